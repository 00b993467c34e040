//! Triangles between the points of a scan that has none.
//!
//! Each point finds its neighbours on the surface alone, as the Delaunay star in its own tangent plane; triangles that
//! all three corners name and that lie in their planes are taken. What lies between them is completed side by side, as a
//! front advances over triangles of the three-dimensional Delaunay triangulation, which need no normals and do not cross
//! each other. Nothing looks farther than a few spacings, so that openings stay open and sheets stay apart.
//!
//! Sources: M. Gopi, S. Krishnan, C. T. Silva, *Surface reconstruction based on lower dimensional localized Delaunay
//! triangulation*, Computer Graphics Forum 19(3), 2000 (DOI 10.1111/1467-8659.00439); D. Cohen-Steiner, F. Da, *A greedy
//! Delaunay-based surface reconstruction algorithm*, The Visual Computer 20, 2004 (DOI 10.1007/s00371-003-0217-z).

mod ball;
mod front;
mod sides;
mod sites;
mod soup;
mod star;

use front::Rule;
use glam::DVec3;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, Result};
use sites::Sites;
use soup::Soup;
use star::Vote;

/// Triangles of a circumradius up to this many spacings are accepted: an opening wider than twice as much stays open.
const WIDEST: f64 = 2.0;
/// Cosine of the angle between a triangle and the planes of its corners up to which it is plain.
const PLAIN: f64 = 0.7;
/// Points that one thread treats in a row; fixed, so that results do not depend on the number of threads.
const CHUNK: usize = 1024;

/// Triangles between `points`, by index.
///
/// `normals` are those of the surface at the points; only their directions matter, not which side they point to, see
/// [`triangulate_oriented`]. Zero or missing ones are found from the neighbours. Triangles are wound so that they look to the side of their corners'
/// normals. Sheets as close as about 1.5 spacings stay apart; openings wider than four spacings stay open, where the
/// spacing is that of the sheet nearby. Points that are not finite or repeat an earlier one get no triangles.
///
/// Every side has at most two triangles and none is folded onto another; at a few vertices sheets may touch, and small
/// holes may be left where the points do not tell how they are connected.
///
/// The same triangles for any order of the points. About 15 us per point and core, 1 kB of memory per point.
///
/// # Errors
/// [`Error::Cancelled`] if `progress` says so, [`Error::Unsupported`] for more than 2^32 - 1 points.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_scan::mesh::triangulate::triangulate;
/// use nurbskin_geometry::progress::Silent;
/// let grid: Vec<DVec3> = (0..30)
///     .map(|k| DVec3::new(f64::from(k % 6), f64::from(k / 6), 0.0))
///     .collect();
/// let triangles = triangulate(&grid, &[DVec3::Z; 30], &Silent)?;
/// assert_eq!(triangles.len(), 2 * 5 * 4);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
pub fn triangulate(
    points: &[DVec3],
    normals: &[DVec3],
    progress: &dyn Progress,
) -> Result<Vec<[u32; 3]>> {
    between(points, normals, false, progress)
}

/// As [`triangulate`], of points whose normals look to one side of the surface, as those of a cleaned scan do: walls that
/// look opposite ways stay apart however close they are, and meet at edges as sharp as ten degrees. Where neighbours in
/// one plane contradict each other only the directions of their normals matter.
///
/// # Errors
/// As [`triangulate`].
pub fn triangulate_oriented(
    points: &[DVec3],
    normals: &[DVec3],
    progress: &dyn Progress,
) -> Result<Vec<[u32; 3]>> {
    between(points, normals, true, progress)
}

fn between(
    points: &[DVec3],
    normals: &[DVec3],
    oriented: bool,
    progress: &dyn Progress,
) -> Result<Vec<[u32; 3]>> {
    if u32::try_from(points.len()).is_err() {
        return Err(Error::Unsupported(format!(
            "{} points are more than the 4 294 967 295 that can be numbered; thin the scan",
            points.len()
        )));
    }
    // 1. The order of coordinates, so that nothing below depends on that of the points.
    let order = in_order(points);
    let sites = Sites::new(points, normals, oriented, &order, progress)?;
    // 2. What each point says of its own neighbourhood.
    let votes = star::votes(&sites, progress)?;
    // 3. What all agree upon and is plain, and what a front adds to it.
    let mut soup = Soup::new(&sites);
    let (plain, doubtful): (Vec<Vote>, Vec<Vote>) = votes
        .into_iter()
        .partition(|vote| vote.count == 3 && plain(&sites, vote.triangle));
    for vote in &plain {
        soup.insert_plain(vote.triangle);
    }
    front::complete(&mut soup, Rule::Delaunay, progress)?;
    // 4. What noise leaves: votes that do not overlap with others, and another front.
    for vote in &doubtful {
        if vote.triangle.iter().all(|&k| !soup.closed(k)) && soup.fits(vote.triangle) {
            soup.insert(vote.triangle);
        }
    }
    progress.check()?;
    front::complete(&mut soup, Rule::Projected, progress)?;
    let back = |t: [u32; 3]| t.map(|k| order[k as usize]);
    Ok(soup.all_wound().map(back).collect())
}

/// Whether a triangle lies in the planes of its corners and a ball through them is empty.
fn plain(sites: &Sites, triangle: [u32; 3]) -> bool {
    let [a, b, c] = triangle.map(|k| sites.points[k as usize]);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let along = |&k: &u32| sites.normals[k as usize].dot(normal).abs() > PLAIN;
    triangle.iter().all(along) && ball::empty_ball(sites, triangle).is_some()
}

/// The indices of the finite points by their coordinates, without repetitions.
fn in_order(points: &[DVec3]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..u32::MAX).take(points.len()).collect();
    order.retain(|&k| points[k as usize].is_finite());
    let key = |k: u32| (points[k as usize] + DVec3::ZERO).to_array();
    order.sort_unstable_by(|&a, &b| {
        let (p, q) = (key(a), key(b));
        p[0].total_cmp(&q[0])
            .then(p[1].total_cmp(&q[1]))
            .then(p[2].total_cmp(&q[2]))
            .then(a.cmp(&b))
    });
    order.dedup_by(|a, b| points[*a as usize] == points[*b as usize]);
    order
}

#[cfg(test)]
mod tests;

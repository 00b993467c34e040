//! Triangulation of a cloud: Delaunay stars in tangent planes, completed by an advancing front.
//!
//! Each point computes its neighbours on the surface alone, as the Delaunay star in its own tangent plane. Triangles
//! that occur in the stars of all three corners and lie in their planes are accepted. A front completes what lies
//! between them, side by side, with triangles of the three-dimensional Delaunay triangulation, which need no normals
//! and do not cross each other. Circumradii are limited to two spacings, so that openings stay open and sheets stay
//! apart.
//!
//! Sources: M. Gopi, S. Krishnan, C. T. Silva, *Surface reconstruction based on lower dimensional localized Delaunay
//! triangulation*, Computer Graphics Forum 19(3), 2000 (DOI 10.1111/1467-8659.00439); D. Cohen-Steiner, F. Da, *A
//! greedy Delaunay-based surface reconstruction algorithm*, The Visual Computer 20, 2004 (DOI
//! 10.1007/s00371-003-0217-z). The separation of sheets is ours.

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

/// Largest circumradius of a triangle, in spacings; openings wider than twice as much stay open. Trial: not recorded.
/// Smaller values leave holes in unevenly sampled surfaces; larger ones close openings and bridge gaps between walls.
const MAX_CIRCUMRADIUS: f64 = 2.0;
/// Cosine of the angle (45°) between the normal of a triangle and those of its corners above which the triangle is
/// plain and needs no front. Trial: 0.8 before, and reduced when the tests of triangulation were written.
const PLAIN_COSINE: f64 = 0.7;
/// Points per parallel task. Guard: fixed, so that results do not depend on the number of threads; large against the
/// overhead of a task.
const SITE_CHUNK: usize = 1024;

/// Triangles between `points`, by index.
///
/// `normals` are those of the surface at the points. Only their directions matter, not their sides (see
/// [`triangulate_oriented`]); zero or missing ones are computed from the neighbours. Triangles are wound so that they
/// look to the side of their corners' normals. Sheets as close as about 1.5 spacings are kept apart, and openings wider
/// than four spacings stay open, in the spacing of the sheet nearby. Points that are not finite or repeat an earlier
/// one get no triangles.
///
/// Every side has at most two triangles, and none is folded onto another. At a few vertices sheets may touch, and small
/// holes may remain where the points do not determine their connections.
///
/// The result does not depend on the order of the points. About 15 us per point and core, 1 kB of memory per point.
///
/// [`Error::Cancelled`] if `progress` is cancelled, [`Error::Unsupported`] for more than 2^32 - 1 points.
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

/// As [`triangulate`], for points with oriented normals, as those of a cleaned scan: walls that look to opposite sides
/// are kept apart at any distance, and meet at edges as sharp as ten degrees. Where neighbours in one plane contradict
/// each other, only the directions of their normals are used.
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
    // 1. Sorted by coordinates, so that nothing below depends on the order of the points.
    let order = in_order(points);
    let sites = Sites::new(points, normals, oriented, &order, progress)?;
    // 2. The Delaunay star of each point.
    let votes = star::votes(&sites, progress)?;
    // 3. The triangles in the stars of all three corners and in their planes, and those that a front adds.
    let mut soup = Soup::new(&sites);
    let (plain, doubtful): (Vec<Vote>, Vec<Vote>) = votes
        .into_iter()
        .partition(|vote| vote.count == 3 && plain(&sites, vote.triangle));
    for vote in &plain {
        soup.insert_plain(vote.triangle);
    }
    front::complete(&mut soup, Rule::Delaunay, progress)?;
    // 4. The gaps that noise leaves: triangles of two stars that overlap no other, and a second front.
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
    let along = |&k: &u32| sites.normals[k as usize].dot(normal).abs() > PLAIN_COSINE;
    triangle.iter().all(along) && ball::empty_ball(sites, triangle).is_some()
}

/// The indices of the finite points, sorted by coordinates, without repetitions.
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

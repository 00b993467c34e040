//! Points that cannot be used are found, counted and named; what remains gets normals, spacing and noise.

use super::neighbours::{NeighbourTable, Neighbours};
use super::noise::{noise_of_grid, noise_of_lines, noise_with_tree};
use super::normals::{line_normals, mesh_normals, orient, plane_normals, principal_axes};
use super::outliers::{meshed, outliers};
use super::parts::Parts;
use super::{GridLayout, Organisation, Reason, Rejected, Scan};
use crate::numeric::statistics::median_in_place;
use crate::progress::Progress;
use crate::{Error, PointGrid, Result};
use glam::DVec3;

/// Neighbours per point that all judgements rest on.
const NEIGHBOURS: usize = 16;
/// Fewer points than this are not searched for outliers: who belongs cannot be told.
const FEWEST_FOR_OUTLIERS: usize = 50;
/// A surface of degree 1 needs 2 x 2 points.
const FEWEST: usize = 4;
/// No length in any unit; squares and cubes of such numbers leave the range of doubles.
const ABSURD: f64 = 1e90;

/// What [`clean`] may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CleanOptions {
    /// Whether outliers are rejected (true).
    pub outliers: bool,
}

impl Default for CleanOptions {
    fn default() -> Self {
        Self { outliers: true }
    }
}

/// The usable points of a scan and what was learnt of them. All lists but `rejected` and `triangles` are in the order
/// of `used`, which ascends.
#[derive(Clone, Debug)]
pub struct CleanScan {
    /// Index in the scan of each used point.
    pub used: Vec<u32>,
    /// The used points.
    pub points: Vec<DVec3>,
    /// The others and why, by ascending index.
    pub rejected: Vec<Rejected>,
    /// Unit normals; neighbours agree on the side, and most look away from the middle of their region.
    pub normals: Vec<DVec3>,
    /// Triangles between used points, by place in `points`: those of a mesh, duplicates merged, without triangles
    /// that lost a corner or their area. Empty for other scans.
    pub triangles: Vec<[u32; 3]>,
    /// The side of the square that one point stands for, in the median: on a square grid its step.
    pub spacing: f64,
    /// Standard deviation of the noise along the normal; zero where there are too few points to tell.
    pub noise: f64,
    /// The separate pieces of the scan.
    pub parts: Parts,
}

impl CleanScan {
    /// Number of points rejected for this reason.
    #[must_use]
    pub fn rejected_for(&self, reason: Reason) -> usize {
        self.rejected.iter().filter(|r| r.reason == reason).count()
    }
}

/// Finds the usable points of `scan`.
///
/// 1. Points that are not finite, and exact duplicates of earlier ones, are rejected; the pole lines of a grid are
///    not duplicates.
/// 2. A point is an outlier if it is isolated (farther from its 16 nearest neighbours than they are from theirs) and
///    off the surface of its neighbours, or so isolated that no surface can be meant.
/// 3. Normals, spacing, noise and separate parts are found among the others.
///
/// The result does not depend on the order of the points, except that of duplicates the first is used.
/// O(n log n), about 10 us per point.
///
/// # Errors
/// [`Error::Invalid`] if too few points are left, or all of them lie on one spot or one line: these are not
/// surfaces, whereas a flat scan is. [`Error::Cancelled`] if `progress` says so.
///
/// ```
/// use nurbskin::DVec3;
/// use nurbskin::progress::Silent;
/// use nurbskin::scan::{Reason, Scan, clean::{CleanOptions, clean}};
/// let mut points: Vec<DVec3> = (0..400)
///     .map(|k| DVec3::new(f64::from(k % 20), f64::from(k / 20), 0.0))
///     .collect();
/// points.push(points[3]);
/// points.push(DVec3::NAN);
/// points.push(DVec3::new(4.5, 4.5, 60.0));
/// let scan = Scan { points, ..Scan::default() };
/// let clean = clean(&scan, &CleanOptions::default(), &Silent)?;
/// assert_eq!(clean.points.len(), 400);
/// let why: Vec<Reason> = clean.rejected.iter().map(|r| r.reason).collect();
/// assert_eq!(why, [Reason::Duplicate, Reason::NonFinite, Reason::Outlier]);
/// assert!((clean.spacing - 1.0).abs() < 0.05);
/// # Ok::<(), nurbskin::Error>(())
/// ```
pub fn clean(scan: &Scan, options: &CleanOptions, progress: &dyn Progress) -> Result<CleanScan> {
    if u32::try_from(scan.points.len()).is_err() {
        return Err(Error::Unsupported(format!(
            "{} points are more than the 4 294 967 295 that can be numbered; thin the scan",
            scan.points.len()
        )));
    }
    let mut rejected = Vec::new();
    // 1. `order` lists usable points by coordinates, so that nothing below depends on their order in the file.
    let Distinct {
        mut order,
        merged,
        copies,
    } = distinct(scan, &mut rejected);
    refuse_few(scan, order.len())?;
    progress.check()?;
    // 2. Outliers.
    let mut points = gather(&scan.points, &order);
    let mut tree = Neighbours::new(&points);
    let mut table = tree.table(NEIGHBOURS);
    progress.check()?;
    if options.outliers && points.len() >= FEWEST_FOR_OUTLIERS {
        let outlying = outliers(
            &points,
            &table,
            &meshed(&scan.organisation, &merged, &order),
        );
        if outlying.iter().any(|&out| out) {
            for (&index, _) in order.iter().zip(&outlying).filter(|(_, out)| **out) {
                let index = index as usize;
                let reason = Reason::Outlier;
                rejected.push(Rejected { index, reason });
            }
            let mut out = outlying.into_iter();
            order.retain(|_| !out.next().unwrap_or(false));
            refuse_few(scan, order.len())?;
            points = gather(&scan.points, &order);
            tree = Neighbours::new(&points);
            table = tree.table(NEIGHBOURS);
        }
    }
    refuse_line(&points)?;
    progress.check()?;
    // 3. Everything else, still in the order of coordinates.
    let mut place = vec![u32::MAX; scan.points.len()];
    for (k, &index) in (0_u32..).zip(&order) {
        place[index as usize] = k;
    }
    let triangles = triangles_between(&scan.organisation, &merged, &place, &points);
    let copies: Vec<(u32, u32)> = copies
        .into_iter()
        .map(|k| (k, place[merged[k as usize] as usize]))
        .filter(|&(_, place)| place != u32::MAX)
        .collect();
    for &(k, at) in &copies {
        place[k as usize] = at;
    }
    let spacing = spacing(&points, &table);
    let normals = normals(scan, &order, &place, &points, &table, &triangles);
    progress.check()?;
    let facing = (!triangles.is_empty()).then_some(normals.as_slice());
    let noise = noise(
        scan,
        &place,
        &points,
        &normals,
        noise_with_tree(&points, &tree, facing),
    );
    progress.check()?;
    let parts = if triangles.is_empty() {
        Parts::by_distance(&points, spacing)
    } else {
        Parts::by_triangles(&points, &triangles, &tree)
    };
    rejected.sort_by_key(|r| r.index);
    let sorted = Sorted {
        order,
        copies,
        points,
        normals,
        triangles,
        parts,
    };
    Ok(sorted.in_file_order(spacing, noise, rejected))
}

/// What was found, in the order of coordinates.
struct Sorted {
    order: Vec<u32>,
    /// Index in the file of points that repeat another, and its place.
    copies: Vec<(u32, u32)>,
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    parts: Parts,
}

impl Sorted {
    fn in_file_order(self, spacing: f64, noise: f64, rejected: Vec<Rejected>) -> CleanScan {
        let mut used: Vec<(u32, u32)> =
            self.order.into_iter().zip(0..).chain(self.copies).collect();
        used.sort_unstable();
        let by_index: Vec<u32> = used.iter().map(|&(_, place)| place).collect();
        let mut to = vec![0_u32; self.points.len()];
        for (k, &from) in (0_u32..).zip(&by_index) {
            to[from as usize] = k;
        }
        CleanScan {
            used: used.iter().map(|&(index, _)| index).collect(),
            points: gather(&self.points, &by_index),
            rejected,
            normals: gather(&self.normals, &by_index),
            triangles: self
                .triangles
                .iter()
                .map(|t| t.map(|k| to[k as usize]))
                .collect(),
            spacing,
            noise,
            parts: self.parts.reordered(&by_index),
        }
    }
}

fn gather<T: Copy>(items: &[T], order: &[u32]) -> Vec<T> {
    order.iter().map(|&k| items[k as usize]).collect()
}

/// The finite, different points of a scan.
struct Distinct {
    /// Their indices, by coordinates.
    order: Vec<u32>,
    /// For every point of the scan the index of the first one with its coordinates.
    merged: Vec<u32>,
    /// Points of pole lines that repeat an earlier one and are used all the same.
    copies: Vec<u32>,
}

/// Sorts out the finite, different points; the others go to `rejected`.
fn distinct(scan: &Scan, rejected: &mut Vec<Rejected>) -> Distinct {
    let points = &scan.points;
    let mut merged: Vec<u32> = (0..u32::MAX).take(points.len()).collect();
    let mut order = merged.clone();
    order.retain(|&k| {
        let usable =
            points[k as usize].abs().max_element() <= ABSURD && !points[k as usize].is_nan();
        if !usable {
            rejected.push(Rejected {
                index: k as usize,
                reason: Reason::NonFinite,
            });
        }
        usable
    });
    // Adding zero makes -0 and 0 the same.
    let key = |k: u32| (points[k as usize] + DVec3::ZERO).to_array();
    order.sort_unstable_by(|&a, &b| {
        let (p, q) = (key(a), key(b));
        p[0].total_cmp(&q[0])
            .then(p[1].total_cmp(&q[1]))
            .then(p[2].total_cmp(&q[2]))
            .then(a.cmp(&b))
    });
    let pole = pole_cells(scan);
    let mut first = None;
    let mut copies = Vec::new();
    order.retain(|&k| match first {
        Some(f) if points[f as usize] == points[k as usize] => {
            merged[k as usize] = f;
            if pole[k as usize] {
                copies.push(k);
            } else {
                rejected.push(Rejected {
                    index: k as usize,
                    reason: Reason::Duplicate,
                });
            }
            false
        }
        _ => {
            first = Some(k);
            true
        }
    });
    Distinct {
        order,
        merged,
        copies,
    }
}

/// Whether each point of a grid lies on a pole line: an end of u, or the first or last row, all of whose cells are one
/// point.
fn pole_cells(scan: &Scan) -> Vec<bool> {
    let mut pole = vec![false; scan.points.len()];
    let Organisation::Grid(grid) = &scan.organisation else {
        return pole;
    };
    let [m, n] = [grid.count_u, grid.count_v];
    if m.checked_mul(n) != Some(grid.cells.len()) || m == 0 || n == 0 {
        return pole;
    }
    let lines: [Vec<usize>; 4] = [
        (0..n).map(|j| j * m).collect(),
        (0..n).map(|j| j * m + m - 1).collect(),
        (0..m).collect(),
        (0..m).map(|i| (n - 1) * m + i).collect(),
    ];
    for line in lines {
        let at: Option<Vec<usize>> = line
            .iter()
            .map(|&cell| grid.cells[cell].map(|k| k as usize))
            .collect();
        let Some(at) = at.filter(|at| at.iter().all(|&k| k < scan.points.len())) else {
            continue;
        };
        if at.iter().all(|&k| scan.points[k] == scan.points[at[0]]) {
            for k in at {
                pole[k] = true;
            }
        }
    }
    pole
}

fn refuse_few(scan: &Scan, left: usize) -> Result<()> {
    if scan.points.is_empty() {
        return Err(Error::invalid("the scan has no points"));
    }
    if left == 1 && scan.points.len() > 1 {
        return Err(Error::invalid(
            "all points are at the same spot; a line or a single spot is not a surface",
        ));
    }
    if left < FEWEST {
        return Err(Error::Invalid(format!(
            "only {left} different usable points of {}; a surface needs at least {FEWEST}",
            scan.points.len()
        )));
    }
    Ok(())
}

/// Refuses points on one line: the second principal axis is then nothing but rounding, of which single precision
/// leaves 6e-8 of the coordinates.
fn refuse_line(points: &[DVec3]) -> Result<()> {
    let (_, [_, (across, _), (along, _)]) = principal_axes(points.iter().copied());
    if across.max(0.0).sqrt() <= 1e-6 * along.sqrt() {
        return Err(Error::invalid(
            "all points lie on one line; a line or a single spot is not a surface",
        ));
    }
    Ok(())
}

/// The step of the square grid on which the 12th neighbour (or the last, of fewer) would be as far, in the median:
/// a disc of that radius holds 12.5 points on average between the 12th and the 13th.
fn spacing(points: &[DVec3], table: &NeighbourTable) -> f64 {
    let count = table.count().min(12);
    let mut radii: Vec<f64> = (0..points.len())
        .filter_map(|k| Some(points[k].distance(points[*table.of(k)[..count].last()? as usize])))
        .collect();
    median_in_place(&mut radii) * (std::f64::consts::PI / (count as f64 + 0.5)).sqrt()
}

/// The mesh's triangles by place among the used points, without those that lost a corner or have no area.
fn triangles_between(
    organisation: &Organisation,
    merged: &[u32],
    place: &[u32],
    points: &[DVec3],
) -> Vec<[u32; 3]> {
    let Organisation::Mesh(triangles) = organisation else {
        return Vec::new();
    };
    let at = |k: u32| {
        merged
            .get(k as usize)
            .map_or(u32::MAX, |&m| place[m as usize])
    };
    triangles
        .iter()
        .map(|t| t.map(at))
        .filter(|&[a, b, c]| a != u32::MAX && b != u32::MAX && c != u32::MAX)
        .filter(|t| {
            let [a, b, c] = t.map(|k| points[k as usize]);
            (b - a).cross(c - a) != DVec3::ZERO
        })
        .collect()
}

/// Normals of local planes. Which side is outside is said by the mesh, the order of the points or the file, in this
/// order, and otherwise found. Mesh and order also correct a plane that goes astray: a mesh knows its own surface
/// better than neighbours that may lie on another wall, and dense scan lines far apart leave the neighbours of a
/// point on one line.
fn normals(
    scan: &Scan,
    order: &[u32],
    place: &[u32],
    points: &[DVec3],
    table: &NeighbourTable,
    triangles: &[[u32; 3]],
) -> Vec<DVec3> {
    let mut normals = plane_normals(points, table, NEIGHBOURS);
    let lines = lines(scan, place);
    // `trust`: by how much of a cosine a plane may differ before it is overruled.
    let (given, trust) = if winding_agrees(points, triangles) {
        (mesh_normals(points, triangles), 1.0)
    } else if !lines.is_empty() {
        (line_normals(points, &lines), 0.5)
    } else if let Some(file) = scan.normals.as_ref().filter(|n| n.len() == place.len()) {
        (gather(file, order), 0.0)
    } else {
        orient(points, &mut normals, table);
        return normals;
    };
    let known = |k: usize| given[k].is_finite() && given[k].length_squared() > 0.25;
    for k in 0..points.len() {
        if known(k) && normals[k].dot(given[k]).abs() < trust {
            normals[k] = given[k];
        }
        let near = table.of(k).iter().map(|&j| j as usize);
        if let Some(side) = std::iter::once(k).chain(near).find(|&j| known(j))
            && normals[k].dot(given[side]) < 0.0
        {
            normals[k] = -normals[k];
        }
    }
    normals
}

/// The lines of constant v of an ordered scan, as places among the used points; none for other scans.
fn lines(scan: &Scan, place: &[u32]) -> Vec<Vec<Option<u32>>> {
    let used = |k: usize| place.get(k).copied().filter(|&p| p != u32::MAX);
    match &scan.organisation {
        Organisation::Grid(grid) if grid.count_u > 0 => grid
            .cells
            .chunks(grid.count_u)
            .map(|row| {
                row.iter()
                    .map(|c| used(c.as_ref().copied()? as usize))
                    .collect()
            })
            .collect(),
        Organisation::Rows(rows) => {
            let mut start = 0_usize;
            rows.iter()
                .map(|&length| {
                    let end = start.saturating_add(length).min(place.len());
                    let line = (start.min(end)..end).map(used).collect();
                    start = end;
                    line
                })
                .collect()
        }
        _ => Vec::new(),
    }
}

/// Whether the triangles around most vertices face the same way.
fn winding_agrees(points: &[DVec3], triangles: &[[u32; 3]]) -> bool {
    let mut sums = vec![(DVec3::ZERO, 0.0); points.len()];
    for t in triangles {
        let [a, b, c] = t.map(|k| points[k as usize]);
        let area = (b - a).cross(c - a);
        for &k in t {
            sums[k as usize].0 += area;
            sums[k as usize].1 += area.length();
        }
    }
    let met = sums.iter().filter(|(_, total)| *total > 0.0);
    // Half of the area cancels only where a vertex is a needle or its triangles disagree.
    let (mut count, mut disagree) = (0_usize, 0_usize);
    for (sum, total) in met {
        count += 1;
        disagree += usize::from(sum.length() < 0.3 * total);
    }
    count > 0 && disagree * 20 < count
}

/// The noise by the cloud's measure, or by that of the lines of ordered points where it is smaller: coarse sampling
/// disturbs the former much more.
fn noise(scan: &Scan, place: &[u32], points: &[DVec3], normals: &[DVec3], cloud: f64) -> f64 {
    let lines = lines(scan, place);
    match &scan.organisation {
        Organisation::Grid(grid) => cloud.min(grid_noise(grid, scan, &lines, points, normals)),
        Organisation::Rows(_) => {
            let mut whole = Vec::new();
            for line in lines {
                runs(line.into_iter(), &mut whole);
            }
            noise_of_lines(points, normals, &whole).map_or(cloud, |lines| cloud.min(lines))
        }
        Organisation::Unordered | Organisation::Mesh(_) => cloud,
    }
}

fn grid_noise(
    grid: &GridLayout,
    scan: &Scan,
    lines: &[Vec<Option<u32>>],
    points: &[DVec3],
    normals: &[DVec3],
) -> f64 {
    let [m, n] = [grid.count_u, grid.count_v];
    if m.checked_mul(n) != Some(grid.cells.len()) {
        return f64::INFINITY;
    }
    let cell = |i: usize, j: usize| lines[j][i];
    let complete: Option<Vec<DVec3>> = grid
        .cells
        .iter()
        .map(|c| c.and_then(|index| scan.points.get(index as usize).copied()))
        .collect();
    if let Some(all) = complete.filter(|_| lines.iter().flatten().all(Option::is_some))
        && let Ok(all) = PointGrid::new(m, n, all)
    {
        return noise_of_grid(&all, [false, false]);
    }
    let (mut rows, mut columns) = (Vec::new(), Vec::new());
    for j in 0..n {
        runs((0..m).map(|i| cell(i, j)), &mut rows);
    }
    for i in 0..m {
        runs((0..n).map(|j| cell(i, j)), &mut columns);
    }
    let along = |lines: &[Vec<usize>]| noise_of_lines(points, normals, lines);
    let known = [along(&rows), along(&columns)].into_iter().flatten();
    known.fold(f64::INFINITY, f64::min)
}

/// Splits a line where points are missing.
fn runs(line: impl Iterator<Item = Option<u32>>, lines: &mut Vec<Vec<usize>>) {
    let mut run = Vec::new();
    for place in line {
        match place {
            Some(place) => run.push(place as usize),
            None => lines.push(std::mem::take(&mut run)),
        }
    }
    lines.push(run);
}

#[cfg(test)]
#[path = "clean_tests.rs"]
mod tests;

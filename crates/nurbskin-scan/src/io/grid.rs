//! Grids of scanners: which cells hold a point, and which only say that there is none.

use crate::{GridLayout, Organisation, Scan};
use glam::DVec3;
use nurbskin_geometry::unit::grouped;

/// What the point `0 0 0` in a cell means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Zero {
    /// A point like any other.
    Point,
    /// No point.
    Missing,
    /// No point, unless the points around it say otherwise.
    Judged,
}

/// Zeros nearer to a neighbour than so many steps of the grid belong to the surface.
const NEAR: f64 = 4.0;

/// Makes the points of `scan`, which are the cells of a `count_u` x `count_v` grid with u fastest, a grid without the
/// points that only stand for empty cells: those whose coordinates are all NaN and, as `zero` says, `0 0 0`.
///
/// More points than 2^32 or other than `count_u * count_v` leave the scan without order.
pub(super) fn organise(scan: &mut Scan, count_u: usize, count_v: usize, zero: Zero) {
    let count = scan.points.len();
    if count_u.checked_mul(count_v) != Some(count) || u32::try_from(count).is_err() {
        return;
    }
    let zeros = match zero {
        Zero::Point => Vec::new(),
        Zero::Missing => scan.points.iter().map(|p| *p == DVec3::ZERO).collect(),
        Zero::Judged => judge(&scan.points, count_u, count_v),
    };
    let missing: Vec<bool> = scan
        .points
        .iter()
        .enumerate()
        .map(|(k, p)| p.is_nan_mask().all() || zeros.get(k) == Some(&true))
        .collect();
    let mut next = 0;
    let cells: Vec<Option<u32>> = missing
        .iter()
        .map(|&missing| {
            (!missing).then(|| {
                next += 1;
                next - 1
            })
        })
        .collect();
    retain(&mut scan.points, &missing);
    scan.records = std::mem::take(&mut scan.records).without(&missing);
    if let Some(normals) = &mut scan.normals {
        retain(normals, &missing);
    }
    let empty = count - scan.points.len();
    if empty > 0 {
        let zeros = zeros.iter().filter(|&&zero| zero).count();
        let how = if zeros > 0 {
            format!(" ({} of them are written as 0 0 0)", grouped(zeros))
        } else {
            String::new()
        };
        scan.warnings.push(format!(
            "{} of the {} cells of the {count_u} x {count_v} grid are empty{how}",
            grouped(empty),
            grouped(count)
        ));
    }
    scan.organisation = Organisation::Grid(GridLayout {
        count_u,
        count_v,
        cells,
    });
}

/// Removes the missing points.
pub(super) fn retain(points: &mut Vec<DVec3>, missing: &[bool]) {
    let mut missing = missing.iter();
    points.retain(|_| missing.next() == Some(&false));
}

/// Which cells are `0 0 0` and stand for no point. A zero is a point where a neighbour is as near as neighbours are,
/// and in the first and last lines where all zeros of the grid fill whole lines: the poles of a sphere about the origin.
pub(super) fn judge(points: &[DVec3], count_u: usize, count_v: usize) -> Vec<bool> {
    let is_zero: Vec<bool> = points.iter().map(|p| *p == DVec3::ZERO).collect();
    let total = is_zero.iter().filter(|&&zero| zero).count();
    if total == 0 || count_u == 0 || count_v == 0 {
        return Vec::new();
    }
    // 1. Whole lines at the ends.
    let line = |along_u: bool, at: usize| {
        let length = if along_u { count_u } else { count_v };
        (0..length).map(move |k| {
            if along_u {
                at * count_u + k
            } else {
                k * count_u + at
            }
        })
    };
    for (along_u, last) in [(true, count_v - 1), (false, count_u - 1)] {
        let filled: usize = [0, last]
            .into_iter()
            .filter(|&at| line(along_u, at).all(|k| is_zero[k]))
            .map(|at| line(along_u, at).count())
            .sum();
        if filled == total {
            return Vec::new();
        }
    }
    // 2. The step of the grid, from points side by side.
    let good = |k: usize| {
        points
            .get(k)
            .filter(|p| p.is_finite() && **p != DVec3::ZERO)
    };
    let mut steps: Vec<f64> = (0..points.len())
        .filter(|k| k % count_u + 1 < count_u)
        .filter_map(|k| Some(good(k)?.distance(*good(k + 1)?)))
        .filter(|step| step.is_finite())
        .collect();
    let middle = steps.len() / 2;
    if steps.is_empty() {
        return is_zero;
    }
    let (_, &mut step, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    // 3. Zeros beside points that are no farther than some steps.
    (0..points.len())
        .map(|k| {
            let [i, j] = [k % count_u, k / count_u];
            let near = |i: Option<usize>, j: Option<usize>| {
                let (Some(i), Some(j)) = (i, j) else {
                    return false;
                };
                i < count_u
                    && j < count_v
                    && good(j * count_u + i).is_some_and(|p| p.length() <= NEAR * step)
            };
            is_zero[k]
                && !(near(i.checked_sub(1), Some(j))
                    || near(Some(i + 1), Some(j))
                    || near(Some(i), j.checked_sub(1))
                    || near(Some(i), Some(j + 1)))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A 5 x 4 grid with step 1 whose first corner is `corner`.
    fn grid(corner: DVec3) -> Vec<DVec3> {
        (0..20)
            .map(|k| corner + DVec3::new(f64::from(k % 5), f64::from(k / 5), 0.0))
            .collect()
    }

    fn cells(points: Vec<DVec3>, zero: Zero) -> Scan {
        let mut scan = Scan {
            points,
            ..Scan::default()
        };
        organise(&mut scan, 5, 4, zero);
        scan
    }

    #[test]
    fn zeros_far_from_their_neighbours_are_no_points() {
        let mut far = grid(DVec3::new(0.0, 0.0, 900.0));
        far[7] = DVec3::ZERO;
        far[8] = DVec3::ZERO;
        far[19] = DVec3::NAN;
        let scan = cells(far.clone(), Zero::Judged);
        assert_eq!((scan.points.len(), scan.warnings.len()), (17, 1));
        let Organisation::Grid(layout) = &scan.organisation else {
            panic!()
        };
        assert_eq!((layout.empty(), layout.cells[9]), (3, Some(7)));
        assert_eq!(scan.records.empty().collect::<Vec<_>>(), [7, 8, 19]);
        assert_eq!(scan.records.of(7), 9);
        assert_eq!(cells(far, Zero::Point).points.len(), 19);
        // A corner at the origin is a point.
        let corner = cells(grid(DVec3::ZERO), Zero::Judged);
        assert_eq!((corner.points.len(), corner.warnings.len()), (20, 0));
        assert_eq!(cells(grid(DVec3::ZERO), Zero::Missing).points.len(), 19);
    }

    #[test]
    fn a_pole_at_the_origin_is_a_line_of_points() {
        let mut points = grid(DVec3::new(3.0, 4.0, 50.0));
        points[15..].fill(DVec3::ZERO);
        assert_eq!(cells(points.clone(), Zero::Judged).points.len(), 20);
        points[3] = DVec3::ZERO;
        assert_eq!(cells(points, Zero::Judged).points.len(), 14);
    }
}

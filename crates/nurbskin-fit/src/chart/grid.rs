//! Ordered scans: an m x n array, or scan lines of different length resampled to one.
//!
//! The rows of the array run along u, and v counts the rows. Rows of different length are resampled by local cubics
//! (Lagrange's formula over four points by chord length), whose error is O(h⁴). A direction is closed if the step from
//! its last line to its first is about as long as the others and leads on:
//!
//! ```text
//! gap(n - 1, 0) <= 2 median gap(j, j + 1)     and     sum (p_0 - p_last) · (p_1 - p_0) > 0
//! ```
//!
//! An end of u whose points coincide is a pole.

use super::Topology;
use glam::DVec3;
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::{Error, PointGrid, Result};
use nurbskin_scan::{Organisation, Scan};

/// An ordered scan as a complete m x n array.
#[derive(Clone, Debug)]
pub struct OrderedScan {
    /// The array: rows run along u, and v counts the rows.
    pub grid: PointGrid,
    /// The closed directions and the poles.
    pub topology: Topology,
    /// Whether rows of different length were resampled to a common count. The array then holds points of curves through
    /// the rows instead of the scan's own points.
    pub resampled: bool,
    /// Whether u and v were exchanged, so that the closed direction is v.
    pub transposed: bool,
    /// The usable points of the scan and their places in the array.
    pub places: Vec<GridPlace>,
    /// A description, for the user.
    pub reason: String,
}

/// The place of a point of the scan in an ordered array.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridPlace {
    /// Index of the point in the scan.
    pub index: usize,
    /// Lines along u and v, counted from zero; fractions where rows were resampled.
    pub lines: [f64; 2],
}

/// Largest gap of a row, in its median gap, above which the row has a hole rather than uneven spacing. Trial: not
/// recorded.
const ROW_HOLE_RATIO: f64 = 4.0;

/// Largest median distance between points at the same part of neighbouring rows, in distances of the rows. Trial: not
/// recorded. A larger one makes arrays of rows that start at different places, a smaller one refuses slanted rows.
const MAX_ROW_OFFSET: f64 = 3.0;
/// Pairs of rows that this is tested for. Guard: bounds the time; the median needs no more.
const SAMPLED_ROWS: usize = 100;
/// Points of each row that this is tested for, its first one not counted. Guard: bounds the time; the median needs no
/// more.
const SAMPLED_POINTS: usize = 24;
/// Points of the next row that each is compared with. Guard: bounds the time; of longer rows every k-th point is taken
/// and the distance between these allowed for.
const MAX_COMPARED_POINTS: usize = 2000;
/// Distance at which points of an array coincide, as a share of its extent. Guard: above the rounding of coordinates in
/// double precision, below any spacing.
const COINCIDENCE: f64 = 1e-9;
/// Largest gap from the last line back to the first, in median gaps between neighbouring lines, of a closed direction.
/// Trial: not recorded. A larger one closes sectors with a narrow opening, a smaller one leaves uneven turns open.
const MAX_CLOSING_GAP: f64 = 2.0;
/// Fewest lines of a closed direction. Guard: a periodic cubic needs four.
const MIN_CLOSED_LINES: usize = 4;

/// The scan as an m x n array.
///
/// A complete grid is taken as it is. Rows of different length (scan lines, or a grid with empty cells at the ends of
/// its rows) are resampled to the length of the longest row, by local cubics. `topology` gives the closed directions;
/// without it, [`grid_topology`] finds them.
///
/// # Errors
/// [`Error::Unsupported`] for a scan without order, with holes inside its rows, with rows of fewer than two points, or
/// with rows whose corresponding points lie far apart.
pub fn order(scan: &Scan, topology: Option<Topology>) -> Result<OrderedScan> {
    let indices = rows_of(scan)?;
    let rows: Vec<Vec<DVec3>> = indices
        .iter()
        .map(|row| row.iter().map(|&k| scan.points[k]).collect())
        .collect();
    if matches!(scan.organisation, Organisation::Rows(_)) && !run_beside(&rows) {
        return Err(Error::Unsupported(
            "the rows do not run beside each other: they start at different places, or in turns at either end"
                .into(),
        ));
    }
    let count_u = rows.iter().map(Vec::len).max().unwrap_or(0);
    let even = rows.iter().all(|row| row.len() == count_u);
    let mut points = Vec::with_capacity(count_u * rows.len());
    for (j, row) in rows.iter().enumerate() {
        if even {
            points.extend_from_slice(row);
        } else {
            points.extend(resample(row, count_u, j)?);
        }
    }
    let mut grid = PointGrid::new(count_u, rows.len(), points)?;
    let found = grid_topology(&grid);
    let mut reason = match topology {
        Some(asked) => format!("{}, as asked", asked.name()),
        None => found.reason.clone(),
    };
    let transposed = topology.is_none() && found.transposed;
    if transposed {
        grid = grid.transposed();
    }
    let topology = topology.unwrap_or(found.topology);
    // A file may repeat the first line at the end of a closed direction.
    for (closed, along_u) in topology.closed().into_iter().zip([true, false]) {
        if closed && repeats_first_line(&grid, along_u) {
            let [m, n] = grid.counts();
            let keep_u: Vec<usize> = (0..if along_u { m - 1 } else { m }).collect();
            let keep_v: Vec<usize> = (0..if along_u { n } else { n - 1 }).collect();
            grid = grid.select(&keep_u, &keep_v)?;
            reason.push_str("; the last line repeats the first and is left out");
        }
    }
    let place = |(j, row): (usize, &Vec<usize>)| {
        let stretch = (count_u - 1) as f64 / (row.len() - 1) as f64;
        let place = move |(i, &index): (usize, &usize)| {
            let [a, b] = [i as f64 * stretch, j as f64];
            GridPlace {
                index,
                lines: if transposed { [b, a] } else { [a, b] },
            }
        };
        row.iter().enumerate().map(place).collect::<Vec<_>>()
    };
    let places = indices.iter().enumerate().flat_map(place).collect();
    Ok(OrderedScan {
        grid,
        topology,
        resampled: !even,
        transposed,
        places,
        reason,
    })
}

/// Whether points at the same part of neighbouring rows are, in the median, about as close to each other as the rows,
/// or as consecutive points of a row. O(sampled points x compared points).
fn run_beside(rows: &[Vec<DVec3>]) -> bool {
    let step = rows.len().div_ceil(SAMPLED_ROWS).max(1);
    let pairs = rows.windows(2).step_by(step);
    let mut times: Vec<f64> = pairs
        .flat_map(|pair| {
            let (row, next) = (&pair[0], &pair[1]);
            let some = next.len().div_ceil(MAX_COMPARED_POINTS).max(1);
            (0..=SAMPLED_POINTS).filter_map(move |k| {
                let point = row[k * (row.len() - 1) / SAMPLED_POINTS];
                let at = k * (next.len() - 1) / SAMPLED_POINTS;
                let beside = next[at.saturating_sub(1)..(at + 2).min(next.len())].windows(2);
                let along = beside.map(|w| w[0].distance(w[1])).fold(0.0, f64::max);
                let distances = next
                    .iter()
                    .step_by(some)
                    .map(|&other| point.distance(other));
                let nearest = distances.fold(f64::INFINITY, f64::min);
                let least = nearest.max(some as f64 * along);
                (least > 0.0).then(|| point.distance(next[at]) / least)
            })
        })
        .collect();
    times.is_empty() || median_in_place(&mut times) <= MAX_ROW_OFFSET
}

/// The points of each scan line, without empty cells and non-finite points.
fn rows_of(scan: &Scan) -> Result<Vec<Vec<usize>>> {
    let usable = |k: &usize| scan.points.get(*k).is_some_and(|p| p.is_finite());
    let rows: Vec<Vec<usize>> = match &scan.organisation {
        Organisation::Grid(layout) => layout
            .cells
            .chunks(layout.count_u.max(1))
            .map(|cells| {
                cells
                    .iter()
                    .flatten()
                    .map(|&k| k as usize)
                    .filter(usable)
                    .collect()
            })
            .collect(),
        Organisation::Rows(lengths) => lengths
            .iter()
            .scan(0, |first, &length| {
                *first += length;
                Some((*first - length..*first).filter(usable).collect())
            })
            .collect(),
        Organisation::Unordered | Organisation::Mesh(_) => {
            return Err(Error::Unsupported(
                "the points have no order: say `--grid MxN` if the file lists N rows of M points"
                    .into(),
            ));
        }
    };
    match rows.iter().position(|row| row.len() < 2) {
        Some(j) => Err(Error::Unsupported(format!(
            "row {} of the grid has fewer than two points",
            j + 1
        ))),
        None => Ok(rows),
    }
}

/// `count` points, evenly spaced in the row's own index, so that the scanner's spacing along the row is kept; the end
/// points stay. Between two points runs the cubic through the four nearest points over chord length, with an error of
/// the fourth order of the spacing.
fn resample(row: &[DVec3], count: usize, index: usize) -> Result<Vec<DVec3>> {
    if row.len() == count {
        return Ok(row.to_vec());
    }
    // A repeated point would divide by zero below.
    let mut row = row.to_vec();
    row.dedup();
    if row.len() < 2 {
        return Err(Error::Unsupported(format!(
            "row {} of the grid is a single spot",
            index + 1
        )));
    }
    let mut gaps: Vec<f64> = row.windows(2).map(|w| w[0].distance(w[1])).collect();
    let mut lengths = vec![0.0];
    lengths.extend(gaps.iter().scan(0.0, |sum, gap| {
        *sum += gap;
        Some(*sum)
    }));
    let largest = gaps.iter().copied().fold(0.0, f64::max);
    if largest > ROW_HOLE_RATIO * median_in_place(&mut gaps) {
        return Err(Error::Unsupported(format!(
            "row {} of the grid has a hole",
            index + 1
        )));
    }
    let last = row.len() - 1;
    Ok((0..count)
        .map(|i| {
            let place = (i * last) as f64 / (count - 1) as f64;
            let k = (i * last / (count - 1)).min(last - 1);
            let s = lengths[k] + (place - k as f64) * (lengths[k + 1] - lengths[k]);
            let first = k.saturating_sub(1).min((last + 1).saturating_sub(4));
            let stencil = first..(first + 4).min(last + 1);
            stencil
                .clone()
                .map(|a| {
                    let weight = stencil
                        .clone()
                        .filter(|&b| b != a)
                        .map(|b| (s - lengths[b]) / (lengths[a] - lengths[b]));
                    row[a] * weight.product::<f64>()
                })
                .sum()
        })
        .collect())
}

/// The result of [`grid_topology`].
#[derive(Clone, Debug)]
pub struct GridTopology {
    /// The topology, after exchanging u and v where `transposed`.
    pub topology: Topology,
    /// Whether u and v must be exchanged, because only u is closed.
    pub transposed: bool,
    /// Why, for the user.
    pub reason: String,
}

/// Closed directions of an ordered array, and whether its ends are poles.
///
/// A direction is closed if the gap from the last line back to the first is no wider than twice the median gap between
/// neighbouring lines and continues in the same direction. An end is a pole if all its points coincide to 1e-9 of the
/// array's extent.
#[must_use]
pub fn grid_topology(grid: &PointGrid) -> GridTopology {
    let [lo, hi] = grid.bounding_box();
    let size = lo.distance(hi);
    let transposed_grid = grid.transposed();
    let (closed_u, closed_v) = (closes(&transposed_grid, size), closes(grid, size));
    let poles = |grid: &PointGrid| {
        let pole = |i: usize| {
            grid.column(i)
                .all(|p| p.distance(grid.point(i, 0)) <= COINCIDENCE * size)
        };
        pole(0) && pole(grid.count_u() - 1)
    };
    let found = |topology, transposed, reason: &str| GridTopology {
        topology,
        transposed,
        reason: reason.to_owned(),
    };
    match (closed_u, closed_v) {
        (true, true) => found(Topology::Torus, false, "closed in u and v"),
        (false, true) if poles(grid) => found(
            Topology::Sphere,
            false,
            "closed in v, with a pole at both ends of u",
        ),
        (false, true) => found(
            Topology::Tube,
            false,
            "closed in v: the last row joins the first",
        ),
        (true, false) if poles(&transposed_grid) => found(
            Topology::Sphere,
            true,
            "closed in v, with a pole at both ends of u, once u and v are exchanged",
        ),
        (true, false) => found(
            Topology::Tube,
            true,
            "closed in v once u and v are exchanged: the last column joins the first",
        ),
        (false, false) => found(Topology::Disk, false, "open in u and v"),
    }
}

/// Whether the rows of the grid close on themselves.
fn closes(grid: &PointGrid, size: f64) -> bool {
    let n = grid.count_v();
    if n < MIN_CLOSED_LINES {
        return false;
    }
    let gap = |a: usize, b: usize| {
        grid.row(a)
            .iter()
            .zip(grid.row(b))
            .map(|(p, q)| p.distance(*q))
            .sum::<f64>()
            / grid.count_u() as f64
    };
    let mut gaps: Vec<f64> = (1..n).map(|j| gap(j - 1, j)).collect();
    let closing = gap(n - 1, 0);
    let median = median_in_place(&mut gaps);
    if closing > MAX_CLOSING_GAP * median {
        return false;
    }
    // A repeated first row closes by definition; otherwise the step back must continue the sequence, not turn round.
    let last = if closing <= COINCIDENCE * size {
        n - 2
    } else {
        n - 1
    };
    let forward: f64 = (0..grid.count_u())
        .map(|i| (grid.point(i, 0) - grid.point(i, last)).dot(grid.point(i, 1) - grid.point(i, 0)))
        .sum();
    forward > 0.0
}

/// Whether the last line along u (or v) has the same points as the first, to 1e-9 of the extent.
fn repeats_first_line(grid: &PointGrid, along_u: bool) -> bool {
    let [lo, hi] = grid.bounding_box();
    let near = |p: DVec3, q: DVec3| p.distance(q) <= COINCIDENCE * lo.distance(hi);
    let [m, n] = grid.counts();
    if along_u {
        m > 2 && (0..n).all(|j| near(grid.point(0, j), grid.point(m - 1, j)))
    } else {
        n > 2 && (0..m).all(|i| near(grid.point(i, 0), grid.point(i, n - 1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn pot(m: usize, n: usize, turn: f64) -> PointGrid {
        PointGrid::from_fn(m, n, |i, j| {
            let (s, t) = (i as f64, turn * j as f64 / n as f64);
            DVec3::new((3.0 + s.sin()) * t.cos(), (3.0 + s.sin()) * t.sin(), s)
        })
        .unwrap()
    }

    #[test]
    fn closed_and_open_directions_are_found() {
        assert_eq!(grid_topology(&pot(9, 24, TAU)).topology, Topology::Tube);
        assert_eq!(
            grid_topology(&pot(9, 24, 0.8 * TAU)).topology,
            Topology::Disk
        );
        let found = grid_topology(&pot(9, 24, TAU).transposed());
        assert_eq!((found.topology, found.transposed), (Topology::Tube, true));
        let sphere = PointGrid::from_fn(11, 24, |i, j| {
            let (s, t) = (TAU / 2.0 * i as f64 / 10.0, TAU * j as f64 / 24.0);
            DVec3::new(s.sin() * t.cos(), s.sin() * t.sin(), s.cos())
        });
        assert_eq!(grid_topology(&sphere.unwrap()).topology, Topology::Sphere);
        let torus = PointGrid::from_fn(20, 30, |i, j| {
            let (s, t) = (TAU * i as f64 / 20.0, TAU * j as f64 / 30.0);
            DVec3::new(
                (5.0 + s.cos()) * t.cos(),
                (5.0 + s.cos()) * t.sin(),
                s.sin(),
            )
        });
        assert_eq!(grid_topology(&torus.unwrap()).topology, Topology::Torus);
    }

    #[test]
    fn a_sheet_folded_back_onto_its_start_is_not_closed() {
        let sheet = PointGrid::from_fn(5, 12, |i, j| {
            let t = j as f64 / 11.0;
            DVec3::new(
                i as f64,
                if t < 0.5 { t } else { 1.0 - t } * 10.0,
                (t > 0.5) as u8 as f64 * 0.1,
            )
        });
        assert_eq!(grid_topology(&sheet.unwrap()).topology, Topology::Disk);
    }

    #[test]
    fn rows_of_different_length_are_brought_to_one() {
        let row = |count: usize, j: usize| {
            (0..count).map(move |i| {
                let s = i as f64 / (count - 1) as f64;
                DVec3::new(s, j as f64, s * s)
            })
        };
        let scan = Scan {
            points: (0..6).flat_map(|j| row(20 + j % 2, j)).collect(),
            organisation: Organisation::Rows((0..6).map(|j| 20 + j % 2).collect()),
            ..Scan::default()
        };
        let ordered = order(&scan, None).unwrap();
        assert!(ordered.resampled);
        assert_eq!(ordered.grid.counts(), [21, 6]);
        // Every resampled point lies on the parabola to the fourth order of the spacing.
        let worst = ordered
            .grid
            .points()
            .iter()
            .map(|p| (p.z - p.x * p.x).abs())
            .fold(0.0, f64::max);
        assert!(worst < 1e-5, "{worst}");
    }

    #[test]
    fn a_repeated_last_row_is_left_out() {
        let grid = pot(9, 24, TAU);
        let mut points = grid.points().to_vec();
        points.extend_from_slice(grid.row(0));
        let layout = nurbskin_scan::GridLayout::complete(9, 25).unwrap();
        let scan = Scan {
            points,
            organisation: Organisation::Grid(layout),
            ..Scan::default()
        };
        let ordered = order(&scan, None).unwrap();
        assert_eq!(ordered.topology, Topology::Tube);
        assert_eq!(ordered.grid, grid);
    }

    #[test]
    fn rows_that_do_not_run_beside_each_other_are_no_array() {
        // Rings about an axis, whose starts turn by this angle from one to the next.
        let rings = |turn: f64| {
            let mut points = Vec::new();
            let mut lengths = Vec::new();
            for j in 0..12_u32 {
                let count = 100 + 7 * j;
                lengths.push(count as usize);
                points.extend((0..count).map(|i| {
                    let angle = TAU * f64::from(i) / f64::from(count) + turn * f64::from(j);
                    DVec3::new(angle.cos(), angle.sin(), 0.2 * f64::from(j))
                }));
            }
            Scan {
                points,
                organisation: Organisation::Rows(lengths),
                ..Scan::default()
            }
        };
        assert!(order(&rings(0.0), None).is_ok());
        assert!(order(&rings(0.3), None).is_ok());
        let refused = order(&rings(2.0), None).unwrap_err();
        assert!(matches!(refused, Error::Unsupported(_)), "{refused}");
    }
}

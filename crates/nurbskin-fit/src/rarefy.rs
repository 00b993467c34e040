//! Logical rarefaction (Pal & Ballav 2007, section 4.2).
//!
//! Along a line of the ordered grid, a point is kept when its normal has turned by more than the threshold `D_T`
//! against the normal of the point kept before it: few points where the surface is flat, many where it bends (figure
//! 5). The paper leaves open how the selections of different rows become one m x n array. Here a whole grid line is
//! kept as soon as the turning in *any* row (or another [`Statistic`] of the rows) exceeds the threshold. With the
//! maximum, every single row obeys the paper's rule. The selection is the Cartesian product of the lines kept in both
//! directions.
//!
//! The turning of the normal is of first order in the spacing, the error of a cubic of fourth order: the rule bounds no
//! distance. [`crate::fit::rarefied`] keeps lines until *every* point is within a tolerance.

use crate::chart::Topology;
use glam::DVec3;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::{Error, PointGrid, Result};

/// Fewest lines that remain along a direction. Derived: degree + 1 of a bicubic surface.
const MIN_LINES: usize = 4;
/// Relative width of the bracket at which the bisection over thresholds ends. Guard: no count shall rest on rounding.
const BISECTION_TOLERANCE: f64 = 1e-6;
/// Threshold in degrees below which the bisection ends, since its lower end is negative. Guard: normals do not tell
/// smaller angles.
const BISECTION_FLOOR: f64 = 1e-9;

/// The thresholds `D_T` of the angle between normals, in degrees, per direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// Threshold for walking along u, which selects lines of constant u.
    pub u: f64,
    /// Threshold for walking along v, which selects lines of constant v.
    pub v: f64,
}

impl Thresholds {
    /// The same threshold in both directions, in degrees.
    #[must_use]
    pub fn both(degrees: f64) -> Self {
        Self {
            u: degrees,
            v: degrees,
        }
    }
}

/// How the turnings of all rows, between the line kept last and the current line, are combined.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Statistic {
    /// The largest: every row obeys the paper's rule.
    #[default]
    Max,
    /// This quantile (0..=1), robust to a few wild rows.
    Quantile(f64),
    /// The mean.
    Mean,
}

/// The rule of a rarefaction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rule {
    /// The thresholds `D_T`.
    pub thresholds: Thresholds,
    /// The statistic of the rows that is compared with the threshold.
    pub statistic: Statistic,
    /// Fewest lines of constant u and of constant v to keep, if the grid has as many: degree + 1, so that a surface of
    /// that degree can interpolate them.
    pub at_least: [usize; 2],
}

impl Rule {
    /// The paper's rule: the largest turning is compared, and the bicubic minimum of four lines is kept.
    #[must_use]
    pub fn new(thresholds: Thresholds) -> Self {
        Self {
            thresholds,
            statistic: Statistic::Max,
            at_least: [MIN_LINES; 2],
        }
    }
}

/// The grid lines that remain, as ascending indices into the lines of the full grid.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Kept {
    /// Indices i of the lines of constant u.
    pub u: Vec<usize>,
    /// Indices j of the lines of constant v.
    pub v: Vec<usize>,
}

impl Kept {
    /// Number of lines `[m, n]`.
    #[must_use]
    pub fn counts(&self) -> [usize; 2] {
        [self.u.len(), self.v.len()]
    }
    /// Number of points kept, m n.
    #[must_use]
    pub fn point_count(&self) -> usize {
        self.u.len() * self.v.len()
    }
    /// The kept points of `grid`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a line does not exist in `grid`.
    pub fn select(&self, grid: &PointGrid) -> Result<PointGrid> {
        grid.select(&self.u, &self.v)
    }
}

/// The unit normals `N_{i,j}` of an ordered grid, u fastest: the direction of the product of the central differences
/// along u and v. Differences wrap around where `topology` closes a direction and are one-sided at open ends. At a
/// pole (both ends of u of a [`Topology::Sphere`], and any end line whose points all coincide) every point has the
/// area-weighted mean normal of the fan of triangles between the pole and the next line. Where the differences are
/// parallel or vanish there is no normal, and the zero vector stands for it. O(m n).
///
/// ```
/// use nurbskin_geometry::{DVec3, PointGrid};
/// use nurbskin_fit::chart::Topology;
/// use nurbskin_fit::rarefy;
/// let plane = PointGrid::from_fn(3, 4, |i, j| DVec3::new(i as f64, j as f64, 5.0))?;
/// assert!(rarefy::normals(&plane, Topology::Disk).iter().all(|n| n.distance(DVec3::Z) < 1e-15));
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[must_use]
pub fn normals(grid: &PointGrid, topology: Topology) -> Vec<DVec3> {
    let [m, n] = grid.counts();
    let closed = topology.closed();
    // Differences are scaled so that products neither overflow nor underflow.
    let [low, high] = grid.bounding_box();
    let scale = (0.5 * high - 0.5 * low).max_element();
    let scale = if scale > 0.0 { 1.0 / scale } else { 1.0 };
    let at = |i: usize, j: usize| (grid.point(i, j) - low) * scale;
    let neighbours = |k: usize, count: usize, closed: bool| {
        if closed {
            ((k + count - 1) % count, (k + 1) % count)
        } else {
            (k.saturating_sub(1), (k + 1).min(count - 1))
        }
    };
    let mut normals = Vec::with_capacity(m * n);
    for j in 0..n {
        let (before, after) = neighbours(j, n, closed[1]);
        for i in 0..m {
            let (left, right) = neighbours(i, m, closed[0]);
            let along_u = at(right, j) - at(left, j);
            let along_v = at(i, after) - at(i, before);
            normals.push(along_u.cross(along_v).normalize_or_zero());
        }
    }
    let sphere = topology == Topology::Sphere;
    let mut fan = |pole: &[(usize, usize)], ring: &[(usize, usize)], closed: bool, sign: f64| {
        let centre = pole.iter().map(|&(i, j)| at(i, j)).sum::<DVec3>() / pole.len() as f64;
        let pairs = if closed { ring.len() } else { ring.len() - 1 };
        let sum = (0..pairs).fold(DVec3::ZERO, |sum, k| {
            let (a, b) = (ring[k], ring[(k + 1) % ring.len()]);
            sum + (at(a.0, a.1) - centre).cross(at(b.0, b.1) - centre)
        });
        for &(i, j) in pole {
            normals[j * m + i] = (sign * sum).normalize_or_zero();
        }
    };
    // The fan around an end of u runs along v and vice versa, with opposite orientation.
    if m > 1 && !closed[0] {
        let line = |i: usize| (0..n).map(|j| (i, j)).collect::<Vec<_>>();
        for (end, next, sign) in [(0, 1, 1.0), (m - 1, m - 2, -1.0)] {
            if sphere || (n > 1 && grid.column(end).all(|p| p == grid.point(end, 0))) {
                fan(&line(end), &line(next), closed[1], sign);
            }
        }
    }
    if n > 1 && !closed[1] {
        let line = |j: usize| (0..m).map(|i| (i, j)).collect::<Vec<_>>();
        for (end, next, sign) in [(0, 1, -1.0), (n - 1, n - 2, 1.0)] {
            if m > 1 && grid.row(end).iter().all(|&p| p == grid.point(0, end)) {
                fan(&line(end), &line(next), closed[0], sign);
            }
        }
    }
    normals
}

/// The lines of `grid` that the paper's rule keeps, with the bicubic minimum of four lines per direction: see
/// [`rarefy_by`].
///
/// ```
/// use nurbskin_geometry::{DVec3, PointGrid};
/// use nurbskin_fit::chart::Topology;
/// use nurbskin_fit::rarefy::{Thresholds, rarefy};
/// // A quarter of a cylinder: straight along v, turning by 1 degree per line along u.
/// let grid = PointGrid::from_fn(91, 20, |i, j| {
///     let (sin, cos) = (i as f64).to_radians().sin_cos();
///     DVec3::new(cos, sin, j as f64)
/// })?;
/// let kept = rarefy(&grid, Topology::Disk, Thresholds::both(14.4));
/// assert_eq!(kept.u, [0, 15, 30, 45, 60, 75, 90]);
/// assert_eq!(kept.v.len(), 4);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[must_use]
pub fn rarefy(grid: &PointGrid, topology: Topology, thresholds: Thresholds) -> Kept {
    rarefy_by(grid, topology, Rule::new(thresholds))
}

/// The lines of `grid` that `rule` keeps.
///
/// In each direction, line 0 is kept. The next line kept is the first whose turning against the line kept last, by
/// `rule.statistic` over all rows, *exceeds* the threshold; the last line of an open direction is kept too. A point
/// without a normal has no turning. A threshold near 0 keeps every line that turns at all, a negative one all lines. If
/// fewer than `rule.at_least` lines remain, the middle line of the widest gap is added until there are enough (or all).
/// O(m n) after the normals.
///
/// Source: Pal & Ballav 2007, section 4.2 and figure 5.
#[must_use]
pub fn rarefy_by(grid: &PointGrid, topology: Topology, rule: Rule) -> Kept {
    let turning = Turning::new(grid, topology);
    let thresholds = [rule.thresholds.u, rule.thresholds.v];
    let [u, v] = [0, 1].map(|direction| {
        let walk = turning.walk(direction, thresholds[direction], rule.statistic);
        turning.filled(direction, walk.kept, rule.at_least[direction])
    });
    Kept { u, v }
}

/// The thresholds at which exactly `counts` = \[m, n\] lines remain, with those lines: found by bisection, with
/// [`Statistic::Max`], between thresholds that differ by at least a millionth, so that no count depends on rounding.
///
/// # Errors
/// [`Error::Invalid`] if a count is below 2 or above the number of lines. [`Error::NoSolution`], with the nearest
/// counts that exist, if no threshold of the bisection leaves exactly these counts: on a surface of revolution all
/// steps around the axis are equal, and 100 lines become 100, 50, 34, 25 ... but never 30. [`to_counts_filled`] adds
/// lines then.
pub fn to_counts(
    grid: &PointGrid,
    topology: Topology,
    counts: [usize; 2],
) -> Result<(Thresholds, Kept)> {
    let found = bisect(grid, topology, counts)?;
    let missed: Vec<String> = (0..2)
        .filter(|&direction| found[direction].kept.len() != counts[direction])
        .map(|direction| {
            let search = &found[direction];
            let above = search
                .above
                .map_or(String::new(), |above| format!(" and {above}"));
            format!(
                "exactly {} lines along {} (the nearest counts are {}{above})",
                counts[direction],
                ["u", "v"][direction],
                search.kept.len(),
            )
        })
        .collect();
    if !missed.is_empty() {
        return Err(Error::NoSolution(format!(
            "no threshold keeps {}: ask for a count that exists",
            missed.join(" and ")
        )));
    }
    let [u, v] = found;
    Ok((
        Thresholds {
            u: u.threshold,
            v: v.threshold,
        },
        Kept {
            u: u.kept,
            v: v.kept,
        },
    ))
}

/// As [`to_counts`], but if no threshold leaves exactly these counts, the smallest threshold that leaves fewer is
/// taken, and lines are added in the middle of the gaps with the largest turning until the count is met.
///
/// # Errors
/// [`Error::Invalid`] if a count is below 2 or above the number of lines.
pub fn to_counts_filled(
    grid: &PointGrid,
    topology: Topology,
    counts: [usize; 2],
) -> Result<(Thresholds, Kept)> {
    let turning = Turning::new(grid, topology);
    let [u, v] = bisect(grid, topology, counts)?;
    let thresholds = Thresholds {
        u: u.threshold,
        v: v.threshold,
    };
    let u = turning.filled_by_turning(0, u.kept, counts[0]);
    let v = turning.filled_by_turning(1, v.kept, counts[1]);
    Ok((thresholds, Kept { u, v }))
}

/// The result of a bisection over the threshold of one direction.
struct Search {
    /// The threshold found, or the smallest tried that keeps too few lines.
    threshold: f64,
    /// The lines it keeps.
    kept: Vec<usize>,
    /// The count at the next smaller threshold, if `kept` has too few lines.
    above: Option<usize>,
}

fn bisect(grid: &PointGrid, topology: Topology, counts: [usize; 2]) -> Result<[Search; 2]> {
    for (direction, &count) in counts.iter().enumerate() {
        let lines = grid.counts()[direction];
        if count < 2 || count > lines {
            return Err(Error::invalid(format!(
                "{count} lines along {} cannot remain of {lines}: ask for 2 to {lines}",
                ["u", "v"][direction]
            )));
        }
    }
    let turning = Turning::new(grid, topology);
    Ok([0, 1].map(|direction| {
        let wanted = counts[direction];
        let walk = |threshold: f64| turning.walk(direction, threshold, Statistic::Max).kept;
        // A negative threshold keeps all lines, 180 degrees the fewest.
        let (mut low, mut high) = (-1.0, 180.0);
        let mut few = walk(high);
        let mut many = grid.counts()[direction];
        if many == wanted {
            return Search {
                threshold: low,
                kept: (0..many).collect(),
                above: None,
            };
        }
        while few.len() < wanted && high - low > BISECTION_TOLERANCE * high {
            let middle = 0.5 * (low + high);
            let kept = walk(middle);
            if kept.len() > wanted {
                (low, many) = (middle, kept.len());
            } else {
                (high, few) = (middle, kept);
            }
            if low < 0.0 && high < BISECTION_FLOOR {
                break;
            }
        }
        Search {
            threshold: high,
            above: (few.len() < wanted).then_some(many),
            kept: few,
        }
    }))
}

/// The normals of a grid, ready for walks along both directions.
pub(crate) struct Turning {
    /// Per direction, the normals of one line after the other.
    lines: [Vec<DVec3>; 2],
    counts: [usize; 2],
    closed: [bool; 2],
}

/// A walk with its threshold.
pub(crate) struct Walk {
    /// The lines kept.
    pub(crate) kept: Vec<usize>,
    /// The largest turning, in degrees, that did not exceed the threshold: below it, other lines are kept. Zero if
    /// none.
    pub(crate) next_threshold: f64,
}

impl Turning {
    pub(crate) fn new(grid: &PointGrid, topology: Topology) -> Self {
        let [m, n] = grid.counts();
        let along_v = normals(grid, topology);
        let along_u = (0..m * n).map(|k| along_v[(k % n) * m + k / n]).collect();
        Self {
            lines: [along_u, along_v],
            counts: [m, n],
            closed: topology.closed(),
        }
    }

    /// The turning in degrees from line `a` to line `b` of a direction.
    fn between(&self, direction: usize, a: usize, b: usize, statistic: Statistic) -> f64 {
        let width = self.counts[1 - direction];
        let line = |k: usize| &self.lines[direction][k * width..(k + 1) * width];
        // |N_a - N_b| = 2 sin(angle / 2) keeps its accuracy for small angles, unlike the cosine.
        let chords = line(a).iter().zip(line(b)).map(|(a, b)| {
            if *a == DVec3::ZERO || *b == DVec3::ZERO {
                0.0
            } else {
                a.distance_squared(*b)
            }
        });
        let angle = |squared: f64| 2.0 * math::asin((0.5 * squared.sqrt()).min(1.0)).to_degrees();
        match statistic {
            Statistic::Max => angle(chords.fold(0.0, f64::max)),
            Statistic::Mean => chords.map(angle).sum::<f64>() / width as f64,
            Statistic::Quantile(fraction) => {
                angle(quantile_in_place(&mut chords.collect::<Vec<_>>(), fraction))
            }
        }
    }

    pub(crate) fn walk(&self, direction: usize, threshold: f64, statistic: Statistic) -> Walk {
        let count = self.counts[direction];
        let mut kept = vec![0];
        let (mut last, mut next_threshold) = (0, 0.0_f64);
        for k in 1..count {
            let turned = self.between(direction, last, k, statistic);
            if turned > threshold {
                kept.push(k);
                last = k;
            } else {
                next_threshold = next_threshold.max(turned);
            }
        }
        if !self.closed[direction] && last != count - 1 {
            kept.push(count - 1);
        }
        Walk {
            kept,
            next_threshold,
        }
    }

    /// `kept` with the middle of the widest gap added until there are `at_least` lines or all.
    pub(crate) fn filled(&self, direction: usize, kept: Vec<usize>, at_least: usize) -> Vec<usize> {
        self.fill(direction, kept, at_least, |a, b| (b - a) as f64)
    }

    /// `kept` with the middle of the gap of the largest turning added until there are `count` lines.
    fn filled_by_turning(&self, direction: usize, kept: Vec<usize>, count: usize) -> Vec<usize> {
        let lines = self.counts[direction];
        self.fill(direction, kept, count, |a, b| {
            self.between(direction, a, b % lines, Statistic::Max)
        })
    }

    fn fill(
        &self,
        direction: usize,
        mut kept: Vec<usize>,
        count: usize,
        size: impl Fn(usize, usize) -> f64,
    ) -> Vec<usize> {
        let lines = self.counts[direction];
        while kept.len() < count.min(lines) {
            let beyond = self.closed[direction].then_some(lines);
            let ends = kept[1..].iter().copied().chain(beyond);
            let widest = kept
                .iter()
                .zip(ends)
                .filter(|&(&a, b)| b - a > 1)
                .map(|(&a, b)| (a, b, size(a, b)))
                // The first of equal gaps, so that the result is deterministic.
                .reduce(|best, gap| {
                    if (gap.2, gap.1 - gap.0) > (best.2, best.1 - best.0) {
                        gap
                    } else {
                        best
                    }
                });
            let Some((a, b, _)) = widest else { break };
            let middle = a + (b - a) / 2;
            kept.insert(kept.partition_point(|&k| k < middle), middle);
        }
        kept
    }
}

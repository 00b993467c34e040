//! Surface elements: the least-squares plane, the spacing and the reach of the neighbourhood of each point.
//!
//! Plane: the eigenvector of the smallest eigenvalue of the covariance of a point p and its 16 nearest neighbours
//! `q_j`. Spacing: h = d √(π / (k + ½)), with d the distance of the k-th neighbour, k = 12: on a square grid a disc of
//! that radius holds k + ½ neighbours. Reach: `m = mean |q_j - p|`; asymmetry: `|mean (q_j - p)| / m`, about 0.1
//! within a sheet and 0.6 at its rim. On a dense scan line the plane is undetermined, and the nearest points beside
//! the line replace the neighbours. Between two close walls the heights above the plane divide into two groups, and
//! the neighbours on the point's own wall remain.
//!
//! Sources: Hoppe et al. 1992 (DOI 10.1145/133994.134011) for the plane; N. Otsu, *A threshold selection method from
//! gray-level histograms*, 1979 (DOI 10.1109/TSMC.1979.4310076) for the two groups; K. Pearson 1916 for the bimodality
//! test. The treatment of scan lines is ours.

use crate::normals::{plane_axes, plane_through};
use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::parallel::{each, gather, pairs_of_blocks};
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::progress::{Progress, Silent};
use nurbskin_geometry::spatial::morton::spatial_order;
use nurbskin_geometry::spatial::neighbours::Scratch;
use nurbskin_geometry::spatial::neighbours::{Nearest, NeighbourTable, Neighbours};
use std::f64::consts::PI;

/// Neighbours per point on which all decisions of cleaning rest. Trial: not recorded; 16 to 24 neighbours are usual for
/// normals by principal components. Fewer give noisy planes, more blur edges and reach across thin walls.
pub(super) const NEIGHBOURS: usize = 16;
/// Rank of the neighbour whose distance gives the local spacing. Trial: not recorded. Nearer neighbours scatter more,
/// farther ones reach over rims.
const SPACING_NEIGHBOUR: usize = 12;
/// Points between two tests for cancellation. Guard: a fraction of a second of work.
const ELEMENT_BATCH: usize = 1 << 18;
/// Points per parallel task. Guard: large against the overhead of a task, small against a batch.
const TASK_SIZE: usize = 2048;
/// Ratio of the two larger variances of a neighbourhood below which its points lie on one line. At the rim of an evenly
/// sampled sheet it is 0.28, at a corner 0.2. Trial: not recorded. A larger value takes corners for lines; a smaller
/// one misses bent or noisy lines.
pub(crate) const LINE_VARIANCE_RATIO: f64 = 0.08;
/// Nearest neighbours that are tested for a line where the scan has lines. Trial: not recorded. Fewer than
/// [`NEIGHBOURS`], so that bent and less dense lines are found.
pub(crate) const LINE_NEIGHBOURS: usize = 8;
/// Stride through 4 × 16 nearest neighbours in which a line is looked for where noise hides it among the nearest.
/// Trial: not recorded. A larger stride would take a wire or a strip eight points wide for a line.
const LINE_STRIDE: usize = 4;
/// Squared cosine of the angle to a line (27°) below which a point lies beside it. Trial: not recorded. A larger value
/// takes points of the line itself; a smaller one misses the next line.
const BESIDE_LINE_COSINE_SQUARED: f64 = 0.8;
/// Distance from a line, in standard deviations of its own points across it, above which a point lies beside the line.
/// Derived: for normal noise two of its points are that far apart once in 2000 times.
const OFF_LINE_DEVIATIONS: f64 = 5.0;
/// Leaves of the search tree that are visited for points beside a line. Guard: bounds the time of a search; points on a
/// line farther from the next one keep their neighbours.
const BESIDE_SEARCH_LEAVES: usize = 1000;
/// Neighbours along the line among the 16; the others lie beside it. Trial: not recorded. They hold the plane in the
/// direction of the line.
const NEIGHBOURS_ALONG_LINE: usize = 4;
/// Least squared distance of those along the line, in the median squared distance of those beside it (half as far).
/// Trial: not recorded. Nearer ones would not hold the plane in that direction.
const ALONG_DISTANCE_SQUARED: f64 = 0.25;
/// Ratio of the two smaller variances of a neighbourhood above which two sheets are looked for. Trial: not recorded. A
/// smaller ratio costs time, a larger one misses sheets that are close together.
const THICK_VARIANCE_RATIO: f64 = 0.02;
/// The same ratio above which the sheets are so far apart that the plane through all points may lie across them: the
/// plane of the nearest points is then tried as well. Trial: not recorded.
const MIXED_VARIANCE_RATIO: f64 = 0.06;
/// Nearest neighbours through which that plane is laid. Trial: not recorded. They may all lie on the point's own sheet
/// where the other neighbours do not.
const NEAREST_PLANE_POINTS: usize = 7;
/// Neighbours that are divided into two sheets, at most 64 (one bit each). Trial: not recorded. Three times
/// [`NEIGHBOURS`]: noise divides fewer points by chance.
const TWO_SHEET_NEIGHBOURS: usize = 48;
/// Share of the variance of the heights between the two sheets above which they are accepted. Without a second sheet it
/// is 0.64 (2/π) for normal noise and 0.75 for evenly spread heights. Trial: not recorded. A smaller share divides
/// noisy sheets; a larger one leaves close walls together.
const TWO_SHEET_VARIANCE: f64 = 0.88;
/// The same share among the 16 nearest neighbours above which more neighbours are examined. Trial: not recorded.
const LIKELY_SHEET_VARIANCE: f64 = 0.85;
/// Share of the range of the heights that must be empty between the sheets for the same test. Trial: noise of one sheet
/// meets both conditions together at one point in a hundred.
const LIKELY_SHEET_GAP: f64 = 0.35;
/// Share of the variance between two sheets below which no better normal is looked for. Trial: not recorded. Just above
/// the 0.64 of normal noise.
const MIN_SHEET_VARIANCE: f64 = 0.65;
/// Least bimodality coefficient (skewness² + 1) / kurtosis of heights that may belong to two sheets: where sheets are
/// expected, and elsewhere. It is 1 for two heights and 5/9 = 0.56 for evenly spread ones. Trial: not recorded. A
/// larger threshold misses sheets, a smaller one costs time.
const BIMODALITY_THRESHOLDS: [f64; 2] = [0.0, 0.65];
/// One point in this many is tested with the first of these thresholds. Trial: not recorded. It finds regions with two
/// sheets at a sixteenth of the cost.
const CLOSE_LOOK_STRIDE: usize = 16;
/// Points in spatial order after one with two sheets that are tested with the first threshold as well. Trial: not
/// recorded.
const CLOSE_LOOK_RUN: usize = 128;
/// Rounds in which the common normal of two sheets is improved. Trial: not recorded.
const SHEET_NORMAL_ROUNDS: usize = 2;
/// Fewest neighbours on the point's own sheet for a division to be accepted. Trial: not recorded. A plane takes three;
/// with few more it follows the noise.
const MIN_OWN_SHEET_POINTS: u32 = 6;

/// The local frame of a point: plane, spacing and extent of its neighbourhood.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Element {
    /// Unit normal of the least-squares plane (Hoppe et al. 1992, DOI 10.1145/133994.134011), of either sign.
    pub(crate) normal: DVec3,
    /// Step of the square grid on which the 12th neighbour would be as far: a disc of that radius holds 12.5 points on
    /// average between the 12th and the 13th.
    pub(super) spacing: f64,
    /// Mean distance to the neighbours.
    pub(crate) reach: f64,
    /// Distance to the mean of the neighbours, in reaches: about 0.1 within a sheet, 0.6 at its rim.
    pub(super) one_sided: f64,
    /// Distance to the next line if the nearest points lie on one line; infinite if there is no other line; zero if
    /// they do not lie on a line. On scans with lines, the test uses the 8 nearest points, or 16, or every 4th of 64;
    /// on others 16.
    pub(crate) gap: f64,
}

/// The elements of all points, and the neighbours from which they are computed: the 16 nearest; for points on a line,
/// the nearest beside the line and a few along it; between two sheets, the nearest on the point's own sheet by the
/// normals of the file or by height.
#[derive(Debug)]
pub(crate) struct Elements {
    pub(crate) of: Vec<Element>,
    pub(super) table: NeighbourTable,
    /// Whether the scan has dense lines.
    lined: bool,
    /// Whether the normals are oriented by the file.
    pub(super) faced: bool,
}

impl Elements {
    /// Computes the elements of the points of a tree in spatial order; `lined` if the scan has dense lines. Advances
    /// `progress` by half the number of points. O(n), about 1.8 us per point.
    pub(super) fn new(tree: &Neighbours, lined: bool, progress: &dyn Progress) -> Result<Self> {
        let total = tree.len();
        let count = NEIGHBOURS.min(total.saturating_sub(1));
        let mut rows = vec![0_u32; count * total];
        let mut of = vec![Element::default(); total];
        let batches = rows
            .chunks_mut((ELEMENT_BATCH * count).max(1))
            .zip(of.chunks_mut(ELEMENT_BATCH));
        for (batch, (rows, of)) in batches.enumerate() {
            progress.check()?;
            pairs_of_blocks(rows, TASK_SIZE * count, of, TASK_SIZE, |chunk, rows, of| {
                let start = batch * ELEMENT_BATCH + chunk * TASK_SIZE;
                let half = of.len() as u64 / 2;
                let mut out = rows.chunks_exact_mut(count).zip(of.iter_mut());
                let mut scratch = Scratch::default();
                let mut more = Nearest::default();
                let mut watch = Watch::default();
                tree.search_range(start..start + out.len(), count, &mut scratch, |k, near| {
                    if let Some((row, element)) = out.next() {
                        watch.next();
                        *element =
                            examine(tree, k, near, lined, &|_| true, &mut watch, &mut more, row);
                    }
                });
                progress.advance(half);
            });
        }
        let table = NeighbourTable::from_rows(count, rows);
        Ok(Self {
            of,
            table,
            lined,
            faced: false,
        })
    }

    /// The elements of every `step`-th point, under the assumption that the scan has lines; without a table of
    /// neighbours.
    pub(super) fn some(tree: &Neighbours, step: usize) -> Vec<Element> {
        let count = NEIGHBOURS.min(tree.len().saturating_sub(1));
        each(tree.len().div_ceil(step), |k| {
            let place = k * step;
            let (mut near, mut more) = (Nearest::default(), Nearest::default());
            let other = |j: u32| j as usize != place;
            tree.search(tree.sorted_points()[place], count, &mut near, other);
            let (watch, row) = (&mut Watch::close(), &mut vec![0; count]);
            examine(tree, place, &near, true, &|_| true, watch, &mut more, row)
        })
    }

    /// Computes the elements of the points near rejected (dead) ones again, without these. O(dead).
    pub(super) fn without(&mut self, tree: &Neighbours, dead: &[bool]) {
        let count = self.table.count();
        let (mut near, mut more) = (Nearest::default(), Nearest::default());
        for k in 0..self.of.len() {
            if dead[k] || !self.table.of(k).iter().any(|&j| dead[j as usize]) {
                continue;
            }
            let keep = |j: u32| !dead[j as usize];
            let other = |j: u32| j as usize != k && keep(j);
            tree.search(tree.sorted_points()[k], count, &mut near, other);
            if near.items.len() == count {
                let (watch, row) = (&mut Watch::close(), self.table.of_mut(k));
                self.of[k] = examine(tree, k, &near, self.lined, &keep, watch, &mut more, row);
            }
        }
    }
}

/// Schedule of the test for two sheets along the points of a task, consecutive in spatial order. One point in 16, and
/// the points after one with two sheets, are tested with the lower threshold; the others only if their heights are
/// clearly bimodal.
#[derive(Debug, Default)]
struct Watch {
    since_probe: usize,
    left: usize,
}

impl Watch {
    fn close() -> Self {
        Self {
            since_probe: 0,
            left: 1,
        }
    }
    fn next(&mut self) {
        self.left = self.left.saturating_sub(1);
        self.since_probe = (self.since_probe + 1) % CLOSE_LOOK_STRIDE;
    }
    /// Least bimodality coefficient for the full test.
    fn least_peaked(&self) -> f64 {
        if self.left > 0 || self.since_probe == 0 {
            BIMODALITY_THRESHOLDS[0]
        } else {
            BIMODALITY_THRESHOLDS[1]
        }
    }
    fn met(&mut self) {
        self.left = CLOSE_LOOK_RUN;
    }
}

/// A dense line through a point and its nearest neighbours.
struct DenseLine {
    direction: DVec3,
    /// The larger of the two variances across the line.
    variance: f64,
    /// Distance between consecutive points.
    step: f64,
}

impl DenseLine {
    /// The line through the offsets `around`, whose variances are `values`; `None` if they do not lie on a line. The
    /// neighbourhood holds `count` points within the distance `within`.
    fn through(around: &[DVec3], values: [f64; 3], within: f64, count: usize) -> Option<Self> {
        if values[1] >= LINE_VARIANCE_RATIO * values[2] {
            return None;
        }
        let (_, axes) = plane_axes(around.iter().copied());
        Some(Self {
            direction: axes[2],
            variance: values[1],
            step: 2.0 * within / (count as f64 + 1.0),
        })
    }

    /// The line through every 4th of 64 neighbours, for noise as wide as the distance of the nearest points.
    fn farther(
        tree: &Neighbours,
        point: DVec3,
        other: &dyn Fn(u32) -> bool,
        more: &mut Nearest,
    ) -> Option<Self> {
        let count = LINE_STRIDE * NEIGHBOURS;
        tree.search(point, count, more, other);
        let last = more.items.last().filter(|_| more.items.len() == count)?;
        let within = last.0.sqrt();
        let mut around = [DVec3::ZERO; NEIGHBOURS];
        let some = more.indices().skip(LINE_STRIDE - 1).step_by(LINE_STRIDE);
        for (cell, j) in around.iter_mut().zip(some) {
            *cell = tree.sorted_points()[j as usize] - point;
        }
        let (values, _) = plane_through(&around);
        Self::through(&around, values, within, count)
    }
}

/// Computes the element of a point, and its row of neighbours, from its nearest points.
fn examine(
    tree: &Neighbours,
    k: usize,
    near: &Nearest,
    lined: bool,
    keep: &dyn Fn(u32) -> bool,
    watch: &mut Watch,
    more: &mut Nearest,
    row: &mut [u32],
) -> Element {
    let points = tree.sorted_points();
    let point = points[k];
    for (cell, index) in row.iter_mut().zip(near.indices()) {
        *cell = index;
    }
    let mut around = [DVec3::ZERO; NEIGHBOURS];
    let around = &mut around[..row.len().min(NEIGHBOURS)];
    offsets(points, point, row, around);
    let (mut values, mut normal) = plane_through(around);
    let mut spacing = spacing_of(near);
    let other = |j: u32| j as usize != k && keep(j);
    // 1. Neighbours on one line do not determine the plane: replace them by points beside the line.
    let mut gap = 0.0;
    let mut line = None;
    if row.len() == NEIGHBOURS {
        let farthest = |count: usize| near.items[count - 1].0.sqrt();
        if lined {
            let (few, _) = plane_through(&around[..LINE_NEIGHBOURS]);
            line = DenseLine::through(
                &around[..LINE_NEIGHBOURS],
                few,
                farthest(LINE_NEIGHBOURS),
                LINE_NEIGHBOURS,
            );
        }
        if line.is_none() {
            line = DenseLine::through(around, values, farthest(NEIGHBOURS), NEIGHBOURS);
        }
        if lined && line.is_none() {
            line = DenseLine::farther(tree, point, &other, more);
        }
    }
    if let Some(line) = &line {
        gap = f64::INFINITY;
        if let Some(beside) = beside_line(tree, k, line, &other, more, row) {
            gap = beside;
            spacing = (line.step * beside).sqrt();
            offsets(points, point, row, around);
            (values, normal) = plane_through(around);
        }
    }
    // 2. Neighbours on two sheets: keep those on the point's own sheet. The nearest points of a line cannot show this.
    let one_line = lined && line.is_some();
    if !one_line && values[0] > THICK_VARIANCE_RATIO * values[1] && row.len() == NEIGHBOURS {
        let likely = |start: DVec3| {
            let (part, empty, across, _) = own_sheet(around, start, watch.least_peaked());
            (part > LIKELY_SHEET_VARIANCE && empty > LIKELY_SHEET_GAP).then_some(across)
        };
        let mut across = likely(normal);
        if across.is_none() && values[0] > MIXED_VARIANCE_RATIO * values[1] {
            // The nearest few may all lie on the own sheet where the plane through all is across both sheets.
            across = likely(plane_through(&around[..NEAREST_PLANE_POINTS]).1);
        }
        if let Some(across) = across {
            tree.search(point, TWO_SHEET_NEIGHBOURS, more, other);
            let mut wider = [DVec3::ZERO; TWO_SHEET_NEIGHBOURS];
            let wider = &mut wider[..more.items.len()];
            for (cell, j) in wider.iter_mut().zip(more.indices()) {
                *cell = points[j as usize] - point;
            }
            let (part, _, _, own) = own_sheet(wider, across, 0.0);
            if part > TWO_SHEET_VARIANCE && own.count_ones() >= MIN_OWN_SHEET_POINTS {
                watch.met();
                let own = |i: &usize| own >> i & 1 == 1;
                let own: Vec<usize> = (0..more.items.len()).filter(own).collect();
                // Repeat the neighbours if there are fewer than the row holds.
                for (cell, &i) in row.iter_mut().zip(own.iter().cycle()) {
                    *cell = more.items[i].1;
                }
                let last = own.len().min(SPACING_NEIGHBOUR);
                spacing = step_of_grid(more.items[own[last - 1]].0.sqrt(), last);
                offsets(points, point, row, around);
                (_, normal) = plane_through(around);
            }
        }
    }
    let (reach, one_sided) = isolation(around);
    Element {
        normal,
        spacing,
        reach,
        one_sided,
        gap,
    }
}

/// Mean distance of the neighbours (reach), and the distance of their mean as a share of it (asymmetry).
pub(super) fn isolation(around: &[DVec3]) -> (f64, f64) {
    let (mut reach, mut sum) = (0.0, DVec3::ZERO);
    for offset in around {
        reach += offset.length();
        sum += *offset;
    }
    (reach / around.len() as f64, sum.length() / reach)
}

/// Fills `around` with the offsets from a point to the neighbours of its row.
#[inline]
pub(super) fn offsets(points: &[DVec3], point: DVec3, row: &[u32], around: &mut [DVec3]) {
    for (cell, &j) in around.iter_mut().zip(row) {
        *cell = points[j as usize] - point;
    }
}

/// The median spacing of points in any order; `None` for fewer than two.
pub(super) fn median_spacing(points: &[DVec3]) -> Option<f64> {
    let order = spatial_order(points, |p| p.is_finite());
    let tree = Neighbours::of_sorted(gather(points, &order));
    let elements = Elements::new(&tree, false, &Silent).ok()?;
    let mut all: Vec<f64> = elements.of.iter().map(|e| e.spacing).collect();
    (all.len() > 1).then(|| median_in_place(&mut all))
}

/// The spacing by the 12th of the nearest neighbours.
pub(super) fn spacing_of(near: &Nearest) -> f64 {
    let last = near.items.len().min(SPACING_NEIGHBOUR);
    step_of_grid(near.items[last - 1].0.sqrt(), last)
}

/// The step of a square grid whose `count`-th neighbour is this far.
fn step_of_grid(distance: f64, count: usize) -> f64 {
    distance * (PI / (count as f64 + 0.5)).sqrt()
}

/// Fills a row with the nearest points beside a line through a point, and with some along it at about the same
/// distance. Returns the distance to the next line. Returns `None`, and leaves the row unchanged, if no point lies
/// beside the line.
fn beside_line(
    tree: &Neighbours,
    k: usize,
    line: &DenseLine,
    other: &dyn Fn(u32) -> bool,
    more: &mut Nearest,
    row: &mut [u32],
) -> Option<f64> {
    let DenseLine {
        direction,
        variance,
        ..
    } = *line;
    let points = tree.sorted_points();
    let offset = |j: u32| points[j as usize] - points[k];
    let beside = |j: u32| {
        let offset = offset(j);
        let (along, all) = (offset.dot(direction).powi(2), offset.length_squared());
        along < BESIDE_LINE_COSINE_SQUARED * all
            && all - along > OFF_LINE_DEVIATIONS * OFF_LINE_DEVIATIONS * variance
            && other(j)
    };
    if !tree.search_some(
        points[k],
        row.len() - NEIGHBOURS_ALONG_LINE,
        more,
        BESIDE_SEARCH_LEAVES,
        beside,
    ) {
        return None;
    }
    let middle = more.items.get(more.items.len() / 2)?.0;
    let nearest = more.indices().next()?;
    let gap = offset(nearest).reject_from(direction).length();
    let (along, across) = row.split_at_mut(NEIGHBOURS_ALONG_LINE);
    let found: Vec<u32> = more.indices().collect();
    for (cell, &index) in across.iter_mut().zip(found.iter().cycle()) {
        *cell = index;
    }
    // At least half as far as those beside the line, so that the plane is determined in both directions.
    let far = |j: u32| {
        !beside(j) && other(j) && offset(j).length_squared() >= ALONG_DISTANCE_SQUARED * middle
    };
    tree.search(points[k], along.len(), more, far);
    for (cell, index) in along.iter_mut().zip(more.indices()) {
        *cell = index;
    }
    Some(gap)
}

/// Divides a point (at the origin) and others around it into two sheets across a normal. Returns the share of the
/// variance of the heights between the sheets, the share of their range that is empty there, the improved normal, and a
/// bit set of the others on the point's own sheet. The sheets are the groups of heights with the largest variance
/// between them (Otsu 1979, DOI 10.1109/TSMC.1979.4310076). As parallel planes they have a common normal, which gives
/// better heights, and so on. Returns zeros if the bimodality coefficient of the heights is below `peaked`.
fn own_sheet(others: &[DVec3], mut normal: DVec3, peaked: f64) -> (f64, f64, DVec3, u64) {
    // The last one is the point itself.
    let mut heights = [0.0_f64; TWO_SHEET_NEIGHBOURS + 1];
    let heights = &mut heights[..(others.len() + 1).min(TWO_SHEET_NEIGHBOURS + 1)];
    for round in 0..=SHEET_NORMAL_ROUNDS {
        for (height, offset) in heights.iter_mut().zip(others) {
            *height = offset.dot(normal);
        }
        if round == 0 && !two_peaked(heights, peaked) {
            break;
        }
        let (part, empty, between) = largest_gap(heights);
        let upper = |height: f64| height > between;
        if round == SHEET_NORMAL_ROUNDS || part < MIN_SHEET_VARIANCE {
            let own = heights[..others.len()].iter().enumerate();
            let own = own.filter(|(_, height)| upper(**height) == upper(0.0));
            let own = own.fold(0, |bits, (i, _)| bits | 1 << i);
            return (part, empty, normal, own);
        }
        // The common normal of both sheets: the direction of least variance about their own means.
        let all = || {
            others
                .iter()
                .copied()
                .chain(std::iter::once(DVec3::ZERO))
                .zip(&*heights)
        };
        let mut means = [(DVec3::ZERO, 0.0_f64); 2];
        for (offset, height) in all() {
            let mean = &mut means[usize::from(upper(*height))];
            mean.0 += offset;
            mean.1 += 1.0;
        }
        let means = means.map(|(sum, n)| sum / n.max(1.0));
        let about = all().map(|(offset, height)| offset - means[usize::from(upper(*height))]);
        let (_, axes) = plane_axes(about);
        normal = axes[0];
    }
    (0.0, 0.0, normal, 0)
}

/// Whether heights may belong to two sheets under a better normal: a test without sorting by the bimodality coefficient
/// (skewness² + 1) / kurtosis. It is 1 for two heights of any weight, 5/9 for evenly spread ones, and 1/3 for normal
/// noise (Pearson 1916).
fn two_peaked(heights: &[f64], least: f64) -> bool {
    let part = 1.0 / heights.len() as f64;
    let mean = part * heights.iter().sum::<f64>();
    let (mut second, mut third, mut fourth) = (0.0, 0.0, 0.0);
    for height in heights {
        let h = height - mean;
        let square = h * h;
        second += square;
        third += square * h;
        fourth += square * square;
    }
    let (second, third, fourth) = (second * part, third * part, fourth * part);
    least <= 0.0 || third * third + second * second * second > least * fourth * second
}

/// The division into two groups with the largest variance between them: its share of the variance of the heights, the
/// empty share of their range between the groups, and the height half-way.
fn largest_gap(all: &[f64]) -> (f64, f64, f64) {
    let mut heights = [0.0; TWO_SHEET_NEIGHBOURS + 1];
    let sorted = &mut heights[..all.len()];
    sorted.copy_from_slice(all);
    sorted.sort_unstable_by(f64::total_cmp);
    let count = sorted.len();
    let total: f64 = sorted.iter().sum();
    let mean = total / count as f64;
    let spread: f64 = sorted.iter().map(|h| (h - mean).powi(2)).sum();
    let (mut below, mut best, mut split) = (0.0, (0.0, 1.0), 0);
    for k in 1..count {
        // Sums about the mean: the sums below and above are opposite.
        below += sorted[k - 1] - mean;
        let (square, pairs) = (below * below, (k * (count - k)) as f64);
        // Comparison of fractions without division.
        if square * best.1 > best.0 * pairs {
            (best, split) = ((square, pairs), k);
        }
    }
    let best = best.0 / best.1 * count as f64;
    if split == 0 || spread <= 0.0 {
        return (0.0, 0.0, 0.0);
    }
    let (low, high) = (sorted[split - 1], sorted[split]);
    let range = sorted[count - 1] - sorted[0];
    (best / spread, (high - low) / range, 0.5 * (low + high))
}

#[cfg(test)]
mod tests;

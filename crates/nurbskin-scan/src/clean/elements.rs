//! What the neighbourhood of each point says: its plane, and how far the next points are.

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

/// Neighbours per point that all judgements rest on.
pub(super) const NEIGHBOURS: usize = 16;
/// The neighbour whose distance gives the local spacing.
const MEASURED: usize = 12;
/// Points between two questions whether to go on: a fraction of a second.
const BATCH: usize = 1 << 18;
/// Points per task.
const CHUNK: usize = 2048;
/// Below this ratio of the variances along a plane the neighbours lie on one line. At the rim of an evenly sampled
/// sheet it is 0.28, at a corner 0.2.
pub(crate) const LINEAR: f64 = 0.08;
/// Nearest neighbours that tell lines where there are some: fewer, so that they do where lines bend or are not so dense.
pub(crate) const ON_LINE: usize = 8;
/// Every so many of as many times more neighbours tell it where noise hides it from the nearest. Of more a wire or a strip
/// that is eight points wide would be a line.
const FARTHER: usize = 4;
/// Squared cosine to the line below which a point lies beside it.
const BESIDE: f64 = 0.8;
/// It is also so many standard deviations of the line's points off it: noise alone takes two of them as far apart once in
/// 2000 times.
const OFF_LINE: f64 = 5.0;
/// Leaves of the tree that are searched for such points: points on a line farther from the next one are left alone.
const LEAVES: usize = 1000;
/// Neighbours along the line that are kept.
const ALONG: usize = 4;
/// From this ratio of the variances across and along a plane on, two sheets are looked for.
const THICK: f64 = 0.02;
/// From this ratio on, the sheets are so far apart that the plane through all may lie across them.
const MIXED: f64 = 0.06;
/// Neighbours whose plane is then tried as well.
const CLOSE: usize = 7;
/// Neighbours that two sheets are told apart by.
const TWO_SHEETS: usize = 48;
/// Part of the variance of the heights that must be between two sheets; for one sheet with normal noise it is 0.64,
/// for evenly spread heights 0.75.
const APART: f64 = 0.88;
/// The same, among the few nearest neighbours, that makes it worth looking at more.
const LIKELY: f64 = 0.85;
/// The part of the range of the heights that must then be empty. Both together are met by noise at one point of a
/// hundred.
const EMPTY: f64 = 0.35;
/// The same, below which a better normal is not looked for.
const HOPELESS: f64 = 0.65;
/// The least ratio of (skewness^2 + 1) to the kurtosis that promises two sheets, where they are expected and elsewhere;
/// that of even heights is 0.56.
const PEAKED: [f64; 2] = [0.0, 0.65];
/// Every so many points are looked at closely.
const PROBE: usize = 16;
/// Points in spatial order for which two sheets are expected after one that has them.
const ALERT: usize = 128;
/// How often the normal of two sheets is improved.
const ROUNDS: usize = 2;
/// Fewest neighbours on a sheet of their own.
const SHEET: u32 = 6;

/// A point's neighbourhood in numbers.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Element {
    /// Unit normal of the least-squares plane (Hoppe et al. 1992, DOI 10.1145/133994.134011), of either sign.
    pub(crate) normal: DVec3,
    /// The step of the square grid on which the 12th neighbour would be as far: a disc of that radius holds 12.5
    /// points on average between the 12th and the 13th.
    pub(super) spacing: f64,
    /// Mean distance to the neighbours.
    pub(crate) reach: f64,
    /// Distance to the mean of the neighbours, in reaches: about 0.1 within a sheet, 0.6 at its rim.
    pub(super) one_sided: f64,
    /// Distance to the next line if the nearest points lie on one line, infinite if there is no other; zero else. Of points
    /// known to lie on lines 8 tell, or 16, or every 4th of 64; of others 16.
    pub(crate) gap: f64,
}

/// The elements of all points and the neighbours they rest on: the 16 nearest, unless these lie on one line (then the
/// nearest beside it and a few along it) or on two sheets (then the nearest on the
/// point's own, as the file's normals tell it or heights do).
#[derive(Debug)]
pub(crate) struct Elements {
    pub(crate) of: Vec<Element>,
    pub(super) table: NeighbourTable,
    /// Whether the points are known to lie on lines.
    lined: bool,
    /// Whether the normals look to the side that the file says.
    pub(super) faced: bool,
}

impl Elements {
    /// Of the points of a tree in spatial order, which may be known to lie on lines; `progress` is advanced by half their
    /// number. O(n), about 1.8 us per point.
    pub(super) fn new(tree: &Neighbours, lined: bool, progress: &dyn Progress) -> Result<Self> {
        let total = tree.len();
        let count = NEIGHBOURS.min(total.saturating_sub(1));
        let mut rows = vec![0_u32; count * total];
        let mut of = vec![Element::default(); total];
        let batches = rows
            .chunks_mut((BATCH * count).max(1))
            .zip(of.chunks_mut(BATCH));
        for (batch, (rows, of)) in batches.enumerate() {
            progress.check()?;
            pairs_of_blocks(rows, CHUNK * count, of, CHUNK, |chunk, rows, of| {
                let start = batch * BATCH + chunk * CHUNK;
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

    /// Of every so many points, as if they lay on lines, and without what the others need.
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

    /// Examines the points near dead ones again, as if these were not there. O(dead).
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

/// How closely the points of a task, one after the other in spatial order, are looked at for two sheets: every so many
/// closely, and those after one that has them; the others only if they show two sheets clearly.
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
        self.since_probe = (self.since_probe + 1) % PROBE;
    }
    /// What a neighbourhood must show at first sight.
    fn least_peaked(&self) -> f64 {
        if self.left > 0 || self.since_probe == 0 {
            PEAKED[0]
        } else {
            PEAKED[1]
        }
    }
    fn met(&mut self) {
        self.left = ALERT;
    }
}

/// A dense line that a point and its nearest neighbours lie on.
struct DenseLine {
    direction: DVec3,
    /// Larger variance across it.
    variance: f64,
    /// Distance of its points from each other.
    step: f64,
}

impl DenseLine {
    /// The line that points seen from a point lie on, whose variances are given, if they do: some of the `count` that are
    /// no farther than `within`.
    fn through(around: &[DVec3], values: [f64; 3], within: f64, count: usize) -> Option<Self> {
        if values[1] >= LINEAR * values[2] {
            return None;
        }
        let (_, axes) = plane_axes(around.iter().copied());
        Some(Self {
            direction: axes[2],
            variance: values[1],
            step: 2.0 * within / (count as f64 + 1.0),
        })
    }

    /// The line through every so many of more neighbours, where noise is as wide as the nearest are far.
    fn farther(
        tree: &Neighbours,
        point: DVec3,
        other: &dyn Fn(u32) -> bool,
        more: &mut Nearest,
    ) -> Option<Self> {
        let count = FARTHER * NEIGHBOURS;
        tree.search(point, count, more, other);
        let last = more.items.last().filter(|_| more.items.len() == count)?;
        let within = last.0.sqrt();
        let mut around = [DVec3::ZERO; NEIGHBOURS];
        let some = more.indices().skip(FARTHER - 1).step_by(FARTHER);
        for (cell, j) in around.iter_mut().zip(some) {
            *cell = tree.sorted_points()[j as usize] - point;
        }
        let (values, _) = plane_through(&around);
        Self::through(&around, values, within, count)
    }
}

/// The element of a point and its row of neighbours, from its nearest ones.
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
    // 1. Neighbours on one line say nothing of the plane: look beside it.
    let mut gap = 0.0;
    let mut line = None;
    if row.len() == NEIGHBOURS {
        let farthest = |count: usize| near.items[count - 1].0.sqrt();
        if lined {
            let (few, _) = plane_through(&around[..ON_LINE]);
            line = DenseLine::through(&around[..ON_LINE], few, farthest(ON_LINE), ON_LINE);
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
    // 2. Neighbours on two sheets: keep to the own one. The nearest of a point on a line do not tell.
    let one_line = lined && line.is_some();
    if !one_line && values[0] > THICK * values[1] && row.len() == NEIGHBOURS {
        let likely = |start: DVec3| {
            let (part, empty, across, _) = own_sheet(around, start, watch.least_peaked());
            (part > LIKELY && empty > EMPTY).then_some(across)
        };
        let mut across = likely(normal);
        if across.is_none() && values[0] > MIXED * values[1] {
            // The nearest few may all be on the own sheet where the others mislead.
            across = likely(plane_through(&around[..CLOSE]).1);
        }
        if let Some(across) = across {
            tree.search(point, TWO_SHEETS, more, other);
            let mut wider = [DVec3::ZERO; TWO_SHEETS];
            let wider = &mut wider[..more.items.len()];
            for (cell, j) in wider.iter_mut().zip(more.indices()) {
                *cell = points[j as usize] - point;
            }
            let (part, _, _, own) = own_sheet(wider, across, 0.0);
            if part > APART && own.count_ones() >= SHEET {
                watch.met();
                let own = |i: &usize| own >> i & 1 == 1;
                let own: Vec<usize> = (0..more.items.len()).filter(own).collect();
                // Fewer are repeated.
                for (cell, &i) in row.iter_mut().zip(own.iter().cycle()) {
                    *cell = more.items[i].1;
                }
                let last = own.len().min(MEASURED);
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

/// The mean distance of neighbours, seen from a point, and how far their mean is off in that distance.
pub(super) fn isolation(around: &[DVec3]) -> (f64, f64) {
    let (mut reach, mut sum) = (0.0, DVec3::ZERO);
    for offset in around {
        reach += offset.length();
        sum += *offset;
    }
    (reach / around.len() as f64, sum.length() / reach)
}

/// Fills `around` with the neighbours of a row as seen from a point.
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
    let last = near.items.len().min(MEASURED);
    step_of_grid(near.items[last - 1].0.sqrt(), last)
}

/// The step of a square grid whose `count`-th neighbour is this far.
fn step_of_grid(distance: f64, count: usize) -> f64 {
    distance * (PI / (count as f64 + 0.5)).sqrt()
}

/// Fills a row with the nearest points beside a line through a point, and with some along it about as far away. Gives the
/// distance of the next line; `None`, and the row as it was, if there is nothing beside.
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
        along < BESIDE * all && all - along > OFF_LINE * OFF_LINE * variance && other(j)
    };
    if !tree.search_some(points[k], row.len() - ALONG, more, LEAVES, beside) {
        return None;
    }
    let middle = more.items.get(more.items.len() / 2)?.0;
    let nearest = more.indices().next()?;
    let gap = offset(nearest).reject_from(direction).length();
    let (along, across) = row.split_at_mut(ALONG);
    let found: Vec<u32> = more.indices().collect();
    for (cell, &index) in across.iter_mut().zip(found.iter().cycle()) {
        *cell = index;
    }
    // At least half as far as those beside, so that the plane is held in both directions.
    let far = |j: u32| !beside(j) && other(j) && offset(j).length_squared() >= 0.25 * middle;
    tree.search(points[k], along.len(), more, far);
    for (cell, index) in along.iter_mut().zip(more.indices()) {
        *cell = index;
    }
    Some(gap)
}

/// Takes a point (at the origin) and others around it for two sheets across a normal: the part of the variance of the
/// heights that lies between them, the part of their range that is empty there, the better normal, and which of the
/// others are on the point's own, as bits. The sheets are the groups of heights with the largest variance between them
/// (Otsu 1979, DOI 10.1109/TSMC.1979.4310076); they are then parallel planes, whose common normal gives better
/// heights, and so on. All zero where the heights are not that much
/// `peaked` twice.
fn own_sheet(others: &[DVec3], mut normal: DVec3, peaked: f64) -> (f64, f64, DVec3, u64) {
    // The last one is the point itself.
    let mut heights = [0.0_f64; TWO_SHEETS + 1];
    let heights = &mut heights[..(others.len() + 1).min(TWO_SHEETS + 1)];
    for round in 0..=ROUNDS {
        for (height, offset) in heights.iter_mut().zip(others) {
            *height = offset.dot(normal);
        }
        if round == 0 && !two_peaked(heights, peaked) {
            break;
        }
        let (part, empty, between) = largest_gap(heights);
        let upper = |height: f64| height > between;
        if round == ROUNDS || part < HOPELESS {
            let own = heights[..others.len()].iter().enumerate();
            let own = own.filter(|(_, height)| upper(**height) == upper(0.0));
            let own = own.fold(0, |bits, (i, _)| bits | 1 << i);
            return (part, empty, normal, own);
        }
        // The normal across which both sheets together are thinnest, each about its own mean.
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

/// Whether heights may be those of two sheets under a better normal: a test before any sorting, by the ratio of
/// (skewness^2 + 1) to the kurtosis, which is 1 for two heights of any weight, 5/9 for evenly spread ones, and 1/3 for
/// normal noise (Pearson 1916).
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

/// The part of the variance of the heights that lies between the two groups that it is largest for, the part of their
/// range between these, and a height there.
fn largest_gap(all: &[f64]) -> (f64, f64, f64) {
    let mut heights = [0.0; TWO_SHEETS + 1];
    let sorted = &mut heights[..all.len()];
    sorted.copy_from_slice(all);
    sorted.sort_unstable_by(f64::total_cmp);
    let count = sorted.len();
    let total: f64 = sorted.iter().sum();
    let mean = total / count as f64;
    let spread: f64 = sorted.iter().map(|h| (h - mean).powi(2)).sum();
    let (mut below, mut best, mut split) = (0.0, (0.0, 1.0), 0);
    for k in 1..count {
        // Sums about the mean: those below and above are opposite.
        below += sorted[k - 1] - mean;
        let (square, pairs) = (below * below, (k * (count - k)) as f64);
        // Larger as a fraction, without division.
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

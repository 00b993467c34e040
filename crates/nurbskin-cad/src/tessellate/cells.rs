//! Which cells between the lines of a face are two triangles each, and which a loop passes through.

use super::metric::Metric;
use crate::region::{Cover, Region};
use glam::DVec2;

/// What is closer than this to a loop is taken as touched, where the larger side of the domain has length 1.
const NEAR: f64 = 1e-9;

/// The cells between the lines of a face, u fastest, and the nodes at their corners.
#[derive(Clone, Debug, Default)]
pub(super) struct Cells {
    /// Number of cells along u and along v.
    counts: [usize; 2],
    /// Whether a cell is wholly inside the loops, with all its corners, and two triangles follow the surface.
    plain: Vec<bool>,
    /// How far the triangles of the plain ones may miss.
    pub(super) bound: f64,
}

/// A face's lines in its parameter plane and in the stretched one of its polygons.
pub(super) struct Lines<'a> {
    pub(super) given: &'a [Vec<f64>; 2],
    pub(super) scaled: [Vec<f64>; 2],
}

impl Lines<'_> {
    fn counts(&self) -> [usize; 2] {
        self.given.each_ref().map(|lines| lines.len() - 1)
    }

    fn node(&self, [i, j]: [usize; 2]) -> DVec2 {
        DVec2::new(self.scaled[0][i], self.scaled[1][j])
    }

    /// Whether a node keeps off the loops by a third of the way to the next lines, and is inside.
    fn is_free(&self, region: &Region, node: [usize; 2]) -> bool {
        let gap = |axis: usize| {
            let (lines, k) = (&self.scaled[axis], node[axis]);
            let before = k.checked_sub(1).map(|j| lines[k] - lines[j]);
            let after = lines.get(k + 1).map(|next| next - lines[k]);
            let gaps = before.into_iter().chain(after);
            0.3 * gaps.fold(f64::INFINITY, f64::min)
        };
        let (place, free) = (self.node(node), DVec2::new(gap(0), gap(1)));
        let [low, high] = region.bounding_rectangle();
        place.cmpge(low).all()
            && place.cmple(high).all()
            && region.cover(place - free, place + free) == Cover::Inside
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    Outside,
    Inside,
    Touched,
}

impl Cells {
    /// The plain cells, and the nodes inside that are corners of others, u fastest. Polygons are in the stretched plane,
    /// cells that hold one of the `extra` places are not plain. O(cells + sides of the polygons x log).
    pub(super) fn new(
        lines: &Lines,
        polygons: &[Vec<DVec2>],
        region: &Region,
        metric: &Metric,
        tolerance: f64,
        extra: &[DVec2],
    ) -> (Self, Vec<usize>) {
        let counts = lines.counts();
        let states = states(lines, polygons, region);
        let mut this = Self {
            counts,
            plain: Vec::new(),
            bound: 0.0,
        };
        // 1. Nodes.
        let [m, n] = counts;
        let mut used = vec![false; (m + 1) * (n + 1)];
        for (node, used) in used.iter_mut().enumerate() {
            let around = this.around(node).map(|cell| cell.map(|cell| states[cell]));
            *used = if around.iter().all(|&state| state == Some(State::Inside)) {
                true
            } else {
                let open =
                    |state: &Option<State>| matches!(state, Some(State::Inside | State::Touched));
                around.iter().any(open) && lines.is_free(region, this.place(node))
            };
        }
        // 2. Cells.
        let mut held = vec![false; m * n];
        for place in extra {
            let range = |axis: usize| meeting(&lines.given[axis], place[axis], place[axis]);
            for j in range(1) {
                held[j * m..][range(0)].fill(true);
            }
        }
        let widths = |axis: usize| {
            let pairs = lines.given[axis].windows(2);
            let width = |w: &[f64]| (metric.spans(axis, w[0], w[1]), w[1] - w[0]);
            pairs.map(width).collect::<Vec<_>>()
        };
        let (across, up) = (widths(0), widths(1));
        this.plain = vec![false; m * n];
        for cell in 0..m * n {
            let whole = states[cell] == State::Inside && !held[cell];
            if !whole || this.corners(cell).iter().any(|&node| !used[node]) {
                continue;
            }
            let ((us, h), (vs, k)) = (&across[cell % m], &up[cell / m]);
            let [uu, uv, vv] = metric.most(us.clone(), vs.clone());
            let miss = (uu * h * h + 2.0 * uv * h * k + vv * k * k) / 8.0;
            if miss <= tolerance {
                this.plain[cell] = true;
                this.bound = this.bound.max(miss);
            }
        }
        // 3. What the others need.
        let needed = |&node: &usize| {
            let around = this.around(node);
            used[node] && !around.iter().all(|cell| this.is_plain(*cell))
        };
        let nodes = (0..used.len()).filter(needed).collect();
        (this, nodes)
    }

    /// Number of plain cells.
    pub(super) fn count(&self) -> usize {
        self.plain.iter().filter(|&&plain| plain).count()
    }

    /// The plain cells, u fastest.
    pub(super) fn plain(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.plain.len()).filter(|&cell| self.plain[cell])
    }

    /// Number of nodes.
    pub(super) fn node_count(&self) -> usize {
        self.counts.iter().map(|count| count + 1).product()
    }

    /// The lines along u and v that cross at a node.
    pub(super) fn place(&self, node: usize) -> [usize; 2] {
        let width = self.counts[0] + 1;
        [node % width, node / width]
    }

    /// Its corners, counter-clockwise.
    pub(super) fn corners(&self, cell: usize) -> [usize; 4] {
        let [m, _] = self.counts;
        let low = (cell / m) * (m + 1) + cell % m;
        [low, low + 1, low + m + 2, low + m + 1]
    }

    /// The cells beyond each side of a cell, in the order of its corners.
    pub(super) fn beyond(&self, cell: usize) -> [Option<usize>; 4] {
        let [m, n] = self.counts;
        let (i, j) = (cell % m, cell / m);
        [
            (j > 0).then(|| cell - m),
            (i + 1 < m).then(|| cell + 1),
            (j + 1 < n).then(|| cell + m),
            (i > 0).then(|| cell - 1),
        ]
    }

    /// Whether all neighbours of a cell are plain.
    pub(super) fn is_surrounded(&self, cell: usize) -> bool {
        self.beyond(cell).iter().all(|&cell| self.is_plain(cell))
    }

    pub(super) fn is_plain(&self, cell: Option<usize>) -> bool {
        cell.is_some_and(|cell| self.plain.get(cell) == Some(&true))
    }

    /// A cell is plain no longer.
    pub(super) fn release(&mut self, cell: usize) {
        if let Some(plain) = self.plain.get_mut(cell) {
            *plain = false;
        }
    }

    /// The cells that share a node.
    fn around(&self, node: usize) -> [Option<usize>; 4] {
        let [m, n] = self.counts;
        let [i, j] = self.place(node);
        let cell = |i: Option<usize>, j: Option<usize>| {
            let (i, j) = (i.filter(|&i| i < m)?, j.filter(|&j| j < n)?);
            Some(j * m + i)
        };
        let (left, below) = (i.checked_sub(1), j.checked_sub(1));
        [
            cell(left, below),
            cell(Some(i), below),
            cell(left, Some(j)),
            cell(Some(i), Some(j)),
        ]
    }
}

/// How each cell lies to the polygons. Neighbours that are not touched are on the same side, so that one look is enough
/// for each run of them in a row.
fn states(lines: &Lines, polygons: &[Vec<DVec2>], region: &Region) -> Vec<State> {
    let [m, n] = lines.counts();
    let mut states = vec![State::Outside; m * n];
    for polygon in polygons {
        let next = polygon.iter().cycle().skip(1);
        for (&p, &q) in polygon.iter().zip(next) {
            touch(&lines.scaled, p, q, &mut states);
        }
    }
    for (j, row) in states.chunks_exact_mut(m).enumerate() {
        let mut last = State::Touched;
        for (i, state) in row.iter_mut().enumerate() {
            if *state != State::Touched {
                *state = if last == State::Touched {
                    let middle = lines.node([i, j]).midpoint(lines.node([i + 1, j + 1]));
                    if region.contains(middle) {
                        State::Inside
                    } else {
                        State::Outside
                    }
                } else {
                    last
                };
            }
            last = *state;
        }
    }
    states
}

/// Marks the cells that a side of a polygon meets.
fn touch(lines: &[Vec<f64>; 2], p: DVec2, q: DVec2, states: &mut [State]) {
    let width = lines[0].len() - 1;
    let (p, q) = if p.y <= q.y { (p, q) } else { (q, p) };
    let rise = q.y - p.y;
    for j in meeting(&lines[1], p.y - NEAR, q.y + NEAR) {
        // Where the side enters the row and leaves it; all of the side where that is not well-conditioned.
        let [a, b] = if rise > 1e-6 {
            [lines[1][j] - NEAR, lines[1][j + 1] + NEAR]
                .map(|y| p.x + (q.x - p.x) * ((y - p.y) / rise).clamp(0.0, 1.0))
        } else {
            [p.x, q.x]
        };
        let range = meeting(&lines[0], a.min(b) - NEAR, a.max(b) + NEAR);
        states[j * width..][range].fill(State::Touched);
    }
}

/// The intervals between lines that meet a range.
fn meeting(lines: &[f64], low: f64, high: f64) -> std::ops::Range<usize> {
    let count = lines.len() - 1;
    let from = lines.partition_point(|&x| x < low).saturating_sub(1);
    let to = lines.partition_point(|&x| x <= high).min(count);
    if lines.last().is_some_and(|&last| last < low) {
        return 0..0;
    }
    from.min(to)..to
}

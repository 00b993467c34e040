//! Seams and poles of a surface that is trimmed.
//!
//! A loop must not cross a seam. A periodic direction has no seam of its own: the knot vector may begin at any of its
//! knots, and it begins where no node of the line across is bare. What still cuts a hole into a seam, or runs round a
//! pole, stays covered. The field of a moved seam is resampled linearly between nodes.
//!
//! Source: ours.

use super::support::Support;
use nurbskin_geometry::nurbs::NurbsSurface;
use nurbskin_geometry::nurbs::refine::Direction;

impl Support {
    /// The span at whose start a periodic direction should begin so that no cut crosses its seam; `None` if the present
    /// seam is free, or no other is.
    pub(super) fn seam(&self, surface: &NurbsSurface, direction: Direction) -> Option<usize> {
        let axis = usize::from(direction == Direction::V);
        let knots = surface.knots(direction);
        if !knots.is_periodic() {
            return None;
        }
        // The number of bare nodes on each line across the direction.
        let [m, n] = self.count;
        let line = |k: usize| -> usize {
            let at = |other: usize| {
                if axis == 0 {
                    other * m + k
                } else {
                    k * m + other
                }
            };
            let across = if axis == 0 { n } else { m };
            (0..across)
                .filter(|&other| self.far[at(other)] > self.level)
                .count()
        };
        if line(0) == 0 {
            return None;
        }
        let (a, b) = knots.domain();
        let last = self.count[axis] - 1;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a node of the grid"
        )]
        let node = |t: f64| {
            ((t - a) / (b - a) * last as f64)
                .round()
                .clamp(0.0, last as f64) as usize
        };
        let breaks = knots.breakpoints();
        // One node to each side as well, since knots lie between nodes.
        let bare = |span: usize| {
            let k = node(breaks[span]) % last;
            let (before, behind) = ((k + last - 1) % last, (k + 1) % last);
            line(before).max(line(k)).max(line(behind))
        };
        let best = (0..breaks.len() - 1).min_by_key(|&span| bare(span))?;
        (bare(best) == 0).then_some(best)
    }

    /// Shifts the field by this share of the domain, after the seam was moved, with linear interpolation between nodes.
    pub(super) fn turn(&mut self, direction: Direction, share: f64) {
        let axis = usize::from(direction == Direction::V);
        let last = self.count[axis] - 1;
        let [m, n] = self.count;
        let exact = share * last as f64;
        let turned = |values: &[f64]| -> Vec<f64> {
            let place = |k: usize| {
                let (i, j) = (k % m, k / m);
                let along = if axis == 0 { i } else { j };
                // Linear between nodes.
                let x = (along as f64 + exact).rem_euclid(last as f64);
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a node of the grid"
                )]
                let low = (x.floor() as usize).min(last - 1);
                let t = x - low as f64;
                let at = |along: usize| {
                    if axis == 0 {
                        j * m + along
                    } else {
                        along * m + i
                    }
                };
                values[at(low)] * (1.0 - t) + values[at(low + 1)] * t
            };
            (0..m * n).map(place).collect()
        };
        self.far = turned(&self.far);
        self.areas = turned(&self.areas);
        self.cosines = turned(&self.cosines);
        copy_seams(&mut self.far, self.count, self.closed);
    }

    /// Covers bare regions that would cut a hole into a seam or enclose a pole. A region that runs from a border across
    /// a seam only shortens the seam.
    pub(super) fn cover_seams_and_poles(&mut self) {
        let [m, n] = self.count;
        let bare = |i: usize, j: usize| self.far[j * m + i] > self.level;
        // Nodes of seams and poles that must not be bare.
        let mut bad = vec![false; m * n];
        for (side, ends) in [(0, n), (1, n), (2, m), (3, m)] {
            let node = |k: usize| match side {
                0 => (0, k),
                1 => (m - 1, k),
                2 => (k, 0),
                _ => (k, n - 1),
            };
            let across = 1 - side / 2;
            let is_open = |end: usize| !self.closed[across] && !self.poles[2 * across + end];
            if !self.closed[side / 2] && !self.poles[side] {
                continue;
            }
            let is_bare = |k: usize| {
                let (i, j) = node(k);
                bare(i, j)
            };
            let seam = self.closed[side / 2];
            let from = match (0..ends).find(|&k| !is_bare(k)) {
                Some(first) if seam && is_open(0) => first,
                _ => 0,
            };
            let to = match (0..ends).rfind(|&k| !is_bare(k)) {
                Some(last) if seam && is_open(1) => last + 1,
                _ => ends,
            };
            for k in (from..to).filter(|&k| is_bare(k)) {
                let (i, j) = node(k);
                bad[j * m + i] = true;
            }
        }
        let regions = self.components(|far, level| far > level);
        for region in regions {
            if region.iter().any(|&k| bad[k]) {
                self.cover(&region);
            }
        }
    }
}

/// Makes both ends of closed directions the same to the last bit.
pub(super) fn copy_seams(far: &mut [f64], [m, n]: [usize; 2], closed: [bool; 2]) {
    if closed[0] {
        for row in far.chunks_exact_mut(m) {
            row[m - 1] = row[0];
        }
    }
    if closed[1] {
        far.copy_within(..m, m * (n - 1));
    }
}

//! Withdrawal from rims: the surface ends before places beside a rim where it turns away from its scan or meets itself.
//!
//! Along its rim a fit is held by points on one side only. Where the rim is ragged, the surface may turn over between
//! the teeth or pass through itself. For each such place p with the nearest point r of the rim, at most `depth` away,
//! the field becomes
//!
//! ```text
//! far(x)  ->  max(far(x), level + width - dist(x, segment p r))
//! ```
//!
//! so that everything within `width` of the segment is bare. Of two sheets that cross, the one nearer to the rim is
//! cut. A withdrawal that takes too much area is undone.
//!
//! Source: ours.

use super::seams::copy_seams;
use super::support::Support;
use glam::{DVec2, DVec3};
use nurbskin_geometry::spatial::nearest::Nearest;

/// Limits of a withdrawal.
pub(super) struct Beside {
    /// Largest depths behind the rim, in spacings, of successive passes; each pass starts from the result of the one
    /// before.
    pub(super) depths: &'static [f64],
    /// Half-width of the strip that is cut along with a place, in spacings; at least a step of the grid.
    around: f64,
    /// Largest share of the area that may be withdrawn, together with earlier withdrawals; a larger one is no matter of
    /// rims.
    pub(super) most: f64,
}

/// Limits where the surface is turned away from the scan: depths and surroundings in spacings, a share of the area.
/// Trial: `rvcg_humface` of docs/real-scans.md keeps its 95 % distance up to a depth of 2; deeper cuts cost more points
/// of the scan than they are worth. Each node is known, so that little around it goes with it.
pub(super) const TURNED: Beside = Beside {
    depths: &[0.5, 1.0, 2.0],
    around: 0.25,
    most: 0.02,
};
/// The same where the surface intersects itself. Trial: the narrow parts of a scene with ragged rims need 3 % of the
/// area; a surface that fails its check is worth more of its rim. A place stands for a cell of the search, whose
/// triangles may be as large as a spacing.
pub(super) const CROSSING: Beside = Beside {
    depths: &[0.5, 1.0, 2.0, 3.0, 4.0],
    around: 0.5,
    most: 0.05,
};

impl Support {
    /// Nodes that are kept although the surface faces away from the scan there.
    pub(super) fn turned(&self) -> Vec<DVec2> {
        let turned = |&k: &usize| self.cosines[k] < 0.0 && self.far[k] <= self.level;
        (0..self.far.len())
            .filter(turned)
            .map(|k| self.place(k))
            .collect()
    }

    /// Ends the surface before those of the `places` (lengths along u and v) that are at most `depth` spacings from a
    /// rim; returns whether that changed anything. A withdrawal of too much area is undone.
    pub(super) fn withdraw(&mut self, places: &[DVec2], depth: f64, beside: &Beside) -> bool {
        let rims = Nearest::new(&self.rims(), None);
        let (before, covered) = (self.far.clone(), self.covered);
        let reach = depth * self.spacing;
        for place in places {
            let Some(rim) = rims.closest(place.extend(0.0), None) else {
                return false;
            };
            if rim.distance <= reach {
                self.cut_between(*place, rim.point.truncate(), beside.around * self.spacing);
            }
        }
        copy_seams(&mut self.far, self.count, self.closed);
        self.drop_islands();
        self.cover_seams_and_poles();
        let lost = |k: &usize| self.far[*k] > self.level && before[*k] <= self.level;
        let lost: f64 = (0..before.len()).filter(lost).map(|k| self.areas[k]).sum();
        let share = lost / self.areas.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        if lost <= 0.0 || self.withdrawn + share > beside.most {
            (self.far, self.covered) = (before, covered);
            return false;
        }
        self.withdrawn += share;
        true
    }

    /// The rim: kept nodes next to bare ones or on an open side, with their images across the seams.
    fn rims(&self) -> Vec<DVec3> {
        let [m, n] = self.count;
        let kept = |i: usize, j: usize| self.far[j * m + i] <= self.level;
        let is_open = |side: usize| !self.closed[side / 2] && !self.poles[side];
        let ends = |k: usize| {
            let (i, j) = (k % m, k / m);
            let on_side = [i == 0, i + 1 == m, j == 0, j + 1 == n];
            kept(i, j)
                && ((0..4).any(|side| on_side[side] && is_open(side))
                    || i > 0 && !kept(i - 1, j)
                    || i + 1 < m && !kept(i + 1, j)
                    || j > 0 && !kept(i, j - 1)
                    || j + 1 < n && !kept(i, j + 1))
        };
        let nodes = (0..m * n).filter(|&k| ends(k));
        let images = nodes.flat_map(|k| self.images(self.place(k)));
        images.map(|p| p.extend(0.0)).collect()
    }

    /// Makes the nodes within `near` of the segment between two places bare.
    fn cut_between(&mut self, from: DVec2, to: DVec2, near: f64) {
        let [m, n] = self.count;
        let steps = self.steps();
        let wide = near.max(steps.max_element());
        let way = to - from;
        let square = way.length_squared().max(f64::MIN_POSITIVE);
        // Nodes farther than twice the width do not move the outline.
        let [low, high] = [from.min(to) - 2.0 * wide, from.max(to) + 2.0 * wide].map(|p| p / steps);
        let nodes = |axis: usize, count: usize| {
            #[expect(clippy::cast_possible_truncation, reason = "nodes of the grid")]
            let range = low[axis].floor() as i64..=high[axis].ceil() as i64;
            let closed = self.closed[axis];
            range.filter_map(move |k| {
                let last = i64::try_from(count).unwrap_or(i64::MAX) - 1;
                let wrapped = if closed { k.rem_euclid(last) } else { k };
                let node = usize::try_from(wrapped).ok().filter(|&node| node < count)?;
                Some((node, k as f64 * steps[axis]))
            })
        };
        let (across, along): (Vec<_>, Vec<_>) = (nodes(0, m).collect(), nodes(1, n).collect());
        for &(j, y) in &along {
            for &(i, x) in &across {
                let at = DVec2::new(x, y);
                let t = ((at - from).dot(way) / square).clamp(0.0, 1.0);
                let off = at.distance(from + t * way);
                let far = &mut self.far[j * m + i];
                *far = far.max(self.level + wide - off);
            }
        }
    }
}

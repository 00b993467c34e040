//! Cells of the knots in gaps, where there are no points though some are near.
//!
//! The domain is divided into square bins of about three points. An empty bin is bare if its 3 x 3 neighbourhood holds
//! less than 34 % of its expected points, and in a gap if points lie within two bins:
//!
//! ```text
//! share of a cell in gaps = max(0, (gap bins / bins - 1/4) / (3/4))
//! ```
//!
//! Where the surface extends over bare bins, they count by the square of their depth: as far from the points, it need not be
//! calmer than waves of that length. The surface goes on along the direction (c, s) away from the points: of the third
//! derivatives uuu, uuv, uvv, vvv, those across that direction hardly count, so that a bend that runs into the outline goes
//! on as it is:
//!
//! ```text
//! shares = c⁶, c⁴ s², c² s⁴, s⁶        of |S_uuu|², 3 |S_uuv|², 3 |S_uvv|², |S_vvv|², with weights 1, 3, 3, 1
//! ```
//!
//! Ours.

use super::samples::Samples;
use super::spline_space::SplineSpace;

/// Mean number of points in a bin. Count.
/// Trial: 7 was used before. Evenly scattered points leave one bin in twenty empty, hence the next condition.
const POINTS_PER_BIN: f64 = 3.0;
/// Most bins, unless more places are looked up. Count.
/// Guard: bounds the memory and the time.
const MAX_BINS: f64 = 65536.0;
/// Most bins along a direction. Count.
/// Guard: bounds the memory for extreme ratios of the sides.
const MAX_BINS_ALONG: f64 = 4096.0;
/// Share of its expected points below which the neighbourhood of an empty bin is sparse, so that the bin is bare.
/// Dimensionless.
/// Derived: by chance this happens to one bin in several thousand inside the domain, and to one in a thousand at a
/// corner.
const SPARSE_SHARE: f64 = 0.34;
/// Distance from the nearest point, in bins, up to which bare bins are a gap. Count.
/// Trial: not recorded. Farther away the domain is empty.
const GAP_REACH: usize = 2;
/// Share of a cell that a gap may take without an effect. Dimensionless.
/// Trial: not recorded. The rest of the cell holds it.
const IGNORED_GAP_SHARE: f64 = 0.25;
/// Share of all third derivatives beyond the points, whatever their direction. Dimensionless.
/// Guard: keeps the surface definite between regions that go on in different directions.
const IN_ALL_DIRECTIONS: f64 = 0.01;
/// Places along each side of a cell that are looked up. Count.
/// Guard: sixteen resolve the share of a cell to 6 %.
const PLACES_PER_SIDE: usize = 4;

/// The domain in square bins: bare ones, and the gaps among them.
#[derive(Debug)]
pub(super) struct Gaps {
    counts: [usize; 2],
    /// 1 for bins in gaps, 0 for others.
    gap: Vec<f64>,
    /// How much the four third derivatives count in a bare bin where the surface extends; 0 for others.
    extension: Vec<[f64; 4]>,
}

impl Gaps {
    /// From the samples with a weight, for a domain of `size` lengths that is divided into this many cells. Bare regions are
    /// weighed if the surface `extends` over them.
    pub(super) fn new(
        samples: &Samples,
        weights: &[f64],
        size: [f64; 2],
        (cells, extends): (usize, bool),
    ) -> Self {
        let looked_up = (PLACES_PER_SIDE * PLACES_PER_SIDE * cells) as f64;
        let bins = (samples.len() as f64 / POINTS_PER_BIN).min(MAX_BINS.max(looked_up));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to 1..=4096"
        )]
        let count = |ratio: f64| (bins * ratio).sqrt().clamp(1.0, MAX_BINS_ALONG) as usize;
        let counts = [count(size[0] / size[1]), count(size[1] / size[0])];
        let mut held = vec![0_u32; counts[0] * counts[1]];
        for (t, &w) in samples.parameters.iter().zip(weights) {
            held[bin(counts, t.x, t.y)] += u32::from(w > 0.0);
        }
        let [m, n] = counts;
        // Number of bins around bin k, itself included, and of points in them.
        let around = |k: usize, reach: usize| {
            let window = |k: usize, n: usize| k.saturating_sub(reach)..(k + reach + 1).min(n);
            let (columns, rows) = (window(k % m, m), window(k / m, n));
            let bins = columns.len() * rows.len();
            let row = |j: usize| held[j * m + columns.start..j * m + columns.end].iter();
            (bins, rows.flat_map(row).sum::<u32>())
        };
        let share = samples.len() as f64 / (m * n) as f64;
        let is_bare = |k: usize| {
            if held[k] > 0 {
                return false;
            }
            let (bins, points) = around(k, 1);
            f64::from(points) < SPARSE_SHARE * share * bins as f64
        };
        let is_bare: Vec<bool> = (0..m * n).map(is_bare).collect();
        let is_gap = |k: usize| is_bare[k] && around(k, GAP_REACH).1 > 0;
        Self {
            counts,
            gap: (0..m * n).map(|k| f64::from(u8::from(is_gap(k)))).collect(),
            extension: match extends {
                true => extension(&is_bare, counts),
                false => vec![[0.0; 4]; m * n],
            },
        }
    }

    /// Share of cell (a, b) in gaps, 0 (up to a quarter) to 1 (all).
    pub(super) fn share(&self, space: &SplineSpace, a: usize, b: usize) -> f64 {
        let share = self.mean(&self.gap, space, a, b);
        // A gap that is small against a cell is held by the rest of it.
        ((share - IGNORED_GAP_SHARE) / (1.0 - IGNORED_GAP_SHARE)).max(0.0)
    }

    /// How much the third derivatives uuu, uuv, uvv and vvv count in cell (a, b), 0 to 1 each: the share without points,
    /// less by the square of the distance from the points, in half of the shorter side of the domain.
    pub(super) fn extension(&self, space: &SplineSpace, a: usize, b: usize) -> [f64; 4] {
        let mut sums = [0.0; 4];
        for bin in self.places(space, a, b) {
            for (sum, share) in sums.iter_mut().zip(self.extension[bin]) {
                *sum += share;
            }
        }
        sums.map(|sum| sum / (PLACES_PER_SIDE * PLACES_PER_SIDE) as f64)
    }

    fn mean(&self, bins: &[f64], space: &SplineSpace, a: usize, b: usize) -> f64 {
        let sum: f64 = self.places(space, a, b).map(|bin| bins[bin]).sum();
        sum / (PLACES_PER_SIDE * PLACES_PER_SIDE) as f64
    }

    /// The bins at evenly spread places of cell (a, b).
    fn places(&self, space: &SplineSpace, a: usize, b: usize) -> impl Iterator<Item = usize> {
        let [bu, bv] = &space.breaks;
        let place = |breaks: &[f64], a: usize, k: usize| {
            let t = (k as f64 + 0.5) / PLACES_PER_SIDE as f64;
            breaks[a] + t * (breaks[a + 1] - breaks[a])
        };
        let along = |breaks: &[f64], a: usize| -> [f64; PLACES_PER_SIDE] {
            std::array::from_fn(|k| place(breaks, a, k))
        };
        let (us, vs) = (along(bu, a), along(bv, b));
        let counts = self.counts;
        vs.into_iter()
            .flat_map(move |v| us.into_iter().map(move |u| bin(counts, u, v)))
    }
}

/// For each bare bin, how much the four third derivatives count: the square of its distance from the nearest other bin, in
/// that of half of the shorter side of the domain, 1 at most, times the shares of the direction from there. 0 for all other
/// bins. O(n) for n bins.
fn extension(is_bare: &[bool], [m, n]: [usize; 2]) -> Vec<[f64; 4]> {
    // Distances by rings of chessboard steps, each bin with the nearest of the sources of its ring.
    let mut depth = vec![u32::MAX; is_bare.len()];
    let mut source: Vec<usize> = (0..is_bare.len()).collect();
    let mut ring: Vec<usize> = (0..is_bare.len()).filter(|&k| !is_bare[k]).collect();
    ring.iter().for_each(|&k| depth[k] = 0);
    let away = |k: usize, from: usize| {
        let along = |k: usize, from: usize| k as f64 - from as f64;
        [along(k % m, from % m), along(k / m, from / m)]
    };
    let squared = |[x, y]: [f64; 2]| x * x + y * y;
    let mut step = 0;
    while !ring.is_empty() {
        step += 1;
        let mut next = Vec::new();
        for k in ring {
            let (i, j) = (k % m, k / m);
            for b in j.saturating_sub(1)..(j + 2).min(n) {
                for a in i.saturating_sub(1)..(i + 2).min(m) {
                    let other = a + m * b;
                    if depth[other] == u32::MAX {
                        depth[other] = step;
                        source[other] = source[k];
                        next.push(other);
                    } else if depth[other] == step
                        && squared(away(other, source[k])) < squared(away(other, source[other]))
                    {
                        source[other] = source[k];
                    }
                }
            }
        }
        ring = next;
    }
    let half = 0.5 * m.min(n) as f64;
    let shares = |k: usize| {
        let weight = (f64::from(depth[k]) / half).powi(2).min(1.0);
        let [x, y] = away(k, source[k]);
        // Where there is no source, in all directions.
        let (c, s) = match squared([x, y]) {
            0.0 => return [weight; 4],
            square => (x * x / square, y * y / square),
        };
        [c * c * c, c * c * s, c * s * s, s * s * s]
            .map(|share| weight * (IN_ALL_DIRECTIONS + (1.0 - IN_ALL_DIRECTIONS) * share))
    };
    (0..is_bare.len()).map(shares).collect()
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "parameters lie in 0..=1"
)]
fn bin(counts: [usize; 2], u: f64, v: f64) -> usize {
    let place = |t: f64, n: usize| ((t * n as f64) as usize).min(n - 1);
    place(u, counts[0]) + counts[0] * place(v, counts[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bare_bins_extend_by_their_depth() {
        // Columns from 20 on are bare, and so is a hole of 4 x 3.
        let counts = [40, 24];
        let is_hole = |i: usize, j: usize| (5..9).contains(&i) && (10..13).contains(&j);
        let is_bare: Vec<bool> = (0..40 * 24)
            .map(|k| k % 40 >= 20 || is_hole(k % 40, k / 40))
            .collect();
        let found = extension(&is_bare, counts);
        for (k, found) in found.into_iter().enumerate() {
            let depth = match (k % 40, k / 40) {
                (i, _) if i >= 20 => i - 19,
                (6 | 7, 11) => 2,
                (i, j) => usize::from(is_hole(i, j)),
            };
            let known = (depth as f64 / 12.0).powi(2).min(1.0);
            // The shares of a direction, with 1, 3, 3, 1, sum up to 1; the hole has other directions.
            let sum = found[0] + 3.0 * (found[1] + found[2]) + found[3];
            let known_sum = known * (1.0 + 7.0 * IN_ALL_DIRECTIONS);
            assert!((sum - known_sum).abs() < 1e-12, "{k}: {found:?} {known}");
            if k % 40 >= 20 {
                assert!((found[0] - known).abs() < 1e-12, "{k}: {found:?}");
                assert!(
                    (found[3] - IN_ALL_DIRECTIONS * known).abs() < 1e-12,
                    "{k}: {found:?}"
                );
            }
        }
        assert!(
            extension(&[true; 6], [3, 2])
                .iter()
                .flatten()
                .all(|&w| w >= 1.0)
        );
    }
}

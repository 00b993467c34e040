//! Where in the domain there are no points though some are near.

use super::samples::Samples;
use super::spline_space::SplineSpace;

/// Mean number of points in a bin. Evenly scattered ones leave one bin in twenty empty, hence the next condition.
const POINTS: f64 = 3.0;
/// Most bins, but for those that are looked up.
const MOST: f64 = 65536.0;
/// An empty bin is in a gap if it and those around it hold less than this part of their share: by chance, one in
/// several thousand inside, one in a thousand at a corner.
const SPARSE: f64 = 0.34;
/// So many bins from the nearest point a gap ends and emptiness begins.
const NEAR: usize = 2;
/// Part of a cell that a gap may take without a say.
const SMALL: f64 = 0.25;
/// Places along each side of a cell that are looked up.
const PLACES: usize = 4;

/// The domain in square bins: those without points beside such with points are gaps.
#[derive(Debug)]
pub(super) struct Gaps {
    counts: [usize; 2],
    is_gap: Vec<bool>,
    is_bare: Vec<bool>,
}

impl Gaps {
    /// From the samples with a weight, for a domain that stands for `size` lengths and is cut into so many cells.
    pub(super) fn new(samples: &Samples, weights: &[f64], size: [f64; 2], cells: usize) -> Self {
        let looked_up = (PLACES * PLACES * cells) as f64;
        let bins = (samples.len() as f64 / POINTS).min(MOST.max(looked_up));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to 1..=4096"
        )]
        let count = |ratio: f64| (bins * ratio).sqrt().clamp(1.0, 4096.0) as usize;
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
            f64::from(points) < SPARSE * share * bins as f64
        };
        let is_bare: Vec<bool> = (0..m * n).map(is_bare).collect();
        let is_gap = |k: usize| is_bare[k] && around(k, NEAR).1 > 0;
        Self {
            counts,
            is_gap: (0..m * n).map(is_gap).collect(),
            is_bare,
        }
    }

    /// How much of cell (a, b) lies in gaps, 0 (up to a quarter) to 1 (all).
    pub(super) fn share(&self, space: &SplineSpace, a: usize, b: usize) -> f64 {
        let share = self.part(&self.is_gap, space, a, b);
        // What is small against a cell is held by the rest of it.
        ((share - SMALL) / (1.0 - SMALL)).max(0.0)
    }

    /// How much of cell (a, b) holds no points, 0 to 1.
    pub(super) fn bare(&self, space: &SplineSpace, a: usize, b: usize) -> f64 {
        self.part(&self.is_bare, space, a, b)
    }

    fn part(&self, marked: &[bool], space: &SplineSpace, a: usize, b: usize) -> f64 {
        let [bu, bv] = &space.breaks;
        let place = |breaks: &[f64], a: usize, k: usize| {
            let t = (k as f64 + 0.5) / PLACES as f64;
            breaks[a] + t * (breaks[a + 1] - breaks[a])
        };
        let in_gap = |k: &usize| {
            let (u, v) = (place(bu, a, k % PLACES), place(bv, b, k / PLACES));
            marked[bin(self.counts, u, v)]
        };
        (0..PLACES * PLACES).filter(in_gap).count() as f64 / (PLACES * PLACES) as f64
    }
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

//! Condensed samples: each is the mean of a group of neighbours, with less noise than any of them.
//!
//! ```text
//! mean of n points:  noise σ / √n,   offset from a curved surface about 1/8 of the sag of the group
//! ```
//!
//! Knots are chosen on the condensed samples, which hold what all points show together at a fraction of the cost. The
//! final fits take all points, because of the offset.
//!
//! Source: recursive median splits as in a k-d tree (J. L. Bentley, 1975); the use for knots is ours.

use crate::fit::least_squares::samples::Samples;
use nurbskin_geometry::{DVec2, DVec3};
use rayon::join;

/// Mean weight of a group up to which it is left out as mostly outliers. Dimensionless.
/// Derived: a half, the majority.
const MIN_GROUP_WEIGHT: f64 = 0.5;
/// Samples of a half from which both halves are worked on in parallel. Count.
/// Guard: fewer take less time than to hand them over.
const PARALLEL_SPLIT_SAMPLES: usize = 20_000;

/// The mean of a group of samples.
#[derive(Clone, Copy, Debug)]
struct Mean {
    point: DVec3,
    parameters: DVec2,
    /// One of the group.
    original: u32,
}

impl Samples {
    /// `groups` means of equally many neighbours in the domain (give or take one), without groups of outliers; `size`
    /// is that of the chart, and `weights` has one entry per sample. The order depends on nothing but the samples. O(n
    /// log groups).
    ///
    /// The domain is split at the median sample, across its longer side, until the groups are small enough.
    pub(super) fn condensed(&self, weights: &[f64], groups: usize, size: [f64; 2]) -> Self {
        let all = (0_u32..).take(self.len());
        let (support, mut members): (Vec<u32>, Vec<u32>) =
            all.partition(|&k| self.is_support(k as usize));
        let groups = groups.clamp(1, members.len().max(1));
        let mut means = vec![None; groups];
        let group = Groups {
            samples: self,
            weights,
        };
        group.split(&mut members, &mut means, size);
        // Support points stay as they are.
        let as_it_is = support.iter().map(|&k| Mean {
            point: self.points[k as usize],
            parameters: self.parameters[k as usize],
            original: self.original[k as usize],
        });
        let sound: Vec<Mean> = means.into_iter().flatten().chain(as_it_is).collect();
        Self {
            points: sound.iter().map(|m| m.point).collect(),
            parameters: sound.iter().map(|m| m.parameters).collect(),
            original: sound.iter().map(|m| m.original).collect(),
            measured: sound.len() - support.len(),
            ..*self
        }
    }
}

struct Groups<'a> {
    samples: &'a Samples,
    weights: &'a [f64],
}

impl Groups<'_> {
    /// Fills `means` with one mean per group; `size` is that of the box of the members.
    fn split(&self, members: &mut [u32], means: &mut [Option<Mean>], size: [f64; 2]) {
        if means.len() <= 1 {
            if let Some(mean) = means.first_mut() {
                *mean = self.mean(members);
            }
            return;
        }
        let d = usize::from(size[1] > size[0]);
        let left = means.len() / 2;
        let at = share(members.len(), left, means.len());
        let along = |k: u32| self.samples.parameters[k as usize][d];
        if at > 0 && at < members.len() {
            members
                .select_nth_unstable_by(at, |&a, &b| along(a).total_cmp(&along(b)).then(a.cmp(&b)));
        }
        let (low, high) = members.split_at_mut(at);
        let (first, second) = means.split_at_mut(left);
        let mut half = size;
        half[d] *= 0.5;
        let small = low.len() < PARALLEL_SPLIT_SAMPLES;
        if small {
            self.split(low, first, half);
            self.split(high, second, half);
        } else {
            join(
                || self.split(low, first, half),
                || self.split(high, second, half),
            );
        }
    }

    /// `None` where the members are mostly outliers.
    fn mean(&self, members: &mut [u32]) -> Option<Mean> {
        // The order of summation must not depend on the partition.
        members.sort_unstable();
        let (mut point, mut parameters, mut total) = (DVec3::ZERO, DVec2::ZERO, 0.0);
        for &k in members.iter() {
            let w = self.weights[k as usize];
            point += w * self.samples.points[k as usize];
            parameters += w * self.samples.parameters[k as usize];
            total += w;
        }
        (total > 0.0 && total >= MIN_GROUP_WEIGHT * members.len() as f64).then(|| Mean {
            point: point / total,
            parameters: (parameters / total).clamp(DVec2::ZERO, DVec2::ONE),
            original: self.samples.original[members[0] as usize],
        })
    }
}

/// The whole part of `count * part / whole`, for `part` up to `whole`. The product of tens of thousands of groups and
/// hundreds of thousands of points is beyond 32 bits, the size of `usize` in a browser.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the quotient is at most count"
)]
fn share(count: usize, part: usize, whole: usize) -> usize {
    (count as u64 * part as u64 / whole as u64) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_many_points_do_not_overflow() {
        // The product is 4.3e9, above 2^32.
        assert_eq!(share(171_852, 25_000, 50_000), 85_926);
        assert_eq!(share(7, 1, 3), 2);
    }

    /// Places of a low-discrepancy sequence, with heights of a plane and a known, alternating error.
    fn plane(n: usize) -> Samples {
        let parameters: Vec<DVec2> = (1..=n)
            .map(|k| k as f64 * DVec2::new(0.754_877_666_246_693, 0.569_840_290_998_053))
            .map(|t| t - t.floor())
            .collect();
        let points: Vec<DVec3> = parameters
            .iter()
            .zip(0..)
            .map(|(t, k)| {
                let error = if k % 2 == 0 { 0.01 } else { -0.01 };
                DVec3::new(t.x, 2.0 * t.y, 0.5 * t.x - t.y + error)
            })
            .collect();
        Samples::new(&points, &parameters, 1.0)
    }

    #[test]
    fn means_of_a_plane_lie_on_it() {
        let samples = plane(20_000);
        let mut weights = vec![1.0; samples.len()];
        weights[17] = 0.0;
        let condensed = samples.condensed(&weights, 500, [1.0, 2.0]);
        assert_eq!(condensed.len(), 500);
        let mut squares = 0.0;
        for (p, t) in condensed.points.iter().zip(&condensed.parameters) {
            let p = condensed.restore(*p);
            assert!((p.x - t.x).abs() < 1e-12 && (p.y - 2.0 * t.y).abs() < 1e-12);
            squares += (p.z - 0.5 * t.x + t.y).powi(2);
        }
        // Forty errors of 0.01 in a mean: 0.01 / sqrt(40) if they were independent.
        assert!((squares / 500.0).sqrt() < 1.3 * 0.01 / 40.0_f64.sqrt());
    }

    #[test]
    fn groups_are_compact_and_outliers_left_out() {
        let samples = plane(20_000);
        let corner = |k: usize| samples.parameters[k].max_element() < 0.25;
        let weights: Vec<f64> = (0..samples.len())
            .map(|k| f64::from(u8::from(!corner(k))))
            .collect();
        let condensed = samples.condensed(&weights, 512, [1.0, 1.0]);
        // One sixteenth of the domain is gone, give or take groups across its border.
        let gone = 512 - condensed.len();
        assert!((20..=40).contains(&gone), "{gone}");
        // 512 groups of a square are 1/32 by 1/16 at most: no two means are much nearer than that.
        let mut nearest = f64::INFINITY;
        for (i, a) in condensed.parameters.iter().enumerate() {
            for b in &condensed.parameters[..i] {
                nearest = nearest.min(a.distance(*b));
            }
        }
        assert!(nearest > 0.4 / 32.0, "{nearest}");
    }
}

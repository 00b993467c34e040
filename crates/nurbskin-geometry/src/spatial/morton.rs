//! The order of points along a Morton curve: neighbours in space are mostly neighbours in memory.
//!
//! Source: G. M. Morton, *A computer oriented geodetic data base and a new technique in file sequencing*, IBM, 1966.

use crate::numeric::bucket_sort::sort_by_key;
use crate::numeric::parallel::each;
use glam::DVec3;
use std::cmp::Ordering;

/// Cells per axis, as a power of two; three axes fit 63 bits.
const BITS: u32 = 21;
/// Classes per axis that the box is searched for its crowded part with.
const CLASSES: usize = 256;

/// Points that one task counts.
const BLOCK: usize = 1 << 16;

/// Compares two points by their coordinates.
pub fn compare(a: &DVec3, b: &DVec3) -> Ordering {
    // Adding zero makes -0 and 0 the same.
    let (a, b) = (*a + DVec3::ZERO, *b + DVec3::ZERO);
    a.x.total_cmp(&b.x)
        .then(a.y.total_cmp(&b.y))
        .then(a.z.total_cmp(&b.z))
}

/// The indices of the points that `keep` admits, which must be finite, along a Morton curve; points in one cell go by
/// their coordinates, then by index. O(n log n).
pub fn spatial_order(points: &[DVec3], keep: impl Fn(&DVec3) -> bool + Sync) -> Vec<u32> {
    let curve = Curve::of(points, &keep);
    let mut keys: Vec<(u64, u32)> = {
        let count = points.len().min(u32::MAX as usize);
        #[expect(clippy::cast_possible_truncation, reason = "at most 2^32 - 1")]
        each(count, |k| (curve.code(points[k]), k as u32))
    };
    keys.retain(|&(_, k)| keep(&points[k as usize]));
    let by = |a: &(u64, u32), b: &(u64, u32)| {
        a.0.cmp(&b.0)
            .then_with(|| compare(&points[a.1 as usize], &points[b.1 as usize]))
            .then(a.1.cmp(&b.1))
    };
    let keys = sort_by_key(keys, |key| key.0, by);
    each(keys.len(), |k| keys[k].1)
}

/// The lower and upper corner of a box that holds nearly all of the points, see [`spatial_order`]. O(n).
pub fn crowded_box(points: &[DVec3]) -> [DVec3; 2] {
    let Curve { low, high, .. } = Curve::of(points, |p| p.is_finite());
    [low, high]
}

/// The curve through a cube around the points.
struct Curve {
    low: DVec3,
    high: DVec3,
    scale: f64,
}

impl Curve {
    /// A cube that holds nearly all points and is not much larger than need be: while the crowded part of the
    /// box is a small one, the box shrinks to it. A few points astray thus cost no resolution; they go to the cells
    /// at its sides.
    fn of(points: &[DVec3], keep: impl Fn(&DVec3) -> bool + Sync) -> Self {
        let finite = |block: usize| {
            let block = &points[block * BLOCK..points.len().min((block + 1) * BLOCK)];
            block.iter().filter(|p| keep(p))
        };
        let blocks = points.len().div_ceil(BLOCK);
        let boxes = each(blocks, |block| {
            let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0_usize);
            finite(block).fold(nothing, |(low, high, count), &p| {
                (low.min(p), high.max(p), count + 1)
            })
        });
        let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0);
        let (mut low, mut high, count) = boxes
            .into_iter()
            .fold(nothing, |a, b| (a.0.min(b.0), a.1.max(b.1), a.2 + b.2));
        // Each round takes at least a factor of eight from a range that has at most 2^2100.
        for _ in 0..800 {
            let side = (high - low).max_element();
            if !(side.is_finite() && side > 0.0) || points.len() < 2 {
                break;
            }
            let scale = CLASSES as f64 / side;
            let counted = each(blocks, |block| {
                let mut classes = vec![[0_usize; 3]; CLASSES];
                for p in finite(block) {
                    let at = ((*p - low) * scale).to_array();
                    for (axis, at) in at.into_iter().enumerate() {
                        #[expect(
                            clippy::cast_possible_truncation,
                            clippy::cast_sign_loss,
                            reason = "saturation is meant"
                        )]
                        let class = (at as usize).min(CLASSES - 1);
                        classes[class][axis] += 1;
                    }
                }
                classes
            });
            let mut classes = vec![[0_usize; 3]; CLASSES];
            for some in counted {
                for (sums, counts) in classes.iter_mut().zip(some) {
                    for (sum, count) in sums.iter_mut().zip(counts) {
                        *sum += count;
                    }
                }
            }
            let mut crowded = [(0, CLASSES); 3];
            for (axis, crowded) in crowded.iter_mut().enumerate() {
                // A thousandth of the points may be astray on either side.
                let few = (count / 1000).max(3);
                let skip = |classes: &mut dyn Iterator<Item = &[usize; 3]>| {
                    let mut met = 0;
                    classes
                        .take_while(|class| {
                            met += class[axis];
                            met <= few
                        })
                        .count()
                };
                *crowded = (
                    skip(&mut classes.iter()),
                    CLASSES - skip(&mut classes.iter().rev()),
                );
            }
            let widest = crowded.iter().map(|(a, b)| b.saturating_sub(*a)).max();
            if widest.is_none_or(|widest| widest == 0 || widest > CLASSES / 8) {
                break;
            }
            let start = DVec3::from_array(crowded.map(|(a, _)| a as f64));
            let end = DVec3::from_array(crowded.map(|(_, b)| b as f64));
            (low, high) = (low + start / scale, low + end / scale);
        }
        let side = (high - low).max_element();
        let scale = f64::from(1_u32 << BITS) / side;
        Self {
            low,
            high,
            scale: if scale.is_finite() { scale } else { 0.0 },
        }
    }

    fn code(&self, point: DVec3) -> u64 {
        let [x, y, z] = ((point - self.low) * self.scale).to_array().map(|at| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "saturation is meant"
            )]
            let cell = (at as u64).min((1 << BITS) - 1);
            spread(cell)
        });
        x | y << 1 | z << 2
    }
}

/// Puts two zeros after each of the lowest 21 bits.
fn spread(mut x: u64) -> u64 {
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_of_a_grid() {
        let points: Vec<DVec3> = (0..8_u32)
            .rev()
            .map(|k| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)))
            .collect();
        assert_eq!(
            spatial_order(&points, |p| p.is_finite()),
            [7, 6, 5, 4, 3, 2, 1, 0]
        );
        assert_eq!(spread(0x1f_ffff), 0x1249_2492_4924_9249);
    }

    #[test]
    fn points_astray_cost_no_resolution() {
        let mut points: Vec<DVec3> = (0..4000).map(|k| DVec3::X * f64::from(k % 2000)).collect();
        points.push(DVec3::splat(1e80));
        points.push(DVec3::splat(-1e85));
        points.push(DVec3::NAN);
        let [low, high] = crowded_box(&points);
        assert!(low.x > -1e5 && high.x < 1e5 && low.x <= 0.0 && high.x >= 1999.0);
        let order = spatial_order(&points, |p| p.is_finite());
        assert_eq!(order.len(), 4002);
        let inner: Vec<f64> = order[1..4001]
            .iter()
            .map(|&k| points[k as usize].x)
            .collect();
        assert!(inner.windows(2).all(|w| w[0] <= w[1]));
    }
}

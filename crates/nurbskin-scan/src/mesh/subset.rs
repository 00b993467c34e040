//! A pseudo-random subset of points that does not depend on their order.
//!
//! The points whose coordinates have the smallest hashes are chosen: a threshold on the hash, with a margin of six
//! standard deviations, selects nearly as many as wanted in one pass, and a selection among these the exact number.
//! Source: bottom-k sampling by a hash; the hash is the finaliser of `SplitMix64`.

use glam::DVec3;
use nurbskin_geometry::numeric::bucket_sort::sort_by_key;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::spatial::morton::compare;
use rayon::prelude::*;

/// Points per parallel task. Guard: at 5 ns per point some 0.3 ms, large against the overhead of a task.
const HASH_CHUNK: usize = 1 << 16;
/// Margin of the threshold of the hash, in standard deviations √limit of the number of points below it. Derived: for
/// even hashes a shortfall has a probability of 1e-9, and it only costs a second pass.
const THRESHOLD_DEVIATIONS: f64 = 6.0;
/// Margin of the threshold in points, for small limits. Guard: the normal approximation fails there.
const THRESHOLD_MARGIN: f64 = 16.0;
/// Factor of the threshold that allows for points that cannot be used. Guard: with more than 9 % of such points a
/// second pass is needed.
const UNUSABLE_ALLOWANCE: f64 = 1.1;

/// At most `limit` of the points that `usable` admits: those whose coordinates have the smallest hash, sorted by
/// coordinates. The result does not depend on the order of the points. O(n + limit log limit), some 5 ns per point.
pub fn subset(points: &[DVec3], limit: usize, usable: impl Fn(usize) -> bool + Sync) -> Vec<u32> {
    let count = points.len().min(u32::MAX as usize);
    let indices = if count <= limit {
        chosen(&points[..count], |k, _| usable(k))
    } else {
        // 1. Hashes are evenly distributed: a threshold with a margin of six standard deviations, and an allowance for
        //    points that cannot be used, selects enough points. Otherwise all points are used.
        let wanted = limit as f64;
        let share = (wanted + THRESHOLD_DEVIATIONS * wanted.sqrt() + THRESHOLD_MARGIN)
            * UNUSABLE_ALLOWANCE
            / count as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive; saturation is meant"
        )]
        let threshold = (share * u64::MAX as f64) as u64;
        let mut few = chosen(&points[..count], |k, p| hash(p) <= threshold && usable(k));
        if few.len() < limit {
            few = chosen(&points[..count], |k, _| usable(k));
        }
        // 2. The smallest hashes.
        if few.len() > limit && limit > 0 {
            let mut keyed = each(few.len(), |k| (hash(points[few[k] as usize]), few[k]));
            keyed.select_nth_unstable(limit - 1);
            few = keyed[..limit].iter().map(|&(_, k)| k).collect();
        }
        few
    };
    // 3. Sorted by coordinates; the first one gives the sort key.
    let xs = || indices.iter().map(|&k| points[k as usize].x);
    let (low, high) = xs().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    let scale = f64::from(u32::MAX) / (high - low).max(f64::MIN_POSITIVE);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturation is meant"
    )]
    let key = |k: u32| ((points[k as usize].x - low) * scale) as u32;
    let keyed = each(indices.len(), |k| (key(indices[k]), indices[k]));
    let by = |&(x, a): &(u32, u32), &(y, b): &(u32, u32)| {
        let (p, q) = (&points[a as usize], &points[b as usize]);
        x.cmp(&y).then_with(|| compare(p, q)).then(a.cmp(&b))
    };
    let sorted = sort_by_key(keyed, |&(key, _)| u64::from(key), by);
    sorted.into_iter().map(|(_, k)| k).collect()
}

/// The indices of the points that `keep` admits, ascending.
fn chosen(points: &[DVec3], keep: impl Fn(usize, DVec3) -> bool + Sync) -> Vec<u32> {
    let of_chunk = |(chunk, points): (usize, &[DVec3])| -> Vec<u32> {
        let start = chunk * HASH_CHUNK;
        #[expect(
            clippy::cast_possible_truncation,
            reason = "there are at most 2^32 - 1 points"
        )]
        (start..)
            .zip(points)
            .filter(|&(k, &p)| keep(k, p))
            .map(|(k, _)| k as u32)
            .collect()
    };
    let chunks = points.par_chunks(HASH_CHUNK).enumerate();
    let parts: Vec<Vec<u32>> = chunks.map(of_chunk).collect();
    parts.concat()
}

/// Mixes the bits of a point (the finaliser of splitmix64).
fn hash(p: DVec3) -> u64 {
    p.to_array().iter().fold(0, |state: u64, x| {
        let mut z = state ^ x.to_bits().wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scattered(n: u32) -> Vec<DVec3> {
        let at = |k: u32, f: f64| (f64::from(k) * f).sin();
        (0..n)
            .map(|k| DVec3::new(at(k, 12.9898), at(k, 78.233), at(k, 37.719)))
            .collect()
    }

    #[test]
    fn the_smallest_hashes_in_any_order() {
        let points = scattered(5000);
        for limit in [1, 40, 700, 4999, 5000, 6000] {
            for step in [1, 2] {
                // By brute force.
                let mut all: Vec<usize> = (0..points.len()).step_by(step).collect();
                all.sort_by_key(|&k| hash(points[k]));
                all.truncate(limit);
                let mut wanted: Vec<DVec3> = all.iter().map(|&k| points[k]).collect();
                wanted.sort_by(|p, q| p.x.total_cmp(&q.x));
                let found = subset(&points, limit, |k| k.is_multiple_of(step));
                let found: Vec<DVec3> = found.iter().map(|&k| points[k as usize]).collect();
                assert_eq!(found, wanted);
            }
        }
        assert!(subset(&[], 10, |_| true).is_empty());
    }
}

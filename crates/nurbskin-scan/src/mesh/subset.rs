//! Some of many points, whatever order they come in.

use glam::DVec3;
use nurbskin_geometry::numeric::bucket_sort::sort_by_key;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::spatial::morton::compare;
use rayon::prelude::*;

/// Points that one task looks at in a row.
const CHUNK: usize = 1 << 16;

/// At most `limit` of the points that `usable` admits: those whose coordinates have the smallest hash, sorted by
/// coordinates. Neither depends on the order of the points. O(n + limit log limit), some 5 ns per point.
pub fn subset(points: &[DVec3], limit: usize, usable: impl Fn(usize) -> bool + Sync) -> Vec<u32> {
    let count = points.len().min(u32::MAX as usize);
    let indices = if count <= limit {
        chosen(&points[..count], |k, _| usable(k))
    } else {
        // 1. Hashes are spread evenly: nearly all that are wanted lie below a threshold, six standard deviations and
        //    the points that cannot be used allowed for. Where too few do, all are looked at.
        let wanted = limit as f64;
        let share = (wanted + 6.0 * wanted.sqrt() + 16.0) * 1.1 / count as f64;
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
        // 2. The smallest of them.
        if few.len() > limit && limit > 0 {
            let mut keyed = each(few.len(), |k| (hash(points[few[k] as usize]), few[k]));
            keyed.select_nth_unstable(limit - 1);
            few = keyed[..limit].iter().map(|&(_, k)| k).collect();
        }
        few
    };
    // 3. By coordinates, the first of which makes keys.
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
        let start = chunk * CHUNK;
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
    let chunks = points.par_chunks(CHUNK).enumerate();
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

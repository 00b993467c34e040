//! Sorting many items by integer keys.

use rayon::prelude::*;
use std::cmp::Ordering;

/// Fewer items than this are sorted as they are.
const FEW: usize = 1 << 14;
/// So many items per bucket, where keys are spread evenly, ...
const PER_BUCKET: usize = 64;
/// ... and buckets by at most so many bits: their ends stay in the cache.
const MOST_BITS: u32 = 14;
/// Buckets of more items than this are sorted by all cores together.
const LARGE: usize = 1 << 15;

/// Sorts by an order that tells all items apart and agrees with their keys: equal keys alone leave it to say more.
///
/// Items go to buckets by the leading bits of what their keys are above the lowest; each of these is then sorted within the
/// cache. O(n log n), whatever the keys; one copy of the items besides.
pub fn sort_by_key<T: Copy + Send + Sync>(
    items: Vec<T>,
    key: impl Fn(&T) -> u64 + Sync,
    by: impl Fn(&T, &T) -> Ordering + Sync,
) -> Vec<T> {
    let Some(&first) = items.first().filter(|_| items.len() >= FEW) else {
        let mut items = items;
        items.sort_unstable_by(by);
        return items;
    };
    // 1. As many leading bits as make small buckets of evenly spread keys.
    let (low, high) = items
        .iter()
        .map(&key)
        .fold((u64::MAX, 0), |(low, high), k| (low.min(k), high.max(k)));
    let wanted = (items.len() / PER_BUCKET).ilog2().min(MOST_BITS);
    let shift = (u64::BITS - (high - low).leading_zeros()).saturating_sub(wanted);
    #[expect(clippy::cast_possible_truncation, reason = "below 2^15")]
    let bucket = |item: &T| ((key(item) - low) >> shift) as usize;
    let mut ends = vec![0_usize; (1 << wanted) + 1];
    for item in &items {
        ends[bucket(item) + 1] += 1;
    }
    for k in 1..ends.len() {
        ends[k] += ends[k - 1];
    }
    // 2. Every item to its bucket; where one starts is where it ends at last.
    let mut sorted = vec![first; items.len()];
    for item in &items {
        let next = &mut ends[bucket(item)];
        sorted[*next] = *item;
        *next += 1;
    }
    drop(items);
    // 3. Each bucket by itself.
    let mut buckets = Vec::with_capacity(ends.len());
    let mut rest = &mut sorted[..];
    let mut start = 0;
    for end in ends {
        let (one, others) = rest.split_at_mut(end - start);
        if one.len() > 1 {
            buckets.push(one);
        }
        (rest, start) = (others, end);
    }
    let sort = |bucket: &mut [T]| match bucket.len() {
        ..LARGE => bucket.sort_unstable_by(&by),
        _ => bucket.par_sort_unstable_by(&by),
    };
    buckets.into_par_iter().with_min_len(16).for_each(sort);
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// By key, then by number.
    fn sorted(keys: &[u64]) -> Vec<(u64, u32)> {
        let items: Vec<(u64, u32)> = keys.iter().copied().zip(0..).collect();
        sort_by_key(items, |item| item.0, Ord::cmp)
    }

    fn by_the_book(keys: &[u64]) -> Vec<(u64, u32)> {
        let mut items: Vec<(u64, u32)> = keys.iter().copied().zip(0..).collect();
        items.sort_unstable();
        items
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        /// Keys of any number of bits, crowded ones, and any number of them around where buckets begin.
        #[test]
        fn any_keys(
            seed in any::<u64>(),
            bits in 0..=64_u32,
            count in prop::sample::select(vec![0, 1, 2, FEW - 1, FEW, 3 * FEW + 7, 3 * LARGE]),
        ) {
            let mut state = seed;
            let keys: Vec<u64> = (0..count)
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    let key = (state >> 1).rotate_left(17);
                    // A tenth lies anywhere.
                    let bits = if key.is_multiple_of(10) { 64 } else { bits };
                    key.checked_shr(64 - bits).unwrap_or(0)
                })
                .collect();
            prop_assert_eq!(sorted(&keys), by_the_book(&keys));
        }
    }

    #[test]
    fn equal_and_extreme_keys() {
        for keys in [
            vec![7; 2 * FEW],
            vec![u64::MAX; FEW],
            [0, u64::MAX].repeat(FEW),
        ] {
            assert_eq!(sorted(&keys), by_the_book(&keys));
        }
    }
}

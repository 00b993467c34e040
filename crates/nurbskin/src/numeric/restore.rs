//! Results that were found in another order.

/// Results that one task puts in a row at least.
#[cfg(feature = "parallel")]
const FEW: usize = 1 << 14;

/// What was found for each index of `order`, a permutation of 0.., in chunks of `size` (the last may have fewer), by
/// ascending index. O(n).
pub(crate) fn by_index<T: Copy + Send + Sync>(
    order: &[u32],
    chunks: &[Vec<T>],
    size: usize,
) -> Vec<T> {
    // Four bytes each are put here and there, and everything else is then written in a row, by all cores.
    let mut place = vec![0_u32; order.len()];
    for (at, &k) in (0_u32..).zip(order) {
        place[k as usize] = at;
    }
    let item = |&at: &u32| chunks[at as usize / size][at as usize % size];
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        place.par_iter().with_min_len(FEW).map(item).collect()
    }
    #[cfg(not(feature = "parallel"))]
    place.iter().map(item).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_permutation() {
        for n in [0, 1, 7, 100_003_u32] {
            // 7919 is a prime that divides none of them.
            let order: Vec<u32> = (0..u64::from(n))
                .filter_map(|k| u32::try_from(k * 7919 % u64::from(n)).ok())
                .collect();
            let chunks: Vec<Vec<u32>> = order.chunks(10).map(<[u32]>::to_vec).collect();
            let expected: Vec<u32> = (0..n).collect();
            assert_eq!(by_index(&order, &chunks, 10), expected);
        }
    }
}

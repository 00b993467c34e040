//! Work on all cores, whose results do not depend on the number of threads.

use rayon::prelude::*;

/// Results of a light function that one task computes at least, so that sharing them out costs little beside them. A guard;
/// results do not depend on it.
const RUN: usize = 1 << 10;
/// The same where a result is only copied.
const RUN_OF_COPIES: usize = 1 << 14;

/// f of each number below `count`, in order.
pub fn each<T: Send>(count: usize, f: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    if count < 2 {
        return (0..count).map(f).collect();
    }
    (0..count).into_par_iter().map(f).collect()
}

/// The results of two functions, each on a core of its own if there is one.
pub fn both<A: Send, B: Send>(
    one: impl FnOnce() -> A + Send,
    two: impl FnOnce() -> B + Send,
) -> (A, B) {
    rayon::join(one, two)
}

/// [`each`] of a light function: few numbers stay on one core.
pub fn each_light<T: Send>(count: usize, f: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    if count <= RUN {
        return (0..count).map(f).collect();
    }
    let shared = (0..count).into_par_iter().with_min_len(RUN);
    shared.map(f).collect()
}

/// Hands `f` block after block of two lists, of `of_a` and `of_b` items, and the number of the block. Nothing for
/// blocks of no items.
pub fn pairs_of_blocks<A: Send, B: Send>(
    a: &mut [A],
    of_a: usize,
    b: &mut [B],
    of_b: usize,
    f: impl Fn(usize, &mut [A], &mut [B]) + Sync + Send,
) {
    if of_a == 0 || of_b == 0 {
        return;
    }
    a.par_chunks_mut(of_a)
        .zip(b.par_chunks_mut(of_b))
        .enumerate()
        .for_each(|(k, (a, b))| f(k, a, b));
}

/// The items at these places.
pub fn gather<T: Copy + Send + Sync>(items: &[T], places: &[u32]) -> Vec<T> {
    each(places.len(), |k| items[places[k] as usize])
}

/// What was found for each index of `order`, a permutation of 0.., in chunks of `size` (the last may have fewer), by
/// ascending index. O(n).
pub fn by_index<T: Copy + Send + Sync>(order: &[u32], chunks: &[Vec<T>], size: usize) -> Vec<T> {
    // Four bytes each are put here and there, and everything else is then written in a row, by all cores.
    let mut place = vec![0_u32; order.len()];
    for (at, &k) in (0_u32..).zip(order) {
        place[k as usize] = at;
    }
    let item = |&at: &u32| chunks[at as usize / size][at as usize % size];
    place
        .par_iter()
        .with_min_len(RUN_OF_COPIES)
        .map(item)
        .collect()
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

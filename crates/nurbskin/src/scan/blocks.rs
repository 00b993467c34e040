//! Work shared out in blocks of fixed size, so that results do not depend on the number of threads.

/// f of each number below `count`, in order.
pub(crate) fn each<T: Send>(count: usize, f: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        (0..count).into_par_iter().map(f).collect()
    }
    #[cfg(not(feature = "parallel"))]
    (0..count).map(f).collect()
}

/// Hands `f` block after block of two lists, of `of_a` and `of_b` items, and the number of the block. Nothing for
/// blocks of no items.
pub(super) fn pairs_of_blocks<A: Send, B: Send>(
    a: &mut [A],
    of_a: usize,
    b: &mut [B],
    of_b: usize,
    f: impl Fn(usize, &mut [A], &mut [B]) + Sync + Send,
) {
    if of_a == 0 || of_b == 0 {
        return;
    }
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        a.par_chunks_mut(of_a)
            .zip(b.par_chunks_mut(of_b))
            .enumerate()
            .for_each(|(k, (a, b))| f(k, a, b));
    }
    #[cfg(not(feature = "parallel"))]
    for (k, (a, b)) in a.chunks_mut(of_a).zip(b.chunks_mut(of_b)).enumerate() {
        f(k, a, b);
    }
}

/// The items at these places.
pub(crate) fn gather<T: Copy + Send + Sync>(items: &[T], places: &[u32]) -> Vec<T> {
    each(places.len(), |k| items[places[k] as usize])
}

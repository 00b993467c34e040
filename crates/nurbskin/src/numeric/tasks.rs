//! Two things at once, where there are cores for it.

#[cfg(feature = "parallel")]
pub(crate) use rayon::join;

/// What both give, one after the other.
#[cfg(not(feature = "parallel"))]
pub(crate) fn join<A, B>(a: impl FnOnce() -> A, b: impl FnOnce() -> B) -> (A, B) {
    (a(), b())
}

//! Panics of a library that damaged files set off.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// Whether a panic of this thread is expected.
    static EXPECTED: Cell<bool> = const { Cell::new(false) };
}

/// What `work` returns, or `None` if it panics, which nobody gets to see. What it was working on is lost then, and must
/// not be used. Without unwinding (`panic = "abort"`) the process ends.
///
/// The first call puts a hook before the one of the program, which all other panics still reach.
pub(super) fn quietly<T>(work: impl FnOnce() -> T) -> Option<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let program = take_hook();
        set_hook(Box::new(move |panic| {
            if !EXPECTED.get() {
                program(panic);
            }
        }));
    });
    let outer = EXPECTED.replace(true);
    let outcome = catch_unwind(AssertUnwindSafe(work));
    EXPECTED.set(outer);
    outcome.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panics_are_results() {
        let none: Option<usize> = quietly(|| std::hint::black_box(&[1_usize][..])[7]);
        assert_eq!((none, quietly(|| 7)), (None, Some(7)));
    }
}

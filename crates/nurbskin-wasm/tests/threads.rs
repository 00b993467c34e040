//! The pool of threads that others bring; alone, because a process has one.

use nurbskin_wasm::threads::{run_thread, start_threads};
use std::collections::BTreeSet;
use std::thread::{current, sleep, spawn};
use std::time::Duration;

#[test]
fn threads_that_come_before_and_after_are_in_the_pool() {
    let early = spawn(run_thread);
    let late = spawn(|| {
        // As good as surely after the pool has been asked for.
        sleep(Duration::from_millis(100));
        run_thread();
    });
    assert!(start_threads(3).is_ok());
    let expected: BTreeSet<String> = [current().id(), early.thread().id(), late.thread().id()]
        .map(|id| format!("{id:?}"))
        .into();
    let used: BTreeSet<String> = rayon::broadcast(|_| format!("{:?}", current().id()))
        .into_iter()
        .collect();
    assert_eq!(used, expected);
    assert!(
        !early.is_finished() && !late.is_finished(),
        "a thread of the pool does not return"
    );
}

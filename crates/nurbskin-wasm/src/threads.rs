//! Threads, where the module is built for shared memory.
//!
//! A thread is a worker of the page with an instance of the module over the same memory. The page makes the workers, because
//! the thread that computes cannot: it does not come back to its events. Each calls [`run_thread`] and waits there; the one
//! that computes calls [`start_threads`], which makes the pool of all of them and of itself. Nobody ends a thread from
//! here: the page ends its worker.
//!
//! This is rayon's way to bring one's own threads, `ThreadPoolBuilder::spawn_handler`. The thread that computes is in the
//! pool, so that what the library tells it, and its question whether to stop, still happen on it.

use js_sys::Error;
use rayon::{ThreadBuilder, ThreadPoolBuilder};
use std::sync::{Condvar, Mutex, PoisonError};
use wasm_bindgen::prelude::{JsValue, wasm_bindgen};

/// Threads of the pool that no worker has taken yet.
static WAITING: Mutex<Vec<ThreadBuilder>> = Mutex::new(Vec::new());
/// Told of each of them.
static ARRIVED: Condvar = Condvar::new();

/// All that follows uses this many threads, this one included; returns when all others are there. Call it once, before
/// all else. Without it, and in a module that is not built for shared memory, there is one.
///
/// # Errors
/// There are threads already.
#[wasm_bindgen(js_name = startThreads)]
pub fn start_threads(count: usize) -> Result<(), JsValue> {
    ThreadPoolBuilder::new()
        .num_threads(count.max(1))
        .use_current_thread()
        .spawn_handler(|thread| {
            let mut waiting = WAITING.lock().unwrap_or_else(PoisonError::into_inner);
            waiting.push(thread);
            ARRIVED.notify_one();
            Ok(())
        })
        .build_global()
        .map_err(|error| Error::new(&error.to_string()).into())
}

/// Is one of the threads that [`start_threads`] makes, now or later, and does not return. For a worker of its own, in a module
/// that is built for shared memory.
#[wasm_bindgen(js_name = runThread)]
pub fn run_thread() {
    let waiting = WAITING.lock().unwrap_or_else(PoisonError::into_inner);
    let mut waiting = ARRIVED
        .wait_while(waiting, |waiting| waiting.is_empty())
        .unwrap_or_else(PoisonError::into_inner);
    let thread = waiting.pop();
    drop(waiting);
    if let Some(thread) = thread {
        thread.run();
    }
}

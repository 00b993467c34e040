//! Long calls: without the interpreter's lock, with progress, and stopped by Ctrl-C.

use crate::errors::raised;
use nurbskin::Error;
use nurbskin::progress::Progress;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// How long the interpreter waits between two looks.
const INTERVAL: Duration = Duration::from_millis(50);

/// What a computation in another thread tells.
#[derive(Default)]
struct Told {
    /// Stages that began since the last look, with their lengths.
    stages: Mutex<Vec<(&'static str, Option<u64>)>>,
    /// Steps of the current one.
    done: AtomicU64,
    stop: AtomicBool,
}

impl Progress for Told {
    fn stage(&self, name: &'static str, steps: Option<u64>) {
        let mut stages = self.stages.lock().unwrap_or_else(PoisonError::into_inner);
        stages.push((name, steps));
        self.done.store(0, Ordering::Relaxed);
    }
    fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Ordering::Relaxed);
    }
    fn warn(&self, _: &str) {}
    fn cancelled(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// Passes on what was told to `callback(stage, done, total)`.
struct Shown<'a, 'py> {
    callback: Option<&'a Bound<'py, PyAny>>,
    stage: Option<(&'static str, Option<u64>)>,
    done: u64,
}

impl Shown<'_, '_> {
    fn look(&mut self, told: &Told) -> PyResult<()> {
        let Some(callback) = self.callback else {
            return Ok(());
        };
        let began =
            std::mem::take(&mut *told.stages.lock().unwrap_or_else(PoisonError::into_inner));
        for (name, total) in began {
            (self.stage, self.done) = (Some((name, total)), 0);
            callback.call1((name, 0_u64, total))?;
        }
        let done = told.done.load(Ordering::Relaxed);
        if let (Some((name, total)), true) = (self.stage, done > self.done) {
            self.done = done;
            callback.call1((name, done, total))?;
        }
        Ok(())
    }
}

/// Does `work` in a thread of its own. Meanwhile other Python threads run, signals are heard, and `callback`, if there is
/// one, is told of the progress; an exception of either stops the work and is raised.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    callback: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&dyn Progress) -> nurbskin::Result<T> + Send,
) -> PyResult<T> {
    let told = Told::default();
    let (sender, mut done) = channel::<()>();
    let mut shown = Shown {
        callback,
        stage: None,
        done: 0,
    };
    let (result, stopped) = std::thread::scope(|scope| {
        let worker = scope.spawn(|| {
            // Dropped at the end, even of a panic.
            let _sender = sender;
            work(&told)
        });
        let mut stopped = None;
        loop {
            let finished;
            (done, finished) = wait(py, done);
            if stopped.is_none()
                && let Err(error) = py.check_signals().and_then(|()| shown.look(&told))
            {
                told.stop.store(true, Ordering::Relaxed);
                stopped = Some(error);
            }
            if finished {
                break;
            }
        }
        (worker.join(), stopped)
    });
    if let Some(error) = stopped {
        return Err(error);
    }
    match result {
        Ok(result) => result.map_err(|error| raised(py, &error)),
        Err(_) => Err(raised(
            py,
            &Error::NoSolution("an internal error; please report it with the data".into()),
        )),
    }
}

/// Waits for an interval, or until the work is done, without the lock.
fn wait(py: Python<'_>, done: Receiver<()>) -> (Receiver<()>, bool) {
    py.detach(move || {
        let finished = done.recv_timeout(INTERVAL) == Err(RecvTimeoutError::Disconnected);
        (done, finished)
    })
}

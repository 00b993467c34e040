//! Long calls: without the interpreter's lock, with progress, and stopped by Ctrl-C.

use crate::errors::raised;
use nurbskin::Error;
use nurbskin::progress::Progress;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
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
            // What went before is done.
            if let Some((before, Some(all))) = self.stage
                && self.done < all
            {
                callback.call1((before, all, all))?;
            }
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

/// How long work that was told to stop may take to do so before it is left to itself.
const PATIENCE: Duration = Duration::from_secs(1);

/// The process in which threads were started first. A fork has none of them, and would wait for them without end.
static PROCESS: OnceLock<u32> = OnceLock::new();

/// Refuses to work in a fork of a process that has worked already.
pub(crate) fn refuse_fork(py: Python<'_>) -> PyResult<()> {
    let here = std::process::id();
    if *PROCESS.get_or_init(|| here) == here {
        return Ok(());
    }
    let what = "this process was forked from one that had used nurbskin, whose threads it has not: start processes with \
                the method spawn or forkserver";
    Err(raised(py, &Error::Unsupported(what.into())))
}

/// Does `work` in a thread of its own. Meanwhile other Python threads run, signals are heard, and `callback`, if there is
/// one, is told of the progress; an exception of either stops the work and is raised. Work that does not ask whether to
/// stop is left to end by itself, unheard.
pub(crate) fn watched<T: Send + 'static>(
    py: Python<'_>,
    callback: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&dyn Progress) -> nurbskin::Result<T> + Send + 'static,
) -> PyResult<T> {
    refuse_fork(py)?;
    let told = Arc::new(Told::default());
    let (sender, mut done) = channel();
    let mut shown = Shown {
        callback,
        stage: None,
        done: 0,
    };
    let worker = {
        let told = Arc::clone(&told);
        // Dropped at the end, even of a panic. Nobody may be left to listen.
        move || drop(sender.send(work(&*told)))
    };
    if let Err(why) = std::thread::Builder::new().spawn(worker) {
        let what = format!("no thread can be started: {why}");
        return Err(raised(py, &Error::NoSolution(what)));
    }
    loop {
        let result;
        (done, result) = wait(py, done, INTERVAL);
        if let Err(error) = py.check_signals().and_then(|()| shown.look(&told)) {
            told.stop.store(true, Ordering::Relaxed);
            if matches!(result, Err(RecvTimeoutError::Timeout)) {
                let _ = wait(py, done, PATIENCE);
            }
            return Err(error);
        }
        match result {
            Ok(result) => return result.map_err(|error| raised(py, &error)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                let what = "an internal error; please report it with the data";
                return Err(raised(py, &Error::NoSolution(what.into())));
            }
        }
    }
}

/// Waits for the result, without the interpreter's lock.
fn wait<T: Send>(
    py: Python<'_>,
    done: Receiver<T>,
    time: Duration,
) -> (Receiver<T>, Result<T, RecvTimeoutError>) {
    py.detach(move || {
        let result = done.recv_timeout(time);
        (done, result)
    })
}

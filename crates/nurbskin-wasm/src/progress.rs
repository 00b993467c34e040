//! Stages and cancelling, through functions of the caller.
//!
//! The library's [`Progress`] may be called from any thread, a function of JavaScript from its own only, so the functions
//! are kept per thread. Other threads leave their steps for the thread of the call, which tells them with its own, and
//! stop when it has been told to. What they say in words nobody hears; warnings are in the figures, too.

use js_sys::{Function, Reflect};
use nurbskin::progress::Progress;
use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use wasm_bindgen::{JsCast, JsValue};

thread_local! {
    /// The functions of the call that runs on this thread.
    static CALLER: RefCell<Option<Caller>> = const { RefCell::new(None) };
}

/// Functions of an object of the caller.
struct Caller {
    stage: Option<Function>,
    advance: Option<Function>,
    tell: Option<Function>,
    warn: Option<Function>,
    cancelled: Option<Function>,
}

/// A [`Progress`] that calls the functions of an object, until it is dropped.
#[derive(Debug)]
pub(crate) struct Watched {
    /// Steps of other threads that nobody has been told.
    untold: AtomicU64,
    /// The caller has asked to stop.
    stopped: AtomicBool,
}

impl Watched {
    /// For an object with any of the functions `stage`, `advance`, `tell`, `warn` and `cancelled`, or `undefined`.
    pub(crate) fn new(object: &JsValue) -> Self {
        let function = |name: &str| {
            let value = Reflect::get(object, &name.into()).ok()?;
            Some(value.dyn_ref::<Function>()?.bind0(object))
        };
        CALLER.set(Some(Caller {
            stage: function("stage"),
            advance: function("advance"),
            tell: function("tell"),
            warn: function("warn"),
            cancelled: function("cancelled"),
        }));
        Self {
            untold: AtomicU64::new(0),
            stopped: AtomicBool::new(false),
        }
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        CALLER.take();
    }
}

/// Whether this is the thread of a call.
fn is_caller() -> bool {
    CALLER.with_borrow(Option::is_some)
}

/// Calls a function of the caller; what it throws is its own matter.
fn call(of: impl Fn(&Caller) -> Option<&Function>, arguments: &[JsValue]) -> Option<JsValue> {
    let function = CALLER.with_borrow(|caller| of(caller.as_ref()?).cloned())?;
    match arguments {
        [] => function.call0(&JsValue::UNDEFINED),
        [a] => function.call1(&JsValue::UNDEFINED, a),
        [a, b, ..] => function.call2(&JsValue::UNDEFINED, a, b),
    }
    .ok()
}

impl Progress for Watched {
    #[expect(
        clippy::cast_precision_loss,
        reason = "counts of steps are far below 2^53"
    )]
    fn stage(&self, name: &'static str, steps: Option<u64>) {
        if is_caller() {
            // They are of the stage before.
            self.untold.store(0, Relaxed);
        }
        let steps = steps.map_or(JsValue::UNDEFINED, |steps| (steps as f64).into());
        call(|caller| caller.stage.as_ref(), &[name.into(), steps]);
    }

    #[expect(
        clippy::cast_precision_loss,
        reason = "counts of steps are far below 2^53"
    )]
    fn advance(&self, steps: u64) {
        if is_caller() {
            let all = steps + self.untold.swap(0, Relaxed);
            call(|caller| caller.advance.as_ref(), &[(all as f64).into()]);
        } else {
            self.untold.fetch_add(steps, Relaxed);
        }
    }

    fn tell(&self, so_far: &str) {
        call(|caller| caller.tell.as_ref(), &[so_far.into()]);
    }

    fn warn(&self, message: &str) {
        call(|caller| caller.warn.as_ref(), &[message.into()]);
    }

    fn cancelled(&self) -> bool {
        if call(|caller| caller.cancelled.as_ref(), &[]).is_some_and(|said| said.is_truthy()) {
            self.stopped.store(true, Relaxed);
        }
        self.stopped.load(Relaxed)
    }
}

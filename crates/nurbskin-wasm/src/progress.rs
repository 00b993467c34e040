//! Stages and cancelling, through functions of the caller.
//!
//! The library's [`Progress`] may be called from any thread, a function of JavaScript from its own only. The functions
//! are kept per thread: on another thread, of which there is none, nobody would be told.

use js_sys::{Function, Reflect};
use nurbskin::progress::Progress;
use std::cell::RefCell;
use wasm_bindgen::{JsCast, JsValue};

thread_local! {
    /// The functions of the call that runs.
    static CALLER: RefCell<Caller> = RefCell::new(Caller::default());
}

/// Functions of an object of the caller.
#[derive(Clone, Default)]
struct Caller {
    stage: Option<Function>,
    advance: Option<Function>,
    tell: Option<Function>,
    warn: Option<Function>,
    cancelled: Option<Function>,
}

/// A [`Progress`] that calls the functions of an object, until it is dropped.
#[derive(Debug)]
pub(crate) struct Watched(());

impl Watched {
    /// For an object with any of the functions `stage`, `advance`, `tell`, `warn` and `cancelled`, or `undefined`.
    pub(crate) fn new(object: &JsValue) -> Self {
        let function = |name: &str| {
            let value = Reflect::get(object, &name.into()).ok()?;
            Some(value.dyn_ref::<Function>()?.bind0(object))
        };
        CALLER.set(Caller {
            stage: function("stage"),
            advance: function("advance"),
            tell: function("tell"),
            warn: function("warn"),
            cancelled: function("cancelled"),
        });
        Self(())
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        CALLER.take();
    }
}

/// Calls a function of the caller; what it throws is its own matter.
fn call(of: impl Fn(&Caller) -> Option<&Function>, arguments: &[JsValue]) -> Option<JsValue> {
    let function = CALLER.with_borrow(|caller| of(caller).cloned())?;
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
        let steps = steps.map_or(JsValue::UNDEFINED, |steps| (steps as f64).into());
        call(|caller| caller.stage.as_ref(), &[name.into(), steps]);
    }

    #[expect(
        clippy::cast_precision_loss,
        reason = "counts of steps are far below 2^53"
    )]
    fn advance(&self, steps: u64) {
        call(|caller| caller.advance.as_ref(), &[(steps as f64).into()]);
    }

    fn tell(&self, so_far: &str) {
        call(|caller| caller.tell.as_ref(), &[so_far.into()]);
    }

    fn warn(&self, message: &str) {
        call(|caller| caller.warn.as_ref(), &[message.into()]);
    }

    fn cancelled(&self) -> bool {
        call(|caller| caller.cancelled.as_ref(), &[]).is_some_and(|said| said.is_truthy())
    }
}

//! Errors and JSON, between the two languages.
//!
//! An error of the library becomes an `Error` of JavaScript with the message, and a `kind` as in the JSON of the command.

use js_sys::{JSON, Reflect};
use nurbskin::Error;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::cell::RefCell;
use wasm_bindgen::JsValue;

thread_local! {
    /// The message of the last panic.
    static PANIC: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Keeps the message of a panic.
pub(crate) fn remember(message: &str) {
    PANIC.with_borrow_mut(|kept| *kept = Some(message.to_owned()));
}

/// The message of the last panic.
pub(crate) fn remembered() -> Option<String> {
    PANIC.with_borrow(Clone::clone)
}

/// The kind of an error, as in the JSON of the command.
fn kind(error: &Error) -> &'static str {
    match error {
        Error::Read { .. } => "read",
        Error::Write { .. } => "write",
        Error::Invalid(_) => "invalid",
        Error::NoSolution(_) => "no_solution",
        Error::Cancelled => "cancelled",
        _ => "unsupported",
    }
}

/// The error as JavaScript throws it.
#[expect(clippy::needless_pass_by_value, reason = "for `map_err`")]
pub(crate) fn thrown(error: Error) -> JsValue {
    let thrown: JsValue = js_sys::Error::new(&error.to_string()).into();
    set(&thrown, "kind", &kind(&error).into());
    thrown
}

/// Sets a property of an object.
pub(crate) fn set(object: &JsValue, key: &str, value: &JsValue) {
    // Fails for what is no object only.
    let _ = Reflect::set(object, &key.into(), value);
}

/// The value as an object of JavaScript.
///
/// # Errors
/// The value cannot be JSON.
pub(crate) fn object(value: &impl Serialize) -> Result<JsValue, JsValue> {
    let text = serde_json::to_string(value).map_err(|error| thrown(wrong(&error)))?;
    JSON::parse(&text)
}

/// The options in an object of JavaScript; the default for `undefined` and `null`.
///
/// # Errors
/// The object has other keys or values.
pub(crate) fn options<T: DeserializeOwned + Default>(object: &JsValue) -> Result<T, JsValue> {
    if object.is_undefined() || object.is_null() {
        return Ok(T::default());
    }
    let text: String = JSON::stringify(object)?.into();
    serde_json::from_str(&text).map_err(|error| thrown(wrong(&error)))
}

fn wrong(error: &serde_json::Error) -> Error {
    Error::invalid(format!("the options cannot be read: {error}"))
}

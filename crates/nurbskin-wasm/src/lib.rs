//! The library for browsers and Node: bytes in, bytes out.
//!
//! A front end of the pipeline, as the command is, with no geometry of its own. An [`Input`](input::Input) is a scan or a
//! CAD file in memory; a [`Fit`](fit::Fit) and a [`Comparison`](compare::Comparison) hold a result, its figures, what a
//! viewer draws of it, and its files. Calls block until they are done: a page makes them in a worker. They use one thread, or
//! more where the module is built for shared memory.
//!
//! | module | does |
//! |---|---|
//! | [`input`] | files in memory: what they are, what a viewer draws, their hash, conversion |
//! | [`fit`], [`compare`] | the verbs |
//! | [`example`] | scans of the virtual scanner |
//! | [`options`] | options as JSON objects |
//! | [`scene`] | the data of a report page as typed arrays |
//! | [`progress`] | stages and cancelling, through functions of the caller |
//! | [`threads`] | workers of a page as threads |
//! | [`errors`] | errors and JSON, between the two languages |

pub mod compare;
pub mod errors;
pub mod example;
pub mod fit;
pub mod input;
pub mod options;
pub mod progress;
mod reports;
pub mod scene;
pub mod threads;

use wasm_bindgen::prelude::wasm_bindgen;

/// The types of the objects that cross the border, for TypeScript.
#[wasm_bindgen(typescript_custom_section)]
const TYPES: &'static str = include_str!("types.ts");

/// Version of the library.
#[must_use]
#[wasm_bindgen]
pub fn version() -> String {
    env!("CARGO_PKG_VERSION").to_owned()
}

/// Keeps the message of a panic, which the trap after it does not carry. Call it once, before all else.
#[wasm_bindgen(start)]
pub fn start() {
    std::panic::set_hook(Box::new(|info| errors::remember(&info.to_string())));
}

/// The message of the panic that ended the module, if one did; without one, a trap means that memory ran out.
#[must_use]
#[wasm_bindgen(js_name = lastPanic)]
pub fn last_panic() -> Option<String> {
    errors::remembered()
}

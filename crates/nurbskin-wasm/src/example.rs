//! Scans of the virtual scanner, as files in memory.

use crate::errors::{options, thrown};
use crate::options::SimulateOptions;
use nurbskin::io::write_scan_to;
use nurbskin::scan::simulate::{self, Body, Shape};
use nurbskin::{Error, Result};
use wasm_bindgen::prelude::{JsValue, wasm_bindgen};

/// A scan of a known shape or body as a PLY file: the bytes that `nurbskin simulate SHAPE -o scan.ply` writes.
///
/// # Errors
/// An unknown shape; options out of their ranges.
#[wasm_bindgen(js_name = simulate)]
pub fn simulated(
    shape: &str,
    #[wasm_bindgen(unchecked_optional_param_type = "SimulateOptions", js_name = options)]
    wishes: &JsValue,
) -> std::result::Result<Vec<u8>, JsValue> {
    let wishes: SimulateOptions = options(wishes)?;
    bytes(shape, &wishes).map_err(thrown)
}

/// The names of all shapes and bodies.
#[must_use]
#[wasm_bindgen]
pub fn shapes() -> Vec<String> {
    names().map(str::to_owned).collect()
}

fn names() -> impl Iterator<Item = &'static str> {
    Shape::ALL
        .into_iter()
        .map(Shape::name)
        .chain(Body::ALL.into_iter().map(Body::name))
}

fn bytes(name: &str, wishes: &SimulateOptions) -> Result<Vec<u8>> {
    let scan = if let Some(shape) = Shape::from_name(name) {
        simulate::scan(shape, &wishes.of_shape()?)?.scan
    } else if let Some(body) = Body::from_name(name) {
        simulate::scan_body(body, &wishes.of_body())?.scan
    } else {
        let names: Vec<&str> = names().collect();
        return Err(Error::invalid(format!(
            "unknown shape {name}: use one of {}",
            names.join(", ")
        )));
    };
    let mut bytes = Vec::new();
    write_scan_to(&mut bytes, name, "ply", &scan)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use nurbskin::pipeline::Source;

    #[test]
    fn examples_are_scans() {
        let options: SimulateOptions =
            serde_json::from_str(r#"{"points":400,"noise":0.05}"#).unwrap();
        let made = bytes("pot", &options).unwrap();
        let scan = Source::bytes("pot.ply", made, Some("ply"))
            .unwrap()
            .read_scan();
        assert_eq!(scan.unwrap().points.len(), 400);
        let said = bytes("teapot", &options).unwrap_err().to_string();
        assert!(said.contains("use one of pot, patch"), "{said}");
    }
}

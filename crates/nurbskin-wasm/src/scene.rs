//! The data of a report page as typed arrays.
//!
//! A [`Document`] has its coordinates as bytes, which its JSON writes in base64. Here the bytes become typed arrays at the
//! same places of the object, and cross the border without a detour by text.

use crate::errors::{object, set};
use js_sys::{Float32Array, Reflect, Uint8Array, Uint32Array};
use nurbskin::report::Document;
use nurbskin::report::document::Packed;
use wasm_bindgen::JsValue;

/// Type of the numbers in an array.
#[derive(Clone, Copy)]
enum Kind {
    Float,
    Integer,
    Byte,
}

/// Bytes taken out of a document, with the way to them.
struct Taken(&'static [&'static str], Kind, Vec<u8>);

/// The document as an object with typed arrays.
///
/// # Errors
/// The document cannot be JSON.
pub(crate) fn scene(mut document: Document) -> Result<JsValue, JsValue> {
    let taken = take(&mut document);
    let scene = object(&document)?;
    for Taken(way, kind, bytes) in taken {
        let Some((last, before)) = way.split_last() else {
            continue;
        };
        let mut place = scene.clone();
        for key in before {
            place = Reflect::get(&place, &(*key).into())?;
        }
        set(&place, last, &array(kind, &bytes));
    }
    Ok(scene)
}

/// The bytes as an array of JavaScript's own memory.
fn array(kind: Kind, bytes: &[u8]) -> JsValue {
    let words = bytes.as_chunks::<4>().0;
    match kind {
        Kind::Byte => Uint8Array::from(bytes).into(),
        Kind::Float => {
            let numbers: Vec<f32> = words.iter().map(|&w| f32::from_le_bytes(w)).collect();
            Float32Array::from(&numbers[..]).into()
        }
        Kind::Integer => {
            let numbers: Vec<u32> = words.iter().map(|&w| u32::from_le_bytes(w)).collect();
            Uint32Array::from(&numbers[..]).into()
        }
    }
}

/// Takes all bytes out of a document.
fn take(document: &mut Document) -> Vec<Taken> {
    let mut taken = Vec::new();
    let mut one = |way: &'static [&'static str], kind: Kind, packed: Option<&mut Packed>| {
        if let Some(packed) = packed {
            taken.push(Taken(way, kind, std::mem::take(&mut packed.0)));
        }
    };
    if let Some(mesh) = &mut document.mesh {
        one(
            &["mesh", "positions"],
            Kind::Float,
            Some(&mut mesh.positions),
        );
        one(&["mesh", "normals"], Kind::Float, Some(&mut mesh.normals));
        one(
            &["mesh", "parameters"],
            Kind::Float,
            mesh.parameters.as_mut(),
        );
        one(
            &["mesh", "vertex_faces"],
            Kind::Integer,
            mesh.vertex_faces.as_mut(),
        );
        one(
            &["mesh", "triangles"],
            Kind::Integer,
            Some(&mut mesh.triangles),
        );
        one(&["mesh", "deviation"], Kind::Float, mesh.deviation.as_mut());
        one(
            &["mesh", "mean_curvature"],
            Kind::Float,
            mesh.mean_curvature.as_mut(),
        );
        one(
            &["mesh", "gaussian_curvature"],
            Kind::Float,
            mesh.gaussian_curvature.as_mut(),
        );
    }
    let lines = &mut document.lines;
    for (way, polylines) in [
        (&["lines", "edges", "positions"][..], &mut lines.edges),
        (&["lines", "seams", "positions"], &mut lines.seams),
        (&["lines", "iso_curves", "positions"], &mut lines.iso_curves),
        (
            &["lines", "control_net", "positions"],
            &mut lines.control_net,
        ),
    ] {
        // Kinds without lines are not in the object.
        if !polylines.is_empty() {
            one(way, Kind::Float, Some(&mut polylines.positions));
        }
    }
    if let Some(points) = &mut document.points {
        one(
            &["points", "positions"],
            Kind::Float,
            Some(&mut points.positions),
        );
        one(
            &["points", "deviation"],
            Kind::Float,
            points.deviation.as_mut(),
        );
        one(&["points", "index"], Kind::Integer, Some(&mut points.index));
        one(
            &["points", "parameters"],
            Kind::Float,
            points.parameters.as_mut(),
        );
        one(&["points", "faces"], Kind::Integer, points.faces.as_mut());
        one(&["points", "state"], Kind::Byte, Some(&mut points.state));
    }
    taken
}

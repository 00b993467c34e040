//! The data of a report page as typed arrays.
//!
//! A [`Document`] has its coordinates as packed lists, which its JSON compresses. Here they become typed arrays at the same
//! places of the object, and cross the border without a detour by text.

use crate::errors::{object, set};
use js_sys::{Float32Array, Reflect, Uint8Array, Uint32Array};
use nurbskin::report::Document;
use nurbskin::report::document::Packed;
use wasm_bindgen::JsValue;

/// Type of the numbers in an array.
#[derive(Clone, Copy)]
enum Kind {
    Float,
    Direction,
    Integer,
    Byte,
}

/// A list taken out of a document, with the way to it.
struct Taken(&'static [&'static str], Kind, Packed);

/// The document as an object with typed arrays.
///
/// # Errors
/// The document cannot be JSON.
pub(crate) fn scene(mut document: Document) -> Result<JsValue, JsValue> {
    let taken = take(&mut document);
    let scene = object(&document)?;
    for Taken(way, kind, list) in taken {
        let Some((last, before)) = way.split_last() else {
            continue;
        };
        let mut place = scene.clone();
        for key in before {
            place = Reflect::get(&place, &(*key).into())?;
        }
        set(&place, last, &array(kind, &list));
    }
    Ok(scene)
}

/// The list as an array of JavaScript's own memory.
fn array(kind: Kind, list: &Packed) -> JsValue {
    match kind {
        Kind::Float => Float32Array::from(&list.to_floats()[..]).into(),
        Kind::Direction => {
            let numbers = list.to_directions();
            Float32Array::from(numbers.as_flattened()).into()
        }
        Kind::Integer => Uint32Array::from(&list.to_integers()[..]).into(),
        Kind::Byte => {
            let byte = |x: u32| u8::try_from(x).unwrap_or(u8::MAX);
            let bytes: Vec<u8> = list.to_integers().into_iter().map(byte).collect();
            Uint8Array::from(&bytes[..]).into()
        }
    }
}

/// Takes all lists out of a document.
fn take(document: &mut Document) -> Vec<Taken> {
    let mut taken = Vec::new();
    let mut one = |way: &'static [&'static str], kind: Kind, packed: Option<&mut Packed>| {
        if let Some(packed) = packed {
            taken.push(Taken(way, kind, std::mem::take(packed)));
        }
    };
    if let Some(mesh) = &mut document.mesh {
        one(
            &["mesh", "positions"],
            Kind::Float,
            Some(&mut mesh.positions),
        );
        one(
            &["mesh", "normals"],
            Kind::Direction,
            Some(&mut mesh.normals),
        );
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

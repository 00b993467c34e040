//! Files in memory: what they are, what a viewer draws, their hash, conversion.

use crate::errors::{object, thrown};
use crate::progress::Watched;
use crate::scene::scene;
use nurbskin::pipeline::{self, ConvertOptions, Source, Target};
use nurbskin::report::{self, Kind, Measured, Subject};
use nurbskin::scan::{Organisation, Scan};
use nurbskin::{DVec3, Error, Result};
use serde_json::{Value, json};
use std::path::PathBuf;
use wasm_bindgen::prelude::{JsValue, wasm_bindgen};

/// A scan or a CAD file in memory; its content decides the format, as everywhere in the library.
#[wasm_bindgen]
#[derive(Debug)]
pub struct Input {
    source: Source,
    name: String,
    bytes: usize,
}

#[wasm_bindgen]
impl Input {
    /// Bytes under the name of a file. An extension that names no format is ignored.
    ///
    /// # Errors
    /// There are no bytes.
    #[wasm_bindgen(constructor)]
    pub fn new(name: &str, bytes: Vec<u8>) -> std::result::Result<Input, JsValue> {
        Self::of(name, bytes).map_err(thrown)
    }

    /// The name of the file.
    #[wasm_bindgen(getter)]
    #[must_use]
    pub fn name(&self) -> String {
        self.name.clone()
    }

    /// Whether it is a CAD file, by its beginning or its name.
    #[wasm_bindgen(getter, js_name = isCad)]
    #[must_use]
    pub fn is_cad(&self) -> bool {
        self.source.is_cad()
    }

    /// What the file holds and a first view of it, all points as they are: a `Look`.
    ///
    /// # Errors
    /// Errors of the reader.
    #[wasm_bindgen(unchecked_return_type = "Look")]
    pub fn look(
        &self,
        #[wasm_bindgen(unchecked_optional_param_type = "Progress")] progress: &JsValue,
    ) -> std::result::Result<JsValue, JsValue> {
        let progress = Watched::new(progress);
        let (about, document) = self.looked(&progress).map_err(thrown)?;
        let look = object(&about)?;
        crate::errors::set(&look, "scene", &scene(document)?);
        Ok(look)
    }

    /// What the file holds, with spacing, noise and parts: the JSON of `nurbskin info`.
    ///
    /// # Errors
    /// Errors of the reader.
    #[wasm_bindgen(unchecked_return_type = "Record<string, unknown>")]
    pub fn info(
        &self,
        #[wasm_bindgen(unchecked_optional_param_type = "Progress")] progress: &JsValue,
    ) -> std::result::Result<JsValue, JsValue> {
        let progress = Watched::new(progress);
        object(&pipeline::info_from(&self.source, &progress).map_err(thrown)?)
    }

    /// The checks of a CAD file: the JSON of `nurbskin check`.
    ///
    /// # Errors
    /// Errors of the reader.
    #[wasm_bindgen(unchecked_return_type = "Record<string, unknown>")]
    pub fn check(
        &self,
        #[wasm_bindgen(unchecked_optional_param_type = "Progress")] progress: &JsValue,
    ) -> std::result::Result<JsValue, JsValue> {
        let progress = Watched::new(progress);
        object(&pipeline::check_from(&self.source, &progress).map_err(thrown)?)
    }

    /// The same content in the format that the name `to` has: scan to scan, CAD to CAD, CAD to mesh.
    ///
    /// # Errors
    /// As `nurbskin convert`.
    pub fn convert(&self, to: &str) -> std::result::Result<Vec<u8>, JsValue> {
        let progress = Watched::new(&JsValue::UNDEFINED);
        let target = [Target::Named(PathBuf::from(to))];
        let options = ConvertOptions::default();
        pipeline::convert_from(&self.source, &target, &options, &progress)
            .and_then(|converted| content(converted.outputs))
            .map_err(thrown)
    }

    /// Name, size and SHA-256.
    ///
    /// # Errors
    /// The object cannot be made.
    #[wasm_bindgen(unchecked_return_type = "Identity")]
    pub fn identity(&self) -> std::result::Result<JsValue, JsValue> {
        let source = self.source.identity().map_err(thrown)?;
        let sha256 = source.map(|source| source.sha256);
        object(&json!({ "name": self.name, "bytes": self.bytes, "sha256": sha256 }))
    }
}

/// The bytes of the only output.
pub(crate) fn content(outputs: Vec<pipeline::Output>) -> Result<Vec<u8>> {
    let content = outputs.into_iter().find_map(|output| output.content);
    content.ok_or_else(|| Error::invalid("nothing was written"))
}

impl Input {
    pub(crate) fn of(name: &str, bytes: Vec<u8>) -> Result<Self> {
        if bytes.is_empty() {
            return Err(Error::read(name, "", "the file is empty"));
        }
        let count = bytes.len();
        let path = PathBuf::from(name);
        // What the name says counts where it names a format; the content decides in any case.
        let extension = path.extension().map(|e| e.to_string_lossy().into_owned());
        let known = Source::bytes(name, Vec::new(), extension.as_deref()).is_ok();
        let format = extension.filter(|_| known);
        Ok(Self {
            source: Source::bytes(name, bytes, format.as_deref())?,
            name: name.to_owned(),
            bytes: count,
        })
    }

    pub(crate) fn source(&self) -> &Source {
        &self.source
    }

    fn looked(&self, progress: &Watched) -> Result<(Value, report::Document)> {
        use nurbskin::progress::Progress;
        progress.stage("read", None);
        if self.source.is_cad() {
            let file = self.source.read_cad()?;
            let document = report::document(
                &Subject {
                    kind: Kind::View,
                    title: &self.name,
                    command: None,
                    heading: None,
                    date: None,
                    kinds: None,
                    inputs: &[],
                    outcome: &Value::Null,
                    unit: file.model.unit,
                    model: Some(&file.model),
                    scan: None,
                    triangles: None,
                    origin: DVec3::ZERO,
                },
                progress,
            )?;
            let about = json!({
                "kind": "cad", "name": self.name, "bytes": self.bytes, "format": file.format,
                "unit": file.model.unit, "unitSource": file.unit_source, "boundingBox": document.bounding_box,
                "faces": file.model.faces().len(), "warnings": file.warnings,
            });
            return Ok((about, document));
        }
        let scan = self.source.read_scan()?;
        let document = view_of(&scan, &self.name, progress)?;
        let triangles = match &scan.organisation {
            Organisation::Mesh(triangles) => Some(triangles.len()),
            _ => None,
        };
        let about = json!({
            "kind": "scan", "name": self.name, "bytes": self.bytes, "format": scan.format,
            "unit": scan.unit, "unitSource": scan.unit_source, "boundingBox": scan.corners(),
            "points": scan.points.len(), "triangles": triangles,
            "organisation": scan.organisation.name(), "warnings": scan.warnings,
        });
        Ok((about, document))
    }
}

/// The points of a scan as they are, with its triangles if it is a mesh.
fn view_of(scan: &Scan, name: &str, progress: &Watched) -> Result<report::Document> {
    if !scan.points.iter().any(|p| p.is_finite()) {
        return Err(Error::read(
            name,
            "",
            "it has no points; check that the file is a complete scan and not only a header",
        ));
    }
    let triangles = match &scan.organisation {
        Organisation::Mesh(triangles) => &triangles[..],
        _ => &[],
    };
    // Triangles name points by their index, so that all points of a mesh stay.
    let kept: Vec<(u32, DVec3)> = (0_u32..)
        .zip(scan.points.iter().copied())
        .filter(|(_, p)| p.is_finite() || !triangles.is_empty())
        .collect();
    let (indices, points): (Vec<u32>, Vec<DVec3>) = kept.into_iter().unzip();
    report::document(
        &Subject {
            kind: Kind::View,
            title: name,
            command: None,
            heading: None,
            date: None,
            kinds: None,
            inputs: &[],
            outcome: &Value::Null,
            unit: scan.unit,
            model: None,
            scan: Some(Measured {
                points: &points,
                indices: &indices,
                records: Some(&scan.records),
                ..Measured::default()
            }),
            triangles: (!triangles.is_empty()).then_some(triangles),
            origin: scan.origin,
        },
        progress,
    )
}

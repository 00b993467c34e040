//! Fits in memory.

use crate::errors::{object, options, thrown};
use crate::input::{Input, content};
use crate::options::FitOptions;
use crate::progress::Watched;
use crate::reports::{csv, json, report_format};
use crate::scene::scene;
use nurbskin::io::Timestamp;
use nurbskin::pipeline::{self, About, Options, Outcome, Source, Target};
use nurbskin::report;
use nurbskin::{Error, Result};
use std::path::PathBuf;
use wasm_bindgen::prelude::{JsValue, wasm_bindgen};

/// The surface of a scan, with its deviation and its files.
#[wasm_bindgen]
#[derive(Debug)]
pub struct Fit {
    outcome: Outcome,
    options: Options,
    source: Source,
    /// Name of the STEP file, and its bytes, which the fit has checked.
    step: (String, Vec<u8>),
}

/// Fits surfaces to a scan. The STEP file is written and checked at once, as by `nurbskin fit`.
///
/// # Errors
/// As `nurbskin fit`.
#[wasm_bindgen]
pub fn fit(
    scan: &Input,
    #[wasm_bindgen(unchecked_optional_param_type = "FitOptions", js_name = options)]
    wishes: &JsValue,
    #[wasm_bindgen(unchecked_optional_param_type = "Progress")] progress: &JsValue,
) -> std::result::Result<Fit, JsValue> {
    let wishes: FitOptions = options(wishes)?;
    let progress = Watched::new(progress);
    fitted(scan.source(), &wishes, &progress).map_err(thrown)
}

fn fitted(source: &Source, wishes: &FitOptions, progress: &Watched) -> Result<Fit> {
    let options = wishes.resolve()?;
    let default = pipeline::default_output(source.path());
    let name = default.file_name().unwrap_or(default.as_os_str());
    let name = name.to_string_lossy().into_owned();
    let target = [Target::Named(PathBuf::from(&name))];
    let mut outcome = pipeline::fit_from(source, &target, &options, progress)?;
    let bytes = outcome
        .outputs
        .iter_mut()
        .find_map(|output| output.content.take());
    let bytes = bytes.ok_or_else(|| Error::invalid("nothing was written"))?;
    Ok(Fit {
        outcome,
        options,
        source: source.clone(),
        step: (name, bytes),
    })
}

#[wasm_bindgen]
impl Fit {
    /// The figures: the JSON of `nurbskin fit --json`.
    ///
    /// # Errors
    /// The object cannot be made.
    #[wasm_bindgen(unchecked_return_type = "FitFigures")]
    pub fn figures(&self) -> std::result::Result<JsValue, JsValue> {
        object(&self.outcome)
    }

    /// What a viewer draws, with the tables of the report.
    ///
    /// # Errors
    /// `cancelled`.
    #[wasm_bindgen(unchecked_return_type = "Scene")]
    pub fn scene(
        &self,
        #[wasm_bindgen(unchecked_optional_param_type = "Progress")] progress: &JsValue,
    ) -> std::result::Result<JsValue, JsValue> {
        scene(self.document(&Watched::new(progress)).map_err(thrown)?)
    }

    /// A file of this name, in the format of its extension: `.step`, `.stp`, `.igs`, `.iges`, `.stl`, `.obj`, `.ply`,
    /// `.glb`, or a report: `.html`, `.json`, `.csv`.
    ///
    /// # Errors
    /// As the writers; an unknown extension.
    pub fn save(&mut self, name: &str) -> std::result::Result<Vec<u8>, JsValue> {
        let progress = Watched::new(&JsValue::UNDEFINED);
        self.saved(name, &progress).map_err(thrown)
    }
}

impl Fit {
    fn document(&self, progress: &Watched) -> Result<report::Document> {
        let output = &self.options.output;
        let about = About {
            heading: &output.heading,
            command: output.command.as_deref(),
            date: output.time.map_or_else(Timestamp::now, Ok)?,
        };
        pipeline::document_of_fit(&self.outcome, Some(&self.source), about, progress)
    }

    fn saved(&mut self, name: &str, progress: &Watched) -> Result<Vec<u8>> {
        if name == self.step.0 {
            return Ok(self.step.1.clone());
        }
        let path = PathBuf::from(name);
        match report_format(name) {
            Some("html") => Ok(report::page(&self.document(progress)?)?.into_bytes()),
            Some("csv") => csv(name, &self.outcome.per_point, self.outcome.origin),
            Some(_) => json(name, &self.outcome),
            None => {
                // The outputs of the outcome stay those of the fit.
                let before = std::mem::take(&mut self.outcome.outputs);
                let target = [Target::Named(path)];
                let written =
                    pipeline::write_to(&mut self.outcome, None, &target, &self.options, progress);
                let after = std::mem::replace(&mut self.outcome.outputs, before);
                written.and_then(|()| content(after))
            }
        }
    }
}

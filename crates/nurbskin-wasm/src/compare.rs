//! Comparisons of scans with CAD files, in memory.

use crate::errors::{object, options, thrown};
use crate::input::Input;
use crate::options::CompareOptions;
use crate::progress::Watched;
use crate::reports::{csv, json, report_format};
use crate::scene::scene;
use nurbskin::pipeline::{self, About, Compared, Source};
use nurbskin::report;
use nurbskin::{Error, Result};
use wasm_bindgen::prelude::{JsValue, wasm_bindgen};

/// The deviation of a scan from a CAD file, with its reports.
#[wasm_bindgen]
#[derive(Debug)]
pub struct Comparison {
    compared: Compared,
    options: CompareOptions,
    scan: Source,
    cad: Source,
}

/// Compares a scan with a CAD file.
///
/// # Errors
/// As `nurbskin deviation`.
#[wasm_bindgen]
pub fn compare(
    scan: &Input,
    cad: &Input,
    #[wasm_bindgen(unchecked_optional_param_type = "CompareOptions", js_name = options)]
    wishes: &JsValue,
    #[wasm_bindgen(unchecked_optional_param_type = "Progress")] progress: &JsValue,
) -> std::result::Result<Comparison, JsValue> {
    let options: CompareOptions = options(wishes)?;
    let progress = Watched::new(progress);
    let (scan, cad) = (scan.source().clone(), cad.source().clone());
    let compared = options
        .resolve()
        .and_then(|options| pipeline::deviation_from(&scan, &cad, &options, &progress))
        .map_err(thrown)?;
    Ok(Comparison {
        compared,
        options,
        scan,
        cad,
    })
}

#[wasm_bindgen]
impl Comparison {
    /// The figures: the JSON of `nurbskin deviation --json`.
    ///
    /// # Errors
    /// The object cannot be made.
    #[wasm_bindgen(unchecked_return_type = "ComparisonFigures")]
    pub fn figures(&self) -> std::result::Result<JsValue, JsValue> {
        object(&self.compared)
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

    /// A report of this name, in the format of its extension: `.html`, `.json` or `.csv`.
    ///
    /// # Errors
    /// An unknown extension.
    pub fn save(&self, name: &str) -> std::result::Result<Vec<u8>, JsValue> {
        self.saved(name, &Watched::new(&JsValue::UNDEFINED))
            .map_err(thrown)
    }
}

impl Comparison {
    fn document(&self, progress: &Watched) -> Result<report::Document> {
        let inputs = [self.scan.clone(), self.cad.clone()];
        let about = About {
            command: self.options.command(),
            ..About::now()?
        };
        pipeline::document_of_deviation(&self.compared, &inputs, about, progress)
    }

    fn saved(&self, name: &str, progress: &Watched) -> Result<Vec<u8>> {
        match report_format(name) {
            Some("html") => Ok(report::page(&self.document(progress)?)?.into_bytes()),
            Some("csv") => csv(name, &self.compared.per_point, self.compared.origin),
            Some(_) => json(name, &self.compared),
            None => Err(Error::invalid(format!(
                "{name}: a comparison has reports: use one of .html, .json, .csv"
            ))),
        }
    }
}

//! Conversion between formats: scan to scan, CAD to CAD, CAD to mesh.
//!
//! The verb reads the input by its content, tessellates or rewrites it, and converts units where the output has another
//! one. A conversion from scan to CAD is refused, because it requires a fit.

use super::output::{
    CHORD_OF_DIAGONAL, MeshOutput, check_all, scan_format, write_mesh, write_points,
};
use super::sanity::doubtful_unit;
use super::{Length, Output, Source, Target, about};
use nurbskin_cad::io::Timestamp;
use nurbskin_cad::io::file::{CadFormat, CadWriteOptions, UNIT_UNKNOWN, cad_text};
use nurbskin_cad::io::step::Schema;
use nurbskin_cad::{Model, extent};
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::UnitSource;
use nurbskin_geometry::{Error, Result, Unit};
use serde::Serialize;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Options of a conversion.
#[derive(Clone, Debug, Default)]
pub struct ConvertOptions {
    /// Chordal tolerance of meshes; a ten-thousandth of the diagonal if absent.
    pub tolerance: Option<Length>,
    /// Unit of the input's numbers; if absent, that of the file, else millimetres.
    pub unit: Option<Unit>,
    /// Unit of the output; that of the input if absent.
    pub to_unit: Option<Unit>,
    /// Application protocol of STEP.
    pub schema: Schema,
    /// Author of the output, for the headers of CAD files; as in the input if empty.
    pub author: String,
    /// The author's organisation, for the same headers; as in the input if empty.
    pub organization: String,
    /// The date in the headers of CAD files; [`Timestamp::now`] if absent. Use one date for all files of a run.
    pub time: Option<Timestamp>,
}

/// Inputs and outputs of a conversion.
#[derive(Clone, Debug, Serialize)]
pub struct Converted {
    /// Version of this JSON: [`SCHEMA`](super::SCHEMA).
    pub schema: u32,
    /// The file read.
    pub input: ConvertedInput,
    /// Files written.
    pub outputs: Vec<Output>,
    /// Warnings: findings that affect the result.
    pub warnings: Vec<String>,
}

/// The input file.
#[derive(Clone, Debug, Serialize)]
pub struct ConvertedInput {
    /// Its path.
    pub path: String,
    /// Its format.
    pub format: Cow<'static, str>,
    /// Unit of its numbers.
    pub unit: Unit,
    /// Source of the unit.
    pub unit_source: UnitSource,
    /// Faces of a CAD file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faces: Option<usize>,
    /// Points of a scan.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<usize>,
    /// Smallest and largest coordinates, in its unit; `None` without finite coordinates.
    pub bounding_box: Option<[[f64; 3]; 2]>,
}

/// Extensions of the possible outputs.
pub const CONVERT_FORMATS: [&str; 12] = [
    "step", "stp", "igs", "iges", "stl", "obj", "ply", "glb", "xyz", "txt", "asc", "csv",
];

/// Converts the file at `input`; the format of each output follows its extension.
///
/// # Errors
/// Errors of reader and writer; [`Error::Invalid`] for the conversion of a scan to a CAD file, which requires a fit,
/// and of a CAD file to points.
pub fn convert(
    input: &Path,
    outputs: &[PathBuf],
    options: &ConvertOptions,
    progress: &dyn Progress,
) -> Result<Converted> {
    let outputs = Target::files(outputs);
    convert_from(&Source::file(input), &outputs, options, progress)
}

/// As [`convert`], from a file or bytes to files or bytes.
///
/// # Errors
/// As [`convert`].
pub fn convert_from(
    source: &Source,
    outputs: &[Target],
    options: &ConvertOptions,
    progress: &dyn Progress,
) -> Result<Converted> {
    check_all(&[source], outputs, &CONVERT_FORMATS)?;
    progress.stage("read", None);
    let convert = if source.is_cad() { of_cad } else { of_scan };
    convert(source, outputs, options, progress).map_err(|error| about(source.path(), error))
}

/// Warning about an input without a unit.
fn assumed(unit: Unit) -> String {
    format!("{UNIT_UNKNOWN}: {unit} assumed (use --unit if it is another)")
}

fn of_cad(
    source: &Source,
    outputs: &[Target],
    options: &ConvertOptions,
    progress: &dyn Progress,
) -> Result<Converted> {
    let file = source.read_cad()?;
    let mut warnings = file.warnings;
    for (entity, count) in &file.unread {
        warnings.push(format!(
            "left out: {count} of {entity}, which cannot be read"
        ));
    }
    let mut model = file.model;
    let mut unit_source = file.unit_source;
    if let Some(unit) = options.unit {
        // The numbers stay the same; only their unit is assigned.
        (model.unit, unit_source) = (unit, UnitSource::Option);
        warnings.retain(|what| !what.starts_with(UNIT_UNKNOWN));
    }
    let box_around = extent(&model)?;
    let read = ConvertedInput {
        path: source.path().display().to_string(),
        format: file.format.into(),
        unit: model.unit,
        unit_source,
        faces: Some(model.faces().len()),
        points: None,
        bounding_box: Some([box_around.low.to_array(), box_around.high.to_array()]),
    };
    if let Some(unit) = options.to_unit {
        model = model.in_unit(unit)?;
    }
    let time = options.time.map_or_else(Timestamp::now, Ok)?;
    let given = |asked: &str, own: &str| if asked.is_empty() { own } else { asked }.to_owned();
    let mut written = Vec::new();
    for target in outputs {
        progress.stage("write", None);
        progress.check()?;
        let output = match CadFormat::from_extension(&target.format()) {
            Some(format) => {
                let [file_name, stem] = target.names();
                let settings = CadWriteOptions {
                    schema: options.schema,
                    product: given(&model.name, &stem),
                    file_name,
                    author: given(&options.author, &file.header.author),
                    organization: given(&options.organization, &file.header.organization),
                    time,
                    ..CadWriteOptions::default()
                };
                let text = cad_text(&model, format, &settings)?;
                target.write_bytes(format.name(), &text)?
            }
            None => mesh_of(&model, target, options, &mut warnings)?,
        };
        written.push(output);
    }
    Ok(Converted {
        schema: super::SCHEMA,
        input: read,
        outputs: written,
        warnings,
    })
}

fn mesh_of(
    model: &Model,
    target: &Target,
    options: &ConvertOptions,
    warnings: &mut Vec<String>,
) -> Result<Output> {
    let extension = target.format();
    if !matches!(extension.as_str(), "stl" | "obj" | "ply" | "glb") {
        return Err(Error::invalid(format!(
            "a CAD file has no points to write as .{extension}: use .stl, .obj, .ply or .glb for a mesh, or another \
             CAD format"
        )));
    }
    let extent = extent(model)?;
    let chord = match options.tolerance {
        Some(length) => length.resolve(model.unit, extent.diagonal()),
        None => CHORD_OF_DIAGONAL * extent.diagonal(),
    };
    let output = MeshOutput {
        model,
        chord,
        origin: nurbskin_geometry::DVec3::ZERO,
        unit_source: UnitSource::File,
    };
    write_mesh(target, &output, warnings)
}

fn of_scan(
    source: &Source,
    outputs: &[Target],
    options: &ConvertOptions,
    progress: &dyn Progress,
) -> Result<Converted> {
    let is_cad = |target: &&Target| CadFormat::from_extension(&target.format()).is_some();
    if let Some(target) = outputs.iter().find(is_cad) {
        return Err(Error::invalid(format!(
            "a scan becomes a CAD file by fitting a surface: nurbskin fit {} -o {}",
            source.path().display(),
            target.path().display()
        )));
    }
    let mut scan = source.read_scan()?;
    let mut warnings = std::mem::take(&mut scan.warnings);
    if let Some(unit) = options.unit {
        (scan.unit, scan.unit_source) = (unit, UnitSource::Option);
    }
    let bounding_box = scan.corners();
    let extents = bounding_box.map(|[low, high]| [0, 1, 2].map(|k| high[k] - low[k]));
    if let Some(doubt) = doubtful_unit(scan.unit_source, scan.unit, extents.unwrap_or_default()) {
        warnings.insert(0, doubt.words_with_next());
    } else if scan.unit_source == UnitSource::Assumed {
        warnings.push(assumed(scan.unit));
    }
    let read = ConvertedInput {
        path: source.path().display().to_string(),
        format: scan.format.clone(),
        unit: scan.unit,
        unit_source: scan.unit_source,
        faces: None,
        points: Some(scan.points.len()),
        bounding_box,
    };
    if let Some(unit) = options.to_unit {
        scan = scan.in_unit(unit);
    }
    let mut written = Vec::new();
    for target in outputs {
        progress.stage("write", None);
        progress.check()?;
        let (output, notes) = write_points(target, scan_format(&target.format()), &scan)?;
        warnings.extend(notes);
        written.push(output);
    }
    Ok(Converted {
        schema: super::SCHEMA,
        input: read,
        outputs: written,
        warnings,
    })
}

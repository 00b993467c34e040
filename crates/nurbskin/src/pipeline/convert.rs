//! From one format to another: scan to scan, CAD to CAD, CAD to mesh.

use super::output::{CHORD_OF_DIAGONAL, MeshOutput, described, extension, write_mesh};
use super::{Length, Output, about};
use crate::cad::Model;
use crate::io::cad::{CadFormat, CadWriteOptions, is_cad_file, read_cad, write_cad};
use crate::io::step::Schema;
use crate::io::{read_scan, write_scan};
use crate::progress::Progress;
use crate::unit::UnitSource;
use crate::{Error, Result, Unit};
use serde::Serialize;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// How a file is converted.
#[derive(Clone, Debug, Default)]
pub struct ConvertOptions {
    /// Chordal tolerance of meshes; a ten-thousandth of the diagonal where absent.
    pub tolerance: Option<Length>,
    /// Unit of the output; that of the input where absent.
    pub unit: Option<Unit>,
    /// Application protocol of STEP.
    pub schema: Schema,
}

/// What a conversion read and wrote.
#[derive(Clone, Debug, Serialize)]
pub struct Converted {
    /// The file read.
    pub input: ConvertedInput,
    /// Files written.
    pub outputs: Vec<Output>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// The file that was read.
#[derive(Clone, Debug, Serialize)]
pub struct ConvertedInput {
    /// Its path.
    pub path: String,
    /// Its format.
    pub format: Cow<'static, str>,
    /// Unit of its numbers.
    pub unit: Unit,
    /// Where the unit was learnt from.
    pub unit_source: UnitSource,
    /// Faces of a CAD file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faces: Option<usize>,
    /// Points of a scan.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<usize>,
}

/// Extensions that a file may be converted to.
pub const CONVERT_FORMATS: [&str; 12] = [
    "step", "stp", "igs", "iges", "stl", "obj", "ply", "glb", "xyz", "txt", "asc", "csv",
];

/// Whether a file shall be a CAD file, by its name.
fn is_cad(path: &Path) -> bool {
    CadFormat::from_extension(&extension(path)).is_some()
}

/// Converts the file at `input`; the format of each output follows its extension.
///
/// # Errors
/// Those of reading and writing; [`Error::Invalid`] for a scan that shall become a CAD file, which takes a fit, and for
/// a CAD file that shall become points.
pub fn convert(
    input: &Path,
    outputs: &[PathBuf],
    options: &ConvertOptions,
    progress: &dyn Progress,
) -> Result<Converted> {
    super::check_folders(outputs)?;
    progress.stage("read", None);
    if is_cad_file(input) {
        of_cad(input, outputs, options, progress).map_err(|error| about(input, error))
    } else {
        of_scan(input, outputs, options, progress).map_err(|error| about(input, error))
    }
}

fn of_cad(
    input: &Path,
    outputs: &[PathBuf],
    options: &ConvertOptions,
    progress: &dyn Progress,
) -> Result<Converted> {
    let file = read_cad(input)?;
    let mut warnings = file.warnings;
    for (entity, count) in &file.unread {
        warnings.push(format!(
            "{count} of {entity} are not understood and left out"
        ));
    }
    let read = ConvertedInput {
        path: input.display().to_string(),
        format: file.format.into(),
        unit: file.model.unit,
        unit_source: file.unit_source,
        faces: Some(file.model.faces().len()),
        points: None,
    };
    let mut model = file.model;
    if let Some(unit) = options.unit {
        model = model.in_unit(unit)?;
    }
    let mut written = Vec::new();
    for path in outputs {
        progress.stage("write", None);
        progress.check()?;
        let format = match CadFormat::from_extension(&extension(path)) {
            Some(format) => {
                let name = |part: Option<&std::ffi::OsStr>| {
                    part.map(|n| n.to_string_lossy().into_owned())
                        .unwrap_or_default()
                };
                let settings = CadWriteOptions {
                    schema: options.schema,
                    product: if model.name.is_empty() {
                        name(path.file_stem())
                    } else {
                        model.name.clone()
                    },
                    file_name: name(path.file_name()),
                    ..CadWriteOptions::default()
                };
                write_cad(path, &model, &settings)?;
                format.name()
            }
            None => mesh_of(&model, path, options, &mut warnings)?,
        };
        written.push(described(path, format)?);
    }
    Ok(Converted {
        input: read,
        outputs: written,
        warnings,
    })
}

fn mesh_of(
    model: &Model,
    path: &Path,
    options: &ConvertOptions,
    warnings: &mut Vec<String>,
) -> Result<&'static str> {
    let extension = extension(path);
    if !matches!(extension.as_str(), "stl" | "obj" | "ply" | "glb") {
        return Err(Error::invalid(format!(
            "a CAD file has no points to write as .{extension}: write .stl, .obj, .ply or .glb, or a CAD file"
        )));
    }
    let extent = crate::cad::extent::extent(model)?;
    let chord = match options.tolerance {
        Some(length) => length.resolve(model.unit, extent.diagonal()),
        None => CHORD_OF_DIAGONAL * extent.diagonal(),
    };
    let output = MeshOutput {
        model,
        chord,
        origin: crate::DVec3::ZERO,
        unit_source: UnitSource::File,
    };
    write_mesh(path, &output, warnings)
}

fn of_scan(
    input: &Path,
    outputs: &[PathBuf],
    options: &ConvertOptions,
    progress: &dyn Progress,
) -> Result<Converted> {
    if let Some(path) = outputs.iter().find(|path| is_cad(path)) {
        return Err(Error::invalid(format!(
            "a scan becomes a surface by fitting one: nurbskin fit {} -o {}",
            input.display(),
            path.display()
        )));
    }
    let mut scan = read_scan(input)?;
    let read = ConvertedInput {
        path: input.display().to_string(),
        format: scan.format.clone(),
        unit: scan.unit,
        unit_source: scan.unit_source,
        faces: None,
        points: Some(scan.points.len()),
    };
    let mut warnings = std::mem::take(&mut scan.warnings);
    if let Some(unit) = options.unit {
        scan = scan.in_unit(unit);
    }
    let mut written = Vec::new();
    for path in outputs {
        progress.stage("write", None);
        progress.check()?;
        warnings.extend(write_scan(path, &scan)?);
        written.push(super::output_of(path)?);
    }
    Ok(Converted {
        input: read,
        outputs: written,
        warnings,
    })
}

//! CAD files, whatever their format.

use super::iges;
use super::iges::{IgesContent, Layout};
use super::step;
use super::step::{Schema, Validation};
use crate::Model;
use crate::io::Timestamp;
use nurbskin_geometry::files::{gzip, sniff};
use nurbskin_geometry::unit::UnitSource;
use nurbskin_geometry::{DVec3, Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::{ErrorKind, Read};
use std::path::Path;

/// What the header of a CAD file says of its origin. What the file does not say is empty.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CadHeader {
    /// Who made it.
    pub author: String,
    /// The author's organisation.
    pub organization: String,
    /// The system that the model comes from.
    pub system: String,
    /// Date and time, as the file spells them.
    pub date: String,
}

/// What was read from a CAD file.
#[derive(Clone, Debug, Default)]
pub struct CadFile {
    /// `iges` or `step`.
    pub format: &'static str,
    /// Faces, edges and so on, in the unit of the file or, where that is none of ours, in millimetres.
    pub model: Model,
    /// Whether the file says its unit.
    pub unit_source: UnitSource,
    /// How many entities of each type the file has: numbers for IGES (`128`), names for STEP.
    pub entities: BTreeMap<String, usize>,
    /// How many entities of each type were not understood, of those that carry geometry or structure of the shape.
    pub unread: BTreeMap<String, usize>,
    /// Where the file comes from.
    pub header: CadHeader,
    /// What the user should know, a sentence each.
    pub warnings: Vec<String>,
}

/// The formats of CAD files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CadFormat {
    /// IGES 5.3.
    Iges,
    /// STEP, ISO 10303-21.
    Step,
}

impl CadFormat {
    /// Extensions that stand for them.
    pub const EXTENSIONS: [&str; 4] = ["step", "stp", "igs", "iges"];

    /// The format that an extension in lower case stands for.
    #[must_use]
    pub fn from_extension(extension: &str) -> Option<Self> {
        match extension {
            "step" | "stp" => Some(CadFormat::Step),
            "igs" | "iges" => Some(CadFormat::Iges),
            _ => None,
        }
    }

    /// `iges` or `step`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            CadFormat::Iges => "iges",
            CadFormat::Step => "step",
        }
    }
}

/// Reads a CAD file from its bytes, by what it says of itself rather than by its name. `path` is for messages only.
///
/// # Errors
/// [`Error::Read`], as [`step::read()`] and [`iges::read_cad`].
pub fn read_cad_bytes(bytes: &[u8], path: &Path) -> Result<CadFile> {
    let mut file = read_either(bytes, path)?;
    let faces = file.model.faces().iter();
    let points = faces.flat_map(|face| face.surface.control_points().points());
    let largest = points.fold(0.0, |most: f64, p| most.max(p.abs().max_element()));
    if largest > OVERFLOWS {
        file.warnings.push(format!(
            "a coordinate of {largest:.0e} is not plausible: areas and volumes overflow"
        ));
    }
    Ok(file)
}

/// Cubes of larger coordinates are no numbers any more.
const OVERFLOWS: f64 = 1e100;

/// How the warnings of both formats begin that say that a unit is assumed.
pub const UNIT_UNKNOWN: &str = "the file does not say its unit";

fn read_either(bytes: &[u8], path: &Path) -> Result<CadFile> {
    if sniff::is_step(bytes) {
        let mut file = step::read(bytes, path)?;
        // IGES has a unit of its own for files that say none, and a warning for it.
        if file.unit_source == UnitSource::Assumed {
            file.warnings.push(format!("{UNIT_UNKNOWN}: mm assumed"));
        }
        return Ok(file);
    }
    if let [0xff, 0xfe, ..] | [0xfe, 0xff, ..] | [b'I', 0, ..] | [0, b'I', ..] = bytes {
        let what = "this is UTF-16 text, and CAD files are ASCII: save it as plain text (UTF-8)";
        return Err(Error::read(path, "", what));
    }
    iges::read_cad(bytes, path)
}

/// Reads the CAD file at `path`, which may be compressed with gzip.
///
/// # Errors
/// [`Error::Read`] if it cannot be opened or is a scan, and as [`read_cad_bytes`].
pub fn read_cad(path: &Path) -> Result<CadFile> {
    read_cad_from(nurbskin_geometry::files::read_file(path)?, path)
}

/// Reads a CAD file, which may be compressed with gzip, from its bytes. `path` is for messages only.
///
/// # Errors
/// [`Error::Read`] if it is a scan, and as [`read_cad_bytes`].
pub fn read_cad_from(mut bytes: Vec<u8>, path: &Path) -> Result<CadFile> {
    if gzip::is_gzip(&bytes) {
        bytes = gzip::inflate(&bytes, path)?;
    }
    if !sniff::is_step(&bytes)
        && !sniff::is_iges(&bytes)
        && let Some(name) = sniff::scan_format(&bytes, path)
    {
        let what = format!(
            "this is a scan ({name}), not a CAD file: use `fit` to make a CAD file from it"
        );
        return Err(Error::read(path, "", what));
    }
    read_cad_bytes(&bytes, path)
}

/// Whether the file at `path` is a CAD file: by its name, or, whatever it is called, by how its content begins.
pub fn is_cad_file(path: &Path) -> bool {
    let named = |path: &Path| {
        CadFormat::from_extension(&nurbskin_geometry::files::sniff::extension(path)).is_some()
    };
    if named(path) {
        return true;
    }
    let mut head = Vec::new();
    let read = std::fs::metadata(path)
        .and_then(|known| {
            if known.is_file() {
                std::fs::File::open(path)
            } else {
                Err(ErrorKind::Other.into())
            }
        })
        .and_then(|file| file.take(sniff::HEAD as u64).read_to_end(&mut head));
    if read.is_err() {
        return false;
    }
    sniff::begins_as_cad(&head)
}

/// How a CAD file is written.
#[derive(Clone, Debug, Default)]
pub struct CadWriteOptions<'a> {
    /// Application protocol of STEP.
    pub schema: Schema,
    /// Packing of IGES.
    pub layout: Layout,
    /// Name of the product; where it is empty the model's.
    pub product: String,
    /// Name of the file, without its folder.
    pub file_name: String,
    /// Added to every point.
    pub origin: DVec3,
    /// Points of the scan, to be written beside the shape.
    pub points: &'a [DVec3],
    /// The distance below which two points are one; by the size of the model and its gaps where absent.
    pub uncertainty: Option<f64>,
    /// Who made the file, for its header; may be empty.
    pub author: String,
    /// The author's organisation, for the header; may be empty.
    pub organization: String,
    /// When the file was made, for the header; 2000-01-01 where nobody says.
    pub time: Timestamp,
}

/// The text of a CAD file.
///
/// # Errors
/// As [`step::write()`] and [`iges::write()`].
pub fn cad_text(
    model: &Model,
    format: CadFormat,
    options: &CadWriteOptions<'_>,
) -> Result<Vec<u8>> {
    let mut text = Vec::new();
    match format {
        CadFormat::Step => {
            let settings = step::WriteOptions {
                schema: options.schema,
                product: options.product.clone(),
                file_name: options.file_name.clone(),
                origin: options.origin,
                uncertainty: options.uncertainty,
                validation: match options.schema {
                    Schema::Ap242 => Some(validation(model)?),
                    Schema::Ap214 => None,
                },
                points: options.points,
                author: options.author.clone(),
                organization: options.organization.clone(),
                timestamp: options.time,
            };
            step::write(&mut text, model, &settings)?;
        }
        CadFormat::Iges => {
            // The paper's files have a surface and nothing else.
            let mut model = std::borrow::Cow::Borrowed(model);
            if options.layout == Layout::Paper {
                let plain = model.to_mut();
                plain.name.clear();
                plain.colour = None;
            }
            let content = IgesContent {
                model: Some(&model),
                points: options.points,
                ..IgesContent::default()
            };
            let settings = iges::WriteOptions {
                unit: model.unit,
                layout: options.layout,
                product: options.product.clone(),
                file_name: options.file_name.clone(),
                origin: options.origin,
                resolution: match options.layout {
                    Layout::Exact => options.uncertainty,
                    Layout::Paper => None,
                },
                author: options.author.clone(),
                organization: options.organization.clone(),
                timestamp: options.time,
                ..iges::WriteOptions::default()
            };
            iges::write(&mut text, &content, &settings)?;
        }
    }
    Ok(text)
}

/// What a receiver may compare with.
fn validation(model: &Model) -> Result<Validation> {
    let mass = crate::mass::mass(model)?;
    Ok(Validation {
        area: mass.area,
        volume: mass.volume,
        centroid: mass.volume_centroid.unwrap_or(mass.centroid),
    })
}

/// Writes a CAD file, whole or not at all; the format follows the extension.
///
/// # Errors
/// [`Error::Invalid`] for an unknown extension, and as [`cad_text`]; [`Error::Write`].
pub fn write_cad(path: &Path, model: &Model, options: &CadWriteOptions<'_>) -> Result<()> {
    let format = CadFormat::from_extension(&nurbskin_geometry::files::sniff::extension(path))
        .ok_or_else(|| {
            Error::invalid(format!(
                "{}: the extension of a CAD file is .step, .stp, .igs or .iges",
                path.display()
            ))
        })?;
    // Put together in memory first: an error of the content is not one of the disk.
    let text = cad_text(model, format, options)?;
    nurbskin_geometry::files::atomic::write_whole(path, |out| {
        out.write_all(&text)
            .map_err(|e| Error::write(path, e.to_string()))
    })
}

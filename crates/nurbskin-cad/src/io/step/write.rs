//! Writing STEP.

mod geometry;
mod product;
mod text;
mod topology;
mod validation;

use crate::Model;
use crate::check::largest_gap;
use crate::io::Timestamp;
pub use crate::io::Written;
use crate::io::text::Bounds;
use nurbskin_geometry::{DVec3, Error, Result};
use std::io::Write;
use text::Text;

/// The application protocol that a file follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Schema {
    /// ISO 10303-214, automotive design: what every system reads.
    #[default]
    Ap214,
    /// ISO 10303-242, managed model based 3-D engineering: with the validation properties.
    Ap242,
}

/// What the sender measured on the shape, for the receiver to compare with: the geometric validation properties of the
/// CAx-IF. In the model's unit; in the coordinates of the model, before the origin is added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Validation {
    /// Area of all faces.
    pub area: f64,
    /// Volume of all solids, where there are solids only.
    pub volume: Option<f64>,
    /// Centroid of the volume, or of the area where there is no volume.
    pub centroid: DVec3,
}

/// How a file is written. The same model and options make the same bytes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WriteOptions<'a> {
    /// The application protocol.
    pub schema: Schema,
    /// Name of the product; where it is empty the model's name, or `part`.
    pub product: String,
    /// Name of the file, without its folder; may be empty.
    pub file_name: String,
    /// Date and time of the file.
    pub timestamp: Timestamp,
    /// Who made the file; may be empty.
    pub author: String,
    /// The author's organisation; may be empty.
    pub organization: String,
    /// Added to every point in f64, correctly rounded: moves back a scan that was moved to the origin for accuracy.
    pub origin: DVec3,
    /// The distance below which two points are one, for a receiver: no smaller than the gaps between faces, edges and
    /// vertices. `None`: the power of ten at or below 1e-7 of the diagonal of the box around everything, at least those
    /// gaps and at least four units in the last place of the largest coordinate.
    pub uncertainty: Option<f64>,
    /// Written with [`Schema::Ap242`] only.
    pub validation: Option<Validation>,
    /// Points of the scan: a geometric set in a shape representation of its own, that a receiver can hide.
    pub points: &'a [DVec3],
}

/// Writes a STEP file (ISO 10303-21, edition 2 of its syntax): one product whose shape is the shells of the model.
///
/// A solid becomes a `MANIFOLD_SOLID_BREP`, another shell a `SHELL_BASED_SURFACE_MODEL`; a face in no shell is written
/// as an open shell of its own. Numbers read back to the same f64. The text is put together in memory first, some 80
/// bytes for each control point.
///
/// # Errors
/// [`Error::Invalid`] if there is no face, a face without a loop (see
/// [`Model::add_whole_surface`](crate::Model::add_whole_surface)), a number that is not finite once the origin is
/// added, or an uncertainty that is not positive; [`Error::Write`] with the file name of the options if `out` fails.
pub fn write(
    out: &mut (impl Write + ?Sized),
    model: &Model,
    options: &WriteOptions<'_>,
) -> Result<Written> {
    let uncertainty = uncertainty(model, options)?;
    let mut text = Text::new(options.origin);
    product::header(&mut text, model, options);
    let product = product::definition(&mut text, model, options, uncertainty);
    let shells = topology::shells(&mut text, model, &product, uncertainty)?;
    product::representations(&mut text, model, options, &product, &shells)?;
    if let (Schema::Ap242, Some(validation)) = (options.schema, &options.validation) {
        validation::push(&mut text, validation, &product)?;
    }
    text.raw("ENDSEC;\nEND-ISO-10303-21;\n");
    let text = text.finish();
    out.write_all(text.as_bytes())
        .map_err(|e| Error::write(&options.file_name, e.to_string()))?;
    Ok(Written {
        lines: text.bytes().filter(|&b| b == b'\n').count(),
        bytes: text.len(),
    })
}

fn uncertainty(model: &Model, options: &WriteOptions<'_>) -> Result<f64> {
    if model.faces().is_empty() {
        return Err(Error::invalid(
            "there is nothing to write: the model has no faces",
        ));
    }
    let nets = model
        .faces()
        .iter()
        .flat_map(|face| face.surface.control_points().points());
    let Some(bounds) = Bounds::of(nets.chain(options.points), options.origin)? else {
        return Err(Error::invalid("there is nothing to write"));
    };
    bounds.resolution(options.uncertainty, bounds.rounding(), largest_gap(model))
}

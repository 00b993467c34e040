//! Writing IGES.

mod brep;
mod face;

use super::card::{CardWriter, MOST_CARDS};
use super::directory::DirectoryEntry;
use super::header::{Extent, global_cards, start_cards};
use super::number::push_real;
use super::surface::{push as push_surface, push_point};
use crate::Model;
use crate::clamped;
use crate::io::Timestamp;
pub use crate::io::Written;
use nurbskin_geometry::nurbs::NurbsSurface;
use nurbskin_geometry::{DVec3, Error, Result, Unit};
use std::fmt::Write as _;
use std::io::Write;

/// Level of the surfaces in the files that are written.
pub const SURFACE_LEVEL: i64 = 1;
/// Level of the scan's points, so that a CAD system can hide them.
pub const POINT_LEVEL: i64 = 2;
/// Level of the scan's polylines.
pub const POLYLINE_LEVEL: i64 = 3;

/// How the numbers are spelled and packed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Layout {
    /// Every number reads back to the same f64; 80 columns and LF.
    #[default]
    Exact,
    /// The layout of Pal & Ballav 2007, whose line counts it reproduces: 22, 230, 267 and 549 lines for nets of 4 x 4,
    /// 18 x 18, 29 x 13 and 25 x 32 control points of degree 3. Six decimals, so that a coordinate is off by up to
    /// 5e-7; control points begin on a card of their own, five numbers to a card; 80 columns and CR LF.
    ///
    /// The paper counts four start cards and one global card. The 26 global parameters do not fit on one card, so
    /// this writer has it the other way round, the sum being the same: start and global cards are five together.
    Paper,
}

/// What goes into a file.
#[derive(Clone, Copy, Debug, Default)]
pub struct IgesContent<'a> {
    /// Its faces: an untrimmed one becomes a bare entity 128, a trimmed one an entity 144 with an entity 142, curves in
    /// the parameter plane and in space, for each of its loops. A face that looks against its surface's normal is
    /// written with u and v exchanged, exactly, so that it looks along it. A shell of several untrimmed faces without
    /// poles keeps its shared edges and vertices: a solid is an entity 186, another one 514; not in the paper's layout.
    /// Its unit, name and colour are the file's.
    pub model: Option<&'a Model>,
    /// Surfaces beside it. Each becomes an entity 128. Periodic and unclamped directions are written clamped, by exact knot insertion:
    /// few readers know other forms.
    pub surfaces: &'a [NurbsSurface],
    /// Points of the scan: entity 116 each.
    pub points: &'a [DVec3],
    /// Polylines of the scan: entity 106 of form 12 each.
    pub polylines: &'a [Vec<DVec3>],
}

/// How a file is written. The same content and options make the same bytes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WriteOptions {
    /// Unit of the numbers, which are written as they are. A model's own unit takes its place.
    pub unit: Unit,
    /// Spelling and packing.
    pub layout: Layout,
    /// Name of the product; where it is empty the model's.
    pub product: String,
    /// Name of the file, without its folder; may be empty. Characters beyond printable ASCII become `_` in both names.
    pub file_name: String,
    /// Added to every point in f64, correctly rounded: moves back a scan that was moved to the origin for accuracy.
    pub origin: DVec3,
    /// Smallest distance that a receiver should care for. `None`: the power of ten at or below 1e-7 of the diagonal of
    /// the box around everything, at least the gaps between edges and surfaces, and at least four units in the last
    /// place of the largest coordinate (1e-6 in the paper's layout).
    pub resolution: Option<f64>,
    /// Date and time of the file and of the model.
    pub timestamp: Timestamp,
    /// Who made the file; may be empty.
    pub author: String,
    /// The author's organisation; may be empty.
    pub organization: String,
    /// Colour of the surfaces: red, green, blue, 0 to 255 each. Where it is not told, the model's.
    pub colour: Option<[u8; 3]>,
}

/// How reals become text; the delimiter is the caller's.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spelling {
    layout: Layout,
}

impl Spelling {
    /// Whether numbers lose digits.
    pub(super) fn is_coarse(self) -> bool {
        self.layout == Layout::Paper
    }
    /// The number that a reader will get.
    pub(super) fn rounded(self, x: f64) -> f64 {
        match self.layout {
            Layout::Exact => x,
            Layout::Paper => format!("{x:.6}").parse().unwrap_or(x),
        }
    }
    // Writing to a String cannot fail.
    pub(super) fn knot(self, text: &mut String, x: f64) {
        match self.layout {
            Layout::Exact => push_real(text, x),
            Layout::Paper => drop(write!(text, "{x:.6}")),
        }
    }
    /// A weight or an end of the domain: the paper has `1.0` where one decimal is enough.
    pub(super) fn weight(self, text: &mut String, x: f64) {
        match self.layout {
            Layout::Exact => push_real(text, x),
            Layout::Paper if (10.0 * x).fract() == 0.0 => drop(write!(text, "{x:.1}")),
            Layout::Paper => drop(write!(text, "{x:.6}")),
        }
    }
    /// A coordinate: in the paper's layout 11 characters, so that five and their commas are on a card.
    pub(super) fn coordinate(self, text: &mut String, x: f64) {
        match self.layout {
            Layout::Exact => push_real(text, x),
            Layout::Paper => drop(write!(text, "{x:>11.6}")),
        }
    }
}

/// Writes an IGES 5.3 file. The text is put together in memory first, some 30 bytes for each number.
///
/// # Errors
/// [`Error::Invalid`] if there is nothing to write, a number is not finite, the resolution is not positive, six
/// decimals are too coarse for a surface in the paper's layout, or the file would have more cards than the format can
/// number (9 999 999 in a section); [`Error::Write`] with the file name of the options if `out` fails.
pub fn write(
    out: &mut (impl Write + ?Sized),
    content: &IgesContent<'_>,
    options: &WriteOptions,
) -> Result<Written> {
    let mut surfaces = Vec::with_capacity(content.surfaces.len());
    for surface in content.surfaces {
        surfaces.push(clamped(surface)?);
    }
    let options = &of_model(options, content.model);
    let extent = Extent::of(content, options)?;
    let end_of_line = match options.layout {
        Layout::Exact => "\n",
        Layout::Paper => "\r\n",
    };
    let spelling = Spelling {
        layout: options.layout,
    };
    let mut entities = Entities {
        directory: CardWriter::new('D', end_of_line),
        parameter: CardWriter::new('P', end_of_line),
        spelling,
        origin: options.origin,
        resolution: extent.resolution,
    };

    let mut colour = 0;
    if let Some(rgb) = options.colour {
        colour = -1; // the first entry
        entities.colour(rgb)?;
    }
    if let Some(model) = content.model {
        let mut alone = vec![true; model.faces().len()];
        for (k, shell) in model.shells().iter().enumerate() {
            if brep::is_shared(model, shell, options.layout) {
                shell.faces.iter().for_each(|&face| alone[face] = false);
                brep::push(&mut entities, model, shell, colour, k)?;
            }
        }
        for (k, face) in model.faces().iter().enumerate().filter(|(k, _)| alone[*k]) {
            face::push(&mut entities, model, face, colour, k)?;
        }
    }
    let entry = |entity, form, level, label: &str, k: usize| DirectoryEntry {
        entity,
        form,
        level,
        colour: if entity == 128 { colour } else { 0 },
        label: label.into(),
        subscript: i64::try_from(k).unwrap_or(0) + 1,
        ..Default::default()
    };
    for (k, surface) in surfaces.iter().enumerate() {
        entities.add(entry(128, 0, SURFACE_LEVEL, "SURFACE", k), |section| {
            push_surface(
                section,
                surface,
                spelling,
                options.origin,
                extent.resolution,
                &[],
            )
        })?;
    }
    for (k, &point) in content.points.iter().enumerate() {
        entities.add(entry(116, 0, POINT_LEVEL, "POINT", k), |section| {
            section.token("116,");
            push_point(section, point, spelling, options.origin)?;
            section.token("0;");
            Ok(())
        })?;
    }
    for (k, polyline) in content.polylines.iter().enumerate() {
        entities.add(entry(106, 12, POLYLINE_LEVEL, "POLYLINE", k), |section| {
            section.token("106,");
            section.token("2,");
            section.token(&format!("{},", polyline.len()));
            for &point in polyline {
                push_point(section, point, spelling, options.origin)?;
            }
            section.token("0;"); // no associativities follow
            Ok(())
        })?;
    }

    let global = global_cards(options, &extent, end_of_line);
    let start = start_cards(options.layout, global.cards(), end_of_line);
    let sections = [start, global, entities.directory, entities.parameter];
    if let Some(section) = sections.iter().find(|s| s.cards() > MOST_CARDS) {
        return Err(Error::invalid(format!(
            "the IGES file would have {} cards in one section, and the format counts to {MOST_CARDS}; write STEP, or fewer control points",
            section.cards()
        )));
    }
    let mut terminate = CardWriter::new('T', end_of_line);
    let [s, g, d, p] = [0, 1, 2, 3].map(|k: usize| sections[k].cards());
    terminate.token(&format!("S{s:>7}G{g:>7}D{d:>7}P{p:>7}"));
    terminate.end_card();
    let mut written = Written::default();
    for section in sections.iter().chain([&terminate]) {
        out.write_all(section.text().as_bytes())
            .map_err(|e| Error::write(&options.file_name, e.to_string()))?;
        written.lines += section.cards();
        written.bytes += section.text().len();
    }
    Ok(written)
}

/// The options, with what the model says where they do not.
fn of_model(options: &WriteOptions, model: Option<&Model>) -> WriteOptions {
    let mut options = options.clone();
    if let Some(model) = model {
        options.unit = model.unit;
        options.colour = options.colour.or(model.colour);
        if options.product.is_empty() {
            options.product.clone_from(&model.name);
        }
    }
    options
}

/// Directory and parameter data, which grow together.
struct Entities {
    directory: CardWriter,
    parameter: CardWriter,
    spelling: Spelling,
    origin: DVec3,
    resolution: f64,
}

impl Entities {
    /// Puts an entity and tells the sequence number of its directory entry.
    fn add(
        &mut self,
        mut entry: DirectoryEntry,
        push: impl FnOnce(&mut CardWriter) -> Result<()>,
    ) -> Result<usize> {
        let before = self.parameter.cards();
        let sequence = self.directory.cards() + 1;
        self.parameter.point_to(sequence);
        push(&mut self.parameter)?;
        self.parameter.end_card();
        entry.parameter = before + 1;
        entry.parameter_cards = self.parameter.cards() - before;
        if entry.status.is_empty() {
            entry.status = "00000000".into();
        }
        entry.push(&mut self.directory);
        Ok(sequence)
    }

    /// Puts a colour (entity 314), in percent.
    fn colour(&mut self, rgb: [u8; 3]) -> Result<usize> {
        let entry = DirectoryEntry {
            entity: 314,
            status: "00000200".into(),
            label: "COLOUR".into(),
            ..Default::default()
        };
        self.add(entry, |section| {
            section.token("314,");
            for (value, delimiter) in rgb.into_iter().zip([',', ',', ';']) {
                section.spelled(|text| {
                    push_real(text, f64::from(value) / 2.55);
                    text.push(delimiter);
                });
            }
            Ok(())
        })
    }
}

//! The global section: unit, delimiters, resolution and where the file came from.

use super::card::{Card, WIDTH};
use super::field::{Delimiters, Fields};
use crate::io::file::UNIT_UNKNOWN;
use nurbskin_geometry::{Error, Result, Unit};
use std::path::Path;

/// What the global section of a file says.
#[derive(Clone, Debug, PartialEq)]
pub struct Global {
    /// Unit of all coordinates that were read. Units that [`Unit`] does not have (miles, kilometres, mils,
    /// microinches) have been converted to its nearest relative, which a warning says.
    pub unit: Unit,
    /// Whether the file names its unit; without a word from it, inches are meant (IGES 5.3, 2.2.4.3.14).
    pub unit_given: bool,
    /// Model space scale: lengths of the model per length in the real world. Coordinates are handed on as they are in
    /// the model.
    pub scale: f64,
    /// Smallest distance that the file's author cares for, in [`Global::unit`]; zero where it does not say.
    pub resolution: f64,
    /// Largest coordinate, as the file promises it; zero where it does not say.
    pub maximum_coordinate: f64,
    /// Name of the product, as its sender knows it.
    pub product: String,
    /// Name of the file, as its sender knows it.
    pub file_name: String,
    /// The system that made the file, and its preprocessor.
    pub system: String,
    /// Date and time as the file has them.
    pub date: String,
    /// Who made the file.
    pub author: String,
    /// The author's organisation.
    pub organization: String,
    /// Parameter and record delimiter.
    pub delimiters: [char; 2],
    /// Factor from the file's numbers to [`Global::unit`].
    pub(super) factor: f64,
}

/// Reads the global section.
pub(super) fn read(
    cards: &[Card<'_>],
    path: &Path,
    warnings: &mut Vec<String>,
) -> Result<(Global, Delimiters)> {
    if cards.is_empty() {
        return Err(Error::read(
            path,
            "",
            "the file has no global section (G): it is cut short or not IGES",
        ));
    }
    let mut fields = Fields::new(path, 'G', 1, cards, WIDTH, Delimiters::default());
    let delimiters = delimiters(&mut fields)?;
    let product = fields.string()?;
    let file_name = fields.string()?;
    let system = [fields.string()?, fields.string()?]
        .join(" ")
        .trim()
        .to_owned();
    // The sender's number formats (text has digits enough of its own), and the product's name for the receiver.
    fields.skip(6)?;
    let scale = fields.real(1.0)?;
    if scale <= 0.0 {
        return Err(fields.refuse(format!(
            "a model space scale of {scale}, where a positive number should be"
        )));
    }
    let flag = fields.integer(0)?;
    let name = fields.string()?;
    let (unit, factor) = unit(flag, &name, &fields)?;
    fields.skip(2)?; // line weights
    let date = fields.string()?;
    let resolution = fields.real(0.0)?;
    let maximum_coordinate = fields.real(0.0)?;
    // What is only shown is no reason to refuse a file.
    let author = fields.string().unwrap_or_default();
    let organization = fields.string().unwrap_or_default();
    let unit_given = flag != 0 || !name.is_empty();
    if !unit_given {
        warnings.push(format!(
            "{UNIT_UNKNOWN}: inches assumed, as the IGES standard demands"
        ));
    }
    #[expect(clippy::float_cmp, reason = "the factors are constants")]
    if factor != 1.0 {
        warnings.push(format!(
            "the file's unit `{name}` was converted: its numbers were multiplied by {factor} to give {unit}"
        ));
    }
    #[expect(clippy::float_cmp, reason = "exactly the default")]
    if scale != 1.0 {
        warnings.push(format!(
            "the file draws its model at scale {scale} : 1; coordinates are those of the drawing"
        ));
    }
    let global = Global {
        unit,
        unit_given,
        scale,
        resolution: resolution * factor,
        maximum_coordinate: maximum_coordinate * factor,
        product,
        file_name,
        system,
        date,
        author,
        organization,
        delimiters: [delimiters.parameter, delimiters.record].map(char::from),
        factor,
    };
    Ok((global, delimiters))
}

/// The first two parameters say the delimiters, each as 1Hx or left out.
fn delimiters(fields: &mut Fields<'_>) -> Result<Delimiters> {
    while fields.peek() == Some(b' ') {
        fields.bump();
    }
    let forbidden = |b: u8| b <= b' ' || b.is_ascii_digit() || b >= 0x7f || b"+-.DEH".contains(&b);
    let parameter = delimiter(fields, b',').unwrap_or(0);
    let after_first = fields.bump();
    let record = delimiter(fields, b';').unwrap_or(0);
    let after_second = fields.bump();
    let sound = !forbidden(parameter)
        && !forbidden(record)
        && parameter != record
        && after_first == Some(parameter)
        && after_second == Some(parameter);
    if !sound {
        return Err(
            fields.refuse("the first two parameters should name the delimiters, as in `1H,,1H;,`")
        );
    }
    fields.delimiters = Delimiters { parameter, record };
    Ok(fields.delimiters)
}

/// One delimiter, spelled 1Hx, or the default where it is left out.
fn delimiter(fields: &mut Fields<'_>, default: u8) -> Option<u8> {
    if fields.peek()? != b'1' {
        return Some(default);
    }
    fields.bump();
    (fields.bump()? == b'H').then(|| fields.bump())?
}

/// The unit that a flag (or, for flag 3, a name) means, with the factor to a unit that we have.
fn unit(flag: i64, name: &str, fields: &Fields<'_>) -> Result<(Unit, f64)> {
    let by_name = || {
        Some(match name.trim().to_ascii_uppercase().as_str() {
            "IN" | "INCH" => (Unit::Inch, 1.0),
            "MM" => (Unit::Millimetre, 1.0),
            "FT" => (Unit::Foot, 1.0),
            "MI" => (Unit::Foot, 5280.0),
            "M" => (Unit::Metre, 1.0),
            "KM" => (Unit::Metre, 1000.0),
            "MIL" => (Unit::Inch, 1e-3),
            "UM" => (Unit::Micrometre, 1.0),
            "CM" => (Unit::Centimetre, 1.0),
            "UIN" => (Unit::Inch, 1e-6),
            _ => return None,
        })
    };
    let known = match flag {
        1 => Some((Unit::Inch, 1.0)),
        2 => Some((Unit::Millimetre, 1.0)),
        4 => Some((Unit::Foot, 1.0)),
        5 => Some((Unit::Foot, 5280.0)),
        6 => Some((Unit::Metre, 1.0)),
        7 => Some((Unit::Metre, 1000.0)),
        8 => Some((Unit::Inch, 1e-3)),
        9 => Some((Unit::Micrometre, 1.0)),
        10 => Some((Unit::Centimetre, 1.0)),
        11 => Some((Unit::Inch, 1e-6)),
        0 if name.is_empty() => Some((Unit::Inch, 1.0)),
        0 | 3 => by_name(),
        _ => None,
    };
    known.ok_or_else(|| {
        fields.refuse(format!(
            "unit flag {flag} with the name `{}` is not a unit of IGES; export the file in millimetres or inches",
            name.escape_debug()
        ))
    })
}

/// Flag and name of a unit in IGES.
pub(super) fn unit_flag(unit: Unit) -> (u8, &'static str) {
    match unit {
        Unit::Inch => (1, "IN"),
        Unit::Millimetre => (2, "MM"),
        Unit::Foot => (4, "FT"),
        Unit::Metre => (6, "M"),
        Unit::Micrometre => (9, "UM"),
        Unit::Centimetre => (10, "CM"),
    }
}

/// `text` as IGES counts strings (`4Htext`), nothing for an empty one. What is not printable ASCII becomes `_`.
pub(super) fn hollerith(text: &str) -> String {
    if text.is_empty() {
        return String::new();
    }
    let plain: String = text
        .chars()
        .map(|c| {
            if c == ' ' || c.is_ascii_graphic() {
                c
            } else {
                '_'
            }
        })
        .collect();
    format!("{}H{plain}", plain.len())
}

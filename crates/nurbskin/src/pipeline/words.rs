//! Text forms of option values, for the command line and for other languages.
//!
//! Every option with a fixed set of values implements [`Worded`], so that all front ends share one set of words.
//! Lengths, counts and rarefactions have parsers here.

use super::{FaceLayout, Length, Method, Rarefaction, Sharp, Trim};
use nurbskin_cad::io::iges::write::Layout;
use nurbskin_cad::io::step::Schema;
use nurbskin_fit::chart::Topology;
use nurbskin_fit::fit::interpolate::parameters::Parameterization;
use nurbskin_geometry::{Error, Result, Unit};
use nurbskin_scan::io::scan::unit_named;
use std::borrow::Cow;
use std::str::FromStr;

/// A word for a value, and its meaning.
#[derive(Clone, Copy, Debug)]
pub struct Word<T: 'static> {
    /// The word.
    pub word: &'static str,
    /// The value.
    pub value: T,
    /// Its meaning, for `--help`; may be empty.
    pub meaning: &'static str,
}

/// Values with one word each: the values of an option, the same in every front end.
///
/// ```
/// use nurbskin::chart::Topology;
/// use nurbskin::pipeline::words::Worded;
/// assert_eq!(Option::<Topology>::of_word("tube")?, Some(Topology::Tube));
/// assert_eq!(Option::<Topology>::of_word("auto")?, None);
/// assert!(Option::<Topology>::of_word("cube").is_err());
/// # Ok::<(), nurbskin::Error>(())
/// ```
pub trait Worded: Copy + 'static {
    /// All words, the default first.
    const WORDS: &'static [Word<Self>];

    /// The value of a word.
    ///
    /// # Errors
    /// [`Error::Invalid`] for any other word.
    fn of_word(said: &str) -> Result<Self> {
        let found = Self::WORDS.iter().find(|known| known.word == said);
        found.map(|known| known.value).ok_or_else(|| {
            let words: Vec<&str> = Self::WORDS.iter().map(|known| known.word).collect();
            Error::invalid(format!(
                "{said:?} is not known; use one of {}",
                words.join(", ")
            ))
        })
    }
}

const fn word<T>(word: &'static str, value: T, meaning: &'static str) -> Word<T> {
    Word {
        word,
        value,
        meaning,
    }
}

impl Worded for Method {
    const WORDS: &'static [Word<Self>] = &[
        word(
            "auto",
            Self::Auto,
            "`interpolate` for ordered scans with little noise, `approximate` for all others",
        ),
        word(
            "interpolate",
            Self::Interpolate,
            "Through every kept point of an ordered scan, as in Pal & Ballav 2007",
        ),
        word(
            "approximate",
            Self::Approximate,
            "Least squares, with as few control points as meet the tolerance",
        ),
    ];
}

impl Worded for FaceLayout {
    const WORDS: &'static [Word<Self>] = &[
        word(
            "auto",
            Self::Auto,
            "One surface where it can be the object and meets the tolerance, else a network",
        ),
        word(
            "single",
            Self::Single,
            "One surface: an open sheet, a tube, a sphere or a torus",
        ),
        word(
            "network",
            Self::Network,
            "A watertight network of four-sided faces, for any shape",
        ),
    ];
}

impl Worded for Option<Topology> {
    const WORDS: &'static [Word<Self>] = &[
        word("auto", None, "Found from the scan"),
        word(
            "disk",
            Some(Topology::Disk),
            "An open sheet with one border",
        ),
        word(
            "tube",
            Some(Topology::Tube),
            "Closed around, open at both ends",
        ),
        word("sphere", Some(Topology::Sphere), "Closed, with two poles"),
        word("torus", Some(Topology::Torus), "A closed ring"),
    ];
}

impl Worded for Option<Parameterization> {
    const WORDS: &'static [Word<Self>] = &[
        word(
            "auto",
            None,
            "Chord length or uniform, whichever predicts every second line better",
        ),
        word("uniform", Some(Parameterization::Uniform), "Equal steps"),
        word(
            "chord",
            Some(Parameterization::ChordLength),
            "By the distance between points",
        ),
        word(
            "centripetal",
            Some(Parameterization::Centripetal),
            "By the square root of that distance",
        ),
    ];
}

impl Worded for Option<Unit> {
    const WORDS: &'static [Word<Self>] = &[
        word("auto", None, ""),
        word("mm", Some(Unit::Millimetre), ""),
        word("cm", Some(Unit::Centimetre), ""),
        word("m", Some(Unit::Metre), ""),
        word("um", Some(Unit::Micrometre), ""),
        word("in", Some(Unit::Inch), ""),
        word("ft", Some(Unit::Foot), ""),
    ];
}

impl Worded for Layout {
    const WORDS: &'static [Word<Self>] = &[
        word("exact", Self::Exact, "Numbers read back to the same value"),
        word(
            "paper",
            Self::Paper,
            "Six decimals, packed as in Pal & Ballav 2007",
        ),
    ];
}

impl Worded for Schema {
    const WORDS: &'static [Word<Self>] = &[
        word("ap214", Self::Ap214, "Read by every system"),
        word(
            "ap242",
            Self::Ap242,
            "With area, volume and centroid, for the receiving system to compare with",
        ),
    ];
}

impl Worded for Trim {
    const WORDS: &'static [Word<Self>] = &[
        word(
            "auto",
            Self::Auto,
            "Trim to the border of the scan and to holes wider than three spacings; small holes of a closed surface (up to \
             2.5 % of it) stay closed",
        ),
        word("always", Self::Always, "Trim these small holes, too"),
        word(
            "off",
            Self::Off,
            "Leave the surface untrimmed, up to the sides of its parameter rectangle",
        ),
    ];
}

/// The notation of lengths, for the ends of sentences.
const LENGTHS: &str =
    "write a number and a unit, as in 0.05mm, 20um, 2thou or 0.1% (of the diagonal)";

/// A positive number and a unit: `0.05mm`, `20um` or `20µm`, `2e-3in`, `2thou` or `2mil`, `0.5 mm`; `0.1%` of the
/// diagonal; or a bare number in the scan's unit. The decimal mark is a point or a comma.
///
/// ```
/// use nurbskin::{Unit, pipeline::Length};
/// assert_eq!("0.05mm".parse::<Length>()?, Length::In(0.05, Unit::Millimetre));
/// assert_eq!("0,5 mm".parse::<Length>()?, Length::In(0.5, Unit::Millimetre));
/// assert_eq!("0.25".parse::<Length>()?, Length::Plain(0.25));
/// assert_eq!("50%".parse::<Length>()?, Length::OfDiagonal(0.5));
/// assert!("-1mm".parse::<Length>().is_err());
/// # Ok::<(), nurbskin::Error>(())
/// ```
impl FromStr for Length {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let text = text.trim();
        let number = text.trim_end_matches(|c: char| c.is_alphabetic() || c == '%');
        let unit = &text[number.len()..];
        let number = decimal(number.trim())?;
        let Ok(value) = number.parse::<f64>() else {
            return Err(Error::invalid(format!(
                "`{text}` is not a length: {LENGTHS}"
            )));
        };
        let length = match unit {
            "" => Self::Plain(value),
            "%" => Self::OfDiagonal(value / 100.0),
            "thou" | "mil" | "mils" => Self::In(1e-3 * value, Unit::Inch),
            name => match unit_named(name) {
                Some(unit) => Self::In(value, unit),
                None => {
                    return Err(Error::invalid(format!(
                        "`{name}` is not a unit of length: use mm, cm, m, um, in, ft, thou or % (of the diagonal)"
                    )));
                }
            },
        };
        // The smallest unit gives the largest number.
        if !length.resolve(Unit::Micrometre, 1.0).is_finite() {
            return Err(Error::invalid(format!("`{text}` is too large a number")));
        }
        if value <= 0.0 {
            return Err(Error::invalid(format!(
                "a tolerance is a positive length, not {text}"
            )));
        }
        Ok(length)
    }
}

/// Converts a decimal comma to a decimal point.
///
/// # Errors
/// [`Error::Invalid`] where the comma may separate thousands: `1,250`.
fn decimal(number: &str) -> Result<Cow<'_, str>> {
    let Some((whole, rest)) = number.split_once(',') else {
        return Ok(Cow::Borrowed(number));
    };
    let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
    if digits == 3 && digits == rest.len() && !whole.trim_start_matches('0').is_empty() {
        return Err(Error::invalid(format!(
            "`{number}` may mean {whole}.{rest} or {whole}{rest}: write one of these"
        )));
    }
    Ok(Cow::Owned(format!("{whole}.{rest}")))
}

/// Two counts: `29x13`.
///
/// # Errors
/// [`Error::Invalid`] for anything else.
pub fn counts(text: &str) -> Result<[usize; 2]> {
    let parse = |s: &str| s.trim().parse::<usize>().ok().filter(|&n| n > 0);
    match text
        .split_once(['x', 'X'])
        .map(|(m, n)| (parse(m), parse(n)))
    {
        Some((Some(m), Some(n))) => Ok([m, n]),
        _ => Err(Error::invalid("write MxN, as in 29x13")),
    }
}

/// `auto`, `off`, degrees for u and v (`20`, or `12,18`), or `18x18` lines.
impl FromStr for Rarefaction {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let angle = |s: &str| {
            s.trim()
                .parse::<f64>()
                .ok()
                .filter(|a| *a >= 0.0 && *a <= 180.0)
        };
        match text {
            "auto" => Ok(Self::Auto),
            "off" => Ok(Self::Off),
            _ if text.contains(['x', 'X']) => counts(text).map(Self::Counts),
            _ => {
                let (u, v) = text.split_once(',').unwrap_or((text, text));
                match (angle(u), angle(v)) {
                    (Some(u), Some(v)) => Ok(Self::Threshold([u, v])),
                    _ => Err(Error::invalid(
                        "write degrees from 0 to 180 (as 20, or 12,18 for u and v), MxN, auto or off",
                    )),
                }
            }
        }
    }
}

/// `auto`, `off` or an angle in degrees: `30`.
///
/// ```
/// use nurbskin::pipeline::{Sharp, words};
/// assert_eq!(words::sharp("30")?, Sharp::Degrees(30.0));
/// assert!(words::sharp("200").is_err());
/// # Ok::<(), nurbskin::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] for anything else.
pub fn sharp(text: &str) -> Result<Sharp> {
    match text.trim() {
        "auto" => Ok(Sharp::Auto),
        "off" => Ok(Sharp::Off),
        other => {
            let angle = other.parse::<f64>().ok();
            let angle = angle.filter(|angle| (0.0..=180.0).contains(angle));
            angle
                .map(Sharp::Degrees)
                .ok_or_else(|| Error::invalid("write degrees from 0 to 180, auto or off"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_read_as_people_write_them() {
        let mm = |value| Length::In(value, Unit::Millimetre);
        let um = Length::In(20.0, Unit::Micrometre);
        for (text, length) in [
            ("0.05mm", mm(0.05)),
            ("0,5mm", mm(0.5)),
            ("0.5 mm", mm(0.5)),
            ("1,5e-2mm", mm(0.015)),
            ("0,125mm", mm(0.125)),
            ("0.05MM", mm(0.05)),
            ("20um", um),
            ("20\u{b5}m", um),
            ("20\u{3bc}m", um),
            ("2thou", Length::In(0.002, Unit::Inch)),
            ("2mil", Length::In(0.002, Unit::Inch)),
            ("2e-3in", Length::In(0.002, Unit::Inch)),
            ("1e-3", Length::Plain(0.001)),
            ("0,25", Length::Plain(0.25)),
            ("0.5%", Length::OfDiagonal(0.005)),
            ("0,5 %", Length::OfDiagonal(0.005)),
        ] {
            assert_eq!(text.parse::<Length>().unwrap(), length, "{text}");
        }
    }

    #[test]
    fn what_is_no_length_is_refused_in_a_sentence() {
        for (text, words) in [
            ("-1mm", "a tolerance is a positive length, not -1mm"),
            ("0", "a tolerance is a positive length, not 0"),
            ("-0.1%", "a tolerance is a positive length"),
            ("", "`` is not a length: write"),
            ("mm", "`mm` is not a length"),
            ("nan", "`nan` is not a length"),
            ("inf", "`inf` is not a length"),
            ("1e999", "too large"),
            ("1e307ft", "too large"),
            ("1.5.2mm", "is not a length"),
            ("1,5,2mm", "is not a length"),
            ("3furlong", "`furlong` is not a unit of length: use mm"),
            ("1,250mm", "may mean 1.250 or 1250"),
        ] {
            let error = text.parse::<Length>().unwrap_err().to_string();
            assert!(error.contains(words), "{text}: {error}");
        }
    }

    #[test]
    fn a_share_is_of_the_diagonal() {
        let tenth: Length = "10%".parse().unwrap();
        assert!((tenth.resolve(Unit::Metre, 5.0) - 0.5).abs() < 1e-12);
    }
}

//! Values as they are typed, and the command as it was.

use super::names::{UnitName, named};
use super::{INPUT, OUTPUT};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};
use nurbskin::io::SCAN_INPUTS;
use nurbskin::pipeline::{CONVERT_FORMATS, Note};

/// The command as it was typed, in the words of a POSIX shell.
pub(crate) fn command_line() -> String {
    let quoted = |word: std::ffi::OsString| {
        let word = word.to_string_lossy();
        let plain = |c: char| c.is_alphanumeric() || "-_./,=:+@%".contains(c);
        if !word.is_empty() && word.chars().all(plain) {
            word.into_owned()
        } else {
            format!("'{}'", word.replace('\'', "'\\''"))
        }
    };
    let words = std::env::args_os().skip(1).map(quoted);
    std::iter::once("nurbskin".to_owned())
        .chain(words)
        .collect::<Vec<_>>()
        .join(" ")
}

/// The unit of what is read.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct InputUnit {
    /// Unit of the scan's numbers [default: auto]
    ///
    /// `auto` takes it from the file; where the file does not say, millimetres are assumed and a warning is printed.
    #[arg(long, value_parser = named::<UnitName>(), default_value = "auto", hide_default_value = true, help_heading = INPUT)]
    pub(crate) unit: UnitName,
}

/// What people say about a report.
#[derive(Args, Clone, Debug)]
pub(crate) struct Heading {
    /// Title of the .html report [default: the name of the scan]
    #[arg(long, value_name = "TEXT", requires = "report", help_heading = OUTPUT)]
    title: Option<String>,
    /// Field of the .html report, as in `operator="A. Lovelace"`; may be repeated
    ///
    /// `part`, `drawing`, `revision`, `operator` and `alignment` come first, others after them. The date and the alignment
    /// are there without being named.
    #[arg(long, value_name = "KEY=VALUE", requires = "report", help_heading = OUTPUT)]
    note: Vec<Note>,
}

impl Heading {
    /// In the words of the library.
    pub(super) fn given(&self) -> nurbskin::pipeline::Heading {
        nurbskin::pipeline::Heading {
            title: self.title.clone(),
            notes: self.note.clone(),
        }
    }
}

/// A format of scans.
pub(super) fn scan_format() -> PossibleValuesParser {
    PossibleValuesParser::new(SCAN_INPUTS)
}

/// The formats of CAD files, by their long and their short extensions.
fn cad_formats() -> impl Iterator<Item = PossibleValue> {
    [("step", "stp"), ("iges", "igs")]
        .into_iter()
        .map(|(long, short)| PossibleValue::new(long).alias(short))
}

/// The formats of CAD files, then these.
fn with_cad(others: impl IntoIterator<Item = &'static str>) -> PossibleValuesParser {
    let others = others.into_iter().map(PossibleValue::new);
    PossibleValuesParser::new(cad_formats().chain(others))
}

/// A format of CAD files.
pub(super) fn cad_format() -> PossibleValuesParser {
    with_cad([])
}

/// A format of scans or CAD files.
pub(super) fn any_format() -> PossibleValuesParser {
    with_cad(SCAN_INPUTS)
}

/// A format that a fit writes.
pub(super) fn surface_format() -> PossibleValuesParser {
    with_cad(["stl", "obj", "ply", "glb"])
}

/// A format that a conversion writes.
pub(super) fn points_or_cad() -> PossibleValuesParser {
    let is_cad = |format: &&str| matches!(*format, "step" | "stp" | "igs" | "iges");
    with_cad(
        CONVERT_FORMATS
            .into_iter()
            .filter(move |format| !is_cad(format)),
    )
}

/// `3` or `3,2`.
pub(super) fn degree(text: &str) -> Result<[usize; 2], String> {
    let parse = |s: &str| {
        let p = s
            .trim()
            .parse::<usize>()
            .ok()
            .filter(|p| (1..=nurbskin::nurbs::MAX_DEGREE).contains(p));
        p.ok_or(format!(
            "a degree is a whole number from 1 to {}",
            nurbskin::nurbs::MAX_DEGREE
        ))
    };
    match text.split_once(',') {
        Some((p, q)) => Ok([parse(p)?, parse(q)?]),
        None => parse(text).map(|p| [p, p]),
    }
}

pub(super) fn fraction(text: &str) -> Result<f64, String> {
    text.parse::<f64>()
        .ok()
        .filter(|x| (0.0..=0.5).contains(x))
        .ok_or("a fraction is a number from 0 to 0.5".into())
}

/// `99.5%`, `99,5 %` or `0.995`.
pub(super) fn share(text: &str) -> Result<f64, String> {
    let wrong = || format!("{text} is not a share: write 99.5% or 0.995");
    let (number, most) = match text.trim().strip_suffix('%') {
        Some(number) => (number.trim_end(), 100.0),
        None => (text.trim(), 1.0),
    };
    let value = number
        .replace(',', ".")
        .parse::<f64>()
        .map_err(|_| wrong())?;
    if (0.0..=most).contains(&value) {
        Ok(value / most)
    } else if most < 100.0 && (0.0..=100.0).contains(&value) {
        Err(format!(
            "a share is from 0 to 1: write {text}% for per cent"
        ))
    } else {
        Err(wrong())
    }
}

pub(super) fn non_negative(text: &str) -> Result<f64, String> {
    text.parse::<f64>()
        .ok()
        .filter(|x| x.is_finite() && *x >= 0.0)
        .ok_or("a number, 0 or more, is needed".into())
}

#[cfg(test)]
mod tests {
    use super::share;

    #[test]
    fn shares_are_per_cent_or_parts_of_one() {
        for (text, value) in [
            ("99.5%", 0.995),
            ("99,5 %", 0.995),
            ("0.995", 0.995),
            ("100%", 1.0),
            ("1", 1.0),
            ("0", 0.0),
        ] {
            assert!(
                (share(text).unwrap_or(-1.0) - value).abs() < 1e-12,
                "{text}"
            );
        }
        assert!(share("99.5").is_err_and(|why| why.contains("99.5%")));
        for text in ["101%", "-1%", "nan", "", "%", "half", "200"] {
            assert!(share(text).is_err(), "{text}");
        }
    }
}

//! Options as Python says them: the names and words of the command line.

use crate::errors::{Raised, unfit};
use nurbskin::nurbs::MAX_DEGREE;
use nurbskin::pipeline::words::{self, Worded};
use nurbskin::pipeline::{ConvertOptions, Heading, Length, Note, Options, Rarefaction, Sharp};
use nurbskin::{DVec3, Error, Unit};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use std::str::FromStr;

/// The value of a word of the option `name`.
pub(crate) fn word<T: Worded>(name: &str, said: &str) -> nurbskin::Result<T> {
    T::of_word(said).map_err(|error| match error {
        Error::Invalid(what) => Error::invalid(format!("{name}: {what}")),
        other => other,
    })
}

/// Two values for u and v, as any sequence; the default where there are none.
pub(crate) fn pair<'py, T: FromPyObjectOwned<'py>>(
    name: &str,
    value: Option<&Bound<'py, PyAny>>,
    default: [T; 2],
) -> PyResult<[T; 2]> {
    let Some(value) = value else {
        return Ok(default);
    };
    let what = |_: &PyErr| format!("{name}: two of them are needed, for u and v");
    value
        .extract::<[T; 2]>()
        .map_err(|why| unfit(value.py(), why, what))
}

/// A place; zero where there is none.
pub(crate) fn place(name: &str, value: Option<&Bound<'_, PyAny>>) -> PyResult<DVec3> {
    let Some(value) = value else {
        return Ok(DVec3::ZERO);
    };
    let what = |_: &PyErr| format!("{name}: three numbers are needed");
    value
        .extract::<[f64; 3]>()
        .map(DVec3::from_array)
        .map_err(|why| unfit(value.py(), why, what))
}

/// Degrees: one number or two; cubic where there are none.
pub(crate) fn degree(value: Option<&Bound<'_, PyAny>>) -> PyResult<[usize; 2]> {
    let Some(value) = value else {
        return Ok([3, 3]);
    };
    let both = match value.extract::<[usize; 2]>() {
        Ok(both) => Some(both),
        Err(_) => value.extract::<usize>().ok().map(|p| [p, p]),
    };
    both.filter(|d| d.iter().all(|p| (1..=MAX_DEGREE).contains(p)))
        .ok_or_else(|| {
            Error::invalid(format!(
                "degree: one whole number from 1 to {MAX_DEGREE}, or two of them for u and v"
            ))
        })
        .or_raise(value.py())
}

/// A number or a text, as the command line has it.
pub(crate) fn parsed<T: FromStr<Err = Error>>(name: &str, value: &Bound<'_, PyAny>) -> PyResult<T> {
    let text = match value.cast::<PyString>() {
        Ok(text) => text.to_string(),
        // Pairs: `12,18`.
        Err(_) => match value.extract::<(f64, f64)>() {
            Ok((u, v)) => format!("{u},{v}"),
            Err(_) => format!("{}", value.extract::<f64>()?),
        },
    };
    let named = |error: Error| match error {
        Error::Invalid(what) => Error::invalid(format!("{name}: {what}")),
        other => other,
    };
    text.parse().map_err(named).or_raise(value.py())
}

/// A degree.
pub(crate) fn checked_degree(py: Python<'_>, degree: usize) -> PyResult<usize> {
    if (1..=MAX_DEGREE).contains(&degree) {
        return Ok(degree);
    }
    let what = format!("degree: one whole number from 1 to {MAX_DEGREE}");
    Err(Error::invalid(what)).or_raise(py)
}

/// The options of a conversion.
pub(crate) fn convert_options(
    py: Python<'_>,
    tolerance: Option<&Bound<'_, PyAny>>,
    unit: &str,
    to_unit: &str,
    step_schema: Option<&str>,
    author: Option<&str>,
    organization: Option<&str>,
) -> PyResult<ConvertOptions> {
    let schema = step_schema.map(|said| word("step_schema", said));
    let text = |said: Option<&str>| said.unwrap_or_default().to_owned();
    Ok(ConvertOptions {
        tolerance: tolerance.map(|t| parsed("tolerance", t)).transpose()?,
        unit: word("unit", unit).or_raise(py)?,
        to_unit: word("to_unit", to_unit).or_raise(py)?,
        schema: schema.transpose().or_raise(py)?.unwrap_or_default(),
        author: text(author),
        organization: text(organization),
        time: None,
    })
}

/// A length in `unit`, as a number or as the command line has it; shares are of the diagonal.
pub(crate) fn length(
    name: &str,
    value: Option<&Bound<'_, PyAny>>,
    unit: Unit,
    diagonal: f64,
) -> PyResult<Option<f64>> {
    let length = |value| parsed::<Length>(name, value);
    let found = value.map(length).transpose()?;
    Ok(found.map(|length| length.resolve(unit, diagonal)))
}

/// An angle in degrees, or a word.
fn sharp(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Sharp> {
    let text = match value.extract::<f64>() {
        Ok(angle) => format!("{angle}"),
        Err(_) => value.extract::<String>()?,
    };
    words::sharp(&text)
        .map_err(|error| match error {
            Error::Invalid(what) => Error::invalid(format!("{name}: {what}")),
            other => other,
        })
        .or_raise(value.py())
}

/// A share from 0 to 1.
pub(crate) fn share(name: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    let number = value.extract::<f64>().ok();
    number
        .filter(|share| (0.0..=1.0).contains(share))
        .ok_or_else(|| Error::invalid(format!("{name}: a share is a number from 0 to 1, as 0.995")))
        .or_raise(value.py())
}

/// A count from `least` to `most`.
fn count(name: &str, value: &Bound<'_, PyAny>, least: usize, most: usize) -> PyResult<usize> {
    let number = value.extract::<usize>().ok();
    let within = |n: &usize| (least..=most).contains(n);
    number
        .filter(within)
        .ok_or_else(|| {
            let range = match most {
                usize::MAX => format!("{least} or more"),
                most => format!("from {least} to {most}"),
            };
            Error::invalid(format!("{name}: a whole number, {range}"))
        })
        .or_raise(value.py())
}

/// Title and notes of a report.
pub(crate) fn heading(
    title: Option<String>,
    notes: Option<&Bound<'_, PyDict>>,
) -> PyResult<Heading> {
    const WRONG: &str = "notes: texts by their names, as {\"operator\": \"A. Lovelace\"}; none is empty or very long, and \
                         names are without `=`";
    let note = |(key, text): (Bound<'_, PyAny>, Bound<'_, PyAny>)| -> PyResult<Note> {
        let py = key.py();
        let (key, text) = (key.extract::<String>()?, text.str()?.to_string());
        let said = format!("{key}={text}").parse::<Note>().ok();
        let known = said.filter(|note| note.key == key.trim());
        known.ok_or_else(|| Error::invalid(WRONG)).or_raise(py)
    };
    let notes = notes
        .into_iter()
        .flatten()
        .map(note)
        .collect::<PyResult<_>>()?;
    Ok(Heading { title, notes })
}

/// The options of a fit from keywords; those that are `None` are left alone.
pub(crate) fn options(keywords: &Bound<'_, PyDict>) -> PyResult<Options> {
    let py = keywords.py();
    let mut options = Options::default();
    for (key, value) in keywords {
        let key: String = key.extract()?;
        if value.is_none() {
            continue;
        }
        let text = || value.extract::<String>();
        match key.as_str() {
            "tolerance" => {
                options.surfacing.tolerance = Some(parsed::<Length>("tolerance", &value)?);
            }
            "within" => options.surfacing.within = Some(share(&key, &value)?),
            "min_coverage" => options.min_coverage = Some(share(&key, &value)?),
            "layout" => options.surfacing.layout = word(&key, &text()?).or_raise(py)?,
            "sharp" => options.surfacing.sharp = sharp(&key, &value)?,
            "method" => options.surfacing.method = word(&key, &text()?).or_raise(py)?,
            "topology" => options.surfacing.topology = word(&key, &text()?).or_raise(py)?,
            "degree" => options.surfacing.degree = degree(Some(&value))?,
            "parameters" => {
                options.surfacing.parameters = word(&key, &text()?).or_raise(py)?;
            }
            "grid" => {
                let both = value.extract::<[usize; 2]>().ok();
                let what = "grid: two whole numbers, M points in each of N rows";
                options.input.grid = Some(both.ok_or_else(|| Error::invalid(what)).or_raise(py)?);
            }
            "rarefy" => options.surfacing.rarefy = parsed::<Rarefaction>("rarefy", &value)?,
            "enrich" => options.surfacing.enrich = count("enrich", &value, 0, 6)?,
            "max_control_points" => {
                options.surfacing.max_control_points = Some(count(&key, &value, 4, usize::MAX)?);
            }
            "trim" => options.surfacing.trim = word(&key, &text()?).or_raise(py)?,
            "unit" => options.input.unit = word(&key, &text()?).or_raise(py)?,
            "hold_out" => {
                let part: f64 = value.extract()?;
                if !(0.0..=0.5).contains(&part) {
                    let what = "hold_out: a fraction is a number from 0 to 0.5";
                    return Err(Error::invalid(what)).or_raise(py);
                }
                options.surfacing.hold_out = part;
            }
            "step_schema" => options.output.step_schema = word(&key, &text()?).or_raise(py)?,
            "iges_layout" => options.output.iges_layout = word(&key, &text()?).or_raise(py)?,
            "with_points" => options.output.with_points = value.extract()?,
            "author" => options.output.author = text()?,
            "organization" => options.output.organization = text()?,
            other => {
                return Err(Error::invalid(format!("no option is called {other}"))).or_raise(py);
            }
        }
    }
    Ok(options)
}

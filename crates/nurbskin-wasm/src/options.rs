//! Options as JSON objects, in the words of the command.
//!
//! The keys are those of the command in camel case, the values its words: `{ "tolerance": "0.05mm", "layout": "network" }`.
//! A key that is not known is an error, so that no option is lost by a slip of the pen.

use nurbskin::io::Timestamp;
use nurbskin::pipeline::words::{self, Worded};
use nurbskin::pipeline::{
    DeviationOptions, Heading, InputOptions, Length, Options, OutputOptions, SurfacingOptions,
};
use nurbskin::scan::simulate;
use nurbskin::{Error, Result};
use serde::Deserialize;

/// A length: a number in the unit of the scan, or words such as `0.05mm` or `0.1%`.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
enum Said {
    Number(f64),
    Words(String),
}

impl Said {
    fn length(&self) -> Result<Length> {
        match self {
            Self::Number(number) => number.to_string().parse(),
            Self::Words(words) => words.parse(),
        }
    }
}

/// Options of a fit.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields, default)]
pub struct FitOptions {
    tolerance: Option<Said>,
    within: Option<f64>,
    min_coverage: Option<f64>,
    unit: Option<String>,
    grid: Option<[usize; 2]>,
    layout: Option<String>,
    sharp: Option<String>,
    method: Option<String>,
    topology: Option<String>,
    degree: Option<[usize; 2]>,
    parameters: Option<String>,
    rarefy: Option<String>,
    enrich: Option<usize>,
    max_control_points: Option<usize>,
    trim: Option<String>,
    hold_out: Option<f64>,
    step_schema: Option<String>,
    iges_layout: Option<String>,
    with_points: Option<bool>,
    author: Option<String>,
    organization: Option<String>,
    date: Option<u64>,
    command: Option<String>,
}

/// The value of a word, the default if there is none.
fn word<T: Worded>(key: &str, said: Option<&String>) -> Result<T> {
    match said {
        Some(said) => T::of_word(said).map_err(|error| Error::invalid(format!("{key}: {error}"))),
        None => T::of_word("auto").or_else(|_| {
            let first = T::WORDS.first().map(|word| word.value);
            first.ok_or_else(|| Error::invalid(format!("{key}: there is no word for it")))
        }),
    }
}

/// A share from 0 to `most`.
fn share(key: &str, said: Option<f64>, most: f64) -> Result<Option<f64>> {
    match said {
        Some(share) if !(0.0..=most).contains(&share) => Err(Error::invalid(format!(
            "{key}: a share is a number from 0 to {most}, not {share}"
        ))),
        said => Ok(said),
    }
}

/// A date in seconds since 1970, if one is given.
fn dated(date: Option<u64>) -> Result<Option<Timestamp>> {
    date.map(Timestamp::from_unix_seconds).transpose()
}

impl FitOptions {
    /// The options of the library.
    ///
    /// # Errors
    /// [`Error::Invalid`] for words and numbers that are not values of their options.
    pub fn resolve(&self) -> Result<Options> {
        let usual = SurfacingOptions::default();
        let degree = self.degree.unwrap_or(usual.degree);
        // Source: the range of the command's --degree.
        if degree.iter().any(|p| !(1..=9).contains(p)) {
            return Err(Error::invalid("degree: two numbers from 1 to 9"));
        }
        if self.enrich.is_some_and(|levels| levels > 6) {
            return Err(Error::invalid("enrich: 0 to 6 levels"));
        }
        Ok(Options {
            input: InputOptions {
                unit: word("unit", self.unit.as_ref())?,
                grid: self.grid,
            },
            surfacing: SurfacingOptions {
                tolerance: self.tolerance.as_ref().map(Said::length).transpose()?,
                within: share("within", self.within, 1.0)?,
                layout: word("layout", self.layout.as_ref())?,
                sharp: words::sharp(self.sharp.as_deref().unwrap_or("auto"))?,
                method: word("method", self.method.as_ref())?,
                topology: word("topology", self.topology.as_ref())?,
                degree,
                parameters: word("parameters", self.parameters.as_ref())?,
                rarefy: self.rarefy.as_deref().unwrap_or("auto").parse()?,
                enrich: self.enrich.unwrap_or(usual.enrich),
                max_control_points: self.max_control_points,
                trim: word("trim", self.trim.as_ref())?,
                hold_out: share("holdOut", self.hold_out, 0.5)?.unwrap_or(usual.hold_out),
                ..usual
            },
            min_coverage: share("minCoverage", self.min_coverage, 1.0)?,
            output: OutputOptions {
                step_schema: word("stepSchema", self.step_schema.as_ref())?,
                iges_layout: word("igesLayout", self.iges_layout.as_ref())?,
                with_points: self.with_points.unwrap_or(false),
                author: self.author.clone().unwrap_or_default(),
                organization: self.organization.clone().unwrap_or_default(),
                time: dated(self.date)?,
                reports: Vec::new(),
                command: self.command.clone(),
                ..OutputOptions::default()
            },
        })
    }
}

/// Options of a comparison with a CAD file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields, default)]
pub struct CompareOptions {
    tolerance: Option<Said>,
    within: Option<f64>,
    min_coverage: Option<f64>,
    unit: Option<String>,
    align: bool,
    command: Option<String>,
}

impl CompareOptions {
    /// The options of the library.
    ///
    /// # Errors
    /// [`Error::Invalid`] for words and numbers that are not values of their options.
    pub fn resolve(&self) -> Result<DeviationOptions> {
        Ok(DeviationOptions {
            tolerance: self.tolerance.as_ref().map(Said::length).transpose()?,
            within: share("within", self.within, 1.0)?,
            min_coverage: share("minCoverage", self.min_coverage, 1.0)?,
            unit: word("unit", self.unit.as_ref())?,
            align: self.align,
            heading: Heading::default(),
            time: None,
            reports: Vec::new(),
            command: self.command.clone(),
        })
    }

    /// The command line of the page.
    pub(crate) fn command(&self) -> Option<&str> {
        self.command.as_deref()
    }
}

/// Options of the virtual scanner.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields, default)]
pub struct SimulateOptions {
    points: Option<usize>,
    noise: f64,
    outliers: f64,
    holes: usize,
    seed: u64,
    shuffled: bool,
    mesh: bool,
}

impl SimulateOptions {
    /// For a shape.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a mesh, which only bodies have.
    pub fn of_shape(&self) -> Result<simulate::ScanOptions> {
        if self.mesh {
            return Err(Error::invalid(
                "mesh: only bodies are scanned as meshes, such as a drill",
            ));
        }
        Ok(simulate::ScanOptions {
            points: self.points,
            noise: self.noise,
            outliers: self.outliers,
            holes: self.holes,
            seed: self.seed,
            order: if self.shuffled {
                simulate::Order::Shuffled
            } else {
                simulate::Order::Ordered
            },
            ..simulate::ScanOptions::default()
        })
    }

    /// For a body; its clouds are in random order.
    #[must_use]
    pub fn of_body(&self) -> simulate::BodyOptions {
        simulate::BodyOptions {
            points: self.points,
            layout: if self.mesh {
                simulate::Layout::Mesh
            } else {
                simulate::Layout::Cloud
            },
            noise: self.noise,
            outliers: self.outliers,
            holes: self.holes,
            seed: self.seed,
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use nurbskin::Unit;
    use nurbskin::pipeline::{FaceLayout, Sharp};

    fn fit(text: &str) -> std::result::Result<Options, String> {
        let options: FitOptions = serde_json::from_str(text).map_err(|e| e.to_string())?;
        options.resolve().map_err(|e| e.to_string())
    }

    #[test]
    fn an_empty_object_leaves_every_choice_to_the_data() {
        let [ours, usual] = [fit("{}").unwrap(), Options::default()].map(|o| format!("{o:?}"));
        assert_eq!(ours, usual);
    }

    #[test]
    fn words_are_those_of_the_command() {
        let options =
            fit(r#"{"tolerance":"20um","unit":"in","layout":"network","sharp":"30","degree":[2,3],"date":1700000000}"#)
                .unwrap();
        assert_eq!(
            options.surfacing.tolerance,
            Some(Length::In(20.0, Unit::Micrometre))
        );
        assert_eq!(options.input.unit, Some(Unit::Inch));
        assert_eq!(options.surfacing.layout, FaceLayout::Network);
        assert_eq!(options.surfacing.sharp, Sharp::Degrees(30.0));
        assert_eq!(options.surfacing.degree, [2, 3]);
        let date = options.output.time.unwrap().iso();
        assert_eq!(date, "2023-11-14T22:13:20");
        let plain = fit(r#"{"tolerance":0.25}"#).unwrap().surfacing.tolerance;
        assert_eq!(plain, Some(Length::Plain(0.25)));
    }

    #[test]
    fn what_is_no_option_is_refused_by_name() {
        for (text, words) in [
            (r#"{"tolerence":"1mm"}"#, "unknown field `tolerence`"),
            (
                r#"{"tolerance":"-1mm"}"#,
                "a tolerance is a positive length",
            ),
            (r#"{"tolerance":-1}"#, "a tolerance is a positive length"),
            (r#"{"unit":"furlong"}"#, "unit: \"furlong\" is not known"),
            (r#"{"within":2}"#, "within: a share is a number from 0 to 1"),
            (r#"{"holdOut":0.9}"#, "holdOut: a share"),
            (r#"{"degree":[0,3]}"#, "degree: two numbers"),
            (r#"{"enrich":9}"#, "enrich: 0 to 6"),
            (r#"{"sharp":"blunt"}"#, "degrees from 0 to 180"),
        ] {
            let said = fit(text).unwrap_err();
            assert!(said.contains(words), "{text}: {said}");
        }
        let mesh = SimulateOptions {
            mesh: true,
            ..SimulateOptions::default()
        };
        assert!(mesh.of_shape().is_err());
    }

    #[test]
    fn a_comparison_aligns_where_it_is_told_to() {
        let options: CompareOptions =
            serde_json::from_str(r#"{"align":true,"tolerance":"0.1mm"}"#).unwrap();
        let options = options.resolve().unwrap();
        assert!(options.align && options.tolerance.is_some());
    }
}

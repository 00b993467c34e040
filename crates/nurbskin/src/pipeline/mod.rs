//! The line as one call: file, scan, ordered points, surface, deviation, CAD file.
//!
//! Every front end calls [`fit()`] (or [`fit_scan`] where the scan does not come from a file) and adds nothing to the
//! geometry.

mod cloud;
mod info;
mod options;
mod ordered;
mod outcome;
mod output;
mod repair;
mod verbs;

pub use info::{CadContent, Content, Information, ScanContent, SurfaceContent, info};
pub use options::{Length, Method, Options, Rarefaction};
pub use outcome::{
    DeviationSummary, Input, Outcome, Output, PerPoint, RejectedCounts, SurfaceSummary, Times,
};
pub use output::{
    REPORT_FORMATS, SCAN_FORMATS, SURFACE_FORMATS, check_folders, check_outputs, output_of,
};
pub use verbs::{Enriched, Rarefied, enrich, rarefy};

use crate::chart::Topology;
use crate::deviation::coverage::{Coverage, coverage};
use crate::deviation::measure::{Deviation, Outside, Statistics, measure};
use crate::deviation::verdict::{Judgement, Resolution, Verdict, judge};
use crate::io;
use crate::nurbs::closest::ClosestPoint;
use crate::progress::Progress;
use crate::scan::{GridLayout, Organisation, Rejected, Scan};
use crate::unit::UnitSource;
use crate::{Error, NurbsSurface, Result};
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Share of the bounding-box diagonal that is the tolerance where the scan shows no noise.
const TOLERANCE_OF_DIAGONAL: f64 = 5e-4;
/// Least squares may do better than interpolation of resampled rows, but not by more than this.
const NEAR_MISS: f64 = 10.0;
/// The tolerance chosen for a noisy scan, in standard deviations: 99.7 % of normal noise lies within.
const TOLERANCE_OF_SIGMA: f64 = 3.0;

/// A surface and how it came about, before it is measured.
struct Fitted {
    surface: NurbsSurface,
    topology: Topology,
    method: &'static str,
    /// Why the fit itself says that it falls short of the tolerance.
    not_met: Option<String>,
    kept: Option<[usize; 2]>,
    parameters: Option<&'static str>,
    grid: Option<[usize; 2]>,
    /// Whether the grid stands for rows of different length.
    resampled: bool,
    tolerance: Tolerance,
    /// The points that count, with their indices in the file.
    used: Vec<u32>,
    points: Vec<DVec3>,
    /// Which of `points` the fit did not see.
    held_out: Vec<bool>,
    rejected: Vec<Rejected>,
    spacing: f64,
    noise: f64,
    triangles: Option<Vec<[u32; 3]>>,
    /// Choices made, for the user.
    notes: Vec<String>,
}

/// The tolerance aimed at, and where it comes from.
#[derive(Clone, Debug)]
struct Tolerance {
    value: f64,
    source: String,
}

impl Tolerance {
    /// The tolerance asked for, or one that the data can carry.
    fn choose(options: &Options, scan: &Scan, noise: f64, diagonal: f64) -> Self {
        if let Some(length) = options.tolerance {
            return Self {
                value: length.in_unit(scan.unit),
                source: "option".into(),
            };
        }
        let (by_noise, by_size) = (TOLERANCE_OF_SIGMA * noise, TOLERANCE_OF_DIAGONAL * diagonal);
        if by_noise > by_size {
            Self {
                value: by_noise,
                source: "three times the measured noise".into(),
            }
        } else {
            Self {
                value: by_size,
                source: "0.05 % of the scan's diagonal; the measured noise is smaller".into(),
            }
        }
    }
}

/// Fits a surface to the scan in `path` and writes `outputs`; the format of each follows its extension.
///
/// # Errors
/// [`Error::Read`], [`Error::Write`], [`Error::Unsupported`] for scans that cannot be charted yet,
/// [`Error::NoSolution`], [`Error::Cancelled`]. Nothing is written then, but for files that were replaced before another could not be written.
pub fn fit(
    path: &Path,
    outputs: &[PathBuf],
    options: &Options,
    progress: &dyn Progress,
) -> Result<Outcome> {
    let start = Instant::now();
    output::check_folders(outputs)?;
    output::check_folders(&options.reports)?;
    progress.stage("read", None);
    let scan = io::read_scan(path)?;
    let read = start.elapsed().as_secs_f64();
    let mut outcome = fit_scan(scan, &path.display().to_string(), options, progress)
        .map_err(|error| about(path, error))?;
    outcome.time.read = read;
    let writing = Instant::now();
    progress.stage("write", None);
    progress.check()?;
    output::write_all(&mut outcome, outputs, options)?;
    outcome.time.write = writing.elapsed().as_secs_f64();
    outcome.time.total = start.elapsed().as_secs_f64();
    Ok(outcome)
}

/// The error, naming the file that it is about.
fn about(path: &Path, error: Error) -> Error {
    let named = |what: String| format!("{}: {what}", path.display());
    match error {
        Error::Invalid(what) => Error::Invalid(named(what)),
        Error::Unsupported(what) => Error::Unsupported(named(what)),
        Error::NoSolution(what) => Error::NoSolution(named(what)),
        other => other,
    }
}

/// Fits a surface to a scan that is already read; `name` stands for it in the outcome. Nothing is written.
///
/// # Errors
/// As [`fit()`], without those of files.
pub fn fit_scan(
    mut scan: Scan,
    name: &str,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Outcome> {
    let start = Instant::now();
    apply_options(&mut scan, options)?;
    let mut times = Times::default();
    let mut fitted = fit_points(&scan, options, progress, &mut times)?;
    let mut assessed = Assessed::new(&fitted, progress, &mut times)?;
    // Rows of different length are interpolated at points between their own. Where that costs the tolerance, least
    // squares through their own points may keep it.
    let chosen = options.method == Method::Auto
        && options.rarefy == Rarefaction::Auto
        && options.enrich == 0
        && fitted.method == "interpolate";
    let near = assessed.measured.statistics.max <= NEAR_MISS * fitted.tolerance.value;
    if chosen && near && fitted.resampled && assessed.judged.verdict == Verdict::Fail {
        let [m, n] = fitted.surface.distinct_counts();
        let instead = Options {
            method: Method::Approximate,
            max_control_points: options.max_control_points.or(Some(m * n)),
            ..options.clone()
        };
        let other = fit_points(&scan, &instead, progress, &mut times)?;
        let other_assessed = Assessed::new(&other, progress, &mut times)?;
        if other_assessed.measured.statistics.max < assessed.measured.statistics.max {
            (fitted, assessed) = (other, other_assessed);
        }
    }
    let Assessed {
        measured,
        coverage,
        hold_out,
        judged,
    } = assessed;
    check_budget(&fitted, options)?;
    times.total = start.elapsed().as_secs_f64();

    let mut warnings = std::mem::take(&mut scan.warnings);
    warnings.extend(fitted.notes);
    if fitted.surface.degree() != options.degree {
        let [p, q] = fitted.surface.degree();
        warnings.push(format!(
            "so few points carry degree {p} x {q} only, not {} x {}",
            options.degree[0], options.degree[1]
        ));
    }
    if scan.unit_source == UnitSource::Assumed {
        warnings.push(format!(
            "the file does not say its unit: {} assumed (say --unit)",
            scan.unit
        ));
    }
    let surface = &fitted.surface;
    Ok(Outcome {
        nurbskin: env!("CARGO_PKG_VERSION"),
        input: Input {
            path: name.to_owned(),
            format: scan.format,
            points: scan.points.len(),
            used: fitted.points.len(),
            rejected: RejectedCounts::of(&fitted.rejected),
            organisation: scan.organisation.name(),
            grid: fitted.grid,
            unit: scan.unit,
            unit_source: scan.unit_source,
            spacing: fitted.spacing,
            noise: fitted.noise,
        },
        surface: SurfaceSummary {
            topology: fitted.topology,
            degree: surface.degree(),
            control_points: surface.distinct_counts(),
            rational: surface.is_rational(),
            closed: fitted.topology.closed(),
            periodic: surface.periodic(),
            trimmed: false,
            kept: fitted.kept,
            parameters: fitted.parameters,
        },
        method: fitted.method,
        tolerance: fitted.tolerance.value,
        tolerance_source: fitted.tolerance.source,
        deviation: DeviationSummary {
            scan_to_surface: measured.statistics,
            free_edges: measured.free_edges,
            surface_to_scan: coverage,
            hold_out,
        },
        verdict: judged.verdict,
        reason: judged.reason,
        time: times,
        outputs: Vec::new(),
        warnings,
        per_point: PerPoint {
            indices: fitted.used,
            points: fitted.points,
            deviation: measured.points,
        },
        geometry: fitted.surface,
        origin: scan.origin,
    })
}

/// A surface, measured.
struct Assessed {
    measured: Deviation,
    coverage: Coverage,
    hold_out: Option<Statistics>,
    judged: Judgement,
}

impl Assessed {
    fn new(fitted: &Fitted, progress: &dyn Progress, times: &mut Times) -> Result<Self> {
        let start = Instant::now();
        progress.stage("deviation", Some(fitted.points.len() as u64));
        progress.check()?;
        let tolerance = fitted.tolerance.value;
        let closest = ClosestPoint::new(&fitted.surface)?;
        let measured = measure(
            &closest,
            &fitted.points,
            None,
            tolerance,
            Outside::Normal,
            progress,
        )?;
        progress.check()?;
        let coverage = coverage(
            &fitted.surface,
            &fitted.points,
            fitted.triangles.as_deref(),
            fitted.spacing,
        );
        progress.check()?;
        let hold_out = fitted.held_out.contains(&true).then(|| {
            let all = measured.points.iter().zip(&fitted.held_out);
            let unseen: Vec<_> = all
                .filter(|(_, out)| **out)
                .map(|(point, _)| *point)
                .collect();
            Statistics::new(&unseen, tolerance)
        });
        let resolution = Resolution {
            noise: fitted.noise,
            spacing: fitted.spacing,
        };
        let mut judged = judge(&measured, tolerance, resolution);
        if let (Some(why), Verdict::Fail) = (&fitted.not_met, judged.verdict) {
            judged.reason = format!("{}; {why}", judged.reason);
        }
        times.deviation += start.elapsed().as_secs_f64();
        Ok(Self {
            measured,
            coverage,
            hold_out,
            judged,
        })
    }
}

/// The budget is a promise: what cannot be had within it is not written.
fn check_budget(fitted: &Fitted, options: &Options) -> Result<()> {
    let [m, n] = fitted.surface.distinct_counts();
    let [p, q] = fitted.surface.degree();
    match options.max_control_points {
        Some(budget) if m * n > budget => Err(Error::NoSolution(format!(
            "a {} of degree {p} x {q} takes {m} x {n} control points here, which is over the budget of {budget}: allow \
             more, or a lower degree",
            fitted.topology.name()
        ))),
        _ => Ok(()),
    }
}

/// What the options say about the scan itself: its unit and its order.
fn apply_options(scan: &mut Scan, options: &Options) -> Result<()> {
    if let Some(unit) = options.unit {
        (scan.unit, scan.unit_source) = (unit, UnitSource::Option);
    }
    if let Some([m, n]) = options.grid {
        if m.checked_mul(n) != Some(scan.points.len()) {
            return Err(Error::invalid(format!(
                "--grid {m}x{n} needs {} points, but the scan has {}: check which number counts the points in a row \
                 (M) and which the rows (N)",
                m.saturating_mul(n),
                scan.points.len()
            )));
        }
        let layout =
            GridLayout::complete(m, n).ok_or_else(|| Error::invalid("the grid is too large"))?;
        scan.organisation = Organisation::Grid(layout);
    }
    Ok(())
}

/// Ordered scans by the paper's way, everything else through a chart.
fn fit_points(
    scan: &Scan,
    options: &Options,
    progress: &dyn Progress,
    times: &mut Times,
) -> Result<Fitted> {
    let is_ordered = matches!(
        scan.organisation,
        Organisation::Grid(_) | Organisation::Rows(_)
    );
    if is_ordered {
        match ordered::fit(scan, options, progress, times) {
            // A grid with holes is still a cloud.
            Err(Error::Unsupported(why))
                if options.grid.is_none() && options.method != Method::Interpolate =>
            {
                let note = format!("{why}; the points are taken without their order");
                let mut fitted =
                    cloud::fit(scan, options, progress, times).map_err(|error| match error {
                        Error::Unsupported(what) => {
                            Error::Unsupported(format!("{note}, and then {what}"))
                        }
                        other => other,
                    })?;
                fitted.notes.insert(0, note);
                return Ok(fitted);
            }
            other => return other,
        }
    } else if options.method == Method::Interpolate {
        return Err(Error::Unsupported(
            "interpolation needs an ordered scan: say `--grid MxN` if the file lists N rows of M points, or use \
             `--method approximate`"
                .into(),
        ));
    }
    let listed = scan.organisation == Organisation::Unordered;
    cloud::fit(scan, options, progress, times).map_err(|error| match error {
        Error::Unsupported(what) if listed => Error::Unsupported(format!(
            "{what}; if the file lists N rows of M points, say --grid MxN"
        )),
        other => other,
    })
}

/// Every k-th of `count` points is held out, for a fraction 1/k.
fn hold_out(count: usize, fraction: f64) -> Vec<bool> {
    if fraction <= 0.0 {
        return vec![false; count];
    }
    // The k-th point is the one at which the running share passes the next whole number.
    let passes = |i: usize| ((i + 1) as f64 * fraction).floor() > (i as f64 * fraction).floor();
    (0..count).map(passes).collect()
}

//! The line as one call: file, scan, ordered points, surface, deviation, CAD file.
//!
//! Every front end calls [`fit()`] (or [`fit_scan`] where the scan does not come from a file) and adds nothing to the
//! geometry.

mod cloud;
mod options;
mod ordered;
mod outcome;
mod output;
mod verbs;

pub use options::{Length, Method, Options, Rarefaction};
pub use outcome::{
    DeviationSummary, Input, Outcome, Output, PerPoint, RejectedCounts, SurfaceSummary, Times,
};
pub use output::{REPORT_FORMATS, SCAN_FORMATS, SURFACE_FORMATS, check_outputs, output_of};
pub use verbs::{Enriched, Rarefied, enrich, rarefy};

use crate::chart::Topology;
use crate::deviation::coverage::coverage;
use crate::deviation::measure::{Outside, Statistics, measure};
use crate::deviation::verdict::{Resolution, Verdict, judge};
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
/// [`Error::NoSolution`], [`Error::Cancelled`]. Nothing is written then.
pub fn fit(
    path: &Path,
    outputs: &[PathBuf],
    options: &Options,
    progress: &dyn Progress,
) -> Result<Outcome> {
    let start = Instant::now();
    progress.stage("read", None);
    let scan = io::read_scan(path)?;
    let read = start.elapsed().as_secs_f64();
    let mut outcome = fit_scan(scan, &path.display().to_string(), options, progress)?;
    outcome.time.read = read;
    let writing = Instant::now();
    progress.stage("write", None);
    progress.check()?;
    output::write_all(&mut outcome, outputs, options)?;
    outcome.time.write = writing.elapsed().as_secs_f64();
    outcome.time.total = start.elapsed().as_secs_f64();
    Ok(outcome)
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
    let fitted = fit_points(&scan, options, progress, &mut times)?;

    let measuring = Instant::now();
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
    let hold_out = fitted.held_out.contains(&true).then(|| {
        let unseen = measured
            .points
            .iter()
            .zip(&fitted.held_out)
            .filter(|(_, held_out)| **held_out);
        Statistics::new(
            &unseen.map(|(point, _)| *point).collect::<Vec<_>>(),
            tolerance,
        )
    });
    let resolution = Resolution {
        noise: fitted.noise,
        spacing: fitted.spacing,
    };
    let mut judged = judge(&measured, tolerance, resolution);
    if let (Some(why), Verdict::Fail) = (&fitted.not_met, judged.verdict) {
        judged.reason = format!("{}; {why}", judged.reason);
    }
    times.deviation = measuring.elapsed().as_secs_f64();
    times.total = start.elapsed().as_secs_f64();

    let mut warnings = std::mem::take(&mut scan.warnings);
    warnings.extend(fitted.notes);
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
        tolerance,
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
                progress.warn(&format!("{why}; the points are taken without their order"));
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
    cloud::fit(scan, options, progress, times)
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

//! The line as one call: file, scan, ordered points, surface, deviation, CAD file.
//!
//! Every front end calls [`fit()`] (or [`fit_scan`] where the scan does not come from a file) and adds nothing to the
//! geometry.

mod assess;
mod check;
mod cloud;
mod convert;
mod defects;
mod deviation;
mod fitted;
mod free_form;
mod info;
mod options;
mod ordered;
mod outcome;
mod output;
mod page;
mod part;
mod reads_back;
mod repair;
mod sanity;
mod solid;
mod source;
mod stored;
mod target;
mod trade;
mod verbs;
mod view;
pub mod words;

pub use check::{Checked, FitCheck, check, check_fitted, check_from};
pub use convert::{
    CONVERT_FORMATS, ConvertOptions, Converted, ConvertedInput, convert, convert_from,
};
pub use deviation::{Compared, DeviationOptions, deviation, deviation_from};
pub use info::{CadContent, Content, Information, ScanContent, SurfaceContent, info, info_from};
pub use options::{Length, Method, Options, Rarefaction, Trim};
pub use outcome::{
    Aim, DeviationSummary, Input, Outcome, Output, PartSummary, PerPoint, RejectedCounts, SCHEMA,
    SurfaceSummary, Times, WorstPoint,
};
pub use output::{
    REPORT_FORMATS, SCAN_FORMATS, SURFACE_FORMATS, check_folders, check_outputs, check_targets,
    default_output, output_of, refuse_existing, write, write_to,
};
pub use page::page_of_fit;
pub use source::Source;
pub use target::{STREAMED, Target};
pub use verbs::{
    Enriched, Rarefied, ScanSummary, enrich, enrich_from, rarefy, rarefy_from, write_scan_to,
};
pub use view::{PAGE_FORMATS, Viewed, view, view_from};

use assess::Assessed;
use fitted::{Fitted, Part, Tolerance};
use glam::DVec3;
use nurbskin_cad::Model;
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::UnitSource;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::{GridLayout, Organisation, Reason, Rejected, Scan};
use sanity::FitFacts;
use std::path::{Path, PathBuf};
use std::time::Instant;
use trade::Trade;

/// Least squares may do better than interpolation of resampled rows, but not by more than this.
const NEAR_MISS: f64 = 10.0;

/// So many times the points that may be beyond a tolerance are what trimming may cost; more has another cause.
const FEW_MORE: f64 = 1.5;
/// Parts of what may be beyond that are tried then, one after the other.
const STRICTER: [f64; 2] = [0.8, 0.5];

/// Fits a surface to the scan in `path` and writes `outputs`; the format of each follows its extension.
///
/// # Errors
/// [`Error::Invalid`] for an output that is the scan itself, another output, or of an unknown format, before any work;
/// [`Error::Read`], [`Error::Write`], [`Error::Unsupported`] for scans that cannot be charted yet,
/// [`Error::NoSolution`], [`Error::Cancelled`]. Nothing is written then, but for files that were replaced before another could not be written.
pub fn fit(
    path: &Path,
    outputs: &[PathBuf],
    options: &Options,
    progress: &dyn Progress,
) -> Result<Outcome> {
    let outputs = Target::files(outputs);
    fit_from(&Source::file(path), &outputs, options, progress)
}

/// As [`fit()`], from a file or bytes to files or bytes.
///
/// # Errors
/// As [`fit()`].
pub fn fit_from(
    source: &Source,
    outputs: &[Target],
    options: &Options,
    progress: &dyn Progress,
) -> Result<Outcome> {
    let start = Instant::now();
    let path = source.path();
    output::check_all(&[source], outputs, &SURFACE_FORMATS)?;
    output::check_all(&[source], &Target::files(&options.reports), &REPORT_FORMATS)?;
    progress.stage("read", None);
    let scan = source.read_scan()?;
    let read = start.elapsed().as_secs_f64();
    let mut outcome = fit_scan(scan, &path.display().to_string(), options, progress)
        .map_err(|error| about(path, error))?;
    outcome.time.read = read;
    let writing = Instant::now();
    progress.stage("write", None);
    progress.check()?;
    output::write_all(&mut outcome, Some(source), outputs, options, progress)?;
    outcome.time.write = writing.elapsed().as_secs_f64();
    outcome.time.total = start.elapsed().as_secs_f64();
    Ok(outcome)
}

/// Refuses a scan without a point that could be compared or shown.
fn refuse_pointless(scan: &Scan) -> Result<()> {
    if scan.points.is_empty() {
        return Err(Error::invalid(
            "the scan has no points; check that the file is a complete scan and not only a header, a curve or a solid",
        ));
    }
    if !scan.points.iter().any(|p| p.is_finite()) {
        return Err(Error::invalid("no point of it is finite"));
    }
    Ok(())
}

/// The error, naming the file that it is about.
fn about(path: &Path, error: Error) -> Error {
    let name = path.display().to_string();
    // What a reader says names the file already.
    let named = |what: String| match what.starts_with(&name) {
        true => what,
        false => format!("{name}: {what}"),
    };
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
    sanity::check_shares(options.within, options.min_coverage)?;
    apply_options(&mut scan, options)?;
    if let Some(doubt) = sanity::doubtful_tolerance(&scan, options) {
        progress.warn(&doubt);
    }
    let mut times = Times::default();
    let mut fitted = fit_points(&scan, options, progress, &mut times)?;
    let mut model = fitted.model("", scan.unit)?;
    let mut assessed = Assessed::new(&fitted, &model, options, progress, &mut times)?;
    let again = |instead: &Options, times: &mut Times| -> Result<(Fitted, Model, Assessed)> {
        let other = fit_points(&scan, instead, progress, times)?;
        let model = other.model("", scan.unit)?;
        let assessed = Assessed::new(&other, &model, options, progress, times)?;
        Ok((other, model, assessed))
    };
    if let Some(instead) = second_try(&fitted, &assessed, options) {
        let other = again(&instead, &mut times)?;
        if other.2.statistics.max < assessed.statistics.max {
            (fitted, model, assessed) = other;
        }
    }
    for part in STRICTER {
        if let Some(instead) = stricter(&fitted, &assessed, options, part) {
            let other = again(&instead, &mut times)?;
            if other.2.statistics.within_tolerance > assessed.statistics.within_tolerance {
                (fitted, model, assessed) = other;
            }
        }
    }
    fitted.check_budget(options)?;
    times.total = start.elapsed().as_secs_f64();
    let notes = notes(&mut scan, &mut fitted, options);
    let (unit, origin) = (scan.unit, scan.origin);
    let counts = RejectedCounts::of(&fitted.rejected);
    let rejected = rejected_points(&scan, &fitted);
    let surfaces: Vec<SurfaceSummary> = fitted
        .parts
        .iter()
        .zip(&assessed.parts)
        .zip(model.faces())
        .map(|((part, assessed), face)| {
            let trade = Trade::new(part, &assessed.measured, &fitted, options);
            part.summary(trade, face)
        })
        .collect();
    let parts: Vec<PartSummary> = fitted
        .parts
        .iter()
        .zip(&assessed.parts)
        .zip(&surfaces)
        .map(|((part, assessed), surface)| PartSummary {
            surface: surface.clone(),
            points: part.points.len(),
            scan_to_surface: assessed.measured.statistics,
            verdict: assessed.judged.verdict,
            reason: assessed.judged.clone().moved(origin).reason(unit),
            reasons: assessed.judged.clone().moved(origin).reasons,
        })
        .collect();
    let mut judged = assessed.judged.clone().moved(origin);
    let facts = FitFacts {
        points: scan.points.len() - counts.non_finite,
        rejected: counts,
        beyond: fitted.parts.iter().map(|part| part.beyond).sum(),
        unsupported: assessed.coverage.unsupported_area,
        unit,
        unit_source: scan.unit_source,
        extents: fitted.extents(),
        options,
    };
    for (verdict, reason) in sanity::of_fit(&facts) {
        judged.add(verdict, reason);
    }
    let per_point = assessed.take_per_point(&mut fitted);
    let (Some(first), Some(surface)) = (fitted.parts.first(), surfaces.into_iter().next()) else {
        return Err(Error::NoSolution(
            "no part of the scan could be fitted".into(),
        ));
    };
    Ok(Outcome {
        nurbskin: env!("CARGO_PKG_VERSION").into(),
        schema: SCHEMA,
        input: Input {
            path: name.to_owned(),
            format: scan.format,
            points: scan.points.len(),
            used: per_point.points.len(),
            rejected: counts,
            organisation: scan.organisation.name().into(),
            grid: fitted.grid,
            unit: scan.unit,
            unit_source: scan.unit_source,
            bounding_box: nurbskin_geometry::point_grid::bounding_box(&per_point.points)
                .map(|corner| (corner + scan.origin).to_array()),
            spacing: Some(fitted.spacing),
            noise: Some(fitted.noise),
            scene_objects: fitted.objects,
        },
        surface,
        parts: if parts.len() > 1 { parts } else { Vec::new() },
        method: first.method.into(),
        tolerance: fitted.tolerance.asked(),
        within: fitted.asked(options).map(|asked| asked.within),
        aim: Aim {
            value: fitted.tolerance.value,
            source: fitted.tolerance.source,
        },
        deviation: DeviationSummary {
            scan_to_surface: assessed.statistics,
            free_edges: assessed.free_edges,
            surface_to_scan: assessed.coverage,
            hold_out: assessed.hold_out,
            worst: per_point.worst(scan.origin),
        },
        verdict: judged.verdict,
        reason: judged.reason(unit),
        reasons: judged.reasons,
        time: times,
        outputs: Vec::new(),
        check: None,
        warnings: notes.warnings,
        details: notes.details,
        per_point,
        rejected,
        model,
        geometry: fitted.parts.into_iter().map(|part| part.surface).collect(),
        origin: scan.origin,
    })
}

/// Rows of different length are interpolated at points between their own. Where that costs the tolerance, least squares
/// through their own points may keep it: the options for that, if it is worth a try.
fn second_try(fitted: &Fitted, assessed: &Assessed, options: &Options) -> Option<Options> {
    let chosen = options.method == Method::Auto
        && options.rarefy == Rarefaction::Auto
        && options.enrich == 0
        && fitted.parts.iter().all(|part| part.method == "interpolate");
    let near = assessed.statistics.max <= NEAR_MISS * fitted.tolerance.value;
    let missed = assessed.statistics.max > fitted.tolerance.value;
    // A tolerance that was asked for may cost more control points.
    let as_many = match options.tolerance {
        None => Some(fitted.control_points()),
        Some(_) => None,
    };
    (chosen && near && missed && fitted.resampled).then(|| Options {
        method: Method::Approximate,
        max_control_points: options.max_control_points.or(as_many),
        ..options.clone()
    })
}

/// A fit measures to the whole surface; where that is then trimmed, a few points are farther off. Where those cost the share
/// that was asked for, though the fit had reached it: the options with a share of which only this part is used.
fn stricter(fitted: &Fitted, assessed: &Assessed, options: &Options, part: f64) -> Option<Options> {
    let asked = fitted.asked(options)?;
    let reached = fitted.parts.iter().all(|part| part.not_met.is_none());
    let is_cut = fitted.parts.iter().any(|part| part.trimming.is_some());
    let allowed = 1.0 - asked.within;
    let beyond = 1.0 - assessed.statistics.within_tolerance?;
    let few = allowed > 0.0 && beyond > allowed && beyond <= FEW_MORE * allowed;
    (reached && is_cut && few).then(|| Options {
        within: Some(1.0 - part * allowed),
        ..options.clone()
    })
}

/// What the user should know: what was assumed in reading, chosen in fitting, and could not be had.
fn notes(scan: &mut Scan, fitted: &mut Fitted, options: &Options) -> Notes {
    let mut notes = Notes {
        warnings: std::mem::take(&mut scan.warnings),
        details: Vec::new(),
    };
    notes.append(std::mem::take(&mut fitted.notes));
    let lower = fitted.parts.iter().map(|part| part.surface.degree());
    // Exact conics have a degree of their own.
    let lower = lower
        .zip(&fitted.parts)
        .find(|(degree, part)| !part.surface.is_rational() && *degree != options.degree);
    if let Some(([p, q], _)) = lower {
        notes.warn(format!(
            "the points are too few for degree {} x {}: degree {p} x {q} is used",
            options.degree[0], options.degree[1]
        ));
    }
    let unordered = !scan.organisation.is_ordered();
    if unordered && options.enrich > 0 {
        notes.warn(no_effect("enrichment"));
    }
    if unordered && options.rarefy != Rarefaction::Auto {
        notes.warn(no_effect("rarefaction"));
    }
    if unordered && options.parameters.is_some() {
        notes.warn(no_effect("choice of parameters"));
    }
    let is_grid = matches!(scan.organisation, Organisation::Grid(_));
    let counts = RejectedCounts::of(&fitted.rejected);
    sanity::ignored(scan.points.len(), counts, is_grid, &mut notes);
    if let Some(doubt) = sanity::doubtful_unit(scan.unit_source, scan.unit, fitted.extents()) {
        notes.warnings.insert(0, doubt.words_with_next());
    } else if scan.unit_source == UnitSource::Assumed {
        notes.warn(match &*scan.format {
            nurbskin_scan::io::ARRAY => format!("the array has no unit: {} is assumed", scan.unit),
            _ => format!(
                "the file does not say its unit: {} is assumed (say --unit)",
                scan.unit
            ),
        });
    }
    notes
}

/// Of an option for ordered points, where there are others.
fn no_effect(what: &str) -> String {
    format!("the {what} has no effect: it applies to ordered points only")
}

/// The points that were left out because of where they are, with their indices.
fn rejected_points(scan: &Scan, fitted: &Fitted) -> Vec<(u32, DVec3)> {
    let placed = |r: &&Rejected| matches!(r.reason, Reason::Outlier | Reason::LeftOut);
    let rejected = fitted.rejected.iter().filter(placed);
    let point = |r: &Rejected| Some((u32::try_from(r.index).ok()?, *scan.points.get(r.index)?));
    rejected.filter_map(point).collect()
}

/// What the options say about the scan itself: its unit and its order.
fn apply_options(scan: &mut Scan, options: &Options) -> Result<()> {
    if let Some(unit) = options.unit {
        (scan.unit, scan.unit_source) = (unit, UnitSource::Option);
    }
    if let Some([m, n]) = options.grid {
        if let Organisation::Grid(own) = &scan.organisation {
            if [own.count_u, own.count_v] == [m, n] {
                return Ok(());
            }
            return Err(Error::invalid(format!(
                "--grid {m}x{n} contradicts the scan, whose points are in a grid of {} x {} already: leave it away",
                own.count_u, own.count_v
            )));
        }
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
    if scan.organisation.is_ordered() {
        match ordered::fit(scan, options, progress, times) {
            // A grid with holes is still a cloud.
            Err(Error::Unsupported(why))
                if options.grid.is_none() && options.method != Method::Interpolate =>
            {
                let note = match scan.organisation {
                    Organisation::Grid(_) => {
                        format!("{why}: the cells of the grid are fitted as a mesh, not row by row")
                    }
                    _ => format!("{why}: the rows are ignored, and their points fitted as a cloud"),
                };
                let mut fitted =
                    cloud::fit(scan, options, progress, times).map_err(|error| match error {
                        Error::Unsupported(what) => {
                            Error::Unsupported(format!("{note}; then {what}"))
                        }
                        other => other,
                    })?;
                // A range image loses nothing by that, rows lose their order.
                let list = match scan.organisation {
                    Organisation::Grid(_) => &mut fitted.notes.details,
                    _ => &mut fitted.notes.warnings,
                };
                list.insert(0, note);
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

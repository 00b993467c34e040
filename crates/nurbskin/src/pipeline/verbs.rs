//! Rarefaction and enrichment of ordered scans as separate verbs, from file to file or from scan to scan.
//!
//! Both find the order of the scan as `fit` does, apply the paper's section 4.2 or 4.1, and write the array in a form
//! that `fit` and `--grid` read again.

use super::output::{SCAN_FORMATS, check_all, scan_format, write_points};
use super::sanity::doubtful_unit;
use super::{Options, Output, Source, Target, about, apply_options};
use crate::surfacing::{Prepared, Rarefaction, Tolerance, prepare_filled, to_tolerance};
use nurbskin_fit::chart::grid::OrderedScan;
use nurbskin_fit::rarefy as paper;
use nurbskin_fit::rarefy::Thresholds;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::{Unit, UnitSource, grouped};
use nurbskin_geometry::{Error, PointGrid, Result};
use nurbskin_scan::{GridLayout, Organisation, Scan};
use serde::Serialize;
use std::borrow::Cow;
use std::path::Path;

/// Result of [`rarefy`].
#[derive(Clone, Debug, Serialize)]
pub struct Rarefied {
    /// Version of this JSON: [`SCHEMA`](super::SCHEMA).
    pub schema: u32,
    /// The scan.
    pub input: ScanSummary,
    /// Lines kept along u and v.
    pub kept: [usize; 2],
    /// Points kept.
    pub points: usize,
    /// Points of the scan.
    #[serde(skip)]
    pub points_of_scan: usize,
    /// The rule of the selection.
    pub reason: String,
    /// The file written.
    pub outputs: Vec<Output>,
    /// Warnings: findings that affect the result.
    pub warnings: Vec<String>,
    /// Details: the way in which the order of the scan was found.
    pub details: Vec<String>,
}

/// Result of [`enrich`].
#[derive(Clone, Debug, Serialize)]
pub struct Enriched {
    /// Version of this JSON: [`SCHEMA`](super::SCHEMA).
    pub schema: u32,
    /// The scan.
    pub input: ScanSummary,
    /// Points along u and v after the enrichment.
    pub grid: [usize; 2],
    /// The file written.
    pub outputs: Vec<Output>,
    /// Warnings: findings that affect the result.
    pub warnings: Vec<String>,
    /// Details: the way in which the order of the scan was found.
    pub details: Vec<String>,
}

/// Figures of an ordered scan.
#[derive(Clone, Debug, Serialize)]
pub struct ScanSummary {
    /// Its path.
    pub path: String,
    /// Its format.
    pub format: Cow<'static, str>,
    /// Points in the file.
    pub points: usize,
    /// Points along u and v.
    pub grid: [usize; 2],
    /// Which directions are closed.
    pub topology: nurbskin_fit::chart::Topology,
    /// Unit of its numbers.
    pub unit: Unit,
    /// Source of the unit.
    pub unit_source: UnitSource,
    /// Smallest and largest finite coordinates; `None` without any.
    pub bounding_box: Option<[[f64; 3]; 2]>,
}

struct Ordered {
    scan: Scan,
    prepared: Prepared,
    summary: ScanSummary,
    /// Warnings: findings that affect the result.
    warnings: Vec<String>,
    /// Details of the ordering.
    details: Vec<String>,
}

fn read_ordered(source: &Source, options: &Options, progress: &dyn Progress) -> Result<Ordered> {
    progress.stage("read", None);
    let mut scan = source.read_scan()?;
    apply_options(&mut scan, options)?;
    progress.stage("order", None);
    let masked: Vec<bool> = scan.points.iter().map(|p| !p.is_finite()).collect();
    let prepared = prepare_filled(&scan, &masked, options.surfacing.topology)?;
    let mut warnings = std::mem::take(&mut scan.warnings);
    let details = vec![prepared.ordered.reason.clone()];
    let missing = masked.iter().filter(|m| **m).count();
    if missing > 0 {
        warnings.push(format!(
            "points that are not finite: {}; short gaps inside rows are filled from their rows, others left out",
            grouped(missing)
        ));
    }
    if prepared.ordered.resampled {
        warnings.push(
            "the rows are of different length: the points of the array are resampled along them, and not measured ones"
                .into(),
        );
    }
    let bounding_box = scan.corners();
    let extents = bounding_box.map(|[low, high]| [0, 1, 2].map(|k| high[k] - low[k]));
    if let Some(doubt) = doubtful_unit(scan.unit_source, scan.unit, extents.unwrap_or_default()) {
        warnings.insert(0, doubt.words_with_next());
    }
    let summary = ScanSummary {
        path: source.path().display().to_string(),
        format: scan.format.clone(),
        points: scan.points.len(),
        grid: prepared.ordered.grid.counts(),
        topology: prepared.ordered.topology,
        unit: scan.unit,
        unit_source: scan.unit_source,
        bounding_box,
    };
    Ok(Ordered {
        scan,
        prepared,
        summary,
        warnings,
        details,
    })
}

/// An array as a scan, which `--grid` and the reader of its format accept once it is written.
fn scan_of(grid: PointGrid, like: &Scan) -> Result<Scan> {
    let [m, n] = grid.counts();
    let layout =
        GridLayout::complete(m, n).ok_or_else(|| Error::invalid("the grid is too large"))?;
    Ok(Scan {
        points: grid.into_points(),
        origin: like.origin,
        organisation: Organisation::Grid(layout),
        unit: like.unit,
        unit_source: like.unit_source,
        ..Scan::default()
    })
}

/// The last stage of both verbs.
fn finished(
    target: &Target,
    scan: &Scan,
    progress: &dyn Progress,
) -> Result<(Output, Vec<String>)> {
    progress.stage("write", None);
    progress.check()?;
    write_scan_to(target, scan)
}

/// Writes a scan to a file or into memory, in a format of [`SCAN_FORMATS`](super::SCAN_FORMATS); returns notes on
/// properties that the format cannot store.
///
/// # Errors
/// [`Error::Write`], and [`Error::Invalid`] for another format.
pub fn write_scan_to(target: &Target, scan: &Scan) -> Result<(Output, Vec<String>)> {
    write_points(target, scan_format(&target.format()), scan)
}

/// The paper's logical rarefaction of the ordered scan in `path`; writes the kept points to `output` as an array.
///
/// # Errors
/// As [`fit()`](super::fit()); [`Error::Unsupported`] for a scan without order.
pub fn rarefy(
    path: &Path,
    output: &Path,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Rarefied> {
    let target = Target::File(output.to_owned());
    rarefy_from(&Source::file(path), &target, options, progress)
}

/// As [`rarefy`], from a file or bytes to a file or bytes.
///
/// # Errors
/// As [`rarefy`].
pub fn rarefy_from(
    source: &Source,
    target: &Target,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Rarefied> {
    check_all(&[source], std::slice::from_ref(target), &SCAN_FORMATS)?;
    let (scan, mut done) = rarefied(source, options, progress)?;
    let (written, notes) = finished(target, &scan, progress)?;
    done.outputs.push(written);
    done.warnings.extend(notes);
    Ok(done)
}

/// As [`rarefy_from`], with the kept points as a scan in place of a file.
///
/// # Errors
/// As [`rarefy`], without those of the writer.
pub fn rarefied(
    source: &Source,
    options: &Options,
    progress: &dyn Progress,
) -> Result<(Scan, Rarefied)> {
    rarefied_named(source, options, progress).map_err(|error| about(source.path(), error))
}

fn rarefied_named(
    source: &Source,
    options: &Options,
    progress: &dyn Progress,
) -> Result<(Scan, Rarefied)> {
    let Ordered {
        scan,
        prepared,
        summary,
        warnings,
        details,
    } = read_ordered(source, options, progress)?;
    let OrderedScan { grid, topology, .. } = &prepared.ordered;
    progress.stage("rarefy", None);
    let (kept, reason) = match options.surfacing.rarefy {
        Rarefaction::Auto => {
            let tolerance = Tolerance::choose(
                &options.surfacing,
                scan.unit,
                prepared.noise,
                prepared.diagonal,
            );
            let found = to_tolerance(
                grid,
                *topology,
                &options.surfacing,
                tolerance.value,
                progress,
            )?;
            let reason = format!(
                "the surface through them is within {} of all points (tolerance {}: {})",
                scan.unit.length(found.max_distance),
                scan.unit.length(tolerance.value),
                tolerance.source
            );
            (found.kept, reason)
        }
        Rarefaction::Off => {
            let [m, n] = grid.counts();
            (
                paper::Kept {
                    u: (0..m).collect(),
                    v: (0..n).collect(),
                },
                "all lines, as asked".to_owned(),
            )
        }
        Rarefaction::Threshold([u, v]) => (
            paper::rarefy(grid, *topology, Thresholds { u, v }),
            format!("a normal turns by more than {u} (u) or {v} (v) degrees from line to line"),
        ),
        Rarefaction::Counts(counts) => {
            let (Thresholds { u, v }, kept) = paper::to_counts_filled(grid, *topology, counts)?;
            (
                kept,
                format!("thresholds {u:.2} (u) and {v:.2} (v) degrees"),
            )
        }
    };
    progress.check()?;
    let selected = scan_of(kept.select(grid)?, &scan)?;
    let done = Rarefied {
        schema: super::SCHEMA,
        kept: kept.counts(),
        points: kept.point_count(),
        points_of_scan: summary.points,
        input: summary,
        reason,
        outputs: Vec::new(),
        warnings,
        details,
    };
    Ok((selected, done))
}

/// Catmull-Clark enrichment of the sparse ordered scan in `path`; writes the denser array to `output`.
///
/// # Errors
/// As [`fit()`](super::fit()); [`Error::Unsupported`] for a scan without order.
pub fn enrich(
    path: &Path,
    output: &Path,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Enriched> {
    let target = Target::File(output.to_owned());
    enrich_from(&Source::file(path), &target, options, progress)
}

/// As [`enrich`], from a file or bytes to a file or bytes.
///
/// # Errors
/// As [`enrich`].
pub fn enrich_from(
    source: &Source,
    target: &Target,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Enriched> {
    check_all(&[source], std::slice::from_ref(target), &SCAN_FORMATS)?;
    let (scan, mut done) = enriched(source, options, progress)?;
    let (written, notes) = finished(target, &scan, progress)?;
    done.outputs.push(written);
    done.warnings.extend(notes);
    Ok(done)
}

/// As [`enrich_from`], with the denser array as a scan in place of a file.
///
/// # Errors
/// As [`enrich`], without those of the writer.
pub fn enriched(
    source: &Source,
    options: &Options,
    progress: &dyn Progress,
) -> Result<(Scan, Enriched)> {
    enriched_named(source, options, progress).map_err(|error| about(source.path(), error))
}

fn enriched_named(
    source: &Source,
    options: &Options,
    progress: &dyn Progress,
) -> Result<(Scan, Enriched)> {
    let Ordered {
        scan,
        prepared,
        summary,
        warnings,
        details,
    } = read_ordered(source, options, progress)?;
    progress.stage("enrich", None);
    let grid = nurbskin_fit::enrich::enrich_grid(
        &prepared.ordered.grid,
        prepared.ordered.topology,
        options.surfacing.enrich,
    )?;
    let counts = grid.counts();
    progress.check()?;
    let done = Enriched {
        schema: super::SCHEMA,
        input: summary,
        grid: counts,
        outputs: Vec::new(),
        warnings,
        details,
    };
    Ok((scan_of(grid, &scan)?, done))
}

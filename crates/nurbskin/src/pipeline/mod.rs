//! The pipeline as one call: file, scan, ordered points, surface, deviation, CAD file.
//!
//! Every front end calls [`fit()`], or [`fit_scan`] for a scan in memory, and adds no geometry of its own. The other
//! verbs (`deviation`, `check`, `convert`, `info`, `view`, `rarefy`, `enrich`) are functions of this module, too. Each
//! takes paths, or bytes and objects through [`Source`] and [`Target`], and returns a structure whose serialisation is
//! the JSON of the command.

mod assembled;
mod assess;
mod attempt;
mod check;
mod convert;
mod defects;
mod deviation;
mod info;
mod input;
mod networks;
mod options;
mod outcome;
mod output;
mod page;
mod per_point;
mod reads_back;
mod sanity;
mod source;
mod stored;
mod target;
mod timed;
mod trade;
mod verbs;
mod view;
pub mod words;

pub use crate::deviation::measure::Unused;
pub use crate::report::{Heading, Note};
pub use crate::surfacing::{
    FaceLayout, Length, Method, Rarefaction, Sharp, SurfacingOptions, Trim,
};
pub use check::{Checked, FitCheck, check, check_fitted, check_from};
pub use convert::{
    CONVERT_FORMATS, ConvertOptions, Converted, ConvertedInput, convert, convert_from,
};
pub use deviation::{Compared, DeviationOptions, deviation, deviation_from, write_deviation};
pub use info::{CadContent, Content, Information, ScanContent, SurfaceContent, info, info_from};
pub use options::{InputOptions, Options, OutputOptions};
pub use outcome::{
    Aim, Closed, DeviationSummary, EdgeCounts, FaceEdge, Input, JumpFigures, Outcome, Output,
    PartSummary, RejectedCounts, SCHEMA, SurfaceSummary, Times,
};
pub use output::{
    REPORT_FORMATS, SCAN_FORMATS, SURFACE_FORMATS, check_folders, check_outputs, check_targets,
    default_output, output_of, refuse_existing, write, write_to,
};
pub use page::{
    About, document_of_deviation, document_of_fit, measured, page_of_deviation, page_of_fit,
};
pub use per_point::{PerPoint, WorstPoint};
pub use source::Source;
pub use target::{STREAMED, Target};
pub use verbs::{
    Enriched, Rarefied, ScanSummary, enrich, enrich_from, enriched, rarefied, rarefy, rarefy_from,
    write_scan_to,
};
pub use view::{PAGE_FORMATS, Viewed, view, view_from};

use attempt::Attempt;
use input::{about, apply_options, refuse_pointless};
use nurbskin_geometry::Result;
use nurbskin_geometry::progress::Progress;
use nurbskin_scan::Scan;
use std::path::{Path, PathBuf};
use timed::Timed;

/// Fits a surface to the scan in `path` and writes `outputs`; the format of each follows its extension.
///
/// # Errors
/// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) for an output that is the scan itself, another output, or of
/// an unknown format, before any work; [`Error::Read`](nurbskin_geometry::Error::Read),
/// [`Error::Write`](nurbskin_geometry::Error::Write), [`Error::Unsupported`](nurbskin_geometry::Error::Unsupported) for
/// scans that cannot be charted yet, [`Error::NoSolution`](nurbskin_geometry::Error::NoSolution),
/// [`Error::Cancelled`](nurbskin_geometry::Error::Cancelled). An error leaves no new files; a file replaced before the
/// failing one stays replaced.
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
    let path = source.path();
    output::check_all(&[source], outputs, &SURFACE_FORMATS)?;
    output::check_all(
        &[source],
        &Target::files(&options.output.reports),
        &REPORT_FORMATS,
    )?;
    let progress = &Timed::new(progress);
    progress.stage("read", None);
    let scan = source.read_scan()?;
    let name = path.display().to_string();
    let mut outcome = fitted(scan, &name, options, progress).map_err(|error| about(path, error))?;
    // Reports carry the times up to here.
    outcome.time = progress.times();
    progress.stage("write", None);
    progress.check()?;
    output::write_all(&mut outcome, Some(source), outputs, options, progress)?;
    outcome.time = progress.times();
    Ok(outcome)
}

/// Fits a surface to a scan in memory; `name` is its name in the outcome. Writes nothing.
///
/// # Errors
/// As [`fit()`], without the errors of files.
pub fn fit_scan(
    scan: Scan,
    name: &str,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Outcome> {
    let progress = &Timed::new(progress);
    let mut outcome = fitted(scan, name, options, progress)?;
    outcome.time = progress.times();
    Ok(outcome)
}

/// The pipeline: surfaces, their model, its deviation, and the outcome.
fn fitted(
    mut scan: Scan,
    name: &str,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Outcome> {
    sanity::check_shares(options.surfacing.within, options.min_coverage)?;
    apply_options(&mut scan, options)?;
    if let Some(doubt) = sanity::doubtful_tolerance(&scan, options) {
        progress.warn(&doubt);
    }
    let attempt = Attempt::best(&scan, options, progress)?;
    assembled::outcome(scan, name, attempt, options, progress)
}

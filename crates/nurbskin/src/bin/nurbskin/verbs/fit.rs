//! `fit`: of one scan, or of several.

use super::targets::{check, is_stream, pass_on, refuse_existing, source, targets};
use crate::args::Fit;
use crate::failure::{Failure, Result};
use crate::show::{Batch, Show, Terminal};
use crate::{DONE, NOT_PASSED};
use nurbskin::io::Timestamp;
use nurbskin::pipeline::{
    self, Options, Outcome, OutputOptions, REPORT_FORMATS, SURFACE_FORMATS, Target,
};
use std::path::{Path, PathBuf};

pub(crate) fn fit(fit: &Fit, show: Show) -> Result<u8> {
    let several = fit.scans.len() > 1;
    if several && !fit.output.is_empty() {
        return Err(Failure::usage(
            "several scans need --output-dir DIR instead of -o",
        ));
    }
    if several && fit.report.iter().any(|report| !is_extension(report)) {
        return Err(Failure::usage(
            "each of several scans has a report of its own, named after it: give --report the extension alone, as in \
             `--report .html`",
        ));
    }
    let is_named_after =
        fit.output.is_empty() || fit.report.iter().any(|report| is_extension(report));
    if is_named_after && fit.scans.iter().any(|scan| is_stream(scan)) {
        return Err(Failure::usage(
            "a scan from standard input has no name to make one for the output of: use -o FILE, or `-o -` for standard \
             output, and a name for each report",
        ));
    }
    let of_all = |files: fn(&Path, &Fit) -> Vec<PathBuf>| -> Vec<PathBuf> {
        fit.scans.iter().flat_map(|scan| files(scan, fit)).collect()
    };
    let (all, reports) = (of_all(outputs_of), of_all(reports_of));
    for cad in fit.scans.iter().filter(|scan| scan.is_file()) {
        if nurbskin::io::cad::is_cad_file(cad) {
            return Err(no_scan(cad));
        }
    }
    let to = targets(&all, fit.to.as_deref(), "step")?;
    check(&fit.scans, &to, &SURFACE_FORMATS)?;
    check(&fit.scans, &Target::files(&reports), &REPORT_FORMATS)?;
    let show = show.beside(&to)?;
    if !fit.force {
        // Those that nobody named.
        let mut made = all.clone();
        made.extend(reports.iter().cloned());
        made.retain(|path| !fit.output.contains(path) && !fit.report.contains(path));
        refuse_existing(&made)?;
    }
    if let Some(folder) = &fit.output_dir {
        std::fs::create_dir_all(folder).map_err(|error| {
            Failure::usage(format!(
                "--output-dir {}: the folder cannot be made ({error})",
                folder.display()
            ))
        })?;
    }
    // One time for all files of a run.
    let time = Timestamp::now().map_err(Failure::refused)?;
    let options = Options {
        output: OutputOptions {
            time: Some(time),
            ..fit.options().output
        },
        ..fit.options()
    };
    let from = fit.from.as_deref();
    if let ([scan], false) = (&*fit.scans, several) {
        let options = with_reports(&options, reports);
        let (outcome, told) = fit_one(scan, from, &to, &options, show);
        let outcome = outcome?;
        pass_on(&outcome.outputs)?;
        show.outcome(&outcome, &told)?;
        return Ok(if outcome.verdict.is_good() {
            DONE
        } else {
            NOT_PASSED
        });
    }
    let mut batch = Batch::new(
        show,
        fit.scans.iter().map(PathBuf::as_path),
        fit.tolerance.is_some(),
    )?;
    for scan in &fit.scans {
        let to = Target::files(&outputs_of(scan, fit));
        let options = with_reports(&options, reports_of(scan, fit));
        let (result, told) = fit_one(scan, from, &to, &options, show);
        match result {
            Ok(outcome) => batch.fitted(&outcome, &told)?,
            Err(failure) => {
                batch.failed(scan, &failure)?;
                if failure.is_cancelled() {
                    break;
                }
            }
        }
    }
    batch.finish()
}

/// The outcome, and the warnings that were told meanwhile.
fn fit_one(
    scan: &Path,
    from: Option<&str>,
    to: &[Target],
    options: &Options,
    show: Show,
) -> (Result<Outcome>, Vec<String>) {
    let terminal = Terminal::new(show);
    let result = source(scan, from)
        .and_then(|source| Ok(pipeline::fit_from(&source, to, options, &terminal)?));
    let told = terminal.finish();
    (result, told)
}

/// The options with these reports.
fn with_reports(options: &Options, reports: Vec<PathBuf>) -> Options {
    let mut options = options.clone();
    options.output.reports = reports;
    options
}

/// Whether a report is given by its extension alone, as `.html`: it is named after its scan.
fn is_extension(report: &Path) -> bool {
    let name = report.to_str().and_then(|name| name.strip_prefix('.'));
    name.is_some_and(|format| REPORT_FORMATS.contains(&&*format.to_lowercase()))
}

/// The STEP file that a scan becomes where none is named.
fn default_of(scan: &Path, fit: &Fit) -> PathBuf {
    let beside = pipeline::default_output(scan);
    match &fit.output_dir {
        Some(folder) => folder.join(beside.file_name().unwrap_or_default()),
        None => beside,
    }
}

/// The files that a scan is written to.
fn outputs_of(scan: &Path, fit: &Fit) -> Vec<PathBuf> {
    match fit.output.is_empty() {
        true => vec![default_of(scan, fit)],
        false => fit.output.clone(),
    }
}

/// The reports of a scan.
fn reports_of(scan: &Path, fit: &Fit) -> Vec<PathBuf> {
    let of = |report: &PathBuf| match report.to_str() {
        Some(name) if is_extension(report) => default_of(scan, fit).with_extension(&name[1..]),
        _ => report.clone(),
    };
    fit.report.iter().map(of).collect()
}

/// `fit` of a CAD file.
fn no_scan(cad: &Path) -> Failure {
    let name = cad.display();
    Failure::usage(format!(
        "{name} is a CAD file, not a scan, and there is nothing to fit: use `nurbskin check {name}` to check its \
         quality, `nurbskin deviation SCAN {name}` to compare a scan with it, or `nurbskin convert {name} -o OUT` to \
         convert it"
    ))
}

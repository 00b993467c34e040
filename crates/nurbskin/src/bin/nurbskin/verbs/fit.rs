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
    if several && !(fit.output.is_empty() && fit.report.is_empty()) {
        return Err(Failure::usage(
            "several scans need --output-dir DIR instead of -o and --report",
        ));
    }
    if fit.output.is_empty() && fit.scans.iter().any(|scan| is_stream(scan)) {
        return Err(Failure::usage(
            "a scan from standard input has no name to make one for the output of: use -o FILE, or `-o -` for standard \
             output",
        ));
    }
    let all: Vec<PathBuf> = fit
        .scans
        .iter()
        .flat_map(|scan| outputs_of(scan, fit))
        .collect();
    for cad in fit.scans.iter().filter(|scan| scan.is_file()) {
        if nurbskin::io::cad::is_cad_file(cad) {
            return Err(no_scan(cad));
        }
    }
    let to = targets(&all, fit.to.as_deref(), "step")?;
    check(&fit.scans, &to, &SURFACE_FORMATS)?;
    check(&fit.scans, &Target::files(&fit.report), &REPORT_FORMATS)?;
    let show = show.beside(&to)?;
    if fit.output.is_empty() && !fit.force {
        refuse_existing(&all)?;
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

/// The files that a scan is written to.
fn outputs_of(scan: &Path, fit: &Fit) -> Vec<PathBuf> {
    let beside = pipeline::default_output(scan);
    match &fit.output_dir {
        Some(folder) => vec![folder.join(beside.file_name().unwrap_or_default())],
        None if fit.output.is_empty() => vec![beside],
        None => fit.output.clone(),
    }
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

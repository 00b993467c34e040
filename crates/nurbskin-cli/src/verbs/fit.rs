//! `fit`: of one scan, or of several.

use super::targets::{refuse_existing, surface_beside};
use crate::args::Fit;
use crate::failure::{Failure, Result};
use crate::show::{Batch, Replaced, Show, Terminal};
use crate::{DONE, NOT_PASSED};
use nurbskin::io::cad::is_cad_file;
use nurbskin::pipeline::{self, Options, Outcome};
use std::path::{Path, PathBuf};

pub(crate) fn fit(fit: &Fit, show: Show) -> Result<u8> {
    let several = fit.scans.len() > 1;
    if several && !(fit.output.is_empty() && fit.report.is_empty()) {
        return Err(Failure::usage(
            "several scans need --output-dir DIR instead of -o and --report",
        ));
    }
    if let Some(cad) = fit
        .scans
        .iter()
        .find(|path| path.is_file() && is_cad_file(path))
    {
        return Err(no_scan(cad));
    }
    let all: Vec<PathBuf> = fit
        .scans
        .iter()
        .flat_map(|scan| outputs_of(scan, fit))
        .collect();
    pipeline::check_outputs(&fit.scans, &all, &pipeline::SURFACE_FORMATS)
        .map_err(Failure::refused)?;
    pipeline::check_outputs(&fit.scans, &fit.report, &pipeline::REPORT_FORMATS)
        .map_err(Failure::refused)?;
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
    let replaced = Replaced::among(all.iter().chain(&fit.report));
    let options = fit.options();
    if let ([scan], false) = (&*fit.scans, several) {
        let (outcome, told) = fit_one(scan, &outputs_of(scan, fit), &options, show);
        let outcome = outcome?;
        show.outcome(&outcome, &replaced, &told)?;
        return Ok(if outcome.verdict.is_good() {
            DONE
        } else {
            NOT_PASSED
        });
    }
    let mut batch = Batch::new(show, fit.scans.iter().map(PathBuf::as_path))?;
    for scan in &fit.scans {
        let (result, told) = fit_one(scan, &outputs_of(scan, fit), &options, show);
        match result {
            Ok(outcome) => batch.fitted(&outcome, &replaced, &told)?,
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
    outputs: &[PathBuf],
    options: &Options,
    show: Show,
) -> (Result<Outcome>, Vec<String>) {
    let terminal = Terminal::new(show);
    let result = pipeline::fit(scan, outputs, options, &terminal);
    let told = terminal.finish();
    (result.map_err(Into::into), told)
}

/// The files that a scan is written to.
fn outputs_of(scan: &Path, fit: &Fit) -> Vec<PathBuf> {
    match &fit.output_dir {
        Some(folder) => {
            let name = surface_beside(scan);
            vec![folder.join(name.file_name().unwrap_or_default())]
        }
        None if fit.output.is_empty() => vec![surface_beside(scan)],
        None => fit.output.clone(),
    }
}

/// `fit` of a CAD file.
fn no_scan(cad: &Path) -> Failure {
    let name = cad.display();
    Failure::usage(format!(
        "{name} is a CAD file, and a surface is fitted to a scan; to check its quality use `nurbskin check {name}`, to \
         compare a scan with it `nurbskin deviation SCAN {name}`, to convert it `nurbskin convert {name} -o OUT`"
    ))
}

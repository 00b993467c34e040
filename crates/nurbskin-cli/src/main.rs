//! The `nurbskin` command: a thin front end of the library's pipeline.

mod args;
mod describe;
mod show;

use anyhow::{Context, Result};
use args::{
    Check, Cli, Common, Convert, Deviation, Enrich, Fit, Info, Rarefy, Simulate, Verb, View,
};
use clap::{CommandFactory, Parser};
use nurbskin::io::write_scan;
use nurbskin::pipeline::{self, Outcome};
use nurbskin::progress::Progress;
use nurbskin::scan::simulate::{self, ScanOptions, Shape};
use nurbskin::unit::UnitSource;
use serde_json::json;
use show::{Show, Terminal};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Written and within tolerance.
const PASS: u8 = 0;
/// Nothing was written.
const ERROR: u8 = 1;
/// Wrong usage.
const USAGE: u8 = 2;
/// Written, but the verdict is not `pass`.
const NOT_PASSED: u8 = 3;

fn main() -> ExitCode {
    let cli = Cli::parse();
    let show = Show::new(&cli.common);
    let done = prepare(&cli.common).and_then(|()| run(&cli.verb, &show));
    ExitCode::from(done.unwrap_or_else(|error| {
        show.error(&error);
        if error.is::<Usage>() { USAGE } else { ERROR }
    }))
}

/// A wrong use of the command that only the file system shows: exit status 2.
#[derive(Debug)]
struct Usage(nurbskin::Error);

impl std::fmt::Display for Usage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

impl std::error::Error for Usage {}

/// Threads and Ctrl-C.
fn prepare(common: &Common) -> Result<()> {
    if let Some(threads) = common.threads {
        nurbskin::set_threads(usize::from(threads)).context("cannot start the threads")?;
    }
    ctrlc::set_handler(show::cancel).context("cannot listen for Ctrl-C")
}

fn run(verb: &Verb, show: &Show) -> Result<u8> {
    match verb {
        Verb::Fit(fit) => run_fit(fit, show),
        Verb::Info(info) => run_info(info, show),
        Verb::Rarefy(rarefy) => run_rarefy(rarefy, show),
        Verb::Enrich(enrich) => run_enrich(enrich, show),
        Verb::Deviation(deviation) => run_deviation(deviation, show),
        Verb::Check(check) => run_check(check, show),
        Verb::Convert(convert) => run_convert(convert, show),
        Verb::Simulate(simulate) => run_simulate(simulate, show),
        Verb::View(view) => run_view(view, show),
        Verb::Completions { shell } => {
            let mut text = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "nurbskin", &mut text);
            show::print(&String::from_utf8_lossy(&text))?;
            Ok(PASS)
        }
        Verb::Man { folder } => {
            clap_mangen::generate_to(Cli::command(), folder)
                .with_context(|| format!("cannot write into {}", folder.display()))?;
            Ok(PASS)
        }
    }
}

/// The files that a scan is written to.
fn outputs_of(scan: &Path, fit: &Fit) -> Vec<PathBuf> {
    match &fit.output_dir {
        Some(folder) => vec![
            folder
                .join(scan.file_name().unwrap_or_default())
                .with_extension("step"),
        ],
        None if fit.output.is_empty() => vec![scan.with_extension("step")],
        None => fit.output.clone(),
    }
}

fn run_fit(fit: &Fit, show: &Show) -> Result<u8> {
    let several = fit.scans.len() > 1;
    if several && !(fit.output.is_empty() && fit.report.is_empty()) {
        return Err(usage(
            "several scans need --output-dir DIR instead of -o and --report",
        ));
    }
    let all: Vec<PathBuf> = fit
        .scans
        .iter()
        .flat_map(|scan| outputs_of(scan, fit))
        .collect();
    pipeline::check_outputs(&fit.scans, &all, &pipeline::SURFACE_FORMATS).map_err(refused)?;
    pipeline::check_outputs(&fit.scans, &fit.report, &pipeline::REPORT_FORMATS).map_err(refused)?;
    if let Some(folder) = &fit.output_dir {
        std::fs::create_dir_all(folder).map_err(|e| {
            usage(&format!(
                "--output-dir {}: no such folder can be made ({e})",
                folder.display()
            ))
        })?;
    }
    let options = fit.options();
    let mut results: Vec<(&Path, Result<Outcome>)> = Vec::new();
    for scan in &fit.scans {
        let terminal = Terminal::new(show);
        let result = pipeline::fit(scan, &outputs_of(scan, fit), &options, &terminal);
        terminal.finish();
        if let (true, Err(error)) = (several, &result) {
            show.error(error);
        }
        let cancelled = matches!(result, Err(nurbskin::Error::Cancelled));
        results.push((scan, result.map_err(Into::into)));
        if cancelled {
            break;
        }
    }
    if !several {
        let Some((_, result)) = results.pop() else {
            return Ok(PASS);
        };
        let outcome = result?;
        show.outcome(&outcome)?;
        return Ok(if outcome.verdict.is_good() {
            PASS
        } else {
            NOT_PASSED
        });
    }
    show.table(&results)?;
    let worst = |result: &Result<Outcome>| match result {
        Ok(outcome) if outcome.verdict.is_good() => PASS,
        Ok(_) => NOT_PASSED,
        Err(_) => ERROR,
    };
    let codes: Vec<u8> = results.iter().map(|(_, result)| worst(result)).collect();
    // An error weighs more than a verdict.
    Ok(if codes.contains(&ERROR) {
        ERROR
    } else {
        codes.into_iter().max().unwrap_or(PASS)
    })
}

fn run_info(info: &Info, show: &Show) -> Result<u8> {
    let mut files = Vec::new();
    let mut status = PASS;
    for path in &info.files {
        let terminal = Terminal::new(show);
        let result = pipeline::info(path, &terminal);
        terminal.finish();
        let cancelled = matches!(result, Err(nurbskin::Error::Cancelled));
        match result {
            Ok(found) => {
                show.information(&found)?;
                files.push(serde_json::to_value(found)?);
            }
            Err(error) => {
                status = ERROR;
                show.error(&error);
                files.push(
                    json!({ "path": path.display().to_string(), "error": error.to_string() }),
                );
            }
        }
        if cancelled {
            break;
        }
    }
    show.json(&json!({ "files": files }))?;
    Ok(status)
}

fn run_rarefy(rarefy: &Rarefy, show: &Show) -> Result<u8> {
    check_scan_output(&rarefy.scan, &rarefy.output)?;
    let terminal = Terminal::new(show);
    let done = pipeline::rarefy(
        &rarefy.scan,
        &rarefy.output,
        &rarefy.shaping.options(),
        &terminal,
    );
    terminal.finish();
    let done = done?;
    let [m, n] = done.kept;
    show.done(
        &done,
        &format!(
            "kept {m} x {n} lines, {} of {} points; {}",
            m * n,
            done.points_of_scan,
            done.reason
        ),
    )?;
    Ok(PASS)
}

fn run_enrich(enrich: &Enrich, show: &Show) -> Result<u8> {
    check_scan_output(&enrich.grid_file, &enrich.output)?;
    let mut options = enrich.shaping.options();
    // One level where nothing is said: enriching by nothing is not what was meant.
    options.enrich = usize::from(enrich.shaping.enrich.unwrap_or(1));
    let terminal = Terminal::new(show);
    let done = pipeline::enrich(&enrich.grid_file, &enrich.output, &options, &terminal);
    terminal.finish();
    let done = done?;
    let [m, n] = done.grid;
    show.done(
        &done,
        &format!("enriched to {m} x {n} points; the surface through them meets the original ones"),
    )?;
    Ok(PASS)
}

fn run_deviation(deviation: &Deviation, show: &Show) -> Result<u8> {
    let inputs = [deviation.scan.clone(), deviation.cad.clone()];
    pipeline::check_outputs(&inputs, &deviation.report, &pipeline::REPORT_FORMATS)
        .map_err(refused)?;
    let terminal = Terminal::new(show);
    let options = deviation.options();
    let compared = pipeline::deviation(&deviation.scan, &deviation.cad, &options, &terminal);
    terminal.finish();
    let compared = compared?;
    show.compared(&compared)?;
    Ok(if compared.verdict.is_good() {
        PASS
    } else {
        NOT_PASSED
    })
}

fn run_check(check: &Check, show: &Show) -> Result<u8> {
    let terminal = Terminal::new(show);
    let checked = pipeline::check(&check.cad, &terminal);
    terminal.finish();
    let checked = checked?;
    show.checked(&checked)?;
    Ok(if checked.verdict == "pass" {
        PASS
    } else {
        NOT_PASSED
    })
}

fn run_convert(convert: &Convert, show: &Show) -> Result<u8> {
    pipeline::check_outputs(
        std::slice::from_ref(&convert.input),
        &convert.output,
        &pipeline::CONVERT_FORMATS,
    )
    .map_err(refused)?;
    let terminal = Terminal::new(show);
    let done = pipeline::convert(
        &convert.input,
        &convert.output,
        &convert.options(),
        &terminal,
    );
    terminal.finish();
    let done = done?;
    show.warnings(&done.warnings);
    let written = done
        .outputs
        .iter()
        .map(|output| format!("{} ({} bytes)", output.path.display(), output.bytes));
    let sentence = written.collect::<Vec<_>>().join(", ");
    show.done(&done, &sentence)?;
    Ok(PASS)
}

fn run_simulate(simulate: &Simulate, show: &Show) -> Result<u8> {
    pipeline::check_outputs(
        &[],
        std::slice::from_ref(&simulate.output),
        &pipeline::SCAN_FORMATS,
    )
    .map_err(refused)?;
    let Some(shape) = Shape::from_name(&simulate.shape) else {
        let known: Vec<&str> = Shape::ALL.iter().map(|shape| shape.name()).collect();
        return Err(usage(&format!(
            "no shape is called {}: use one of {}",
            simulate.shape,
            known.join(", ")
        )));
    };
    let options = ScanOptions {
        points: simulate
            .points
            .map(|n| usize::try_from(n).unwrap_or(usize::MAX)),
        noise: simulate.noise,
        outliers: simulate.outliers,
        holes: simulate.holes,
        seed: simulate.seed,
        order: if simulate.shuffled {
            simulate::Order::Shuffled
        } else {
            simulate::Order::Ordered
        },
        opening: simulate.opening,
        ..ScanOptions::default()
    };
    pipeline::check_folders(std::slice::from_ref(&simulate.output))?;
    let terminal = Terminal::new(show);
    terminal.stage("simulate", None);
    let simulated = simulate::scan(shape, &options);
    terminal.stage("write", None);
    terminal.finish();
    terminal.check()?;
    let mut simulated = simulated?;
    // The scanner knows its unit: let the file say it.
    simulated.scan.unit_source = UnitSource::File;
    let warnings = write_scan(&simulate.output, &simulated.scan)?;
    let output = pipeline::output_of(&simulate.output)?;
    let count = simulated.scan.points.len();
    show.done(
        &json!({
            "input": { "shape": shape.name(), "points": count, "organisation": simulated.scan.organisation.name(),
                       "noise": simulate.noise, "outliers": simulated.outliers.len(), "seed": simulate.seed },
            "outputs": [output],
            "warnings": warnings,
        }),
        &format!("{count} points of a {} to {}", shape.name(), simulate.output.display()),
    )?;
    Ok(PASS)
}

fn run_view(view: &View, show: &Show) -> Result<u8> {
    if view.output.is_some() && view.files.len() > 1 {
        return Err(usage("several files are several pages: leave out -o"));
    }
    let output = view.output.as_slice();
    pipeline::check_outputs(&view.files, output, &pipeline::PAGE_FORMATS).map_err(refused)?;
    let command = args::command_line();
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    let mut status = PASS;
    for path in &view.files {
        let terminal = Terminal::new(show);
        let result = pipeline::view(path, view.output.as_deref(), Some(&command), &terminal);
        terminal.finish();
        let cancelled = matches!(result, Err(nurbskin::Error::Cancelled));
        match result {
            Ok(viewed) => {
                show.viewed(&viewed, view.no_open)?;
                inputs.push(serde_json::to_value(viewed.input)?);
                outputs.push(viewed.output);
            }
            Err(error) => {
                status = ERROR;
                show.error(&error);
                inputs.push(
                    json!({ "path": path.display().to_string(), "error": error.to_string() }),
                );
            }
        }
        if cancelled {
            break;
        }
    }
    show.json(&json!({ "inputs": inputs, "outputs": outputs }))?;
    Ok(status)
}

fn check_scan_output(input: &Path, output: &Path) -> Result<()> {
    let (inputs, outputs) = ([input.to_owned()], [output.to_owned()]);
    pipeline::check_outputs(&inputs, &outputs, &pipeline::SCAN_FORMATS).map_err(refused)
}

/// A refusal before any work: what the words on the command line contradict is wrong usage, what is missing on the disk
/// is not.
fn refused(error: nurbskin::Error) -> anyhow::Error {
    match error {
        nurbskin::Error::Invalid(_) => Usage(error).into(),
        other => other.into(),
    }
}

fn usage(what: &str) -> anyhow::Error {
    Usage(nurbskin::Error::Invalid(what.to_owned())).into()
}

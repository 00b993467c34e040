//! `rarefy`, `enrich` and `simulate`: verbs that write scans.

use super::targets::{self, pass_on, source};
use crate::DONE;
use crate::args::{Enrich, Rarefy, Simulate};
use crate::failure::{Failure, Result};
use crate::show::{Show, Terminal, sized};
use nurbskin::pipeline::{self, SCAN_FORMATS, ScanSummary, Target};
use nurbskin::progress::Progress;
use nurbskin::scan::simulate::{self, Order, ScanOptions, Shape};
use nurbskin::unit::{UnitSource, counted, grouped};
use serde_json::json;
use std::path::PathBuf;

/// Where a verb writes the scan that it makes.
fn scan_target(inputs: &[PathBuf], output: &PathBuf, to: Option<&str>) -> Result<Target> {
    let mut to = targets::targets(std::slice::from_ref(output), to, "ply")?;
    targets::check(inputs, &to, &SCAN_FORMATS)?;
    to.pop()
        .ok_or_else(|| Failure::usage("name an output with -o"))
}

/// An ordered scan that was read: its points, its order and its size.
fn scanned(scan: &ScanSummary) -> String {
    let [m, n] = scan.grid;
    format!(
        "{}: {}, {m} x {n} lines{}",
        scan.path,
        counted(scan.points, "point", "points"),
        sized(scan.bounding_box, scan.unit, scan.unit_source)
    )
}

pub(crate) fn rarefy(rarefy: &Rarefy, show: Show) -> Result<u8> {
    let to = scan_target(
        std::slice::from_ref(&rarefy.scan),
        &rarefy.output,
        rarefy.to.as_deref(),
    )?;
    let show = show.beside(std::slice::from_ref(&to))?;
    let scan = source(&rarefy.scan, rarefy.from.as_deref())?;
    let terminal = Terminal::new(show);
    let done = pipeline::rarefy_from(&scan, &to, &rarefy.options(), &terminal);
    let told = terminal.finish();
    let done = done?;
    pass_on(&done.outputs)?;
    show.warnings(&done.warnings, &told);
    show.details(&done.details);
    let [m, n] = done.kept;
    let kept = format!(
        "{m} x {n} lines, {} of {}",
        grouped(m * n),
        counted(done.points_of_scan, "point", "points")
    );
    let rows = [
        ("scan", scanned(&done.input)),
        ("kept", kept),
        ("rule", done.reason.clone()),
    ];
    show.done(&done, &rows, &done.outputs)?;
    Ok(DONE)
}

pub(crate) fn enrich(enrich: &Enrich, show: Show) -> Result<u8> {
    let to = scan_target(
        std::slice::from_ref(&enrich.scan),
        &enrich.output,
        enrich.to.as_deref(),
    )?;
    let show = show.beside(std::slice::from_ref(&to))?;
    let scan = source(&enrich.scan, enrich.from.as_deref())?;
    let terminal = Terminal::new(show);
    let done = pipeline::enrich_from(&scan, &to, &enrich.options(), &terminal);
    let told = terminal.finish();
    let done = done?;
    pass_on(&done.outputs)?;
    show.warnings(&done.warnings, &told);
    show.details(&done.details);
    let [m, n] = done.grid;
    let grid = format!(
        "{m} x {n} = {}; the surface through them meets the original ones",
        counted(m * n, "point", "points")
    );
    let rows = [("scan", scanned(&done.input)), ("grid", grid)];
    show.done(&done, &rows, &done.outputs)?;
    Ok(DONE)
}

pub(crate) fn simulate(simulate: &Simulate, show: Show) -> Result<u8> {
    let to = scan_target(&[], &simulate.output, simulate.to.as_deref())?;
    let show = show.beside(std::slice::from_ref(&to))?;
    let Some(shape) = Shape::from_name(&simulate.shape) else {
        let known: Vec<&str> = Shape::ALL.iter().map(|shape| shape.name()).collect();
        return Err(Failure::usage(format!(
            "unknown shape {}: use one of {}",
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
            Order::Shuffled
        } else {
            Order::Ordered
        },
        opening: simulate.opening,
        ..ScanOptions::default()
    };
    if let Some(file) = to.as_file() {
        pipeline::check_folders(std::slice::from_ref(&file.to_path_buf()))?;
    }
    let terminal = Terminal::new(show);
    terminal.stage("simulate", None);
    let simulated = simulate::scan(shape, &options);
    terminal.stage("write", None);
    terminal.finish();
    terminal.check()?;
    let mut simulated = simulated?;
    // The scanner knows its unit: let the file say it.
    simulated.scan.unit_source = UnitSource::File;
    let (output, warnings) = pipeline::write_scan_to(&to, &simulated.scan)?;
    let output = [output];
    pass_on(&output)?;
    show.warnings(&warnings, &[]);
    let points = simulated.scan.points.len();
    let made = json!({
        "input": { "shape": shape.name(), "points": points, "organisation": simulated.scan.organisation.name(),
                   "noise": simulate.noise, "outliers": simulated.outliers.len(), "seed": simulate.seed },
        "outputs": output,
        "warnings": warnings,
    });
    let scan = format!(
        "{} of a {}, {}{}",
        counted(points, "point", "points"),
        shape.name(),
        match simulated.scan.organisation.name() {
            "grid" => "in a grid",
            "rows" => "in rows",
            other => other,
        },
        sized(
            simulated.scan.corners(),
            simulated.scan.unit,
            simulated.scan.unit_source
        )
    );
    show.done(&made, &[("scan", scan)], &output)?;
    Ok(DONE)
}

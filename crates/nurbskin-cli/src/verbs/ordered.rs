//! `rarefy`, `enrich` and `simulate`: verbs that write scans.

use super::targets::check_scan_output;
use crate::DONE;
use crate::args::{Enrich, Rarefy, Simulate};
use crate::failure::{Failure, Result};
use crate::show::text::{count, counted};
use crate::show::{Replaced, Show, Terminal};
use nurbskin::io::write_scan;
use nurbskin::pipeline;
use nurbskin::progress::Progress;
use nurbskin::scan::simulate::{self, Order, ScanOptions, Shape};
use nurbskin::unit::UnitSource;
use serde_json::json;

pub(crate) fn rarefy(rarefy: &Rarefy, show: Show) -> Result<u8> {
    check_scan_output(&rarefy.scan, &rarefy.output)?;
    let replaced = Replaced::among([&rarefy.output]);
    let terminal = Terminal::new(show);
    let done = pipeline::rarefy(&rarefy.scan, &rarefy.output, &rarefy.options(), &terminal);
    let told = terminal.finish();
    let done = done?;
    show.warnings(&done.warnings, &told);
    let [m, n] = done.kept;
    let kept = format!(
        "{m} x {n} lines, {} of {}",
        count(m * n),
        counted(done.points_of_scan, "point", "points")
    );
    let rows = [("kept", kept), ("rule", done.reason.clone())];
    show.done(&done, &rows, &done.outputs, &replaced)?;
    Ok(DONE)
}

pub(crate) fn enrich(enrich: &Enrich, show: Show) -> Result<u8> {
    check_scan_output(&enrich.scan, &enrich.output)?;
    let replaced = Replaced::among([&enrich.output]);
    let terminal = Terminal::new(show);
    let done = pipeline::enrich(&enrich.scan, &enrich.output, &enrich.options(), &terminal);
    let told = terminal.finish();
    let done = done?;
    show.warnings(&done.warnings, &told);
    let [m, n] = done.grid;
    let grid = format!(
        "{m} x {n} = {}; the surface through them meets the original ones",
        counted(m * n, "point", "points")
    );
    show.done(&done, &[("grid", grid)], &done.outputs, &replaced)?;
    Ok(DONE)
}

pub(crate) fn simulate(simulate: &Simulate, show: Show) -> Result<u8> {
    let outputs = std::slice::from_ref(&simulate.output);
    pipeline::check_outputs(&[], outputs, &pipeline::SCAN_FORMATS).map_err(Failure::refused)?;
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
    pipeline::check_folders(outputs)?;
    let replaced = Replaced::among(outputs);
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
    let output = [pipeline::output_of(&simulate.output)?];
    show.warnings(&warnings, &[]);
    let points = simulated.scan.points.len();
    let made = json!({
        "input": { "shape": shape.name(), "points": points, "organisation": simulated.scan.organisation.name(),
                   "noise": simulate.noise, "outliers": simulated.outliers.len(), "seed": simulate.seed },
        "outputs": output,
        "warnings": warnings,
    });
    let scan = format!(
        "{} of a {}, {}",
        counted(points, "point", "points"),
        shape.name(),
        simulated.scan.organisation.name()
    );
    show.done(&made, &[("scan", scan)], &output, &replaced)?;
    Ok(DONE)
}

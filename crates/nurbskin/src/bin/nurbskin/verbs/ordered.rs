//! `rarefy`, `enrich` and `simulate`: verbs that write scans.

use super::targets::{self, pass_on, source};
use crate::DONE;
use crate::args::{Enrich, Rarefy, Simulate};
use crate::failure::{Failure, Result};
use crate::show::{Show, Terminal, sized};
use nurbskin::pipeline::{self, SCAN_FORMATS, ScanSummary, Target};
use nurbskin::progress::Progress;
use nurbskin::scan::Scan;
use nurbskin::scan::simulate::{self, Body, BodyOptions, Layout, Order, ScanOptions, Shape};
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
    let object = Object::named(simulate)?;
    if let Some(file) = to.as_file() {
        pipeline::check_folders(std::slice::from_ref(&file.to_path_buf()))?;
    }
    let terminal = Terminal::new(show);
    terminal.stage("simulate", None);
    let simulated = object.scan(simulate);
    terminal.stage("write", None);
    terminal.finish();
    terminal.check()?;
    let (mut scan, outliers) = simulated?;
    // The scanner knows its unit: let the file say it.
    scan.unit_source = UnitSource::File;
    let (output, warnings) = pipeline::write_scan_to(&to, &scan)?;
    let output = [output];
    pass_on(&output)?;
    show.warnings(&warnings, &[]);
    let points = scan.points.len();
    let made = json!({
        "input": { "shape": object.name(), "points": points, "organisation": scan.organisation.name(),
                   "noise": simulate.noise, "outliers": outliers, "seed": simulate.seed },
        "outputs": output,
        "warnings": warnings,
    });
    let line = format!(
        "{} of a {}, {}{}",
        counted(points, "point", "points"),
        object.name(),
        match scan.organisation.name() {
            "grid" => "in a grid",
            "rows" => "in rows",
            "mesh" => "a mesh",
            other => other,
        },
        sized(scan.corners(), scan.unit, scan.unit_source)
    );
    show.done(&made, &[("scan", line)], &output)?;
    Ok(DONE)
}

/// What the virtual scanner scans.
enum Object {
    Shape(Shape),
    Body(Body),
}

impl Object {
    fn named(simulate: &Simulate) -> Result<Self> {
        let name = &simulate.shape;
        if let Some(body) = Body::from_name(name) {
            let refused = [
                (simulate.ordered, "--ordered"),
                (simulate.opening, "--opening"),
            ];
            if let Some((_, option)) = refused.iter().find(|(given, _)| *given) {
                return Err(Failure::usage(format!(
                    "{option} does not apply to a {}: its scans are clouds in random order, or meshes",
                    body.name()
                )));
            }
            return Ok(Self::Body(body));
        }
        let bodies = Body::ALL.map(Body::name);
        let Some(shape) = Shape::from_name(name) else {
            let shapes = Shape::ALL.map(Shape::name);
            return Err(Failure::usage(format!(
                "unknown shape {name}: use one of {}",
                [&shapes[..], &bodies[..]].concat().join(", ")
            )));
        };
        if simulate.mesh {
            return Err(Failure::usage(format!(
                "--mesh does not apply to a {}: use one of {}",
                shape.name(),
                bodies.join(", ")
            )));
        }
        Ok(Self::Shape(shape))
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Shape(shape) => shape.name(),
            Self::Body(body) => body.name(),
        }
    }

    /// The scan and its number of outliers.
    fn scan(&self, simulate: &Simulate) -> nurbskin::Result<(Scan, usize)> {
        let points = simulate
            .points
            .map(|n| usize::try_from(n).unwrap_or(usize::MAX));
        let Simulate {
            noise,
            outliers,
            holes,
            seed,
            opening,
            ..
        } = *simulate;
        match *self {
            Self::Shape(shape) => {
                let order = if simulate.shuffled {
                    Order::Shuffled
                } else {
                    Order::Ordered
                };
                let options = ScanOptions {
                    points,
                    noise,
                    outliers,
                    holes,
                    seed,
                    order,
                    opening,
                    ..ScanOptions::default()
                };
                let made = simulate::scan(shape, &options)?;
                Ok((made.scan, made.outliers.len()))
            }
            Self::Body(body) => {
                let layout = match (simulate.mesh, simulate.unaligned) {
                    (false, _) => Layout::Cloud,
                    (true, false) => Layout::Mesh,
                    (true, true) => Layout::Unaligned,
                };
                let options = BodyOptions {
                    points,
                    layout,
                    noise,
                    outliers,
                    holes,
                    seed,
                };
                let made = simulate::scan_body(body, &options)?;
                Ok((made.scan, made.outliers.len()))
            }
        }
    }
}

//! Reads STEP files with step-io, which has nothing in common with our reader and writer, and with ours, and compares
//! what both found: unit, solids, faces, bounds, edges, and every number of the surfaces.
//!
//! ```sh
//! cargo run --manifest-path compare/step-io/Cargo.toml -- FILE.step...
//! ```

use nurbskin_geometry::NurbsSurface;
use nurbskin_cad::{Face, Model, ShellKind};
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let mut failed = false;
    for path in std::env::args().skip(1) {
        let said = match compare(Path::new(&path)) {
            Ok(faces) => format!("the same {faces} faces"),
            Err(why) => {
                failed = true;
                format!("DIFFERS: {why}")
            }
        };
        println!("{path}: {said}");
    }
    if failed {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    }
}

fn compare(path: &Path) -> Result<usize, String> {
    let bytes = std::fs::read(path).map_err(|e| e.to_string())?;
    let ours = nurbskin_cad::io::step::read(&bytes, path)
        .map_err(|e| e.to_string())?
        .model;
    let (theirs, report) = step_io::read(bytes.as_slice()).map_err(|e| e.to_string())?;
    same("instances dropped", &report.dropped.len(), &0)?;
    same("warnings", &report.parse_warnings.len(), &0)?;
    let scene = theirs.scene();
    let metres = scene.units().length.map_or(0.0, |length| length.to_si);
    let unit = ours.unit.millimetres() / 1000.0;
    if (metres - unit).abs() > 1e-12 * unit {
        return Err(format!("a unit of {metres} m, and {unit} m"));
    }
    let solids = ours.shells().iter().filter(|s| s.kind == ShellKind::Solid);
    same("solids", &scene.all_solids().count(), &solids.count())?;
    same("faces", &scene.all_faces().count(), &ours.faces().len())?;
    for (found, face) in scene.all_faces().zip(ours.faces()) {
        same("names", &found.name(), &face.name.as_str())?;
        same("bounds", &found.bounds().count(), &face.loops.len())?;
        let edges: usize = found.bounds().map(|bound| bound.edges().count()).sum();
        same("edges", &edges, &real_edges(&ours, face))?;
        let surface = found.to_nurbs().ok_or("a surface that is no NURBS")?;
        let mut numbers = surface.knots_u;
        numbers.extend(surface.knots_v);
        let weights = surface.weights.iter().flatten();
        for (w, p) in weights.zip(surface.control_points.iter().flatten()) {
            numbers.push(*w);
            numbers.extend(p);
        }
        let ours = all_numbers(&face.surface);
        let mut pairs = numbers.iter().zip(&ours);
        if let Some((theirs, ours)) = pairs.find(|(theirs, ours)| theirs != ours) {
            return Err(format!("a surface with {theirs:e}, and ours with {ours:e}"));
        }
        same("numbers of a surface", &numbers.len(), &ours.len())?;
    }
    Ok(ours.faces().len())
}

fn same<T: PartialEq + std::fmt::Debug>(what: &str, theirs: &T, ours: &T) -> Result<(), String> {
    if theirs == ours {
        return Ok(());
    }
    Err(format!("{what}: {theirs:?}, and ours {ours:?}"))
}

/// Edges of a face without the degenerate ones, which STEP does not have.
fn real_edges(model: &Model, face: &Face) -> usize {
    let used = face.loops.iter().flat_map(|each| &each.uses);
    used.filter(|used| model.edges()[used.edge].curve.is_some())
        .count()
}

/// Knots along u and v, then w, x, y, z of all control points, u by u.
fn all_numbers(surface: &NurbsSurface) -> Vec<f64> {
    let [m, n] = surface.control_points().counts();
    let knots = [surface.knots_u(), surface.knots_v()];
    let mut all: Vec<f64> = knots.iter().flat_map(|k| k.knots()).copied().collect();
    for (i, j) in (0..m).flat_map(|i| (0..n).map(move |j| (i, j))) {
        all.push(surface.weights().map_or(1.0, |w| w[j * m + i]));
        all.extend(surface.control_points().point(i, j).to_array());
    }
    all
}

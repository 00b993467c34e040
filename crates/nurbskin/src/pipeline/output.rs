//! What is written: CAD files, meshes, reports. Each whole or not at all.

use super::check::check_outputs_of;
use super::page::page_of_fit;
use super::{Options, Outcome, Output, PerPoint};
use crate::cad::Model;
use crate::cad::tessellate::tessellate;
use crate::io::atomic::write_whole;
use crate::io::cad::{CadFormat, CadWriteOptions, write_cad};
use crate::io::glb::{GlbMesh, write as write_glb};
use crate::io::iges::Layout;
use crate::io::write_scan;
use crate::progress::Progress;
use crate::scan::{Organisation, Scan};
use crate::unit::UnitSource;
use crate::{DVec3, Error, Result};
use serde::Serialize;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Chordal tolerance of meshes, as a share of the fit's tolerance.
const CHORD_OF_TOLERANCE: f64 = 0.1;

/// Where there is none, as a share of the diagonal.
pub(super) const CHORD_OF_DIAGONAL: f64 = 1e-4;
/// A mesh of more triangles helps nobody.
const MOST_TRIANGLES: usize = 20_000_000;

/// The lower-case extension of a path.
pub(super) fn extension(path: &Path) -> String {
    path.extension()
        .map(|e| e.to_string_lossy().to_lowercase())
        .unwrap_or_default()
}

/// Refuses outputs that cannot be written, before any work: one that is also an input or another output, a folder, a
/// device, or of an extension not in `formats`.
///
/// # Errors
/// [`Error::Invalid`] that names the output; [`Error::Read`] for an input that is a folder.
pub fn check_outputs(inputs: &[PathBuf], outputs: &[PathBuf], formats: &[&str]) -> Result<()> {
    let same = |a: &Path, b: &Path| resolved(a) == resolved(b);
    for (k, output) in outputs.iter().enumerate() {
        let name = output.display();
        if let Some(input) = inputs.iter().find(|input| same(input, output)) {
            if input.is_dir() {
                return Err(Error::read(input, "", "this is a directory; name a file"));
            }
            return Err(Error::invalid(format!(
                "{name} is also an input ({}): name another output",
                input.display()
            )));
        }
        if outputs[..k].iter().any(|earlier| same(earlier, output)) {
            return Err(Error::invalid(format!(
                "{name} is named twice as an output"
            )));
        }
        match fs::metadata(output) {
            Ok(meta) if meta.is_dir() => {
                return Err(Error::invalid(format!(
                    "{name} is a directory: name a file in it"
                )));
            }
            Ok(meta) if !meta.is_file() => {
                return Err(Error::invalid(format!("{name} is a device: name a file")));
            }
            _ => {}
        }
        let extension = extension(output);
        if !formats.contains(&extension.as_str()) {
            let known = formats
                .iter()
                .map(|f| format!(".{f}"))
                .collect::<Vec<_>>()
                .join(", ");
            let what = match extension.as_str() {
                "html" | "htm" => "a page of HTML is a report: say --report".to_owned(),
                "" => "the format follows the extension, and there is none".to_owned(),
                other => format!("nothing is known of the extension .{other}"),
            };
            return Err(Error::invalid(format!(
                "{name}: {what}; use one of {known}"
            )));
        }
    }
    Ok(())
}

/// The file that a path leads to, through links and whichever way it is written; one that is not there yet is taken in
/// its folder, and named as it is where that is missing, too.
fn resolved(path: &Path) -> PathBuf {
    let missing = || {
        let folder = match path.parent()? {
            folder if folder.as_os_str().is_empty() => Path::new("."),
            folder => folder,
        };
        Some(folder.canonicalize().ok()?.join(path.file_name()?))
    };
    path.canonicalize()
        .ok()
        .or_else(missing)
        .unwrap_or_else(|| path.to_owned())
}

/// Refuses outputs whose folder does not exist, before any work.
///
/// # Errors
/// [`Error::Write`] that names the output.
pub fn check_folders(outputs: &[PathBuf]) -> Result<()> {
    for output in outputs {
        let folder = output.parent().filter(|f| !f.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|f| !f.is_dir()) {
            let what = format!(
                "the folder {} does not exist; make it first",
                folder.display()
            );
            return Err(Error::write(output, what));
        }
    }
    Ok(())
}

/// Extensions that [`fit`](super::fit()) writes.
pub const SURFACE_FORMATS: [&str; 8] = ["step", "stp", "igs", "iges", "stl", "obj", "ply", "glb"];
/// Extensions of reports.
pub const REPORT_FORMATS: [&str; 4] = ["html", "htm", "json", "csv"];
/// Extensions of scans.
pub const SCAN_FORMATS: [&str; 5] = ["ply", "xyz", "txt", "asc", "csv"];

/// Writes the surface to `outputs` and the reports of the options, each in the format of its extension, and notes them in
/// the outcome. If one cannot be written, those written before it are removed, unless they took the place of a file that
/// was there. A page shows the file `input` that was fitted, if there is one.
///
/// # Errors
/// [`Error::Invalid`] as [`check_outputs`]; [`Error::Write`]; [`Error::Read`] if the input is gone;
/// [`Error::Cancelled`].
pub fn write(
    outcome: &mut Outcome,
    input: Option<&Path>,
    outputs: &[PathBuf],
    options: &Options,
    progress: &dyn Progress,
) -> Result<()> {
    let inputs: Vec<PathBuf> = input.map(Path::to_owned).into_iter().collect();
    check_outputs(&inputs, outputs, &SURFACE_FORMATS)?;
    check_outputs(&inputs, &options.reports, &REPORT_FORMATS)?;
    check_folders(outputs)?;
    check_folders(&options.reports)?;
    write_all(outcome, input, outputs, options, progress)
}

/// [`write`] of outputs that are checked already.
pub(super) fn write_all(
    outcome: &mut Outcome,
    input: Option<&Path>,
    outputs: &[PathBuf],
    options: &Options,
    progress: &dyn Progress,
) -> Result<()> {
    let all = outputs.iter().chain(&options.reports);
    let old: Vec<&PathBuf> = all.filter(|path| path.exists()).collect();
    let done = write_each(outcome, outputs, options, progress)
        .and_then(|()| write_reports(outcome, input, options, progress))
        .and_then(|()| progress.check());
    if done.is_err() {
        for written in outcome.outputs.drain(..) {
            if !old.contains(&&written.path) {
                // What went wrong first is what is told.
                let _ = fs::remove_file(&written.path);
            }
        }
    }
    done
}

fn write_each(
    outcome: &mut Outcome,
    outputs: &[PathBuf],
    options: &Options,
    progress: &dyn Progress,
) -> Result<()> {
    for path in outputs {
        progress.check()?;
        let format = if let Some(format) = CadFormat::from_extension(&extension(path)) {
            write_model(outcome, path, options)?;
            format.name()
        } else {
            let output = MeshOutput {
                model: &outcome.model,
                chord: CHORD_OF_TOLERANCE * outcome.aim.value,
                origin: outcome.origin,
                unit_source: outcome.input.unit_source,
            };
            let mut warnings = Vec::new();
            let format = write_mesh(path, &output, &mut warnings)?;
            outcome.warnings.append(&mut warnings);
            format
        };
        note(outcome, path, format)?;
    }
    check_outputs_of(outcome, options.iges_layout == Layout::Exact)
}

/// A CSV report does not show the outputs; the others do, themselves not counted.
fn write_reports(
    outcome: &mut Outcome,
    input: Option<&Path>,
    options: &Options,
    progress: &dyn Progress,
) -> Result<()> {
    for path in &options.reports {
        let format = match extension(path).as_str() {
            "csv" => {
                write_csv(path, &outcome.per_point, outcome.origin, progress)?;
                "csv"
            }
            "html" | "htm" => {
                let command = options.command.as_deref();
                let page = page_of_fit(outcome, input, command, progress)?;
                write_page(path, &page, progress)?;
                "html"
            }
            _ => {
                write_json(path, outcome, progress)?;
                "json"
            }
        };
        note(outcome, path, format)?;
    }
    Ok(())
}

/// Writes a report whole, or not at all where the caller has asked to stop meanwhile.
fn write_report(
    path: &Path,
    progress: &dyn Progress,
    fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<()> {
    write_whole(path, |out| {
        fill(out).map_err(|e| Error::write(path, e.to_string()))?;
        progress.check()
    })
}

/// Writes every point with its deviation.
pub(super) fn write_csv(
    path: &Path,
    points: &PerPoint,
    origin: DVec3,
    progress: &dyn Progress,
) -> Result<()> {
    write_report(path, progress, |out| points.write_csv(origin, out))
}

/// Writes a page of HTML.
pub(super) fn write_page(path: &Path, page: &str, progress: &dyn Progress) -> Result<()> {
    write_report(path, progress, |out| out.write_all(page.as_bytes()))
}

/// Writes what `--json` prints.
pub(super) fn write_json(
    path: &Path,
    outcome: &impl Serialize,
    progress: &dyn Progress,
) -> Result<()> {
    let text =
        serde_json::to_string_pretty(outcome).map_err(|e| Error::write(path, e.to_string()))?;
    write_report(path, progress, |out| writeln!(out, "{text}"))
}

/// Adds a file to the outputs.
fn note(outcome: &mut Outcome, path: &Path, format: &'static str) -> Result<()> {
    outcome.outputs.push(described(path, format)?);
    Ok(())
}

pub(super) fn described(path: &Path, format: &'static str) -> Result<Output> {
    let bytes = fs::metadata(path)
        .map_err(|e| Error::write(path, e.to_string()))?
        .len();
    Ok(Output {
        path: path.to_owned(),
        format: format.into(),
        bytes,
    })
}

/// The scan file at `path` as an output.
///
/// # Errors
/// [`Error::Write`] if it is not there.
pub fn output_of(path: &Path) -> Result<Output> {
    let extension = extension(path);
    described(
        path,
        SCAN_FORMATS
            .into_iter()
            .find(|format| *format == extension)
            .unwrap_or("xyz"),
    )
}

fn write_model(outcome: &Outcome, path: &Path, options: &Options) -> Result<()> {
    let name = |part: Option<&std::ffi::OsStr>| {
        part.map(|n| n.to_string_lossy().into_owned())
            .unwrap_or_default()
    };
    let settings = CadWriteOptions {
        schema: options.step_schema,
        layout: options.iges_layout,
        product: name(path.file_stem()),
        file_name: name(path.file_name()),
        origin: outcome.origin,
        points: if options.with_points {
            &outcome.per_point.points
        } else {
            &[]
        },
        uncertainty: None,
    };
    write_cad(path, &outcome.model, &settings)
}

/// A model that is written as a mesh.
pub(super) struct MeshOutput<'a> {
    pub(super) model: &'a Model,
    /// Chordal tolerance.
    pub(super) chord: f64,
    /// Added to every point.
    pub(super) origin: DVec3,
    pub(super) unit_source: UnitSource,
}

/// Leaves out triangles of which two corners are one in the 32 bits that STL has: its neighbours meet there, so that the
/// mesh stays as closed as it is.
fn leave_out_flat(triangles: &mut Vec<[u32; 3]>, points: &[DVec3], origin: DVec3) {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounding is what the format demands"
    )]
    let rounded = |k: u32| (points[k as usize] + origin).to_array().map(|c| c as f32);
    triangles.retain(|&t| {
        let [a, b, c] = t.map(rounded);
        #[expect(clippy::float_cmp, reason = "identical corners, to the last bit")]
        let apart = a != b && b != c && c != a;
        apart
    });
}

/// Writes the triangles of a model; the format follows the extension, and is told.
pub(super) fn write_mesh(
    path: &Path,
    output: &MeshOutput<'_>,
    warnings: &mut Vec<String>,
) -> Result<&'static str> {
    let model = output.model;
    let mesh = tessellate(model, output.chord, MOST_TRIANGLES)?;
    for (face, why) in &mesh.left_out {
        warnings.push(format!("face {} is left out of the mesh: {why}", face + 1));
    }
    let extension = extension(path);
    if extension == "glb" {
        // A vertex for each normal: creases stay sharp.
        let mut points = vec![DVec3::ZERO; mesh.normals.len()];
        for (triangle, corners) in mesh.triangles.iter().zip(&mesh.corners) {
            for (&k, &corner) in triangle.iter().zip(corners) {
                points[corner as usize] = mesh.points[k as usize];
            }
        }
        let glb = GlbMesh {
            points: &points,
            normals: &mesh.normals,
            triangles: &mesh.corners,
            unit: model.unit,
            origin: output.origin,
            name: &model.name,
            colour: model.colour,
        };
        write_whole(path, |out| write_glb(out, &glb))?;
        return Ok("glb");
    }
    let mut triangles = mesh.triangles;
    if extension == "stl" {
        leave_out_flat(&mut triangles, &mesh.points, output.origin);
    }
    let scan = Scan {
        points: mesh.points,
        origin: output.origin,
        organisation: Organisation::Mesh(triangles),
        unit: model.unit,
        unit_source: output.unit_source,
        ..Scan::default()
    };
    warnings.extend(write_scan(path, &scan)?);
    Ok(match extension.as_str() {
        "stl" => "stl",
        "obj" => "obj",
        _ => "ply",
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::{Silent, Stopped};

    #[test]
    fn a_report_is_not_written_after_a_stop() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("page.html");
        write_page(&path, "before", &Silent).unwrap();
        let stopped = write_page(&path, "after", &Stopped);
        assert!(matches!(stopped, Err(Error::Cancelled)));
        assert_eq!(fs::read_to_string(&path).unwrap(), "before");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn triangles_whose_corners_are_one_in_32_bits_are_left_out() {
        let points = [
            DVec3::ZERO,
            DVec3::X,
            DVec3::new(1.0 + 1e-9, 0.0, 0.0),
            DVec3::Y,
        ];
        let mut triangles = vec![[0, 1, 2], [0, 2, 3], [0, 3, 1]];
        leave_out_flat(&mut triangles, &points, DVec3::ZERO);
        assert_eq!(triangles, [[0, 2, 3], [0, 3, 1]]);
        // So far away, all of them are.
        leave_out_flat(&mut triangles, &points, DVec3::splat(1e9));
        assert!(triangles.is_empty());
    }
}

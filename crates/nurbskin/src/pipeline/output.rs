//! Writers of outputs: CAD files, meshes, scans and reports.
//!
//! All outputs are checked before any work: no output may be an input, another output or an unknown format. Each file
//! is written completely or not at all. If one of several fails, the new files of the run are removed.

use super::check::check_outputs_of;
use super::page::{About, page_of_source};
use super::source::not_a_scan;
use super::{Options, Outcome, Output, PerPoint, Source, Target};
use nurbskin_cad::Model;
use nurbskin_cad::io::Timestamp;
use nurbskin_cad::io::file::{CadFormat, CadWriteOptions, cad_text, is_cad_file};
use nurbskin_cad::io::glb::{GlbMesh, write as write_glb};
use nurbskin_cad::io::iges::Layout;
use nurbskin_cad::tessellate::tessellate;
use nurbskin_geometry::files::atomic::write_whole;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::UnitSource;
use nurbskin_geometry::{DVec3, Error, Result};
use nurbskin_scan::io::write_scan_to;
use nurbskin_scan::{Organisation, Scan};
use serde::Serialize;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Chordal tolerance of meshes, as a share of the fit's tolerance.
const CHORD_OF_TOLERANCE: f64 = 0.1;

/// Chordal tolerance of meshes without a tolerance of the fit, as a share of the diagonal.
pub(super) const CHORD_OF_DIAGONAL: f64 = 1e-4;
/// Largest number of triangles of a mesh; a larger mesh is impractical.
const MOST_TRIANGLES: usize = 20_000_000;

/// The lower-case extension of a path.
pub(super) fn extension(path: &Path) -> String {
    path.extension()
        .map(|e| e.to_string_lossy().to_lowercase())
        .unwrap_or_default()
}

/// Refuses outputs that cannot be written, before any work: an output that is also an input or another output, a
/// folder, a device, or has an extension outside `formats`.
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
            // The default output of a fit is the CAD file that was mistaken for a scan.
            if formats == SURFACE_FORMATS && is_cad_file(input) {
                return Err(not_a_scan(input));
            }
            return Err(Error::invalid(format!(
                "{name} is also an input ({}): name another output",
                input.display(),
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
        check_extension(output, formats)?;
    }
    Ok(())
}

/// Refuses an output whose extension is not among the formats.
fn check_extension(output: &Path, formats: &[&str]) -> Result<()> {
    let extension = extension(output);
    if formats.contains(&extension.as_str()) {
        return Ok(());
    }
    let what = match extension.as_str() {
        "html" | "htm" => "an HTML page is a report: use --report FILE.html".to_owned(),
        "" => "no extension, which would name the format".to_owned(),
        other => format!("unknown extension .{other}"),
    };
    Err(Error::invalid(format!(
        "{}: {what}; use one of {}",
        output.display(),
        listed(formats, ".")
    )))
}

/// Refuses outputs as [`check_outputs`] does, and more than one output to a stream, because their bytes would mix.
///
/// # Errors
/// As [`check_outputs`].
pub fn check_targets(inputs: &[Source], outputs: &[Target], formats: &[&str]) -> Result<()> {
    let inputs: Vec<&Source> = inputs.iter().collect();
    check_sources(&inputs, outputs, formats)
}

fn check_sources(inputs: &[&Source], outputs: &[Target], formats: &[&str]) -> Result<()> {
    let files = |input: &&Source| input.is_file().then(|| input.path().to_owned());
    let inputs: Vec<PathBuf> = inputs.iter().filter_map(files).collect();
    let mut streams = 0;
    for output in outputs.iter().filter(|output| output.as_file().is_none()) {
        let format = output.format();
        if let Target::Named(name) = output {
            check_extension(name, formats)?;
            continue;
        }
        if !formats.contains(&format.as_str()) {
            return Err(Error::invalid(format!(
                "unknown format `{format}` for standard output: use one of {}",
                listed(formats, "")
            )));
        }
        streams += 1;
    }
    if streams > 1 {
        return Err(Error::invalid(
            "only one output can go to standard output: name files for the others",
        ));
    }
    check_outputs(&inputs, &files_of(outputs), formats)
}

/// Refuses outputs as [`check_targets`] does, and outputs in folders that do not exist.
///
/// # Errors
/// As [`check_targets`].
pub(super) fn check_all(inputs: &[&Source], outputs: &[Target], formats: &[&str]) -> Result<()> {
    check_sources(inputs, outputs, formats)?;
    check_folders(&files_of(outputs))
}

/// The outputs to files.
pub(super) fn files_of(outputs: &[Target]) -> Vec<PathBuf> {
    let files = outputs.iter().filter_map(Target::as_file);
    files.map(Path::to_owned).collect()
}

/// List of formats, for the end of a sentence.
fn listed(formats: &[&str], before: &str) -> String {
    let each: Vec<String> = formats.iter().map(|f| format!("{before}{f}")).collect();
    each.join(", ")
}

/// Default output of a fit of the scan at `path`: beside the scan, with the extension `.step` instead of its own (of
/// both `.ply` and `.gz` in `part.ply.gz`).
///
/// ```
/// use nurbskin::pipeline::default_output;
/// assert_eq!(default_output("scans/part.ply.gz").to_str(), Some("scans/part.step"));
/// assert_eq!(default_output("part.v2.xyz").to_str(), Some("part.v2.step"));
/// ```
pub fn default_output(path: impl AsRef<Path>) -> PathBuf {
    let path = path.as_ref();
    if extension(path) == "gz" {
        return path.with_extension("").with_extension("step");
    }
    path.with_extension("step")
}

/// Refuses default outputs that would replace an existing file.
///
/// # Errors
/// [`Error::Invalid`] with the name of the file and a remedy.
pub fn refuse_existing(outputs: &[PathBuf]) -> Result<()> {
    match outputs.iter().find(|output| output.exists()) {
        Some(output) => Err(Error::invalid(format!(
            "{} exists already: name an output with -o, or replace the file with --force",
            output.display()
        ))),
        None => Ok(()),
    }
}

/// The canonical form of a path, with links resolved. The name of a missing file is appended to its canonical folder; a
/// path in a missing folder stays unchanged.
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

/// Writes the surface to `outputs` and the reports of the options, each in the format of its extension, and records
/// them in the outcome. If one cannot be written, the files written before it are removed, unless they replaced an
/// existing file. A page shows the input file, if there is one.
///
/// # Errors
/// [`Error::Invalid`] as [`check_outputs`]; [`Error::Write`]; [`Error::Read`] if the input no longer exists;
/// [`Error::Cancelled`].
pub fn write(
    outcome: &mut Outcome,
    input: Option<&Path>,
    outputs: &[PathBuf],
    options: &Options,
    progress: &dyn Progress,
) -> Result<()> {
    let source = input.map(Source::file);
    write_to(
        outcome,
        source.as_ref(),
        &Target::files(outputs),
        options,
        progress,
    )
}

/// As [`write()`], for a scan from a [`Source`] and outputs to [`Target`]s.
///
/// # Errors
/// As [`write()`].
pub fn write_to(
    outcome: &mut Outcome,
    input: Option<&Source>,
    outputs: &[Target],
    options: &Options,
    progress: &dyn Progress,
) -> Result<()> {
    let inputs: Vec<Source> = input.into_iter().cloned().collect();
    check_targets(&inputs, outputs, &SURFACE_FORMATS)?;
    let reports = Target::files(&options.output.reports);
    check_targets(&inputs, &reports, &REPORT_FORMATS)?;
    check_folders(&files_of(outputs))?;
    check_folders(&options.output.reports)?;
    write_all(outcome, input, outputs, options, progress)
}

/// [`write_to`] for outputs that are already checked.
pub(super) fn write_all(
    outcome: &mut Outcome,
    input: Option<&Source>,
    outputs: &[Target],
    options: &Options,
    progress: &dyn Progress,
) -> Result<()> {
    let done = write_each(outcome, outputs, options, progress)
        .and_then(|()| write_reports(outcome, input, options, progress))
        .and_then(|()| progress.check());
    if done.is_err() {
        for written in outcome.outputs.drain(..) {
            if !written.replaced && written.content.is_none() {
                // The first error is the one reported.
                let _ = fs::remove_file(&written.path);
            }
        }
    }
    done
}

fn write_each(
    outcome: &mut Outcome,
    outputs: &[Target],
    options: &Options,
    progress: &dyn Progress,
) -> Result<()> {
    let time = options.output.time.map_or_else(Timestamp::now, Ok)?;
    for target in outputs {
        progress.check()?;
        let written = if let Some(format) = CadFormat::from_extension(&target.format()) {
            write_model(outcome, target, format, options, time)?
        } else {
            let output = MeshOutput {
                model: &outcome.model,
                chord: CHORD_OF_TOLERANCE * outcome.aim.value,
                origin: outcome.origin,
                unit_source: outcome.input.unit_source,
            };
            let mut warnings = Vec::new();
            let written = write_mesh(target, &output, &mut warnings)?;
            outcome.warnings.append(&mut warnings);
            written
        };
        outcome.outputs.push(written);
    }
    check_outputs_of(outcome, options.output.iges_layout == Layout::Exact)
}

/// A CSV report does not list the outputs; the other reports do, without themselves.
fn write_reports(
    outcome: &mut Outcome,
    input: Option<&Source>,
    options: &Options,
    progress: &dyn Progress,
) -> Result<()> {
    for path in &options.output.reports {
        let replaced = path.exists();
        let format = match extension(path).as_str() {
            "csv" => {
                write_csv(path, &outcome.per_point, outcome.origin, progress)?;
                "csv"
            }
            "html" | "htm" => {
                let about = About {
                    heading: &options.output.heading,
                    command: options.output.command.as_deref(),
                    date: options.output.time.map_or_else(Timestamp::now, Ok)?,
                };
                let page = page_of_source(outcome, input, about, progress)?;
                write_page(path, &page, progress)?;
                "html"
            }
            _ => {
                write_json(path, outcome, progress)?;
                "json"
            }
        };
        outcome.outputs.push(Output {
            replaced,
            ..described(path, format)?
        });
    }
    Ok(())
}

/// Writes a report completely, or not at all if the caller has cancelled meanwhile.
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

/// Writes the JSON of `--json`.
pub(super) fn write_json(
    path: &Path,
    outcome: &impl Serialize,
    progress: &dyn Progress,
) -> Result<()> {
    let text =
        serde_json::to_string_pretty(outcome).map_err(|e| Error::write(path, e.to_string()))?;
    write_report(path, progress, |out| writeln!(out, "{text}"))
}

pub(super) fn described(path: &Path, format: &'static str) -> Result<Output> {
    let bytes = fs::metadata(path)
        .map_err(|e| Error::write(path, e.to_string()))?
        .len();
    Ok(Output {
        path: path.to_owned(),
        format: format.into(),
        bytes,
        replaced: false,
        content: None,
    })
}

/// The scan file at `path` as an output.
///
/// # Errors
/// [`Error::Write`] if it is not there.
pub fn output_of(path: &Path) -> Result<Output> {
    described(path, scan_format(&extension(path)))
}

fn write_model(
    outcome: &Outcome,
    target: &Target,
    format: CadFormat,
    options: &Options,
    time: Timestamp,
) -> Result<Output> {
    let [file_name, product] = target.names();
    let settings = CadWriteOptions {
        schema: options.output.step_schema,
        layout: options.output.iges_layout,
        product,
        file_name,
        origin: outcome.origin,
        points: if options.output.with_points {
            &outcome.per_point.points
        } else {
            &[]
        },
        uncertainty: None,
        author: options.output.author.clone(),
        organization: options.output.organization.clone(),
        time,
    };
    let text = cad_text(&outcome.model, format, &settings)?;
    target.write_bytes(format.name(), &text)
}

/// A model to be written as a mesh.
pub(super) struct MeshOutput<'a> {
    pub(super) model: &'a Model,
    /// Chordal tolerance.
    pub(super) chord: f64,
    /// Added to every point.
    pub(super) origin: DVec3,
    pub(super) unit_source: UnitSource,
}

/// Omits triangles with two corners that coincide in the 32 bits of STL: their neighbours meet there, so that the mesh
/// stays as closed as before.
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

/// Writes the triangles of a model.
pub(super) fn write_mesh(
    target: &Target,
    output: &MeshOutput<'_>,
    warnings: &mut Vec<String>,
) -> Result<Output> {
    let model = output.model;
    let mesh = tessellate(model, output.chord, MOST_TRIANGLES)?;
    for (face, why) in &mesh.left_out {
        warnings.push(format!("face {} is left out of the mesh: {why}", face + 1));
    }
    let extension = target.format();
    if extension == "glb" {
        // One vertex per normal, so that creases stay sharp.
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
        return Ok(target.write("glb", |out| write_glb(out, &glb))?.0);
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
    let format = match extension.as_str() {
        "stl" => "stl",
        "obj" => "obj",
        _ => "ply",
    };
    let (written, notes) = write_points(target, format, &scan)?;
    warnings.extend(notes);
    Ok(written)
}

/// Writes a scan in the named format, and returns notes on properties that the format cannot store.
pub(super) fn write_points(
    target: &Target,
    format: &'static str,
    scan: &Scan,
) -> Result<(Output, Vec<String>)> {
    let name = target.path().to_string_lossy();
    target.write(format, |out| {
        write_scan_to(out, &name, &target.format(), scan)
    })
}

/// The name of the scan format for this extension.
pub(super) fn scan_format(extension: &str) -> &'static str {
    let known = ["stl", "obj"].into_iter().chain(SCAN_FORMATS);
    let mut same = known.filter(|format| *format == extension);
    same.next().unwrap_or("xyz")
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_geometry::progress::{Silent, Stopped};

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
        // At this distance from the origin all triangles coincide.
        leave_out_flat(&mut triangles, &points, DVec3::splat(1e9));
        assert!(triangles.is_empty());
    }
}

//! The deviation of a scan from a CAD file, of nurbskin or of another system.
//!
//! The verb reads scan and nominal, aligns the scan if requested, and measures both ways: every point against the
//! trimmed faces, and the faces against the scan. The verdict combines deviation, coverage and plausibility.

use super::info::{Information, information_of_cad};
use super::outcome::{DeviationSummary, Input, RejectedCounts, Times};
use super::output::{check_all, described, extension, write_csv, write_json, write_page};
use super::page::{About, page_of_deviation};
use super::sanity::{ComparedFacts, check_shares, doubtful_unit, misplaced, of_comparison};
use super::timed::Timed;
use super::{
    Heading, Length, Output, PerPoint, REPORT_FORMATS, SCHEMA, Source, Target, about,
    refuse_pointless,
};
use crate::deviation::align::{Alignment, align};
use crate::deviation::coverage::{Covered, CoveredFace, coverage_of_all};
use crate::deviation::measure::{Unused, measure_model};
use crate::deviation::verdict::{
    Asked, Judgement, Reason, Resolution, USUAL_SHARE, Verdict, judge,
};
use crate::surfacing::prepare_filled;
use glam::DVec3;
use nurbskin_cad::io::Timestamp;
use nurbskin_cad::{ClosestOnModel, Model, Region};
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::{Unit, UnitSource, counted, percent, three_digits};
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::{CleanOptions, CleanScan, Organisation, Scan, clean};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Least number of points for a noise estimate: a quadric passes through any nine points.
const FEWEST_TO_TELL: usize = 10;
/// A noise estimate above this fraction of the size of the scan is the shape between points that are too sparse.
const MOST_NOISE: f64 = 0.02;
/// Default of the required share of the nominal's area with data. A scan from a few sides of a part on a table covers
/// more.
const USUAL_COVERAGE: f64 = 0.9;
/// A motion is not small if it rotates by more degrees, or shifts by more than this fraction of the size of the scan.
const FAR_TURN: f64 = 15.0;
const FAR_SHIFT: f64 = 0.25;

/// Options of a comparison of a scan with a CAD file.
#[derive(Clone, Debug, Default)]
pub struct DeviationOptions {
    /// Largest distance allowed between scan and surface; the deviation is not judged if absent.
    pub tolerance: Option<Length>,
    /// Share (0 to 1) of the points that must be within the tolerance. If absent, 1 for ordered points and 0.995 for
    /// clouds, meshes and range images.
    pub within: Option<f64>,
    /// Share (0 to 1) of the nominal's area that must have data for a `pass`; 0.9 if absent.
    pub min_coverage: Option<f64>,
    /// Unit of the scan's numbers; if absent, that of the file, else millimetres.
    pub unit: Option<Unit>,
    /// Whether the scan is first moved to the best fit.
    pub align: bool,
    /// Reports to write: `.html`, `.json` or `.csv`.
    pub reports: Vec<PathBuf>,
    /// The command line, for the HTML page.
    pub command: Option<String>,
    /// Title and notes of the HTML page.
    pub heading: Heading,
    /// The date of the HTML page; [`Timestamp::now`] if absent.
    pub time: Option<Timestamp>,
}

/// The deviation of a scan from a CAD file. Lengths are in the scan's unit.
#[derive(Clone, Debug, Serialize)]
pub struct Compared {
    /// Version of the library.
    pub nurbskin: &'static str,
    /// Version of this JSON: [`SCHEMA`](super::SCHEMA).
    pub schema: u32,
    /// The scan.
    pub input: Input,
    /// The CAD file, in its own unit.
    pub cad: Information,
    /// The motion of the scan, if it was aligned.
    pub alignment: Option<Alignment>,
    /// The required tolerance; `None` without one.
    pub tolerance: Option<f64>,
    /// Required share (0..=1) of the points within it; `None` without a tolerance.
    pub within: Option<f64>,
    /// Required share (0..=1) of the area with data; `None` without a tolerance.
    pub min_coverage: Option<f64>,
    /// The distances, both ways.
    pub deviation: DeviationSummary,
    /// The worst of the findings on deviation, coverage, and the plausibility of units and sizes.
    pub verdict: Verdict,
    /// The first reason in words; for `pass` and `not_asked` a sentence with the figures.
    pub reason: String,
    /// The reasons against `pass`, the most serious first; empty for `pass` and `not_asked`.
    pub reasons: Vec<Reason>,
    /// Seconds per stage.
    pub time: Times,
    /// Reports written.
    pub outputs: Vec<Output>,
    /// Warnings that affect the result: assumptions, doubts, omissions.
    pub warnings: Vec<String>,
    /// Details: repairs and decisions of the run.
    pub details: Vec<String>,
    /// The deviation of each point, after the alignment if any.
    #[serde(skip)]
    pub per_point: PerPoint,
    /// The faces, in the unit of the scan and less [`origin`](Self::origin).
    #[serde(skip)]
    pub model: Model,
    /// The offset that was subtracted from all coordinates.
    #[serde(skip)]
    pub origin: DVec3,
}

/// Compares the scan in `scan` with the CAD file in `cad`, and writes the requested reports.
///
/// Every finite point counts, duplicates and outliers included.
///
/// # Errors
/// Errors of reader and writer; [`Error::Invalid`] for a CAD file without faces, or a scan without points.
pub fn deviation(
    scan: &Path,
    cad: &Path,
    options: &DeviationOptions,
    progress: &dyn Progress,
) -> Result<Compared> {
    deviation_from(&Source::file(scan), &Source::file(cad), options, progress)
}

/// As [`deviation`], for files or for bytes.
///
/// # Errors
/// As [`deviation`].
pub fn deviation_from(
    scan_source: &Source,
    cad_source: &Source,
    options: &DeviationOptions,
    progress: &dyn Progress,
) -> Result<Compared> {
    let (scan, cad) = (scan_source.path(), cad_source.path());
    check_shares(options.within, options.min_coverage)?;
    let reports = Target::files(&options.reports);
    check_all(&[scan_source, cad_source], &reports, &REPORT_FORMATS)?;
    if !cad_source.is_cad() {
        if cad_source.is_file() && !cad.exists() {
            // The reader's message about a missing file.
            cad_source.read_cad()?;
        }
        return Err(Error::read(
            cad,
            "",
            "this is not a CAD file: name the scan first, then the .step or .igs file",
        ));
    }
    let progress = &Timed::new(progress);
    progress.stage("read", None);
    let points = scan_source.read_scan()?;
    let file = cad_source.read_cad()?;
    progress.check()?;
    let unread = file.unread.iter();
    let unread: Vec<String> = unread
        .map(|(entity, &count)| {
            let entities = counted(count, "entity", "entities");
            format!("{entities} of type {entity} not read, and so not compared")
        })
        .collect();
    if file.model.faces().is_empty() {
        return Err(Error::read(cad, "", "there is no face to compare with"));
    }
    let model = file.model.clone();
    let information = information_of_cad(file, cad).map_err(|error| about(cad, error))?;
    let mut compared = compare(points, scan, model, information, options, progress)
        .map_err(|error| about(scan, error))?;
    compared.warnings.extend(unread);
    // Reports carry the times up to here.
    compared.time = progress.times();
    progress.stage("write", None);
    progress.check()?;
    let inputs = [scan_source.clone(), cad_source.clone()];
    let about = About {
        heading: &options.heading,
        command: options.command.as_deref(),
        date: options.time.map_or_else(Timestamp::now, Ok)?,
    };
    write_reports(&mut compared, &inputs, &options.reports, about, progress)?;
    compared.time = progress.times();
    Ok(compared)
}

/// Writes reports of a comparison, each in the format of its extension, and records them in it. A page shows those of
/// the `inputs` that are files, and what is `about` it.
///
/// # Errors
/// [`Error::Invalid`] as [`check_outputs`](super::check_outputs); [`Error::Write`]; [`Error::Read`] if an input no
/// longer exists; [`Error::Cancelled`].
pub fn write_deviation(
    compared: &mut Compared,
    inputs: &[Source],
    reports: &[PathBuf],
    about: About,
    progress: &dyn Progress,
) -> Result<()> {
    let read: Vec<&Source> = inputs.iter().collect();
    check_all(&read, &Target::files(reports), &REPORT_FORMATS)?;
    write_reports(compared, inputs, reports, about, progress)
}

/// [`write_deviation`] for reports that are already checked.
fn write_reports(
    compared: &mut Compared,
    inputs: &[Source],
    reports: &[PathBuf],
    about: About,
    progress: &dyn Progress,
) -> Result<()> {
    for path in reports {
        let replaced = path.exists();
        let format = match extension(path).as_str() {
            "csv" => {
                write_csv(path, &compared.per_point, compared.origin, progress)?;
                "csv"
            }
            "html" | "htm" => {
                let page = page_of_deviation(compared, inputs, about, progress)?;
                write_page(path, &page, progress)?;
                "html"
            }
            _ => {
                write_json(path, compared, progress)?;
                "json"
            }
        };
        compared.outputs.push(Output {
            replaced,
            ..described(path, format)?
        });
    }
    Ok(())
}

/// Whether the points were measured in order: rows, or a grid without an empty cell. A range image always has empty
/// cells.
fn is_ordered(scan: &Scan) -> bool {
    match &scan.organisation {
        Organisation::Rows(_) => true,
        Organisation::Grid(layout) => {
            layout.cells.iter().all(Option::is_some) && scan.points.iter().all(|p| p.is_finite())
        }
        Organisation::Mesh(_) | Organisation::Unordered => false,
    }
}

/// The points of a scan that are compared, and their properties.
struct Usable {
    indices: Vec<u32>,
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    spacing: Option<f64>,
    noise: Option<f64>,
}

impl Usable {
    /// Every finite point; spacing and noise from the cleaned scan.
    fn new(scan: &Scan, cleaned: Option<&CleanScan>) -> Self {
        let finite = (0_u32..).zip(&scan.points).filter(|(_, p)| p.is_finite());
        let (indices, points) = finite.map(|(k, &p)| (k, p)).unzip();
        let mut this = Self {
            indices,
            points,
            triangles: Vec::new(),
            spacing: cleaned.map(|c| c.spacing),
            noise: cleaned.map(|c| c.noise),
        };
        if let Organisation::Mesh(triangles) = &scan.organisation {
            let place = |k: u32| this.indices.binary_search(&k).ok();
            let moved = triangles.iter().filter_map(|t| {
                let [a, b, c] = t.map(place);
                let small = |k: usize| u32::try_from(k).unwrap_or(u32::MAX);
                Some([small(a?), small(b?), small(c?)])
            });
            this.triangles = moved.collect();
        }
        this
    }
}

fn compare(
    mut scan: Scan,
    path: &Path,
    model: Model,
    cad: Information,
    options: &DeviationOptions,
    progress: &dyn Progress,
) -> Result<Compared> {
    if let Some(unit) = options.unit {
        (scan.unit, scan.unit_source) = (unit, UnitSource::Option);
    }
    let mut warnings = std::mem::take(&mut scan.warnings);
    refuse_pointless(&scan)?;
    // 1. The resolution of the scan.
    progress.stage("clean", Some(scan.points.len() as u64));
    let cleaned = match clean(&scan, &CleanOptions { outliers: false }, progress) {
        Ok(cleaned) if cleaned.points.len() >= FEWEST_TO_TELL => Some(cleaned),
        Ok(_) => None,
        Err(Error::Cancelled) => return Err(Error::Cancelled),
        Err(why) => {
            warnings.push(format!("spacing and noise cannot be told: {why}"));
            None
        }
    };
    let mut usable = Usable::new(&scan, cleaned.as_ref());
    if usable.indices.len() == scan.points.len()
        && scan.organisation.is_ordered()
        && let Ok(prepared) = prepare_filled(&scan, &vec![false; scan.points.len()], None)
    {
        // The spacing between its lines, as in `fit`.
        usable.spacing = Some(prepared.spacing);
    }
    drop(cleaned);
    let [low, high] = nurbskin_geometry::point_grid::bounding_box(&usable.points);
    let corners = [low, high].map(|corner| (corner + scan.origin).to_array());
    let model = model.in_unit(scan.unit)?.map_points(|p| p - scan.origin)?;
    let target = ClosestOnModel::new(&model)?;
    let extents = (high - low).to_array();
    if let Some(doubt) = doubtful_unit(scan.unit_source, scan.unit, extents) {
        warnings.insert(0, doubt.words_with_next());
    } else if scan.unit_source == UnitSource::Assumed {
        warnings.push(format!(
            "the scan does not say its unit: {} is assumed (say --unit)",
            scan.unit
        ));
    }
    let sizes = [low.distance(high), diagonal_of(&cad, scan.unit)];
    usable.noise = usable.noise.filter(|&noise| noise <= MOST_NOISE * sizes[0]);
    let asked = options.tolerance.map(|tolerance| Asked {
        tolerance: tolerance.resolve(scan.unit, sizes[0]),
        within: options.within.unwrap_or(match is_ordered(&scan) {
            true => 1.0,
            false => USUAL_SHARE,
        }),
    });
    let tolerance = asked.map(|asked| asked.tolerance);
    progress.check()?;
    // 2. Alignment.
    let alignment = if options.align {
        progress.stage("align", None);
        let (motion, said) = align(&target, &usable.points, progress)?;
        for point in &mut usable.points {
            *point = motion.apply(*point);
        }
        warnings.extend(far(&said, sizes[0], scan.unit));
        Some(said.about(scan.origin))
    } else {
        None
    };
    // 3. Deviation, both ways.
    progress.stage("deviation", Some(usable.points.len() as u64));
    let measured = measure_model(&target, &usable.points, None, tolerance, progress)?;
    let resolution = Resolution {
        noise: usable.noise,
        spacing: usable.spacing.unwrap_or(0.0),
        extent: sizes[0],
        unit: scan.unit,
    };
    let mut judged = judge(&measured, &usable.points, asked, resolution).moved(scan.origin);
    let surface_to_scan = back(&model, &usable)?;
    let least = asked.map(|_| options.min_coverage.unwrap_or(USUAL_COVERAGE));
    let covered = 1.0 - surface_to_scan.unsupported_area;
    judged.summary = format!(
        "{}; {} of the nominal's area has data",
        judged.summary,
        percent(covered)
    );
    let [low, high] = nurbskin_geometry::point_grid::bounding_box(&usable.points);
    let facts = ComparedFacts {
        sizes: [low.distance(high), sizes[1]],
        unit: scan.unit,
        aligned: options.align,
        covered,
        least,
        median: measured.statistics.p50,
    };
    if let Some(reason) = misplaced(&facts) {
        warnings.insert(0, reason.words_with_next());
    }
    advise(&mut judged, asked, &facts);
    for (verdict, reason) in of_comparison(&facts) {
        judged.add(verdict, reason);
    }
    progress.check()?;
    let per_point = PerPoint {
        indices: usable.indices,
        points: usable.points,
        deviation: measured.points,
        held_out: Vec::new(),
        triangles: usable.triangles,
        unused: not_finite(&scan),
        records: std::mem::take(&mut scan.records),
    };
    Ok(Compared {
        nurbskin: env!("CARGO_PKG_VERSION"),
        schema: SCHEMA,
        input: Input {
            path: path.display().to_string(),
            format: scan.format,
            points: scan.points.len(),
            used: per_point.points.len(),
            rejected: RejectedCounts {
                non_finite: scan.points.len() - per_point.points.len(),
                ..RejectedCounts::default()
            },
            organisation: scan.organisation.name().into(),
            grid: match &scan.organisation {
                Organisation::Grid(layout) => Some([layout.count_u, layout.count_v]),
                _ => None,
            },
            unit: scan.unit,
            unit_source: scan.unit_source,
            bounding_box: corners,
            spacing: usable.spacing,
            noise: usable.noise,
            scene_objects: 0,
        },
        cad,
        alignment,
        tolerance,
        within: asked.map(|asked| asked.within),
        min_coverage: least,
        deviation: DeviationSummary {
            scan_to_surface: measured.statistics,
            surface_to_scan,
            free_edges: measured.free_edges,
            hold_out: None,
            // Every finite point is used.
            all_points: Some(measured.statistics),
            worst: per_point.worst(scan.origin),
        },
        verdict: judged.verdict,
        reason: judged.reason(scan.unit),
        reasons: judged.reasons,
        time: Times::default(),
        outputs: Vec::new(),
        warnings,
        details: Vec::new(),
        per_point,
        model,
        origin: scan.origin,
    })
}

/// The points that cannot be compared.
fn not_finite(scan: &Scan) -> Vec<Unused> {
    let other = |(index, &point): (u32, &DVec3)| Unused {
        index,
        point,
        reason: nurbskin_scan::Reason::NonFinite,
        deviation: None,
    };
    let all = (0_u32..).zip(&scan.points).filter(|(_, p)| !p.is_finite());
    all.map(other).collect()
}

/// The diagonal of the box around the faces of a CAD file.
fn diagonal_of(cad: &Information, unit: Unit) -> f64 {
    let corners = cad.bounding_box.map(|corners| corners.map(DVec3::from));
    let diagonal = corners.map_or(0.0, |[low, high]| low.distance(high));
    Length::In(diagonal, cad.unit).resolve(unit, 0.0)
}

/// The remedy for points outside the tolerance.
fn advise(judged: &mut Judgement, asked: Option<Asked>, facts: &ComparedFacts) {
    let most = asked.is_some_and(|asked| facts.median > asked.tolerance);
    let next = match (misplaced(facts).and_then(|reason| reason.next), most) {
        (Some(next), _) => next,
        (None, true) if !facts.aligned => {
            "say --align if the scan is not in the nominal's coordinates".into()
        }
        _ => "look at the place in the report (--report part.html)".into(),
    };
    for reason in judged.reasons.iter_mut().filter(|r| r.next.is_none()) {
        reason.next = Some(next.clone());
    }
}

/// The warning about a motion that is not small.
fn far(said: &Alignment, size: f64, unit: Unit) -> Option<String> {
    let by = DVec3::from(said.translation).length();
    (said.rotation_deg > FAR_TURN || by > FAR_SHIFT * size).then(|| {
        format!(
            "the scan was turned by {} degrees and moved by {} to fit: only small motions are found for certain, check \
             the result",
            three_digits(said.rotation_deg),
            unit.length(by)
        )
    })
}

/// The distance of the faces to the scan.
fn back(model: &Model, scan: &Usable) -> Result<crate::deviation::coverage::Coverage> {
    let regions = model
        .faces()
        .iter()
        .map(|face| face.trimmed.then(|| Region::new(face)).transpose())
        .collect::<Result<Vec<_>>>()?;
    let faces = model.faces().iter().zip(&regions);
    let triangles = (!scan.triangles.is_empty()).then_some(&scan.triangles[..]);
    Ok(coverage_of_all(&[Covered {
        faces: faces
            .map(|(face, region)| CoveredFace {
                surface: &face.surface,
                region: region.as_ref(),
            })
            .collect(),
        points: &scan.points,
        triangles,
        spacing: scan.spacing.unwrap_or(0.0),
    }]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quarter turn about z of points less their origin, in the coordinates of the file.
    #[test]
    fn the_motion_is_that_of_the_files_coordinates() {
        let said = Alignment {
            rotation_deg: 90.0,
            translation: [0.0; 3],
            rms_before: 1.0,
            rms_after: 0.0,
            matrix: [
                [0.0, -1.0, 0.0, 1.0],
                [1.0, 0.0, 0.0, 2.0],
                [0.0, 0.0, 1.0, 3.0],
            ],
        };
        let apply = |m: &[[f64; 4]; 3], p: DVec3| {
            DVec3::from(m.map(|[x, y, z, by]| DVec3::new(x, y, z).dot(p) + by))
        };
        let origin = DVec3::new(1000.0, 200.0, -30.0);
        let p = DVec3::new(4.0, 5.0, 6.0);
        let moved = apply(&said.matrix, p) + origin;
        assert_eq!(moved, DVec3::new(996.0, 206.0, -21.0));
        assert_eq!(apply(&said.about(origin).matrix, p + origin), moved);
    }

    #[test]
    fn large_motions_are_said() {
        let said = |degrees: f64, by: f64| Alignment {
            rotation_deg: degrees,
            translation: [by, 0.0, 0.0],
            rms_before: 1.0,
            rms_after: 0.1,
            matrix: [[0.0; 4]; 3],
        };
        let mm = Unit::Millimetre;
        assert!(far(&said(3.0, 1.0), 10.0, mm).is_none());
        assert!(far(&said(16.0, 0.0), 10.0, mm).is_some());
        assert!(far(&said(0.0, 3.0), 10.0, mm).is_some_and(|s| s.contains("by 3 mm")));
    }
}

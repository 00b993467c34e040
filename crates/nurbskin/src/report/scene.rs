//! Builds the data of a page from the result of a verb.
//!
//! Tessellates the faces, assigns deviation and curvature to their vertices, selects lines and points, and adds the
//! tables from the JSON of the verb.

use super::colours::deviation_of_vertices;
use super::document::{Document, FaceSummary, Judged, Mesh, Packed, Table};
use super::fields::{Heading, Note};
use super::histogram::histogram;
use super::joins::joins;
use super::lines::{ModelLines, lines};
use super::points::points;
use super::source::Source;
use super::surface::{Surface, normals_of};
use super::trade::trade;
use super::worst::worst;
use super::{
    DEVIATION_STEP, number, step_of_parameters, step_of_places, step_of_values, tables, text,
};
use crate::deviation::measure::{PointDeviation, Statistics, Unused};
use glam::DVec3;
use nurbskin_cad::io::Timestamp;
use nurbskin_cad::{JoinKind, Model, extent};
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::Unit;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::Records;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// Largest number of triangles of a displayed scan mesh.
const MOST_TRIANGLES: usize = 1_000_000;
/// Chordal tolerance of lines, as a share of the diagonal.
const CHORD_OF_LINES: f64 = 1.0 / 4000.0;
/// Steps of normals: 0.004 degrees, far below what the eye sees in zebra stripes.
const NORMAL_STEP: f64 = 1.0 / (1 << 15) as f64;
/// Steps of curvatures, as a share of a common one: four digits.
const CURVATURE_STEP: f64 = 1.0 / (1 << 13) as f64;
/// The deviation as the page stores it.
const STATISTICS: [&str; 5] = [
    "scan_to_surface",
    "all_points",
    "surface_to_scan",
    "free_edges",
    "hold_out",
];

/// Kind of a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A scan and the surface fitted to it.
    Fit,
    /// A scan compared with a CAD file.
    Deviation,
    /// A file without a comparison.
    View,
}

impl Kind {
    /// `fit`, `deviation` or `view`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Kind::Fit => "fit",
            Kind::Deviation => "deviation",
            Kind::View => "view",
        }
    }
}

/// Input of a page.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// Kind of the page.
    pub kind: Kind,
    /// Subject of the page, such as the name of the scan.
    pub title: &'a str,
    /// The command line, if any.
    pub command: Option<&'a str>,
    /// The input files.
    pub inputs: &'a [Source],
    /// Title and notes, if people gave some.
    pub heading: Option<&'a Heading>,
    /// The date of the report.
    pub date: Option<Timestamp>,
    /// The JSON of the verb, the source of the figures, the tolerance and the verdict of the page.
    pub outcome: &'a Value,
    /// Unit of all lengths.
    pub unit: Unit,
    /// The faces, minus `origin`; `None` or an empty model without faces.
    pub model: Option<&'a Model>,
    /// How the faces join at each edge of the model, if it is known; else it is judged by the angles.
    pub kinds: Option<&'a [JoinKind]>,
    /// The points, if there is a scan.
    pub scan: Option<Measured<'a>>,
    /// The scan's own triangles between the points of `scan`, displayed if there are no faces.
    pub triangles: Option<&'a [[u32; 3]]>,
    /// The offset to add to all coordinates.
    pub origin: DVec3,
}

/// The points of a scan and their distances from the faces. Each list is empty or has one entry per point.
#[derive(Clone, Copy, Debug, Default)]
pub struct Measured<'a> {
    /// The points used, minus the origin.
    pub points: &'a [DVec3],
    /// Index of each point in the scan; empty if the points are all of the scan.
    pub indices: &'a [u32],
    /// The deviation of each point, if measured.
    pub deviation: Option<&'a [PointDeviation]>,
    /// Which points were held out of the fit; empty if none were.
    pub held_out: &'a [bool],
    /// Triangles between the points, if the scan has any; the area that they cover has data, whatever the spacing of
    /// the points.
    pub triangles: &'a [[u32; 3]],
    /// The points of the scan that are not used, by ascending index.
    pub unused: &'a [Unused],
    /// Which records of the file hold the points of the scan; the page numbers points by them. `None`: all of them.
    pub records: Option<&'a Records>,
    /// Typical distance between neighbouring points; zero if unknown, then estimated from their number.
    pub spacing: f64,
}

impl Subject<'_> {
    /// The title that people gave, or the subject.
    fn title(&self) -> &str {
        let given = self.heading.and_then(|heading| heading.title.as_deref());
        given.unwrap_or(self.title)
    }
}

impl Measured<'_> {
    /// With a positive spacing, estimated if necessary.
    pub(super) fn with_spacing(self, diagonal: f64) -> Self {
        let guess = diagonal / (self.points.len().max(1) as f64).sqrt();
        Self {
            spacing: if self.spacing > 0.0 {
                self.spacing
            } else {
                guess
            },
            ..self
        }
    }

    /// Record in the file of a point.
    pub(super) fn index(&self, k: usize) -> u32 {
        self.record(self.indices.get(k).copied().unwrap_or_else(|| number(k)))
    }

    /// Record in the file of the point of this index in the scan.
    pub(super) fn record(&self, index: u32) -> u32 {
        self.records.map_or(index, |records| records.of(index))
    }
}

/// The data of the page. O(n log n) for n points and vertices; a few hundred bytes per vertex and point shown.
///
/// Deterministic: the same data for the same subject, whatever the number of threads.
///
/// # Errors
/// [`Error::Cancelled`]; errors of the tessellation are reported on the page.
///
/// ```
/// use nurbskin::{DVec3, Unit, cad::Model, nurbs::conic, progress::Silent};
/// use nurbskin::report::{Kind, Subject, document, page};
/// let mut model = Model::new("ball");
/// model.add_whole_surface(&conic::sphere(DVec3::ZERO, 1.0)?, 1e-9)?;
/// let subject = Subject {
///     kind: Kind::View,
///     title: "ball.step",
///     command: None,
///     inputs: &[],
///     heading: None,
///     date: None,
///     outcome: &serde_json::Value::Null,
///     unit: Unit::Millimetre,
///     model: Some(&model),
///     kinds: None,
///     scan: None,
///     triangles: None,
///     origin: DVec3::ZERO,
/// };
/// let document = document(&subject, &Silent)?;
/// assert_eq!(document.poles.len(), 2);
/// assert!(page(&document)?.contains("ball.step"));
/// # Ok::<(), nurbskin::Error>(())
/// ```
pub fn document(subject: &Subject, progress: &dyn Progress) -> Result<Document> {
    let model = subject.model.filter(|model| !model.faces().is_empty());
    let [low, high] = corners(subject, model);
    let (centre, diagonal) = (low.midpoint(high), low.distance(high));
    let scan = subject.scan.map(|scan| scan.with_spacing(diagonal));
    let scan = scan.as_ref();
    let tolerance = subject.outcome.get("tolerance").and_then(Value::as_f64);
    let measured = scan.and_then(|scan| scan.deviation.map(|deviation| (scan, deviation)));
    let mut display = Vec::new();
    let mesh = match model {
        Some(model) => of_model(model, diagonal, measured, centre, &mut display, progress)?,
        None => of_scan(subject, diagonal, centre, &mut display),
    };
    progress.check()?;
    let ModelLines {
        lines,
        edges,
        poles,
    } = model.map_or_else(ModelLines::default, |model| {
        lines(model, diagonal, CHORD_OF_LINES * diagonal, centre)
    });
    let joins = model.map_or_else(Vec::new, |model| {
        joins(model, subject.kinds, &edges, subject.origin)
    });
    progress.check()?;
    let points = scan.map(|scan| points(scan, centre, diagonal));
    if let Some(points) = points.as_ref().filter(|p| p.shown < p.total) {
        let counts = [points.shown, points.total].map(|n| text::count(n as u64));
        display.push(vec![
            "points shown".to_owned(),
            format!("{} of {}; all count in the figures", counts[0], counts[1]),
        ]);
    }
    let mut tables = tables::tables(subject.outcome, subject.unit);
    if !display.is_empty() {
        tables.push(Table {
            title: "Display",
            rows: display,
        });
    }
    Ok(Document {
        nurbskin: env!("CARGO_PKG_VERSION"),
        kind: subject.kind.name(),
        title: subject.title().to_owned(),
        fields: fields(subject),
        command: subject.command.map(str::to_owned),
        inputs: subject.inputs.to_vec(),
        unit: subject.unit,
        shown_in: subject.unit.shown_in(),
        verdict: verdict(subject.outcome),
        tolerance,
        within: subject.outcome.get("within").and_then(Value::as_f64),
        tables,
        details: listed(subject.outcome, "details"),
        statistics: statistics(subject.outcome),
        histogram: measured.and_then(|(_, deviation)| histogram(deviation, tolerance)),
        trade: trade(subject.outcome, subject.unit),
        worst: match (measured, model) {
            (Some((scan, deviation)), Some(model)) => {
                worst(scan, deviation, model, subject.origin, diagonal)
            }
            _ => Vec::new(),
        },
        faces: model.map_or_else(Vec::new, |model| {
            faces(model, measured.map(|m| m.1), tolerance)
        }),
        bounding_box: [low, high].map(|corner| (corner + subject.origin).to_array()),
        origin: (centre + subject.origin).to_array(),
        mesh,
        lines,
        joins,
        poles,
        points,
    })
}

/// The bounding box of the displayed content, minus the origin: of the faces, or of the points used.
fn corners(subject: &Subject, model: Option<&Model>) -> [DVec3; 2] {
    let found = match model {
        Some(model) => extent(model).map_or_else(
            |_| {
                let boxes = model.faces().iter().flat_map(|f| f.surface.bounding_box());
                bounding_box(&boxes.collect::<Vec<_>>())
            },
            |extent| [extent.low, extent.high],
        ),
        None => {
            let points = subject.scan.map_or(&[][..], |scan| scan.points);
            let finite = points.iter().copied().filter(|p| p.is_finite());
            bounding_box(&finite.collect::<Vec<_>>())
        }
    };
    if found.iter().all(|corner| corner.is_finite()) {
        found
    } else {
        [DVec3::ZERO; 2]
    }
}

/// Triangles of the faces.
fn of_model(
    model: &Model,
    diagonal: f64,
    measured: Option<(&Measured, &[PointDeviation])>,
    centre: DVec3,
    display: &mut Vec<Vec<String>>,
    progress: &dyn Progress,
) -> Result<Option<Mesh>> {
    let surface = match Surface::new(model, diagonal, progress) {
        Err(Error::Cancelled) => return Err(Error::Cancelled),
        Err(why) => {
            display.push(vec!["faces".to_owned(), format!("not shown: {why}")]);
            return Ok(None);
        }
        Ok(surface) => surface,
    };
    display.push(vec![
        "triangles".to_owned(),
        format!(
            "{}, within {} of the faces",
            text::count(surface.triangles.len() as u64),
            model.unit.length(surface.bound)
        ),
    ]);
    for (face, why) in &surface.left_out {
        display.push(vec![
            format!("face {}", face + 1),
            format!("has no triangles: {why}"),
        ]);
    }
    progress.check()?;
    let curvatures = surface.curvatures(model, diagonal);
    progress.check()?;
    let deviation = measured.map(|(scan, deviation)| {
        let values = deviation_of_vertices(&surface, model, scan, deviation);
        let step = step_of_values(values.iter().copied(), DEVIATION_STEP);
        Packed::floats(values.into_iter().map(|x| [x]), step)
    });
    let curvature = |k: usize| {
        let step = step_of_values(curvatures.iter().map(|c| c[k]), CURVATURE_STEP);
        Packed::floats(curvatures.iter().map(|c| [c[k]]), step)
    };
    let parameters = || surface.parameters.iter().map(|p| p.to_array());
    let step = step_of_parameters(parameters().flatten());
    Ok(Some(Mesh {
        positions: places(&surface.points, centre, diagonal),
        normals: normals(&surface.normals),
        parameters: Some(Packed::floats(parameters(), step)),
        vertex_faces: Some(Packed::integers(surface.faces.iter().map(|&f| [f]))),
        triangles: Packed::integers(surface.triangles.iter().copied()),
        deviation,
        mean_curvature: Some(curvature(0)),
        gaussian_curvature: Some(curvature(1)),
    }))
}

/// Places relative to `centre`, on a part of this size.
fn places(points: &[DVec3], centre: DVec3, diagonal: f64) -> Packed {
    let places: Vec<DVec3> = points.iter().map(|&p| p - centre).collect();
    let step = step_of_places(&places, diagonal);
    Packed::floats(places.iter().map(DVec3::to_array), step)
}

fn normals(normals: &[DVec3]) -> Packed {
    Packed::directions(normals.iter().map(DVec3::to_array), NORMAL_STEP)
}

/// The scan's own triangles.
fn of_scan(
    subject: &Subject,
    diagonal: f64,
    centre: DVec3,
    display: &mut Vec<Vec<String>>,
) -> Option<Mesh> {
    let points = subject.scan?.points;
    let finite = |&k: &u32| points.get(k as usize).is_some_and(|p| p.is_finite());
    let all = subject.triangles?.iter();
    let usable: Vec<[u32; 3]> = all
        .copied()
        .filter(|t| t.iter().all(finite))
        .take(MOST_TRIANGLES + 1)
        .collect();
    if usable.is_empty() {
        return None;
    }
    if usable.len() > MOST_TRIANGLES {
        display.push(vec![
            "triangles".to_owned(),
            format!(
                "not shown: more than {}; the points are",
                text::count(MOST_TRIANGLES as u64)
            ),
        ]);
        return None;
    }
    // Only points used by triangles, in their order.
    let mut numbers = vec![u32::MAX; points.len()];
    usable
        .iter()
        .flatten()
        .for_each(|&k| numbers[k as usize] = 0);
    let mut used = Vec::new();
    for (slot, &point) in numbers.iter_mut().zip(points) {
        if *slot == 0 {
            *slot = number(used.len());
            used.push(point);
        }
    }
    let triangles: Vec<[u32; 3]> = usable
        .iter()
        .map(|t| t.map(|k| numbers[k as usize]))
        .collect();
    Some(Mesh {
        positions: places(&used, centre, diagonal),
        normals: normals(&normals_of(&used, &triangles)),
        triangles: Packed::integers(triangles),
        ..Mesh::default()
    })
}

fn faces(
    model: &Model,
    deviation: Option<&[PointDeviation]>,
    tolerance: Option<f64>,
) -> Vec<FaceSummary> {
    let all = model.faces();
    let figures = deviation.map(|found| Statistics::by_face(found, all.len(), tolerance));
    let summary = |(k, face): (usize, &nurbskin_cad::Face)| FaceSummary {
        name: face.name.clone(),
        kind: face.kind,
        degree: face.surface.degree(),
        control_points: face.surface.distinct_counts(),
        deviation: figures.as_ref().and_then(|figures| figures.get(k).copied()),
    };
    all.iter().enumerate().map(summary).collect()
}

/// Keys of notes that the heading shows first, in this order, after the date.
const FIRST: [&str; 6] = [
    "date",
    "part",
    "drawing",
    "revision",
    "operator",
    "alignment",
];

/// What the heading says beside the title: the date, what people noted, and how the scan was aligned.
fn fields(subject: &Subject) -> Vec<Note> {
    let mut fields = subject.heading.map(Heading::distinct).unwrap_or_default();
    let mut add = |key: &str, text: Option<String>| {
        let known = fields.iter().any(|field| field.key.to_lowercase() == key);
        fields.extend(text.filter(|_| !known).map(|text| Note {
            key: key.to_owned(),
            text,
        }));
    };
    add(
        "date",
        subject
            .date
            .map(|date| format!("{} UTC", date.iso().replace('T', " "))),
    );
    add("alignment", alignment(subject));
    fields.sort_by_key(|field| {
        let key = field.key.to_lowercase();
        let place = FIRST.iter().position(|first| *first == key);
        place.unwrap_or(FIRST.len())
    });
    fields
}

/// How the scan of a comparison was aligned.
fn alignment(subject: &Subject) -> Option<String> {
    if subject.kind != Kind::Deviation {
        return None;
    }
    let found = subject.outcome.get("alignment").filter(|a| a.is_object());
    let Some(found) = found else {
        return Some("as scanned, not moved".to_owned());
    };
    let number = |key: &str| found.get(key).and_then(Value::as_f64);
    let vector: Vec<f64> = listed(found, "translation");
    let by = <[f64; 3]>::try_from(vector).map_or(0.0, |v| DVec3::from(v).length());
    Some(format!(
        "best fit: turned by {}, moved by {}",
        text::with_unit(number("rotation_deg")?, "°"),
        subject.unit.length(by)
    ))
}

fn verdict(outcome: &Value) -> Option<Judged> {
    let text = |key: &str| outcome.get(key).and_then(Value::as_str).map(str::to_owned);
    Some(Judged {
        verdict: text("verdict")?,
        reason: text("reason").unwrap_or_default(),
        reasons: listed(outcome, "reasons"),
    })
}

/// A list of the JSON; empty if absent.
fn listed<T: DeserializeOwned>(outcome: &Value, key: &str) -> Vec<T> {
    let found = outcome.get(key).cloned().map(serde_json::from_value);
    found.and_then(std::result::Result::ok).unwrap_or_default()
}

/// The deviation in the JSON of the verb; null if absent.
fn statistics(outcome: &Value) -> Option<Value> {
    let found = outcome.get("deviation")?.as_object()?;
    let of = |key: &str| (key.to_owned(), found.get(key).cloned().unwrap_or_default());
    Some(Value::Object(
        STATISTICS.into_iter().map(of).collect::<Map<_, _>>(),
    ))
}

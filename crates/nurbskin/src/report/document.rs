//! The data of the page in the form that its script reads; lengths in the unit of the scan.
//!
//! The structures here define the JSON inside the page. Coordinates and deviations are [`Packed`] numbers, relative to
//! an origin.

use super::fields::Note;
pub use super::packed::Packed;
use super::source::Source;
use crate::deviation::measure::Statistics;
use crate::deviation::verdict::Reason;
use nurbskin_cad::{JoinKind, SurfaceKind};
use nurbskin_fit::fit::approximate::trade::TradePoint;
use nurbskin_geometry::unit::{ShownUnit, Unit};
use serde::Serialize;

/// The complete data of a page.
#[derive(Clone, Debug, Serialize)]
pub struct Document {
    /// Version of the library.
    pub nurbskin: &'static str,
    /// `fit`, `deviation` or `view`.
    pub kind: &'static str,
    /// The subject of the page, such as the name of the scan.
    pub title: String,
    /// What the heading says beside the title, such as date, part, operator and alignment.
    pub fields: Vec<Note>,
    /// The command line, if any.
    pub command: Option<String>,
    /// The input files.
    pub inputs: Vec<Source>,
    /// Unit of all lengths.
    pub unit: Unit,
    /// The units of displayed lengths.
    pub shown_in: Vec<ShownUnit>,
    /// The verdict, if there is one.
    pub verdict: Option<Judged>,
    /// The tolerance, where there is one.
    pub tolerance: Option<f64>,
    /// Required share (0..=1) of the points within it.
    pub within: Option<f64>,
    /// Formatted figures.
    pub tables: Vec<Table>,
    /// Details: repairs and decisions of the run, one sentence each.
    pub details: Vec<String>,
    /// `deviation` of the verb's JSON, where there is one.
    pub statistics: Option<serde_json::Value>,
    /// Histogram of the signed deviations of all points used.
    pub histogram: Option<Histogram>,
    /// Deviation against control points, for several surfaces that of the first; only if the search produced more than
    /// one surface.
    pub trade: Option<Trade>,
    /// The places of largest deviation, the worst first, separated from each other.
    pub worst: Vec<Worst>,
    /// The faces, by index.
    pub faces: Vec<FaceSummary>,
    /// Lowest and highest corner of the displayed content, in the coordinates of the file.
    pub bounding_box: [[f64; 3]; 2],
    /// Origin of the positions below, in the coordinates of the file.
    pub origin: [f64; 3],
    /// The faces, or the scan's own mesh, as triangles.
    pub mesh: Option<Mesh>,
    /// Lines on and around the faces.
    pub lines: Lines,
    /// How the faces join at each of the polylines `lines.edges`.
    pub joins: Vec<Join>,
    /// Poles, relative to the origin.
    pub poles: Vec<[f32; 3]>,
    /// The points of the scan.
    pub points: Option<Points>,
}

/// A verdict and its reasons.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// `pass`, `fail`, `cannot_tell` or `not_asked`.
    pub verdict: String,
    /// The first reason as a sentence, or the figures if there is none.
    pub reason: String,
    /// The reasons against `pass`, the most serious first, with places in the coordinates of the file.
    pub reasons: Vec<Reason>,
}

/// A table without a header row.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Table {
    /// Its heading.
    pub title: &'static str,
    /// The cells of each row; the first cell is the name of the row.
    pub rows: Vec<Vec<String>>,
}

/// Numbers of signed deviations in intervals of equal width.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Histogram {
    /// Lower limit of the first interval.
    pub low: f64,
    /// Upper limit of the last interval: -`low`.
    pub high: f64,
    /// Numbers of points per interval; the number of intervals is odd, so that zero is in the middle of one.
    pub counts: Vec<u64>,
    /// Points below the first interval.
    pub below: u64,
    /// Points above the last interval.
    pub above: u64,
}

/// Deviation over control points.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trade {
    /// At least two surfaces, ascending in control points, descending in p95.
    pub points: Vec<TradePoint>,
    /// Control points of the chosen surface, which is in the list.
    pub chosen: usize,
    /// Control points at the knee of the curve.
    pub knee: Option<usize>,
    /// Estimated control points for a looser and a tighter tolerance, in words.
    pub neighbours: Option<String>,
}

/// A point far from the surface.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Worst {
    /// Its record in the file.
    pub index: u32,
    /// The point, in the coordinates of the file.
    pub point: [f64; 3],
    /// The foot point on the surface, in the coordinates of the file.
    pub foot: [f64; 3],
    /// Signed: positive outside.
    pub deviation: f64,
    /// Parameter u of the foot point.
    pub u: f64,
    /// Parameter v of the foot point.
    pub v: f64,
    /// Index of the face.
    pub face: u32,
    /// `interior` or `free_edge`.
    pub state: &'static str,
}

/// How faces join at an edge. Angles are in degrees.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Join {
    /// Index of the edge.
    pub edge: usize,
    /// `smooth`, `sharp` or `open`; `None` where more than two faces meet, or nothing could be measured.
    pub kind: Option<JoinKind>,
    /// Indices of the faces at the edge.
    pub faces: Vec<u32>,
    /// The largest sampled angle between the normals of the two faces.
    pub sampled: Option<f64>,
    /// No angle on the edge exceeds this.
    pub bound: Option<f64>,
    /// Length of the edge between two faces.
    pub length: Option<f64>,
    /// The place of the largest sample, in the coordinates of the file.
    pub place: Option<[f64; 3]>,
}

/// Description of a face.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FaceSummary {
    /// Its name, possibly empty.
    pub name: String,
    /// Type of its surface in the file.
    pub kind: SurfaceKind,
    /// Degrees along u and v.
    pub degree: [usize; 2],
    /// Control points along u and v; those that wrap around count once.
    pub control_points: [usize; 2],
    /// Deviation of the points whose foot point is on the face; `None` without a comparison.
    pub deviation: Option<Statistics>,
}

/// Triangles with the attributes of each vertex. A vertex belongs to one face; where faces meet, each has its own.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Mesh {
    /// Three numbers per vertex.
    pub positions: Packed,
    /// Two numbers per vertex: the octahedral projection of the outward unit normal.
    pub normals: Packed,
    /// Two numbers per vertex: (u, v).
    pub parameters: Option<Packed>,
    /// One number per vertex: index of the face.
    pub vertex_faces: Option<Packed>,
    /// Three numbers per triangle, counter-clockwise seen from outside.
    pub triangles: Packed,
    /// One number per vertex: signed deviation of the points around; NaN without points.
    pub deviation: Option<Packed>,
    /// One number per vertex: mean curvature, positive where the shape is convex seen from outside; NaN where undefined.
    pub mean_curvature: Option<Packed>,
    /// One number per vertex: Gaussian curvature; NaN where undefined.
    pub gaussian_curvature: Option<Packed>,
}

/// Lines of several kinds; empty kinds are omitted.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Lines {
    /// Edges of the faces.
    #[serde(skip_serializing_if = "Polylines::is_empty")]
    pub edges: Polylines,
    /// Seams: edges where a face meets itself.
    #[serde(skip_serializing_if = "Polylines::is_empty")]
    pub seams: Polylines,
    /// Lines of constant u or v, at knots and between.
    #[serde(skip_serializing_if = "Polylines::is_empty")]
    pub iso_curves: Polylines,
    /// Rows and columns of control points.
    #[serde(skip_serializing_if = "Polylines::is_empty")]
    pub control_net: Polylines,
}

/// Concatenated polylines.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Polylines {
    /// Three numbers per point.
    pub positions: Packed,
    /// Number of points of each polyline.
    pub lengths: Vec<u32>,
}

impl Polylines {
    /// Whether there are no polylines.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lengths.is_empty()
    }
}

/// Points of a scan, all or a sample for display; by ascending index.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Points {
    /// Number of displayed points.
    pub shown: usize,
    /// Number of all points.
    pub total: usize,
    /// Three numbers per point.
    pub positions: Packed,
    /// One number per point: signed deviation; NaN where it is not measured.
    pub deviation: Option<Packed>,
    /// One number per point: its record in the file.
    pub index: Packed,
    /// Two numbers per point: (u, v) of the foot point; NaN where it is not measured.
    pub parameters: Option<Packed>,
    /// One number per point: index of the face of the foot point.
    pub faces: Option<Packed>,
    /// One number per point: 0 interior, 1 at a free edge, 2 held out of the fit, 3 outlier, 4 in a part without a
    /// surface, 5 duplicate. Points from 3 on are not used.
    pub state: Packed,
    /// Records in the file of the points that are not finite and of empty cells of its range grid, if all points are
    /// displayed and not too many cells are empty.
    pub not_finite: Packed,
}

//! The data of the page, as its script reads them. Lengths are in the unit of the scan.

use super::source::Source;
use crate::deviation::verdict::Reason;
use base64::display::Base64Display;
use base64::engine::general_purpose::STANDARD;
use bytemuck::NoUninit;
use nurbskin_cad::SurfaceKind;
use nurbskin_fit::fit::approximate::trade::TradePoint;
use nurbskin_geometry::unit::{ShownUnit, Unit};
use serde::{Serialize, Serializer};

/// All that a page shows.
#[derive(Clone, Debug, Serialize)]
pub struct Document {
    /// Version of the library.
    pub nurbskin: &'static str,
    /// `fit`, `deviation` or `view`.
    pub kind: &'static str,
    /// What the page is about, such as the name of the scan.
    pub title: String,
    /// The command line, where there was one.
    pub command: Option<String>,
    /// The files that were read.
    pub inputs: Vec<Source>,
    /// Unit of all lengths.
    pub unit: Unit,
    /// The units in which lengths are shown.
    pub shown_in: Vec<ShownUnit>,
    /// Whether the surface is within its tolerance, where that was asked.
    pub verdict: Option<Judged>,
    /// The tolerance, where there is one.
    pub tolerance: Option<f64>,
    /// Share (0..=1) of the points that had to be within it.
    pub within: Option<f64>,
    /// Figures, ready to show.
    pub tables: Vec<Table>,
    /// The chronicle: what was repaired and decided on the way, a sentence each.
    pub details: Vec<String>,
    /// `deviation` of the verb's JSON, where there is one.
    pub statistics: Option<serde_json::Value>,
    /// Of the signed deviations of all points used.
    pub histogram: Option<Histogram>,
    /// What the size of the surface buys, of several surfaces of the first, where a fit met more than one on its way.
    pub trade: Option<Trade>,
    /// Where the deviation is largest, the worst first, apart from each other.
    pub worst: Vec<Worst>,
    /// The faces, by index.
    pub faces: Vec<FaceSummary>,
    /// Lowest and highest corner of what is shown, in the coordinates of the file.
    pub bounding_box: [[f64; 3]; 2],
    /// What positions below are relative to, in the coordinates of the file.
    pub origin: [f64; 3],
    /// The faces, or the scan's own mesh, as triangles.
    pub mesh: Option<Mesh>,
    /// Lines on and around the faces.
    pub lines: Lines,
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
    /// A sentence: the first reason, or the figures where there is none.
    pub reason: String,
    /// Why it is not `pass`, the gravest first, with places in the coordinates of the file.
    pub reasons: Vec<Reason>,
}

/// A table without a head.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Table {
    /// Its heading.
    pub title: &'static str,
    /// The cells of each row, the first of which names it.
    pub rows: Vec<Vec<String>>,
}

/// How often signed deviations are in each of many intervals of the same width.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Histogram {
    /// Where the first interval begins.
    pub low: f64,
    /// Where the last one ends: -`low`.
    pub high: f64,
    /// Numbers of points, of an odd number of intervals: zero is in the middle of one.
    pub counts: Vec<u64>,
    /// Points below the first interval.
    pub below: u64,
    /// Points above the last one.
    pub above: u64,
}

/// Deviation over control points.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trade {
    /// At least two: ascending in control points, descending in p95.
    pub points: Vec<TradePoint>,
    /// Control points of the surface that was chosen, which is one of them.
    pub chosen: usize,
    /// Control points from which on more of them buy little.
    pub knee: Option<usize>,
    /// What a looser and a tighter tolerance would take, in words.
    pub neighbours: Option<String>,
}

/// A point far from the surface.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Worst {
    /// Its index in the file.
    pub index: u32,
    /// The point, in the coordinates of the file.
    pub point: [f64; 3],
    /// The nearest place of the surface, in the coordinates of the file.
    pub foot: [f64; 3],
    /// Signed: positive outside.
    pub deviation: f64,
    /// Parameter u of the foot.
    pub u: f64,
    /// Parameter v of the foot.
    pub v: f64,
    /// Index of the face.
    pub face: u32,
    /// `interior` or `free_edge`.
    pub state: &'static str,
}

/// A face in words.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FaceSummary {
    /// Possibly empty.
    pub name: String,
    /// What its surface was in the file.
    pub kind: SurfaceKind,
    /// Degrees along u and v.
    pub degree: [usize; 2],
    /// Control points along u and v, what wraps around counted once.
    pub control_points: [usize; 2],
}

/// Triangles with what is known at each vertex. A vertex lies on one face: where faces meet there is one for each.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Mesh {
    /// Three f32 per vertex.
    pub positions: Packed,
    /// Three f32 per vertex: the outward unit normal.
    pub normals: Packed,
    /// Two f32 per vertex: (u, v).
    pub parameters: Option<Packed>,
    /// One u32 per vertex: index of the face.
    pub vertex_faces: Option<Packed>,
    /// Three u32 per triangle, counter-clockwise seen from outside.
    pub triangles: Packed,
    /// One f32 per vertex: signed deviation of the points around; NaN where there are none.
    pub deviation: Option<Packed>,
    /// One f32 per vertex: mean curvature, positive where the shape is convex seen from outside; NaN where there is none.
    pub mean_curvature: Option<Packed>,
    /// One f32 per vertex: Gaussian curvature; NaN where there is none.
    pub gaussian_curvature: Option<Packed>,
}

/// Lines of several kinds; what there is none of is left out.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Lines {
    /// Edges of the faces.
    #[serde(skip_serializing_if = "Polylines::is_empty")]
    pub edges: Polylines,
    /// Edges where a face meets itself.
    #[serde(skip_serializing_if = "Polylines::is_empty")]
    pub seams: Polylines,
    /// Lines of constant u or v, at knots and between.
    #[serde(skip_serializing_if = "Polylines::is_empty")]
    pub iso_curves: Polylines,
    /// Rows and columns of control points.
    #[serde(skip_serializing_if = "Polylines::is_empty")]
    pub control_net: Polylines,
}

/// Polylines, one after the other.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Polylines {
    /// Three f32 per point.
    pub positions: Packed,
    /// Number of points of each.
    pub lengths: Vec<u32>,
}

impl Polylines {
    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lengths.is_empty()
    }
}

/// Points of a scan, all or enough of them for the eye; by ascending index.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Points {
    /// How many.
    pub shown: usize,
    /// Of how many.
    pub total: usize,
    /// Three f32 per point.
    pub positions: Packed,
    /// One f32 per point: signed deviation; NaN of points that were left out.
    pub deviation: Option<Packed>,
    /// One u32 per point: its index in the file.
    pub index: Packed,
    /// Two f32 per point: (u, v) of the nearest place; NaN of points that were left out.
    pub parameters: Option<Packed>,
    /// One u32 per point: index of the face of the nearest place.
    pub faces: Option<Packed>,
    /// One u8 per point: 0 interior, 1 at a free edge, 2 held out of the fit, 3 rejected.
    pub state: Packed,
}

/// Numbers as bytes, little-endian; base64 in JSON.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Packed(pub Vec<u8>);

impl Packed {
    /// Of 32-bit numbers.
    fn words<T: NoUninit, const N: usize>(items: impl IntoIterator<Item = [T; N]>) -> Self {
        let mut bytes = Vec::new();
        for item in items {
            for word in &item {
                let start = bytes.len();
                bytes.extend_from_slice(bytemuck::bytes_of(word));
                if cfg!(target_endian = "big") {
                    bytes[start..].reverse();
                }
            }
        }
        Self(bytes)
    }

    /// Groups of f32.
    pub fn floats<const N: usize>(items: impl IntoIterator<Item = [f32; N]>) -> Self {
        Self::words(items)
    }

    /// Groups of u32.
    pub fn integers<const N: usize>(items: impl IntoIterator<Item = [u32; N]>) -> Self {
        Self::words(items)
    }
}

impl Serialize for Packed {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&Base64Display::new(&self.0, &STANDARD))
    }
}

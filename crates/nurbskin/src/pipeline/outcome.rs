//! The result of a fit with all measured figures; its serialisation is the JSON contract of the command.
//!
//! The structures here define the keys of that JSON. A change of meaning increments [`SCHEMA`]; new keys do not. Fields
//! without a serialisation (points, model, surfaces) serve callers of the library.

use super::{FitCheck, PerPoint, WorstPoint};
use crate::deviation::coverage::Coverage;
use crate::deviation::measure::Statistics;
use crate::deviation::verdict;
use crate::deviation::verdict::Verdict;
use crate::surfacing::FaceLayout;
use glam::DVec3;
use nurbskin_cad::{JoinKind, Model};
use nurbskin_fit::chart::Topology;
use nurbskin_fit::fit::approximate::trade::{Neighbour, TradePoint};
use nurbskin_geometry::NurbsSurface;
use nurbskin_geometry::unit::{Unit, UnitSource};
use nurbskin_scan::{Reason, Rejected};
use serde::{Deserialize, Serialize, Serializer};
use std::borrow::Cow;
use std::path::PathBuf;

/// The result of a fit. Lengths are in the scan's unit, angles in degrees, times in seconds.
///
/// The JSON contains the figures only; an outcome read from JSON has no points, model or surfaces.
/// [`to_bytes`](Self::to_bytes) stores all fields.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Version of the library.
    pub nurbskin: Cow<'static, str>,
    /// Version of this JSON: [`SCHEMA`].
    pub schema: u32,
    /// The scan.
    pub input: Input,
    /// Summary of the surface; for several parts, of the largest.
    pub surface: SurfaceSummary,
    /// Summary of the surface of each separate part of the scan, the largest first; omitted if there is only one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<PartSummary>,
    /// `interpolate` or `approximate`.
    pub method: Cow<'static, str>,
    /// The required tolerance; `None` without one.
    pub tolerance: Option<f64>,
    /// Required share (0..=1) of the points within it; `None` without a tolerance.
    pub within: Option<f64>,
    /// The aim of the fit: the tolerance, or without one, a distance derived from the scan.
    pub aim: Aim,
    /// The distances between surface and scan, both ways.
    pub deviation: DeviationSummary,
    /// The worst of the findings on the deviation, the check of the written files, the part of the scan with a surface,
    /// and the plausibility of units and sizes.
    pub verdict: Verdict,
    /// The first reason in words; for `pass` and `not_asked` a sentence with the figures.
    pub reason: String,
    /// The reasons against `pass`, the most serious first; empty for `pass` and `not_asked`.
    pub reasons: Vec<verdict::Reason>,
    /// Seconds per stage.
    pub time: Times,
    /// Files written.
    pub outputs: Vec<Output>,
    /// Product-data quality of the CAD files written, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub check: Option<FitCheck>,
    /// Warnings that affect the result: assumptions, doubts, points and parts left out, holes closed, options without
    /// effect.
    pub warnings: Vec<String>,
    /// Details: repairs, and the reasons for the shape of the surface.
    pub details: Vec<String>,
    /// The deviation of each used point.
    #[serde(skip)]
    pub per_point: PerPoint,
    /// The points rejected by position (outliers, parts without a surface), with their indices in the file, minus the
    /// [`origin`](Self::origin).
    #[serde(skip)]
    pub rejected: Vec<(u32, DVec3)>,
    /// The written faces, trimmed, with their edges, in the coordinates of the scan minus [`origin`](Self::origin); one
    /// shell per part.
    #[serde(skip)]
    pub model: Model,
    /// The surface of each part, or of each face of a network, in the order of the faces of the model and the
    /// coordinates of the scan minus [`origin`](Self::origin); never empty.
    #[serde(skip)]
    pub geometry: Vec<NurbsSurface>,
    /// The edges of the networks of faces; empty without a network.
    #[serde(skip)]
    pub edges: Vec<FaceEdge>,
    /// The offset that was subtracted from the scan's coordinates.
    #[serde(skip)]
    pub origin: DVec3,
}

impl Outcome {
    /// Adds the result of the check of the written files: the verdict becomes the worse of both, and the reasons those
    /// of both. Replaces the result of an earlier check of the same surface.
    pub(super) fn set_check(&mut self, check: FitCheck) {
        let mut before = None;
        if let Some(earlier) = self.check.take() {
            before = self
                .reasons
                .iter()
                .position(|r| earlier.reasons.contains(r));
            self.reasons.retain(|r| !earlier.reasons.contains(r));
        }
        if !check.reasons.is_empty() {
            let front = verdict::worse(&mut self.verdict, Verdict::Fail);
            let last = before.unwrap_or(self.reasons.len());
            let place = if front { 0 } else { last };
            let all = check.reasons.iter().cloned();
            self.reasons.splice(place..place, all);
        }
        if let Some(first) = self.reasons.first() {
            self.reason = first.words(self.input.unit);
        }
        for what in &check.not_checked {
            let said = format!("not checked: {what}");
            if !self.warnings.contains(&said) {
                self.warnings.push(said);
            }
        }
        self.check = Some(check);
    }
}

/// Version of the JSON of all verbs. It increases when a key changes its meaning; keys may be added without an
/// increase.
pub const SCHEMA: u32 = 2;

/// The aim of a fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Aim {
    /// The distance that the fit tries to keep.
    pub value: f64,
    /// `option`, or the way it was derived.
    pub source: String,
}

/// The scan that was fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Input {
    /// Its path.
    pub path: String,
    /// Its format.
    pub format: Cow<'static, str>,
    /// Points in the file.
    pub points: usize,
    /// Points used.
    pub used: usize,
    /// Points not used, by reason.
    pub rejected: RejectedCounts,
    /// `grid`, `rows`, `unordered` or `mesh`.
    pub organisation: Cow<'static, str>,
    /// Grid of the ordered scan as fitted, points along u and v.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<[usize; 2]>,
    /// Unit of all lengths.
    pub unit: Unit,
    /// Source of the unit.
    pub unit_source: UnitSource,
    /// Lowest and highest corner of the box around the points used, in the file's coordinates.
    pub bounding_box: [[f64; 3]; 2],
    /// Typical distance between neighbouring points; `None` for too few points.
    pub spacing: Option<f64>,
    /// Standard deviation of the noise; `None` where the points are too few, or too sparse, for an estimate.
    pub noise: Option<f64>,
    /// Objects in front of a background or on a support: with any, the scan is a scene and not a single surface.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub scene_objects: usize,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// Number of points not used, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RejectedCounts {
    /// NaN or infinite.
    pub non_finite: usize,
    /// Repeated coordinates.
    pub duplicate: usize,
    /// Too far from the surface.
    pub outlier: usize,
    /// In a separate part without a surface.
    pub left_out: usize,
}

impl RejectedCounts {
    /// The counts of a list.
    #[must_use]
    pub fn of(rejected: &[Rejected]) -> Self {
        let count = |reason| rejected.iter().filter(|r| r.reason == reason).count();
        Self {
            non_finite: count(Reason::NonFinite),
            duplicate: count(Reason::Duplicate),
            outlier: count(Reason::Outlier),
            left_out: count(Reason::LeftOut),
        }
    }
}

/// Figures of the surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SurfaceSummary {
    /// One surface, or a network of faces.
    #[serde(default = "single")]
    pub layout: FaceLayout,
    /// Topology of its domain, or of the network; `None` for a network of another topology.
    pub topology: Option<Topology>,
    /// Degrees along u and v.
    pub degree: [usize; 2],
    /// Control points along u and v; those that wrap around count once. Of a network, one number: their total.
    pub control_points: Vec<usize>,
    /// Whether weights are present.
    pub rational: bool,
    /// Which directions are closed; of a network, whether it is.
    pub closed: Closed,
    /// Which directions are periodic.
    pub periodic: [bool; 2],
    /// Whether the surface is trimmed.
    pub trimmed: bool,
    /// Grid lines kept by rarefaction, along u and v.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kept: Option<[usize; 2]>,
    /// Parameterization of an interpolation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parameters: Option<Cow<'static, str>>,
    /// Variation of its mean curvature ([`nurbskin_cad::curvature_variation`]): dimensionless, 0 for planes, cylinders
    /// and spheres.
    #[serde(default)]
    pub curvature_variation: f64,
    /// The surfaces of the search and the chosen one with its measured deviation, ascending in control points,
    /// descending in p95. The chosen surface alone if there was no search: ordered scans that are interpolated or
    /// rarefied, and surfaces of revolution.
    #[serde(default)]
    pub trade: Vec<TradePoint>,
    /// The number of control points at the knee of the curve, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub knee: Option<usize>,
    /// Estimated control points for a looser and a tighter tolerance, where available.
    #[serde(default)]
    pub neighbours: Vec<Neighbour>,
    /// The reason why the fit ended, if it ended before it reached its aim.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ended: Option<String>,
    /// Number of faces of a network.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub faces: Option<usize>,
    /// Control points of a network; those that faces share count once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub control_points_total: Option<usize>,
    /// Edges of a network, by kind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edges: Option<EdgeCounts>,
    /// Angles between the normals of neighbouring faces along the smooth edges of a network.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal_jump: Option<JumpFigures>,
    /// Number of handles of a network.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub genus: Option<usize>,
    /// Number of borders of a network.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub borders: Option<usize>,
}

/// The layout of an outcome of a version without networks.
fn single() -> FaceLayout {
    FaceLayout::Single
}

/// What closes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Closed {
    /// The directions u and v of a surface.
    Directions([bool; 2]),
    /// A network, where it has no border.
    Network(bool),
}

/// Numbers of edges of a network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EdgeCounts {
    /// Edges whose two faces share the normal.
    pub smooth: usize,
    /// Edges on feature lines.
    pub sharp: usize,
    /// Edges with one face.
    pub border: usize,
}

/// Angles between normals across the smooth edges of a network, in degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JumpFigures {
    /// 95 % of the length of the edges have a smaller angle.
    pub p95: f64,
    /// 99 % of the length of the edges have a smaller angle.
    #[serde(default)]
    pub p99: f64,
    /// The largest angle, sampled.
    pub max: f64,
    /// A bound that no angle exceeds, between the samples too; `None` where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bound: Option<f64>,
    /// Share of the length with an angle over 0.1 degrees, 0 to 1.
    #[serde(default)]
    pub over_tenth: f64,
    /// Share of the length with an angle over 0.5 degrees, 0 to 1.
    #[serde(default)]
    pub over_half: f64,
}

/// An edge of a network.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaceEdge {
    /// Its index in the model.
    pub edge: usize,
    /// How its faces join.
    pub kind: JoinKind,
    /// The largest angle between the normals of its two faces, in degrees: a bound where one is known. `None` at a
    /// border.
    pub jump: Option<f64>,
}

/// One of several separate parts of a scan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartSummary {
    /// Its surface.
    pub surface: SurfaceSummary,
    /// Points used.
    pub points: usize,
    /// Distance of its points to its surface.
    pub scan_to_surface: Statistics,
    /// Whether the part is within the tolerance.
    pub verdict: Verdict,
    /// The first reason in words, or a sentence with the figures.
    pub reason: String,
    /// The reasons against `pass`; empty for `pass`.
    pub reasons: Vec<verdict::Reason>,
}

/// Deviation both ways.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviationSummary {
    /// Distance of every used point to the surface.
    pub scan_to_surface: Statistics,
    /// Distance of the surface to the scan.
    pub surface_to_scan: Coverage,
    /// Distance of the points whose foot point is on a free boundary of the surface; `scan_to_surface` includes them.
    pub free_edges: Statistics,
    /// Distance of the points that were held out of the fit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hold_out: Option<Statistics>,
    /// Distance of every finite point of the file: those used and those not used, such as outliers and duplicates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub all_points: Option<Statistics>,
    /// The ten points farthest from the surface, separated from each other; the worst first.
    pub worst: Vec<WorstPoint>,
}

/// Seconds per stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Times {
    /// Reading the file.
    pub read: f64,
    /// Cleaning.
    pub clean: f64,
    /// Finding the order, or charting.
    pub order: f64,
    /// Alignment of the scan to the model, if requested.
    #[serde(default)]
    pub align: f64,
    /// Rarefaction.
    pub rarefy: f64,
    /// Enrichment.
    pub enrich: f64,
    /// Parameters, knots and solves.
    pub fit: f64,
    /// Measuring the deviation.
    pub deviation: f64,
    /// Writing the files.
    pub write: f64,
    /// Total time.
    pub total: f64,
}

/// A file that was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Output {
    /// Its path.
    #[serde(serialize_with = "display_path")]
    pub path: PathBuf,
    /// Its format.
    pub format: Cow<'static, str>,
    /// Its size.
    pub bytes: u64,
    /// Whether it replaced an existing file.
    #[serde(default)]
    pub replaced: bool,
    /// The content of an output in memory; see [`Target::Memory`](super::Target::Memory).
    #[serde(skip)]
    pub content: Option<Vec<u8>>,
}

/// A path as text; other bytes than Unicode are replaced.
pub(crate) fn display_path<S: Serializer>(
    path: &std::path::Path,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&path.display())
}

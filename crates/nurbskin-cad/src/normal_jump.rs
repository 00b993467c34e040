//! How far the normal turns across edges that two faces share, measured and bounded.
//!
//! Let T be the tangent of the edge, X and Y the derivatives of the two surfaces across it, so that the outward normals
//! are those of `T x X` and `T x Y`. With `q = T . (X x Y)` and `c = (T x X) . (T x Y)` the angle between them is
//! `atan2(|q| |T|, c)`, because `(T x X) x (T x Y) = q T`. On a knot span common to both faces q, c and T . T are
//! polynomials, and their Bernstein coefficients bound them. Spans are halved until the bound is close to what samples
//! show. So the bound holds everywhere on the edge, between the samples too.
//!
//! That needs polynomial surfaces and p-curves that are straight lines of constant u or v, run through evenly: the
//! edges of a network of faces. Others get samples only.

mod bernstein;
mod rim;
mod samples;

use crate::model::Model;
use bernstein::{Jump, Sample};
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::each;
use serde::{Deserialize, Serialize};

/// Bounds are refined until they are this many times the largest sample of the edge.
/// Guard: closer costs more, and changes no decision.
const RATIO: f64 = 1.05;
/// ... or below this many degrees. Derived: a tenth of the 0.1 degrees that `cad::check` allows at smooth edges.
const FLOOR: f64 = 0.01;
/// Edges are meant to be smooth where most of their length turns by less, in degrees. Guard: well above the jumps of a
/// fitted smooth edge, and well below the 25 degrees from which a layout follows sharp lines. Not tried on files of
/// other origin, whose edges of a few degrees may be meant either way.
pub const MEANT_SMOOTH: f64 = 5.0;
/// Shares of the length are given over these angles, in degrees. Derived: the limits of `edge_tangency` and of
/// `normal_jump` in `cad::check`.
const OVER: [f64; 2] = [0.1, 0.5];

/// How the faces at an edge join.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JoinKind {
    /// Two faces that are meant to have the same normals.
    Smooth,
    /// Two faces that meet in a feature line.
    Sharp,
    /// One face: a border.
    Open,
}

impl JoinKind {
    /// `smooth`, `sharp` or `open`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            JoinKind::Smooth => "smooth",
            JoinKind::Sharp => "sharp",
            JoinKind::Open => "open",
        }
    }
}

/// Which edges are meant to be smooth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Meant<'a> {
    /// The kind of each edge of the model. Edges beyond the list are judged by [`MEANT_SMOOTH`].
    Kinds(&'a [JoinKind]),
    /// Those whose normals turn by less than this on most of their length, in degrees.
    Below(f64),
}

impl Default for Meant<'_> {
    /// By [`MEANT_SMOOTH`]: for files, which do not have the kind of an edge.
    fn default() -> Self {
        Meant::Below(MEANT_SMOOTH)
    }
}

/// The angle between the normals at an edge that two faces share. Angles are in degrees.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeJump {
    /// Index of the edge.
    pub edge: usize,
    /// Indices of the faces; the same twice at a seam.
    pub faces: [usize; 2],
    /// Smooth or sharp.
    pub kind: JoinKind,
    /// Length of the edge, by its samples.
    pub length: f64,
    /// The largest angle among the samples.
    pub sampled: f64,
    /// Where that is.
    pub place: DVec3,
    /// No angle on the edge exceeds this; `None` where only samples were taken. 180 where a normal vanishes.
    pub bound: Option<f64>,
    /// Angles along the edge, each with the length that it stands for.
    samples: Vec<[f64; 2]>,
}

/// Figures of all smooth edges of a model. Angles are in degrees, quantiles and shares by length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct JumpSummary {
    /// Number of edges between two faces that are meant to be smooth.
    pub smooth: usize,
    /// Number of edges between two faces that are not.
    pub sharp: usize,
    /// Number of edges of one face.
    pub open: usize,
    /// Length of the smooth edges.
    pub length: f64,
    /// 95 % of the length are below this angle.
    pub p95: f64,
    /// 99 % of the length are below this angle.
    pub p99: f64,
    /// The largest angle among the samples.
    pub max: f64,
    /// No angle exceeds this; `None` where an edge has no bound.
    pub bound: Option<f64>,
    /// Share of the length over 0.1 degrees.
    pub over_tenth: f64,
    /// Share of the length over 0.5 degrees.
    pub over_half: f64,
}

/// The angles between normals at all shared edges of a model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NormalJumps {
    /// Edges that exactly two uses share, by index.
    pub edges: Vec<EdgeJump>,
    /// Figures of those that are smooth.
    pub summary: JumpSummary,
}

impl NormalJumps {
    /// The smooth edge with the largest angle.
    #[must_use]
    pub fn worst(&self) -> Option<&EdgeJump> {
        let smooth = self.edges.iter().filter(|e| e.kind == JoinKind::Smooth);
        smooth.max_by(|a, b| a.reach().total_cmp(&b.reach()))
    }

    /// The smooth edges with a sample above an angle in degrees.
    pub fn smooth_above(&self, angle: f64) -> impl Iterator<Item = &EdgeJump> {
        let smooth = self.edges.iter().filter(|e| e.kind == JoinKind::Smooth);
        smooth.filter(move |e| e.sampled > angle)
    }
}

impl EdgeJump {
    /// The bound, or the largest sample where there is none.
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.bound.unwrap_or(self.sampled)
    }
}

/// Measures the angle between normals at every edge that two faces share. O(knot spans along the edges).
///
/// Faces that use an edge in the same direction look to opposite sides; the normal of one is then turned over.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_cad::{Meant, Model, normal_jumps};
/// use nurbskin_geometry::nurbs::conic;
/// let mut model = Model::new("ring");
/// model.add_whole_surface(&conic::torus(DVec3::ZERO, DVec3::Z, 30.0, 10.0)?, 1e-9)?;
/// let jumps = normal_jumps(&model, Meant::default());
/// assert_eq!(jumps.summary.smooth, 2);
/// assert!(jumps.summary.max < 1e-6);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[must_use]
pub fn normal_jumps(model: &Model, meant: Meant<'_>) -> NormalJumps {
    let mut uses: Vec<Vec<[usize; 3]>> = vec![Vec::new(); model.edges().len()];
    for (k, face) in model.faces().iter().enumerate() {
        for (l, each) in face.loops.iter().enumerate() {
            for (m, used) in each.uses.iter().enumerate() {
                uses[used.edge].push([k, l, m]);
            }
        }
    }
    let real = |k: usize| model.edges()[k].curve.is_some();
    let open = (0..uses.len()).filter(|&k| real(k) && uses[k].len() == 1);
    let open = open.count();
    let shared: Vec<usize> = (0..uses.len())
        .filter(|&k| real(k) && uses[k].len() == 2)
        .collect();
    let edges = each(shared.len(), |i| {
        let k = shared[i];
        of_edge(model, k, [uses[k][0], uses[k][1]], meant)
    });
    let edges: Vec<EdgeJump> = edges.into_iter().flatten().collect();
    let summary = summary(&edges, open);
    NormalJumps { edges, summary }
}

/// One edge; `None` where nothing could be measured.
fn of_edge(model: &Model, k: usize, uses: [[usize; 3]; 2], meant: Meant<'_>) -> Option<EdgeJump> {
    let curve = model.edges()[k].curve.as_ref()?;
    let strips = uses.map(|[face, l, m]| {
        let face = &model.faces()[face];
        rim::strip(face, &face.loops[l].uses[m], curve.domain())
    });
    let senses = uses.map(|[f, l, m]| {
        let face = &model.faces()[f];
        face.loops[l].uses[m].reversed != face.reversed
    });
    let flip = senses[0] == senses[1];
    let (samples, bound) = match strips {
        [Some(one), Some(two)] => {
            let mut jump = Jump::default();
            for (range, pair) in rim::common(&one, &two) {
                jump.add(range, &pair, flip);
            }
            let bound = jump.bound(RATIO, FLOOR);
            (jump.samples, Some(bound))
        }
        _ => (samples::along(model, k, uses, flip), None),
    };
    let largest = samples.iter().max_by(|a, b| a.angle.total_cmp(&b.angle))?;
    let (a, b) = curve.domain();
    let place = curve.point(a + largest.at * (b - a));
    let length = samples.iter().map(|s| s.length).sum();
    let sampled = largest.angle;
    let samples: Vec<[f64; 2]> = samples.iter().map(|s| [s.angle, s.length]).collect();
    let judged = |limit: f64| {
        if quantile(&mut samples.clone(), 0.5) < limit {
            JoinKind::Smooth
        } else {
            JoinKind::Sharp
        }
    };
    let kind = match meant {
        Meant::Kinds(kinds) => kinds.get(k).map_or_else(|| judged(MEANT_SMOOTH), |k| *k),
        Meant::Below(limit) => judged(limit),
    };
    Some(EdgeJump {
        edge: k,
        faces: [uses[0][0], uses[1][0]],
        kind,
        length,
        sampled,
        place,
        bound,
        samples,
    })
}

/// The angle below which a share of the length is, of pairs of angle and length, which are sorted; 0 for none.
fn quantile(samples: &mut [[f64; 2]], share: f64) -> f64 {
    samples.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let total: f64 = samples.iter().map(|s| s[1]).sum();
    let mut sum = 0.0;
    for [angle, length] in &*samples {
        sum += length;
        if sum >= share * total {
            return *angle;
        }
    }
    samples.last().map_or(0.0, |s| s[0])
}

fn summary(edges: &[EdgeJump], open: usize) -> JumpSummary {
    let smooth: Vec<&EdgeJump> = edges
        .iter()
        .filter(|e| e.kind == JoinKind::Smooth)
        .collect();
    let mut samples: Vec<[f64; 2]> = smooth.iter().flat_map(|e| e.samples.clone()).collect();
    let length = samples.iter().fold(0.0, |sum: f64, s| sum + s[1]);
    let over = OVER.map(|limit| {
        let over = samples.iter().filter(|s| s[0] > limit);
        let over = over.fold(0.0, |sum: f64, s| sum + s[1]);
        if length > 0.0 { over / length } else { 0.0 }
    });
    let bound = smooth
        .iter()
        .try_fold(0.0, |most: f64, e| Some(most.max(e.bound?)));
    JumpSummary {
        smooth: smooth.len(),
        sharp: edges.len() - smooth.len(),
        open,
        length,
        p95: quantile(&mut samples, 0.95),
        p99: quantile(&mut samples, 0.99),
        max: smooth.iter().fold(0.0, |most, e| most.max(e.sampled)),
        bound,
        over_tenth: over[0],
        over_half: over[1],
    }
}

#[cfg(test)]
mod tests;

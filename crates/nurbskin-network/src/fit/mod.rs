//! Fits a network of B-spline faces to a mesh over a layout.
//!
//! The unknowns of all faces are found together by sparse least squares, again and again with new feet of the points
//! (`strategy`). Faces share the curves of their edges as functions (`network`), so that the result is watertight without
//! sewing; the jump of the normal across smooth edges is a residual (`joins`), so that it is smooth to hundredths of a degree.
//!
//! ```text
//! network   unknowns, knots, M        terms   distances, bending      strategy  the order of steps
//! insertion knots as a matrix         joins   jump of the normal      state     a fit under way
//! patch     evaluation, feet on one   stars   directions at vertices  refine    new knots
//! system    normal equations          lines   sharp and open lines    feet      feet over all faces
//! adapt     layouts by the shape        mend      folds and self-intersections    ways  how unknowns may move
//! ```
//!
//! Source: ours (docs/network.md).

mod adapt;
mod feet;
mod insertion;
mod joins;
mod lines;
mod mend;
mod network;
mod patch;
mod refine;
mod stars;
mod state;
mod strategy;
mod system;
mod terms;
mod ways;

#[cfg(test)]
mod tests;

pub use adapt::FaceSizes;
pub use network::DEGREE;

use crate::layout::{EdgeKind, Layout, OnFace, Side};
use glam::DVec3;
use mend::Mended;
use network::WIDTH;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{ControlNet, Error, NurbsCurve, NurbsSurface, Result};
use nurbskin_scan::mesh::Manifold;

/// What a network is fitted to: the points of a scan, and a mesh that shows how they hang together.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// The mesh of the layout. The network relaxes over its vertices before it follows the points.
    pub mesh: &'a Manifold,
    /// Vertices of the mesh, by index, where it passes through itself, or did before it was untangled: a sound network cannot follow the
    /// points there, and they weigh less. Those beyond the list are none of them.
    pub crossed: &'a [bool],
    /// Whether the mesh was untangled: the middles of triangles that crossed weigh as much as others then. Found by trial: with less weight a
    /// head lacks a face at 0.1 % of its diagonal.
    pub untangled: bool,
    /// The points; often, but not necessarily, the vertices of the mesh.
    pub points: &'a [DVec3],
    /// Their unit normals, on the side of those of the mesh or on the other.
    pub normals: &'a [DVec3],
    /// Standard deviation of the points across the surface, in the unit of the points.
    pub noise: f64,
}

/// What a fit is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitOptions {
    /// Largest distance of a point, in the unit of the points.
    pub tolerance: f64,
    /// Share of the points that are to be within it, 0 to 1.
    pub share_within: f64,
    /// Whether knots are added for the other points too, as long as that pays.
    pub beyond_share: bool,
    /// Whether the tolerance was requested. Regions must then be free of bias also where the noise is small beside it, as its verdict
    /// asks. Otherwise it is an aim, and the last rounds add knots only for the farthest points.
    pub requested: bool,
    /// Most control points of all faces; a round of refinement may pass it by a few.
    pub max_control_points: usize,
    /// Share of the faces that may fold or jump after the first round of refinement, 0 to 1. Beyond it the fit ends with
    /// [`Error::NoSolution`]; 1 never does.
    pub most_folding: f64,
}

/// A fitted network.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The vertices.
    pub vertices: Vec<DVec3>,
    /// The edges, in the order of the layout.
    pub edges: Vec<FittedEdge>,
    /// The faces, in the order of the layout.
    pub faces: Vec<FittedFace>,
    /// Where each point of the target lies.
    pub feet: Vec<OnFace>,
    /// Distance of each point from there, an upper bound of its distance from the network.
    pub distances: Vec<f64>,
    /// Which faces fold at one of many samples, or are the emptier one at a smooth edge whose normal turns by a degree.
    pub bad: Vec<bool>,
    /// What [`Inspect`] found, and the faces that turn over at a smooth edge.
    pub defects: Vec<FacePart>,
    /// Which faces have points beyond the tolerance that were let go to mend the network. May be empty where none were.
    pub lost: Vec<bool>,
}

/// Defects per face, after mends, beyond which whole faces cross and not only spots of them. Count.
/// Trial: first layouts of 15 simulated bodies and 12 scans. Along lines that are noise (two cans, a bowl, a face) 13 to 54 are left;
/// where a later layout is sound, at most 5.
const WIDELY: usize = 10;

impl Fitted {
    /// Whether whole faces cross. Over feature lines smaller faces cannot be expected to help then.
    #[must_use]
    pub fn crosses_widely(&self) -> bool {
        self.defects.len() > WIDELY * self.faces.len()
    }
}

/// A part of a face: a rectangle in (u, v).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacePart {
    /// Index of the face.
    pub face: u32,
    /// Lower corner, (u, v).
    pub low: [f64; 2],
    /// Upper corner, (u, v).
    pub high: [f64; 2],
}

/// Finds where a network folds or intersects itself. One part of a face for each place that counts; others than those of the
/// network are ignored. The list of defects of the network is empty then.
pub type Inspect<'i> = dyn FnMut(&Fitted) -> Result<Vec<FacePart>> + 'i;

/// A fitted edge.
#[derive(Clone, Debug)]
pub struct FittedEdge {
    /// The curve, over \[0, 1\].
    pub curve: NurbsCurve,
    /// The vertices at its ends.
    pub ends: [u32; 2],
    /// What the surface does here.
    pub kind: EdgeKind,
}

/// A fitted face.
#[derive(Clone, Debug)]
pub struct FittedFace {
    /// The surface, over the unit square; its rims are the curves of the sides, as functions.
    pub surface: NurbsSurface,
    /// Sides v = 0, u = 1, v = 1, u = 0.
    pub sides: [Side; 4],
}

/// Fits a network over the layout of a mesh to the points of a scan.
///
/// About 40 sparse least-squares problems; O(n log n) per step in the points, O(N^1.5) in the control points.
///
/// # Errors
/// [`Error::Invalid`] for a layout that does not belong to the mesh, or lists of different length; [`Error::NoSolution`]
/// if the equations cannot be solved; [`Error::Cancelled`].
pub fn fit(
    target: &Target,
    layout: &Layout,
    options: &FitOptions,
    progress: &dyn Progress,
) -> Result<Fitted> {
    check(target, options)?;
    let mut fit = strategy::relaxed(target, layout, options.tolerance, progress)?;
    strategy::run(&mut fit, target, options)?;
    finished(&fit, Mended::default())
}

/// As [`fit`], over layouts that follow the detail of the mesh: faces that do not carry the shape, or fold, before knots are
/// added are made smaller. `divide` makes a layout from the sizes of its faces at each triangle, relative to the first
/// ones; a [`Producer`](crate::layout::Producer) does. `sizes` become those of the layout taken, so that a further fit may
/// ask for smaller faces in place of bad ones. Where `inspect` finds defects, and on faces that fold or jump, the network lets go
/// of the points and becomes smoother, a few times; if it then misses the tolerance, it gets knots for the other points.
///
/// # Errors
/// As [`fit`], and those of `divide` and `inspect`.
pub fn fit_adaptive(
    target: &Target,
    divide: &mut dyn FnMut(&[f64]) -> Result<Layout>,
    sizes: &mut FaceSizes,
    inspect: &mut Inspect,
    options: &FitOptions,
    progress: &dyn Progress,
) -> Result<Fitted> {
    check(target, options)?;
    let mut fit = adapt::adapted(target, divide, sizes, options, progress)?;
    let mended = mend::mended(&mut fit, target, inspect, options)?;
    finished(&fit, mended)
}

/// [`Error::Invalid`] for targets and options without a meaning.
fn check(target: &Target, options: &FitOptions) -> Result<()> {
    if options.tolerance.is_nan() || options.tolerance <= 0.0 {
        return Err(Error::invalid(
            "the tolerance of a network must be positive",
        ));
    }
    if target.points.len() != target.normals.len() {
        return Err(Error::invalid("a network needs a normal for each point"));
    }
    Ok(())
}

/// The result of a fit.
fn finished(fit: &state::Fit, mended: Mended) -> Result<Fitted> {
    let network = &fit.network;
    let edge = |e: &network::Edge| -> Result<FittedEdge> {
        let curve = NurbsCurve::new(e.knots.clone(), network.curve_points(e), None)?;
        Ok(FittedEdge {
            curve,
            ends: e.ends,
            kind: e.kind,
        })
    };
    let face = |f: &network::Face| -> Result<FittedFace> {
        let [nu, nv] = [0, 1].map(|d| f.inner[d].len() + WIDTH);
        let net = ControlNet::from_fn(nu, nv, |i, j| f.net[j * nu + i])?;
        let [u, v] = f.knots.clone();
        Ok(FittedFace {
            surface: NurbsSurface::new(u, v, net, None)?,
            sides: f.sides,
        })
    };
    Ok(Fitted {
        vertices: network.x[..network.vertices].to_vec(),
        edges: network.edges.iter().map(edge).collect::<Result<_>>()?,
        faces: network.faces.iter().map(face).collect::<Result<_>>()?,
        feet: fit.samples.feet[..fit.counted].to_vec(),
        distances: fit.distances().to_vec(),
        bad: fit.bad_faces(),
        defects: mended.defects,
        lost: mended.lost,
    })
}

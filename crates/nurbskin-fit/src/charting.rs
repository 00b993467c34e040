//! The chart of a scan: (u, v) for every point of one cleaned part, whatever its shape.
//!
//! A sheet that projects onto its best plane takes its parameters from there, and one that bends over may be spread out in
//! the plane. Everything else is charted over a mesh:
//! the scan's own, one with fewer vertices and the same topology, or one made of its points. The topology of that mesh
//! (disk, tube, sphere or torus) follows from its genus and its borders. Where several topologies are possible, each is
//! charted and scored by a coarse fit. Holes are bridged for the layout alone.
//!
//! The decisions are ours; the methods are those of [`chart`](crate::chart).

mod base;
mod charts;
mod over_mesh;
mod part_mesh;
mod reading;
mod spread_out;

pub use self::charts::{Charts, chart};
pub use self::part_mesh::{PartMesh, mesh_of};

use crate::chart::surface_mesh::ChartQuality;
use crate::chart::{Chart, Topology};
use crate::fit::approximate::Facing;
use glam::{DVec2, DVec3};
use nurbskin_geometry::notes::Notes;
use nurbskin_scan::mesh::Manifold;

/// Root mean square stretch of a chart (1 for an isometry) above which another chart is tried. Trial: not recorded.
/// Knots along u and v then meet features of very different sizes.
const POOR_STRETCH: f64 = 3.0;
/// Share of folded triangles above which another chart is tried, and a chart over a mesh is refused in the end. Trial:
/// not recorded.
const POOR_FOLDED: f64 = 5e-3;
/// Length of a triangle's longest side, in spacings, from which places on it count as points do. Trial: not recorded. A
/// smaller one adds places between points that are close enough.
const LONG_EDGE: f64 = 2.0;
/// The same for the triangles of a mesh file. Trial: those of even vertices are 1.1 to 1.5 spacings long and hold no
/// more than their corners.
const LONG_MESH_EDGE: f64 = 1.6;
/// Most steps along a side of such a triangle. Guard: bounds the places on it to 136.
const MAX_EDGE_STEPS: f64 = 16.0;

/// What fills the domain of a chart.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Extends {
    /// The part does: its borders are the sides of the domain.
    #[default]
    No,
    /// The surface continues beyond the outline of a sheet to fill a rectangle in a plane, with these axes along u and v and
    /// across.
    OverPlane([DVec3; 3]),
    /// It continues to fill a rectangle around a sheet that was spread out, whose lengths it keeps.
    SpreadOut,
}

/// How a scan is charted.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChartOptions {
    /// The topology of the domain; chosen by the shape if absent.
    pub topology: Option<Topology>,
    /// Whether the points are the vertices of a mesh file, which are as even as its author left them.
    pub vertices: bool,
}

/// What a point of a part is to the surface over its chart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PointState {
    /// It lies over the domain; the surface is fitted to it.
    #[default]
    Charted,
    /// It lies beyond a border of the domain. The fit leaves it out; the deviation counts it.
    Beyond,
    /// It belongs to a bit of the mesh that is not part of the surface.
    Detached,
    /// The fit found it to be an outlier.
    Outlier,
}

/// A chart with its guides for the fit.
#[derive(Clone, Debug)]
pub struct Charted {
    /// The domain, and (u, v) for each point.
    pub chart: Chart,
    /// The state of each point; none is an outlier yet.
    pub states: Vec<PointState>,
    /// Places on the scan's own triangles and in the domain, where these triangles are large; they count as points do.
    pub inside: Vec<(DVec3, DVec2)>,
    /// Places where only a mesh made of the scan shows where the surface may be, as in filled holes.
    pub support: Vec<(DVec3, DVec2)>,
    /// Normals of the mesh, at its rims and inside.
    pub facing: Vec<Facing>,
    /// Whether and how the surface continues beyond the outline.
    pub extends: Extends,
    /// Whether (u, v) are the coordinates on its best plane.
    pub is_flat: bool,
    /// Repairs and choices, for the user.
    pub notes: Notes,
}

/// The states of points that lie `beyond` the borders, or on `loose` bits, which go first; the latter may be empty.
fn states(beyond: impl Iterator<Item = bool>, loose: &[bool]) -> Vec<PointState> {
    let of = |(k, beyond): (usize, bool)| match (loose.get(k), beyond) {
        (Some(true), _) => PointState::Detached,
        (_, true) => PointState::Beyond,
        (_, false) => PointState::Charted,
    };
    beyond.enumerate().map(of).collect()
}

/// Whether the chart is so poor that another one is tried.
fn is_poor_chart(quality: ChartQuality) -> bool {
    quality.stretch > POOR_STRETCH || quality.folded > POOR_FOLDED
}

/// The side of an equilateral triangle of the mean area.
fn typical_edge(mesh: &Manifold) -> f64 {
    let each = mesh.area() / mesh.triangles.len().max(1) as f64;
    (4.0 / 3.0_f64.sqrt() * each).sqrt()
}

/// Places on the triangles that are longer than the step, or on all of them, each with its parameters: there the mesh
/// shows where the surface is, and no point does.
fn places_on(
    triangles: impl Iterator<Item = ([DVec3; 3], [DVec2; 3])>,
    topology: Topology,
    step: f64,
    all: bool,
) -> Vec<(DVec3, DVec2)> {
    let mut places = Vec::new();
    for ([a, b, c], [p, q, r]) in triangles {
        let steps = steps_on([a, b, c], step);
        if steps <= 1.0 && !all {
            continue;
        }
        places.extend(middles(steps).map(|[f, g]| {
            (
                a + (b - a) * f + (c - a) * g,
                topology.within(p + (q - p) * f + (r - p) * g),
            )
        }));
    }
    places
}

/// Number of steps along the longest side of a triangle.
fn steps_on([a, b, c]: [DVec3; 3], step: f64) -> f64 {
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    (longest / step).ceil().clamp(1.0, MAX_EDGE_STEPS)
}

/// A triangle is divided into `steps` parts per side; these are the middles of the upright small triangles, along its
/// first and its last side.
fn middles(steps: f64) -> impl Iterator<Item = [f64; 2]> {
    let along = move |from: f64| {
        let next = move |at: &f64| Some(at + 1.0).filter(|at| from + at < steps);
        std::iter::successors(Some(0.0).filter(|at| from + at < steps), next)
    };
    along(0.0).flat_map(move |i| along(i).map(move |j| [i, j].map(|at| (at + 1.0 / 3.0) / steps)))
}

#[cfg(test)]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small meshes"
)]
mod tests;

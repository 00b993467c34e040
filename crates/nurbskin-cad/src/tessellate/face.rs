//! One face: what is planned for it, and its triangles.

use super::Fineness;
use super::cells::Cells;
use super::edges::Key;
use super::metric::Metric;
use crate::model::Face;
use crate::region::scale_of;
use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::nurbs::NurbsSurface;
use std::collections::BTreeMap;

/// What is known of a face before its edges are cut.
pub(super) struct Plan<'a> {
    pub(super) face: &'a Face,
    pub(super) metric: Metric,
    /// Lines of points: parameters along u and along v, each from end to end of the rectangle around the loops.
    pub(super) lines: [Vec<f64>; 2],
    /// Mean length of a unit of u and of v.
    pub(super) scale: DVec2,
    pub(super) tolerance: f64,
}

impl<'a> Plan<'a> {
    /// `None` if the lines would cross far more often than `limit` triangles allow.
    pub(super) fn new(face: &'a Face, fineness: Fineness, limit: usize) -> Result<Option<Self>> {
        let Fineness { tolerance, step } = fineness;
        let metric = Metric::new(&face.surface, step)?;
        // Where loops cover a small part of the rectangle, most crossings are of no use.
        let limit = limit.saturating_mul(8).saturating_add(64);
        let lines = metric.grid(0.98 * tolerance, rectangle(face), limit);
        Ok(lines.map(|lines| Self {
            face,
            metric,
            lines,
            scale: scale_of(&face.surface),
            tolerance,
        }))
    }
}

/// The part of the domain that holds the p-curves: a direction in which they do not extend is taken whole.
fn rectangle(face: &Face) -> [DVec2; 2] {
    let [(a, b), (c, d)] = face.surface.domain();
    let (start, end) = (DVec2::new(a, c), DVec2::new(b, d));
    let pcurves = face.loops.iter().flat_map(|each| &each.uses);
    let points = pcurves.flat_map(|used| used.pcurve.control_points());
    let [low, high] = points.fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[low, high], p| {
        [low.min(p.truncate()), high.max(p.truncate())]
    });
    let (low, high) = (low.max(start), high.min(end));
    let wide = (high - low).cmpgt(1e-9 * (end - start));
    [
        DVec2::select(wide, low, start),
        DVec2::select(wide, high, end),
    ]
}

/// The triangles of a face.
#[derive(Clone, Debug, Default)]
pub(super) struct FaceMesh {
    /// (u, v) of each vertex, and which point of the edges and vertices of the model it is, if it is one.
    pub(super) vertices: Vec<(DVec2, Option<Key>)>,
    /// Counter-clockwise in (u, v); those of the plain cells only after [`FaceMesh::fill`].
    pub(super) triangles: Vec<[usize; 3]>,
    /// The cells between the lines that are two triangles each.
    pub(super) cells: Cells,
    /// Vertices at crossings of the lines.
    pub(super) nodes: BTreeMap<usize, usize>,
    /// Points that are at one place of the parameter plane.
    pub(super) same: Vec<[Key; 2]>,
    /// How far triangles may miss the surface.
    pub(super) bound: f64,
    /// Intervals of edges, (edge, number), that are too long for this face.
    pub(super) splits: Vec<(usize, usize)>,
    /// Pairs of vertices, the smaller first, that a loop joins; sorted.
    pub(super) borders: Vec<[usize; 2]>,
    /// Why there are no triangles.
    pub(super) fault: Option<String>,
    pub(super) too_many: bool,
}

impl FaceMesh {
    /// Whether a loop joins two vertices.
    pub(super) fn is_border(&self, a: usize, b: usize) -> bool {
        self.borders.binary_search(&[a.min(b), a.max(b)]).is_ok()
    }

    /// Number of triangles, those of the plain cells included.
    pub(super) fn count(&self) -> usize {
        self.triangles.len() + 2 * self.cells.count()
    }

    /// Adds the vertices and triangles of the plain cells; tells point and normal of the surface at every vertex.
    pub(super) fn fill(&mut self, plan: &Plan) -> Vec<(DVec3, DVec3)> {
        let mut number = vec![usize::MAX; self.cells.node_count()];
        for (&node, &vertex) in &self.nodes {
            number[node] = vertex;
        }
        for node in self.cells.plain().flat_map(|c| self.cells.corners(c)) {
            if number[node] == usize::MAX {
                number[node] = self.vertices.len();
                let [i, j] = self.cells.place(node);
                let place = DVec2::new(plan.lines[0][i], plan.lines[1][j]);
                self.vertices.push((place, None));
            }
        }
        let surface = &plan.face.surface;
        let least = 1e-9 * plan.scale.element_product();
        let samples = each(self.vertices.len(), |k| {
            sample(surface, self.vertices[k].0, least)
        });
        self.triangles.reserve(2 * self.cells.count());
        for cell in self.cells.plain() {
            let [a, b, c, d] = self.cells.corners(cell).map(|node| number[node]);
            let length = |x: usize, y: usize| samples[x].0.distance_squared(samples[y].0);
            // The shorter diagonal.
            self.triangles.extend(if length(a, c) <= length(b, d) {
                [[a, b, c], [a, c, d]]
            } else {
                [[a, b, d], [b, c, d]]
            });
        }
        samples
    }
}

/// The point and normal at a place; where `S_u` x `S_v` is all but nothing, the normal a little further inside.
fn sample(surface: &NurbsSurface, place: DVec2, least: f64) -> (DVec3, DVec3) {
    let d = surface.derivatives(place.x, place.y);
    let cross = d.du.cross(d.dv);
    if cross.length() > least {
        return (d.point, cross.normalize_or_zero());
    }
    let [(a, b), (c, end)] = surface.domain();
    let inside = place.lerp(DVec2::new(a, c).midpoint(DVec2::new(b, end)), 1e-4);
    let normal = surface.normal(inside.x, inside.y);
    (d.point, normal.unwrap_or_default())
}

//! (u, v) of points near a charted mesh.
//!
//! A point takes the parameters of its foot point on the nearest triangle, linear in the barycentric coordinates. Given
//! a normal n, a triangle with `n · n_t > 0` is preferred if it is at most six mean edges farther, so that the walls of a
//! thin pot are told apart. Next to a pole, v is that of the ray from the pole.
//!
//! Points in spatial order share their searches: all triangles that can be nearest to one of a group lie within a
//! common distance of its box.

use super::chart::MeshChart;
use super::sides::{NONE, Sides};
use crate::chart::Chart;
use glam::{DVec2, DVec3};
use nurbskin_geometry::numeric::parallel::by_index;
use nurbskin_geometry::spatial::morton::spatial_order;
use nurbskin_geometry::spatial::nearest::{Nearest, OnTriangle};
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::mesh::Manifold;
use rayon::prelude::*;

/// Points that one task places. Guard: large against the cost of a task, small against a scan.
const POINTS_PER_TASK: usize = 4096;
/// Points that share one search for triangles. Trial: not recorded. More share larger boxes with more triangles, fewer
/// repeat the search.
const POINTS_PER_SEARCH: usize = 16;
/// Most blocks of up to eight triangles that a shared search may yield; with more, each point searches alone. Guard:
/// testing many blocks costs more than a search.
const MAX_SHARED_BLOCKS: usize = 64;
/// Largest additional distance of a triangle that faces the right way, in mean edges. Trial: not recorded. A smaller
/// one takes the wrong wall of a thin pot, a larger one jumps where normals are wrong.
const MAX_FACING_DETOUR: f64 = 6.0;
/// Barycentric weight of the opposite corner up to which a place lies on a side. Guard: above rounding.
const ON_SIDE_WEIGHT: f64 = 1e-9;

/// Points with their place in a chart.
#[derive(Clone, Debug, Default)]
pub struct Placement {
    /// (u, v) of each point: that of the nearest place on the mesh.
    pub parameters: Vec<DVec2>,
    /// Distance of each point beyond an open border, along the surface; 0 for all others.
    pub beyond: Vec<f64>,
    /// Distance of each point to the mesh.
    pub distances: Vec<f64>,
}

impl MeshChart {
    /// Places points by the nearest triangle of `mesh`, which must be the charted mesh. Given normals, triangles that
    /// face the same side are preferred within a few edges, so that the walls of a thin pot are told apart. O(m log m +
    /// n log n) for m points and n triangles; about 1 us per point.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the mesh is not the charted one, or if the numbers of normals and points differ.
    pub fn place(
        &self,
        mesh: &Manifold,
        points: &[DVec3],
        normals: Option<&[DVec3]>,
    ) -> Result<Placement> {
        let exists = |t: &[u32; 3]| t.iter().all(|&k| (k as usize) < mesh.points.len());
        if mesh.triangles.len() != self.corners.len()
            || mesh.points.len() != self.places.len()
            || !mesh.triangles.iter().all(exists)
        {
            return Err(Error::invalid("the chart is of another mesh"));
        }
        if normals.is_some_and(|n| n.len() != points.len()) {
            return Err(Error::invalid("a normal is needed for each point or none"));
        }
        let placer = Placer::new(self, mesh);
        // Neighbours are placed one after another: the triangle of one is a good start for the next, and it is in the
        // cache.
        let order = spatial_order(points, |_| true);
        let chunk = |places: &[u32]| {
            let mut search = Search::default();
            let mut placed = Vec::with_capacity(places.len());
            for group in places.chunks(POINTS_PER_SEARCH) {
                search.around(&placer.nearest, group.iter().map(|&k| points[k as usize]));
                for &k in group {
                    let p = points[k as usize];
                    let normal = normals.map(|n| n[k as usize]);
                    let hit = placer.facing(p, normal, search.nearest(&placer.nearest, p));
                    placed.push(
                        hit.map_or((DVec2::ZERO, f64::INFINITY, f64::INFINITY), |h| {
                            let (parameter, out) = placer.parameter(&h);
                            (parameter, placer.beyond(&h, p) + out, h.distance)
                        }),
                    );
                }
            }
            placed
        };
        let placed: Vec<Vec<(DVec2, f64, f64)>> =
            order.par_chunks(POINTS_PER_TASK).map(chunk).collect();
        let placed = by_index(&order, &placed, POINTS_PER_TASK);
        Ok(Placement {
            parameters: placed.iter().map(|p| p.0).collect(),
            beyond: placed.iter().map(|p| p.1).collect(),
            distances: placed.iter().map(|p| p.2).collect(),
        })
    }

    /// The chart of placed points.
    #[must_use]
    pub fn chart_of(&self, parameters: Vec<DVec2>) -> Chart {
        Chart {
            topology: self.topology,
            parameters,
            size: self.size,
            reason: self.reason.clone(),
        }
    }
}

/// The search for the nearest triangles of points that lie together.
#[derive(Default)]
struct Search {
    /// The triangle that was found last.
    near: Option<u32>,
    /// The blocks with all triangles that may be nearest to one of the points.
    blocks: Vec<u32>,
}

impl Search {
    /// Prepares the search for a group of points; only finite ones count. No point is farther from the mesh than from
    /// the triangle nearest to the middle of the group.
    fn around(&mut self, mesh: &Nearest, points: impl Iterator<Item = DVec3> + Clone) {
        let points = points.filter(|p| p.is_finite());
        let corners = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let grown = |(low, high): (DVec3, DVec3), p: DVec3| (low.min(p), high.max(p));
        let (low, high) = points.clone().fold(corners, grown);
        self.blocks.clear();
        let Some(hit) = mesh.on_triangles(0.5 * (low + high), None, self.near, f64::INFINITY)
        else {
            return;
        };
        self.near = Some(hit.item);
        let reach = points
            .map(|p| mesh.to_item(p, hit.item))
            .fold(0.0, f64::max);
        mesh.within([low, high], reach, &mut self.blocks);
    }

    fn nearest(&mut self, mesh: &Nearest, point: DVec3) -> Option<OnTriangle> {
        let hit = match self.blocks.len() {
            1..=MAX_SHARED_BLOCKS => mesh.on_blocks(point, self.near, &self.blocks)?,
            _ => mesh.on_triangles(point, None, self.near, f64::INFINITY)?,
        };
        self.near = Some(hit.item);
        Some(hit)
    }
}

/// The mesh, its chart and the search structure.
struct Placer<'a> {
    chart: &'a MeshChart,
    mesh: &'a Manifold,
    nearest: Nearest,
    partner: Vec<u32>,
    /// Vertices on a border.
    border: Vec<bool>,
    /// Largest additional distance of a triangle that faces the right way.
    farther: f64,
}

impl<'a> Placer<'a> {
    fn new(chart: &'a MeshChart, mesh: &'a Manifold) -> Self {
        let sides = Sides::new(&mesh.triangles);
        let mut border = vec![false; mesh.points.len()];
        let mut length = 0.0;
        for &side in &sides.edges {
            let [a, b] = super::sides::ends(&mesh.triangles, side).map(|k| k as usize);
            length += mesh.points[a].distance(mesh.points[b]);
            if sides.partner[side as usize] == NONE {
                border[a] = true;
                border[b] = true;
            }
        }
        Self {
            chart,
            mesh,
            nearest: Nearest::new(&mesh.points, Some(&mesh.triangles)).with_walls(),
            farther: MAX_FACING_DETOUR * length / sides.edges.len().max(1) as f64,
            partner: sides.partner,
            border,
        }
    }

    fn normal(&self, triangle: u32) -> DVec3 {
        let corners = self.mesh.triangles.get(triangle as usize);
        corners.map_or(DVec3::ZERO, |t| {
            let [a, b, c] = t.map(|k| self.mesh.points[k as usize]);
            (b - a).cross(c - a)
        })
    }

    /// The nearest place; if its triangle faces the other side, a place a little farther whose triangle does not.
    fn facing(
        &self,
        point: DVec3,
        normal: Option<DVec3>,
        nearest: Option<OnTriangle>,
    ) -> Option<OnTriangle> {
        let hit = nearest?;
        match normal {
            Some(normal) if self.normal(hit.triangle).dot(normal) <= 0.0 => {
                let within = hit.distance + self.farther;
                let facing = self.nearest.on_triangles(point, Some(normal), None, within);
                facing.or(Some(hit))
            }
            _ => Some(hit),
        }
    }

    /// (u, v) of a hit, linear over the triangle. Next to a pole, u is linear and v is that of the ray from the pole.
    /// On the tip of a ragged rim, (u, v) is clamped to the border, and the second number is the distance outside.
    fn parameter(&self, hit: &OnTriangle) -> (DVec2, f64) {
        let t = hit.triangle as usize;
        let (Some(corners), Some(vertices)) =
            (self.chart.corners.get(t), self.mesh.triangles.get(t))
        else {
            return (DVec2::ZERO, f64::INFINITY);
        };
        let w = hit.weights;
        let mut at = w[0] * corners[0] + w[1] * corners[1] + w[2] * corners[2];
        let is_pole = |k: &usize| self.chart.poles.is_some_and(|p| p.contains(&vertices[*k]));
        if let Some(k) = (0..3).find(is_pole) {
            let (b, c) = ((k + 1) % 3, (k + 2) % 3);
            if w[b] + w[c] > 0.0 {
                at.y = (w[b] * corners[b].y + w[c] * corners[c].y) / (w[b] + w[c]);
            }
        }
        let closed = self.chart.topology.closed();
        let inside = self.chart.topology.within(at);
        let out = |x: f64, closed: bool, size: f64| {
            if closed {
                0.0
            } else {
                (x - x.clamp(0.0, 1.0)) * size
            }
        };
        let [length, width] = self.chart.size;
        let off = DVec2::new(out(at.x, closed[0], length), out(at.y, closed[1], width));
        (inside, off.length())
    }

    /// Distance of a point beyond the border, if its foot point lies on a border.
    fn beyond(&self, hit: &OnTriangle, point: DVec3) -> f64 {
        let t = hit.triangle as usize;
        let Some(vertices) = self.mesh.triangles.get(t) else {
            return 0.0;
        };
        let on = |k: usize| hit.weights[k] <= ON_SIDE_WEIGHT;
        // Side s is opposite corner s + 2.
        let on_border_side =
            (0..3).any(|s| on((s + 2) % 3) && self.partner.get(3 * t + s) == Some(&NONE));
        let at_border_corner =
            (0..3).any(|k| on((k + 1) % 3) && on((k + 2) % 3) && self.border[vertices[k] as usize]);
        if !on_border_side && !at_border_corner {
            return 0.0;
        }
        let p = vertices.map(|k| self.mesh.points[k as usize]);
        let foot = hit.weights[0] * p[0] + hit.weights[1] * p[1] + hit.weights[2] * p[2];
        let normal = self.normal(hit.triangle).normalize_or_zero();
        (point - foot).reject_from_normalized(normal).length()
    }
}

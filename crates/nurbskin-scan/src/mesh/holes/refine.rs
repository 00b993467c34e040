//! Refinement of a patch to the edge lengths around it.
//!
//! The wanted edge length at a corner of the rim is the mean of its two edges, and grows by 0.25 per distance from it.
//! A triangle is split at its centroid c if √2 |c - v| exceeds the wanted length for all its corners v; edges then
//! flip towards the Delaunay criterion (the two opposite angles add to at most π).
//!
//! Source: P. Liepa, *Filling holes in meshes*, 2003; the growth towards the middle is ours.

use super::patch::Patch;
use crate::mesh::manifold::{NONE, after, before, opposite_sides};
use glam::DVec3;
use nurbskin_geometry::math;
use std::collections::HashSet;

/// Growth of the wanted edge length per distance from the rim. Trial: not recorded. 0 refines to the edge length of the
/// rim throughout; larger values coarsen the middle.
const EDGE_GROWTH: f64 = 0.25;
/// A triangle is split if the distance of its centroid from each corner, times this factor, exceeds the wanted edge
/// length. Source: Liepa 2003, √2.
const DENSITY_FACTOR: f64 = std::f64::consts::SQRT_2;
/// Most rounds of splitting; each may triple the triangles. Guard: a round that splits nothing ends the loop before.
const MAX_SPLIT_ROUNDS: usize = 24;
/// Points of a patch per corner of the rim above which nothing is split. Guard: [`EDGE_GROWTH`] keeps the number far
/// below.
const MAX_POINTS_PER_CORNER: usize = 64;
/// Most edge flips per triangle in one relaxation. Guard: on surfaces that are not flat an edge could flip for ever.
const FLIPS_PER_TRIANGLE: usize = 8;
/// Angle by which the sum of the opposite angles must exceed π for an edge to flip. Guard: rounding must not flip the
/// edges of four points on a circle for ever.
const FLIP_SLACK: f64 = 1e-6;

/// Splits triangles that are large against the edges of the rim, and flips edges towards the Delaunay criterion.
pub(super) fn refine(patch: &mut Patch, joined: &dyn Fn(usize, usize) -> bool) {
    let rim = patch.rim;
    let mut wanted: Vec<f64> = (0..rim)
        .map(|k| {
            let p = patch.points[k];
            let before = p.distance(patch.points[(k + rim - 1) % rim]);
            0.5 * (before + p.distance(patch.points[(k + 1) % rim]))
        })
        .collect();
    wanted.resize(patch.points.len(), f64::INFINITY);
    let mut mesh = Mesh::new(std::mem::take(&mut patch.triangles), rim, joined);
    mesh.relax(&patch.points, (0..3 * mesh.count()).collect());
    for _ in 0..MAX_SPLIT_ROUNDS {
        let mut changed = Vec::new();
        for t in 0..mesh.triangles.len() {
            if patch.points.len() > MAX_POINTS_PER_CORNER * rim {
                break;
            }
            let corners = mesh.triangles[t].map(|k| k as usize);
            let middle = corners.iter().map(|&k| patch.points[k]).sum::<DVec3>() / 3.0;
            let far = corners.map(|k| middle.distance(patch.points[k]));
            let size = corners
                .iter()
                .zip(far)
                .map(|(&k, far)| wanted[k] + EDGE_GROWTH * far)
                .fold(f64::INFINITY, f64::min);
            let large = |(&k, far): (&usize, f64)| {
                DENSITY_FACTOR * far > size
                    && (DENSITY_FACTOR * far > wanted[k] || wanted[k].is_infinite())
            };
            if size.is_finite() && corners.iter().zip(far).all(large) {
                changed.extend(mesh.split(t, patch.points.len()));
                patch.points.push(middle);
                wanted.push(size);
            }
        }
        if changed.is_empty() {
            break;
        }
        mesh.relax(&patch.points, changed);
    }
    patch.triangles = mesh.triangles;
}

/// Triangles whose edges can be flipped.
struct Mesh<'a> {
    triangles: Vec<[u32; 3]>,
    opposite: Vec<u32>,
    edges: HashSet<(u32, u32)>,
    rim: u32,
    joined: &'a dyn Fn(usize, usize) -> bool,
}

impl<'a> Mesh<'a> {
    fn new(triangles: Vec<[u32; 3]>, rim: usize, joined: &'a dyn Fn(usize, usize) -> bool) -> Self {
        let mut mesh = Self {
            opposite: opposite_sides(&triangles),
            edges: HashSet::new(),
            rim: u32::try_from(rim).unwrap_or(NONE),
            joined,
            triangles,
        };
        for side in 0..3 * mesh.count() {
            let edge = mesh.edge(side);
            mesh.edges.insert(edge);
        }
        mesh
    }

    fn count(&self) -> u32 {
        u32::try_from(self.triangles.len()).unwrap_or(NONE)
    }

    fn start(&self, side: u32) -> u32 {
        self.triangles[side as usize / 3][side as usize % 3]
    }

    fn edge(&self, side: u32) -> (u32, u32) {
        let (a, b) = (self.start(side), self.start(after(side)));
        (a.min(b), a.max(b))
    }

    /// Splits a triangle at a new vertex inside. Returns the sides around it.
    fn split(&mut self, t: usize, vertex: usize) -> [u32; 3] {
        let vertex = u32::try_from(vertex).unwrap_or(NONE);
        let [a, b, c] = self.triangles[t];
        let first = u32::try_from(3 * t).unwrap_or(NONE);
        let [second, third] = [3 * self.count(), 3 * self.count() + 3];
        // [a, b, x], [b, c, x], [c, a, x]: their first sides are those of the old triangle.
        self.triangles[t] = [a, b, vertex];
        self.triangles.extend([[b, c, vertex], [c, a, vertex]]);
        let outer = [
            self.opposite[first as usize + 1],
            self.opposite[first as usize + 2],
        ];
        self.opposite.resize(third as usize + 3, NONE);
        for (side, other) in [
            (first + 1, second + 2),
            (second + 1, third + 2),
            (third + 1, first + 2),
            (second, outer[0]),
            (third, outer[1]),
        ] {
            self.link(side, other);
        }
        for corner in [a, b, c] {
            self.edges.insert((corner, vertex));
        }
        [first, second, third]
    }

    fn link(&mut self, side: u32, other: u32) {
        self.opposite[side as usize] = other;
        if other != NONE {
            self.opposite[other as usize] = side;
        }
    }

    /// Flips edges, beginning with these sides, until the opposite angles of each add to at most pi.
    fn relax(&mut self, points: &[DVec3], mut sides: Vec<u32>) {
        // On surfaces that are not flat an edge could flip for ever.
        let mut turns = FLIPS_PER_TRIANGLE * self.triangles.len();
        while let Some(side) = sides.pop() {
            let other = self.opposite[side as usize];
            if other == NONE {
                continue;
            }
            let [c, d] = [side, other].map(|s| self.start(before(s)));
            let [a, b] = [side, after(side)].map(|s| self.start(s));
            let [p, q, r, s] = [a, b, c, d].map(|k| points[k as usize]);
            let angles = math::angle_between(p - r, q - r) + math::angle_between(p - s, q - s);
            let edge = (c.min(d), c.max(d));
            let outside = edge.1 < self.rim && (self.joined)(c as usize, d as usize);
            let flat = angles.is_nan() || angles < std::f64::consts::PI + FLIP_SLACK;
            if flat || outside || self.edges.contains(&edge) {
                continue;
            }
            if turns == 0 {
                return;
            }
            turns -= 1;
            self.edges.remove(&(a.min(b), a.max(b)));
            self.edges.insert(edge);
            sides.extend(self.turn(side, other));
        }
    }

    /// Flips the edge ab of triangles abc and bad to cd. Returns the sides around.
    fn turn(&mut self, side: u32, other: u32) -> [u32; 4] {
        let [c, d] = [side, other].map(|s| self.start(before(s)));
        // abc becomes [a -> d]bc: its side `side` runs d to b; bad becomes [b -> c]ad: `other` runs c to a.
        let (next, next_other) = (after(side), after(other));
        let [beyond, beyond_other] = [next, next_other].map(|s| self.opposite[s as usize]);
        // Triangle 1: a b c -> a d c: sides ad (from other), dc, ca. Triangle 2: b a d -> b c d: bc (from one), cd, db.
        self.triangles[next as usize / 3][next as usize % 3] = d;
        self.triangles[next_other as usize / 3][next_other as usize % 3] = c;
        self.link(side, beyond_other);
        self.link(other, beyond);
        self.link(next, next_other);
        [side, other, before(side), before(other)]
    }
}

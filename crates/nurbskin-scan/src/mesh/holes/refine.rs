//! A patch refined to the edge lengths around it.

use super::patch::Patch;
use crate::mesh::manifold::{NONE, after, before, opposite_sides};
use glam::DVec3;
use std::collections::HashSet;

/// Edges may be longer by so much per distance from the rim.
const GROWTH: f64 = 0.25;
/// A triangle is split if its middle is farther than the wanted edge length over this from all its corners (Liepa 2003).
const DENSITY: f64 = std::f64::consts::SQRT_2;
/// Rounds of splitting; each may triple the triangles.
const ROUNDS: usize = 24;
/// Most vertices added per corner of the rim; the growth keeps far below.
const MOST: usize = 64;

/// Splits triangles that are large for the rim around, and turns edges toward Delaunay's.
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
    for _ in 0..ROUNDS {
        let mut changed = Vec::new();
        for t in 0..mesh.triangles.len() {
            if patch.points.len() > MOST * rim {
                break;
            }
            let corners = mesh.triangles[t].map(|k| k as usize);
            let middle = corners.iter().map(|&k| patch.points[k]).sum::<DVec3>() / 3.0;
            let far = corners.map(|k| middle.distance(patch.points[k]));
            let size = corners
                .iter()
                .zip(far)
                .map(|(&k, far)| wanted[k] + GROWTH * far)
                .fold(f64::INFINITY, f64::min);
            let large = |(&k, far): (&usize, f64)| {
                DENSITY * far > size && (DENSITY * far > wanted[k] || wanted[k].is_infinite())
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

/// Triangles whose edges can be turned.
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

    /// Joins a triangle's corners with a new vertex in it; returns the sides around.
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

    /// Turns edges, beginning with these sides, until the angles against each sum to no more than half a turn.
    fn relax(&mut self, points: &[DVec3], mut sides: Vec<u32>) {
        // Surfaces that are not flat could turn an edge for ever.
        let mut turns = 8 * self.triangles.len();
        while let Some(side) = sides.pop() {
            let other = self.opposite[side as usize];
            if other == NONE {
                continue;
            }
            let [c, d] = [side, other].map(|s| self.start(before(s)));
            let [a, b] = [side, after(side)].map(|s| self.start(s));
            let [p, q, r, s] = [a, b, c, d].map(|k| points[k as usize]);
            let angles = (p - r).angle_between(q - r) + (p - s).angle_between(q - s);
            let edge = (c.min(d), c.max(d));
            let outside = edge.1 < self.rim && (self.joined)(c as usize, d as usize);
            let flat = angles.is_nan() || angles < std::f64::consts::PI + 1e-6;
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

    /// Turns the edge ab of triangles abc and bad to cd; returns the sides around.
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

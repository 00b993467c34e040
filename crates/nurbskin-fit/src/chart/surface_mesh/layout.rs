//! Layouts: a mesh on a domain that may wrap round.
//!
//! A vertex has one place; the corners of a triangle are lifted to the plane that covers the domain by the whole turns
//! along its sides, so that they lie next to each other. The linear map of a triangle from there to space has the
//! derivatives
//!
//! ```text
//! S_u = (e h_v - f g_v) / D,   S_v = (f g_u - e h_u) / D,   D = g × h
//! ```
//!
//! for edges e, f in space and g, h in the plane. D ≤ 0 means that the triangle is folded.

use super::ragged::Tooth;
use super::sides::{Jumps, Sides};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Fewest triangles of a task. Guard: fewer cost less than the task itself.
const TRIANGLES_PER_TASK: usize = 1024;

/// A triangle mesh with its sides.
#[derive(Debug)]
pub(super) struct Surface<'a> {
    pub(super) points: &'a [DVec3],
    pub(super) triangles: &'a [[u32; 3]],
    pub(super) sides: Sides,
}

impl<'a> Surface<'a> {
    pub(super) fn new(points: &'a [DVec3], triangles: &'a [[u32; 3]]) -> Self {
        Self {
            points,
            triangles,
            sides: Sides::new(triangles),
        }
    }

    pub(super) fn corners(&self, t: usize) -> [DVec3; 3] {
        self.triangles[t].map(|k| self.points[k as usize])
    }
}

/// The domain of a mesh, and the constraints on its vertices.
#[derive(Clone, Debug)]
pub(super) struct Setup {
    /// Whether u and v are closed.
    pub(super) closed: [bool; 2],
    /// Turns along each side.
    pub(super) jumps: Jumps,
    /// Fixed coordinates, by vertex.
    pub(super) held: Vec<[Option<f64>; 2]>,
    /// The vertices at u = 0 and u = 1 that stand for a whole line of v.
    pub(super) poles: Option<[u32; 2]>,
    /// The vertices of the rims.
    pub(super) teeth: Vec<Tooth>,
}

impl Setup {
    pub(super) fn open(vertices: usize, triangles: usize) -> Self {
        Self {
            closed: [false; 2],
            jumps: vec![[0; 2]; 3 * triangles],
            held: vec![[None; 2]; vertices],
            poles: None,
            teeth: Vec::new(),
        }
    }

    pub(super) fn is_pole(&self, vertex: u32) -> bool {
        self.poles.is_some_and(|poles| poles.contains(&vertex))
    }

    pub(super) fn jump(&self, side: usize) -> DVec2 {
        let [u, v] = self.jumps[side];
        DVec2::new(f64::from(u), f64::from(v))
    }

    /// The corners of a triangle in the plane that covers the domain, next to each other. A pole takes the v of the
    /// middle of the opposite side.
    pub(super) fn lifted(&self, triangle: &[u32; 3], t: usize, places: &[DVec2]) -> [DVec2; 3] {
        let mut at = triangle.map(|k| places[k as usize]);
        if let Some(k) = (0..3).find(|&k| self.is_pole(triangle[k])) {
            let (b, c) = ((k + 1) % 3, (k + 2) % 3);
            at[c] += self.jump(3 * t + b);
            at[k].y = 0.5 * (at[b].y + at[c].y);
        } else {
            at[1] += self.jump(3 * t);
            at[2] -= self.jump(3 * t + 2);
        }
        at
    }
}

/// Derivatives by u and v of the linear map from corners `at` in the plane to corners `p` in space, times twice the
/// area in the plane; and twice that area with its sign.
pub(super) fn derivatives([p, q, r]: [DVec3; 3], [a, b, c]: [DVec2; 3]) -> (DVec3, DVec3, f64) {
    let (e, f) = (q - p, r - p);
    let (g, h) = (b - a, c - a);
    (e * h.y - f * g.y, f * g.x - e * h.x, g.perp_dot(h))
}

/// A triangle in its domain.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// Its corners, next to each other.
    pub(super) at: [DVec2; 3],
    /// The [`derivatives`] of its map to space, times `twice`.
    pub(super) du: DVec3,
    pub(super) dv: DVec3,
    /// Twice its area in the domain, with its sign.
    pub(super) twice: f64,
}

/// All triangles in the domain.
pub(super) fn pieces(surface: &Surface<'_>, setup: &Setup, places: &[DVec2]) -> Vec<Piece> {
    let piece = |(t, triangle): (usize, &[u32; 3])| {
        let at = setup.lifted(triangle, t, places);
        let (du, dv, twice) = derivatives(surface.corners(t), at);
        Piece { at, du, dv, twice }
    };
    let triangles = surface.triangles.par_iter().enumerate();
    triangles
        .with_min_len(TRIANGLES_PER_TASK)
        .map(piece)
        .collect()
}

/// Mean lengths of the lines along u and along v, weighted by area in the domain.
pub(super) fn lengths(pieces: &[Piece]) -> [f64; 2] {
    let (mut u, mut v, mut area) = (0.0, 0.0, 0.0);
    for piece in pieces.iter().filter(|piece| piece.twice > 0.0) {
        u += piece.du.length();
        v += piece.dv.length();
        area += piece.twice;
    }
    if area > 0.0 && u > 0.0 && v > 0.0 {
        [u / area, v / area]
    } else {
        [1.0, 1.0]
    }
}

/// Twice the signed area of the whole layout; positive if triangles keep their orientation.
pub(super) fn twice_area(surface: &Surface<'_>, setup: &Setup, places: &[DVec2]) -> f64 {
    let twice = |(t, triangle): (usize, &[u32; 3])| {
        let [a, b, c] = setup.lifted(triangle, t, places);
        (b - a).perp_dot(c - a)
    };
    surface.triangles.iter().enumerate().map(twice).sum()
}

/// Share of the triangles that are folded: turned over or without area in the domain.
pub(super) fn folded(pieces: &[Piece]) -> f64 {
    let count = pieces.iter().filter(|piece| piece.twice <= 0.0).count();
    count as f64 / pieces.len().max(1) as f64
}

//! How sharply the surface bends across each edge.
//!
//! A strip reaches from the edge two spacings into one side, and a spacing and a half from the middle of the edge both
//! ways along it. Triangles are clipped to it in coordinates of their own plane, so it may hold dozens of triangles of
//! a scan or a part of one large triangle. The bend is the angle about the edge between the mean normals of both strips.
//! Beside a sharp edge it falls linearly with the distance, to zero at two spacings.

use super::{ABOVE_REST, MIN_LENGTH, NONE, Surface};
use glam::{DVec2, DVec3};
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::statistics::{median_in_place, quantile_in_place};
use rayon::prelude::*;

/// Depth of a strip in spacings. Source: the issue. Derived: strips on a right-angled fillet of two spacings bend
/// by 55 degrees, on one of 2.9 by 40, on one of four by 29.
const DEPTH: f64 = 2.0;
/// Half length of a strip in spacings. Trial: 1.5 on noisy boxes; not varied.
const HALF_LENGTH: f64 = 1.5;
/// Most triangles of a strip. Guard: against meshes much finer than the spacing.
const MOST: usize = 160;
/// Share of the bend that the dihedral angle of an edge has where the edge is the whole crease. Derived: a crease that
/// two edges share evenly has a half on each, a thin rib's bends in both strips three quarters.
const OWN_SHARE: f64 = 0.6;
/// Largest bend in radians of which the dihedral angle is a share. Derived: a right angle and some; the strips of coarse
/// meshes run round the next edge, too, and bend by up to a half turn.
const MAX_BEND: f64 = 1.7;
/// Between these depths, in spacings, a strip measures how far the surface bends in all. Derived: a right-angled fillet
/// of radius two spacings ends at 1.6.
const OUTER: [f64; 2] = [2.0, 3.5];
/// Dihedral angle of an exact crease, in standard deviations of the normals beside it. Trial: 5: fandisk has 718 exact
/// edges, banana and sea vase none.
const SMOOTH: f64 = 5.0;
/// Least share of the strips of an exact crease between other edges that may be creases. Derived: the triangles across a
/// crease that the mesh does not follow fill 0.07; a face of a coarse cube 0.26.
const MIN_FILLED: f64 = 0.15;
/// Standard deviations by which a dihedral angle stands clear of the noise. Trial: 6 on noisy boxes and scans; not varied.
const CLEAR: f64 = 6.0;

/// The bend of each inner edge.
pub(super) struct Bends {
    /// Angle between the strips of each edge in radians, positive where convex.
    pub(super) bend: Vec<f64>,
    /// Dihedral angle of each edge in radians, positive where convex.
    pub(super) dihedral: Vec<f64>,
    /// Whether the edge is a crease by itself.
    pub(super) exact: Vec<bool>,
    /// Share of the bend in what the surface bends farther out, for edges that bend; 1 for all others.
    pub(super) share: Vec<f64>,
    /// Median of the absolute bends.
    pub(super) rest: f64,
}

impl Bends {
    pub(super) fn new(surface: &Surface, weak: f64) -> Self {
        let count = surface.edges.len();
        let dihedral: Vec<f64> = (0..count).map(|e| dihedral(surface, e)).collect();
        let mut strips = Strips {
            surface,
            barrier: vec![false; count],
        };
        let bend: Vec<f64> = (0..count).into_par_iter().map(|e| strips.bend(e)).collect();
        let common = ABOVE_REST * flattest(&dihedral);
        let clear =
            |e: usize| dihedral[e].abs() > weak.max(common).max(CLEAR * scatter(surface, e));
        strips.barrier = (0..count).map(clear).collect();
        let is_exact = |e: usize| {
            let own = dihedral[e].abs();
            if !strips.barrier[e] || own <= OWN_SHARE * bend[e].abs().min(MAX_BEND) {
                return false;
            }
            let (rough, filled) = strips.roughness(e);
            own > SMOOTH * rough && filled > MIN_FILLED
        };
        let exact: Vec<bool> = (0..count).into_par_iter().map(is_exact).collect();
        let exact = surface.long_enough(exact, MIN_LENGTH, |_| true);
        let mut bends = Self {
            bend,
            dihedral,
            exact,
            share: vec![1.0; count],
            rest: 0.0,
        };
        bends.measure_between_creases(surface, weak);
        bends.rest = median(&bends.bend);
        bends
    }

    /// Measures the edges that bend again, with strips that end at the creases found.
    fn measure_between_creases(&mut self, surface: &Surface, weak: f64) {
        let strips = Strips {
            surface,
            barrier: self.exact.clone(),
        };
        let (bend, dihedral, exact) = (&self.bend, &self.dihedral, &self.exact);
        let again = |e: usize| match bend[e] {
            _ if exact[e] => (dihedral[e], 1.0),
            bend if bend.abs() > weak => {
                let bend = strips.bend(e);
                let outer = strips.angle(e, OUTER);
                // Where the strips end at creases there is nothing farther out.
                (bend, if outer == 0.0 { 1.0 } else { bend / outer })
            }
            bend => (bend, 1.0),
        };
        (self.bend, self.share) = (0..bend.len()).into_par_iter().map(again).unzip();
    }

    /// The largest bend at each vertex.
    pub(super) fn heights(&self, surface: &Surface) -> Vec<f64> {
        let mut height = vec![0.0_f64; surface.mesh.points.len()];
        for (edge, bend) in self.bend.iter().enumerate() {
            for v in surface.ends(edge) {
                height[v as usize] = height[v as usize].max(bend.abs());
            }
        }
        height
    }

    /// How well a line may follow this edge: its bend, raised by its own dihedral angle of the same sign.
    pub(super) fn ridge(&self, edge: usize) -> f64 {
        let bend = self.bend[edge];
        let own = (self.dihedral[edge] * bend.signum()).clamp(0.0, bend.abs());
        bend.abs() + 0.5 * own
    }
}

/// Dihedral angle of an edge.
fn dihedral(surface: &Surface, edge: usize) -> f64 {
    let [a, b] = surface.points(edge);
    let [n, m] = surface.beside(edge).map(|t| surface.normals[t]);
    let sine = n.cross(m).dot((b - a).normalize_or_zero());
    // No angle beside a triangle without area.
    if n == DVec3::ZERO || m == DVec3::ZERO {
        return 0.0;
    }
    math::atan2(sine, n.dot(m))
}

/// Standard deviation of a dihedral angle by noise. Derived: each normal tilts by the noise of the far corner and of
/// the edge, over the height of the triangle.
fn scatter(surface: &Surface, edge: usize) -> f64 {
    let tilts = surface.beside(edge).map(|t| {
        let height = 2.0 * surface.mesh.vector_area(t).length() / surface.length(edge);
        1.5 * (surface.noise / height).powi(2)
    });
    let both = tilts[0] + tilts[1];
    if both.is_nan() {
        f64::INFINITY
    } else {
        both.sqrt()
    }
}

/// The strips beside the edges of a mesh.
struct Strips<'a> {
    surface: &'a Surface<'a>,
    /// The edges that no strip crosses.
    barrier: Vec<bool>,
}

impl Strips<'_> {
    /// The angle between the strips of an edge, positive where convex; zero where a strip is empty.
    fn bend(&self, edge: usize) -> f64 {
        self.angle(edge, [0.0, DEPTH])
    }

    /// The same for strips that begin and end at other depths, in spacings.
    fn angle(&self, edge: usize, depths: [f64; 2]) -> f64 {
        let along = self.along(edge);
        let half = HALF_LENGTH * self.surface.reach[edge];
        let [n, m] = self
            .strips(edge, half, depths)
            .map(|(n, _)| (n - n.dot(along) * along).normalize_or_zero());
        if n == DVec3::ZERO || m == DVec3::ZERO {
            return 0.0;
        }
        math::atan2(n.cross(m).dot(along), n.dot(m))
    }

    /// Standard deviation of the normals in the rougher strip of an edge, in radians, and the share of the smaller strip
    /// that is filled. Derived: the mean of unit vectors with deviations of variance s² has the length 1 - s²/2.
    fn roughness(&self, edge: usize) -> (f64, f64) {
        // No longer than the edge: the facets of a coarse cylinder bend beside its rim.
        let reach = self.surface.reach[edge];
        let half = (0.5 * self.surface.length(edge)).min(HALF_LENGTH * reach);
        let strips = self.strips(edge, half, [0.0, DEPTH]);
        let of =
            |(normal, area): (DVec3, f64)| (2.0 * (1.0 - normal.length() / area).max(0.0)).sqrt();
        let long = self.strips(edge, HALF_LENGTH * reach, [0.0, DEPTH]);
        let whole = 2.0 * HALF_LENGTH * DEPTH * reach * reach;
        let rough = of(strips[0]).max(of(strips[1]));
        (rough, long[0].1.min(long[1].1) / whole)
    }

    fn along(&self, edge: usize) -> DVec3 {
        let [a, b] = self.surface.points(edge);
        (b - a).normalize_or_zero()
    }

    /// The sums of normals and of areas in the strips left and right of an edge.
    fn strips(&self, edge: usize, half: f64, depths: [f64; 2]) -> [(DVec3, f64); 2] {
        let [a, b] = self.surface.points(edge);
        let along = self.along(edge);
        let spacing = self.surface.reach[edge];
        let [low, high] = [
            DVec2::new(-half, depths[0] * spacing),
            DVec2::new(half, depths[1] * spacing),
        ];
        let [left, right] = self.surface.beside(edge);
        [(left, along), (right, -along)]
            .map(|(start, along)| self.strip(start, 0.5 * (a + b), along, low, high))
    }

    /// The sums of a strip that begins in triangle `start`, to the left of `along`.
    fn strip(
        &self,
        start: usize,
        middle: DVec3,
        along: DVec3,
        low: DVec2,
        high: DVec2,
    ) -> (DVec3, f64) {
        let mut met = vec![start];
        let mut next = 0;
        let mut sums = (DVec3::ZERO, 0.0);
        while let Some(&t) = met.get(next) {
            let normal = self.surface.normals[t];
            let inward = normal.cross(along);
            let slant = inward.length();
            let mut reached = next == 0;
            if slant > 0.0 {
                let corners = self.surface.mesh.corners(t);
                let place = |p: DVec3| {
                    DVec2::new((p - middle).dot(along), (p - middle).dot(inward) / slant)
                };
                let places = corners.map(place);
                // Depths from the edge on, so that strips that begin farther out are reached.
                reached |= clipped_area(places, DVec2::new(low.x, 0.0), high) > 0.0;
                let area = slant * clipped_area(places, low, high);
                sums.0 += area * normal;
                sums.1 += area;
            }
            if reached {
                self.neighbours(t, &mut met);
            }
            next += 1;
        }
        sums
    }

    /// Appends the neighbours of a triangle that are not in the list.
    fn neighbours(&self, t: usize, met: &mut Vec<usize>) {
        for side in 3 * t..3 * t + 3 {
            let edge = self.surface.edge_of[side];
            if edge == NONE || self.barrier[edge as usize] || met.len() >= MOST {
                continue;
            }
            let other = self.surface.adjacency.opposite[side] as usize / 3;
            if !met.contains(&other) {
                met.push(other);
            }
        }
    }
}

/// Area of the part of a triangle in a box.
///
/// Source: I. Sutherland, G. Hodgman, *Reentrant polygon clipping*, Communications of the ACM 17 (1), 1974.
fn clipped_area(triangle: [DVec2; 3], low: DVec2, high: DVec2) -> f64 {
    let least = triangle[0].min(triangle[1]).min(triangle[2]);
    let most = triangle[0].max(triangle[1]).max(triangle[2]);
    if most.cmple(low).any() || least.cmpge(high).any() {
        return 0.0;
    }
    if least.cmpge(low).all() && most.cmple(high).all() {
        return shoelace(&triangle);
    }
    let insides: [&dyn Fn(DVec2) -> f64; 4] = [
        &|p| p.y - low.y,
        &|p| high.y - p.y,
        &|p| p.x - low.x,
        &|p| high.x - p.x,
    ];
    // Each of the four lines adds at most one corner.
    let mut from = [DVec2::ZERO; 8];
    let mut count = 3;
    from[..3].copy_from_slice(&triangle);
    for inside in insides {
        let mut to = [DVec2::ZERO; 8];
        let mut made = 0;
        let mut add = |p: DVec2| {
            if let Some(place) = to.get_mut(made) {
                *place = p;
                made += 1;
            }
        };
        for k in 0..count {
            let (p, q) = (from[k], from[(k + 1) % count]);
            let (a, b) = (inside(p), inside(q));
            if a >= 0.0 {
                add(p);
            }
            if (a < 0.0) != (b < 0.0) {
                add(p.lerp(q, a / (a - b)));
            }
        }
        (from, count) = (to, made);
    }
    shoelace(&from[..count])
}

/// The median that angles of a normal distribution with the lower quartile of these have. Derived: 0.674 / 0.319. More
/// than half of the edges of a coarse CAD mesh are creases.
fn flattest(angles: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = angles.iter().map(|a| a.abs()).collect();
    2.11 * quantile_in_place(&mut sizes, 0.25)
}

fn median(angles: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = angles.iter().map(|a| a.abs()).collect();
    median_in_place(&mut sizes)
}

fn shoelace(polygon: &[DVec2]) -> f64 {
    let next = polygon.iter().cycle().skip(1);
    let twice: f64 = polygon.iter().zip(next).map(|(p, q)| p.perp_dot(*q)).sum();
    0.5 * twice.abs()
}

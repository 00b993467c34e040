//! Shapes with known sharp edges, as meshes whose triangles do or do not follow them.

use glam::{DVec2, DVec3};
use nurbskin_geometry::progress::Silent;
use nurbskin_scan::mesh::Manifold;
use nurbskin_scan::mesh::repair::repair;
use nurbskin_scan::mesh::samples::Random;
use nurbskin_scan::mesh::thin::thin;
use nurbskin_scan::mesh::triangulate::triangulate_oriented;
use std::f64::consts::TAU;

/// A solid around the origin, every point of which is seen from there.
pub(super) struct Shape {
    /// Signed distance, or a bound of it, negative inside; the second number is the radius of the fillets.
    pub(super) distance: fn(DVec3, f64) -> f64,
    /// Its sharp edges.
    pub(super) edges: Vec<[DVec3; 2]>,
}

fn box_distance(p: DVec3, half: DVec3, round: f64) -> f64 {
    let q = p.abs() - (half - round);
    q.max(DVec3::ZERO).length() + q.max_element().min(0.0) - round
}

/// About the area of each shape.
const AREA: f64 = 9.0;
const BOX: DVec3 = DVec3::new(1.0, 0.6, 0.5);
const CYLINDER: DVec2 = DVec2::new(0.6, 0.8);

pub(super) fn cuboid() -> Shape {
    let mut edges = Vec::new();
    for axis in 0..3 {
        for k in 0..4 {
            let mut a = BOX;
            a[(axis + 1) % 3] *= if k % 2 == 0 { 1.0 } else { -1.0 };
            a[(axis + 2) % 3] *= if k / 2 == 0 { 1.0 } else { -1.0 };
            let mut b = a;
            b[axis] = -b[axis];
            edges.push([a, b]);
        }
    }
    Shape {
        distance: |p, round| box_distance(p, BOX, round),
        edges,
    }
}

pub(super) fn cylinder() -> Shape {
    let n = 200;
    let at = |k: i32, z: f64| {
        let (s, c) = (TAU * f64::from(k) / f64::from(n)).sin_cos();
        DVec3::new(CYLINDER.x * c, CYLINDER.x * s, z)
    };
    let rings = [-CYLINDER.y, CYLINDER.y];
    Shape {
        distance: |p, round| {
            let q = DVec2::new(p.truncate().length(), p.z.abs()) - (CYLINDER - round);
            q.max(DVec2::ZERO).length() + q.max_element().min(0.0) - round
        },
        edges: rings
            .iter()
            .flat_map(|&z| (0..n).map(move |k| [at(k, z), at(k + 1, z)]))
            .collect(),
    }
}

/// Two boxes of one square section each, with their common one around the origin.
pub(super) fn bracket() -> Shape {
    let corners = [
        (-0.4, -0.4),
        (1.4, -0.4),
        (1.4, 0.4),
        (0.4, 0.4),
        (0.4, 1.4),
        (-0.4, 1.4),
    ];
    let at = |k: usize, z: f64| DVec3::new(corners[k % 6].0, corners[k % 6].1, z);
    let mut edges: Vec<[DVec3; 2]> = (0..6).map(|k| [at(k, -0.4), at(k, 0.4)]).collect();
    for z in [-0.4, 0.4] {
        edges.extend((0..6).map(|k| [at(k, z), at(k + 1, z)]));
    }
    Shape {
        distance: |p, round| {
            let half = DVec3::new(0.9, 0.4, 0.4);
            let a = box_distance(p - DVec3::new(0.5, 0.0, 0.0), half, round);
            let b = box_distance(
                p - DVec3::new(0.0, 0.5, 0.0),
                DVec3::new(0.4, 0.9, 0.4),
                round,
            );
            a.min(b)
        },
        edges,
    }
}

/// A number of the standard normal distribution.
pub(super) fn normal(random: &mut Random) -> f64 {
    let uniform = |random: &mut Random| (random.below(1 << 30) as f64 + 0.5) / f64::from(1 << 30);
    let (a, b) = (uniform(random), uniform(random));
    (-2.0 * a.ln()).sqrt() * (TAU * b).cos()
}

impl Shape {
    /// Even random points on it, about `spacing` apart, with noise of a standard deviation in spacings, triangulated as
    /// a cloud: no triangle follows the edges.
    pub(super) fn triangulated(&self, spacing: f64, round: f64, noise: f64, seed: u64) -> Manifold {
        let mut random = Random(seed * 2 + 0x9e37_79b9_7f4a_7c15);
        let mut points = Vec::new();
        let mut normals = Vec::new();
        let f = |p: DVec3| (self.distance)(p, round);
        // Uniform in a box; those near the surface are moved to it.
        let band = 0.5 * spacing;
        while points.len() as f64 * spacing * spacing < 30.0 * AREA {
            let mut p = DVec3::from(
                [0; 3].map(|_| random.below(1 << 30) as f64 / f64::from(1 << 30) * 3.2 - 1.6),
            );
            if f(p).abs() > band {
                continue;
            }
            let gradient = |p: DVec3| {
                let e = 1e-6;
                DVec3::from([DVec3::X, DVec3::Y, DVec3::Z].map(|d| f(p + e * d) - f(p - e * d)))
                    .normalize()
            };
            for _ in 0..8 {
                p -= f(p) * gradient(p);
            }
            let inner = p - 1e-4 * gradient(p);
            points.push(p);
            normals.push(gradient(inner));
        }
        let kept = thin(&points, Some(&normals), spacing, 0.0);
        let size = noise * spacing;
        let mut scatter = || size * normal(&mut random);
        let points: Vec<DVec3> = kept
            .iter()
            .map(|&k| points[k as usize] + DVec3::new(scatter(), scatter(), scatter()))
            .collect();
        let normals: Vec<DVec3> = kept.iter().map(|&k| normals[k as usize]).collect();
        let triangles = triangulate_oriented(&points, &normals, &Silent).unwrap();
        repair(&points, &triangles, &Silent).unwrap().manifold
    }

    /// Distance of a point from the nearest sharp edge.
    pub(super) fn off(&self, p: DVec3) -> f64 {
        let to = |[a, b]: &[DVec3; 2]| {
            let t = ((p - a).dot(b - a) / a.distance_squared(*b)).clamp(0.0, 1.0);
            p.distance(a.lerp(*b, t))
        };
        self.edges.iter().map(to).fold(f64::INFINITY, f64::min)
    }
}

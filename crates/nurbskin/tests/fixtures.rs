//! Four noise-free scans in millimetres, as ordered grids: a turned pot, a face, a bent handle and a sphere with poles.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

use nurbskin::chart::Topology;
use nurbskin::{DVec3, PointGrid};
use std::f64::consts::{PI, TAU};

/// A named grid with its topology.
pub(crate) struct Shape {
    pub(crate) name: &'static str,
    pub(crate) grid: PointGrid,
    pub(crate) topology: Topology,
}

/// All four, at their standard densities.
pub(crate) fn all() -> [Shape; 4] {
    let shape = |name, grid, topology| Shape {
        name,
        grid,
        topology,
    };
    [
        shape("pot", pot(115, 115), Topology::Tube),
        shape("face", face(101, 100), Topology::Disk),
        shape("tube", tube(120, 100), Topology::Tube),
        shape("sphere", sphere(100, 100), Topology::Sphere),
    ]
}

fn grid(m: usize, n: usize, f: impl Fn(f64, f64) -> DVec3, closed: bool) -> PointGrid {
    let end = if closed { n } else { n - 1 };
    let at = |i: usize, j: usize| f(i as f64 / (m - 1) as f64, j as f64 / end as f64);
    PointGrid::from_fn(m, n, at).unwrap()
}

/// Turned about z, 104 in diameter, 120 high; closed around the axis.
pub(crate) fn pot(m: usize, n: usize) -> PointGrid {
    let radius = |s: f64| {
        38.0 + 14.0 * (2.4 * PI * s.powf(1.2)).sin() + 6.0 * (-((s - 0.93) / 0.05).powi(2)).exp()
    };
    let point = |s: f64, t: f64| {
        let (sin, cos) = (t * TAU).sin_cos();
        DVec3::new(radius(s) * cos, radius(s) * sin, 120.0 * s)
    };
    grid(m, n, point, true)
}

/// A height field of 150 x 200 with nose, eyes and lips.
pub(crate) fn face(m: usize, n: usize) -> PointGrid {
    // Centre, half widths and height of each bump.
    const BUMPS: [[f64; 5]; 8] = [
        [0.0, 0.0, 9.0, 22.0, 24.0],
        [0.0, -14.0, 13.0, 9.0, 9.0],
        [-30.0, 24.0, 15.0, 11.0, -10.0],
        [30.0, 24.0, 15.0, 11.0, -10.0],
        [0.0, -45.0, 22.0, 6.0, 6.0],
        [0.0, -53.0, 24.0, 3.5, -3.0],
        [0.0, -62.0, 20.0, 6.0, 5.0],
        [0.0, -88.0, 25.0, 12.0, 8.0],
    ];
    let point = |s: f64, t: f64| {
        let (x, y) = (150.0 * s - 75.0, 200.0 * t - 100.0);
        let skull = 70.0 * (1.0 - (x / 95.0).powi(2) - (y / 130.0).powi(2));
        let bump = |[cx, cy, sx, sy, a]: &[f64; 5]| {
            a * (-((x - cx) / sx).powi(2) - ((y - cy) / sy).powi(2)).exp()
        };
        DVec3::new(x, y, skull + BUMPS.iter().map(bump).sum::<f64>())
    };
    grid(m, n, point, false)
}

/// A handle bent by 1.3 radians about (0, 90), its section neither round nor constant; closed around.
pub(crate) fn tube(m: usize, n: usize) -> PointGrid {
    let point = |s: f64, t: f64| {
        let (sin_a, cos_a) = (1.3 * s).sin_cos();
        let radius = 9.0 + 4.0 * (2.2 * PI * s).sin() + 2.0 * (-((s - 0.75) / 0.06).powi(2)).exp();
        let stretch = 1.0 + 0.35 * (PI * s).cos().powi(2);
        let (sin, cos) = (t * TAU).sin_cos();
        let centre = DVec3::new(90.0 * sin_a, 90.0 * (1.0 - cos_a), 0.0);
        let outward = DVec3::new(-sin_a, cos_a, 0.0);
        let up = sin + 0.12 * (2.0 * t * TAU).sin();
        centre + radius * stretch * cos * outward + radius * up * DVec3::Z
    };
    grid(m, n, point, true)
}

/// Radius 50, poles at both ends of u, closed around the axis.
pub(crate) fn sphere(m: usize, n: usize) -> PointGrid {
    let point = |s: f64, t: f64| {
        let (sin, cos) = (t * TAU).sin_cos();
        // The sine of pi is not 0 in floating point; a pole is one point.
        let ring = if s >= 1.0 { 0.0 } else { (PI * s).sin() };
        50.0 * DVec3::new(ring * cos, ring * sin, (PI * s).cos())
    };
    grid(m, n, point, true)
}

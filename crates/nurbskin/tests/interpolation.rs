//! Interpolation of grids: Pal & Ballav 2007, section 3, against the paper's own full-matrix route and against laws.

#![expect(clippy::unwrap_used, reason = "a test may stop")]

use nurbskin::chart::Topology;
use nurbskin::fit::interpolate::{interpolate, interpolate_at};
use nurbskin::fit::parameters::Parameterization::{self, Centripetal, ChordLength, Uniform};
use nurbskin::{DVec3, NurbsSurface, PointGrid};
use std::f64::consts::{PI, TAU};

/// A bumpy sheet with uneven, curved grid lines.
fn sheet(m: usize, n: usize) -> PointGrid {
    PointGrid::from_fn(m, n, |i, j| {
        let (i, j) = (i as f64 / (m - 1) as f64, j as f64 / (n - 1) as f64);
        let s = i + 0.10 * (TAU * i).sin() / PI;
        let t = j - 0.12 * (TAU * j).sin() / PI;
        let x = 100.0 * s + 0.8 * (TAU * t).sin();
        let y = 80.0 * t + 0.6 * (TAU * s).sin();
        let z = 8.0 * (TAU * x / 50.0).sin() * (TAU * y / 40.0).cos()
            + 3.0 * (TAU * (x + y) / 90.0).sin()
            + 0.004 * (x - 50.0).powi(2);
        DVec3::new(x, y, z)
    })
    .unwrap()
}

fn grid_of(topology: Topology, m: usize, n: usize) -> PointGrid {
    PointGrid::from_fn(m, n, |i, j| {
        let (s, t) = (
            i as f64,
            TAU * (j as f64 + 0.3 * (j as f64).sin()) / n as f64,
        );
        match topology {
            Topology::Disk => sheet(m, n).point(i, j),
            Topology::Tube => DVec3::new((3.0 + (0.3 * s).sin()) * t.cos(), 2.0 * t.sin(), s),
            Topology::Sphere => {
                let a = PI * s / (m - 1) as f64;
                let r = if i == m - 1 { 0.0 } else { a.sin() };
                DVec3::new(r * t.cos(), r * t.sin(), 1.5 * a.cos())
            }
            Topology::Torus => {
                let a = TAU * s / m as f64;
                let r = 5.0 + a.cos();
                DVec3::new(r * t.cos(), r * t.sin(), 2.0 * a.sin())
            }
        }
    })
    .unwrap()
}

/// Largest distance at the grid's points, relative to the bounding box.
fn residual(grid: &PointGrid, surface: &NurbsSurface, [u, v]: [&[f64]; 2]) -> f64 {
    let [lo, hi] = grid.bounding_box();
    let mut worst = 0.0_f64;
    for (j, &v) in v.iter().enumerate() {
        for (i, &u) in u.iter().enumerate() {
            worst = worst.max(surface.point(u, v).distance(grid.point(i, j)));
        }
    }
    worst / lo.distance(hi)
}

const ALL: [Topology; 4] = [
    Topology::Disk,
    Topology::Tube,
    Topology::Sphere,
    Topology::Torus,
];
const KINDS: [Parameterization; 3] = [Uniform, ChordLength, Centripetal];

#[test]
fn every_point_is_met() {
    for topology in ALL {
        for kind in KINDS {
            for degree in [[1, 1], [2, 2], [3, 3], [4, 3], [5, 2], [3, 6]] {
                for (m, n) in [(3, 3), (4, 5), (7, 4), (12, 15), (30, 21)] {
                    let grid = grid_of(topology, m, n);
                    let fit = interpolate(&grid, topology, degree, kind).unwrap();
                    let [u, v] = &fit.parameters;
                    let r = residual(&grid, &fit.surface, [u, v]);
                    assert!(
                        r <= 1e-12,
                        "{topology:?} {kind:?} {degree:?} {m} x {n}: {r:e}"
                    );
                }
            }
        }
    }
}

#[test]
fn every_point_is_met_at_every_size() {
    for (m, n) in [
        (2, 2),
        (4, 4),
        (18, 18),
        (29, 13),
        (25, 32),
        (100, 100),
        (400, 300),
        (2000, 5),
    ] {
        let grid = sheet(m, n);
        let fit = interpolate(&grid, Topology::Disk, [3, 3], ChordLength).unwrap();
        let [u, v] = &fit.parameters;
        let r = residual(&grid, &fit.surface, [u, v]);
        assert!(r <= 1e-12, "{m} x {n}: {r:e}");
        let _ = interpolate_at(&grid, Topology::Disk, [3, 3], [u, v]).unwrap();
    }
}

//! Charts of whole scans over their meshes.

use super::*;
use nurbskin_geometry::progress::Silent;
use nurbskin_scan::clean::{CleanOptions, CleanScan, clean};
use nurbskin_scan::mesh::samples::Mesh;
use nurbskin_scan::{Organisation, Scan};
use std::f64::consts::TAU;

const MESH: ChartOptions = ChartOptions {
    topology: None,
    vertices: true,
};

/// A scan of a mesh.
fn cleaned(mesh: Mesh) -> CleanScan {
    let scan = Scan {
        points: mesh.points,
        organisation: Organisation::Mesh(mesh.triangles),
        ..Scan::default()
    };
    clean(&scan, &CleanOptions::default(), &Silent).unwrap()
}

/// A pipe of radius 1 and length 3 with a wall, closed at its ends by rims: a ring by its topology.
fn pipe([around, along]: [u32; 2], wall: f64) -> Mesh {
    // Once around the section of the wall: up outside, over the rim, down inside, and back.
    let lengths = [3.0, wall, 3.0, wall];
    let whole: f64 = lengths.iter().sum();
    Mesh::lattice([around, along], [true, true], |u, v| {
        let s = v * whole;
        let (r, z) = if s < 3.0 {
            (1.0, s)
        } else if s < 3.0 + wall {
            (1.0 - (s - 3.0), 3.0)
        } else if s < 6.0 + wall {
            (1.0 - wall, 6.0 + wall - s)
        } else {
            (1.0 - (whole - s), 0.0)
        };
        DVec3::new(r * (TAU * u).cos(), r * (TAU * u).sin(), z)
    })
}

#[test]
fn a_thin_wall_is_what_its_mesh_says() {
    // 20,000 points on the 37 square units of both walls are .043 apart: twice the wall.
    let mesh = pipe([300, 280], 0.02);
    assert!(mesh.points.len() > 60_000);
    let scan = cleaned(mesh);
    let charted = chart(&scan, &MESH, &Silent).unwrap();
    assert_eq!(charted.chart.topology, Topology::Torus);
    assert_eq!(charted.chart.parameters.len(), scan.points.len());
    assert!(charted.support.is_empty());
    assert!(
        charted
            .states
            .iter()
            .all(|&state| state == PointState::Charted)
    );
    // Points across the wall from each other lie on two walls of the chart, too: half of its short way round apart.
    let at = |r: f64, k: usize| {
        let p = DVec3::new(
            r * (TAU * k as f64 / 10.0).cos(),
            r * (TAU * k as f64 / 10.0).sin(),
            1.5,
        );
        let nearest = (0..scan.points.len()).min_by(|&i, &j| {
            let [i, j] = [i, j].map(|i| scan.points[i].distance_squared(p));
            i.total_cmp(&j)
        });
        charted.chart.parameters[nearest.unwrap()]
    };
    for k in 0..10 {
        let apart = (at(1.0, k) - at(0.98, k)).abs();
        let apart = apart.min(1.0 - apart);
        assert!(apart.max_element() > 0.25, "{apart}");
    }
}

#[test]
fn bits_of_a_large_mesh_are_loose_as_those_of_a_small_one() {
    // A sheet and another one that touches it in a point.
    let sheets = |n: u32| {
        let mut mesh = Mesh::lattice([n, n], [false, false], |u, v| DVec3::new(u, v, 0.1 * u * u));
        let other = Mesh::lattice([n / 2, n / 2], [false, false], |u, v| {
            DVec3::new(1.0 + 0.5 * u, 1.0 + 0.5 * v, 0.1)
        });
        let first = mesh.points.len() as u32;
        let corner = first - 1;
        mesh.points.extend(other.points);
        let moved = |k: u32| if k == 0 { corner } else { k + first };
        let triangles = other.triangles.iter().map(|t| t.map(moved));
        mesh.triangles.extend(triangles);
        mesh
    };
    for n in [100, 300] {
        let scan = cleaned(sheets(n));
        let charted = chart(&scan, &MESH, &Silent).unwrap();
        assert_eq!(charted.chart.topology, Topology::Disk);
        let is_other = |p: &DVec3| p.x > 1.0 + 1e-9 || p.y > 1.0 + 1e-9;
        for (k, p) in scan.points.iter().enumerate() {
            let detached = charted.states[k] == PointState::Detached;
            assert_eq!(detached, is_other(p), "{n}: {p}");
        }
    }
}

#[test]
fn long_triangles_of_a_large_mesh_have_places_inside() {
    // A dense square beside a strip of few triangles, and a hole in the dense part.
    let n = 260_u32;
    let at = |k: u32| match k <= n {
        true => f64::from(k) / f64::from(n),
        false => 1.0 + 0.25 * f64::from(k - n),
    };
    let m = n + 4;
    let mesh = Mesh::lattice([m, n], [false, false], |u, v| {
        let k = (u * f64::from(m)).round() as u32;
        DVec3::new(at(k), v, 0.1 * (3.0 * v).sin())
    })
    .without(|p| p.distance(DVec3::new(0.5, 0.5, 0.1 * 1.5_f64.sin())) < 0.1);
    let scan = cleaned(mesh);
    assert!(scan.points.len() > 60_000);
    let charted = chart(&scan, &MESH, &Silent).unwrap();
    assert!(!charted.inside.is_empty() && charted.inside.len() <= scan.points.len());
    assert!(charted.inside.iter().all(|(p, _)| p.x > 1.0));
    // The hole was bridged: only its patch shows where the surface may be.
    assert!(!charted.support.is_empty());
    let off = |p: &DVec3| (p.truncate() - DVec2::splat(0.5)).length();
    assert!(charted.support.iter().all(|(p, _)| off(p) < 0.12));
}

/// 290 degrees of a cylinder of radius 1, of which a part is kept by its place on the cylinder, laid flat.
fn bent(keep: impl Fn(DVec2) -> bool) -> Mesh {
    Mesh::lattice([121, 91], [false, false], |u, v| {
        let (sin, cos) = (5.0 * (u - 0.5)).sin_cos();
        DVec3::new(sin, 5.0 * (v - 0.5), cos)
    })
    .without(|p| !keep(laid_flat(p)))
}

fn laid_flat(p: DVec3) -> DVec2 {
    DVec2::new(p.x.atan2(p.z), p.y)
}

#[test]
fn a_sheet_that_bends_over_is_spread_out_with_its_lengths() {
    type Outline = fn(DVec2) -> bool;
    let outlines: [Outline; 3] = [
        |p| p.length() < 2.3,
        |p| p.x < 0.0 || p.y < 0.0,
        |p| p.length() < 2.3 && p.length() > 1.2,
    ];
    for (k, keep) in outlines.into_iter().enumerate() {
        let scan = cleaned(bent(keep));
        let charts = Charts::new(&scan, MESH);
        assert!(charts.natural_base().unwrap().is_none(), "{k}");
        let charted = charts.spread_out(&Silent).unwrap().unwrap();
        assert_eq!(charted.extends, Extends::SpreadOut);
        assert_eq!(charted.chart.topology, Topology::Disk);
        let size = DVec2::from(charted.chart.size);
        let places = charted.chart.parameters.iter().map(|&p| p * size);
        let few: Vec<(DVec2, DVec2)> = (scan.points.iter().zip(places))
            .zip(&charted.states)
            .filter(|(_, state)| **state == PointState::Charted)
            .map(|((&p, place), _)| (laid_flat(p), place))
            // Single triangles that stand out at the outline are not part of the mesh.
            .filter(|(p, _)| keep(1.05 * p) && keep(0.95 * p))
            .step_by(97)
            .collect();
        // Rounds end at a root mean square strain of 1e-3; the outline is 5 across.
        for (a, b) in few.iter().zip(&few[7..]) {
            let (known, found) = (a.0.distance(b.0), a.1.distance(b.1));
            assert!(
                (known - found).abs() < 2e-3 * (1.0 + known),
                "{k}: {known} {found}"
            );
        }
        // No triangle is turned over.
        let corners = scan
            .triangles
            .iter()
            .map(|t| t.map(|k| charted.chart.parameters[k as usize] * size));
        assert!(
            corners
                .into_iter()
                .all(|[a, b, c]| (b - a).perp_dot(c - a) > 0.0)
        );
    }
}

#[test]
fn what_is_no_sheet_with_an_outline_of_its_own_is_not_spread_out() {
    let tube = Mesh::lattice([90, 40], [true, false], |u, v| {
        DVec3::new((TAU * u).cos(), (TAU * u).sin(), 3.0 * v)
    });
    // It fills its rectangle.
    let whole = bent(|_| true);
    let most_of_a_sphere = Mesh::sphere([60, 60], 0.0, 2.9);
    for (k, mesh) in [tube, whole, most_of_a_sphere].into_iter().enumerate() {
        let scan = cleaned(mesh);
        let charts = Charts::new(&scan, MESH);
        let found = charts.spread_out(&Silent).unwrap();
        assert!(found.is_none(), "{k}: {:?}", found.map(|f| &f.notes));
    }
    // Another topology was asked for.
    let scan = cleaned(bent(|p| p.length() < 2.3));
    let asked = ChartOptions {
        topology: Some(Topology::Tube),
        ..MESH
    };
    let charts = Charts::new(&scan, asked);
    assert!(charts.spread_out(&Silent).unwrap().is_none());
}

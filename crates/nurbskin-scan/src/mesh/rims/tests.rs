//! Rims of sheets with steps.

use super::*;
use crate::mesh::repair::repair;
use crate::mesh::samples::{Mesh, Random, check};
use nurbskin_geometry::progress::Silent;
use proptest::prelude::*;
use std::f64::consts::TAU;

/// Height of the test surface over a place.
fn height(p: DVec3) -> f64 {
    0.01 * (p.x * p.x - 0.5 * p.y * p.y)
}

/// A lattice of spacing 1 on the test surface, within an outline around the origin.
fn sheet(outline: impl Fn(f64) -> f64) -> Manifold {
    let place = |u: f64, v: f64| {
        let p = DVec3::new(40.0 * u - 20.0, 40.0 * v - 20.0, 0.0);
        p + height(p) * DVec3::Z
    };
    let outside = |p: DVec3| p.truncate().length() > outline(p.y.atan2(p.x).rem_euclid(TAU));
    let mesh = Mesh::lattice([40, 40], [false; 2], place).without(outside);
    repair(&mesh.points, &mesh.triangles, &Silent)
        .unwrap()
        .manifold
}

/// An outline with steps of these heights.
fn steps(heights: Vec<f64>) -> impl Fn(f64) -> f64 {
    move |angle| {
        let ends = (1..heights.len()).map(|k| k as f64 * TAU / heights.len() as f64);
        14.0 + heights[ends.filter(|end| *end <= angle).count()]
    }
}

/// Whether a place lies inside a border, seen along z.
fn is_inside(mesh: &Manifold, border: usize, p: DVec3) -> bool {
    let rim = &mesh.loops[border];
    let place = |k: usize| mesh.points[rim[k % rim.len()] as usize] - p;
    let turn = |k: usize| {
        let (a, b) = (place(k).truncate(), place(k + 1).truncate());
        a.perp_dot(b).atan2(a.dot(b))
    };
    (0..rim.len()).map(turn).sum::<f64>() > 0.5 * TAU
}

#[test]
fn a_ragged_rim_becomes_even_outside_its_points() {
    let ragged = sheet(steps((0..60).map(|k| f64::from(k * k % 7) / 3.0).collect()));
    let normals = mesh_normals(&ragged.points, &ragged.triangles);
    assert!(is_ragged(&ragged, &normals, &ragged.loops[0]));
    let Evened {
        mesh: even,
        ragged: count,
        lost,
    } = evened(ragged.clone());
    assert_eq!(count, 1);
    check(&even);
    let normals = mesh_normals(&even.points, &even.triangles);
    assert!(!is_ragged(&even, &normals, &even.loops[0]));
    let mut inside = 0;
    for (&p, _) in ragged.points.iter().zip(&lost).filter(|p| !*p.1) {
        assert!(is_inside(&even, 0, p), "{p}");
        inside += 1;
    }
    assert!(inside * 20 > 19 * ragged.points.len());
    for &k in &even.loops[0] {
        let p = even.points[k as usize];
        assert!((p.z - height(p)).abs() < 0.02, "{p}");
        let radius = p.truncate().length();
        assert!((14.0..18.5).contains(&radius), "{radius}");
    }
}

#[test]
fn no_notch_is_left() {
    let mut random = Random(7);
    let mut ragged = 0;
    for count in 20..60 {
        let heights = (0..count).map(|_| random.below(90) as f64 / 10.0 - 6.0);
        let Evened {
            mesh, ragged: one, ..
        } = evened(sheet(steps(heights.collect())));
        let spacing = median_edge(&mesh);
        assert_eq!(close_some(mesh, &[0], MOUTH, spacing).1, 0, "{count}");
        ragged += one;
    }
    assert!(ragged > 30, "{ragged}");
}

#[test]
fn an_even_rim_beside_a_ragged_one_stays() {
    // A zone of a sphere, even at its upper end.
    let tooth = |p: DVec3| (7.0 * p.y.atan2(p.x)).sin() + (31.0 * p.y.atan2(p.x)).cos();
    let mesh = Mesh::sphere([120, 20], 0.3, 1.2).without(|p| p.z < 0.5 + 0.05 * tooth(p));
    let ragged = repair(&mesh.points, &mesh.triangles, &Silent)
        .unwrap()
        .manifold;
    assert_eq!(ragged.loops.len(), 2);
    let Evened {
        mesh: even,
        ragged: count,
        ..
    } = evened(ragged);
    check(&even);
    assert_eq!((count, even.loops.len()), (1, 2));
    let upper = |k: &u32| (even.points[*k as usize].z - 0.3_f64.cos()).abs() < 1e-12;
    assert!(
        even.loops
            .iter()
            .any(|rim| rim.len() == 120 && rim.iter().all(upper))
    );
}

#[test]
fn even_rims_stay() {
    let round = Mesh::sphere([60, 20], 0.3, 1.2);
    let square = Mesh::lattice([30, 30], [false; 2], |u, v| DVec3::new(u, v, u * v));
    for mesh in [round, square] {
        let mesh = repair(&mesh.points, &mesh.triangles, &Silent)
            .unwrap()
            .manifold;
        let Evened {
            mesh: same,
            ragged: count,
            ..
        } = evened(mesh.clone());
        assert_eq!((same, count), (mesh, 0));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_outline_stays_a_sheet_without_folds(heights in prop::collection::vec(-6.0..3.0_f64, 3..60)) {
        let ragged = sheet(steps(heights));
        let Evened { mesh: even, .. } = evened(ragged.clone());
        check(&even);
        prop_assert_eq!(even.euler_characteristic(), ragged.euler_characteristic());
        for t in 0..even.triangles.len() {
            // Notches close over points in a line, too; such a triangle stands on edge.
            let [a, b, c] = even.corners(t);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            prop_assert!(even.vector_area(t).z > -1e-3 * longest * longest, "{a} {b} {c}");
        }
    }
}

//! Clouds of parts whose walls lie closer together than points see, or meet at a sharp edge.

use nurbskin::chart::Topology;
use nurbskin::chart::shape::shape_of;
use nurbskin::deviation::verdict::Verdict;
use nurbskin::mesh::repair::repair;
use nurbskin::mesh::triangulate::triangulate_oriented;
use nurbskin::pipeline::{Options, fit_scan};
use nurbskin::progress::Silent;
use nurbskin::scan::clean::{CleanOptions, clean};
use nurbskin::scan::simulate::Random;
use nurbskin::scan::{Scan, Viewpoint};
use nurbskin::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// A surface over the unit square.
type Surface = fn(f64, f64) -> DVec3;

/// A tapered, swept wing, open at both ends: NACA 0012 sections, whose walls meet at 16 degrees.
fn wing(u: f64, v: f64) -> DVec3 {
    let x = 0.5 * (1.0 + (TAU * v).cos());
    let half = 0.6 * (0.2969 * x.sqrt() - x * (0.1260 + x * (0.3516 - x * (0.2843 - 0.1036 * x))));
    let chord = 100.0 * (1.0 - 0.5 * u);
    let height = if v < 0.5 { half } else { -half };
    DVec3::new(chord * x + 40.0 * u, chord * height, 150.0 * u)
}

/// A thin blade, twisted, with a round nose and a round trailing edge of radius 0.8.
fn blade(u: f64, v: f64) -> DVec3 {
    const LENGTH: f64 = 40.0;
    const EDGE: f64 = 0.8;
    let x = 0.5 * (1.0 + (TAU * v).cos());
    // An ellipse and a stadium, whichever is thicker, smoothly.
    let (ellipse, along) = (
        3.0 * (x * (1.0 - x)).sqrt() * (1.0 - x),
        LENGTH * (1.0 - x).min(x),
    );
    let round = (EDGE * EDGE - (EDGE - along.min(EDGE)).powi(2))
        .max(0.0)
        .sqrt();
    let half = ellipse.hypot(round);
    let flat = DVec2::new(
        LENGTH * x,
        4.0 * (PI * x).sin() + if v < 0.5 { half } else { -half },
    );
    let flat = DVec2::from_angle(0.5 * u).rotate(flat - DVec2::new(16.0, 0.0));
    DVec3::new(flat.x, flat.y, 60.0 * u)
}

/// A cambered blade of NACA sections 6 % thick, tapered and twisted, open at both ends: its walls meet at eight degrees.
fn sharp_blade(u: f64, v: f64) -> DVec3 {
    let x = 0.5 * (1.0 + (TAU * v).cos());
    let half = 0.3 * (0.2969 * x.sqrt() - x * (0.1260 + x * (0.3516 - x * (0.2843 - 0.1036 * x))));
    let height = if v < 0.5 { half } else { -half } + 0.48 * x * (1.0 - x);
    let flat = DVec2::new(x - 0.4, height) * (40.0 * (1.0 - 0.3 * u));
    let flat = DVec2::from_angle(0.9 * u).rotate(flat);
    DVec3::new(flat.x, flat.y, 90.0 * u)
}

/// A bowl of thickness 2.5 with a round rim, closed all over.
fn bowl(u: f64, v: f64) -> DVec3 {
    const OUTER: f64 = 30.0;
    const WALL: f64 = 2.5;
    let end = 0.45 * PI;
    let lengths = [OUTER * end, 0.5 * PI * WALL, (OUTER - WALL) * end];
    let along = u * lengths.iter().sum::<f64>();
    let polar = |radius: f64, angle: f64| DVec2::new(angle.sin(), -angle.cos()) * radius;
    let at = if along < lengths[0] {
        polar(OUTER, along / OUTER)
    } else if along < lengths[0] + lengths[1] {
        let turn = (along - lengths[0]) / (0.5 * WALL);
        polar(OUTER - 0.5 * WALL, end) + polar(0.5 * WALL, end + turn)
    } else {
        polar(
            OUTER - WALL,
            end - (along - lengths[0] - lengths[1]) / (OUTER - WALL),
        )
    };
    let (sin, cos) = (TAU * v).sin_cos();
    DVec3::new(at.x * cos, at.x * sin, at.y)
}

/// Random points spread evenly over a surface, with noise along their normals, and its area.
fn cloud(surface: Surface, count: usize, noise: f64) -> (Scan, f64) {
    let step = 1e-6;
    let vector = |u: f64, v: f64| {
        let along_u = surface((u + step).min(1.0), v) - surface((u - step).max(0.0), v);
        let along_v = surface(u, (v + step).min(1.0)) - surface(u, (v - step).max(0.0));
        let spans = [u, v].map(|t| (t + step).min(1.0) - (t - step).max(0.0));
        along_u.cross(along_v) / (spans[0] * spans[1])
    };
    let middle = |k: u32| (f64::from(k) + 0.5) / 400.0;
    let all = (0..160_000_u32).map(|k| vector(middle(k % 400), middle(k / 400)).length());
    let (sum, most) = all.fold((0.0, 0.0_f64), |(sum, most), a| (sum + a, most.max(a)));
    let mut random = Random::new(9);
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    while points.len() < count {
        let (u, v) = (random.uniform(), random.uniform());
        let area = vector(u, v);
        if random.uniform() * most < area.length() {
            let normal = area.normalize();
            points.push(surface(u, v) + normal * (noise * random.normal()));
            normals.push(normal);
        }
    }
    let scan = Scan {
        points,
        normals: Some(normals),
        ..Scan::default()
    };
    (scan, sum / 160_000.0)
}

fn both(scan: Scan) -> [Scan; 2] {
    let without = Scan {
        normals: None,
        ..scan.clone()
    };
    [scan, without]
}

#[test]
fn walls_stay_apart_and_meet_at_their_edges() {
    let parts: [(&str, Surface, Topology, usize); 4] = [
        ("wing", wing, Topology::Tube, 14_000),
        ("blade", blade, Topology::Tube, 8_000),
        ("sharp blade", sharp_blade, Topology::Tube, 20_000),
        ("bowl", bowl, Topology::Sphere, 10_000),
    ];
    for (name, surface, topology, count) in parts {
        let (scan, area) = cloud(surface, count, 0.01);
        let truth = scan.normals.clone().unwrap();
        for scan in both(scan) {
            let name = format!("{name}, normals: {}", scan.normals.is_some());
            let cleaned = clean(&scan, &CleanOptions::default(), &Silent).unwrap();
            let right = cleaned.used.iter().zip(&cleaned.normals);
            let right = right
                .filter(|(k, n)| truth[**k as usize].dot(**n) > 0.0)
                .count();
            let right = right.max(cleaned.used.len() - right) as f64 / cleaned.used.len() as f64;
            let triangles =
                triangulate_oriented(&cleaned.points, &cleaned.normals, &Silent).unwrap();
            let manifold = repair(&cleaned.points, &triangles, &Silent)
                .unwrap()
                .manifold;
            let shape = shape_of(&manifold, None).unwrap();
            let ratio = manifold.area() / area;
            println!(
                "{name}: {right} of the sides, area {ratio}, {}",
                shape.reason
            );
            assert_eq!(shape.topology, topology, "{name}");
            assert!(right > 0.98, "{name}: {right}");
            assert!((ratio - 1.0).abs() < 0.02, "{name}: {ratio}");
        }
    }
}

#[test]
fn a_wing_becomes_a_tube() {
    let (scan, _) = cloud(wing, 14_000, 0.01);
    for scan in both(scan) {
        let found = fit_scan(scan, "wing", &Options::default(), &Silent).unwrap();
        let p95 = found.deviation.scan_to_surface.p95;
        assert_eq!(found.surface.topology, Some(Topology::Tube));
        assert_ne!(found.verdict, Verdict::Fail, "{:?}", found.reasons);
        // A tenth of a per cent of the diagonal.
        assert!(p95 < 0.18, "{p95}");
    }
}

/// Normals with signs by chance are those of nobody's sides: they are found as if there were none.
#[test]
fn normals_without_sides_are_not_believed() {
    let (scan, _) = cloud(bowl, 6_000, 0.01);
    let bare = Scan {
        normals: None,
        ..scan.clone()
    };
    let mut random = Random::new(3);
    let mut painted = scan;
    for normal in painted.normals.iter_mut().flatten() {
        if random.uniform() < 0.5 {
            *normal = -*normal;
        }
    }
    let mut flat = bare.clone();
    flat.normals = Some(vec![DVec3::Z; bare.points.len()]);
    let normals = |scan: &Scan| {
        clean(scan, &CleanOptions::default(), &Silent)
            .unwrap()
            .normals
    };
    let found = normals(&bare);
    assert_eq!(normals(&painted), found);
    assert_eq!(normals(&flat), found);
}

/// Both faces of a sheet of metal, thinner than the points of a face are apart, each seen by a scanner of its own.
#[test]
fn scanners_on_either_side_keep_the_faces_of_a_sheet_apart() {
    let mut random = Random::new(5);
    let mut scan = Scan::default();
    for (side, place) in [(1.0, 300.0), (-1.0, -300.0)] {
        scan.viewpoints.push(Viewpoint {
            first: scan.points.len(),
            place: DVec3::new(50.0, 40.0, place),
        });
        for _ in 0..6_000 {
            let (x, y) = (100.0 * random.uniform(), 80.0 * random.uniform());
            let z = 4.0 * (0.05 * x).sin() + side * 0.3 + 0.01 * random.normal();
            scan.points.push(DVec3::new(x, y, z));
        }
    }
    let cleaned = clean(&scan, &CleanOptions::default(), &Silent).unwrap();
    let right = cleaned.used.iter().zip(&cleaned.normals);
    let right = right.filter(|(k, n)| (**k < 6_000) == (n.z > 0.0)).count();
    assert!(right as f64 > 0.99 * cleaned.used.len() as f64, "{right}");
}

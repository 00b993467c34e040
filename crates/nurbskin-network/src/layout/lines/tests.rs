mod shapes;

use super::{FeatureLines, Sharp, feature_lines};
use glam::DVec3;
use nurbskin_geometry::numeric::statistics::{median_in_place, quantile_in_place};
use nurbskin_geometry::progress::Silent;
use nurbskin_geometry::spatial::neighbours::Neighbours;
use nurbskin_scan::Organisation;
use nurbskin_scan::io::read_scan;
use nurbskin_scan::mesh::Manifold;
use nurbskin_scan::mesh::repair::repair;
use nurbskin_scan::mesh::samples::{Mesh, Random};
use nurbskin_scan::noise::noise_of_cloud;
use shapes::{Shape, bracket, cuboid, cylinder, normal};
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;

/// Median distance of a vertex to its nearest neighbour.
fn spacing_of(points: &[DVec3]) -> f64 {
    let tree = Neighbours::new(points);
    let nearest = |p: &DVec3| p.distance(points[tree.nearest(*p, 2)[1] as usize]);
    median_in_place(&mut points.iter().map(nearest).collect::<Vec<f64>>())
}

fn manifold(mesh: &Mesh) -> Manifold {
    repair(&mesh.points, &mesh.triangles, &Silent)
        .unwrap()
        .manifold
}

/// With noise of a standard deviation in all directions.
fn noisy(mut mesh: Manifold, noise: f64) -> Manifold {
    let mut random = Random(11);
    for p in &mut mesh.points {
        *p += noise
            * DVec3::new(
                normal(&mut random),
                normal(&mut random),
                normal(&mut random),
            );
    }
    mesh
}

fn automatic(mesh: &Manifold, noise: f64) -> FeatureLines {
    feature_lines(mesh, spacing_of(&mesh.points), noise, Sharp::Auto)
}

/// By side, whether the dihedral angle is above a limit in degrees.
fn bent(mesh: &Manifold, limit: f64) -> Vec<bool> {
    let normal = |side: usize| mesh.vector_area(side / 3).normalize();
    let opposite = mesh.adjacency().opposite;
    let angle = |(side, other): (usize, &u32)| {
        normal(side)
            .angle_between(normal(*other as usize))
            .to_degrees()
    };
    opposite
        .iter()
        .enumerate()
        .map(|x| angle(x) > limit)
        .collect()
}

#[test]
fn clean_cubes_have_their_edges() {
    let block = |x: i64, y: i64, z: i64| x < 2 && y < 1 && z < 1;
    let bracket = |x: i64, y: i64, z: i64| z < 1 && (x < 1 && y < 3 || y < 1 && x < 2);
    for (d, length, mesh) in [
        (1, 16.0, Mesh::cubes(1, block)),
        (2, 16.0, Mesh::cubes(2, block)),
        (10, 16.0, Mesh::cubes(10, block)),
        (1, 26.0, Mesh::cubes(1, bracket)),
        (8, 26.0, Mesh::cubes(8, bracket)),
        (6, 60.0, Mesh::frame(2, 6)),
    ] {
        let mesh = manifold(&mesh);
        let lines = automatic(&mesh, 0.0);
        assert_eq!(lines.sides, bent(&mesh, 40.0), "{d}, {length}");
        assert!(
            (lines.length - length).abs() < 1e-9,
            "{} {length}",
            lines.length
        );
        assert_eq!(feature_lines(&mesh, 0.5, 0.0, Sharp::Off).chains, 0);
        assert_eq!(
            feature_lines(&mesh, 0.1, 0.0, Sharp::Degrees(100.0)).chains,
            0
        );
    }
    assert_eq!(automatic(&manifold(&Mesh::cubes(8, block)), 0.0).chains, 12);
}

/// A cylinder with caps, n needles round it, each from end to end.
fn needles(n: u32) -> Manifold {
    let profile = [(0.0, 0.0), (1.0, 0.0), (1.0, 4.0), (0.0, 4.0)];
    manifold(&Mesh::lattice([n, 3], [true, false], |u, v| {
        let (r, z) = profile[[0.0, 0.5, 0.9].iter().filter(|x| v > **x).count()];
        DVec3::new(r * (TAU * u).cos(), r * (TAU * u).sin(), z)
    }))
}

#[test]
fn needles_of_a_cylinder() {
    for n in [16, 60, 200] {
        let mesh = needles(n);
        let lines = automatic(&mesh, 0.0);
        assert_eq!(lines.sides, bent(&mesh, 40.0), "{n}");
        assert_eq!(lines.chains, 2);
    }
}

#[test]
fn smooth_shapes_have_none() {
    let saddle = Mesh::lattice([50, 50], [false, false], |u, v| {
        let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
        DVec3::new(x, y, 0.6 * (x * x - y * y))
    });
    for mesh in [
        Mesh::sphere([80, 40], 0.0, PI),
        Mesh::torus([100, 36], 1.0, 0.35),
        saddle,
    ] {
        let mesh = manifold(&mesh);
        let spacing = spacing_of(&mesh.points);
        for noise in [0.0, 0.05, 0.1] {
            // Nearest neighbours at the poles of the sphere are close: at most the spacing of all others.
            let lines = automatic(&noisy(mesh.clone(), noise * spacing), noise * spacing);
            assert_eq!(lines.chains, 0, "{noise}");
        }
    }
}

#[test]
fn degenerate_input() {
    assert_eq!(
        feature_lines(&Manifold::default(), 1.0, 0.0, Sharp::Auto),
        FeatureLines::default()
    );
    let mut mesh = manifold(&Mesh::cubes(3, |x, y, z| x + y + z == 0));
    for (spacing, noise) in [
        (0.0, 0.0),
        (f64::NAN, f64::NAN),
        (1e9, 0.0),
        (1e-12, 0.0),
        (0.3, 1e9),
        (0.3, -1.0),
    ] {
        let lines = feature_lines(&mesh, spacing, noise, Sharp::Degrees(f64::NAN));
        assert_eq!(lines.sides.len(), 3 * mesh.triangles.len());
    }
    assert_eq!(feature_lines(&mesh, f64::NAN, 0.0, Sharp::Auto).chains, 12);
    mesh.points[0] = DVec3::NAN;
    mesh.points[5] = mesh.points[6];
    assert_eq!(
        feature_lines(&mesh, 0.3, 0.0, Sharp::Auto).sides.len(),
        3 * mesh.triangles.len()
    );
}

/// How lines compare with the true edges of a shape.
#[derive(Debug)]
struct Compared {
    /// Distance of the line's vertices from the true edges in spacings, at 95 %.
    off: f64,
    /// Share of the true edges within two spacings of a line.
    covered: f64,
    /// Length of the lines over that of the true edges.
    length: f64,
}

fn compare(shape: &Shape, mesh: &Manifold, lines: &FeatureLines) -> Compared {
    let spacing = spacing_of(&mesh.points);
    let sides = lines.sides.iter().enumerate().filter(|(_, on)| **on);
    let on: Vec<DVec3> = sides
        .map(|(side, _)| mesh.corners(side / 3)[side % 3])
        .collect();
    let mut off: Vec<f64> = on.iter().map(|p| shape.off(*p) / spacing).collect();
    let (mut near, mut all, mut length) = (0.0, 0.0, 0.0);
    for [a, b] in &shape.edges {
        let piece = a.distance(*b);
        let steps = (0..100).take_while(|k| f64::from(*k) * spacing < 2.0 * piece);
        let of = |k: i32| a.lerp(*b, (0.5 * f64::from(k) * spacing / piece).min(1.0));
        let steps: Vec<DVec3> = steps.map(of).collect();
        let count = |p: &&DVec3| on.iter().any(|q| q.distance(**p) < 2.0 * spacing);
        near += steps.iter().filter(count).count() as f64 / steps.len() as f64 * piece;
        all += piece;
        length += piece;
    }
    Compared {
        off: if off.is_empty() {
            0.0
        } else {
            quantile_in_place(&mut off, 0.95)
        },
        covered: near / all,
        length: lines.length / length,
    }
}

#[test]
fn triangulated_clouds_have_their_edges() {
    for (name, shape) in [
        ("box", cuboid()),
        ("cylinder", cylinder()),
        ("bracket", bracket()),
    ] {
        for (round, noise) in [
            (0.0, 0.0),
            (0.0, 0.1),
            (1.8, 0.0),
            (1.8, 0.1),
            (4.0, 0.0),
            (4.0, 0.1),
        ] {
            let spacing = 0.05;
            let mesh = shape.triangulated(spacing, round * spacing, noise, 1);
            let lines = feature_lines(&mesh, spacing, noise * spacing, Sharp::Auto);
            let found = compare(&shape, &mesh, &lines);
            println!("{name} {round} {noise} {} {found:?}", lines.chains);
            save(&format!("{name}_{round}_{noise}"), &mesh, &lines);
            if round < 2.0 {
                assert!(found.covered > 0.95, "{name} {round} {noise} {found:?}");
                assert!(found.off < 3.5, "{name} {round} {noise} {found:?}");
                assert!(
                    (0.9..1.6).contains(&found.length),
                    "{name} {round} {noise} {found:?}"
                );
            } else {
                assert!(found.length < 0.1, "{name} {round} {noise} {found:?}");
            }
        }
    }
}

fn report(name: &str, mesh: &Manifold) -> FeatureLines {
    let (spacing, noise) = (spacing_of(&mesh.points), noise_of_cloud(&mesh.points, None));
    let start = std::time::Instant::now();
    let lines = feature_lines(mesh, spacing, noise, Sharp::Auto);
    let time = start.elapsed();
    let (low, high) = mesh
        .points
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| {
            (l.min(*p), h.max(*p))
        });
    let per = 1.0 / low.distance(high);
    println!(
        "{name}: {} triangles, spacing {:.2e} D, noise {:.1e} D: {} chains, {:.3} D, {time:.2?}, {:?}",
        mesh.triangles.len(),
        spacing * per,
        noise * per,
        lines.chains,
        lines.length * per,
        lines.notes,
    );
    save(name, mesh, &lines);
    lines
}

/// Writes a mesh with its lines as OBJ, for the eye, to the folder named by `NURBSKIN_LINES`.
fn save(name: &str, mesh: &Manifold, lines: &FeatureLines) {
    if let Ok(folder) = std::env::var("NURBSKIN_LINES") {
        let mut text = String::new();
        for p in &mesh.points {
            writeln!(text, "v {} {} {}", p.x, p.y, p.z).unwrap();
        }
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|k| k + 1);
            writeln!(text, "f {a} {b} {c}").unwrap();
        }
        for (side, _) in lines.sides.iter().enumerate().filter(|(_, on)| **on) {
            let t = mesh.triangles[side / 3].map(|k| k + 1);
            writeln!(text, "l {} {}", t[side % 3], t[(side + 1) % 3]).unwrap();
        }
        std::fs::write(format!("{folder}/{}.obj", name.replace('/', "_")), text).unwrap();
    }
}

/// Prints the lines of real scans. See [`save`].
#[test]
#[ignore = "prints figures of real scans"]
fn scans() {
    let Ok(folder) = std::env::var("NURBSKIN_DATA") else {
        println!("skipped: NURBSKIN_DATA is not set");
        return;
    };
    for name in [
        "classics/fandisk.obj",
        "pots/sea_vase.ply",
        "pots/plastic_vase.ply",
        "faces/lee_perry_smith_head.ply",
        "classics/stanford_bun_zipper.ply",
        "tubes/ycb_banana.obj",
        "tubes/aorta2.stl",
        "tubes/ycb_mustard_bottle.obj",
        "pots/ycb_tomato_soup_can.obj",
        "pots/ycb_bowl_16k.stl",
        "faces/rvcg_humface.ply",
        "patches/neon_side_panel.off",
    ] {
        let scan = read_scan(format!("{folder}/{name}")).unwrap();
        let Organisation::Mesh(triangles) = &scan.organisation else {
            continue;
        };
        report(
            name,
            &repair(&scan.points, triangles, &Silent).unwrap().manifold,
        );
    }
}

#[test]
fn fandisk_and_crusts() {
    let Ok(folder) = std::env::var("NURBSKIN_DATA") else {
        println!("skipped: NURBSKIN_DATA is not set");
        return;
    };
    for name in ["classics/fandisk.obj", "tubes/aorta2.stl"] {
        let scan = read_scan(format!("{folder}/{name}")).unwrap();
        let Organisation::Mesh(triangles) = &scan.organisation else {
            continue;
        };
        let mesh = repair(&scan.points, triangles, &Silent).unwrap().manifold;
        let lines = report(name, &mesh);
        if name.contains("fandisk") {
            let bent = bent(&mesh, 40.0);
            let found = bent
                .iter()
                .zip(&lines.sides)
                .filter(|(b, l)| **b && **l)
                .count();
            let all = bent.iter().filter(|b| **b).count();
            println!("{found} of {all} sides");
            assert!(found as f64 > 0.95 * all as f64, "{found} of {all}");
        } else {
            assert_eq!(lines.chains, 0);
        }
    }
}

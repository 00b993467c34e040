use super::*;
use crate::mesh::repair::repair;
use crate::mesh::samples::{Mesh, Random, check};
use nurbskin_geometry::progress::{Silent, Stopped};
use nurbskin_geometry::spatial::nearest::Nearest;
use proptest::prelude::*;
use std::f64::consts::PI;

/// Number of handles, of borders, and which way it faces: the area as a vector, and six times the volume.
fn told(m: &Manifold) -> (usize, usize, DVec3, f64) {
    let volume = (0..m.triangles.len()).map(|t| {
        let [a, b, c] = m.corners(t);
        a.dot(b.cross(c))
    });
    let vector = (0..m.triangles.len()).map(|t| m.vector_area(t)).sum();
    (m.genus(), m.loops.len(), vector, volume.sum())
}

/// Largest distance of the points that went from what is left.
fn farthest(mesh: &Manifold, few: &Manifold) -> f64 {
    let nearest = Nearest::new(&few.points, Some(&few.triangles));
    let distances = mesh.points.iter().map(|&p| nearest.closest(p, None));
    distances.map(|at| at.unwrap().distance).fold(0.0, f64::max)
}

/// Side of the equilateral triangles that cover the mesh.
fn edge(m: &Manifold) -> f64 {
    (4.0 / 3.0_f64.sqrt() * m.area() / m.triangles.len() as f64).sqrt()
}

/// A surface with `genus` handles and `holes` round holes, every point moved at random by up to a part of an edge.
fn made(genus: usize, holes: usize, noise: f64, seed: u64) -> Manifold {
    let mesh = match genus {
        0 => Mesh::sphere([60, 40], 0.0, PI),
        1 => Mesh::torus([70, 40], 1.0, 0.4),
        g => Mesh::frame(g as i64, 10),
    };
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let [low, high] = bounding_box(&mesh.points);
    let size = low.distance(high);
    let mut centres: Vec<DVec3> = Vec::new();
    for _ in 0..1000 {
        let centre = mesh.points[random.below(mesh.points.len())];
        if centres.len() < holes && centres.iter().all(|c| c.distance(centre) > 0.25 * size) {
            centres.push(centre);
        }
    }
    let radii: Vec<f64> = centres
        .iter()
        .map(|_| size * (0.03 + 0.0005 * random.below(60) as f64))
        .collect();
    let mesh = mesh.without(|p| centres.iter().zip(&radii).any(|(c, r)| c.distance(p) < *r));
    let mut manifold = repair(&mesh.points, &mesh.triangles, &Silent)
        .unwrap()
        .manifold;
    let by = noise * edge(&manifold);
    for p in &mut manifold.points {
        *p += DVec3::from([0; 3].map(|_| by * (random.below(2001) as f64 / 1000.0 - 1.0)));
    }
    manifold
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    /// Whatever is left of a mesh has its handles, borders and side, and the vertices wanted.
    #[test]
    fn the_topology_stays(
        genus in 0..4_usize,
        holes in 0..5_usize,
        noise in prop::sample::select(vec![0.0, 0.05, 0.3]),
        part in 3..20_usize,
        seed in any::<u64>(),
    ) {
        let mesh = made(genus, holes, noise, seed);
        let wanted = mesh.points.len() / part;
        let done = decimate(&mesh, wanted, &Silent).unwrap();
        let few = &done.manifold;
        check(few);
        let (before, after) = (told(&mesh), told(few));
        prop_assert_eq!((before.0, before.1), (after.0, after.1));
        prop_assert_eq!(before.0, genus);
        prop_assert!(few.points.len() == wanted || noise > 0.1, "{} for {}", few.points.len(), wanted);
        // Noise of a third of an edge leaves triangles beside each other back to back, which may not turn over.
        prop_assert!(few.points.len() < mesh.points.len() / 2);
        if mesh.loops.is_empty() {
            prop_assert!(after.3 > 0.8 * before.3, "{} of {}", after.3, before.3);
        } else {
            prop_assert!((after.2 - before.2).length() < 0.1 * mesh.area());
        }
        // Each vertex stands for others, and all stand for some.
        let mut stood = vec![false; few.points.len()];
        for k in done.into.iter().flatten() {
            stood[*k as usize] = true;
        }
        prop_assert!(stood.iter().all(|s| *s) && done.into.iter().all(Option::is_some));
    }

    /// Down to what has no vertex to spare.
    #[test]
    fn as_few_as_can_be(genus in 0..4_usize, holes in 0..5_usize, seed in any::<u64>()) {
        let mesh = made(genus, holes, 0.0, seed);
        let few = decimate(&mesh, 0, &Silent).unwrap().manifold;
        check(&few);
        prop_assert_eq!((few.genus(), few.loops.len()), (genus, mesh.loops.len()));
        prop_assert!(few.points.len() < 80 + 40 * (genus + holes), "{}", few.points.len());
    }
}

#[test]
fn what_went_lies_near_what_is_left() {
    // On a sphere a triangle with sides h lies h^2 / (6 R) below the surface at most; those left are up to 1.7 times as
    // long as the mean, and lie to both sides.
    for wanted in [400, 1500] {
        let mesh = Mesh::sphere([200, 100], 0.0, PI);
        let mesh = repair(&mesh.points, &mesh.triangles, &Silent)
            .unwrap()
            .manifold;
        let few = decimate(&mesh, wanted, &Silent).unwrap().manifold;
        assert_eq!(few.points.len(), wanted);
        let bound = (1.7 * edge(&few)).powi(2) / 6.0;
        let off = farthest(&mesh, &few);
        assert!(off < bound, "{off} > {bound}");
        // And as far the other way.
        assert!(farthest(&few, &mesh) < bound);
    }
}

#[test]
fn triangles_come_out_even() {
    let mesh = Mesh::torus([400, 160], 1.0, 0.4);
    let mesh = repair(&mesh.points, &mesh.triangles, &Silent)
        .unwrap()
        .manifold;
    let few = decimate(&mesh, 3000, &Silent).unwrap().manifold;
    let mut shapes: Vec<f64> = (0..few.triangles.len())
        .map(|t| faced(few.corners(t)).1)
        .collect();
    shapes.sort_by(f64::total_cmp);
    assert!(
        shapes[shapes.len() / 100] > 0.5,
        "{}",
        shapes[shapes.len() / 100]
    );
    let mut areas: Vec<f64> = (0..few.triangles.len())
        .map(|t| few.vector_area(t).length())
        .collect();
    areas.sort_by(f64::total_cmp);
    let n = areas.len();
    assert!(
        areas[n * 99 / 100] < 6.0 * areas[n / 100],
        "{} {}",
        areas[n / 100],
        areas[n * 99 / 100]
    );
}

#[test]
fn borders_and_edges_are_followed() {
    // A disk of radius 1: its rim is a circle that chords of h leave by h^2 / 8.
    let polar = Mesh::lattice([240, 60], [true, false], |u, v| {
        let (a, r) = (2.0 * PI * u, 0.2 + 0.8 * v);
        DVec3::new(r * a.cos(), r * a.sin(), 0.0)
    });
    let mesh = repair(&polar.points, &polar.triangles, &Silent)
        .unwrap()
        .manifold;
    let few = decimate(&mesh, 600, &Silent).unwrap().manifold;
    let h = 1.7 * edge(&few);
    assert!(farthest(&mesh, &few) < h * h / (8.0 * 0.2));
    assert!(
        (few.area() / mesh.area() - 1.0).abs() < 0.002,
        "{}",
        few.area() / mesh.area()
    );
    // A cube keeps its volume, and all its edges.
    let cube = Mesh::cubes(30, |x, y, z| x < 2 && y < 2 && z < 2);
    let mesh = repair(&cube.points, &cube.triangles, &Silent)
        .unwrap()
        .manifold;
    let few = decimate(&mesh, 500, &Silent).unwrap().manifold;
    let (before, after) = (told(&mesh).3, told(&few).3);
    assert!((after / before - 1.0).abs() < 0.005, "{after} of {before}");
    assert!(
        farthest(&mesh, &few) < 0.1 * edge(&few),
        "{}",
        farthest(&mesh, &few)
    );
}

#[test]
fn coordinates_of_any_size() {
    let ball = Mesh::sphere([60, 30], 0.0, PI);
    let mesh = repair(&ball.points, &ball.triangles, &Silent)
        .unwrap()
        .manifold;
    let wanted = decimate(&mesh, 300, &Silent).unwrap().manifold;
    for (scale, to) in [(1e-60, 0.0), (1e60, 0.0), (1.0, 1e6)] {
        let mut other = mesh.clone();
        other.points.iter_mut().for_each(|p| *p = scale * *p + to);
        let few = decimate(&other, 300, &Silent).unwrap().manifold;
        check(&few);
        assert_eq!(few.points.len(), 300);
        assert!((few.area() / scale / scale / wanted.area() - 1.0).abs() < 0.01);
    }
}

#[test]
fn hubs_and_small_meshes() {
    // A cone with 20000 triangles at its tip, a tetrahedron, a triangle, and nothing.
    let n = 20_000_u32;
    let around = |k: u32| f64::from(k) / f64::from(n) * 2.0 * PI;
    let mut points: Vec<DVec3> = (0..n)
        .map(|k| DVec3::new(around(k).cos(), around(k).sin(), 0.0))
        .collect();
    points.push(DVec3::Z);
    let triangles: Vec<[u32; 3]> = (0..n).map(|k| [k, (k + 1) % n, n]).collect();
    let mesh = repair(&points, &triangles, &Silent).unwrap().manifold;
    let few = decimate(&mesh, 100, &Silent).unwrap().manifold;
    check(&few);
    assert_eq!((few.points.len(), few.loops.len()), (100, 1));
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    for triangles in [
        &[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]][..],
        &[[0, 1, 2]],
    ] {
        let mesh = repair(&corners, triangles, &Silent).unwrap().manifold;
        let same = decimate(&mesh, 0, &Silent).unwrap().manifold;
        assert_eq!(same.triangles.len(), triangles.len());
        check(&same);
    }
    assert_eq!(
        decimate(&Manifold::default(), 5, &Silent).unwrap(),
        Decimated::default()
    );
}

#[test]
fn bad_meshes_and_callers_that_stop() {
    let bad = |points: Vec<DVec3>, triangles: Vec<[u32; 3]>| {
        let mesh = Manifold {
            source: vec![None; points.len()],
            points,
            triangles,
            loops: Vec::new(),
        };
        decimate(&mesh, 1, &Silent)
    };
    assert!(matches!(
        bad(vec![DVec3::ZERO], vec![[0, 0, 1]]),
        Err(Error::Invalid(_))
    ));
    assert!(matches!(
        bad(vec![DVec3::NAN; 3], vec![[0, 1, 2]]),
        Err(Error::Invalid(_))
    ));
    // What is no manifold is an error, else so is what comes of it.
    let mut random = Random(5);
    for _ in 0..300 {
        let points: Vec<DVec3> = (0..12)
            .map(|_| DVec3::from([0; 3].map(|_| random.below(5) as f64)))
            .collect();
        let triangles = (0..random.below(40))
            .map(|_| [0; 3].map(|_| random.below(12) as u32))
            .collect();
        match bad(points, triangles) {
            Ok(few) => few
                .manifold
                .triangles
                .iter()
                .flatten()
                .for_each(|k| assert!((*k as usize) < 12)),
            Err(why) => assert!(matches!(why, Error::Invalid(_))),
        }
    }
    let mesh = made(1, 1, 0.0, 3);
    assert!(matches!(
        decimate(&mesh, 100, &Stopped),
        Err(Error::Cancelled)
    ));
}

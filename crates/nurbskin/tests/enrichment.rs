//! Catmull-Clark enrichment: the paper's equations, known masks, and originals that stay.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

use crate::fixtures;
use nurbskin::chart::Topology;
use nurbskin::enrich::{
    PolygonMesh, controls_of_grid, controls_of_mesh, enrich_grid, enrich_mesh, limit_grid,
    limit_mask, subdivide_grid, vertex_mask,
};
use nurbskin::{ControlNet, DVec3, Error, KnotVector, NurbsSurface, PointGrid};
use proptest::prelude::*;
use std::f64::consts::TAU;

const TOPOLOGIES: [Topology; 4] = [
    Topology::Disk,
    Topology::Tube,
    Topology::Sphere,
    Topology::Torus,
];

/// A wavy grid that fits any topology.
fn wavy(m: usize, n: usize, topology: Topology) -> PointGrid {
    PointGrid::from_fn(m, n, |i, j| {
        let (s, t) = (i as f64, j as f64);
        let wave = DVec3::new(
            (1.3 * s + t).sin(),
            (0.7 * t * s).cos(),
            (2.1 * t - s).sin(),
        );
        let place = match topology {
            Topology::Disk => DVec3::new(10.0 * s, 10.0 * t, 0.0),
            Topology::Tube => {
                let (sin, cos) = (TAU * t / n as f64).sin_cos();
                DVec3::new(20.0 * cos, 20.0 * sin, 10.0 * s)
            }
            Topology::Sphere => {
                let (sin, cos) = (TAU * t / n as f64).sin_cos();
                let (ring, height) = (TAU * s / (2 * (m - 1)) as f64).sin_cos();
                if i == 0 || i == m - 1 {
                    return DVec3::new(0.3, 0.2, 20.0 * height);
                }
                20.0 * DVec3::new(ring * cos, ring * sin, height)
            }
            Topology::Torus => {
                let (sin, cos) = (TAU * t / n as f64).sin_cos();
                let (sin_s, cos_s) = (TAU * s / m as f64).sin_cos();
                DVec3::new(
                    (40.0 + 15.0 * cos_s) * cos,
                    (40.0 + 15.0 * cos_s) * sin,
                    15.0 * sin_s,
                )
            }
        };
        place + wave
    })
    .unwrap()
}

/// A fan of `k` quads around point 0: then the k edge neighbours, then the k diagonal ones; and a second ring of quads
/// so that the fan is not at the boundary.
fn star(k: usize) -> PolygonMesh {
    let ring = |radius: f64, turn: f64, lift: f64| {
        (0..k).map(move |i| {
            let (sin, cos) = ((i as f64 + turn) * TAU / k as f64).sin_cos();
            DVec3::new(
                radius * cos,
                radius * sin,
                lift * (1.0 + (2.3 * i as f64).sin()),
            )
        })
    };
    let mut points = vec![DVec3::new(0.1, 0.2, 1.0)];
    points.extend(ring(1.0, 0.0, 0.5));
    points.extend(ring(1.4, 0.5, -0.3));
    points.extend(ring(2.0, 0.0, 0.2));
    points.extend(ring(2.8, 0.5, 0.1));
    let mut faces = Vec::new();
    for i in 0..k {
        let (e, next) = (1 + i, 1 + (i + 1) % k);
        let f = 1 + k + i;
        let (outer_e, outer_next, outer_f) = (e + 2 * k, next + 2 * k, f + 2 * k);
        faces.push([0, e, f, next]);
        faces.push([e, outer_e, outer_f, f]);
        faces.push([next, f, outer_f, outer_next]);
    }
    PolygonMesh::new(points, &faces).unwrap()
}

#[test]
fn equation_11_is_equation_12() {
    for k in 3..=8 {
        let mesh = star(k);
        assert_eq!(mesh.valence(0), Some(k));
        let p = mesh.points();
        let sum = |range: std::ops::Range<usize>| p[range].iter().sum::<DVec3>();
        let [centre, edge, diagonal] = vertex_mask(k);
        let by_11 = centre * p[0] + edge * sum(1..1 + k) + diagonal * sum(1 + k..1 + 2 * k);
        let by_12 = mesh.subdivided().unwrap().points()[0];
        assert!(
            by_11.distance(by_12) < 2e-15,
            "valence {k}: {:e}",
            by_11.distance(by_12)
        );
        let total = centre + k as f64 * (edge + diagonal);
        assert!((total - 1.0).abs() < 1e-15);
        let [centre, edge, diagonal] = limit_mask(k);
        let by_mask = centre * p[0] + edge * sum(1..1 + k) + diagonal * sum(1 + k..1 + 2 * k);
        assert!(by_mask.distance(mesh.limit_positions()[0]) < 2e-15);
    }
    let regular = [36.0 / 64.0, 6.0 / 64.0, 1.0 / 64.0];
    let limit = [4.0 / 9.0, 1.0 / 9.0, 1.0 / 36.0];
    for k in 0..3 {
        assert!((vertex_mask(4)[k] - regular[k]).abs() < 1e-16);
        assert!((limit_mask(4)[k] - limit[k]).abs() < 1e-16);
    }
}

/// The matrix of one step on a point, its k edge neighbours and its k diagonal ones, by subdividing unit vectors.
fn subdivision_matrix(k: usize) -> Vec<Vec<f64>> {
    let mesh = star(k);
    let count = 2 * k + 1;
    // The edge to neighbour i gives neighbour i of the finer star, the face after it diagonal i.
    let finer = mesh.subdivided().unwrap();
    let place: Vec<usize> = {
        let quads: Vec<&[usize]> = finer.faces().filter(|quad| quad[0] == 0).collect();
        let edges = quads.iter().map(|quad| quad[1]);
        let faces = quads.iter().map(|quad| quad[2]);
        std::iter::once(0).chain(edges).chain(faces).collect()
    };
    let mut matrix = vec![vec![0.0; count]; count];
    for column in 0..count {
        let mut unit = vec![DVec3::ZERO; mesh.points().len()];
        unit[column] = DVec3::X;
        let finer = mesh.with_points(unit).unwrap().subdivided().unwrap();
        for row in 0..count {
            matrix[row][column] = finer.points()[place[row]].x;
        }
    }
    matrix
}

#[test]
fn limit_mask_is_the_left_eigenvector_and_the_subdominant_eigenvalue_is_known() {
    for k in 3..=8 {
        let matrix = subdivision_matrix(k);
        let count = 2 * k + 1;
        let [centre, edge, diagonal] = limit_mask(k);
        let left: Vec<f64> = (0..count)
            .map(|i| {
                if i == 0 {
                    centre
                } else if i <= k {
                    edge
                } else {
                    diagonal
                }
            })
            .collect();
        for column in 0..count {
            let product: f64 = (0..count).map(|row| left[row] * matrix[row][column]).sum();
            assert!((product - left[column]).abs() < 1e-15, "valence {k}");
        }
        // Power iteration on the first Fourier mode, whose eigenvalue is the subdominant one.
        let angle = |i: usize| TAU * i as f64 / k as f64;
        let mut mode: Vec<f64> = (0..count)
            .map(|i| match i {
                0 => 0.0,
                i if i <= k => angle(i - 1).cos(),
                i => 0.7 * (angle(i - 1 - k) + 0.5 * angle(1)).cos(),
            })
            .collect();
        let mut eigenvalue = 0.0;
        for _ in 0..200 {
            let next: Vec<f64> = matrix
                .iter()
                .map(|row| row.iter().zip(&mode).map(|(a, b)| a * b).sum())
                .collect();
            eigenvalue = next[1] / mode[1];
            // Rounding must not let the dominant eigenvector grow.
            let dominant: f64 = left.iter().zip(&next).map(|(a, b)| a * b).sum();
            mode = next.iter().map(|x| (x - dominant) / eigenvalue).collect();
        }
        let a = angle(1);
        let known = (5.0 + a.cos() + (0.5 * a).cos() * (18.0 + 2.0 * a.cos()).sqrt()) / 16.0;
        assert!(
            (eigenvalue - known).abs() < 1e-13,
            "valence {k}: {eigenvalue} {known}"
        );
    }
}

#[test]
fn a_regular_closed_mesh_is_the_uniform_bicubic_spline() {
    let (m, n) = (7, 6);
    let grid = wavy(m, n, Topology::Torus);
    let wrapped = ControlNet::from_fn(m + 3, n + 3, |i, j| grid.point(i % m, j % n)).unwrap();
    let knots = |count: usize| {
        let breaks: Vec<f64> = (0..=count).map(|k| k as f64).collect();
        KnotVector::periodic(3, &breaks).unwrap()
    };
    let surface = NurbsSurface::new(knots(m), knots(n), wrapped, None).unwrap();
    // Control point (i, j) belongs to the parameters (i - 1, j - 1): the middle of its basis functions.
    let mut finer = PolygonMesh::from_grid(&grid, Topology::Torus).unwrap();
    for _ in 0..3 {
        let limits = finer.limit_positions();
        for j in 0..n {
            for i in 0..m {
                let on_spline = surface.point((i + m) as f64 - 1.0, (j + n) as f64 - 1.0);
                assert!(limits[j * m + i].distance(on_spline) < 1e-13);
            }
        }
        finer = finer.subdivided().unwrap();
    }
    let dense = limit_grid(
        &subdivide_grid(&grid, Topology::Torus).unwrap(),
        Topology::Torus,
    );
    let dense = dense.unwrap();
    for j in 0..2 * n {
        for i in 0..2 * m {
            let (u, v) = (0.5 * i as f64 - 1.0, 0.5 * j as f64 - 1.0);
            assert!(dense.point(i, j).distance(surface.point(u, v)) < 1e-13);
        }
    }
}

#[test]
fn grid_and_mesh_agree() {
    for topology in [Topology::Disk, Topology::Tube, Topology::Torus] {
        let grid = wavy(6, 5, topology);
        let mesh = PolygonMesh::from_grid(&grid, topology).unwrap();
        let finer = mesh.subdivided().unwrap();
        let by_grid = subdivide_grid(&grid, topology).unwrap();
        // Open tubes end in smooth curves in both, and the disk in fixed corners.
        let same = |a: &[DVec3], grid: &PointGrid, stride: usize| {
            for j in 0..5 {
                for i in 0..6 {
                    let b = grid.point(stride * i, stride * j);
                    // At the ends of a tube the grid rule and the mesh rule are the same curve rule.
                    assert!(a[j * 6 + i].distance(b) < 1e-13, "{topology:?} {i} {j}");
                }
            }
        };
        same(finer.points(), &by_grid, 2);
        same(
            &mesh.limit_positions(),
            &limit_grid(&grid, topology).unwrap(),
            1,
        );
        let controls = controls_of_mesh(&mesh).unwrap();
        same(
            controls.points(),
            &controls_of_grid(&grid, topology).unwrap(),
            1,
        );
        let all = by_grid.points();
        for point in finer.points() {
            assert!(all.iter().any(|q| q.distance(*point) < 1e-13));
        }
    }
}

#[test]
fn enriched_grids_keep_their_points() {
    for topology in TOPOLOGIES {
        for [m, n] in [[2, 3], [4, 4], [5, 7], [9, 8]] {
            let grid = wavy(m, n, topology);
            let controls = controls_of_grid(&grid, topology).unwrap();
            let mut finer = controls;
            for level in 0..3 {
                let limits = limit_grid(&finer, topology).unwrap();
                let worst = (0..m * n)
                    .map(|k| (k % m, k / m))
                    .map(|(i, j)| {
                        limits
                            .point(i << level, j << level)
                            .distance(grid.point(i, j))
                    })
                    .fold(0.0, f64::max);
                // Plain steps average the pole rows, which the enrichment does not.
                if topology != Topology::Sphere || level == 0 {
                    assert!(worst < 1e-12 * 100.0, "{topology:?} {m} x {n}: {worst:e}");
                }
                finer = subdivide_grid(&finer, topology).unwrap();
            }
            let dense = enrich_grid(&grid, topology, 3).unwrap();
            for j in 0..n {
                for i in 0..m {
                    assert_eq!(dense.point(8 * i, 8 * j), grid.point(i, j));
                }
            }
            // The points put back exactly are not out of line with those around them.
            if topology == Topology::Sphere {
                let rows = [0, dense.count_u() - 1];
                for i in rows {
                    let pole = dense.point(i, 0);
                    let worst = dense
                        .column(i)
                        .map(|p| p.distance(pole))
                        .fold(0.0, f64::max);
                    assert!(worst < 1e-12, "{m} x {n} {i}: {worst:e}");
                }
            }
        }
    }
}

#[test]
fn an_enriched_sphere_is_round_across_its_poles() {
    let grid = fixtures::sphere(13, 24);
    let dense = enrich_grid(&grid, Topology::Sphere, 3).unwrap();
    let worst = dense
        .points()
        .iter()
        .map(|p| (p.length() - 50.0).abs())
        .fold(0.0, f64::max);
    assert!(worst < 0.02, "{worst}");
    // With an odd number around, the meridians end freely and flatten at the poles.
    let odd = enrich_grid(&fixtures::sphere(13, 25), Topology::Sphere, 3).unwrap();
    let worst = odd
        .points()
        .iter()
        .map(|p| (p.length() - 50.0).abs())
        .fold(0.0, f64::max);
    assert!(worst < 0.5, "{worst}");
}

#[test]
fn plain_steps_move_the_points_by_millimetres() {
    let moved = |a: &PointGrid, stride: usize, grid: &PointGrid| {
        let [m, n] = grid.counts();
        (0..m * n)
            .map(|k| (k % m, k / m))
            .map(|(i, j)| a.point(stride * i, stride * j).distance(grid.point(i, j)))
            .fold(0.0, f64::max)
    };
    for (count, step, limit) in [(18, 2.105, 2.798), (12, 3.181, 4.217), (8, 5.294, 7.006)] {
        let grid = fixtures::pot(count, count);
        let plain = subdivide_grid(&grid, Topology::Tube).unwrap();
        assert!((moved(&plain, 2, &grid) - step).abs() < 6e-4);
        let end = limit_grid(&grid, Topology::Tube).unwrap();
        assert!((moved(&end, 1, &grid) - limit).abs() < 6e-4);
    }
}

/// Meshes of all kinds of valence: platonic bodies, stars, a pyramid, an L of quads with a corner of three faces.
fn meshes() -> Vec<(&'static str, PolygonMesh)> {
    let cube_points: Vec<DVec3> = (0..8)
        .map(|k| DVec3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64))
        .collect();
    let cube_faces = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let cube = PolygonMesh::new(cube_points, &cube_faces).unwrap();
    let pyramid = PolygonMesh::new(
        vec![
            DVec3::new(1.0, 0.0, 0.0),
            DVec3::new(0.0, 1.0, 0.0),
            DVec3::new(-1.0, 0.1, 0.0),
            DVec3::new(0.0, -1.0, 0.0),
            DVec3::new(0.0, 0.1, 1.5),
        ],
        &[
            vec![3, 2, 1, 0],
            vec![0, 1, 4],
            vec![1, 2, 4],
            vec![2, 3, 4],
            vec![3, 0, 4],
        ],
    );
    let l_points: Vec<DVec3> = (0..8)
        .map(|k| {
            [
                [0, 0],
                [1, 0],
                [2, 0],
                [0, 1],
                [1, 1],
                [2, 1],
                [0, 2],
                [1, 2],
            ][k]
        })
        .map(|[x, y]: [i32; 2]| DVec3::new(x.into(), y.into(), f64::from(x * y) * 0.3))
        .collect();
    let l = PolygonMesh::new(l_points, &[[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6]]);
    let sphere = PolygonMesh::from_grid(&fixtures::sphere(7, 9), Topology::Sphere);
    let mut all = vec![
        ("cube", cube),
        ("pyramid", pyramid.unwrap()),
        ("L", l.unwrap()),
        ("sphere", sphere.unwrap()),
    ];
    all.extend((3..=12).map(|k| ("star", star(k))));
    all
}

#[test]
fn enriched_meshes_keep_their_points() {
    for (name, mesh) in meshes() {
        let controls = controls_of_mesh(&mesh).unwrap();
        let mut finer = controls;
        for _ in 0..3 {
            let limits = finer.limit_positions();
            for (a, b) in limits.iter().zip(mesh.points()) {
                assert!(a.distance(*b) < 1e-12, "{name}: {:e}", a.distance(*b));
            }
            finer = finer.subdivided().unwrap();
        }
        let dense = enrich_mesh(&mesh, 2).unwrap();
        assert_eq!(&dense.points()[..mesh.points().len()], mesh.points());
        assert!(dense.faces().all(|face| face.len() == 4));
        // V - E + F does not change.
        let euler =
            |mesh: &PolygonMesh| mesh.points().len() + mesh.face_count() - mesh.edge_count();
        assert_eq!(euler(&dense), euler(&mesh));
    }
}

#[test]
fn a_distorted_cube_is_solved_one_level_down() {
    let (_, cube) = meshes().swap_remove(0);
    let mut points = cube.points().to_vec();
    points[3] += DVec3::new(0.2, 0.1, 0.3);
    let distorted = cube.with_points(points).unwrap();
    assert!(matches!(
        controls_of_mesh(&distorted),
        Err(Error::NoSolution(_))
    ));
    for levels in 1..4 {
        let dense = enrich_mesh(&distorted, levels).unwrap();
        assert_eq!(&dense.points()[..8], distorted.points());
        // The originals are in line: each is near the mean of its neighbours at a fine level.
        let [low, high] = [-0.5, 1.8].map(DVec3::splat);
        assert!(
            dense
                .points()
                .iter()
                .all(|p| p.cmpge(low).all() && p.cmple(high).all())
        );
    }
}

#[test]
fn boundaries_are_cubic_curves_and_corners_stay() {
    let (_, l) = meshes().swap_remove(2);
    let p = l.points();
    let finer = l.subdivided().unwrap();
    for corner in [0, 2, 5, 6, 7] {
        assert_eq!(finer.points()[corner], p[corner]);
    }
    // Point 4 is the boundary point with three faces of the L, between points 5 and 7.
    assert_eq!(l.valence(4), Some(3));
    assert!(finer.points()[4].distance(0.75 * p[4] + 0.125 * (p[5] + p[7])) < 1e-15);
    assert!(l.limit_positions()[4].distance(p[4] * 2.0 / 3.0 + (p[5] + p[7]) / 6.0) < 1e-15);
    // The inner edge of a boundary point with three faces and an inner point: 3/4 - 1/4, 1/4 and 1/16 of four neighbours.
    let grid = wavy(4, 4, Topology::Disk);
    let mut faces: Vec<Vec<usize>> = PolygonMesh::from_grid(&grid, Topology::Disk)
        .unwrap()
        .faces()
        .map(<[usize]>::to_vec)
        .collect();
    // A quad added outside gives point 1 a third face.
    let mut points = grid.points().to_vec();
    points.extend([DVec3::new(10.0, -9.0, 1.0), DVec3::new(21.0, -8.0, 0.0)]);
    faces.push(vec![16, 17, 2, 1]);
    let mesh = PolygonMesh::new(points, &faces).unwrap();
    assert_eq!((mesh.valence(1), mesh.is_boundary(1)), (Some(3), true));
    let q = mesh.points();
    let expected = 0.5 * q[1] + 0.25 * q[5] + (q[0] + q[4] + q[2] + q[6]) / 16.0;
    let finer = mesh.subdivided().unwrap();
    assert!(finer.points().iter().any(|p| p.distance(expected) < 1e-14));
}

#[test]
fn what_is_no_manifold_is_refused() {
    let points = |count: usize| vec![DVec3::ONE; count];
    let refused = |count: usize, faces: &[Vec<usize>], what: &str| {
        let error = PolygonMesh::new(points(count), faces)
            .unwrap_err()
            .to_string();
        assert!(error.contains(what), "{error}");
    };
    refused(3, &[vec![0, 1]], "at least 3");
    refused(3, &[vec![0, 1, 2, 1]], "twice");
    refused(3, &[vec![0, 1, 3]], "only 3 points");
    refused(
        5,
        &[vec![0, 1, 2], vec![1, 0, 3], vec![0, 1, 4]],
        "has 3 faces",
    );
    refused(4, &[vec![0, 1, 2], vec![0, 1, 3]], "same direction");
    refused(5, &[vec![0, 1, 2], vec![0, 3, 4]], "share no edge");
    refused(4, &[vec![0, 1, 2]], "belongs to no face");
    let bad = vec![DVec3::ONE, DVec3::NAN, DVec3::ONE];
    assert!(PolygonMesh::new(bad, &[[0, 1, 2]]).is_err());
    assert!(PolygonMesh::from_grid(&wavy(3, 2, Topology::Tube), Topology::Tube).is_err());
    let grid = wavy(9, 9, Topology::Disk);
    for levels in [12, 31, 63, 64, 1000, usize::MAX] {
        assert!(matches!(
            enrich_grid(&grid, Topology::Disk, levels),
            Err(Error::Unsupported(_))
        ));
        let mesh = PolygonMesh::from_grid(&grid, Topology::Disk).unwrap();
        assert!(matches!(
            enrich_mesh(&mesh, levels),
            Err(Error::Unsupported(_))
        ));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn enrichment_moves_with_the_points(
        m in 2usize..7,
        n in 3usize..7,
        shift in prop::array::uniform3(-1e3..1e3f64),
        topology in prop::sample::select(TOPOLOGIES.to_vec()),
    ) {
        let grid = wavy(m, n, topology);
        let shift = DVec3::from(shift);
        let moved = grid.map(|p| 2.0 * p + shift).unwrap();
        let a = enrich_grid(&grid, topology, 2).unwrap();
        let b = enrich_grid(&moved, topology, 2).unwrap();
        for (p, q) in a.points().iter().zip(b.points()) {
            prop_assert!((2.0 * *p + shift).distance(*q) < 1e-10);
        }
    }
}

//! Networks over layouts of exact shapes.

mod mends;

use super::network::Network;
use super::state::vertex_normals;
use super::system::{Element, scalar};
use super::*;
use crate::layout::{LayoutEdge, LayoutFace, LayoutOptions, layout};
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::progress::{Silent, Stopped};
use nurbskin_scan::mesh::repair::repair;
use nurbskin_scan::mesh::samples::Mesh;

/// A closed grid of m x n quads, each split in two, wrapped both ways.
fn torus(major: f64, minor: f64, [m, n]: [u32; 2]) -> Manifold {
    let turn = std::f64::consts::TAU;
    let at = |i: u32, j: u32| {
        let (a, b) = (
            turn * f64::from(i) / f64::from(m),
            turn * f64::from(j) / f64::from(n),
        );
        let r = major + minor * b.cos();
        DVec3::new(r * a.cos(), r * a.sin(), minor * b.sin())
    };
    let index = |i: u32, j: u32| (i % m) * n + j % n;
    let points = (0..m * n).map(|k| at(k / n, k % n)).collect();
    let triangles = (0..m * n)
        .flat_map(|k| {
            let (i, j) = (k / n, k % n);
            let [a, b, c, d] = [
                index(i, j),
                index(i + 1, j),
                index(i + 1, j + 1),
                index(i, j + 1),
            ];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    Manifold {
        points,
        source: (0..m * n).map(Some).collect(),
        triangles,
        loops: Vec::new(),
    }
}

/// A cube from -1 to 1 of n x n squares a side, projected by `f`.
fn cube(n: u32, f: impl Fn(DVec3) -> DVec3) -> Manifold {
    let mut points: Vec<DVec3> = Vec::new();
    let mut known = std::collections::BTreeMap::new();
    let mut triangles = Vec::new();
    let mut vertex = |p: [i64; 3]| {
        *known.entry(p).or_insert_with(|| {
            points.push(f(
                DVec3::from(p.map(|x| x as f64)) / f64::from(n) * 2.0 - DVec3::ONE
            ));
            super::network::number(points.len() - 1)
        })
    };
    let side = i64::from(n);
    for axis in 0..3 {
        for (end, turn) in [(0, true), (side, false)] {
            for i in 0..side {
                for j in 0..side {
                    let mut corner = |di: i64, dj: i64| {
                        let mut p = [0; 3];
                        p[axis] = end;
                        p[(axis + 1) % 3] = i + di;
                        p[(axis + 2) % 3] = j + dj;
                        vertex(p)
                    };
                    let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                    let two = [[a, b, c], [a, c, d]];
                    triangles.extend(two.map(|[x, y, z]| if turn { [x, z, y] } else { [x, y, z] }));
                }
            }
        }
    }
    let source = (0..super::network::number(points.len()))
        .map(Some)
        .collect();
    Manifold {
        points,
        source,
        triangles,
        loops: Vec::new(),
    }
}

/// The vertices of a mesh, with these normals and this noise.
fn target_of<'a>(mesh: &'a Manifold, normals: &'a [DVec3], noise: f64) -> Target<'a> {
    Target {
        mesh,
        crossed: &[],
        untangled: false,
        points: &mesh.points,
        normals,
        noise,
    }
}

/// Options that ask for a tolerance at a share of the points, and for nothing beyond it.
fn asking_for(tolerance: f64, share_within: f64) -> FitOptions {
    FitOptions {
        tolerance,
        share_within,
        beyond_share: false,
        requested: true,
        max_control_points: 20_000,
        most_folding: 1.0,
    }
}

/// A layout without feature lines.
fn smooth_layout(mesh: &Manifold) -> Layout {
    let smooth = vec![false; 3 * mesh.triangles.len()];
    layout(mesh, &smooth, &LayoutOptions::default()).unwrap()
}

fn fitted_to(mesh: &Manifold, sharp: &[bool], normals: &[DVec3], tolerance: f64) -> Fitted {
    let layout = layout(mesh, sharp, &LayoutOptions::default()).unwrap();
    layout.validate(mesh).unwrap();
    let target = target_of(mesh, normals, 0.0);
    let options = asking_for(tolerance, 1.0);
    fit(&target, &layout, &options, &Silent).unwrap()
}

#[test]
fn an_aim_takes_fewer_control_points_than_a_request() {
    let wave = |p: DVec3| p.normalize() * (10.0 + 0.6 * (0.9 * p.x).sin() * (0.7 * p.y).cos());
    let mesh = cube(24, |p| wave(10.0 * p.normalize()));
    // Nearly those of the surface.
    let normals: Vec<DVec3> = mesh.points.iter().map(|p| p.normalize()).collect();
    let layout = smooth_layout(&mesh);
    let target = target_of(&mesh, &normals, 0.0);
    let tolerance = 0.01;
    let fitted = |share_within: f64, requested: bool| {
        let options = FitOptions {
            requested,
            ..asking_for(tolerance, share_within)
        };
        let network = fit(&target, &layout, &options, &Silent).unwrap();
        let within = network.distances.iter().filter(|d| **d <= tolerance);
        let share = within.count() as f64 / mesh.points.len() as f64;
        assert!(share >= share_within, "{share}");
        let counts = network.faces.iter().map(|f| f.surface.distinct_counts());
        counts.map(|[nu, nv]| nu * nv).sum::<usize>()
    };
    let [aim, request] = [(0.95, false), (0.98, true)].map(|(share, asked)| fitted(share, asked));
    assert!(aim < request, "{aim} {request}");
}

/// The largest distance of the two surfaces beside an edge from its curve, and the largest angle between their normals at
/// smooth ones, in degrees.
fn seams(network: &Fitted) -> [f64; 2] {
    let mut uses: Vec<Vec<(usize, usize, bool)>> = vec![Vec::new(); network.edges.len()];
    for (f, face) in network.faces.iter().enumerate() {
        for (k, side) in face.sides.iter().enumerate() {
            uses[side.edge as usize].push((f, k, side.reversed));
        }
    }
    let [mut gap, mut jump] = [0.0_f64; 2];
    for (edge, uses) in network.edges.iter().zip(&uses) {
        for step in 0..=32 {
            let t = f64::from(step) / 32.0;
            let mut normals = Vec::new();
            for &(f, k, reversed) in uses {
                let s = if reversed { 1.0 - t } else { t };
                let [u, v] = [[s, 0.0], [1.0, s], [s, 1.0], [0.0, s]][k];
                let at = network.faces[f].surface.derivatives(u, v);
                gap = gap.max(at.point.distance(edge.curve.point(t)));
                normals.push(at.du.cross(at.dv).normalize());
            }
            if let (EdgeKind::Smooth, [a, b]) = (edge.kind, &normals[..]) {
                jump = jump.max(a.cross(*b).length().atan2(a.dot(*b)).to_degrees());
            }
        }
    }
    [gap, jump]
}

#[test]
fn an_exact_sphere() {
    let mesh = cube(24, |p| 10.0 * p.normalize());
    let normals: Vec<DVec3> = mesh.points.iter().map(|p| p.normalize()).collect();
    let diagonal = 20.0 * 3.0_f64.sqrt();
    let network = fitted_to(
        &mesh,
        &vec![false; 3 * mesh.triangles.len()],
        &normals,
        5e-4 * diagonal,
    );
    let [gap, jump] = seams(&network);
    assert!(gap < 1e-12 * diagonal, "{gap}");
    assert!(jump < 0.1, "{jump} degrees");
    assert!(network.distances.iter().all(|&d| d <= 5e-4 * diagonal));
    // The surface between the points is a sphere, too.
    for face in &network.faces {
        for k in 0..100 {
            let p = face
                .surface
                .point(f64::from(k % 10) / 9.0, f64::from(k / 10) / 9.0);
            assert!(
                (p.length() - 10.0).abs() < 1e-3 * diagonal,
                "{}",
                p.length()
            );
        }
    }
}

#[test]
fn an_exact_torus_with_normals_inwards() {
    let mesh = torus(30.0, 10.0, [60, 24]);
    let normals: Vec<DVec3> = mesh
        .points
        .iter()
        .map(|p| -(*p - 30.0 * DVec3::new(p.x, p.y, 0.0).normalize()).normalize())
        .collect();
    let network = fitted_to(
        &mesh,
        &vec![false; 3 * mesh.triangles.len()],
        &normals,
        0.06,
    );
    let [gap, jump] = seams(&network);
    assert!(gap < 1e-10, "{gap}");
    assert!(jump < 0.2, "{jump} degrees");
    assert!(network.distances.iter().all(|&d| d <= 0.06));
}

#[test]
fn a_cube_keeps_its_edges() {
    let mesh = cube(12, |p| p);
    let adjacency = mesh.adjacency();
    let normal = |t: usize| mesh.vector_area(t).normalize();
    let sharp: Vec<bool> = (0..3 * mesh.triangles.len())
        .map(|side| normal(side / 3).dot(normal(adjacency.opposite[side] as usize / 3)) < 0.5)
        .collect();
    let normals: Vec<DVec3> = mesh.points.iter().map(|p| p.normalize()).collect();
    let network = fitted_to(&mesh, &sharp, &normals, 1e-3);
    let [gap, jump] = seams(&network);
    assert!(gap < 1e-12 && jump < 0.1, "{gap} {jump}");
    let length = |e: &FittedEdge| e.curve.point(0.0).distance(e.curve.point(1.0));
    let sharp: f64 = network
        .edges
        .iter()
        .filter(|e| e.kind == EdgeKind::Sharp)
        .map(length)
        .sum();
    assert!((sharp - 24.0).abs() < 0.1, "{sharp}");
    let worst = network.distances.iter().copied().fold(0.0, f64::max);
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn knots_do_not_change_the_surface() {
    let mesh = torus(3.0, 1.0, [40, 16]);
    let layout = smooth_layout(&mesh);
    let mut network = Network::new(&layout, &[0.5]).unwrap();
    // Any unknowns will do.
    for (k, x) in network.x.iter_mut().enumerate() {
        *x += 0.3
            * DVec3::new(
                (k as f64 * 1.3).sin(),
                (k as f64 * 0.7).cos(),
                (k as f64 * 2.1).sin(),
            );
    }
    network.update_nets();
    let places: Vec<(usize, f64, f64)> = (0..200)
        .map(|k| {
            (
                k % network.faces.len(),
                (k as f64 * 0.377).fract(),
                (k as f64 * 0.619).fract(),
            )
        })
        .collect();
    let points = |network: &Network| -> Vec<DVec3> {
        places
            .iter()
            .map(|&(f, u, v)| network.faces[f].patch().point(u, v))
            .collect()
    };
    let before = points(&network);
    network
        .add_knots(
            &[(0, 0.25), (3, 0.75), (3, 0.625)],
            &[(1, 0, 0.25), (1, 1, 0.125), (2, 1, 0.75)],
        )
        .unwrap();
    for (a, b) in points(&network).iter().zip(before) {
        assert!(a.distance(b) < 1e-13, "{}", a.distance(b));
    }
}

#[test]
fn the_same_for_any_number_of_threads() {
    let mesh = torus(3.0, 1.0, [40, 16]);
    let normals: Vec<DVec3> = mesh
        .points
        .iter()
        .map(|p| (*p - 3.0 * DVec3::new(p.x, p.y, 0.0).normalize()).normalize())
        .collect();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            fitted_to(
                &mesh,
                &vec![false; 3 * mesh.triangles.len()],
                &normals,
                0.004,
            )
        })
    };
    let [one, three] = [run(1), run(3)];
    for (a, b) in one.faces.iter().zip(&three.faces) {
        assert_eq!(a.surface, b.surface);
    }
    assert_eq!(one.distances, three.distances);
}

#[test]
fn noise_is_averaged_out() {
    let mesh = torus(30.0, 10.0, [150, 60]);
    let normal = |p: &DVec3| (*p - 30.0 * DVec3::new(p.x, p.y, 0.0).normalize()).normalize();
    let normals: Vec<DVec3> = mesh.points.iter().map(normal).collect();
    // Uniform noise of standard deviation 0.05, by a linear congruence.
    let mut state = 7_u64;
    let mut random = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let points: Vec<DVec3> = mesh
        .points
        .iter()
        .zip(&normals)
        .map(|(p, n)| *p + 0.05 * 12.0_f64.sqrt() * (random() - 0.5) * *n)
        .collect();
    let noisy = Manifold {
        points,
        ..mesh.clone()
    };
    let layout = smooth_layout(&noisy);
    let target = target_of(&noisy, &normals, 0.05);
    let options = asking_for(0.15, 0.995);
    let network = fit(&target, &layout, &options, &Silent).unwrap();
    let off: Vec<f64> = each(network.faces.len(), |f| {
        (0..64)
            .map(|k| {
                network.faces[f]
                    .surface
                    .point(f64::from(k % 8) / 7.0, f64::from(k / 8) / 7.0)
            })
            .map(|p| {
                let axis = 30.0 * DVec3::new(p.x, p.y, 0.0).normalize();
                p.distance(axis) - 10.0
            })
            .collect::<Vec<f64>>()
    })
    .concat();
    let rms = (off.iter().map(|d| d * d).sum::<f64>() / off.len() as f64).sqrt();
    assert!(rms < 0.5 * 0.05, "{rms}");
}

#[test]
fn points_beyond_an_open_side_do_not_bend_it() {
    // A flat square, and beside it a row of points that lie higher.
    let n = 24_u32;
    let square = Mesh::lattice([n, n], [false; 2], |u, v| DVec3::new(u, v, 0.0));
    let mesh = repair(&square.points, &square.triangles, &Silent)
        .unwrap()
        .manifold;
    let beyond = (0..n).map(|k| DVec3::new(1.08, f64::from(k) / f64::from(n - 1), 0.02));
    let points: Vec<DVec3> = mesh.points.iter().copied().chain(beyond).collect();
    let normals = vec![DVec3::Z; points.len()];
    let target = Target {
        points: &points,
        ..target_of(&mesh, &normals, 0.0)
    };
    let options = asking_for(1e-3, 1.0);
    let found = fit(&target, &smooth_layout(&mesh), &options, &Silent).unwrap();
    for face in &found.faces {
        for p in face.surface.control_points().points() {
            assert!(p.z.abs() < 2e-3, "{p}");
        }
    }
    // They ask for no knots either.
    let count: usize = found
        .faces
        .iter()
        .map(|face| face.surface.control_points().points().len())
        .sum();
    assert!(count <= 25 * found.faces.len(), "{count}");
}

#[test]
fn bad_input_is_refused() {
    let mesh = torus(3.0, 1.0, [20, 10]);
    let flags = vec![false; 3 * mesh.triangles.len()];
    let good = layout(&mesh, &flags, &LayoutOptions::default()).unwrap();
    let normals = vec![DVec3::Z; mesh.points.len()];
    let target = target_of(&mesh, &normals, 0.0);
    let options = FitOptions {
        max_control_points: 1000,
        ..asking_for(0.01, 1.0)
    };
    let refused = |layout: &Layout, target: &Target, options: &FitOptions| {
        fit(target, layout, options, &Silent).is_err()
    };
    assert!(refused(
        &good,
        &target,
        &FitOptions {
            tolerance: f64::NAN,
            ..options
        }
    ));
    assert!(refused(
        &good,
        &Target {
            normals: &normals[1..],
            ..target
        },
        &options
    ));
    let mut short = good.clone();
    short.start.pop();
    assert!(refused(&short, &target, &options));
    let mut wrong = good.clone();
    wrong.faces[0].sides[0].edge = u32::MAX;
    assert!(refused(&wrong, &target, &options));
    assert!(matches!(
        fit(&target, &good, &options, &Stopped),
        Err(Error::Cancelled)
    ));
}

#[test]
fn rows_of_an_element_add_up() {
    let rows: [&[(u32, f64)]; 2] = [&[(3, 1.0), (7, -1.0)], &[(7, 2.0), (9, 0.5)]];
    let mut element = Element::over(rows.into_iter());
    for row in rows {
        element.add_row(row, &scalar(1.0), DVec3::X);
    }
    assert_eq!(element.nodes, [3, 7, 9]);
}

#[test]
fn bending_of_a_parabola() {
    // S = (3 u, 2 v, 5 u^2): S_uu = 10, so that the energy is 3 x 2 x 10^2 / 3^4.
    let side = |edge: u32| Side {
        edge,
        reversed: false,
    };
    let vertices = [
        [0.0, 0.0, 0.0],
        [3.0, 0.0, 5.0],
        [3.0, 2.0, 5.0],
        [0.0, 2.0, 0.0],
    ]
    .map(DVec3::from);
    let edge = |a, b, line| LayoutEdge {
        ends: [a, b],
        kind: EdgeKind::Open,
        line: Some(line),
    };
    let layout = Layout {
        vertices: vertices.to_vec(),
        edges: vec![edge(0, 1, 0), edge(1, 2, 1), edge(3, 2, 2), edge(0, 3, 3)],
        faces: vec![LayoutFace {
            corners: [0, 1, 2, 3],
            sides: [side(0), side(1), side(2), side(3)],
        }],
        ..Layout::default()
    };
    let mut network = Network::new(&layout, &[0.25, 0.5]).unwrap();
    let face = &mut network.faces[0];
    let [u, v] = face.knots.clone();
    let (t, heights) = (u.knots(), v.greville());
    face.net = heights
        .iter()
        .flat_map(|&y| {
            (0..u.control_point_count()).map(move |i| {
                // The blossoms of u and of u^2.
                let [a, b, c] = [t[i + 1], t[i + 2], t[i + 3]];
                DVec3::new(a + b + c, 2.0 * y, 5.0 * (a * b + a * c + b * c) / 3.0)
            })
        })
        .collect();
    let energy = super::terms::energy(face, [3.0, 2.0]);
    assert!((energy - 600.0 / 81.0).abs() < 1e-10, "{energy}");
}

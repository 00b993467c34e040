//! Oracles: shapes with known charts, invariants, and real scans if they are available.

use super::layout::Surface;
use super::relax::lay_out;
use super::sides::{NONE, Sides, ends};
use super::*;
use crate::chart::Topology;
use glam::{DMat3, DQuat, DVec2, DVec3};
use nurbskin_geometry::Error;
use nurbskin_geometry::progress::Silent;
use nurbskin_scan::mesh::Manifold;
use std::f64::consts::{PI, TAU};

/// A mesh with its borders, longest first.
fn manifold(points: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Manifold {
    let sides = Sides::new(&triangles);
    let mut next = vec![NONE; points.len()];
    for &side in sides.edges.iter() {
        if sides.partner[side as usize] == NONE {
            let [a, b] = ends(&triangles, side);
            next[a as usize] = b;
        }
    }
    let mut loops = Vec::new();
    for k in 0..points.len() {
        let (mut border, mut at) = (Vec::new(), k);
        while next[at] != NONE {
            border.push(u32::try_from(at).unwrap());
            at = std::mem::replace(&mut next[at], NONE) as usize;
        }
        if !border.is_empty() {
            loops.push(border);
        }
    }
    let mut mesh = Manifold {
        source: vec![None; points.len()],
        points,
        triangles,
        loops,
    };
    let mut order: Vec<usize> = (0..mesh.loops.len()).collect();
    order.sort_by(|&a, &b| mesh.border_length(b).total_cmp(&mesh.border_length(a)));
    mesh.loops = order.iter().map(|&k| mesh.loops[k].clone()).collect();
    mesh
}

/// A lattice of m x n vertices mapped by `shape`, closed in the given directions, without the cells for which `cut`
/// holds; vertices without a triangle are left out.
fn lattice(
    [m, n]: [u32; 2],
    [closed_u, closed_v]: [bool; 2],
    shape: impl Fn(f64, f64) -> DVec3,
    cut: impl Fn(u32, u32) -> bool,
) -> Manifold {
    let points: Vec<DVec3> = (0..m * n)
        .map(|k| shape(f64::from(k % m), f64::from(k / m)))
        .collect();
    let mut triangles = Vec::new();
    for j in 0..if closed_v { n } else { n - 1 } {
        for i in 0..if closed_u { m } else { m - 1 } {
            let k = |i: u32, j: u32| (j % n) * m + i % m;
            if !cut(i, j) {
                triangles.push([k(i, j), k(i + 1, j), k(i + 1, j + 1)]);
                triangles.push([k(i, j), k(i + 1, j + 1), k(i, j + 1)]);
            }
        }
    }
    let mut number = vec![NONE; points.len()];
    let mut used = Vec::new();
    for k in triangles.as_flattened_mut() {
        if number[*k as usize] == NONE {
            number[*k as usize] = u32::try_from(used.len()).unwrap();
            used.push(points[*k as usize]);
        }
        *k = number[*k as usize];
    }
    manifold(used, triangles)
}

fn chart(mesh: &Manifold) -> MeshChart {
    chart_of_mesh(mesh, &Silent).unwrap()
}

/// Distance round a circle of length 1.
fn around(a: f64, b: f64) -> f64 {
    let d = (a - b).rem_euclid(1.0);
    d.min(1.0 - d)
}

/// Largest difference of `values` from `truth`, up to a shift and the direction.
fn round_error(values: &[f64], truth: &[f64]) -> f64 {
    let error = |sign: f64| {
        let shift = values[0] - sign * truth[0];
        let off = values.iter().zip(truth);
        off.map(|(v, t)| around(*v, sign * t + shift))
            .fold(0.0, f64::max)
    };
    error(1.0).min(error(-1.0))
}

/// A tube without symmetry: bent, oval, bulging, with a finger.
fn odd_tube() -> Manifold {
    let shape = |i: f64, j: f64| {
        let (a, s) = (TAU * i / 48.0, j / 30.0);
        let finger = 0.5 * (-8.0 * ((a - 2.0).powi(2) + 9.0 * (s - 0.6).powi(2))).exp();
        let r = 1.0 + 0.2 * (5.0 * s).sin() + finger;
        let (x, y) = (3.0 + r * a.cos(), 0.7 * r * a.sin() + 0.3 * s);
        DVec3::new(x * (1.2 * s).cos(), y, x * (1.2 * s).sin())
    };
    lattice([48, 31], [true, false], shape, |_, _| false)
}

#[test]
fn tubes_of_revolution_have_their_angle_and_their_length() {
    // Cylinder, frustum.
    for slope in [0.0, -0.12] {
        let shape = move |i: f64, j: f64| {
            let (a, z) = (TAU * i / 60.0, 0.1 * j);
            let r = 1.0 + slope * z;
            DVec3::new(r * a.cos(), r * a.sin(), z)
        };
        let mesh = lattice([60, 41], [true, false], shape, |_, _| false);
        let chart = chart(&mesh);
        assert_eq!(chart.topology, Topology::Tube);
        assert!(chart.quality.folded <= 0.0);
        let angles: Vec<f64> = mesh.points.iter().map(|p| p.y.atan2(p.x) / TAU).collect();
        let v: Vec<f64> = chart.places.iter().map(|p| p.y).collect();
        // A tenth of an edge.
        let error = round_error(&v, &angles);
        assert!(error < 0.1 / 60.0, "{error}");
        let turned = chart.places[0].x > 0.5;
        for (p, at) in mesh.points.iter().zip(&chart.places) {
            let u = if turned { 1.0 - at.x } else { at.x };
            assert!((u - p.z / 4.0).abs() < 0.2 / 40.0, "{u} {}", p.z / 4.0);
        }
        let length = 4.0 * (1.0_f64 + slope * slope).sqrt();
        assert!((chart.size[0] - length).abs() < 0.01 * length);
        let girth = TAU * (1.0 + 2.0 * slope);
        assert!((chart.size[1] - girth).abs() < 0.01 * girth);
    }
}

#[test]
fn bent_tubes_are_not_twisted() {
    // A quarter of a ring: by symmetry its innermost and outermost lines are lines of constant v, half a turn apart.
    let shape = |i: f64, j: f64| {
        let (a, b) = (TAU * i / 40.0, 0.25 * TAU * j / 30.0);
        let r = 3.0 + a.cos();
        DVec3::new(r * b.cos(), r * b.sin(), a.sin())
    };
    let mesh = lattice([40, 31], [true, false], shape, |_, _| false);
    let chart = chart(&mesh);
    assert!(chart.quality.folded <= 0.0);
    let line = |radius: f64| {
        let on = |p: &&DVec3| (p.truncate().length() - radius).abs() < 1e-9;
        let places = mesh
            .points
            .iter()
            .zip(&chart.places)
            .filter(move |(p, _)| on(p));
        places.map(|(_, at)| at.y).collect::<Vec<f64>>()
    };
    let (inner, outer) = (line(2.0), line(4.0));
    assert!(inner.len() == 31 && outer.len() == 31);
    for (a, b) in inner.iter().zip(&outer) {
        // The diagonals of the lattice are not symmetric: a quarter of an edge.
        let (twist, apart) = (around(*a, inner[0]), around(*b, a + 0.5));
        assert!(twist < 0.25 / 40.0 && apart < 0.5 / 40.0, "{twist} {apart}");
    }
}

#[test]
fn closed_shapes_have_poles_at_their_ends() {
    // An egg of revolution about a skew axis, from an octahedron whose sides are cut in 16.
    let mut mesh = octahedron(16);
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -0.7, 0.3));
    for p in &mut mesh.points {
        *p = turn * (p.normalize() * DVec3::new(1.0, 1.0, 2.0));
    }
    let chart = chart(&mesh);
    assert_eq!(chart.topology, Topology::Sphere);
    assert!(chart.quality.folded <= 0.0);
    let axis = turn * DVec3::Z;
    let poles = chart.poles.unwrap().map(|k| mesh.points[k as usize]);
    for p in poles {
        assert!(p.dot(axis).abs() > 1.95, "{p}");
    }
    let sign = poles[0].dot(axis).signum();
    // Along a meridian u is the part of its length.
    let length = |z: f64| {
        let steps = 2000;
        let at = |k: i32| (z.acos() * f64::from(k) / f64::from(steps)).sin_cos();
        (1..=steps).fold(0.0, |sum, k| {
            let ((s, c), (t, d)) = (at(k - 1), at(k));
            sum + (s - t).hypot(2.0 * (c - d))
        })
    };
    let whole = length(-1.0);
    for (p, at) in mesh.points.iter().zip(&chart.places).step_by(7) {
        let z = (sign * p.dot(axis) / 2.0).clamp(-1.0, 1.0);
        assert!((at.x - length(z) / whole).abs() < 0.02);
    }
    // S_u x S_v looks outward, as the triangles do.
    assert!(chart.quality.smallest_jacobian > 0.05);
    assert!(chart.quality.stretch < 1.25);
}

#[test]
fn poles_are_where_the_finished_chart_stretches_least() {
    // Busts: a head over a neck, and shoulders that are `wide`, so that a corner of them is the farthest from the top.
    for wide in [1.5, 2.0, 3.0] {
        let mut mesh = octahedron(20);
        for p in &mut mesh.points {
            let q = p.normalize();
            let neck = 1.0 - 0.6 * (-((q.z + 0.1) / 0.25).powi(2)).exp();
            let below = ((-0.3 - q.z) / 0.3).clamp(0.0, 1.0);
            *p = DVec3::new(q.x * (1.0 + (wide - 1.0) * below), q.y, 1.0) * neck;
            p.z = 1.5 * q.z;
        }
        let chosen = chart(&mesh);
        let surface = Surface::new(&mesh.points, &mesh.triangles);
        let finished = |poles: [u32; 2]| {
            let (mut setup, start) = closed::sphere(&surface, poles).unwrap();
            lay_out(&surface, &mut setup, start, 8, &Silent).unwrap()
        };
        let pairs = poles::candidates(&surface);
        let all: Vec<f64> = pairs.iter().map(|&p| finished(p).stretch.mean).collect();
        let own = finished(chosen.poles.unwrap()).stretch.mean;
        let least = all.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(own <= 1.006 * least, "{own} {all:?}");
    }
}

/// A sphere of eight sides, each edge cut in `n`, wound outward; vertices on the octahedron.
fn octahedron(n: i32) -> Manifold {
    use std::collections::BTreeMap;
    let mut numbers: BTreeMap<[i32; 3], u32> = BTreeMap::new();
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    let mut number = |p: [i32; 3]| {
        *numbers.entry(p).or_insert_with(|| {
            points.push(DVec3::from(p.map(f64::from)));
            u32::try_from(points.len() - 1).unwrap()
        })
    };
    for octant in 0..8 {
        let sign = [0, 1, 2].map(|k| if octant >> k & 1 == 0 { 1 } else { -1 });
        let even = sign.iter().product::<i32>() > 0;
        for i in 0..n {
            for j in 0..n - i {
                let mut at =
                    |i: i32, j: i32| number([sign[0] * i, sign[1] * j, sign[2] * (n - i - j)]);
                let mut cell = vec![[at(i, j), at(i + 1, j), at(i, j + 1)]];
                if i + j + 2 <= n {
                    cell.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
                for [a, b, c] in cell {
                    triangles.push(if even { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    manifold(points, triangles)
}

#[test]
fn rings_have_their_short_and_their_long_way_round() {
    let shape = |i: f64, j: f64| {
        // A lattice that twists as it goes round: the short way and the long way must be found.
        let (b, a) = (TAU * j / 72.0, TAU * (i / 24.0 + j / 72.0));
        let r = 3.0 + a.cos();
        DVec3::new(r * b.cos(), r * b.sin(), a.sin())
    };
    let mesh = lattice([24, 72], [true, true], shape, |_, _| false);
    let chart = chart(&mesh);
    assert_eq!(chart.topology, Topology::Torus);
    assert!(chart.quality.folded <= 0.0);
    let long: Vec<f64> = mesh.points.iter().map(|p| p.y.atan2(p.x) / TAU).collect();
    let v: Vec<f64> = chart.places.iter().map(|p| p.y).collect();
    assert!(
        round_error(&v, &long) < 1.0 / 72.0,
        "{}",
        round_error(&v, &long)
    );
    let short = |p: &DVec3| p.z.atan2(p.truncate().length() - 3.0) / TAU;
    let short: Vec<f64> = mesh.points.iter().map(short).collect();
    let u: Vec<f64> = chart.places.iter().map(|p| p.x).collect();
    // By length the angle is spaced evenly but for the root mean square over longer outer lines: within two edges.
    assert!(
        round_error(&u, &short) < 2.0 / 24.0,
        "{}",
        round_error(&u, &short)
    );
    assert!((chart.size[0] - TAU).abs() < 0.15 && (chart.size[1] - 3.0 * TAU).abs() < 0.6);
}

#[test]
fn plane_rectangles_are_mapped_by_an_affine_map() {
    let shape = |i: f64, j: f64| DVec3::new(0.2 * i, 0.25 * j, 3.0);
    let mesh = lattice([31, 17], [false; 2], shape, |_, _| false);
    let chart = chart(&mesh);
    assert_eq!(chart.topology, Topology::Disk);
    let mut size = chart.size;
    size.sort_by(f64::total_cmp);
    assert!(
        (size[0] - 4.0).abs() < 1e-3 && (size[1] - 6.0).abs() < 1e-3,
        "{size:?}"
    );
    // From three corners the rest follows.
    let at = |i: usize, j: usize| {
        let p = DVec3::new(0.2 * i as f64, 0.25 * j as f64, 3.0);
        let k = mesh.points.iter().position(|q| q.distance(p) < 1e-9);
        chart.places[k.unwrap()]
    };
    let (origin, x, y) = (at(0, 0), at(30, 0) - at(0, 0), at(0, 16) - at(0, 0));
    assert!((x.perp_dot(y) - 1.0).abs() < 1e-3);
    for (p, t) in mesh.points.iter().zip(&chart.places) {
        let expected = origin + x * (p.x / 6.0) + y * (p.y / 4.0);
        assert!(t.distance(expected) < 1e-3, "{t} {expected}");
    }
}

/// A square lattice of -1..1 put on a disk of radius 1.
fn on_disk(i: f64, j: f64, n: f64) -> DVec2 {
    let p = DVec2::new(2.0 * i / n - 1.0, 2.0 * j / n - 1.0);
    DVec2::new(
        p.x * (1.0 - 0.5 * p.y * p.y).sqrt(),
        p.y * (1.0 - 0.5 * p.x * p.x).sqrt(),
    )
}

/// The cap of the unit sphere to this angle from its middle.
fn cap(angle: f64) -> Manifold {
    let shape = move |i, j| {
        let p = on_disk(i, j, 40.0);
        let (polar, around) = (angle * p.length(), p.y.atan2(p.x));
        DVec3::new(
            polar.sin() * around.cos(),
            polar.sin() * around.sin(),
            polar.cos(),
        )
    };
    lattice([41, 41], [false; 2], shape, |_, _| false)
}

#[test]
fn caps_saddles_and_fingers_lie_flat_without_folds() {
    let saddle = |i: f64, j: f64| {
        let p = DVec2::new(i / 15.0 - 1.0, j / 15.0 - 1.0);
        DVec3::new(p.x, p.y, 1.5 * (p.x * p.x - p.y * p.y))
    };
    let finger = |i: f64, j: f64| {
        let p = DVec2::new(i / 20.0 - 1.0, j / 20.0 - 1.0);
        DVec3::new(p.x, p.y, 1.5 * (-p.length_squared() / 0.1).exp())
    };
    for (mesh, most) in [
        (cap(1.57), 1.15),
        (cap(2.1), 1.3),
        (lattice([31, 31], [false; 2], saddle, |_, _| false), 1.3),
        (lattice([41, 41], [false; 2], finger, |_, _| false), 1.5),
    ] {
        let chart = chart(&mesh);
        assert!(chart.quality.folded <= 0.0, "{}", chart.reason);
        assert!(chart.quality.smallest_jacobian > 0.0);
        assert!(chart.quality.stretch < most, "{}", chart.reason);
    }
}

#[test]
fn ragged_rims_do_not_bend_the_lines() {
    // A cylinder and a plane with cells missing along their rims: the lines stay those of the whole shape.
    let shape = |i: f64, j: f64| {
        let (a, z) = (TAU * i / 60.0, 0.1 * j);
        DVec3::new(a.cos(), a.sin(), z)
    };
    let teeth = |i: u32, j: u32| j == 0 && i % 3 == 1 || j == 39 && i % 4 == 2;
    let tube = lattice([60, 41], [true, false], shape, teeth);
    let flat = |i: f64, j: f64| DVec3::new(0.1 * i, 0.1 * j, 0.0);
    let sheet = lattice([61, 41], [false; 2], flat, |i, j| {
        teeth(i, j) && (3..57).contains(&i)
    });
    for (mesh, axis) in [(tube, 2), (sheet, 1)] {
        let chart = chart(&mesh);
        assert!(chart.quality.folded <= 0.0, "{}", chart.reason);
        // The coordinate of the domain that runs across the ragged rims.
        let across = |k: usize| chart.places.iter().map(move |p| p[k]);
        let slope = |k: usize| {
            let values: Vec<f64> = across(k).collect();
            let x: Vec<f64> = mesh.points.iter().map(|p| p[axis]).collect();
            let n = x.len() as f64;
            let (mx, mv) = (x.iter().sum::<f64>() / n, values.iter().sum::<f64>() / n);
            let sxx: f64 = x.iter().map(|x| (x - mx).powi(2)).sum();
            let sxv: f64 = x
                .iter()
                .zip(&values)
                .map(|(x, v)| (x - mx) * (v - mv))
                .sum();
            let slope = sxv / sxx;
            let off = x.iter().zip(&values);
            let worst = off
                .map(|(x, v)| (v - mv - slope * (x - mx)).abs())
                .fold(0.0, f64::max);
            (slope.abs(), worst)
        };
        let (of_u, of_v) = (slope(0), slope(1));
        let (slope, worst) = if of_u.0 > of_v.0 { of_u } else { of_v };
        // Half an edge, of forty across.
        assert!(
            (slope - 0.25).abs() < 0.02 && worst < 0.5 / 40.0,
            "{slope} {worst}"
        );
    }
}

#[test]
fn neither_numbers_nor_motions_matter() {
    let mesh = odd_tube();
    let n = mesh.points.len();
    // 1021 is prime and no divisor of n.
    let place = |k: usize| k * 1021 % n;
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 1.4, -0.7, 2.3));
    let mut points = vec![DVec3::ZERO; n];
    for k in 0..n {
        points[place(k)] = turn * (20.0 * mesh.points[k]) + DVec3::new(50.0, -30.0, 80.0);
    }
    let relabel = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|k| u32::try_from(place(k as usize)).unwrap());
        [c, a, b]
    };
    let triangles = mesh.triangles.iter().rev().map(relabel).collect();
    let moved = manifold(points, triangles);
    let (one, two) = (chart(&mesh), chart(&moved));
    assert!(one.quality.folded <= 0.0, "{}", one.reason);
    assert!(one.quality.stretch < 1.2, "{}", one.reason);
    assert!((two.size[0] / one.size[0] - 20.0).abs() < 0.02);
    for k in 0..n {
        let (a, b) = (one.places[k], two.places[place(k)]);
        assert!(
            (a.x - b.x).abs() < 1e-3 && around(a.y, b.y) < 1e-3,
            "{a} {b}"
        );
    }
}

#[test]
fn vertices_are_placed_where_they_are() {
    for mesh in [odd_tube(), cap(1.2)] {
        let chart = chart(&mesh);
        let placed = chart.place(&mesh, &mesh.points, None).unwrap();
        let closed = chart.topology.closed();
        for (k, (own, found)) in chart.places.iter().zip(&placed.parameters).enumerate() {
            let inside = own.clamp(DVec2::ZERO, DVec2::ONE);
            let dv = if closed[1] {
                around(own.y, found.y)
            } else {
                (inside.y - found.y).abs()
            };
            assert!((inside.x - found.x).abs() < 1e-9 && dv < 1e-9, "{k}");
            assert!(placed.distances[k] < 1e-12);
        }
        // Neither non-finite points nor points far away change the places of others.
        let others = [
            DVec3::NAN,
            DVec3::INFINITY,
            DVec3::X * 1e6,
            -DVec3::INFINITY,
        ];
        let each = mesh.points.iter().zip(others.iter().cycle());
        let mixed: Vec<DVec3> = each.flat_map(|(&p, &other)| [p, other]).collect();
        let among = chart.place(&mesh, &mixed, None).unwrap();
        for (k, own) in placed.parameters.iter().enumerate() {
            assert!(own.distance(among.parameters[2 * k]) < 1e-9, "{k}");
        }
    }
}

#[test]
fn walls_are_told_apart_and_what_lies_beyond_is_said() {
    // A strip folded over: two sheets a hundredth apart, outside up and down.
    let shape = |i: f64, j: f64| {
        let x = i / 20.0;
        if x < 1.0 {
            DVec3::new(x, j / 20.0, 0.01)
        } else {
            DVec3::new(2.05 - x, j / 20.0, 0.0)
        }
    };
    let mesh = lattice([42, 21], [false; 2], shape, |_, _| false);
    let chart = chart(&mesh);
    // Nearer to the lower sheet, facing up.
    let point = DVec3::new(0.5, 0.5, 0.004);
    let up = chart.place(&mesh, &[point], Some(&[DVec3::Z])).unwrap();
    let down = chart.place(&mesh, &[point], Some(&[-DVec3::Z])).unwrap();
    assert!((up.distances[0] - 0.006).abs() < 1e-9 && (down.distances[0] - 0.004).abs() < 1e-9);
    assert!(up.parameters[0].distance(down.parameters[0]) > 0.4);
    let outside = DVec3::new(0.3, -0.2, 0.05);
    let placed = chart.place(&mesh, &[outside, point], None).unwrap();
    assert!((placed.beyond[0] - 0.2).abs() < 1e-9 && placed.beyond[1] == 0.0);
    assert!(matches!(
        chart.place(&odd_tube(), &[point], None),
        Err(Error::Invalid(_))
    ));
}

#[test]
fn what_is_no_domain_is_refused() {
    let shape = |i: f64, j: f64| DVec3::new(i, j, 0.0);
    let holes =
        |i: u32, j: u32| (5..8).contains(&j) && ((5..8).contains(&i) || (12..15).contains(&i));
    let mesh = lattice([21, 13], [false; 2], shape, holes);
    let error = chart_of_mesh(&mesh, &Silent).unwrap_err();
    assert!(error.to_string().contains("3 openings"), "{error}");
    assert!(matches!(
        chart_of_mesh(&Manifold::default(), &Silent),
        Err(Error::Invalid(_))
    ));
}

#[test]
fn the_domain_is_covered_once() {
    // The areas of all triangles in the domain add up to the whole of it, whichever way it wraps round.
    let ring = |i: f64, j: f64| {
        let (a, b) = (TAU * i / 20.0, TAU * j / 50.0);
        let r = 3.0 + (1.0 + 0.3 * b.sin()) * a.cos();
        DVec3::new(
            r * b.cos(),
            r * b.sin(),
            (1.0 + 0.2 * (2.0 * b).cos()) * a.sin(),
        )
    };
    for mesh in [
        lattice([20, 50], [true, true], ring, |_, _| false),
        odd_tube(),
    ] {
        let chart = chart(&mesh);
        assert!(chart.quality.folded <= 0.0, "{}", chart.reason);
        let twice = |[a, b, c]: &[DVec2; 3]| (*b - *a).perp_dot(*c - *a);
        let area = 0.5 * chart.corners.iter().map(twice).sum::<f64>();
        assert!((area - 1.0).abs() < 0.01, "{area}");
    }
    // Sanity of the oracle's own quantity.
    let cap = cap(PI / 2.0);
    let surface = Surface::new(&cap.points, &cap.triangles);
    assert_eq!(surface.sides.partner.len(), 3 * cap.triangles.len());
}

/// Real scans: nothing folds, little stretch, the topology is right.
#[test]
fn real_scans_lie_flat() {
    let Some(folder) = std::env::var_os("NURBSKIN_DATA").map(std::path::PathBuf::from) else {
        println!("NURBSKIN_DATA is not set: no real scans");
        return;
    };
    for (file, topology, most) in [
        ("tubes/ycb_mustard_body_crop.ply", Topology::Tube, 1.05),
        ("tubes/ycb_banana.obj", Topology::Sphere, 1.15),
        ("tubes/ycb_mustard_bottle.obj", Topology::Sphere, 1.15),
        ("faces/fran_cut.ply", Topology::Disk, 1.1),
        ("faces/lee_perry_smith_head.ply", Topology::Sphere, 1.6),
    ] {
        let scan = nurbskin_scan::io::read_scan(folder.join(file)).unwrap();
        let nurbskin_scan::Organisation::Mesh(triangles) = &scan.organisation else {
            panic!("{file} is no mesh");
        };
        let repaired =
            nurbskin_scan::mesh::repair::repair(&scan.points, triangles, &Silent).unwrap();
        let shape = crate::chart::shape::shape_of(&repaired.manifold, None).unwrap();
        let (mesh, _) = nurbskin_scan::mesh::holes::fill(repaired.manifold, &shape.holes);
        let chart = chart(&mesh);
        assert_eq!(chart.topology, topology, "{file}");
        assert!(chart.quality.folded <= 0.0, "{file}: {}", chart.reason);
        assert!(chart.quality.stretch < most, "{file}: {}", chart.reason);
    }
}

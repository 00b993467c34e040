use super::*;
use crate::mesh::thin::{radius_for, smooth, thin};
use crate::normals::principal_axes;
use crate::simulate::{Order, Random, ScanOptions, Shape, TrueSurface, scan};
use glam::DQuat;
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use nurbskin_geometry::progress::Silent;
use nurbskin_geometry::spatial::neighbours::Neighbours;
use std::collections::{BTreeMap, BTreeSet};

/// What the largest piece of a mesh is.
#[derive(Debug)]
struct Census {
    euler: i64,
    /// Sides of each border, descending.
    borders: Vec<usize>,
    area: f64,
    used: usize,
}

impl Census {
    /// Borders longer than this many sides, and the Euler characteristic once the others are filled.
    fn openings(&self, sides: usize) -> (usize, i64) {
        let large = self.borders.iter().filter(|&&b| b > sides).count();
        let filled = (self.borders.len() - large) as i64;
        (large, self.euler + filled)
    }
}

/// Counts by corners, so that sheets that only touch at a vertex count apart. Fails for a third triangle at a side.
fn census(points: &[DVec3], triangles: &[[u32; 3]]) -> Census {
    let mut sides: BTreeMap<(u32, u32), Vec<(usize, usize)>> = BTreeMap::new();
    for (t, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            sides.entry((a.min(b), a.max(b))).or_default().push((t, k));
        }
    }
    let mut pieces = DisjointSets::new(triangles.len());
    for beside in sides.values() {
        assert!(beside.len() <= 2, "three triangles at a side");
        if let [(t, _), (u, _)] = beside[..] {
            pieces.join(t, u);
        }
    }
    let mut sizes = vec![0; triangles.len()];
    for t in 0..triangles.len() {
        sizes[pieces.root(t)] += 1;
    }
    let largest = (0..sizes.len()).max_by_key(|&t| (sizes[t], t)).unwrap();
    let mut corners = DisjointSets::new(3 * triangles.len());
    let corner =
        |t: usize, vertex: u32| 3 * t + triangles[t].iter().position(|&k| k == vertex).unwrap();
    let (mut count, mut border) = (0, Vec::new());
    for (&(a, b), beside) in &sides {
        if pieces.root(beside[0].0) != largest {
            continue;
        }
        count += 1;
        match beside[..] {
            [(t, _), (u, _)] => {
                corners.join(corner(t, a), corner(u, a));
                corners.join(corner(t, b), corner(u, b));
            }
            _ => border.push([corner(beside[0].0, a), corner(beside[0].0, b)]),
        }
    }
    let mut loops = DisjointSets::new(3 * triangles.len());
    for side in &border {
        let [a, b] = side.map(|c| corners.root(c));
        loops.join(a, b);
    }
    let mut lengths: BTreeMap<usize, usize> = BTreeMap::new();
    for [a, _] in border {
        *lengths.entry(loops.root(corners.root(a))).or_default() += 1;
    }
    let own: Vec<usize> = (0..triangles.len())
        .filter(|&t| pieces.root(t) == largest)
        .collect();
    let vertices: BTreeSet<usize> = own
        .iter()
        .flat_map(|&t| (0..3).map(move |k| 3 * t + k))
        .map(|c| corners.root(c))
        .collect();
    let used: BTreeSet<u32> = own.iter().flat_map(|&t| triangles[t]).collect();
    let area = |&t: &usize| {
        let [a, b, c] = triangles[t].map(|k| points[k as usize]);
        0.5 * (b - a).cross(c - a).length()
    };
    let mut borders: Vec<usize> = lengths.into_values().collect();
    borders.sort_unstable_by(|a, b| b.cmp(a));
    Census {
        euler: vertices.len() as i64 - i64::from(count) + own.len() as i64,
        borders,
        area: own.iter().map(area).sum(),
        used: used.len(),
    }
}

/// Of the least-squares plane through each point and its 16 nearest; which of the two directions is left open.
fn normals_of(points: &[DVec3]) -> Vec<DVec3> {
    let table = Neighbours::new(points).table(16);
    let around = |k: usize| table.of(k).iter().map(|&j| points[j as usize]);
    let (all, own) = (0..points.len(), |k: usize| std::iter::once(points[k]));
    all.map(|k| principal_axes(around(k).chain(own(k))).1[0].1)
        .collect()
}

/// In random pose.
fn posed(points: &[DVec3], seed: u64) -> Vec<DVec3> {
    let mut random = Random::new(seed);
    let [x, y, z, w] = std::array::from_fn(|_| random.normal());
    let turn = DQuat::from_xyzw(x, y, z, w).normalize();
    points
        .iter()
        .map(|&p| turn * p + DVec3::new(x, y, z) * 100.0)
        .collect()
}

/// Thinned to about `count` points, smoothed, and triangulated.
fn mesh_of(points: &[DVec3], spacing: f64, count: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let normals = normals_of(points);
    let radius = radius_for(count, points.len(), spacing);
    let kept = thin(points, Some(&normals), radius, 0.0);
    let smoothed = smooth(points, &normals, &kept, radius, 0.0, &Silent).unwrap();
    let triangles = triangulate(&smoothed.points, &smoothed.normals, &Silent).unwrap();
    (smoothed.points, triangles)
}

fn true_area(shape: Shape) -> f64 {
    let truth = TrueSurface::new(shape);
    let n = 300;
    let middle = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
    let piece = |i, j| {
        let d = truth.derivatives(middle(i), middle(j));
        d.du.cross(d.dv).length()
    };
    let sum: f64 = (0..n).flat_map(|i| (0..n).map(move |j| piece(i, j))).sum();
    sum / f64::from(n * n)
}

#[test]
fn shapes_have_their_topology() {
    for (shape, noise, openings, euler) in [
        (Shape::Pot, 0.1, 2, 0),
        (Shape::Face, 0.2, 1, 1),
        (Shape::Handle, 0.05, 2, 0),
        (Shape::Sphere, 0.1, 0, 2),
        (Shape::Ellipsoid, 0.1, 0, 2),
        (Shape::Torus, 0.1, 0, 0),
        (Shape::Tube, 0.05, 2, 0),
        (Shape::Saddle, 0.1, 1, 1),
    ] {
        let options = ScanOptions {
            points: Some(20_000),
            noise,
            order: Order::Scattered,
            ..ScanOptions::default()
        };
        let points = posed(&scan(shape, &options).unwrap().scan.points, 7);
        let area = true_area(shape);
        let spacing = (area / points.len() as f64).sqrt();
        let (vertices, triangles) = mesh_of(&points, spacing, 5000);
        let census = census(&vertices, &triangles);
        assert_eq!(
            census.openings(12),
            (openings, euler),
            "{shape:?}: {census:?}"
        );
        assert!(
            census.borders.len() <= openings + 1,
            "{shape:?}: {census:?}"
        );
        assert!(
            (census.area / area - 1.0).abs() < 0.02,
            "{shape:?}: {} of {area}",
            census.area
        );
        assert!(census.used * 1000 >= vertices.len() * 997, "{shape:?}");
    }
}

/// Scan lines of random order, raw, on a blade with edges sharper than the spacing.
#[test]
fn sharp_edges_of_a_raw_scan() {
    let options = ScanOptions {
        order: Order::Shuffled,
        ..ScanOptions::default()
    };
    let points = posed(&scan(Shape::Blade, &options).unwrap().scan.points, 3);
    let triangles = triangulate(&points, &normals_of(&points), &Silent).unwrap();
    let census = census(&points, &triangles);
    assert_eq!(census.openings(20), (2, 0), "{census:?}");
    assert!(census.borders.len() <= 8, "{census:?}");
    assert!((census.area / true_area(Shape::Blade) - 1.0).abs() < 0.02);
}

/// A pot with an inner and an outer wall and a round rim, closed all over.
#[test]
fn thin_walls_stay_apart() {
    let mut random = Random::new(11);
    let (outer, height, thickness) = (40.0, 60.0, 3.0);
    let inner = outer - thickness;
    let rim = 0.5 * thickness;
    let lengths = [
        outer,
        height,
        std::f64::consts::PI * rim,
        height - thickness,
        inner,
    ];
    let total: f64 = lengths.iter().sum();
    let mut points = Vec::new();
    while points.len() < 40_000 {
        let (mut along, mut piece) = (random.uniform() * total, 0);
        while piece < 4 && along > lengths[piece] {
            along -= lengths[piece];
            piece += 1;
        }
        let (radius, z) = match piece {
            0 => (along, 0.0),
            1 => (outer, along),
            2 => {
                let angle = along / rim;
                (outer - rim + rim * angle.cos(), height + rim * angle.sin())
            }
            3 => (inner, thickness + along),
            _ => (along, thickness),
        };
        let turn = random.uniform() * std::f64::consts::TAU;
        if random.uniform() * outer < radius {
            points.push(DVec3::new(radius * turn.cos(), radius * turn.sin(), z));
        }
    }
    let (vertices, triangles) = mesh_of(&posed(&points, 5), 0.98, 10_000);
    let census = census(&vertices, &triangles);
    assert_eq!(census.openings(20), (0, 2), "{census:?}");
    assert!(census.borders.iter().sum::<usize>() < 200, "{census:?}");
}

#[test]
fn regular_grids_are_complete() {
    for (m, n, step) in [(40_u32, 25, 1.0), (30, 30, 3.0)] {
        let flat: Vec<DVec3> = (0..m * n)
            .map(|k| DVec3::new(f64::from(k % m), step * f64::from(k / m), 0.0))
            .collect();
        for points in [posed(&flat, 1), flat] {
            let triangles = triangulate(&points, &normals_of(&points), &Silent).unwrap();
            assert_eq!(triangles.len(), 2 * (m as usize - 1) * (n as usize - 1));
            let census = census(&points, &triangles);
            let area = step * f64::from((m - 1) * (n - 1));
            assert!((census.area - area).abs() < 1e-9 * area);
            assert_eq!((census.euler, census.borders.len()), (1, 1));
        }
    }
}

/// A sheet of uneven points with a window and a ragged border.
fn sheet() -> Vec<DVec3> {
    let mut random = Random::new(2);
    let mut points = Vec::new();
    for k in 0..2500 {
        let [x, y] = [f64::from(k % 50), f64::from(k / 50)].map(|x| x + 0.5 * random.uniform());
        let window = (x - 25.0).hypot(y - 25.0) < 3.0;
        if !window && x > 2.0 + (0.7 * y).sin() {
            points.push(DVec3::new(x, y, 3.0 * (0.1 * x).sin() * (0.1 * y).cos()));
        }
    }
    points
}

#[test]
fn windows_stay_open() {
    let points = sheet();
    let triangles = triangulate(&points, &normals_of(&points), &Silent).unwrap();
    let census = census(&points, &triangles);
    assert_eq!((census.euler, census.borders.len()), (0, 2), "{census:?}");
    assert_eq!(census.used, points.len());
}

#[test]
fn the_order_of_points_does_not_matter() {
    let points = sheet();
    let normals = normals_of(&points);
    let mut order: Vec<usize> = (0..points.len()).collect();
    Random::new(9).shuffle(&mut order);
    let shuffled: Vec<DVec3> = order.iter().map(|&k| points[k]).collect();
    // The other side for some.
    let turned: Vec<DVec3> = order
        .iter()
        .map(|&k| if k % 3 == 0 { -normals[k] } else { normals[k] })
        .collect();
    let set = |triangles: Vec<[u32; 3]>, of: &dyn Fn(u32) -> usize| -> BTreeSet<[usize; 3]> {
        let sorted = |t: [u32; 3]| {
            let mut t = t.map(of);
            t.sort_unstable();
            t
        };
        triangles.into_iter().map(sorted).collect()
    };
    let one = triangulate(&points, &normals, &Silent).unwrap();
    let other = triangulate(&shuffled, &turned, &Silent).unwrap();
    assert_eq!(
        set(one, &|k| k as usize),
        set(other, &|k| order[k as usize])
    );
}

#[test]
fn poor_input_is_no_harm() {
    let none = |points: &[DVec3]| triangulate(points, &[], &Silent).unwrap();
    assert!(none(&[]).is_empty());
    assert!(none(&[DVec3::ONE; 5]).is_empty());
    assert!(none(&[DVec3::NAN, DVec3::ZERO, DVec3::X]).is_empty());
    let line: Vec<DVec3> = (0..50).map(|k| DVec3::X * f64::from(k)).collect();
    assert!(none(&line).is_empty());
    let huge: Vec<DVec3> = sheet().iter().map(|p| *p * 1e120).collect();
    none(&huge);
    assert_eq!(none(&[DVec3::ZERO, DVec3::X, DVec3::Y]).len(), 1);
}

use super::*;
use glam::{DMat3, DQuat};

struct Mesh {
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    fn chart(&self) -> Result<Chart> {
        let parts = Parts {
            of: vec![0; self.points.len()],
            sizes: vec![self.points.len()],
        };
        chart_of_disk_mesh(&self.points, &self.normals, &self.triangles, &parts)
    }
    /// Part of the triangles that are turned over in the domain.
    fn folded(&self, chart: &Chart) -> f64 {
        let turned = self.triangles.iter().filter(|t| {
            let [a, b, c] = t.map(|k| chart.parameters[k as usize]);
            (b - a).perp_dot(c - a) < -1e-12
        });
        turned.count() as f64 / self.triangles.len() as f64
    }
}

/// A lattice of m x n vertices (0..m, 0..n) taken through `shape`, which gives place and normal, without the cells that
/// `cut` names; wound with u x v.
fn lattice(
    [m, n]: [u32; 2],
    shape: impl Fn(f64, f64) -> (DVec3, DVec3),
    cut: impl Fn(u32, u32) -> bool,
) -> Mesh {
    let vertices = (0..m * n).map(|k| shape(f64::from(k % m), f64::from(k / m)));
    let (points, normals) = vertices.unzip();
    let mut triangles = Vec::new();
    for j in 0..n - 1 {
        for i in 0..m - 1 {
            let k = j * m + i;
            if !cut(i, j) {
                triangles.extend([[k, k + 1, k + m + 1], [k, k + m + 1, k + m]]);
            }
        }
    }
    Mesh {
        points,
        normals,
        triangles,
    }
}

/// A square lattice of -1..1 put on a disk of radius 1 (x, y).
fn on_disk(i: f64, j: f64, n: f64) -> DVec2 {
    let p = DVec2::new(2.0 * i / n - 1.0, 2.0 * j / n - 1.0);
    DVec2::new(
        p.x * (1.0 - 0.5 * p.y * p.y).sqrt(),
        p.y * (1.0 - 0.5 * p.x * p.x).sqrt(),
    )
}

/// The cap of the unit sphere to this angle from its middle.
fn cap(angle: f64) -> Mesh {
    let shape = move |i, j| {
        let p = on_disk(i, j, 40.0);
        let (polar, around) = (angle * p.length(), p.y.atan2(p.x));
        let x = DVec3::new(
            polar.sin() * around.cos(),
            polar.sin() * around.sin(),
            polar.cos(),
        );
        (x, x)
    };
    lattice([41, 41], shape, |_, _| false)
}

fn bowl(cut: impl Fn(u32, u32) -> bool) -> Mesh {
    let shape = |i: f64, j: f64| {
        let p = DVec2::new(1.3 * (i / 20.0 - 1.0), j / 15.0 - 1.0);
        let slope = 2.0 * p;
        (
            DVec3::new(p.x, p.y, p.length_squared()),
            DVec3::new(-slope.x, -slope.y, 1.0).normalize(),
        )
    };
    lattice([41, 31], shape, cut)
}

#[test]
fn a_plane_rectangle_is_mapped_by_an_affine_map() {
    let shape = |i: f64, j: f64| (DVec3::new(0.2 * i, 0.25 * j, 3.0), DVec3::Z);
    let mesh = lattice([31, 17], shape, |_, _| false);
    let chart = mesh.chart().unwrap();
    assert!((chart.size[0] - 6.0).abs() < 1e-9 && (chart.size[1] - 4.0).abs() < 1e-9);
    for (p, t) in mesh.points.iter().zip(&chart.parameters) {
        let expected = DVec2::new(p.x / 6.0, p.y / 4.0);
        assert!(t.distance(expected) < 1e-8, "{t} {expected}");
    }
}

#[test]
fn hemispheres_saddles_and_bowls_lie_flat_without_folds() {
    let saddle = |i: f64, j: f64| {
        let p = DVec2::new(i / 15.0 - 1.0, j / 15.0 - 1.0);
        let normal = DVec3::new(-3.0 * p.x, 3.0 * p.y, 1.0).normalize();
        (DVec3::new(p.x, p.y, 1.5 * (p.x * p.x - p.y * p.y)), normal)
    };
    // A hole of six by four cells, and a rim with every third cell missing in places.
    let ragged = |i: u32, j: u32| {
        (10..16).contains(&i) && (12..16).contains(&j)
            || j == 0 && i % 3 == 1
            || i == 39 && j % 4 == 2
    };
    for mesh in [
        cap(1.57),
        cap(2.0),
        lattice([31, 31], saddle, |_, _| false),
        bowl(ragged),
    ] {
        let chart = mesh.chart().unwrap();
        assert!(mesh.folded(&chart) == 0.0, "{}", chart.reason);
        let inside = |t: &DVec2| t.cmpge(DVec2::ZERO).all() && t.cmple(DVec2::ONE).all();
        assert!(chart.parameters.iter().all(inside));
    }
}

#[test]
fn stretch_is_evened_out() {
    // A finger that stands on a plate: harmonic maps leave its tip next to nothing.
    let shape = |i: f64, j: f64| {
        let p = DVec2::new(i / 20.0 - 1.0, j / 20.0 - 1.0);
        let height = 1.5 * (-p.length_squared() / 0.1).exp();
        let slope = p * (-2.0 / 0.1) * height;
        (
            DVec3::new(p.x, p.y, height),
            DVec3::new(-slope.x, -slope.y, 1.0).normalize(),
        )
    };
    let mesh = lattice([41, 41], shape, |_, _| false);
    let chart = mesh.chart().unwrap();
    let manifold = Manifold {
        points: mesh.points,
        triangles: mesh.triangles,
        ..Manifold::default()
    };
    let surface = Surface::new(&manifold.points, &manifold.triangles);
    let setup = layout::Setup::open(manifold.points.len(), manifold.triangles.len());
    let stretch = stretch::Stretch::measure(&surface, &setup, &chart.parameters, chart.size);
    assert!(stretch.whole < 1.5, "{}", stretch.whole);
}

#[test]
fn what_is_no_disk_is_refused_with_what_it_is() {
    let tube = |i: f64, j: f64| {
        let x = DVec3::new((0.2 * i).cos(), (0.2 * i).sin(), 0.0);
        (x + 0.1 * j * DVec3::Z, x)
    };
    // 31 columns of 0.2 radians nearly close the circle; the last cells join the first column.
    let mut mesh = lattice([31, 21], tube, |_, _| false);
    for j in 0..20 {
        let (a, b) = (31 * j + 30, 31 * j);
        mesh.triangles.extend([[a, b, b + 31], [a, b + 31, a + 31]]);
    }
    let says = |mesh: &Mesh, what: &str| {
        let error = mesh.chart().unwrap_err();
        assert!(matches!(error, Error::Unsupported(_)));
        assert!(error.to_string().contains(what), "{error}");
    };
    says(&mesh, "a tube or a ring");
    says(&cap(2.7), "nearly closed");
    // Two bowls rim on rim.
    let mut closed = cap(1.0);
    let n = u32::try_from(closed.points.len()).unwrap();
    let rim = |k: u32| k.is_multiple_of(41) || k % 41 == 40 || k / 41 == 0 || k / 41 == 40;
    let other = |k: u32| if rim(k) { k } else { k + n };
    let lower: Vec<[u32; 3]> = closed.triangles.iter().map(|t| t.map(other)).collect();
    closed
        .triangles
        .extend(lower.iter().map(|&[a, b, c]| [a, c, b]));
    let below: Vec<DVec3> = closed
        .points
        .iter()
        .map(|p| DVec3::new(p.x, p.y, -p.z))
        .collect();
    closed.points.extend(&below);
    closed.normals.extend(&below);
    says(&closed, "closed");
    assert!(matches!(
        Mesh {
            points: vec![DVec3::ZERO; 3],
            normals: vec![DVec3::Z; 3],
            triangles: vec![]
        }
        .chart(),
        Err(Error::Invalid(_))
    ));
}

#[test]
fn the_order_of_the_vertices_does_not_matter() {
    let mesh = bowl(|i, j| (10..16).contains(&i) && (12..16).contains(&j));
    let n = mesh.points.len();
    // 1021 is prime and no divisor of n.
    let place = |k: usize| k * 1021 % n;
    let mut shuffled = Mesh {
        points: mesh.points.clone(),
        normals: mesh.normals.clone(),
        triangles: mesh
            .triangles
            .iter()
            .rev()
            .map(|&[a, b, c]| [c, a, b].map(|k| u32::try_from(place(k as usize)).unwrap()))
            .collect(),
    };
    for k in 0..n {
        shuffled.points[place(k)] = mesh.points[k];
        shuffled.normals[place(k)] = mesh.normals[k];
    }
    let (one, two) = (mesh.chart().unwrap(), shuffled.chart().unwrap());
    for k in 0..n {
        let apart = one.parameters[k].distance(two.parameters[place(k)]);
        assert!(apart < 1e-3, "{apart}");
    }
}

#[test]
fn the_chart_goes_with_the_mesh_and_faces_its_normals() {
    let mesh = bowl(|_, _| false);
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -0.7, 0.3));
    let moved = Mesh {
        points: mesh
            .points
            .iter()
            .map(|&p| turn * p + DVec3::new(5.0, -3.0, 8.0))
            .collect(),
        // The other side, and half of the triangles wound the other way.
        normals: mesh.normals.iter().map(|&n| turn * n).collect(),
        triangles: mesh
            .triangles
            .iter()
            .enumerate()
            .map(|(k, &[a, b, c])| if k % 2 == 0 { [a, c, b] } else { [a, b, c] })
            .collect(),
    };
    let (one, two) = (mesh.chart().unwrap(), moved.chart().unwrap());
    for (s, t) in one.parameters.iter().zip(&two.parameters) {
        let apart = s.distance(*t).min(s.distance(DVec2::ONE - *t));
        assert!(apart < 1e-3, "{s} {t}");
    }
    assert!(mesh.folded(&one) == 0.0 && mesh.folded(&two) == 0.0);
    let back = Mesh {
        normals: mesh.normals.iter().map(|&n| -n).collect(),
        ..mesh
    };
    assert!(back.folded(&back.chart().unwrap()) > 0.99);
}

//! Layouts of random manifolds are valid, whatever their topology and their feature lines.

mod random;

use super::outlines::Outlines;
use super::surface::Surface;
use super::{CellShape, FaceSplit, Layout, LayoutOptions, Producer, Seeds, cells, layout};
use glam::DVec3;
use nurbskin_geometry::progress::Silent;
use nurbskin_scan::mesh::manifold::Manifold;
use nurbskin_scan::mesh::repair::repair;
use nurbskin_scan::mesh::samples::Mesh;
use random::{random_lines, random_manifold};

/// The manifold of a sample.
fn manifold(mesh: &Mesh) -> Manifold {
    repair(&mesh.points, &mesh.triangles, &Silent)
        .unwrap()
        .manifold
}

/// A valid layout of a mesh without lines, with this number of cells at first.
fn valid(mesh: &Manifold, cells: Option<usize>) -> Layout {
    let sharp = vec![false; 3 * mesh.triangles.len()];
    let options = LayoutOptions {
        cells,
        ..LayoutOptions::default()
    };
    let layout = layout(mesh, &sharp, &options).unwrap();
    layout.validate(mesh).unwrap();
    layout
}

#[test]
fn a_thousand_random_manifolds_get_valid_layouts() {
    let mut genera = [0; 6];
    let mut borders = [0; 7];
    for seed in 0..1000 {
        let (mesh, mut random) = random_manifold(seed);
        let sharp = random_lines(&mesh, &mut random);
        genera[mesh.genus().min(5)] += 1;
        borders[mesh.loops.len().min(6)] += 1;
        let options = LayoutOptions {
            cells: [None, Some(1), Some(1 + random.below(60))][random.below(3)],
            shape: [CellShape::Geodesic, CellShape::Aligned][random.below(2)],
            split: [FaceSplit::All, FaceSplit::Parity][random.below(2)],
            tidy: random.below(2) == 0,
            detail: random.below(3) as f64,
            ..LayoutOptions::default()
        };
        let layout = layout(&mesh, &sharp, &options).unwrap();
        if let Err(error) = layout.validate(&mesh) {
            panic!("seed {seed}: {error}");
        }
    }
    println!("genus {genera:?}, borders {borders:?}");
    assert!(genera.iter().all(|n| *n >= 20), "{genera:?}");
    assert!(borders.iter().all(|n| *n >= 20), "{borders:?}");
}

#[test]
fn a_layout_that_follows_another_is_valid_whatever_the_sizes() {
    for seed in 0..200 {
        let (mesh, mut random) = random_manifold(seed);
        let sharp = random_lines(&mesh, &mut random);
        let mut producer = Producer::new(&mesh, &sharp).unwrap();
        producer.follow(Seeds::default());
        let mut sizes = vec![1.0; mesh.triangles.len()];
        for _ in 0..3 {
            let layout = producer.layout(&LayoutOptions::coarse(), &sizes);
            if let Err(error) = layout.validate(&mesh) {
                panic!("seed {seed}: {error}");
            }
            for size in &mut sizes {
                *size *= [1.0, 1.0, 0.6][random.below(3)];
            }
        }
    }
}

#[test]
fn a_layout_that_follows_another_stays_where_sizes_do() {
    let mesh = manifold(&Mesh::torus([120, 48], 1.0, 0.4));
    let sharp = vec![false; 3 * mesh.triangles.len()];
    let options = LayoutOptions::coarse();
    let mut producer = Producer::new(&mesh, &sharp).unwrap();
    let first = producer.layout(&options, &[]);
    let mut next = Producer::new(&mesh, &sharp).unwrap();
    next.follow(producer.into_seeds());
    assert_eq!(next.layout(&options, &[]), first);
    // Half the size at x > 1.2, all of it again one radius of a cell farther, 0.64; beyond, seeds stay, and with them the vertices of cells
    // whose neighbours stay, too.
    let size = |corners: &[u32; 3]| match mesh.points[corners[0] as usize].x > 1.2 {
        true => 0.5,
        false => 1.0,
    };
    let sizes: Vec<f64> = mesh.triangles.iter().map(size).collect();
    let second = next.layout(&options, &sizes);
    second.validate(&mesh).unwrap();
    assert!(second.faces.len() > first.faces.len());
    let far = |layout: &Layout| -> Vec<DVec3> {
        let vertices = layout.vertices.iter().copied();
        vertices.filter(|p| p.x < -0.9).collect()
    };
    let kept = far(&first);
    assert!(kept.len() >= 4, "{kept:?}");
    for vertex in kept {
        assert!(far(&second).contains(&vertex), "{vertex} is gone");
    }
}

#[test]
fn known_surfaces() {
    for cells in [None, Some(1), Some(7), Some(40)] {
        let sphere = manifold(&Mesh::sphere([24, 12], 0.0, std::f64::consts::PI));
        let torus = manifold(&Mesh::torus([30, 12], 1.0, 0.4));
        for mesh in [sphere, torus] {
            let layout = valid(&mesh, cells);
            assert!(layout.on_lines.is_empty());
            assert!(layout.faces.len() >= 6);
        }
    }
}

#[test]
fn the_smallest_meshes() {
    let triangle = Mesh {
        points: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
        triangles: vec![[0, 1, 2]],
    };
    assert_eq!(valid(&manifold(&triangle), None).faces.len(), 3);
    let mut tetrahedron = triangle;
    tetrahedron.points.push(DVec3::Z);
    tetrahedron.triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let mesh = manifold(&tetrahedron);
    valid(&mesh, None);
    // All edges sharp: the faces of the solid, three quads each, with all edges kept.
    let options = LayoutOptions::default();
    let all = layout(&mesh, &[true; 12], &options).unwrap();
    all.validate(&mesh).unwrap();
    assert_eq!(all.faces.len(), 12);
    assert_eq!(all.edges.iter().filter(|e| e.kind.is_hard()).count(), 12);
    assert_eq!(
        layout(&mesh, &[true; 3], &options).unwrap_err().to_string(),
        "3 flags of sharp sides for 4 triangles; give three for each triangle"
    );
}

#[test]
fn the_edges_of_a_cube_are_kept() {
    let mesh = manifold(&Mesh::cubes(6, |x, y, z| x < 1 && y < 1 && z < 1));
    let table = mesh.adjacency();
    let sharp: Vec<bool> = (0..3 * mesh.triangles.len())
        .map(|side| {
            let other = table.opposite[side] as usize / 3;
            mesh.vector_area(side / 3)
                .dot(mesh.vector_area(other))
                .abs()
                < 1e-9
        })
        .collect();
    let layout = layout(&mesh, &sharp, &LayoutOptions::default()).unwrap();
    layout.validate(&mesh).unwrap();
    // Every vertex on an edge of the cube has a place on a line, the corners on three.
    let on_edge = |p: DVec3| p.to_array().iter().filter(|x| x.fract() == 0.0).count();
    for (k, &p) in mesh.points.iter().enumerate() {
        let lines = layout.on_lines.iter().filter(|on| on.vertex as usize == k);
        match on_edge(p) {
            3 => assert_eq!(lines.count(), 3),
            2 => assert!(matches!(lines.count(), 1 | 2)),
            _ => assert_eq!(lines.count(), 0),
        }
    }
    // A line is straight here: all its vertices share two coordinates.
    for edge in layout.edges.iter().filter(|e| e.kind.is_hard()) {
        let [a, b] = edge.ends.map(|v| layout.vertices[v as usize]);
        let same = (a - b).to_array().iter().filter(|d| d.abs() < 1e-9).count();
        assert_eq!(same, 2);
    }
}

#[test]
fn single_triangles_are_the_last_resort() {
    // Unsound cells that cannot be split: everything one cell of a sphere.
    let mesh = manifold(&Mesh::sphere([8, 4], 0.0, std::f64::consts::PI));
    let sharp = vec![true; 3 * mesh.triangles.len()];
    let surface = Surface::new(&mesh, &sharp).unwrap();
    let cells = cells::sound(&surface, vec![0; surface.count()]);
    assert_eq!(cells.count(), surface.count());
    let again = Outlines::new(&surface, &cells.labels, cells.count(), &[]);
    assert!(again.sound());
}

use super::*;
use crate::mesh::samples::{Mesh, Random, check};
use nurbskin_geometry::progress::Silent;

fn repaired(mesh: &Mesh) -> Repaired {
    let repaired = repair(&mesh.points, &mesh.triangles, &Silent).unwrap();
    check(&repaired.manifold);
    repaired
}

/// Six times the volume within.
fn volume(m: &Manifold) -> f64 {
    let volume = |t| {
        let [a, b, c] = m.corners(t);
        a.dot(b.cross(c))
    };
    (0..m.triangles.len()).map(volume).sum()
}

#[test]
fn frames_with_holes_in_any_order_and_winding() {
    for genus in 0..4 {
        for holes in 0..4_u32 {
            // A hole on top of each bar across.
            let mesh = Mesh::frame(genus, 4).without(|p| {
                let along = p.x - 0.5;
                let bar = (along / 2.0).round();
                p.z > 0.9 && bar < f64::from(holes) - 0.5 && along == 2.0 * bar && p.y == 0.5
                    || (genus == 0 && p.z > 0.9 && p.x == 0.5 && holes > 1 && p.y == 1.5)
                    || (genus == 0 && p.z > 0.9 && p.x == 0.5 && holes > 2 && p.y == 2.5)
            });
            let expected = if genus == 0 {
                holes
            } else {
                holes.min(genus as u32 + 1)
            };
            let plain = repaired(&mesh);
            assert_eq!(plain.manifold.genus(), genus as usize);
            assert_eq!(plain.manifold.loops.len(), expected as usize);
            assert!(plain.notes.is_empty(), "{:?}", plain.notes);
            assert!(plain.left_out.is_empty());
            assert!(volume(&plain.manifold) > 0.0);
            let soup = repaired(&mesh.soup().shuffled(5, false)).manifold;
            assert_eq!(
                (&soup.points, &soup.triangles),
                (&plain.manifold.points, &plain.manifold.triangles)
            );
            assert_eq!(soup.loops, plain.manifold.loops);
            let turned = repaired(&mesh.shuffled(7, true)).manifold;
            assert_eq!(turned.points, plain.manifold.points);
            assert_eq!(turned.loops.len(), plain.manifold.loops.len());
            if holes == 0 {
                let wound = |m: &Manifold| {
                    let mut t: Vec<[u32; 3]> = m.triangles.clone();
                    t.iter_mut().for_each(|t| {
                        let least = (0..3).min_by_key(|&k| t[k]).unwrap();
                        t.rotate_left(least);
                    });
                    t.sort_unstable();
                    t
                };
                assert_eq!(wound(&turned), wound(&plain.manifold));
            }
        }
    }
}

#[test]
fn sources_name_the_points() {
    let mesh = Mesh::torus([12, 8], 2.0, 0.7).shuffled(3, false);
    let m = repaired(&mesh).manifold;
    for (p, source) in m.points.iter().zip(&m.source) {
        assert_eq!(*p, mesh.points[source.unwrap() as usize]);
    }
}

#[test]
fn one_side_is_refused() {
    for n in [12, 60] {
        let strip = Mesh::lattice([n, 3], [false, false], |u, v| {
            let (around, across) = (std::f64::consts::TAU * u, 0.4 * (v - 0.5));
            let r = 1.0 + across * (0.5 * around).cos();
            DVec3::new(
                r * around.cos(),
                r * around.sin(),
                across * (0.5 * around).sin(),
            )
        });
        // The ends meet turned over: by number, for their coordinates differ in the last digit.
        let mut strip = strip;
        let row = n + 1;
        for t in strip.triangles.iter_mut().flatten() {
            if *t % row == n {
                *t = (3 - *t / row) * row;
            }
        }
        let why = repair(&strip.points, &strip.triangles, &Silent).unwrap_err();
        assert!(
            matches!(&why, Error::Unsupported(text) if text.contains("only one side")),
            "{why}"
        );
    }
}

#[test]
fn sheets_that_touch_the_wrong_way_are_cut_apart_where_they_bend() {
    // Two long sheets, one over the other, joined at their ends: by a bend at one, by a twist of three steps at the
    // other.
    let (n, rows) = (40_u32, 7_u32);
    let place = |a: u32, b: u32, z: f64| DVec3::new(f64::from(a), f64::from(b), z);
    let mut points = Vec::new();
    for z in [0.0, 1.5] {
        points.extend((0..n * rows).map(|k| place(k % n, k / n, z)));
    }
    let at = |a: u32, b: u32, top: u32| top * n * rows + b * n + a;
    let mut triangles = Vec::new();
    let mut square = |a: u32, b: u32, c: u32, d: u32| triangles.extend([[a, b, c], [a, c, d]]);
    for b in 0..rows - 1 {
        for a in 0..n - 1 {
            square(
                at(a, b, 0),
                at(a + 1, b, 0),
                at(a + 1, b + 1, 0),
                at(a, b + 1, 0),
            );
            square(
                at(a, b, 1),
                at(a, b + 1, 1),
                at(a + 1, b + 1, 1),
                at(a + 1, b, 1),
            );
        }
        square(at(0, b + 1, 0), at(0, b + 1, 1), at(0, b, 1), at(0, b, 0));
    }
    let whole = triangles.len();
    for b in 0..3 {
        triangles.push([at(n - 1, b, 0), at(n - 1, b + 1, 0), at(n - 1, 3 - b, 1)]);
        triangles.push([
            at(n - 1, b + 1, 0),
            at(n - 1, 3 - b, 1),
            at(n - 1, 2 - b, 1),
        ]);
    }
    let repaired = repair(&points, &triangles, &Silent).unwrap();
    assert!(
        repaired
            .notes
            .iter()
            .any(|note| note.contains("cut the mesh open")),
        "{:?}",
        repaired.notes
    );
    // Both sheets and their bend are left whole.
    assert!(repaired.manifold.triangles.len() >= whole);
    assert_eq!(repaired.manifold.genus(), 0);
}

#[test]
fn what_hangs_on_is_taken_off() {
    // A sheet, with a fin, a twin, a loose bit, a bit that touches in a point, bad numbers and a bad point.
    let mut mesh = Mesh::lattice([20, 20], [false, false], |u, v| DVec3::new(u, v, 0.0));
    let sheet = mesh.triangles.len();
    let first = mesh.triangles[200];
    mesh.points.extend([
        DVec3::new(0.3, 0.3, 0.5),
        DVec3::new(3.0, 0.0, 0.0),
        DVec3::new(3.1, 0.0, 0.0),
        DVec3::new(3.0, 0.1, 0.0),
        DVec3::new(0.2, 0.2, 0.4),
        DVec3::new(0.2, 0.3, 0.4),
        DVec3::NAN,
    ]);
    let n = 21 * 21;
    mesh.triangles.extend([
        [first[0], first[1], n],
        [first[2], first[0], first[1]],
        [n + 1, n + 2, n + 3],
        [first[0], n + 4, n + 5],
        [0, 1, n + 6],
        [0, 1, 99_999],
        [0, 0, 1],
    ]);
    let repaired = repaired(&mesh);
    let m = &repaired.manifold;
    assert_eq!((m.triangles.len(), m.loops.len(), m.genus()), (sheet, 1, 0));
    assert_eq!(repaired.left_out.len(), 6);
    let text = repaired.notes.join("\n");
    for part in [
        "3 triangles are dropped",
        "1 triangle is dropped",
        "1 edge has more",
        "removed 3 loose fragments",
    ] {
        assert!(text.contains(part), "{part} in {text}");
    }
}

#[test]
fn teeth_and_strips_go_and_corners_stay() {
    let mut mesh = Mesh::lattice([30, 30], [false, false], |u, v| DVec3::new(u, v, 0.0));
    let sheet = mesh.triangles.len();
    let mut point = |x: f64, y: f64| {
        mesh.points.push(DVec3::new(x / 30.0, y / 30.0, 0.0));
        mesh.points.len() as u32 - 1
    };
    // Teeth on the lower side, and a strip one triangle wide on the upper one.
    let teeth: Vec<[u32; 3]> = (3..9)
        .map(|k| [k + 1, k, point(f64::from(k) + 0.5, -0.9)])
        .collect();
    let row = 31 * 30;
    let mut strip = Vec::new();
    let mut ends = [row + 10, row + 11];
    for k in 1..7 {
        let next = [
            point(10.0, 30.0 + f64::from(k)),
            point(11.0, 30.0 + f64::from(k)),
        ];
        strip.extend([[ends[0], ends[1], next[1]], [ends[0], next[1], next[0]]]);
        ends = next;
    }
    mesh.triangles.extend(teeth);
    mesh.triangles.extend(strip);
    let repaired = repaired(&mesh);
    assert_eq!(repaired.manifold.triangles.len(), sheet);
    assert!(
        repaired
            .notes
            .join("")
            .contains("removed 18 triangles from the ragged border")
    );
}

#[test]
fn solids_that_touch_are_taken_apart() {
    // Cubes that share an edge, or two opposite corners; the larger one remains.
    let mesh = Mesh::cubes(3, |x, y, z| {
        (x < 2 && y < 2 && z < 2) || (x == 2 && y == 2 && z == 0) || (x == 2 && y == 0 && z == 2)
    });
    let repaired = repaired(&mesh.shuffled(9, false));
    let m = &repaired.manifold;
    assert_eq!((m.genus(), m.loops.len()), (0, 0));
    assert!((volume(m) - 6.0 * 8.0).abs() < 1e-9, "{}", volume(m) / 6.0);
}

#[test]
fn any_triangles_give_a_manifold_or_a_reason() {
    let mut random = Random(77);
    let mut several = 0;
    for _ in 0..400 {
        let points: Vec<DVec3> = (0..4 + random.below(8))
            .map(|_| DVec3::from([0; 3].map(|_| random.below(5) as f64)))
            .collect();
        let triangles: Vec<[u32; 3]> = (0..1 + random.below(40))
            .map(|_| [0; 3].map(|_| random.below(points.len() + 1) as u32))
            .collect();
        let mesh = Mesh { points, triangles };
        match repair(&mesh.points, &mesh.triangles, &Silent) {
            Ok(repaired) => {
                check(&repaired.manifold);
                several += usize::from(repaired.manifold.triangles.len() > 4);
                let all: Vec<usize> = (0..repaired.manifold.loops.len()).collect();
                let closed = crate::mesh::holes::fill(repaired.manifold.clone(), &all).0;
                check(&closed);
                assert!(closed.loops.is_empty());
            }
            Err(Error::Invalid(_) | Error::Unsupported(_)) => {}
            Err(other) => panic!("{other}"),
        }
    }
    assert!(several > 100, "{several}");
}

#[test]
fn no_triangles_is_an_error() {
    assert!(matches!(repair(&[], &[], &Silent), Err(Error::Invalid(_))));
    assert!(matches!(
        repair(&[DVec3::ZERO; 3], &[[0, 1, 2]], &Silent),
        Err(Error::Invalid(_))
    ));
}

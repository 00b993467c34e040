//! What is written reads back the same.

use nurbskin::io::{read_scan, write_scan};
use nurbskin::scan::{GridLayout, Organisation, Scan};
use nurbskin::unit::{Unit, UnitSource};
use nurbskin::{DVec3, Error};
use proptest::prelude::*;

/// Writes and reads.
fn there_and_back(scan: &Scan, name: &str) -> Scan {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    write_scan(&path, scan).unwrap();
    read_scan(&path).unwrap_or_else(|e| {
        panic!(
            "{e}\n{}",
            String::from_utf8_lossy(&std::fs::read(&path).unwrap())
        )
    })
}

/// Bits of the coordinates as they were in the file; all NaN are one.
fn bits(scan: &Scan) -> Vec<[u64; 3]> {
    let one = |c: f64| if c.is_nan() { f64::NAN } else { c }.to_bits();
    scan.points
        .iter()
        .map(|&p| (p + scan.origin).to_array().map(one))
        .collect()
}

fn assert_same(read: &Scan, written: &Scan) {
    assert_eq!(bits(read), bits(written));
    assert_eq!(read.organisation, written.organisation);
    assert_eq!(read.normals, written.normals);
    if written.unit_source != UnitSource::Assumed {
        assert_eq!(
            (read.unit, read.unit_source),
            (written.unit, UnitSource::File)
        );
    } else {
        assert_eq!(read.unit_source, UnitSource::Assumed);
    }
}

/// Any f64 that a scan may hold, large and tiny ones included.
fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => -1e3..1e3_f64,
        2 => (-1e3..1e3_f64).prop_map(|x| x + 5.6e6),
        1 => prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO,
        1 => Just(0.1),
    ]
}

fn point() -> impl Strategy<Value = DVec3> {
    [coordinate(), coordinate(), coordinate()].prop_map(DVec3::from_array)
}

fn scan() -> impl Strategy<Value = Scan> {
    let units = prop_oneof![
        Just((Unit::Millimetre, UnitSource::Assumed)),
        Just((Unit::Inch, UnitSource::Option)),
        Just((Unit::Metre, UnitSource::File)),
    ];
    (
        prop::collection::vec(point(), 0..40),
        units,
        any::<bool>(),
        0..4_u8,
        any::<u64>(),
    )
        .prop_map(|(points, (unit, unit_source), with_normals, kind, seed)| {
            let count = points.len();
            let mut state = seed;
            let mut below = |n: usize| {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                usize::try_from(state >> 33).unwrap() % n.max(1)
            };
            let organisation = match kind {
                1 if count > 0 => {
                    let mut lengths = Vec::new();
                    let mut rest = count;
                    while rest > 0 {
                        let length = 1 + below(rest);
                        lengths.push(length);
                        rest -= length;
                    }
                    Organisation::Rows(lengths)
                }
                2 if count > 0 => {
                    // The points in their order, empty cells between.
                    let (mut cells, mut next) = (Vec::new(), 0);
                    while next < count {
                        if below(3) > 0 {
                            cells.push(Some(u32::try_from(next).unwrap()));
                            next += 1;
                        } else {
                            cells.push(None);
                        }
                    }
                    let count_u = 1 + below(7);
                    while cells.len() % count_u > 0 {
                        cells.push(None);
                    }
                    let count_v = cells.len() / count_u;
                    Organisation::Grid(GridLayout {
                        count_u,
                        count_v,
                        cells,
                    })
                }
                3 if count > 0 => Organisation::Mesh(
                    (0..=below(9))
                        .map(|_| [0; 3].map(|_: i32| u32::try_from(below(count)).unwrap()))
                        .collect(),
                ),
                _ => Organisation::Unordered,
            };
            let normals = with_normals.then(|| {
                points
                    .iter()
                    .map(|p| p.normalize_or(DVec3::Z))
                    .collect::<Vec<_>>()
            });
            Scan {
                points,
                organisation,
                normals,
                unit,
                unit_source,
                ..Scan::default()
            }
        })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn ply_holds_everything(scan in scan()) {
        assert_same(&there_and_back(&scan, "a.ply"), &scan);
    }

    #[test]
    fn text_holds_all_but_triangles(mut scan in scan(), name in prop::sample::select(vec!["a.xyz", "a.csv", "a.txt"])) {
        let read = there_and_back(&scan, name);
        if matches!(scan.organisation, Organisation::Mesh(_)) {
            scan.organisation = Organisation::Unordered;
        }
        if scan.points.is_empty() {
            scan.normals = read.normals.clone();
        }
        assert_same(&read, &scan);
    }

    #[test]
    fn obj_holds_meshes(mut scan in scan()) {
        let read = there_and_back(&scan, "a.obj");
        if !matches!(scan.organisation, Organisation::Mesh(_)) {
            scan.organisation = Organisation::Unordered;
        }
        if scan.points.is_empty() {
            scan.normals = None;
        }
        assert_same(&read, &scan);
    }

    #[test]
    fn the_origin_moves_no_point(mut scan in scan()) {
        scan.origin = DVec3::new(5.0e6, -0.25, 4096.0);
        scan.points = scan.points.iter().map(|p| (*p).clamp(DVec3::splat(-1e3), DVec3::splat(1e3))).collect();
        assert_same(&there_and_back(&scan, "a.ply"), &scan);
    }
}

#[test]
fn non_finite_points_and_permuted_grids_survive() {
    let points = vec![
        DVec3::new(f64::NAN, 1.0, 2.0),
        DVec3::new(1.0, f64::INFINITY, 0.0),
        DVec3::new(0.1, -0.0, 1e-320),
    ];
    let grid = GridLayout {
        count_u: 2,
        count_v: 2,
        cells: vec![Some(2), None, Some(0), Some(1)],
    };
    let scan = Scan {
        points,
        organisation: Organisation::Grid(grid),
        ..Scan::default()
    };
    assert_same(&there_and_back(&scan, "a.ply"), &scan);
    // Text lists the points by cells.
    let read = there_and_back(&scan, "a.xyz");
    assert_eq!(bits(&read)[0], bits(&scan)[2]);
    let rows = Scan {
        organisation: Organisation::Rows(vec![1, 2]),
        ..scan
    };
    assert_same(&there_and_back(&rows, "a.csv"), &rows);
}

#[test]
fn stl_rounds_to_32_bits_and_says_so() {
    let scan = Scan {
        points: vec![
            DVec3::ZERO,
            DVec3::new(0.1, 0.0, 0.0),
            DVec3::new(0.0, 0.25, 0.0),
        ],
        organisation: Organisation::Mesh(vec![[0, 1, 2]]),
        ..Scan::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.stl");
    let notes = write_scan(&path, &scan).unwrap();
    assert!(notes.iter().any(|note| note.contains("32-bit")));
    let read = read_scan(&path).unwrap();
    assert_eq!(read.organisation, scan.organisation);
    assert_eq!(read.points[1].x, f64::from(0.1_f32));
    let cloud = Scan {
        organisation: Organisation::Unordered,
        ..scan
    };
    let refused = write_scan(folder.path().join("b.stl"), &cloud);
    assert!(matches!(refused, Err(Error::Unsupported(_))));
    assert!(!folder.path().join("b.stl").exists());
}

/// The triangles that `tobj` finds in the OBJ files of the writer and of other programs are ours, in order.
#[test]
fn obj_agrees_with_tobj() {
    let folder = tempfile::tempdir().unwrap();
    let scan = Scan {
        points: (0..20)
            .map(|k| DVec3::new(f64::from(k), f64::from(k * k), 0.5))
            .collect(),
        organisation: Organisation::Mesh((0..18).map(|k| [k, k + 1, k + 2]).collect()),
        ..Scan::default()
    };
    let mut paths = vec![folder.path().join("a.obj")];
    write_scan(&paths[0], &scan).unwrap();
    if let Some(data) = std::env::var_os("NURBSKIN_DATA") {
        let data = std::path::PathBuf::from(data);
        paths.extend(["tubes/ycb_banana.obj", "classics/fandisk.obj"].map(|name| data.join(name)));
    }
    for path in paths {
        let scan = read_scan(&path).unwrap();
        let Organisation::Mesh(triangles) = &scan.organisation else {
            panic!()
        };
        let ours = triangles
            .as_flattened()
            .iter()
            .map(|&k| scan.points[k as usize].as_vec3().to_array());
        let options = tobj::LoadOptions {
            triangulate: true,
            ..tobj::LoadOptions::default()
        };
        let reader = &mut std::io::BufReader::new(std::fs::File::open(&path).unwrap());
        let none = |_: &std::path::Path| Err(tobj::LoadError::OpenFileFailed);
        let (models, _) = tobj::load_obj_buf(reader, &options, none).unwrap();
        let theirs = models.iter().flat_map(|model| {
            let corner = |&k: &u32| [0, 1, 2].map(|c| model.mesh.positions[3 * k as usize + c]);
            model.mesh.indices.iter().map(corner)
        });
        assert!(ours.eq(theirs), "{}", path.display());
    }
}

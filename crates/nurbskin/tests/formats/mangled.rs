//! Files as they arrive: odd but good ones, and damaged ones, which get one sentence.

use nurbskin::io::scan::read_bytes;
use nurbskin::scan::{Organisation, Scan};
use nurbskin::{DVec3, Error, Result, Unit};
use proptest::prelude::*;
use std::path::Path;

fn of(name: &str, content: impl AsRef<[u8]>) -> Result<Scan> {
    read_bytes(content.as_ref().to_vec(), Path::new(name))
}

/// The message that this content gets.
fn refused(name: &str, content: impl AsRef<[u8]>) -> String {
    match of(name, content) {
        Err(error) => error.to_string(),
        Ok(scan) => panic!("{} points, {:?}", scan.points.len(), scan.warnings),
    }
}

const A: DVec3 = DVec3::new(1.5, 2.0, 3.0);
const B: DVec3 = DVec3::new(-4.0, 0.5, 60.0);

#[test]
fn text_in_all_dialects() {
    for content in [
        "1.5 2 3\n-4 .5 6e1\n",
        "1.5 2 3\r\n-4 .5 6e1",
        "\u{feff}1.5,2,3\n-4,.5,60\n",
        "1.5, 2, 3\n-4, 0.5, 60\n",
        "1,5;2;3\n-4;0,5;60\n",
        "1,5\t2\t3\n-4\t0,5\t60\n",
        "1,5 2 3\n-4 0,5 60\n",
        "x,y,z\n1.5,2,3\n-4,0.5,60\n",
        "z;name;x;y\n3;first;1,5;2\n60;second;-4;0,5\n",
        "\"z\",\"a, b\",\"x\",\"y\"\n3,\"p, q\",1.5,2\n60,\"r\",-4,0.5\n",
        "// made by hand\n# another\n\n1.5 2 3 # the first\n\n// between\n-4 0.5 60\n",
        "2\n1.5 2 3\n-4 0.5 60\n",
        "1.5\t\t2\t\t3\n-4\t\t0.5\t\t60\n",
        "  1.5   2   3  \n\t-4 0.5 6.0D+01\n",
        "//X Y Z\n1.5 2 3\n-4 0.5 60\n",
        "1\n1.5 2 3\n1\n-4 0.5 60\n",
        "1.5,2,3,\n-4,0.5,60,\n",
        "1.5 2 3\r-4 0.5 60\r",
    ] {
        let scan = of("a.txt", content).unwrap_or_else(|e| panic!("{content:?}: {e}"));
        assert_eq!(scan.points, [A, B], "{content:?}");
        assert_eq!(scan.organisation, Organisation::Unordered, "{content:?}");
        assert!(scan.warnings.is_empty(), "{content:?}: {:?}", scan.warnings);
    }
}

#[test]
fn text_with_more_than_points() {
    let scan = of("a.xyz", "1.5 2 3 7 8 9\n-4 .5 60 7 8 9\n").unwrap();
    assert_eq!((scan.points.len(), scan.warnings.len()), (2, 1));
    let scan = of("a.xyz", "1.5 2 3 0 0 1\n-4 .5 60 0.6 -.8 0\n").unwrap();
    assert_eq!(scan.normals.unwrap()[1], DVec3::new(0.6, -0.8, 0.0));
    let scan = of("a.csv", "nz,ny,nx,x [cm],y [cm],z [cm]\n3,2,1,1.5,2,3\n").unwrap();
    assert_eq!(scan.normals.unwrap(), [DVec3::new(1.0, 2.0, 3.0)]);
    assert_eq!(scan.unit, Unit::Centimetre);
    let scan = of(
        "a.csv",
        "1,2,3\nnan,2,3\n4,,5\n1e999,0,0\n1.#QNAN,0,0\n7,8,9",
    )
    .unwrap();
    assert_eq!(scan.points.len(), 6);
    assert_eq!(scan.points.iter().filter(|p| p.is_finite()).count(), 2);
    let scan = of("a.csv", "Points:0,Points:1,Points:2\n1.5,2,3\n").unwrap();
    assert_eq!((scan.points[0], scan.warnings.len()), (A, 0));
}

#[test]
fn blank_lines_separate_rows() {
    let rows = |content: &str| of("a.xyz", content).unwrap().organisation;
    let expected = Organisation::Rows(vec![2, 3]);
    assert_eq!(
        rows("0 0 0\n1 0 0\n\n\n# c\n0 1 0\n1 1 0\n2 1 0\n\n"),
        expected
    );
    // Every second line blank is no order.
    assert_eq!(rows("0 0 0\n\n1 0 0\n\n0 1 0\n"), Organisation::Unordered);
    assert_eq!(rows("0 0 0\n1 0 0\n\n"), Organisation::Unordered);
}

#[test]
fn bad_text_is_named_by_its_line() {
    for (content, line) in [
        ("1 2 3\n4 5\n", "line 2"),
        ("1 2 3\n\n4 five 6\n", "line 3"),
        ("# c\nx,y,z\n1,2,3\n4,a,6\n", "line 4"),
        ("1 2\n3 4\n", "line 1"),
        ("lorem ipsum\ndolor sit\n", "line 1"),
        ("lorem ipsum dolor\n", "line 1"),
        (
            "x,y,depth\n1,2,3\n",
            "line 1: the header line has no column z",
        ),
        ("\"1\",2,3\n\"1,2,3\n", "line 2"),
        ("5\n1 2 3\n4 5 6\n", "truncated"),
        ("1,5;2,5;3,5\n1.5;2.5;3.5\n", "line 1"),
    ] {
        let message = refused("a.txt", content);
        assert!(message.contains(line), "{content:?}: {message}");
        assert!(message.starts_with("a.txt"), "{message}");
    }
}

const PLY: &str = "ply\nformat ascii 1.0\ncomment unit m\nelement extra 1\nproperty list uchar float w\n\
    element vertex 4\nproperty float x\nproperty uchar red\nproperty float y\nproperty float z\n\
    element face 2\nproperty list uchar int vertex_indices\nproperty int flags\nend_header\n\
    2 1 2\n0 300 0 0\n1 0 0 0\n1 0.5 1 0\n0 0 1 nan\n4 0 1 2 3 9\n3 0 1.0 2 9\n";

#[test]
fn ply_in_all_line_ends_and_with_unknown_parts() {
    for content in [
        PLY.to_owned(),
        PLY.replace('\n', "\r\n"),
        PLY.replace('\n', "\r"),
        PLY.trim_end().to_owned(),
    ] {
        let scan = of("a.ply", &content).unwrap();
        assert_eq!(scan.points.len(), 4);
        assert_eq!(scan.points[2], DVec3::new(1.0, 1.0, 0.0));
        assert!(scan.points[3].z.is_nan());
        let mesh = Organisation::Mesh(vec![[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
        assert_eq!(scan.organisation, mesh);
        assert_eq!(scan.unit, Unit::Metre);
        assert!(scan.warnings.is_empty(), "{:?}", scan.warnings);
    }
    let mut latin: Vec<u8> = PLY.into();
    latin.splice(21..21, *b"comment caf\xe9\n");
    assert_eq!(of("a.ply", latin).unwrap().points.len(), 4);
    let more = of("a.ply", format!("{PLY}1 2 3\n")).unwrap();
    assert_eq!(more.warnings.len(), 1);
}

#[test]
fn ply_in_both_byte_orders() {
    for (name, swap) in [("little", false), ("big", true)] {
        let mut content = format!(
            "ply\nformat binary_{name}_endian 1.0\nelement point 2\nproperty double x\nproperty float y\n\
             property short z\nproperty list uchar ushort skipped\nend_header\n"
        )
        .into_bytes();
        let mut put = |bytes: &[u8]| {
            if swap {
                content.extend(bytes.iter().rev());
            } else {
                content.extend(bytes);
            }
        };
        for p in [A, B] {
            put(&p.x.to_le_bytes());
            put(&f32::to_le_bytes(if p == A { 2.0 } else { 0.5 }));
            put(&i16::to_le_bytes(if p == A { 3 } else { 60 }));
            put(&[1]);
            put(&7_u16.to_le_bytes());
        }
        assert_eq!(of("a.ply", content).unwrap().points, [A, B]);
    }
}

#[test]
fn ply_strips_and_grids() {
    let points = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
    let data = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n";
    let strips = format!(
        "ply\nformat ascii 1.0\n{points}element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
         {data}8 0 1 2 3 -1 1 3 2\n"
    );
    let mesh = Organisation::Mesh(vec![[0, 1, 2], [2, 1, 3], [1, 3, 2]]);
    assert_eq!(of("a.ply", &strips).unwrap().organisation, mesh);
    let grid = |cols: &str| {
        format!(
            "ply\nformat ascii 1.0\n{cols}{points}element range_grid 6\nproperty list uchar int vertex_indices\n\
             end_header\n{data}1 0\n1 1\n0\n1 2\n0\n1 3\n"
        )
    };
    let scan = of("a.ply", grid("obj_info num_cols 3\nobj_info num_rows 2\n")).unwrap();
    let Organisation::Grid(layout) = scan.organisation else {
        panic!()
    };
    assert_eq!([layout.count_u, layout.count_v, layout.empty()], [3, 2, 2]);
    assert_eq!(layout.cells[3], Some(2));
    let message = refused("a.ply", grid("obj_info num_cols 3\nobj_info num_rows 3\n"));
    assert!(message.contains("range_grid"), "{message}");
    assert_eq!(of("a.ply", grid("")).unwrap().warnings.len(), 1);
}

#[test]
fn bad_ply_is_named_by_its_row() {
    for (from, to, at) in [
        ("1.0 2 9\n", "1.0 4 9\n", "element face, row 1"),
        ("1.0 2 9\n", "-1 2 9\n", "element face, row 1 (line 21)"),
        ("1.0 2 9\n", "", "element face, row 1"),
        (
            "1 0.5 1 0",
            "1 0.5 one 0",
            "element vertex, row 2 (line 18)",
        ),
        ("vertex 4", "vertex 40000000000", "truncated"),
        ("face 2", "face 18446744073709551615", "truncated"),
        ("float x", "float u", "property x"),
        ("element vertex", "element vortex", "no element vertex"),
        ("end_header", "end_haeder", "end_header"),
        ("float z", "triple z", "header"),
        ("2 1 2\n", "4000000000 1 2\n", "element extra, row 0"),
    ] {
        let message = refused("a.ply", PLY.replace(from, to));
        assert!(message.contains(at), "{from:?} -> {to:?}: {message}");
    }
    let endless = "ply\nformat ascii 1.0\nelement nothing 18446744073709551615\nelement vertex 0\nproperty float x\n\
                   end_header\n";
    assert!(refused("a.ply", endless).contains("no properties"));
}

#[test]
fn paths_that_are_no_files() {
    let folder = tempfile::tempdir().unwrap();
    let message = |path: &Path| nurbskin::io::read_scan(path).unwrap_err().to_string();
    assert!(message(folder.path()).contains("directory"));
    assert!(message(&folder.path().join("none.ply")).contains("no such file"));
    let empty = folder.path().join("empty.obj");
    std::fs::write(&empty, "").unwrap();
    assert!(message(&empty).contains("empty"));
}

/// Small good files of every format, for damage.
fn good() -> Vec<(&'static str, Vec<u8>)> {
    let points = (0..12)
        .map(f64::from)
        .map(|k| DVec3::new(k, k * k, (0.7 * k).sin()));
    let mut scan = Scan {
        points: points.collect(),
        organisation: Organisation::Rows(vec![5, 4, 3]),
        ..Scan::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let mut files = vec![("a.ply", PLY.as_bytes().to_vec())];
    let mut add = |name: &'static str, scan: &Scan| {
        let path = folder.path().join(name);
        nurbskin::io::write_scan(&path, scan).unwrap();
        files.push((name, std::fs::read(&path).unwrap()));
    };
    add("r.ply", &scan);
    add("r.xyz", &scan);
    add("r.csv", &scan);
    scan.organisation = Organisation::Mesh((0..10).map(|k| [k, k + 1, k + 2]).collect());
    scan.normals = Some(vec![DVec3::Z; 12]);
    add("m.ply", &scan);
    add("m.obj", &scan);
    add("m.stl", &scan);
    files.push(("t.stl", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n".to_vec()));
    files.push((
        "q.csv",
        b"\"x\";\"y\";\"z\"\n1,5;2,5;3,5\n\"4\";5;6\n".to_vec(),
    ));
    files
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A scan that agrees with itself, or a sentence; never a panic, and never more points than bytes.
    #[test]
    fn damage_never_panics(
        which in 0..9_usize,
        cut in any::<prop::sample::Index>(),
        truncate in any::<bool>(),
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        words in prop::collection::vec((any::<prop::sample::Index>(), 0..8_usize), 0..2),
    ) {
        thread_local! {
            static GOOD: Vec<(&'static str, Vec<u8>)> = good();
        }
        let (name, mut bytes) = GOOD.with(|good| good[which % good.len()].clone());
        for (at, byte) in flips {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        const WORDS: [&[u8]; 8] = [
            b"18446744073709551615", b"-9223372036854775808", b"4294967295", b"nan", b"\n\n", b"\0\0\0\0", b"\xff\xff\xff\xff", b"1e999",
        ];
        for (at, word) in words {
            let at = at.index(bytes.len());
            bytes.splice(at..at, WORDS[word].iter().copied());
        }
        if truncate {
            bytes.truncate(cut.index(bytes.len() + 1));
        }
        match of(name, &bytes) {
            Ok(scan) => {
                prop_assert!(scan.points.len() <= bytes.len());
                let count = scan.points.len();
                match &scan.organisation {
                    Organisation::Unordered => {}
                    Organisation::Rows(lengths) => prop_assert_eq!(lengths.iter().sum::<usize>(), count),
                    Organisation::Grid(grid) => {
                        prop_assert_eq!(grid.count_u * grid.count_v, grid.cells.len());
                        prop_assert!(grid.cells.iter().flatten().all(|&k| (k as usize) < count));
                    }
                    Organisation::Mesh(triangles) => {
                        prop_assert!(triangles.as_flattened().iter().all(|&k| (k as usize) < count));
                    }
                }
                prop_assert!(scan.normals.is_none_or(|normals| normals.len() == count));
            }
            Err(error) => {
                let text = error.to_string();
                prop_assert!(matches!(error, Error::Read { .. } | Error::Unsupported(_)), "{}", text);
                prop_assert!(!text.contains('\n') && text.len() < 500, "{}", text);
            }
        }
    }
}

//! Files of scanners and of array programs: the right points in the right cells, or one sentence.

use super::make::{e57, e57_with_normals, gzip, las, npy, pcd, ptx, wave};
use nurbskin::io::scan::read_bytes;
use nurbskin::scan::{GridLayout, Organisation, Scan};
use nurbskin::unit::UnitSource;
use nurbskin::{DVec3, Error, Unit};
use std::path::Path;

fn of(name: &str, content: impl AsRef<[u8]>) -> Scan {
    read_bytes(content.as_ref().to_vec(), Path::new(name)).unwrap_or_else(|e| panic!("{e}"))
}

/// The message that this content gets.
fn refused(name: &str, content: impl AsRef<[u8]>) -> String {
    match read_bytes(content.as_ref().to_vec(), Path::new(name)) {
        Err(error) => error.to_string(),
        Ok(scan) => panic!("{name}: {} points, {:?}", scan.points.len(), scan.warnings),
    }
}

fn grid(scan: &Scan) -> &GridLayout {
    match &scan.organisation {
        Organisation::Grid(layout) => layout,
        other => panic!("{other:?}, {:?}", scan.warnings),
    }
}

/// The wave with two cells empty: NaN, or `0 0 0`.
fn holed(empty: DVec3) -> Vec<DVec3> {
    let mut points = wave();
    points[3] = empty;
    points[12] = empty;
    points
}

/// Whether these are the cells of the holed wave.
fn assert_holed(scan: &Scan, moved: impl Fn(DVec3) -> DVec3) {
    let layout = grid(scan);
    assert_eq!([layout.count_u, layout.count_v, layout.empty()], [5, 4, 2]);
    assert_eq!(scan.points.len(), 18);
    assert!(scan.validate().is_ok());
    for (k, (cell, p)) in layout.cells.iter().zip(wave()).enumerate() {
        match cell {
            None => assert!(k == 3 || k == 12),
            Some(index) => {
                let found = scan.points[*index as usize] + scan.origin;
                assert!(found.distance(moved(p)) < 1e-9, "{k}: {found}");
            }
        }
    }
}

#[test]
fn pcd_in_all_kinds_of_data() {
    for data in ["ascii", "binary", "binary_compressed"] {
        let scan = of("a.pcd", pcd(&wave(), 20, 1, data));
        assert_eq!(scan.points, wave(), "{data}");
        assert_eq!(scan.organisation, Organisation::Unordered);
        assert_eq!(scan.normals, Some(vec![DVec3::Z; 20]));
        assert!(scan.warnings.is_empty(), "{data}: {:?}", scan.warnings);
        for empty in [DVec3::NAN, DVec3::ZERO] {
            let scan = of("a.pcd", pcd(&holed(empty), 5, 4, data));
            assert_holed(&scan, |p| p);
            assert_eq!(scan.normals.as_ref().unwrap().len(), 18);
            assert!(scan.warnings[0].starts_with("2 of the 20 cells"));
            assert!(scan.records.empty().eq([3, 12]));
        }
    }
    // Points that are missing without a grid are kept for cleaning to count.
    assert_eq!(
        of("a.pcd", pcd(&holed(DVec3::NAN), 20, 1, "binary"))
            .points
            .len(),
        20
    );
    let old =
        "VERSION .5\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nDATA ascii\n1 2 3\nnan 5 6";
    assert_eq!(of("a.dat", old).points[0], DVec3::new(1.0, 2.0, 3.0));
    let bare = "COLUMNS x y z\nPOINTS 1\nDATA ascii\n1 2 3\n";
    assert_eq!(of("a.pcd", bare).points.len(), 1);
}

#[test]
fn bad_pcd_is_named() {
    let ascii = String::from_utf8(pcd(&wave(), 5, 4, "ascii")).unwrap();
    for (from, to, says) in [
        ("POINTS 20", "POINTS 4000000000", "truncated"),
        ("WIDTH 5", "WIDTH five", "line 7"),
        ("COUNT 3", "COUNT 18446744073709551615", "too large"),
        ("SIZE 2 8", "SIZE 2 3", "size, type or count of the field x"),
        ("TYPE U F F", "TYPE U F", "TYPE has 6 entries"),
        ("FIELDS label x", "FIELDS label u", "no field x"),
        ("DATA ascii", "DATA morse", "line 11"),
        ("DATA ascii", "DOTA ascii", "line 11"),
        ("1 2 3 11 ", "1 2 3 eleven ", "line 13"),
        (
            "1 2 3 14 20 300 0 0 1\n",
            "1 2 3 14 20 300 0 0\n",
            "line 16",
        ),
    ] {
        assert!(ascii.contains(from), "{from}");
        let message = refused("a.pcd", ascii.replacen(from, to, 1));
        assert!(message.contains(says), "{to}: {message}");
    }
    assert_eq!(
        of("a.pcd", ascii.replace("WIDTH 5", "WIDTH 6"))
            .warnings
            .len(),
        1
    );
    for data in ["ascii", "binary", "binary_compressed"] {
        let file = pcd(&wave(), 5, 4, data);
        let message = refused("a.pcd", &file[..file.len() - 30]);
        let says = if data == "ascii" {
            "line 3"
        } else {
            "truncated"
        };
        assert!(message.contains(says), "{data}: {message}");
    }
    // Gigabytes for a few bytes.
    let mut file = pcd(&wave(), 5, 4, "binary_compressed");
    let body = file.windows(11).position(|w| w == b"compressed\n").unwrap() + 11;
    file[body + 4..body + 8].fill(0xff);
    assert!(refused("a.pcd", &file).contains("cannot hold"));
    file[body..body + 4].fill(0xff);
    assert!(refused("a.pcd", &file).contains("truncated"));
}

#[test]
fn ptx_keeps_its_grid_and_moves_it() {
    let turned = |p: DVec3| DVec3::new(-p.y, p.x, p.z);
    let scan = of(
        "a.ptx",
        ptx(&holed(DVec3::ZERO), 4, 5, DVec3::new(1.0, 2.0, 3.0)),
    );
    assert_holed(&scan, |p| turned(p) + DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(scan.seen_from(7), Some(DVec3::new(1.0, 2.0, 3.0)));
    assert_eq!(
        (scan.unit, scan.unit_source),
        (Unit::Metre, UnitSource::Assumed)
    );
    // Far away no digit of the scanner's own coordinates is lost.
    let far = DVec3::new(4.0e6, 5.0e6, 100.0);
    let scan = of("a.txt", ptx(&holed(DVec3::ZERO), 4, 5, far));
    assert_eq!(scan.origin, DVec3::new(4.0e6, 5.0e6, 0.0));
    assert_eq!(
        scan.points[1],
        turned(wave()[1]) + DVec3::new(0.0, 0.0, 100.0)
    );
    let two = ptx(&holed(DVec3::ZERO), 4, 5, DVec3::ZERO) + "\n" + &ptx(&wave(), 2, 10, DVec3::X);
    let scan = of("a.ptx", &two);
    assert_eq!(
        (scan.points.len(), &scan.organisation),
        (38, &Organisation::Unordered)
    );
    assert!(scan.warnings.iter().any(|w| w.contains("2 scans")));
    assert!(scan.records.empty().eq([3, 12]));
    assert_eq!([2, 17, 18, 37].map(|k| scan.records.of(k)), [2, 19, 20, 39]);
    for (point, place) in [(17, DVec3::ZERO), (18, DVec3::X), (37, DVec3::X)] {
        assert_eq!(scan.seen_from(point), Some(place));
    }
    for (content, says) in [
        (two[..two.len() - 90].to_owned(), "of 20)"),
        (two.replacen("4\n5\n", "4\n5000000000\n", 1), "line 2"),
        (two.replacen("0 1 0 0\n", "0 1 0\n", 1), "line 7"),
        (two.replacen("10 20 300 ", "10 twenty 300 ", 1), "line 11"),
        (two.replacen("10 20 300 0.5 10 20 30\n", "", 1), "line 31"),
    ] {
        let message = refused("a.ptx", content);
        assert!(message.contains(says), "{says}: {message}");
    }
}

#[test]
fn off_with_all_keywords() {
    let vertices = ["0 0 0", "1 0 0", "1 1 0", "0 1 0.5"];
    let make = |keyword: &str, counts: &str, extra: &str| {
        format!(
            "{keyword}{counts}\n{}{extra}\n4 0 1 2 3 255 0 0\n2 0 1\n",
            vertices.join(&format!("{extra}\n"))
        )
    };
    for (keyword, extra) in [
        ("OFF\n", ""),
        ("OFF", ""),
        ("\t OFF ", ""),
        ("# made\n\nOFF # by hand\n# counts\n", " # a corner"),
        ("", ""),
        ("COFF\n", " 255 0 0"),
        ("NOFF\n", " 0 0 1"),
        ("STOFF\n", " 0.5 0.5"),
        ("4OFF\n", " 1"),
        ("nOFF\n3\n", ""),
        ("STCNOFF\n", " 0 0 1 255 0 0 1 0.5 0.5"),
    ] {
        for counts in ["4 2 5", "4 2", "4 2 0 # nothing"] {
            let scan = of("a.off", make(keyword, counts, extra));
            assert_eq!(scan.points[3], DVec3::new(0.0, 1.0, 0.5), "{keyword}");
            assert_eq!(
                scan.organisation,
                Organisation::Mesh(vec![[0, 1, 2], [0, 2, 3]]),
                "{keyword}"
            );
            assert_eq!(scan.normals.is_some(), keyword.contains('N'), "{keyword}");
            assert_eq!(scan.warnings.len(), 1, "{:?}", scan.warnings);
        }
    }
    assert!(of("a.off", "OFF\n1 0 0\n1 2 3\n").points.len() == 1);
    for (content, says) in [
        ("OFF BINARY\n\0\0", "binary"),
        ("OFF\n400000000000 2 0\n1 2 3\n", "line 2"),
        ("OFF\n2 0 0\n1 2 3\n", "truncated"),
        (
            "OFF\n1 1 0\n1 2 3\n3 0 0 1\n",
            "vertex index 1 is out of range",
        ),
        ("OFF\n1 1 0\n1 2 3\n3 0 0 -1\n", "line 4"),
        ("OFF\n1 1 0\n1 2 z\n3 0 0 0\n", "line 3"),
        ("OFF\n1 1 0\n1 2 3\n99999999999 0 0 0\n", "truncated"),
        ("nOFF\n4\n1 0 0\n1 2 3 4\n", "three coordinates"),
        ("OFF\n", "ends before the number of vertices"),
    ] {
        let message = refused("a.off", content);
        assert!(message.contains(says), "{content:?}: {message}");
    }
}

#[test]
fn arrays_of_numpy_in_both_orders() {
    let points = holed(DVec3::NAN);
    let list: Vec<f64> = wave().iter().flat_map(|p| p.to_array()).collect();
    // [i][j] is the point i along u in row j; the last index, or the first, runs fastest.
    let index = |i: usize, j: usize| points[5 * j + i].to_array();
    let mut by_last = Vec::new();
    let mut by_first = Vec::new();
    for i in 0..5 {
        for j in 0..4 {
            by_last.extend(index(i, j));
        }
    }
    for c in 0..3 {
        for j in 0..4 {
            by_first.extend((0..5).map(|i| index(i, j)[c]));
        }
    }
    for descr in ["<f8", ">f8", "<f4", ">f4"] {
        let scan = of("a.npy", npy(descr, false, "(20, 3)", &list));
        assert_eq!(scan.points, wave(), "{descr}");
        assert_eq!(scan.organisation, Organisation::Unordered);
        assert_holed(
            &of("a.npy", npy(descr, false, "(5, 4, 3)", &by_last)),
            |p| p,
        );
        assert_holed(
            &of("a.npy", npy(descr, true, "(5, 4, 3)", &by_first)),
            |p| p,
        );
    }
    assert_eq!(
        of(
            "a.npy",
            npy(">i2", false, "(2, 3)", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
        )
        .points[1]
            .x,
        4.0
    );
    for (file, says) in [
        (npy("<f8", false, "(20, 2)", &list), "fewer than 3"),
        (npy("<f8", false, "(60,)", &list), "holds no points"),
        (npy("<f8", false, "(3, 20)", &list), "transpose"),
        (npy("<f8", false, "(21, 3)", &list), "truncated"),
        (
            npy("<f8", false, "(6148914691236517206, 3)", &list),
            "truncated",
        ),
        (npy("<c16", false, "(20, 3)", &list), "<c16"),
    ] {
        let message = refused("a.npy", file);
        assert!(message.contains(says), "{says}: {message}");
    }
    for depth in [1_000, 60_000] {
        let nested = format!("{{'descr': {}", "(".repeat(depth));
        let mut file = b"\x93NUMPY\x02\0".to_vec();
        file.extend(u32::try_from(nested.len()).unwrap().to_le_bytes());
        file.extend(nested.bytes());
        assert!(refused("a.npy", file).len() < 300);
    }
}

#[test]
fn e57_with_pose_and_cells() {
    let turned = |p: DVec3| DVec3::new(-p.y, p.x, p.z);
    let cells = |points: &[DVec3]| -> Vec<(DVec3, [i64; 2])> {
        let cells = (0..).map(|k| [100 + k % 5, 7 + k / 5]);
        let all = points.iter().copied().zip(cells);
        all.filter(|(p, _)| !p.is_nan()).collect()
    };
    let place = DVec3::new(3.0, -2.0, 1.0);
    for spherical in [false, true] {
        // Cells without an entry, marked invalid, and 0 0 0.
        for empty in [DVec3::NAN, DVec3::NEG_Z, DVec3::ZERO] {
            if spherical && empty == DVec3::ZERO {
                continue;
            }
            let mut points = cells(&holed(empty));
            let scan = of("a.e57", e57(&[points.clone()], place, spherical));
            assert_holed(&scan, |p| turned(p) + place);
            // Cells without an entry have no record.
            let records: Vec<u32> = scan.records.empty().collect();
            assert_eq!(records, if empty.is_nan() { vec![] } else { vec![3, 12] });
            assert_eq!(
                (scan.unit, scan.unit_source),
                (Unit::Metre, UnitSource::File)
            );
            points.reverse();
            let scan = of("a.e57", e57(&[points], place, spherical));
            assert_holed(&scan, |p| turned(p) + place);
            assert_eq!(scan.records.of(17), if empty.is_nan() { 17 } else { 19 });
        }
    }
    let far = DVec3::new(4.0e6, 5.0e6, 0.0);
    let scan = of("a.e57", e57(&[cells(&wave())], far, false));
    assert_eq!(scan.origin, far);
    assert!(scan.points[7].distance(turned(wave()[7])) < 1e-13);
    let two = of(
        "a.e57",
        e57(&[cells(&wave()), cells(&holed(DVec3::NAN))], far, false),
    );
    assert_eq!(
        (two.points.len(), &two.organisation),
        (38, &Organisation::Unordered)
    );
    for point in [0, 37] {
        // Relative to the place of the scanner, which is far.
        assert_eq!(two.seen_from(point), Some(DVec3::ZERO));
    }
    let mut twice = cells(&wave());
    twice.push(twice[3]);
    let scan = of("a.e57", e57(&[twice], far, false));
    assert_eq!(
        (scan.points.len(), &scan.organisation),
        (21, &Organisation::Unordered)
    );
    let file = e57(&[cells(&wave())], far, false);
    for (content, says) in [
        (file[..file.len() - 1024].to_vec(), "header"),
        (file[..file.len() - 7].to_vec(), "truncated"),
        (b"ASTM-E57".to_vec(), "header"),
    ] {
        let message = refused("a.e57", content);
        assert!(message.contains(says), "{says}: {message}");
    }
}

#[test]
fn normals_of_e57_are_turned_by_the_pose() {
    let scan = of("a.e57", e57_with_normals(&wave(), DVec3::X));
    let normals = scan.normals.unwrap();
    assert_eq!(normals.len(), 20);
    assert!(normals.iter().all(|n| n.distance(DVec3::Y) < 1e-12));
    assert_eq!(scan.viewpoints.len(), 1);
    assert_eq!(scan.viewpoints[0].place, DVec3::new(1.0, 2.0, 3.0));
}

#[test]
fn las_and_laz_to_the_last_digit() {
    let offset = DVec3::new(4_500_000.0, 5_500_000.0, 0.0);
    let points: Vec<DVec3> = (0..3000)
        .map(f64::from)
        .map(|k| {
            let p = DVec3::new((k * 0.1).round(), (k * k) % 977.0, (k * 7.0) % 31.0);
            offset + p * 0.001
        })
        .collect();
    for format in [0, 1, 2, 3, 6, 7, 8] {
        for compressed in [false, true] {
            let file = las(&points, format, compressed, offset);
            let scan = of("a.laz", &file);
            assert_eq!(scan.format, if compressed { "laz" } else { "las" });
            assert_eq!(scan.points.len(), points.len(), "format {format}");
            assert_eq!(
                scan.origin.x.fract().abs() + scan.origin.y.fract().abs(),
                0.0
            );
            for (found, given) in scan.points.iter().zip(&points) {
                // Whole thousandths, as they were before the offset was added.
                let exact = ((*given - offset) * 1000.0).round() - (scan.origin - offset) * 1000.0;
                assert!((*found * 1000.0).distance(exact) < 1e-9, "{found} {given}");
            }
            let cut = &file[..file.len() * 2 / 3];
            let message = refused("a.las", cut);
            assert!(
                message.contains("truncated") || message.contains("end"),
                "{message}"
            );
        }
    }
    let mut lying = las(&points[..5], 0, false, offset);
    lying[107..111].fill(0xff);
    assert!(refused("a.las", &lying).contains("file ends after 5"));
    let mut endless = las(&points[..5], 6, false, offset);
    let end = u64::try_from(endless.len()).unwrap();
    endless[235..243].copy_from_slice(&end.to_le_bytes());
    endless[243] = 1;
    endless.extend([0xff; 80]);
    assert_eq!(of("a.las", endless).points.len(), 5);
    let near = of("a.las", las(&wave(), 0, false, DVec3::ZERO));
    assert_eq!((near.points, near.origin), (wave(), DVec3::ZERO));
}

#[test]
fn compressed_files_of_any_format() {
    for (name, content) in [
        ("a.xyz.gz", b"1 2 3\n4 5 6\n".to_vec()),
        ("a.ply.gz", b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n4 5 6\n".to_vec()),
        ("a.gz", pcd(&wave()[..2], 2, 1, "binary")),
        ("a.off.gz", b"2 0 0\n1 2 3\n4 5 6\n".to_vec()),
    ] {
        let packed = gzip(&content);
        assert_eq!(of(name, &packed).points.len(), 2, "{name}");
        let message = refused(name, &packed[..packed.len() - 9]);
        assert!(message.contains("gzip"), "{message}");
        assert!(refused(name, gzip(&packed)).contains("gzip within gzip"));
    }
    // Two members are one file.
    let two = [gzip(b"1 2 3\n"), gzip(b"4 5 6\n")].concat();
    assert_eq!(of("a.xyz.gz", two).points.len(), 2);
    let bomb = gzip(&vec![b' '; 30 << 20]);
    assert!(bomb.len() < 1 << 16);
    assert!(refused("a.xyz.gz", bomb).contains("gunzip"));
    assert!(refused("a.xyz.gz", gzip(b"")).contains("empty"));
}

#[test]
fn what_is_no_scan_is_answered_with_what_is() {
    for (name, content) in [
        ("a.3mf", "<?xml version=\"1.0\"?>\n<model>"),
        ("a.xml", "<xml>\n</xml>\n"),
    ] {
        let error = read_bytes(content.into(), Path::new(name)).unwrap_err();
        assert!(matches!(error, Error::Unsupported(_)), "{error}");
        for format in [
            "PLY", "OFF", "PCD", "PTX", "E57", "LAS", "NPY", "VTK", "XYZ",
        ] {
            assert!(error.to_string().contains(format), "{error}");
        }
    }
}

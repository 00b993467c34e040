//! CAD files written and read back.

use nurbskin::io::iges::{self, IgesContent, IgesModel, Layout, Timestamp, WriteOptions};
use nurbskin::{ControlNet, DVec3, Error, KnotVector, NurbsSurface, Unit};
use proptest::prelude::*;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

fn surface(
    ku: KnotVector,
    kv: KnotVector,
    f: impl Fn(usize, usize) -> DVec3,
    w: Option<Vec<f64>>,
) -> NurbsSurface {
    let (m, n) = (ku.control_point_count(), kv.control_point_count());
    NurbsSurface::new(ku, kv, ControlNet::from_fn(m, n, f).unwrap(), w).unwrap()
}

/// An open, uneven surface of these degrees.
fn wavy(p: usize, q: usize, m: usize, n: usize) -> NurbsSurface {
    let breaks = |spans: usize| -> Vec<f64> { (0..=spans).map(|i| (i as f64).powf(1.3)).collect() };
    surface(
        KnotVector::clamped(p, &breaks(m - p)).unwrap(),
        KnotVector::clamped(q, &breaks(n - q)).unwrap(),
        |i, j| {
            let (x, y) = (i as f64 / 3.0, j as f64 * 0.7);
            DVec3::new(x, y, (0.9 * x).sin() * (1.1 * y).cos() - 2.0)
        },
        None,
    )
}

/// A tube, periodic along v, of radius 7.
fn tube(m: usize, n: usize) -> NurbsSurface {
    let breaks: Vec<f64> = (0..=n).map(|i| i as f64 / n as f64).collect();
    surface(
        KnotVector::uniform(3, m).unwrap(),
        KnotVector::periodic(3, &breaks).unwrap(),
        |i, j| {
            let angle = TAU * (j % n) as f64 / n as f64;
            DVec3::new(7.0 * angle.cos(), 7.0 * angle.sin(), 3.0 * i as f64)
        },
        None,
    )
}

/// The sphere of radius 5 about (1, 2, 3), exactly: nine by five control points.
fn sphere() -> NurbsSurface {
    let around = [
        (1, 0),
        (1, 1),
        (0, 1),
        (-1, 1),
        (-1, 0),
        (-1, -1),
        (0, -1),
        (1, -1),
        (1, 0),
    ];
    let along = [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1)];
    let weights = (0..45)
        .map(|k| {
            let half = |odd: bool| if odd { FRAC_1_SQRT_2 } else { 1.0 };
            half(k % 9 % 2 == 1) * half(k / 9 % 2 == 1)
        })
        .collect();
    surface(
        KnotVector::new(2, vec![0., 0., 0., 1., 1., 2., 2., 3., 3., 4., 4., 4.]).unwrap(),
        KnotVector::new(2, vec![0., 0., 0., 1., 1., 2., 2., 2.]).unwrap(),
        |i, j| {
            let ((x, y), (r, z)) = (around[i], along[j]);
            DVec3::new(1.0, 2.0, 3.0)
                + 5.0 * DVec3::new(f64::from(r * x), f64::from(r * y), f64::from(z))
        },
        Some(weights),
    )
}

fn bytes_of(surfaces: &[NurbsSurface], options: &WriteOptions) -> Vec<u8> {
    let mut bytes = Vec::new();
    let content = IgesContent {
        surfaces,
        ..Default::default()
    };
    let written = iges::write(&mut bytes, &content, options).unwrap();
    assert_eq!(written.bytes, bytes.len());
    assert_eq!(written.lines, bytes.iter().filter(|&&b| b == b'\n').count());
    bytes
}

fn exact(surfaces: &[NurbsSurface]) -> Vec<u8> {
    bytes_of(surfaces, &WriteOptions::default())
}

fn read(bytes: &[u8]) -> IgesModel {
    iges::read(bytes, "part.igs").unwrap()
}

fn refusal(bytes: &[u8]) -> String {
    iges::read(bytes, "part.igs").unwrap_err().to_string()
}

/// All numbers of a surface, bit by bit.
fn bits(s: &NurbsSurface) -> Vec<u64> {
    let points = s
        .control_points()
        .points()
        .iter()
        .flat_map(|p| p.to_array());
    let knots = s
        .knots_u()
        .knots()
        .iter()
        .chain(s.knots_v().knots())
        .copied();
    let weights = s.weights().unwrap_or(&[]).iter().copied();
    points
        .chain(knots)
        .chain(weights)
        .map(f64::to_bits)
        .collect()
}

#[test]
fn iges_returns_every_bit() {
    let mut surfaces: Vec<NurbsSurface> = (1..=9)
        .map(|p| wavy(p, 10 - p, p + 1 + p % 3, 13))
        .collect();
    surfaces.push(wavy(3, 3, 4, 4)); // one span by one span
    surfaces.push(wavy(1, 1, 2, 2));
    surfaces.push(sphere());
    let extremes = [
        5e-324,
        -2.2e-308,
        1e300,
        -1e300,
        -0.0,
        0.0,
        0.1,
        1.0 / 3.0,
        1e15,
        1e16,
        123_456_789.0,
    ];
    let knots = KnotVector::uniform(2, 4).unwrap();
    surfaces.push(surface(
        knots.clone(),
        knots.with_domain(-1e-310, 3e-7).unwrap(),
        |i, j| DVec3::new(extremes[i], extremes[4 + j], extremes[(i + j) % 11]),
        Some((0..16).map(|k| 1e-3 * f64::from(k + 1) / 7.0).collect()),
    ));
    let model = read(&exact(&surfaces));
    assert_eq!(model.surfaces.len(), surfaces.len());
    for (found, wanted) in model.surfaces.iter().zip(&surfaces) {
        assert_eq!(found.surface.degree(), wanted.degree());
        assert_eq!(bits(&found.surface), bits(wanted));
        assert_eq!(found.label, "SURFACE");
        assert_eq!(found.level, iges::SURFACE_LEVEL);
        assert!(!found.trimmed);
    }
    assert!(model.warnings.is_empty() && model.unread.is_empty());
}

#[test]
fn iges_has_eighty_columns_and_its_counts_hold() {
    let bytes = exact(&[wavy(3, 3, 9, 8), sphere()]);
    let text = std::str::from_utf8(&bytes).unwrap();
    let mut sections = std::collections::BTreeMap::<&str, usize>::new();
    for line in text.lines() {
        assert_eq!(line.len(), 80);
        let count = sections.entry(&line[72..73]).or_default();
        *count += 1;
        assert_eq!(line[73..].trim().parse(), Ok(*count));
    }
    let count = |s: &str| sections[s];
    let last = format!(
        "S{:>7}G{:>7}D{:>7}P{:>7}",
        count("S"),
        count("G"),
        count("D"),
        count("P")
    );
    assert!(text.lines().last().unwrap().starts_with(&last));
    assert_eq!((count("D"), count("T")), (4, 1));
    // K = count - 1, then the degrees, closure, "polynomial", "not periodic".
    assert!(text.contains("128,8,7,3,3,0,0,1,0,0,"));
    assert!(text.contains("128,8,4,2,2,1,0,0,0,0,"));
}

#[test]
fn iges_in_the_papers_layout_has_the_papers_lines() {
    for (m, n, lines, kib) in [
        (18, 18, 230, 18.42),
        (4, 4, 22, 1.76),
        (29, 13, 267, 21.38),
        (25, 32, 549, 43.96),
    ] {
        // Averaged uniform parameters, as the paper interpolates.
        let knots = |count: usize| {
            let t = |k: usize| k as f64 / (count - 1) as f64;
            let mut breaks = vec![0.0];
            breaks.extend((1..count - 3).map(|j| (t(j) + t(j + 1) + t(j + 2)) / 3.0));
            breaks.push(1.0);
            KnotVector::clamped(3, &breaks).unwrap()
        };
        let s = surface(
            knots(m),
            knots(n),
            |i, j| {
                DVec3::new(
                    10.0 * i as f64 - 80.0,
                    9.5 * j as f64,
                    -3.25 * (i * j) as f64 / 7.0,
                )
            },
            None,
        );
        for name in [
            "",
            "a_rather_long_name_for_a_part_that_somebody_scanned.igs",
        ] {
            let options = WriteOptions {
                layout: Layout::Paper,
                product: name.into(),
                file_name: name.into(),
                ..Default::default()
            };
            let bytes = bytes_of(std::slice::from_ref(&s), &options);
            assert_eq!(bytes.len(), 82 * lines, "{m} x {n}");
            assert!((bytes.len() as f64 / 1024.0 - kib).abs() < 0.006);
            let back = &read(&bytes).surfaces[0].surface;
            assert_eq!(back.control_points().counts(), [m, n]);
            for (a, b) in back
                .control_points()
                .points()
                .iter()
                .zip(s.control_points().points())
            {
                assert!((*a - *b).abs().max_element() <= 5.1e-7);
            }
        }
    }
}

#[test]
fn the_papers_layout_refuses_what_six_decimals_would_tear() {
    let knots = KnotVector::clamped(1, &[0.0, 1e-8, 2e-8, 1.0]).unwrap();
    let s = surface(
        knots.clone(),
        knots,
        |i, j| DVec3::new(i as f64, j as f64, 0.0),
        None,
    );
    let options = WriteOptions {
        layout: Layout::Paper,
        ..Default::default()
    };
    let content = IgesContent {
        surfaces: &[s],
        ..Default::default()
    };
    let error = iges::write(&mut Vec::new(), &content, &options).unwrap_err();
    assert!(
        error.to_string().contains("too coarse for the knots"),
        "{error}"
    );
}

#[test]
fn periodic_and_unclamped_surfaces_are_written_clamped_and_unmoved() {
    let periodic = tube(6, 11);
    let unclamped = surface(
        KnotVector::new(3, (0..12).map(f64::from).collect()).unwrap(),
        KnotVector::new(2, vec![-1., -0.5, 0., 1., 1., 2., 2.25, 4.]).unwrap(),
        |i, j| DVec3::new(i as f64, j as f64, ((i * i + 3 * j) % 5) as f64),
        Some((0..40).map(|k| 1.0 + f64::from(k % 7) / 3.0).collect()),
    );
    let model = read(&exact(&[periodic.clone(), unclamped.clone()]));
    assert_eq!(model.surfaces[0].closed, [false, true]);
    assert_eq!(model.surfaces[1].closed, [false, false]);
    for (found, wanted) in model.surfaces.iter().zip([&periodic, &unclamped]) {
        let found = &found.surface;
        assert!(found.knots_u().is_clamped() && found.knots_v().is_clamped());
        assert_eq!(found.periodic(), [false, false]);
        assert_eq!(found.domain(), wanted.domain());
        let [(a, b), (c, d)] = wanted.domain();
        for k in 0..400 {
            let (u, v) = (
                a + (b - a) * f64::from(k % 20) / 19.0,
                c + (d - c) * f64::from(k / 20) / 19.0,
            );
            assert!((found.point(u, v) - wanted.point(u, v)).length() < 1e-13);
        }
    }
    let back = &model.surfaces[0].surface;
    let [m, n] = back.control_points().counts();
    assert!(
        (0..m).all(|i| back.control_points().point(i, 0) == back.control_points().point(i, n - 1))
    );
}

#[test]
fn closure_is_the_geometrys() {
    let closed = |s: &NurbsSurface| read(&exact(std::slice::from_ref(s))).surfaces[0].closed;
    assert_eq!(closed(&sphere()), [true, false]);
    assert_eq!(closed(&sphere().transposed()), [false, true]);
    assert_eq!(closed(&wavy(3, 2, 7, 7)), [false, false]);
    // A gap of a millionth of the size is a gap.
    let net = tube(6, 11);
    let open = read(&exact(&[net])).surfaces[0].surface.clone();
    let n = open.control_points().count_v();
    let first = open.control_points().row(0).to_vec();
    let opened = surface(
        open.knots_u().clone(),
        open.knots_v().clone(),
        |i, j| {
            let shift = if j == n - 1 && i == 2 { 3e-5 } else { 0.0 };
            (if j == n - 1 {
                first[i]
            } else {
                open.control_points().point(i, j)
            }) + DVec3::X * shift
        },
        None,
    );
    assert_eq!(closed(&opened), [false, false]);
}

#[test]
fn units_names_times_and_resolution_are_told() {
    for unit in Unit::ALL {
        let options = WriteOptions {
            unit,
            product: "Vase, größer; 3D".into(),
            file_name: "vase.igs".into(),
            timestamp: Timestamp::new(2007, 1, 29, 10, 54, 34).unwrap(),
            ..Default::default()
        };
        let global = read(&bytes_of(&[sphere()], &options)).global;
        assert_eq!(global.unit, unit);
        assert!(global.unit_given);
        assert_eq!(global.product, "Vase, gr__er; 3D");
        assert_eq!(global.file_name, "vase.igs");
        assert_eq!(global.date, "20070129.105434");
        assert!(
            (global.resolution - 1e-6).abs() < 1e-20,
            "{}",
            global.resolution
        ); // diagonal 17.3
        assert!((global.maximum_coordinate - 8.0).abs() < 1e-12);
    }
    let far = WriteOptions {
        origin: DVec3::splat(1e12),
        ..Default::default()
    };
    let model = read(&bytes_of(&[sphere()], &far));
    assert!(model.global.resolution > 8e-4);
    let moved = sphere().map_points(|p| p + 1e12).unwrap();
    assert_eq!(bits(&model.surfaces[0].surface), bits(&moved));
}

#[test]
fn scan_points_and_polylines_go_along() {
    let points = [DVec3::new(0.1, -0.0, 1e-300), DVec3::X];
    let polylines = [vec![DVec3::ZERO, DVec3::Y, DVec3::new(1.0, 2.0, 1.0 / 3.0)]];
    let mut bytes = Vec::new();
    let content = IgesContent {
        surfaces: &[sphere()],
        points: &points,
        polylines: &polylines,
    };
    let options = WriteOptions {
        colour: Some([255, 128, 0]),
        ..Default::default()
    };
    iges::write(&mut bytes, &content, &options).unwrap();
    let model = read(&bytes);
    assert_eq!(model.points, points);
    assert_eq!(model.polylines, polylines);
    assert_eq!(model.surfaces.len(), 1);
    assert_eq!(
        model.entities,
        [(106, 1), (116, 2), (128, 1), (314, 1)].into()
    );
    assert_eq!(model.unread, [(314, 1)].into());
}

#[test]
fn what_cannot_be_written_is_refused() {
    let write = |content: IgesContent<'_>, options: &WriteOptions| {
        iges::write(&mut Vec::new(), &content, options)
            .unwrap_err()
            .to_string()
    };
    let plain = WriteOptions::default();
    assert!(write(IgesContent::default(), &plain).contains("nothing to write"));
    let bad = [DVec3::NAN];
    let content = IgesContent {
        points: &bad,
        ..Default::default()
    };
    assert!(write(content, &plain).contains("not finite"));
    let surfaces = [sphere()];
    let content = IgesContent {
        surfaces: &surfaces,
        ..Default::default()
    };
    for wrong in [0.0, -1.0, f64::NAN] {
        let options = WriteOptions {
            resolution: Some(wrong),
            ..Default::default()
        };
        assert!(write(content, &options).contains("resolution"));
    }
    let mut full: &mut [u8] = &mut [0; 100];
    let options = WriteOptions {
        file_name: "vase.igs".into(),
        ..Default::default()
    };
    let error = iges::write(&mut full, &content, &options).unwrap_err();
    assert!(matches!(error, Error::Write { .. }) && error.to_string().contains("vase.igs"));
}

#[test]
fn the_same_input_makes_the_same_bytes() {
    let surfaces = [tube(5, 8), sphere()];
    assert_eq!(exact(&surfaces), exact(&surfaces));
}

/// An entity of a hand-made file: type, form, directory entry of its matrix, parameters.
type Entity<'a> = (u32, i32, usize, &'a str);

fn hand_made(global: &str, entities: &[Entity<'_>]) -> String {
    let mut cards = [String::new(), String::new(), String::new()];
    let mut counts = [0usize; 3];
    let mut put = |which: usize, data: &str| {
        counts[which] += 1;
        let letter = ["G", "D", "P"][which];
        cards[which] += &format!("{data:<72}{letter}{:>7}\n", counts[which]);
        counts[which]
    };
    let mut rest = global;
    while !rest.is_empty() {
        let (head, tail) = rest.split_at(rest.len().min(72));
        put(0, head);
        rest = tail;
    }
    for (k, (entity, form, matrix, parameters)) in entities.iter().enumerate() {
        let mut range = (usize::MAX, 0);
        for line in parameters.lines() {
            let at = put(2, &format!("{line:<64} {:>7}", 2 * k + 1));
            range = (range.0.min(at), at);
        }
        let status = if *entity == 126 {
            "00010000"
        } else {
            "00000000"
        };
        put(
            1,
            &format!(
                "{entity:>8}{:>8}{:>8}{:>8}{:>8}{:>8}{matrix:>8}{:>8}{status}",
                range.0, "", "", 4, "", ""
            ),
        );
        let lines = range.1 + 1 - range.0;
        put(
            1,
            &format!(
                "{entity:>8}{:>8}{:>8}{lines:>8}{form:>8}{:>16}{:>8}{:>8}",
                "", "", "", "LABEL", k
            ),
        );
    }
    let [g, d, p] = counts;
    format!(
        "{:<72}S{:>7}\n{}{}{}{:<72}T{:>7}\n",
        "Made by hand",
        1,
        cards[0],
        cards[1],
        cards[2],
        format!("S{:>7}G{g:>7}D{d:>7}P{p:>7}", 1),
        1
    )
}

const MILLIMETRES: &str = "1H,,1H;,,,,,32,38,6,308,15,,1.,2,2HMM;";

fn near(a: DVec3, b: DVec3) {
    assert!((a - b).length() < 1e-12, "{a} is not {b}");
}

#[test]
fn curves_points_and_matrices_are_read() {
    let file = hand_made(
        MILLIMETRES,
        &[
            (100, 0, 0, "100,5.,1.,1.,3.,1.,1.,3.;"), // a quarter
            (100, 0, 3, "100,0.0D0,0,0,2.E0,0,2,0;"), // a full circle, moved by D3
            (124, 0, 0, "124,0,-1,0,10., 1,0,0,0, 0,0,1,0;"), // unused here
            (110, 0, 9, "110,1,2,3,4,5,6;"),
            (124, 0, 11, "124,0,-1,0,0,1,0,0,0,0,0,1,0;"), // a quarter turn about z, then D11
            (124, 0, 0, "124,1,0,0,100,0,1,0,0,0,0,1,0;"), // a shift along x
            (
                126,
                0,
                0,
                "126,2,1,0,0,1,0,0.,0.,1.,2.,2.,\n1.,1.,1.,0,0,0,1,0,0,1,1,0,0.5,1.5,0,0,1;",
            ),
            (102, 0, 0, "102,2,1,7;"),
            (116, 0, 0, "116,1.5,,-2.5D-1;"),
            (106, 1, 0, "106,1,2,7.,1,2,3,4;"),
            (106, 2, 0, "106,2,2,1,2,3,4,5,6;"),
            (106, 3, 0, "106,3,1,1,2,3,0,0,1;"),
            (106, 11, 0, "106,1,2,7.,1,2,3,4;"),
            (106, 63, 0, "106,1,3,0.,0,0,1,0,0,1;"),
            (106, 31, 0, "106,1,2,7.,1,2,3,4;"), // section lines: a drawing aid
            (402, 1, 0, "402,2,1,7;"),
        ],
    );
    // D3 is not a matrix: its line is named.
    let text = refusal(file.as_bytes());
    assert_eq!(
        text,
        "part.igs, line 5 (D3): its transformation matrix should be at D3, where no entity 124 is"
    );
    let file = file.replace(
        "       3        00000000D      3",
        "       5        00000000D      3",
    );
    let model = read(file.as_bytes());
    let curve = |k: usize| &model.curves[k].curve;
    assert_eq!(model.curves.len(), 4);
    for k in 0..=50 {
        let t = f64::from(k) / 50.0;
        let p = curve(0).point(t);
        assert!(
            (p - DVec3::new(1.0, 1.0, 5.0)).length() - 2.0 < 1e-14
                && p.x > 1.0 - 1e-12
                && p.y > 1.0 - 1e-12
        );
        let p = curve(1).point(t) - DVec3::X * 10.0;
        assert!((p.length() - 2.0).abs() < 1e-14);
    }
    near(curve(1).point(0.25), DVec3::new(8.0, 0.0, 0.0)); // (0, 2) turned by 90 degrees
    near(curve(2).point(0.0), DVec3::new(98.0, 1.0, 3.0));
    near(curve(2).point(1.0), DVec3::new(95.0, 4.0, 6.0));
    assert_eq!(curve(3).domain(), (0.5, 1.5));
    near(curve(3).point(1.0), DVec3::X);
    assert!(model.curves[3].subordinate && !model.curves[3].parametric);
    assert_eq!(model.composites.len(), 1);
    assert_eq!(
        model.composites[0].parts,
        [curve(0).clone(), curve(2).clone()]
    );
    assert_eq!(model.points.len(), 1 + 2 + 2 + 1);
    assert_eq!(model.points[0], DVec3::new(1.5, 0.0, -0.25));
    assert_eq!(model.points[1], DVec3::new(1.0, 2.0, 7.0));
    assert_eq!(model.polylines.len(), 2);
    assert_eq!(model.polylines[1].len(), 4);
    assert_eq!(model.unread, [(106, 1), (402, 1)].into());
    assert_eq!(model.entities[&106], 6);
}

#[test]
fn delimiters_may_be_chosen_and_fields_left_out() {
    let file = hand_made(
        "1H/,1H#////4HA/#B//////////".replace(',', "/").as_str(),
        &[(116, 0, 0, "116/1./2./3.#")],
    );
    // Parameter 14 (unit flag) and all behind it are missing: inches, and the reader says so.
    let file = file.replace("//////////", "////////# ");
    let model = read(file.as_bytes());
    assert_eq!(model.global.delimiters, ['/', '#']);
    assert_eq!(model.points, [DVec3::new(1.0, 2.0, 3.0)]);
    assert_eq!(model.global.unit, Unit::Inch);
    assert!(!model.global.unit_given && model.warnings[0].contains("inches"));
    let file = hand_made(",,,,,,,,,,,,,8;", &[(116, 0, 0, "116,1.,2.,3.;")]);
    let model = read(file.as_bytes());
    assert_eq!(model.global.unit, Unit::Inch);
    near(model.points[0], DVec3::new(0.001, 0.002, 0.003));
    assert!(model.warnings[0].contains("0.001"));
}

#[test]
fn line_ends_and_lengths_are_tolerated() {
    let bytes = exact(&[wavy(2, 3, 5, 6)]);
    let text = String::from_utf8(bytes.clone()).unwrap();
    let wanted = bits(&read(&bytes).surfaces[0].surface);
    let crlf = text.replace('\n', "\r\n") + "\u{1a}";
    let cr = text.replace('\n', "\r");
    let records = text.replace('\n', "");
    let long = text.replace('\n', "     \n\n");
    for variant in [crlf, cr, records, long] {
        assert_eq!(bits(&read(variant.as_bytes()).surfaces[0].surface), wanted);
    }
}

#[test]
fn refusals_name_the_line() {
    let good = String::from_utf8(exact(&[wavy(3, 3, 5, 5)])).unwrap();
    let line_with = |text: &str| good.lines().position(|l| l.contains(text)).unwrap() + 1;
    let changed = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        refusal(good.replacen(from, to, 1).as_bytes())
    };
    let p1 = line_with("128,4,4,3,3");
    let tests = [
        (refusal(b""), "the file is empty".to_owned()),
        (
            refusal(b"ply\nformat ascii 1.0\n"),
            "line 1: this is not an IGES file".into(),
        ),
        (refusal(&[0u8; 300]), "binary".into()),
        (
            refusal(format!("{:<72}C      1\n", "").as_bytes()),
            "compressed ASCII form".into(),
        ),
        (
            refusal(format!("{:<72}B      1\n", "").as_bytes()),
            "binary form".into(),
        ),
        (
            changed("128,4,4,3,3", "128,9,4,3,3"),
            "numbers (control points): its counts do not fit".into(),
        ),
        (
            changed("128,4,4,3,3,", "128,9999999,"),
            format!("line {p1} (P1): 9999999 values (K1)"),
        ),
        (
            changed("128,4,4,3,3,", "128,-4,4,3, "),
            format!("line {p1} (P1): K1 is -4"),
        ),
        (
            changed("128,4,4,3,3", "126,4,4,3,3"),
            format!("line {p1} (P1): the data of an entity 126"),
        ),
        (
            changed("128,4,4,3,3", "128,4,4,3,x"),
            format!("line {p1} (P1): `x` where an integer"),
        ),
        (
            changed("     128       1", "     128       9"),
            "(D1): its parameter data should be".into(),
        ),
    ];
    for (found, wanted) in &tests {
        assert!(
            found.contains(wanted.as_str()),
            "{found}\nshould have\n{wanted}"
        );
        assert!(found.starts_with("part.igs"), "{found}");
    }
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    let good = exact(&[wavy(2, 2, 4, 4), tube(4, 5)]);
    for end in 0..good.len() - 9 {
        // The terminate card's last columns are only its number.
        let error = iges::read(&good[..end], "part.igs");
        assert!(error.is_err(), "cut after {end} bytes of {}", good.len());
    }
}

#[test]
fn counts_that_lie_cost_nothing() {
    for parameters in [
        "128,9000000,9000000,3,3,0,0,1,0,0,0;",
        "128,9223372036854775807,1,1,1,0,0,1,0,0,0;",
        "126,99999999999999999999,1;",
        "106,2,4000000000,0.,0.;",
        "102,1000000000,1;",
        "116,1,2,99999999H;",
        "106,2,60;",
    ] {
        let entity: u32 = parameters[..3].parse().unwrap();
        let form = if entity == 106 { 2 } else { 0 };
        let file = hand_made(MILLIMETRES, &[(entity, form, 0, parameters)]);
        let text = refusal(file.as_bytes());
        assert!(text.contains("(P1)"), "{text}");
    }
    // Two entities that share one long record, a circle of matrices, a composite of itself.
    let file = hand_made(
        MILLIMETRES,
        &[(116, 0, 0, "116,1,2,3;"), (116, 0, 0, "116,1,2,3;")],
    );
    let shared = file.replacen("     116       2", "     116       1", 1);
    assert!(refusal(shared.as_bytes()).contains("belong to another entity"));
    let matrix = "124,1,0,0,0,0,1,0,0,0,0,1,0;";
    let circle = hand_made(
        MILLIMETRES,
        &[
            (124, 0, 3, matrix),
            (124, 0, 1, matrix),
            (116, 0, 1, "116,1,2,3;"),
        ],
    );
    assert!(refusal(circle.as_bytes()).contains("circle"));
    let own = hand_made(
        MILLIMETRES,
        &[(102, 0, 0, "102,1,1;"), (102, 0, 0, "102,1,9;")],
    );
    assert!(refusal(own.as_bytes()).contains("D9, where no entity is"));
    let line = (110, 0, 0, "110,0,0,0,1,1,1;");
    let many = format!("102,3000{};", ",1".repeat(3000));
    let many: Vec<String> = many
        .as_bytes()
        .chunks(64)
        .map(|c| String::from_utf8_lossy(c).into())
        .collect();
    // Numbers may not be broken, but these are one digit long with their comma, and the head fits.
    let many = many.join("\n");
    let repeats: Vec<Entity<'_>> = std::iter::once(line)
        .chain((0..3).map(|_| (102, 0, 0, many.as_str())))
        .collect();
    let _ = iges::read(hand_made(MILLIMETRES, &repeats).as_bytes(), "part.igs");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Whatever happens to a file, reading it ends, without a panic; and what it says can be written again.
    #[test]
    fn mangled_files_are_read_or_refused(
        which in 0usize..3,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0u8..4), 1..6),
    ) {
        let mut bytes = match which {
            0 => exact(&[wavy(2, 3, 4, 5), sphere()]),
            1 => hand_made(MILLIMETRES, &[
                (124, 0, 0, "124,1,0,0,0,0,1,0,0,0,0,1,0;"),
                (100, 0, 1, "100,5.,1.,1.,3.,1.,1.,3.;"),
                (126, 0, 0, "126,2,1,0,0,1,0,0.,0.,1.,2.,2.,\n1.,1.,1.,0,0,0,1,0,0,1,1,0,0.5,1.5,0,0,1;"),
                (102, 0, 0, "102,2,3,5;"),
                (106, 12, 0, "106,2,2,1,2,3,4,5,6;"),
                (144, 0, 0, "144,1,0,0,1;"),
            ]).into_bytes(),
            _ => bytes_of(&[tube(4, 4)], &WriteOptions { layout: Layout::Paper, ..Default::default() }),
        };
        for (at, byte, kind) in changes {
            let at = at.index(bytes.len());
            // Characters that mean something do more harm than others.
            let likely = b"0123456789,;.-+EDHSGPT \n"[usize::from(byte) % 24];
            match kind {
                0 => bytes[at] = byte,
                1 => bytes[at] = likely,
                2 => { bytes.remove(at); }
                _ => bytes.insert(at, likely),
            }
        }
        if let Ok(model) = iges::read(&bytes, "part.igs") {
            let surfaces: Vec<NurbsSurface> = model.surfaces.into_iter().map(|s| s.surface).collect();
            let content = IgesContent { surfaces: &surfaces, ..Default::default() };
            let _ = iges::write(&mut Vec::new(), &content, &WriteOptions::default());
        }
    }

    /// Random surfaces of any degree return bit by bit.
    #[test]
    fn random_surfaces_return(
        p in 1usize..=9,
        q in 1usize..=9,
        more in (0usize..4, 0usize..4),
        seed in any::<u64>(),
        rational in any::<bool>(),
    ) {
        let mut state = seed | 1;
        let mut random = || {
            // Xorshift: any 64 bits, of which the finite numbers are taken.
            loop {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                let x = f64::from_bits(state);
                if x.is_finite() {
                    return x;
                }
            }
        };
        let (m, n) = (p + 1 + more.0, q + 1 + more.1);
        let points = (0..m * n).map(|_| DVec3::new(random(), random(), random())).collect();
        let weights = rational.then(|| (0..m * n).map(|_| random().abs().clamp(1e-9, 1e9)).collect());
        let s = NurbsSurface::new(
            KnotVector::uniform(p, m).unwrap(),
            KnotVector::uniform(q, n).unwrap().with_domain(-0.3, 1.0 / 7.0).unwrap(),
            ControlNet::new(m, n, points).unwrap(),
            weights,
        ).unwrap();
        prop_assert_eq!(bits(&read(&exact(std::slice::from_ref(&s))).surfaces[0].surface), bits(&s));
    }
}

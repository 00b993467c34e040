//! What is written reads back, bit by bit, and keeps to the format.

use super::{bits, bytes_of, exact, read, sphere, surface, tube, wavy};
use nurbskin::io::iges::{self, IgesContent, Layout, Timestamp, WriteOptions};
use nurbskin::{DVec3, Error, KnotVector, NurbsSurface, Unit};

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
fn a_rational_torus_of_any_degree_closes_to_the_last_bit() {
    for degree in 1..=6 {
        let breaks_u: Vec<f64> = (0..=7)
            .map(|i| f64::from(i) + 0.3 * f64::from(i % 3))
            .collect();
        let ku = KnotVector::periodic(degree, &breaks_u).unwrap();
        let kv = KnotVector::periodic(2, &[0.0, 0.5, 0.8, 2.0]).unwrap();
        let (m, n, du) = (
            ku.control_point_count(),
            kv.control_point_count(),
            ku.distinct_count(),
        );
        let weights = (0..m * n).map(|k| 1.0 + 0.1 * ((k % m % du) + 2 * (k / m % 3)) as f64);
        let torus = surface(
            ku,
            kv,
            |i, j| {
                let (a, b) = ((i % du) as f64 * 0.9, (j % 3) as f64 * 2.1);
                DVec3::new(
                    (3.0 + b.cos()) * a.cos(),
                    (3.0 + b.cos()) * a.sin(),
                    b.sin(),
                )
            },
            Some(weights.collect()),
        );
        let found = &read(&exact(std::slice::from_ref(&torus))).surfaces[0];
        assert_eq!(found.closed, [true, true]);
        let plain = &found.surface;
        let [(a, b), (c, d)] = torus.domain();
        assert_eq!(plain.domain(), torus.domain());
        for k in 0..400 {
            let (u, v) = (
                a + (b - a) * f64::from(k % 20) / 19.0,
                c + (d - c) * f64::from(k / 20) / 19.0,
            );
            assert!((plain.point(u, v) - torus.point(u, v)).length() < 1e-13);
        }
        let [m, n] = plain.control_points().counts();
        assert!(
            (0..n).all(|j| plain.homogeneous(0, j) == plain.homogeneous(m - 1, j)),
            "{degree}"
        );
        assert!(
            (0..m).all(|i| plain.homogeneous(i, 0) == plain.homogeneous(i, n - 1)),
            "{degree}"
        );
    }
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
        ..Default::default()
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

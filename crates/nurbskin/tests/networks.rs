//! Networks of faces, from scan to CAD file.

use crate::real_scans;
use nurbskin::cad::{JoinKind, ShellKind};
use nurbskin::deviation::verdict::Verdict;
use nurbskin::pipeline::{Closed, FaceLayout, Length, Options, Outcome, SurfacingOptions};
use nurbskin::pipeline::{check_fitted, fit_scan};
use nurbskin::progress::Silent;
use nurbskin::scan::simulate::{Body, BodyOptions, Layout, scan_body};
use nurbskin::scan::{Organisation, Scan};
use nurbskin::{DVec3, Error};

/// A mesh of a body with about this many vertices.
fn body(body: Body, points: usize) -> Scan {
    let options = BodyOptions {
        points: Some(points),
        layout: Layout::Mesh,
        ..BodyOptions::default()
    };
    scan_body(body, &options).unwrap().scan
}

/// A cube with sides of 2 n squares, a unit long.
fn cube(n: i32) -> Scan {
    let mut scan = Scan::default();
    let mut triangles = Vec::new();
    let at = |k: i32| f64::from(k) / f64::from(n) - 1.0;
    for (x, y, z) in [
        (DVec3::X, DVec3::Y, DVec3::Z),
        (DVec3::Y, DVec3::Z, DVec3::X),
        (DVec3::Z, DVec3::X, DVec3::Y),
    ] {
        for side in [1.0, -1.0] {
            let first = u32::try_from(scan.points.len()).unwrap();
            let count = u32::try_from(2 * n + 1).unwrap();
            for j in 0..=2 * n {
                for i in 0..=2 * n {
                    scan.points
                        .push(50.0 * (at(i) * x * side + at(j) * y + side * z));
                }
            }
            for j in 0..count - 1 {
                for i in 0..count - 1 {
                    let [a, b] = [first + j * count + i, first + (j + 1) * count + i];
                    triangles.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
                }
            }
        }
    }
    scan.organisation = Organisation::Mesh(triangles);
    scan
}

fn options(layout: FaceLayout, tolerance: f64) -> Options {
    Options {
        surfacing: SurfacingOptions {
            layout,
            tolerance: Some(Length::OfDiagonal(tolerance)),
            ..SurfacingOptions::default()
        },
        ..Options::default()
    }
}

fn checked(scan: Scan, options: &Options) -> Outcome {
    let mut outcome = fit_scan(scan, "body", options, &Silent).unwrap();
    check_fitted(&mut outcome, &Silent).unwrap();
    outcome
}

#[test]
fn a_body_with_handles_becomes_a_closed_solid() {
    let found = checked(
        body(Body::DoubleTorus, 4000),
        &options(FaceLayout::Auto, 2e-3),
    );
    let said = format!("{}; {:?}", found.reason, found.details);
    assert_eq!(found.verdict, Verdict::Pass, "{said}");
    assert_eq!(found.surface.layout, FaceLayout::Network);
    assert_eq!(found.surface.closed, Closed::Network(true));
    assert_eq!(
        (found.surface.genus, found.surface.borders),
        (Some(2), Some(0))
    );
    assert_eq!(found.model.shells().len(), 1);
    assert_eq!(found.model.shells()[0].kind, ShellKind::Solid);
    let faces = found.surface.faces.unwrap();
    assert_eq!(
        [found.model.faces().len(), found.geometry.len()],
        [faces; 2]
    );
    let counts = found.surface.edges.unwrap();
    assert_eq!(
        counts.smooth + counts.sharp + counts.border,
        found.edges.len()
    );
    assert!(found.edges.iter().all(|edge| edge.jump.is_some()));
    assert!(
        found
            .details
            .iter()
            .any(|said| said.contains("one surface cannot be")),
        "{said}"
    );
    // The bytes of an outcome keep all of it.
    let again = Outcome::from_bytes(&found.to_bytes().unwrap()).unwrap();
    assert_eq!(again, found);
}

#[test]
fn a_single_surface_with_handles_is_refused_with_the_way_out() {
    let scan = body(Body::DoubleTorus, 3000);
    let why = fit_scan(scan, "body", &options(FaceLayout::Single, 2e-3), &Silent).unwrap_err();
    let Error::Unsupported(why) = why else {
        panic!("{why}");
    };
    assert!(
        why.contains("2 handles") && why.contains("--layout network"),
        "{why}"
    );
}

#[test]
fn the_keys_of_a_network_are_those_of_the_contract() {
    let found = checked(body(Body::Tee, 3000), &options(FaceLayout::Network, 3e-3));
    let value = serde_json::to_value(&found).unwrap();
    let surface = &value["surface"];
    assert_eq!(surface["layout"], "network");
    let total = surface["control_points_total"].as_u64().unwrap();
    assert_eq!(surface["control_points"], serde_json::json!([total]));
    assert_eq!(surface["closed"], false);
    assert_eq!(surface["borders"], 3);
    assert!(surface["edges"]["border"].as_u64().unwrap() >= 6);
    let jump = |key: &str| surface["normal_jump"][key].as_f64().unwrap();
    assert!(
        jump("p95") <= jump("p99") && jump("p99") <= jump("max"),
        "{surface}"
    );
    assert!(jump("max") <= jump("bound"), "{surface}");
    assert!(
        (0.0..=jump("over_tenth")).contains(&jump("over_half")),
        "{surface}"
    );
    assert_eq!(jump("over_tenth") > 0.0, jump("max") > 0.1, "{surface}");
    assert!(
        found
            .edges
            .iter()
            .any(|edge| edge.kind == JoinKind::Open && edge.jump.is_none())
    );
    assert_eq!(found.model.shells()[0].kind, ShellKind::Open);
    assert_eq!(value["surface"]["topology"], serde_json::Value::Null);
    assert_eq!(found.verdict, Verdict::Pass, "{}", found.reason);
}

#[test]
fn a_cube_keeps_its_edges() {
    let found = checked(cube(8), &options(FaceLayout::Auto, 1e-3));
    let said = format!("{}; {:?}", found.reason, found.details);
    assert_eq!(found.verdict, Verdict::Pass, "{said}");
    assert_eq!(found.surface.layout, FaceLayout::Network, "{said}");
    assert!(found.surface.edges.unwrap().sharp >= 12, "{said}");
    assert_eq!(found.model.shells()[0].kind, ShellKind::Solid);
}

#[test]
fn a_network_does_not_depend_on_the_number_of_threads() {
    let scan = body(Body::Mug, 3000);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let options = options(FaceLayout::Network, 5e-3);
            let mut found = fit_scan(scan.clone(), "mug", &options, &Silent).unwrap();
            found.time = nurbskin::pipeline::Times::default();
            found.to_bytes().unwrap()
        })
    };
    assert!(with(1) == with(2));
}

#[test]
fn a_closed_scan_without_a_tolerance_takes_few_control_points_to_its_aim() {
    let fitted = |layout| {
        let mut wanted = options(layout, 1.0);
        wanted.surfacing.tolerance = None;
        let found = checked(body(Body::Hammer, 6000), &wanted);
        assert_eq!(found.verdict, Verdict::NotAsked, "{}", found.reason);
        found
    };
    let chosen = fitted(FaceLayout::Auto);
    let single = fitted(FaceLayout::Single);
    assert_eq!(chosen.surface.layout, FaceLayout::Network);
    let count = |found: &Outcome| -> usize { found.surface.control_points.iter().product() };
    assert!(count(&chosen) < count(&single));
    let (reached, aim) = (chosen.deviation.scan_to_surface.p95, chosen.aim.value);
    assert!(reached <= aim, "{reached}, {aim}");
}

/// What a mesh has above a height, as of a part that stood on a table; the height is a share of its own.
fn cut_below(scan: &Scan, share: f64) -> Scan {
    let heights = || scan.points.iter().map(|p| p.z);
    let (low, high) = heights().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| {
        (low.min(z), high.max(z))
    });
    let floor = low + share * (high - low);
    let mut number = vec![None; scan.points.len()];
    let mut cut = Scan::default();
    for (number, &point) in number.iter_mut().zip(&scan.points) {
        if point.z >= floor {
            *number = u32::try_from(cut.points.len()).ok();
            cut.points.push(point);
        }
    }
    let Organisation::Mesh(triangles) = &scan.organisation else {
        panic!("not a mesh");
    };
    let renumbered = triangles.iter().filter_map(|triangle| {
        let [a, b, c] = triangle.map(|k| number[k as usize]);
        Some([a?, b?, c?])
    });
    cut.organisation = Organisation::Mesh(renumbered.collect());
    cut
}

#[test]
fn an_open_mesh_that_one_surface_does_not_carry_becomes_a_network() {
    let mut wanted = options(FaceLayout::Auto, 1.0);
    wanted.surfacing.tolerance = None;
    let found = checked(cut_below(&body(Body::Drill, 6000), 0.03), &wanted);
    let said = format!("{}; {:?}", found.reason, found.details);
    assert_eq!(found.verdict, Verdict::NotAsked, "{said}");
    assert_eq!(found.surface.layout, FaceLayout::Network, "{said}");
    assert_eq!(found.surface.borders, Some(1));
    let (reached, aim) = (found.deviation.scan_to_surface.p95, found.aim.value);
    assert!(reached <= aim, "{reached}, {aim}");
    assert!(
        found
            .details
            .iter()
            .any(|said| said.contains("one surface"))
    );
}

/// A bud: a cap with ten petals, which hang by necks four squares wide and close over more than half a body that is no ball.
fn bud() -> Scan {
    let is_in = |x: f64, y: f64| {
        let petal = |k: u8| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 10.0).sin_cos();
            let (along, across) = (cos * x + sin * y, cos * y - sin * x);
            (along - 44.0).hypot(across) < 9.0
                || (along > 0.0 && along < 44.0 && across.abs() < 2.1)
        };
        x.hypot(y) < 30.0 || (0..10).any(petal)
    };
    let mut scan = Scan::default();
    let mut number = std::collections::BTreeMap::new();
    for j in -55_i32..=55 {
        for i in -55_i32..=55 {
            let (x, y) = (f64::from(i), f64::from(j));
            if is_in(x, y) {
                number.insert((i, j), u32::try_from(scan.points.len()).unwrap());
                let length = x.hypot(y).max(f64::MIN_POSITIVE);
                let (sin, cos) = (length / 26.0).sin_cos();
                let [x, y] = [x, y].map(|side| 26.0 * sin * side / length);
                scan.points
                    .push(DVec3::new(1.3 * x + 0.02 * y * y, y, 41.6 * cos));
            }
        }
    }
    let mut triangles = Vec::new();
    for &(i, j) in number.keys() {
        let corner = |di, dj| number.get(&(i + di, j + dj)).copied();
        let corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
        if let [Some(a), Some(b), Some(c), Some(d)] = corners {
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    scan.organisation = Organisation::Mesh(triangles);
    scan
}

#[test]
fn a_network_covers_what_hangs_by_necks() {
    let scan = bud();
    let count = scan.points.len();
    let mut wanted = options(FaceLayout::Auto, 1.0);
    wanted.surfacing.tolerance = None;
    let found = checked(scan, &wanted);
    let said = format!("{}; {:?}", found.reason, found.details);
    // One surface without the petals has half of the points.
    assert_eq!(found.verdict, Verdict::NotAsked, "{said}");
    assert_eq!(found.surface.layout, FaceLayout::Network, "{said}");
    assert!(found.rejected.len() * 20 < count, "{said}");
    let (reached, aim) = (found.deviation.scan_to_surface.p95, found.aim.value);
    assert!(reached <= aim, "{reached}, {aim}; {said}");
}

#[test]
fn a_cloud_with_a_tolerance_becomes_a_network_that_takes_fewer_control_points() {
    let cloud = BodyOptions {
        points: Some(6000),
        ..BodyOptions::default()
    };
    let scan = scan_body(Body::Mug, &cloud).unwrap().scan;
    let found = checked(scan, &options(FaceLayout::Auto, 3e-3));
    assert_eq!(found.verdict, Verdict::Pass, "{}", found.reason);
    // One surface, a torus, takes 4128.
    assert_eq!(found.surface.layout, FaceLayout::Network);
    let count: usize = found.surface.control_points.iter().product();
    assert!(count < 2500, "{count}");
}

/// A real scan, if it is there.
fn real(name: &str) -> Option<Scan> {
    real_scans::path(name).map(|path| nurbskin::io::read_scan(path).unwrap())
}

#[test]
fn lines_along_which_a_network_crosses_itself_are_rounded_off() {
    // Its lip is narrower than two spacings.
    let Some(scan) = real("pots/ycb_bowl_16k.stl") else {
        return;
    };
    let found = checked(scan, &options(FaceLayout::Network, 2e-3));
    let said = format!("{}; {:?}", found.reason, found.details);
    assert!(said.contains("are rounded off"), "{said}");
    assert_eq!(found.surface.edges.unwrap().sharp, 0);
    assert_eq!(found.model.shells()[0].kind, ShellKind::Solid);
    let check = found.check.as_ref().unwrap();
    assert_eq!(check.verdict, "pass", "{:?}", check.reasons);
}

#[test]
fn a_face_whose_feature_lines_are_noise_passes() {
    let Some(scan) = real("faces/fran_cut.ply") else {
        return;
    };
    let found = checked(scan, &options(FaceLayout::Network, 2e-3));
    assert_eq!(found.verdict, Verdict::Pass, "{}", found.reason);
}

#[test]
fn a_range_image_off_on_one_region_becomes_a_network() {
    let Some(scan) = real("organised/stanford_bun000.ply") else {
        return;
    };
    let found = checked(scan, &options(FaceLayout::Auto, 2e-3));
    assert_eq!(found.surface.layout, FaceLayout::Network);
    assert_eq!(found.verdict, Verdict::Pass, "{}", found.reason);
}

#[test]
fn feature_lines_that_are_noise_are_rounded_off() {
    let options_of_scan = BodyOptions {
        points: Some(6000),
        layout: Layout::Mesh,
        noise: 1.0,
        ..BodyOptions::default()
    };
    let scan = scan_body(Body::Mug, &options_of_scan).unwrap().scan;
    let found = checked(scan, &options(FaceLayout::Network, 6e-3));
    let said = format!("{}; {:?}", found.reason, found.details);
    assert!(said.contains("rounded off"), "{said}");
    // The tolerance is below the noise, so that it cannot pass; no check of the file fails.
    assert_eq!(found.verdict, Verdict::CannotTell, "{said}");
}

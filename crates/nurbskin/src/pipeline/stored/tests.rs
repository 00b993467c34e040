//! Fits of simulated scans there and back.

use crate::deviation::measure::{Place, PointDeviation, Unused};
use crate::pipeline::{Closed, Options, Outcome, SurfacingOptions, fit, fit_scan};
use glam::DVec3;
use nurbskin_cad::io::file::{CadFormat, CadWriteOptions, cad_text};
use nurbskin_cad::{ShellKind, SurfaceKind};
use nurbskin_geometry::progress::Silent;
use nurbskin_scan::simulate::{Order, Random, ScanOptions, Shape, scan};
use nurbskin_scan::{Organisation, Scan};

fn simulated(shape: Shape, points: usize, options: ScanOptions) -> Scan {
    let options = ScanOptions {
        points: Some(points),
        ..options
    };
    scan(shape, &options).unwrap().scan
}

fn noisy(noise: f64) -> ScanOptions {
    ScanOptions {
        noise,
        order: Order::Scattered,
        ..ScanOptions::default()
    }
}

fn fitted(scan: Scan, options: &Options) -> Outcome {
    fit_scan(scan, "scan", options, &Silent).unwrap()
}

fn bits(point: DVec3) -> [u64; 3] {
    point.to_array().map(f64::to_bits)
}

/// All numbers of the points, which `==` does not tell apart where they are NaN or zero.
fn point_bits(outcome: &Outcome) -> Vec<[u64; 8]> {
    let points = &outcome.per_point;
    let of = |(d, p): (&crate::deviation::measure::PointDeviation, &DVec3)| {
        let [x, y, z] = bits(*p);
        let [lower, upper, side, u, v] = [d.lower, d.upper, d.side, d.u, d.v].map(f64::to_bits);
        [lower, upper, side, u, v, x, y, z]
    };
    points
        .deviation
        .iter()
        .zip(&points.points)
        .map(of)
        .collect()
}

fn text(outcome: &Outcome, format: CadFormat) -> Vec<u8> {
    let options = CadWriteOptions {
        origin: outcome.origin,
        ..CadWriteOptions::default()
    };
    cad_text(&outcome.model, format, &options).unwrap()
}

fn there_and_back(outcome: &Outcome) -> Outcome {
    let bytes = outcome.to_bytes().unwrap();
    let read = Outcome::from_bytes(&bytes).unwrap();
    assert_eq!(read.to_bytes().unwrap(), bytes);
    let json = |o: &Outcome| serde_json::to_string_pretty(o).unwrap();
    assert_eq!(json(&read), json(outcome));
    assert_eq!(point_bits(&read), point_bits(outcome));
    assert_eq!(read.model, outcome.model);
    assert_eq!(read.geometry, outcome.geometry);
    assert_eq!(bits(read.origin), bits(outcome.origin));
    for format in [CadFormat::Step, CadFormat::Iges] {
        assert_eq!(text(&read, format), text(outcome, format));
    }
    read
}

#[test]
fn a_noisy_face_comes_back() {
    let mut options = noisy(0.1);
    options.outliers = 0.01;
    let mut scan = simulated(Shape::Face, 3000, options);
    scan.origin = DVec3::new(4e5, 0.1, -5e6);
    let held = Options {
        surfacing: SurfacingOptions {
            hold_out: 0.1,
            ..SurfacingOptions::default()
        },
        ..Options::default()
    };
    let outcome = fitted(scan, &held);
    assert!(!outcome.rejected.is_empty() && outcome.deviation.hold_out.is_some());
    assert!(outcome.per_point.held_out.contains(&true));
    assert!(
        outcome
            .per_point
            .unused
            .iter()
            .any(|p| p.deviation.is_some())
    );
    assert_eq!(there_and_back(&outcome), outcome);
}

#[test]
fn a_turned_pot_comes_back() {
    let outcome = fitted(
        simulated(Shape::Pot, 4000, noisy(0.02)),
        &Options::default(),
    );
    assert!(outcome.surface.rational);
    assert_eq!(outcome.surface.closed, Closed::Directions([false, true]));
    assert_eq!(there_and_back(&outcome), outcome);
}

#[test]
fn an_interpolated_grid_comes_back() {
    let scan = simulated(Shape::Handle, 900, ScanOptions::default());
    let outcome = fitted(scan, &Options::default());
    assert!(outcome.input.grid.is_some() && outcome.surface.parameters.is_some());
    assert_eq!(there_and_back(&outcome), outcome);
}

#[test]
fn a_trimmed_saddle_comes_back() {
    let mut options = noisy(0.02);
    options.holes = 2;
    let outcome = fitted(simulated(Shape::Saddle, 6000, options), &Options::default());
    assert!(outcome.surface.trimmed);
    assert!(outcome.model.faces()[0].trimmed);
    assert_eq!(there_and_back(&outcome), outcome);
}

#[test]
fn a_solid_comes_back() {
    let outcome = fitted(
        simulated(Shape::Ellipsoid, 4000, noisy(0.0)),
        &Options::default(),
    );
    assert_eq!(outcome.model.shells()[0].kind, ShellKind::Solid);
    assert_eq!(outcome.model.faces()[0].kind, SurfaceKind::BSpline);
    assert_eq!(there_and_back(&outcome), outcome);
}

#[test]
fn two_parts_come_back() {
    let mut scan = simulated(Shape::Patch, 1500, noisy(0.0));
    let beside: Vec<DVec3> = scan.points.iter().map(|p| p + DVec3::X * 1e3).collect();
    scan.points.extend(&beside[..1400]);
    scan.organisation = Organisation::Unordered;
    let outcome = fitted(scan, &Options::default());
    assert_eq!((outcome.parts.len(), outcome.geometry.len()), (2, 2));
    assert_eq!(there_and_back(&outcome), outcome);
}

/// With files written, checked, and their paths.
#[test]
fn outputs_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let [path, out] = ["scan.xyz", "ünï.step"].map(|name| folder.path().join(name));
    let points = simulated(Shape::Patch, 1500, noisy(0.0)).points;
    let lines = points.iter().map(|p| format!("{} {} {}\n", p.x, p.y, p.z));
    std::fs::write(&path, lines.collect::<String>()).unwrap();
    let outcome = fit(
        &path,
        std::slice::from_ref(&out),
        &Options::default(),
        &Silent,
    )
    .unwrap();
    assert_eq!(outcome.outputs[0].path, out);
    assert!(outcome.check.as_ref().unwrap().said.contains("checks"));
    assert_eq!(there_and_back(&outcome), outcome);
}

fn small() -> Outcome {
    let options = noisy(0.01);
    fitted(simulated(Shape::Patch, 300, options), &Options::default())
}

#[test]
fn numbers_that_are_none_come_back() {
    let mut outcome = small();
    let odd = f64::from_bits(f64::NAN.to_bits() | 1 << 63 | 4711);
    outcome.time.read = odd;
    outcome.origin.y = odd;
    outcome.tolerance = Some(f64::INFINITY);
    outcome.deviation.free_edges.signed_min = f64::NEG_INFINITY;
    outcome.per_point.deviation[7].u = odd;
    outcome.per_point.deviation[7].place = Place::FreeEdge;
    outcome.per_point.deviation[8].place = Place::Interior;
    outcome.per_point.deviation[8].lower = f64::NEG_INFINITY;
    outcome.per_point.points[9].z = -0.0;
    outcome.rejected.push((3, DVec3::new(1.0, odd, -0.0)));
    let bytes = outcome.to_bytes().unwrap();
    let read = Outcome::from_bytes(&bytes).unwrap();
    assert_eq!(read.to_bytes().unwrap(), bytes);
    assert_eq!(point_bits(&read), point_bits(&outcome));
    assert_eq!(bits(read.origin), bits(outcome.origin));
    let places = [7, 8].map(|k: usize| read.per_point.deviation[k].place);
    assert_eq!(places, [Place::FreeEdge, Place::Interior]);
    assert_eq!(read.time.read.to_bits(), odd.to_bits());
    let rejected = |o: &Outcome| o.rejected.iter().map(|r| bits(r.1)).collect::<Vec<_>>();
    assert_eq!(rejected(&read), rejected(&outcome));
}

#[test]
fn what_does_not_go_together_is_refused() {
    let breaks: [fn(&mut Outcome); 8] = [
        |o| o.geometry.clear(),
        |o| o.per_point.points.truncate(5),
        |o| o.per_point.indices.push(0),
        |o| o.per_point.held_out = vec![true],
        |o| {
            // Private fields, but stored as a pair: a record that the file does not have.
            let wrong = serde_json::json!({ "of_points": [0, 7], "total": 3 });
            o.per_point.records = serde_json::from_value(wrong).unwrap();
        },
        |o| o.per_point.triangles = vec![[0, 1, 300]],
        |o| o.per_point.deviation[0].face = 1,
        |o| {
            o.per_point.unused.push(Unused {
                index: 1,
                point: DVec3::ZERO,
                reason: nurbskin_scan::Reason::Outlier,
                deviation: Some(PointDeviation {
                    face: 1,
                    ..o.per_point.deviation[0]
                }),
            });
        },
    ];
    for (k, change) in breaks.into_iter().enumerate() {
        let mut outcome = small();
        change(&mut outcome);
        let bytes = outcome.to_bytes().unwrap();
        let said = Outcome::from_bytes(&bytes).unwrap_err().to_string();
        assert!(said.contains("different lengths"), "{k}: {said}");
    }
    let scan = simulated(Shape::Patch, 300, ScanOptions::default());
    let said = Outcome::from_bytes(&scan.to_bytes().unwrap()).unwrap_err();
    assert_eq!(said.to_string(), "the bytes are not a stored outcome");
}

/// An error, or an outcome that can be stored and written: never a panic.
#[test]
fn damaged_bytes_do_no_harm() {
    let bytes = small().to_bytes().unwrap();
    let mut random = Random::new(5);
    for _ in 0..200 {
        let end = random.index(bytes.len());
        assert!(Outcome::from_bytes(&bytes[..end]).is_err(), "cut at {end}");
    }
    // Where the points, of which there are most, hold any number, little can go wrong.
    let model = bytes.windows(5).position(|w| w == b"model").unwrap();
    let mut read = 0;
    for k in 0..600 {
        let mut changed = bytes.clone();
        for _ in 0..=k % 3 {
            let start = if k % 2 == 0 { model } else { 0 };
            let at = start + random.index(bytes.len() - start);
            changed[at] ^= 1 << random.index(8);
        }
        let Ok(outcome) = Outcome::from_bytes(&changed) else {
            continue;
        };
        read += 1;
        let again = outcome.to_bytes().unwrap();
        let again = Outcome::from_bytes(&again).unwrap();
        assert_eq!(point_bits(&again), point_bits(&outcome));
        assert_eq!(again.model, outcome.model);
        let options = CadWriteOptions::default();
        drop(cad_text(&outcome.model, CadFormat::Step, &options));
        let mut csv = Vec::new();
        outcome
            .per_point
            .write_csv(outcome.origin, &mut csv)
            .unwrap();
    }
    assert!(read > 50 && read < 550, "{read} of 600 read");
}

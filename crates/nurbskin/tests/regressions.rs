//! Every bug, by name.

use nurbskin::cad::trim::{Scanned, trimming};
use nurbskin::cad::{Model, mass};
use nurbskin::chart::Topology;
use nurbskin::io::cad::{CadFile, CadFormat, CadWriteOptions, cad_text, read_cad_bytes};
use nurbskin::io::iges;
use nurbskin::nurbs::conic;
use nurbskin::pipeline::{Options, SurfacingOptions, check, fit_scan, info};
use nurbskin::progress::Silent;
use nurbskin::scan::simulate::{self, Random, ScanOptions, Shape};
use nurbskin::scan::{GridLayout, Organisation, Scan};
use nurbskin::{ControlNet, DVec3, Error, KnotVector, NurbsSurface, Unit};
use std::io::Write;
use std::path::Path;

/// An array of points on a gently bent sheet.
fn sheet(m: u32, n: u32) -> Scan {
    let point = |k: u32| {
        let (x, y) = (f64::from(k % m), f64::from(k / m));
        DVec3::new(x, y, 0.01 * (x * x - x * y))
    };
    Scan {
        points: (0..m * n).map(point).collect(),
        organisation: Organisation::Grid(
            GridLayout::complete(m as usize, n as usize).expect("small"),
        ),
        ..Scan::default()
    }
}

#[test]
fn a_grid_on_a_line_is_refused() {
    let mut scan = sheet(10, 10);
    for (k, point) in scan.points.iter_mut().enumerate() {
        *point = DVec3::new(1.0, 2.0, 3.0) * k as f64;
    }
    let refused = fit_scan(scan, "line", &Options::default(), &Silent);
    assert!(matches!(refused, Err(Error::Invalid(what)) if what.contains("one line")));
}

#[test]
fn a_point_missing_in_a_grid_does_not_shift_its_row() {
    let mut scan = sheet(20, 20);
    scan.points[210] = DVec3::NAN;
    let found = fit_scan(scan, "holed", &Options::default(), &Silent).unwrap();
    assert_eq!(found.input.rejected.non_finite, 1);
    assert_eq!(found.input.grid, Some([20, 20]));
    assert!(found.deviation.scan_to_surface.max <= found.aim.value);
}

#[test]
fn holding_points_out_does_not_tear_a_grid_apart() {
    let options = Options {
        surfacing: SurfacingOptions {
            hold_out: 0.25,
            ..SurfacingOptions::default()
        },
        ..Options::default()
    };
    let found = fit_scan(sheet(20, 20), "sheet", &options, &Silent).unwrap();
    let hold_out = found.deviation.hold_out.expect("some were held out");
    assert!((80..=100).contains(&hold_out.count) && hold_out.max <= found.aim.value);
}

#[test]
fn the_budget_of_control_points_is_never_exceeded() {
    for budget in [4, 9, 16, 25, 60] {
        let options = Options {
            surfacing: SurfacingOptions {
                max_control_points: Some(budget),
                ..SurfacingOptions::default()
            },
            ..Options::default()
        };
        let scan = ScanOptions {
            points: Some(900),
            ..ScanOptions::default()
        };
        let scan = simulate::scan(Shape::Torus, &scan).unwrap().scan;
        match fit_scan(scan, "torus", &options, &Silent) {
            Ok(found) => {
                let [m, n] = found.surface.control_points[..] else {
                    panic!()
                };
                assert!(m * n <= budget, "{m} x {n} for {budget}");
            }
            Err(error) => assert!(error.to_string().contains("budget"), "{error}"),
        }
    }
}

#[test]
fn an_unsupported_area_of_nothing_is_not_negative() {
    let found = fit_scan(sheet(12, 12), "sheet", &Options::default(), &Silent).unwrap();
    assert!(
        found
            .deviation
            .surface_to_scan
            .unsupported_area
            .is_sign_positive()
    );
}

#[test]
fn spans_halved_around_one_row_do_not_flatten_the_surface() {
    let options = ScanOptions {
        noise: 0.05,
        ..ScanOptions::default()
    };
    let scan = simulate::scan(Shape::Face, &options).unwrap().scan;
    let found = fit_scan(scan, "face", &Options::default(), &Silent).unwrap();
    let rms = found.deviation.scan_to_surface.rms;
    assert!(rms < 0.1, "{rms}");
}

/// The text of a model as STEP, with this in place of that, read again.
fn step_with(model: &Model, from: &str, to: &str) -> CadFile {
    let text = cad_text(model, CadFormat::Step, &CadWriteOptions::default()).unwrap();
    let text = String::from_utf8(text).unwrap();
    assert!(text.contains(from));
    read_cad_bytes(text.replace(from, to).as_bytes(), Path::new("a.step")).unwrap()
}

/// A gently bent surface over [0, 1] x [0, 1], 7 by 6 long, all of it a face.
fn bent(weights: Option<Vec<f64>>) -> (NurbsSurface, Model) {
    let net = ControlNet::from_fn(6, 5, |i, j| {
        let (x, y) = (7.0 * i as f64 / 5.0, 6.0 * j as f64 / 4.0);
        DVec3::new(x, y, 0.1 * x * y)
    });
    let knots = |n| KnotVector::uniform(3, n).unwrap();
    let surface = NurbsSurface::new(knots(6), knots(5), net.unwrap(), weights).unwrap();
    let mut model = Model::new("bent");
    model.add_whole_surface(&surface, 1e-9).unwrap();
    (surface, model)
}

/// The nearest border was taken for the surface beyond it.
#[test]
fn p_curves_beyond_the_surface_are_computed_anew() {
    let (_, model) = bent(None);
    let area = mass(&model).unwrap().area;
    let file = step_with(&model, "('',(0.,0.))", "('',(0.,-0.7))");
    assert!(
        file.warnings[0].contains("computed again"),
        "{:?}",
        file.warnings
    );
    let found = mass(&file.model).unwrap().area;
    assert!((found / area - 1.0).abs() < 1e-9, "{found} of {area}");
    // A period away, on a surface that closes, they are as good as any.
    let tube = conic::cylinder(DVec3::ZERO, 5.0 * DVec3::Z, 2.0).unwrap();
    let mut model = Model::new("tube");
    model.add_whole_surface(&tube, 1e-9).unwrap();
    let text = cad_text(&model, CadFormat::Step, &CadWriteOptions::default()).unwrap();
    let file = read_cad_bytes(&text, Path::new("a.step")).unwrap();
    assert!(file.warnings.is_empty(), "{:?}", file.warnings);
}

/// Weights that are all the same were dropped by the writer, and kept by the reader.
#[test]
fn equal_weights_of_step_are_none() {
    let mut weights = vec![1.0; 30];
    weights[17] = 0.375;
    let (_, model) = bent(Some(weights));
    assert!(model.faces()[0].surface.is_rational());
    let file = step_with(&model, "0.375", "1.");
    assert!(!file.model.faces()[0].surface.is_rational());
}

/// Edges are 1e-7 of the diagonal off their surface at most; a power of ten below that was written.
#[test]
fn uncertainty_and_resolution_are_no_smaller_than_the_gaps() {
    let (surface, _) = bent(None);
    let place = |k: u32, n: u32| f64::from(k) / f64::from(n);
    let all = (0..=3600).map(|k| surface.point(place(k % 61, 60), place(k / 61, 60)));
    let points: Vec<DVec3> = all
        .filter(|p| (*p - DVec3::new(3.0, 3.0, p.z)).length() > 1.7)
        .collect();
    let scan = Scanned {
        points: &points,
        triangles: None,
        is_mesh: false,
        spacing: 0.12,
        feet: None,
        stays_closed: true,
    };
    let cut = trimming(&surface, &scan).unwrap();
    assert!(cut.is_cut());
    let mut model = Model::new("cut");
    let [low, high] = surface.bounding_box();
    let size = low.distance(high);
    model
        .add_trimmed_surface(&cut, 1e-9 * size, 1e-7 * size)
        .unwrap();
    let mut gap = 0.0_f64;
    let face = &model.faces()[0];
    for used in face.loops.iter().flat_map(|l| &l.uses) {
        let Some(curve) = &model.edges()[used.edge].curve else {
            continue;
        };
        for span in curve.knots().breakpoints().windows(2) {
            for k in 0..=50 {
                let t = span[0] + (span[1] - span[0]) * place(k, 50);
                let p = used.pcurve.point(t);
                gap = gap.max(face.surface.point(p.x, p.y).distance(curve.point(t)));
            }
        }
    }
    assert!(gap > 1e-8 * size, "{gap}: nothing to see");
    let options = CadWriteOptions::default();
    let [step, iges] = [CadFormat::Step, CadFormat::Iges]
        .map(|format| cad_text(&model, format, &options).unwrap());
    let step = String::from_utf8(step).unwrap();
    let after = step
        .split("UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(")
        .nth(1)
        .unwrap();
    let uncertainty: f64 = after.split(')').next().unwrap().parse().unwrap();
    let resolution = iges::read(&iges, "a.igs").unwrap().global.resolution;
    for value in [uncertainty, resolution] {
        assert!(value >= gap && value <= 4e-7 * size, "{value} for {gap}");
    }
}

/// CAD files are known by their content, and what is none is named.
#[test]
fn cad_files_are_told_by_their_content() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (_, model) = bent(None);
    let text = cad_text(&model, CadFormat::Step, &CadWriteOptions::default()).unwrap();
    let mut gz = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    gz.write_all(&text).unwrap();
    for (name, bytes) in [
        ("a.stl", text.clone()),
        ("a.p21", text.clone()),
        ("a.step.gz", gz.finish().unwrap()),
    ] {
        std::fs::write(path(name), bytes).unwrap();
        let found = info(&path(name), &Silent).unwrap();
        assert_eq!(found.format, "step", "{name}");
    }
    let wide: Vec<u8> = text.iter().flat_map(|&b| [b, 0]).collect();
    let scan = b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n";
    for (name, bytes, says) in [
        (
            "scan.ply",
            scan.as_slice(),
            "this is a scan (PLY), not a CAD file",
        ),
        ("scan.step", scan, "this is a scan (PLY), not a CAD file"),
        ("wide.step", &wide, "UTF-16"),
        ("data.igs", &[7, 0, 3, 0, 9], "neither IGES nor STEP"),
    ] {
        std::fs::write(path(name), bytes).unwrap();
        let said = check(&path(name), &Silent).unwrap_err().to_string();
        assert!(said.contains(says), "{name}: {said}");
    }
}

/// One digit of an exponent made an area of infinity, without a word.
#[test]
fn coordinates_that_overflow_are_told() {
    let (_, model) = bent(None);
    let file = step_with(&model, "(7.,6.,4.2)", "(7.,6.,4.2E120)");
    let said = file.warnings.join("; ");
    assert!(said.contains("is not plausible"), "{said}");
}

/// Without a word, millimetres were assumed; a thousandth of an inch was printed as 0.025400000000000002 mm.
#[test]
fn units_of_step_are_told() {
    let (_, model) = bent(None);
    let warnings = |from: &str, to: &str| step_with(&model, from, to).warnings.join("; ");
    let said = warnings("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT(.MILLI.,.GRAM.)");
    assert!(said.contains("does not say its unit"), "{said}");
    let mut inches = model.clone();
    inches.unit = Unit::Inch;
    let file = step_with(&inches, "LENGTH_MEASURE(25.4)", "LENGTH_MEASURE(0.0254)");
    assert_eq!(
        file.warnings,
        ["the file has a unit of its own (0.0254 mm): lengths were converted to mm"]
    );
}

/// Distances along the normals of a flat array are zero whatever its lines are: rarefaction aimed lower without end.
#[test]
fn arrays_in_a_plane_or_on_a_line_are_rarefied() {
    use nurbskin::PointGrid;
    use nurbskin::fit::rarefied::{Options, rarefy_to_tolerance};
    let place = |i: usize, j: usize, step: f64| ((7 * i + 5 * j) as f64 * step).fract();
    for (m, n, wide) in [(3, 9, 0.0), (2, 5, 1.0), (6, 7, 1.0)] {
        let point = |i, j| DVec3::new(place(i, j, 0.618), wide * place(i, j, 0.7548), 0.0);
        let grid = PointGrid::from_fn(m, n, point).unwrap();
        for topology in [Topology::Disk, Topology::Tube] {
            let options = Options::default();
            let found = rarefy_to_tolerance(&grid, topology, 1e-3, &options, &Silent).unwrap();
            assert!(found.met && found.max_distance <= 1e-3);
        }
    }
}

/// A strip of it had no place of its own on the plane that the rest of it has: the surface ended before it.
#[test]
fn a_cloud_of_a_sheet_with_a_curled_border() {
    let mut random = Random::new(5);
    let (flat, radius, turn, width, noise) = (130.0, 12.0, 2.2, 80.0, 0.02);
    let points = (0..12_000).map(|_| {
        let along = random.uniform() * (flat + radius * turn);
        let y = width * random.uniform();
        let angle = ((along - flat) / radius).max(0.0);
        let x = along.min(flat) + radius * angle.sin();
        let z = radius * (1.0 - angle.cos());
        let [a, b, c] = [(); 3].map(|()| noise * random.normal());
        DVec3::new(x + a, y + b, z + c)
    });
    let scan = Scan {
        points: points.collect(),
        ..Scan::default()
    };
    let found = fit_scan(scan, "sheet", &Options::default(), &Silent).unwrap();
    assert_eq!(found.surface.topology, Some(Topology::Disk));
    let points = &found.deviation.scan_to_surface;
    assert!(points.p95 < 3.0 * noise, "{}", points.p95);
}

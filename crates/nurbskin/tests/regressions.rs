//! Every bug, by name.

use nurbskin::pipeline::{Options, fit_scan};
use nurbskin::progress::Silent;
use nurbskin::scan::simulate::{self, ScanOptions, Shape};
use nurbskin::scan::{GridLayout, Organisation, Scan};
use nurbskin::{DVec3, Error};

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
    assert!(found.deviation.scan_to_surface.max <= found.tolerance);
}

#[test]
fn holding_points_out_does_not_tear_a_grid_apart() {
    let options = Options {
        hold_out: 0.25,
        ..Options::default()
    };
    let found = fit_scan(sheet(20, 20), "sheet", &options, &Silent).unwrap();
    let hold_out = found.deviation.hold_out.expect("some were held out");
    assert!((80..=100).contains(&hold_out.count) && hold_out.max <= found.tolerance);
}

#[test]
fn the_budget_of_control_points_is_never_exceeded() {
    for budget in [4, 9, 16, 25, 60] {
        let options = Options {
            max_control_points: Some(budget),
            ..Options::default()
        };
        let scan = ScanOptions {
            points: Some(900),
            ..ScanOptions::default()
        };
        let scan = simulate::scan(Shape::Torus, &scan).unwrap().scan;
        match fit_scan(scan, "torus", &options, &Silent) {
            Ok(found) => {
                let [m, n] = found.surface.control_points;
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

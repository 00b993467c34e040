//! Real scans, read from the folder named by `NURBSKIN_DATA`; skipped with a reason where it is not set.

use nurbskin::pipeline::{Options, fit};
use nurbskin::progress::Silent;
use std::path::Path;

/// Fits a scan as the command does without flags, and returns p95 both ways in parts of the scan's diagonal, the share of
/// the area without data, and the number of control points.
fn measured(data: &Path, name: &str) -> [f64; 4] {
    let outcome = fit(&data.join(name), &[], &Options::default(), &Silent).unwrap();
    let points = &outcome.per_point.points;
    let lo = points.iter().copied().reduce(|a, b| a.min(b)).unwrap();
    let hi = points.iter().copied().reduce(|a, b| a.max(b)).unwrap();
    let [m, n] = outcome.surface.control_points;
    let back = &outcome.deviation.surface_to_scan;
    [
        outcome.deviation.scan_to_surface.p95 / lo.distance(hi),
        back.p95 / lo.distance(hi),
        back.unsupported_area,
        (m * n) as f64,
    ]
}

#[test]
fn faces_are_within_three_thousandths_of_their_diagonal() {
    let Some(data) = std::env::var_os("NURBSKIN_DATA") else {
        println!("skipped: NURBSKIN_DATA does not name a folder of real scans");
        return;
    };
    for name in ["faces/fran_cut.ply", "faces/rvcg_humface.ply"] {
        let [to_surface, to_scan, unsupported, count] = measured(Path::new(&data), name);
        println!("{name}: {to_surface:.2e} {to_scan:.2e} {unsupported:.3} {count}");
        assert!(
            to_surface <= 3e-3 && to_scan <= 3e-3,
            "{name}: {to_surface:.2e}, {to_scan:.2e}"
        );
        assert!(
            unsupported <= 0.02 && count <= 1600.0,
            "{name}: {unsupported}, {count}"
        );
    }
}

//! Any points, fitted: a surface with finite control points, or an error.
#![no_main]

use nurbskin::DVec3;
use nurbskin::pipeline::{Options, SurfacingOptions, fit_scan};
use nurbskin::progress::Silent;
use nurbskin::scan::Scan;

/// More points than this make a run slow and find nothing new.
const MOST_POINTS: usize = 400;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    // Three bytes each: small whole numbers bring many equal, collinear and coplanar points.
    let at = |xyz: &[u8]| DVec3::new(f64::from(xyz[0]), f64::from(xyz[1]), f64::from(xyz[2]) / 8.0);
    let points: Vec<DVec3> = bytes.chunks_exact(3).take(MOST_POINTS).map(at).collect();
    let options = Options {
        surfacing: SurfacingOptions {
            max_control_points: Some(60),
            ..SurfacingOptions::default()
        },
        ..Options::default()
    };
    let scan = Scan {
        points,
        ..Scan::default()
    };
    if let Ok(outcome) = fit_scan(scan, "fuzz", &options, &Silent) {
        for surface in &outcome.geometry {
            assert!(surface.control_points().points().iter().all(|p| p.is_finite()));
        }
    }
});

//! What interpolation makes of a noisy scan, and what least squares makes of it.

use super::{Outcome, table};
use nurbskin::nurbs::closest::ClosestPoint;
use nurbskin::pipeline::{Method, Options, Rarefaction, SurfacingOptions, fit_scan};
use nurbskin::progress::Silent;
use nurbskin::scan::simulate::{ScanOptions, Shape, Simulated, scan};
use std::time::Instant;

/// Standard deviation of the noise, in millimetres.
const SIGMA: f64 = 0.05;
/// The surface is looked at in so many places along u and along v.
const PLACES: usize = 120;

/// Fits the noisy pot in several ways and measures each surface against the true shape.
pub(crate) fn print() -> Outcome<()> {
    let options = ScanOptions {
        noise: SIGMA,
        ..ScanOptions::default()
    };
    let pot = scan(Shape::Pot, &options)?;
    let through = |counts| (Method::Interpolate, Rarefaction::Counts(counts));
    let ways = [
        ("through 18 x 18 points", through([18, 18])),
        ("through 48 x 48 points", through([48, 48])),
        (
            "through all points",
            (Method::Interpolate, Rarefaction::Off),
        ),
        (
            "least squares",
            (Method::Approximate, Rarefaction::default()),
        ),
    ];
    let rows = ways
        .iter()
        .map(|&(name, way)| row(name, way, &pot))
        .collect::<Outcome<Vec<_>>>()?;
    table::print(
        &format!(
            "In noise: the pot scanned with a standard deviation of {SIGMA} mm, against the true shape"
        ),
        &[
            "surface",
            "control points",
            "at scan, max, mm",
            "at truth, max, mm",
            "at truth, rms, mm",
            "time, s",
        ],
        &rows,
    );
    Ok(())
}

fn row(
    name: &str,
    (method, rarefy): (Method, Rarefaction),
    pot: &Simulated,
) -> Outcome<Vec<String>> {
    let options = Options {
        surfacing: SurfacingOptions {
            method,
            rarefy,
            ..SurfacingOptions::default()
        },
        ..Options::default()
    };
    let start = Instant::now();
    let outcome = fit_scan(pot.scan.clone(), "pot", &options, &Silent)?;
    let seconds = start.elapsed().as_secs_f64();
    let surface = outcome.geometry[0].map_points(|p| p + outcome.origin)?;
    let feet = ClosestPoint::new(&surface)?.closest_all(&pot.scan.points, None);
    let at_scan = feet.iter().map(|foot| foot.distance).fold(0.0, f64::max);

    let [(a, b), (c, d)] = surface.domain();
    let step = |k: usize| (k as f64 + 0.5) / PLACES as f64;
    let error = |k: usize| {
        let (u, v) = (
            a + (b - a) * step(k % PLACES),
            c + (d - c) * step(k / PLACES),
        );
        pot.truth.distance(surface.point(u, v))
    };
    let errors: Vec<f64> = (0..PLACES * PLACES).map(error).collect();
    let squares: f64 = errors.iter().map(|e| e * e).sum();
    let [m, n] = outcome.surface.control_points[..] else {
        unreachable!("an ordered scan has one surface")
    };
    Ok(vec![
        name.into(),
        format!("{m} x {n} = {}", m * n),
        format!("{at_scan:.3}"),
        format!("{:.3}", errors.iter().copied().fold(0.0, f64::max)),
        format!("{:.4}", (squares / errors.len() as f64).sqrt()),
        format!("{seconds:.2}"),
    ])
}

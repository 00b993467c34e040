//! How long does an approximation of scattered points take?
#![expect(clippy::unwrap_used, reason = "a bench may stop")]

use criterion::{Criterion, criterion_group, criterion_main};
use nurbskin::chart::{Chart, Topology};
use nurbskin::fit::approximate::{ApproximateOptions, approximate};
use nurbskin::progress::Silent;
use nurbskin::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// A wavy sheet of 100 x 100 with noise of 0.05, at places of a low-discrepancy sequence.
fn sheet(n: usize) -> (Vec<DVec3>, Chart) {
    let parameters: Vec<DVec2> = (1..=n)
        .map(|k| {
            DVec2::new(
                k as f64 * 0.754_877_666_246_693,
                k as f64 * 0.569_840_290_998_053,
            )
        })
        .map(|t| t - t.floor())
        .collect();
    let points = parameters
        .iter()
        .enumerate()
        .map(|(k, t)| {
            let wobble = (k as f64 * 12.9898).sin() * 43758.5453;
            let noise = 0.17 * (wobble - wobble.floor() - 0.5);
            let (x, y) = (100.0 * t.x, 100.0 * t.y);
            DVec3::new(x, y, 8.0 * (x / 9.0).sin() * (y / 12.0).cos() + noise)
        })
        .collect();
    let chart = Chart {
        topology: Topology::Disk,
        parameters,
        size: [100.0, 100.0],
        reason: String::new(),
    };
    (points, chart)
}

/// A height field over a disk of radius 50 with noise of 0.05, in no order of its places.
fn bump(n: usize) -> (Vec<DVec3>, Chart) {
    let part = |x: f64| x - x.floor();
    let points: Vec<DVec3> = (1..=n)
        .map(|k| {
            let k = k as f64;
            let (r, a) = (
                50.0 * part(k * 0.754_877_666_246_693).sqrt(),
                TAU * part(k * 0.569_840_290_998_053),
            );
            let (x, y) = (r * a.cos(), r * a.sin());
            let normal = (-2.0 * part((k * 12.9898).sin() * 43758.5453).max(1e-12).ln()).sqrt()
                * (TAU * part((k * 78.233).sin() * 24634.6345)).cos();
            let z = 20.0 * (PI * r / 120.0).cos()
                + 3.0 * (TAU * x / 40.0).sin() * (TAU * y / 35.0).cos();
            DVec3::new(x, y, z + 0.05 * normal)
        })
        .collect();
    let parameters = points.iter().map(|p| p.truncate() / 100.0 + 0.5);
    let chart = Chart {
        topology: Topology::Disk,
        parameters: parameters.collect(),
        size: [100.0, 100.0],
        reason: String::new(),
    };
    (points, chart)
}

fn benches(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("approximate");
    group.sample_size(10);
    let (points, chart) = sheet(20_000);
    group.bench_function("20k points to tolerance", |b| {
        b.iter(|| approximate(&points, &chart, &ApproximateOptions::new(0.15), &Silent).unwrap());
    });
    // On such points scipy's LSQBivariateSpline with the same knots takes 0.23, 1.9 and 20 s on a core.
    for (n, name) in [
        (10_000, "10k points, 24 x 24 control points"),
        (100_000, "100k points, 24 x 24 control points"),
        (1_000_000, "1M points, 24 x 24 control points"),
    ] {
        let (points, chart) = bump(n);
        let once = ApproximateOptions {
            refine: false,
            spans: Some([21, 21]),
            ..ApproximateOptions::new(0.15)
        };
        group.bench_function(name, |b| {
            b.iter(|| approximate(&points, &chart, &once, &Silent).unwrap());
        });
    }
    group.finish();
}

criterion_group!(all, benches);
criterion_main!(all);

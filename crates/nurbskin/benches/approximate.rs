//! How long does an approximation of scattered points take?
#![expect(clippy::unwrap_used, reason = "a bench may stop")]

use criterion::{Criterion, criterion_group, criterion_main};
use nurbskin::chart::{Chart, Topology};
use nurbskin::fit::approximate::{ApproximateOptions, approximate};
use nurbskin::progress::Silent;
use nurbskin::{DVec2, DVec3};

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

fn benches(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("approximate");
    group.sample_size(10);
    let (points, chart) = sheet(20_000);
    group.bench_function("20k points to tolerance", |b| {
        b.iter(|| approximate(&points, &chart, &ApproximateOptions::new(0.15), &Silent).unwrap());
    });
    let (points, chart) = sheet(1_000_000);
    let once = ApproximateOptions {
        refine: false,
        spans: Some([21, 21]),
        noise: Some(0.05),
        ..ApproximateOptions::new(0.15)
    };
    group.bench_function(
        "1M points, 24 x 24 control points, four fits with weights",
        |b| {
            b.iter(|| approximate(&points, &chart, &once, &Silent).unwrap());
        },
    );
    group.finish();
}

criterion_group!(all, benches);
criterion_main!(all);

//! How long does interpolation at given parameters take, by size of the grid? (`compare/run.py grid` adds
//! the large sizes, the growth exponent, the memory and the peers.)

#![expect(clippy::unwrap_used, reason = "a benchmark may stop")]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nurbskin::chart::Topology;
use nurbskin::fit::interpolate::interpolate_at;
use nurbskin::fit::interpolate::parameters::{Parameterization, parameters_u, parameters_v};
use nurbskin::{DVec3, PointGrid};
use std::hint::black_box;

fn interpolation(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("interpolate_at");
    group.sample_size(20);
    for (m, n) in [
        (18, 18),
        (29, 13),
        (25, 32),
        (100, 100),
        (300, 300),
        (1000, 1000),
    ] {
        let grid = PointGrid::from_fn(m, n, |i, j| {
            let (s, t) = (i as f64 / (m - 1) as f64, j as f64 / (n - 1) as f64);
            DVec3::new(
                s + 0.03 * (6.0 * s).sin(),
                t,
                (9.0 * s).sin() * (7.0 * t).cos(),
            )
        })
        .unwrap();
        let u = parameters_u(&grid, false, Parameterization::ChordLength).unwrap();
        let v = parameters_v(&grid, false, Parameterization::ChordLength).unwrap();
        group.throughput(Throughput::Elements((m * n) as u64));
        group.bench_function(BenchmarkId::from_parameter(format!("{m}x{n}")), |b| {
            b.iter(|| interpolate_at(black_box(&grid), Topology::Disk, [3, 3], [&u, &v]).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, interpolation);
criterion_main!(benches);

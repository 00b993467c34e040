//! How long does cleaning a scan of 100 thousand to 10 million points take, and how good is the noise found?
//!
//! Arguments: numbers of points (default 100000 1000000). Seconds are those of the clock, the least of three runs (of
//! one from 10 million points on), with one thread and with all; peak memory is that of the whole process so far.
#![expect(clippy::print_stdout, reason = "a benchmark reports")]
#![expect(clippy::unwrap_used, reason = "the scans are valid")]

use nurbskin::DVec3;
use nurbskin::progress::Silent;
use nurbskin::scan::simulate::{Order, Random, ScanOptions, Shape, scan};
use nurbskin::scan::{CleanOptions, Scan, clean};
use std::f64::consts::{PI, TAU};
use std::time::Instant;

/// A wavy height field over a disc of radius 50, with noise in all three coordinates.
fn bump(count: usize, sigma: f64) -> Vec<DVec3> {
    let mut random = Random::new(3);
    let mut point = || {
        let (radius, angle) = (50.0 * random.uniform().sqrt(), TAU * random.uniform());
        let (x, y) = (radius * angle.cos(), radius * angle.sin());
        let wave = (TAU * x / 40.0).sin() * (TAU * y / 35.0).cos();
        let z = 20.0 * (PI * radius / 120.0).cos() + 3.0 * wave;
        let noise = DVec3::new(random.normal(), random.normal(), random.normal());
        DVec3::new(x, y, z) + sigma * noise
    };
    (0..count).map(|_| point()).collect()
}

/// Peak resident memory in megabytes, where the system says.
fn peak() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok());
    kilobytes.unwrap_or(0.0) / 1e3
}

fn main() {
    let counts: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let counts = if counts.is_empty() {
        vec![100_000, 1_000_000]
    } else {
        counts
    };
    for count in counts {
        let tube = ScanOptions {
            points: Some(count),
            noise: 0.05,
            outliers: 0.01,
            order: Order::Scattered,
            ..ScanOptions::default()
        };
        for name in ["bump", "tube"] {
            let scan = match name {
                "bump" => Scan {
                    points: bump(count, 0.05),
                    ..Scan::default()
                },
                _ => scan(Shape::Tube, &tube).unwrap().scan,
            };
            for threads in [1, 0] {
                let pool = rayon::ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .build()
                    .unwrap();
                let run = || {
                    let start = Instant::now();
                    let result = clean(&scan, &CleanOptions::default(), &Silent).unwrap();
                    (start.elapsed().as_secs_f64(), result)
                };
                let runs = if count < 10_000_000 { 3 } else { 1 };
                let timed = (0..runs).map(|_| pool.install(run));
                let (seconds, result) = timed.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
                println!(
                    "{name} {count:8} points, {} threads: {seconds:6.2} s, {:.2} us per point; spacing {:.4}, noise \
                     {:.5} (0.05), {} outliers, {} parts; peak {:.0} MB",
                    pool.current_num_threads(),
                    1e6 * seconds / count as f64,
                    result.spacing,
                    result.noise,
                    result.rejected.len(),
                    result.parts.count(),
                    peak(),
                );
            }
        }
    }
}

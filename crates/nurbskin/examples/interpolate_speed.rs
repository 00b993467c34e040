//! How fast grids are interpolated: seconds, growth exponent and peak memory from 18 x 18 to 3000 x 3000 points, on one
//! thread and on two.
//!
//! `cargo run --release --example interpolate_speed` prints the table; every line is measured in a process of its own,
//! which `interpolate_speed M N` runs (threads by `RAYON_NUM_THREADS`). Times are the smallest of many repeats.

use nurbskin::chart::Topology;
use nurbskin::fit::interpolate::interpolate_at;
use nurbskin::fit::parameters::{Parameterization, parameters_u, parameters_v};
use nurbskin::{DVec3, PointGrid};
use std::f64::consts::{PI, TAU};
use std::hint::black_box;
use std::time::Instant;

const SIZES: [(usize, usize); 7] = [
    (18, 18),
    (29, 13),
    (25, 32),
    (100, 100),
    (300, 300),
    (1000, 1000),
    (3000, 3000),
];

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

#[expect(clippy::print_stdout, reason = "its purpose")]
fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [m, n] = arguments.as_slice() {
        let ([p, p_cpu], [s, s_cpu], memory) = measure(m.parse()?, n.parse()?)?;
        println!("{p:e} {p_cpu:e} {s:e} {s_cpu:e} {memory}");
        return Ok(());
    }
    println!("               parameters             surface at given parameters");
    println!(
        "threads      grid     wall s      cpu s      wall s      cpu s      ns/point  exponent  peak MB"
    );
    for threads in ["1", "2"] {
        let mut before: Option<(f64, f64)> = None;
        for (m, n) in SIZES {
            let output = std::process::Command::new(std::env::current_exe()?)
                .args([m.to_string(), n.to_string()])
                .env("RAYON_NUM_THREADS", threads)
                .output()?;
            let text = String::from_utf8(output.stdout)?;
            let values = text
                .split_whitespace()
                .map(str::parse::<f64>)
                .collect::<Result<Vec<_>, _>>()?;
            let [p, p_cpu, s, s_cpu, memory] = values[..] else {
                return Err("a measuring process failed".into());
            };
            let points = (m * n) as f64;
            let exponent = before.map_or(String::new(), |(points_before, s_before)| {
                format!("{:.2}", (s / s_before).ln() / (points / points_before).ln())
            });
            before = Some((points, s));
            println!(
                "{threads:>7} {m:>4}x{n:<4} {p:>10.2e} {p_cpu:>10.2e}  {s:>10.2e} {s_cpu:>10.2e}  {:>12.2} {exponent:>9} {memory:>8.0}",
                1e9 * s / points
            );
        }
    }
    Ok(())
}

/// [Wall time, processor time] of the parameters, the same of the surface at given parameters, peak memory in MB.
fn measure(m: usize, n: usize) -> Outcome<([f64; 2], [f64; 2], f64)> {
    let grid = bumpy_sheet(m, n)?;
    let chord = Parameterization::ChordLength;
    let u = parameters_u(&grid, false, chord)?;
    let v = parameters_v(&grid, false, chord)?;
    let parameters = fastest(|| {
        Ok([
            parameters_u(black_box(&grid), false, chord)?,
            parameters_v(black_box(&grid), false, chord)?,
        ])
    })?;
    let solve = fastest(|| {
        Ok(interpolate_at(
            black_box(&grid),
            Topology::Disk,
            [3, 3],
            [&u, &v],
        )?)
    })?;
    Ok((parameters, solve, peak_memory()))
}

/// The grid that the comparison with other libraries uses: uneven, with curved lines.
fn bumpy_sheet(m: usize, n: usize) -> nurbskin::Result<PointGrid> {
    PointGrid::from_fn(m, n, |i, j| {
        let (i, j) = (i as f64 / (m - 1) as f64, j as f64 / (n - 1) as f64);
        let s = i + 0.10 * (TAU * i).sin() / PI;
        let t = j - 0.12 * (TAU * j).sin() / PI;
        let x = 100.0 * s + 0.8 * (TAU * t).sin();
        let y = 80.0 * t + 0.6 * (TAU * s).sin();
        let z = 8.0 * (TAU * x / 50.0).sin() * (TAU * y / 40.0).cos()
            + 3.0 * (TAU * (x + y) / 90.0).sin()
            + 0.004 * (x - 50.0).powi(2);
        DVec3::new(x, y, z)
    })
}

/// [Smallest wall time, mean processor time] of one run, over about a second of runs and at least seven. Processor time
/// is that of all threads; on a machine busy with other work it says more than wall time. Short runs are measured many
/// at a time; the time to give the memory of a long run's result back to the system is not counted.
fn fastest<T>(mut run: impl FnMut() -> Outcome<T>) -> Outcome<[f64; 2]> {
    let begin = Instant::now();
    black_box(run()?);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a small positive number"
    )]
    let repeats = (3e-3 / begin.elapsed().as_secs_f64()).clamp(1.0, 1e4) as usize;
    let (mut best, mut worked, mut samples) = (f64::INFINITY, 0.0, 0);
    while samples < 7 || begin.elapsed().as_secs_f64() < 1.0 {
        let (start, before) = (Instant::now(), processor_time());
        for _ in 1..repeats {
            black_box(run()?);
        }
        let result = black_box(run()?);
        best = best.min(start.elapsed().as_secs_f64());
        worked += processor_time() - before;
        drop(result);
        samples += 1;
    }
    let repeats = repeats as f64;
    Ok([best / repeats, worked / (repeats * f64::from(samples))])
}

/// Seconds that all threads of this process have run, where the system tells it.
fn processor_time() -> f64 {
    let Ok(tasks) = std::fs::read_dir("/proc/self/task") else {
        return f64::NAN;
    };
    tasks
        .flatten()
        .filter_map(|task| std::fs::read_to_string(task.path().join("schedstat")).ok())
        .filter_map(|text| text.split_whitespace().next()?.parse::<f64>().ok())
        .sum::<f64>()
        * 1e-9
}

/// Peak resident memory of this process in MB, where the system tells it.
fn peak_memory() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))
        .and_then(|rest| rest.split_whitespace().next()?.parse::<f64>().ok())
        .map_or(f64::NAN, |kib| kib * 1024.0 / 1e6)
}

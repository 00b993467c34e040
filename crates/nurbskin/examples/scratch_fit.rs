use nurbskin::chart::{Chart, Topology};
use nurbskin::fit::approximate::{ApproximateOptions, approximate};
use nurbskin::progress::Silent;
use nurbskin::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let n: usize = a[1].parse().unwrap();
    let mode = a[2].as_str();
    let part = |x: f64| x - x.floor();
    let mut clean = vec![];
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
            clean.push(z);
            DVec3::new(x, y, z + 0.05 * normal)
        })
        .collect();
    let parameters: Vec<DVec2> = points.iter().map(|p| p.truncate() / 100.0 + 0.5).collect();
    let chart = Chart {
        topology: Topology::Disk,
        parameters,
        size: [100.0, 100.0],
        reason: String::new(),
    };
    let o = match mode {
        "once" => ApproximateOptions {
            refine: false,
            spans: Some([21, 21]),
            ..ApproximateOptions::new(0.15)
        },
        "budget" => ApproximateOptions {
            max_control_points: Some(1600),
            noise: Some(0.05),
            correct: false,
            ..ApproximateOptions::new(0.15)
        },
        _ => ApproximateOptions::new(0.15),
    };
    for _ in 0..a.get(3).map_or(1, |x| x.parse().unwrap()) {
        let t = std::time::Instant::now();
        let fit = approximate(&points, &chart, &o, &Silent).unwrap();
        let s = t.elapsed().as_secs_f64();
        let mut sq = 0.0;
        let mut mx: f64 = 0.0;
        let mut cnt = 0.0;
        for k in (0..n).step_by((n / 20000).max(1)) {
            let p = fit.surface.point(fit.feet[k].x, fit.feet[k].y);
            let r = p.truncate().length();
            let (x, y) = (p.x, p.y);
            let z = 20.0 * (PI * r / 120.0).cos()
                + 3.0 * (TAU * x / 40.0).sin() * (TAU * y / 35.0).cos();
            // slope
            let e = 1e-4;
            let f = |x: f64, y: f64| {
                20.0 * (PI * x.hypot(y) / 120.0).cos()
                    + 3.0 * (TAU * x / 40.0).sin() * (TAU * y / 35.0).cos()
            };
            let g = DVec2::new(
                (f(x + e, y) - f(x - e, y)) / (2. * e),
                (f(x, y + e) - f(x, y - e)) / (2. * e),
            );
            let d = (p.z - z) / (1.0 + g.length_squared()).sqrt();
            sq += d * d;
            cnt += 1.0;
            mx = mx.max(d.abs());
        }
        println!(
            "{n} {mode}: {s:.3} s, {:?} {:?}, rms {:.5} max {:.4} sigma {:.4} rounds {}",
            fit.surface.distinct_counts(),
            fit.status,
            (sq / cnt as f64).sqrt(),
            mx,
            fit.sigma,
            fit.history.len()
        );
    }
}

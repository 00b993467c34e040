//! What does a certified distance cost? Points near, far from and beyond the edge of a wavy bicubic surface with
//! 30 x 30 control points, on one core: microseconds per point, the best of several runs, and the widest bracket.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a benchmark prints what it measures and may stop"
)]

use nurbskin::nurbs::closest::ClosestPoint;
use nurbskin::{ControlNet, DVec2, DVec3, KnotVector, NurbsSurface};
use std::time::Instant;

fn surface() -> NurbsSurface {
    let knots = KnotVector::uniform(3, 30).unwrap();
    let at = knots.greville();
    let tau = std::f64::consts::TAU;
    let net = ControlNet::from_fn(30, 30, |i, j| {
        let (x, y) = (100.0 * at[i], 80.0 * at[j]);
        let z = 8.0 * (tau * x / 50.0).sin() * (tau * y / 40.0).cos()
            + 3.0 * (tau * (x + y) / 90.0).sin()
            + 0.004 * (x - 50.0) * (x - 50.0);
        DVec3::new(
            x + 0.8 * (tau * at[j]).sin(),
            y + 0.6 * (tau * at[i]).sin(),
            z,
        )
    })
    .unwrap();
    NurbsSurface::new(knots.clone(), knots, net, None).unwrap()
}

/// Normally distributed numbers: Box-Muller over a linear congruential sequence.
struct Normal(u64);

impl Normal {
    fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
    fn next(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// 80 % near (standard deviation 0.5 per coordinate), 10 % far (8), 10 % up to 3 beyond an edge.
fn queries(surface: &NurbsSurface, count: usize) -> Vec<DVec3> {
    let mut random = Normal(5);
    (0..count)
        .map(|k| {
            let foot = surface.point(random.uniform(), random.uniform());
            let sigma = if k % 10 == 3 { 8.0 } else { 0.5 };
            let mut point = foot + sigma * DVec3::new(random.next(), random.next(), random.next());
            if k % 10 == 7 {
                let beyond = 3.0 * random.uniform();
                point.x = if random.uniform() < 0.5 {
                    -beyond
                } else {
                    100.0 + beyond
                };
            }
            point
        })
        .collect()
}

/// Seconds of processor time of this thread where the system tells, which a busy machine does not disturb.
fn seconds(start: Instant) -> f64 {
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|text| text.split(' ').next()?.parse::<f64>().ok())
        .map_or_else(|| start.elapsed().as_secs_f64(), |ns| 1e-9 * ns)
}

fn time(name: &str, count: usize, run: impl Fn() -> f64) {
    let start = Instant::now();
    // Long enough for clocks that tick every few milliseconds.
    let repeat = 1 + 50_000 / count;
    let mut widest = 0.0;
    let best = (0..5)
        .map(|_| {
            let before = seconds(start);
            for _ in 0..repeat {
                widest = run();
            }
            (seconds(start) - before) / repeat as f64
        })
        .fold(f64::INFINITY, f64::min);
    println!(
        "{name:<28} {:7.3} us per point, widest bracket {widest:.1e}",
        1e6 * best / count as f64
    );
}

fn all() {
    let surface = surface();
    let start = Instant::now();
    let solver = ClosestPoint::new(&surface).unwrap();
    println!(
        "prepared in {:.1} ms: {} pieces, tolerance {:.1e}",
        1e3 * start.elapsed().as_secs_f64(),
        solver.piece_count(),
        solver.tolerance()
    );
    let points = queries(&surface, 10_000);
    type Kind = (&'static str, fn(usize) -> bool);
    let kinds: [Kind; 4] = [
        ("near", |k| k != 3 && k != 7),
        ("far", |k| k == 3),
        ("beyond the edge", |k| k == 7),
        ("all", |_| true),
    ];
    for (name, kind) in kinds {
        let set: Vec<DVec3> = points
            .iter()
            .enumerate()
            .filter(|(k, _)| kind(k % 10))
            .map(|(_, &p)| p)
            .collect();
        let widest = |starts: Option<&[DVec2]>| {
            solver
                .closest_all(&set, starts)
                .iter()
                .map(|foot| foot.distance - foot.lower)
                .fold(0.0, f64::max)
        };
        time(name, set.len(), || widest(None));
        let starts: Vec<DVec2> = solver
            .closest_all(&set, None)
            .iter()
            .map(|foot| DVec2::new(foot.u + 0.003, foot.v - 0.003))
            .collect();
        time(&format!("{name}, from near starts"), set.len(), || {
            widest(Some(&starts))
        });
    }
}

fn main() {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap()
        .install(all);
}

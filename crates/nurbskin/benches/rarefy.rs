//! How many points do four noise-free shapes need at 0.1 mm, and how long does it take to find them?
//!
//! Seconds are processor seconds of this thread, the least of three runs.
#![expect(clippy::print_stdout, reason = "a benchmark reports")]
#![expect(clippy::unwrap_used, reason = "the shapes are valid")]

#[path = "../tests/fixtures.rs"]
mod fixtures;

use nurbskin::enrich::enrich_grid;
use nurbskin::fit::interpolate::parameters::Parameterization::{ChordLength, Uniform};
use nurbskin::fit::rarefied::{Options, largest_threshold, rarefy_to_tolerance};
use nurbskin::progress::Silent;
use nurbskin::rarefy::{Thresholds, rarefy};

/// Seconds that this thread has computed; where the system does not say, seconds of the clock.
fn seconds() -> f64 {
    let computed = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = computed.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(
        || {
            let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
            since.map_or(0.0, |time| time.as_secs_f64())
        },
        |nanoseconds| nanoseconds * 1e-9,
    )
}

/// The result and the least time of three runs.
fn timed<T>(f: impl Fn() -> T) -> (T, f64) {
    let run = || {
        let start = seconds();
        let result = f();
        (result, seconds() - start)
    };
    let (result, first) = run();
    (result, first.min(run().1).min(run().1))
}

/// The least time by the clock of twenty runs of what is too short for the processor clock.
fn short(f: impl Fn()) -> f64 {
    let run = |_| {
        let start = std::time::Instant::now();
        f();
        start.elapsed().as_secs_f64()
    };
    (0..20).map(run).fold(f64::INFINITY, f64::min)
}

fn main() {
    for shape in fixtures::all() {
        let (name, grid, topology) = (shape.name, &shape.grid, shape.topology);
        for (label, parameterization) in [
            ("chord length", Some(ChordLength)),
            ("uniform", Some(Uniform)),
            ("best of both", None),
        ] {
            let options = Options {
                parameterization,
                ..Options::default()
            };
            let (result, time) =
                timed(|| rarefy_to_tolerance(grid, topology, 0.1, &options, &Silent).unwrap());
            let [m, n] = result.kept.counts();
            println!(
                "{name:6}  to tolerance, {label:12}  {m:3} x {n:3} = {:4} points, {:.4} mm, {time:.3} s",
                m * n,
                result.max_distance,
            );
        }
        for (label, kind) in [("chord length", ChordLength), ("uniform", Uniform)] {
            let (found, time) =
                timed(|| largest_threshold(grid, topology, 0.1, [3, 3], kind, &Silent).unwrap());
            match found {
                Some((degrees, result)) => {
                    let [m, n] = result.kept.counts();
                    println!(
                        "{name:6}  D_T {degrees:7.3} deg, {label:12}  {m:3} x {n:3} = {:4} points, {:.4} mm, {time:.3} s",
                        m * n,
                        result.max_distance,
                    );
                }
                None => println!("{name:6}  D_T, {label}: none"),
            }
        }
        let time = short(|| {
            let _ = rarefy(grid, topology, Thresholds::both(5.0));
        });
        let dense = enrich_grid(grid, topology, 2).unwrap();
        let enriching = short(|| {
            enrich_grid(grid, topology, 2).unwrap();
        });
        println!(
            "{name:6}  one threshold {:.1} ms; enriched to {} points in {:.1} ms",
            1e3 * time,
            dense.points().len(),
            1e3 * enriching
        );
    }
}

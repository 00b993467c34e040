//! How many points do four noise-free shapes need at 0.1 mm, and how long does it take to find them?
#![expect(clippy::print_stdout, reason = "a benchmark reports")]

#[path = "../tests/four_shapes.rs"]
mod four_shapes;

use nurbskin::fit::parameters::Parameterization;
use nurbskin::fit::rarefied::{Options, rarefy_to_tolerance};
use nurbskin::progress::Silent;

/// Seconds that this thread has computed; where the system does not say, seconds of the clock.
fn seconds() -> f64 {
    let computed = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = computed.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    nanoseconds.unwrap_or_else(|| {
        let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        since.map_or(0.0, |time| 1e9 * time.as_secs_f64())
    }) * 1e-9
}

fn main() {
    for shape in four_shapes::all() {
        for kind in [
            Some(Parameterization::ChordLength),
            Some(Parameterization::Uniform),
            None,
        ] {
            let options = Options {
                parameterization: kind,
                ..Options::default()
            };
            let mut best = f64::INFINITY;
            let mut last = None;
            for _ in 0..3 {
                let start = seconds();
                let result =
                    rarefy_to_tolerance(&shape.grid, shape.topology, 0.1, &options, &Silent)
                        .unwrap();
                best = best.min(seconds() - start);
                last = Some(result);
            }
            let result = last.unwrap();
            let [m, n] = result.kept.counts();
            println!(
                "{:7} {:12} {m:3} x {n:3} = {:4} points, {:.4} mm, {} rounds, {:.3} s",
                shape.name,
                format!("{kind:?}"),
                m * n,
                result.max_distance,
                result.rounds,
                best
            );
        }
    }
}

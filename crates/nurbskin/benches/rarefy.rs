//! How many points do four noise-free shapes need at 0.1 mm, and how long does it take to find them?
#![expect(clippy::print_stdout, reason = "a benchmark reports")]

#[path = "../tests/four_shapes.rs"]
mod four_shapes;

use nurbskin::fit::parameters::Parameterization;
use nurbskin::fit::rarefied::{Options, rarefy_to_tolerance};
use nurbskin::progress::Silent;
use std::time::Instant;

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
                let start = Instant::now();
                let result =
                    rarefy_to_tolerance(&shape.grid, shape.topology, 0.1, &options, &Silent)
                        .unwrap();
                best = best.min(start.elapsed().as_secs_f64());
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

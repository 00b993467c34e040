//! The deep drawing example of G+Smo: points with parameters.

use crate::Outcome;
use nurbskin::chart::{Chart, Topology};
use nurbskin::fit::approximate::{ApproximateOptions, approximate};
use nurbskin::progress::Silent;
use nurbskin::{DVec2, DVec3};
use std::path::PathBuf;
use std::time::Instant;

const FILE: &str = "patches/gismo_deepdrawingC_xyzuv.txt";

/// Prints what comes of it with the peers' numbers of control points.
pub(crate) fn print(only: &str) -> Outcome<()> {
    if !"deep drawing".contains(only) {
        return Ok(());
    }
    let Some(folder) = std::env::var_os("NURBSKIN_DATA") else {
        println!("\nDeep drawing: no folder of scans in NURBSKIN_DATA.");
        return Ok(());
    };
    let text = std::fs::read_to_string(PathBuf::from(folder).join(FILE))?;
    let mut points = Vec::new();
    let mut parameters = Vec::new();
    for line in text.lines().filter(|l| !l.starts_with('#')) {
        let numbers = line
            .split_whitespace()
            .map(str::parse)
            .collect::<Result<Vec<f64>, _>>()?;
        let &[x, y, z, u, v] = &numbers[..] else {
            return Err(format!("{FILE}: five numbers in a line expected").into());
        };
        points.push(DVec3::new(x, y, z));
        parameters.push(DVec2::new(u, v));
    }
    let fold = |f: fn(DVec2, DVec2) -> DVec2| parameters.iter().copied().reduce(f);
    let (lo, hi) = (
        fold(DVec2::min).unwrap_or_default(),
        fold(DVec2::max).unwrap_or_default(),
    );
    let chart = Chart {
        topology: Topology::Disk,
        parameters: parameters.iter().map(|t| (*t - lo) / (hi - lo)).collect(),
        size: [102.0, 102.0],
        reason: String::new(),
    };
    println!(
        "\n| deep drawing, at most | control points | at the parameters: max | rms | at the feet: max | rms | THB: max / rms | s |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (budget, peer) in [(1117, "0.074 / 0.019"), (1633, "0.047 / 0.0097")] {
        let options = ApproximateOptions {
            max_control_points: Some(budget),
            // Less than can be had, so that all of the budget is used.
            ..ApproximateOptions::new(0.02)
        };
        let start = Instant::now();
        let fit = approximate(&points, &chart, &options, &Silent)?;
        let seconds = start.elapsed().as_secs_f64();
        let errors = |places: &[DVec2]| {
            let distances = points
                .iter()
                .zip(places)
                .map(|(p, t)| p.distance(fit.surface.point(t.x, t.y)));
            let (largest, squares) =
                distances.fold((0.0_f64, 0.0), |(m, s), d| (m.max(d), s + d * d));
            format!(
                "{largest:.4} | {:.4}",
                (squares / points.len() as f64).sqrt()
            )
        };
        let [m, n] = fit.surface.distinct_counts();
        println!(
            "| {budget} | {m} x {n} = {} | {} | {} | {peer} | {seconds:.3} |",
            m * n,
            errors(&fit.parameters),
            errors(&fit.feet),
        );
    }
    Ok(())
}

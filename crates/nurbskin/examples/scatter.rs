//! How few control points an approximation needs, and how close it comes to a truth that is known:
//! `cargo run --release --example scatter [-- --seeds 20] [--only NAME] [--uniform SPANS|SPANSxSPANS]`.
//!
//! Every case is scanned anew for each seed, in a random pose and a random unit, and printed as a row of a Markdown table:
//! the median and the worst over the seeds; with `--uniform` on so many even spans along u and v, to compare. One pot is
//! recognised as a surface of revolution from its points alone. With a folder of scans in `NURBSKIN_DATA`, the point set of
//! the peers' deep drawing example, which comes with parameters, follows.

#![expect(clippy::print_stdout, reason = "tables are what it is for")]

#[path = "scatter/given.rs"]
mod given;
#[path = "scatter/scans.rs"]
mod scans;

use nurbskin::fit::approximate::{ApproximateOptions, Status, approximate};
use nurbskin::fit::revolution;
use nurbskin::nurbs::closest::ClosestPoint;
use nurbskin::progress::Silent;
use nurbskin::scan::{CleanOptions, Scan, clean};
use nurbskin::{DVec3, NurbsSurface};
use scans::{Case, Posed};
use std::time::Instant;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// What one fit gave; lengths in millimetres.
struct Row {
    control_points: f64,
    largest: f64,
    rms: f64,
    sigma: f64,
    seconds: f64,
    met: bool,
}

fn run(case: &Case, seed: u64, uniform: Option<[usize; 2]>) -> Outcome<Row> {
    let Posed {
        points,
        chart,
        truth,
        unit,
    } = scans::posed(case, seed);
    let options = ApproximateOptions {
        max_control_points: case.budget,
        refine: uniform.is_none(),
        spans: uniform,
        ..ApproximateOptions::new(case.tolerance * unit)
    };
    let start = Instant::now();
    let (surface, sigma, met) = if case.recognised {
        turned(points, options.tolerance)?
    } else {
        let fit = approximate(&points, &chart, &options, &Silent)?;
        (fit.surface, fit.sigma, fit.status == Status::Met)
    };
    let seconds = start.elapsed().as_secs_f64();
    let [m, n] = surface.distinct_counts();
    let closest = ClosestPoint::with_tolerance(&surface, 1e-5 * unit)?;
    let distances: Vec<f64> = closest
        .closest_all(&truth, None)
        .iter()
        .map(|foot| foot.distance / unit)
        .collect();
    let squares: f64 = distances.iter().map(|d| d * d).sum();
    Ok(Row {
        control_points: (m * n) as f64,
        largest: distances.iter().copied().fold(0.0, f64::max),
        rms: (squares / distances.len() as f64).sqrt(),
        sigma: sigma / unit,
        seconds,
        met,
    })
}

/// The surface of revolution that the points are a scan of, the noise, and that it is within the tolerance: there is none
/// otherwise.
fn turned(points: Vec<DVec3>, tolerance: f64) -> Outcome<(NurbsSurface, f64, bool)> {
    let scan = Scan {
        points,
        ..Scan::default()
    };
    let scan = clean(&scan, &CleanOptions::default(), &Silent)?;
    let (points, normals) = (&scan.points, &scan.normals);
    match revolution::fit(
        points,
        normals,
        tolerance,
        scan.noise,
        scan.spacing,
        &Silent,
    )? {
        revolution::Outcome::Fitted(fit) => Ok((fit.surface, fit.sigma, true)),
        revolution::Outcome::Refused(why) => Err(why.into()),
    }
}

/// Median and largest.
fn median_worst(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    let worst = values.last().copied().unwrap_or(f64::NAN);
    [
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN),
        worst,
    ]
}

fn main() -> Outcome<()> {
    let mut seeds = 20;
    let mut only = String::new();
    let mut uniform = None;
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let value = arguments.next().unwrap_or_default();
        match argument.as_str() {
            "--seeds" => seeds = value.parse()?,
            "--only" => only = value,
            "--uniform" => {
                let (along, across) = value.split_once('x').unwrap_or((&value, &value));
                uniform = Some([along.parse()?, across.parse()?]);
            }
            other => {
                return Err(
                    format!("{other}: only --seeds, --only and --uniform are known").into(),
                );
            }
        }
    }
    println!(
        "| data | tolerance | control points, median (worst) | ceiling | max, mm | ceiling | rms, mm | ceiling | sigma | met | s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    let wanted =
        |case: &&Case| case.name.contains(&only) && !(case.recognised && uniform.is_some());
    for case in scans::cases().iter().filter(wanted) {
        let rows = (1..=seeds)
            .map(|seed| run(case, seed, uniform))
            .collect::<Outcome<Vec<Row>>>()?;
        let column = |f: fn(&Row) -> f64| median_worst(rows.iter().map(f).collect());
        let ceiling = |x: Option<f64>| x.map_or_else(|| "-".into(), |x| x.to_string());
        let [count, most] = column(|r| r.control_points);
        let [largest, worst] = column(|r| r.largest);
        let [rms, worst_rms] = column(|r| r.rms);
        let [sigma, _] = column(|r| r.sigma);
        let [seconds, slowest] = column(|r| r.seconds);
        let met = rows.iter().filter(|r| r.met).count();
        println!(
            "| {} | {} | {count} ({most}) | {} | {largest:.4} ({worst:.4}) | {} | {rms:.5} ({worst_rms:.5}) | {} | {sigma:.4} | {met}/{} | {seconds:.3} ({slowest:.3}) |",
            case.name,
            case.tolerance,
            ceiling(case.ceilings[0]),
            ceiling(case.ceilings[1]),
            ceiling(case.ceilings[2]),
            rows.len(),
        );
    }
    given::print(&only)
}

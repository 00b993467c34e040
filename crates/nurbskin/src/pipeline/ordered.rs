//! Ordered scans: rarefied and interpolated as the paper does, or approximated where they are noisy.

use super::cloud::approximate_seen;
use super::{Fitted, Method, Options, Rarefaction, Times, Tolerance, hold_out};
use crate::chart::{Chart, Topology, grid};
use crate::enrich::enrich_grid;
use crate::fit::approximate::Status;
use crate::fit::interpolate::{choose_parameterization, interpolate};
use crate::fit::parameters::{Parameterization, parameters_u, parameters_v};
use crate::fit::rarefied::{self, Rarefied, rarefy_to_tolerance};
use crate::progress::Progress;
use crate::rarefy::{self as paper, Thresholds};
use crate::scan::noise::noise_of_grid;
use crate::scan::{Organisation, Reason, Rejected, Scan};
use crate::{Error, NurbsSurface, PointGrid, Result};
use glam::{DVec2, DVec3};
use std::time::Instant;

/// Noise above this share of the tolerance makes interpolation pass it on: approximation is chosen.
const NOISE_TO_INTERPOLATE: f64 = 0.1;

/// An ordered scan with what was measured of it.
pub(super) struct Prepared {
    pub(super) ordered: grid::OrderedScan,
    pub(super) noise: f64,
    pub(super) spacing: f64,
    pub(super) diagonal: f64,
}

pub(super) fn prepare(scan: &Scan, topology: Option<Topology>) -> Result<Prepared> {
    let ordered = grid::order(scan, topology)?;
    let [lo, hi] = ordered.grid.bounding_box();
    let diagonal = lo.distance(hi);
    if diagonal <= 0.0 {
        return Err(Error::invalid(
            "all points are equal: a surface needs an extent",
        ));
    }
    let noise = noise_of_grid(&ordered.grid, ordered.topology.closed());
    let spacing = spacing_of_grid(&ordered.grid, ordered.topology);
    Ok(Prepared {
        ordered,
        noise,
        spacing,
        diagonal,
    })
}

/// Median distance between neighbours along u and v: the longer of the two.
fn spacing_of_grid(grid: &PointGrid, topology: Topology) -> f64 {
    let [m, n] = grid.counts();
    let [_, closed] = topology.closed();
    let mut along_u: Vec<f64> = (0..n)
        .flat_map(|j| grid.row(j).windows(2).map(|w| w[0].distance(w[1])))
        .collect();
    let rows = if closed { n } else { n.saturating_sub(1) };
    let mut along_v: Vec<f64> = (0..rows)
        .flat_map(|j| (0..m).map(move |i| grid.point(i, j).distance(grid.point(i, (j + 1) % n))))
        .collect();
    let median = |gaps: &mut [f64]| crate::numeric::statistics::median_in_place(gaps);
    median(&mut along_u).max(median(&mut along_v))
}

/// Fits an ordered scan.
pub(super) fn fit(
    scan: &Scan,
    options: &Options,
    progress: &dyn Progress,
    times: &mut Times,
) -> Result<Fitted> {
    progress.stage("order", None);
    let start = Instant::now();
    let held_out = hold_out(scan.points.len(), options.hold_out);
    let seen = without(scan, &held_out);
    let prepared = prepare(seen.as_ref().unwrap_or(scan), options.topology)?;
    let tolerance = Tolerance::choose(options, scan, prepared.noise, prepared.diagonal);
    times.order = start.elapsed().as_secs_f64();

    let method = match options.method {
        Method::Auto if prepared.noise > NOISE_TO_INTERPOLATE * tolerance.value => {
            Method::Approximate
        }
        Method::Auto => Method::Interpolate,
        asked => asked,
    };
    let ordered = &prepared.ordered;
    let made = if method == Method::Approximate {
        approximated(
            scan,
            &prepared,
            &held_out,
            options,
            tolerance.value,
            progress,
            times,
        )?
    } else {
        interpolated(ordered, options, tolerance.value, progress, times)?
    };
    let usable = |k: &usize| scan.points[*k].is_finite();
    let used: Vec<usize> = (0..scan.points.len()).filter(usable).collect();
    let rejected = (0..scan.points.len())
        .filter(|k| !usable(k))
        .map(|index| Rejected {
            index,
            reason: Reason::NonFinite,
        })
        .collect();
    Ok(Fitted {
        surface: made.surface,
        topology: ordered.topology,
        method: if method == Method::Approximate {
            "approximate"
        } else {
            "interpolate"
        },
        not_met: made.not_met,
        kept: made.kept,
        parameters: made.kind.map(Parameterization::name),
        grid: Some(ordered.grid.counts()),
        tolerance,
        points: used.iter().map(|&k| scan.points[k]).collect(),
        held_out: used.iter().map(|&k| held_out[k]).collect(),
        used: used
            .iter()
            .map(|&k| u32::try_from(k).unwrap_or(u32::MAX))
            .collect(),
        rejected,
        spacing: prepared.spacing,
        noise: prepared.noise,
        triangles: None,
        notes: vec![ordered.reason.clone()],
    })
}

/// The scan as rows without the points held out; `None` if none is.
fn without(scan: &Scan, held_out: &[bool]) -> Option<Scan> {
    if !held_out.contains(&true) {
        return None;
    }
    let mut seen = Scan {
        points: Vec::with_capacity(scan.points.len()),
        ..Scan::default()
    };
    let mut lengths = Vec::new();
    let mut take = |row: &mut dyn Iterator<Item = usize>| {
        let before = seen.points.len();
        seen.points
            .extend(row.filter(|&k| !held_out[k]).map(|k| scan.points[k]));
        lengths.push(seen.points.len() - before);
    };
    match &scan.organisation {
        Organisation::Grid(layout) => {
            for row in layout.cells.chunks(layout.count_u.max(1)) {
                take(&mut row.iter().flatten().map(|&k| k as usize));
            }
        }
        Organisation::Rows(rows) => {
            let mut first = 0;
            for &length in rows {
                take(&mut (first..first + length));
                first += length;
            }
        }
        Organisation::Unordered | Organisation::Mesh(_) => return None,
    }
    seen.organisation = Organisation::Rows(lengths);
    Some(seen)
}

/// A surface made from an ordered scan.
struct Made {
    surface: NurbsSurface,
    not_met: Option<String>,
    kept: Option<[usize; 2]>,
    kind: Option<Parameterization>,
}

/// The fewest lines within the tolerance on all points.
pub(super) fn to_tolerance(
    grid: &PointGrid,
    topology: Topology,
    options: &Options,
    tolerance: f64,
    progress: &dyn Progress,
) -> Result<Rarefied> {
    let wanted = rarefied::Options {
        degree: options.degree,
        parameterization: options.parameters,
        max_points: options.max_control_points,
        ..rarefied::Options::default()
    };
    rarefy_to_tolerance(grid, topology, tolerance, &wanted, progress)
}

/// The paper's line: enriched or rarefied, then interpolated.
fn interpolated(
    ordered: &grid::OrderedScan,
    options: &Options,
    tolerance: f64,
    progress: &dyn Progress,
    times: &mut Times,
) -> Result<Made> {
    let topology = ordered.topology;
    let start = Instant::now();
    let enriched;
    let mut grid = &ordered.grid;
    if options.enrich > 0 {
        progress.stage("enrich", None);
        enriched = enrich_grid(grid, topology, options.enrich)?;
        grid = &enriched;
        times.enrich = start.elapsed().as_secs_f64();
    }
    let budget = options.max_control_points.unwrap_or(usize::MAX);
    let rarefying = Instant::now();
    progress.stage("rarefy", None);
    let kept = match options.rarefy {
        // What was enriched on purpose is not thinned again unless that is asked for.
        Rarefaction::Auto if options.enrich > 0 => None,
        Rarefaction::Off => None,
        Rarefaction::Auto => {
            let found = to_tolerance(grid, topology, options, tolerance, progress)?;
            times.rarefy = rarefying.elapsed().as_secs_f64();
            let not_met = (!found.met).then(|| {
                format!(
                    "the best {} points within the budget leave {:.4e}",
                    found.kept.point_count(),
                    found.max_distance
                )
            });
            return Ok(Made {
                surface: found.surface,
                not_met,
                kept: Some(found.kept.counts()),
                kind: Some(found.parameterization),
            });
        }
        Rarefaction::Threshold([u, v]) => Some(paper::rarefy(grid, topology, Thresholds { u, v })),
        Rarefaction::Counts(counts) => Some(paper::to_counts_filled(grid, topology, counts)?.1),
    };
    times.rarefy = rarefying.elapsed().as_secs_f64();
    let fitting = Instant::now();
    progress.stage("fit", None);
    let selected;
    if let Some(kept) = &kept {
        selected = kept.select(grid)?;
        grid = &selected;
    }
    let [m, n] = grid.counts();
    if m * n > budget {
        return Err(Error::NoSolution(format!(
            "interpolating {m} x {n} points needs as many control points, which is over the budget of {budget}: use \
             --rarefy auto or --method approximate"
        )));
    }
    let kind = match options.parameters {
        Some(kind) => kind,
        None => choose_parameterization(grid, topology, options.degree)?.kind,
    };
    let surface = interpolate(grid, topology, options.degree, kind)?.surface;
    times.fit = fitting.elapsed().as_secs_f64();
    Ok(Made {
        surface,
        not_met: None,
        kept: kept.map(|k| k.counts()),
        kind: Some(kind),
    })
}

/// Least squares through all points, each at its place in the array.
fn approximated(
    scan: &Scan,
    prepared: &Prepared,
    held_out: &[bool],
    options: &Options,
    tolerance: f64,
    progress: &dyn Progress,
    times: &mut Times,
) -> Result<Made> {
    progress.stage("fit", None);
    let start = Instant::now();
    let ordered = &prepared.ordered;
    let [closed_u, closed_v] = ordered.topology.closed();
    let kind = options.parameters.unwrap_or(Parameterization::ChordLength);
    let lines = [
        parameters_u(&ordered.grid, closed_u, kind)?,
        parameters_v(&ordered.grid, closed_v, kind)?,
    ];
    let points: Vec<DVec3> = ordered
        .places
        .iter()
        .map(|place| scan.points[place.index])
        .collect();
    let parameters = ordered
        .places
        .iter()
        .map(|place| DVec2::from_array([0, 1].map(|d| between(&lines[d], place.lines[d]))))
        .collect();
    let chart = Chart {
        topology: ordered.topology,
        parameters,
        size: mean_lengths(&ordered.grid, ordered.topology),
        reason: ordered.reason.clone(),
    };
    let unseen: Vec<bool> = ordered
        .places
        .iter()
        .map(|place| held_out[place.index])
        .collect();
    let made = approximate_seen(
        &points,
        &chart,
        &unseen,
        prepared.noise,
        tolerance,
        options,
        progress,
    )?;
    times.fit = start.elapsed().as_secs_f64();
    let not_met = match made.status {
        Status::Met => None,
        Status::NotMet(why) => Some(why),
    };
    Ok(Made {
        surface: made.surface,
        not_met,
        kept: None,
        kind: Some(kind),
    })
}

/// The parameter at a place between lines; beyond the last line of a closed direction the first one follows at 1.
fn between(parameters: &[f64], line: f64) -> f64 {
    let last = parameters.len() - 1;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 <= line <= last"
    )]
    let k = (line as usize).min(last);
    let next = parameters.get(k + 1).copied().unwrap_or(1.0);
    parameters[k] + (line - k as f64).clamp(0.0, 1.0) * (next - parameters[k])
}

/// Mean lengths of the lines along u and along v.
fn mean_lengths(grid: &PointGrid, topology: Topology) -> [f64; 2] {
    let [m, n] = grid.counts();
    let [closed_u, closed_v] = topology.closed();
    let along =
        |count: usize, closed: bool, lines: usize, point: &dyn Fn(usize, usize) -> DVec3| {
            let steps = if closed { count } else { count - 1 };
            let sum: f64 = (0..lines)
                .flat_map(|l| (0..steps).map(move |k| (k, l)))
                .map(|(k, l)| point(k, l).distance(point((k + 1) % count, l)))
                .sum();
            sum / lines as f64
        };
    [
        along(m, closed_u, n, &|i, j| grid.point(i, j)),
        along(n, closed_v, m, &|j, i| grid.point(i, j)),
    ]
}

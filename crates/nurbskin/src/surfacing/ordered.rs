//! Ordered scans: rarefied and interpolated as in the paper, or approximated where they are noisy.
//!
//! 1. Points that are not finite, held out or outliers are masked, and filled from their rows by cubics (`rows`).
//! 2. σ ≤ 0.1 T and no outliers: rarefaction to the tolerance, then interpolation through the kept points.
//! 3. Otherwise penalised least squares to all points, at the parameters of their places in the array.
//!
//! Source: Pal and Ballav, IJPR 45(2), 2007, for enrichment, rarefaction and interpolation; the rest is ours.

use super::part::{Asked, approximate_seen};
use super::surfaces::{PartShape, SinglePart};
use super::{Method, Part, Rarefaction, Surfaces, SurfacingOptions, Tolerance, hold_out, rows};
use glam::{DVec2, DVec3};
use nurbskin_fit::chart::{Chart, Topology, grid};
use nurbskin_fit::enrich::enrich_grid;
use nurbskin_fit::fit::approximate::trade::Met;
use nurbskin_fit::fit::approximate::{Guides, NOISE_SHARE, Status};
use nurbskin_fit::fit::interpolate::parameters::{Parameterization, parameters_u, parameters_v};
use nurbskin_fit::fit::interpolate::{choose_parameterization, interpolate, interpolate_at};
use nurbskin_fit::fit::rarefied;
use nurbskin_fit::fit::rarefied::{Rarefied, rarefy_to_tolerance};
use nurbskin_fit::rarefy as paper;
use nurbskin_fit::rarefy::Thresholds;
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, NurbsSurface, PointGrid, Result};
use nurbskin_scan::clean::{CleanOptions, clean};
use nurbskin_scan::noise::noise_of_grid;
use nurbskin_scan::{Reason, Rejected, Scan};
use std::sync::OnceLock;

/// Distance from a line, as a share of the diagonal, up to which points count as collinear.
/// Guard: far above the rounding of coordinates.
const COLLINEARITY: f64 = 1e-9;

/// An ordered scan with its noise, spacing and diagonal.
pub(crate) struct Prepared {
    pub(crate) ordered: grid::OrderedScan,
    pub(crate) noise: f64,
    pub(crate) spacing: f64,
    pub(crate) diagonal: f64,
}

fn prepare(scan: &Scan, topology: Option<Topology>) -> Result<Prepared> {
    let ordered = grid::order(scan, topology)?;
    let [lo, hi] = ordered.grid.bounding_box();
    let diagonal = lo.distance(hi);
    if diagonal <= 0.0 {
        return Err(Error::invalid(
            "all points are equal: a surface needs an extent",
        ));
    }
    if on_a_line(ordered.grid.points(), diagonal) {
        return Err(Error::invalid(
            "all points lie on one line; a line or a single spot is not a surface",
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

/// [`prepare`], the masked points filled from their rows.
pub(crate) fn prepare_filled(
    scan: &Scan,
    masked: &[bool],
    topology: Option<Topology>,
) -> Result<Prepared> {
    let filled = rows::filled(scan, masked);
    prepare(filled.as_ref().unwrap_or(scan), topology)
}

/// Whether the points are collinear up to rounding.
fn on_a_line(points: &[DVec3], diagonal: f64) -> bool {
    let far = |from: DVec3| {
        points.iter().copied().fold(from, |best, p| {
            if p.distance_squared(from) > best.distance_squared(from) {
                p
            } else {
                best
            }
        })
    };
    let Some(&first) = points.first() else {
        return true;
    };
    let direction = (far(first) - first).normalize_or_zero();
    points
        .iter()
        .all(|&p| (p - first).cross(direction).length() <= COLLINEARITY * diagonal)
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
    let median = |gaps: &mut [f64]| nurbskin_geometry::numeric::statistics::median_in_place(gaps);
    median(&mut along_u).max(median(&mut along_v))
}

/// Fits an ordered scan.
///
/// Points that are not finite, held out or outliers are left out, and their places in the array filled from their rows.
/// Repeated points have places of their own in an array (poles, seams): they are used, and not counted as duplicates.
pub(super) fn fit(
    scan: &Scan,
    options: &SurfacingOptions,
    progress: &dyn Progress,
) -> Result<Surfaces> {
    progress.stage("order", None);
    let finite: Vec<bool> = scan.points.iter().map(|p| p.is_finite()).collect();
    let held_out = hold_out_inside(scan, options.hold_out);
    let mut masked: Vec<bool> = held_out
        .iter()
        .zip(&finite)
        .map(|(out, finite)| *out || !finite)
        .collect();
    let order = |masked: &[bool]| prepare_filled(scan, masked, options.topology);
    let choose = |prepared: &Prepared| {
        Tolerance::choose(options, scan.unit, prepared.noise, prepared.diagonal)
    };
    let mut prepared = order(&masked);
    // The search for outliers costs more than everything else here, and a clean array needs none. Resampled rows hide a
    // part of their noise.
    let noisy = match &prepared {
        Ok(prepared) => {
            prepared.ordered.resampled && prepared.noise > NOISE_SHARE * choose(prepared).value
        }
        Err(_) => true,
    };
    let mut outliers = vec![false; scan.points.len()];
    if noisy || rows::has_jumps(scan) {
        progress.stage("clean", Some(scan.points.len() as u64));
        match clean(scan, &CleanOptions::default(), progress) {
            Ok(cleaned) => {
                let found = cleaned.rejected.iter();
                for r in found.filter(|r| r.reason == Reason::Outlier) {
                    (outliers[r.index], masked[r.index]) = (true, true);
                }
                if outliers.contains(&true) {
                    prepared = order(&masked);
                }
                // Remaining outliers may still tear a row apart.
                if prepared.is_err() {
                    for index in rows::spikes(scan, &masked) {
                        (outliers[index], masked[index]) = (true, true);
                    }
                    prepared = order(&masked);
                }
                if let Ok(prepared) = &mut prepared
                    && prepared.ordered.resampled
                {
                    prepared.noise = cleaned.noise;
                }
            }
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            // Then only the order decides.
            Err(_) => {}
        }
    }
    let prepared = prepared?;
    let tolerance = choose(&prepared);
    // Some outliers are always missed: robust least squares tolerates them, interpolation does not.
    let method = if options.method == Method::Auto && outliers.contains(&true) {
        Method::Approximate
    } else {
        method(&prepared, options, tolerance.value)
    };
    let ordered = &prepared.ordered;
    let unseen: Vec<bool> = (0..scan.points.len())
        .map(|k| held_out[k] || outliers[k])
        .collect();
    let made = if method == Method::Approximate {
        approximated(scan, &prepared, &unseen, options, tolerance.value, progress)?
    } else {
        interpolated(ordered, options, tolerance.value, progress)?
    };
    for &index in &made.lost {
        outliers[index] = true;
    }
    let mut notes = Notes::default();
    notes.detail(ordered.reason.clone());
    if options.enrich > 0 && options.rarefy == Rarefaction::Auto && method == Method::Interpolate {
        notes.warn(
            "all points of the enriched grid are kept; --rarefy DEGREES or --rarefy MxN thins it out"
        );
    }
    let reason = |k: usize| match (finite[k], outliers[k]) {
        (false, _) => Some(Reason::NonFinite),
        (true, true) => Some(Reason::Outlier),
        (true, false) => None,
    };
    let indices = 0..scan.points.len();
    let used: Vec<usize> = indices.clone().filter(|&k| reason(k).is_none()).collect();
    let rejected = indices
        .filter_map(|index| reason(index).map(|reason| Rejected { index, reason }))
        .collect();
    let single = SinglePart {
        surface: made.surface,
        topology: ordered.topology,
        kept: made.kept,
        parameters: made.kind.map(Parameterization::name),
        beyond: 0,
        feet: None,
        is_spread_out: false,
        met: Met::default(),
        may_cross: false,
        trimming: None,
        network_tried: false,
    };
    let part = Part {
        shape: PartShape::Single(Box::new(single)),
        method,
        not_met: made.not_met,
        points: used.iter().map(|&k| scan.points[k]).collect(),
        held_out: used.iter().map(|&k| held_out[k]).collect(),
        used: used
            .iter()
            .map(|&k| u32::try_from(k).unwrap_or(u32::MAX))
            .collect(),
        spacing: prepared.spacing,
        noise: prepared.noise,
        triangles: None,
        is_mesh: false,
        near: OnceLock::new(),
    };
    Ok(Surfaces {
        parts: vec![part],
        tolerance,
        grid: Some(ordered.grid.counts()),
        resampled: ordered.resampled,
        objects: 0,
        rejected,
        spacing: prepared.spacing,
        noise: prepared.noise,
        notes,
    })
}

/// Interpolation, if the data and the budget allow it, unless another method is requested.
fn method(prepared: &Prepared, options: &SurfacingOptions, tolerance: f64) -> Method {
    let [m, n] = prepared.ordered.grid.counts();
    let fixed = match options.rarefy {
        Rarefaction::Off => Some(m.saturating_mul(n)),
        Rarefaction::Counts([m, n]) => Some(m.saturating_mul(n)),
        Rarefaction::Auto | Rarefaction::Threshold(_) => None,
    };
    let over_budget = fixed
        .zip(options.max_control_points)
        .is_some_and(|(count, budget)| count > budget);
    match options.method {
        Method::Auto if over_budget || prepared.noise > NOISE_SHARE * tolerance => {
            Method::Approximate
        }
        Method::Auto => Method::Interpolate,
        asked => asked,
    }
}

/// The held-out points, except for the ends of rows: without them the array would end earlier.
fn hold_out_inside(scan: &Scan, fraction: f64) -> Vec<bool> {
    let mut held_out = hold_out(scan.points.len(), fraction);
    if fraction > 0.0 {
        for row in rows::rows(scan) {
            let is_finite = |k: &&usize| scan.points[**k].is_finite();
            for &end in row
                .iter()
                .find(is_finite)
                .into_iter()
                .chain(row.iter().rfind(is_finite))
            {
                held_out[end] = false;
            }
        }
    }
    held_out
}

/// A surface made from an ordered scan.
struct Made {
    surface: NurbsSurface,
    not_met: Option<String>,
    kept: Option<[usize; 2]>,
    kind: Option<Parameterization>,
    /// Indices of the points that the fit found to be outliers.
    lost: Vec<usize>,
}

/// The fewest lines within the tolerance on all points.
pub(crate) fn to_tolerance(
    grid: &PointGrid,
    topology: Topology,
    options: &SurfacingOptions,
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

/// The method of the paper: enriched or rarefied, then interpolated.
fn interpolated(
    ordered: &grid::OrderedScan,
    options: &SurfacingOptions,
    tolerance: f64,
    progress: &dyn Progress,
) -> Result<Made> {
    let topology = ordered.topology;
    let enriched;
    let mut grid = &ordered.grid;
    if options.enrich > 0 {
        progress.stage("enrich", None);
        enriched = enrich_grid(grid, topology, options.enrich)?;
        grid = &enriched;
    }
    let budget = options.max_control_points;
    progress.stage("rarefy", None);
    let kept = match options.rarefy {
        // A grid that was enriched on purpose is only thinned on request.
        Rarefaction::Auto if options.enrich > 0 => None,
        Rarefaction::Off => None,
        Rarefaction::Auto => {
            let found = to_tolerance(grid, topology, options, tolerance, progress)?;
            let not_met = (!found.met).then(|| {
                let within = budget.map_or(String::new(), |b| format!(" within the budget of {b}"));
                format!(
                    "the best {} points{within} do not suffice",
                    found.kept.point_count()
                )
            });
            // The search solved many selections; the solution of the chosen one is the fit.
            progress.stage("fit", None);
            let [u, v] = &found.parameters;
            let u: Vec<f64> = found.kept.u.iter().map(|&i| u[i]).collect();
            let v: Vec<f64> = found.kept.v.iter().map(|&j| v[j]).collect();
            let kept = found.kept.select(grid)?;
            let surface = interpolate_at(&kept, topology, options.degree, [&u, &v])?;
            return Ok(Made {
                surface,
                not_met,
                kept: Some(found.kept.counts()),
                kind: Some(found.parameterization),
                lost: Vec::new(),
            });
        }
        Rarefaction::Threshold([u, v]) => Some(paper::rarefy(grid, topology, Thresholds { u, v })),
        Rarefaction::Counts(counts) => Some(paper::to_counts_filled(grid, topology, counts)?.1),
    };
    progress.stage("fit", None);
    let selected;
    if let Some(kept) = &kept {
        selected = kept.select(grid)?;
        grid = &selected;
    }
    let [m, n] = grid.counts();
    if let Some(budget) = budget
        && m * n > budget
    {
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
    Ok(Made {
        surface,
        not_met: None,
        kept: kept.map(|k| k.counts()),
        kind: Some(kind),
        lost: Vec::new(),
    })
}

/// Least squares through all points, each at its place in the array.
fn approximated(
    scan: &Scan,
    prepared: &Prepared,
    unseen: &[bool],
    options: &SurfacingOptions,
    tolerance: f64,
    progress: &dyn Progress,
) -> Result<Made> {
    progress.stage("fit", None);
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
    // A filled place is not a point.
    let unseen: Vec<bool> = ordered
        .places
        .iter()
        .map(|place| unseen[place.index] || !scan.points[place.index].is_finite())
        .collect();
    let (made, lost) = approximate_seen(
        (&points, &Guides::default()),
        &chart,
        &unseen,
        Asked {
            resolution: [prepared.noise, prepared.spacing],
            tolerance,
            fairness: None,
            vertices: false,
            thrifty: false,
            goal: None,
        },
        options,
        progress,
    )?;
    let not_met = match made.status {
        Status::Met => None,
        Status::NotMet(why) => Some(why.to_string()),
    };
    Ok(Made {
        surface: made.surface,
        not_met,
        kept: None,
        kind: Some(kind),
        lost: ordered
            .places
            .iter()
            .zip(lost)
            .filter(|(_, lost)| *lost)
            .map(|(place, _)| place.index)
            .collect(),
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

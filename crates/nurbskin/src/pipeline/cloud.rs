//! Clouds and meshes: cleaned, charted, approximated to the tolerance.

use super::{Fitted, Options, Times, Tolerance, hold_out, repair};
use crate::chart::plane::{PlaneChart, plane_chart};
use crate::chart::surface_mesh::chart_of_disk_mesh;
use crate::chart::{Chart, Topology};
use crate::fit::approximate::{ApproximateOptions, Approximation, Status, approximate};
use crate::progress::Progress;
use crate::scan::clean::{CleanOptions, CleanScan, clean};
use crate::scan::{Reason, Rejected, Scan};
use crate::{Error, Result};
use glam::DVec3;
use std::time::Instant;

/// Budget of control points where neither a tolerance nor a budget was asked for: what follows 0.05 % of the diagonal
/// of any smooth part, and can still be edited. A scan that needs more is told so.
const DEFAULT_BUDGET: usize = 1600;

/// Fits a scan that has no order.
pub(super) fn fit(
    scan: &Scan,
    options: &Options,
    progress: &dyn Progress,
    times: &mut Times,
) -> Result<Fitted> {
    if let Some(topology) = options.topology.filter(|&t| t != Topology::Disk) {
        return Err(Error::Unsupported(format!(
            "an unordered scan cannot be charted as a {topology} yet: only sheets that project onto a plane are; an \
             ordered scan (--grid MxN) can be a tube, a sphere or a torus",
            topology = topology.name(),
        )));
    }
    progress.stage("clean", Some(scan.points.len() as u64));
    let start = Instant::now();
    let cleaned = clean(scan, &CleanOptions::default(), progress)?;
    progress.check()?;
    times.clean += start.elapsed().as_secs_f64();

    progress.stage("order", None);
    let start = Instant::now();
    let PlaneChart { chart, beyond } = chart(&cleaned)?;
    progress.check()?;
    times.order += start.elapsed().as_secs_f64();

    progress.stage("fit", None);
    let start = Instant::now();
    let [lo, hi] = crate::point_grid::bounding_box(&cleaned.points);
    let tolerance = Tolerance::choose(options, scan, cleaned.noise, lo.distance(hi));
    let held_out = hold_out(cleaned.points.len(), options.hold_out);
    let by_default = options.tolerance.is_none() && options.max_control_points.is_none();
    let budgeted = Options {
        max_control_points: if by_default {
            Some(DEFAULT_BUDGET)
        } else {
            options.max_control_points
        },
        ..options.clone()
    };
    let unseen: Vec<bool> = held_out
        .iter()
        .zip(&beyond)
        .map(|(held_out, beyond)| *held_out || *beyond)
        .collect();
    let (approximation, lost) = approximate_seen(
        &cleaned.points,
        &chart,
        &unseen,
        [cleaned.noise, cleaned.spacing],
        tolerance.value,
        &budgeted,
        progress,
    )?;
    times.fit += start.elapsed().as_secs_f64();
    let mut rejected = cleaned.rejected;
    let outliers = cleaned.used.iter().zip(&lost).filter(|(_, lost)| **lost);
    rejected.extend(outliers.map(|(&index, _)| Rejected {
        index: index as usize,
        reason: Reason::Outlier,
    }));
    rejected.sort_by_key(|r| r.index);
    let triangles = without(&cleaned.triangles, &lost);
    let mut notes = vec![chart.reason];
    let count = beyond.iter().filter(|beyond| **beyond).count();
    if count > 0 {
        notes.push(format!(
            "{count} points lie beyond the surface's borders; the fit leaves them out, the deviation counts them"
        ));
    }
    Ok(Fitted {
        surface: approximation.surface,
        topology: chart.topology,
        method: "approximate",
        not_met: match approximation.status {
            Status::Met => None,
            Status::NotMet(why) if by_default => Some(format!(
                "{why} (without -t and --max-control-points at most {DEFAULT_BUDGET} are used)"
            )),
            Status::NotMet(why) => Some(why),
        },
        kept: None,
        parameters: None,
        grid: None,
        resampled: false,
        tolerance,
        used: kept(&cleaned.used, &lost),
        points: kept(&cleaned.points, &lost),
        held_out: kept(&held_out, &lost),
        rejected,
        spacing: cleaned.spacing,
        noise: cleaned.noise,
        triangles: Some(triangles).filter(|t| !t.is_empty()),
        notes,
    })
}

/// The chart of a sheet: that of a disk where there is a mesh that is one, else by projection.
fn chart(scan: &CleanScan) -> Result<PlaneChart> {
    let on_plane = || plane_chart(&scan.points, &scan.normals, &scan.triangles, &scan.parts);
    if scan.triangles.is_empty() {
        return on_plane();
    }
    match chart_of_disk_mesh(&scan.points, &scan.normals, &scan.triangles, &scan.parts) {
        // What the mesh is says more than what no plane can do with it.
        Err(why @ Error::Unsupported(_)) => match on_plane() {
            Err(Error::Unsupported(_)) => Err(why),
            other => other,
        },
        other => other.map(|chart| PlaneChart {
            beyond: vec![false; chart.parameters.len()],
            chart,
        }),
    }
}

/// The items that are not lost.
fn kept<T: Copy>(items: &[T], lost: &[bool]) -> Vec<T> {
    let pairs = items.iter().zip(lost);
    pairs
        .filter(|(_, lost)| !**lost)
        .map(|(item, _)| *item)
        .collect()
}

/// The triangles between points that are not lost, by their new places.
fn without(triangles: &[[u32; 3]], lost: &[bool]) -> Vec<[u32; 3]> {
    if !lost.contains(&true) {
        return triangles.to_vec();
    }
    let mut next = 0;
    let place: Vec<u32> = lost
        .iter()
        .map(|&lost| {
            next += u32::from(!lost);
            next.saturating_sub(1)
        })
        .collect();
    let whole = |t: &&[u32; 3]| t.iter().all(|&k| !lost[k as usize]);
    let moved = |t: &[u32; 3]| t.map(|k| place[k as usize]);
    triangles.iter().filter(whole).map(moved).collect()
}

/// Approximates the points that are not held out; also tells which points turned out to be outliers.
pub(super) fn approximate_seen(
    points: &[DVec3],
    chart: &Chart,
    held_out: &[bool],
    [noise, spacing]: [f64; 2],
    tolerance: f64,
    options: &Options,
    progress: &dyn Progress,
) -> Result<(Approximation, Vec<bool>)> {
    let wanted = ApproximateOptions {
        noise: Some(noise),
        degree: options.degree,
        max_control_points: options.max_control_points,
        ..ApproximateOptions::new(tolerance)
    };
    if !held_out.contains(&true) {
        let made = approximate(points, chart, &wanted, progress)?;
        let lost = repair::lost(points, &made, tolerance, spacing);
        return Ok((made, lost));
    }
    let seen = |k: &usize| !held_out[*k];
    let kept: Vec<usize> = (0..points.len()).filter(seen).collect();
    let mut lost = vec![false; points.len()];
    let points: Vec<DVec3> = kept.iter().map(|&k| points[k]).collect();
    let chart = Chart {
        parameters: kept.iter().map(|&k| chart.parameters[k]).collect(),
        ..chart.clone()
    };
    let made = approximate(&points, &chart, &wanted, progress)?;
    for (&k, out) in kept
        .iter()
        .zip(repair::lost(&points, &made, tolerance, spacing))
    {
        lost[k] = out;
    }
    Ok((made, lost))
}

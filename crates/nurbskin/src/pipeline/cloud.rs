//! Clouds and meshes: cleaned, charted, approximated to the tolerance.

use super::{Fitted, Options, Times, Tolerance, hold_out};
use crate::chart::plane::chart_on_plane;
use crate::chart::surface_mesh::chart_of_disk_mesh;
use crate::chart::{Chart, Topology};
use crate::fit::approximate::{ApproximateOptions, Approximation, Status, approximate};
use crate::progress::Progress;
use crate::scan::Scan;
use crate::scan::clean::{CleanOptions, CleanScan, clean};
use crate::{Error, Result};
use glam::DVec3;
use std::time::Instant;

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
    times.clean = start.elapsed().as_secs_f64();

    progress.stage("order", None);
    let start = Instant::now();
    let chart = chart(&cleaned)?;
    progress.check()?;
    times.order = start.elapsed().as_secs_f64();

    progress.stage("fit", None);
    let start = Instant::now();
    let [lo, hi] = crate::point_grid::bounding_box(&cleaned.points);
    let tolerance = Tolerance::choose(options, scan, cleaned.noise, lo.distance(hi));
    let held_out = hold_out(cleaned.points.len(), options.hold_out);
    let approximation = approximate_seen(
        &cleaned.points,
        &chart,
        &held_out,
        cleaned.noise,
        tolerance.value,
        options,
        progress,
    )?;
    times.fit = start.elapsed().as_secs_f64();
    Ok(Fitted {
        surface: approximation.surface,
        topology: chart.topology,
        method: "approximate",
        not_met: match approximation.status {
            Status::Met => None,
            Status::NotMet(why) => Some(why),
        },
        kept: None,
        parameters: None,
        grid: None,
        tolerance,
        used: cleaned.used,
        points: cleaned.points,
        held_out,
        rejected: cleaned.rejected,
        spacing: cleaned.spacing,
        noise: cleaned.noise,
        triangles: Some(cleaned.triangles).filter(|t| !t.is_empty()),
        notes: vec![chart.reason],
    })
}

/// The chart of a sheet: that of a disk where there is a mesh that is one, else by projection.
fn chart(scan: &CleanScan) -> Result<Chart> {
    let on_plane = || chart_on_plane(&scan.points, &scan.normals, &scan.triangles, &scan.parts);
    if scan.triangles.is_empty() {
        return on_plane();
    }
    match chart_of_disk_mesh(&scan.points, &scan.normals, &scan.triangles, &scan.parts) {
        // What the mesh is says more than what no plane can do with it.
        Err(why @ Error::Unsupported(_)) => match on_plane() {
            Err(Error::Unsupported(_)) => Err(why),
            other => other,
        },
        other => other,
    }
}

/// Approximates the points that are not held out.
pub(super) fn approximate_seen(
    points: &[DVec3],
    chart: &Chart,
    held_out: &[bool],
    noise: f64,
    tolerance: f64,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Approximation> {
    let wanted = ApproximateOptions {
        noise: Some(noise),
        degree: options.degree,
        max_control_points: options.max_control_points,
        ..ApproximateOptions::new(tolerance)
    };
    if !held_out.contains(&true) {
        return approximate(points, chart, &wanted, progress);
    }
    let seen = |k: &usize| !held_out[*k];
    let kept: Vec<usize> = (0..points.len()).filter(seen).collect();
    let points: Vec<DVec3> = kept.iter().map(|&k| points[k]).collect();
    let chart = Chart {
        parameters: kept.iter().map(|&k| chart.parameters[k]).collect(),
        ..chart.clone()
    };
    approximate(&points, &chart, &wanted, progress)
}

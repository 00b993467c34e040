//! One part of a scan: charted, approximated to the tolerance.

use super::fitted::Part;
use super::{Options, Times, repair};
use crate::chart::plane::{PlaneChart, plane_chart};
use crate::chart::shape::shape_of;
use crate::chart::surface_mesh::{ChartQuality, MeshChart, chart_of_mesh};
use crate::chart::{Chart, Topology};
use crate::fit::revolution;
use crate::fit::approximate::{ApproximateOptions, Approximation, Status, approximate};
use crate::mesh::{Manifold, holes, repair as mesh_repair, thin, triangulate};
use crate::progress::Progress;
use crate::scan::clean::CleanScan;
use crate::scan::{Reason, Rejected};
use crate::{Error, NurbsSurface, Result};
use glam::{DVec2, DVec3};
use std::time::Instant;

/// Budget of control points where neither a tolerance nor a budget was asked for: what follows 0.05 % of the diagonal
/// of any smooth part, and can still be edited. A scan that needs more is told so.
const DEFAULT_BUDGET: usize = 1600;
/// A chart is made of the scan's own mesh with at most so many vertices, ...
const MOST_VERTICES: usize = 60_000;
/// ... of a mesh of all points with at most so many, ...
const MOST_TO_CONNECT: usize = 30_000;
/// ... and else of a part of the points of about so many: enough for any shape that 1600 control points can follow.
const WANTED_VERTICES: usize = 20_000;
/// Spacings by which the ends of a tube are cut.
const INSET: f64 = 0.5;
/// A mean stretch, or a part folded over, above which another chart is tried.
const STRETCHED: f64 = 3.0;
const FOLDED: f64 = 5e-3;
/// Triangles longer than this many spacings hold the surface between their corners; at most so many steps along each.
const SUPPORT: f64 = 2.0;
const MOST_STEPS: f64 = 16.0;
/// A surface that leaves the box around its points by this part of its diagonal runs off; looked for at so many places
/// along u and v.
const RUNS_OFF: f64 = 0.1;
const PROBES: usize = 128;
/// The fairness that a surface gets that ran off with the usual one.
const CALM: f64 = 1.0;
/// Noise above this part of the spacing roughens a mesh.
const ROUGH: f64 = 0.3;
/// Points farther than this many spacings beyond a border are not part of the surface: on it they would pile up.
const BEYOND: f64 = 1.0;

/// A fitted part and what is said of it.
pub(super) struct Made {
    pub(super) part: Part,
    /// Points that the fit found to be outliers, by their index in the file.
    pub(super) lost: Vec<Rejected>,
    pub(super) notes: Vec<String>,
}

/// A surface and what its fit says of the points.
struct Shaped {
    surface: NurbsSurface,
    topology: Topology,
    not_met: Option<String>,
    lost: Vec<bool>,
    notes: Vec<String>,
}

/// Fits one part of a scan: as a surface of revolution if it is one, else as a free form.
pub(super) fn fit(
    scan: &CleanScan,
    tolerance: f64,
    options: &Options,
    progress: &dyn Progress,
    times: &mut Times,
) -> Result<Made> {
    let held_out = super::hold_out(scan.points.len(), options.hold_out);
    let start = Instant::now();
    progress.stage("order", None);
    let (turned, why_not) = revolution(scan, tolerance, &held_out, options, progress)?;
    times.order += start.elapsed().as_secs_f64();
    let shaped = match turned {
        Some(shaped) => shaped,
        None => free_form(scan, tolerance, &held_out, options, progress, times)?,
    };
    let mut notes = shaped.notes;
    notes.extend(why_not);
    let lost = shaped.lost;
    let outliers = scan.used.iter().zip(&lost).filter(|(_, lost)| **lost);
    let rejected = outliers.map(|(&index, _)| Rejected {
        index: index as usize,
        reason: Reason::Outlier,
    });
    let triangles = without(&scan.triangles, &lost);
    Ok(Made {
        lost: rejected.collect(),
        notes,
        part: Part {
            surface: shaped.surface,
            topology: shaped.topology,
            method: "approximate",
            not_met: shaped.not_met,
            kept: None,
            parameters: None,
            used: kept(&scan.used, &lost),
            points: kept(&scan.points, &lost),
            held_out: kept(&held_out, &lost),
            spacing: scan.spacing,
            noise: scan.noise,
            triangles: Some(triangles).filter(|t| !t.is_empty()),
        },
    })
}

/// The exact surface of revolution, if the points are a scan of one and nothing else is asked for; else why not, where
/// it was a near thing.
fn revolution(
    scan: &CleanScan,
    tolerance: f64,
    held_out: &[bool],
    options: &Options,
    progress: &dyn Progress,
) -> Result<(Option<Shaped>, Option<String>)> {
    if options.degree != Options::default().degree {
        return Ok((None, None));
    }
    let made = revolution::fit(
        &kept(&scan.points, held_out),
        &kept(&scan.normals, held_out),
        tolerance,
        scan.noise,
        scan.spacing,
        progress,
    );
    let fit = match made {
        Ok(revolution::Outcome::Fitted(fit)) => fit,
        Ok(revolution::Outcome::Refused(_)) | Err(Error::NoSolution(_) | Error::Invalid(_)) => {
            return Ok((None, None));
        }
        Err(other) => return Err(other),
    };
    let count: usize = fit.surface.distinct_counts().into_iter().product();
    if count > options.max_control_points.unwrap_or(DEFAULT_BUDGET) {
        return Ok((None, None));
    }
    if options.topology.is_some_and(|asked| asked != fit.topology) {
        let why = format!("{}, which is not the {} asked for", fit.reason, fit.topology.name());
        return Ok((None, Some(why)));
    }
    let robust = repair::Robust {
        residuals: &fit.residuals,
        weights: None,
        sigma: fit.sigma,
    };
    let places = (0..scan.points.len()).filter(|&k| !held_out[k]);
    let mut lost = vec![false; scan.points.len()];
    let found = repair::lost(&kept(&scan.points, held_out), &robust, tolerance, scan.spacing);
    for (k, out) in places.zip(found) {
        lost[k] = out;
    }
    Ok((
        Some(Shaped {
            surface: fit.surface,
            topology: fit.topology,
            not_met: None,
            lost,
            notes: vec![fit.reason],
        }),
        None,
    ))
}

/// Charted, and approximated to the tolerance.
fn free_form(
    scan: &CleanScan,
    tolerance: f64,
    held_out: &[bool],
    options: &Options,
    progress: &dyn Progress,
    times: &mut Times,
) -> Result<Shaped> {
    let start = Instant::now();
    let Charted {
        chart,
        beyond,
        support,
        mut notes,
    } = chart(scan, options.topology, progress)?;
    progress.check()?;
    times.order += start.elapsed().as_secs_f64();

    progress.stage("fit", None);
    let start = Instant::now();
    let by_default = options.tolerance.is_none() && options.max_control_points.is_none();
    let budgeted = Options {
        max_control_points: if by_default {
            Some(DEFAULT_BUDGET)
        } else {
            options.max_control_points
        },
        ..options.clone()
    };
    let either = held_out.iter().zip(&beyond);
    let mut unseen: Vec<bool> = either.map(|(out, beyond)| *out || *beyond).collect();
    // What holds the surface between the points takes part in the fit, and in nothing else.
    let mut points = scan.points.clone();
    let mut chart = chart;
    for (point, parameter) in support {
        points.push(point);
        chart.parameters.push(parameter);
        unseen.push(false);
    }
    let fitted = |fairness: Option<f64>| {
        let asked = Asked {
            resolution: [scan.noise, scan.spacing],
            tolerance,
            fairness,
        };
        approximate_seen(&points, &chart, &unseen, asked, &budgeted, progress)
    };
    let (mut approximation, mut lost) = fitted(None)?;
    if runs_off(&approximation.surface, &scan.points) {
        (approximation, lost) = fitted(Some(CALM))?;
        if runs_off(&approximation.surface, &scan.points) {
            return Err(Error::NoSolution(
                "the surface runs off where the scan has no data: its border is too ragged, or too few points lie \
                 along it; trim the scan"
                    .into(),
            ));
        }
    }
    lost.truncate(scan.points.len());
    times.fit += start.elapsed().as_secs_f64();
    let count = beyond.iter().filter(|beyond| **beyond).count();
    if count > 0 {
        notes.push(format!(
            "{count} points lie beyond the surface's borders; the fit leaves them out, the deviation counts them"
        ));
    }
    Ok(Shaped {
        surface: approximation.surface,
        topology: chart.topology,
        not_met: match approximation.status {
            Status::Met => None,
            Status::NotMet(why) if by_default => Some(format!(
                "{why} (without -t and --max-control-points at most {DEFAULT_BUDGET} are used)"
            )),
            Status::NotMet(why) => Some(why),
        },
        lost,
        notes,
    })
}

/// (u, v) for every point, and what was found on the way.
struct Charted {
    chart: Chart,
    /// Points past the surface's borders.
    beyond: Vec<bool>,
    /// Places on the mesh, and in the domain, where its points are far apart.
    support: Vec<(DVec3, DVec2)>,
    notes: Vec<String>,
}

/// By projection where there is no mesh and a plane will do, else over a mesh; where that comes out badly, as over the
/// frayed borders of a range image, by projection after all.
fn chart(
    scan: &CleanScan,
    topology: Option<Topology>,
    progress: &dyn Progress,
) -> Result<Charted> {
    let sheet = topology.is_none_or(|t| t == Topology::Disk);
    if scan.triangles.is_empty() && sheet {
        match projected(scan) {
            Err(Error::Unsupported(_)) => {}
            other => return other,
        }
    }
    let (over_mesh, quality) = chart_over_mesh(scan, topology, progress)?;
    let poor = quality.stretch > STRETCHED || quality.folded > FOLDED;
    if poor && sheet && over_mesh.chart.topology == Topology::Disk {
        match projected(scan) {
            Err(Error::Unsupported(_)) => {}
            other => return other,
        }
    }
    if quality.folded > FOLDED {
        return Err(Error::Unsupported(format!(
            "the surface cannot be laid out: {:.1} % of it would fold over; its border is too ragged or it is crumpled",
            100.0 * quality.folded
        )));
    }
    Ok(over_mesh)
}

/// The chart by projection onto the best plane.
fn projected(scan: &CleanScan) -> Result<Charted> {
    let PlaneChart { chart, beyond } =
        plane_chart(&scan.points, &scan.normals, &scan.triangles, &scan.parts)?;
    let notes = vec![chart.reason.clone()];
    Ok(Charted {
        chart,
        beyond,
        support: Vec::new(),
        notes,
    })
}

/// 1. A mesh, repaired. 2. What shape it is. 3. Its holes filled, its chart, and every point in it.
fn chart_over_mesh(
    scan: &CleanScan,
    topology: Option<Topology>,
    progress: &dyn Progress,
) -> Result<(Charted, ChartQuality)> {
    let repaired = if scan.triangles.is_empty() || scan.points.len() > MOST_VERTICES {
        let (points, triangles) = meshed(scan, progress)?;
        mesh_repair::repair(&points, &triangles, progress)?
    } else {
        mesh_repair::repair(&scan.points, &scan.triangles, progress)?
    };
    let mut notes = repaired.notes;
    let shape = shape_of(&repaired.manifold, topology)?;
    notes.push(shape.reason);
    let (mesh, filled) = holes::fill(repaired.manifold, &shape.holes);
    if !filled.is_empty() {
        let area: f64 = filled.iter().map(|hole| hole.area).sum();
        notes.push(format!(
            "{} holes are covered, {:.2} % of the area",
            filled.len(),
            100.0 * area / mesh.area()
        ));
    }
    let charted = chart_of_mesh(&mesh, progress)?;
    let placed = charted.place(&mesh, &scan.points, Some(&scan.normals))?;
    // The ragged rims of a tube are cut where hardly a gap is left between their teeth.
    let inset = match charted.topology {
        Topology::Tube => (INSET * scan.spacing / charted.size[0]).min(0.1),
        _ => 0.0,
    };
    let within = |t: DVec2| DVec2::new((t.x - inset) / (1.0 - 2.0 * inset), t.y);
    let past = |t: DVec2| !(0.0..=1.0).contains(&within(t).x);
    let beyond: Vec<bool> = placed
        .beyond
        .iter()
        .zip(&placed.parameters)
        .map(|(&by, &t)| by > BEYOND * scan.spacing || past(t))
        .collect();
    let inside = |t: &DVec2| within(*t).clamp(DVec2::ZERO, DVec2::ONE);
    let mut chart = charted.chart_of(placed.parameters.iter().map(inside).collect());
    chart.size[0] *= 1.0 - 2.0 * inset;
    let mut support = support(&mesh, &charted, scan.spacing);
    support.retain(|(_, t)| !past(*t));
    for (_, t) in &mut support {
        *t = inside(t);
    }
    notes.push(chart.reason.clone());
    let quality = charted.quality;
    Ok((
        Charted {
            beyond,
            chart,
            support,
            notes,
        },
        quality,
    ))
}

/// Places on the triangles that are large against the spacing, and in holes that were filled, each with its parameters:
/// there the mesh says where the surface is, and no point does.
fn support(mesh: &Manifold, chart: &MeshChart, spacing: f64) -> Vec<(DVec3, DVec2)> {
    let closed = chart.topology.closed();
    let inside = |t: DVec2| {
        let within = |x: f64, closed: bool| if closed { x.rem_euclid(1.0) } else { x };
        let t = DVec2::new(within(t.x, closed[0]), within(t.y, closed[1]));
        t.clamp(DVec2::ZERO, DVec2::ONE)
    };
    let mut places = Vec::new();
    for (triangle, corners) in mesh.triangles.iter().zip(&chart.corners) {
        let [a, b, c] = triangle.map(|k| mesh.points[k as usize]);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let filled = triangle.iter().any(|&k| mesh.source[k as usize].is_none());
        let steps = (longest / (SUPPORT * spacing)).ceil().clamp(1.0, MOST_STEPS);
        if steps <= 1.0 && !filled {
            continue;
        }
        // The middles of the small triangles that stand upright.
        let [p, q, r] = *corners;
        let mut i = 0.0;
        while i < steps {
            let mut j = 0.0;
            while i + j < steps {
                let (f, g) = ((i + 1.0 / 3.0) / steps, (j + 1.0 / 3.0) / steps);
                places.push((
                    a + (b - a) * f + (c - a) * g,
                    inside(p + (q - p) * f + (r - p) * g),
                ));
                j += 1.0;
            }
            i += 1.0;
        }
    }
    places
}

/// Whether a surface leaves the box around its points by far.
fn runs_off(surface: &NurbsSurface, points: &[DVec3]) -> bool {
    let [lo, hi] = crate::point_grid::bounding_box(points);
    let margin = RUNS_OFF * lo.distance(hi);
    let [(a, b), (c, d)] = surface.domain();
    let at = |k: usize| (k as f64 + 0.5) / PROBES as f64;
    (0..PROBES * PROBES).any(|k| {
        let (u, v) = (at(k % PROBES), at(k / PROBES));
        let p = surface.point(a + (b - a) * u, c + (d - c) * v);
        p.cmplt(lo - margin).any() || p.cmpgt(hi + margin).any()
    })
}

/// Triangles between the points, or a part of them where there are many or noise roughens them.
fn meshed(scan: &CleanScan, progress: &dyn Progress) -> Result<(Vec<DVec3>, Vec<[u32; 3]>)> {
    let (points, normals) = (&scan.points, &scan.normals);
    let rough = scan.noise > ROUGH * scan.spacing;
    if points.len() <= MOST_TO_CONNECT && !rough {
        let triangles = triangulate::triangulate(points, normals, progress)?;
        return Ok((points.clone(), triangles));
    }
    let wanted = WANTED_VERTICES.min(points.len() / 2);
    let radius = thin::radius_for(wanted, points.len(), scan.spacing).max(scan.noise / ROUGH);
    let kept = thin::thin(points, Some(normals), radius);
    let smoothed = thin::smooth(points, normals, &kept, radius, progress)?;
    let triangles = triangulate::triangulate(&smoothed.points, &smoothed.normals, progress)?;
    Ok((smoothed.points, triangles))
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

/// What an approximation shall reach, and with which points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked {
    /// Noise and spacing of the points.
    pub(super) resolution: [f64; 2],
    pub(super) tolerance: f64,
    /// Other than the usual fairness.
    pub(super) fairness: Option<f64>,
}

/// Approximates the points that are not held out; also tells which points turned out to be outliers.
pub(super) fn approximate_seen(
    points: &[DVec3],
    chart: &Chart,
    held_out: &[bool],
    asked: Asked,
    options: &Options,
    progress: &dyn Progress,
) -> Result<(Approximation, Vec<bool>)> {
    let Asked {
        resolution: [noise, spacing],
        tolerance,
        fairness,
    } = asked;
    let usual = ApproximateOptions::new(tolerance);
    let wanted = ApproximateOptions {
        noise: Some(noise),
        degree: options.degree,
        max_control_points: options.max_control_points,
        fairness: fairness.unwrap_or(usual.fairness),
        // Charts here are even as they are; corrected parameters leave parts of the domain without points.
        correct: false,
        ..usual
    };
    if !held_out.contains(&true) {
        let made = approximate(points, chart, &wanted, progress)?;
        let lost = repair::lost(points, &(&made).into(), tolerance, spacing);
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
        .zip(repair::lost(&points, &(&made).into(), tolerance, spacing))
    {
        lost[k] = out;
    }
    Ok((made, lost))
}

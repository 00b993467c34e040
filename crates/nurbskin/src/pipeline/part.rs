//! One part of a scan: charted, approximated to the tolerance.

use super::fitted::Part;
use super::{Options, Times, Tolerance, free_form, repair};
use crate::deviation::verdict::USUAL_SHARE;
use glam::{DVec2, DVec3};
use nurbskin_cad::check::crossings;
use nurbskin_cad::trim::Trimming;
use nurbskin_fit::chart::{Chart, Topology};
use nurbskin_fit::fit::approximate::trade::Met;
use nurbskin_fit::fit::approximate::{
    ApproximateOptions, Approximation, Goal, Guides, approximate_guided,
};
use nurbskin_fit::fit::revolution;
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::nurbs::closest::ClosestPoint;
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, NurbsSurface, Result};
use nurbskin_scan::clean::CleanScan;
use nurbskin_scan::{Reason, Rejected};
use std::borrow::Cow;
use std::sync::OnceLock;
use std::time::Instant;

/// Most control points where neither a tolerance nor a budget was asked for. Control points have to pay, so that few fits come
/// near it; a surface of so many can still be edited, and is fitted and checked in seconds.
pub(super) const DEFAULT_BUDGET: usize = 5000;
/// Standard deviations, or a tolerance if that is more, within which a surface of revolution must have its points, ...
const REACH_SIGMAS: f64 = 5.0;
/// ... but for this part of them where they are noisy.
const MISSED: f64 = 5e-3;
/// Factors of a tolerance that is missed with which a surface of revolution is tried.
const LOOSER: [f64; 3] = [2.0, 4.0, 8.0];

/// A fitted part and what is said of it.
pub(super) struct Made {
    pub(super) part: Part,
    /// The points, by place in the part, of bits of its mesh that the surface is not for.
    pub(super) loose: Vec<bool>,
    /// Points that the fit found to be outliers, by their index in the file.
    pub(super) lost: Vec<Rejected>,
    pub(super) notes: Notes,
}

/// A surface and what its fit says of the points.
pub(super) struct Shaped {
    pub(super) surface: NurbsSurface,
    /// Places where it intersects itself, as far as that was looked for.
    pub(super) crossings: usize,
    /// What trimming leaves of it, if that was needed to see where it intersects itself.
    pub(super) trimming: Option<Trimming>,
    /// Whether it could.
    pub(super) may_cross: bool,
    pub(super) topology: Topology,
    /// Distance along the normal of 95 % of the points.
    pub(super) error: f64,
    pub(super) not_met: Option<String>,
    /// How many points lie beyond the borders.
    pub(super) beyond: usize,
    pub(super) lost: Vec<bool>,
    /// Points of bits that the surface is not for; none where there are no such bits.
    pub(super) loose: Vec<bool>,
    /// Nearest places of the points, as far as the fit knows them.
    pub(super) feet: Option<Vec<DVec2>>,
    /// The surfaces that the fit met on its way.
    pub(super) met: Met,
    pub(super) notes: Notes,
}

/// Fits one part of a scan: as a surface of revolution if it is one, else as a free form. With `vertices` its points are
/// those of a mesh that came as one.
pub(super) fn fit(
    scan: &CleanScan,
    vertices: bool,
    tolerance: &Tolerance,
    options: &Options,
    progress: &dyn Progress,
    times: &mut Times,
) -> Result<Made> {
    let held_out = super::hold_out(scan.points.len(), options.hold_out);
    let start = Instant::now();
    progress.stage("order", None);
    let told = tolerance.told(scan.noise);
    let (turned, why_not) = revolution(scan, told, &held_out, options, progress)?;
    times.order += start.elapsed().as_secs_f64();
    let shaped = match turned {
        Some(shaped) => shaped,
        None => {
            let free = free_form::fit(
                scan, vertices, tolerance, &held_out, options, progress, times,
            )?;
            turned_instead(free, scan, tolerance, &held_out, options, progress)?
        }
    };
    let mut notes = shaped.notes;
    notes.details.extend(why_not);
    let mut lost = shaped.lost;
    for (lost, loose) in lost.iter_mut().zip(&shaped.loose) {
        *lost &= !loose;
    }
    let outliers = scan.used.iter().zip(&lost).filter(|(_, lost)| **lost);
    let rejected = outliers.map(|(&index, _)| Rejected {
        index: index as usize,
        reason: Reason::Outlier,
    });
    let rejected = rejected.collect();
    for (lost, loose) in lost.iter_mut().zip(&shaped.loose) {
        *lost |= loose;
    }
    let triangles = without(&scan.triangles, &lost);
    Ok(Made {
        lost: rejected,
        loose: shaped.loose,
        notes,
        part: Part {
            surface: shaped.surface,
            topology: shaped.topology,
            method: "approximate",
            not_met: shaped.not_met,
            beyond: shaped.beyond,
            kept: None,
            parameters: None,
            used: kept(&scan.used, &lost),
            points: kept(&scan.points, &lost),
            feet: shaped.feet.map(|feet| kept(&feet, &lost)),
            met: shaped.met,
            held_out: kept(&held_out, &lost),
            spacing: scan.spacing,
            noise: scan.noise,
            triangles: Some(triangles).filter(|t| !t.is_empty()),
            is_mesh: vertices,
            trimming: shaped.trimming,
            may_cross: shaped.may_cross,
            near: OnceLock::new(),
        },
    })
}

/// A free form that misses the tolerance asked for, or the surface of revolution that a looser one allows, if that is
/// closer to the points.
fn turned_instead(
    free: Shaped,
    scan: &CleanScan,
    tolerance: &Tolerance,
    held_out: &[bool],
    options: &Options,
    progress: &dyn Progress,
) -> Result<Shaped> {
    let Some(asked) = tolerance.asked().filter(|_| free.not_met.is_some()) else {
        return Ok(free);
    };
    let off = |surface: &NurbsSurface| -> Result<f64> {
        let closest = ClosestPoint::new(surface)?;
        let mut distances = each(scan.points.len(), |k| {
            closest.closest(scan.points[k]).distance
        });
        let within = options.within.unwrap_or(USUAL_SHARE);
        Ok(quantile_in_place(&mut distances, within))
    };
    for looser in LOOSER {
        let (turned, _) = revolution(scan, looser * asked, held_out, options, progress)?;
        if let Some(mut turned) = turned {
            if off(&turned.surface)? < off(&free.surface)? {
                turned.not_met = free.not_met;
                return Ok(turned);
            }
            break;
        }
    }
    Ok(free)
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
    let points = seen(&scan.points, held_out);
    let normals = seen(&scan.normals, held_out);
    let made = revolution::fit(
        &points,
        &normals,
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
        let why = format!(
            "{}, which is not the {} asked for",
            fit.reason,
            fit.topology.name()
        );
        return Ok((None, Some(why)));
    }
    // A profile that passes the axis, or turns back on itself, is no part of a solid.
    let [low, high] = bounding_box(&scan.points);
    if !crossings(&fit.surface, low.distance(high), &|_| true).is_empty() {
        return Ok((
            None,
            Some(format!("{}, which would intersect itself", fit.reason)),
        ));
    }
    let robust = repair::Robust {
        residuals: &fit.residuals,
        weights: None,
        sigma: fit.sigma,
    };
    let places = (0..scan.points.len()).filter(|&k| !held_out[k]);
    let mut lost = vec![false; scan.points.len()];
    let found = repair::lost(&points, &robust, tolerance, scan.spacing);
    for (k, out) in places.zip(found) {
        lost[k] = out;
    }
    // What was accepted by its symmetry must also reach every point, at the rims above all. Where it is a whole turn
    // that is known.
    let reach = tolerance.max(REACH_SIGMAS * scan.noise);
    let off = |k: usize| {
        if fit.sector.whole() {
            fit.residuals[k].abs()
        } else {
            let foot = fit.parameters[k];
            fit.surface.point(foot.x, foot.y).distance(points[k])
        }
    };
    let places = (0..scan.points.len()).filter(|&k| !held_out[k]);
    let missed = places
        .enumerate()
        .filter(|&(seen, k)| !lost[k] && off(seen) > reach);
    if missed.count() as f64 > MISSED * scan.points.len() as f64 * scan.noise / reach {
        return Ok((None, None));
    }
    Ok((
        Some(Shaped {
            surface: fit.surface,
            crossings: 0,
            trimming: None,
            may_cross: false,
            topology: fit.topology,
            error: fit.sigma,
            not_met: None,
            beyond: 0,
            lost,
            loose: Vec::new(),
            feet: (!held_out.contains(&true)).then_some(fit.parameters),
            met: Met::default(),
            notes: Notes {
                details: vec![fit.reason],
                ..Notes::default()
            },
        }),
        None,
    ))
}

/// The items that are not held out.
fn seen<'a, T: Copy>(items: &'a [T], held_out: &[bool]) -> Cow<'a, [T]> {
    if held_out.contains(&true) {
        Cow::Owned(kept(items, held_out))
    } else {
        Cow::Borrowed(items)
    }
}

/// The items that are not lost.
pub(super) fn kept<T: Copy>(items: &[T], lost: &[bool]) -> Vec<T> {
    let pairs = items.iter().zip(lost);
    pairs
        .filter(|(_, lost)| !**lost)
        .map(|(item, _)| *item)
        .collect()
}

/// The triangles between points that are not lost, by their new places.
pub(super) fn without(triangles: &[[u32; 3]], lost: &[bool]) -> Vec<[u32; 3]> {
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
    /// Whether the points are vertices of a mesh.
    pub(super) vertices: bool,
    /// Whether control points have to pay.
    pub(super) thrifty: bool,
    /// A tolerance asked for.
    pub(super) goal: Option<Goal>,
}

/// Approximates the points that are not held out, with what else is known of the surface; also
/// tells which points turned out to be outliers.
pub(super) fn approximate_seen(
    (points, guides): (&[DVec3], &Guides<'_>),
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
        vertices,
        thrifty,
        goal,
    } = asked;
    let usual = ApproximateOptions::new(tolerance);
    let wanted = ApproximateOptions {
        goal,
        noise: Some(noise),
        degree: options.degree,
        max_control_points: options.max_control_points,
        thrifty,
        fairness: fairness.unwrap_or(usual.fairness),
        // Charts here are even as they are; corrected parameters leave parts of the domain without points.
        correct: false,
        vertices,
        ..usual
    };
    if !held_out.contains(&true) {
        let made = approximate_guided(points, chart, guides, &wanted, progress)?;
        let lost = repair::lost(points, &(&made).into(), tolerance, spacing);
        return Ok((made, lost));
    }
    let seen = |k: &usize| !held_out[*k];
    let kept: Vec<usize> = (0..points.len()).filter(seen).collect();
    let mut lost = vec![false; points.len()];
    let points = each(kept.len(), |k| points[kept[k]]);
    let chart = Chart {
        parameters: each(kept.len(), |k| chart.parameters[kept[k]]),
        topology: chart.topology,
        size: chart.size,
        reason: chart.reason.clone(),
    };
    let guides = Guides {
        own: guides.own.map(|own| kept.partition_point(|&k| k < own)),
        ..*guides
    };
    let made = approximate_guided(&points, &chart, &guides, &wanted, progress)?;
    for (&k, out) in kept
        .iter()
        .zip(repair::lost(&points, &(&made).into(), tolerance, spacing))
    {
        lost[k] = out;
    }
    Ok((made, lost))
}

//! One part of a scan: charted, approximated to the tolerance.

use super::{Method, Part, SurfacingOptions, Tolerance, free_form, outliers};
use glam::{DVec2, DVec3};
use nurbskin_cad::trim::Trimming;
use nurbskin_fit::chart::{Chart, Topology};
use nurbskin_fit::fit::approximate::trade::Met;
use nurbskin_fit::fit::approximate::{
    ApproximateOptions, Approximation, Goal, Guides, approximate_guided,
};
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{NurbsSurface, Result};
use nurbskin_scan::clean::CleanScan;
use nurbskin_scan::{Reason, Rejected};
use std::borrow::Cow;
use std::sync::OnceLock;

/// Most control points where neither a tolerance nor a budget was asked for. Control points have to pay, so that few fits come
/// near it; a surface of so many can still be edited, and is fitted and checked in seconds.
pub(super) const DEFAULT_BUDGET: usize = 5000;

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

/// A part of a scan, and what is asked of its surface.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub(super) scan: &'a CleanScan,
    /// Whether its points are those of a mesh that came as one.
    pub(super) vertices: bool,
    pub(super) tolerance: &'a Tolerance,
    /// Which of the points the fit must not see.
    pub(super) held_out: &'a [bool],
    pub(super) options: &'a SurfacingOptions,
    pub(super) progress: &'a dyn Progress,
}

/// Fits one part of a scan: as a surface of revolution if it is one, else as a free form. With `vertices` its points are
/// those of a mesh that came as one.
pub(super) fn fit(
    scan: &CleanScan,
    vertices: bool,
    tolerance: &Tolerance,
    options: &SurfacingOptions,
    progress: &dyn Progress,
) -> Result<Made> {
    let held_out = super::hold_out(scan.points.len(), options.hold_out);
    let task = Task {
        scan,
        vertices,
        tolerance,
        held_out: &held_out,
        options,
        progress,
    };
    progress.stage("order", None);
    let (turned, why_not) = task.turned(tolerance.told(scan.noise))?;
    let shaped = match turned {
        Some(shaped) => shaped,
        None => task.turned_instead(free_form::fit(task)?)?,
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
            method: Method::Approximate,
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

/// The items that are not held out.
pub(super) fn seen<'a, T: Copy>(items: &'a [T], held_out: &[bool]) -> Cow<'a, [T]> {
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
    options: &SurfacingOptions,
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
        let lost = outliers::lost(points, &(&made).into(), tolerance, spacing);
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
        .zip(outliers::lost(&points, &(&made).into(), tolerance, spacing))
    {
        lost[k] = out;
    }
    Ok((made, lost))
}

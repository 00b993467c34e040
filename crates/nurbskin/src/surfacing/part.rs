//! One part of a scan with one surface: an exact surface of revolution where it is one, otherwise a free form.
//!
//! `single` chooses between `turned` and `free_form`, removes the outliers that the fit found, and returns the [`Part`]
//! with its points; `choice` decides between it and a network. `approximate_seen` approximates the points that are not held out. Ours.

use super::network::AUTOMATIC_SHARE;
use super::surfaces::{PartShape, SinglePart};
use super::{Method, Part, SurfacingOptions, Tolerance, choice, free_form, outliers};
use glam::{DVec2, DVec3};
use nurbskin_cad::trim::Trimming;
use nurbskin_fit::chart::{Chart, Topology};
use nurbskin_fit::charting::{ChartOptions, Charts, PartMesh, PointState, mesh_of};
use nurbskin_fit::fit::approximate::trade::Met;
use nurbskin_fit::fit::approximate::{
    ApproximateOptions, Approximation, Goal, Guides, approximate_guided,
};
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{NurbsSurface, Result};
use nurbskin_network::layout::lines::{FeatureLines, feature_lines};
use nurbskin_scan::clean::CleanScan;
use nurbskin_scan::{Reason, Rejected};
use std::borrow::Cow;
use std::sync::OnceLock;

/// Most control points where neither a tolerance nor a budget was asked for. Count.
/// Guard: a surface of so many can still be edited, and is fitted and checked in seconds. Control points have to pay,
/// so that few fits come near it; with 1600 some ended while they still paid.
pub(super) const AUTOMATIC_BUDGET: usize = 5000;

/// Share of the points of a part that one surface may leave without any before a network is tried. Dimensionless.
/// Derived: the share that an aim lets lie anywhere.
pub(super) const MOST_STRANDED: f64 = 1.0 - AUTOMATIC_SHARE;

/// A fitted part with its notes.
pub(super) struct Made {
    pub(super) part: Part,
    /// Which points, by index in the part, belong to bits of its mesh that the surface does not cover.
    pub(super) detached: Vec<bool>,
    /// Points that the fit found to be outliers, by their index in the file.
    pub(super) lost: Vec<Rejected>,
    pub(super) notes: Notes,
    /// Number of places where it folds or intersects itself, if checked; 0 if it is sound.
    pub(super) crossings: usize,
    /// Whether it intersects itself and is too far from the points to be mended before the network is tried.
    pub(super) is_unmended: bool,
    /// Whether it is a network that does not intersect itself only because faces are left out, more than an open scan may lack.
    pub(super) is_opened: bool,
    /// Share of the points of the part that get no surface if this one stays: they are in bits that it does not cover, too small for
    /// surfaces of their own. 0 where few points are not covered.
    pub(super) stranded: f64,
    /// Distance of 95 % of the points.
    pub(super) error: f64,
}

/// A surface with the results of its fit.
pub(super) struct Shaped {
    pub(super) surface: NurbsSurface,
    /// Number of self-intersections, if checked.
    pub(super) crossings: usize,
    /// Whether whole regions of it intersect each other.
    pub(super) crosses_widely: bool,
    /// Whether it intersects itself and is too far from the points to be mended before the network is tried.
    pub(super) is_unmended: bool,
    /// Its trimming, if the check for self-intersections needed it.
    pub(super) trimming: Option<Trimming>,
    /// Whether it can intersect itself.
    pub(super) may_cross: bool,
    pub(super) topology: Topology,
    /// Distance along the normal of 95 % of the points.
    pub(super) error: f64,
    /// Whether it continues beyond the outline of a sheet that was spread out.
    pub(super) is_spread_out: bool,
    pub(super) not_met: Option<String>,
    /// How many points lie beyond the borders.
    pub(super) beyond: usize,
    /// The state of each point.
    pub(super) states: Vec<PointState>,
    /// Foot points, if the fit knows them.
    pub(super) feet: Option<Vec<DVec2>>,
    /// The surfaces that the fit met on its way.
    pub(super) met: Met,
    pub(super) notes: Notes,
}

/// A part of a scan, and the requirements on its surface.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub(super) scan: &'a CleanScan,
    /// Whether its points are the vertices of an input mesh.
    pub(super) vertices: bool,
    /// The fewest points that get a surface of their own.
    pub(super) least: usize,
    pub(super) tolerance: &'a Tolerance,
    /// Which of the points are excluded from the fit.
    pub(super) held_out: &'a [bool],
    pub(super) options: &'a SurfacingOptions,
    pub(super) progress: &'a dyn Progress,
    /// Whether a surface that misses the tolerance is of no use, nor a network that is far from sound after one attempt.
    pub(super) only_met: bool,
    /// Distance of 95 % of the points beyond which no other fits are tried for a surface that intersects itself.
    pub(super) worth_mending: f64,
    /// The mesh of its scan, once it is known.
    pub(super) mesh: &'a OnceLock<LinedMesh>,
    /// The charts of its scan.
    pub(super) charts: &'a Charts<'a>,
}

/// The mesh of a part, and the lines that stay sharp on it.
#[derive(Debug)]
pub(super) struct LinedMesh {
    pub(super) mesh: PartMesh,
    pub(super) lines: FeatureLines,
}

impl<'a> Task<'a> {
    /// The mesh of the scan, with its small holes filled, and its feature lines. Made once.
    ///
    /// # Errors
    /// As [`mesh_of`].
    pub(super) fn lined_mesh(&self) -> Result<&'a LinedMesh> {
        if let Some(known) = self.mesh.get() {
            return Ok(known);
        }
        let mesh = mesh_of(self.scan, self.progress)?;
        self.progress.check()?;
        // The mesh may have fewer vertices than the scan: its own edges are its spacing.
        let lines = feature_lines(&mesh.manifold, 0.0, self.scan.noise, self.options.sharp);
        Ok(self.mesh.get_or_init(|| LinedMesh { mesh, lines }))
    }
}

impl Task<'_> {
    /// The share of the points that get no surface if these are not covered: those in bits too small for surfaces of their own. 0 where
    /// few are not covered. O(n log n).
    pub(super) fn stranded(&self, detached: &[bool]) -> f64 {
        let count = self.scan.points.len() as f64;
        let off = detached.iter().filter(|off| **off).count();
        if off as f64 <= MOST_STRANDED * count {
            return 0.0;
        }
        let (_, bits) = self.scan.rest(detached, self.least);
        let stranded: usize = bits.iter().map(|bit| bit.indices.len()).sum();
        stranded as f64 / count
    }
}

impl Made {
    /// A part with this shape; `states` are those of the points of the task.
    pub(super) fn new(
        task: &Task<'_>,
        states: &[PointState],
        shape: PartShape,
        not_met: Option<String>,
        notes: Notes,
    ) -> Self {
        let scan = task.scan;
        let outliers = scan.used.iter().zip(states);
        let outliers = outliers.filter(|(_, state)| **state == PointState::Outlier);
        let lost = outliers.map(|(&index, _)| Rejected {
            index: index as usize,
            reason: Reason::Outlier,
        });
        let gone: Vec<bool> = states.iter().map(|&state| is_gone(state)).collect();
        let detached = states.iter().map(|&state| state == PointState::Detached);
        let detached: Vec<bool> = detached.collect();
        let triangles = without(&scan.triangles, &gone);
        Self {
            lost: lost.collect(),
            stranded: task.stranded(&detached),
            detached,
            notes,
            part: Part {
                shape,
                method: Method::Approximate,
                not_met,
                used: kept(&scan.used, &gone),
                points: kept(&scan.points, &gone),
                held_out: kept(task.held_out, &gone),
                spacing: scan.spacing,
                noise: scan.noise,
                triangles: Some(triangles).filter(|t| !t.is_empty()),
                is_mesh: task.vertices,
                near: OnceLock::new(),
            },
            crossings: 0,
            is_unmended: false,
            is_opened: false,
            error: 0.0,
        }
    }
}

/// Fits one part of a scan with one surface, or with a network of faces. With `vertices` its points are the vertices of
/// an input mesh. Bits of fewer than `least` points that the surface does not cover get none.
pub(super) fn fit(
    scan: &CleanScan,
    vertices: bool,
    least: usize,
    tolerance: &Tolerance,
    options: &SurfacingOptions,
    progress: &dyn Progress,
) -> Result<Made> {
    let held_out = super::hold_out(scan.points.len(), options.hold_out);
    choice::fit(&Task {
        scan,
        vertices,
        least,
        tolerance,
        held_out: &held_out,
        options,
        progress,
        only_met: false,
        worth_mending: f64::INFINITY,
        mesh: &OnceLock::new(),
        charts: &Charts::new(
            scan,
            ChartOptions {
                topology: options.topology,
                vertices,
            },
        ),
    })
}

/// Fits a part with one surface: as a surface of revolution if it is one, otherwise as a free form.
pub(super) fn single(task: &Task<'_>) -> Result<Made> {
    let Task {
        scan,
        tolerance,
        progress,
        ..
    } = *task;
    progress.stage("order", None);
    let (turned, why_not) = task.turned(tolerance.told(scan.noise))?;
    let shaped = match turned {
        Some(shaped) => shaped,
        None => task.turned_instead(free_form::fit(*task)?)?,
    };
    let mut notes = shaped.notes;
    notes.details.extend(why_not);
    let states = &shaped.states;
    let gone: Vec<bool> = states.iter().map(|&state| is_gone(state)).collect();
    let surface = SinglePart {
        surface: shaped.surface,
        topology: shaped.topology,
        kept: None,
        parameters: None,
        beyond: shaped.beyond,
        feet: shaped.feet.map(|feet| kept(&feet, &gone)),
        is_spread_out: shaped.is_spread_out,
        met: shaped.met,
        may_cross: shaped.may_cross,
        trimming: shaped.trimming,
        network_tried: false,
    };
    let shape = PartShape::Single(Box::new(surface));
    Ok(Made {
        crossings: shaped.crossings,
        is_unmended: shaped.is_unmended,
        error: shaped.error,
        ..Made::new(task, states, shape, shaped.not_met, notes)
    })
}

/// Whether a point takes no part in what follows the fit: outliers and bits that the surface does not cover.
pub(super) fn is_gone(state: PointState) -> bool {
    matches!(state, PointState::Outlier | PointState::Detached)
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

/// Requirements on an approximation, and properties of its points.
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
    /// The requested tolerance, if any.
    pub(super) goal: Option<Goal>,
}

/// Approximates the points that are not held out, with additional guides; also returns which points are outliers.
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
        // These charts are even; corrected parameters would leave parts of the domain without points.
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

//! A free-form surface of a part: charted, approximated, and made free of self-intersections.
//!
//! A sheet has up to three candidate domains: the rectangle around it, spread out or seen along its best direction, at
//! whose outline the surface is trimmed, and the region that its own borders enclose. All are fitted unless one is plainly
//! good, and the best one is kept (`choice`). A surface that runs off beyond the outline (`extent`) is fitted again with
//! more fairness. One that intersects itself is replaced by the other candidate or by one with more fairness or fewer
//! control points, as long as p95 grows by a factor of 3 at most.
//!
//! Ours.

mod choice;
mod extent;

use super::part::{
    AUTOMATIC_BUDGET, Asked, Shaped, Task, approximate_seen, is_gone, kept, without,
};
use super::{SurfacingOptions, Trim};
use crate::deviation::verdict::USUAL_SHARE;
use extent::{box_of, runs_off};
use glam::{DVec2, DVec3};
use nurbskin_cad::check::{Defects, crossings};
use nurbskin_cad::trim::{Scanned, Trimming, trimming_near};
use nurbskin_fit::charting::{Charted, Extends, PointState};
use nurbskin_fit::fit::approximate::{Approximation, Crossing, Goal, Guides, NOISE_SHARE, Status};
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::nurbs::closest::ClosestPoint;
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::spatial::nearest::Nearest;
use nurbskin_geometry::unit::{counted, grouped};
use nurbskin_geometry::{Error, NurbsSurface, Result};
use std::borrow::Cow;
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;

/// Tolerance of the feet of points that the fit left out, in spacings. Dimensionless.
/// Guard: they only tell where the surface is trimmed.
const FOOT_TOLERANCE: f64 = 1e-3;
/// Control points per measured point above which a surface is said to follow the errors of its scan.
/// Derived: from three points for each unknown of a coordinate, a residual keeps a variance of 1 - 1/3, two thirds of
/// that of the noise.
pub(crate) const MOST_UNKNOWNS: f64 = 1.0 / 3.0;
/// Most control points with which that is tried, and with which a surface is plainly good. Count.
/// Guard: a choice; so many can still be edited by hand.
const EDITABLE_SIZE: usize = 200;
/// Distance of 95 % of the points from a surface with few control points over a sheet that was spread out, in that aimed at,
/// up to which more control points are tried. Dimensionless.
/// Derived: the error falls with the square of the control points, so that twice as many suffice.
const PROMISING: f64 = 4.0;
/// Fairness, in the unit of `ApproximateOptions::fairness`, of the further attempts for a surface that runs off with
/// the default of 0.02. Dimensionless.
/// Trial: on corners that leave the box by a little, for which the first one suffices.
const FAIRNESS_RETRIES: [f64; 2] = [0.15, 1.0];
/// Factor by which the distance of 95 % of the points may rise for a surface that does not intersect itself.
/// Dimensionless.
/// Trial: on the scans of docs/real-scans.md.
const MAX_MENDED_ERROR_RISE: f64 = 3.0;
/// Fairness and share of the control points of the attempts for a surface that still intersects itself with stiffer
/// cells. Dimensionless.
/// Trial: on the scans of docs/real-scans.md.
const MENDING_ATTEMPTS: [(f64, f64); 6] = [
    (0.1, 1.0),
    (0.02, 0.3),
    (0.5, 1.0),
    (0.1, 0.5),
    (0.5, 0.5),
    (0.5, 0.25),
];

/// Charts a part and approximates it to the tolerance: over the rectangle around a sheet, over the region that its own
/// borders enclose, or over both where the first is not plainly good; the better one is kept.
pub(super) fn fit(task: Task<'_>) -> Result<Shaped> {
    let Task {
        scan,
        progress,
        charts,
        ..
    } = task;
    progress.stage("order", None);
    // The better surface over a rectangle around the sheet, and its chart.
    let mut natural: Option<(Shaped, &Charted)> = None;
    let rectangles = [charts.spread_out(progress)?, charts.natural_base()?];
    for rectangle in rectangles.into_iter().flatten() {
        match task.over_rectangle(rectangle) {
            Ok(shaped) if shaped.is_plainly_good() => return Ok(shaped),
            Ok(shaped) => {
                let keeps = |(other, _): &(Shaped, &Charted)| !shaped.precedes(other);
                if !natural.as_ref().is_some_and(keeps) {
                    natural = Some((shaped, rectangle));
                }
            }
            Err(Error::NoSolution(_)) => {}
            Err(other) => return Err(other),
        }
    }
    let charted = charts.chart(progress);
    let refused = |why: &Error| matches!(why, Error::NoSolution(_) | Error::Unsupported(_));
    let fitted = charted.and_then(|charted| {
        let shaped = task.fitted(charted, Effort::USUAL)?;
        Ok((shaped, charted))
    });
    // The better surface and its chart, and the other surface.
    let (chosen, charted, other) = match (fitted, natural) {
        (Err(why), Some((natural, rectangle))) if refused(&why) => (natural, rectangle, None),
        (Ok((bounded, _)), Some((natural, rectangle))) if natural.is_better_than(&bounded) => {
            let natural = natural.instead_of(&bounded, scan.unit);
            (natural, rectangle, Some(bounded))
        }
        (fitted, natural) => {
            let (bounded, charted) = fitted?;
            let natural = natural.map(|(natural, _)| natural.instead_of(&bounded, scan.unit));
            (bounded, charted, natural)
        }
    };
    task.mended(chosen, charted, other)
}

/// An approximation, and the outliers that it found.
type Made = (Approximation, Vec<bool>);
/// An approximation to a goal with the budget of these options and this fairness.
type Attempt<'a> = dyn Fn(Option<Goal>, &SurfacingOptions, Option<f64>) -> Result<Made> + 'a;

/// Settings of a fit that differ from the default.
#[derive(Clone, Copy, Debug)]
struct Effort {
    /// The fairness.
    fairness: Option<f64>,
    /// Most control points.
    most: Option<usize>,
    /// Whether a sheet without noise is first fitted at every point with few control points.
    all_first: bool,
}

impl Effort {
    const USUAL: Self = Self {
        fairness: None,
        most: None,
        all_first: true,
    };
}

/// Where a surface folds or intersects itself within the part that is kept.
#[derive(Default)]
struct Crossed {
    /// In (u, v).
    places: Vec<DVec2>,
    /// Whether whole regions intersect each other.
    is_wide: bool,
    /// The trimming, if it was needed.
    trimming: Option<Trimming>,
}

impl Task<'_> {
    /// The surface over a rectangle around a sheet. Over a sheet that was spread out, one with few control points shows
    /// first whether more are worth it.
    fn over_rectangle(&self, rectangle: &Charted) -> Result<Shaped> {
        if rectangle.extends == Extends::SpreadOut {
            let few = Effort {
                most: Some(EDITABLE_SIZE),
                ..Effort::USUAL
            };
            let shaped = self.fitted(rectangle, few)?;
            let is_promising = shaped.error <= PROMISING * self.tolerance.aim();
            let usual = self.budgeted(Effort::USUAL).max_control_points;
            let has_more = usual.is_none_or(|most| most > EDITABLE_SIZE);
            if shaped.is_plainly_good() || !is_promising || !has_more {
                return Ok(shaped);
            }
            let more = Effort {
                all_first: false,
                ..Effort::USUAL
            };
            return self.fitted(rectangle, more);
        }
        self.fitted(rectangle, Effort::USUAL)
    }

    /// A surface without folds and self-intersections where the chosen one has some: the other candidate, or one with
    /// more fairness or fewer control points. The chosen one if nothing helps at an acceptable error.
    fn mended(&self, shaped: Shaped, charted: &Charted, other: Option<Shaped>) -> Result<Shaped> {
        if shaped.crossings == 0 || self.is_useless(shaped.not_met.is_some()) {
            return Ok(shaped);
        }
        let is_borne = |other: &Shaped| {
            other.crossings == 0
                && (shaped.not_met.is_some() || other.not_met.is_none())
                && other.error <= MAX_MENDED_ERROR_RISE * shaped.error
        };
        if let Some(other) = other.filter(is_borne) {
            return Ok(other);
        }
        // Trial: other fairness mends that at no error worth having; a figure with a handle stays wide, a head is mended at
        // ten times its aim.
        if shaped.crosses_widely {
            return Ok(shaped);
        }
        if shaped.error > self.worth_mending {
            return Ok(Shaped {
                is_unmended: true,
                ..shaped
            });
        }
        for (fairness, share) in MENDING_ATTEMPTS {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a part of a count"
            )]
            let most = (share * shaped.control_points() as f64) as usize;
            let effort = Effort {
                fairness: Some(fairness),
                most: Some(most),
                all_first: false,
            };
            let other = match self.fitted(charted, effort) {
                Ok(other) => other,
                Err(Error::NoSolution(_) | Error::Invalid(_)) => continue,
                Err(other) => return Err(other),
            };
            if is_borne(&other) {
                return Ok(other.calmer_than(&shaped, self.scan.unit));
            }
        }
        Ok(shaped)
    }

    /// Self-intersections of a surface, in (u, v), within the part that trimming to these points and triangles leaves,
    /// as the check of the model will see it, including what trimming adds beyond the sides.
    fn crossings(
        &self,
        surface: &NurbsSurface,
        (points, triangles, feet): (&[DVec3], &[[u32; 3]], Option<&[DVec2]>),
        nearest: &OnceLock<Nearest>,
    ) -> Crossed {
        let [mut low, mut high] = bounding_box(points);
        if self.options.trim == Trim::Off {
            let [from, to] = box_of(surface);
            (low, high) = (low.min(from), high.max(to));
        }
        let diagonal = low.distance(high);
        // Trimming takes longer than a test of the whole surface.
        let whole = crossings(surface, diagonal, &|_| true);
        let untrimmed = |whole: &Defects| Crossed {
            places: whole.places(),
            is_wide: whole.is_wide(),
            trimming: None,
        };
        if whole.is_empty() || self.options.trim == Trim::Off {
            return untrimmed(&whole);
        }
        let scanned = Scanned {
            points,
            triangles: Some(triangles).filter(|t| !t.is_empty()),
            is_mesh: self.vertices,
            spacing: self.scan.spacing,
            feet,
            stays_closed: self.options.trim == Trim::Auto,
        };
        let nearest = nearest.get_or_init(|| scanned.nearest());
        let Ok(trimming) = trimming_near(surface, &scanned, nearest, Some(diagonal)) else {
            return untrimmed(&whole);
        };
        // The seam of the trimmed surface may have moved, and the surface continues beyond the sides.
        let [(a, b), (c, d)] = surface.domain();
        let moved = DVec2::from(trimming.moved) * DVec2::new(b - a, d - c);
        let back = |p: DVec2| {
            let p = p + moved;
            let at = DVec2::new(surface.knots_u().wrap(p.x), surface.knots_v().wrap(p.y));
            at.clamp(DVec2::new(a, c), DVec2::new(b, d))
        };
        let places = trimming.crossings.places().into_iter().map(back);
        Crossed {
            places: places.collect(),
            is_wide: trimming.crossings.is_wide(),
            trimming: Some(trimming),
        }
    }

    /// Whether a surface that `missed` the tolerance is of no use.
    fn is_useless(&self, missed: bool) -> bool {
        self.only_met && missed
    }

    /// Whether neither a tolerance nor a budget was requested.
    fn by_default(&self) -> bool {
        self.options.tolerance.is_none() && self.options.max_control_points.is_none()
    }

    /// The options with the budget of an effort.
    fn budgeted(&self, effort: Effort) -> SurfacingOptions {
        let usual = match self.by_default() {
            true => Some(AUTOMATIC_BUDGET),
            false => self.options.max_control_points,
        };
        SurfacingOptions {
            max_control_points: usual.into_iter().chain(effort.most).min(),
            ..self.options.clone()
        }
    }

    /// The first attempt that does not run off: for all points of an exact sheet with few control points, then as
    /// requested, then with more fairness.
    fn attempted(
        &self,
        budgeted: &SurfacingOptions,
        effort: Effort,
        (extends, is_flat, size): (Extends, bool, [f64; 2]),
        fitted: &Attempt<'_>,
    ) -> Result<Made> {
        let scan = self.scan;
        let goal = self.tolerance.asked().map(|tolerance| Goal {
            tolerance,
            within: self.options.within.unwrap_or(USUAL_SHARE),
        });
        let stays = |made: &Made| !runs_off(&made.0.surface, &scan.points, (extends, size));
        let is_few = effort.all_first && (is_flat || extends != Extends::No);
        let exact = |g: &Goal| is_few && scan.noise < NOISE_SHARE * g.tolerance;
        if let Some(goal) = goal.filter(exact) {
            let few = SurfacingOptions {
                max_control_points: budgeted
                    .max_control_points
                    .into_iter()
                    .chain([EDITABLE_SIZE])
                    .min(),
                ..budgeted.clone()
            };
            let all = Goal {
                within: 1.0,
                ..goal
            };
            for fairness in std::iter::once(effort.fairness).chain(FAIRNESS_RETRIES.map(Some)) {
                let made = fitted(Some(all), &few, fairness)?;
                if made.0.status != Status::Met {
                    break;
                }
                if stays(&made) {
                    return Ok(made);
                }
            }
        }
        for fairness in std::iter::once(effort.fairness).chain(FAIRNESS_RETRIES.map(Some)) {
            let made = fitted(goal, budgeted, fairness)?;
            if stays(&made) {
                return Ok(made);
            }
        }
        Err(Error::NoSolution(
            "the surface runs off where the scan has no data: its border is too ragged, or too few points lie along it; \
             trim the scan"
                .into(),
        ))
    }

    /// Gives some points that the fit left out their feet on the surface. O(log n) for each.
    fn project(
        &self,
        surface: &NurbsSurface,
        is_left: &dyn Fn(usize) -> bool,
        feet: &mut [DVec2],
    ) -> Result<()> {
        let left: Vec<usize> = (0..feet.len()).filter(|&k| is_left(k)).collect();
        if left.is_empty() {
            return Ok(());
        }
        let tolerance = FOOT_TOLERANCE * self.scan.spacing;
        let closest = ClosestPoint::with_tolerance(surface, tolerance)?;
        let points: Vec<DVec3> = left.iter().map(|&k| self.scan.points[k]).collect();
        let starts: Vec<DVec2> = left.iter().map(|&k| feet[k]).collect();
        let found = closest.closest_all_with(&points, Some(&starts), self.progress)?;
        for (k, foot) in left.into_iter().zip(found) {
            feet[k] = DVec2::new(foot.u, foot.v);
        }
        Ok(())
    }

    /// Notes an excessive number of control points, and how many points lie beyond the borders.
    fn note_size_and_rim(&self, surface: &NurbsSurface, past: usize, notes: &mut Notes) {
        let size: usize = surface.distinct_counts().into_iter().product();
        let points = self.scan.points.len();
        if size as f64 > MOST_UNKNOWNS * points as f64 {
            notes.warn(format!(
                "{} control points for {} points: with more than one for three the surface follows every error of the \
                 scan; allow a larger tolerance",
                grouped(size),
                grouped(points)
            ));
        }
        if past > 0 {
            notes.detail(format!(
                "{} beyond the borders of the chart: the fit leaves {} out, the deviation counts {}",
                counted(past, "point lies", "points lie"),
                if past == 1 { "it" } else { "them" },
                if past == 1 { "it" } else { "them" },
            ));
        }
    }

    /// The surface over a chart.
    fn fitted(&self, charted: &Charted, effort: Effort) -> Result<Shaped> {
        let &Task {
            scan,
            vertices,
            tolerance,
            held_out,
            progress,
            ..
        } = self;
        let Charted {
            chart,
            states,
            inside,
            support,
            facing,
            extends,
            is_flat,
            notes,
        } = charted;
        let (mut notes, extends, size) = (notes.clone(), *extends, chart.size);
        progress.check()?;

        progress.stage("fit", None);
        let either = held_out.iter().zip(states);
        let mut unseen: Vec<bool> = either
            .map(|(out, &state)| *out || state != PointState::Charted)
            .collect();
        let past: Vec<DVec3> = (scan.points.iter().zip(states))
            .filter(|(_, state)| **state == PointState::Beyond)
            .map(|(point, _)| *point)
            .collect();
        // Places inside the scan's own large triangles are fitted as its points are.
        let (mut points, mut chart) = (Cow::Borrowed(scan.points.as_slice()), Cow::Borrowed(chart));
        if !inside.is_empty() {
            points.to_mut().extend(inside.iter().map(|place| place.0));
            let chart = chart.to_mut();
            chart.parameters.extend(inside.iter().map(|place| place.1));
            unseen.resize(points.len(), false);
        }
        let budgeted = self.budgeted(effort);
        let nearest = OnceLock::new();
        let whole = (&scan.points[..], &scan.triangles[..]);
        // A surface that runs off at first is fitted again: its self-intersections do not count.
        let is_first = AtomicBool::new(false);
        let is_spread_out = extends == Extends::SpreadOut;
        let charted_feet = is_spread_out.then(|| &charted.chart.parameters[..]);
        let find = |surface: &NurbsSurface| {
            if is_first.swap(false, Relaxed) && runs_off(surface, &scan.points, (extends, size)) {
                return Some(Vec::new());
            }
            let found = self.crossings(surface, (whole.0, whole.1, charted_feet), &nearest);
            (!found.is_wide).then_some(found.places)
        };
        // A sheet over its plane hardly intersects itself: that is checked once.
        let guided = (!matches!(extends, Extends::OverPlane(_))).then_some(&find);
        let guides = Guides {
            own: Some(scan.points.len()),
            unseen: &past,
            support,
            facing,
            extends: extends != Extends::No,
            crossing: guided.map(|f| Crossing(f)),
            only_met: self.only_met,
        };
        let fitted = |goal: Option<Goal>, budgeted: &SurfacingOptions, fairness: Option<f64>| {
            let is_last = fairness.is_some() && fairness == FAIRNESS_RETRIES.last().copied();
            is_first.store(!is_last, Relaxed);
            let asked = Asked {
                resolution: [scan.noise, scan.spacing],
                tolerance: tolerance.aim(),
                fairness,
                vertices,
                thrifty: self.by_default(),
                goal,
            };
            approximate_seen(
                (&points, &guides),
                &chart,
                &unseen,
                asked,
                budgeted,
                progress,
            )
        };
        let (approximation, lost) =
            self.attempted(&budgeted, effort, (extends, *is_flat, size), &fitted)?;
        let states: Vec<PointState> = (states.iter().zip(lost))
            .map(|(&state, lost)| if lost { PointState::Outlier } else { state })
            .collect();
        let mut feet = feet_of(
            &approximation,
            &unseen,
            &chart.parameters,
            scan.points.len(),
        );
        if is_spread_out {
            let is_left = |k: usize| unseen[k] && states[k] != PointState::Detached;
            self.project(&approximation.surface, &is_left, &mut feet)?;
        }
        let count = past.len();
        self.note_size_and_rim(&approximation.surface, count, &mut notes);
        let mut off: Vec<f64> = approximation.residuals.iter().map(|r| r.abs()).collect();
        let error = quantile_in_place(&mut off, 0.95);
        let [m, n] = approximation.surface.distinct_counts();
        let is_full = m * n + m.min(n) > AUTOMATIC_BUDGET;
        // Outliers are excluded from the trimming.
        let gone: Vec<bool> = states.iter().map(|&state| is_gone(state)).collect();
        let missed = approximation.status != Status::Met;
        let crossed = match gone.contains(&true) {
            // The surface is discarded.
            _ if self.is_useless(missed) => Crossed::default(),
            true => {
                let kept_feet = kept(&feet, &gone);
                let left = (
                    &kept(&scan.points, &gone)[..],
                    &without(&scan.triangles, &gone)[..],
                    is_spread_out.then_some(&kept_feet[..]),
                );
                self.crossings(&approximation.surface, left, &OnceLock::new())
            }
            false => self.crossings(
                &approximation.surface,
                (whole.0, whole.1, is_spread_out.then_some(&feet[..])),
                &nearest,
            ),
        };
        Ok(Shaped {
            crossings: crossed.places.len(),
            crosses_widely: crossed.is_wide,
            is_unmended: false,
            trimming: crossed.trimming,
            may_cross: true,
            surface: approximation.surface,
            topology: chart.topology,
            error,
            is_spread_out,
            not_met: match approximation.status {
                Status::Met => None,
                Status::NotMet(_) if self.by_default() && effort.fairness.is_some() => {
                    Some("a closer fit was tried, and the surface intersected itself".to_owned())
                }
                Status::NotMet(_) if self.by_default() && is_full => Some(format!(
                    "{} control points are the most without -t and --max-control-points",
                    grouped(AUTOMATIC_BUDGET)
                )),
                Status::NotMet(why) => Some(why.to_string()),
            },
            beyond: count,
            states,
            feet: Some(feet),
            met: approximation.met,
            notes,
        })
    }
}

/// The foot points of the first `count` points; the parameters of the chart for points that the fit excluded.
fn feet_of(
    approximation: &Approximation,
    unseen: &[bool],
    parameters: &[DVec2],
    count: usize,
) -> Vec<DVec2> {
    let mut seen = approximation.feet.iter();
    let places = unseen.iter().zip(parameters).take(count);
    let foot = |(unseen, at): (&bool, &DVec2)| match unseen {
        true => *at,
        false => seen.next().copied().unwrap_or(*at),
    };
    places.map(foot).collect()
}

//! A free form: charted in one way or another, approximated, and made valid.

mod choice;

use super::part::{Asked, DEFAULT_BUDGET, Shaped, Task, approximate_seen, kept, without};
use super::{SurfacingOptions, Trim};
use crate::deviation::verdict::USUAL_SHARE;
use glam::{DVec2, DVec3};
use nurbskin_cad::check::crossings;
use nurbskin_cad::trim::{Scanned, Trimming, trimming_near};
use nurbskin_fit::charting::{ChartOptions, Charted, chart, natural_base};
use nurbskin_fit::fit::approximate::{Approximation, Crossing, Goal, Guides, Status};
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::spatial::nearest::Nearest;
use nurbskin_geometry::unit::{counted, grouped};
use nurbskin_geometry::{Error, NurbsSurface, Result};
use std::borrow::Cow;
use std::sync::OnceLock;

/// A surface that leaves the box around its points by this part of its diagonal runs off; looked for at so many places
/// along u and v.
const RUNS_OFF: f64 = 0.1;
const PROBES: usize = 128;
/// Control points per measured point above which a surface is said to follow the errors of its scan: three points for each
/// unknown of a coordinate leave its variance two thirds of theirs.
pub(crate) const MOST_UNKNOWNS: f64 = 1.0 / 3.0;
/// A sheet over its best plane with less noise than this part of the tolerance is brought within the tolerance at all its points,
/// ...
const EXACT: f64 = 0.1;
/// ... where so many control points suffice: so many can still be edited.
const FEW: usize = 200;
/// The fairness that a surface gets that ran off with the usual one, 0.02, one after the other: a corner that leaves the box by a
/// little needs no more than the first.
const CALMER: [f64; 2] = [0.15, 1.0];
/// Factor by which the error may rise for a surface that does not intersect itself, ...
const DEAREST: f64 = 3.0;
/// ... and what is tried for it where stiffer cells do not help: more fairness, with a part of the control points. By trial on
/// the scans of docs/real-scans.md.
const EFFORTS: [(f64, f64); 6] = [
    (0.1, 1.0),
    (0.02, 0.3),
    (0.5, 1.0),
    (0.1, 0.5),
    (0.5, 0.5),
    (0.5, 0.25),
];

/// Charted, and approximated to the tolerance: over the rectangle around a sheet, over what its own borders enclose, or over
/// both, where the first is not plainly good, and the better one kept.
pub(super) fn fit(task: Task<'_>) -> Result<Shaped> {
    let Task { scan, progress, .. } = task;
    let charting = ChartOptions {
        topology: task.options.topology,
        vertices: task.vertices,
    };
    let rectangle = natural_base(scan, &charting)?;
    let natural = match rectangle
        .as_ref()
        .map(|charted| task.fitted(charted, Effort::USUAL))
    {
        None | Some(Err(Error::NoSolution(_))) => None,
        Some(Ok(shaped)) if shaped.is_plainly_good() => return Ok(shaped),
        Some(Ok(shaped)) => Some(shaped),
        Some(Err(other)) => return Err(other),
    };
    progress.stage("order", None);
    let charted = chart(scan, &charting, progress);
    let refused = |why: &Error| matches!(why, Error::NoSolution(_) | Error::Unsupported(_));
    let fitted = charted.and_then(|charted| {
        let shaped = task.fitted(&charted, Effort::USUAL)?;
        Ok((shaped, charted))
    });
    // The better one and its chart, and the other.
    let (chosen, charted, other) = match (fitted, natural, rectangle) {
        (Err(why), Some(natural), Some(rectangle)) if refused(&why) => (natural, rectangle, None),
        (Ok((bounded, _)), Some(natural), Some(rectangle)) if natural.is_better_than(&bounded) => {
            let natural = natural.instead_of(&bounded, scan.unit);
            (natural, rectangle, Some(bounded))
        }
        (fitted, natural, _) => {
            let (bounded, charted) = fitted?;
            let natural = natural.map(|natural| natural.instead_of(&bounded, scan.unit));
            (bounded, charted, natural)
        }
    };
    task.mended(chosen, &charted, other)
}

/// An approximation, and which points it found to be outliers.
type Made = (Approximation, Vec<bool>);
/// An approximation to a goal, with the budget of these options and this fairness.
type Attempt<'a> = dyn Fn(Option<Goal>, &SurfacingOptions, Option<f64>) -> Result<Made> + 'a;

/// Other than the usual effort of a fit.
#[derive(Clone, Copy, Debug)]
struct Effort {
    /// The fairness.
    fairness: Option<f64>,
    /// Most control points.
    most: Option<usize>,
}

impl Effort {
    const USUAL: Self = Self {
        fairness: None,
        most: None,
    };
}

impl Task<'_> {
    /// A surface that neither folds nor intersects itself: the other one, or one with more fairness or fewer control points,
    /// where the one that was chosen does; that one if nothing helps at a bearable price.
    fn mended(&self, shaped: Shaped, charted: &Charted, other: Option<Shaped>) -> Result<Shaped> {
        if shaped.crossings == 0 {
            return Ok(shaped);
        }
        let is_borne = |other: &Shaped| {
            other.crossings == 0
                && (shaped.not_met.is_some() || other.not_met.is_none())
                && other.error <= DEAREST * shaped.error
        };
        if let Some(other) = other.filter(is_borne) {
            return Ok(other);
        }
        for (fairness, share) in EFFORTS {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a part of a count"
            )]
            let most = (share * shaped.control_points() as f64) as usize;
            let effort = Effort {
                fairness: Some(fairness),
                most: Some(most),
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

    /// Where a surface folds or intersects itself, in (u, v), in what trimming to these points and triangles leaves of it, as
    /// the check of the model will see it, with what trimming adds beyond the sides; and that trimming, if it mattered.
    fn crossings(
        &self,
        surface: &NurbsSurface,
        (points, triangles): (&[DVec3], &[[u32; 3]]),
        nearest: &OnceLock<Nearest>,
    ) -> (Vec<DVec2>, Option<Trimming>) {
        let [mut low, mut high] = bounding_box(points);
        if self.options.trim == Trim::Off {
            let [from, to] = box_of(surface);
            (low, high) = (low.min(from), high.max(to));
        }
        let diagonal = low.distance(high);
        // To find where it ends takes longer than to see that it is sound as it is.
        let whole = crossings(surface, diagonal, &|_| true);
        if whole.is_empty() || self.options.trim == Trim::Off {
            return (whole.places(), None);
        }
        let scanned = Scanned {
            points,
            triangles: Some(triangles).filter(|t| !t.is_empty()),
            is_mesh: self.vertices,
            spacing: self.scan.spacing,
            stays_closed: self.options.trim == Trim::Auto,
        };
        let nearest = nearest.get_or_init(|| scanned.nearest());
        let Ok(trimming) = trimming_near(surface, &scanned, nearest, Some(diagonal)) else {
            return (whole.places(), None);
        };
        // Its seam may have moved, and it goes on beyond the sides.
        let [(a, b), (c, d)] = surface.domain();
        let moved = DVec2::from(trimming.moved) * DVec2::new(b - a, d - c);
        let back = |p: DVec2| {
            let p = p + moved;
            let at = DVec2::new(surface.knots_u().wrap(p.x), surface.knots_v().wrap(p.y));
            at.clamp(DVec2::new(a, c), DVec2::new(b, d))
        };
        let places = trimming.crossings.places().into_iter().map(back);
        (places.collect(), Some(trimming))
    }

    /// Whether neither a tolerance nor a budget was asked for.
    fn by_default(&self) -> bool {
        self.options.tolerance.is_none() && self.options.max_control_points.is_none()
    }

    /// The options with the budget of an effort.
    fn budgeted(&self, effort: Effort) -> SurfacingOptions {
        let usual = match self.by_default() {
            true => Some(DEFAULT_BUDGET),
            false => self.options.max_control_points,
        };
        SurfacingOptions {
            max_control_points: usual.into_iter().chain(effort.most).min(),
            ..self.options.clone()
        }
    }

    /// The first attempt that does not run off: for all points of an exact sheet with few control points, as asked, or much
    /// stiffer.
    fn attempted(
        &self,
        budgeted: &SurfacingOptions,
        effort: Effort,
        (extends, is_flat): (Option<[DVec3; 3]>, bool),
        fitted: &Attempt<'_>,
    ) -> Result<Made> {
        let scan = self.scan;
        let goal = self.tolerance.asked().map(|tolerance| Goal {
            tolerance,
            within: self.options.within.unwrap_or(USUAL_SHARE),
        });
        let stays = |made: &Made| !runs_off(&made.0.surface, &scan.points, extends);
        let exact = |g: &Goal| is_flat && effort.most.is_none() && scan.noise < EXACT * g.tolerance;
        if let Some(goal) = goal.filter(exact) {
            let few = SurfacingOptions {
                max_control_points: budgeted.max_control_points.into_iter().chain([FEW]).min(),
                ..budgeted.clone()
            };
            let all = Goal {
                within: 1.0,
                ..goal
            };
            for fairness in std::iter::once(effort.fairness).chain(CALMER.map(Some)) {
                let made = fitted(Some(all), &few, fairness)?;
                if made.0.status != Status::Met {
                    break;
                }
                if stays(&made) {
                    return Ok(made);
                }
            }
        }
        for fairness in std::iter::once(effort.fairness).chain(CALMER.map(Some)) {
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

    /// Notes more control points than the points carry, and how many points lie past the borders.
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
                "{} beyond the surface's borders: the fit leaves {} out, the deviation counts {}",
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
            beyond,
            loose,
            inside,
            support,
            facing,
            extends,
            is_flat,
            notes,
        } = charted;
        let (mut notes, extends) = (notes.clone(), *extends);
        progress.check()?;

        progress.stage("fit", None);
        let either = held_out.iter().zip(beyond);
        let mut unseen: Vec<bool> = either.map(|(out, beyond)| *out || *beyond).collect();
        for (unseen, loose) in unseen.iter_mut().zip(loose) {
            *unseen |= loose;
        }
        let in_bit = |k: usize| loose.get(k) == Some(&true);
        let past: Vec<DVec3> = (0..beyond.len())
            .filter(|&k| beyond[k] && !in_bit(k))
            .map(|k| scan.points[k])
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
        let find = |surface: &NurbsSurface| self.crossings(surface, whole, &nearest).0;
        // A sheet over its plane hardly meets itself: that is looked for once.
        let guided = extends.is_none().then_some(&find);
        let guides = Guides {
            own: Some(scan.points.len()),
            unseen: &past,
            support,
            facing,
            extends: extends.is_some(),
            crossing: guided.map(|f| Crossing(f)),
        };
        let fitted = |goal: Option<Goal>, budgeted: &SurfacingOptions, fairness: Option<f64>| {
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
        let (approximation, mut lost) =
            self.attempted(&budgeted, effort, (extends, *is_flat), &fitted)?;
        lost.truncate(scan.points.len());
        let feet = feet_of(
            &approximation,
            &unseen,
            &chart.parameters,
            scan.points.len(),
        );
        let count = past.len();
        self.note_size_and_rim(&approximation.surface, count, &mut notes);
        let error = {
            let mut off: Vec<f64> = approximation.residuals.iter().map(|r| r.abs()).collect();
            quantile_in_place(&mut off, 0.95)
        };
        let [m, n] = approximation.surface.distinct_counts();
        let is_full = m * n + m.min(n) > DEFAULT_BUDGET;
        // Outliers do not take part in the trimming.
        let gone: Vec<bool> = (0..scan.points.len())
            .map(|k| lost.get(k) == Some(&true) || in_bit(k))
            .collect();
        let (crossings, trimming) = match gone.contains(&true) {
            true => {
                let left = (
                    &kept(&scan.points, &gone)[..],
                    &without(&scan.triangles, &gone)[..],
                );
                self.crossings(&approximation.surface, left, &OnceLock::new())
            }
            false => self.crossings(&approximation.surface, whole, &nearest),
        };
        Ok(Shaped {
            crossings: crossings.len(),
            trimming,
            may_cross: true,
            surface: approximation.surface,
            topology: chart.topology,
            error,
            not_met: match approximation.status {
                Status::Met => None,
                Status::NotMet(_) if self.by_default() && effort.most.is_some() => {
                    Some("a closer fit was tried, and the surface intersected itself".to_owned())
                }
                Status::NotMet(_) if self.by_default() && is_full => Some(format!(
                    "{} control points are the most without -t and --max-control-points",
                    grouped(DEFAULT_BUDGET)
                )),
                Status::NotMet(why) => Some(why.to_string()),
            },
            beyond: count,
            lost,
            loose: loose.clone(),
            feet: Some(feet),
            met: approximation.met,
            notes,
        })
    }
}

/// Where on the surface the fit saw each of the first `count` points; that of the chart for those that it did not see.
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

/// The box around places all over a surface.
fn box_of(surface: &NurbsSurface) -> [DVec3; 2] {
    let [(a, b), (c, d)] = surface.domain();
    let at = |k: usize| k as f64 / (PROBES - 1) as f64;
    let places = (0..PROBES * PROBES).map(|k| {
        let (u, v) = (at(k % PROBES), at(k / PROBES));
        surface.point(a + (b - a) * u, c + (d - c) * v)
    });
    bounding_box(&places.collect::<Vec<_>>())
}

/// Whether a surface leaves the box around its points by far; the box along these axes, where there are some.
fn runs_off(surface: &NurbsSurface, points: &[DVec3], axes: Option<[DVec3; 3]>) -> bool {
    let axes = axes.unwrap_or([DVec3::X, DVec3::Y, DVec3::Z]);
    let along = |p: DVec3| DVec3::from(axes.map(|axis| axis.dot(p)));
    let (lo, hi) = points
        .iter()
        .map(|&p| along(p))
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| {
            (lo.min(p), hi.max(p))
        });
    let margin = RUNS_OFF * lo.distance(hi);
    let [(a, b), (c, d)] = surface.domain();
    let at = |k: usize| (k as f64 + 0.5) / PROBES as f64;
    (0..PROBES * PROBES).any(|k| {
        let (u, v) = (at(k % PROBES), at(k / PROBES));
        let p = along(surface.point(a + (b - a) * u, c + (d - c) * v));
        p.cmplt(lo - margin).any() || p.cmpgt(hi + margin).any()
    })
}

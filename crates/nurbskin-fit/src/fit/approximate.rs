//! Penalised least squares to scattered, parametrised points, with knots where the error is.
//!
//! Rounds of refinement: fit with robust weights and a small fairness term, measure the residuals, and halve the spans
//! in which the surface is not good enough, along u or along v, whichever gains more per control point. Then knots that
//! do not matter are removed again.
//!
//! ```text
//! minimise  Σ w |X - S(u, v)|² / Σ w + λ E(S),   E the thin-plate energy
//! ```
//!
//! With noise, "good enough" is a statistical statement about mean residuals, since the maximum would chase noise.
//! Without noise it is the largest distance.
//!
//! Source: least squares of *The NURBS Book*, 9.4; the bias test and the order of attempts are ours.

pub mod adapt;
mod data_reduction;
mod goal;
mod knot_placement;
mod knot_removal;
mod large;
mod least_error;
mod problem;
mod refinement;
mod reparametrisation;
mod result;
mod search;
mod span_residuals;
mod strategy;
pub mod trade;
mod unfold;
mod visits;

use crate::chart::Chart;
use crate::fit::approximate::adapt::Criterion;
pub use crate::fit::approximate::goal::{Goal, OUTLIER_SIGMAS, OUTLIER_SPACINGS};
use crate::fit::approximate::problem::{Known, Problem};
use crate::fit::approximate::trade::Met;
use crate::fit::approximate::visits::Visits;
use crate::fit::least_squares::robust::Neighbourhoods;
use crate::fit::least_squares::samples::Samples;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::bias::USUAL_WITHIN;
use nurbskin_geometry::nurbs::{MAX_DEGREE, NurbsSurface};
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{DVec2, DVec3, Error, Result};

/// Ratio of the noise sigma to the tolerance from which the points count as noisy and the bias of cells is judged;
/// below it they count as exact and the largest distance is judged. Dimensionless.
/// Trial: not recorded. At this ratio the largest of a million normal errors, about 5 sigma, takes half of the
/// tolerance; with a larger one the maximum criterion chases noise.
pub const NOISE_SHARE: f64 = 0.1;
/// Default root mean square error that fairness may cost, as a share of the reach: half of the tolerance for exact
/// points, three times the error that noise leaves in any surface for noisy ones. Dimensionless.
/// Trial: in prototypes on simulated clouds the bias at this share stayed far below the tolerance; a fixed weight of
/// 1e-8 times the variance of the points over-smoothed.
const FAIRNESS_SHARE: f64 = 0.02;
/// Most distinct control points of a surface where the caller sets no limit. Count.
/// Guard: bounds time, memory and the size of the file; with a tolerance in reach a fit ends far below it.
pub const DEFAULT_BUDGET: usize = 20_000;
/// Exponent e of the number of control points N in the cost `p95 N^e`, by which surfaces are compared where control
/// points have to pay: twice as many must bring the surface 19 % closer. Dimensionless.
/// Trial: 0.1 (7 %) followed by a fixed limit of 1600 spent control points whether they paid or not. Of a smooth shape
/// twice as many bring 80 to 94 % (bicubic, from the second to the fourth power of the knot distance), of one with
/// details of all sizes 40 to 50 %, of noise none.
const SIZE_EXPONENT: f64 = 0.3;
/// Fewest points that are approximated. Count.
/// Derived: a single bicubic patch has (3 + 1)^2 control points.
const MIN_POINTS: usize = 16;

/// Options of an approximation.
#[derive(Clone, Debug, PartialEq)]
pub struct ApproximateOptions {
    /// Error that the surface aims at, in the unit of the points. It sets how stiff the surface is and, without a goal,
    /// where the surface has enough knots.
    pub tolerance: f64,
    /// Goal of a search for the smallest surface that reaches it, whatever `tolerance` is. Without a goal, knots are
    /// added as long as they pay.
    pub goal: Option<Goal>,
    /// Standard deviation of the points across the surface. `None`: it is estimated.
    pub noise: Option<f64>,
    /// Degrees along u and v.
    pub degree: [usize; 2],
    /// Most distinct control points. Where they do not suffice, the best surface within them is returned.
    pub max_control_points: Option<usize>,
    /// Whether control points have to pay. If so, of the surfaces within `max_control_points` the one is returned from
    /// which on twice as many control points would bring 95 % of other points of the same scan less than 19 % closer;
    /// otherwise the closest one.
    pub thrifty: bool,
    /// Whether knots are added. If not, the surface is fitted once on `spans`.
    pub refine: bool,
    /// Spans along u and v to start with; `None`: two along an open, four along a closed direction.
    pub spans: Option<[usize; 2]>,
    /// Root mean square error that fairness may cost, in tolerances; with noisy points, in three times the error that
    /// noise leaves in any surface, if that is less.
    pub fairness: f64,
    /// Whether the parameters may be corrected where the tolerance is not reached and a correction helps. `false` keeps
    /// the parameters of the chart.
    pub correct: bool,
    /// Whether the points are the vertices of a mesh, from which most outliers were removed when it was made. A point
    /// that is off by about half of the spacing is then followed as a feature, as with points without noise.
    pub vertices: bool,
}

impl ApproximateOptions {
    /// Bicubic to this tolerance, noise measured, no limit but 20 000 control points.
    #[must_use]
    pub fn new(tolerance: f64) -> Self {
        Self {
            tolerance,
            goal: None,
            noise: None,
            degree: [3, 3],
            max_control_points: None,
            thrifty: false,
            refine: true,
            spans: None,
            fairness: FAIRNESS_SHARE,
            correct: true,
            vertices: false,
        }
    }
}

/// Whether the tolerance was reached.
#[derive(Clone, Debug, PartialEq)]
pub enum Status {
    /// By the criterion of the approximation.
    Met,
    /// Why not.
    NotMet(Shortfall),
}

/// Why a surface misses its tolerance. Its text gives a remedy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shortfall {
    /// The number of control points that was allowed does not suffice.
    OverBudget(usize),
    /// There are too few points for another knot where the surface is still off.
    TooFewPoints,
    /// The number of rounds of refinement reached its limit.
    Unfinished,
    /// Control points have to pay, and more of them bring the surface only a little closer.
    LittleGain,
    /// More control points bring the surface no closer to the points that are off.
    NoGain,
    /// The spans were given, and no knots may be added.
    GivenSpans,
}

impl std::fmt::Display for Shortfall {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::OverBudget(count) => {
                return write!(
                    f,
                    "{count} control points do not suffice for the tolerance: allow more of them, or a larger tolerance"
                );
            }
            Self::TooFewPoints => {
                "where the surface is still off there are too few points to follow: scan more densely, or allow a larger tolerance"
            }
            Self::Unfinished => "refinement did not come to an end: allow a larger tolerance",
            Self::LittleGain => "more control points bring the surface little closer",
            Self::NoGain => "more control points bring the surface no closer to the points that are off: they are noise, a rough spot or a \
     sharp edge",
            Self::GivenSpans => "the given spans do not suffice for the tolerance: let them be refined",
        })
    }
}

/// One round of refinement.
#[derive(Clone, Debug, PartialEq)]
pub struct Round {
    /// Distinct control points along u and v.
    pub control_points: [usize; 2],
    /// Root mean square of the residuals with their weights, in the unit of the points.
    pub rms: f64,
    /// Largest distance of a point that is not an outlier.
    pub maximum: f64,
    /// Standard deviation of the residuals about their neighbourhoods.
    pub sigma: f64,
    /// Largest score by the criterion; 1 is just good enough.
    pub worst: f64,
}

/// A surface through the middle of scattered points.
#[derive(Clone, Debug)]
pub struct Approximation {
    /// The surface on \[0, 1\] x \[0, 1\].
    pub surface: NurbsSurface,
    /// (u, v) of each point, after corrections.
    pub parameters: Vec<DVec2>,
    /// Foot point of each point: the place of the surface nearest to it, to a few Gauss-Newton steps.
    pub feet: Vec<DVec2>,
    /// Distance of each point to the surface along its normal, signed: positive on the side of `S_u x S_v`.
    pub residuals: Vec<f64>,
    /// Robust weight of each point, 0..=1; 0 = treated as an outlier.
    pub weights: Vec<f64>,
    /// Standard deviation of the points across the surface, measured from the residuals.
    pub sigma: f64,
    /// The criterion by which the surface was judged.
    pub criterion: Criterion,
    /// Residual of the normal equations, relative to their right-hand side.
    pub equation_residual: f64,
    /// The rounds of refinement, then the final surface.
    pub history: Vec<Round>,
    /// Every surface that the fit visited, in order, with its number of control points and the distances of the points
    /// that count for a tolerance. Where points are many and noisy, a subset stands for all.
    pub met: Met,
    /// Whether the tolerance was reached.
    pub status: Status,
}

/// A surface that approximates `points`, which the chart places in \[0, 1\] x \[0, 1\], to the tolerance.
///
/// Outliers lose their weight; where the domain holds no points the surface continues with as little energy as its
/// knots allow. The result does not depend on the order of the points or the number of threads.
///
/// Source: penalised least squares with thin-plate energy, knots by a test of mean residuals; local medians keep
/// features from being taken for outliers. O(M) per round for M points plus O(N w^2) for N control points in a band w.
///
/// ```
/// use nurbskin_fit::chart::{Chart, Topology};
/// use nurbskin_fit::fit::approximate::{ApproximateOptions, approximate};
/// use nurbskin_geometry::{DVec2, DVec3};
/// use nurbskin_geometry::progress::Silent;
/// let parameters: Vec<DVec2> = (0..900)
///     .map(|k| DVec2::new((k % 30) as f64, (k / 30) as f64) / 29.0)
///     .collect();
/// let points: Vec<DVec3> = parameters
///     .iter()
///     .map(|t| DVec3::new(100.0 * t.x, 100.0 * t.y, 20.0 * (3.0 * t.x).sin()))
///     .collect();
/// let chart = Chart { topology: Topology::Disk, parameters, size: [100.0, 100.0], reason: String::new() };
/// let fit = approximate(&points, &chart, &ApproximateOptions::new(0.05), &Silent)?;
/// assert!((fit.surface.point(0.5, 0.3).z - 20.0 * 1.5_f64.sin()).abs() < 0.05);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] if counts disagree, a number is not finite, a size or the tolerance is not positive, or a degree
/// is out of range; [`Error::NoSolution`] if there are fewer than 16 points or they do not determine a surface;
/// [`Error::Cancelled`].
pub fn approximate(
    points: &[DVec3],
    chart: &Chart,
    options: &ApproximateOptions,
    progress: &dyn Progress,
) -> Result<Approximation> {
    approximate_guided(points, chart, &Guides::default(), options, progress)
}

/// Additional knowledge about a surface, beside the points on it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Guides<'a> {
    /// Points with parameters that support the surface where the scan has none, as in a filled hole. They have a
    /// quarter of the weight of a point, so that neighbouring points dominate them, and enter nothing but the fit:
    /// neither the residuals nor the placement of knots.
    pub support: &'a [(DVec3, DVec2)],
    /// Number of points, from the first on, that belong to the scan and count for a goal; the others lie on its
    /// triangles. `None`: all of them.
    pub own: Option<usize>,
    /// Points that count for a goal although the surface is not fitted to them: those beyond its borders.
    pub unseen: &'a [DVec3],
    /// Finds self-intersections of a surface. The surface is made stiffer there until none is left. Where the goal was
    /// reached it must stay reached; otherwise the root mean square distance may rise by half, and by 150 % if the
    /// distance of 95 % of the points rises by a quarter at most. Ignored with more than half a million points and
    /// support points.
    pub crossing: Option<Crossing<'a>>,
    /// Whether the surface continues with least third derivatives where the domain has no points, as beyond the outline
    /// of a trimmed sheet.
    pub extends: bool,
    /// Intended directions of the normal, to within a right angle. Where the surface folds over, it is made stiffer
    /// until it does not, as long as that costs little. Ignored with more than half a million points and support
    /// points.
    pub facing: &'a [Facing],
    /// Whether a surface that misses the goal is of no use to the caller: folds and self-intersections stay in it, which saves
    /// most of its time.
    pub only_met: bool,
}

/// A function from a surface to the places in its parameters where it intersects itself; [`None`] where it does so all over, which
/// stiffness does not mend.
#[derive(Clone, Copy)]
pub struct Crossing<'a>(pub &'a (dyn Fn(&NurbsSurface) -> Option<Vec<DVec2>> + Sync));

impl std::fmt::Debug for Crossing<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Crossing")
    }
}

/// Intended direction of the normal at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facing {
    /// (u, v), in 0..=1.
    pub parameters: DVec2,
    /// Intended direction of `S_u x S_v`, a unit vector.
    pub normal: DVec3,
    /// Whether the place is inside the scan, where a fold may be a feature too narrow for the knots.
    pub inside: bool,
}

/// [`approximate`], with additional knowledge about the surface. As fast; a surface that folds takes up to twenty more
/// fits.
///
/// # Errors
/// As [`approximate`]; [`Error::Invalid`], too, if a place is not finite, a normal is no unit vector, or parameters lie
/// outside 0..1.
pub fn approximate_guided(
    points: &[DVec3],
    chart: &Chart,
    guides: &Guides<'_>,
    options: &ApproximateOptions,
    progress: &dyn Progress,
) -> Result<Approximation> {
    check(points, chart, guides, options)?;
    let support = guides.support;
    let scale = math::hypot(chart.size[0], chart.size[1]);
    let samples = if support.is_empty() {
        Samples::new(points, &chart.parameters, scale)
    } else {
        let (places, parameters): (Vec<DVec3>, Vec<DVec2>) = support.iter().copied().unzip();
        let places = [points, &places].concat();
        let parameters = [chart.parameters.as_slice(), &parameters].concat();
        Samples::with_support(&places, &parameters, points.len(), scale)
    };
    let size = chart.size.map(|s| s / scale);
    let neighbourhoods = Neighbourhoods::new(&samples, size, chart.topology);
    let noise = match options.noise {
        Some(noise) => noise / scale,
        None => neighbourhoods.noise(&samples),
    };
    let tolerance = options.tolerance / scale;
    let goal = options.goal.map(|goal| Goal {
        tolerance: goal.tolerance / scale,
        ..goal
    });
    let criterion = match is_noise(noise, tolerance) {
        false => Criterion::Maximum,
        true => Criterion::Bias,
    };
    let visits = Visits::default();
    let problem = Problem {
        samples: &samples,
        neighbourhoods: &neighbourhoods,
        topology: chart.topology,
        degree: options.degree,
        size,
        tolerance,
        noise: match options.noise {
            Some(_) => Known::Given(noise),
            None => Known::Estimated(noise),
        },
        criterion,
        goal,
        own: guides.own.unwrap_or(points.len()),
        unseen: guides.unseen,
        vertices: options.vertices,
        budget: options.max_control_points.unwrap_or(DEFAULT_BUDGET),
        price: if options.thrifty { SIZE_EXPONENT } else { 0.0 },
        fairness: options.fairness,
        held_out: None,
        extends: guides.extends,
        crossing: guides.crossing,
        facing: guides.facing,
        only_met: guides.only_met,
        stiff: None,
        share: options.goal.map_or(USUAL_WITHIN, |goal| goal.within),
        visits: &visits,
        gauge: None,
        progress,
    };
    progress.stage("approximate", None);
    let made = problem.approximation(options, scale)?;
    Ok(Approximation {
        met: visits.met(scale),
        ..made
    })
}

/// Whether noise takes a share of the tolerance that counts.
pub(super) fn is_noise(noise: f64, tolerance: f64) -> bool {
    noise >= NOISE_SHARE * tolerance
}

/// Rejects input that cannot be approximated.
fn check(
    points: &[DVec3],
    chart: &Chart,
    guides: &Guides<'_>,
    options: &ApproximateOptions,
) -> Result<()> {
    let support = guides.support;
    if points.len() != chart.parameters.len() {
        return Err(Error::invalid(format!(
            "{} points come with {} parameters: each point needs one",
            points.len(),
            chart.parameters.len()
        )));
    }
    if u32::try_from(points.len() + support.len()).is_err() {
        return Err(Error::Unsupported(
            "more than 4 billion points cannot be approximated at once: thin them out first".into(),
        ));
    }
    if let Some(k) = points.iter().position(|p| !p.is_finite()) {
        return Err(Error::invalid(format!("point {k} is not finite")));
    }
    let domain = |t: &DVec2| t.cmpge(DVec2::ZERO).all() && t.cmple(DVec2::ONE).all();
    if let Some(k) = chart.parameters.iter().position(|t| !domain(t)) {
        return Err(Error::invalid(format!(
            "the parameters of point {k} lie outside 0..1"
        )));
    }
    if let Some(k) = support
        .iter()
        .position(|(p, t)| !p.is_finite() || !domain(t))
    {
        return Err(Error::invalid(format!(
            "support {k} is not finite, or its parameters lie outside 0..1"
        )));
    }
    if let Some(k) = guides
        .facing
        .iter()
        .position(|f| !f.normal.is_normalized() || !domain(&f.parameters))
    {
        return Err(Error::invalid(format!(
            "the normal of facing {k} is no unit vector, or its parameters lie outside 0..1"
        )));
    }
    let positive = |x: f64| x.is_finite() && x > 0.0;
    if !chart.size.iter().all(|&s| positive(s)) {
        return Err(Error::invalid("the lengths of the chart must be positive"));
    }
    if !positive(options.tolerance) {
        return Err(Error::invalid("the tolerance must be positive"));
    }
    if options.noise.is_some_and(|s| !(s.is_finite() && s >= 0.0)) {
        return Err(Error::invalid("the noise must not be negative"));
    }
    if !(options.fairness.is_finite() && options.fairness >= 0.0) {
        return Err(Error::invalid("the fairness must not be negative"));
    }
    if options.degree.iter().any(|p| !(1..=MAX_DEGREE).contains(p)) {
        return Err(Error::invalid(format!(
            "degrees must lie in 1..={MAX_DEGREE}"
        )));
    }
    if points.len() < MIN_POINTS {
        return Err(Error::NoSolution(format!(
            "{} points are too few for a surface: at least {MIN_POINTS} are needed",
            points.len()
        )));
    }
    Ok(())
}

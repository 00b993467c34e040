//! The verdict on a deviation: pass, fail or cannot tell, with reasons.
//!
//! This is the verdict on distances. The pipeline lowers it where other findings ask for that: what was left out, units and
//! sizes (`pipeline::sanity`), and failed checks of the CAD file (`pipeline::outcome`). `docs/verdict.md` has all four.
//!
//! One rule applies to every scan. Given are a tolerance T, the required share of the points within T, and the standard
//! deviation sigma of the noise:
//!
//! - **not asked** without a tolerance: the figures, and the resolution of the scan.
//! - **pass** if the required share of the points is within T, and no *region* is biased. A region is a cell of a grid
//!   over (u, v) with a few dozen points. Its mean may deviate by `b = max(0.2 T, T - z sigma)`, where z is the
//!   quantile of the normal distribution for the share (2.58 for 99.5 %): with this mean, the share of the region's
//!   points is still within T. Without noise b is T. A region with at least 12 points is biased if its mean exceeds
//!   `b + y s / sqrt(n)`, where s is sigma or the scatter of its own points, whichever is wider, and y is at least 3.5,
//!   so that one rough spot is not a bias. This mean limits each point to 2.5 sigma from the median, so that a few
//!   outliers cause no bias; without noise it is the median. Where sigma is a tenth of T or more, a region is also
//!   biased if more of its points are beyond T on one side than noise, the share and the scan's outliers explain, and
//!   its plain mean exceeds `b + y sigma / sqrt(n)`. y and the number of points beyond T are chosen such that a perfect
//!   surface fails in any of its regions with a probability of 1 %, whatever the number of regions.
//! - **cannot tell** if T < 2 sigma: the uncertainty (95 %) of a single measurement then exceeds T, and an
//!   interpolating surface merely follows the noise. Also if the share is missed by no more than noise explains and no
//!   region is biased; if T < 4 sigma and the points are too few for one region, so that noise and bias cannot be
//!   separated; and if the points are too few or too sparse to determine their noise, or T is as large as the scan.
//! - **fail** otherwise; below 2 sigma only if more than half of the points are farther than T + 2 sigma, which noise
//!   of that size does not explain.

use super::measure::{Deviation, Statistics};
use glam::DVec3;
use nurbskin_geometry::numeric::bias::{
    ALL_WITHIN, Allowed, Bias, LEAST_TOLD, Placed, USUAL_WITHIN, bias, poisson_tail,
};
use nurbskin_geometry::numeric::statistics::{normal_exceeded, normal_tail};
use nurbskin_geometry::unit::{Unit, counted, grouped, percent};
use serde::{Deserialize, Serialize};

/// Probability below which noise does not explain the number of points outside: 3.5 standard deviations.
const UNEXPLAINED: f64 = 2.3e-4;
/// Margin of an advised tolerance beyond the noise.
const ROOM: f64 = 1.05;

/// Default of the required share of the points of a cloud, a mesh or a range image within the tolerance. Scanners
/// produce one point in some hundreds off the surface: at edges, in reflections, on dust.
pub const USUAL_SHARE: f64 = USUAL_WITHIN;

/// The verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The surface is within the tolerance.
    Pass,
    /// The surface is not within the tolerance.
    Fail,
    /// The scan allows no decision: it is too noisy or too sparse, or has no points on too much of the part.
    CannotTell,
    /// No tolerance was given, and there is no other finding.
    NotAsked,
}

impl Verdict {
    /// The name in the JSON contract: `pass`, `fail`, `cannot_tell` or `not_asked`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Pass => "pass",
            Verdict::Fail => "fail",
            Verdict::CannotTell => "cannot_tell",
            Verdict::NotAsked => "not_asked",
        }
    }
    /// Whether the surface is within the tolerance.
    #[must_use]
    pub fn is_pass(self) -> bool {
        self == Verdict::Pass
    }
    /// Whether there is no adverse finding: `pass`, or `not_asked`. The command's exit status is then 0, else 3.
    #[must_use]
    pub fn is_good(self) -> bool {
        self.gravity() == 0
    }
    /// Severity: 0 for `pass` and `not_asked`, 1 for `cannot_tell`, 2 for `fail`.
    pub(crate) fn gravity(self) -> u8 {
        match self {
            Verdict::Pass | Verdict::NotAsked => 0,
            Verdict::CannotTell => 1,
            Verdict::Fail => 2,
        }
    }
}

/// One reason for a verdict.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Reason {
    /// The finding, with numbers and units.
    pub what: String,
    /// The place of the finding, if it has one: a point in the scan's coordinates, after the alignment if any.
    #[serde(rename = "where")]
    pub where_: Option<[f64; 3]>,
    /// One remedy, if there is one.
    pub next: Option<String>,
}

impl Reason {
    /// A reason without a place and a remedy.
    pub fn new(what: impl Into<String>) -> Self {
        Self {
            what: what.into(),
            ..Self::default()
        }
    }

    /// The same with a remedy.
    #[must_use]
    pub fn next(mut self, next: impl Into<String>) -> Self {
        self.next = Some(next.into());
        self
    }

    /// The same at this place.
    #[must_use]
    pub fn at(mut self, place: [f64; 3]) -> Self {
        self.where_ = Some(place);
        self
    }

    /// Finding and remedy as one sentence.
    pub(crate) fn words_with_next(&self) -> String {
        match &self.next {
            Some(next) => format!("{}; {next}", self.what),
            None => self.what.clone(),
        }
    }

    /// Finding and place as one sentence; the place in `unit`.
    #[must_use]
    pub fn words(&self, unit: Unit) -> String {
        match self.where_ {
            Some(place) => format!("{}, at {}", self.what, unit.place(place)),
            None => self.what.clone(),
        }
    }
}

/// A verdict with its reasons.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judgement {
    /// The verdict.
    pub verdict: Verdict,
    /// One sentence with the figures of the verdict.
    pub summary: String,
    /// The reasons against `pass`, the most serious first; empty for `pass` and `not_asked`.
    pub reasons: Vec<Reason>,
}

impl Judgement {
    /// The first reason in words, or the [`summary`](Self::summary) if there is none; places in `unit`.
    #[must_use]
    pub fn reason(&self, unit: Unit) -> String {
        match self.reasons.first() {
            Some(first) => first.words(unit),
            None => self.summary.clone(),
        }
    }

    /// The same with `by`, the offset subtracted from all coordinates, added to the places.
    #[must_use]
    pub fn moved(mut self, by: DVec3) -> Self {
        for place in self.reasons.iter_mut().filter_map(|r| r.where_.as_mut()) {
            *place = (DVec3::from(*place) + by).to_array();
        }
        self
    }

    /// The worse of this and another finding, whose reasons are added.
    pub(crate) fn add(&mut self, verdict: Verdict, reason: Reason) {
        let before = worse(&mut self.verdict, verdict);
        let place = if before { 0 } else { self.reasons.len() };
        self.reasons.insert(place, reason);
    }
}

/// Makes a verdict the worse of itself and another; returns whether it changed.
pub(crate) fn worse(verdict: &mut Verdict, other: Verdict) -> bool {
    let graver = other.gravity() > verdict.gravity();
    if graver {
        *verdict = other;
    }
    graver
}

/// The resolution of the scan; lengths in the unit of the points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolution {
    /// Standard deviation of the measured noise; `None` where the points are too few, or too sparse, for an estimate.
    pub noise: Option<f64>,
    /// Typical distance of neighbouring points.
    pub spacing: f64,
    /// Diagonal of the box around the points.
    pub extent: f64,
    /// Unit of these lengths, for the messages.
    pub unit: Unit,
}

/// Requirements on the deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asked {
    /// Largest distance allowed, in the unit of the points.
    pub tolerance: f64,
    /// Required share (0..=1) of the points within it.
    pub within: f64,
}

/// Judges the deviation of points against a tolerance; `places` are the coordinates of these points.
///
/// ```
/// use nurbskin::{DVec3, Unit};
/// use nurbskin::deviation::measure::{Deviation, Place, PointDeviation};
/// use nurbskin::deviation::verdict::{Asked, Resolution, Verdict, judge};
/// let points: Vec<PointDeviation> = (0..100).map(|k| {
///     let (u, v) = ((k % 10) as f64, (k / 10) as f64);
///     PointDeviation { lower: 0.01, upper: 0.01, side: 1.0, u, v, face: 0, place: Place::Interior }
/// }).collect();
/// let places: Vec<DVec3> = points.iter().map(|p| DVec3::new(p.u, p.v, p.signed())).collect();
/// let deviation = Deviation::new(points, 0.1);
/// let scan = Resolution { noise: Some(0.005), spacing: 1.0, extent: 13.0, unit: Unit::Millimetre };
/// let answer = |asked| judge(&deviation, &places, asked, scan).verdict;
/// assert_eq!(answer(Some(Asked { tolerance: 0.1, within: 0.995 })), Verdict::Pass);
/// assert_eq!(answer(Some(Asked { tolerance: 0.005, within: 0.995 })), Verdict::CannotTell);
/// assert_eq!(answer(None), Verdict::NotAsked);
/// ```
#[must_use]
pub fn judge(
    deviation: &Deviation,
    places: &[DVec3],
    asked: Option<Asked>,
    scan: Resolution,
) -> Judgement {
    if deviation.points.is_empty() {
        let what = "there are no points to compare";
        return cannot_tell(what.into(), vec![Reason::new(what)]);
    }
    let Some(asked) = asked else {
        return Judgement {
            verdict: Verdict::NotAsked,
            summary: unasked(&deviation.statistics, scan),
            reasons: Vec::new(),
        };
    };
    let found = Found::new(deviation, places, asked, scan);
    found.nothing_shown().unwrap_or_else(|| found.judged())
}

/// The figures without a tolerance, and the resolution of the scan.
pub(crate) fn unasked(statistics: &Statistics, scan: Resolution) -> String {
    let length = |x: f64| scan.unit.length(x);
    let noise = match scan.noise {
        Some(noise) => format!("noise is {}", length(noise)),
        None => "noise is not known".to_owned(),
    };
    format!(
        "no tolerance was given; 95 % of {} are within {}, the worst is {}; the scan's {noise}, its spacing {}",
        counted(statistics.count, "point", "points"),
        length(statistics.p95),
        scan.unit.signed_length(worst_of(statistics)),
        length(scan.spacing),
    )
}

/// The largest deviation with its sign.
fn worst_of(statistics: &Statistics) -> f64 {
    if -statistics.signed_min > statistics.signed_max {
        statistics.signed_min
    } else {
        statistics.signed_max
    }
}

fn cannot_tell(summary: String, reasons: Vec<Reason>) -> Judgement {
    Judgement {
        verdict: Verdict::CannotTell,
        summary,
        reasons,
    }
}

/// Comparison of a deviation with a tolerance.
struct Found<'a> {
    deviation: &'a Deviation,
    places: &'a [DVec3],
    asked: Asked,
    scan: Resolution,
    noise: f64,
    outside: usize,
    bias: Bias,
    /// Limit of the mean deviation of a region.
    offset: f64,
}

impl<'a> Found<'a> {
    fn new(deviation: &'a Deviation, places: &'a [DVec3], asked: Asked, scan: Resolution) -> Self {
        let Asked { tolerance, within } = asked;
        let noise = scan.noise.unwrap_or(0.0).max(0.0);
        let points = &deviation.points;
        let outside = points.iter().filter(|p| p.upper > tolerance).count();
        let allowed = Allowed::in_verdicts(tolerance, noise, within, points.len());
        let placed: Vec<Placed> = points
            .iter()
            .map(|p| Placed {
                face: p.face,
                u: p.u,
                v: p.v,
                signed: p.signed(),
            })
            .collect();
        Self {
            deviation,
            places,
            asked,
            scan,
            noise,
            outside,
            bias: bias(&placed, allowed),
            offset: allowed.offset,
        }
    }

    fn count(&self) -> usize {
        self.deviation.points.len()
    }

    fn length(&self, x: f64) -> String {
        self.scan.unit.length(x)
    }

    /// Whether the required share is within the tolerance.
    fn meets(&self) -> bool {
        let count = self.count() as f64;
        // Rounding of the share must not require an additional point.
        self.outside as f64 <= (1.0 - self.asked.within) * count + 1e-9 * count
    }

    /// The number of points within the tolerance, and the worst point.
    fn share(&self) -> String {
        let (count, tolerance) = (self.count(), self.length(self.asked.tolerance));
        let points = counted(count, "point", "points");
        let worst = self
            .scan
            .unit
            .signed_length(worst_of(&self.deviation.statistics));
        if self.outside == 0 {
            return format!("all {points} are within +-{tolerance}; the worst is {worst}");
        }
        let share = self.outside as f64 / count as f64;
        let allowed = match self.asked.within >= 1.0 {
            true => "none".to_owned(),
            false => percent(1.0 - self.asked.within),
        };
        format!(
            "{} of {points} ({}) {} outside +-{tolerance}, {allowed} may be; the worst is {worst}",
            grouped(self.outside),
            percent(share),
            if self.outside == 1 { "is" } else { "are" },
        )
    }

    /// Whether regions are biased.
    fn regions(&self) -> String {
        let tested = counted(self.bias.tested, "region", "regions");
        match &self.bias.worst {
            _ if self.bias.tested == 0 => "the points are too few for regions".into(),
            None => "no region is biased".into(),
            Some(worst) => format!(
                "{} of {tested} {} biased: the worst is off by {} on average, {} is allowed",
                self.bias.biased,
                if self.bias.biased == 1 { "is" } else { "are" },
                self.scan.unit.signed_length(worst.mean),
                self.length(self.offset),
            ),
        }
    }

    fn summary(&self) -> String {
        format!("{}; {}", self.share(), self.regions())
    }

    /// The point with the largest deviation.
    fn worst_place(&self) -> Option<[f64; 3]> {
        let points = self.deviation.points.iter().enumerate();
        let (k, _) = points.max_by(|a, b| a.1.upper.total_cmp(&b.1.upper))?;
        Some(self.places.get(k)?.to_array())
    }

    /// The central point of the region with the largest deviation.
    fn biased_place(&self) -> Option<[f64; 3]> {
        let region = self.bias.worst.as_ref()?;
        let places = || region.points.iter().filter_map(|&k| self.places.get(k));
        let middle = places().sum::<DVec3>() / places().count().max(1) as f64;
        let by_distance = |a: &&DVec3, b: &&DVec3| {
            let to = |p: &DVec3| p.distance_squared(middle);
            to(a).total_cmp(&to(b))
        };
        Some(places().min_by(by_distance)?.to_array())
    }

    /// The verdict where the scan allows no decision, whatever the regions.
    fn nothing_shown(&self) -> Option<Judgement> {
        let tolerance = self.asked.tolerance;
        let said = |why: &str| format!("{}; {why}", self.summary());
        let answer = |why: String, next: &str| {
            let reason = Reason::new(said(&why)).next(next);
            cannot_tell(said(&why), vec![reason])
        };
        if self.meets() && self.scan.noise.is_none() {
            return Some(answer(
                "but the points are too few, or too sparse, to tell their noise and what lies between them".into(),
                "scan more densely",
            ));
        }
        if self.meets() && tolerance >= self.scan.extent {
            return Some(answer(
                format!(
                    "but the tolerance is as large as the scan, whose diagonal is {}",
                    self.length(self.scan.extent)
                ),
                "check the unit of the scan (--unit) and of the tolerance (-t)",
            ));
        }
        let noise = self.noise;
        if tolerance < LEAST_TOLD * noise
            && self.deviation.statistics.p50 <= tolerance + 2.0 * noise
        {
            return Some(answer(
                format!(
                    "but the tolerance is below two standard deviations of the scan's noise, {}",
                    self.length(noise)
                ),
                &self.wider(),
            ));
        }
        if tolerance < ALL_WITHIN * noise && self.bias.tested == 0 {
            return Some(answer(
                format!(
                    "and bias cannot be told from the noise, {}",
                    self.length(noise)
                ),
                "scan more densely",
            ));
        }
        None
    }

    /// The advice of a tolerance that leaves room for this noise.
    fn wider(&self) -> String {
        let beyond = (1.0 - self.asked.within).max(0.5 / self.count() as f64);
        let least = ROOM * normal_exceeded(0.5 * beyond) * self.noise;
        format!(
            "scan with less noise, or allow a tolerance of {} (-t), which this noise can show",
            self.length(least)
        )
    }

    fn judged(&self) -> Judgement {
        let biased = self.bias.worst.is_some();
        let (meets, summary) = (self.meets(), self.summary());
        if meets && !biased {
            return Judgement {
                verdict: Verdict::Pass,
                summary,
                reasons: Vec::new(),
            };
        }
        if !biased && self.noise_explains() {
            let what = format!(
                "{summary}; the scan's noise of {} alone leaves as many outside",
                self.length(self.noise)
            );
            let reason = Reason {
                what: what.clone(),
                where_: self.worst_place(),
                next: Some(self.wider()),
            };
            return cannot_tell(what, vec![reason]);
        }
        let mut reasons = Vec::new();
        if !meets {
            reasons.push(Reason {
                what: match biased {
                    true => self.share(),
                    false => summary.clone(),
                },
                where_: self.worst_place(),
                next: None,
            });
        }
        if biased {
            reasons.push(Reason {
                what: match meets {
                    true => format!("{}; {}", self.regions(), self.share()),
                    false => self.regions(),
                },
                where_: self.biased_place(),
                next: None,
            });
        }
        Judgement {
            verdict: Verdict::Fail,
            summary,
            reasons,
        }
    }

    /// Whether the noise around a perfect surface explains the number of points outside.
    fn noise_explains(&self) -> bool {
        let tolerance = self.asked.tolerance;
        if self.noise <= 0.0 || tolerance < LEAST_TOLD * self.noise {
            return false;
        }
        let expected = 2.0 * normal_tail(tolerance / self.noise) * self.count() as f64;
        poisson_tail(expected, self.outside) >= UNEXPLAINED
    }
}

#[cfg(test)]
mod tests;

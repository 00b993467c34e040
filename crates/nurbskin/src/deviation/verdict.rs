//! Pass, fail or cannot tell, and why.
//!
//! With a standard deviation sigma of the noise and a tolerance T:
//!
//! - **pass** if every point is within T; or, where T < 4 sigma, if 99.5 % of the points are and no *significant bias*
//!   remains: in no cell of a grid over (u, v) is the mean signed deviation beyond `0.2 T + z sigma / sqrt(n)`, or are
//!   more points beyond T on one side than the share of outliers explains. A point farther than 2.5 sigma from the median of
//!   its cell counts as that far in the mean, so that a few outliers, which the share beyond T counts, do not pass for bias;
//!   z, at least 3.5, and the number of points beyond T leave a perfect surface one chance in a hundred to fail in any of
//!   the cells, however many they are.
//!   (At 4 sigma one point in 16 000 is beyond T for a perfect surface, so above it all must be within.)
//! - **cannot tell** if T < 2 sigma: then a single measurement is less certain (95 %) than T is wide, a perfect surface
//!   would leave more than one point in twenty outside, and a surface that goes through the points only follows the
//!   noise. Up to 2.81 sigma a perfect surface leaves 0.5 % outside or more; if the share outside and the cell means are
//!   what noise alone makes them, the answer is the same. So it is if T < 4 sigma and there are too few points for one
//!   cell: then noise and bias cannot be told apart.
//!   Where the points are too few, or too sparse, to tell the noise, or T is as large as the scan, points within T show nothing either.
//! - **fail** otherwise; below 2 sigma only if more than half of the points are farther than T + 2 sigma, which no noise
//!   of that size explains.

use super::measure::Deviation;
use crate::numeric::bias::{ALL_WITHIN, Placed, bias};
use crate::unit::Unit;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// The answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The surface is within the tolerance.
    Pass,
    /// It is not.
    Fail,
    /// The scan cannot show it: it is too noisy, too sparse, or has no points on too much of the part.
    CannotTell,
    /// No tolerance was given, and nothing else is amiss.
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
    /// Whether nothing is amiss: `pass`, or `not_asked`. The command's exit status is 0 then, else 3.
    #[must_use]
    pub fn is_good(self) -> bool {
        matches!(self, Verdict::Pass | Verdict::NotAsked)
    }
}

/// One reason for a verdict.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Reason {
    /// What is the case, with numbers and units.
    pub what: String,
    /// Where, if it is at one place: a point in the scan's coordinates, aligned if the scan was.
    #[serde(rename = "where")]
    pub where_: Option<[f64; 3]>,
    /// One thing to do about it, if there is one.
    pub next: Option<String>,
}

impl Reason {
    /// A reason without a place and without advice.
    pub fn new(what: impl Into<String>) -> Self {
        Self {
            what: what.into(),
            ..Self::default()
        }
    }

    /// The same with one thing to do about it.
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

    /// What, and where, as one sentence for people; the place in `unit`.
    #[must_use]
    pub fn words(&self, unit: Unit) -> String {
        match self.where_ {
            Some(place) => format!("{}, at {}", self.what, unit.place(place)),
            None => self.what.clone(),
        }
    }
}

/// The answer with its reasons.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judgement {
    /// The answer.
    pub verdict: Verdict,
    /// One sentence with the figures that the answer rests on.
    pub summary: String,
    /// Why the answer is not `pass`; none for `pass` and `not_asked`.
    pub reasons: Vec<Reason>,
}

impl Judgement {
    /// The first reason in words, or the [`summary`](Self::summary) where there is none; places in `unit`.
    #[must_use]
    pub fn reason(&self, unit: Unit) -> String {
        match self.reasons.first() {
            Some(first) => first.words(unit),
            None => self.summary.clone(),
        }
    }
}

/// What the scan can show; lengths in the unit of the points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolution {
    /// Standard deviation of the measured noise; `None` where the points are too few, or too sparse, to tell.
    pub noise: Option<f64>,
    /// Typical distance of neighbouring points.
    pub spacing: f64,
    /// Diagonal of the box around the points.
    pub extent: f64,
    /// Unit of all of this, for the sentences.
    pub unit: Unit,
}

/// The share of the points of a cloud, a mesh or a range image that must be within the tolerance unless another is asked
/// for. Scanners leave one point in some hundreds off the surface: at edges, on glints, in dust.
pub const USUAL_SHARE: f64 = 0.995;

/// What the deviation is judged by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asked {
    /// Largest distance allowed, in the unit of the points.
    pub tolerance: f64,
    /// Share (0..=1) of the points that must be within it.
    pub within: f64,
}

/// Judges the deviation of points against a tolerance; `places` are these points.
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
    _places: &[DVec3],
    asked: Option<Asked>,
    scan: Resolution,
) -> Judgement {
    let Some(Asked { tolerance, .. }) = asked else {
        return Judgement {
            verdict: Verdict::NotAsked,
            summary: "no tolerance was given".into(),
            reasons: Vec::new(),
        };
    };
    let statistics = &deviation.statistics;
    let noise = scan.noise.unwrap_or(0.0).max(0.0);
    let count = deviation.points.len();
    let answer = |verdict: Verdict, summary: String| Judgement {
        reasons: match verdict.is_good() {
            true => Vec::new(),
            false => vec![Reason::new(summary.clone())],
        },
        verdict,
        summary,
    };
    let (limit, sigma) = (digits(tolerance), digits(noise));
    let largest = digits(statistics.max);
    if count == 0 {
        return answer(
            Verdict::CannotTell,
            "there are no points to compare".to_owned(),
        );
    }
    let outside = deviation
        .points
        .iter()
        .filter(|p| p.upper > tolerance)
        .count();
    if outside == 0 && scan.noise.is_none() {
        return answer(
            Verdict::CannotTell,
            format!(
                "all {count} points are within {limit}, the largest deviation is {largest}; they are too few, or too \
                 sparse, to tell their noise, and what lies between them"
            ),
        );
    }
    if outside == 0 && tolerance >= scan.extent {
        return answer(
            Verdict::CannotTell,
            format!(
                "the tolerance {limit} is larger than the scan itself, {}: is its unit right?",
                digits(scan.extent)
            ),
        );
    }
    if tolerance >= ALL_WITHIN * noise {
        return if outside == 0 {
            answer(
                Verdict::Pass,
                format!(
                    "all {count} points are within {limit}; the largest deviation is {largest}"
                ),
            )
        } else {
            answer(
                Verdict::Fail,
                format!("{outside} of {count} points are farther than {limit}, up to {largest}"),
            )
        };
    }
    if tolerance < 2.0 * noise {
        return if statistics.p50 > tolerance + 2.0 * noise {
            answer(
                Verdict::Fail,
                format!(
                    "half of the points are farther than {}, which the noise of {sigma} does not explain",
                    digits(statistics.p50)
                ),
            )
        } else {
            answer(
                Verdict::CannotTell,
                format!(
                    "the tolerance {limit} is below two standard deviations of the scan's noise ({sigma})"
                ),
            )
        };
    }
    let placed: Vec<Placed> = deviation
        .points
        .iter()
        .map(|p| Placed {
            face: p.face,
            u: p.u,
            v: p.v,
            signed: p.signed(),
        })
        .collect();
    let bias = bias(&placed, tolerance, noise);
    let share = 1.0 - outside as f64 / count as f64;
    let percent = 100.0 * share;
    if bias.tested == 0 {
        return answer(
            Verdict::CannotTell,
            format!(
                "{count} points, {} apart, are too few to tell bias from the noise of {sigma}",
                digits(scan.spacing)
            ),
        );
    }
    if let Some(mean) = bias.worst {
        return answer(
            Verdict::Fail,
            format!(
                "{} of {} regions are biased beyond the noise, up to {}",
                bias.biased,
                bias.tested,
                digits(mean)
            ),
        );
    }
    if share >= 0.995 {
        return answer(
            Verdict::Pass,
            format!(
                "{percent:.2} % of {count} points are within {limit} and no bias remains; the noise is {sigma}"
            ),
        );
    }
    let expected = within(tolerance / noise);
    let spread = (expected * (1.0 - expected) / count as f64).sqrt();
    if expected < 0.995 && share >= expected - 3.5 * spread {
        return answer(
            Verdict::CannotTell,
            format!(
                "{percent:.2} % of {count} points are within {limit}, as many as the noise of {sigma} allows"
            ),
        );
    }
    answer(
        Verdict::Fail,
        format!(
            "only {percent:.2} % of {count} points are within {limit}; the noise of {sigma} allows {:.2} %",
            100.0 * expected
        ),
    )
}

/// Probability that a normal variable is within `x` standard deviations, to 2e-7.
///
/// Source: Abramowitz and Stegun, *Handbook of Mathematical Functions*, 7.1.26.
fn within(x: f64) -> f64 {
    let z = x / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * z);
    let coefficients = [
        1.061_405_429,
        -1.453_152_027,
        1.421_413_741,
        -0.284_496_736,
        0.254_829_592,
    ];
    let polynomial = coefficients.iter().fold(0.0, |sum, c| (sum + c) * t);
    1.0 - polynomial * (-z * z).exp()
}

/// A length with four significant digits.
pub(crate) fn digits(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    #[expect(clippy::cast_possible_truncation, reason = "the exponent of an f64")]
    let places = 3 - x.abs().log10().floor() as i32;
    match usize::try_from(places) {
        Ok(places) if places <= 8 => format!("{x:.places$}"),
        Ok(_) => format!("{x:.3e}"),
        Err(_) => format!("{x:.0}"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::measure::{Place, PointDeviation, Statistics};
    use super::*;

    /// A deviation with these signed values on a square of (u, v).
    fn with(count: usize, tolerance: f64, signed: impl Fn(usize, f64, f64) -> f64) -> Deviation {
        let side = (count as f64).sqrt().ceil();
        let points: Vec<PointDeviation> = (0..count)
            .map(|k| {
                let (u, v) = ((k as f64 % side) / side, (k as f64 / side).floor() / side);
                let d = signed(k, u, v);
                PointDeviation {
                    lower: d.abs(),
                    upper: d.abs(),
                    side: if d < 0.0 { -1.0 } else { 1.0 },
                    u,
                    v,
                    face: 0,
                    place: Place::Interior,
                }
            })
            .collect();
        Deviation {
            statistics: Statistics::new(&points, tolerance),
            free_edges: Statistics::default(),
            points,
        }
    }

    /// Normal noise by the sum of twelve uniform numbers would have no tails: Box-Muller instead.
    fn normal(k: usize) -> f64 {
        let hash = |k: u64| {
            let mut x = k.wrapping_add(0x9e37_79b9_7f4a_7c15);
            x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
        };
        let (a, b) = (hash(2 * k as u64 + 1), hash(2 * k as u64 + 7_000_001));
        (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    }

    /// With places as if the surface were the square.
    fn judged(deviation: &Deviation, tolerance: f64, scan: Resolution) -> Judgement {
        let place = |p: &PointDeviation| DVec3::new(p.u, p.v, p.signed());
        let places: Vec<DVec3> = deviation.points.iter().map(place).collect();
        let within = USUAL_SHARE;
        judge(deviation, &places, Some(Asked { tolerance, within }), scan)
    }

    fn verdict(
        tolerance: f64,
        noise: f64,
        count: usize,
        signed: impl Fn(usize, f64, f64) -> f64,
    ) -> Verdict {
        let scan = Resolution {
            noise: Some(noise),
            spacing: 0.01,
            extent: 1.0,
            unit: Unit::Millimetre,
        };
        let judgement = judged(&with(count, tolerance, signed), tolerance, scan);
        assert!(!judgement.summary.is_empty());
        judgement.verdict
    }

    #[test]
    fn lengths_have_four_digits() {
        let all = [0.0, 0.1, 12.345_678, 3.21e-5, 1.5e-9, 123_456.0].map(digits);
        assert_eq!(
            all,
            ["0", "0.1000", "12.35", "0.00003210", "1.500e-9", "123456"]
        );
    }

    #[test]
    fn points_that_show_nothing_do_not_pass() {
        let scan = Resolution {
            noise: None,
            spacing: 1.0,
            extent: 10.0,
            unit: Unit::Millimetre,
        };
        let deviation = with(8, 0.1, |_, _, _| 0.0);
        assert_eq!(judged(&deviation, 0.1, scan).verdict, Verdict::CannotTell);
        // What is off is off all the same.
        let off = with(8, 0.1, |_, _, _| 0.2);
        assert_eq!(judged(&off, 0.1, scan).verdict, Verdict::Fail);
        let larger = Resolution {
            noise: Some(0.0),
            ..scan
        };
        let within = with(1000, 10.0, |_, _, _| 3.0);
        assert_eq!(judged(&within, 9.0, larger).verdict, Verdict::Pass);
        assert_eq!(judged(&within, 10.0, larger).verdict, Verdict::CannotTell);
    }

    #[test]
    fn a_quiet_scan_is_judged_by_every_point() {
        assert_eq!(verdict(0.1, 0.0, 1000, |_, _, _| 0.09), Verdict::Pass);
        let one = |k: usize, _: f64, _: f64| if k == 17 { -0.11 } else { 0.0 };
        assert_eq!(verdict(0.1, 0.0, 1000, one), Verdict::Fail);
    }

    #[test]
    fn noise_alone_passes_at_three_sigma_and_bias_fails() {
        assert_eq!(
            verdict(0.3, 0.1, 20_000, |k, _, _| 0.1 * normal(k)),
            Verdict::Pass
        );
        // A bump of 1.2 sigma in a corner leaves 99 % inside and is seen all the same.
        let bump = |k: usize, u: f64, v: f64| {
            0.1 * normal(k) + if u < 0.2 && v < 0.2 { 0.15 } else { 0.0 }
        };
        assert_eq!(verdict(0.39, 0.1, 20_000, bump), Verdict::Fail);
    }

    #[test]
    fn outliers_are_no_bias_but_what_lies_off_together_is() {
        // One point in 300 anywhere within 60 sigma.
        let scattered = |k: usize, _: f64, _: f64| match k % 300 {
            0 => 2.0 * normal(k + 500_000),
            _ => 0.1 * normal(k),
        };
        assert_eq!(verdict(0.3, 0.1, 10_000, scattered), Verdict::Pass);
        // Two of them side by side.
        let two = |k: usize, _: f64, _: f64| match k {
            5050 | 5051 => 6.0,
            _ => 0.1 * normal(k),
        };
        assert_eq!(verdict(0.3, 0.1, 10_000, two), Verdict::Pass);
        // A feature of 8 x 4 points that was smoothed away lies in a corner of four cells or half of one: 99.6 % of the
        // points are within, and their median is none the wiser.
        for (from, to) in [((30, 30), (38, 34)), ((33, 36), (41, 40))] {
            let feature = move |k: usize, _: f64, _: f64| {
                let inside =
                    (from.0..to.0).contains(&(k % 100)) && (from.1..to.1).contains(&(k / 100));
                0.1 * normal(k) + if inside { 0.6 } else { 0.0 }
            };
            assert_eq!(verdict(0.3, 0.1, 10_000, feature), Verdict::Fail);
        }
        // One that is wider and lower: no more points beyond the tolerance than noise explains.
        let low = |k: usize, u: f64, v: f64| {
            let inside = (0.4..0.55).contains(&u) && (0.4..0.55).contains(&v);
            0.1 * normal(k) + if inside { 0.17 } else { 0.0 }
        };
        assert_eq!(verdict(0.38, 0.1, 10_000, low), Verdict::Fail);
    }

    #[test]
    fn perfect_surfaces_hardly_ever_fail() {
        // 100 scans, of which each may fail with one chance in a hundred; 0.2 % outliers within reach.
        let failed = (0..100)
            .filter(|&scan| {
                let signed = |k: usize, _: f64, _: f64| {
                    let k = k + 20_000 * scan;
                    let outlier = k.wrapping_mul(2_654_435_761) % 1000 < 2;
                    if outlier { normal(k) } else { 0.1 * normal(k) }
                };
                verdict(0.35, 0.1, 5_000, signed) == Verdict::Fail
            })
            .count();
        assert!(failed <= 4, "{failed}");
    }

    #[test]
    fn below_the_noise_nothing_can_be_told_unless_it_is_gross() {
        let noise = |k: usize, _: f64, _: f64| 0.1 * normal(k);
        assert_eq!(verdict(0.02, 0.1, 20_000, noise), Verdict::CannotTell);
        assert_eq!(verdict(0.25, 0.1, 20_000, noise), Verdict::CannotTell);
        assert_eq!(
            verdict(0.02, 0.1, 20_000, |_, _, _| 0.0),
            Verdict::CannotTell
        );
        assert_eq!(verdict(0.02, 0.1, 20_000, |_, _, _| 5.0), Verdict::Fail);
        assert_eq!(
            verdict(0.25, 0.1, 20_000, |k, _, _| 0.2 * normal(k)),
            Verdict::Fail
        );
        assert_eq!(verdict(0.3, 0.1, 4, noise), Verdict::CannotTell);
        assert_eq!(verdict(0.3, 0.1, 0, noise), Verdict::CannotTell);
    }

    #[test]
    fn normal_probabilities() {
        for (x, p) in [(1.0, 0.682_689_5), (2.0, 0.954_499_7), (2.807_03, 0.995)] {
            assert!((within(x) - p).abs() < 1e-6);
        }
    }
}

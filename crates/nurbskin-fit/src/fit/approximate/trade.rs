//! The trade-off between control points and deviation: the surfaces that a fit visited, as a curve.
//!
//! ```text
//! curve: lower left envelope of (N, p95);   between rounds log N is linear in log T
//! ```
//!
//! The knee is the point of the curve farthest below its chord on logarithmic axes; neighbours are other tolerances
//! with the interpolated number of control points that they take.
//!
//! Source: knee by V. Satopaa, J. Albrecht, D. Irwin, B. Raghavan, *Finding a "Kneedle" in a Haystack*, 2011; the
//! interpolation is ours.

use nurbskin_geometry::math;
use nurbskin_geometry::unit::{Unit, grouped, three_digits};
use serde::{Deserialize, Serialize};

/// Fewest points of a curve in which a knee is looked for. Count.
/// Guard: through three points a bend is the chance of one.
const MIN_KNEE_POINTS: usize = 4;
/// Least height of a knee above the chord, as a share of the diagram.
/// Guard: less is the scatter of a straight line.
const MIN_KNEE_HEIGHT: f64 = 0.05;
/// Factors by which a tolerance is loosened or tightened for a neighbour; the first that changes the size is reported.
/// Dimensionless.
/// Guard: a choice of what is worth reading.
const NEIGHBOUR_FACTORS: [f64; 2] = [2.0, 4.0];
/// Ratio of control points up to which two surfaces count as of the same size. Dimensionless.
/// Guard: searches scatter by that much.
const SAME_SIZE_RATIO: f64 = 1.1;
/// Largest factor of the tolerance by which the curve is continued past its last point. Dimensionless.
/// Guard: farther the slope of the end says little.
const MAX_EXTRAPOLATION: f64 = 2.0;
/// Least ratio of control points of the two points that give the slope at the end of the curve. Dimensionless.
/// Guard: over a shorter base the slope is chance.
const SLOPE_BASE_RATIO: f64 = 2.0;
/// Largest relative change of a number by rounding to two digits. Dimensionless.
/// Derived: half a unit in the second digit of 1.0 is 0.05.
const TWO_DIGIT_ROUNDING: f64 = 0.05;

/// A surface that a fit visited. Lengths are in the unit of the points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TradePoint {
    /// Distinct control points.
    pub control_points: usize,
    /// Distance that 95 % of the points keep.
    pub p95: f64,
    /// Largest distance of a point that is no outlier.
    pub max: f64,
    /// Distance that the share of the points keeps which a tolerance demands.
    pub tolerance: f64,
}

impl TradePoint {
    /// Whether all its figures have logarithms.
    fn is_positive(&self) -> bool {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        self.control_points > 0
            && [self.p95, self.max, self.tolerance]
                .into_iter()
                .all(positive)
    }
}

/// The surfaces that a fit visited.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Met {
    /// Every surface, in order.
    pub surfaces: Vec<TradePoint>,
    /// The surfaces of the main rounds of a search, each larger than the one before by a fixed factor. These rounds do
    /// not depend on the tolerance. Fewer than two where no search was made.
    pub way: Vec<TradePoint>,
}

impl Met {
    /// The largest surface of the main rounds, the last one of several.
    #[must_use]
    pub fn largest(&self) -> Option<&TradePoint> {
        self.way.iter().max_by_key(|p| p.control_points)
    }

    /// The order at which the tolerance falls with the control points up to the largest surface of the main rounds, from
    /// one with half as many or fewer: k where it falls as `N^-k`, negative where it rises. It is 2 for a smooth
    /// bicubic surface, whose distance falls with the fourth power of its spans (C. de Boor, *A Practical Guide to
    /// Splines*, ch. XII). `None` where there are no such rounds. O(n).
    ///
    /// ```
    /// use nurbskin_fit::fit::approximate::trade::{Met, TradePoint};
    /// let point = |control_points, tolerance| TradePoint { control_points, p95: tolerance, max: tolerance, tolerance };
    /// let way = vec![point(100, 1.6), point(160, 0.5), point(200, 0.4)];
    /// let met = Met { surfaces: Vec::new(), way };
    /// assert!((met.order().unwrap() - 2.0).abs() < 1e-12);
    /// assert_eq!(Met::default().order(), None);
    /// ```
    #[must_use]
    pub fn order(&self) -> Option<f64> {
        let last = self.largest()?;
        let is_before = |p: &&TradePoint| {
            p.control_points as f64 * SLOPE_BASE_RATIO <= last.control_points as f64
        };
        let before = self.way.iter().filter(is_before);
        let before = before.max_by_key(|p| p.control_points)?;
        let growth = last.control_points as f64 / before.control_points as f64;
        let order = math::ln(before.tolerance / last.tolerance) / math::ln(growth);
        order.is_finite().then_some(order)
    }
}

/// Another tolerance, and about how many control points it would take.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Neighbour {
    /// The tolerance, to two digits.
    pub tolerance: f64,
    /// Control points, to two digits.
    pub control_points: usize,
    /// Whether it lies past the last surface of the fit.
    pub extrapolated: bool,
}

/// Bounds for neighbours.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    /// The requested tolerance if it is kept, or the one that the chosen surface keeps.
    pub tolerance: f64,
    /// The least tolerance that may be promised; infinite where none below `tolerance` may.
    pub least: f64,
    /// Most control points that may be promised.
    pub most: usize,
}

/// The trade-off curve through the chosen surface: ascending in control points, descending in p95.
///
/// A surface is omitted where another one has no more control points and is as close. A surface is also omitted that
/// would exclude the chosen one in this way: its figures are from the fit, before trimming, and often from a subset of
/// the points; those of the chosen surface are final. O(n log n).
///
/// ```
/// use nurbskin_fit::fit::approximate::trade::{TradePoint, curve};
/// let point = |control_points, p95| TradePoint { control_points, p95, max: 2.0 * p95, tolerance: p95 };
/// let met = [point(100, 0.1), point(50, 0.4), point(160, 0.2), point(200, 0.05)];
/// assert_eq!(curve(&met, point(120, 0.08)), [point(50, 0.4), point(100, 0.1), point(120, 0.08), point(200, 0.05)]);
/// ```
#[must_use]
pub fn curve(met: &[TradePoint], chosen: TradePoint) -> Vec<TradePoint> {
    envelope(met, chosen, |point| point.p95)
}

/// The lower left envelope, through the chosen point.
fn envelope(met: &[TradePoint], chosen: TradePoint, of: fn(&TradePoint) -> f64) -> Vec<TradePoint> {
    let (size, height) = (chosen.control_points, of(&chosen));
    // Left and above, or right and below.
    let fits = |p: &&TradePoint| match p.control_points.cmp(&size) {
        std::cmp::Ordering::Less => of(p) > height,
        std::cmp::Ordering::Equal => false,
        std::cmp::Ordering::Greater => of(p) < height,
    };
    let mut all: Vec<TradePoint> = met
        .iter()
        .filter(|p| p.is_positive())
        .filter(fits)
        .copied()
        .collect();
    all.push(chosen);
    all.sort_by(|a, b| (a.control_points.cmp(&b.control_points)).then(of(a).total_cmp(&of(b))));
    let mut lowest = f64::INFINITY;
    all.retain(|p| {
        let lower = of(p) < lowest;
        lowest = lowest.min(of(p));
        lower
    });
    all
}

/// The number of control points beyond which more of them gain little: where the curve of p95, on logarithmic axes, is
/// farthest below the chord between its ends. `None` for fewer than four points, or where the curve hardly bends that
/// way.
///
/// Source: V. Satopaa, J. Albrecht, D. Irwin, B. Raghavan, *Finding a "Kneedle" in a Haystack: Detecting Knee Points in
/// System Behavior*, 2011, without its smoothing.
#[must_use]
pub fn knee(curve: &[TradePoint]) -> Option<usize> {
    let points: Vec<&TradePoint> = curve.iter().filter(|p| p.is_positive()).collect();
    let (first, last) = (points.first()?, points.last()?);
    let wide = math::ln(last.control_points as f64 / first.control_points as f64);
    let tall = math::ln(first.p95 / last.p95);
    if points.len() < MIN_KNEE_POINTS || wide <= 0.0 || tall <= 0.0 {
        return None;
    }
    let bend = |p: &TradePoint| {
        let along = math::ln(p.control_points as f64 / first.control_points as f64) / wide;
        math::ln(first.p95 / p.p95) / tall - along
    };
    let bends = points.iter().map(|p| (bend(p), p.control_points));
    let (most, control_points) = bends.reduce(|a, b| if b.0 > a.0 { b } else { a })?;
    (most >= MIN_KNEE_HEIGHT).then_some(control_points)
}

/// Other tolerances of interest: one looser with fewer control points, then one tighter with more; each if it exists.
///
/// A search with another tolerance follows the same sequence to its first surface that keeps it, and bisects the step
/// before. So between two steps the logarithm of the control points is linear in that of the tolerance. Past the last
/// one the curve is continued by a factor of two at most, with the slope at its end.
#[must_use]
pub fn neighbours(met: &Met, chosen: TradePoint, range: Range) -> Vec<Neighbour> {
    let mut way: Vec<TradePoint> = met
        .way
        .iter()
        .filter(|p| p.is_positive())
        .copied()
        .collect();
    if way.len() < 2 {
        way = envelope(&met.surfaces, chosen, |point| point.tolerance);
    }
    let size = chosen.control_points as f64;
    if !chosen.is_positive() || met.surfaces.is_empty() {
        return Vec::new();
    }
    if way
        .last()
        .is_none_or(|last| last.control_points < chosen.control_points)
    {
        way.push(chosen);
    }
    let at = |tolerance: f64| -> Option<(f64, Neighbour)> {
        let tolerance = two_digits(tolerance);
        let (mut count, extrapolated) = needed(&way, tolerance)?;
        if chosen.tolerance <= tolerance {
            count = count.min(size);
        }
        let good = tolerance >= range.least && count <= range.most as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive and no more than the limit"
        )]
        good.then(|| {
            let control_points = two_digits(count).round() as usize;
            (
                count,
                Neighbour {
                    tolerance,
                    control_points,
                    extrapolated,
                },
            )
        })
    };
    let mut looser = NEIGHBOUR_FACTORS
        .iter()
        .filter_map(|f| at(range.tolerance * f));
    let mut tighter = NEIGHBOUR_FACTORS
        .iter()
        .filter_map(|f| at(range.tolerance / f));
    let fewer = looser.find(|n| n.0 * SAME_SIZE_RATIO <= size);
    let more = tighter.find(|n| n.0 >= SAME_SIZE_RATIO * size);
    fewer.into_iter().chain(more).map(|found| found.1).collect()
}

/// The number of control points for a tolerance, and whether it is extrapolated; `None` too far past the last step.
fn needed(way: &[TradePoint], tolerance: f64) -> Option<(f64, bool)> {
    let last = way.last()?;
    let count = |p: &TradePoint| p.control_points as f64;
    let reached = way.iter().position(|p| p.tolerance <= tolerance);
    let (from, to) = match reached {
        Some(0) => return Some((count(&way[0]), false)),
        Some(k) => (&way[k - 1], &way[k]),
        None if MAX_EXTRAPOLATION * tolerance * (1.0 + TWO_DIGIT_ROUNDING) < last.tolerance => {
            return None;
        }
        None => {
            let mut before = way.iter().rev();
            let from = before.find(|p| SLOPE_BASE_RATIO * count(p) <= count(last))?;
            (from, last)
        }
    };
    let slope = math::ln(count(to) / count(from)) / math::ln(from.tolerance / to.tolerance);
    let found = count(to) * math::exp(slope * math::ln(to.tolerance / tolerance));
    (slope >= 0.0 && found.is_finite()).then_some((found, reached.is_none()))
}

/// A positive number with two significant digits.
fn two_digits(x: f64) -> f64 {
    let step = math::powf(10_f64, math::log10(x).floor() - 1.0);
    let rounded = (x / step).round();
    // Division by an exact power of ten rounds once: 0.2, not 0.2000...01.
    match step < 1.0 {
        true => rounded / (1.0 / step).round(),
        false => rounded * step,
    }
}

/// The neighbours in words: `-t 0.2mm would take about 640 control points, -t 50um about 5200`; `None` without any.
#[must_use]
pub fn said(neighbours: &[Neighbour], unit: Unit) -> Option<String> {
    let option = |x: f64| {
        let text = unit.length(x).replace(' ', "");
        // The option parser does not know these units.
        match text.ends_with("nm") || text.ends_with("km") {
            true => format!("-t {}{unit}", three_digits(x)),
            false => format!("-t {text}"),
        }
    };
    let mut words = neighbours.iter().enumerate().map(|(k, n)| {
        let count = grouped(n.control_points);
        match k {
            0 => format!(
                "{} would take about {count} control points",
                option(n.tolerance)
            ),
            _ => format!("{} about {count}", option(n.tolerance)),
        }
    });
    let first = words.next()?;
    Some(words.fold(first, |all, next| format!("{all}, {next}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(control_points: usize, p95: f64) -> TradePoint {
        TradePoint {
            control_points,
            p95,
            max: 3.0 * p95,
            tolerance: 2.0 * p95,
        }
    }

    /// Sizes by a factor of 1.5, with a deviation that is `of` the size.
    fn law(of: impl Fn(f64) -> f64) -> Vec<TradePoint> {
        let sizes = (0..8).map(|k| (40.0 * 1.5_f64.powi(k)).round());
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "small"
        )]
        sizes.map(|n| point(n as usize, of(n))).collect()
    }

    fn range(tolerance: f64, least: f64) -> Range {
        Range {
            tolerance,
            least,
            most: 20_000,
        }
    }

    #[test]
    fn the_order_of_a_flat_a_rising_and_a_repeated_way() {
        let order = |way: &[(usize, f64)]| {
            let point = |&(control_points, tolerance): &(usize, f64)| TradePoint {
                control_points,
                p95: tolerance,
                max: tolerance,
                tolerance,
            };
            let way = way.iter().map(point).collect();
            let surfaces = Vec::new();
            Met { surfaces, way }.order()
        };
        assert_eq!(order(&[(100, 0.3), (400, 0.3)]), Some(0.0));
        assert!((order(&[(100, 0.1), (200, 0.2)]).unwrap() + 1.0).abs() < 1e-12);
        // A second search begins anew; the largest surface counts.
        let twice = [(100, 0.8), (200, 0.4), (120, 0.7), (200, 0.2)];
        assert!((order(&twice).unwrap() - 2.0).abs() < 1e-12);
        // Too few rounds, and a distance of zero, which has no logarithm.
        assert_eq!(order(&[(100, 0.3), (150, 0.1)]), None);
        assert_eq!(order(&[(100, 0.3), (200, 0.0)]), None);
    }

    #[test]
    fn curves_are_monotone_and_hold_the_chosen_surface() {
        let mut met = law(|n| 30.0 / n);
        met.extend([point(100, 9.0), point(3, f64::NAN), point(700, 0.0)]);
        for chosen in [
            point(61, 0.7),
            point(200, 0.01),
            point(5, 90.0),
            point(9000, 5.0),
        ] {
            let found = curve(&met, chosen);
            assert!(found.contains(&chosen));
            let rising = |pair: &[TradePoint]| {
                pair[0].control_points < pair[1].control_points && pair[0].p95 > pair[1].p95
            };
            assert!(found.windows(2).all(rising), "{found:?}");
        }
        assert_eq!(curve(&[], met[0]), [met[0]]);
    }

    #[test]
    fn the_knee_is_where_a_power_law_meets_a_floor() {
        // Noise that adds to an error of the fourth order: both are equal at 200 control points.
        let curve = law(|n| (1.0 + (200.0 / n).powi(8)).sqrt());
        let found = knee(&curve).unwrap();
        assert!((150..350).contains(&found), "{found}");
        assert_eq!(knee(&law(|n| n.powi(-2))), None);
        // It bends the other way.
        assert_eq!(knee(&law(|n| (-n / 100.0).exp())), None);
        assert_eq!(knee(&curve[..3]), None);
    }

    #[test]
    fn neighbours_of_a_power_law_are_on_it() {
        let met = law(|n| 50.0 / n);
        // The distance of the share is twice the p95: 100 / n.
        let all = Met {
            surfaces: met.clone(),
            way: met.clone(),
        };
        let of = |chosen: usize, least| {
            let way = met[..=chosen.max(6)].to_vec();
            let all = Met { way, ..all.clone() };
            neighbours(&all, met[chosen], range(met[chosen].tolerance, least))
        };
        let found = of(4, 0.0);
        assert_eq!(found.len(), 2);
        for n in &found {
            assert!(
                (n.control_points as f64 * n.tolerance / 100.0 - 1.0).abs() < 0.06,
                "{n:?}"
            );
            assert!(!n.extrapolated);
        }
        assert!(found[0].tolerance > met[4].tolerance && found[1].tolerance < met[4].tolerance);
        // Past the end by a factor of two, and nothing below what may be promised.
        let past = of(7, 0.0);
        assert!(
            past[1].extrapolated && (1200..1500).contains(&past[1].control_points),
            "{past:?}"
        );
        assert_eq!(of(7, met[7].tolerance).len(), 1);
        let none = Met::default();
        assert_eq!(neighbours(&none, met[7], range(1.0, 0.0)), []);
        let few = Range {
            most: 500,
            ..range(met[7].tolerance, 0.0)
        };
        assert_eq!(neighbours(&all, met[7], few).len(), 1);
    }

    #[test]
    #[expect(clippy::float_cmp, reason = "digits are exact")]
    fn words_are_options() {
        let at = |tolerance, control_points| Neighbour {
            tolerance,
            control_points,
            extrapolated: false,
        };
        let both = [at(0.2, 640), at(0.05, 15_000)];
        assert_eq!(
            said(&both, Unit::Millimetre).unwrap(),
            "-t 0.2mm would take about 640 control points, -t 50um about 15 000"
        );
        assert_eq!(said(&[], Unit::Millimetre), None);
        assert_eq!(
            said(&[at(2e-5, 9)], Unit::Millimetre).unwrap(),
            "-t 0.00002mm would take about 9 control points"
        );
        let digits = [0.2049, 0.0637, 1234.0, 9.96, 7e-6].map(two_digits);
        assert_eq!(digits, [0.2, 0.064, 1200.0, 10.0, 7e-6]);
    }
}

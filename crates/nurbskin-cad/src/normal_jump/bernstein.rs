//! The angle between two normals along a curve, from polynomials in Bernstein form.
//!
//! The values of a polynomial lie between its smallest and its largest Bernstein coefficient, and those of the halves,
//! from de Casteljau's algorithm, approach its values with the square of the width (*The NURBS Book*, A1.5).

use super::rim::Strip;
use glam::DVec3;
use nurbskin_geometry::math;
use std::ops::{Add, Mul};

/// Samples per knot span, at the middles of equal parts. Guard: bicubic faces have 8 extrema of q in a span at most.
const SAMPLES: usize = 8;
/// Rounding errors of a coefficient of |q| |T| and of c, whose factors have coefficients of 1 at most.
/// Derived: products of polynomials of degree 25 sum 26 terms twice, and 20 halvings add 25 roundings each in the worst
/// case; errors of both signs make far less.
const ROUNDING: f64 = 512.0 * f64::EPSILON;
/// Parts of an edge that a bound looks at, at most. Guard: what is left has a bound that is true, and wide.
const PARTS: usize = 4096;
/// Coefficients that are less, as a share of the largest, are rounding. Guard: a thousand units in the last place.
const NOTHING: f64 = 1e-12;
/// Narrowest part of a span. Guard: 20 halvings.
const NARROW: f64 = 1e-6;

/// An angle along an edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// Where, as a share of the edge's parameters.
    pub(super) at: f64,
    /// In degrees.
    pub(super) angle: f64,
    /// The length that it stands for.
    pub(super) length: f64,
}

/// The angles along an edge.
#[derive(Debug, Default)]
pub(super) struct Jump {
    parts: Vec<Part>,
    pub(super) samples: Vec<Sample>,
}

/// The polynomials over a part of a span.
#[derive(Clone, Debug)]
struct Part {
    /// Of the edge's parameters.
    range: [f64; 2],
    /// T . (X x Y).
    triple: Vec<f64>,
    /// (T x X) . (T x Y).
    cosine: Vec<f64>,
    /// T . T, of T divided by `length`.
    speed: Vec<f64>,
    length: f64,
    /// What rounding, and tangents of the two rims that differ, may add to |q| |T| and take from c.
    slack: f64,
    /// Width, as a share of the knot span.
    width: f64,
}

impl Jump {
    /// Adds a span that both faces have in common, over this range of the edge's parameters; `flip` turns the second
    /// normal over.
    pub(super) fn add(&mut self, range: [f64; 2], [one, two]: &[Strip; 2], flip: bool) {
        let part = Part::new(range, one, two, flip);
        for k in 0..SAMPLES {
            let s = (k as f64 + 0.5) / SAMPLES as f64;
            self.samples.push(Sample {
                at: range[0] + s * (range[1] - range[0]),
                angle: angle(
                    value(&part.triple, s),
                    value(&part.speed, s),
                    value(&part.cosine, s),
                ),
                length: part.length * value(&part.speed, s).max(0.0).sqrt() / SAMPLES as f64,
            });
        }
        self.samples.extend(part.ends());
        self.parts.push(part);
    }

    /// An upper bound of the angle, in degrees. Parts are halved until theirs is at most `ratio` times the largest
    /// sample, to which ends of parts are added, or below `floor`.
    pub(super) fn bound(&mut self, ratio: f64, floor: f64) -> f64 {
        let mut stack = std::mem::take(&mut self.parts);
        let mut sampled = self
            .samples
            .iter()
            .fold(0.0, |most: f64, s| most.max(s.angle));
        let (mut bound, mut count) = (sampled, stack.len());
        while let Some(part) = stack.pop() {
            let upper = part.upper();
            if upper <= (ratio * sampled).max(floor) || part.width < NARROW || count >= PARTS {
                bound = bound.max(upper);
                continue;
            }
            count += 2;
            let [low, high] = part.halves();
            // The end of the first half is the middle.
            for sample in low.ends().into_iter().skip(1) {
                sampled = sampled.max(sample.angle);
                bound = bound.max(sample.angle);
                self.samples.push(sample);
            }
            stack.extend([low, high]);
        }
        bound
    }
}

impl Part {
    fn new(range: [f64; 2], one: &Strip, two: &Strip, flip: bool) -> Self {
        // Lengths of T, X and Y do not matter: at most 1, they neither overflow nor vanish.
        let [tangent, tangent_of_two] = [one, two].map(|strip| hodograph(&strip.rim));
        let length = largest(&tangent);
        let off = difference(&tangent, &tangent_of_two);
        let (tangent, off) = if length > 0.0 && length.is_finite() {
            (scaled(&tangent, 1.0 / length), off / length)
        } else {
            (tangent, off)
        };
        let side = if flip { -1.0 } else { 1.0 };
        let [own, other] = [(one, 1.0), (two, side)].map(|(strip, side)| {
            let across = reduced(&strip.across);
            let size = largest(&across);
            if size > 0.0 && size.is_finite() {
                scaled(&across, side / size)
            } else {
                across
            }
        });
        let cross = |a: DVec3, b: DVec3| a.cross(b);
        let dot = |a: DVec3, b: DVec3| a.dot(b);
        let normal = product(&tangent, &own, cross);
        let slack = ROUNDING + largest(&normal) * off;
        Self {
            range,
            triple: product(&normal, &other, dot),
            cosine: product(&normal, &product(&tangent, &other, cross), dot),
            speed: product(&tangent, &tangent, dot),
            length,
            slack,
            width: 1.0,
        }
    }

    /// The two ends, which stand for no length.
    fn ends(&self) -> [Sample; 2] {
        let end = |v: &[f64], k: usize| v[if k == 0 { 0 } else { v.len() - 1 }];
        [0, 1].map(|k| Sample {
            at: self.range[k],
            angle: angle(
                end(&self.triple, k),
                end(&self.speed, k),
                end(&self.cosine, k),
            ),
            length: 0.0,
        })
    }

    /// An upper bound of the angle, in degrees: the largest of atan2 over a rectangle of (cosine, sine).
    fn upper(&self) -> f64 {
        let [low, high] = limits(&self.triple);
        let [slow, fast] = limits(&self.speed).map(|s| s.max(0.0).sqrt());
        let least = self.cosine.iter().copied().fold(f64::INFINITY, f64::min) - self.slack;
        let mut all = self.triple.iter().chain(&self.cosine).chain(&self.speed);
        if !(all.all(|x| x.is_finite()) && self.slack.is_finite()) {
            180.0
        } else if least >= 0.0 {
            // The angle rises with the sine.
            math::atan2(high.max(-low) * fast + self.slack, least).to_degrees()
        } else {
            // ... and falls with it beyond 90 degrees.
            let sine = (low.max(-high).max(0.0) * slow - self.slack).max(0.0);
            math::atan2(sine, least).to_degrees()
        }
    }

    fn halves(&self) -> [Self; 2] {
        let [triple, cosine, speed] = [&self.triple, &self.cosine, &self.speed].map(|v| halves(v));
        let [a, b] = self.range;
        let middle = f64::midpoint(a, b);
        let [t0, t1] = triple;
        let [c0, c1] = cosine;
        let [s0, s1] = speed;
        let half = |range, triple, cosine, speed| Self {
            range,
            triple,
            cosine,
            speed,
            length: self.length,
            slack: self.slack,
            width: 0.5 * self.width,
        };
        [half([a, middle], t0, c0, s0), half([middle, b], t1, c1, s1)]
    }
}

fn scaled(points: &[DVec3], factor: f64) -> Vec<DVec3> {
    points.iter().map(|&p| factor * p).collect()
}

/// The angle in degrees, 0 where a normal vanishes.
fn angle(triple: f64, speed: f64, cosine: f64) -> f64 {
    let angle = math::atan2(triple.abs() * speed.max(0.0).sqrt(), cosine);
    if angle.is_nan() {
        0.0
    } else {
        angle.to_degrees()
    }
}

/// Derivative of a Bezier curve by its local parameter.
fn hodograph(points: &[DVec3]) -> Vec<DVec3> {
    let p = points.len().saturating_sub(1) as f64;
    points.windows(2).map(|w| p * (w[1] - w[0])).collect()
}

/// A polynomial without its roots at 0 and at 1, divided by t and 1 - t: its values have the same directions, and one
/// at the ends too. That is the derivative across an edge that ends in a pole.
fn reduced(points: &[DVec3]) -> Vec<DVec3> {
    let least = NOTHING * largest(points);
    let mut points = points.to_vec();
    while points.len() > 1 && points[0].length() <= least {
        let n = points.len() - 1;
        points = (0..n)
            .map(|j| points[j + 1] * (n as f64 / (j + 1) as f64))
            .collect();
    }
    while points.len() > 1 && points[points.len() - 1].length() <= least {
        let n = points.len() - 1;
        points = (0..n)
            .map(|j| points[j] * (n as f64 / (n - j) as f64))
            .collect();
    }
    points
}

/// Binomial coefficients n over 0 to n.
fn binomials(n: usize) -> Vec<f64> {
    let mut row = vec![1.0];
    for k in 0..n {
        row.push(row[k] * (n - k) as f64 / (k + 1) as f64);
    }
    row
}

/// The product of two polynomials in Bernstein form:
/// `c_k = sum over i + j = k of C(m, i) C(n, j) / C(m + n, k) a_i b_j`.
///
/// Source: R. T. Farouki, V. T. Rajan, *Algorithms for polynomials in Bernstein form*, CAGD 5, 1988.
fn product<C>(a: &[DVec3], b: &[DVec3], times: impl Fn(DVec3, DVec3) -> C) -> Vec<C>
where
    C: Copy + Default + Add<Output = C> + Mul<f64, Output = C>,
{
    let (Some(m), Some(n)) = (a.len().checked_sub(1), b.len().checked_sub(1)) else {
        return Vec::new();
    };
    let [of_a, of_b, of_both] = [m, n, m + n].map(binomials);
    let mut sums = vec![C::default(); m + n + 1];
    for (i, &x) in a.iter().enumerate() {
        for (j, &y) in b.iter().enumerate() {
            let share = of_a[i] * of_b[j] / of_both[i + j];
            sums[i + j] = sums[i + j] + times(x, y) * share;
        }
    }
    sums
}

/// The same polynomial with a degree higher by one.
fn elevated(points: &[DVec3]) -> Vec<DVec3> {
    let n = points.len();
    let point = |i: usize| {
        let share = i as f64 / n as f64;
        match (i.checked_sub(1).and_then(|k| points.get(k)), points.get(i)) {
            (Some(&before), Some(&at)) => share * before + (1.0 - share) * at,
            (Some(&end), None) | (None, Some(&end)) => end,
            (None, None) => DVec3::ZERO,
        }
    };
    (0..=n).map(point).collect()
}

/// An upper bound of the distance between two polynomials.
fn difference(a: &[DVec3], b: &[DVec3]) -> f64 {
    let (mut a, mut b) = (a.to_vec(), b.to_vec());
    while a.len() < b.len() {
        a = elevated(&a);
    }
    while b.len() < a.len() {
        b = elevated(&b);
    }
    a.iter()
        .zip(&b)
        .fold(0.0, |most: f64, (p, q)| most.max(p.distance(*q)))
}

fn largest(points: &[DVec3]) -> f64 {
    points.iter().fold(0.0, |most: f64, p| most.max(p.length()))
}

/// The smallest and the largest coefficient.
fn limits(values: &[f64]) -> [f64; 2] {
    values
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &x| {
            [low.min(x), high.max(x)]
        })
}

/// The value of a polynomial at s in 0..=1, by de Casteljau's algorithm.
fn value(coefficients: &[f64], s: f64) -> f64 {
    let mut work = coefficients.to_vec();
    for last in (1..work.len()).rev() {
        for k in 0..last {
            work[k] = (1.0 - s) * work[k] + s * work[k + 1];
        }
    }
    work.first().copied().unwrap_or(0.0)
}

/// The polynomial over both halves of its interval.
fn halves(coefficients: &[f64]) -> [Vec<f64>; 2] {
    let mut high = coefficients.to_vec();
    let mut low = Vec::with_capacity(high.len());
    for last in (0..high.len()).rev() {
        low.push(high[0]);
        for k in 0..last {
            high[k] = f64::midpoint(high[k], high[k + 1]);
        }
    }
    // What is left in place k is the coefficient of the second half, in its order.
    [low, high]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_and_products_keep_the_values() {
        let p = [1.0, -2.0, 0.5, 3.0];
        let [low, high] = halves(&p);
        for s in [0.0, 0.3, 0.77, 1.0] {
            assert!((value(&low, s) - value(&p, s / 2.0)).abs() < 1e-14);
            assert!((value(&high, s) - value(&p, 0.5 + s / 2.0)).abs() < 1e-14);
        }
        let a = [DVec3::X, DVec3::new(1.0, 2.0, 3.0), DVec3::Z];
        let b = [DVec3::ONE, DVec3::new(0.5, -1.0, 2.0)];
        let at = |v: &[DVec3], s: f64| {
            let part = |f: fn(&DVec3) -> f64| value(&v.iter().map(f).collect::<Vec<_>>(), s);
            DVec3::new(part(|p| p.x), part(|p| p.y), part(|p| p.z))
        };
        let both = product(&a, &b, |x, y| x.cross(y));
        for s in [0.0, 0.2, 0.9, 1.0] {
            assert!((at(&both, s) - at(&a, s).cross(at(&b, s))).length() < 1e-14);
            assert!((at(&elevated(&a), s) - at(&a, s)).length() < 1e-14);
        }
        // Times t (1 - t), and back.
        let ends = product(&a, &[DVec3::ZERO, DVec3::ONE, DVec3::ZERO], |x, y| x * y);
        for (x, y) in reduced(&ends).iter().zip(&a) {
            assert!((*x - *y * 2.0).length() < 1e-14);
        }
        assert!(difference(&a, &elevated(&elevated(&a))) < 1e-15);
    }
}

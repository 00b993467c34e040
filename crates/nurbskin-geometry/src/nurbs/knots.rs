//! Knot vectors: clamped, unclamped and periodic.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// Highest degree supported: what the common CAD kernels accept. Buffers for basis functions of any degree fit on
/// the stack.
pub const MAX_DEGREE: usize = 25;

/// What is said of knots that are not periodic although they should be.
const TORN: &str = "the knots of a periodic direction do not continue themselves";

/// A knot vector `U = {u_0 <= ... <= u_m}` with its degree p, for `n + 1 = m - p` control points.
///
/// The domain is `[u_p, u_{n+1}]`. Interior knots have multiplicity p at most, so that the curve is continuous; the
/// ends may be clamped (multiplicity p + 1) or not.
///
/// A **periodic** knot vector continues itself: `u_{i+N} = u_i + (b - a)` for the N distinct control points of the
/// closed curve, which are stored *wrapped*: the last p of the `N + p` control points repeat the first p. Evaluation
/// then needs no special case.
///
/// ```
/// use nurbskin_geometry::KnotVector;
/// let knots = KnotVector::new(3, vec![0., 0., 0., 0., 0.5, 1., 1., 1., 1.])?;
/// assert_eq!(knots.control_point_count(), 5);
/// assert_eq!(knots.span(0.5), 4);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct KnotVector {
    degree: usize,
    knots: Vec<f64>,
    periodic: bool,
}

/// A knot vector as it is stored, not yet checked.
#[derive(Deserialize)]
struct Stored {
    degree: usize,
    knots: Vec<f64>,
    periodic: bool,
}

impl TryFrom<Stored> for KnotVector {
    type Error = Error;

    fn try_from(stored: Stored) -> Result<Self> {
        let this = Self {
            degree: stored.degree,
            knots: stored.knots,
            periodic: stored.periodic,
        };
        this.validate()?;
        // Moving a domain far away rounds its knots, which may then continue themselves less closely than those of a
        // file must.
        let largest = this
            .knots
            .iter()
            .fold(0.0, |most: f64, u| most.max(u.abs()));
        if this.periodic && !this.continues(8.0 * f64::EPSILON * largest) {
            return Err(Error::invalid(TORN));
        }
        Ok(this)
    }
}

impl KnotVector {
    /// A knot vector that is not periodic, clamped or not.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the degree is not in 1..=[`MAX_DEGREE`], there are fewer than 2 (p + 1) knots, a knot is
    /// not finite, the knots decrease, the domain is empty, or an interior knot has a multiplicity above p.
    pub fn new(degree: usize, knots: Vec<f64>) -> Result<Self> {
        let this = Self {
            degree,
            knots,
            periodic: false,
        };
        this.validate()?;
        Ok(this)
    }

    /// The periodic knot vector with these breakpoints: the first and the last are the same place of the closed curve,
    /// and every other one is a simple knot unless it is repeated. N + 1 breakpoints make N distinct control points.
    ///
    /// # Errors
    /// As [`KnotVector::new`].
    pub fn periodic(degree: usize, breakpoints: &[f64]) -> Result<Self> {
        let spans = breakpoints.len().saturating_sub(1);
        if spans == 0 {
            return Err(Error::invalid(
                "a periodic knot vector needs at least two breakpoints",
            ));
        }
        let period = breakpoints[spans] - breakpoints[0];
        let knot = |i: usize| {
            // i counts from `degree` spans before the domain; turns keep the index arithmetic unsigned.
            let turns = degree.div_ceil(spans);
            let k = i + turns * spans - degree;
            breakpoints[k % spans] + ((k / spans) as f64 - turns as f64) * period
        };
        let knots = (0..spans + 2 * degree + 1).map(knot).collect();
        let this = Self {
            degree,
            knots,
            periodic: true,
        };
        this.validate()?;
        Ok(this)
    }

    /// A periodic knot vector from all its knots, as a file has them.
    ///
    /// # Errors
    /// As [`KnotVector::new`], and if the knots do not continue themselves to 1e-9 of the period.
    pub fn from_periodic_knots(degree: usize, knots: Vec<f64>) -> Result<Self> {
        let this = Self {
            degree,
            knots,
            periodic: true,
        };
        this.validate()?;
        if this.continues(0.0) {
            Ok(this)
        } else {
            Err(Error::invalid(TORN))
        }
    }

    /// Whether the knots repeat themselves after the period, to 1e-9 of it and `rounding` more.
    fn continues(&self, rounding: f64) -> bool {
        let (a, b) = self.domain();
        let distinct = self.distinct_count();
        let close = 1e-9 * (b - a) + rounding;
        (0..self.knots.len() - distinct)
            .all(|i| (self.knots[i + distinct] - self.knots[i] - (b - a)).abs() <= close)
    }

    /// The clamped knot vector on \[0, 1\] with evenly spaced interior knots.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there are fewer than p + 1 control points or the degree is out of range.
    pub fn uniform(degree: usize, control_point_count: usize) -> Result<Self> {
        if control_point_count <= degree {
            return Err(Error::invalid(format!(
                "degree {degree} needs at least {} control points, not {control_point_count}",
                degree + 1
            )));
        }
        let spans = control_point_count - degree;
        Self::clamped(
            degree,
            &(0..=spans)
                .map(|i| i as f64 / spans as f64)
                .collect::<Vec<_>>(),
        )
    }

    /// The clamped knot vector with these breakpoints: the ends become (p + 1)-fold, the others are taken as they are
    /// (repeat one for a higher multiplicity).
    ///
    /// # Errors
    /// As [`KnotVector::new`].
    pub fn clamped(degree: usize, breakpoints: &[f64]) -> Result<Self> {
        let (Some(&a), Some(&b)) = (breakpoints.first(), breakpoints.last()) else {
            return Err(Error::invalid(
                "a knot vector needs at least two breakpoints",
            ));
        };
        let mut knots = vec![a; degree];
        knots.extend_from_slice(breakpoints);
        knots.extend(std::iter::repeat_n(b, degree));
        Self::new(degree, knots)
    }

    fn validate(&self) -> Result<()> {
        let (p, knots) = (self.degree, &self.knots);
        if p == 0 || p > MAX_DEGREE {
            return Err(Error::invalid(format!(
                "degree {p} is not in 1..={MAX_DEGREE}"
            )));
        }
        if knots.len() < 2 * (p + 1) {
            return Err(Error::invalid(format!(
                "degree {p} needs at least {} knots, not {}",
                2 * (p + 1),
                knots.len()
            )));
        }
        if let Some(i) = knots.iter().position(|u| !u.is_finite()) {
            return Err(Error::invalid(format!("knot {i} is not finite")));
        }
        if let Some(i) = knots.windows(2).position(|w| w[1] < w[0]) {
            return Err(Error::invalid(format!(
                "knot {} is smaller than the one before it",
                i + 1
            )));
        }
        let (a, b) = self.domain();
        if a >= b {
            return Err(Error::invalid("the domain of the knot vector is empty"));
        }
        // u_i = u_{i+p} strictly inside the domain is a multiplicity above p: the curve would be torn there. A periodic
        // one has no ends, its seam is inside.
        let inside = |u: f64| self.periodic || (u > a && u < b);
        if let Some(i) =
            (1..knots.len() - p - 1).find(|&i| knots[i] >= knots[i + p] && inside(knots[i]))
        {
            return Err(Error::invalid(format!(
                "knot {} has a multiplicity above the degree {p}: the surface would be torn there",
                knots[i]
            )));
        }
        if knots.windows(p + 2).any(|w| w[p + 1] <= w[0]) {
            return Err(Error::invalid(format!(
                "an end knot has a multiplicity above {}",
                p + 1
            )));
        }
        Ok(())
    }

    /// Degree p.
    #[must_use]
    pub fn degree(&self) -> usize {
        self.degree
    }
    /// All m + 1 knots.
    #[must_use]
    pub fn knots(&self) -> &[f64] {
        &self.knots
    }
    /// Whether the direction is periodic, with wrapped control points.
    #[must_use]
    pub fn is_periodic(&self) -> bool {
        self.periodic
    }
    /// Number of control points stored: knots - degree - 1.
    #[must_use]
    pub fn control_point_count(&self) -> usize {
        self.knots.len() - self.degree - 1
    }
    /// Number of control points, those that wrap around counted once.
    #[must_use]
    pub fn distinct_count(&self) -> usize {
        self.control_point_count() - if self.periodic { self.degree } else { 0 }
    }
    /// The parameter interval `[u_p, u_{n+1}]`.
    #[must_use]
    pub fn domain(&self) -> (f64, f64) {
        (
            self.knots[self.degree],
            self.knots[self.knots.len() - self.degree - 1],
        )
    }
    /// Whether both ends have multiplicity p + 1.
    #[must_use]
    pub fn is_clamped(&self) -> bool {
        let (a, b) = self.domain();
        let (first, last) = (self.knots[0], self.knots[self.knots.len() - 1]);
        first >= a && last <= b
    }
    /// `u` brought into the domain: wrapped around where periodic, clamped to the ends where not.
    #[must_use]
    pub fn wrap(&self, u: f64) -> f64 {
        let (a, b) = self.domain();
        if u >= a && u <= b {
            u
        } else if self.periodic && u.is_finite() {
            (a + (u - a).rem_euclid(b - a)).clamp(a, b)
        } else if u > a {
            b
        } else {
            a
        }
    }
    /// Index i of the knot span with `u_i <= u < u_{i+1}`; the last non-empty span at the end of the domain. Outside the
    /// domain the nearest span is taken. O(log n).
    ///
    /// Source: A2.1, *The NURBS Book*, 2nd ed., p. 68.
    #[must_use]
    pub fn span(&self, u: f64) -> usize {
        let (p, n) = (self.degree, self.control_point_count());
        let inner = &self.knots[p + 1..n];
        let k = p + inner.partition_point(|&knot| knot <= u);
        if u < self.knots[n] {
            return k;
        }
        // At or beyond the right end: the last span that is not empty.
        (p..n)
            .rev()
            .find(|&i| self.knots[i] < self.knots[i + 1])
            .unwrap_or(p)
    }
    /// Number of knots equal to `u`.
    #[must_use]
    #[expect(clippy::float_cmp, reason = "multiplicity is about identical knots")]
    pub fn multiplicity(&self, u: f64) -> usize {
        self.knots.iter().filter(|&&knot| knot == u).count()
    }
    /// The distinct knots of the domain, its ends included.
    #[must_use]
    pub fn breakpoints(&self) -> Vec<f64> {
        let mut breaks = self.knots[self.degree..=self.control_point_count()].to_vec();
        breaks.dedup();
        breaks
    }
    /// Greville abscissae: the mean of p consecutive knots per control point.
    #[must_use]
    pub fn greville(&self) -> Vec<f64> {
        self.knots[1..self.knots.len() - 1]
            .windows(self.degree)
            .map(|w| w.iter().sum::<f64>() / self.degree as f64)
            .collect()
    }
    /// The same knots moved and stretched so that the domain becomes \[a, b\].
    ///
    /// # Errors
    /// [`Error::Invalid`] if a < b does not hold or knots collapse onto each other.
    pub fn with_domain(&self, a: f64, b: f64) -> Result<Self> {
        let (from, to) = self.domain();
        let scale = (b - a) / (to - from);
        // The ends are set exactly: clamped ends must stay equal to the domain.
        #[expect(clippy::float_cmp, reason = "exactly the end knots")]
        let map = |u: f64| {
            if u == from {
                a
            } else if u == to {
                b
            } else {
                a + (u - from) * scale
            }
        };
        let this = Self {
            knots: self.knots.iter().map(|&u| map(u)).collect(),
            ..*self
        };
        this.validate()?;
        Ok(this)
    }

    /// The knots run backwards over the same domain: u becomes a + b - u.
    ///
    /// # Errors
    /// [`Error::Invalid`] if knots collapse onto each other by rounding.
    pub fn reversed(&self) -> Result<Self> {
        let (a, b) = self.domain();
        // The ends are set exactly: clamped ends must stay equal to the domain.
        #[expect(clippy::float_cmp, reason = "exactly the end knot")]
        let map = |u: f64| if u == b { a } else { b - (u - a) };
        let this = Self {
            knots: self.knots.iter().rev().map(|&u| map(u)).collect(),
            ..*self
        };
        this.validate()?;
        Ok(this)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_at_ends_and_knots() {
        let knots = KnotVector::new(2, vec![0., 0., 0., 1., 2., 3., 4., 4., 5., 5., 5.]).unwrap();
        // The NURBS Book, Ex 2.3: u = 5/2 lies in span 4.
        assert_eq!(knots.span(2.5), 4);
        assert_eq!(knots.span(5.0), 7);
        assert_eq!(knots.span(4.0), 7);
        assert_eq!(knots.span(-1.0), 2);
        assert_eq!(knots.span(9.0), 7);
    }

    #[test]
    fn periodic_knots_continue_themselves() {
        for spans in 1..8 {
            let breaks: Vec<f64> = (0..=spans).map(|i| (i * i) as f64).collect();
            let knots = KnotVector::periodic(3, &breaks).unwrap();
            assert_eq!(knots.distinct_count(), spans);
            assert_eq!(knots.domain(), (0.0, (spans * spans) as f64));
            KnotVector::from_periodic_knots(3, knots.knots().to_vec()).unwrap();
        }
    }

    #[test]
    fn bad_knots_are_refused() {
        assert!(KnotVector::new(0, vec![0., 1.]).is_err());
        assert!(KnotVector::new(3, vec![0., 0., 0., 1., 1., 1.]).is_err());
        assert!(KnotVector::new(2, vec![0., 0., 0., 0.5, 0.5, 0.5, 1., 1., 1.]).is_err());
        assert!(KnotVector::new(2, vec![0., 0., 0., 0., 1., 1., 1.]).is_err());
        assert!(KnotVector::new(1, vec![0., 0., f64::NAN, 1.]).is_err());
        assert!(KnotVector::new(1, vec![0., 1., 0., 1.]).is_err());
        assert!(KnotVector::new(1, vec![0., 0., 0., 0.]).is_err());
    }
}

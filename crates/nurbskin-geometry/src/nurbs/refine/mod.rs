//! The same curve or surface in another form: knots inserted and removed, degree raised, clamped, split, cut out,
//! reversed.
//!
//! All exact operations are one idea. The control points over any knot vector are values of the *polar form*
//! (blossom): `Q_i = f[t_{i+1}, .., t_{i+p}]` (L. Ramshaw, *Blossoms are polar forms*, CAGD 6, 1989). Hence each new
//! control point is a convex combination of p + 1 old ones, whose coefficients depend on the knots alone. They are
//! formed once per operation (`lines.rs`) and applied to the control points of a curve, or to all rows or columns of
//! a surface. Only knot removal changes the geometry; it says by how much (`remove.rs`).

mod lines;
mod remove;
mod seam;

pub use remove::Removal;

use super::{KnotVector, NurbsCurve, NurbsSurface};
use crate::{Error, Result};
pub(super) use lines::{LineMap, bezier_target};
use lines::{elevated_target, extended_target, inserted_target, section_target};

/// A parameter direction of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// Along u.
    U,
    /// Along v.
    V,
}

impl Direction {
    /// Both directions.
    pub const BOTH: [Direction; 2] = [Direction::U, Direction::V];

    /// The other direction.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Direction::U => Direction::V,
            Direction::V => Direction::U,
        }
    }
}

impl NurbsCurve {
    fn mapped(&self, map: &LineMap) -> Result<Self> {
        let points = map.apply(&self.homogeneous_points(), 1);
        Self::from_homogeneous(map.target().clone(), &points, self.weights().is_some())
    }

    /// The same curve with more knots; a knot listed k times is inserted k times. Nothing changes where an end is
    /// clamped already. O(n p^2).
    ///
    /// Source: the refinement of A5.4, *The NURBS Book*, 2nd ed., p. 164, by polar forms.
    ///
    /// ```
    /// use nurbskin_geometry::{DVec3, KnotVector, NurbsCurve};
    /// let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    /// let curve = NurbsCurve::new(KnotVector::uniform(3, 4)?, points, None)?;
    /// let finer = curve.insert_knots(&[0.5, 0.5])?;
    /// assert_eq!(finer.control_points().len(), 6);
    /// assert!((finer.point(0.3) - curve.point(0.3)).length() < 1e-15);
    /// # Ok::<(), nurbskin_geometry::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Invalid`] if a knot lies outside the domain or its multiplicity would exceed the degree.
    pub fn insert_knots(&self, knots: &[f64]) -> Result<Self> {
        let target = inserted_target(self.knots(), knots)?;
        self.mapped(&LineMap::refinement(self.knots(), target))
    }

    /// Removes `knot` up to `times` times, as often as the curve stays within `tolerance` of itself.
    ///
    /// # Errors
    /// [`Error::Invalid`] if `tolerance` is negative or not finite.
    pub fn remove_knot(&self, knot: f64, times: usize, tolerance: f64) -> Result<Removal<Self>> {
        remove::from_curve(self, Some(knot), times, tolerance)
    }

    /// Removes as many knots as `tolerance` allows, the cheapest first. The bound it returns holds for every
    /// parameter. O(n^2 + n p^2).
    ///
    /// Source: the idea of A5.8 and A9.8, *The NURBS Book*, 2nd ed., pp. 185 and 429, with the error spread evenly.
    ///
    /// # Errors
    /// [`Error::Invalid`] if `tolerance` is negative or not finite.
    pub fn remove_knots(&self, tolerance: f64) -> Result<Removal<Self>> {
        remove::from_curve(self, None, usize::MAX, tolerance)
    }

    /// The same curve with a degree higher by `times`. Every knot becomes as many times more multiple.
    ///
    /// Source: the result of A5.9, *The NURBS Book*, 2nd ed., p. 206, by polar forms.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the degree would exceed [`MAX_DEGREE`](super::MAX_DEGREE).
    pub fn elevate(&self, times: usize) -> Result<Self> {
        check_elevation(self.knots(), times)?;
        let mut curve = self.clone();
        for _ in 0..times {
            let target = elevated_target(curve.knots())?;
            curve = curve.mapped(&LineMap::elevation(curve.knots(), target))?;
        }
        Ok(curve)
    }

    /// The part over [a, b], clamped, with its parameters kept. On a periodic curve b may lie beyond the end of the
    /// domain, up to one turn after a.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a < b does not hold or the interval leaves the curve.
    pub fn segment(&self, a: f64, b: f64) -> Result<Self> {
        let target = section_target(self.knots(), a, b)?;
        self.mapped(&LineMap::refinement(self.knots(), target))
    }

    /// The two parts before and after t, clamped, with their parameters kept.
    ///
    /// # Errors
    /// [`Error::Invalid`] if t is not strictly inside the domain.
    pub fn split(&self, t: f64) -> Result<[Self; 2]> {
        let (a, b) = self.domain();
        check_split(t, (a, b))?;
        Ok([self.segment(a, t)?, self.segment(t, b)?])
    }

    /// The same curve with clamped ends; a periodic one becomes a closed one that is not periodic. Exact.
    ///
    /// # Errors
    /// None for a valid curve.
    pub fn clamped(&self) -> Result<Self> {
        if self.knots().is_clamped() && !self.knots().is_periodic() {
            return Ok(self.clone());
        }
        let (a, b) = self.domain();
        self.segment(a, b)
    }

    /// The same curve run backwards over the same domain: `C(a + b - t)`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if two knots collapse onto each other by rounding.
    pub fn reversed(&self) -> Result<Self> {
        let points = self.control_points().iter().rev().copied().collect();
        let weights = self.weights().map(|w| w.iter().rev().copied().collect());
        Self::new(self.knots().reversed()?, points, weights)
    }
}

impl NurbsSurface {
    /// Knot vector along `direction`.
    #[must_use]
    pub fn knots(&self, direction: Direction) -> &KnotVector {
        match direction {
            Direction::U => self.knots_u(),
            Direction::V => self.knots_v(),
        }
    }

    fn mapped(&self, direction: Direction, map: &LineMap) -> Result<Self> {
        let points = self.homogeneous_points();
        let target = map.target().clone();
        let (knots_u, knots_v, points) = match direction {
            Direction::U => (target, self.knots_v().clone(), map.apply(&points, 1)),
            Direction::V => {
                let stride = self.control_points().count_u();
                (self.knots_u().clone(), target, map.apply(&points, stride))
            }
        };
        Self::from_homogeneous(knots_u, knots_v, &points, self.is_rational())
    }

    /// The same surface with more knots along `direction`; a knot listed k times is inserted k times. Nothing changes
    /// where an end is clamped already.
    ///
    /// Source: the refinement of A5.5, *The NURBS Book*, 2nd ed., p. 167, by polar forms.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a knot lies outside the domain or its multiplicity would exceed the degree.
    pub fn insert_knots(&self, direction: Direction, knots: &[f64]) -> Result<Self> {
        let source = self.knots(direction);
        let target = inserted_target(source, knots)?;
        self.mapped(direction, &LineMap::refinement(source, target))
    }

    /// Removes `knot` along `direction` up to `times` times, as often as the surface stays within `tolerance` of
    /// itself.
    ///
    /// # Errors
    /// [`Error::Invalid`] if `tolerance` is negative or not finite.
    pub fn remove_knot(
        &self,
        direction: Direction,
        knot: f64,
        times: usize,
        tolerance: f64,
    ) -> Result<Removal<Self>> {
        remove::from_surface(self, direction, Some(knot), times, tolerance)
    }

    /// Removes as many knots along `direction` as `tolerance` allows, the cheapest first. The bound it returns holds
    /// for every (u, v).
    ///
    /// Source: the idea of A5.8 and A9.8, *The NURBS Book*, 2nd ed., pp. 185 and 429, with the error spread evenly.
    ///
    /// # Errors
    /// [`Error::Invalid`] if `tolerance` is negative or not finite.
    pub fn remove_knots(&self, direction: Direction, tolerance: f64) -> Result<Removal<Self>> {
        remove::from_surface(self, direction, None, usize::MAX, tolerance)
    }

    /// The same surface with a degree along `direction` higher by `times`.
    ///
    /// Source: the result of A5.10, *The NURBS Book*, 2nd ed., p. 210, by polar forms.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the degree would exceed [`MAX_DEGREE`](super::MAX_DEGREE).
    pub fn elevate(&self, direction: Direction, times: usize) -> Result<Self> {
        check_elevation(self.knots(direction), times)?;
        let mut surface = self.clone();
        for _ in 0..times {
            let target = elevated_target(surface.knots(direction))?;
            let map = LineMap::elevation(surface.knots(direction), target);
            surface = surface.mapped(direction, &map)?;
        }
        Ok(surface)
    }

    /// The part over [a, b] of `direction`, clamped there, with its parameters kept. In a periodic direction b may
    /// lie beyond the end of the domain, up to one turn after a. Two calls cut out a rectangle.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a < b does not hold or the interval leaves the surface.
    pub fn segment(&self, direction: Direction, a: f64, b: f64) -> Result<Self> {
        let source = self.knots(direction);
        let target = section_target(source, a, b)?;
        self.mapped(direction, &LineMap::refinement(source, target))
    }

    /// The same surface over the longer domain [a, b] of `direction`, clamped there: its first and last polynomial pieces
    /// go on beyond its ends, with all their derivatives. As many control points as before. Near an end it continues the
    /// shape; farther than a part of the last span it may swing out as polynomials do.
    ///
    /// # Errors
    /// [`Error::Invalid`] if [a, b] does not contain the domain, the direction is periodic, or a weight would not be
    /// positive.
    pub fn extended(&self, direction: Direction, a: f64, b: f64) -> Result<Self> {
        let target = extended_target(self.knots(direction), a, b)?;
        // Before an end that is not clamped there are pieces that are no part of the surface.
        let (start, end) = self.knots(direction).domain();
        let clamped = self.segment(direction, start, end)?;
        let map = LineMap::refinement(clamped.knots(direction), target);
        clamped.mapped(direction, &map)
    }

    /// The two parts before and after the parameter t of `direction`, clamped there, with their parameters kept.
    ///
    /// # Errors
    /// [`Error::Invalid`] if t is not strictly inside the domain.
    pub fn split(&self, direction: Direction, t: f64) -> Result<[Self; 2]> {
        let (a, b) = self.knots(direction).domain();
        check_split(t, (a, b))?;
        Ok([
            self.segment(direction, a, t)?,
            self.segment(direction, t, b)?,
        ])
    }

    /// The same surface clamped in both directions; a periodic one becomes a closed one that is not periodic. Exact.
    ///
    /// # Errors
    /// None for a valid surface.
    pub fn clamped(&self) -> Result<Self> {
        let mut surface = self.clone();
        for direction in Direction::BOTH {
            let knots = surface.knots(direction);
            if knots.is_periodic() || !knots.is_clamped() {
                let (a, b) = knots.domain();
                surface = surface.segment(direction, a, b)?;
            }
        }
        Ok(surface)
    }

    /// The same surface with `direction` run backwards over the same domain; its normal turns round.
    ///
    /// # Errors
    /// [`Error::Invalid`] if two knots collapse onto each other by rounding.
    pub fn reversed(&self, direction: Direction) -> Result<Self> {
        let [m, n] = self.control_points().counts();
        let mut points = self.control_points().points().to_vec();
        let mut weights = self.weights().map(<[f64]>::to_vec);
        reverse_lines(&mut points, m, direction);
        if let Some(weights) = &mut weights {
            reverse_lines(weights, m, direction);
        }
        let [mut knots_u, mut knots_v] = [self.knots_u().clone(), self.knots_v().clone()];
        match direction {
            Direction::U => knots_u = knots_u.reversed()?,
            Direction::V => knots_v = knots_v.reversed()?,
        }
        let net = super::ControlNet::new(m, n, points)?;
        Self::new(knots_u, knots_v, net, weights)
    }

    /// The curve `S(t, v)` or `S(u, t)` at a fixed parameter t of `direction`: it runs along the other direction.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the weights underflow.
    pub fn iso_curve(&self, direction: Direction, t: f64) -> Result<NurbsCurve> {
        let knots = self.knots(direction);
        let t = knots.wrap(t);
        let span = knots.span(t);
        let first = span - knots.degree();
        let mut basis = [0.0; super::MAX_DEGREE + 1];
        super::basis::basis_functions(knots, span, t, &mut basis);
        let other = self.knots(direction.other());
        let points: Vec<_> = (0..other.control_point_count())
            .map(|l| {
                (0..=knots.degree())
                    .map(|k| match direction {
                        Direction::U => basis[k] * self.homogeneous(first + k, l),
                        Direction::V => basis[k] * self.homogeneous(l, first + k),
                    })
                    .sum()
            })
            .collect();
        NurbsCurve::from_homogeneous(other.clone(), &points, self.is_rational())
    }
}

/// Reverses the rows (U) or their order (V) of an array of rows of length m.
fn reverse_lines<T>(values: &mut [T], m: usize, direction: Direction) {
    match direction {
        Direction::U => values.chunks_exact_mut(m).for_each(<[T]>::reverse),
        Direction::V => {
            values.reverse();
            values.chunks_exact_mut(m).for_each(<[T]>::reverse);
        }
    }
}

fn check_elevation(knots: &KnotVector, times: usize) -> Result<()> {
    let p = knots.degree();
    if times > super::MAX_DEGREE - p {
        return Err(Error::invalid(format!(
            "degree {p} cannot be raised by {times}: {} is the highest",
            super::MAX_DEGREE
        )));
    }
    Ok(())
}

fn check_split(t: f64, (a, b): (f64, f64)) -> Result<()> {
    if t > a && t < b {
        return Ok(());
    }
    Err(Error::invalid(format!(
        "cannot split at {t}: it is not strictly between {a} and {b}"
    )))
}

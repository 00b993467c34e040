//! Profiles: cubic B-spline curves in the half plane (radius, height), fitted to scattered points.
//!
//! The first fit minimises point distances at given parameters, later ones tangent distances with a small weight along
//! the curve, so that parameters may slide:
//!
//! ```text
//! sum w ((C(s) - q) · n)² + 0.01 w ((C(s) - C_before(s)) · t)² + 1e-7 w̄ sum |Δ² P|²
//! ```
//!
//! A profile may end on the axis, at a right angle (pole) or at another angle (tip), or be a closed section. The normal
//! equations are banded, also in the closed case, where the unknowns are taken from both ends in turn.

use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::cholesky::{BandedCholesky, SymmetricBanded};
use nurbskin_geometry::nurbs::KnotVector;
use nurbskin_geometry::nurbs::basis::basis_derivatives;

/// Degree of profile curves. Source: cubic B-splines, C² at simple knots (Piegl and Tiller, The NURBS Book, 1997).
pub(crate) const DEGREE: usize = 3;
/// Basis functions that do not vanish on a span. Derived: degree + 1.
const BASIS_COUNT: usize = DEGREE + 1;
/// Weight of the squared second differences of control points, relative to the mean weight of points per control point.
/// Guard: it only has to bridge spans without points; it is too small to move spans that have some.
const SMOOTHING_WEIGHT: f64 = 1e-7;
/// Weight, relative to that of all points together, of the equations that hold an end on the axis. Guard: any weight
/// far above 1 does, since the ends are then put there exactly; a much larger one spoils the condition of the matrix
/// (1e5 in an earlier version).
const AXIS_END_WEIGHT: f64 = 1e4;
/// Weight of offsets along the curve, relative to offsets across it. Trial: not recorded. With 0 (tangent distance) the
/// curve is free to slide along itself; with 1 (point distance) it converges slowly.
const TANGENTIAL_WEIGHT: f64 = 1e-2;
/// Newton steps to a foot point from a near guess. Guard: convergence is quadratic; callers repeat the search in every
/// round.
const NEWTON_STEPS: usize = 3;
/// Longest Newton step, as a share of the domain of the curve. Guard: keeps a step from leaving the branch of the
/// guess.
const MAX_NEWTON_STEP: f64 = 0.05;
/// Least derivative of (c - q) · c' for a full Newton step, as a share of |c'|²; below it the Gauss-Newton step is
/// taken. Guard: near the centre of curvature the full derivative vanishes or turns.
const MIN_NEWTON_SLOPE: f64 = 0.3;
/// Step at which the search for a foot point ends, as a share of the domain. Guard: a little above rounding.
const NEWTON_TOLERANCE: f64 = 1e-12;
/// Ridge of the least squares for scalar functions, relative to the mean weight of points per coefficient. Guard: keeps
/// the matrix definite where spans hold no points.
const SCALAR_RIDGE: f64 = 1e-9;

/// How a profile ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ProfileEnd {
    /// Away from the axis: the surface has a rim.
    #[default]
    Rim,
    /// On the axis and perpendicular to it: a pole with a normal.
    Pole,
    /// On the axis at another angle: the tip of a cone.
    Tip,
}

/// A cubic B-spline curve in the half plane (radius, height); periodic for a closed section.
#[derive(Clone, Debug, PartialEq)]
pub struct ProfileCurve {
    knots: KnotVector,
    /// Wrapped where periodic.
    control: Vec<DVec2>,
    /// Power coefficients of each knot span, about its start; those of empty spans are zero.
    cubics: Vec<[DVec2; BASIS_COUNT]>,
}

/// A data point of the fit: `at`, with the parameter `s` and the weight `weight`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Target {
    pub(crate) at: DVec2,
    pub(crate) s: f64,
    pub(crate) weight: f64,
}

/// The row of unknown i of n. In a closed curve, unknowns are taken from both ends in turn, which keeps the matrix
/// banded.
fn place(i: usize, n: usize, periodic: bool) -> usize {
    let i = i % n;
    if !periodic {
        i
    } else if 2 * i < n {
        2 * i
    } else {
        2 * (n - 1 - i) + 1
    }
}

/// Half-bandwidth, in unknowns.
fn band(periodic: bool) -> usize {
    if periodic { 2 * DEGREE + 1 } else { DEGREE }
}

/// The knots over these breakpoints.
pub(crate) fn knots_over(breaks: &[f64], periodic: bool) -> Result<KnotVector> {
    if periodic {
        KnotVector::periodic(DEGREE, breaks)
    } else {
        KnotVector::clamped(DEGREE, breaks)
    }
}

impl ProfileCurve {
    /// Knots; cubic.
    #[must_use]
    pub fn knots(&self) -> &KnotVector {
        &self.knots
    }
    /// Control points (radius, height), wrapped where periodic.
    #[must_use]
    pub fn control_points(&self) -> &[DVec2] {
        &self.control
    }
    /// Point, first and second derivative at s, which is brought into the domain.
    #[must_use]
    pub fn derivatives(&self, s: f64) -> [DVec2; 3] {
        let s = self.knots.wrap(s);
        let span = self.knots.span(s);
        let [a, b, c, d] = self.cubics[span - DEGREE];
        let t = s - self.knots.knots()[span];
        [
            a + t * (b + t * (c + t * d)),
            b + t * (2.0 * c + t * (3.0 * d)),
            2.0 * c + t * (6.0 * d),
        ]
    }
    fn new(knots: &KnotVector, control: Vec<DVec2>) -> Self {
        let mut basis = [0.0; BASIS_COUNT * BASIS_COUNT];
        let spans = DEGREE..knots.control_point_count();
        let cubics = spans.map(|span| {
            let [start, end] = [knots.knots()[span], knots.knots()[span + 1]];
            let mut powers = [DVec2::ZERO; BASIS_COUNT];
            if end > start {
                basis_derivatives(knots, span, start, DEGREE, &mut basis);
                for (k, (power, factorial)) in
                    powers.iter_mut().zip([1.0, 1.0, 2.0, 6.0]).enumerate()
                {
                    for j in 0..BASIS_COUNT {
                        *power +=
                            basis[k * BASIS_COUNT + j] / factorial * control[span - DEGREE + j];
                    }
                }
            }
            powers
        });
        Self {
            cubics: cubics.collect(),
            knots: knots.clone(),
            control,
        }
    }
    /// The parameter of the foot point of `q`, from the guess `s`, by a few Newton steps.
    #[must_use]
    pub fn foot(&self, q: DVec2, s: f64) -> f64 {
        self.foot_in(q, s, NEWTON_STEPS)
    }
    /// The same with at most `steps` steps.
    pub(crate) fn foot_in(&self, q: DVec2, s: f64, steps: usize) -> f64 {
        let (a, b) = self.knots.domain();
        let longest = MAX_NEWTON_STEP * (b - a);
        let mut s = self.knots.wrap(s);
        for _ in 0..steps {
            let [c, c1, c2] = self.derivatives(s);
            let square = c1.length_squared();
            if square <= 0.0 {
                break;
            }
            let full = square + (c - q).dot(c2);
            let slope = if full > MIN_NEWTON_SLOPE * square {
                full
            } else {
                square
            };
            let step = ((c - q).dot(c1) / slope).clamp(-longest, longest);
            s = self.knots.wrap(s - step);
            if step.abs() < NEWTON_TOLERANCE * (b - a) {
                break;
            }
        }
        s
    }
    /// Signed distance of `q` from the curve at its foot parameter, positive to the left of the curve, and the unit
    /// normal to that side.
    #[must_use]
    pub fn offset(&self, q: DVec2, s: f64) -> (f64, DVec2) {
        let [c, c1, _] = self.derivatives(s);
        let t = c1.normalize_or(DVec2::Y);
        let n = DVec2::new(-t.y, t.x);
        ((q - c).dot(n), n)
    }

    /// The least-squares curve. Without `before`, it minimises point distances at the given parameters. With it, only
    /// distances across the curve `before` count, and parameters may slide along it.
    ///
    /// # Errors
    /// [`Error::NoSolution`](nurbskin_geometry::Error::NoSolution) if the normal equations are singular.
    pub(crate) fn fit(
        knots: &KnotVector,
        targets: &[Target],
        ends: [ProfileEnd; 2],
        before: Option<&ProfileCurve>,
    ) -> Result<Self> {
        let (n, periodic) = (knots.distinct_count(), knots.is_periodic());
        let mut matrix = SymmetricBanded::zeros(2 * n, 2 * band(periodic) + 1)?;
        let mut right = vec![DVec3::ZERO; 2 * n];
        let mut total = 0.0;
        let mut basis = [0.0; 3 * BASIS_COUNT];
        // 1. Points.
        let mut sums = vec![Moments::default(); knots.knots().len()];
        let mut terms: Vec<Term> = Vec::with_capacity(4);
        for target in targets.iter().filter(|t| t.weight > 0.0) {
            let span = knots.span(target.s);
            basis_derivatives(knots, span, target.s, 0, &mut basis);
            terms.clear();
            match before {
                None => {
                    terms.push(Term::new(DVec2::X, target.at, target.weight));
                    terms.push(Term::new(DVec2::Y, target.at, target.weight));
                }
                Some(before) => {
                    let [c, c1, _] = before.derivatives(target.s);
                    let t = c1.normalize_or(DVec2::Y);
                    terms.push(Term::new(DVec2::new(-t.y, t.x), target.at, target.weight));
                    terms.push(Term::new(t, c, TANGENTIAL_WEIGHT * target.weight));
                }
            }
            sums[span].add(&basis, &terms);
            total += target.weight;
        }
        for (span, sum) in sums.iter().enumerate().filter(|(_, s)| s.count > 0) {
            sum.scatter(span, n, periodic, &mut matrix, &mut right);
        }
        // 2. Smoothing, and ends on the axis.
        let mut row = Row {
            n,
            periodic,
            matrix: &mut matrix,
            right: &mut right,
        };
        let calm = SMOOTHING_WEIGHT * total / n as f64;
        let starts = if periodic { n } else { n - 2 };
        for i in 0..starts {
            for component in 0..2 {
                row.add(
                    &[
                        (i, component, 1.0),
                        (i + 1, component, -2.0),
                        (i + 2, component, 1.0),
                    ],
                    calm,
                );
            }
        }
        let (a, b) = knots.domain();
        for (end, [first, second]) in ends.into_iter().zip([[0, 1], [n - 1, n - 2]]) {
            if end != ProfileEnd::Rim {
                row.add(&[(first, 0, 1.0)], AXIS_END_WEIGHT * total);
            }
            // Distances across the curve leave the ends free to slide along it.
            if let Some(before) = before.filter(|_| end == ProfileEnd::Rim && !periodic) {
                let [c, c1, _] = before.derivatives(if first == 0 { a } else { b });
                let t = c1.normalize_or(DVec2::Y);
                row.hold(first, t, t.dot(c), total / n as f64);
            }
            if end == ProfileEnd::Pole {
                row.add(
                    &[(first, 1, 1.0), (second, 1, -1.0)],
                    AXIS_END_WEIGHT * total,
                );
            }
        }
        // 3. Solve, and set the ends exactly.
        matrix.factor()?.solve(&mut right);
        let mut control: Vec<DVec2> = (0..n)
            .map(|i| {
                let k = 2 * place(i, n, periodic);
                DVec2::new(right[k].x, right[k + 1].x)
            })
            .collect();
        for (end, [first, second]) in ends.into_iter().zip([[0, 1], [n - 1, n - 2]]) {
            if end != ProfileEnd::Rim {
                control[first].x = 0.0;
            }
            if end == ProfileEnd::Pole {
                control[second].y = control[first].y;
            }
        }
        if periodic {
            control.extend_from_within(..DEGREE);
        }
        Ok(Self::new(knots, control))
    }
}

/// One equation of a point: the component of the curve along `direction` equals that of `at`.
struct Term {
    direction: DVec2,
    value: f64,
    weight: f64,
}

impl Term {
    fn new(direction: DVec2, at: DVec2, weight: f64) -> Self {
        Self {
            direction,
            value: direction.dot(at),
            weight,
        }
    }
}

/// Normal equations of the points of one span; they share their control points.
#[derive(Clone, Default)]
struct Moments {
    count: usize,
    square: [[f64; 2 * BASIS_COUNT]; 2 * BASIS_COUNT],
    right: [f64; 2 * BASIS_COUNT],
}

impl Moments {
    fn add(&mut self, basis: &[f64], terms: &[Term]) {
        self.count += 1;
        for term in terms {
            let d = term.direction.to_array();
            let mut line = [0.0; 2 * BASIS_COUNT];
            for (k, cell) in line.iter_mut().enumerate() {
                *cell = basis[k / 2] * d[k % 2];
            }
            for i in 0..2 * BASIS_COUNT {
                let w = term.weight * line[i];
                self.right[i] += w * term.value;
                for (cell, l) in self.square[i].iter_mut().zip(&line).take(i + 1) {
                    *cell += w * l;
                }
            }
        }
    }
    fn scatter(
        &self,
        span: usize,
        n: usize,
        periodic: bool,
        matrix: &mut SymmetricBanded,
        right: &mut [DVec3],
    ) {
        let at = |k: usize| 2 * place(span - DEGREE + k / 2, n, periodic) + k % 2;
        for i in 0..2 * BASIS_COUNT {
            right[at(i)].x += self.right[i];
            for j in 0..=i {
                let (a, b) = (at(i), at(j));
                let mut value = self.square[i][j];
                // Control points that coincide after wrapping.
                if a == b && i != j {
                    value *= 2.0;
                }
                matrix.add(a.max(b), a.min(b), value);
            }
        }
    }
}

/// Adds squared linear forms of the unknowns to the normal equations.
struct Row<'a> {
    n: usize,
    periodic: bool,
    matrix: &'a mut SymmetricBanded,
    right: &'a mut [DVec3],
}

impl Row<'_> {
    /// Adds: the component of control point i along `direction` equals `value`.
    fn hold(&mut self, i: usize, direction: DVec2, value: f64, weight: f64) {
        self.add(&[(i, 0, direction.x), (i, 1, direction.y)], weight);
        for (component, d) in direction.to_array().into_iter().enumerate() {
            let at = 2 * place(i, self.n, self.periodic) + component;
            self.right[at].x += weight * d * value;
        }
    }
    fn add(&mut self, form: &[(usize, usize, f64)], weight: f64) {
        debug_assert!(self.right.len() == 2 * self.n, "two components each");
        let at = |&(i, component, _): &(usize, usize, f64)| {
            2 * place(i, self.n, self.periodic) + component
        };
        for (a, x) in form.iter().enumerate() {
            for y in &form[..=a] {
                let (i, j) = (at(x), at(y));
                let twice = if i == j && !std::ptr::eq(x, y) {
                    2.0
                } else {
                    1.0
                };
                self.matrix
                    .add(i.max(j), i.min(j), twice * weight * x.2 * y.2);
            }
        }
    }
}

/// Least squares of scalar functions over the same knots: the projection onto splines of s.
pub(super) struct Scalars {
    knots: KnotVector,
    factor: BandedCholesky,
}

impl Scalars {
    pub(super) fn new(knots: &KnotVector, s: &[f64], weights: &[f64]) -> Result<Self> {
        let (n, periodic) = (knots.distinct_count(), knots.is_periodic());
        let mut matrix = SymmetricBanded::zeros(n, band(periodic))?;
        let mut total = 0.0;
        let mut basis = [0.0; 3 * BASIS_COUNT];
        for (&s, &w) in s.iter().zip(weights).filter(|(_, w)| **w > 0.0) {
            let span = knots.span(s);
            basis_derivatives(knots, span, s, 0, &mut basis);
            for i in 0..BASIS_COUNT {
                for j in 0..=i {
                    let a = place(span - DEGREE + i, n, periodic);
                    let b = place(span - DEGREE + j, n, periodic);
                    let twice = if a == b && i != j { 2.0 } else { 1.0 };
                    matrix.add(a.max(b), a.min(b), twice * w * basis[i] * basis[j]);
                }
            }
            total += w;
        }
        for i in 0..n {
            matrix.add(i, i, SCALAR_RIDGE * total / n as f64);
        }
        Ok(Self {
            knots: knots.clone(),
            factor: matrix.factor()?,
        })
    }

    /// Subtracts from three functions of the points their best approximations by splines of s.
    pub(super) fn rest(&self, s: &[f64], weights: &[f64], values: &mut [DVec3]) {
        let (n, periodic) = (self.knots.distinct_count(), self.knots.is_periodic());
        let mut right = vec![DVec3::ZERO; n];
        let mut basis = [0.0; 3 * BASIS_COUNT];
        for ((&s, &w), value) in s.iter().zip(weights).zip(values.iter()) {
            if w > 0.0 {
                let span = self.knots.span(s);
                basis_derivatives(&self.knots, span, s, 0, &mut basis);
                for k in 0..BASIS_COUNT {
                    right[place(span - DEGREE + k, n, periodic)] += w * basis[k] * *value;
                }
            }
        }
        self.factor.solve(&mut right);
        for (&s, value) in s.iter().zip(values.iter_mut()) {
            let s = self.knots.wrap(s);
            let span = self.knots.span(s);
            basis_derivatives(&self.knots, span, s, 0, &mut basis);
            for k in 0..BASIS_COUNT {
                *value -= basis[k] * right[place(span - DEGREE + k, n, periodic)];
            }
        }
    }
}

//! A profile in the half plane (radius, height): a cubic B-spline curve through scattered points.

use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::cholesky::{BandedCholesky, SymmetricBanded};
use nurbskin_geometry::nurbs::KnotVector;
use nurbskin_geometry::nurbs::basis::basis_derivatives;

/// Degree of profiles.
pub(crate) const DEGREE: usize = 3;
const WIDTH: usize = DEGREE + 1;
/// Weight of the second differences of control points, so that spans without points are bridged.
const CALM: f64 = 1e-7;
/// Weight with which the ends on the axis are held, before they are put there exactly.
const HOLD: f64 = 1e4;
/// Weight, against offsets across it, with which a point of the curve stays at its place along it.
const SLIDE: f64 = 1e-2;

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

/// A cubic B-spline curve in the half plane (radius, height); periodic if it is a closed section.
#[derive(Clone, Debug, PartialEq)]
pub struct ProfileCurve {
    knots: KnotVector,
    /// Wrapped where periodic.
    control: Vec<DVec2>,
    /// The cubic of each knot span, by powers of the distance from its start; empty spans have none to speak of.
    cubics: Vec<[DVec2; WIDTH]>,
}

/// What a profile is fitted to: the point `at`, thought at the parameter `s`, with the weight `weight`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Target {
    pub(crate) at: DVec2,
    pub(crate) s: f64,
    pub(crate) weight: f64,
}

/// The place of the unknown i of n: in a closed curve the two ends meet, so that unknowns are taken from both in turn,
/// which keeps the matrix banded.
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
        let mut basis = [0.0; WIDTH * WIDTH];
        let spans = DEGREE..knots.control_point_count();
        let cubics = spans.map(|span| {
            let [start, end] = [knots.knots()[span], knots.knots()[span + 1]];
            let mut powers = [DVec2::ZERO; WIDTH];
            if end > start {
                basis_derivatives(knots, span, start, DEGREE, &mut basis);
                for (k, (power, factorial)) in
                    powers.iter_mut().zip([1.0, 1.0, 2.0, 6.0]).enumerate()
                {
                    for j in 0..WIDTH {
                        *power += basis[k * WIDTH + j] / factorial * control[span - DEGREE + j];
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
    /// The parameter of the point of the curve nearest to `q`, from the guess `s`: a few steps of Newton's method.
    #[must_use]
    pub fn foot(&self, q: DVec2, s: f64) -> f64 {
        self.foot_in(q, s, 3)
    }
    /// The same with at most `steps` steps.
    pub(crate) fn foot_in(&self, q: DVec2, s: f64, steps: usize) -> f64 {
        let (a, b) = self.knots.domain();
        let longest = 0.05 * (b - a);
        let mut s = self.knots.wrap(s);
        for _ in 0..steps {
            let [c, c1, c2] = self.derivatives(s);
            let square = c1.length_squared();
            if square <= 0.0 {
                break;
            }
            let full = square + (c - q).dot(c2);
            let slope = if full > 0.3 * square { full } else { square };
            let step = ((c - q).dot(c1) / slope).clamp(-longest, longest);
            s = self.knots.wrap(s - step);
            if step.abs() < 1e-12 * (b - a) {
                break;
            }
        }
        s
    }
    /// Signed distance of `q` from the curve at the parameter of its foot, positive on the side that
    /// `along` calls the normal's, and that unit normal.
    #[must_use]
    pub fn offset(&self, q: DVec2, s: f64) -> (f64, DVec2) {
        let [c, c1, _] = self.derivatives(s);
        let t = c1.normalize_or(DVec2::Y);
        let n = DVec2::new(-t.y, t.x);
        ((q - c).dot(n), n)
    }

    /// The curve of least squares. Without `before`, through the points as they are placed; with it, only distances
    /// across the curve `before` count, and places may slide along it.
    ///
    /// # Errors
    /// [`Error::NoSolution`](nurbskin_geometry::Error::NoSolution) if the equations have no solution.
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
        let mut basis = [0.0; 3 * WIDTH];
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
                    terms.push(Term::new(t, c, SLIDE * target.weight));
                }
            }
            sums[span].add(&basis, &terms);
            total += target.weight;
        }
        for (span, sum) in sums.iter().enumerate().filter(|(_, s)| s.count > 0) {
            sum.scatter(span, n, periodic, &mut matrix, &mut right);
        }
        // 2. Calm, and ends on the axis.
        let mut row = Row {
            n,
            periodic,
            matrix: &mut matrix,
            right: &mut right,
        };
        let calm = CALM * total / n as f64;
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
                row.add(&[(first, 0, 1.0)], HOLD * total);
            }
            // Distances across do not tell where along itself the curve ends.
            if let Some(before) = before.filter(|_| end == ProfileEnd::Rim && !periodic) {
                let [c, c1, _] = before.derivatives(if first == 0 { a } else { b });
                let t = c1.normalize_or(DVec2::Y);
                row.hold(first, t, t.dot(c), total / n as f64);
            }
            if end == ProfileEnd::Pole {
                row.add(&[(first, 1, 1.0), (second, 1, -1.0)], HOLD * total);
            }
        }
        // 3. Solve; the ends exactly.
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

/// One equation per point: the component along `direction` shall be that of `at`.
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

/// Normal equations of the points of one span, whose control points are all the same.
#[derive(Clone, Default)]
struct Moments {
    count: usize,
    square: [[f64; 2 * WIDTH]; 2 * WIDTH],
    right: [f64; 2 * WIDTH],
}

impl Moments {
    fn add(&mut self, basis: &[f64], terms: &[Term]) {
        self.count += 1;
        for term in terms {
            let d = term.direction.to_array();
            let mut line = [0.0; 2 * WIDTH];
            for (k, cell) in line.iter_mut().enumerate() {
                *cell = basis[k / 2] * d[k % 2];
            }
            for i in 0..2 * WIDTH {
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
        for i in 0..2 * WIDTH {
            right[at(i)].x += self.right[i];
            for j in 0..=i {
                let (a, b) = (at(i), at(j));
                let mut value = self.square[i][j];
                // Control points that wrap around onto themselves.
                if a == b && i != j {
                    value *= 2.0;
                }
                matrix.add(a.max(b), a.min(b), value);
            }
        }
    }
}

/// Adds squares of linear forms of the unknowns.
struct Row<'a> {
    n: usize,
    periodic: bool,
    matrix: &'a mut SymmetricBanded,
    right: &'a mut [DVec3],
}

impl Row<'_> {
    /// The component of the control point i along `direction` shall have this value.
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

/// Least squares of numbers over the same knots: what of a function of the points a function of s can explain.
pub(super) struct Scalars {
    knots: KnotVector,
    factor: BandedCholesky,
}

impl Scalars {
    pub(super) fn new(knots: &KnotVector, s: &[f64], weights: &[f64]) -> Result<Self> {
        let (n, periodic) = (knots.distinct_count(), knots.is_periodic());
        let mut matrix = SymmetricBanded::zeros(n, band(periodic))?;
        let mut total = 0.0;
        let mut basis = [0.0; 3 * WIDTH];
        for (&s, &w) in s.iter().zip(weights).filter(|(_, w)| **w > 0.0) {
            let span = knots.span(s);
            basis_derivatives(knots, span, s, 0, &mut basis);
            for i in 0..WIDTH {
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
            matrix.add(i, i, 1e-9 * total / n as f64);
        }
        Ok(Self {
            knots: knots.clone(),
            factor: matrix.factor()?,
        })
    }

    /// What is left of three functions of the points after the best functions of s are taken off.
    pub(super) fn rest(&self, s: &[f64], weights: &[f64], values: &mut [DVec3]) {
        let (n, periodic) = (self.knots.distinct_count(), self.knots.is_periodic());
        let mut right = vec![DVec3::ZERO; n];
        let mut basis = [0.0; 3 * WIDTH];
        for ((&s, &w), value) in s.iter().zip(weights).zip(values.iter()) {
            if w > 0.0 {
                let span = self.knots.span(s);
                basis_derivatives(&self.knots, span, s, 0, &mut basis);
                for k in 0..WIDTH {
                    right[place(span - DEGREE + k, n, periodic)] += w * basis[k] * *value;
                }
            }
        }
        self.factor.solve(&mut right);
        for (&s, value) in s.iter().zip(values.iter_mut()) {
            let s = self.knots.wrap(s);
            let span = self.knots.span(s);
            basis_derivatives(&self.knots, span, s, 0, &mut basis);
            for k in 0..WIDTH {
                *value -= basis[k] * right[place(span - DEGREE + k, n, periodic)];
            }
        }
    }
}

//! Knot removal with a bound that holds.
//!
//! Inserting a knot t of multiplicity s - 1 into the result must give back the given control points P up to errors e:
//! `P_i = a_i Q_i + (1 - a_i) Q_{i-1} + e_i` for the p - s + 1 control points around t. That is one equation more than
//! there are unknowns Q, so the errors obey one condition `sum y_i e_i = rho`, and the smallest largest error is
//! `|rho| / sum |y_i|`, the same on all of them. As the basis functions are positive with sum 1, no point of the curve
//! moves by more. Over several removals the errors are added where they overlap, hence the final bound is rigorous.
//!
//! A5.8 of *The NURBS Book* (2nd ed., p. 185) puts the whole error on one control point; spreading it evenly removes
//! more knots within the same tolerance. In homogeneous coordinates an error (e, f) moves a point x of the curve by
//! `|e - x f| / w` at most; see [`Measure`].

use super::Direction;
use super::lines::{EndlessKnots, signed};
use crate::nurbs::{KnotVector, MAX_DEGREE, NurbsCurve, NurbsSurface};
use crate::{Error, Result};
use glam::{DVec3, DVec4};

/// What knot removal gives back.
#[derive(Clone, Debug, PartialEq)]
pub struct Removal<T> {
    /// The curve or surface with fewer knots.
    pub result: T,
    /// The removed knots, in the order of removal.
    pub removed: Vec<f64>,
    /// No point moved by more than this, at equal parameters; at most the tolerance. Rounding is not in it.
    pub bound: f64,
}

pub(super) fn from_curve(
    curve: &NurbsCurve,
    knot: Option<f64>,
    times: usize,
    tolerance: f64,
) -> Result<Removal<NurbsCurve>> {
    let rational = curve.weights().is_some();
    let points = curve.homogeneous_points();
    let mut remover = Remover::new(curve.knots(), &points, 1, rational, tolerance)?;
    let removed = remover.run(knot, times);
    let result = if removed.is_empty() {
        curve.clone()
    } else {
        let (knots, points) = remover.finish(1)?;
        NurbsCurve::from_homogeneous(knots, &points, rational)?
    };
    Ok(Removal {
        result,
        removed,
        bound: remover.bound(),
    })
}

pub(super) fn from_surface(
    surface: &NurbsSurface,
    direction: Direction,
    knot: Option<f64>,
    times: usize,
    tolerance: f64,
) -> Result<Removal<NurbsSurface>> {
    let rational = surface.is_rational();
    let points = surface.homogeneous_points();
    let stride = match direction {
        Direction::U => 1,
        Direction::V => surface.control_points().count_u(),
    };
    let knots = surface.knots(direction);
    let mut remover = Remover::new(knots, &points, stride, rational, tolerance)?;
    let removed = remover.run(knot, times);
    let result = if removed.is_empty() {
        surface.clone()
    } else {
        let (knots, points) = remover.finish(stride)?;
        let (knots_u, knots_v) = match direction {
            Direction::U => (knots, surface.knots_v().clone()),
            Direction::V => (surface.knots_u().clone(), knots),
        };
        NurbsSurface::from_homogeneous(knots_u, knots_v, &points, rational)?
    };
    Ok(Removal {
        result,
        removed,
        bound: remover.bound(),
    })
}

/// Errors of homogeneous control points as distances.
///
/// With all old points x within `radius` of `centre` and all old weights at least `weight`, an error of measure
/// m = |e - centre f| + radius |f| moves no point by more than d = m / (weight - m / radius): a new point lies within
/// radius + d of the centre, so d <= (|e - centre f| + (radius + d) |f|) / weight, and |f| <= m / radius.
struct Measure {
    centre: DVec3,
    radius: f64,
    weight: f64,
    rational: bool,
}

impl Measure {
    fn new(points: &[DVec4], rational: bool, tolerance: f64) -> Self {
        let place = |h: &DVec4| h.truncate() / h.w;
        let [low, high] = points
            .iter()
            .map(place)
            .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| {
                [low.min(p), high.max(p)]
            });
        let centre = (low + high) / 2.0;
        let reach = points.iter().map(|h| place(h).distance(centre));
        Self {
            centre,
            // Any larger radius is true as well; it must not vanish.
            radius: reach.fold(tolerance, f64::max),
            weight: points.iter().map(|h| h.w).fold(f64::INFINITY, f64::min),
            rational,
        }
    }

    fn of(&self, error: DVec4) -> f64 {
        let (e, f) = (error.truncate(), error.w);
        if self.rational {
            (e - self.centre * f).length() + self.radius * f.abs()
        } else {
            e.length()
        }
    }

    /// The largest measure that moves no point by more than `tolerance`.
    fn limit(&self, tolerance: f64) -> f64 {
        if self.rational && tolerance > 0.0 {
            tolerance * self.weight / (1.0 + tolerance / self.radius)
        } else {
            tolerance
        }
    }

    fn distance(&self, measure: f64) -> f64 {
        if self.rational && measure > 0.0 {
            measure / (self.weight - measure / self.radius)
        } else {
            measure
        }
    }
}

/// Control points while knots are taken away.
struct Remover {
    knots: EndlessKnots,
    /// Control point i of every line.
    columns: Vec<Vec<DVec4>>,
    /// Measure of the error so far of the curve, as coefficients of the basis functions.
    errors: Vec<f64>,
    /// Total error after removal of each knot; infinite where it cannot be removed.
    costs: Vec<f64>,
    measure: Measure,
    tolerance: f64,
}

/// The equations around one copy of a knot.
struct Equations {
    /// Index of the knot, the last of its copies.
    knot: isize,
    /// How many there are: p - s + 1.
    count: usize,
    alpha: [f64; MAX_DEGREE + 1],
    /// The condition on the errors, scaled to sum |y| = 1.
    y: [f64; MAX_DEGREE + 1],
}

impl Remover {
    fn new(
        knots: &KnotVector,
        points: &[DVec4],
        stride: usize,
        rational: bool,
        tolerance: f64,
    ) -> Result<Self> {
        if !tolerance.is_finite() || tolerance < 0.0 {
            return Err(Error::invalid(format!(
                "a tolerance must be a finite number not below zero, not {tolerance}"
            )));
        }
        let endless = EndlessKnots::new(knots);
        let stored = knots.control_point_count();
        let column = |i: usize| {
            let start = endless.column(signed(i)) * stride;
            points
                .chunks_exact(stored * stride)
                .flat_map(|block| &block[start..start + stride])
                .copied()
                .collect()
        };
        let columns: Vec<Vec<DVec4>> = (0..knots.distinct_count()).map(column).collect();
        Ok(Self {
            errors: vec![0.0; columns.len()],
            costs: vec![f64::INFINITY; endless.knots.len()],
            columns,
            measure: Measure::new(points, rational, tolerance),
            tolerance,
            knots: endless,
        })
    }

    /// Position in `costs` of knot i.
    fn place(&self, i: isize) -> usize {
        let start = if self.knots.periodic {
            signed(self.knots.degree)
        } else {
            0
        };
        (i - start)
            .rem_euclid(signed(self.costs.len()))
            .unsigned_abs()
    }

    fn column(&self, i: isize) -> usize {
        i.rem_euclid(signed(self.columns.len())).unsigned_abs()
    }

    /// The equations of knot r, if a copy of it can be removed at all and r is the last copy.
    fn equations(&self, r: isize) -> Option<Equations> {
        let (p, (a, b)) = (self.knots.degree, self.knots.domain);
        let knot = |i: isize| self.knots.knot(i);
        let t = knot(r);
        let copies = (0..=signed(p)).take_while(|&k| knot(r - k) >= t).count();
        let is_last = knot(r + 1) > t;
        let removable = if self.knots.periodic {
            // The seam keeps one knot; a knot and its image must not meet in one equation.
            self.columns.len() >= p + 2 && (copies >= 2 || t > a)
        } else {
            t > a && t < b
        };
        if !is_last || !removable || copies > p {
            return None;
        }
        let count = p + 1 - copies;
        let mut alpha = [0.0; MAX_DEGREE + 1];
        let mut y = [0.0; MAX_DEGREE + 1];
        for (i, alpha) in (r - signed(p)..).zip(&mut alpha[..count]) {
            *alpha = (t - knot(i)) / (knot(i + signed(p) + 1) - knot(i));
        }
        y[0] = 1.0;
        for k in 1..count {
            y[k] = -y[k - 1] * alpha[k - 1] / (1.0 - alpha[k]);
        }
        let sum: f64 = y[..count].iter().map(|y| y.abs()).sum();
        y[..count].iter_mut().for_each(|y| *y /= sum);
        sum.is_finite().then_some(Equations {
            knot: r,
            count,
            alpha,
            y,
        })
    }

    /// The control points of the equations with one more on each side, as columns.
    fn around(&self, equations: &Equations) -> impl Iterator<Item = usize> + Clone {
        let first = equations.knot - signed(self.knots.degree) - 1;
        (first..first + signed(equations.count) + 2).map(|i| self.column(i))
    }

    /// The error of one line, the same on all control points but for the sign of y.
    fn residual(&self, equations: &Equations, line: usize) -> DVec4 {
        let Equations {
            count, alpha, y, ..
        } = equations;
        let mut sum = DVec4::ZERO;
        for (k, column) in self.around(equations).enumerate() {
            let factor = if k == 0 {
                -y[0] * (1.0 - alpha[0])
            } else if k <= *count {
                y[k - 1]
            } else {
                -y[count - 1] * alpha[count - 1]
            };
            sum += factor * self.columns[column][line];
        }
        sum
    }

    /// Largest error of the curve after removal of knot r.
    fn cost(&self, r: isize) -> f64 {
        let Some(equations) = self.equations(r) else {
            return f64::INFINITY;
        };
        let lines = 0..self.columns[0].len();
        let error = lines
            .map(|line| self.measure.of(self.residual(&equations, line)))
            .fold(0.0, f64::max);
        let inner = self.around(&equations).skip(1).take(equations.count);
        let before = inner.map(|i| self.errors[i]).fold(0.0, f64::max);
        let cost = error + before;
        if cost.is_nan() { f64::INFINITY } else { cost }
    }

    /// Removes knots (only `knot`, if given), the cheapest first.
    fn run(&mut self, knot: Option<f64>, times: usize) -> Vec<f64> {
        let limit = self.measure.limit(self.tolerance);
        let (start, end) = if self.knots.periodic {
            let p = signed(self.knots.degree);
            (p, p + signed(self.costs.len()))
        } else {
            (0, signed(self.costs.len()))
        };
        #[expect(clippy::float_cmp, reason = "a knot is meant exactly")]
        let wanted = |t: f64| knot.is_none_or(|knot| knot == t);
        for r in start..end {
            if wanted(self.knots.knot(r)) {
                let place = self.place(r);
                self.costs[place] = self.cost(r);
            }
        }
        let mut removed = Vec::new();
        while removed.len() < times {
            let cheapest = self.costs.iter().enumerate();
            let Some((place, &cost)) = cheapest.min_by(|x, y| x.1.total_cmp(y.1)) else {
                break;
            };
            if cost.is_infinite() || cost > limit {
                break;
            }
            let (r, t) = (start + signed(place), self.knots.knots[place]);
            if !self.remove(r, cost) {
                self.costs[place] = f64::INFINITY;
                continue;
            }
            removed.push(t);
            let reach = signed(self.knots.degree) + 2;
            for near in r - reach..=r + reach {
                let place = self.place(near);
                let outside = near < 0 || near >= signed(self.costs.len());
                if (self.knots.periodic || !outside) && wanted(self.knots.knots[place]) {
                    self.costs[place] = self.cost(start + signed(place));
                }
            }
        }
        removed
    }

    /// Takes out one copy of knot r, unless a weight would not stay positive.
    fn remove(&mut self, r: isize, cost: f64) -> bool {
        let Some(equations) = self.equations(r) else {
            return false;
        };
        let Equations {
            count, alpha, y, ..
        } = &equations;
        let around: Vec<usize> = self.around(&equations).collect();
        let unknowns = count - 1;
        // The equations at the left give the left unknowns, those at the right the others: both divide by at least
        // one half.
        let half = alpha[..unknowns].iter().take_while(|a| **a >= 0.5).count();
        let mut fresh = vec![DVec4::ZERO; unknowns * self.columns[0].len()];
        for (line, q) in fresh.chunks_exact_mut(unknowns.max(1)).enumerate() {
            let residual = self.residual(&equations, line);
            let point = |k: usize| self.columns[around[k]][line];
            let exact = |k: usize| point(k + 1) - y[k].signum() * residual;
            for k in 0..half {
                let before = if k == 0 { point(0) } else { q[k - 1] };
                q[k] = (exact(k) - (1.0 - alpha[k]) * before) / alpha[k];
            }
            for k in (half..unknowns).rev() {
                let after = if k + 1 == unknowns {
                    point(count + 1)
                } else {
                    q[k + 1]
                };
                q[k] = (exact(k + 1) - alpha[k + 1] * after) / (1.0 - alpha[k + 1]);
            }
        }
        if fresh.iter().any(|q| q.w.is_nan() || q.w <= 0.0) {
            return false;
        }
        for (line, q) in fresh.chunks_exact(unknowns.max(1)).enumerate() {
            for (k, &q) in q.iter().enumerate() {
                self.columns[around[k + 1]][line] = q;
            }
        }
        // A coefficient of a removed function at least as large as those it replaces keeps the sum a bound.
        for &i in &around {
            self.errors[i] = self.errors[i].max(cost);
        }
        self.columns.remove(around[*count]);
        self.errors.remove(around[*count]);
        if r - signed(self.knots.degree) + signed(*count) > signed(self.columns.len() + 1) {
            // The columns around an image of the knot beyond the period: numbers count from the knot itself.
            self.columns.rotate_right(1);
            self.errors.rotate_right(1);
        }
        let place = self.place(r);
        self.costs.remove(place);
        self.knots.knots.remove(place);
        true
    }

    fn bound(&self) -> f64 {
        self.measure
            .distance(self.errors.iter().copied().fold(0.0, f64::max))
    }

    /// The knots and control points that remain.
    fn finish(&self, stride: usize) -> Result<(KnotVector, Vec<DVec4>)> {
        let (p, mut knots) = (self.knots.degree, self.knots.knots.clone());
        let knots = if self.knots.periodic {
            knots.push(self.knots.domain.1);
            KnotVector::periodic(p, &knots)?
        } else {
            KnotVector::new(p, knots)?
        };
        let (count, lines) = (self.columns.len(), self.columns[0].len());
        let mut points = Vec::with_capacity(knots.control_point_count() * lines);
        for block in (0..lines).step_by(stride) {
            for i in 0..knots.control_point_count() {
                points.extend_from_slice(&self.columns[i % count][block..block + stride]);
            }
        }
        Ok((knots, points))
    }
}

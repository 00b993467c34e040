//! The collocation system of one direction: B-splines that take given values at given parameters.
//!
//! ```text
//! B_ki = N_i(t_k),   B P = Q:   banded, totally positive for averaged knots, LU without pivoting; cyclic where closed
//! ```
//!
//! Source: *The NURBS Book*, 9.2.1; C. de Boor, *A Practical Guide to Splines*, chapter XIII.

use super::parameters::{averaged_knots, periodic_knots};
use nurbskin_geometry::numeric::banded::{BandedLu, BandedMatrix, Lanes, Lines};
use nurbskin_geometry::numeric::cyclic::CyclicLu;
use nurbskin_geometry::nurbs::MAX_DEGREE;
use nurbskin_geometry::nurbs::basis::basis_functions;
use nurbskin_geometry::{Error, KnotVector, Result};
use std::ops::Range;

/// Interpolation along one direction: knots and the factored collocation matrix `N_i(t_k)`.
pub(crate) struct Collocation {
    pub(crate) knots: KnotVector,
    factors: Factors,
    /// Index of the control point of the first line: lines are solved at `shift..shift + count`.
    pub(crate) shift: usize,
    pub(super) count: usize,
}

enum Factors {
    Open(BandedLu),
    Closed(CyclicLu),
}

impl Collocation {
    pub(crate) fn new(
        count: usize,
        closed: bool,
        degree: usize,
        parameters: &[f64],
        lines: &str,
    ) -> Result<Self> {
        let least = if closed { 3 } else { 2 };
        if count < least {
            let kind = if closed { "a closed" } else { "an open" };
            return Err(Error::invalid(format!(
                "{kind} direction needs at least {least} {lines}, not {count}"
            )));
        }
        if degree == 0 || degree > MAX_DEGREE {
            return Err(Error::invalid(format!(
                "degree {degree} is not in 1..={MAX_DEGREE}"
            )));
        }
        if parameters.len() != count {
            return Err(Error::invalid(format!(
                "{count} {lines} need as many parameters, not {}",
                parameters.len()
            )));
        }
        let degree = degree.min(count - 1);
        if closed {
            Self::closed(degree, parameters)
        } else {
            Self::open(degree, parameters)
        }
    }

    /// On given knots, clamped and not periodic; every line needs the support of its own basis function.
    pub(super) fn on(knots: &KnotVector, parameters: &[f64], lines: &str) -> Result<Self> {
        let count = knots.control_point_count();
        if knots.is_periodic() || !knots.is_clamped() {
            return Err(Error::invalid(
                "interpolation on given knots needs clamped ones that are not periodic",
            ));
        }
        if parameters.len() != count {
            return Err(Error::invalid(format!(
                "these knots need {count} {lines}, not {}",
                parameters.len()
            )));
        }
        let (u, p) = (knots.knots(), knots.degree());
        let (a, b) = knots.domain();
        // Schoenberg and Whitney: the matrix is regular exactly then. Ends, where one function is 1, belong to it.
        let holds = |(k, &t): (usize, &f64)| {
            let first = k == 0 && t <= a;
            let last = k + 1 == count && t >= b;
            (u[k] < t || first) && (t < u[k + p + 1] || last) && t >= a && t <= b
        };
        let rises = parameters.windows(2).all(|w| w[0] < w[1]);
        if let Some(k) = (0..count).find(|&k| !rises || !holds((k, &parameters[k]))) {
            return Err(Error::NoSolution(format!(
                "no surface on these knots goes through the {lines}: parameter {k} must lie strictly between knots {k} \
                 and {}, and parameters must rise",
                k + p + 1
            )));
        }
        // t_k lies between u_k and u_{k+p+1}: at most p entries on either side.
        Self::banded(knots.clone(), parameters, p)
    }

    fn open(degree: usize, parameters: &[f64]) -> Result<Self> {
        let knots = averaged_knots(parameters, degree)?;
        // Averaged knots put t_k strictly between u_{k+1} and u_{k+p}: at most p - 1 entries on either side.
        Self::banded(knots, parameters, degree - 1)
    }

    /// The system with at most `half` entries on either side of the diagonal.
    fn banded(knots: KnotVector, parameters: &[f64], half: usize) -> Result<Self> {
        let (count, degree) = (parameters.len(), knots.degree());
        let mut matrix = BandedMatrix::zeros(count, half, half);
        let mut basis = [0.0; MAX_DEGREE + 1];
        for (k, &t) in parameters.iter().enumerate() {
            let span = knots.span(t);
            basis_functions(&knots, span, t, &mut basis);
            for (i, &value) in (span - degree..).zip(&basis[..=degree]) {
                if k.abs_diff(i) <= half {
                    matrix.add(k, i, value);
                }
            }
        }
        Ok(Self {
            knots,
            factors: Factors::Open(matrix.factor()?),
            shift: 0,
            count,
        })
    }

    fn closed(degree: usize, parameters: &[f64]) -> Result<Self> {
        let knots = periodic_knots(parameters, degree)?;
        let count = parameters.len();
        // Line k is at knot k + p (odd degree) or inside span k + p (even): basis functions k .. k + p do not vanish,
        // and k + p / 2, rounded down, is the largest.
        let half = degree / 2;
        let mut table = vec![0.0; count * (degree + 1)];
        for (k, &t) in parameters.iter().enumerate() {
            basis_functions(
                &knots,
                k + degree,
                t,
                &mut table[k * (degree + 1)..(k + 1) * (degree + 1)],
            );
        }
        let entry = |k: usize, d: isize| table[k * (degree + 1) + half.wrapping_add_signed(d)];
        Ok(Self {
            factors: Factors::Closed(CyclicLu::factor(count, half, entry)?),
            knots,
            shift: half,
            count,
        })
    }

    /// Number of control points stored, wrapped ones included.
    pub(crate) fn stored(&self) -> usize {
        self.knots.control_point_count()
    }

    /// The rows of a table that hold lines, without those that [`Self::wrap`] fills; `width` points per row.
    pub(crate) fn rows_of<'a, T>(&self, table: &'a mut [T], width: usize) -> &'a mut [T] {
        &mut table[self.shift * width..(self.shift + self.count) * width]
    }

    /// Solves lines of points in place, each with its unknowns along the line, and wraps them; `points` holds
    /// [`Self::stored`] points per line.
    pub(super) fn solve_lines(&self, points: &mut [[f64; 3]]) {
        let width = self.stored();
        let mut lines = Lines {
            points,
            width,
            from: self.shift,
        };
        match &self.factors {
            Factors::Open(lu) => lu.solve_lines(&mut lines),
            Factors::Closed(lu) => {
                lu.solve_lines(&mut lines);
                for line in points.chunks_exact_mut(width) {
                    self.wrap(1, line);
                }
            }
        }
    }

    /// Solves the right-hand sides `lanes` of `count` rows in place.
    pub(crate) fn solve<R: Lanes>(&self, rows: &mut [R], lanes: Range<usize>) {
        match &self.factors {
            Factors::Open(lu) => lu.solve_rows(rows, lanes),
            Factors::Closed(lu) => lu.solve_rows(rows, lanes),
        }
    }

    /// Repeats the solved rows, `width` points each, across the seam.
    pub(crate) fn wrap<T: Copy>(&self, width: usize, rows: &mut [T]) {
        let (start, end) = (self.shift * width, (self.shift + self.count) * width);
        let period = self.count * width;
        for k in (0..start).rev() {
            rows[k] = rows[k + period];
        }
        for k in end..rows.len() {
            rows[k] = rows[k - period];
        }
    }
}

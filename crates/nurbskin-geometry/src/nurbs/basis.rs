//! B-spline basis functions and their derivatives.
//!
//! `N_{i,p}(u)` are the normalized B-spline basis functions of Pal & Ballav 2007, eq. (2), on half-open spans
//! `[u_i, u_{i+1})` with the last one closed (as printed, eq. (2) closes all of them and would count a knot twice).

use super::knots::{KnotVector, MAX_DEGREE};

/// One row of a basis function table.
type Row = [f64; MAX_DEGREE + 1];

/// The p + 1 basis functions N_{span-p,p}(u) .. N_{span,p}(u) that do not vanish on `span`, written to the first
/// p + 1 places of `out`. Outside the domain the polynomial of the span is continued. O(p^2), no allocation.
///
/// Source: A2.2, *The NURBS Book*, 2nd ed., p. 70.
///
/// # Panics
/// If `out` is shorter than p + 1 or `span` is not one that [`KnotVector::span`] returns.
#[inline]
pub fn basis_functions(knots: &KnotVector, span: usize, u: f64, out: &mut [f64]) {
    let (p, knots) = (knots.degree(), knots.knots());
    let out = &mut out[..=p];
    out[0] = 1.0;
    for k in 1..=p {
        let (low, high) = (&knots[span + 1 - k..=span], &knots[span + 1..=span + k]);
        let mut saved = 0.0;
        for r in 0..k {
            let share = out[r] / (high[r] - low[r]);
            out[r] = saved + (high[r] - u) * share;
            saved = (u - low[r]) * share;
        }
        out[k] = saved;
    }
}

/// The non-vanishing basis functions and their derivatives to `order`: `out[k * (p + 1) + j]` is the k-th derivative
/// of N_{span-p+j,p} at u. Derivatives above the degree are zero. O(p^2 + order^2 p), no allocation.
///
/// The k-th derivative starts as the basis functions of degree p - k and is raised to degree p by k applications of
/// eq. (2.7), while the functions themselves are raised by eq. (2.5); both divide by the same knot differences. That
/// gives what A2.3 does (*The NURBS Book*, 2nd ed., p. 72) without its tables.
///
/// # Panics
/// If `out` is shorter than (order + 1)(p + 1).
#[inline]
pub fn basis_derivatives(knots: &KnotVector, span: usize, u: f64, order: usize, out: &mut [f64]) {
    let p = knots.degree();
    let around = &knots.knots()[span + 1 - p..=span + p];
    let out = &mut out[..(order + 1) * (p + 1)];
    match <&[f64; 6]>::try_from(around) {
        // Loops of known length for the usual degree.
        Ok(around) => raised(3, around, u, order, out),
        Err(_) => raised(p, around, u, order, out),
    }
}

/// [`basis_derivatives`] of degree `p` from the 2 p knots around u.
#[expect(clippy::inline_always, reason = "for a constant degree")]
#[inline(always)]
fn raised(p: usize, around: &[f64], u: f64, order: usize, out: &mut [f64]) {
    let width = p + 1;
    let highest = order.min(p);
    out.fill(0.0);
    out[0] = 1.0;
    if highest == p {
        out[p * width] = 1.0;
    }
    let mut inverse: Row = [0.0; MAX_DEGREE + 1];
    // All rows from degree k - 1 to k.
    for k in 1..=p {
        let (low, high) = (&around[p - k..p], &around[p..p + k]);
        let (values, derivatives) = out.split_at_mut(width);
        let mut saved = 0.0;
        for r in 0..k {
            inverse[r] = 1.0 / (high[r] - low[r]);
            let share = values[r] * inverse[r];
            values[r] = saved + (high[r] - u) * share;
            saved = (u - low[r]) * share;
        }
        values[k] = saved;
        for m in (p - k).max(1)..=highest {
            let row = &mut derivatives[(m - 1) * width..][..=k];
            if m == p - k {
                row.copy_from_slice(&values[..=k]);
                continue;
            }
            let mut saved = 0.0;
            for r in 0..k {
                let share = k as f64 * row[r] * inverse[r];
                row[r] = saved - share;
                saved = share;
            }
            row[k] = saved;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::float_cmp, reason = "dyadic values are exact")]
    fn book_example_2_3() {
        // The NURBS Book, Ex 2.3 and 2.4: p = 2, u = 5/2 on span 4.
        let knots = KnotVector::new(2, vec![0., 0., 0., 1., 2., 3., 4., 4., 5., 5., 5.]).unwrap();
        let mut out = [0.0; 9];
        basis_functions(&knots, 4, 2.5, &mut out);
        assert_eq!(out[..3], [1.0 / 8.0, 6.0 / 8.0, 1.0 / 8.0]);
        basis_derivatives(&knots, 4, 2.5, 2, &mut out);
        assert_eq!(out, [0.125, 0.75, 0.125, -0.5, 0.0, 0.5, 1.0, -2.0, 1.0]);
    }
}

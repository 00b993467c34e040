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
    let mut left: Row = [0.0; MAX_DEGREE + 1];
    let mut right: Row = [0.0; MAX_DEGREE + 1];
    out[0] = 1.0;
    for j in 1..=p {
        left[j] = u - knots[span + 1 - j];
        right[j] = knots[span + j] - u;
        let mut saved = 0.0;
        for r in 0..j {
            let temp = out[r] / (right[r + 1] + left[j - r]);
            out[r] = saved + right[r + 1] * temp;
            saved = left[j - r] * temp;
        }
        out[j] = saved;
    }
}

/// The non-vanishing basis functions and their derivatives to `order`: `out[k * (p + 1) + j]` is the k-th derivative
/// of N_{span-p+j,p} at u. Derivatives above the degree are zero. O(order p^2), no allocation.
///
/// Source: A2.3, *The NURBS Book*, 2nd ed., p. 72.
///
/// # Panics
/// If `out` is shorter than (order + 1)(p + 1).
pub fn basis_derivatives(knots: &KnotVector, span: usize, u: f64, order: usize, out: &mut [f64]) {
    let (p, knots) = (knots.degree(), knots.knots());
    let width = p + 1;
    // ndu: upper triangle basis functions, lower triangle knot differences.
    let mut ndu = [[0.0; MAX_DEGREE + 1]; MAX_DEGREE + 1];
    let mut left: Row = [0.0; MAX_DEGREE + 1];
    let mut right: Row = [0.0; MAX_DEGREE + 1];
    ndu[0][0] = 1.0;
    for j in 1..=p {
        left[j] = u - knots[span + 1 - j];
        right[j] = knots[span + j] - u;
        let mut saved = 0.0;
        for r in 0..j {
            ndu[j][r] = right[r + 1] + left[j - r];
            let temp = ndu[r][j - 1] / ndu[j][r];
            ndu[r][j] = saved + right[r + 1] * temp;
            saved = left[j - r] * temp;
        }
        ndu[j][j] = saved;
    }
    for j in 0..=p {
        out[j] = ndu[j][p];
    }
    for k in 1..=order {
        out[k * width..(k + 1) * width].fill(0.0);
    }
    let highest = order.min(p);
    for r in 0..=p {
        let mut a = [[0.0; MAX_DEGREE + 1]; 2];
        let (mut s1, mut s2) = (0, 1);
        a[0][0] = 1.0;
        for k in 1..=highest {
            let mut d = 0.0;
            let pk = p - k;
            if r >= k {
                a[s2][0] = a[s1][0] / ndu[pk + 1][r - k];
                d = a[s2][0] * ndu[r - k][pk];
            }
            let first = if r + 1 >= k { 1 } else { k - r };
            let last = if r <= pk + 1 { k - 1 } else { p - r };
            for j in first..=last {
                let row = r + j - k;
                a[s2][j] = (a[s1][j] - a[s1][j - 1]) / ndu[pk + 1][row];
                d += a[s2][j] * ndu[row][pk];
            }
            if r <= pk {
                a[s2][k] = -a[s1][k - 1] / ndu[pk + 1][r];
                d += a[s2][k] * ndu[r][pk];
            }
            out[k * width + r] = d;
            std::mem::swap(&mut s1, &mut s2);
        }
    }
    let mut factor = p as f64;
    for k in 1..=highest {
        for value in &mut out[k * width..(k + 1) * width] {
            *value *= factor;
        }
        factor *= (p - k) as f64;
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

//! Evaluation of one piece: the point and its derivatives to second order in one pass.

use crate::nurbs::MAX_DEGREE;
use glam::{DVec3, DVec4};

/// A point of a piece with its derivatives along x and y, the piece being the image of `[-1, 1] x [-1, 1]`; the weight
/// function and its first derivatives are 1 and 0 where the surface is polynomial.
#[derive(Clone, Copy, Debug)]
pub(super) struct Jet {
    pub(super) s: DVec3,
    pub(super) sx: DVec3,
    pub(super) sy: DVec3,
    pub(super) sxx: DVec3,
    pub(super) sxy: DVec3,
    pub(super) syy: DVec3,
    pub(super) w: f64,
    pub(super) wx: f64,
    pub(super) wy: f64,
}

/// Coefficients of `x^k y^j` at `[4 j + k]`, homogeneous.
pub(super) type Powers = [[f64; 4]; 16];

/// `a x + b` in four lanes.
#[inline(always)]
fn step(a: [f64; 4], x: f64, b: [f64; 4]) -> [f64; 4] {
    [
        a[0] * x + b[0],
        a[1] * x + b[1],
        a[2] * x + b[2],
        a[3] * x + b[3],
    ]
}

/// Value, first and half the second derivative of a cubic, by repeated synthetic division (Horner).
#[inline(always)]
fn horner(c: [[f64; 4]; 4], x: f64) -> [[f64; 4]; 3] {
    let b2 = step(c[3], x, c[2]);
    let b1 = step(b2, x, c[1]);
    let e2 = step(c[3], x, b2);
    [step(b1, x, c[0]), step(e2, x, b1), step(c[3], x, e2)]
}

/// All homogeneous derivatives to second order of a bicubic in power form:
/// `[S, Sx, Sy, Sxx / 2, Sxy, Syy / 2]`.
#[inline(always)]
fn cubic(c: &Powers, x: f64, y: f64) -> [[f64; 4]; 6] {
    let mut rows = [[[0.0; 4]; 4]; 3];
    for j in 0..4 {
        let row = horner([c[4 * j], c[4 * j + 1], c[4 * j + 2], c[4 * j + 3]], x);
        for k in 0..3 {
            rows[k][j] = row[k];
        }
    }
    let [s, sy, syy] = horner(rows[0], y);
    let [sx, sxy, _] = horner(rows[1], y);
    let r = rows[2];
    let sxx = step(step(step(r[3], y, r[2]), y, r[1]), y, r[0]);
    [s, sx, sy, sxx, sxy, syy]
}

#[inline(always)]
fn xyz(a: [f64; 4]) -> DVec3 {
    DVec3::new(a[0], a[1], a[2])
}

/// The jet of a bicubic piece in power form.
#[inline]
pub(super) fn cubic_jet(c: &Powers, rational: bool, x: f64, y: f64) -> Jet {
    let [s, sx, sy, sxx, sxy, syy] = cubic(c, x, y);
    if rational {
        let d = |a: [f64; 4], f: f64| DVec4::from_array(a) * f;
        return quotient([
            d(s, 1.0),
            d(sx, 1.0),
            d(sy, 1.0),
            d(sxx, 2.0),
            d(sxy, 1.0),
            d(syy, 2.0),
        ]);
    }
    Jet {
        s: xyz(s),
        sx: xyz(sx),
        sy: xyz(sy),
        sxx: 2.0 * xyz(sxx),
        sxy: xyz(sxy),
        syy: 2.0 * xyz(syy),
        w: 1.0,
        wx: 0.0,
        wy: 0.0,
    }
}

/// Only the point of a bicubic piece in power form.
#[inline]
pub(super) fn cubic_point(c: &Powers, rational: bool, x: f64, y: f64) -> DVec3 {
    let row = |j: usize| {
        let c = &c[4 * j..4 * j + 4];
        step(step(step(c[3], x, c[2]), x, c[1]), x, c[0])
    };
    let s = step(step(step(row(3), y, row(2)), y, row(1)), y, row(0));
    if rational { xyz(s) / s[3] } else { xyz(s) }
}

/// Derivatives of the quotient of homogeneous derivatives `[X, Xx, Xy, Xxx, Xxy, Xyy]`.
///
/// Source: A4.4, *The NURBS Book*, 2nd ed., p. 137.
#[inline]
fn quotient(h: [DVec4; 6]) -> Jet {
    let [w, wx, wy, wxx, wxy, wyy] = h.map(|a| a.w);
    let [a, ax, ay, axx, axy, ayy] = h.map(DVec4::truncate);
    let r = 1.0 / w;
    let s = a * r;
    let sx = (ax - wx * s) * r;
    let sy = (ay - wy * s) * r;
    Jet {
        s,
        sx,
        sy,
        sxx: (axx - 2.0 * wx * sx - wxx * s) * r,
        sxy: (axy - wx * sy - wy * sx - wxy * s) * r,
        syy: (ayy - 2.0 * wy * sy - wyy * s) * r,
        w,
        wx,
        wy,
    }
}

type Row = [f64; MAX_DEGREE + 1];

/// Bernstein polynomials of degree p in `t = (x + 1) / 2` with their first two derivatives along x.
fn bernstein(p: usize, x: f64) -> [Row; 3] {
    let (t, r) = (0.5 * (1.0 + x), 0.5 * (1.0 - x));
    let mut out = [[0.0; MAX_DEGREE + 1]; 3];
    let mut b: Row = [0.0; MAX_DEGREE + 1];
    b[0] = 1.0;
    for degree in 1..=p {
        let full = degree as f64;
        // Derivatives are differences of the polynomials one and two degrees lower; 1/2 per derivative is dt/dx.
        if degree + 1 == p {
            let f = 0.25 * (full + 1.0) * full;
            for i in 0..degree {
                out[2][i] += f * b[i];
                out[2][i + 1] -= 2.0 * f * b[i];
                out[2][i + 2] += f * b[i];
            }
        }
        if degree == p {
            let f = 0.5 * full;
            for i in 0..degree {
                out[1][i] -= f * b[i];
                out[1][i + 1] += f * b[i];
            }
        }
        let mut carry = 0.0;
        for value in &mut b[..=degree] {
            let here = *value;
            *value = r * here + carry;
            carry = t * here;
        }
    }
    out[0] = b;
    out
}

/// The jet of a piece of any degrees from its homogeneous Bezier net, u fastest.
pub(super) fn general_jet(net: &[DVec4], [p, q]: [usize; 2], x: f64, y: f64) -> Jet {
    let (bx, by) = (bernstein(p, x), bernstein(q, y));
    let mut h = [DVec4::ZERO; 6];
    for (j, row) in net.chunks_exact(p + 1).enumerate() {
        let mut along = [DVec4::ZERO; 3];
        for (i, &point) in row.iter().enumerate() {
            for (sum, basis) in along.iter_mut().zip(&bx) {
                *sum += basis[i] * point;
            }
        }
        h[0] += by[0][j] * along[0];
        h[1] += by[0][j] * along[1];
        h[2] += by[1][j] * along[0];
        h[3] += by[0][j] * along[2];
        h[4] += by[1][j] * along[1];
        h[5] += by[2][j] * along[0];
    }
    quotient(h)
}

/// A line of Bezier points on `[-1, 1]` of degree 3 at most as the coefficients of a cubic.
pub(super) fn to_powers(line: &[DVec4]) -> [DVec4; 4] {
    let at = |i: usize| line[i];
    let zero = DVec4::ZERO;
    match line.len() {
        2 => [0.5 * (at(0) + at(1)), 0.5 * (at(1) - at(0)), zero, zero],
        3 => [
            0.25 * (at(0) + 2.0 * at(1) + at(2)),
            0.5 * (at(2) - at(0)),
            0.25 * (at(0) - 2.0 * at(1) + at(2)),
            zero,
        ],
        _ => [
            0.125 * (at(0) + 3.0 * (at(1) + at(2)) + at(3)),
            0.375 * (at(3) - at(0) + at(2) - at(1)),
            0.375 * (at(0) - at(1) - at(2) + at(3)),
            0.125 * (at(3) - at(0) + 3.0 * (at(1) - at(2))),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_and_bernstein_forms_agree() {
        for [p, q] in [[1, 3], [2, 2], [3, 1], [3, 3]] {
            let net: Vec<DVec4> = (0..(p + 1) * (q + 1))
                .map(|k| {
                    let k = k as f64;
                    DVec4::new(k.sin(), (2.0 * k).cos(), (3.0 * k).sin(), 1.2 + k.cos())
                })
                .collect();
            let rows: Vec<[DVec4; 4]> = net.chunks(p + 1).map(to_powers).collect();
            let mut powers: Powers = [[0.0; 4]; 16];
            for k in 0..4 {
                let column: Vec<DVec4> = rows.iter().map(|row| row[k]).collect();
                for (j, c) in to_powers(&column).into_iter().enumerate() {
                    powers[4 * j + k] = c.to_array();
                }
            }
            for (x, y) in [(0.3, -0.7), (-1.0, 1.0), (0.0, 0.1)] {
                let (a, b) = (
                    cubic_jet(&powers, true, x, y),
                    general_jet(&net, [p, q], x, y),
                );
                for (a, b) in [
                    (a.s, b.s),
                    (a.sx, b.sx),
                    (a.sy, b.sy),
                    (a.sxx, b.sxx),
                    (a.sxy, b.sxy),
                    (a.syy, b.syy),
                ] {
                    assert!((a - b).length() < 1e-11 * (1.0 + b.length()));
                }
                assert!((cubic_point(&powers, true, x, y) - b.s).length() < 1e-13);
            }
        }
    }
}

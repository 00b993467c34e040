//! Foot points: the nearest place of a surface for each point that it was fitted to.
//!
//! ```text
//! Gauss-Newton: (S_uᵀS_u  S_uᵀS_v; S_uᵀS_v  S_vᵀS_v) Δ = (S_uᵀd, S_vᵀd),   d = X - S(u, v)
//! ```
//!
//! The polynomial pieces are expanded once per cell into powers of local coordinates. A point then costs one evaluation
//! where its own parameters are good, and up to three steps where they are not. A step whose curvature term is bounded
//! by 0.5 % of the distance is taken unchecked.
//!
//! Source: A6.4, *The NURBS Book*, 2nd ed., p. 232, without second derivatives; the bound is ours.

use super::chebyshev::Pieces;
use super::samples::{Residual, Samples};
use super::spline_space::Fit;
use nurbskin_geometry::numeric::parallel::each_light;
use nurbskin_geometry::{DVec2, DVec3};

/// Most Gauss-Newton steps to a foot point. Count.
/// Guard: bounds the time; they start at the parameters of the point, and a distance is an upper bound wherever they
/// end.
const MAX_FOOT_STEPS: usize = 3;
/// Relative change of the distance by curvature up to which a step is not checked. Dimensionless.
/// Guard: half a per cent of a residual is below its noise.
const NEGLIGIBLE_CHANGE: f64 = 0.005;
/// Longest step, in longest spans of the direction.
/// Guard: the linear model holds within a span.
const MAX_FOOT_STEP: f64 = 0.5;
/// Determinant of the first fundamental form, relative to the product of its diagonal, up to which the tangents count
/// as parallel. Dimensionless.
/// Guard: above rounding.
const PARALLEL_TANGENTS: f64 = 1e-12;
/// Ratio of the squared distances of two steps above which the iteration ends. Dimensionless.
/// Guard: a thousandth of the distance is below its noise.
const STAGNATION: f64 = 0.998;

/// A point of a surface and its first derivatives by local coordinates.
#[derive(Clone, Copy, Debug)]
struct Tangents {
    point: DVec3,
    du: DVec3,
    dv: DVec3,
}

/// A surface cell by cell, as polynomials.
struct Cellwise<'a> {
    fit: &'a Fit,
    pieces: [Pieces; 2],
    /// (p + 1)(q + 1) coefficients per cell, powers of s fastest.
    coefficients: Vec<DVec3>,
    /// Per cell bounds of `|S_ss|`, `|S_st|` and `|S_tt|`.
    bends: Vec<[f64; 3]>,
}

impl<'a> Cellwise<'a> {
    /// O(cells p^3).
    fn new(fit: &'a Fit) -> Self {
        let space = &fit.space;
        let pieces = [0, 1].map(|d| Pieces::new(&space.knots[d]));
        let [columns, rows] = space.spans();
        let [m, n] = space.degree().map(|p| p + 1);
        let powers = |d: usize, spans: usize, size: usize| -> Vec<f64> {
            let mut out = vec![0.0; spans * size * size];
            for (span, out) in out.chunks_mut(size * size).enumerate() {
                pieces[d].powers(span, out);
            }
            out
        };
        let (of_u, of_v) = (powers(0, columns, m), powers(1, rows, n));
        let mut coefficients = vec![DVec3::ZERO; columns * rows * m * n];
        let mut bends = vec![[0.0; 3]; columns * rows];
        let mut half = vec![DVec3::ZERO; m * n];
        let cells = coefficients.chunks_mut(m * n).zip(&mut bends);
        for (cell, (out, bends)) in cells.enumerate() {
            let (a, b) = (cell % columns, cell / columns);
            let (fu, fv) = (&of_u[a * m * m..][..m * m], &of_v[b * n * n..][..n * n]);
            // 1. Rows of control points along u, then along v.
            for (j, half) in half.chunks_mut(m).enumerate() {
                half.fill(DVec3::ZERO);
                let net = &fit.net[(b + j) * space.stride() + a..][..m];
                for (&c, f) in net.iter().zip(fu.chunks(m)) {
                    half.iter_mut().zip(f).for_each(|(h, &f)| *h += f * c);
                }
            }
            for (half, f) in half.chunks(m).zip(fv.chunks(n)) {
                for (out, &f) in out.chunks_mut(m).zip(f) {
                    out.iter_mut().zip(half).for_each(|(o, &h)| *o += f * h);
                }
            }
            // 2. |s|, |t| <= 1: second derivatives are at most the sums of their coefficients.
            for (k, c) in out.iter().enumerate() {
                let (i, j, c) = ((k % m) as f64, (k / m) as f64, c.length());
                bends[0] += i * (i - 1.0) * c;
                bends[1] += i * j * c;
                bends[2] += j * (j - 1.0) * c;
            }
        }
        Self {
            fit,
            pieces,
            coefficients,
            bends,
        }
    }

    /// The cell of a place, with the middle and half length of its spans.
    #[inline]
    fn cell(&self, t: DVec2) -> (usize, [[f64; 2]; 2]) {
        let space = &self.fit.space;
        let (a, b) = (space.span(0, t.x), space.span(1, t.y));
        let frame = [self.pieces[0].span(a), self.pieces[1].span(b)];
        (b * (space.breaks[0].len() - 1) + a, frame)
    }

    /// S and its derivatives by the local coordinates of a cell.
    #[inline]
    fn tangents(&self, cell: usize, s: f64, t: f64) -> Tangents {
        let [p, q] = self.fit.space.degree();
        let size = (p + 1) * (q + 1);
        let coefficients = &self.coefficients[cell * size..][..size];
        match <&[DVec3; 16]>::try_from(coefficients) {
            // Bicubic: lengths known at compile time.
            Ok(cubic) if p == 3 => horner(4, cubic, s, t),
            _ => horner(p + 1, coefficients, s, t),
        }
    }
}

/// Horner's rule in both directions with derivatives, for rows of `n` powers of s.
#[inline(always)]
fn horner(n: usize, coefficients: &[DVec3], s: f64, t: f64) -> Tangents {
    let mut out = Tangents {
        point: DVec3::ZERO,
        du: DVec3::ZERO,
        dv: DVec3::ZERO,
    };
    for row in coefficients.chunks(n).rev() {
        let (mut c, mut cs) = (DVec3::ZERO, DVec3::ZERO);
        for &k in row.iter().rev() {
            cs = cs * s + c;
            c = c * s + k;
        }
        out.dv = out.dv * t + out.point;
        out.point = out.point * t + c;
        out.du = out.du * t + cs;
    }
    out
}

/// `S_u x S_v`, of any positive length, at places of the domain. O(n).
pub(crate) fn normals(fit: &Fit, places: &[DVec2]) -> Vec<DVec3> {
    let surface = Cellwise::new(fit);
    each_light(places.len(), |k| {
        let at = places[k];
        let (cell, [[u, hu], [v, hv]]) = surface.cell(at);
        let t = surface.tangents(cell, (at.x - u) / hu, (at.y - v) / hv);
        t.du.cross(t.dv)
    })
}

/// The residuals of all samples, from foot points found by Gauss-Newton from their own parameters. O(n).
///
/// The last step within a cell is taken without an evaluation at its end if, by the bounds of the second derivatives,
/// the distance changes by less than a two-hundredth.
///
/// Source: A6.4, *The NURBS Book*, 2nd ed., p. 232, without second derivatives; steps are at most half a span long and
/// only taken while the distance falls.
pub(crate) fn residuals(fit: &Fit, samples: &Samples) -> Vec<Residual> {
    let surface = Cellwise::new(fit);
    let longest = fit
        .space
        .breaks
        .each_ref()
        .map(|b| MAX_FOOT_STEP * b.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max));
    let closed = fit.space.topology.closed();
    each_light(samples.len(), |k| {
        surface.foot(samples.points[k], samples.parameters[k], longest, closed)
    })
}

impl Cellwise<'_> {
    /// The residual of x, starting from the parameters `foot`.
    #[inline]
    fn foot(&self, x: DVec3, mut foot: DVec2, longest: [f64; 2], closed: [bool; 2]) -> Residual {
        let settle = |t: f64, d: usize| match closed[d] {
            true => t - t.floor(),
            false => t.clamp(0.0, 1.0),
        };
        let look = |foot: DVec2| {
            let (cell, frame) = self.cell(foot);
            let [[u, hu], [v, hv]] = frame;
            let place = DVec2::new((foot.x - u) / hu, (foot.y - v) / hv);
            let here = self.tangents(cell, place.x, place.y);
            (cell, DVec2::new(hu, hv), place, here)
        };
        let (mut cell, mut half, mut place, mut here) = look(foot);
        for _ in 0..MAX_FOOT_STEPS {
            let d = x - here.point;
            let (a, b, c) = (
                here.du.length_squared(),
                here.du.dot(here.dv),
                here.dv.length_squared(),
            );
            let (g, h) = (here.du.dot(d), here.dv.dot(d));
            let determinant = a * c - b * b;
            if determinant <= PARALLEL_TANGENTS * a * c {
                break;
            }
            let step = DVec2::new(c * g - b * h, a * h - b * g) / determinant;
            let apart = (d.length_squared() - g * step.x - h * step.y)
                .max(0.0)
                .sqrt();
            // Taylor's remainder bounds the change of the distance.
            let [ss, st, tt] = self.bends[cell];
            let [x1, y1] = step.abs().to_array();
            let bend = 0.5 * (ss * x1 * x1 + 2.0 * st * x1 * y1 + tt * y1 * y1);
            if bend <= NEGLIGIBLE_CHANGE * apart && (place + step).abs().max_element() <= 1.0 {
                let n = here.du.cross(here.dv);
                let signed = d.dot(n) / n.length();
                return Residual {
                    signed,
                    distance: signed.abs(),
                    foot: foot + step * half,
                };
            }
            let moved = (step * half).clamp(-DVec2::from(longest), DVec2::from(longest));
            let next = DVec2::new(settle(foot.x + moved.x, 0), settle(foot.y + moved.y, 1));
            let there = look(next);
            let (old, new) = (d.length_squared(), (x - there.3.point).length_squared());
            if new >= old {
                break;
            }
            foot = next;
            (cell, half, place, here) = there;
            if new > STAGNATION * old {
                break;
            }
        }
        let d = x - here.point;
        let n = here.du.cross(here.dv);
        let distance = d.length();
        let signed = match n.try_normalize() {
            Some(n) => d.dot(n),
            // At a pole there is no normal from first derivatives.
            None => distance,
        };
        Residual {
            signed,
            distance,
            foot,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::spline_space::SplineSpace;
    use super::*;
    use crate::chart::Topology;
    use nurbskin_geometry::nurbs::closest::ClosestPoint;
    use std::f64::consts::TAU;

    /// Distances against certified closest points, for points beside the places that their parameters say.
    #[test]
    fn feet_are_the_closest_points() {
        for (degree, topology) in [
            ([3, 3], Topology::Disk),
            ([2, 5], Topology::Tube),
            ([4, 3], Topology::Torus),
        ] {
            let even = |n: usize| (0..=n).map(|k| k as f64 / n as f64).collect::<Vec<_>>();
            let space = SplineSpace::new(degree, [even(12), even(14)], topology).unwrap();
            // The last control points of a closed direction are the first ones again, to the last bit.
            let [gu, gv] = [0, 1].map(|d| {
                let all = space.knots[d].greville();
                let distinct = if topology.closed()[d] {
                    [12, 14][d]
                } else {
                    all.len()
                };
                (0..all.len())
                    .map(|k| all[k % distinct])
                    .collect::<Vec<f64>>()
            });
            let shape = |u: f64, v: f64| match topology {
                Topology::Disk => {
                    DVec3::new(9.0 * u, 8.0 * v, 0.5 * (5.0 * u).sin() * (4.0 * v).cos())
                }
                Topology::Torus => {
                    let ((s, c), (t, d)) = ((TAU * u).sin_cos(), (TAU * v).sin_cos());
                    DVec3::new((6.0 + 2.0 * d) * c, (6.0 + 2.0 * d) * s, 2.0 * t)
                }
                _ => DVec3::new(2.0 * (TAU * v).cos(), (2.0 + u) * (TAU * v).sin(), 9.0 * u),
            };
            let net = gv
                .iter()
                .flat_map(|&v| gu.iter().map(move |&u| shape(u, v)));
            let mut fit = Fit {
                net: net.collect(),
                space,
            };
            let surface = fit.surface(|p| p).unwrap();
            let place = |k: usize, step: f64| (k as f64 * step).fract();
            let parameters: Vec<DVec2> = (0..3000)
                .map(|k| {
                    DVec2::new(
                        0.01 + 0.98 * place(k, 0.618_034),
                        0.01 + 0.98 * place(k, 0.7548),
                    )
                })
                .collect();
            // Off by up to 0.1 across the surface and 0.02 along it; some exactly on it.
            let points: Vec<DVec3> = (0..)
                .zip(&parameters)
                .map(|(k, t)| {
                    let d = surface.derivatives(t.x, t.y);
                    let n = d.du.cross(d.dv).normalize();
                    let along = 0.02 * (place(k, 0.41) - 0.5) * d.du.normalize();
                    let across = 0.2 * (place(k, 0.317) - 0.5) * n;
                    d.point
                        + if k % 10 == 0 {
                            DVec3::ZERO
                        } else {
                            along + across
                        }
                })
                .collect();
            let samples = Samples::new(&points, &parameters, 1.0);
            let origin = samples.restore(DVec3::ZERO);
            fit.net.iter_mut().for_each(|c| *c -= origin);
            let found = residuals(&fit, &samples);
            let closest = ClosestPoint::new(&surface).unwrap();
            for (k, r) in found.iter().enumerate() {
                let x = points[samples.original[k] as usize];
                let exact = closest.closest(x).distance;
                // A step that is not taken changes the distance by half a percent at most.
                assert!(
                    (r.distance - exact).abs() <= 0.006 * exact + 1e-9,
                    "{degree:?} {k}: {} {exact}",
                    r.distance
                );
                let foot = surface.point(r.foot.x, r.foot.y);
                assert!(((foot - x).length() - exact).abs() <= 0.01 * exact + 1e-9);
            }
        }
    }
}

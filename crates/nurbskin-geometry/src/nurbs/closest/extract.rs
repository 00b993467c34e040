//! Bezier patches out of a B-spline surface, and parts out of Bezier patches.

use crate::nurbs::{KnotVector, MAX_DEGREE, NurbsSurface};
use glam::DVec4;

/// A span that is not empty, with the matrix that takes its control points to Bezier points.
#[derive(Clone, Debug)]
pub(super) struct Span {
    index: usize,
    pub(super) ends: (f64, f64),
    matrix: Vec<f64>,
}

/// The spans of a knot vector that are not empty.
///
/// Source: Bezier points are the values of the blossom at the ends of the span (Ramshaw 1989).
pub(super) fn spans(knots: &KnotVector) -> Vec<Span> {
    let (p, u) = (knots.degree(), knots.knots());
    (p..knots.control_point_count())
        .filter(|&i| u[i] < u[i + 1])
        .map(|index| {
            let ends = (u[index], u[index + 1]);
            let mut matrix = Vec::with_capacity((p + 1) * (p + 1));
            for k in 0..=p {
                for unit in 0..=p {
                    let mut d: Vec<f64> =
                        (0..=p).map(|j| if j == unit { 1.0 } else { 0.0 }).collect();
                    for r in 1..=p {
                        // The first p - k arguments of the blossom are the left end.
                        let t = if r <= p - k { ends.0 } else { ends.1 };
                        for j in (r..=p).rev() {
                            let (a, b) = (u[index + j - p], u[index + 1 + j - r]);
                            let f = (t - a) / (b - a);
                            d[j] = (1.0 - f) * d[j - 1] + f * d[j];
                        }
                    }
                    matrix.push(d[p]);
                }
            }
            Span {
                index,
                ends,
                matrix,
            }
        })
        .collect()
}

/// The homogeneous Bezier net of one patch, u fastest.
pub(super) fn bezier_net(surface: &NurbsSurface, su: &Span, sv: &Span) -> Vec<DVec4> {
    let [p, q] = surface.degree();
    let mut along_u = Vec::with_capacity((p + 1) * (q + 1));
    for l in 0..=q {
        for row in su.matrix.chunks_exact(p + 1) {
            let sum = row.iter().enumerate().fold(DVec4::ZERO, |sum, (k, &m)| {
                sum + m * surface.homogeneous(su.index - p + k, sv.index - q + l)
            });
            along_u.push(sum);
        }
    }
    let mut net = Vec::with_capacity(along_u.len());
    for row in sv.matrix.chunks_exact(q + 1) {
        for k in 0..=p {
            net.push(row.iter().enumerate().fold(DVec4::ZERO, |sum, (l, &m)| {
                sum + m * along_u[l * (p + 1) + k]
            }));
        }
    }
    net
}

/// The Bezier points of a line on the part `[a, b]` of its parameter interval `[0, 1]`.
fn restrict(line: &mut [DVec4], a: f64, b: f64) {
    // The right part [a, 1] first, then its left part.
    let n = line.len();
    for r in 1..n {
        for i in 0..n - r {
            line[i] = line[i] * (1.0 - a) + line[i + 1] * a;
        }
    }
    let f = (b - a) / (1.0 - a);
    for r in 1..n {
        for i in (r..n).rev() {
            line[i] = line[i - 1] * (1.0 - f) + line[i] * f;
        }
    }
}

/// The net, u fastest, of the part `[a, b] x [c, d]` of the parameter square `[0, 1] x [0, 1]`.
pub(super) fn restrict_net(net: &mut [DVec4], [p, q]: [usize; 2], [a, b, c, d]: [f64; 4]) {
    for row in net.chunks_exact_mut(p + 1) {
        restrict(row, a, b);
    }
    let mut line = [DVec4::ZERO; MAX_DEGREE + 1];
    for k in 0..=p {
        for l in 0..=q {
            line[l] = net[l * (p + 1) + k];
        }
        restrict(&mut line[..=q], c, d);
        for l in 0..=q {
            net[l * (p + 1) + k] = line[l];
        }
    }
}

/// A patch cut into a grid of equal parts, x fastest.
pub(super) fn grid(
    net: &[DVec4],
    degree: [usize; 2],
    domain: [f64; 4],
    parts: [usize; 2],
) -> Vec<(Vec<DVec4>, [f64; 4])> {
    if parts == [1, 1] {
        return vec![(net.to_vec(), domain)];
    }
    let fraction = |i: usize, n: usize| i as f64 / n as f64;
    let between = |a: f64, b: f64, f: f64| if f >= 1.0 { b } else { a + (b - a) * f };
    let mut out = Vec::with_capacity(parts[0] * parts[1]);
    for j in 0..parts[1] {
        let (c, d) = (fraction(j, parts[1]), fraction(j + 1, parts[1]));
        for i in 0..parts[0] {
            let (a, b) = (fraction(i, parts[0]), fraction(i + 1, parts[0]));
            let mut part = net.to_vec();
            restrict_net(&mut part, degree, [a, b, c, d]);
            out.push((
                part,
                [
                    between(domain[0], domain[1], a),
                    between(domain[0], domain[1], b),
                    between(domain[2], domain[3], c),
                    between(domain[2], domain[3], d),
                ],
            ));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::evaluate::general_jet;
    use super::*;
    use crate::{ControlNet, DVec3};

    #[test]
    fn patches_and_their_parts_are_the_surface() {
        let u = KnotVector::new(2, vec![0., 0.1, 0.3, 1., 1., 2., 2.5, 3.]).unwrap();
        let v = KnotVector::periodic(3, &[0., 1., 1.5, 3., 4.]).unwrap();
        let net = ControlNet::from_fn(5, 7, |i, j| {
            let (i, j) = (i as f64, (j % 4) as f64);
            DVec3::new(i, j, (i * 1.3 + j).sin())
        })
        .unwrap();
        let weights = (0..35).map(|k| 1.0 + 0.1 * f64::from(k / 5 % 4)).collect();
        let surface = NurbsSurface::new(u, v, net, Some(weights)).unwrap();
        for su in spans(surface.knots_u()) {
            for sv in spans(surface.knots_v()) {
                let patch = bezier_net(&surface, &su, &sv);
                let domain = [su.ends.0, su.ends.1, sv.ends.0, sv.ends.1];
                for (part, [a, b, c, d]) in grid(&patch, [2, 3], domain, [2, 4]) {
                    for (x, y) in [(-1.0, 0.3), (0.2, -0.7), (0.99, 0.99)] {
                        let at = general_jet(&part, [2, 3], x, y).s;
                        let (s, t) = (0.5 * (1.0 + x), 0.5 * (1.0 + y));
                        let there = surface.point(a + (b - a) * s, c + (d - c) * t);
                        assert!((at - there).length() < 1e-13);
                    }
                }
            }
        }
    }
}

//! A plane spline surface that fills an outline, so that the domain of a sheet ends where the sheet does.
//!
//! Four corners cut the outline into sides, a spline curve follows each side, and a Coons net (1967) between them is
//! relaxed by Winslow's equation (1966), whose solutions have harmonic u and v:
//!
//! ```text
//! a x_uu - 2 b x_uv + c x_vv = 0        a = |x_v|²,  b = x_u · x_v,  c = |x_u|²
//! ```
//!
//! A harmonic map onto a convex region that is one to one on the border is one to one inside (Radó, Kneser, Choquet),
//! so that the net has no folds whatever the outline. Its nodes at the Greville abscissae are the control points.

use glam::{DVec2, DVec3};
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::cholesky::{SymmetricBanded, solve_refined};
use nurbskin_geometry::nurbs::basis::basis_functions;
use nurbskin_geometry::{ControlNet, KnotVector, NurbsCurve, NurbsSurface};

/// Cubic spans of the curve that follows a side; the first count that comes close enough is taken. Trial: not recorded;
/// few spans make a calm border.
const SIDE_SPANS: [usize; 4] = [6, 10, 15, 22];
/// Samples of a side to which its curve is fitted. Guard: more than ten per span.
const SIDE_SAMPLES: usize = 300;
/// Cubic spans of the surface along u and v. Trial: 20 in an earlier version; the data are not recorded. Fewer miss the
/// finest sides, more fold sooner and cost time.
const SURFACE_SPANS: usize = 28;
/// Intervals of the net along u and v. Derived: three per span, since the outermost Greville abscissae are a third of a
/// span apart.
const NET_INTERVALS: usize = 3 * SURFACE_SPANS;
/// Most sweeps over the net. Guard: most nets settle earlier; 400 in an earlier version did not settle all.
const MAX_SWEEPS: usize = 1500;
/// Factor of successive over-relaxation. Trial: 1.5 in an earlier version; the data are not recorded. It must lie below
/// 2 (Kahan 1958), and below the optimum of the linear problem, since the coefficients change from sweep to sweep.
const RELAXATION_FACTOR: f64 = 1.6;
/// Largest move of a node in the last sweep, as a share of the rectangle's longer side. Guard: far below the tolerance
/// of the borders.
const SETTLED_MOVE: f64 = 1e-6;
/// Length to each side of a corner over which it is pulled out, as a share of the outline's length. Trial: not
/// recorded.
const CORNER_REACH: f64 = 0.04;
/// Largest angle between the chords over this length at a corner, in degrees; flatter corners are pulled out. Trial:
/// 130 in an earlier version; the data are not recorded. The chords of a circle meet at 166 degrees, and where sides
/// meet at 180 the surface has no normal.
const MAX_CORNER_ANGLE: f64 = 145.0;
/// Places per span and direction at which the surface is tested for folds. Guard: a fold between them is narrower than
/// a quarter of a span.
const FOLD_TESTS: usize = 4;
/// Shares of the rectangle that are mixed into a net that folds, in turn. Trial: not recorded.
const RECTANGLE_SHARES: [f64; 3] = [0.25, 0.5, 0.75];
/// Counts of [`SIDE_SPANS`] that are allowed in turn, until the net does not fold. Trial: not recorded.
const CALMER_SIDES: [usize; 3] = [SIDE_SPANS.len(), 2, 1];

/// A plane surface without folds whose borders follow an outline.
pub(super) struct Base {
    /// The surface, in z = 0; `S_u x S_v` points to +z.
    pub(super) surface: NurbsSurface,
    /// Mean lengths of the lines along u and along v.
    pub(super) size: [f64; 2],
    /// Smallest and largest area ratio, relative to the mean.
    pub(super) stretch: [f64; 2],
}

/// The surface for a counter-clockwise `outline` in the rectangle from the origin to `size`. Its borders are within
/// `tolerance` (root mean square) of the outline, or as close as smooth curves come. If the net folds all the same, the
/// borders are made smoother; then the net is mixed with the rectangle; `None` if that fails as well. O(net).
pub(super) fn fill(outline: &[DVec2], size: DVec2, tolerance: f64) -> Option<Base> {
    let rectangle = |k: usize| {
        let at = DVec2::new((k % NET_NODES) as f64, (k / NET_NODES) as f64);
        at / NET_INTERVALS as f64 * size
    };
    let mut net = Vec::new();
    for most_spans in CALMER_SIDES {
        let Some(sides) = sides(outline, size, tolerance, &SIDE_SPANS[..most_spans]) else {
            continue;
        };
        net = between(&sides)?;
        relax(&mut net, size);
        let found = surface(&net);
        if found.is_some() {
            return found;
        }
    }
    if net.is_empty() {
        return None;
    }
    RECTANGLE_SHARES.into_iter().find_map(|mixed| {
        let mix = |(k, p): (usize, &DVec2)| p.lerp(rectangle(k), mixed);
        surface(&net.iter().enumerate().map(mix).collect::<Vec<_>>())
    })
}

/// Nodes of the net along u and v. Derived: one more than its intervals.
const NET_NODES: usize = NET_INTERVALS + 1;

/// Curves along the sides v = 0, u = 1, v = 1 and u = 0 in turn, counter-clockwise, as nodes of the net.
fn sides(
    outline: &[DVec2],
    size: DVec2,
    tolerance: f64,
    spans: &[usize],
) -> Option<[Vec<DVec2>; 4]> {
    // 1. The corners: the points farthest towards the corners of the rectangle, if they are in order.
    let corner = |toward: DVec2| {
        let reach = |k: &usize| (outline[*k] / size).dot(toward);
        (0..outline.len()).max_by(|a, b| reach(a).total_cmp(&reach(b)))
    };
    let first = corner(DVec2::new(-1.0, -1.0))?;
    let mut polygon = outline.to_vec();
    polygon.rotate_left(first);
    let n = polygon.len();
    let from_first = |toward| corner(toward).map(|k| (k + n - first) % n);
    let corners = [
        0,
        from_first(DVec2::new(1.0, -1.0))?,
        from_first(DVec2::ONE)?,
        from_first(DVec2::new(-1.0, 1.0))?,
        n,
    ];
    if corners.windows(2).any(|w| w[1] < w[0] + 4) {
        return None;
    }
    // 2. Flat corners are pulled out.
    let mut along = vec![0.0];
    for k in 0..n {
        along.push(along[k] + polygon[k].distance(polygon[(k + 1) % n]));
    }
    let length = along[n];
    let reach = CORNER_REACH * length;
    let at = |s: f64| {
        let s = s.rem_euclid(length);
        let k = along.partition_point(|&a| a <= s).clamp(1, n);
        let t = (s - along[k - 1]) / (along[k] - along[k - 1]).max(f64::MIN_POSITIVE);
        polygon[k - 1].lerp(polygon[k % n], t)
    };
    let pulls = [0, 1, 2, 3].map(|c| {
        let here = along[corners[c]];
        let (before, corner, after) = (at(here - reach), at(here), at(here + reach));
        let out = -(after - before).perp().normalize_or_zero();
        let turn = math::turn(corner - before, after - corner);
        let excess = std::f64::consts::PI - turn - MAX_CORNER_ANGLE.to_radians();
        (
            here,
            0.5 * reach * math::tan((0.5 * excess.max(0.0)).min(1.0)) * out,
        )
    });
    let pulled = |s: f64| {
        let pull = |(here, pull): &(f64, DVec2)| {
            let away = (s - here).abs();
            let near = 1.0 - away.min(length - away).max(0.0) / reach;
            *pull * near.max(0.0).powi(2)
        };
        at(s) + pulls.iter().map(pull).sum::<DVec2>()
    };
    // 3. A curve along each side.
    let side = |c: usize| {
        let (a, b) = (along[corners[c]], along[corners[c + 1]]);
        let samples = (0..=SIDE_SAMPLES).map(|k| k as f64 / SIDE_SAMPLES as f64);
        let samples: Vec<DVec2> = samples.map(|t| pulled(a + t * (b - a))).collect();
        let mut curves = spans.iter().map(|&spans| follow(&samples, spans));
        let close = |curve: &Option<(NurbsCurve, f64)>| {
            curve.as_ref().is_some_and(|(_, error)| *error < tolerance)
        };
        let curve = match curves.find(close) {
            Some(curve) => curve,
            None => follow(&samples, *spans.last()?),
        }?
        .0;
        let node = |k: usize| curve.point(k as f64 / NET_INTERVALS as f64).truncate();
        Some((0..NET_NODES).map(node).collect())
    };
    Some([side(0)?, side(1)?, side(2)?, side(3)?])
}

/// The least-squares cubic spline with `spans` even spans through the first and the last sample, and its root mean
/// square error.
fn follow(samples: &[DVec2], spans: usize) -> Option<(NurbsCurve, f64)> {
    let (count, last) = (spans + 3, samples.len() - 1);
    let knots = KnotVector::uniform(3, count).ok()?;
    let ends = [samples[0].extend(0.0), samples[last].extend(0.0)];
    let mut basis = [0.0; 4];
    // The end points are given: the unknowns are 1..count - 1, and the terms of the ends go to the right-hand side.
    let mut matrix = SymmetricBanded::zeros(count - 2, 3).ok()?;
    let mut right = vec![DVec3::ZERO; count - 2];
    for (k, p) in samples.iter().enumerate() {
        let t = k as f64 / last as f64;
        let span = knots.span(t);
        basis_functions(&knots, span, t, &mut basis);
        let unknown = |i: usize| (span + i).checked_sub(4).filter(|&r| r < count - 2);
        let mut rest = p.extend(0.0);
        for (i, b) in basis.iter().enumerate() {
            if unknown(i).is_none() {
                rest -= *b * ends[usize::from(span + i > 3)];
            }
        }
        for i in 0..4 {
            let Some(row) = unknown(i) else { continue };
            right[row] += basis[i] * rest;
            for (j, b) in basis[..=i].iter().enumerate() {
                if let Some(column) = unknown(j) {
                    matrix.add(row, column, basis[i] * b);
                }
            }
        }
    }
    let (solution, _) = solve_refined(&matrix, &right).ok()?;
    let mut points = vec![ends[0]];
    points.extend(solution);
    points.push(ends[1]);
    let curve = NurbsCurve::new(knots, points, None).ok()?;
    let squares = samples.iter().enumerate().map(|(k, p)| {
        let off = curve.point(k as f64 / last as f64) - p.extend(0.0);
        off.length_squared()
    });
    let error = (squares.sum::<f64>() / samples.len() as f64).sqrt();
    Some((curve, error))
}

/// The bilinearly blended net between four sides (Coons 1967, DOI 10.21236/AD0663504).
fn between(sides: &[Vec<DVec2>; 4]) -> Option<Vec<DVec2>> {
    let [low, right, high, left] = sides;
    let last = NET_INTERVALS;
    let node = |k: usize| {
        let (i, j) = (k % NET_NODES, k / NET_NODES);
        let (u, v) = (i as f64 / last as f64, j as f64 / last as f64);
        // `high` and `left` run against u and v.
        let (across, along) = (
            low[i].lerp(high[last - i], v),
            left[last - j].lerp(right[j], u),
        );
        let corners = low[0].lerp(low[last], u).lerp(left[0].lerp(high[0], u), v);
        across + along - corners
    };
    let net: Vec<DVec2> = (0..NET_NODES * NET_NODES).map(node).collect();
    net.iter().all(|p| p.is_finite()).then_some(net)
}

/// Moves the inner nodes until u and v are harmonic in the plane: `a x_uu - 2 b x_uv + c x_vv = 0` with `a = |x_v|^2`,
/// `b = x_u . x_v`, `c = |x_u|^2` (Winslow 1966, DOI 10.1016/0021-9991(66)90001-5), by successive over-relaxation.
fn relax(net: &mut [DVec2], size: DVec2) {
    for _ in 0..MAX_SWEEPS {
        let mut largest = 0.0f64;
        for j in 1..NET_INTERVALS {
            for i in 1..NET_INTERVALS {
                let k = j * NET_NODES + i;
                let (west, east) = (net[k - 1], net[k + 1]);
                let (south, north) = (net[k - NET_NODES], net[k + NET_NODES]);
                let (along_u, along_v) = (0.5 * (east - west), 0.5 * (north - south));
                let a = along_v.length_squared();
                let b = along_u.dot(along_v);
                let c = along_u.length_squared();
                let mixed =
                    net[k + NET_NODES + 1] - net[k + NET_NODES - 1] - net[k - NET_NODES + 1]
                        + net[k - NET_NODES - 1];
                let sum = a * (east + west) + c * (north + south) - 0.5 * b * mixed;
                if a + c > 0.0 {
                    let step = RELAXATION_FACTOR * (sum / (2.0 * (a + c)) - net[k]);
                    net[k] += step;
                    largest = largest.max(step.length());
                }
            }
        }
        if largest < SETTLED_MOVE * size.max_element() {
            return;
        }
    }
}

/// The surface with the nodes at the Greville abscissae as control points; `None` if it folds.
fn surface(net: &[DVec2]) -> Option<Base> {
    let knots = KnotVector::uniform(3, SURFACE_SPANS + 3).ok()?;
    let place = |i: usize| match i {
        0 => 0,
        1 => 1,
        i if i > SURFACE_SPANS => NET_INTERVALS + i - SURFACE_SPANS - 2,
        i => 3 * (i - 1),
    };
    let node = |i, j| net[place(j) * NET_NODES + place(i)].extend(0.0);
    let points = ControlNet::from_fn(SURFACE_SPANS + 3, SURFACE_SPANS + 3, node).ok()?;
    let surface = NurbsSurface::new(knots.clone(), knots, points, None).ok()?;
    let steps = FOLD_TESTS * SURFACE_SPANS;
    let (mut least, mut most, mut total) = (f64::INFINITY, 0.0f64, 0.0);
    let mut size = [0.0; 2];
    for j in 0..=steps {
        for i in 0..=steps {
            let at = surface.derivatives(i as f64 / steps as f64, j as f64 / steps as f64);
            let area = at.du.cross(at.dv).z;
            least = least.min(area);
            most = most.max(area);
            total += area;
            size[0] += at.du.length();
            size[1] += at.dv.length();
        }
    }
    let places = ((steps + 1) * (steps + 1)) as f64;
    let mean = total / places;
    // The comparison is false for NaN.
    let unfolded = least > 0.0 && most.is_finite();
    unfolded.then(|| Base {
        surface,
        size: size.map(|s| s / places),
        stretch: [least / mean, most / mean],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn polygon(radius: impl Fn(f64) -> f64, middle: DVec2) -> Vec<DVec2> {
        let at = |k: i32| TAU * f64::from(k) / 400.0;
        (0..400)
            .map(|k| middle + radius(at(k)) * DVec2::from_angle(at(k)))
            .collect()
    }

    #[test]
    fn a_disc_is_filled_without_folds() {
        let (radius, middle) = (5.0, DVec2::splat(5.0));
        let base = fill(&polygon(|_| radius, middle), DVec2::splat(10.0), 0.05).unwrap();
        assert!(base.stretch[0] > 0.1 && base.stretch[1] < 3.0);
        for k in 0..=100 {
            let t = f64::from(k) / 100.0;
            for (u, v) in [(t, 0.0), (1.0, t), (t, 1.0), (0.0, t)] {
                let off = base.surface.point(u, v).truncate().distance(middle) - radius;
                assert!(off > -0.06 && off < 0.25, "{off} at {u} {v}");
            }
        }
        // Four corners alike: the middle is in the middle.
        assert!(base.surface.point(0.5, 0.5).truncate().distance(middle) < 0.02);
        assert!((base.size[0] - base.size[1]).abs() < 0.02);
    }

    #[test]
    fn a_bay_is_followed_without_folds() {
        let middle = DVec2::splat(6.0);
        let outline = polygon(|t| 5.0 + 0.9 * (3.0 * t).cos(), middle);
        let base = fill(&outline, DVec2::splat(12.0), 0.05).unwrap();
        assert!(base.stretch[0] > 0.0);
        assert!(fill(&outline[..3], DVec2::ONE, 0.1).is_none());
        assert!(fill(&[], DVec2::ONE, 0.1).is_none());
    }
}

//! The form of a surface that every reader takes: clamped at both ends of both directions.
//!
//! IGES knows unclamped and periodic knot vectors, but few readers do. Knot insertion changes the form and not the
//! surface: the ends of the wanted interval are inserted to multiplicity p, and what lies outside is cut off.
//!
//! Source: *The NURBS Book*, 2nd ed., section 5.2 (A5.1) and p. 577 (clamping).

use crate::nurbs::{ControlNet, KnotVector, NurbsCurve, NurbsSurface};
use crate::{DVec4, Result};

/// Control points of one strip, in homogeneous coordinates, with their knots.
struct Strip {
    knots: Vec<f64>,
    points: Vec<DVec4>,
}

impl Strip {
    /// Inserts `t`, inside the domain, until it has multiplicity p (A5.1, one knot at a time).
    fn insert_to_degree(&mut self, p: usize, t: f64) {
        loop {
            let after = self.knots.partition_point(|&u| u <= t);
            let first = self.knots.partition_point(|&u| u < t);
            let s = after - first;
            if s >= p {
                return;
            }
            let k = after - 1;
            let changed: Vec<DVec4> = (k - p + 1..=k - s)
                .map(|i| {
                    let (low, high) = (self.knots[i], self.knots[i + p]);
                    let alpha = (t - low) / (high - low);
                    self.points[i - 1].lerp(self.points[i], alpha)
                })
                .collect();
            self.points.splice(k - p + 1..k - s, changed);
            self.knots.insert(after, t);
        }
    }

    /// The part on \[a, b\], clamped.
    fn part(mut self, p: usize, a: f64, b: f64) -> Strip {
        self.insert_to_degree(p, a);
        self.insert_to_degree(p, b);
        // p knots a end at index `last`; the control point before the first of them is the curve's point at a.
        let first_a = self.knots.partition_point(|&u| u <= a) - p;
        let first_b = self.knots.partition_point(|&u| u < b);
        let mut knots = vec![a];
        knots.extend_from_slice(&self.knots[first_a..first_b + p]);
        knots.push(b);
        Strip {
            knots,
            points: self.points[first_a - 1..first_b].to_vec(),
        }
    }
}

/// The part of one direction on \[a, b\]: the new knots and strips. `strips` are control points along that direction.
fn part_of_strips(
    knots: &KnotVector,
    strips: Vec<Vec<DVec4>>,
    (a, b): (f64, f64),
) -> Result<(KnotVector, Vec<Vec<DVec4>>)> {
    let closes = knots.is_periodic() && (a, b) == knots.domain();
    let p = knots.degree();
    let mut new_knots = Vec::new();
    let mut parts = Vec::with_capacity(strips.len());
    for points in strips {
        let mut part = Strip {
            knots: knots.knots().to_vec(),
            points,
        }
        .part(p, a, b);
        // A periodic strip comes back to its first point; rounding shall not open it.
        if closes
            && let Some(&first) = part.points.first()
            && let Some(last) = part.points.last_mut()
        {
            *last = first;
        }
        new_knots = part.knots;
        parts.push(part.points);
    }
    Ok((KnotVector::new(p, new_knots)?, parts))
}

/// The curve on \[a, b\] of its domain, clamped. O(p n).
///
/// # Errors
/// [`crate::Error::Invalid`] if \[a, b\] is empty or the numbers overflow.
pub(super) fn part_of_curve(curve: &NurbsCurve, (a, b): (f64, f64)) -> Result<NurbsCurve> {
    let points = (0..curve.control_points().len())
        .map(|i| curve.homogeneous(i))
        .collect();
    let (knots, mut parts) = part_of_strips(curve.knots(), vec![points], (a, b))?;
    let points = parts.pop().unwrap_or_default();
    let weights = curve
        .weights()
        .map(|_| points.iter().map(|h| h.w).collect());
    let rational = curve.weights().is_some();
    NurbsCurve::new(
        knots,
        points.iter().map(|&h| cartesian(h, rational)).collect(),
        weights,
    )
}

/// The surface on the rectangle `[(a, b), (c, d)]` of its domain, clamped in both directions. O(p m n).
///
/// # Errors
/// [`crate::Error::Invalid`] if the rectangle is empty or the numbers overflow.
pub(super) fn part_of_surface(
    surface: &NurbsSurface,
    [range_u, range_v]: [(f64, f64); 2],
) -> Result<NurbsSurface> {
    let [m, n] = surface.control_points().counts();
    let rows = (0..n)
        .map(|j| (0..m).map(|i| surface.homogeneous(i, j)).collect())
        .collect();
    let (knots_u, rows) = part_of_strips(surface.knots_u(), rows, range_u)?;
    let m = knots_u.control_point_count();
    let columns = (0..m)
        .map(|i| rows.iter().map(|row| row[i]).collect())
        .collect();
    let (knots_v, columns) = part_of_strips(surface.knots_v(), columns, range_v)?;
    let n = knots_v.control_point_count();
    let rational = surface.is_rational();
    let at = |i: usize, j: usize| columns[i][j];
    let net = ControlNet::from_fn(m, n, |i, j| cartesian(at(i, j), rational))?;
    let weights = rational.then(|| {
        (0..n)
            .flat_map(|j| (0..m).map(move |i| (i, j)))
            .map(|(i, j)| at(i, j).w)
            .collect()
    });
    NurbsSurface::new(knots_u, knots_v, net, weights)
}

fn cartesian(h: DVec4, rational: bool) -> crate::DVec3 {
    if rational {
        h.truncate() / h.w
    } else {
        h.truncate()
    }
}

/// The surface itself where it is clamped, else its clamped form.
///
/// # Errors
/// As [`part_of_surface`].
pub(super) fn clamped(surface: &NurbsSurface) -> Result<std::borrow::Cow<'_, NurbsSurface>> {
    let plain = |knots: &KnotVector| knots.is_clamped() && !knots.is_periodic();
    if plain(surface.knots_u()) && plain(surface.knots_v()) {
        Ok(std::borrow::Cow::Borrowed(surface))
    } else {
        part_of_surface(surface, surface.domain()).map(std::borrow::Cow::Owned)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DVec3;

    #[test]
    fn a_periodic_torus_keeps_its_shape_and_closes_exactly() {
        for degree in 1..=6 {
            let breaks_u: Vec<f64> = (0..=7)
                .map(|i| f64::from(i) + 0.3 * f64::from(i % 3))
                .collect();
            let breaks_v = [0.0, 0.5, 0.8, 2.0];
            let ku = KnotVector::periodic(degree, &breaks_u).unwrap();
            let kv = KnotVector::periodic(2, &breaks_v).unwrap();
            let (du, dv) = (ku.distinct_count(), kv.distinct_count());
            let net = ControlNet::from_fn(
                ku.control_point_count(),
                kv.control_point_count(),
                |i, j| {
                    let (a, b) = ((i % du) as f64 * 0.9, (j % dv) as f64 * 2.1);
                    DVec3::new(
                        (3.0 + b.cos()) * a.cos(),
                        (3.0 + b.cos()) * a.sin(),
                        b.sin(),
                    )
                },
            )
            .unwrap();
            let weights = (0..net.points().len())
                .map(|k| {
                    let (i, j) = (k % net.count_u() % du, k / net.count_u() % dv);
                    1.0 + 0.1 * (i + 2 * j) as f64
                })
                .collect();
            let surface = NurbsSurface::new(ku, kv, net, Some(weights)).unwrap();
            let plain = clamped(&surface).unwrap();
            assert!(plain.knots_u().is_clamped() && plain.knots_v().is_clamped());
            assert_eq!(plain.domain(), surface.domain());
            let [(a, b), (c, d)] = surface.domain();
            for i in 0..=20 {
                for j in 0..=20 {
                    let (u, v) = (
                        a + (b - a) * f64::from(i) / 20.0,
                        c + (d - c) * f64::from(j) / 20.0,
                    );
                    assert!((plain.point(u, v) - surface.point(u, v)).length() < 1e-13);
                }
            }
            let [m, n] = plain.control_points().counts();
            assert!((0..n).all(|j| plain.homogeneous(0, j) == plain.homogeneous(m - 1, j)));
            assert!((0..m).all(|i| plain.homogeneous(i, 0) == plain.homogeneous(i, n - 1)));
        }
    }

    #[test]
    fn a_part_is_the_part() {
        let knots =
            KnotVector::new(3, vec![-3., -1., -0.5, 0., 1., 1., 2., 3., 3.5, 4., 6.]).unwrap();
        let points: Vec<DVec3> = (0..7)
            .map(|i| DVec3::new(f64::from(i), f64::from(i * i % 5), 1.0))
            .collect();
        let curve = NurbsCurve::new(knots, points, None).unwrap();
        for range in [
            (0.0, 3.0),
            (0.0, 1.0),
            (1.0, 2.0),
            (0.25, 2.75),
            (1.5, 1.75),
        ] {
            let part = part_of_curve(&curve, range).unwrap();
            assert_eq!(part.domain(), range);
            assert!(part.knots().is_clamped());
            for k in 0..=30 {
                let t = range.0 + (range.1 - range.0) * f64::from(k) / 30.0;
                assert!(
                    (part.point(t) - curve.point(t)).length() < 1e-13,
                    "{range:?} {t}"
                );
            }
        }
    }
}

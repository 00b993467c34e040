//! Where a closed direction begins and ends.

use super::Direction;
use crate::nurbs::{ControlNet, KnotVector, NurbsSurface};
use crate::{Error, Result};

impl NurbsSurface {
    /// The same surface with the seam of a periodic direction at the knot that ends its span number `span` of the domain,
    /// 0 leaving all as it is. The domain stays; parameters move by the knot's distance from its start. Exact: control
    /// points change their order only.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the direction is not periodic.
    pub fn with_seam_after(&self, direction: Direction, span: usize) -> Result<Self> {
        let knots = self.knots(direction);
        if !knots.is_periodic() {
            return Err(Error::invalid(
                "only a periodic direction can begin elsewhere",
            ));
        }
        let (p, n) = (knots.degree(), knots.distinct_count());
        let (a, b) = knots.domain();
        // Stored control points to turn by: those whose knots lie before the new start.
        let breaks = knots.breakpoints();
        let start = breaks[span % (breaks.len() - 1)];
        let turn = knots.knots()[p..].partition_point(|&u| u < start);
        let all = knots.knots();
        let knot = |i: usize| {
            let j = i + turn;
            if j < all.len() {
                all[j]
            } else {
                all[j - n] + (b - a)
            }
        };
        let turned = KnotVector::from_periodic_knots(p, (0..all.len()).map(knot).collect())?;
        let turned = turned.with_domain(a, b)?;
        let source = |k: usize| (k + turn) % n;
        let [m, rows] = self.control_points().counts();
        let from = |i: usize, j: usize| match direction {
            Direction::U => (source(i), j),
            Direction::V => (i, source(j)),
        };
        let net = ControlNet::from_fn(m, rows, |i, j| {
            let (i, j) = from(i, j);
            self.control_points().point(i, j)
        })?;
        let weights = self.weights().map(|w| {
            let places = (0..m * rows).map(|k| from(k % m, k / m));
            places.map(|(i, j)| w[j * m + i]).collect()
        });
        let (u, v) = match direction {
            Direction::U => (turned, self.knots_v().clone()),
            Direction::V => (self.knots_u().clone(), turned),
        };
        NurbsSurface::new(u, v, net, weights)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn a_turned_seam_moves_nothing() {
        let breaks = [0.0, 0.1, 0.25, 0.5, 0.6, 0.8, 1.0];
        let v = KnotVector::periodic(3, &breaks).unwrap();
        let u = KnotVector::uniform(2, 4).unwrap();
        let net = ControlNet::from_fn(4, 9, |i, j| {
            let a = (j % 6) as f64;
            DVec3::new(i as f64, a.cos() * (1.0 + 0.1 * i as f64), a.sin())
        });
        let surface = NurbsSurface::new(u, v, net.unwrap(), None).unwrap();
        for (span, &shift) in breaks[..6].iter().enumerate() {
            for (surface, direction) in [
                (surface.clone(), Direction::V),
                (surface.transposed(), Direction::U),
            ] {
                let turned = surface.with_seam_after(direction, span).unwrap();
                assert_eq!(turned.domain(), surface.domain());
                for k in 0..40 {
                    let (s, t) = (0.3, f64::from(k) / 40.0);
                    let was = (t + shift).rem_euclid(1.0);
                    let [p, q] = match direction {
                        Direction::V => [turned.point(s, t), surface.point(s, was)],
                        Direction::U => [turned.point(t, s), surface.point(was, s)],
                    };
                    assert!(p.distance(q) < 1e-14);
                }
            }
        }
    }
}

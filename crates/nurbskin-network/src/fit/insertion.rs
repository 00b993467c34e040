//! Knot insertion as a matrix: the control points on finer knots from those on coarser ones.
//!
//! Row i of the matrix is
//!
//! ```text
//! R_1(t_{i+1}) R_2(t_{i+2}) ... R_p(t_{i+p})
//! ```
//!
//! where `R_k` is the k-th step of the recurrence of the basis functions on the coarse knots. Rows sum to 1 and have no negative entries.
//!
//! Source: E. Cohen, T. Lyche, R. Riesenfeld, *Discrete B-splines and subdivision techniques*, Computer Graphics and
//! Image Processing 14 (1980), the Oslo algorithm.

use nurbskin_geometry::nurbs::{KnotVector, MAX_DEGREE};

/// The rows of an insertion matrix.
#[derive(Clone, Debug)]
pub(crate) struct Insertion {
    /// For each fine control point the first coarse one that counts.
    pub(crate) first: Vec<usize>,
    /// The weights of `degree + 1` coarse control points from `first` on.
    pub(crate) weights: Vec<[f64; MAX_DEGREE + 1]>,
}

/// The matrix that leads from control points on `coarse` to those on `fine`, clamped knots of the same degree and
/// domain; `fine` holds all of `coarse`. O(n p^2).
pub(crate) fn insertion(coarse: &KnotVector, fine: &KnotVector) -> Insertion {
    let p = coarse.degree();
    let (t, tau) = (fine.knots(), coarse.knots());
    let mut rows = Insertion {
        first: Vec::with_capacity(fine.control_point_count()),
        weights: Vec::with_capacity(fine.control_point_count()),
    };
    for i in 0..fine.control_point_count() {
        let span = coarse.span(t[i]);
        let mut row = [0.0; MAX_DEGREE + 1];
        row[0] = 1.0;
        for k in 1..=p {
            let mut saved = 0.0;
            for r in 0..k {
                let (low, high) = (tau[span + 1 - k + r], tau[span + 1 + r]);
                let share = row[r] / (high - low);
                row[r] = saved + (high - t[i + k]) * share;
                saved = (t[i + k] - low) * share;
            }
            row[k] = saved;
        }
        rows.first.push(span - p);
        rows.weights.push(row);
    }
    rows
}

impl Insertion {
    /// The fine control points for coarse ones.
    pub(crate) fn apply(&self, coarse: &[glam::DVec3]) -> Vec<glam::DVec3> {
        let row = |(first, weights): (&usize, &[f64; MAX_DEGREE + 1])| {
            let used = coarse.iter().skip(*first);
            used.zip(weights).map(|(point, w)| *w * *point).sum()
        };
        self.first.iter().zip(&self.weights).map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use nurbskin_geometry::NurbsCurve;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_curve_stays(
            degree in 1_usize..6,
            coarse in proptest::collection::btree_set(1_u32..64, 0..6),
            more in proptest::collection::btree_set(1_u32..64, 0..9),
        ) {
            let knots = |set: &std::collections::BTreeSet<u32>| {
                let inner = set.iter().map(|&k| f64::from(k) / 64.0);
                let breaks: Vec<f64> = [0.0].into_iter().chain(inner).chain([1.0]).collect();
                KnotVector::clamped(degree, &breaks).unwrap()
            };
            let (coarse, fine) = (knots(&coarse), knots(&coarse.union(&more).copied().collect()));
            let points: Vec<DVec3> = (0..coarse.control_point_count())
                .map(|i| {
                    let x = i as f64;
                    DVec3::new(x, (x * 1.7).sin(), (x * 0.9).cos() * x)
                })
                .collect();
            let matrix = insertion(&coarse, &fine);
            for row in &matrix.weights {
                prop_assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-13);
                prop_assert!(row.iter().all(|&w| w >= -1e-15));
            }
            let old = NurbsCurve::new(coarse, points.clone(), None).unwrap();
            let new = NurbsCurve::new(fine, matrix.apply(&points), None).unwrap();
            for k in 0..=40 {
                let t = f64::from(k) / 40.0;
                prop_assert!(old.point(t).distance(new.point(t)) < 1e-12);
            }
        }
    }
}

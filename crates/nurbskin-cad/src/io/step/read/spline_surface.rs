//! B-spline surfaces of a STEP file.

use super::curve::knots;
use super::instance::Instance;
use super::parse::Value;
use super::place::Geometry;
use crate::io::text::true_weights;
use nurbskin_geometry::Result;
use nurbskin_geometry::nurbs::{ControlNet, NurbsSurface};

impl Geometry<'_, '_> {
    pub(super) fn spline_surface(&self, instance: &Instance<'_, '_>) -> Result<NurbsSurface> {
        let complex = instance.is_complex();
        let base = instance.part("B_SPLINE_SURFACE")?;
        let k = usize::from(!complex);
        let degree = [base.count(k)?, base.count(k + 1)?];
        // Rows along u, in the file; u is fastest here.
        let rows = base.list(k + 2)?;
        let mut lines = Vec::with_capacity(rows.len());
        for row in rows {
            let Value::List(row) = row else {
                return Err(instance.error("the control points should be a list of lists"));
            };
            let points = base
                .references_of(k + 2, row)?
                .into_iter()
                .map(|p| self.point(p));
            lines.push(points.collect::<Result<Vec<_>>>()?);
        }
        let counts = [lines.len(), lines.first().map_or(0, Vec::len)];
        if counts.contains(&0) || lines.iter().any(|l| l.len() != counts[1]) {
            return Err(instance.error("the rows of control points differ in length"));
        }
        let named = |text: &str| instance.parts.iter().any(|p| p.name == text);
        let given = if named("B_SPLINE_SURFACE_WITH_KNOTS") {
            let part = instance.part("B_SPLINE_SURFACE_WITH_KNOTS")?;
            let k = if complex { 0 } else { 8 };
            Some([
                (part.counts(k)?, part.reals(k + 2)?),
                (part.counts(k + 1)?, part.reals(k + 3)?),
            ])
        } else if named("BEZIER_SURFACE")
            || named("UNIFORM_SURFACE")
            || named("QUASI_UNIFORM_SURFACE")
        {
            None
        } else {
            return Err(instance.error("the knots are missing"));
        };
        let made = |axis: usize| {
            let given = given.as_ref().map(|g| (&g[axis].0[..], &g[axis].1[..]));
            knots(
                instance,
                degree[axis],
                counts[axis],
                given,
                named("BEZIER_SURFACE"),
                named("QUASI_UNIFORM_SURFACE"),
            )
        };
        let weights = if complex && named("RATIONAL_B_SPLINE_SURFACE") {
            true_weights(self.weights(instance, counts)?)
        } else {
            None
        };
        let net = ControlNet::from_fn(counts[0], counts[1], |i, j| lines[i][j])
            .map_err(|e| instance.error(e))?;
        let surface = NurbsSurface::new(made(0)?, made(1)?, net, weights);
        surface
            .and_then(|s| s.clamped())
            .map_err(|e| instance.error(e))
    }

    fn weights(&self, instance: &Instance<'_, '_>, [m, n]: [usize; 2]) -> Result<Vec<f64>> {
        let part = instance.part("RATIONAL_B_SPLINE_SURFACE")?;
        let mut rows = Vec::new();
        for row in part.list(0)? {
            let Value::List(row) = row else {
                return Err(instance.error("the weights should be a list of lists"));
            };
            rows.push(part.reals_of(0, row)?);
        }
        if rows.len() != m || rows.iter().any(|r| r.len() != n) {
            return Err(
                instance.error("the number of weights differs from the number of control points")
            );
        }
        Ok((0..n)
            .flat_map(|j| rows.iter().map(move |r| r[j]))
            .collect())
    }
}

//! Parametric splines (entities 112 and 114): polynomial pieces, turned into B-splines exactly.

use super::super::field::Fields;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::{ControlNet, KnotVector, NurbsCurve, NurbsSurface};
use nurbskin_geometry::unit::three_digits;
use nurbskin_geometry::{DVec3, Error, Result};

/// Beyond this many pieces in a direction, knots keep their full multiplicity: removing them takes quadratic time.
const MOST_REDUCED: usize = 1000;

/// Reads entity 112.
pub(super) fn read_curve(fields: &mut Fields<'_>) -> Result<NurbsCurve> {
    fields.skip(3)?; // the kind of spline, its continuity and dimension: the numbers themselves tell
    let pieces = fields.count("pieces of a spline curve")?;
    let breaks = fields.reals(pieces + 1, "breakpoints")?;
    let values = fields.reals(pieces.saturating_mul(12), "coefficients")?;
    let mut powers = Vec::with_capacity(4 * pieces);
    for piece in values.chunks_exact(12) {
        powers.extend((0..4).map(|k| DVec3::new(piece[k], piece[4 + k], piece[8 + k])));
    }
    let made = || -> Result<NurbsCurve> {
        let lines = Lines::new(&breaks, &powers)?;
        let points = lines.points(&powers)?;
        let tolerance = rounding(&points);
        let curve = NurbsCurve::new(lines.knots()?, points, None)?;
        if pieces > MOST_REDUCED || pieces == 1 {
            return Ok(curve);
        }
        Ok(curve.remove_knots(tolerance)?.result)
    };
    made().map_err(|e| fields.refuse(format!("the spline curve is not valid: {e}")))
}

/// Reads entity 114.
pub(super) fn read_surface(fields: &mut Fields<'_>) -> Result<NurbsSurface> {
    fields.skip(2)?; // the kind of spline and of patches: the numbers themselves tell
    let m = fields.count("patches along u")?;
    let n = fields.count("patches along v")?;
    let breaks_u = fields.reals(m + 1, "breakpoints along u")?;
    let breaks_v = fields.reals(n + 1, "breakpoints along v")?;
    fields.expect_room(m.saturating_mul(n).saturating_mul(48), "coefficients")?;
    // Powers of u and v of all patches: [4 i + k of u] of rows [4 j + l of v].
    let mut net = vec![DVec3::ZERO; 16 * m * n];
    for i in 0..m {
        for j in 0..n {
            let c = fields.reals(48, "coefficients of a patch")?;
            for l in 0..4 {
                for k in 0..4 {
                    let at = 4 * l + k;
                    net[(4 * j + l) * 4 * m + 4 * i + k] =
                        DVec3::new(c[at], c[16 + at], c[32 + at]);
                }
            }
        }
        fields.skip(48)?; // a patch of no meaning ends each row
    }
    assembled(&breaks_u, &breaks_v, &net)
        .map_err(|e| fields.refuse(format!("the spline surface is not valid: {e}")))
}

fn assembled(breaks_u: &[f64], breaks_v: &[f64], net: &[DVec3]) -> Result<NurbsSurface> {
    let m = breaks_u.len() - 1;
    // 1. Along u, row by row; then along v, column by column.
    let along_u = Lines::new(breaks_u, net)?;
    let rows = net.chunks_exact(4 * m).map(|row| along_u.raw_points(row));
    let rows: Vec<Vec<DVec3>> = rows.collect();
    let count_u = along_u.count();
    let columns: Vec<Vec<DVec3>> = (0..count_u)
        .map(|i| rows.iter().map(|row| row[i]).collect())
        .collect();
    let along_v = Lines::new(breaks_v, &columns.concat())?;
    let columns: Vec<Vec<DVec3>> = columns.iter().map(|c| along_v.raw_points(c)).collect();
    let count_v = along_v.count();
    let net = ControlNet::from_fn(count_u, count_v, |i, j| columns[i][j])?;
    // 2. The patches must meet: rounding of the file's numbers is all that may part them.
    let [low, high] = net.bounding_box();
    let gap = along_u.gap.get().max(along_v.gap.get());
    if gap > 1e-4 * low.distance(high) {
        return Err(Error::invalid(format!(
            "its patches are {} (in the file's unit) apart",
            three_digits(gap)
        )));
    }
    let tolerance = rounding(net.points());
    let mut surface = NurbsSurface::new(along_u.knots()?, along_v.knots()?, net, None)?;
    for (direction, breaks) in Direction::BOTH.into_iter().zip([breaks_u, breaks_v]) {
        if (3..=MOST_REDUCED).contains(&breaks.len()) {
            surface = surface.remove_knots(direction, tolerance)?.result;
        }
    }
    Ok(surface)
}

/// What rounding leaves of a sum of four terms of this size.
fn rounding(points: &[DVec3]) -> f64 {
    let reach = points.iter().map(|p| p.abs().max_element());
    64.0 * f64::EPSILON * reach.fold(0.0, f64::max)
}

/// Pieces in powers of the distance from where they start, four coefficients each.
struct Lines<'b> {
    breaks: &'b [f64],
    degree: usize,
    /// The widest gap between neighbours so far.
    gap: std::cell::Cell<f64>,
}

impl<'b> Lines<'b> {
    /// For lines of pieces one after the other, of the lowest degree that has all their powers.
    fn new(breaks: &'b [f64], powers: &[DVec3]) -> Result<Self> {
        if breaks.windows(2).any(|w| w[0] >= w[1]) {
            return Err(Error::invalid("its breakpoints do not rise"));
        }
        let has = |k: usize| powers.iter().skip(k).step_by(4).any(|c| *c != DVec3::ZERO);
        Ok(Self {
            breaks,
            degree: [3, 2].into_iter().find(|&k| has(k)).unwrap_or(1),
            gap: std::cell::Cell::new(0.0),
        })
    }

    fn count(&self) -> usize {
        self.degree * (self.breaks.len() - 1) + 1
    }

    fn knots(&self) -> Result<KnotVector> {
        let last = self.breaks.len() - 1;
        let inner = self.breaks.iter().enumerate().flat_map(|(k, &t)| {
            let copies = if k == 0 || k == last { 1 } else { self.degree };
            std::iter::repeat_n(t, copies)
        });
        KnotVector::clamped(self.degree, &inner.collect::<Vec<_>>())
    }

    /// The control points of one line, its pieces as Bezier curves; where they do not meet, the middle.
    fn raw_points(&self, powers: &[DVec3]) -> Vec<DVec3> {
        let p = self.degree;
        let mut points: Vec<DVec3> = Vec::with_capacity(self.count());
        for (piece, w) in powers.chunks_exact(4).zip(self.breaks.windows(2)) {
            let h = w[1] - w[0];
            // Power k contributes C(i, k) / C(p, k) to control point i.
            let binomial = |n: usize, k: usize| -> f64 {
                (0..k).fold(1.0, |b, x| b * (n as f64 - x as f64) / (x as f64 + 1.0))
            };
            let scaled = [
                piece[0],
                piece[1] * h,
                piece[2] * (h * h),
                piece[3] * (h * h * h),
            ];
            let of = |i: usize| {
                let terms = (1..=i).map(|k| scaled[k] * (binomial(i, k) / binomial(p, k)));
                terms.fold(scaled[0], |sum, term| sum + term)
            };
            match points.last_mut() {
                Some(joint) => {
                    self.gap.set(self.gap.get().max(joint.distance(scaled[0])));
                    *joint = joint.midpoint(scaled[0]);
                }
                None => points.push(scaled[0]),
            }
            points.extend((1..=p).map(of));
        }
        points
    }

    fn points(&self, powers: &[DVec3]) -> Result<Vec<DVec3>> {
        let points = self.raw_points(powers);
        let [low, high] = nurbskin_geometry::point_grid::bounding_box(&points);
        let gap = self.gap.get();
        if gap > 1e-4 * low.distance(high) {
            return Err(Error::invalid(format!(
                "its pieces are {} (in the file's unit) apart",
                three_digits(gap)
            )));
        }
        Ok(points)
    }
}

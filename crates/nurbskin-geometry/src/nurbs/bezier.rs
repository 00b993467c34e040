//! Bezier extraction: a spline as its polynomial pieces.
//!
//! Control points are homogeneous, (w P, w), so that a rational piece is a polynomial one in four coordinates; for a
//! polynomial spline w is 1.

use super::refine::{Direction, LineMap, bezier_target};
use super::{KnotVector, MAX_DEGREE, NurbsCurve, NurbsSurface};
use crate::Result;
use glam::{DVec3, DVec4};

/// One polynomial piece of a curve.
#[derive(Clone, Debug, PartialEq)]
pub struct BezierCurve {
    /// The parameter interval of the spline that this piece covers.
    pub range: (f64, f64),
    /// The p + 1 homogeneous control points.
    pub points: Vec<DVec4>,
}

/// One polynomial piece of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct BezierPatch {
    /// Degrees [p, q].
    pub degree: [usize; 2],
    /// The parameter rectangle of the spline that this piece covers: (a, b) of u, (c, d) of v.
    pub range: [(f64, f64); 2],
    /// The (p + 1)(q + 1) homogeneous control points, u fastest.
    pub points: Vec<DVec4>,
}

/// The pieces of a curve, in the order of its parameter.
///
/// Source: A5.6, *The NURBS Book*, 2nd ed., p. 173, by polar forms.
///
/// # Errors
/// None for a valid curve.
pub fn curve_pieces(curve: &NurbsCurve) -> Result<Vec<BezierCurve>> {
    let map = LineMap::refinement(curve.knots(), bezier_target(curve.knots())?);
    let points = map.apply(&curve.homogeneous_points(), 1);
    let p = curve.knots().degree();
    let ranges = ranges(map.target());
    let piece = |(k, &range): (usize, _)| BezierCurve {
        range,
        points: points[k * p..=(k + 1) * p].to_vec(),
    };
    Ok(ranges.iter().enumerate().map(piece).collect())
}

/// The pieces of a surface, u fastest.
///
/// Source: A5.7, *The NURBS Book*, 2nd ed., p. 177, by polar forms.
///
/// ```
/// use nurbskin_geometry::nurbs::{bezier, conic};
/// use nurbskin_geometry::DVec3;
/// let sphere = conic::sphere(DVec3::ZERO, 1.0)?;
/// let pieces = bezier::patches(&sphere)?;
/// assert_eq!(pieces.len(), 4 * 2);
/// assert!((pieces[3].point(0.2, 0.7).length() - 1.0).abs() < 1e-15);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
///
/// # Errors
/// None for a valid surface.
pub fn patches(surface: &NurbsSurface) -> Result<Vec<BezierPatch>> {
    let mut patches = Vec::new();
    visit(surface, |_, patch| patches.push(patch.clone()))?;
    Ok(patches)
}

/// Calls `f` with the number [i, j] of each piece and the piece, u fastest, without storing them all.
pub fn visit(surface: &NurbsSurface, mut f: impl FnMut([usize; 2], &BezierPatch)) -> Result<()> {
    let map_u = LineMap::refinement(surface.knots_u(), bezier_target(surface.knots_u())?);
    let map_v = LineMap::refinement(surface.knots_v(), bezier_target(surface.knots_v())?);
    let points = map_u.apply(&surface.homogeneous_points(), 1);
    let stride = map_u.target().control_point_count();
    let degree @ [p, q] = surface.degree();
    let ranges_u = ranges(map_u.target());
    let mut strip = Vec::with_capacity(stride * (q + 1));
    let mut patch = BezierPatch {
        degree,
        range: [(0.0, 1.0); 2],
        points: Vec::with_capacity((p + 1) * (q + 1)),
    };
    for (l, range_v) in ranges(map_v.target()).into_iter().enumerate() {
        strip.clear();
        map_v.append(&points, stride, l * q..(l + 1) * q + 1, &mut strip);
        for (k, &range_u) in ranges_u.iter().enumerate() {
            patch.range = [range_u, range_v];
            patch.points.clear();
            for row in strip.chunks_exact(stride) {
                patch.points.extend_from_slice(&row[k * p..=(k + 1) * p]);
            }
            f([k, l], &patch);
        }
    }
    Ok(())
}

fn ranges(knots: &KnotVector) -> Vec<(f64, f64)> {
    knots
        .breakpoints()
        .windows(2)
        .map(|w| (w[0], w[1]))
        .collect()
}

impl BezierCurve {
    /// The point at s in \[0, 1\] of the range, by de Casteljau's algorithm.
    ///
    /// Source: A1.5, *The NURBS Book*, 2nd ed., p. 24.
    #[must_use]
    pub fn point(&self, s: f64) -> DVec3 {
        let h = de_casteljau(self.points.iter().copied(), s);
        h.truncate() / h.w
    }

    /// The two parts before and after s in \[0, 1\] of the range.
    #[must_use]
    pub fn split(&self, s: f64) -> [Self; 2] {
        let (left, right) = split_range(self.range, s);
        let (mut low, mut high) = (self.points.clone(), self.points.clone());
        split_line(&mut low, &mut high, s, 1);
        [
            Self {
                range: left,
                points: low,
            },
            Self {
                range: right,
                points: high,
            },
        ]
    }
}

impl BezierPatch {
    /// The point at (s, t) in \[0, 1\] x \[0, 1\] of the range, by de Casteljau's algorithm.
    ///
    /// Source: A1.7, *The NURBS Book*, 2nd ed., p. 39.
    #[must_use]
    pub fn point(&self, s: f64, t: f64) -> DVec3 {
        let rows = self.points.chunks_exact(self.degree[0] + 1);
        let h = de_casteljau(rows.map(|row| de_casteljau(row.iter().copied(), s)), t);
        h.truncate() / h.w
    }

    /// The two parts before and after s in \[0, 1\] of the range of `direction`.
    #[must_use]
    pub fn split(&self, direction: Direction, s: f64) -> [Self; 2] {
        let [p, q] = self.degree;
        let (mut low, mut high) = (self.clone(), self.clone());
        let (axis, lines, step, stride) = match direction {
            Direction::U => (0, q + 1, p + 1, 1),
            Direction::V => (1, p + 1, 1, p + 1),
        };
        (low.range[axis], high.range[axis]) = split_range(self.range[axis], s);
        let count = self.degree[axis] + 1;
        for line in 0..lines {
            let (start, end) = (line * step, line * step + (count - 1) * stride + 1);
            split_line(
                &mut low.points[start..end],
                &mut high.points[start..end],
                s,
                stride,
            );
        }
        [low, high]
    }

    /// Corners of the box around the control points, which holds the piece.
    #[must_use]
    pub fn bounding_box(&self) -> [DVec3; 2] {
        let points = self.points.iter().map(|h| h.truncate() / h.w);
        points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| {
            [low.min(p), high.max(p)]
        })
    }
}

fn split_range((a, b): (f64, f64), s: f64) -> ((f64, f64), (f64, f64)) {
    let middle = a + s * (b - a);
    ((a, middle), (middle, b))
}

/// The value of a Bezier polynomial; at most [`MAX_DEGREE`] + 1 points.
fn de_casteljau(points: impl ExactSizeIterator<Item = DVec4>, s: f64) -> DVec4 {
    let mut work = [DVec4::ZERO; MAX_DEGREE + 1];
    let count = points.len();
    for (place, point) in work.iter_mut().zip(points) {
        *place = point;
    }
    for last in (1..count).rev() {
        for k in 0..last {
            work[k] = (1.0 - s) * work[k] + s * work[k + 1];
        }
    }
    work[0]
}

/// De Casteljau's scheme on a line of points `stride` apart: `low` and `high` hold the points and get those of the two
/// parts.
fn split_line(low: &mut [DVec4], high: &mut [DVec4], s: f64, stride: usize) {
    let count = high.len().div_ceil(stride);
    for level in 1..count {
        for k in 0..count - level {
            high[k * stride] = (1.0 - s) * high[k * stride] + s * high[(k + 1) * stride];
        }
        low[level * stride] = high[0];
    }
}

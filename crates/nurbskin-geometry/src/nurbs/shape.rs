//! Normals, curvatures, continuity.
//!
//! The normal is that of `S_u x S_v`. A curvature is positive where the surface bends towards the normal: a sphere
//! with outward normals has the principal curvatures -1/r.

use super::basis::basis_derivatives;
use super::refine::Direction;
use super::surface::SurfaceDerivatives;
use super::{KnotVector, NurbsCurve, NurbsSurface};
use crate::math;
use crate::{Error, Result};
use glam::{DVec3, DVec4};

/// Part of the derivatives at a seam by which they may differ where it is smooth: what text with six digits leaves.
const SEAMLESS: f64 = 1e-6;

/// How a surface bends at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curvature {
    /// Unit normal.
    pub normal: DVec3,
    /// First fundamental form E, F, G: the products `S_u S_u`, `S_u S_v`, `S_v S_v`.
    pub first: [f64; 3],
    /// Second fundamental form L, M, N: the components of `S_uu`, `S_uv`, `S_vv` along the normal.
    pub second: [f64; 3],
    /// Gaussian curvature, the product of the principal ones.
    pub gaussian: f64,
    /// Mean curvature, half the sum of the principal ones.
    pub mean: f64,
    /// Principal curvatures, the larger first.
    pub principal: [f64; 2],
    /// Their unit directions, a right-handed frame with the normal; any such frame at an umbilic point.
    pub directions: [DVec3; 2],
}

/// The largest jumps found along a knot line or a seam. All are 0 to rounding where the surface is smooth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jumps {
    /// Of the position, a length.
    pub position: f64,
    /// Of the first derivative across the line, a length per parameter.
    pub first: f64,
    /// Of the second derivative across the line.
    pub second: f64,
    /// Of the normal: an angle in radians. Where it vanishes, the surface is smooth (G1) whatever its parameters do.
    pub normal_angle: f64,
    /// Of the normal curvature across the line. With equal normals, that is the jump of twice the mean curvature.
    pub curvature: f64,
}

/// A side of the parameter rectangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Edge {
    /// The smallest u.
    UMin,
    /// The largest u.
    UMax,
    /// The smallest v.
    VMin,
    /// The largest v.
    VMax,
}

impl Edge {
    /// All four.
    pub const ALL: [Edge; 4] = [Edge::UMin, Edge::UMax, Edge::VMin, Edge::VMax];

    /// The direction that ends at this edge.
    #[must_use]
    pub fn direction(self) -> Direction {
        match self {
            Edge::UMin | Edge::UMax => Direction::U,
            Edge::VMin | Edge::VMax => Direction::V,
        }
    }
}

impl NurbsSurface {
    /// Unit normal at (u, v), or `None` where there is none.
    ///
    /// Where `S_u` vanishes to rounding (a pole), the normal is the limit along the line of constant u, which is that
    /// of `S_uv x S_v`, and likewise for `S_v`. At a smooth pole, such as that of a sphere, it does not depend on u; at
    /// the tip of a cone it does. There is none where both vanish, or where the tangents are parallel. On a crease it
    /// is that of the side with the larger parameters.
    ///
    /// ```
    /// use nurbskin_geometry::DVec3;
    /// use nurbskin_geometry::nurbs::conic;
    /// let sphere = conic::sphere(DVec3::ZERO, 2.0)?;
    /// let pole = sphere.normal(0.3, 1.0).unwrap_or_default();
    /// assert!((pole - DVec3::Z).length() < 1e-14);
    /// # Ok::<(), nurbskin_geometry::Error>(())
    /// ```
    #[must_use]
    pub fn normal(&self, u: f64, v: f64) -> Option<DVec3> {
        let (u, v) = (self.knots_u().wrap(u), self.knots_v().wrap(v));
        let spans = [self.knots_u().span(u), self.knots_v().span(v)];
        let d = self.derivatives_on(spans, u, v);
        self.normal_of(spans, [u, v], &d)
    }

    /// The normal from derivatives that are known.
    pub(super) fn normal_of(
        &self,
        spans: [usize; 2],
        [u, v]: [f64; 2],
        d: &SurfaceDerivatives,
    ) -> Option<DVec3> {
        let noise = self.derivative_noise(spans);
        // Steps from the place into the domain.
        let [inward_u, inward_v] = [(u, self.knots_u()), (v, self.knots_v())]
            .map(|(t, knots)| if t < knots.domain().1 { 1.0 } else { -1.0 });
        let (du, dv, slack) = match (d.du.length() > noise[0], d.dv.length() > noise[1]) {
            (true, true) => (d.du, d.dv, [noise[0], noise[1]]),
            (false, true) => (inward_v * d.duv, d.dv, [noise[2], noise[1]]),
            (true, false) => (d.du, inward_u * d.duv, [noise[0], noise[2]]),
            (false, false) => return None,
        };
        let normal = du.cross(dv);
        let rounding = slack[0] * dv.length() + slack[1] * du.length();
        if normal.length() > rounding {
            normal.try_normalize()
        } else {
            None
        }
    }

    /// What rounding may leave of `S_u`, `S_v` and `S_uv` where they vanish: a derivative is a sum of p + 1 control
    /// points with coefficients up to 2 p / (width of the span), each rounded a few times.
    fn derivative_noise(&self, [span_u, span_v]: [usize; 2]) -> [f64; 3] {
        let [p, q] = self.degree();
        let (mut reach, mut light, mut heavy) = (0.0_f64, f64::INFINITY, 0.0_f64);
        for j in span_v - q..=span_v {
            for i in span_u - p..=span_u {
                reach = reach.max(self.control_points().point(i, j).abs().max_element());
                let weight = self
                    .weights()
                    .map_or(1.0, |w| w[j * self.control_points().count_u() + i]);
                light = light.min(weight);
                heavy = heavy.max(weight);
            }
        }
        let width = |knots: &KnotVector, span: usize| knots.knots()[span + 1] - knots.knots()[span];
        let factor_u = 2.0 * p as f64 / width(self.knots_u(), span_u);
        let factor_v = 2.0 * q as f64 / width(self.knots_v(), span_v);
        let rounding = 8.0 * f64::EPSILON * reach * heavy / light;
        [
            rounding * factor_u,
            rounding * factor_v,
            rounding * factor_u * factor_v,
        ]
    }

    /// Curvatures at (u, v), or `None` where `S_u` and `S_v` do not span a plane, such as at a pole.
    ///
    /// Source: M. P. do Carmo, *Differential Geometry of Curves and Surfaces*, sections 2.5 and 3.2.
    ///
    /// ```
    /// use nurbskin_geometry::DVec3;
    /// use nurbskin_geometry::nurbs::conic;
    /// let torus = conic::torus(DVec3::ZERO, DVec3::Z, 3.0, 1.0)?;
    /// let outside = torus.curvature(0.0, 0.0).map(|c| c.gaussian);
    /// assert!((outside.unwrap_or(0.0) - 1.0 / 4.0).abs() < 1e-14);
    /// # Ok::<(), nurbskin_geometry::Error>(())
    /// ```
    #[must_use]
    pub fn curvature(&self, u: f64, v: f64) -> Option<Curvature> {
        let (u, v) = (self.knots_u().wrap(u), self.knots_v().wrap(v));
        let spans = [self.knots_u().span(u), self.knots_v().span(v)];
        self.curvature_of(spans, &self.derivatives_on(spans, u, v))
    }

    /// The normal of the polynomial piece on the given spans: that of one side of a knot line.
    pub fn normal_on(&self, spans: [usize; 2], [u, v]: [f64; 2]) -> Option<DVec3> {
        self.normal_of(spans, [u, v], &self.derivatives_on(spans, u, v))
    }

    /// The curvatures of the polynomial piece on the given spans.
    pub fn curvature_on(&self, spans: [usize; 2], [u, v]: [f64; 2]) -> Option<Curvature> {
        self.curvature_of(spans, &self.derivatives_on(spans, u, v))
    }

    fn curvature_of(&self, spans: [usize; 2], d: &SurfaceDerivatives) -> Option<Curvature> {
        let noise = self.derivative_noise(spans);
        let (du, dv) = (d.du.length(), d.dv.length());
        let product = d.du.cross(d.dv);
        if product.length() <= noise[0] * dv + noise[1] * du {
            return None;
        }
        let normal = product.try_normalize()?;
        let second = [d.duu, d.duv, d.dvv].map(|second| second.dot(normal));
        let [l, m, n] = second;
        // The shape operator in an orthonormal frame of the tangent plane: S_u = a e1, S_v = b e1 + c e2.
        let e1 = d.du / du;
        let e2 = normal.cross(e1);
        let (a, b, c) = (du, d.dv.dot(e1), d.dv.dot(e2));
        let ratio = b / a;
        let s11 = l / (a * a);
        let s12 = (m - ratio * l) / (a * c);
        let s22 = (n - ratio * (2.0 * m - ratio * l)) / (c * c);
        let mean = f64::midpoint(s11, s22);
        let radius = math::hypot((s11 - s22) / 2.0, s12);
        let (sin, cos) = math::sin_cos(0.5 * math::atan2(2.0 * s12, s11 - s22));
        let direction = cos * e1 + sin * e2;
        Some(Curvature {
            normal,
            first: [d.du.dot(d.du), d.du.dot(d.dv), d.dv.dot(d.dv)],
            second,
            gaussian: s11 * s22 - s12 * s12,
            mean,
            principal: [mean + radius, mean - radius],
            directions: [direction, normal.cross(direction)],
        })
    }

    /// The jumps across the line at parameter t strictly inside the domain of `direction`, from q + 3 places in each
    /// span along it; q is the degree along it.
    ///
    /// # Errors
    /// [`Error::Invalid`] if t is not strictly inside the domain.
    pub fn knot_jumps(&self, direction: Direction, t: f64) -> Result<Jumps> {
        let knots = self.knots(direction);
        let (a, b) = knots.domain();
        if !(t > a && t < b) {
            return Err(Error::invalid(format!(
                "{t} is not a parameter strictly between {a} and {b}"
            )));
        }
        let before = knots.knots().partition_point(|&u| u < t) - 1;
        Ok(self.jumps(direction, [(before, t), (knots.span(t), t)]))
    }

    /// The jumps from the end of the domain of `direction` to its start: how well a closed surface closes.
    #[must_use]
    pub fn seam_jumps(&self, direction: Direction) -> Jumps {
        let knots = self.knots(direction);
        let (a, b) = knots.domain();
        self.jumps(direction, [(knots.span(b), b), (knots.span(a), a)])
    }

    /// The jumps between two (span, parameter).
    fn jumps(&self, direction: Direction, sides: [(usize, f64); 2]) -> Jumps {
        let along = self.knots(direction.other());
        let places = along.degree() + 3;
        let mut jumps = Jumps::default();
        for range in along.breakpoints().windows(2) {
            let span = along.span(range[0]);
            for k in 0..places {
                let s = range[0] + (range[1] - range[0]) * k as f64 / (places - 1) as f64;
                let side = |(across, t): (usize, f64)| match direction {
                    Direction::U => {
                        let d = self.derivatives_on([across, span], t, s);
                        let normal = self.normal_of([across, span], [t, s], &d);
                        (
                            d.point,
                            d.du,
                            d.duu,
                            normal,
                            self.curvature_of([across, span], &d),
                        )
                    }
                    Direction::V => {
                        let d = self.derivatives_on([span, across], s, t);
                        let normal = self.normal_of([span, across], [s, t], &d);
                        (
                            d.point,
                            d.dv,
                            d.dvv,
                            normal,
                            self.curvature_of([span, across], &d),
                        )
                    }
                };
                let (x, y) = (side(sides[0]), side(sides[1]));
                jumps.position = jumps.position.max(x.0.distance(y.0));
                jumps.first = jumps.first.max(x.1.distance(y.1));
                jumps.second = jumps.second.max(x.2.distance(y.2));
                if let (Some(x), Some(y)) = (x.3, y.3) {
                    let angle = math::angle_between(x, y);
                    jumps.normal_angle = jumps.normal_angle.max(angle);
                }
                if let (Some(x), Some(y)) = (x.4, y.4) {
                    jumps.curvature = jumps.curvature.max(2.0 * (x.mean - y.mean).abs());
                }
            }
        }
        jumps
    }

    /// Lengths of the surface along u and v: the longest of five lines each, to about a percent.
    #[must_use]
    pub fn iso_lengths(&self) -> [f64; 2] {
        const STEPS: usize = 32;
        let [(a, b), (c, d)] = self.domain();
        let at = |a: f64, b: f64, i: usize| a + (b - a) * i as f64 / STEPS as f64;
        let mut length = [0.0f64; 2];
        for k in [0, STEPS / 4, STEPS / 2, 3 * STEPS / 4, STEPS] {
            let along = |point: &dyn Fn(usize) -> DVec3| -> f64 {
                (0..STEPS).map(|i| point(i).distance(point(i + 1))).sum()
            };
            length[0] = length[0].max(along(&|i| self.point(at(a, b, i), at(c, d, k))));
            length[1] = length[1].max(along(&|i| self.point(at(a, b, k), at(c, d, i))));
        }
        length
    }

    /// The boundary curve at this edge; it runs along the other direction.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the weights underflow.
    pub fn edge_curve(&self, edge: Edge) -> Result<NurbsCurve> {
        let (a, b) = self.knots(edge.direction()).domain();
        let t = match edge {
            Edge::UMin | Edge::VMin => a,
            Edge::UMax | Edge::VMax => b,
        };
        self.iso_curve(edge.direction(), t)
    }

    /// Whether the two edges at the ends of `direction` coincide at equal parameters within `tolerance`. The distance
    /// of their control points decides, which bounds that of the edges. A periodic direction is closed.
    #[must_use]
    pub fn is_closed(&self, direction: Direction, tolerance: f64) -> bool {
        let [low, high] = match direction {
            Direction::U => [Edge::UMin, Edge::UMax],
            Direction::V => [Edge::VMin, Edge::VMax],
        };
        if self.knots(direction).is_periodic() {
            return true;
        }
        match (self.edge_curve(low), self.edge_curve(high)) {
            (Ok(low), Ok(high)) => distance_bound(&low, &high) <= tolerance,
            _ => false,
        }
    }

    /// Number of control points along `direction`, those that wrap around counted once: a clamped direction of degree p that
    /// closes with p - 1 continuous derivatives is a periodic one, whose first p control points follow its last ones.
    ///
    /// Both ends are within `tolerance` then, and the derivatives agree to six digits.
    #[must_use]
    pub fn count_around(&self, direction: Direction, tolerance: f64) -> usize {
        let knots = self.knots(direction);
        let (p, count) = (knots.degree(), knots.distinct_count());
        if knots.is_periodic() || count <= 2 * p || !self.is_closed(direction, tolerance) {
            return count;
        }
        let (a, b) = knots.domain();
        let width = p + 1;
        let ends = [a, b].map(|t| {
            let span = knots.span(t);
            let mut basis = vec![0.0; width * width];
            basis_derivatives(knots, span, t, p, &mut basis);
            (span - p, basis)
        });
        let [m, n] = self.control_points().counts();
        let across = match direction {
            Direction::U => n,
            Direction::V => m,
        };
        let homogeneous = |k: usize, across: usize| {
            let (i, j) = match direction {
                Direction::U => (k, across),
                Direction::V => (across, k),
            };
            self.homogeneous(i, j)
        };
        let smooth = (1..p).all(|order| {
            let (mut most, mut jump) = (0.0_f64, 0.0_f64);
            for line in 0..across {
                let [low, high] = ends.each_ref().map(|(first, basis)| {
                    let terms = basis[order * width..].iter().take(width).enumerate();
                    terms.fold(DVec4::ZERO, |sum, (k, b)| {
                        sum + homogeneous(first + k, line) * *b
                    })
                });
                most = most.max(low.length()).max(high.length());
                jump = jump.max((high - low).length());
            }
            jump <= SEAMLESS * most
        });
        if smooth { count - p } else { count }
    }

    /// Whether this edge is a single point: its control points lie within `tolerance` of the middle of their box. A
    /// periodic direction has no edges.
    #[must_use]
    pub fn is_pole(&self, edge: Edge, tolerance: f64) -> bool {
        if self.knots(edge.direction()).is_periodic() {
            return false;
        }
        let Ok(curve) = self.edge_curve(edge) else {
            return false;
        };
        let points = curve.control_points();
        let [low, high] = crate::point_grid::bounding_box(points);
        let middle = (low + high) / 2.0;
        points.iter().all(|p| p.distance(middle) <= tolerance)
    }
}

/// No two points at equal parameters of these curves over the same knots are further apart than this.
///
/// With A = w C and the weights scaled to agree at the start, `C - D = (A - B - (D - c)(w - x) - c (w - x)) / w`.
fn distance_bound(one: &NurbsCurve, other: &NurbsCurve) -> f64 {
    let [low, high] = crate::point_grid::bounding_box(other.control_points());
    let centre = (low + high) / 2.0;
    let reach = other.control_points().iter().map(|p| p.distance(centre));
    let radius = reach.fold(0.0, f64::max);
    let scale = one.homogeneous(0).w / other.homogeneous(0).w;
    let (mut error, mut weight) = (0.0_f64, f64::INFINITY);
    for i in 0..one.control_points().len() {
        let a = one.homogeneous(i);
        let difference: DVec4 = a - scale * other.homogeneous(i);
        let f = difference.w;
        error = error.max((difference.truncate() - centre * f).length() + radius * f.abs());
        weight = weight.min(a.w);
    }
    error / weight
}

//! The surface that a simulated scan was taken from.

use super::ellipsoid::closest_on_ellipsoid;
use super::shapes::{ELLIPSOID, PLANE, SPHERE, Shape, TORUS};
use glam::{DVec2, DVec3};
use nurbskin_geometry::nurbs::SurfaceDerivatives;
use std::sync::OnceLock;

/// Part of v that a longitudinal opening leaves out.
const OPENING: f64 = 0.04;
/// Cells along each parameter in which the closest point is searched.
const CELLS: usize = 64;

/// A [`Shape`], whole or with a longitudinal opening: points, normals and exact distance.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_scan::simulate::{Shape, TrueSurface};
/// let sphere = TrueSurface::new(Shape::Sphere);
/// let point = sphere.point(0.3, 0.7) + 2.0 * sphere.normal(0.3, 0.7);
/// assert!((sphere.signed_distance(point) - 2.0).abs() < 1e-12);
/// ```
#[derive(Clone, Debug)]
pub struct TrueSurface {
    shape: Shape,
    end_v: f64,
    cells: OnceLock<Vec<Cell>>,
}

/// A ball around one cell of the parameter domain.
#[derive(Clone, Copy, Debug)]
struct Cell {
    parameters: DVec2,
    centre: DVec3,
    radius: f64,
}

/// A foot point: the closest point of the surface and the outward normal there.
struct Foot {
    point: DVec3,
    normal: DVec3,
}

impl TrueSurface {
    /// The whole shape.
    #[must_use]
    pub fn new(shape: Shape) -> Self {
        Self {
            shape,
            end_v: 1.0,
            cells: OnceLock::new(),
        }
    }

    /// The shape with a longitudinal opening: v ends at 0.96 and is no longer closed, as the paper's handle. Only
    /// tubes have one; other shapes are returned whole.
    #[must_use]
    pub fn opened(shape: Shape) -> Self {
        let end_v = if shape.is_tube() { 1.0 - OPENING } else { 1.0 };
        Self {
            end_v,
            ..Self::new(shape)
        }
    }

    /// The shape.
    #[must_use]
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// Whether u and v are closed; a tube with an opening is not.
    #[must_use]
    pub fn closed(&self) -> [bool; 2] {
        if self.end_v < 1.0 {
            [false, false]
        } else {
            self.shape.closed()
        }
    }

    /// The point at (u, v), both in [0, 1].
    #[must_use]
    pub fn point(&self, u: f64, v: f64) -> DVec3 {
        self.derivatives(u, v).point
    }

    /// Point and partial derivatives to second order at (u, v), both in [0, 1].
    #[must_use]
    pub fn derivatives(&self, u: f64, v: f64) -> SurfaceDerivatives {
        let d = self.shape.derivatives(u, v * self.end_v);
        SurfaceDerivatives {
            dv: d.dv * self.end_v,
            duv: d.duv * self.end_v,
            dvv: d.dvv * self.end_v * self.end_v,
            ..d
        }
    }

    /// The outward unit normal at (u, v) (upward for sheets); poles included.
    #[must_use]
    pub fn normal(&self, u: f64, v: f64) -> DVec3 {
        let d = self.derivatives(u, v);
        self.normal_from(&d)
    }

    fn normal_from(&self, d: &SurfaceDerivatives) -> DVec3 {
        match self.shape {
            // The gradient of the implicit form has no trouble at the poles.
            Shape::Sphere => (d.point - self.shape.origin()).normalize_or(DVec3::Z),
            Shape::Ellipsoid => {
                ((d.point - self.shape.origin()) / (ELLIPSOID * ELLIPSOID)).normalize_or(DVec3::Z)
            }
            _ => d.du.cross(d.dv).normalize_or(DVec3::Z),
        }
    }

    /// Mean lengths of the lines along u and along v.
    #[must_use]
    pub fn size(&self) -> [f64; 2] {
        const LINES: usize = 24;
        const STEPS: usize = 96;
        let mean = |at: &dyn Fn(f64, f64) -> DVec3| {
            let line = |l: usize| {
                let fixed = (l as f64 + 0.5) / LINES as f64;
                let step = |k: usize| at(k as f64 / STEPS as f64, fixed);
                (0..STEPS)
                    .map(|k| step(k).distance(step(k + 1)))
                    .sum::<f64>()
            };
            (0..LINES).map(line).sum::<f64>() / LINES as f64
        };
        [
            mean(&|t, fixed| self.point(t, fixed)),
            mean(&|t, fixed| self.point(fixed, t)),
        ]
    }

    /// Distance from `point` to the surface, not negative. Exact to rounding for sphere, torus, plane and ellipsoid;
    /// for the others a search over all cells of the domain that could hold a closer point, each with Newton's
    /// method, to 1e-10 of the shape. About 10 us near the surface; more where many places are equally far.
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        point.distance(self.closest_point(point))
    }

    /// The closest point of the surface; see [`distance`](Self::distance). One of them where there are several.
    #[must_use]
    pub fn closest_point(&self, point: DVec3) -> DVec3 {
        self.foot(point).point
    }

    /// Distance with a sign: positive on the side of the outward normal.
    #[must_use]
    pub fn signed_distance(&self, point: DVec3) -> f64 {
        let foot = self.foot(point);
        let offset = point - foot.point;
        offset.length().copysign(offset.dot(foot.normal))
    }

    fn foot(&self, point: DVec3) -> Foot {
        let origin = self.shape.origin();
        let p = point - origin;
        match self.shape {
            Shape::Sphere => {
                let normal = p.normalize_or(DVec3::X);
                Foot {
                    point: origin + SPHERE * normal,
                    normal,
                }
            }
            Shape::Ellipsoid => {
                let foot = closest_on_ellipsoid(ELLIPSOID, p);
                Foot {
                    point: origin + foot,
                    normal: (foot / (ELLIPSOID * ELLIPSOID)).normalize_or(DVec3::X),
                }
            }
            Shape::Torus => {
                let outward = DVec3::new(p.x, p.y, 0.0).normalize_or(DVec3::X);
                let centre = TORUS[0] * outward;
                let normal = (p - centre).normalize_or(outward);
                Foot {
                    point: origin + centre + TORUS[1] * normal,
                    normal,
                }
            }
            Shape::Plane => {
                let half = DVec3::new(0.5 * PLANE[0], 0.5 * PLANE[1], 0.0);
                Foot {
                    point: origin + p.clamp(-half, half),
                    normal: DVec3::Z,
                }
            }
            _ => {
                let parameters = self.search(point);
                let d = self.derivatives(parameters.x, parameters.y);
                Foot {
                    point: d.point,
                    normal: self.normal_from(&d),
                }
            }
        }
    }

    /// Parameters of the closest point, over all cells whose ball reaches nearer than the best found.
    fn search(&self, point: DVec3) -> DVec2 {
        let cells = self.cells.get_or_init(|| self.cells());
        let mut bound = f64::INFINITY;
        for cell in cells {
            bound = bound.min(point.distance_squared(cell.centre));
        }
        let bound = bound.sqrt();
        let mut near: Vec<(f64, &Cell)> = cells
            .iter()
            .map(|cell| (point.distance(cell.centre) - cell.radius, cell))
            .filter(|(least, _)| *least <= bound)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut best = (f64::INFINITY, DVec2::ZERO);
        for (least, cell) in near {
            if least > best.0 {
                break;
            }
            let parameters = self.refine(point, cell.parameters);
            let distance = self.point(parameters.x, parameters.y).distance(point);
            if distance < best.0 {
                best = (distance, parameters);
            }
        }
        best.1
    }

    fn cells(&self) -> Vec<Cell> {
        let size = 1.0 / CELLS as f64;
        (0..CELLS * CELLS)
            .map(|k| {
                let corner = DVec2::new((k % CELLS) as f64, (k / CELLS) as f64) * size;
                let parameters = corner + 0.5 * size;
                let centre = self.point(parameters.x, parameters.y);
                let mut radius = 0.0_f64;
                for s in 0..25_u8 {
                    let at =
                        corner + DVec2::new(f64::from(s % 5), f64::from(s / 5)) * (0.25 * size);
                    radius = radius.max(centre.distance(self.point(at.x, at.y)));
                }
                // The farthest point of a cell is a corner or close to one: 5 % covers what 25 samples miss.
                Cell {
                    parameters,
                    centre,
                    radius: 1.05 * radius,
                }
            })
            .collect()
    }

    /// Newton's method for the foot point from `start`, held inside the domain, never uphill.
    fn refine(&self, point: DVec3, start: DVec2) -> DVec2 {
        let closed = self.closed();
        let mut at = start;
        let mut d = self.derivatives(at.x, at.y);
        for _ in 0..60 {
            let r = d.point - point;
            let gradient = DVec2::new(r.dot(d.du), r.dot(d.dv));
            // 1. A parameter at its end stays there while the surface beyond would be nearer.
            let held = |k: usize| {
                !closed[k]
                    && ((at[k] <= 0.0 && gradient[k] >= 0.0)
                        || (at[k] >= 1.0 && gradient[k] <= 0.0))
            };
            let held = [held(0), held(1)];
            // 2. Newton's step where the Hessian is positive definite, else Gauss-Newton's.
            let (a, b, c) = (d.du.dot(d.du), d.du.dot(d.dv), d.dv.dot(d.dv));
            let full = (a + r.dot(d.duu), b + r.dot(d.duv), c + r.dot(d.dvv));
            let step = solve(full, gradient, held)
                .or_else(|| solve((a, b, c), gradient, held))
                .unwrap_or(DVec2::ZERO);
            // 3. Halve it until the distance does not grow.
            let now = r.length_squared();
            let mut factor = 1.0;
            let mut moved = false;
            for _ in 0..40 {
                let mut next = at - factor * step;
                for k in 0..2 {
                    next[k] = if closed[k] {
                        next[k].rem_euclid(1.0)
                    } else {
                        next[k].clamp(0.0, 1.0)
                    };
                }
                let e = self.derivatives(next.x, next.y);
                if e.point.distance_squared(point) < now {
                    (at, d, moved) = (next, e, true);
                    break;
                }
                factor *= 0.5;
                if factor * step.length() < 1e-15 {
                    break;
                }
            }
            if !moved {
                break;
            }
        }
        at
    }
}

/// Solves the 2 x 2 system with the matrix (a b; b c), leaving out the parameters held; `None` unless what is left is
/// positive definite.
fn solve((a, b, c): (f64, f64, f64), gradient: DVec2, held: [bool; 2]) -> Option<DVec2> {
    match held {
        [true, true] => Some(DVec2::ZERO),
        [false, true] => (a > 0.0).then(|| DVec2::new(gradient.x / a, 0.0)),
        [true, false] => (c > 0.0).then(|| DVec2::new(0.0, gradient.y / c)),
        [false, false] => {
            let determinant = a * c - b * b;
            (a > 0.0 && determinant > 1e-12 * a * c).then(|| {
                DVec2::new(
                    c * gradient.x - b * gradient.y,
                    a * gradient.y - b * gradient.x,
                ) / determinant
            })
        }
    }
}

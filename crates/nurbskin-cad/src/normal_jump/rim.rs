//! A face along a straight p-curve: the rim and the derivative across it, in Bezier pieces.

use crate::model::{EdgeUse, Face};
use glam::DVec3;
use nurbskin_geometry::nurbs::bezier::curve_pieces;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve, NurbsSurface};

/// How far a p-curve may be from an even straight line of constant u or v, as a share of the domain. Guard: far above
/// the rounding of readers, and a millionth of a knot span.
const STRAIGHT: f64 = 1e-9;
/// Breakpoints of two faces that are nearer, as a share of the edge's parameters, are one.
const SAME: f64 = 1e-10;

/// A piece of a rim: Bezier control points of the rim, less its first point, and of the derivative across it,
/// whose sign makes `tangent x across` the outward normal.
#[derive(Clone, Debug)]
pub(super) struct Strip {
    pub(super) rim: Vec<DVec3>,
    pub(super) across: Vec<DVec3>,
}

/// The pieces of a rim with their ranges, as shares of the edge's parameters from 0 to 1.
pub(super) type Pieces = Vec<([f64; 2], Strip)>;

/// The face along the p-curve of a use. `None` where the surface is rational or the p-curve not an even straight line of
/// constant u or v.
pub(super) fn strip(face: &Face, used: &EdgeUse, domain: (f64, f64)) -> Option<Pieces> {
    let surface = &face.surface;
    if surface.is_rational() {
        return None;
    }
    let [from, to] = even_line(surface, used, domain)?;
    // 0: the line has constant u, and runs along v.
    let axis = usize::from((to[0] - from[0]).abs() > (to[1] - from[1]).abs());
    let direction = [Direction::U, Direction::V][axis];
    let sense = (to[1 - axis] - from[1 - axis]).signum();
    // The face is to the left of its loop: at smaller u where that runs up, at larger v where it runs to the right.
    let onward = sense * if used.reversed { -1.0 } else { 1.0 };
    let beyond = (axis == 1) == (onward > 0.0);
    let lines = Lines::new(surface, direction, from[axis], beyond)?;
    // S_u x S_v is tangent x (sense S_v) along u, and tangent x (-sense S_u) along v.
    let side = sense * if axis == 1 { 1.0 } else { -1.0 } * if face.reversed { -1.0 } else { 1.0 };
    let origin = lines.rim.first().copied()?;
    let rim: Vec<DVec3> = lines.rim.iter().map(|&p| p - origin).collect();
    let across: Vec<DVec3> = lines.across.iter().map(|&x| side * x).collect();
    let pieces = |points: Vec<DVec3>| {
        let curve = NurbsCurve::new(lines.knots.clone(), points, None).ok()?;
        curve_pieces(&curve).ok()
    };
    let (start, width) = (from[1 - axis], to[1 - axis] - from[1 - axis]);
    let mut found: Pieces = Vec::new();
    for (rim, across) in pieces(rim)?.into_iter().zip(pieces(across)?) {
        let mut range = [rim.range.0, rim.range.1].map(|s| (s - start) / width);
        let [mut rim, mut across] =
            [rim, across].map(|c| c.points.iter().map(|h| h.truncate()).collect::<Vec<_>>());
        if width < 0.0 {
            range.reverse();
            rim.reverse();
            across.reverse();
        }
        found.push((range, Strip { rim, across }));
    }
    if width < 0.0 {
        found.reverse();
    }
    Some(found)
}

/// Both ends of a p-curve, if it is straight, even and of constant u or v.
fn even_line(surface: &NurbsSurface, used: &EdgeUse, (a, b): (f64, f64)) -> Option<[[f64; 2]; 2]> {
    let pcurve = &used.pcurve;
    if pcurve.weights().is_some() {
        return None;
    }
    let points = pcurve.control_points();
    let ends = [points.first()?, points.last()?].map(|p| p.truncate());
    let widths = surface.domain().map(|(low, high)| high - low);
    let near = |x: f64, y: f64, k: usize| (x - y).abs() <= STRAIGHT * widths[k];
    let [from, to] = ends.map(|p| p.to_array());
    let constant = [0, 1].map(|k| near(from[k], to[k], k));
    if constant[0] == constant[1] {
        return None;
    }
    let even = pcurve
        .knots()
        .greville()
        .into_iter()
        .zip(points)
        .all(|(t, p)| {
            let on = ends[0].lerp(ends[1], (t - a) / (b - a));
            near(on.x, p.x, 0) && near(on.y, p.y, 1)
        });
    even.then_some([from, to])
}

/// Control points of an isoparametric line and of the derivative across it, over the knots along it.
struct Lines {
    knots: KnotVector,
    rim: Vec<DVec3>,
    across: Vec<DVec3>,
}

impl Lines {
    /// The line at parameter t of a direction; the derivative is that of the part of the surface beyond the line, or
    /// before it.
    fn new(surface: &NurbsSurface, direction: Direction, t: f64, beyond: bool) -> Option<Self> {
        let (a, b) = surface.knots(direction).domain();
        let near = STRAIGHT * (b - a);
        let (part, low) = if t <= a + near {
            (surface.clone(), true)
        } else if t >= b - near {
            (surface.clone(), false)
        } else if beyond {
            (surface.segment(direction, t, b).ok()?, true)
        } else {
            (surface.segment(direction, a, t).ok()?, false)
        };
        let knots = part.knots(direction);
        if !knots.is_clamped() || knots.is_periodic() {
            return None;
        }
        let (p, n) = (knots.degree(), knots.control_point_count());
        // First and last control points of the derivative, *The NURBS Book*, sections 3.3 and 3.5.
        let (rim, next, width) = if low {
            (0, [0, 1], knots.knots()[p + 1] - knots.knots()[1])
        } else {
            let width = knots.knots()[n + p - 1] - knots.knots()[n - 1];
            (n - 1, [n - 2, n - 1], width)
        };
        let net = part.control_points();
        let line = |k: usize| -> Vec<DVec3> {
            match direction {
                Direction::U => net.column(k).collect(),
                Direction::V => net.row(k).to_vec(),
            }
        };
        let [before, after] = next.map(line);
        let pairs = before.iter().zip(&after);
        Some(Self {
            knots: part.knots(direction.other()).clone(),
            rim: line(rim),
            across: pairs.map(|(x, y)| (*y - *x) * (p as f64 / width)).collect(),
        })
    }
}

/// The parts that the pieces of two rims have in common, from 0 to 1.
pub(super) fn common(one: &Pieces, two: &Pieces) -> Vec<([f64; 2], [Strip; 2])> {
    let mut found = Vec::new();
    let (mut i, mut j, mut low) = (0, 0, 0.0);
    while let (Some((x, first)), Some((y, second))) = (one.get(i), two.get(j)) {
        let high = x[1].min(y[1]).min(1.0);
        if high - low > SAME {
            let pair = [cut(first, *x, [low, high]), cut(second, *y, [low, high])];
            found.push(([low, high], pair));
            low = high;
        }
        i += usize::from(x[1] <= high + SAME);
        j += usize::from(y[1] <= high + SAME);
        if high >= 1.0 {
            break;
        }
    }
    found
}

/// The part of a piece over `part` of its `range`.
fn cut(strip: &Strip, range: [f64; 2], part: [f64; 2]) -> Strip {
    let local = |t: f64| {
        let s = (t - range[0]) / (range[1] - range[0]);
        let near = SAME / (range[1] - range[0]);
        if s <= near {
            0.0
        } else if s >= 1.0 - near {
            1.0
        } else {
            s
        }
    };
    let [a, b] = part.map(local);
    let cut = |points: &[DVec3]| {
        let mut points = points.to_vec();
        if b < 1.0 {
            points = split(&points, b)[0].clone();
        }
        if a > 0.0 {
            points = split(&points, a / b)[1].clone();
        }
        points
    };
    Strip {
        rim: cut(&strip.rim),
        across: cut(&strip.across),
    }
}

/// The two parts of a Bezier curve before and after s.
fn split(points: &[DVec3], s: f64) -> [Vec<DVec3>; 2] {
    let mut high = points.to_vec();
    let mut low = Vec::with_capacity(high.len());
    for last in (0..high.len()).rev() {
        low.push(high[0]);
        for k in 0..last {
            high[k] = high[k].lerp(high[k + 1], s);
        }
    }
    [low, high]
}

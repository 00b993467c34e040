//! The point of some curves that is closest to a given point, with a certified lower bound.
//!
//! A Bezier piece is no further from its chord than its control points are, so that the distance to the chord less
//! theirs is a lower bound. Pieces are halved until it is close enough to the best distance found, by Newton's method,
//! or excludes them; halving makes the bound better by four.

use crate::Result;
use crate::nurbs::bezier::{BezierCurve, curve_pieces};
use crate::nurbs::{MAX_DEGREE, NurbsCurve};
use crate::spatial::hierarchy;
use crate::spatial::hierarchy::{Node, limit};
use glam::{DVec3, DVec4};

/// Most bisections of a piece.
const MOST_CUTS: u32 = 60;
/// At these numbers of bisections, Newton's method starts anew.
const POLISHED: [u32; 3] = [0, 4, 10];

/// Curves cut into pieces under a hierarchy of boxes.
#[derive(Clone, Debug)]
pub(super) struct Curves {
    pieces: Vec<(usize, BezierCurve)>,
    nodes: Vec<Node>,
}

/// The best place on the curves so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct OnCurve {
    pub(super) curve: usize,
    pub(super) parameter: f64,
    /// Relative to the centre.
    pub(super) point: DVec3,
}

/// What a search for the nearest place knows.
#[derive(Clone, Copy, Debug)]
pub(super) struct CurveSearch {
    pub(super) point: DVec3,
    /// Squared distance of the best place.
    pub(super) best: f64,
    pub(super) found: Option<OnCurve>,
    /// What was dropped is at least this far, squared, or farther than the best.
    pub(super) proven: f64,
    pub(super) tolerance: f64,
    /// For the rounding of boxes.
    pub(super) slack: f64,
}

/// Memory of a search, kept.
#[derive(Debug, Default)]
pub(super) struct Parts {
    stack: Vec<(f64, f64, u32)>,
    nets: Vec<DVec4>,
    net: Vec<DVec4>,
}

impl Curves {
    pub(super) fn new(curves: &[NurbsCurve], centre: DVec3) -> Result<Self> {
        let mut pieces = Vec::new();
        for (k, curve) in curves.iter().enumerate() {
            let moved = curve.map_points(|p| p - centre)?;
            pieces.extend(curve_pieces(&moved)?.into_iter().map(|piece| (k, piece)));
        }
        let boxes: Vec<[DVec3; 2]> = pieces
            .iter()
            .map(|(_, piece)| super::interval::hull(piece.points.iter().map(project)))
            .collect();
        Ok(Self {
            nodes: hierarchy::build(&boxes),
            pieces,
        })
    }

    /// Looks for a place nearer than the best so far.
    pub(super) fn search(&self, search: &mut CurveSearch, parts: &mut Parts) {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the limit has slack for this rounding"
        )]
        let point = search.point.to_array().map(|x| x as f32);
        let first = limit(search.best, search.slack);
        hierarchy::visit_near(&self.nodes, point, first, |piece| {
            if let Some((curve, piece)) = self.pieces.get(piece) {
                search.visit(*curve, piece, parts);
            }
            limit(search.best, search.slack)
        });
    }
}

fn project(h: &DVec4) -> DVec3 {
    h.truncate() / h.w
}

impl CurveSearch {
    fn visit(&mut self, curve: usize, piece: &BezierCurve, parts: &mut Parts) {
        let count = piece.points.len();
        parts.stack.clear();
        parts.nets.clear();
        parts.stack.push((0.0, 1.0, 0));
        parts.nets.extend_from_slice(&piece.points);
        while let Some((a, b, cuts)) = parts.stack.pop() {
            let from = parts.nets.len() - count;
            parts.net.clear();
            parts.net.extend_from_slice(&parts.nets[from..]);
            parts.nets.truncate(from);
            let (share, lower) = self.bound(&parts.net);
            if lower * lower >= self.best {
                continue;
            }
            if POLISHED.contains(&cuts) {
                let place = self.descend(piece, a + share * (b - a), [a, b]);
                self.offer(curve, piece, place);
            }
            let ends = [(a, parts.net.first()), (b, parts.net.last())];
            for (s, end) in ends {
                if end.is_some_and(|h| project(h).distance_squared(self.point) < self.best) {
                    self.offer(curve, piece, s);
                }
            }
            if lower >= self.best.sqrt() - self.tolerance || cuts >= MOST_CUTS {
                self.proven = self.proven.min(lower * lower);
                continue;
            }
            let middle = f64::midpoint(a, b);
            // The half that holds the foot of the chord is examined first, from the end of the stack.
            let halves = [(a, middle, cuts + 1), (middle, b, cuts + 1)];
            let start = parts.nets.len();
            parts.nets.extend_from_slice(&parts.net);
            parts.nets.extend_from_slice(&parts.net);
            let (low, high) = parts.nets[start..].split_at_mut(count);
            halve(low, high);
            if share < 0.5 {
                low.swap_with_slice(high);
                parts.stack.extend([halves[1], halves[0]]);
            } else {
                parts.stack.extend(halves);
            }
        }
    }

    /// The share of the chord at its nearest point, and a lower bound of the distance to the piece.
    fn bound(&self, net: &[DVec4]) -> (f64, f64) {
        let (Some(first), Some(last)) = (net.first(), net.last()) else {
            return (0.0, f64::INFINITY);
        };
        let (a, b) = (project(first), project(last));
        let (share, distance) = to_chord(self.point, a, b);
        let inner = net.get(1..net.len() - 1).unwrap_or_default();
        let bend = inner
            .iter()
            .fold(0.0_f64, |bend, h| bend.max(to_chord(project(h), a, b).1));
        let rounding = 4.0 * f64::EPSILON * (a.abs() + b.abs() + self.point.abs()).max_element();
        (share, (distance - bend - rounding).max(0.0))
    }

    fn offer(&mut self, curve: usize, piece: &BezierCurve, s: f64) {
        let point = piece.point(s);
        let squared = point.distance_squared(self.point);
        if squared < self.best {
            self.best = squared;
            let (a, b) = piece.range;
            self.found = Some(OnCurve {
                curve,
                parameter: if s >= 1.0 { b } else { a + s * (b - a) },
                point,
            });
        }
    }

    /// Newton's method for a local minimum of the distance within [a, b].
    fn descend(&self, piece: &BezierCurve, start: f64, [a, b]: [f64; 2]) -> f64 {
        let mut s = start;
        let mut last = f64::INFINITY;
        for _ in 0..12 {
            let [point, first, second] = derivatives(&piece.points, s);
            let e = point - self.point;
            let squared = e.length_squared();
            if squared >= last {
                break;
            }
            last = squared;
            let (gradient, square) = (e.dot(first), first.length_squared());
            let convex = square + e.dot(second);
            let slope = if convex > 0.0 { convex } else { square };
            if slope <= 0.0 {
                break;
            }
            let next = (s - gradient / slope).clamp(a, b);
            if (next - s).abs() <= 1e-16 {
                break;
            }
            s = next;
        }
        s
    }
}

/// The share (0..=1) of the way from a to b at its point nearest to p, and its distance.
fn to_chord(p: DVec3, a: DVec3, b: DVec3) -> (f64, f64) {
    let (way, to) = (b - a, p - a);
    let square = way.length_squared();
    let share = if square > 0.0 {
        (to.dot(way) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (share, (to - share * way).length())
}

/// De Casteljau at 1/2: `low` (a copy of `high`) becomes the first half, `high` the second.
fn halve(low: &mut [DVec4], high: &mut [DVec4]) {
    for (level, low) in low.iter_mut().enumerate().skip(1) {
        for k in 0..high.len() - level {
            high[k] = 0.5 * (high[k] + high[k + 1]);
        }
        *low = high[0];
    }
}

/// The point of a rational Bezier curve and its first two derivatives, by de Casteljau's algorithm.
///
/// Source: *The NURBS Book*, 2nd ed., section 4.3, equation 4.8.
fn derivatives(points: &[DVec4], s: f64) -> [DVec3; 3] {
    let mut work = [DVec4::ZERO; MAX_DEGREE + 1];
    let count = points.len().min(work.len());
    work[..count].copy_from_slice(&points[..count]);
    let p = count.saturating_sub(1) as f64;
    let (mut first, mut second) = (DVec4::ZERO, DVec4::ZERO);
    for last in (1..count).rev() {
        if last == 2 {
            second = p * (p - 1.0) * (work[2] - 2.0 * work[1] + work[0]);
        }
        if last == 1 {
            first = p * (work[1] - work[0]);
        }
        for k in 0..last {
            work[k] = (1.0 - s) * work[k] + s * work[k + 1];
        }
    }
    let w = work[0].w;
    let point = work[0].truncate() / w;
    let d = (first.truncate() - first.w * point) / w;
    let dd = (second.truncate() - 2.0 * first.w * d - second.w * point) / w;
    [point, d, dd]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nurbs::{KnotVector, conic};
    use std::f64::consts::TAU;

    fn nearest(curves: &Curves, point: DVec3) -> CurveSearch {
        let mut search = CurveSearch {
            point,
            best: f64::INFINITY,
            found: None,
            proven: f64::INFINITY,
            tolerance: 1e-11,
            slack: 1e-5,
        };
        curves.search(&mut search, &mut Parts::default());
        search
    }

    #[test]
    fn distances_to_a_circle_are_exact() {
        let circle = conic::arc(DVec3::ZERO, 2.0 * DVec3::X, 2.0 * DVec3::Y, 0.0, TAU).unwrap();
        let curves = Curves::new(&[circle], DVec3::ZERO).unwrap();
        for k in 0..200 {
            let k = f64::from(k);
            let p = 3.0 * DVec3::new((1.3 * k).sin(), (2.1 * k).cos(), (0.7 * k).sin());
            let expected = (p.truncate().length() - 2.0).hypot(p.z);
            let found = nearest(&curves, p);
            let (upper, lower) = (found.best.sqrt(), found.proven.min(found.best).sqrt());
            assert!((upper - expected).abs() < 1e-13, "{upper} {expected}");
            assert!(lower <= expected + 1e-13 && upper - lower < 2e-11);
        }
        // From the axis all points are equally far: bounded work, one answer.
        assert!((nearest(&curves, 3.0 * DVec3::Z).best - 13.0).abs() < 1e-12);
    }

    #[test]
    fn the_nearest_of_several_curves_is_found_anywhere() {
        let wave = |z: f64| {
            let points = (0..12).map(|i| {
                let x = f64::from(i);
                DVec3::new(x, (1.7 * x + z).sin() * 2.0, z)
            });
            NurbsCurve::new(KnotVector::uniform(3, 12).unwrap(), points.collect(), None).unwrap()
        };
        let all = [wave(0.0), wave(1.0), wave(2.5)];
        let curves = Curves::new(&all, DVec3::ZERO).unwrap();
        for k in 0..100 {
            let k = f64::from(k);
            let p = DVec3::new(
                6.0 + 6.0 * k.sin(),
                3.0 * (1.9 * k).cos(),
                3.0 * (0.3 * k).sin(),
            );
            let samples = all
                .iter()
                .flat_map(|c| (0..=4000).map(|i| c.point(f64::from(i) / 4000.0).distance(p)));
            let brute = samples.fold(f64::INFINITY, f64::min);
            let found = nearest(&curves, p);
            let upper = found.best.sqrt();
            assert!(upper <= brute + 1e-12 && upper > brute - 1e-4);
            assert!(found.proven.min(found.best).sqrt() <= upper);
            let on = found.found.unwrap();
            assert!(all[on.curve].point(on.parameter).distance(on.point) < 1e-12);
        }
    }
}

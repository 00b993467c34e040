//! A loop as a chain of Bezier pieces under a tree.

use super::{LoopPoint, end_of, place_of, start_of};
use crate::pcurve::planar::{place_and_velocity, rule};
use glam::DVec2;
use nurbskin_geometry::nurbs::bezier::BezierCurve;
use std::sync::LazyLock;

/// Splits of a piece end here at the latest: then its parts are as short as rounding.
const DEPTH: usize = 60;

/// A Bezier piece of a loop, in the sense of the loop.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    pub(crate) curve: BezierCurve,
    pub(crate) use_index: usize,
}

/// Pieces that follow each other: its own, or those of its two children.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec2,
    high: DVec2,
    start: DVec2,
    end: DVec2,
    /// Index of the piece, or of the second child; the first child follows its parent.
    next: usize,
    leaf: bool,
}

/// A closed chain of pieces.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pieces: Vec<Piece>,
    nodes: Vec<Node>,
}

impl Chain {
    /// From at least one piece.
    pub(super) fn new(pieces: Vec<Piece>) -> Self {
        let mut chain = Self {
            nodes: Vec::with_capacity(2 * pieces.len()),
            pieces,
        };
        chain.build(0, chain.pieces.len());
        chain
    }

    fn build(&mut self, from: usize, to: usize) {
        let at = self.nodes.len();
        if to - from <= 1 {
            let curve = &self.pieces[from].curve;
            let [low, high] = hull(curve);
            let (start, end) = (start_of(curve), end_of(curve));
            self.nodes.push(Node {
                low,
                high,
                start,
                end,
                next: from,
                leaf: true,
            });
            return;
        }
        let middle = usize::midpoint(from, to);
        let empty = Node {
            low: DVec2::ZERO,
            high: DVec2::ZERO,
            start: DVec2::ZERO,
            end: DVec2::ZERO,
            next: 0,
            leaf: false,
        };
        self.nodes.push(empty);
        self.build(from, middle);
        let next = self.nodes.len();
        self.build(middle, to);
        let (one, two) = (self.nodes[at + 1], self.nodes[next]);
        self.nodes[at] = Node {
            low: one.low.min(two.low),
            high: one.high.max(two.high),
            start: one.start,
            end: two.end,
            next,
            leaf: false,
        };
    }

    /// The pieces, in the order of the loop.
    pub(super) fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    pub(super) fn bounds(&self) -> [DVec2; 2] {
        [self.nodes[0].low, self.nodes[0].high]
    }

    /// Whether a ray from `place` to larger u crosses the chain an odd number of times.
    pub(super) fn crossed_from(&self, place: DVec2) -> bool {
        self.crossed(0, place)
    }

    fn crossed(&self, at: usize, place: DVec2) -> bool {
        let node = &self.nodes[at];
        if let Some(known) = parity([node.low, node.high], node.start, node.end, place) {
            return known;
        }
        if node.leaf {
            crossed_piece(&self.pieces[node.next].curve, place)
        } else {
            self.crossed(at + 1, place) != self.crossed(node.next, place)
        }
    }

    /// Whether the chain may pass through a rectangle.
    pub(super) fn touches(&self, low: DVec2, high: DVec2) -> bool {
        let mut stack = vec![0];
        while let Some(at) = stack.pop() {
            let node = &self.nodes[at];
            if node.low.cmpgt(high).any() || node.high.cmplt(low).any() {
                continue;
            }
            if node.leaf {
                if piece_touches(&self.pieces[node.next].curve, low, high, 12) {
                    return true;
                }
            } else {
                stack.extend([node.next, at + 1]);
            }
        }
        false
    }

    /// Improves what is known of the nearest place, and tells whether it did.
    pub(super) fn nearest(&self, place: DVec2, scale: DVec2, best: &mut LoopPoint) -> bool {
        let mut improved = false;
        let reach = |node: &Node| box_distance(place, node.low, node.high, scale);
        let mut stack = vec![(reach(&self.nodes[0]), 0)];
        while let Some((bound, at)) = stack.pop() {
            if bound >= best.distance {
                continue;
            }
            let node = &self.nodes[at];
            if node.leaf {
                let piece = &self.pieces[node.next];
                improved |= nearest_on(piece, place, scale, best);
                continue;
            }
            let mut pair = [at + 1, node.next].map(|k| (reach(&self.nodes[k]), k));
            if pair[0].0 < pair[1].0 {
                pair.swap(0, 1);
            }
            stack.extend(pair);
        }
        improved
    }

    pub(super) fn signed_area(&self) -> f64 {
        // Around the start, which keeps the terms small; half the sum of what the sides sweep.
        let origin = self.nodes[0].start;
        let mut sum = 0.0;
        for piece in &self.pieces {
            sum += swept(&piece.curve, origin);
        }
        sum / 2.0
    }
}

/// Box of the control points of a piece.
pub(super) fn hull(curve: &BezierCurve) -> [DVec2; 2] {
    let places = curve.points.iter().map(|&h| place_of(h));
    places.fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[a, b], p| {
        [a.min(p), b.max(p)]
    })
}

/// The parity of the crossings of a ray with a chain, where its box and ends tell.
fn parity([low, high]: [DVec2; 2], start: DVec2, end: DVec2, place: DVec2) -> Option<bool> {
    if place.y < low.y || place.y > high.y || place.x > high.x {
        Some(false)
    } else if place.x < low.x {
        Some((start.y > place.y) != (end.y > place.y))
    } else {
        None
    }
}

fn crossed_piece(curve: &BezierCurve, place: DVec2) -> bool {
    let mut odd = false;
    let mut stack = vec![(curve.clone(), 0)];
    while let Some((curve, depth)) = stack.pop() {
        let (a, b) = (start_of(&curve), end_of(&curve));
        let [low, high] = hull(&curve);
        // The halves of a piece as short as rounding are as long as it is: splitting would go on in both.
        let rounding = f64::EPSILON * low.abs().max(high.abs());
        let is_spot = (high - low).cmple(rounding).all();
        if let Some(known) = parity([low, high], a, b, place) {
            odd ^= known;
        } else if curve.points.len() == 2 || depth == DEPTH || is_spot {
            // A chord; the weights of its ends do not bend it.
            if (a.y > place.y) != (b.y > place.y) {
                let side = (b - a).perp_dot(place - a);
                odd ^= (side > 0.0) == (b.y > a.y);
            }
        } else {
            let [one, two] = curve.split(0.5);
            stack.extend([(one, depth + 1), (two, depth + 1)]);
        }
    }
    odd
}

fn piece_touches(curve: &BezierCurve, low: DVec2, high: DVec2, depth: usize) -> bool {
    let [a, b] = hull(curve);
    if a.cmpgt(high).any() || b.cmplt(low).any() {
        return false;
    }
    let (start, end) = (start_of(curve), end_of(curve));
    let inside = |p: DVec2| p.cmpge(low).all() && p.cmple(high).all();
    if depth == 0 || inside(start) || inside(end) {
        return true;
    }
    let [one, two] = curve.split(0.5);
    piece_touches(&one, low, high, depth - 1) || piece_touches(&two, low, high, depth - 1)
}

fn box_distance(place: DVec2, low: DVec2, high: DVec2, scale: DVec2) -> f64 {
    let outside = (low - place).max(place - high).max(DVec2::ZERO);
    (outside * scale).length()
}

/// The nearest place on a segment from `a` to `b`: its share of the way, and its distance.
fn nearest_on_chord(place: DVec2, a: DVec2, b: DVec2, scale: DVec2) -> (f64, f64) {
    let (way, to) = ((b - a) * scale, (place - a) * scale);
    let square = way.length_squared();
    let share = if square > 0.0 {
        (to.dot(way) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (share, (to - share * way).length())
}

/// Splits a piece until its chord is it, leaving out parts that cannot come nearer: no point of a part is further from
/// its chord than its control points are.
fn nearest_on(piece: &Piece, place: DVec2, scale: DVec2, best: &mut LoopPoint) -> bool {
    let mut improved = false;
    let mut stack = vec![(piece.curve.clone(), 0)];
    while let Some((curve, depth)) = stack.pop() {
        let (a, b) = (start_of(&curve), end_of(&curve));
        let (share, distance) = nearest_on_chord(place, a, b, scale);
        let off = |&h: &_| nearest_on_chord(place_of(h), a, b, scale).1;
        let bend = curve.points.iter().map(off).fold(0.0, f64::max);
        if distance - bend >= best.distance {
            continue;
        }
        let size = (b - a).length() + a.length();
        let rounding = 4.0 * f64::EPSILON * size * scale.max_element();
        if bend > rounding && depth < DEPTH {
            let mut parts = curve.split(0.5);
            // The nearer part is taken first, from the end of the stack.
            if share < 0.5 {
                parts.swap(0, 1);
            }
            stack.extend(parts.map(|part| (part, depth + 1)));
            continue;
        }
        if distance < best.distance {
            // On a chord with weights the share of the way is not that of the parameter.
            let weight = |h: Option<&glam::DVec4>| h.map_or(1.0, |h| h.w);
            let (w0, w1) = (weight(curve.points.first()), weight(curve.points.last()));
            let s = share * w0 / (share * w0 + (1.0 - share) * w1);
            best.place = a + share * (b - a);
            best.distance = distance;
            best.use_index = piece.use_index;
            best.parameter = curve.range.0 + s * (curve.range.1 - curve.range.0);
            improved = true;
        }
    }
    improved
}

/// Twice the area swept by the line from `origin` to a point running along a piece: that of its chord, and what lies
/// between it and the chord.
fn swept(curve: &BezierCurve, origin: DVec2) -> f64 {
    let (start, end) = (start_of(curve), end_of(curve));
    (start - origin).perp_dot(end - origin) + beside_chord(curve, 0)
}

/// Twice the area between a piece and its chord: by Gauss' rule of ten points, which is exact without weights, else split
/// until two halves say the same.
fn beside_chord(curve: &BezierCurve, depth: usize) -> f64 {
    if curve.points.len() == 2 {
        return 0.0;
    }
    let start = start_of(curve);
    let whole = beside_chord_by_rule(curve);
    #[expect(clippy::float_cmp, reason = "exactly a polynomial")]
    let polynomial = curve.points.iter().all(|h| h.w == curve.points[0].w);
    if (polynomial && curve.points.len() <= RULE + 1) || depth >= 8 {
        return whole;
    }
    let halves = curve.split(0.5);
    let corner = (end_of(&halves[0]) - start).perp_dot(end_of(curve) - start);
    let [one, two] = halves.each_ref().map(beside_chord_by_rule);
    let [low, high] = hull(curve);
    if (whole - (corner + one + two)).abs() <= 1e-13 * (high - low).length_squared() {
        return corner + one + two;
    }
    corner + beside_chord(&halves[0], depth + 1) + beside_chord(&halves[1], depth + 1)
}

/// Points of the rule: it integrates the product of a place and a velocity of degree so many exactly.
const RULE: usize = 10;

fn beside_chord_by_rule(curve: &BezierCurve) -> f64 {
    static GAUSS: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| rule(RULE));
    let start = start_of(curve);
    let sum = GAUSS.iter().map(|&(x, weight)| {
        let [place, velocity] = place_and_velocity(curve, x);
        weight * (place - start).perp_dot(velocity)
    });
    sum.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec4;

    #[test]
    fn a_piece_without_length_ends_the_search() {
        // Found by the fuzzer of STEP files: each half of such a piece is the whole of it.
        let spot = DVec2::new(0.3, 0.7);
        for rounding in [0.0, f64::EPSILON / 8.0] {
            let points = (0..4).map(|k| {
                let p = spot + rounding * f64::from(k % 2);
                DVec4::new(p.x, p.y, 0.0, 1.0)
            });
            let curve = BezierCurve {
                points: points.collect(),
                range: (0.0, 1.0),
            };
            assert!(!crossed_piece(&curve, spot));
        }
    }
}

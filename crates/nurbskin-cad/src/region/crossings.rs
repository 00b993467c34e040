//! Where the loops of a region cross.

use super::chain::hull;
use super::{Region, end_of, place_of, start_of};
use glam::{DVec2, DVec3};
use nurbskin_geometry::nurbs::bezier::BezierCurve;
use nurbskin_geometry::spatial::boxes::Tree;
use nurbskin_geometry::{Error, Result};

/// Pairs of pieces that are looked at: beyond, loops run along each other.
const BUDGET: usize = 2_000_000;

impl Region {
    /// Where the loops cross themselves or each other. Touching is not crossing.
    ///
    /// # Errors
    /// [`Error::NoSolution`] if there are so many places where they come close that they run along each other.
    pub(crate) fn crossings(&self) -> Result<Vec<DVec2>> {
        crossings(self)
    }
}

fn crossings(region: &Region) -> Result<Vec<DVec2>> {
    let chains = region.chains.iter().flat_map(|chain| chain.pieces());
    let pieces: Vec<&BezierCurve> = chains.map(|piece| &piece.curve).collect();
    let flat = |[a, b]: [DVec2; 2]| [a.extend(0.0), b.extend(0.0)];
    let boxes: Vec<[DVec3; 2]> = pieces.iter().map(|p| flat(hull(p))).collect();
    let [low, high] = region.bounding_rectangle();
    // Less than that in space is a touch.
    let slack = 1e-9 * ((high - low) * region.scale()).length();
    let (mut places, mut budget) = (Vec::new(), BUDGET);
    Tree::new(&boxes).pairs(|a, b| {
        cross(
            pieces[a],
            pieces[b],
            region.scale(),
            slack,
            &mut places,
            &mut budget,
        );
        budget > 0
    });
    // A piece may cross itself: its parts, which are monotone soon.
    for piece in pieces {
        if piece.points.len() > 3 && budget > 0 {
            self_cross(piece, 5, region.scale(), slack, &mut places, &mut budget);
        }
    }
    if budget == 0 {
        return Err(Error::NoSolution("some run along each other".to_owned()));
    }
    // One crossing may be found by neighbouring parts.
    let mut distinct: Vec<DVec2> = Vec::new();
    for place in places {
        let near = |other: &DVec2| ((place - *other) * region.scale()).length() <= 1e3 * slack;
        if !distinct.iter().any(near) {
            distinct.push(place);
        }
    }
    Ok(distinct)
}

/// How far control points are from the chord, in space.
fn bend(piece: &BezierCurve, scale: DVec2) -> f64 {
    let (a, b) = (start_of(piece) * scale, end_of(piece) * scale);
    let way = (b - a).normalize_or_zero();
    let off = |&h: &_| {
        let to = place_of(h) * scale - a;
        let along = to.dot(way).clamp(0.0, a.distance(b));
        (to - along * way).length()
    };
    piece.points.iter().map(off).fold(0.0, f64::max)
}

fn self_cross(
    piece: &BezierCurve,
    depth: usize,
    scale: DVec2,
    slack: f64,
    places: &mut Vec<DVec2>,
    budget: &mut usize,
) {
    let halves = piece.split(0.5);
    if depth > 0 {
        for half in &halves {
            self_cross(half, depth - 1, scale, slack, places, budget);
        }
    }
    cross(&halves[0], &halves[1], scale, slack, places, budget);
}

/// Splits two pieces while their boxes overlap, until they are straight to half of `slack`.
fn cross(
    one: &BezierCurve,
    two: &BezierCurve,
    scale: DVec2,
    slack: f64,
    places: &mut Vec<DVec2>,
    budget: &mut usize,
) {
    let mut stack = vec![(one.clone(), two.clone())];
    while let Some((one, two)) = stack.pop() {
        if *budget == 0 {
            return;
        }
        *budget -= 1;
        let ([a, b], [c, d]) = (hull(&one), hull(&two));
        // Parts that only meet at an end do not overlap by more than the slack.
        let overlap = (b.min(d) - a.max(c)) * scale;
        if overlap.min_element() < 0.0 || overlap.max_element() <= slack {
            continue;
        }
        let (bend_one, bend_two) = (bend(&one, scale), bend(&two, scale));
        if bend_one.max(bend_two) <= slack / 2.0 {
            places.extend(chords_cross(&one, &two, scale, slack));
        } else if bend_one >= bend_two {
            let [x, y] = one.split(0.5);
            stack.extend([(x, two.clone()), (y, two)]);
        } else {
            let [x, y] = two.split(0.5);
            stack.extend([(one.clone(), x), (one, y)]);
        }
    }
}

/// Where the chords of two pieces cross, each with its ends on either side of the other by more than the slack.
fn chords_cross(one: &BezierCurve, two: &BezierCurve, scale: DVec2, slack: f64) -> Option<DVec2> {
    let [a, b] = [start_of(one) * scale, end_of(one) * scale];
    let [c, d] = [start_of(two) * scale, end_of(two) * scale];
    let (way, other) = ((b - a).try_normalize()?, (d - c).try_normalize()?);
    let [p, q] = [c, d].map(|x| way.perp_dot(x - a));
    let [r, s] = [a, b].map(|x| other.perp_dot(x - c));
    let apart = |x: f64, y: f64| x.min(y) < -slack && x.max(y) > slack;
    if !apart(p, q) || !apart(r, s) {
        return None;
    }
    Some((c + (d - c) * (p / (p - q))) / scale)
}

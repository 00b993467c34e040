//! Seams where rings bound a closed surface: a cylinder between two circles, a cap around a pole.

use super::boundary::{Chain, set_end};
use super::model::{EdgeUse, Model};
use super::project::Projector;
use crate::nurbs::refine::Direction;
use crate::nurbs::shape::Edge as Side;
use crate::nurbs::{KnotVector, NurbsCurve};
use crate::{Error, Result};
use glam::{DVec2, DVec3};

/// Joins chains that end periods from their start, in pairs or with a pole, by seams to closed chains.
///
/// # Errors
/// [`Error::Invalid`] if a ring has no partner, or runs around in both directions.
pub(super) fn join_rings(
    model: &mut Model,
    projector: &Projector,
    rings: Vec<Chain>,
) -> Result<Vec<Chain>> {
    if rings.is_empty() {
        return Ok(Vec::new());
    }
    let round: usize = match rings[0].turns {
        [_, 0] => 0,
        [0, _] => 1,
        _ => return Err(no_partner()),
    };
    if rings
        .iter()
        .any(|r| r.turns[round].abs() != 1 || r.turns[1 - round] != 0)
    {
        return Err(no_partner());
    }
    let pairs = match pairs(projector, &rings, round) {
        Some(pairs) => pairs,
        None => {
            // The file has them the wrong way round, perhaps.
            let turned: Vec<Chain> = rings.into_iter().map(Chain::turned).collect();
            let pairs = pairs(projector, &turned, round).ok_or_else(no_partner)?;
            model
                .notes
                .push("the loops of a face ran the wrong way round".into());
            pairs
        }
    };
    let mut closed = Vec::new();
    for (low, high) in pairs {
        closed.push(match (low, high) {
            (Some(low), Some(high)) => between(model, projector, low, high, round)?,
            (Some(ring), None) => to_pole(model, projector, ring, round, true)?,
            (None, Some(ring)) => to_pole(model, projector, ring, round, false)?,
            (None, None) => continue,
        });
    }
    Ok(closed)
}

fn no_partner() -> Error {
    Error::invalid("a loop around a closed surface has no partner on the other side of the face")
}

type Pair = (Option<Chain>, Option<Chain>);

/// Rings with the face on the side of higher parameters, and those on its other side; `None` if one is left over.
fn pairs(projector: &Projector, rings: &[Chain], round: usize) -> Option<Vec<Pair>> {
    let across = 1 - round;
    let sense = if round == 0 { 1 } else { -1 };
    let (mut lows, mut highs): (Vec<&Chain>, Vec<&Chain>) =
        rings.iter().partition(|r| r.turns[round] == sense);
    let height = |c: &Chain| {
        let all = c.uses.iter().map(|u| u.ends()[0][across]);
        all.sum::<f64>() / c.uses.len() as f64
    };
    lows.sort_by(|a, b| height(b).total_cmp(&height(a)));
    let period = projector.period()[across];
    let mut pairs = Vec::new();
    for low in lows {
        let mut best: Option<(f64, usize, f64)> = None;
        for (k, high) in highs.iter().enumerate() {
            let mut rise = height(high) - height(low);
            let mut shift = 0.0;
            if projector.closed[across] {
                let wrapped = rise.rem_euclid(period);
                let wrapped = if wrapped == 0.0 { period } else { wrapped };
                shift = wrapped - rise;
                rise = wrapped;
            }
            if rise > 0.0 && best.is_none_or(|b| rise < b.0) {
                best = Some((rise, k, shift));
            }
        }
        match best {
            Some((_, k, shift)) => {
                let mut by = DVec2::ZERO;
                by[across] = shift;
                let high = highs.remove(k).clone().shifted(by).ok()?;
                pairs.push((Some(low.clone()), Some(high)));
            }
            None if projector.has_pole(pole_side(round, true)) => {
                pairs.push((Some(low.clone()), None));
            }
            None => return None,
        }
    }
    for high in highs {
        if !projector.has_pole(pole_side(round, false)) {
            return None;
        }
        pairs.push((None, Some(high.clone())));
    }
    Some(pairs)
}

fn pole_side(round: usize, high: bool) -> Side {
    match (round, high) {
        (0, true) => Side::VMax,
        (0, false) => Side::VMin,
        (_, true) => Side::UMax,
        (_, false) => Side::UMin,
    }
}

/// The ring from its k-th edge on.
fn begun_at(mut ring: Chain, k: usize) -> Result<Chain> {
    let way = ring.end() - ring.start();
    let tail = ring.uses.split_off(k);
    let head = Chain {
        uses: std::mem::take(&mut ring.uses),
        turns: [0; 2],
    };
    ring.uses = tail;
    ring.uses.extend(head.shifted(way)?.uses);
    Ok(ring)
}

/// The band between two rings, a seam from one to the other.
fn between(
    model: &mut Model,
    projector: &Projector,
    low: Chain,
    high: Chain,
    round: usize,
) -> Result<Chain> {
    // The vertices that are nearest to facing each other.
    let period = projector.period()[round];
    let mut best = (f64::INFINITY, 0, 0);
    for (i, a) in low.uses.iter().enumerate() {
        for (j, b) in high.uses.iter().enumerate() {
            let gap = a.ends()[0][round] - b.ends()[0][round];
            let gap = (gap - (gap / period).round() * period).abs();
            if gap < best.0 - 1e-12 * period {
                best = (gap, i, j);
            }
        }
    }
    let (low, high) = (begun_at(low, best.1)?, begun_at(high, best.2)?);
    let mut shift = DVec2::ZERO;
    shift[round] = projector.turns(low.end() - high.start())[round];
    let mut high = high.shifted(shift)?;
    let (from, mut to) = (low.end(), high.start());
    let back = low.start() - low.end();
    if best.0 <= 1e-9 * period {
        // Straight up, then, exactly.
        to[round] = from[round];
        let end = to + back;
        if let Some(first) = high.uses.first_mut() {
            set_end(first, false, to)?;
        }
        if let Some(last) = high.uses.last_mut() {
            set_end(last, true, end)?;
        }
    }
    let (Some(last), Some(first)) = (low.uses.last(), high.uses.first()) else {
        return Err(no_partner());
    };
    let vertices = [model.ends_of(last)?[1], model.ends_of(first)?[0]];
    let seam = seam(model, projector, [from, to], vertices)?;
    let mut uses = low.uses;
    uses.push(seam.clone());
    uses.extend(high.uses);
    uses.push(returned(seam, back)?);
    Ok(Chain {
        uses,
        turns: [0; 2],
    })
}

/// The cap between a ring and a pole.
fn to_pole(
    model: &mut Model,
    projector: &Projector,
    ring: Chain,
    round: usize,
    high: bool,
) -> Result<Chain> {
    let (from, back) = (ring.end(), ring.start() - ring.end());
    let mut to = from;
    let side = pole_side(round, high);
    to[1 - round] = projector.side_parameter(side);
    let Some(last) = ring.uses.last() else {
        return Err(no_partner());
    };
    let pole = model.add_vertex(projector.at(to))?;
    let vertices = [model.ends_of(last)?[1], pole];
    let seam = seam(model, projector, [from, to], vertices)?;
    let mut chain = Chain {
        uses: ring.uses,
        turns: [0; 2],
    };
    chain.uses.push(seam.clone());
    model.add_pole(&mut chain, side, to, to + back)?;
    chain.uses.push(returned(seam, back)?);
    Ok(chain)
}

/// The seam on its way back, a period from its way there.
fn returned(seam: EdgeUse, by: DVec2) -> Result<EdgeUse> {
    Ok(EdgeUse {
        reversed: !seam.reversed,
        pcurve: seam.pcurve.map_points(|p| p + by.extend(0.0))?,
        ..seam
    })
}

/// A new edge along the straight line between two places: exact along a parameter line.
fn seam(
    model: &mut Model,
    projector: &Projector,
    [from, to]: [DVec2; 2],
    [start, end]: [usize; 2],
) -> Result<EdgeUse> {
    let surface = projector.surface();
    #[expect(clippy::float_cmp, reason = "set equal where it is a parameter line")]
    let fixed = if from.x == to.x {
        Some((Direction::U, 0))
    } else if from.y == to.y {
        Some((Direction::V, 1))
    } else {
        None
    };
    if let Some((direction, axis)) = fixed {
        let at = projector.wrapped(from)[axis];
        let (a, b) = (from[1 - axis], to[1 - axis]);
        let (c, d) = surface.knots(direction.other()).domain();
        let (low, high) = (a.min(b), a.max(b));
        if low >= c && high <= d {
            let curve = surface.iso_curve(direction, at)?.segment(low, high)?;
            let reversed = a > b;
            let (p, q) = if reversed { (to, from) } else { (from, to) };
            let (start, end) = if reversed { (end, start) } else { (start, end) };
            let edge = model.add_edge(&curve, start, end)?;
            let pcurve = super::natural::line(p.to_array(), q.to_array(), (low, high))?;
            return Ok(EdgeUse {
                edge,
                reversed,
                pcurve,
            });
        }
    }
    let curve = lifted(projector, from, to)?;
    let edge = model.add_edge(&curve, start, end)?;
    Ok(EdgeUse {
        edge,
        reversed: false,
        pcurve: super::natural::line(from.to_array(), to.to_array(), (0.0, 1.0))?,
    })
}

/// The curve S(p(t)) of a straight p over \[0, 1\] as cubic Hermite pieces within the tolerance.
fn lifted(projector: &Projector, from: DVec2, to: DVec2) -> Result<NurbsCurve> {
    let way = to - from;
    let jet = |t: f64, inward: f64| {
        let uv = projector.wrapped(from + way * (t + 1e-9 * inward));
        let d = projector.surface().derivatives(uv.x, uv.y);
        (projector.at(from + way * t), d.du * way.x + d.dv * way.y)
    };
    let piece = |a: f64, b: f64| -> [DVec3; 4] {
        let ((p, dp), (q, dq)) = (jet(a, b - a), jet(b, a - b));
        let third = (b - a) / 3.0;
        [p, p + dp * third, q - dq * third, q]
    };
    let mut todo: Vec<(f64, f64)> = (0..8)
        .rev()
        .map(|k| (f64::from(k) / 8.0, f64::from(k + 1) / 8.0))
        .collect();
    let (mut breaks, mut points) = (vec![0.0], vec![projector.at(from)]);
    while let Some((a, b)) = todo.pop() {
        let bezier = piece(a, b);
        let off = [0.25, 0.5, 0.75].map(|s: f64| {
            let r = 1.0 - s;
            let [p0, p1, p2, p3] = bezier;
            let point =
                r * r * r * p0 + 3.0 * r * r * s * p1 + 3.0 * r * s * s * p2 + s * s * s * p3;
            point.distance(projector.at(from + way * (a + s * (b - a))))
        });
        if off.iter().any(|&d| d > 0.5 * projector.tolerance()) && b - a > 1e-4 {
            let middle = f64::midpoint(a, b);
            todo.extend([(middle, b), (a, middle)]);
            continue;
        }
        breaks.extend([b; 3]);
        points.extend_from_slice(&bezier[1..]);
    }
    breaks.truncate(breaks.len() - 2);
    NurbsCurve::new(KnotVector::clamped(3, &breaks)?, points, None)
}

//! Seams where rings bound a closed surface: a cylinder between two circles, a cap around a pole.

use crate::boundary::{Chain, set_end};
use crate::model::{EdgeUse, Model};
use crate::pcurve::lift::lift;
use crate::pcurve::project::Projector;
use glam::DVec2;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::shape::Edge as Side;
use nurbskin_geometry::{Error, Result};

/// The way round a closed surface that the rings of a face have in common.
#[derive(Clone, Copy, Debug)]
struct Way {
    /// Periods along u and v of rings that have the face on their left.
    turns: [i32; 2],
    period: DVec2,
}

impl Way {
    /// The way of these rings, of which none crosses another: all have the same, or the opposite one.
    fn of(rings: &[Chain], period: DVec2) -> Option<Self> {
        let first = rings.first()?.turns;
        // Upwards, a face to the left has lower u; so that `height` rises with u, the way along v is downwards.
        let turns = match first {
            [_, 0] => [1, 0],
            [0, _] => [0, -1],
            [u, v] if u < 0 => [-u, -v],
            oblique => oblique,
        };
        let sound = turns.iter().all(|t| t.abs() <= 32);
        let against = turns.map(|t| -t);
        let same = |r: &Chain| r.turns == turns || r.turns == against;
        (sound && rings.iter().all(same)).then_some(Self { turns, period })
    }

    /// The direction that is closed and along which the rings run, if it is one of the two.
    fn axis(&self) -> Option<usize> {
        match self.turns {
            [_, 0] => Some(0),
            [0, _] => Some(1),
            _ => None,
        }
    }

    fn vector(&self) -> DVec2 {
        DVec2::new(f64::from(self.turns[0]), f64::from(self.turns[1]))
    }

    /// How far to the left a place is: 1 from a ring to its next copy where the surface closes across.
    fn height(&self, uv: DVec2) -> f64 {
        self.vector().perp_dot(uv / self.period)
    }

    /// How far along a place is: 1 for a whole ring.
    fn along(&self, uv: DVec2) -> f64 {
        let way = self.vector();
        way.dot(uv / self.period) / way.length_squared()
    }

    /// Whole periods that rise by one in height.
    fn step(&self) -> Option<DVec2> {
        let (p, q) = (self.turns[0], self.turns[1]);
        let all = (-32..=32).flat_map(|i| (-32..=32).map(move |j| (i, j)));
        let found = all
            .filter(|&(i, j)| p * j - q * i == 1)
            .min_by_key(|&(i, j)| i * i + j * j);
        found.map(|(i, j)| DVec2::new(f64::from(i), f64::from(j)) * self.period)
    }
}

/// Joins chains that end periods from their start, in pairs or with a pole, by seams to closed chains. They may go round
/// along u, along v, or obliquely, as Villarceau's circles do on a torus.
///
/// # Errors
/// [`Error::Invalid`] if a ring has no partner, or rings cross.
pub(super) fn join_rings(
    model: &mut Model,
    projector: &Projector,
    rings: Vec<Chain>,
) -> Result<Vec<Chain>> {
    if rings.is_empty() {
        return Ok(Vec::new());
    }
    let way = Way::of(&rings, projector.period()).ok_or_else(|| {
        Error::invalid(
            "loops run around a closed surface more than once or cross each other; check the face in the system that \
             wrote it",
        )
    })?;
    let pairs = match pairs(projector, &rings, way) {
        Some(pairs) => pairs,
        None => {
            // The file has them the wrong way round, perhaps.
            let turned: Vec<Chain> = rings.into_iter().map(Chain::turned).collect();
            let pairs = pairs(projector, &turned, way).ok_or_else(no_partner)?;
            model
                .notes
                .push("the loops of a face had the wrong orientation: they were reversed".into());
            pairs
        }
    };
    let mut closed = Vec::new();
    for pair in pairs {
        closed.push(match (pair, way.axis()) {
            ((Some(low), Some(high)), _) => between(model, projector, low, high, way)?,
            ((Some(ring), None), Some(round)) => to_pole(model, projector, ring, round, true)?,
            ((None, Some(ring)), Some(round)) => to_pole(model, projector, ring, round, false)?,
            _ => continue,
        });
    }
    Ok(closed)
}

fn no_partner() -> Error {
    Error::invalid("a loop around a closed surface has no partner on the other side of the face")
}

type Pair = (Option<Chain>, Option<Chain>);

/// Rings with the face on the side of higher parameters, and those on its other side; `None` if one is left over.
fn pairs(projector: &Projector, rings: &[Chain], way: Way) -> Option<Vec<Pair>> {
    let (mut lows, mut highs): (Vec<&Chain>, Vec<&Chain>) =
        rings.iter().partition(|r| r.turns == way.turns);
    let height = |c: &Chain| {
        let all = c.uses.iter().map(|u| way.height(u.ends()[0]));
        all.sum::<f64>() / c.uses.len() as f64
    };
    lows.sort_by(|a, b| height(b).total_cmp(&height(a)));
    let pole = |high: bool| {
        let round = way.axis();
        round.is_some_and(|round| projector.has_pole(pole_side(round, high)))
    };
    // Across the way, the surface goes on from its end, or does not.
    let step = match way.axis() {
        Some(round) if !projector.closed[1 - round] => None,
        _ => way.step(),
    };
    let mut pairs = Vec::new();
    for low in lows {
        let mut best: Option<(f64, usize, DVec2)> = None;
        for (k, high) in highs.iter().enumerate() {
            let mut rise = height(high) - height(low);
            let mut shift = DVec2::ZERO;
            if let Some(step) = step {
                let wrapped = rise.rem_euclid(1.0);
                let wrapped = if wrapped == 0.0 { 1.0 } else { wrapped };
                shift = (wrapped - rise).round() * step;
                rise = wrapped;
            }
            if rise > 0.0 && best.is_none_or(|b| rise < b.0) {
                best = Some((rise, k, shift));
            }
        }
        match best {
            Some((_, k, shift)) => {
                let high = highs.remove(k).clone().shifted(shift).ok()?;
                pairs.push((Some(low.clone()), Some(high)));
            }
            None if pole(true) => pairs.push((Some(low.clone()), None)),
            None => return None,
        }
    }
    for high in highs {
        if !pole(false) {
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
    way: Way,
) -> Result<Chain> {
    // The vertices that are nearest to facing each other.
    let mut best = (f64::INFINITY, 0, 0);
    for (i, a) in low.uses.iter().enumerate() {
        for (j, b) in high.uses.iter().enumerate() {
            let gap = way.along(a.ends()[0] - b.ends()[0]);
            let gap = (gap - gap.round()).abs();
            if gap < best.0 - 1e-12 {
                best = (gap, i, j);
            }
        }
    }
    let (low, high) = (begun_at(low, best.1)?, begun_at(high, best.2)?);
    let turns = way.along(low.end() - high.start()).round();
    let mut high = high.shifted(turns * way.vector() * way.period)?;
    let (from, mut to) = (low.end(), high.start());
    let back = low.start() - low.end();
    if best.0 <= 1e-9
        && let Some(round) = way.axis()
    {
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
            let pcurve = crate::natural::line(p.to_array(), q.to_array(), (low, high))?;
            return Ok(EdgeUse {
                edge,
                reversed,
                pcurve,
            });
        }
    }
    let pcurve = crate::natural::line(from.to_array(), to.to_array(), (0.0, 1.0))?;
    let curve = lift(&pcurve, 0.5 * projector.tolerance(), |uv| {
        let place = projector.wrapped(uv);
        let s = surface.derivatives(place.x, place.y);
        [s.point, s.du, s.dv]
    })?;
    let edge = model.add_edge(&curve, start, end)?;
    Ok(EdgeUse {
        edge,
        reversed: false,
        pcurve,
    })
}

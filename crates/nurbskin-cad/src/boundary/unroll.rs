//! The domain of a surface moved, or unrolled over more than a turn, so that loops lie in it.

use crate::boundary::Chain;
use crate::model::{EdgeUse, Loop, Model};
use crate::pcurve::project::Projector;
use glam::{DVec2, DVec4};
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve, NurbsSurface};
use nurbskin_geometry::{Error, Result};

/// A loop as a polygon in the parameter plane.
#[derive(Clone, Debug)]
pub(super) struct Area {
    points: Vec<DVec2>,
}

impl Area {
    pub(super) fn of(uses: &[EdgeUse]) -> Self {
        let mut points = Vec::new();
        for used in uses {
            let breaks = used.pcurve.knots().breakpoints();
            let parts = if used.pcurve.knots().degree() == 1 {
                1
            } else {
                8
            };
            let mut own: Vec<DVec2> = Vec::new();
            for w in breaks.windows(2) {
                own.extend((0..parts).map(|k| {
                    let t = w[0] + (w[1] - w[0]) * f64::from(k) / f64::from(parts);
                    used.pcurve.point(t).truncate()
                }));
            }
            own.extend(used.pcurve.control_points().last().map(|p| p.truncate()));
            if used.reversed {
                own.reverse();
            }
            points.extend(own);
        }
        Self { points }
    }

    /// Positive if the polygon runs counter-clockwise.
    pub(super) fn signed(&self) -> f64 {
        let Some(&first) = self.points.first() else {
            return 0.0;
        };
        let rest = self.points.windows(2);
        0.5 * rest
            .map(|w| (w[0] - first).perp_dot(w[1] - first))
            .sum::<f64>()
    }

    fn range(&self) -> [DVec2; 2] {
        let all = self.points.iter();
        all.fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[a, b], &p| {
            [a.min(p), b.max(p)]
        })
    }

    fn holds(&self, p: DVec2) -> bool {
        let mut inside = false;
        let count = self.points.len();
        for k in 0..count {
            let (a, b) = (self.points[k], self.points[(k + 1) % count]);
            if (a.y > p.y) != (b.y > p.y) && p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y) {
                inside = !inside;
            }
        }
        inside
    }
}

/// The surface over a domain that holds the loops, and the loops, the outer ones first; with `whole`, a loop around all
/// of the surface is put before them.
pub(super) fn fit_domain(
    model: &mut Model,
    projector: &Projector,
    chains: Vec<Chain>,
    whole: bool,
) -> Result<(NurbsSurface, Vec<Loop>)> {
    let mut chains = chains;
    let mut surface = projector.surface().clone();
    if whole {
        for (direction, axis) in [(Direction::U, 0), (Direction::V, 1)] {
            if projector.closed[axis]
                && let Some(from) = clear_line(projector, &chains, axis)?
            {
                surface = unrolled(&surface, direction, from, from + projector.period()[axis])?;
            }
        }
        let [(a, b), (c, d)] = surface.domain();
        chains = into(projector, chains, &|p| {
            p.x >= a && p.x <= b && p.y >= c && p.y <= d
        })?;
        let mut loops = vec![model.whole_loop(&surface, projector.tolerance())?];
        loops.extend(finished(chains, &surface)?);
        return Ok((surface, loops));
    }
    // Holes go where the outer loop is.
    let mut rest = chains.into_iter();
    let Some(outer) = rest.next() else {
        return Err(Error::invalid("a face without a boundary"));
    };
    let around = Area::of(&outer.uses);
    let mut range = around.range();
    let mut chains = vec![outer];
    chains.extend(into(projector, rest.collect(), &|p| around.holds(p))?);
    for (direction, axis) in [(Direction::U, 0), (Direction::V, 1)] {
        if !projector.closed[axis] {
            continue;
        }
        let period = projector.period()[axis];
        let (a, b) = projector.surface().knots(direction).domain();
        let (low, high) = (range[0][axis], range[1][axis]);
        let slack = 1e-7 * period;
        let turn = ((low + slack - a) / period).floor() * period;
        if high - turn <= b + slack {
            let mut by = DVec2::ZERO;
            by[axis] = -turn;
            let moved = chains.into_iter().map(|c| c.shifted(by));
            chains = moved.collect::<Result<Vec<_>>>()?;
            range = range.map(|r| r + by);
        } else if high - low < 64.0 * period {
            let width = (high - low).max(period);
            let spare = if high - low < period - slack {
                0.5 * (period - (high - low))
            } else {
                0.0
            };
            surface = unrolled(&surface, direction, low - spare, low - spare + width)?;
        } else {
            return Err(Error::invalid(
                "a face goes around its surface more than 64 times",
            ));
        }
    }
    let loops = finished(chains, &surface)?;
    Ok((surface, loops))
}

/// Each chain by the periods that put its first point where `inside` holds, if there are such.
fn into(
    projector: &Projector,
    chains: Vec<Chain>,
    inside: &dyn Fn(DVec2) -> bool,
) -> Result<Vec<Chain>> {
    let turns = |closed: bool| if closed { -2_i32..=2 } else { 0..=0 };
    let place = |chain: Chain| {
        let start = chain.start();
        let [us, vs] = [turns(projector.closed[0]), turns(projector.closed[1])];
        let shifts = us.flat_map(|i| {
            vs.clone()
                .map(move |j| DVec2::new(f64::from(i), f64::from(j)))
        });
        let mut shifts: Vec<DVec2> = shifts.map(|s| s * projector.period()).collect();
        shifts.sort_by(|a, b| a.length().total_cmp(&b.length()));
        let shift = shifts.into_iter().find(|&s| inside(start + s));
        chain.shifted(shift.unwrap_or(DVec2::ZERO))
    };
    chains.into_iter().map(place).collect()
}

/// A parameter of a closed direction that no hole crosses, unless that is where the domain begins already.
fn clear_line(projector: &Projector, holes: &[Chain], axis: usize) -> Result<Option<f64>> {
    let period = projector.period()[axis];
    let ranges: Vec<(f64, f64)> = holes
        .iter()
        .map(|h| Area::of(&h.uses).range())
        .map(|[low, high]| (low[axis], high[axis]))
        .collect();
    let direction = Direction::BOTH[axis];
    let (a, b) = projector.surface().knots(direction).domain();
    let clear = |t: f64| {
        ranges.iter().all(|&(low, high)| {
            let from = (low - t).rem_euclid(period);
            from > 0.0 && from + (high - low) < period
        })
    };
    if clear(a) {
        return Ok(None);
    }
    let places = (1..256).map(|k| a + (b - a) * f64::from(k) / 256.0);
    places
        .into_iter()
        .find(|&t| clear(t))
        .map(Some)
        .ok_or_else(|| Error::invalid("the holes of a closed face leave no place for its seam"))
}

/// The loops, held in the domain of the surface: what is off by rounding is put on its border.
fn finished(chains: Vec<Chain>, surface: &NurbsSurface) -> Result<Vec<Loop>> {
    let [(a, b), (c, d)] = surface.domain();
    // Control points may lie further outside than their curve.
    let snap = |t: f64, a: f64, b: f64| {
        let near = 1e-11 * (b - a);
        let far = 1e-7 * (b - a);
        if t <= a + near && t >= a - far {
            a
        } else if t >= b - near && t <= b + far {
            b
        } else {
            t
        }
    };
    let hold = |curve: &NurbsCurve| {
        curve.map_points(|p| glam::DVec3::new(snap(p.x, a, b), snap(p.y, c, d), 0.0))
    };
    let mut loops = Vec::with_capacity(chains.len());
    for chain in chains {
        let mut uses = chain.uses;
        for used in &mut uses {
            used.pcurve = hold(&used.pcurve)?;
        }
        loops.push(Loop { uses });
    }
    Ok(loops)
}

/// A surface that closes along `direction` over [a, b] there, which may begin anywhere and be longer than a period.
///
/// # Errors
/// [`Error::Invalid`] if a < b does not hold.
fn unrolled(surface: &NurbsSurface, direction: Direction, a: f64, b: f64) -> Result<NurbsSurface> {
    if direction == Direction::V {
        return Ok(unrolled(&surface.transposed(), Direction::U, a, b)?.transposed());
    }
    let knots = surface.knots_u();
    let (p, (low, high)) = (knots.degree(), knots.domain());
    let period = high - low;
    let first = ((a - low) / period).floor();
    let copies = ((b - low) / period).ceil() - first;
    if !(1.0..=66.0).contains(&copies) {
        return Err(Error::invalid("a surface cannot be unrolled that far"));
    }
    let [m, n] = surface.control_points().counts();
    let inner = &knots.knots()[p + 1..m];
    let mut breaks = vec![low + first * period];
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "1 to 66"
    )]
    let copies = copies as usize;
    for k in 0..copies {
        let by = (first + k as f64) * period;
        breaks.extend(inner.iter().map(|u| u + by));
        let joint = low + (first + k as f64 + 1.0) * period;
        breaks.extend(std::iter::repeat_n(
            joint,
            if k + 1 == copies { 1 } else { p },
        ));
    }
    let mut points: Vec<DVec4> = Vec::with_capacity(n * (copies * (m - 1) + 1));
    for j in 0..n {
        let row: Vec<DVec4> = (0..m).map(|i| surface.homogeneous(i, j)).collect();
        let (mut scale, ratio) = (1.0, row[m - 1].w / row[0].w);
        points.push(row[0]);
        for _ in 0..copies {
            points.extend(row[1..].iter().map(|&h| h * scale));
            scale *= ratio;
        }
    }
    let long = NurbsSurface::from_homogeneous(
        KnotVector::clamped(p, &breaks)?,
        surface.knots_v().clone(),
        &points,
        surface.is_rational(),
    )?;
    let (from, to) = long.knots_u().domain();
    long.segment(Direction::U, a.max(from), b.min(to))
}

//! Feet along a curve on a surface, each found from the one before.

use super::project::{Place, Projector};
use glam::DVec2;
use nurbskin_geometry::Result;
use nurbskin_geometry::nurbs::NurbsCurve;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::shape::Edge as Side;

impl Projector {
    /// Feet along the curve, close enough to each other to be sure of the way.
    pub(super) fn places(&mut self, curve: &NurbsCurve) -> Result<Vec<Place>> {
        let a = curve.domain().0;
        // Times to meet: 4 intervals per span, fewer where there are many spans.
        let breaks = curve.knots().breakpoints();
        let parts = if breaks.len() > 200 { 1 } else { 4 };
        let mut times = vec![a];
        for w in breaks.windows(2) {
            times.extend((1..=parts).map(|k| {
                if k == parts {
                    w[1]
                } else {
                    w[0] + (w[1] - w[0]) * f64::from(k) / f64::from(parts)
                }
            }));
        }
        // Begin in the middle, or where the curve is furthest from the poles.
        let clear = |t: f64| {
            let point = curve.point(t);
            let distances = self.poles.iter().map(|p| p.1.distance(point));
            distances.fold(f64::INFINITY, f64::min)
        };
        let last = times.len() - 1;
        let mut begin = last / 2;
        if !self.poles.is_empty() {
            let best = (0..=last).map(|k| (clear(times[k]), k));
            begin = best
                .fold((-1.0, begin), |a, b| if b.0 > a.0 { b } else { a })
                .1;
        }
        let (uv, _) = self.foot_anywhere(curve.point(times[begin]), None)?;
        let seed = Place {
            t: times[begin],
            uv,
            slope: None,
        };
        let mut back = self.march(curve, seed, times[..begin].iter().rev().copied(), true)?;
        let ahead = self.march(curve, seed, times[begin + 1..].iter().copied(), true)?;
        back.reverse();
        back.push(seed);
        back.extend(ahead);
        Ok(back)
    }

    /// Feet from a place at these times, with steps between them where the way is not sure.
    fn march(
        &mut self,
        curve: &NurbsCurve,
        seed: Place,
        times: impl Iterator<Item = f64>,
        to_end: bool,
    ) -> Result<Vec<Place>> {
        let (a, b) = curve.domain();
        let mut here = seed;
        let mut slope = None;
        let mut found: Vec<Place> = Vec::new();
        let times: Vec<f64> = times.collect();
        for (k, &goal) in times.iter().enumerate() {
            let ends_at = (to_end && k + 1 == times.len()).then(|| self.pole_at(curve.point(goal)));
            if let Some(Some(side)) = ends_at {
                let place = self.reach_pole(curve, here, goal, side)?;
                found.extend(place);
                break;
            }
            let mut steps = 0;
            #[expect(clippy::float_cmp, reason = "the goal itself is reached")]
            while here.t != goal {
                let shortest = 1e-6 * (b - a);
                let mut dt = goal - here.t;
                let next = loop {
                    let t = if dt.abs() >= (goal - here.t).abs() {
                        goal
                    } else {
                        here.t + dt
                    };
                    match self.step(curve, here, slope, t) {
                        Some(next) => break next,
                        None if dt.abs() > shortest && steps < 4000 => dt *= 0.5,
                        None => {
                            let (uv, _) = self.foot_anywhere(curve.point(t), Some(here.uv))?;
                            break Place { t, uv, slope: None };
                        }
                    }
                    steps += 1;
                };
                slope = Some(self.slope(curve, next, here));
                here = next;
                found.push(here);
            }
        }
        Ok(found)
    }

    /// The foot at time t, or `None` if it is not clear that the curve leads there.
    fn step(&self, curve: &NurbsCurve, here: Place, slope: Option<DVec2>, t: f64) -> Option<Place> {
        let (from, to) = (curve.point(here.t), curve.point(t));
        let ahead = Place {
            t,
            uv: here.uv,
            slope: None,
        };
        let slope = slope.unwrap_or_else(|| self.slope(curve, here, ahead));
        let guess = self.held(here.uv + slope * (t - here.t));
        let off = self.at(here.uv).distance(from);
        let within = 4.0 * off + self.tolerance.max(1e-6 * from.distance(to));
        let starts = [guess, here.uv];
        starts.into_iter().find_map(|start| {
            let (uv, distance) = self.foot_from(to, start);
            // The way in between is as long in space as the curve.
            let middle = self.at(0.5 * (uv + here.uv));
            let half = curve.point(f64::midpoint(t, here.t));
            let strays =
                middle.distance(half) > 0.5 * from.distance(half).max(to.distance(half)) + within;
            (distance <= within && !strays).then_some(Place { t, uv, slope: None })
        })
    }

    /// Goes to a pole at time `goal`, where one of the parameters is the limit.
    fn reach_pole(
        &mut self,
        curve: &NurbsCurve,
        here: Place,
        goal: f64,
        side: Side,
    ) -> Result<Vec<Place>> {
        // Close to the pole, but where parameters are good to 1e-10 still.
        let step = 1e-3 * (here.t - goal);
        let near = self.march(
            curve,
            here,
            [3.0, 2.0, 1.0].map(|k| goal + k * step).into_iter(),
            false,
        )?;
        let [.., third, second, first] = near[..] else {
            return Ok(near);
        };
        let (u1, u2, u3) = (first.uv, second.uv, third.uv);
        let mut uv = 3.0 * u1 - 3.0 * u2 + u3;
        let pole = self.side_parameter(side);
        match side.direction() {
            Direction::U => uv.x = pole + self.turns(DVec2::new(uv.x - pole, 0.0)).x,
            Direction::V => uv.y = pole + self.turns(DVec2::new(0.0, uv.y - pole)).y,
        }
        let slope = (-11.0 / 6.0 * uv + 3.0 * u1 - 1.5 * u2 + u3 / 3.0) / step;
        let mut found = near;
        found.push(Place {
            t: goal,
            uv,
            slope: Some(slope),
        });
        Ok(found)
    }
}

//! The curve through the feet of a curve on a surface.

use super::project::{Place, Projector};
use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve};

/// More intervals than this are not made: the curve does not lie on the surface, or the surface is folded.
const MOST_PIECES: usize = 2000;

impl Projector {
    /// The straight p-curve from end to end, if it is within the tolerance.
    pub(super) fn straight(
        &self,
        curve: &NurbsCurve,
        places: &[Place],
    ) -> Result<Option<NurbsCurve>> {
        let [first, .., last] = places else {
            return Ok(None);
        };
        let at = |t: f64| first.uv + (last.uv - first.uv) * ((t - first.t) / (last.t - first.t));
        let good = |t: f64, uv: DVec2| self.at(at(t)).distance(self.at(uv)) <= 0.5 * self.within;
        if !places.iter().all(|p| good(p.t, p.uv)) {
            return Ok(None);
        }
        let between = places.windows(2).all(|w| {
            let t = f64::midpoint(w[0].t, w[1].t);
            let (uv, _) = self.foot_from(curve.point(t), at(t));
            good(t, uv)
        });
        if !between {
            return Ok(None);
        }
        crate::natural::line(first.uv.to_array(), last.uv.to_array(), curve.domain()).map(Some)
    }

    /// Adds places until the Hermite curve is within the tolerance of the feet.
    pub(super) fn refine(&self, curve: &NurbsCurve, places: &mut Vec<Place>) {
        let mut todo: Vec<[Place; 2]> = places.windows(2).rev().map(|w| [w[0], w[1]]).collect();
        let Some(&first) = places.first() else {
            return;
        };
        let mut done = vec![first];
        let shortest = 1e-9 * (curve.domain().1 - curve.domain().0);
        while let Some([from, to]) = todo.pop() {
            let full = done.len() + todo.len() > MOST_PIECES || to.t - from.t < shortest;
            match self.worst(curve, from, to) {
                Some(between) if !full => todo.extend([[between, to], [from, between]]),
                _ => done.push(to),
            }
        }
        *places = done;
    }

    /// A place to cut an interval at, if the Hermite curve is not good there.
    fn worst(&self, curve: &NurbsCurve, from: Place, to: Place) -> Option<Place> {
        let bezier = self.bezier(curve, from, to);
        let mut middle = None;
        let mut good = true;
        for s in [0.5, 0.25, 0.75] {
            let t = from.t + s * (to.t - from.t);
            let guess = cubic(bezier, s);
            let (uv, _) = self.foot_from(curve.point(t), guess);
            let uv = if self.at(uv).distance(self.at(guess))
                > 1e3 * self.within + curve.point(from.t).distance(curve.point(to.t))
            {
                guess
            } else {
                uv
            };
            middle.get_or_insert(Place { t, uv, slope: None });
            good &= self.at(guess).distance(self.at(uv)) <= 0.5 * self.within;
        }
        if good { None } else { middle }
    }

    fn bezier(&self, curve: &NurbsCurve, from: Place, to: Place) -> [DVec2; 4] {
        let third = (to.t - from.t) / 3.0;
        [
            from.uv,
            from.uv + third * self.slope(curve, from, to),
            to.uv - third * self.slope(curve, to, from),
            to.uv,
        ]
    }

    /// The Hermite curve through the places: C1 where the slopes of both sides agree, else with a triple knot.
    pub(super) fn hermite(&self, curve: &NurbsCurve, places: &[Place]) -> Result<NurbsCurve> {
        let (a, b) = curve.domain();
        let mut breaks = vec![a];
        let mut points: Vec<DVec3> = Vec::new();
        for (k, w) in places.windows(2).enumerate() {
            let bezier = self.bezier(curve, w[0], w[1]);
            if k == 0 {
                points.push(bezier[0].extend(0.0));
            } else if let Some(before) = points.last().copied() {
                // With a double knot the joint is between its neighbours.
                let [h0, h1] = [w[0].t - places[k - 1].t, w[1].t - w[0].t];
                let joint = (before.truncate() * h1 + bezier[1] * h0) / (h0 + h1);
                breaks.extend([w[0].t; 2]);
                if self.at(joint).distance(self.at(w[0].uv)) > 0.05 * self.within {
                    breaks.push(w[0].t);
                    points.push(w[0].uv.extend(0.0));
                }
            }
            points.extend([bezier[1].extend(0.0), bezier[2].extend(0.0)]);
        }
        if let Some(last) = places.last() {
            points.push(last.uv.extend(0.0));
        }
        breaks.push(b);
        NurbsCurve::new(KnotVector::clamped(3, &breaks)?, points, None)
    }
}

fn cubic(b: [DVec2; 4], s: f64) -> DVec2 {
    let r = 1.0 - s;
    r * r * r * b[0] + 3.0 * r * r * s * b[1] + 3.0 * r * s * s * b[2] + s * s * s * b[3]
}

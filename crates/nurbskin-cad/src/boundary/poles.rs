//! Poles in loops: the way along them, and edges that run through one.

use crate::boundary::{Bound, Chain, set_end};
use crate::model::{EdgeUse, Model};
use crate::pcurve::project::Projector;
use glam::DVec2;
use nurbskin_geometry::Result;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::shape::Edge as Side;

impl Model {
    /// The bounds with all pieces of edges that were cut; those that run through a pole of the surface, where their
    /// parameters jump, are cut there before.
    pub(super) fn cut_at_poles(
        &mut self,
        projector: &Projector,
        bounds: &[Bound],
    ) -> Result<Vec<Bound>> {
        for each in bounds.iter().flat_map(|b| &b.edges) {
            for (_, pole) in &projector.poles {
                let pieces: Vec<usize> = self.pieces_of(each.edge).collect();
                for piece in pieces {
                    let edge = self.edges().get(piece);
                    let Some(curve) = edge.and_then(|e| e.curve.as_ref()) else {
                        continue;
                    };
                    let (a, b) = curve.domain();
                    let off = |t: f64| projector.pole_at(curve.point(t)).is_none();
                    if off(a) && off(b) {
                        let t = curve.nearest(*pole);
                        if !off(t) && t > a && t < b {
                            self.cut_edge(piece, t)?;
                        }
                    }
                }
            }
        }
        let pieces = |bound: &Bound| {
            let mut bound = bound.clone();
            let edges = bound.edges.iter().flat_map(|each| {
                let mut pieces: Vec<usize> = self.pieces_of(each.edge).collect();
                if each.reversed {
                    pieces.reverse();
                }
                let cut = pieces.len() > 1;
                pieces.into_iter().map(move |edge| {
                    let mut each = each.clone();
                    each.edge = edge;
                    if cut {
                        each.pcurve = None;
                    }
                    each
                })
            });
            bound.edges = edges.collect();
            bound
        };
        Ok(bounds.iter().map(pieces).collect())
    }

    /// Adds the degenerate edge at a pole from (u, v) to (u, v), if it has a length.
    pub(super) fn add_pole(
        &mut self,
        chain: &mut Chain,
        side: Side,
        from: DVec2,
        to: DVec2,
    ) -> Result<()> {
        // Both lie on the side exactly.
        if let Some(last) = chain.uses.last_mut() {
            set_end(last, true, from)?;
        }
        let length = match side.direction() {
            Direction::U => (to - from).y,
            Direction::V => (to - from).x,
        };
        let Some(last) = chain.uses.last() else {
            return Ok(());
        };
        if length == 0.0 {
            return Ok(());
        }
        let vertex = self.ends_of(last)?[1];
        let edge = self.add_degenerate_edge(vertex)?;
        chain.uses.push(EdgeUse {
            edge,
            reversed: false,
            pcurve: crate::natural::line(from.to_array(), to.to_array(), (0.0, 1.0))?,
        });
        Ok(())
    }
}

/// Where the way along a pole ends that begins at `from` and leads to `to` or periods from it. The face is to the left:
/// rightwards along `v_min`, upwards along `u_max`, leftwards along `v_max`, downwards along `u_min`.
pub(super) fn pole_way(
    projector: &Projector,
    side: Side,
    from: DVec2,
    to: DVec2,
    same: bool,
) -> DVec2 {
    let pole = projector.side_parameter(side);
    let (along, rises) = match side {
        Side::VMin => (0, true),
        Side::VMax => (0, false),
        Side::UMin => (1, false),
        Side::UMax => (1, true),
    };
    let mut target = to;
    target[1 - along] = pole;
    if projector.closed[along] {
        let period = projector.period()[along];
        let mut way = (to[along] - from[along]).rem_euclid(period);
        let slack = 1e-6 * period;
        if way < slack || way > period - slack {
            // There and back along one edge is a whole turn, else it is none.
            way = if same { period } else { 0.0 };
        }
        if !rises && way > 0.0 {
            way -= period;
            if same && way == 0.0 {
                way = -period;
            }
        }
        target[along] = from[along] + way;
    }
    target
}

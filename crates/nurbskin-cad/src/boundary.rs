//! Faces from what files give: edges in loops, with p-curves or without, seams and poles or none.

mod poles;
mod rings;
mod unroll;

use super::model::{EdgeUse, Face, Model, SurfaceKind};
use crate::boundary::poles::pole_way;
use crate::boundary::rings::join_rings;
use crate::boundary::unroll::{Area, fit_domain};
use crate::pcurve::lift::leaves;
use crate::pcurve::project::Projector;
use glam::DVec2;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::shape::Edge as Side;
use nurbskin_geometry::nurbs::sweep::over;
use nurbskin_geometry::nurbs::{NurbsCurve, NurbsSurface};
use nurbskin_geometry::unit::three_digits;
use nurbskin_geometry::{Error, Result};

/// A file's own p-curve is taken where it is this many tolerances from the curve in space at most: both are given as the
/// edge, and a p-curve made anew is no truer.
pub(crate) const GIVEN: f64 = 20.0;

/// A closed chain of edges as a file has it, in order; without edges, it is a point (a vertex loop).
#[derive(Clone, Debug, Default)]
pub(crate) struct Bound {
    /// The edges, the face to their left seen from its outward side.
    pub(crate) edges: Vec<BoundEdge>,
    /// Whether the file calls it the outer one.
    pub(crate) outer: bool,
}

impl Bound {
    /// The bound run the other way.
    pub(crate) fn turned(mut self) -> Self {
        self.edges.reverse();
        for each in &mut self.edges {
            each.reversed = !each.reversed;
        }
        self
    }
}

/// An edge of a [`Bound`].
#[derive(Clone, Debug)]
pub(crate) struct BoundEdge {
    /// Index of the edge.
    pub(crate) edge: usize,
    /// Whether the loop runs from the edge's end to its start.
    pub(crate) reversed: bool,
    /// The file's p-curve, over the edge curve's parameters and running as the edge does.
    pub(crate) pcurve: Option<NurbsCurve>,
}

/// A chain of edges in the parameter plane, where closed directions run on.
#[derive(Clone, Debug, Default)]
pub(super) struct Chain {
    pub(super) uses: Vec<EdgeUse>,
    /// How many periods along u and v its end lies from its start.
    pub(super) turns: [i32; 2],
}

impl Chain {
    pub(super) fn start(&self) -> DVec2 {
        self.uses.first().map_or(DVec2::ZERO, |u| u.ends()[0])
    }
    pub(super) fn end(&self) -> DVec2 {
        self.uses.last().map_or(DVec2::ZERO, |u| u.ends()[1])
    }
    /// The chain moved in the parameter plane.
    pub(super) fn shifted(mut self, by: DVec2) -> Result<Self> {
        if by != DVec2::ZERO {
            for used in &mut self.uses {
                used.pcurve = used.pcurve.map_points(|p| p + by.extend(0.0))?;
            }
        }
        Ok(self)
    }
    /// The chain run the other way.
    pub(super) fn turned(mut self) -> Self {
        self.uses.reverse();
        for used in &mut self.uses {
            used.reversed = !used.reversed;
        }
        self.turns = self.turns.map(|t| -t);
        self
    }
}

impl Model {
    /// Adds a face bounded as a file says, and tells its index.
    ///
    /// P-curves that are missing, outside the surface, or farther from their edges than `given` (at least 20 tolerances) are
    /// computed, to `tolerance`. Closed
    /// directions run on over their seams; a loop that leaves the domain moves the seam of the surface, or unrolls it over more than one
    /// turn. Degenerate edges are added where a loop passes a pole, and seams where rings bound a closed surface. Loops
    /// are turned so that the face lies to their left, the outer one first.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the edges of a bound do not follow each other, or the bounds make no face.
    pub(crate) fn add_bounded_face(
        &mut self,
        surface: &NurbsSurface,
        kind: SurfaceKind,
        reversed: bool,
        bounds: &[Bound],
        name: String,
        [tolerance, given]: [f64; 2],
    ) -> Result<usize> {
        let mut projector = Projector::new(surface, tolerance)?;
        projector.given = given.max(GIVEN * projector.tolerance());
        let bounds = &self.cut_at_poles(&projector, bounds)?;
        let mut rings = Vec::new();
        let mut closed = Vec::new();
        for bound in bounds {
            let chain = self.chain(&mut projector, bound, reversed)?;
            if chain.uses.is_empty() {
                continue;
            }
            if chain.turns == [0, 0] {
                closed.push((chain, bound.outer));
            } else {
                rings.push(chain);
            }
        }
        let mut outer = join_rings(self, &projector, rings)?;
        let whole = outer.is_empty() && self.needs_whole(&projector, &closed);
        let mut holes = Vec::new();
        if outer.is_empty() && !whole {
            let area = |c: &(Chain, bool)| Area::of(&c.0.uses).signed().abs();
            let best = closed.iter().map(area).enumerate();
            let largest = best.fold((0, -1.0), |a, b| if b.1 > a.1 { b } else { a }).0;
            if largest >= closed.len() {
                return Err(Error::invalid("a face without a boundary"));
            }
            outer.push(closed.remove(largest).0);
        }
        for (chain, _) in closed {
            holes.push(chain);
        }
        let mut loops: Vec<Chain> = Vec::new();
        for chain in outer {
            loops.push(oriented(chain, true));
        }
        for chain in holes {
            loops.push(oriented(chain, false));
        }
        let (surface, loops) = fit_domain(self, &projector, loops, whole)?;
        let [(a, b), (c, d)] = surface.domain();
        let area: f64 = loops.iter().map(|l| Area::of(&l.uses).signed()).sum();
        let trimmed = loops.len() != 1 || area < (1.0 - 1e-7) * (b - a) * (d - c);
        self.add_face(Face {
            surface,
            kind,
            reversed,
            loops,
            trimmed,
            name,
        })
    }

    /// Whether the boundary of the face is that of the surface, and all loops are holes: the surface closes on itself
    /// and no loop goes round a piece of it.
    fn needs_whole(&self, projector: &Projector, loops: &[(Chain, bool)]) -> bool {
        let shut = Side::ALL.into_iter().all(|side| {
            let along = usize::from(side.direction() == Direction::V);
            projector.has_pole(side) || projector.closed[along]
        });
        // A loop with a seam in it is no hole, whichever way it runs.
        let seamed = |c: &Chain| {
            let real = |u: &&EdgeUse| self.edges()[u.edge].curve.is_some();
            let mut edges: Vec<usize> = c.uses.iter().filter(real).map(|u| u.edge).collect();
            edges.sort_unstable();
            edges.windows(2).any(|w| w[0] == w[1])
        };
        let hole = |c: &Chain| !seamed(c) && Area::of(&c.uses).signed() < 0.0;
        loops.is_empty() || (shut && loops.iter().all(|l| hole(&l.0)))
    }

    /// The edges of a bound one after the other in the parameter plane, with degenerate edges at poles.
    fn chain(&mut self, projector: &mut Projector, bound: &Bound, turn: bool) -> Result<Chain> {
        let mut uses = self.uses(projector, bound, turn)?;
        // Not from a pole, if there is another vertex: where the way goes on from there is not known yet.
        let pole = |u: &EdgeUse| projector.pole_at(projector.at(u.ends()[0])).is_some();
        if let Some(first) = uses.iter().position(|u| !pole(u)) {
            uses.rotate_left(first);
        }
        let Some(origin) = uses.first().map(|u| u.ends()[0]) else {
            return Ok(Chain::default());
        };
        let first_edge = uses.first().map_or(usize::MAX, |u| u.edge);
        let (mut chain, mut before) = (Chain::default(), usize::MAX);
        for used in uses {
            if chain.uses.is_empty() {
                before = used.edge;
                chain.uses.push(used);
                continue;
            }
            let (end, start) = (chain.end(), used.ends()[0]);
            let side = projector.pole_at(projector.at(start));
            let shift = match side {
                Some(side) => {
                    let to = pole_way(projector, side, end, start, before == used.edge);
                    self.add_pole(&mut chain, side, end, to)?;
                    to - start
                }
                None => projector.turns(end - start),
            };
            before = used.edge;
            let moved = Chain {
                uses: vec![used],
                turns: [0; 2],
            };
            chain.uses.extend(moved.shifted(shift)?.uses);
            if side.is_none() {
                self.join(projector, &mut chain)?;
            }
        }
        // Back to where it began, or a period away.
        let end = chain.end();
        let mut target = origin + projector.turns(end - origin);
        if let Some(side) = projector.pole_at(projector.at(origin)) {
            target = pole_way(
                projector,
                side,
                end,
                origin,
                first_edge == before && chain.uses.len() >= 2,
            );
            self.add_pole(&mut chain, side, end, target)?;
        } else if let Some(last) = chain.uses.last_mut()
            && meets(projector, end, target)
        {
            set_end(last, true, target)?;
        }
        let turns = ((target - origin) / projector.period()).round();
        #[expect(clippy::cast_possible_truncation, reason = "rounded; a few turns")]
        let turns = [turns.x as i32, turns.y as i32];
        chain.turns = turns;
        Ok(chain)
    }

    /// The edges of a bound with their p-curves, in the order of the loop.
    fn uses(
        &mut self,
        projector: &mut Projector,
        bound: &Bound,
        turn: bool,
    ) -> Result<Vec<EdgeUse>> {
        let mut uses: Vec<EdgeUse> = Vec::new();
        for each in &bound.edges {
            let edge = self.edges().get(each.edge);
            let edge =
                edge.ok_or_else(|| Error::invalid(format!("there is no edge {}", each.edge)))?;
            // Degenerate edges are made anew where the loop needs them.
            let Some(curve) = &edge.curve else {
                continue;
            };
            let given = each
                .pcurve
                .as_ref()
                .map(|p| over(&p.clamped()?, curve.domain()));
            let given = given.and_then(Result::ok);
            let good = given.filter(|p| {
                let outside = leaves(p, projector.surface().domain(), projector.closed);
                !outside && projector.gap(curve, p) <= projector.given
            });
            let (pcurve, note) = match good {
                Some(pcurve) => (pcurve, None),
                None => {
                    let pcurve = projector.pcurve(curve)?;
                    let off = projector.gap(curve, &pcurve);
                    let note = (off > 100.0 * projector.tolerance()).then(|| {
                        format!(
                            "edge {} is {} (in the file's unit) off its surface",
                            each.edge,
                            three_digits(off)
                        )
                    });
                    let wrong = each.pcurve.is_some();
                    let note = note.or_else(|| {
                        wrong.then(|| {
                            format!(
                                "the 2-D curve of edge {} does not match its 3-D curve and was computed again",
                                each.edge
                            )
                        })
                    });
                    (pcurve, note)
                }
            };
            self.notes.extend(note);
            uses.push(EdgeUse {
                edge: each.edge,
                reversed: each.reversed,
                pcurve,
            });
        }
        self.connect(&mut uses)?;
        Ok(if turn {
            Chain {
                uses,
                turns: [0; 2],
            }
            .turned()
            .uses
        } else {
            uses
        })
    }

    /// Turns edges round that are said to run against the loop.
    fn connect(&mut self, uses: &mut [EdgeUse]) -> Result<()> {
        let ends = uses
            .iter()
            .map(|u| self.ends_of(u))
            .collect::<Result<Vec<_>>>()?;
        let meet = |k: usize, flip: bool, at: usize| ends[k][usize::from(flip)] == at;
        if let ([first, second, ..], [used, ..]) = (&ends[..], &mut uses[..])
            && !second.contains(&first[1])
            && second.contains(&first[0])
        {
            used.reversed = !used.reversed;
        }
        let Some(mut at) = uses
            .first()
            .map(|u| self.ends_of(u))
            .transpose()?
            .map(|e| e[1])
        else {
            return Ok(());
        };
        for k in 1..uses.len() {
            let flip = !meet(k, false, at) && meet(k, true, at);
            if flip {
                uses[k].reversed = !uses[k].reversed;
                self.notes.push(format!(
                    "edge {} had the wrong orientation in its loop: it was reversed",
                    uses[k].edge
                ));
            } else if !meet(k, false, at) {
                return Err(Error::invalid(format!(
                    "the edges of a loop do not follow each other: edge {} begins elsewhere",
                    uses[k].edge
                )));
            }
            at = ends[k][usize::from(!flip)];
        }
        Ok(())
    }

    /// Lets the last two p-curves of a chain meet exactly, where that moves them by next to nothing.
    fn join(&mut self, projector: &Projector, chain: &mut Chain) -> Result<()> {
        let [.., before, after] = &mut chain.uses[..] else {
            return Ok(());
        };
        let (end, start) = (before.ends()[1], after.ends()[0]);
        let gap = projector.at(end).distance(projector.at(start));
        if gap > 100.0 * projector.tolerance() {
            self.notes.push(format!(
                "edges {} and {} of a loop do not meet: their 2-D curves are {} (in the file's unit) apart",
                before.edge,
                after.edge,
                three_digits(gap)
            ));
        }
        if meets(projector, end, start) {
            set_end(before, true, start)?;
        }
        Ok(())
    }
}

/// Whether an end may be put where the next p-curve begins: not what meets but for rounding, which stays as the file has
/// it, nor what is further away than p-curves may be from their edges, which it would be then.
fn meets(projector: &Projector, end: DVec2, start: DVec2) -> bool {
    let gap = projector.at(end).distance(projector.at(start));
    gap > 1e-6 * projector.tolerance() && gap <= projector.given
}

/// Sets the (u, v) where the loop enters (or leaves) an edge.
pub(super) fn set_end(used: &mut EdgeUse, leaves: bool, uv: DVec2) -> Result<()> {
    let mut points = used.pcurve.control_points().to_vec();
    let place = if leaves == used.reversed {
        points.first_mut()
    } else {
        points.last_mut()
    };
    if let Some(place) = place {
        *place = uv.extend(0.0);
    }
    let weights = used.pcurve.weights().map(<[f64]>::to_vec);
    used.pcurve = NurbsCurve::new(used.pcurve.knots().clone(), points, weights)?;
    Ok(())
}

fn oriented(chain: Chain, left: bool) -> Chain {
    if (Area::of(&chain.uses).signed() > 0.0) == left {
        chain
    } else {
        chain.turned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::disk_with_hole;
    use glam::DVec3;

    #[test]
    fn a_p_curve_within_what_the_file_states_is_taken() {
        let disk = disk_with_hole([2.0, 1.0], [0.0, 0.5]);
        let face = &disk.faces()[0];
        // Off by 30 tolerances.
        let off = DVec3::new(5e-8, 0.0, 0.0);
        let bounds: Vec<Bound> = (face.loops.iter())
            .map(|each| Bound {
                edges: (each.uses.iter())
                    .map(|used| BoundEdge {
                        edge: used.edge,
                        reversed: used.reversed,
                        pcurve: Some(used.pcurve.map_points(|p| p + off).unwrap()),
                    })
                    .collect(),
                outer: false,
            })
            .collect();
        let size = face
            .surface
            .point(0.9, 0.5)
            .distance(face.surface.point(0.1, 0.5))
            / 0.8;
        let tolerance = 5e-8 * size / 30.0;
        for (given, taken) in [(0.0, false), (40.0 * tolerance, true)] {
            let mut model = disk.clone();
            let added = model.add_bounded_face(
                &face.surface,
                SurfaceKind::BSpline,
                false,
                &bounds,
                String::new(),
                [tolerance, given],
            );
            let loops = &model.faces()[added.unwrap()].loops;
            let same = loops.iter().flat_map(|each| &each.uses).all(|used| {
                let mut all = bounds.iter().flat_map(|bound| &bound.edges);
                all.any(|each| each.pcurve.as_ref() == Some(&used.pcurve))
            });
            assert_eq!(same, taken);
            assert_eq!(model.take_notes().is_empty(), taken);
        }
    }
}

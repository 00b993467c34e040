//! Vertices, edges and loops of a STEP file.

use super::instance::Instance;
use super::place::Geometry;
use super::shape::{Curve, Shape};
use super::topology::Topology;
use crate::boundary::{Bound, BoundEdge};
use glam::DVec3;
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve};
use nurbskin_geometry::unit::three_digits;
use nurbskin_geometry::{Error, Result};

impl Topology<'_, '_, '_> {
    /// Reads a bound of a face; points of vertex loops go to `around`.
    pub(super) fn bound(&mut self, id: u64, around: &mut Vec<DVec3>) -> Result<Bound> {
        let step = self.geometry.step;
        let instance = step.get(id)?;
        if !matches!(instance.name(), "FACE_BOUND" | "FACE_OUTER_BOUND") {
            return Err(instance.error("a FACE_BOUND should be here"));
        }
        let all = instance.all();
        let chain = step.get(all.reference(1)?)?;
        let mut bound = Bound {
            edges: Vec::new(),
            outer: instance.has("FACE_OUTER_BOUND"),
        };
        match chain.name() {
            "EDGE_LOOP" => {
                for edge in chain.all().references(1)? {
                    bound.edges.push(self.oriented_edge(edge)?);
                }
            }
            "VERTEX_LOOP" => {
                let vertex = self.vertex(chain.all().reference(1)?)?;
                around.extend(self.model.vertices().get(vertex));
            }
            "POLY_LOOP" => bound.edges = self.poly_loop(&chain)?,
            name => return Err(chain.error(format_args!("{name} is not read as a loop"))),
        }
        Ok(if all.flag(2)? { bound } else { bound.turned() })
    }

    fn poly_loop(&mut self, chain: &Instance<'_, '_>) -> Result<Vec<BoundEdge>> {
        let points = chain.all().references(1)?;
        let mut corners = points
            .into_iter()
            .map(|p| self.vertex(p))
            .collect::<Result<Vec<_>>>()?;
        corners.dedup();
        if corners.len() < 3 {
            return Err(chain.error("a POLY_LOOP of fewer than three points"));
        }
        let mut edges = Vec::with_capacity(corners.len());
        for k in 0..corners.len() {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            let key = [a.min(b), a.max(b)];
            let edge = match self.straight.get(&key) {
                Some(&edge) => edge,
                None => {
                    let [p, q] =
                        key.map(|v| self.model.vertices().get(v).copied().unwrap_or_default());
                    let line = segment(p, q).map_err(|e| chain.error(e))?;
                    let edge = self.model.add_edge(&line, key[0], key[1])?;
                    self.straight.insert(key, edge);
                    edge
                }
            };
            edges.push(BoundEdge {
                edge,
                reversed: a > b,
                pcurve: None,
            });
        }
        Ok(edges)
    }

    fn oriented_edge(&mut self, id: u64) -> Result<BoundEdge> {
        let step = self.geometry.step;
        let instance = step.get(id)?;
        let all = instance.all();
        match instance.name() {
            "ORIENTED_EDGE" => {
                let inner = all.reference(3)?;
                let same = all.flag(4)?;
                let mut edge = step.deeper(id, || self.oriented_edge(inner))?;
                edge.reversed = edge.reversed == same;
                Ok(edge)
            }
            "EDGE_CURVE" => Ok(BoundEdge {
                edge: self.edge(id, &instance)?,
                reversed: false,
                pcurve: None,
            }),
            name => Err(instance.error(format_args!("{name} is not read as an edge"))),
        }
    }

    fn edge(&mut self, id: u64, instance: &Instance<'_, '_>) -> Result<usize> {
        if let Some(&edge) = self.edges.get(&id) {
            return Ok(edge);
        }
        let all = instance.all();
        let (start, end) = (
            self.vertex(all.reference(1)?)?,
            self.vertex(all.reference(2)?)?,
        );
        let curve = self.geometry.curve(all.reference(3)?)?;
        let curve = if all.flag(4)? { curve } else { curve.turned() };
        let at = |v: usize| self.model.vertices().get(v).copied().unwrap_or_default();
        let off = |p: DVec3| curve.shape.point(curve.shape.parameter(p)).distance(p);
        let worst = off(at(start)).max(off(at(end)));
        if worst > 100.0 * self.geometry.tolerance {
            let worst = three_digits(worst);
            let note = format!("its vertices are {worst} (in the file's unit) from its curve");
            self.losses.warn(instance.error(note));
        }
        let curve = curve
            .between(at(start), at(end), start == end, self.geometry.tolerance)
            .map_err(|e| instance.error(e))?;
        let edge = self.model.add_edge(&curve, start, end)?;
        self.edges.insert(id, edge);
        self.instances.insert(edge, id);
        Ok(edge)
    }

    /// The p-curve that the file gives an edge on a B-spline surface, where both curves are splines over the same
    /// parameters; of a seam the one for this way.
    pub(super) fn pcurve(&self, used: &BoundEdge, surface: u64) -> Option<NurbsCurve> {
        let step = self.geometry.step;
        let edge = step.get(*self.instances.get(&used.edge)?).ok()?;
        if !edge.all().flag(4).ok()? {
            return None;
        }
        let curve = step.get(edge.all().reference(3).ok()?).ok()?;
        if !matches!(
            curve.name(),
            "SURFACE_CURVE" | "SEAM_CURVE" | "INTERSECTION_CURVE"
        ) {
            return None;
        }
        let planar = Geometry {
            planar: true,
            ..*self.geometry
        };
        let on_surface = |id: u64| -> Option<NurbsCurve> {
            let pcurve = step.get(id).ok()?;
            if pcurve.name() != "PCURVE" || pcurve.all().reference(1).ok()? != surface {
                return None;
            }
            let definition = step.get(pcurve.all().reference(2).ok()?).ok()?;
            let [line] = definition.all().references(1).ok()?[..] else {
                return None;
            };
            match planar.curve(line).ok()? {
                Curve {
                    shape: Shape::Spline(line),
                    reversed: false,
                    range: None,
                } => Some(line),
                _ => None,
            }
        };
        let all = curve.all().references(2).ok()?;
        let mut found: Vec<NurbsCurve> = all.into_iter().filter_map(on_surface).collect();
        if used.reversed {
            found.reverse();
        }
        let domain = self.model.edges().get(used.edge)?.curve.as_ref()?.domain();
        found.into_iter().find(|line| line.domain() == domain)
    }

    /// A `VERTEX_POINT`, or a point itself.
    pub(super) fn vertex(&mut self, id: u64) -> Result<usize> {
        if let Some(&vertex) = self.vertices.get(&id) {
            return Ok(vertex);
        }
        let instance = self.geometry.step.get(id)?;
        let point = match instance.name() {
            "VERTEX_POINT" => self.geometry.point(instance.all().reference(1)?)?,
            _ => self.geometry.point(id)?,
        };
        let vertex = self.model.add_vertex(point)?;
        self.vertices.insert(id, vertex);
        Ok(vertex)
    }
}

fn segment(p: DVec3, q: DVec3) -> Result<NurbsCurve> {
    let length = p.distance(q);
    if length == 0.0 {
        return Err(Error::invalid("the edge has no length"));
    }
    NurbsCurve::new(KnotVector::clamped(1, &[0.0, length])?, vec![p, q], None)
}

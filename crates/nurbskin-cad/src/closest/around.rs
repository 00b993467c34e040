//! What lies around a foot: free borders, and normals that tell inside from outside.
//!
//! Faces that share an edge know each other. In files without that, neighbours lie along each other's free edges: they
//! are found by where they are.

use super::{ClosestOnModel, ModelFoot, Place, Workspace};
use crate::model::EdgeUse;
use glam::{DVec2, DVec3};
use nurbskin_geometry::math;
use nurbskin_geometry::nurbs::NurbsCurve;
use nurbskin_geometry::nurbs::closest::Foot;
use std::f64::consts::{PI, TAU};

/// A foot is on an edge, or at a vertex, within this part of the size of its face.
const SAME: f64 = 1e-7;
/// Faces lie along the edge of another within this part of the size of that: as far as systems that do not share edges
/// leave them apart.
const JOINED: f64 = 1e-5;
/// A face that is that near this far inside the edge as well, in parts of the size, lies over the other and does not go
/// on from it.
const INSIDE: f64 = 1e-2;
/// Places of an edge where its neighbour must be.
const PROBES: [f64; 5] = [0.02, 0.3, 0.5, 0.7, 0.98];

/// What a foot lies on.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Element {
    Face(usize),
    Edge(usize),
    Vertex(usize),
}

/// The faces around an element.
#[derive(Clone, Copy, Debug, Default)]
struct Around {
    /// Their outward normals times their angles.
    normal: DVec3,
    /// Whether there is a border beside it without a neighbour.
    free: bool,
    /// Whether there is one with a neighbour that does not share it.
    joined: bool,
}

impl ClosestOnModel<'_> {
    /// Finds the edges with one user that other faces lie along.
    pub(super) fn join(&mut self) {
        let mut workspace = Workspace::default();
        for (edge, users) in self.users.iter().enumerate() {
            let ([used], Some(curve)) = (&users[..], &self.model.edges()[edge].curve) else {
                continue;
            };
            let (a, b) = curve.domain();
            let mut beside = |s: &f64| self.goes_on(*used, curve, a + s * (b - a), &mut workspace);
            self.joined[edge] = PROBES.iter().all(&mut beside);
        }
    }

    /// Whether another face goes on where a face ends at a place of one of its edges.
    fn goes_on(
        &self,
        [f, l, k]: [usize; 3],
        curve: &NurbsCurve,
        t: f64,
        workspace: &mut Workspace,
    ) -> bool {
        let Some(target) = &self.faces[f] else {
            return false;
        };
        let used = &self.model.faces()[f].loops[l].uses[k];
        let reach = JOINED * target.size;
        let mut others = Vec::new();
        let at = curve.point(t);
        self.visit_beside(at, reach, f, workspace, |other, _, _| others.push(other));
        if others.is_empty() {
            return false;
        }
        // The face lies to the left of its loop.
        let place = used.pcurve.point(t);
        let jet = self.model.faces()[f].surface.derivatives(place.x, place.y);
        let along = if used.reversed { -1.0 } else { 1.0 } * curve.derivatives(t)[1];
        let inward = jet.du.cross(jet.dv).cross(along).normalize_or_zero();
        let probe = at + INSIDE * target.size * inward;
        let own = target.closest.nearer(probe, f64::INFINITY, None, workspace);
        let Some(own) = own.foot else {
            return true;
        };
        others.into_iter().any(|other| {
            let Some(Some(other)) = self.faces.get(other) else {
                return false;
            };
            let over = other.closest.nearer(own.point, reach, None, workspace);
            over.foot.is_none_or(|foot| foot.distance > reach)
        })
    }

    /// Visits the faces but one that pass within reach of a place, each with its nearest point.
    fn visit_beside(
        &self,
        place: DVec3,
        reach: f64,
        face: usize,
        workspace: &mut Workspace,
        mut visit: impl FnMut(usize, Foot, Option<(usize, f64)>),
    ) {
        self.visit_near(place, reach, face, |other| {
            if let Some(Some(target)) = self.faces.get(other) {
                let found = target.closest.nearer(place, reach, None, workspace);
                if let Some(foot) = found.foot
                    && foot.distance <= reach
                {
                    visit(other, foot, found.border);
                }
            }
            reach
        });
    }

    /// The foot with its normal outwards, and where it lies.
    pub(super) fn placed(
        &self,
        face: usize,
        mut foot: Foot,
        border: Option<(usize, f64)>,
        workspace: &mut Workspace,
    ) -> ModelFoot {
        let (element, around) = self.around(face, &foot, border);
        let mut normal = around.normal;
        if around.joined {
            let mut seen = vec![element];
            let size = self.faces[face].as_ref().map_or(0.0, |target| target.size);
            let reach = JOINED * size;
            self.visit_beside(foot.point, reach, face, workspace, |other, at, border| {
                let (element, around) = self.around(other, &at, border);
                if !seen.contains(&element) {
                    normal += around.normal;
                    seen.push(element);
                }
            });
        }
        let sum = normal.normalize_or_zero();
        foot.normal = match sum == DVec3::ZERO {
            true => self.outward_of(face, foot.normal),
            false => sum,
        };
        let place = match around.free {
            true => Place::FreeEdge,
            false => Place::Interior,
        };
        ModelFoot { face, foot, place }
    }

    fn outward_of(&self, face: usize, normal: DVec3) -> DVec3 {
        let reversed = self.model.faces()[face].reversed;
        if reversed { -normal } else { normal }
    }

    /// What a foot on a face lies on, and the faces around that.
    fn around(&self, face: usize, foot: &Foot, border: Option<(usize, f64)>) -> (Element, Around) {
        let inside = Around {
            normal: TAU * self.outward_of(face, foot.normal),
            ..Around::default()
        };
        let Some(target) = &self.faces[face] else {
            return (Element::Face(face), inside);
        };
        let on = match border {
            Some((curve, t)) => target.part.border.get(curve).map(|b| (b.edge, t)),
            None if target.closest.on_side(foot) => {
                let place = target.part.region.nearest(DVec2::new(foot.u, foot.v));
                let each = self.model.faces()[face].loops.get(place.loop_index);
                let used = each.and_then(|l| l.uses.get(place.use_index));
                used.map(|used| (used.edge, place.parameter))
            }
            None => None,
        };
        let edges = self.model.edges();
        let found = on.and_then(|(k, t)| Some((k, t, &edges[k], edges[k].curve.as_ref()?)));
        let Some((k, t, edge, curve)) = found else {
            return (Element::Face(face), inside);
        };
        let vertex = [edge.start, edge.end].into_iter().find(|&v| {
            let there = self.model.vertices().get(v);
            there.is_some_and(|p| p.distance(foot.point) <= SAME * target.size)
        });
        match vertex {
            Some(vertex) => (Element::Vertex(vertex), self.around_vertex(vertex)),
            None => (Element::Edge(k), self.around_edge(k, curve, t)),
        }
    }

    fn around_edge(&self, edge: usize, curve: &NurbsCurve, t: f64) -> Around {
        let users = &self.users[edge];
        let normals = users.iter().map(|&at| self.outward(at, curve, t));
        Around {
            normal: PI * normals.sum::<DVec3>(),
            free: users.len() == 1 && !self.joined[edge],
            joined: self.joined[edge],
        }
    }

    /// The outward normal of a face at a place of one of its edges.
    fn outward(&self, [f, l, k]: [usize; 3], curve: &NurbsCurve, t: f64) -> DVec3 {
        let face = &self.model.faces()[f];
        let (a, b) = curve.domain();
        let place = face.loops[l].uses[k].pcurve.point(t.clamp(a, b));
        let at = face.surface.derivatives(place.x, place.y);
        self.outward_of(f, at.du.cross(at.dv).normalize_or_zero())
    }

    fn around_vertex(&self, vertex: usize) -> Around {
        let mut around = Around::default();
        for &at in &self.corners[vertex] {
            if let Some((angle, normal)) = self.corner(at, &mut around) {
                around.normal += angle * normal;
            }
        }
        around
    }

    /// The angle of a face between an edge of a loop and the one before, and its normal between them.
    fn corner(&self, [f, l, k]: [usize; 3], around: &mut Around) -> Option<(f64, DVec3)> {
        let uses = &self.model.faces()[f].loops[l].uses;
        let used = &uses[k];
        let edge = self.model.edges().get(used.edge)?;
        let curve = edge.curve.as_ref()?;
        // Past the pole, if there is one between them.
        let before = (1..=uses.len()).find_map(|back| {
            let used = &uses[(k + uses.len() - back) % uses.len()];
            let edge = self.model.edges().get(used.edge)?;
            edge.curve.as_ref().map(|curve| (used, curve))
        });
        let (other, arriving) = before?;
        for EdgeUse { edge, .. } in [used, other] {
            around.free |= self.users[*edge].len() == 1 && !self.joined[*edge];
            around.joined |= self.joined[*edge];
        }
        let leaving = tangent(curve, used.reversed, true);
        let back = -tangent(arriving, other.reversed, false);
        let (a, b) = curve.domain();
        let t = if used.reversed { b } else { a };
        let normal = self.outward([f, l, k], curve, t);
        let angle = math::angle_between(leaving, back);
        Some((if angle.is_finite() { angle } else { 0.0 }, normal))
    }
}

/// The direction of an edge as its loop runs, where it begins or ends.
fn tangent(curve: &NurbsCurve, reversed: bool, begins: bool) -> DVec3 {
    let (a, b) = curve.domain();
    let t = if begins == reversed { b } else { a };
    let d = curve.derivatives(t)[1];
    if reversed { -d } else { d }
}

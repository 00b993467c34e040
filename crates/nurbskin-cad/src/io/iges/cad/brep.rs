//! Boundary representations: solids (entity 186), shells (514), faces (510), loops (508), edges (504), vertices (502).

use super::super::directory::DirectoryEntry;
use super::carrier::Carrier;
use super::curves::{placed, points_of};
use super::entity::Reader;
use super::lift::paired;
use super::trimmed::reason;
use super::{Got, Miss, Place, leave};
use crate::boundary::{Bound, BoundEdge};
use crate::{Face, Shell, ShellKind};
use nurbskin_geometry::nurbs::sweep::join;
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve};
use nurbskin_geometry::unit::three_digits;
use nurbskin_geometry::{DVec3, Result};
use std::collections::BTreeMap;
use std::rc::Rc;

/// What the faces of one body share: edges and vertices by list and place in it.
#[derive(Default)]
pub(super) struct Body {
    place: Option<Place>,
    edges: BTreeMap<(usize, usize), usize>,
    vertices: BTreeMap<(usize, usize), usize>,
    faces: Vec<usize>,
}

/// An edge of a loop as the file has it.
struct LoopEdge {
    edge: usize,
    reversed: bool,
    /// In the parameter plane of the surface.
    plane: Vec<NurbsCurve>,
}

impl Reader<'_> {
    /// A solid, a shell that stands alone, or a face that does.
    pub(super) fn body(&mut self, place: Place, entry: &Rc<DirectoryEntry>) -> Got<()> {
        let mut body = Body {
            place: Some(place),
            ..Body::default()
        };
        let kind = match entry.entity {
            186 => {
                self.solid(&mut body, place, entry)?;
                ShellKind::Solid
            }
            514 => {
                self.shell(&mut body, place, entry, false)?;
                if entry.form == 2 {
                    ShellKind::Open
                } else {
                    ShellKind::Closed
                }
            }
            _ => {
                let place = place.of_part(None);
                let face = self.brep_face(&mut body, place, entry, false)?;
                self.loose.push(face);
                return Ok(());
            }
        };
        if body.faces.is_empty() {
            return leave("none of its faces could be read");
        }
        let closed = self.file.model.is_closed(&body.faces);
        if kind != ShellKind::Open && !closed {
            self.file.warnings.push(format!(
                "line {} (D{}): the {} has gaps: it was read as an open shell",
                entry.line,
                entry.sequence,
                super::structure::name_of(entry.entity)
            ));
        }
        let kind = if closed { kind } else { ShellKind::Open };
        self.file.model.add_shell(Shell {
            faces: body.faces,
            kind,
        })?;
        Ok(())
    }

    /// Entity 186: shell, its sense, and the shells of voids with theirs.
    fn solid(&mut self, body: &mut Body, place: Place, entry: &Rc<DirectoryEntry>) -> Got<()> {
        let place = place.of_part(self.store.transform(entry)?);
        let mut cursor = self.cursor(entry)?;
        let mut shells = vec![(cursor.pointer(), cursor.integer() == 0)];
        for _ in 0..cursor.count(2, self)? {
            shells.push((cursor.pointer(), cursor.integer() == 0));
        }
        self.see_name(entry, &cursor.properties())?;
        for (at, against) in shells {
            let shell = self.entry(entry, at, "shell")?;
            if shell.entity != 514 {
                return leave(format!("its shell is an entity {}, not 514", shell.entity));
            }
            self.inside(entry, |this| this.shell(body, place, &shell, against))?;
        }
        Ok(())
    }

    /// Entity 514: faces and whether the shell has their sense.
    fn shell(
        &mut self,
        body: &mut Body,
        place: Place,
        entry: &Rc<DirectoryEntry>,
        against: bool,
    ) -> Got<()> {
        let place = place.of_part(self.store.transform(entry)?);
        let mut cursor = self.cursor(entry)?;
        let mut faces = Vec::new();
        for _ in 0..cursor.count(2, self)? {
            faces.push((cursor.pointer(), cursor.integer() == 0));
        }
        self.see_name(entry, &cursor.properties())?;
        for (at, turned) in faces {
            let face = self.entry(entry, at, "face")?;
            if face.entity != 510 {
                return leave(format!("its face is an entity {}, not 510", face.entity));
            }
            match reason(self.brep_face(body, place, &face, turned != against))? {
                Ok(made) => body.faces.push(made),
                Err(why) => self.leave(&face, &why),
            }
        }
        Ok(())
    }

    /// Names the model after its first body, if the file has no name for it.
    fn see_name(&mut self, entry: &DirectoryEntry, properties: &[usize]) -> Got<()> {
        let name = self.name(entry, properties)?;
        if self.file.model.name.is_empty() {
            self.file.model.name = name;
        }
        Ok(())
    }

    /// Entity 510: surface, loops, whether the first of them is the outer one.
    fn brep_face(
        &mut self,
        body: &mut Body,
        place: Place,
        entry: &Rc<DirectoryEntry>,
        turned: bool,
    ) -> Got<usize> {
        let place = place.of_part(self.store.transform(entry)?);
        body.place = Some(place);
        let mut cursor = self.cursor(entry)?;
        let surface = cursor.pointer();
        let count = cursor.count(1, self)?;
        let first_is_outer = cursor.integer() != 0;
        let pointers: Vec<usize> = (0..count).map(|_| cursor.pointer()).collect();
        let name = self.name(entry, &cursor.properties())?;
        let carrier = self.carrier(entry, surface)?;
        let mut loops = Vec::with_capacity(count);
        for at in pointers {
            let edges = self.edges_of_loop(body, entry, at)?;
            if !edges.is_empty() {
                loops.push(edges);
            }
        }
        // 1. The surface, as far as the edges reach.
        let model = &self.file.model;
        let edges = loops.iter().flatten();
        let edges = edges.flat_map(|used| model.pieces_of(used.edge));
        let curves = edges.filter_map(|edge| model.edges().get(edge)?.curve.as_ref());
        let mut hull: Vec<DVec3> = curves
            .flat_map(NurbsCurve::control_points)
            .copied()
            .collect();
        let realised = carrier.realise(place, &hull)?;
        self.spend(realised.control_points().points().len() + hull.len())?;
        if hull.is_empty() {
            hull.extend(realised.control_points().points());
        }
        let [low, high] = nurbskin_geometry::point_grid::bounding_box(&hull);
        let tolerance = self.tolerance(low.distance(high));
        let reversed = turned != place.mirrors();
        let kind = carrier.kind();
        self.see_colour(entry)?;
        // 2. Loops; without any, the edge of the surface.
        if loops.is_empty() {
            let surface = crate::clamped(&realised)?;
            let model = &mut self.file.model;
            let around = model.whole_loop(&surface, tolerance)?;
            return Ok(model.add_face(Face {
                surface,
                kind,
                reversed,
                loops: vec![around],
                trimmed: false,
                name,
            })?);
        }
        let mut bounds = Vec::with_capacity(loops.len());
        for (k, edges) in loops.into_iter().enumerate() {
            let mut made = Vec::with_capacity(edges.len());
            for used in edges {
                made.push(self.bound_edge(place, &carrier, &realised, used, tolerance)?);
            }
            // A loop has the face to its left seen from the side of the surface's normal, a bound from outside.
            let bound = Bound {
                edges: made,
                outer: first_is_outer && k == 0,
            };
            bounds.push(if reversed { bound.turned() } else { bound });
        }
        let model = &mut self.file.model;
        let added =
            model.add_bounded_face(&realised, kind, reversed, &bounds, name, [tolerance, 0.0]);
        self.take_notes(entry);
        Ok(added?)
    }

    fn bound_edge(
        &mut self,
        place: Place,
        carrier: &Carrier,
        surface: &nurbskin_geometry::nurbs::NurbsSurface,
        used: LoopEdge,
        tolerance: f64,
    ) -> Got<BoundEdge> {
        let own = matches!(carrier, Carrier::Net { own_parameters, .. } if *own_parameters);
        let edges = self.file.model.edges();
        let curve = edges.get(used.edge).and_then(|edge| edge.curve.as_ref());
        let mut pcurve = None;
        if let Some(curve) = curve {
            pcurve = carrier.pcurve(place, curve);
            if own && !used.plane.is_empty() {
                let (found, off) = paired(surface, &join(&used.plane)?, curve)?;
                pcurve = (off <= tolerance).then_some(found);
            }
        }
        Ok(BoundEdge {
            edge: used.edge,
            reversed: used.reversed,
            pcurve,
        })
    }

    /// Entity 508: of each edge whether it is a vertex, its list and place there, its sense, its curves in the
    /// parameter plane. Vertices are poles of the surface, which are found again without them.
    fn edges_of_loop(
        &mut self,
        body: &mut Body,
        from: &Rc<DirectoryEntry>,
        at: usize,
    ) -> Got<Vec<LoopEdge>> {
        let entry = self.entry(from, at, "loop")?;
        if entry.entity != 508 {
            return leave(format!("its loop is an entity {}, not 508", entry.entity));
        }
        let mut cursor = self.cursor(&entry)?;
        let mut edges = Vec::new();
        for _ in 0..cursor.count(5, self)? {
            let vertex = cursor.integer() == 1;
            let key = (cursor.pointer(), cursor.pointer());
            let reversed = cursor.integer() == 0;
            let mut plane = Vec::new();
            for _ in 0..cursor.count(2, self)? {
                let _iso = cursor.integer();
                let chain = self.chain(&entry, cursor.pointer())?;
                self.spend(points_of(&chain))?;
                plane.extend(chain.iter().cloned());
            }
            if vertex {
                self.entry(&entry, key.0, "list of vertices")?;
                continue;
            }
            if let Some(edge) = self.brep_edge(body, &entry, key)? {
                edges.push(LoopEdge {
                    edge,
                    reversed,
                    plane,
                });
            }
        }
        Ok(edges)
    }

    /// An edge of entity 504: curve, list and place of its start, list and place of its end. `None` for one without
    /// length.
    fn brep_edge(
        &mut self,
        body: &mut Body,
        from: &Rc<DirectoryEntry>,
        key: (usize, usize),
    ) -> Got<Option<usize>> {
        if let Some(&known) = body.edges.get(&key) {
            return Ok(Some(known));
        }
        let list = self.entry(from, key.0, "list of edges")?;
        if list.entity != 504 {
            return leave(format!(
                "its edges are in an entity {}, not 504",
                list.entity
            ));
        }
        let mut cursor = self.cursor(&list)?;
        let count = cursor.count(5, self)?;
        if key.1 == 0 || key.1 > count {
            return Err(self.no_such(from, key, count));
        }
        cursor.skip(5 * (key.1 - 1));
        let curve = cursor.pointer();
        let start = (cursor.pointer(), cursor.pointer());
        let end = (cursor.pointer(), cursor.pointer());
        let start = self.brep_vertex(body, &list, start)?;
        let end = self.brep_vertex(body, &list, end)?;
        let place = body.place.unwrap_or_else(|| self.place());
        let curve = self.curve(&list, curve)?;
        let curve = placed(std::slice::from_ref(&curve), place)?.remove(0);
        self.spend(curve.control_points().len())?;
        let [low, high] = nurbskin_geometry::point_grid::bounding_box(curve.control_points());
        let size = low.distance(high);
        let [from, to] = [start, end].map(|v| self.file.model.vertices()[v]);
        if start == end && size <= self.tolerance(size) {
            return Ok(None);
        }
        let curve = fitted(curve, [from, to], size)?;
        let edge = self.file.model.add_edge(&curve, start, end)?;
        body.edges.insert(key, edge);
        Ok(Some(edge))
    }

    /// A vertex of entity 502.
    fn brep_vertex(
        &mut self,
        body: &mut Body,
        from: &Rc<DirectoryEntry>,
        key: (usize, usize),
    ) -> Got<usize> {
        if let Some(&known) = body.vertices.get(&key) {
            return Ok(known);
        }
        let list = self.entry(from, key.0, "list of vertices")?;
        if list.entity != 502 {
            return leave(format!(
                "its vertices are in an entity {}, not 502",
                list.entity
            ));
        }
        let points = self.once(
            &list,
            |this| &mut this.vertices,
            |this, entry| {
                let transform = this.store.transform(entry)?;
                let mut fields = this.store.fields(entry)?;
                let count = fields.count("vertices")?;
                let points = fields.points(count, "vertices")?.into_iter();
                let points = points.map(|p| transform.map_or(p, |t| t.apply(p)));
                Ok(Rc::new(points.collect()))
            },
        )?;
        let Some(&point) = key.1.checked_sub(1).and_then(|k| points.get(k)) else {
            return Err(self.no_such(from, key, points.len()));
        };
        let place = body.place.unwrap_or_else(|| self.place());
        let vertex = self.file.model.add_vertex(place.apply(point))?;
        body.vertices.insert(key, vertex);
        Ok(vertex)
    }

    fn no_such(&self, from: &DirectoryEntry, key: (usize, usize), count: usize) -> Miss {
        Miss::Refuse(from.refuse(
            self.store.path,
            format!(
                "it refers to item {} of the list at D{}, which has only {count}",
                key.1, key.0
            ),
        ))
    }
}

/// The curve from vertex to vertex. A straight line is made anew where it only leads there; another one is turned round
/// where it runs the other way.
fn fitted(curve: NurbsCurve, [from, to]: [DVec3; 2], size: f64) -> Got<NurbsCurve> {
    let (a, b) = curve.domain();
    let ends = [curve.point(a), curve.point(b)];
    let apart = |ends: [DVec3; 2]| ends[0].distance(from).max(ends[1].distance(to));
    let back = apart([ends[1], ends[0]]);
    let curve = if back < apart(ends) && back < 1e-3 * size {
        curve.reversed()?
    } else {
        curve
    };
    let reach = apart(ends).min(back);
    if reach <= 1e-3 * size {
        return Ok(curve);
    }
    let straight = curve.knots().degree() == 1 && curve.control_points().len() == 2;
    let direction = (ends[1] - ends[0]).normalize_or_zero();
    let aside = |p: DVec3| (p - ends[0]).reject_from_normalized(direction).length();
    if straight && direction != DVec3::ZERO && aside(from).max(aside(to)) <= 1e-3 * size {
        let knots = KnotVector::uniform(1, 2)?;
        let line: Result<NurbsCurve> = NurbsCurve::new(knots, vec![from, to], None);
        return Ok(line?);
    }
    leave(format!(
        "an edge ends {} (in the file's unit) from its vertices",
        three_digits(reach)
    ))
}

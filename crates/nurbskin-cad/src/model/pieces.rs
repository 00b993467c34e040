//! Models put together and moved, edges cut in two, and what no face uses left out.

use super::{Edge, EdgeUse, Model};
use glam::{DAffine3, DVec3};
use nurbskin_geometry::nurbs::NurbsCurve;
use nurbskin_geometry::{Error, Result, Unit};

impl Model {
    /// Adds all that another model holds, in the unit of this one.
    pub(crate) fn append(&mut self, other: Self) -> Result<()> {
        let other = other.in_unit(self.unit)?;
        let (vertices, edges, faces) = (self.vertices.len(), self.edges.len(), self.faces.len());
        self.vertices.extend(other.vertices);
        self.edges.extend(other.edges.into_iter().map(|e| Edge {
            start: e.start + vertices,
            end: e.end + vertices,
            ..e
        }));
        self.faces.extend(other.faces.into_iter().map(|mut face| {
            let uses = face.loops.iter_mut().flat_map(|l| &mut l.uses);
            uses.for_each(|u| u.edge += edges);
            face
        }));
        self.shells
            .extend(other.shells.into_iter().map(|mut shell| {
                shell.faces.iter_mut().for_each(|f| *f += faces);
                shell
            }));
        self.notes.extend(other.notes);
        Ok(())
    }

    /// The model with every length multiplied by the ratio of its unit to `unit`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if that leads out of the range of numbers.
    pub fn in_unit(mut self, unit: Unit) -> Result<Self> {
        let factor = self.unit.millimetres() / unit.millimetres();
        if self.unit != unit {
            self = self.map_points(|p| p * factor)?;
            self.unit = unit;
        }
        Ok(self)
    }

    /// The model with every point moved by `f`, which should be affine.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a point is no longer finite.
    pub fn map_points(mut self, f: impl Fn(DVec3) -> DVec3) -> Result<Self> {
        for vertex in &mut self.vertices {
            *vertex = f(*vertex);
            if !vertex.is_finite() {
                return Err(Error::invalid(
                    "a vertex leads to numbers that are too large",
                ));
            }
        }
        for curve in self.edges.iter_mut().filter_map(|edge| edge.curve.as_mut()) {
            *curve = curve.map_points(&f)?;
        }
        for face in &mut self.faces {
            face.surface = face.surface.map_points(&f)?;
        }
        Ok(self)
    }

    /// The model moved by an affine map. One that mirrors turns the faces over, so that their outward sides stay outward.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a point is no longer finite, or the map has no inverse.
    pub(crate) fn placed(self, way: &DAffine3) -> Result<Self> {
        if *way == DAffine3::IDENTITY {
            return Ok(self);
        }
        let volume = way.matrix3.determinant();
        if !(volume.is_finite() && volume != 0.0) {
            return Err(Error::invalid("a placement that flattens the part"));
        }
        let mut model = self.map_points(|p| way.transform_point3(p))?;
        if volume < 0.0 {
            for face in &mut model.faces {
                face.reversed = !face.reversed;
            }
        }
        Ok(model)
    }

    /// The edge, and what was cut off it, in the order of its curve.
    pub(crate) fn pieces_of(&self, edge: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(edge), |at| self.cut.get(at).copied())
    }

    /// Cuts an edge at a parameter inside its domain: it keeps the part before, and a new one has the rest. Faces that have
    /// it get both.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is no such edge, or the parameter is not inside.
    pub(crate) fn cut_edge(&mut self, edge: usize, t: f64) -> Result<()> {
        let whole = self.edges.get(edge).cloned();
        let Some(Edge {
            curve: Some(curve),
            start,
            end,
        }) = whole
        else {
            return Err(Error::invalid(format!("there is no edge {edge} to cut")));
        };
        let (a, b) = curve.domain();
        let halves = |c: &NurbsCurve| -> Result<[NurbsCurve; 2]> {
            Ok([c.segment(a, t)?, c.segment(t, b)?])
        };
        let [before, after] = halves(&curve)?;
        let middle = self.add_vertex(curve.point(t))?;
        let rest = self.push_edge(Edge {
            curve: Some(after),
            start: middle,
            end,
        })?;
        if let Some(place) = self.edges.get_mut(edge) {
            *place = Edge {
                curve: Some(before),
                start,
                end: middle,
            };
        }
        if let Some(next) = self.cut.insert(edge, rest) {
            self.cut.insert(rest, next);
        }
        for each in self.faces.iter_mut().flat_map(|f| &mut f.loops) {
            if !each.uses.iter().any(|used| used.edge == edge) {
                continue;
            }
            let mut uses = Vec::with_capacity(each.uses.len() + 1);
            for used in each.uses.drain(..) {
                if used.edge != edge {
                    uses.push(used);
                    continue;
                }
                let [before, after] = halves(&used.pcurve)?;
                let part = |edge, pcurve| EdgeUse {
                    edge,
                    reversed: used.reversed,
                    pcurve,
                };
                let mut both = [part(edge, before), part(rest, after)];
                if used.reversed {
                    both.reverse();
                }
                uses.extend(both);
            }
            each.uses = uses;
        }
        Ok(())
    }

    /// Leaves out the vertices and edges that no face uses, and numbers the others anew.
    pub(crate) fn drop_unused(&mut self) {
        self.cut.clear();
        let mut used = vec![false; self.edges.len()];
        let uses = self.faces.iter().flat_map(|f| &f.loops);
        for each in uses.flat_map(|l| &l.uses) {
            used[each.edge] = true;
        }
        let mut standing = vec![false; self.vertices.len()];
        for (edge, _) in self.edges.iter().zip(&used).filter(|(_, used)| **used) {
            standing[edge.start] = true;
            standing[edge.end] = true;
        }
        let numbers = |kept: &[bool]| -> Vec<usize> {
            let counts = kept.iter().scan(0, |next, &kept| {
                let number = *next;
                *next += usize::from(kept);
                Some(number)
            });
            counts.collect()
        };
        let (edges, vertices) = (numbers(&used), numbers(&standing));
        let mut keep = used.iter();
        self.edges.retain(|_| keep.next() == Some(&true));
        let mut keep = standing.iter();
        self.vertices.retain(|_| keep.next() == Some(&true));
        for edge in &mut self.edges {
            edge.start = vertices[edge.start];
            edge.end = vertices[edge.end];
        }
        let uses = self.faces.iter_mut().flat_map(|f| &mut f.loops);
        for each in uses.flat_map(|l| &mut l.uses) {
            each.edge = edges[each.edge];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mass;
    use glam::DMat3;
    use nurbskin_geometry::nurbs::conic;

    fn ball() -> Model {
        let mut model = Model::default();
        let ball = conic::sphere(DVec3::X, 2.0).unwrap();
        // What nothing uses, before and behind.
        model.add_vertex(DVec3::ONE).unwrap();
        model.add_degenerate_edge(0).unwrap();
        let face = model.add_whole_surface(&ball, 1e-9).unwrap();
        model.add_shell_of(face).unwrap();
        model.add_degenerate_edge(0).unwrap();
        model
    }

    #[test]
    fn what_no_face_uses_is_left_out() {
        let mut model = ball();
        model.drop_unused();
        assert_eq!((model.vertices().len(), model.edges().len()), (2, 3));
        assert!(model.is_closed(&[0]));
        let same = model.clone();
        model.drop_unused();
        assert_eq!(model, same);
    }

    /// Scaled by (1, 2, -3): volume by 6, and positive still.
    #[test]
    fn mirrored_models_keep_their_outward_side() {
        let way = DAffine3::from_mat3_translation(
            DMat3::from_diagonal(DVec3::new(1.0, 2.0, -3.0)),
            DVec3::Y,
        );
        let moved = ball().placed(&way).unwrap();
        let [before, after] = [ball(), moved].map(|m| mass(&m).unwrap().volume.unwrap());
        assert!((after / before - 6.0).abs() < 1e-9);
        let flat = DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0));
        assert!(ball().placed(&flat).is_err());
    }

    #[test]
    fn cut_edges_leave_faces_closed() {
        let mut model = ball();
        let (seam, edge) = model
            .edges()
            .iter()
            .enumerate()
            .find(|e| e.1.curve.is_some())
            .unwrap();
        let (a, b) = edge.curve.as_ref().unwrap().domain();
        model.cut_edge(seam, a + 0.3 * (b - a)).unwrap();
        model.cut_edge(seam, a + 0.1 * (b - a)).unwrap();
        assert_eq!(model.pieces_of(seam).count(), 3);
        let last = model.pieces_of(seam).last().unwrap();
        let end = model.edges()[last].curve.as_ref().unwrap().domain().1;
        assert!((end - b).abs() <= 0.0);
        assert!(model.is_closed(&[0]));
        let face = model.faces()[0].clone();
        assert_eq!(face.loops[0].uses.len(), 4 + 2 * 2);
        model.add_face(face).unwrap();
        assert!(model.cut_edge(99, 0.5).is_err());
    }
}

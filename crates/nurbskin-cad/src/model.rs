//! Vertices, edges, loops, faces and shells, by index.

use glam::{DVec2, DVec3};
use nurbskin_geometry::nurbs::{NurbsCurve, NurbsSurface};
use nurbskin_geometry::{Error, Result, Unit};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

mod pieces;
mod stored;

/// A boundary representation: faces that share edges that share vertices.
///
/// Indices lead from shells to faces to edges to vertices; what is added must refer to what is there already, so that
/// every model is sound in structure. How well its geometry fits together is measured by `cad::check`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "stored::Stored")]
pub struct Model {
    /// Name of the part, possibly empty.
    pub name: String,
    /// Unit of all lengths.
    pub unit: Unit,
    /// Colour of all faces: red, green, blue, 0 to 255 each.
    pub colour: Option<[u8; 3]>,
    vertices: Vec<DVec3>,
    edges: Vec<Edge>,
    faces: Vec<Face>,
    shells: Vec<Shell>,
    /// What was repaired when faces were added, a sentence each; readers take it out.
    pub(super) notes: Vec<String>,
    /// Edges that were cut, and the next piece of each.
    cut: BTreeMap<usize, usize>,
}

/// A piece of a curve between two vertices.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Edge {
    /// The curve, clamped, from start to end over its whole domain; `None` for a degenerate edge, the pole of a
    /// surface, which begins and ends at one vertex.
    pub curve: Option<NurbsCurve>,
    /// Index of the vertex at its start.
    pub start: usize,
    /// Index of the vertex at its end: the start, if the edge closes.
    pub end: usize,
}

/// An edge as part of a loop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EdgeUse {
    /// Index of the edge.
    pub edge: usize,
    /// Whether the loop runs from the edge's end to its start.
    pub reversed: bool,
    /// The edge in the parameter plane of the face, clamped, with z = 0. It runs as the edge does, whatever `reversed`
    /// says, and over the same parameters as the edge's curve, where there is one.
    pub pcurve: NurbsCurve,
}

impl EdgeUse {
    /// (u, v) where the loop enters the edge and where it leaves it.
    #[must_use]
    pub fn ends(&self) -> [DVec2; 2] {
        let points = self.pcurve.control_points();
        let at = |p: Option<&DVec3>| p.map_or(DVec2::ZERO, |p| p.truncate());
        let ends = [at(points.first()), at(points.last())];
        if self.reversed {
            [ends[1], ends[0]]
        } else {
            ends
        }
    }
}

/// A closed chain of edges. The face lies to its left in the (u, v) plane, u to the right and v up.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Loop {
    /// The edges, each beginning at the vertex and at the (u, v) where the one before ends, the first where the last
    /// ends.
    pub uses: Vec<EdgeUse>,
}

/// What a surface was in the file that it was read from. All are kept as NURBS, exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SurfaceKind {
    /// A B-spline or NURBS surface.
    #[default]
    BSpline,
    /// A plane.
    Plane,
    /// A circular cylinder.
    Cylinder,
    /// A circular cone.
    Cone,
    /// A sphere.
    Sphere,
    /// A torus.
    Torus,
    /// A profile turned around an axis.
    Revolution,
    /// A profile moved along a line.
    Extrusion,
    /// A surface ruled between two curves.
    Ruled,
    /// A parametric spline surface (IGES 114).
    ParametricSpline,
}

/// A part of a surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Face {
    /// The surface, clamped in both directions.
    pub surface: NurbsSurface,
    /// What it was in its file.
    pub kind: SurfaceKind,
    /// Whether the face's outward side is that of -(`S_u` x `S_v`).
    pub reversed: bool,
    /// The outer loop first, then the holes. All of them lie in the domain of the surface and have the face to their
    /// left, whatever `reversed` says.
    pub loops: Vec<Loop>,
    /// Whether the loops take only a part of the surface.
    pub trimmed: bool,
    /// Possibly empty.
    pub name: String,
}

/// What faces together are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ShellKind {
    /// A sheet with free edges.
    #[default]
    Open,
    /// A closed skin: every edge is used twice.
    Closed,
    /// The volume inside a closed skin whose faces have it behind them.
    Solid,
}

/// Faces that belong together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Shell {
    /// Indices of the faces.
    pub faces: Vec<usize>,
    /// What they are.
    pub kind: ShellKind,
}

impl Model {
    /// A model of nothing yet, in millimetres.
    #[must_use]
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            ..Self::default()
        }
    }

    /// The vertices.
    #[must_use]
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }
    /// The edges.
    #[must_use]
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }
    /// The faces.
    #[must_use]
    pub fn faces(&self) -> &[Face] {
        &self.faces
    }
    /// The shells. A face may belong to none.
    #[must_use]
    pub fn shells(&self) -> &[Shell] {
        &self.shells
    }

    /// Takes what was repaired when faces were added, a sentence each.
    pub(crate) fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Adds a vertex and tells its index.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is not finite.
    pub fn add_vertex(&mut self, point: DVec3) -> Result<usize> {
        if !point.is_finite() {
            return Err(Error::invalid(format!("the vertex {point} is not finite")));
        }
        self.vertices.push(point);
        Ok(self.vertices.len() - 1)
    }

    /// Adds an edge along a curve, which is clamped if it is not, and tells its index.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a vertex does not exist.
    pub fn add_edge(&mut self, curve: &NurbsCurve, start: usize, end: usize) -> Result<usize> {
        let curve = Some(curve.clamped()?);
        self.push_edge(Edge { curve, start, end })
    }

    /// Adds a degenerate edge, the pole of a surface, and tells its index.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the vertex does not exist.
    pub fn add_degenerate_edge(&mut self, vertex: usize) -> Result<usize> {
        self.push_edge(Edge {
            curve: None,
            start: vertex,
            end: vertex,
        })
    }

    fn push_edge(&mut self, edge: Edge) -> Result<usize> {
        for vertex in [edge.start, edge.end] {
            if vertex >= self.vertices.len() {
                return Err(Error::invalid(format!(
                    "an edge at vertex {vertex} of {}",
                    self.vertices.len()
                )));
            }
        }
        self.edges.push(edge);
        Ok(self.edges.len() - 1)
    }

    /// Adds a face, its surface clamped if it is not, and tells its index.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a loop is empty, names an edge that does not exist, or has edges that do not follow each
    /// other from vertex to vertex; if a p-curve is not clamped or not over its edge's parameters.
    pub fn add_face(&mut self, face: Face) -> Result<usize> {
        let Face { surface, loops, .. } = &face;
        for each in loops {
            self.check_loop(each)?;
        }
        let clamped = [surface.knots_u(), surface.knots_v()]
            .iter()
            .all(|knots| knots.is_clamped() && !knots.is_periodic());
        let face = if clamped {
            face
        } else {
            Face {
                surface: super::natural::clamped(surface)?,
                ..face
            }
        };
        self.faces.push(face);
        Ok(self.faces.len() - 1)
    }

    /// Turns a face over: its outward side becomes the other one.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it does not exist, or is in a closed shell with others.
    pub fn turn_face(&mut self, face: usize) -> Result<()> {
        let in_shell =
            |s: &&Shell| s.kind != ShellKind::Open && s.faces.len() > 1 && s.faces.contains(&face);
        if self.shells.iter().any(|s| in_shell(&s)) {
            return Err(Error::invalid(format!(
                "face {face} is one of a closed shell's"
            )));
        }
        let count = self.faces.len();
        let face = self
            .faces
            .get_mut(face)
            .ok_or_else(|| Error::invalid(format!("face {face} of {count}")))?;
        face.reversed = !face.reversed;
        Ok(())
    }

    fn check_loop(&self, each: &Loop) -> Result<()> {
        let Some(last) = each.uses.last() else {
            return Err(Error::invalid("a loop without edges"));
        };
        let mut at = self.ends_of(last)?[1];
        for used in &each.uses {
            let [from, to] = self.ends_of(used)?;
            if from != at {
                return Err(Error::invalid(format!(
                    "edge {} begins at vertex {from}, and the edge before it in its loop ends at vertex {at}",
                    used.edge
                )));
            }
            at = to;
            let knots = used.pcurve.knots();
            let curve = self.edges[used.edge].curve.as_ref();
            let same = curve.is_none_or(|curve| curve.domain() == used.pcurve.domain());
            if !knots.is_clamped() || knots.is_periodic() || !same {
                return Err(Error::invalid(format!(
                    "the p-curve of edge {} is not clamped, or over other parameters than its curve",
                    used.edge
                )));
            }
        }
        Ok(())
    }

    /// The vertices at which a loop enters and leaves an edge.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the edge does not exist.
    pub fn ends_of(&self, used: &EdgeUse) -> Result<[usize; 2]> {
        let edge = self
            .edges
            .get(used.edge)
            .ok_or_else(|| Error::invalid(format!("edge {} of {}", used.edge, self.edges.len())))?;
        Ok(if used.reversed {
            [edge.end, edge.start]
        } else {
            [edge.start, edge.end]
        })
    }

    /// Adds a shell and tells its index.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it has no faces, one that does not exist, one twice or one of another shell; or if it is
    /// said to be closed and an edge is not used twice, once in each direction.
    pub fn add_shell(&mut self, shell: Shell) -> Result<usize> {
        let mut taken = vec![false; self.faces.len()];
        for &face in self.shells.iter().flat_map(|s| &s.faces) {
            taken[face] = true;
        }
        for &face in &shell.faces {
            match taken.get_mut(face) {
                Some(taken) if !*taken => *taken = true,
                _ => {
                    return Err(Error::invalid(format!(
                        "face {face} of a shell does not exist, or is in a shell already"
                    )));
                }
            }
        }
        if shell.faces.is_empty() {
            return Err(Error::invalid("a shell without faces"));
        }
        if shell.kind != ShellKind::Open && !self.is_closed(&shell.faces) {
            return Err(Error::invalid(
                "a shell that is said to be closed has a free edge, or neighbours that face opposite ways",
            ));
        }
        self.shells.push(shell);
        Ok(self.shells.len() - 1)
    }

    /// Whether every edge of these faces is used twice by them, once in each direction seen from outside. Degenerate
    /// edges do not count.
    #[must_use]
    pub fn is_closed(&self, faces: &[usize]) -> bool {
        let mut uses = vec![[0_u32; 2]; self.edges.len()];
        for face in faces.iter().filter_map(|&face| self.faces.get(face)) {
            for used in face.loops.iter().flat_map(|l| &l.uses) {
                uses[used.edge][usize::from(used.reversed != face.reversed)] += 1;
            }
        }
        let real = self
            .edges
            .iter()
            .zip(&uses)
            .filter(|(e, _)| e.curve.is_some());
        let mut used = real.map(|(_, uses)| *uses).filter(|uses| *uses != [0, 0]);
        let bounded = faces
            .iter()
            .all(|&f| self.faces.get(f).is_some_and(|f| !f.loops.is_empty()));
        bounded && used.all(|uses| uses == [1, 1])
    }
}

//! Quad layouts: the division of a mesh into four-sided faces.
//!
//! [`Layout`] is the seam between the producers of layouts and the fit. Any producer will do whose layouts pass
//! [`Layout::validate`].

mod aligned;
mod arcs;
mod cells;
mod collapse;
pub mod field;
mod flatten;
mod grow;
pub mod lines;
mod outlines;
mod parity;
mod patterns;
mod produce;
mod quads;
mod surface;
mod tidy;
mod validate;

pub use produce::{CellShape, FaceSplit, LayoutOptions, Producer, Seeds, layout};

use glam::DVec3;
use nurbskin_scan::mesh::manifold::NONE;

#[cfg(test)]
mod tests;

/// A division of a mesh into four-sided faces, with a first parameter for each vertex of the mesh.
///
/// Corners of a face are counter-clockwise seen from outside, at (u, v) = (0, 0), (1, 0), (1, 1), (0, 1).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layout {
    /// First places of the vertices of the layout, in the unit of the mesh.
    pub vertices: Vec<DVec3>,
    /// The edges: each belongs to one face (open) or two.
    pub edges: Vec<LayoutEdge>,
    /// The faces.
    pub faces: Vec<LayoutFace>,
    /// For each vertex of the mesh where it lies on the layout.
    pub start: Vec<OnFace>,
    /// The vertices of the mesh on sharp and open lines.
    pub on_lines: Vec<OnLine>,
}

/// An edge of a layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayoutEdge {
    /// The vertices at t = 0 and t = 1. They differ.
    pub ends: [u32; 2],
    /// What the surface does here.
    pub kind: EdgeKind,
    /// The sharp or open line that this edge is a piece of: edges with the same number follow each other without a
    /// kink. `None` for smooth edges.
    pub line: Option<u32>,
}

/// What the surface does at an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EdgeKind {
    /// The two faces share the normal.
    Smooth,
    /// A feature line: the two faces meet at an angle.
    Sharp,
    /// A border: there is one face.
    Open,
}

impl EdgeKind {
    /// Whether the two sides need not share their normal: sharp or open.
    #[must_use]
    pub fn is_hard(self) -> bool {
        self != Self::Smooth
    }
}

/// A four-sided face of a layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayoutFace {
    /// The vertices at (0, 0), (1, 0), (1, 1) and (0, 1): four different ones.
    pub corners: [u32; 4],
    /// The sides v = 0, u = 1, v = 1 and u = 0, each in the direction in which its parameter increases: from corner 0
    /// to 1, 1 to 2, 3 to 2 and 0 to 3.
    pub sides: [Side; 4],
}

/// The corners at which the four sides of a face begin and end.
pub const SIDE_CORNERS: [[usize; 2]; 4] = [[0, 1], [1, 2], [3, 2], [0, 3]];

/// A side of a face: an edge, in its direction or against it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Side {
    /// Index of the edge.
    pub edge: u32,
    /// Whether the parameter of the side runs against that of the edge: t = 1 - u (or 1 - v).
    pub reversed: bool,
}

/// A place on a face.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OnFace {
    /// Index of the face.
    pub face: u32,
    /// 0 to 1.
    pub u: f64,
    /// 0 to 1.
    pub v: f64,
}

/// A vertex of the mesh on a sharp or open line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnLine {
    /// Index of the vertex of the mesh.
    pub vertex: u32,
    /// Index of the edge of the layout.
    pub edge: u32,
    /// First parameter on the edge, 0 to 1.
    pub t: f64,
}

//! The producer of layouts: cells, collapse of short arcs, split.

use super::arcs::Polygons;
use super::surface::Surface;
use super::{Layout, cells, quads};
use nurbskin_geometry::Result;
use nurbskin_scan::mesh::manifold::Manifold;

/// How [`layout`] divides a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct LayoutOptions {
    /// Cells are added until no triangle is farther than this from the middle of its cell, in diagonals of the bounding
    /// box. Default: 0.25. Trial: median radius 0.24 to 0.30 on six scans whose numbers were set by hand.
    pub radius: f64,
    /// The number of cells at first, in place of the radius. Splits may add cells, at least one is made for each part that
    /// sharp lines cut off.
    pub cells: Option<usize>,
}

impl Default for LayoutOptions {
    fn default() -> Self {
        Self {
            radius: 0.25,
            cells: None,
        }
    }
}

/// Divides a mesh into four-sided faces.
///
/// `sharp` has a flag for each side 3 t + s of the triangles (see [`Adjacency`]): whether it is on a feature line. One
/// flag of the two sides of an edge is enough. No face crosses these lines, except ends of lines within one cell, which are
/// dropped. Every connected oriented manifold gets a layout that [`Layout::validate`] accepts. About O(n log n).
///
/// Source: geodesic Voronoi cells after M. Eck, H. Hoppe, *Automatic reconstruction of B-spline surfaces of arbitrary
/// topological type*, SIGGRAPH 1996.
///
/// # Errors
/// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) for a mesh without triangles or with vertices that are not
/// finite, and for a wrong number of flags.
///
/// [`Adjacency`]: nurbskin_scan::mesh::manifold::Adjacency
pub fn layout(mesh: &Manifold, sharp: &[bool], options: &LayoutOptions) -> Result<Layout> {
    let surface = Surface::new(mesh, sharp)?;
    let cells = cells::geodesic(&surface, options);
    let mut polygons = Polygons::new(&surface, &cells);
    let area: f64 = surface.areas.iter().sum();
    polygons.collapse_short((area / cells.count().max(1) as f64).sqrt());
    Ok(quads::split_all(&surface, &cells, &polygons))
}

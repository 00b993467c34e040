//! The producer of layouts: cells, collapse of short arcs, split.

use super::arcs::Polygons;
use super::cells::{Seeding, geodesic, sound};
use super::field::{CrossField, cross_field};
use super::quads::Division;
use super::surface::Surface;
use super::tidy::{tidy, typical_side};
use super::{Layout, aligned, collapse, parity, quads};
use nurbskin_geometry::Result;
use nurbskin_scan::mesh::manifold::Manifold;

/// The shape of the cells at first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum CellShape {
    /// Round, whatever the curvature: nearest seed along the surface.
    #[default]
    Geodesic,
    /// Squares along a cross field, in rows.
    Aligned,
}

/// How cells become four-sided faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum FaceSplit {
    /// Each cell with k corners becomes k faces around its middle.
    #[default]
    All,
    /// Sides of cells are split only where the number of corners asks for it: fewer faces, larger ones.
    Parity,
}

/// How [`layout`] divides a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct LayoutOptions {
    /// Cells are added until no triangle is farther than this from the middle of its cell, in diagonals of the bounding
    /// box. Default: 0.25. Trial: median radius 0.24 to 0.30 on six scans whose numbers were set by hand.
    pub radius: f64,
    /// The number of cells at first, in place of the radius. Splits may add cells; at least one is made for each part that
    /// sharp lines cut off.
    pub cells: Option<usize>,
    /// The shape of the cells at first.
    pub shape: CellShape,
    /// How cells become faces.
    pub split: FaceSplit,
    /// How much smaller cells along a cross field are where the surface bends: 1 is usual, 0 makes all of one size.
    pub detail: f64,
    /// Whether thin cells join neighbours and cells with many corners are split.
    pub tidy: bool,
}

/// Radius of aligned cells of the coarsest candidate, in diagonals.
/// Derived: cells without splits are 2.5 times as many as those with, for as many faces: 0.25 / sqrt(2.5).
const ALIGNED_RADIUS: f64 = 0.158;
/// Divisions of that radius: each has about twice the faces of the one before.
/// Trial: not recorded.
const DIVISIONS: [f64; 3] = [1.0, 1.5, 2.2];

impl Default for LayoutOptions {
    fn default() -> Self {
        Self {
            radius: 0.25,
            cells: None,
            shape: CellShape::default(),
            split: FaceSplit::default(),
            detail: 1.0,
            tidy: false,
        }
    }
}

impl LayoutOptions {
    /// Cells along a cross field, all split: few extraordinary vertices, edges along the curvature. Radius 0.16 gives as
    /// many faces as the default or fewer. Trial: six scans.
    #[must_use]
    pub fn aligned() -> Self {
        Self {
            radius: 0.16,
            shape: CellShape::Aligned,
            ..Self::default()
        }
    }

    /// Cells along a cross field, split where parity asks for it: a fifth to a third fewer faces than
    /// [`aligned`](Self::aligned) with about as many extraordinary vertices. Trial: six scans.
    #[must_use]
    pub fn parity() -> Self {
        Self {
            radius: 0.1,
            shape: CellShape::Aligned,
            split: FaceSplit::Parity,
            tidy: true,
            ..Self::default()
        }
    }

    /// Ways of division from few faces to many: cells along the curvature in three sizes, split where parity asks, and
    /// last round cells with all sides split. The first that carries the shape takes the fewest control points.
    #[must_use]
    pub fn candidates() -> [Self; 4] {
        let [coarse, medium, fine] = DIVISIONS.map(|division| Self {
            radius: ALIGNED_RADIUS / division,
            ..Self::parity()
        });
        [coarse, medium, fine, Self::default()]
    }
}

/// Divides a mesh into four-sided faces.
///
/// `sharp` has a flag for each side 3 t + s of the triangles (see [`Adjacency`]): whether it is on a feature line. One
/// flag of the two sides of an edge is enough. No face crosses these lines, except ends of lines within one cell, which are
/// dropped. Every connected oriented manifold gets a layout that [`Layout::validate`] accepts. About O(n log n); with
/// [`CellShape::Aligned`] the cross field costs about O(n^1.5).
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
    let field = match options.shape {
        CellShape::Geodesic => None,
        CellShape::Aligned => Some(cross_field(mesh, sharp)),
    };
    Ok(divide(&surface, field.as_ref(), options))
}

/// As [`layout`], with a cross field that was computed before. It counts only with [`CellShape::Aligned`].
///
/// # Errors
/// As [`layout`].
pub fn layout_along(
    mesh: &Manifold,
    sharp: &[bool],
    field: &CrossField,
    options: &LayoutOptions,
) -> Result<Layout> {
    let surface = Surface::new(mesh, sharp)?;
    let field = (options.shape == CellShape::Aligned).then_some(field);
    Ok(divide(&surface, field, options))
}

fn divide(surface: &Surface<'_>, field: Option<&CrossField>, options: &LayoutOptions) -> Layout {
    let seeding = match options.cells {
        Some(cells) => Seeding::Count(cells),
        None => Seeding::Radius(options.radius * surface.diagonal),
    };
    let labels = match field {
        Some(field) => aligned::labels(surface, field, seeding, options.detail),
        None => geodesic(surface, seeding),
    };
    let mut cells = sound(surface, labels);
    if options.tidy {
        cells = tidy(surface, cells);
    }
    let side = typical_side(surface, &cells);
    let mut polygons = Polygons::new(surface, &cells);
    match options.shape {
        CellShape::Geodesic => collapse::short(&mut polygons, side),
        CellShape::Aligned => collapse::by_score(&mut polygons, side),
    }
    let division = match options.split {
        FaceSplit::All => Division::all(&polygons),
        FaceSplit::Parity => parity::divide(surface, &polygons),
    };
    quads::assemble(surface, &cells, &polygons, &division)
}

//! The producer of layouts: cells, collapse of short arcs, split.

use super::aligned::Known;
use super::arcs::Polygons;
use super::cells::{Seeding, geodesic, sound};
use super::field::{CrossField, cross_field};
use super::grow::Front;
use super::quads::Division;
use super::surface::{Surface, index};
use super::tidy::{tidy, typical_side};
use super::{Layout, aligned, collapse, parity, quads};
use nurbskin_geometry::Result;
use nurbskin_scan::mesh::manifold::Manifold;
use std::collections::BinaryHeap;
use std::sync::OnceLock;

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

/// Radius of the cells of the coarsest layout, in diagonals.
/// Derived: cells without splits are 2.5 times as many as those with, for as many faces: 0.25 / sqrt(2.5).
const COARSE_RADIUS: f64 = 0.158;

/// Most growth of the relative size of cells over the radius of a cell of size 1. Dimensionless.
/// Trial: 0.5 on head and bunny; not varied. Neighbours differ by less than twice then.
const GRADATION: f64 = 0.5;

/// Most divisions whose seeds are kept. Count.
/// Guard: bounds memory; the layout that a fit takes is one of its last four.
const MOST_KEPT: usize = 8;

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

    /// The first layout of a fit, which asks for smaller cells where it needs them: few, large faces along the curvature.
    #[must_use]
    pub fn coarse() -> Self {
        Self {
            radius: COARSE_RADIUS,
            ..Self::parity()
        }
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
    Ok(Producer::new(mesh, sharp)?.layout(options, &[]))
}

/// The producer of layouts of one mesh: its tables and its cross field are made once.
#[derive(Debug)]
pub struct Producer<'a> {
    surface: Surface<'a>,
    flags: &'a [bool],
    field: OnceLock<CrossField>,
    made: Seeds,
    /// Whether a layout begins with the seeds of an earlier one.
    follows: bool,
}

/// The seeds of the aligned layouts that a [`Producer`] has made.
#[derive(Clone, Debug, Default)]
pub struct Seeds(Vec<Seeded>);

/// The seeds of a division, and the sizes of its cells.
#[derive(Clone, Debug)]
struct Seeded {
    /// By triangle.
    sizes: Vec<f64>,
    seeds: Vec<u32>,
}

impl<'a> Producer<'a> {
    /// For a mesh with feature lines, as [`layout`].
    ///
    /// # Errors
    /// As [`layout`].
    pub fn new(mesh: &'a Manifold, sharp: &'a [bool]) -> Result<Self> {
        Ok(Self {
            surface: Surface::new(mesh, sharp)?,
            flags: sharp,
            field: OnceLock::new(),
            made: Seeds::default(),
            follows: false,
        })
    }

    /// From now on a layout begins with the seeds of the earlier one with the most sizes in common, if there is one: those here, or those
    /// of another producer for the same mesh, lines and options. Where sizes stay, so do the seeds, and most of the faces; further seeds
    /// come where sizes are smaller. With [`CellShape::Geodesic`] there is no effect.
    pub fn follow(&mut self, earlier: Seeds) {
        let count = self.surface.count();
        let same = earlier
            .0
            .into_iter()
            .filter(|made| made.sizes.len() == count);
        self.made.0.splice(..0, same);
        self.follows = true;
    }

    /// The seeds of the layouts made so far.
    #[must_use]
    pub fn into_seeds(self) -> Seeds {
        self.made
    }

    /// The seeds of the earlier division with the most sizes in common, the last of several.
    fn known(&self) -> Known {
        let sizes = &self.surface.sizes;
        let is_same = |made: &Seeded, t: usize| sizes[t].to_bits() == made.sizes[t].to_bits();
        // A seed is never removed.
        let is_coarser = |made: &&Seeded| (0..sizes.len()).all(|t| made.sizes[t] >= sizes[t]);
        let differing = |made: &&Seeded| (0..sizes.len()).filter(|&t| !is_same(made, t)).count();
        let earlier = self.made.0.iter().rev().filter(|_| self.follows);
        let earlier = earlier.filter(is_coarser);
        let Some(made) = earlier.min_by_key(differing) else {
            return Known::default();
        };
        let seeds = made.seeds.iter();
        Known {
            held: seeds.map(|&seed| is_same(made, seed as usize)).collect(),
            seeds: made.seeds.clone(),
        }
    }

    /// A layout, as [`layout`]. `sizes` has the size of the cells at each triangle, relative to that of the options; a
    /// missing, non-positive or infinite one counts as 1. With [`CellShape::Geodesic`] sizes only tell which cells are thin.
    pub fn layout(&mut self, options: &LayoutOptions, sizes: &[f64]) -> Layout {
        let size = |t: usize| sizes.get(t).copied().filter(|s| s.is_finite() && *s > 0.0);
        let sizes: Vec<f64> = (0..self.surface.count())
            .map(|t| size(t).unwrap_or(1.0))
            .collect();
        self.surface.sizes = graded(&self.surface, sizes, options.radius);
        let known = self.known();
        let surface = &self.surface;
        let field = || {
            let made = || cross_field(surface.mesh, self.flags);
            self.field.get_or_init(made)
        };
        let seeding = match options.cells {
            Some(cells) => Seeding::Count(cells),
            None => Seeding::Radius(options.radius * surface.diagonal),
        };
        let labels = match options.shape {
            CellShape::Aligned => {
                let made = aligned::divide(surface, field(), seeding, options.detail, known);
                self.made.0.push(Seeded {
                    sizes: surface.sizes.clone(),
                    seeds: made.seeds,
                });
                let surplus = self.made.0.len().saturating_sub(MOST_KEPT);
                self.made.0.drain(..surplus);
                made.labels
            }
            CellShape::Geodesic => geodesic(surface, seeding),
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
            FaceSplit::Parity => parity::divide(surface, &cells, &polygons),
        };
        quads::assemble(surface, &cells, &polygons, &division)
    }
}

/// The largest sizes up to these that grow by [`GRADATION`] at most per radius of a cell. O(n log n).
fn graded(surface: &Surface<'_>, mut sizes: Vec<f64>, radius: f64) -> Vec<f64> {
    let least = sizes.iter().copied().fold(f64::INFINITY, f64::min);
    if sizes.iter().all(|size| *size <= least) {
        return sizes;
    }
    let slope = GRADATION / (radius * surface.diagonal).max(f64::MIN_POSITIVE);
    let all = (0..index(sizes.len())).zip(&sizes);
    let mut heap: BinaryHeap<Front> = all.map(|(t, &size)| Front(size, t)).collect();
    while let Some(Front(size, triangle)) = heap.pop() {
        let t = triangle as usize;
        if size > sizes[t] {
            continue;
        }
        for o in (3 * t..3 * t + 3).filter_map(|side| surface.across(side)) {
            let most = size + slope * surface.middles[t].distance(surface.middles[o]);
            if most < sizes[o] {
                sizes[o] = most;
                heap.push(Front(most, index(o)));
            }
        }
    }
    sizes
}

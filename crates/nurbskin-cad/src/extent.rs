//! The exact box around faces.
//!
//! A coordinate is largest on an edge, at a point inside a face where both its derivatives vanish, or on a crease. For
//! each of the six directions one search goes through edge curves, creases (knot lines of multiplicity p) and Bezier
//! patches, those with the highest bound first: control points bound a piece (convex hull property), pieces below what
//! was found are left out, as are patches outside the region and patches on which the coordinate rises or falls
//! strictly along u or v; what remains is split. The border of a region needs no search of its own in the patches that
//! it crosses, since edges are searched as curves.

mod borders;
mod search;

use super::model::{Face, Model, Shell};
use super::region::Region;
use borders::Borders;
use glam::DVec3;
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::{Error, Result};
use rayon::prelude::*;
use search::Search;
use std::sync::OnceLock;

/// The search ends this far from the truth, as a share of the diagonal of the control points' box.
const PRECISION: f64 = 2e-11;

/// A box around faces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Lower corner.
    pub low: DVec3,
    /// Upper corner.
    pub high: DVec3,
    /// The true box is at most this much larger on any side, rounding apart: 2e-11 of the diagonal, or more where a
    /// shape made the search give up.
    pub gap: f64,
}

impl Extent {
    /// The length of the diagonal.
    #[must_use]
    pub fn diagonal(&self) -> f64 {
        self.low.distance(self.high)
    }
}

/// The box around all faces of a model, or, where there is none, around its edges and vertices.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_cad::{Model, extent};
/// use nurbskin_geometry::nurbs::conic;
/// let mut model = Model::new("ring");
/// model.add_whole_surface(&conic::torus(DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0), 3.0, 1.0)?, 1e-9)?;
/// let around = extent(&model)?;
/// let expected = DVec3::new(3.0 / 2_f64.sqrt() + 1.0, 3.0 / 2_f64.sqrt() + 1.0, 4.0);
/// assert!((around.high - expected).length() < 1e-8);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] if the model has no vertex, or a face no loop.
pub fn extent(model: &Model) -> Result<Extent> {
    let edges: Vec<usize> = (0..model.edges().len()).collect();
    around(model, &(0..model.faces().len()).collect::<Vec<_>>(), &edges)
}

/// The box around one face.
///
/// # Errors
/// [`Error::Invalid`] if the face does not exist or has no loop.
pub fn face_extent(model: &Model, face: usize) -> Result<Extent> {
    let Some(found) = model.faces().get(face) else {
        return Err(Error::invalid(format!(
            "face {face} of {}",
            model.faces().len()
        )));
    };
    around(model, &[face], &edges_of(std::iter::once(found)))
}

/// The box around the faces of a shell.
///
/// # Errors
/// As [`extent`].
pub(crate) fn shell_extent(model: &Model, shell: &Shell) -> Result<Extent> {
    let faces = shell.faces.iter().map(|&face| &model.faces()[face]);
    around(model, &shell.faces, &edges_of(faces))
}

/// The edges of some faces, in ascending order.
fn edges_of<'a>(faces: impl Iterator<Item = &'a Face>) -> Vec<usize> {
    let loops = faces.flat_map(|face| &face.loops);
    let uses = loops.flat_map(|each| &each.uses);
    let mut edges: Vec<usize> = uses.map(|used| used.edge).collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// A face and its region, made when it is needed.
pub(super) struct Part<'a> {
    pub(super) face: &'a Face,
    region: OnceLock<Result<Region>>,
}

impl Part<'_> {
    /// The region; `None` for a face that is all of its surface.
    pub(super) fn region(&self) -> Option<&Region> {
        if !self.face.trimmed {
            return None;
        }
        let region = self.region.get_or_init(|| Region::new(self.face));
        region.as_ref().ok()
    }
}

fn around(model: &Model, faces: &[usize], edges: &[usize]) -> Result<Extent> {
    let parts: Vec<Part> = faces
        .iter()
        .filter_map(|&face| model.faces().get(face))
        .map(|face| Part {
            face,
            region: OnceLock::new(),
        })
        .collect();
    if parts.iter().any(|part| part.face.loops.is_empty()) {
        return Err(Error::invalid("a face without loops"));
    }
    let mut points: Vec<DVec3> = Vec::new();
    if parts.is_empty() {
        points.extend(model.vertices());
    }
    let edge_curves = edges
        .iter()
        .filter_map(|&e| model.edges().get(e)?.curve.as_ref());
    let boxes = parts.iter().map(|part| part.face.surface.bounding_box());
    let boxes = boxes.chain(edge_curves.map(|c| bounding_box(c.control_points())));
    let boxes = boxes.chain(points.iter().map(|&p| [p, p]));
    let [low, high] = boxes.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[a, b], [c, d]| {
        [a.min(c), b.max(d)]
    });
    if !low.cmple(high).all() {
        return Err(Error::invalid("a model without faces and vertices"));
    }
    let borders = Borders::new(model, &parts, edges, 1e-9 * (high - low).length());
    let tolerance = PRECISION * (high - low).length();
    let side = |k: usize| {
        let sign = if k < 3 { 1.0 } else { -1.0 };
        Search::new(&parts, k % 3, sign, tolerance).run(&points, &borders)
    };
    let found: Result<Vec<[f64; 2]>> = (0..6).into_par_iter().map(side).collect();
    let found = found?;
    let at = |k: usize| found[k][0];
    Ok(Extent {
        low: -DVec3::new(at(3), at(4), at(5)),
        high: DVec3::new(at(0), at(1), at(2)),
        gap: found.iter().fold(0.0, |gap, side| gap.max(side[1])),
    })
}

#[cfg(test)]
mod tests;

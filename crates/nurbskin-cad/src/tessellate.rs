//! A whole model as triangles, watertight across shared edges.
//!
//! Every edge is cut once, and all faces that use it take the same points, so that neighbours and the two sides of a
//! seam fit whatever their parameters do; a pole is one point. Lines of parameters cut each face into cells as its
//! second derivatives ask for. A cell that no loop comes near is two triangles; the band of the others along the loops,
//! stretched as the cells are, gets a constrained Delaunay triangulation of the cut loops, the corners of its cells and
//! the sides that it shares with plain ones. What triangles miss is bounded as `nurbs::tessellate` bounds it; triangles
//! that miss too much get more points, and edges of the model that are too long for a face are cut again.

mod assemble;
mod band;
mod cells;
mod edges;
mod face;
mod metric;

use super::model::Model;
use assemble::{assemble, doubled};
use edges::EdgeCuts;
use face::{FaceMesh, Plan};
use glam::{DVec2, DVec3};
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::{Error, Result};

/// Triangles on the faces of a model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelTessellation {
    /// The points, each once, whatever faces meet there.
    pub points: Vec<DVec3>,
    /// Points of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Index of the face that each triangle lies on.
    pub faces: Vec<u32>,
    /// Unit normals that point outwards, one per point and face; zero where the surface has none.
    pub normals: Vec<DVec3>,
    /// (u, v) on the face, beside each normal.
    pub parameters: Vec<DVec2>,
    /// The normals of the corners of each triangle.
    pub corners: Vec<[u32; 3]>,
    /// No triangle is further than this from the surface at its parameters, nor (as measured on samples) a chord from
    /// its edge.
    pub bound: f64,
    /// Faces that could not be triangulated, and why. The others are complete.
    pub left_out: Vec<(usize, String)>,
}

impl ModelTessellation {
    /// Area of all triangles.
    #[must_use]
    pub fn area(&self) -> f64 {
        let area = |&triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|k| self.points[k as usize]);
            (b - a).cross(c - a).length() / 2.0
        };
        self.triangles.iter().map(area).sum()
    }

    /// Volume inside the triangles, if they close.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let origin = self.points.first().copied().unwrap_or_default();
        let cone = |&triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|k| self.points[k as usize] - origin);
            a.cross(b).dot(c) / 6.0
        };
        self.triangles.iter().map(cone).sum()
    }
}

/// Edges are cut again this often at most.
const ROUNDS: usize = 24;

/// Triangles that follow a model within `tolerance`, at most `max_triangles`.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_cad::{Model, tessellate};
/// use nurbskin_geometry::nurbs::conic;
/// let mut model = Model::new("ball");
/// model.add_whole_surface(&conic::sphere(DVec3::ZERO, 1.0)?, 1e-9)?;
/// let mesh = tessellate(&model, 0.01, 100_000)?;
/// // Euler's formula for a closed surface without holes: V - E + F = 2 with E = 3 F / 2.
/// assert_eq!(2 * mesh.points.len(), mesh.triangles.len() + 4);
/// assert!(mesh.bound <= 0.01);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] if the tolerance is not positive; [`Error::NoSolution`] if it needs more triangles.
pub fn tessellate(
    model: &Model,
    tolerance: f64,
    max_triangles: usize,
) -> Result<ModelTessellation> {
    let fineness = Fineness {
        tolerance,
        step: f64::INFINITY,
    };
    tessellate_finely(model, fineness, max_triangles)
}

/// How fine triangles are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fineness {
    /// How far they may miss the model.
    pub tolerance: f64,
    /// About how far neighbouring vertices may be apart along either direction of a surface; infinite where that does not
    /// matter. For what is shown per vertex.
    pub step: f64,
}

/// [`tessellate`] with vertices no further apart than about `fineness.step`.
///
/// # Errors
/// As [`tessellate`], and [`Error::Invalid`] if the step is not positive.
pub fn tessellate_finely(
    model: &Model,
    fineness: Fineness,
    max_triangles: usize,
) -> Result<ModelTessellation> {
    let Fineness { tolerance, step } = fineness;
    if !(tolerance > 0.0 && tolerance.is_finite() && step > 0.0) {
        return Err(Error::invalid(format!(
            "the chordal tolerance must be a positive number, not {tolerance}"
        )));
    }
    let limit = max_triangles.min(u32::MAX as usize / 4);
    let too_many = || {
        Error::NoSolution(format!(
            "a chordal tolerance of {} needs more than {max_triangles} triangles: use a larger tolerance",
            model.unit.length(tolerance)
        ))
    };
    let plans: Vec<Plan> = each(model.faces().len(), |k| {
        Plan::new(&model.faces()[k], fineness, limit)
    })
    .into_iter()
    .map(|plan| plan?.ok_or_else(too_many))
    .collect::<Result<_>>()?;
    let mut cuts = EdgeCuts::new(model, &plans, fineness)?;
    let mut extra: Vec<Vec<DVec2>> = vec![Vec::new(); plans.len()];
    let mut meshes: Vec<FaceMesh> = vec![FaceMesh::default(); plans.len()];
    let mut stale: Vec<usize> = (0..plans.len()).collect();
    for round in 0..ROUNDS {
        let made = each(stale.len(), |i| {
            let k = stale[i];
            plans[k].mesh(&cuts, &extra[k], limit)
        });
        for (&k, mesh) in stale.iter().zip(made) {
            meshes[k] = mesh;
        }
        let count: usize = meshes.iter().map(FaceMesh::count).sum();
        if count > limit || meshes.iter().any(|mesh| mesh.too_many) {
            return Err(too_many());
        }
        let mut splits: Vec<(usize, usize)> =
            meshes.iter().flat_map(|m| m.splits.clone()).collect();
        splits.sort_unstable();
        splits.dedup();
        stale.clear();
        if round + 1 == ROUNDS {
            break;
        }
        if splits.is_empty() {
            for (k, place) in doubled(model, &cuts, &meshes) {
                extra[k].push(place);
                stale.push(k);
            }
        } else {
            stale.extend(cuts.split(&splits));
        }
        stale.sort_unstable();
        stale.dedup();
        if stale.is_empty() {
            break;
        }
    }
    Ok(assemble(&plans, &cuts, meshes))
}

#[cfg(test)]
mod tests;

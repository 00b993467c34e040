//! Catmull-Clark enrichment of sparse grids and meshes (Pal & Ballav 2007, section 4.1).
//!
//! One step of Catmull-Clark subdivision puts a point into every face and on every edge, and moves the points that were
//! there. The paper takes the moved points for measured ones; on a sparse scan that costs millimetres. Here the control
//! points whose *limit* surface passes through the measured points are computed first and then subdivided: every
//! measured point stays where it is, and the new points lie on a smooth surface through them. Plain subdivision is
//! available for comparison.
//!
//! On a regular grid the limit surface is the uniform bicubic B-spline surface, so that enrichment adds no information
//! beyond interpolation. It is useful for irregular meshes.
//!
//! Sources: E. Catmull and J. Clark, *Recursively generated B-spline surfaces on arbitrary topological meshes*,
//! Computer-Aided Design 10(6), 1978; limit masks: M. Halstead, M. Kass and T. `DeRose`, *Efficient, fair interpolation
//! using Catmull-Clark surfaces*, SIGGRAPH 1993; boundary rules: H. Biermann, A. Levin and D. Zorin, *Piecewise smooth
//! subdivision surfaces with normal control*, SIGGRAPH 2000.

mod grid;
mod mesh;
mod solve;

pub use grid::{controls_of_grid, enrich_grid, limit_grid, subdivide_grid};
pub use mesh::PolygonMesh;
pub use solve::{controls_of_mesh, enrich_mesh};

use nurbskin_geometry::{Error, Result};

/// Most points of an enriched grid or mesh. Guard: a mistyped level must not exhaust the memory; 2^26 points take 1.6
/// GB.
const MAX_POINTS: usize = 1 << 26;

/// The weights of a vertex, of each of its `valence` edge neighbours and of each of its `valence` diagonal neighbours
/// in the vertex's new place, in a quad mesh. A regular vertex has 36/64, 6/64 and 1/64.
///
/// Source: Pal & Ballav 2007, eq. (11), beta = 3 / (2 k) and gamma = 1 / (4 k); the same as eq. (12).
#[must_use]
pub fn vertex_mask(valence: usize) -> [f64; 3] {
    let k = valence as f64;
    let (beta, gamma) = (3.0 / (2.0 * k), 1.0 / (4.0 * k));
    [1.0 - beta - gamma, beta / k, gamma / k]
}

/// The weights of a vertex, of each of its `valence` edge neighbours and of each of its `valence` diagonal neighbours
/// in the vertex's limit position on an infinitely refined quad mesh.
///
/// Source: Halstead, Kass & `DeRose` 1993: (k^2, 4, 1) / (k (k + 5)).
#[must_use]
pub fn limit_mask(valence: usize) -> [f64; 3] {
    let k = valence as f64;
    let sum = k * (k + 5.0);
    [k * k / sum, 4.0 / sum, 1.0 / sum]
}

fn check_size(points: Option<usize>) -> Result<()> {
    match points {
        Some(points) if points <= MAX_POINTS => Ok(()),
        _ => Err(Error::Unsupported(format!(
            "enrichment to more than {MAX_POINTS} points is not supported: ask for fewer levels"
        ))),
    }
}

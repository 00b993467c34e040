//! Charts: the parameter domain of a scan, and (u, v) for every point.
//!
//! A tensor-product surface needs a rectangle of parameters, [0, 1] × [0, 1], whose directions may be closed, and a
//! place in it for each point. A good chart has no folds, little stretch and evenly spaced lines, so that knots along u
//! and v meet features of the same size everywhere.
//!
//! Ordered scans get theirs from their rows ([`grid`]), sheets by projection ([`plane`]), surfaces of revolution from
//! axis and profile ([`revolution`]), and everything else from a triangle mesh that is laid out on the domain of its
//! topology ([`shape`], [`surface_mesh`]).

mod base;
mod domain;
pub mod grid;
mod outline;
pub mod plane;
mod rectangle;
pub mod revolution;
pub mod shape;
pub mod surface_mesh;
mod topology;

pub use topology::Topology;

use glam::DVec2;

/// The parameter domain of a scan and the place of every used point in it.
#[derive(Clone, Debug)]
pub struct Chart {
    /// Which directions are closed.
    pub topology: Topology,
    /// (u, v) in [0, 1] x [0, 1] for each point, in the order of the points charted.
    pub parameters: Vec<DVec2>,
    /// Lengths of the iso-lines along u and along v, in the scan's unit.
    pub size: [f64; 2],
    /// Why this domain was chosen, for the user.
    pub reason: String,
}

/// Smallest size of a part that counts, as a share of the points of the largest part; smaller parts are scraps. Trial:
/// not recorded. A larger share ignores a second object, a smaller one refuses scans with stray clusters.
const MIN_PART_SHARE: f64 = 0.1;

/// Refuses a scan of several parts of comparable size; scraps do not count.
fn check_one_part(parts: &nurbskin_scan::Parts) -> nurbskin_geometry::Result<()> {
    match parts.count_above(MIN_PART_SHARE) {
        0 | 1 => Ok(()),
        several => Err(nurbskin_geometry::Error::Unsupported(format!(
            "the scan has {several} separate parts of comparable size; only scans of one part can be charted here: split it \
             and fit each part"
        ))),
    }
}

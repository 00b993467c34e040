//! Which shape of domain a scan has, and (u, v) for every point.

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
    /// Lengths in the scan's unit that u and v from 0 to 1 stand for.
    pub size: [f64; 2],
    /// Why this domain was chosen, for the user.
    pub reason: String,
}

/// Pieces with fewer points than this fraction of the largest piece's are scraps.
const SCRAP: f64 = 0.1;

/// Refuses a scan of several pieces of comparable size; scraps do not count.
fn check_one_part(parts: &nurbskin_scan::Parts) -> nurbskin_geometry::Result<()> {
    match parts.count_above(SCRAP) {
        0 | 1 => Ok(()),
        several => Err(nurbskin_geometry::Error::Unsupported(format!(
            "the scan has {several} separate parts of comparable size; only scans of one part can be charted here: split it \
             and fit each part"
        ))),
    }
}

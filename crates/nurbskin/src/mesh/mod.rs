//! Triangles between the points of a scan: made where there are none, repaired, and understood as a surface with borders.

#[cfg(feature = "scan")]
pub mod decimate;
#[cfg(feature = "scan")]
pub mod handles;
#[cfg(feature = "scan")]
pub mod holes;
#[cfg(feature = "scan")]
pub mod manifold;
pub(crate) mod nearest;
pub mod range_grid;
#[cfg(feature = "scan")]
pub mod repair;
#[cfg(feature = "scan")]
pub mod scene;
#[cfg(feature = "scan")]
pub(crate) mod subset;
#[cfg(feature = "scan")]
pub mod thin;
#[cfg(feature = "scan")]
pub mod triangulate;

#[cfg(feature = "scan")]
pub use manifold::Manifold;

/// Shapes for the tests of this stage and of charts.
#[cfg(all(test, feature = "scan"))]
#[allow(
    clippy::cast_possible_truncation,
    clippy::float_cmp,
    clippy::unwrap_used,
    reason = "small meshes, for tests only; exact numbers are meant"
)]
pub(crate) mod samples;

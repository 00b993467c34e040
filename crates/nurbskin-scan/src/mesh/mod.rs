//! Triangle meshes of a scan: made where a scan has none, repaired, and reduced.
//!
//! Triangulation of clouds (`triangulate`) and range images (`range_grid`, `scene`), thinning (`thin`, `subset`; local `quadric`s),
//! repair to an oriented manifold with borders (`manifold`, `repair`, `handles`, `holes`, `notches`, `rims` and their
//! `opening`), decimation (`decimate`), and meshes that pass through themselves (`crossings`, `untangle`).

pub mod crossings;
pub mod decimate;
pub mod handles;
pub mod holes;
pub mod manifold;
pub mod notches;
mod opening;
mod quadric;
pub mod range_grid;
pub mod repair;
pub mod rims;
pub mod scene;
pub mod subset;
pub mod thin;
pub mod triangulate;
pub mod untangle;

pub use manifold::Manifold;

/// Shapes for the tests of this stage and of charts.
#[cfg(any(test, feature = "samples"))]
#[allow(
    clippy::cast_possible_truncation,
    clippy::float_cmp,
    clippy::unwrap_used,
    reason = "small meshes, for tests only; exact numbers are meant"
)]
pub mod samples;

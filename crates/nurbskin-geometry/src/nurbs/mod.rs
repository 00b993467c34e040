//! NURBS curves and surfaces: *The NURBS Book*, chapters 2 to 6.

pub mod basis;
pub mod bezier;
pub mod closest;
pub mod conic;
mod curve;
pub mod elementary;
mod knots;
pub mod refine;
pub mod shape;
mod surface;
pub mod sweep;
pub mod tessellate;

pub use curve::NurbsCurve;
pub use knots::{KnotVector, MAX_DEGREE};
pub use refine::Direction;
pub use surface::{NurbsSurface, SurfaceDerivatives};

/// The control points P_{i,j} of a surface: i along u, j along v.
pub type ControlNet = crate::PointGrid;

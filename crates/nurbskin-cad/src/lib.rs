//! What a CAD file holds: faces on surfaces, bounded by loops of edges that neighbours share.
//!
//! | module | does |
//! |---|---|
//! | [`model`] | vertices, edges, loops, faces and shells, by index |
//! | `natural` | the face that is a whole surface: true seams, poles as degenerate edges |
//! | `boundary` | loops made of what files give: p-curves, seams, poles, rings |
//! | `pcurve` | the p-curve of a curve on a surface, and the curve in space of a p-curve |
//! | [`trim`] | the part of a surface that has its scan under it |
//! | [`mod@network`] | four-sided faces that share the curves along their sides |
//! | [`mod@normal_jump`] | how far normals turn across shared edges, with a certified bound |
//! | [`region`] | the part of the parameter plane that a face covers |
//! | [`mod@mass`] | area, volume, centroids |
//! | [`mod@fairness`] | how evenly a face bends |
//! | [`mod@extent`] | exact bounding boxes |
//! | [`mod@tessellate`] | triangles of a whole model, watertight |
//! | [`mod@check`] | product data quality |
//! | [`closest`] | certified closest points of trimmed faces, edges and corners |
//! | [`io`] | STEP and IGES, read and written; GLB, written |
//!
//! ```
//! use nurbskin_geometry::DVec3;
//! use nurbskin_cad::Model;
//! use nurbskin_geometry::nurbs::conic;
//! let mut model = Model::new("ball");
//! let face = model.add_whole_surface(&conic::sphere(DVec3::ZERO, 1.0)?, 1e-9)?;
//! // One seam, used twice, and a degenerate edge at each pole.
//! assert_eq!(model.edges().len(), 3);
//! assert_eq!(model.faces()[face].loops[0].uses.len(), 4);
//! # Ok::<(), nurbskin_geometry::Error>(())
//! ```

// Results are the same on every machine: elementary functions are those of `math`.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub(crate) mod boundary;
pub mod check;
pub mod closest;
pub mod extent;
pub mod fairness;
pub mod io;
pub mod mass;
pub mod model;
mod natural;
pub mod network;
pub mod normal_jump;
mod pcurve;
pub mod region;
#[cfg(any(test, feature = "samples"))]
#[allow(clippy::unwrap_used, reason = "models for tests only")]
pub mod samples;
pub mod tessellate;
pub mod trim;

pub(crate) use natural::clamped;

pub use check::{Check, Report, Severity, check, check_meant};
pub use closest::{ClosestOnModel, ModelFoot, Place};
pub use extent::{Extent, extent, face_extent};
pub use fairness::curvature_variation;
pub use mass::{FaceMass, Mass, face_mass, mass, shell_mass};
pub use model::{Edge, EdgeUse, Face, Loop, Model, Shell, ShellKind, SurfaceKind};
pub use network::{FaceNetwork, NetworkEdge, NetworkFace};
pub use normal_jump::{EdgeJump, JoinKind, JumpSummary, Meant, NormalJumps, normal_jumps};
pub use region::{Cover, LoopPoint, Region};
pub use tessellate::{Fineness, ModelTessellation, tessellate, tessellate_finely};

/// Compiles and runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

//! Fit one clean NURBS surface to a 3-D scan.
//!
//! The crate is one line of stages, from a file to a CAD file; each stage is a module and uses only the modules
//! before it:
//!
//! | module | does |
//! |---|---|
//! | [`numeric`] | banded solvers, robust statistics |
//! | [`nurbs`] | knot vectors, basis functions, curves, surfaces and what one does with them |
//! | [`spatial`] | nearest points, nearest places on triangles, boxes that overlap |
//! | [`scan`] | what a scan is; cleaning, neighbours, normals, noise; a virtual scanner |
//! | [`mesh`] | triangles between points, made, repaired and understood as a surface with borders |
//! | [`chart`] | which shape of domain a scan has, and (u, v) for every point |
//! | [`rarefy`], [`enrich`] | the paper's logical rarefaction and Catmull-Clark enrichment |
//! | [`fit`] | interpolation, rarefaction to tolerance, approximation to tolerance |
//! | [`charting`] | the chart of any cleaned part: by projection, or over a mesh |
//! | [`network`] | four-sided faces over any mesh: their layout, and their fit |
//! | [`cad`] | faces, loops, edges and vertices of CAD files |
//! | [`deviation`] | certified distances of all points to the surface, coverage, the verdict |
//! | [`io`] | scans in, CAD files in and out |
//! | `report` | the page that shows how close, as one HTML file |
//! | [`surfacing`] | the surfaces of a scan: which way of fitting, which tolerance, where each ends |
//! | [`pipeline`] | the line as one call |
//!
//! [`scan::clean()`], [`charting::chart`], [`fit::approximate`], [`cad::trim`], [`deviation::measure`] and [`io::cad`] in this order
//! make a CAD file of a scan: the example of the README is these lines. [`pipeline::fit`] is the same with every choice made.
//!
//! It implements P. Pal and R. Ballav, *Object shape reconstruction through NURBS surface interpolation*,
//! Int. J. Production Research 45(2), 2007, 287-307 (DOI 10.1080/00207540600688481), and names follow L. Piegl and
//! W. Tiller, *The NURBS Book*, 2nd ed., Springer 1997.

// Results are the same on every machine: elementary functions are those of `math`.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod deviation;
pub mod io;
pub mod pipeline;
pub mod report;
pub mod surfacing;

pub use nurbskin_cad as cad;
pub use nurbskin_fit::{chart, charting, enrich, fit, rarefy};
pub use nurbskin_geometry::{
    ControlNet, DVec2, DVec3, DVec4, Error, KnotVector, NurbsCurve, NurbsSurface, PointGrid,
    Result, Unit, error, math, notes, numeric, nurbs, progress, spatial, unit,
};
pub use nurbskin_network as network;
pub use nurbskin_scan as scan;
pub use nurbskin_scan::mesh;

/// Sets the number of threads of all parallel work, once and before any of it; without, all cores are used. The results
/// are the same for any number.
///
/// # Errors
/// [`Error::Invalid`] if parallel work has already begun.
pub fn set_threads(count: usize) -> Result<()> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count);
    pool.build_global()
        .map_err(|e| Error::invalid(format!("the number of threads cannot be set: {e}")))
}

/// Compiles and runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;

//! A virtual scanner: shapes of exactly known surface and distance, scanned with noise, outliers and holes.
//!
//! A [`Shape`] is a formula; a [`TrueSurface`] answers what one wants to know of it (points, normals, distance);
//! [`scan()`] samples it as a scanner would and keeps the truth beside the scan. Tests and examples fit the scan and
//! ask the truth how far the fit is off, which no real scan can tell. A [`Body`] is the same for surfaces with handles,
//! branches and sharp edges, which no one (u, v) covers.
//!
//! ```
//! use nurbskin_scan::simulate::{ScanOptions, Shape, scan};
//! let simulated = scan(Shape::Pot, &ScanOptions { noise: 0.05, ..ScanOptions::default() })?;
//! assert_eq!(simulated.scan.points.len(), 13_159);
//! let worst = simulated.scan.points.iter().map(|&p| simulated.truth.distance(p)).fold(0.0, f64::max);
//! assert!(worst < 0.3);
//! # Ok::<(), nurbskin_geometry::Error>(())
//! ```

pub mod body;
mod ellipsoid;
mod jet;
mod random;
pub mod scanner;
pub mod shapes;
mod truth;

pub use body::{Body, BodyOptions, BodySurface, Layout, SimulatedBody, scan_body};
pub use random::Random;
pub use scanner::{Order, ScanOptions, Simulated, scan};
pub use shapes::Shape;
pub use truth::TrueSurface;

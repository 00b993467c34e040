//! IGES 5.3: rational B-spline surfaces (entity 128), bare or trimmed (144), the curves around them, points and
//! polylines of a scan.
//!
//! An IGES file is a stack of 80-column cards. Column 73 names the section, columns 74-80 count within it: **S**tart
//! (free text), **G**lobal (unit, delimiters, resolution), **D**irectory (two cards per entity: what it is, its level,
//! its transformation), **P**arameter (the numbers, free format, delimited by `,` and `;`), **T**erminate (how many
//! cards each section has). Both directions share the modules that know one of these things each:
//!
//! | module | knows |
//! |---|---|
//! | `card` | 80 columns, sections, sequence numbers |
//! | `number` | how a real is spelled so that it reads back to the same f64 |
//! | `field` | the free format of the parameter data |
//! | `global`, `header`, `directory` | the S, G and D sections |
//! | `surface`, `curve`, `point`, `transform` | the entities 128; 126, 110, 100, 102; 116, 106; 124 |
//! | `store` | a file taken apart, for both readers |
//! | [`write`](mod@write) | a whole file out |
//! | [`cad`] | the faces of a file: [`read_cad()`], which `io::read_cad` calls |
//! | [`read`](mod@read) | its surfaces, curves and points one by one, bit by bit, whatever is made of them |
//!
//! Neither direction needs a file system: [`write()`] takes any [`std::io::Write`], [`read()`] takes bytes. To a file on a
//! disk, `io::atomic::write_whole(path, |out| iges::write(out, &content, &options))` writes all or nothing.
//!
//! ```
//! use nurbskin_cad::io::iges;
//! use nurbskin_cad::io::iges::{IgesContent, WriteOptions};
//! use nurbskin_geometry::{ControlNet, DVec3, KnotVector, NurbsSurface};
//! let net = ControlNet::from_fn(4, 4, |i, j| DVec3::new(i as f64 / 3.0, j as f64 / 3.0, (i * j) as f64))?;
//! let knots = KnotVector::uniform(3, 4)?;
//! let surface = NurbsSurface::new(knots.clone(), knots, net, None)?;
//!
//! let mut file = Vec::new();
//! let content = IgesContent { surfaces: std::slice::from_ref(&surface), ..Default::default() };
//! iges::write(&mut file, &content, &WriteOptions::default())?;
//!
//! let model = iges::read(&file, "part.igs")?;
//! assert_eq!(model.surfaces[0].surface, surface); // every number, to the last bit
//! assert_eq!(model.entities[&128], 1);
//! # Ok::<(), nurbskin_geometry::Error>(())
//! ```
//!
//! Source: *Initial Graphics Exchange Specification 5.3*, U.S. Product Data Association, 1996.

pub mod cad;
mod card;
mod curve;
mod directory;
mod field;
mod global;
mod header;
mod number;
mod point;
pub mod read;
mod store;
mod surface;
mod transform;
pub mod write;

pub use super::Timestamp;
pub use cad::read_cad;
pub use global::Global;
pub use read::{IgesComposite, IgesCurve, IgesModel, IgesSurface, read};
pub use write::{
    IgesContent, Layout, POINT_LEVEL, POLYLINE_LEVEL, SURFACE_LEVEL, WriteOptions, Written, write,
};

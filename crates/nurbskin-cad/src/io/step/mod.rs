//! STEP (ISO 10303-21 exchange files of AP203, AP214 and AP242): faces on NURBS surfaces.
//!
//! A file is a list of instances, `#12=VERTEX_POINT('',#11);`, that refer to each other by number. What is written:
//!
//! | module of [`write`](mod@write) | writes |
//! |---|---|
//! | `text` | instances, numbers that read back to the same f64, strings of any alphabet |
//! | `product` | the product, units, uncertainty, representations, colour |
//! | `geometry` | B-spline curves and surfaces, in space and in the parameter plane |
//! | `topology` | vertices, edges with their p-curves, loops, faces, shells |
//! | `validation` | area, volume and centroid for the receiver to compare with |
//!
//! ```
//! use nurbskin_cad::io::step;
//! use nurbskin_cad::io::step::WriteOptions;
//! use nurbskin_geometry::DVec3;
//! use nurbskin_cad::Model;
//! use nurbskin_geometry::nurbs::conic;
//! let mut model = Model::new("ball");
//! let face = model.add_whole_surface(&conic::sphere(DVec3::ZERO, 10.0)?, 1e-9)?;
//! model.add_shell_of(face)?;
//!
//! let mut file = Vec::new();
//! step::write(&mut file, &model, &WriteOptions::default())?;
//! let text = String::from_utf8_lossy(&file);
//! assert!(text.contains("MANIFOLD_SOLID_BREP('ball',") && text.contains("SEAM_CURVE"));
//! # Ok::<(), nurbskin_geometry::Error>(())
//! ```
//!
//! Sources: ISO 10303-21 (the file), -41 and -43 (product, representation), -42 (geometry, topology), -46 (colour), -214
//! and -242 (the application protocols).

pub mod read;
pub mod write;

pub use read::read;
pub use write::{Schema, Validation, WriteOptions, Written, write};

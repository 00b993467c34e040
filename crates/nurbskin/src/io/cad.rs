//! CAD files, whatever their format.

use crate::cad::Model;
use crate::unit::UnitSource;
use std::collections::BTreeMap;

/// What was read from a CAD file.
#[derive(Clone, Debug, Default)]
pub struct CadFile {
    /// `iges` or `step`.
    pub format: &'static str,
    /// Faces, edges and so on, in the unit of the file or, where that is none of ours, in millimetres.
    pub model: Model,
    /// Whether the file says its unit.
    pub unit_source: UnitSource,
    /// How many entities of each type the file has: numbers for IGES (`128`), names for STEP.
    pub entities: BTreeMap<String, usize>,
    /// How many entities of each type were not understood, of those that carry geometry or structure of the shape.
    pub unread: BTreeMap<String, usize>,
    /// What the user should know, a sentence each.
    pub warnings: Vec<String>,
}

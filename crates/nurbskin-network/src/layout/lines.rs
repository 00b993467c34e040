//! Feature lines: the edges of a mesh along which the surface bends sharply.

use nurbskin_scan::mesh::Manifold;

/// Which edges count as sharp.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Sharp {
    /// Lines begin where the surface bends by more than 40 degrees.
    #[default]
    Auto,
    /// There are no lines.
    Off,
    /// Lines begin where the surface bends by more than this, in degrees.
    Degrees(f64),
}

/// The feature lines of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FeatureLines {
    /// By side (3 t + s) of the mesh, whether it lies on a line; the two sides of an edge agree.
    pub sides: Vec<bool>,
    /// Number of pieces between ends and junctions; closed lines count once.
    pub chains: usize,
    /// Total length, in the unit of the mesh.
    pub length: f64,
    /// What was left out, a sentence each, for the user.
    pub notes: Vec<String>,
}

/// The feature lines of a mesh; none yet.
#[must_use]
pub fn feature_lines(mesh: &Manifold, _spacing: f64, _noise: f64, _sharp: Sharp) -> FeatureLines {
    FeatureLines {
        sides: vec![false; 3 * mesh.triangles.len()],
        ..FeatureLines::default()
    }
}

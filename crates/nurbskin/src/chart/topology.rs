//! The shapes of domain.

use serde::{Deserialize, Serialize};

/// The topology of a surface, which says which parameter directions are closed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Topology {
    /// A sheet: neither direction is closed.
    #[default]
    Disk,
    /// Closed in v.
    Tube,
    /// Closed in v, with a pole at each end of u.
    Sphere,
    /// Closed in u and v.
    Torus,
}

impl Topology {
    /// The name on the command line and in JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Topology::Disk => "disk",
            Topology::Tube => "tube",
            Topology::Sphere => "sphere",
            Topology::Torus => "torus",
        }
    }

    /// Whether u and v are closed.
    #[must_use]
    pub fn closed(self) -> [bool; 2] {
        match self {
            Topology::Disk => [false, false],
            Topology::Tube | Topology::Sphere => [false, true],
            Topology::Torus => [true, true],
        }
    }
}

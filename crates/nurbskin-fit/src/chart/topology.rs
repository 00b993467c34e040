//! The four topologies of a domain.
//!
//! A rectangle of parameters with none, one or both of its directions closed is a disk, a tube or a torus; a tube whose
//! two ends are single points is a sphere. There are no other domains: further topologies need several patches.

use glam::DVec2;

use serde::{Deserialize, Serialize};

/// The topology of a surface, which determines its closed parameter directions.
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

    /// A place in the domain \[0, 1\] x \[0, 1\]: wrapped to 0 <= t < 1 in closed directions, clamped in open ones.
    #[must_use]
    pub fn within(self, at: DVec2) -> DVec2 {
        let each = |x: f64, closed: bool| match closed {
            // A value slightly below zero can round to one.
            true => Some(x - x.floor()).filter(|&x| x < 1.0).unwrap_or(0.0),
            false => x.clamp(0.0, 1.0),
        };
        let [u, v] = self.closed();
        DVec2::new(each(at.x, u), each(at.y, v))
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

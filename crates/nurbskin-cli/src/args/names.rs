//! Values with a name.

use clap::ValueEnum;
use nurbskin::Unit;
use nurbskin::chart::Topology;
use nurbskin::fit::interpolate::parameters::Parameterization;
use nurbskin::io::iges::write::Layout;
use nurbskin::io::step::Schema;
use nurbskin::pipeline::{Method, Trim};

#[derive(ValueEnum, Clone, Copy, Debug, Default)]
pub(crate) enum MethodName {
    /// `interpolate` for ordered scans with little noise, `approximate` for all others
    #[default]
    Auto,
    /// Through every kept point of an ordered scan, as in Pal & Ballav 2007
    Interpolate,
    /// Least squares, with as few control points as meet the tolerance
    Approximate,
}

impl From<MethodName> for Method {
    fn from(name: MethodName) -> Self {
        match name {
            MethodName::Auto => Method::Auto,
            MethodName::Interpolate => Method::Interpolate,
            MethodName::Approximate => Method::Approximate,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug, Default)]
pub(crate) enum TopologyName {
    /// Found from the scan
    #[default]
    Auto,
    /// An open sheet with one border
    Disk,
    /// Closed around, open at both ends
    Tube,
    /// Closed, with two poles
    Sphere,
    /// A closed ring
    Torus,
}

impl TopologyName {
    pub(super) fn topology(self) -> Option<Topology> {
        match self {
            TopologyName::Auto => None,
            TopologyName::Disk => Some(Topology::Disk),
            TopologyName::Tube => Some(Topology::Tube),
            TopologyName::Sphere => Some(Topology::Sphere),
            TopologyName::Torus => Some(Topology::Torus),
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug, Default)]
pub(crate) enum ParametersName {
    /// Chord length or uniform, whichever predicts every second line better
    #[default]
    Auto,
    /// Equal steps
    Uniform,
    /// By the distance between points
    Chord,
    /// By the square root of that distance
    Centripetal,
}

impl ParametersName {
    pub(super) fn kind(self) -> Option<Parameterization> {
        match self {
            ParametersName::Auto => None,
            ParametersName::Uniform => Some(Parameterization::Uniform),
            ParametersName::Chord => Some(Parameterization::ChordLength),
            ParametersName::Centripetal => Some(Parameterization::Centripetal),
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug, Default)]
pub(crate) enum UnitName {
    #[default]
    Auto,
    Mm,
    Cm,
    M,
    Um,
    In,
    Ft,
}

impl UnitName {
    pub(super) fn unit(self) -> Option<Unit> {
        match self {
            UnitName::Auto => None,
            UnitName::Mm => Some(Unit::Millimetre),
            UnitName::Cm => Some(Unit::Centimetre),
            UnitName::M => Some(Unit::Metre),
            UnitName::Um => Some(Unit::Micrometre),
            UnitName::In => Some(Unit::Inch),
            UnitName::Ft => Some(Unit::Foot),
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug, Default)]
pub(crate) enum LayoutName {
    /// Numbers read back to the same value
    #[default]
    Exact,
    /// Six decimals, packed as in Pal & Ballav 2007
    Paper,
}

impl From<LayoutName> for Layout {
    fn from(name: LayoutName) -> Self {
        match name {
            LayoutName::Exact => Layout::Exact,
            LayoutName::Paper => Layout::Paper,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug, Default)]
pub(crate) enum SchemaName {
    /// Read by every system
    #[default]
    Ap214,
    /// With area, volume and centroid, for the receiving system to compare with
    Ap242,
}

impl From<SchemaName> for Schema {
    fn from(name: SchemaName) -> Self {
        match name {
            SchemaName::Ap214 => Schema::Ap214,
            SchemaName::Ap242 => Schema::Ap242,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug, Default)]
pub(crate) enum TrimName {
    /// Trim to the border of the scan and to holes wider than three spacings; small holes of a closed surface (up to
    /// 2.5 % of it) stay closed
    #[default]
    Auto,
    /// Trim these small holes, too
    Always,
    /// Leave the surface untrimmed, up to the sides of its parameter rectangle
    Off,
}

impl From<TrimName> for Trim {
    fn from(name: TrimName) -> Self {
        match name {
            TrimName::Auto => Trim::Auto,
            TrimName::Always => Trim::Always,
            TrimName::Off => Trim::Off,
        }
    }
}

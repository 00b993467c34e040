//! Points, directions and placements of a STEP file.

use super::instance::Step;
use crate::nurbs::elementary::Frame;
use crate::{Error, Result};
use glam::DVec3;

/// Reads geometry with the units of one context.
#[derive(Debug)]
pub(super) struct Geometry<'s, 'a> {
    pub(super) step: &'s Step<'a>,
    /// Radians per unit of angle.
    pub(super) angle: f64,
    /// Points closer than this are one, in the unit of the file.
    pub(super) tolerance: f64,
    /// Whether this is the parameter plane of a surface, whose points have two coordinates.
    pub(super) planar: bool,
}

impl Geometry<'_, '_> {
    pub(super) fn error(&self, id: u64, what: impl std::fmt::Display) -> Error {
        self.step.error(id, what)
    }

    fn vector_of(&self, id: u64, name: &str) -> Result<DVec3> {
        let instance = self.step.get(id)?;
        if !instance.has(name) {
            return Err(instance.error(format_args!("a {name} should be here")));
        }
        // A complex instance holds the coordinates where it has its own name.
        let all = instance.part(name)?;
        let k = usize::from(!instance.is_complex());
        match all.reals(k)?[..] {
            [x, y, z] => Ok(DVec3::new(x, y, z)),
            [x, y] if self.planar => Ok(DVec3::new(x, y, 0.0)),
            _ if self.planar => Err(instance.error("two coordinates are needed")),
            _ => Err(instance.error("three coordinates are needed")),
        }
    }

    pub(super) fn point(&self, id: u64) -> Result<DVec3> {
        self.vector_of(id, "CARTESIAN_POINT")
    }

    /// A direction of length 1.
    pub(super) fn direction(&self, id: u64) -> Result<DVec3> {
        let direction = self.vector_of(id, "DIRECTION")?;
        direction
            .try_normalize()
            .ok_or_else(|| self.error(id, "a direction without length"))
    }

    /// A VECTOR: direction times magnitude.
    pub(super) fn vector(&self, id: u64) -> Result<DVec3> {
        let instance = self.step.get(id)?;
        if !instance.has("VECTOR") {
            return Err(instance.error("a VECTOR should be here"));
        }
        let vector = self.direction(instance.all().reference(1)?)? * instance.all().real(2)?;
        if vector == DVec3::ZERO {
            return Err(instance.error("a vector without length"));
        }
        Ok(vector)
    }

    fn optional_direction(&self, value: Option<&super::parse::Value<'_>>) -> Result<Option<DVec3>> {
        match value {
            Some(super::parse::Value::Reference(id)) => self.direction(*id).map(Some),
            _ => Ok(None),
        }
    }

    /// An `AXIS2_PLACEMENT_3D` or `AXIS1_PLACEMENT`.
    pub(super) fn frame(&self, id: u64) -> Result<Frame> {
        let instance = self.step.get(id)?;
        if !instance.has("AXIS2_PLACEMENT_3D") && !instance.has("AXIS1_PLACEMENT") {
            return Err(instance.error("an AXIS2_PLACEMENT_3D should be here"));
        }
        let all = instance.all();
        let origin = self.point(all.reference(1)?)?;
        let z = self.optional_direction(all.get(2))?.unwrap_or(DVec3::Z);
        let x = self.optional_direction(all.get(3))?;
        Frame::new(origin, z, x).map_err(|e| instance.error(e))
    }
}

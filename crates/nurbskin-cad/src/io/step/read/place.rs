//! Points, directions and placements of a STEP file.

use super::instance::{Step, real};
use super::parse::Value;
use glam::{DAffine3, DMat3, DVec3};
use nurbskin_geometry::nurbs::elementary::Frame;
use nurbskin_geometry::{Error, Result};

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
            return Err(instance.error(format_args!("the file should have a {name} here")));
        }
        // A complex instance holds the coordinates where it has its own name.
        let all = instance.part(name)?;
        let k = usize::from(!instance.is_complex());
        match all.reals(k)?[..] {
            [x, y, z] => Ok(DVec3::new(x, y, z)),
            [x, y] if self.planar => Ok(DVec3::new(x, y, 0.0)),
            _ if self.planar => Err(instance.error("the point needs two coordinates")),
            _ => Err(instance.error("the point needs three coordinates")),
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
            .ok_or_else(|| self.error(id, "the direction has no length"))
    }

    /// A VECTOR: direction times magnitude.
    pub(super) fn vector(&self, id: u64) -> Result<DVec3> {
        let instance = self.step.get(id)?;
        if !instance.has("VECTOR") {
            return Err(instance.error("a VECTOR should be here"));
        }
        let vector = self.direction(instance.all().reference(1)?)? * instance.all().real(2)?;
        if vector == DVec3::ZERO {
            return Err(instance.error("the vector has no length"));
        }
        Ok(vector)
    }

    fn optional_direction(&self, value: Option<&Value<'_>>) -> Result<Option<DVec3>> {
        match value {
            Some(Value::Reference(id)) => self.direction(*id).map(Some),
            _ => Ok(None),
        }
    }

    /// An `AXIS2_PLACEMENT_3D` or `AXIS1_PLACEMENT`; in a parameter plane an `AXIS2_PLACEMENT_2D`.
    pub(super) fn frame(&self, id: u64) -> Result<Frame> {
        let instance = self.step.get(id)?;
        if self.planar && instance.has("AXIS2_PLACEMENT_2D") {
            let all = instance.all();
            let (origin, x) = (
                self.point(all.reference(1)?)?,
                self.optional_direction(all.get(2))?,
            );
            return Frame::new(origin, DVec3::Z, x).map_err(|e| instance.error(e));
        }
        if !instance.has("AXIS2_PLACEMENT_3D") && !instance.has("AXIS1_PLACEMENT") {
            return Err(instance.error("the file should have an AXIS2_PLACEMENT_3D here"));
        }
        let all = instance.all();
        let origin = self.point(all.reference(1)?)?;
        let z = self.optional_direction(all.get(2))?.unwrap_or(DVec3::Z);
        let x = self.optional_direction(all.get(3))?;
        Frame::new(origin, z, x).map_err(|e| instance.error(e))
    }

    /// A `CARTESIAN_TRANSFORMATION_OPERATOR_3D`: rotation, mirror image, scale, shift.
    ///
    /// Source: ISO 10303-42, `base_axis`.
    pub(super) fn operator(&self, id: u64) -> Result<DAffine3> {
        let instance = self.step.get(id)?;
        let base = instance.part("CARTESIAN_TRANSFORMATION_OPERATOR")?;
        // Around the origin: names and descriptions stand before, of which writers have one to three.
        let is_point = |k: &usize| match base.get(*k) {
            Some(Value::Reference(id)) => self.step.names(*id).contains(&"CARTESIAN_POINT"),
            _ => false,
        };
        let at = (2..base.values.len()).find(is_point).map(|k| k - 2);
        let at = at.ok_or_else(|| instance.error("the origin of the placement is missing"))?;
        let third = if instance.is_complex() {
            instance
                .part("CARTESIAN_TRANSFORMATION_OPERATOR_3D")?
                .get(0)
        } else {
            base.get(at + 4)
        };
        let [x, y] = [base.get(at), base.get(at + 1)];
        let [x, y, z] = [
            self.optional_direction(x)?,
            self.optional_direction(y)?,
            self.optional_direction(third)?,
        ];
        let origin = self.point(base.reference(at + 2)?)?;
        let scale = match base.get(at + 3).and_then(real) {
            Some(scale) if scale > 0.0 && scale.is_finite() => scale,
            Some(scale) => {
                return Err(instance.error(format_args!(
                    "the transformation has a scale of {scale}, which is not a positive number"
                )));
            }
            None => 1.0,
        };
        let z = z.unwrap_or_else(|| match (x, y) {
            (Some(x), Some(y)) => x.cross(y).try_normalize().unwrap_or(DVec3::Z),
            _ => DVec3::Z,
        });
        let frame = Frame::new(origin, z, x).map_err(|e| instance.error(e))?;
        let [x, mut y] = [frame.axes.x_axis, frame.axes.y_axis];
        // The second axis says on which side: a mirror image, perhaps.
        if self
            .optional_direction(base.get(at + 1))?
            .is_some_and(|given| given.dot(y) < 0.0)
        {
            y = -y;
        }
        let axes = DMat3::from_cols(x, y, frame.axes.z_axis);
        Ok(DAffine3::from_mat3_translation(axes * scale, origin))
    }
}

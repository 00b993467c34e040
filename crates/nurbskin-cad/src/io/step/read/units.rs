//! Units and uncertainty of a STEP file.

use super::instance::{Instance, Step, real};
use super::parse::Value;
use nurbskin_geometry::Result;

/// Units of a representation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Context {
    /// Millimetres per unit, where the file says so.
    pub(super) length: Option<f64>,
    /// Radians per unit.
    pub(super) angle: f64,
    /// The uncertainty, in the unit.
    pub(super) tolerance: f64,
}

pub(super) const UNKNOWN: Context = Context {
    length: None,
    angle: 1.0,
    tolerance: 1e-5,
};

impl Step<'_> {
    /// Lengths, angles and uncertainty of a context.
    pub(super) fn context(&self, id: Option<u64>) -> Context {
        id.and_then(|id| self.get(id).ok())
            .map_or(UNKNOWN, |instance| {
                let mut context = UNKNOWN;
                if let Ok(all) = instance.part("GLOBAL_UNIT_ASSIGNED_CONTEXT") {
                    let k = if instance.is_complex() { 0 } else { 2 };
                    for unit in all.references(k).unwrap_or_default() {
                        let _ = self.unit_into(unit, &mut context);
                    }
                }
                if let Ok(all) = instance.part("GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT") {
                    let k = if instance.is_complex() { 0 } else { 2 };
                    for uncertainty in all.references(k).unwrap_or_default() {
                        let value = self.get(uncertainty).ok();
                        if let Some(value) = value.and_then(|v| v.all().get(0).and_then(real)) {
                            let millimetre = 1.0 / context.length.unwrap_or(1.0);
                            context.tolerance = value.clamp(1e-7 * millimetre, 1e-2 * millimetre);
                        }
                    }
                }
                context
            })
    }

    fn unit_into(&self, id: u64, context: &mut Context) -> Result<()> {
        let unit = self.get(id)?;
        if unit.has("LENGTH_UNIT") {
            let metres = self.scale(&unit, "METRE")?;
            context.length = metres
                .map(|m| as_written(m * 1000.0))
                .filter(|m| *m > 0.0 && m.is_finite());
        } else if unit.has("PLANE_ANGLE_UNIT") {
            let radians = self.scale(&unit, "RADIAN")?;
            context.angle = radians.filter(|r| *r > 0.0 && r.is_finite()).unwrap_or(1.0);
        }
        Ok(())
    }

    /// How many SI units this one is.
    fn scale(&self, unit: &Instance<'_, '_>, si: &str) -> Result<Option<f64>> {
        if unit.has("CONVERSION_BASED_UNIT") {
            let measure = self.get(unit.part("CONVERSION_BASED_UNIT")?.reference(1)?)?;
            let all = measure.part("MEASURE_WITH_UNIT")?;
            let base = self.get(all.reference(1)?)?;
            let factor = self.deeper(base.id, || self.scale(&base, si))?;
            let exact = |x: f64| (x * 1e12).round() / 1e12;
            return Ok(factor.map(|f| f * all.real(0).map_or(f64::NAN, exact)));
        }
        if !unit.has("SI_UNIT") {
            return Ok(None);
        }
        let all = unit.part("SI_UNIT")?;
        let k = usize::from(!unit.is_complex());
        if all.get(k + 1) != Some(&Value::Name(si)) {
            return Ok(None);
        }
        Ok(match all.get(k) {
            Some(Value::Name(prefix)) => prefix_of(prefix),
            _ => Some(1.0),
        })
    }
}

/// A factor without the rounding of the products that it is made of: to 14 digits.
fn as_written(x: f64) -> f64 {
    format!("{x:.13e}").parse().unwrap_or(x)
}

fn prefix_of(prefix: &str) -> Option<f64> {
    Some(match prefix {
        "EXA" => 1e18,
        "PETA" => 1e15,
        "TERA" => 1e12,
        "GIGA" => 1e9,
        "MEGA" => 1e6,
        "KILO" => 1e3,
        "HECTO" => 1e2,
        "DECA" => 1e1,
        "DECI" => 1e-1,
        "CENTI" => 1e-2,
        "MILLI" => 1e-3,
        "MICRO" => 1e-6,
        "NANO" => 1e-9,
        "PICO" => 1e-12,
        "FEMTO" => 1e-15,
        "ATTO" => 1e-18,
        _ => return None,
    })
}

//! Elementary functions with the same last digit on every machine.
//!
//! IEEE 754 fixes sums, products, quotients and square roots to the last bit. It does not fix sines and logarithms: those of
//! `std` come from the system's library, and differ between systems and versions. A fit takes thousands of decisions by
//! comparison, so one last digit can change a surface. These functions are those of `libm`, written in operations that are
//! fixed. The lint `clippy::disallowed_methods` keeps the others out of the library; square roots, and tests, may use `std`.

use glam::{DQuat, DVec2, DVec3};

pub use libm::{
    acos, asin, asinh, atan, atan2, cbrt, cos, cosh, exp, exp2, hypot, log as ln, log1p as ln_1p,
    log2, log10, pow as powf, sin, sinh, tan, tanh,
};

/// Sine and cosine of an angle in radians.
#[must_use]
pub fn sin_cos(angle: f64) -> (f64, f64) {
    libm::sincos(angle)
}

/// The unit vector at an angle in radians from the x axis.
///
/// ```
/// use nurbskin_geometry::math;
/// let d = math::unit_vector(0.5);
/// assert_eq!(math::direction_angle(d), 0.5);
/// ```
#[must_use]
pub fn unit_vector(angle: f64) -> DVec2 {
    let (sin, cos) = sin_cos(angle);
    DVec2::new(cos, sin)
}

/// The angle of a vector from the x axis, in (-pi, pi]; 0 for the zero vector.
#[must_use]
pub fn direction_angle(vector: DVec2) -> f64 {
    atan2(vector.y, vector.x)
}

/// The angle between two vectors, in [0, pi]; 0 if one is zero. Accurate for small angles too.
#[must_use]
pub fn angle_between(a: DVec3, b: DVec3) -> f64 {
    atan2(a.cross(b).length(), a.dot(b))
}

/// The signed angle from one vector to another, counter-clockwise positive, in (-pi, pi]; 0 if one is zero.
#[must_use]
pub fn turn(from: DVec2, to: DVec2) -> f64 {
    atan2(from.perp_dot(to), from.dot(to))
}

/// The rotation about a vector by its length in radians.
#[must_use]
pub fn rotation(vector: DVec3) -> DQuat {
    let angle = vector.length();
    // A vector whose square underflows is no rotation to a double.
    if angle == 0.0 {
        return DQuat::IDENTITY;
    }
    let (sin, cos) = sin_cos(0.5 * angle);
    let axis = vector * (sin / angle);
    DQuat::from_xyzw(axis.x, axis.y, axis.z, cos)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Two functions of libraries that are each within one unit of the last place, or of 1 near zeros.
    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() <= 2.0 * f64::EPSILON * b.abs().max(f64::MIN_POSITIVE)
    }

    proptest! {
        #[test]
        fn functions_agree_with_the_systems(x in -20.0..20.0_f64, y in -20.0..20.0_f64) {
            prop_assert!(near(sin(x), x.sin()) && near(cos(x), x.cos()) && near(exp(x), x.exp()));
            prop_assert!(near(ln(x.abs()), x.abs().ln()) && near(atan2(y, x), y.atan2(x)));
            prop_assert!(near(hypot(x, y), x.hypot(y)) && near(powf(x.abs(), y), x.abs().powf(y)));
            prop_assert_eq!(sin_cos(x), (sin(x), cos(x)));
        }

        #[test]
        fn rotations_agree_with_glam(x in -3.0..3.0_f64, y in -3.0..3.0_f64, z in -3.0..3.0_f64) {
            let v = DVec3::new(x, y, z);
            let w = DVec3::new(1.0, 2.0, 3.0);
            let same = DQuat::from_scaled_axis(v) * w;
            prop_assert!((rotation(v) * w).distance(same) < 1e-14);
            prop_assert!((angle_between(v, DVec3::X) - v.angle_between(DVec3::X)).abs() < 1e-7);
        }
    }

    /// Bits that any IEEE 754 machine gives.
    #[test]
    fn last_digits_are_fixed() {
        let bits = [sin(0.7), cos(0.7), exp(0.7), ln(0.7), atan2(0.7, -0.2)].map(f64::to_bits);
        let fixed: [u64; 5] = [
            0x3fe4_9d6e_6946_19b8,
            0x3fe8_7996_529f_9d93,
            0x4000_1c2a_6126_8987,
            0xbfd6_d3c3_24e1_3f50,
            0x3ffd_95e5_ac22_d08d,
        ];
        assert_eq!(bits, fixed);
        assert_eq!(rotation(DVec3::ZERO), DQuat::IDENTITY);
    }
}

//! Numbers that carry their derivatives, so that a shape is written once as a formula.

use nurbskin_geometry::math;
use std::ops::{Add, Mul, Neg, Sub};

/// A function of (u, v) at one place: its value and its partial derivatives to second order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Jet {
    pub(super) value: f64,
    pub(super) u: f64,
    pub(super) v: f64,
    pub(super) uu: f64,
    pub(super) uv: f64,
    pub(super) vv: f64,
}

impl Jet {
    pub(super) fn constant(value: f64) -> Self {
        Self {
            value,
            u: 0.0,
            v: 0.0,
            uu: 0.0,
            uv: 0.0,
            vv: 0.0,
        }
    }
    /// The parameter u itself.
    pub(super) fn parameter_u(value: f64) -> Self {
        Self {
            u: 1.0,
            ..Self::constant(value)
        }
    }
    /// The parameter v itself.
    pub(super) fn parameter_v(value: f64) -> Self {
        Self {
            v: 1.0,
            ..Self::constant(value)
        }
    }
    /// f of this jet, from f, f' and f'' at its value: the chain rule to second order.
    fn chain(self, f: f64, d: f64, dd: f64) -> Self {
        Self {
            value: f,
            u: d * self.u,
            v: d * self.v,
            uu: d * self.uu + dd * self.u * self.u,
            uv: d * self.uv + dd * self.u * self.v,
            vv: d * self.vv + dd * self.v * self.v,
        }
    }
    pub(super) fn sin(self) -> Self {
        let (s, c) = math::sin_cos(self.value);
        self.chain(s, c, -s)
    }
    pub(super) fn cos(self) -> Self {
        let (s, c) = math::sin_cos(self.value);
        self.chain(c, -s, -c)
    }
    pub(super) fn square(self) -> Self {
        self * self
    }
    /// exp(-x^2)
    pub(super) fn bell(self) -> Self {
        let x = self.value;
        let f = math::exp(-x * x);
        self.chain(f, -2.0 * x * f, (4.0 * x * x - 2.0) * f)
    }
    /// x^exponent for x >= 0; an infinite derivative at 0 is cut to a large finite one.
    pub(super) fn power(self, exponent: f64) -> Self {
        let x = self.value.max(1e-12);
        let f = math::powf(self.value.max(0.0), exponent);
        let d = exponent * math::powf(x, exponent - 1.0);
        let dd = exponent * (exponent - 1.0) * math::powf(x, exponent - 2.0);
        self.chain(f, d, dd)
    }
}

impl Add for Jet {
    type Output = Jet;
    fn add(self, b: Jet) -> Jet {
        Jet {
            value: self.value + b.value,
            u: self.u + b.u,
            v: self.v + b.v,
            uu: self.uu + b.uu,
            uv: self.uv + b.uv,
            vv: self.vv + b.vv,
        }
    }
}
impl Sub for Jet {
    type Output = Jet;
    fn sub(self, b: Jet) -> Jet {
        self + -b
    }
}
impl Neg for Jet {
    type Output = Jet;
    fn neg(self) -> Jet {
        self * -1.0
    }
}
impl Mul for Jet {
    type Output = Jet;
    fn mul(self, b: Jet) -> Jet {
        let a = self;
        Jet {
            value: a.value * b.value,
            u: a.u * b.value + a.value * b.u,
            v: a.v * b.value + a.value * b.v,
            uu: a.uu * b.value + 2.0 * a.u * b.u + a.value * b.uu,
            uv: a.uv * b.value + a.u * b.v + a.v * b.u + a.value * b.uv,
            vv: a.vv * b.value + 2.0 * a.v * b.v + a.value * b.vv,
        }
    }
}
impl Mul<f64> for Jet {
    type Output = Jet;
    fn mul(self, b: f64) -> Jet {
        Jet {
            value: self.value * b,
            u: self.u * b,
            v: self.v * b,
            uu: self.uu * b,
            uv: self.uv * b,
            vv: self.vv * b,
        }
    }
}
impl Mul<Jet> for f64 {
    type Output = Jet;
    fn mul(self, b: Jet) -> Jet {
        b * self
    }
}
impl Add<f64> for Jet {
    type Output = Jet;
    fn add(self, b: f64) -> Jet {
        Jet {
            value: self.value + b,
            ..self
        }
    }
}
impl Sub<f64> for Jet {
    type Output = Jet;
    fn sub(self, b: f64) -> Jet {
        self + -b
    }
}
impl Add<Jet> for f64 {
    type Output = Jet;
    fn add(self, b: Jet) -> Jet {
        b + self
    }
}
impl Sub<Jet> for f64 {
    type Output = Jet;
    fn sub(self, b: Jet) -> Jet {
        -b + self
    }
}

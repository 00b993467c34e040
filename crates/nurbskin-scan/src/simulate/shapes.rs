//! Shapes given by formulas.

use super::jet::Jet;
use glam::DVec3;
use nurbskin_geometry::nurbs::SurfaceDerivatives;
use std::f64::consts::{PI, TAU};

/// A shape for the virtual scanner, in millimetres. The first four are the objects of Pal & Ballav 2007.
///
/// Each is a formula S(u, v) on [0, 1] x [0, 1] whose normal `S_u x S_v` points outward (upward for sheets); closed
/// shapes are closed in v. All stand where a scanner's table would be: every coordinate lies between 100 and 1000.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// The metallic pot (figure 1): a surface of revolution about a vertical axis, u up its profile.
    Pot,
    /// The styled patch (figure 7): the bicubic surface through 4 x 4 points at the parameters 0, 1/3, 2/3, 1.
    Patch,
    /// The boy's face (figures 14-16): a height field 150 mm wide (v) and 200 mm high (u).
    Face,
    /// The ergonomic handle of a vegetable peeler (figures 17 and 18): a wrapper surface, u along it.
    Handle,
    /// A sphere of radius 50 with its poles at the ends of u.
    Sphere,
    /// An ellipsoid of semi-axes 40, 25 and 60 with its poles at the ends of u.
    Ellipsoid,
    /// A torus of radii 45 and 16, u around the ring's section.
    Torus,
    /// A bent tube of varying, non-circular section, u along it.
    Tube,
    /// A hyperbolic paraboloid over a square of 100 mm.
    Saddle,
    /// A twisted, tapered, cambered blade, u along its span and v around its section.
    Blade,
    /// A rectangle of 120 x 80.
    Plane,
}

/// The styled patch's data points `Q_{i,j}`, i along u fastest, to four decimals as in the paper.
pub(super) const PATCH_POINTS: [[f64; 3]; 16] = [
    [210.0, 205.5, 312.4175],
    [258.3125, 196.4375, 341.8625],
    [311.6875, 201.25, 297.5375],
    [360.0, 212.8125, 329.75],
    [202.4375, 251.1875, 337.6250],
    [254.75, 247.9375, 361.0875],
    [309.125, 250.5625, 322.4625],
    [367.5625, 255.375, 301.1125],
    [206.8125, 303.625, 306.9375],
    [260.4375, 308.25, 331.5125],
    [313.9375, 305.875, 352.0375],
    [364.25, 301.4375, 339.2875],
    [214.5625, 352.75, 328.3625],
    [263.875, 361.3125, 302.7875],
    [316.5, 357.0625, 318.6125],
    [357.1875, 348.625, 346.4375],
];

/// Semi-axes of the ellipsoid.
pub(super) const ELLIPSOID: DVec3 = DVec3::new(40.0, 25.0, 60.0);
/// Radius of the sphere.
pub(super) const SPHERE: f64 = 50.0;
/// Radii of the torus: of the ring and of its section.
pub(super) const TORUS: [f64; 2] = [45.0, 16.0];
/// Sides of the plane.
pub(super) const PLANE: [f64; 2] = [120.0, 80.0];

impl Shape {
    /// All shapes, in the order of the documentation.
    pub const ALL: [Shape; 11] = [
        Shape::Pot,
        Shape::Patch,
        Shape::Face,
        Shape::Handle,
        Shape::Sphere,
        Shape::Ellipsoid,
        Shape::Torus,
        Shape::Tube,
        Shape::Saddle,
        Shape::Blade,
        Shape::Plane,
    ];

    /// The shape's name on the command line: `pot`, `patch`, `face` ...
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Shape::Pot => "pot",
            Shape::Patch => "patch",
            Shape::Face => "face",
            Shape::Handle => "handle",
            Shape::Sphere => "sphere",
            Shape::Ellipsoid => "ellipsoid",
            Shape::Torus => "torus",
            Shape::Tube => "tube",
            Shape::Saddle => "saddle",
            Shape::Blade => "blade",
            Shape::Plane => "plane",
        }
    }

    /// The shape of this name, upper or lower case.
    ///
    /// ```
    /// use nurbskin_scan::simulate::Shape;
    /// assert_eq!(Shape::from_name("Torus"), Some(Shape::Torus));
    /// assert_eq!(Shape::from_name("teapot"), None);
    /// ```
    #[must_use]
    pub fn from_name(name: &str) -> Option<Shape> {
        Shape::ALL
            .into_iter()
            .find(|shape| shape.name().eq_ignore_ascii_case(name))
    }

    /// Whether u and v are closed.
    #[must_use]
    pub fn closed(self) -> [bool; 2] {
        match self {
            Shape::Patch | Shape::Face | Shape::Saddle | Shape::Plane => [false, false],
            Shape::Torus => [true, true],
            _ => [false, true],
        }
    }

    /// Whether each end of u is one point.
    #[must_use]
    pub fn has_poles(self) -> bool {
        matches!(self, Shape::Sphere | Shape::Ellipsoid)
    }

    /// Whether the shape is a tube: closed in v, with a rim at each end of u.
    #[must_use]
    pub fn is_tube(self) -> bool {
        self.closed() == [false, true] && !self.has_poles()
    }

    /// Points along u and number of rows of a scan whose size nobody said; the paper's totals for its four objects:
    /// pot 13 159 (a prime: rows of 91 and 92 points), patch 16, face 10 031 (rows of 128 and 129), handle 12 000.
    #[must_use]
    pub fn default_counts(self) -> (usize, usize) {
        match self {
            Shape::Pot => (13_159, 144),
            Shape::Patch => (16, 4),
            Shape::Face => (10_031, 78),
            Shape::Handle | Shape::Tube => (12_000, 100),
            Shape::Sphere
            | Shape::Ellipsoid
            | Shape::Torus
            | Shape::Saddle
            | Shape::Blade
            | Shape::Plane => (10_000, 100),
        }
    }

    /// Where the shape's own origin stands.
    pub(super) fn origin(self) -> DVec3 {
        match self {
            Shape::Patch => DVec3::ZERO,
            Shape::Face => DVec3::new(300.0, 300.0, 200.0),
            _ => DVec3::new(300.0, 300.0, 300.0),
        }
    }

    /// S and its derivatives to second order at (u, v).
    #[must_use]
    pub fn derivatives(self, u: f64, v: f64) -> SurfaceDerivatives {
        let [x, y, z] = self.jets(Jet::parameter_u(u), Jet::parameter_v(v));
        let vector = |part: fn(&Jet) -> f64| DVec3::new(part(&x), part(&y), part(&z));
        SurfaceDerivatives {
            point: vector(|j| j.value) + self.origin(),
            du: vector(|j| j.u),
            dv: vector(|j| j.v),
            duu: vector(|j| j.uu),
            duv: vector(|j| j.uv),
            dvv: vector(|j| j.vv),
        }
    }

    fn jets(self, u: Jet, v: Jet) -> [Jet; 3] {
        match self {
            Shape::Pot => pot(u, v),
            Shape::Patch => patch(u, v),
            Shape::Face => face(u, v),
            Shape::Handle => handle(u, v),
            Shape::Sphere => ellipsoid(u, v, DVec3::splat(SPHERE)),
            Shape::Ellipsoid => ellipsoid(u, v, ELLIPSOID),
            Shape::Torus => {
                let [ring, section] = TORUS;
                let (angle, turn) = (u * TAU, v * -TAU);
                let radius = ring + section * angle.cos();
                [
                    radius * turn.cos(),
                    radius * turn.sin(),
                    section * angle.sin(),
                ]
            }
            Shape::Tube => tube(u, v),
            Shape::Saddle => {
                let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
                [50.0 * x, 50.0 * y, 20.0 * (x.square() - y.square())]
            }
            Shape::Blade => blade(u, v),
            Shape::Plane => [
                (u - 0.5) * PLANE[0],
                (v - 0.5) * PLANE[1],
                Jet::constant(0.0),
            ],
        }
    }
}

/// A wavy profile with a rolled rim, turned about z. v runs clockwise from above, so that `S_u x S_v` points outward.
fn pot(s: Jet, v: Jet) -> [Jet; 3] {
    let wave = (2.4 * PI * s.power(1.2)).sin();
    let rim = ((s - 0.93) * 20.0).bell();
    let radius = 38.0 + 14.0 * wave + 6.0 * rim;
    let turn = v * -TAU;
    [radius * turn.cos(), radius * turn.sin(), 120.0 * s]
}

/// The tensor product of the cubic Lagrange polynomials at 0, 1/3, 2/3, 1: what interpolation with uniform
/// parameters of 4 x 4 points gives, since there is no interior knot.
fn patch(u: Jet, v: Jet) -> [Jet; 3] {
    let lagrange = |t: Jet| {
        let t = 3.0 * t;
        let (a, b, c) = (t - 1.0, t - 2.0, t - 3.0);
        [
            (-1.0 / 6.0) * (a * b * c),
            0.5 * (t * b * c),
            -0.5 * (t * a * c),
            (1.0 / 6.0) * (t * a * b),
        ]
    };
    let (in_u, in_v) = (lagrange(u), lagrange(v));
    std::array::from_fn(|axis| {
        let mut sum = Jet::constant(0.0);
        for (k, point) in PATCH_POINTS.iter().enumerate() {
            sum = sum + in_u[k % 4] * in_v[k / 4] * point[axis];
        }
        sum
    })
}

/// A vaulted oval with nose, eye sockets, lips and chin as bells. u goes up, v from the right ear to the left.
fn face(u: Jet, v: Jet) -> [Jet; 3] {
    let (x, y) = (75.0 - 150.0 * v, 200.0 * u - 100.0);
    let bell = |cx: f64, cy: f64, width: f64, height: f64, size: f64| {
        size * ((x - cx) * (1.0 / width)).bell() * ((y - cy) * (1.0 / height)).bell()
    };
    let vault = 1.0 - (x * (1.0 / 95.0)).square() - (y * (1.0 / 130.0)).square();
    let z = 70.0 * vault + bell(0.0, 0.0, 9.0, 22.0, 24.0) + bell(0.0, -14.0, 13.0, 9.0, 9.0)
        - bell(-30.0, 24.0, 15.0, 11.0, 10.0)
        - bell(30.0, 24.0, 15.0, 11.0, 10.0)
        + bell(0.0, -45.0, 22.0, 6.0, 6.0)
        - bell(0.0, -53.0, 24.0, 3.5, 3.0)
        + bell(0.0, -62.0, 20.0, 6.0, 5.0)
        + bell(0.0, -88.0, 25.0, 12.0, 8.0);
    [x, y, z]
}

/// A handle 120 mm long on a bowed axis, with finger grips below and a palm swell above.
fn handle(s: Jet, v: Jet) -> [Jet; 3] {
    // The seam lies below (angle -pi/2), where the opening is.
    let turn = v * -TAU - 0.5 * PI;
    let (c, d) = (turn.cos(), turn.sin());
    let axis = 7.0 * (PI * s).sin();
    let width = 10.0 + 3.0 * (2.0 * PI * s - 0.6).sin() + 1.5 * ((s - 0.12) * 9.0).bell();
    let height = 8.5 + 2.0 * (PI * s).sin() + 1.1 * (5.0 * PI * s).cos();
    // A section flatter than an ellipse, and pointed towards the palm.
    let section = 1.0 + 0.06 * (4.0 * turn).cos() + 0.08 * d;
    [120.0 * s, width * section * c, axis + height * section * d]
}

/// v runs clockwise from above, u from the lower pole to the upper.
fn ellipsoid(u: Jet, v: Jet, axes: DVec3) -> [Jet; 3] {
    let (polar, turn) = (u * PI, v * -TAU);
    let ring = polar.sin();
    [
        axes.x * ring * turn.cos(),
        axes.y * ring * turn.sin(),
        -axes.z * polar.cos(),
    ]
}

/// An arc of 74 degrees swept by a section whose size, flatness and symmetry change.
fn tube(s: Jet, v: Jet) -> [Jet; 3] {
    let (angle, turn) = (1.3 * s, v * -TAU);
    let radius = 9.0 + 4.0 * (2.2 * PI * s).sin() + 2.0 * ((s - 0.75) * (1.0 / 0.06)).bell();
    let oval = 1.0 + 0.35 * (PI * s).cos().square();
    let across = radius * oval * turn.cos();
    let up = radius * (turn.sin() + 0.12 * (2.0 * turn).sin());
    [
        90.0 * angle.sin() - across * angle.sin(),
        90.0 * (1.0 - angle.cos()) + across * angle.cos(),
        up,
    ]
}

/// A blade 100 mm long whose chord shrinks from 45 to 30 mm while it twists by 35 degrees.
fn blade(s: Jet, v: Jet) -> [Jet; 3] {
    let turn = v * -TAU;
    let (c, d) = (turn.cos(), turn.sin());
    let half = 22.5 - 7.5 * s;
    let thickness = 3.6 - 1.4 * s;
    let x = half * c;
    let y = thickness * (1.0 + 0.45 * c) * d + 0.16 * half * (1.0 - c.square());
    let (twist_sin, twist_cos) = ((0.61 * s).sin(), (0.61 * s).cos());
    [
        x * twist_cos - y * twist_sin,
        x * twist_sin + y * twist_cos,
        100.0 * s,
    ]
}

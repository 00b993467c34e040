//! The scanned shapes: formulas, sampled at random with noise along the normal and outliers.

use glam::{DQuat, DVec2, DVec3};
use nurbskin::chart::{Chart, Topology};
use std::f64::consts::{PI, TAU};

/// A small generator of repeatable numbers (xorshift64*, Vigna 2016).
pub(crate) struct Random(u64);

impl Random {
    fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }
    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.normal(), self.normal(), self.normal())
    }
}

/// A shape over the unit square, and how it is scanned.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    pub(crate) points: usize,
    pub(crate) sigma: f64,
    /// Share of outliers and their spread.
    pub(crate) outliers: [f64; 2],
    pub(crate) tolerance: f64,
    pub(crate) budget: Option<usize>,
    /// Control points, largest and root mean square error to beat.
    pub(crate) ceilings: [Option<f64>; 3],
    pub(crate) shape: Shape,
    /// Whether it is to be recognised as a surface of revolution, without a chart.
    pub(crate) recognised: bool,
    /// Whether all points are exact and on a lattice of so many places; else scattered.
    pub(crate) lattice: Option<[usize; 2]>,
}

#[derive(Clone, Copy)]
pub(crate) enum Shape {
    Pot,
    Face,
    Tube,
    Sphere,
    Bump,
    Dome,
}

fn gauss(x: f64, y: f64, [cx, cy, sx, sy, height]: [f64; 5]) -> f64 {
    height * (-((x - cx) / sx).powi(2) - ((y - cy) / sy).powi(2)).exp()
}

/// Height of a face: forehead, nose, eye sockets, lips, chin.
fn face(x: f64, y: f64) -> f64 {
    const FEATURES: [[f64; 5]; 8] = [
        [0., 0., 9., 22., 24.],
        [0., -14., 13., 9., 9.],
        [-30., 24., 15., 11., -10.],
        [30., 24., 15., 11., -10.],
        [0., -45., 22., 6., 6.],
        [0., -53., 24., 3.5, -3.],
        [0., -62., 20., 6., 5.],
        [0., -88., 25., 12., 8.],
    ];
    let shell = 70.0 * (1.0 - (x / 95.0).powi(2) - (y / 130.0).powi(2));
    shell + FEATURES.iter().map(|&f| gauss(x, y, f)).sum::<f64>()
}

impl Shape {
    /// The point at (s, t) of the unit square.
    fn at(self, s: f64, t: f64) -> DVec3 {
        let (sin, cos) = (TAU * t).sin_cos();
        match self {
            Shape::Pot => {
                let rim = 6.0 * (-((s - 0.93) / 0.05).powi(2)).exp();
                let r = 38.0 + 14.0 * (2.4 * PI * s.max(0.0).powf(1.2)).sin() + rim;
                DVec3::new(r * cos, r * sin, 120.0 * s)
            }
            Shape::Face => {
                let (x, y) = (150.0 * s - 75.0, 200.0 * t - 100.0);
                DVec3::new(x, y, face(x, y))
            }
            Shape::Tube => {
                let (b, a) = (1.3 * s).sin_cos();
                let r =
                    9.0 + 4.0 * (2.2 * PI * s).sin() + 2.0 * (-((s - 0.75) / 0.06).powi(2)).exp();
                let wide = r * (1.0 + 0.35 * (PI * s).cos().powi(2));
                let up = r * (sin + 0.12 * (2.0 * TAU * t).sin());
                DVec3::new(
                    90.0 * b - b * wide * cos,
                    90.0 * (1.0 - a) + a * wide * cos,
                    up,
                )
            }
            Shape::Sphere => {
                let (b, a) = (PI * s).sin_cos();
                50.0 * DVec3::new(b * cos, b * sin, a)
            }
            Shape::Bump => {
                let (x, y) = (50.0 * s.sqrt() * cos, 50.0 * s.sqrt() * sin);
                let waves = (TAU * x / 40.0).sin() * (TAU * y / 35.0).cos();
                DVec3::new(x, y, 20.0 * (PI * x.hypot(y) / 120.0).cos() + 3.0 * waves)
            }
            Shape::Dome => {
                let c = 1.0 - s * 1.5;
                let b = (1.0 - c * c).max(0.0).sqrt();
                let r = 40.0 * (1.0 + 0.06 * (5.0 * TAU * t).cos() * b * b * c);
                r * DVec3::new(b * cos, b * sin, c)
            }
        }
    }
    /// Unit normal, by differences.
    fn normal(self, s: f64, t: f64) -> DVec3 {
        let h = 1e-6;
        let (s0, s1) = ((s - h).max(0.0), (s + h).min(1.0));
        let du = self.at(s1, t) - self.at(s0, t);
        let dv = self.at(s, t + h) - self.at(s, t - h);
        du.cross(dv).normalize_or_zero()
    }
    /// A chart as one would choose it for a point near the shape.
    fn chart(self, p: DVec3) -> DVec2 {
        let turn = |a: f64| (a / TAU).rem_euclid(1.0);
        let on = match self {
            Shape::Pot => DVec2::new(p.z / 120.0, turn(p.y.atan2(p.x))),
            Shape::Face => DVec2::new(p.x / 150.0 + 0.5, p.y / 200.0 + 0.5),
            Shape::Bump => 0.5 + p.truncate() / 100.0,
            Shape::Dome => {
                let from_top = p.truncate().length().atan2(p.z);
                0.5 + 0.5 * from_top / (TAU / 3.0) * p.truncate().normalize_or_zero()
            }
            // Only fitted as lattices, whose parameters are known.
            Shape::Tube | Shape::Sphere => DVec2::ZERO,
        };
        DVec2::new(on.x.clamp(0.0, 1.0), on.y.clamp(0.0, 1.0))
    }
    fn topology(self) -> Topology {
        match self {
            Shape::Pot | Shape::Tube => Topology::Tube,
            Shape::Sphere => Topology::Sphere,
            _ => Topology::Disk,
        }
    }
    fn size(self) -> [f64; 2] {
        match self {
            Shape::Pot => [140.0, 240.0],
            Shape::Face => [150.0, 200.0],
            Shape::Tube => [120.0, 70.0],
            Shape::Sphere => [157.0, 200.0],
            Shape::Bump => [100.0, 100.0],
            Shape::Dome => [168.0, 168.0],
        }
    }
}

/// The cases of the table.
pub(crate) fn cases() -> Vec<Case> {
    let exact = |name, shape, lattice: [usize; 2], count| Case {
        name,
        points: lattice[0] * lattice[1],
        sigma: 0.0,
        outliers: [0.0; 2],
        tolerance: 0.1,
        budget: None,
        ceilings: [Some(count), Some(0.1), None],
        shape,
        recognised: false,
        lattice: Some(lattice),
    };
    let noisy = |name, shape, points, sigma, outliers, tolerance, ceilings| Case {
        name,
        points,
        sigma,
        outliers,
        tolerance,
        budget: None,
        ceilings,
        shape,
        recognised: false,
        lattice: None,
    };
    let some = |c: [f64; 3]| c.map(|x| (x > 0.0).then_some(x));
    let bump = |name, n, rms| {
        noisy(
            name,
            Shape::Bump,
            n,
            0.05,
            [0.0; 2],
            0.15,
            some([576.0, 0.0, rms]),
        )
    };
    let pot = |name, ceilings| {
        let (points, sigma, outliers) = (13_159, 0.05, [0.01, 6.0]);
        noisy(
            name,
            Shape::Pot,
            points,
            sigma,
            outliers,
            0.1,
            some(ceilings),
        )
    };
    vec![
        exact("pot, exact", Shape::Pot, [115, 115], 120.0),
        exact("face, exact", Shape::Face, [101, 100], 644.0),
        exact("tube, exact", Shape::Tube, [120, 100], 144.0),
        exact("sphere, exact", Shape::Sphere, [100, 100], 56.0),
        pot("pot, sigma 0.05", [136.0, 0.083, 0.018]),
        Case {
            recognised: true,
            ..pot("pot, recognised", [198.0, 0.084, 0.009])
        },
        noisy(
            "face, sigma 0.1",
            Shape::Face,
            20_000,
            0.1,
            [0.005, 8.0],
            0.3,
            some([714.0, 0.19, 0.024]),
        ),
        noisy(
            "face, sigma 0.02",
            Shape::Face,
            20_000,
            0.02,
            [0.005, 8.0],
            0.1,
            some([1092.0, 0.096, 0.0087]),
        ),
        bump("bump 10k", 10_000, 0.013),
        bump("bump 100k", 100_000, 0.0038),
        bump("bump 1M", 1_000_000, 0.0015),
        noisy(
            "dome 10k",
            Shape::Dome,
            10_000,
            0.05,
            [0.0; 2],
            0.15,
            some([0.0, 0.0, 0.02]),
        ),
        noisy(
            "dome 100k",
            Shape::Dome,
            100_000,
            0.05,
            [0.0; 2],
            0.15,
            [None; 3],
        ),
    ]
}

/// A scan in a pose and a unit of its own.
pub(crate) struct Posed {
    pub(crate) points: Vec<DVec3>,
    pub(crate) chart: Chart,
    /// Points of the true surface.
    pub(crate) truth: Vec<DVec3>,
    /// Length of a millimetre.
    pub(crate) unit: f64,
}

/// The scan of a case.
pub(crate) fn posed(case: &Case, seed: u64) -> Posed {
    let mut random = Random::new(seed);
    let shape = case.shape;
    let axis = random.vector().normalize_or_zero();
    let turn = DQuat::from_axis_angle(axis, TAU * random.uniform());
    let unit = 10_f64.powf(6.0 * random.uniform() - 3.0);
    let shift = 200.0 * random.vector();
    let pose = |p: DVec3| unit * (turn * p + shift);
    let mut points = Vec::with_capacity(case.points);
    let mut parameters = Vec::with_capacity(case.points);
    for k in 0..case.points {
        let (s, t) = match case.lattice {
            Some([m, n]) => {
                let closed = shape.topology() != Topology::Disk;
                let last = if closed { n } else { n - 1 };
                (
                    (k % m) as f64 / (m - 1) as f64,
                    (k / m) as f64 / last as f64,
                )
            }
            None => (random.uniform(), random.uniform()),
        };
        let mut p = shape.at(s, t) + case.sigma * random.normal() * shape.normal(s, t);
        if random.uniform() < case.outliers[0] {
            p += case.outliers[1] * random.vector();
        }
        points.push(pose(p));
        parameters.push(match case.lattice {
            Some(_) => DVec2::new(s, t),
            None => shape.chart(p),
        });
    }
    // Every place of the lattice, or as many scattered ones as show the largest error well.
    let truth = match case.lattice {
        Some(_) => points.clone(),
        None => (0..10_000)
            .map(|_| pose(shape.at(random.uniform(), random.uniform())))
            .collect(),
    };
    Posed {
        points,
        chart: Chart {
            topology: shape.topology(),
            parameters,
            size: shape.size().map(|s| s * unit),
            reason: String::new(),
        },
        truth,
        unit,
    }
}

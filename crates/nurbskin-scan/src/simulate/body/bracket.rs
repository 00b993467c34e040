//! An L-shaped bracket of planes and cylinders, with exact distances.
//!
//! The solid is an L-shaped profile in (x, z), extruded along y, less two round holes across the legs. Its surface is a
//! set of faces: rectangles, some with a round hole, and cylinders. The closest point of a rectangle is a clamped
//! projection; inside its hole it is on the circle. The closest point of the surface is the closest over all faces.

use super::super::random::Random;
use super::forms::Level;
use glam::{DVec2, DVec3};
use nurbskin_geometry::math;
use std::f64::consts::TAU;

/// The profile in (x, z), anticlockwise with x to the right and z up, mm, by design: the foot lies on z = 0, the
/// upright leg on x = 0. The corner of index 3 is the inner one.
pub(super) const PROFILE: [[f64; 2]; 6] = [
    [-40.0, -35.0],
    [40.0, -35.0],
    [40.0, -23.0],
    [-28.0, -23.0],
    [-28.0, 35.0],
    [-40.0, 35.0],
];
/// The ends of the extrusion along y, mm, by design.
pub(super) const DEPTH: [f64; 2] = [-25.0, 25.0];
/// Radius of the holes, mm, by design.
pub(super) const HOLE: f64 = 10.0;

/// A through hole along an axis of the frame.
pub(super) struct Hole {
    /// Its axis: 0 for x, 2 for z.
    pub(super) along: usize,
    /// A point of its axis.
    pub(super) centre: DVec3,
    /// Where it begins and ends along the axis.
    pub(super) range: [f64; 2],
}

/// The holes: through the foot and through the upright leg.
pub(super) const HOLES: [Hole; 2] = [
    Hole {
        along: 2,
        centre: DVec3::new(8.0, 0.0, 0.0),
        range: [-35.0, -23.0],
    },
    Hole {
        along: 0,
        centre: DVec3::new(0.0, 0.0, 8.0),
        range: [-40.0, -28.0],
    },
];

impl Hole {
    /// Splits a point into its vector from the axis and its place along the axis.
    pub(super) fn split(&self, point: DVec3) -> (DVec3, f64) {
        let mut across = point - self.centre;
        across[self.along] = 0.0;
        (across, point[self.along])
    }

    /// A point from its vector from the axis and its place along the axis.
    pub(super) fn join(&self, across: DVec3, place: f64) -> DVec3 {
        let mut point = self.centre + across;
        point[self.along] = place;
        point
    }
}

/// A face: a box that is flat along one axis, or the cylinder of a hole.
enum Face {
    Flat {
        low: DVec3,
        high: DVec3,
        normal: DVec3,
        hole: Option<&'static Hole>,
    },
    Round(&'static Hole),
}

/// The faces; the L-shaped ends are two rectangles each.
fn faces() -> impl Iterator<Item = Face> {
    let sides = (0..PROFILE.len()).map(|k| {
        let ([x0, z0], [x1, z1]) = (PROFILE[k], PROFILE[(k + 1) % PROFILE.len()]);
        let (a, b) = (DVec3::new(x0, DEPTH[0], z0), DVec3::new(x1, DEPTH[1], z1));
        let normal = DVec3::new(z1 - z0, 0.0, x0 - x1).normalize();
        // A hole begins and ends in the planes of the faces that it crosses.
        let hole = HOLES.iter().find(|hole| {
            normal[hole.along].abs() > 0.5
                && hole
                    .range
                    .iter()
                    .any(|&end| (a[hole.along] - end).abs() < 1e-9)
        });
        Face::Flat {
            low: a.min(b),
            high: a.max(b),
            normal,
            hole,
        }
    });
    let ends = [(DEPTH[0], -1.0), (DEPTH[1], 1.0)]
        .into_iter()
        .flat_map(|(y, sign)| {
            [(0, 2), (3, 5)].map(|(k, l)| {
                let (a, b) = (PROFILE[k], PROFILE[l]);
                let (a, b) = (DVec3::new(a[0], y, a[1]), DVec3::new(b[0], y, b[1]));
                Face::Flat {
                    low: a.min(b),
                    high: a.max(b),
                    normal: sign * DVec3::Y,
                    hole: None,
                }
            })
        });
    sides.chain(ends).chain(HOLES.iter().map(Face::Round))
}

impl Face {
    /// The closest point of the face and the outward normal there.
    fn closest(&self, point: DVec3) -> (DVec3, DVec3) {
        match self {
            Face::Flat {
                low,
                high,
                normal,
                hole,
            } => {
                let mut foot = point.clamp(*low, *high);
                if let Some(hole) = hole {
                    let (across, place) = hole.split(foot);
                    if across.length() < HOLE {
                        foot = hole.join(HOLE * direction(across, hole), place);
                    }
                }
                (foot, *normal)
            }
            Face::Round(hole) => {
                let (across, place) = hole.split(point);
                let outward = direction(across, hole);
                let place = place.clamp(hole.range[0], hole.range[1]);
                (hole.join(HOLE * outward, place), -outward)
            }
        }
    }

    fn area(&self) -> f64 {
        match self {
            Face::Flat {
                low, high, hole, ..
            } => {
                let [x, y, z] = (*high - *low).to_array();
                let disk = if hole.is_some() {
                    0.5 * TAU * HOLE * HOLE
                } else {
                    0.0
                };
                x * y + y * z + z * x - disk
            }
            Face::Round(hole) => TAU * HOLE * (hole.range[1] - hole.range[0]),
        }
    }

    /// A random point, evenly over the area, and the outward normal.
    fn sample(&self, random: &mut Random) -> (DVec3, DVec3) {
        match self {
            Face::Flat {
                low,
                high,
                normal,
                hole,
            } => loop {
                let part = DVec3::new(random.uniform(), random.uniform(), random.uniform());
                let point = *low + part * (*high - *low);
                if hole.is_none_or(|hole| hole.split(point).0.length() >= HOLE) {
                    return (point, *normal);
                }
            },
            Face::Round(hole) => {
                let (s, c) = math::sin_cos(TAU * random.uniform());
                let mut across = DVec3::ZERO;
                across[(hole.along + 1) % 3] = c;
                across[(hole.along + 2) % 3] = s;
                let place = hole.range[0] + random.uniform() * (hole.range[1] - hole.range[0]);
                (hole.join(HOLE * across, place), -across)
            }
        }
    }
}

/// The unit vector of `across`; any across the axis for a point of the axis.
fn direction(across: DVec3, hole: &Hole) -> DVec3 {
    let mut other = DVec3::ZERO;
    other[(hole.along + 1) % 3] = 1.0;
    across.normalize_or(other)
}

/// The closest point of the surface and the outward normal of its face; on an edge that of either face.
pub(super) fn closest(point: DVec3) -> (DVec3, DVec3) {
    let mut best = (f64::INFINITY, (point, DVec3::Z));
    for face in faces() {
        let foot = face.closest(point);
        let distance = foot.0.distance_squared(point);
        if distance < best.0 {
            best = (distance, foot);
        }
    }
    best.1
}

/// Whether a point is inside of the solid.
fn is_inside(point: DVec3) -> bool {
    let within = |x: f64, [low, high]: [f64; 2]| low < x && x < high;
    let [corner, _, inner] = [PROFILE[0], PROFILE[1], PROFILE[3]];
    let foot =
        within(point.z, [corner[1], inner[1]]) && within(point.x, [corner[0], PROFILE[1][0]]);
    let leg = within(point.x, [corner[0], inner[0]]) && within(point.z, [corner[1], PROFILE[5][1]]);
    let through = |hole: &Hole| {
        let (across, place) = hole.split(point);
        across.length() < HOLE && within(place, hole.range)
    };
    within(point.y, DEPTH) && (foot || leg) && !HOLES.iter().any(through)
}

/// The exact signed distance, negative inside, and its gradient; on the surface the gradient is a face's normal.
pub(super) fn level(point: DVec3) -> Level {
    let (foot, normal) = closest(point);
    let offset = point - foot;
    let sign = if is_inside(point) { -1.0 } else { 1.0 };
    let distance = offset.length();
    Level {
        value: sign * distance,
        gradient: if distance > 1e-9 {
            sign * offset / distance
        } else {
            normal
        },
    }
}

/// A random point of the surface, evenly over its area, and the outward normal there.
pub(super) fn sample(random: &mut Random) -> (DVec3, DVec3) {
    let total: f64 = faces().map(|face| face.area()).sum();
    let mut left = random.uniform() * total;
    let mut last = None;
    for face in faces() {
        left -= face.area();
        last = Some(face);
        if left <= 0.0 {
            break;
        }
    }
    last.map_or((DVec3::ZERO, DVec3::Z), |face| face.sample(random))
}

/// The exact area of the surface, mm².
#[cfg(test)]
pub(super) fn area() -> f64 {
    faces().map(|face| face.area()).sum()
}

/// The place of a profile corner in (x, z).
pub(super) fn corner(k: usize) -> DVec2 {
    DVec2::from(PROFILE[k % PROFILE.len()])
}

//! A mesh of the bracket whose edges follow its creases.
//!
//! 1. The creases are divided evenly: straight edges, and two circles for each hole.
//! 2. A flat face gets a hexagonal lattice of points, away from its creases, and the Delaunay triangles of all its
//!    points. The creases are edges of those, because the circle over each of their parts holds no other point.
//! 3. A hole gets rings of points, each turned by half a step, and strips of triangles between rings.

use super::bracket::{DEPTH, HOLE, HOLES, Hole, PROFILE, closest, corner};
use super::mesh::Mesh;
use super::relax::Relaxed;
use glam::{DVec2, DVec3};
use nurbskin_geometry::math;
use spade::{DelaunayTriangulation, Point2, Triangulation};
use std::f64::consts::TAU;

/// Least distance of a lattice point from a crease, in edge lengths. Derived: above 0.5, so that the circle over a part
/// of a crease holds no lattice point. Trial: a mesh of 8000 points. The least angle is 31° with 0.7, 27° with 0.55 and
/// 28° with 0.85.
const CLEARANCE: f64 = 0.7;

/// Least double area of a triangle, in squared edge lengths. Guard: those of equal sides have 0.87, those of rounding
/// 1e-13.
const FLAT: f64 = 1e-6;

/// The mesh, and which of its vertices lie on creases.
pub(super) struct Creased {
    pub(super) points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    feature: Vec<bool>,
}

/// A flat face: how its plane lies, and the creases around it.
struct Plane<'a> {
    /// Maps (x, y) of the plane to space; x, y and the outward normal form a right-handed frame.
    place: &'a dyn Fn(DVec2) -> DVec3,
    flat: &'a dyn Fn(DVec3) -> DVec2,
    is_inside: &'a dyn Fn(DVec2) -> bool,
    low: DVec2,
    high: DVec2,
}

/// The mesh with edges of about `length`.
pub(super) fn mesh(length: f64) -> Creased {
    let mut made = Creased {
        points: Vec::new(),
        triangles: Vec::new(),
        feature: Vec::new(),
    };
    let creases = made.creases(length);
    made.sides(&creases, length);
    made.ends(&creases, length);
    for (k, hole) in HOLES.iter().enumerate() {
        made.cylinder(hole, &creases.circles[k], length);
    }
    made
}

/// The mesh with its vertices spread evenly over each face.
pub(super) fn relaxed(made: Creased) -> Mesh {
    let mut relaxed = Relaxed::new(made.points, made.triangles, made.feature);
    relaxed.run(&|_, p| closest(p).0);
    Mesh {
        points: relaxed.points,
        triangles: relaxed.triangles,
    }
}

/// The vertices along the creases.
struct Creases {
    /// Along each side of the profile, from its first corner to before the next, at both ends of the extrusion.
    profile: [Vec<Vec<u32>>; 2],
    /// Along y from each corner, without the corners.
    across: Vec<Vec<u32>>,
    /// The circles of each hole, where it begins and ends.
    circles: Vec<[Vec<u32>; 2]>,
}

/// Parts of a length, each near to `wanted`.
fn parts(length: f64, wanted: f64) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped"
    )]
    {
        (length / wanted).round().clamp(1.0, 1e6) as u32
    }
}

/// A point of a hole's circle; `turn` in full turns, right-handed about the axis.
fn on_hole(hole: &Hole, turn: f64, place: f64) -> DVec3 {
    let (s, c) = math::sin_cos(TAU * turn);
    let mut across = DVec3::ZERO;
    across[(hole.along + 1) % 3] = HOLE * c;
    across[(hole.along + 2) % 3] = HOLE * s;
    hole.join(across, place)
}

impl Creased {
    fn add(&mut self, point: DVec3, feature: bool) -> u32 {
        self.points.push(point);
        self.feature.push(feature);
        u32::try_from(self.points.len() - 1).unwrap_or(u32::MAX)
    }

    fn creases(&mut self, length: f64) -> Creases {
        let sides = PROFILE.len();
        let profile = DEPTH.map(|y| {
            (0..sides)
                .map(|k| {
                    let (a, b) = (corner(k), corner(k + 1));
                    let count = parts(a.distance(b), length);
                    (0..count)
                        .map(|l| {
                            let p = a + (b - a) * (f64::from(l) / f64::from(count));
                            self.add(DVec3::new(p.x, y, p.y), true)
                        })
                        .collect()
                })
                .collect()
        });
        let across = (0..sides)
            .map(|k| {
                let p = corner(k);
                let count = parts(DEPTH[1] - DEPTH[0], length);
                (1..count)
                    .map(|l| {
                        let y = DEPTH[0] + (DEPTH[1] - DEPTH[0]) * f64::from(l) / f64::from(count);
                        self.add(DVec3::new(p.x, y, p.y), true)
                    })
                    .collect()
            })
            .collect();
        let around = parts(TAU * HOLE, length).max(6);
        let rings = HOLES.iter().map(|hole| {
            // The last ring of the cylinder is turned by half a step for each strip.
            let shift = f64::from(rings(hole, length) % 2) * 0.5;
            [(hole.range[0], 0.0), (hole.range[1], shift)].map(|(place, shift)| {
                (0..around)
                    .map(|k| {
                        let turn = (f64::from(k) + shift) / f64::from(around);
                        self.add(on_hole(hole, turn, place), true)
                    })
                    .collect()
            })
        });
        Creases {
            profile,
            across,
            circles: rings.collect(),
        }
    }

    /// The faces along the extrusion.
    fn sides(&mut self, creases: &Creases, length: f64) {
        for k in 0..PROFILE.len() {
            let next = (k + 1) % PROFILE.len();
            let (a, b) = (corner(k), corner(next));
            let along = (b - a).normalize();
            let outward = DVec3::new(along.y, 0.0, -along.x);
            let mut border: Vec<u32> = Vec::new();
            for profile in &creases.profile {
                border.extend(&profile[k]);
                border.push(profile[next][0]);
            }
            border.extend(creases.across[k].iter().chain(&creases.across[next]));
            let mut round = None;
            for (hole, circles) in HOLES.iter().zip(&creases.circles) {
                for (end, circle) in hole.range.into_iter().zip(circles) {
                    if outward[hole.along].abs() > 0.5
                        && (DVec3::new(a.x, 0.0, a.y)[hole.along] - end).abs() < 1e-9
                    {
                        border.extend(circle);
                        round = Some(hole);
                    }
                }
            }
            // x along the profile, y against the extrusion: their cross product points outward.
            let place = |p: DVec2| {
                let at = a + p.x * along;
                DVec3::new(at.x, -p.y, at.y)
            };
            let flat = |p: DVec3| DVec2::new((DVec2::new(p.x, p.z) - a).dot(along), -p.y);
            let plane = Plane {
                place: &place,
                flat: &flat,
                is_inside: &|p| round.is_none_or(|hole| hole.split(place(p)).0.length() > HOLE),
                low: DVec2::new(0.0, -DEPTH[1]),
                high: DVec2::new(a.distance(b), -DEPTH[0]),
            };
            self.face(&plane, &border, length);
        }
    }

    /// The L-shaped faces.
    fn ends(&mut self, creases: &Creases, length: f64) {
        let [low, high, inner] = [corner(0), DVec2::new(corner(1).x, corner(5).y), corner(3)];
        for (y, profile) in DEPTH.into_iter().zip(&creases.profile) {
            let border: Vec<u32> = profile.iter().flatten().copied().collect();
            // The end of lower y faces against y: (x, z) is right-handed there, (-x, z) at the other.
            let sign = if y < 0.0 { 1.0 } else { -1.0 };
            let (from, to) = (sign * low.x, sign * high.x);
            let plane = Plane {
                place: &|p| DVec3::new(sign * p.x, y, p.y),
                flat: &|p| DVec2::new(sign * p.x, p.z),
                is_inside: &|p| sign * p.x < inner.x || p.y < inner.y,
                low: DVec2::new(from.min(to), low.y),
                high: DVec2::new(from.max(to), high.y),
            };
            self.face(&plane, &border, length);
        }
    }

    /// Lattice points and Delaunay triangles of a flat face.
    fn face(&mut self, plane: &Plane<'_>, border: &[u32], length: f64) {
        let mut delaunay = DelaunayTriangulation::<Point2<f64>>::new();
        let mut vertices: Vec<u32> = Vec::new();
        let mut put = |delaunay: &mut DelaunayTriangulation<Point2<f64>>, p: DVec2, vertex: u32| {
            if let Ok(handle) = delaunay.insert(Point2::new(p.x, p.y)) {
                if vertices.len() <= handle.index() {
                    vertices.resize(handle.index() + 1, vertex);
                }
                vertices[handle.index()] = vertex;
            }
        };
        let near: Vec<DVec2> = border
            .iter()
            .map(|&k| (plane.flat)(self.points[k as usize]))
            .collect();
        let clear = Buckets::new(&near, length);
        for (&vertex, &p) in border.iter().zip(&near) {
            put(&mut delaunay, p, vertex);
        }
        for p in lattice(plane, length) {
            if (plane.is_inside)(p) && clear.is_clear(p, CLEARANCE * length) {
                let vertex = self.add((plane.place)(p), false);
                put(&mut delaunay, p, vertex);
            }
        }
        for face in delaunay.inner_faces() {
            let corners = face.vertices();
            let [a, b, c] = corners.map(|v| DVec2::new(v.position().x, v.position().y));
            // Points of one crease make no triangle but by rounding.
            let is_flat = (b - a).perp_dot(c - a) < FLAT * length * length;
            if !is_flat && (plane.is_inside)((a + b + c) / 3.0) {
                self.triangles.push(corners.map(|v| vertices[v.index()]));
            }
        }
    }

    /// Rings of points between the circles of a hole, and triangles that face its axis.
    fn cylinder(&mut self, hole: &Hole, circles: &[Vec<u32>; 2], length: f64) {
        let count = rings(hole, length);
        let around = circles[0].len();
        let mut below = circles[0].clone();
        for ring in 1..=count {
            let above: Vec<u32> = if ring == count {
                circles[1].clone()
            } else {
                let part = f64::from(ring) / f64::from(count);
                let place = hole.range[0] + part * (hole.range[1] - hole.range[0]);
                let shift = f64::from(ring % 2) * 0.5;
                (0..around)
                    .map(|k| {
                        let turn = (k as f64 + shift) / around as f64;
                        self.add(on_hole(hole, turn, place), false)
                    })
                    .collect()
            };
            for k in 0..around {
                let next = (k + 1) % around;
                // Above is turned by half a step against below: forward in odd rings, backward in even ones.
                let [two, one] = if ring % 2 == 1 {
                    [
                        [below[k], above[k], below[next]],
                        [below[next], above[k], above[next]],
                    ]
                } else {
                    [
                        [below[k], above[k], above[next]],
                        [below[k], above[next], below[next]],
                    ]
                };
                self.triangles.extend([two, one]);
            }
            below = above;
        }
    }
}

/// Strips of triangles along a hole; the rings are closer than points on them, by the height of a triangle.
fn rings(hole: &Hole, length: f64) -> u32 {
    parts(hole.range[1] - hole.range[0], 0.75_f64.sqrt() * length)
}

/// A hexagonal lattice over the box of a plane, in its middle.
fn lattice(plane: &Plane<'_>, length: f64) -> Vec<DVec2> {
    let row = 0.75_f64.sqrt() * length;
    let size = plane.high - plane.low;
    let [columns, rows] = [parts(size.x, length), parts(size.y, row)];
    let step = DVec2::new(size.x / f64::from(columns), size.y / f64::from(rows));
    let mut points = Vec::new();
    for j in 1..rows {
        for i in 0..=columns {
            let x = f64::from(i) + 0.5 * f64::from(j % 2);
            points.push(plane.low + step * DVec2::new(x, f64::from(j)));
        }
    }
    points.retain(|p| p.cmpgt(plane.low).all() && p.cmplt(plane.high).all());
    points
}

/// Points of a plane by squares of a size.
struct Buckets<'a> {
    size: f64,
    points: &'a [DVec2],
    squares: std::collections::HashMap<[i64; 2], Vec<usize>>,
}

impl<'a> Buckets<'a> {
    fn new(points: &'a [DVec2], size: f64) -> Self {
        let mut squares = std::collections::HashMap::<[i64; 2], Vec<usize>>::new();
        for (k, p) in points.iter().enumerate() {
            squares.entry(square(*p, size)).or_default().push(k);
        }
        Self {
            size,
            points,
            squares,
        }
    }

    /// Whether no point is nearer than `least`, at most the size of the squares.
    fn is_clear(&self, p: DVec2, least: f64) -> bool {
        let [x, y] = square(p, self.size);
        let squares = (x - 1..=x + 1).flat_map(|x| (y - 1..=y + 1).map(move |y| [x, y]));
        squares
            .filter_map(|key| self.squares.get(&key))
            .flatten()
            .all(|&k| self.points[k].distance(p) >= least)
    }
}

fn square(p: DVec2, size: f64) -> [i64; 2] {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "some 100 mm over an edge length"
    )]
    (p / size).floor().to_array().map(|x| x as i64)
}

//! Notches in the rims of a mesh, closed.
//!
//! The rim of a scan is where the scanner stopped: a zigzag, with triangles missing here and there. A surface that follows each
//! notch wrinkles or folds beside it. Teeth are removed by [`repair`](super::repair); here notches are filled with triangles
//! between the vertices that exist, the sharpest first, as in an advancing front. No vertex then lies outside the rim. Source: ours.

use super::Manifold;
use super::repair::surface::longest_first;
use crate::normals::mesh_normals;
use glam::DVec3;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::statistics::median_in_place;
use std::collections::{BTreeSet, HashSet};
use std::f64::consts::PI;

/// Length of the rim around a notch, in widths of its mouth, from which on it is closed. Dimensionless.
/// Derived: as for teeth that are removed; the reentrant corner of a machined outline has 1.41.
const OVERHANG: f64 = 1.6;
/// Angle outside the surface at a vertex of a zigzag. Radians: 120 degrees.
/// Derived: above the right angles of a zigzag through a grid.
const ZIGZAG: f64 = 120.0 * PI / 180.0;
/// Turn to the right up to which a rim is straight. Radians.
/// Guard: rounding.
const STRAIGHT: f64 = 1e-6;
/// Part of the turn at a vertex that the rim makes over [`TEETH`] vertices, up to which it does not turn as a whole.
/// Derived: halfway between a zigzag and a corner between straight lines.
const WHOLE: f64 = 0.5;
/// Vertices to each side. Count. Guard: farther than the next tooth.
const TEETH: usize = 3;
/// Vertices of a notch to each side, per median length of an edge of the widest mouth. Dimensionless.
/// Guard: bounds the time; a notch about as deep as it is wide.
const PER_MOUTH: usize = 2;
/// Widest mouth of a notch, in median lengths of edges. Dimensionless.
/// Derived: two sides that are three spacings apart, or less, are not resolved by a scan, as for walls.
const MOUTH: usize = 3;
/// Twice the area of a triangle, of its longest side squared, up to which it has none. Dimensionless.
/// Guard: where the sides of a slit touch, its vertices coincide.
const LEAST_AREA: f64 = 1e-3;

/// Closes the notches in the rims of a mesh; returns the number of triangles added. Existing vertices and triangles keep their
/// indices. O(n log n) in the triangles.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_scan::mesh::{Manifold, notches::close};
/// // A star of 24 points: the notches between them are closed.
/// let rim = (0..48_u32).map(|k| {
///     let angle = f64::from(k) * std::f64::consts::PI / 24.0;
///     let radius = if k % 2 == 0 { 1.0 } else { 0.7 };
///     radius * DVec3::new(angle.cos(), angle.sin(), 0.0)
/// });
/// let star = Manifold {
///     points: rim.chain([DVec3::ZERO]).collect(),
///     source: vec![None; 49],
///     triangles: (0..48).map(|k| [k, (k + 1) % 48, 48]).collect(),
///     loops: vec![(0..48).collect()],
/// };
/// let (closed, added) = close(star);
/// assert_eq!((added, closed.loops[0].len()), (24, 24));
/// ```
#[must_use]
pub fn close(mesh: Manifold) -> (Manifold, usize) {
    let all: Vec<usize> = (0..mesh.loops.len()).collect();
    let spacing = median_edge(&mesh);
    close_some(mesh, &all, MOUTH, spacing)
}

/// The same for some borders, with a widest mouth in spacings.
pub(super) fn close_some(
    mut mesh: Manifold,
    borders: &[usize],
    mouth: usize,
    spacing: f64,
) -> (Manifold, usize) {
    if borders.is_empty() {
        return (mesh, 0);
    }
    let normals = mesh_normals(&mesh.points, &mesh.triangles);
    let mut edges = HashSet::new();
    for triangle in &mesh.triangles {
        for k in 0..3 {
            let [a, b] = [triangle[k], triangle[(k + 1) % 3]];
            edges.insert([a.min(b), a.max(b)]);
        }
    }
    let reach = PER_MOUTH * mouth;
    let mouth = mouth as f64 * spacing;
    let before = mesh.triangles.len();
    for &index in borders {
        let rim = std::mem::take(&mut mesh.loops[index]);
        let mut rim = Rim::new(rim, &mesh.points, &normals, reach);
        mesh.triangles.extend(rim.close(mouth, &mut edges));
        mesh.loops[index] = rim.left();
    }
    longest_first(&mesh.points, &mut mesh.loops);
    let added = mesh.triangles.len() - before;
    (mesh, added)
}

/// The median length of the edges. O(n).
pub(super) fn median_edge(mesh: &Manifold) -> f64 {
    let sides = mesh.triangles.iter();
    let sides = sides.flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let length = |[a, b]: [u32; 2]| mesh.points[a as usize].distance(mesh.points[b as usize]);
    median_in_place(&mut sides.map(length).collect::<Vec<f64>>())
}

/// A rim as a ring, with the surface on its left.
struct Rim<'a> {
    /// The vertices at first; their places in this list are their numbers here.
    vertices: Vec<u32>,
    before: Vec<usize>,
    after: Vec<usize>,
    gone: Vec<bool>,
    count: usize,
    /// Vertices of a notch to each side.
    reach: usize,
    points: &'a [DVec3],
    normals: &'a [DVec3],
}

impl<'a> Rim<'a> {
    fn new(vertices: Vec<u32>, points: &'a [DVec3], normals: &'a [DVec3], reach: usize) -> Self {
        let count = vertices.len();
        Self {
            before: (0..count).map(|k| (k + count - 1) % count).collect(),
            after: (0..count).map(|k| (k + 1) % count).collect(),
            gone: vec![false; count],
            vertices,
            count,
            reach,
            points,
            normals,
        }
    }

    fn place(&self, k: usize) -> DVec3 {
        self.points[self.vertices[k] as usize]
    }

    /// By how much a line from `a` over `k` to `b` turns to the right at `k`. Radians.
    fn turn(&self, a: usize, k: usize, b: usize) -> f64 {
        let (one, two) = (self.place(k) - self.place(a), self.place(b) - self.place(k));
        let normal = self.normals[self.vertices[k] as usize];
        let right = -one.cross(two).dot(normal);
        if right == 0.0 {
            return 0.0;
        }
        math::atan2(right, one.dot(two))
    }

    /// The angle outside the surface at a vertex in a notch of a zigzag, or in one with this mouth at most.
    fn notch(&self, k: usize, mouth: f64) -> Option<f64> {
        let turn = self.turn(self.before[k], k, self.after[k]);
        let outside = PI - turn;
        if turn <= STRAIGHT {
            return None;
        }
        let (mut a, mut b) = (k, k);
        for _ in 0..TEETH {
            (a, b) = (self.before[a], self.after[b]);
        }
        let is_zigzag = outside < ZIGZAG && self.turn(a, k, b) < WHOLE * turn;
        (is_zigzag || self.is_pocket(k, mouth)).then_some(outside)
    }

    /// Whether the rim around a vertex is long and its mouth narrow.
    fn is_pocket(&self, k: usize, mouth: f64) -> bool {
        let (mut a, mut to_a) = (k, 0.0);
        for _ in 0..self.reach {
            to_a += self.place(a).distance(self.place(self.before[a]));
            a = self.before[a];
            let (mut b, mut to_b) = (k, 0.0);
            for _ in 0..self.reach {
                to_b += self.place(b).distance(self.place(self.after[b]));
                b = self.after[b];
                let chord = self.place(a).distance(self.place(b));
                if chord <= mouth && to_a + to_b > OVERHANG * chord && self.turn(a, k, b) > STRAIGHT
                {
                    return true;
                }
            }
        }
        false
    }

    /// Whether the triangle over a vertex has an area and holds no other vertex of the rim near it.
    fn is_free(&self, k: usize) -> bool {
        let (a, b) = (self.before[k], self.after[k]);
        let corners = [k, a, b].map(|k| self.place(k));
        let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let longest = (0..3).map(|i| corners[i].distance_squared(corners[(i + 1) % 3]));
        if area.length() <= LEAST_AREA * longest.fold(0.0, f64::max) {
            return false;
        }
        let holds = |p: DVec3| {
            (0..3).all(|i| {
                let (from, to) = (corners[i], corners[(i + 1) % 3]);
                (to - from).cross(p - from).dot(area) > 0.0
            })
        };
        let (mut one, mut two) = (a, b);
        (0..self.reach).all(|_| {
            (one, two) = (self.before[one], self.after[two]);
            !holds(self.place(one)) && !holds(self.place(two))
        })
    }

    /// Closes notches, the sharpest first; returns the triangles.
    fn close(&mut self, mouth: f64, edges: &mut HashSet<[u32; 2]>) -> Vec<[u32; 3]> {
        let mut added = Vec::new();
        let rank = |angle: f64| angle.to_bits();
        let ranks = (0..self.count).map(|k| self.notch(k, mouth).map(rank));
        let mut ranks: Vec<Option<u64>> = ranks.collect();
        let found = (0..).zip(&ranks);
        let mut queue: BTreeSet<(u64, usize)> =
            found.filter_map(|(k, r)| Some(((*r)?, k))).collect();
        while let Some((_, k)) = queue.pop_first() {
            ranks[k] = None;
            let (a, b) = (self.before[k], self.after[k]);
            let [from, at, to] = [a, k, b].map(|k| self.vertices[k]);
            let edge = [from.min(to), from.max(to)];
            let fits = self.place(a).distance(self.place(b)) <= mouth && self.is_free(k);
            if self.count <= 2 * self.reach + 2 || !fits || edges.contains(&edge) {
                continue;
            }
            edges.insert(edge);
            added.push([at, from, to]);
            self.gone[k] = true;
            self.count -= 1;
            (self.after[a], self.before[b]) = (b, a);
            // Those near it have other neighbours now.
            let mut near = a;
            for _ in 1..self.reach {
                near = self.before[near];
            }
            for _ in 0..2 * self.reach {
                if let Some(rank) = ranks[near].take() {
                    queue.remove(&(rank, near));
                }
                ranks[near] = self.notch(near, mouth).map(rank);
                queue.extend(ranks[near].map(|r| (r, near)));
                near = self.after[near];
            }
        }
        added
    }

    /// The vertices that are left.
    fn left(&self) -> Vec<u32> {
        let kept = self.vertices.iter().zip(&self.gone).filter(|v| !*v.1);
        kept.map(|v| *v.0).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_geometry::DVec2;

    /// A sheet of triangles around a hub, in a tilted plane.
    fn sheet(rim: &[DVec2]) -> Manifold {
        let count = u32::try_from(rim.len()).unwrap();
        let tilted = |p: &DVec2| DVec3::new(p.x, 0.8 * p.y, 0.6 * p.y);
        Manifold {
            points: rim.iter().map(tilted).chain([DVec3::ZERO]).collect(),
            source: (0..=count).map(Some).collect(),
            triangles: (0..count).map(|k| [k, (k + 1) % count, count]).collect(),
            loops: vec![(0..count).collect()],
        }
    }

    fn ring(count: u32, radius: impl Fn(u32) -> f64) -> Vec<DVec2> {
        let step = 2.0 * PI / f64::from(count);
        (0..count)
            .map(|k| radius(k) * DVec2::from_angle(step * f64::from(k)))
            .collect()
    }

    /// The closed mesh, which is a disk still, and what was added.
    fn closed(mesh: &Manifold) -> (Manifold, usize) {
        let (closed, added) = close(mesh.clone());
        assert_eq!(closed.triangles.len(), mesh.triangles.len() + added);
        assert_eq!(closed.euler_characteristic(), mesh.euler_characteristic());
        assert_eq!(closed.loops[0].len() + added, mesh.loops[0].len());
        let along = closed.vector_area(0);
        for t in 0..closed.triangles.len() {
            assert!(closed.vector_area(t).dot(along) > 0.0, "{t}");
        }
        (closed, added)
    }

    #[test]
    fn clean_rims_stay() {
        assert_eq!(closed(&sheet(&ring(60, |_| 10.0))).1, 0);
        assert_eq!(
            closed(&sheet(
                &ring(60, |k| 10.0 + (f64::from(k) * PI / 10.0).sin())
            ))
            .1,
            0
        );
    }

    #[test]
    fn machined_corners_stay() {
        // An L around a hub in its inner part: reentrant corner at (1, 1).
        let corners = [(-5, -5), (15, -5), (15, 1), (1, 1), (1, 15), (-5, 15)]
            .map(|(x, y)| DVec2::new(f64::from(x), f64::from(y)));
        let mut rim = Vec::new();
        for k in 0..6 {
            let (a, b) = (corners[k], corners[(k + 1) % 6]);
            let count = (a.distance(b) / 2.0).round();
            let mut at = 0.0;
            while at < count {
                rim.push(a.lerp(b, at / count));
                at += 1.0;
            }
        }
        assert_eq!(closed(&sheet(&rim)).1, 0);
    }

    #[test]
    fn a_zigzag_goes() {
        let mesh = sheet(&ring(80, |k| if k % 2 == 0 { 10.4 } else { 9.6 }));
        let (closed, added) = closed(&mesh);
        assert_eq!(added, 40);
        for &k in &closed.loops[0] {
            assert!((mesh.points[k as usize].length() - 10.4).abs() < 1e-12);
        }
    }

    #[test]
    fn a_pocket_is_closed_and_a_bay_stays() {
        let depth =
            |wide: f64| move |k: u32| 10.0 - 4.0 * (-((f64::from(k) - 30.0) / wide).powi(2)).exp();
        let (left, added) = closed(&sheet(&ring(120, depth(1.5))));
        assert!(added >= 3, "{added}");
        let inmost = left.loops[0]
            .iter()
            .map(|&k| left.points[k as usize].length())
            .fold(f64::INFINITY, f64::min);
        assert!(inmost > 8.0, "{inmost}");
        assert_eq!(closed(&sheet(&ring(120, depth(12.0)))).1, 0);
    }
}

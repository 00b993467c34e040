//! Candidates for the poles of a closed surface.
//!
//! Poles should lie at the ends of a shape. Candidates are the two vertices that are farthest from each other along
//! edges (a diameter by repeated shortest paths, Dijkstra 1959), and the places where the three principal axes of the
//! surface enter it first and leave it last. [`chart`](super::chart) keeps the pair whose finished chart stretches
//! least.
//!
//! Source: ours.

use super::layout::Surface;
use super::sides::ends;
use glam::{DMat3, DVec3};
use nurbskin_geometry::math;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Most sweeps from one end of the surface to the other. Guard: the distance grows in every sweep and settles after two
/// or three as a rule.
const DIAMETER_SWEEPS: usize = 4;
/// Relative growth of the distance at which the sweeps end. Guard: above rounding.
const MIN_SWEEP_GAIN: f64 = 1e-9;
/// Sweeps of Jacobi's rotations for a 3 x 3 matrix. Guard: convergence is quadratic, five or six do.
const JACOBI_SWEEPS: usize = 16;

/// Candidate pairs of poles, far apart: the two vertices that are farthest from each other along edges, and the places
/// where each principal axis of the surface enters it first and leaves it last. O(n log n).
pub(super) fn candidates(surface: &Surface<'_>) -> Vec<[u32; 2]> {
    let mut pairs: Vec<[u32; 2]> = Vec::new();
    let (middle, axes) = principal_axes(surface);
    let graph = Graph::new(surface);
    if let Some(pair) = graph.far_apart(surface, middle) {
        pairs.push(pair);
    }
    for axis in axes {
        if let Some(pair) = pierced(surface, middle, axis)
            && pair[0] != pair[1]
            && !pairs.contains(&pair)
        {
            pairs.push(pair);
        }
    }
    pairs.retain(|&[a, b]| {
        graph
            .neighbours(a)
            .all(|(k, _)| k != b && graph.neighbours(k).all(|(l, _)| l != b))
    });
    pairs
}

/// Edges of a mesh by vertex.
struct Graph {
    starts: Vec<usize>,
    ends: Vec<(u32, f64)>,
}

impl Graph {
    fn new(surface: &Surface<'_>) -> Self {
        let count = surface.points.len();
        let mut starts = vec![0; count + 1];
        let pairs = surface
            .sides
            .edges
            .iter()
            .map(|&side| ends(surface.triangles, side));
        let pairs: Vec<[u32; 2]> = pairs.collect();
        for k in pairs.as_flattened() {
            starts[*k as usize + 1] += 1;
        }
        for k in 0..count {
            starts[k + 1] += starts[k];
        }
        let mut next = starts.clone();
        let mut list = vec![(0, 0.0); 2 * pairs.len()];
        for &[a, b] in &pairs {
            let length = surface.points[a as usize].distance(surface.points[b as usize]);
            for (a, b) in [(a, b), (b, a)] {
                list[next[a as usize]] = (b, length);
                next[a as usize] += 1;
            }
        }
        Self { starts, ends: list }
    }

    fn neighbours(&self, k: u32) -> impl Iterator<Item = (u32, f64)> + '_ {
        let k = k as usize;
        self.ends[self.starts[k]..self.starts[k + 1]]
            .iter()
            .copied()
    }

    /// Lengths of the shortest paths along edges from one vertex (Dijkstra 1959).
    fn distances(&self, from: u32) -> Vec<f64> {
        let mut distances = vec![f64::INFINITY; self.starts.len() - 1];
        distances[from as usize] = 0.0;
        // The bits of non-negative floating-point numbers are ordered as the numbers.
        let mut heap = BinaryHeap::from([Reverse((0_u64, from))]);
        while let Some(Reverse((bits, k))) = heap.pop() {
            let distance = f64::from_bits(bits);
            if distance > distances[k as usize] {
                continue;
            }
            for (other, length) in self.neighbours(k) {
                let then = distance + length;
                if then < distances[other as usize] {
                    distances[other as usize] = then;
                    heap.push(Reverse((then.to_bits(), other)));
                }
            }
        }
        distances
    }

    /// Two vertices, each the farthest from the other along edges; the search starts at the vertex farthest from
    /// `middle`.
    fn far_apart(&self, surface: &Surface<'_>, middle: DVec3) -> Option<[u32; 2]> {
        let count = u32::try_from(surface.points.len()).ok()?;
        let off = |k: &u32| surface.points[*k as usize].distance_squared(middle);
        let mut at = (0..count).max_by(|a, b| off(a).total_cmp(&off(b)))?;
        let mut before = at;
        let mut longest = 0.0;
        for _ in 0..DIAMETER_SWEEPS {
            let distances = self.distances(at);
            let finite = |k: &u32| distances[*k as usize].is_finite();
            let value = |k: &u32| distances[*k as usize];
            let far = (0..count)
                .filter(finite)
                .max_by(|a, b| value(a).total_cmp(&value(b)))?;
            if value(&far) <= longest * (1.0 + MIN_SWEEP_GAIN) {
                break;
            }
            longest = value(&far);
            before = at;
            at = far;
        }
        (before != at).then_some([before, at])
    }
}

/// Centroid and principal axes of the surface, by area.
fn principal_axes(surface: &Surface<'_>) -> (DVec3, [DVec3; 3]) {
    let mut sum = DVec3::ZERO;
    let mut whole = 0.0;
    let part = |t: usize| {
        let [a, b, c] = surface.corners(t);
        (0.5 * (b - a).cross(c - a).length(), (a + b + c) / 3.0)
    };
    for t in 0..surface.triangles.len() {
        let (area, place) = part(t);
        sum += area * place;
        whole += area;
    }
    let middle = sum / f64::max(whole, f64::MIN_POSITIVE);
    let mut moments = DMat3::ZERO;
    for t in 0..surface.triangles.len() {
        let (area, place) = part(t);
        let d = place - middle;
        moments += DMat3::from_cols(area * d.x * d, area * d.y * d, area * d.z * d);
    }
    (middle, eigenvectors(moments))
}

/// Eigenvectors of a symmetric matrix by Jacobi's rotations.
fn eigenvectors(mut a: DMat3) -> [DVec3; 3] {
    let mut vectors = DMat3::IDENTITY;
    for _ in 0..JACOBI_SWEEPS {
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let (x, y, z) = (a.col(i)[i], a.col(j)[j], a.col(j)[i]);
            if z.abs() <= 1e-300 {
                continue;
            }
            let half = 0.5 * math::atan2(2.0 * z, y - x);
            let (s, c) = math::sin_cos(half);
            let mut turn = DMat3::IDENTITY;
            turn.col_mut(i)[i] = c;
            turn.col_mut(j)[j] = c;
            turn.col_mut(j)[i] = s;
            turn.col_mut(i)[j] = -s;
            a = turn.transpose() * a * turn;
            vectors *= turn;
        }
    }
    [0, 1, 2].map(|k| vectors.col(k))
}

/// The vertices nearest to the first and the last intersection of a line with the surface.
fn pierced(surface: &Surface<'_>, origin: DVec3, axis: DVec3) -> Option<[u32; 2]> {
    let (x, y) = axis.try_normalize()?.any_orthonormal_pair();
    let mut found: Option<[(f64, u32); 2]> = None;
    for (t, triangle) in surface.triangles.iter().enumerate() {
        let p = surface.corners(t).map(|p| p - origin);
        let flat = p.map(|p| glam::DVec2::new(p.dot(x), p.dot(y)));
        let areas = [0, 1, 2].map(|k| flat[(k + 1) % 3].perp_dot(flat[(k + 2) % 3]));
        let whole = areas[0] + areas[1] + areas[2];
        let inside = areas.iter().all(|a| a * whole >= 0.0) && whole != 0.0;
        if !inside {
            continue;
        }
        let along: f64 = (0..3).map(|k| areas[k] / whole * p[k].dot(axis)).sum();
        let nearest = (0..3).max_by(|&a, &b| (areas[a] / whole).total_cmp(&(areas[b] / whole)));
        let hit = (along, triangle[nearest.unwrap_or(0)]);
        found = Some(match found {
            None => [hit, hit],
            Some([low, high]) => [
                if hit.0 < low.0 { hit } else { low },
                if hit.0 > high.0 { hit } else { high },
            ],
        });
    }
    found.map(|f| f.map(|f| f.1))
}

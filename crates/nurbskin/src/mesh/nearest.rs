//! Distance from anywhere to the nearest point or triangle of a scan.

use crate::nurbs::closest::hierarchy::{self, Node};
use crate::point_grid::bounding_box;
use crate::scan::morton::spatial_order;
use glam::DVec3;

/// Points per leaf of the hierarchy, ...
const BLOCK: usize = 8;
/// ... and triangles: boxes are far cheaper to test than they are.
const TRIANGLES: usize = 2;

/// The points of a scan, or its triangles, under a hierarchy of boxes.
#[derive(Debug)]
pub(crate) struct Nearest {
    /// Corners of the triangles, or one corner per point, in blocks that lie together.
    items: Vec<[DVec3; 3]>,
    /// Number of each triangle in the list it came from.
    numbers: Vec<u32>,
    points: Vec<DVec3>,
    nodes: Vec<Node>,
    centre: DVec3,
}

impl Nearest {
    /// Triangles that name a point that does not exist are left out, and what is not finite. O(n log n).
    pub(crate) fn new(points: &[DVec3], triangles: Option<&[[u32; 3]]>) -> Self {
        let finite = points.iter().filter(|p| p.is_finite());
        let [low, high] = finite.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[a, b], &p| {
            [a.min(p), b.max(p)]
        });
        let centre = match low.is_finite() {
            true => low + 0.5 * (high - low),
            false => DVec3::ZERO,
        };
        let mut this = Self {
            items: Vec::new(),
            numbers: Vec::new(),
            points: Vec::new(),
            nodes: Vec::new(),
            centre,
        };
        let boxes: Vec<[DVec3; 2]> = match triangles {
            Some(triangles) => {
                let at = |i: u32| points.get(i as usize).map(|&p| p - centre);
                let numbered: Vec<([DVec3; 3], u32)> = triangles
                    .iter()
                    .zip(0..)
                    .filter_map(|(&[a, b, c], k)| Some(([at(a)?, at(b)?, at(c)?], k)))
                    .collect();
                let sorted = along_curve(&numbered, |(t, _)| (t[0] + t[1] + t[2]) / 3.0);
                (this.items, this.numbers) = sorted.into_iter().unzip();
                this.items
                    .chunks(TRIANGLES)
                    .map(|block| bounding_box(block.as_flattened()))
                    .collect()
            }
            None => {
                let centred: Vec<DVec3> = points.iter().map(|&p| p - centre).collect();
                this.points = along_curve(&centred, |&p| p);
                this.points.chunks(BLOCK).map(bounding_box).collect()
            }
        };
        this.nodes = hierarchy::build(&boxes);
        this
    }

    /// Distance to the nearest one; infinite if there is none.
    pub(crate) fn distance(&self, point: DVec3) -> f64 {
        self.search(point - self.centre).1
    }

    /// The nearest place on any of them, if there is one.
    #[cfg(feature = "scan")]
    pub(crate) fn closest(&self, point: DVec3) -> Option<DVec3> {
        let found = self.search(point - self.centre).0?;
        Some(found + self.centre)
    }

    /// The nearest place and its distance, all around the centre.
    fn search(&self, point: DVec3) -> (Option<DVec3>, f64) {
        let slack = 4.0 * f64::from(f32::EPSILON) * point.abs().max_element();
        let mut best = f64::INFINITY;
        let mut found = None;
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the slack covers the rounding"
        )]
        let at = point.to_array().map(|x| x as f32);
        let limit = |best: f64| hierarchy::limit(best, slack);
        let mut consider = |q: DVec3, best: &mut f64| {
            let distance = q.distance_squared(point);
            if distance < *best {
                (*best, found) = (distance, Some(q));
            }
        };
        hierarchy::visit_near(&self.nodes, at, f32::INFINITY, |block| {
            for &p in self.points.iter().skip(block * BLOCK).take(BLOCK) {
                consider(p, &mut best);
            }
            let triangles = self.items.iter().skip(block * TRIANGLES);
            for t in triangles.take(TRIANGLES) {
                consider(closest_on_triangle(point, t), &mut best);
            }
            limit(best)
        });
        (found, best.sqrt())
    }
}

/// A place on a triangle.
#[cfg(feature = "scan")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OnTriangle {
    /// Number of the triangle in the list given.
    pub(crate) triangle: u32,
    /// Where it lies among the sorted triangles; a start for the next search.
    pub(crate) item: u32,
    /// Weights of the corners: not negative, their sum 1.
    pub(crate) weights: [f64; 3],
    /// From the point that was asked for.
    pub(crate) distance: f64,
}

#[cfg(feature = "scan")]
impl Nearest {
    /// The place on the triangles nearest to `point` and nearer than `within`, among those that face the side of `facing`
    /// if one is given (cosine above zero). Starting from the triangle `near`, if it is near indeed, is faster. Of equally
    /// near ones that of the lowest number is taken. About O(log n).
    pub(crate) fn on_triangles(
        &self,
        point: DVec3,
        facing: Option<DVec3>,
        near: Option<u32>,
        within: f64,
    ) -> Option<OnTriangle> {
        let point = point - self.centre;
        let slack = 4.0 * f64::from(f32::EPSILON) * point.abs().max_element();
        let mut best = within * within;
        let mut found: Option<(u32, DVec3)> = None;
        let mut consider = |item: usize, best: &mut f64| {
            let (Some(t), Some(&number)) = (self.items.get(item), self.numbers.get(item)) else {
                return;
            };
            if let Some(facing) = facing
                && (t[1] - t[0]).cross(t[2] - t[0]).dot(facing) <= 0.0
            {
                return;
            }
            let q = closest_on_triangle(point, t);
            let distance = q.distance_squared(point);
            let first = |(other, _): (u32, DVec3)| {
                self.numbers.get(other as usize).is_none_or(|&o| number < o)
            };
            if distance < *best || (distance <= *best && found.is_none_or(first)) {
                *best = distance;
                found = Some((u32::try_from(item).unwrap_or(u32::MAX), q));
            }
        };
        if let Some(near) = near {
            consider(near as usize, &mut best);
        }
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the slack covers the rounding"
        )]
        let at = point.to_array().map(|x| x as f32);
        let limit = |best: f64| hierarchy::limit(best, slack);
        hierarchy::visit_near(&self.nodes, at, limit(best), |block| {
            for item in block * TRIANGLES..(block + 1) * TRIANGLES {
                consider(item, &mut best);
            }
            limit(best)
        });
        let (item, q) = found?;
        Some(OnTriangle {
            triangle: *self.numbers.get(item as usize)?,
            item,
            weights: barycentric(q, self.items.get(item as usize)?),
            distance: best.sqrt(),
        })
    }
}

/// A triangle that may be the nearest one to some places, with the box around it.
#[cfg(feature = "scan")]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    low: DVec3,
    high: DVec3,
    item: u32,
}

#[cfg(feature = "scan")]
impl Nearest {
    /// Lists all triangles within `radius` of `point`, and some others nearby.
    pub(crate) fn within(&self, point: DVec3, radius: f64, found: &mut Vec<Candidate>) {
        found.clear();
        let point = point - self.centre;
        let slack = 4.0 * f64::from(f32::EPSILON) * point.abs().max_element();
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the slack covers the rounding"
        )]
        let (at, limit) = (
            [point.x as f32, point.y as f32, point.z as f32],
            ((radius + slack).powi(2) * (1.0 + 1e-6)) as f32,
        );
        hierarchy::visit_near(&self.nodes, at, limit, |block| {
            let start = block * TRIANGLES;
            for (item, t) in (start..).zip(self.items.iter().skip(start).take(TRIANGLES)) {
                found.push(Candidate {
                    low: t[0].min(t[1]).min(t[2]),
                    high: t[0].max(t[1]).max(t[2]),
                    item: u32::try_from(item).unwrap_or(u32::MAX),
                });
            }
            limit
        });
    }

    /// As [`Self::on_triangles`], among the candidates, which must hold all triangles that may be nearest; the one
    /// found comes first of them afterwards, as it may be nearest to the next point, too.
    pub(crate) fn on_candidates(
        &self,
        point: DVec3,
        candidates: &mut [Candidate],
    ) -> Option<OnTriangle> {
        let point = point - self.centre;
        let mut best = f64::INFINITY;
        let mut found: Option<(usize, DVec3)> = None;
        let mut place = 0;
        for (k, candidate) in candidates.iter().enumerate() {
            let outside = (candidate.low - point).max(point - candidate.high);
            let least = outside.max(DVec3::ZERO).length_squared();
            // Rounding may put a place on a triangle a little outside of its box.
            if least * (1.0 - 1e-9) > best {
                continue;
            }
            let item = candidate.item as usize;
            let Some(t) = self.items.get(item) else {
                continue;
            };
            let q = closest_on_triangle(point, t);
            let distance = q.distance_squared(point);
            let first =
                |(other, _): (usize, DVec3)| self.numbers.get(item) < self.numbers.get(other);
            if distance < best || (distance <= best && found.is_none_or(first)) {
                best = distance;
                found = Some((item, q));
                place = k;
            }
        }
        let (item, q) = found?;
        candidates.swap(0, place);
        Some(OnTriangle {
            triangle: *self.numbers.get(item)?,
            item: u32::try_from(item).unwrap_or(u32::MAX),
            weights: barycentric(q, self.items.get(item)?),
            distance: best.sqrt(),
        })
    }
}

/// Weights of the corners for a point on the triangle; of the longest side alone where it has no area.
#[cfg(feature = "scan")]
fn barycentric(q: DVec3, &[a, b, c]: &[DVec3; 3]) -> [f64; 3] {
    let normal = (b - a).cross(c - a);
    let square = normal.length_squared();
    let weights = if square > 0.0 {
        let part = |x: DVec3, y: DVec3| ((x - q).cross(y - q).dot(normal) / square).max(0.0);
        [part(b, c), part(c, a), part(a, b)]
    } else {
        let along = |x: DVec3, y: DVec3| {
            let d = y - x;
            let length = d.length_squared();
            let t = if length > 0.0 {
                ((q - x).dot(d) / length).clamp(0.0, 1.0)
            } else {
                0.0
            };
            (length, t)
        };
        let (ab, bc, ca) = (along(a, b), along(b, c), along(c, a));
        if ab.0 >= bc.0 && ab.0 >= ca.0 {
            [1.0 - ab.1, ab.1, 0.0]
        } else if bc.0 >= ca.0 {
            [0.0, 1.0 - bc.1, bc.1]
        } else {
            [ca.1, 0.0, 1.0 - ca.1]
        }
    };
    let sum = weights[0] + weights[1] + weights[2];
    if sum > 0.0 {
        weights.map(|w| w / sum)
    } else {
        [1.0, 0.0, 0.0]
    }
}

/// The items along a Morton curve, so that those of a block lie together.
fn along_curve<T: Copy>(items: &[T], place: impl Fn(&T) -> DVec3) -> Vec<T> {
    let places: Vec<DVec3> = items.iter().map(place).collect();
    let order = spatial_order(&places, |p| p.is_finite());
    order.into_iter().map(|k| items[k as usize]).collect()
}

/// The point of a triangle closest to `p`, by the Voronoi regions of its corners and edges.
///
/// Source: C. Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5.
fn closest_on_triangle(p: DVec3, &[a, b, c]: &[DVec3; 3]) -> DVec3 {
    let normal = (b - a).cross(c - a);
    let inside = |from: DVec3, to: DVec3| (to - from).cross(p - from).dot(normal) >= 0.0;
    let area = normal.length_squared();
    if area > 0.0 && inside(a, b) && inside(b, c) && inside(c, a) {
        return p - normal * (normal.dot(p - a) / area);
    }
    let on_edge = |from: DVec3, to: DVec3| {
        let d = to - from;
        let length = d.length_squared();
        let t = if length > 0.0 {
            ((p - from).dot(d) / length).clamp(0.0, 1.0)
        } else {
            0.0
        };
        from + d * t
    };
    [on_edge(b, c), on_edge(c, a)]
        .into_iter()
        .fold(on_edge(a, b), |best, q| {
            if q.distance_squared(p) < best.distance_squared(p) {
                q
            } else {
                best
            }
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scattered(n: usize) -> Vec<DVec3> {
        (0..n)
            .map(|k| {
                let k = k as f64;
                DVec3::new(
                    (k * 12.9898).sin(),
                    (k * 78.233).sin(),
                    0.3 * (k * 37.719).sin(),
                )
            })
            .collect()
    }

    #[test]
    fn points_as_by_brute_force() {
        let points = scattered(1000);
        let nearest = Nearest::new(&points, None);
        for q in scattered(1200).iter().skip(900) {
            let q = *q * 1.5 + DVec3::splat(0.01);
            let brute = points
                .iter()
                .map(|p| p.distance(q))
                .fold(f64::INFINITY, f64::min);
            assert!((nearest.distance(q) - brute).abs() < 1e-14);
        }
    }

    #[test]
    fn triangles_as_by_sampling() {
        let points = scattered(60);
        let triangles: Vec<[u32; 3]> = (0..20).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let nearest = Nearest::new(&points, Some(&triangles));
        let mut samples = Vec::new();
        for t in &triangles {
            let [a, b, c] = t.map(|i| points[i as usize]);
            for i in 0..=60 {
                for j in 0..=60 - i {
                    let (f, g) = (f64::from(i) / 60.0, f64::from(j) / 60.0);
                    samples.push(a + (b - a) * f + (c - a) * g);
                }
            }
        }
        for q in scattered(100) {
            let q = q * 1.4 + DVec3::splat(0.013);
            let brute = samples
                .iter()
                .map(|p| p.distance(q))
                .fold(f64::INFINITY, f64::min);
            let exact = nearest.distance(q);
            assert!(exact <= brute + 1e-14 && brute - exact < 0.05);
        }
    }

    #[test]
    fn nothing_is_infinitely_far() {
        assert!(Nearest::new(&[], None).distance(DVec3::ONE).is_infinite());
    }
}

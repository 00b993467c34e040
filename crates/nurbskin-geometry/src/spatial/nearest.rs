//! Distance from anywhere to the nearest point or triangle of a scan.

use crate::numeric::parallel::each;
use crate::point_grid::bounding_box;
use crate::spatial::hierarchy;
use crate::spatial::hierarchy::Node;
use crate::spatial::morton::spatial_order;
use glam::DVec3;

/// Points per leaf of the hierarchy, ...
const BLOCK: usize = 8;
/// ... and triangles: boxes are far cheaper to test than they are.
const TRIANGLES: usize = 2;

/// The points of a scan, or its triangles, under a hierarchy of boxes.
#[derive(Debug)]
pub struct Nearest {
    /// Corners of the triangles, in blocks that lie together.
    pub items: Vec<[DVec3; 3]>,
    /// Number of each triangle in the list it came from.
    numbers: Vec<u32>,
    /// Walls of each triangle, where they are asked for, and what rounding may make of a distance to one, in lengths.
    walls: (Vec<Walls>, f64),
    points: Vec<DVec3>,
    nodes: Vec<Node>,
    centre: DVec3,
}

impl Nearest {
    /// Of the points, where there are no triangles. Triangles that name a point that does not exist are left out, and what
    /// is not finite. O(n log n).
    pub fn new(points: &[DVec3], triangles: Option<&[[u32; 3]]>) -> Self {
        let triangles = triangles.filter(|t| !t.is_empty());
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
            walls: (Vec::new(), 0.0),
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
                let middle = |(t, _): &([DVec3; 3], u32)| (t[0] + t[1] + t[2]) / 3.0;
                let middles: Vec<DVec3> = numbered.iter().map(middle).collect();
                let order = spatial_order(&middles, |p| p.is_finite());
                let sorted = order.into_iter().map(|k| numbered[k as usize]);
                (this.items, this.numbers) = sorted.unzip();
                this.items
                    .chunks(TRIANGLES)
                    .map(|block| bounding_box(block.as_flattened()))
                    .collect()
            }
            None => {
                let order = spatial_order(points, |p| p.is_finite());
                this.points = each(order.len(), |k| points[order[k] as usize] - centre);
                let count = this.points.len();
                each(count.div_ceil(BLOCK), |k| {
                    bounding_box(&this.points[k * BLOCK..count.min((k + 1) * BLOCK)])
                })
            }
        };
        this.nodes = hierarchy::build(&boxes);
        this
    }

    /// The nearest place on any of them and its distance, if there is one. That of a point nearby, `near`, makes the
    /// search shorter; of equally near places it is the one found.
    pub fn closest(&self, point: DVec3, near: Option<Place>) -> Option<Place> {
        if !point.is_finite() {
            return None;
        }
        let point = point - self.centre;
        let (at, slack) = rounded(point);
        let mut found = near.map(|near| (near.offset, near.facing));
        let mut best = found.map_or(f64::INFINITY, |(q, _)| q.distance_squared(point));
        let limit = |best: f64| hierarchy::limit(best, slack);
        let off = self.walls.1 + OFF_WALL * point.abs().max_element();
        let mut consider = |q: DVec3, facing: &dyn Fn() -> DVec3, best: &mut f64| {
            let distance = q.distance_squared(point);
            if distance < *best {
                (*best, found) = (distance, Some((q, facing())));
            }
        };
        hierarchy::visit_near(&self.nodes, at, limit(best), |block| {
            for &p in self.points.iter().skip(block * BLOCK).take(BLOCK) {
                consider(p, &|| DVec3::ZERO, &mut best);
            }
            let triangles = self.items.iter().enumerate().skip(block * TRIANGLES);
            for (_item, t) in triangles.take(TRIANGLES) {
                if let Some(walls) = self.walls.0.get(_item)
                    && walls.at_least(point, off) > best
                {
                    continue;
                }
                let facing = || (t[1] - t[0]).cross(t[2] - t[0]).normalize_or_zero();
                consider(closest_on_triangle(point, t), &facing, &mut best);
            }
            limit(best)
        });
        found.map(|(offset, facing)| Place {
            offset,
            facing,
            point: offset + self.centre,
            distance: best.sqrt(),
        })
    }
}

/// A place on a point or triangle of the scan.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// From the centre of the scan.
    offset: DVec3,
    /// Unit normal of the triangle; zero of a point, and where a triangle has none.
    pub facing: DVec3,
    /// The place.
    pub point: DVec3,
    /// From the point that was asked for.
    pub distance: f64,
}

/// A place on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnTriangle {
    /// Number of the triangle in the list given.
    pub triangle: u32,
    /// Where it lies among the sorted triangles; a start for the next search.
    pub item: u32,
    /// Weights of the corners: not negative, their sum 1.
    pub weights: [f64; 3],
    /// From the point that was asked for.
    pub distance: f64,
}

impl Nearest {
    /// Gets ready for many searches for triangles, with 128 bytes for each of them.
    pub fn with_walls(mut self) -> Self {
        let all = self.items.as_flattened().iter();
        let farthest = all.fold(0.0, |most: f64, p| most.max(p.abs().max_element()));
        let walls = self.items.iter().map(Walls::new).collect();
        self.walls = (walls, OFF_WALL * farthest);
        self
    }

    /// The place on the triangles nearest to `point` and nearer than `within`, among those that face the side of `facing`
    /// if one is given (cosine above zero). Starting from the triangle `near`, if it is near indeed, is faster. Of equally
    /// near ones that of the lowest number is taken. About O(log n).
    pub fn on_triangles(
        &self,
        point: DVec3,
        facing: Option<DVec3>,
        near: Option<u32>,
        within: f64,
    ) -> Option<OnTriangle> {
        self.on_some(None, point, facing, near, within)
    }

    /// The place nearest to `point`, and nearer than `within`, on the triangles that face the side of `facing`.
    pub fn on_same_side(&self, point: DVec3, facing: DVec3, within: f64) -> Option<DVec3> {
        let found = self.on_triangles(point, Some(facing), None, within)?;
        let corners = self.items.get(found.item as usize)?;
        let weighted = corners.iter().zip(found.weights).map(|(p, w)| w * *p);
        Some(self.centre + weighted.sum::<DVec3>())
    }

    /// Where all triangles are, for [`Self::on_blocks`], that may be nearest to a point in the box from `low` to `high`
    /// that is no farther than `reach` from one of them.
    pub fn within(&self, [low, high]: [DVec3; 2], reach: f64, blocks: &mut Vec<u32>) {
        let [low, high] = [low, high].map(|corner| rounded(corner - self.centre));
        let limit = hierarchy::limit(reach * reach, low.1.max(high.1));
        hierarchy::blocks_near(&self.nodes, [low.0, high.0], limit, blocks);
    }

    /// How far a point is from one of the triangles, by its place in the order of the search; infinitely from none.
    pub fn to_item(&self, point: DVec3, item: u32) -> f64 {
        let point = point - self.centre;
        let t = self.items.get(item as usize);
        t.map_or(f64::INFINITY, |t| {
            closest_on_triangle(point, t).distance(point)
        })
    }

    /// As [`Self::on_triangles`], where it is known where the triangles are that may be nearest.
    pub fn on_blocks(&self, point: DVec3, near: Option<u32>, blocks: &[u32]) -> Option<OnTriangle> {
        self.on_some(Some(blocks), point, None, near, f64::INFINITY)
    }

    fn on_some(
        &self,
        blocks: Option<&[u32]>,
        point: DVec3,
        facing: Option<DVec3>,
        near: Option<u32>,
        within: f64,
    ) -> Option<OnTriangle> {
        let point = point - self.centre;
        let mut best = within * within;
        let off = self.walls.1 + OFF_WALL * point.abs().max_element();
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
            let walls = self.walls.0.get(item);
            if walls.is_some_and(|walls| walls.at_least(point, off) > *best) {
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
        let (at, slack) = rounded(point);
        let limit = |best: f64| hierarchy::limit(best, slack);
        let start = limit(best);
        let visit = |block: usize| {
            for item in block * TRIANGLES..(block + 1) * TRIANGLES {
                // The first one of all is there already.
                if Some(item) != near.map(|near| near as usize) {
                    consider(item, &mut best);
                }
            }
            limit(best)
        };
        match blocks {
            None => hierarchy::visit_near(&self.nodes, at, start, visit),
            Some(blocks) => hierarchy::visit_blocks(&self.nodes, blocks, at, start, visit),
        }
        let (item, q) = found?;
        Some(OnTriangle {
            triangle: *self.numbers.get(item as usize)?,
            item,
            weights: barycentric(q, self.items.get(item as usize)?),
            distance: best.sqrt(),
        })
    }
}

/// The plane of a triangle, and those through its sides that stand upright on it: unit normals, those of sides outwards,
/// and distances from the origin.
#[derive(Clone, Copy, Debug)]
struct Walls([(DVec3, f64); 4]);

/// Triangles thinner than this part of their longest side have no walls: rounding would turn them.
const THINNEST: f64 = 1e-5;
/// What rounding may make of a distance to a wall, in parts of the largest coordinates: some 3e-11 with the thinnest
/// triangles.
const OFF_WALL: f64 = 1e-10;

impl Walls {
    fn new(&[a, b, c]: &[DVec3; 3]) -> Self {
        let normal = (b - a).cross(c - a);
        let sides = [(a, b), (b, c), (c, a)];
        let longest = sides.map(|(from, to)| from.distance_squared(to));
        let longest = longest.into_iter().fold(0.0, f64::max);
        if normal.length() <= THINNEST * longest {
            return Self([(DVec3::ZERO, 0.0); 4]);
        }
        let through = |corner: DVec3, normal: DVec3| {
            let normal = normal.normalize_or_zero();
            (normal, normal.dot(corner))
        };
        let [ab, bc, ca] = sides.map(|(from, to)| through(from, (to - from).cross(normal)));
        Self([through(a, normal), ab, bc, ca])
    }

    /// What the squared distance of a point to the triangle is at least, where walls may be `off` by so much.
    fn at_least(&self, point: DVec3, off: f64) -> f64 {
        let [above, sides @ ..] = self.0.map(|(normal, at)| normal.dot(point) - at);
        let beyond = sides.into_iter().fold(0.0, f64::max);
        (above.abs() - off).max(0.0).powi(2) + (beyond - off).max(0.0).powi(2)
    }
}

/// A place in single precision, and what that may be off by and more.
fn rounded(point: DVec3) -> ([f32; 3], f64) {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the slack covers the rounding"
    )]
    let at = point.to_array().map(|x| x as f32);
    let slack = 4.0 * f64::from(f32::EPSILON) * point.abs().max_element();
    (at, slack)
}

/// Weights of the corners for a point on the triangle; of the longest side alone where it has no area.
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
            assert!((nearest.closest(q, None).unwrap().distance - brute).abs() < 1e-14);
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
        let mut near = None;
        for q in scattered(100) {
            let q = q * 1.4 + DVec3::splat(0.013);
            let brute = samples
                .iter()
                .map(|p| p.distance(q))
                .fold(f64::INFINITY, f64::min);
            near = nearest.closest(q, near);
            let exact = near.unwrap().distance;
            let afresh = nearest.closest(q, None).unwrap().distance;
            assert!((exact - afresh).abs() < 1e-15);
            assert!(exact <= brute + 1e-14 && brute - exact < 0.05);
        }
    }

    /// With walls and without, from anywhere and among blocks, thin triangles included.
    #[test]
    fn places_are_the_same_by_all_ways() {
        let mut points = scattered(300);
        for k in (0..300).step_by(30) {
            points[k + 2] = points[k].lerp(points[k + 1], 0.3) + 1e-9 * DVec3::Y;
            points[k + 5] = points[k + 4];
        }
        let triangles: Vec<[u32; 3]> = (0..100).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let plain = Nearest::new(&points, Some(&triangles));
        let walled = Nearest::new(&points, Some(&triangles)).with_walls();
        let mut blocks = Vec::new();
        let mut near = None;
        for q in scattered(400) {
            let q = q * 1.3 + DVec3::splat(0.017);
            let wanted = plain.on_triangles(q, None, None, f64::INFINITY).unwrap();
            let distance = plain.closest(q, None).unwrap().distance;
            assert!((wanted.distance - distance).abs() < 1e-15);
            assert_eq!(
                walled.on_triangles(q, None, near, f64::INFINITY).unwrap(),
                wanted
            );
            blocks.clear();
            walled.within([q - 0.05, q + 0.02], wanted.distance, &mut blocks);
            assert_eq!(walled.on_blocks(q, near, &blocks).unwrap(), wanted);
            near = Some(wanted.item);
        }
    }

    #[test]
    fn nothing_is_nowhere() {
        assert!(Nearest::new(&[], None).closest(DVec3::ONE, None).is_none());
    }
}

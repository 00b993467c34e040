//! Cells that are squares of a cross field.
//!
//! Each triangle gets coordinates (x, y) in the frame of its seed, carried along the ways of the search: a step adds its
//! components along the local cross, divided by the local sizes. Crosses of neighbours match by the nearest quarter turn.
//! The distance is the norm (|x|⁸ + |y|⁸)^(1/8), near the maximum of both, so that cells are squares of the field. Along an
//! arm of curvature c the size is s = 1 / (1 + 0.06 D c), times that asked for at the triangle.
//!
//! Lloyd's steps move each seed to the centroid of its (x, y), and on towards the rows of its neighbours: the mean offset
//! across x of the neighbours that lie along x, and the same for y. The borders of neighbouring cells then run in line. It
//! works like a position field, with the safety of a division into cells.
//!
//! Source: ours; for the norm B. Lévy, Y. Liu, *Lp centroidal Voronoi tessellation and its applications*, ACM Transactions on
//! Graphics 29(4), 2010; for the rows W. Jakob, M. Tarini, D. Panozzo, O. Sorkine-Hornung, *Instant field-aligned meshes*,
//! ACM Transactions on Graphics 34(6), 2015.

use super::NONE;
use super::cells::{Seeding, first_seeds};
use super::field::CrossField;
use super::grow::Front;
use super::surface::{Surface, index};
use glam::{DVec2, DVec3};
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::parallel::each_light;
use std::collections::BinaryHeap;

/// Exponent of the norm. Trial: prototype; with 2 banana and aorta get the same angles with more faces.
const EXPONENT: i32 = 8;
/// Lloyd's steps. Trial: prototype; 40 change the figures by less than 15 %.
const LLOYD: usize = 25;
/// Shrinkage by curvature, in diagonals: that of the steps of the geodesic cells.
const BEND: f64 = 0.06;
/// Largest ratio of the two sizes. Trial: prototype; with 4 there are fewer extraordinary vertices and aorta gets six bad
/// joins, with 1.6 banana gets a third more faces.
const MAX_RATIO: f64 = 2.5;
/// Share of the move towards the rows of the neighbours. Trial: prototype; 1.2 is as good.
const PULL: f64 = 0.7;
/// Largest move and spread of the weights, in typical sides of a cell. Trial: prototype.
const REACH: f64 = 0.25;
/// A neighbour lies along x if |x| is more than this multiple of |y|. Trial: prototype.
const ALONG: f64 = 1.2;

/// The crosses of the triangles, and the steps between them.
#[derive(Debug)]
struct Crosses {
    crosses: Vec<Cross>,
    /// By side 3 t + s.
    steps: Vec<Step>,
}

/// The cross of a triangle.
#[derive(Clone, Copy, Debug)]
struct Cross {
    middle: DVec3,
    /// The two arms at right angles.
    arms: [DVec3; 2],
    normal: DVec3,
    /// The sizes along them.
    sizes: [f64; 2],
}

/// A direction of a cross: one of its two arms, forwards or backwards.
#[derive(Clone, Copy, Debug, Default)]
struct Arm {
    second: bool,
    backwards: bool,
}

impl Arm {
    /// The opposite direction if `is_so`, else the same.
    fn reversed(self, is_so: bool) -> Self {
        Self {
            backwards: self.backwards != is_so,
            ..self
        }
    }
}

/// The step over a side to the triangle across.
#[derive(Clone, Copy, Debug)]
struct Step {
    /// The triangle; [`NONE`] over sharp lines and borders.
    to: u32,
    /// Where the first and the second arm, carried along, point there.
    arms: [Arm; 2],
    /// The step in the frames of these arms, in the local sizes: the sum of those at both ends.
    frames: [DVec2; 2],
}

impl Crosses {
    fn new(surface: &Surface<'_>, field: &CrossField, shrink: f64) -> Self {
        let cross = |t: usize| {
            let normal = surface.mesh.vector_area(t).normalize_or_zero();
            let arm = field.arms.get(t).copied().unwrap_or(DVec3::X);
            let bend = field.curvature.get(t).copied().unwrap_or_default();
            let [x, y] = bend.map(|c| 1.0 / (1.0 + shrink * surface.diagonal * c));
            let (mean, ratio) = ((x * y).sqrt(), (x / y).clamp(1.0 / MAX_RATIO, MAX_RATIO));
            Cross {
                middle: surface.middles[t],
                arms: [arm, normal.cross(arm)],
                normal,
                sizes: [mean * ratio.sqrt(), mean / ratio.sqrt()]
                    .map(|size| surface.sizes[t] * size),
            }
        };
        let crosses: Vec<Cross> = each_light(surface.count(), cross);
        let step = |side: usize| {
            let here = &crosses[side / 3];
            let Some(o) = surface.across(side) else {
                return Step {
                    to: NONE,
                    arms: [Arm::default(); 2],
                    frames: [DVec2::ZERO; 2],
                };
            };
            let there = &crosses[o];
            let step = there.middle - here.middle;
            let arms = here.arms.map(|arm| there.nearest(arm));
            let frame = |k: usize| {
                here.measure(here.arms[k], step) + there.measure(there.direction(arms[k]), step)
            };
            Step {
                to: index(o),
                arms,
                frames: [frame(0), frame(1)],
            }
        };
        Self {
            steps: each_light(3 * surface.count(), step),
            crosses,
        }
    }

    /// The area of a triangle in the local sizes.
    fn area(&self, surface: &Surface<'_>, t: usize) -> f64 {
        let [a, b] = self.crosses[t].sizes;
        surface.areas[t] / (a * b) + f64::MIN_POSITIVE
    }
}

impl Cross {
    /// The arm nearest to a direction.
    fn nearest(&self, direction: DVec3) -> Arm {
        let [along, across] = self.arms.map(|arm| direction.dot(arm));
        let second = along.abs() < across.abs();
        let least = if second { across } else { along };
        Arm {
            second,
            backwards: least.is_sign_negative(),
        }
    }

    /// The direction of an arm.
    fn direction(&self, arm: Arm) -> DVec3 {
        let along = self.arms[usize::from(arm.second)];
        if arm.backwards { -along } else { along }
    }

    /// A step in the frame of this arm, in the local sizes.
    fn measure(&self, arm: DVec3, step: DVec3) -> DVec2 {
        let [mut along, mut across] = self.sizes;
        if arm.dot(self.arms[0]).abs() < 0.5 {
            (along, across) = (across, along);
        }
        let beside = self.normal.cross(arm);
        DVec2::new(step.dot(arm) / along, step.dot(beside) / across)
    }
}

/// Coordinates of the triangles in the frames of their seeds.
#[derive(Debug)]
struct Charts {
    places: Vec<Place>,
    heap: BinaryHeap<Front>,
}

/// Where a triangle lies in the frame of a seed.
#[derive(Clone, Copy, Debug)]
struct Place {
    distance: f64,
    owner: u32,
    at: DVec2,
    /// The x direction of the seed, carried here.
    arm: Arm,
}

impl Place {
    /// That of a triangle which nothing has reached.
    const NOWHERE: Self = Self {
        distance: f64::INFINITY,
        owner: NONE,
        at: DVec2::ZERO,
        arm: Arm {
            second: false,
            backwards: false,
        },
    };
}

impl Charts {
    fn new(count: usize) -> Self {
        Self {
            places: vec![Place::NOWHERE; count],
            heap: BinaryHeap::new(),
        }
    }

    fn clear(&mut self) {
        self.places.fill(Place::NOWHERE);
    }

    fn seed(&mut self, triangle: u32, number: u32) {
        let t = triangle as usize;
        self.places[t] = Place {
            distance: 0.0,
            owner: number,
            at: DVec2::ZERO,
            arm: Arm::default(),
        };
        self.heap.push(Front(0.0, triangle));
    }

    /// The triangles that were reached, with their places.
    fn reached(&self) -> impl Iterator<Item = (usize, &Place)> {
        self.places.iter().enumerate().filter(|p| p.1.owner != NONE)
    }

    /// Spreads from the seeds set since the last call.
    fn run(&mut self, crosses: &Crosses) {
        while let Some(Front(distance, triangle)) = self.heap.pop() {
            let t = triangle as usize;
            let here = self.places[t];
            if distance > here.distance {
                continue;
            }
            let arm = usize::from(here.arm.second);
            for step in &crosses.steps[3 * t..3 * t + 3] {
                let Some(there) = self.places.get_mut(step.to as usize) else {
                    continue;
                };
                if there.distance <= distance {
                    continue;
                }
                let half = 0.5 * step.frames[arm];
                let at = here.at + if here.arm.backwards { -half } else { half };
                // The norm is no less.
                if at.abs().max_element() >= there.distance {
                    continue;
                }
                let next = norm(at).max(distance);
                if next < there.distance {
                    *there = Place {
                        distance: next,
                        owner: here.owner,
                        at,
                        arm: step.arms[arm].reversed(here.arm.backwards),
                    };
                    self.heap.push(Front(next, step.to));
                }
            }
        }
    }

    /// The reached triangle farthest from its seed.
    fn farthest(&self) -> Option<(u32, f64)> {
        let mut best: Option<(u32, f64)> = None;
        for (t, d) in self.places.iter().map(|p| p.distance).enumerate() {
            if d.is_finite() && best.is_none_or(|b| d > b.1) {
                best = Some((index(t), d));
            }
        }
        best
    }

    /// For each pair of cells that touch, where the seed of the other one lies in the frame of the first, on average:
    /// (first cell, place, number of common sides), by the first cell.
    fn neighbours(&self, surface: &Surface<'_>, crosses: &Crosses) -> Vec<(u32, DVec2, f64)> {
        let mut pairs: Vec<([u32; 2], DVec2)> = Vec::new();
        for side in 0..surface.steps.len() {
            let t = side / 3;
            let own = &self.places[t];
            let Some(o) = surface
                .across(side)
                .filter(|&o| self.places[o].owner != own.owner)
            else {
                continue;
            };
            let other = &self.places[o];
            let (cross, there) = (&crosses.crosses[t], &crosses.crosses[o]);
            let (arm, arm_there) = (cross.direction(own.arm), there.direction(other.arm));
            let here = own.at + cross.measure(arm, there.middle - cross.middle);
            // The arm there in the frame here, by the nearest quarter turn.
            let beside = cross.normal.cross(arm);
            let (c, s) = (arm_there.dot(arm), arm_there.dot(beside));
            let turn = if c.abs() > s.abs() {
                DVec2::new(c.signum(), 0.0)
            } else {
                DVec2::new(0.0, s.signum())
            };
            pairs.push(([own.owner, other.owner], here - turn.rotate(other.at)));
        }
        pairs.sort_by(|x, y| {
            let places = x.1.x.total_cmp(&y.1.x).then(x.1.y.total_cmp(&y.1.y));
            x.0.cmp(&y.0).then(places)
        });
        pairs
            .chunk_by(|x, y| x.0 == y.0)
            .map(|same| {
                let count = same.len() as f64;
                let sum: DVec2 = same.iter().map(|(_, place)| place).sum();
                (same[0].0[0], sum / count, count)
            })
            .collect()
    }

    /// The triangles to which the seeds move.
    fn targets(&self, surface: &Surface<'_>, crosses: &Crosses, seeds: usize) -> Vec<u32> {
        let mut sums = vec![(DVec2::ZERO, 0.0); seeds];
        let mut whole = 0.0;
        for (t, place) in self.reached() {
            let weight = crosses.area(surface, t);
            let sum = &mut sums[place.owner as usize];
            sum.0 += weight * place.at;
            sum.1 += weight;
            whole += weight;
        }
        let side = (whole / seeds.max(1) as f64).sqrt();
        let pulls = self.pulls(surface, crosses, seeds, side);
        let target = sums
            .iter()
            .zip(pulls)
            .map(|(sum, pull)| sum.0 / sum.1.max(f64::MIN_POSITIVE) + PULL * pull);
        let target: Vec<DVec2> = target.collect();
        let mut best = vec![(f64::INFINITY, NONE); seeds];
        for (t, place) in self.reached() {
            let owner = place.owner as usize;
            let away = place.at.distance_squared(target[owner]);
            if away < best[owner].0 {
                best[owner] = (away, index(t));
            }
        }
        best.into_iter().map(|(_, t)| t).collect()
    }

    /// Where the rows of the neighbours lie, for each seed; `side` is a typical side of a cell.
    fn pulls(
        &self,
        surface: &Surface<'_>,
        crosses: &Crosses,
        seeds: usize,
        side: f64,
    ) -> Vec<DVec2> {
        let mut sums = vec![(DVec2::ZERO, DVec2::ZERO); seeds];
        for (cell, place, common) in self.neighbours(surface, crosses) {
            let sum = &mut sums[cell as usize];
            let weigh = |off: f64| common * math::exp(-(off / (REACH * side)).powi(2));
            if place.x.abs() > ALONG * place.y.abs() {
                sum.0.y += weigh(place.y) * place.y;
                sum.1.y += weigh(place.y);
            }
            if place.y.abs() > ALONG * place.x.abs() {
                sum.0.x += weigh(place.x) * place.x;
                sum.1.x += weigh(place.x);
            }
        }
        let most = DVec2::splat(REACH * side);
        let pull = |(sum, weight): (DVec2, DVec2)| {
            // Half, since the neighbour comes as well.
            let mean = |s: f64, w: f64| if w > 1e-9 { 0.5 * s / w } else { 0.0 };
            DVec2::new(mean(sum.x, weight.x), mean(sum.y, weight.y)).clamp(-most, most)
        };
        sums.into_iter().map(pull).collect()
    }
}

/// The norm of a place.
fn norm(place: DVec2) -> f64 {
    let p = place.abs();
    let (most, least) = (p.max_element(), p.min_element());
    if most > 0.0 {
        let rest = (least / most).powi(EXPONENT);
        most * (1.0 + rest).sqrt().sqrt().sqrt()
    } else {
        0.0
    }
}

/// A division into cells of the field.
#[derive(Clone, Debug)]
pub(crate) struct Aligned {
    /// For each triangle the number of its cell; [`NONE`] for one that no seed reaches.
    pub(crate) labels: Vec<u32>,
    /// For each cell its seed, a triangle.
    pub(crate) seeds: Vec<u32>,
}

/// The seeds that a division begins with.
#[derive(Clone, Debug, Default)]
pub(crate) struct Known {
    /// None for a division from nothing; else one at least for each part that sharp lines separate.
    pub(crate) seeds: Vec<u32>,
    /// Which of them stay where they are.
    pub(crate) held: Vec<bool>,
}

/// Divides the surface into cells of the field. Sizes shrink by curvature `detail` times as usual.
pub(crate) fn divide(
    surface: &Surface<'_>,
    field: &CrossField,
    seeding: Seeding,
    detail: f64,
    known: Known,
) -> Aligned {
    let crosses = Crosses::new(surface, field, BEND * detail);
    let mut charts = Charts::new(surface.count());
    let mut seeds = match known.seeds.is_empty() {
        true => first_seeds(surface),
        false => known.seeds,
    };
    let mut number = 0;
    loop {
        for &seed in &seeds[number..] {
            charts.seed(seed, index(number));
            number += 1;
        }
        charts.run(&crosses);
        match charts.farthest() {
            Some((farthest, distance)) if seeding.wants_more(number, distance) => {
                seeds.push(farthest);
            }
            _ => break,
        }
    }
    if !known.held.is_empty() && charts.places.iter().any(|place| place.owner == NONE) {
        // Seeds of other lines leave a part without any.
        return divide(surface, field, seeding, detail, Known::default());
    }
    for _ in 0..LLOYD {
        let mut moved = charts.targets(surface, &crosses, seeds.len());
        for ((to, from), _) in moved
            .iter_mut()
            .zip(&seeds)
            .zip(&known.held)
            .filter(|k| *k.1)
        {
            *to = *from;
        }
        if moved == seeds || moved.contains(&NONE) {
            break;
        }
        seeds = moved;
        charts.clear();
        for (k, &seed) in seeds.iter().enumerate() {
            charts.seed(seed, index(k));
        }
        charts.run(&crosses);
    }
    Aligned {
        labels: charts.places.iter().map(|place| place.owner).collect(),
        seeds,
    }
}

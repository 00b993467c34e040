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

/// A cross per triangle with its sizes.
#[derive(Debug)]
struct Crosses {
    /// The two arms at right angles.
    arms: Vec<[DVec3; 2]>,
    normals: Vec<DVec3>,
    /// The sizes along them.
    sizes: Vec<[f64; 2]>,
}

impl Crosses {
    fn new(surface: &Surface<'_>, field: &CrossField, shrink: f64) -> Self {
        let count = surface.count();
        let normals: Vec<DVec3> = (0..count)
            .map(|t| surface.mesh.vector_area(t).normalize_or_zero())
            .collect();
        let arm = |t: usize| field.arms.get(t).copied().unwrap_or(DVec3::X);
        let arms = (0..count).map(|t| [arm(t), normals[t].cross(arm(t))]);
        let size = |t: usize| {
            let bend = field.curvature.get(t).copied().unwrap_or_default();
            let [x, y] = bend.map(|c| 1.0 / (1.0 + shrink * surface.diagonal * c));
            let (mean, ratio) = ((x * y).sqrt(), (x / y).clamp(1.0 / MAX_RATIO, MAX_RATIO));
            [mean * ratio.sqrt(), mean / ratio.sqrt()].map(|size| surface.sizes[t] * size)
        };
        Self {
            arms: arms.collect(),
            normals,
            sizes: (0..count).map(size).collect(),
        }
    }

    /// The arm of triangle t nearest to a direction.
    fn nearest(&self, t: usize, direction: DVec3) -> DVec3 {
        let [x, y] = self.arms[t];
        let (along, across) = (direction.dot(x), direction.dot(y));
        if along.abs() >= across.abs() {
            x * along.signum()
        } else {
            y * across.signum()
        }
    }

    /// A step in the frame of this arm of triangle t, in the local sizes.
    fn measure(&self, t: usize, arm: DVec3, step: DVec3) -> DVec2 {
        let [mut along, mut across] = self.sizes[t];
        if arm.dot(self.arms[t][0]).abs() < 0.5 {
            (along, across) = (across, along);
        }
        let beside = self.normals[t].cross(arm);
        DVec2::new(step.dot(arm) / along, step.dot(beside) / across)
    }

    /// The area of a triangle in the local sizes.
    fn area(&self, surface: &Surface<'_>, t: usize) -> f64 {
        let [a, b] = self.sizes[t];
        surface.areas[t] / (a * b) + f64::MIN_POSITIVE
    }
}

/// Coordinates of the triangles in the frames of their seeds.
#[derive(Debug)]
struct Charts {
    distance: Vec<f64>,
    owner: Vec<u32>,
    place: Vec<DVec2>,
    /// The x direction of the seed, carried here.
    arm: Vec<DVec3>,
    heap: BinaryHeap<Front>,
}

impl Charts {
    fn new(count: usize) -> Self {
        Self {
            distance: vec![f64::INFINITY; count],
            owner: vec![NONE; count],
            place: vec![DVec2::ZERO; count],
            arm: vec![DVec3::X; count],
            heap: BinaryHeap::new(),
        }
    }

    fn clear(&mut self) {
        self.distance.fill(f64::INFINITY);
        self.owner.fill(NONE);
    }

    fn seed(&mut self, crosses: &Crosses, triangle: u32, number: u32) {
        let t = triangle as usize;
        self.distance[t] = 0.0;
        self.owner[t] = number;
        self.place[t] = DVec2::ZERO;
        self.arm[t] = crosses.arms[t][0];
        self.heap.push(Front(0.0, triangle));
    }

    /// Spreads from the seeds set since the last call.
    fn run(&mut self, surface: &Surface<'_>, crosses: &Crosses) {
        while let Some(Front(distance, triangle)) = self.heap.pop() {
            let t = triangle as usize;
            if distance > self.distance[t] {
                continue;
            }
            for o in (3 * t..3 * t + 3).filter_map(|side| surface.across(side)) {
                if self.distance[o] <= distance {
                    continue;
                }
                let step = surface.middles[o] - surface.middles[t];
                let arm = crosses.nearest(o, self.arm[t]);
                let half = crosses.measure(t, self.arm[t], step) + crosses.measure(o, arm, step);
                let place = self.place[t] + 0.5 * half;
                let next = norm(place).max(distance);
                if next < self.distance[o] {
                    self.distance[o] = next;
                    self.owner[o] = self.owner[t];
                    self.place[o] = place;
                    self.arm[o] = arm;
                    self.heap.push(Front(next, index(o)));
                }
            }
        }
    }

    /// The reached triangle farthest from its seed.
    fn farthest(&self) -> Option<(u32, f64)> {
        let mut best: Option<(u32, f64)> = None;
        for (t, &d) in self.distance.iter().enumerate() {
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
            let Some(o) = surface
                .across(side)
                .filter(|&o| self.owner[o] != self.owner[t])
            else {
                continue;
            };
            let step = surface.middles[o] - surface.middles[t];
            let here = self.place[t] + crosses.measure(t, self.arm[t], step);
            // The arm there in the frame here, by the nearest quarter turn.
            let beside = crosses.normals[t].cross(self.arm[t]);
            let (c, s) = (self.arm[o].dot(self.arm[t]), self.arm[o].dot(beside));
            let turn = if c.abs() > s.abs() {
                DVec2::new(c.signum(), 0.0)
            } else {
                DVec2::new(0.0, s.signum())
            };
            pairs.push((
                [self.owner[t], self.owner[o]],
                here - turn.rotate(self.place[o]),
            ));
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
        for (t, &owner) in self.owner.iter().enumerate().filter(|(_, o)| **o != NONE) {
            let weight = crosses.area(surface, t);
            let sum = &mut sums[owner as usize];
            sum.0 += weight * self.place[t];
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
        for (t, &owner) in self.owner.iter().enumerate().filter(|(_, o)| **o != NONE) {
            let away = self.place[t].distance_squared(target[owner as usize]);
            if away < best[owner as usize].0 {
                best[owner as usize] = (away, index(t));
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
            let weigh = |off: f64| common * (-(off / (REACH * side)).powi(2)).exp();
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

/// A label per triangle: the cell of the field that it lies in. Sizes shrink by curvature `detail` times as usual.
pub(crate) fn labels(
    surface: &Surface<'_>,
    field: &CrossField,
    seeding: Seeding,
    detail: f64,
) -> Vec<u32> {
    let crosses = Crosses::new(surface, field, BEND * detail);
    let mut charts = Charts::new(surface.count());
    let mut seeds = first_seeds(surface);
    let mut number = 0;
    loop {
        for &seed in &seeds[number..] {
            charts.seed(&crosses, seed, index(number));
            number += 1;
        }
        charts.run(surface, &crosses);
        match charts.farthest() {
            Some((farthest, distance)) if seeding.wants_more(number, distance) => {
                seeds.push(farthest);
            }
            _ => break,
        }
    }
    for _ in 0..LLOYD {
        let moved = charts.targets(surface, &crosses, seeds.len());
        if moved == seeds || moved.contains(&NONE) {
            break;
        }
        seeds = moved;
        charts.clear();
        for (k, &seed) in seeds.iter().enumerate() {
            charts.seed(&crosses, seed, index(k));
        }
        charts.run(surface, &crosses);
    }
    charts.owner
}

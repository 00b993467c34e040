//! A division of the mesh into cells: disks with three corners or more that no sharp line crosses.
//!
//! Seeds are the farthest triangles until none is farther than a radius from its seed; Lloyd's steps centre them;
//! labels are smoothed. Unsound cells are split in two until all cells are sound.
//!
//! Why it ends: from round [`SMOOTH_ROUNDS`] on each round only splits, and a cell of one triangle cannot be split.
//! After [`MAX_ROUNDS`] rounds, or when no unsound cell can be split, every cell that is no disk becomes single
//! triangles. These are disks with three different vertices. More cells only add cut edges, so no disk stops being
//! one. Then vertices of its own outline are promoted to corners of each cell that lacks corners; an outline has at
//! least three vertices. All cells are sound then, whatever the mesh.

use super::NONE;
use super::grow::Grower;
use super::outlines::{Fault, Outlines};
use super::surface::{Surface, index};
use glam::DVec3;

/// Steps of Lloyd's that centre the seeds. Trial: prototype; more move the borders little.
const LLOYD: usize = 6;
/// The same for a cell that is split. Trial: prototype.
const SPLIT_LLOYD: usize = 3;
/// Rounds in which labels are smoothed at first, and after each split. Trial: prototype.
const SMOOTHINGS: [usize; 2] = [5, 2];
/// Rounds of splits after which labels are not smoothed any more. Trial: real scans need at most 10.
const SMOOTH_ROUNDS: usize = 20;
/// Most rounds of splits. Guard: the last resort follows.
const MAX_ROUNDS: usize = 60;

/// A label per triangle, and the outlines of the cells.
#[derive(Debug)]
pub(crate) struct Cells {
    pub(crate) labels: Vec<u32>,
    pub(crate) outlines: Outlines,
}

impl Cells {
    /// Number of cells.
    pub(crate) fn count(&self) -> usize {
        self.outlines.loops.len()
    }
}

/// When there are enough seeds.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Seeding {
    /// When no triangle is farther than this from its seed.
    Radius(f64),
    /// When there are so many.
    Count(usize),
}

impl Seeding {
    /// Whether another seed is wanted after `count` of them, the farthest triangle being this far away. A single cell is
    /// no division: two seeds at least, where there are two triangles.
    pub(crate) fn wants_more(self, count: usize, distance: f64) -> bool {
        let more = match self {
            Self::Radius(radius) => distance >= radius,
            Self::Count(wanted) => count < wanted,
        };
        distance > 0.0 && (more || count < 2)
    }
}

/// The label of the nearest seed for each triangle, after Lloyd's steps. About O(n log n) for n triangles.
pub(crate) fn geodesic(surface: &Surface<'_>, seeding: Seeding) -> Vec<u32> {
    let mut grower = Grower::new(surface.count());
    let mut seeds = first_seeds(surface);
    let mut number = 0;
    let most = index(surface.count());
    loop {
        for &seed in &seeds[number..] {
            grower.seed(seed, index(number));
            number += 1;
        }
        grower.run(surface, |_| true);
        match grower.farthest(0..most) {
            Some((farthest, distance)) if seeding.wants_more(number, distance) => {
                seeds.push(farthest);
            }
            _ => break,
        }
    }
    for _ in 0..LLOYD {
        let centred = centres(surface, &grower.owner, seeds.len(), 0..most);
        if centred == seeds {
            break;
        }
        seeds = centred;
        grower.clear();
        for (k, &seed) in seeds.iter().enumerate() {
            grower.seed(seed, index(k));
        }
        grower.run(surface, |_| true);
    }
    grower.owner
}

/// One triangle of each part that sharp lines separate.
pub(crate) fn first_seeds(surface: &Surface<'_>) -> Vec<u32> {
    let labels = relabelled(surface, &vec![0; surface.count()]).0;
    let mut seeds = Vec::new();
    for (t, &label) in labels.iter().enumerate() {
        if label as usize == seeds.len() {
            seeds.push(index(t));
        }
    }
    seeds
}

/// The triangle of each label nearest to the area centroid of its label.
fn centres(
    surface: &Surface<'_>,
    labels: &[u32],
    count: usize,
    among: impl Iterator<Item = u32> + Clone,
) -> Vec<u32> {
    let mut sums = vec![(DVec3::ZERO, 0.0); count];
    for t in among.clone().map(|t| t as usize) {
        let sum = &mut sums[labels[t] as usize];
        let weight = surface.areas[t] + f64::MIN_POSITIVE;
        sum.0 += weight * surface.middles[t];
        sum.1 += weight;
    }
    let mut best = vec![(f64::INFINITY, NONE); count];
    for t in among {
        let label = labels[t as usize] as usize;
        let centre = sums[label].0 / sums[label].1;
        let away = surface.middles[t as usize].distance_squared(centre);
        if away < best[label].0 || best[label].1 == NONE {
            best[label] = (away, t);
        }
    }
    best.into_iter().map(|(_, t)| t).collect()
}

/// Makes sound cells of any labels: smooths them, labels connected parts apart, and splits.
pub(crate) fn sound(surface: &Surface<'_>, mut labels: Vec<u32>) -> Cells {
    smooth(surface, &mut labels, SMOOTHINGS[0]);
    let mut grower = Grower::new(surface.count());
    let mut round = 0;
    loop {
        let (parts, count) = relabelled(surface, &labels);
        labels = parts;
        let outlines = Outlines::new(surface, &labels, count, &[]);
        if outlines.sound() {
            return Cells { labels, outlines };
        }
        if round == MAX_ROUNDS || !split_unsound(surface, &mut labels, &outlines, &mut grower) {
            return last_resort(surface, labels, &outlines);
        }
        if round < SMOOTH_ROUNDS {
            smooth(surface, &mut labels, SMOOTHINGS[1]);
        }
        round += 1;
    }
}

/// Splits each unsound cell in two, if it has two triangles. Whether any was split.
fn split_unsound(
    surface: &Surface<'_>,
    labels: &mut [u32],
    outlines: &Outlines,
    grower: &mut Grower,
) -> bool {
    let mut members = vec![Vec::new(); outlines.faults.len()];
    for (t, &label) in labels.iter().enumerate() {
        if outlines.faults[label as usize].is_some() {
            members[label as usize].push(index(t));
        }
    }
    let mut next = index(members.len());
    let mut any = false;
    for list in &members {
        if split(surface, labels, list, next, grower) {
            next += 1;
            any = true;
        }
    }
    any
}

/// Gives about half of the triangles of a connected cell the label `new`. False for single triangles.
pub(crate) fn split(
    surface: &Surface<'_>,
    labels: &mut [u32],
    members: &[u32],
    new: u32,
    grower: &mut Grower,
) -> bool {
    if members.len() < 2 {
        return false;
    }
    let own = labels[members[0] as usize];
    let mut run = |seeds: &[u32]| {
        grower.clear_some(members);
        for (k, &seed) in seeds.iter().enumerate() {
            grower.seed(seed, index(k));
        }
        grower.run(surface, |t| labels[t] == own);
        let farthest = grower.farthest(members.iter().copied());
        farthest.map_or(members[0], |f| f.0)
    };
    let one = run(&members[..1]);
    let two = run(&[one]);
    let mut seeds = vec![one, two];
    run(&seeds);
    for _ in 0..SPLIT_LLOYD {
        let centred = centres(surface, &grower.owner, 2, members.iter().copied());
        if centred == seeds || centred.contains(&NONE) {
            break;
        }
        seeds = centred;
        let mut again = |seeds: &[u32]| {
            grower.clear_some(members);
            for (k, &seed) in seeds.iter().enumerate() {
                grower.seed(seed, index(k));
            }
            grower.run(surface, |t| labels[t] == own);
        };
        again(&seeds);
    }
    for &t in members {
        if grower.owner[t as usize] == 1 {
            labels[t as usize] = new;
        }
    }
    true
}

/// Connected triangles of equal labels get a label of their own, in the order of their first triangles. Also their
/// number. O(n).
pub(crate) fn relabelled(surface: &Surface<'_>, labels: &[u32]) -> (Vec<u32>, usize) {
    let mut new = vec![NONE; labels.len()];
    let mut count = 0;
    let mut stack = Vec::new();
    for first in 0..labels.len() {
        if new[first] != NONE {
            continue;
        }
        new[first] = index(count);
        stack.push(first);
        while let Some(t) = stack.pop() {
            for o in (3 * t..3 * t + 3).filter_map(|side| surface.across(side)) {
                if new[o] == NONE && labels[o] == labels[first] {
                    new[o] = index(count);
                    stack.push(o);
                }
            }
        }
        count += 1;
    }
    (new, count)
}

/// Triangles with two neighbours of one other label take it.
pub(crate) fn smooth(surface: &Surface<'_>, labels: &mut [u32], rounds: usize) {
    for _ in 0..rounds {
        let mut changed = false;
        for t in 0..labels.len() {
            let beside = [3 * t, 3 * t + 1, 3 * t + 2]
                .map(|side| surface.across(side).map_or(NONE, |o| labels[o]));
            let twice = beside
                .iter()
                .enumerate()
                .find(|(k, label)| **label != NONE && beside[k + 1..].contains(label));
            if let Some((_, &label)) = twice
                && label != labels[t]
            {
                labels[t] = label;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
}

/// Sound cells of any cells: what is no disk becomes single triangles, and corners are promoted where they lack.
fn last_resort(surface: &Surface<'_>, mut labels: Vec<u32>, outlines: &Outlines) -> Cells {
    let mut count = index(outlines.faults.len());
    for label in &mut labels {
        if outlines.faults[*label as usize] == Some(Fault::NotDisk) {
            *label = count;
            count += 1;
        }
    }
    let (labels, count) = relabelled(surface, &labels);
    let plain = Outlines::new(surface, &labels, count, &[]);
    let mut promoted = Vec::new();
    for (outline, fault) in plain.loops.iter().zip(&plain.faults) {
        if fault.is_some() {
            promote(surface, outline, &plain.corner, &mut promoted);
        }
    }
    let outlines = Outlines::new(surface, &labels, count, &promoted);
    Cells { labels, outlines }
}

/// Promotes vertices of an outline until it has three corners.
fn promote(surface: &Surface<'_>, outline: &[u32], corner: &[bool], promoted: &mut Vec<u32>) {
    let vertices: Vec<u32> = outline
        .iter()
        .map(|&side| surface.ends(side as usize)[0])
        .collect();
    let is_corner = |v: &u32| corner[*v as usize];
    let mut corners: Vec<usize> = (0..vertices.len())
        .filter(|&k| is_corner(&vertices[k]))
        .collect();
    while corners.len() < 3 && corners.len() < vertices.len() {
        // In the middle of the widest gap.
        let n = vertices.len();
        let gap = |k: usize| {
            let (from, to) = (corners[k], corners[(k + 1) % corners.len()]);
            (to + n - from - 1) % n + 1
        };
        let widest = (0..corners.len()).max_by_key(|&k| (gap(k), n - k));
        let at = widest.map_or(0, |k| (corners[k] + gap(k) / 2) % n);
        promoted.push(vertices[at]);
        corners.push(at);
        corners.sort_unstable();
    }
}

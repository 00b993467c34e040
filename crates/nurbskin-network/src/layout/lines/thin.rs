//! A band of bent edges reduced to paths one edge wide.
//!
//! The band is a complex of triangles, edges and vertices. An edge with one triangle of the band is free: removing both
//! changes no connection and no hole of the band (an elementary collapse). The weakest free edge goes first, so that the
//! path that remains runs along the ridge. Where no edge is free (a closed band), the weakest triangle goes.

use super::bend::Bends;
use super::{NONE, Surface};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Area of a gap in the band up to which it is filled, in squares of the spacing. Trial: 12, not varied: holes of a few
/// triangles, where noise hides the bend. Larger ones belong to the shape, as the land between two lines.
const MAX_GAP: f64 = 12.0;

/// Distance within which a loose end is compared with the ridge, in spacings. Derived: the depth of a strip.
const NEAR: f64 = 2.0;
/// Share of the highest bend nearby above which a loose end is on the ridge. Derived: half a spacing off a sharp edge the
/// bend is down by a quarter.
const NEAR_RIDGE: f64 = 0.75;
/// Most vertices compared. Guard: against meshes much finer than the spacing.
const MOST: usize = 200;

/// A weight in the order of `total_cmp`.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Weight(pub(super) f64);

impl Eq for Weight {}

impl Ord for Weight {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Weight {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// What remains of the band.
pub(super) struct Skeleton {
    /// By edge: whether it is on a path.
    pub(super) edges: Vec<bool>,
    /// By triangle: whether it was in the band.
    pub(super) band: Vec<bool>,
}

/// The paths along the ridges of the bend, and the exact creases.
pub(super) fn skeleton(surface: &Surface, bends: &Bends, weak: f64) -> Skeleton {
    let band = band(surface, bends, weak);
    let mut edges = bends.exact.clone();
    for (side, &edge) in surface.edge_of.iter().enumerate() {
        if edge != NONE && band[side / 3] {
            edges[edge as usize] = true;
        }
    }
    let mut left = band.clone();
    let mut free = BinaryHeap::new();
    // The triangles from weak to strong: where to open a closed band.
    let strength = |t: usize| {
        let of = |side: usize| match surface.edge_of[side] {
            NONE => 0.0,
            edge => bends.bend[edge as usize].abs(),
        };
        of(3 * t).max(of(3 * t + 1)).max(of(3 * t + 2))
    };
    let mut order: Vec<usize> = (0..band.len()).filter(|&t| band[t]).collect();
    order.sort_by(|&a, &b| strength(a).total_cmp(&strength(b)).then(a.cmp(&b)));
    let offer = |free: &mut BinaryHeap<_>, left: &[bool], t: usize| {
        for side in 3 * t..3 * t + 3 {
            let edge = surface.edge_of[side];
            if edge != NONE && !bends.exact[edge as usize] {
                let count = surface
                    .beside(edge as usize)
                    .iter()
                    .filter(|&&t| left[t])
                    .count();
                if count == 1 {
                    free.push(Reverse((Weight(bends.ridge(edge as usize)), edge)));
                }
            }
        }
    };
    // A border is free, and no edge of a path.
    for &t in &order {
        left[t] = !surface.edge_of[3 * t..3 * t + 3].contains(&NONE);
    }
    for &t in &order {
        offer(&mut free, &left, t);
    }
    for &first in &order {
        while let Some(Reverse((_, edge))) = free.pop() {
            let edge = edge as usize;
            let mut beside = surface.beside(edge).into_iter().filter(|&t| left[t]);
            if let (true, Some(t), None) = (edges[edge], beside.next(), beside.next()) {
                edges[edge] = false;
                left[t] = false;
                offer(&mut free, &left, t);
            }
        }
        if left[first] {
            left[first] = false;
            offer(&mut free, &left, first);
        }
    }
    cut_branches(surface, bends, &mut edges);
    Skeleton { edges, band }
}

/// Removes loose edges from their ends on, down to the ridge. The collapse of triangles leaves a tree that reaches every
/// vertex of the band.
fn cut_branches(surface: &Surface, bends: &Bends, edges: &mut [bool]) {
    let height = bends.heights(surface);
    let mut degree = vec![0_u32; height.len()];
    for e in (0..edges.len()).filter(|&e| edges[e]) {
        for v in surface.ends(e) {
            degree[v as usize] += 1;
        }
    }
    let is_end = |v: u32, degree: &[u32]| degree[v as usize] == 1;
    let mut open: Vec<u32> = (0..)
        .zip(&degree)
        .filter(|(_, d)| **d == 1)
        .map(|(v, _)| v)
        .collect();
    while let Some(v) = open.pop() {
        if !is_end(v, &degree) {
            continue;
        }
        let least = NEAR_RIDGE * highest(surface, &height, v);
        for (w, edge) in surface.around(v) {
            if edges[edge] && !bends.exact[edge] && bends.bend[edge].abs() < least {
                edges[edge] = false;
                degree[v as usize] -= 1;
                degree[w as usize] -= 1;
                if is_end(w, &degree) {
                    open.push(w);
                }
            }
        }
    }
}

/// The largest height within [`NEAR`] of a vertex.
fn highest(surface: &Surface, height: &[f64], vertex: u32) -> f64 {
    let centre = surface.mesh.points[vertex as usize];
    let mut most = 0.0_f64;
    let mut met = vec![vertex];
    let mut next = 0;
    while let Some(&v) = met.get(next) {
        next += 1;
        most = most.max(height[v as usize]);
        for (w, edge) in surface.around(v) {
            let near =
                surface.mesh.points[w as usize].distance(centre) < NEAR * surface.reach[edge];
            if near && met.len() < MOST && !met.contains(&w) {
                met.push(w);
            }
        }
    }
    most
}

/// The triangles with an edge that bends, except exact creases; small gaps are filled.
fn band(surface: &Surface, bends: &Bends, weak: f64) -> Vec<bool> {
    let bent = |side: usize| {
        let edge = surface.edge_of[side];
        edge != NONE && !bends.exact[edge as usize] && bends.bend[edge as usize].abs() > weak
    };
    let count = surface.normals.len();
    let mut band: Vec<bool> = (0..count).map(|t| (3 * t..3 * t + 3).any(bent)).collect();
    let most = MAX_GAP * surface.spacing * surface.spacing;
    let mut seen = band.clone();
    for start in 0..count {
        if std::mem::replace(&mut seen[start], true) {
            continue;
        }
        let mut gap = vec![start];
        let mut area = 0.0;
        let mut closed = true;
        let mut next = 0;
        while let Some(&t) = gap.get(next) {
            next += 1;
            area += surface.mesh.vector_area(t).length();
            for side in 3 * t..3 * t + 3 {
                let edge = surface.edge_of[side];
                if edge == NONE || bends.exact[edge as usize] {
                    closed = false;
                    continue;
                }
                let other = surface.adjacency.opposite[side] as usize / 3;
                if !std::mem::replace(&mut seen[other], true) {
                    gap.push(other);
                }
            }
        }
        if closed && area < most {
            gap.iter().for_each(|&t| band[t] = true);
        }
    }
    band
}

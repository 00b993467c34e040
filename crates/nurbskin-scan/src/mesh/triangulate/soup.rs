//! A growing set of triangles, and the test whether another triangle fits.
//!
//! A triangle fits if each of its sides has at most one other triangle, it is folded onto none of these (angle about
//! the side above 40°, or 8° where the normals state a sharp edge), and its sectors at the corners overlap no other
//! sector by more than 0.05 rad, seen along the normal there. Source: ours.

use super::sites::Sites;
use glam::DVec3;
use nurbskin_geometry::math;
use std::f64::consts::{PI, TAU};

/// Cosine of the angle (40°) between two triangles about their common side, seen along it, above which they are folded
/// onto each other. Trial: not recorded. A smaller value opens sharp edges; a larger one joins the two walls of a thin
/// part.
const FOLD_COSINE: f64 = 0.77;
/// The same cosine (8°) where the normals state that the triangles are the two flanks of one edge, as of a blade.
/// Trial: not recorded.
pub(super) const SHARP_FOLD_COSINE: f64 = 0.99;
/// Angle by which two triangles may overlap at a common vertex, seen along its normal. Trial: not recorded. Noise makes
/// sound triangles overlap a little; a larger angle admits folds.
const MAX_SECTOR_OVERLAP: f64 = 0.05;

/// A growing set of triangles in which every side has at most two.
#[derive(Debug)]
pub(super) struct Soup<'a> {
    pub(super) sites: &'a Sites,
    triangles: Vec<[u32; 3]>,
    /// Whether the winding of each triangle is determined by normals.
    wound: Vec<bool>,
    /// The triangles of each vertex.
    around: Vec<Vec<u32>>,
    /// Vertices whose normal is confirmed by a plain triangle.
    settled: Vec<bool>,
}

impl<'a> Soup<'a> {
    pub(super) fn new(sites: &'a Sites) -> Self {
        Self {
            sites,
            triangles: Vec::with_capacity(2 * sites.points.len()),
            wound: Vec::with_capacity(2 * sites.points.len()),
            settled: vec![false; sites.points.len()],
            around: vec![Vec::new(); sites.points.len()],
        }
    }

    pub(super) fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    pub(super) fn insert(&mut self, triangle: [u32; 3]) {
        let (triangle, wound) = self.winding(triangle).unwrap_or((triangle, false));
        self.wound.push(wound);
        // A surface has two triangles per vertex; triangles beyond 2^32 cannot be looked up.
        let number = u32::try_from(self.triangles.len()).unwrap_or(u32::MAX);
        self.triangles.push(triangle);
        for k in triangle {
            self.around[k as usize].push(number);
        }
    }

    /// Inserts a triangle that lies in the planes of its corners, which confirms their normals.
    pub(super) fn insert_plain(&mut self, triangle: [u32; 3]) {
        self.insert(triangle);
        for k in triangle {
            self.settled[k as usize] = true;
        }
    }

    /// The far corners of the triangles at a side.
    pub(super) fn beside(&self, a: u32, b: u32) -> impl Iterator<Item = u32> {
        let triangles = self.around[a as usize].iter();
        triangles.filter_map(move |&t| {
            let t = self.triangles[t as usize];
            let far = t.into_iter().find(|&k| k != a && k != b);
            far.filter(|_| t.contains(&b))
        })
    }

    /// Whether a vertex has a triangle.
    pub(super) fn used(&self, k: u32) -> bool {
        !self.around[k as usize].is_empty()
    }

    /// Whether triangles surround a vertex.
    pub(super) fn closed(&self, k: u32) -> bool {
        let around = &self.around[k as usize];
        let mut others = around.iter().flat_map(|&t| self.triangles[t as usize]);
        !around.is_empty() && others.all(|j| j == k || self.beside(k, j).count() == 2)
    }

    /// The vertices that share a border side with `k`.
    pub(super) fn border_neighbours(&self, k: u32) -> impl Iterator<Item = u32> {
        let around = self.around[k as usize].iter();
        let others = around.flat_map(|&t| self.triangles[t as usize]);
        others.filter(move |&j| j != k && self.beside(k, j).count() == 1)
    }

    /// Whether a triangle fits: no third triangle at a side, no fold and no overlap.
    pub(super) fn fits(&self, triangle: [u32; 3]) -> bool {
        let [a, b, c] = triangle;
        let sides = [[a, b, c], [b, c, a], [c, a, b]];
        self.fits_sides(triangle)
            && self.winding(triangle).is_some_and(|winding| {
                let fits = |&[a, b, c]: &[u32; 3]| self.fits_around(a, b, c, winding);
                sides.iter().all(fits)
            })
    }

    /// Whether a triangle fits at its sides: no third triangle and no fold.
    pub(super) fn fits_sides(&self, [a, b, c]: [u32; 3]) -> bool {
        let sides = [[a, b, c], [b, c, a], [c, a, b]];
        sides.iter().all(|&[a, b, far]| self.fits_beside(a, b, far)) && !self.sites.shuts([a, b, c])
    }

    /// Whether a triangle fits at its sides, and overlaps no other at corners with a confirmed normal.
    pub(super) fn fits_plain(&self, triangle: [u32; 3]) -> bool {
        let [a, b, c] = triangle;
        let corners = [[a, b, c], [b, c, a], [c, a, b]];
        self.fits_sides(triangle)
            && self.winding(triangle).is_some_and(|winding| {
                let overlaps = |&[v, b, c]: &[u32; 3]| {
                    self.settled[v as usize] && !self.fits_around(v, b, c, winding)
                };
                !corners.iter().any(overlaps)
            })
    }

    fn fits_beside(&self, a: u32, b: u32, far: u32) -> bool {
        let mut beside = self.beside(a, b);
        let Some(other) = beside.next() else {
            return true;
        };
        if other == far || beside.next().is_some() {
            return false;
        }
        let known = [a, b, other, far]
            .iter()
            .all(|&k| self.sites.sided[k as usize]);
        self.unfolding(a, b, other, far)
            < if known {
                SHARP_FOLD_COSINE
            } else {
                FOLD_COSINE
            }
    }

    /// The winding of a triangle by its corners' normals and the triangles at its sides, and whether any of these
    /// determines it; `None` if they contradict each other.
    fn winding(&self, triangle: [u32; 3]) -> Option<([u32; 3], bool)> {
        let [a, b, c] = triangle;
        let mut found = self.sites.facing(triangle);
        let sided = |k: u32| self.sites.sided[k as usize];
        if triangle.iter().all(|&k| sided(k)) {
            for [a, b, far] in [[a, b, c], [b, c, a], [c, a, b]] {
                for &t in &self.around[a as usize] {
                    let (t, known) = (self.triangles[t as usize], self.wound[t as usize]);
                    if !known || !t.contains(&b) || !t.iter().all(|&k| sided(k)) {
                        continue;
                    }
                    let along = runs(t, a, b);
                    let asked = if along { [b, a, far] } else { [a, b, far] };
                    match found {
                        None => found = Some(asked),
                        Some(found) if runs(found, a, b) == along => return None,
                        Some(_) => {}
                    }
                }
            }
        }
        Some(found.map_or((triangle, false), |found| (found, true)))
    }

    /// The cosine of the angle between two far corners about a side: -1 in one plane, 1 if they are folded together.
    pub(super) fn unfolding(&self, a: u32, b: u32, c: u32, d: u32) -> f64 {
        let [a, b, c, d] = [a, b, c, d].map(|k| self.sites.points[k as usize]);
        let along = (b - a).normalize_or_zero();
        let across = |p: DVec3| {
            let v = p - a;
            (v - along * v.dot(along)).normalize_or_zero()
        };
        across(c).dot(across(d))
    }

    /// Whether the sector of a triangle at its corner `v` is free, as seen along the normal there. Triangles that look
    /// to the other side belong to another wall, which meets this one at a sharp edge.
    fn fits_around(&self, v: u32, b: u32, c: u32, winding: ([u32; 3], bool)) -> bool {
        let around = &self.around[v as usize];
        if around.is_empty() {
            return true;
        }
        let at = v as usize;
        let (across, along) = self.sites.normals[at].any_orthonormal_pair();
        let angle = |k: u32| {
            let d = self.sites.points[k as usize] - self.sites.points[at];
            math::atan2(d.dot(along), d.dot(across))
        };
        // Start and width, less than pi.
        let sector = |b: u32, c: u32| {
            let (b, c) = (angle(b), angle(c));
            let turn = (c - b).rem_euclid(TAU);
            if turn <= PI {
                (b, turn)
            } else {
                (c, TAU - turn)
            }
        };
        let (start, width) = sector(b, c);
        let height = |(t, wound): ([u32; 3], bool)| {
            let [a, b, c] = t.map(|k| self.sites.points[k as usize]);
            let facing = (b - a).cross(c - a).dot(self.sites.normals[at]);
            if wound { facing } else { 0.0 }
        };
        let own = height(winding);
        around.iter().all(|&t| {
            let number = t as usize;
            if own * height((self.triangles[number], self.wound[number])) < 0.0 {
                return true;
            }
            let mut others = self.triangles[t as usize].into_iter().filter(|&k| k != v);
            let (Some(b), Some(c)) = (others.next(), others.next()) else {
                return true;
            };
            let (from, turn) = sector(b, c);
            let ahead = (from - start).rem_euclid(TAU);
            let behind = (start - from).rem_euclid(TAU);
            let slack = MAX_SECTOR_OVERLAP.min(0.5 * width).min(0.5 * turn);
            (ahead >= width - slack || ahead > TAU - slack && turn <= slack)
                && (behind >= turn - slack || behind > TAU - slack && width <= slack)
        })
    }

    /// The triangles, each wound to the side of its corners' normals, or as its neighbours.
    pub(super) fn all_wound(&self) -> impl Iterator<Item = [u32; 3]> {
        let all = self.triangles.iter().zip(&self.wound);
        all.map(|(t, wound)| if *wound { *t } else { self.wound(*t) })
    }

    /// A triangle wound to the side of its corners' normals.
    fn wound(&self, triangle: [u32; 3]) -> [u32; 3] {
        let [a, b, c] = triangle.map(|k| self.sites.points[k as usize]);
        let area = (b - a).cross(c - a);
        let side: f64 = triangle
            .iter()
            .map(|&k| self.sites.normals[k as usize].dot(area))
            .sum();
        let [a, b, c] = triangle;
        if side < 0.0 { [a, c, b] } else { [a, b, c] }
    }
}

/// Whether a triangle runs from one corner to another.
fn runs([p, q, r]: [u32; 3], a: u32, b: u32) -> bool {
    [(p, q), (q, r), (r, p)].contains(&(a, b))
}

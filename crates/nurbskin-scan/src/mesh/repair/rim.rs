//! Removal of parts that hang on a border by one edge: teeth, spikes, and strips one triangle wide.
//!
//! An inner edge between two vertices of one border separates a part of the surface. The part is removed if the border
//! around it is more than 1.6 times as long as the edge, and its area at most 0.5 % of the surface (3 % in total).
//! Four single triangles of small overhang are the corners of a sheet and remain. Source: ours.

use super::surface::Surface;
use crate::mesh::manifold::{Adjacency, Manifold, NONE};
use nurbskin_geometry::unit::{counted, percent};

/// Ratio of the border around a part to the edge that it hangs on, above which the part is taken off. The lone tooth of
/// an even mesh has 2, the corner of a square 1.41. Trial: not recorded; between these two.
const MIN_OVERHANG: f64 = 1.6;
/// Most single triangles that are corners of a sheet and not teeth. Derived: a sheet has four corners.
const MAX_SHEET_CORNERS: usize = 4;
/// Largest overhang of such a corner. Trial: not recorded. Acute corners of a sheet exceed [`MIN_OVERHANG`]; an
/// isosceles triangle has 3 at an angle of 39°.
const MAX_CORNER_OVERHANG: f64 = 3.0;
/// Largest part that is taken off at once, as a share of the area. Trial: not recorded. Larger parts are shape.
const MAX_TOOTH_AREA: f64 = 0.005;
/// Largest total area that is taken off, as a share of the area. Trial: not recorded.
const MAX_TRIMMED_AREA: f64 = 0.03;
/// Most passes; each takes off the teeth that the last one exposed. Guard: a pass that takes nothing ends the loop
/// before.
const MAX_RIM_PASSES: usize = 8;

/// The triangles that were removed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Taken {
    triangles: usize,
    area: f64,
    of: f64,
}

impl Taken {
    pub(super) fn merge(&mut self, other: &Self) {
        self.triangles += other.triangles;
        self.area += other.area;
    }
    pub(super) fn note(&self) -> Option<String> {
        (self.triangles > 0).then(|| {
            format!(
                "removed {} from the ragged border, {} of the area",
                counted(self.triangles, "triangle", "triangles"),
                percent(self.area / self.of.max(f64::MIN_POSITIVE))
            )
        })
    }
}

/// Removes teeth, spikes, and strips one triangle wide: every part that one inner edge between two vertices of the same
/// border separates, if it is small and sticks out far. O(n log n) per pass, a few passes.
pub(super) fn smooth(manifold: &mut Manifold) -> Taken {
    let mut taken = Taken {
        of: manifold.area(),
        ..Taken::default()
    };
    for _ in 0..MAX_RIM_PASSES {
        if manifold.loops.is_empty() {
            break;
        }
        let adjacency = manifold.adjacency();
        let mut gone = vec![false; manifold.triangles.len()];
        let mut seen = vec![NONE; manifold.triangles.len()];
        let before = taken.triangles;
        let chords = chords(manifold, &adjacency);
        let corner = |&(overhang, side): &(f64, u32)| {
            let own = side - side % 3;
            let open = (own..own + 3).filter(|&s| adjacency.opposite[s as usize] == NONE);
            overhang < MAX_CORNER_OVERHANG && open.count() == 2
        };
        if chords.len() <= MAX_SHEET_CORNERS && chords.iter().all(corner) {
            break;
        }
        for (_, chord) in chords {
            let part = beyond(
                manifold,
                &adjacency,
                &gone,
                &mut seen,
                chord,
                MAX_TOOTH_AREA * taken.of,
            );
            let area: f64 = part.iter().map(|&t| manifold.vector_area(t).length()).sum();
            if part.is_empty() || taken.area + area > MAX_TRIMMED_AREA * taken.of {
                continue;
            }
            taken.triangles += part.len();
            taken.area += area;
            for t in part {
                gone[t] = true;
            }
        }
        if taken.triangles == before {
            break;
        }
        *manifold = without(std::mem::take(manifold), &gone);
    }
    taken
}

/// The sides that separate a part that sticks out, longest border first, and the ratio of that border to the side
/// (overhang). The triangle of the side belongs to the part.
fn chords(manifold: &Manifold, adjacency: &Adjacency) -> Vec<(f64, u32)> {
    // Border of each vertex, and its arc length from the first vertex of the border.
    let mut place = vec![(NONE, 0.0); manifold.points.len()];
    let mut lengths = Vec::new();
    for (k, border) in (0_u32..).zip(&manifold.loops) {
        let mut along = 0.0;
        for (&a, &b) in border.iter().zip(border.iter().cycle().skip(1)) {
            place[a as usize] = (k, along);
            along += manifold.points[a as usize].distance(manifold.points[b as usize]);
        }
        lengths.push(along);
    }
    let mut found = Vec::new();
    for (side, &other) in (0_u32..).zip(&adjacency.opposite) {
        let t = manifold.triangles[side as usize / 3];
        let [a, b] = [side % 3, (side + 1) % 3].map(|c| t[c as usize]);
        let [from, to] = [a, b].map(|k| place[k as usize]);
        if other == NONE || from.0 == NONE || from.0 != to.0 {
            continue;
        }
        // The border from the end of the side to its start belongs to the part of the side's triangle.
        let length = lengths[from.0 as usize];
        let around = (from.1 - to.1).rem_euclid(length);
        let chord = manifold.points[a as usize].distance(manifold.points[b as usize]);
        if around < 0.5 * length && around > MIN_OVERHANG * chord {
            found.push((around, around / chord, side));
        }
    }
    found.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.2.cmp(&y.2)));
    found
        .into_iter()
        .map(|(_, overhang, side)| (overhang, side))
        .collect()
}

/// The triangles of the part at this side; empty if their area exceeds `most`, or if the side does not separate them.
/// `seen` holds the side for which each triangle was visited last.
fn beyond(
    manifold: &Manifold,
    adjacency: &Adjacency,
    gone: &[bool],
    seen: &mut [u32],
    side: u32,
    most: f64,
) -> Vec<usize> {
    let across = adjacency.opposite[side as usize] as usize / 3;
    let first = side as usize / 3;
    if gone[first] || gone[across] {
        return Vec::new();
    }
    let mut part = vec![first];
    seen[first] = side;
    let mut area = 0.0;
    let mut k = 0;
    while let Some(&t) = part.get(k) {
        area += manifold.vector_area(t).length();
        if area > most || t == across {
            return Vec::new();
        }
        for s in 0..3 {
            let there = 3 * t + s;
            let other = adjacency.opposite[there];
            let u = other as usize / 3;
            if other != NONE && there != side as usize && !gone[u] && seen[u] != side {
                seen[u] = side;
                part.push(u);
            }
        }
        k += 1;
    }
    part
}

/// The main piece of the remaining triangles.
pub(in crate::mesh) fn without(manifold: Manifold, gone: &[bool]) -> Manifold {
    let mut kept = manifold;
    let mut number = 0;
    kept.triangles.retain(|_| {
        number += 1;
        !gone[number - 1]
    });
    Surface::from_manifold(kept).assemble().manifold
}

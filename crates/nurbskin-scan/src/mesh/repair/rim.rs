//! What hangs on a border by one edge.

use super::surface::Surface;
use crate::mesh::manifold::{Adjacency, Manifold, NONE};
use nurbskin_geometry::unit::{counted, percent};

/// A part is taken off if the border around it is so many times as long as the edge that it hangs on: the lone tooth of
/// an even mesh has 2, the corner of a square 1.41.
const OVERHANG: f64 = 1.6;
/// Up to so many single triangles in all, none with more overhang than this, are corners of a sheet, not teeth.
const CORNERS: usize = 4;
const CORNER: f64 = 3.0;
/// Largest part taken off at once, and all together, against the area.
const LARGEST: f64 = 0.005;
const MOST: f64 = 0.03;
/// Teeth under teeth are looked for so many times.
const PASSES: usize = 8;

/// What was taken off.
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

/// Takes off teeth, spikes, and strips one triangle wide: whatever one inner edge between two vertices of the same border
/// parts from the rest, if it sticks out far and is small. O(n log n) per pass, a few passes.
pub(super) fn smooth(manifold: &mut Manifold) -> Taken {
    let mut taken = Taken {
        of: manifold.area(),
        ..Taken::default()
    };
    for _ in 0..PASSES {
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
            overhang < CORNER && open.count() == 2
        };
        if chords.len() <= CORNERS && chords.iter().all(corner) {
            break;
        }
        for (_, chord) in chords {
            let part = beyond(
                manifold,
                &adjacency,
                &gone,
                &mut seen,
                chord,
                LARGEST * taken.of,
            );
            let area: f64 = part.iter().map(|&t| manifold.vector_area(t).length()).sum();
            if part.is_empty() || taken.area + area > MOST * taken.of {
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

/// The sides that part something that sticks out, longest border first, and how many times as long as the side that is;
/// the side's own triangle is what sticks out.
fn chords(manifold: &Manifold, adjacency: &Adjacency) -> Vec<(f64, u32)> {
    // Border of each vertex, and the way along it from its first vertex.
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
        // The border from the side's end on to its start is that of what its triangle belongs to.
        let length = lengths[from.0 as usize];
        let around = (from.1 - to.1).rem_euclid(length);
        let chord = manifold.points[a as usize].distance(manifold.points[b as usize]);
        if around < 0.5 * length && around > OVERHANG * chord {
            found.push((around, around / chord, side));
        }
    }
    found.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.2.cmp(&y.2)));
    found
        .into_iter()
        .map(|(_, overhang, side)| (overhang, side))
        .collect()
}

/// The triangles on this side's side; none if they are more than `most` in area, or the side does not part them. `seen`
/// holds the side for which each triangle was met last.
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

/// The main piece of what is not gone.
pub(super) fn without(manifold: Manifold, gone: &[bool]) -> Manifold {
    let mut kept = manifold;
    let mut number = 0;
    kept.triangles.retain(|_| {
        number += 1;
        !gone[number - 1]
    });
    Surface::from_manifold(kept).assemble().manifold
}

//! Outlines of cells: the loops of sides around each one, their corners, and what is wrong with a cell.
//!
//! A side is cut if the triangle across has another label or does not exist. A cell is sound if it is a disk, its
//! outline meets no vertex twice, and it has three corners. With I inner vertices, B cut sides and F triangles,
//! the Euler number of a cell is I + B/2 - F/2. A corner is a vertex with three or more cut edges, one where a sharp or
//! open line turns, or one that was promoted.

use super::NONE;
use super::surface::{Surface, after};
use glam::DVec3;
use nurbskin_geometry::math;

/// Least turn of a sharp line at a corner, degrees. Source: design note, section 4.1: below, arcs round no kink worth a
/// corner; without such corners the lines of fandisk were off by 18 thousandths of the diagonal, with them by 2.5.
const TURN: f64 = 50.0;
/// Lengths over which the turn of a line is measured, in diagonals: sharp, open. Trial: prototype for sharp lines; open
/// lines of scans are ragged, and turn as much at shorter lengths everywhere.
const REACH: [f64; 2] = [0.012, 0.03];

/// What is wrong with a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// It has handles, several borders, or meets itself at a vertex.
    NotDisk,
    /// It has fewer than three corners.
    Corners,
}

/// The outlines of all cells.
#[derive(Debug)]
pub(crate) struct Outlines {
    /// Per vertex.
    pub(crate) corner: Vec<bool>,
    /// Corners that a line has because it turns there, or that were promoted.
    pub(crate) turned: Vec<bool>,
    /// Per cell the cut sides around it in the direction of its triangles; of the first loop, where there are several.
    pub(crate) loops: Vec<Vec<u32>>,
    /// Per cell.
    pub(crate) faults: Vec<Option<Fault>>,
}

impl Outlines {
    /// Of the cells `0..cells`; `promoted` are additional corners.
    pub(crate) fn new(
        surface: &Surface<'_>,
        labels: &[u32],
        cells: usize,
        promoted: &[u32],
    ) -> Self {
        let cut = cut_sides(surface, labels);
        let mut degree = vec![0_u32; surface.mesh.points.len()];
        for (side, _) in cut.iter().enumerate().filter(|(_, cut)| **cut) {
            let other = surface.table.opposite[side];
            if other == NONE || side < other as usize {
                for v in surface.ends(side) {
                    degree[v as usize] += 1;
                }
            }
        }
        let turned = turns(surface, &cut, &degree, promoted);
        let corner = degree.iter().zip(&turned).map(|(d, t)| *d >= 3 || *t);
        let mut outlines = Self {
            corner: corner.collect(),
            turned,
            loops: vec![Vec::new(); cells],
            faults: vec![None; cells],
        };
        let count = outlines.trace(surface, labels, &cut);
        outlines.judge(surface, labels, &degree, &count);
        outlines
    }

    /// Whether all cells are sound.
    pub(crate) fn sound(&self) -> bool {
        self.faults.iter().all(Option::is_none)
    }

    /// Finds the loops; returns their number per cell. Cells that meet themselves are marked.
    fn trace(&mut self, surface: &Surface<'_>, labels: &[u32], cut: &[bool]) -> Vec<u32> {
        let mut count = vec![0_u32; self.loops.len()];
        let mut seen = vec![false; cut.len()];
        let mut met = vec![usize::MAX; surface.mesh.points.len()];
        for first in (0..cut.len()).filter(|&side| cut[side]) {
            if seen[first] {
                continue;
            }
            let cell = labels[first / 3] as usize;
            let mut outline = Vec::new();
            let mut side = first;
            while !seen[side] {
                seen[side] = true;
                outline.push(super::surface::index(side));
                let start = surface.ends(side)[0] as usize;
                if met[start] == first {
                    self.faults[cell] = Some(Fault::NotDisk);
                }
                met[start] = first;
                side = after(side);
                while !cut[side] {
                    side = after(surface.table.opposite[side] as usize);
                }
            }
            count[cell] += 1;
            if self.loops[cell].is_empty() {
                self.loops[cell] = outline;
            }
        }
        count
    }

    /// Finds the faults, given the number of loops of each cell.
    fn judge(&mut self, surface: &Surface<'_>, labels: &[u32], degree: &[u32], count: &[u32]) {
        // Twice the Euler number without the part of the cut sides.
        let mut twice = vec![0_i64; self.loops.len()];
        for &label in labels {
            twice[label as usize] -= 1;
        }
        for (v, _) in degree.iter().enumerate().filter(|(_, d)| **d == 0) {
            let side = surface.table.first[v];
            if side != NONE {
                twice[labels[side as usize / 3] as usize] += 2;
            }
        }
        for (cell, outline) in self.loops.iter().enumerate() {
            let sides = i64::try_from(outline.len()).unwrap_or(i64::MAX / 2);
            if count[cell] != 1 || twice[cell] + sides != 2 {
                self.faults[cell] = Some(Fault::NotDisk);
            }
            let corners = outline.iter().filter(|&&side| {
                let start = surface.ends(side as usize)[0];
                self.corner[start as usize]
            });
            if self.faults[cell].is_none() && corners.count() < 3 {
                self.faults[cell] = Some(Fault::Corners);
            }
        }
    }
}

/// Per side, whether the triangle across has another label or does not exist.
fn cut_sides(surface: &Surface<'_>, labels: &[u32]) -> Vec<bool> {
    let other = |side: usize| surface.table.opposite[side];
    (0..3 * labels.len())
        .map(|side| other(side) == NONE || labels[other(side) as usize / 3] != labels[side / 3])
        .collect()
}

/// The vertices at which a sharp or open line turns although only two cut edges meet there, and the promoted ones.
/// Sharpest first; no other one within the reach of an accepted one.
fn turns(surface: &Surface<'_>, cut: &[bool], degree: &[u32], promoted: &[u32]) -> Vec<bool> {
    let mut turned = vec![false; degree.len()];
    for &v in promoted {
        turned[v as usize] = true;
    }
    let mut beside: Vec<[u32; 2]> = vec![[NONE; 2]; degree.len()];
    let mut on_line = Vec::new();
    for side in (0..cut.len()).filter(|&s| cut[s]) {
        let other = surface.table.opposite[side];
        let open = other == NONE;
        if !(open || surface.sharp[side] && side < other as usize) {
            continue;
        }
        let [a, b] = surface.ends(side);
        for (v, w) in [(a, b), (b, a)] {
            let pair = &mut beside[v as usize];
            if pair[0] == NONE {
                pair[0] = w;
                on_line.push((v, open));
            } else {
                pair[1] = w;
            }
        }
    }
    let walk = Walk {
        surface,
        beside: &beside,
        degree,
    };
    let mut kinks: Vec<(f64, u32, f64)> = on_line
        .iter()
        .filter(|(v, _)| degree[*v as usize] == 2 && beside[*v as usize][1] != NONE)
        .filter_map(|&(v, open)| {
            let reach = REACH[usize::from(open)] * surface.diagonal;
            let turn = walk.turn(v, reach);
            (turn > TURN).then_some((turn, v, reach))
        })
        .collect();
    kinks.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
    let mut blocked = vec![false; degree.len()];
    for (_, v, reach) in kinks {
        if !blocked[v as usize] {
            turned[v as usize] = true;
            for towards in beside[v as usize] {
                walk.ahead(v, towards, reach, |w| blocked[w as usize] = true);
            }
        }
    }
    turned
}

/// Walks along lines.
struct Walk<'a> {
    surface: &'a Surface<'a>,
    beside: &'a [[u32; 2]],
    degree: &'a [u32],
}

impl Walk<'_> {
    /// From `v` over its neighbour along the line until `reach` is behind, the line ends or meets another; calls `met`
    /// for each vertex.
    fn ahead(&self, v: u32, towards: u32, reach: f64, mut met: impl FnMut(u32)) -> DVec3 {
        let (mut from, mut at) = (v, towards);
        let mut length = 0.0;
        loop {
            met(at);
            length += self.surface.place(from).distance(self.surface.place(at));
            let pair = self.beside[at as usize];
            if length >= reach || pair[1] == NONE || self.degree[at as usize] != 2 {
                break;
            }
            let next = if pair[0] == from { pair[1] } else { pair[0] };
            if next == v {
                break;
            }
            (from, at) = (at, next);
        }
        self.surface.place(at)
    }

    /// The turn of the line at `v`, degrees.
    fn turn(&self, v: u32, reach: f64) -> f64 {
        let place = self.surface.place(v);
        let [p, q] = self.beside[v as usize].map(|w| self.ahead(v, w, reach, |_| ()));
        let (a, b) = (place - p, q - place);
        let straight = a.dot(b) / (a.length() * b.length()).max(f64::MIN_POSITIVE);
        math::acos(straight.clamp(-1.0, 1.0)).to_degrees()
    }
}

//! Meshes of implicit surfaces: a surface net over the cells of a grid that the surface crosses.
//!
//! Each cell whose corners differ in sign gets a vertex for each sheet of the surface in it, and each grid edge whose
//! ends differ in sign gets the quadrilateral of the sheets of its four cells. Sheets are loops of crossed edges: two
//! crossed edges of a face belong together; where all four are crossed, the two at each inner corner do. Cells are found
//! by bisection of a cube: a 1-Lipschitz function has no zero in a cube whose half diagonal is less than its value at
//! the centre.
//!
//! Source: S. F. F. Gibson, *Constrained elastic surface nets*, MICCAI 1998; G. M. Nielson, *Dual marching cubes*, IEEE
//! Visualization 2004, for several vertices in a cell.

use glam::{DVec3, IVec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// A grid of cells. Cell (i, j, k) begins at `origin` + (i, j, k) `spacing`.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    pub(super) origin: DVec3,
    pub(super) spacing: DVec3,
    /// Number of cells along each axis.
    pub(super) count: IVec3,
}

/// Values above this are outside, mm. Guard: a face of the body may lie in a plane of the grid, where rounding must not
/// decide.
const INSIDE: f64 = -1e-9;

/// A cell that the surface crosses.
struct Crossed {
    cell: IVec3,
    /// A bit for each corner, set inside.
    mask: u8,
    /// The sheet of each crossed edge, by [`edge`].
    sheet: [u8; 24],
    /// The mean of the crossings of each sheet.
    points: Vec<DVec3>,
}

/// The number of a cell's edge from its lower corner: bits 0 to 2 of a corner are its x, y and z.
fn edge(corner: usize, axis: usize) -> usize {
    8 * axis + (corner & !(1 << axis))
}

/// The net: a vertex for each sheet, and triangles with the outside on their left-hand turn.
pub(super) struct Net {
    pub(super) points: Vec<DVec3>,
    /// The cell of each vertex.
    pub(super) cells: Vec<IVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Grid {
    fn node(&self, at: IVec3) -> DVec3 {
        self.origin + at.as_dvec3() * self.spacing
    }

    /// Cells that a zero of the function may cross, in the order of the bisection.
    fn candidates(&self, level: &(impl Fn(DVec3) -> f64 + Sync)) -> Vec<IVec3> {
        let mut size = 1;
        while size < self.count.max_element() {
            size *= 2;
        }
        let mut found = Vec::new();
        let mut open = vec![(IVec3::ZERO, size)];
        while let Some((low, size)) = open.pop() {
            if low.cmpge(self.count).any() {
                continue;
            }
            let half = 0.5 * f64::from(size) * self.spacing;
            if level(self.node(low) + half).abs() > half.length() {
                continue;
            }
            if size == 1 {
                found.push(low);
                continue;
            }
            let half = size / 2;
            for k in 0..8 {
                open.push((low + half * IVec3::new(k & 1, k >> 1 & 1, k >> 2), half));
            }
        }
        found
    }

    /// Signs, sheets and crossings of a cell; `None` where all signs are the same.
    fn crossed(&self, cell: IVec3, level: &(impl Fn(DVec3) -> f64 + Sync)) -> Option<Crossed> {
        let mut nodes = [(DVec3::ZERO, 0.0); 8];
        for (k, node) in (0_i32..).zip(&mut nodes) {
            let place = self.node(cell + IVec3::new(k & 1, k >> 1 & 1, k >> 2));
            *node = (place, level(place));
        }
        let mask = (0..8).fold(0_u8, |mask, k| mask | u8::from(nodes[k].1 < INSIDE) << k);
        if mask == 0 || mask == 255 {
            return None;
        }
        let (sheet, count) = sheets(mask);
        let mut sums = vec![(DVec3::ZERO, 0.0); count];
        for (corner, axis) in (0..8).flat_map(|corner| (0..3).map(move |axis| (corner, axis))) {
            let other = corner | 1 << axis;
            if corner == other || (mask >> corner ^ mask >> other) & 1 == 0 {
                continue;
            }
            let (from, to) = (nodes[corner], nodes[other]);
            let part = (from.1 / (from.1 - to.1)).clamp(0.0, 1.0);
            let sum = &mut sums[usize::from(sheet[edge(corner, axis)])];
            sum.0 += from.0.lerp(to.0, part);
            sum.1 += 1.0;
        }
        Some(Crossed {
            cell,
            mask,
            sheet,
            points: sums.iter().map(|(sum, count)| sum / *count).collect(),
        })
    }

    /// The net of the zeros of a 1-Lipschitz function. O(n log n) in the cells crossed.
    pub(super) fn net(&self, level: &(impl Fn(DVec3) -> f64 + Sync)) -> Net {
        let candidates = self.candidates(level);
        let crossed: Vec<Crossed> = candidates
            .into_par_iter()
            .filter_map(|cell| self.crossed(cell, level))
            .collect();
        let mut points = Vec::with_capacity(crossed.len());
        let mut cells = Vec::with_capacity(crossed.len());
        let mut first: HashMap<IVec3, (u32, usize)> = HashMap::with_capacity(crossed.len());
        for (k, of) in crossed.iter().enumerate() {
            first.insert(
                of.cell,
                (u32::try_from(points.len()).unwrap_or(u32::MAX), k),
            );
            points.extend(&of.points);
            cells.extend(of.points.iter().map(|_| of.cell));
        }
        let mut triangles = Vec::with_capacity(2 * points.len());
        for of in &crossed {
            for axis in 0..3 {
                // The edge from corner 0 of the cell, and its place in the four cells around it.
                let (inside, beyond) = (of.mask & 1 != 0, of.mask >> (1 << axis) & 1 != 0);
                if inside == beyond {
                    continue;
                }
                let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
                let vertex = |back: usize| {
                    let step = [0, 1, 2].map(|k| i32::from(back >> k & 1 != 0));
                    let &(first, k) = first.get(&(of.cell - IVec3::from(step)))?;
                    Some(first + u32::from(crossed[k].sheet[edge(back, axis)]))
                };
                let around = [0, 1 << b, 1 << b | 1 << c, 1 << c].map(vertex);
                if let [Some(p), Some(q), Some(r), Some(s)] = around {
                    let corners = if inside { [p, q, r, s] } else { [s, r, q, p] };
                    triangles.extend(halves(corners, &points));
                }
            }
        }
        Net {
            points,
            cells,
            triangles,
        }
    }
}

/// Two triangles of a quadrilateral, along its shorter diagonal.
fn halves([p, q, r, s]: [u32; 4], points: &[DVec3]) -> [[u32; 3]; 2] {
    let square = |a: u32, b: u32| points[a as usize].distance_squared(points[b as usize]);
    if square(p, r) <= square(q, s) {
        [[p, q, r], [p, r, s]]
    } else {
        [[p, q, s], [q, r, s]]
    }
}

/// The sheet of each crossed edge of a cell of these signs, and their number.
fn sheets(mask: u8) -> ([u8; 24], usize) {
    let inside = |corner: usize| mask >> corner & 1 != 0;
    let crosses = |corner: usize, axis: usize| inside(corner) != inside(corner ^ 1 << axis);
    // 1. The edges that follow each other over the faces, as classes of least members.
    let mut class: [usize; 24] = std::array::from_fn(|k| k);
    let mut join = |a: usize, b: usize| {
        let (from, to) = (class[a].max(class[b]), class[a].min(class[b]));
        class
            .iter_mut()
            .filter(|c| **c == from)
            .for_each(|c| *c = to);
    };
    for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1 << axis)]) {
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        let corners = [0, 1 << b, 1 << c, 1 << b | 1 << c].map(|k| k | side);
        let sides = [
            (corners[0], b),
            (corners[2], b),
            (corners[0], c),
            (corners[1], c),
        ];
        let met = sides
            .iter()
            .filter(|(corner, along)| crosses(*corner, *along));
        let met: Vec<usize> = met.map(|&(corner, along)| edge(corner, along)).collect();
        if let [one, two] = met[..] {
            join(one, two);
        } else if met.len() == 4 {
            for &corner in corners.iter().filter(|&&corner| inside(corner)) {
                join(edge(corner, b), edge(corner, c));
            }
        }
    }
    // 2. Classes of crossed edges, numbered.
    let mut sheet = [0; 24];
    let mut found: Vec<usize> = Vec::with_capacity(4);
    for (corner, axis) in (0..8).flat_map(|corner| (0..3).map(move |axis| (corner, axis))) {
        if corner >> axis & 1 == 0 && crosses(corner, axis) {
            let class = class[edge(corner, axis)];
            let number = found.iter().position(|&c| c == class).unwrap_or_else(|| {
                found.push(class);
                found.len() - 1
            });
            sheet[edge(corner, axis)] = u8::try_from(number).unwrap_or(0);
        }
    }
    (sheet, found.len())
}

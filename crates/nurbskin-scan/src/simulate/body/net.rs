//! Meshes of implicit surfaces: a surface net over the cells of a grid that the surface crosses.
//!
//! Each cell whose corners differ in sign gets one vertex, and each grid edge whose ends differ in sign gets the
//! quadrilateral of its four cells. Cells are found by bisection of a cube: a 1-Lipschitz function has no zero in a cube
//! whose half diagonal is less than its value at the centre.
//!
//! Source: S. F. F. Gibson, *Constrained elastic surface nets*, MICCAI 1998.

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

/// The net: a vertex for each cell, and triangles with the outside on their left-hand turn.
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

    /// Signs of the corners of a cell, a bit each, set inside; and the mean of the zeros on its edges. `None` where all
    /// signs are the same.
    fn crossing(&self, cell: IVec3, level: &(impl Fn(DVec3) -> f64 + Sync)) -> Option<(u8, DVec3)> {
        let corner = |k: i32| cell + IVec3::new(k & 1, k >> 1 & 1, k >> 2);
        let values: [f64; 8] = std::array::from_fn(|k| {
            #[expect(clippy::cast_possible_truncation, reason = "below 8")]
            level(self.node(corner(k as i32)))
        });
        let mask = (0..8).fold(0_u8, |mask, k| mask | u8::from(values[k] < 0.0) << k);
        if mask == 0 || mask == 255 {
            return None;
        }
        let (mut sum, mut count) = (DVec3::ZERO, 0.0);
        for (a, b) in (0..8).flat_map(|a| [1, 2, 4].map(|bit| (a, a | bit))) {
            if a == b || (values[a] < 0.0) == (values[b] < 0.0) {
                continue;
            }
            let part = values[a] / (values[a] - values[b]);
            #[expect(clippy::cast_possible_truncation, reason = "below 8")]
            let [from, to] = [a, b].map(|k| self.node(corner(k as i32)));
            sum += from.lerp(to, part);
            count += 1.0;
        }
        Some((mask, sum / count))
    }

    /// The net of the zeros of a 1-Lipschitz function. O(n log n) in the cells crossed.
    pub(super) fn net(&self, level: &(impl Fn(DVec3) -> f64 + Sync)) -> Net {
        let candidates = self.candidates(level);
        let crossed: Vec<(IVec3, u8, DVec3)> = candidates
            .into_par_iter()
            .filter_map(|cell| {
                let (mask, point) = self.crossing(cell, level)?;
                Some((cell, mask, point))
            })
            .collect();
        let vertex: HashMap<IVec3, u32> = crossed.iter().map(|c| c.0).zip(0_u32..).collect();
        let mut triangles = Vec::with_capacity(2 * crossed.len());
        for &(cell, mask, _) in &crossed {
            for (axis, bit) in [1_u8, 2, 4].into_iter().enumerate() {
                // Corner 0 of the cell and its next corner along the axis.
                let (first, second) = (mask & 1 != 0, mask >> bit & 1 != 0);
                if first == second {
                    continue;
                }
                let unit = |k: usize| IVec3::AXES[k % 3];
                let (b, c) = (unit(axis + 1), unit(axis + 2));
                let corners = [cell, cell - b, cell - b - c, cell - c].map(|at| vertex.get(&at));
                let [Some(&p), Some(&q), Some(&r), Some(&s)] = corners else {
                    continue;
                };
                let [p, q, r, s] = if first { [p, q, r, s] } else { [s, r, q, p] };
                let place = |k: u32| crossed[k as usize].2;
                if place(p).distance_squared(place(r)) <= place(q).distance_squared(place(s)) {
                    triangles.extend([[p, q, r], [p, r, s]]);
                } else {
                    triangles.extend([[p, q, s], [q, r, s]]);
                }
            }
        }
        Net {
            points: crossed.iter().map(|c| c.2).collect(),
            cells: crossed.iter().map(|c| c.0).collect(),
            triangles,
        }
    }
}

//! Triangulation of a range image, without triangles across steps in depth.
//!
//! A side between two cells is cut if it differs from both sides that continue it on its line by more than max(2.5 l,
//! 4 c), with l and c the median length and median difference of successive sides in a window of 7 × 7 cells, or if it
//! is longer than 6 l. Each square of cells gives up to two triangles across its shorter diagonal. Source: ours.

use crate::GridLayout;
use glam::DVec3;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::statistics::median_in_place;
use rayon::prelude::*;

/// Half the side of the window in which side lengths and differences are compared (7 × 7 cells). Trial: not recorded.
/// Larger windows mix regions of different depth.
const HALF_WINDOW: isize = 3;
/// Difference of a side from both its continuations, in median side lengths, above which it crosses a step in depth.
/// Trial: not recorded. Smaller values tear noisy surfaces, larger ones bridge steps.
const STEP_LENGTHS: f64 = 2.5;
/// The same difference in median differences of successive sides, where that is larger. Trial: not recorded. Coarsely
/// quantised depths have steps everywhere.
const STEP_CHANGES: f64 = 4.0;
/// Length of a side, in median side lengths, above which it crosses a step in depth whatever its continuations are.
/// Trial: not recorded. Smaller values tear surfaces at grazing views.
const MAX_SIDE_LENGTHS: f64 = 6.0;

/// Triangles between neighbouring cells of a range image, by index in `points`, all wound the same way; never across a
/// step in depth.
///
/// A side between two cells is cut if its difference from the sides before and after it on its line is large against
/// both the median length and the median difference nearby, or if it is much longer than the median. Of a square with a
/// missing corner or a cut side the remaining triangle is used, if there is one. Cells without a finite point are
/// empty; closed directions are ignored.
///
/// Empty for a layout whose cells are not `count_u * count_v` or refer to points that do not exist. O(cells), about 2
/// us each.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_scan::mesh::range_grid::triangles_of_grid;
/// use nurbskin_scan::GridLayout;
/// // Two terraces.
/// let points: Vec<DVec3> = (0..60)
///     .map(|k| DVec3::new(f64::from(k % 10), f64::from(k / 10), if k % 10 < 5 { 0.0 } else { 7.0 }))
///     .collect();
/// let grid = GridLayout::complete(10, 6).unwrap_or(GridLayout { count_u: 0, count_v: 0, cells: Vec::new() });
/// assert_eq!(triangles_of_grid(&points, &grid).len(), 2 * 2 * 4 * 5);
/// ```
#[must_use]
pub fn triangles_of_grid(points: &[DVec3], grid: &GridLayout) -> Vec<[u32; 3]> {
    if grid.count_u.checked_mul(grid.count_v) != Some(grid.cells.len()) {
        return Vec::new();
    }
    let image = Image { points, grid };
    let rows = 0..isize::try_from(grid.count_v).unwrap_or(0) - 1;
    rows.into_par_iter()
        .flat_map_iter(|j| image.strip(j))
        .collect()
}

/// Column and row of a cell, which may lie outside the image.
type Cell = [isize; 2];

/// Direction of a line of the image: the step to the next cell.
type Direction = [isize; 2];

/// Step to the next cell along u. Derived: the unit vector.
const ALONG_U: Direction = [1, 0];
/// Step to the next cell along v. Derived: the unit vector.
const ALONG_V: Direction = [0, 1];

struct Image<'a> {
    points: &'a [DVec3],
    grid: &'a GridLayout,
}

/// Medians around a cell, along u and along v: lengths and differences of successive sides.
#[derive(Clone, Copy)]
struct Usual {
    lengths: [f64; 2],
    changes: [f64; 2],
}

impl Image<'_> {
    fn index(&self, [i, j]: Cell) -> Option<u32> {
        let (i, j) = (usize::try_from(i).ok()?, usize::try_from(j).ok()?);
        if i >= self.grid.count_u {
            return None;
        }
        *self.grid.cells.get(i + j * self.grid.count_u)?
    }

    fn at(&self, cell: Cell) -> Option<DVec3> {
        let point = self.points.get(self.index(cell)? as usize)?;
        point.is_finite().then_some(*point)
    }

    /// The offset from a cell to the next in a direction.
    fn side(&self, cell: Cell, direction: Direction) -> Option<DVec3> {
        Some(self.at(moved(cell, direction, 1))? - self.at(cell)?)
    }

    fn usual(&self, [i, j]: Cell, values: &mut [Vec<f64>; 4]) -> Usual {
        values.iter_mut().for_each(Vec::clear);
        for y in -HALF_WINDOW..=HALF_WINDOW {
            for x in -HALF_WINDOW..=HALF_WINDOW {
                let cell = [i + x, j + y];
                for (k, direction) in [ALONG_U, ALONG_V].into_iter().enumerate() {
                    if let Some(side) = self.side(cell, direction) {
                        values[k].push(side.length());
                        if let Some(next) = self.side(moved(cell, direction, 1), direction) {
                            values[k + 2].push(side.distance(next));
                        }
                    }
                }
            }
        }
        let [a, b, c, d] = values.each_mut().map(|values| match values.len() {
            0 => 0.0,
            _ => median_in_place(values),
        });
        Usual {
            lengths: [a, b],
            changes: [c, d],
        }
    }

    /// Whether two cells next to each other lie on one sheet.
    fn joined(&self, cell: Cell, direction: Direction, usual: &Usual) -> bool {
        let Some(side) = self.side(cell, direction) else {
            return false;
        };
        let along = direction.map(|step| if step == 0 { 0.0 } else { 1.0 });
        let of = |values: [f64; 2]| math::hypot(values[0] * along[0], values[1] * along[1]);
        let (length, change) = (of(usual.lengths), of(usual.changes));
        if side.length() > MAX_SIDE_LENGTHS * length {
            return false;
        }
        let before = self.side(moved(cell, direction, -1), direction);
        let after = self.side(moved(cell, direction, 1), direction);
        let least = [before, after]
            .into_iter()
            .flatten()
            .map(|other| side.distance(other))
            .reduce(f64::min);
        least.unwrap_or(side.length() - length)
            <= (STEP_LENGTHS * length).max(STEP_CHANGES * change)
    }

    /// The triangles between row `j` and the next.
    fn strip(&self, j: isize) -> Vec<[u32; 3]> {
        let mut values: [Vec<f64>; 4] = Default::default();
        let mut found = Vec::new();
        for i in 0..isize::try_from(self.grid.count_u).unwrap_or(0) - 1 {
            self.square([i, j], &mut values, &mut found);
        }
        found
    }

    fn square(&self, [i, j]: Cell, values: &mut [Vec<f64>; 4], found: &mut Vec<[u32; 3]>) {
        let corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
        let places = corners.map(|cell| self.at(cell));
        if places.iter().flatten().count() < 3 {
            return;
        }
        let usual = self.usual([i, j], values);
        let sides = [
            self.joined(corners[0], ALONG_U, &usual),
            self.joined(corners[1], ALONG_V, &usual),
            self.joined(corners[3], ALONG_U, &usual),
            self.joined(corners[0], ALONG_V, &usual),
        ];
        // The diagonal from the first corner, and the other one: whether it is joined, the two triangles that it makes,
        // and the sides of each.
        let halves = [
            (
                self.joined(corners[0], [1, 1], &usual),
                [[0, 1, 2], [0, 2, 3]],
                [[0, 1], [2, 3]],
            ),
            (
                self.joined(corners[1], [-1, 1], &usual),
                [[1, 2, 3], [1, 3, 0]],
                [[1, 2], [3, 0]],
            ),
        ];
        let choice = halves.map(|(joined, triangles, beside)| {
            let whole = |k: usize| joined && beside[k].iter().all(|&side| sides[side]);
            let taken = [0, 1].map(|k| whole(k).then_some(triangles[k]));
            let length = match (places[triangles[1][0]], places[triangles[1][1]]) {
                (Some(a), Some(c)) => a.distance(c),
                _ => f64::INFINITY,
            };
            (taken, length)
        });
        let count = |k: usize| choice[k].0.iter().flatten().count();
        let better = match count(0).cmp(&count(1)) {
            std::cmp::Ordering::Equal => usize::from(choice[1].1 < choice[0].1),
            order => usize::from(order.is_lt()),
        };
        for triangle in choice[better].0.into_iter().flatten() {
            if let [Some(a), Some(b), Some(c)] = triangle.map(|k| self.index(corners[k])) {
                found.push([a, b, c]);
            }
        }
    }
}

fn moved([i, j]: Cell, [x, y]: Direction, steps: isize) -> Cell {
    [i + x * steps, j + y * steps]
}

#[cfg(test)]
mod tests;

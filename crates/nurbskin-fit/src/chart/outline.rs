//! The outline of a flat set of points and triangles.
//!
//! The set is drawn on a raster. A morphological closing, the filling of holes and an opening (Serra 1982) remove gaps
//! between points, windows and hairs:
//!
//! ```text
//! X  ->  fill(X ⊕ C) ⊖ C  ->  (· ⊖ O) ⊕ O        C, O squares of 6 and 4 cells
//! ```
//!
//! Three passes of a box blur and the contour at 1/2 then give one closed polygon that is smooth on the scale of a
//! cell. O(points + cells).

use glam::DVec2;
use nurbskin_geometry::numeric::contours::{area, contours};

/// Fewest and most cells along the longer side of the raster. Guard: the lower limit keeps a scan of few points larger
/// than the closing; the upper one bounds the raster to about 10⁶ cells.
const RASTER_CELLS: [f64; 2] = [24.0, 1000.0];
/// Cells per spacing. Trial: not recorded. A coarser raster shifts the outline by its cells; a finer one needs wider
/// closing and opening, which are counted in cells.
const CELLS_PER_SPACING: f64 = 3.0;
/// Half-width of the morphological closing, in cells (6 cells are two spacings): gaps up to twice as wide are closed.
/// Trial: not recorded. A smaller one leaves gaps between points open, a larger one fills bays.
const CLOSING_CELLS: usize = 6;
/// Half-width of the morphological opening, in cells: what is thinner than twice as much is removed. Trial: not
/// recorded. A smaller one keeps hairs of stray points, a larger one takes off the corners of the sheet.
const OPENING_CELLS: usize = 4;
/// Empty cells around the picture. Derived: the closing plus six cells, more than the three passes of the blur reach,
/// so that nothing touches the border of the raster.
const MARGIN_CELLS: usize = CLOSING_CELLS + 6;
/// Radius of the disc that is drawn for each point, in spacings. Trial: not recorded; a point stands for half a spacing
/// to every side. A larger one draws the outline outside the points, a smaller one leaves gaps between them.
const DISC_RADIUS: f64 = 0.4;
/// Passes of the box blur of three cells before the contour is traced. Trial: not recorded. Fewer leave the stairs of
/// the cells in the outline, more round off its corners.
const BLUR_PASSES: usize = 3;

/// What is drawn on the raster.
pub(super) struct Picture<'a> {
    /// Points in the plane; points outside of the rectangle are left out.
    pub(super) points: &'a [DVec2],
    /// Per point, the factor by which projection shortens a length across the rim; it keeps the outline close at steep
    /// rims.
    pub(super) cosines: &'a [f64],
    /// Triangles between the points, if any; their corners lie in or near the rectangle.
    pub(super) triangles: &'a [[usize; 3]],
    /// Typical distance of neighbouring points in space.
    pub(super) spacing: f64,
}

/// The outline, counter-clockwise, of a picture in the rectangle from the origin to `size`; empty if there is none.
/// Holes are ignored; of several pieces the largest is taken. O(points + cells).
pub(super) fn trace(picture: &Picture<'_>, size: DVec2) -> Vec<DVec2> {
    let &Picture {
        points,
        cosines,
        triangles,
        spacing,
    } = picture;
    if spacing.is_nan() || spacing <= 0.0 {
        return Vec::new();
    }
    let long = size.max_element();
    let cell = long / (CELLS_PER_SPACING * long / spacing).clamp(RASTER_CELLS[0], RASTER_CELLS[1]);
    let mut raster = Raster::new(size, cell);
    for (&p, cosine) in points.iter().zip(cosines) {
        raster.draw_disc(p, DISC_RADIUS * spacing * cosine.clamp(0.0, 1.0));
    }
    for t in triangles {
        raster.draw_triangle(t.map(|k| points[k]));
    }
    // 1. Closing, then no holes, then opening.
    raster.grow(CLOSING_CELLS, true);
    raster.fill_holes();
    raster.grow(CLOSING_CELLS, false);
    raster.grow(OPENING_CELLS, false);
    raster.grow(OPENING_CELLS, true);
    // 2. A smooth picture, and its contour.
    for _ in 0..BLUR_PASSES {
        raster.blur();
    }
    let largest = raster
        .contours(0.5)
        .into_iter()
        .max_by(|a, b| area(a).total_cmp(&area(b)));
    largest.unwrap_or_default()
}

/// A picture of cells, 1 inside and 0 outside; u fastest.
struct Raster {
    count: [usize; 2],
    cell: f64,
    values: Vec<f64>,
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "cells are counted from zero to a few thousand, and clamped"
)]
impl Raster {
    fn new(size: DVec2, cell: f64) -> Self {
        let cells = |length: f64| (length / cell).ceil() as usize + 1 + 2 * MARGIN_CELLS;
        let count = [cells(size.x), cells(size.y)];
        Self {
            count,
            cell,
            values: vec![0.0; count[0] * count[1]],
        }
    }

    /// Place in units of cells; the middle of cell (i, j) is at (i, j).
    fn place(&self, p: DVec2) -> DVec2 {
        p / self.cell + DVec2::splat(MARGIN_CELLS as f64)
    }

    /// Fills the cell of a point and all cells whose middle lies within the radius. Points outside of the rectangle are
    /// left out.
    fn draw_disc(&mut self, p: DVec2, radius: f64) {
        let [m, n] = self.count;
        let (at, reach) = (self.place(p), radius / self.cell);
        let end = DVec2::new(m as f64, n as f64) - (MARGIN_CELLS + 1) as f64;
        if at.cmplt(DVec2::splat(MARGIN_CELLS as f64 - 0.5)).any() || at.cmpgt(end + 0.5).any() {
            return;
        }
        let middle = at.round();
        let (i, j) = (middle.x as usize, middle.y as usize);
        let far = (reach.ceil() as usize).min(MARGIN_CELLS - 1);
        for y in j - far..=(j + far).min(n - 1) {
            for x in i - far..=(i + far).min(m - 1) {
                if (x, y) == (i, j) || at.distance(DVec2::new(x as f64, y as f64)) <= reach {
                    self.values[y * m + x] = 1.0;
                }
            }
        }
    }

    /// Fills the cells whose middle lies in the triangle.
    fn draw_triangle(&mut self, corners: [DVec2; 3]) {
        let [a, b, c] = corners.map(|p| self.place(p));
        let turn = (b - a).perp_dot(c - a).signum();
        let first = |x: f64, n: usize| {
            x.ceil()
                .clamp(MARGIN_CELLS as f64, (n - MARGIN_CELLS) as f64) as usize
        };
        let [m, n] = self.count;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        for j in first(low.y, n)..first(high.y.floor() + 1.0, n) {
            for i in first(low.x, m)..first(high.x.floor() + 1.0, m) {
                let p = DVec2::new(i as f64, j as f64);
                let left = |a: DVec2, b: DVec2| turn * (b - a).perp_dot(p - a) >= 0.0;
                if left(a, b) && left(b, c) && left(c, a) {
                    self.values[j * m + i] = 1.0;
                }
            }
        }
    }

    /// Dilates the binary picture by `reach` cells along both axes, or erodes it. O(cells).
    fn grow(&mut self, reach: usize, wider: bool) {
        let [m, n] = self.count;
        let ink = f64::from(u8::from(wider));
        // A cell takes the ink if an inked cell lies at most `reach` cells before or behind it. The way back writes
        // only behind the cells that are still to be read.
        for (lines, along, step, stride) in [(n, m, 1, m), (m, n, m, 1)] {
            let mut marked = vec![false; along];
            for line in 0..lines {
                let at = |i: usize| line * stride + i * step;
                let mut since = reach + 1;
                for (i, marked) in marked.iter_mut().enumerate() {
                    let inked = (self.values[at(i)] > 0.5) == wider;
                    since = if inked { 0 } else { since + 1 };
                    *marked = since <= reach;
                }
                since = reach + 1;
                for (i, marked) in marked.iter().enumerate().rev() {
                    let inked = (self.values[at(i)] > 0.5) == wider;
                    since = if inked { 0 } else { since + 1 };
                    if *marked || since <= reach {
                        self.values[at(i)] = ink;
                    }
                }
            }
        }
    }

    /// Replaces each value by the mean of it and its neighbours, along rows and then along columns.
    fn blur(&mut self) {
        let [m, n] = self.count;
        for (lines, along, step, stride) in [(n, m, 1, m), (m, n, m, 1)] {
            for line in 0..lines {
                let at = |i: usize| line * stride + i * step;
                let mut before = 0.0;
                for i in 0..along {
                    let here = self.values[at(i)];
                    let next = if i + 1 < along {
                        self.values[at(i + 1)]
                    } else {
                        0.0
                    };
                    self.values[at(i)] = (before + here + next) / 3.0;
                    before = here;
                }
            }
        }
    }

    /// Fills all cells that are not connected to the border of the raster.
    fn fill_holes(&mut self) {
        let [m, n] = self.count;
        let mut outside = vec![false; m * n];
        let mut stack = vec![0];
        while let Some(k) = stack.pop() {
            if outside[k] || self.values[k] > 0.5 {
                continue;
            }
            outside[k] = true;
            let (i, j) = (k % m, k / m);
            stack.extend((i > 0).then(|| k - 1));
            stack.extend((i + 1 < m).then(|| k + 1));
            stack.extend((j > 0).then(|| k - m));
            stack.extend((j + 1 < n).then(|| k + m));
        }
        for (value, outside) in self.values.iter_mut().zip(outside) {
            *value = f64::from(u8::from(!outside));
        }
    }

    /// All contours at `level`, with the larger values to their left.
    fn contours(&self, level: f64) -> Vec<Vec<DVec2>> {
        let place = |p: DVec2| (p - DVec2::splat(MARGIN_CELLS as f64)) * self.cell;
        let lines = contours(&self.values, self.count, level);
        let placed = lines
            .into_iter()
            .map(|line| line.into_iter().map(place).collect());
        placed.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disc_with_a_hole_and_a_hair() {
        let (radius, spacing) = (10.0, 0.2);
        let mut points: Vec<DVec2> = (0..101 * 101)
            .map(|k| DVec2::new(f64::from(k % 101), f64::from(k / 101)) * spacing)
            .filter(|p| p.distance(DVec2::splat(radius)) < radius)
            .filter(|p| p.distance(DVec2::new(7.0, 9.0)) > 1.5)
            .collect();
        points.extend((0..20).map(|k| DVec2::new(20.0 + 0.2 * f64::from(k), 10.0)));
        let outline = trace(
            &Picture {
                points: &points,
                cosines: &vec![1.0; points.len()],
                triangles: &[],
                spacing,
            },
            DVec2::new(24.0, 20.0),
        );
        for p in &outline {
            let off = p.distance(DVec2::splat(radius)) - radius;
            assert!(off.abs() < 1.5 * spacing, "{off}");
        }
        let disc = std::f64::consts::PI * radius * radius;
        assert!((area(&outline) / disc - 1.0).abs() < 0.03);
    }

    #[test]
    fn triangles_are_as_wide_as_they_are() {
        let corners = [DVec2::ZERO, DVec2::new(8.0, 0.0), DVec2::new(0.0, 6.0)];
        for triangle in [[0, 1, 2], [2, 1, 0]] {
            let picture = Picture {
                points: &corners,
                cosines: &[0.0; 3],
                triangles: &[triangle],
                spacing: 0.1,
            };
            let outline = trace(&picture, DVec2::new(8.0, 6.0));
            assert!((area(&outline) - 24.0).abs() < 0.3);
        }
        for spacing in [0.0, 0.1] {
            let nothing = Picture {
                points: &[],
                cosines: &[],
                triangles: &[],
                spacing,
            };
            assert!(trace(&nothing, DVec2::ONE).is_empty());
        }
    }
}

//! The outline of a scan that lies flat in a plane.
//!
//! The scan is drawn on a raster, gaps and holes are closed, thin bits are taken off, and the contour of the blurred
//! picture is traced. What is left is one closed polygon, smooth on the scale of the raster.

use glam::DVec2;
use nurbskin_geometry::numeric::contours::{area, contours};

/// Cells along the longer side of the raster at least and at most.
const CELLS: [f64; 2] = [24.0, 1000.0];
/// Cells per spacing.
const FINENESS: f64 = 3.0;
/// Gaps as wide as twice this many cells are closed ...
const CLOSING: usize = 6;
/// ... and bits as thin as twice this many are taken off.
const OPENING: usize = 4;
/// Empty cells around the picture, so that nothing reaches its border.
const MARGIN: usize = CLOSING + 6;
/// Each point stands for what is around it, half a spacing to every side; this part of it is drawn.
const REACH: f64 = 0.4;

/// What is drawn.
pub(super) struct Picture<'a> {
    /// Points in the plane; those outside the rectangle are left out.
    pub(super) points: &'a [DVec2],
    /// How much of a length across the rim is left in the plane at each point, so that steep rims are followed closely.
    pub(super) cosines: &'a [f64],
    /// Triangles between the points, where there are any; all their corners in or near the rectangle.
    pub(super) triangles: &'a [[usize; 3]],
    /// The usual distance of neighbours in space.
    pub(super) spacing: f64,
}

/// The outline, counter-clockwise, of a picture in the rectangle from the origin to `size`; empty if there is none.
/// Holes are ignored, and of several pieces the one with the largest area is taken. O(points + cells).
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
    let cell = long / (FINENESS * long / spacing).clamp(CELLS[0], CELLS[1]);
    let mut raster = Raster::new(size, cell);
    for (&p, cosine) in points.iter().zip(cosines) {
        raster.draw_disc(p, REACH * spacing * cosine.clamp(0.0, 1.0));
    }
    for t in triangles {
        raster.draw_triangle(t.map(|k| points[k]));
    }
    // 1. Closing, then no holes, then opening.
    raster.grow(CLOSING, true);
    raster.fill_holes();
    raster.grow(CLOSING, false);
    raster.grow(OPENING, false);
    raster.grow(OPENING, true);
    // 2. A smooth picture, and its contour.
    for _ in 0..3 {
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
        let cells = |length: f64| (length / cell).ceil() as usize + 1 + 2 * MARGIN;
        let count = [cells(size.x), cells(size.y)];
        Self {
            count,
            cell,
            values: vec![0.0; count[0] * count[1]],
        }
    }

    /// Place in units of cells; the middle of cell (i, j) is at (i, j).
    fn place(&self, p: DVec2) -> DVec2 {
        p / self.cell + DVec2::splat(MARGIN as f64)
    }

    /// Fills the cell of a point, and those whose middle is within the radius. What lies outside the rectangle is
    /// left out.
    fn draw_disc(&mut self, p: DVec2, radius: f64) {
        let [m, n] = self.count;
        let (at, reach) = (self.place(p), radius / self.cell);
        let end = DVec2::new(m as f64, n as f64) - (MARGIN + 1) as f64;
        if at.cmplt(DVec2::splat(MARGIN as f64 - 0.5)).any() || at.cmpgt(end + 0.5).any() {
            return;
        }
        let middle = at.round();
        let (i, j) = (middle.x as usize, middle.y as usize);
        let far = (reach.ceil() as usize).min(MARGIN - 1);
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
        let first = |x: f64, n: usize| x.ceil().clamp(MARGIN as f64, (n - MARGIN) as f64) as usize;
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

    /// Widens the picture, of ones and zeros, by so many cells along both axes, or narrows it. O(cells).
    fn grow(&mut self, reach: usize, wider: bool) {
        let [m, n] = self.count;
        let ink = f64::from(u8::from(wider));
        // A cell takes the ink that is at most `reach` cells before or behind it. What is drawn on the way back lies
        // behind the cells yet to be read.
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

    /// Each value replaced by the mean of it and its neighbours along a row, then along a column.
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

    /// Fills what cannot be reached from the border.
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
        let place = |p: DVec2| (p - DVec2::splat(MARGIN as f64)) * self.cell;
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

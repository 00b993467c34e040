//! Panels, surfaces with their lines, and bars.

use super::canvas::{Camera, Canvas, Colour, Vertex};
use super::text;
use nurbskin::{DVec2, DVec3, NurbsSurface};

pub(crate) const INK: Colour = [0.15, 0.15, 0.15];
/// Both sides of a surface that carries lines or points.
pub(crate) const PALE: [Colour; 2] = [[0.90, 0.92, 0.95], [0.93, 0.90, 0.85]];
/// Steps of a drawn surface, and of a curve.
const STEPS: usize = 240;
/// Part of the height of what is shown that stays free above it.
const ROOM: f64 = 0.12;

/// How points are looked at.
pub(crate) struct View {
    /// Pixels across and down.
    pub(crate) size: [usize; 2],
    /// What is up, and what is in front.
    pub(crate) frame: [DVec3; 2],
    /// Azimuth and elevation in degrees.
    pub(crate) angles: [f64; 2],
}

impl View {
    /// Of an object that stands.
    pub(crate) const fn upright(size: [usize; 2], angles: [f64; 2]) -> Self {
        Self {
            size,
            frame: [DVec3::Z, DVec3::NEG_Y],
            angles,
        }
    }

    /// Of the plane of x and y.
    pub(crate) const fn flat(size: [usize; 2]) -> Self {
        Self {
            size,
            frame: [DVec3::Y, DVec3::Z],
            angles: [0.0; 2],
        }
    }

    /// An empty picture that shows these points below a title.
    pub(crate) fn panel(&self, points: &[DVec3], title: &str) -> Canvas {
        let [up, _] = self.frame;
        let heights = || points.iter().map(|p| p.dot(up));
        let low = heights().fold(f64::INFINITY, f64::min);
        let high = heights().fold(f64::NEG_INFINITY, f64::max);
        // Room for the title.
        let above = |p: &DVec3| *p + up * (high + ROOM * (high - low) - p.dot(up));
        let shown: Vec<DVec3> = points
            .iter()
            .copied()
            .chain(points.iter().map(above))
            .collect();
        let [width, height] = self.size;
        let camera = Camera::around(
            &shown,
            self.frame,
            self.angles,
            width as f64 / height as f64,
        );
        let mut canvas = Canvas::new(width, height, camera);
        text::write(&mut canvas, [12, 8], title, INK);
        canvas
    }
}

/// The lines below a title, each in its colour.
pub(crate) fn legend(canvas: &mut Canvas, lines: &[(String, Colour)]) {
    for (k, (line, colour)) in lines.iter().enumerate() {
        let top = 32 + 20 * k;
        canvas.block([12, top + 2], [10, 10], *colour);
        text::write(canvas, [30, top], line, *colour);
    }
}

/// Where lines of constant value lie on a triangle: the ends of each, by the values at the corners.
pub(crate) fn crossings(corners: [DVec3; 3], values: [f64; 3], count: f64) -> Vec<[DVec3; 2]> {
    let scaled = values.map(|value| value * count);
    let low = scaled.iter().copied().fold(f64::INFINITY, f64::min);
    let high = scaled.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let first = low.ceil();
    let levels = std::iter::successors(Some(first), |level| Some(level + 1.0));
    let on = |level: f64| {
        let sides = [(0, 1), (1, 2), (2, 0)];
        let cut = sides.into_iter().filter_map(|(i, j)| {
            let (a, b) = (scaled[i], scaled[j]);
            let between = (a < level) != (b < level);
            between.then(|| corners[i].lerp(corners[j], (level - a) / (b - a)))
        });
        let ends: Vec<DVec3> = cut.collect();
        <[DVec3; 2]>::try_from(ends).ok()
    };
    levels
        .take_while(|&level| level <= high)
        .filter_map(on)
        .collect()
}

/// The surface, where `shown` holds in (u, v).
pub(crate) fn shade(canvas: &mut Canvas, surface: &NurbsSurface, shown: &dyn Fn(DVec2) -> bool) {
    let [(a, b), (c, d)] = surface.domain();
    let at = |k: usize| {
        let (s, t) = ((k % (STEPS + 1)) as f64, (k / (STEPS + 1)) as f64);
        DVec2::new(
            a + (b - a) * s / STEPS as f64,
            c + (d - c) * t / STEPS as f64,
        )
    };
    let vertex = |k: usize| {
        let p = at(k);
        let s = surface.derivatives(p.x, p.y);
        let normal = s.du.cross(s.dv).normalize_or(DVec3::Z);
        let vertex = Vertex {
            point: s.point,
            normal,
            sides: PALE,
        };
        (vertex, shown(p))
    };
    let vertices: Vec<(Vertex, bool)> = (0..(STEPS + 1) * (STEPS + 1)).map(vertex).collect();
    for (i, j) in (0..STEPS).flat_map(|j| (0..STEPS).map(move |i| (i, j))) {
        let k = j * (STEPS + 1) + i;
        let corners = [k, k + 1, k + STEPS + 2, k + STEPS + 1].map(|k| &vertices[k]);
        if corners.iter().all(|corner| corner.1) {
            canvas.triangle([&corners[0].0, &corners[1].0, &corners[2].0]);
            canvas.triangle([&corners[0].0, &corners[2].0, &corners[3].0]);
        }
    }
}

/// A curve over 0 to 1, as far as it has points.
pub(crate) fn curve(
    canvas: &mut Canvas,
    point: &dyn Fn(f64) -> Option<DVec3>,
    [width, lift]: [f64; 2],
    colour: Colour,
) {
    let at = |k: usize| point(k as f64 / STEPS as f64);
    for k in 0..STEPS {
        if let (Some(a), Some(b)) = (at(k), at(k + 1)) {
            canvas.line(a, b, width, lift, colour);
        }
    }
}

/// Lines of the surface at these parameters, where `shown` holds.
pub(crate) fn wires(
    canvas: &mut Canvas,
    surface: &NurbsSurface,
    at: &[Vec<f64>; 2],
    shown: &dyn Fn(DVec2) -> bool,
) {
    let ends = surface.domain();
    for (axis, values) in at.iter().enumerate() {
        let (from, to) = ends[1 - axis];
        for &value in values {
            let point = |t: f64| {
                let mut p = DVec2::splat(from + (to - from) * t);
                p[axis] = value;
                shown(p).then(|| surface.point(p.x, p.y))
            };
            curve(canvas, &point, [1.4, 0.006], INK);
        }
    }
}

/// A histogram in 44 equal bins.
pub(crate) struct Bars {
    /// Pixels above it.
    pub(crate) top: usize,
    /// The values at both ends.
    pub(crate) range: [f64; 2],
    /// What is written below the axis, evenly spread from end to end.
    pub(crate) labels: [&'static str; 5],
}

impl Bars {
    /// Draws the bars, each in the colour of its value.
    pub(crate) fn draw(
        &self,
        canvas: &mut Canvas,
        values: impl Iterator<Item = f64>,
        colour: &dyn Fn(f64) -> Colour,
    ) {
        const BINS: usize = 44;
        const LEFT: usize = 40;
        const WIDE: usize = 440;
        const HIGH: usize = 150;
        let [low, high] = self.range;
        let mut sorted: Vec<f64> = values.collect();
        sorted.sort_by(f64::total_cmp);
        let edge = |k: usize| low + (high - low) * k as f64 / BINS as f64;
        let below = |k: usize| sorted.partition_point(|&value| value < edge(k));
        let counts: Vec<usize> = (0..BINS).map(|k| below(k + 1) - below(k)).collect();
        let most = counts.iter().copied().max().unwrap_or(0).max(1);
        for (k, count) in counts.iter().enumerate() {
            let tall = count * HIGH / most;
            let from = [LEFT + k * (WIDE / BINS), self.top + HIGH - tall];
            let shade = colour(f64::midpoint(edge(k), edge(k + 1)));
            canvas.block(from, [WIDE / BINS - 1, tall], shade);
        }
        let axis = self.top + HIGH;
        canvas.block([LEFT, axis], [WIDE, 2], INK);
        for (k, label) in self.labels.iter().enumerate() {
            let x = LEFT + k * WIDE / (self.labels.len() - 1);
            canvas.block([x, axis], [2, 8], INK);
            let half = label.len() * text::ADVANCE / 2;
            text::write(canvas, [x.saturating_sub(half), axis + 14], label, INK);
        }
    }
}

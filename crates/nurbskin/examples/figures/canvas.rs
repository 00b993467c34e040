//! A small software renderer: shaded triangles, lines and markers with a depth buffer, smoothed by oversampling.

#![expect(
    clippy::cast_possible_truncation,
    reason = "pixels and colours are clamped to their ranges first"
)]

use glam::{DMat3, DVec2, DVec3};
use std::path::Path;

/// Samples per pixel along each axis.
const OVERSAMPLING: usize = 3;

/// RGB, 0 to 1.
pub(crate) type Colour = [f64; 3];

/// A corner of a shaded triangle.
pub(crate) struct Vertex {
    pub(crate) point: DVec3,
    pub(crate) normal: DVec3,
    /// The colour seen from the side of the normal, and from the other.
    pub(crate) sides: [Colour; 2],
}

/// Orthographic view: the rows of the matrix are the picture's right, up and towards the eye.
pub(crate) struct Camera {
    axes: DMat3,
    centre: DVec3,
    scale: f64,
}

impl Camera {
    /// Looks at the points from `view` = [azimuth, elevation] in degrees: around `up`, starting at `front`, and above
    /// the horizon. The points fill the picture's smaller side.
    pub(crate) fn around(
        points: &[DVec3],
        [up, front]: [DVec3; 2],
        view: [f64; 2],
        aspect: f64,
    ) -> Self {
        let [(sin_a, cos_a), (sin_e, cos_e)] = view.map(|angle| angle.to_radians().sin_cos());
        let side = up.cross(front);
        let eye = cos_e * (cos_a * front + sin_a * side) + sin_e * up;
        let right = cos_a * side - sin_a * front;
        let up = eye.cross(right);
        let axes = DMat3::from_cols(right, up, eye).transpose();
        let projected: Vec<DVec3> = points.iter().map(|&p| axes * p).collect();
        let lo = projected.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let hi = projected
            .iter()
            .copied()
            .fold(DVec3::NEG_INFINITY, DVec3::max);
        let extent = ((hi.x - lo.x) / aspect)
            .max(hi.y - lo.y)
            .max(f64::MIN_POSITIVE);
        Self {
            axes,
            centre: axes.transpose() * ((lo + hi) / 2.0),
            scale: 0.9 / extent,
        }
    }
}

/// A picture being drawn.
pub(crate) struct Canvas {
    width: usize,
    height: usize,
    colour: Vec<[f32; 3]>,
    depth: Vec<f64>,
    camera: Camera,
}

impl Canvas {
    /// A white picture of `width` x `height` pixels.
    pub(crate) fn new(width: usize, height: usize, camera: Camera) -> Self {
        let (width, height) = (width * OVERSAMPLING, height * OVERSAMPLING);
        Self {
            width,
            height,
            colour: vec![[1.0; 3]; width * height],
            depth: vec![f64::NEG_INFINITY; width * height],
            camera,
        }
    }

    /// Samples across, down, and depth towards the eye in the unit of a picture's height.
    fn project(&self, p: DVec3) -> DVec3 {
        let q = self.camera.axes * (p - self.camera.centre) * self.camera.scale;
        let h = self.height as f64;
        DVec3::new(self.width as f64 / 2.0 + q.x * h, h / 2.0 - q.y * h, q.z)
    }

    fn put(&mut self, x: usize, y: usize, z: f64, colour: Colour) {
        let k = y * self.width + x;
        if z > self.depth[k] {
            self.depth[k] = z;
            self.colour[k] = colour.map(|c| c as f32);
        }
    }

    /// Pixels whose centres lie in the box of these corners.
    fn pixels(&self, lo: DVec2, hi: DVec2) -> impl Iterator<Item = (usize, usize)> + use<> {
        let clip = |x: f64, size: usize| x.clamp(0.0, size as f64) as usize;
        let (x0, x1) = (
            clip(lo.x.floor(), self.width),
            clip(hi.x.ceil() + 1.0, self.width),
        );
        let (y0, y1) = (
            clip(lo.y.floor(), self.height),
            clip(hi.y.ceil() + 1.0, self.height),
        );
        (y0..y1).flat_map(move |y| (x0..x1).map(move |x| (x, y)))
    }

    /// A triangle, lit from the upper left of the eye on both sides.
    pub(crate) fn triangle(&mut self, corners: [&Vertex; 3]) {
        let [a, b, c] = corners.map(|corner| self.project(corner.point));
        let (ab, ac) = ((b - a).truncate(), (c - a).truncate());
        let area = ab.perp_dot(ac);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let (lo, hi) = (a.min(b).min(c).truncate(), a.max(b).max(c).truncate());
        let light = DVec3::new(-0.4, 0.55, 0.73).normalize();
        for (x, y) in self.pixels(lo, hi) {
            let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5) - a.truncate();
            let (s, t) = (p.perp_dot(ac) / area, ab.perp_dot(p) / area);
            if s < -1e-9 || t < -1e-9 || s + t > 1.0 + 1e-9 {
                continue;
            }
            let mix = |value: &dyn Fn(&Vertex) -> DVec3| {
                let [a, b, c] = corners.map(value);
                a * (1.0 - s - t) + b * s + c * t
            };
            let n = self.camera.axes * mix(&|corner| corner.normal);
            let side = usize::from(n.z < 0.0);
            let colour = mix(&|corner| DVec3::from_array(corner.sides[side]));
            let n = if side == 1 { -n } else { n }.normalize_or(DVec3::Z);
            // Light that reaches around the edge of the lit half keeps the shape visible there.
            let diffuse = (0.6 + 0.4 * n.dot(light)).max(0.0).powf(1.4);
            let shine = (2.0 * n.dot(light) * n.z - light.z).max(0.0).powi(40);
            let shaded = colour * (0.28 + 0.72 * diffuse) + 0.15 * shine;
            let z = a.z + s * (b.z - a.z) + t * (c.z - a.z);
            self.put(x, y, z, shaded.min(DVec3::ONE).to_array());
        }
    }

    /// A line `width` pixels wide, drawn `lift` picture heights nearer to the eye so that it wins against the surface
    /// that it lies on.
    pub(crate) fn line(&mut self, from: DVec3, to: DVec3, width: f64, lift: f64, colour: Colour) {
        let (a, b) = (self.project(from), self.project(to));
        let radius = width * OVERSAMPLING as f64 / 2.0;
        let d = (b - a).truncate();
        let margin = DVec2::splat(radius);
        for (x, y) in self.pixels(a.min(b).truncate() - margin, a.max(b).truncate() + margin) {
            let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5) - a.truncate();
            let t = (p.dot(d) / d.length_squared().max(1e-12)).clamp(0.0, 1.0);
            if (p - d * t).length() <= radius {
                self.put(x, y, a.z + t * (b.z - a.z) + lift, colour);
            }
        }
    }

    /// A disc of this radius in pixels.
    pub(crate) fn dot(&mut self, at: DVec3, radius: f64, lift: f64, colour: Colour) {
        self.line(at, at, 2.0 * radius, lift, colour);
    }

    /// A `+` of this arm length in pixels.
    pub(crate) fn plus(&mut self, at: DVec3, arm: f64, lift: f64, colour: Colour) {
        let axes = self.camera.axes.transpose();
        let step = arm * OVERSAMPLING as f64 / (self.height as f64 * self.camera.scale);
        for axis in [axes.x_axis, axes.y_axis] {
            self.line(at - axis * step, at + axis * step, 1.4, lift, colour);
        }
    }

    /// A rectangle of finished pixels, in front of everything.
    pub(crate) fn block(&mut self, from: [usize; 2], size: [usize; 2], colour: Colour) {
        let [xs, ys] = [0, 1].map(|k| {
            let limit = if k == 0 { self.width } else { self.height };
            let end = (from[k] + size[k]) * OVERSAMPLING;
            (from[k] * OVERSAMPLING).min(limit)..end.min(limit)
        });
        for y in ys {
            xs.clone().for_each(|x| self.put(x, y, f64::MAX, colour));
        }
    }

    /// Colour of a pixel of the finished picture, 0 to 255.
    fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        let samples = OVERSAMPLING * OVERSAMPLING;
        let mut sum = [0.0; 3];
        for k in 0..samples {
            let (i, j) = (k % OVERSAMPLING, k / OVERSAMPLING);
            let sample = self.colour[(y * OVERSAMPLING + j) * self.width + x * OVERSAMPLING + i];
            sum = [0, 1, 2].map(|c| sum[c] + sample[c]);
        }
        sum.map(|s| (s / samples as f32 * 255.0).round() as u8)
    }
}

/// Writes pictures of equal height side by side as one PNG.
pub(crate) fn save(pictures: &[Canvas], path: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let sizes: Vec<(usize, usize)> = pictures
        .iter()
        .map(|c| (c.width / OVERSAMPLING, c.height / OVERSAMPLING))
        .collect();
    let (width, height) = (
        sizes.iter().map(|s| s.0).sum::<usize>(),
        sizes.iter().map(|s| s.1).min().unwrap_or(0),
    );
    let mut bytes = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        for (picture, &(w, _)) in pictures.iter().zip(&sizes) {
            bytes.extend((0..w).flat_map(|x| picture.pixel(x, y)));
        }
    }
    let file = std::io::BufWriter::new(std::fs::File::create(path)?);
    let mut encoder = png::Encoder::new(file, u32::try_from(width)?, u32::try_from(height)?);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    encoder.write_header()?.write_image_data(&bytes)?;
    Ok(())
}

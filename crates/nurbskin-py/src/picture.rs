//! Meshes for display, and their picture without a graphics card: what a notebook shows at once.

use crate::arrays;
use crate::errors::Raised;
use numpy::{IntoPyArray, PyArrayMethods};
use nurbskin::report::DisplayMesh;
use nurbskin::{DVec3, Error};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Largest width and height of a picture in pixels: 16 megapixels.
const MOST_PIXELS: usize = 4096;
/// Share of the picture that the shape fills.
const FILLED: f64 = 0.94;
/// Light that reaches a face edge on, as a share of that on a face that looks at the viewer.
const AMBIENT: f64 = 0.35;

/// A display mesh as a dictionary of arrays; `origin` is added to the points.
pub(crate) fn mesh_of(
    py: Python<'_>,
    mesh: DisplayMesh,
    origin: DVec3,
) -> PyResult<Bound<'_, PyDict>> {
    let points = mesh.points.into_iter().map(|p| p + origin).collect();
    let all = PyDict::new(py);
    all.set_item("points", arrays::of_points(py, points)?)?;
    all.set_item("triangles", arrays::of_triangles(py, mesh.triangles)?)?;
    all.set_item("normals", arrays::of_points(py, mesh.normals)?)?;
    all.set_item("parameters", arrays::of_parameters(py, &mesh.parameters)?)?;
    all.set_item("face", mesh.faces.into_pyarray(py))?;
    all.set_item("mean_curvature", mesh.mean_curvature.into_pyarray(py))?;
    all.set_item(
        "gaussian_curvature",
        mesh.gaussian_curvature.into_pyarray(py),
    )?;
    if !mesh.deviation.is_empty() {
        all.set_item("deviation", mesh.deviation.into_pyarray(py))?;
    }
    Ok(all)
}

/// What a picture shows at each pixel: the value there, and the light.
struct Picture {
    width: usize,
    height: usize,
    depth: Vec<f64>,
    values: Vec<f64>,
    light: Vec<f64>,
}

impl Picture {
    fn new([width, height]: [usize; 2]) -> Self {
        let count = width * height;
        Self {
            width,
            height,
            depth: vec![f64::NEG_INFINITY; count],
            values: vec![f64::NAN; count],
            light: vec![0.0; count],
        }
    }

    /// Draws a triangle given by pixel coordinates and depth (greater is nearer), with a value and the light per corner.
    fn draw(&mut self, corners: [DVec3; 3], values: [f64; 3], light: [f64; 3]) {
        let [a, b, c] = corners.map(DVec3::truncate);
        let area = (b - a).perp_dot(c - a);
        if !area.is_finite() || area.abs() < f64::MIN_POSITIVE {
            return;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let columns = range(low.x, high.x, self.width);
        for y in range(low.y, high.y, self.height) {
            for x in columns.clone() {
                let at = pixel(x, y);
                let weights = [
                    (c - b).perp_dot(at - b) / area,
                    (a - c).perp_dot(at - c) / area,
                    (b - a).perp_dot(at - a) / area,
                ];
                if weights.iter().any(|w| *w < 0.0) {
                    continue;
                }
                let mix =
                    |of: [f64; 3]| -> f64 { weights.iter().zip(of).map(|(w, x)| w * x).sum() };
                let depth = mix(corners.map(|p| p.z));
                let k = y * self.width + x;
                if depth > self.depth[k] {
                    self.depth[k] = depth;
                    self.values[k] = mix(values);
                    self.light[k] = mix(light);
                }
            }
        }
    }
}

/// The middle of a pixel.
fn pixel(x: usize, y: usize) -> nurbskin::DVec2 {
    nurbskin::DVec2::new(x as f64 + 0.5, y as f64 + 0.5)
}

/// The pixels whose middles lie between two coordinates.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped first"
)]
fn range(low: f64, high: f64, count: usize) -> std::ops::Range<usize> {
    let clamped = |x: f64| x.clamp(0.0, count as f64) as usize;
    clamped((low - 0.5).ceil())..clamped((high + 0.5).floor())
}

/// The axes of the picture in space: right, up, and towards the viewer. Angles are in degrees; z is up.
fn axes(elevation: f64, azimuth: f64) -> [DVec3; 3] {
    let (e, a) = (elevation.to_radians(), azimuth.to_radians());
    let towards = DVec3::new(e.cos() * a.cos(), e.cos() * a.sin(), e.sin());
    let right = DVec3::new(-a.sin(), a.cos(), 0.0);
    [right, towards.cross(right), towards]
}

/// Values and light at the pixels of a picture of a mesh from afar, each (height, width): values are NaN, and light is 0,
/// where there is nothing to see.
#[pyfunction]
#[pyo3(signature = (points, triangles, normals, values, width, height, elevation, azimuth))]
pub(crate) fn render<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    triangles: &Bound<'py, PyAny>,
    normals: &Bound<'py, PyAny>,
    values: &Bound<'py, PyAny>,
    width: usize,
    height: usize,
    elevation: f64,
    azimuth: f64,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let size = [width, height];
    if size.iter().any(|n| !(1..=MOST_PIXELS).contains(n)) {
        let what = format!("size: width and height are from 1 to {MOST_PIXELS} pixels");
        return Err(Error::invalid(what)).or_raise(py);
    }
    let points = arrays::points(points, "points")?;
    let normals = arrays::points(normals, "normals")?;
    let triangles = arrays::triangles(triangles)?;
    let values = arrays::numbers(values, "values")?;
    if normals.len() != points.len() || values.len() != points.len() {
        let what = "points, normals and values: one of each for every vertex";
        return Err(Error::invalid(what)).or_raise(py);
    }
    let picture = py.detach(|| {
        let axes = axes(elevation, azimuth);
        let turned = |p: DVec3| DVec3::from(axes.map(|axis| axis.dot(p)));
        let mut places: Vec<DVec3> = points.iter().map(|&p| turned(p)).collect();
        let corners = places.iter().filter(|p| p.is_finite());
        let [low, high] = corners
            .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], &p| {
                [low.min(p), high.max(p)]
            });
        let (middle, extent) = ((low + high) / 2.0, high - low);
        let [w, h] = size.map(|n| n as f64);
        let scale = FILLED
            * (w / extent.x.max(f64::MIN_POSITIVE))
                .min(h / extent.y.max(f64::MIN_POSITIVE))
                .min(f64::MAX.sqrt());
        for p in &mut places {
            let q = (*p - middle) * scale;
            // Rows run downwards.
            *p = DVec3::new(w / 2.0 + q.x, h / 2.0 - q.y, q.z);
        }
        let towards = axes[2];
        // Both sides of an open surface are lit.
        let light = |n: DVec3| AMBIENT + (1.0 - AMBIENT) * n.dot(towards).abs();
        let mut picture = Picture::new(size);
        for triangle in triangles {
            let corners = triangle.map(|k| k as usize);
            if corners.iter().all(|&k| k < places.len()) {
                picture.draw(
                    corners.map(|k| places[k]),
                    corners.map(|k| values[k]),
                    corners.map(|k| light(normals[k])),
                );
            }
        }
        picture
    });
    let shaped = |list: Vec<f64>| -> PyResult<Bound<'py, PyAny>> {
        Ok(list.into_pyarray(py).reshape([height, width])?.into_any())
    };
    Ok((shaped(picture.values)?, shaped(picture.light)?))
}

//! The triangles of the page for other front ends: in double precision, with the values of the page at each vertex.

use super::Measured;
use super::colours::deviation_of_vertices;
use super::surface::Surface;
use glam::{DVec2, DVec3};
use nurbskin_cad::{Model, extent};
use nurbskin_geometry::Result;
use nurbskin_geometry::progress::Progress;

/// Triangles of a model with values per vertex. Each vertex lies on one face; faces repeat the vertices of their common
/// edges. Lengths are in the unit of the model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DisplayMesh {
    /// Vertices.
    pub points: Vec<DVec3>,
    /// Outward unit normal per vertex; zero where there is none.
    pub normals: Vec<DVec3>,
    /// (u, v) per vertex, on its face.
    pub parameters: Vec<DVec2>,
    /// Index of the face of each vertex.
    pub faces: Vec<u32>,
    /// Vertices of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Signed deviation of the scan near each vertex, NaN where the scan has no points; empty without a scan.
    pub deviation: Vec<f64>,
    /// Mean curvature per vertex, positive where the shape is convex seen from outside; NaN where undefined.
    pub mean_curvature: Vec<f64>,
    /// Gaussian curvature per vertex; NaN where undefined.
    pub gaussian_curvature: Vec<f64>,
}

/// The triangles of `model` as the page shows them, with the deviation of the points of `scan`, which must have one.
///
/// O(n log n) for n points and vertices. Deterministic, whatever the number of threads.
///
/// ```
/// use nurbskin::{DVec3, cad::Model, nurbs::conic, progress::Silent, report::display_mesh};
/// let mut model = Model::new("ball");
/// model.add_whole_surface(&conic::sphere(DVec3::ZERO, 2.0)?, 1e-9)?;
/// let mesh = display_mesh(&model, None, &Silent)?;
/// let middle = mesh.points.iter().position(|p| p.z.abs() < 0.1).unwrap();
/// assert!((mesh.mean_curvature[middle] - 0.5).abs() < 1e-9);
/// assert!((mesh.normals[middle] - mesh.points[middle] / 2.0).length() < 1e-9);
/// assert!(mesh.deviation.is_empty());
/// # Ok::<(), nurbskin::Error>(())
/// ```
///
/// # Errors
/// Errors of the tessellation; [`Error::Cancelled`](nurbskin_geometry::Error::Cancelled).
pub fn display_mesh(
    model: &Model,
    scan: Option<Measured<'_>>,
    progress: &dyn Progress,
) -> Result<DisplayMesh> {
    let diagonal = extent(model)?.diagonal();
    let surface = Surface::new(model, diagonal, progress)?;
    progress.check()?;
    let (mean_curvature, gaussian_curvature) = surface
        .curvatures(model, diagonal)
        .into_iter()
        .map(|[mean, gaussian]| (mean, gaussian))
        .unzip();
    progress.check()?;
    let measured = scan.map(|scan| scan.with_spacing(diagonal));
    let deviation = measured.as_ref().and_then(|scan| {
        let deviation = scan.deviation?;
        Some(deviation_of_vertices(&surface, model, scan, deviation))
    });
    progress.check()?;
    Ok(DisplayMesh {
        points: surface.points,
        normals: surface.normals,
        parameters: surface.parameters,
        faces: surface.faces,
        triangles: surface.triangles,
        deviation: deviation.unwrap_or_default(),
        mean_curvature,
        gaussian_curvature,
    })
}

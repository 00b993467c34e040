//! Triangles of a model for display, with normals and curvatures at their vertices.
//!
//! The tessellation is finer than the chordal tolerance requires, so that the colours of the vertices resolve the
//! deviation. Near singular points normals and curvatures are evaluated slightly inside the domain.

use glam::{DVec2, DVec3};
use nurbskin_cad::{Fineness, Model, tessellate_finely};
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::nurbs::shape::Curvature;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, Result};

/// Chordal tolerance of the triangles, as a share of the diagonal.
const CHORD: f64 = 1.0 / 2000.0;
/// Distance of their vertices, as a share of the diagonal.
const STEP: f64 = 1.0 / 150.0;
/// Largest number of triangles; both shares are enlarged to stay below it.
const MOST_TRIANGLES: usize = 300_000;
/// Largest number of enlargements, and their factor.
const ATTEMPTS: usize = 24;
const COARSER: f64 = 1.4;
/// Step into the domain, as a share of it, for normals and curvatures at singular points.
const INWARDS: f64 = 1e-4;

/// Least radius of curvature, as a share of the diagonal; a smaller one is an artefact of the parameterization.
const SHARPEST: f64 = 1e-6;

/// Triangles whose vertices lie on one face each.
#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    pub(super) points: Vec<DVec3>,
    /// Outward unit normals.
    pub(super) normals: Vec<DVec3>,
    /// (u, v).
    pub(super) parameters: Vec<DVec2>,
    /// Index of the face of each vertex.
    pub(super) faces: Vec<u32>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Largest distance of a triangle from its face.
    pub(super) bound: f64,
    /// Faces without triangles, with the reason.
    pub(super) left_out: Vec<(usize, String)>,
}

impl Surface {
    /// Tessellates all faces of a model of this size.
    ///
    /// # Errors
    /// Errors of [`tessellate_finely`]; [`Error::Cancelled`].
    pub(super) fn new(model: &Model, diagonal: f64, progress: &dyn Progress) -> Result<Self> {
        let mut fineness = Fineness {
            tolerance: CHORD * diagonal,
            step: STEP * diagonal,
        };
        let mut attempt = 0;
        let mesh = loop {
            progress.check()?;
            match tessellate_finely(model, fineness, MOST_TRIANGLES) {
                Err(Error::NoSolution(_)) if attempt < ATTEMPTS => {
                    fineness.tolerance *= COARSER;
                    fineness.step *= COARSER;
                    attempt += 1;
                }
                done => break done?,
            }
        };
        let count = mesh.normals.len();
        let mut this = Self {
            points: vec![DVec3::ZERO; count],
            normals: mesh.normals,
            parameters: mesh.parameters,
            faces: vec![0; count],
            triangles: mesh.corners,
            bound: mesh.bound,
            left_out: mesh.left_out,
        };
        for ((corners, points), &face) in
            this.triangles.iter().zip(&mesh.triangles).zip(&mesh.faces)
        {
            for (&corner, &point) in corners.iter().zip(points) {
                this.points[corner as usize] = mesh.points[point as usize];
                this.faces[corner as usize] = face;
            }
        }
        this.complete_normals();
        Ok(this)
    }

    /// Where the surface has no normal, the normal of the adjacent triangles is used.
    fn complete_normals(&mut self) {
        let open: Vec<bool> = self.normals.iter().map(|n| *n == DVec3::ZERO).collect();
        if !open.contains(&true) {
            return;
        }
        let around = normals_of(&self.points, &self.triangles);
        for ((normal, open), around) in self.normals.iter_mut().zip(open).zip(around) {
            if open {
                *normal = around;
            }
        }
    }

    /// Mean and Gaussian curvature at every vertex, the mean curvature positive where the shape is convex seen from
    /// outside; NaN where undefined, as at singular points.
    pub(super) fn curvatures(&self, model: &Model, diagonal: f64) -> Vec<[f64; 2]> {
        each(self.points.len(), |k| {
            let Some(face) = model.faces().get(self.faces[k] as usize) else {
                return [f64::NAN; 2];
            };
            let (surface, place) = (&face.surface, self.parameters[k]);
            let found = surface.curvature(place.x, place.y).or_else(|| {
                let [(a, b), (c, d)] = surface.domain();
                let middle = DVec2::new(f64::midpoint(a, b), f64::midpoint(c, d));
                let inside = place.lerp(middle, INWARDS);
                surface.curvature(inside.x, inside.y)
            });
            // In the library, curvature towards S_u x S_v is positive.
            let side = if face.reversed { 1.0 } else { -1.0 };
            let bend = |c: &Curvature| {
                c.principal
                    .iter()
                    .fold(0.0_f64, |most, k| most.max(k.abs()))
            };
            let found = found.filter(|c| bend(c) * SHARPEST * diagonal <= 1.0);
            found.map_or([f64::NAN; 2], |c| [side * c.mean, c.gaussian])
        })
    }
}

/// Unit normals at the vertices of triangles: the area-weighted mean over the adjacent triangles; zero without any.
pub(super) fn normals_of(points: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; points.len()];
    for triangle in triangles {
        let corners = triangle.map(|k| points.get(k as usize).copied());
        if let [Some(a), Some(b), Some(c)] = corners {
            let area = (b - a).cross(c - a);
            for &k in triangle {
                sums[k as usize] += area;
            }
        }
    }
    sums.into_iter().map(DVec3::normalize_or_zero).collect()
}

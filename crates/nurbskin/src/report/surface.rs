//! Triangles of a model for the eye, and how it bends at their vertices.

use glam::{DVec2, DVec3};
use nurbskin_cad::{Fineness, Model, tessellate_finely};
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::nurbs::shape::Curvature;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, Result};

/// Triangles miss the faces by this share of the diagonal, ...
const CHORD: f64 = 1.0 / 2000.0;
/// ... and their vertices are about this share of it apart, ...
const STEP: f64 = 1.0 / 150.0;
/// ... both larger where there would be more triangles than this.
const MOST_TRIANGLES: usize = 300_000;
/// How often they are made larger, and by how much.
const ATTEMPTS: usize = 24;
const COARSER: f64 = 1.4;
/// Where a normal or a curvature does not exist, that of a place by this share of the domain further inside is taken.
const INWARDS: f64 = 1e-4;

/// Where the surface bends more sharply than a ball of this share of the diagonal, its parameters are at fault.
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
    /// No triangle is further than this from its face.
    pub(super) bound: f64,
    /// Faces that have no triangles, and why.
    pub(super) left_out: Vec<(usize, String)>,
}

impl Surface {
    /// Triangles of all faces of a model of this size.
    ///
    /// # Errors
    /// Those of [`tessellate_finely`]; [`Error::Cancelled`].
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

    /// Where the surface has no normal the triangles around have one.
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

    /// Mean and Gaussian curvature at every vertex, the first positive where the shape is convex seen from outside; NaN
    /// where there is none, as where parameters run together.
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
            // The library counts what bends towards S_u x S_v as positive.
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

/// Unit normals at the points of triangles: those of the triangles around, weighted by area; zero without any.
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

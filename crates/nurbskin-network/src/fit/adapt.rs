//! Layouts whose faces are as small as the shape asks for.
//!
//! ```text
//! layout ─▶ relax ─▶ do all faces carry the shape? ── no: smaller faces there ─▶ layout …
//!                      │                              (first layout: one round of knots on a copy shows whether many faces fold)
//!                      └─ yes ─▶ knots, finish
//! ```
//!
//! A layout of few, large faces takes the fewest control points as long as its faces carry the shape: a detail on a large face
//! drives knots right across it. Source: ours.

use super::state::Fit;
use super::strategy::{first_round, relaxed, run};
use super::{FitOptions, Target};
use crate::layout::Layout;
use nurbskin_geometry::math;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::mesh::Manifold;

/// Distance, in tolerances, at which a face carries the shape before knots are added.
/// Derived: with halved spans a bicubic fit comes sixteen times nearer; less than that where the shape is not smooth.
const COARSE: f64 = 4.0;
/// The same in standard deviations of the noise. Derived: the quantile of the distances that noise alone explains.
const NOISE: f64 = 2.0;
/// Share of the triangles on faces that do not carry the shape, up to which a layout is good enough.
/// Trial: 0.02 on six scans; with 0.1 (and 10 steps of Lloyd's) aorta has 139 faces for 61.
const UNFIT: f64 = 0.02;
/// Most layouts of a fit. Count.
/// Guard: faces are halved three times before.
const MOST_LAYOUTS: usize = 4;
/// Factor of the size of faces that are asked to shrink. Dimensionless.
/// Trial: not varied.
const AGAIN: f64 = 0.7;

/// Makes layouts of the mesh of a target, from the sizes of faces at its triangles.
pub(super) type Divide<'d> = dyn FnMut(&[f64]) -> Result<Layout> + 'd;

/// The sizes of the faces of a network at the triangles of a mesh, relative to those of the first layout.
#[derive(Clone, Debug, PartialEq)]
pub struct FaceSizes {
    /// By triangle.
    sizes: Vec<f64>,
    /// By vertex, the face of the last layout.
    faces: Vec<u32>,
}

impl FaceSizes {
    /// Of a first layout.
    #[must_use]
    pub fn new(mesh: &Manifold) -> Self {
        Self {
            sizes: vec![1.0; mesh.triangles.len()],
            faces: Vec::new(),
        }
    }

    /// Asks for smaller faces in place of those of the last fit that are marked. Faces beyond the list stay.
    pub fn shrink(&mut self, mesh: &Manifold, bad: &[bool]) {
        let factors: Vec<f64> = bad.iter().map(|&b| if b { AGAIN } else { 1.0 }).collect();
        shrink(&mut self.sizes, mesh, &self.faces, &factors);
    }
}

/// The fit over layouts that begin with these sizes, which become those of the layout taken.
pub(super) fn adapted<'a>(
    target: &Target<'a>,
    divide: &mut Divide,
    sizes: &mut FaceSizes,
    options: &FitOptions,
    progress: &'a dyn Progress,
) -> Result<Fit<'a>> {
    if sizes.sizes.len() != target.mesh.triangles.len() {
        return Err(Error::invalid(
            "the sizes of faces are those of another mesh",
        ));
    }
    let laid = laid_out(target, divide, &sizes.sizes, options, progress)?;
    *sizes = laid.sizes;
    let mut fit = laid.fit;
    run(&mut fit, target, options)?;
    Ok(fit)
}

/// A relaxed network and the sizes of its faces.
struct LaidOut<'a> {
    fit: Fit<'a>,
    sizes: FaceSizes,
}

/// The relaxed network that carries most of the shape, over layouts that begin with these sizes. Before the second layout, one round of
/// refinement over the first one shows whether too many faces fold.
fn laid_out<'a>(
    target: &Target<'a>,
    divide: &mut Divide,
    sizes: &[f64],
    options: &FitOptions,
    progress: &'a dyn Progress,
) -> Result<LaidOut<'a>> {
    let tolerance = options.tolerance;
    let limit = math::hypot(COARSE * tolerance, NOISE * target.noise);
    let mut sizes = sizes.to_vec();
    let mut best: Option<(f64, LaidOut)> = None;
    for count in 1..=MOST_LAYOUTS {
        let layout = divide(&sizes)?;
        let fit = match relaxed(target, &layout, tolerance, progress) {
            Err(Error::NoSolution(_)) if best.is_some() => break,
            other => other?,
        };
        let factors = fit.smaller_faces(limit);
        let used = sizes.clone();
        let faces: Vec<u32> = layout.start.iter().map(|start| start.face).collect();
        let unfit = shrink(&mut sizes, target.mesh, &faces, &factors);
        if count == 1 && unfit > UNFIT && options.most_folding < 1.0 {
            first_round(fit.clone(), target, options)?;
        }
        if best.as_ref().is_none_or(|b| unfit < b.0) {
            let sizes = FaceSizes { sizes: used, faces };
            best = Some((unfit, LaidOut { fit, sizes }));
        }
        if unfit <= UNFIT {
            break;
        }
    }
    best.map(|b| b.1)
        .ok_or_else(|| Error::invalid("a network needs a layout"))
}

/// Shrinks the sizes at the triangles by the factors of the faces of their vertices; returns the share of those that shrink.
fn shrink(sizes: &mut [f64], mesh: &Manifold, faces: &[u32], factors: &[f64]) -> f64 {
    let factor = |v: &u32| {
        let face = faces.get(*v as usize);
        face.and_then(|f| factors.get(*f as usize))
            .map_or(1.0, |f| *f)
    };
    let mut shrunk = 0;
    for (size, triangle) in sizes.iter_mut().zip(&mesh.triangles) {
        let least = triangle.iter().map(factor).fold(1.0, f64::min);
        shrunk += usize::from(least < 1.0);
        *size *= least;
    }
    shrunk as f64 / sizes.len().max(1) as f64
}

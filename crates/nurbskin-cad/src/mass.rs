//! Area, volume and centroids of faces and shells.
//!
//! The integral of a density f over the region of a face is, by Green's theorem in the parameter plane, that of
//! `F(u, v) dv` along its loops with `F = integral of f from the left side of the domain to u`. The p-curves are cut at
//! the knot lines. Within a knot cell, f is smooth and Gauss' rule converges fast; what F holds of the cells further to
//! the left is not integrated again along the curve: between two knot lines it depends on the ends of the curve only,
//! and at knot lines it is made of whole cells. So each cell is integrated once, and the curve only next to itself.
//!
//! Every integral is by rules of rising order until two agree to 1e-8 of it, the better one being closer by far, and cut in four where none do. Surface pieces
//! are evaluated in Bezier form, many places at the same v at a time.

mod cells;
mod patch;

use super::model::{Face, Model, ShellKind};
use cells::{Cells, Sums};
use glam::DVec3;
use nurbskin_geometry::{Error, Result};
use rayon::prelude::*;

/// Area and centroid of a face, and the cone over it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FaceMass {
    /// Area, in square units of length.
    pub area: f64,
    /// Centroid of the area; the apex if that is 0.
    pub centroid: DVec3,
    /// Volume of the cone from the apex to the face: positive where the face looks away from it. Over the faces of a
    /// closed shell that look outwards, the sum is the volume inside.
    pub cone: f64,
    /// The integral of the vector from the apex over that cone, in length to the fourth.
    pub cone_moment: DVec3,
}

/// Area, volume and centroids of a model or a shell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mass {
    /// Area of all faces.
    pub area: f64,
    /// Centroid of the area.
    pub centroid: DVec3,
    /// Volume inside the closed shells, negative where their faces look inwards; `None` where no shell is closed.
    pub volume: Option<f64>,
    /// Centroid of that volume.
    pub volume_centroid: Option<DVec3>,
}

/// Area and centroid of a face, and the volume of the cone over it from `apex`: to about 1e-10 of the area, times the
/// size of the face for volumes.
///
/// The sense of the loops does not matter as long as they agree; `reversed` turns the sign of the cone.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_cad::{Model, face_mass};
/// use nurbskin_geometry::nurbs::conic;
/// let mut model = Model::new("ball");
/// let face = model.add_whole_surface(&conic::sphere(DVec3::ZERO, 1.0)?, 1e-9)?;
/// let mass = face_mass(&model.faces()[face], DVec3::ZERO)?;
/// assert!((mass.area - 4.0 * std::f64::consts::PI).abs() < 1e-9);
/// assert!((mass.cone - 4.0 / 3.0 * std::f64::consts::PI).abs() < 1e-9);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] if the face has no loop.
pub fn face_mass(face: &Face, apex: DVec3) -> Result<FaceMass> {
    if face.loops.is_empty() {
        return Err(Error::invalid("a face without loops has no area"));
    }
    let mut sum = Cells::new(&face.surface, apex).integrate(&face.loops)?;
    if sum.area < 0.0 {
        sum = sum * -1.0;
    }
    let side = if face.reversed { -1.0 } else { 1.0 };
    let offset = if sum.area > 0.0 {
        sum.area_moment / sum.area
    } else {
        DVec3::ZERO
    };
    Ok(FaceMass {
        area: sum.area,
        centroid: apex + offset,
        cone: side * sum.cone,
        cone_moment: side * sum.cone_moment,
    })
}

/// Area, volume and centroids of all faces of a model; the volume is that inside its shells that are closed.
///
/// # Errors
/// As [`face_mass`].
pub fn mass(model: &Model) -> Result<Mass> {
    let apex = middle(model, 0..model.faces().len());
    let parts = masses(model, &(0..model.faces().len()).collect::<Vec<_>>(), apex)?;
    let mut inside = vec![false; parts.len()];
    for shell in model.shells().iter().filter(|s| s.kind != ShellKind::Open) {
        shell.faces.iter().for_each(|&face| inside[face] = true);
    }
    Ok(total(apex, parts.into_iter().zip(inside)))
}

/// Area, volume and centroids of a shell; it has a volume if every edge is used once in each direction, whatever its
/// kind says.
///
/// # Errors
/// [`Error::Invalid`] if the shell does not exist; as [`face_mass`].
pub fn shell_mass(model: &Model, shell: usize) -> Result<Mass> {
    let shells = model.shells();
    let Some(shell) = shells.get(shell) else {
        let count = shells.len();
        return Err(Error::invalid(format!("shell {shell} of {count}")));
    };
    let closed = model.is_closed(&shell.faces);
    let apex = middle(model, shell.faces.iter().copied());
    let parts = masses(model, &shell.faces, apex)?;
    Ok(total(apex, parts.into_iter().map(|part| (part, closed))))
}

/// The middle of some faces: the nearer the apex, the less is lost to rounding.
fn middle(model: &Model, faces: impl Iterator<Item = usize>) -> DVec3 {
    let boxes = faces
        .filter_map(|face| model.faces().get(face))
        .map(|face| face.surface.bounding_box());
    let [low, high] = boxes.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[a, b], [c, d]| {
        [a.min(c), b.max(d)]
    });
    if low.cmple(high).all() {
        low.midpoint(high)
    } else {
        DVec3::ZERO
    }
}

fn masses(model: &Model, faces: &[usize], apex: DVec3) -> Result<Vec<FaceMass>> {
    let of = |&face: &usize| match model.faces().get(face) {
        Some(face) => face_mass(face, apex),
        None => Err(Error::invalid(format!("there is no face {face}"))),
    };
    faces.par_iter().map(of).collect()
}

/// The sum over faces, each with whether it bounds a volume.
fn total(apex: DVec3, parts: impl Iterator<Item = (FaceMass, bool)>) -> Mass {
    let (mut area, mut moment) = (0.0, DVec3::ZERO);
    let (mut volume, mut volume_moment, mut any) = (0.0, DVec3::ZERO, false);
    for (part, closed) in parts {
        area += part.area;
        moment += part.area * (part.centroid - apex);
        if closed {
            any = true;
            volume += part.cone;
            volume_moment += part.cone_moment;
        }
    }
    let centre = |moment: DVec3, size: f64| {
        let offset = moment / size;
        apex + if offset.is_finite() {
            offset
        } else {
            DVec3::ZERO
        }
    };
    Mass {
        area,
        centroid: centre(moment, area),
        volume: any.then_some(volume),
        volume_centroid: any.then(|| centre(volume_moment, volume)),
    }
}

#[cfg(test)]
mod tests;

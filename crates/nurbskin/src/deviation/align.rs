//! Best fit of a scan to a model: a small rigid motion, by iterated closest points.

use crate::Result;
use crate::cad::{ClosestOnModel, ModelFoot, Place};
use crate::numeric::eigen::symmetric_eigen;
use crate::numeric::statistics::median_in_place;
use crate::progress::Progress;
use glam::{DMat3, DQuat, DVec2, DVec3};
use serde::Serialize;

/// Points that take part at most.
const MOST_POINTS: usize = 20_000;
const MOST_STEPS: usize = 100;
/// A point farther than this many medians from the model has no say: it is an outlier, or lies beside the model.
const REACH: f64 = 4.0;
/// Motions with less than this share of the stiffness of the stiffest (along a plane, around an axis of revolution) are
/// left alone.
const LOOSE: f64 = 1e-8;
/// It is done when no point moves by more than this share of the size of the scan.
const STILL: f64 = 1e-11;

/// A rigid motion of a scan: a point p goes to `rotation * p + translation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidMotion {
    /// The rotation.
    pub rotation: DMat3,
    /// The translation, after the rotation.
    pub translation: DVec3,
}

impl RigidMotion {
    /// The point moved.
    #[must_use]
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }

    /// The angle of the rotation in degrees, 0 to 180.
    #[must_use]
    pub fn degrees(&self) -> f64 {
        // Of the quaternion, which keeps the digits of small angles.
        let q = DQuat::from_mat3(&self.rotation);
        2.0 * q.xyz().length().atan2(q.w.abs()).to_degrees()
    }
}

/// How a scan was aligned. Lengths in the unit of the points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Alignment {
    /// Angle of the rotation in degrees.
    pub rotation_deg: f64,
    /// How far, and along x, y and z, the middle of the scan moved.
    pub translation: [f64; 3],
    /// Root mean square distance of the points to the model before.
    pub rms_before: f64,
    /// The same after.
    pub rms_after: f64,
    /// The motion as a matrix of three rows: x, y, z and what is added.
    pub matrix: [[f64; 4]; 3],
}

/// The small rigid motion of the points that brings them closest to the model in the sense of least squares, or none if
/// nothing comes closer. It finds the motion next to where the points are: they must lie roughly in place already, with
/// less between them and the model than the size of its features.
///
/// Each step minimises the squared distances of the points to the tangent planes at their feet (Y. Chen and G. Medioni,
/// *Object modelling by registration of multiple range images*, Image and Vision Computing 10, 1992), over at most
/// 20 000 points, without those far off and those beside free edges.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub fn align(
    model: &ClosestOnModel<'_>,
    points: &[DVec3],
    progress: &dyn Progress,
) -> Result<(RigidMotion, Alignment)> {
    let chosen: Vec<DVec3> = evenly(points, MOST_POINTS);
    let count = chosen.len().max(1) as f64;
    let middle = chosen.iter().sum::<DVec3>() / count;
    let size = chosen
        .iter()
        .map(|p| p.distance(middle))
        .fold(0.0, f64::max);
    let (mut rotation, mut shift) = (DQuat::IDENTITY, DVec3::ZERO);
    let mut best: Option<(DQuat, DVec3, f64)> = None;
    let mut before = 0.0;
    let mut starts: Option<Vec<(usize, DVec2)>> = None;
    let mut since = 0;
    for step in 0..MOST_STEPS {
        let moved: Vec<DVec3> = chosen
            .iter()
            .map(|&p| middle + shift + rotation * (p - middle))
            .collect();
        let feet = model.closest_all(&moved, starts.as_deref(), progress)?;
        let rms = rms(&feet);
        if step == 0 {
            before = rms;
        }
        match &best {
            Some((_, _, least)) if rms >= *least * (1.0 - 1e-6) => since += 1,
            _ => since = 0,
        }
        if best.is_none_or(|(_, _, least)| rms < least) {
            best = Some((rotation, shift, rms));
        }
        // Steps that gain nothing any more go round in circles.
        if size <= 0.0 || since > 4 {
            break;
        }
        let (turn, by) = step_of(&moved, &feet, middle + shift, size);
        rotation = (DQuat::from_scaled_axis(turn) * rotation).normalize();
        shift += by;
        if turn.length() * size + by.length() <= STILL * size {
            break;
        }
        starts = Some(
            feet.iter()
                .map(|f| (f.face, DVec2::new(f.foot.u, f.foot.v)))
                .collect(),
        );
    }
    let (rotation, shift, after) = best.unwrap_or((DQuat::IDENTITY, DVec3::ZERO, 0.0));
    let matrix = DMat3::from_quat(rotation);
    let motion = RigidMotion {
        rotation: matrix,
        translation: middle + shift - matrix * middle,
    };
    let rows = [0, 1, 2].map(|k| {
        let row = matrix.row(k);
        [row.x, row.y, row.z, motion.translation[k]]
    });
    let said = Alignment {
        rotation_deg: motion.degrees(),
        translation: shift.to_array(),
        rms_before: before,
        rms_after: after,
        matrix: rows,
    };
    Ok((motion, said))
}

/// At most `most` of the points, evenly spread over the list.
fn evenly(points: &[DVec3], most: usize) -> Vec<DVec3> {
    let every = points.len().div_ceil(most).max(1);
    points.iter().copied().step_by(every).collect()
}

fn rms(feet: &[ModelFoot]) -> f64 {
    let sum: f64 = feet.iter().map(|f| f.foot.distance.powi(2)).sum();
    (sum / feet.len().max(1) as f64).sqrt()
}

/// The rotation (as a vector along its axis) around `middle` and the translation that minimise the distances to the
/// tangent planes; lengths are divided by `size`, so that both have the same weight.
fn step_of(points: &[DVec3], feet: &[ModelFoot], middle: DVec3, size: f64) -> (DVec3, DVec3) {
    let mut distances: Vec<f64> = feet.iter().map(|f| f.foot.distance).collect();
    let reach = REACH * median_in_place(&mut distances);
    let mut matrix = [[0.0; 6]; 6];
    let mut right = [0.0; 6];
    for (&p, found) in points.iter().zip(feet) {
        let foot = &found.foot;
        if foot.distance > reach || found.place == Place::FreeEdge {
            continue;
        }
        let n = foot.normal;
        let m = ((p - middle) / size).cross(n);
        let row = [m.x, m.y, m.z, n.x, n.y, n.z];
        let off = n.dot(p - foot.point) / size;
        for (i, a) in row.iter().enumerate() {
            right[i] -= a * off;
            for (j, b) in row.iter().enumerate() {
                matrix[i][j] += a * b;
            }
        }
    }
    let pairs = symmetric_eigen(matrix);
    let stiffest = pairs.iter().map(|pair| pair.0).fold(0.0, f64::max);
    let mut step = [0.0; 6];
    for (value, vector) in pairs {
        if value <= LOOSE * stiffest || value <= 0.0 {
            continue;
        }
        let along: f64 = vector.iter().zip(right).map(|(v, r)| v * r).sum();
        for (s, v) in step.iter_mut().zip(vector) {
            *s += v * along / value;
        }
    }
    let [a, b, c, x, y, z] = step;
    (DVec3::new(a, b, c), size * DVec3::new(x, y, z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cad::samples::block;
    use crate::progress::Silent;

    /// Points on the faces of a model.
    fn on(model: &crate::cad::Model) -> Vec<DVec3> {
        let mut all = Vec::new();
        for face in model.faces() {
            let region = crate::cad::Region::new(face).unwrap();
            let [(a, b), (c, d)] = face.surface.domain();
            for k in 0..900 {
                let (s, t) = (f64::from(k % 30) / 29.0, f64::from(k / 30) / 29.0);
                let place = DVec2::new(a + s * (b - a), c + t * (d - c));
                if region.contains(place) {
                    all.push(face.surface.point(place.x, place.y));
                }
            }
        }
        all
    }

    #[test]
    fn a_motion_is_undone() {
        let model = block(DVec3::new(1.0, 2.0, 3.0));
        let target = ClosestOnModel::new(&model).unwrap();
        let turn = DQuat::from_scaled_axis(DVec3::new(0.01, -0.02, 0.015));
        let by = DVec3::new(0.01, 0.02, -0.015);
        let points: Vec<DVec3> = on(&model).into_iter().map(|p| turn * p + by).collect();
        let (motion, said) = align(&target, &points, &Silent).unwrap();
        assert!(said.rms_before > 1e-3 && said.rms_after < 1e-9, "{said:?}");
        assert!((said.rotation_deg - 0.0269258_f64.to_degrees()).abs() < 1e-5);
        for p in &points {
            let back = turn.inverse() * (*p - by);
            assert!(motion.apply(*p).distance(back) < 1e-7);
        }
    }

    #[test]
    fn what_a_plane_cannot_tell_is_left_alone() {
        let model = crate::cad::samples::disk_with_hole([4.0, 1.0], [0.0, 1.5]);
        let target = ClosestOnModel::new(&model).unwrap();
        let inside = |p: &DVec3| p.length() < 3.0 && p.distance(1.5 * DVec3::X) > 1.3;
        let points = on(&model).into_iter().filter(inside);
        let points: Vec<DVec3> = points.map(|p| p + 0.1 * DVec3::Z).collect();
        let (motion, said) = align(&target, &points, &Silent).unwrap();
        assert!((said.rms_before - 0.1).abs() < 1e-9 && said.rms_after < 1e-9);
        let still = motion.apply(points[0]) - points[0] + 0.1 * DVec3::Z;
        assert!(still.length() < 1e-9, "{still}");
    }
}

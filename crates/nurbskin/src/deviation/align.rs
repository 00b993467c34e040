//! Best fit of a scan to a model: a small rigid motion, by iterated closest points.
//!
//! Each step finds the foot points of the scan on the model and minimises the squared distances to their tangent
//! planes. The phases reduce the scale of a robust weight from a quantile of the distances to the noise, so that far
//! points guide the start and do not affect the end.

use glam::{DMat3, DQuat, DVec2, DVec3};
use nurbskin_cad::{ClosestOnModel, ModelFoot, Place};
use nurbskin_geometry::Result;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::eigen::symmetric_eigen;
use nurbskin_geometry::numeric::statistics::{median_in_place, quantile_in_place};
use nurbskin_geometry::progress::Progress;
use serde::Serialize;

/// Largest number of points in the alignment.
const MOST_POINTS: usize = 20_000;
/// Largest number of steps per phase.
const MOST_STEPS: usize = 40;
/// Ratio of the standard deviation of normal errors to the median of their magnitudes.
const SIGMA_OF_MEDIAN: f64 = 1.4826;
/// Fraction of a quantile of the distances up to which residuals have full weight at first: most points of a plate do
/// not constrain its position along itself, and its sides have few points.
const SHARE: f64 = 0.25;
/// The quantiles of the first and the second phase.
const QUANTILES: [f64; 2] = [0.98, 0.9];
/// Number of phases: those by quantiles, one by the median, and some without outliers, each of which recomputes the
/// median.
const PHASES: usize = QUANTILES.len() + 4;
/// Residual, in standard deviations, beyond which a point has no weight in the last phases: it is an outlier, or lies
/// beside the model.
const REACH: f64 = 6.0;
/// Motions with less than this share of the largest stiffness (along a plane, around an axis of revolution) are not
/// applied.
const LOOSE: f64 = 1e-8;
/// The alignment ends when no point moves by more than this share of the size of the scan.
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
    /// The transformed point.
    #[must_use]
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }

    /// The angle of the rotation in degrees, 0 to 180.
    #[must_use]
    pub fn degrees(&self) -> f64 {
        // From the quaternion, which is accurate for small angles.
        let q = DQuat::from_mat3(&self.rotation);
        2.0 * math::atan2(q.xyz().length(), q.w.abs()).to_degrees()
    }
}

/// The result of an alignment. Lengths are in the unit of the points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Alignment {
    /// Angle of the rotation in degrees.
    pub rotation_deg: f64,
    /// Displacement of the centroid of the scan, along x, y and z.
    pub translation: [f64; 3],
    /// Root mean square distance of the points to the model before.
    pub rms_before: f64,
    /// Root mean square distance after the alignment.
    pub rms_after: f64,
    /// The motion as a matrix of three rows: x, y, z and the translation.
    pub matrix: [[f64; 4]; 3],
}

impl Alignment {
    /// The same motion for points to which `origin` is added: `x -> R (x - origin) + t + origin`.
    #[must_use]
    pub fn about(mut self, origin: DVec3) -> Self {
        let shift = origin.to_array();
        for (row, by) in self.matrix.iter_mut().zip(shift) {
            let [x, y, z, moved] = *row;
            row[3] = moved + (by - DVec3::new(x, y, z).dot(origin));
        }
        self
    }
}

/// The small rigid motion of the points that minimises the squared distances to the model; the identity if no motion
/// reduces them. The result is the local minimum next to the initial position: the points must be roughly in place,
/// closer to the model than the size of its features.
///
/// Each step minimises the squared distances of the points to the tangent planes at their foot points (Y. Chen and G.
/// Medioni, *Object modelling by registration of multiple range images*, Image and Vision Computing 10, 1992), over at
/// most 20 000 points, without those beside free edges. Residuals beyond a scale count linearly (P. J. Huber, *Robust
/// estimation of a location parameter*, 1964). The scale decreases in phases to that of the noise; in the last phases
/// points far beyond it have no weight.
///
/// # Errors
/// [`Error::Cancelled`](nurbskin_geometry::Error::Cancelled).
pub fn align(
    model: &ClosestOnModel<'_>,
    points: &[DVec3],
    progress: &dyn Progress,
) -> Result<(RigidMotion, Alignment)> {
    let chosen: Vec<DVec3> = evenly(points, MOST_POINTS);
    let count = chosen.len().max(1) as f64;
    let middle = chosen.iter().sum::<DVec3>() / count;
    let reach = chosen.iter().map(|p| p.distance(middle));
    let scan = Scan {
        model,
        size: reach.fold(0.0, f64::max),
        middle,
        points: chosen,
        progress,
    };
    let start = Pose {
        turn: DQuat::IDENTITY,
        shift: DVec3::ZERO,
    };
    let before = scan.distances(&scan.feet(start, None)?);
    let mut found = vec![(start, before.clone())];
    if scan.size > 0.0 {
        // From a large to a small scale, and once from the small scale only, for scans with many points beside the
        // model.
        for first in [0, QUANTILES.len() + 1] {
            let mut pose = start;
            for phase in first..PHASES {
                pose = scan.fitted(pose, phase)?;
            }
            found.push((pose, scan.distances(&scan.feet(pose, None)?)));
        }
    }
    // The best result by the residuals within the reach of the closest one, so that points beside the model do not
    // count.
    let median = |of: &(Pose, Vec<f64>)| median_in_place(&mut of.1.clone());
    let least = found.iter().map(median).fold(f64::INFINITY, f64::min);
    let reach = (REACH * SIGMA_OF_MEDIAN * least).max(STILL * scan.size);
    let cost = |of: &(Pose, Vec<f64>)| of.1.iter().map(|d| d.min(reach).powi(2)).sum::<f64>();
    let best = found.into_iter().min_by(|a, b| cost(a).total_cmp(&cost(b)));
    let (Pose { turn, shift }, after) = best.unwrap_or((start, Vec::new()));
    let matrix = DMat3::from_quat(turn);
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
        rms_before: rms(&before),
        rms_after: rms(&after),
        matrix: rows,
    };
    Ok((motion, said))
}

/// A rotation around the centroid of a scan, and a shift.
#[derive(Clone, Copy)]
struct Pose {
    turn: DQuat,
    shift: DVec3,
}

/// The points to align.
struct Scan<'a> {
    model: &'a ClosestOnModel<'a>,
    points: Vec<DVec3>,
    middle: DVec3,
    /// Largest distance from the centroid.
    size: f64,
    progress: &'a dyn Progress,
}

impl Scan<'_> {
    fn moved(&self, pose: Pose) -> Vec<DVec3> {
        let place = |&p: &DVec3| self.middle + pose.shift + pose.turn * (p - self.middle);
        self.points.iter().map(place).collect()
    }

    fn feet(&self, pose: Pose, starts: Option<&[(usize, DVec2)]>) -> Result<Vec<ModelFoot>> {
        self.model
            .closest_all(&self.moved(pose), starts, self.progress)
    }

    fn distances(&self, feet: &[ModelFoot]) -> Vec<f64> {
        feet.iter().map(|f| f.foot.distance).collect()
    }

    /// The best pose of a phase: the first phases use quantiles, the next the median, the last exclude outliers.
    fn fitted(&self, start: Pose, phase: usize) -> Result<Pose> {
        let mut feet = self.feet(start, None)?;
        let mut distances = self.distances(&feet);
        let mut scale = SIGMA_OF_MEDIAN * median_in_place(&mut distances);
        if let Some(&q) = QUANTILES.get(phase) {
            scale = scale.max(SHARE * quantile_in_place(&mut distances, q));
        }
        scale = scale.max(STILL * self.size);
        let without_outliers = phase > QUANTILES.len();
        let weight = |distance: f64| match without_outliers {
            true => f64::from(u8::from(distance <= REACH * scale)),
            false => (scale / distance).min(1.0),
        };
        let cost = |feet: &[ModelFoot]| -> f64 {
            let each = |f: &ModelFoot| {
                let d = f.foot.distance;
                match without_outliers {
                    true => d.min(REACH * scale).powi(2),
                    false => d.min(scale) * (2.0 * d - d.min(scale)),
                }
            };
            feet.iter().map(each).sum()
        };
        let (mut pose, mut best, mut least) = (start, start, cost(&feet));
        let mut since = 0;
        for _ in 0..MOST_STEPS {
            let (turn, by) = step_of(
                &self.moved(pose),
                &feet,
                weight,
                self.middle + pose.shift,
                self.size,
            );
            pose.turn = (math::rotation(turn) * pose.turn).normalize();
            pose.shift += by;
            let starts: Vec<(usize, DVec2)> = feet
                .iter()
                .map(|f| (f.face, DVec2::new(f.foot.u, f.foot.v)))
                .collect();
            feet = self.feet(pose, Some(&starts))?;
            let now = cost(&feet);
            since = if now < least * (1.0 - 1e-6) {
                0
            } else {
                since + 1
            };
            if now < least {
                (best, least) = (pose, now);
            }
            // Steps without a gain cycle.
            if since > 4 || turn.length() * self.size + by.length() <= STILL * self.size {
                break;
            }
        }
        Ok(best)
    }
}

fn rms(distances: &[f64]) -> f64 {
    let sum: f64 = distances.iter().map(|d| d * d).sum();
    (sum / distances.len().max(1) as f64).sqrt()
}

/// At most `most` of the points, evenly distributed over the list.
fn evenly(points: &[DVec3], most: usize) -> Vec<DVec3> {
    let every = points.len().div_ceil(most).max(1);
    points.iter().copied().step_by(every).collect()
}

/// The rotation (as a vector along its axis) around `middle` and the translation that minimise the weighted squared
/// distances to the tangent planes. Lengths are divided by `size`, so that both have equal weight.
fn step_of(
    points: &[DVec3],
    feet: &[ModelFoot],
    weight: impl Fn(f64) -> f64,
    middle: DVec3,
    size: f64,
) -> (DVec3, DVec3) {
    let mut matrix = [[0.0; 6]; 6];
    let mut right = [0.0; 6];
    for (&p, found) in points.iter().zip(feet) {
        let foot = &found.foot;
        let weight = weight(foot.distance);
        if weight <= 0.0 || found.place == Place::FreeEdge {
            continue;
        }
        let n = foot.normal;
        let m = ((p - middle) / size).cross(n);
        let row = [m.x, m.y, m.z, n.x, n.y, n.z];
        let off = n.dot(p - foot.point) / size;
        for (i, a) in row.iter().enumerate() {
            right[i] -= weight * a * off;
            for (j, b) in row.iter().enumerate() {
                matrix[i][j] += weight * a * b;
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
    use nurbskin_cad::samples::block;
    use nurbskin_geometry::progress::Silent;

    /// Points on the faces of a model.
    fn on(model: &nurbskin_cad::Model) -> Vec<DVec3> {
        let mut all = Vec::new();
        for face in model.faces() {
            let region = nurbskin_cad::Region::new(face).unwrap();
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
        let model = nurbskin_cad::samples::disk_with_hole([4.0, 1.0], [0.0, 1.5]);
        let target = ClosestOnModel::new(&model).unwrap();
        let inside = |p: &DVec3| p.length() < 3.0 && p.distance(1.5 * DVec3::X) > 1.3;
        let points = on(&model).into_iter().filter(inside);
        let points: Vec<DVec3> = points.map(|p| p + 0.1 * DVec3::Z).collect();
        let (motion, said) = align(&target, &points, &Silent).unwrap();
        assert!((said.rms_before - 0.1).abs() < 1e-9 && said.rms_after < 1e-9);
        let still = motion.apply(points[0]) - points[0] + 0.1 * DVec3::Z;
        assert!(still.length() < 1e-9, "{still}");
    }

    #[test]
    fn the_sides_of_a_plate_are_heard() {
        let size = DVec3::new(100.0, 100.0, 2.0);
        let model = block(size);
        let target = ClosestOnModel::new(&model).unwrap();
        let turn = DQuat::from_scaled_axis(DVec3::new(0.001, -0.002, 0.004));
        let random = |k: usize| {
            let each = |x: f64| (k as f64 * x).fract();
            DVec3::new(each(0.618_034), each(0.754_878), each(0.569_841))
        };
        for (by, noise, outliers) in [
            (DVec3::new(0.2, 0.1, 0.05), 0.0, 0),
            (DVec3::new(0.5, 0.3, 0.0), 0.0, 0),
            (DVec3::new(0.2, 0.1, 0.05), 0.01, 0),
            (DVec3::new(0.2, 0.1, 0.05), 0.01, 400),
        ] {
            let mut points = Vec::new();
            for k in 0..5000 {
                let spot = random(k);
                // One in twenty on a side.
                let mut at = spot * size;
                match k % 20 {
                    0 => at[k / 20 % 2] = size[k / 20 % 2] * f64::from(u8::from(k / 40 % 2 == 0)),
                    _ => at.z = size.z * f64::from(u8::from(k % 2 == 0)),
                }
                let error = 3.0_f64.sqrt() * (2.0 * random(77 * k + 5) - 1.0);
                points.push(turn * at + by + noise * error);
            }
            for k in 0..outliers {
                let spot = random(31 * k + 11);
                points.push((2.0 * spot - 0.5) * size + 20.0 * spot.z * DVec3::Z);
            }
            let (motion, said) = align(&target, &points, &Silent).unwrap();
            let corner = DVec3::new(size.x, 0.0, size.z);
            let off = motion.apply(turn * corner + by).distance(corner);
            // 250 points on the sides, 125 for each direction: their mean is known to a tenth of the noise.
            assert!(
                off <= 1e-8 + 0.5 * noise,
                "{by} {noise} {outliers}: {off} {said:?}"
            );
        }
    }

    #[test]
    fn what_lies_to_one_side_pulls_nothing() {
        let size = DVec3::new(60.0, 40.0, 20.0);
        let model = block(size);
        let target = ClosestOnModel::new(&model).unwrap();
        let mut points = on(&model);
        let count = points.len();
        // Three in ten belong to a table beside it.
        points.extend((0..3 * count / 7).map(|k| {
            let k = k as f64;
            DVec3::new(
                62.0 + (0.618_034 * k).fract() * 60.0,
                (0.754_878 * k).fract() * 60.0,
                0.0,
            )
        }));
        for by in [DVec3::ZERO, DVec3::new(0.6, -0.5, 0.4)] {
            let moved: Vec<DVec3> = points.iter().map(|&p| p + by).collect();
            let (motion, said) = align(&target, &moved, &Silent).unwrap();
            let off = motion.apply(size + by).distance(size);
            assert!(off < 1e-6, "{by}: {off} {said:?}");
        }
    }
}

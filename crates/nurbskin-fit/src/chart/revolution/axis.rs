//! The axis of a surface of revolution, from points and unit normals.
//!
//! The normal lines of a surface that a rotation or a screw motion moves in itself lie in a linear complex (c, d):
//!
//! ```text
//! c · (x × n) + d · n = 0        minimise the weighted sum of squares subject to |c| = 1
//! ```
//!
//! The axis has the direction c and passes through c × d. The weights are those of Geman and `McClure`, for outliers. A
//! sphere, which has no axis of its own, is recognised by algebraic least squares and gets an axis that suits the
//! scanned part.
//!
//! Source: H. Pottmann and J. Wallner, *Computational Line Geometry*, Springer 2001, sections 3.1 and 4.3.

use glam::{DMat3, DVec2, DVec3};
use nurbskin_geometry::numeric::eigen::symmetric_eigen;
use nurbskin_geometry::numeric::statistics::{SIGMA_PER_MAD, median_in_place};
use nurbskin_scan::mesh::subset::subset;

/// Rounds of iterative reweighting for the axis. Guard: the weights settle within some rounds; each costs O(n).
const AXIS_ROUNDS: usize = 12;
/// Scale c of the Geman-McClure weights (1 + (r/c)²)⁻² of the axis, in sigma: a residual of c has a quarter of the full
/// weight. Trial: not recorded. A smaller one discards good normals, a larger one lets outliers tilt the axis.
const AXIS_WEIGHT_SIGMAS: f64 = 2.0;
/// Rounds of iterative reweighting for a sphere. Guard: an algebraic sphere settles within a few; each costs O(n).
const SPHERE_ROUNDS: usize = 4;
/// The same scale for the distances from a sphere, in sigma. Trial: not recorded.
const SPHERE_WEIGHT_SIGMAS: f64 = 3.0;
/// Ridge on the matrix of normals, as a share of its trace. Guard: the normals of a cylinder span a plane only, and the
/// matrix has no inverse without it.
const NORMAL_RIDGE: f64 = 1e-9;
/// Determinant of the weighted scatter of the points, in extents and per cubed weight, up to which they count as flat.
/// Guard: below it the centre of a sphere is rounding.
const FLAT_DETERMINANT: f64 = 1e-18;
/// Length of the mean direction from the centre above which a scanned part of a sphere has a middle (0 for a whole
/// sphere, 1/2 for half of it). Trial: not recorded.
const CAP_MEAN: f64 = 0.05;
/// Difference of the largest and the smallest eigenvalue of the mean of d dᵀ, for unit directions d, above which a part
/// of a sphere is a zone (0 for a whole sphere). Trial: not recorded.
const ZONE_ANISOTROPY: f64 = 0.05;

/// A line in space with a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// The point of the axis nearest to the middle of the data.
    pub point: DVec3,
    /// Unit direction.
    pub direction: DVec3,
}

impl Axis {
    /// Radius and height of a point: its distance from the axis, and its coordinate along the axis from `point`.
    #[must_use]
    pub fn radius_height(&self, p: DVec3) -> DVec2 {
        let (height, across) = self.split(p);
        DVec2::new(across.length(), height)
    }
    /// Height of a point, and its offset from the axis.
    pub(super) fn split(&self, p: DVec3) -> (f64, DVec3) {
        let offset = p - self.point;
        let height = offset.dot(self.direction);
        (height, offset - height * self.direction)
    }
    /// Two unit vectors that make a right-handed frame with the direction. The first leans to the coordinate axis that
    /// is farthest from the direction.
    #[must_use]
    pub fn frame(&self) -> [DVec3; 2] {
        let c = self.direction;
        let mut lean = DVec3::ZERO;
        lean[c.abs().min_position()] = 1.0;
        let x = (lean - lean.dot(c) * c).normalize_or(c.any_orthonormal_vector());
        [x, c.cross(x)]
    }
    /// The line with `point` nearest to `middle`, directed towards larger coordinates.
    pub(super) fn settled(self, middle: DVec3) -> Self {
        let c = self.direction;
        let c = if c[c.abs().max_position()] < 0.0 {
            -c
        } else {
            c
        };
        Self {
            point: self.point + (middle - self.point).dot(c) * c,
            direction: c,
        }
    }
}

/// Points with unit normals, in an order that is independent of the file's.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    pub(crate) points: Vec<DVec3>,
    pub(crate) normals: Vec<DVec3>,
}

impl Sample {
    /// At most `limit` of the points that have a normal: those with the smallest hash of their coordinates, sorted by
    /// coordinates. The result is independent of the order of the points. O(n + limit log limit).
    pub(crate) fn new(points: &[DVec3], normals: &[DVec3], limit: usize) -> Self {
        let count = points.len().min(normals.len());
        let usable = |k: usize| normals[k].length_squared() > 0.5;
        let indices = subset(&points[..count], limit, usable);
        let gather = |items: &[DVec3]| indices.iter().map(|&k| items[k as usize]).collect();
        Self {
            points: gather(points),
            normals: gather(normals),
        }
    }

    /// Mean of the points, and their root mean square distance from it.
    pub(super) fn extent(&self) -> (DVec3, f64) {
        let n = self.points.len().max(1) as f64;
        let middle = self.points.iter().sum::<DVec3>() / n;
        let square: f64 = self.points.iter().map(|p| p.distance_squared(middle)).sum();
        (middle, (square / n).sqrt())
    }
}

/// The axis that the normal lines meet best, and the median miss of the normals: the sine of the angle between a normal
/// and the half plane through the axis, times the distance from the axis in extents.
///
/// The linear complex (c, d) minimises the sum of squares of `c . (x x n) + d . n` under |c| = 1, reweighted for
/// outliers; c is the direction of the axis and c x d a point of it (H. Pottmann and J. Wallner, *Computational Line
/// Geometry*, Springer 2001, sections 3.1 and 4.3). O(n).
pub(super) fn axis_of_normals(sample: &Sample) -> Option<(Axis, f64)> {
    let (middle, size) = sample.extent();
    if !(size > 0.0 && size.is_finite()) {
        return None;
    }
    let lines: Vec<[f64; 6]> = sample
        .points
        .iter()
        .zip(&sample.normals)
        .map(|(&p, &n)| {
            let moment = ((p - middle) / size).cross(n);
            [moment.x, moment.y, moment.z, n.x, n.y, n.z]
        })
        .collect();
    let mut weights = vec![1.0; lines.len()];
    let mut found = None;
    for _ in 0..AXIS_ROUNDS {
        let (c, d) = complex(&lines, &weights)?;
        let mut missed: Vec<f64> = lines
            .iter()
            .map(|l| {
                (c.dot(DVec3::new(l[0], l[1], l[2])) + d.dot(DVec3::new(l[3], l[4], l[5]))).abs()
            })
            .collect();
        for (w, r) in weights.iter_mut().zip(&missed) {
            *w = *r;
        }
        let median = median_in_place(&mut missed);
        let sigma = SIGMA_PER_MAD * median + 1e-12;
        for w in &mut weights {
            *w = (1.0 + (*w / (AXIS_WEIGHT_SIGMAS * sigma)).powi(2)).powi(-2);
        }
        let axis = Axis {
            point: middle + size * c.cross(d),
            direction: c,
        };
        found = Some((axis.settled(middle), median));
    }
    found.filter(|(axis, _)| axis.point.is_finite() && axis.direction.is_finite())
}

/// (c, d) of the linear complex: d is eliminated, and c is the eigenvector of the Schur complement.
fn complex(lines: &[[f64; 6]], weights: &[f64]) -> Option<(DVec3, DVec3)> {
    let mut m = [[0.0; 6]; 6];
    for (l, &w) in lines.iter().zip(weights) {
        for i in 0..6 {
            for j in i..6 {
                m[i][j] += w * l[i] * l[j];
            }
        }
    }
    let at = |i: usize, j: usize| m[i.min(j)][i.max(j)];
    let block = |row: usize, column: usize| {
        DMat3::from_cols_array_2d(&std::array::from_fn(|j| {
            std::array::from_fn(|i| at(row + i, column + j))
        }))
    };
    let (a, b, d) = (block(0, 0), block(0, 3), block(3, 3));
    let trace = at(3, 3) + at(4, 4) + at(5, 5);
    let inverse = (d + DMat3::from_diagonal(DVec3::splat(NORMAL_RIDGE * trace))).inverse();
    let schur = a - b * inverse * b.transpose();
    let pairs = symmetric_eigen(schur.to_cols_array_2d());
    let c = DVec3::from_array(pairs[0].1);
    let d = -(inverse * (b.transpose() * c));
    (c.is_finite() && d.is_finite()).then_some((c, d))
}

/// Centre, radius and robust standard deviation of the best sphere, by reweighted algebraic least squares; `None` for
/// flat points.
pub(super) fn sphere(sample: &Sample) -> Option<(DVec3, f64, f64)> {
    let (middle, size) = sample.extent();
    let mut weights = vec![1.0; sample.points.len()];
    let mut found = None;
    for _ in 0..SPHERE_ROUNDS {
        // |y|² = 2 centre · y + k, relative to the weighted means, which eliminates k.
        let (mut total, mut mean, mut square) = (0.0, DVec3::ZERO, 0.0);
        let scaled = || sample.points.iter().map(|&p| (p - middle) / size);
        for (y, &w) in scaled().zip(&weights) {
            total += w;
            mean += w * y;
            square += w * y.length_squared();
        }
        (mean, square) = (mean / total, square / total);
        let (mut a, mut b) = (DMat3::ZERO, DVec3::ZERO);
        for (y, &w) in scaled().zip(&weights) {
            let d = y - mean;
            a += DMat3::from_cols(w * d.x * d, w * d.y * d, w * d.z * d);
            b += w * (y.length_squared() - square) * d;
        }
        if a.determinant() <= FLAT_DETERMINANT * total.powi(3) {
            return None;
        }
        let centre = 0.5 * (a.inverse() * b);
        let radii: Vec<f64> = scaled().map(|y| y.distance(centre)).collect();
        let radius = median_in_place(&mut radii.clone());
        let mut off: Vec<f64> = radii.iter().map(|r| (r - radius).abs()).collect();
        let sigma = SIGMA_PER_MAD * median_in_place(&mut off) + 1e-15;
        for (w, r) in weights.iter_mut().zip(&radii) {
            *w = (1.0 + ((r - radius) / (SPHERE_WEIGHT_SIGMAS * sigma)).powi(2)).powi(-2);
        }
        found = Some((middle + size * centre, size * radius, size * sigma));
    }
    found.filter(|(centre, radius, _)| centre.is_finite() && radius.is_finite())
}

/// The axis of a sphere that suits the scanned part: towards the middle of a cap, along the axis of a zone, and along z
/// for a whole sphere.
pub(super) fn axis_of_sphere(sample: &Sample, centre: DVec3) -> Axis {
    let n = sample.points.len().max(1) as f64;
    let directions = || {
        sample
            .points
            .iter()
            .map(|&p| (p - centre).normalize_or_zero())
    };
    let mean = directions().sum::<DVec3>() / n;
    let mut moment = [[0.0; 3]; 3];
    for d in directions() {
        for (i, row) in moment.iter_mut().enumerate() {
            for (j, cell) in row.iter_mut().enumerate() {
                *cell += d[i] * d[j] / n;
            }
        }
    }
    let [low, mid, high] = symmetric_eigen(moment);
    let direction = if mean.length() > CAP_MEAN {
        mean.normalize_or(DVec3::Z)
    } else if high.0 - low.0 > ZONE_ANISOTROPY {
        let odd = if mid.0 - low.0 > high.0 - mid.0 {
            low
        } else {
            high
        };
        DVec3::from_array(odd.1)
    } else {
        DVec3::Z
    };
    Axis {
        point: centre,
        direction,
    }
    .settled(centre)
}

//! Principal axes of points, least-squares planes, and normals of meshes and of points on lines.
//!
//! The normal of the least-squares plane is the eigenvector of the smallest eigenvalue λ of the covariance matrix A,
//! scaled to trace 1. The fast path finds λ by Newton's method on the characteristic polynomial from zero, which
//! approaches the smallest root from one side, and takes the longest cross product of two rows of A - λI as the
//! eigenvector. Where the two smallest eigenvalues nearly coincide, Jacobi rotations replace it.
//!
//! Sources: G. H. Golub, C. F. Van Loan, *Matrix Computations*, 4th ed., section 8.5, for Jacobi rotations; Hoppe et
//! al. 1992 for planes as local normals.

use glam::DVec3;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::statistics::median_in_place;

/// Most sweeps of Jacobi rotations over a 3 × 3 matrix. Guard: convergence is quadratic, and some six sweeps reach
/// rounding.
const MAX_JACOBI_SWEEPS: usize = 30;
/// Sum of the off-diagonal entries, relative to the diagonal ones, at which the matrix is diagonal. Guard: below
/// rounding, so that the next sweep changes nothing.
const JACOBI_TOLERANCE: f64 = f64::EPSILON * 1e-3;
/// Most Newton steps for the smallest eigenvalue. Guard: convergence is quadratic; slower matrices have two nearly
/// equal eigenvalues and go to Jacobi rotations.
const MAX_NEWTON_STEPS: usize = 20;
/// Slope of the characteristic polynomial of a matrix of trace 1 up to which the two smallest eigenvalues are too close
/// for Newton's method. Guard: the slope is the product of the distances to the other two eigenvalues.
const MIN_NEWTON_SLOPE: f64 = 1e-6;
/// Absolute step at which Newton's method ends, for a matrix of trace 1. Guard: half a unit of rounding of the largest
/// eigenvalue.
const NEWTON_ABSOLUTE: f64 = 1e-16;
/// Relative step at which Newton's method ends. Derived: the error after a step is of the order of its square, 1e-18,
/// which is below rounding.
const NEWTON_RELATIVE: f64 = 1e-9;
/// Least length of the cross product of two rows that gives the eigenvector, for a matrix of trace 1. Guard: the
/// direction of a shorter one is lost in rounding, relative to 1e-16.
const MIN_AXIS_LENGTH: f64 = 1e-4;

/// Eigenvalues (ascending) and unit eigenvectors of the symmetric matrix with the rows (xx xy xz), (xy yy yz),
/// (xz yz zz), by Jacobi rotations (Golub & Van Loan, *Matrix Computations*, 4th ed., section 8.5).
#[must_use]
pub fn symmetric_eigen(xx: f64, yy: f64, zz: f64, xy: f64, xz: f64, yz: f64) -> [(f64, DVec3); 3] {
    let mut a = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let mut vectors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..MAX_JACOBI_SWEEPS {
        let off = a[0][1].abs() + a[0][2].abs() + a[1][2].abs();
        let diagonal = a[0][0].abs() + a[1][1].abs() + a[2][2].abs();
        if off <= JACOBI_TOLERANCE * diagonal {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q].abs() <= f64::MIN_POSITIVE {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + math::hypot(theta, 1.0));
            let c = 1.0 / math::hypot(t, 1.0);
            let s = t * c;
            for row in &mut a {
                let (x, y) = (row[p], row[q]);
                (row[p], row[q]) = (c * x - s * y, s * x + c * y);
            }
            let (above, below) = a.split_at_mut(q);
            for (x, y) in above[p].iter_mut().zip(&mut below[0]) {
                (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
            }
            for row in &mut vectors {
                let (x, y) = (row[p], row[q]);
                (row[p], row[q]) = (c * x - s * y, s * x + c * y);
            }
        }
    }
    let column = |k: usize| DVec3::new(vectors[0][k], vectors[1][k], vectors[2][k]);
    let mut pairs = [0, 1, 2].map(|k| (a[k][k], column(k)));
    pairs.sort_by(|x, y| x.0.total_cmp(&y.0));
    pairs
}

/// Principal axes of points about their mean: the mean, and variance and direction of each axis, ascending. Zero
/// variances for no points.
#[must_use]
pub fn principal_axes(points: impl Iterator<Item = DVec3> + Clone) -> (DVec3, [(f64, DVec3); 3]) {
    let (sum, count) = points
        .clone()
        .fold((DVec3::ZERO, 0.0), |(sum, n), p| (sum + p, n + 1.0));
    let n = f64::max(count, 1.0);
    let mean = sum / n;
    let mut square = DVec3::ZERO;
    let mut mixed = DVec3::ZERO;
    for p in points {
        let d = p - mean;
        square += d * d;
        mixed += DVec3::new(d.x * d.y, d.x * d.z, d.y * d.z);
    }
    let (s, m) = (square / n, mixed / n);
    (mean, symmetric_eigen(s.x, s.y, s.z, m.x, m.y, m.z))
}

/// As [`principal_axes`], faster: the variances, ascending, and their directions, the first of which is the normal of
/// the least-squares plane. Newton's method finds the smallest root of the characteristic polynomial from zero, which
/// it approaches from one side; where the two smallest roots are too close, Jacobi rotations replace it.
#[must_use]
pub fn plane_axes(mut points: impl Iterator<Item = DVec3>) -> ([f64; 3], [DVec3; 3]) {
    let start = points.next().unwrap_or(DVec3::ZERO);
    let (mut count, mut sum, mut square, mut mixed) = (1.0, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
    for p in points {
        let d = p - start;
        count += 1.0;
        sum += d;
        square += d * d;
        mixed += DVec3::new(d.x * d.y, d.x * d.z, d.y * d.z);
    }
    let mean = sum / count;
    let s = square / count - mean * mean;
    let m = mixed / count - DVec3::new(mean.x * mean.y, mean.x * mean.z, mean.y * mean.z);
    let trace = s.element_sum();
    if !(trace > 0.0 && trace.is_finite()) {
        return ([0.0; 3], [DVec3::Z, DVec3::Y, DVec3::X]);
    }
    let (s, m) = (s / trace, m / trace);
    fast_eigen(s, m).map_or_else(
        || {
            let pairs = symmetric_eigen(s.x, s.y, s.z, m.x, m.y, m.z);
            (
                pairs.map(|(v, _)| v.max(0.0) * trace),
                pairs.map(|(_, axis)| axis),
            )
        },
        |(values, axes)| (values.map(|v| v * trace), axes),
    )
}

/// As [`plane_axes`] for the origin and points around it, faster still: the variances, ascending, and the normal.
#[must_use]
pub(super) fn plane_through(offsets: &[DVec3]) -> ([f64; 3], DVec3) {
    let (mut sum, mut square, mut mixed) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
    for d in offsets {
        sum += *d;
        square += *d * *d;
        mixed += DVec3::new(d.x * d.y, d.x * d.z, d.y * d.z);
    }
    let part = 1.0 / (offsets.len() as f64 + 1.0);
    let mean = sum * part;
    let s = square * part - mean * mean;
    let m = mixed * part - DVec3::new(mean.x * mean.y, mean.x * mean.z, mean.y * mean.z);
    let trace = s.element_sum();
    if !(trace > 0.0 && trace.is_finite()) {
        return ([0.0; 3], DVec3::Z);
    }
    let (s, m) = (s / trace, m / trace);
    let Some((least, minors, normal)) = least_axis(s, m) else {
        let pairs = symmetric_eigen(s.x, s.y, s.z, m.x, m.y, m.z);
        return (pairs.map(|(v, _)| v.max(0.0) * trace), pairs[0].1);
    };
    // The sum of the other two is the rest of the trace, their product the rest of the principal minors.
    let middle = 0.5 * (1.0 - least);
    let product = (minors - least * (1.0 - least)).max(0.0);
    let largest = middle + (middle * middle - product).max(0.0).sqrt();
    let values = [least.max(0.0), product / largest, largest];
    (values.map(|v| v * trace), normal)
}

/// The smallest eigenvalue of a symmetric matrix of trace 1 with the diagonal `s` and the entries xy, xz, yz in `m`,
/// the sum of its principal minors of order two, and the eigenvector; `None` if the two smallest eigenvalues are too
/// close.
#[inline]
fn least_axis(s: DVec3, m: DVec3) -> Option<(f64, f64, DVec3)> {
    let minors = s.x * s.y + s.x * s.z + s.y * s.z - m.length_squared();
    let determinant = s.x * (s.y * s.z - m.z * m.z) - m.x * (m.x * s.z - m.z * m.y)
        + m.y * (m.x * m.z - s.y * m.y);
    let mut least = 0.0_f64;
    let mut settled = false;
    for _ in 0..MAX_NEWTON_STEPS {
        let value = ((least - 1.0) * least + minors) * least - determinant;
        let slope = (3.0 * least - 2.0) * least + minors;
        if slope <= MIN_NEWTON_SLOPE {
            return None;
        }
        let step = value / slope;
        least -= step;
        // The next step would be of the order of its square.
        if step.abs() <= NEWTON_ABSOLUTE + NEWTON_RELATIVE * least.abs() {
            settled = true;
            break;
        }
    }
    let rows = [
        DVec3::new(s.x - least, m.x, m.y),
        DVec3::new(m.x, s.y - least, m.z),
        DVec3::new(m.y, m.z, s.z - least),
    ];
    let crosses = [
        rows[0].cross(rows[1]),
        rows[0].cross(rows[2]),
        rows[1].cross(rows[2]),
    ];
    let squares = crosses.map(DVec3::length_squared);
    let [a, b, c] = squares;
    let longest = if a >= b && a >= c {
        0
    } else if b >= c {
        1
    } else {
        2
    };
    let length = squares[longest].sqrt();
    if !settled || length.is_nan() || length < MIN_AXIS_LENGTH {
        return None;
    }
    Some((least, minors, crosses[longest] / length))
}

/// All eigenvalues and eigenvectors of such a matrix; `None` as for [`least_axis`].
fn fast_eigen(s: DVec3, m: DVec3) -> Option<([f64; 3], [DVec3; 3])> {
    let (least, _, normal) = least_axis(s, m)?;
    // The other two in the plane across the normal: a 2 x 2 matrix.
    let a = normal.any_orthonormal_vector();
    let b = normal.cross(a);
    let times = |v: DVec3| {
        DVec3::new(
            s.x * v.x + m.x * v.y + m.y * v.z,
            m.x * v.x + s.y * v.y + m.z * v.z,
            m.y * v.x + m.z * v.y + s.z * v.z,
        )
    };
    let (aa, ab, bb) = (a.dot(times(a)), a.dot(times(b)), b.dot(times(b)));
    let (middle, half) = (0.5 * (aa + bb), math::hypot(0.5 * (aa - bb), ab));
    // (A - value) v = 0 has two rows that determine v; the longer one is less affected by rounding.
    let [by_a, by_b] = [(ab, middle + half - aa), (middle + half - bb, ab)];
    let (of_a, of_b) = if math::hypot(by_a.0, by_a.1) > math::hypot(by_b.0, by_b.1) {
        by_a
    } else {
        by_b
    };
    let long = (a * of_a + b * of_b).try_normalize().unwrap_or(a);
    let values = [least.max(0.0), (middle - half).max(0.0), middle + half];
    Some((values, [normal, normal.cross(long), long]))
}

/// Vertex normals of a mesh: the normals of the triangles around each vertex, weighted by area. Zero for vertices
/// without a triangle.
#[must_use]
pub fn mesh_normals(points: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; points.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|k| points[k as usize]);
        let area = (b - a).cross(c - a);
        for &k in triangle {
            sums[k as usize] += area;
        }
    }
    sums.into_iter().map(DVec3::normalize_or_zero).collect()
}

/// Differences along or across lines longer than this many median ones cross a depth step or a gap, and are left out.
/// Trial: not recorded. A smaller limit leaves unevenly sampled lines without normals; a larger one takes steps for
/// surface.
const MAX_LINE_STEP: f64 = 5.0;

/// Normals of points on lines, by the cross product of the differences along and across the lines. `lines` hold indices
/// into `points`; points of lines of different length correspond by the fraction of their length. The normals are
/// turned as a whole so that most look away from the centroid. Zero where neighbours are missing, far away or
/// coincident.
#[must_use]
pub(super) fn line_normals(points: &[DVec3], lines: &[Vec<Option<u32>>]) -> Vec<DVec3> {
    let at = |line: usize, k: usize| lines.get(line)?.get(k)?.map(|place| points[place as usize]);
    // k / last * (other - 1), rounded.
    let opposite = |from: usize, k: usize, to: usize| {
        let (last, other) = (lines[from].len().max(2) - 1, lines.get(to)?.len());
        at(to, (2 * k * other.checked_sub(1)? + last) / (2 * last))
    };
    let next = |l: usize, k: usize| [at(l, k + 1), opposite(l, k, l + 1)];
    // 1. The median difference along and across the lines.
    let mut steps = [Vec::new(), Vec::new()];
    for (l, line) in lines.iter().enumerate() {
        for k in 0..line.len() {
            let Some(here) = at(l, k) else { continue };
            for (steps, there) in steps.iter_mut().zip(next(l, k)) {
                steps.extend(there.map(|p| p.distance(here)).filter(|&d| d > 0.0));
            }
        }
    }
    let limits = steps.map(|mut steps| MAX_LINE_STEP * median_in_place(&mut steps));
    // 2. Normals from differences that are not much longer.
    let mut normals = vec![DVec3::ZERO; points.len()];
    for (l, line) in lines.iter().enumerate() {
        for (k, place) in line.iter().enumerate() {
            let Some(place) = place else { continue };
            let here = points[*place as usize];
            let near = |p: Option<DVec3>, limit: f64| {
                p.filter(|p| p.distance(here) <= limit).unwrap_or(here)
            };
            let [after, above] = next(l, k);
            let before = k.checked_sub(1).and_then(|k| at(l, k));
            let below = l.checked_sub(1).and_then(|other| opposite(l, k, other));
            let along = near(after, limits[0]) - near(before, limits[0]);
            let across = near(above, limits[1]) - near(below, limits[1]);
            normals[*place as usize] = along.cross(across).normalize_or_zero();
        }
    }
    let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let outward: f64 = points
        .iter()
        .zip(&normals)
        .map(|(p, n)| (*p - middle).dot(*n))
        .sum();
    if outward < 0.0 {
        for normal in &mut normals {
            *normal = -*normal;
        }
    }
    normals
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Flat, round and long heaps of points: both ways agree.
        #[test]
        fn fast_axes_are_the_axes(
            cells in prop::collection::vec((-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64), 4..40),
            size in prop::array::uniform3(-6..3_i32),
        ) {
            let size = DVec3::from_array(size.map(|e| 10_f64.powi(e)));
            let turn = glam::DQuat::from_xyzw(0.1, 0.7, -0.3, 0.5).normalize();
            let points: Vec<DVec3> = cells
                .iter()
                .map(|&(x, y, z)| turn * (size * DVec3::new(x, y, z)) + DVec3::splat(3.0))
                .collect();
            let (_, slow) = principal_axes(points.iter().copied());
            let (values, axes) = plane_axes(points.iter().copied());
            let largest = slow[2].0;
            for (k, (value, _)) in slow.into_iter().enumerate() {
                prop_assert!((values[k] - value).abs() <= 1e-13 * largest);
                // Each is an eigenvector: the variance along it is its value.
                let mean = points.iter().sum::<DVec3>() / points.len() as f64;
                let along = points.iter().map(|p| (*p - mean).dot(axes[k]).powi(2)).sum::<f64>();
                prop_assert!((along / points.len() as f64 - values[k]).abs() <= 1e-10 * largest);
            }
        }
    }
}

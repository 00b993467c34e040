//! Normals of points, and which side of them is outside.

use super::neighbours::NeighbourTable;
use glam::DVec3;

/// Eigenvalues (ascending) and unit eigenvectors of the symmetric matrix with the rows (xx xy xz), (xy yy yz),
/// (xz yz zz), by Jacobi rotations (Golub & Van Loan, *Matrix Computations*, 4th ed., section 8.5).
#[must_use]
pub(crate) fn symmetric_eigen(
    xx: f64,
    yy: f64,
    zz: f64,
    xy: f64,
    xz: f64,
    yz: f64,
) -> [(f64, DVec3); 3] {
    let mut a = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let mut vectors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..30 {
        let off = a[0][1].abs() + a[0][2].abs() + a[1][2].abs();
        let diagonal = a[0][0].abs() + a[1][1].abs() + a[2][2].abs();
        if off <= f64::EPSILON * 1e-3 * diagonal {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q].abs() <= f64::MIN_POSITIVE {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let c = 1.0 / t.hypot(1.0);
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
pub(crate) fn principal_axes(
    points: impl Iterator<Item = DVec3> + Clone,
) -> (DVec3, [(f64, DVec3); 3]) {
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

/// The normal of the least-squares plane through each point and its `count` nearest neighbours (Hoppe et al. 1992,
/// DOI 10.1145/133994.134011). Which of the two directions is left open; see [`orient`].
#[must_use]
pub fn plane_normals(points: &[DVec3], neighbours: &NeighbourTable, count: usize) -> Vec<DVec3> {
    let normal = |k: usize| {
        let near = &neighbours.of(k)[..count.min(neighbours.count())];
        let around = near.iter().map(|&j| points[j as usize]);
        let (_, axes) = principal_axes(around.chain(std::iter::once(points[k])));
        axes[0].1
    };
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        (0..points.len()).into_par_iter().map(normal).collect()
    }
    #[cfg(not(feature = "parallel"))]
    (0..points.len()).map(normal).collect()
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

/// Normals of points that lie on lines, by the cross product of the differences along and across the lines; `lines`
/// hold places in `points`, lines of different length correspond by the fraction of their length. Turned as a whole
/// so that most look away from the middle. Zero where neighbours are missing or coincide.
#[must_use]
pub(super) fn line_normals(points: &[DVec3], lines: &[Vec<Option<u32>>]) -> Vec<DVec3> {
    let at = |line: usize, k: usize| lines[line][k].map(|place| points[place as usize]);
    let opposite = |from: usize, k: usize, to: usize| {
        let (last, other) = (lines[from].len().max(2) - 1, lines[to].len());
        // Rounded k / last * (other - 1).
        at(
            to,
            ((2 * k * other.saturating_sub(1) + last) / (2 * last)).min(other.checked_sub(1)?),
        )
    };
    let mut normals = vec![DVec3::ZERO; points.len()];
    for (l, line) in lines.iter().enumerate() {
        for (k, place) in line.iter().enumerate() {
            let Some(place) = place else { continue };
            let here = points[*place as usize];
            let before = k.checked_sub(1).and_then(|k| at(l, k));
            let after = (k + 1 < line.len()).then(|| at(l, k + 1)).flatten();
            let below = l.checked_sub(1).and_then(|other| opposite(l, k, other));
            let above = (l + 1 < lines.len())
                .then(|| opposite(l, k, l + 1))
                .flatten();
            let along = after.unwrap_or(here) - before.unwrap_or(here);
            let across = above.unwrap_or(here) - below.unwrap_or(here);
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

/// Turns normals so that neighbours agree: from a start in each connected region along the minimum spanning tree of
/// the angles between normals, in 32 classes, over the neighbour graph (Hoppe et al. 1992), then each region as a whole so that most of it
/// looks away from its middle. Exact on clean surfaces; at sharp edges and between thin walls it may err.
/// O(n).
pub fn orient(points: &[DVec3], normals: &mut [DVec3], neighbours: &NeighbourTable) {
    let links = symmetric_links(neighbours, points.len());
    let mut seen = vec![false; points.len()];
    // Links to follow, by disagreement; a bucket holds a range of it, the last link found is followed first.
    let mut buckets: Vec<Vec<(u32, u32)>> = vec![Vec::new(); BUCKETS];
    for start in (0..u32::MAX).take(points.len()) {
        if seen[start as usize] {
            continue;
        }
        let mut region = Vec::new();
        let mut next = Some((start, start));
        while let Some((to, from)) = next {
            let (at, before) = (to as usize, from as usize);
            if !seen[at] {
                seen[at] = true;
                if normals[before].dot(normals[at]) < 0.0 {
                    normals[at] = -normals[at];
                }
                region.push(at);
                for &other in links.of(at) {
                    if !seen[other as usize] {
                        let agreement = normals[at].dot(normals[other as usize]).abs();
                        buckets[bucket(agreement)].push((other, to));
                    }
                }
            }
            next = buckets.iter_mut().find_map(Vec::pop);
        }
        let middle = region.iter().map(|&k| points[k]).sum::<DVec3>() / region.len() as f64;
        let outward: f64 = region
            .iter()
            .map(|&k| (points[k] - middle).dot(normals[k]))
            .sum();
        if outward < 0.0 {
            for k in region {
                normals[k] = -normals[k];
            }
        }
    }
}

/// Number of classes of disagreement between two normals.
const BUCKETS: usize = 32;

/// The class of |cos| of the angle between two normals: even steps of the sine, so that small angles differ.
fn bucket(agreement: f64) -> usize {
    let sine = (1.0 - agreement * agreement).max(0.0).sqrt();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and BUCKETS"
    )]
    let class = (sine * BUCKETS as f64) as usize;
    class.min(BUCKETS - 1)
}

/// Links in both directions, in compressed rows.
struct Links {
    starts: Vec<usize>,
    ends: Vec<u32>,
}

impl Links {
    fn of(&self, point: usize) -> &[u32] {
        &self.ends[self.starts[point]..self.starts[point + 1]]
    }
}

/// At most this many neighbours of a point carry orientation on.
const ORIENTATION_LINKS: usize = 8;

#[expect(
    clippy::cast_possible_truncation,
    reason = "neighbour tables hold at most 2^32 points"
)]
fn symmetric_links(neighbours: &NeighbourTable, count: usize) -> Links {
    let used = neighbours.count().min(ORIENTATION_LINKS);
    let pairs = || (0..count).flat_map(|k| neighbours.of(k)[..used].iter().map(move |&j| (k, j)));
    let mut starts = vec![0_usize; count + 1];
    for (k, j) in pairs() {
        starts[k + 1] += 1;
        starts[j as usize + 1] += 1;
    }
    for k in 0..count {
        starts[k + 1] += starts[k];
    }
    let mut next = starts.clone();
    let mut ends = vec![0_u32; starts[count]];
    for (k, j) in pairs() {
        ends[next[k]] = j;
        next[k] += 1;
        ends[next[j as usize]] = k as u32;
        next[j as usize] += 1;
    }
    Links { starts, ends }
}

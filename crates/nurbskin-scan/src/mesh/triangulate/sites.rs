//! Sites of a triangulation: points with normals, spacing, weights and neighbours, and the test for one sheet.
//!
//! Two points with the chord d and normals n and m on the same side lie on one sheet if the mean height ½ (n·d + m·d),
//! which is zero on a circular arc, is at most 0.35 |d| + 0.3 h, and the larger height at most 0.85 |d| + 0.1 h, with
//! h the spacing. Spacing and normals are measured on the sheets that the last round found. Small pseudo-random
//! weights make four points on one circle a regular case. Source: ours.

use super::SITE_CHUNK;
use super::sides;
use crate::normals::principal_axes;
use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::spatial::neighbours::{NeighbourTable, Neighbours};
use rayon::prelude::*;

/// Nearest neighbours of each point in the table; cells that they do not enclose get more. Trial: not recorded. A
/// Voronoi cell has six on average, of which a second wall nearby takes half.
const SITE_NEIGHBOURS: usize = 24;
/// Rank of the neighbour on the same sheet whose distance gives the spacing. Trial: not recorded. Nearer neighbours
/// scatter more.
const SITE_SPACING_NEIGHBOUR: usize = 12;
/// Neighbours on the same sheet that must be exceeded for a spacing by these to replace the first estimate. Trial: not
/// recorded.
const MIN_SPACING_NEIGHBOURS: f64 = 3.0;
/// Rounds in which sheets are separated and normals corrected; each uses the normals of the last. Trial: not recorded.
const SHEET_ROUNDS: usize = 2;
/// Nearest neighbours whose plane gives the normal of a point without one. Trial: not recorded.
const SITE_PLANE_POINTS: usize = 12;
/// Cosine of the angle between two oriented normals (105°) beyond which their points lie on different walls. Trial: not
/// recorded. The same as in cleaning: the faces of a box still meet with a margin of 15° for noise.
const OPPOSED_SITES_COSINE: f64 = -0.25;
/// Component along the normal of a triangle of the sum of its corners' normals (at most 3) above which they determine
/// its winding. Trial: not recorded.
const MIN_FACING_HEIGHT: f64 = 0.3;
/// Largest distance, in spacings, between two walls that meet across an edge without points of its own. Trial: not
/// recorded. Walls farther apart end at an opening, which larger values would close.
const MAX_EDGE_GAP: f64 = 1.2;
/// Absolute cosine between the normals of a triangle and of each corner (60°) below which it stands upright between two
/// walls. Trial: not recorded.
const UPRIGHT_COSINE: f64 = 0.5;
/// Nearest neighbours on the same sheet whose plane may correct a normal. Trial: not recorded. Few, since the normals
/// of wide neighbourhoods are the ones in error.
const CORRECTING_NEIGHBOURS: usize = 10;
/// Fewest neighbours that may do so. Guard: a plane takes three points, two more average its noise.
const MIN_CORRECTING_NEIGHBOURS: usize = 5;
/// Mean squared sine of the angle (10°) between neighbours and the plane of a normal above which the normal may be
/// corrected. Trial: not recorded. A smaller value follows noise.
const CORRECTION_SINE_SQUARED: f64 = 0.03;
/// Ratio of the squared heights above the new and the old plane below which the normal is corrected. Trial: not
/// recorded.
const CORRECTION_GAIN: f64 = 0.5;
/// Largest offset of one sheet per distance between two points; the offset is the mean height above both tangent
/// planes, which is zero on a circular arc. Trial: not recorded. Smaller values divide sheets at edges; larger ones
/// join walls.
const SHEET_OFFSET_SLOPE: f64 = 0.35;
/// Offset of one sheet that is admitted at any distance, in spacings. Trial: not recorded. It admits noise; walls
/// closer than about 1.5 spacings are joined.
const SHEET_OFFSET_SLACK: f64 = 0.3;
/// Largest height above either tangent plane per distance between two points of one sheet (58°). Trial: not recorded.
const SHEET_HEIGHT_SLOPE: f64 = 0.85;
/// Height that is admitted at any distance, in spacings. Trial: not recorded.
const SHEET_HEIGHT_SLACK: f64 = 0.1;
/// Largest weight of a site, in the squared distance to its nearest neighbour. Guard: large against rounding, so that
/// no four points lie on one circle; small enough to change the triangulation of such points only.
const SITE_WEIGHT: f64 = 0.01;

/// The points of a triangulation, sorted by coordinates.
#[derive(Debug)]
pub(super) struct Sites {
    pub(super) points: Vec<DVec3>,
    pub(super) normals: Vec<DVec3>,
    /// The side of the square that one point represents on the same sheet nearby.
    pub(super) spacing: Vec<f64>,
    /// Weights, as differences of squared distances, that perturb four points on one circle.
    pub(super) weights: Vec<f64>,
    /// Whether the normal of each point determines its side.
    pub(super) sided: Vec<bool>,
    pub(super) tree: Neighbours,
    pub(super) table: NeighbourTable,
}

impl Sites {
    pub(super) fn new(
        points: &[DVec3],
        normals: &[DVec3],
        oriented: bool,
        order: &[u32],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let points: Vec<DVec3> = order.iter().map(|&k| points[k as usize]).collect();
        let tree = Neighbours::new(&points);
        progress.check()?;
        let table = tree.table(SITE_NEIGHBOURS);
        progress.check()?;
        let normals = normals_of(&points, normals, order, &table);
        let mut this = Self {
            weights: vec![0.0; points.len()],
            spacing: vec![0.0; points.len()],
            sided: vec![false; points.len()],
            points,
            normals,
            tree,
            table,
        };
        if oriented {
            this.sided = sides::known(&this.points, &this.normals, &this.table);
        }
        this.measure(progress)?;
        Ok(this)
    }

    /// Computes weights, sheets, normals and spacings.
    fn measure(&mut self, progress: &dyn Progress) -> Result<()> {
        self.weights = by_index(self.points.len(), |k| {
            let nearest = self.table.of(k).first();
            let nearest =
                nearest.map_or(0.0, |&j| self.points[k].distance(self.points[j as usize]));
            SITE_WEIGHT * nearest * nearest * scatter(k)
        });
        self.spacing = by_index(self.points.len(), |k| self.spacing_to(k, |_| true));
        for _ in 0..SHEET_ROUNDS {
            progress.check()?;
            self.normals = by_index(self.points.len(), |k| self.straightened(k));
            self.spacing = by_index(self.points.len(), |k| {
                self.spacing_to(k, |j| self.same_sheet(k, j))
            });
        }
        progress.check()?;
        // At a border the neighbours fill half a disc, at most of their neighbours more: take the median.
        self.spacing = by_index(self.points.len(), |k| {
            let own = self.table.of(k).iter().map(|&j| j as usize);
            let own = own.filter(|&j| self.same_sheet(k, j));
            let mut values: Vec<f64> = own.chain([k]).map(|j| self.spacing[j]).collect();
            median_in_place(&mut values)
        });
        Ok(())
    }

    /// The spacing by the 12th neighbour that `belongs` to the sheet, or the last one if there are fewer.
    fn spacing_to(&self, k: usize, belongs: impl Fn(usize) -> bool) -> f64 {
        let row = self.table.of(k).iter().map(|&j| j as usize);
        let own = row.filter(|&j| belongs(j)).take(SITE_SPACING_NEIGHBOUR);
        let (count, last) = own.fold((0.0, None), |(count, _), j| (count + 1.0, Some(j)));
        match last {
            // A disc of that radius holds count + 1/2 points on average.
            Some(j) if count > MIN_SPACING_NEIGHBOURS || self.spacing[k] <= 0.0 => {
                self.points[k].distance(self.points[j])
                    * (std::f64::consts::PI / (count + 0.5)).sqrt()
            }
            _ => self.spacing[k],
        }
    }

    /// Offset of `j` from the surface that touches `i` with the curvature given by both normals: half the sum of its
    /// heights above both tangent planes, which have opposite signs on a circle. Also returns the greater height.
    fn offset(&self, i: usize, j: usize) -> (f64, f64) {
        let (n, mut m) = (self.normals[i], self.normals[j]);
        if n.dot(m) < 0.0 {
            m = -m;
        }
        let d = self.points[j] - self.points[i];
        let (here, there) = (n.dot(d), m.dot(d));
        (0.5 * (here + there), here.abs().max(there.abs()))
    }

    /// Whether the normals of two points have known and opposite sides.
    fn opposed(&self, i: usize, j: usize) -> bool {
        self.sided[i]
            && self.sided[j]
            && self.normals[i].dot(self.normals[j]) < OPPOSED_SITES_COSINE
    }

    /// A triangle wound to the side of its corners' normals; `None` if these do not determine it, or lie on two walls
    /// that meet at an edge.
    pub(super) fn facing(&self, triangle: [u32; 3]) -> Option<[u32; 3]> {
        let [a, b, c] = triangle;
        let [k, j, i] = triangle.map(|k| k as usize);
        if !(self.sided[k] && self.sided[j] && self.sided[i])
            || self.opposed(k, j)
            || self.opposed(j, i)
            || self.opposed(i, k)
        {
            return None;
        }
        let (p, q, r) = (self.points[k], self.points[j], self.points[i]);
        let area = (q - p).cross(r - p);
        let side = (self.normals[k] + self.normals[j] + self.normals[i]).dot(area);
        if side.abs() <= MIN_FACING_HEIGHT * area.length() {
            return None;
        }
        Some(if side > 0.0 { [a, b, c] } else { [a, c, b] })
    }

    /// Whether a triangle stands upright between two walls that are too far apart to meet there, as at the open end of
    /// a hollow part.
    pub(super) fn shuts(&self, triangle: [u32; 3]) -> bool {
        let [k, j, i] = triangle.map(|k| k as usize);
        let (p, q, r) = (self.points[k], self.points[j], self.points[i]);
        let plane = (q - p).cross(r - p).normalize_or_zero();
        let apart = |k: usize, j: usize| {
            let gap = (self.points[j] - self.points[k]).dot(self.normals[k]).abs();
            self.opposed(k, j) && gap > MAX_EDGE_GAP * self.spacing[k].max(self.spacing[j])
        };
        [k, j, i]
            .iter()
            .all(|&k| self.sided[k] && self.normals[k].dot(plane).abs() < UPRIGHT_COSINE)
            && (apart(k, j) || apart(j, i) || apart(i, k))
    }

    /// Whether `j` may lie on the sheet of `i` nearby.
    pub(super) fn same_sheet(&self, i: usize, j: usize) -> bool {
        if self.opposed(i, j) {
            return false;
        }
        let (offset, height) = self.offset(i, j);
        let length = self.points[i].distance(self.points[j]);
        let slack = self.spacing[i].max(self.spacing[j]);
        offset.abs() <= SHEET_OFFSET_SLOPE * length + SHEET_OFFSET_SLACK * slack
            && height <= SHEET_HEIGHT_SLOPE * length + SHEET_HEIGHT_SLACK * slack
    }

    /// The normal of a point, or that of the plane through its neighbours on the same sheet, if they lie much nearer to
    /// the latter. Where a wall bends or another one is close, normals of wide neighbourhoods are in error.
    fn straightened(&self, k: usize) -> DVec3 {
        let row = self.table.of(k).iter().map(|&j| j as usize);
        let own = row
            .filter(|&j| self.same_sheet(k, j))
            .take(CORRECTING_NEIGHBOURS);
        let around = own.map(|j| self.points[j] - self.points[k]);
        let normal = self.normals[k];
        let (mut count, mut above, mut total) = (0, 0.0, 0.0);
        for d in around.clone() {
            count += 1;
            above += d.dot(normal).powi(2);
            total += d.length_squared();
        }
        if count < MIN_CORRECTING_NEIGHBOURS || above < CORRECTION_SINE_SQUARED * total {
            return normal;
        }
        let (_, axes) = principal_axes(around.clone().chain(std::iter::once(DVec3::ZERO)));
        let plane = axes[0].1;
        let left: f64 = around.map(|d| d.dot(plane).powi(2)).sum();
        if left < CORRECTION_GAIN * above {
            plane * plane.dot(normal).signum()
        } else {
            normal
        }
    }
}

/// One value per point, in parallel.
pub(super) fn by_index<T: Send>(count: usize, value: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    (0..count)
        .into_par_iter()
        .with_min_len(SITE_CHUNK)
        .map(value)
        .collect()
}

/// Normals in the order of the sites; missing ones are computed from the neighbours.
fn normals_of(
    points: &[DVec3],
    normals: &[DVec3],
    order: &[u32],
    table: &NeighbourTable,
) -> Vec<DVec3> {
    let given = |k: u32| {
        let n = normals.get(k as usize).copied().unwrap_or_default();
        n.try_normalize().unwrap_or_default()
    };
    let mut own: Vec<DVec3> = order.iter().map(|&k| given(k)).collect();
    if own.contains(&DVec3::ZERO) {
        for (k, n) in own
            .iter_mut()
            .enumerate()
            .filter(|(_, n)| **n == DVec3::ZERO)
        {
            let near = table
                .of(k)
                .iter()
                .take(SITE_PLANE_POINTS)
                .map(|&j| points[j as usize]);
            let (_, axes) = principal_axes(near.chain(std::iter::once(points[k])));
            *n = axes[0].1;
        }
    }
    own
}

/// A pseudo-random number between 0 and 1 (the finaliser of `SplitMix64`).
fn scatter(k: usize) -> f64 {
    let mut z = (k as u64).wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

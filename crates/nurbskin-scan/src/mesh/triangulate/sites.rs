//! The points of a triangulation and what is known around each of them.

use super::CHUNK;
use super::sides;
use crate::normals::principal_axes;
use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::spatial::neighbours::{NeighbourTable, Neighbours};
use rayon::prelude::*;

/// Neighbours of each point that are looked at first.
const NEIGHBOURS: usize = 24;
/// The spacing is measured to this neighbour of the same sheet.
const SPACING_BY: usize = 12;
/// Rounds of telling sheets apart and straightening normals.
const ROUNDS: usize = 2;
/// Neighbours that make the plane of a point that comes without a normal.
const PLANE: usize = 12;
/// Cosine of the angle between two normals, 105 degrees, beyond which their points lie on different walls.
const OPPOSED: f64 = -0.25;
/// Height of the sum of its corners' normals above a triangle from which on they say which way it looks.
const CLEAR: f64 = 0.3;
/// Walls that look opposite ways meet across an edge that has no points of its own if they are no farther apart there
/// than so many spacings, ...
const MEET: f64 = 1.2;
/// ... and a triangle stands upright between them if it is that steep, 60 degrees, to the planes of all its corners.
const UPRIGHT: f64 = 0.5;
/// Neighbours on the same sheet that may overrule a normal.
const NEAREST: usize = 10;
/// Squared sine of the angle by which neighbours must leave the plane of a normal to overrule it.
const STEEP: f64 = 0.03;

/// Points in the order of their coordinates.
#[derive(Debug)]
pub(super) struct Sites {
    pub(super) points: Vec<DVec3>,
    pub(super) normals: Vec<DVec3>,
    /// The side of the square that one point stands for nearby on the same sheet.
    pub(super) spacing: Vec<f64>,
    /// Weights that make four points on one circle none: differences of squared distances, harmlessly small.
    pub(super) weights: Vec<f64>,
    /// Whether each point's normal says on which side of the surface it looks.
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
        let table = tree.table(NEIGHBOURS);
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

    /// Finds weights, sheets, normals and spacing.
    fn measure(&mut self, progress: &dyn Progress) -> Result<()> {
        self.weights = by_index(self.points.len(), |k| {
            let nearest = self.table.of(k).first();
            let nearest =
                nearest.map_or(0.0, |&j| self.points[k].distance(self.points[j as usize]));
            0.01 * nearest * nearest * scatter(k)
        });
        self.spacing = by_index(self.points.len(), |k| self.spacing_to(k, |_| true));
        for _ in 0..ROUNDS {
            progress.check()?;
            self.normals = by_index(self.points.len(), |k| self.straightened(k));
            self.spacing = by_index(self.points.len(), |k| {
                self.spacing_to(k, |j| self.same_sheet(k, j))
            });
        }
        progress.check()?;
        // A point at a border sees half of a disc; most of its neighbours see more.
        self.spacing = by_index(self.points.len(), |k| {
            let own = self.table.of(k).iter().map(|&j| j as usize);
            let own = own.filter(|&j| self.same_sheet(k, j));
            let mut values: Vec<f64> = own.chain([k]).map(|j| self.spacing[j]).collect();
            median_in_place(&mut values)
        });
        Ok(())
    }

    /// The spacing by the last of the first neighbours that `belongs`.
    fn spacing_to(&self, k: usize, belongs: impl Fn(usize) -> bool) -> f64 {
        let row = self.table.of(k).iter().map(|&j| j as usize);
        let own = row.filter(|&j| belongs(j)).take(SPACING_BY);
        let (count, last) = own.fold((0.0, None), |(count, _), j| (count + 1.0, Some(j)));
        match last {
            // A disc of that radius holds count + 1/2 points on average.
            Some(j) if count > 3.0 || self.spacing[k] <= 0.0 => {
                self.points[k].distance(self.points[j])
                    * (std::f64::consts::PI / (count + 0.5)).sqrt()
            }
            _ => self.spacing[k],
        }
    }

    /// How far `j` leaves the surface that touches `i` and is as curved as both normals say: half the sum of its heights
    /// above both tangent planes, which has opposite signs on a circle. Also the greater height.
    fn offset(&self, i: usize, j: usize) -> (f64, f64) {
        let (n, mut m) = (self.normals[i], self.normals[j]);
        if n.dot(m) < 0.0 {
            m = -m;
        }
        let d = self.points[j] - self.points[i];
        let (here, there) = (n.dot(d), m.dot(d));
        (0.5 * (here + there), here.abs().max(there.abs()))
    }

    /// Whether two points are known to look to opposite sides.
    fn opposed(&self, i: usize, j: usize) -> bool {
        self.sided[i] && self.sided[j] && self.normals[i].dot(self.normals[j]) < OPPOSED
    }

    /// A triangle wound so that it looks to the side that its corners do; `None` where they do not say, or lie on two
    /// walls that meet at an edge.
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
        if side.abs() <= CLEAR * area.length() {
            return None;
        }
        Some(if side > 0.0 { [a, b, c] } else { [a, c, b] })
    }

    /// Whether a triangle stands upright between two walls that are too far apart to meet there: at the open end of a
    /// hollow part.
    pub(super) fn shuts(&self, triangle: [u32; 3]) -> bool {
        let [k, j, i] = triangle.map(|k| k as usize);
        let (p, q, r) = (self.points[k], self.points[j], self.points[i]);
        let plane = (q - p).cross(r - p).normalize_or_zero();
        let apart = |k: usize, j: usize| {
            let gap = (self.points[j] - self.points[k]).dot(self.normals[k]).abs();
            self.opposed(k, j) && gap > MEET * self.spacing[k].max(self.spacing[j])
        };
        [k, j, i]
            .iter()
            .all(|&k| self.sided[k] && self.normals[k].dot(plane).abs() < UPRIGHT)
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
        offset.abs() <= 0.35 * length + 0.3 * slack && height <= 0.85 * length + 0.1 * slack
    }

    /// The normal of a point, or that of the plane through its neighbours on the same sheet where these lie much nearer to
    /// it: where a wall turns or another one is close, normals of wide neighbourhoods go astray.
    fn straightened(&self, k: usize) -> DVec3 {
        let row = self.table.of(k).iter().map(|&j| j as usize);
        let own = row.filter(|&j| self.same_sheet(k, j)).take(NEAREST);
        let around = own.map(|j| self.points[j] - self.points[k]);
        let normal = self.normals[k];
        let (mut count, mut above, mut total) = (0, 0.0, 0.0);
        for d in around.clone() {
            count += 1;
            above += d.dot(normal).powi(2);
            total += d.length_squared();
        }
        if count < 5 || above < STEEP * total {
            return normal;
        }
        let (_, axes) = principal_axes(around.clone().chain(std::iter::once(DVec3::ZERO)));
        let plane = axes[0].1;
        let left: f64 = around.map(|d| d.dot(plane).powi(2)).sum();
        if left < 0.5 * above {
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
        .with_min_len(CHUNK)
        .map(value)
        .collect()
}

/// Normals in the order of the sites, those that are none found from the neighbours.
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
            let near = table.of(k).iter().take(PLANE).map(|&j| points[j as usize]);
            let (_, axes) = principal_axes(near.chain(std::iter::once(points[k])));
            *n = axes[0].1;
        }
    }
    own
}

/// A number between 0 and 1 that looks random (the finaliser of `SplitMix64`).
fn scatter(k: usize) -> f64 {
    let mut z = (k as u64).wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

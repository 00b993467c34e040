//! An m x n array of points.

use crate::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// An array of `count_u` x `count_v` points Q_{i,j}, i along u and j along v; u runs fastest in memory, so that a
/// row (a line of constant v) is contiguous. It serves as ordered scan and, as [`ControlNet`](crate::ControlNet),
/// as the control points of a surface.
///
/// All coordinates are finite; no invalid value exists.
///
/// ```
/// use nurbskin_geometry::{DVec3, PointGrid};
/// let grid = PointGrid::from_fn(3, 2, |i, j| DVec3::new(i as f64, j as f64, 0.0))?;
/// assert_eq!(grid.point(2, 1), DVec3::new(2.0, 1.0, 0.0));
/// assert_eq!(grid.row(1).len(), 3);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct PointGrid {
    count_u: usize,
    count_v: usize,
    points: Vec<DVec3>,
}

/// A grid as it is stored, not yet checked.
#[derive(Deserialize)]
struct Stored {
    count_u: usize,
    count_v: usize,
    points: Vec<DVec3>,
}

impl TryFrom<Stored> for PointGrid {
    type Error = Error;

    fn try_from(stored: Stored) -> Result<Self> {
        Self::new(stored.count_u, stored.count_v, stored.points)
    }
}

impl PointGrid {
    /// A grid from its points, u fastest.
    ///
    /// # Errors
    /// [`Error::Invalid`] if `points` does not hold `count_u * count_v` points, there are none, or one is not finite.
    pub fn new(count_u: usize, count_v: usize, points: Vec<DVec3>) -> Result<Self> {
        if count_u == 0 || count_v == 0 {
            return Err(Error::invalid(format!(
                "a {count_u} x {count_v} grid has no points"
            )));
        }
        if count_u.checked_mul(count_v) != Some(points.len()) {
            return Err(Error::invalid(format!(
                "a {count_u} x {count_v} grid needs {} points, not {}",
                count_u.saturating_mul(count_v),
                points.len()
            )));
        }
        if let Some(k) = points.iter().position(|p| !p.is_finite()) {
            return Err(Error::invalid(format!(
                "point {k} of the grid is not finite"
            )));
        }
        Ok(Self {
            count_u,
            count_v,
            points,
        })
    }

    /// A grid of points that are known to be finite and as many as they should.
    pub fn from_finite(count_u: usize, count_v: usize, points: Vec<DVec3>) -> Self {
        debug_assert!(count_u > 0 && count_u * count_v == points.len());
        Self {
            count_u,
            count_v,
            points,
        }
    }

    /// A grid from a function of (i, j).
    ///
    /// # Errors
    /// As [`PointGrid::new`].
    pub fn from_fn(
        count_u: usize,
        count_v: usize,
        f: impl Fn(usize, usize) -> DVec3,
    ) -> Result<Self> {
        let points = (0..count_v)
            .flat_map(|j| (0..count_u).map(move |i| (i, j)))
            .map(|(i, j)| f(i, j))
            .collect();
        Self::new(count_u, count_v, points)
    }

    /// Number of points along u.
    #[must_use]
    pub fn count_u(&self) -> usize {
        self.count_u
    }
    /// Number of points along v.
    #[must_use]
    pub fn count_v(&self) -> usize {
        self.count_v
    }
    /// `[count_u, count_v]`.
    #[must_use]
    pub fn counts(&self) -> [usize; 2] {
        [self.count_u, self.count_v]
    }
    /// All points, u fastest.
    #[must_use]
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }
    /// All points, u fastest.
    #[must_use]
    pub fn into_points(self) -> Vec<DVec3> {
        self.points
    }
    /// Q_{i,j}.
    #[must_use]
    pub fn point(&self, i: usize, j: usize) -> DVec3 {
        self.points[j * self.count_u + i]
    }
    /// The points Q_{0,j} .. Q_{m,j} of constant v.
    #[must_use]
    pub fn row(&self, j: usize) -> &[DVec3] {
        &self.points[j * self.count_u..(j + 1) * self.count_u]
    }
    /// The points Q_{i,0} .. Q_{i,n} of constant u.
    pub fn column(&self, i: usize) -> impl ExactSizeIterator<Item = DVec3> + '_ {
        (0..self.count_v).map(move |j| self.point(i, j))
    }
    /// The same points with u and v exchanged.
    #[must_use]
    pub fn transposed(&self) -> Self {
        let points = (0..self.count_u).flat_map(|i| self.column(i)).collect();
        Self {
            count_u: self.count_v,
            count_v: self.count_u,
            points,
        }
    }
    /// The grid of the lines `keep_u` x `keep_v`, in that order.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a list is empty or an index is out of range.
    pub fn select(&self, keep_u: &[usize], keep_v: &[usize]) -> Result<Self> {
        if keep_u.iter().any(|&i| i >= self.count_u) || keep_v.iter().any(|&j| j >= self.count_v) {
            return Err(Error::invalid("a selected grid line does not exist"));
        }
        let points = keep_v
            .iter()
            .flat_map(|&j| keep_u.iter().map(move |&i| (i, j)))
            .map(|(i, j)| self.point(i, j));
        Self::new(keep_u.len(), keep_v.len(), points.collect())
    }
    /// The points mapped by `f`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a mapped point is not finite.
    pub fn map(&self, f: impl Fn(DVec3) -> DVec3) -> Result<Self> {
        Self::new(
            self.count_u,
            self.count_v,
            self.points.iter().map(|&p| f(p)).collect(),
        )
    }
    /// Smallest axis-parallel box: its two corners.
    #[must_use]
    pub fn bounding_box(&self) -> [DVec3; 2] {
        bounding_box(&self.points)
    }
}

/// Corners of the smallest axis-parallel box around `points`; inverted infinities for none.
#[must_use]
pub fn bounding_box(points: &[DVec3]) -> [DVec3; 2] {
    points
        .iter()
        .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[lo, hi], &p| {
            [lo.min(p), hi.max(p)]
        })
}

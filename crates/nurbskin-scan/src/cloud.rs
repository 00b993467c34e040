//! Points, and what the file said about their order.

use glam::DVec3;
use nurbskin_geometry::unit::{Unit, UnitSource};
use nurbskin_geometry::{Error, Result};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// A scan as read: every point of the file in its order, not yet judged. Records of the file that stand for no point,
/// the empty cells of range grids, are left out and kept in [`records`](Self::records).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Scan {
    /// The points in file order, relative to [`origin`](Self::origin); may hold non-finite ones, which cleaning
    /// rejects by index.
    pub points: Vec<DVec3>,
    /// Which records of the file hold the points.
    pub records: Records,
    /// What was subtracted from the file's coordinates: zero unless they are large against the extent.
    pub origin: DVec3,
    /// What the file says of the order of its points.
    pub organisation: Organisation,
    /// One normal per point, where the file has them.
    pub normals: Option<Vec<DVec3>>,
    /// Where the scanner stood, as far as the file says, by ascending first point; relative to [`origin`](Self::origin).
    pub viewpoints: Vec<Viewpoint>,
    /// Unit of the coordinates.
    pub unit: Unit,
    /// Where the unit was learnt from.
    pub unit_source: UnitSource,
    /// Short name of the file format: `ply`, `stl`, `obj`, `xyz`, `csv`.
    pub format: Cow<'static, str>,
    /// Assumptions made while reading, for the user.
    pub warnings: Vec<String>,
}

impl Scan {
    /// The same scan with its coordinates in another unit.
    #[must_use]
    pub fn in_unit(mut self, unit: Unit) -> Self {
        if self.unit != unit {
            let factor = self.unit.millimetres() / unit.millimetres();
            self.points.iter_mut().for_each(|p| *p *= factor);
            self.viewpoints.iter_mut().for_each(|v| v.place *= factor);
            self.origin *= factor;
            self.unit = unit;
        }
        self
    }

    /// The smallest and the largest coordinates of its finite points, as the file has them; `None` without any.
    #[must_use]
    pub fn corners(&self) -> Option<[[f64; 3]; 2]> {
        let finite = self.points.iter().filter(|p| p.is_finite());
        let mut points = finite.map(|&p| p + self.origin);
        let first = points.next()?;
        let (low, high) = points.fold((first, first), |(low, high), p| (low.min(p), high.max(p)));
        Some([low.to_array(), high.to_array()])
    }

    /// Where the scanner stood that saw a point. O(log n) in the viewpoints.
    #[must_use]
    pub fn seen_from(&self, point: usize) -> Option<DVec3> {
        let after = self.viewpoints.partition_point(|v| v.first <= point);
        Some(self.viewpoints.get(after.checked_sub(1)?)?.place)
    }

    /// Whether its records, its order and its normals are of the points that it has.
    ///
    /// # Errors
    /// [`Error::Invalid`] if not.
    pub fn validate(&self) -> Result<()> {
        let count = self.points.len();
        if self.organisation.is_of(count)
            && self.normals.as_ref().is_none_or(|n| n.len() == count)
            && self.records.is_of(count)
        {
            return Ok(());
        }
        Err(Error::invalid(format!(
            "the scan contradicts itself: its {}, its normals or its records do not match its {count} points",
            self.organisation.name()
        )))
    }
}

/// Which records of a file hold the points of a scan. A record is what stands for a point in the format: a vertex, a line
/// of coordinates, a cell of a range grid, or a distinct corner of an STL file; they are counted from 0 through the file.
///
/// Takes four bytes per point where some records hold no point, else nothing.
///
/// ```
/// use nurbskin_scan::Records;
/// let records = Records::new(vec![0, 2, 3], 6)?;
/// assert_eq!(records.of(1), 2);
/// assert_eq!(records.empty().collect::<Vec<_>>(), [1, 4, 5]);
/// assert_eq!(Records::default().of(1), 1);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Records {
    /// The record of each point, ascending; empty where every record holds a point.
    of_points: Vec<u32>,
    /// Number of records of the file; 0 where `of_points` is empty.
    total: u32,
}

impl Records {
    /// The records of points in a file of `total` records.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the records are not strictly ascending, one of them is not below `total`, or `total` is above
    /// 4294967295.
    pub fn new(of_points: Vec<u32>, total: usize) -> Result<Self> {
        let Ok(most) = u32::try_from(total) else {
            return Err(Error::invalid("more than 4294967295 records"));
        };
        let this = match of_points.is_empty() {
            true => Self::default(),
            false => Self {
                of_points,
                total: most,
            },
        };
        if !this.is_sound() {
            return Err(Error::invalid(
                "the records of the points are not in order, or not in the file",
            ));
        }
        // As many as there are, in order: each its own index.
        Ok(match this.of_points.len() == total {
            true => Self::default(),
            false => this,
        })
    }

    /// The record of a point.
    #[must_use]
    pub fn of(&self, point: u32) -> u32 {
        self.of_points.get(point as usize).copied().unwrap_or(point)
    }

    /// Number of records that hold no point. O(1).
    #[must_use]
    pub fn empty_count(&self) -> usize {
        self.total as usize - self.of_points.len()
    }

    /// The records that hold no point, ascending. O(total) to run through.
    pub fn empty(&self) -> impl Iterator<Item = u32> + '_ {
        let mut filled = self.of_points.iter().peekable();
        (0..self.total).filter(move |record| filled.next_if_eq(&record).is_none())
    }

    /// The records without those of the missing points, of which there is one flag per point.
    pub(crate) fn without(self, missing: &[bool]) -> Self {
        let kept = (0_u32..).zip(missing).filter(|(_, missing)| !**missing);
        let of_points: Vec<u32> = kept.map(|(point, _)| self.of(point)).collect();
        let total = match self.of_points.is_empty() {
            true => missing.len(),
            false => self.total as usize,
        };
        // Some of records in order are in order.
        Self::new(of_points, total).unwrap_or_default()
    }

    /// Whether they can be those of a file.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        match self.of_points.last() {
            None => self.total == 0,
            Some(&last) => {
                last < self.total && self.of_points.is_sorted_by(|before, after| before < after)
            }
        }
    }

    /// Whether they are sound and of `count` points.
    fn is_of(&self, count: usize) -> bool {
        self.is_sound() && (self.of_points.is_empty() || self.of_points.len() == count)
    }
}

/// Where the scanner stood for the points from one on, until the next viewpoint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Viewpoint {
    /// Index of the first point.
    pub first: usize,
    /// Place of the scanner.
    pub place: DVec3,
}

/// How the points of a scan are ordered.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Organisation {
    /// No order.
    #[default]
    Unordered,
    /// Consecutive scan lines (rows of constant v) with these numbers of points, which add up to all points.
    Rows(Vec<usize>),
    /// An m x n array, possibly with empty cells.
    Grid(GridLayout),
    /// Triangles between the points.
    Mesh(Vec<[u32; 3]>),
}

impl Organisation {
    /// The name in the JSON contract: `unordered`, `rows`, `grid` or `mesh`.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Organisation::Unordered => "unordered",
            Organisation::Rows(_) => "rows",
            Organisation::Grid(_) => "grid",
            Organisation::Mesh(_) => "mesh",
        }
    }

    /// Whether the points are in order: rows or a grid.
    #[must_use]
    pub fn is_ordered(&self) -> bool {
        matches!(self, Organisation::Rows(_) | Organisation::Grid(_))
    }

    /// Whether it orders `count` points and names no other.
    fn is_of(&self, count: usize) -> bool {
        let exists = |&point: &u32| (point as usize) < count;
        match self {
            Organisation::Unordered => true,
            Organisation::Rows(lengths) => {
                let all = lengths
                    .iter()
                    .try_fold(0_usize, |sum, &n| sum.checked_add(n));
                all == Some(count)
            }
            Organisation::Grid(grid) => {
                grid.count_u.checked_mul(grid.count_v) == Some(grid.cells.len())
                    && grid.cells.iter().flatten().all(exists)
            }
            Organisation::Mesh(triangles) => triangles.iter().flatten().all(exists),
        }
    }
}

/// Which point lies in which cell of an m x n array.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GridLayout {
    /// Points along u (in a row).
    pub count_u: usize,
    /// Number of rows.
    pub count_v: usize,
    /// Index of the point in each cell, u fastest; `None` where the cell is empty.
    pub cells: Vec<Option<u32>>,
}

impl GridLayout {
    /// A grid without empty cells whose points lie in the file in grid order; `None` for more than 2^32 points.
    #[must_use]
    pub fn complete(count_u: usize, count_v: usize) -> Option<Self> {
        let count = u32::try_from(count_u.checked_mul(count_v)?).ok()?;
        Some(Self {
            count_u,
            count_v,
            cells: (0..count).map(Some).collect(),
        })
    }
    /// Number of empty cells.
    #[must_use]
    pub fn empty(&self) -> usize {
        self.cells.iter().filter(|cell| cell.is_none()).count()
    }
}

/// A point that was not used, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rejected {
    /// Index of the point in the scan.
    pub index: usize,
    /// Why it was rejected.
    pub reason: Reason,
}

/// Why a point was rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// A coordinate is NaN or infinite.
    NonFinite,
    /// The same coordinates as an earlier point.
    Duplicate,
    /// Too far from its neighbours to belong to the surface.
    Outlier,
    /// In a separate part of the scan that got no surface.
    LeftOut,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_know_which_of_them_are_empty() {
        let all = Records::new((0..5).collect(), 5).unwrap();
        assert_eq!(all, Records::default());
        assert_eq!(
            (all.of(3), all.empty().count(), all.empty_count()),
            (3, 0, 0)
        );
        let some = all.without(&[false, true, false, false, true]);
        assert_eq!([0, 1, 2].map(|k| some.of(k)), [0, 2, 3]);
        assert_eq!(some.empty().collect::<Vec<_>>(), [1, 4]);
        assert_eq!(some.empty_count(), 2);
        // Once more, of what is left.
        let fewer = some.without(&[true, false, false]);
        assert_eq!(fewer.empty().collect::<Vec<_>>(), [0, 1, 4]);
        for (wrong, total) in [(vec![1, 1], 4), (vec![2, 1], 4), (vec![1, 4], 4)] {
            assert!(Records::new(wrong, total).is_err());
        }
    }
}

//! Points, and what the file said about their order.

use glam::DVec3;
use nurbskin_geometry::unit::{Unit, UnitSource};
use nurbskin_geometry::{Error, Result};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// A scan as read: every point of the file at its original index, not yet judged.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Scan {
    /// The points in file order, relative to [`origin`](Self::origin); may hold non-finite ones, which cleaning
    /// rejects by index.
    pub points: Vec<DVec3>,
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

    /// Whether its order and its normals are of the points that it has.
    ///
    /// # Errors
    /// [`Error::Invalid`] if not.
    pub fn validate(&self) -> Result<()> {
        let count = self.points.len();
        if self.organisation.is_of(count) && self.normals.as_ref().is_none_or(|n| n.len() == count)
        {
            return Ok(());
        }
        Err(Error::invalid(format!(
            "the scan contradicts itself: its {} or its normals do not match its {count} points",
            self.organisation.name()
        )))
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
    /// Index of the point in the file.
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

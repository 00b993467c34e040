//! E57, the exchange format of laser scanners, through `e57`.

use super::{far, grid};
use crate::{GridLayout, Organisation, Scan, Viewpoint};
use e57::{E57Reader, PointCloud, RawValues, Record, RecordDataType, RecordName};
use glam::{DMat3, DQuat, DVec3};
use nurbskin_geometry::math;
use nurbskin_geometry::unit::{Unit, UnitSource, grouped};
use nurbskin_geometry::{Error, Result};
use std::io::Cursor;
use std::path::Path;

/// A point of a real scanner has fewer parts.
const MOST_PARTS: usize = 64;
/// A grid with more cells than so many for each point is an index that lies.
const MOST_CELLS: usize = 16;

/// Reads all scans of an E57 file in metres, each moved by its pose. Points that the file marks as invalid are empty
/// cells of a grid, and elsewhere not finite, for cleaning to count. The points of a single scan with row and column indices are a grid, columns along u, whose cells without a
/// point are empty; several scans are one cloud without order.
///
/// # Errors
/// [`Error::Read`] naming the scan and the point.
pub(super) fn read(bytes: Vec<u8>, path: &Path) -> Result<Scan> {
    let problem = |at: String, e: &dyn std::fmt::Display| {
        let what = format!("{e}; copy or export the file again");
        Error::read(path, at, what.replace('\n', " "))
    };
    let size = bytes.len() as u64;
    let mut file = E57Reader::new(Cursor::new(bytes)).map_err(|e| problem("header".into(), &e))?;
    let clouds = file.pointclouds();
    let mut scan = Scan {
        format: "e57".into(),
        unit: Unit::Metre,
        unit_source: UnitSource::File,
        ..Scan::default()
    };
    // Everything relative to the place of the first scanner, so that far places cost no digits.
    let origin = clouds.first().map_or(DVec3::ZERO, |cloud| pose(cloud).1);
    let mut all = Gathered::default();
    for (k, cloud) in clouds.iter().enumerate() {
        let at = |n: u64| format!("scan {k}, point {n}");
        check(cloud, size).map_err(|what| problem(format!("scan {k}"), &what))?;
        let parts = Parts::of(cloud).map_err(|what| problem(format!("scan {k}"), &what))?;
        let (rotation, translation) = pose(cloud);
        let offset = translation - origin;
        let points = file
            .pointcloud_raw(cloud)
            .map_err(|e| problem(format!("scan {k}"), &e))?;
        let before = all.points.len();
        // Without a pose points need not be where the scanner saw them from.
        if cloud.transform.is_some() {
            scan.viewpoints.push(Viewpoint {
                first: before,
                place: offset,
            });
        }
        for (n, values) in (0..).zip(points) {
            all.take(&parts, &values.map_err(|e| problem(at(n), &e))?);
        }
        if clouds.len() == 1 && all.cells.len() == all.points.len() {
            all.organise(&mut scan);
        }
        for point in &mut all.points[before..] {
            *point = rotation * *point + offset;
        }
        for normal in all.normals.iter_mut().skip(before) {
            *normal = rotation * *normal;
        }
    }
    scan.points = all.points;
    if all.normals.len() == scan.points.len() && !scan.points.is_empty() {
        scan.normals = Some(all.normals);
    }
    if scan.viewpoints.len() != clouds.len() {
        scan.viewpoints.clear();
    }
    if all.invalid > 0 {
        scan.warnings.push(format!(
            "ignored points that the file marks as invalid: {}",
            all.invalid
        ));
    }
    if clouds.len() > 1 {
        scan.warnings.push(format!(
            "the file has {} scans: their points were merged, without their order",
            clouds.len()
        ));
    }
    far::place(&mut scan, origin);
    Ok(scan)
}

/// Refuses descriptions that need more memory or time than the file is worth.
fn check(cloud: &PointCloud, size: u64) -> std::result::Result<(), String> {
    let bits = |record: &Record| match record.data_type {
        RecordDataType::Single { .. } => 32,
        RecordDataType::Double { .. } => 64,
        RecordDataType::Integer { min, max } | RecordDataType::ScaledInteger { min, max, .. } => {
            u64::from(
                128 - (i128::from(max) - i128::from(min))
                    .unsigned_abs()
                    .leading_zeros(),
            )
        }
    };
    let each: u64 = cloud.prototype.iter().map(bits).sum();
    if cloud.prototype.len() > MOST_PARTS {
        return Err(format!(
            "each point has {} fields, more than any scanner writes",
            cloud.prototype.len()
        ));
    }
    let needed = u128::from(each) * u128::from(cloud.records);
    if cloud.records > 0 && (each == 0 || needed > 8 * u128::from(size)) {
        return Err(format!(
            "{} points are announced, which need more than the {size} bytes of the file: the count is wrong",
            cloud.records
        ));
    }
    Ok(())
}

/// Rotation and translation of a scan.
fn pose(cloud: &PointCloud) -> (DMat3, DVec3) {
    let Some(pose) = &cloud.transform else {
        return (DMat3::IDENTITY, DVec3::ZERO);
    };
    let (q, t) = (&pose.rotation, &pose.translation);
    let rotation = DQuat::from_xyzw(q.x, q.y, q.z, q.w);
    let length = rotation.length();
    let rotation = if length.is_normal() {
        DMat3::from_quat(rotation / length)
    } else {
        DMat3::IDENTITY
    };
    (rotation, DVec3::new(t.x, t.y, t.z))
}

/// A part of a point: its place among the values and its type.
type Part = (usize, RecordDataType);

/// Which parts say what.
struct Parts {
    place: [Part; 3],
    spherical: bool,
    invalid: Option<Part>,
    cell: Option<[Part; 2]>,
    normal: Option<[Part; 3]>,
}

impl Parts {
    fn of(cloud: &PointCloud) -> std::result::Result<Self, String> {
        let find = |wanted: &dyn Fn(&RecordName) -> bool| {
            let found = cloud.prototype.iter().position(|r| wanted(&r.name))?;
            Some((found, cloud.prototype.get(found)?.data_type.clone()))
        };
        let part = |name: RecordName| find(&|known| *known == name);
        let three = |[a, b, c]: [RecordName; 3]| Some([part(a)?, part(b)?, part(c)?]);
        let cartesian = three([
            RecordName::CartesianX,
            RecordName::CartesianY,
            RecordName::CartesianZ,
        ]);
        let polar = three([
            RecordName::SphericalRange,
            RecordName::SphericalAzimuth,
            RecordName::SphericalElevation,
        ]);
        let spherical = cartesian.is_none();
        let place = cartesian.or(polar).ok_or(
            "the points have neither cartesian nor spherical coordinates: this is not a scan",
        )?;
        let unknown = |wanted: &'static str| {
            find(&|known| matches!(known, RecordName::Unknown { name, .. } if name == wanted))
        };
        let normal = || {
            Some([
                unknown("normalX")?,
                unknown("normalY")?,
                unknown("normalZ")?,
            ])
        };
        let cell = || Some([part(RecordName::ColumnIndex)?, part(RecordName::RowIndex)?]);
        Ok(Self {
            place,
            spherical,
            invalid: part(if spherical {
                RecordName::SphericalInvalidState
            } else {
                RecordName::CartesianInvalidState
            }),
            cell: cell(),
            normal: normal(),
        })
    }
}

#[derive(Default)]
struct Gathered {
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    /// Column and row of each point, where all have them.
    cells: Vec<[i64; 2]>,
    invalid: usize,
}

impl Gathered {
    fn take(&mut self, parts: &Parts, values: &RawValues) {
        let real = |(at, kind): &Part| {
            let value = values.get(*at).and_then(|value| value.to_f64(kind).ok());
            value.unwrap_or(f64::NAN)
        };
        let whole = |(at, kind): &Part| values.get(*at).and_then(|value| value.to_i64(kind).ok());
        let state = parts.invalid.as_ref().and_then(whole);
        let invalid = state.is_some_and(|state| state != 0);
        if invalid {
            self.invalid += 1;
        }
        let [a, b, c] = [0, 1, 2].map(|k| real(&parts.place[k]));
        let local = if invalid {
            DVec3::NAN
        } else if parts.spherical {
            let (sine, cosine) = math::sin_cos(c);
            a * DVec3::new(cosine * math::cos(b), cosine * math::sin(b), sine)
        } else {
            DVec3::new(a, b, c)
        };
        self.points.push(local);
        if let Some(normal) = &parts.normal {
            let [x, y, z] = [0, 1, 2].map(|k| real(&normal[k]));
            self.normals.push(DVec3::new(x, y, z));
        }
        if let Some([column, row]) = &parts.cell
            && let (Some(column), Some(row)) = (whole(column), whole(row))
        {
            self.cells.push([column, row]);
        }
    }

    /// Puts the points into the cells that their indices name; `0 0 0` far from its neighbours is no point.
    fn organise(&mut self, scan: &mut Scan) {
        let Some(&first) = self.cells.first() else {
            return;
        };
        // 1. The size of the grid.
        let (low, high) = self.cells.iter().fold((first, first), |(low, high), cell| {
            let pair = |pick: fn(i64, i64) -> i64, known: [i64; 2]| {
                [pick(known[0], cell[0]), pick(known[1], cell[1])]
            };
            (pair(i64::min, low), pair(i64::max, high))
        });
        let size = |k: usize| {
            let size = high[k].checked_sub(low[k])?.checked_add(1)?;
            usize::try_from(size).ok()
        };
        let (Some(count_u), Some(count_v)) = (size(0), size(1)) else {
            return;
        };
        if count_u < 2 || count_v < 2 {
            return;
        }
        let most = self.points.len().saturating_mul(MOST_CELLS);
        let Some(count) = count_u.checked_mul(count_v).filter(|&n| n <= most) else {
            scan.warnings.push(format!(
                "the row and column indices make a grid of {count_u} x {count_v}, far more cells than points: they \
                 were ignored"
            ));
            return;
        };
        // 2. The point of each cell.
        let mut layout: Vec<Option<u32>> = vec![None; count];
        let mut taken = 0;
        for (k, [column, row]) in (0_u32..).zip(&self.cells) {
            let place = |value: i64, k: usize| usize::try_from(value - low[k]).unwrap_or(0);
            if !self.points[k as usize].is_finite() {
                continue;
            }
            match layout.get_mut(place(*row, 1) * count_u + place(*column, 0)) {
                Some(cell @ None) => *cell = Some(k),
                _ => taken += 1,
            }
        }
        if taken > 0 {
            scan.warnings.push(format!(
                "{taken} points share their row and column with another one: the order of the points was ignored"
            ));
            return;
        }
        // 3. Without zeros that are none; the others keep their order.
        let of_cell = |cell: &Option<u32>| cell.map_or(DVec3::NAN, |k| self.points[k as usize]);
        let by_cell: Vec<DVec3> = layout.iter().map(of_cell).collect();
        let zeros = grid::judge(&by_cell, count_u, count_v);
        let mut dropped: Vec<bool> = self.points.iter().map(|p| !p.is_finite()).collect();
        for (cell, _) in layout.iter_mut().zip(&zeros).filter(|(_, zero)| **zero) {
            if let Some(k) = cell.take() {
                dropped[k as usize] = true;
            }
        }
        let mut next = 0;
        let renumbered: Vec<u32> = dropped
            .iter()
            .map(|&dropped| {
                next += u32::from(!dropped);
                next.saturating_sub(1)
            })
            .collect();
        for cell in layout.iter_mut().flatten() {
            *cell = renumbered[*cell as usize];
        }
        let with_normals = self.normals.len() == self.points.len();
        grid::retain(&mut self.points, &dropped);
        scan.records = std::mem::take(&mut scan.records).without(&dropped);
        if with_normals {
            grid::retain(&mut self.normals, &dropped);
        }
        let empty = count - self.points.len();
        if empty > 0 {
            scan.warnings.push(format!(
                "{} of the {} cells of the {count_u} x {count_v} grid are empty",
                grouped(empty),
                grouped(count)
            ));
        }
        scan.organisation = Organisation::Grid(GridLayout {
            count_u,
            count_v,
            cells: layout,
        });
    }
}

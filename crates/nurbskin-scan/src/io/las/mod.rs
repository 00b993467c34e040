//! LAS and LAZ, the point clouds of airborne scanners.
//!
//! The header is read here: `las` reserves what the length of an extended record claims, which ends the process, and
//! hands out coordinates that are rounded where they are far from zero. `laz` unpacks the points, after the sizes
//! that it would trust were checked.

mod guard;
mod header;
mod packed;
mod unit;

use super::bytes::i32_at;
use super::far;
use crate::Scan;
use glam::{DVec3, I64Vec3};
use header::Header;
use nurbskin_geometry::unit::{Unit, UnitSource};
use nurbskin_geometry::{Error, Result};
use std::path::Path;

/// Reads the coordinates of a LAS or LAZ file, versions 1.0 to 1.4.
///
/// They are whole numbers times a scale plus an offset. Where that is far from zero, a whole number is subtracted
/// first, and what it stands for is the origin of the scan: no digit is lost.
///
/// # Errors
/// [`Error::Read`] naming the byte or the point; [`Error::Unsupported`] for compressions that are not known.
pub(super) fn read(bytes: Vec<u8>, path: &Path) -> Result<Scan> {
    let header = Header::of(&bytes, path)?;
    let mut scan = Scan {
        format: if header.compressed { "laz" } else { "las" }.into(),
        unit: Unit::Metre,
        ..Scan::default()
    };
    unit::find(&mut scan, &header, &bytes);
    let raw = if header.compressed {
        packed::unpack(bytes, &header, path)?
    } else {
        plain(&bytes, &header, path)?
    };
    place(&mut scan, &raw, &header);
    Ok(scan)
}

/// The whole numbers of points that are not compressed.
fn plain(bytes: &[u8], header: &Header, path: &Path) -> Result<Vec<[i32; 3]>> {
    let data = bytes.get(header.start..).unwrap_or_default();
    let held = data.len() / header.record;
    let count = usize::try_from(header.count)
        .ok()
        .filter(|&n| n <= held)
        .ok_or_else(|| {
            let what = format!(
                "{} points are announced, but the file ends after {held}: it is truncated or the count is wrong; copy \
                 or export it again",
                header.count
            );
            Error::read(path, format!("point {held}"), what)
        })?;
    let records = data.chunks_exact(header.record).take(count);
    Ok(records.filter_map(coordinates).collect())
}

/// The three numbers that every record begins with.
fn coordinates(record: &[u8]) -> Option<[i32; 3]> {
    Some([i32_at(record, 0)?, i32_at(record, 4)?, i32_at(record, 8)?])
}

/// Scales the whole numbers, relative to an origin near them.
fn place(scan: &mut Scan, raw: &[[i32; 3]], header: &Header) {
    let vector = |p: &[i32; 3]| I64Vec3::from_array(p.map(i64::from));
    let Some(first) = raw.first().map(vector) else {
        return;
    };
    // 1. A whole unit in the middle of the points, if the scale makes one.
    let (low, high) = raw
        .iter()
        .map(vector)
        .fold((first, first), |(low, high), p| (low.min(p), high.max(p)));
    let middle = (0.5 * (low + high).as_dvec3() * header.scale + header.offset).round();
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a number that is too large saturates, and any origin is right"
    )]
    let whole = |value: f64| value.round().clamp(-4.0e9, 4.0e9) as i64;
    let steps = (middle - header.offset) / header.scale;
    let base = I64Vec3::new(whole(steps.x), whole(steps.y), whole(steps.z));
    let origin = base.as_dvec3() * header.scale + header.offset;
    // 2. Is it far? Otherwise the numbers as the file means them.
    let extent = ((high - low).as_dvec3() * header.scale).length();
    let far = origin
        .to_array()
        .map(|c| extent > 0.0 && c.abs() > far::FAR * extent);
    let choose = |far: bool, base: i64, origin: f64, offset: f64| {
        if far {
            (base, 0.0, origin)
        } else {
            (0, offset, 0.0)
        }
    };
    let [x, y, z] = [0, 1, 2].map(|k| choose(far[k], base[k], origin[k], header.offset[k]));
    let base = I64Vec3::new(x.0, y.0, z.0);
    let offset = DVec3::new(x.1, y.1, z.1);
    scan.points = raw
        .iter()
        .map(|p| (vector(p) - base).as_dvec3() * header.scale + offset)
        .collect();
    far::keep(scan, DVec3::new(x.2, y.2, z.2));
}

/// Says what was assumed of the unit.
fn assume(scan: &mut Scan, what: &str) {
    scan.warnings.push(what.to_owned());
}

/// Takes a unit that the file states.
fn state(scan: &mut Scan, unit: Unit) {
    scan.unit = unit;
    scan.unit_source = UnitSource::File;
}

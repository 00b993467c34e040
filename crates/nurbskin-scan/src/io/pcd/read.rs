//! The reader of PCD.

use super::super::bytes::u32_at;
use super::super::grid::{Zero, organise};
use super::super::lines::{lines, number, shown};
use super::super::scan::take_unit;
use super::header::{Data, Field, Header};
use super::lzf;
use crate::{Scan, Viewpoint};
use glam::DVec3;
use nurbskin_geometry::{Error, Result};
use std::path::Path;

/// Reads a PCD file of any version: the fields x, y, z and normal_x, normal_y, normal_z of any type. A cloud of more
/// than one row is a grid, rows along u; NaN in all coordinates and, where no neighbour is near, `0 0 0` are its empty
/// cells. The viewpoint is where the sensor was: points are in the coordinates of the world already.
///
/// # Errors
/// [`Error::Read`] naming the line or byte.
#[expect(clippy::doc_markdown, reason = "names of fields")]
pub fn read(bytes: &[u8], path: &Path) -> Result<Scan> {
    let mut header = Header::of(bytes, path)?;
    let body = &bytes[header.body..];
    let mut scan = Scan {
        format: "pcd".into(),
        warnings: std::mem::take(&mut header.warnings),
        ..Scan::default()
    };
    for comment in &header.comments {
        take_unit(&mut scan, comment);
    }
    let [x, y] = ["x", "y"].map(|name| header.field(name));
    let (Some(x), Some(y)) = (x, y) else {
        let what =
            "there is no field x or y: the points have no coordinates; export them with x, y and z";
        return Err(Error::read(path, "header", what));
    };
    let z = header.field("z");
    if z.is_none() {
        scan.warnings
            .push("the points have no field z: 0 was used".to_owned());
    }
    let normal = ["normal_x", "normal_y", "normal_z"].map(|name| header.field(name));
    let with_normals = normal.iter().all(Option::is_some);
    let slots = [Some(x), Some(y), z, normal[0], normal[1], normal[2]];
    let slots = &slots[..if with_normals { 6 } else { 3 }];
    let mut points = Points::new(with_normals);
    match header.data {
        Data::Ascii => points.ascii(&header, body, slots, path)?,
        Data::Binary => points.binary(&header, body, slots, path)?,
        Data::Compressed => points.compressed(&header, body, slots, path)?,
    }
    scan.warnings.extend(points.warnings);
    scan.points = points.points;
    scan.normals = points.normals;
    // Clouds that never had a sensor say that it was at the origin.
    let is_image = header.width > 1 && header.height > 1;
    let seen_from = header.viewpoint.filter(|p| is_image || *p != DVec3::ZERO);
    scan.viewpoints = seen_from
        .filter(|p| p.is_finite())
        .map(|place| Viewpoint { first: 0, place })
        .into_iter()
        .collect();
    if is_image {
        organise(&mut scan, header.width, header.height, Zero::Judged);
    }
    Ok(scan)
}

struct Points {
    points: Vec<DVec3>,
    normals: Option<Vec<DVec3>>,
    warnings: Vec<String>,
}

impl Points {
    /// Nothing is reserved before the file has shown that it is long enough.
    fn new(with_normals: bool) -> Self {
        Self {
            points: Vec::new(),
            normals: with_normals.then(Vec::new),
            warnings: Vec::new(),
        }
    }

    fn reserve(&mut self, count: usize) {
        self.points.reserve_exact(count);
        if let Some(normals) = &mut self.normals {
            normals.reserve_exact(count);
        }
    }

    #[inline]
    fn push(&mut self, [x, y, z, nx, ny, nz]: [f64; 6]) {
        self.points.push(DVec3::new(x, y, z));
        if let Some(normals) = &mut self.normals {
            normals.push(DVec3::new(nx, ny, nz));
        }
    }

    fn ascii(
        &mut self,
        header: &Header,
        body: &[u8],
        slots: &[Option<&Field>],
        path: &Path,
    ) -> Result<()> {
        // Each number takes a digit and a separator.
        check(header, header.columns.checked_mul(2), body.len() + 1, path)?;
        self.reserve(header.points);
        // The slot of each column up to the last one needed.
        let needed = slots.iter().flatten().map(|f| f.column + 1).max();
        let mut columns = vec![None; needed.unwrap_or(0)];
        for (slot, field) in slots.iter().enumerate() {
            if let Some(field) = field {
                columns[field.column] = Some(slot);
            }
        }
        for (line_number, line) in lines(body) {
            if line.is_empty() || line.starts_with(b"#") {
                continue;
            }
            if self.points.len() == header.points {
                self.warnings.push(format!(
                    "ignored what follows the {} points announced",
                    header.points
                ));
                return Ok(());
            }
            let at = |what: String| {
                let line = header.lines + line_number;
                let what = format!("{what}; correct the line or export the file again");
                Err(Error::read(path, format!("line {line}"), what))
            };
            let mut values = [0.0; 6];
            let mut found = 0;
            let words = line
                .split(u8::is_ascii_whitespace)
                .filter(|word| !word.is_empty());
            for (slot, word) in columns.iter().zip(words) {
                found += 1;
                let Some(slot) = *slot else { continue };
                match number(word) {
                    Some(value) => values[slot] = value,
                    None => return at(format!("\"{}\" is not a number", shown(word))),
                }
            }
            if found < columns.len() {
                return at(format!(
                    "a line needs {} numbers, this one has {found}",
                    header.columns
                ));
            }
            self.push(values);
        }
        if self.points.len() < header.points {
            let what = format!(
                "{} points are announced, but there are {}: the file is truncated or the count is wrong; export it \
                 again",
                header.points,
                self.points.len()
            );
            return Err(Error::read(path, "", what));
        }
        Ok(())
    }

    fn binary(
        &mut self,
        header: &Header,
        body: &[u8],
        slots: &[Option<&Field>],
        path: &Path,
    ) -> Result<()> {
        let needed = check(header, Some(header.stride), body.len(), path)?;
        // Files that were once mapped into memory end with zeros.
        if body[needed..].iter().any(|&b| b != 0) {
            self.warnings.push(format!(
                "ignored {} bytes after the last point",
                body.len() - needed
            ));
        }
        if header.stride == 0 {
            return Ok(());
        }
        self.reserve(header.points);
        for record in body[..needed].chunks_exact(header.stride) {
            let mut values = [0.0; 6];
            for (value, field) in values.iter_mut().zip(slots) {
                if let Some(field) = field {
                    *value = field.number.read(record, field.offset, false);
                }
            }
            self.push(values);
        }
        Ok(())
    }

    fn compressed(
        &mut self,
        header: &Header,
        body: &[u8],
        slots: &[Option<&Field>],
        path: &Path,
    ) -> Result<()> {
        let damaged = |at: usize, what: String| {
            let what = format!("{what}; export the file again");
            Error::read(path, format!("byte {}", header.body + at), what)
        };
        let size = |at: usize| u32_at(body, at).and_then(|n| usize::try_from(n).ok());
        let (Some(packed), Some(unpacked)) = (size(0), size(4)) else {
            return Err(damaged(0, "the file ends before its points".to_owned()));
        };
        let needed = header.stride.checked_mul(header.points);
        if needed == Some(0) {
            return Ok(());
        }
        let data = body[8..].get(..packed).ok_or_else(|| {
            let what = format!(
                "{packed} bytes of compressed points are announced, but the file has {}: it is truncated",
                body.len() - 8
            );
            damaged(0, what)
        })?;
        if needed != Some(unpacked) || unpacked > packed.saturating_mul(lzf::MOST) {
            let what = format!(
                "{packed} bytes cannot hold the {} points of {} bytes announced: a count is wrong",
                header.points, header.stride
            );
            return Err(damaged(4, what));
        }
        let columns = lzf::unpack(data, unpacked)
            .map_err(|at| damaged(8 + at, "the compressed points are damaged".to_owned()))?;
        self.reserve(header.points);
        for k in 0..header.points {
            let mut values = [0.0; 6];
            for (value, field) in values.iter_mut().zip(slots) {
                if let Some(field) = field {
                    // Field after field, each with all of its points.
                    let at = field.offset * header.points + k * field.number.size();
                    *value = field.number.read(&columns, at, false);
                }
            }
            self.push(values);
        }
        Ok(())
    }
}

/// The bytes that all points take.
///
/// # Errors
/// [`Error::Read`] if there are fewer.
fn check(header: &Header, each: Option<usize>, available: usize, path: &Path) -> Result<usize> {
    let needed = each.and_then(|each| each.checked_mul(header.points));
    needed.filter(|&needed| needed <= available).ok_or_else(|| {
        let what = format!(
            "{} points are announced, which need more than the {available} bytes of data that the file has: it is \
             truncated or the count is wrong; export it again",
            header.points
        );
        Error::read(path, "header", what)
    })
}

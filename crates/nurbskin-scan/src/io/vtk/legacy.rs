//! The legacy format: a text header before each array, whose numbers are text or big-endian.

use super::super::bytes::Number;
use super::super::grid;
use super::super::grid::Zero;
use super::super::lines::{number, shown};
use super::super::scan::take_unit;
use super::{AGAIN, Kind, Mesh, index, points_of};
use crate::{Organisation, Scan};
use nurbskin_geometry::{Error, Result};
use std::path::Path;

/// Reads the content of a legacy VTK file, versions 1 to 5.1, text or binary: `POLYDATA`, the surface cells of an
/// `UNSTRUCTURED_GRID`, and a `STRUCTURED_GRID` of one layer as a grid. Polygons become fans of triangles; of the data
/// of points only the normals are read.
///
/// # Errors
/// [`Error::Read`] naming the line or the byte; [`Error::Unsupported`] for images and volumes.
pub(in super::super) fn read(bytes: &[u8], path: &Path) -> Result<Scan> {
    let mut reader = Reader {
        bytes,
        at: 0,
        binary: false,
        after: "the header",
    };
    reader.scan().map_err(|problem| match problem {
        Problem::Damaged(what) => {
            let at = if reader.binary {
                format!("byte {} ({})", reader.at, reader.after)
            } else {
                let before = bytes.get(..reader.at).unwrap_or(bytes);
                let line = 1 + before.iter().filter(|&&b| b == b'\n').count();
                format!("line {line} ({})", reader.after)
            };
            Error::read(path, at, what)
        }
        Problem::Unfit(what) => Error::Unsupported(format!("{}: {what}", path.display())),
    })
}

enum Problem {
    Damaged(String),
    Unfit(String),
}

impl From<String> for Problem {
    fn from(what: String) -> Self {
        Self::Damaged(what)
    }
}

type Outcome<T> = std::result::Result<T, Problem>;

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    binary: bool,
    /// The array that is being read.
    after: &'static str,
}

/// What the file says its points are.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Dataset {
    Poly,
    Unstructured,
    Structured,
}

/// The corners of cells, and where each cell begins among them; the last offset is the end.
#[derive(Default)]
struct Cells {
    offsets: Vec<f64>,
    corners: Vec<f64>,
}

impl<'a> Reader<'a> {
    fn scan(&mut self) -> Outcome<Scan> {
        // 1. Three lines: the magic, which was seen, a title and the encoding.
        self.line();
        let title = String::from_utf8_lossy(self.line()).into_owned();
        let encoding = self.line();
        self.binary = match encoding {
            b"ASCII" => false,
            b"BINARY" => true,
            _ => {
                return Err(Problem::Damaged(format!(
                    "\"{}\" where ASCII or BINARY is expected; {AGAIN}",
                    shown(encoding)
                )));
            }
        };
        let mut titled = Scan::default();
        take_unit(&mut titled, &title);
        let unit = (titled.unit_source == nurbskin_geometry::unit::UnitSource::File)
            .then_some(titled.unit);
        // 2. The kind of dataset.
        let words = self.heading();
        let dataset = match words.as_slice() {
            [b"DATASET", b"POLYDATA", ..] => Dataset::Poly,
            [b"DATASET", b"UNSTRUCTURED_GRID", ..] => Dataset::Unstructured,
            [b"DATASET", b"STRUCTURED_GRID", ..] => Dataset::Structured,
            [b"DATASET", other, ..] => {
                return Err(Problem::Unfit(format!(
                    "a VTK dataset of the type {} is not a surface: export it as POLYDATA",
                    shown(other)
                )));
            }
            _ => {
                return Err(Problem::Damaged(format!(
                    "the line DATASET is missing; {AGAIN}"
                )));
            }
        };
        self.arrays(dataset, unit)
    }

    /// The arrays after the line `DATASET`, in any order.
    fn arrays(&mut self, dataset: Dataset, unit: Option<nurbskin_geometry::Unit>) -> Outcome<Scan> {
        let mut mesh = Mesh::default();
        let mut dimensions = None;
        let (mut cells, mut kinds) = (Cells::default(), Vec::new());
        let mut all: Vec<(Kind, Cells)> = Vec::new();
        loop {
            let words = self.heading();
            let Some(&keyword) = words.first() else {
                break;
            };
            let count = |k: usize| {
                let word: &[u8] = words.get(k).copied().unwrap_or_default();
                whole(word)
                    .ok_or_else(|| Problem::Damaged(format!("\"{}\" is not a count", shown(word))))
            };
            match keyword.to_ascii_uppercase().as_slice() {
                b"POINTS" => {
                    self.after = "POINTS";
                    let numbers = count(1)?.saturating_mul(3);
                    let values = self.values(numbers, kind_of(words.get(2))?)?;
                    mesh.points = points_of(&values);
                }
                b"POLYGONS" => {
                    let found = self.cells("POLYGONS", count(1)?, count(2)?)?;
                    all.push((Kind::Polygon, found));
                }
                b"TRIANGLE_STRIPS" => {
                    let found = self.cells("TRIANGLE_STRIPS", count(1)?, count(2)?)?;
                    all.push((Kind::Strip, found));
                }
                b"VERTICES" | b"LINES" => {
                    let found = self.cells("VERTICES or LINES", count(1)?, count(2)?)?;
                    all.push((Kind::Thin, found));
                }
                b"CELLS" => cells = self.cells("CELLS", count(1)?, count(2)?)?,
                b"CELL_TYPES" => {
                    self.after = "CELL_TYPES";
                    kinds = self.values(count(1)?, Some(Number::I32))?;
                }
                b"DIMENSIONS" => dimensions = Some([count(1)?, count(2)?, count(3)?]),
                b"METADATA" => self.metadata(),
                b"FIELD" => self.field(count(2)?)?,
                b"POINT_DATA" => {
                    // What follows are data, of which only the normals count: geometry is complete.
                    mesh.normals = self.normals(mesh.points.len());
                    break;
                }
                b"CELL_DATA" => {
                    // Normals of points may come after those of cells.
                    let found = self.skip_to_point_data();
                    if found {
                        mesh.normals = self.normals(mesh.points.len());
                    }
                    break;
                }
                _ => {
                    return Err(Problem::Damaged(format!(
                        "unknown keyword \"{}\": an array is shorter or longer than announced, or the file is damaged; \
                         {AGAIN}",
                        shown(keyword)
                    )));
                }
            }
        }
        self.after = "cells";
        for (kind, cells) in &all {
            mesh.cells(0, &cells.offsets, &cells.corners, |_| *kind)?;
        }
        if dataset == Dataset::Unstructured {
            let announced = cells.offsets.len().saturating_sub(1);
            if kinds.len() != announced {
                return Err(Problem::Damaged(format!(
                    "{announced} cells and {} cell types: each cell needs one; {AGAIN}",
                    kinds.len()
                )));
            }
            let kind = |k: usize| kinds.get(k).map_or(Kind::Other, |&kind| surface_kind(kind));
            quadratic(&mut cells, &kinds);
            mesh.cells(0, &cells.offsets, &cells.corners, kind)?;
        }
        let mut scan = mesh.into_scan(unit);
        if dataset == Dataset::Structured {
            structured(&mut scan, dimensions)?;
        }
        scan.format = "vtk".into();
        Ok(scan)
    }

    /// What is left of the line, without white space around it; the next line is what follows.
    fn line(&mut self) -> &'a [u8] {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let end = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        self.at += (end + 1).min(rest.len());
        rest[..end].trim_ascii()
    }

    /// The words of the next line that is not blank; none at the end of the file.
    fn heading(&mut self) -> Vec<&'a [u8]> {
        self.skip_blanks();
        let line = self.line();
        let words = line.split(u8::is_ascii_whitespace);
        words.filter(|word| !word.is_empty()).take(8).collect()
    }

    fn skip_blanks(&mut self) {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        self.at += rest.len() - rest.trim_ascii_start().len();
    }

    /// Whether this word comes next, after white space.
    fn sees(&self, word: &[u8]) -> bool {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        rest.trim_ascii_start().starts_with(word)
    }

    /// Reads a given count of numbers. `kind` is how binary ones are stored; `None` means bits.
    fn values(&mut self, count: usize, kind: Option<Number>) -> Outcome<Vec<f64>> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        // A number of a text takes a digit and a separator.
        let needed = match (self.binary, kind) {
            (false, _) => count.saturating_mul(2).saturating_sub(1),
            (true, Some(kind)) => count.saturating_mul(kind.size()),
            (true, None) => count.div_ceil(8),
        };
        if needed > rest.len() {
            return Err(Problem::Damaged(format!(
                "{count} numbers are announced, which need at least {needed} bytes, but only {} follow: the file is \
                 truncated or the count is wrong; {AGAIN}",
                rest.len()
            )));
        }
        if self.binary {
            self.at += needed;
            let Some(kind) = kind else {
                return Ok(Vec::new());
            };
            let value = |k: usize| kind.read(rest, k * kind.size(), true);
            return Ok((0..count).map(value).collect());
        }
        let mut values = Vec::with_capacity(count);
        for k in 0..count {
            self.skip_blanks();
            let rest = self.bytes.get(self.at..).unwrap_or_default();
            let end = rest.iter().position(u8::is_ascii_whitespace);
            let word = &rest[..end.unwrap_or(rest.len())];
            let Some(value) = number(word) else {
                return Err(Problem::Damaged(if word.is_empty() {
                    format!("the file ends after {k} of {count} numbers: it is truncated; {AGAIN}")
                } else {
                    format!("\"{}\" is not a number", shown(word))
                }));
            };
            self.at += word.len();
            values.push(value);
        }
        Ok(values)
    }

    /// Cells: up to version 4 as lists that each begin with their length, later as offsets and corners.
    fn cells(&mut self, after: &'static str, count: usize, size: usize) -> Outcome<Cells> {
        self.after = after;
        if self.sees(b"OFFSETS") {
            let mut arrays = [Vec::new(), Vec::new()];
            for (array, (name, count)) in arrays
                .iter_mut()
                .zip([(b"OFFSETS".as_slice(), count), (b"CONNECTIVITY", size)])
            {
                let words = self.heading();
                if words.first() != Some(&name) {
                    return Err(Problem::Damaged(format!(
                        "the array {} is missing; {AGAIN}",
                        String::from_utf8_lossy(name)
                    )));
                }
                *array = self.values(count, kind_of(words.get(1))?)?;
            }
            let [offsets, corners] = arrays;
            return Ok(Cells { offsets, corners });
        }
        let list = self.values(size, Some(Number::I32))?;
        // A cell takes its length at least.
        if count > size {
            return Err(Problem::Damaged(format!(
                "{count} cells cannot be in a list of {size} numbers; {AGAIN}"
            )));
        }
        let mut cells = Cells {
            offsets: Vec::with_capacity(count + 1),
            corners: Vec::with_capacity(size - count),
        };
        cells.offsets.push(0.0);
        let mut rest = &list[..];
        for k in 0..count {
            let cell = rest.split_first().and_then(|(&length, after)| {
                let length = index(length, after.len() + 1)?;
                after.split_at_checked(length)
            });
            let Some((corners, after)) = cell else {
                return Err(Problem::Damaged(format!(
                    "the list of cells ends in cell {k} of {count}; {AGAIN}"
                )));
            };
            cells.corners.extend_from_slice(corners);
            cells.offsets.push(cells.corners.len() as f64);
            rest = after;
        }
        Ok(cells)
    }

    /// Notes about the array before them, up to a blank line.
    fn metadata(&mut self) {
        while self.at < self.bytes.len() && !self.line().is_empty() {}
    }

    /// So many arrays with names, which nobody needs.
    fn field(&mut self, arrays: usize) -> Outcome<()> {
        self.after = "FIELD";
        for _ in 0..arrays {
            let mut words = self.heading();
            while words.first() == Some(&b"METADATA".as_slice()) {
                self.metadata();
                words = self.heading();
            }
            let count = |k: usize| words.get(k).and_then(|word| whole(word));
            let size = count(1).zip(count(2)).and_then(|(a, b)| a.checked_mul(b));
            let (Some(size), true) = (size, words.len() >= 4) else {
                return Err(Problem::Damaged(format!(
                    "an array of the FIELD is not described; {AGAIN}"
                )));
            };
            self.values(size, kind_of(words.get(3))?)?;
        }
        Ok(())
    }

    /// Passes over the data of cells; whether those of points follow.
    fn skip_to_point_data(&mut self) -> bool {
        while let Some(keyword) = self.attribute(None) {
            if keyword == b"POINT_DATA" {
                return true;
            }
        }
        false
    }

    /// The normals among the data of so many points, if they are there and sound.
    fn normals(&mut self, count: usize) -> Option<Vec<glam::DVec3>> {
        loop {
            let before = self.at;
            let words = self.heading();
            if words.first() == Some(&b"NORMALS".as_slice()) {
                let kind = kind_of(words.get(2)).ok()?;
                let values = self.values(count.checked_mul(3)?, kind).ok()?;
                return Some(points_of(&values));
            }
            self.at = before;
            if self.attribute(Some(count))? == b"CELL_DATA" {
                return None;
            }
        }
    }

    /// Passes over one attribute of `count` points or, where that is absent, of cells; its keyword, or `None` at the
    /// end and where it cannot be passed over.
    fn attribute(&mut self, count: Option<usize>) -> Option<&'a [u8]> {
        let words = self.heading();
        let keyword = *words.first()?;
        let number = |k: usize| words.get(k).and_then(|word| whole(word));
        let kind = |k: usize| kind_of(words.get(k)).ok();
        let (per, kind) = match keyword {
            b"METADATA" => {
                self.metadata();
                return Some(keyword);
            }
            b"FIELD" => {
                self.field(number(2)?).ok()?;
                return Some(keyword);
            }
            b"POINT_DATA" | b"CELL_DATA" => return Some(keyword),
            b"LOOKUP_TABLE" => {
                let size = number(2)?.checked_mul(4)?;
                self.values(size, Some(Number::U8)).ok()?;
                return Some(keyword);
            }
            b"SCALARS" => {
                if self.sees(b"LOOKUP_TABLE") {
                    self.heading();
                }
                (number(3).unwrap_or(1), kind(2)?)
            }
            b"COLOR_SCALARS" => (number(2)?, Some(Number::U8)),
            b"VECTORS" | b"NORMALS" => (3, kind(2)?),
            b"TEXTURE_COORDINATES" => (number(2)?, kind(3)?),
            b"TENSORS" => (9, kind(2)?),
            b"TENSORS6" => (6, kind(2)?),
            b"GLOBAL_IDS" | b"PEDIGREE_IDS" | b"EDGE_FLAGS" => (1, kind(2)?),
            _ => return None,
        };
        // Text can be passed over without its count: a keyword is no number.
        if self.binary {
            self.values(count?.checked_mul(per)?, kind).ok()?;
        } else {
            loop {
                self.skip_blanks();
                let rest = self.bytes.get(self.at..).unwrap_or_default();
                let end = rest.iter().position(u8::is_ascii_whitespace);
                let word = &rest[..end.unwrap_or(rest.len())];
                if super::super::lines::number(word).is_none() {
                    break;
                }
                self.at += word.len();
            }
        }
        Some(keyword)
    }
}

/// A number without sign or fraction.
fn whole(word: &[u8]) -> Option<usize> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// How numbers of a type are stored; `None` for bits.
fn kind_of(word: Option<&&[u8]>) -> Outcome<Option<Number>> {
    let word: &[u8] = word.copied().unwrap_or_default();
    Ok(Some(match word.to_ascii_lowercase().as_slice() {
        b"bit" => return Ok(None),
        b"float" => Number::F32,
        b"double" => Number::F64,
        b"char" | b"signed_char" | b"vtktypeint8" => Number::I8,
        b"unsigned_char" | b"vtktypeuint8" => Number::U8,
        b"short" | b"vtktypeint16" => Number::I16,
        b"unsigned_short" | b"vtktypeuint16" => Number::U16,
        b"int" | b"vtkidtype" | b"vtktypeint32" => Number::I32,
        b"unsigned_int" | b"vtktypeuint32" => Number::U32,
        b"long" | b"vtktypeint64" => Number::I64,
        b"unsigned_long" | b"vtktypeuint64" => Number::U64,
        _ => {
            return Err(Problem::Damaged(format!(
                "\"{}\" is not a type of numbers that is read; export float or double",
                shown(word)
            )));
        }
    }))
}

/// What a cell of this type is (VTK File Formats, figures 2 and 3).
fn surface_kind(code: f64) -> Kind {
    match index(code, 256) {
        Some(1..=4 | 21 | 35 | 68) => Kind::Thin,
        Some(5 | 7 | 9 | 22 | 23 | 28 | 34) => Kind::Polygon,
        Some(6) => Kind::Strip,
        Some(8) => Kind::Pixel,
        _ => Kind::Other,
    }
}

/// Leaves the corners of curved triangles and quadrilaterals, without the points on their edges.
fn quadratic(cells: &mut Cells, kinds: &[f64]) {
    let straight = |kind: f64| match index(kind, 256) {
        Some(22 | 34) => Some(3),
        Some(23 | 28) => Some(4),
        _ => None,
    };
    if !kinds.iter().any(|&kind| straight(kind).is_some()) {
        return;
    }
    let mut kept = Cells {
        offsets: vec![0.0],
        corners: Vec::new(),
    };
    for (pair, &kind) in cells.offsets.windows(2).zip(kinds) {
        let count = cells.corners.len() + 1;
        let range = index(pair[0], count).zip(index(pair[1], count));
        // What contradicts itself is told by the caller.
        let Some(cell) = range.and_then(|(from, to)| cells.corners.get(from..to)) else {
            return;
        };
        let corners = straight(kind).unwrap_or(cell.len()).min(cell.len());
        kept.corners.extend_from_slice(&cell[..corners]);
        kept.offsets.push(kept.corners.len() as f64);
    }
    *cells = kept;
}

/// The points of a structured grid in their order.
fn structured(scan: &mut Scan, dimensions: Option<[usize; 3]>) -> Outcome<()> {
    let Some([x, y, z]) = dimensions else {
        return Err(Problem::Damaged(format!(
            "the line DIMENSIONS is missing; {AGAIN}"
        )));
    };
    let count = x.checked_mul(y).and_then(|xy| xy.checked_mul(z));
    if count != Some(scan.points.len()) {
        return Err(Problem::Damaged(format!(
            "the grid of {x} x {y} x {z} needs another number of points than the {} of the file; {AGAIN}",
            scan.points.len()
        )));
    }
    scan.organisation = Organisation::Unordered;
    let mut sides = [x, y, z].into_iter().filter(|&n| n > 1);
    match (sides.next(), sides.next(), sides.next()) {
        (Some(m), Some(n), None) => grid::organise(scan, m, n, Zero::Point),
        (_, _, None) => {}
        _ => {
            return Err(Problem::Unfit(format!(
                "a structured grid of {x} x {y} x {z} points is a volume: export one layer of it, or its surface as \
                 POLYDATA"
            )));
        }
    }
    Ok(())
}

//! PTX, the gridded scans of Leica's programs: per scan the size of its grid, the scanner's place, and a line per cell.

use super::far;
use super::grid::{Zero, organise};
use super::lines::{lines, number, shown};
use crate::{Records, Scan, Viewpoint};
use glam::{DMat3, DVec3};
use nurbskin_geometry::unit::{Unit, grouped};
use nurbskin_geometry::{Error, Result};
use std::path::Path;

/// Reads all scans of a PTX file, each moved by its transformation. The points of a single scan keep their grid, with
/// the rows of the scanner along u; `0 0 0` is an empty cell. Several scans are one cloud without order, whose points know
/// where the scanner stood.
///
/// # Errors
/// [`Error::Read`] naming the line.
pub fn read(bytes: &[u8], path: &Path) -> Result<Scan> {
    let mut reader = Reader {
        lines: lines(bytes),
        line_number: 0,
        size: bytes.len(),
    };
    let mut scans = Vec::new();
    loop {
        match reader.scan() {
            Ok(Some(scan)) => scans.push(scan),
            Ok(None) => break,
            Err(what) => {
                let at = format!("line {}", reader.line_number);
                let what = format!("{what}; correct the file or export it again");
                return Err(Error::read(path, at, what));
            }
        }
    }
    let mut scan = Scan {
        format: "ptx".into(),
        unit: Unit::Metre,
        warnings: vec!["PTX files do not say their unit: metres assumed, as is usual".to_owned()],
        ..Scan::default()
    };
    let several = scans.len() > 1;
    if several {
        scan.warnings.push(format!(
            "the file has {} scans: their points were merged, without their order",
            scans.len()
        ));
    }
    // Everything relative to the place of the first scanner, so that far places cost no digits.
    let origin = scans.first().map_or(DVec3::ZERO, |scan| scan.translation);
    // Cells so far, and those of several scans that hold a point.
    let mut cells = 0;
    let mut filled = Vec::new();
    for part in scans {
        let offset = part.translation - origin;
        let moved = |p: DVec3| part.rotation * p + offset;
        scan.viewpoints.push(Viewpoint {
            first: scan.points.len(),
            place: offset,
        });
        if several {
            for (k, point) in (cells..).zip(&part.points) {
                if *point != DVec3::ZERO && !point.is_nan_mask().all() {
                    scan.points.push(moved(*point));
                    filled.push(u32::try_from(k).unwrap_or(u32::MAX));
                }
            }
            cells += part.points.len();
        } else {
            scan.points = part.points;
            organise(&mut scan, part.rows, part.columns, Zero::Missing);
            for point in &mut scan.points {
                *point = moved(*point);
            }
        }
    }
    if cells > filled.len() {
        let missing = grouped(cells - filled.len());
        scan.warnings
            .push(format!("empty cells of the grid: {missing}"));
        scan.records = Records::new(filled, cells)
            .map_err(|error| Error::read(path, "", format!("{error}; split the file")))?;
    }
    far::place(&mut scan, origin);
    Ok(scan)
}

/// One scan of the file.
struct Part {
    columns: usize,
    rows: usize,
    rotation: DMat3,
    translation: DVec3,
    /// The cells, rows fastest.
    points: Vec<DVec3>,
}

struct Reader<I> {
    lines: I,
    line_number: usize,
    size: usize,
}

impl<'a, I: Iterator<Item = (usize, &'a [u8])>> Reader<I> {
    /// The next line that is not blank.
    fn line(&mut self) -> Option<&'a [u8]> {
        let (line_number, line) = self.lines.find(|(_, line)| !line.is_empty())?;
        self.line_number = line_number;
        Some(line)
    }

    /// A line of at least `N` numbers.
    #[inline]
    fn numbers<const N: usize>(&mut self) -> std::result::Result<[f64; N], String> {
        let line = self.line().ok_or("the file ends here: it is truncated")?;
        let mut words = line
            .split(u8::is_ascii_whitespace)
            .filter(|word| !word.is_empty());
        let mut values = [0.0; N];
        for value in &mut values {
            let word = words.next().unwrap_or_default();
            *value = number(word).ok_or_else(|| {
                format!(
                    "{N} numbers are expected here, but \"{}\" is not one",
                    shown(word)
                )
            })?;
        }
        Ok(values)
    }

    /// The next scan; `None` at the end of the file.
    fn scan(&mut self) -> std::result::Result<Option<Part>, String> {
        let count = |line: &[u8], what: &str| {
            std::str::from_utf8(line)
                .ok()
                .and_then(|line| line.parse::<usize>().ok())
                .ok_or_else(|| format!("\"{}\" is not a number of {what} of a scan", shown(line)))
        };
        // 1. The size of the grid. The first line may be missing, if the file has ended.
        let Some(line) = self.line() else {
            return Ok(None);
        };
        let columns = count(line, "columns")?;
        let line = self.line().ok_or("the file ends here: it is truncated")?;
        let rows = count(line, "rows")?;
        let cells = columns.checked_mul(rows);
        // A cell takes three digits and three separators.
        let Some(cells) = cells.filter(|&cells| cells <= self.size / 6 + 1) else {
            return Err(format!(
                "{columns} x {rows} cells are announced, which need more than the {} bytes of the file: it is \
                 truncated or a count is wrong",
                self.size
            ));
        };
        // 2. The scanner's place, which the transformation repeats: rows of a matrix that points stand before.
        for _ in 0..4 {
            self.numbers::<3>()?;
        }
        let mut rows_of_matrix = [DVec3::ZERO; 4];
        for row in &mut rows_of_matrix {
            let [x, y, z, _] = self.numbers::<4>()?;
            *row = DVec3::new(x, y, z);
        }
        let [x, y, z, translation] = rows_of_matrix;
        // 3. The cells.
        let mut points = Vec::with_capacity(cells);
        for k in 0..cells {
            let [x, y, z] = self
                .numbers::<3>()
                .map_err(|what| format!("{what} (point {k} of {cells})"))?;
            points.push(DVec3::new(x, y, z));
        }
        Ok(Some(Part {
            columns,
            rows,
            rotation: DMat3::from_cols(x, y, z),
            translation,
            points,
        }))
    }
}

//! The reader of delimited text.

use super::super::grid;
use super::super::lines::{lines, shown};
use super::super::scan::take_unit;
use super::columns::{Columns, is_unit};
use super::separator::{Quoted, Style};
use crate::{Organisation, Scan};
use glam::DVec3;
use nurbskin_geometry::unit::UnitSource;
use nurbskin_geometry::{Error, Result};
use std::path::Path;

/// Lines from which separator and columns are told.
const SAMPLE: usize = 64;

/// Reads delimited text: one point per line, separated by commas, semicolons, tabs or blanks.
///
/// A line of column names, a first line with the number of points, comments after `#` or `//` and decimal commas are
/// understood. Blank lines between groups of two and more points each separate scan lines. Cells that are empty or
/// NaN make points that are not finite. Without names the first three columns are x, y, z, and three columns of unit
/// vectors the normal; further columns are ignored with a warning.
///
/// # Errors
/// [`Error::Read`] naming the line.
pub fn read(bytes: &[u8], path: &Path) -> Result<Scan> {
    let mut reader = Reader::prepare(bytes, path)?;
    for (line_number, line) in lines(bytes) {
        if line_number < reader.first {
            reader.comment(line);
            continue;
        }
        if line.is_empty() {
            reader.end_group();
            continue;
        }
        if reader.quoted.is_none() && reader.take(reader.style.fields(line)).is_ok() {
            continue;
        }
        reader.take_carefully(line).map_err(|what| {
            let what = format!("{what}; correct the line or export the file again");
            Error::read(path, format!("line {line_number}"), what)
        })?;
    }
    reader.into_scan(path)
}

struct Reader {
    style: Style,
    columns: Columns,
    /// Number of the first line with a point.
    first: usize,
    /// Cuts the lines where fields may be quoted.
    quoted: Option<Quoted>,
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    /// Numbers of points between blank lines.
    groups: Vec<usize>,
    /// Points before the current group.
    grouped: usize,
    announced: Option<usize>,
    /// Our writer's notes: the size of a grid, the number of rows.
    grid: Option<[usize; 2]>,
    rows: Option<usize>,
    scan: Scan,
}

/// Whether a line is a comment.
fn is_comment(line: &[u8]) -> bool {
    line.starts_with(b"#") || line.starts_with(b"//")
}

/// A line without the comment at its end.
fn uncommented(line: &[u8]) -> &[u8] {
    match line.iter().position(|&b| b == b'#') {
        Some(at) => line[..at].trim_ascii_end(),
        None => line,
    }
}

/// The number of points, where a line holds nothing else.
fn count_in(line: &[u8]) -> Option<usize> {
    std::str::from_utf8(line).ok()?.parse().ok()
}

impl Reader {
    /// Tells count, names, separator and columns from the first lines.
    fn prepare(bytes: &[u8], path: &Path) -> Result<Self> {
        let mut sample = lines(bytes)
            .filter(|(_, line)| !line.is_empty() && !is_comment(line))
            .map(|(number, line)| (number, uncommented(line)))
            .take(SAMPLE)
            .peekable();
        let before = sample.peek().map_or(usize::MAX, |&(number, _)| number);
        let commented = lines(bytes)
            .take_while(|&(number, _)| number < before)
            .filter(|(_, line)| is_comment(line))
            .last()
            .map(|(_, line)| line);
        let sample: Vec<(usize, &[u8])> = sample.collect();
        let mut rest = sample.as_slice();
        let style = Style::of(&rest.iter().map(|&(_, line)| line).collect::<Vec<_>>());
        let mut announced = None;
        let mut names = None;
        let mut named_in = String::new();
        for _ in 0..2 {
            let Some(&(number, line)) = rest.first() else {
                break;
            };
            if announced.is_none() && rest.len() > 1 && count_in(line).is_some() {
                announced = count_in(line);
                rest = &rest[1..];
            } else if names.is_none() && is_header(style, line) {
                names = Some(style.all_fields(line));
                named_in = format!("line {number}");
                rest = &rest[1..];
            }
        }
        if let Some(&(number, line)) = sample.first()
            && !rest.iter().any(|&(_, line)| !is_header(style, line))
            && (!rest.is_empty()
                || names
                    .as_ref()
                    .is_some_and(|n| Columns::named(n) == Ok(None)))
        {
            let what = format!(
                "\"{}\" is not a line of numbers: each line needs x, y and z; is this a file of points?",
                shown(line)
            );
            return Err(Error::read(path, format!("line {number}"), what));
        }
        let first = rest.first().map_or(usize::MAX, |&(number, _)| number);
        let mut width = rest
            .first()
            .map_or(3, |&(_, line)| style.all_fields(line).len());
        if style.separator.is_some()
            && rest
                .iter()
                .all(|(_, line)| line.last() == style.separator.as_ref())
        {
            // A separator ends every line.
            width -= usize::from(width > 3);
        }
        let mut scan = Scan {
            format: if style.separator.is_some() && style.separator != Some(b'\t') {
                "csv".into()
            } else {
                "xyz".into()
            },
            ..Scan::default()
        };
        let from_comment = || {
            let words = commented?.trim_ascii_start();
            let words = words
                .iter()
                .position(|b| !b"#/ \t".contains(b))
                .map(|at| style.all_fields(&words[at..]))?;
            let columns = Columns::named(&words).ok().flatten()?;
            (words.len() == width).then_some(columns)
        };
        let columns = match names {
            Some(names) => Columns::named(&names).map_err(|missing| {
                let what =
                    format!("the header line has no column {missing}; name the columns x, y and z");
                Error::read(path, named_in, what)
            })?,
            None => from_comment(),
        };
        let columns = columns.unwrap_or_else(|| {
            if first != usize::MAX && sample.len() > rest.len() + usize::from(announced.is_some()) {
                scan.warnings.push(
                    "the header line does not name x, y and z: the first three columns were used"
                        .to_owned(),
                );
            }
            let values: Vec<Vec<f64>> = rest
                .iter()
                .map(|(_, line)| {
                    let fields = style.all_fields(line);
                    // What is no number is no component of a unit vector.
                    let values = fields
                        .iter()
                        .map(|field| style.number(field).unwrap_or(9.0));
                    values.collect()
                })
                .collect();
            Columns::guessed(width, &values)
        });
        // What a column with a name holds is known: no need to warn of it.
        let used = columns.slots.iter().flatten().count();
        if !columns.named && width > used {
            scan.warnings.push(format!(
                "the columns have no names: {used} of {width} were used as x, y, z{}",
                if columns.normal {
                    " and the normal"
                } else {
                    ""
                }
            ));
        }
        if let Some(unit) = columns.unit {
            scan.unit = unit;
            scan.unit_source = UnitSource::File;
        }
        Ok(Reader {
            quoted: style.quoted.then(|| Quoted::new(style)),
            style,
            columns,
            first,
            points: Vec::new(),
            normals: Vec::new(),
            groups: Vec::new(),
            grouped: 0,
            announced,
            grid: None,
            rows: None,
            scan,
        })
    }

    /// Takes a point from fields; the first field that is no number, or the number of fields if there are too few.
    #[inline]
    fn take<'a>(
        &mut self,
        fields: impl Iterator<Item = &'a [u8]>,
    ) -> std::result::Result<(), Refused> {
        let mut values = [0.0; 6];
        let mut count = 0;
        for (slot, field) in self.columns.slots.iter().zip(fields) {
            count += 1;
            if let Some(slot) = slot {
                let Some(value) = self.style.number(field) else {
                    return Err(Refused::NoNumber(shown(field)));
                };
                values[usize::from(*slot)] = value;
            }
        }
        if count < self.columns.slots.len() {
            return Err(Refused::TooFew(count));
        }
        let [x, y, z, normal @ ..] = values;
        self.points.push(DVec3::new(x, y, z));
        if self.columns.normal {
            self.normals.push(DVec3::from_array(normal));
        }
        Ok(())
    }

    /// Takes a line that may be a comment, end with one, be quoted, or announce the points of the next block.
    fn take_carefully(&mut self, line: &[u8]) -> std::result::Result<(), String> {
        if is_comment(line) {
            self.comment(line);
            return Ok(());
        }
        let line = uncommented(line);
        if let (Some(sum), Some(more)) = (self.announced, count_in(line)) {
            self.announced = Some(sum.saturating_add(more));
            return Ok(());
        }
        // Set aside, because `take` borrows all of the reader.
        let outcome = match self.quoted.take() {
            None => self.take(self.style.fields(line)),
            Some(mut quoted) => {
                let fields = quoted.fields(line).ok_or("a quote is not closed")?;
                let outcome = self.take(fields);
                self.quoted = Some(quoted);
                outcome
            }
        };
        let needed = self.columns.slots.len();
        outcome.map_err(|refused| match refused {
            Refused::NoNumber(field) => format!("\"{field}\" is not a number"),
            Refused::TooFew(count) => {
                format!("a line needs {needed} numbers, this one has {count}")
            }
        })
    }

    /// Takes what a comment says of the unit and the order.
    fn comment(&mut self, line: &[u8]) {
        if !is_comment(line) {
            return;
        }
        let text = String::from_utf8_lossy(line);
        let text = text.trim_start_matches(['#', '/', ' ']);
        take_unit(&mut self.scan, text);
        let words: Vec<&str> = text.split_ascii_whitespace().take(5).collect();
        match words.as_slice() {
            ["grid", m, "x", n] => {
                self.grid = self
                    .grid
                    .or_else(|| Some([m.parse().ok()?, n.parse().ok()?]));
            }
            ["rows", n] => self.rows = self.rows.or_else(|| n.parse().ok()),
            _ => {}
        }
    }

    fn end_group(&mut self) {
        let length = self.points.len() - self.grouped;
        if length > 0 {
            self.groups.push(length);
            self.grouped = self.points.len();
        }
    }

    fn into_scan(mut self, path: &Path) -> Result<Scan> {
        self.end_group();
        let count = self.points.len();
        if let Some(announced) = self.announced {
            if announced > count {
                let what = format!(
                    "{announced} points are announced, but there are {count}: the file is truncated or the count is \
                     wrong; export it again"
                );
                return Err(Error::read(path, "", what));
            }
            if announced < count {
                self.scan.warnings.push(format!(
                    "{announced} points are announced, but the file has {count}: all were read"
                ));
            }
        }
        let mut scan = self.scan;
        if self.columns.normal {
            if self.columns.named || self.normals.iter().all(|n| is_unit(n.to_array())) {
                scan.normals = Some(self.normals);
            } else {
                scan.warnings.push(
                    "some columns look like normals at first, but not to the end: they were ignored".to_owned(),
                );
            }
        }
        scan.points = self.points;
        scan.organisation = match (self.grid, self.rows) {
            (Some([m, n]), _)
                if m.checked_mul(n) == Some(count) && u32::try_from(count).is_ok() =>
            {
                grid::organise(&mut scan, m, n, grid::Zero::Point);
                return Ok(scan);
            }
            (_, Some(rows)) if rows == self.groups.len() => Organisation::Rows(self.groups),
            _ if self.groups.len() >= 2 && self.groups.iter().all(|&length| length >= 2) => {
                Organisation::Rows(self.groups)
            }
            _ => Organisation::Unordered,
        };
        Ok(scan)
    }
}

/// Why a line was not taken.
enum Refused {
    NoNumber(String),
    TooFew(usize),
}

/// Whether a line holds names: no field begins like a number or is one, and not all are empty.
fn is_header(style: Style, line: &[u8]) -> bool {
    let fields = style.all_fields(line);
    let no_number = |field: &Vec<u8>| {
        field
            .first()
            .is_none_or(|b| !b.is_ascii_digit() && !b"+-.,".contains(b))
            && (field.is_empty() || style.number(field).is_none())
    };
    fields.iter().all(no_number) && fields.iter().any(|field| !field.is_empty())
}

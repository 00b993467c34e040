//! The header of a PCD file.

use super::super::bytes::Number;
use super::super::lines::{number, shown};
use glam::DVec3;
use nurbskin_geometry::{Error, Result};
use std::path::Path;

/// How the points are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Data {
    Ascii,
    Binary,
    Compressed,
}

/// A named part of a point.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) number: Number,
    pub(super) count: usize,
    /// Words of an ascii line before it.
    pub(super) column: usize,
    /// Bytes of a point before it.
    pub(super) offset: usize,
}

/// What the header says.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) fields: Vec<Field>,
    pub(super) columns: usize,
    /// Bytes of a point.
    pub(super) stride: usize,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) points: usize,
    pub(super) data: Data,
    /// Lines of the header.
    pub(super) lines: usize,
    /// The first byte of the points.
    pub(super) body: usize,
    /// Where the sensor was.
    pub(super) viewpoint: Option<DVec3>,
    pub(super) comments: Vec<String>,
    pub(super) warnings: Vec<String>,
}

/// No line of a header is longer, and no header has more lines.
const LONGEST: usize = 1 << 16;
const MOST_LINES: usize = 256;

/// The lines as they stand in the file.
#[derive(Default)]
struct Lines<'a> {
    fields: Vec<&'a [u8]>,
    sizes: Vec<&'a [u8]>,
    kinds: Vec<&'a [u8]>,
    counts: Vec<&'a [u8]>,
    width: Option<usize>,
    height: Option<usize>,
    points: Option<usize>,
    viewpoint: Option<DVec3>,
}

/// A count in a header.
fn whole(word: &[u8]) -> Option<usize> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

impl Header {
    /// The header of `bytes`. Of version .5 and .6, too, which know no viewpoint, and may leave out sizes and counts.
    pub(super) fn of(bytes: &[u8], path: &Path) -> Result<Self> {
        let mut found = Lines::default();
        let mut comments = Vec::new();
        let mut body = 0;
        for (k, line) in bytes
            .split_inclusive(|&b| b == b'\n')
            .take(MOST_LINES)
            .enumerate()
        {
            body += line.len();
            let at = |what: String| {
                let what = format!("{what}; correct the header or export the file again");
                Error::read(path, format!("line {}", k + 1), what)
            };
            if line.len() > LONGEST {
                return Err(at("a line of the header is too long".to_owned()));
            }
            let line = line.trim_ascii();
            if let Some(comment) = line.strip_prefix(b"#") {
                comments.push(String::from_utf8_lossy(comment).trim().to_owned());
                continue;
            }
            let mut words = line
                .split(u8::is_ascii_whitespace)
                .filter(|word| !word.is_empty());
            let Some(key) = words.next() else { continue };
            let count = || {
                let word = words.clone().next().unwrap_or_default();
                let what = || at(format!("\"{}\" is no {}", shown(word), shown(key)));
                whole(word).map(Some).ok_or_else(what)
            };
            match key {
                b"FIELDS" | b"COLUMNS" => found.fields = words.collect(),
                b"SIZE" => found.sizes = words.collect(),
                b"TYPE" => found.kinds = words.collect(),
                b"COUNT" => found.counts = words.collect(),
                b"WIDTH" => found.width = count()?,
                b"HEIGHT" => found.height = count()?,
                b"POINTS" => found.points = count()?,
                b"VERSION" => {}
                b"VIEWPOINT" => {
                    let place: Vec<f64> = words.map_while(number).take(3).collect();
                    found.viewpoint = <[f64; 3]>::try_from(place).ok().map(DVec3::from_array);
                }
                b"DATA" => {
                    let data = match words.next() {
                        Some(b"ascii") => Data::Ascii,
                        Some(b"binary") => Data::Binary,
                        Some(b"binary_compressed") => Data::Compressed,
                        other => {
                            return Err(at(format!(
                                "data are ascii, binary or binary_compressed, not \"{}\"",
                                shown(other.unwrap_or_default())
                            )));
                        }
                    };
                    let mut header = found.header(data).map_err(at)?;
                    (header.lines, header.body, header.comments) = (k + 1, body, comments);
                    return Ok(header);
                }
                other => return Err(at(format!("\"{}\" is not a keyword of PCD", shown(other)))),
            }
        }
        Err(Error::read(
            path,
            "header",
            "there is no DATA line: the file is truncated or not a PCD file; export it again",
        ))
    }

    /// The field of this name, if it is a single number.
    pub(super) fn field(&self, name: &str) -> Option<&Field> {
        self.fields.iter().find(|f| f.name == name && f.count == 1)
    }
}

impl Lines<'_> {
    fn header(&self, data: Data) -> std::result::Result<Header, String> {
        let mut header = Header {
            fields: Vec::with_capacity(self.fields.len()),
            columns: 0,
            stride: 0,
            width: 0,
            height: 0,
            points: 0,
            data,
            lines: 0,
            body: 0,
            viewpoint: self.viewpoint,
            comments: Vec::new(),
            warnings: Vec::new(),
        };
        for (name, list) in [
            ("SIZE", &self.sizes),
            ("TYPE", &self.kinds),
            ("COUNT", &self.counts),
        ] {
            if !list.is_empty() && list.len() != self.fields.len() {
                return Err(format!(
                    "{} fields are named, but {name} has {} entries",
                    self.fields.len(),
                    list.len()
                ));
            }
        }
        for (k, name) in self.fields.iter().enumerate() {
            let name = String::from_utf8_lossy(name).into_owned();
            let size = self.sizes.get(k).map_or(Some(4), |word| whole(word));
            let kind = self.kinds.get(k).and_then(|word| word.first());
            let count = self.counts.get(k).map_or(Some(1), |word| whole(word));
            let number = size.and_then(|size| Number::of(*kind.unwrap_or(&b'F'), size));
            let (Some(number), Some(count)) = (number, count) else {
                return Err(format!(
                    "the size, type or count of the field {} is not known",
                    shown(name.as_bytes())
                ));
            };
            let (column, offset) = (header.columns, header.stride);
            let add = |sum: usize, more: Option<usize>| more.and_then(|more| sum.checked_add(more));
            let (Some(columns), Some(stride)) = (
                add(column, Some(count)),
                add(offset, count.checked_mul(number.size())),
            ) else {
                return Err(format!("the field {} is too large", shown(name.as_bytes())));
            };
            (header.columns, header.stride) = (columns, stride);
            header.fields.push(Field {
                name,
                number,
                count,
                column,
                offset,
            });
        }
        header.width = self.width.unwrap_or(0);
        header.height = self.height.unwrap_or(1);
        let cells = header.width.checked_mul(header.height);
        header.points = match (self.points, cells) {
            (Some(points), cells) => {
                if self.width.is_some() && cells != Some(points) {
                    header.warnings.push(format!(
                        "{} x {} cells do not match the {points} points announced: their order was ignored",
                        header.width, header.height
                    ));
                    (header.width, header.height) = (points, 1);
                }
                points
            }
            (None, Some(cells)) if self.width.is_some() => cells,
            _ => return Err("the header does not say the number of points".to_owned()),
        };
        Ok(header)
    }
}

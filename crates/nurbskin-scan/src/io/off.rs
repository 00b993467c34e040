//! OFF meshes, as Geomview defined them and everybody writes them.

use super::lines::{lines, number, shown};
use super::scan::take_unit;
use crate::{Organisation, Scan};
use glam::DVec3;
use nurbskin_geometry::files::sniff;
use nurbskin_geometry::{Error, Result};
use std::path::Path;

/// Reads the content of an OFF file: `OFF`, `COFF`, `NOFF`, `STOFF`, `4OFF`, `nOFF` and their combinations, the counts
/// on the line of the keyword or after it. All vertices in file order, normals where the keyword has an N, polygons as
/// fans of triangles; colours and texture coordinates are left out.
///
/// # Errors
/// [`Error::Read`] naming the line; [`Error::Unsupported`] for binary files and other dimensions than three.
pub fn read(bytes: &[u8], path: &Path) -> Result<Scan> {
    let mut words = Words::new(bytes);
    let found = Content::read(&mut words, bytes.len());
    found.map_err(|problem| match problem {
        Problem::Damaged(what) => {
            let at = format!("line {}", words.line_number);
            let what = format!("{what}; correct the line or export the file again");
            Error::read(path, at, what)
        }
        Problem::Unfit(what) => Error::Unsupported(format!("{}: {what}", path.display())),
    })
}

/// What stands in the way of reading on.
enum Problem {
    Damaged(String),
    Unfit(String),
}

type Outcome<T> = std::result::Result<T, Problem>;

/// The words of the file, line by line, without comments.
struct Words<'a> {
    lines: Box<dyn Iterator<Item = (usize, &'a [u8])> + 'a>,
    rest: &'a [u8],
    line_number: usize,
    comments: Vec<&'a [u8]>,
}

impl<'a> Words<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self {
            lines: Box::new(lines(bytes)),
            rest: b"",
            line_number: 0,
            comments: Vec::new(),
        }
    }

    /// The next word of the line.
    #[inline]
    fn on_line(&mut self) -> Option<&'a [u8]> {
        self.rest = self.rest.trim_ascii_start();
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(u8::is_ascii_whitespace);
        let (word, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        self.rest = rest;
        Some(word)
    }

    /// The next word, on this line or a later one.
    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        loop {
            if let Some(word) = self.on_line() {
                return Some(word);
            }
            let (line_number, line) = self.lines.next()?;
            self.line_number = line_number;
            let end = line.iter().position(|&b| b == b'#');
            self.rest = &line[..end.unwrap_or(line.len())];
            if let Some(at) = end
                && self.comments.len() < 64
            {
                self.comments.push(&line[at + 1..]);
            }
        }
    }

    /// Leaves the rest of the line.
    fn end_line(&mut self) {
        self.rest = b"";
    }

    /// The next number; `what` names what it belongs to.
    #[inline]
    fn number(&mut self, what: &str, of: usize, count: usize) -> Outcome<f64> {
        let ended = || {
            Problem::Damaged(format!(
                "the file ends at {what} {of} of {count}: it is truncated or the count is wrong"
            ))
        };
        let word = self.next().ok_or_else(ended)?;
        number(word).ok_or_else(|| Problem::Damaged(format!("\"{}\" is not a number", shown(word))))
    }

    /// The next whole number.
    fn count(&mut self, what: &str) -> Outcome<usize> {
        let Some(word) = self.next() else {
            return Err(Problem::Damaged(format!(
                "the file ends before the number of {what}"
            )));
        };
        whole(word).ok_or_else(|| {
            Problem::Damaged(format!("\"{}\" is not a number of {what}", shown(word)))
        })
    }
}

/// A number without sign or fraction.
fn whole(word: &[u8]) -> Option<usize> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

struct Content {
    scan: Scan,
    triangles: Vec<[u32; 3]>,
    short_faces: usize,
}

impl Content {
    fn read(words: &mut Words, size: usize) -> Outcome<Scan> {
        let mut content = Content {
            scan: Scan {
                format: "off".into(),
                ..Scan::default()
            },
            triangles: Vec::new(),
            short_faces: 0,
        };
        // 1. The keyword, which some leave out, and the counts; nobody needs that of the edges.
        let mut first = words
            .next()
            .ok_or_else(|| Problem::Damaged("the file holds nothing".to_owned()))?;
        let mut letters: &[u8] = b"";
        if let Some((before, after)) = sniff::off_keyword(first) {
            letters = before;
            first = after;
            if after.is_empty() {
                if words.rest.trim_ascii().eq_ignore_ascii_case(b"binary") {
                    return Err(Problem::Unfit(
                        "binary OFF is not read; export it as text".to_owned(),
                    ));
                }
                if letters.contains(&b'n') && words.count("dimensions")? != 3 {
                    return Err(Problem::Unfit(
                        "only points with three coordinates are read; export the mesh in 3-D"
                            .to_owned(),
                    ));
                }
                let next = words.next().ok_or_else(|| {
                    Problem::Damaged("the file ends before the number of vertices".to_owned())
                });
                first = next?;
            }
        }
        let vertices = whole(first).ok_or_else(|| {
            Problem::Damaged(format!("\"{}\" is not a number of vertices", shown(first)))
        })?;
        let faces = words.count("faces")?;
        words.end_line();
        // A vertex takes three digits and three separators, a face one of each.
        if vertices > size / 6 + 1 || faces > size / 2 + 1 {
            return Err(Problem::Damaged(format!(
                "{vertices} vertices and {faces} faces are announced, which need more than the {size} bytes of the \
                 file: it is truncated or a count is wrong"
            )));
        }
        // 2. What was promised.
        content.vertices(words, vertices, letters)?;
        content.faces(words, faces)?;
        if words.next().is_some() {
            content.scan.warnings.push(format!(
                "ignored everything from line {} on, after the last announced face",
                words.line_number
            ));
        }
        if content.short_faces > 0 {
            content.scan.warnings.push(format!(
                "ignored faces with fewer than three corners: {}",
                content.short_faces
            ));
        }
        for comment in &words.comments {
            take_unit(&mut content.scan, &String::from_utf8_lossy(comment));
        }
        content.scan.organisation = Organisation::Mesh(content.triangles);
        Ok(content.scan)
    }

    fn vertices(&mut self, words: &mut Words, count: usize, letters: &[u8]) -> Outcome<()> {
        let with_weights = letters.contains(&b'4');
        let mut normals = letters.contains(&b'N').then(|| Vec::with_capacity(count));
        self.scan.points.reserve_exact(count);
        for k in 0..count {
            let triple = |words: &mut Words| -> Outcome<DVec3> {
                Ok(DVec3::new(
                    words.number("vertex", k, count)?,
                    words.number("vertex", k, count)?,
                    words.number("vertex", k, count)?,
                ))
            };
            let mut point = triple(words)?;
            if with_weights {
                point /= words.number("vertex", k, count)?;
            }
            self.scan.points.push(point);
            if let Some(normals) = &mut normals {
                normals.push(triple(words)?);
            }
            // Colours come in any number.
            words.end_line();
        }
        self.scan.normals = normals;
        Ok(())
    }

    fn faces(&mut self, words: &mut Words, count: usize) -> Outcome<()> {
        let vertices = self.scan.points.len();
        for k in 0..count {
            let ended = || {
                Problem::Damaged(format!(
                    "the file ends at face {k} of {count}: it is truncated or the count is wrong"
                ))
            };
            let word = words.next().ok_or_else(ended)?;
            let corners = whole(word).ok_or_else(|| {
                Problem::Damaged(format!("\"{}\" is not a number of corners", shown(word)))
            })?;
            let mut corner = || -> Outcome<u32> {
                let word = words.next().ok_or_else(ended)?;
                whole(word)
                    .filter(|&index| index < vertices)
                    .and_then(|index| u32::try_from(index).ok())
                    .ok_or_else(|| {
                        let what = shown(word);
                        Problem::Damaged(format!(
                            "vertex index {what} is out of range: the file has {vertices} \
                         vertices"
                        ))
                    })
            };
            if corners < 3 {
                for _ in 0..corners {
                    corner()?;
                }
                self.short_faces += 1;
            } else {
                let (first, mut last) = (corner()?, corner()?);
                for _ in 2..corners {
                    let next = corner()?;
                    self.triangles.push([first, last, next]);
                    last = next;
                }
            }
            words.end_line();
        }
        Ok(())
    }
}

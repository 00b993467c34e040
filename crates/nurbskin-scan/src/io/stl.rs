//! STL meshes, ASCII and binary.
//!
//! Binary files go through `stl_io`. Text is read here: `stl_io` stops at the first of several solids, takes a file
//! with a nameless `solid` or with NaN for damaged, and cannot name a line.

use super::lines::{lines, number, shown};
use super::scan::take_unit;
use crate::{Organisation, Scan};
use glam::DVec3;
use nurbskin_geometry::{Error, Result};
use std::collections::HashMap;
use std::io::{Cursor, Write};
use std::path::Path;

/// Corners with the same bits become one point, in the order of their first appearance.
#[derive(Default)]
struct Welder {
    points: Vec<DVec3>,
    index: HashMap<[u64; 3], u32>,
    triangles: Vec<[u32; 3]>,
}

impl Welder {
    /// Adds a triangle; `None` if there are more points than indices.
    fn add(&mut self, corners: [DVec3; 3]) -> Option<()> {
        let mut triangle = [0; 3];
        for (slot, corner) in triangle.iter_mut().zip(corners) {
            // -0 and 0 are the same place.
            let corner = corner + DVec3::ZERO;
            let next = u32::try_from(self.points.len()).ok()?;
            *slot = *self
                .index
                .entry(corner.to_array().map(f64::to_bits))
                .or_insert(next);
            if *slot == next {
                self.points.push(corner);
            }
        }
        self.triangles.push(triangle);
        Some(())
    }

    fn into_scan(self, header: &[u8], warnings: Vec<String>) -> Scan {
        let mut scan = Scan {
            points: self.points,
            organisation: Organisation::Mesh(self.triangles),
            format: "stl".into(),
            warnings,
            ..Scan::default()
        };
        take_unit(&mut scan, &String::from_utf8_lossy(header));
        scan
    }
}

fn too_many(path: &Path) -> Error {
    Error::read(path, "", "more than 4294967295 points; split the mesh")
}

/// Reads the content of a binary STL file: the triangles, their corners welded where all bits agree. Normals and
/// colours are left out.
///
/// # Errors
/// [`Error::Read`] for a truncated file.
pub fn read_binary(mut bytes: Vec<u8>, path: &Path) -> Result<Scan> {
    const HEADER: usize = 84;
    const RECORD: usize = 50;
    let Some(&[.., a, b, c, d]) = bytes.first_chunk::<HEADER>() else {
        let what = format!(
            "the file has {} bytes, the header of a binary STL file alone has {HEADER}: it is truncated or not an STL \
             file; export it again",
            bytes.len()
        );
        return Err(Error::read(path, "", what));
    };
    let announced = u32::from_le_bytes([a, b, c, d]) as usize;
    let data = bytes.len() - HEADER;
    let held = data / RECORD;
    let mut warnings = Vec::new();
    if announced > held {
        let what = format!(
            "{announced} triangles are announced, but the file ends after {held}: it is truncated or not an STL file; \
             export it again"
        );
        return Err(Error::read(path, format!("triangle {held}"), what));
    }
    if announced == 0 && held > 0 && data.is_multiple_of(RECORD) {
        // Written by a program that could not go back to fill in the count.
        warnings.push(format!(
            "the header announces no triangles: the {held} that follow were read"
        ));
        let count = u32::try_from(held).map_err(|_| too_many(path))?;
        bytes[80..HEADER].copy_from_slice(&count.to_le_bytes());
    } else if data > announced * RECORD {
        let rest = data - announced * RECORD;
        warnings.push(format!("ignored {rest} bytes after the last triangle"));
    }
    let header = bytes[..80].to_vec();
    // A binary file whose header begins with "solid" would be taken for text.
    bytes[..80].fill(0);
    let mut welder = Welder::default();
    let mut cursor = Cursor::new(bytes);
    let damaged = |e: std::io::Error| Error::read(path, "", format!("{e}; export the file again"));
    for triangle in stl_io::create_stl_reader(&mut cursor).map_err(damaged)? {
        let corners = triangle
            .map_err(damaged)?
            .vertices
            .map(|corner| DVec3::from_array(corner.0.map(f64::from)));
        welder.add(corners).ok_or_else(|| too_many(path))?;
    }
    Ok(welder.into_scan(&header, warnings))
}

/// Reads the content of an ASCII STL file: the triangles of all its solids, corners welded where all bits agree.
///
/// # Errors
/// [`Error::Read`] naming the line.
pub fn read_text(bytes: &[u8], path: &Path) -> Result<Scan> {
    let mut welder = Welder::default();
    let mut corners = Vec::with_capacity(3);
    let mut header: &[u8] = b"";
    let mut open_facet = None;
    let mut open_solid = false;
    let mut last = 0;
    for (line_number, line) in lines(bytes) {
        let mut words = line
            .split(u8::is_ascii_whitespace)
            .filter(|word| !word.is_empty());
        let Some(keyword) = words.next() else {
            continue;
        };
        last = line_number;
        let problem = |what: String| {
            Err(Error::read(
                path,
                format!("line {line_number}"),
                format!("{what}; correct the line or export the file again"),
            ))
        };
        match keyword.to_ascii_lowercase().as_slice() {
            b"vertex" => {
                let mut values = [0.0; 3];
                for value in &mut values {
                    let word = words.next().unwrap_or_default();
                    let Some(parsed) = number(word) else {
                        return problem(format!(
                            "a vertex has three numbers, but \"{}\" is not one",
                            shown(word)
                        ));
                    };
                    *value = parsed;
                }
                if open_facet.is_none() || corners.len() == 3 {
                    return problem("a facet has three vertices, not more".to_owned());
                }
                corners.push(DVec3::from_array(values));
            }
            b"facet" => {
                if let Some(begun) = open_facet.replace(line_number) {
                    return problem(format!(
                        "the facet that begins in line {begun} has no endfacet"
                    ));
                }
            }
            b"endfacet" => {
                let &[a, b, c] = corners.as_slice() else {
                    return problem(format!("a facet has three vertices, not {}", corners.len()));
                };
                welder.add([a, b, c]).ok_or_else(|| too_many(path))?;
                corners.clear();
                open_facet = None;
            }
            b"solid" => {
                open_solid = true;
                if header.is_empty() {
                    header = line;
                }
            }
            b"endsolid" => open_solid = false,
            b"outer" | b"endloop" | b"color" => {}
            other if other.starts_with(b"#") || other.starts_with(b"//") => {}
            other => return problem(format!("\"{}\" is not a keyword of STL", shown(other))),
        }
    }
    if let Some(begun) = open_facet {
        return Err(Error::read(
            path,
            format!("line {last}"),
            format!(
                "the file ends in the facet that begins in line {begun}: it is truncated; export it again"
            ),
        ));
    }
    let mut warnings = Vec::new();
    if open_solid {
        warnings.push("the file ends without endsolid: it may be truncated".to_owned());
    }
    Ok(welder.into_scan(header, warnings))
}

/// The triangles of a mesh as STL holds them.
///
/// # Errors
/// [`Error::Unsupported`] for a scan without triangles or with numbers beyond 32 bits.
pub(super) fn triangles(scan: &Scan) -> Result<Vec<stl_io::Triangle>> {
    let Organisation::Mesh(triangles) = &scan.organisation else {
        return Err(Error::Unsupported(format!(
            "STL holds triangles, this scan is {}; write .ply or .xyz",
            scan.organisation.name()
        )));
    };
    let place = |index: u32| scan.points[index as usize] + scan.origin;
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounding is what the format demands"
    )]
    let rounded = |v: DVec3| stl_io::Vector::new(v.to_array().map(|c| c as f32));
    let triangles: Vec<stl_io::Triangle> = triangles
        .iter()
        .map(|&[a, b, c]| {
            let [a, b, c] = [place(a), place(b), place(c)];
            stl_io::Triangle {
                normal: rounded((b - a).cross(c - a).normalize_or_zero()),
                vertices: [rounded(a), rounded(b), rounded(c)],
            }
        })
        .collect();
    if u32::try_from(triangles.len()).is_err() {
        return Err(Error::Unsupported(
            "STL holds at most 4294967295 triangles; write .ply".to_owned(),
        ));
    }
    let infinite = |t: &stl_io::Triangle| t.vertices.iter().flat_map(|v| v.0).any(f32::is_infinite);
    if triangles.iter().any(infinite) {
        return Err(Error::Unsupported(
            "a coordinate is too large for the 32-bit numbers of STL; write .ply".to_owned(),
        ));
    }
    Ok(triangles)
}

/// Writes binary STL; coordinates are rounded to 32 bits.
///
/// # Errors
/// Those of `writer`.
pub(super) fn write(
    mut writer: &mut dyn Write,
    triangles: &[stl_io::Triangle],
) -> std::io::Result<()> {
    stl_io::write_stl(&mut writer, triangles.iter())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Scan> {
        read_text(text.as_bytes(), Path::new("t.stl"))
    }

    const FACET: &str = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";

    #[test]
    fn several_solids_are_one_mesh() {
        let text = format!("solid\n{FACET}endsolid\nSOLID b units=cm\n{FACET}endsolid b");
        let scan = read(&text).unwrap();
        assert_eq!(scan.points.len(), 3);
        assert_eq!(scan.organisation, Organisation::Mesh(vec![[0, 1, 2]; 2]));
        assert!(scan.warnings.is_empty());
    }

    #[test]
    fn damage_is_named_by_its_line() {
        for (text, line) in [
            (format!("solid\n{}", &FACET[..56]), "line 5"),
            (
                "solid\nfacet\nouter loop\nvertex 1 x 2\n".to_owned(),
                "line 4",
            ),
            (
                "solid\nfacet\nouter loop\nvertex 1 2\n".to_owned(),
                "line 4",
            ),
            ("solid\nvertex 1 2 3\n".to_owned(), "line 2"),
            ("solid\nfacet\nendfacet\n".to_owned(), "line 3"),
            ("solid\nrubbish\n".to_owned(), "line 2"),
        ] {
            let message = read(&text).unwrap_err().to_string();
            assert!(message.contains(line), "{message}");
        }
        assert_eq!(read(&format!("solid\n{FACET}")).unwrap().warnings.len(), 1);
    }

    #[test]
    fn counts_of_binary_files_are_checked() {
        let record: Vec<u8> = [
            0.0_f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -0.0, 1.0, 0.0,
        ]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .chain([0, 0])
        .collect();
        let file = |announced: u32, held: usize| {
            let mut bytes = b"solid COLOR=\x01\x02\x03\x04 UNITS=cm".to_vec();
            bytes.resize(80, 0);
            bytes.extend(announced.to_le_bytes());
            bytes.extend(record.repeat(held));
            read_binary(bytes, Path::new("t.stl"))
        };
        let scan = file(2, 2).unwrap();
        assert_eq!((scan.points.len(), scan.warnings.len()), (3, 0));
        assert_eq!(scan.unit, nurbskin_geometry::Unit::Centimetre);
        assert_eq!(file(1, 2).unwrap().warnings.len(), 1);
        assert_eq!(
            file(0, 2).unwrap().organisation,
            Organisation::Mesh(vec![[0, 1, 2]; 2])
        );
        let message = file(u32::MAX, 2).unwrap_err().to_string();
        assert!(message.contains("truncated"), "{message}");
        assert!(read_binary(vec![1; 83], Path::new("t.stl")).is_err());
    }
}

//! Wavefront OBJ meshes and points.
//!
//! Read here: `tobj` drops vertices that no face uses and with them every file of points only (and the index that a
//! point has in its file), and cannot name a line.

use super::lines::{lines, number, shown};
use super::scan::take_unit;
use crate::{Organisation, Scan};
use glam::DVec3;
use nurbskin_geometry::{Error, Result};
use std::borrow::Cow;
use std::io::Write;
use std::path::Path;

/// Reads the content of an OBJ file: all vertices in file order, polygons as fans of triangles.
///
/// Vertices with a weight are divided by it; colours and texture coordinates are left out. Normals count where every
/// vertex gets one: its own, or the mean over the faces around it where faces name others.
///
/// # Errors
/// [`Error::Read`] naming the line.
pub fn read(bytes: &[u8], path: &Path) -> Result<Scan> {
    let mut content = Content::default();
    let mut joined: Vec<u8> = Vec::new();
    for (line_number, line) in lines(bytes) {
        // A backslash joins a line with the next.
        if let Some(part) = line.strip_suffix(b"\\") {
            joined.extend_from_slice(part);
            joined.push(b' ');
            continue;
        }
        let line = if joined.is_empty() {
            Cow::Borrowed(line)
        } else {
            joined.extend_from_slice(line);
            Cow::Owned(std::mem::take(&mut joined))
        };
        content.statement(&line, line_number).map_err(|what| {
            let what = format!("{what}; correct the line or export the file again");
            Error::read(path, format!("line {line_number}"), what)
        })?;
    }
    content.into_scan(path)
}

#[derive(Default)]
struct Content {
    scan: Scan,
    normals: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// Sum of the normals that faces give to each vertex; as long as the largest vertex needs.
    sums: Vec<DVec3>,
    /// The largest indices of a vertex and a normal, and their lines.
    largest: [(u64, usize); 2],
    corners: Vec<[u64; 2]>,
    /// Corners whose normal is defined later in the file.
    late: Vec<[u64; 2]>,
    short_faces: usize,
    /// A corner whose normal has another number than its vertex.
    crossed: bool,
    weighted: bool,
    free_form: bool,
}

impl Content {
    fn statement(&mut self, line: &[u8], line_number: usize) -> std::result::Result<(), String> {
        let mut words = line
            .split(u8::is_ascii_whitespace)
            .filter(|word| !word.is_empty())
            .take_while(|word| !word.starts_with(b"#"));
        match words.next() {
            Some(b"v") => {
                let mut values = [0.0; 4];
                let mut count = 0;
                for word in words.by_ref() {
                    let Some(slot) = values.get_mut(count) else {
                        count += 1;
                        break;
                    };
                    // A fourth number may belong to a colour, which may be anything.
                    *slot = match number(word) {
                        Some(value) => value,
                        None if count >= 3 => 1.0,
                        None => return Err(format!("\"{}\" is not a number", shown(word))),
                    };
                    count += 1;
                }
                if count < 3 {
                    return Err(format!("a vertex has three numbers, not {count}"));
                }
                let [x, y, z, weight] = values;
                let point = DVec3::new(x, y, z);
                // Six numbers are a point and its colour; four are a point and its weight.
                let point = if count == 4 && (weight - 1.0).abs() > 0.0 {
                    self.weighted = true;
                    if weight == 0.0 {
                        return Err(
                            "the weight of a vertex is 0, which puts it at infinity".to_owned()
                        );
                    }
                    point / weight
                } else {
                    point
                };
                self.scan.points.push(point);
            }
            Some(b"vn") => {
                let mut normal = [0.0; 3];
                for slot in &mut normal {
                    let word = words.next().unwrap_or_default();
                    *slot = number(word)
                        .ok_or_else(|| format!("\"{}\" is not a number", shown(word)))?;
                }
                self.normals.push(DVec3::from_array(normal));
            }
            Some(b"f" | b"fo") => {
                self.corners.clear();
                for word in words {
                    let corner = self.corner(word, line_number)?;
                    self.corners.push(corner);
                }
                self.face();
            }
            Some(b"cstype" | b"curv" | b"curv2" | b"surf") => self.free_form = true,
            None if line.starts_with(b"#") => {
                take_unit(&mut self.scan, &String::from_utf8_lossy(line));
            }
            // Names, materials, texture coordinates, lines, smoothing.
            _ => {}
        }
        Ok(())
    }

    /// The indices from 0 of vertex and normal of `7`, `7/1`, `7//3` or `7/1/3`, negative ones counted from the
    /// last; `u64::MAX` for no normal.
    fn corner(&mut self, word: &[u8], line_number: usize) -> std::result::Result<[u64; 2], String> {
        let mut parts = word.split(|&b| b == b'/');
        let vertex = parts.next().unwrap_or_default();
        let normal = parts.nth(1).unwrap_or_default();
        let mut corner = [u64::MAX; 2];
        let defined = [self.scan.points.len(), self.normals.len()];
        for (k, part) in [vertex, normal].into_iter().enumerate() {
            if k == 1 && part.is_empty() {
                continue;
            }
            let index = std::str::from_utf8(part)
                .ok()
                .and_then(|part| part.parse::<i64>().ok())
                .ok_or_else(|| format!("\"{}\" is not a vertex index", shown(word)))?;
            let defined = defined[k] as u64;
            corner[k] = if index > 0 {
                index.unsigned_abs() - 1
            } else {
                let back = index.unsigned_abs();
                if back == 0 || back > defined {
                    let what = ["vertices", "normals"][k];
                    return Err(format!(
                        "index \"{}\" is out of range: the file has {defined} {what} up to here",
                        shown(word)
                    ));
                }
                defined - back
            };
            if corner[k] >= self.largest[k].0 {
                self.largest[k] = (corner[k], line_number);
            }
        }
        Ok(corner)
    }

    /// Takes the face of `corners`. Indices that are not defined yet are checked at the end of the file.
    fn face(&mut self) {
        if self.corners.len() < 3 {
            self.short_faces += 1;
            return;
        }
        for &[vertex, normal] in &self.corners {
            if normal == u64::MAX {
                continue;
            }
            self.crossed |= vertex != normal;
            let known = usize::try_from(normal)
                .ok()
                .and_then(|n| self.normals.get(n));
            match (known, usize::try_from(vertex)) {
                (Some(&normal), Ok(vertex)) if vertex < self.scan.points.len() => {
                    if self.sums.len() <= vertex {
                        self.sums.resize(self.scan.points.len(), DVec3::ZERO);
                    }
                    self.sums[vertex] += normal;
                }
                _ => self.late.push([vertex, normal]),
            }
        }
        // An index beyond 32 bits is found out at the end.
        let index = |corner: &[u64; 2]| u32::try_from(corner[0]).unwrap_or(u32::MAX);
        let first = index(&self.corners[0]);
        self.triangles.extend(
            self.corners[1..]
                .windows(2)
                .map(|pair| [first, index(&pair[0]), index(&pair[1])]),
        );
    }

    fn into_scan(mut self, path: &Path) -> Result<Scan> {
        let counts = [self.scan.points.len(), self.normals.len()];
        for (k, what) in ["vertices", "normals"].into_iter().enumerate() {
            let (largest, line_number) = self.largest[k];
            if line_number > 0 && largest >= counts[k] as u64 {
                let what = format!(
                    "a face refers to number {} of only {} {what}; correct the line or export the file again",
                    largest.saturating_add(1),
                    counts[k]
                );
                return Err(Error::read(path, format!("line {line_number}"), what));
            }
        }
        self.sums.resize(counts[0], DVec3::ZERO);
        for [vertex, normal] in std::mem::take(&mut self.late) {
            // Both were just found to exist.
            if let (Ok(vertex), Ok(normal)) = (usize::try_from(vertex), usize::try_from(normal)) {
                self.sums[vertex] += self.normals[normal];
            }
        }
        let mut scan = self.scan;
        if !self.crossed && counts[0] == counts[1] && counts[0] > 0 {
            scan.normals = Some(self.normals);
        } else if counts[1] > 0 && self.sums.iter().all(|sum| *sum != DVec3::ZERO) {
            scan.normals = Some(
                self.sums
                    .into_iter()
                    .map(DVec3::normalize_or_zero)
                    .collect(),
            );
        }
        let mut warn = |what: String| scan.warnings.push(what);
        if self.short_faces > 0 {
            warn(format!(
                "ignored faces with fewer than three corners: {}",
                self.short_faces
            ));
        }
        if self.weighted {
            warn("vertices with a weight were divided by it".to_owned());
        }
        if self.free_form {
            warn(
                "free-form curves and surfaces were ignored: only vertices and faces are read"
                    .to_owned(),
            );
        }
        scan.organisation = Organisation::Mesh(self.triangles);
        scan.format = "obj".into();
        Ok(scan)
    }
}

/// Writes vertices, their normals and the triangles, if any, with the shortest digits that read back the same.
///
/// # Errors
/// Those of `writer`.
pub fn write(writer: &mut dyn Write, scan: &Scan) -> std::io::Result<()> {
    if scan.unit_source != nurbskin_geometry::unit::UnitSource::Assumed {
        writeln!(writer, "# unit {}", scan.unit)?;
    }
    if scan.points.is_empty() {
        writeln!(writer, "# no points")?;
    }
    for &point in &scan.points {
        let [x, y, z] = (point + scan.origin).to_array();
        writeln!(writer, "v {x:?} {y:?} {z:?}")?;
    }
    for normal in scan.normals.iter().flatten() {
        let [x, y, z] = normal.to_array();
        writeln!(writer, "vn {x:?} {y:?} {z:?}")?;
    }
    if let Organisation::Mesh(triangles) = &scan.organisation {
        for corners in triangles {
            let [a, b, c] = corners.map(|corner| u64::from(corner) + 1);
            if scan.normals.is_some() {
                writeln!(writer, "f {a}//{a} {b}//{b} {c}//{c}")?;
            } else {
                writeln!(writer, "f {a} {b} {c}")?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Result<Scan> {
        read(text.as_bytes(), Path::new("t.obj"))
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0 0.5 0.5 nan\nv 2 2 0 2\nv 0 1 0\nvn 0 0 2\nvt 0 0\n";

    #[test]
    fn all_forms_of_an_index() {
        for face in [
            "f 1 2 3 4",
            "f 1/1 2/1 3/1 4/1",
            "f 1//1 2//1 3//1 4//1",
            "f -4/-1/-1 \\\n -3/-1/-1 3/1/1 4/1/-1 # comment",
        ] {
            let scan = of(&format!("{SQUARE}{face}\n")).unwrap();
            assert_eq!(scan.points[2], DVec3::new(1.0, 1.0, 0.0));
            assert_eq!(
                scan.organisation,
                Organisation::Mesh(vec![[0, 1, 2], [0, 2, 3]])
            );
            assert_eq!(
                scan.normals.is_some(),
                face.contains("//1") || face.contains("-1/-1")
            );
            assert!(scan.normals.iter().flatten().all(|n| *n == DVec3::Z));
        }
    }

    #[test]
    fn indices_out_of_range_are_refused_with_their_line() {
        for face in [
            "f 1 2 5",
            "f 0 1 2",
            "f -5 1 2",
            "f 1//2 2//1 3//1",
            "f 1 2 99999999999999999999",
            "f 1 2 9223372036854775807",
            "f 1 2 -9223372036854775808",
            "f 1 2 x",
            "f 1 // 2",
        ] {
            let message = of(&format!("{SQUARE}{face}\n")).unwrap_err().to_string();
            assert!(message.contains("line 7"), "{message}");
        }
        assert!(of("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 1 1 0\n").is_ok());
        assert!(of("v 1 2\n").unwrap_err().to_string().contains("line 1"));
        assert!(
            of("v 1 2 3 0\n")
                .unwrap_err()
                .to_string()
                .contains("line 1")
        );
    }
}

//! The PLY reader: an adapter of `serde_ply`.

use super::header::{Header, Source};
use super::rows::{Lists, Skipped, Vertex};
use crate::io::scan::take_unit;
use crate::scan::{GridLayout, Organisation, Scan};
use crate::{Error, Result};
use glam::DVec3;
use serde::de::MapAccess;
use serde_ply::{
    DeserializeError, ElementDef, PlyFormat, PlyHeader, PlyReader, PropertyType, RowVisitor,
    ScalarType,
};
use std::io::ErrorKind;
use std::path::Path;

/// Reads the content of a PLY file: the vertices, and their order from a range grid, faces or triangle strips.
///
/// Elements and properties that are not known are skipped; polygons become fans of triangles.
///
/// # Errors
/// [`Error::Read`] naming the element and row.
pub fn read(mut bytes: Vec<u8>, path: &Path) -> Result<Scan> {
    let clean = Header::find(&bytes, path)?;
    if clean.ascii {
        // The last number may end with the file; the parser wants to see its end.
        bytes.push(b'\n');
    }
    let body = &bytes[clean.body..];
    let mut source = Source {
        header: clean.text.as_bytes(),
        body,
    };
    let mut content = Content::default();
    let outcome = elements(&mut source, &mut content);
    let consumed = body.len() - source.body.len();
    match outcome {
        Ok(true) => content.note_remains(source.body, clean.ascii),
        Ok(false) => {}
        Err(Problem { mut at, what }) => {
            if clean.ascii && consumed > 0 {
                let ends = body[..consumed - 1].iter().filter(|&&b| b == b'\n');
                at = format!("{at} (line {})", clean.lines + 1 + ends.count());
            }
            return Err(Error::read(path, at, what));
        }
    }
    content.into_scan(path)
}

/// What is wrong, and where.
struct Problem {
    at: String,
    what: String,
}

impl Problem {
    fn new(at: impl Into<String>, what: impl Into<String>) -> Self {
        Self {
            at: at.into(),
            what: what.into(),
        }
    }
}

/// What an element is to us.
#[derive(Clone, Copy, PartialEq)]
enum Role {
    Vertices,
    Faces,
    Strips,
    Grid,
    Unknown,
}

impl Role {
    fn of(name: &str) -> Self {
        match name {
            "vertex" | "vertices" | "point" | "points" => Role::Vertices,
            "face" | "faces" => Role::Faces,
            "tristrips" => Role::Strips,
            "range_grid" => Role::Grid,
            _ => Role::Unknown,
        }
    }
}

/// What was found so far.
#[derive(Default)]
struct Content {
    points: Vec<DVec3>,
    normals: Option<Vec<DVec3>>,
    triangles: Vec<[u32; 3]>,
    cells: Vec<Option<u32>>,
    comments: Vec<String>,
    warnings: Vec<String>,
    /// The largest index used, and where.
    largest: Option<(u32, String)>,
    /// Faces with fewer than three corners.
    short_faces: usize,
}

/// Reads all elements; true if the data were read to their announced end.
fn elements(source: &mut Source, content: &mut Content) -> std::result::Result<bool, Problem> {
    let available = source.body.len();
    let mut reader = PlyReader::from_reader(source).map_err(|e| {
        let what = format!("{}; export the file again", e.0);
        Problem::new("header", what)
    })?;
    let header = reader.header().clone();
    content.comments = [&header.comments[..], &header.obj_info[..]].concat();
    check_size(&header, available)?;
    let roles: Vec<Role> = header
        .elem_defs
        .iter()
        .scan(Vec::new(), |seen: &mut Vec<Role>, element| {
            // Of two elements with the same job the first counts.
            let role = Role::of(&element.name);
            let role = if seen.contains(&role) {
                Role::Unknown
            } else {
                role
            };
            seen.push(role);
            Some(role)
        })
        .collect();
    let Some(last) = roles.iter().rposition(|&role| role != Role::Unknown) else {
        return Ok(false);
    };
    if !roles.contains(&Role::Vertices) && header.elem_defs.iter().any(|e| e.count > 0) {
        return Err(Problem::new(
            "header",
            "there is no element vertex or point: this is not a scan",
        ));
    }
    for (element, &role) in header.elem_defs.iter().zip(&roles).take(last + 1) {
        match role {
            Role::Vertices => content.read_vertices(&mut reader, element)?,
            Role::Unknown => {
                let mut row = 0;
                let mut skip = RowVisitor::new(|_: Skipped| row += 1);
                let outcome = (&mut reader).next_value_seed(&mut skip);
                outcome.map_err(|e| row_problem(&e, element, row))?;
            }
            _ => content.read_lists(&mut reader, element, role)?,
        }
    }
    Ok(last + 1 == roles.len())
}

/// Refuses counts that the data cannot hold, before anything is reserved for them or looped over.
fn check_size(header: &PlyHeader, available: usize) -> std::result::Result<(), Problem> {
    let mut least: u128 = 0;
    for element in &header.elem_defs {
        let row: u128 = element
            .properties
            .iter()
            .map(|property| match (header.format, &property.property_type) {
                // A digit and a separator.
                (PlyFormat::Ascii, _) => 2,
                (_, PropertyType::Scalar(kind)) => size(*kind),
                (_, PropertyType::List { count_type, .. }) => size(*count_type),
            })
            .sum();
        if row == 0 && element.count > 0 {
            let what = format!(
                "{} rows are announced, but the element has no properties; export the file again",
                element.count
            );
            return Err(Problem::new(format!("element {}", element.name), what));
        }
        least += row * element.count as u128;
        if least > available as u128 {
            let what = format!(
                "{} rows are announced, which need more than the {available} bytes of data that the file has: it is \
                 truncated or the count is wrong; export it again",
                element.count
            );
            return Err(Problem::new(format!("element {}", element.name), what));
        }
    }
    Ok(())
}

/// Bytes of a number.
fn size(kind: ScalarType) -> u128 {
    match kind {
        ScalarType::I8 | ScalarType::U8 => 1,
        ScalarType::I16 | ScalarType::U16 => 2,
        ScalarType::I32 | ScalarType::U32 | ScalarType::F32 => 4,
        ScalarType::F64 => 8,
    }
}

/// What the parser says, in our words.
fn row_problem(error: &DeserializeError, element: &ElementDef, row: usize) -> Problem {
    let what = if error.0.kind() == ErrorKind::UnexpectedEof {
        format!(
            "the file ends here, but {} rows are announced: it is truncated or the count is wrong; export it again",
            element.count
        )
    } else {
        format!("{}; correct the row or export the file again", error.0)
    };
    Problem::new(format!("element {}, row {row}", element.name), what)
}

impl Content {
    fn read_vertices(
        &mut self,
        reader: &mut PlyReader<&mut Source>,
        element: &ElementDef,
    ) -> std::result::Result<(), Problem> {
        let has = |name: &str| {
            element
                .get_property(name)
                .is_some_and(|p| matches!(p.property_type, PropertyType::Scalar(_)))
        };
        if element.count > 0 && !(has("x") && has("y")) {
            let missing = if has("x") { "y" } else { "x" };
            let what = format!("there is no property {missing}: the points have no coordinates");
            return Err(Problem::new(format!("element {}", element.name), what));
        }
        if element.count > 0 && !has("z") {
            self.warnings
                .push("the points have no property z: it is taken as 0".to_owned());
        }
        let with_normals = has("nx") && has("ny") && has("nz");
        // The count was checked against the size of the data.
        let mut points = Vec::with_capacity(element.count);
        let mut normals = Vec::with_capacity(if with_normals { element.count } else { 0 });
        let mut take = RowVisitor::new(|row: Vertex| {
            points.push(DVec3::new(row.x, row.y, row.z));
            if with_normals {
                normals.push(DVec3::new(row.nx, row.ny, row.nz));
            }
        });
        let mut map = reader;
        let outcome = MapAccess::next_value_seed(&mut map, &mut take);
        outcome.map_err(|e| row_problem(&e, element, points.len()))?;
        self.points = points;
        self.normals = with_normals.then_some(normals);
        Ok(())
    }

    fn read_lists(
        &mut self,
        reader: &mut PlyReader<&mut Source>,
        element: &ElementDef,
        role: Role,
    ) -> std::result::Result<(), Problem> {
        let list = element.properties.iter().find(|p| {
            matches!(p.property_type, PropertyType::List { .. })
                && matches!(p.name.as_str(), "vertex_indices" | "vertex_index")
        });
        if list.is_none() && element.count > 0 {
            self.warnings.push(format!(
                "element {} has no list vertex_indices: it is ignored",
                element.name
            ));
        }
        let mut row = 0;
        let mut take = Lists {
            name: list.map_or("", |p| p.name.as_str()),
            each: |indices: &[i64]| {
                self.take_row(indices, role, list.is_some(), row, element)?;
                row += 1;
                Ok(())
            },
        };
        let mut map = reader;
        let outcome = MapAccess::next_value_seed(&mut map, &mut take);
        outcome.map_err(|e| row_problem(&e, element, row))
    }

    /// Takes the indices of a face, a strip or a cell.
    fn take_row(
        &mut self,
        indices: &[i64],
        role: Role,
        listed: bool,
        row: usize,
        element: &ElementDef,
    ) -> std::result::Result<(), String> {
        if !listed {
            return Ok(());
        }
        let mut vertex = |index: i64| match u32::try_from(index) {
            Ok(index) => {
                if self
                    .largest
                    .as_ref()
                    .is_none_or(|(known, _)| index > *known)
                {
                    self.largest = Some((index, format!("element {}, row {row}", element.name)));
                }
                Ok(index)
            }
            Err(_) => Err(format!("{index} is no vertex")),
        };
        match role {
            Role::Grid => {
                let cell = indices.first().map(|&index| vertex(index)).transpose()?;
                self.cells.push(cell);
            }
            Role::Strips => {
                for strip in indices.split(|&index| index == -1) {
                    for (k, corners) in strip.windows(3).enumerate() {
                        let [a, b, c] = [
                            vertex(corners[0])?,
                            vertex(corners[1])?,
                            vertex(corners[2])?,
                        ];
                        // Repeated corners join strips; every second triangle is turned.
                        if a != b && b != c && a != c {
                            self.triangles
                                .push(if k % 2 == 0 { [a, b, c] } else { [b, a, c] });
                        }
                    }
                }
            }
            _ if indices.len() < 3 => self.short_faces += 1,
            _ => {
                let first = vertex(indices[0])?;
                for pair in indices[1..].windows(2) {
                    self.triangles
                        .push([first, vertex(pair[0])?, vertex(pair[1])?]);
                }
            }
        }
        Ok(())
    }

    /// Warns of data after the announced rows.
    fn note_remains(&mut self, remains: &[u8], ascii: bool) {
        let count = if ascii {
            remains.trim_ascii().len()
        } else {
            remains.len()
        };
        if count > 0 {
            self.warnings.push(format!(
                "the file goes on for {count} bytes after the announced rows: they are ignored"
            ));
        }
    }

    fn into_scan(mut self, path: &Path) -> Result<Scan> {
        let count = self.points.len();
        if let Some((index, at)) = &self.largest
            && *index as usize >= count
        {
            return Err(Error::read(
                path,
                at,
                format!("{index} is no vertex, there are {count}; export the file again"),
            ));
        }
        if self.short_faces > 0 {
            self.warnings.push(format!(
                "{} faces with fewer than three corners are left out",
                self.short_faces
            ));
        }
        let organisation = self.organisation(path)?;
        let mut scan = Scan {
            points: self.points,
            normals: self.normals,
            organisation,
            format: "ply",
            warnings: self.warnings,
            ..Scan::default()
        };
        for comment in &self.comments {
            take_unit(&mut scan, comment);
        }
        Ok(scan)
    }

    fn organisation(&mut self, path: &Path) -> Result<Organisation> {
        if let Some(lengths) = self.row_lengths() {
            if lengths
                .iter()
                .try_fold(0_usize, |sum, &n| sum.checked_add(n))
                == Some(self.points.len())
            {
                return Ok(Organisation::Rows(lengths));
            }
            self.warnings
                .push("the row lengths do not add up to the points: they are ignored".to_owned());
        }
        let cells = std::mem::take(&mut self.cells);
        if !cells.is_empty() {
            match (self.size_named("num_cols"), self.size_named("num_rows")) {
                (Some(count_u), Some(count_v)) => {
                    if count_u.checked_mul(count_v) != Some(cells.len()) {
                        let what = format!(
                            "{} cells do not make the {count_u} x {count_v} that num_cols and num_rows announce; \
                             correct the header",
                            cells.len()
                        );
                        return Err(Error::read(path, "element range_grid", what));
                    }
                    return Ok(Organisation::Grid(GridLayout {
                        count_u,
                        count_v,
                        cells,
                    }));
                }
                _ => self.warnings.push(
                    "the range grid names no num_cols and num_rows: the points count as unordered"
                        .to_owned(),
                ),
            }
        }
        Ok(Organisation::Mesh(std::mem::take(&mut self.triangles)))
    }

    /// The number after this name in a comment or an `obj_info` line.
    fn size_named(&self, name: &str) -> Option<usize> {
        self.comments
            .iter()
            .find_map(|line| line.strip_prefix(name)?.trim().parse().ok())
    }

    /// The lengths of scan lines that our writer notes in comments.
    fn row_lengths(&self) -> Option<Vec<usize>> {
        let mut lines = self
            .comments
            .iter()
            .filter_map(|line| line.strip_prefix(super::write::ROW_LENGTHS))
            .peekable();
        lines.peek()?;
        lines
            .flat_map(str::split_ascii_whitespace)
            .map(|word| word.parse().ok())
            .collect()
    }
}

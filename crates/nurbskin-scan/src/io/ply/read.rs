//! The PLY reader: an adapter of `serde_ply`.

use super::content::{Content, Role};
use super::header::{Header, Source};
use super::rows::{Lists, Skipped, Vertex};
use crate::Scan;
use glam::DVec3;
use nurbskin_geometry::{Error, Result};
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
        bytes.reserve_exact(1);
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
                .push("the points have no property z: 0 was used".to_owned());
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
                "element {} has no list vertex_indices: it was ignored",
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
}

//! What a PLY file holds, as a scan.

use super::write::ROW_LENGTHS;
use crate::io::scan::take_unit;
use crate::{GridLayout, Organisation, Scan};
use glam::DVec3;
use nurbskin_geometry::{Error, Result};
use serde_ply::ElementDef;
use std::path::Path;

/// What an element is to us.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Role {
    Vertices,
    Faces,
    Strips,
    Grid,
    Unknown,
}

impl Role {
    pub(super) fn of(name: &str) -> Self {
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
pub(super) struct Content {
    pub(super) points: Vec<DVec3>,
    pub(super) normals: Option<Vec<DVec3>>,
    triangles: Vec<[u32; 3]>,
    cells: Vec<Option<u32>>,
    pub(super) comments: Vec<String>,
    pub(super) warnings: Vec<String>,
    /// The largest index used, and where.
    largest: Option<(u32, String)>,
    /// Faces with fewer than three corners.
    short_faces: usize,
}

impl Content {
    /// Takes the indices of a face, a strip or a cell.
    pub(super) fn take_row(
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
            Err(_) => Err(format!("{index} is not a vertex index")),
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
    pub(super) fn note_remains(&mut self, remains: &[u8], ascii: bool) {
        let count = if ascii {
            remains.trim_ascii().len()
        } else {
            remains.len()
        };
        if count > 0 {
            self.warnings
                .push(format!("ignored {count} bytes after the last row"));
        }
    }

    pub(super) fn into_scan(mut self, path: &Path) -> Result<Scan> {
        let count = self.points.len();
        if let Some((index, at)) = &self.largest
            && *index as usize >= count
        {
            return Err(Error::read(
                path,
                at,
                format!(
                    "vertex index {index} is out of range: the file has {count} vertices; export the file again"
                ),
            ));
        }
        if self.short_faces > 0 {
            self.warnings.push(format!(
                "ignored faces with fewer than three corners: {}",
                self.short_faces
            ));
        }
        let organisation = self.organisation(path)?;
        let mut scan = Scan {
            points: self.points,
            normals: self.normals,
            organisation,
            format: "ply".into(),
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
            self.warnings.push(
                "the row lengths do not add up to the number of points: they were ignored"
                    .to_owned(),
            );
        }
        let cells = std::mem::take(&mut self.cells);
        if !cells.is_empty() {
            match (self.size_named("num_cols"), self.size_named("num_rows")) {
                (Some(count_u), Some(count_v)) => {
                    if count_u.checked_mul(count_v) != Some(cells.len()) {
                        let what = format!(
                            "{} cells do not match the {count_u} x {count_v} that num_cols and num_rows announce; \
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
                    "the range grid has no num_cols and num_rows: the order of the points was ignored"
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
            .filter_map(|line| line.strip_prefix(ROW_LENGTHS))
            .peekable();
        lines.peek()?;
        lines
            .flat_map(str::split_ascii_whitespace)
            .map(|word| word.parse().ok())
            .collect()
    }
}

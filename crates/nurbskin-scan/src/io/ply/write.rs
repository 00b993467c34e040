//! The PLY writer: binary, little endian, 64-bit coordinates.
//!
//! By hand: `serde_ply` learns the type of a list from the first row, and the first cell of a range grid may be
//! empty.

use crate::{Organisation, Scan};
use nurbskin_geometry::unit::UnitSource;
use std::io::{Result, Write};

/// Begins a comment that lists the numbers of points of consecutive scan lines.
pub(super) const ROW_LENGTHS: &str = "row_lengths ";

/// Writes a scan so that [`read`](super::read) gives back the same: grids as `range_grid`, triangles as faces, rows
/// as a range grid whose short rows end with empty cells and comments with the numbers of points.
///
/// # Errors
/// Those of `writer`.
pub fn write(writer: &mut dyn Write, scan: &Scan) -> Result<()> {
    write!(writer, "ply\nformat binary_little_endian 1.0\n")?;
    if scan.unit_source != UnitSource::Assumed {
        writeln!(writer, "comment unit {}", scan.unit)?;
    }
    let [count_u, count_v] = grid_size(scan);
    if let Organisation::Rows(lengths) = &scan.organisation {
        for chunk in lengths.chunks(16) {
            write!(writer, "comment {}", ROW_LENGTHS.trim_end())?;
            for length in chunk {
                write!(writer, " {length}")?;
            }
            writeln!(writer)?;
        }
    }
    if count_u > 0 && count_v > 0 {
        write!(
            writer,
            "obj_info num_cols {count_u}\nobj_info num_rows {count_v}\n"
        )?;
    }
    writeln!(writer, "element vertex {}", scan.points.len())?;
    let names: &[&str] = if scan.normals.is_some() {
        &["x", "y", "z", "nx", "ny", "nz"]
    } else {
        &["x", "y", "z"]
    };
    for name in names {
        writeln!(writer, "property double {name}")?;
    }
    let list = "property list uchar uint vertex_indices";
    if let Organisation::Mesh(triangles) = &scan.organisation {
        write!(writer, "element face {}\n{list}\n", triangles.len())?;
    }
    if count_u > 0 && count_v > 0 {
        write!(writer, "element range_grid {}\n{list}\n", count_u * count_v)?;
    }
    writeln!(writer, "end_header")?;

    for (k, &point) in scan.points.iter().enumerate() {
        for coordinate in (point + scan.origin).to_array() {
            writer.write_all(&coordinate.to_le_bytes())?;
        }
        if let Some(normals) = &scan.normals {
            for component in normals[k].to_array() {
                writer.write_all(&component.to_le_bytes())?;
            }
        }
    }
    match &scan.organisation {
        Organisation::Unordered => {}
        Organisation::Mesh(triangles) => {
            for corners in triangles {
                writer.write_all(&[3])?;
                for corner in corners {
                    writer.write_all(&corner.to_le_bytes())?;
                }
            }
        }
        Organisation::Grid(grid) => {
            for &cell in &grid.cells {
                write_cell(writer, cell)?;
            }
        }
        Organisation::Rows(lengths) => {
            let mut next = 0_u32;
            for &length in lengths {
                for i in 0..count_u {
                    write_cell(writer, (i < length).then_some(next))?;
                    next += u32::from(i < length);
                }
            }
        }
    }
    Ok(())
}

/// Columns and rows of the range grid; zero where there is none. Very uneven rows get none, as it would be mostly
/// empty: their lengths say enough.
fn grid_size(scan: &Scan) -> [usize; 2] {
    match &scan.organisation {
        Organisation::Grid(grid) => [grid.count_u, grid.count_v],
        Organisation::Rows(lengths) => {
            let longest = lengths.iter().copied().max().unwrap_or(0);
            let cells = longest.saturating_mul(lengths.len());
            if cells <= scan.points.len().saturating_mul(4) {
                [longest, lengths.len()]
            } else {
                [0, 0]
            }
        }
        _ => [0, 0],
    }
}

fn write_cell(writer: &mut dyn Write, cell: Option<u32>) -> Result<()> {
    match cell {
        None => writer.write_all(&[0]),
        Some(index) => {
            writer.write_all(&[1])?;
            writer.write_all(&index.to_le_bytes())
        }
    }
}

//! The writer of delimited text.

use crate::{Organisation, Scan};
use glam::DVec3;
use nurbskin_geometry::unit::UnitSource;
use std::io::{Result, Write};

/// Writes one point per line with the shortest digits that read back the same, scan lines and the rows of a grid
/// separated by blank lines, empty cells as NaN. `separator` is a comma, which brings a line of names, or a blank.
///
/// # Errors
/// Those of `writer`.
pub fn write(writer: &mut dyn Write, scan: &Scan, separator: char) -> Result<()> {
    if scan.unit_source != UnitSource::Assumed {
        writeln!(writer, "# unit {}", scan.unit)?;
    }
    if scan.points.is_empty() {
        writeln!(writer, "# no points")?;
    }
    match &scan.organisation {
        Organisation::Grid(grid) => writeln!(writer, "# grid {} x {}", grid.count_u, grid.count_v)?,
        Organisation::Rows(lengths) => {
            let rows = lengths.iter().filter(|&&length| length > 0).count();
            writeln!(writer, "# rows {rows}")?;
        }
        _ => {}
    }
    match (separator, &scan.normals) {
        (',', None) => writeln!(writer, "x,y,z")?,
        (',', Some(_)) => writeln!(writer, "x,y,z,nx,ny,nz")?,
        (_, None) => {}
        (_, Some(_)) => writeln!(writer, "# x y z nx ny nz")?,
    }
    let mut out = Lines {
        writer,
        scan,
        separator,
    };
    match &scan.organisation {
        Organisation::Rows(lengths) => {
            let mut next = 0;
            for &length in lengths.iter().filter(|&&length| length > 0) {
                if next > 0 {
                    out.blank()?;
                }
                for index in next..next + length {
                    out.point(Some(index))?;
                }
                next += length;
            }
        }
        Organisation::Grid(grid) => {
            for (j, row) in grid.cells.chunks(grid.count_u.max(1)).enumerate() {
                if j > 0 {
                    out.blank()?;
                }
                for cell in row {
                    out.point(cell.map(|index| index as usize))?;
                }
            }
        }
        _ => {
            for index in 0..scan.points.len() {
                out.point(Some(index))?;
            }
        }
    }
    Ok(())
}

struct Lines<'a> {
    writer: &'a mut dyn Write,
    scan: &'a Scan,
    separator: char,
}

impl Lines<'_> {
    fn blank(&mut self) -> Result<()> {
        writeln!(self.writer)
    }

    /// The line of a point, or of NaN for an empty cell.
    fn point(&mut self, index: Option<usize>) -> Result<()> {
        let separator = self.separator;
        let of = |points: &[DVec3]| index.map_or(DVec3::NAN, |index| points[index]).to_array();
        let [x, y, z] = (DVec3::from_array(of(&self.scan.points)) + self.scan.origin).to_array();
        write!(self.writer, "{x:?}{separator}{y:?}{separator}{z:?}")?;
        if let Some(normals) = &self.scan.normals {
            let [x, y, z] = of(normals);
            write!(
                self.writer,
                "{separator}{x:?}{separator}{y:?}{separator}{z:?}"
            )?;
        }
        writeln!(self.writer)
    }
}

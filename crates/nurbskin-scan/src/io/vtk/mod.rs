//! VTK meshes: the legacy format (`.vtk`) and XML polydata (`.vtp`).
//!
//! Read here: no crate at hand bounds its memory by the size of the file. XML itself is `roxmltree`'s.
//!
//! Source: *VTK File Formats*, Kitware; the layout of version 5.1 as its writers make it.

mod arrays;
mod legacy;
mod xml;

pub(super) use legacy::read as read_legacy;
pub(super) use xml::read as read_xml;

use crate::{Organisation, Scan};
use glam::DVec3;
use nurbskin_geometry::unit::Unit;

/// What to do about a file that contradicts itself.
const AGAIN: &str = "export the file again";

/// What is made of the cells of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Corners around a polygon.
    Polygon,
    /// Every three neighbours are a triangle, turned every other time.
    Strip,
    /// A rectangle whose corners are listed row by row.
    Pixel,
    /// Points and lines, which have no area.
    Thin,
    /// Solids, and what is not known.
    Other,
}

/// A mesh under construction.
#[derive(Debug, Default)]
struct Mesh {
    points: Vec<DVec3>,
    normals: Option<Vec<DVec3>>,
    triangles: Vec<[u32; 3]>,
    /// Faces with fewer than three corners.
    short: usize,
    /// Points and lines.
    thin: usize,
    /// Solids, and what is not known.
    other: usize,
    warnings: Vec<String>,
}

impl Mesh {
    /// Adds a cell with these corners, numbered from the point `first` on.
    fn add(
        &mut self,
        kind: Kind,
        first: usize,
        corners: impl ExactSizeIterator<Item = f64>,
    ) -> Result<(), String> {
        match kind {
            Kind::Thin => self.thin += 1,
            Kind::Other => self.other += 1,
            _ if corners.len() < 3 => self.short += 1,
            _ => {
                let count = self.points.len() - first.min(self.points.len());
                let mut before = [0_u32; 2];
                for (k, value) in corners.enumerate() {
                    let corner = index(value, count)
                        .and_then(|corner| u32::try_from(first + corner).ok())
                        .ok_or_else(|| {
                            format!("vertex index {value} is out of range: there are {count} points, numbered from 0")
                        })?;
                    self.corner(kind, k, corner, &mut before);
                }
            }
        }
        Ok(())
    }

    /// The corner `k` of a cell, after the two that matter for it.
    fn corner(&mut self, kind: Kind, k: usize, corner: u32, before: &mut [u32; 2]) {
        let [a, b] = *before;
        match k {
            0 => before[0] = corner,
            1 => before[1] = corner,
            _ => {
                let odd = k % 2 == 1 && kind != Kind::Polygon;
                let triangle = if odd { [b, a, corner] } else { [a, b, corner] };
                self.triangles.push(triangle);
                *before = match kind {
                    Kind::Polygon => [a, corner],
                    _ => [b, corner],
                };
            }
        }
    }

    /// The cells that these offsets, the first of which is 0, cut out of the list of corners.
    fn cells(
        &mut self,
        first: usize,
        offsets: &[f64],
        corners: &[f64],
        kind: impl Fn(usize) -> Kind,
    ) -> Result<(), String> {
        for (k, pair) in offsets.windows(2).enumerate() {
            let range = index(pair[0], corners.len() + 1).zip(index(pair[1], corners.len() + 1));
            let Some(cell) = range.and_then(|(from, to)| corners.get(from..to)) else {
                return Err(format!(
                    "cell {k} has the offsets {} and {} into a list of {} corners; {AGAIN}",
                    pair[0],
                    pair[1],
                    corners.len()
                ));
            };
            self.add(kind(k), first, cell.iter().copied())?;
        }
        Ok(())
    }

    /// As a scan.
    fn into_scan(mut self, unit: Option<Unit>) -> Scan {
        for (count, what) in [
            (self.short, "faces with fewer than three corners"),
            (self.thin, "vertices and lines"),
            (self.other, "solid or unknown cells"),
        ] {
            if count > 0 {
                self.warnings.push(format!("ignored {what}: {count}"));
            }
        }
        let count = self.points.len();
        let mut scan = Scan {
            normals: self.normals.filter(|normals| normals.len() == count),
            points: self.points,
            organisation: Organisation::Mesh(self.triangles),
            warnings: self.warnings,
            ..Scan::default()
        };
        if let Some(unit) = unit {
            (scan.unit, scan.unit_source) = (unit, nurbskin_geometry::unit::UnitSource::File);
        }
        scan
    }
}

/// A whole number below `count`.
fn index(value: f64, count: usize) -> Option<usize> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "in range and whole"
    )]
    let whole =
        (value >= 0.0 && value < count as f64 && value.fract() == 0.0).then_some(value as usize);
    whole.filter(|&whole| whole < count)
}

/// Numbers as points.
fn points_of(values: &[f64]) -> Vec<DVec3> {
    let (triples, _) = values.as_chunks::<3>();
    triples.iter().map(|&p| DVec3::from_array(p)).collect()
}

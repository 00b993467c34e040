//! The natural base of a sheet that bends over: the rectangle around it, spread out in the plane.
//!
//! A mesh of few vertices is laid out over a rectangle, its holes filled, and spread out. The mesh of the part starts from
//! there, and follows in a few rounds. A ring that a tube suits as well is none of these sheets.
//!
//! The decisions are ours; the methods are those of [`chart`](crate::chart).

use super::base::Base;
use super::over_mesh::placed;
use super::{Charted, Extends, POOR_FOLDED, typical_edge};
use crate::chart::Topology;
use crate::chart::plane::RECTANGULAR;
use crate::chart::shape::{readings_of, shape_of};
use crate::chart::surface_mesh::{Developed, chart_of_mesh, spread};
use glam::DVec2;
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::clean::CleanScan;
use nurbskin_scan::mesh::decimate::decimate;
use nurbskin_scan::mesh::{Manifold, holes};

/// Vertices of the mesh that is spread out first. Guard: its rounds, up to two hundred, take some tenths of a second.
const FIRST_VERTICES: usize = 2000;
/// Width of the strip around the sheet in its rectangle, in edges of its mesh. Guard: points that are no vertices of the
/// mesh, such as tips of a ragged border, lie there.
const MARGIN: f64 = 2.0;
/// Length of the border of a sheet that fills its rectangle, in the perimeter of that, from which the borders are no sides.
/// Trial: the ragged border of points at random is 1.2 times as long; a slit over half of a square makes it 1.25 times.
const MAX_FULL_RIM: f64 = 1.25;
/// Root mean square stretch, above which a sheet that was spread out is no natural base. Trial: not varied.
const MAX_SPREAD_STRETCH: f64 = 1.5;

/// The chart in the rectangle around a sheet that is spread out, if that neither overlaps nor stretches it, and leaves
/// some of the rectangle empty. `vertices`: the points are those of a mesh file.
///
/// # Errors
/// [`Error::Cancelled`].
pub(super) fn spread_out(
    scan: &CleanScan,
    base: &Base,
    vertices: bool,
    progress: &dyn Progress,
) -> Result<Option<Charted>> {
    let made = developed(&base.manifold, progress);
    match made {
        Ok(Some(Developed { chart, .. })) => {
            let mesh = &base.manifold;
            let layout = (vertices, Notes::default());
            let mut charted = placed(scan, base, (mesh, &chart), mesh.triangles.len(), layout)?;
            charted.extends = Extends::SpreadOut;
            Ok(Some(charted))
        }
        Ok(None) | Err(Error::Unsupported(_) | Error::NoSolution(_) | Error::Invalid(_)) => {
            Ok(None)
        }
        Err(other) => Err(other),
    }
}

/// The mesh, spread out, if it is such a sheet.
fn developed(mesh: &Manifold, progress: &dyn Progress) -> Result<Option<Developed>> {
    if mesh.loops.is_empty() || mesh.genus() > 0 {
        return Ok(None);
    }
    let fewer = match mesh.points.len() > 2 * FIRST_VERTICES {
        true => Some(decimate(mesh, FIRST_VERTICES, progress)?.manifold),
        false => None,
    };
    let first = fewer.as_ref().unwrap_or(mesh);
    let found = first_of(first, progress)?;
    if fewer.is_none() || !found.is_natural() {
        return Ok(Some(found).filter(Developed::is_natural));
    }
    let size = DVec2::from(found.chart.size);
    let placed = found
        .chart
        .place(first, &mesh.points, Some(&mesh.normals()))?;
    let start = placed.parameters.iter().map(|&p| p * size).collect();
    let places = spread(mesh, mesh.triangles.len(), start, progress)?;
    Ok(
        Some(Developed::new(mesh, places, MARGIN * typical_edge(mesh)))
            .filter(Developed::is_natural),
    )
}

/// A mesh of few vertices, spread out from its layout over a rectangle.
fn first_of(mesh: &Manifold, progress: &dyn Progress) -> Result<Developed> {
    let likely = readings_of(mesh, None)?.first().map(|shape| shape.topology);
    let is_tube = likely == Some(Topology::Tube);
    if !is_tube && likely != Some(Topology::Disk) {
        return Err(Error::Unsupported("the part is no sheet".into()));
    }
    let shape = shape_of(mesh, Some(Topology::Disk))?;
    let (filled, _) = holes::fill(mesh.clone(), &shape.holes);
    let laid = chart_of_mesh(&filled, progress)?;
    let size = DVec2::from(laid.size);
    let start = laid.places.iter().map(|&p| p * size).collect();
    let mut places = spread(&filled, mesh.triangles.len(), start, progress)?;
    places.truncate(mesh.points.len());
    let found = Developed::new(mesh, places, MARGIN * typical_edge(mesh));
    if is_tube {
        let tube = shape_of(mesh, Some(Topology::Tube)).and_then(|tube| {
            let (filled, _) = holes::fill(mesh.clone(), &tube.holes);
            chart_of_mesh(&filled, progress)
        });
        match tube {
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Ok(tube) if tube.quality.stretch <= found.chart.quality.stretch => {
                return Err(Error::Unsupported("the part is a tube".into()));
            }
            _ => {}
        }
    }
    Ok(found)
}

impl Developed {
    /// Whether the rectangle is a natural base: the sheet does not overlap in it, nor stretch much, and has other sides.
    fn is_natural(&self) -> bool {
        let is_full = self.filled >= RECTANGULAR && self.rim < MAX_FULL_RIM;
        self.doubled <= POOR_FOLDED && !is_full && self.chart.quality.stretch <= MAX_SPREAD_STRETCH
    }
}

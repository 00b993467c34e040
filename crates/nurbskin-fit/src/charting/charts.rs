//! The charts of a scan, each made once.
//!
//! A sheet has up to three: over its own borders, over the rectangle around its projection onto a plane, and over the
//! rectangle around it where it was spread out.
//!
//! The decisions are ours; the methods are those of [`chart`](crate::chart).

use super::base::{Base, Walls};
use super::over_mesh::OverMesh;
use super::spread_out::spread_out;
use super::{
    ChartOptions, Charted, Extends, LONG_EDGE, LONG_MESH_EDGE, POOR_FOLDED, is_poor_chart,
    places_on, states,
};
use crate::chart::Topology;
use crate::chart::plane::{PlaneChart, RECTANGULAR, Sides, plane_chart};
use glam::DVec3;
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::clean::CleanScan;
use std::sync::OnceLock;

/// Share of a cloud without a certain place on the plane, up to which no mesh is made. Trial: on a sheet that curls
/// over at a border, whose strip beyond upright had no place of its own on the plane, 95 % of the points were within
/// 4.28 mm, and over a mesh within 0.04 mm.
const MAX_DOUBTFUL: f64 = 5e-3;
/// Root mean square stretch of a sheet over its best plane above which it is spread out, too. Trial: not varied.
const MAX_PLANE_STRETCH: f64 = 1.2;
/// Least cosine of a normal to the plane that counts for this. Guard: 3.5 % of the points on walls then make up the limit
/// above.
const LEAST_COSINE: f64 = 0.2;

/// The charts of a cleaned part. Each is made when it is first asked for, and then kept; what is refused is tried again.
#[derive(Debug)]
pub struct Charts<'a> {
    scan: &'a CleanScan,
    options: ChartOptions,
    mesh: OnceLock<Base>,
    chart: OnceLock<Charted>,
    flat: OnceLock<Flat>,
    spread_out: OnceLock<Option<Charted>>,
}

/// The projection of a part onto its best plane.
#[derive(Debug)]
struct Flat {
    /// The chart in the rectangle around it, if that is one and some of it stays empty.
    charted: Option<Charted>,
    /// Whether the projection is no good chart.
    bends_over: bool,
}

impl<'a> Charts<'a> {
    /// The charts of a cleaned part; none is made yet.
    #[must_use]
    pub const fn new(scan: &'a CleanScan, options: ChartOptions) -> Self {
        Self {
            scan,
            options,
            mesh: OnceLock::new(),
            chart: OnceLock::new(),
            flat: OnceLock::new(),
            spread_out: OnceLock::new(),
        }
    }

    /// The chart over the borders of the part.
    ///
    /// It is made by projection if there is no mesh and a plane suffices, else over a mesh. If the chart over the mesh is
    /// poor, as for the frayed borders of a range image, or for the mesh of a cloud that nearly projects onto a plane,
    /// the projection is used after all. O(n log n) for n points, with at most 60,000 vertices laid out.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for shapes without a chart, such as those with handles or branches, or with another
    /// topology than the one asked for; [`Error::NoSolution`]; [`Error::Cancelled`].
    pub fn chart(&self, progress: &dyn Progress) -> Result<&Charted> {
        once(&self.chart, || self.made(progress))
    }

    /// The chart in the rectangle around a sheet that projects onto its best plane and does not fill that rectangle;
    /// `None` for other scans. O(n).
    ///
    /// # Errors
    /// [`Error::Invalid`] if there are no points.
    pub fn natural_base(&self) -> Result<Option<&Charted>> {
        Ok(match self.may_be_sheet() {
            true => self.flat()?.charted.as_ref(),
            false => None,
        })
    }

    /// The chart in the rectangle around a sheet that was spread out, for one that bends over or is steep to its best plane;
    /// `None` if it cannot be spread out, or its borders are the sides of a rectangle. O(n log n).
    ///
    /// # Errors
    /// [`Error::Invalid`] if there are no points; [`Error::Cancelled`].
    pub fn spread_out(&self, progress: &dyn Progress) -> Result<Option<&Charted>> {
        if !self.may_be_sheet() || !self.flat()?.bends_over {
            return Ok(None);
        }
        let (scan, vertices) = (self.scan, self.options.vertices);
        let made = || match self.mesh(progress) {
            Ok(mesh) => spread_out(scan, mesh, vertices, progress),
            Err(Error::Cancelled) => Err(Error::Cancelled),
            Err(_) => Ok(None),
        };
        Ok(once(&self.spread_out, made)?.as_ref())
    }

    fn made(&self, progress: &dyn Progress) -> Result<Charted> {
        let scan = self.scan;
        let sheet = self.may_be_sheet();
        let mut flat = None;
        if scan.triangles.is_empty() && sheet {
            match projected(scan, Sides::Outline) {
                Err(Error::Unsupported(_)) => {}
                Ok(found) if found.doubtful <= MAX_DOUBTFUL => return Ok(found.charted),
                other => flat = Some(other?.charted),
            }
        }
        let laid = self
            .mesh(progress)
            .and_then(|mesh| OverMesh::of(scan, mesh, self.options.topology, progress));
        let over_mesh = laid.and_then(|over_mesh| {
            let quality = over_mesh.laid.chart.quality;
            Ok((over_mesh.charted(scan, self.options.vertices)?, quality))
        });
        if let Some(flat) = flat {
            // A sheet that bends over beyond upright has a place for all points only over a mesh, if it has one.
            return match over_mesh {
                Ok((over_mesh, quality))
                    if over_mesh.chart.topology == Topology::Disk && !is_poor_chart(quality) =>
                {
                    Ok(over_mesh)
                }
                Err(Error::Cancelled) => Err(Error::Cancelled),
                _ => Ok(flat),
            };
        }
        let (over_mesh, quality) = over_mesh?;
        let poor = is_poor_chart(quality);
        if poor && sheet && over_mesh.chart.topology == Topology::Disk {
            match projected(scan, Sides::Outline) {
                Err(Error::Unsupported(_)) => {}
                other => return other.map(|found| found.charted),
            }
        }
        if quality.folded > POOR_FOLDED {
            return Err(Error::Unsupported(format!(
                "the surface cannot be laid out: {:.1} % of it would fold over; its border is too ragged or it is crumpled",
                100.0 * quality.folded
            )));
        }
        Ok(over_mesh)
    }

    /// The projection onto a plane, and whether it is no good chart.
    fn flat(&self) -> Result<&Flat> {
        let (scan, vertices) = (self.scan, self.options.vertices);
        let none = |bends_over: bool| Flat {
            charted: None,
            bends_over,
        };
        once(&self.flat, || match projected(scan, Sides::Rectangle) {
            Ok(found) if found.doubtful > MAX_DOUBTFUL => Ok(none(true)),
            Ok(Projected {
                mut charted, steep, ..
            }) => {
                let bends_over = steep > MAX_PLANE_STRETCH;
                if charted.extends == Extends::No {
                    return Ok(none(bends_over));
                }
                let step = scan.spacing * if vertices { LONG_MESH_EDGE } else { LONG_EDGE };
                let of = |k: u32| {
                    let k = k as usize;
                    (scan.points[k], charted.chart.parameters[k])
                };
                let corners = scan.triangles.iter().map(|t| {
                    let corners = t.map(of);
                    (corners.map(|c| c.0), corners.map(|c| c.1))
                });
                charted.inside = places_on(corners, Topology::Disk, step, false);
                Ok(Flat {
                    charted: Some(charted),
                    bends_over,
                })
            }
            Err(Error::Unsupported(_)) => Ok(none(true)),
            Err(other) => Err(other),
        })
    }

    /// The mesh of the part, whose walls are kept apart.
    fn mesh(&self, progress: &dyn Progress) -> Result<&Base> {
        once(&self.mesh, || Base::of(self.scan, Walls::Apart, progress))
    }

    /// Whether a sheet was asked for, or nothing.
    fn may_be_sheet(&self) -> bool {
        self.options.topology.is_none_or(|t| t == Topology::Disk)
    }
}

/// What `cell` holds, made if it is empty.
fn once<T>(cell: &OnceLock<T>, make: impl FnOnce() -> Result<T>) -> Result<&T> {
    match cell.get() {
        Some(known) => Ok(known),
        None => make().map(|made| cell.get_or_init(|| made)),
    }
}

/// The chart of a part over its borders: [`Charts::chart`]. O(n log n).
///
/// # Errors
/// As [`Charts::chart`].
pub fn chart(scan: &CleanScan, options: &ChartOptions, progress: &dyn Progress) -> Result<Charted> {
    Charts::new(scan, *options).made(progress)
}

/// Root mean square stretch of a sheet over its best plane: that of its tangent planes with the given normals. O(n).
fn projected_stretch(normals: &[DVec3], across: DVec3) -> f64 {
    let square = |n: &DVec3| {
        let cosine = n.dot(across).abs().max(LEAST_COSINE);
        0.5 * (1.0 + 1.0 / (cosine * cosine))
    };
    (normals.iter().map(square).sum::<f64>() / normals.len().max(1) as f64).sqrt()
}

/// A chart by projection onto the best plane.
struct Projected {
    charted: Charted,
    /// Share of the scan without a place of its own there.
    doubtful: f64,
    /// Root mean square stretch of the scan over the plane.
    steep: f64,
}

/// The chart by projection onto the best plane, with these sides. O(n).
fn projected(scan: &CleanScan, sides: Sides) -> Result<Projected> {
    let PlaneChart {
        chart,
        beyond,
        doubtful,
        frame,
        filled,
    } = plane_chart(scan, sides)?;
    // A cloud that fills its rectangle has that domain in any case.
    let extends = sides == Sides::Rectangle && (filled < RECTANGULAR || !scan.triangles.is_empty());
    let mut notes = Notes::default();
    notes.detail(chart.reason.clone());
    let charted = Charted {
        chart,
        states: states(beyond.into_iter(), &[]),
        inside: Vec::new(),
        support: Vec::new(),
        facing: Vec::new(),
        extends: match extends {
            true => Extends::OverPlane(frame),
            false => Extends::No,
        },
        is_flat: sides == Sides::Rectangle || filled >= RECTANGULAR,
        notes,
    };
    Ok(Projected {
        charted,
        doubtful,
        steep: projected_stretch(&scan.normals, frame[2]),
    })
}

//! A part laid out over a mesh: the mesh, the domain that its topology demands, and the charts that follow.
//!
//! 1. A mesh, repaired ([`Base`]).
//! 2. Its topology, its holes filled, its layout ([`reading`]).
//! 3. A place for every point: on the layout, or, for a sheet, on the same mesh spread out in the plane.
//!
//! The decisions are ours; the methods are those of [`chart`](crate::chart).

use super::base::{Base, Kind, Walls};
use super::{
    Charted, Extends, LONG_EDGE, LONG_MESH_EDGE, places_on, reading, states, typical_edge,
};
use crate::chart::Topology;
use crate::chart::shape::{MeshShape, shape_of};
use crate::chart::surface_mesh::{MAX_NEW_FOLDS, MeshChart, chart_of_mesh};
use crate::fit::approximate::Facing;
use glam::{DVec2, DVec3};
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::{Unit, counted};
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::clean::CleanScan;
use nurbskin_scan::mesh::{Manifold, holes, repair};

/// Most rounds in which pockets are cut off. Guard: a layout without pockets ends them; each round lays the mesh out
/// again.
const POCKET_ROUNDS: usize = 3;
/// Distance past a border, in spacings, from which a point is not part of the surface; such points would pile up on the
/// border. Trial: not recorded; 3 in an earlier version.
pub(super) const MAX_BEYOND: f64 = 1.0;

/// A part laid out over a mesh.
#[derive(Debug)]
pub(super) struct OverMesh<'a> {
    base: &'a Base,
    /// The mesh that was laid out instead, if any.
    other: Option<Base>,
    pub(super) laid: LaidOut,
}

impl<'a> OverMesh<'a> {
    /// The layout of a mesh whose walls are kept apart over the domain of this topology, or of its own.
    pub(super) fn of(
        scan: &CleanScan,
        base: &'a Base,
        topology: Option<Topology>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let is_cloud = base.kind == Kind::Cloud;
        let free = topology.is_none();
        let laid = reading::best(&base.manifold, topology, scan.unit, progress);
        let (other, laid) = match laid {
            // Normals whose sides are wrong, after noise or at a sharp fold, tear a cloud apart and leave handles.
            Err(Error::Unsupported(why)) if is_cloud && free => {
                let other = Base::of(scan, Walls::Either, progress)?;
                match reading::best(&other.manifold, topology, scan.unit, progress) {
                    Err(Error::Unsupported(_)) => (None, Err(Error::Unsupported(why))),
                    laid => (Some(other), laid),
                }
            }
            laid => (None, laid),
        };
        let laid = laid.map_err(|error| match error {
            // The mesh of a cloud is a guess.
            Error::Unsupported(why) if is_cloud && free => Error::Unsupported(format!(
                "{why}; if walls that lie closer together than about {} were joined by mistake, fit a mesh of the part",
                scan.unit.length(2.0 * typical_edge(&base.manifold))
            )),
            other => other,
        })?;
        Ok(Self { base, other, laid })
    }

    /// The chart over the layout. `vertices`: the points are those of a mesh file.
    pub(super) fn charted(&self, scan: &CleanScan, vertices: bool) -> Result<Charted> {
        let LaidOut {
            mesh,
            chart,
            scanned,
            ..
        } = &self.laid;
        let base = self.other.as_ref().unwrap_or(self.base);
        let notes = self.laid.notes.clone();
        let mut charted = placed(scan, base, (mesh, chart), *scanned, (vertices, notes))?;
        charted.facing = facing(mesh, chart, *scanned);
        Ok(charted)
    }
}

/// The chart of the points over a mesh whose first `scanned` triangles are those of the scan.
pub(super) fn placed(
    scan: &CleanScan,
    base: &Base,
    (mesh, charted): (&Manifold, &MeshChart),
    scanned: usize,
    (vertices, layout): (bool, Notes),
) -> Result<Charted> {
    let mut notes = Notes {
        details: base.notes.clone(),
        ..Notes::default()
    };
    notes.append(layout);
    let placed = charted.place(mesh, &scan.points, Some(&scan.normals))?;
    let beyond = placed
        .beyond
        .iter()
        .map(|&by| by > MAX_BEYOND * scan.spacing);
    let loose = base.loose_bits(scan, mesh, &placed.distances);
    let states = states(beyond, &loose);
    let chart = charted.chart_of(placed.parameters);
    let places = |range: std::ops::Range<usize>, step: f64| {
        let filled = range.start >= scanned;
        let pairs = mesh.triangles[range.clone()]
            .iter()
            .zip(&charted.corners[range]);
        let corners = pairs.map(|(t, at)| (t.map(|k| mesh.points[k as usize]), *at));
        places_on(corners, charted.topology, step, filled)
    };
    let (own, filled) = (0..scanned, scanned..mesh.triangles.len());
    let long = if vertices { LONG_MESH_EDGE } else { LONG_EDGE };
    let step = long * scan.spacing;
    let (inside, support) = match base.kind {
        Kind::Own => (places(own, step), places(filled, step)),
        Kind::Decimated => (base.inside(scan, mesh, charted)?, places(filled, step)),
        Kind::Cloud => {
            // Between the vertices of a mesh that was made of a cloud there may be further points.
            let step = LONG_EDGE * scan.spacing.max(typical_edge(mesh));
            let all = [places(own, step), places(filled, step)];
            (Vec::new(), all.concat())
        }
    };
    let [long, wide] = charted.size.map(|size| scan.unit.length(size));
    notes.detail(format!("{}; about {long} x {wide}", chart.reason));
    Ok(Charted {
        states,
        chart,
        inside,
        support,
        facing: Vec::new(),
        extends: Extends::No,
        is_flat: false,
        notes,
    })
}

/// A description of the shape of a mesh, with the lengths of its openings.
pub(super) fn described(shape: &MeshShape, mesh: &Manifold, unit: Unit) -> String {
    let around = |&k: &usize| unit.length(mesh.border_length(k));
    let openings: Vec<String> = shape.openings.iter().map(around).collect();
    match openings.is_empty() {
        true => shape.reason.clone(),
        false => format!("{}; border length {}", shape.reason, openings.join(" and ")),
    }
}

/// Normals of a mesh, at its rims and on its first `count` triangles. O(n log n).
fn facing(mesh: &Manifold, charted: &MeshChart, count: usize) -> Vec<Facing> {
    let made = |inside: bool| {
        move |(parameters, normal): (DVec2, DVec3)| Facing {
            parameters,
            normal,
            inside,
        }
    };
    let rims = charted.facing_at_rims(mesh, typical_edge(mesh));
    let middles = charted.facing(mesh, count);
    let rims = rims.into_iter().map(made(false));
    rims.chain(middles.into_iter().map(made(true))).collect()
}

/// A mesh laid out with its holes filled.
#[derive(Debug)]
pub(super) struct LaidOut {
    /// The mesh before holes were filled.
    pub(super) source: Manifold,
    pub(super) mesh: Manifold,
    /// Number of triangles of the scan; those after them were filled in.
    pub(super) scanned: usize,
    pub(super) chart: MeshChart,
    pub(super) notes: Notes,
}

/// Lays a mesh out, and again without patches that hang on it by too narrow a neck.
pub(super) fn without_pockets(
    source: Manifold,
    shape: &MeshShape,
    progress: &dyn Progress,
) -> Result<LaidOut> {
    let mut laid = lay_out(source, &shape.holes, progress)?;
    let mut cut = 0;
    for _ in 0..POCKET_ROUNDS {
        let mut pockets = laid.chart.pockets(&laid.mesh);
        pockets.truncate(laid.scanned);
        let count = pockets.iter().filter(|p| **p).count();
        if count == 0 {
            break;
        }
        let manifold = repair::without(laid.source.clone(), &pockets);
        let Ok(shape) = shape_of(&manifold, Some(shape.topology)) else {
            break;
        };
        progress.check()?;
        let Ok(next) = lay_out(manifold, &shape.holes, progress) else {
            break;
        };
        if next.chart.quality.folded > laid.chart.quality.folded.max(MAX_NEW_FOLDS) {
            break;
        }
        cut += count;
        laid = next;
    }
    if cut > 0 {
        laid.notes.detail(format!(
            "removed {} attached only by a narrow neck",
            counted(cut, "triangle", "triangles")
        ));
    }
    Ok(laid)
}

/// Fills the holes and charts the mesh.
fn lay_out(source: Manifold, holes: &[usize], progress: &dyn Progress) -> Result<LaidOut> {
    let mut notes = Notes::default();
    let scanned = source.triangles.len();
    let (mesh, filled) = holes::fill(source.clone(), holes);
    if !filled.is_empty() {
        notes.detail(format!(
            "bridged {} to lay the mesh out",
            counted(filled.len(), "hole", "holes")
        ));
    }
    let chart = chart_of_mesh(&mesh, progress)?;
    Ok(LaidOut {
        source,
        mesh,
        scanned,
        chart,
        notes,
    })
}

//! The mesh of one part, for surfaces that need no chart: networks of faces.
//!
//! It is the mesh that a chart lies over: the scan's own, one with fewer vertices, or one made of the points; spurious
//! handles are cut open. Small holes of the scan are filled, other borders stay open, their notches closed and ragged ones
//! opened and continued to an even line, and true handles stay.
//!
//! The decisions are those of [`chart`](super::chart).

use super::base::{Base, Kind, Walls};
use crate::chart::shape::holes_of;
use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::spatial::nearest::Nearest;
use nurbskin_geometry::spatial::neighbours::Neighbours;
use nurbskin_geometry::unit::counted;
use nurbskin_scan::clean::CleanScan;
use nurbskin_scan::mesh::rims::{self, Evened};
use nurbskin_scan::mesh::{Manifold, holes, notches};

/// Largest area of all holes that are filled, as a share of that of the mesh. Dimensionless.
/// Guard: a network covers a filled hole, and invents the surface there: with all windows of a car's side panel filled, 40 % of it.
const MOST_FILLED: f64 = 0.03;

/// The mesh of one part of a scan.
#[derive(Clone, Debug)]
pub struct PartMesh {
    /// The mesh; vertices without a source are in filled holes. Those of ragged rims have moved away from their points.
    pub manifold: Manifold,
    /// Whether it was made of points, and is a guess.
    pub is_cloud: bool,
    /// Which points of the scan belong to bits of its mesh that only touch this one, or to narrow teeth of its rim.
    pub detached: Vec<bool>,
    /// Number of holes that were filled.
    pub filled: usize,
    /// Repairs, for the user.
    pub notes: Notes,
}

/// The mesh of a part, with its holes filled and its openings open.
///
/// O(n log n) for n points; the mesh has 60,000 vertices at most.
///
/// # Errors
/// [`Error::Unsupported`](nurbskin_geometry::Error::Unsupported) for a surface with only one side;
/// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) without triangles to use;
/// [`Error::Cancelled`](nurbskin_geometry::Error::Cancelled).
pub fn mesh_of(scan: &CleanScan, progress: &dyn Progress) -> Result<PartMesh> {
    let (base, manifold, filled) = simplest(scan, progress)?;
    let mut notes = Notes {
        details: base.notes.clone(),
        ..Notes::default()
    };
    if filled > 0 {
        notes.detail(format!("filled {}", counted(filled, "hole", "holes")));
    }
    let (manifold, closed) = notches::close(manifold);
    if closed > 0 {
        let added = counted(closed, "triangle", "triangles");
        notes.detail(format!("closed notches in its borders with {added}"));
    }
    let is_cloud = base.kind == Kind::Cloud;
    let mut detached = vec![false; scan.points.len()];
    if !is_cloud {
        let distances = distances(&scan.points, &manifold);
        let loose = base.loose_bits(scan, &manifold, &distances);
        detached.iter_mut().zip(loose).for_each(|(d, off)| *d = off);
    }
    let places = manifold.points.clone();
    let Evened { mesh, ragged, lost } = rims::evened(manifold);
    if ragged > 0 {
        let rims = counted(ragged, "ragged border", "ragged borders");
        notes.detail(format!(
            "continued {rims} to an even line outside the points"
        ));
    }
    if lost.contains(&true) {
        let at_lost = nearest_is(&scan.points, &places, &lost);
        let count = at_lost.iter().filter(|at| **at).count();
        let points = counted(count, "point", "points");
        notes.detail(format!("left out {points} in narrow teeth of the border"));
        detached
            .iter_mut()
            .zip(at_lost)
            .for_each(|(d, at)| *d |= at);
    }
    Ok(PartMesh {
        detached,
        manifold: mesh,
        is_cloud,
        filled,
        notes,
    })
}

/// A mesh with its holes filled; of a cloud, the reading of close walls with fewer handles and openings.
fn simplest(scan: &CleanScan, progress: &dyn Progress) -> Result<(Base, Manifold, usize)> {
    let made = |walls| -> Result<(Base, Manifold, usize)> {
        let base = Base::of(scan, walls, progress)?;
        progress.check()?;
        let holes = small_holes(&base.manifold);
        let (manifold, filled) = holes::fill(base.manifold.clone(), &holes);
        Ok((base, manifold, filled.len()))
    };
    let first = made(Walls::Apart)?;
    let features = |m: &Manifold| m.genus() + m.loops.len();
    if first.0.kind != Kind::Cloud || features(&first.1) <= 1 {
        return Ok(first);
    }
    // Normals whose sides are wrong tear a cloud apart and leave handles.
    let other = made(Walls::Either)?;
    let simpler = features(&other.1) < features(&first.1);
    Ok(if simpler { other } else { first })
}

/// The borders that are holes for certain and that together are a small part of the surface.
fn small_holes(mesh: &Manifold) -> Vec<usize> {
    let mut holes: Vec<(f64, usize)> = holes_of(mesh)
        .into_iter()
        .map(|k| (mesh.flat_area(k), k))
        .collect();
    holes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut left = MOST_FILLED * mesh.area();
    let fits = |hole: &(f64, usize)| {
        left -= hole.0;
        left >= 0.0
    };
    let mut small: Vec<usize> = holes.into_iter().take_while(fits).map(|h| h.1).collect();
    small.sort_unstable();
    small
}

/// For each point whether the nearest of some places is marked.
fn nearest_is(points: &[DVec3], places: &[DVec3], marked: &[bool]) -> Vec<bool> {
    let tree = Neighbours::new(places);
    each(points.len(), |k| {
        let nearest = tree.nearest(points[k], 1);
        nearest.iter().any(|&j| marked[j as usize])
    })
}

/// Distance of each point from a mesh.
fn distances(points: &[DVec3], mesh: &Manifold) -> Vec<f64> {
    let nearest = Nearest::new(&mesh.points, Some(&mesh.triangles));
    each(points.len(), |k| {
        let found = nearest.closest(points[k], None);
        found.map_or(f64::INFINITY, |place| place.distance)
    })
}

//! From triangles as they come to a surface with borders.

pub(super) mod rim;
mod soup;
pub(super) mod surface;
mod winding;

use super::handles;
use super::handles::CutHandles;
use super::manifold::Manifold;
use glam::DVec3;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::{counted, percent};
use nurbskin_geometry::{Error, Result};
use soup::Soup;
use surface::Surface;

/// Cuts longer than this, against the square root of the area, are not faults of a mesh: the surface has one side. Where
/// sheets are joined that only touch, it bends at the cut; the second figure is for cuts where it is flat.
const ONE_SIDED: f64 = 0.5;
const ONE_SIDED_AND_FLAT: f64 = 0.15;
/// Pieces with more than this part of the largest one's area are told of as pieces rather than as loose bits.
const COMPARABLE: f64 = 0.1;

/// A mesh after [`repair`].
#[derive(Clone, Debug, Default)]
pub struct Repaired {
    /// The main piece. Its vertices and triangles are in an order that depends on coordinates only.
    pub manifold: Manifold,
    /// What was changed, a sentence each, for the user; empty for a mesh that was a manifold.
    pub notes: Vec<String>,
    /// Indices of the points that had triangles and are no vertex of the manifold, ascending. Of points at the same
    /// place only the first counts, as in [`Manifold::source`].
    pub left_out: Vec<u32>,
}

/// Makes a [`Manifold`] of any triangles between points.
///
/// 1. Triangles without extent, with points that do not exist or are not finite, and twins are dropped; points with
///    equal coordinates are one.
/// 2. Where more than two triangles share an edge, those that continue each other best are joined in pairs.
/// 3. All are wound the same way, outward if the surface is closed, else as most of them were; where that is impossible
///    the surface is cut open.
/// 4. The edge-connected piece of largest area is kept.
/// 5. Vertices where sheets only touch are split, as are borders that touch themselves.
/// 6. What hangs on the rim by one edge, from single teeth to strips one triangle wide, is taken off.
/// 7. Spurious handles are cut (see [`handles`]).
///
/// The result does not depend on the order of points and triangles, nor on the winding of closed surfaces. About
/// O(n log n).
///
/// # Errors
/// [`Error::Invalid`] if there is no triangle to use, [`Error::Unsupported`] for a surface with only one side (a Moebius
/// strip), [`Error::Cancelled`].
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_scan::mesh::repair::repair;
/// use nurbskin_geometry::progress::Silent;
/// // Two triangles, one wound the wrong way, and a fin on the edge between them.
/// let points = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.], [0.5, 0.5, 0.3]].map(DVec3::from);
/// let repaired = repair(&points, &[[0, 1, 2], [0, 3, 2], [0, 2, 4]], &Silent)?;
/// assert_eq!(repaired.manifold.triangles.len(), 2);
/// assert_eq!(repaired.manifold.loops[0].len(), 4);
/// assert_eq!(repaired.left_out, [4]);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
pub fn repair(
    points: &[DVec3],
    triangles: &[[u32; 3]],
    progress: &dyn Progress,
) -> Result<Repaired> {
    let mut notes = Vec::new();
    // 1. What can be used at all.
    let soup = Soup::new(points, triangles);
    if soup.triangles.is_empty() {
        return Err(Error::invalid(
            "the mesh has no triangle with three different, finite points; fit its points alone, without triangles",
        ));
    }
    notes.extend(soup.notes());
    progress.check()?;
    // 2. and 3. Who continues whom, wound alike.
    let (mut surface, joined) = Surface::join(&soup);
    progress.check()?;
    let torn = surface.wind(joined.trusted);
    notes.extend(joined.note());
    if torn.length > 0.0 {
        let scale = surface.area().sqrt();
        if torn.length > ONE_SIDED * scale || torn.flat > ONE_SIDED_AND_FLAT * scale {
            return Err(Error::Unsupported(format!(
                "the mesh has only one side, like a Moebius strip; cut it open along {}, where it may have a border",
                counted(torn.edges, "edge", "edges"),
            )));
        }
        notes.push(format!(
            "cut the mesh open at {} whose triangles face opposite ways",
            counted(torn.edges, "edge", "edges"),
        ));
    }
    progress.check()?;
    // 4. and 5. The main piece, its vertices one fan each.
    let assembled = surface.assemble();
    notes.extend(pieces_note(&assembled.pieces));
    let mut manifold = assembled.manifold;
    // 6. Teeth and strips of the rim.
    let mut taken = rim::smooth(&mut manifold);
    progress.check()?;
    // 7. Handles that are no handles; their cuts may leave teeth.
    let CutHandles { count, .. } = handles::cut_spurious(&mut manifold, progress)?;
    if count > 0 {
        taken.merge(&rim::smooth(&mut manifold));
        notes.push(format!(
            "{} cut open",
            counted(count, "spurious handle was", "spurious handles were"),
        ));
    }
    notes.extend(taken.note());
    manifold.face_outward();
    let left_out = soup.without(&manifold);
    Ok(Repaired {
        manifold,
        notes,
        left_out,
    })
}

/// The main piece of a surface without some of its triangles; the vertices that remain keep their source. O(n log n).
pub fn without(manifold: Manifold, gone: &[bool]) -> Manifold {
    let mut kept = rim::without(manifold, gone);
    rim::smooth(&mut kept);
    kept
}

/// Says which pieces were left out; areas, largest first.
fn pieces_note(areas: &[f64]) -> Option<String> {
    let (main, others) = areas.split_first()?;
    if others.is_empty() {
        return None;
    }
    let total: f64 = others.iter().sum();
    let large = others.iter().filter(|&&a| a > COMPARABLE * main).count();
    let share = total / (total + main).max(f64::MIN_POSITIVE);
    Some(if large > 0 {
        format!(
            "the mesh falls into {}, of which {} at least a tenth as large as the largest; only the largest is used, \
             {} of the area is left out",
            counted(areas.len(), "piece", "pieces"),
            counted(large, "other is", "others are"),
            percent(share)
        )
    } else {
        format!(
            "removed {}, {} of the area",
            counted(others.len(), "loose fragment", "loose fragments"),
            percent(share)
        )
    })
}

impl Manifold {
    /// Turns a closed surface outward.
    fn face_outward(&mut self) {
        if !self.loops.is_empty() {
            return;
        }
        let origin = self.points.first().copied().unwrap_or_default();
        let volume = |t| {
            let [a, b, c] = self.corners(t).map(|p| p - origin);
            a.dot(b.cross(c))
        };
        if (0..self.triangles.len()).map(volume).sum::<f64>() < 0.0 {
            self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
    }
}

#[cfg(test)]
#[allow(
    clippy::cast_possible_truncation,
    clippy::float_cmp,
    reason = "small meshes; exact numbers are meant"
)]
mod tests;

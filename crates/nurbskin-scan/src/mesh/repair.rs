//! Repair: any set of triangles becomes an oriented manifold with borders.
//!
//! Steps: usable triangles between distinct points; pairs across each edge; a common winding, with cuts where there is
//! none; the largest piece, with one fan of triangles per vertex; removal of teeth at the border; cuts of spurious
//! handles. All steps act on the pairing of sides, so that a cut is a pair less and a vertex is a class of corners
//! that meet across pairs.
//!
//! Source: the sequence is ours; A. Guéziec, G. Taubin, F. Lazarus, B. Horn, *Cutting and stitching: converting sets
//! of polygons to manifold surfaces*, IEEE TVCG 7(2), 2001, describes the same operations.

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

/// Total length of the cuts, in square roots of the area, above which the surface has one side and they are no faults
/// of the mesh. Trial: not recorded. 0.15 was too small for meshes whose sheets touch without belonging together.
const MAX_CUT_LENGTH: f64 = 0.5;
/// Length of the longest connected cut where the surface is flat, in the same unit, above which the surface has one
/// side. Trial: not recorded. Where sheets are joined that only touch, the surface bends at the cut; a flat cut that
/// runs on is one through a Moebius strip. Short ones are faults of a cloud's triangles at edges and thin walls.
const MAX_FLAT_CUT_LENGTH: f64 = 0.15;
/// Area of a piece, as a share of the largest one's, above which the note calls it a piece and not a fragment. Trial:
/// not recorded. It only changes the words of the note.
const COMPARABLE_PIECE: f64 = 0.1;

/// A mesh after [`repair`].
#[derive(Clone, Debug, Default)]
pub struct Repaired {
    /// The main piece. Its vertices and triangles are in an order that depends on coordinates only.
    pub manifold: Manifold,
    /// The changes, a sentence each, for the user; empty for a mesh that was a manifold.
    pub notes: Vec<String>,
    /// Indices of the points that had triangles and are no vertex of the manifold, ascending. Of points with equal
    /// coordinates only the first counts, as in [`Manifold::source`].
    pub left_out: Vec<u32>,
}

/// Makes a [`Manifold`] of any triangles between points.
///
/// 1. Triangles without extent, triangles with points that do not exist or are not finite, and repeated triangles are
///    dropped; points with equal coordinates become one.
/// 2. Where more than two triangles share an edge, those that continue each other best are joined in pairs.
/// 3. All triangles are wound alike: outward if the surface is closed, otherwise as most of them were. Where that is
///    impossible, the surface is cut.
/// 4. The edge-connected piece of largest area is kept.
/// 5. Vertices where sheets only touch are split, and so are borders that touch themselves.
/// 6. Parts that hang on the border by one edge, from single teeth to strips one triangle wide, are removed.
/// 7. Spurious handles are cut (see [`handles`]).
///
/// The result does not depend on the order of points and triangles, nor on the winding of closed surfaces. About
/// O(n log n).
///
/// [`Error::Invalid`] if there is no triangle to use, [`Error::Unsupported`] for a surface with only one side (a
/// Moebius strip), [`Error::Cancelled`].
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
    // 1. Usable triangles.
    let soup = Soup::new(points, triangles);
    if soup.triangles.is_empty() {
        return Err(Error::invalid(
            "the mesh has no triangle with three different, finite points; fit its points alone, without triangles",
        ));
    }
    notes.extend(soup.notes());
    progress.check()?;
    // 2. and 3. Pairs across edges, wound alike.
    let (mut surface, joined) = Surface::join(&soup);
    progress.check()?;
    let torn = surface.wind(joined.trusted);
    notes.extend(joined.note());
    if torn.length > 0.0 {
        let scale = surface.area().sqrt();
        if torn.length > MAX_CUT_LENGTH * scale || torn.longest > MAX_FLAT_CUT_LENGTH * scale {
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
    // 4. and 5. The main piece, with one fan of triangles per vertex.
    let assembled = surface.assemble();
    notes.extend(pieces_note(&assembled.pieces));
    let mut manifold = assembled.manifold;
    // 6. Teeth and strips at the border.
    let mut taken = rim::smooth(&mut manifold);
    progress.check()?;
    // 7. Spurious handles; the cuts may leave teeth.
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

/// The note about pieces that were left out, from the areas of all pieces, largest first.
fn pieces_note(areas: &[f64]) -> Option<String> {
    let (main, others) = areas.split_first()?;
    if others.is_empty() {
        return None;
    }
    let total: f64 = others.iter().sum();
    let large = others
        .iter()
        .filter(|&&a| a > COMPARABLE_PIECE * main)
        .count();
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

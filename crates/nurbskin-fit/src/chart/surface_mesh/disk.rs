//! Disks: the corners of the border at the corners of the domain.
//!
//! [`Rim`] proposes several sets of four corners. For each, the border is laid on the sides of a rectangle, the inside
//! is solved once, and the set whose layout stretches least is kept. The sides of the rectangle are as long as the
//! smoothed sides of the border.
//!
//! Source: corners by curvature and balance of opposite sides are usual; the choice by stretch is ours.

use super::layout::{Setup, Surface};
use super::ragged::{Tooth, depth, normals_along};
use super::relax::lay_out;
use super::rim::Rim;
use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::progress::Progress;

/// Least relative decrease of the stretch for which a later set of corners replaces an earlier one. Guard: above the
/// accuracy of the trial layouts' stretch, so that rounding does not choose.
const MIN_CORNER_GAIN: f64 = 1e-3;

/// The setup of the disk with this border whose corners give the least stretch, and a start for its places.
pub(super) fn disk(
    surface: &Surface<'_>,
    border: &[u32],
    progress: &dyn Progress,
) -> Result<Option<(Setup, Vec<DVec2>)>> {
    let rim = Rim::new(border.iter().map(|&k| surface.points[k as usize]).collect());
    let normals = normals_along(surface, border);
    let mut best: Option<(f64, Setup, Vec<DVec2>)> = None;
    for corners in rim.candidates(mean_normal(surface), &normals) {
        progress.check()?;
        let Some(places) = rim.border(corners) else {
            continue;
        };
        let mut setup = Setup::open(surface.points.len(), surface.triangles.len());
        for (&k, at) in border.iter().zip(&places.places) {
            let at = *at / places.size;
            setup.held[k as usize] = [Some(at.x), Some(at.y)];
        }
        // Each side from corner to corner; u grows along the first side.
        let n = border.len();
        for (side, (axis, base)) in [(1, 0.0), (0, 1.0), (1, 1.0), (0, 0.0)]
            .into_iter()
            .enumerate()
        {
            let (from, to) = (corners[side], corners[(side + 1) % 4]);
            for j in 0..=(to + n - from) % n {
                let k = (from + j) % n;
                let point = surface.points[border[k] as usize];
                let beside = places.beside[side].get(j).copied().unwrap_or_default();
                setup.teeth.push(Tooth {
                    vertex: border[k],
                    axis,
                    base,
                    depth: if k == from || k == to {
                        0.0
                    } else {
                        depth(point, normals[k], beside)
                    },
                });
            }
        }
        let start = vec![DVec2::splat(0.5); surface.points.len()];
        let layout = lay_out(surface, &mut setup, start, 0, progress)?;
        if best
            .as_ref()
            .is_none_or(|b| layout.stretch.whole < b.0 * (1.0 - MIN_CORNER_GAIN))
        {
            best = Some((layout.stretch.whole, setup, layout.places));
        }
    }
    Ok(best.map(|b| (b.1, b.2)))
}

/// The mean normal by area.
fn mean_normal(surface: &Surface<'_>) -> DVec3 {
    let area = |t: usize| {
        let [a, b, c] = surface.corners(t);
        (b - a).cross(c - a)
    };
    let sum: DVec3 = (0..surface.triangles.len()).map(area).sum();
    sum.try_normalize().unwrap_or(DVec3::Z)
}

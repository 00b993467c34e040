//! How far a surface reaches beyond its points, and how much it stretches there.
//!
//! Ours.

use glam::DVec3;
use nurbskin_fit::charting::Extends;
use nurbskin_geometry::NurbsSurface;
use nurbskin_geometry::point_grid::bounding_box;

/// Distance by which a surface may leave the box around its points, as a share of the diagonal of the box; beyond it
/// the surface runs off.
/// Trial: not recorded.
const MAX_OVERRUN: f64 = 0.1;
/// Largest stretch of a surface over a sheet that was spread out; beyond it the surface runs off. Dimensionless.
/// Derived: an extension with constant second derivatives that turns by 1.7 rad is stretched by √(1 + 1.7²) at its end.
const MAX_EXTENSION_STRETCH: f64 = 2.0;
/// Places along u and along v at which a surface is sampled for its box and its stretch. Count.
/// Guard: a corner that runs off by a tenth of the diagonal is wider than one cell of this grid.
const PROBES_PER_SIDE: usize = 128;

/// The bounding box of samples of a surface.
pub(super) fn box_of(surface: &NurbsSurface) -> [DVec3; 2] {
    let [(a, b), (c, d)] = surface.domain();
    let at = |k: usize| k as f64 / (PROBES_PER_SIDE - 1) as f64;
    let places = (0..PROBES_PER_SIDE * PROBES_PER_SIDE).map(|k| {
        let (u, v) = (at(k % PROBES_PER_SIDE), at(k / PROBES_PER_SIDE));
        surface.point(a + (b - a) * u, c + (d - c) * v)
    });
    bounding_box(&places.collect::<Vec<_>>())
}

/// Whether a surface leaves the box around its points by more than [`MAX_OVERRUN`]; the box is aligned with the axes of
/// the plane that the surface extends over, if any. A surface over a sheet that was spread out to a rectangle of this
/// `size` runs off if it stretches it by more than [`MAX_EXTENSION_STRETCH`].
pub(super) fn runs_off(
    surface: &NurbsSurface,
    points: &[DVec3],
    (extends, size): (Extends, [f64; 2]),
) -> bool {
    let [(a, b), (c, d)] = surface.domain();
    let at = |k: usize| (k as f64 + 0.5) / PROBES_PER_SIDE as f64;
    let mut probes = (0..PROBES_PER_SIDE * PROBES_PER_SIDE).map(|k| {
        let (u, v) = (at(k % PROBES_PER_SIDE), at(k / PROBES_PER_SIDE));
        [a + (b - a) * u, c + (d - c) * v]
    });
    let axes = match extends {
        Extends::No => DVec3::AXES,
        Extends::OverPlane(axes) => axes,
        Extends::SpreadOut => {
            return probes.any(|[u, v]| {
                let at = surface.derivatives(u, v);
                let stays = (b - a) * at.du.length() <= MAX_EXTENSION_STRETCH * size[0]
                    && (d - c) * at.dv.length() <= MAX_EXTENSION_STRETCH * size[1];
                !stays
            });
        }
    };
    let along = |p: DVec3| DVec3::from(axes.map(|axis| axis.dot(p)));
    let (lo, hi) = points
        .iter()
        .map(|&p| along(p))
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| {
            (lo.min(p), hi.max(p))
        });
    let margin = MAX_OVERRUN * lo.distance(hi);
    probes.any(|[u, v]| {
        let p = along(surface.point(u, v));
        p.cmplt(lo - margin).any() || p.cmpgt(hi + margin).any()
    })
}

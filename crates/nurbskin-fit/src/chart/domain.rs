//! The domain of a sheet that projects onto a plane.
//!
//! The domain is the rectangle around the projection, or a plane spline surface B(u, v) whose borders follow the
//! outline of the sheet. In the first case (u, v) is the place in the rectangle; in the second it is the foot point on
//! B, the minimum of |B(u, v) - p|. The outline is followed only if it encloses less than 93 % of the rectangle.
//!
//! Source: base surfaces for the parametrisation of points (Ma and Kruth 1995); the choice between the two is ours.

use super::{Chart, Topology, base, outline};
use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::contours::area;
use nurbskin_geometry::nurbs::closest::{ClosestPoint, Foot};

/// Root mean square distance from the outline up to which a border curve counts as close, in spacings. Trial: not
/// recorded. A smaller one makes borders follow the noise of the rim, a larger one leaves points beyond them.
const OUTLINE_TOLERANCE: f64 = 0.35;
/// Distance beyond the borders from which a point has no place on the surface, in spacings. Trial: not recorded. A
/// smaller one drops points of ragged rims, a larger one piles stray points up on the border.
const MAX_BORDER_DISTANCE: f64 = 1.5;
/// Share of its bounding rectangle from which on a sheet keeps the rectangle as its domain. Trial: rounded corners and
/// ragged rims leave less than 7 % open, a disc leaves 21 %.
pub const RECTANGULAR: f64 = 0.93;
/// Tolerance of foot points on the base surface, as a share of the rectangle's diagonal. Guard: a billionth of it is
/// far below what any scan resolves.
const FOOT_TOLERANCE: f64 = 1e-9;

/// A chart by projection, and the points without a place in it.
#[derive(Clone, Debug)]
pub struct PlaneChart {
    /// The chart of all points.
    pub chart: Chart,
    /// Points well beyond the borders: stray bits, ragged rims. They lie on the border in the chart, and a fit should
    /// leave them out.
    pub beyond: Vec<bool>,
    /// Share of the scan without a place of its own on the plane: turned away from it, or, in a cloud, in a second
    /// layer that is farther away than noise can explain.
    pub doubtful: f64,
    /// Axes of the plane along u and v, and the viewing direction; unit vectors.
    pub frame: [DVec3; 3],
    /// Share of the rectangle that the scan fills.
    pub filled: f64,
}

/// How the domain of a sheet is bounded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// The domain is the rectangle around the sheet; the surface continues beyond the outline and is trimmed there.
    Rectangle,
    /// The four sides of the domain follow the outline, unless the outline is a rectangle.
    Outline,
}

/// The chart of points in and around the rectangle from the origin to `size`, the points that lie well beyond its
/// borders, and the share of the rectangle that `picture` fills.
pub(super) fn chart(
    flat: &[DVec2],
    size: DVec2,
    picture: &outline::Picture<'_>,
    sides: Sides,
    reason: String,
) -> Result<(Chart, Vec<bool>, f64)> {
    let outline = outline::trace(picture, size);
    let filled = area(&outline) / (size.x * size.y);
    let follows = sides == Sides::Outline && filled < RECTANGULAR && !outline.is_empty();
    let base = if follows {
        base::fill(&outline, size, OUTLINE_TOLERANCE * picture.spacing)
    } else {
        None
    };
    let far = MAX_BORDER_DISTANCE * picture.spacing;
    let Some(base) = base else {
        let share = |p: &DVec2| (*p / size).clamp(DVec2::ZERO, DVec2::ONE);
        let off = |p: &DVec2| p.distance(p.clamp(DVec2::ZERO, size));
        let chart = Chart {
            topology: Topology::Disk,
            parameters: flat.iter().map(share).collect(),
            size: size.to_array(),
            reason,
        };
        return Ok((chart, flat.iter().map(|p| off(p) > far).collect(), filled));
    };
    let flat: Vec<DVec3> = flat.iter().map(|p| p.extend(0.0)).collect();
    let closest = ClosestPoint::with_tolerance(&base.surface, FOOT_TOLERANCE * size.length())?;
    let feet = closest.closest_all(&flat, None);
    let place = |f: &Foot| DVec2::new(f.u, f.v).clamp(DVec2::ZERO, DVec2::ONE);
    let chart = Chart {
        topology: Topology::Disk,
        parameters: feet.iter().map(place).collect(),
        size: base.size,
        reason: format!(
            "{reason}; it fills {:.0} % of its bounding rectangle, so the surface's edges follow its outline (areas \
             are {:.2} to {:.1} times their mean)",
            100.0 * filled,
            base.stretch[0],
            base.stretch[1]
        ),
    };
    let beyond = feet.iter().map(|f| f.distance > far).collect();
    Ok((chart, beyond, filled))
}

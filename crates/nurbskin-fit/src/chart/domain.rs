//! The domain of a scan that lies flat: the rectangle around it, or what its outline encloses.

use super::{Chart, Topology, base, outline};
use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::contours::area;
use nurbskin_geometry::nurbs::closest::{ClosestPoint, Foot};

/// How close the borders shall come to the outline, in spacings.
const CLOSE: f64 = 0.35;
/// Points so many spacings beyond the borders have no place on the surface.
const BEYOND: f64 = 1.5;
/// A scan that fills this part of its rectangle is taken to be one. By trial: rounded corners and ragged rims leave less than
/// 7 % open, a disc 21 %.
pub const RECTANGULAR: f64 = 0.93;
/// A chart by projection, with the points that it has no place for.
#[derive(Clone, Debug)]
pub struct PlaneChart {
    /// The chart of all points.
    pub chart: Chart,
    /// Which points lie well beyond its borders: stray bits, ragged rims. They are on the border in the chart, and a fit
    /// should leave them out.
    pub beyond: Vec<bool>,
    /// Part of the scan that has no place of its own on the plane: turned away from it, or, in a cloud, in a second layer
    /// that is farther off than noise throws points.
    pub doubtful: f64,
    /// Axes of the plane along u and v, and the direction from which it is seen; unit vectors.
    pub frame: [DVec3; 3],
    /// Part of the rectangle that the scan fills.
    pub filled: f64,
}

/// What the domain of a sheet is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// The domain is the rectangle around the sheet: its surface goes on beyond the outline, and is trimmed there.
    Rectangle,
    /// Four sides of the domain follow the outline, unless that is a rectangle.
    Outline,
}

/// The chart of points in and around the rectangle from the origin to `size`, which of them lie well beyond its borders, and
/// what part of the rectangle `picture` fills.
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
        base::fill(&outline, size, CLOSE * picture.spacing)
    } else {
        None
    };
    let far = BEYOND * picture.spacing;
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
    // A billionth of the rectangle is far below what any scan resolves.
    let closest = ClosestPoint::with_tolerance(&base.surface, 1e-9 * size.length())?;
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

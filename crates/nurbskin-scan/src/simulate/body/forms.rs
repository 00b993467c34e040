//! The parts of bodies: rounded primitives as distances from cores, and their smooth union.
//!
//! A rounded primitive is the set of points within a radius of its core: f(p) = |p - c(p)| - r, where c is the closest
//! point of the core, and grad f = (p - c) / |p - c|. Outside of a convex core, f is an exact signed distance with a
//! continuous gradient.

use glam::{DVec2, DVec3};

/// The value of an implicit function at a point, negative inside, and its gradient.
#[derive(Clone, Copy, Debug)]
pub(super) struct Level {
    pub(super) value: f64,
    pub(super) gradient: DVec3,
}

/// The signed distance from the points within `radius` of a core whose point `core` is the closest to `point`. The
/// gradient is zero on the core itself, which is inside.
pub(super) fn around(point: DVec3, core: DVec3, radius: f64) -> Level {
    let offset = point - core;
    Level {
        value: offset.length() - radius,
        gradient: offset.normalize_or_zero(),
    }
}

/// The union of two parts, blended where their values differ by less than `width` (mm).
///
/// The cubic smooth minimum: with h = max(1 - |a - b| / k, 0), f = min(a, b) - k h³ / 6. It is twice continuously
/// differentiable in a and b, and its gradient is a mean of the two gradients, so f stays 1-Lipschitz.
///
/// Source: I. Quilez, *Smooth minimum*, 2013 (iquilezles.org/articles/smin), cubic polynomial form.
pub(super) fn union(a: Level, b: Level, width: f64) -> Level {
    let (near, far) = if a.value <= b.value { (a, b) } else { (b, a) };
    let h = (1.0 - (far.value - near.value) / width).max(0.0);
    let weight = 0.5 * h * h;
    Level {
        value: near.value - width * h * h * h / 6.0,
        gradient: (1.0 - weight) * near.gradient + weight * far.gradient,
    }
}

/// The closest point of the segment from `a` to `b`.
pub(super) fn on_segment(point: DVec3, a: DVec3, b: DVec3) -> DVec3 {
    let along = b - a;
    a + along * ((point - a).dot(along) / along.length_squared()).clamp(0.0, 1.0)
}

/// The closest point of a circle about `centre` in the plane across the unit vector `axis`; a point of the axis gets any.
pub(super) fn on_circle(point: DVec3, centre: DVec3, axis: DVec3, radius: f64) -> DVec3 {
    let offset = point - centre;
    let flat = offset - axis * offset.dot(axis);
    centre + radius * flat.normalize_or(axis.any_orthonormal_vector())
}

/// The closest point of the half circle about `centre` in the plane y = const, on the side of greater x.
pub(super) fn on_half_circle(point: DVec3, centre: DVec3, radius: f64) -> DVec3 {
    let offset = point - centre;
    if offset.x >= 0.0 {
        on_circle(point, centre, DVec3::Y, radius)
    } else {
        centre + DVec3::Z * radius.copysign(offset.z)
    }
}

/// The closest point of the solid cylinder of `radius` about the x axis, from `low` to `high`.
pub(super) fn on_cylinder(point: DVec3, [low, high]: [f64; 2], radius: f64) -> DVec3 {
    let across = DVec2::new(point.y, point.z).clamp_length_max(radius);
    DVec3::new(point.x.clamp(low, high), across.x, across.y)
}

/// The convex hull of two balls about `a` and `b`: a cone with round ends, touched by both.
///
/// In the half plane through the axis, with s along the axis from `a` and ρ across, the flank is the line of unit normal
/// n = (sin θ, cos θ) in (s, ρ), sin θ = (ra - rb) / |b - a| for radii ra and rb. The value is that of the flank between its two points
/// of tangency, and of a ball beyond them.
pub(super) fn round_cone(point: DVec3, a: (DVec3, f64), b: (DVec3, f64)) -> Level {
    let length = a.0.distance(b.0);
    let axis = (b.0 - a.0) / length;
    let offset = point - a.0;
    let s = offset.dot(axis);
    let across = offset - s * axis;
    let rho = across.length();
    let sine = (a.1 - b.1) / length;
    let cosine = (1.0 - sine * sine).sqrt();
    // Place of the foot along the flank.
    let along = s * cosine - rho * sine;
    if along <= 0.0 {
        around(point, a.0, a.1)
    } else if along >= length * cosine {
        around(point, b.0, b.1)
    } else {
        Level {
            value: s * sine + rho * cosine - a.1,
            gradient: sine * axis + cosine * across.normalize_or_zero(),
        }
    }
}

/// The closest point of the curve from (0, `low`) along the line z = `low`, a quarter circle of radius `corner` and the
/// line ρ = `radius` up to `high`, turned about the z axis: the middle surface of a cup.
pub(super) fn on_cup(point: DVec3, radius: f64, corner: f64, [low, high]: [f64; 2]) -> DVec3 {
    let across = DVec2::new(point.x, point.y);
    let p = DVec2::new(across.length(), point.z);
    let centre = DVec2::new(radius - corner, low + corner);
    let to = p - centre;
    let turn = DVec2::new(to.x.max(0.0), to.y.min(0.0));
    let candidates = [
        DVec2::new(p.x.clamp(0.0, centre.x), low),
        centre + corner * turn.normalize_or(DVec2::new(0.5, -0.5).normalize()),
        DVec2::new(radius, p.y.clamp(centre.y, high)),
    ];
    let closer = |x: DVec2, y: DVec2| if p.distance(y) < p.distance(x) { y } else { x };
    let foot = closer(closer(candidates[0], candidates[1]), candidates[2]);
    let flat = foot.x * across.normalize_or(DVec2::X);
    DVec3::new(flat.x, flat.y, foot.y)
}

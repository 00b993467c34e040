//! The implicit functions of the bodies that are blended of parts. Lengths in millimetres, by design.

use super::forms::{
    Level, around, on_circle, on_cup, on_cylinder, on_half_circle, on_segment, round_cone, union,
};
use glam::DVec3;

/// Radius of the tee's main pipe, along x.
pub(super) const TEE_MAIN: f64 = 20.0;
/// Radius of the tee's branch, along z.
pub(super) const TEE_BRANCH: f64 = 14.0;
/// Distance of the tee's three ends from its middle.
pub(super) const TEE_END: f64 = 70.0;

/// Two rings of radius 26 and section radius 9, with centres 62 apart, so that the sections overlap where they meet.
pub(super) fn double_torus(p: DVec3) -> Level {
    let ring = |x: f64| {
        around(
            p,
            on_circle(p, DVec3::new(x, 0.0, 0.0), DVec3::Z, 26.0),
            9.0,
        )
    };
    union(ring(-31.0), ring(31.0), 8.0)
}

/// A cup of outer radius 42 with a wall of 8 and a half ring as handle. The handle ends inside the wall; its blend
/// (4) does not reach the inner side of the wall.
pub(super) fn mug(p: DVec3) -> Level {
    let cup = around(p, on_cup(p, 38.0, 12.0, [-45.0, 45.0]), 4.0);
    let handle = around(p, on_half_circle(p, DVec3::new(43.0, 0.0, 0.0), 25.0), 5.0);
    union(cup, handle, 4.0)
}

/// A head along x with a flat face and a tapered peen, on a tapered handle along z.
pub(super) fn hammer(p: DVec3) -> Level {
    let head = around(p, on_cylinder(p, [-10.0, 40.0], 12.0), 4.0);
    let peen = round_cone(
        p,
        (DVec3::new(-10.0, 0.0, 0.0), 14.0),
        (DVec3::new(-58.0, 0.0, 0.0), 5.0),
    );
    let handle = round_cone(p, (DVec3::new(0.0, 0.0, -130.0), 12.0), (DVec3::ZERO, 9.0));
    union(union(head, peen, 6.0), handle, 10.0)
}

/// A body along x with a chuck, a slanted grip, a flat foot, and a bent guard from the body to the foot.
pub(super) fn drill(p: DVec3) -> Level {
    /// Width of the blends.
    const BLEND: f64 = 8.0;
    let at = |x: f64, z: f64| DVec3::new(x, 0.0, z);
    let rod = |a: DVec3, b: DVec3, radius: f64| around(p, on_segment(p, a, b), radius);
    let body = around(p, on_cylinder(p, [-47.0, 27.0], 18.0), 8.0);
    let chuck = round_cone(p, (at(30.0, 0.0), 17.0), (at(75.0, 0.0), 9.0));
    let grip = rod(at(-22.0, -10.0), at(-40.0, -105.0), 15.0);
    let half = DVec3::new(40.0, 24.0, 8.0);
    let middle = at(-36.0, -115.0);
    let foot = around(p, middle + (p - middle).clamp(-half, half), 8.0);
    let guard = union(
        rod(at(16.0, -15.0), at(24.0, -62.0), 6.0),
        rod(at(24.0, -62.0), at(2.0, -112.0), 6.0),
        4.0,
    );
    let held = union(union(body, chuck, BLEND), grip, BLEND);
    union(union(held, foot, BLEND), guard, BLEND)
}

/// Two endless pipes, that along z only upward; the surface ends at the planes x = ±70 and z = 70, where it is an exact
/// cylinder. The blend is no wider than the difference of the radii: the far side of the main pipe has none.
pub(super) fn tee(p: DVec3) -> Level {
    let main = around(p, DVec3::new(p.x, 0.0, 0.0), TEE_MAIN);
    let branch = around(p, DVec3::new(0.0, 0.0, p.z.max(0.0)), TEE_BRANCH);
    union(main, branch, TEE_MAIN - TEE_BRANCH)
}

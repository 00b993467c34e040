//! Ragged rims: iso-lines follow the smoothed course of a rim instead of its teeth.
//!
//! A vertex of the rim at the depth d inside the smoothed rim, a length along the surface, is held at
//!
//! ```text
//! x = base ± d |∇x|
//! ```
//!
//! with the gradient of the layout so far, averaged around it. Teeth near folded triangles are made half as deep, again
//! and again. The domain then ends at a quantile of the depths: 5 % of the vertices of an even rim lie outside, and up
//! to 25 % of a ragged one.
//!
//! Source: ours.

use super::layout::{Setup, Surface};
use super::sides::NONE;
use glam::{DVec2, DVec3};
use nurbskin_geometry::numeric::statistics::median_in_place;

/// Quantiles of the depths of the vertices of a rim at which the domain ends, for an even rim and for a ragged one.
/// Trial: not recorded. Larger ones cut more teeth off, smaller ones make the surface bridge notches without data.
const RIM_QUANTILES: [f64; 2] = [0.05, 0.25];
/// Largest cut of a rim, in its roughness, so that an even rim keeps its corners. Trial: not recorded.
const MAX_CUT: f64 = 2.5;
/// Least distance by which the tip of a triangle at the rim stands out from its base, as a share of its height. Trial:
/// not recorded; with 0 such triangles lose their area.
const MIN_TIP_HEIGHT: f64 = 0.3;
/// Factor on the depth of teeth near folds, in each round. Trial: not recorded; bisection.
const TOOTH_SHRINKAGE: f64 = 0.5;
/// Vertices of a rim to either side over which its normals are averaged. Trial: not recorded.
const NORMAL_WINDOW: usize = 3;

/// A vertex of a rim and its depth inside the smoothed rim.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tooth {
    pub(super) vertex: u32,
    /// The direction that crosses the rim, 0 = u, 1 = v.
    pub(super) axis: usize,
    /// Its value on the smoothed rim: 0 or 1.
    pub(super) base: f64,
    /// Length along the surface, negative outside.
    pub(super) depth: f64,
}

impl Tooth {
    /// The sign of a step inwards.
    fn inward(&self) -> f64 {
        if self.base < 0.5 { 1.0 } else { -1.0 }
    }
}

/// Depth of a vertex of the border inside the smoothed border, which passes next to it at `middle` in the direction
/// `along`, measured on the surface with this normal. The border runs in the sense of its triangles, with the inside to
/// the left.
pub(super) fn depth(point: DVec3, normal: DVec3, (middle, along): (DVec3, DVec3)) -> f64 {
    let inward = normal.cross(along).normalize_or_zero();
    (point - middle).dot(inward)
}

/// Normals of the surface at the vertices of its border, averaged along it.
pub(super) fn normals_along(surface: &Surface<'_>, border: &[u32]) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; surface.points.len()];
    for (t, triangle) in surface.triangles.iter().enumerate() {
        let [a, b, c] = surface.corners(t);
        for &k in triangle {
            sums[k as usize] += (b - a).cross(c - a);
        }
    }
    let own: Vec<DVec3> = border
        .iter()
        .map(|&k| sums[k as usize].normalize_or_zero())
        .collect();
    let n = own.len();
    let reach = NORMAL_WINDOW.min(n.saturating_sub(1) / 2);
    let around = |k: usize| (0..=2 * reach).map(move |s| (k + n + s - reach) % n);
    (0..n)
        .map(|k| around(k).map(|j| own[j]).sum::<DVec3>())
        .map(DVec3::normalize_or_zero)
        .collect()
}

/// Holds the teeth at their depths next to the smoothed rim, by the slopes of the layout so far. The tip of a triangle
/// that hangs on the rim by one side always lies outside of that side. O(n).
pub(super) fn hold(surface: &Surface<'_>, setup: &mut Setup, raw: &[DVec2]) {
    if setup.teeth.is_empty() {
        return;
    }
    let slopes = slopes(surface, setup, raw);
    for tooth in &setup.teeth {
        let k = tooth.vertex as usize;
        let step = tooth.depth * slopes[k][tooth.axis];
        setup.held[k][tooth.axis] = Some(tooth.base + tooth.inward() * step);
    }
    let tips = tips(surface);
    // A corner of the domain belongs to two sides.
    let mut sides = vec![0_u8; surface.points.len()];
    for tooth in &setup.teeth {
        sides[tooth.vertex as usize] += 1;
    }
    for tooth in &setup.teeth {
        if sides[tooth.vertex as usize] > 1 {
            continue;
        }
        let k = tooth.vertex as usize;
        let Some((feet, height)) = tips[k] else {
            continue;
        };
        let depth = |k: usize| setup.held[k][tooth.axis].map(|x| (x - tooth.base) * tooth.inward());
        if let (Some(own), Some(a), Some(b)) =
            (depth(k), depth(feet[0] as usize), depth(feet[1] as usize))
        {
            let highest = a.min(b) - MIN_TIP_HEIGHT * height * slopes[k][tooth.axis];
            if own > highest {
                setup.held[k][tooth.axis] = Some(tooth.base + tooth.inward() * highest);
            }
        }
    }
}

/// For vertices of a single triangle: its other two vertices, and the distance from the side between them.
fn tips(surface: &Surface<'_>) -> Vec<Option<([u32; 2], f64)>> {
    let mut tips = vec![None; surface.points.len()];
    for (t, triangle) in surface.triangles.iter().enumerate() {
        for k in 0..3 {
            let open = |side: usize| surface.sides.partner[3 * t + side] == NONE;
            if open(k) && open((k + 2) % 3) {
                let p = surface.corners(t);
                let (b, c) = ((k + 1) % 3, (k + 2) % 3);
                let base = p[c] - p[b];
                let height = (p[k] - p[b]).reject_from(base).length();
                let feet = [triangle[b], triangle[c]];
                tips[triangle[k] as usize] = height.is_finite().then_some((feet, height));
            }
        }
    }
    tips
}

/// Moves the teeth near folded triangles towards their smoothed rim, and onto it in the `last` round. Returns whether
/// there are any. O(n).
pub(super) fn soften(
    surface: &Surface<'_>,
    setup: &mut Setup,
    places: &[DVec2],
    last: bool,
) -> bool {
    let mut near = vec![false; surface.points.len()];
    for (t, triangle) in surface.triangles.iter().enumerate() {
        let [a, b, c] = setup.lifted(triangle, t, places);
        if (b - a).perp_dot(c - a) <= 0.0 {
            for &k in triangle {
                near[k as usize] = true;
            }
        }
    }
    let folds = near.clone();
    for triangle in surface.triangles {
        if triangle.iter().any(|&k| folds[k as usize]) {
            for &k in triangle {
                near[k as usize] = true;
            }
        }
    }
    let mut any = false;
    for tooth in &mut setup.teeth {
        if near[tooth.vertex as usize] && tooth.depth != 0.0 {
            tooth.depth = if last {
                0.0
            } else {
                TOOTH_SHRINKAGE * tooth.depth
            };
            any = true;
        }
    }
    any
}

/// Lengths of the gradients of u and v at each vertex, averaged over two rings of triangles.
fn slopes(surface: &Surface<'_>, setup: &Setup, raw: &[DVec2]) -> Vec<DVec2> {
    let mut on_rim = vec![false; surface.points.len()];
    for tooth in &setup.teeth {
        on_rim[tooth.vertex as usize] = true;
    }
    let own = |t: usize| {
        let triangle = &surface.triangles[t];
        let p = surface.corners(t);
        let twice = (p[1] - p[0]).cross(p[2] - p[0]).length();
        // A triangle whose vertices all lie on the rim has no slope of its own.
        if twice <= 0.0 || triangle.iter().all(|&k| on_rim[k as usize]) {
            return (DVec2::ZERO, 0.0);
        }
        let x = setup.lifted(triangle, t, raw);
        let gradient = |k: fn(DVec2) -> f64| {
            let x = x.map(k);
            (x[0] * (p[2] - p[1]) + x[1] * (p[0] - p[2]) + x[2] * (p[1] - p[0])).length()
        };
        (DVec2::new(gradient(|p| p.x), gradient(|p| p.y)), twice)
    };
    let mut sums = vec![(DVec2::ZERO, 0.0); surface.points.len()];
    let add = |sums: &mut [(DVec2, f64)], t: usize, part: (DVec2, f64)| {
        for &k in &surface.triangles[t] {
            sums[k as usize].0 += part.0;
            sums[k as usize].1 += part.1;
        }
    };
    for t in 0..surface.triangles.len() {
        add(&mut sums, t, own(t));
    }
    let mut again = vec![(DVec2::ZERO, 0.0); surface.points.len()];
    for t in 0..surface.triangles.len() {
        let parts = surface.triangles[t].map(|k| sums[k as usize]);
        let part = parts
            .iter()
            .fold((DVec2::ZERO, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
        add(&mut again, t, part);
    }
    let mean = |&(sum, weight): &(DVec2, f64)| sum / f64::max(weight, f64::MIN_POSITIVE);
    again.iter().map(mean).collect()
}

/// Ends of the domain in a direction: few teeth of an even rim lie outside. Of a ragged rim more do, so that the
/// surface does not bridge the notches between them, where no data hold it.
pub(super) fn bounds(setup: &Setup, axis: usize) -> [f64; 2] {
    [0.0, 1.0].map(|base| {
        let of_end = |t: &&Tooth| t.axis == axis && (t.base - base).abs() < 0.5;
        let inward = if base < 0.5 { 1.0 } else { -1.0 };
        let mut depths: Vec<f64> = (setup.teeth.iter().filter(of_end))
            .filter_map(|t| setup.held[t.vertex as usize][axis])
            .map(|place| inward * (place - base))
            .collect();
        if depths.is_empty() {
            return base;
        }
        let rough = roughness(&depths);
        depths.sort_unstable_by(f64::total_cmp);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a part of the count"
        )]
        let [few, many] = RIM_QUANTILES.map(|part| depths[(part * depths.len() as f64) as usize]);
        base + inward * many.min(few + MAX_CUT * rough)
    })
}

/// Median offset of the vertices of a rim from the middle of their neighbours.
fn roughness(depths: &[f64]) -> f64 {
    let off = |w: &[f64]| (w[1] - 0.5 * (w[0] + w[2])).abs();
    let mut off: Vec<f64> = depths.windows(3).map(off).collect();
    if off.is_empty() {
        return 0.0;
    }
    median_in_place(&mut off)
}

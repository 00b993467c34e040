//! Ragged rims: lines along the rim follow its smoothed course instead of its teeth.

use super::layout::{Setup, Surface};
use super::sides::NONE;
use glam::{DVec2, DVec3};
use nurbskin_geometry::numeric::statistics::median_in_place;

/// Part of the vertices of a rim that may lie outside the end of the domain, of an even rim and of a ragged one.
const OUTSIDE: [f64; 2] = [0.05, 0.25];
/// A rim is cut by at most so many times its roughness, so that an even one keeps its corners.
const CUT: f64 = 2.5;
/// The tip of a triangle at the rim stands out at least so many times its height.
const OVERHANG: f64 = 0.3;
/// Where triangles fold teeth are made so many times as deep, again and again.
const SOFTER: f64 = 0.5;
/// Vertices of a rim to either side over which its normals are averaged.
const AVERAGED: usize = 3;

/// A vertex of a rim and how far inside the smoothed rim it lies.
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

/// How far inside the smoothed border, which passes beside it at `middle` and runs `along`, a vertex of the border lies,
/// measured on the surface of this normal. The border runs in the sense of its triangles: the inside is to the left.
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
    let reach = AVERAGED.min(n.saturating_sub(1) / 2);
    let around = |k: usize| (0..=2 * reach).map(move |s| (k + n + s - reach) % n);
    (0..n)
        .map(|k| around(k).map(|j| own[j]).sum::<DVec3>())
        .map(DVec3::normalize_or_zero)
        .collect()
}

/// Holds the teeth where they lie beside their smoothed rim, by the slopes of the layout so far. The tip of a triangle
/// that hangs on the rim by one side lies outside that side at any rate. O(n).
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
    // A corner of the domain has a foot on either side.
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
            let highest = a.min(b) - OVERHANG * height * slopes[k][tooth.axis];
            if own > highest {
                setup.held[k][tooth.axis] = Some(tooth.base + tooth.inward() * highest);
            }
        }
    }
}

/// For vertices of one triangle alone: the other two, and how far it lies from the side between them.
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

/// Brings the teeth near triangles that fold nearer to their smoothed rim, to it in the `last` round. Whether there are
/// any. O(n).
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
            tooth.depth = if last { 0.0 } else { SOFTER * tooth.depth };
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
        // A triangle of the rim's vertices alone says nothing.
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

/// Where the domain begins and ends in a direction: few teeth of an even rim lie outside, and of a ragged one so many
/// that the surface does not reach far over the notches between them, where nothing would hold it.
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
        let [few, many] = OUTSIDE.map(|part| depths[(part * depths.len() as f64) as usize]);
        base + inward * many.min(few + CUT * rough)
    })
}

/// By how much the vertices of a rim, in order, stand out between their neighbours: the median.
fn roughness(depths: &[f64]) -> f64 {
    let off = |w: &[f64]| (w[1] - 0.5 * (w[0] + w[2])).abs();
    let mut off: Vec<f64> = depths.windows(3).map(off).collect();
    if off.is_empty() {
        return 0.0;
    }
    median_in_place(&mut off)
}

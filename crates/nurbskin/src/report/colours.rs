//! The deviation at the vertices of a model, interpolated from the points around.
//!
//! Each deviation is assigned to the foot point of its scan point, so that a scan with a large overall offset still
//! colours the whole surface. A region without foot points has no data. Points beyond free edges are excluded, because
//! their distance runs along the surface. Triangles of a scan contribute interpolated values between their corners.

use super::Measured;
use super::surface::Surface;
use crate::deviation::coverage::UNSUPPORTED_SPACINGS;
use crate::deviation::measure::{Place, PointDeviation};
use glam::DVec3;
use nurbskin_cad::Model;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::{median_in_place, robust_sigma};
use nurbskin_geometry::spatial::neighbours::Neighbours;
use nurbskin_scan::mesh::subset::subset;
use std::collections::BTreeSet;

/// Largest number of points; more do not improve the colours of the vertices.
const MOST_POINTS: usize = 2_000_000;
/// Number of nearest points per vertex, before points on the other side of a thin wall or beyond a crease are excluded.
const NEAREST: usize = 24;
/// Radius in spacings within which points contribute ...
const REACH: f64 = 1.5;
/// ... and least number of points that contribute.
const FEW: usize = 4;
/// Least cosines between the normals at a vertex and at a contributing foot point, on the same face and on an adjacent
/// one.
const SAME_SIDE: f64 = 0.2;
const SMOOTH: f64 = 0.7;
/// Limit of the deviations in standard deviations from the median.
const CLIP: f64 = 3.0;

/// Largest number of samples along each side of a triangle.
const MOST_STEPS: usize = 64;

/// The contribution of a point at its foot point.
#[derive(Clone, Copy)]
struct Foot {
    normal: DVec3,
    face: u32,
    signed: f64,
}

/// The deviation at each vertex; NaN where no point contributes within three spacings. O((points + vertices) log
/// points).
pub(super) fn deviation_of_vertices(
    surface: &Surface,
    model: &Model,
    scan: &Measured,
    deviation: &[PointDeviation],
) -> Vec<f64> {
    let (places, feet, spacing) = feet_of(model, scan, deviation);
    let tree = Neighbours::new(&places);
    let beside = neighbours_of_faces(model);
    let reach = UNSUPPORTED_SPACINGS * spacing;
    each(surface.points.len(), |k| {
        let (at, normal, face) = (surface.points[k], surface.normals[k], surface.faces[k]);
        let near: Vec<(f64, f64)> = tree
            .nearest(at, NEAREST)
            .into_iter()
            .filter_map(|j| {
                let (foot, distance) = (feet.get(j as usize)?, places[j as usize].distance(at));
                let least = if foot.face == face {
                    SAME_SIDE
                } else if beside.contains(&(face, foot.face)) {
                    SMOOTH
                } else {
                    return None;
                };
                let counts = distance <= reach && foot.normal.dot(normal) >= least;
                counts.then_some((distance, foot.signed))
            })
            .collect();
        local_mean(&near, spacing)
    })
}

/// The weighted mean of the nearby values of (distance, value), sorted by distance; NaN if empty.
fn local_mean(near: &[(f64, f64)], spacing: f64) -> f64 {
    let within = near.iter().filter(|(d, _)| *d <= REACH * spacing).count();
    let chosen = near
        .get(..within.max(FEW.min(near.len())))
        .unwrap_or_default();
    let mut values: Vec<f64> = chosen.iter().map(|c| c.1).collect();
    let median = median_in_place(&mut values);
    let clip = CLIP * robust_sigma(&values, median);
    let mut sums = [0.0; 2];
    for (distance, value) in chosen {
        let weight = 1.0 / (1.0 + (distance / spacing).powi(2));
        sums[0] += weight * (value - median).clamp(-clip, clip);
        sums[1] += weight;
    }
    median + sums[0] / sums[1]
}

/// The foot points of the contributing points, their deviations, and their spacing.
fn feet_of(
    model: &Model,
    scan: &Measured,
    deviation: &[PointDeviation],
) -> (Vec<DVec3>, Vec<Foot>, f64) {
    let speaks = |k: usize| deviation.get(k).is_some_and(|d| d.place == Place::Interior);
    let chosen = subset(scan.points, MOST_POINTS, speaks);
    let thinned = scan.points.len() as f64 / MOST_POINTS as f64;
    let spacing = scan.spacing * thinned.max(1.0).sqrt();
    let foot_of = |k: usize| {
        let d = deviation.get(k).filter(|_| speaks(k))?;
        let of = model.faces().get(d.face as usize)?;
        let at = of.surface.derivatives(d.u, d.v);
        let normal = at.du.cross(at.dv).normalize_or_zero();
        let foot = Foot {
            normal: if of.reversed { -normal } else { normal },
            face: d.face,
            signed: d.signed(),
        };
        at.point.is_finite().then_some((at.point, foot))
    };
    let found = each(chosen.len(), |k| foot_of(chosen[k] as usize));
    let (mut places, mut feet): (Vec<DVec3>, Vec<Foot>) = found.into_iter().flatten().unzip();
    for triangle in scan.triangles {
        let room = MOST_POINTS.saturating_sub(places.len());
        let corners = triangle.map(|k| foot_of(k as usize));
        if let [Some(a), Some(b), Some(c)] = corners {
            let between = between([a, b, c], spacing);
            for (place, foot) in between.into_iter().take(room) {
                places.push(place);
                feet.push(foot);
            }
        }
    }
    (places, feet, spacing)
}

/// Interpolated samples of a triangle whose corners are farther apart than their reach.
fn between(corners: [(DVec3, Foot); 3], spacing: f64) -> Vec<(DVec3, Foot)> {
    let [a, b, c] = corners.map(|corner| corner.0);
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    if longest <= REACH * spacing {
        return Vec::new();
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped first"
    )]
    let steps = (longest / spacing).ceil().clamp(2.0, MOST_STEPS as f64) as usize;
    let mut all = Vec::new();
    for i in 0..=steps {
        for j in 0..=steps - i {
            let weights = [i, j, steps - i - j].map(|k| k as f64 / steps as f64);
            if weights.contains(&1.0) {
                continue;
            }
            let (mut place, mut normal, mut signed) = (DVec3::ZERO, DVec3::ZERO, 0.0);
            for (weight, (at, foot)) in weights.iter().zip(&corners) {
                place += *weight * *at;
                normal += *weight * foot.normal;
                signed += weight * foot.signed;
            }
            let foot = Foot {
                normal: normal.normalize_or_zero(),
                face: corners[0].1.face,
                signed,
            };
            all.push((place, foot));
        }
    }
    all
}

/// Pairs of faces with a common edge, in both orders.
fn neighbours_of_faces(model: &Model) -> BTreeSet<(u32, u32)> {
    let mut uses: Vec<(usize, u32)> = Vec::new();
    for (k, face) in (0..).zip(model.faces()) {
        uses.extend(face.loops.iter().flat_map(|l| &l.uses).map(|u| (u.edge, k)));
    }
    uses.sort_unstable();
    let mut pairs = BTreeSet::new();
    for of_edge in uses.chunk_by(|a, b| a.0 == b.0) {
        // More than two faces at an edge all count as neighbours, up to a limit.
        for (i, a) in of_edge.iter().enumerate().take(8) {
            for b in of_edge.iter().take(8).skip(i + 1).filter(|b| b.1 != a.1) {
                pairs.extend([(a.1, b.1), (b.1, a.1)]);
            }
        }
    }
    pairs
}

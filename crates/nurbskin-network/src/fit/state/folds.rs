//! Which faces of a fit fold, jump, or do not carry the shape.

use super::super::joins::{self, smooth_uses};
use super::super::network::Network;
use super::super::patch::{CORNERS, Jet};
use super::Fit;
use glam::{DVec2, DVec3};
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::{median_in_place, quantile_in_place};
use std::f64::consts::FRAC_PI_2;

/// Jump from which a face is taken for folded. Radians: one degree.
/// Trial: not recorded.
const BAD_JUMP: f64 = 0.0175;
/// Samples of jumps per span of an edge. Count. Trial: not varied.
const JUMP_SAMPLES: usize = 4;
/// The same in the search for faces that turn over. Count. Source: the check of CAD files, for an edge of one span.
const OVER_SAMPLES: usize = 24;
/// Jump from which a face turns over at an edge. Radians.
/// Source: the limit of the check of CAD files, 90 degrees.
const OVER: f64 = FRAC_PI_2;
/// Samples per span along u and v in the search for folds. Count.
/// Trial: with 10 per face folds within a span were missed on a bottle.
const FOLD_SAMPLES: usize = 6;
/// Area element, as a share of its median, below which a face is squeezed. Dimensionless.
/// Trial: with 0.2 fandisk has a jump of 0.6 degrees instead of 0.25, with 0 one degree.
const SQUEEZED: f64 = 0.1;
/// Samples per span along u and v in the search for it. Count. Trial: not varied.
const SQUEEZE_SAMPLES: usize = 3;
/// Halvings of the way between two samples in the search for the place where a normal turns over. Count.
/// Guard: a ridge whose radius is below a hundredth of a span is no ridge of a bicubic face.
const FLIP_HALVINGS: usize = 4;
/// Sine of the angle at a corner of a face below which its normal there is no normal. Guard: one degree.
const LEAST_SINE: f64 = 0.0175;
/// Quantile of the distances on a face by which it is judged.
/// Trial: not recorded; single outliers do not count.
const FACE_QUANTILE: f64 = 0.95;
/// Least factor of the size of faces from one layout to the next. Dimensionless.
/// Guard: a relaxed fit says little about faces of less than half the size.
const LEAST_FACTOR: f64 = 0.5;
/// The factor for a face that folds. Dimensionless. Trial: not varied; half the area.
const FOLDED_FACTOR: f64 = 0.7;

impl Fit<'_> {
    /// Which faces fold, are the emptier one at an edge that jumps, or have no normal at a corner.
    pub(in crate::fit) fn bad_faces(&self) -> Vec<bool> {
        let mut bad = self.crooked_faces();
        for (bad, face) in bad.iter_mut().zip(&self.network.faces) {
            let patch = face.patch();
            let straight = |at: [f64; 2]| {
                let jet = patch.tangents(at[0], at[1]);
                let sine = jet.du.cross(jet.dv).length();
                sine < LEAST_SINE * jet.du.length() * jet.dv.length()
            };
            *bad |= CORNERS.into_iter().any(straight);
        }
        bad
    }

    /// Which faces fold, or are the emptier one at an edge that jumps: a larger fairness may mend these.
    pub(super) fn crooked_faces(&self) -> Vec<bool> {
        let network = &self.network;
        let mut bad = each(network.faces.len(), |k| self.folds(k));
        for (angle, face) in self.jumps(JUMP_SAMPLES) {
            bad[face as usize] |= angle > BAD_JUMP;
        }
        bad
    }

    /// The faces that turn over at a smooth edge: the emptier one of the two.
    pub(in crate::fit) fn turned_faces(&self) -> Vec<u32> {
        let over = self
            .jumps(OVER_SAMPLES)
            .into_iter()
            .filter(|(angle, _)| *angle > OVER);
        let mut faces: Vec<u32> = over.map(|(_, face)| face).collect();
        faces.sort_unstable();
        faces.dedup();
        faces
    }

    /// For each smooth edge the largest jump, in radians, and the face beside it with fewer points. That face gives way. Each span
    /// of the edge has `per_span` samples.
    fn jumps(&self, per_span: usize) -> Vec<(f64, u32)> {
        let network = &self.network;
        let mut count = vec![0_u32; network.faces.len()];
        for foot in &self.samples.feet[..self.counted] {
            count[foot.face as usize] += 1;
        }
        let worst = each(network.edges.len(), |k| {
            let edge = &network.edges[k];
            let uses = smooth_uses(edge)?;
            let samples = joins::samples(network, edge, per_span).into_iter();
            let worst = samples
                .map(|t| joins::jump(network, &uses, t))
                .fold(0.0, f64::max);
            let [a, b] = uses.map(|used| used.face);
            let emptier = count[b as usize] < count[a as usize];
            Some((worst, if emptier { b } else { a }))
        });
        worst.into_iter().flatten().collect()
    }

    /// Which faces are squeezed: the area element `|S_u x S_v|` is somewhere far below its median, so that they soon fold.
    pub(super) fn squeezed_faces(&self) -> Vec<bool> {
        each(self.network.faces.len(), |k| {
            let face = &self.network.faces[k];
            let patch = face.patch();
            let [us, vs] = [0, 1].map(|d| inside_spans(&face.inner[d], SQUEEZE_SAMPLES));
            let [us, vs] = [(0, &us), (1, &vs)].map(|(d, at)| patch.bases::<1>(d, at));
            let places = vs.iter().flat_map(|v| us.iter().map(move |u| (u, v)));
            let area = |(u, v)| {
                let jet = patch.tangents_of(u, v);
                jet.du.cross(jet.dv).length()
            };
            let mut areas: Vec<f64> = places.map(area).collect();
            let least = areas.iter().copied().fold(f64::INFINITY, f64::min);
            least < SQUEEZED * median_in_place(&mut areas)
        })
    }

    /// For each face how much smaller faces there should be, at most 1: for a fit of second order to come within `limit` of
    /// most points, and not to fold.
    pub(in crate::fit) fn smaller_faces(&self, limit: f64) -> Vec<f64> {
        let by_face = self.samples.by_face(self.network.faces.len());
        each(by_face.len(), |k| {
            let own = by_face[k].iter().filter(|&&i| (i as usize) < self.counted);
            let mut distances: Vec<f64> =
                own.map(|&i| self.samples.distances[i as usize]).collect();
            let error = if distances.is_empty() {
                0.0
            } else {
                quantile_in_place(&mut distances, FACE_QUANTILE)
            };
            let factor = (limit / error).sqrt().clamp(LEAST_FACTOR, 1.0);
            if self.folds(k) {
                factor.min(FOLDED_FACTOR)
            } else {
                factor
            }
        })
    }

    /// Whether a face folds: its normal turns over within a span, or is mostly against those of the
    /// three nearest vertices of the mesh.
    fn folds(&self, face: usize) -> bool {
        let face = &self.network.faces[face];
        let patch = face.patch();
        let [us, vs] = [0, 1].map(|d| inside_spans(&face.inner[d], FOLD_SAMPLES));
        let normal = |at: DVec2| patch.tangents(at.x, at.y).normal();
        // Places whose normal agrees with the mesh, and those against it.
        let mut sides = [0_usize; 2];
        let mut before: Vec<(DVec2, DVec3)> = Vec::new();
        let [along_u, along_v] = [(0, &us), (1, &vs)].map(|(d, at)| patch.bases::<1>(d, at));
        for (j, (&v, along_v)) in vs.iter().zip(&along_v).enumerate() {
            let jets: Vec<Jet> = along_u
                .iter()
                .map(|along_u| patch.tangents_of(along_u, along_v))
                .collect();
            let place = |(&u, jet): (&f64, &Jet)| (DVec2::new(u, v), jet.normal());
            let row: Vec<(DVec2, DVec3)> = us.iter().zip(&jets).map(place).collect();
            let along = row.windows(2).any(|w| flips(&normal, w[0], w[1]));
            let across = || row.iter().zip(&before).any(|(a, b)| flips(&normal, *b, *a));
            let against = |jet: &Jet| {
                let near = self.anchor_tree.nearest(jet.point, 3);
                let normal = jet.normal();
                near.iter()
                    .all(|&p| self.anchor_normals[p as usize].dot(normal) < 0.0)
            };
            if along || across() {
                return true;
            }
            if j % 3 == 1 {
                let some = jets.iter().skip(1).step_by(3);
                for jet in some {
                    sides[usize::from(against(jet))] += 1;
                }
            }
            before = row;
        }
        sides[1] > sides[0]
    }
}

/// Evenly spaced places inside each span of the unit interval, `count` per span; `inner` are its inner knots.
fn inside_spans(inner: &[f64], count: usize) -> Vec<f64> {
    let inside = |w: &[f64]| {
        let (low, high) = (w[0], w[1]);
        (0..count).map(move |k| low + (high - low) * (k as f64 + 0.5) / count as f64)
    };
    let breaks = Network::breaks(inner);
    breaks.windows(2).flat_map(inside).collect()
}

/// Whether the normal turns over between two places with their normals. On a sharp ridge it turns little by little however
/// near the places are; where the parameters fold it turns over at once.
fn flips(normal: &impl Fn(DVec2) -> DVec3, mut a: (DVec2, DVec3), mut b: (DVec2, DVec3)) -> bool {
    for _ in 0..FLIP_HALVINGS {
        if a.1.dot(b.1) >= 0.0 {
            return false;
        }
        let at = 0.5 * (a.0 + b.0);
        let middle = (at, normal(at));
        // On with the half in which it turns more.
        if middle.1.dot(a.1) < middle.1.dot(b.1) {
            b = middle;
        } else {
            a = middle;
        }
    }
    a.1.dot(b.1) < 0.0
}

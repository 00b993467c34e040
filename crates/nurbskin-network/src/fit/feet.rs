//! The nearest place on a network for each point.
//!
//! A point starts from its last foot and may cross into the faces beside it (`near`). Where that may be the wrong place, as
//! the distance is large or the normals disagree, samples of all faces give other starts (`anywhere`).
//!
//! Source: *The NURBS Book*, 2nd ed., section 6.1; ours across faces.

use super::network::{EdgeUse, Network};
use super::patch::PatchFoot;
use super::terms::Samples;
use crate::layout::OnFace;
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::{each, each_light};
use nurbskin_geometry::spatial::neighbours::{Nearest, Neighbours};

/// Faces that one search may cross into. Count.
/// Guard: a foot moves less than a face between iterations.
const MOST_CROSSINGS: usize = 6;
/// Samples per span and direction of a face with one inner knot or none, and of others. Count.
/// Trial: not recorded.
const SAMPLES: [usize; 2] = [6, 3];
/// Spans of a direction from which on the smaller number of samples is taken. Count.
const MANY_SPANS: usize = 3;
/// Samples that are tried as starts, and faces that a search begins on. Counts.
/// Trial: not recorded.
const CANDIDATES: usize = 8;
const MOST_FACES: usize = 4;
/// Cosine between the normals of a point and of the surface from which on a place may be its foot.
/// Trial: not recorded. It keeps the two sides of thin walls apart.
pub(crate) const AGREE: f64 = 0.2;

/// The foot of a point from a start, over the faces that its way leads across.
fn search(network: &Network, point: DVec3, start: OnFace) -> (OnFace, f64) {
    let mut best = network.faces[start.face as usize]
        .patch()
        .foot(point, start.u, start.v);
    let mut face = start.face;
    let mut seen = vec![face];
    while seen.len() <= MOST_CROSSINGS {
        let mut better: Option<(u32, PatchFoot)> = None;
        for beside in across(network, face, &best) {
            if seen.contains(&beside.face) {
                continue;
            }
            seen.push(beside.face);
            let foot = network.faces[beside.face as usize]
                .patch()
                .foot(point, beside.u, beside.v);
            let least = better.as_ref().map_or(best.squared, |b| b.1.squared);
            if foot.squared < least {
                better = Some((beside.face, foot));
            }
        }
        let Some(found) = better else { break };
        (face, best) = found;
    }
    (
        OnFace {
            face,
            u: best.u,
            v: best.v,
        },
        best.squared.sqrt(),
    )
}

/// The same place on the faces across the sides that a foot lies on.
fn across(network: &Network, face: u32, foot: &PatchFoot) -> impl Iterator<Item = OnFace> {
    let sides = [foot.v <= 0.0, foot.u >= 1.0, foot.v >= 1.0, foot.u <= 0.0];
    let own = &network.faces[face as usize];
    let along = [foot.u, foot.v];
    (0..4_usize)
        .filter(move |&k| sides[k])
        .filter_map(move |k| {
            let side = own.sides[k];
            let s = along[k % 2];
            let t = if side.reversed { 1.0 - s } else { s };
            let uses = &network.edges[side.edge as usize].uses;
            let other = uses.iter().find(|used: &&EdgeUse| used.face != face)?;
            Some(other.place(t))
        })
}

/// Moves the feet of all points to the nearest places near them. O(points).
pub(crate) fn near(network: &Network, samples: &mut Samples) {
    let found = each_light(samples.points.len(), |k| {
        search(network, samples.points[k], samples.feet[k])
    });
    for (k, (foot, distance)) in found.into_iter().enumerate() {
        samples.feet[k] = foot;
        samples.distances[k] = distance;
    }
}

/// Places all over a network with their points and normals.
pub(crate) struct Spread {
    places: Vec<OnFace>,
    normals: Vec<DVec3>,
    tree: Neighbours,
}

impl Spread {
    /// Samples of all faces. O(n log n).
    pub(crate) fn new(network: &Network) -> Self {
        let per_face = each(network.faces.len(), |k| {
            let face = &network.faces[k];
            let [us, vs] = [0, 1].map(|d| {
                let count = SAMPLES[usize::from(face.inner[d].len() + 1 >= MANY_SPANS)];
                let breaks = Network::breaks(&face.inner[d]);
                let spans = breaks.windows(2);
                spans
                    .flat_map(|w| {
                        (0..count)
                            .map(move |i| w[0] + (w[1] - w[0]) * (i as f64 + 0.5) / count as f64)
                    })
                    .collect::<Vec<f64>>()
            });
            let patch = face.patch();
            let mut all = Vec::with_capacity(us.len() * vs.len());
            let [along_u, along_v] = [(0, &us), (1, &vs)].map(|(d, at)| patch.bases::<1>(d, at));
            for (&v, along_v) in vs.iter().zip(&along_v) {
                for (&u, along_u) in us.iter().zip(&along_u) {
                    let jet = patch.tangents_of(along_u, along_v);
                    #[expect(clippy::cast_possible_truncation, reason = "fewer than 2^32 faces")]
                    let place = OnFace {
                        face: k as u32,
                        u,
                        v,
                    };
                    all.push((place, jet.point, jet.normal()));
                }
            }
            all
        })
        .concat();
        let points: Vec<DVec3> = per_face.iter().map(|s| s.1).collect();
        Self {
            places: per_face.iter().map(|s| s.0).collect(),
            normals: per_face.iter().map(|s| s.2).collect(),
            tree: Neighbours::new(&points),
        }
    }

    /// Starts for the search of a point's foot: near samples whose normals agree, one per face.
    fn starts(&self, point: DVec3, normal: DVec3) -> Vec<OnFace> {
        let mut found = Nearest::default();
        self.tree.search(point, CANDIDATES, &mut found, |_| true);
        let mut starts: Vec<OnFace> = Vec::with_capacity(MOST_FACES);
        for index in found.indices() {
            let place = self.places[index as usize];
            let agrees = self.normals[index as usize].dot(normal) >= AGREE;
            if agrees && starts.len() < MOST_FACES && starts.iter().all(|s| s.face != place.face) {
                starts.push(place);
            }
        }
        starts
    }
}

/// Looks for nearer feet of some points all over the network; without agreeing normals a foot stays. O(points log n).
pub(crate) fn anywhere(network: &Network, samples: &mut Samples, which: &[u32]) {
    if which.is_empty() {
        return;
    }
    let spread = Spread::new(network);
    let found = each(which.len(), |i| {
        let k = which[i] as usize;
        let (point, normal) = (samples.points[k], samples.normals[k]);
        let agrees = agrees(network, samples, k);
        let mut best = (
            samples.feet[k],
            if agrees {
                samples.distances[k]
            } else {
                f64::INFINITY
            },
        );
        for start in spread.starts(point, normal) {
            let (foot, distance) = search(network, point, start);
            if distance < best.1 {
                best = (foot, distance);
            }
        }
        best
    });
    for (&k, (foot, distance)) in which.iter().zip(found) {
        if distance.is_finite() {
            samples.feet[k as usize] = foot;
            samples.distances[k as usize] = distance;
        }
    }
}

/// Whether the normal of a point agrees with that of the surface at its foot.
pub(crate) fn agrees(network: &Network, samples: &Samples, k: usize) -> bool {
    let OnFace { face, u, v } = samples.feet[k];
    let normal = network.faces[face as usize].patch().tangents(u, v).normal();
    normal.dot(samples.normals[k]) >= AGREE
}

/// The points that are farther than `limit` from their feet, or whose normals disagree.
pub(crate) fn doubtful(network: &Network, samples: &Samples, limit: f64) -> Vec<u32> {
    let doubt = each_light(samples.points.len(), |k| {
        samples.distances[k] > limit || !agrees(network, samples, k)
    });
    (0_u32..).zip(doubt).filter(|d| d.1).map(|d| d.0).collect()
}

//! Which way each unknown may move in a step.
//!
//! Once the parameters have settled, the surface comes nearer to the points along its normals: one number for each unknown in
//! place of three. Unknowns on sharp and open lines, and those of stiff faces, keep all three.
//!
//! Source: ours.

use super::network::Network;
use super::patch::CORNERS;
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::each;

/// The direction along which an unknown moves; [`None`] for all.
pub(crate) type Way = Option<DVec3>;

/// The normals of the surface at the unknowns of a network; all ways for those on hard lines and of faces that are `free`.
pub(crate) fn along_normals(network: &Network, free: &[bool]) -> Vec<Way> {
    let mut sums = vec![DVec3::ZERO; network.unknowns()];
    let mut all = vec![false; sums.len()];
    let normals = each(network.faces.len(), |k| {
        let face = &network.faces[k];
        let patch = face.patch();
        let [us, vs] = [0, 1].map(|d| face.knots[d].greville());
        let inner = |list: &[f64]| list[1..list.len() - 1].to_vec();
        let (us, vs) = (inner(&us), inner(&vs));
        let places = vs.iter().flat_map(|&v| us.iter().map(move |&u| [u, v]));
        let normals = places.map(|[u, v]| patch.tangents(u, v).normal());
        normals.collect::<Vec<DVec3>>()
    });
    for ((face, normals), &free) in network.faces.iter().zip(normals).zip(free) {
        let first = face.first as usize;
        all[first..first + normals.len()].fill(free);
        sums[first..first + normals.len()].copy_from_slice(&normals);
        let patch = face.patch();
        for (&vertex, [u, v]) in face.corners.iter().zip(CORNERS) {
            sums[vertex as usize] += patch.tangents(u, v).normal();
            all[vertex as usize] |= free;
        }
    }
    for edge in &network.edges {
        let is_free = edge.kind.is_hard() || edge.uses.iter().any(|used| free[used.face as usize]);
        let places = edge.knots.greville();
        for (k, &t) in places.iter().enumerate() {
            let at = Network::unknown_of_edge(edge, k) as usize;
            all[at] |= is_free;
            if k > 0 && k + 1 < places.len() {
                for used in &edge.uses {
                    let foot = used.place(t);
                    let patch = network.faces[used.face as usize].patch();
                    sums[at] += patch.tangents(foot.u, foot.v).normal();
                }
            }
        }
    }
    let way = |(sum, all): (DVec3, bool)| if all { None } else { sum.try_normalize() };
    sums.into_iter().zip(all).map(way).collect()
}

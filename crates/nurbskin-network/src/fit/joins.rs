//! Terms at smooth edges: the jump of the normal, and weak rows that keep the parameters even across the edge.
//!
//! At t on an edge, T is the tangent, `D_F` and `D_G` are the derivatives into the two faces, n is the mean normal made
//! orthogonal to T, and b = n x T/|T| points into F. Then
//!
//! ```text
//! J = n . [(D_F - a_F T) / b_F + (D_G - a_G T) / b_G]     b_F = D_F . b,  b_G = -D_G . b,  a = D . T / |T|^2
//! ```
//!
//! is the angle between the normals of the two faces to second order. All but D and T are taken from the last iterate, so
//! that J is linear and homogeneous in the control points. It asks nothing of the parameters along the edge.
//!
//! The gluing rows `D_F / l_F + D_G / l_G - beta T / l_T` with the lengths l of the edges keep those even: beta is that of a
//! star of equal angles at both ends, and 0 at hard edges.
//!
//! Source: ours. The gluing rows are those of G1 splines of geometrically equal sectors (Peters, Fan 2009), weakly.

use super::network::{DEGREE, Edge, EdgeUse, Network, WIDTH};
use super::system::{Element, directed, scalar};
use crate::layout::OnFace;
use glam::DVec3;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::parallel::each;

/// Share of the derivative into a face that its part across the edge counts for at least.
/// Guard: a face that folds back along its edge would weigh without bounds.
const LEAST_ACROSS: f64 = 1e-3;

/// Weights of the terms at edges.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JoinWeights {
    /// Of a squared jump in radians, per sample.
    pub(crate) jump: f64,
    /// Of a squared gluing row, per sample.
    pub(crate) gluing: f64,
    /// Samples per span.
    pub(crate) per_span: usize,
}

/// What the two faces beside an edge have at a parameter.
struct Beside {
    tangent: DVec3,
    inward: [DVec3; 2],
    normals: [DVec3; 2],
}

/// Tangent, derivatives into the faces and normals at a place of an edge between two faces.
fn beside(network: &Network, uses: &[EdgeUse; 2], t: f64) -> Beside {
    let mut beside = Beside {
        tangent: DVec3::ZERO,
        inward: [DVec3::ZERO; 2],
        normals: [DVec3::ZERO; 2],
    };
    for (k, used) in uses.iter().enumerate() {
        let OnFace { face, u, v } = used.place(t);
        let jet = network.faces[face as usize].patch().tangents(u, v);
        let (along, across) = if used.along_u() {
            (jet.du, jet.dv)
        } else {
            (jet.dv, jet.du)
        };
        beside.inward[k] = used.inward() * across;
        beside.normals[k] = jet.normal();
        if k == 0 {
            beside.tangent = used.forward() * along;
        }
    }
    beside
}

/// Angle between the normals of two faces beside an edge at t. Radians.
pub(crate) fn jump(network: &Network, uses: &[EdgeUse; 2], t: f64) -> f64 {
    let [a, b] = beside(network, uses, t).normals;
    math::angle_between(a, b)
}

/// The two uses of a smooth edge.
pub(crate) fn smooth_uses(edge: &Edge) -> Option<[EdgeUse; 2]> {
    match edge.uses[..] {
        [a, b] if !edge.kind.is_hard() => Some([a, b]),
        _ => None,
    }
}

/// Parameters at which an edge is sampled: `per_span` in each span common to its faces, the knots between, and the ends.
pub(crate) fn samples(network: &Network, edge: &Edge, per_span: usize) -> Vec<f64> {
    let breaks = network.common_breaks(edge);
    let mut all = vec![0.0];
    for w in breaks.windows(2) {
        all.extend(
            (0..per_span).map(|k| w[0] + (w[1] - w[0]) * (k as f64 + 0.5) / per_span as f64),
        );
        all.push(w[1]);
    }
    all
}

/// Adds `scale` times the derivative of a face across or along a side to a row.
fn push(
    network: &Network,
    used: &EdgeUse,
    t: f64,
    across: bool,
    scale: f64,
    row: &mut Vec<(u32, f64)>,
) {
    let OnFace { face, u, v } = used.place(t);
    let face = &network.faces[face as usize];
    let patch = face.patch();
    let basis = patch.basis::<1>(u, v);
    let by_u = used.along_u() != across;
    let [du, dv] = if by_u { [1, 0] } else { [0, 1] };
    for [at, i, j] in patch.indices(&basis) {
        let value = scale * basis[0].values[du][i] * basis[1].values[dv][j];
        if value != 0.0 {
            row.extend(face.rows.of(at).iter().map(|&(k, w)| (k, w * value)));
        }
    }
}

/// Adds `scale` times the derivative of the edge's curve to a row.
fn push_tangent(edge: &Edge, t: f64, scale: f64, row: &mut Vec<(u32, f64)>) {
    row.extend(
        Network::edge_basis(edge, t)
            .iter()
            .map(|&(k, [_, slope])| (k, scale * slope)),
    );
}

/// Sorts a row by unknowns and adds up entries of the same one.
pub(crate) fn merge(row: &mut Vec<(u32, f64)>) {
    row.sort_by_key(|e| e.0);
    row.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 += next.1;
        }
        same
    });
}

/// The row of the jump at t, and the direction n that its sum is taken along.
fn jump_row(
    network: &Network,
    edge: &Edge,
    uses: &[EdgeUse; 2],
    t: f64,
) -> (Vec<(u32, f64)>, DVec3) {
    let Beside {
        tangent,
        inward,
        normals,
    } = beside(network, uses, t);
    let squared = tangent.length_squared().max(f64::MIN_POSITIVE);
    let mut n = normals[0] + normals[1];
    n -= tangent * (n.dot(tangent) / squared);
    n = n.normalize_or_zero();
    let mut b = n.cross(tangent / squared.sqrt());
    if b.dot(inward[0]) < 0.0 {
        b = -b;
    }
    let mut row = Vec::with_capacity(WIDTH * WIDTH * 3);
    let mut along = 0.0;
    for (k, used) in uses.iter().enumerate() {
        let sign = if k == 0 { 1.0 } else { -1.0 };
        let least = LEAST_ACROSS * inward[k].length() + f64::MIN_POSITIVE;
        let across = (sign * inward[k].dot(b)).max(least);
        along += inward[k].dot(tangent) / squared / across;
        push(network, used, t, true, used.inward() / across, &mut row);
    }
    push_tangent(edge, t, -along, &mut row);
    merge(&mut row);
    (row, n)
}

/// What gluing rows need of the network as it is.
struct Lengths<'a> {
    chords: &'a [f64],
    /// For each vertex 2 cos(2 pi / faces), 0 on hard edges.
    turns: &'a [f64],
}

/// The gluing row at t.
fn gluing_row(
    network: &Network,
    index: usize,
    uses: &[EdgeUse; 2],
    t: f64,
    lengths: &Lengths,
) -> Vec<(u32, f64)> {
    let edge = &network.edges[index];
    let mut row = Vec::with_capacity(WIDTH * WIDTH * 3);
    for used in uses {
        let face = &network.faces[used.face as usize];
        let s = if used.reversed { 1.0 - t } else { t };
        // The edges across at both ends.
        let [low, high] = if used.along_u() { [3, 1] } else { [0, 2] };
        let chord = |k: usize| lengths.chords[face.sides[k].edge as usize];
        let length = (1.0 - s) * chord(low) + s * chord(high);
        push(network, used, t, true, used.inward() / length, &mut row);
    }
    let [c0, c1] = edge.ends.map(|v| lengths.turns[v as usize]);
    let beta = c0 * (1.0 - t) * (1.0 - t) - c1 * t * t;
    push_tangent(edge, t, -beta / lengths.chords[index], &mut row);
    merge(&mut row);
    row
}

/// 2 cos(2 pi / k) for each vertex with k faces, 0 for those on hard edges.
pub(crate) fn turns(network: &Network) -> Vec<f64> {
    let mut count = vec![0_u32; network.vertices];
    for corner in network.faces.iter().flat_map(|f| f.corners) {
        count[corner as usize] += 1;
    }
    let full = std::f64::consts::TAU;
    let mut turns: Vec<f64> = count
        .iter()
        .map(|&k| 2.0 * math::cos(full / f64::from(k.max(1))))
        .collect();
    for vertex in network
        .edges
        .iter()
        .filter(|e| e.kind.is_hard())
        .flat_map(|e| e.ends)
    {
        turns[vertex as usize] = 0.0;
    }
    turns
}

/// The terms of all smooth edges, one element each. `chords` are the lengths of the edges. O(samples).
pub(crate) fn elements(network: &Network, chords: &[f64], weights: &JoinWeights) -> Vec<Element> {
    let turns = turns(network);
    let lengths = Lengths {
        chords,
        turns: &turns,
    };
    let smooth: Vec<(usize, [EdgeUse; 2])> = (0..network.edges.len())
        .filter_map(|k| Some((k, smooth_uses(&network.edges[k])?)))
        .collect();
    each(smooth.len(), |k| {
        let (index, uses) = &smooth[k];
        let edge = &network.edges[*index];
        let samples = samples(network, edge, weights.per_span);
        let jumps: Vec<_> = samples
            .iter()
            .map(|&t| jump_row(network, edge, uses, t))
            .collect();
        let gluing: Vec<_> = samples
            .iter()
            .map(|&t| gluing_row(network, *index, uses, t, &lengths))
            .collect();
        let rows = jumps
            .iter()
            .map(|(row, _)| &row[..])
            .chain(gluing.iter().map(|row| &row[..]));
        let mut element = Element::over(rows);
        for (row, n) in &jumps {
            element.add_row(row, &directed(*n, weights.jump, 0.0), DVec3::ZERO);
        }
        for row in &gluing {
            element.add_row(row, &scalar(weights.gluing), DVec3::ZERO);
        }
        element
    })
}

const _: () = assert!(DEGREE >= 2, "a face needs a derivative across its sides");

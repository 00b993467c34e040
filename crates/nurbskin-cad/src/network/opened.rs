//! A network without some of its faces.

use super::{FaceNetwork, NetworkEdge, NetworkFace, SIDES};
use crate::normal_jump::JoinKind;
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;

impl FaceNetwork {
    /// The network without the faces that are `gone`, and the index here of each face that stays. Where only one of the two
    /// faces of an edge stays, the edge becomes open. Of several pieces that hang together by edges only the one with the largest sum of
    /// `weights` stays. A vertex at which faces stay that no edges join becomes several at the same place, so that the result is a
    /// manifold. [`None`] where no face stays. O(n log n) in the faces.
    ///
    /// Faces beyond the ends of the lists stay, and weigh nothing.
    ///
    /// # Panics
    /// Where a face has an edge, or an edge a vertex, that the network does not have; a [valid](Self::validate) one has all.
    #[must_use]
    pub fn without(&self, gone: &[bool], weights: &[usize]) -> Option<(Self, Vec<usize>)> {
        let kept = self.heaviest_piece(gone, weights)?;
        // Corners of faces that meet along an edge are one vertex.
        let count = self.faces.len();
        let mut corners = DisjointSets::new(4 * count);
        let mut first: Vec<Option<[usize; 2]>> = vec![None; self.edges.len()];
        let mut uses = vec![0_usize; self.edges.len()];
        for &face in &kept {
            for (side, &(edge, reversed)) in self.faces[face].sides.iter().enumerate() {
                let mut ends = SIDES[side].corners.map(|corner| 4 * face + corner);
                if reversed {
                    ends.swap(0, 1);
                }
                let edge = edge as usize;
                uses[edge] += 1;
                let others = *first[edge].get_or_insert(ends);
                for (one, other) in ends.into_iter().zip(others) {
                    corners.join(one, other);
                }
            }
        }
        let mut number = vec![None; 4 * count];
        let mut network = Self::default();
        let mut place = vec![0; self.edges.len()];
        for (k, (edge, ends)) in self.edges.iter().zip(&first).enumerate() {
            let Some(ends) = ends else {
                continue;
            };
            let mut vertex = |end: usize| {
                *number[corners.root(ends[end])].get_or_insert_with(|| {
                    network
                        .vertices
                        .push(self.vertices[edge.ends[end] as usize]);
                    index(network.vertices.len() - 1)
                })
            };
            let ends = [0, 1].map(&mut vertex);
            place[k] = index(network.edges.len());
            network.edges.push(NetworkEdge {
                curve: edge.curve.clone(),
                ends,
                kind: match uses[k] {
                    1 => JoinKind::Open,
                    _ => edge.kind,
                },
            });
        }
        let moved = |&face: &usize| NetworkFace {
            surface: self.faces[face].surface.clone(),
            sides: self.faces[face].sides.map(|(e, r)| (place[e as usize], r)),
        };
        network.faces = kept.iter().map(moved).collect();
        Some((network, kept))
    }

    /// The faces of the piece that stays.
    fn heaviest_piece(&self, gone: &[bool], weights: &[usize]) -> Option<Vec<usize>> {
        let stays = |face: &usize| gone.get(*face) != Some(&true);
        let count = self.faces.len();
        let mut pieces = DisjointSets::new(count);
        let mut first: Vec<Option<usize>> = vec![None; self.edges.len()];
        for face in (0..count).filter(stays) {
            for &(edge, _) in &self.faces[face].sides {
                let other = *first[edge as usize].get_or_insert(face);
                pieces.join(face, other);
            }
        }
        let mut sums = vec![(0_usize, 0_usize); count];
        for face in (0..count).filter(stays) {
            let sum = &mut sums[pieces.root(face)];
            sum.0 += weights.get(face).copied().unwrap_or(0);
            sum.1 += 1;
        }
        let best = (0..count).max_by_key(|&root| (sums[root], std::cmp::Reverse(root)))?;
        let is_in = |face: &usize| pieces.root(*face) == best;
        Some((0..count).filter(stays).filter(is_in).collect::<Vec<_>>())
            .filter(|kept| !kept.is_empty())
    }

    /// Number of handles and of borders, by Euler's formula, of a [valid](Self::validate) network whose vertices are all those of
    /// edges. O(n).
    ///
    /// # Panics
    /// Where an edge has a vertex that the network does not have.
    #[must_use]
    pub fn genus_and_borders(&self) -> [usize; 2] {
        let mut rims = DisjointSets::new(self.vertices.len());
        let mut at_rim = vec![false; self.vertices.len()];
        for edge in self.edges.iter().filter(|e| e.kind == JoinKind::Open) {
            let [a, b] = edge.ends.map(|end| end as usize);
            rims.join(a, b);
            at_rim[a] = true;
            at_rim[b] = true;
        }
        let is_first = |&k: &usize| at_rim[k] && rims.root(k) == k;
        let borders = (0..at_rim.len()).filter(is_first).count();
        // V - E + F = 2 - 2 g - b.
        let handles =
            (2 + self.edges.len()).saturating_sub(self.vertices.len() + self.faces.len() + borders);
        [handles / 2, borders]
    }
}

/// An index of a network.
fn index(k: usize) -> u32 {
    u32::try_from(k).unwrap_or(u32::MAX)
}

//! Usable triangles of a file: between three distinct, finite points, none twice.
//!
//! Points with equal coordinates become one; points and triangles are sorted by coordinates, so that the result does
//! not depend on their order. Source: ours.

use super::Manifold;
use glam::DVec3;
use nurbskin_geometry::unit::counted;

/// Distinct triangles between distinct points, in an order that depends on the coordinates only.
#[derive(Debug)]
pub(super) struct Soup {
    /// Ascending by x, y, z.
    pub(super) points: Vec<DVec3>,
    /// The smallest index of each point.
    pub(super) source: Vec<u32>,
    /// Sorted by their points; wound as given.
    pub(super) triangles: Vec<[u32; 3]>,
    unusable: usize,
    twins: usize,
}

impl Soup {
    /// O(n log n).
    pub(super) fn new(points: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        // 1. Points with triangles, sorted by coordinates; equal ones become one.
        let usable = |t: &&[u32; 3]| {
            t.iter()
                .all(|&k| points.get(k as usize).is_some_and(|p| p.is_finite()))
        };
        let mut used = vec![false; points.len()];
        for &k in triangles.iter().filter(usable).flatten() {
            used[k as usize] = true;
        }
        let mut order: Vec<(DVec3, u32)> = (0_u32..)
            .zip(points)
            .filter(|(k, _)| used[*k as usize])
            // Adding zero takes the sign off a negative one.
            .map(|(k, &p)| (p + DVec3::ZERO, k))
            .collect();
        order.sort_unstable_by(|(p, j), (q, k)| {
            let by_place = p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y));
            by_place.then(p.z.total_cmp(&q.z)).then(j.cmp(k))
        });
        let mut number = vec![0_u32; points.len()];
        let (mut places, mut source) = (Vec::new(), Vec::new());
        for same in order.chunk_by(|a, b| a.0 == b.0) {
            for &(_, k) in same {
                number[k as usize] = u32::try_from(places.len()).unwrap_or(u32::MAX);
            }
            places.push(same[0].0);
            source.push(same[0].1);
        }
        // 2. Triangles, each starting at its first point, so that the order of its corners does not matter.
        let mut kept: Vec<([u32; 3], bool)> = triangles
            .iter()
            .filter(usable)
            .map(|t| t.map(|k| number[k as usize]))
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .map(|[a, b, c]| {
                let least = a.min(b).min(c);
                let [a, b, c] = match least {
                    _ if least == a => [a, b, c],
                    _ if least == b => [b, c, a],
                    _ => [c, a, b],
                };
                ([a, b.min(c), b.max(c)], b > c)
            })
            .collect();
        let unusable = triangles.len() - kept.len();
        kept.sort_unstable();
        let before = kept.len();
        kept.dedup_by_key(|t| t.0);
        Self {
            points: places,
            source,
            triangles: kept
                .iter()
                .map(|&([a, b, c], turned)| if turned { [a, c, b] } else { [a, b, c] })
                .collect(),
            unusable,
            twins: before - kept.len(),
        }
    }

    /// Notes about dropped triangles.
    pub(super) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.unusable > 0 {
            notes.push(format!(
                "{} dropped: corners that coincide, do not exist or are not finite",
                counted(self.unusable, "triangle is", "triangles are")
            ));
        }
        if self.twins > 0 {
            notes.push(format!(
                "{} dropped: they repeat another",
                counted(self.twins, "triangle is", "triangles are")
            ));
        }
        notes
    }

    /// Indices of the points that are not in `manifold`, ascending.
    pub(super) fn without(&self, manifold: &Manifold) -> Vec<u32> {
        let mut inside: Vec<u32> = manifold.source.iter().copied().flatten().collect();
        inside.sort_unstable();
        let missing = |k: &u32| inside.binary_search(k).is_err();
        let mut out: Vec<u32> = self.source.iter().copied().filter(missing).collect();
        out.sort_unstable();
        out
    }
}

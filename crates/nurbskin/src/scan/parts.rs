//! The separate pieces of a scan.

use super::neighbours::Neighbours;
use crate::numeric::disjoint_sets::DisjointSets;
use glam::DVec3;

/// Which separate piece each point belongs to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Parts {
    /// Number of the part of each point; part 0 is the largest.
    pub of: Vec<u32>,
    /// Points in each part, descending.
    pub sizes: Vec<usize>,
}

impl Parts {
    /// Number of parts.
    #[must_use]
    pub fn count(&self) -> usize {
        self.sizes.len()
    }

    /// Number of parts that hold at least this fraction of the points of the largest; the others are scraps.
    #[must_use]
    pub fn count_above(&self, fraction: f64) -> usize {
        let largest = self.sizes.first().copied().unwrap_or(0) as f64;
        let above = |&&size: &&usize| size as f64 >= fraction * largest;
        self.sizes.iter().filter(above).count()
    }

    /// Pieces more than a few `spacing` apart: cubes of three spacings are joined where they touch. O(n log n).
    #[must_use]
    pub fn by_distance(points: &[DVec3], spacing: f64) -> Self {
        let size = (3.0 * spacing).max(f64::MIN_POSITIVE);
        // Saturates beyond 2^63 cells, where points are far apart at any rate.
        #[expect(clippy::cast_possible_truncation, reason = "saturation is meant")]
        let cell = |p: &DVec3| p.to_array().map(|x| (x / size).floor() as i64);
        let mut cells: Vec<[i64; 3]> = points.iter().map(cell).collect();
        cells.sort_unstable();
        cells.dedup();
        let find = |c: [i64; 3]| cells.binary_search(&c).ok();
        let mut union = DisjointSets::new(cells.len());
        for (k, c) in cells.iter().enumerate() {
            for offset in 0..13_i64 {
                // The 13 of the 26 neighbours that come before.
                let step = [offset / 9 - 1, offset / 3 % 3 - 1, offset % 3 - 1];
                let other = std::array::from_fn(|axis| c[axis].saturating_add(step[axis]));
                if let Some(other) = find(other) {
                    union.join(k, other);
                }
            }
        }
        let roots = points
            .iter()
            .map(|p| find(cell(p)).map_or(0, |k| union.root(k)));
        Self::from_roots(&roots.collect::<Vec<_>>())
    }

    /// Pieces of a mesh; points without a triangle belong to the piece of the nearest point that has one.
    #[must_use]
    pub(super) fn by_triangles(
        points: &[DVec3],
        triangles: &[[u32; 3]],
        tree: &Neighbours,
    ) -> Self {
        let mut union = DisjointSets::new(points.len());
        let mut met = vec![false; points.len()];
        for &[a, b, c] in triangles {
            union.join(a as usize, b as usize);
            union.join(a as usize, c as usize);
            for k in [a, b, c] {
                met[k as usize] = true;
            }
        }
        let loose: Vec<usize> = (0..points.len()).filter(|&k| !met[k]).collect();
        for k in loose {
            let near = tree.nearest(points[k], 16);
            if let Some(&other) = near.iter().find(|&&j| met[j as usize]) {
                union.join(k, other as usize);
            }
        }
        let roots: Vec<usize> = (0..points.len()).map(|k| union.root(k)).collect();
        Self::from_roots(&roots)
    }

    /// Numbers the parts by size, of equals the one met first.
    fn from_roots(roots: &[usize]) -> Self {
        let mut sizes = vec![0_usize; roots.iter().max().map_or(0, |&r| r + 1)];
        let mut met = Vec::new();
        for &root in roots {
            if sizes[root] == 0 {
                met.push(root);
            }
            sizes[root] += 1;
        }
        met.sort_by_key(|&root| std::cmp::Reverse(sizes[root]));
        let mut number = vec![0_u32; sizes.len()];
        for (k, &root) in (0_u32..).zip(&met) {
            number[root] = k;
        }
        Self {
            of: roots.iter().map(|&root| number[root]).collect(),
            sizes: met.iter().map(|&root| sizes[root]).collect(),
        }
    }

    pub(super) fn reordered(&self, order: &[u32]) -> Self {
        Self {
            of: order.iter().map(|&k| self.of[k as usize]).collect(),
            sizes: self.sizes.clone(),
        }
    }
}

//! Disjoint sets.

/// Disjoint sets of the numbers 0..count; the root of a set is its smallest member, so that the result does not depend on
/// the order of joining. Near O(1) per call.
///
/// Source: R. E. Tarjan, *Efficiency of a good but not linear set union algorithm*, J. ACM 22(2), 1975 (path halving).
#[derive(Clone, Debug)]
pub struct DisjointSets {
    parents: Vec<usize>,
}

impl DisjointSets {
    /// Each number a set of its own.
    pub fn new(count: usize) -> Self {
        Self {
            parents: (0..count).collect(),
        }
    }
    /// The smallest member of k's set.
    pub fn root(&mut self, mut k: usize) -> usize {
        while self.parents[k] != k {
            self.parents[k] = self.parents[self.parents[k]];
            k = self.parents[k];
        }
        k
    }
    /// Makes one set of the sets of a and b.
    pub fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b)] = a.min(b);
    }
}

//! Nearest neighbours.

use glam::DVec3;

/// Most points in a leaf of the tree.
const LEAF: usize = 10;
/// Queries that one thread answers in a row; fixed, so that results do not depend on the number of threads.
const CHUNK: usize = 2048;

/// A k-d tree over points, built once and asked often. It halves the points at the median of the widest side, so that
/// equal, collinear and coplanar points do no harm, and answers do not depend on how it was built: of equally far
/// points those of lower index come first.
///
/// ```
/// use nurbskin::DVec3;
/// use nurbskin::scan::neighbours::Neighbours;
/// let line: Vec<DVec3> = (0..10).map(|i| DVec3::X * f64::from(i)).collect();
/// let near = Neighbours::new(&line).nearest(DVec3::X * 3.2, 3);
/// assert_eq!(near, [3, 4, 2]);
/// ```
#[derive(Clone, Debug)]
pub struct Neighbours {
    /// The points in tree order: each node's points are contiguous.
    points: Vec<DVec3>,
    /// The index of each of them.
    indices: Vec<u32>,
    /// Nodes in depth-first order; the left child follows its parent.
    nodes: Vec<Node>,
}

#[derive(Clone, Copy, Debug)]
enum Node {
    Leaf { start: u32, end: u32 },
    Split { axis: u8, at: f64, right: u32 },
}

/// A candidate: squared distance and index, the nearest of lowest index first.
type Candidate = (f64, u32);

fn before(a: Candidate, b: Candidate) -> bool {
    a.0 < b.0 || (a.0 <= b.0 && a.1 < b.1)
}

impl Neighbours {
    /// A tree over finite points, at most 2^32 - 1 (further ones are left out). O(n log n).
    #[must_use]
    pub fn new(points: &[DVec3]) -> Self {
        let mut indices: Vec<u32> = (0..u32::MAX).take(points.len()).collect();
        let mut nodes = Vec::with_capacity(4 * indices.len() / LEAF + 1);
        build(points, &mut indices, 0, &mut nodes);
        Self {
            points: indices.iter().map(|&i| points[i as usize]).collect(),
            indices,
            nodes,
        }
    }

    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Indices of the `count` points nearest to `query`, nearest first; all points if there are fewer.
    #[must_use]
    pub fn nearest(&self, query: DVec3, count: usize) -> Vec<u32> {
        let mut found = Vec::new();
        self.search(query, count, u32::MAX, &mut found);
        found.into_iter().map(|(_, index)| index).collect()
    }

    /// For each point the `count` nearest other points, nearest first; `count` is cut to the number of others.
    /// Queries run in tree order, which keeps memory close. About 1 us each for `count` = 16.
    #[must_use]
    pub fn table(&self, count: usize) -> NeighbourTable {
        let count = count.min(self.len().saturating_sub(1));
        if count == 0 {
            return NeighbourTable {
                count,
                indices: Vec::new(),
            };
        }
        let mut in_tree_order = vec![0_u32; count * self.len()];
        let answer = |(chunk, rows): (usize, &mut [u32])| {
            let mut found = Vec::with_capacity(count + 1);
            for (k, row) in rows.chunks_exact_mut(count).enumerate() {
                let at = chunk * CHUNK + k;
                self.search(self.points[at], count, self.indices[at], &mut found);
                for (cell, &(_, index)) in row.iter_mut().zip(&found) {
                    *cell = index;
                }
            }
        };
        #[cfg(feature = "parallel")]
        {
            use rayon::prelude::*;
            in_tree_order
                .par_chunks_mut(CHUNK * count)
                .enumerate()
                .for_each(answer);
        }
        #[cfg(not(feature = "parallel"))]
        in_tree_order
            .chunks_mut(CHUNK * count)
            .enumerate()
            .for_each(answer);
        let mut indices = vec![0_u32; count * self.len()];
        for (row, &index) in in_tree_order.chunks_exact(count).zip(&self.indices) {
            let start = index as usize * count;
            indices[start..start + count].copy_from_slice(row);
        }
        NeighbourTable { count, indices }
    }

    /// Fills `found` with the `count` nearest points but `except`, sorted.
    fn search(&self, query: DVec3, count: usize, except: u32, found: &mut Vec<Candidate>) {
        found.clear();
        if count == 0 || self.nodes.is_empty() {
            return;
        }
        let query_at = query.to_array();
        // Branches still to visit, with the squared distance of the plane in between. A balanced tree over 2^32
        // points is less than 64 levels deep.
        let mut open = [(0_u32, 0.0_f64); 64];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let (mut node, least) = open[depth];
            if found.len() == count && least > found[count - 1].0 {
                continue;
            }
            loop {
                match self.nodes[node as usize] {
                    Node::Split { axis, at, right } => {
                        let offset = query_at[usize::from(axis)] - at;
                        let (near, far) = if offset < 0.0 {
                            (node + 1, right)
                        } else {
                            (right, node + 1)
                        };
                        let plane = offset * offset;
                        if found.len() < count || plane <= found[count - 1].0 {
                            open[depth] = (far, plane);
                            depth += 1;
                        }
                        node = near;
                    }
                    Node::Leaf { start, end } => {
                        for at in start as usize..end as usize {
                            let index = self.indices[at];
                            let candidate = (query.distance_squared(self.points[at]), index);
                            if index != except {
                                insert(found, count, candidate);
                            }
                        }
                        break;
                    }
                }
            }
        }
    }
}

fn insert(found: &mut Vec<Candidate>, count: usize, candidate: Candidate) {
    if found.len() == count {
        if !before(candidate, found[count - 1]) {
            return;
        }
        found.pop();
    }
    let mut at = found.len();
    found.push(candidate);
    while at > 0 && before(candidate, found[at - 1]) {
        found[at] = found[at - 1];
        at -= 1;
    }
    found[at] = candidate;
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "there are at most 2^32 - 1 points and fewer nodes"
)]
fn build(points: &[DVec3], indices: &mut [u32], start: usize, nodes: &mut Vec<Node>) {
    if indices.len() <= LEAF {
        nodes.push(Node::Leaf {
            start: start as u32,
            end: (start + indices.len()) as u32,
        });
        return;
    }
    let (low, high) = indices
        .iter()
        .map(|&i| points[i as usize])
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
            (low.min(p), high.max(p))
        });
    let side = high - low;
    let axis = side.max_position();
    let middle = indices.len() / 2;
    // Ties go by index, so that the tree is the same however the selection permutes.
    indices.select_nth_unstable_by(middle, |&a, &b| {
        let (p, q) = (points[a as usize][axis], points[b as usize][axis]);
        p.total_cmp(&q).then(a.cmp(&b))
    });
    let at = points[indices[middle] as usize][axis];
    let node = nodes.len();
    nodes.push(Node::Split {
        axis: axis as u8,
        at,
        right: 0,
    });
    let (left, right) = indices.split_at_mut(middle);
    build(points, left, start, nodes);
    let next = nodes.len() as u32;
    if let Node::Split { right, .. } = &mut nodes[node] {
        *right = next;
    }
    build(points, right, start + middle, nodes);
}

/// The nearest other points of every point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NeighbourTable {
    count: usize,
    indices: Vec<u32>,
}

impl NeighbourTable {
    /// Neighbours per point.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The neighbours of a point, nearest first.
    #[must_use]
    pub fn of(&self, point: usize) -> &[u32] {
        &self.indices[point * self.count..(point + 1) * self.count]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute(points: &[DVec3], query: DVec3, count: usize, except: usize) -> Vec<u32> {
        let mut all: Vec<(f64, u32)> = points
            .iter()
            .enumerate()
            .filter(|&(k, _)| k != except)
            .map(|(k, p)| (query.distance_squared(*p), u32::try_from(k).unwrap()))
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        all.truncate(count);
        all.into_iter().map(|(_, k)| k).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        /// Small integers make ties, duplicates, lines and planes.
        #[test]
        fn agrees_with_brute_force(
            cells in prop::collection::vec((0..9_i32, 0..9_i32, 0..9_i32), 1..200),
            flat in 0..3_u8,
            count in 1..20_usize,
        ) {
            let points: Vec<DVec3> = cells
                .iter()
                .map(|&(x, y, z)| {
                    let keep = |c: i32, level: u8| if flat >= level { 0.0 } else { f64::from(c) };
                    DVec3::new(f64::from(x), keep(y, 2), keep(z, 1))
                })
                .collect();
            let tree = Neighbours::new(&points);
            let table = tree.table(count);
            prop_assert_eq!(table.count(), count.min(points.len() - 1));
            for (k, &point) in points.iter().enumerate() {
                let wanted = brute(&points, point, table.count(), k);
                prop_assert_eq!(table.of(k), &wanted[..]);
            }
            let query = DVec3::new(2.5, 4.5, -1.0);
            prop_assert_eq!(tree.nearest(query, count), brute(&points, query, count, usize::MAX));
        }
    }

    #[test]
    fn few_points() {
        assert!(Neighbours::new(&[]).nearest(DVec3::ZERO, 3).is_empty());
        assert_eq!(Neighbours::new(&[]).table(3).count(), 0);
        assert_eq!(Neighbours::new(&[DVec3::ONE]).table(3).of(0), [0_u32; 0]);
        assert_eq!(
            Neighbours::new(&vec![DVec3::ONE; 5000]).table(4).of(7),
            [0, 1, 2, 3]
        );
    }
}

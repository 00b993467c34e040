//! Patterns: ways to divide a polygon into four-sided faces.
//!
//! The polygon has n vertices, the corners of a cell and the middles of its split arcs. Chords divide n = 6 into two
//! faces and n = 8 into three; with n = 4 there is one face. From n = 6 on a centre with spokes to every second vertex
//! gives n / 2 faces. Every middle must be the end of a chord or of a spoke: a face would have a straight angle there.
//!
//! A ring of faces along the rim gives every vertex of the rim two faces; a polygon with as many vertices is left inside. It
//! suits cells with a smooth rim, such as disks.

/// A division of a polygon.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Pattern {
    /// Vertices of the faces, counter-clockwise; those from n on lie inside.
    pub(crate) faces: Vec<[usize; 4]>,
    /// Number of vertices n of the polygon.
    pub(crate) count: usize,
    /// Whether there is a ring: the vertices n to 2 n - 1.
    pub(crate) ring: bool,
    /// Whether there is a centre: the last vertex.
    pub(crate) centre: bool,
}

impl Pattern {
    /// Spokes to every second vertex, the first one being `first`: 0 or 1.
    pub(crate) fn star(count: usize, first: usize) -> Self {
        let at = |k: usize| (first + k) % count;
        Self {
            faces: (0..count / 2)
                .map(|k| [count, at(2 * k), at(2 * k + 1), at(2 * k + 2)])
                .collect(),
            count,
            ring: false,
            centre: true,
        }
    }

    /// A ring around this pattern.
    fn ringed(&self) -> Self {
        let n = self.count;
        let around = (0..n).map(|k| {
            let next = (k + 1) % n;
            [k, next, n + next, n + k]
        });
        let inside = self.faces.iter().map(|face| face.map(|k| n + k));
        Self {
            faces: around.chain(inside).collect(),
            ring: true,
            ..*self
        }
    }

    /// Number of vertices inside the polygon.
    pub(crate) fn inner(&self) -> usize {
        usize::from(self.centre) + if self.ring { self.count } else { 0 }
    }

    /// The Catmull-Clark split of a cell with k corners. Corners and middles alternate, corners first.
    pub(crate) fn catmull_clark(k: usize) -> Self {
        Self::star(2 * k, 1)
    }

    /// All patterns of a polygon. `middle` tells which of its vertices are middles of arcs.
    pub(crate) fn all(middle: &[bool]) -> Vec<Self> {
        let n = middle.len();
        let mut patterns = Vec::new();
        if n < 4 || n % 2 == 1 {
            return patterns;
        }
        let chorded = |faces: Vec<[usize; 4]>| Self {
            faces,
            count: n,
            ring: false,
            centre: false,
        };
        match n {
            4 => patterns.push(chorded(vec![[0, 1, 2, 3]])),
            6 => patterns.extend((0..3).map(|i| chorded(vec![cut(n, i), cut(n, i + 3)]))),
            8 => patterns.extend(octagons().into_iter().map(chorded)),
            _ => {}
        }
        if n >= 6 {
            patterns.extend([Self::star(n, 0), Self::star(n, 1)]);
        }
        let ringed: Vec<Self> = patterns.iter().map(Self::ringed).collect();
        patterns.extend(ringed);
        patterns.retain(|p| (0..n).all(|k| !middle[k] || p.faces_at(k) >= 2));
        patterns
    }

    /// The number of faces at a vertex of the polygon.
    pub(crate) fn faces_at(&self, vertex: usize) -> usize {
        self.faces.iter().filter(|f| f.contains(&vertex)).count()
    }
}

/// The face that the chord from i to i + 3 cuts off.
fn cut(n: usize, i: usize) -> [usize; 4] {
    [i % n, (i + 1) % n, (i + 2) % n, (i + 3) % n]
}

/// The twelve divisions of an octagon by two chords: two faces cut off, and the face between.
fn octagons() -> Vec<Vec<[usize; 4]>> {
    let mut all = Vec::new();
    for i in 0..8 {
        // The second face begins at the end of the first, or a vertex later: then the rest is on both sides.
        for j in [3, 4] {
            let (a, b) = (cut(8, i), cut(8, i + j));
            if j == 4 && i >= 4 {
                continue;
            }
            let mut rest: Vec<usize> = (0..8)
                .filter(|v| {
                    let inner = |f: &[usize; 4]| f[1] == *v || f[2] == *v;
                    !inner(&a) && !inner(&b)
                })
                .collect();
            rest.sort_unstable();
            if let [p, q, r, s] = rest[..] {
                all.push(vec![a, b, [p, q, r, s]]);
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_of_polygons_without_middles() {
        for (n, count) in [(4, 2), (6, 10), (8, 28), (10, 4), (12, 4), (5, 0), (3, 0)] {
            assert_eq!(Pattern::all(&vec![false; n]).len(), count, "{n}");
        }
    }

    #[test]
    fn every_side_belongs_to_one_face_and_every_chord_to_two() {
        for n in [4, 6, 8, 10] {
            for pattern in Pattern::all(&vec![false; n]) {
                let mut sides = std::collections::BTreeMap::new();
                for f in &pattern.faces {
                    for k in 0..4 {
                        *sides.entry((f[k], f[(k + 1) % 4])).or_insert(0) += 1;
                    }
                }
                assert!(sides.values().all(|c| *c == 1), "{pattern:?}");
                for &(a, b) in sides.keys() {
                    let rim = a < n && b == (a + 1) % n;
                    assert_eq!(sides.contains_key(&(b, a)), !rim, "{pattern:?}");
                }
            }
        }
    }

    #[test]
    fn middles_are_ends_of_chords_or_spokes() {
        let plain = |middle: &[bool]| -> Vec<Pattern> {
            let all = Pattern::all(middle).into_iter();
            all.filter(|p| !p.ring).collect()
        };
        // A triangle: only its Catmull-Clark split.
        let middle = [false, true, false, true, false, true];
        assert_eq!(plain(&middle), [Pattern::catmull_clark(3)]);
        // A cell with four corners and two opposite middles: one chord.
        let middle = [false, true, false, false, true, false];
        assert_eq!(plain(&middle).len(), 1);
        // Three corners and one middle cannot be one face.
        assert!(plain(&[false, true, false, false]).is_empty());
    }

    #[test]
    fn a_ring_gives_each_vertex_of_the_rim_two_faces() {
        for pattern in Pattern::all(&[true; 8]).iter().filter(|p| p.ring) {
            assert!((0..8).all(|k| pattern.faces_at(k) == 2), "{pattern:?}");
            let most = pattern.faces.as_flattened().iter().max();
            assert_eq!(most, Some(&(pattern.count + pattern.inner() - 1)));
        }
    }
}

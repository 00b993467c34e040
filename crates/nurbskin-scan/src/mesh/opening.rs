//! The opening of a mesh at its rims: teeth, strips and spits are removed.
//!
//! As in mathematical morphology: the core are the vertices at least a radius from the rim, and what is farther than the radius and a
//! slack from the core goes. Sharp corners lose their tips. Parts that join two others or close a ring with one, and large ones, stay.
//! Distances are along sides of triangles.
//!
//! Source: J. Serra, *Image Analysis and Mathematical Morphology* (1982), for the opening; on meshes ours.

use super::Manifold;
use super::manifold::NONE;
use super::notches::median_edge;
use super::repair::rim::without;
use glam::DVec3;
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

/// Radius of the opening, in spacings. Dimensionless.
/// Derived: as the mouth of a notch; a strip of twice that width has no vertex off its rims by more.
const RADIUS: f64 = 3.0;
/// Distance beyond the radius within which parts stay, in spacings. Dimensionless.
/// Guard: ways along sides are longer than straight ones, and roughness of a spacing is that of any rim.
const SLACK: f64 = 1.0;
/// Largest part that goes, as a share of the area. Dimensionless. Guard: larger parts are shape.
const MOST_AREA: f64 = 0.01;

/// The mesh without what is narrow at some of its borders, and for each vertex before whether it is gone. O(n log n).
pub(super) fn opened(mesh: Manifold, borders: &[usize]) -> (Manifold, Vec<bool>) {
    let gone = narrow_parts(&mesh, borders);
    let mut lost = vec![false; mesh.points.len()];
    if !gone.contains(&true) {
        return (mesh, lost);
    }
    for flag in [true, false] {
        let triangles = mesh.triangles.iter().zip(&gone);
        for (triangle, _) in triangles.filter(|t| *t.1 == flag) {
            for &k in triangle {
                lost[k as usize] = flag;
            }
        }
    }
    (without(mesh, &gone), lost)
}

/// Which triangles are in narrow parts that hang on one other part along one line.
fn narrow_parts(mesh: &Manifold, borders: &[usize]) -> Vec<bool> {
    let spacing = median_edge(mesh);
    let (radius, reach) = (RADIUS * spacing, (RADIUS + SLACK) * spacing);
    let links = links(mesh);
    let rim = borders.iter().flat_map(|&k| mesh.loops[k].iter().copied());
    let depths = distances_from(rim, &mesh.points, &links, radius);
    let core = (0..).zip(&depths).filter(|(_, depth)| **depth >= radius);
    let back = distances_from(core.map(|(k, _)| k), &mesh.points, &links, reach);
    let is_narrow = |t: &[u32; 3]| t.iter().any(|&k| back[k as usize] >= reach);
    let narrow: Vec<bool> = mesh.triangles.iter().map(is_narrow).collect();
    // Parts of either kind, and beside each narrow one the others.
    let table = mesh.adjacency();
    let count = narrow.len();
    let beside = |t: usize| {
        let neighbours = table.neighbours(t).into_iter();
        neighbours.filter(|o| *o != NONE).map(|o| o as usize)
    };
    let mut parts = DisjointSets::new(count);
    for t in 0..count {
        for other in beside(t).filter(|&o| narrow[o] == narrow[t]) {
            parts.join(t, other);
        }
    }
    let mut found: BTreeMap<usize, Part> = BTreeMap::new();
    for t in (0..count).filter(|&t| narrow[t]) {
        let part = found.entry(parts.root(t)).or_default();
        part.area += mesh.vector_area(t).length();
        let triangle = mesh.triangles[t];
        for (side, other) in table.neighbours(t).into_iter().enumerate() {
            if other != NONE && !narrow[other as usize] {
                part.others.insert(parts.root(other as usize));
                part.sides += 1;
                part.ends.extend([triangle[side], triangle[(side + 1) % 3]]);
            }
        }
    }
    let most = MOST_AREA * mesh.area();
    let hangs = |root: usize| {
        let part = found.get(&root);
        part.is_some_and(|part| part.hangs() && part.area <= most)
    };
    (0..count)
        .map(|t| narrow[t] && hangs(parts.root(t)))
        .collect()
}

/// A narrow part, and where it hangs on others.
#[derive(Default)]
struct Part {
    area: f64,
    others: BTreeSet<usize>,
    /// Number of sides shared with them, and the vertices of these.
    sides: usize,
    ends: BTreeSet<u32>,
}

impl Part {
    /// Whether it hangs on one part along one line: a line has a vertex more than sides, and a part that hangs on two lines would
    /// take a handle or a border with it.
    fn hangs(&self) -> bool {
        self.others.len() == 1 && self.ends.len() == self.sides + 1
    }
}

/// The vertices at the other ends of the sides of each vertex.
fn links(mesh: &Manifold) -> Vec<Vec<u32>> {
    let mut links = vec![Vec::new(); mesh.points.len()];
    for &[a, b, c] in &mesh.triangles {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            links[p as usize].push(q);
            links[q as usize].push(p);
        }
    }
    links
}

/// Length of the shortest way along sides from some vertices to each vertex, at most `most`. O(n log n).
///
/// Source: E. Dijkstra, A note on two problems in connexion with graphs, 1959.
fn distances_from(
    from: impl Iterator<Item = u32>,
    points: &[DVec3],
    links: &[Vec<u32>],
    most: f64,
) -> Vec<f64> {
    let mut distances = vec![most; points.len()];
    let mut queue = BinaryHeap::new();
    for k in from {
        distances[k as usize] = 0.0;
        // The bits of positive numbers are in their order.
        queue.push(Reverse((0_u64, k)));
    }
    while let Some(Reverse((bits, k))) = queue.pop() {
        let distance = f64::from_bits(bits);
        if distance > distances[k as usize] {
            continue;
        }
        for &other in &links[k as usize] {
            let there = distance + points[k as usize].distance(points[other as usize]);
            if there < distances[other as usize] {
                distances[other as usize] = there;
                queue.push(Reverse((there.to_bits(), other)));
            }
        }
    }
    distances
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::repair::repair;
    use crate::mesh::samples::{Mesh, check};
    use nurbskin_geometry::progress::Silent;
    use proptest::prelude::*;

    /// The part of a plane lattice of spacing 1 that a function keeps.
    fn sheet(size: u32, keep: impl Fn(DVec3) -> bool) -> Manifold {
        let n = f64::from(size);
        let mesh = Mesh::lattice([size, size], [false; 2], |u, v| {
            DVec3::new(n * u, n * v, 0.0)
        })
        .without(|p| !keep(p));
        repair(&mesh.points, &mesh.triangles, &Silent)
            .unwrap()
            .manifold
    }

    fn all_opened(mesh: &Manifold) -> (Manifold, Vec<bool>) {
        let borders: Vec<usize> = (0..mesh.loops.len()).collect();
        opened(mesh.clone(), &borders)
    }

    #[test]
    fn a_square_stays() {
        let mesh = sheet(30, |_| true);
        let (same, lost) = all_opened(&mesh);
        // A corner is farther from the core than a side is.
        assert!(lost.iter().filter(|lost| **lost).count() <= 12);
        assert!(same.area() > 0.99 * mesh.area());
    }

    #[test]
    fn a_strip_goes_and_its_vertices_are_told() {
        // A square of 50, and from its right side a strip 2 wide and 6 long.
        let mesh = sheet(60, |p| {
            p.x < 50.5 && p.y < 50.5 || p.x < 56.5 && (12.0 - p.y).abs() < 1.5
        });
        let (open, lost) = all_opened(&mesh);
        check(&open);
        for (p, lost) in mesh.points.iter().zip(&lost) {
            assert!(*lost || p.x < 54.5, "{p} stays");
            assert!(!*lost || p.x > 49.5 || on_corner(*p), "{p} is gone");
        }
        assert!(lost.contains(&true));
    }

    /// Whether a place is at a corner of the square.
    fn on_corner(p: DVec3) -> bool {
        let near = |x: f64| x.min(50.0 - x) < 2.5;
        near(p.x) && near(p.y)
    }

    #[test]
    fn a_strip_between_two_parts_stays() {
        let mesh = sheet(80, |p| {
            let in_square = p.y < 30.5 && (p.x < 30.5 || p.x > 45.5);
            in_square || (12.0 - p.y).abs() < 2.5
        });
        let (open, lost) = all_opened(&mesh);
        check(&open);
        let strip = |p: &DVec3| p.x > 33.0 && p.x < 43.0;
        let gone = mesh
            .points
            .iter()
            .zip(&lost)
            .filter(|(p, lost)| strip(p) && **lost);
        assert_eq!(gone.count(), 0);
        assert!(open.points.iter().any(|p| p.x > 60.0));
    }

    #[test]
    fn a_bar_between_two_windows_stays() {
        // Two windows 12 wide, and a bar 2 wide between them.
        let window = |p: DVec3| (25.0 - p.x).abs() < 12.5 && (25.0 - p.y).abs() < 6.5;
        let mesh = sheet(50, |p| !window(p) || (25.0 - p.x).abs() < 1.5);
        assert_eq!(mesh.loops.len(), 3);
        let (open, _) = all_opened(&mesh);
        check(&open);
        assert_eq!(open.loops.len(), 3);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        /// What is left lies within the radius and the slack of the core, and the core stays.
        #[test]
        fn teeth_go_and_the_core_stays(heights in proptest::collection::vec(0.0..9.0_f64, 20)) {
            let mesh = sheet(40, |p| {
                let ends = (1..20).filter(|k| p.x >= 2.05 * f64::from(*k));
                p.y < 30.5 + heights[ends.count()]
            });
            let (open, lost) = all_opened(&mesh);
            check(&open);
            prop_assert!(open.loops.len() == 1 && open.euler_characteristic() == 1);
            for (p, lost) in mesh.points.iter().zip(&lost) {
                let inside = p.x > 3.5 && p.x < 36.5 && p.y > 3.5 && p.y < 27.0;
                prop_assert!(!(inside && *lost), "{p}");
            }
        }
    }
}

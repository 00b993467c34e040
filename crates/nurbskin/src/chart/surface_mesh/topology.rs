//! The main piece of a mesh as a surface with borders: non-manifold places are cut open.

use glam::DVec3;

/// No partner across a side.
const NONE: u32 = u32::MAX;

/// An edge-connected, consistently wound surface.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    /// Point of each vertex; a point where sheets only touch has several.
    pub(super) point: Vec<u32>,
    /// By vertices, wound the same way.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Its borders by vertices, in the sense of the triangles, longest first.
    pub(super) loops: Vec<Vec<u32>>,
}

impl Piece {
    /// The edge-connected piece with most triangles, cut open along edges where more than two triangles meet or two
    /// that cannot be wound the same way. O(n log n).
    pub(super) fn largest(points: &[DVec3], triangles: &[[u32; 3]]) -> Option<Self> {
        let mut faces: Vec<[u32; 3]> = triangles
            .iter()
            .filter(|t| t.iter().all(|&k| (k as usize) < points.len()))
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .copied()
            .collect();
        let sorted = |t: &[u32; 3]| {
            let mut t = *t;
            t.sort_unstable();
            t
        };
        // The order of the triangles must not matter, and twins would close every edge.
        faces.sort_unstable_by_key(sorted);
        faces.dedup_by_key(|t| sorted(t));
        let mut partners = partners(&faces);
        let component = largest_component(&faces, &partners);
        // Wind all alike, starting from the first; whoever is reached both ways is cut off.
        let first = *component.first()?;
        let mut wound = vec![None; faces.len()];
        wound[first] = Some(false);
        let mut queue = std::collections::VecDeque::from([first]);
        while let Some(t) = queue.pop_front() {
            let turned = wound[t].unwrap_or(false);
            for s in 0..3 {
                let side = 3 * t + s;
                let other = partners[side];
                if other == NONE {
                    continue;
                }
                let u = other as usize / 3;
                let same = start(&faces, side) == start(&faces, other as usize);
                match wound[u] {
                    None => {
                        wound[u] = Some(turned ^ same);
                        queue.push_back(u);
                    }
                    Some(before) if before != turned ^ same => {
                        partners[side] = NONE;
                        partners[other as usize] = NONE;
                    }
                    Some(_) => {}
                }
            }
        }
        Some(Self::assemble(
            points, &faces, &partners, &wound, &component,
        ))
    }

    fn assemble(
        points: &[DVec3],
        faces: &[[u32; 3]],
        partners: &[u32],
        wound: &[Option<bool>],
        component: &[usize],
    ) -> Self {
        // Corners that meet across a side are one vertex.
        let mut parents: Vec<usize> = (0..3 * faces.len()).collect();
        for &t in component {
            for s in 0..3 {
                let other = partners[3 * t + s];
                if other == NONE {
                    continue;
                }
                let (u, r) = (other as usize / 3, other as usize % 3);
                let ends = [3 * t + s, 3 * t + (s + 1) % 3];
                let mut theirs = [3 * u + r, 3 * u + (r + 1) % 3];
                if faces[t][s] != faces[u][r] {
                    theirs.reverse();
                }
                for (a, b) in ends.into_iter().zip(theirs) {
                    let (a, b) = (root(&mut parents, a), root(&mut parents, b));
                    parents[a.max(b)] = a.min(b);
                }
            }
        }
        let mut number = vec![NONE; parents.len()];
        let mut point = Vec::new();
        let mut triangles = Vec::with_capacity(component.len());
        let mut next: Vec<u32> = Vec::new();
        for &t in component {
            let corners = [0, 1, 2].map(|c| {
                let r = root(&mut parents, 3 * t + c);
                if number[r] == NONE {
                    number[r] = u32::try_from(point.len()).unwrap_or(NONE);
                    point.push(faces[t][c]);
                    next.push(NONE);
                }
                number[r]
            });
            for s in 0..3 {
                if partners[3 * t + s] == NONE {
                    let (mut a, mut b) = (corners[s], corners[(s + 1) % 3]);
                    if wound[t] == Some(true) {
                        (a, b) = (b, a);
                    }
                    next[a as usize] = b;
                }
            }
            let [a, b, c] = corners;
            triangles.push(if wound[t] == Some(true) {
                [a, c, b]
            } else {
                corners
            });
            debug_assert!(a != b && b != c);
        }
        let mut loops = Vec::new();
        for k in 0..next.len() {
            let mut border = Vec::new();
            let mut at = k;
            while next[at] != NONE {
                border.push(u32::try_from(at).unwrap_or(NONE));
                at = std::mem::replace(&mut next[at], NONE) as usize;
            }
            if border.len() >= 3 && at == k {
                loops.push(border);
            }
        }
        let place = |k: u32| points[point[k as usize] as usize];
        let length = |border: &[u32]| -> f64 {
            let steps = border.iter().zip(border.iter().cycle().skip(1));
            steps.map(|(&a, &b)| place(a).distance(place(b))).sum()
        };
        let mut keyed: Vec<(f64, Vec<u32>)> = loops.into_iter().map(|l| (length(&l), l)).collect();
        keyed.sort_by(|a, b| b.0.total_cmp(&a.0));
        Self {
            loops: keyed.into_iter().map(|l| l.1).collect(),
            point,
            triangles,
        }
    }
}

/// The point that a side (3 times its triangle plus its number) starts from.
fn start(faces: &[[u32; 3]], side: usize) -> u32 {
    faces[side / 3][side % 3]
}

/// For each side the only other side between the same points, or `NONE`.
fn partners(faces: &[[u32; 3]]) -> Vec<u32> {
    let mut sides: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * faces.len());
    for (t, f) in (0_u32..).zip(faces) {
        for s in 0..3 {
            let (a, b) = (f[s], f[(s + 1) % 3]);
            sides.push((a.min(b), a.max(b), 3 * t + u32::try_from(s).unwrap_or(0)));
        }
    }
    sides.sort_unstable();
    let mut partners = vec![NONE; sides.len()];
    for same in sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        if let [x, y] = same {
            partners[x.2 as usize] = y.2;
            partners[y.2 as usize] = x.2;
        }
    }
    partners
}

/// The triangles of the piece that has most of them.
fn largest_component(faces: &[[u32; 3]], partners: &[u32]) -> Vec<usize> {
    let mut seen = vec![false; faces.len()];
    let mut largest = Vec::new();
    for first in 0..faces.len() {
        if seen[first] {
            continue;
        }
        seen[first] = true;
        let mut piece = vec![first];
        let mut k = 0;
        while k < piece.len() {
            for &other in &partners[3 * piece[k]..3 * piece[k] + 3] {
                if other != NONE && !seen[other as usize / 3] {
                    seen[other as usize / 3] = true;
                    piece.push(other as usize / 3);
                }
            }
            k += 1;
        }
        if piece.len() > largest.len() {
            largest = piece;
        }
    }
    largest
}

fn root(parents: &mut [usize], mut k: usize) -> usize {
    while parents[k] != k {
        parents[k] = parents[parents[k]];
        k = parents[k];
    }
    k
}

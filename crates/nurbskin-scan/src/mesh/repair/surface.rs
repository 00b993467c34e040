//! Triangles paired across their sides, and the manifold that the pairing defines.
//!
//! An edge with two triangles makes one pair. At an edge with more, the sides are paired in order of least bend.
//! Corners that meet across a pair are one vertex (equivalence classes by disjoint sets), so that every vertex has one
//! fan of triangles by construction. Double edges between the same vertices are split at their middle; borders of two
//! sides are closed. Source: ours.

use super::soup::Soup;
use crate::mesh::manifold::{Manifold, NONE, after, opposite_sides, sides_by_edge};
use glam::DVec3;
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use nurbskin_geometry::unit::counted;

/// Share of the edges with two triangles that must be wound consistently for the winding to be used. Trial: not
/// recorded. A random winding is consistent at half of the edges.
const MIN_CONSISTENT_EDGES: f64 = 0.98;
/// Penalty of a hollow bend against a bulging one in the choice of pairs at a crowded edge, as a cosine. Trial: not
/// recorded. It takes solids apart that share only an edge; a large penalty would join flat sheets wrongly.
const HOLLOW_PENALTY: f64 = 0.1;
/// Most passes that split double edges; each splits edges without a common triangle. Guard: a few passes suffice for
/// all but contrived meshes.
const MAX_SPLIT_PASSES: usize = 64;

/// Triangles, and the pairing of their sides.
#[derive(Clone, Debug, Default)]
pub(in crate::mesh) struct Surface {
    pub(in crate::mesh) points: Vec<DVec3>,
    pub(in crate::mesh) source: Vec<Option<u32>>,
    pub(in crate::mesh) triangles: Vec<[u32; 3]>,
    /// The side across each side (3 times the triangle plus the number of its first corner), or [`NONE`].
    pub(in crate::mesh) opposite: Vec<u32>,
}

/// Result of [`Surface::join`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Joined {
    /// Whether the winding of the triangles is consistent enough to be used.
    pub(super) trusted: bool,
    crowded: usize,
}

impl Joined {
    pub(super) fn note(self) -> Option<String> {
        (self.crowded > 0).then(|| {
            format!(
                "{} more than two triangles; those that continue each other best were joined in pairs",
                counted(self.crowded, "edge has", "edges have")
            )
        })
    }
}

/// The main piece of a [`Surface`].
#[derive(Clone, Debug, Default)]
pub(in crate::mesh) struct Assembled {
    pub(in crate::mesh) manifold: Manifold,
    /// Index in the surface of each triangle that is now number 0, 1, ...; triangles beyond these were added by
    /// splitting edges.
    pub(in crate::mesh) kept: Vec<u32>,
    /// Areas of all pieces, largest first.
    pub(in crate::mesh) pieces: Vec<f64>,
}

impl Surface {
    /// Joins the triangles across their edges; at edges with more than two, those that bend least, in pairs.
    pub(super) fn join(soup: &Soup) -> (Self, Joined) {
        let triangles = soup.triangles.clone();
        let sides = sides_by_edge(&triangles);
        let groups = || sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1));
        let start = |side: u32| triangles[side as usize / 3][side as usize % 3];
        let pairs = groups().filter(|g| g.len() == 2);
        let agree = |g: &&[(u32, u32, u32)]| start(g[0].2) != start(g[1].2);
        let agreeing = pairs.clone().filter(agree).count();
        let trusted =
            agreeing > 0 && agreeing as f64 >= MIN_CONSISTENT_EDGES * pairs.count() as f64;
        let mut opposite = vec![NONE; sides.len()];
        let mut crowded = 0;
        for group in groups() {
            match group {
                [_] => {}
                [x, y] => {
                    opposite[x.2 as usize] = y.2;
                    opposite[y.2 as usize] = x.2;
                }
                _ => {
                    crowded += 1;
                    let members: Vec<u32> = group.iter().map(|s| s.2).collect();
                    for [x, y] in best_pairs(&soup.points, &triangles, &members, trusted) {
                        opposite[x as usize] = y;
                        opposite[y as usize] = x;
                    }
                }
            }
        }
        let surface = Self {
            points: soup.points.clone(),
            source: soup.source.iter().map(|&k| Some(k)).collect(),
            triangles,
            opposite,
        };
        (surface, Joined { trusted, crowded })
    }

    /// A manifold as a surface whose sides can be cut or joined.
    pub(in crate::mesh) fn from_manifold(manifold: Manifold) -> Self {
        Self {
            opposite: opposite_sides(&manifold.triangles),
            points: manifold.points,
            source: manifold.source,
            triangles: manifold.triangles,
        }
    }

    /// The area of all triangles.
    pub(super) fn area(&self) -> f64 {
        let all = 0..self.triangles.len();
        all.map(|t| self.area_of(t)).sum()
    }

    pub(super) fn area_of(&self, triangle: usize) -> f64 {
        let [a, b, c] = self.triangles[triangle].map(|k| self.points[k as usize]);
        0.5 * (b - a).cross(c - a).length()
    }

    pub(super) fn start(&self, side: u32) -> u32 {
        self.triangles[side as usize / 3][side as usize % 3]
    }

    /// The ends of a side.
    pub(super) fn ends(&self, side: u32) -> [u32; 2] {
        [self.start(side), self.start(after(side))]
    }

    /// Separates two joined sides.
    pub(in crate::mesh) fn cut(&mut self, side: u32) {
        let other = std::mem::replace(&mut self.opposite[side as usize], NONE);
        if other != NONE {
            self.opposite[other as usize] = NONE;
        }
    }

    /// The piece of largest area as a manifold: corners that meet across a pair of sides are one vertex, and no others.
    /// About O(n).
    pub(in crate::mesh) fn assemble(mut self) -> Assembled {
        let (piece, pieces) = self.pieces();
        self.close_slits(&piece);
        let mut corners = self.corners();
        let inside: Vec<u32> = (0_u32..)
            .zip(&piece)
            .filter(|(_, p)| **p == 0)
            .map(|(t, _)| t)
            .collect();
        // 1. Vertices, in the order of their points.
        let mut roots: Vec<(u32, usize)> = Vec::new();
        for &t in &inside {
            for side in sides_of(t as usize) {
                if corners.root(side as usize) == side as usize {
                    roots.push((self.start(side), side as usize));
                }
            }
        }
        roots.sort_unstable();
        let mut number = vec![NONE; 3 * self.triangles.len()];
        for (k, &(_, corner)) in (0_u32..).zip(&roots) {
            number[corner] = k;
        }
        // 2. Triangles.
        let mut manifold = Manifold {
            points: roots.iter().map(|r| self.points[r.0 as usize]).collect(),
            source: roots.iter().map(|r| self.source[r.0 as usize]).collect(),
            ..Manifold::default()
        };
        let mut opposite = Vec::with_capacity(3 * inside.len());
        let mut place = vec![NONE; self.triangles.len()];
        for (k, &t) in (0_u32..).zip(&inside) {
            place[t as usize] = k;
        }
        for &t in &inside {
            let sides = sides_of(t as usize);
            manifold
                .triangles
                .push(sides.map(|side| number[corners.root(side as usize)]));
            opposite.extend(sides.map(|side| match self.opposite[side as usize] {
                NONE => NONE,
                other => 3 * place[other as usize / 3] + other % 3,
            }));
        }
        split_double_edges(&mut manifold, &mut opposite);
        manifold.loops = borders(&manifold, &opposite);
        Assembled {
            manifold,
            kept: inside,
            pieces,
        }
    }

    /// The number of the piece of each triangle, and their areas, largest first.
    fn pieces(&self) -> (Vec<u32>, Vec<f64>) {
        let mut of = vec![NONE; self.triangles.len()];
        let mut areas = Vec::new();
        for first in 0..of.len() {
            if of[first] != NONE {
                continue;
            }
            let number = u32::try_from(areas.len()).unwrap_or(NONE);
            of[first] = number;
            let mut stack = vec![first];
            let mut area = 0.0;
            while let Some(t) = stack.pop() {
                area += self.area_of(t);
                for &other in &self.opposite[3 * t..3 * t + 3] {
                    if other != NONE && of[other as usize / 3] == NONE {
                        of[other as usize / 3] = number;
                        stack.push(other as usize / 3);
                    }
                }
            }
            areas.push((area, number));
        }
        areas.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut rank = vec![NONE; areas.len()];
        for (k, a) in (0_u32..).zip(&areas) {
            rank[a.1 as usize] = k;
        }
        for piece in &mut of {
            *piece = rank[*piece as usize];
        }
        (of, areas.into_iter().map(|a| a.0).collect())
    }

    /// Sets of the corners 3 t + c that meet across pairs of sides.
    fn corners(&self) -> DisjointSets {
        let mut sets = DisjointSets::new(self.opposite.len());
        for (side, &other) in (0_u32..).zip(&self.opposite) {
            if other != NONE && side < other {
                sets.join(side as usize, after(other) as usize);
                sets.join(after(side) as usize, other as usize);
            }
        }
        sets
    }

    /// Joins the two sides of borders that consist of two sides.
    fn close_slits(&mut self, piece: &[u32]) {
        let mut corners = self.corners();
        let mut open: Vec<(usize, usize, u32)> = Vec::new();
        for (side, &other) in (0_u32..).zip(&self.opposite) {
            if other == NONE && piece[side as usize / 3] == 0 {
                let ends = [side, after(side)].map(|c| corners.root(c as usize));
                open.push((ends[0], ends[1], side));
            }
        }
        open.sort_unstable();
        for &(a, b, side) in &open {
            let from = open.partition_point(|o| (o.0, o.1) < (b, a));
            if let Some(&(x, y, other)) = open.get(from)
                && (x, y) == (b, a)
                && side < other
            {
                self.opposite[side as usize] = other;
                self.opposite[other as usize] = side;
            }
        }
    }
}

/// The three sides of a triangle.
pub(super) fn sides_of(triangle: usize) -> [u32; 3] {
    let first = u32::try_from(3 * triangle).unwrap_or(NONE);
    [first, first + 1, first + 2]
}

/// Pairs of the sides of one edge, least bend first; only between triangles wound alike if the winding is `trusted`.
fn best_pairs(
    points: &[DVec3],
    triangles: &[[u32; 3]],
    members: &[u32],
    trusted: bool,
) -> Vec<[u32; 2]> {
    let place = |side: u32| points[triangles[side as usize / 3][side as usize % 3] as usize];
    // Direction from the edge into the triangle, perpendicular to the edge.
    let into = |side: u32| {
        let (a, b) = (place(side), place(after(side)));
        let c = place(after(after(side)));
        let along = (b - a).normalize_or_zero();
        let d = c - a;
        (d - along * along.dot(d)).normalize_or_zero()
    };
    let start = |side: u32| triangles[side as usize / 3][side as usize % 3];
    let normal = |side: u32| {
        let (a, b, c) = (place(side), place(after(side)), place(after(after(side))));
        (b - a).cross(c - a)
    };
    let mut pairs = Vec::new();
    for (k, &x) in members.iter().enumerate() {
        for &y in &members[k + 1..] {
            let against = trusted && start(x) == start(y);
            let hollow = trusted && normal(x).dot(into(y)) > 0.0;
            let bend = into(x).dot(into(y)) + if hollow { HOLLOW_PENALTY } else { 0.0 };
            pairs.push((against, bend, x, y));
        }
    }
    pairs.sort_by(|a, b| {
        let by_bend = a.0.cmp(&b.0).then(a.1.total_cmp(&b.1));
        by_bend.then((a.2, a.3).cmp(&(b.2, b.3)))
    });
    let mut taken: Vec<u32> = Vec::new();
    let mut best = Vec::new();
    for (against, _, x, y) in pairs {
        if !against && !taken.contains(&x) && !taken.contains(&y) {
            taken.extend([x, y]);
            best.push([x, y]);
        }
    }
    best
}

/// Splits all but one of the edges between the same two vertices, so that two vertices identify an edge.
fn split_double_edges(manifold: &mut Manifold, opposite: &mut Vec<u32>) {
    // Each pass splits edges without a common triangle; only contrived meshes need more than a few passes.
    for _ in 0..MAX_SPLIT_PASSES {
        let sides = sides_by_edge(&manifold.triangles);
        let mut touched: Vec<u32> = Vec::new();
        let mut again = false;
        for group in sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            let own = group[0].2;
            for &(_, _, side) in &group[1..] {
                let other = opposite[side as usize];
                if other == own || (other != NONE && other < side) {
                    continue;
                }
                let both = [side / 3, if other == NONE { NONE } else { other / 3 }];
                again = true;
                if both.iter().any(|t| *t != NONE && touched.contains(t)) {
                    continue;
                }
                touched.extend(both.iter().filter(|t| **t != NONE));
                split_edge(manifold, opposite, side);
            }
        }
        if !again {
            break;
        }
    }
}

/// Splits the edge of this side at its middle.
fn split_edge(manifold: &mut Manifold, opposite: &mut Vec<u32>, side: u32) {
    let count = |n: usize| u32::try_from(n).unwrap_or(NONE);
    let start = |m: &Manifold, side: u32| m.triangles[side as usize / 3][side as usize % 3];
    let (a, b) = (start(manifold, side), start(manifold, after(side)));
    let middle = count(manifold.points.len());
    let place = manifold.points[a as usize].midpoint(manifold.points[b as usize]);
    manifold.points.push(place);
    manifold.source.push(None);
    // The half that keeps the index of the triangle keeps the start of its side.
    let half = |manifold: &mut Manifold, opposite: &mut Vec<u32>, side: u32| {
        let (end, apex) = (after(side), after(after(side)));
        let fresh = 3 * count(manifold.triangles.len());
        let (b, c) = (start(manifold, end), start(manifold, apex));
        manifold.triangles[end as usize / 3][end as usize % 3] = middle;
        manifold.triangles.push([middle, b, c]);
        let beyond = opposite[end as usize];
        opposite.extend([NONE, beyond, end]);
        if beyond != NONE {
            opposite[beyond as usize] = fresh + 1;
        }
        opposite[end as usize] = fresh + 2;
        fresh
    };
    let other = opposite[side as usize];
    let fresh = half(manifold, opposite, side);
    if other != NONE {
        let beyond = half(manifold, opposite, other);
        // side runs a to middle, beyond's middle to a; fresh middle to b, other b to middle.
        opposite[side as usize] = beyond;
        opposite[beyond as usize] = side;
        opposite[fresh as usize] = other;
        opposite[other as usize] = fresh;
    }
}

/// The borders, longest first; each begins at its vertex of smallest index.
pub(in crate::mesh) fn borders(manifold: &Manifold, opposite: &[u32]) -> Vec<Vec<u32>> {
    let mut next = vec![NONE; manifold.points.len()];
    for (side, _) in (0_u32..).zip(opposite).filter(|s| *s.1 == NONE) {
        let [a, b] =
            [side, after(side)].map(|s| manifold.triangles[s as usize / 3][s as usize % 3]);
        next[a as usize] = b;
    }
    let mut loops = Vec::new();
    for first in 0..next.len() {
        let mut border = Vec::new();
        let mut at = first;
        while next[at] != NONE {
            border.push(u32::try_from(at).unwrap_or(NONE));
            at = std::mem::replace(&mut next[at], NONE) as usize;
        }
        if border.len() >= 3 && at == first {
            loops.push(border);
        }
    }
    longest_first(&manifold.points, &mut loops);
    loops
}

/// Sorts borders by length, longest first.
pub(in crate::mesh) fn longest_first(points: &[DVec3], loops: &mut Vec<Vec<u32>>) {
    let place = |k: u32| points[k as usize];
    let length = |border: &[u32]| -> f64 {
        let steps = border.iter().zip(border.iter().cycle().skip(1));
        steps.map(|(&a, &b)| place(a).distance(place(b))).sum()
    };
    let mut keyed: Vec<(f64, Vec<u32>)> = loops.drain(..).map(|l| (length(&l), l)).collect();
    keyed.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    loops.extend(keyed.into_iter().map(|l| l.1));
}

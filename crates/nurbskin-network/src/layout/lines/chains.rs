//! Chains of edges between ends and junctions: pruned, straightened, and chosen.

use super::bend::Bends;
use super::thin::{Skeleton, Weight};
use super::{ABOVE_REST, FeatureLines, Limits, MIN_LENGTH, NONE, Surface};
use nurbskin_geometry::numeric::statistics::{median_in_place, quantile_in_place};
use nurbskin_geometry::unit::counted;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Length in spacings up to which a chain with a loose end is a spur of the band. Derived: a band reaches a spacing and
/// a half to both sides of its ridge. Trial: 4 on boxes and the bunny; not varied.
const SPUR: f64 = 4.0;
/// Distance in spacings within which a chain with a loose end runs beside another line. Trial: 2.5 on boxes with fillets
/// of 1.8 spacings, whose ridges are flat. Derived: less than two lines need between them.
const BESIDE: f64 = 2.5;
/// Most vertices searched for a line. Guard: against meshes much finer than the spacing.
const MOST: usize = 200;
/// Share of a chain that is strong. Trial: a quarter, not varied alone. Noise lifts single edges of a fillet of four
/// spacings over the limit.
const STRONG_SHARE: f64 = 0.25;
/// Most rounds of pruning. Guard: each round removes a chain, so it ends anyway.
const MAX_ROUNDS: usize = 100;
/// Weight of the distance from the ridge when a chain is straightened. Derived: at 16 an edge half a
/// spacing off, where the bend is down by a quarter, counts twice its length.
const OFF_RIDGE: f64 = 16.0;
/// Quantile of the bend at the vertices of a chain that counts as the height of its ridge. Trial: 0.9; not varied.
const RIDGE_QUANTILE: f64 = 0.9;

/// Least width of a region between lines, twice its area over its border, in spacings. Trial: 2.5 on bunny and soup can.
/// Both lines of a narrower one bend the surface in the strips of the other.
const MIN_WIDTH: f64 = 2.5;
/// Least area of a region between lines in squares of the spacing. Trial: 30 on bunny and soup can, whose double lines
/// are joined as ladders.
const MIN_AREA: f64 = 30.0;
/// Least share of the bend across a chain in what the surface bends farther out. Derived: a cylinder has 0.36 (two
/// spacings against five and a half), a right-angled fillet of radius two spacings 0.61, a sharp edge 1. Noise takes a tenth.
const MIN_SHARE: f64 = 0.55;
/// Least share of the edges that bend, of which a line is the cause, for lines that are no exact creases.
/// Trial: on boxes, cylinders and brackets with noise and fillets 0.78 to 0.9; on organic scans (banana, bunny, two heads, a
/// vase, a bottle) 0.2 to 0.6. Between the two; not varied.
const MIN_EXPLAINED: f64 = 0.7;

/// Least total length of connected exact creases on an organic shape, as a share of the diagonal.
/// Trial: the rims of filled holes on the bunny have 0.09, the plane that cuts off a head at its neck 1.2; not varied.
const MIN_ALONE: f64 = 0.25;

/// Edges from one end or junction to the next.
struct Chain {
    edges: Vec<usize>,
    /// In the order of the edges, one more than edges; the last is the first if the chain is closed.
    vertices: Vec<u32>,
}

/// The graph of the lines.
pub(super) struct Chains<'a> {
    surface: &'a Surface<'a>,
    bends: &'a Bends,
    on: Vec<bool>,
    /// Chains left out because the surface bends too little across them.
    faint: usize,
    /// Chains left out because the surface bends as much elsewhere.
    common: usize,
}

impl<'a> Chains<'a> {
    pub(super) fn new(
        surface: &'a Surface<'a>,
        bends: &'a Bends,
        limits: &Limits,
        skeleton: Skeleton,
    ) -> Self {
        let mut chains = Self {
            surface,
            bends,
            on: skeleton.edges,
            faint: 0,
            common: 0,
        };
        chains.prune();
        chains.merge_slivers();
        chains.prune();
        chains.straighten(&skeleton.band);
        chains.choose(limits);
        chains.merge_slivers();
        chains.prune();
        chains.choose(limits);
        if let Some(bent) = limits.bent
            && chains.explained(bent) < MIN_EXPLAINED
        {
            chains.keep_exact(limits);
        }
        chains
    }

    /// The lines that were kept.
    pub(super) fn lines(self, mut lines: FeatureLines) -> FeatureLines {
        for (edge, _) in self.on.iter().enumerate().filter(|(_, on)| **on) {
            let side = self.surface.edges[edge] as usize;
            lines.sides[side] = true;
            lines.sides[self.surface.adjacency.opposite[side] as usize] = true;
            lines.length += self.surface.length(edge);
        }
        lines.chains = self.split().len();
        if self.faint > 0 {
            lines.notes.push(format!(
                "{} left out: the surface bends there little more than elsewhere, or is round",
                counted(
                    self.faint,
                    "possible feature line was",
                    "possible feature lines were"
                ),
            ));
        }
        if self.common > 0 {
            lines.notes.push(format!(
                "{} left out: the surface bends as much elsewhere, as that of no machined part does (`--sharp DEGREES` \
                 keeps them)",
                counted(
                    self.common,
                    "possible feature line was",
                    "possible feature lines were"
                ),
            ));
        }
        lines
    }

    /// Of the edges that bend by more than an angle, the share of those that lie on or beside a line. On a part with
    /// sharp edges the faces between them are calm; on an organic shape the surface bends everywhere.
    fn explained(&self, angle: f64) -> f64 {
        let bent = (0..self.on.len()).filter(|&e| self.bends.bend[e].abs() > angle);
        let (mut beside, mut all) = (0_usize, 0_usize);
        for e in bent {
            let reach = BESIDE * self.surface.reach[e];
            let near = || {
                let ends = self.surface.ends(e);
                ends.iter().all(|&v| self.is_near_line(v, reach))
            };
            all += 1;
            beside += usize::from(self.on[e] || near());
        }
        beside as f64 / all.max(1) as f64
    }

    /// Keeps the chains that are exact creases, and are long enough.
    fn keep_exact(&mut self, limits: &Limits) {
        for chain in self.split() {
            if !self.is_exact(&chain) {
                self.common += 1;
                chain.edges.iter().for_each(|&e| self.on[e] = false);
            }
        }
        self.keep_long(limits, MIN_ALONE);
    }

    fn length(&self, chain: &Chain) -> f64 {
        chain.edges.iter().map(|&e| self.surface.length(e)).sum()
    }

    /// Whether half of a chain or more are exact creases.
    fn is_exact(&self, chain: &Chain) -> bool {
        let exact = chain.edges.iter().filter(|&&e| self.bends.exact[e]);
        2 * exact.count() >= chain.edges.len()
    }

    /// For each vertex its edges on lines.
    fn incident(&self) -> Vec<Vec<u32>> {
        let mut incident = vec![Vec::new(); self.surface.mesh.points.len()];
        for (edge, _) in (0_u32..).zip(&self.on).filter(|(_, on)| **on) {
            for v in self.surface.ends(edge as usize) {
                incident[v as usize].push(edge);
            }
        }
        incident
    }

    fn split(&self) -> Vec<Chain> {
        let incident = self.incident();
        let mut left = self.on.clone();
        let mut chains = Vec::new();
        let nodes = (0..incident.len()).filter(|&v| incident[v].len() != 2);
        // Closed chains begin anywhere, after those between nodes.
        for start in nodes.chain(0..incident.len()) {
            for &first in &incident[start] {
                if left[first as usize] {
                    chains.push(self.follow(&incident, &mut left, start, first));
                }
            }
        }
        chains
    }

    fn follow(&self, incident: &[Vec<u32>], left: &mut [bool], start: usize, first: u32) -> Chain {
        let mut chain = Chain {
            edges: Vec::new(),
            vertices: vec![u32::try_from(start).unwrap_or(NONE)],
        };
        let (mut at, mut edge) = (start, first as usize);
        loop {
            left[edge] = false;
            let [a, b] = self.surface.ends(edge);
            at = if a as usize == at {
                b as usize
            } else {
                a as usize
            };
            chain.edges.push(edge);
            chain.vertices.push(if a as usize == at { a } else { b });
            if incident[at].len() != 2 {
                return chain;
            }
            match incident[at].iter().find(|&&e| left[e as usize]) {
                Some(&next) => edge = next as usize,
                None => return chain,
            }
        }
    }

    /// Removes chains with a loose end that are short or run beside another line, the shortest first.
    fn prune(&mut self) {
        for _ in 0..MAX_ROUNDS {
            let incident = self.incident();
            let mut loose: Vec<(Weight, Vec<u32>, Vec<usize>)> = Vec::new();
            for chain in self.split() {
                let ends = [chain.vertices[0], chain.vertices[chain.edges.len()]];
                let is_loose = ends.map(|v| incident[v as usize].len() == 1);
                if is_loose.contains(&true) && !self.is_exact(&chain) {
                    let mut tests = vec![chain.vertices[chain.vertices.len() / 2]];
                    tests.extend(
                        ends.iter()
                            .zip(is_loose)
                            .filter(|(_, loose)| *loose)
                            .map(|(v, _)| *v),
                    );
                    loose.push((Weight(self.length(&chain)), tests, chain.edges));
                }
            }
            loose.sort();
            let mut changed = false;
            for (length, tests, edges) in loose {
                let reach =
                    edges.iter().map(|&e| self.surface.reach[e]).sum::<f64>() / edges.len() as f64;
                edges.iter().for_each(|&e| self.on[e] = false);
                // Without it: are there lines near it, and does it begin at one?
                let beside = tests.iter().all(|&v| self.is_near_line(v, BESIDE * reach));
                let short = tests.len() == 2 && length.0 < SPUR * reach;
                let taken = beside || short;
                changed |= taken;
                if !taken {
                    edges.iter().for_each(|&e| self.on[e] = true);
                }
            }
            if !changed {
                return;
            }
        }
    }

    /// Whether there is a line within a distance of a vertex, along the mesh.
    fn is_near_line(&self, vertex: u32, distance: f64) -> bool {
        let centre = self.surface.mesh.points[vertex as usize];
        let mut met = vec![vertex];
        let mut next = 0;
        while let Some(&v) = met.get(next) {
            next += 1;
            for (w, edge) in self.surface.around(v) {
                if self.on[edge] {
                    return true;
                }
                let near = self.surface.mesh.points[w as usize].distance(centre) < distance;
                if near && met.len() < MOST && !met.contains(&w) {
                    met.push(w);
                }
            }
        }
        false
    }

    /// Removes the weakest chain round each region that is too narrow for two lines.
    fn merge_slivers(&mut self) {
        for _ in 0..MAX_ROUNDS {
            let regions = self.regions();
            let count = regions.iter().max().map_or(0, |&last| last as usize + 1);
            let mut area = vec![0.0; count];
            for (t, &region) in regions.iter().enumerate() {
                area[region as usize] += self.surface.mesh.vector_area(t).length();
            }
            let mut border = vec![0.0; count];
            let mut reach = vec![0.0; count];
            let mut weakest = vec![(Weight(f64::INFINITY), usize::MAX); count];
            let chains = self.split();
            for (c, chain) in chains.iter().enumerate() {
                let [left, right] = self
                    .surface
                    .beside(chain.edges[0])
                    .map(|t| regions[t] as usize);
                if left == right {
                    continue;
                }
                let length = self.length(chain);
                let sum = |of: &dyn Fn(usize) -> f64| {
                    chain
                        .edges
                        .iter()
                        .map(|&e| of(e) * self.surface.length(e))
                        .sum::<f64>()
                };
                let own = sum(&|e| self.surface.reach[e]);
                let ridge = sum(&|e| self.bends.ridge(e)) / length;
                for region in [left, right] {
                    border[region] += length;
                    reach[region] += own;
                    if !self.is_exact(chain) {
                        weakest[region] = weakest[region].min((Weight(ridge), c));
                    }
                }
            }
            let mut changed = false;
            for region in 0..count {
                let spacing = reach[region] / border[region];
                let narrow = 2.0 * area[region] < MIN_WIDTH * spacing * border[region];
                let small = area[region] < MIN_AREA * spacing * spacing;
                if let (true, Some(chain)) = (narrow || small, chains.get(weakest[region].1)) {
                    changed = true;
                    chain.edges.iter().for_each(|&e| self.on[e] = false);
                }
            }
            if !changed {
                return;
            }
        }
    }

    /// For each triangle the number of its region between the lines.
    fn regions(&self) -> Vec<u32> {
        let count = self.surface.normals.len();
        let mut of = vec![NONE; count];
        let mut regions = 0;
        for start in 0..count {
            if of[start] != NONE {
                continue;
            }
            of[start] = regions;
            let mut open = vec![start];
            while let Some(t) = open.pop() {
                for side in 3 * t..3 * t + 3 {
                    let edge = self.surface.edge_of[side];
                    if edge == NONE || self.on[edge as usize] {
                        continue;
                    }
                    let other = self.surface.adjacency.opposite[side] as usize / 3;
                    if of[other] == NONE {
                        of[other] = regions;
                        open.push(other);
                    }
                }
            }
            regions += 1;
        }
        of
    }

    /// Replaces each chain by the shortest path near the ridge, within the band and off all other chains.
    fn straighten(&mut self, band: &[bool]) {
        let height = self.bends.heights(self.surface);
        let mut usable = vec![false; height.len()];
        for (t, _) in band.iter().enumerate().filter(|(_, band)| **band) {
            for v in self.surface.mesh.triangles[t] {
                usable[v as usize] = true;
            }
        }
        let chains = self.split();
        for v in chains.iter().flat_map(|chain| &chain.vertices) {
            usable[*v as usize] = false;
        }
        for chain in chains {
            if self.is_exact(&chain) {
                continue;
            }
            let mut at: Vec<f64> = chain.vertices.iter().map(|&v| height[v as usize]).collect();
            let ridge = quantile_in_place(&mut at, RIDGE_QUANTILE);
            for part in pieces(&chain, &height) {
                part.iter().for_each(|&v| usable[v as usize] = true);
                let path = self.path(part, &usable, |a, b| {
                    let off = (1.0 - 0.5 * (height[a] + height[b]) / ridge).max(0.0);
                    1.0 + OFF_RIDGE * off * off
                });
                part.iter().for_each(|&v| usable[v as usize] = false);
                if let Some(path) = path {
                    for pair in part.windows(2) {
                        self.set(pair[0], pair[1], false);
                    }
                    for pair in path.windows(2) {
                        self.set(pair[0], pair[1], true);
                        usable[pair[0] as usize] = false;
                    }
                }
            }
        }
    }

    fn set(&mut self, a: u32, b: u32, on: bool) {
        if let Some(edge) = self.edge(a, b) {
            self.on[edge] = on;
        }
    }

    fn edge(&self, a: u32, b: u32) -> Option<usize> {
        self.surface
            .around(a)
            .find(|&(v, _)| v == b)
            .map(|(_, edge)| edge)
    }

    /// The cheapest path between the ends of a part of a chain over usable vertices, by Dijkstra's algorithm.
    fn path(
        &self,
        part: &[u32],
        usable: &[bool],
        factor: impl Fn(usize, usize) -> f64,
    ) -> Option<Vec<u32>> {
        let (&start, &end) = (part.first()?, part.last()?);
        // In order of vertices, so that no order of a hash table matters.
        let mut best = std::collections::BTreeMap::from([(start, (0.0, start))]);
        let mut open = BinaryHeap::from([Reverse((Weight(0.0), start))]);
        while let Some(Reverse((Weight(cost), v))) = open.pop() {
            if v == end && cost > 0.0 {
                break;
            }
            if best.get(&v).is_some_and(|b| cost > b.0) {
                continue;
            }
            for (w, edge) in self.surface.around(v) {
                if !usable[w as usize] {
                    continue;
                }
                let reached = cost + self.surface.length(edge) * factor(v as usize, w as usize);
                if best.get(&w).is_none_or(|b| reached < b.0) {
                    best.insert(w, (reached, v));
                    open.push(Reverse((Weight(reached), w)));
                }
            }
        }
        let mut path = vec![end];
        let mut at = end;
        while at != start {
            at = best.get(&at)?.1;
            path.push(at);
        }
        Some(path)
    }

    /// Keeps the chains that stand clear of the rest of the mesh; of these the connected ones that are long enough and
    /// somewhere strong.
    fn choose(&mut self, limits: &Limits) {
        let least = limits.weak.max(ABOVE_REST * self.bends.rest);
        for chain in self.split() {
            let median = |of: &dyn Fn(usize) -> f64| {
                let mut values: Vec<f64> = chain.edges.iter().map(|&e| of(e)).collect();
                median_in_place(&mut values)
            };
            let strong = chain
                .edges
                .iter()
                .filter(|&&e| self.bends.bend[e].abs() > limits.strong)
                .count();
            let strong = strong as f64 >= STRONG_SHARE * chain.edges.len() as f64;
            let clear = median(&|e| self.bends.bend[e].abs()) > least;
            let sharp = median(&|e| self.bends.share[e]) > MIN_SHARE;
            if !(self.is_exact(&chain) || strong && clear && sharp) {
                self.faint += 1;
                chain.edges.iter().for_each(|&e| self.on[e] = false);
            }
        }
        self.keep_long(limits, MIN_LENGTH);
    }

    /// Of all lines keeps those that are connected to enough length, somewhere strong.
    fn keep_long(&mut self, limits: &Limits, least: f64) {
        let on = std::mem::take(&mut self.on);
        // Noise does not raise the limit of an exact crease.
        let is_strong = |e: usize| {
            let least = if self.bends.exact[e] {
                limits.exact
            } else {
                limits.strong
            };
            self.bends.bend[e].abs() > least
        };
        self.on = self.surface.long_enough(on, least, is_strong);
    }
}

/// A chain as open parts that may be straightened: itself, or, if closed, from its highest vertex half round and back.
fn pieces<'a>(chain: &'a Chain, _height: &[f64]) -> Vec<&'a [u32]> {
    let v = &chain.vertices;
    if v.first() != v.last() {
        return vec![v];
    }
    let half = v.len() / 2;
    vec![&v[..=half], &v[half..]]
}

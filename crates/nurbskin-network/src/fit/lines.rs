//! The points on sharp and open lines, and the nearest places on the curves of their lines.

use super::network::Network;
use crate::layout::{EdgeKind, OnFace, OnLine};
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::each;
use std::collections::BTreeMap;

/// Samples per span of an edge from which a search begins. Count.
/// Trial: not recorded.
const PER_SPAN: usize = 12;
/// Newton steps after that. Count.
/// Guard: the start is within half a sample of the foot.
const STEPS: usize = 4;

/// Points on lines and where they lie.
#[derive(Clone, Debug, Default)]
pub(crate) struct LineSamples {
    pub(crate) points: Vec<DVec3>,
    /// The edge and the parameter of its foot.
    pub(crate) feet: Vec<(u32, f64)>,
    /// Distance from there.
    pub(crate) distances: Vec<f64>,
    /// Factors of the weight of a point on a line, 1 at first. Mends change those on borders.
    pub(crate) weights: Vec<f64>,
    /// The edges that a foot may be on.
    edges: Vec<u32>,
    ranges: Vec<[u32; 2]>,
}

impl LineSamples {
    /// The points on lines of a mesh, at their first places.
    pub(crate) fn new(network: &Network, points: &[DVec3], on_lines: &[OnLine]) -> Self {
        let mut by_line: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for (k, edge) in (0_u32..).zip(&network.edges) {
            if let Some(line) = edge.line {
                by_line.entry(line).or_default().push(k);
            }
        }
        let mut samples = Self::default();
        let mut range_of: BTreeMap<u32, [u32; 2]> = BTreeMap::new();
        for (line, edges) in by_line {
            let start = super::network::number(samples.edges.len());
            samples.edges.extend(edges);
            range_of.insert(line, [start, super::network::number(samples.edges.len())]);
        }
        for on in on_lines {
            let Some(&point) = points.get(on.vertex as usize) else {
                continue;
            };
            let Some(line) = network.edges.get(on.edge as usize).and_then(|e| e.line) else {
                continue;
            };
            let Some(&range) = range_of.get(&line) else {
                continue;
            };
            samples.points.push(point);
            samples.feet.push((on.edge, on.t));
            samples.distances.push(0.0);
            samples.weights.push(1.0);
            samples.ranges.push(range);
        }
        samples
    }

    /// For each point on a border its foot on the face, and its weight.
    pub(crate) fn on_borders(
        &mut self,
        network: &Network,
    ) -> impl Iterator<Item = (OnFace, &mut f64)> {
        let own = self.feet.iter().zip(&mut self.weights);
        own.filter_map(|(&(e, t), weight)| {
            let edge = &network.edges[e as usize];
            let used = edge.uses.first()?;
            (edge.kind == EdgeKind::Open).then(|| (used.place(t), weight))
        })
    }

    /// Moves the feet on open lines to the nearest places near them, and those beyond `limit` and on sharp lines to the nearest of all
    /// places of their lines. A foot on a border so keeps its place in the order of the line where the curve doubles back.
    /// O(points x spans of a line).
    pub(crate) fn project(&mut self, network: &Network, limit: f64) {
        // Samples of each edge, once.
        let curves: Vec<Vec<(f64, DVec3)>> = each(network.edges.len(), |k| {
            let edge = &network.edges[k];
            if edge.line.is_none() {
                return Vec::new();
            }
            let count = PER_SPAN * (edge.inner.len() + 1);
            (0..=count)
                .map(|i| i as f64 / count as f64)
                .map(|t| (t, network.on_edge(edge, t)[0]))
                .collect()
        });
        let found = each(self.points.len(), |k| {
            let [from, to] = self.ranges[k];
            let edges = &self.edges[from as usize..to as usize];
            let (point, foot) = (self.points[k], self.feet[k]);
            let open = network.edges[foot.0 as usize].kind == EdgeKind::Open;
            let near = open.then(|| near(network, edges, point, foot));
            if near.is_some_and(|near| near.2 <= limit) {
                return near;
            }
            let other = nearest_of(network, edges, &curves, point);
            match (near, other) {
                (Some(near), Some(other)) if near.2 <= other.2 => Some(near),
                (near, other) => other.or(near),
            }
        });
        for (k, foot) in found.into_iter().enumerate() {
            if let Some((edge, t, distance)) = foot {
                self.feet[k] = (edge, t);
                self.distances[k] = distance;
            }
        }
    }
}

/// The nearest place near a foot, on its edge or one that continues it.
fn near(network: &Network, edges: &[u32], point: DVec3, (e, t): (u32, f64)) -> (u32, f64, f64) {
    let first = on_edge(network, e, point, t);
    let end = match first.1 {
        t if t <= 0.0 => 0,
        t if t >= 1.0 => 1,
        _ => return first,
    };
    let vertex = network.edges[e as usize].ends[end];
    let mut best = first;
    for &other in edges.iter().filter(|&&other| other != e) {
        let ends = network.edges[other as usize].ends;
        for (end, start) in [(0, 0.0), (1, 1.0)] {
            if ends[end] == vertex {
                let found = on_edge(network, other, point, start);
                if found.2 < best.2 {
                    best = found;
                }
            }
        }
    }
    best
}

/// The nearest place on an edge near a parameter.
fn on_edge(network: &Network, e: u32, point: DVec3, start: f64) -> (u32, f64, f64) {
    let edge = &network.edges[e as usize];
    let mut t = start;
    let mut foot = (t, network.on_edge(edge, t)[0].distance(point));
    for _ in 0..STEPS {
        let [at, slope] = network.on_edge(edge, t);
        let squared = slope.length_squared();
        if squared <= 0.0 {
            break;
        }
        t = (t + (point - at).dot(slope) / squared).clamp(0.0, 1.0);
        let distance = network.on_edge(edge, t)[0].distance(point);
        if distance < foot.1 {
            foot = (t, distance);
        }
    }
    (e, foot.0, foot.1)
}

/// The nearest place on some edges.
fn nearest_of(
    network: &Network,
    edges: &[u32],
    curves: &[Vec<(f64, DVec3)>],
    point: DVec3,
) -> Option<(u32, f64, f64)> {
    let mut best: Option<(u32, f64, f64)> = None;
    for &e in edges {
        let near = curves[e as usize]
            .iter()
            .map(|&(t, at)| (t, at.distance_squared(point)));
        let Some((t, _)) = near.min_by(|a, b| a.1.total_cmp(&b.1)) else {
            continue;
        };
        let foot = on_edge(network, e, point, t);
        if best.is_none_or(|b| foot.2 < b.2) {
            best = Some(foot);
        }
    }
    best
}

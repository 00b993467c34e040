//! One face: a constrained Delaunay triangulation of its region.

use super::edges::EdgeCuts;
use super::metric::Metric;
use crate::Result;
use crate::cad::model::Face;
use crate::cad::region::{Cover, Region, scale_of};
use glam::DVec2;
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};
use std::collections::BTreeMap;

type Delaunay = ConstrainedDelaunayTriangulation<Point2<f64>>;

/// Rounds of points for triangles that miss too much.
const ROUNDS: usize = 40;

/// What is known of a face before its edges are cut.
pub(super) struct Plan<'a> {
    pub(super) face: &'a Face,
    pub(super) metric: Metric,
    /// Lines of points: parameters along u and along v.
    pub(super) lines: [Vec<f64>; 2],
    tolerance: f64,
}

/// The triangles of a face.
#[derive(Clone, Debug, Default)]
pub(super) struct FaceMesh {
    /// (u, v) of each vertex, and its number among the points of edges and vertices of the model, if it is one.
    pub(super) vertices: Vec<(DVec2, Option<usize>)>,
    /// Counter-clockwise in (u, v).
    pub(super) triangles: Vec<[usize; 3]>,
    /// Numbers of points that are at one place of the parameter plane.
    pub(super) same: Vec<[usize; 2]>,
    /// How far triangles may miss the surface.
    pub(super) bound: f64,
    /// Intervals of edges, (edge, number), that are too long for this face.
    pub(super) splits: Vec<(usize, usize)>,
    /// Pairs of vertices, the smaller first, that a loop joins; sorted.
    pub(super) borders: Vec<[usize; 2]>,
    /// Why there are no triangles.
    pub(super) fault: Option<String>,
    pub(super) too_many: bool,
}

impl FaceMesh {
    /// Whether a loop joins two vertices.
    pub(super) fn is_border(&self, a: usize, b: usize) -> bool {
        self.borders.binary_search(&[a.min(b), a.max(b)]).is_ok()
    }
}

/// A side of the polygon of a loop: the edge's interval, and how often it occurs.
#[derive(Clone, Copy)]
struct Side {
    interval: (usize, usize),
    times: u32,
}

impl<'a> Plan<'a> {
    pub(super) fn new(face: &'a Face, tolerance: f64) -> Result<Self> {
        let metric = Metric::new(&face.surface)?;
        let lines = metric.grid(0.98 * tolerance);
        Ok(Self {
            face,
            metric,
            lines,
            tolerance,
        })
    }

    /// The triangles with these cuts of the edges and with points at `extra` places.
    pub(super) fn mesh(&self, cuts: &EdgeCuts, extra: &[DVec2], limit: usize) -> FaceMesh {
        let mut work = Work::new(self);
        let done = work
            .borders(self, cuts)
            .and_then(|()| work.lines(self, limit))
            .and_then(|()| work.insert_all(extra))
            .and_then(|()| work.refine(self, limit));
        match done {
            Ok(()) => {}
            Err(Stop::TooMany) => work.mesh.too_many = true,
            Err(Stop::Split) => {}
            Err(Stop::Fault(text)) => work.mesh.fault = Some(text),
        }
        work.mesh.borders = work.sides.keys().copied().collect();
        work.mesh
    }
}

/// Why a triangulation is not finished.
enum Stop {
    TooMany,
    /// Edges have to be cut first.
    Split,
    Fault(String),
}

struct Work {
    delaunay: Delaunay,
    /// (u, v) = low + place / factor.
    low: DVec2,
    factor: DVec2,
    polygons: Vec<Vec<DVec2>>,
    /// By pairs of vertices, the smaller first.
    sides: BTreeMap<[usize; 2], Side>,
    mesh: FaceMesh,
}

impl Work {
    fn new(plan: &Plan) -> Self {
        let [(a, b), (c, d)] = plan.face.surface.domain();
        let scale = scale_of(&plan.face.surface);
        let size = DVec2::new(b - a, d - c) * scale;
        Self {
            delaunay: Delaunay::new(),
            low: DVec2::new(a, c),
            factor: scale / size.max_element(),
            polygons: Vec::new(),
            sides: BTreeMap::new(),
            mesh: FaceMesh::default(),
        }
    }

    fn scaled(&self, place: DVec2) -> DVec2 {
        (place - self.low) * self.factor
    }

    /// Adds a vertex; where there is one already, tells that.
    fn insert(&mut self, place: DVec2, number: Option<usize>) -> std::result::Result<usize, Stop> {
        let mut p = self.scaled(place);
        // The triangulation refuses numbers that underflow.
        for x in [&mut p.x, &mut p.y] {
            if x.abs() < 1e-30 {
                *x = 0.0;
            }
        }
        let handle = self.delaunay.insert(Point2::new(p.x, p.y));
        let Ok(handle) = handle else {
            return Err(Stop::Fault(
                "its loops leave the range of numbers".to_owned(),
            ));
        };
        let index = handle.index();
        match self.mesh.vertices.get(index) {
            None => self.mesh.vertices.push((place, number)),
            Some(&(_, Some(there))) => {
                if let Some(number) = number.filter(|&number| number != there) {
                    self.mesh.same.push([there, number]);
                }
            }
            Some(_) => {}
        }
        Ok(index)
    }

    fn insert_all(&mut self, places: &[DVec2]) -> std::result::Result<(), Stop> {
        places
            .iter()
            .try_for_each(|&place| self.insert(place, None).map(drop))
    }

    /// The polygons of the loops as constraints.
    fn borders(&mut self, plan: &Plan, cuts: &EdgeCuts) -> std::result::Result<(), Stop> {
        for each in &plan.face.loops {
            // Vertex and the interval that leads on from it.
            let mut ring: Vec<(usize, (usize, usize))> = Vec::new();
            let mut polygon = Vec::new();
            for used in &each.uses {
                let parameters = &cuts.cuts[used.edge].parameters;
                let last = parameters.len() - 1;
                for k in 0..last {
                    let (at, interval) = if used.reversed {
                        (last - k, last - k - 1)
                    } else {
                        (k, k)
                    };
                    let place = used.pcurve.point(parameters[at]).truncate();
                    let number = cuts.number(used.edge, at);
                    self.miss(plan, place, number, used.edge, at, cuts);
                    let vertex = self.insert(place, Some(number))?;
                    ring.push((vertex, (used.edge, interval)));
                    polygon.push(self.scaled(place));
                }
            }
            self.polygons.push(polygon);
            let next = ring.iter().cycle().skip(1);
            let pairs: Vec<_> = ring
                .iter()
                .zip(next)
                .map(|(a, b)| (a.0, b.0, a.1))
                .collect();
            for (a, b, interval) in pairs {
                self.constrain(a, b, interval)?;
            }
        }
        // A side that was led through another vertex is not a side.
        let whole = |pair: &[usize; 2]| {
            let [a, b] = pair.map(FixedVertexHandle::from_index);
            self.delaunay.exists_constraint(a, b)
        };
        let torn = self.sides.iter().filter(|(pair, _)| !whole(pair));
        self.mesh.splits.extend(torn.map(|(_, side)| side.interval));
        if self.mesh.splits.is_empty() {
            Ok(())
        } else {
            self.mesh.fault = Some("its loops touch or cross themselves or each other".to_owned());
            Err(Stop::Split)
        }
    }

    /// By how much a point of an edge is off the surface: triangles that use it are off as well.
    fn miss(
        &mut self,
        plan: &Plan,
        place: DVec2,
        number: usize,
        edge: usize,
        at: usize,
        cuts: &EdgeCuts,
    ) {
        let point = cuts.point(number, edge, at);
        let off = plan.face.surface.point(place.x, place.y).distance(point);
        self.mesh.bound = self.mesh.bound.max(off);
    }

    fn constrain(
        &mut self,
        a: usize,
        b: usize,
        interval: (usize, usize),
    ) -> std::result::Result<(), Stop> {
        if a == b {
            return Ok(());
        }
        let pair = [a.min(b), a.max(b)];
        if let Some(side) = self.sides.get_mut(&pair) {
            side.times += 1;
            return Ok(());
        }
        let [from, to] = [a, b].map(FixedVertexHandle::from_index);
        if !self.delaunay.can_add_constraint(from, to) {
            let crossed = self
                .delaunay
                .get_conflicting_edges_between_vertices(from, to);
            let mut crossed: Vec<[usize; 2]> = crossed
                .map(|edge| {
                    let [a, b] = [edge.from().index(), edge.to().index()];
                    [a.min(b), a.max(b)]
                })
                .collect();
            crossed.sort_unstable();
            let intervals = crossed.iter().filter_map(|pair| self.sides.get(pair));
            self.mesh.splits.extend(intervals.map(|side| side.interval));
            self.mesh.splits.push(interval);
            return Ok(());
        }
        self.delaunay.add_constraint(from, to);
        self.sides.insert(pair, Side { interval, times: 1 });
        Ok(())
    }

    /// Points at the crossings of the lines, where the region covers them and they keep off its border; creases become
    /// constraints.
    fn lines(&mut self, plan: &Plan, limit: usize) -> std::result::Result<(), Stop> {
        let Ok(region) = Region::from_polygons(&self.polygons, DVec2::ONE) else {
            return Err(Stop::Fault("it has no loop".to_owned()));
        };
        let [us, vs] = &plan.lines;
        if us.len().saturating_mul(vs.len()) > 2 * limit + 64 {
            return Err(Stop::TooMany);
        }
        let [low, high] = region.bounding_rectangle();
        // A third of the way to the next line, in the stretched plane.
        let gaps = |lines: &[f64], factor: f64| -> Vec<f64> {
            let gap = |k: usize| {
                let before = k.checked_sub(1).map(|j| lines[k] - lines[j]);
                let after = lines.get(k + 1).map(|next| next - lines[k]);
                let gap = before
                    .into_iter()
                    .chain(after)
                    .fold(f64::INFINITY, f64::min);
                0.3 * gap * factor
            };
            (0..lines.len()).map(gap).collect()
        };
        let (gaps_u, gaps_v) = (gaps(us, self.factor.x), gaps(vs, self.factor.y));
        for (&v, &gap_v) in vs.iter().zip(&gaps_v) {
            for (&u, &gap_u) in us.iter().zip(&gaps_u) {
                let place = DVec2::new(u, v);
                let p = self.scaled(place);
                if p.cmplt(low).any() || p.cmpgt(high).any() {
                    continue;
                }
                let free = DVec2::new(gap_u, gap_v);
                if region.cover(p - free, p + free) == Cover::Inside {
                    self.insert(place, None)?;
                }
            }
        }
        for axis in 0..2 {
            for &at in &plan.metric.creases[axis] {
                self.crease(&region, axis, at);
            }
        }
        Ok(())
    }

    /// Triangles must not bridge a crease: what lies on it is joined along it.
    fn crease(&mut self, region: &Region, axis: usize, at: f64) {
        let rounding = 1e-9 / self.factor[axis];
        let vertices = self.mesh.vertices.iter().enumerate();
        let mut on: Vec<(f64, usize)> = vertices
            .filter(|(_, (place, _))| (place[axis] - at).abs() <= rounding)
            .map(|(k, (place, _))| (place[1 - axis], k))
            .collect();
        on.sort_by(|x, y| x.0.total_cmp(&y.0));
        for pair in on.windows(2) {
            let [p, q] = [pair[0].1, pair[1].1].map(|k| self.scaled(self.mesh.vertices[k].0));
            let [from, to] = [pair[0].1, pair[1].1].map(FixedVertexHandle::from_index);
            if region.contains(p.midpoint(q)) && self.delaunay.can_add_constraint(from, to) {
                self.delaunay.add_constraint(from, to);
            }
        }
    }

    /// The triangles inside the loops: those that an odd number of sides separates from the outside.
    fn inside(&self) -> Vec<[usize; 3]> {
        const UNKNOWN: u8 = 2;
        let mut state = vec![UNKNOWN; self.delaunay.num_all_faces()];
        let outer = self.delaunay.outer_face();
        let mut stack = Vec::new();
        state[outer.index()] = 0;
        // The edges around the outer face, from outside.
        for edge in self.delaunay.convex_hull() {
            stack.push(edge.fix());
        }
        while let Some(edge) = stack.pop() {
            let edge = self.delaunay.directed_edge(edge);
            let (here, there) = (edge.face().index(), edge.rev().face().index());
            if state[there] != UNKNOWN {
                continue;
            }
            let [a, b] = [edge.from().index(), edge.to().index()];
            let side = if edge.is_constraint_edge() {
                self.sides.get(&[a.min(b), a.max(b)])
            } else {
                None
            };
            let odd = side.is_some_and(|side| side.times % 2 == 1);
            state[there] = state[here] ^ u8::from(odd);
            let back = edge.rev();
            stack.extend([back.next().fix(), back.prev().fix()]);
        }
        self.delaunay
            .inner_faces()
            .filter(|face| state[face.index()] == 1)
            .map(|face| face.vertices().map(|vertex| vertex.index()))
            .collect()
    }

    /// Points for triangles that miss too much, until none does.
    fn refine(&mut self, plan: &Plan, limit: usize) -> std::result::Result<(), Stop> {
        let moved = self.mesh.bound;
        let allowed = (plan.tolerance - moved).max(plan.tolerance / 2.0);
        for round in 0..=ROUNDS {
            let triangles = self.inside();
            let mut places = Vec::new();
            let mut bound = 0.0_f64;
            self.mesh.splits.clear();
            for triangle in &triangles {
                let corners = triangle.map(|k| self.mesh.vertices[k].0);
                let (miss, longest) = plan.metric.triangle(corners);
                bound = bound.max(miss);
                if miss <= allowed {
                    continue;
                }
                let [a, b] = [triangle[longest], triangle[(longest + 1) % 3]];
                match self.sides.get(&[a.min(b), a.max(b)]) {
                    Some(side) => self.mesh.splits.push(side.interval),
                    None => places.push([a.min(b), a.max(b)]),
                }
            }
            places.sort_unstable();
            places.dedup();
            self.mesh.triangles = triangles;
            self.mesh.bound = moved + bound;
            if places.is_empty() || round == ROUNDS {
                return Ok(());
            }
            if self.mesh.vertices.len() + places.len() > limit + 64 {
                return Err(Stop::TooMany);
            }
            for [a, b] in places {
                let middle = self.mesh.vertices[a].0.midpoint(self.mesh.vertices[b].0);
                self.insert(middle, None)?;
            }
        }
        Ok(())
    }
}

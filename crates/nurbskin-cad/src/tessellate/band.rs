//! The constrained Delaunay triangulation of what the plain cells of a face leave over: the band along its loops.

use super::cells::{Cells, Lines};
use super::edges::{EdgeCuts, Key};
use super::face::{FaceMesh, Plan};
use crate::region::Region;
use glam::{DVec2, DVec3};
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};
use std::collections::BTreeMap;

type Delaunay = ConstrainedDelaunayTriangulation<Point2<f64>>;

/// Rounds of points for triangles that miss too much.
const ROUNDS: usize = 40;

/// A side of the polygon of a loop: the edge's interval, and how often it occurs.
#[derive(Clone, Copy)]
struct Side {
    interval: (usize, usize),
    times: u32,
}

type Outcome<T = ()> = std::result::Result<T, Stop>;

impl Plan<'_> {
    /// The triangles beside the plain cells with these cuts of the edges and with points at `extra` places.
    pub(super) fn mesh(&self, cuts: &EdgeCuts, extra: &[DVec2], limit: usize) -> FaceMesh {
        let mut band = Band::new(self);
        let done = band
            .borders(self, cuts)
            .and_then(|()| band.cells(self, extra))
            .and_then(|()| {
                let mut places = extra.iter();
                places.try_for_each(|&place| band.insert(place, None).map(drop))
            })
            .and_then(|()| band.refine(self, limit));
        match done {
            Ok(()) => {}
            Err(Stop::TooMany) => band.mesh.too_many = true,
            Err(Stop::Split) => {}
            Err(Stop::Fault(text)) => band.mesh.fault = Some(text),
        }
        band.mesh.borders = band.sides.keys().copied().collect();
        band.mesh
    }
}

/// Why a triangulation is not finished.
enum Stop {
    TooMany,
    /// Edges have to be cut first.
    Split,
    Fault(String),
}

/// A triangulation in the making.
struct Band {
    delaunay: Delaunay,
    /// (u, v) = low + place / factor.
    low: DVec2,
    factor: DVec2,
    polygons: Vec<Vec<DVec2>>,
    /// By pairs of vertices, the smaller first.
    sides: BTreeMap<[usize; 2], Side>,
    /// The sides of plain cells that others are beside, by pairs of vertices, and the plain cell.
    fences: BTreeMap<[usize; 2], usize>,
    mesh: FaceMesh,
}

impl Band {
    fn new(plan: &Plan) -> Self {
        let [us, vs] = &plan.lines;
        let corner = |x: Option<&f64>, y: Option<&f64>| {
            DVec2::new(x.copied().unwrap_or(0.0), y.copied().unwrap_or(1.0))
        };
        let low = corner(us.first(), vs.first());
        let width = corner(us.last(), vs.last()) - low;
        // Cells of the lines are squares in the stretched plane: what is Delaunay there misses the surface least. Where
        // nothing bends, lengths count.
        let cells = plan.lines.each_ref().map(|lines| (lines.len() - 1) as f64);
        let scale = if cells[0] + cells[1] > 2.0 {
            DVec2::from(cells) / width
        } else {
            plan.scale
        };
        let size = width * scale;
        Self {
            delaunay: Delaunay::new(),
            low,
            factor: scale / size.max_element(),
            polygons: Vec::new(),
            sides: BTreeMap::new(),
            fences: BTreeMap::new(),
            mesh: FaceMesh::default(),
        }
    }

    fn scaled(&self, place: DVec2) -> DVec2 {
        (place - self.low) * self.factor
    }

    /// Adds a vertex; where there is one already, tells that.
    fn insert(&mut self, place: DVec2, number: Option<Key>) -> Outcome<usize> {
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

    /// The polygons of the loops as constraints.
    fn borders(&mut self, plan: &Plan, cuts: &EdgeCuts) -> Outcome {
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
                    let number = cuts.key(used.edge, at);
                    self.miss(plan, place, cuts.point(number));
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
    fn miss(&mut self, plan: &Plan, place: DVec2, point: DVec3) {
        let off = plan.face.surface.point(place.x, place.y).distance(point);
        self.mesh.bound = self.mesh.bound.max(off);
    }

    fn constrain(&mut self, a: usize, b: usize, interval: (usize, usize)) -> Outcome {
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

    /// The plain cells are fenced in, and what is beside them gets points at the crossings of the lines, where these keep
    /// off the loops; creases become constraints.
    fn cells(&mut self, plan: &Plan, extra: &[DVec2]) -> Outcome {
        let Ok(region) = Region::from_polygons(&self.polygons, DVec2::ONE) else {
            return Err(Stop::Fault("it has no loop".to_owned()));
        };
        let lines = Lines {
            given: &plan.lines,
            scaled: [0, 1].map(|axis| {
                let scaled = |&t: &f64| (t - self.low[axis]) * self.factor[axis];
                plan.lines[axis].iter().map(scaled).collect()
            }),
        };
        let (cells, nodes) = Cells::new(
            &lines,
            &self.polygons,
            &region,
            &plan.metric,
            0.99 * plan.tolerance,
            extra,
        );
        self.mesh.cells = cells;
        for node in nodes {
            self.node(plan, node)?;
        }
        let plain: Vec<usize> = self.mesh.cells.plain().collect();
        for cell in plain {
            if !self.mesh.cells.is_surrounded(cell) {
                self.fence(plan, cell, false)?;
            }
        }
        for axis in 0..2 {
            for &at in &plan.metric.creases[axis] {
                self.crease(&region, axis, at);
            }
        }
        Ok(())
    }

    /// The vertex at a crossing of the lines.
    fn node(&mut self, plan: &Plan, node: usize) -> Outcome<usize> {
        if let Some(&vertex) = self.mesh.nodes.get(&node) {
            return Ok(vertex);
        }
        let [i, j] = self.mesh.cells.place(node);
        let vertex = self.insert(DVec2::new(plan.lines[0][i], plan.lines[1][j]), None)?;
        self.mesh.nodes.insert(node, vertex);
        Ok(vertex)
    }

    /// Fences between a cell and those of its neighbours that are not plain, if it is plain itself; else between it and
    /// those that are, and none any more to the others.
    fn fence(&mut self, plan: &Plan, cell: usize, released: bool) -> Outcome {
        let (corners, beyond) = (self.mesh.cells.corners(cell), self.mesh.cells.beyond(cell));
        for k in 0..4 {
            let plain = self.mesh.cells.is_plain(beyond[k]);
            if plain && !released {
                continue;
            }
            let a = self.node(plan, corners[k])?;
            let b = self.node(plan, corners[(k + 1) % 4])?;
            let pair = [a.min(b), a.max(b)];
            if released && !plain {
                // The constraint may stay.
                self.fences.remove(&pair);
                continue;
            }
            let [from, to] = pair.map(FixedVertexHandle::from_index);
            if self.delaunay.can_add_constraint(from, to) {
                self.delaunay.add_constraint(from, to);
            }
            if !self.delaunay.exists_constraint(from, to) {
                return Err(Stop::Fault(
                    "its loops cannot be told from its parameter lines".to_owned(),
                ));
            }
            self.fences
                .insert(pair, beyond[k].filter(|_| released).unwrap_or(cell));
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
            let odd = side.is_some_and(|side| side.times % 2 == 1)
                || edge.is_constraint_edge() && self.fences.contains_key(&[a.min(b), a.max(b)]);
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
    fn refine(&mut self, plan: &Plan, limit: usize) -> Outcome {
        let moved = self.mesh.bound + plan.metric.slack;
        let cells = self.mesh.cells.bound + plan.metric.slack;
        let allowed = (plan.tolerance - moved).max(plan.tolerance / 2.0);
        for round in 0..=ROUNDS {
            let triangles = self.inside();
            let (mut places, mut released) = (Vec::new(), Vec::new());
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
                let pair = [a.min(b), a.max(b)];
                if let Some(side) = self.sides.get(&pair) {
                    self.mesh.splits.push(side.interval);
                } else if let Some(&cell) = self.fences.get(&pair) {
                    released.push(cell);
                } else {
                    places.push(pair);
                }
            }
            places.sort_unstable();
            places.dedup();
            self.mesh.triangles = triangles;
            self.mesh.bound = cells.max(moved + bound);
            if places.is_empty() && released.is_empty() || round == ROUNDS {
                return Ok(());
            }
            if self.mesh.vertices.len() + places.len() > limit + 64 {
                return Err(Stop::TooMany);
            }
            released.sort_unstable();
            released.dedup();
            for cell in released {
                self.mesh.cells.release(cell);
                self.fence(plan, cell, true)?;
            }
            for [a, b] in places {
                let middle = self.mesh.vertices[a].0.midpoint(self.mesh.vertices[b].0);
                self.insert(middle, None)?;
            }
        }
        Ok(())
    }
}

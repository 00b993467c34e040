//! A network of bicubic B-spline faces that share their edge curves, and its unknowns.
//!
//! Unknowns x: the vertices; the inner control points of each edge, on knots of its own; the inner control points of each
//! face. The rim of a face's control net is the knot insertion of the curves of its four edges, so that all control points
//! of a face are P = M x with a constant sparse matrix M, and neighbours meet exactly whatever their knots. A knot added to
//! a face ends at its edges: refinement never runs through the layout.
//!
//! Inner knots are dyadic, so that unions of knots and t -> 1 - t are exact.
//!
//! Source: ours; design of spline spaces with hanging knots as in T-splines (Sederberg et al. 2003), without T-junctions.

use super::insertion::insertion;
use super::patch::Patch;
use crate::layout::{EdgeKind, Layout, OnFace, SIDE_CORNERS, Side};
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::nurbs::KnotVector;
use nurbskin_geometry::nurbs::basis::basis_derivatives;
use nurbskin_geometry::{Error, Result};

/// Degree of all faces and edges.
/// Source: bicubics with simple knots reach jumps of 0.05 degrees (docs/network.md); CAD systems expect them.
pub const DEGREE: usize = 3;
/// Basis functions that do not vanish at a parameter.
pub(crate) const WIDTH: usize = DEGREE + 1;

/// An edge of a network.
#[derive(Clone, Debug)]
pub(crate) struct Edge {
    /// The vertices at t = 0 and t = 1.
    pub(crate) ends: [u32; 2],
    /// What the surface does here.
    pub(crate) kind: EdgeKind,
    /// The line it is a piece of.
    pub(crate) line: Option<u32>,
    /// Inner knots, ascending.
    pub(crate) inner: Vec<f64>,
    /// Knot vector.
    pub(crate) knots: KnotVector,
    /// The one or two faces beside it.
    pub(crate) uses: Vec<EdgeUse>,
    /// Its first unknown.
    pub(crate) first: u32,
}

/// An edge as a side of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct EdgeUse {
    /// Index of the face.
    pub(crate) face: u32,
    /// Number of the side: v = 0, u = 1, v = 1, u = 0.
    pub(crate) side: u8,
    /// Whether the parameter of the side is 1 - t.
    pub(crate) reversed: bool,
}

impl EdgeUse {
    /// (u, v) of the face at the parameter t of the edge.
    pub(crate) fn place(&self, t: f64) -> OnFace {
        let s = if self.reversed { 1.0 - t } else { t };
        let (u, v) = match self.side {
            0 => (s, 0.0),
            1 => (1.0, s),
            2 => (s, 1.0),
            _ => (0.0, s),
        };
        OnFace {
            face: self.face,
            u,
            v,
        }
    }
    /// Whether the edge runs along u.
    pub(crate) fn along_u(&self) -> bool {
        self.side.is_multiple_of(2)
    }
    /// The sign that turns the derivative across the side inwards.
    pub(crate) fn inward(&self) -> f64 {
        if self.side == 0 || self.side == 3 {
            1.0
        } else {
            -1.0
        }
    }
    /// The sign that turns the derivative along the side into that by t.
    pub(crate) fn forward(&self) -> f64 {
        if self.reversed { -1.0 } else { 1.0 }
    }
}

/// Square of the ratio of a point's distance from its foot on an open side to that along the normal, above which it lies beyond.
/// Dimensionless. Trial: 2, 3, 5 and 10 on a vessel with five openings, whose largest jump is 0.31, 0.31, 0.10 and 0.11 degrees, and
/// on two range images at three tolerances, of whose six networks 5, 3, 4 and 5 pass.
const BEYOND: f64 = 10.0;

/// A face of a network.
#[derive(Clone, Debug)]
pub(crate) struct Face {
    /// Vertices at (0, 0), (1, 0), (1, 1), (0, 1).
    pub(crate) corners: [u32; 4],
    /// Sides v = 0, u = 1, v = 1, u = 0.
    pub(crate) sides: [Side; 4],
    /// Inner knots along u and v, ascending; they hold those of the edges.
    pub(crate) inner: [Vec<f64>; 2],
    /// Knot vectors along u and v.
    pub(crate) knots: [KnotVector; 2],
    /// Its first unknown.
    pub(crate) first: u32,
    /// M: the unknowns that each control point is made of, u fastest.
    pub(crate) rows: Rows,
    /// The control points P = M x, u fastest.
    pub(crate) net: Vec<DVec3>,
}

impl Face {
    /// Numbers of control points along u and v.
    pub(crate) fn counts(&self) -> [usize; 2] {
        [0, 1].map(|d| self.inner[d].len() + WIDTH)
    }
    /// Which sides are open.
    pub(crate) fn open(&self, edges: &[Edge]) -> [bool; 4] {
        self.sides
            .map(|side| edges[side.edge as usize].kind == EdgeKind::Open)
    }
    /// Whether a point whose nearest place is (u, v) lies beyond an open side, much farther along the surface than across it. It
    /// carries no information on the surface there.
    pub(crate) fn is_beyond(&self, open: [bool; 4], [u, v]: [f64; 2], point: DVec3) -> bool {
        let at = [v <= 0.0, u >= 1.0, v >= 1.0, u <= 0.0];
        if !(0..4).any(|k| open[k] && at[k]) {
            return false;
        }
        let jet = self.patch().tangents(u, v);
        let away = point - jet.point;
        let normal = jet.normal();
        // Without a normal there is no direction across.
        normal != DVec3::ZERO && BEYOND * away.dot(normal).powi(2) < away.length_squared()
    }
    /// The face as a surface to evaluate.
    pub(crate) fn patch(&self) -> Patch<'_> {
        Patch::new(&self.knots[0], &self.knots[1], &self.net)
    }
}

/// Sparse rows: for each the columns and weights.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
    start: Vec<u32>,
    entries: Vec<(u32, f64)>,
}

impl Rows {
    /// A row.
    pub(crate) fn of(&self, row: usize) -> &[(u32, f64)] {
        &self.entries[self.start[row] as usize..self.start[row + 1] as usize]
    }
    fn push(&mut self, row: impl IntoIterator<Item = (u32, f64)>) {
        if self.start.is_empty() {
            self.start.push(0);
        }
        self.entries.extend(row.into_iter().filter(|e| e.1 != 0.0));
        self.start.push(number(self.entries.len()));
    }
}

/// A count as an index.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a network has fewer than 2^32 unknowns"
)]
pub(crate) fn number(count: usize) -> u32 {
    count as u32
}

/// A network of faces with shared edges.
#[derive(Clone, Debug)]
pub(crate) struct Network {
    pub(crate) vertices: usize,
    pub(crate) edges: Vec<Edge>,
    pub(crate) faces: Vec<Face>,
    /// The unknowns: vertices, edges, faces.
    pub(crate) x: Vec<DVec3>,
}

/// Inner knots run the other way.
fn turned(inner: &[f64]) -> Vec<f64> {
    inner.iter().rev().map(|t| 1.0 - t).collect()
}

/// Two ascending lists as one, without repeats.
fn union(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut all: Vec<f64> = a.iter().chain(b).copied().collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// The clamped knots over \[0, 1\] with these inner ones.
fn clamped(inner: &[f64]) -> Result<KnotVector> {
    let breaks: Vec<f64> = std::iter::once(0.0)
        .chain(inner.iter().copied())
        .chain([1.0])
        .collect();
    KnotVector::clamped(DEGREE, &breaks)
}

impl Network {
    /// The network over a layout, with the same inner knots on all edges and faces and all unknowns at the origin.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a side names an edge or a corner that does not exist.
    pub(crate) fn new(layout: &Layout, inner: &[f64]) -> Result<Self> {
        let knots = clamped(inner)?;
        let mut edges: Vec<Edge> = layout
            .edges
            .iter()
            .map(|e| Edge {
                ends: e.ends,
                kind: e.kind,
                line: e.line,
                inner: inner.to_vec(),
                knots: knots.clone(),
                uses: Vec::new(),
                first: 0,
            })
            .collect();
        for (f, face) in layout.faces.iter().enumerate() {
            for (k, side) in face.sides.iter().enumerate() {
                let ends = SIDE_CORNERS[k].map(|c| face.corners[c]);
                let edge = edges.get_mut(side.edge as usize);
                let edge = edge.ok_or_else(|| {
                    Error::invalid("a face of a layout names an edge that does not exist")
                })?;
                let expected = if side.reversed {
                    [ends[1], ends[0]]
                } else {
                    ends
                };
                if edge.ends != expected
                    || ends.iter().any(|&v| v as usize >= layout.vertices.len())
                {
                    return Err(Error::invalid(
                        "a side of a layout ends elsewhere than its edge",
                    ));
                }
                #[expect(clippy::cast_possible_truncation, reason = "0 to 3")]
                edge.uses.push(EdgeUse {
                    face: number(f),
                    side: k as u8,
                    reversed: side.reversed,
                });
            }
        }
        let faces = layout
            .faces
            .iter()
            .map(|face| Face {
                corners: face.corners,
                sides: face.sides,
                inner: [inner.to_vec(), inner.to_vec()],
                knots: [knots.clone(), knots.clone()],
                first: 0,
                rows: Rows::default(),
                net: Vec::new(),
            })
            .collect();
        let mut network = Self {
            vertices: layout.vertices.len(),
            edges,
            faces,
            x: Vec::new(),
        };
        network.renumber()?;
        network.set_bilinear(&layout.vertices);
        Ok(network)
    }

    /// Straight edges and bilinear faces between vertices.
    fn set_bilinear(&mut self, vertices: &[DVec3]) {
        let mut x = vertices.to_vec();
        for edge in &self.edges {
            let [a, b] = edge.ends.map(|v| vertices[v as usize]);
            let at = edge.knots.greville();
            x.extend(at[1..at.len() - 1].iter().map(|&t| a.lerp(b, t)));
        }
        for face in &self.faces {
            let [a, b, c, d] = face.corners.map(|v| vertices[v as usize]);
            let [us, vs] = [0, 1].map(|k| face.knots[k].greville());
            for &v in &vs[1..vs.len() - 1] {
                x.extend(
                    us[1..us.len() - 1]
                        .iter()
                        .map(|&u| a.lerp(b, u).lerp(d.lerp(c, u), v)),
                );
            }
        }
        self.x = x;
        self.update_nets();
    }

    /// Number of unknowns.
    pub(crate) fn unknowns(&self) -> usize {
        let edges: usize = self.edges.iter().map(|e| e.inner.len() + WIDTH - 2).sum();
        let faces: usize = self
            .faces
            .iter()
            .map(|f| f.counts().map(|n| n - 2).iter().product::<usize>())
            .sum();
        self.vertices + edges + faces
    }

    /// Number of control points of all faces, those on shared rims counted for each face.
    pub(crate) fn control_points(&self) -> usize {
        self.faces
            .iter()
            .map(|f| f.counts().iter().product::<usize>())
            .sum()
    }

    /// Numbers the unknowns and makes the matrices anew, after knots were added; faces first get the knots of their
    /// edges.
    fn renumber(&mut self) -> Result<()> {
        let mut next = number(self.vertices);
        for edge in &mut self.edges {
            edge.first = next;
            edge.knots = clamped(&edge.inner)?;
            next += number(edge.inner.len() + WIDTH - 2);
        }
        for k in 0..self.faces.len() {
            for side in 0..4 {
                let Side { edge, reversed } = self.faces[k].sides[side];
                let inner = &self.edges[edge as usize].inner;
                let inner = if reversed {
                    turned(inner)
                } else {
                    inner.clone()
                };
                let own = &mut self.faces[k].inner[side % 2];
                *own = union(own, &inner);
            }
            let face = &mut self.faces[k];
            face.knots = [clamped(&face.inner[0])?, clamped(&face.inner[1])?];
            face.first = next;
            let [nu, nv] = face.counts();
            next += number((nu - 2) * (nv - 2));
        }
        let rows = each(self.faces.len(), |k| self.rows_of(&self.faces[k]));
        for (face, rows) in self.faces.iter_mut().zip(rows) {
            face.rows = rows?;
        }
        Ok(())
    }

    /// The unknown of control point `k` of an edge, counted from its start.
    pub(crate) fn unknown_of_edge(edge: &Edge, k: usize) -> u32 {
        let last = edge.inner.len() + WIDTH - 1;
        match k {
            0 => edge.ends[0],
            k if k == last => edge.ends[1],
            k => edge.first + number(k) - 1,
        }
    }

    /// M for one face.
    fn rows_of(&self, face: &Face) -> Result<Rows> {
        let [nu, nv] = face.counts();
        // The control points of the four sides in unknowns.
        let mut sides: [Vec<Vec<(u32, f64)>>; 4] = Default::default();
        for (k, side) in sides.iter_mut().enumerate() {
            let Side { edge, reversed } = face.sides[k];
            let edge = &self.edges[edge as usize];
            let inner = if reversed {
                turned(&edge.inner)
            } else {
                edge.inner.clone()
            };
            let matrix = insertion(&clamped(&inner)?, &face.knots[k % 2]);
            let count = edge.inner.len() + WIDTH;
            *side = matrix
                .first
                .iter()
                .zip(&matrix.weights)
                .map(|(&first, weights)| {
                    (0..WIDTH)
                        .map(|j| {
                            let at = first + j;
                            let at = if reversed { count - 1 - at } else { at };
                            (Self::unknown_of_edge(edge, at), weights[j])
                        })
                        .collect()
                })
                .collect();
        }
        let mut rows = Rows::default();
        for j in 0..nv {
            for i in 0..nu {
                match (i, j) {
                    (i, 0) => rows.push(sides[0][i].iter().copied()),
                    (i, j) if j == nv - 1 => rows.push(sides[2][i].iter().copied()),
                    (0, j) => rows.push(sides[3][j].iter().copied()),
                    (i, j) if i == nu - 1 => rows.push(sides[1][j].iter().copied()),
                    (i, j) => rows.push([(face.first + number((j - 1) * (nu - 2) + i - 1), 1.0)]),
                }
            }
        }
        Ok(rows)
    }

    /// Computes the control points of all faces from the unknowns.
    pub(crate) fn update_nets(&mut self) {
        let x = &self.x;
        let nets = each(self.faces.len(), |k| {
            let face = &self.faces[k];
            let [nu, nv] = face.counts();
            let point = |row| {
                face.rows
                    .of(row)
                    .iter()
                    .map(|&(at, w)| w * x[at as usize])
                    .sum()
            };
            (0..nu * nv).map(point).collect::<Vec<DVec3>>()
        });
        for (face, net) in self.faces.iter_mut().zip(nets) {
            face.net = net;
        }
    }

    /// The basis of an edge's curve at t: unknowns and the values of their functions and first derivatives.
    pub(crate) fn edge_basis(edge: &Edge, t: f64) -> [(u32, [f64; 2]); WIDTH] {
        let span = edge.knots.span(t);
        let mut values = [0.0; 2 * WIDTH];
        basis_derivatives(&edge.knots, span, t, 1, &mut values);
        std::array::from_fn(|k| {
            (
                Self::unknown_of_edge(edge, span - DEGREE + k),
                [values[k], values[WIDTH + k]],
            )
        })
    }

    /// The point of an edge at t, and its derivative.
    pub(crate) fn on_edge(&self, edge: &Edge, t: f64) -> [DVec3; 2] {
        let mut at = [DVec3::ZERO; 2];
        for (k, [value, slope]) in Self::edge_basis(edge, t) {
            at[0] += value * self.x[k as usize];
            at[1] += slope * self.x[k as usize];
        }
        at
    }

    /// The control points of an edge.
    pub(crate) fn curve_points(&self, edge: &Edge) -> Vec<DVec3> {
        (0..edge.inner.len() + WIDTH)
            .map(|k| self.x[Self::unknown_of_edge(edge, k) as usize])
            .collect()
    }

    /// Adds knots; the surface stays the same. `edges` and `faces` list (index, knot) and (index, direction, knot).
    ///
    /// # Errors
    /// As for knot vectors; never for knots inside (0, 1).
    pub(crate) fn add_knots(
        &mut self,
        edges: &[(usize, f64)],
        faces: &[(usize, usize, f64)],
    ) -> Result<()> {
        let before = self.clone();
        for &(edge, t) in edges {
            let inner = &mut self.edges[edge].inner;
            *inner = union(inner, &[t]);
        }
        for &(face, direction, t) in faces {
            let inner = &mut self.faces[face].inner[direction];
            *inner = union(inner, &[t]);
        }
        self.renumber()?;
        self.prolong(&before)
    }

    /// The unknowns of the same surface as `before`, on the knots of `self`, which hold those of `before`.
    fn prolong(&mut self, before: &Self) -> Result<()> {
        let mut x = vec![DVec3::ZERO; self.unknowns()];
        x[..self.vertices].copy_from_slice(&before.x[..self.vertices]);
        for (new, old) in self.edges.iter().zip(&before.edges) {
            let matrix = insertion(&old.knots, &new.knots);
            let points = matrix.apply(&before.curve_points(old));
            let own = points.len() - 2;
            x[new.first as usize..][..own].copy_from_slice(&points[1..=own]);
        }
        for (new, old) in self.faces.iter().zip(&before.faces) {
            let [nu, nv] = new.counts();
            let along = [0, 1].map(|d| insertion(&old.knots[d], &new.knots[d]));
            let [mu, mv] = old.counts();
            let strips: Vec<Vec<DVec3>> = (0..mv)
                .map(|j| along[0].apply(&old.net[j * mu..(j + 1) * mu]))
                .collect();
            for i in 1..nu - 1 {
                let column: Vec<DVec3> = strips.iter().map(|row| row[i]).collect();
                for (j, point) in along[1]
                    .apply(&column)
                    .into_iter()
                    .enumerate()
                    .skip(1)
                    .take(nv - 2)
                {
                    x[new.first as usize + (j - 1) * (nu - 2) + i - 1] = point;
                }
            }
        }
        self.x = x;
        self.update_nets();
        Ok(())
    }

    /// Break points of a face along a direction: 0, its inner knots, 1.
    pub(crate) fn breaks(inner: &[f64]) -> Vec<f64> {
        std::iter::once(0.0)
            .chain(inner.iter().copied())
            .chain([1.0])
            .collect()
    }

    /// Break points of an edge that count for both faces beside it, by the parameter of the edge.
    pub(crate) fn common_breaks(&self, edge: &Edge) -> Vec<f64> {
        let mut inner = edge.inner.clone();
        for used in &edge.uses {
            let own = &self.faces[used.face as usize].inner[usize::from(!used.along_u())];
            inner = union(
                &inner,
                &if used.reversed {
                    turned(own)
                } else {
                    own.clone()
                },
            );
        }
        Self::breaks(&inner)
    }

    /// Straight distance of the ends of each edge, at least `least`.
    pub(crate) fn chords(&self, least: f64) -> Vec<f64> {
        let chord = |e: &Edge| self.x[e.ends[0] as usize].distance(self.x[e.ends[1] as usize]);
        self.edges.iter().map(|e| chord(e).max(least)).collect()
    }

    /// Mean length of a face along u and v, from its corners.
    pub(crate) fn lengths(&self, face: &Face, chords: &[f64]) -> [f64; 2] {
        let side = |k: usize| chords[face.sides[k].edge as usize];
        [
            f64::midpoint(side(0), side(2)),
            f64::midpoint(side(1), side(3)),
        ]
    }
}

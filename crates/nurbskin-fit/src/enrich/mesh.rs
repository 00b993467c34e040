//! Catmull-Clark subdivision of polygon meshes of any valence, with boundaries and corners.
//!
//! With the mean f of a face, an edge between a and b and a vertex v of valence k, one step makes
//!
//! ```text
//! face f,   edge (a + b + f_1 + f_2) / 4,   vertex (k - 2)/k v + 1/k² sum v_i + 1/k² sum f_i
//! ```
//!
//! Boundaries follow the cubic curve rules; a boundary vertex of a single face is a corner and stays. The limit of a
//! vertex is (k², 4, 1) / (k (k + 5)).
//!
//! Sources: Catmull and Clark 1978; Pal and Ballav 2007, eq. (12); limits by Halstead, Kass and `DeRose` 1993; boundary
//! edges by Biermann, Levin and Zorin 2000.

use super::check_size;
use crate::chart::Topology;
use glam::DVec3;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use nurbskin_geometry::{Error, PointGrid, Result};

/// Face beyond a boundary edge. Derived: the largest index, which no face of a mesh has.
const NO_FACE: usize = usize::MAX;

/// A mesh of polygons: a consistently oriented manifold with or without boundary.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_fit::enrich::PolygonMesh;
/// let corners = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]].map(DVec3::from);
/// let square = PolygonMesh::new(corners.to_vec(), &[[0, 1, 2, 3]])?;
/// let finer = square.subdivided()?;
/// assert_eq!((finer.points().len(), finer.face_count()), (9, 4));
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct PolygonMesh {
    points: Vec<DVec3>,
    /// Where each face begins in `corners`, and the end of the last one.
    starts: Vec<usize>,
    /// The point indices of all faces, one face after the other.
    corners: Vec<usize>,
    /// The edge from each corner to the next one of its face.
    corner_edges: Vec<usize>,
    edges: Vec<Edge>,
    vertices: Vec<Vertex>,
}

/// An edge with its end points and the one or two faces beside it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    pub(super) ends: [usize; 2],
    faces: [usize; 2],
}

impl Edge {
    fn is_boundary(self) -> bool {
        self.faces[1] == NO_FACE
    }
}

/// The neighbourhood of a point, as far as the masks depend on it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Vertex {
    /// Number of faces around the point; of an inner point this is its valence.
    pub(super) faces: usize,
    /// The neighbours along the boundary of a boundary point.
    pub(super) boundary: Option<[usize; 2]>,
}

impl Vertex {
    /// A corner, a boundary point of a single face, stays where it is.
    pub(super) fn is_corner(&self) -> bool {
        self.boundary.is_some() && self.faces == 1
    }
}

impl PolygonMesh {
    /// A mesh from its points and, per face, the indices of its corners in order.
    ///
    /// # Errors
    /// [`Error::Invalid`], naming the place, if a point is not finite or belongs to no face; if a face has fewer than
    /// three corners, the same corner twice, or one that does not exist; if an edge has more than two faces or two of
    /// opposite orientation; or if faces meet in a point only.
    pub fn new<F: AsRef<[usize]>>(points: Vec<DVec3>, faces: &[F]) -> Result<Self> {
        let mut starts = vec![0];
        let mut corners = Vec::new();
        for (f, face) in faces.iter().enumerate() {
            let face = face.as_ref();
            if face.len() < 3 {
                return Err(Error::invalid(format!(
                    "face {f} has {} corners: a face needs at least 3",
                    face.len()
                )));
            }
            let mut sorted = face.to_vec();
            sorted.sort_unstable();
            if let Some(pair) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
                return Err(Error::invalid(format!(
                    "face {f} has point {} twice: remove or split the face",
                    pair[0]
                )));
            }
            if sorted[sorted.len() - 1] >= points.len() {
                return Err(Error::invalid(format!(
                    "face {f} has point {}, but there are only {} points",
                    sorted[sorted.len() - 1],
                    points.len()
                )));
            }
            corners.extend_from_slice(face);
            starts.push(corners.len());
        }
        Self::from_corners(points, starts, corners)
    }

    fn from_corners(points: Vec<DVec3>, starts: Vec<usize>, corners: Vec<usize>) -> Result<Self> {
        if let Some(k) = points.iter().position(|p| !p.is_finite()) {
            return Err(Error::invalid(format!(
                "point {k} of the mesh is not finite"
            )));
        }
        let mut mesh = Self {
            vertices: vec![Vertex::default(); points.len()],
            corner_edges: vec![0; corners.len()],
            edges: Vec::new(),
            points,
            starts,
            corners,
        };
        mesh.connect()?;
        Ok(mesh)
    }

    /// Finds edges and boundaries, and refuses meshes that are no oriented manifold.
    fn connect(&mut self) -> Result<()> {
        let mut sides = Vec::with_capacity(self.corners.len());
        for f in 0..self.face_count() {
            for corner in self.starts[f]..self.starts[f + 1] {
                let (a, b) = (self.corners[corner], self.corners[self.next(f, corner)]);
                sides.push((a.min(b), a.max(b), corner, f));
                self.vertices[a].faces += 1;
            }
        }
        sides.sort_unstable();
        let mut fans = DisjointSets::new(self.corners.len());
        for group in sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            let (a, b, corner, face) = group[0];
            let other = match *group {
                [_] => NO_FACE,
                [_, (.., second, other)] => {
                    if self.corners[corner] == self.corners[second] {
                        return Err(Error::invalid(format!(
                            "faces {face} and {other} run along the edge of points {a} and {b} in the same direction: orient them alike"
                        )));
                    }
                    fans.join(corner, self.next(other, second));
                    fans.join(self.next(face, corner), second);
                    other
                }
                _ => {
                    return Err(Error::invalid(format!(
                        "the edge of points {a} and {b} has {} faces, not one or two: split the mesh there",
                        group.len()
                    )));
                }
            };
            if other == NO_FACE {
                for (end, neighbour) in [(a, b), (b, a)] {
                    let boundary = self.vertices[end].boundary.get_or_insert([neighbour; 2]);
                    boundary[1] = neighbour;
                }
            }
            for &(_, _, corner, _) in group {
                self.corner_edges[corner] = self.edges.len();
            }
            self.edges.push(Edge {
                ends: [a, b],
                faces: [face, other],
            });
        }
        let mut fan_of = vec![NO_FACE; self.points.len()];
        for corner in 0..self.corners.len() {
            let (point, fan) = (self.corners[corner], fans.root(corner));
            if fan_of[point] != NO_FACE && fan_of[point] != fan {
                return Err(Error::invalid(format!(
                    "faces that share no edge meet at point {point}: give each group of faces a point of its own"
                )));
            }
            fan_of[point] = fan;
        }
        match fan_of.iter().position(|&fan| fan == NO_FACE) {
            Some(point) => Err(Error::invalid(format!(
                "point {point} belongs to no face: remove it"
            ))),
            None => Ok(()),
        }
    }

    /// The quads between the points of an ordered grid, closed as `topology` says. At the poles of a sphere the points
    /// of the end line become one and its quads triangles. Except for poles, points keep their order.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a direction has fewer than 2 lines, or 3 where it is closed.
    pub fn from_grid(grid: &PointGrid, topology: Topology) -> Result<Self> {
        let [m, n] = grid.counts();
        let closed = topology.closed();
        if m < 2 || n < 2 || (closed[0] && m < 3) || (closed[1] && n < 3) {
            return Err(Error::invalid(format!(
                "a {m} x {n} grid has too few lines for a mesh: at least 2 are needed, 3 where it is closed"
            )));
        }
        let sphere = topology == Topology::Sphere;
        let mut points = Vec::with_capacity(m * n);
        let mut index = vec![0; m * n];
        for j in 0..n {
            for i in 0..m {
                let first_of_pole = sphere && (i == 0 || i == m - 1) && j > 0;
                index[j * m + i] = if first_of_pole {
                    index[i]
                } else {
                    points.len()
                };
                if !first_of_pole {
                    points.push(grid.point(i, j));
                }
            }
        }
        let mut faces = Vec::new();
        for j in 0..if closed[1] { n } else { n - 1 } {
            for i in 0..if closed[0] { m } else { m - 1 } {
                let at = |i: usize, j: usize| index[(j % n) * m + i % m];
                let mut face = vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                face.dedup();
                if face.len() > 3 && face[0] == face[3] {
                    face.pop();
                }
                faces.push(face);
            }
        }
        Self::new(points, &faces)
    }

    /// The points.
    #[must_use]
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }
    /// Number of faces.
    #[must_use]
    pub fn face_count(&self) -> usize {
        self.starts.len() - 1
    }
    /// Number of edges.
    #[must_use]
    pub fn edge_count(&self) -> usize {
        self.edges.len()
    }
    /// The point indices of each face in order.
    pub fn faces(&self) -> impl ExactSizeIterator<Item = &[usize]> {
        self.starts.windows(2).map(|w| &self.corners[w[0]..w[1]])
    }
    /// Number of faces around a point, for an inner point its valence; `None` where the point does not exist.
    #[must_use]
    pub fn valence(&self, point: usize) -> Option<usize> {
        self.vertices.get(point).map(|vertex| vertex.faces)
    }
    /// Whether a point lies on the boundary.
    #[must_use]
    pub fn is_boundary(&self, point: usize) -> bool {
        self.vertices
            .get(point)
            .is_some_and(|vertex| vertex.boundary.is_some())
    }
    /// The same faces with other points.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the number of points changes or one is not finite.
    pub fn with_points(&self, points: Vec<DVec3>) -> Result<Self> {
        if points.len() != self.points.len() || points.iter().any(|p| !p.is_finite()) {
            return Err(Error::invalid(format!(
                "the mesh needs {} finite points",
                self.points.len()
            )));
        }
        Ok(Self {
            points,
            ..self.clone()
        })
    }

    pub(super) fn vertices(&self) -> &[Vertex] {
        &self.vertices
    }

    /// The corner after `corner` in face `f`.
    fn next(&self, f: usize, corner: usize) -> usize {
        if corner + 1 == self.starts[f + 1] {
            self.starts[f]
        } else {
            corner + 1
        }
    }

    /// One plain Catmull-Clark step: the points at their new places, then one point per edge, then one per face; every
    /// face becomes as many quads as it has corners. O(number of corners).
    ///
    /// Inner points follow Pal & Ballav 2007, eq. (12); boundary points and edges the cubic curve rules; a boundary
    /// point of a single face is a corner and stays. The point of an inner edge at a boundary point with F faces
    /// follows Biermann, Levin & Zorin 2000 with weight 3/8 - cos(pi / F) / 4 (1/8 in print in Pal & Ballav 2007,
    /// section 4.1, is the mask of the regular boundary).
    ///
    /// # Errors
    /// [`Error::Unsupported`] if the result would have more than 2^26 points.
    pub fn subdivided(&self) -> Result<Self> {
        check_size(Some(
            self.points.len() + self.edges.len() + self.face_count(),
        ))?;
        let mut points = Vec::new();
        self.refine(&self.points, &mut points);
        let (first_edge, first_face) = (self.points.len(), self.points.len() + self.edges.len());
        let mut corners = Vec::with_capacity(4 * self.corners.len());
        for f in 0..self.face_count() {
            let mut before = self.corner_edges[self.starts[f + 1] - 1];
            for corner in self.starts[f]..self.starts[f + 1] {
                let after = self.corner_edges[corner];
                corners.extend([
                    self.corners[corner],
                    first_edge + after,
                    first_face + f,
                    first_edge + before,
                ]);
                before = after;
            }
        }
        let starts = (0..=self.corners.len()).map(|k| 4 * k).collect();
        Self::from_corners(points, starts, corners)
    }

    /// The limit positions of the points: where infinitely many steps move them. O(number of corners).
    ///
    /// The mask (k^2, 4, 1) / (k (k + 5)) of an inner point holds on quads; it is applied after one step, so that it
    /// serves polygons and all boundary rules as well. A boundary point goes to (1, 4, 1) / 6 along the boundary.
    #[must_use]
    pub fn limit_positions(&self) -> Vec<DVec3> {
        let mut refined = Vec::new();
        let mut limit = Vec::new();
        self.limit_of(&self.points, &mut refined, &mut limit);
        limit
    }

    /// The points after one step on the faces of this mesh, of any `points`.
    pub(super) fn refine(&self, points: &[DVec3], out: &mut Vec<DVec3>) {
        let count = points.len();
        let first_face = count + self.edges.len();
        out.clear();
        out.resize(first_face + self.face_count(), DVec3::ZERO);
        for (f, face) in self.faces().enumerate() {
            let sum = face.iter().fold(DVec3::ZERO, |sum, &k| sum + points[k]);
            out[first_face + f] = sum / face.len() as f64;
        }
        // Before scaling, the first points hold the sums over neighbours and faces of eq. (12).
        for (e, edge) in self.edges.iter().enumerate() {
            let [a, b] = edge.ends;
            out[a] += points[b];
            out[b] += points[a];
            out[count + e] = if edge.is_boundary() {
                0.5 * points[a] + 0.5 * points[b]
            } else {
                let [f, g] = edge.faces.map(|f| out[first_face + f]);
                0.25 * (points[a] + points[b] + (f + g)) + self.boundary_bias(*edge, points)
            };
        }
        for (f, face) in self.faces().enumerate() {
            let centre = out[first_face + f];
            for &k in face {
                out[k] += centre;
            }
        }
        for (k, vertex) in self.vertices.iter().enumerate() {
            out[k] = match vertex.boundary {
                Some(_) if vertex.is_corner() => points[k],
                Some([a, b]) => 0.125 * (points[a] + points[b]) + 0.75 * points[k],
                None => {
                    let valence = vertex.faces as f64;
                    (valence - 2.0) / valence * points[k] + out[k] / (valence * valence)
                }
            };
        }
    }

    /// How much an edge point moves towards the boundary end of its edge beyond the regular rule.
    fn boundary_bias(&self, edge: Edge, points: &[DVec3]) -> DVec3 {
        let [a, b] = edge.ends;
        let (rim, inner) = match (self.vertices[a].boundary, self.vertices[b].boundary) {
            (Some(_), None) => (a, b),
            (None, Some(_)) => (b, a),
            _ => return DVec3::ZERO,
        };
        // 3/8 - g with g = 3/8 - cos(pi / F) / 4; the regular F = 2 has exactly none.
        let faces = self.vertices[rim].faces;
        if faces == 2 {
            return DVec3::ZERO;
        }
        let bias = 0.25 * math::cos(std::f64::consts::PI / faces as f64);
        bias * (points[rim] - points[inner])
    }

    /// The limit positions of any `points` on the faces of this mesh; `refined` is working space.
    pub(super) fn limit_of(
        &self,
        points: &[DVec3],
        refined: &mut Vec<DVec3>,
        out: &mut Vec<DVec3>,
    ) {
        self.refine(points, refined);
        let count = points.len();
        let first_face = count + self.edges.len();
        out.clear();
        out.resize(count, DVec3::ZERO);
        for (e, edge) in self.edges.iter().enumerate() {
            for k in edge.ends {
                out[k] += 4.0 * refined[count + e];
            }
        }
        for (f, face) in self.faces().enumerate() {
            for &k in face {
                out[k] += refined[first_face + f];
            }
        }
        for (k, vertex) in self.vertices.iter().enumerate() {
            out[k] = match vertex.boundary {
                Some(_) if vertex.is_corner() => points[k],
                Some([a, b]) => (points[a] + points[b]) / 6.0 + points[k] * (2.0 / 3.0),
                None => {
                    let valence = vertex.faces as f64;
                    (valence * valence * refined[k] + out[k]) / (valence * (valence + 5.0))
                }
            };
        }
    }
}

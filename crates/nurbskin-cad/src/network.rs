//! Networks of four-sided faces that share the curves along their sides.
//!
//! A face is a whole B-spline surface over the unit square. Each of its four sides is an edge of the network, and the
//! rim of the surface is the edge's curve as a function of the parameter, after knot insertion: with the knots `U` of the
//! surface and `K`, a subset of `U`, of the edge, `rim = T(K -> U) C`. Neighbours thus meet without a gap wherever
//! their own knots are, and the p-curves of the model are the four straight sides of the square.
//!
//! [`FaceNetwork::validate`] measures how far each rim is from its curve. The control points of both over the same knots
//! bound that distance, by the convex hull property (*The NURBS Book*, section 3.2). [`FaceNetwork::without`]
//! opens a network at faces that are of no use.

use crate::mass::face_mass;
use crate::model::{EdgeUse, Face, Loop, Model, Shell, ShellKind, SurfaceKind};
use crate::natural::line;
use crate::normal_jump::JoinKind;
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::nurbs::shape::Edge as Rim;
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve, NurbsSurface};
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::{Error, Result};

mod opened;

/// How far rims, curves and vertices may be apart, as a share of the diagonal. Guard: a hundredth of the 1e-7 of the
/// diagonal that the writers give as uncertainty, and far above the rounding of knot insertion, some 1e-15.
const GAP: f64 = 1e-9;
/// Knots of a rim and of its edge that differ by less are one knot. Derived: `1 - t` of a knot in the unit interval is
/// off by half a unit in the last place of 1 where knots are not dyadic; this is eight such units.
const SAME_KNOT: f64 = 8.0 * f64::EPSILON;

/// A side of the unit square, in the direction in which its parameter increases.
struct Side {
    /// Of the surface.
    rim: Rim,
    /// Where it begins and ends.
    corners: [usize; 2],
    /// The same in (u, v).
    places: [[f64; 2]; 2],
    /// Whether the loop around the face runs along it backwards.
    backwards: bool,
}

/// v = 0, u = 1, v = 1 and u = 0.
const SIDES: [Side; 4] = [
    Side {
        rim: Rim::VMin,
        corners: [0, 1],
        places: [[0.0, 0.0], [1.0, 0.0]],
        backwards: false,
    },
    Side {
        rim: Rim::UMax,
        corners: [1, 2],
        places: [[1.0, 0.0], [1.0, 1.0]],
        backwards: false,
    },
    Side {
        rim: Rim::VMax,
        corners: [3, 2],
        places: [[0.0, 1.0], [1.0, 1.0]],
        backwards: true,
    },
    Side {
        rim: Rim::UMin,
        corners: [0, 3],
        places: [[0.0, 0.0], [0.0, 1.0]],
        backwards: true,
    },
];

/// A curve that one or two faces have as a side.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkEdge {
    /// The curve: non-rational, clamped over \[0, 1\].
    pub curve: NurbsCurve,
    /// The vertices where it begins and ends.
    pub ends: [u32; 2],
    /// How its faces join.
    pub kind: JoinKind,
}

/// A four-sided face.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkFace {
    /// The surface: non-rational, clamped over the unit square.
    pub surface: NurbsSurface,
    /// The edges along v = 0, u = 1, v = 1 and u = 0, and whether the parameter t of the side, which increases with u
    /// or v, is 1 - t of the edge. With the corners 0 to 3 at (0, 0), (1, 0), (1, 1) and (0, 1), the sides run from 0
    /// to 1, 1 to 2, 3 to 2 and 0 to 3.
    pub sides: [(u32, bool); 4],
}

/// Vertices, edges and four-sided faces.
///
/// ```
/// use nurbskin_cad::{FaceNetwork, JoinKind, NetworkEdge, NetworkFace};
/// use nurbskin_geometry::nurbs::shape::Edge;
/// use nurbskin_geometry::{ControlNet, DVec3, KnotVector, NurbsSurface};
/// let knots = KnotVector::uniform(3, 4)?;
/// let net = ControlNet::from_fn(4, 4, |i, j| DVec3::new(i as f64, j as f64, 0.0))?;
/// let surface = NurbsSurface::new(knots.clone(), knots, net, None)?;
/// let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
/// let side = |rim, ends| -> nurbskin_geometry::Result<NetworkEdge> {
///     Ok(NetworkEdge { curve: surface.edge_curve(rim)?, ends, kind: JoinKind::Open })
/// };
/// let network = FaceNetwork {
///     vertices: corners.iter().map(|&[u, v]| surface.point(u, v)).collect(),
///     edges: vec![
///         side(Edge::VMin, [0, 1])?,
///         side(Edge::UMax, [1, 2])?,
///         side(Edge::VMax, [3, 2])?,
///         side(Edge::UMin, [0, 3])?,
///     ],
///     faces: vec![NetworkFace { surface, sides: [(0, false), (1, false), (2, false), (3, false)] }],
/// };
/// let model = network.to_model("sheet")?;
/// assert_eq!(model.edges().len(), 4);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaceNetwork {
    /// Where edges meet.
    pub vertices: Vec<DVec3>,
    /// The curves.
    pub edges: Vec<NetworkEdge>,
    /// The faces. Those that share an edge run along it in opposite directions, so that all look to the same side.
    pub faces: Vec<NetworkFace>,
}

impl FaceNetwork {
    /// Number of control points, those of shared edges and vertices counted once: each vertex, the inner ones of each
    /// edge and of each face.
    #[must_use]
    pub fn control_point_count(&self) -> usize {
        let inner = |count: usize| count.saturating_sub(2);
        let of_edge = |edge: &NetworkEdge| inner(edge.curve.control_points().len());
        let of_face = |face: &NetworkFace| {
            let [m, n] = face.surface.control_points().counts();
            inner(m) * inner(n)
        };
        let edges: usize = self.edges.iter().map(of_edge).sum();
        let faces: usize = self.faces.iter().map(of_face).sum();
        self.vertices.len() + edges + faces
    }

    /// How many edges are smooth, sharp and open.
    #[must_use]
    pub fn kind_counts(&self) -> [usize; 3] {
        let kinds = [JoinKind::Smooth, JoinKind::Sharp, JoinKind::Open];
        kinds.map(|kind| self.edges.iter().filter(|e| e.kind == kind).count())
    }

    /// The kind of each edge, for [`Meant::Kinds`](crate::Meant::Kinds): those of the model of this network alone.
    #[must_use]
    pub fn kinds(&self) -> Vec<JoinKind> {
        self.edges.iter().map(|edge| edge.kind).collect()
    }

    /// Whether no edge is open.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.edges.iter().all(|edge| edge.kind != JoinKind::Open)
    }

    /// Length of the diagonal of the box around all control points.
    #[must_use]
    pub fn diagonal(&self) -> f64 {
        let boxes = self.faces.iter().map(|face| face.surface.bounding_box());
        let corners: Vec<DVec3> = boxes.flatten().collect();
        let [low, high] = bounding_box(&corners);
        if corners.is_empty() {
            return 0.0;
        }
        low.distance(high)
    }

    /// Checks the structure and measures the geometry: returns an upper bound of the distance between any rim and the
    /// curve of its edge, and between any end of a curve and its vertex. O(control points).
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is no face; an index is out of range; a curve or surface is rational, not clamped or
    /// not over \[0, 1\]; an edge has more or fewer faces than its kind says; the sides of a face do not meet at their
    /// vertices; two faces run along an edge in the same direction; the faces do not hang together; a rim has not all
    /// the knots of its edge; or the bound exceeds 1e-9 of the diagonal.
    pub fn validate(&self) -> Result<f64> {
        let limit = GAP * self.diagonal();
        if self.faces.is_empty() {
            return Err(Error::invalid("a network without faces"));
        }
        let mut worst = 0.0_f64;
        for (k, edge) in self.edges.iter().enumerate() {
            worst = worst.max(self.check_edge(k, edge, limit)?);
        }
        let mut uses: Vec<Vec<(usize, bool)>> = vec![Vec::new(); self.edges.len()];
        for (k, face) in self.faces.iter().enumerate() {
            self.check_corners(k, face)?;
            for (side, &(edge, reversed)) in face.sides.iter().enumerate() {
                uses[edge as usize].push((k, SIDES[side].backwards != reversed));
            }
        }
        self.check_uses(&uses)?;
        for (k, face) in self.faces.iter().enumerate() {
            for (side, &(edge, reversed)) in face.sides.iter().enumerate() {
                let curve = &self.edges[edge as usize].curve;
                let gap = rim_gap(&face.surface, side, curve, reversed).map_err(|error| {
                    Error::invalid(format!("side {side} of face {k}, edge {edge}: {error}"))
                })?;
                if gap.is_nan() || gap > limit {
                    return Err(Error::invalid(format!(
                        "side {side} of face {k} is {gap:.3e} from edge {edge}, and at most {limit:.3e} is allowed"
                    )));
                }
                worst = worst.max(gap);
            }
        }
        Ok(worst)
    }

    /// An edge by itself: its curve and its vertices. Returns their distance.
    fn check_edge(&self, k: usize, edge: &NetworkEdge, limit: f64) -> Result<f64> {
        let curve = &edge.curve;
        if curve.weights().is_some() || !over_unit(curve.knots()) {
            return Err(Error::invalid(format!(
                "the curve of edge {k} is rational, or not clamped over 0 to 1"
            )));
        }
        let mut worst = 0.0_f64;
        for (end, t) in edge.ends.into_iter().zip([0.0, 1.0]) {
            let Some(vertex) = self.vertices.get(end as usize) else {
                return Err(Error::invalid(format!(
                    "edge {k} ends at vertex {end} of {}",
                    self.vertices.len()
                )));
            };
            let gap = vertex.distance(curve.point(t));
            if gap.is_nan() || gap > limit {
                return Err(Error::invalid(format!(
                    "edge {k} ends {gap:.3e} from vertex {end}, and at most {limit:.3e} is allowed"
                )));
            }
            worst = worst.max(gap);
        }
        Ok(worst)
    }

    /// A face by itself: its domain, and whether its sides meet at vertices.
    fn check_corners(&self, k: usize, face: &NetworkFace) -> Result<()> {
        let surface = &face.surface;
        let domain = over_unit(surface.knots_u()) && over_unit(surface.knots_v());
        if surface.is_rational() || !domain {
            return Err(Error::invalid(format!(
                "face {k} is rational, or not clamped over the unit square"
            )));
        }
        let mut corners = [None; 4];
        for (side, &(edge, reversed)) in face.sides.iter().enumerate() {
            let Some(found) = self.edges.get(edge as usize) else {
                return Err(Error::invalid(format!(
                    "side {side} of face {k} is edge {edge} of {}",
                    self.edges.len()
                )));
            };
            let mut ends = found.ends;
            if reversed {
                ends.swap(0, 1);
            }
            for (corner, vertex) in SIDES[side].corners.into_iter().zip(ends) {
                if *corners[corner].get_or_insert(vertex) != vertex {
                    return Err(Error::invalid(format!(
                        "the sides of face {k} do not meet at one vertex in its corner {corner}"
                    )));
                }
            }
        }
        Ok(())
    }

    /// Edges by the faces that use them, each with the sense in which its loop runs along the edge.
    fn check_uses(&self, uses: &[Vec<(usize, bool)>]) -> Result<()> {
        for (k, (edge, of_edge)) in self.edges.iter().zip(uses).enumerate() {
            let expected = if edge.kind == JoinKind::Open { 1 } else { 2 };
            if of_edge.len() != expected {
                return Err(Error::invalid(format!(
                    "edge {k} is {} and has {} faces",
                    edge.kind.name(),
                    of_edge.len()
                )));
            }
            if let [(f, one), (g, two)] = of_edge[..]
                && one == two
            {
                return Err(Error::invalid(format!(
                    "faces {f} and {g} run along edge {k} in the same direction: they look to opposite sides"
                )));
            }
        }
        let mut reached = vec![false; self.faces.len()];
        let mut stack = vec![0];
        while let Some(face) = stack.pop() {
            if !std::mem::replace(&mut reached[face], true) {
                let sides = self.faces[face].sides.iter();
                stack.extend(sides.flat_map(|&(e, _)| uses[e as usize].iter().map(|u| u.0)));
            }
        }
        match reached.iter().position(|reached| !reached) {
            None => Ok(()),
            Some(k) => Err(Error::invalid(format!(
                "faces 0 and {k} are not connected by edges: a network is one shell"
            ))),
        }
    }

    /// Adds the network to a model as one shell, and returns the index of the shell. Vertices, edges and faces get the
    /// next indices of the model, in their order.
    ///
    /// The shell is a solid where no edge is open and it encloses a volume. Its faces are turned over where the volume
    /// is negative. A closed network without volume is a closed shell, any other an open one.
    ///
    /// # Errors
    /// As [`FaceNetwork::validate`]; the model is then as it was.
    pub fn add_to(&self, model: &mut Model) -> Result<usize> {
        self.validate()?;
        let (first_vertex, first_edge) = (model.vertices().len(), model.edges().len());
        let first_face = model.faces().len();
        for &vertex in &self.vertices {
            model.add_vertex(vertex)?;
        }
        for edge in &self.edges {
            let [start, end] = edge.ends.map(|v| first_vertex + v as usize);
            model.add_edge(&edge.curve, start, end)?;
        }
        let mut faces = Vec::with_capacity(self.faces.len());
        for face in &self.faces {
            faces.push(Face {
                surface: face.surface.clone(),
                kind: SurfaceKind::BSpline,
                reversed: false,
                loops: vec![loop_around(face, first_edge)?],
                trimmed: false,
                name: String::new(),
            });
        }
        let volume = if self.is_closed() {
            Some(volume(&faces)?)
        } else {
            None
        };
        for mut face in faces {
            face.reversed = volume.is_some_and(|volume| volume < 0.0);
            model.add_face(face)?;
        }
        let kind = match volume {
            None => ShellKind::Open,
            Some(volume) if volume != 0.0 => ShellKind::Solid,
            Some(_) => ShellKind::Closed,
        };
        let faces = (first_face..model.faces().len()).collect();
        model.add_shell(Shell { faces, kind })
    }

    /// A model of this network alone: its vertices, edges and faces have the indices that they have here.
    ///
    /// # Errors
    /// As [`FaceNetwork::validate`].
    pub fn to_model(&self, name: &str) -> Result<Model> {
        let mut model = Model::new(name);
        self.add_to(&mut model)?;
        Ok(model)
    }
}

/// Whether these knots are clamped over 0 to 1.
fn over_unit(knots: &KnotVector) -> bool {
    let (a, b) = knots.domain();
    let unit = a.to_bits() == 0.0_f64.to_bits() && b.to_bits() == 1.0_f64.to_bits();
    unit && knots.is_clamped() && !knots.is_periodic()
}

/// The volume inside faces that close.
fn volume(faces: &[Face]) -> Result<f64> {
    let corners: Vec<DVec3> = faces
        .iter()
        .flat_map(|f| f.surface.bounding_box())
        .collect();
    let [low, high] = bounding_box(&corners);
    let apex = low.midpoint(high);
    let cones = each(faces.len(), |k| face_mass(&faces[k], apex));
    cones.into_iter().map(|mass| Ok(mass?.cone)).sum()
}

/// The loop around a face: the four sides, the last two backwards.
fn loop_around(face: &NetworkFace, first_edge: usize) -> Result<Loop> {
    let mut uses = Vec::with_capacity(4);
    for (&(edge, reversed), side) in face.sides.iter().zip(&SIDES) {
        let [from, to] = side.places;
        let (from, to) = if reversed { (to, from) } else { (from, to) };
        uses.push(EdgeUse {
            edge: first_edge + edge as usize,
            reversed: side.backwards != reversed,
            pcurve: line(from, to, (0.0, 1.0))?,
        });
    }
    Ok(Loop { uses })
}

/// An upper bound of the distance between a rim of a surface and a curve at equal parameters, or opposite ones: that of
/// the control points over the knots of the rim.
fn rim_gap(surface: &NurbsSurface, side: usize, curve: &NurbsCurve, reversed: bool) -> Result<f64> {
    let rim = surface.edge_curve(SIDES[side].rim)?;
    let mut curve = if reversed {
        curve.reversed()?
    } else {
        curve.clone()
    };
    let [low, high] = [curve.knots().degree(), rim.knots().degree()];
    if low > high {
        return Err(Error::invalid(format!(
            "a curve of degree {low} is no side of a surface of degree {high}"
        )));
    }
    curve = curve.elevate(high - low)?;
    let missing = missing_knots(curve.knots().knots(), rim.knots().knots()).ok_or_else(|| {
        Error::invalid("the curve has a knot that its side of the surface does not have")
    })?;
    let curve = curve.insert_knots(&missing)?;
    let pairs = curve.control_points().iter().zip(rim.control_points());
    Ok(pairs.fold(0.0, |most: f64, (a, b)| most.max(a.distance(*b))))
}

/// The knots of `all` without those of `some`; `None` if one of `some` is not among `all`.
fn missing_knots(some: &[f64], all: &[f64]) -> Option<Vec<f64>> {
    let mut some = some.iter().copied().peekable();
    let mut missing = Vec::new();
    for &knot in all {
        if some
            .next_if(|&own| (own - knot).abs() <= SAME_KNOT)
            .is_none()
        {
            missing.push(knot);
        }
    }
    some.peek().is_none().then_some(missing)
}

#[cfg(test)]
mod tests;

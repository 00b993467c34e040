//! The face that is a whole surface.

use super::mass::face_mass;
use super::model::{EdgeUse, Face, Loop, Model, Shell, ShellKind};
use glam::DVec3;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::shape::Edge as Side;
use nurbskin_geometry::nurbs::{ControlNet, KnotVector, NurbsCurve, NurbsSurface};
use nurbskin_geometry::{Error, Result};

/// The surface with clamped knots that do not wrap. Knot insertion makes it exactly; the last line of control points of
/// a direction that was periodic is then a copy of the first, so that rounding does not open it.
///
/// # Errors
/// [`Error::Invalid`] if weights underflow.
pub(crate) fn clamped(surface: &NurbsSurface) -> Result<NurbsSurface> {
    let plain = |knots: &KnotVector| knots.is_clamped() && !knots.is_periodic();
    if plain(surface.knots_u()) && plain(surface.knots_v()) {
        return Ok(surface.clone());
    }
    let (periodic, surface) = (surface.periodic(), surface.clamped()?);
    let [m, n] = surface.control_points().counts();
    let source = |i: usize, j: usize| {
        let turn =
            |k: usize, count: usize, wraps: bool| if wraps && k + 1 == count { 0 } else { k };
        (turn(i, m, periodic[0]), turn(j, n, periodic[1]))
    };
    let net = ControlNet::from_fn(m, n, |i, j| {
        let (i, j) = source(i, j);
        surface.control_points().point(i, j)
    })?;
    let weights = surface.weights().map(|w| {
        let all = (0..m * n).map(|k| source(k % m, k / m));
        all.map(|(i, j)| w[j * m + i]).collect()
    });
    NurbsSurface::new(
        surface.knots_u().clone(),
        surface.knots_v().clone(),
        net,
        weights,
    )
}

/// A straight p-curve over these parameters.
///
/// # Errors
/// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) if the parameters do not rise.
pub(crate) fn line(from: [f64; 2], to: [f64; 2], (a, b): (f64, f64)) -> Result<NurbsCurve> {
    let at = |p: [f64; 2]| DVec3::new(p[0], p[1], 0.0);
    NurbsCurve::new(
        KnotVector::new(1, vec![a, a, b, b])?,
        vec![at(from), at(to)],
        None,
    )
}

/// The sides of the domain in the order and sense of the loop around it: each side and whether it runs backwards.
const AROUND: [(Side, bool); 4] = [
    (Side::VMin, false),
    (Side::UMax, false),
    (Side::VMax, true),
    (Side::UMin, true),
];

impl Model {
    /// Adds a face that is all of a surface, bounded by its four sides, and tells its index: sides that coincide within
    /// `tolerance` become one edge, a seam, that the loop runs along both ways; sides that are a point within it become
    /// degenerate edges.
    ///
    /// # Errors
    /// [`Error::Invalid`] if weights underflow.
    pub fn add_whole_surface(&mut self, surface: &NurbsSurface, tolerance: f64) -> Result<usize> {
        let surface = clamped(surface)?;
        let boundary = self.whole_loop(&surface, tolerance)?;
        self.add_face(Face {
            surface,
            kind: super::SurfaceKind::BSpline,
            reversed: false,
            loops: vec![boundary],
            trimmed: false,
            name: String::new(),
        })
    }

    /// The loop around the domain of a clamped surface, its vertices and edges added.
    pub(crate) fn whole_loop(&mut self, surface: &NurbsSurface, tolerance: f64) -> Result<Loop> {
        let closed = Direction::BOTH.map(|d| surface.is_closed(d, tolerance));
        let pole = |side: Side| surface.is_pole(side, tolerance);
        let [(a, b), (c, d)] = surface.domain();
        // 1. Corners (0, 0), (1, 0), (1, 1), (0, 1); those that are one get the number of the first.
        let mut corner = [0, 1, 2, 3];
        let mut join = |i: usize, j: usize| {
            let (low, high) = (corner[i].min(corner[j]), corner[i].max(corner[j]));
            corner
                .iter_mut()
                .filter(|c| **c == high)
                .for_each(|c| *c = low);
        };
        if closed[0] || pole(Side::VMin) {
            join(0, 1);
        }
        if closed[0] || pole(Side::VMax) {
            join(3, 2);
        }
        if closed[1] || pole(Side::UMin) {
            join(0, 3);
        }
        if closed[1] || pole(Side::UMax) {
            join(1, 2);
        }
        let places = [[a, c], [b, c], [b, d], [a, d]];
        let mut vertices = [usize::MAX; 4];
        for k in 0..4 {
            if corner[k] == k {
                vertices[k] = self.add_vertex(surface.point(places[k][0], places[k][1]))?;
            }
        }
        let vertex = |k: usize| vertices[corner[k]];
        // 2. Sides, each from its lower to its higher parameter: corners where it starts and ends.
        let ends = |side: Side| match side {
            Side::VMin => [0, 1],
            Side::UMax => [1, 2],
            Side::VMax => [3, 2],
            Side::UMin => [0, 3],
        };
        let seam_of = |side: Side| match side {
            Side::UMax if closed[0] => Some(Side::UMin),
            Side::VMax if closed[1] => Some(Side::VMin),
            _ => None,
        };
        let mut edges: Vec<(Side, usize)> = Vec::with_capacity(4);
        for side in [Side::UMin, Side::VMin, Side::UMax, Side::VMax] {
            let twin = seam_of(side).and_then(|other| edges.iter().find(|e| e.0 == other));
            let edge = match twin {
                Some(&(_, edge)) => edge,
                None => {
                    let [start, end] = ends(side).map(vertex);
                    if pole(side) {
                        self.add_degenerate_edge(start)?
                    } else {
                        self.add_edge(&surface.edge_curve(side)?, start, end)?
                    }
                }
            };
            edges.push((side, edge));
        }
        // 3. Around.
        let mut boundary = Loop::default();
        for (side, reversed) in AROUND {
            let Some(&(_, edge)) = edges.iter().find(|e| e.0 == side) else {
                continue;
            };
            let [start, end] = ends(side).map(|k| places[k]);
            let range = match side.direction() {
                Direction::U => (c, d),
                Direction::V => (a, b),
            };
            boundary.uses.push(EdgeUse {
                edge,
                reversed,
                pcurve: line(start, end, range)?,
            });
        }
        Ok(boundary)
    }

    /// Adds a shell of one face: a solid where the face closes on itself, turned so that the volume is behind it, else
    /// an open sheet.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the face does not exist or is in a shell already.
    pub fn add_shell_of(&mut self, face: usize) -> Result<usize> {
        let kind = if self.is_closed(&[face]) {
            let found = self.faces().get(face);
            let found = found.ok_or_else(|| Error::invalid(format!("there is no face {face}")))?;
            let [low, high] = found.surface.bounding_box();
            if face_mass(found, 0.5 * (low + high))?.cone < 0.0 {
                self.turn_face(face)?;
            }
            ShellKind::Solid
        } else {
            ShellKind::Open
        };
        self.add_shell(Shell {
            faces: vec![face],
            kind,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_geometry::nurbs::conic;

    /// Edges, vertices and whether the face closes.
    fn shape(surface: &NurbsSurface) -> (usize, usize, bool) {
        let mut model = Model::new("");
        let face = model.add_whole_surface(surface, 1e-9).unwrap();
        let boundary = &model.faces()[face].loops[0];
        // P-curves follow each other, and lie on the curves of their edges.
        let mut at = boundary.uses[3].ends()[1];
        for used in &boundary.uses {
            assert_eq!(used.ends()[0], at);
            at = used.ends()[1];
            let (a, b) = used.pcurve.domain();
            for k in 0..=8 {
                let t = a + (b - a) * f64::from(k) / 8.0;
                let place = used.pcurve.point(t);
                let on_surface = model.faces()[face].surface.point(place.x, place.y);
                let edge = &model.edges()[used.edge];
                let on_edge = match &edge.curve {
                    Some(curve) => curve.point(t),
                    None => model.vertices()[edge.start],
                };
                assert!(on_surface.distance(on_edge) < 1e-12);
            }
        }
        (
            model.edges().len(),
            model.vertices().len(),
            model.is_closed(&[face]),
        )
    }

    #[test]
    fn sides_become_edges_seams_and_poles() {
        let axis = DVec3::new(1.0, 2.0, 3.0);
        let net = ControlNet::from_fn(4, 4, |i, j| DVec3::new(i as f64, j as f64, (i * j) as f64));
        let knots = KnotVector::uniform(3, 4).unwrap();
        let sheet = NurbsSurface::new(knots.clone(), knots, net.unwrap(), None).unwrap();
        assert_eq!(shape(&sheet), (4, 4, false));
        assert_eq!(
            shape(&conic::cylinder(axis, axis, 2.0).unwrap()),
            (3, 2, false)
        );
        assert_eq!(
            shape(&conic::cone(axis, axis, 2.0, 0.0).unwrap()),
            (3, 2, false)
        );
        assert_eq!(shape(&conic::sphere(axis, 2.0).unwrap()), (3, 2, true));
        assert_eq!(
            shape(&conic::torus(axis, axis, 2.0, 1.0).unwrap()),
            (2, 1, true)
        );
        assert_eq!(
            shape(&conic::sphere(axis, 2.0).unwrap().transposed()),
            (3, 2, true)
        );
    }
}

//! Faces and shells of a STEP file.

use super::instance::Instance;
use super::place::Geometry;
use crate::boundary::{Bound, BoundEdge};
use crate::{Model, Shell, ShellKind, SurfaceKind};
use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::nurbs::KnotVector;
use std::collections::BTreeMap;

/// What was not understood, and why.
#[derive(Debug, Default)]
pub(super) struct Losses {
    pub(super) unread: BTreeMap<String, usize>,
    pub(super) warnings: Vec<String>,
    /// Warnings that were counted only.
    pub(super) more: usize,
}

/// Warnings beyond this are counted only.
const MAX_WARNINGS: usize = 50;
/// The uncertainty that a file states holds for its p-curves as well, up to this part of the size of the surface: twice what
/// the check of a model allows.
const CERTAIN: f64 = 2e-7;

impl Losses {
    pub(super) fn add(&mut self, name: &str, why: impl std::fmt::Display) {
        *self.unread.entry(name.to_string()).or_default() += 1;
        self.warn(why);
    }

    pub(super) fn warn(&mut self, what: impl std::fmt::Display) {
        if self.warnings.len() < MAX_WARNINGS {
            self.warnings.push(what.to_string());
        } else {
            self.more += 1;
        }
    }
}

/// Reads the items of one representation into a model of its own, in the unit of the file.
#[derive(Debug)]
pub(super) struct Topology<'g, 's, 'a> {
    pub(super) geometry: &'g Geometry<'s, 'a>,
    pub(super) model: Model,
    pub(super) losses: &'g mut Losses,
    pub(super) vertices: BTreeMap<u64, usize>,
    pub(super) edges: BTreeMap<u64, usize>,
    /// The instances of edges.
    pub(super) instances: BTreeMap<usize, u64>,
    /// Edges of `POLY_LOOP`s by the vertices they join, the smaller first.
    pub(super) straight: BTreeMap<[usize; 2], usize>,
}

/// Surfaces that are read.
pub(super) fn is_surface(name: &str) -> bool {
    matches!(
        name,
        "PLANE"
            | "CYLINDRICAL_SURFACE"
            | "CONICAL_SURFACE"
            | "SPHERICAL_SURFACE"
            | "TOROIDAL_SURFACE"
            | "DEGENERATE_TOROIDAL_SURFACE"
            | "SURFACE_OF_REVOLUTION"
            | "SURFACE_OF_LINEAR_EXTRUSION"
            | "RECTANGULAR_TRIMMED_SURFACE"
            | "CURVE_BOUNDED_SURFACE"
            | "BEZIER_SURFACE"
            | "UNIFORM_SURFACE"
            | "QUASI_UNIFORM_SURFACE"
    ) || name.contains("B_SPLINE_SURFACE")
}

impl<'g, 's, 'a> Topology<'g, 's, 'a> {
    pub(super) fn new(geometry: &'g Geometry<'s, 'a>, losses: &'g mut Losses) -> Self {
        Self {
            geometry,
            model: Model::default(),
            losses,
            vertices: BTreeMap::new(),
            edges: BTreeMap::new(),
            instances: BTreeMap::new(),
            straight: BTreeMap::new(),
        }
    }

    /// Reads an item of a representation; what is not understood is counted.
    pub(super) fn item(&mut self, id: u64) {
        if let Err(error) = self.item_at(id) {
            let names = self.geometry.step.names(id);
            self.losses.add(names.first().unwrap_or(&"?"), error);
        }
    }

    fn item_at(&mut self, id: u64) -> Result<()> {
        let instance = self.geometry.step.get(id)?;
        let all = instance.all();
        match instance.name() {
            "MANIFOLD_SOLID_BREP" | "FACETED_BREP" => {
                self.shell(all.reference(1)?, ShellKind::Solid, false)
            }
            "BREP_WITH_VOIDS" => {
                self.shell(all.reference(1)?, ShellKind::Solid, false)?;
                let voids = all.references(2)?;
                voids
                    .into_iter()
                    .try_for_each(|v| self.shell(v, ShellKind::Solid, false))
            }
            "SHELL_BASED_SURFACE_MODEL" | "FACE_BASED_SURFACE_MODEL" => {
                let shells = all.references(1)?;
                shells
                    .into_iter()
                    .try_for_each(|s| self.shell(s, ShellKind::Open, false))
            }
            "OPEN_SHELL"
            | "CLOSED_SHELL"
            | "ORIENTED_OPEN_SHELL"
            | "ORIENTED_CLOSED_SHELL"
            | "CONNECTED_FACE_SET" => self.shell(id, ShellKind::Open, false),
            "GEOMETRIC_SET" | "GEOMETRIC_CURVE_SET" => {
                let elements = all.references(1)?;
                self.geometry.step.deeper(id, || {
                    elements.into_iter().for_each(|e| self.item(e));
                    Ok(())
                })
            }
            "ADVANCED_FACE" | "FACE_SURFACE" => {
                let face = self.face(id, false)?;
                self.model.add_shell_of(face).map(|_| ())
            }
            // Where things are, but no shape.
            "AXIS2_PLACEMENT_3D" | "MAPPED_ITEM" => Ok(()),
            name if is_surface(name) => {
                let face = self.bare(id, &instance)?;
                self.model.add_shell_of(face).map(|_| ())
            }
            name => Err(instance.error(format_args!("{name} is not read"))),
        }
    }

    /// Reads a shell: its faces one by one, those that fail counted.
    fn shell(&mut self, id: u64, kind: ShellKind, flip: bool) -> Result<()> {
        let step = self.geometry.step;
        let instance = step.get(id)?;
        let all = instance.all();
        let name = instance.name();
        if let "ORIENTED_OPEN_SHELL" | "ORIENTED_CLOSED_SHELL" = name {
            let (inner, flip) = (all.reference(2)?, flip == all.flag(3)?);
            return step.deeper(id, || self.shell(inner, kind, flip));
        }
        if !matches!(name, "OPEN_SHELL" | "CLOSED_SHELL" | "CONNECTED_FACE_SET") {
            return Err(instance.error("the file should have a shell here"));
        }
        let kind = if kind == ShellKind::Open && name == "CLOSED_SHELL" {
            ShellKind::Closed
        } else {
            kind
        };
        let mut faces = Vec::new();
        let mut lost = 0;
        for face in all.references(1)? {
            match self.face(face, flip) {
                Ok(face) => faces.push(face),
                Err(error) => {
                    lost += 1;
                    self.losses.add(&self.culprit(face), error);
                }
            }
        }
        if faces.is_empty() {
            return Ok(());
        }
        let closed = self.model.is_closed(&faces);
        let kind = if closed { kind } else { ShellKind::Open };
        if !closed && name == "CLOSED_SHELL" && lost == 0 {
            self.losses.warn(
                instance
                    .error("this closed shell has gaps; it was read as an open one")
                    .to_string(),
            );
        }
        self.model.add_shell(Shell { faces, kind }).map(|_| ())
    }

    /// The type to blame for a face that was not read: that of its surface, if that is not understood.
    fn culprit(&self, face: u64) -> String {
        let step = self.geometry.step;
        let surface = step
            .get(face)
            .and_then(|f| f.all().reference(2))
            .map(|s| step.names(s));
        let name = surface.ok().and_then(|names| names.first().copied());
        match name {
            Some(name) if !is_surface(name) && name != "BOUNDED_SURFACE" => name.to_string(),
            _ => step.names(face).first().unwrap_or(&"?").to_string(),
        }
    }

    /// Reads a face; `flip` turns its outward side round.
    fn face(&mut self, id: u64, flip: bool) -> Result<usize> {
        let (geometry, step) = (self.geometry, self.geometry.step);
        let instance = step.get(id)?;
        let all = instance.all();
        let mut sense = true;
        let mut surface = None;
        match instance.name() {
            "ADVANCED_FACE" | "FACE_SURFACE" => {
                surface = Some(all.reference(2)?);
                sense = all.flag(3)?;
            }
            "ORIENTED_FACE" => {
                let (inner, flip) = (all.reference(2)?, flip == all.flag(3)?);
                return step.deeper(id, || self.face(inner, flip));
            }
            "FACE" => {}
            name => return Err(instance.error(format_args!("{name} is not read as a face"))),
        }
        let mut bounds = Vec::new();
        let mut around = Vec::new();
        for bound in all.references(1)? {
            let bound = self.bound(bound, &mut around)?;
            bounds.push(if flip { bound.turned() } else { bound });
        }
        let smooth = surface.is_some_and(|s| {
            let names = step.names(s);
            names.contains(&"CONICAL_SURFACE") || names.contains(&"SURFACE_OF_REVOLUTION")
        });
        around.extend(self.around(&bounds, smooth));
        let reversed = sense == flip;
        let name = all.text(0);
        let tolerance = self.tolerance(&around);
        let (surface, kind, reversed) = match surface {
            Some(surface) => {
                let read = geometry.surface(surface, &around)?;
                // Other surfaces have other parameters here than in the file.
                if read.kind == SurfaceKind::BSpline && !read.flipped {
                    for edge in bounds.iter_mut().flat_map(|bound| &mut bound.edges) {
                        edge.pcurve = self.pcurve(edge, surface);
                    }
                }
                (read.surface, read.kind, reversed != read.flipped)
            }
            None => (
                flat(&around).ok_or_else(|| instance.error("the face has no surface"))?,
                SurfaceKind::Plane,
                flip,
            ),
        };
        let tolerance = if tolerance > 0.0 {
            tolerance
        } else {
            size(surface.control_points().points()) * 1e-8
        };
        let whole = size(surface.control_points().points());
        let given = self.geometry.tolerance.min(CERTAIN * whole);
        let added = self.model.add_bounded_face(
            &surface,
            kind,
            reversed,
            &bounds,
            name,
            [tolerance, given],
        );
        for note in self.model.take_notes() {
            self.losses.warn(instance.error(note).to_string());
        }
        added.map_err(|e| instance.error(e))
    }

    /// How close p-curves are made to their edges.
    fn tolerance(&self, around: &[DVec3]) -> f64 {
        let far = around
            .iter()
            .fold(0.0_f64, |a, p| a.max(p.abs().max_element()));
        (1e-8 * size(around)).max(1e-13 * far)
    }

    /// Points of the edges: with their control points, which hold them, or without, all of them on the edges.
    fn around(&self, bounds: &[Bound], exact: bool) -> Vec<DVec3> {
        let mut points = Vec::new();
        let edges = bounds.iter().flat_map(|b| &b.edges);
        for edge in edges.flat_map(|each| self.model.pieces_of(each.edge)) {
            let edge = self.model.edges().get(edge);
            let Some(curve) = edge.and_then(|e| e.curve.as_ref()) else {
                continue;
            };
            let breaks = curve.knots().breakpoints();
            let parts = if breaks.len() > 64 { 4 } else { 32 };
            for w in breaks.windows(2) {
                points.extend(
                    (0..=parts).map(|k| {
                        curve.point(w[0] + (w[1] - w[0]) * f64::from(k) / f64::from(parts))
                    }),
                );
            }
            if !exact {
                points.extend_from_slice(curve.control_points());
            }
        }
        points
    }

    /// A surface without a face.
    fn bare(&mut self, id: u64, instance: &Instance<'_, '_>) -> Result<usize> {
        let mut bounds = Vec::new();
        if instance.name() == "CURVE_BOUNDED_SURFACE" {
            for bound in instance.all().references(2)? {
                let curve = self.geometry.curve(bound)?.whole(self.geometry.tolerance)?;
                let start = self.model.add_vertex(curve.point(curve.domain().0))?;
                let edge = self.model.add_edge(&curve, start, start)?;
                bounds.push(Bound {
                    edges: vec![BoundEdge {
                        edge,
                        reversed: false,
                        pcurve: None,
                    }],
                    outer: false,
                });
            }
        }
        let around = self.around(&bounds, false);
        let read = self.geometry.surface(id, &around)?;
        let tolerance = 1e-8 * size(read.surface.control_points().points());
        let name = instance.all().text(0);
        let added = self.model.add_bounded_face(
            &read.surface,
            read.kind,
            false,
            &bounds,
            name,
            [tolerance, 0.0],
        );
        added.map_err(|e| instance.error(e))
    }
}

/// The diagonal of the box around points.
fn size(points: &[DVec3]) -> f64 {
    let fold = |[a, b]: [DVec3; 2], &p: &DVec3| [a.min(p), b.max(p)];
    match points
        .iter()
        .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], fold)
    {
        [a, b] if a.x <= b.x => a.distance(b),
        _ => 0.0,
    }
}

/// The plane of a polygon as a patch around it, its normal by Newell's rule.
fn flat(points: &[DVec3]) -> Option<nurbskin_geometry::nurbs::NurbsSurface> {
    let first = *points.first()?;
    let normal: DVec3 = points
        .windows(2)
        .map(|w| (w[0] - first).cross(w[1] - first))
        .sum();
    let z = normal.try_normalize()?;
    let x = z.any_orthonormal_vector();
    let y = z.cross(x);
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for p in points {
        let local = DVec3::new((*p - first).dot(x), (*p - first).dot(y), 0.0);
        (low, high) = (low.min(local), high.max(local));
    }
    let net = nurbskin_geometry::nurbs::ControlNet::from_fn(2, 2, |i, j| {
        let u = if i == 0 { low.x } else { high.x };
        let v = if j == 0 { low.y } else { high.y };
        first + u * x + v * y
    });
    let knots = |a: f64, b: f64| KnotVector::clamped(1, &[a, b]).ok();
    nurbskin_geometry::nurbs::NurbsSurface::new(
        knots(low.x, high.x)?,
        knots(low.y, high.y)?,
        net.ok()?,
        None,
    )
    .ok()
}

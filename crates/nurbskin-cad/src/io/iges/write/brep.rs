//! Shells whose faces share edges: a solid (entity 186) or a shell (514) of faces (510) with loops (508), over one list
//! of edges (504) and one of vertices (502).
//!
//! Bare surfaces (128) lose which faces meet. So shells of several whole surfaces, networks of four-sided faces above
//! all, are written with their topology. A loop has its face to the left seen from outside; each curve in a parameter
//! plane runs as its edge does.

use super::face::{PARAMETRIC, PART};
use super::{Entities, Layout, SURFACE_LEVEL};
use crate::io::iges::curve;
use crate::io::iges::directory::DirectoryEntry;
use crate::io::iges::surface::{self, push_point};
use crate::{EdgeUse, Face, Model, Shell, ShellKind};
use nurbskin_geometry::nurbs::NurbsCurve;
use nurbskin_geometry::{DVec3, Error, Result};

/// Whether a shell is written with its topology: several whole surfaces, without poles. The paper's layout has bare
/// surfaces only.
pub(super) fn is_shared(model: &Model, shell: &Shell, layout: Layout) -> bool {
    let whole = |&face: &usize| {
        let Some(face) = model.faces().get(face) else {
            return false;
        };
        let real = |used: &EdgeUse| model.edges()[used.edge].curve.is_some();
        let loops = face.loops.iter().flat_map(|l| &l.uses);
        !face.trimmed && face.loops.len() == 1 && loops.clone().all(real)
    };
    layout == Layout::Exact && shell.faces.len() > 1 && shell.faces.iter().all(whole)
}

/// The numbers that vertices or edges get in their list, from 1, in the order of their use.
struct Numbers {
    of: Vec<usize>,
    used: Vec<usize>,
}

impl Numbers {
    fn new(count: usize) -> Self {
        Self {
            of: vec![0; count],
            used: Vec::new(),
        }
    }

    fn of(&mut self, k: usize) -> usize {
        if self.of[k] == 0 {
            self.used.push(k);
            self.of[k] = self.used.len();
        }
        self.of[k]
    }
}

/// Puts a shell, the `k`-th of the file, and what it consists of before it.
///
/// # Errors
/// As `write`.
pub(super) fn push(
    entities: &mut Entities,
    model: &Model,
    shell: &Shell,
    colour: i64,
    k: usize,
) -> Result<()> {
    let entry = |entity, form, status: &str, label: &str| DirectoryEntry {
        entity,
        form,
        level: SURFACE_LEVEL,
        status: status.into(),
        label: label.into(),
        subscript: i64::try_from(k).unwrap_or(0) + 1,
        ..Default::default()
    };
    let visible = |entry| DirectoryEntry { colour, ..entry };
    let (origin, resolution) = (entities.origin, entities.resolution);
    // 1. Edges and vertices, each once.
    let mut edges = Numbers::new(model.edges().len());
    let mut vertices = Numbers::new(model.vertices().len());
    for &face in &shell.faces {
        for used in uses_of(&model.faces()[face]) {
            edges.of(used.edge);
        }
    }
    let mut ends = Vec::with_capacity(edges.used.len());
    for &edge in &edges.used {
        let edge = &model.edges()[edge];
        ends.push([vertices.of(edge.start), vertices.of(edge.end)]);
    }
    let spelling = entities.spelling;
    let points = entities.add(entry(502, 1, PART, "VERTICES"), |section| {
        section.token("502,");
        section.token(&format!("{},", vertices.used.len()));
        for &vertex in &vertices.used {
            push_point(section, model.vertices()[vertex], spelling, origin)?;
        }
        section.token("0;"); // no associativities follow
        Ok(())
    })?;
    let mut numbers = vec![504, edges.used.len()];
    for (&edge, [start, end]) in edges.used.iter().zip(ends) {
        let Some(of_edge) = &model.edges()[edge].curve else {
            return Err(Error::invalid(format!("edge {edge} is a pole")));
        };
        let in_space = entities.add(entry(126, 0, PART, "CURVE"), |section| {
            curve::push(section, of_edge, origin, resolution, false)
        })?;
        numbers.extend([in_space, points, start, points, end]);
    }
    let list = entities.list(entry(504, 1, PART, "EDGES"), &numbers)?;
    // 2. Faces. One that looks against its surface gets u and v exchanged, as bare surfaces do.
    let mut faces = vec![514, shell.faces.len()];
    for &face in &shell.faces {
        let face = &model.faces()[face];
        let mut properties = Vec::new();
        if !face.name.is_empty() {
            properties.push(entities.name(&face.name)?);
        }
        let turned = face.reversed.then(|| face.surface.transposed());
        let whole = turned.as_ref().unwrap_or(&face.surface);
        let basis = entities.add(visible(entry(128, 0, PART, "SURFACE")), |section| {
            surface::push(section, whole, spelling, origin, resolution, &[])
        })?;
        let mut uses: Vec<&EdgeUse> = uses_of(face).collect();
        if face.reversed {
            uses.reverse();
        }
        let mut numbers = vec![508, uses.len()];
        for used in uses {
            let mut plane = used.pcurve.clone();
            if face.reversed {
                plane = plane.map_points(|p| DVec3::new(p.y, p.x, p.z))?;
            }
            let curve = entities.add(entry(126, 0, PARAMETRIC, "PCURVE"), |section| {
                curve::push(section, &plane, DVec3::ZERO, resolution, true)
            })?;
            let along = usize::from(used.reversed == face.reversed);
            let iso = usize::from(is_iso(&plane));
            // An edge, its list and place there, its sense, one curve in the parameter plane.
            numbers.extend([0, list, edges.of(used.edge), along, 1, iso, curve]);
        }
        let border = entities.list(entry(508, 1, PART, "LOOP"), &numbers)?;
        // One loop, the outer one.
        let mut numbers = vec![510, basis, 1, 1, border];
        if !properties.is_empty() {
            numbers.extend([0, properties.len()]);
            numbers.extend(properties);
        }
        let made = entities.list(visible(entry(510, 1, PART, "FACE")), &numbers)?;
        // It has the sense of its surface.
        faces.extend([made, 1]);
    }
    // 3. The shell.
    let (form, status) = match shell.kind {
        ShellKind::Open => (2, ""),
        ShellKind::Closed => (1, ""),
        ShellKind::Solid => (1, PART),
    };
    let made = entities.list(visible(entry(514, form, status, "SHELL")), &faces)?;
    if shell.kind == ShellKind::Solid {
        // The shell has the sense of its faces; no voids.
        entities.list(visible(entry(186, 0, "", "SOLID")), &[186, made, 1, 0])?;
    }
    Ok(())
}

fn uses_of(face: &Face) -> impl Iterator<Item = &EdgeUse> {
    face.loops.iter().flat_map(|each| &each.uses)
}

/// Whether a curve in the parameter plane is a line of constant u or v.
#[expect(clippy::float_cmp, reason = "exactly along one of the parameters")]
fn is_iso(plane: &NurbsCurve) -> bool {
    let points = plane.control_points();
    let same = |f: fn(&DVec3) -> f64| points.windows(2).all(|w| f(&w[0]) == f(&w[1]));
    same(|p| p.x) || same(|p| p.y)
}

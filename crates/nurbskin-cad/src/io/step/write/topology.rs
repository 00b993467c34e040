//! Vertices, edges with their p-curves, loops, faces and shells (ISO 10303-42).

use super::geometry;
use super::product::Product;
use super::text::{Id, Text};
use crate::{EdgeUse, Face, Loop, Model, ShellKind};
use nurbskin_geometry::{Error, Result};

/// A shell as a shape, ready to be an item of a representation.
pub(super) struct Item {
    /// A `MANIFOLD_SOLID_BREP` or `SHELL_BASED_SURFACE_MODEL`.
    pub(super) id: Id,
    pub(super) solid: bool,
}

/// What is written already, by the indices of the model.
struct Writer<'m> {
    model: &'m Model,
    vertices: Vec<Option<Id>>,
    /// `EDGE_CURVE`s; none for degenerate edges.
    edges: Vec<Option<Id>>,
    surfaces: Vec<Id>,
}

/// Writes the shells of a model, faces in no shell as open ones of their own after them.
///
/// # Errors
/// [`Error::Invalid`] for a face without a loop, or if the origin makes a point non-finite.
pub(super) fn shells(
    text: &mut Text,
    model: &Model,
    product: &Product,
    uncertainty: f64,
) -> Result<Vec<Item>> {
    let mut writer = Writer {
        model,
        vertices: vec![None; model.vertices().len()],
        edges: vec![None; model.edges().len()],
        surfaces: Vec::with_capacity(model.faces().len()),
    };
    for face in model.faces() {
        let surface = geometry::surface(text, &face.surface, uncertainty)?;
        writer.surfaces.push(surface);
    }
    writer.edges(text, product)?;
    let mut faces = Vec::with_capacity(model.faces().len());
    for (k, face) in model.faces().iter().enumerate() {
        faces.push(writer.face(text, k, face)?);
    }
    let mut loose = vec![true; faces.len()];
    let mut items = Vec::new();
    for shell in model.shells() {
        let members: Vec<Id> = shell.faces.iter().map(|&k| faces[k]).collect();
        shell.faces.iter().for_each(|&k| loose[k] = false);
        items.push(item(text, &model.name, &members, shell.kind));
    }
    for (&face, _) in faces.iter().zip(&loose).filter(|(_, loose)| **loose) {
        items.push(item(text, &model.name, &[face], ShellKind::Open));
    }
    Ok(items)
}

fn item(text: &mut Text, name: &str, faces: &[Id], kind: ShellKind) -> Item {
    let shell = text.add(|text| {
        text.raw(match kind {
            ShellKind::Open => "OPEN_SHELL('',",
            ShellKind::Closed | ShellKind::Solid => "CLOSED_SHELL('',",
        });
        text.ids(faces).raw(")");
    });
    let solid = kind == ShellKind::Solid;
    let id = text.add(|text| {
        if solid {
            text.raw("MANIFOLD_SOLID_BREP(").string(name).raw(",");
            text.id(shell).raw(")");
        } else {
            text.raw("SHELL_BASED_SURFACE_MODEL(").string(name);
            text.raw(",").ids(&[shell]).raw(")");
        }
    });
    Item { id, solid }
}

impl Writer<'_> {
    fn vertex(&mut self, text: &mut Text, index: usize) -> Result<Id> {
        if let Some(id) = self.vertices[index] {
            return Ok(id);
        }
        let point = text.point(self.model.vertices()[index])?;
        let id = text.add(|text| {
            text.raw("VERTEX_POINT('',").id(point).raw(")");
        });
        self.vertices[index] = Some(id);
        Ok(id)
    }

    /// All edges that a face uses: `EDGE_CURVE` over a `SURFACE_CURVE` with the p-curves on its one or two faces, or a
    /// `SEAM_CURVE` with both on one face. Part 42 has room for two.
    fn edges(&mut self, text: &mut Text, product: &Product) -> Result<()> {
        let mut uses: Vec<Vec<(usize, &EdgeUse)>> = vec![Vec::new(); self.model.edges().len()];
        for (k, face) in self.model.faces().iter().enumerate() {
            for used in face.loops.iter().flat_map(|l| &l.uses) {
                uses[used.edge].push((k, used));
            }
        }
        for (k, mut uses) in uses.into_iter().enumerate() {
            let edge = &self.model.edges()[k];
            let (Some(curve), Some(&(face, first))) = (&edge.curve, uses.first()) else {
                continue;
            };
            let twin = uses.iter().skip(1).position(|(other, _)| *other == face);
            // The two sides of a seam: the one that the face runs along forwards comes first.
            let seam = twin.is_some();
            if let Some(twin) = twin {
                uses.swap(1, twin + 1);
                if first.reversed {
                    uses.swap(0, 1);
                }
            }
            uses.truncate(2);
            let pcurves: Vec<Id> = uses
                .iter()
                .map(|(face, used)| pcurve(text, self.surfaces[*face], used, product))
                .collect();
            let basis = geometry::curve(text, curve, edge.start == edge.end)?;
            let on_surface = text.add(|text| {
                text.raw(if seam {
                    "SEAM_CURVE('',"
                } else {
                    "SURFACE_CURVE('',"
                });
                text.id(basis).raw(",").ids(&pcurves).raw(",.CURVE_3D.)");
            });
            let [start, end] = [self.vertex(text, edge.start)?, self.vertex(text, edge.end)?];
            self.edges[k] = Some(text.add(|text| {
                text.raw("EDGE_CURVE('',")
                    .id(start)
                    .raw(",")
                    .id(end)
                    .raw(",");
                text.id(on_surface).raw(",.T.)");
            }));
        }
        Ok(())
    }

    fn face(&mut self, text: &mut Text, index: usize, face: &Face) -> Result<Id> {
        if face.loops.is_empty() {
            return Err(Error::invalid(format!(
                "face {index} has no loop: STEP needs the border of every face"
            )));
        }
        let mut bounds = Vec::with_capacity(face.loops.len());
        for (k, each) in face.loops.iter().enumerate() {
            let path = self.path(text, each, face.reversed)?;
            bounds.push(text.add(|text| {
                text.raw(if k == 0 {
                    "FACE_OUTER_BOUND('',"
                } else {
                    "FACE_BOUND('',"
                });
                text.id(path).raw(",.T.)");
            }));
        }
        let surface = self.surfaces[index];
        Ok(text.add(|text| {
            text.raw("ADVANCED_FACE(").string(&face.name).raw(",");
            text.ids(&bounds).raw(",").id(surface).raw(",");
            text.flag(!face.reversed).raw(")");
        }))
    }

    /// A loop, backwards where the face is seen from the other side of its surface: STEP has the face on the left of
    /// its loops seen from outside. Degenerate edges have no place in STEP; a loop of nothing else is its vertex.
    ///
    /// A loop through a pole begins there, or, where the poles are sides of u, after the piece of the seam that follows.
    /// OpenCascade 8.0, which walks along the loop to put in the missing degenerate edges, takes a loop that begins
    /// elsewhere apart if a hole crosses its seam.
    fn path(&mut self, text: &mut Text, each: &Loop, backwards: bool) -> Result<Id> {
        let is_pole = |used: &EdgeUse| self.edges[used.edge].is_none();
        let first = each.uses.iter().position(is_pole).unwrap_or(0);
        let from_pole = each.uses[first..].iter().chain(&each.uses[..first]);
        let real = from_pole.filter_map(|used| {
            let edge = self.edges[used.edge]?;
            Some((edge, used.reversed == backwards))
        });
        let mut oriented: Vec<Id> = real
            .map(|(edge, forwards)| {
                text.add(|text| {
                    text.raw("ORIENTED_EDGE('',*,*,").id(edge).raw(",");
                    text.flag(forwards).raw(")");
                })
            })
            .collect();
        if backwards {
            oriented.reverse();
        }
        let pole = each.uses.get(first).filter(|used| is_pole(used));
        let side_of_u = pole.is_some_and(|used| (used.ends()[1] - used.ends()[0]).y.abs() > 0.0);
        if side_of_u && oriented.len() > 2 {
            oriented.rotate_left(1);
        }
        if let ([], Some(used)) = (oriented.as_slice(), each.uses.first()) {
            let vertex = self.vertex(text, self.model.edges()[used.edge].start)?;
            return Ok(text.add(|text| {
                text.raw("VERTEX_LOOP('',").id(vertex).raw(")");
            }));
        }
        Ok(text.add(|text| {
            text.raw("EDGE_LOOP('',").ids(&oriented).raw(")");
        }))
    }
}

fn pcurve(text: &mut Text, surface: Id, used: &EdgeUse, product: &Product) -> Id {
    let curve = geometry::curve_uv(text, &used.pcurve);
    let context = product.context_uv;
    let representation = text.add(|text| {
        text.raw("DEFINITIONAL_REPRESENTATION('',").ids(&[curve]);
        text.raw(",").id(context).raw(")");
    });
    text.add(|text| {
        text.raw("PCURVE('',").id(surface).raw(",");
        text.id(representation).raw(")");
    })
}

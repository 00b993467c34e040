//! The vertices and edges of a face that stands alone: curves that meet share vertices, those that coincide are one edge.

use super::lift::gap;
use super::sheet::Piece;
use crate::boundary::BoundEdge;
use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::nurbs::sweep::over;
use nurbskin_geometry::nurbs::{NurbsCurve, NurbsSurface};
use std::collections::BTreeMap;

/// The vertices and edges of one face.
pub(super) struct Joints {
    pub(super) tolerance: f64,
    /// Vertices by the cell of space that they are in.
    cells: BTreeMap<[i64; 3], Vec<usize>>,
    /// Edges by their vertices, the lower first.
    edges: BTreeMap<[usize; 2], Vec<usize>>,
}

/// Coinciding edges are looked for among this many between the same vertices.
const MOST_TWINS: usize = 8;

impl Joints {
    pub(super) fn new(tolerance: f64) -> Self {
        Self {
            tolerance,
            cells: BTreeMap::new(),
            edges: BTreeMap::new(),
        }
    }

    /// The vertex of the face at this point, added where there is none.
    pub(super) fn vertex(&mut self, model: &mut crate::Model, point: DVec3) -> Result<usize> {
        let width = 4.0 * self.tolerance;
        #[expect(
            clippy::cast_possible_truncation,
            reason = "saturates, which only joins cells"
        )]
        let cell = |p: DVec3| (p / width).floor().to_array().map(|x| x as i64);
        // Both corners of the reach around the point: the cells between them are at most eight.
        let [low, high] = [-self.tolerance, self.tolerance].map(|d| cell(point + d));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let near = self.cells.get(&[x, y, z]).into_iter().flatten();
                    let mut close =
                        near.filter(|&&v| model.vertices()[v].distance(point) <= self.tolerance);
                    if let Some(&found) = close.next() {
                        return Ok(found);
                    }
                }
            }
        }
        let added = model.add_vertex(point)?;
        self.cells.entry(cell(point)).or_default().push(added);
        Ok(added)
    }

    /// A piece from vertex to vertex as an edge of the boundary, new or shared.
    pub(super) fn edge(
        &mut self,
        model: &mut crate::Model,
        piece: &Piece,
        [from, to]: [usize; 2],
        backwards: bool,
        surface: &NurbsSurface,
    ) -> Result<BoundEdge> {
        let key = [from.min(to), from.max(to)];
        let twins = self.edges.entry(key).or_default();
        for &twin in twins.iter().take(MOST_TWINS) {
            let Some(curve) = model.edges()[twin].curve.clone() else {
                continue;
            };
            let mine = over(&piece.curve, curve.domain())?;
            let back = mine.reversed()?;
            let apart = |other: &NurbsCurve| {
                let (a, b) = curve.domain();
                let at = |k: u32| a + (b - a) * f64::from(k) / 8.0;
                (0..=8)
                    .map(|k| curve.point(at(k)).distance(other.point(at(k))))
                    .fold(0.0, f64::max)
            };
            let apart = [apart(&mine), apart(&back)];
            let opposite = apart[1] < apart[0];
            if apart[usize::from(opposite)] > self.tolerance {
                continue;
            }
            let given = piece.pcurve.as_ref().map(|pcurve| -> Result<NurbsCurve> {
                let pcurve = over(pcurve, curve.domain())?;
                if opposite {
                    pcurve.reversed()
                } else {
                    Ok(pcurve)
                }
            });
            let pcurve = given.transpose()?;
            let pcurve = pcurve.filter(|p| gap(surface, p, &curve) <= 2.0 * self.tolerance);
            return Ok(BoundEdge {
                edge: twin,
                reversed: backwards != opposite,
                pcurve,
            });
        }
        let [start, end] = if backwards { [to, from] } else { [from, to] };
        let edge = model.add_edge(&piece.curve, start, end)?;
        twins.push(edge);
        Ok(BoundEdge {
            edge,
            reversed: backwards,
            pcurve: piece.pcurve.clone(),
        })
    }
}

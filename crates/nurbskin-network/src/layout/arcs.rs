//! Arcs between corners of the cells, and the collapse of short ones.
//!
//! An arc is a chain of cut sides between two corners. Where an arc is collapsed its corners become one. The collapsed arcs form a forest, each collapse joining two different
//! corners, and a collapse never joins two borders. So the surface keeps its topology (a quotient by disjoint trees).
//!
//! A smooth arc goes if not both of its corners are on hard lines. A hard arc goes if one of its corners is there only
//! because smooth arcs meet a hard line that goes on: then these ends slide along the line, and the next arc of the line
//! takes over the vertices of the mesh.

use super::cells::Cells;
use super::surface::{Surface, index};
use super::{EdgeKind, NONE};

/// A chain of cut sides between two corners.
#[derive(Clone, Debug)]
pub(crate) struct Arc {
    /// Vertices of the mesh, in the direction of the first cell.
    pub(crate) path: Vec<u32>,
    /// The same with the arcs of the same hard line that collapsed into this one.
    pub(crate) line: Vec<u32>,
    /// What the surface does there: sharp if most of the length is.
    pub(crate) kind: EdgeKind,
    /// Length of the path, in the size of the cells along it.
    pub(crate) length: f64,
    /// The cells to the left and to the right; [`NONE`] beyond a border.
    pub(crate) cells: [u32; 2],
    /// Whether it was collapsed.
    pub(crate) gone: bool,
}

/// The cells as polygons of arcs.
#[derive(Clone, Debug)]
pub(crate) struct Polygons {
    pub(crate) arcs: Vec<Arc>,
    /// Per cell its arcs in the direction of its triangles, and whether each runs against its own direction.
    pub(crate) sides: Vec<Vec<(u32, bool)>>,
    /// For each vertex of the mesh the corner it was joined to; itself for most.
    joined: Vec<u32>,
    /// Whether other corners were joined to the vertex.
    joins: Vec<bool>,
    /// The arcs at each corner of the mesh, gone ones too.
    at: Vec<Vec<u32>>,
    /// Corners that stay where they are.
    turned: Vec<bool>,
}

impl Polygons {
    /// Of sound cells.
    pub(crate) fn new(surface: &Surface<'_>, cells: &Cells) -> Self {
        let outlines = &cells.outlines;
        let mut arc_of = vec![NONE; surface.steps.len()];
        let mut arcs: Vec<Arc> = Vec::new();
        let mut sides = Vec::with_capacity(cells.count());
        let corner = |side: u32| outlines.corner[surface.ends(side as usize)[0] as usize];
        for (cell, outline) in outlines.loops.iter().enumerate() {
            let first = outline.iter().position(|&side| corner(side)).unwrap_or(0);
            let around: Vec<u32> = [&outline[first..], &outline[..first]].concat();
            let mut polygon = Vec::new();
            for span in around.chunk_by(|_, &next| !corner(next)) {
                let other = surface.table.opposite[span[0] as usize];
                let known = if other == NONE {
                    NONE
                } else {
                    arc_of[other as usize]
                };
                if known == NONE {
                    for &side in span {
                        arc_of[side as usize] = index(arcs.len());
                    }
                    polygon.push((index(arcs.len()), false));
                    let beyond = if other == NONE {
                        NONE
                    } else {
                        cells.labels[other as usize / 3]
                    };
                    arcs.push(Arc::new(surface, span, [index(cell), beyond]));
                } else {
                    polygon.push((known, true));
                }
            }
            sides.push(polygon);
        }
        let mut at = vec![Vec::new(); surface.mesh.points.len()];
        for (k, arc) in arcs.iter().enumerate() {
            for v in arc.ends() {
                at[v as usize].push(index(k));
            }
        }
        Self {
            arcs,
            sides,
            joined: (0..index(at.len())).collect(),
            joins: vec![false; at.len()],
            at,
            turned: outlines.turned.clone(),
        }
    }

    /// The corner that the vertex was joined to.
    pub(crate) fn root(&self, mut vertex: u32) -> u32 {
        while self.joined[vertex as usize] != vertex {
            vertex = self.joined[vertex as usize];
        }
        vertex
    }

    /// The arcs of a cell that are left.
    pub(crate) fn left(&self, cell: usize) -> impl Iterator<Item = (u32, bool)> + '_ {
        let sides = self.sides[cell].iter().copied();
        sides.filter(|(arc, _)| !self.arcs[*arc as usize].gone)
    }

    /// The number of corners of a cell that are left.
    pub(crate) fn corners(&self, cell: u32) -> usize {
        self.left(cell as usize).count()
    }

    /// The corners at the ends of an arc.
    pub(crate) fn corners_of(&self, arc: u32) -> [u32; 2] {
        self.arcs[arc as usize].ends().map(|v| self.root(v))
    }

    /// The arcs left that end at a corner.
    pub(crate) fn arcs_at(&self, corner: u32) -> impl Iterator<Item = u32> + '_ {
        let at = self.at[corner as usize].iter().copied();
        at.filter(|&k| !self.arcs[k as usize].gone)
    }

    /// The hard arcs left that end at a corner.
    fn hard_at(&self, corner: u32) -> impl Iterator<Item = u32> + '_ {
        self.arcs_at(corner)
            .filter(|&k| self.arcs[k as usize].kind.is_hard())
    }

    /// The number of hard arcs left that end at a corner.
    pub(crate) fn hard_count(&self, corner: u32) -> usize {
        self.hard_at(corner).count()
    }

    /// Whether the corner is on a border.
    pub(crate) fn is_open(&self, corner: u32) -> bool {
        self.arcs_at(corner)
            .any(|k| self.arcs[k as usize].kind == EdgeKind::Open)
    }

    /// Whether a cell that is not beside the arc has both of its corners. It would have one corner twice.
    pub(crate) fn would_pinch(&self, arc: u32) -> bool {
        let [p, q] = self.corners_of(arc);
        let around = |corner: u32| {
            let cells = self
                .arcs_at(corner)
                .flat_map(|k| self.arcs[k as usize].cells);
            let mut cells: Vec<u32> = cells.filter(|c| *c != NONE).collect();
            cells.sort_unstable();
            cells.dedup();
            cells
        };
        let beside = self.arcs[arc as usize].cells;
        let there = around(q);
        around(p)
            .iter()
            .any(|c| !beside.contains(c) && there.binary_search(c).is_ok())
    }

    /// Whether hard lines meet the corner.
    pub(crate) fn is_hard(&self, corner: u32) -> bool {
        self.hard_at(corner).next().is_some()
    }

    /// Whether a hard line goes on at the corner, which is there for smooth arcs only.
    fn is_plain(&self, corner: u32) -> bool {
        !self.turned[corner as usize]
            && !self.joins[corner as usize]
            && self.hard_at(corner).count() == 2
    }

    /// The corner that stays and the one that goes if the arc is collapsed; `None` if it must not be: its cells would
    /// keep fewer than `least` corners, it joins two hard corners, or a second arc joins its two corners.
    pub(crate) fn collapsible(&self, arc: u32, least: usize) -> Option<[u32; 2]> {
        let a = &self.arcs[arc as usize];
        let [p, q] = self.corners_of(arc);
        if a.gone || p == q {
            return None;
        }
        let beside = a.cells.iter().filter(|c| **c != NONE);
        if beside.into_iter().any(|&c| self.corners(c) <= least) {
            return None;
        }
        let doubled = self.arcs_at(p).any(|k| {
            let [r, s] = self.corners_of(k);
            k != arc && ([r, s] == [p, q] || [r, s] == [q, p])
        });
        if doubled {
            return None;
        }
        if a.kind.is_hard() {
            let go = [[p, q], [q, p]];
            return go.into_iter().find(|[_, go]| self.is_plain(*go));
        }
        match [self.is_hard(p), self.is_hard(q)] {
            [true, true] => None,
            [_, true] => Some([q, p]),
            _ => Some([p, q]),
        }
    }

    /// Collapses an arc: corner `gone` becomes `stays`, as [`collapsible`](Self::collapsible) returns them.
    pub(crate) fn collapse(&mut self, arc: u32, [stays, gone]: [u32; 2]) {
        if self.arcs[arc as usize].kind.is_hard() {
            let next = self.hard_at(gone).find(|&k| k != arc);
            if let Some(next) = next {
                self.take_over(arc, next, gone);
            }
        }
        self.arcs[arc as usize].gone = true;
        self.joined[gone as usize] = stays;
        self.joins[stays as usize] = true;
        let moved = std::mem::take(&mut self.at[gone as usize]);
        self.at[stays as usize].extend(moved);
    }

    /// Puts the line of a collapsed arc before that of the next arc, which meets it at a corner.
    fn take_over(&mut self, arc: u32, next: u32, corner: u32) {
        let mut before = self.arcs[arc as usize].line.clone();
        if before.first() == Some(&corner) {
            before.reverse();
        }
        let line = &mut self.arcs[next as usize].line;
        if line.first() == Some(&corner) {
            before.pop();
            before.extend_from_slice(line);
            *line = before;
        } else if line.last() == Some(&corner) {
            line.pop();
            before.reverse();
            line.extend(before);
        }
    }
}

impl Arc {
    /// Of consecutive sides of the first cell.
    fn new(surface: &Surface<'_>, span: &[u32], cells: [u32; 2]) -> Self {
        let mut path: Vec<u32> = span
            .iter()
            .map(|&side| surface.ends(side as usize)[0])
            .collect();
        if let Some(&last) = span.last() {
            path.push(surface.ends(last as usize)[1]);
        }
        let (mut length, mut sharp) = (0.0, 0.0);
        for &side in span {
            let l = surface.relative_length(side as usize);
            length += l;
            if surface.sharp[side as usize] {
                sharp += l;
            }
        }
        let kind = if cells[1] == NONE {
            EdgeKind::Open
        } else if 2.0 * sharp > length {
            EdgeKind::Sharp
        } else {
            EdgeKind::Smooth
        };
        Self {
            line: path.clone(),
            path,
            kind,
            length,
            cells,
            gone: false,
        }
    }

    /// The vertices of the mesh at its two ends.
    pub(crate) fn ends(&self) -> [u32; 2] {
        [
            self.path.first().copied().unwrap_or(NONE),
            self.path.last().copied().unwrap_or(NONE),
        ]
    }
}

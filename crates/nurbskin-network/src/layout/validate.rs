//! The conditions that every layout must meet.

use super::{EdgeKind, Layout, NONE, SIDE_CORNERS};
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::mesh::manifold::Manifold;

impl Layout {
    /// Checks that the layout is a division of the surface of the mesh into four-sided faces:
    ///
    /// 1. Each face has four different vertices, and its sides run between its corners.
    /// 2. Each edge belongs to two faces, which run along it in opposite directions, or to one if it is open.
    /// 3. The faces around each vertex form one fan, open only at borders.
    /// 4. The faces are connected; the Euler number and the number of borders are those of the mesh.
    /// 5. Every vertex of the mesh has a place within a face; vertices on lines have one within a hard edge.
    ///
    /// With 1 to 4 the layout and the mesh have the same topology. O(n log n).
    ///
    /// # Errors
    /// [`Error::Invalid`] that names the first violated condition.
    pub fn validate(&self, mesh: &Manifold) -> Result<()> {
        self.check(mesh)
            .map_err(|what| Error::invalid(format!("the layout is not valid: {what}")))
    }

    fn check(&self, mesh: &Manifold) -> std::result::Result<(), String> {
        self.check_indices()?;
        let uses = self.check_edges()?;
        let borders = self.check_fans(&uses)?;
        let count = |n: usize| i64::try_from(n).unwrap_or(i64::MAX);
        let [v, e, f] = [self.vertices.len(), self.edges.len(), self.faces.len()].map(count);
        let (own, wanted) = (v - e + f, mesh.euler_characteristic());
        if own != wanted {
            return Err(format!(
                "its Euler number is {own}, that of the mesh {wanted}"
            ));
        }
        if borders != mesh.loops.len() {
            let wanted = mesh.loops.len();
            return Err(format!("it has {borders} borders, the mesh has {wanted}"));
        }
        self.check_places(mesh)
    }

    /// Whether all indices exist and all values are finite.
    fn check_indices(&self) -> std::result::Result<(), String> {
        let vertex = |v: &u32| (*v as usize) < self.vertices.len();
        if let Some(k) = self.vertices.iter().position(|p| !p.is_finite()) {
            return Err(format!("vertex {k} is not finite"));
        }
        for (k, edge) in self.edges.iter().enumerate() {
            if !edge.ends.iter().all(vertex) || edge.ends[0] == edge.ends[1] {
                return Err(format!("edge {k} has no two different vertices"));
            }
            if edge.kind.is_hard() != edge.line.is_some() {
                return Err(format!(
                    "edge {k} is hard without a line, or smooth with one"
                ));
            }
        }
        for (k, face) in self.faces.iter().enumerate() {
            let c = face.corners;
            let repeated = (1..4).any(|j| c[..j].contains(&c[j]));
            if !c.iter().all(vertex) || repeated {
                return Err(format!("face {k} has no four different vertices"));
            }
            for (side, [from, to]) in face.sides.iter().zip(SIDE_CORNERS) {
                let Some(edge) = self.edges.get(side.edge as usize) else {
                    return Err(format!("face {k} has a side without an edge"));
                };
                let mut ends = edge.ends;
                if side.reversed {
                    ends.reverse();
                }
                if ends != [c[from], c[to]] {
                    return Err(format!(
                        "a side of face {k} does not run between its corners"
                    ));
                }
            }
        }
        Ok(())
    }

    /// Checks the number of faces of each edge and their directions; returns that number.
    fn check_edges(&self) -> std::result::Result<Vec<u8>, String> {
        // The faces that run along the edge and against it.
        let mut uses = vec![[0_u8; 2]; self.edges.len()];
        for side in self.faces.iter().flat_map(|f| f.sides.iter().enumerate()) {
            let against = side.1.reversed != (side.0 >= 2);
            let count = &mut uses[side.1.edge as usize][usize::from(against)];
            *count = count.saturating_add(1);
        }
        for (k, (edge, uses)) in self.edges.iter().zip(&uses).enumerate() {
            let wanted = if edge.kind == EdgeKind::Open { 1 } else { 2 };
            if uses[0].max(uses[1]) > 1 || uses[0] + uses[1] != wanted {
                return Err(format!(
                    "edge {k} ({:?}) has {} faces along it and {} against it",
                    edge.kind, uses[0], uses[1]
                ));
            }
        }
        Ok(uses.iter().map(|u| u[0] + u[1]).collect())
    }

    /// Checks the faces around each vertex, and that all faces are connected; returns the number of borders.
    fn check_fans(&self, uses: &[u8]) -> std::result::Result<usize, String> {
        // (vertex, edge, corner) for both sides of each corner of each face.
        let mut around = Vec::with_capacity(8 * self.faces.len());
        for (f, face) in self.faces.iter().enumerate() {
            for (c, sides) in [[3, 0], [0, 1], [1, 2], [2, 3]].iter().enumerate() {
                for &s in sides {
                    around.push((face.corners[c], face.sides[s].edge, 4 * f + c));
                }
            }
        }
        around.sort_unstable();
        let mut fans = DisjointSets::new(4 * self.faces.len());
        let mut pieces = DisjointSets::new(self.faces.len());
        for same in around.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            for other in &same[1..] {
                fans.join(same[0].2, other.2);
                pieces.join(same[0].2 / 4, other.2 / 4);
            }
        }
        let mut next = 0;
        for fan in around.chunk_by(|x, y| x.0 == y.0) {
            let vertex = fan[0].0;
            if vertex != next {
                return Err(format!("vertex {next} has no faces"));
            }
            next += 1;
            let root = fans.root(fan[0].2);
            if fan.iter().any(|(_, _, corner)| fans.root(*corner) != root) {
                return Err(format!("the faces at vertex {vertex} form several fans"));
            }
            let open = fan.iter().filter(|(_, edge, _)| uses[*edge as usize] == 1);
            if !matches!(open.count(), 0 | 2) {
                return Err(format!("the faces at vertex {vertex} form no fan"));
            }
        }
        if next as usize != self.vertices.len() {
            return Err(format!("vertex {next} has no faces"));
        }
        if (0..self.faces.len()).any(|f| pieces.root(f) != 0) {
            return Err("its faces form several pieces".into());
        }
        Ok(self.borders())
    }

    /// The number of loops of open edges.
    fn borders(&self) -> usize {
        let mut sets = DisjointSets::new(self.vertices.len());
        let mut open = vec![false; self.vertices.len()];
        for edge in self.edges.iter().filter(|e| e.kind == EdgeKind::Open) {
            let [a, b] = edge.ends.map(|v| v as usize);
            sets.join(a, b);
            open[a] = true;
            open[b] = true;
        }
        (0..open.len())
            .filter(|&v| open[v] && sets.root(v) == v)
            .count()
    }

    /// Checks the first places of the vertices of the mesh.
    fn check_places(&self, mesh: &Manifold) -> std::result::Result<(), String> {
        if self.start.len() != mesh.points.len() {
            return Err(format!(
                "{} places for {} vertices of the mesh",
                self.start.len(),
                mesh.points.len()
            ));
        }
        let unit = |t: f64| (0.0..=1.0).contains(&t);
        for (k, on) in self.start.iter().enumerate() {
            if on.face == NONE || on.face as usize >= self.faces.len() || !unit(on.u) || !unit(on.v)
            {
                return Err(format!("vertex {k} of the mesh has no place on a face"));
            }
        }
        for on in &self.on_lines {
            let hard = self.edges.get(on.edge as usize).map(|e| e.kind.is_hard());
            if hard != Some(true) || !unit(on.t) || on.vertex as usize >= mesh.points.len() {
                return Err(format!(
                    "vertex {} of the mesh has no place on a hard edge",
                    on.vertex
                ));
            }
        }
        Ok(())
    }
}

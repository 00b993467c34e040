//! A surface of triangles with borders.

use glam::DVec3;

/// A connected, oriented triangle mesh in which every side has one or two triangles and every vertex one fan of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Manifold {
    /// Where the vertices are.
    pub points: Vec<DVec3>,
    /// Index of the point of the scan that each vertex is; `None` for vertices that were added. A point where sheets
    /// only touch has several vertices.
    pub source: Vec<Option<u32>>,
    /// By vertices, all wound the same way.
    pub triangles: Vec<[u32; 3]>,
    /// The borders by vertices, in the sense of the triangles beside them, longest first; no vertex twice.
    pub loops: Vec<Vec<u32>>,
}

impl Manifold {
    /// V - E + F: 2 for a sphere, 1 for a disk, 0 for a tube or a torus, two less for each handle, one for each hole.
    #[must_use]
    pub fn euler_characteristic(&self) -> i64 {
        let border: usize = self.loops.iter().map(Vec::len).sum();
        let count = |n: usize| i64::try_from(n).unwrap_or(i64::MAX);
        // 3 F = 2 E - B.
        let sides = usize::midpoint(3 * self.triangles.len(), border);
        count(self.points.len()) - count(sides) + count(self.triangles.len())
    }

    /// Number of handles: (2 - borders - Euler characteristic) / 2.
    #[must_use]
    pub fn genus(&self) -> usize {
        let borders = i64::try_from(self.loops.len()).unwrap_or(i64::MAX);
        usize::try_from((2 - borders - self.euler_characteristic()) / 2).unwrap_or(0)
    }

    /// The length of border number `index`; zero if there is none.
    #[must_use]
    pub fn border_length(&self, index: usize) -> f64 {
        let Some(border) = self.loops.get(index) else {
            return 0.0;
        };
        let place = |k: &u32| self.points[*k as usize];
        let next = border.iter().cycle().skip(1);
        let sides = border.iter().zip(next);
        sides.map(|(a, b)| place(a).distance(place(b))).sum()
    }

    /// The area of all triangles.
    #[must_use]
    pub fn area(&self) -> f64 {
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|k| self.points[k as usize]);
            0.5 * (b - a).cross(c - a).length()
        };
        self.triangles.iter().map(area).sum()
    }
}

//! A connected, oriented triangle mesh with borders, and its corner table.
//!
//! Side 3t + s of triangle t runs from its corner s to the next one; the table stores the opposite side of each side.
//! The Euler characteristic is χ = V - E + F, and the genus g = (2 - b - χ) / 2 for b borders.
//!
//! Source: J. Rossignac, A. Safonova, A. Szymczak, *3D Compression Made Simple: Edgebreaker on a Corner-Table*, Shape
//! Modeling International 2001.

use glam::DVec3;

pub use crate::sides::NONE;
pub(crate) use crate::sides::{after, before, opposite_sides, sides_by_edge};

/// A connected, oriented triangle mesh in which every side has one or two triangles and every vertex one fan of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Manifold {
    /// Positions of the vertices.
    pub points: Vec<DVec3>,
    /// Index of each vertex in the points of the scan; `None` for added vertices. A point where sheets only touch has
    /// several vertices.
    pub source: Vec<Option<u32>>,
    /// By vertices, all wound the same way.
    pub triangles: Vec<[u32; 3]>,
    /// The borders by vertices, in the direction of the triangles beside them, longest first; no vertex occurs twice.
    pub loops: Vec<Vec<u32>>,
}

impl Manifold {
    /// The corner table. O(n log n).
    #[must_use]
    pub fn adjacency(&self) -> Adjacency {
        let opposite = opposite_sides(&self.triangles);
        let mut first = vec![NONE; self.points.len()];
        for (side, &other) in (0_u32..).zip(&opposite) {
            let start = self.triangles[side as usize / 3][side as usize % 3] as usize;
            // At a border the fan begins there, so that it contains all triangles.
            if other == NONE || first[start] == NONE {
                first[start] = side;
            }
        }
        Adjacency { opposite, first }
    }

    /// The places of the corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|k| self.points[k as usize])
    }

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

    /// The length of the vector area of border number `index`: the area of a flat hole, and less than that of a bent one; zero if there
    /// is no such border. O(vertices of the border).
    #[must_use]
    pub fn flat_area(&self, index: usize) -> f64 {
        let Some(rim) = self.loops.get(index) else {
            return 0.0;
        };
        let place =
            |k: usize| self.points[rim[k % rim.len()] as usize] - self.points[rim[0] as usize];
        let twice: DVec3 = (0..rim.len()).map(|k| place(k).cross(place(k + 1))).sum();
        0.5 * twice.length()
    }

    /// The area of all triangles.
    #[must_use]
    pub fn area(&self) -> f64 {
        (0..self.triangles.len())
            .map(|t| self.vector_area(t).length())
            .sum()
    }

    /// The unit normal at each vertex: the mean of those of its triangles, weighted by area; zero where they cancel. O(n).
    #[must_use]
    pub fn normals(&self) -> Vec<DVec3> {
        let mut normals = vec![DVec3::ZERO; self.points.len()];
        for (t, corners) in self.triangles.iter().enumerate() {
            let area = self.vector_area(t);
            for &v in corners {
                normals[v as usize] += area;
            }
        }
        normals.into_iter().map(DVec3::normalize_or_zero).collect()
    }

    /// The normal of a triangle times its area.
    pub fn vector_area(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.corners(triangle);
        0.5 * (b - a).cross(c - a)
    }
}

/// The corner table of a [`Manifold`]. Side `3 t + s` of triangle t runs from its corner s to the next one.
///
/// Source: J. Rossignac, A. Safonova, A. Szymczak, *3D Compression Made Simple: Edgebreaker on a Corner-Table*, Shape
/// Modeling International 2001.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Adjacency {
    /// For each side the opposite side: that of the same edge in the other triangle, or [`NONE`] at a border.
    pub opposite: Vec<u32>,
    /// For each vertex a side that starts there; at a border the border's side, so that [`fan`](Self::fan) yields every
    /// triangle; [`NONE`] for a vertex without triangles.
    pub first: Vec<u32>,
}

impl Adjacency {
    /// The triangle across each side of triangle t, or [`NONE`].
    #[must_use]
    pub fn neighbours(&self, triangle: usize) -> [u32; 3] {
        let of = |s| match self.opposite.get(3 * triangle + s) {
            Some(&side) if side != NONE => side / 3,
            _ => NONE,
        };
        [of(0), of(1), of(2)]
    }

    /// The sides that start at a vertex, one per triangle around it, in the direction of the winding; from border to
    /// border if there is one. The triangle of a side is a third of it, rounded down.
    pub fn fan(&self, vertex: u32) -> impl Iterator<Item = u32> + '_ {
        let first = self.first.get(vertex as usize).copied().unwrap_or(NONE);
        let mut side = first;
        std::iter::from_fn(move || {
            let this = Some(side).filter(|&s| s != NONE)?;
            side = self.opposite[before(this) as usize];
            if side == first {
                side = NONE;
            }
            Some(this)
        })
    }

    /// Whether a vertex lies on a border.
    #[must_use]
    pub fn on_border(&self, vertex: u32) -> bool {
        let first = self.first.get(vertex as usize).copied().unwrap_or(NONE);
        first != NONE && self.opposite[first as usize] == NONE
    }
}

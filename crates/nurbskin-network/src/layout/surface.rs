//! The mesh as the layout sees it: triangles as places, and the cost of the step from each one to the next.
//!
//! A step over side s between triangles t and o costs `|c_t - c_o| + bend D angle(n_t, n_o)`: the distance of the middles
//! plus the turn of the normals, so that borders of cells tend to lie where the surface bends. No step leads over a
//! sharp line.

use super::NONE;
use glam::DVec3;
use nurbskin_geometry::math;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::mesh::manifold::{Adjacency, Manifold};

/// Cost of a radian of turn of the normal, in diagonals. Trial: prototype, six scans; cells end at bends with it.
const BEND: f64 = 0.06;
/// Rounds in which normals are averaged over neighbours. Trial: prototype; noise of a vertex no longer counts as a bend.
const NORMAL_ROUNDS: usize = 4;
/// Least cost of a step, in diagonals. Guard: triangles whose middles coincide.
const LEAST_STEP: f64 = 1e-12;

/// A mesh with its tables.
#[derive(Debug)]
pub(crate) struct Surface<'a> {
    pub(crate) mesh: &'a Manifold,
    pub(crate) table: Adjacency,
    /// Per side: whether it is on a sharp line. Both sides of an edge agree; borders are not sharp.
    pub(crate) sharp: Vec<bool>,
    /// Middle of each triangle.
    pub(crate) middles: Vec<DVec3>,
    /// Area of each triangle.
    pub(crate) areas: Vec<f64>,
    /// Diagonal of the bounding box.
    pub(crate) diagonal: f64,
    /// Cost of the step over each side; infinite over sharp lines and borders.
    pub(crate) steps: Vec<f64>,
    /// Size of the cells at each triangle, relative to others. Lengths of arcs and widths of cells are compared in it.
    pub(crate) sizes: Vec<f64>,
}

/// The index as it is stored.
pub(crate) fn index(k: usize) -> u32 {
    u32::try_from(k).unwrap_or(NONE)
}

/// The side after this one in its triangle.
pub(crate) fn after(side: usize) -> usize {
    if side % 3 == 2 { side - 2 } else { side + 1 }
}

impl<'a> Surface<'a> {
    /// [`Error::Invalid`] if there is no triangle or if there are not three flags a triangle.
    pub(crate) fn new(mesh: &'a Manifold, sharp: &[bool]) -> Result<Self> {
        let count = mesh.triangles.len();
        if count == 0 {
            return Err(Error::invalid(
                "the mesh has no triangles; a layout needs at least one",
            ));
        }
        if sharp.len() != 3 * count {
            return Err(Error::invalid(format!(
                "{} flags of sharp sides for {count} triangles; give three for each triangle",
                sharp.len()
            )));
        }
        if mesh.points.iter().any(|p| !p.is_finite()) {
            return Err(Error::invalid("the mesh has vertices that are not finite"));
        }
        let table = mesh.adjacency();
        let sharp = (0..3 * count).map(|side| {
            let other = table.opposite[side];
            other != NONE && (sharp[side] || sharp[other as usize])
        });
        let low = mesh.points.iter().copied().reduce(DVec3::min);
        let high = mesh.points.iter().copied().reduce(DVec3::max);
        let extent = high.unwrap_or_default() - low.unwrap_or_default();
        let mut surface = Self {
            sharp: sharp.collect(),
            middles: (0..count)
                .map(|t| mesh.corners(t).iter().sum::<DVec3>() / 3.0)
                .collect(),
            areas: (0..count).map(|t| mesh.vector_area(t).length()).collect(),
            diagonal: extent.length(),
            steps: Vec::new(),
            sizes: vec![1.0; count],
            mesh,
            table,
        };
        surface.steps = surface.costs();
        Ok(surface)
    }

    /// Number of triangles.
    pub(crate) fn count(&self) -> usize {
        self.middles.len()
    }

    /// The vertices at the start and the end of a side.
    pub(crate) fn ends(&self, side: usize) -> [u32; 2] {
        let t = self.mesh.triangles[side / 3];
        [t[side % 3], t[(side + 1) % 3]]
    }

    /// The place of a vertex.
    pub(crate) fn place(&self, vertex: u32) -> DVec3 {
        self.mesh.points[vertex as usize]
    }

    /// The length of the side.
    pub(crate) fn length(&self, side: usize) -> f64 {
        let [a, b] = self.ends(side);
        self.place(a).distance(self.place(b))
    }

    /// The length of the side in the size of the cells there.
    pub(crate) fn relative_length(&self, side: usize) -> f64 {
        self.length(side) / self.sizes[side / 3]
    }

    /// The area of a triangle in the size of the cells there.
    pub(crate) fn relative_area(&self, t: usize) -> f64 {
        self.areas[t] / self.sizes[t].powi(2)
    }

    /// The triangle across a side, unless a sharp line or a border is between.
    pub(crate) fn across(&self, side: usize) -> Option<usize> {
        let other = self.table.opposite[side];
        (other != NONE && !self.sharp[side]).then_some(other as usize / 3)
    }

    /// The costs of all steps.
    fn costs(&self) -> Vec<f64> {
        let count = self.count();
        let mut normals: Vec<DVec3> = (0..count).map(|t| self.mesh.vector_area(t)).collect();
        for _ in 0..NORMAL_ROUNDS {
            let mean = |t: usize| {
                let beside = (3 * t..3 * t + 3).filter_map(|side| self.across(side));
                normals[t] + beside.map(|o| normals[o]).sum::<DVec3>()
            };
            normals = (0..count).map(mean).collect();
        }
        for n in &mut normals {
            *n = n.normalize_or_zero();
        }
        let cost = |side: usize| match self.across(side) {
            Some(o) => {
                let t = side / 3;
                let turn = math::acos(normals[t].dot(normals[o]).clamp(-1.0, 1.0));
                let way = self.middles[t].distance(self.middles[o]);
                way + (BEND * turn + LEAST_STEP) * self.diagonal + f64::MIN_POSITIVE
            }
            None => f64::INFINITY,
        };
        (0..3 * count).map(cost).collect()
    }
}

//! Feature lines: the edges of a mesh along which the surface bends sharply.
//!
//! 1. `bend`: the bend of each edge is the angle between the mean normals of two strips, two spacings deep, left and
//!    right of it. Noise averages out there, and a fillet of small radius bends as a sharp edge does.
//! 2. Edges whose own dihedral angle makes up the bend and stands clear of the noise are taken as they are: the edges
//!    of a CAD mesh. The strips of other edges end there.
//! 3. `thin`: on a scan several edges bend beside each other. Their triangles form a band; collapsing it from its
//!    borders, weakest edges first, leaves a path one edge wide with the same connections, on the ridge of the bend.
//! 4. `chains`: short spurs are cut, paths are straightened within the band, and chains are kept by hysteresis, by
//!    length, and where their bend stands clear of that of the rest of the mesh.
//!
//! Sources: C. Rössl, L. Kobbelt, H.-P. Seidel, *Extraction of feature lines on triangulated surfaces using
//! morphological operators*, AAAI Smart Graphics 2000 (band and skeleton); J. H. C. Whitehead, *Simplicial spaces,
//! nuclei and m-groups*, 1939 (collapse keeps the connections).

mod bend;
mod chains;
#[cfg(test)]
mod tests;
mod thin;

use bend::Bends;
use chains::Chains;
use glam::DVec3;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_scan::mesh::Manifold;
use nurbskin_scan::mesh::manifold::{Adjacency, NONE};

/// Bend in degrees above which a line begins. Source: the issue, as the prototype. Trial: 40 on fandisk.
const STRONG: f64 = 40.0;
/// Bend in degrees above which a line goes on. Source: the issue, as the prototype. Trial: 25 on fandisk.
const WEAK: f64 = 25.0;
/// Least total length of connected lines, as a share of the diagonal. Source: the issue. Trial: 0.06 on fandisk.
const MIN_LENGTH: f64 = 0.06;
/// Bend in degrees above which a surface bends by more than the faces of a machined part do. Derived: a radius of eight
/// spacings, over the two that a strip is deep.
const BENT: f64 = 15.0;
/// How far the bend of a line stands above the median bend of the mesh. Source: the issue.
const ABOVE_REST: f64 = 3.0;

/// Standard deviation of a bend in radians, per standard deviation of the noise in spacings. Derived: the slope of a
/// plane through the seven points of a strip two spacings deep, √12 / (2 √7), times √2 for two strips.
const TILT: f64 = 0.92;

/// Which edges count as sharp.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Sharp {
    /// Lines begin where the surface bends by more than 40 degrees.
    #[default]
    Auto,
    /// There are no lines.
    Off,
    /// Lines begin where the surface bends by more than this, in degrees.
    Degrees(f64),
}

/// The feature lines of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FeatureLines {
    /// By side (3 t + s) of the mesh, whether it lies on a line; the two sides of an edge agree.
    pub sides: Vec<bool>,
    /// Number of pieces between ends and junctions; closed lines count once.
    pub chains: usize,
    /// Total length, in the unit of the mesh.
    pub length: f64,
    /// What was left out, a sentence each, for the user.
    pub notes: Vec<String>,
}

/// Finds the feature lines of a mesh whose points are `spacing` apart and scatter by `noise` (a standard deviation)
/// across the surface, all in the unit of the mesh. A spacing that is not positive is replaced by the median edge.
///
/// A line that fades out ends where the bend falls below 25 degrees. Borders are no lines. Noise raises the bend at which
/// lines begin, except at edges that are creases by themselves. Up to 0.1 ms per triangle and core. The result does not depend on the number of threads.
#[must_use]
pub fn feature_lines(mesh: &Manifold, spacing: f64, noise: f64, sharp: Sharp) -> FeatureLines {
    let none = FeatureLines {
        sides: vec![false; 3 * mesh.triangles.len()],
        ..FeatureLines::default()
    };
    let strong = match sharp {
        Sharp::Off => return none,
        Sharp::Auto => STRONG,
        Sharp::Degrees(angle) if angle.is_finite() => angle.max(0.0),
        Sharp::Degrees(_) => STRONG,
    };
    let surface = Surface::new(mesh, spacing, noise);
    if surface.edges.is_empty() {
        return none;
    }
    let limits = Limits {
        exact: strong.to_radians(),
        strong: math::hypot(
            strong.to_radians(),
            2.0 * TILT * surface.noise / surface.spacing,
        ),
        weak: WEAK.min(strong).to_radians(),
        bent: (sharp == Sharp::Auto).then_some(math::hypot(
            BENT.to_radians(),
            3.0 * TILT * surface.noise / surface.spacing,
        )),
    };
    let bends = Bends::new(&surface, limits.weak);
    let skeleton = thin::skeleton(&surface, &bends, limits.weak);
    let chains = Chains::new(&surface, &bends, &limits, skeleton);
    chains.lines(none)
}

/// Angles in radians above which lines begin and go on.
struct Limits {
    /// For exact creases.
    exact: f64,
    /// For all others: the scatter of bends by noise is added.
    strong: f64,
    weak: f64,
    /// Above which an edge needs a line as its cause; the scatter is added threefold. [`None`]: every line stays.
    bent: Option<f64>,
}

/// A mesh, its inner edges and the lengths that matter.
struct Surface<'a> {
    mesh: &'a Manifold,
    adjacency: Adjacency,
    /// For each inner edge the smaller of its two sides.
    edges: Vec<u32>,
    /// For each side its edge, or [`NONE`] at a border.
    edge_of: Vec<u32>,
    /// Unit normals of the triangles; zero for those without area.
    normals: Vec<DVec3>,
    spacing: f64,
    /// For each edge the spacing, or the size of the triangles beside it if that is larger.
    reach: Vec<f64>,
    noise: f64,
    diagonal: f64,
}

impl<'a> Surface<'a> {
    fn new(mesh: &'a Manifold, spacing: f64, noise: f64) -> Self {
        let adjacency = mesh.adjacency();
        let mut edges = Vec::with_capacity(adjacency.opposite.len() / 2);
        let mut edge_of = vec![NONE; adjacency.opposite.len()];
        for (side, &other) in (0_u32..).zip(&adjacency.opposite) {
            if other != NONE && side < other {
                let edge = u32::try_from(edges.len()).unwrap_or(NONE);
                edge_of[side as usize] = edge;
                edge_of[other as usize] = edge;
                edges.push(side);
            }
        }
        let normals = (0..mesh.triangles.len())
            .map(|t| mesh.vector_area(t).normalize_or_zero())
            .collect();
        let mut finite = mesh.points.iter().filter(|p| p.is_finite());
        let first = finite.next().copied().unwrap_or_default();
        let (low, high) = finite.fold((first, first), |(l, h), p| (l.min(*p), h.max(*p)));
        let mut surface = Self {
            mesh,
            adjacency,
            edges,
            edge_of,
            normals,
            spacing,
            reach: Vec::new(),
            noise: if noise > 0.0 { noise } else { 0.0 },
            diagonal: low.distance(high),
        };
        // The side of an equilateral triangle of the height across the longest side: the width of needles.
        let width = |t: usize| {
            let [a, b, c] = mesh.corners(t);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let width = 2.0 * mesh.vector_area(t).length() / longest / (0.75_f64).sqrt();
            if width.is_finite() { width } else { 0.0 }
        };
        let widths: Vec<f64> = (0..mesh.triangles.len()).map(width).collect();
        let usable = if spacing.is_finite() { spacing } else { 0.0 };
        surface.spacing = usable
            .max(median_in_place(&mut widths.clone()))
            .max(f64::MIN_POSITIVE);
        let reach = |e: usize| {
            let [a, b] = surface.beside(e);
            surface.spacing.max(0.5 * (widths[a] + widths[b]))
        };
        surface.reach = (0..surface.edges.len()).map(reach).collect();
        surface
    }

    /// The vertices of a side, in its direction.
    fn ends_of_side(&self, side: u32) -> [u32; 2] {
        let (t, s) = (side as usize / 3, side as usize % 3);
        let corners = self.mesh.triangles[t];
        [corners[s], corners[(s + 1) % 3]]
    }

    fn ends(&self, edge: usize) -> [u32; 2] {
        self.ends_of_side(self.edges[edge])
    }

    fn points(&self, edge: usize) -> [DVec3; 2] {
        self.ends(edge).map(|v| self.mesh.points[v as usize])
    }

    fn length(&self, edge: usize) -> f64 {
        let [a, b] = self.points(edge);
        a.distance(b)
    }

    /// The triangles beside an edge: that of its smaller side first.
    fn beside(&self, edge: usize) -> [usize; 2] {
        let side = self.edges[edge];
        [
            side as usize / 3,
            self.adjacency.opposite[side as usize] as usize / 3,
        ]
    }
    /// The vertices joined to a vertex by inner edges, with the edges.
    fn around(&self, vertex: u32) -> impl Iterator<Item = (u32, usize)> + '_ {
        self.adjacency.fan(vertex).filter_map(move |side| {
            let edge = self.edge_of[side as usize];
            (edge != NONE).then(|| (self.ends_of_side(side)[1], edge as usize))
        })
    }

    /// Of some edges those that are connected to a total length of at least `least` diagonals with a strong edge.
    fn long_enough(
        &self,
        mut on: Vec<bool>,
        least: f64,
        is_strong: impl Fn(usize) -> bool,
    ) -> Vec<bool> {
        let mut sets = DisjointSets::new(self.mesh.points.len());
        for e in (0..on.len()).filter(|&e| on[e]) {
            let [a, b] = self.ends(e);
            sets.join(a as usize, b as usize);
        }
        let mut length = vec![0.0; self.mesh.points.len()];
        let mut strong = vec![false; length.len()];
        for e in (0..on.len()).filter(|&e| on[e]) {
            let root = sets.root(self.ends(e)[0] as usize);
            length[root] += self.length(e);
            strong[root] |= is_strong(e);
        }
        for (e, on) in on.iter_mut().enumerate() {
            let root = sets.root(self.ends(e)[0] as usize);
            *on &= strong[root] && length[root] > least * self.diagonal;
        }
        on
    }
}

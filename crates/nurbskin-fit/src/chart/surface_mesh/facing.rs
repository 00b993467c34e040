//! Normals of a charted mesh: on its triangles, at its rims, and a little beyond.
//!
//! Beyond a ragged rim no triangle holds the surface, and a fit may turn over there. Places across the rim therefore
//! take the normal `S_u × S_v` of the vertices next to them. The two slopes at a vertex are those of least squares over
//! the vertices `p_j` in two rings around it:
//!
//! ```text
//! minimise sum |S_u Δu_j + S_v Δv_j - (p_j - p)|²
//! ```
//!
//! Source: ours.

use super::chart::MeshChart;
use glam::{DMat2, DVec2, DVec3};
use nurbskin_scan::mesh::Manifold;
use nurbskin_scan::mesh::manifold::Adjacency;

/// Rings of triangles around a vertex of a rim from which its slopes are estimated. Trial: not recorded. One ring
/// follows the noise of the rim, many average over bends.
const SLOPE_RINGS: usize = 2;
/// Most vertices for that estimate. Guard: fans of thousands of triangles occur.
const MAX_SLOPE_VERTICES: usize = 64;
/// Places between two vertices of a rim, and in a step across it. Trial: not recorded.
const PLACES_PER_STEP: u32 = 4;
/// Distance inside a rim, in steps, over which it is taken to face the same way. Trial: not recorded.
const INNER_STEPS: f64 = 1.0;
/// Widest strip outside a rim, in steps, that still belongs to the surface. Trial: not recorded.
const OUTER_STEPS: f64 = 3.0;
/// Determinant of the normal equations, as a share of the product of their diagonal, at which vertices lie on a line.
/// Guard: rounding leaves none smaller.
const SINGULAR_DETERMINANT: f64 = 1e-6;

/// A vertex of a rim: (u, v), `S_u` and `S_v`.
#[derive(Clone, Copy, Debug)]
struct AtRim {
    at: DVec2,
    slopes: [DVec3; 2],
}

impl MeshChart {
    /// Places (u, v) on and across the rims, a quarter of a step apart, each with the unit normal of the surface next
    /// to it. They reach from one `step` (a length) inside a rim to the end of the domain, where teeth and notches
    /// leave strips without triangles; strips wider than three steps get none. `mesh` is the charted mesh. O(n log n)
    /// for its sides; empty for a mesh without rims.
    ///
    /// ```
    /// use nurbskin_fit::chart::surface_mesh::chart_of_mesh;
    /// use nurbskin_geometry::DVec3;
    /// use nurbskin_scan::mesh::Manifold;
    /// use nurbskin_geometry::progress::Silent;
    /// // A square of 5 x 5 vertices.
    /// let points: Vec<DVec3> = (0..25).map(|k| DVec3::new(f64::from(k % 5), f64::from(k / 5), 0.0)).collect();
    /// let cells = (0..16_u32).map(|k| k % 4 + k / 4 * 5);
    /// let triangles: Vec<[u32; 3]> = cells.flat_map(|k| [[k, k + 1, k + 5], [k + 1, k + 6, k + 5]]).collect();
    /// let border = vec![0, 1, 2, 3, 4, 9, 14, 19, 24, 23, 22, 21, 20, 15, 10, 5];
    /// let mesh = Manifold { source: vec![None; 25], points, triangles, loops: vec![border] };
    /// let chart = chart_of_mesh(&mesh, &Silent)?;
    /// let facing = chart.facing_at_rims(&mesh, 1.0);
    /// assert!(facing.len() > 16 && facing.iter().all(|(_, normal)| normal.z > 0.999));
    /// # Ok::<(), nurbskin_geometry::Error>(())
    /// ```
    #[must_use]
    pub fn facing_at_rims(&self, mesh: &Manifold, step: f64) -> Vec<(DVec2, DVec3)> {
        if mesh.loops.is_empty() {
            return Vec::new();
        }
        let adjacency = mesh.adjacency();
        let mut around = Vec::new();
        let mut out = Vec::new();
        for rim in &mesh.loops {
            let mut at_rim = |&k: &u32| {
                near(mesh, &adjacency, k, &mut around);
                let slopes = self.slopes(mesh, k, &around)?;
                let at = self.places[k as usize];
                Some(AtRim { at, slopes })
            };
            let vertices: Vec<Option<AtRim>> = rim.iter().map(&mut at_rim).collect();
            let next = vertices.iter().cycle().skip(1);
            for pair in vertices.iter().zip(next) {
                if let (Some(one), Some(other)) = pair {
                    self.across(one, other, step, &mut out);
                }
            }
        }
        out
    }

    /// The middles (u, v) of the first `count` triangles of the charted mesh, with their unit normals; triangles
    /// without area are left out. O(n).
    #[must_use]
    pub fn facing(&self, mesh: &Manifold, count: usize) -> Vec<(DVec2, DVec3)> {
        let triangles = (0..count.min(mesh.triangles.len())).zip(&self.corners);
        let each = |(t, at): (usize, &[DVec2; 3])| {
            let normal = mesh.vector_area(t).try_normalize()?;
            Some((self.topology.within((at[0] + at[1] + at[2]) / 3.0), normal))
        };
        triangles.filter_map(each).collect()
    }

    /// Places across a rim between two consecutive vertices.
    fn across(&self, one: &AtRim, other: &AtRim, step: f64, out: &mut Vec<(DVec2, DVec3)>) {
        let closed = self.topology.closed();
        let mut way = other.at - one.at;
        for d in (0..2).filter(|&d| closed[d]) {
            way[d] -= way[d].round();
        }
        for k in 0..PLACES_PER_STEP {
            let part = f64::from(k) / f64::from(PLACES_PER_STEP);
            let slopes = [0, 1].map(|d| one.slopes[d].lerp(other.slopes[d], part));
            let Some(normal) = slopes[0].cross(slopes[1]).try_normalize() else {
                continue;
            };
            let at = one.at + part * way;
            for d in (0..2).filter(|&d| !closed[d]) {
                let quarter = step / f64::from(PLACES_PER_STEP) / slopes[d].length();
                for (end, sense) in [(0.0, -1.0), (1.0, 1.0)] {
                    let strip = sense * (end - at[d]) / quarter;
                    if strip > OUTER_STEPS * f64::from(PLACES_PER_STEP) || strip.is_nan() {
                        continue;
                    }
                    let mut j = -INNER_STEPS * f64::from(PLACES_PER_STEP);
                    while j < strip + 1.0 {
                        let mut to = at;
                        to[d] += sense * quarter * j.min(strip);
                        out.push((self.topology.within(to), normal));
                        j += 1.0;
                    }
                }
            }
        }
    }

    /// `S_u` and `S_v` at vertex k by least squares over the vertices around it; `None` if these lie on a line.
    fn slopes(&self, mesh: &Manifold, k: u32, around: &[u32]) -> Option<[DVec3; 2]> {
        let closed = self.topology.closed();
        let (mut squares, mut right) = (DMat2::ZERO, [DVec3::ZERO; 2]);
        for &j in around {
            let mut t = self.places[j as usize] - self.places[k as usize];
            for d in (0..2).filter(|&d| closed[d]) {
                t[d] -= t[d].round();
            }
            let p = mesh.points[j as usize] - mesh.points[k as usize];
            squares += DMat2::from_cols(t.x * t, t.y * t);
            right[0] += t.x * p;
            right[1] += t.y * p;
        }
        if squares.determinant() <= SINGULAR_DETERMINANT * squares.x_axis.x * squares.y_axis.y {
            return None;
        }
        let inverse = squares.inverse();
        Some([0, 1].map(|d| inverse.col(0)[d] * right[0] + inverse.col(1)[d] * right[1]))
    }
}

/// A vertex and its neighbours within two rings of triangles, limited in number.
fn near(mesh: &Manifold, adjacency: &Adjacency, vertex: u32, around: &mut Vec<u32>) {
    around.clear();
    around.push(vertex);
    let mut from = 0;
    for _ in 0..SLOPE_RINGS {
        if around.len() >= MAX_SLOPE_VERTICES {
            break;
        }
        let to = around.len();
        for i in from..to {
            for side in adjacency.fan(around[i]) {
                for k in mesh.triangles[side as usize / 3] {
                    if around.len() < MAX_SLOPE_VERTICES && !around.contains(&k) {
                        around.push(k);
                    }
                }
            }
        }
        from = to;
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may stop")]
mod tests {
    use super::*;
    use crate::chart::surface_mesh::chart_of_mesh;
    use nurbskin_geometry::progress::Silent;

    /// A tube of radius 1 and length 3, every other vertex of whose upper rim is missing half a row.
    fn tube() -> Manifold {
        let (around, along) = (32_u32, 16_u32);
        let point = |k: u32| {
            let (i, j) = (k % around, k / around);
            let notch = if j == along - 1 && i % 2 == 0 {
                0.5
            } else {
                0.0
            };
            let angle = f64::from(i) / f64::from(around) * std::f64::consts::TAU;
            DVec3::new(angle.cos(), angle.sin(), 0.2 * (f64::from(j) - notch))
        };
        let cell = |k: u32| {
            let (a, b) = (k, k / around * around + (k + 1) % around);
            [[a, b, a + around], [b, b + around, a + around]]
        };
        let last = around * (along - 1);
        Manifold {
            points: (0..around * along).map(point).collect(),
            source: vec![None; (around * along) as usize],
            triangles: (0..last).flat_map(cell).collect(),
            loops: vec![(last..last + around).rev().collect(), (0..around).collect()],
        }
    }

    #[test]
    fn a_tube_faces_outwards_on_and_across_its_rims() {
        let mesh = tube();
        let chart = chart_of_mesh(&mesh, &Silent).unwrap();
        let rims = chart.facing_at_rims(&mesh, 0.2);
        let inside = chart.facing(&mesh, mesh.triangles.len());
        assert_eq!(inside.len(), mesh.triangles.len());
        // Where a place lies around the tube its nearest triangle tells.
        for (at, normal) in &rims {
            let apart = |other: &DVec2| {
                let step = at.y - other.y;
                (at.x - other.x).hypot(step - step.round())
            };
            let nearest = (inside.iter()).min_by(|a, b| apart(&a.0).total_cmp(&apart(&b.0)));
            assert!(normal.dot(nearest.unwrap().1) > 0.95, "{at} {normal}");
        }
        // To both ends of the domain, and around.
        for end in [0.0, 1.0] {
            let at_end = rims.iter().filter(|f| (f.0.x - end).abs() < 1e-9);
            assert!(at_end.count() >= 32);
        }
        let quarter = |k: f64| rims.iter().any(|f| (f.0.y - 0.25 * k - 0.1).abs() < 0.1);
        assert!([0.0, 1.0, 2.0, 3.0].into_iter().all(quarter));
    }
}

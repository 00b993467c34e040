//! Which way a surface faces: on its triangles, at its rims and beyond them.

use super::chart::MeshChart;
use glam::{DMat2, DVec2, DVec3};
use nurbskin_scan::mesh::Manifold;
use nurbskin_scan::mesh::manifold::Adjacency;

/// Rings of triangles around a vertex of a rim that say which way it faces.
const RINGS: usize = 2;
/// So many vertices say enough, where a fan of thousands meets.
const MOST_AROUND: usize = 64;
/// Places between two vertices of a rim, and in a step across it.
const EACH: u32 = 4;
/// So many steps inside a rim it still faces the same way, ...
const INSIDE: f64 = 1.0;
/// ... and strips beyond it that are wider than so many are no part of the surface.
const OUTSIDE: f64 = 3.0;
/// Rounding leaves no determinant smaller than this part of the product of the squares.
const SINGULAR: f64 = 1e-6;

/// A vertex of a rim: (u, v), `S_u` and `S_v`.
#[derive(Clone, Copy, Debug)]
struct AtRim {
    at: DVec2,
    slopes: [DVec3; 2],
}

impl MeshChart {
    /// Places (u, v) in and across the rims, each with the unit normal of the surface beside it: from a `step`, a length,
    /// inside them to the end of the domain, where teeth and notches leave strips without triangles; none where the end is
    /// farther than three steps. A quarter of a step apart. `mesh` is the one that was charted. O(n log n) for its sides;
    /// nothing where it has no rims.
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

    /// The middles (u, v) of the first `count` triangles of the mesh that was charted, with their unit normals; none of
    /// triangles without area. O(n).
    #[must_use]
    pub fn facing(&self, mesh: &Manifold, count: usize) -> Vec<(DVec2, DVec3)> {
        let triangles = (0..count.min(mesh.triangles.len())).zip(&self.corners);
        let each = |(t, at): (usize, &[DVec2; 3])| {
            let normal = mesh.vector_area(t).try_normalize()?;
            Some((self.topology.within((at[0] + at[1] + at[2]) / 3.0), normal))
        };
        triangles.filter_map(each).collect()
    }

    /// Places across a rim on the way from one of its vertices to the next.
    fn across(&self, one: &AtRim, other: &AtRim, step: f64, out: &mut Vec<(DVec2, DVec3)>) {
        let closed = self.topology.closed();
        let mut way = other.at - one.at;
        for d in (0..2).filter(|&d| closed[d]) {
            way[d] -= way[d].round();
        }
        for k in 0..EACH {
            let part = f64::from(k) / f64::from(EACH);
            let slopes = [0, 1].map(|d| one.slopes[d].lerp(other.slopes[d], part));
            let Some(normal) = slopes[0].cross(slopes[1]).try_normalize() else {
                continue;
            };
            let at = one.at + part * way;
            for d in (0..2).filter(|&d| !closed[d]) {
                let quarter = step / f64::from(EACH) / slopes[d].length();
                for (end, sense) in [(0.0, -1.0), (1.0, 1.0)] {
                    let strip = sense * (end - at[d]) / quarter;
                    if strip > OUTSIDE * f64::from(EACH) || strip.is_nan() {
                        continue;
                    }
                    let mut j = -INSIDE * f64::from(EACH);
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

    /// `S_u` and `S_v` at vertex k by least squares over the vertices around it; `None` where they lie on a line.
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
        if squares.determinant() <= SINGULAR * squares.x_axis.x * squares.y_axis.y {
            return None;
        }
        let inverse = squares.inverse();
        Some([0, 1].map(|d| inverse.col(0)[d] * right[0] + inverse.col(1)[d] * right[1]))
    }
}

/// A vertex and those within two rings of triangles around it, the first so many.
fn near(mesh: &Manifold, adjacency: &Adjacency, vertex: u32, around: &mut Vec<u32>) {
    around.clear();
    around.push(vertex);
    let mut from = 0;
    for _ in 0..RINGS {
        if around.len() >= MOST_AROUND {
            break;
        }
        let to = around.len();
        for i in from..to {
            for side in adjacency.fan(around[i]) {
                for k in mesh.triangles[side as usize / 3] {
                    if around.len() < MOST_AROUND && !around.contains(&k) {
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

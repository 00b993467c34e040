//! Untangles a mesh that passes through itself: eyelids, lips and folds of merged scans.
//!
//! ```text
//! vertices that cross ─▶ one smoothing step of them and those beside them ─▶ crossings … until there are none
//!                                      └─▶ back towards their places, a step … until they cross again
//! ```
//!
//! A step moves a vertex p by a part of the umbrella vector, the mean of its neighbours less p. Folds shrink, and the sheets on both
//! sides of a gap part. Most vertices that moved could have stayed nearer to their places, and return as far as nothing crosses.
//! Sheets are to be a clearance apart in the end: the mesh, and the same mesh moved by half of it along its normals, either way, do
//! not pass through themselves there.
//!
//! Source: G. Taubin, *A signal processing approach to fair surface design*, SIGGRAPH 1995 (the umbrella); the rest is ours.

use super::Manifold;
use super::crossings::{box_of, crossed, crossed_among};
use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::progress::Progress;

/// Part of the umbrella vector that a vertex moves by in a step. Dimensionless.
/// Trial: 0.1, 0.3 and 0.5 on a head, of whose 8834 vertices 213 cross: 27, 24 and 26 end more than 0.05 % of its diagonal off their
/// places, after 0.28, 0.21 and 0.19 s.
const STEP: f64 = 0.3;
/// Most steps. Count. Guard: bounds the time; five to twelve untangle the scans at hand.
const MOST_STEPS: usize = 64;
/// Steps after which one more ring of vertices moves along. Count.
/// Guard: a tangle that does not come apart needs more room.
const WIDER_AFTER: usize = 16;
/// Part of the way back to its place that a vertex moves by in a step. Dimensionless.
/// Trial: 0.1, 0.15 and 0.3 on that head, in 60, 30 and 20 steps: 24, 24 and 30 vertices end more than 0.05 % off.
const RETURN: f64 = 0.15;
/// Most steps back. Count. Derived: a vertex that may move all the way ends within 1 % of it, as 0.85^30 = 0.008.
const MOST_RETURNS: usize = 30;
/// Most rounds of undoing in a step back, as undoing some vertices may make others cross. Count. Guard: bounds the time.
const MOST_UNDONE: usize = 8;
/// Share of the vertices that may cross at first. Dimensionless.
/// Guard: a mesh that is noise all over cannot be untangled in place. Of the head 2.4 % of the vertices cross, of a can 3.2 %.
const MOST_CROSSED: f64 = 0.1;
/// Largest clearance, in lengths of a typical edge.
/// Guard: folds of the mesh moved along its normals are no crossings of sheets as long as it moves by far less than an edge.
const MOST_CLEARANCE: f64 = 0.2;

/// Places of the vertices at which a mesh no longer passes through itself, with its sheets `clearance` apart where they crossed.
/// Vertices away from such places stay. `None` if the mesh does not pass through itself, or cannot be untangled: more than a tenth of
/// its vertices cross, or some still do after 64 steps.
///
/// `clearance` is in the unit of the points; a fifth of the median edge at most counts. O(n log n) for each step, on all cores; a mesh of
/// 9000 vertices takes 0.2 s.
///
/// # Errors
/// [`Error::Cancelled`](nurbskin_geometry::Error::Cancelled).
pub fn untangled(
    mesh: &Manifold,
    clearance: f64,
    progress: &dyn Progress,
) -> Result<Option<Vec<DVec3>>> {
    let region = crossed(mesh);
    let count = region.iter().filter(|crosses| **crosses).count();
    if count == 0 || count as f64 > MOST_CROSSED * region.len() as f64 {
        return Ok(None);
    }
    let mut tangle = Tangle {
        umbrella: umbrellas(mesh),
        mesh: mesh.clone(),
        region,
        clearance: clearance.min(MOST_CLEARANCE * typical_edge(mesh)),
        progress,
    };
    if tangle.even_out()? {
        tangle.go_back(&mesh.points)?;
    } else {
        // Where there is no room for the clearance, sheets that only come close will do, and stay where they are.
        tangle.clearance = 0.0;
        if tangle.crossed().contains(&true) {
            return Ok(None);
        }
    }
    Ok(Some(tangle.mesh.points))
}

/// The median length of the sides of the triangles.
fn typical_edge(mesh: &Manifold) -> f64 {
    let sides = (0..mesh.triangles.len()).flat_map(|t| {
        let [a, b, c] = mesh.corners(t);
        [a.distance(b), b.distance(c), c.distance(a)]
    });
    median_in_place(&mut sides.collect::<Vec<f64>>())
}

/// A mesh under way.
struct Tangle<'a> {
    mesh: Manifold,
    /// The neighbours of each vertex; those along the border where it is on one.
    umbrella: Vec<Vec<u32>>,
    /// The vertices that have moved, or cross.
    region: Vec<bool>,
    clearance: f64,
    progress: &'a dyn Progress,
}

impl Tangle<'_> {
    /// Moves vertices that cross, and those around them, until none do. Returns false if some still do, or are too close, after the last step.
    fn even_out(&mut self) -> Result<bool> {
        for step in 0..MOST_STEPS {
            self.progress.check()?;
            let mut moving = self.crossed();
            if !moving.contains(&true) {
                return Ok(true);
            }
            for _ in 0..=step / WIDER_AFTER {
                moving = self.with_neighbours(&moving);
            }
            let before = self.mesh.points.clone();
            for v in (0..moving.len()).filter(|&v| moving[v]) {
                let ring = &self.umbrella[v];
                let sum: DVec3 = ring.iter().map(|&w| before[w as usize]).sum();
                let middle = sum / ring.len().max(1) as f64;
                self.mesh.points[v] = before[v].lerp(middle, STEP);
                self.region[v] = true;
            }
        }
        Ok(!self.crossed().contains(&true))
    }

    /// Moves vertices back towards their places, as far as nothing crosses.
    fn go_back(&mut self, places: &[DVec3]) -> Result<()> {
        let mut held = vec![false; places.len()];
        for _ in 0..MOST_RETURNS {
            let before = self.mesh.points.clone();
            let free = |v: &usize| self.region[*v] && !held[*v];
            let moving: Vec<usize> = (0..places.len()).filter(free).collect();
            if moving.is_empty() {
                break;
            }
            for &v in &moving {
                self.mesh.points[v] = before[v].lerp(places[v], RETURN);
            }
            let mut still = true;
            for round in 0..MOST_UNDONE {
                self.progress.check()?;
                let mut undone = self.crossed();
                still = undone.contains(&true);
                if !still {
                    break;
                }
                for _ in 0..round / 2 {
                    undone = self.with_neighbours(&undone);
                }
                for v in (0..undone.len()).filter(|&v| undone[v]) {
                    self.mesh.points[v] = before[v];
                    held[v] = true;
                }
            }
            if still {
                self.mesh.points = before;
                break;
            }
        }
        Ok(())
    }

    /// The vertices of the region that are too close to another sheet, or beyond it, and those of that sheet.
    fn crossed(&self) -> Vec<bool> {
        let Self { mesh, region, .. } = self;
        let is_in = |t: usize| mesh.triangles[t].iter().any(|&v| region[v as usize]);
        let near = self.near_region();
        let normals = mesh.normals();
        let mut found = vec![false; region.len()];
        for side in [0.0, 0.5, -0.5] {
            let off = side * self.clearance;
            let place = |(p, n): (&DVec3, &DVec3)| *p + off * *n;
            let places: Vec<DVec3> = mesh.points.iter().zip(&normals).map(place).collect();
            let these = crossed_among(&places, &mesh.triangles, &near, is_in);
            found.iter_mut().zip(these).for_each(|(f, t)| *f |= t);
        }
        found
    }

    /// The triangles that may come close to those of the region.
    fn near_region(&self) -> Vec<usize> {
        let Self { mesh, region, .. } = self;
        let all = 0..mesh.triangles.len();
        let is_in = |t: &usize| mesh.triangles[*t].iter().any(|&v| region[v as usize]);
        let around = |t: usize| box_of(mesh.corners(t));
        let first = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let [low, high] = all
            .clone()
            .filter(is_in)
            .map(around)
            .fold(first, |[l, h], [a, b]| [l.min(a), h.max(b)]);
        let margin = DVec3::splat(self.clearance);
        let (low, high) = (low - margin, high + margin);
        let meets = |t: &usize| {
            let [a, b] = around(*t);
            a.cmple(high).all() && b.cmpge(low).all()
        };
        all.filter(meets).collect()
    }

    /// These vertices and their neighbours.
    fn with_neighbours(&self, flags: &[bool]) -> Vec<bool> {
        let beside = |ring: &Vec<u32>| ring.iter().any(|&w| flags[w as usize]);
        let pairs = flags.iter().zip(&self.umbrella);
        pairs.map(|(flag, ring)| *flag || beside(ring)).collect()
    }
}

/// The neighbours of each vertex, ascending; of one on a border the two along it.
fn umbrellas(mesh: &Manifold) -> Vec<Vec<u32>> {
    let mut rings = vec![Vec::new(); mesh.points.len()];
    for &[a, b, c] in &mesh.triangles {
        for (from, to) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
            rings[from as usize].extend(to);
        }
    }
    for ring in &mut rings {
        ring.sort_unstable();
        ring.dedup();
    }
    for border in &mesh.loops {
        let (next, last) = (border.iter().cycle().skip(1), border.iter().cycle());
        let last = last.skip(border.len().saturating_sub(1));
        for (vertex, (next, last)) in border.iter().zip(next.zip(last)) {
            rings[*vertex as usize] = vec![*last, *next];
        }
    }
    rings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::crossings::tests::sphere;
    use glam::DQuat;
    use nurbskin_geometry::progress::Silent;

    /// A sphere with a groove along its equator, whose lips meet, and pass `depth` through each other on a quarter of its length.
    fn grooved(depth: f64) -> Manifold {
        let mut mesh = sphere([60, 80]);
        let lips = |p: DVec3| {
            // The groove is 0.1 wide at the lips and wider inside: at the equator the sphere falls in.
            let fall = 0.3 * (-(p.z / 0.12).powi(2)).exp();
            let flat = p.with_z(0.0).normalize_or_zero();
            let along = (2.0 * p.y.atan2(p.x)).cos().max(0.0);
            let lean = depth * along * p.z.signum() * (-((p.z.abs() - 0.16) / 0.06).powi(2)).exp();
            // Turned by half a side, so that edges do not meet edges.
            let turn = DQuat::from_rotation_z(if p.z < 0.0 { 0.05 } else { 0.0 });
            turn * (p - fall * flat - DVec3::Z * lean)
        };
        mesh.points = mesh.points.into_iter().map(lips).collect();
        mesh
    }

    #[test]
    fn a_mesh_that_does_not_cross_stays() {
        assert_eq!(untangled(&grooved(0.0), 1e-3, &Silent).unwrap(), None);
    }

    #[test]
    fn lips_that_pass_through_each_other_come_apart() {
        for depth in [0.2, 0.3] {
            let mesh = grooved(depth);
            let before = crossed(&mesh);
            let count = before.iter().filter(|c| **c).count();
            assert!(count > 20, "{count}");
            for clearance in [0.0, 2e-3] {
                let mut apart = mesh.clone();
                apart.points = untangled(&mesh, clearance, &Silent).unwrap().unwrap();
                let normals = apart.normals();
                for side in [0.0, 0.49, -0.49] {
                    let mut moved = apart.clone();
                    for (p, n) in moved.points.iter_mut().zip(&normals) {
                        *p += side * clearance * *n;
                    }
                    assert!(
                        !crossed(&moved).contains(&true),
                        "{depth} {clearance} {side}"
                    );
                }
                // They go a part of the way back, and the rest of the sphere stays.
                let pairs = mesh.points.iter().zip(&apart.points);
                let far = pairs
                    .clone()
                    .map(|(a, b)| a.distance(*b))
                    .fold(0.0, f64::max);
                assert!(far < 0.6 * depth, "{far}");
                let stayed = pairs.filter(|(a, b)| a == b).count();
                assert!(stayed > mesh.points.len() / 2, "{stayed}");
            }
        }
    }

    #[test]
    fn a_mesh_that_is_a_tangle_all_over_stays() {
        let mut mesh = grooved(0.0);
        for (k, p) in mesh.points.iter_mut().enumerate() {
            *p += [DVec3::X, DVec3::Y, -DVec3::ONE][k * k % 7 % 3];
        }
        assert!(crossed(&mesh).contains(&true));
        assert_eq!(untangled(&mesh, 1e-3, &Silent).unwrap(), None);
    }

    #[test]
    fn a_clearance_is_less_than_an_edge() {
        let mesh = grooved(0.2);
        let places = untangled(&mesh, 10.0, &Silent).unwrap().unwrap();
        let pairs = mesh.points.iter().zip(&places);
        let stayed = pairs.filter(|(a, b)| a == b).count();
        assert!(stayed > mesh.points.len() / 2, "{stayed}");
    }

    #[test]
    fn a_vertex_that_went_through_the_other_side_comes_back() {
        let mut mesh = sphere([40, 20]);
        let k = mesh.points.iter().position(|p| p.x > 0.95).unwrap();
        mesh.points[k] *= -1.3;
        let mut apart = mesh.clone();
        apart.points = untangled(&mesh, 1e-3, &Silent).unwrap().unwrap();
        assert!(!crossed(&apart).contains(&true));
    }
}

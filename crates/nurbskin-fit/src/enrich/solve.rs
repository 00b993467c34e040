//! The control mesh whose limit surface passes through the vertices of a mesh.
//!
//! The limit positions of control points P are L P with a sparse matrix L. Along the boundary, L is (1, 4, 1) / 6 and
//! independent of the inside. Inside, D L with D = diag(k (k + 5)) is symmetric; with the faces F and edges E at the
//! points, its quadratic form is
//!
//! ```text
//! 4 sum_F (sum x)² / |F| + 2 sum_E (x_a + x_b)² + sum k (k - 3) x²
//! ```
//!
//! It is positive semidefinite for valences from 3 up, so that preconditioned conjugate gradients solve the system,
//! including the consistent singular case (a cube).
//!
//! Source: interpolation by Halstead, Kass and `DeRose` 1993; the form is ours.

use super::check_size;
use super::mesh::PolygonMesh;
use glam::DVec3;
use nurbskin_geometry::{Error, Result};

/// Distance of a limit position from its point at which the control points are found, as a share of the box's largest
/// side. Guard: a few hundred roundings.
const LIMIT_TOLERANCE: f64 = 1e-13;
/// The same in units of rounding of the largest coordinate, where that is more. Guard: sums over the neighbours of a
/// point round by a few units.
const ROUNDING_ULPS: f64 = 16.0;
/// Miss, in these tolerances, above which no control mesh is said to exist. Guard: solvable systems reach a few,
/// unsolvable ones miss by parts of the box.
const MAX_ACCEPTED_MISS: f64 = 10.0;
/// Most runs of conjugate gradients, each from the true residual. Guard: restarts restore the accuracy that the
/// recurrence loses; one or two do.
const CG_RUNS: usize = 4;
/// Most steps of a run: the number of points up to the first, plus the second. Guard: in exact arithmetic as many steps
/// as unknowns do; some tens are usual.
const CG_STEPS: [usize; 2] = [2000, 50];
/// Curvature along a direction, per squared length, at which a run ends: the direction moves no limit. Guard: the level
/// of rounding.
const MIN_CURVATURE: f64 = 1e-14;
/// Decrease of the squared residual at which a run ends. Guard: 1e-15 of the residual, the level of rounding.
const CG_TOLERANCE: f64 = 1e-30;
/// Decrease of the best squared residual that counts as progress. Guard: with the limit of steps below, it ends a run
/// that only circles.
const STALL_RATIO: f64 = 0.5;
/// Steps without progress after which a run ends. Guard: more than the plateaus of well-conditioned systems.
const STALL_STEPS: usize = 200;

/// The control mesh, of the same faces, whose limit positions are the points of `mesh`, to 1e-13 of its bounding box.
/// O(number of corners) per iteration; some tens of iterations, whatever the size.
///
/// # Errors
/// [`Error::NoSolution`] if no control mesh with these faces has those limits: only on a few closed meshes of valence 3
/// or 2 (on a cube, for the points of a distorted one). [`enrich_mesh`] then corrects one level further down, where a
/// solution always exists.
pub fn controls_of_mesh(mesh: &PolygonMesh) -> Result<PolygonMesh> {
    let (controls, residual) = solve(mesh)?;
    let size = extent(mesh.points());
    if residual > MAX_ACCEPTED_MISS * accuracy(mesh.points(), size) {
        return Err(Error::NoSolution(format!(
            "no control mesh with these faces has a limit surface through all points: the best one misses them by {residual:.3e}; subdivide the mesh once first"
        )));
    }
    Ok(controls)
}

/// A finer quad mesh through the same points: `levels` Catmull-Clark steps on the control mesh whose limit surface
/// passes through all points of `mesh`, taken to the limit. The points of `mesh` come first, to the last bit.
/// O(4^levels number of corners).
///
/// # Errors
/// [`Error::Unsupported`] if the result would have more than 2^26 points.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_fit::enrich::{PolygonMesh, enrich_mesh};
/// // A tetrahedron becomes a round body through its four corners.
/// let corners = [[1., 1., 1.], [1., -1., -1.], [-1., 1., -1.], [-1., -1., 1.]].map(DVec3::from);
/// let faces = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]];
/// let body = enrich_mesh(&PolygonMesh::new(corners.to_vec(), &faces)?, 2)?;
/// assert_eq!(body.face_count(), 48);
/// assert_eq!(body.points()[..4], corners);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
pub fn enrich_mesh(mesh: &PolygonMesh, levels: usize) -> Result<PolygonMesh> {
    if levels == 0 {
        return Ok(mesh.clone());
    }
    // Each step makes a quad of every corner, with 4 corners each.
    let corners: usize = mesh.faces().map(<[usize]>::len).sum();
    let growth = u32::try_from(levels - 1)
        .ok()
        .and_then(|l| 4_usize.checked_pow(l));
    check_size(growth.and_then(|growth| corners.checked_mul(growth)?.checked_mul(2)))?;
    let (mut finer, residual) = solve(mesh)?;
    finer = finer.subdivided()?;
    let size = extent(mesh.points());
    if residual > accuracy(mesh.points(), size) {
        finer = corrected(&finer, mesh.points())?;
    }
    for _ in 1..levels {
        finer = finer.subdivided()?;
    }
    let mut points = finer.limit_positions();
    // The original points are there up to rounding; their exact values are restored.
    points[..mesh.points().len()].copy_from_slice(mesh.points());
    finer.with_points(points)
}

/// `finer`, one step below the original mesh, with the original points moved so that their limits are `points`. After a
/// step no two original points are neighbours, so that each limit is set by its own point.
fn corrected(finer: &PolygonMesh, points: &[DVec3]) -> Result<PolygonMesh> {
    let limits = finer.limit_positions();
    let mut moved = finer.points().to_vec();
    for (k, target) in points.iter().enumerate() {
        let vertex = &finer.vertices()[k];
        let own_weight = match vertex.boundary {
            Some(_) if vertex.is_corner() => 1.0,
            Some(_) => 2.0 / 3.0,
            None => super::limit_mask(vertex.faces)[0],
        };
        moved[k] += (*target - limits[k]) / own_weight;
    }
    finer.with_points(moved)
}

/// Largest side of the bounding box.
fn extent(points: &[DVec3]) -> f64 {
    let [low, high] = nurbskin_geometry::point_grid::bounding_box(points);
    (high - low).max_element().max(0.0)
}

/// The accuracy that can be reached: the tolerance, but at least the rounding of the coordinates.
fn accuracy(points: &[DVec3], size: f64) -> f64 {
    let largest = points.iter().fold(0.0, |most: f64, p| {
        most.max(p.x.abs()).max(p.y.abs()).max(p.z.abs())
    });
    (LIMIT_TOLERANCE * size).max(ROUNDING_ULPS * f64::EPSILON * largest)
}

/// The control mesh with the smallest miss found, and that miss.
fn solve(mesh: &PolygonMesh) -> Result<(PolygonMesh, f64)> {
    let target = mesh.points();
    let accuracy = accuracy(target, extent(target));
    let mut controls = target.to_vec();
    let mut workspace = Workspace::default();
    // The boundary first, then the inside with the boundary known.
    let on_boundary: Vec<bool> = (0..target.len()).map(|k| mesh.is_boundary(k)).collect();
    for boundary in [true, false] {
        let unknown: Vec<bool> = (0..target.len())
            .map(|k| on_boundary[k] == boundary && !mesh.vertices()[k].is_corner())
            .collect();
        if unknown.contains(&true) {
            // Conjugate gradients lose accuracy; a few restarts from the true residual restore it.
            for _ in 0..CG_RUNS {
                if workspace.improve(mesh, target, &unknown, accuracy, &mut controls) <= accuracy {
                    break;
                }
            }
        }
    }
    let residual = workspace.residual(mesh, target, &controls);
    Ok((mesh.with_points(controls)?, residual))
}

#[derive(Default)]
struct Workspace {
    refined: Vec<DVec3>,
    limits: Vec<DVec3>,
}

impl Workspace {
    fn residual(&mut self, mesh: &PolygonMesh, target: &[DVec3], controls: &[DVec3]) -> f64 {
        mesh.limit_of(controls, &mut self.refined, &mut self.limits);
        let misses = self.limits.iter().zip(target);
        misses.fold(0.0, |most: f64, (a, b)| most.max(a.distance(*b)))
    }

    /// One run of preconditioned conjugate gradients for the `unknown` points; returns the miss there before it.
    fn improve(
        &mut self,
        mesh: &PolygonMesh,
        target: &[DVec3],
        unknown: &[bool],
        accuracy: f64,
        controls: &mut [DVec3],
    ) -> f64 {
        let weight = |k: usize| match mesh.vertices()[k].boundary {
            Some(_) => 6.0,
            None => {
                let valence = mesh.vertices()[k].faces as f64;
                valence * (valence + 5.0)
            }
        };
        mesh.limit_of(controls, &mut self.refined, &mut self.limits);
        let mut worst = 0.0_f64;
        let mut residual = vec![DVec3::ZERO; target.len()];
        for k in (0..target.len()).filter(|&k| unknown[k]) {
            let miss = target[k] - self.limits[k];
            worst = worst.max(miss.length());
            residual[k] = weight(k) * miss;
        }
        if worst <= accuracy {
            return worst;
        }
        let mut direction: Vec<DVec3> =
            (0..target.len()).map(|k| residual[k] / weight(k)).collect();
        let mut energy = dot(&residual, &direction);
        let first_energy = energy;
        let mut best_energy = energy;
        let mut since_best = 0;
        for _ in 0..target.len().min(CG_STEPS[0]) + CG_STEPS[1] {
            mesh.limit_of(&direction, &mut self.refined, &mut self.limits);
            let mut curvature = 0.0;
            for k in (0..target.len()).filter(|&k| unknown[k]) {
                self.limits[k] *= weight(k);
                curvature += direction[k].dot(self.limits[k]);
            }
            // Along a direction that moves no limit (or of an indefinite matrix) there is no gain.
            if curvature <= MIN_CURVATURE * dot(&direction, &direction) {
                break;
            }
            let step = energy / curvature;
            for k in (0..target.len()).filter(|&k| unknown[k]) {
                controls[k] += step * direction[k];
                residual[k] -= step * self.limits[k];
            }
            let next = (0..target.len())
                .fold(0.0, |sum, k| sum + residual[k].length_squared() / weight(k));
            if next <= CG_TOLERANCE * first_energy {
                break;
            }
            if next < STALL_RATIO * best_energy {
                (best_energy, since_best) = (next, 0);
            } else {
                since_best += 1;
                if since_best > STALL_STEPS {
                    break;
                }
            }
            let factor = next / energy;
            energy = next;
            for k in (0..target.len()).filter(|&k| unknown[k]) {
                direction[k] = residual[k] / weight(k) + factor * direction[k];
            }
        }
        worst
    }
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

//! Sheets that bend over, spread out in the plane with as little distortion as possible.
//!
//! Each triangle t keeps its own shape, turned by R; its edges then disagree with the vertices u as little as possible:
//!
//! ```text
//! E = Σ_t Σ_ij c_tij |u_i - u_j - R_t (x_ti - x_tj)|²        c_tij = ½ cot of the opposite angle, clamped
//! ```
//!
//! The corners x are those of the triangle, laid flat. The best R for given u follows from each triangle alone, and the best
//! u for given R from one Laplace equation, in turns. Each round goes on in the direction of the last ones, with the
//! momentum k / (k + 3), until E grows; then it starts anew from the best places. Nothing holds the border, so that a developable sheet keeps its
//! lengths. Holes that were filled for the first layout count next to nothing.
//!
//! Sources: the local and global steps of L. Liu, L. Zhang, Y. Xu, C. Gotsman and S. Gortler, *A local/global approach to
//! mesh parameterization*, 2008, DOI 10.1111/j.1467-8659.2008.01290.x; the momentum of Nesterov 1983 with the restarts of
//! B. O'Donoghue and E. Candès 2015, DOI 10.1007/s10208-013-9150-3. The start over a rectangle is ours.

use super::MeshChart;
use super::chart::assemble;
use super::layout::{Setup, Surface, lengths, pieces};
use super::relax::Layout;
use super::sides::ends;
use super::stretch::Stretch;
use crate::chart::Topology;
use crate::chart::rectangle::{convex_hull, smallest_rectangle};
use glam::{DMat2, DVec2, DVec3};
use nurbskin_geometry::numeric::conjugate_gradients::GraphMatrix;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Result, math};
use nurbskin_scan::mesh::Manifold;
use rayon::prelude::*;

/// Least and largest weight of a side. Guard: slivers have infinite cotangents; positive weights keep the equation
/// definite.
const SIDE_WEIGHTS: [f64; 2] = [1e-2, 10.0];
/// Weight of a triangle that fills a hole, in that of one of the scan. Guard: it carries the vertices inside the hole
/// along, and does not resist.
const FILLED_WEIGHT: f64 = 1e-4;
/// Most rounds of both steps. Guard: bounds the time.
const MAX_ROUNDS: usize = 200;
/// Rounds between two looks at the decrease of E. Guard: with momentum single rounds may raise it.
const ROUNDS_PER_CHECK: usize = 10;
/// Relative decrease of E between two looks below which the rounds end. Trial: not varied.
const MIN_DECREASE: f64 = 0.02;
/// Relative residual to which the Laplace equation is solved in each round. Guard: the next round starts from there.
const SOLVE_ACCURACY: f64 = 1e-6;
/// Most steps of conjugate gradients in a round. Guard: bounds the time of a round.
const MAX_CG_STEPS: usize = 50;
/// (a - b) / (a + b) for the mean squares a and b of the curvatures along and across the bend, above which a sheet bends in
/// one direction. Derived: a root mean square ratio of three, (9 - 1) / (9 + 1).
const ONE_WAY: f64 = 0.8;
/// Rounds in which normals are averaged over their triangles before the bend is measured. Guard: normals of triangles between
/// points at random scatter by more than the bend of an edge's length; averages over a few edges do not.
const SMOOTHING_ROUNDS: usize = 6;
/// Energy per area at which a sheet counts as developed exactly. Guard: a strain of a thousandth moves no knot.
const NO_STRAIN: f64 = 1e-6;
/// Most cells along a side of the raster that finds overlaps. Guard: bounds its memory to a megabyte.
const RASTER_CELLS: f64 = 1000.0;
/// Fewest triangles of a task. Guard: fewer cost less than the task itself.
const TRIANGLES_PER_TASK: usize = 1024;

/// The places of the vertices of a mesh, spread out from a `start` in the unit of the mesh. The triangles after the first
/// `scanned` fill holes. O(n) for each of 200 rounds at most.
pub(crate) fn spread(
    mesh: &Manifold,
    scanned: usize,
    start: Vec<DVec2>,
    progress: &dyn Progress,
) -> Result<Vec<DVec2>> {
    let surface = Surface::new(&mesh.points, &mesh.triangles);
    let area = (0..scanned).map(|t| mesh.vector_area(t).length()).sum();
    Flat::new(&surface, scanned, area).relaxed(start, progress)
}

impl Developed {
    /// The chart of a mesh whose vertices were spread out to these `places`, in its unit. The domain is a rectangle around
    /// them with a `margin`: with u along the bend of a sheet that bends in one direction, so that its knots lie along the
    /// other one; else the smallest, with u along its longer side, or along the bend for a round outline. O(n log n).
    pub(crate) fn new(mesh: &Manifold, mut places: Vec<DVec2>, margin: f64) -> Self {
        let surface = Surface::new(&mesh.points, &mesh.triangles);
        let (bend, one_way) = bend(mesh, &places);
        let long = smallest_rectangle(&convex_hull(&places), bend);
        let smallest = turn(&mut places, long, 0.0);
        let along = if one_way > ONE_WAY {
            DVec2::new(long.dot(bend), long.perp_dot(bend))
        } else {
            DVec2::X
        };
        let size = turn(&mut places, along, margin);
        let doubled = doubled(&surface, &places, size);
        for p in &mut places {
            *p /= size;
        }
        let lengths_of_rims = (0..mesh.loops.len()).map(|k| mesh.border_length(k));
        let rim = lengths_of_rims.fold(0.0, f64::max);
        let setup = Setup::open(mesh.points.len(), mesh.triangles.len());
        let of = pieces(&surface, &setup, &places);
        let layout = Layout {
            stretch: Stretch::measure(&surface, &of, lengths(&of)),
            folded: 0.0,
            places,
            size: size.to_array(),
        };
        let what = "open sheet that bends over, spread out";
        Self {
            chart: assemble(&surface, &setup, layout, Topology::Disk, what),
            doubled,
            filled: mesh.area() / smallest.element_product(),
            rim: rim / (2.0 * smallest.element_sum()),
        }
    }
}

/// A sheet that was spread out in the plane.
#[derive(Debug)]
pub(crate) struct Developed {
    /// Its chart; the domain is the rectangle around it.
    pub(crate) chart: MeshChart,
    /// Share of its triangles that overlap others, or are turned over.
    pub(crate) doubled: f64,
    /// Its area, as a share of that of the smallest rectangle.
    pub(crate) filled: f64,
    /// The length of its longest border, in the perimeter of the same.
    pub(crate) rim: f64,
}

/// Triangles laid flat, each by itself.
struct Flat<'a> {
    surface: &'a Surface<'a>,
    /// Per triangle, side s from corner s to the next one.
    sides: Vec<[DVec2; 3]>,
    /// Per triangle, the weights of its sides.
    weights: Vec<[f64; 3]>,
    /// Of the triangles of the scan.
    area: f64,
}

impl<'a> Flat<'a> {
    fn new(surface: &'a Surface<'a>, scanned: usize, area: f64) -> Self {
        let count = surface.triangles.len();
        let sides = |t: usize| {
            let [p, q, r] = surface.corners(t);
            let (e, f) = (q - p, r - p);
            let along = e.normalize_or(DVec3::X);
            let (x, y) = (
                f.dot(along),
                e.cross(f).length() / e.length().max(f64::MIN_POSITIVE),
            );
            let at = [DVec2::ZERO, DVec2::new(e.length(), 0.0), DVec2::new(x, y)];
            [at[1] - at[0], at[2] - at[1], at[0] - at[2]]
        };
        let sides: Vec<[DVec2; 3]> = (0..count).map(sides).collect();
        let weights = |(t, side): (usize, &[DVec2; 3])| {
            let share = if t < scanned { 1.0 } else { FILLED_WEIGHT };
            [0, 1, 2].map(|s| {
                // The angle opposite side s lies between the other two.
                let (a, b) = (side[(s + 2) % 3], -side[(s + 1) % 3]);
                let twice = a.perp_dot(b).abs().max(f64::MIN_POSITIVE);
                let weight = 0.5 * a.dot(b) / twice;
                share * weight.clamp(SIDE_WEIGHTS[0], SIDE_WEIGHTS[1])
            })
        };
        let weights = sides.iter().enumerate().map(weights).collect();
        Self {
            surface,
            sides,
            weights,
            area,
        }
    }

    /// The places after rounds of both steps.
    fn relaxed(&self, mut places: Vec<DVec2>, progress: &dyn Progress) -> Result<Vec<DVec2>> {
        let surface = self.surface;
        let edges: Vec<[u32; 2]> = (surface.sides.edges.iter())
            .map(|&side| ends(surface.triangles, side))
            .collect();
        let weights: Vec<f64> = (surface.sides.edges.iter())
            .map(|&side| {
                let of = |side: u32| {
                    self.weights
                        .get(side as usize / 3)
                        .map(|w| w[side as usize % 3])
                };
                let other = surface.sides.partner[side as usize];
                of(side).unwrap_or(0.0) + of(other).unwrap_or(0.0)
            })
            .collect();
        // The places are determined up to a shift.
        let mut free = vec![[true; 2]; places.len()];
        if let Some(first) = surface.triangles.first() {
            free[first[0] as usize] = [false; 2];
        }
        let mut matrix = GraphMatrix::new(&edges, &free);
        matrix.weigh(&weights, &[]);
        // The places before, the best of them, and the rounds since the momentum was dropped.
        let (mut before, mut best, mut since) =
            (places.clone(), (f64::INFINITY, places.clone()), 0);
        let mut last = f64::INFINITY;
        for round in 0..MAX_ROUNDS {
            progress.check()?;
            let turned: Vec<([DVec2; 3], f64)> = (surface.triangles.par_iter().enumerate())
                .with_min_len(TRIANGLES_PER_TASK)
                .map(|(t, triangle)| self.turned(t, triangle.map(|k| places[k as usize])))
                .collect();
            let mut right = vec![DVec2::ZERO; places.len()];
            for (t, (sides, _)) in surface.triangles.iter().zip(&turned) {
                for s in 0..3 {
                    right[t[s] as usize] -= sides[s];
                    right[t[(s + 1) % 3] as usize] += sides[s];
                }
            }
            let energy: f64 = turned.iter().map(|(_, energy)| energy).sum();
            if energy < best.0 {
                best = (energy, places.clone());
            }
            if !energy.is_finite() || energy <= NO_STRAIN * self.area {
                break;
            }
            if round % ROUNDS_PER_CHECK == ROUNDS_PER_CHECK - 1 {
                if best.0 > (1.0 - MIN_DECREASE) * last {
                    break;
                }
                last = best.0;
            }
            if energy > best.0 {
                // A round without momentum comes no further.
                if since <= 1 {
                    break;
                }
                (places, since) = (best.1.clone(), 0);
                before.clone_from(&places);
                continue;
            }
            matrix.solve(&right, &mut places, SOLVE_ACCURACY, MAX_CG_STEPS);
            let momentum = f64::from(since) / (f64::from(since) + 3.0);
            since += 1;
            for (place, before) in places.iter_mut().zip(&mut before) {
                let found = *place;
                *place += momentum * (found - *before);
                *before = found;
            }
        }
        Ok(best.1)
    }

    /// The sides of a triangle in its best position for these places, each times its weight, and its energy.
    fn turned(&self, t: usize, at: [DVec2; 3]) -> ([DVec2; 3], f64) {
        let (sides, weights) = (&self.sides[t], &self.weights[t]);
        let seen = [0, 1, 2].map(|s| at[(s + 1) % 3] - at[s]);
        let (mut along, mut across) = (0.0, 0.0);
        for s in 0..3 {
            along += weights[s] * sides[s].dot(seen[s]);
            across += weights[s] * sides[s].perp_dot(seen[s]);
        }
        let turn = DVec2::new(along, across).normalize_or(DVec2::X);
        let sides = sides.map(|side| turn.rotate(side));
        let energy = (0..3)
            .map(|s| weights[s] * sides[s].distance_squared(seen[s]))
            .sum();
        ([0, 1, 2].map(|s| weights[s] * sides[s]), energy)
    }
}

/// Turns the places into the rectangle along a direction around them, which begins at the origin; returns its size. It has
/// a `margin`.
fn turn(places: &mut [DVec2], along: DVec2, margin: f64) -> DVec2 {
    let frame = DMat2::from_cols(along, along.perp()).transpose();
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for p in places.iter_mut() {
        *p = frame * *p;
        low = low.min(*p);
        high = high.max(*p);
    }
    for p in places.iter_mut() {
        *p += margin - low;
    }
    (high - low + 2.0 * margin).max(DVec2::splat(f64::MIN_POSITIVE))
}

/// The direction in which the normals turn most, the first axis of the mean of ∇nᵀ ∇n, and (a - b) / (a + b) for the
/// eigenvalues a and b of that matrix: 1 for a cylinder, 0 for a sphere.
fn bend(mesh: &Manifold, places: &[DVec2]) -> (DVec2, f64) {
    let mut normals = mesh.normals();
    for _ in 0..SMOOTHING_ROUNDS {
        let mut sums = vec![DVec3::ZERO; normals.len()];
        for triangle in &mesh.triangles {
            let sum: DVec3 = triangle.iter().map(|&k| normals[k as usize]).sum();
            triangle.iter().for_each(|&k| sums[k as usize] += sum);
        }
        normals = sums.into_iter().map(DVec3::normalize_or_zero).collect();
    }
    let (mut difference, mut mixed, mut sum) = (0.0, 0.0, 0.0);
    for triangle in &mesh.triangles {
        let n = triangle.map(|k| normals[k as usize]);
        let at = triangle.map(|k| places[k as usize]);
        let (du, dv, twice) = super::layout::derivatives(n, at);
        if twice > 0.0 {
            difference += (du.length_squared() - dv.length_squared()) / twice;
            mixed += 2.0 * du.dot(dv) / twice;
            sum += (du.length_squared() + dv.length_squared()) / twice;
        }
    }
    let axis = math::unit_vector(0.5 * math::atan2(mixed, difference));
    let apart = (difference * difference + mixed * mixed).sqrt();
    (axis, apart / sum.max(f64::MIN_POSITIVE))
}

/// Share of the triangles that are turned over, plus the share of the covered cells of a raster that lie in several triangles.
/// O(n) for n triangles, with at most [`RASTER_CELLS`] squared cells.
fn doubled(surface: &Surface<'_>, places: &[DVec2], size: DVec2) -> f64 {
    let count = surface.triangles.len() as f64;
    // About two cells for each triangle.
    let cell = (0.5 * size.element_product() / count).sqrt();
    let cell = cell.max(size.max_element() / RASTER_CELLS);
    if !cell.is_finite() || cell <= 0.0 {
        return 1.0;
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the raster, which has a thousand lines at most"
    )]
    let line = |x: f64, lines: usize| (x.ceil().max(0.0) as usize).min(lines);
    let [columns, rows] = [size.x, size.y].map(|length| 1 + line(length / cell, 1 << 12));
    let mut covers = vec![0_u8; columns * rows];
    let mut turned = 0.0;
    for triangle in surface.triangles {
        let at = triangle.map(|k| places[k as usize] / cell);
        if (at[1] - at[0]).perp_dot(at[2] - at[0]) <= 0.0 {
            turned += 1.0;
            continue;
        }
        let ends = |f: fn(f64, f64) -> f64| f(f(at[0].y, at[1].y), at[2].y);
        // Cells whose middles lie on a side belong to the triangle on one side of it.
        for row in line(ends(f64::min), rows)..line(ends(f64::max), rows) {
            let height = row as f64;
            let crossed = (0..3).filter_map(|s| {
                let (p, q) = (at[s], at[(s + 1) % 3]);
                let crosses = (p.y <= height) != (q.y <= height);
                crosses.then(|| p.x + (height - p.y) / (q.y - p.y) * (q.x - p.x))
            });
            let (low, high) = crossed.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
                (l.min(x), h.max(x))
            });
            let (from, to) = (line(low, columns), line(high, columns));
            for cover in covers[row * columns..][from.min(to)..to].iter_mut() {
                *cover = cover.saturating_add(1);
            }
        }
    }
    let covered = |least: u8| covers.iter().filter(|cover| **cover >= least).count() as f64;
    turned / count.max(1.0) + covered(2) / covered(1).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_geometry::progress::Silent;
    use nurbskin_scan::mesh::samples::Mesh;
    use std::f64::consts::TAU;

    /// A flat ring that winds `turns` times.
    fn ramp(turns: f64) -> (Manifold, Vec<DVec2>) {
        let Mesh {
            points, triangles, ..
        } = Mesh::lattice([120, 16], [false, false], |u, v| {
            let (angle, r) = (-turns * TAU * u, 1.0 + 0.5 * v);
            DVec3::new(r * angle.cos(), r * angle.sin(), 1e-4 * angle)
        });
        let places = points.iter().map(|p| p.truncate()).collect();
        let mesh = Manifold {
            source: vec![None; points.len()],
            points,
            triangles,
            loops: Vec::new(),
        };
        (mesh, places)
    }

    #[test]
    fn what_lies_over_itself_is_measured() {
        for (turns, known) in [(0.9, 0.0), (1.5, 0.5)] {
            let (mesh, places) = ramp(turns);
            let found = Developed::new(&mesh, places, 0.1).doubled;
            assert!((found - known).abs() < 0.02, "{turns}: {found}");
        }
        let (mesh, mut places) = ramp(0.9);
        for p in &mut places {
            p.x = -p.x;
        }
        assert!(
            Developed::new(&mesh, places, 0.1).doubled > 0.99,
            "turned over"
        );
    }

    #[test]
    fn a_cylinder_bends_in_one_direction_and_a_cap_in_none() {
        let of = |shape: fn(DVec2) -> DVec3| {
            let Mesh {
                points, triangles, ..
            } = Mesh::lattice([40, 40], [false, false], |u, v| DVec3::new(u, v, 0.0));
            // A square of side 1 that lies across its coordinates by 0.3 rad.
            let turned = |p: &DVec3| DVec2::from_angle(0.3).rotate(p.truncate() - 0.5);
            let places: Vec<DVec2> = points.iter().map(turned).collect();
            let mesh = Manifold {
                source: vec![None; points.len()],
                points: places.iter().map(|&p| shape(p)).collect(),
                triangles,
                loops: Vec::new(),
            };
            bend(&mesh, &places)
        };
        let (axis, one_way) = of(|p| DVec3::new(p.x.sin(), p.y, p.x.cos()));
        assert!(axis.y.abs() < 1e-2 && one_way > 0.98, "{axis} {one_way}");
        let (_, one_way) = of(|p| p.extend(-0.05 * p.length_squared()));
        assert!(one_way < 0.05, "{one_way}");
    }

    #[test]
    fn a_stretched_sheet_finds_back_to_its_shape() {
        let (mesh, known) = ramp(0.7);
        let start = known
            .iter()
            .map(|p| DVec2::new(1.4 * p.x + 0.3 * p.y, 0.7 * p.y));
        let places = spread(&mesh, mesh.triangles.len(), start.collect(), &Silent).unwrap();
        let lengths = |all: &[DVec2]| -> Vec<f64> {
            all.iter()
                .zip(&all[300..])
                .map(|(a, b)| a.distance(*b))
                .collect()
        };
        for (known, found) in lengths(&known).into_iter().zip(lengths(&places)) {
            // Rounds end at a root mean square strain of 1e-3.
            assert!((known - found).abs() < 5e-3, "{known} {found}");
        }
    }
}

//! Ragged rims, opened and continued to an even line.
//!
//! The rim of a scan is where the scanner stopped. Its teeth are no shape, and a surface that ends on them wrinkles, folds and
//! wastes control points there.
//!
//! 1. What is narrow at the rim is removed (`opening.rs`), and notches are closed.
//! 2. Each vertex k of the rim moves along the surface to
//!
//!    ```text
//!    c + (e + h / 2) o
//!    ```
//!
//!    with c the rim smoothed by binomial averages, o the direction outwards, h the spacing, and e the largest height of the rim
//!    above c nearby, itself averaged. No vertex of the rim then lies outside the new one, but for teeth higher than six spacings, and
//!    where a move is shorter so that it folds nothing, stays beside its neighbours and does not come near another rim.
//! 3. Vertices that lie inside c, where the rim turns sharply into the surface, move out to it, a few times.
//!
//! After each of these moves the notches are closed that have opened beside vertices that could not move.
//!
//! The height across the surface is that of a quadric fitted to the vertices around. Source: ours; as for the trimmed outline of a
//! single sheet, the surface goes on beyond its data by as much as the rim is rough.

use super::Manifold;
use super::manifold::{Adjacency, NONE};
use super::notches::{close_some, median_edge};
use super::opening::opened;
use super::quadric::{Quadric, QuadricFit};
use super::repair::rim::without;
use crate::normals::mesh_normals;
use glam::{DVec2, DVec3};
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::spatial::neighbours::{Nearest, Neighbours};
use std::collections::HashSet;

/// Median angle by which a rim turns at a vertex, beside its mean turn around it, from which on the rim is ragged. Radians.
/// Derived: half of that of a staircase in a lattice, which turns by 0, 0 and 45 degrees to either side (median 0.39).
const RAGGED: f64 = 0.2;
/// Vertices to each side over which a rim is averaged. Count.
/// Trial: 4, 6 and 10 on three range images of a figure at 0.12 % of the diagonal: one, two and none of their networks are sound.
const WINDOW: usize = 6;
/// Widest mouth of a notch of a ragged rim that is closed, in spacings. Dimensionless.
/// Trial: 3, 6 and 10 on a range image of a figure, whose network has 117, 74 and 58 faces, of which 7, 2 and 2 are bad.
const MOUTH: usize = 10;
/// Fewest vertices of a rim. Count. Guard: two windows to each side of a vertex do not overlap.
const FEWEST: usize = 4 * WINDOW;
/// Distance from the outermost points to the new rim, in spacings. Dimensionless.
/// Derived: a point stands for the surface half a spacing around it.
const MARGIN: f64 = 0.5;
/// Largest height of a tooth above the smoothed rim that counts, in spacings. Dimensionless.
/// Guard: the opening leaves few as high, parts too large to go; the surface ends before their tips.
const MOST_HEIGHT: f64 = 6.0;
/// Vertices to which a quadric is fitted. Count.
/// Derived: a half disk of a radius of five spacings; most moves are shorter, and beyond it the surface is taken for straight.
const AROUND: usize = 40;
/// Times that vertices inside the smoothed rim move out to it. Count.
/// Trial: 1, 3, 6 and 12 on three range images of a figure at 0.14 and 0.2 % of the diagonal: 1, 1, 3 and 3 of the six networks are
/// sound at the first attempt.
const FILLS: usize = 6;
/// Most by which a vertex of a rim moves farther than the one beside it, in spacings. Dimensionless.
/// Derived: neighbours are a spacing apart; a rim that was straight then turns by 45 degrees at most.
const MOST_STEP: f64 = 1.0;
/// Cosine between the normals of vertices of one sheet. Dimensionless. Guard: those of the other side of a wall are opposite.
const AGREE: f64 = 0.3;
/// Area of a triangle that moved along its normal before, as a share of the area before, below which it folds. Dimensionless.
/// Guard: above zero; triangles of a tenth of their area are slivers already.
const LEAST_AREA: f64 = 0.1;
/// Rounds in which the moves at folded triangles are halved. Count. Guard: in later ones they are none, until nothing folds.
const HALVINGS: usize = 5;

/// A mesh with even rims.
#[derive(Clone, Debug)]
pub struct Evened {
    /// The mesh.
    pub mesh: Manifold,
    /// How many rims were ragged and still are after the opening.
    pub ragged: usize,
    /// For each vertex of the given mesh whether the opening removed it.
    pub lost: Vec<bool>,
}

/// Removes what is narrow at the ragged rims of a mesh, and continues them to even ones outside the points that are left. Vertices of
/// the rims move, and triangles that hang on them by one side and lose their area go. O(n log n) in the vertices.
#[must_use]
pub fn evened(mesh: Manifold) -> Evened {
    let none = vec![false; mesh.points.len()];
    let rims = ragged(&mesh);
    if rims.is_empty() {
        return Evened {
            mesh,
            ragged: 0,
            lost: none,
        };
    }
    let (mesh, lost) = opened(mesh, &rims);
    // They have another order afterwards.
    let rims = ragged(&mesh);
    let count = rims.len();
    let of_ragged: HashSet<u32> = rims
        .iter()
        .flat_map(|&k| &mesh.loops[k])
        .filter_map(|&v| mesh.source[v as usize])
        .collect();
    let left = |mesh: &Manifold| -> Vec<usize> {
        let was_ragged = |v: &u32| mesh.source[*v as usize].is_some_and(|k| of_ragged.contains(&k));
        let is_left = |rim: &Vec<u32>| rim.len() >= FEWEST && rim.iter().any(was_ragged);
        (0..mesh.loops.len())
            .filter(|&k| is_left(&mesh.loops[k]))
            .collect()
    };
    let spacing = median_edge(&mesh);
    let (mut mesh, _) = close_some(mesh, &rims, MOUTH, spacing);
    for pass in 0..=FILLS {
        let normals = mesh_normals(&mesh.points, &mesh.triangles);
        let rims: Vec<&Vec<u32>> = left(&mesh).into_iter().map(|k| &mesh.loops[k]).collect();
        let moves = moves(&mesh, &normals, &rims, |course| match pass {
            0 => course.outside(spacing),
            _ => course.filled(),
        });
        if moves.iter().all(|step| *step == DVec3::ZERO) {
            break;
        }
        let hanging = move_vertices(&mut mesh, &normals, &moves, spacing);
        if hanging.contains(&true) {
            mesh = without(mesh, &hanging);
        }
        // Vertices that moved leave notches beside those that could not.
        let rims = left(&mesh);
        (mesh, _) = close_some(mesh, &rims, MOUTH, spacing);
    }
    Evened {
        mesh,
        ragged: count,
        lost,
    }
}

/// The ragged rims of a mesh.
fn ragged(mesh: &Manifold) -> Vec<usize> {
    if mesh.loops.is_empty() {
        return Vec::new();
    }
    let normals = mesh_normals(&mesh.points, &mesh.triangles);
    let rims = 0..mesh.loops.len();
    rims.filter(|&k| is_ragged(mesh, &normals, &mesh.loops[k]))
        .collect()
}

/// Whether a rim turns to and fro.
fn is_ragged(mesh: &Manifold, normals: &[DVec3], rim: &[u32]) -> bool {
    let n = rim.len();
    if n < FEWEST {
        return false;
    }
    let place = |k: usize| mesh.points[rim[k % n] as usize];
    let turn = |k: usize| {
        let (one, two) = (place(k) - place(k + n - 1), place(k + 1) - place(k));
        let turn = one.cross(two).dot(normals[rim[k] as usize]);
        // Without a normal there is no side to turn to.
        if turn == 0.0 {
            0.0
        } else {
            math::atan2(turn, one.dot(two))
        }
    };
    let turns: Vec<f64> = (0..n).map(turn).collect();
    let beside = |k: usize| {
        let mean: f64 = around(k, n).map(|j| turns[j]).sum::<f64>() / (2 * WINDOW + 1) as f64;
        (turns[k] - mean).abs()
    };
    let mut off: Vec<f64> = (0..n).map(beside).collect();
    median_in_place(&mut off) > RAGGED
}

/// The places of a rim of n vertices within the window around k.
fn around(k: usize, n: usize) -> impl Iterator<Item = usize> {
    (0..=2 * WINDOW).map(move |s| (k + n + s - WINDOW) % n)
}

/// For each vertex how it moves, zero for those that stay. `wanted` gives the move of each vertex of a rim.
fn moves(
    mesh: &Manifold,
    normals: &[DVec3],
    rims: &[&Vec<u32>],
    wanted: impl Fn(&Course) -> Vec<DVec3>,
) -> Vec<DVec3> {
    let tree = Neighbours::new(&mesh.points);
    let mut moves = vec![DVec3::ZERO; mesh.points.len()];
    for rim in rims {
        let course = Course::of(mesh, normals, rim);
        let wanted = wanted(&course);
        let own = each(rim.len(), |k| {
            if wanted[k] == DVec3::ZERO {
                return DVec3::ZERO;
            }
            Local::new(mesh, normals, &tree, rim[k], course.normals[k]).along(wanted[k])
        });
        for (&vertex, own) in rim.iter().zip(own) {
            moves[vertex as usize] = own;
        }
    }
    moves
}

/// The course of a rim: for each vertex its place, the place on the smoothed rim, the direction outwards and the normal there.
struct Course {
    places: Vec<DVec3>,
    middles: Vec<DVec3>,
    outward: Vec<DVec3>,
    normals: Vec<DVec3>,
}

impl Course {
    fn of(mesh: &Manifold, normals: &[DVec3], rim: &[u32]) -> Self {
        let n = rim.len();
        let places: Vec<DVec3> = rim.iter().map(|&k| mesh.points[k as usize]).collect();
        let middles = averaged(&places);
        let normals: Vec<DVec3> = rim.iter().map(|&k| normals[k as usize]).collect();
        let normals: Vec<DVec3> = averaged(&normals)
            .into_iter()
            .map(DVec3::normalize_or_zero)
            .collect();
        // The surface lies to the left of its rim.
        let outward = (0..n)
            .map(|k| {
                let along = middles[(k + 1) % n] - middles[(k + n - 1) % n];
                along.cross(normals[k]).normalize_or_zero()
            })
            .collect();
        Self {
            places,
            middles,
            outward,
            normals,
        }
    }

    /// The moves to an even rim outside all vertices.
    fn outside(&self, spacing: f64) -> Vec<DVec3> {
        let n = self.places.len();
        let most = MOST_HEIGHT * spacing;
        let height = |k: usize| {
            let height = (self.places[k] - self.middles[k]).dot(self.outward[k]);
            height.min(most)
        };
        let heights: Vec<f64> = (0..n).map(height).collect();
        let highest = |k: usize| {
            around(k, n)
                .map(|j| heights[j])
                .fold(f64::NEG_INFINITY, f64::max)
        };
        let highest: Vec<f64> = (0..n).map(highest).collect();
        let envelope =
            |k: usize| around(k, n).map(|j| highest[j]).sum::<f64>() / (2 * WINDOW + 1) as f64;
        (0..n)
            .map(|k| {
                let out = envelope(k) + MARGIN * spacing;
                let to = self.middles[k] + out * self.outward[k] - self.places[k];
                to.reject_from_normalized(self.normals[k])
            })
            .collect()
    }

    /// The moves of the vertices inside the smoothed rim out to it.
    fn filled(&self) -> Vec<DVec3> {
        let filled = |k: usize| {
            let inside = (self.middles[k] - self.places[k]).dot(self.outward[k]);
            inside.max(0.0) * self.outward[k]
        };
        (0..self.places.len()).map(filled).collect()
    }
}

/// A closed line of vectors, each with those around it by binomial weights of a standard deviation of half the window.
fn averaged(line: &[DVec3]) -> Vec<DVec3> {
    let n = line.len();
    let mut line = line.to_vec();
    for _ in 0..WINDOW * WINDOW / 2 {
        line = (0..n)
            .map(|k| 0.5 * line[k] + 0.25 * (line[(k + n - 1) % n] + line[(k + 1) % n]))
            .collect();
    }
    line
}

/// The surface around a vertex of a rim.
struct Local {
    axes: [DVec3; 3],
    radius: f64,
    quadric: Option<Quadric>,
}

impl Local {
    fn new(
        mesh: &Manifold,
        normals: &[DVec3],
        tree: &Neighbours,
        vertex: u32,
        normal: DVec3,
    ) -> Self {
        let origin = mesh.points[vertex as usize];
        let mut found = Nearest::default();
        tree.search(origin, AROUND, &mut found, |k| {
            normals[k as usize].dot(normal) > AGREE
        });
        let places: Vec<DVec3> = found
            .indices()
            .map(|k| mesh.points[k as usize] - origin)
            .collect();
        let radius = places
            .iter()
            .map(|d| d.length())
            .fold(f64::MIN_POSITIVE, f64::max);
        let (across, along) = normal.any_orthonormal_pair();
        let axes = [across, along, normal];
        let mut fit = QuadricFit::default();
        for d in &places {
            let [x, y, height] = axes.map(|axis| d.dot(axis) / radius);
            fit.samples.push([x, y, height, 1.0]);
        }
        Self {
            axes,
            radius,
            quadric: fit.solve(),
        }
    }

    /// A move along the surface. Beyond the radius the surface is straight.
    fn along(&self, step: DVec3) -> DVec3 {
        let [across, along, normal] = self.axes;
        let at = DVec2::new(step.dot(across), step.dot(along)) / self.radius;
        let height = self.quadric.map_or(0.0, |quadric| {
            let inside = at.clamp_length_max(1.0);
            quadric.height(inside) + quadric.slope(inside).dot(at - inside)
        });
        step + self.radius * height * normal
    }
}

/// For each vertex the part of its move by which it does not come near the nearest other stretch of a rim, wherever that looks.
fn apart(mesh: &Manifold, moves: &[DVec3], spacing: f64) -> Vec<f64> {
    let mut moving: Vec<(u32, usize, usize)> = Vec::new();
    for (r, rim) in mesh.loops.iter().enumerate() {
        moving.extend(rim.iter().enumerate().map(|(k, &v)| (v, r, k)));
    }
    let places: Vec<DVec3> = moving.iter().map(|m| mesh.points[m.0 as usize]).collect();
    let tree = Neighbours::new(&places);
    let factors = each(moving.len(), |i| {
        let (vertex, r, k) = moving[i];
        let own = moves[vertex as usize].length();
        if own == 0.0 {
            return 1.0;
        }
        let n = mesh.loops[r].len();
        let mut found = Nearest::default();
        // Beyond its own stretch of the rim.
        tree.search(places[i], 1, &mut found, |j| {
            let (_, s, l) = moving[j as usize];
            let between = k.abs_diff(l);
            r != s || between.min(n - between) > 2 * WINDOW
        });
        found.indices().next().map_or(1.0, |j| {
            let gap = places[i].distance(places[j as usize]) - MARGIN * spacing;
            (0.5 * gap / own).clamp(0.0, 1.0)
        })
    });
    let mut parts = vec![1.0; mesh.points.len()];
    for (&(vertex, ..), factor) in moving.iter().zip(factors) {
        parts[vertex as usize] = factor;
    }
    parts
}

/// Shortens moves so that no vertex of a rim moves farther than the one beside it by more than `step`. O(n).
fn beside_neighbours(mesh: &Manifold, moves: &[DVec3], parts: &mut [f64], step: f64) {
    for rim in &mesh.loops {
        let n = rim.len();
        let mut shorten = |from: usize, to: usize| {
            let (from, to) = (rim[from % n] as usize, rim[to % n] as usize);
            let most = parts[from] * moves[from].length() + step;
            let length = moves[to].length();
            if parts[to] * length > most {
                parts[to] = most / length;
            }
        };
        // Twice around, since the shortest move may be anywhere.
        for k in 0..2 * n {
            shorten(k, k + 1);
        }
        for k in (0..2 * n).rev() {
            shorten(k + 1, k);
        }
    }
}

/// Moves the vertices, less far where triangles would fold. Returns which triangles hang on the rim by one side and have lost their
/// area.
fn move_vertices(
    mesh: &mut Manifold,
    normals: &[DVec3],
    moves: &[DVec3],
    spacing: f64,
) -> Vec<bool> {
    let mut parts = apart(mesh, moves, spacing);
    beside_neighbours(mesh, moves, &mut parts, MOST_STEP * spacing);
    let table = mesh.adjacency();
    let before = mesh.points.clone();
    let count = mesh.triangles.len();
    // On the side of the vertices: after several moves a sliver would turn with its neighbours unseen.
    let area = |t: usize| {
        let side: DVec3 = mesh.triangles[t].iter().map(|&k| normals[k as usize]).sum();
        mesh.vector_area(t).length() * side.normalize_or_zero()
    };
    let areas: Vec<DVec3> = (0..count).map(area).collect();
    let mut hanging = vec![false; count];
    for round in 0.. {
        for (k, p) in mesh.points.iter_mut().enumerate() {
            *p = before[k] + parts[k] * moves[k];
        }
        let lost =
            |t: usize| mesh.vector_area(t).dot(areas[t]) < LEAST_AREA * areas[t].length_squared();
        let lost: Vec<bool> = (0..count).map(lost).collect();
        hanging = hanging_of(mesh, &table, &lost);
        let mut folds = vec![false; parts.len()];
        for t in (0..count).filter(|&t| lost[t] && !hanging[t]) {
            for v in mesh.triangles[t] {
                folds[v as usize] |= parts[v as usize] * moves[v as usize] != DVec3::ZERO;
            }
        }
        // Each further round takes the moves of some vertices.
        if !folds.contains(&true) {
            break;
        }
        let factor = if round < HALVINGS { 0.5 } else { 0.0 };
        for (part, _) in parts.iter_mut().zip(folds).filter(|f| f.1) {
            *part *= factor;
        }
        beside_neighbours(mesh, moves, &mut parts, MOST_STEP * spacing);
    }
    hanging
}

/// Those of some triangles that hang on a border by one side, also after others of them are gone.
fn hanging_of(mesh: &Manifold, table: &Adjacency, some: &[bool]) -> Vec<bool> {
    let mut hanging = vec![false; mesh.triangles.len()];
    let mut queue: Vec<usize> = (0..mesh.triangles.len()).filter(|&t| some[t]).collect();
    while let Some(t) = queue.pop() {
        let held = |o: &u32| *o != NONE && !hanging[*o as usize];
        let beside: Vec<u32> = table.neighbours(t).into_iter().filter(held).collect();
        if let [one] = beside[..]
            && !hanging[t]
        {
            hanging[t] = true;
            queue.extend(some[one as usize].then_some(one as usize));
        }
    }
    hanging
}

#[cfg(test)]
mod tests;

//! Meshes laid out on their domain: sheets, tubes, closed shapes and rings, whatever their shape in space.

mod chart;
mod closed;
mod disk;
mod harmonic;
mod layout;
mod place;
mod poles;
mod ragged;
mod relax;
mod rim;
mod sides;
mod spread;
mod stretch;
mod topology;

pub use chart::{ChartQuality, MeshChart, chart_of_mesh};
pub use place::Placement;

use super::{Chart, Topology};
use crate::mesh::Manifold;
use crate::progress::Silent;
use crate::scan::Parts;
use crate::scan::neighbours::Neighbours;
use crate::{Error, Result};
use glam::{DVec2, DVec3};
use layout::Surface;
use rim::Rim;
use topology::Piece;

/// Loops longer than this part of the longest are openings of their own rather than holes.
const COMPARABLE: f64 = 0.35;
/// Least L^2 / (4 pi A) of a rim of length L around an area A: 1 for a flat disk, 0.5 for a hemisphere, 0.25 for the cap
/// of a sphere to 120 degrees from its middle. Deeper ones have too little rim to lay them out from.
const SHALLOW: f64 = 0.2;
/// Below so much of it a border is but a hole in a closed shape.
const CLOSED: f64 = 0.02;
/// Part of the triangles that may come out turned over; handles turn a few.
const FLIPPED: f64 = 0.02;

/// Charts a mesh whose main piece is a disk, whatever its shape in space: steep, bent or hanging over. The longest
/// border becomes the border of the domain, its corners toward those of the smallest rectangle in the best plane, u
/// along the longer side; inside, vertices are laid out without folds and with little stretch. `S_u x S_v` looks to the
/// side of the normals.
///
/// `points` and `normals` correspond, `triangles` are by index, `parts` are the separate pieces. Holes are filled; points
/// off the main surface take the place of the nearest point on it. About O(n^1.25).
///
/// # Errors
/// [`Error::Unsupported`] for a mesh that is not a disk, with what it looks like: several parts, closed, a tube, more
/// openings, or nearly closed. [`Error::Invalid`] if there are no points or triangles or the lists do not correspond.
///
/// ```
/// use nurbskin::DVec3;
/// use nurbskin::chart::surface_mesh::chart_of_disk_mesh;
/// use nurbskin::scan::Parts;
/// // A strip bent to three quarters of a circle: no plane charts it.
/// let (m, n) = (41_u32, 11_u32);
/// let points: Vec<DVec3> = (0..m * n)
///     .map(|k| (f64::from(k % m) * 0.1178, f64::from(k / m) * 0.1))
///     .map(|(a, z)| DVec3::new(a.cos(), a.sin(), z))
///     .collect();
/// let normals: Vec<DVec3> = points.iter().map(|p| DVec3::new(p.x, p.y, 0.0)).collect();
/// let cells = (0..(m - 1) * (n - 1)).map(|k| k % (m - 1) + k / (m - 1) * m);
/// let triangles: Vec<[u32; 3]> = cells.flat_map(|k| [[k, k + 1, k + m], [k + 1, k + m + 1, k + m]]).collect();
/// let parts = Parts { of: vec![0; points.len()], sizes: vec![points.len()] };
/// let chart = chart_of_disk_mesh(&points, &normals, &triangles, &parts)?;
/// assert!(chart.size[0] > 3.0 * chart.size[1]);
/// // A triangle in the middle keeps its side.
/// let [a, b, c] = triangles[410].map(|k| chart.parameters[k as usize]);
/// assert!((b - a).perp_dot(c - a) > 0.0);
/// # Ok::<(), nurbskin::Error>(())
/// ```
pub fn chart_of_disk_mesh(
    points: &[DVec3],
    normals: &[DVec3],
    triangles: &[[u32; 3]],
    parts: &Parts,
) -> Result<Chart> {
    if points.is_empty() || normals.len() != points.len() || parts.of.len() != points.len() {
        return Err(Error::invalid(
            "charting needs points, and a normal and a part for each of them",
        ));
    }
    super::check_one_part(parts)?;
    let Some(mut piece) = Piece::largest(points, triangles) else {
        return Err(Error::invalid(
            "charting a mesh needs triangles between its points",
        ));
    };
    // 1. Outward as the normals say.
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|k| points[piece.point[k as usize] as usize]);
        0.5 * (b - a).cross(c - a)
    };
    let agreement = |t: &[u32; 3]| {
        let normal: DVec3 = t
            .iter()
            .map(|&k| normals[piece.point[k as usize] as usize])
            .sum();
        area(t).dot(normal)
    };
    let agrees: f64 = piece.triangles.iter().map(agreement).sum();
    let total: f64 = piece.triangles.iter().map(|t| area(t).length()).sum();
    let mean: DVec3 = piece.triangles.iter().map(area).sum();
    let mean = if agrees < 0.0 { -mean } else { mean };
    if agrees < 0.0 {
        piece.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        piece.loops.iter_mut().for_each(|l| l.reverse());
    }
    // 2. Is it a disk?
    let place = |k: u32| points[piece.point[k as usize] as usize];
    open_rim(&piece, place, total)?;
    if mean.try_normalize().is_none() {
        return Err(Error::Unsupported(
            "the mesh faces all ways alike: no side of it can be laid on the domain".into(),
        ));
    }
    // 3. As a mesh of its own; holes are filled from their middle.
    let mut mesh = Manifold {
        points: (0_u32..).zip(&piece.point).map(|(k, _)| place(k)).collect(),
        source: piece.point.iter().map(|&k| Some(k)).collect(),
        triangles: piece.triangles.clone(),
        loops: piece.loops[..1].to_vec(),
    };
    for hole in &piece.loops[1..] {
        let middle = u32::try_from(mesh.points.len()).unwrap_or(u32::MAX);
        let sum: DVec3 = hole.iter().map(|&k| place(k)).sum();
        mesh.points.push(sum / hole.len() as f64);
        mesh.source.push(None);
        let steps = hole.iter().zip(hole.iter().cycle().skip(1));
        let fan = steps.map(|(&a, &b)| [b, a, middle]);
        mesh.triangles.extend(fan);
    }
    let surface = Surface::new(&mesh.points, &mesh.triangles);
    let chart = chart::disk(&surface, &mesh.loops[0], &Silent)?;
    if chart.quality.folded > FLIPPED {
        return Err(Error::Unsupported(format!(
            "the mesh cannot be laid out flat: {:.0} % of its triangles fold over; it has handles or crosses itself",
            100.0 * chart.quality.folded
        )));
    }
    Ok(Chart {
        topology: Topology::Disk,
        parameters: everywhere(points, &piece, &chart.places),
        size: chart.size,
        reason: chart.reason,
    })
}

/// The rim of a disk, or what the piece is instead.
fn open_rim(piece: &Piece, place: impl Fn(u32) -> DVec3, area: f64) -> Result<Rim> {
    let rims: Vec<Rim> = piece
        .loops
        .iter()
        .map(|l| Rim::new(l.iter().map(|&k| place(k)).collect()))
        .collect();
    let longest = rims.first().map_or(0.0, Rim::length);
    let openings = rims
        .iter()
        .filter(|r| r.length() > COMPARABLE * longest)
        .count();
    let roundness = longest * longest / (4.0 * std::f64::consts::PI * area.max(f64::MIN_POSITIVE));
    let looks = match openings {
        0 => "has no border: it is closed".to_owned(),
        _ if roundness < CLOSED => {
            format!("is closed but for small holes, the longest {longest:.4} around")
        }
        2 => format!(
            "is a tube or a ring: its two longest borders are {longest:.4} and {:.4} long",
            rims[1].length()
        ),
        3.. => format!("has {openings} openings of comparable size"),
        _ if roundness < SHALLOW => format!(
            "is nearly closed: its longest border is {longest:.4} long, a flat disk's of the same area {:.4}",
            longest / roundness.sqrt()
        ),
        _ => {
            return rims
                .into_iter()
                .next()
                .ok_or_else(|| Error::invalid("no rim"));
        }
    };
    Err(Error::Unsupported(format!(
        "the mesh {looks}; only meshes with one dominant border are laid out yet"
    )))
}

/// The place in \[0, 1\] x \[0, 1\] of all points: off the piece, that of the nearest point on it.
fn everywhere(points: &[DVec3], piece: &Piece, places: &[DVec2]) -> Vec<DVec2> {
    let mut parameters = vec![None; points.len()];
    for (&point, at) in piece.point.iter().zip(places) {
        let entry = &mut parameters[point as usize];
        if entry.is_none() {
            *entry = Some(at.clamp(DVec2::ZERO, DVec2::ONE));
        }
    }
    let known: Vec<usize> = (0..points.len())
        .filter(|&k| parameters[k].is_some())
        .collect();
    if known.len() == points.len() {
        return parameters.into_iter().flatten().collect();
    }
    let cloud: Vec<DVec3> = known.iter().map(|&k| points[k]).collect();
    let tree = Neighbours::new(&cloud);
    let nearest = |p: DVec3| {
        tree.nearest(p, 1)
            .first()
            .and_then(|&j| parameters[known[j as usize]])
    };
    let all = parameters.iter().zip(points);
    all.map(|(at, &p)| at.or_else(|| nearest(p)).unwrap_or(DVec2::ZERO))
        .collect()
}

#[cfg(test)]
#[path = "surface_mesh/tests.rs"]
mod tests;

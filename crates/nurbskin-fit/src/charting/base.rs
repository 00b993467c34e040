//! The mesh over which a part of a scan is charted: its own, a decimated one, or one made of its points.
//!
//! Layouts cost about O(n^1.25), and 20 000 vertices suffice for any shape that a fit can follow. A larger mesh is
//! decimated by edge collapses that keep its genus and borders. A cloud is thinned where it is large or its noise is
//! wide, the kept points move onto local quadrics, and triangles connect them.
//!
//! Sources: decimation, thinning and triangulation are those of `nurbskin_scan::mesh`; their combination is ours.

use super::{middles, steps_on, typical_edge};
use crate::chart::surface_mesh::MeshChart;
use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use nurbskin_geometry::numeric::parallel::gather;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::grouped;
use nurbskin_scan::clean::CleanScan;
use nurbskin_scan::mesh::decimate::{Decimated, decimate};
use nurbskin_scan::mesh::repair::Repaired;
use nurbskin_scan::mesh::subset::subset;
use nurbskin_scan::mesh::{Manifold, repair, thin, triangulate};

/// Largest mesh of a scan that is laid out as it is; a larger one is decimated to [`LAYOUT_VERTICES`], with the same
/// topology. Guard: bounds the time of the layout.
const MAX_OWN_VERTICES: usize = 60_000;
/// Largest cloud that is triangulated as it is; a larger one is thinned to about [`LAYOUT_VERTICES`]. Guard: bounds the
/// time of the triangulation, some 15 µs per point.
const MAX_CLOUD_POINTS: usize = 30_000;
/// Vertices of a mesh that is laid out for a larger scan: enough for any shape that 1600 control points can follow.
/// Trial: on meshes of a bent tube and an ellipsoid with 150,000 to 210,000 vertices, 30,000 changed the distance of 95
/// % of the points by less than 1 %.
const LAYOUT_VERTICES: usize = 20_000;
/// Most points per vertex that take part in its smoothing. Derived: as many as the local quadric of the smoothing uses.
const POINTS_PER_VERTEX: usize = 24;
/// Noise, as a share of the spacing, above which a mesh of all points is rough and the cloud is thinned first. Trial:
/// not recorded. A larger one leaves folds and holes in the mesh, a smaller one thins clouds that need no smoothing.
const MAX_MESH_NOISE: f64 = 0.3;
/// Noise, as a share of the distance of the kept vertices, up to which local quadrics smooth it away. Trial: not
/// recorded; half of the limit above.
const SMOOTH_MESH_NOISE: f64 = 0.15;
/// Distance of the points that are kept along scan lines, in spacings. Trial: not recorded; 0.7 spacings of points on
/// lines are half the distance between lines.
const LINE_POINT_DISTANCE: f64 = 0.7;
/// Distance from the charted piece, in spacings or edges, beyond which a bit of the mesh is no part of it. Trial: not
/// recorded. A smaller one cuts teeth of the rim off.
const LOOSE_DISTANCE: f64 = 4.0;

/// Where a mesh comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// The scan's own, repaired.
    Own,
    /// The scan's own, decimated.
    Decimated,
    /// Triangulated from the points, or from a sample of them.
    Cloud,
}

/// Treatment of close walls of a cloud whose normals are opposite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Walls {
    /// Kept apart at any distance.
    Apart,
    /// Kept apart only beyond a distance of a spacing and a half.
    Either,
}

/// A mesh to chart.
#[derive(Debug)]
pub(super) struct Base {
    pub(super) manifold: Manifold,
    pub(super) kind: Kind,
    /// Changes, for the user.
    pub(super) notes: Vec<String>,
    /// Points of the scan in the mesh, each with the source point of its vertex; empty for a cloud.
    stands: Vec<[u32; 2]>,
    /// For a decimated mesh: the typical side of its triangles, ...
    edge: f64,
    /// ... and the scan's own triangles that are longer; there points are farther apart than vertices.
    long: Vec<[DVec3; 3]>,
}

impl Base {
    /// The mesh for a scan. A scan's own mesh is used as it is, except that too many vertices are reduced by edge
    /// collapses that keep handles and borders.
    pub(super) fn of(scan: &CleanScan, walls: Walls, progress: &dyn Progress) -> Result<Self> {
        if scan.triangles.is_empty() {
            let (points, triangles) = meshed(scan, walls, progress)?;
            let Repaired {
                manifold, notes, ..
            } = repair::repair(&points, &triangles, progress)?;
            return Ok(Self {
                manifold,
                kind: Kind::Cloud,
                notes,
                stands: Vec::new(),
                edge: 0.0,
                long: Vec::new(),
            });
        }
        let Repaired {
            manifold,
            mut notes,
            ..
        } = repair::repair(&scan.points, &scan.triangles, progress)?;
        if manifold.points.len() <= MAX_OWN_VERTICES {
            let own = manifold.source.iter().copied().flatten();
            return Ok(Self {
                kind: Kind::Own,
                notes,
                stands: own.map(|k| [k, k]).collect(),
                edge: 0.0,
                long: Vec::new(),
                manifold,
            });
        }
        let Decimated {
            manifold: fewer,
            into,
        } = decimate(&manifold, LAYOUT_VERTICES, progress)?;
        notes.push(format!(
            "laid out over {} of the {} vertices of its mesh, with the same handles and borders",
            grouped(fewer.points.len()),
            grouped(manifold.points.len())
        ));
        let stand = |(source, into): (&Option<u32>, &Option<u32>)| {
            let vertex = (*into)? as usize;
            Some([(*source)?, (*fewer.source.get(vertex)?)?])
        };
        let edge = typical_edge(&fewer);
        let corners = (0..manifold.triangles.len()).map(|t| manifold.corners(t));
        Ok(Self {
            kind: Kind::Decimated,
            notes,
            stands: manifold
                .source
                .iter()
                .zip(&into)
                .filter_map(stand)
                .collect(),
            long: corners.filter(|t| steps_on(*t, edge) > 1.0).collect(),
            edge,
            manifold: fewer,
        })
    }

    /// Places on the long triangles of the scan, as far apart as the vertices of this mesh, each with its parameters;
    /// at most as many as the scan has points.
    pub(super) fn inside(
        &self,
        scan: &CleanScan,
        mesh: &Manifold,
        chart: &MeshChart,
    ) -> Result<Vec<(DVec3, DVec2)>> {
        let count = |step: f64| -> f64 {
            let steps = self.long.iter().map(|t| steps_on(*t, step));
            steps
                .filter(|s| *s > 1.0)
                .map(|s| 0.5 * s * (s + 1.0))
                .sum()
        };
        let mut step = self.edge;
        while count(step) > scan.points.len() as f64 && step < f64::INFINITY {
            step *= 2.0;
        }
        let (mut places, mut normals) = (Vec::new(), Vec::new());
        for &[a, b, c] in &self.long {
            let steps = steps_on([a, b, c], step);
            if steps > 1.0 {
                let at = |[f, g]: [f64; 2]| a + (b - a) * f + (c - a) * g;
                places.extend(middles(steps).map(at));
                normals.resize(places.len(), (b - a).cross(c - a).normalize_or_zero());
            }
        }
        let placed = chart.place(mesh, &places, Some(&normals))?;
        // Places on parts that were cut off are left out.
        let from = self.loose_from(scan);
        let near = |&(k, _): &(usize, &DVec3)| {
            placed.beyond[k] <= super::over_mesh::MAX_BEYOND * scan.spacing
                && placed.distances[k] <= from
        };
        let kept = places.iter().enumerate().filter(near);
        Ok(kept.map(|(k, &p)| (p, placed.parameters[k])).collect())
    }

    /// The distance from which bits of the mesh are loose.
    fn loose_from(&self, scan: &CleanScan) -> f64 {
        // The remains of a tooth of a decimated mesh are as large as its triangles.
        LOOSE_DISTANCE * scan.spacing.max(self.edge)
    }

    /// Points of connected bits without a vertex in `mesh`, the mesh that was charted in the end, if they reach far
    /// from it: pieces that only touched it. Teeth of the rim stay near it. Empty if there are none, or if the scan has
    /// no triangles. O(n).
    pub(super) fn loose_bits(
        &self,
        scan: &CleanScan,
        mesh: &Manifold,
        distances: &[f64],
    ) -> Vec<bool> {
        if self.kind == Kind::Cloud {
            return Vec::new();
        }
        let mut left = vec![false; scan.points.len()];
        for k in mesh.source.iter().copied().flatten() {
            left[k as usize] = true;
        }
        let mut out = vec![false; scan.points.len()];
        for &k in scan.triangles.iter().flatten() {
            out[k as usize] = true;
        }
        for &[point, stands_for_it] in &self.stands {
            if left[stands_for_it as usize] {
                out[point as usize] = false;
            }
        }
        let mut sets = DisjointSets::new(out.len());
        for t in &scan.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                if out[a as usize] && out[b as usize] {
                    sets.join(a as usize, b as usize);
                }
            }
        }
        let from = self.loose_from(scan);
        let mut far = vec![false; out.len()];
        for k in (0..out.len()).filter(|&k| out[k]) {
            far[sets.root(k)] |= distances[k] > from;
        }
        for (k, out) in out.iter_mut().enumerate() {
            *out = *out && far[sets.root(k)];
        }
        if out.contains(&true) { out } else { Vec::new() }
    }
}

/// Triangulates the points, or a sample of them if there are many or their noise is wide.
fn meshed(
    scan: &CleanScan,
    walls: Walls,
    progress: &dyn Progress,
) -> Result<(Vec<DVec3>, Vec<[u32; 3]>)> {
    let triangulate = |points: &[DVec3], normals: &[DVec3]| match walls {
        Walls::Apart => triangulate::triangulate_oriented(points, normals, progress),
        Walls::Either => triangulate::triangulate(points, normals, progress),
    };
    let (points, normals) = (&scan.points, &scan.normals);
    let rough = scan.noise > MAX_MESH_NOISE * scan.spacing;
    let radius = if scan.squares <= MAX_CLOUD_POINTS && !rough {
        // Closer points make triangles that stand on end, or degenerate ones along lines.
        (scan.noise / MAX_MESH_NOISE).max(if scan.is_on_lines() {
            LINE_POINT_DISTANCE * scan.spacing
        } else {
            0.0
        })
    } else {
        let wanted = LAYOUT_VERTICES.min(scan.squares / 2);
        let even = thin::radius_for(wanted, scan.squares, scan.spacing);
        even.max(scan.noise / SMOOTH_MESH_NOISE)
    };
    let kept = thin::thin(points, Some(normals), radius, scan.noise);
    if kept.is_empty() || kept.len() == points.len() {
        let triangles = triangulate(points, normals)?;
        return Ok((points.clone(), triangles));
    }
    progress.check()?;
    // The kept points, and the points that smooth them.
    let few = subset(points, POINTS_PER_VERTEX * LAYOUT_VERTICES, |_| true);
    let chosen = [&kept[..], &few].concat();
    let (points, normals) = (gather(points, &chosen), gather(normals, &chosen));
    let kept: Vec<u32> = (0..).take(kept.len()).collect();
    let smoothed = thin::smooth(&points, &normals, &kept, radius, scan.noise, progress)?;
    let triangles = triangulate(&smoothed.points, &smoothed.normals)?;
    Ok((smoothed.points, triangles))
}

//! The mesh that a part of a scan is charted over: its own, a smaller one of the same topology, or one made of its points.

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

/// A chart is made of the scan's own mesh with at most so many vertices; where there are more, of one with
/// [`WANTED_VERTICES`] that has the same topology.
const MOST_VERTICES: usize = 60_000;
/// A cloud with at most so many points is triangulated as it is; of a larger one, a part of about [`WANTED_VERTICES`].
const MOST_TO_CONNECT: usize = 30_000;
/// Vertices that do for any shape that 1600 control points can follow. On meshes of a bent tube and an ellipsoid with 150,000 to
/// 210,000 vertices, 30,000 changed what 95 % of the points keep by less than 1 %.
const WANTED_VERTICES: usize = 20_000;
/// So many points per vertex, at most, say where it is, beside itself: as many as its smoothing uses.
const PER_VERTEX: usize = 24;
/// Noise above this part of the spacing roughens a mesh; ...
const ROUGH: f64 = 0.3;
/// ... of vertices so far apart that it is this part of their distance it can be smoothed away.
const SMOOTHED: f64 = 0.15;
/// Points on lines that are kept are so many spacings apart.
const ALONG: f64 = 0.7;
/// Bits of a mesh that reach farther than this many spacings from the piece that is charted are no part of it.
const LOOSE: f64 = 4.0;

/// Where a mesh comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// The scan's own, repaired.
    Own,
    /// That with fewer vertices.
    Decimated,
    /// Triangles were made between the points, or a part of them.
    Cloud,
}

/// Whether walls of a cloud that look opposite ways are kept apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Walls {
    /// However close they are.
    Apart,
    /// Only where they are a spacing and a half apart.
    Either,
}

/// A mesh to chart.
pub(super) struct Base {
    pub(super) manifold: Manifold,
    pub(super) kind: Kind,
    /// What was changed.
    pub(super) notes: Vec<String>,
    /// Points of the scan in the mesh, each with the one that is the source of its vertex; none for a cloud.
    stands: Vec<[u32; 2]>,
    /// Where it has fewer vertices than the scan, the side of its triangles, ...
    edge: f64,
    /// ... and the scan's own triangles that are longer: points are farther apart there than its vertices.
    long: Vec<[DVec3; 3]>,
}

impl Base {
    /// The scan's mesh is taken at its word: where it has too many vertices to be laid out in good time, edges are collapsed
    /// such that handles and borders stay.
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
        if manifold.points.len() <= MOST_VERTICES {
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
        } = decimate(&manifold, WANTED_VERTICES, progress)?;
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

    /// Places on the long triangles that the scan came with, as far apart as the vertices of this mesh, each with its
    /// parameters; no more than the scan has points.
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
        // Not those of what was cut off.
        let from = self.loose_from(scan);
        let near = |&(k, _): &(usize, &DVec3)| {
            placed.beyond[k] <= super::BEYOND * scan.spacing && placed.distances[k] <= from
        };
        let kept = places.iter().enumerate().filter(near);
        Ok(kept.map(|(k, &p)| (p, placed.parameters[k])).collect())
    }

    /// The distance from which bits of the mesh are loose.
    fn loose_from(&self, scan: &CleanScan) -> f64 {
        // What is left of a tooth of a mesh of fewer vertices is as large as its triangles.
        LOOSE * scan.spacing.max(self.edge)
    }

    /// The points of bits that hang together and of which no vertex is left in `mesh`, what was charted in the end, if they
    /// reach far from it: pieces that only touched it. Teeth of the rim stay near it. None if there are none, or no
    /// triangles came with the scan. O(n).
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

/// Triangles between the points, or a part of them where there are many or noise roughens them.
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
    let rough = scan.noise > ROUGH * scan.spacing;
    let radius = if scan.squares <= MOST_TO_CONNECT && !rough {
        // Points closer than that make triangles that stand on end, or lines.
        (scan.noise / ROUGH).max(if scan.is_on_lines() {
            ALONG * scan.spacing
        } else {
            0.0
        })
    } else {
        let wanted = WANTED_VERTICES.min(scan.squares / 2);
        let even = thin::radius_for(wanted, scan.squares, scan.spacing);
        even.max(scan.noise / SMOOTHED)
    };
    let kept = thin::thin(points, Some(normals), radius, scan.noise);
    if kept.is_empty() || kept.len() == points.len() {
        let triangles = triangulate(points, normals)?;
        return Ok((points.clone(), triangles));
    }
    progress.check()?;
    // What is kept, and what says where it is.
    let few = subset(points, PER_VERTEX * WANTED_VERTICES, |_| true);
    let chosen = [&kept[..], &few].concat();
    let (points, normals) = (gather(points, &chosen), gather(normals, &chosen));
    let kept: Vec<u32> = (0..).take(kept.len()).collect();
    let smoothed = thin::smooth(&points, &normals, &kept, radius, scan.noise, progress)?;
    let triangles = triangulate(&smoothed.points, &smoothed.normals)?;
    Ok((smoothed.points, triangles))
}

//! (u, v) for every point of one part of a scan: by projection where a plane will do, else over a mesh.

use super::notes::Notes;
use crate::chart::plane::{PlaneChart, plane_chart};
use crate::chart::shape::{MeshShape, shape_of};
use crate::chart::surface_mesh::{ChartQuality, MeshChart, chart_of_mesh};
use crate::chart::{Chart, Topology};
use crate::fit::approximate::Facing;
use crate::mesh::subset::subset;
use crate::mesh::{Manifold, holes, repair, thin, triangulate};
use crate::numeric::disjoint_sets::DisjointSets;
use crate::progress::Progress;
use crate::scan::blocks::gather;
use crate::scan::clean::CleanScan;
use crate::unit::{Unit, counted};
use crate::{Error, Result};
use glam::{DVec2, DVec3};

/// A chart is made of the scan's own mesh with at most so many vertices, ...
const MOST_VERTICES: usize = 60_000;
/// ... of a mesh of all points with at most so many, ...
const MOST_TO_CONNECT: usize = 30_000;
/// ... and else of a part of the points of about so many: enough for any shape that 1600 control points can follow.
const WANTED_VERTICES: usize = 20_000;
/// So many points per vertex, at most, say where it is, beside itself: as many as its smoothing uses.
const PER_VERTEX: usize = 24;
/// A mean stretch, or a part folded over, above which another chart is tried.
const STRETCHED: f64 = 3.0;
const FOLDED: f64 = 5e-3;
/// Part of a cloud without a place of its own on a plane, up to which it needs no mesh.
const CERTAIN: f64 = 5e-3;
/// Triangles longer than this many spacings hold the surface between their corners; at most so many steps along each. In a
/// mesh that came as one those of even vertices are 1.1 to 1.5 spacings long: they say no more than their corners.
const SUPPORT: f64 = 2.0;
const SUPPORT_OF_MESH: f64 = 1.6;
const MOST_STEPS: f64 = 16.0;
/// Times that pockets are looked for.
const POCKETS: usize = 3;
/// Noise above this part of the spacing roughens a mesh; ...
const ROUGH: f64 = 0.3;
/// ... of vertices so far apart that it is this part of their distance it can be smoothed away.
const SMOOTHED: f64 = 0.15;
/// Points on lines that are kept are so many spacings apart.
const ALONG: f64 = 0.7;
/// Points farther than this many spacings beyond a border are not part of the surface: on it they would pile up.
const BEYOND: f64 = 1.0;
/// Bits of a mesh that reach farther than this many spacings from the piece that is charted are no part of it.
const LOOSE: f64 = 4.0;

/// (u, v) for every point, and what was found on the way.
pub(super) struct Charted {
    pub(super) chart: Chart,
    /// Points past the surface's borders.
    pub(super) beyond: Vec<bool>,
    /// Points of bits of the scan's mesh that are not part of the surface; none where there are no such bits.
    pub(super) loose: Vec<bool>,
    /// Places on the scan's own triangles, and in the domain, where these are large: they count as points do.
    pub(super) inside: Vec<(DVec3, DVec2)>,
    /// Places where only the mesh that was made of the scan says where the surface may be, as in holes that were filled.
    pub(super) support: Vec<(DVec3, DVec2)>,
    /// Which way the mesh faces, at its rims and inside.
    pub(super) facing: Vec<Facing>,
    pub(super) notes: Notes,
}

/// By projection where there is no mesh and a plane will do, else over a mesh; where that comes out badly, as over the
/// frayed borders of a range image, or over the mesh of a cloud that a plane nearly does for, by projection after all.
pub(super) fn chart(
    scan: &CleanScan,
    vertices: bool,
    topology: Option<Topology>,
    progress: &dyn Progress,
) -> Result<Charted> {
    let sheet = topology.is_none_or(|t| t == Topology::Disk);
    let mut flat = None;
    if scan.triangles.is_empty() && sheet {
        match projected(scan) {
            Err(Error::Unsupported(_)) => {}
            Ok((flat, doubtful)) if doubtful <= CERTAIN => return Ok(flat),
            other => flat = Some(other?.0),
        }
    }
    let over_mesh = chart_over_mesh(scan, vertices, topology, progress);
    if let Some(flat) = flat {
        // A sheet that bends over beyond upright somewhere has its place on a mesh only, if it has one.
        return match over_mesh {
            Ok((over_mesh, quality))
                if over_mesh.chart.topology == Topology::Disk && !is_poor_chart(quality) =>
            {
                Ok(over_mesh)
            }
            Err(Error::Cancelled) => Err(Error::Cancelled),
            _ => Ok(flat),
        };
    }
    let (over_mesh, quality) = over_mesh?;
    let poor = is_poor_chart(quality);
    if poor && sheet && over_mesh.chart.topology == Topology::Disk {
        match projected(scan) {
            Err(Error::Unsupported(_)) => {}
            other => return other.map(|found| found.0),
        }
    }
    if quality.folded > FOLDED {
        return Err(Error::Unsupported(format!(
            "the surface cannot be laid out: {:.1} % of it would fold over; its border is too ragged or it is crumpled",
            100.0 * quality.folded
        )));
    }
    Ok(over_mesh)
}

/// The chart by projection onto the best plane, and the part of the scan that has no place of its own there.
fn projected(scan: &CleanScan) -> Result<(Charted, f64)> {
    let PlaneChart {
        chart,
        beyond,
        doubtful,
    } = plane_chart(scan)?;
    let mut notes = Notes::default();
    notes.detail(chart.reason.clone());
    let charted = Charted {
        chart,
        beyond,
        loose: Vec::new(),
        inside: Vec::new(),
        support: Vec::new(),
        facing: Vec::new(),
        notes,
    };
    Ok((charted, doubtful))
}

/// 1. A mesh, repaired. 2. What shape it is. 3. Its holes filled, its chart, and every point in it.
fn chart_over_mesh(
    scan: &CleanScan,
    vertices: bool,
    topology: Option<Topology>,
    progress: &dyn Progress,
) -> Result<(Charted, ChartQuality)> {
    let is_cloud = scan.triangles.is_empty() || scan.points.len() > MOST_VERTICES;
    let repaired = if is_cloud {
        let (points, triangles) = meshed(scan, progress)?;
        repair::repair(&points, &triangles, progress)?
    } else {
        repair::repair(&scan.points, &scan.triangles, progress)?
    };
    let mut notes = Notes {
        details: repaired.notes,
        ..Notes::default()
    };
    let free = topology.is_none();
    let shape = shape_of(&repaired.manifold, topology).map_err(|error| match error {
        // The mesh is a guess.
        Error::Unsupported(why) if is_cloud && free => Error::Unsupported(format!(
            "{why}; if walls that lie closer together than about {} were joined by mistake, fit a mesh of the part",
            scan.unit.length(2.0 * typical_edge(&repaired.manifold))
        )),
        other => other,
    })?;
    notes.detail(described(&shape, &repaired.manifold, scan.unit));
    let mut laid = without_pockets(repaired.manifold.clone(), &shape, progress);
    if free && shape.topology == Topology::Tube && is_poor(&laid) {
        // A sheet with a large hole can look like a tube.
        let sheet_shape = shape_of(&repaired.manifold, Some(Topology::Disk))?;
        let sheet = without_pockets(repaired.manifold, &sheet_shape, progress);
        if stretch(&sheet) < stretch(&laid) {
            laid = sheet;
            notes.detail(format!(
                "laid out with less stretch as a {}",
                sheet_shape.reason
            ));
        }
    }
    let laid = laid?;
    notes.append(laid.notes);
    let (mesh, charted) = (laid.mesh, laid.chart);
    let count = laid.scanned;
    let placed = charted.place(&mesh, &scan.points, Some(&scan.normals))?;
    let beyond = placed.beyond.iter().map(|&by| by > BEYOND * scan.spacing);
    let beyond = beyond.collect();
    let loose = match is_cloud {
        true => Vec::new(),
        false => loose_bits(scan, &mesh, &placed.distances),
    };
    let chart = charted.chart_of(placed.parameters);
    let places = |range: std::ops::Range<usize>, step: f64| {
        let filled = range.start >= count;
        let pairs = mesh.triangles[range.clone()]
            .iter()
            .zip(&charted.corners[range]);
        let corners = pairs.map(|(t, at)| (t.map(|k| mesh.points[k as usize]), *at));
        places_on(corners, charted.topology, step, filled)
    };
    let long = if vertices && !is_cloud {
        SUPPORT_OF_MESH
    } else {
        SUPPORT
    };
    let (scanned, filled) = (0..count, count..mesh.triangles.len());
    let (inside, support) = if is_cloud {
        // Between the points of a mesh that was made of a cloud there may be more of them.
        let step = long * scan.spacing.max(typical_edge(&mesh));
        let all = [places(scanned, step), places(filled, step)];
        (Vec::new(), all.concat())
    } else {
        let step = long * scan.spacing;
        (places(scanned, step), places(filled, step))
    };
    let facing = facing(&mesh, &charted, count);
    let [long, wide] = charted.size.map(|size| scan.unit.length(size));
    notes.detail(format!("{}; about {long} x {wide}", chart.reason));
    let quality = charted.quality;
    Ok((
        Charted {
            beyond,
            loose,
            chart,
            inside,
            support,
            facing,
            notes,
        },
        quality,
    ))
}

/// What shape a mesh is, with the lengths of its openings.
fn described(shape: &MeshShape, mesh: &Manifold, unit: Unit) -> String {
    let around = |&k: &usize| unit.length(mesh.border_length(k));
    let openings: Vec<String> = shape.openings.iter().map(around).collect();
    match openings.is_empty() {
        true => shape.reason.clone(),
        false => format!("{}; border length {}", shape.reason, openings.join(" and ")),
    }
}

/// Which way a mesh faces, at its rims and on its first `count` triangles. O(n log n).
fn facing(mesh: &Manifold, charted: &MeshChart, count: usize) -> Vec<Facing> {
    let made = |inside: bool| {
        move |(parameters, normal): (DVec2, DVec3)| Facing {
            parameters,
            normal,
            inside,
        }
    };
    let rims = charted.facing_at_rims(mesh, typical_edge(mesh));
    let middles = charted.facing(mesh, count);
    let rims = rims.into_iter().map(made(false));
    rims.chain(middles.into_iter().map(made(true))).collect()
}

/// The points of bits that hang together and of which no vertex is left in `mesh`, if they reach far from it: pieces that
/// only touched it. Teeth of the rim stay near it. None if there are none. O(n).
fn loose_bits(scan: &CleanScan, mesh: &Manifold, distances: &[f64]) -> Vec<bool> {
    let mut out = vec![false; scan.points.len()];
    for &k in scan.triangles.iter().flatten() {
        out[k as usize] = true;
    }
    for k in mesh.source.iter().copied().flatten() {
        out[k as usize] = false;
    }
    let mut sets = DisjointSets::new(out.len());
    for t in &scan.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            if out[a as usize] && out[b as usize] {
                sets.join(a as usize, b as usize);
            }
        }
    }
    let mut far = vec![false; out.len()];
    for k in (0..out.len()).filter(|&k| out[k]) {
        far[sets.root(k)] |= distances[k] > LOOSE * scan.spacing;
    }
    for (k, out) in out.iter_mut().enumerate() {
        *out = *out && far[sets.root(k)];
    }
    if out.contains(&true) { out } else { Vec::new() }
}

/// A mesh laid out with its holes filled.
struct LaidOut {
    /// Before anything was filled.
    source: Manifold,
    mesh: Manifold,
    /// Triangles that are the scan's; those after them were filled in.
    scanned: usize,
    chart: MeshChart,
    notes: Notes,
}

/// How much a chart stretches; without end where there is none.
fn stretch(laid: &Result<LaidOut>) -> f64 {
    let stretch = laid.as_ref().map(|laid| laid.chart.quality.stretch);
    stretch.unwrap_or(f64::INFINITY)
}

/// Whether another chart may be better.
fn is_poor_chart(quality: ChartQuality) -> bool {
    quality.stretch > STRETCHED || quality.folded > FOLDED
}

/// The same of a mesh that may not have been laid out at all.
fn is_poor(laid: &Result<LaidOut>) -> bool {
    match laid {
        Ok(laid) => is_poor_chart(laid.chart.quality),
        Err(why) => matches!(why, Error::Unsupported(_)),
    }
}

/// Lays a mesh out, and again without what hangs on it by too narrow a neck.
fn without_pockets(
    source: Manifold,
    shape: &MeshShape,
    progress: &dyn Progress,
) -> Result<LaidOut> {
    let mut laid = lay_out(source, &shape.holes, progress)?;
    let mut cut = 0;
    for _ in 0..POCKETS {
        let mut pockets = laid.chart.pockets(&laid.mesh);
        pockets.truncate(laid.scanned);
        let count = pockets.iter().filter(|p| **p).count();
        if count == 0 {
            break;
        }
        let manifold = repair::without(laid.source.clone(), &pockets);
        let Ok(shape) = shape_of(&manifold, Some(shape.topology)) else {
            break;
        };
        progress.check()?;
        let Ok(next) = lay_out(manifold, &shape.holes, progress) else {
            break;
        };
        if next.chart.quality.folded > laid.chart.quality.folded {
            break;
        }
        cut += count;
        laid = next;
    }
    if cut > 0 {
        laid.notes.detail(format!(
            "removed {} attached only by a narrow neck",
            counted(cut, "triangle", "triangles")
        ));
    }
    Ok(laid)
}

/// Fills the holes and charts.
fn lay_out(source: Manifold, holes: &[usize], progress: &dyn Progress) -> Result<LaidOut> {
    let mut notes = Notes::default();
    let scanned = source.triangles.len();
    let (mesh, filled) = holes::fill(source.clone(), holes);
    if !filled.is_empty() {
        notes.detail(format!(
            "bridged {} to lay the mesh out",
            counted(filled.len(), "hole", "holes")
        ));
    }
    let chart = chart_of_mesh(&mesh, progress)?;
    Ok(LaidOut {
        source,
        mesh,
        scanned,
        chart,
        notes,
    })
}

/// The side of an equilateral triangle of the mean area.
fn typical_edge(mesh: &Manifold) -> f64 {
    let each = mesh.area() / mesh.triangles.len().max(1) as f64;
    (4.0 / 3.0_f64.sqrt() * each).sqrt()
}

/// Places on the triangles that are longer than the step, or on all of them, each with its parameters: there the mesh
/// says where the surface is, and no point does.
fn places_on(
    triangles: impl Iterator<Item = ([DVec3; 3], [DVec2; 3])>,
    topology: Topology,
    step: f64,
    all: bool,
) -> Vec<(DVec3, DVec2)> {
    let mut places = Vec::new();
    for ([a, b, c], [p, q, r]) in triangles {
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let steps = (longest / step).ceil().clamp(1.0, MOST_STEPS);
        if steps <= 1.0 && !all {
            continue;
        }
        // The middles of the small triangles that stand upright.
        let mut i = 0.0;
        while i < steps {
            let mut j = 0.0;
            while i + j < steps {
                let (f, g) = ((i + 1.0 / 3.0) / steps, (j + 1.0 / 3.0) / steps);
                places.push((
                    a + (b - a) * f + (c - a) * g,
                    topology.within(p + (q - p) * f + (r - p) * g),
                ));
                j += 1.0;
            }
            i += 1.0;
        }
    }
    places
}

/// Triangles between the points, or a part of them where there are many or noise roughens them.
fn meshed(scan: &CleanScan, progress: &dyn Progress) -> Result<(Vec<DVec3>, Vec<[u32; 3]>)> {
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
        let triangles = triangulate::triangulate(points, normals, progress)?;
        return Ok((points.clone(), triangles));
    }
    progress.check()?;
    // What is kept, and what says where it is.
    let few = subset(points, PER_VERTEX * WANTED_VERTICES, |_| true);
    let chosen = [&kept[..], &few].concat();
    let (points, normals) = (gather(points, &chosen), gather(normals, &chosen));
    let kept: Vec<u32> = (0..).take(kept.len()).collect();
    let smoothed = thin::smooth(&points, &normals, &kept, radius, scan.noise, progress)?;
    let triangles = triangulate::triangulate(&smoothed.points, &smoothed.normals, progress)?;
    Ok((smoothed.points, triangles))
}

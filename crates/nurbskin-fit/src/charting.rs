//! The chart of a scan: (u, v) for every point of one cleaned part, whatever its shape.
//!
//! A sheet that projects onto its best plane takes its parameters from there. Everything else is charted over a mesh: the scan's
//! own, one with fewer vertices and the same topology, or one made of its points. The topology of that mesh (disk, tube, sphere
//! or ring) follows from its genus and its borders; where several topologies are possible, each is charted and scored by a
//! coarse fit. Holes are bridged for the layout alone.

mod base;
mod reading;

use self::base::{Base, Kind, Walls};
use crate::chart::plane::{PlaneChart, RECTANGULAR, Sides, plane_chart};
use crate::chart::shape::{MeshShape, shape_of};
use crate::chart::surface_mesh::{ChartQuality, FEW_FOLDED, MeshChart, chart_of_mesh};
use crate::chart::{Chart, Topology};
use crate::fit::approximate::Facing;
use glam::{DVec2, DVec3};
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::{Unit, counted};
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::clean::CleanScan;
use nurbskin_scan::mesh::{Manifold, holes, repair};

/// A root mean square stretch, or a part folded over, above which another chart is tried.
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
/// Points farther than this many spacings beyond a border are not part of the surface: on it they would pile up.
const BEYOND: f64 = 1.0;

/// How a scan is charted.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChartOptions {
    /// The topology of the domain; chosen by the shape where absent.
    pub topology: Option<Topology>,
    /// Whether the points are the vertices of a mesh, which are as even as their maker left them.
    pub vertices: bool,
}

/// (u, v) for every point, and what was found on the way.
#[derive(Clone, Debug)]
pub struct Charted {
    /// The domain, and (u, v) for each point.
    pub chart: Chart,
    /// Points past the surface's borders.
    pub beyond: Vec<bool>,
    /// Points of bits of the scan's mesh that are not part of the surface; none where there are no such bits.
    pub loose: Vec<bool>,
    /// Places on the scan's own triangles, and in the domain, where these are large: they count as points do.
    pub inside: Vec<(DVec3, DVec2)>,
    /// Places where only the mesh that was made of the scan says where the surface may be, as in holes that were filled.
    pub support: Vec<(DVec3, DVec2)>,
    /// Which way the mesh faces, at its rims and inside.
    pub facing: Vec<Facing>,
    /// Axes along u and v and across the sheet, where its surface goes on beyond the outline to fill a rectangle.
    pub extends: Option<[DVec3; 3]>,
    /// Whether (u, v) are the places on its best plane.
    pub is_flat: bool,
    /// What was repaired and chosen.
    pub notes: Notes,
}

/// By projection where there is no mesh and a plane will do, else over a mesh; where that comes out badly, as over the
/// frayed borders of a range image, or over the mesh of a cloud that a plane nearly does for, by projection after all.
///
/// O(n log n) for n points, with at most 60,000 vertices laid out.
///
/// # Errors
/// [`Error::Unsupported`] for shapes without a chart, such as those with handles or branches, or a topology other than that
/// asked for; [`Error::NoSolution`]; [`Error::Cancelled`].
pub fn chart(scan: &CleanScan, options: &ChartOptions, progress: &dyn Progress) -> Result<Charted> {
    let &ChartOptions { topology, vertices } = options;
    let sheet = topology.is_none_or(|t| t == Topology::Disk);
    let mut flat = None;
    if scan.triangles.is_empty() && sheet {
        match projected(scan, Sides::Outline) {
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
        match projected(scan, Sides::Outline) {
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

/// The rectangle around a sheet that projects onto its best plane and does not fill it; `None` for what is no such sheet.
///
/// # Errors
/// [`Error::Invalid`] if there are no points.
pub fn natural_base(scan: &CleanScan, options: &ChartOptions) -> Result<Option<Charted>> {
    let &ChartOptions { topology, vertices } = options;
    if topology.is_some_and(|t| t != Topology::Disk) {
        return Ok(None);
    }
    match projected(scan, Sides::Rectangle) {
        Ok((charted, doubtful)) if charted.extends.is_none() || doubtful > CERTAIN => Ok(None),
        Ok((mut charted, _)) => {
            let step = scan.spacing * if vertices { SUPPORT_OF_MESH } else { SUPPORT };
            let of = |k: u32| {
                let k = k as usize;
                (scan.points[k], charted.chart.parameters[k])
            };
            let corners = scan.triangles.iter().map(|t| {
                let corners = t.map(of);
                (corners.map(|c| c.0), corners.map(|c| c.1))
            });
            charted.inside = places_on(corners, Topology::Disk, step, false);
            Ok(Some(charted))
        }
        Err(Error::Unsupported(_)) => Ok(None),
        Err(other) => Err(other),
    }
}

/// The chart by projection onto the best plane, and the part of the scan that has no place of its own there.
fn projected(scan: &CleanScan, sides: Sides) -> Result<(Charted, f64)> {
    let PlaneChart {
        chart,
        beyond,
        doubtful,
        frame,
        filled,
    } = plane_chart(scan, sides)?;
    // A cloud that fills its rectangle has that domain in any case.
    let extends = sides == Sides::Rectangle && (filled < RECTANGULAR || !scan.triangles.is_empty());
    let mut notes = Notes::default();
    notes.detail(chart.reason.clone());
    let charted = Charted {
        chart,
        beyond,
        loose: Vec::new(),
        inside: Vec::new(),
        support: Vec::new(),
        facing: Vec::new(),
        extends: extends.then_some(frame),
        is_flat: sides == Sides::Rectangle || filled >= RECTANGULAR,
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
    let base = Base::of(scan, Walls::Apart, progress)?;
    let is_cloud = base.kind == Kind::Cloud;
    let free = topology.is_none();
    let laid = reading::best(&base.manifold, topology, scan.unit, progress);
    let (base, laid) = match laid {
        // Sides that noise or a sharp fold turned wrong tear a cloud apart, which leaves handles.
        Err(Error::Unsupported(why)) if is_cloud && free => {
            let other = Base::of(scan, Walls::Either, progress)?;
            match reading::best(&other.manifold, topology, scan.unit, progress) {
                Err(Error::Unsupported(_)) => (base, Err(Error::Unsupported(why))),
                laid => (other, laid),
            }
        }
        laid => (base, laid),
    };
    let mut notes = Notes {
        details: base.notes.clone(),
        ..Notes::default()
    };
    let laid = laid.map_err(|error| match error {
        // The mesh is a guess.
        Error::Unsupported(why) if is_cloud && free => Error::Unsupported(format!(
            "{why}; if walls that lie closer together than about {} were joined by mistake, fit a mesh of the part",
            scan.unit.length(2.0 * typical_edge(&base.manifold))
        )),
        other => other,
    })?;
    notes.append(laid.notes);
    let (mesh, charted) = (laid.mesh, laid.chart);
    let count = laid.scanned;
    let placed = charted.place(&mesh, &scan.points, Some(&scan.normals))?;
    let beyond = placed.beyond.iter().map(|&by| by > BEYOND * scan.spacing);
    let beyond = beyond.collect();
    let loose = base.loose_bits(scan, &mesh, &placed.distances);
    let chart = charted.chart_of(placed.parameters);
    let places = |range: std::ops::Range<usize>, step: f64| {
        let filled = range.start >= count;
        let pairs = mesh.triangles[range.clone()]
            .iter()
            .zip(&charted.corners[range]);
        let corners = pairs.map(|(t, at)| (t.map(|k| mesh.points[k as usize]), *at));
        places_on(corners, charted.topology, step, filled)
    };
    let (scanned, filled) = (0..count, count..mesh.triangles.len());
    let long = if vertices { SUPPORT_OF_MESH } else { SUPPORT };
    let step = long * scan.spacing;
    let (inside, support) = match base.kind {
        Kind::Own => (places(scanned, step), places(filled, step)),
        Kind::Decimated => (base.inside(scan, &mesh, &charted)?, places(filled, step)),
        Kind::Cloud => {
            // Between the points of a mesh that was made of a cloud there may be more of them.
            let step = SUPPORT * scan.spacing.max(typical_edge(&mesh));
            let all = [places(scanned, step), places(filled, step)];
            (Vec::new(), all.concat())
        }
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
            extends: None,
            is_flat: false,
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

/// Whether another chart may be better.
fn is_poor_chart(quality: ChartQuality) -> bool {
    quality.stretch > STRETCHED || quality.folded > FOLDED
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
        if next.chart.quality.folded > laid.chart.quality.folded.max(FEW_FOLDED) {
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
        let steps = steps_on([a, b, c], step);
        if steps <= 1.0 && !all {
            continue;
        }
        places.extend(middles(steps).map(|[f, g]| {
            (
                a + (b - a) * f + (c - a) * g,
                topology.within(p + (q - p) * f + (r - p) * g),
            )
        }));
    }
    places
}

/// How many steps the longest side of a triangle takes.
fn steps_on([a, b, c]: [DVec3; 3], step: f64) -> f64 {
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    (longest / step).ceil().clamp(1.0, MOST_STEPS)
}

/// The middles of the small triangles that stand upright in one of so many steps, along its first and its last side.
fn middles(steps: f64) -> impl Iterator<Item = [f64; 2]> {
    let along = move |from: f64| {
        let next = move |at: &f64| Some(at + 1.0).filter(|at| from + at < steps);
        std::iter::successors(Some(0.0).filter(|at| from + at < steps), next)
    };
    along(0.0).flat_map(move |i| along(i).map(move |j| [i, j].map(|at| (at + 1.0 / 3.0) / steps)))
}

#[cfg(test)]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small meshes"
)]
mod tests;

//! The chart of a scan: (u, v) for every point of one cleaned part, whatever its shape.
//!
//! A sheet that projects onto its best plane takes its parameters from there. Everything else is charted over a mesh:
//! the scan's own, one with fewer vertices and the same topology, or one made of its points. The topology of that mesh
//! (disk, tube, sphere or torus) follows from its genus and its borders. Where several topologies are possible, each is
//! charted and scored by a coarse fit. Holes are bridged for the layout alone.
//!
//! The decisions are ours; the methods are those of [`chart`](crate::chart).

mod base;
mod part_mesh;
mod reading;

pub use self::part_mesh::{PartMesh, mesh_of};

use self::base::{Base, Kind, Walls};
use crate::chart::plane::{PlaneChart, RECTANGULAR, Sides, plane_chart};
use crate::chart::shape::{MeshShape, shape_of};
use crate::chart::surface_mesh::{ChartQuality, MAX_NEW_FOLDS, MeshChart, chart_of_mesh};
use crate::chart::{Chart, Topology};
use crate::fit::approximate::Facing;
use glam::{DVec2, DVec3};
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::{Unit, counted};
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::clean::CleanScan;
use nurbskin_scan::mesh::{Manifold, holes, repair};

/// Root mean square stretch of a chart (1 for an isometry) above which another chart is tried. Trial: not recorded.
/// Knots along u and v then meet features of very different sizes.
const POOR_STRETCH: f64 = 3.0;
/// Share of folded triangles above which another chart is tried, and a chart over a mesh is refused in the end. Trial:
/// not recorded.
const POOR_FOLDED: f64 = 5e-3;
/// Share of a cloud without a certain place on the plane, up to which no mesh is made. Trial: on a sheet that curls
/// over at a border, whose strip beyond upright had no place of its own on the plane, 95 % of the points were within
/// 4.28 mm, and over a mesh within 0.04 mm.
const MAX_DOUBTFUL: f64 = 5e-3;
/// Length of a triangle's longest side, in spacings, from which places on it count as points do. Trial: not recorded. A
/// smaller one adds places between points that are close enough.
const LONG_EDGE: f64 = 2.0;
/// The same for the triangles of a mesh file. Trial: those of even vertices are 1.1 to 1.5 spacings long and hold no
/// more than their corners.
const LONG_MESH_EDGE: f64 = 1.6;
/// Most steps along a side of such a triangle. Guard: bounds the places on it to 136.
const MAX_EDGE_STEPS: f64 = 16.0;
/// Most rounds in which pockets are cut off. Guard: a layout without pockets ends them; each round lays the mesh out
/// again.
const POCKET_ROUNDS: usize = 3;
/// Distance past a border, in spacings, from which a point is not part of the surface; such points would pile up on the
/// border. Trial: not recorded; 3 in an earlier version.
const MAX_BEYOND: f64 = 1.0;

/// How a scan is charted.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChartOptions {
    /// The topology of the domain; chosen by the shape if absent.
    pub topology: Option<Topology>,
    /// Whether the points are the vertices of a mesh file, which are as even as its author left them.
    pub vertices: bool,
}

/// What a point of a part is to the surface over its chart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PointState {
    /// It lies over the domain; the surface is fitted to it.
    #[default]
    Charted,
    /// It lies beyond a border of the domain. The fit leaves it out; the deviation counts it.
    Beyond,
    /// It belongs to a bit of the mesh that is not part of the surface.
    Detached,
    /// The fit found it to be an outlier.
    Outlier,
}

/// A chart with its guides for the fit.
#[derive(Clone, Debug)]
pub struct Charted {
    /// The domain, and (u, v) for each point.
    pub chart: Chart,
    /// The state of each point; none is an outlier yet.
    pub states: Vec<PointState>,
    /// Places on the scan's own triangles and in the domain, where these triangles are large; they count as points do.
    pub inside: Vec<(DVec3, DVec2)>,
    /// Places where only a mesh made of the scan shows where the surface may be, as in filled holes.
    pub support: Vec<(DVec3, DVec2)>,
    /// Normals of the mesh, at its rims and inside.
    pub facing: Vec<Facing>,
    /// Axes along u and v and across the sheet, for a sheet whose surface continues beyond the outline to fill a
    /// rectangle.
    pub extends: Option<[DVec3; 3]>,
    /// Whether (u, v) are the coordinates on its best plane.
    pub is_flat: bool,
    /// Repairs and choices, for the user.
    pub notes: Notes,
}

/// Charts by projection if there is no mesh and a plane suffices, else over a mesh. If the chart over the mesh is poor,
/// as for the frayed borders of a range image, or for the mesh of a cloud that nearly projects onto a plane, the
/// projection is used after all.
///
/// O(n log n) for n points, with at most 60,000 vertices laid out.
///
/// # Errors
/// [`Error::Unsupported`] for shapes without a chart, such as those with handles or branches, or with another topology
/// than the one asked for; [`Error::NoSolution`]; [`Error::Cancelled`].
pub fn chart(scan: &CleanScan, options: &ChartOptions, progress: &dyn Progress) -> Result<Charted> {
    let &ChartOptions { topology, vertices } = options;
    let sheet = topology.is_none_or(|t| t == Topology::Disk);
    let mut flat = None;
    if scan.triangles.is_empty() && sheet {
        match projected(scan, Sides::Outline) {
            Err(Error::Unsupported(_)) => {}
            Ok((flat, doubtful)) if doubtful <= MAX_DOUBTFUL => return Ok(flat),
            other => flat = Some(other?.0),
        }
    }
    let over_mesh = chart_over_mesh(scan, vertices, topology, progress);
    if let Some(flat) = flat {
        // A sheet that bends over beyond upright has a place for all points only over a mesh, if it has one.
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
    if quality.folded > POOR_FOLDED {
        return Err(Error::Unsupported(format!(
            "the surface cannot be laid out: {:.1} % of it would fold over; its border is too ragged or it is crumpled",
            100.0 * quality.folded
        )));
    }
    Ok(over_mesh)
}

/// The chart in the rectangle around a sheet that projects onto its best plane and does not fill that rectangle; `None`
/// for other scans.
///
/// # Errors
/// [`Error::Invalid`] if there are no points.
pub fn natural_base(scan: &CleanScan, options: &ChartOptions) -> Result<Option<Charted>> {
    let &ChartOptions { topology, vertices } = options;
    if topology.is_some_and(|t| t != Topology::Disk) {
        return Ok(None);
    }
    match projected(scan, Sides::Rectangle) {
        Ok((charted, doubtful)) if charted.extends.is_none() || doubtful > MAX_DOUBTFUL => Ok(None),
        Ok((mut charted, _)) => {
            let step = scan.spacing * if vertices { LONG_MESH_EDGE } else { LONG_EDGE };
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

/// The chart by projection onto the best plane, and the share of the scan without a place of its own there.
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
        states: states(beyond.into_iter(), &[]),
        inside: Vec::new(),
        support: Vec::new(),
        facing: Vec::new(),
        extends: extends.then_some(frame),
        is_flat: sides == Sides::Rectangle || filled >= RECTANGULAR,
        notes,
    };
    Ok((charted, doubtful))
}

/// Charts over a mesh: 1. a mesh, repaired; 2. its topology; 3. its holes filled, its chart, and a place for every
/// point.
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
        // Normals whose sides are wrong, after noise or at a sharp fold, tear a cloud apart and leave handles.
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
        // The mesh of a cloud is a guess.
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
    let beyond = placed
        .beyond
        .iter()
        .map(|&by| by > MAX_BEYOND * scan.spacing);
    let loose = base.loose_bits(scan, &mesh, &placed.distances);
    let states = states(beyond, &loose);
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
    let long = if vertices { LONG_MESH_EDGE } else { LONG_EDGE };
    let step = long * scan.spacing;
    let (inside, support) = match base.kind {
        Kind::Own => (places(scanned, step), places(filled, step)),
        Kind::Decimated => (base.inside(scan, &mesh, &charted)?, places(filled, step)),
        Kind::Cloud => {
            // Between the vertices of a mesh that was made of a cloud there may be further points.
            let step = LONG_EDGE * scan.spacing.max(typical_edge(&mesh));
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
            states,
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

/// The states of points that lie `beyond` the borders, or on `loose` bits, which go first; the latter may be empty.
fn states(beyond: impl Iterator<Item = bool>, loose: &[bool]) -> Vec<PointState> {
    let of = |(k, beyond): (usize, bool)| match (loose.get(k), beyond) {
        (Some(true), _) => PointState::Detached,
        (_, true) => PointState::Beyond,
        (_, false) => PointState::Charted,
    };
    beyond.enumerate().map(of).collect()
}

/// A description of the shape of a mesh, with the lengths of its openings.
fn described(shape: &MeshShape, mesh: &Manifold, unit: Unit) -> String {
    let around = |&k: &usize| unit.length(mesh.border_length(k));
    let openings: Vec<String> = shape.openings.iter().map(around).collect();
    match openings.is_empty() {
        true => shape.reason.clone(),
        false => format!("{}; border length {}", shape.reason, openings.join(" and ")),
    }
}

/// Normals of a mesh, at its rims and on its first `count` triangles. O(n log n).
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
    /// The mesh before holes were filled.
    source: Manifold,
    mesh: Manifold,
    /// Number of triangles of the scan; those after them were filled in.
    scanned: usize,
    chart: MeshChart,
    notes: Notes,
}

/// Whether the chart is so poor that another one is tried.
fn is_poor_chart(quality: ChartQuality) -> bool {
    quality.stretch > POOR_STRETCH || quality.folded > POOR_FOLDED
}

/// Lays a mesh out, and again without patches that hang on it by too narrow a neck.
fn without_pockets(
    source: Manifold,
    shape: &MeshShape,
    progress: &dyn Progress,
) -> Result<LaidOut> {
    let mut laid = lay_out(source, &shape.holes, progress)?;
    let mut cut = 0;
    for _ in 0..POCKET_ROUNDS {
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
        if next.chart.quality.folded > laid.chart.quality.folded.max(MAX_NEW_FOLDS) {
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

/// Fills the holes and charts the mesh.
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
/// shows where the surface is, and no point does.
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

/// Number of steps along the longest side of a triangle.
fn steps_on([a, b, c]: [DVec3; 3], step: f64) -> f64 {
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    (longest / step).ceil().clamp(1.0, MAX_EDGE_STEPS)
}

/// A triangle is divided into `steps` parts per side; these are the middles of the upright small triangles, along its
/// first and its last side.
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

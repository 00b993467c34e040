//! Charts of meshes of all four topologies.
//!
//! 1. Genus and borders give the topology, and with it the domain and its cuts ([`disk`], [`closed`]).
//! 2. A harmonic layout, relaxed round by round until its stretch no longer falls ([`Relaxation`]). For a sphere,
//!    several pairs of poles are relaxed at the same time as long as they keep up with the best.
//! 3. Places are wrapped into the domain, and folds, stretch and scales are measured.
//!
//! Sources: see [`super`]. The competition of poles is ours.

use super::layout::{Setup, Surface, derivatives};
use super::poles;
use super::relax::{Layout, Relaxation, lay_out};
use super::{closed, disk};
use crate::chart::Topology;
use glam::{DMat2, DVec2};
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::percent;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::mesh::Manifold;
use rayon::prelude::*;

/// Most rounds that lower the stretch. Guard: rounds end earlier where the gain is small.
const MAX_RELAXATION_ROUNDS: usize = 8;
/// Mean stretch of a pair of poles, over that of the best pair after as many rounds, above which it is given up. Trial:
/// on the closed scans of docs/real-scans.md, the pairs that win in the end are within 1.03 after each round.
const MAX_POLE_LAG: f64 = 1.1;
/// Ratio of mean stretches within which pairs of poles are equal, and the root mean square decides. Trial: not
/// recorded.
const POLE_TIE: f64 = 1.005;
/// Largest share of folded triangles of a layout. Trial: not recorded; 0.02 in an earlier version. With more, no later
/// step can mend it.
const MAX_FOLDED: f64 = 0.1;
/// Quantiles of the ratio of areas in the domain and in space that are reported as the scales. Guard: the extremes are
/// single triangles.
const SCALE_QUANTILES: [f64; 2] = [0.99, 0.01];

/// A mesh laid out on its domain.
#[derive(Clone, Debug)]
pub struct MeshChart {
    /// Which directions are closed.
    pub topology: Topology,
    /// (u, v) of each vertex: in 0..1 in closed directions; in 0..=1 in open ones, except for the tips of ragged rims,
    /// which stand out a little. A pole has u = 0 or 1 and no v of its own.
    pub places: Vec<DVec2>,
    /// (u, v) of the corners of each triangle, next to each other and not wrapped: they differ from the vertices' by
    /// whole turns in closed directions. A corner at a pole has the mean v of the other two.
    pub corners: Vec<[DVec2; 3]>,
    /// Mean lengths of the iso-lines along u and along v, in the unit of the mesh.
    pub size: [f64; 2],
    /// The vertices at u = 0 and u = 1 of a sphere.
    pub poles: Option<[u32; 2]>,
    /// How good it is.
    pub quality: ChartQuality,
    /// A description of the chart, for the user.
    pub reason: String,
}

/// How much a chart distorts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChartQuality {
    /// Share of the triangles that are turned over or without area in the domain.
    pub folded: f64,
    /// Smallest ratio of a triangle's area in the domain to that in space, with a mean of 1; negative for a folded one.
    pub smallest_jacobian: f64,
    /// Root mean square stretch from the domain, drawn `size` large, to the surface; 1 for an isometry.
    pub stretch: f64,
    /// The worst triangle's stretch.
    pub worst_stretch: f64,
    /// Quantiles (1 % and 99 % of the surface) of the square root of the ratio of areas in space and in the domain,
    /// with a mean of 1.
    pub scale: [f64; 2],
}

/// Charts a mesh as a disk, a tube, a sphere or a torus, by its genus and borders, whatever its shape in space. `S_u x
/// S_v` points to the side from which its triangles are wound counter-clockwise.
///
/// Tube: u runs from the longer rim to the other, v around. Sphere: u runs between two poles, chosen for the least
/// stretch. Torus: u runs the short way round, v the long way. Disk: four vertices of the border lie at the corners of
/// the domain. Lines are evenly spaced on average. About O(n^1.25).
///
/// ```
/// use nurbskin_fit::chart::Topology;
/// use nurbskin_fit::chart::surface_mesh::chart_of_mesh;
/// use nurbskin_geometry::DVec3;
/// use nurbskin_scan::mesh::Manifold;
/// use nurbskin_geometry::progress::Silent;
/// // A strip bent to three quarters of a circle: no plane charts it.
/// let (m, n) = (41_u32, 11_u32);
/// let points: Vec<DVec3> = (0..m * n)
///     .map(|k| (f64::from(k % m) * 0.1178, f64::from(k / m) * 0.1))
///     .map(|(a, z)| DVec3::new(a.cos(), a.sin(), z))
///     .collect();
/// let cells = (0..(m - 1) * (n - 1)).map(|k| k % (m - 1) + k / (m - 1) * m);
/// let triangles: Vec<[u32; 3]> = cells.flat_map(|k| [[k, k + 1, k + m], [k + 1, k + m + 1, k + m]]).collect();
/// let (right, top) = ((1..n).map(|j| j * m + m - 1), (0..m - 1).rev().map(|i| (n - 1) * m + i));
/// let border = (0..m).chain(right).chain(top).chain((1..n - 1).rev().map(|j| j * m)).collect();
/// let mesh = Manifold { source: vec![None; points.len()], points, triangles, loops: vec![border] };
/// let chart = chart_of_mesh(&mesh, &Silent)?;
/// assert_eq!(chart.topology, Topology::Disk);
/// assert!(chart.size[0].max(chart.size[1]) > 3.0 * chart.size[0].min(chart.size[1]));
/// // Points anywhere near it take the place of the nearest one on it.
/// let placed = chart.place(&mesh, &mesh.points, None)?;
/// assert!(placed.parameters[60].distance(chart.places[60]) < 1e-9);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
///
/// # Errors
/// [`Error::Unsupported`] for any other number of handles and borders, and if too many triangles fold;
/// [`Error::Invalid`] for a mesh without triangles; [`Error::Cancelled`].
pub fn chart_of_mesh(mesh: &Manifold, progress: &dyn Progress) -> Result<MeshChart> {
    let count = mesh.points.len();
    let exists = |t: &[u32; 3]| t.iter().all(|&k| (k as usize) < count);
    if mesh.triangles.is_empty() || !mesh.triangles.iter().all(exists) {
        return Err(Error::invalid(
            "charting a mesh needs triangles between its points",
        ));
    }
    let surface = Surface::new(&mesh.points, &mesh.triangles);
    let chart = match (mesh.genus(), &mesh.loops[..]) {
        (0, [border]) => disk(&surface, border, progress),
        (0, [first, second]) => tube(&surface, [first, second], progress),
        (0, []) => sphere(&surface, progress),
        (1, []) => torus(&surface, progress),
        (genus, loops) => Err(Error::Unsupported(format!(
            "the surface has {genus} handles and {} openings: one surface can be a sheet (no handle, one border), a tube \
             (two), a closed shape (none) or a ring (one handle, no border)",
            loops.len()
        ))),
    }?;
    if chart.quality.folded > MAX_FOLDED {
        return Err(Error::Unsupported(format!(
            "the mesh cannot be laid out as a {}: {:.0} % of its triangles fold over",
            chart.topology.name(),
            100.0 * chart.quality.folded
        )));
    }
    Ok(chart)
}

pub(super) fn disk(
    surface: &Surface<'_>,
    border: &[u32],
    progress: &dyn Progress,
) -> Result<MeshChart> {
    let Some((mut setup, start)) = disk::disk(surface, border, progress)? else {
        return Err(Error::Unsupported(
            "the mesh's rim has no four corners: it is too small or too tangled".into(),
        ));
    };
    let layout = lay_out(surface, &mut setup, start, MAX_RELAXATION_ROUNDS, progress)?;
    let what = "open sheet with one border";
    Ok(assemble(surface, &setup, layout, Topology::Disk, what))
}

fn tube(surface: &Surface<'_>, rims: [&[u32]; 2], progress: &dyn Progress) -> Result<MeshChart> {
    let (mut setup, start) = closed::tube(surface, rims)?;
    let layout = lay_out(surface, &mut setup, start, MAX_RELAXATION_ROUNDS, progress)?;
    let what = "tube between two borders";
    Ok(assemble(surface, &setup, layout, Topology::Tube, what))
}

/// The pair of poles whose chart stretches least in the end. All candidates are relaxed, round by round, as long as
/// they keep up with the best, since the order after the first round is not that after the last.
fn sphere(surface: &Surface<'_>, progress: &dyn Progress) -> Result<MeshChart> {
    let begun = |poles: [u32; 2]| -> Result<Candidate<'_>> {
        let (mut setup, start) = closed::sphere(surface, poles)?;
        let relaxation = Relaxation::begun(surface, &mut setup, start);
        Ok(Candidate {
            setup,
            relaxation,
            goes_on: true,
        })
    };
    let begun: Vec<_> = poles::candidates(surface)
        .into_par_iter()
        .map(begun)
        .collect();
    let mut candidates = begun.into_iter().collect::<Result<Vec<_>>>()?;
    let least = |all: &[Candidate<'_>]| {
        let means = all.iter().map(|c| c.relaxation.stretch().mean);
        means.fold(f64::INFINITY, f64::min)
    };
    for _ in 0..MAX_RELAXATION_ROUNDS {
        progress.check()?;
        candidates = candidates
            .into_par_iter()
            .map(Candidate::advanced)
            .collect();
        let limit = MAX_POLE_LAG * least(&candidates);
        candidates.retain(|c| c.relaxation.stretch().mean <= limit);
        if candidates.iter().all(|c| !c.goes_on) {
            break;
        }
    }
    let limit = POLE_TIE * least(&candidates);
    candidates.retain(|c| c.relaxation.stretch().mean <= limit);
    let whole = |c: &Candidate<'_>| c.relaxation.stretch().whole;
    let best = candidates
        .into_iter()
        .min_by(|a, b| whole(a).total_cmp(&whole(b)));
    let Some(Candidate {
        mut setup,
        relaxation,
        ..
    }) = best
    else {
        return Err(Error::Unsupported(
            "the mesh is closed but too small to have two poles".into(),
        ));
    };
    let layout = relaxation.finished(&mut setup);
    let what = "closed shape with two poles";
    Ok(assemble(surface, &setup, layout, Topology::Sphere, what))
}

/// The chart of a pair of poles so far.
struct Candidate<'a> {
    setup: Setup,
    relaxation: Relaxation<'a>,
    goes_on: bool,
}

impl Candidate<'_> {
    /// Advances by one round, unless the last one was discarded.
    fn advanced(mut self) -> Self {
        self.goes_on = self.goes_on && self.relaxation.advance(&mut self.setup);
        self
    }
}

fn torus(surface: &Surface<'_>, progress: &dyn Progress) -> Result<MeshChart> {
    let (mut setup, start) = closed::torus(surface)?;
    let first = lay_out(surface, &mut setup, start, 0, progress)?;
    let start = closed::straighten(surface, &mut setup, &first.places);
    let layout = lay_out(surface, &mut setup, start, MAX_RELAXATION_ROUNDS, progress)?;
    let what = "closed ring";
    Ok(assemble(surface, &setup, layout, Topology::Torus, what))
}

/// Wraps the places into the domain and measures the chart.
pub(super) fn assemble(
    surface: &Surface<'_>,
    setup: &Setup,
    layout: Layout,
    topology: Topology,
    what: &str,
) -> MeshChart {
    let wrap = |p: DVec2| {
        let one = |x: f64, closed: bool| {
            if closed {
                let x = x - x.floor();
                if x < 1.0 { x } else { 0.0 }
            } else {
                x
            }
        };
        DVec2::new(one(p.x, setup.closed[0]), one(p.y, setup.closed[1]))
    };
    let corner = |(t, triangle): (usize, &[u32; 3])| {
        let at = setup.lifted(triangle, t, &layout.places);
        // The first corner that is no pole keeps its place.
        let k = (0..3).find(|&k| !setup.is_pole(triangle[k])).unwrap_or(0);
        let shift = wrap(at[k]) - at[k];
        at.map(|p| p + shift)
    };
    let corners: Vec<[DVec2; 3]> = surface.triangles.iter().enumerate().map(corner).collect();
    let mut quality = measure(surface, &corners, layout.size);
    quality.stretch = layout.stretch.whole;
    quality.worst_stretch = layout.stretch.worst;
    MeshChart {
        topology,
        places: layout.places.iter().map(|&p| wrap(p)).collect(),
        corners,
        size: layout.size,
        poles: setup.poles,
        quality,
        reason: format!(
            "{what}: {} of its triangles fold over in the parameter plane, stretch {:.2} on average, {:.1} at most",
            percent(quality.folded),
            quality.stretch,
            quality.worst_stretch
        ),
    }
}

/// Measures folds and scales.
fn measure(surface: &Surface<'_>, corners: &[[DVec2; 3]], size: [f64; 2]) -> ChartQuality {
    let scale = DMat2::from_diagonal(DVec2::from(size));
    let mut folded = 0_usize;
    let mut whole = [0.0; 2];
    // Area in space and in the domain.
    let mut areas: Vec<[f64; 2]> = Vec::with_capacity(corners.len());
    for (t, corner) in corners.iter().enumerate() {
        let p = surface.corners(t);
        let space = 0.5 * (p[1] - p[0]).cross(p[2] - p[0]).length();
        let flat = 0.5 * derivatives(p, corner.map(|c| scale * c)).2;
        folded += usize::from(flat <= 0.0);
        whole[0] += space;
        whole[1] += flat;
        areas.push([space, flat]);
    }
    let usual = whole[1] / whole[0].max(f64::MIN_POSITIVE);
    let mut ratios: Vec<(f64, f64)> = areas
        .iter()
        .filter(|a| a[0] > 0.0)
        .map(|a| (a[1] / a[0] / usual, a[0]))
        .collect();
    ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
    let quantile = |part: f64| {
        let mut sum = 0.0;
        let at = ratios.iter().find(|r| {
            sum += r.1;
            sum >= part * whole[0]
        });
        at.map_or(1.0, |r| (1.0 / r.0.max(1e-12)).sqrt())
    };
    ChartQuality {
        folded: folded as f64 / corners.len().max(1) as f64,
        smallest_jacobian: ratios.first().map_or(0.0, |r| r.0),
        stretch: 1.0,
        worst_stretch: 1.0,
        // The scale is large where the domain is small.
        scale: SCALE_QUANTILES.map(quantile),
    }
}

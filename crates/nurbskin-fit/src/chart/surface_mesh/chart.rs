//! Charts of meshes of any of the four shapes of domain.

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

/// Rounds that even out the stretch.
const ROUNDS: usize = 8;
/// Poles whose chart stretches by this factor more in the mean than the best one's after as many rounds are given up. On the
/// closed scans of docs/real-scans.md those that win in the end are within 1.03 after each round.
const KEEPS_UP: f64 = 1.1;
/// Of poles whose charts stretch alike in the mean, within this factor, those are taken whose worst places stretch less.
const ALIKE: f64 = 1.005;
/// Part of the triangles that may come out turned over: with more there is no telling what to mend.
const FOLDED: f64 = 0.1;

/// A mesh laid out on its domain.
#[derive(Clone, Debug)]
pub struct MeshChart {
    /// Which directions are closed.
    pub topology: Topology,
    /// (u, v) of each vertex: in 0..1 in closed directions; in 0..=1 in open ones, but for the tips of ragged rims, which
    /// stand out a little. A pole has u = 0 or 1 and no v of its own.
    pub places: Vec<DVec2>,
    /// (u, v) of the corners of each triangle beside each other, not wrapped round: they differ from the vertices' by whole
    /// turns in closed directions. A corner at a pole has the v between those of the other two.
    pub corners: Vec<[DVec2; 3]>,
    /// Lengths in the unit of the mesh that u and v from 0 to 1 stand for: means of the lengths of iso-lines.
    pub size: [f64; 2],
    /// The vertices at u = 0 and u = 1 of a sphere.
    pub poles: Option<[u32; 2]>,
    /// How good it is.
    pub quality: ChartQuality,
    /// What was found, for the user.
    pub reason: String,
}

/// How much a chart distorts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChartQuality {
    /// Part of the triangles that are turned over or without area in the domain.
    pub folded: f64,
    /// Smallest area of a triangle in the domain against that in space, 1 being the mean; negative where one is turned over.
    pub smallest_jacobian: f64,
    /// Root mean square stretch from the domain, drawn `size` large, to the surface; 1 for an isometry.
    pub stretch: f64,
    /// The worst triangle's stretch.
    pub worst_stretch: f64,
    /// Square roots of the ratio of areas in space and in the domain, 1 being the mean, that 1 % and 99 % of the surface lie
    /// below.
    pub scale: [f64; 2],
}

/// Charts a mesh: by its handles and borders a disk, a tube, a sphere or a torus, whatever its shape in space.
/// `S_u x S_v` looks to the side that its triangles are wound counter-clockwise seen from.
///
/// Tube: u runs from the longer rim to the other, v around. Sphere: u runs between two poles, chosen where the chart
/// stretches least. Torus: u runs the short way round, v the long way. Disk: the border's corners lie at the corners of
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
/// [`Error::Unsupported`] for any other number of handles and borders, and where triangles fold over;
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
    if chart.quality.folded > FOLDED {
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
    let layout = lay_out(surface, &mut setup, start, ROUNDS, progress)?;
    let what = "open sheet with one border";
    Ok(assemble(surface, &setup, layout, Topology::Disk, what))
}

fn tube(surface: &Surface<'_>, rims: [&[u32]; 2], progress: &dyn Progress) -> Result<MeshChart> {
    let (mut setup, start) = closed::tube(surface, rims)?;
    let layout = lay_out(surface, &mut setup, start, ROUNDS, progress)?;
    let what = "tube between two borders";
    Ok(assemble(surface, &setup, layout, Topology::Tube, what))
}

/// The poles are those whose chart stretches least in the end. All candidates are relaxed, round by round, as long as they keep
/// up with the best: what the first round says of poles is not yet true after the last.
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
    for _ in 0..ROUNDS {
        progress.check()?;
        candidates = candidates
            .into_par_iter()
            .map(Candidate::advanced)
            .collect();
        let limit = KEEPS_UP * least(&candidates);
        candidates.retain(|c| c.relaxation.stretch().mean <= limit);
        if candidates.iter().all(|c| !c.goes_on) {
            break;
        }
    }
    let limit = ALIKE * least(&candidates);
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

/// A chart with these poles, as far as it has come.
struct Candidate<'a> {
    setup: Setup,
    relaxation: Relaxation<'a>,
    goes_on: bool,
}

impl Candidate<'_> {
    /// A round further, unless the last one brought nothing.
    fn advanced(mut self) -> Self {
        self.goes_on = self.goes_on && self.relaxation.advance(&mut self.setup);
        self
    }
}

fn torus(surface: &Surface<'_>, progress: &dyn Progress) -> Result<MeshChart> {
    let (mut setup, start) = closed::torus(surface)?;
    let first = lay_out(surface, &mut setup, start, 0, progress)?;
    let start = closed::straighten(surface, &mut setup, &first.places);
    let layout = lay_out(surface, &mut setup, start, ROUNDS, progress)?;
    let what = "closed ring";
    Ok(assemble(surface, &setup, layout, Topology::Torus, what))
}

/// Wraps the places into the domain and measures the chart.
fn assemble(
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

/// Folds and scales.
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
        // Large where the domain is small.
        scale: [quantile(0.99), quantile(0.01)],
    }
}

//! Samples a body as a scanner would.
//!
//! A cloud is drawn evenly by area: a triangle of a fine mesh by its area, a place in it, and the point of the exact
//! surface there; the bracket's faces are drawn from directly. A mesh has its vertices on the exact surface. Then holes,
//! noise along the normal and outliers are the same as for shapes.

use super::super::random::Random;
use super::super::scanner::{self, ScanOptions, cut_holes, sample_count, throw};
use super::mesh::{self, Mesh};
use super::surface::{Exact, ORIGIN};
use super::{Body, BodySurface, bracket};
use crate::{Organisation, Scan};
use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::unit::UnitSource;
use rayon::prelude::*;

/// Points of a scan whose size is not given.
const DEFAULT_POINTS: usize = 20_000;

/// What a simulated scan of a body is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Layout {
    /// A cloud: points at random places, evenly over the area, in random order.
    #[default]
    Cloud,
    /// A mesh of nearly equilateral triangles. Its edges follow the body's sharp edges.
    Mesh,
    /// A mesh that ignores sharp edges, as a mesh of a real scan: triangles cut corners.
    Unaligned,
}

/// What the virtual scanner does to a body. Lengths are in millimetres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyOptions {
    /// Number of points (20 000), 16 to 100 million: exact for clouds, nearly so for meshes (within 1 % in most cases,
    /// fewer with holes, which take the vertices of the triangles at their rims).
    pub points: Option<usize>,
    /// Cloud or mesh (cloud).
    pub layout: Layout,
    /// Standard deviation of the Gaussian noise along the normal (0).
    pub noise: f64,
    /// Part of the points thrown far off, 0 to 0.5 (0).
    pub outliers: f64,
    /// Number of round regions without points, at most 30 (0).
    pub holes: usize,
    /// Seed of all random numbers (0); same options, same points.
    pub seed: u64,
}

/// A simulated scan of a body and its truth.
#[derive(Debug)]
pub struct SimulatedBody {
    /// The scan.
    pub scan: Scan,
    /// The surface it was taken from.
    pub truth: BodySurface,
    /// The true place of each point on the surface, in the order of the scan's points.
    pub places: Vec<DVec3>,
    /// Indices of the points thrown off, ascending.
    pub outliers: Vec<usize>,
}

/// Scans `body`. About 1 us per point of a cloud, 10 us per vertex of a mesh.
///
/// ```
/// use nurbskin_scan::simulate::{Body, BodyOptions, scan_body};
/// let simulated = scan_body(Body::Hammer, &BodyOptions { points: Some(500), ..BodyOptions::default() })?;
/// let worst = simulated.scan.points.iter().map(|&p| simulated.truth.level(p).abs()).fold(0.0, f64::max);
/// assert!(simulated.scan.points.len() == 500 && worst < 1e-9);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) if an option is out of its range, or if a mesh of so few points
/// cannot have the topology of the body.
pub fn scan_body(body: Body, options: &BodyOptions) -> Result<SimulatedBody> {
    let points = options.points.unwrap_or(DEFAULT_POINTS);
    let common = ScanOptions {
        noise: options.noise,
        outliers: options.outliers,
        holes: options.holes,
        ..ScanOptions::default()
    };
    scanner::check(&common, points)?;
    let exact = Exact(body);
    // Places, holes, noise and outliers each have their own numbers, as for shapes.
    let stream = |k: u64| Random::new(options.seed.wrapping_mul(8).wrapping_add(k));
    let samples = sample_count(points, options.holes);
    let (mut places, mut triangles) = match options.layout {
        Layout::Cloud => (scatter(exact, samples, &mut stream(0)), Vec::new()),
        layout => {
            let made = mesh::mesh(exact, samples, layout == Layout::Mesh)?;
            (facing(exact, &made), made.triangles)
        }
    };
    if options.holes > 0 {
        let at = |k: usize| places[k];
        let keep = cut_holes(places.len(), at, options.holes, points, &mut stream(1));
        (places, triangles) = remaining(&places, &triangles, &keep);
    }
    let mut random = stream(3);
    let mut coordinates: Vec<DVec3> = places
        .iter()
        .map(|&(point, normal)| ORIGIN + point + options.noise * random.normal() * normal)
        .collect();
    let truth = BodySurface::new(body);
    let outliers = throw(
        &mut coordinates,
        (0..places.len()).collect(),
        options.outliers,
        truth.diagonal(),
        &mut stream(4),
    );
    let organisation = match options.layout {
        Layout::Cloud => Organisation::Unordered,
        _ => Organisation::Mesh(triangles),
    };
    Ok(SimulatedBody {
        scan: Scan {
            points: coordinates,
            organisation,
            format: "simulated".into(),
            // The bodies are defined in millimetres.
            unit_source: UnitSource::File,
            ..Scan::default()
        },
        truth,
        places: places
            .into_iter()
            .map(|(point, _)| ORIGIN + point)
            .collect(),
        outliers,
    })
}

/// Random points of the surface with their normals, evenly over the area.
fn scatter(exact: Exact, count: usize, random: &mut Random) -> Vec<(DVec3, DVec3)> {
    if exact.0 == Body::Bracket {
        return (0..count).map(|_| bracket::sample(random)).collect();
    }
    let even = mesh::even(exact);
    let corners = |t: usize| even.triangles[t].map(|k| even.points[k as usize]);
    let mut total = 0.0;
    let sums: Vec<f64> = (0..even.triangles.len())
        .map(|t| {
            let [a, b, c] = corners(t);
            total += (b - a).cross(c - a).length();
            total
        })
        .collect();
    let drawn: Vec<DVec3> = (0..count)
        .map(|_| {
            let at = random.uniform() * total;
            let triangle = sums.partition_point(|&sum| sum < at).min(sums.len() - 1);
            let [a, b, c] = corners(triangle);
            let (mut s, mut t) = (random.uniform(), random.uniform());
            if s + t > 1.0 {
                (s, t) = (1.0 - s, 1.0 - t);
            }
            a + s * (b - a) + t * (c - a)
        })
        .collect();
    let exactly = drawn.into_par_iter().map(|p| {
        let foot = exact.project(p);
        (foot, exact.normal(foot))
    });
    exactly.collect()
}

/// The vertices of a mesh with their normals. At a sharp edge, the normal is the mean of those of the triangles there.
fn facing(exact: Exact, mesh: &Mesh) -> Vec<(DVec3, DVec3)> {
    if !exact.0.has_creases() {
        let vertices = mesh.points.par_iter();
        return vertices.map(|&p| (p, exact.normal(p))).collect();
    }
    let mut sums = vec![DVec3::ZERO; mesh.points.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|k| mesh.points[k as usize]);
        let normal = (b - a).cross(c - a);
        triangle.iter().for_each(|&k| sums[k as usize] += normal);
    }
    let facing = |(&p, sum): (&DVec3, &DVec3)| (p, sum.normalize_or(exact.normal(p)));
    mesh.points.iter().zip(&sums).map(facing).collect()
}

/// What is kept, and the triangles between kept vertices; vertices that lose all their triangles go too.
fn remaining(
    places: &[(DVec3, DVec3)],
    triangles: &[[u32; 3]],
    keep: &[bool],
) -> (Vec<(DVec3, DVec3)>, Vec<[u32; 3]>) {
    let left = triangles
        .iter()
        .filter(|t| t.iter().all(|&k| keep[k as usize]));
    let left: Vec<[u32; 3]> = left.copied().collect();
    let mut used = keep.to_vec();
    if !triangles.is_empty() {
        used.fill(false);
        left.as_flattened()
            .iter()
            .for_each(|&k| used[k as usize] = true);
    }
    let mut count = 0_u32;
    let number: Vec<u32> = used
        .iter()
        .map(|&used| (count, count += u32::from(used)).0)
        .collect();
    let kept = places.iter().zip(&used).filter(|(_, used)| **used);
    let renumbered = left.iter().map(|t| t.map(|k| number[k as usize]));
    (
        kept.map(|(place, _)| *place).collect(),
        renumbered.collect(),
    )
}

//! A scanned object and its surface, and how they are drawn.

use super::canvas::{Camera, Canvas, Colour, Vertex};
use glam::DVec3;
use nurbskin::NurbsSurface;
use nurbskin::chart::Topology;
use nurbskin::chart::grid::order;
use nurbskin::fit::interpolate::interpolate;
use nurbskin::fit::interpolate::parameters::Parameterization;
use nurbskin::fit::rarefied::{Options, rarefy_to_tolerance};
use nurbskin::progress::Silent;
use nurbskin::rarefy::to_counts_filled;
use nurbskin::scan::simulate::{ScanOptions, Shape, TrueSurface, scan};
use std::error::Error;

const LINE: Colour = [0.12, 0.20, 0.34];
const NET: Colour = [0.80, 0.33, 0.10];
pub(crate) const POINT: Colour = [0.75, 0.05, 0.10];
/// Outside and inside of a surface.
pub(crate) const SKIN: [Colour; 2] = [[0.55, 0.66, 0.80], [0.86, 0.74, 0.55]];
/// A surface that only hides the lines behind it.
pub(crate) const PALE: [Colour; 2] = [[0.97, 0.97, 0.97], [0.93, 0.90, 0.85]];

/// How many points of the scan the surface passes through.
pub(crate) enum Keep {
    /// So many lines as the paper, by its rule. A round object scanned without opening is an open array whose last row
    /// repeats the first, as the paper's pot.
    Paper([usize; 2], Parameterization),
    /// As many as it takes to be within this distance of all points, in millimetres.
    Within(f64),
}

/// One of the paper's objects: the dense scan, the points kept and the surface through them.
pub(crate) struct Object {
    pub(crate) scan: Vec<DVec3>,
    pub(crate) truth: TrueSurface,
    pub(crate) kept: Vec<DVec3>,
    pub(crate) surface: NurbsSurface,
    /// Its upward and its forward direction.
    upright: [DVec3; 2],
}

impl Object {
    pub(crate) fn new(shape: Shape, keep: &Keep, opening: bool) -> Result<Self, Box<dyn Error>> {
        let options = ScanOptions {
            opening,
            ..ScanOptions::default()
        };
        let simulated = scan(shape, &options)?;
        let ordered = order(&simulated.scan, None)?;
        let (grid, mut topology) = (&ordered.grid, ordered.topology);
        let (kept, surface) = match *keep {
            Keep::Paper([m, n], kind) => {
                let repeated = topology == Topology::Tube;
                let counts = [m, n - usize::from(repeated)];
                let (_, lines) = to_counts_filled(grid, topology, counts)?;
                let mut rows = lines.v.clone();
                if repeated {
                    rows.extend(lines.v.first());
                    topology = Topology::Disk;
                }
                let kept = grid.select(&lines.u, &rows)?;
                let surface = interpolate(&kept, topology, [3, 3], kind)?.surface;
                (kept, surface)
            }
            Keep::Within(tolerance) => {
                let options = Options::default();
                let found = rarefy_to_tolerance(grid, topology, tolerance, &options, &Silent)?;
                (found.kept.select(grid)?, found.surface)
            }
        };
        let upright = match shape {
            Shape::Face => [DVec3::Y, DVec3::Z],
            _ => [DVec3::Z, DVec3::NEG_Y],
        };
        Ok(Self {
            scan: simulated.scan.points,
            truth: simulated.truth,
            kept: kept.into_points(),
            surface,
            upright,
        })
    }

    /// A picture of this size in pixels, looking from `view`, around the scan and `more`.
    pub(crate) fn view(
        &self,
        [width, height]: [usize; 2],
        view: [f64; 2],
        more: &[DVec3],
    ) -> Canvas {
        let mut shown = self.scan.clone();
        // The scan may be as sparse as the surface is wavy.
        let points = |k: usize| self.at((k % 20) as f64 / 19.0, (k / 20) as f64 / 19.0);
        shown.extend((0..400).map(points).map(|(u, v)| self.surface.point(u, v)));
        shown.extend_from_slice(more);
        let aspect = width as f64 / height as f64;
        let camera = Camera::around(&shown, self.upright, view, aspect);
        Canvas::new(width, height, camera)
    }

    /// Parameters at fraction (s, t) of the domain.
    fn at(&self, s: f64, t: f64) -> (f64, f64) {
        let [(a, b), (c, d)] = self.surface.domain();
        (a + s * (b - a), c + t * (d - c))
    }

    /// The shaded surface; `sides` gives the colours of its two sides at a point.
    pub(crate) fn shade(&self, canvas: &mut Canvas, sides: &dyn Fn(DVec3) -> [Colour; 2]) {
        const STEPS: usize = 240;
        let vertex = |k: usize| {
            let [i, j] = [k % (STEPS + 1), k / (STEPS + 1)];
            let (u, v) = self.at(i as f64 / STEPS as f64, j as f64 / STEPS as f64);
            let s = self.surface.derivatives(u, v);
            Vertex {
                point: s.point,
                normal: s.du.cross(s.dv).normalize_or(DVec3::Z),
                sides: sides(s.point),
            }
        };
        let vertices: Vec<Vertex> = (0..(STEPS + 1) * (STEPS + 1)).map(vertex).collect();
        for (i, j) in (0..STEPS).flat_map(|j| (0..STEPS).map(move |i| (i, j))) {
            let corner = |i: usize, j: usize| &vertices[j * (STEPS + 1) + i];
            let [a, c] = [corner(i, j), corner(i + 1, j + 1)];
            canvas.triangle([a, corner(i + 1, j), c]);
            canvas.triangle([a, c, corner(i, j + 1)]);
        }
    }

    /// Iso-parametric curves.
    pub(crate) fn wires(&self, canvas: &mut Canvas, along_u: usize, along_v: usize) {
        const STEPS: usize = 200;
        let mut curve = |point: &dyn Fn(f64) -> DVec3| {
            for k in 0..STEPS {
                let [a, b] = [k, k + 1].map(|k| point(k as f64 / STEPS as f64));
                canvas.line(a, b, 1.1, 0.004, LINE);
            }
        };
        let point = |s: f64, t: f64| {
            let (u, v) = self.at(s, t);
            self.surface.point(u, v)
        };
        (0..=along_u).for_each(|k| curve(&|t| point(k as f64 / along_u as f64, t)));
        (0..=along_v).for_each(|k| curve(&|s| point(s, k as f64 / along_v as f64)));
    }

    /// Control points as dots, joined along u and v.
    pub(crate) fn net(&self, canvas: &mut Canvas) {
        let net = self.surface.control_points();
        let [m, n] = net.counts();
        for (i, j) in (0..n).flat_map(|j| (0..m).map(move |i| (i, j))) {
            let p = net.point(i, j);
            canvas.dot(p, 5.0, 0.02, NET);
            if i + 1 < m {
                canvas.line(p, net.point(i + 1, j), 1.8, 0.01, NET);
            }
            if j + 1 < n {
                canvas.line(p, net.point(i, j + 1), 1.8, 0.01, NET);
            }
        }
    }

    /// The kept points as `+`.
    pub(crate) fn pluses(&self, canvas: &mut Canvas, arm: f64, colour: Colour) {
        let kept = self.kept.iter();
        kept.for_each(|&p| canvas.plus(p, arm, 0.012, colour));
    }

    /// Points as dots of this radius in pixels.
    pub(crate) fn dots(canvas: &mut Canvas, points: &[DVec3], radius: f64, colour: Colour) {
        for &p in points {
            canvas.dot(p, radius, 0.012, colour);
        }
    }

    /// The scan as small dots.
    pub(crate) fn cloud(&self, canvas: &mut Canvas) {
        Self::dots(canvas, &self.scan, 1.0, LINE);
    }
}

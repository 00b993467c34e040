//! Draws the paper's figures again, from our own scans: `cargo run --release --example figures [FOLDER]`.

mod canvas;

use canvas::{Camera, Canvas, Colour, save};
use glam::DVec3;
use nurbskin::NurbsSurface;
use nurbskin::chart::grid::order;
use nurbskin::fit::interpolate::interpolate;
use nurbskin::fit::parameters::Parameterization;
use nurbskin::rarefy::to_counts_filled;
use nurbskin::scan::simulate::scanner::{ScanOptions, scan};
use nurbskin::scan::simulate::shapes::Shape;
use std::error::Error;
use std::path::{Path, PathBuf};

const SURFACE: Colour = [0.55, 0.66, 0.80];
const LINE: Colour = [0.12, 0.20, 0.34];
const NET: Colour = [0.80, 0.33, 0.10];
const POINT: Colour = [0.75, 0.05, 0.10];

/// One of the paper's objects: the dense scan, the points kept and the surface through them.
struct Object {
    scan: Vec<DVec3>,
    kept: Vec<DVec3>,
    surface: NurbsSurface,
    /// Its upward and its forward direction.
    upright: [DVec3; 2],
}

impl Object {
    fn new(shape: Shape, counts: [usize; 2], opening: bool) -> Result<Self, Box<dyn Error>> {
        let simulated = scan(
            shape,
            &ScanOptions {
                opening,
                ..ScanOptions::default()
            },
        )?;
        let ordered = order(&simulated.scan, None)?;
        let (_, kept) = to_counts_filled(&ordered.grid, ordered.topology, counts)?;
        let grid = kept.select(&ordered.grid)?;
        let surface = interpolate(
            &grid,
            ordered.topology,
            [3, 3],
            Parameterization::ChordLength,
        )?
        .surface;
        let upright = if shape == Shape::Face {
            [DVec3::Y, DVec3::Z]
        } else {
            [DVec3::Z, DVec3::NEG_Y]
        };
        Ok(Self {
            scan: simulated.scan.points,
            kept: grid.points().to_vec(),
            surface,
            upright,
        })
    }

    fn view(&self, [width, height]: [usize; 2], view: [f64; 2]) -> Canvas {
        let mut shown = self.scan.clone();
        shown.extend_from_slice(self.surface.control_points().points());
        let aspect = width as f64 / height as f64;
        Canvas::new(
            width,
            height,
            Camera::around(&shown, self.upright, view, aspect),
        )
    }

    /// S at fraction (s, t) of the domain.
    fn at(&self, s: f64, t: f64) -> (f64, f64) {
        let [(a, b), (c, d)] = self.surface.domain();
        (a + s * (b - a), c + t * (d - c))
    }

    fn shade(&self, canvas: &mut Canvas) {
        const STEPS: usize = 240;
        let sample = |i: usize, j: usize| {
            let (u, v) = self.at(i as f64 / STEPS as f64, j as f64 / STEPS as f64);
            let s = self.surface.derivatives(u, v);
            (s.point, s.du.cross(s.dv).normalize_or(DVec3::Z))
        };
        for (i, j) in (0..STEPS).flat_map(|j| (0..STEPS).map(move |i| (i, j))) {
            let [a, b, c, d] = [
                sample(i, j),
                sample(i + 1, j),
                sample(i + 1, j + 1),
                sample(i, j + 1),
            ];
            canvas.triangle([a.0, b.0, c.0], [a.1, b.1, c.1], SURFACE);
            canvas.triangle([a.0, c.0, d.0], [a.1, c.1, d.1], SURFACE);
        }
    }

    /// Iso-parametric curves.
    fn wires(&self, canvas: &mut Canvas, along_u: usize, along_v: usize) {
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
    fn net(&self, canvas: &mut Canvas) {
        let net = self.surface.control_points();
        let [m, n] = net.counts();
        for (i, j) in (0..n).flat_map(|j| (0..m).map(move |i| (i, j))) {
            let p = net.point(i, j);
            canvas.dot(p, 4.0, 0.02, NET);
            if i + 1 < m {
                canvas.line(p, net.point(i + 1, j), 1.5, 0.01, NET);
            }
            if j + 1 < n {
                canvas.line(p, net.point(i, j + 1), 1.5, 0.01, NET);
            }
        }
    }

    fn pluses(&self, canvas: &mut Canvas, arm: f64) {
        self.kept
            .iter()
            .for_each(|&p| canvas.plus(p, arm, 0.012, POINT));
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args()
        .nth(1)
        .map_or_else(|| Path::new("docs/figures").to_owned(), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    let pot = Object::new(Shape::Pot, [18, 18], false)?;
    let patch = Object::new(Shape::Patch, [4, 4], false)?;
    let face = Object::new(Shape::Face, [29, 13], false)?;
    let handle = Object::new(Shape::Handle, [25, 32], true)?;

    let picture = |name: &str, views: &[Canvas]| save(views, &folder.join(name));
    let shaded = |object: &Object, size: [usize; 2], view: [f64; 2]| {
        let mut canvas = object.view(size, view);
        object.shade(&mut canvas);
        canvas
    };

    // Figures 1 and 2: the dense scan, the reconstruction, the rarefied points on it.
    let mut cloud = pot.view([420, 480], [20.0, 22.0]);
    pot.scan.iter().for_each(|&p| cloud.dot(p, 1.0, 0.0, LINE));
    let mut points = shaded(&pot, [420, 480], [20.0, 22.0]);
    pot.pluses(&mut points, 4.0);
    picture(
        "fig02-pot.png",
        &[cloud, shaded(&pot, [420, 480], [20.0, 22.0]), points],
    )?;

    // Figure 7: 4 x 4 points and the surface through them.
    let mut through = shaded(&patch, [640, 460], [30.0, 30.0]);
    patch.wires(&mut through, 3, 3);
    patch
        .kept
        .iter()
        .for_each(|&p| through.dot(p, 5.0, 0.02, POINT));
    picture("fig07-patch.png", &[through])?;

    // Figure 12: control net, net vectors and data points, shaded and as wires.
    let mut net = shaded(&patch, [560, 460], [30.0, 30.0]);
    patch.net(&mut net);
    let mut wires = patch.view([560, 460], [30.0, 30.0]);
    patch.wires(&mut wires, 9, 9);
    patch.net(&mut wires);
    patch.pluses(&mut wires, 6.0);
    picture("fig12-net.png", &[net, wires])?;

    // Figures 14 to 16: the face from several sides, as wires, with the rarefied points.
    let views =
        [[0.0, 0.0], [-40.0, 10.0], [75.0, 5.0]].map(|view| shaded(&face, [360, 440], view));
    picture("fig14-face.png", &views)?;
    let mut wires = face.view([420, 520], [-25.0, 10.0]);
    face.wires(&mut wires, 56, 24);
    picture("fig15-face-wireframe.png", &[wires])?;
    let mut points = shaded(&face, [420, 520], [-25.0, 10.0]);
    face.pluses(&mut points, 4.0);
    picture("fig16-face-points.png", &[points])?;

    // Figure 18: the handle as one surface with a longitudinal opening.
    let mut wires = handle.view([560, 320], [205.0, -30.0]);
    handle.wires(&mut wires, 48, 31);
    picture(
        "fig18-handle.png",
        &[shaded(&handle, [560, 320], [205.0, -30.0]), wires],
    )?;
    Ok(())
}

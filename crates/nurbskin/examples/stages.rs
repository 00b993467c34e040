//! Draws one picture for each page on a stage, from simulated scans: `cargo run --release --example stages [FOLDER]`.

#[path = "figures/canvas.rs"]
#[expect(dead_code, reason = "the figures of the paper use the rest")]
mod canvas;
#[path = "stages/draw.rs"]
mod draw;
#[path = "figures/scale.rs"]
mod scale;
#[path = "stages/text.rs"]
mod text;

use canvas::{Colour, Vertex, save};
use draw::{Bars, INK, PALE, View, crossings, curve, legend, shade, wires};
use nurbskin::cad::trim::{Scanned, trimming};
use nurbskin::cad::{Model, Region};
use nurbskin::chart::grid::order;
use nurbskin::chart::plane::chart_on_plane;
use nurbskin::chart::surface_mesh::chart_of_mesh;
use nurbskin::charting::{ChartOptions, Charts, Extends};
use nurbskin::deviation::measure::{Outside, PointDeviation, measure};
use nurbskin::fit::approximate::{ApproximateOptions, Guides, approximate, approximate_guided};
use nurbskin::fit::interpolate::interpolate;
use nurbskin::fit::interpolate::parameters::Parameterization::ChordLength;
use nurbskin::mesh::{repair::repair, triangulate::triangulate_oriented};
use nurbskin::nurbs::closest::ClosestPoint;
use nurbskin::progress::Silent;
use nurbskin::rarefy::to_counts_filled;
use nurbskin::scan::simulate::{Order, ScanOptions, Shape, Simulated, scan};
use nurbskin::scan::{CleanOptions, CleanScan, Reason, Scan, clean};
use nurbskin::{DVec2, DVec3, Error as Failure};
use std::error::Error;
use std::path::{Path, PathBuf};

type Outcome<T> = Result<T, Box<dyn Error>>;

const GREY: Colour = [0.62, 0.64, 0.67];
const RED: Colour = [0.80, 0.08, 0.10];
const BLUE: Colour = [0.05, 0.30, 0.75];

fn main() -> Outcome<()> {
    let folder = std::env::args()
        .nth(1)
        .map_or_else(|| Path::new("docs/stages").to_owned(), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    draw_cleaning(&folder.join("clean.png"))?;
    draw_chart(&folder.join("chart.png"))?;
    draw_fits(&folder.join("fit.png"))?;
    draw_trimming(&folder.join("trim.png"))?;
    draw_deviation(&folder.join("deviation.png"))
}

/// A simulated cloud of so many points without order.
fn cloud(shape: Shape, points: usize, noise: f64, outliers: f64) -> nurbskin::Result<Simulated> {
    let options = ScanOptions {
        points: Some(points),
        noise,
        outliers,
        order: Order::Scattered,
        ..ScanOptions::default()
    };
    scan(shape, &options)
}

fn cleaned(raw: &Scan) -> nurbskin::Result<CleanScan> {
    clean(raw, &CleanOptions::default(), &Silent)
}

/// Used points, outliers and duplicates; and the normals of the used ones.
fn draw_cleaning(path: &Path) -> Outcome<()> {
    const VIEW: View = View::upright([600, 500], [20.0, 42.0]);
    let mut raw = cloud(Shape::Torus, 9000, 0.25, 0.02)?.scan;
    // Some points come twice, as where two passes of a scanner meet.
    let twice: Vec<DVec3> = raw.points.iter().copied().step_by(60).collect();
    raw.points.extend(twice);
    let cleaned = cleaned(&raw)?;
    let mut all = VIEW.panel(&raw.points, "all points");
    for &p in &cleaned.points {
        all.dot(p, 1.3, 0.0, GREY);
    }
    for rejected in &cleaned.rejected {
        let (radius, lift, colour) = match rejected.reason {
            Reason::Outlier => (2.8, 0.02, RED),
            _ => (2.4, 0.002, BLUE),
        };
        all.dot(raw.points[rejected.index], radius, lift, colour);
    }
    let [outliers, twice] = [Reason::Outlier, Reason::Duplicate].map(|r| cleaned.rejected_for(r));
    let lines = [
        (format!("{} used", cleaned.points.len()), [0.45, 0.47, 0.50]),
        (format!("{outliers} outliers"), RED),
        (format!("{twice} duplicates"), BLUE),
    ];
    legend(&mut all, &lines);
    let mut used = VIEW.panel(&cleaned.points, "used points by normal");
    for (&p, n) in cleaned.points.iter().zip(&cleaned.normals) {
        used.dot(p, 1.6, 0.0, (0.5 + 0.45 * *n).to_array());
    }
    let [spacing, noise] = [cleaned.spacing, cleaned.noise];
    let found = format!("spacing {spacing:.2} mm, noise {noise:.2} mm");
    legend(&mut used, &[(found, INK)]);
    save(&[all, used], path)
}

/// Lines of constant u and v on the mesh of a cloud, and its triangles in the domain.
fn draw_chart(path: &Path) -> Outcome<()> {
    let cleaned = cleaned(&cloud(Shape::Torus, 5000, 0.0, 0.0)?.scan)?;
    let triangles = triangulate_oriented(&cleaned.points, &cleaned.normals, &Silent)?;
    let mesh = repair(&cleaned.points, &triangles, &Silent)?.manifold;
    let chart = chart_of_mesh(&mesh, &Silent)?;
    let [along_u, along_v] = chart.size;
    // Cells about as long as wide.
    let counts = [12.0, (12.0 * along_v / along_u).round()];
    let place = |p: DVec2| DVec3::new(p.y * along_v, p.x * along_u, 0.0);
    let view = View::upright([520, 420], [20.0, 42.0]);
    let mut shape = view.panel(&mesh.points, "the cloud as a mesh");
    let domain = [DVec2::ZERO, DVec2::ONE].map(place);
    let mut flat = View::flat([860, 420]).panel(&domain, "the domain: v to the right, u up");
    let inside = |p: &DVec3| p.cmpge(domain[0]).all() && p.cmple(domain[1]).all();
    for (t, &places) in chart.corners.iter().enumerate() {
        let corners = mesh.corners(t);
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let vertices = corners.map(|point| Vertex {
            point,
            normal: normal.normalize_or_zero(),
            sides: PALE,
        });
        shape.triangle([&vertices[0], &vertices[1], &vertices[2]]);
        let spots = places.map(place);
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            shape.line(corners[a], corners[b], 0.6, 0.002, [0.62, 0.64, 0.67]);
            if inside(&spots[a]) && inside(&spots[b]) {
                flat.line(spots[a], spots[b], 0.6, 0.0, [0.55, 0.57, 0.60]);
            }
        }
        for (axis, colour) in [(0, RED), (1, BLUE)] {
            let values = places.map(|p| p[axis]);
            for [a, b] in crossings(corners, values, counts[axis]) {
                shape.line(a, b, 1.8, 0.006, colour);
            }
        }
    }
    for (axis, colour) in [(0, RED), (1, BLUE)] {
        let steps = std::iter::successors(Some(0.0), |k| Some(k + 1.0));
        for k in steps.take_while(|&k| k <= counts[axis]) {
            let mut ends = [DVec2::ZERO, DVec2::ONE];
            ends.iter_mut().for_each(|end| end[axis] = k / counts[axis]);
            let [a, b] = ends.map(place);
            flat.line(a, b, 1.8, 0.01, colour);
        }
    }
    save(&[shape, flat], path)
}

/// Knot lines of the first surface, of one with few control points, and of the final one.
fn draw_fits(path: &Path) -> Outcome<()> {
    const LARGEST: f64 = 0.5;
    let view = View {
        angles: [-20.0, 8.0],
        ..View::flat([420, 540])
    };
    let cleaned = cleaned(&cloud(Shape::Face, 12_000, 0.1, 0.0)?.scan)?;
    let chart = chart_on_plane(&cleaned)?;
    let usual = ApproximateOptions {
        noise: Some(cleaned.noise),
        correct: false,
        ..ApproximateOptions::new(0.4)
    };
    let first = ApproximateOptions {
        refine: false,
        ..usual.clone()
    };
    let few = ApproximateOptions {
        max_control_points: Some(200),
        ..usual.clone()
    };
    let mut views = Vec::new();
    for (name, options) in [
        ("first round", first),
        ("200 at most", few),
        ("final", usual),
    ] {
        let made = approximate(&cleaned.points, &chart, &options, &Silent)?;
        let mut canvas = view.panel(&cleaned.points, name);
        shade(&mut canvas, &made.surface, &|_| true);
        let (u, v) = (made.surface.knots_u(), made.surface.knots_v());
        let knots = [u, v].map(nurbskin::KnotVector::breakpoints);
        wires(&mut canvas, &made.surface, &knots, &|_| true);
        for (&p, off) in cleaned.points.iter().zip(&made.residuals) {
            canvas.dot(p, 1.0, 0.003, scale::diverging(off / LARGEST));
        }
        let [m, n] = made.surface.distinct_counts();
        let mut distances: Vec<f64> = made.residuals.iter().map(|off| off.abs()).collect();
        distances.sort_by(f64::total_cmp);
        let p95 = distances[distances.len() * 95 / 100];
        let lines = [
            (format!("{m} x {n} control points"), INK),
            (format!("95 % within {p95:.2} mm"), INK),
        ];
        legend(&mut canvas, &lines);
        views.push(canvas);
    }
    save(&views, path)
}

/// A sheet with a notch and a hole: what the fit gives, and what is left of it.
fn draw_trimming(path: &Path) -> Outcome<()> {
    const VIEW: View = View::upright([640, 480], [-35.0, 48.0]);
    let simulated = cloud(Shape::Saddle, 9000, 0.02, 0.0)?;
    let in_notch = |p: &DVec2| p.x > 0.55 && (p.y - 0.30).abs() < 0.13;
    let in_hole = |p: &DVec2| p.distance(DVec2::new(0.38, 0.70)) < 0.15;
    let places = simulated.parameters.iter();
    let kept = simulated.scan.points.iter().zip(places);
    let kept = kept.filter(|(_, p)| !in_notch(p) && !in_hole(p));
    let cut = Scan {
        points: kept.map(|(point, _)| *point).collect(),
        ..Scan::default()
    };
    let cleaned = cleaned(&cut)?;
    let no_sheet = || Failure::Unsupported("the sheet has no plane".into());
    let charts = Charts::new(&cleaned, ChartOptions::default());
    let base = charts.natural_base()?.ok_or_else(no_sheet)?;
    let guides = Guides {
        extends: base.extends != Extends::No,
        ..Guides::default()
    };
    let options = ApproximateOptions {
        noise: Some(cleaned.noise),
        correct: false,
        ..ApproximateOptions::new(0.1)
    };
    let points = &cleaned.points;
    let made = approximate_guided(points, &base.chart, &guides, &options, &Silent)?;
    let found = trimming(&made.surface, &Scanned::cloud(points, cleaned.spacing))?;
    let mut model = Model::new("sheet");
    model.add_trimmed_surface(&found, 1e-7, 1e-5)?;
    let face = model.faces().first().ok_or_else(no_sheet)?;
    let region = Region::new(face)?;
    let surface = &face.surface;
    let grid = surface.domain().map(|(from, to)| -> Vec<f64> {
        let at = |k: u32| from + (to - from) * f64::from(k) / 16.0;
        (0..=16).map(at).collect()
    });
    let corners: Vec<DVec3> = grid[0]
        .iter()
        .flat_map(|&u| grid[1].iter().map(move |&v| surface.point(u, v)))
        .collect();
    let everywhere = |_: DVec2| true;
    let left = |p: DVec2| region.contains(p);
    let mut views = Vec::new();
    let shown: [(&str, &dyn Fn(DVec2) -> bool); 2] = [
        ("surface, points, loops", &everywhere),
        ("the trimmed face", &left),
    ];
    for (k, (title, shown)) in shown.into_iter().enumerate() {
        let mut canvas = VIEW.panel(&corners, title);
        shade(&mut canvas, surface, shown);
        wires(&mut canvas, surface, &grid, shown);
        if k == 0 {
            points.iter().for_each(|&p| canvas.dot(p, 1.0, 0.004, BLUE));
        }
        for used in face.loops.iter().flat_map(|each| &each.uses) {
            let (from, to) = used.pcurve.domain();
            let at = |t: f64| {
                let p = used.pcurve.point(from + (to - from) * t);
                Some(surface.point(p.x, p.y))
            };
            curve(&mut canvas, &at, [3.0, 0.01], RED);
        }
        views.push(canvas);
    }
    save(&views, path)
}

/// Points by their signed deviation from a surface through few of them; how these and the brackets are spread.
fn draw_deviation(path: &Path) -> Outcome<()> {
    const LARGEST: f64 = 1.0;
    let simulated = scan(Shape::Pot, &ScanOptions::default())?;
    let ordered = order(&simulated.scan, None)?;
    let (_, lines) = to_counts_filled(&ordered.grid, ordered.topology, [16, 16])?;
    let kept = ordered.grid.select(&lines.u, &lines.v)?;
    let surface = interpolate(&kept, ordered.topology, [3, 3], ChordLength)?.surface;
    let points = &simulated.scan.points;
    let closest = ClosestPoint::new(&surface)?;
    let measured = measure(&closest, points, None, None, Outside::Normal, &Silent)?;
    let view = View::upright([520, 500], [20.0, 22.0]);
    let mut object = view.panel(points, "signed deviation");
    for (&p, off) in points.iter().zip(&measured.points) {
        object.dot(p, 2.2, 0.0, scale::diverging(off.signed() / LARGEST));
    }
    scale::draw(&mut object, [440, 120], 260, LARGEST);
    let mut plots = View::flat([540, 500]).panel(points, "points by signed deviation, mm");
    let signed = Bars {
        top: 40,
        range: [-LARGEST, LARGEST],
        labels: ["-1", "-0.5", "0", "0.5", "1"],
    };
    let values = measured.points.iter().map(PointDeviation::signed);
    signed.draw(&mut plots, values, &|value| {
        scale::diverging(value / LARGEST)
    });
    let title = "points by upper - lower bound, mm";
    text::write(&mut plots, [12, 256], title, INK);
    let bracket = Bars {
        top: 288,
        range: [-14.0, -6.0],
        labels: ["1e-14", "1e-12", "1e-10", "1e-8", "1e-6"],
    };
    let widths = measured.points.iter().map(|p| p.upper - p.lower);
    let widths = widths.map(|width| width.max(1e-16).log10());
    bracket.draw(&mut plots, widths, &|_| BLUE);
    save(&[object, plots], path)
}

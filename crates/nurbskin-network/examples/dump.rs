//! dev
use glam::DVec3;
use nurbskin_geometry::progress::Progress;
use nurbskin_network::fit::{FitOptions, Target, fit_best};
use nurbskin_network::layout::{LayoutOptions, layout};
use nurbskin_network::layout::lines::{Sharp, feature_lines};
use nurbskin_scan::mesh::{holes, repair};
use nurbskin_scan::{CleanOptions, clean};
struct Log(std::time::Instant);
impl Progress for Log {
    fn stage(&self, _: &'static str, _: Option<u64>) {}
    fn advance(&self, _: u64) {}
    fn tell(&self, s: &str) { println!("{:6.2} {s}", self.0.elapsed().as_secs_f64()); }
    fn warn(&self, _: &str) {}
}
fn main() {
    let arg = |k: usize, d: &str| std::env::args().nth(k).unwrap_or(d.into());
    let path = arg(1, "");
    let tol: f64 = arg(2, "0.5").parse().unwrap();
    let most: usize = arg(3, "30000").parse().unwrap();
    let fill: usize = arg(4, "40").parse().unwrap();
    let sharp_deg: f64 = arg(5, "0").parse().unwrap();
    let cells: usize = arg(6, "0").parse().unwrap();
    let scan = nurbskin_scan::io::scan::read_scan(std::path::Path::new(&path)).unwrap();
    let log = Log(std::time::Instant::now());
    let cleaned = clean(&scan, &CleanOptions::default(), &log).unwrap();
    let r = repair::repair(&cleaned.points, &cleaned.triangles, &log).unwrap();
    let m = r.manifold;
    let small: Vec<usize> = (0..m.loops.len()).filter(|&k| m.loops[k].len() <= fill).collect();
    let (m, _) = holes::fill(m, &small);
    println!("{:6.2} {} vertices, genus {}, borders {}, noise {:.3e} spacing {:.3e}", log.0.elapsed().as_secs_f64(), m.points.len(), m.genus(), m.loops.len(), cleaned.noise, cleaned.spacing);
    let kind = if sharp_deg < 0.0 { Sharp::Off } else if sharp_deg > 0.0 { Sharp::Degrees(sharp_deg) } else { Sharp::Auto };
    let lines = feature_lines(&m, cleaned.spacing, cleaned.noise, kind);
    let sharp = lines.sides;
    println!("{:6.2} {} chains of {:.3} D", log.0.elapsed().as_secs_f64(), lines.chains, lines.length / { let b = nurbskin_geometry::point_grid::bounding_box(&m.points); b[0].distance(b[1]) });
    let kinds: Vec<LayoutOptions> = arg(7, "p0.158,p0.105,p0.072,g0.25").split(',').map(|k| {
        let radius: f64 = k.trim_start_matches(|c: char| c.is_alphabetic()).parse().unwrap();
        let n = (cells > 0).then_some(cells);
        match &k[..1] {
            "p" => LayoutOptions { radius, cells: n, ..LayoutOptions::parity() },
            "a" => LayoutOptions { radius, cells: n, ..LayoutOptions::aligned() },
            _ => LayoutOptions { radius, cells: n, ..LayoutOptions::default() },
        }
    }).collect();
    let layouts: Vec<_> = kinds.iter().map(|k| {
        let l = layout(&m, &sharp, k).unwrap();
        l.validate(&m).unwrap();
        println!("{:6.2} {} faces", log.0.elapsed().as_secs_f64(), l.faces.len());
        l
    }).collect();
    let b = nurbskin_geometry::point_grid::bounding_box(&m.points);
    let diagonal = b[0].distance(b[1]);
    let target = Target { mesh: &m, points: &cleaned.points, normals: &cleaned.normals, noise: if std::env::var_os("NOISE").is_some() { cleaned.noise } else { 0.0 } };
    let (_, f) = fit_best(&target, &layouts, &FitOptions { tolerance: tol * 1e-3 * diagonal, share_within: 1.0, max_control_points: most }, &log).unwrap();
    let _ = DVec3::ZERO;
    println!("{} faces, {:.2} s, max {:.3}", f.faces.len(), log.0.elapsed().as_secs_f64(), f.distances.iter().copied().fold(0.0, f64::max) / diagonal * 1e3);
}

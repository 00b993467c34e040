//! dev
use glam::DVec3;
use nurbskin_geometry::progress::Progress;
use nurbskin_network::fit::{FitOptions, Target, fit_best};
use nurbskin_network::layout::{CellShape, FaceSplit, LayoutOptions, layout};
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
    let adj = m.adjacency();
    let mut sharp = vec![false; 3 * m.triangles.len()];
    if sharp_deg > 0.0 {
        for side in 0..sharp.len() {
            let o = adj.opposite[side];
            if o != u32::MAX {
                let [a, b] = [side / 3, o as usize / 3].map(|t| m.vector_area(t).normalize_or_zero());
                sharp[side] = a.cross(b).length().atan2(a.dot(b)).to_degrees() > sharp_deg;
            }
        }
    }
    let kinds: Vec<LayoutOptions> = arg(7, "ap1,ap1.5,ap2.2,g1").split(',').map(|k| {
        let p = k.contains('p');
        let div: f64 = k.trim_start_matches(|c: char| c.is_alphabetic()).parse().unwrap_or(1.0);
        let n = (cells as f64 * if p { 2.5 } else { 1.0 } * div * div) as usize;
        let radius = 0.25 / div / if p { 2.5_f64.sqrt() } else { 1.0 };
        LayoutOptions { radius, cells: (cells > 0).then_some(n), shape: if k.contains('a') { CellShape::Aligned } else { CellShape::Geodesic }, split: if p { FaceSplit::Parity } else { FaceSplit::All } }
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

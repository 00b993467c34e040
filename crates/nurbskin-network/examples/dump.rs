//! dev
use glam::DVec3;
use nurbskin_geometry::progress::Progress;
use nurbskin_network::fit::{FitOptions, Target, fit};
use nurbskin_network::layout::*;
struct Log(std::time::Instant);
impl Progress for Log {
    fn stage(&self, _: &'static str, _: Option<u64>) {}
    fn advance(&self, _: u64) {}
    fn tell(&self, s: &str) { println!("{:6.2} {s}", self.0.elapsed().as_secs_f64()); }
    fn warn(&self, _: &str) {}
}
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let tol: f64 = std::env::args().nth(2).map_or(0.5, |s| s.parse().unwrap());
    let most: usize = std::env::args().nth(3).map_or(20000, |s| s.parse().unwrap());
    let v: serde_json::Value = serde_json::from_reader(std::io::BufReader::new(std::fs::File::open(path).unwrap())).unwrap();
    let p3 = |v: &serde_json::Value| DVec3::new(v[0].as_f64().unwrap(), v[1].as_f64().unwrap(), v[2].as_f64().unwrap());
    let pts = |k: &str| v[k].as_array().unwrap().iter().map(p3).collect::<Vec<_>>();
    let u = |v: &serde_json::Value| v.as_u64().unwrap() as u32;
    let (points, normals) = (pts("V"), pts("N"));
    let triangles: Vec<[u32; 3]> = v["F"].as_array().unwrap().iter().map(|t| [u(&t[0]), u(&t[1]), u(&t[2])]).collect();
    let layout = Layout {
        vertices: pts("pos"),
        edges: v["edges"].as_array().unwrap().iter().map(|e| LayoutEdge {
            ends: [u(&e[0]), u(&e[1])],
            kind: match e[2].as_str().unwrap() { "smooth" => EdgeKind::Smooth, "sharp" => EdgeKind::Sharp, _ => EdgeKind::Open },
            line: e[3].as_i64().filter(|&l| l >= 0).map(|l| l as u32),
        }).collect(),
        faces: v["faces"].as_array().unwrap().iter().map(|f| LayoutFace {
            corners: std::array::from_fn(|k| u(&f[0][k])),
            sides: std::array::from_fn(|k| Side { edge: u(&f[1][k][0]), reversed: f[1][k][1].as_bool().unwrap() }),
        }).collect(),
        start: v["start"].as_array().unwrap().iter().map(|s| OnFace { face: s[0].as_f64().unwrap() as u32, u: s[1].as_f64().unwrap(), v: s[2].as_f64().unwrap() }).collect(),
        on_lines: v["on"].as_array().unwrap().iter().map(|s| OnLine { vertex: u(&s[0]), edge: u(&s[1]), t: s[2].as_f64().unwrap() }).collect(),
    };
    let diagonal = v["diag"].as_f64().unwrap();
    let target = Target { points: &points, normals: &normals, triangles: &triangles, diagonal };
    let t0 = std::time::Instant::now();
    let f = fit(&target, &layout, &FitOptions { tolerance: tol * 1e-3 * diagonal, share_within: 1.0, max_control_points: most }, &Log(t0)).unwrap();
    println!("{} faces, {:.2} s", f.faces.len(), t0.elapsed().as_secs_f64());
}

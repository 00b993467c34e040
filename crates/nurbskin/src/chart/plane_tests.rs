//! What projects is charted, what does not is refused and named.

use super::*;
use crate::progress::Silent;
use crate::scan::simulate::{Order, ScanOptions, Shape, scan};
use crate::scan::{CleanOptions, CleanScan, Organisation, Scan, clean};
use glam::{DMat3, DQuat};

fn charted(scan: &CleanScan) -> Result<Chart> {
    chart_on_plane(&scan.points, &scan.normals, &scan.triangles, &scan.parts)
}

#[test]
fn zz_real() {
    for f in [
        "fran_cut",
        "rvcg_humface",
        "lee_perry_smith_head",
        "mustard_body",
        "bunny",
        "banana",
        "vase",
        "bottle",
        "soup",
        "neon",
    ] {
        let read = |e: &str| std::fs::read_to_string(format!("/tmp/simdata/{f}.{e}")).unwrap();
        let points: Vec<DVec3> = read("xyz")
            .lines()
            .map(|l| {
                let v: Vec<f64> = l.split_whitespace().map(|x| x.parse().unwrap()).collect();
                DVec3::new(v[0], v[1], v[2])
            })
            .collect();
        let tri: Vec<[u32; 3]> = read("tri")
            .lines()
            .map(|l| {
                let v: Vec<u32> = l.split_whitespace().map(|x| x.parse().unwrap()).collect();
                [v[0], v[1], v[2]]
            })
            .collect();
        for organisation in [Organisation::Mesh(tri), Organisation::Unordered] {
            let name = organisation.name();
            let s = Scan {
                points: points.clone(),
                organisation,
                ..Scan::default()
            };
            let t = std::time::Instant::now();
            let c = clean(&s, &CleanOptions::default(), &Silent).unwrap();
            let t1 = t.elapsed();
            let out: Vec<usize> = c
                .rejected
                .iter()
                .filter(|r| r.reason == crate::scan::Reason::Outlier)
                .map(|r| r.index)
                .collect();
            println!(
                "{f} {name}: {} used, out {}, spacing {:.4}, noise {:.5}, parts {:?}, clean {t1:?}",
                c.used.len(),
                out.len(),
                c.spacing,
                c.noise,
                c.parts.sizes.iter().take(5).collect::<Vec<_>>()
            );
            let t = std::time::Instant::now();
            match charted(&c) {
                Ok(ch) => println!("   OK {:?} {} {:?}", ch.size, ch.reason, t.elapsed()),
                Err(e) => println!("   {e} {:?}", t.elapsed()),
            }
        }
    }
}

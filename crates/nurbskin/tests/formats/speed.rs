//! How fast large scans are read; run with `--ignored --nocapture`.

use nurbskin::DVec3;
use nurbskin::io::{read_scan, write_scan};
use nurbskin::scan::{Organisation, Scan};
use std::path::Path;
use std::time::Instant;

/// Reads a file five times and prints the best.
fn measure(path: &Path) -> Scan {
    let megabytes = std::fs::metadata(path).unwrap().len() as f64 / 1e6;
    let mut best = f64::INFINITY;
    let mut last = Scan::default();
    for _ in 0..5 {
        drop(std::mem::take(&mut last));
        let begun = Instant::now();
        last = read_scan(path).unwrap();
        best = best.min(begun.elapsed().as_secs_f64());
    }
    println!(
        "{:12} {:8} points {megabytes:7.1} MB {best:.3} s {:6.0} MB/s",
        path.file_name().unwrap().to_string_lossy(),
        last.points.len(),
        megabytes / best
    );
    last
}

#[test]
#[ignore = "measures, takes seconds and 500 MB of temporary files"]
fn large_scans() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let points: Vec<DVec3> = (0..5_000_000)
        .map(f64::from)
        .map(|k| DVec3::new((k * 0.37).sin() * 100.0, k * 1e-4, (k * 0.11).cos()))
        .collect();
    let mut floats = b"ply\nformat binary_little_endian 1.0\nelement vertex 5000000\nproperty float x\nproperty float y\n\
        property float z\nend_header\n"
        .to_vec();
    for point in &points {
        floats.extend(
            point
                .as_vec3()
                .to_array()
                .iter()
                .flat_map(|c| c.to_le_bytes()),
        );
    }
    std::fs::write(path("float.ply"), floats).unwrap();
    measure(&path("float.ply"));
    let mut scan = Scan {
        points,
        ..Scan::default()
    };
    write_scan(path("double.ply"), &scan).unwrap();
    measure(&path("double.ply"));
    scan.points.truncate(1_000_000);
    for name in ["full.xyz", "full.csv"] {
        write_scan(path(name), &scan).unwrap();
        measure(&path(name));
    }
    let short: String = scan
        .points
        .iter()
        .map(|p| format!("{:.4} {:.4} {:.4}\n", p.x, p.y, p.z))
        .collect();
    std::fs::write(path("short.xyz"), &short).unwrap();
    measure(&path("short.xyz"));
    std::fs::write(path("comma.txt"), short.replace(' ', ";").replace('.', ",")).unwrap();
    measure(&path("comma.txt"));
    let quoted = short.replace(' ', "\",\"").replace('\n', "\"\n\"");
    std::fs::write(
        path("quoted.csv"),
        format!("\"{}\n", &quoted[..quoted.len() - 2]),
    )
    .unwrap();
    measure(&path("quoted.csv"));
    let header = "ply\nformat ascii 1.0\nelement vertex 1000000\nproperty float x\nproperty float y\nproperty float z\n\
        end_header\n";
    std::fs::write(path("ascii.ply"), format!("{header}{short}")).unwrap();
    measure(&path("ascii.ply"));
    scan.points.truncate(500_000);
    let triangles = (0..499_000_u32).flat_map(|k| [[k, k + 1, k + 700], [k, k + 700, k + 699]]);
    scan.organisation = Organisation::Mesh(triangles.collect());
    for name in ["mesh.ply", "mesh.obj", "mesh.stl"] {
        write_scan(path(name), &scan).unwrap();
        measure(&path(name));
    }
}

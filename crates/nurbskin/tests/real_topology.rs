//! What real scans are, after repair; read from the folder named by `NURBSKIN_DATA`, skipped where it is not set.

use nurbskin::chart::Topology;
use nurbskin::chart::shape::shape_of;
use nurbskin::mesh::holes::fill;
use nurbskin::mesh::repair::repair;
use nurbskin::progress::Silent;
use nurbskin::scan::Organisation;
use nurbskin::{DVec3, io};
use std::path::Path;

type Mesh = (Vec<DVec3>, Vec<[u32; 3]>);

/// Points and triangles of an OFF file.
fn off(path: &Path) -> Mesh {
    let text = std::fs::read_to_string(path).unwrap();
    let mut words = text.split_whitespace().skip(1);
    let mut whole = || words.next().unwrap().parse::<u32>().unwrap();
    let [vertices, faces, _] = [whole(), whole(), whole()];
    let mut number = || words.next().unwrap().parse::<f64>().unwrap();
    let points = (0..vertices)
        .map(|_| DVec3::new(number(), number(), number()))
        .collect();
    let mut whole = || words.next().unwrap().parse::<u32>().unwrap();
    let mut triangles = Vec::new();
    for _ in 0..faces {
        let corners: Vec<u32> = (0..whole()).map(|_| whole()).collect();
        triangles.extend((1..corners.len() - 1).map(|k| [corners[0], corners[k], corners[k + 1]]));
    }
    (points, triangles)
}

fn mesh(path: &Path) -> Mesh {
    if path.extension().is_some_and(|e| e == "off") {
        return off(path);
    }
    let scan = io::read_scan(path).unwrap();
    match scan.organisation {
        Organisation::Mesh(triangles) => (scan.points, triangles),
        other => panic!("{}: {}", path.display(), other.name()),
    }
}

#[test]
fn real_meshes_are_repaired_and_understood() {
    let Some(data) = std::env::var_os("NURBSKIN_DATA") else {
        println!("skipped: NURBSKIN_DATA does not name a folder of real scans");
        return;
    };
    use Topology::{Disk, Sphere, Tube};
    let known = [
        ("faces/fran_cut.ply", Ok((Disk, 0))),
        ("faces/rvcg_humface.ply", Ok((Disk, 1))),
        ("faces/lee_perry_smith_head.ply", Ok((Sphere, 0))),
        ("pots/plastic_vase.ply", Ok((Tube, 60))),
        ("pots/ycb_bowl_16k.stl", Ok((Sphere, 0))),
        ("pots/ycb_tomato_soup_can.obj", Ok((Sphere, 0))),
        ("pots/ycb_master_chef_can.obj", Ok((Sphere, 0))),
        ("tubes/ycb_mustard_bottle.obj", Ok((Sphere, 0))),
        ("tubes/ycb_mustard_body_crop.ply", Ok((Tube, 0))),
        ("tubes/ycb_banana.obj", Ok((Sphere, 0))),
        ("classics/stanford_bun_zipper.ply", Ok((Sphere, 5))),
        ("classics/fandisk.obj", Ok((Sphere, 0))),
        ("patches/neon_side_panel.off", Ok((Disk, 3))),
        (
            "pots/sea_vase.ply",
            Err("1 handle (genus 1) and 2 openings"),
        ),
        ("tubes/aorta2.stl", Err("branches: it has 5 openings")),
    ];
    for (name, expected) in known {
        let path = Path::new(&data).join(name);
        if !path.exists() {
            println!("skipped: {name} is missing");
            continue;
        }
        let (points, triangles) = mesh(&path);
        let manifold = repair(&points, &triangles, &Silent).unwrap().manifold;
        match (shape_of(&manifold, None), expected) {
            (Ok(shape), Ok((topology, holes))) => {
                assert_eq!(
                    (shape.topology, shape.holes.len()),
                    (topology, holes),
                    "{name}: {}",
                    shape.reason
                );
                let filled = fill(manifold, &shape.holes).0;
                assert_eq!(
                    (filled.loops.len(), filled.genus()),
                    (shape.openings.len(), 0),
                    "{name}"
                );
                let open = filled
                    .adjacency()
                    .opposite
                    .iter()
                    .filter(|s| **s == u32::MAX)
                    .count();
                assert_eq!(
                    open,
                    filled.loops.iter().map(Vec::len).sum::<usize>(),
                    "{name}"
                );
            }
            (Err(why), Err(text)) => assert!(why.to_string().contains(text), "{name}: {why}"),
            (found, _) => panic!("{name}: {found:?}"),
        }
    }
}

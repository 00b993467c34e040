//! Scans from other programs, in the folder that the environment variable `NURBSKIN_DATA` names.

use nurbskin::Error;
use nurbskin::io::read_scan;
use nurbskin::scan::Organisation;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The folder of data, or nothing with a printed reason.
fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("NURBSKIN_DATA").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: NURBSKIN_DATA names no folder of scans");
    }
    folder
}

/// File, points, organisation, cells or triangles.
const GOOD: [(&str, usize, &str, usize); 42] = [
    ("faces/fran_cut.ply", 2205, "mesh", 4224),
    ("faces/rvcg_humface.ply", 10381, "mesh", 20000),
    ("faces/lee_perry_smith_head.ply", 8838, "mesh", 17672),
    ("pots/plastic_vase.ply", 18238, "mesh", 35708),
    ("pots/sea_vase.ply", 18063, "mesh", 35483),
    ("pots/ycb_bowl_16k.stl", 8191, "mesh", 16375),
    ("pots/ycb_tomato_soup_can.obj", 7850, "mesh", 15728),
    ("pots/ycb_master_chef_can.obj", 7678, "mesh", 15728),
    ("tubes/ycb_mustard_bottle.obj", 7866, "mesh", 15728),
    ("tubes/ycb_mustard_body_crop.ply", 4527, "mesh", 8845),
    ("tubes/ycb_mustard_body_crop.xyz", 4527, "unordered", 0),
    ("tubes/ycb_banana.obj", 7866, "mesh", 15728),
    ("tubes/aorta2.stl", 6278, "mesh", 12455),
    ("organised/stanford_bun000.ply", 40256, "grid", 204_800),
    ("organised/stanford_bun090.ply", 30379, "grid", 204_800),
    ("organised/stanford_bun180.ply", 40251, "grid", 204_800),
    ("organised/stanford_bun270.ply", 31701, "grid", 204_800),
    (
        "organised/mosd_learn36_cylinders.pcd",
        171_863,
        "grid",
        307_200,
    ),
    (
        "organised/pcl_table_scene_mug.pcd",
        209_280,
        "grid",
        307_200,
    ),
    ("patches/neon_side_panel.off", 15896, "mesh", 30376),
    ("formats/bunnyDouble.e57", 30571, "unordered", 0),
    ("formats/tiny_spherical.e57", 360, "unordered", 0),
    ("formats/pdal_simple.las", 1065, "unordered", 0),
    ("formats/pdal_simple.laz", 1065, "unordered", 0),
    ("formats/pdal_with_color.ptx", 1065, "grid", 1065),
    ("formats/pcdrs_ascii.pcd", 213, "unordered", 0),
    (
        "formats/pcdrs_highly_uncompressed.pcd",
        1000,
        "unordered",
        0,
    ),
    (
        "formats/pcdrs_mixed_types_compressed.pcd",
        2,
        "unordered",
        0,
    ),
    ("formats/pcdrs_test_v05_ascii.pcd", 2, "unordered", 0),
    ("formats/pcdrs_test_v06_binary.pcd", 1, "unordered", 0),
    (
        "formats/plyrs_leading_spaces_ok_ascii.ply",
        4,
        "unordered",
        0,
    ),
    ("classics/stanford_bun_zipper.ply", 35947, "mesh", 69451),
    ("classics/fandisk.obj", 6475, "mesh", 12946),
    ("classics/cgal_kitten_normals.xyz", 5210, "unordered", 0),
    ("patches/gismo_deepdrawingC_xyzuv.txt", 2969, "unordered", 0),
    ("formats/pdal_test.pts", 19, "unordered", 0),
    ("formats/points_cloudcompare.xyz", 101, "unordered", 0),
    ("formats/points_agisoft.xyz", 100, "unordered", 0),
    (
        "formats/plyrs_empty_2_ok_little_endian.ply",
        0,
        "unordered",
        0,
    ),
    (
        "formats/plyrs_exponent_values_ok_ascii.ply",
        1,
        "unordered",
        0,
    ),
    (
        "formats/plyrs_greg_turk_example2_ok_ascii.ply",
        8,
        "mesh",
        12,
    ),
    ("formats/plyrs_house_2_ok_little_endian.ply", 5, "mesh", 3),
];

#[test]
fn real_scans_read_whole() {
    let Some(folder) = data() else { return };
    for (name, points, organisation, cells) in GOOD {
        let begun = Instant::now();
        let scan = read_scan(folder.join(name)).unwrap_or_else(|e| panic!("{e}"));
        let seconds = begun.elapsed().as_secs_f64();
        let found = match &scan.organisation {
            Organisation::Grid(grid) => grid.cells.len(),
            Organisation::Mesh(triangles) => triangles.len(),
            _ => 0,
        };
        println!(
            "{name:48} {:6} {:9} {found:6} {seconds:.4} s {:?}",
            scan.points.len(),
            scan.organisation.name(),
            scan.warnings
        );
        assert_eq!(scan.points.len(), points, "{name}");
        assert_eq!(scan.organisation.name(), organisation, "{name}");
        assert_eq!(found, cells, "{name}");
        if name.ends_with("normals.xyz") {
            assert!(scan.normals.is_some(), "{name}");
        }
    }
}

#[test]
fn hostile_files_get_a_scan_or_a_sentence() {
    let Some(folder) = data() else { return };
    for part in ["hostile", "formats", "organised", "patches", "cad"] {
        visit(&folder.join(part));
    }
}

fn visit(folder: &Path) {
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.sort();
    for path in paths {
        let begun = Instant::now();
        let outcome = read_scan(&path);
        let seconds = begun.elapsed().as_secs_f64();
        match outcome {
            Ok(scan) => println!(
                "{:60} {} points, {}, {:?}",
                path.file_name().unwrap().to_string_lossy(),
                scan.points.len(),
                scan.organisation.name(),
                scan.warnings
            ),
            Err(error) => {
                println!("{error}");
                assert!(matches!(error, Error::Read { .. } | Error::Unsupported(_)));
                assert!(!error.to_string().contains('\n'));
            }
        }
        assert!(seconds < 0.5, "{}: {seconds} s", path.display());
    }
}

//! Real scans, read from the folder named by `NURBSKIN_DATA`; skipped with a reason where it is not set.

use nurbskin::DVec3;
use nurbskin::chart::Topology::{self, Disk, Sphere, Tube};
use nurbskin::deviation::verdict::Verdict;
use nurbskin::pipeline::{Length, Options, Outcome, SurfacingOptions, fit};
use nurbskin::progress::Silent;
use nurbskin::surfacing::FaceLayout;
use std::path::PathBuf;

/// The file of a scan, if it is there.
pub(crate) fn path(name: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("NURBSKIN_DATA") else {
        println!("skipped: NURBSKIN_DATA does not name a folder of real scans");
        return None;
    };
    let path = PathBuf::from(folder).join(name);
    if !path.exists() {
        println!("skipped: {} is missing", path.display());
        return None;
    }
    Some(path)
}

/// What a fit without flags must reach; lengths in thousandths of the diagonal of the scan's box.
struct Bars {
    topology: Topology,
    /// 95 % of the points are this close to the surface.
    to_surface: f64,
    /// 95 % of the surface is this close to the scan.
    to_scan: f64,
    /// Share of the surface without data beneath.
    bare: f64,
}

/// Control points that the bars are for.
const BUDGET: usize = 1600;

/// Fits a scan with the control points of the bars and no tolerance, and holds it against them.
fn reaches(name: &str, bars: &Bars) {
    let Some(path) = path(name) else { return };
    let options = Options {
        surfacing: SurfacingOptions {
            max_control_points: Some(BUDGET),
            ..SurfacingOptions::default()
        },
        ..Options::default()
    };
    let found: Outcome = fit(&path, &[], &options, &Silent).unwrap();
    let [lo, hi] = found.input.bounding_box.map(DVec3::from_array);
    let per_mille = 1e3 / lo.distance(hi);
    let to_surface = found.deviation.scan_to_surface.p95 * per_mille;
    let to_scan = found.deviation.surface_to_scan.p95 * per_mille;
    let bare = found.deviation.surface_to_scan.unsupported_area;
    let count: usize = found.surface.control_points.iter().product();
    let said = format!(
        "{name}: {:?} {count} control points, to surface {to_surface:.3}, to scan {to_scan:.3}, bare {bare:.4}; {:?}",
        found.surface.topology, found.warnings
    );
    println!("{said}");
    assert_eq!(found.surface.topology, Some(bars.topology), "{said}");
    assert_eq!(found.geometry.len(), 1, "{said}");
    assert!(count <= BUDGET, "{said}");
    assert!(to_surface <= bars.to_surface, "{said}");
    assert!(to_scan <= bars.to_scan, "{said}");
    assert!(bare <= bars.bare, "{said}");
}

#[test]
fn a_cut_out_face() {
    let bars = Bars {
        topology: Disk,
        to_surface: 3.0,
        to_scan: 3.0,
        bare: 0.02,
    };
    reaches("faces/fran_cut.ply", &bars);
}

#[test]
fn a_face_with_a_ragged_rim() {
    let bars = Bars {
        topology: Disk,
        to_surface: 3.0,
        to_scan: 3.0,
        bare: 0.02,
    };
    reaches("faces/rvcg_humface.ply", &bars);
}

#[test]
fn a_tube_with_its_mesh() {
    let bars = Bars {
        topology: Tube,
        to_surface: 0.5,
        to_scan: 1.0,
        bare: 0.01,
    };
    reaches("tubes/ycb_mustard_body_crop.ply", &bars);
}

#[test]
fn a_tube_without_its_mesh() {
    // The distance to a scan without triangles is that to its next point: up to about the spacing, 12.8.
    let bars = Bars {
        topology: Tube,
        to_surface: 0.5,
        to_scan: 12.8,
        bare: 0.01,
    };
    reaches("tubes/ycb_mustard_body_crop.xyz", &bars);
}

#[test]
fn a_long_closed_shape() {
    let bars = Bars {
        topology: Sphere,
        to_surface: 0.5,
        to_scan: 1.0,
        bare: 0.01,
    };
    reaches("tubes/ycb_banana.obj", &bars);
}

#[test]
fn a_closed_shape_with_creases() {
    let bars = Bars {
        topology: Sphere,
        to_surface: 1.5,
        to_scan: 1.5,
        bare: 0.01,
    };
    reaches("tubes/ycb_mustard_bottle.obj", &bars);
}

#[test]
fn a_vase_with_holes() {
    let bars = Bars {
        topology: Tube,
        to_surface: 3.0,
        to_scan: 3.0,
        bare: 0.02,
    };
    reaches("pots/plastic_vase.ply", &bars);
}

#[test]
fn a_body_with_limbs() {
    let bars = Bars {
        topology: Sphere,
        to_surface: 5.0,
        to_scan: 10.0,
        bare: 0.05,
    };
    reaches("classics/stanford_bun_zipper.ply", &bars);
}

#[test]
fn a_panel_with_windows() {
    // The surface goes on over the windows, nearly half of its area; there it has no data, up to half a window away.
    let bars = Bars {
        topology: Disk,
        to_surface: 1.5,
        to_scan: 100.0,
        bare: 0.5,
    };
    reaches("patches/neon_side_panel.off", &bars);
}

#[test]
fn an_aorta_is_a_network_with_five_openings() {
    let Some(path) = path("tubes/aorta2.stl") else {
        return;
    };
    let mut options = Options::default();
    options.surfacing.tolerance = Some(Length::OfDiagonal(5e-4));
    let outcome = fit(&path, &[], &options, &Silent).unwrap();
    assert_eq!(outcome.verdict, Verdict::Pass, "{}", outcome.reason);
    let model = &outcome.model;
    let mut uses = vec![0; model.edges().len()];
    for used in model
        .faces()
        .iter()
        .flat_map(|f| &f.loops)
        .flat_map(|l| &l.uses)
    {
        uses[used.edge] += 1;
    }
    assert!(uses.iter().all(|&n| n == 1 || n == 2));
    // V - E + F of a sphere with five openings.
    let [v, e, f] = [
        model.vertices().len(),
        model.edges().len(),
        model.faces().len(),
    ];
    assert_eq!(v + f + 3, e);
}

#[test]
fn what_no_single_surface_can_be_is_refused() {
    for (name, says) in [
        ("tubes/aorta2.stl", "5 openings"),
        ("pots/sea_vase.ply", "genus 1"),
    ] {
        let Some(path) = path(name) else { continue };
        let mut options = Options::default();
        options.surfacing.layout = FaceLayout::Single;
        let why = fit(&path, &[], &options, &Silent).unwrap_err();
        let why = why.to_string();
        assert!(why.contains(says) && why.contains(name), "{name}: {why}");
        assert!(why.contains("--layout network"), "{name}: {why}");
    }
}

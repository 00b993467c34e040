//! Mends of folds and self-intersections, and knots after them.

use super::*;
use crate::fit::mend::mended;
use crate::fit::state::Fit;
use crate::fit::state::release::LEAST_ON_BORDER;
use crate::fit::strategy::{relaxed, run};
use nurbskin_geometry::nurbs::SurfaceDerivatives;
use nurbskin_scan::mesh::manifold::NONE;

/// The parts of the faces of a network, `n` in each direction, in whose middle something is wrong.
fn parts_where(
    n: u32,
    network: &Fitted,
    is_wrong: impl Fn(&SurfaceDerivatives) -> bool,
) -> Vec<FacePart> {
    let mut parts = Vec::new();
    for (face, fitted) in (0..).zip(&network.faces) {
        for k in 0..n * n {
            let [u, v] = [k % n, k / n].map(|k| (f64::from(k) + 0.5) / f64::from(n));
            if is_wrong(&fitted.surface.derivatives(u, v)) {
                let [low, high] = [-0.02, 0.02].map(|d| [u + d, v + d]);
                parts.push(FacePart { face, low, high });
            }
        }
    }
    parts
}

/// Where the upper wall of [`dented`] has passed through the lower one.
fn below(network: &Fitted) -> Vec<FacePart> {
    parts_where(20, network, |at| {
        let p = at.point;
        let inside = 1.0 - p.x * p.x - p.y * p.y;
        at.du.cross(at.dv).z > 0.0 && inside > 0.5 && p.z < -0.3 * inside.sqrt()
    })
}

#[test]
fn a_wall_that_passes_through_another_lets_go_of_its_points() {
    // A flat ellipsoid with a dent that comes out below: no sound surface follows it.
    let dented = |p: DVec3| {
        let p = p.normalize();
        let r2 = p.x * p.x + p.y * p.y;
        let dent = if p.z > 0.0 {
            0.63 * (-r2 / 0.02).exp()
        } else {
            0.0
        };
        DVec3::new(p.x, p.y, 0.3 * p.z - dent)
    };
    let mesh = cube(24, dented);
    let normals: Vec<DVec3> = vertex_normals(&mesh);
    let target = target_of(&mesh, &normals, 0.0);
    let options = asking_for(2e-3, 1.0);
    let sharp = vec![false; 3 * mesh.triangles.len()];
    let mut producer = crate::layout::Producer::new(&mesh, &sharp).unwrap();
    let mut run = |inspect: &mut Inspect| {
        let mut sizes = FaceSizes::new(&mesh);
        let mut divide = |sizes: &[f64]| Ok(producer.layout(&LayoutOptions::coarse(), sizes));
        fit_adaptive(&target, &mut divide, &mut sizes, inspect, &options, &Silent).unwrap()
    };
    let plain = run(&mut |_| Ok(Vec::new()));
    assert!(!below(&plain).is_empty());
    let mut found = Vec::new();
    let mended = run(&mut |network| {
        let parts = below(network);
        found.push(parts.len());
        Ok(parts)
    });
    assert!(
        mended.defects.is_empty() && below(&mended).is_empty(),
        "{found:?}"
    );
    // The faces whose points stay away are known.
    assert!(!plain.lost.contains(&true));
    for (face, lost) in (0..).zip(&mended.lost) {
        let mut points = mended.feet.iter().zip(&mended.distances);
        let far = points.any(|(foot, d)| foot.face == face && *d > options.tolerance);
        assert!(far || !lost, "{face}");
    }
    assert!(mended.lost.contains(&true));
    // All other points are as close as before.
    let far = |network: &Fitted| {
        let off = mesh.points.iter().zip(&network.distances);
        let off = off.filter(|(p, d)| p.x.hypot(p.y) > 0.5 && **d > 2e-3);
        off.count()
    };
    assert!(
        far(&mended) <= far(&plain) + 5,
        "{} {}",
        far(&mended),
        far(&plain)
    );
    // Points around the dent were let go with it, and are taken back. Without that three of 272 stay beyond the tolerance.
    let near = |network: &Fitted| {
        let off = mesh.points.iter().zip(&network.distances);
        let off = off.filter(|(p, d)| (0.12..0.5).contains(&p.x.hypot(p.y)) && **d > 2e-3);
        off.count()
    };
    assert!(near(&mended) <= near(&plain) + 1, "{}", near(&mended));
    // The fit returns defects that it cannot mend.
    let part = FacePart {
        face: 0,
        low: [0.5; 2],
        high: [0.5; 2],
    };
    let left = run(&mut |_| Ok(vec![part]));
    assert_eq!(left.defects, [part]);
}

/// A ball with waves, and its normals.
fn wavy() -> (Manifold, Vec<DVec3>) {
    let wave = |p: DVec3| p.normalize() * (10.0 + 0.3 * (0.9 * p.x).sin() * (0.7 * p.y).cos());
    let mesh = cube(20, |p| wave(10.0 * p.normalize()));
    let normals = vertex_normals(&mesh);
    (mesh, normals)
}

/// A network of it without any knots, and the options of one that keeps its tolerance.
fn coarse<'a>(target: &Target<'a>) -> (Fit<'a>, FitOptions) {
    let options = asking_for(1e-3, 0.98);
    let no_knots = FitOptions {
        max_control_points: 0,
        ..options
    };
    let mut fit = relaxed(target, &smooth_layout(target.mesh), 1e-3, &Silent).unwrap();
    run(&mut fit, target, &no_knots).unwrap();
    (fit, options)
}

#[test]
fn a_sound_network_that_misses_the_tolerance_gets_knots() {
    let (mesh, normals) = wavy();
    let target = target_of(&mesh, &normals, 0.0);
    let (mut fit, options) = coarse(&target);
    let (count, beyond) = (fit.network.control_points(), fit.beyond(1e-3));
    assert!(beyond > 0.1, "{beyond}");
    let left = mended(&mut fit, &target, &mut |_| Ok(Vec::new()), &options).unwrap();
    assert!(left.defects.is_empty() && !left.lost.contains(&true));
    assert!(fit.network.control_points() > count);
    assert!(fit.beyond(1e-3) < 0.3 * beyond, "{}", fit.beyond(1e-3));
}

#[test]
fn knots_that_cause_a_defect_are_taken_back() {
    let (mesh, normals) = wavy();
    let target = target_of(&mesh, &normals, 0.0);
    let (mut fit, options) = coarse(&target);
    let size = |fitted: &Fitted| -> usize {
        let nets = fitted
            .faces
            .iter()
            .map(|face| face.surface.control_points().points().len());
        nets.sum()
    };
    let before = finished(&fit, Mended::default()).unwrap();
    let part = FacePart {
        face: 0,
        low: [0.0; 2],
        high: [1.0; 2],
    };
    let mut grown = 0;
    let mut inspect = |fitted: &Fitted| {
        let is_larger = size(fitted) > size(&before);
        grown += usize::from(is_larger);
        Ok(if is_larger { vec![part] } else { Vec::new() })
    };
    let left = mended(&mut fit, &target, &mut inspect, &options).unwrap();
    assert_eq!(grown, 1);
    assert!(left.defects.is_empty());
    let after = finished(&fit, left).unwrap();
    assert_eq!(size(&after), size(&before));
    assert_eq!(after.distances, before.distances);
}

/// Where a network of a flat sheet, seen from above, is turned over.
fn turned_over(network: &Fitted) -> Vec<FacePart> {
    parts_where(30, network, |at| at.du.cross(at.dv).z < 0.0)
}

#[test]
fn a_border_with_a_hooked_cleft_lets_go_of_its_points() {
    // The side of a face that goes around the hook doubles back, and the face folds.
    let n = 60_u32;
    let square = Mesh::lattice([n, n], [false; 2], |u, v| DVec3::new(u, v, 0.0));
    let hook = |p: DVec3| {
        let cleft = (p.x - 0.5).abs() < 0.02 && p.y < 0.2;
        cleft || (0.5..0.6).contains(&p.x) && (p.y - 0.18).abs() < 0.02
    };
    let cut = square.without(hook);
    let mesh = repair(&cut.points, &cut.triangles, &Silent)
        .unwrap()
        .manifold;
    let normals = vec![DVec3::Z; mesh.points.len()];
    let target = target_of(&mesh, &normals, 0.0);
    let options = asking_for(1e-3, 0.98);
    let mut fit = relaxed(&target, &smooth_layout(&mesh), 1e-3, &Silent).unwrap();
    run(&mut fit, &target, &options).unwrap();
    assert!(!turned_over(&finished(&fit, Mended::default()).unwrap()).is_empty());
    let mut counts = Vec::new();
    let mut inspect = |fitted: &Fitted| {
        let parts = turned_over(fitted);
        counts.push(parts.len());
        Ok(parts)
    };
    let left = mended(&mut fit, &target, &mut inspect, &options).unwrap();
    assert!(left.defects.is_empty(), "{counts:?}");
    // Few points end beyond the tolerance.
    assert!(fit.beyond(1e-3) < 0.01, "{}", fit.beyond(1e-3));
}

#[test]
fn points_of_a_border_keep_a_little_weight() {
    // A cube without its lid, whose border is open and whose edges are sharp.
    let cube = cube(12, |p| p);
    let open = repair(
        &cube.points,
        &(0..cube.triangles.len())
            .filter(|&t| cube.corners(t).iter().any(|p| p.z < 0.999))
            .map(|t| cube.triangles[t])
            .collect::<Vec<_>>(),
        &Silent,
    );
    let mesh = open.unwrap().manifold;
    let adjacency = mesh.adjacency();
    let normal = |t: usize| mesh.vector_area(t).normalize();
    let is_sharp = |side: usize| match adjacency.opposite[side] {
        NONE => false,
        o => normal(side / 3).dot(normal(o as usize / 3)) < 0.5,
    };
    let sharp: Vec<bool> = (0..3 * mesh.triangles.len()).map(is_sharp).collect();
    let layout = layout(&mesh, &sharp, &LayoutOptions::default()).unwrap();
    let normals = vertex_normals(&mesh);
    let target = target_of(&mesh, &normals, 0.0);
    let mut fit = relaxed(&target, &layout, 1e-3, &Silent).unwrap();
    let face = fit.lines.on_borders(&fit.network).next().unwrap().0.face;
    let part = FacePart {
        face,
        low: [0.0; 2],
        high: [1.0; 2],
    };
    for _ in 0..3 {
        fit.let_go(&[part], 0, [0.03, 1.0]);
    }
    let mut counts = [0; 2];
    for (foot, weight) in fit.lines.on_borders(&fit.network) {
        let expected = if foot.face == face {
            LEAST_ON_BORDER
        } else {
            1.0
        };
        assert_eq!(weight.to_bits(), expected.to_bits());
        counts[usize::from(foot.face == face)] += 1;
    }
    let on_borders: usize = counts.iter().sum();
    let light = fit.lines.weights.iter().filter(|w| **w < 1.0).count();
    assert!(counts[0] > 0 && light == counts[1] && fit.lines.weights.len() > on_borders);
}

use super::*;
use crate::samples::{block, disk_with_hole, solid_cylinder};
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::{NurbsSurface, conic};
use std::f64::consts::PI;

fn whole(surface: &NurbsSurface) -> FaceMass {
    let mut model = Model::new("");
    let face = model.add_whole_surface(surface, 1e-9).unwrap();
    face_mass(&model.faces()[face], DVec3::ZERO).unwrap()
}

fn close(one: f64, two: f64) {
    assert!((one - two).abs() <= 1e-10 * two.abs(), "{one} {two}");
}

#[test]
fn conics_have_their_area_and_volume() {
    let centre = DVec3::new(3.0, -2.0, 5.0);
    let axis = DVec3::new(1.0, 2.0, 2.0);
    let sphere = conic::sphere(centre, 2.0).unwrap();
    for surface in [
        sphere.clone(),
        sphere.transposed().reversed(Direction::U).unwrap(),
    ] {
        let mass = whole(&surface);
        close(mass.area, 16.0 * PI);
        close(mass.cone, 32.0 / 3.0 * PI);
        assert!(mass.centroid.distance(centre) < 1e-9);
        assert!((mass.cone_moment / mass.cone).distance(centre) < 1e-9);
    }
    close(whole(&sphere.transposed()).cone, -32.0 / 3.0 * PI);
    let torus = whole(&conic::torus(centre, axis, 3.0, 1.0).unwrap());
    close(torus.area, 12.0 * PI * PI);
    close(torus.cone, 6.0 * PI * PI);
    let cylinder = whole(&conic::cylinder(centre, axis, 2.0).unwrap());
    close(cylinder.area, 12.0 * PI);
    assert!(cylinder.centroid.distance(centre + axis / 2.0) < 1e-9);
    let cone = whole(&conic::cone(centre, axis, 4.0, 0.0).unwrap());
    close(cone.area, PI * 4.0 * 5.0);
    assert!(cone.centroid.distance(centre + axis / 3.0) < 1e-9);
}

#[test]
fn knots_and_turned_directions_change_nothing() {
    let torus = conic::torus(DVec3::X, DVec3::new(1.0, 1.0, 3.0), 3.0, 1.2).unwrap();
    let before = whole(&torus);
    let finer = torus
        .insert_knots(Direction::U, &[0.1, 0.3, 0.30001, 0.9])
        .and_then(|s| s.insert_knots(Direction::V, &[0.2, 0.6, 0.61]))
        .and_then(|s| s.elevate(Direction::U, 1))
        .unwrap();
    let after = whole(&finer);
    close(after.area, before.area);
    close(after.cone, before.cone);
    for direction in Direction::BOTH {
        let turned = whole(&torus.reversed(direction).unwrap());
        close(turned.area, before.area);
        close(turned.cone, -before.cone);
    }
}

#[test]
fn trimmed_faces_have_the_area_inside_their_loops() {
    let model = disk_with_hole([2.0, 1.0], [0.0, 0.5]);
    let mass = mass(&model).unwrap();
    close(mass.area, 3.0 * PI);
    // 4 pi at 0 less pi at 0.5.
    assert!(mass.centroid.distance(DVec3::new(-0.5 / 3.0, 0.0, 0.0)) < 1e-10);
    assert_eq!(mass.volume, None);
    // A hole that no knot line meets, and one that touches several; loops run the other way round.
    for inner in [0.1, 0.9, 1.4] {
        let model = disk_with_hole([2.0, inner], [0.0, 0.55]);
        let area = PI * (4.0 - inner * inner);
        close(face_mass(&model.faces()[0], DVec3::Z).unwrap().area, area);
        let mut face = model.faces()[0].clone();
        for each in &mut face.loops {
            each.uses.reverse();
            each.uses.iter_mut().for_each(|used| used.reversed ^= true);
        }
        let turned = face_mass(&face, DVec3::Z).unwrap();
        close(turned.area, area);
        // The apex is above the plane, which looks up.
        close(turned.cone, -area / 3.0);
    }
}

#[test]
fn solids_have_a_volume_and_a_centroid() {
    let block = block(DVec3::new(1.0, 2.0, 3.0));
    let mass = mass(&block).unwrap();
    close(mass.area, 22.0);
    close(mass.volume.unwrap(), 6.0);
    assert!(mass.centroid.distance(DVec3::new(0.5, 1.0, 1.5)) < 1e-12);
    assert!(
        mass.volume_centroid
            .unwrap()
            .distance(DVec3::new(0.5, 1.0, 1.5))
            < 1e-12
    );
    let cylinder = shell_mass(&solid_cylinder(), 0).unwrap();
    close(cylinder.area, 6.0 * PI);
    close(cylinder.volume.unwrap(), 2.0 * PI);
    assert!(cylinder.volume_centroid.unwrap().distance(DVec3::Z) < 1e-10);
    // Far away, little is lost.
    let far = block.map_points(|p| p + DVec3::splat(1e6)).unwrap();
    let far = super::mass(&far).unwrap();
    close(far.volume.unwrap(), 6.0);
}

#[test]
fn a_freeform_surface_agrees_with_a_fine_sum() {
    use nurbskin_geometry::nurbs::{ControlNet, KnotVector};
    let knots = KnotVector::uniform(3, 7).unwrap();
    let net = ControlNet::from_fn(7, 7, |i, j| {
        let (x, y) = (i as f64, j as f64);
        DVec3::new(x, y, (1.3 * x).sin() + (0.9 * y).cos() * x / 3.0)
    });
    let surface = NurbsSurface::new(knots.clone(), knots, net.unwrap(), None).unwrap();
    let mass = whole(&surface);
    // The midpoint rule, extrapolated twice.
    let sum = |n: u32| {
        let at = |k: u32| (f64::from(k) + 0.5) / f64::from(n);
        let mut area = 0.0;
        for j in 0..n {
            for i in 0..n {
                let d = surface.derivatives(at(i), at(j));
                area += d.du.cross(d.dv).length();
            }
        }
        area / f64::from(n * n)
    };
    let (a, b, c) = (sum(32), sum(64), sum(128));
    let (ab, bc) = (b + (b - a) / 3.0, c + (c - b) / 3.0);
    let fine = bc + (bc - ab) / 15.0;
    assert!(
        (mass.area - fine).abs() < 1e-7 * fine,
        "{} {fine}",
        mass.area
    );
}

use super::*;
use crate::samples::disk_with_hole;
use crate::{Face, Model};
use glam::DVec3;
use nurbskin_geometry::nurbs::conic;

#[test]
fn a_disk_with_a_hole_contains_its_ring() {
    let model = disk_with_hole([2.0, 1.0], [3.0, 0.5]);
    let region = Region::new(&model.faces()[0]).unwrap();
    // Centre (0, 0), radius 2; hole at (0.5, 0), radius 1: in (u, v) = (x + 5, y + 5) / 10 of the plane.
    let place = |x: f64, y: f64| DVec2::new(x + 5.0, y + 5.0) / 10.0;
    let mut rng = 1_u64;
    let mut random = || {
        rng = rng.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (rng >> 11) as f64 / (1_u64 << 53) as f64
    };
    for _ in 0..4000 {
        let (x, y) = (6.0 * random() - 3.0, 6.0 * random() - 3.0);
        let [outer, inner] = [2.0 - x.hypot(y), (x - 0.5).hypot(y) - 1.0];
        let p = place(x, y);
        assert_eq!(region.contains(p), outer > 0.0 && inner > 0.0, "{x} {y}");
        // The nearest place: distances of circles are known.
        let expected = outer.abs().min(inner.abs());
        let near = region.nearest(p);
        assert!(
            (near.distance - expected).abs() < 1e-9,
            "{near:?} {expected}"
        );
        let used = &model.faces()[0].loops[near.loop_index].uses[near.use_index];
        let on = used.pcurve.point(near.parameter).truncate();
        assert!(on.distance(near.place) < 1e-12);
    }
    // A hair inside and outside.
    for k in 0..100 {
        let (sin, cos) = f64::from(k).sin_cos();
        assert!(region.contains(place((2.0 - 1e-12) * cos, (2.0 - 1e-12) * sin)));
        assert!(!region.contains(place((2.0 + 1e-12) * cos, (2.0 + 1e-12) * sin)));
    }
    let pi = std::f64::consts::PI;
    assert!((region.signed_area(0) - 0.04 * pi).abs() < 1e-14);
    assert!((region.signed_area(1) + 0.01 * pi).abs() < 1e-14);
    assert!((region.scale() - DVec2::splat(10.0)).length() < 1e-12);
    let cover = |a: f64, b: f64, c: f64, d: f64| region.cover(place(a, b), place(c, d));
    assert_eq!(cover(-1.4, -0.2, -0.6, 0.2), Cover::Inside);
    assert_eq!(cover(0.2, -0.2, 0.6, 0.2), Cover::Outside);
    assert_eq!(cover(1.5, 1.5, 1.9, 1.9), Cover::Outside);
    assert_eq!(cover(1.3, 1.3, 1.9, 1.9), Cover::Border);
    assert_eq!(cover(-3.0, -3.0, 3.0, 3.0), Cover::Border);
}

#[test]
fn whole_surfaces_contain_their_domain() {
    let mut model = Model::new("");
    let torus = conic::torus(DVec3::ZERO, DVec3::Z, 3.0, 1.0).unwrap();
    let face = model.add_whole_surface(&torus, 1e-9).unwrap();
    let region = Region::new(&model.faces()[face]).unwrap();
    for k in 0..=50 {
        for l in 0..=50 {
            let p = DVec2::new(f64::from(k), f64::from(l)) / 40.0 - 0.125 + 1e-9;
            let inside = p.cmpgt(DVec2::ZERO).all() && p.cmplt(DVec2::ONE).all();
            assert_eq!(region.contains(p), inside, "{p}");
        }
    }
    assert_eq!(region.bounding_rectangle(), [DVec2::ZERO, DVec2::ONE]);
    let empty = Face {
        loops: Vec::new(),
        ..model.faces()[face].clone()
    };
    assert!(Region::new(&empty).is_err());
}

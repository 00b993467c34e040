use super::*;
use crate::samples::{block, disk_with_hole, solid_cylinder};
use nurbskin_geometry::nurbs::{ControlNet, KnotVector, NurbsSurface, conic};

fn whole(surface: &NurbsSurface) -> Model {
    let mut model = Model::new("");
    model.add_whole_surface(surface, 1e-9).unwrap();
    model
}

fn check(model: &Model, low: DVec3, high: DVec3) {
    let found = extent(model).unwrap();
    let slack = 1.1e-9 * high.distance(low);
    assert!(found.gap <= slack, "{found:?}");
    assert!(found.low.distance(low) < slack, "{found:?} {low}");
    assert!(found.high.distance(high) < slack, "{found:?} {high}");
}

#[test]
fn conics_in_any_position() {
    let centre = DVec3::new(3.0, -2.0, 5.0);
    let axis = DVec3::new(1.0, 2.0, 2.0) / 3.0;
    let two = DVec3::splat(2.0);
    let sphere = conic::sphere(centre, 2.0).unwrap();
    check(&whole(&sphere), centre - two, centre + two);
    // A circle of radius r about an axis reaches r sqrt(1 - a^2) along each coordinate.
    let reach = (DVec3::ONE - axis * axis).map(f64::sqrt);
    let torus = conic::torus(centre, axis, 3.0, 1.0).unwrap();
    let half = 3.0 * reach + DVec3::ONE;
    check(&whole(&torus), centre - half, centre + half);
    let cylinder = conic::cylinder(centre, 3.0 * axis, 1.0).unwrap();
    check(
        &whole(&cylinder),
        centre - reach,
        centre + 3.0 * axis + reach,
    );
    for axis in DVec3::AXES {
        let torus = conic::torus(centre, axis, 3.0, 1.0).unwrap();
        let half = DVec3::splat(4.0) - 3.0 * axis;
        check(&whole(&torus), centre - half, centre + half);
    }
}

#[test]
fn trimmed_faces_and_solids() {
    let round = DVec3::new(2.0, 2.0, 0.0);
    check(&disk_with_hole([2.0, 1.0], [0.0, 0.5]), -round, round);
    check(
        &solid_cylinder(),
        DVec3::new(-1.0, -1.0, 0.0),
        DVec3::new(1.0, 1.0, 2.0),
    );
    let size = DVec3::new(1.0, 2.0, 3.0);
    check(&block(size), DVec3::ZERO, size);
    // A bump of height 1 in the hole of the disk does not count, one on the ring does.
    for (x, counts) in [(0.5, false), (-1.5, true)] {
        let model = disk_with_hole([2.0, 1.0], [0.0, 0.5]);
        let mut raised = Model::new("");
        model
            .vertices()
            .iter()
            .for_each(|&p| _ = raised.add_vertex(p).unwrap());
        for edge in model.edges() {
            let curve = edge.curve.as_ref().unwrap();
            raised.add_edge(curve, edge.start, edge.end).unwrap();
        }
        let knots = KnotVector::uniform(3, 43).unwrap();
        let at = knots.greville();
        let net = ControlNet::from_fn(43, 43, |i, j| {
            let p = DVec3::new(10.0 * at[i] - 5.0, 10.0 * at[j] - 5.0, 0.0);
            let near = (p.x - x).hypot(p.y) < 0.3;
            p + if near { DVec3::Z } else { DVec3::ZERO }
        });
        let surface = NurbsSurface::new(knots.clone(), knots, net.unwrap(), None).unwrap();
        let face = Face {
            surface: surface.clone(),
            ..model.faces()[0].clone()
        };
        raised.add_face(face).unwrap();
        let top = extent(&raised).unwrap().high.z;
        if counts {
            // The top of the bump by a fine grid.
            let mut best = 0.0_f64;
            for k in 0..=400 {
                for l in 0..=400 {
                    let (u, v) = (0.3 + f64::from(k) / 4000.0, 0.45 + f64::from(l) / 4000.0);
                    best = best.max(surface.point(u, v).z);
                }
            }
            assert!(top >= best - 1e-9 && top < best + 1e-3, "{top} {best}");
        } else {
            assert!(top.abs() < 1e-9, "{top}");
        }
    }
}

#[test]
fn creases_count() {
    // A roof: the ridge is a double knot of degree 2, nowhere critical.
    let knots_u = KnotVector::new(2, vec![0., 0., 0., 0.5, 0.5, 1., 1., 1.]).unwrap();
    let knots_v = KnotVector::uniform(2, 3).unwrap();
    let net = ControlNet::from_fn(5, 3, |i, j| {
        let x = i as f64 - 2.0;
        let y = j as f64 - 1.0;
        DVec3::new(x, y, 2.0 - x.abs() - 0.5 * y * y)
    });
    let surface = NurbsSurface::new(knots_u, knots_v, net.unwrap(), None).unwrap();
    let ridge = surface.point(0.5, 0.5).z;
    let found = extent(&whole(&surface)).unwrap();
    assert!((found.high.z - ridge).abs() < 1e-9, "{found:?} {ridge}");
}

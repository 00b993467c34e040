//! STEP files read back by a reader that has nothing in common with the writer.

use super::step::{whole, with_hole};
use super::{sphere, tube, wavy};
use nurbskin::cad::Model;
use nurbskin::io::step::{self, Schema, Validation, WriteOptions};
use nurbskin::nurbs::conic;
use nurbskin::{DVec3, NurbsSurface, Unit};

fn text_of(model: &Model, schema: Schema) -> Vec<u8> {
    let mut bytes = Vec::new();
    let options = WriteOptions {
        schema,
        validation: Some(Validation {
            area: 2.0,
            volume: None,
            centroid: DVec3::X,
        }),
        ..Default::default()
    };
    step::write(&mut bytes, model, &options).unwrap();
    bytes
}

/// Knots along u and v, then w, x, y, z of all control points, u by u: every bit.
fn numbers(surface: &NurbsSurface) -> Vec<u64> {
    let [m, n] = surface.control_points().counts();
    let knots = [surface.knots_u(), surface.knots_v()];
    let mut all: Vec<f64> = knots.iter().flat_map(|k| k.knots()).copied().collect();
    for (i, j) in (0..m).flat_map(|i| (0..n).map(move |j| (i, j))) {
        all.push(surface.weights().map_or(1.0, |w| w[j * m + i]));
        all.extend(surface.control_points().point(i, j).to_array());
    }
    all.into_iter().map(f64::to_bits).collect()
}

#[test]
fn step_io_reads_the_same_model() {
    let cone = conic::cone(DVec3::ONE, DVec3::X, 2.0, 0.0).unwrap();
    let torus = conic::torus(DVec3::ONE, DVec3::X, 3.0, 1.0).unwrap();
    let wholes = [wavy(3, 2, 7, 8), tube(6, 9), sphere(), cone, torus];
    let mut models: Vec<Model> = wholes.iter().map(whole).collect();
    models.extend([with_hole(false), with_hole(true)]);
    models[0].unit = Unit::Inch;
    models[1].unit = Unit::Metre;
    for (model, schema) in models
        .iter()
        .flat_map(|model| [(model, Schema::Ap214), (model, Schema::Ap242)])
    {
        let bytes = text_of(model, schema);
        let (read, report) = step_io::read(bytes.as_slice()).unwrap();
        assert!(report.dropped.is_empty(), "{:?}", report.dropped);
        assert!(report.normalized.is_empty() && report.parse_warnings.is_empty());
        let scene = read.scene();
        let length = scene.units().length.unwrap();
        let metres = model.unit.millimetres() / 1000.0;
        assert!((length.to_si - metres).abs() < 1e-15, "{length:?}");
        let solids = model
            .shells()
            .iter()
            .filter(|s| s.kind == nurbskin::cad::ShellKind::Solid);
        assert_eq!(scene.all_solids().count(), solids.count());
        assert_eq!(scene.all_faces().count(), model.faces().len());
        for (found, face) in scene.all_faces().zip(model.faces()) {
            assert_eq!(found.name(), face.name);
            assert_eq!(found.bounds().count(), face.loops.len());
            for (bound, each) in found.bounds().zip(&face.loops) {
                let edges = each.uses.iter().map(|used| &model.edges()[used.edge]);
                let real = edges.filter(|edge| edge.curve.is_some()).count();
                assert_eq!(bound.edges().count(), real);
            }
            let surface = found.to_nurbs().unwrap();
            let mut all = surface.knots_u;
            all.extend(surface.knots_v);
            let weights = surface.weights.iter().flatten();
            for (w, p) in weights.zip(surface.control_points.iter().flatten()) {
                all.push(*w);
                all.extend(p);
            }
            let all: Vec<u64> = all.into_iter().map(f64::to_bits).collect();
            assert_eq!(all, numbers(&face.surface));
        }
    }
}

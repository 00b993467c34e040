//! What is written as CAD reads back to the last bit.

use crate::io::file::CadFile;
use crate::io::{iges, step};
use crate::samples::{block, disk_with_hole, solid_cylinder};
use crate::{Face, Loop, Model};
use glam::DVec3;
use nurbskin_geometry::nurbs::{NurbsCurve, conic};

fn through_iges(model: &Model) -> CadFile {
    let mut bytes = Vec::new();
    let content = iges::IgesContent {
        model: Some(model),
        ..Default::default()
    };
    iges::write(&mut bytes, &content, &iges::WriteOptions::default()).unwrap();
    iges::read_cad(&bytes, "part.igs").unwrap()
}

fn through_step(model: &Model) -> CadFile {
    let mut bytes = Vec::new();
    step::write(&mut bytes, model, &step::WriteOptions::default()).unwrap();
    step::read(&bytes, "part.step").unwrap()
}

/// The p-curves and curves of a loop, each run as the loop runs.
fn runs(model: &Model, each: &Loop) -> Vec<(NurbsCurve, Option<NurbsCurve>)> {
    let run = |curve: &NurbsCurve, back: bool| {
        // Equal weights are none.
        let equal = curve
            .weights()
            .is_some_and(|w| w.iter().all(|x| x.to_bits() == w[0].to_bits()));
        let weights = curve.weights().filter(|_| !equal).map(<[f64]>::to_vec);
        let points = curve.control_points().to_vec();
        let curve = NurbsCurve::new(curve.knots().clone(), points, weights).unwrap();
        if back {
            curve.reversed().unwrap()
        } else {
            curve
        }
    };
    let uses = each.uses.iter().map(|used| {
        let curve = model.edges()[used.edge].curve.as_ref();
        (
            run(&used.pcurve, used.reversed),
            curve.map(|c| run(c, used.reversed)),
        )
    });
    uses.collect()
}

/// A face as IGES has it, where the sense is that of the surface.
fn with_its_surface(model: &Model, face: &Face) -> Vec<Vec<(NurbsCurve, Option<NurbsCurve>)>> {
    let turn = |mut pairs: Vec<(NurbsCurve, Option<NurbsCurve>)>| {
        pairs.reverse();
        let swap = |p: DVec3| DVec3::new(p.y, p.x, 0.0);
        for (pcurve, curve) in &mut pairs {
            *pcurve = pcurve.reversed().unwrap().map_points(swap).unwrap();
            *curve = curve.as_ref().map(|c| c.reversed().unwrap());
        }
        pairs
    };
    let loops = face.loops.iter().map(|each| runs(model, each));
    if face.reversed {
        loops.map(turn).collect()
    } else {
        loops.collect()
    }
}

/// On one line for each curve.
fn text<T: std::fmt::Debug>(all: &[T]) -> String {
    let lines: Vec<String> = all.iter().map(|each| format!("  {each:?}")).collect();
    lines.join("\n")
}

fn same_loops<T: PartialEq + std::fmt::Debug>(one: &[Vec<T>], two: &[Vec<T>], what: &str) {
    assert_eq!(one.len(), two.len(), "{what}");
    for (one, two) in one.iter().zip(two) {
        // A loop may begin anywhere.
        let same = (0..two.len().max(1)).any(|k| {
            let mut two: Vec<&T> = two.iter().collect();
            let count = two.len();
            two.rotate_left(k.min(count));
            one.iter().collect::<Vec<_>>() == two
        });
        assert!(same, "{what}: {}\n{}", text(one), text(two));
    }
}

#[test]
fn trimmed_faces_read_back_to_the_last_bit() {
    let disk = disk_with_hole([2.0, 1.0], [0.25, 0.5]);
    // Control points of curves and surface moved each on its own: they agree within a tolerance only.
    let wavy = |p: DVec3| p + 2e-8 * DVec3::new(p.y.sin(), p.x.cos(), (3.0 * p.x + p.y).sin());
    let models = [
        ("disk", disk.clone()),
        ("wavy", disk.map_points(wavy).unwrap()),
        ("block", block(DVec3::new(1.0, 2.0, 3.0))),
        ("cylinder", solid_cylinder()),
    ];
    for (name, model) in models {
        for (format, file) in [
            ("iges", through_iges(&model)),
            ("step", through_step(&model)),
        ] {
            let what = format!("{name} {format}");
            assert_eq!(file.warnings, Vec::<String>::new(), "{what}");
            assert!(file.unread.is_empty(), "{what}");
            let back = &file.model;
            assert_eq!(back.faces().len(), model.faces().len(), "{what}");
            for face in model.faces() {
                let iges = format == "iges";
                let (surface, loops) = if iges && face.reversed {
                    (face.surface.transposed(), with_its_surface(&model, face))
                } else {
                    let loops = face.loops.iter().map(|each| runs(&model, each));
                    (face.surface.clone(), loops.collect())
                };
                // The faces of an IGES file are read by kind.
                let again = back.faces().iter().find(|f| f.surface == surface);
                let again = again.unwrap_or_else(|| panic!("{what}: {surface:?}"));
                assert_eq!(again.reversed, face.reversed && !iges, "{what}");
                assert_eq!(again.trimmed, face.trimmed, "{what}");
                if face.trimmed || !iges {
                    let found: Vec<_> = again.loops.iter().map(|each| runs(back, each)).collect();
                    same_loops(&loops, &found, &what);
                }
            }
        }
    }
}

#[test]
fn bare_surfaces_read_back_to_the_last_bit() {
    let surfaces = [
        crate::samples::square(3, 6),
        conic::torus(DVec3::X, DVec3::Z, 3.0, 1.0).unwrap(),
        conic::sphere(DVec3::Y, 2.0).unwrap(),
    ];
    for surface in surfaces {
        let mut model = Model::new("bare");
        let face = model.add_whole_surface(&surface, 1e-9).unwrap();
        model.add_shell_of(face).unwrap();
        for file in [through_iges(&model), through_step(&model)] {
            let found: Vec<_> = file
                .model
                .faces()
                .iter()
                .map(|f| f.surface.clone())
                .collect();
            assert_eq!(found, std::slice::from_ref(&surface));
            assert!(file.model.faces().iter().all(|face| !face.trimmed));
        }
    }
}

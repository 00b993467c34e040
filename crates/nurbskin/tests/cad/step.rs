//! STEP files that are written: what they say, instance by instance, found by a reader of a few lines.

use super::{sphere, surface, tube, wavy};
use nurbskin::cad::{EdgeUse, Face, Loop, Model, SurfaceKind};
use nurbskin::io::step::{self, Schema, Validation, WriteOptions};
use nurbskin::nurbs::{NurbsCurve, conic};
use nurbskin::{DVec3, KnotVector, NurbsSurface, Unit};
use std::collections::BTreeMap;

/// The instances of a file by their number: what stands between `=` and `;`.
fn instances(text: &str) -> BTreeMap<usize, String> {
    let data = text.split_once("\nDATA;\n").unwrap().1;
    let data = data.split_once("ENDSEC;\nEND-ISO-10303-21;\n").unwrap();
    assert_eq!(data.1, "");
    let mut all = BTreeMap::new();
    for record in data.0.split_terminator(";\n") {
        let (name, body) = record.split_once('=').unwrap();
        let number = name.strip_prefix('#').unwrap().parse().unwrap();
        assert!(all.insert(number, body.replace('\n', "")).is_none());
    }
    all
}

/// The instances that a record refers to; its strings left aside.
fn references(body: &str) -> Vec<usize> {
    let plain: String = body.split('\'').step_by(2).collect();
    let parts = plain.split('#').skip(1);
    parts
        .map(|part| {
            let end = part.find(|c: char| !c.is_ascii_digit());
            part[..end.unwrap_or(part.len())].parse().unwrap()
        })
        .collect()
}

/// The records that begin with this name.
fn named<'a>(all: &'a BTreeMap<usize, String>, name: &str) -> Vec<&'a str> {
    let begins = format!("{name}(");
    let found = all.values().filter(|body| body.starts_with(&begins));
    found.map(String::as_str).collect()
}

fn text_of(model: &Model, options: &WriteOptions<'_>) -> String {
    let mut bytes = Vec::new();
    let written = step::write(&mut bytes, model, options).unwrap();
    assert_eq!(written.bytes, bytes.len());
    let text = String::from_utf8(bytes).unwrap();
    assert_eq!(written.lines, text.lines().count());
    assert!(text.is_ascii() && text.starts_with("ISO-10303-21;\nHEADER;\n"));
    // All references lead backwards to an instance: a reader needs one pass, and nothing runs in circles.
    for (number, body) in instances(&text) {
        assert!(references(&body).iter().all(|&r| r < number), "{body}");
    }
    text
}

fn written(model: &Model) -> BTreeMap<usize, String> {
    instances(&text_of(model, &WriteOptions::default()))
}

pub(super) fn whole(surface: &NurbsSurface) -> Model {
    let mut model = Model::new("part");
    let face = model.add_whole_surface(surface, 1e-9).unwrap();
    model.add_shell_of(face).unwrap();
    model
}

/// The numbers of the 3-D points of a list of references.
fn points(all: &BTreeMap<usize, String>, body: &str) -> Vec<DVec3> {
    let of = |number: usize| {
        let body = all[&number].strip_prefix("CARTESIAN_POINT('',(")?;
        let numbers = body.trim_end_matches("))").split(',');
        let c: Vec<f64> = numbers.map(|x| x.parse().unwrap()).collect();
        (c.len() == 3).then(|| DVec3::from_slice(&c))
    };
    references(body).into_iter().filter_map(of).collect()
}

#[test]
fn step_has_a_product_units_and_an_uncertainty() {
    let all = written(&whole(&wavy(3, 2, 7, 8)));
    for name in [
        "APPLICATION_CONTEXT",
        "APPLICATION_PROTOCOL_DEFINITION",
        "PRODUCT_CONTEXT",
        "PRODUCT",
        "PRODUCT_RELATED_PRODUCT_CATEGORY",
        "PRODUCT_DEFINITION_FORMATION",
        "PRODUCT_DEFINITION_CONTEXT",
        "PRODUCT_DEFINITION",
        "PRODUCT_DEFINITION_SHAPE",
        "SHAPE_DEFINITION_REPRESENTATION",
        "MANIFOLD_SURFACE_SHAPE_REPRESENTATION",
        "SHELL_BASED_SURFACE_MODEL",
        "OPEN_SHELL",
        "ADVANCED_FACE",
        "FACE_OUTER_BOUND",
        "B_SPLINE_SURFACE_WITH_KNOTS",
        "UNCERTAINTY_MEASURE_WITH_UNIT",
    ] {
        assert_eq!(named(&all, name).len(), 1, "{name}");
    }
    assert_eq!(named(&all, "EDGE_CURVE").len(), 4);
    assert_eq!(named(&all, "VERTEX_POINT").len(), 4);
    assert_eq!(named(&all, "DEFINITIONAL_REPRESENTATION").len(), 4);
    let mut model = whole(&wavy(3, 2, 7, 8));
    for (unit, spelled) in [
        (Unit::Millimetre, "SI_UNIT(.MILLI.,.METRE.))"),
        (Unit::Centimetre, "SI_UNIT(.CENTI.,.METRE.))"),
        (Unit::Metre, "SI_UNIT($,.METRE.))"),
        (Unit::Micrometre, "SI_UNIT(.MICRO.,.METRE.))"),
        (Unit::Inch, "LENGTH_MEASURE(25.4),"),
        (Unit::Foot, "LENGTH_MEASURE(304.8),"),
    ] {
        model.unit = unit;
        let text = text_of(&model, &WriteOptions::default());
        assert!(text.contains(spelled), "{unit}");
        assert!(text.contains("SI_UNIT($,.RADIAN.)") && text.contains("SI_UNIT($,.STERADIAN.)"));
        // 6.3 x 4.9 x 2: the power of ten below 1e-7 of that.
        assert!(text.contains("LENGTH_MEASURE(1.E-7)"));
    }
    let none = step::write(&mut Vec::new(), &Model::new(""), &WriteOptions::default());
    assert!(none.unwrap_err().to_string().contains("nothing to write"));
    let far = WriteOptions {
        origin: DVec3::splat(f64::MAX),
        uncertainty: Some(0.0),
        ..Default::default()
    };
    assert!(step::write(&mut Vec::new(), &model, &far).is_err());
}

#[test]
fn step_returns_every_bit() {
    let extremes = [
        5e-324,
        -2.2e-308,
        1e300,
        -1e300,
        -0.0,
        0.0,
        0.1,
        1.0 / 3.0,
        1e15,
        1e16,
    ];
    let knots = KnotVector::new(2, vec![0., 0., 0., 0.1, 1. / 3., 1. / 3., 1., 1., 1.]).unwrap();
    let sheet = surface(
        knots.clone(),
        knots.clone(),
        |i, j| DVec3::new(extremes[i], extremes[4 + j], extremes[(i + j) % 10]),
        Some((0..36).map(|k| 1e-3 * f64::from(k + 1) / 7.0).collect()),
    );
    let mut model = Model::new("");
    model.add_whole_surface(&sheet, 0.0).unwrap();
    let all = written(&model);
    let body = all
        .values()
        .find(|body| body.starts_with("(BOUNDED_SURFACE()"))
        .unwrap();
    // All names of the complex instance, in alphabetical order.
    let names: Vec<&str> = body[1..body.len() - 1]
        .split(|c: char| !(c.is_ascii_uppercase() || c == '_'))
        .filter(|name| name.len() > 4 && *name != "UNSPECIFIED")
        .collect();
    let wanted = [
        "BOUNDED_SURFACE",
        "B_SPLINE_SURFACE",
        "B_SPLINE_SURFACE_WITH_KNOTS",
        "GEOMETRIC_REPRESENTATION_ITEM",
        "RATIONAL_B_SPLINE_SURFACE",
        "REPRESENTATION_ITEM",
        "SURFACE",
    ];
    assert_eq!(names, wanted);
    assert!(names.is_sorted());
    let bits = |p: &DVec3| p.to_array().map(f64::to_bits);
    // Along v first, then along u: the other way round than IGES.
    let net = sheet.transposed();
    let poles: Vec<_> = net.control_points().points().iter().map(bits).collect();
    assert_eq!(
        points(&all, body).iter().map(bits).collect::<Vec<_>>(),
        poles
    );
    assert!(body.contains("(3,1,2,3),(3,1,2,3),(0.,0.1,0.3333333333333333,1.),"));
    let weights = body.split_once("RATIONAL_B_SPLINE_SURFACE(").unwrap().1;
    let weights = weights.split_once("))").unwrap().0.replace(['(', ')'], "");
    let weights: Vec<f64> = weights.split(',').map(|w| w.parse().unwrap()).collect();
    assert_eq!(weights, net.weights().unwrap());
}

#[test]
fn seams_poles_and_closure_are_true() {
    // name, model, edges, seams, oriented edges, "closed" in u and v
    let cone = conic::cone(DVec3::ONE, DVec3::X, 2.0, 0.0).unwrap();
    let torus = conic::torus(DVec3::ONE, DVec3::X, 3.0, 1.0).unwrap();
    for (surface, edges, seams, oriented, closed, solid) in [
        (sphere(), 1, 1, 2, ".T.,.F.", true),
        (sphere().transposed(), 1, 1, 2, ".F.,.T.", true),
        (torus, 2, 2, 4, ".T.,.T.", true),
        (cone, 2, 1, 3, ".T.,.F.", false),
        (tube(6, 9), 3, 1, 4, ".F.,.T.", false),
    ] {
        let all = written(&whole(&surface));
        assert_eq!(named(&all, "EDGE_CURVE").len(), edges);
        let found = named(&all, "SEAM_CURVE");
        assert_eq!(found.len(), seams);
        for seam in found {
            // All four attributes: name, curve, both p-curves, which of them is master.
            assert_eq!(references(seam).len(), 3);
            assert!(seam.ends_with("),.CURVE_3D.)"), "{seam}");
        }
        assert_eq!(named(&all, "SURFACE_CURVE").len(), edges - seams);
        assert_eq!(named(&all, "ORIENTED_EDGE").len(), oriented);
        let flags = format!(",.UNSPECIFIED.,{closed},.F.");
        let is_surface = |body: &&String| body.contains("B_SPLINE_SURFACE");
        assert!(all.values().find(is_surface).unwrap().contains(&flags));
        assert_eq!(named(&all, "MANIFOLD_SOLID_BREP").len(), usize::from(solid));
        assert_eq!(named(&all, "CLOSED_SHELL").len(), usize::from(solid));
        // Clamped and not periodic: the end knots have multiplicity p + 1, and no knot is there twice.
        let text = text_of(&whole(&surface), &WriteOptions::default());
        assert!(!text.contains("/*") && !text.contains("PERIODIC"));
    }
}

/// A square with a hole, as seen from the front or from behind.
pub(super) fn with_hole(reversed: bool) -> Model {
    let knots = KnotVector::clamped(1, &[0.0, 4.0]).unwrap();
    let square = surface(
        knots.clone(),
        knots,
        |i, j| DVec3::new(4.0 * i as f64, 4.0 * j as f64, 0.0),
        None,
    );
    let mut model = Model::new("plate");
    let outer = model.whole_loop_of(&square);
    let circle = conic::circle(DVec3::new(2.0, 2.0, 0.0), DVec3::Z, 1.0).unwrap();
    let start = model.add_vertex(circle.control_points()[0]).unwrap();
    let edge = model.add_edge(&circle, start, start).unwrap();
    let hole = EdgeUse {
        edge,
        reversed: true,
        pcurve: circle,
    };
    let face = Face {
        surface: square,
        kind: SurfaceKind::Plane,
        reversed,
        loops: vec![outer, Loop { uses: vec![hole] }],
        trimmed: true,
        name: "the 'plate' µ".into(),
    };
    model.add_face(face).unwrap();
    model
}

trait WholeLoop {
    fn whole_loop_of(&mut self, surface: &NurbsSurface) -> Loop;
}

impl WholeLoop for Model {
    /// The border of a bilinear square, made by hand.
    fn whole_loop_of(&mut self, surface: &NurbsSurface) -> Loop {
        let net = surface.control_points();
        let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| net.point(i, j));
        let first = self.vertices().len();
        for corner in corners {
            self.add_vertex(corner).unwrap();
        }
        let uses = (0..4).map(|k| {
            let next = (k + 1) % 4;
            let knots = KnotVector::clamped(1, &[0.0, 1.0]).unwrap();
            let line = NurbsCurve::new(knots, vec![corners[k], corners[next]], None).unwrap();
            let edge = self.add_edge(&line, first + k, first + next).unwrap();
            EdgeUse {
                edge,
                reversed: false,
                pcurve: line,
            }
        });
        Loop {
            uses: uses.collect(),
        }
    }
}

#[test]
fn loops_run_to_the_left_of_the_outward_normal() {
    for reversed in [false, true] {
        let all = written(&with_hole(reversed));
        let face = named(&all, "ADVANCED_FACE")[0];
        assert!(face.starts_with(r"ADVANCED_FACE('the ''plate'' \X2\00B5\X0\',("));
        assert!(face.ends_with(if reversed { ",.F.)" } else { ",.T.)" }));
        assert_eq!(named(&all, "FACE_OUTER_BOUND").len(), 1);
        assert_eq!(named(&all, "FACE_BOUND").len(), 1);
        let uses = named(&all, "ORIENTED_EDGE");
        let forwards: Vec<bool> = uses.iter().map(|u| u.ends_with(",.T.)")).collect();
        let outer = !reversed;
        assert_eq!(forwards, [outer, outer, outer, outer, !outer]);
        // Each edge begins where the one before it ends.
        let path = references(named(&all, "EDGE_LOOP")[0]);
        let ends = |oriented: usize| {
            let edge = references(&all[&oriented])[0];
            let [start, end] = [0, 1].map(|k| references(&all[&edge])[k]);
            if outer { [start, end] } else { [end, start] }
        };
        for k in 0..4 {
            assert_eq!(ends(path[k])[1], ends(path[(k + 1) % 4])[0]);
        }
        // The circle is rational in both its curves.
        let is_circle = |body: &&String| body.contains("RATIONAL_B_SPLINE_CURVE((1.,0.7");
        assert_eq!(all.values().filter(is_circle).count(), 2);
    }
}

#[test]
fn colour_names_points_and_validation_properties() {
    let mut model = whole(&sphere());
    let sheet = model.add_whole_surface(&wavy(2, 2, 4, 4), 1e-9).unwrap();
    assert_eq!(sheet, 1); // in no shell: an open one of its own
    model.colour = Some([255, 0, 51]);
    let scan = [DVec3::new(0.5, 0.25, -7.0), DVec3::ZERO];
    let options = WriteOptions {
        schema: Schema::Ap242,
        product: "Büste".into(),
        file_name: "a'b.step".into(),
        points: &scan,
        origin: DVec3::new(1e6, 0.0, 0.0),
        validation: Some(Validation {
            area: 314.5,
            volume: Some(523.25),
            centroid: DVec3::new(1.0, 2.0, 3.0),
        }),
        ..Default::default()
    };
    let text = text_of(&model, &options);
    assert_eq!(text, text_of(&model, &options));
    assert!(text.contains("FILE_NAME('a''b.step','2000-01-01T00:00:00',"));
    assert!(text.contains("AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 "));
    let all = instances(&text);
    assert!(named(&all, "PRODUCT")[0].starts_with(r"PRODUCT('B\X2\00FC\X0\ste',"));
    assert!(named(&all, "COLOUR_RGB")[0].ends_with(",1.,0.,0.2)"));
    assert_eq!(named(&all, "STYLED_ITEM").len(), 2);
    assert!(text.contains("AREA_MEASURE(314.5)") && text.contains("VOLUME_MEASURE(523.25)"));
    assert!(text.contains("CARTESIAN_POINT('centre point',(1000001.,2.,3.))"));
    assert!(text.contains("CARTESIAN_POINT('',(1000000.5,0.25,-7.))"));
    assert_eq!(named(&all, "GEOMETRIC_SET").len(), 1);
    // Solid, sheet and points: three representations of one shape.
    assert_eq!(named(&all, "SHAPE_REPRESENTATION_RELATIONSHIP").len(), 3);
    assert_eq!(named(&all, "SHAPE_DEFINITION_REPRESENTATION").len(), 1);
    assert!(!text_of(&model, &WriteOptions::default()).contains("AREA_MEASURE"));
}

/// OpenCascade, which adds the missing degenerate edges, takes a loop apart otherwise that a hole across the seam is in.
#[test]
fn loops_through_poles_begin_there() {
    for reversed in [false, true] {
        let ball = whole(&sphere());
        let mut face = ball.faces()[0].clone();
        // Pole, seam up, pole, seam down.
        let uses = &mut face.loops[0].uses;
        assert!(ball.edges()[uses[0].edge].curve.is_none());
        uses.rotate_left(1);
        face.reversed = reversed;
        let mut model = Model::new("ball");
        for &vertex in ball.vertices() {
            model.add_vertex(vertex).unwrap();
        }
        for edge in ball.edges() {
            match &edge.curve {
                Some(curve) => model.add_edge(curve, edge.start, edge.end).unwrap(),
                None => model.add_degenerate_edge(edge.start).unwrap(),
            };
        }
        // A loop of one edge from pole to pole and back: begun at either, it is the same. With a hole, it is not.
        model.add_face(face).unwrap();
        let all = written(&model);
        let path = references(named(&all, "EDGE_LOOP")[0]);
        let forwards: Vec<bool> = path.iter().map(|p| all[p].ends_with(",.T.)")).collect();
        assert_eq!(forwards, [false, true]);
    }
}

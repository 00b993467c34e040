use super::read;
use crate::io::file::CadFile;
use crate::{Model, ShellKind, SurfaceKind};
use nurbskin_geometry::{Error, Unit};
use std::time::Instant;

mod foreign;

/// A file around these instances.
fn text(data: &str) -> String {
    format!(
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_SCHEMA(('CONFIG_CONTROL_DESIGN'));\nENDSEC;\n\
         DATA;\n{data}\nENDSEC;\nEND-ISO-10303-21;\n"
    )
}

fn load(data: &str) -> CadFile {
    read(text(data), "test.stp").unwrap()
}

/// The worst distance of p-curves to their edges; loops must chain exactly, inside the domain.
fn gap(model: &Model) -> f64 {
    let mut worst = 0.0_f64;
    for face in model.faces() {
        let [(a, b), (c, d)] = face.surface.domain();
        for each in &face.loops {
            let mut at = each.uses[each.uses.len() - 1].ends()[1];
            for used in &each.uses {
                assert!(used.ends()[0].distance(at) < 1e-12, "{used:?} after {at}");
                at = used.ends()[1];
                let (from, to) = used.pcurve.domain();
                let edge = &model.edges()[used.edge];
                for k in 0..=40 {
                    let t = from + (to - from) * f64::from(k) / 40.0;
                    let p = used.pcurve.point(t);
                    let slack = 1e-12 * (b - a + d - c);
                    let within = p.x >= a - slack
                        && p.x <= b + slack
                        && p.y >= c - slack
                        && p.y <= d + slack;
                    assert!(within, "{p}");
                    let there = match &edge.curve {
                        Some(curve) => curve.point(t),
                        None => model.vertices()[edge.start],
                    };
                    worst = worst.max(face.surface.point(p.x, p.y).distance(there));
                }
            }
        }
    }
    worst
}

const AXES: &str = "#1=CARTESIAN_POINT('',(0.,0.,0.));#2=DIRECTION('',(0.,0.,1.));#3=DIRECTION('',(1.,0.,0.));\
    #4=AXIS2_PLACEMENT_3D('',#1,#2,#3);#5=CARTESIAN_POINT('',(0.,0.,4.));#6=AXIS2_PLACEMENT_3D('',#5,#2,#3);";

/// Circles around the axis with a vertex each: numbers base, base + 1, ... ; the edge is base + 4.
fn rim(base: u64, axes: u64, radius: f64, height: f64, angle: f64) -> String {
    let (x, y) = (radius * angle.cos(), radius * angle.sin());
    format!(
        "#{base}=CIRCLE('',#{axes},{radius:?});#{}=CARTESIAN_POINT('',({x:?},{y:?},{height:?}));\
         #{}=VERTEX_POINT('',#{});#{}=EDGE_CURVE('',#{},#{},#{base},.T.);",
        base + 1,
        base + 2,
        base + 1,
        base + 4,
        base + 2,
        base + 2
    )
}

/// A bound of one edge: the bound has the number of `base`.
fn ring(base: u64, edge: u64, sense: &str) -> String {
    format!(
        "#{base}=FACE_BOUND('',#{},.T.);#{}=EDGE_LOOP('',(#{}));#{}=ORIENTED_EDGE('',*,*,#{edge},{sense});",
        base + 1,
        base + 1,
        base + 2,
        base + 2
    )
}

#[test]
fn a_can_of_rings_without_seams_is_a_solid() {
    for turn in [0.0, 0.7] {
        let data = [
            AXES,
            &rim(10, 4, 2.0, 0.0, 0.3),
            &rim(20, 6, 2.0, 4.0, 0.3 + turn),
            &ring(30, 14, ".T."),
            &ring(40, 24, ".F."),
            &ring(50, 14, ".F."),
            &ring(60, 24, ".T."),
            "#70=CYLINDRICAL_SURFACE('',#4,2.);#71=PLANE('',#4);#72=PLANE('',#6);\
             #73=ADVANCED_FACE('side',(#30,#40),#70,.T.);#74=ADVANCED_FACE('',(#50),#71,.F.);\
             #75=ADVANCED_FACE('',(#60),#72,.T.);#76=CLOSED_SHELL('',(#73,#74,#75));\
             #77=MANIFOLD_SOLID_BREP('can',#76);",
        ]
        .concat();
        let file = load(&data);
        let model = &file.model;
        assert_eq!(file.warnings, Vec::<String>::new());
        assert_eq!(model.faces().len(), 3);
        assert_eq!(model.shells()[0].kind, ShellKind::Solid);
        assert_eq!(model.faces()[0].kind, SurfaceKind::Cylinder);
        assert_eq!(model.faces()[0].name, "side");
        // Two rims and the seam between them.
        assert_eq!(model.edges().len(), 3);
        assert_eq!(model.faces()[0].loops[0].uses.len(), 4);
        assert!(gap(model) < 1e-7, "{}", gap(model));
    }
}

#[test]
fn caps_and_tips_get_their_poles() {
    // Half a ball: the loop is the equator, the pole is not in the file.
    let data = [
        AXES,
        &rim(10, 4, 2.0, 0.0, 0.0),
        &ring(30, 14, ".T."),
        &ring(40, 14, ".F."),
        "#70=SPHERICAL_SURFACE('',#4,2.);#71=PLANE('',#4);#73=ADVANCED_FACE('',(#30),#70,.T.);\
         #74=ADVANCED_FACE('',(#40),#71,.F.);#76=CLOSED_SHELL('',(#73,#74));#77=MANIFOLD_SOLID_BREP('',#76);",
    ]
    .concat();
    let file = load(&data);
    assert_eq!(file.model.shells()[0].kind, ShellKind::Solid);
    assert_eq!(file.model.edges().len(), 3);
    assert!(gap(&file.model) < 1e-7);
    // A cone up to its tip, a vertex loop: radius 2 at z = 0, tip at z = 4.
    let data = [
        AXES,
        &rim(10, 4, 2.0, 0.0, 0.0),
        &ring(30, 14, ".T."),
        "#41=VERTEX_POINT('',#5);#42=VERTEX_LOOP('',#41);#43=FACE_BOUND('',#42,.T.);\
         #70=CONICAL_SURFACE('',#4,2.,-0.46364760900080609);#73=ADVANCED_FACE('',(#30,#43),#70,.T.);\
         #76=OPEN_SHELL('',(#73));#77=SHELL_BASED_SURFACE_MODEL('',(#76));",
    ]
    .concat();
    let file = load(&data);
    let face = &file.model.faces()[0];
    assert_eq!(face.loops[0].uses.len(), 4);
    assert!(gap(&file.model) < 1e-7);
    assert!(!face.trimmed || face.surface.domain()[1].1 > 3.9);
}

#[test]
fn whole_surfaces_and_units() {
    let units = "#80=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));\
        #81=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#80);\
        #82=(CONVERSION_BASED_UNIT('INCH',#81)LENGTH_UNIT()NAMED_UNIT(#83));#83=DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);\
        #84=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#82))REPRESENTATION_CONTEXT('',''));\
        #85=SHAPE_REPRESENTATION('',(#4,#77),#84);#86=PRODUCT('1','caf\\X2\\00E9\\X0\\ ''x''','',(#84));";
    let data = [
        AXES,
        units,
        "#10=SPHERICAL_SURFACE('',#4,2.);#11=TOROIDAL_SURFACE('',#4,5.,1.);#12=DEGENERATE_TOROIDAL_SURFACE('',#4,1.,2.,.T.);\
         #13=OFFSET_SURFACE('',#10,1.,.F.);#77=GEOMETRIC_SET('',(#10,#11,#12,#13));",
    ]
    .concat();
    let file = load(&data);
    assert_eq!(file.model.unit, Unit::Inch);
    assert_eq!(file.model.name, "caf\u{e9} 'x'");
    assert_eq!(file.model.faces().len(), 3);
    assert_eq!(file.unread.get("OFFSET_SURFACE"), Some(&1));
    let spindle = &file.model.faces()[2].surface;
    let [(a, b), (c, d)] = spindle.domain();
    for k in 0..100 {
        let p = spindle.point(
            a + (b - a) * f64::from(k) / 99.0,
            c + (d - c) * f64::from(k * k % 100) / 99.0,
        );
        let off = (p.x.hypot(p.y) - 1.0).hypot(p.z) - 2.0;
        assert!(off.abs() < 1e-12, "{p}");
    }
    assert!(gap(&file.model) < 1e-12);
}

#[test]
fn assemblies_place_their_parts_in_their_own_units() {
    let unit = |id: u64, prefix: &str| {
        format!(
            "#{}=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.{prefix}.,.METRE.));\
             #{id}=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#{}))REPRESENTATION_CONTEXT('',''));",
            id + 10,
            id + 10
        )
    };
    let link = |id: u64, from: u64, to: u64| {
        format!(
            "#{}=ITEM_DEFINED_TRANSFORMATION('','',#{from},#{to});#{id}=(REPRESENTATION_RELATIONSHIP('','',#12,#13)\
             REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#{})SHAPE_REPRESENTATION_RELATIONSHIP());",
            id + 10,
            id + 10
        )
    };
    let data = [
        AXES,
        &unit(90, "MILLI"),
        &unit(91, "CENTI"),
        &link(20, 4, 6),
        &link(21, 6, 4),
        "#10=SPHERICAL_SURFACE('',#4,2.);#11=GEOMETRIC_SET('',(#10));#12=SHAPE_REPRESENTATION('',(#11,#4),#90);\
         #13=SHAPE_REPRESENTATION('',(#6,#4),#91);",
    ]
    .concat();
    let file = load(&data);
    assert_eq!(file.model.unit, Unit::Millimetre);
    // The parent's placement is 4 cm up, the part's own 4 mm up.
    let lowest = file
        .model
        .faces()
        .iter()
        .map(|f| f.surface.bounding_box()[0].z);
    assert_eq!(lowest.collect::<Vec<_>>(), [38.0, -6.0]);
    assert_eq!(file.model.shells().len(), 2);
}

/// A file cut off, in circles, too deep or with counts that lie is an error that says where, and takes no time.
#[test]
fn hostile_files_are_refused() {
    let good = text(
        &[
            AXES,
            "#10=SPHERICAL_SURFACE('',#4,2.);#11=GEOMETRIC_SET('',(#10));",
        ]
        .concat(),
    );
    assert!(read(&good, "").is_ok());
    let refused = |data: &str, part: &str| {
        let start = Instant::now();
        match read(text(data), "x.stp") {
            Err(Error::Read { at, what, .. }) => {
                assert!(format!("{at}: {what}").contains(part), "{at}: {what}");
            }
            other => panic!("{data}: {other:?}"),
        }
        assert!(start.elapsed().as_secs() < 20);
    };
    for cut in 1..good.len() - 30 {
        assert!(read(&good[..cut], "").is_err(), "{}", &good[..cut]);
    }
    refused("", "no instances");
    refused("#1=A(;", "1 A");
    refused("#1=PLANE('',#2)\n#3=A();", "line 8: a semicolon");
    refused("#1=A();#1=B();", "#1 is defined twice");
    refused(
        &format!("#1=GEOMETRIC_SET({}", "(".repeat(200_000)),
        "should come here",
    );
    refused(
        &format!(
            "#1=GEOMETRIC_SET('',{}{});",
            "(".repeat(5000),
            ")".repeat(5000)
        ),
        "deep",
    );
    refused("#1=GEOMETRIC_SET('',(#1));", "");
    refused("#1=GEOMETRIC_SET('',(#1,#1,#1));", "");
    refused(
        "#1=GEOMETRIC_SET('',(#2));#2=RECTANGULAR_TRIMMED_SURFACE('',#2,0.,1.,0.,1.,.T.,.T.);",
        "deep",
    );
    // Each curve is twice the next one.
    let mut doubling =
        String::from("#1=GEOMETRIC_SET('',(#2));#2=SURFACE_OF_REVOLUTION('',#100,#4);");
    for k in 100..160 {
        doubling += &format!(
            "#{k}=COMPOSITE_CURVE('',(#{},#{}),.F.);#{}=COMPOSITE_CURVE_SEGMENT(.CONTINUOUS.,.T.,#{});\
             #{}=COMPOSITE_CURVE_SEGMENT(.CONTINUOUS.,.T.,#{});",
            k + 1000,
            k + 2000,
            k + 1000,
            k + 1,
            k + 2000,
            k + 1
        );
    }
    refused(&doubling, "");
    let points = "#20=CARTESIAN_POINT('',(0.,0.,0.));#21=CARTESIAN_POINT('',(1.,0.,0.));";
    let surface =
        "#22=B_SPLINE_SURFACE_WITH_KNOTS('',1,1,((#20,#21),(#20,#21)),.UNSPECIFIED.,.F.,.F.,.F.,";
    for knots in [
        "(2,999999999999),(2,2),(0.,1.),(0.,1.)",
        "(9223372036854775807,9223372036854775807),(2,2),(0.,1.),(0.,1.)",
        "(-2,2),(2,2),(0.,1.),(0.,1.)",
        "(2,2),(2,2),(1.,0.),(0.,1.)",
        "(2),(2,2),(1.,0.),(0.,1.)",
    ] {
        refused(
            &format!("{points}{surface}{knots},.UNSPECIFIED.);#23=GEOMETRIC_SET('',(#22));"),
            "#22",
        );
    }
    // An assembly of itself, and one that doubles at each level.
    let mut nested = [AXES, "#9=SHAPE_REPRESENTATION('',(#200,#4),$);"].concat();
    for k in 0..40 {
        let (rep, map) = (300 + k, 500 + k);
        nested += &format!("#{map}=REPRESENTATION_MAP(#4,#{});", rep + 1);
        nested += &format!(
            "#{}=MAPPED_ITEM('',#{map},#4);#{}=MAPPED_ITEM('',#{map},#4);",
            700 + k,
            800 + k
        );
        nested += &format!(
            "#{rep}=SHAPE_REPRESENTATION('',(#{},#{}),$);",
            700 + k,
            800 + k
        );
    }
    refused(&nested, "");
}

/// Variants of good files, cut, shifted, re-counted, with flipped bits: an error or a model, never a panic or a hang.
#[test]
fn mutants_neither_panic_nor_hang() {
    let can = [
        AXES,
        &rim(10, 4, 2.0, 0.0, 0.3),
        &rim(20, 6, 2.0, 4.0, 0.3),
        &ring(30, 14, ".T."),
        &ring(40, 24, ".F."),
        &ring(50, 14, ".F."),
        &ring(60, 24, ".T."),
        "#70=CYLINDRICAL_SURFACE('',#4,2.);#71=PLANE('',#4);#72=PLANE('',#6);\
         #73=ADVANCED_FACE('',(#30,#40),#70,.T.);#74=ADVANCED_FACE('',(#50),#71,.F.);\
         #75=ADVANCED_FACE('',(#60),#72,.T.);#76=CLOSED_SHELL('',(#73,#74,#75));#77=MANIFOLD_SOLID_BREP('',#76);",
    ]
    .concat();
    let patch = "#20=CARTESIAN_POINT('',(0.,0.,0.));#21=CARTESIAN_POINT('',(1.,0.,0.));\
        #24=CARTESIAN_POINT('',(0.,1.,0.5));#25=CARTESIAN_POINT('',(1.,1.,0.));\
        #22=(BOUNDED_SURFACE()B_SPLINE_SURFACE(1,1,((#20,#24),(#21,#25)),.UNSPECIFIED.,.F.,.F.,.F.)\
        B_SPLINE_SURFACE_WITH_KNOTS((2,2),(2,2),(0.,1.),(0.,1.),.UNSPECIFIED.)GEOMETRIC_REPRESENTATION_ITEM()\
        RATIONAL_B_SPLINE_SURFACE(((1.,0.7),(1.,1.)))REPRESENTATION_ITEM('')SURFACE());\
        #23=GEOMETRIC_SET('',(#22));";
    let sources = [text(&can), text(patch)];
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        usize::try_from(state % below as u64).unwrap()
    };
    let start = Instant::now();
    let mut accepted = 0;
    for k in 0..1000 {
        let mut bytes = sources[k % 2].clone().into_bytes();
        for _ in 0..=random(3) {
            let at = 90 + random(bytes.len() - 120);
            match random(5) {
                0 => bytes.truncate(at.max(200)),
                1 => bytes[at] ^= 1 << random(8),
                2 => {
                    bytes.remove(at);
                }
                3 => {
                    let other = bytes[90 + random(bytes.len() - 120)];
                    bytes.insert(at, other);
                }
                _ => {
                    // Another digit: another reference, count or coordinate.
                    if let Some(digit) = bytes[at..].iter().position(u8::is_ascii_digit) {
                        bytes[at + digit] = b'0' + u8::try_from(random(10)).unwrap();
                    }
                }
            }
        }
        if let Ok(file) = read(&bytes, "mutant.stp") {
            accepted += 1;
            for edge in file.model.edges().iter().filter_map(|e| e.curve.as_ref()) {
                assert!(edge.control_points().iter().all(|p| p.is_finite()));
            }
        }
    }
    assert!(accepted > 50, "{accepted}");
    assert!(start.elapsed().as_secs() < 300);
}

#[test]
fn real_files_have_their_faces() {
    let Some(folder) = std::env::var_os("NURBSKIN_DATA") else {
        println!("NURBSKIN_DATA is not set");
        return;
    };
    for (name, faces) in [("pygem_pipe.step", 6), ("tigl_nacelle.stp", 6)] {
        let path = std::path::Path::new(&folder).join("cad").join(name);
        let Ok(bytes) = std::fs::read(&path) else {
            println!("{} is not there", path.display());
            continue;
        };
        let file = read(bytes, &path).unwrap();
        assert_eq!(file.model.faces().len(), faces);
        assert!(file.unread.is_empty(), "{:?}", file.unread);
        let points = file
            .model
            .faces()
            .iter()
            .flat_map(|f| f.surface.control_points().points());
        let size = points.fold(0.0_f64, |a, p| a.max(p.abs().max_element()));
        assert!(gap(&file.model) < 1e-6 * size, "{}", gap(&file.model));
    }
}

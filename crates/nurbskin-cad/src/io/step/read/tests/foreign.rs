//! What other systems write: edges without curves in space, scaled and mirrored copies, rings of all ways, edges through
//! poles, faces that cannot be read among others that can.

use super::{AXES, gap, load, rim, ring};
use crate::{ShellKind, mass};
use std::f64::consts::{PI, TAU};

/// A polygon in the parameter plane of surface #100, its edges p-curves only; the bound is #200.
fn flat_polygon(corners: &[[f64; 2]], point: impl Fn([f64; 2]) -> [f64; 3]) -> String {
    let count = corners.len();
    let (mut data, mut edges) = (String::new(), Vec::new());
    for (k, &[u, v]) in corners.iter().enumerate() {
        let base = 300 + 20 * k;
        let [x, y, z] = point([u, v]);
        data += &format!("#{base}=CARTESIAN_POINT('',({x:?},{y:?},{z:?}));");
        data += &format!("#{}=VERTEX_POINT('',#{base});", base + 1);
        let [a, b] = corners[(k + 1) % count];
        let (next, length) = (300 + 20 * ((k + 1) % count), (a - u).hypot(b - v));
        let ids: Vec<usize> = (base + 2..base + 12).collect();
        data += &format!(
            "#{}=CARTESIAN_POINT('',({u:?},{v:?}));#{}=DIRECTION('',({:?},{:?}));#{}=VECTOR('',#{},1.);\
             #{}=LINE('',#{},#{});#{}=DEFINITIONAL_REPRESENTATION('',(#{}),#999);#{}=PCURVE('',#100,#{});\
             #{}=SURFACE_CURVE('',$,(#{}),.PCURVE_S1.);#{}=EDGE_CURVE('',#{},#{},#{},.T.);\
             #{}=ORIENTED_EDGE('',*,*,#{},.T.);",
            ids[0],
            ids[1],
            (a - u) / length,
            (b - v) / length,
            ids[2],
            ids[1],
            ids[3],
            ids[0],
            ids[2],
            ids[4],
            ids[3],
            ids[5],
            ids[4],
            ids[6],
            ids[5],
            ids[7],
            base + 1,
            next + 1,
            // Some have the p-curve itself for a curve.
            ids[if k % 2 == 0 { 6 } else { 5 }],
            ids[8],
            ids[7],
        );
        edges.push(format!("#{}", ids[8]));
    }
    data + &format!(
        "#999=(GEOMETRIC_REPRESENTATION_CONTEXT(2)PARAMETRIC_REPRESENTATION_CONTEXT()REPRESENTATION_CONTEXT('',''));\
         #200=FACE_OUTER_BOUND('',#201,.T.);#201=EDGE_LOOP('',({}));",
        edges.join(",")
    )
}

#[test]
fn edges_may_have_curves_in_the_parameter_plane_only() {
    let shell = "#202=ADVANCED_FACE('',(#200),#100,.T.);#203=OPEN_SHELL('',(#202));\
                 #204=SHELL_BASED_SURFACE_MODEL('',(#203));";
    // Helices, and lines of the cylinder, over its seam.
    let corners = [[0.5, 0.0], [6.5, 1.0], [6.5, 3.0], [0.5, 2.0]];
    let on_cylinder = |[u, v]: [f64; 2]| [2.0 * f64::cos(u), 2.0 * f64::sin(u), v];
    let cylinder = [
        AXES,
        "#100=CYLINDRICAL_SURFACE('',#4,2.);",
        &flat_polygon(&corners, on_cylinder),
        shell,
    ];
    // A triangle on a sphere between two meridians and the equator; a patch of a torus.
    let on_torus = |major: f64, minor: f64| {
        move |[u, v]: [f64; 2]| {
            let r = major + minor * v.cos();
            [r * u.cos(), r * u.sin(), minor * v.sin()]
        }
    };
    let corners = [[-0.5, 0.0], [0.7, 0.0], [0.7, 1.0], [-0.5, 1.0]];
    let sphere = [
        AXES,
        "#100=SPHERICAL_SURFACE('',#4,2.);",
        &flat_polygon(&corners, on_torus(0.0, 2.0)),
        shell,
    ];
    let torus = [
        AXES,
        "#100=TOROIDAL_SURFACE('',#4,5.,2.);",
        &flat_polygon(&corners, on_torus(5.0, 2.0)),
        shell,
    ];
    // (6 u, 4 v, 0).
    let triangle = [[0.1, 0.1], [0.9, 0.2], [0.3, 0.8]];
    let spline = [
        AXES,
        "#101=CARTESIAN_POINT('',(6.,0.,0.));#102=CARTESIAN_POINT('',(0.,4.,0.));\
         #103=CARTESIAN_POINT('',(6.,4.,0.));#100=B_SPLINE_SURFACE_WITH_KNOTS('',1,1,((#1,#102),(#101,#103)),\
         .UNSPECIFIED.,.F.,.F.,.F.,(2,2),(2,2),(0.,1.),(0.,1.),.UNSPECIFIED.);",
        &flat_polygon(&triangle, |[u, v]| [6.0 * u, 4.0 * v, 0.0]),
        shell,
    ];
    let cases = [
        (cylinder.concat(), 2.0 * 6.0 * 2.0),
        (sphere.concat(), 4.0 * 1.2 * 1_f64.sin()),
        (torus.concat(), 1.2 * (10.0 + 4.0 * 1_f64.sin())),
        (spline.concat(), 24.0 * 0.5 * (0.8 * 0.7 - 0.2 * 0.1)),
    ];
    for (data, wanted) in cases {
        let file = load(&data);
        assert_eq!((&file.unread, &file.warnings), (&[].into(), &Vec::new()));
        let area = mass(&file.model).unwrap().area;
        assert!((area / wanted - 1.0).abs() < 1e-6, "{area}, not {wanted}");
        assert!(gap(&file.model) < 1e-5, "{}", gap(&file.model));
    }
}

/// A can of radius 2 and height 4, of volume 16 pi: as it is, mirrored at half its size, mirrored by its third axis.
#[test]
fn copies_may_be_scaled_and_mirrored() {
    let data = [
        AXES,
        &rim(10, 4, 2.0, 0.0, 0.3),
        &rim(20, 6, 2.0, 4.0, 0.3),
        &ring(30, 14, ".T."),
        &ring(40, 24, ".F."),
        &ring(50, 14, ".F."),
        &ring(60, 24, ".T."),
        "#70=CYLINDRICAL_SURFACE('',#4,2.);#71=PLANE('',#4);#72=PLANE('',#6);\
         #73=ADVANCED_FACE('side',(#30,#40),#70,.T.);#74=ADVANCED_FACE('',(#50),#71,.F.);\
         #75=ADVANCED_FACE('',(#60),#72,.T.);#76=CLOSED_SHELL('',(#73,#74,#75));\
         #77=MANIFOLD_SOLID_BREP('can',#76);\
         #80=ADVANCED_BREP_SHAPE_REPRESENTATION('',(#77,#4),$);#81=REPRESENTATION_MAP(#4,#80);\
         #82=DIRECTION('',(0.,1.,0.));#83=DIRECTION('',(0.,-1.,0.));#84=DIRECTION('',(0.,0.,-1.));\
         #85=CARTESIAN_POINT('',(10.,0.,0.));#86=CARTESIAN_POINT('',(0.,10.,0.));\
         #87=CARTESIAN_TRANSFORMATION_OPERATOR_3D('','',$,#3,#83,#85,0.5,#2);\
         #88=CARTESIAN_TRANSFORMATION_OPERATOR_3D('',#3,#82,#86,$,#84);\
         #89=MAPPED_ITEM('',#81,#4);#90=MAPPED_ITEM('',#81,#87);#91=MAPPED_ITEM('',#81,#88);\
         #92=SHAPE_REPRESENTATION('',(#89,#90,#91),$);",
    ];
    let file = load(&data.concat());
    assert_eq!((&file.unread, &file.warnings), (&[].into(), &Vec::new()));
    assert_eq!(file.model.shells().len(), 3);
    let volume = mass(&file.model).unwrap().volume.unwrap();
    assert!((volume / (16.0 * PI * (1.0 + 0.125 + 1.0)) - 1.0).abs() < 1e-6);
    let lid = |s: &crate::Shell| {
        let lid = &file.model.faces()[s.faces[2]].surface;
        lid.control_points().points()[0].z
    };
    let heights: Vec<f64> = file.model.shells().iter().map(lid).collect();
    assert_eq!(heights, [4.0, 2.0, -4.0]);
}

/// Villarceau's circles go round a torus both ways at once; turned about its axis they are parallel. The band between two
/// has the share of the torus that the angle is of a turn.
#[test]
fn rings_may_go_round_a_torus_both_ways() {
    let (major, minor, angle) = (5.0_f64, 2.0_f64, 1.0_f64);
    let tilt = (minor / major).asin();
    let circle = |base: u64, turn: f64| {
        let (sin, cos) = turn.sin_cos();
        let turned = |x: f64, y: f64, z: f64| [cos * x - sin * y, sin * x + cos * y, z];
        let at = |p: [f64; 3]| format!("({:?},{:?},{:?})", p[0], p[1], p[2]);
        let (along, normal) = (
            [tilt.cos(), 0.0, tilt.sin()],
            [-tilt.sin(), 0.0, tilt.cos()],
        );
        format!(
            "#{base}=CIRCLE('',#{},{major:?});#{}=CARTESIAN_POINT('',{});#{}=VERTEX_POINT('',#{});\
             #{}=EDGE_CURVE('',#{},#{},#{base},.T.);#{}=AXIS2_PLACEMENT_3D('',#{},#{},#{});\
             #{}=CARTESIAN_POINT('',{});#{}=DIRECTION('',{});#{}=DIRECTION('',{});",
            base + 5,
            base + 1,
            at(turned(major * along[0], minor, major * along[2])),
            base + 2,
            base + 1,
            base + 4,
            base + 2,
            base + 2,
            base + 5,
            base + 6,
            base + 7,
            base + 8,
            base + 6,
            at(turned(0.0, minor, 0.0)),
            base + 7,
            at(turned(normal[0], normal[1], normal[2])),
            base + 8,
            at(turned(along[0], along[1], along[2])),
        )
    };
    let mut shares = Vec::new();
    for senses in [[".T.", ".F."], [".F.", ".T."]] {
        let data = [
            AXES,
            &circle(10, 0.0),
            &circle(20, angle),
            &ring(30, 14, senses[0]),
            &ring(40, 24, senses[1]),
            "#70=TOROIDAL_SURFACE('',#4,5.,2.);#73=ADVANCED_FACE('',(#30,#40),#70,.T.);\
             #76=OPEN_SHELL('',(#73));#77=SHELL_BASED_SURFACE_MODEL('',(#76));",
        ];
        let file = load(&data.concat());
        assert_eq!((&file.unread, &file.warnings), (&[].into(), &Vec::new()));
        assert!(gap(&file.model) < 1e-6, "{}", gap(&file.model));
        shares.push(mass(&file.model).unwrap().area / (TAU * major * TAU * minor));
    }
    shares.sort_by(f64::total_cmp);
    assert!((shares[0] - angle / TAU).abs() < 1e-6, "{shares:?}");
    assert!((shares[1] - (1.0 - angle / TAU)).abs() < 1e-6, "{shares:?}");
}

/// Two halves of a ball, their common edge a circle through both poles of both surfaces.
#[test]
fn edges_may_run_through_poles() {
    let data = [
        AXES,
        "#10=CIRCLE('',#15,2.);#11=CARTESIAN_POINT('',(2.,0.,0.));#12=VERTEX_POINT('',#11);\
         #14=EDGE_CURVE('',#12,#12,#10,.T.);#15=AXIS2_PLACEMENT_3D('',#1,#16,#3);#16=DIRECTION('',(0.,1.,0.));",
        &ring(30, 14, ".T."),
        &ring(40, 14, ".F."),
        "#70=SPHERICAL_SURFACE('',#4,2.);#73=ADVANCED_FACE('',(#30),#70,.T.);\
         #74=ADVANCED_FACE('',(#40),#70,.T.);#76=CLOSED_SHELL('',(#73,#74));#77=MANIFOLD_SOLID_BREP('',#76);",
    ];
    let file = load(&data.concat());
    assert_eq!((&file.unread, &file.warnings), (&[].into(), &Vec::new()));
    let model = &file.model;
    assert_eq!(model.shells()[0].kind, ShellKind::Solid);
    let curves = model.edges().iter().filter(|e| e.curve.is_some());
    assert_eq!(curves.count(), 3);
    assert!(gap(model) < 1e-7, "{}", gap(model));
    let volume = mass(model).unwrap().volume.unwrap();
    assert!((volume / (32.0 * PI / 3.0) - 1.0).abs() < 1e-6, "{volume}");
}

#[test]
fn a_face_that_fails_leaves_nothing_behind() {
    let data = [
        AXES,
        &rim(10, 4, 2.0, 0.0, 0.3),
        &rim(20, 6, 2.0, 4.0, 0.3),
        &ring(50, 14, ".T."),
        &ring(60, 24, ".T."),
        "#71=PLANE('',#4);#72=OFFSET_SURFACE('',#71,1.,.F.);#74=ADVANCED_FACE('',(#60),#72,.T.);\
         #75=ADVANCED_FACE('',(#50),#71,.T.);#76=OPEN_SHELL('',(#74,#75));\
         #77=SHELL_BASED_SURFACE_MODEL('',(#76));",
    ];
    let file = load(&data.concat());
    assert_eq!(file.unread, [("OFFSET_SURFACE".to_string(), 1)].into());
    let model = &file.model;
    assert_eq!(
        (
            model.faces().len(),
            model.edges().len(),
            model.vertices().len()
        ),
        (1, 1, 1)
    );
    assert_eq!(model.faces()[0].loops[0].uses[0].edge, 0);
}

/// A square tube, 2 wide and 3 high, that closes where its rims begin and end.
#[test]
fn curves_in_the_parameter_plane_may_go_round() {
    let rim = |base: u64, v: f64, z: f64| {
        format!(
            "#{base}=CARTESIAN_POINT('',(0.,0.,{z:?}));#{}=VERTEX_POINT('',#{base});#{}=CARTESIAN_POINT('',(0.,{v:?}));\
             #{}=DIRECTION('',(1.,0.));#{}=VECTOR('',#{},1.);#{}=LINE('',#{},#{});\
             #{}=DEFINITIONAL_REPRESENTATION('',(#{}),#1);#{}=PCURVE('',#70,#{});#{}=SURFACE_CURVE('',$,(#{}),.PCURVE_S1.);\
             #{}=EDGE_CURVE('',#{},#{},#{},.T.);",
            base + 1,
            base + 2,
            base + 3,
            base + 5,
            base + 3,
            base + 6,
            base + 2,
            base + 5,
            base + 7,
            base + 6,
            base + 8,
            base + 7,
            base + 9,
            base + 8,
            base + 4,
            base + 1,
            base + 1,
            base + 9,
        )
    };
    let corners = [[0, 0], [2, 0], [2, 2], [0, 2], [0, 0]];
    let (mut points, mut rows) = (String::new(), Vec::new());
    for (k, [x, y]) in corners.into_iter().enumerate() {
        let id = 200 + 2 * k;
        points += &format!(
            "#{id}=CARTESIAN_POINT('',({x}.,{y}.,0.));#{}=CARTESIAN_POINT('',({x}.,{y}.,3.));",
            id + 1
        );
        rows.push(format!("(#{id},#{})", id + 1));
    }
    let data = [
        AXES,
        &rim(10, 0.0, 0.0),
        &rim(20, 1.0, 3.0),
        &ring(30, 14, ".T."),
        &ring(40, 24, ".F."),
        &points,
        &format!(
            "#70=B_SPLINE_SURFACE_WITH_KNOTS('',1,1,({}),.UNSPECIFIED.,.T.,.F.,.F.,(2,1,1,1,2),(2,2),\
             (0.,0.25,0.5,0.75,1.),(0.,1.),.UNSPECIFIED.);",
            rows.join(",")
        ),
        "#73=ADVANCED_FACE('',(#30,#40),#70,.T.);#76=OPEN_SHELL('',(#73));#77=SHELL_BASED_SURFACE_MODEL('',(#76));",
    ];
    let file = load(&data.concat());
    assert_eq!((&file.unread, &file.warnings), (&[].into(), &Vec::new()));
    let area = mass(&file.model).unwrap().area;
    assert!((area / 24.0 - 1.0).abs() < 1e-9, "{area}");
}

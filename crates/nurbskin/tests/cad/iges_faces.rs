//! Faces of IGES files that the tests make, against what they should be.

use super::{MILLIMETRES, hand_made};
use nurbskin::cad::{ShellKind, SurfaceKind};
use nurbskin::io::cad::CadFile;
use nurbskin::io::iges::read_cad;
use nurbskin::{DVec3, NurbsSurface, Unit};
use std::f64::consts::{FRAC_PI_4, PI, TAU};

/// An entity: type, form, matrix, parameters behind the type, however long.
type Entity = (u32, i32, usize, String);

/// Parameters on lines that fit a card.
fn wrapped(parameters: &str) -> String {
    let mut lines = vec![String::new()];
    for field in parameters.split_inclusive([',', ';']) {
        if lines.last().unwrap().len() + field.len() > 64 {
            lines.push(String::new());
        }
        lines.last_mut().unwrap().push_str(field.trim());
    }
    lines.join("\n")
}

pub(super) fn file_of(global: &str, entities: &[Entity]) -> String {
    let all: Vec<(u32, i32, usize, String)> = entities
        .iter()
        .map(|(kind, form, matrix, text)| {
            (*kind, *form, *matrix, wrapped(&format!("{kind},{text};")))
        })
        .collect();
    let borrowed: Vec<_> = all
        .iter()
        .map(|(k, f, m, t)| (*k, *f, *m, t.as_str()))
        .collect();
    hand_made(global, &borrowed)
}

fn e(kind: u32, form: i32, text: impl Into<String>) -> Entity {
    (kind, form, 0, text.into())
}

fn read(entities: &[Entity]) -> CadFile {
    let file = read_cad(file_of(MILLIMETRES, entities), "part.igs").unwrap();
    sound(&file);
    file
}

/// Every p-curve lies on its edge and follows the one before; returns the widest gap.
pub(super) fn sound(file: &CadFile) -> f64 {
    let model = &file.model;
    let mut worst = 0.0_f64;
    for face in model.faces() {
        assert!(!face.loops.is_empty());
        for each in &face.loops {
            let mut at = each.uses.last().unwrap().ends()[1];
            for used in &each.uses {
                assert!(at.distance(used.ends()[0]) <= 1e-9 * (1.0 + at.length()));
                at = used.ends()[1];
                let edge = &model.edges()[used.edge];
                let (a, b) = used.pcurve.domain();
                for k in 0..=20 {
                    let t = a + (b - a) * f64::from(k) / 20.0;
                    let uv = used.pcurve.point(t);
                    let on_edge = match &edge.curve {
                        Some(curve) => curve.point(t),
                        None => model.vertices()[edge.start],
                    };
                    worst = worst.max(face.surface.point(uv.x, uv.y).distance(on_edge));
                }
            }
        }
    }
    worst
}

/// All points of a grid over the surface.
fn grid(surface: &NurbsSurface) -> impl Iterator<Item = (f64, f64, DVec3)> + '_ {
    let [(a, b), (c, d)] = surface.domain();
    (0..=12).flat_map(move |i| {
        (0..=12).map(move |j| {
            let u = a + (b - a) * f64::from(i) / 12.0;
            let v = c + (d - c) * f64::from(j) / 12.0;
            (u, v, surface.point(u, v))
        })
    })
}

fn only(file: &CadFile) -> &nurbskin::cad::Face {
    assert_eq!(file.model.faces().len(), 1, "{:?}", file.warnings);
    assert!(file.unread.is_empty(), "{:?}", file.warnings);
    &file.model.faces()[0]
}

/// The coefficients of a polynomial of degree 3 in u and v around (u0, v0), IGES order, z and a kink in x.
fn patch(u0: f64, v0: f64, kink: f64) -> String {
    // x = u + kink max(u - 1, 0), y = v, z = u^3 - 2 u v^2 + v^3 + 1.
    let mut c = [[0.0; 16]; 3];
    let slope = if u0 >= 1.0 { 1.0 + kink } else { 1.0 };
    c[0][0] = if u0 >= 1.0 {
        u0 + kink * (u0 - 1.0)
    } else {
        u0
    };
    c[0][1] = slope;
    c[1][0] = v0;
    c[1][4] = 1.0;
    c[2][0] = u0.powi(3) - 2.0 * u0 * v0 * v0 + v0.powi(3) + 1.0;
    c[2][1] = 3.0 * u0 * u0 - 2.0 * v0 * v0;
    c[2][2] = 3.0 * u0;
    c[2][3] = 1.0;
    c[2][4] = -4.0 * u0 * v0 + 3.0 * v0 * v0;
    c[2][5] = -4.0 * v0;
    c[2][8] = -2.0 * u0 + 3.0 * v0;
    c[2][9] = -2.0;
    c[2][12] = 1.0;
    c.as_flattened().iter().map(|x| format!("{x:?},")).collect()
}

#[test]
fn parametric_spline_surfaces_are_exact_with_the_least_knots() {
    for (kink, inner) in [(0.0, 0), (0.5, 3)] {
        let mut text = "3,1,2,2,0.,1.,2.5,-1.,0.,1.,".to_owned();
        for u0 in [0.0, 1.0] {
            for v0 in [-1.0, 0.0] {
                text += &patch(u0, v0, kink);
            }
            text += &"7.,".repeat(48); // means nothing
        }
        let file = read(&[e(114, 0, text.trim_end_matches(','))]);
        let face = only(&file);
        assert_eq!(face.kind, SurfaceKind::ParametricSpline);
        assert_eq!(face.surface.degree(), [3, 3]);
        assert_eq!(face.surface.knots_v().knots().len(), 8);
        assert_eq!(face.surface.knots_u().knots().len(), 8 + inner);
        for (u, v, p) in grid(&face.surface) {
            let x = u + kink * (u - 1.0).max(0.0);
            let z = u.powi(3) - 2.0 * u * v * v + v.powi(3) + 1.0;
            assert!(p.distance(DVec3::new(x, v, z)) < 1e-13);
        }
    }
}

#[test]
fn ruled_revolved_and_tabulated_surfaces_are_exact() {
    // Between a half circle and a line that runs the other way.
    let file = read(&[
        e(118, 1, "3,5,1,0"),
        e(100, 0, "0.,0.,0.,2.,0.,-2.,0."),
        e(110, 0, "-3.,0.,4.,3.,0.,4."),
    ]);
    let face = only(&file);
    assert_eq!(face.kind, SurfaceKind::Ruled);
    for (u, v, p) in grid(&face.surface) {
        if v <= 0.0 {
            assert!((p.length() - 2.0).abs() < 1e-14);
        }
        if v >= 1.0 {
            assert!(p.distance(DVec3::new(3.0 - 6.0 * u, 0.0, 4.0)) < 1e-14);
        }
    }
    // A quarter of a cone about a shifted axis, from 30 to 120 degrees.
    let (start, end) = (PI / 6.0, 2.0 * PI / 3.0);
    let file = read(&[
        e(120, 0, format!("3,5,{start:?},{end:?}")),
        e(110, 0, "1.,0.,0.,1.,0.,5."),
        e(110, 0, "4.,0.,0.,2.,0.,6."),
    ]);
    let face = only(&file);
    assert_eq!(face.kind, SurfaceKind::Revolution);
    for (u, v, p) in grid(&face.surface) {
        let (x, y) = (p.x - 1.0, p.y);
        assert!((x.hypot(y) - (3.0 - 2.0 * u)).abs() < 1e-13 && (p.z - 6.0 * u).abs() < 1e-13);
        let angle = y.atan2(x);
        assert!(angle > start - 1e-12 && angle < end + 1e-12);
        assert!(v < 1.0 || (angle - end).abs() < 1e-12);
    }
    // An ellipse, moved along a slanted line: entity 104 with x^2 / 9 + y^2 / 4 = 1, turned by 45 degrees.
    let (c, s) = (FRAC_PI_4.cos(), FRAC_PI_4.sin());
    let at = |x: f64, y: f64| format!("{:?},{:?}", c * x - s * y, s * x + c * y);
    let (a, b) = (1.0 / 9.0, 1.0 / 4.0);
    let conic = format!(
        "{:?},{:?},{:?},0.,0.,-1.,7.,{},{}",
        a * c * c + b * s * s,
        2.0 * c * s * (a - b),
        a * s * s + b * c * c,
        at(3.0, 0.0),
        at(0.0, -2.0)
    );
    let end = format!("{:?},{:?},12.", 3.0 * c + 1.0, 3.0 * s + 1.0);
    let file = read(&[e(122, 0, format!("3,{end}")), e(104, 1, conic)]);
    let face = only(&file);
    assert_eq!(face.kind, SurfaceKind::Extrusion);
    for (_, v, p) in grid(&face.surface) {
        let q = p - v * DVec3::new(1.0, 1.0, 5.0);
        let (x, y) = (c * q.x + s * q.y, c * q.y - s * q.x);
        assert!((a * x * x + b * y * y - 1.0).abs() < 1e-14 && (q.z - 7.0).abs() < 1e-14);
        // Three quarters, counter-clockwise: the one that is left out has x > 0 > y.
        assert!(!(x > 1e-9 && y < -1e-9));
    }
}

#[test]
fn parabolas_and_hyperbolas_are_exact() {
    for (form, coefficients, ends) in [
        (3, [1.0, 0.0, 0.0, 0.0, -1.0, 0.0], [-1.0, 1.0, 2.0, 4.0]), // y = x^2
        (
            2,
            [1.0, 0.0, -1.0, 0.0, 0.0, -1.0],
            [2.0_f64.sqrt(), -1.0, 2.0, 3.0_f64.sqrt()],
        ), // x^2 - y^2 = 1
    ] {
        let list = |values: &[f64]| values.iter().map(|x| format!("{x:?},")).collect::<String>();
        let text = format!("{}0.,{}", list(&coefficients), list(&ends));
        let file = read(&[
            e(122, 0, format!("3,{:?},{:?},1.", ends[0], ends[1])),
            e(104, form, text.trim_end_matches(',')),
        ]);
        let [a, b, c, d, f, g] = coefficients;
        for (_, _, p) in grid(&only(&file).surface) {
            let (x, y) = (p.x, p.y);
            assert!((a * x * x + b * x * y + c * y * y + d * x + f * y + g).abs() < 1e-13);
            assert!(x >= ends[0].min(1.0) - 1e-12 && x <= 2.0 + 1e-12);
        }
    }
}

#[test]
fn elementary_surfaces_are_exact() {
    let bare = |kind: u32, text: &str| {
        read(&[
            e(kind, 1, text),
            e(116, 0, "1.,2.,3."),
            e(123, 0, "0.,0.,2."),
            e(123, 0, "0.,3.,0."),
        ])
    };
    let file = bare(196, "3,2.,5,7");
    for (_, _, p) in grid(&only(&file).surface) {
        assert!((p.distance(DVec3::new(1.0, 2.0, 3.0)) - 2.0).abs() < 1e-14);
    }
    assert_eq!(file.model.shells()[0].kind, ShellKind::Closed);
    let file = bare(198, "3,5,4.,1.,7");
    for (_, _, p) in grid(&only(&file).surface) {
        let q = p - DVec3::new(1.0, 2.0, 3.0);
        assert!((q.x.hypot(q.y) - 4.0).hypot(q.z) - 1.0 < 1e-14);
    }
    // Cylinder and cone between two circles, and a plane within one.
    for (kind, text, radii) in [(192, "3,5,2.", [2.0, 2.0]), (194, "3,5,2.,45.", [2.0, 5.0])] {
        let file = read(&[
            e(kind, 0, text),
            e(116, 0, "1.,2.,3."),
            e(123, 0, "0.,0.,1."),
            e(
                100,
                0,
                format!("3.,1.,2.,{:?},2.,{:?},2.", 1.0 + radii[0], 1.0 + radii[0]),
            ),
            e(
                100,
                0,
                format!("6.,1.,2.,{:?},2.,{:?},2.", 1.0 + radii[1], 1.0 + radii[1]),
            ),
            e(142, 0, "1,1,0,7,2"),
            e(142, 0, "1,1,0,9,2"),
            e(144, 0, "1,1,1,11,13"),
        ]);
        let face = only(&file);
        for (_, _, p) in grid(&face.surface) {
            let height = (p.z - 3.0) / 3.0;
            let radius = radii[0] + (radii[1] - radii[0]) * height;
            assert!(((p.x - 1.0).hypot(p.y - 2.0) - radius).abs() < 1e-13);
            assert!((-1e-12..1.0 + 1e-12).contains(&height));
        }
        assert_eq!(face.loops.len(), 1, "a seam joins the circles");
    }
    let file = read(&[
        e(144, 0, "3,1,0,9"),
        e(190, 0, "5,7"),
        e(116, 0, "0.,0.,2."),
        e(123, 0, "0.,0.,1."),
        e(142, 0, "1,3,0,11,2"),
        e(100, 0, "2.,1.,1.,4.,1.,4.,1."),
    ]);
    assert_eq!(only(&file).kind, SurfaceKind::Plane);
    assert!(sound(&file) < 1e-14);
    // The same disk as a bounded plane.
    let file = read(&[
        e(108, 1, "0.,0.,2.,4.,3,0.,0.,2.,1."),
        e(100, 0, "2.,1.,1.,4.,1.,4.,1."),
    ]);
    assert_eq!(only(&file).kind, SurfaceKind::Plane);
    assert!(only(&file).trimmed && sound(&file) < 1e-14);
}

/// A plate from 0 to 4 by 0 to 4 with parameters 0 to 1.
fn plate() -> Entity {
    e(
        128,
        0,
        "1,1,1,1,0,0,1,0,0,0,0,1,1,0,0,1,1,1,1,1,1,0,0,0,4,0,0,0,4,0,4,4,0,0,1,0,1",
    )
}

#[test]
fn trims_follow_the_curves_that_count() {
    // A square hole whose curves are there only in the parameter plane, in an outer boundary that is the plate's own.
    let line = |x0: f64, y0: f64, x1: f64, y1: f64| e(110, 0, format!("{x0},{y0},0,{x1},{y1},0"));
    let holed = |preferred: u8, space: usize| {
        let mut entities = vec![
            plate(),
            e(144, 0, "1,0,1,0,5"),
            e(142, 0, format!("0,1,7,{space},{preferred}")),
            e(102, 0, "4,9,11,13,15"),
            line(0.25, 0.25, 0.75, 0.25),
            line(0.75, 0.25, 0.75, 0.75),
            line(0.75, 0.75, 0.25, 0.75),
            line(0.25, 0.75, 0.25, 0.25),
        ];
        if space != 0 {
            entities.push(e(100, 0, "0.,2.,2.,3.,2.,3.,2."));
        }
        read(&entities)
    };
    let file = holed(1, 0);
    let face = only(&file);
    assert_eq!(
        face.loops.iter().map(|l| l.uses.len()).collect::<Vec<_>>(),
        [4, 4]
    );
    assert!(
        file.model
            .vertices()
            .iter()
            .any(|p| p.distance(DVec3::new(1.0, 3.0, 0.0)) < 1e-14)
    );
    // A circle in space counts where the file prefers it.
    assert_eq!(only(&holed(2, 17)).loops[1].uses.len(), 1);
    // A bounded surface (143, 141) whose second curve runs backwards.
    let file = read(&[
        plate(),
        e(143, 0, "0,1,1,5"),
        e(141, 0, "0,0,1,2,7,1,0,9,2,0"),
        e(100, 0, "0.,2.,2.,3.,2.,1.,2."),
        e(110, 0, "3.,2.,0.,1.,2.,0."),
    ]);
    let face = only(&file);
    assert!(face.trimmed && face.loops.len() == 1 && sound(&file) < 1e-12);
}

#[test]
fn curves_may_leave_the_domain_that_the_file_cuts_out() {
    // The plate up to v = 0.5, with trims up to 0.9, within its knots, and up to 1.05.
    for top in [0.9, 1.05] {
        let line = |a: [f64; 2], b: [f64; 2], scale: f64| {
            let [a, b] = [a, b].map(|p| p.map(|x| scale * x));
            e(110, 0, format!("{},{},0,{},{},0", a[0], a[1], b[0], b[1]))
        };
        let corners = [[0.25, 0.25], [0.75, 0.25], [0.75, top], [0.25, top]];
        let sides = |scale: f64| -> Vec<Entity> {
            let side = |k: usize| line(corners[k], corners[(k + 1) % 4], scale);
            (0..4).map(side).collect()
        };
        let plate = "1,1,1,1,0,0,1,0,0,0,0,1,1,0,0,1,1,1,1,1,1,0,0,0,4,0,0,0,4,0,4,4,0,0,1,0,0.5";
        let mut entities = vec![
            e(128, 0, plate),
            e(144, 0, "1,1,0,5"),
            e(142, 0, "0,1,7,9,3"),
            e(102, 0, "4,11,13,15,17"),
            e(102, 0, "4,19,21,23,25"),
        ];
        entities.extend(sides(1.0));
        entities.extend(sides(4.0));
        let file = read(&entities);
        assert_eq!(file.warnings, Vec::<String>::new());
        let face = only(&file);
        assert!(sound(&file) < 1e-12, "{top}: {}", sound(&file));
        let area = nurbskin::cad::face_mass(face, DVec3::ZERO).unwrap().area;
        assert!((area - 8.0 * (top - 0.25)).abs() < 1e-12, "{top}: {area}");
    }
}

#[test]
fn subfigures_are_placed_where_they_are_used() {
    let file = read(&[
        e(308, 0, "0,4HPART,1,3"),
        plate(),
        e(408, 0, "1,10.,0.,0.,2."),
        (408, 0, 9, "1,0.,0.,1.".into()),
        e(124, 0, "0,-1,0,0,1,0,0,0,0,0,1,0"),
        (408, 0, 13, "1,0.,0.,0.,3.".into()),
        e(124, 0, "-1,0,0,0,0,1,0,0,0,0,1,0"),
    ]);
    let corners: Vec<DVec3> = file
        .model
        .faces()
        .iter()
        .map(|f| f.surface.point(1.0, 0.0))
        .collect();
    assert_eq!(
        corners,
        [
            DVec3::new(18.0, 0.0, 0.0),
            DVec3::new(0.0, 4.0, 1.0),
            DVec3::new(-12.0, 0.0, 0.0)
        ]
    );
    // A mirror image has its outward side where the original has.
    let turned: Vec<bool> = file.model.faces().iter().map(|f| f.reversed).collect();
    assert_eq!(turned, [false, false, true]);
    assert!(file.unread.is_empty(), "{:?}", file.warnings);
}

#[test]
fn what_is_not_understood_is_named_and_counted() {
    let file = read(&[
        e(140, 0, "0.,0.,1.,2.,3"),
        plate(),
        e(144, 0, "1,0,0,0"),
        e(116, 0, "1.,2.,3."),
        e(406, 15, "1,4HNAME"),
        e(314, 0, "100.,50.,0."),
        e(150, 0, "1.,2.,3."),
        e(0, 0, ""),
    ]);
    assert_eq!(file.model.faces().len(), 1);
    let unread = ["116", "140", "144", "150"].map(|kind| (kind.to_owned(), 1));
    assert_eq!(file.unread, unread.into(), "{:?}", file.warnings);
    assert_eq!(file.model.unit, Unit::Millimetre);
    assert_eq!(file.entities["128"], 1);
    // Pointers that lead nowhere, and circles, are damage.
    let refused = |entities: &[Entity]| {
        read_cad(file_of(MILLIMETRES, entities), "part.igs")
            .unwrap_err()
            .to_string()
    };
    let text = refused(&[e(144, 0, "99,0,0,0")]);
    assert!(
        text.contains("(D1)") && text.contains("D99, but there is no entity"),
        "{text}"
    );
    let text = refused(&[plate(), e(144, 0, "1,1,0,5"), e(102, 0, "1,5")]);
    assert!(text.contains("leads back to itself"), "{text}");
    let many = (0..12).map(|k| {
        let next = format!("{}", 4 * k + 5);
        [
            e(308, 0, format!("0,1HA,2,{},{}", 4 * k + 3, 4 * k + 3)),
            e(408, 0, format!("{next},0,0,0")),
        ]
    });
    let mut doubled: Vec<Entity> = many.flatten().collect();
    doubled.push(e(308, 0, "0,1HZ,1,51"));
    doubled.push(plate());
    doubled.push(e(408, 0, "1,0,0,0"));
    let made = read_cad(file_of(MILLIMETRES, &doubled), "part.igs");
    assert!(made.is_ok() || made.unwrap_err().to_string().contains("over and over"));
}

#[test]
fn a_revolved_profile_of_a_turn_closes() {
    let file = read(&[
        e(120, 0, format!("3,5,0.,{TAU:?}")),
        e(110, 0, "0.,0.,0.,0.,0.,1."),
        e(100, 1, "0.,0.,0.,0.,-3.,0.,3."),
        e(124, 0, "1,0,0,0,0,0,-1,0,0,1,0,0"),
    ]);
    let _ = file;
    let file = read(&[
        e(120, 0, format!("3,5,0.,{TAU:?}")),
        e(110, 0, "0.,0.,0.,0.,0.,1."),
        (100, 0, 7, "0.,0.,0.,0.,-3.,0.,3.".into()),
        e(124, 0, "1,0,0,0,0,0,-1,0,0,1,0,0"),
    ]);
    let face = only(&file);
    for (_, _, p) in grid(&face.surface) {
        assert!((p.length() - 3.0).abs() < 1e-13);
    }
    assert_eq!(file.model.shells()[0].kind, ShellKind::Closed);
}

/// Boxes by Open CASCADE (`BRepBndLib::AddOptimal`, without tolerances).
#[test]
fn files_of_other_programs_have_their_faces_and_boxes() {
    let folder = std::env::var_os("NURBSKIN_DATA").map(std::path::PathBuf::from);
    let Some(folder) = folder.map(|f| f.join("cad")) else {
        println!("skipped: NURBSKIN_DATA does not name a folder of CAD files");
        return;
    };
    for (name, faces, planes, kind, low, high) in [
        (
            "occt_hammer.iges",
            45,
            0,
            ShellKind::Open,
            DVec3::new(-10939.2722401, 17053.2448499, -13714.2039801),
            DVec3::new(2239.5174661, 21342.9604601, 24717.1788052),
        ),
        (
            "tigl_d150_wing.igs",
            8,
            2,
            ShellKind::Closed,
            DVec3::new(12743.7135265, 0.0, -1845.8883644),
            DVec3::new(22136.9723101, 16963.4790601, -106.9635419),
        ),
    ] {
        let Ok(bytes) = std::fs::read(folder.join(name)) else {
            println!("skipped: {name} is not there");
            continue;
        };
        let file = read_cad(&bytes, name).unwrap();
        assert!(file.unread.is_empty(), "{:?}", file.unread);
        let model = &file.model;
        assert_eq!((model.faces().len(), model.unit), (faces, Unit::Millimetre));
        let flat = |f: &&nurbskin::cad::Face| f.kind == SurfaceKind::Plane;
        assert_eq!(model.faces().iter().filter(flat).count(), planes);
        assert_eq!(model.shells()[0].kind, kind);
        let found = nurbskin::cad::extent::extent(model).unwrap();
        let off = (found.low - low).abs().max((found.high - high).abs());
        let size = low.distance(high);
        assert!(off.max_element() <= 1e-6 * size, "{name}: {off} of {size}");
        let gap = sound(&file);
        // The hammer is a poor file: curves in space lie up to 1.8 off its surfaces.
        assert!(gap <= 5e-5 * size, "{name}: {gap}");
    }
}

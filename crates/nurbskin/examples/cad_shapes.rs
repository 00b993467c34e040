//! Writes a folder of CAD files of known shape, for other readers to be tried on: each as IGES, STEP AP214 and AP242,
//! with an `.xyz` of points that lie on it exactly, the `.max` distance that a reader may find, and the number of
//! `.faces`.
//!
//! ```sh
//! cargo run --release -p nurbskin --example cad_shapes -- FOLDER
//! ```

#![expect(clippy::print_stdout, reason = "an example talks")]

use nurbskin::cad::{
    EdgeUse, Face, Loop, Model, Shell, ShellKind, SurfaceKind, extent, mass, samples,
};
use nurbskin::io::{iges, step};
use nurbskin::nurbs::{NurbsCurve, conic};
use nurbskin::{ControlNet, DVec3, KnotVector, NurbsSurface, Result, Unit};
use std::f64::consts::TAU;
use std::path::Path;

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args()
        .nth(1)
        .unwrap_or_else(|| "cad_shapes".into());
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    for (name, model) in shapes()? {
        let mut sizes = Vec::new();
        for (extension, bytes) in [
            ("igs", iges_of(&model, name)?),
            ("step", step_of(&model, name, step::Schema::Ap214)?),
            ("242.step", step_of(&model, name, step::Schema::Ap242)?),
        ] {
            sizes.push(bytes.len());
            std::fs::write(folder.join(format!("{name}.{extension}")), bytes)?;
        }
        // Readers deliver millimetres.
        let millimetres = model.unit.millimetres();
        let text = points_on(&model)
            .into_iter()
            .map(|p| p * millimetres)
            .map(|p| format!("{} {} {}\n", p.x, p.y, p.z));
        std::fs::write(folder.join(format!("{name}.xyz")), text.collect::<String>())?;
        // A ten-millionth of the box.
        let most = 1e-7 * extent(&model)?.diagonal() * millimetres;
        std::fs::write(folder.join(format!("{name}.max")), most.to_string())?;
        std::fs::write(
            folder.join(format!("{name}.faces")),
            model.faces().len().to_string(),
        )?;
        println!("{name}: {} faces, {sizes:?} bytes", model.faces().len());
    }
    Ok(())
}

/// Points to go along: only one of the files has them.
fn scan_of(model: &Model, name: &str) -> Vec<DVec3> {
    let has = name == "with_points";
    let points = has.then(|| points_on(model));
    points.unwrap_or_default()
}

fn iges_of(model: &Model, name: &str) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let content = iges::IgesContent {
        model: Some(model),
        points: &scan_of(model, name),
        ..Default::default()
    };
    let options = iges::WriteOptions {
        file_name: format!("{name}.igs"),
        ..Default::default()
    };
    iges::write(&mut bytes, &content, &options)?;
    Ok(bytes)
}

fn step_of(model: &Model, name: &str, schema: step::Schema) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mass = mass(model)?;
    let options = step::WriteOptions {
        schema,
        points: &scan_of(model, name),
        file_name: format!("{name}.step"),
        validation: Some(step::Validation {
            area: mass.area,
            volume: mass.volume,
            centroid: mass.volume_centroid.unwrap_or(mass.centroid),
        }),
        ..Default::default()
    };
    step::write(&mut bytes, model, &options)?;
    Ok(bytes)
}

/// The shapes, each a model with a name, a colour, and names of its faces that need escaping.
fn shapes() -> Result<Vec<(&'static str, Model)>> {
    let at = DVec3::new(10.0, -20.0, 5.0);
    let axis = DVec3::new(1.0, 2.0, 2.0);
    let sphere = conic::sphere(at, 25.0)?;
    let mut all = vec![
        ("sheet", whole(&sheet(30, 30)?)?),
        ("tube", whole(&tube(8, 12)?)?),
        ("free_ball", turned_over(&ball(9, 12)?)?),
        ("sphere", whole(&sphere)?),
        ("sphere_turned", turned_over(&sphere.transposed())?),
        ("torus", whole(&conic::torus(at, axis, 30.0, 10.0)?)?),
        ("cone", whole(&conic::cone(at, axis, 20.0, 0.0)?)?),
        (
            "bordered_cone",
            changed(&conic::cone(at, axis, 20.0, 0.0)?, |face| {
                face.trimmed = true;
            })?,
        ),
        ("revolution", whole(&vase()?)?),
        ("two_faces", two_faces()?),
        ("round_hole", round_hole(false)?),
        ("round_hole_turned", round_hole(true)?),
        ("network_cube", samples::cube_network().to_model("")?),
        (
            "network_torus",
            samples::torus_network([4, 3], 4, [30.0, 10.0]).to_model("")?,
        ),
        ("network_open", samples::open_network().to_model("")?),
    ];
    // A solid and a sheet in one file, and points of a scan beside them.
    let mut mixed = whole(&sphere)?;
    mixed.add_whole_surface(&sheet(5, 6)?, 1e-9)?;
    all.push(("with_points", mixed));
    for (name, unit) in [
        ("inch", Unit::Inch),
        ("metre", Unit::Metre),
        ("foot", Unit::Foot),
    ] {
        let mut model = whole(&sheet(6, 7)?)?;
        model.unit = unit;
        all.push((name, model));
    }
    for (name, model) in &mut all {
        model.name = (*name).into();
        model.colour = Some([184, 134, 11]);
    }
    Ok(all)
}

/// A face that is all of a surface, and a solid where it closes.
fn whole(surface: &NurbsSurface) -> Result<Model> {
    let mut model = Model::new("");
    let [low, high] = surface.bounding_box();
    let face = model.add_whole_surface(surface, 1e-9 * (high - low).length())?;
    model.add_shell_of(face)?;
    Ok(model)
}

/// A solid of one surface whose normal points inwards: its face is reversed.
fn turned_over(surface: &NurbsSurface) -> Result<Model> {
    changed(surface, |face| face.reversed = true)
}

/// A model of one whole surface with its face changed.
fn changed(surface: &NurbsSurface, change: impl Fn(&mut Face)) -> Result<Model> {
    let source = whole(surface)?;
    let mut model = Model::new("");
    for &vertex in source.vertices() {
        model.add_vertex(vertex)?;
    }
    for edge in source.edges() {
        match &edge.curve {
            Some(curve) => model.add_edge(curve, edge.start, edge.end)?,
            None => model.add_degenerate_edge(edge.start)?,
        };
    }
    for face in source.faces() {
        let mut face = face.clone();
        change(&mut face);
        let face = model.add_face(face)?;
        model.add_shell_of(face)?;
    }
    Ok(model)
}

fn surface_of(knots: [KnotVector; 2], f: impl Fn(usize, usize) -> DVec3) -> Result<NurbsSurface> {
    let [ku, kv] = knots;
    let (m, n) = (ku.control_point_count(), kv.control_point_count());
    NurbsSurface::new(ku, kv, ControlNet::from_fn(m, n, f)?, None)
}

fn sheet(m: usize, n: usize) -> Result<NurbsSurface> {
    surface_of(
        [KnotVector::uniform(3, m)?, KnotVector::uniform(3, n)?],
        |i, j| {
            let (x, y) = (
                100.0 * i as f64 / (m - 1) as f64,
                80.0 * j as f64 / (n - 1) as f64,
            );
            DVec3::new(x, y, 6.0 * (0.07 * x).sin() * (0.09 * y).cos())
        },
    )
}

fn tube(m: usize, n: usize) -> Result<NurbsSurface> {
    let breaks: Vec<f64> = (0..=n).map(|i| i as f64 / n as f64).collect();
    surface_of(
        [
            KnotVector::uniform(3, m)?,
            KnotVector::periodic(3, &breaks)?,
        ],
        |i, j| {
            let angle = TAU * (j % n) as f64 / n as f64;
            let r = 20.0 + 3.0 * (0.8 * i as f64).sin() + 2.0 * (3.0 * angle).cos();
            DVec3::new(r * angle.cos(), r * angle.sin(), 9.0 * i as f64)
        },
    )
}

/// Closed along v, with a pole at each end of u.
fn ball(m: usize, n: usize) -> Result<NurbsSurface> {
    let breaks: Vec<f64> = (0..=n).map(|i| i as f64 / n as f64).collect();
    surface_of(
        [
            KnotVector::uniform(3, m)?,
            KnotVector::periodic(3, &breaks)?,
        ],
        |i, j| {
            let angle = TAU * (j % n) as f64 / n as f64;
            let up = std::f64::consts::PI * i as f64 / (m - 1) as f64;
            let r = if i == 0 || i == m - 1 {
                0.0
            } else {
                30.0 * up.sin()
            };
            DVec3::new(1.3 * r * angle.cos(), r * angle.sin(), -25.0 * up.cos())
        },
    )
}

fn vase() -> Result<NurbsSurface> {
    let profile = [
        (12.0, 0.0),
        (20.0, 10.0),
        (5.0, 25.0),
        (8.0, 40.0),
        (14.0, 45.0),
    ];
    let points = profile
        .iter()
        .map(|&(r, z)| DVec3::new(r, 0.0, z))
        .collect();
    let profile = NurbsCurve::new(KnotVector::uniform(3, 5)?, points, None)?;
    conic::revolve(&profile, DVec3::ZERO, DVec3::Z, TAU)
}

/// Two sheets side by side that share an edge; the second one is turned over, so that it is a reversed face.
fn two_faces() -> Result<Model> {
    let whole = sheet(9, 8)?;
    let [left, right] = whole.split(nurbskin::nurbs::Direction::U, 0.4)?;
    let right = right.reversed(nurbskin::nurbs::Direction::U)?;
    let mut model = Model::new("");
    let corner = |s: &NurbsSurface, u: usize, v: usize| {
        let [(a, b), (c, d)] = s.domain();
        s.point([a, b][u], [c, d][v])
    };
    let mut vertices = Vec::new();
    // 0, 1: the left side; 2, 3: the common one; 4, 5: the right side. Lower v first.
    for (s, u) in [(&left, 0), (&left, 1), (&right, 0)] {
        for v in 0..2 {
            vertices.push(model.add_vertex(corner(s, u, v))?);
        }
    }
    use nurbskin::nurbs::shape::Edge as Side;
    let side = |s: &NurbsSurface, side| s.edge_curve(side);
    let common = model.add_edge(&side(&left, Side::UMax)?, 2, 3)?;
    let far_left = model.add_edge(&side(&left, Side::UMin)?, 0, 1)?;
    let far_right = model.add_edge(&side(&right, Side::UMin)?, 4, 5)?;
    let mut low_high = Vec::new();
    for (s, ends) in [(&left, [0, 2]), (&right, [4, 2])] {
        for (k, which) in [Side::VMin, Side::VMax].into_iter().enumerate() {
            low_high.push(model.add_edge(&side(s, which)?, ends[0] + k, ends[1] + k)?);
        }
    }
    let faces = [
        (left, far_left, common, &low_high[..2], false),
        (right, far_right, common, &low_high[2..], true),
    ];
    let mut members = Vec::new();
    for (k, (surface, u_min, u_max, v_sides, reversed)) in faces.into_iter().enumerate() {
        let [(a, b), (c, d)] = surface.domain();
        let uses = [
            (v_sides[0], [a, c], [b, c], (a, b), false),
            (u_max, [b, c], [b, d], (c, d), false),
            (v_sides[1], [a, d], [b, d], (a, b), true),
            (u_min, [a, c], [a, d], (c, d), true),
        ];
        let uses = uses.into_iter().map(|(edge, from, to, range, reversed)| {
            Ok(EdgeUse {
                edge,
                reversed,
                pcurve: line(from, to, range)?,
            })
        });
        let loops = vec![Loop {
            uses: uses.collect::<Result<_>>()?,
        }];
        members.push(model.add_face(Face {
            surface,
            kind: SurfaceKind::BSpline,
            reversed,
            loops,
            trimmed: false,
            name: ["Blech 'links' ä", "right \\ 右"][k].into(),
        })?);
    }
    model.add_shell(Shell {
        faces: members,
        kind: ShellKind::Open,
    })?;
    Ok(model)
}

fn line(from: [f64; 2], to: [f64; 2], (a, b): (f64, f64)) -> Result<NurbsCurve> {
    let points = [from, to].map(|p| DVec3::new(p[0], p[1], 0.0)).to_vec();
    NurbsCurve::new(KnotVector::new(1, vec![a, a, b, b])?, points, None)
}

/// A bilinear patch in a plane, [0, 3] x [0, 2] times ten, trimmed by a rectangle with a round hole: in a plane the
/// curves in space are those of the parameter plane, exactly. `reversed`: seen from behind.
fn round_hole(reversed: bool) -> Result<Model> {
    let knots = |end: f64| KnotVector::clamped(1, &[0.0, end]);
    let place = |p: DVec3| DVec3::new(5.0 + 10.0 * p.x, 7.0 + 6.0 * p.y, 1.0 + 8.0 * p.y);
    let surface = surface_of([knots(3.0)?, knots(2.0)?], |i, j| {
        place(DVec3::new(3.0 * i as f64, 2.0 * j as f64, 0.0))
    })?;
    let mut model = Model::new("");
    let mut uses = Vec::new();
    let corners = [[0.25, 0.25], [2.75, 0.25], [2.5, 1.75], [0.5, 1.75]];
    for p in corners {
        model.add_vertex(place(DVec3::new(p[0], p[1], 0.0)))?;
    }
    for k in 0..4 {
        let pcurve = line(corners[k], corners[(k + 1) % 4], (0.0, 1.0))?;
        let edge = model.add_edge(&pcurve.map_points(place)?, k, (k + 1) % 4)?;
        uses.push(EdgeUse {
            edge,
            reversed: false,
            pcurve,
        });
    }
    // The circle turns counter-clockwise, and the face is on the left of the hole's loop: it runs backwards.
    let pcurve =
        conic::circle(DVec3::new(1.4, 1.0, 0.0), DVec3::Z, 0.5)?.map_points(|p| p.with_z(0.0))?;
    let start = model.add_vertex(place(pcurve.control_points()[0]))?;
    let edge = model.add_edge(&pcurve.map_points(place)?, start, start)?;
    let hole = EdgeUse {
        edge,
        reversed: true,
        pcurve,
    };
    let face = model.add_face(Face {
        surface,
        kind: SurfaceKind::Plane,
        reversed,
        loops: vec![Loop { uses }, Loop { uses: vec![hole] }],
        trimmed: true,
        name: "Platte".into(),
    })?;
    model.add_shell_of(face)?;
    Ok(model)
}

/// Points on all faces, those in a hole left out.
fn points_on(model: &Model) -> Vec<DVec3> {
    let mut points = Vec::new();
    for face in model.faces() {
        let [(a, b), (c, d)] = face.surface.domain();
        for k in 0..100 {
            let (s, t) = (f64::from(k % 10) / 9.0, f64::from(k / 10) / 9.0);
            let (u, v) = (a + (b - a) * s, c + (d - c) * t);
            // The plane is trimmed: its rectangle narrows upwards, its hole is a circle.
            let inside = u >= 0.25 + v / 6.0
                && u <= 2.75 - v / 6.0
                && (0.25..=1.75).contains(&v)
                && (u - 1.4).hypot(v - 1.0) >= 0.5;
            if face.kind != SurfaceKind::Plane || inside {
                points.push(face.surface.point(u, v));
            }
        }
    }
    points
}

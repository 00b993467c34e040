use super::*;
use crate::deviation::measure::{PointDeviation, measure_model};
use glam::{DVec2, DVec3, Vec3};
use nurbskin_cad::ClosestOnModel;
use nurbskin_cad::samples::{block, disk_with_hole};
use nurbskin_cad::{Model, Region};
use nurbskin_geometry::Unit;
use nurbskin_geometry::nurbs::conic;
use nurbskin_geometry::progress::Silent;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// A page of a model and points measured against it.
pub(super) struct Case {
    pub(super) model: Model,
    pub(super) points: Vec<DVec3>,
    pub(super) deviation: Vec<PointDeviation>,
    pub(super) spacing: f64,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) title: String,
}

impl Case {
    pub(super) fn new(model: Model, points: Vec<DVec3>, spacing: f64) -> Self {
        let target = ClosestOnModel::new(&model).unwrap();
        let found = measure_model(&target, &points, None, 0.1, &Silent).unwrap();
        Self {
            model,
            points,
            deviation: found.points,
            spacing,
            triangles: Vec::new(),
            title: "scan.ply".into(),
        }
    }

    pub(super) fn page(&self) -> String {
        let outcome = json!({
            "input": { "path": self.title, "points": self.points.len(), "unit": "mm", "unit_source": "assumed" },
            "tolerance": 0.1, "verdict": "pass", "reason": "as <b>it</b> is",
            "deviation": { "scan_to_surface": { "max": 0.1 }, "worst": [] },
            "outputs": [{ "path": "a.step", "format": "step", "bytes": 12345 }],
        });
        let subject = Subject {
            kind: Kind::Fit,
            title: &self.title,
            command: Some("nurbskin fit"),
            inputs: &[],
            heading: None,
            date: None,
            outcome: &outcome,
            unit: Unit::Millimetre,
            model: Some(&self.model),
            kinds: None,
            scan: Some(Measured {
                points: &self.points,
                deviation: Some(&self.deviation),
                spacing: self.spacing,
                triangles: &self.triangles,
                ..Measured::default()
            }),
            triangles: None,
            origin: DVec3::new(1e6, 0.0, 0.0),
        };
        page(&document(&subject, &Silent).unwrap()).unwrap()
    }
}

/// The data of a page.
pub(super) fn data(page: &str) -> Value {
    let from = page.find("id=\"data\">").unwrap() + "id=\"data\">".len();
    let length = page[from..].find("</script").unwrap();
    serde_json::from_str(&page[from..from + length]).unwrap()
}

pub(super) use super::packed::read::{floats, integers};

pub(super) fn vectors(value: &Value) -> Vec<Vec3> {
    floats(value)
        .chunks_exact(3)
        .map(Vec3::from_slice)
        .collect()
}

pub(super) fn directions(value: &Value) -> Vec<Vec3> {
    let found = super::packed::read::directions(value);
    found.into_iter().map(Vec3::from).collect()
}

/// Checks positions, normals and triangles: watertight except for `free` sides, oriented like the normals, fine enough.
fn mesh(data: &Value, free: impl Fn(Vec3) -> bool) -> (Vec<Vec3>, Vec<Vec3>) {
    let mesh = &data["mesh"];
    let (positions, normals) = (vectors(&mesh["positions"]), directions(&mesh["normals"]));
    let triangles: Vec<[u32; 3]> = integers(&mesh["triangles"]).as_chunks().0.to_vec();
    let corner = |k: usize| {
        let of = |i: usize| data["bounding_box"][k][i].as_f64().unwrap();
        DVec3::new(of(0), of(1), of(2))
    };
    let diagonal = corner(0).distance(corner(1));
    let mut sides: BTreeMap<[[u32; 3]; 2], i32> = BTreeMap::new();
    for triangle in &triangles {
        let [a, b, c] = triangle.map(|k| positions[k as usize]);
        let normal = (b - a).cross(c - a);
        for (k, &corner) in triangle.iter().enumerate() {
            assert!(normal.dot(normals[corner as usize]) > 0.0);
            let (p, q) = ([a, b, c][k], [a, b, c][(k + 1) % 3]);
            assert!(f64::from(p.distance(q)) < 2.0 * diagonal / 150.0);
            let bits = |p: Vec3| p.to_array().map(f32::to_bits);
            let (p, q) = (bits(p), bits(q));
            *sides.entry([p.min(q), p.max(q)]).or_default() += if p < q { 1 } else { -1 };
        }
    }
    for (ends, count) in sides {
        let on_free = ends
            .iter()
            .all(|p| free(Vec3::from_array(p.map(f32::from_bits))));
        assert!(count == 0 || on_free, "{ends:?}");
    }
    assert!(triangles.len() < 300_000);
    (positions, normals)
}

/// Points all over a sphere.
pub(super) fn fibonacci(count: u32, radius: f64) -> Vec<DVec3> {
    let at = |k: u32| {
        let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
        let (sin, cos) = (f64::from(k) * 2.399_963_229_728_653).sin_cos();
        radius * DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
    };
    (0..count).map(at).collect()
}

fn ball() -> Case {
    let mut model = Model::new("ball");
    let sphere = conic::sphere(DVec3::ZERO, 20.0).unwrap();
    model.add_whole_surface(&sphere, 1e-9).unwrap();
    Case::new(model, fibonacci(4000, 20.1), 1.1)
}

#[test]
fn a_sphere_bends_as_it_should_and_shows_a_shift() {
    let case = ball();
    let data = data(&case.page());
    let (positions, normals) = mesh(&data, |_| false);
    assert!(positions.len() > 10_000, "{}", positions.len());
    let mean = floats(&data["mesh"]["mean_curvature"]);
    let gaussian = floats(&data["mesh"]["gaussian_curvature"]);
    let deviation = floats(&data["mesh"]["deviation"]);
    for (k, p) in positions.iter().enumerate() {
        assert!((p.length() - 20.0).abs() < 1e-4);
        assert!(normals[k].dot(p / 20.0) > 0.9999);
        assert!((mean[k] - 1.0 / 20.0).abs() < 1e-5, "{} at {p}", mean[k]);
        assert!((gaussian[k] - 1.0 / 400.0).abs() < 1e-5);
        assert!((deviation[k] - 0.1).abs() < 1e-5);
    }
    assert_eq!(data["poles"].as_array().unwrap().len(), 2);
    assert_eq!(
        data["lines"]["seams"]["lengths"].as_array().unwrap().len(),
        1
    );
    assert_eq!(data["lines"].get("edges"), None);
    let origin: [f64; 3] = serde_json::from_value(data["origin"].clone()).unwrap();
    assert!(DVec3::from(origin).distance(DVec3::X * 1e6) < 1e-6);
    assert_eq!(data["faces"][0]["degree"], json!([2, 2]));
    assert_eq!(data["verdict"]["verdict"], "pass");
    assert_eq!(data["statistics"]["hold_out"], Value::Null);
    let histogram = &data["histogram"];
    let counts: Vec<u64> = serde_json::from_value(histogram["counts"].clone()).unwrap();
    assert_eq!(counts.iter().sum::<u64>(), 4000);
    let worst = data["worst"].as_array().unwrap();
    assert_eq!(worst.len(), 10);
    for place in worst {
        let at = |key: &str| serde_json::from_value::<[f64; 3]>(place[key].clone()).unwrap();
        let (point, foot) = (DVec3::from(at("point")), DVec3::from(at("foot")));
        assert!((point.distance(foot) - 0.1).abs() < 1e-9);
        assert!((place["deviation"].as_f64().unwrap() - 0.1).abs() < 1e-9);
    }
    for (key, lines) in data["lines"].as_object().unwrap() {
        let on = if key == "control_net" {
            0.0..40.0
        } else {
            19.99..20.01
        };
        let positions = vectors(&lines["positions"]);
        assert!(positions.iter().all(|p| on.contains(&p.length())), "{key}");
        let lengths: Vec<usize> = serde_json::from_value(lines["lengths"].clone()).unwrap();
        assert_eq!(lengths.iter().sum::<usize>(), positions.len());
    }
}

#[test]
fn a_torus_has_the_curvatures_of_the_formula() {
    let mut model = Model::new("ring");
    let torus = conic::torus(DVec3::ZERO, DVec3::Z, 30.0, 10.0).unwrap();
    model.add_whole_surface(&torus, 1e-9).unwrap();
    let case = Case::new(model, vec![DVec3::new(45.0, 0.0, 0.0)], 0.5);
    let data = data(&case.page());
    let (positions, _) = mesh(&data, |_| false);
    let mean = floats(&data["mesh"]["mean_curvature"]);
    let gaussian = floats(&data["mesh"]["gaussian_curvature"]);
    for (k, p) in positions.iter().enumerate() {
        let cos = (p.truncate().length() - 30.0) / 10.0;
        let k_expected = cos / (10.0 * (30.0 + 10.0 * cos));
        let h_expected = (30.0 + 20.0 * cos) / (20.0 * (30.0 + 10.0 * cos));
        assert!((gaussian[k] - k_expected).abs() < 1e-5);
        assert!((mean[k] - h_expected).abs() < 1e-5);
    }
    // One point colours only the region around its foot point.
    let deviation = floats(&data["mesh"]["deviation"]);
    for (p, d) in positions.iter().zip(&deviation) {
        let near = p.distance(Vec3::new(40.0, 0.0, 0.0));
        assert!((near > 1.51) == d.is_nan() || (near - 1.5).abs() < 0.01);
        assert!(d.is_nan() || (d - 5.0).abs() < 1e-5);
    }
    assert_eq!(
        data["lines"]["seams"]["lengths"].as_array().unwrap().len(),
        2
    );
}

/// Whether a place is on a loop of the disk of radius 4 with a hole of radius 1 around (1, 0).
fn on_loop(p: Vec3) -> bool {
    let centre = Vec3::new(1.0, 0.0, 0.0);
    (p.length() - 4.0).abs() < 0.02 || (p.distance(centre) - 1.0).abs() < 0.02
}

#[test]
fn a_trimmed_sheet_ends_at_its_loops_and_is_bare_where_the_scan_is() {
    let model = disk_with_hole([4.0, 1.0], [0.0, 1.0]);
    // Points 0.1 under the plane, none within 1.5 of (-2.4, 0) and outside it, as in a scan with a gap.
    let mut points = Vec::new();
    for k in 0..200 * 200 {
        let at = DVec2::new(f64::from(k % 200), f64::from(k / 200)) * 0.05 - 4.975;
        if at.distance(DVec2::new(-2.4, 0.0)) > 1.0 && at.length() < 3.99 {
            points.push(at.extend(-0.1));
        }
    }
    let count = points.len();
    let case = Case::new(model, points, 0.05);
    let data = data(&case.page());
    let (positions, _) = mesh(&data, on_loop);
    let deviation = floats(&data["mesh"]["deviation"]);
    let mean = floats(&data["mesh"]["mean_curvature"]);
    for (k, p) in positions.iter().enumerate() {
        let bare = p.distance(Vec3::new(-2.4, 0.0, 0.0));
        if bare < 1.0 - 0.15 {
            assert!(deviation[k].is_nan(), "{p}");
        } else if bare > 1.0 {
            assert!((deviation[k] + 0.1).abs() < 1e-6, "{p}: {}", deviation[k]);
        }
        assert!(mean[k].abs() < 1e-6);
    }
    // Lines of parameters stay on the face, up to its loops.
    let face = &case.model.faces()[0];
    let region = Region::new(face).unwrap();
    let iso = vectors(&data["lines"]["iso_curves"]["positions"]);
    let off = |p: &&Vec3| {
        let place = (p.truncate().as_dvec2() + 5.0) / 10.0;
        !region.contains(place) && region.nearest(place).distance > 1e-5
    };
    assert_eq!(iso.iter().filter(off).count(), 0);
    assert!(iso.iter().any(|&p| on_loop(p)) && iso.len() > 30);
    assert_eq!(
        data["lines"]["edges"]["lengths"].as_array().unwrap().len(),
        3
    );
    let shown = data["points"]["shown"].as_u64().unwrap();
    assert_eq!(
        [shown, data["points"]["total"].as_u64().unwrap()],
        [count as u64; 2]
    );
}

#[test]
fn large_triangles_have_data_under_them() {
    let model = disk_with_hole([4.0, 1.0], [0.0, 1.0]);
    let at = |x: f64, y: f64| DVec3::new(x, y, 0.1);
    let points = vec![at(-3.0, -2.0), at(-3.0, 2.0), at(-0.5, -2.0), at(-0.5, 2.0)];
    let mut case = Case::new(model, points, 0.1);
    case.triangles = vec![[0, 2, 1], [2, 3, 1]];
    let data = data(&case.page());
    let (positions, _) = mesh(&data, on_loop);
    let deviation = floats(&data["mesh"]["deviation"]);
    let inside = |p: &Vec3| p.x > -3.0 && p.x < -0.5 && p.y.abs() < 2.0;
    assert!(positions.iter().any(inside));
    for (p, d) in positions.iter().zip(&deviation).filter(|(p, _)| inside(p)) {
        assert!((d - 0.1).abs() < 1e-6, "{p}: {d}");
    }
}

#[test]
fn the_two_sides_of_a_crease_keep_to_themselves() {
    // The scan of the top of a box has an offset of 0.2; its sides have no points.
    let model = block(DVec3::new(10.0, 10.0, 10.0));
    let top = model.faces().iter().position(|face| {
        let [low, high] = face.surface.bounding_box();
        low.z > 9.0 && high.z > 9.0
    });
    let top = u32::try_from(top.unwrap()).unwrap();
    let points: Vec<DVec3> = (0..2500)
        .map(|k| DVec3::new(f64::from(k % 50) + 0.5, f64::from(k / 50) + 0.5, 51.0) / 5.0)
        .collect();
    let target = ClosestOnModel::new(&model).unwrap();
    let found = measure_model(&target, &points, None, 0.1, &Silent).unwrap();
    let subject = Subject {
        kind: Kind::Deviation,
        title: "box",
        command: None,
        inputs: &[],
        heading: None,
        date: None,
        outcome: &Value::Null,
        unit: Unit::Inch,
        model: Some(&model),
        kinds: None,
        scan: Some(Measured {
            points: &points,
            deviation: Some(&found.points),
            spacing: 0.2,
            ..Measured::default()
        }),
        triangles: None,
        origin: DVec3::ZERO,
    };
    let data = serde_json::to_value(document(&subject, &Silent).unwrap()).unwrap();
    mesh(&data, |_| false);
    let deviation = floats(&data["mesh"]["deviation"]);
    for (d, face) in deviation
        .iter()
        .zip(integers(&data["mesh"]["vertex_faces"]))
    {
        assert_eq!(d.is_nan(), face != top);
        assert!(d.is_nan() || (d.abs() - 0.2).abs() < 1e-6);
    }
    assert_eq!(data["faces"].as_array().unwrap().len(), 6);
    assert_eq!(
        data["lines"]["edges"]["lengths"].as_array().unwrap().len(),
        12
    );
}

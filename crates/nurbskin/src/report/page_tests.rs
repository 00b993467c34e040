use super::tests::{Case, data, directions, fibonacci, integers, vectors};
use super::*;
use crate::deviation::measure::Unused;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::{DVec3, Vec3};
use nurbskin_cad::Model;
use nurbskin_cad::samples::square;
use nurbskin_geometry::Unit;
use nurbskin_geometry::progress::Silent;
use nurbskin_scan::{Reason, Records};
use serde_json::{Value, json};
use std::io::Read;

/// Points that are not used.
fn unused<const N: usize>(points: [(u32, DVec3, Reason); N]) -> [Unused; N] {
    points.map(|(index, point, reason)| Unused {
        index,
        point,
        reason,
        deviation: None,
    })
}

/// The page of a cloud alone, in metres.
fn viewed(scan: Measured<'_>) -> Subject<'_> {
    Subject {
        kind: Kind::View,
        title: "cloud.xyz",
        command: None,
        inputs: &[],
        heading: None,
        date: None,
        outcome: &Value::Null,
        unit: Unit::Metre,
        model: None,
        kinds: None,
        scan: Some(scan),
        triangles: None,
        origin: DVec3::ZERO,
    }
}

#[test]
fn points_alone_and_nothing_at_all_are_pages_too() {
    let points: Vec<DVec3> = fibonacci(250_000, 5.0);
    let unused = unused([
        (7, DVec3::X * 90.0, Reason::Outlier),
        (9, DVec3::NAN, Reason::NonFinite),
    ]);
    let subject = viewed(Measured {
        points: &points,
        unused: &unused,
        spacing: 0.03,
        ..Measured::default()
    });
    let found = data(&page(&document(&subject, &Silent).unwrap()).unwrap());
    assert_eq!(found["points"]["shown"], 200_000);
    assert_eq!(found["points"]["total"], 250_001);
    assert_eq!([&found["mesh"], &found["histogram"]], [&Value::Null; 2]);
    let state = integers(&found["points"]["state"]);
    assert_eq!(state.iter().filter(|s| **s == 3).count(), 1);
    let index = integers(&found["points"]["index"]);
    assert!(index.is_sorted() && index.len() == 200_000);
    // An even sample: an eighth of the sphere holds an eighth of the points.
    let positions = vectors(&found["points"]["positions"]);
    let eighth = positions.iter().filter(|p| p.min_element() > 0.0).count();
    assert!((24_300..25_700).contains(&eighth), "{eighth}");
    let nothing = Subject {
        scan: None,
        ..subject
    };
    let found = data(&page(&document(&nothing, &Silent).unwrap()).unwrap());
    assert_eq!(
        found["bounding_box"],
        json!([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    );
}

#[test]
fn points_have_the_numbers_of_their_records() {
    let points = fibonacci(5, 1.0);
    let unused = unused([
        (1, DVec3::X, Reason::Duplicate),
        (2, DVec3::NAN, Reason::NonFinite),
    ]);
    let records = Records::new(vec![2, 3, 5, 6, 7, 8, 9], 12).unwrap();
    let subject = viewed(Measured {
        points: &points,
        indices: &[0, 3, 4, 5, 6],
        unused: &unused,
        records: Some(&records),
        ..Measured::default()
    });
    let found = data(&page(&document(&subject, &Silent).unwrap()).unwrap());
    assert_eq!(integers(&found["points"]["index"]), [2, 3, 6, 7, 8, 9]);
    let absent = integers(&found["points"]["not_finite"]);
    assert_eq!(absent, [0, 1, 4, 5, 10, 11]);
}

#[test]
fn a_comparison_has_tables_of_its_own() {
    let outcome = json!({
        "input": { "path": "scan.ply", "points": 9 },
        "cad": { "path": "part.step", "faces": 2, "entities": { "CARTESIAN_POINT": 111 }, "unread": { "FACE": 3 } },
        "tolerance": 0.1, "within": 0.995, "min_coverage": 0.9,
        "time": { "read": 0.5, "align": 2.0, "order": 0.0, "total": 3.0 },
    });
    let found = tables::tables(&outcome, Unit::Millimetre);
    let titles: Vec<&str> = found.iter().map(|table| table.title).collect();
    assert_eq!(titles, ["Read", "Surface", "Compared", "Time"]);
    // The entities of a file are not listed, only the missing ones.
    let rows = &found[1].rows;
    assert!(rows.iter().all(|row| row[0] != "entities"));
    assert!(rows.contains(&vec!["not understood".to_owned(), "3 of FACE".to_owned()]));
    let row = |table: usize, name: &str| {
        let mut rows = found[table].rows.iter();
        rows.find(|row| row[0] == name).map(|row| row[1].clone())
    };
    assert_eq!(row(2, "tolerance").as_deref(), Some("0.1 mm"));
    assert_eq!(
        row(2, "within it, asked").as_deref(),
        Some("99.5 % of the points")
    );
    assert_eq!(
        row(2, "with data, asked").as_deref(),
        Some("90 % of the area")
    );
    assert_eq!(row(3, "align").as_deref(), Some("2.00\u{a0}s"));
    assert_eq!(row(3, "order"), None);
    let unasked = json!({
        "surface": {}, "tolerance": null, "within": null, "aim": { "value": 0.0126, "source": "the noise" },
        "parts": [{ "points": 1, "scan_to_surface": { "max": 0.5, "within_tolerance": null }, "verdict": "not_asked" }],
    });
    let found = tables::tables(&unasked, Unit::Millimetre);
    assert_eq!(found[0].title, "Fitted");
    assert_eq!(
        found[0].rows,
        [["aim", "12.6 um"], ["aim from", "the noise"]]
    );
    let cells = [
        "part 1",
        "1 point",
        " control points",
        "at most 0.5 mm",
        "not asked",
    ];
    assert_eq!(found[1].rows, [cells]);
}

#[test]
fn a_page_has_the_reasons_and_the_chronicle() {
    let reason =
        json!({ "what": "it crosses itself", "where": [1.0, 2.0, 3.0], "next": "allow more" });
    let outcome = json!({
        "verdict": "fail", "reason": "it crosses itself", "reasons": [reason],
        "within": 0.995, "tolerance": 0.1, "details": ["1 hole is filled"],
    });
    let subject = Subject {
        kind: Kind::View,
        title: "scan",
        command: None,
        inputs: &[],
        heading: None,
        date: None,
        outcome: &outcome,
        unit: Unit::Metre,
        model: None,
        kinds: None,
        scan: None,
        triangles: None,
        origin: DVec3::ZERO,
    };
    let found = serde_json::to_value(document(&subject, &Silent).unwrap()).unwrap();
    assert_eq!(found["verdict"]["reasons"], json!([reason]));
    assert_eq!(found["details"], json!(["1 hole is filled"]));
    assert_eq!(found["within"], 0.995);
}

#[test]
fn a_page_has_what_control_points_buy() {
    let point = |n: usize, p95: f64| json!({ "control_points": n, "p95": p95, "max": 2.0 * p95, "tolerance": p95 });
    let outcome = |points: &[Value]| {
        let neighbours = json!([{ "tolerance": 0.2, "control_points": 80, "extrapolated": false }]);
        json!({ "surface": { "control_points": [10, 12], "trade": points, "knee": 120, "neighbours": neighbours } })
    };
    let found = trade::trade(
        &outcome(&[point(60, 0.3), point(120, 0.1)]),
        Unit::Millimetre,
    )
    .unwrap();
    assert_eq!(
        (found.points.len(), found.chosen, found.knee),
        (2, 120, Some(120))
    );
    let said = "-t 0.2mm would take about 80 control points";
    assert_eq!(found.neighbours.as_deref(), Some(said));
    // One point is no curve, and zero has no logarithm.
    for points in [vec![point(120, 0.1)], vec![point(60, 0.3), point(120, 0.0)]] {
        assert_eq!(trade::trade(&outcome(&points), Unit::Millimetre), None);
    }
    assert_eq!(trade::trade(&json!({}), Unit::Millimetre), None);
}

#[test]
fn a_mesh_is_shown_as_it_is() {
    let points = [DVec3::ZERO, DVec3::NAN, DVec3::X, DVec3::Y, DVec3::Z];
    let triangles = [[0, 3, 2], [0, 1, 2], [0, 2, 9], [0, 2, 4]];
    let subject = Subject {
        kind: Kind::View,
        title: "mesh.stl",
        command: None,
        inputs: &[],
        heading: None,
        date: None,
        outcome: &Value::Null,
        unit: Unit::Metre,
        model: None,
        kinds: None,
        scan: Some(Measured {
            points: &points,
            ..Measured::default()
        }),
        triangles: Some(&triangles),
        origin: DVec3::ZERO,
    };
    let found = serde_json::to_value(document(&subject, &Silent).unwrap()).unwrap();
    assert_eq!(integers(&found["mesh"]["triangles"]), [0, 2, 1, 0, 1, 3]);
    assert_eq!(vectors(&found["mesh"]["positions"]).len(), 4);
    assert!(directions(&found["mesh"]["normals"])[2].distance(Vec3::NEG_Z) < 1e-6);
}

#[test]
fn hostile_names_stay_text_and_pages_are_the_same_for_any_threads() {
    // On a small part of a sheet, for speed.
    let mut model = Model::new("sheet");
    model.add_whole_surface(&square(1, 2), 1e-9).unwrap();
    let mut case = Case::new(model, vec![DVec3::Z], 0.1);
    case.title = "</script><script>alert(1)</script>/*DATA*//*SCRIPT*/".into();
    let hostile = case.page();
    let ends = |page: &str| page.matches("</script").count();
    let value = data(&hostile);
    assert_eq!(value["title"], case.title.as_str());
    assert_eq!(value["tables"][0]["rows"][0][1], case.title.as_str());
    assert_eq!(value["verdict"]["reason"], "as <b>it</b> is");
    assert!(!hostile.contains("<script>alert"));
    case.title = "a".into();
    let plain = case.page();
    assert_eq!(ends(&hostile), ends(&plain));
    {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        assert!(plain == pool.unwrap().install(|| case.page()));
    }
    // Only the placeholders of the template are filled.
    assert!(!plain.contains("/*DATA*/") && !plain.contains("/*SCRIPT*/"));
}

#[test]
fn a_page_has_its_script_compressed_with_the_licence_of_what_is_in_it() {
    let empty = page(&document(&nothing(Kind::View, &Value::Null), &Silent).unwrap()).unwrap();
    let start = empty.split("id=\"script\">").nth(1).unwrap();
    let packed = STANDARD.decode(start.split('<').next().unwrap()).unwrap();
    let mut script = String::new();
    let mut decoder = flate2::read::DeflateDecoder::new(packed.as_slice());
    decoder.read_to_string(&mut script).unwrap();
    assert_eq!(script, include_str!("page/page.js"));
    assert!(script.contains("three.js authors") && script.contains("The MIT License"));
    // Pages must not swell.
    assert!(empty.len() < 220_000, "{}", empty.len());
}

#[test]
fn a_model_too_fine_to_show_is_shown_coarser() {
    // A degenerate sheet of no area still ends.
    let mut model = Model::new("flat");
    model.add_whole_surface(&square(1, 2), 1e-9).unwrap();
    let flat = model.map_points(|p| DVec3::new(p.x, 0.0, 0.0)).unwrap();
    let case = Case {
        model: flat,
        points: Vec::new(),
        deviation: Vec::new(),
        spacing: 0.0,
        triangles: Vec::new(),
        title: String::new(),
    };
    let found = data(&case.page());
    assert!(found["lines"].is_object());
}

/// The subject of a page with nothing in it.
fn nothing<'a>(kind: Kind, outcome: &'a Value) -> Subject<'a> {
    Subject {
        kind,
        title: "scan.ply",
        command: None,
        inputs: &[],
        heading: None,
        date: None,
        outcome,
        unit: Unit::Millimetre,
        model: None,
        kinds: None,
        scan: None,
        triangles: None,
        origin: DVec3::ZERO,
    }
}

#[test]
fn a_page_has_the_fields_that_people_give() {
    let notes = [
        "lot=7",
        "operator=A. <b>",
        "revision=C",
        "PART=Blade",
        "lot=8",
    ];
    let heading = Heading {
        title: Some("First article".into()),
        notes: notes.map(|note| note.parse().unwrap()).to_vec(),
    };
    let date = nurbskin_cad::io::Timestamp::new(2007, 1, 29, 10, 54, 34).unwrap();
    let aligned = json!({ "alignment": { "rotation_deg": 1.5, "translation": [3.0, 4.0, 0.0] } });
    let subject = Subject {
        heading: Some(&heading),
        date: Some(date),
        ..nothing(Kind::Deviation, &aligned)
    };
    let found = serde_json::to_value(document(&subject, &Silent).unwrap()).unwrap();
    assert_eq!(found["title"], "First article");
    let pairs = |found: &Value| -> Vec<String> {
        let fields = found["fields"].as_array().unwrap().iter();
        let text = |f: &Value| format!("{}: {}", f["key"], f["text"]).replace('"', "");
        fields.map(text).collect()
    };
    assert_eq!(
        pairs(&found),
        [
            "date: 2007-01-29 10:54:34 UTC",
            "PART: Blade",
            "revision: C",
            "operator: A. <b>",
            "alignment: best fit: turned by 1.5°, moved by 5 mm",
            "lot: 8",
        ]
    );
    // What people say on the alignment counts; without an alignment it says so, and a fit has none.
    let said = Heading {
        title: None,
        notes: vec!["alignment=datums A, B, C".parse().unwrap()],
    };
    let not = json!({ "alignment": null });
    let with = |kind, heading| {
        let subject = Subject {
            heading,
            ..nothing(kind, &not)
        };
        serde_json::to_value(document(&subject, &Silent).unwrap()).unwrap()
    };
    let found = with(Kind::Deviation, Some(&said));
    assert_eq!(found["title"], "scan.ply");
    assert_eq!(pairs(&found), ["alignment: datums A, B, C"]);
    assert_eq!(
        pairs(&with(Kind::Deviation, None)),
        ["alignment: as scanned, not moved"]
    );
    assert!(pairs(&with(Kind::Fit, None)).is_empty());
}

#[test]
fn a_page_has_the_joins_and_the_deviation_of_its_faces() {
    let network = nurbskin_cad::samples::torus_network([3, 4], 2, [30.0, 10.0]);
    let model = network.to_model("ring").unwrap();
    let kinds: Vec<_> = network.edges.iter().map(|edge| edge.kind).collect();
    let case = Case::new(model, fibonacci(500, 30.0), 2.0);
    let outcome = json!({ "tolerance": 0.5 });
    let subject = Subject {
        model: Some(&case.model),
        kinds: Some(&kinds),
        scan: Some(Measured {
            points: &case.points,
            deviation: Some(&case.deviation),
            ..Measured::default()
        }),
        ..nothing(Kind::Fit, &outcome)
    };
    let found = serde_json::to_value(document(&subject, &Silent).unwrap()).unwrap();
    let joins = found["joins"].as_array().unwrap();
    let lengths = found["lines"]["edges"]["lengths"].as_array().unwrap();
    assert!(joins.len() > 1 && joins.len() == lengths.len());
    for join in joins {
        assert_eq!(join["kind"], "smooth");
        assert_eq!(join["faces"].as_array().unwrap().len(), 2);
        let angle = |key: &str| join[key].as_f64().unwrap();
        assert!(angle("sampled") <= angle("bound") && angle("length") > 0.0);
    }
    let faces = found["faces"].as_array().unwrap();
    let counts = faces
        .iter()
        .map(|f| f["deviation"]["count"].as_u64().unwrap());
    assert_eq!(counts.sum::<u64>(), 500);
    for face in faces {
        let d = &face["deviation"];
        let beyond =
            d["above_tolerance"].as_u64().unwrap_or(0) + d["below_tolerance"].as_u64().unwrap_or(0);
        let within = d["within_tolerance"].as_f64().unwrap_or(1.0);
        let count = d["count"].as_f64().unwrap();
        assert!((within * count + beyond as f64 - count).abs() < 1e-6);
    }
}

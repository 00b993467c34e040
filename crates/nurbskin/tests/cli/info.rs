//! `info`: scans and CAD files in numbers.

use super::{Bench, counts, number, text};

#[test]
fn scans_in_numbers() {
    let bench = Bench::with_scan("tube --points 600 --noise 0.01 -o tube.ply");
    let found = bench.json("info tube.ply", 0);
    let file = &found["files"][0];
    assert_eq!(file["path"], "tube.ply");
    for (key, value) in [
        ("kind", "scan"),
        ("format", "ply"),
        ("unit", "mm"),
        ("unit_source", "file"),
    ] {
        assert_eq!(file[key], value, "{found:#}");
    }
    assert_eq!(file["points"], 600);
    assert!(file["warnings"].is_array() && file["normals"].is_boolean());
    assert_eq!(file["rejected"]["non_finite"], 0);
    assert_eq!(text(file, "/topology"), "tube");
    assert!(number(file, "/noise") < 0.03 && number(file, "/spacing") > 0.1);
    assert!(number(file, "/bounding_box/1/0") > number(file, "/bounding_box/0/0"));
    let [m, n] = counts(file, "/grid");
    assert_eq!(
        (m * n, &file["parts"], &file["triangles"]),
        (600, &1.into(), &serde_json::Value::Null)
    );
    let shown = bench.run("info tube.ply");
    assert_eq!((shown.status, shown.stderr.as_str()), (0, ""));
    for word in [
        "tube.ply:\nsize        ",
        "unit        mm (from the file)",
        "scan        600 points, grid of",
        "topology    tube",
    ] {
        assert!(shown.stdout.contains(word), "{word}: {}", shown.stdout);
    }
}

#[test]
fn surfaces_in_numbers() {
    let bench = Bench::with_scan("patch -o patch.ply");
    bench.run("fit patch.ply -o patch.igs --rarefy off --quiet");
    let found = bench.json("info patch.igs", 0);
    let file = &found["files"][0];
    assert_eq!(
        (&file["kind"], &file["format"]),
        (&"cad".into(), &"iges".into())
    );
    assert_eq!(
        (&file["faces"], &file["entities"]["128"]),
        (&1.into(), &1.into())
    );
    assert_eq!(counts(file, "/surfaces/0/control_points"), [4, 4]);
    assert_eq!(counts(file, "/surfaces/0/degree"), [3, 3]);
    assert!(number(file, "/area") > 0.0);
    let shown = bench.run("info patch.igs").stdout;
    for words in [
        "patch.igs:\nsize        ",
        "model       0 solids, 1 shell, 1 face, open, area ",
        "system      nurbskin",
        "surface     B-spline, 4 x 4 control points, degree 3",
    ] {
        assert!(shown.contains(words), "{words}: {shown}");
    }
    // Entities, with their numbers, on demand only.
    assert!(!shown.contains("entities"), "{shown}");
    let shown = bench.run("info patch.igs -v").stdout;
    assert!(shown.contains("entities"), "{shown}");
}

#[test]
fn it_goes_on_after_a_failure() {
    let bench = Bench::with_scan("patch -o patch.ply");
    bench.write("bad.ply", "ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\nproperty float y\nend_header\n1 2\n");
    bench.write("few.xyz", "0 0 0\n1 0 0\n");
    bench.write("part.step", "ISO-10303-21;\n");
    let done = bench.run("info bad.ply none.ply patch.ply few.xyz part.step --json");
    assert_eq!(
        (done.status, done.stderr.lines().count()),
        (1, 3),
        "{done:?}"
    );
    let found: serde_json::Value = serde_json::from_str(&done.stdout).unwrap();
    let files = found["files"].as_array().unwrap();
    assert_eq!(files.len(), 5);
    for k in [0, 1, 4] {
        assert_eq!(text(&files[k], "/error/kind"), "read", "{}", files[k]);
    }
    assert_eq!(files[2]["points"], 16);
    // Too few for a surface is no failure of reading.
    assert_eq!(files[3]["points"], 2);
    assert!(files[3]["spacing"].is_null() && files[3]["warnings"].as_array().unwrap().len() == 1);
    bench.refuses("info none.ply", 1, "no such file");
    bench.refuses("info bad.ply", 1, "truncated");
}

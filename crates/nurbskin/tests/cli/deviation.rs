//! `deviation`: a scan against a CAD file.

use super::{Bench, number, points, text};

/// Writes the points of a scan moved by `f`.
fn moved(bench: &Bench, from: &str, to: &str, f: impl Fn([f64; 3]) -> [f64; 3]) {
    let lines = points(&bench.path(from)).into_iter().map(|p| {
        let [x, y, z] = f(p);
        format!("{x} {y} {z}\n")
    });
    bench.write(to, lines.collect::<String>());
}

#[test]
fn a_larger_ball_is_that_much_outside() {
    let bench = Bench::with_scan("sphere --points 3000 --shuffled -o ball.xyz");
    assert_eq!(
        bench
            .run("fit ball.xyz -t 0.005 -o ball.step -o ball.igs")
            .status,
        0
    );
    let all = points(&bench.path("ball.xyz"));
    let middle = [0, 1, 2].map(|k| {
        let (low, high) = all
            .iter()
            .fold((f64::MAX, f64::MIN), |(a, b), p| (a.min(p[k]), b.max(p[k])));
        f64::midpoint(low, high)
    });
    let radius = super::distance(all[0], middle);
    moved(&bench, "ball.xyz", "larger.xyz", |p| {
        [0, 1, 2].map(|k| middle[k] + (p[k] - middle[k]) * (radius + 0.25) / radius)
    });
    for cad in ["ball.step", "ball.igs"] {
        let found = bench.json(&format!("deviation larger.xyz {cad} -t 0.3"), 0);
        for key in ["signed_min", "signed_max", "mean", "max"] {
            let value = number(&found, &format!("/deviation/scan_to_surface/{key}"));
            assert!((value - 0.25).abs() < 0.003, "{cad} {key}: {value}");
        }
        assert_eq!(found["deviation"]["scan_to_surface"]["count"], 3000);
        assert_eq!(found["deviation"]["free_edges"]["count"], 0);
        assert_eq!(found["alignment"], serde_json::Value::Null);
        assert_eq!(
            (text(&found, "/cad/path"), text(&found, "/verdict")),
            (cad, "pass")
        );
        assert_eq!(
            (&found["cad"]["faces"], &found["input"]["used"]),
            (&1.into(), &3000.into())
        );
    }
    // Not within 0.1, and said so.
    let failed = bench.json("deviation larger.xyz ball.step -t 0.1", 3);
    assert_eq!(text(&failed, "/verdict"), "fail");
}

#[test]
fn a_moved_scan_is_put_back_in_place() {
    let bench = Bench::with_scan("patch -o patch.xyz");
    bench.run("fit patch.xyz -o patch.step --rarefy off --quiet");
    let (sin, cos) = 0.01_f64.sin_cos();
    moved(&bench, "patch.xyz", "moved.xyz", |[x, y, z]| {
        [cos * x - sin * y + 0.2, sin * x + cos * y - 0.1, z + 0.3]
    });
    let off = bench.json("deviation moved.xyz patch.step -t 0.01", 3);
    let found = bench.json(
        "deviation moved.xyz patch.step -t 0.01 --align --report all.csv --report all.json",
        0,
    );
    assert!(number(&off, "/deviation/scan_to_surface/max") > 0.1);
    let before = number(&found, "/alignment/rms_before");
    assert!((before - number(&off, "/deviation/scan_to_surface/rms")).abs() < 0.1 * before);
    assert!(number(&found, "/alignment/rms_after") < 1e-3);
    let turned = number(&found, "/alignment/rotation_deg");
    assert!((turned - 0.01_f64.to_degrees()).abs() < 0.01, "{turned}");
    let rows = bench.read("all.csv");
    let count = found["input"]["points"].as_u64().unwrap();
    assert_eq!(rows.lines().count() as u64, count + 1);
    assert!(rows.starts_with("index,x,y,z,deviation,lower,upper,u,v,face,state\n"));
    assert_eq!(found["outputs"].as_array().unwrap().len(), 2);
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let bench = Bench::with_scan("patch -o patch.xyz");
    bench.run("fit patch.xyz -o patch.step --rarefy off --quiet");
    bench.refuses("deviation patch.step patch.xyz", 1, "name the scan first");
    bench.refuses("deviation none.xyz patch.step", 1, "none.xyz");
    bench.refuses(
        "deviation patch.xyz patch.step --report patch.step",
        2,
        "also an input",
    );
    bench.refuses("deviation patch.xyz patch.step --report a.dat", 2, ".dat");
    bench.write(
        "empty.step",
        "ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n",
    );
    bench.refuses("deviation patch.xyz empty.step", 1, "empty.step");
}

#[test]
fn without_a_tolerance_there_are_figures_and_no_verdict() {
    let bench = Bench::with_scan("patch -o patch.xyz");
    bench.run("fit patch.xyz -o patch.step --rarefy off --quiet");
    let found = bench.json("deviation patch.xyz patch.step", 0);
    assert_eq!(text(&found, "/verdict"), "not_asked");
    assert!(found["tolerance"].is_null() && found["within"].is_null());
    assert!(number(&found, "/deviation/scan_to_surface/p95") >= 0.0);
    let shown = bench.run("deviation patch.xyz patch.step");
    assert_eq!(shown.status, 0);
    for words in [
        "scan  ",
        "nominal  ",
        "1 face,",
        "coverage  ",
        "verdict     not asked",
    ] {
        assert!(shown.stdout.contains(words), "{words}: {}", shown.stdout);
    }
}

#[test]
fn sizes_that_do_not_go_together_are_said() {
    let bench = Bench::with_scan("patch -o patch.xyz");
    bench.run("fit patch.xyz -o patch.step --rarefy off --quiet");
    moved(&bench, "patch.xyz", "metres.xyz", |p| p.map(|x| 1e-3 * x));
    let found = bench.json("deviation metres.xyz patch.step -t 1000", 3);
    assert_eq!(text(&found, "/verdict"), "cannot_tell");
    let reasons = found["reasons"].to_string();
    assert!(
        reasons.contains("times smaller than the nominal"),
        "{reasons}"
    );
    assert!(reasons.contains("--unit m"), "{reasons}");
}

//! `fit`: the JSON contract and every option.

use super::{Bench, counts, number, text};
use serde_json::Value;

/// Every key of the contract, with the kind of its value: n number, s text, b truth, i whole number, 2 a pair of whole
/// numbers, t a pair of truths.
const CONTRACT: &str = "
    s /nurbskin  i /schema
    s /input/path  s /input/format  i /input/points  i /input/used
    i /input/rejected/non_finite  i /input/rejected/duplicate  i /input/rejected/outlier
    i /input/rejected/left_out
    s /input/organisation  s /input/unit  s /input/unit_source  n /input/spacing  n /input/noise
    s /surface/topology  2 /surface/degree  2 /surface/control_points  b /surface/rational
    t /surface/closed  t /surface/periodic  b /surface/trimmed
    s /method  n /aim/value  s /aim/source
    i /deviation/scan_to_surface/count  n /deviation/scan_to_surface/max  n /deviation/scan_to_surface/mean
    n /deviation/scan_to_surface/rms  n /deviation/scan_to_surface/p50  n /deviation/scan_to_surface/p95
    n /deviation/scan_to_surface/p99  n /deviation/scan_to_surface/signed_min
    n /deviation/scan_to_surface/signed_max
    n /deviation/surface_to_scan/max  n /deviation/surface_to_scan/mean  n /deviation/surface_to_scan/p95
    n /deviation/surface_to_scan/unsupported_area
    s /verdict  s /reason
    n /time/read  n /time/clean  n /time/order  n /time/rarefy  n /time/enrich  n /time/fit  n /time/deviation
    n /time/write  n /time/total
    s /outputs/0/path  s /outputs/0/format  i /outputs/0/bytes";

fn keeps_contract(value: &Value) {
    let words: Vec<&str> = CONTRACT.split_whitespace().collect();
    for pair in words.chunks(2) {
        let found = value.pointer(pair[1]).unwrap_or(&Value::Null);
        let array = |good: fn(&Value) -> bool| {
            let items = found.as_array().map_or(&[][..], Vec::as_slice);
            items.len() == 2 && items.iter().all(good)
        };
        let good = match pair[0] {
            "n" => found.is_number(),
            "i" => found.is_u64(),
            "s" => found.as_str().is_some_and(|s| !s.is_empty()),
            "b" => found.is_boolean(),
            "2" => array(Value::is_u64),
            _ => array(Value::is_boolean),
        };
        assert!(good, "{}: {found}", pair[1]);
    }
    let tolerance = value["tolerance"].is_number();
    assert_eq!(
        value["deviation"]["scan_to_surface"]["within_tolerance"].is_number(),
        tolerance
    );
    assert_eq!(value["within"].is_number(), tolerance);
    let verdict = text(value, "/verdict");
    assert!(
        tolerance || matches!(verdict, "not_asked" | "fail"),
        "{verdict}"
    );
    let trade = value["surface"]["trade"].as_array().unwrap();
    let size: f64 = (0..2)
        .map(|k| number(value, &format!("/surface/control_points/{k}")))
        .product();
    let of = |point: &Value, key: &str| number(point, &format!("/{key}"));
    let chosen = trade
        .iter()
        .find(|point| (of(point, "control_points") - size).abs() < 0.5);
    assert!(chosen.is_some_and(|point| of(point, "max") >= of(point, "p95")));
    assert!(trade.windows(2).all(|pair| {
        of(&pair[0], "control_points") < of(&pair[1], "control_points")
            && of(&pair[0], "p95") > of(&pair[1], "p95")
    }));
    let reasons = value["reasons"].as_array().unwrap();
    assert_eq!(reasons.is_empty(), matches!(verdict, "pass" | "not_asked"));
    for reason in reasons {
        assert!(!text(reason, "/what").is_empty());
    }
    assert!(!value.to_string().contains("-0.0,"), "a negative zero");
    let points = number(value, "/input/points");
    let rejected: f64 = ["non_finite", "duplicate", "outlier", "left_out"]
        .map(|why| number(value, &format!("/input/rejected/{why}")))
        .iter()
        .sum();
    assert!(
        (number(value, "/input/used") + rejected - points).abs() < 0.5,
        "all points are counted"
    );
}

#[test]
fn every_shape_without_a_flag() {
    for (shape, topology) in [
        ("pot", "tube"),
        ("patch", "disk"),
        ("face", "disk"),
        ("handle", "tube"),
        ("sphere", "sphere"),
        ("ellipsoid", "sphere"),
        ("torus", "torus"),
        ("tube", "tube"),
        ("saddle", "disk"),
        ("blade", "tube"),
    ] {
        let points = if shape == "patch" { 16 } else { 2500 };
        let bench = Bench::with_scan(&format!("{shape} --points {points} -o scan.ply"));
        let found = bench.json("fit scan.ply --force", 0);
        keeps_contract(&found);
        assert_eq!(text(&found, "/surface/topology"), topology, "{shape}");
        assert_eq!(text(&found, "/method"), "interpolate", "{shape}");
        assert_eq!(text(&found, "/verdict"), "not_asked", "{shape}");
        assert_eq!(text(&found, "/input/unit_source"), "file", "{shape}");
        assert_eq!(found["outputs"][0]["bytes"], bench.read("scan.step").len());
        assert!(number(&found, "/time/fit") > 0.0);
    }
}

#[test]
fn clouds_and_noise() {
    let bench =
        Bench::with_scan("face --points 4000 --noise 0.1 --outliers 0.01 --shuffled -o scan.xyz");
    let found = bench.json(
        "fit scan.xyz -o a.igs -o a.stl -o a.obj -o a.ply --report r.json --report r.csv",
        0,
    );
    keeps_contract(&found);
    assert_eq!(text(&found, "/method"), "approximate");
    assert_eq!(text(&found, "/input/organisation"), "unordered");
    let outliers = number(&found, "/input/rejected/outlier");
    assert!((20.0..60.0).contains(&outliers), "{outliers}");
    assert_eq!(found["outputs"].as_array().unwrap().len(), 6);
    let report: Value = serde_json::from_str(&bench.read("r.json")).unwrap();
    assert_eq!(report["deviation"], found["deviation"]);
    let csv = bench.read("r.csv");
    assert_eq!(
        csv.lines().next(),
        Some("index,x,y,z,deviation,lower,upper,u,v,face,state")
    );
    assert_eq!(found["input"]["points"], csv.lines().count() - 1);
    let with = |state: &str| csv.lines().filter(|line| line.ends_with(state)).count();
    assert_eq!(found["input"]["used"], with(",used"));
    assert_eq!(found["input"]["rejected"]["outlier"], with(",outlier"));
    assert!(csv.lines().all(|line| line.split(',').count() == 11));
    // The mesh is a scan, too.
    keeps_contract(&bench.json("fit a.ply -o b.igs -t 1.5", 0));
}

#[test]
fn the_neighbours_of_a_tolerance_are_named() {
    let bench = Bench::with_scan("face --points 6000 --shuffled -o scan.xyz");
    let said = bench.run("fit scan.xyz -o a.step --unit mm").stdout;
    let line = said.lines().find(|line| line.starts_with("trade"));
    let line = line.unwrap_or_else(|| panic!("{said}"));
    assert!(
        line.contains("-t ") && line.contains("would take about"),
        "{line}"
    );
    let found = bench.json("fit scan.xyz -o b.step --unit mm", 0);
    keeps_contract(&found);
    assert!(found["surface"]["trade"].as_array().unwrap().len() > 3);
    assert!(
        !found["surface"]["neighbours"]
            .as_array()
            .unwrap()
            .is_empty()
    );
    // Nothing is searched where points are ordered.
    bench.run("simulate face --points 2500 -o ordered.ply");
    let ordered = bench.json("fit ordered.ply -o c.step", 0);
    assert_eq!(ordered["surface"]["trade"].as_array().unwrap().len(), 1);
    assert_eq!(
        ordered["surface"]["neighbours"].as_array().unwrap().len(),
        0
    );
}

#[test]
fn ordered_noise_is_measured_and_outliers_are_counted() {
    for shape in ["face", "pot", "torus"] {
        let bench = Bench::with_scan(&format!("{shape} --points 5000 --noise 0.1 -o scan.ply"));
        let clean = bench.json("fit scan.ply --force", 0);
        assert_eq!(text(&clean, "/method"), "approximate", "{shape}");
        let noise = number(&clean, "/input/noise");
        assert!((0.085..0.115).contains(&noise), "{shape}: {noise}");
        bench.run(&format!(
            "simulate {shape} --points 5000 --noise 0.1 --outliers 0.01 -o scan.ply"
        ));
        let found = bench.run("fit scan.ply --force --json");
        let found: Value = serde_json::from_str(&found.stdout).unwrap();
        keeps_contract(&found);
        assert_eq!(
            found["surface"]["topology"], clean["surface"]["topology"],
            "{shape}"
        );
        let outliers = number(&found, "/input/rejected/outlier");
        assert!((25.0..70.0).contains(&outliers), "{shape}: {outliers}");
    }
}

#[test]
fn options_do_what_they_say() {
    let bench = Bench::with_scan("pot --points 4000 -o scan.ply");
    let fit = |options: &str, status: i32| {
        let found = bench.json(&format!("fit scan.ply --force {options}"), status);
        keeps_contract(&found);
        found
    };
    for method in ["interpolate", "approximate"] {
        assert_eq!(
            text(&fit(&format!("--method {method}"), 0), "/method"),
            method
        );
    }
    for degree in 1..=5 {
        for method in ["auto", "approximate"] {
            let options = format!("--degree {degree} -t 1 --method {method}");
            let found = bench.run(&format!("fit scan.ply --force --json {options}"));
            // Facets meet in creases, which the check of the file may hold against them.
            assert!(found.status == 0 || (found.status == 3 && degree == 1));
            let found: Value = serde_json::from_str(&found.stdout).unwrap();
            keeps_contract(&found);
            assert_eq!(counts(&found, "/surface/degree"), [degree; 2]);
        }
    }
    assert_eq!(counts(&fit("--degree 2,4", 0), "/surface/degree"), [2, 4]);
    for kind in ["uniform", "chord", "centripetal"] {
        let found = fit(&format!("--parameters {kind}"), 0);
        assert_eq!(text(&found, "/surface/parameters"), kind);
    }
    assert_eq!(
        counts(&fit("--rarefy 18x18 -t 2", 0), "/surface/control_points"),
        [18, 18]
    );
    assert_eq!(
        counts(&fit("--rarefy off", 0), "/surface/control_points"),
        counts(&fit("", 0), "/input/grid")
    );
    for degrees in ["20", "15,25"] {
        let found = fit(&format!("--rarefy {degrees} -t 9"), 0);
        assert_eq!(
            counts(&found, "/surface/control_points"),
            counts(&found, "/surface/kept")
        );
    }
    assert_eq!(
        text(&fit("--topology disk", 0), "/surface/topology"),
        "disk"
    );
    assert_eq!(
        text(&fit("--seed 7 --trim off -t 0.2", 0), "/verdict"),
        "pass"
    );
    // A surface that is too coarse for its tolerance is written all the same.
    let found = fit("--rarefy 6x6 -t 0.1", 3);
    assert_eq!(text(&found, "/verdict"), "fail");
    assert!(!found["reasons"].as_array().unwrap().is_empty());
}

#[test]
fn the_budget_is_hard() {
    let bench = Bench::with_scan("pot --points 4000 -o scan.ply");
    for options in [
        "",
        "--method interpolate",
        "--method approximate",
        "--rarefy off",
        "--rarefy 18x18",
    ] {
        let found = bench.json(
            &format!("fit scan.ply --force -t 0.1 --max-control-points 40 {options}"),
            3,
        );
        let [m, n] = counts(&found, "/surface/control_points");
        assert!(m * n <= 40, "{options}: {m} x {n}");
        assert!(
            found["reasons"].to_string().contains("40"),
            "{options}: {}",
            found["reasons"]
        );
    }
    bench.refuses(
        "fit scan.ply -o a.igs --max-control-points 4",
        1,
        "over the budget of 4",
    );
    bench.refuses(
        "fit scan.ply -o a.igs --max-control-points 40 --method interpolate --rarefy off",
        1,
        "over the budget of 40",
    );
}

#[test]
fn hold_out_is_reported_apart() {
    for scan in [
        "pot --points 4000 -o scan.ply",
        "face --points 4000 --shuffled -o scan.ply",
    ] {
        let bench = Bench::with_scan(scan);
        let found = bench.json(
            "fit scan.ply --force --hold-out 0.1 -t 1 --report points.csv",
            0,
        );
        let count = number(&found, "/deviation/hold_out/count");
        let rows = bench.read("points.csv");
        let held_out = rows
            .lines()
            .filter(|line| line.ends_with(",held_out"))
            .count();
        assert!((held_out as f64 - count).abs() < 0.5, "{held_out} {count}");
        assert!((300.0..=400.0).contains(&count), "{count}");
        // The tolerance is for 99.5 % of the points.
        assert!(number(&found, "/deviation/hold_out/p99") < 1.0);
        assert!(number(&found, "/deviation/hold_out/max") < 1.1);
        assert!(number(&found, "/deviation/scan_to_surface/count") > 3990.0);
    }
}

#[test]
fn units() {
    let bench = Bench::with_scan("saddle --points 900 -o scan.txt");
    let metres: String = super::points(&bench.path("scan.txt"))
        .iter()
        .map(|p| format!("{} {} {}\n", p[0] / 1e3, p[1] / 1e3, p[2] / 1e3))
        .collect();
    bench.write("metres.txt", metres);
    let found = bench.json("fit metres.txt --force --grid 30x30 --unit m -t 0.05mm", 0);
    assert!((number(&found, "/tolerance") - 5e-5).abs() < 1e-12);
    assert_eq!(text(&found, "/input/unit"), "m");
    assert_eq!(text(&found, "/input/unit_source"), "option");
    let found = bench.json("fit metres.txt --force --grid 30x30", 0);
    assert_eq!(text(&found, "/input/unit_source"), "assumed");
    assert!(found["warnings"].to_string().contains("--unit"));
    assert!(bench.read("metres.step").contains(".MILLI."));
}

#[test]
fn closed_grids_from_text() {
    // Closed by what --topology says, rows not repeated.
    for (shape, topology) in [("tube", "tube"), ("torus", "torus"), ("sphere", "sphere")] {
        let bench = Bench::with_scan(&format!("{shape} --points 1200 -o scan.txt"));
        let all = bench.read("scan.txt");
        let bare: String = all
            .lines()
            .filter(|l| !l.starts_with('#'))
            .map(|l| format!("{l}\n"))
            .collect();
        let grid = all
            .lines()
            .find(|l| l.contains("grid"))
            .unwrap()
            .replace("# grid ", "")
            .replace(' ', "");
        bench.write("bare.txt", bare);
        let found = bench.json(
            &format!("fit bare.txt --force --grid {grid} --topology {topology} --rarefy off"),
            0,
        );
        assert_eq!(text(&found, "/surface/topology"), topology);
        assert_eq!(found["surface"]["closed"][1], true);
        assert_eq!(found["surface"]["closed"][0], topology == "torus");
        assert!(number(&found, "/deviation/scan_to_surface/max") < 1e-9);
        let [m, n] = counts(&found, "/surface/control_points");
        assert_eq!(format!("{m}x{n}"), grid);
    }
}

/// Length of the diagonal of the box around the points.
fn diagonal(found: &Value) -> f64 {
    let side = |d: usize| {
        number(found, &format!("/input/bounding_box/1/{d}"))
            - number(found, &format!("/input/bounding_box/0/{d}"))
    };
    (0..3).map(|d| side(d).powi(2)).sum::<f64>().sqrt()
}

/// The surfaces in an IGES file: its directory has two lines for each.
fn surfaces(iges: &str) -> usize {
    let entry = |line: &&str| line.get(72..73) == Some("D") && line.starts_with("     128");
    iges.lines().filter(entry).count() / 2
}

#[test]
fn the_shape_of_a_cloud_is_found() {
    for (shape, topology) in [
        ("torus", "torus"),
        ("pot", "tube"),
        ("tube", "tube"),
        ("handle", "tube"),
        ("ellipsoid", "sphere"),
        ("saddle", "disk"),
    ] {
        let bench = Bench::with_scan(&format!("{shape} --points 5000 --shuffled -o scan.txt"));
        let found = bench.json("fit scan.txt -o a.igs", 0);
        keeps_contract(&found);
        assert_eq!(text(&found, "/surface/topology"), topology, "{shape}");
        assert_eq!(text(&found, "/method"), "approximate", "{shape}");
        assert!(found.get("parts").is_none(), "{shape}: it is in one piece");
        // The default tolerance is half a thousandth of the diagonal. And the surface stays with the scan: of points
        // that lie at random, one to a square of the spacing, 95 in 100 places are nearer than sqrt(ln 20 / pi) = 0.98
        // spacings to one; unevenly scattered points (an ellipsoid's) reach a little farther.
        let size = diagonal(&found);
        let max = number(&found, "/deviation/scan_to_surface/max");
        assert!(max <= 1.01 * 5e-4 * size, "{shape}: {max} of {size}");
        let back = number(&found, "/deviation/surface_to_scan/p95");
        let spacing = number(&found, "/input/spacing");
        assert!(back <= 1.2 * spacing, "{shape}: {back}, spacing {spacing}");
        assert!(number(&found, "/deviation/surface_to_scan/unsupported_area") <= 0.01);
        assert_eq!(surfaces(&bench.read("a.igs")), 1, "{shape}");
    }
}

#[test]
fn each_part_of_a_scan_gets_a_surface() {
    let bench = Bench::new();
    let mut all = String::new();
    for (shape, count, at) in [("torus", 1600, 0.0), ("ellipsoid", 1200, 1000.0)] {
        let done = bench.run(&format!(
            "simulate {shape} --points {count} --shuffled -o one.xyz"
        ));
        assert_eq!(done.status, 0, "{done:?}");
        for [x, y, z] in super::points(&bench.path("one.xyz")) {
            all += &format!("{} {y} {z}\n", x + at);
        }
    }
    // A scrap with too few points for a surface.
    for k in 0..40 {
        all += &format!("-1000 {} {}\n", k % 8, k / 8);
    }
    bench.write("scan.xyz", all);
    let found = bench.json("fit scan.xyz -o a.igs -o a.stl --report r.csv", 0);
    keeps_contract(&found);
    let parts = found["parts"].as_array().unwrap();
    assert_eq!(parts.len(), 2);
    for (part, (topology, points)) in parts.iter().zip([("torus", 1600), ("sphere", 1200)]) {
        assert_eq!(text(part, "/surface/topology"), topology);
        assert_eq!(part["points"], points, "{topology}");
        assert_eq!(part["scan_to_surface"]["count"], points, "{topology}");
        assert_eq!(text(part, "/verdict"), "not_asked", "{topology}");
    }
    assert_eq!(parts[0]["surface"], found["surface"], "the largest");
    assert_eq!(found["input"]["rejected"]["left_out"], 40);
    assert_eq!(found["input"]["used"], 2800);
    assert!(
        found["warnings"]
            .to_string()
            .contains("(40 of 2840) are left out")
    );
    assert_eq!(surfaces(&bench.read("a.igs")), 2);
    // The last two columns are the number of the surface and the state.
    let csv = bench.read("r.csv");
    let with = |end: &str| csv.lines().filter(|line| line.ends_with(end)).count();
    assert_eq!([with(",0,used"), with(",1,used")], [1600, 1200]);
    assert_eq!(with(",left_out"), 40);
}

#[test]
fn rows_of_different_length_keep_a_tight_tolerance() {
    let bench = Bench::with_scan("pot -o scan.ply");
    let found = bench.json("fit scan.ply --force -t 0.001", 0);
    keeps_contract(&found);
    assert_eq!(text(&found, "/method"), "approximate");
    // What cannot be kept is said, and soon.
    let found = bench.json("fit scan.ply --force -t 1e-9", 3);
    assert!(number(&found, "/time/total") < 60.0);
}

#[test]
fn the_papers_layout_has_the_papers_lines() {
    let fit = "--rarefy off --topology disk --parameters uniform --method interpolate --iges-layout paper --quiet";
    for (shape, grid, lines) in [
        ("patch", "4x4", 22),
        ("pot", "18x18", 230),
        ("face", "29x13", 267),
        ("handle", "25x32", 549),
    ] {
        let bench = Bench::with_scan(&format!("{shape} -o scan.ply"));
        if shape == "patch" {
            assert_eq!(bench.run(&format!("fit scan.ply -o a.igs {fit}")).status, 0);
        } else {
            assert_eq!(
                bench
                    .run(&format!("rarefy scan.ply -o kept.txt --rarefy {grid}"))
                    .status,
                0
            );
            // The face with uniform parameters intersects itself, as the check finds.
            let status = if shape == "face" { 3 } else { 0 };
            assert_eq!(
                bench
                    .run(&format!("fit kept.txt --grid {grid} -o a.igs {fit}"))
                    .status,
                status
            );
        }
        assert_eq!(bench.read("a.igs").lines().count(), lines, "{shape}");
    }
}

#[test]
fn points_go_along_on_request() {
    let bench = Bench::with_scan("saddle --points 400 -o scan.ply");
    bench.json("fit scan.ply -o without.igs", 0);
    bench.json("fit scan.ply -o with.igs --with-points", 0);
    let lines = |name| bench.read(name).lines().count();
    assert!(lines("with.igs") > lines("without.igs") + 400);
}

#[test]
fn enriched_surfaces_meet_the_originals() {
    for shape in ["torus", "saddle", "tube"] {
        let bench = Bench::with_scan(&format!("{shape} --points 64 -o scan.ply"));
        let found = bench.json("fit scan.ply --force --enrich 2 -t 5", 0);
        assert!(
            number(&found, "/deviation/scan_to_surface/max") < 1e-10,
            "{shape}"
        );
        let [m, n] = counts(&found, "/surface/control_points");
        assert!(m * n > 10 * 64, "{shape}: {m} x {n}");
    }
}

#[test]
fn a_closed_shape_stays_closed_unless_asked_otherwise() {
    let bench =
        Bench::with_scan("ellipsoid --points 6000 --holes 2 --shuffled --seed 7 -o scan.xyz");
    let closed = bench.json("fit scan.xyz -t 0.2 -o closed.step", 0);
    assert_eq!(closed["surface"]["trimmed"], false);
    assert!(closed["warnings"].to_string().contains("--trim always"));
    let open = bench.json("fit scan.xyz -t 0.2 --trim always -o open.step", 0);
    assert_eq!(open["surface"]["trimmed"], true);
    assert!(open["warnings"].to_string().contains("holes"));
}

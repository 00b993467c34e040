//! Pages of HTML: the report of a fit and of a deviation, and `view`.

use super::{Bench, number, text};
use serde_json::Value;

/// The data in a page, which must be the only thing that a name could break out of.
fn data(page: &str) -> Value {
    let from = page.find("id=\"data\">").unwrap() + "id=\"data\">".len();
    let length = page[from..].find("</script").unwrap();
    for mark in ["/*TITLE*/", "/*STYLE*/", "/*DATA*/", "/*SCRIPT*/"] {
        assert!(!page.contains(mark), "{mark}");
    }
    serde_json::from_str(&page[from..from + length]).unwrap()
}

#[test]
fn a_fit_and_a_deviation_are_reported_as_pages() {
    let bench = Bench::with_scan("saddle --points 900 --noise 0.02 -o scan.ply");
    let found = bench.json(
        "fit scan.ply -o part.step -t 0.2 --hold-out 0.1 --report page.html --report r.json",
        0,
    );
    assert_eq!(text(&found, "/outputs/1/format"), "html");
    let page = bench.read("page.html");
    assert_eq!(found["outputs"][1]["bytes"], page.len());
    let shown = data(&page);
    assert_eq!(
        (text(&shown, "/kind"), text(&shown, "/title")),
        ("fit", "scan.ply")
    );
    let command = "nurbskin fit scan.ply -o part.step -t 0.2 --hold-out 0.1 --report page.html --report r.json --json";
    assert_eq!(text(&shown, "/command"), command);
    assert_eq!(
        shown["statistics"]["scan_to_surface"],
        found["deviation"]["scan_to_surface"]
    );
    assert_eq!(
        shown["statistics"]["hold_out"],
        found["deviation"]["hold_out"]
    );
    assert_eq!(shown["verdict"]["reason"], found["reason"]);
    assert_eq!(shown["tolerance"], found["tolerance"]);
    let counts: Vec<f64> = serde_json::from_value(shown["histogram"]["counts"].clone()).unwrap();
    let beyond = number(&shown, "/histogram/below") + number(&shown, "/histogram/above");
    assert!((counts.iter().sum::<f64>() + beyond - number(&found, "/input/used")).abs() < 0.5);
    let titles: Vec<&str> = (0..6)
        .filter_map(|k| shown.pointer(&format!("/tables/{k}/title"))?.as_str())
        .collect();
    assert_eq!(&titles[..4], ["Read", "Fitted", "Checked", "Written"]);
    assert_eq!(text(&shown, "/inputs/0/sha256").len(), 64);

    let found = bench.json("deviation scan.ply part.step -t 0.2 --report d.html", 0);
    let shown = data(&bench.read("d.html"));
    assert_eq!(text(&shown, "/kind"), "deviation");
    assert_eq!(shown["inputs"].as_array().unwrap().len(), 2);
    assert_eq!(
        shown["statistics"]["free_edges"],
        found["deviation"]["free_edges"]
    );

    bench.refuses(
        "fit scan.ply -o a.html",
        2,
        "an HTML page is a report: use --report",
    );
}

#[test]
fn any_file_is_viewed() {
    let bench = Bench::with_scan("pot --points 1500 -o scan.ply");
    assert_eq!(bench.run("fit scan.ply -o part.igs -t 1").status, 0);
    // A file with a hostile name.
    std::fs::copy(bench.path("scan.ply"), bench.path("<b>&'.xyz")).unwrap();
    let done = bench.run("view scan.ply part.igs <b>&'.xyz --no-open");
    assert_eq!(done.status, 0, "{done:?}");
    let paths: Vec<&str> = done.stdout.lines().collect();
    assert_eq!(paths.len(), 3);
    let pages: Vec<Value> = paths
        .iter()
        .map(|path| data(&std::fs::read_to_string(path).unwrap()))
        .collect();
    let faces = |k: usize| pages[k]["faces"].as_array().unwrap().len();
    assert_eq!([faces(0), faces(1), faces(2)], [0, 1, 0]);
    assert_eq!(pages[0]["points"]["total"], 1500);
    assert_eq!([&pages[1]["points"], &pages[0]["mesh"]], [&Value::Null; 2]);
    assert_eq!(text(&pages[2], "/title"), "<b>&'.xyz");
    // The same name and bytes again; another place on request.
    let again = bench.run("view scan.ply part.igs --no-open --threads 1");
    assert_eq!(again.stdout.lines().collect::<Vec<_>>(), paths[..2]);
    let found = bench.json("view scan.ply -o my.html --no-open", 0);
    assert_eq!(text(&found, "/outputs/0/path"), "my.html");
    assert_eq!(text(&found, "/inputs/0/kind"), "scan");
    // What cannot be read is said, the others are shown.
    let done = bench.run("view none.ply scan.ply --no-open");
    assert_eq!((done.status, done.stdout.lines().count()), (1, 1));
    let nothing = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    bench.write("nothing.ply", nothing);
    bench.write("nan.xyz", "nan nan nan\n".repeat(9));
    for (name, says) in [
        ("nothing.ply", "the scan has no points"),
        ("nan.xyz", "no point of it is finite"),
    ] {
        bench.refuses(&format!("view {name} --no-open"), 1, says);
        bench.refuses(&format!("deviation {name} part.igs"), 1, says);
    }
    bench.refuses("fit nothing.ply --force", 1, "the scan has no points");
    // What is no surface is shown all the same.
    bench.write("spot.xyz", "1 2 3\n");
    assert_eq!(bench.run("view spot.xyz --no-open").status, 0);
    bench.refuses("view scan.ply -o scan.ply --no-open", 2, "is also an input");
    bench.refuses("view scan.ply -o a.step --no-open", 2, ".html");
    bench.refuses("view scan.ply part.igs -o a.html", 2, "several pages");
}

#[test]
fn a_page_has_the_title_and_the_notes_that_are_given() {
    let bench = Bench::with_scan("patch --points 900 -o scan.ply");
    let asked = "--title First --note operator=<b>Ada --note part=P-1 --report";
    let done = bench.run(&format!(
        "fit scan.ply -t 1 {asked} page.html --report points.csv"
    ));
    assert_eq!(done.status, 0, "{done:?}");
    let page = bench.read("page.html");
    assert!(page.contains("<title>First</title>"));
    let shown = data(&page);
    let fields = shown["fields"].as_array().unwrap().iter();
    let pairs: Vec<[&str; 2]> = fields
        .map(|f| [text(f, "/key"), text(f, "/text")])
        .collect();
    // SOURCE_DATE_EPOCH is 1750000000.
    assert_eq!(
        pairs,
        [
            ["date", "2025-06-15 15:06:40 UTC"],
            ["part", "P-1"],
            ["operator", "<b>Ada"],
        ]
    );
    // A line of the CSV for each point of the file.
    assert_eq!(bench.read("points.csv").lines().count(), 901);
    let done = bench.run(&format!("deviation scan.ply scan.step -t 1 {asked} d.html"));
    assert_eq!(done.status, 0, "{done:?}");
    let shown = data(&bench.read("d.html"));
    assert_eq!(text(&shown, "/fields/3/key"), "alignment");
    assert_eq!(text(&shown, "/fields/3/text"), "as scanned, not moved");
    for (wrong, says) in [
        ("--title x", "--report"),
        ("--note a=b", "--report"),
        ("--report b.html --note operator", "KEY=VALUE"),
    ] {
        let done = bench.run(&format!("fit scan.ply --force {wrong}"));
        assert_eq!(done.status, 2, "{wrong}: {done:?}");
        assert!(done.stderr.contains(says), "{wrong}: {done:?}");
    }
}

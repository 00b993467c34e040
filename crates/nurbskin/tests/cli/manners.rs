//! Where things are printed and how: streams, colours, files that are replaced, options and help.

use super::{Bench, text};

#[test]
fn results_are_on_stdout_and_messages_on_stderr() {
    let bench = Bench::with_scan("saddle --points 900 -o scan.txt");
    for (arguments, words) in [
        ("simulate patch -o a.ply", "16 points of a patch"),
        ("fit scan.txt -o part.step -t 1mm", "verdict     pass"),
        ("deviation scan.txt part.step -t 1mm", "verdict     pass"),
        ("check part.step", "part.step: pass (26 checks passed)"),
        ("info part.step", "size  "),
        ("rarefy scan.txt -o kept.txt", "kept  "),
        ("enrich a.ply -o dense.txt", "points; the surface"),
        ("convert part.step -o part.igs", "written     part.igs ("),
    ] {
        let done = bench.run(arguments);
        assert_eq!(done.status, 0, "{arguments}: {done:?}");
        assert!(done.stdout.contains(words), "{arguments}: {}", done.stdout);
        assert!(
            done.stderr
                .lines()
                .all(|line| line.starts_with("warning: ")),
            "{arguments}: {}",
            done.stderr
        );
        assert!(!done.stdout.contains('\u{1b}') && !done.stdout.contains('\u{a0}'));
    }
    // Silence, and the exit status.
    for arguments in [
        "fit scan.txt -o part.step -t 1mm -q",
        "deviation scan.txt part.step -t 1mm -q",
        "check part.step -q",
        "convert part.step -o part.igs -q",
    ] {
        let done = bench.run(arguments);
        assert_eq!(
            (done.status, &*done.stdout, &*done.stderr),
            (0, "", ""),
            "{arguments}"
        );
    }
}

#[test]
fn a_file_that_nobody_named_is_never_replaced() {
    let bench = Bench::with_scan("patch -o part.ply");
    bench.write("part.step", "the nominal of the customer");
    bench.refuses("fit part.ply", 2, "part.step exists already");
    bench.refuses("fit part.ply --json", 2, "--force");
    assert_eq!(bench.read("part.step"), "the nominal of the customer");
    // Named, or forced, it is replaced, and that is said.
    for arguments in ["fit part.ply --force", "fit part.ply -o part.step"] {
        let done = bench.run(arguments);
        assert_eq!(done.status, 0, "{arguments}: {done:?}");
        assert!(
            done.stdout.contains("replaced the file that was there"),
            "{arguments}: {}",
            done.stdout
        );
        assert!(bench.read("part.step").starts_with("ISO-10303-21;"));
    }
    bench.write("r.csv", "");
    let found = bench.json("fit part.ply -o new.step --report r.csv", 0);
    assert_eq!(found["outputs"][0]["replaced"], false);
    assert_eq!(found["outputs"][1]["replaced"], true);
    for arguments in [
        "simulate patch -o part.ply",
        "rarefy part.ply -o r.csv",
        "convert new.step -o part.step",
    ] {
        let done = bench.run(arguments);
        assert!(done.stdout.contains("replaced"), "{arguments}: {done:?}");
    }
}

#[test]
fn errors_are_objects_where_json_is_asked_for() {
    let bench = Bench::with_scan("patch -o part.ply");
    bench.write("line.xyz", "0 0 0\n1 1 1\n2 2 2\n3 3 3\n");
    for (arguments, status, kind) in [
        ("fit none.ply --json", 1, "read"),
        ("fit line.xyz --json", 1, "invalid"),
        ("fit part.ply -o none/a.step --json", 1, "write"),
        ("fit part.ply -o a.doc --json", 2, "usage"),
        ("fit part.ply --json --nonsense", 2, "usage"),
        ("fit part.ply -t --json", 2, "usage"),
        ("check none.step --json", 1, "read"),
        ("deviation part.ply part.ply --json", 1, ""),
        ("view --json", 2, "usage"),
    ] {
        let done = bench.run(arguments);
        assert_eq!(done.status, status, "{arguments}: {done:?}");
        let found: serde_json::Value = serde_json::from_str(&done.stdout).unwrap();
        assert_eq!(found["schema"], 2, "{arguments}");
        assert!(
            kind.is_empty() || text(&found, "/error/kind") == kind,
            "{arguments}: {found}"
        );
        let message = text(&found, "/error/message");
        assert!(
            !message.contains("--help") && !message.contains("Usage"),
            "{message}"
        );
    }
    // Help is help.
    let done = bench.run("fit --help --json");
    assert!(
        done.status == 0 && done.stdout.starts_with("Fit NURBS surfaces to a scan"),
        "{done:?}"
    );
}

#[test]
fn the_size_comes_first_and_is_doubted_without_a_unit() {
    let bench = Bench::with_scan("saddle --points 900 -o scan.txt");
    let metres: String = super::points(&bench.path("scan.txt"))
        .iter()
        .map(|p| format!("{} {} {}\n", p[0] / 1e3, p[1] / 1e3, p[2] / 1e3))
        .collect();
    bench.write("metres.xyz", &metres);
    let done = bench.run("fit metres.xyz --grid 30x30 -o a.step");
    let first = done.stderr.lines().next().unwrap();
    assert!(
        first.starts_with("warning: the size of the scan is ") && first.contains("--unit m"),
        "{first}"
    );
    assert!(
        done.stdout
            .starts_with("scan        metres.xyz: 900 points, grid of 30 x 30, "),
        "{}",
        done.stdout
    );
    assert!(
        done.stdout
            .lines()
            .next()
            .unwrap()
            .ends_with(" (mm assumed)"),
        "{}",
        done.stdout
    );
    // The doubt is told once, and not where the unit is known.
    assert_eq!(done.stderr.lines().count(), 1, "{}", done.stderr);
    let done = bench.run("fit metres.xyz --grid 30x30 --unit m -o a.step");
    assert_eq!(done.stderr, "");
    assert!(
        done.stdout.contains(" mm\n"),
        "in millimetres: {}",
        done.stdout
    );
    let done = bench.run("info metres.xyz");
    assert!(
        done.stderr
            .starts_with("warning: metres.xyz: the size of the scan is "),
        "{done:?}"
    );
}

#[test]
fn the_chronicle_is_told_on_demand() {
    let bench = Bench::with_scan("pot --points 3000 -o scan.ply");
    let short = bench.run("fit scan.ply -o a.step");
    assert_eq!(short.stderr, "");
    let long = bench.run("fit scan.ply -o a.step -v");
    assert!(long.stderr.starts_with("note: "), "{long:?}");
    assert!(long.stdout.contains("aim  ") && !short.stdout.contains("aim  "));
    let found = bench.json("fit scan.ply -o a.step", 0);
    assert!(!found["details"].as_array().unwrap().is_empty());
}

#[test]
fn a_cad_file_is_not_fitted() {
    let bench = Bench::with_scan("patch -o scan.ply");
    bench.run("fit scan.ply -o part.step -q");
    for arguments in [
        "fit part.step",
        "fit part.step -o other.step",
        "fit scan.ply part.step --output-dir out",
    ] {
        let done = bench.run(arguments);
        assert_eq!(done.status, 2, "{done:?}");
        for word in [
            "part.step is a CAD file",
            "nurbskin check",
            "nurbskin deviation",
            "nurbskin convert",
        ] {
            assert!(done.stderr.contains(word), "{word}: {}", done.stderr);
        }
    }
}

#[test]
fn a_check_is_a_quality_report() {
    let bench = Bench::with_scan("pot --points 3000 -o scan.ply");
    bench.run("fit scan.ply -o part.step -q");
    let done = bench.run("check part.step");
    let lines: Vec<&str> = done.stdout.lines().collect();
    assert_eq!(
        lines[0],
        "part.step: pass (26 checks passed); STEP, 1 face, lengths in mm"
    );
    assert_eq!(lines.len(), 5, "{}", done.stdout);
    for (line, begins) in lines[1..].iter().zip([
        "  note  free edges of an open shell: 2 edges; worst at (",
        "  ok    geometry: ",
        "  ok    topology: ",
        "  ok    read-back: ",
    ]) {
        assert!(line.starts_with(begins), "{line}");
    }
    let all = bench.run("check part.step -v").stdout;
    for words in [
        "(limit >= ",
        "(limit <= ",
        "degree: 3 (limit <= 11)",
        "none allowed",
    ] {
        assert!(all.contains(words), "{words}: {all}");
    }
    assert!(all.lines().count() > 20);
    // The JSON has the names.
    let found = bench.json("check part.step", 0);
    assert!(found["checks"].to_string().contains("self_intersections"));
}

#[test]
fn help_is_in_groups_and_breaks_its_own_lines() {
    let bench = Bench::new();
    let help = bench.run("fit --help").stdout;
    let headings = [
        "\nOutput:",
        "\nTolerance and size:",
        "\nSurface:",
        "\nOrdered scans:",
        "\nInput:",
        "\nCommon options:",
    ];
    let places: Vec<usize> = headings
        .iter()
        .map(|heading| help.find(heading).unwrap())
        .collect();
    assert!(places.is_sorted(), "{places:?}");
    for verb in [
        "",
        "fit",
        "deviation",
        "check",
        "info",
        "view",
        "app",
        "convert",
        "rarefy",
        "enrich",
        "simulate",
        "completions",
        "man",
    ] {
        for flag in ["-h", "--help"] {
            let done = bench.run(&format!("{verb} {flag}"));
            assert_eq!((done.status, &*done.stderr), (0, ""), "{verb}");
            assert!(done.stdout.contains("Common options:"), "{verb}");
            assert!(
                done.stdout.lines().all(|line| line.chars().count() <= 100),
                "{verb}"
            );
            assert!(
                !done.stdout.contains("\nOptions:"),
                "{verb}: {}",
                done.stdout
            );
        }
    }
    let all = bench.run("--help").stdout;
    for words in [
        "completions",
        "man ",
        "Exit status:",
        "of several files: one or more failed",
        "NO_COLOR",
    ] {
        assert!(all.contains(words), "{words}: {all}");
    }
    assert_eq!(bench.run("help fit").stdout, help);
    // Options without effect are not offered.
    let enrich = bench.run("enrich --help").stdout;
    for option in ["--rarefy", "--degree", "--tolerance", "--parameters"] {
        assert!(!enrich.contains(option), "{option}");
    }
    assert!(!bench.run("rarefy --help").stdout.contains("--enrich"));
    assert!(bench.run("completions bash").stdout.contains("--within"));
}

#[test]
fn headers_name_author_and_date() {
    let bench = Bench::with_scan("patch -o scan.ply");
    let fit = |name: &str| {
        let output = bench
            .command(&format!(
                "fit scan.ply -o {name} --author Ada --organization Works"
            ))
            .env("SOURCE_DATE_EPOCH", "1000000000")
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0));
    };
    for name in ["a.step", "a.igs"] {
        fit(name);
        let found = bench.json(&format!("info {name}"), 0);
        assert_eq!(text(&found, "/files/0/header/author"), "Ada", "{name}");
        assert_eq!(
            text(&found, "/files/0/header/organization"),
            "Works",
            "{name}"
        );
        let shown = bench.run(&format!("info {name}")).stdout;
        assert!(
            shown.contains("author      Ada\n") && shown.contains("2001"),
            "{shown}"
        );
    }
}

#[test]
fn colours_are_for_terminals_and_can_be_turned_off() {
    let bench = Bench::with_scan("patch -o scan.ply");
    let run = |variable: &str, arguments: &str| {
        let output = bench
            .command(arguments)
            .env(variable, "1")
            .output()
            .unwrap();
        let text = [output.stdout, output.stderr].concat();
        String::from_utf8(text).unwrap()
    };
    let fit = "fit scan.ply -o a.step -t 1mm";
    // What a terminal is shown.
    let shown = run("CLICOLOR_FORCE", fit);
    assert!(shown.contains("\u{1b}[32mpass"), "{shown}");
    let shown = run("CLICOLOR_FORCE", "fit none.ply");
    assert!(shown.contains("\u{1b}[31merror:"), "{shown}");
    for arguments in [fit, "fit none.ply"] {
        assert!(!run("NO_COLOR", arguments).contains('\u{1b}'));
    }
}

#[test]
fn a_tolerance_larger_than_the_scan_is_doubted_at_once() {
    let bench = Bench::with_scan("saddle --points 900 -o scan.ply");
    let done = bench.run("fit scan.ply -t 1e9m -o a.step");
    assert_eq!(done.status, 3, "{done:?}");
    let first = done.stderr.lines().next().unwrap();
    assert!(
        first.starts_with("warning: the tolerance of 1000000 km is larger than the scan"),
        "{first}"
    );
}

#[test]
fn what_failed_comes_first_with_its_place_and_what_to_do() {
    let bench = Bench::new();
    let mut eight = String::new();
    for j in 0..8 {
        for i in 0..40 {
            let t = std::f64::consts::TAU * f64::from(i) / 39.0 + 0.3;
            let (x, y) = (20.0 * (2.0 * t).sin(), 30.0 * t.sin());
            eight += &format!("{x} {y} {}\n", 5 * j);
        }
    }
    bench.write("eight.txt", eight);
    // A surface that intersects itself is no success, with or without a tolerance.
    let fit = "fit eight.txt --grid 40x8 --unit mm --topology disk --method interpolate --rarefy off -o eight.step";
    for options in ["", "-t 1mm"] {
        let done = bench.run(&format!("{fit} {options}"));
        assert_eq!(done.status, 3, "{done:?}");
        for words in [
            "check       FAIL: ",
            "verdict     FAIL: ",
            " mm\n            next: ",
        ] {
            assert!(done.stdout.contains(words), "{words}: {}", done.stdout);
        }
    }
    let found = bench.json(fit, 3);
    assert!(
        text(&found, "/reasons/0/what").contains("intersects itself"),
        "{found}"
    );
    assert!(found["reasons"][0]["where"].is_array() && found["reasons"][0]["next"].is_string());
    let done = bench.run("check eight.step");
    assert_eq!(done.status, 3);
    let lines: Vec<&str> = done.stdout.lines().collect();
    assert!(lines[0].starts_with("eight.step: FAIL ("), "{}", lines[0]);
    assert!(
        lines[1].starts_with("  FAIL  self-intersections: "),
        "{}",
        lines[1]
    );
    assert!(
        lines[1].contains(", none allowed; worst at ("),
        "{}",
        lines[1]
    );
    assert!(lines[lines.len() - 1].starts_with("  ok    read-back"));
}

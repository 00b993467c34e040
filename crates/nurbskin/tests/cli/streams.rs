//! `-` for standard input and output, and compressed names.

use super::{Bench, text};

#[test]
fn a_scan_goes_through_pipes() {
    let bench = Bench::with_scan("saddle --points 900 -o scan.ply");
    let scan = std::fs::read(bench.path("scan.ply")).unwrap();
    // In: the format is found, or said.
    for options in ["", "--from ply"] {
        let done = bench.run_with_input(&format!("fit - -o a.step {options}"), &scan);
        assert_eq!(done.status, 0, "{done:?}");
        assert!(
            done.stdout.contains("standard input: 900 points"),
            "{}",
            done.stdout
        );
    }
    // Out: the file on stdout, the result on stderr.
    let done = bench.run_with_input("fit - -o -", &scan);
    assert_eq!(done.status, 0, "{done:?}");
    assert!(
        done.stdout.starts_with("ISO-10303-21;")
            && done.stdout.trim_end().ends_with("END-ISO-10303-21;")
    );
    assert!(
        done.stderr.contains("verdict     not asked")
            && done.stderr.contains("written     standard output")
    );
    let iges = bench.run("fit scan.ply -o - --to iges -q");
    assert!(
        iges.stdout.lines().all(|line| line.len() == 80),
        "{}",
        iges.stdout
    );
    assert_eq!(iges.stderr, "");
    // From verb to verb.
    bench.run("fit scan.ply -o part.step -q");
    let done = bench.run_with_input("deviation - part.step -t 1mm", &scan);
    assert_eq!(done.status, 0, "{done:?}");
    let done = bench.run_with_input("convert - -o - --to xyz", &scan);
    assert!(
        done.status == 0 && done.stdout.lines().count() >= 900,
        "{}",
        done.stderr
    );
    let done = bench.run_with_input("check -", bench.read("part.step").as_bytes());
    assert_eq!(done.status, 0, "{done:?}");
    let done = bench.run_with_input("info - --json", &scan);
    let found: serde_json::Value = serde_json::from_str(&done.stdout).unwrap();
    assert_eq!(text(&found, "/files/0/path"), "standard input");
    let done = bench.run_with_input("rarefy - -o - --to xyz -q", &scan);
    assert!(
        done.status == 0 && done.stdout.lines().count() > 9,
        "{done:?}"
    );
    // Without --to a scan goes out as PLY, a CAD file as STEP.
    for arguments in [
        "rarefy - -o - -q",
        "enrich - -o - -q",
        "simulate pot --points 200 -o - -q",
    ] {
        let input = std::fs::File::open(bench.path("scan.ply")).unwrap();
        let done = bench.command(arguments).stdin(input).output().unwrap();
        assert!(done.stdout.starts_with(b"ply\n"), "{arguments}: {done:?}");
        assert!(
            done.status.success() && done.stderr.is_empty(),
            "{arguments}: {done:?}"
        );
    }
    let done = bench.run("simulate pot --points 200 -o - --to csv");
    assert!(
        done.stdout.lines().count() >= 200 && done.stderr.contains("written     standard output")
    );
    // CAD files, their format said by either extension.
    let step = bench.read("part.step");
    for arguments in [
        "check - --from step",
        "info - --from stp",
        "deviation scan.ply - -t 1mm",
    ] {
        let done = bench.run_with_input(arguments, step.as_bytes());
        assert_eq!(done.status, 0, "{arguments}: {done:?}");
    }
    let done = bench.run_with_input("convert - --from step -o - --to igs -q", step.as_bytes());
    assert!(done.stdout.contains("S      1\n"), "{done:?}");
    // A file whose name says nothing.
    std::fs::copy(bench.path("scan.ply"), bench.path("scan.dat")).unwrap();
    assert_eq!(bench.run("fit scan.dat --from ply -o b.step").status, 0);
    assert_eq!(bench.run("info scan.dat --from ply").status, 0);
}

#[test]
fn streams_that_cannot_be() {
    let bench = Bench::with_scan("patch -o scan.ply");
    for (arguments, says) in [
        ("fit -", "-o FILE"),
        ("fit scan.ply -o - --json", "both write to standard output"),
        ("fit scan.ply -o - -o -", "only one output"),
        (
            "fit scan.ply -o a.step --to iges",
            "--to is the format of standard output",
        ),
        ("info - -", "only once"),
    ] {
        let done = bench.run_with_input(arguments, b"0 0 0\n");
        assert_eq!(done.status, 2, "{arguments}: {done:?}");
        assert!(done.stderr.contains(says), "{arguments}: {}", done.stderr);
    }
    let done = bench.run_with_input("fit - -o a.step", b"");
    assert!(
        done.status == 1 && done.stderr.contains("standard input"),
        "{done:?}"
    );
    assert_eq!(bench.files(), ["scan.ply"]);
}

#[test]
fn units_of_input_and_output_are_two() {
    let bench = Bench::new();
    bench.write("metres.xyz", "0 0 0\n1 0 0\n1 1 0\n0 1 0.5\n");
    let found = bench.json("convert metres.xyz --unit m --to-unit mm -o mm.xyz", 0);
    assert_eq!(
        (
            text(&found, "/input/unit"),
            text(&found, "/input/unit_source")
        ),
        ("m", "option")
    );
    assert!(
        super::distance(
            super::points(&bench.path("mm.xyz"))[3],
            [0.0, 1000.0, 500.0]
        ) < 1e-9
    );
    // Without --to-unit numbers stay; and an assumed unit is told.
    let done = bench.run("convert metres.xyz -o same.xyz");
    assert!(done.stderr.contains("--unit"), "{done:?}");
    assert!(super::distance(super::points(&bench.path("same.xyz"))[3], [0.0, 1.0, 0.5]) < 1e-9);
}

//! `simulate`, `rarefy`, `enrich`, and the examples of `--help`.

use super::{Bench, counts, distance, number, points, text};

/// The size stands in the first line of every verb that reads a scan or makes one, and the spacing and the numbers of control
/// points are those of the fit everywhere.
#[test]
fn sizes_and_counts_are_the_same_everywhere() {
    let bench = Bench::new();
    let size = "106 x 106 x 120 mm";
    let made = bench.run("simulate pot --points 2000 -o pot.ply").stdout;
    assert!(
        made.starts_with(&format!(
            "scan        2000 points of a pot, in a grid, {size}"
        )),
        "{made}"
    );
    let fitted = bench.json("fit pot.ply -o pot.step", 0);
    for arguments in [
        "fit pot.ply -o pot.igs",
        "deviation pot.ply pot.step",
        "rarefy pot.ply --rarefy 9x9 -o kept.ply",
        "enrich pot.ply -o dense.ply",
        "convert pot.ply -o pot.xyz",
        "info pot.ply",
    ] {
        let said = bench.run(arguments).stdout;
        assert!(said.contains(size), "{arguments}: {said}");
    }
    let said = bench.run("convert pot.step -o again.step").stdout;
    assert!(
        said.starts_with("read        pot.step: 1 face, 10"),
        "{said}"
    );
    let found = bench.json("info pot.ply pot.step", 0);
    let compared = bench.json("deviation pot.ply pot.step", 0);
    for spacing in [&found["files"][0]["spacing"], &compared["input"]["spacing"]] {
        assert_eq!(*spacing, fitted["input"]["spacing"]);
    }
    assert_eq!(
        found["files"][1]["surfaces"][0]["control_points"],
        fitted["surface"]["control_points"]
    );
    // A unit that nobody said is doubted by every verb.
    bench.run("convert pot.ply --to-unit m -o small.xyz");
    let points: String = bench
        .read("small.xyz")
        .lines()
        .filter(|line| !line.starts_with('#'))
        .fold(String::new(), |all, line| all + line + "\n");
    bench.write("small.xyz", points);
    for arguments in ["convert small.xyz -o a.ply", "info small.xyz"] {
        let done = bench.run(arguments);
        assert!(
            done.stderr.starts_with("warning: ")
                && done.stderr.contains("--unit m: 106 x 106 x 120 mm"),
            "{arguments}: {done:?}"
        );
    }
}

#[test]
fn bodies_are_clouds_or_meshes() {
    let bench = Bench::new();
    for body in [
        "double-torus",
        "mug",
        "hammer",
        "drill",
        "tee",
        "bracket",
        "knot",
    ] {
        let found = bench.json(
            &format!("simulate {body} --points 700 --noise 0.01 -o a.ply"),
            0,
        );
        assert_eq!(found["input"]["shape"], body);
        assert_eq!(found["input"]["points"], 700);
        assert_eq!(found["input"]["organisation"], "unordered");
    }
    for arguments in ["tee --mesh", "bracket --mesh", "bracket --mesh --unaligned"] {
        let found = bench.json(&format!("simulate {arguments} --points 2000 -o a.ply"), 0);
        assert_eq!(found["input"]["organisation"], "mesh");
        let points = found["input"]["points"].as_u64().unwrap();
        assert!(points.abs_diff(2000) < 100, "{arguments}: {points}");
    }
    let few = bench.run("simulate mug --mesh --points 100 -o a.ply");
    assert_eq!(few.status, 1);
    assert!(
        few.stderr.contains("too few for a mesh of the mug"),
        "{}",
        few.stderr
    );
}

#[test]
fn simulate_counts_and_orders() {
    let bench = Bench::new();
    for (arguments, count, organisation) in [
        ("pot", 13159, "rows"),
        ("patch", 16, "grid"),
        ("face", 10031, "rows"),
        ("handle", 12000, "grid"),
        ("handle --opening", 12000, "grid"),
        ("sphere --points 777", 777, "rows"),
        ("face --points 1234 --shuffled", 1234, "unordered"),
        (
            "blade --points 500 --noise 0.2 --outliers 0.1 --seed 3",
            500,
            "",
        ),
        (
            "torus --points 1000 --holes 3 --shuffled",
            1000,
            "unordered",
        ),
    ] {
        let found = bench.json(&format!("simulate {arguments} -o a.ply"), 0);
        assert_eq!(found["input"]["points"], count, "{arguments}");
        assert!(
            text(&found, "/input/organisation").contains(organisation) || organisation == "rows",
            "{arguments}: {found}"
        );
        assert_eq!(text(&found, "/outputs/0/format"), "ply");
        assert!(found["warnings"].is_array());
        if arguments.contains("outliers") {
            assert_eq!(found["input"]["outliers"], 50);
        }
        for format in ["xyz", "txt", "asc", "csv"] {
            bench.json(&format!("simulate {arguments} -o a.{format}"), 0);
            assert_eq!(
                points(&bench.path(&format!("a.{format}"))).len(),
                count,
                "{arguments}.{format}"
            );
        }
    }
    // The same seed, the same bytes; another one, others.
    let made = |seed: u32| {
        bench.run(&format!(
            "simulate face --points 400 --noise 0.1 --shuffled --seed {seed} -o s.txt"
        ));
        bench.read("s.txt")
    };
    assert_eq!(made(1), made(1));
    assert_ne!(made(1), made(2));
}

#[test]
fn rarefied_scans_read_back() {
    let bench = Bench::with_scan("pot --points 4000 -o scan.ply");
    for (options, kept) in [
        ("--rarefy 9x12", Some([9, 12])),
        ("--rarefy 25", None),
        ("-t 0.5", None),
        ("--rarefy off", None),
    ] {
        for format in ["ply", "txt", "xyz", "csv"] {
            let found = bench.json(&format!("rarefy scan.ply -o kept.{format} {options}"), 0);
            let [m, n] = counts(&found, "/kept");
            assert!(kept.is_none_or(|kept| kept == [m, n]), "{found}");
            assert_eq!(found["points"], m * n);
            assert_eq!(text(&found, "/outputs/0/format"), format);
            for grid in [String::new(), format!("--grid {m}x{n}")] {
                let back = bench.json(
                    &format!("fit kept.{format} -o kept.igs {grid} --topology tube --rarefy off"),
                    0,
                );
                assert_eq!(counts(&back, "/input/grid"), [m, n], "{format} {options}");
                assert_eq!(text(&back, "/input/organisation"), "grid");
                assert!(number(&back, "/deviation/scan_to_surface/max") < 1e-9);
            }
        }
    }
}

#[test]
fn enriching_keeps_the_original_points() {
    for (shape, grid) in [
        ("saddle", "8x8"),
        ("torus", "8x8"),
        ("tube", "8x8"),
        ("patch", "4x4"),
    ] {
        let n = if shape == "patch" { 16 } else { 64 };
        let bench = Bench::with_scan(&format!("{shape} --points {n} -o sparse.txt"));
        let found = bench.json("enrich sparse.txt --enrich 2 -o dense.txt", 0);
        let [m, n] = counts(&found, "/grid");
        let dense = points(&bench.path("dense.txt"));
        assert_eq!(dense.len() as u64, m * n);
        for p in points(&bench.path("sparse.txt")) {
            let nearest = dense
                .iter()
                .map(|&q| distance(p, q))
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-10, "{shape} {grid}: {nearest:e}");
        }
        let back = bench.json(
            &format!("fit dense.txt --grid {m}x{n} --rarefy off -o d.igs -t 9"),
            0,
        );
        assert_eq!(counts(&back, "/input/grid"), [m, n]);
    }
}

#[test]
fn the_examples_of_the_help_work() {
    let bench = Bench::new();
    for scan in [
        "pot -o pot.ply",
        "face --shuffled -o face.ply",
        "face --points 377 -o first.txt",
        "saddle --points 64 -o sparse.txt",
    ] {
        assert_eq!(bench.run(&format!("simulate {scan}")).status, 0);
    }
    bench.run("rarefy pot.ply --rarefy 29x13 -o rows.txt");
    std::fs::create_dir(bench.path("scans")).unwrap();
    bench.run("simulate patch -o scans/a.ply");
    bench.run("simulate torus --points 900 -o scans/b.ply");
    bench.run("fit pot.ply -o part.step");
    bench.run("fit pot.ply -o part.igs");
    std::fs::copy(bench.path("pot.ply"), bench.path("scan.ply")).unwrap();
    let mut count = 0;
    for verb in [
        "fit",
        "info",
        "deviation",
        "check",
        "convert",
        "rarefy",
        "enrich",
        "simulate",
        "view",
    ] {
        let help = bench.run(&format!("{verb} --help"));
        assert_eq!((help.status, help.stderr.as_str()), (0, ""));
        for option in ["--json", "--quiet", "--threads", "Example"] {
            assert!(help.stdout.contains(option), "{verb}: {option}");
        }
        for line in help
            .stdout
            .lines()
            .map(str::trim)
            .filter(|l| l.starts_with("nurbskin "))
        {
            // Remarks stand two blanks after the command.
            let command = line["nurbskin ".len()..].split("   ").next().unwrap();
            let command = command.replace("scans/*.ply", "scans/a.ply scans/b.ply");
            let done = bench.run(&command);
            assert_eq!(done.status, 0, "{command}: {done:?}");
            count += 1;
        }
    }
    assert!(count >= 8, "{count}");
}

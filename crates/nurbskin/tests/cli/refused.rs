//! Wrong usage and bad files: one sentence, the right exit status, nothing written.

use super::Bench;

#[test]
fn outputs_that_cannot_be() {
    let bench = Bench::with_scan("patch -o scan.ply");
    std::fs::create_dir(bench.path("folder.igs")).unwrap();
    for (arguments, says) in [
        ("fit scan.ply -o scan.ply", "also an input"),
        ("fit scan.ply -o ./scan.ply", "also an input"),
        ("fit scan.ply -o a.igs -o a.igs", "named twice"),
        ("fit scan.ply -o a.igs -o ./a.igs", "named twice"),
        (
            "fit scan.ply -o a.igs -o folder.igs/../a.igs",
            "named twice",
        ),
        (
            "fit scan.ply --report a.html --report ./a.html",
            "named twice",
        ),
        ("fit scan.ply -o folder.igs", "is a directory"),
        ("fit scan.ply -o /dev/null", "is a device"),
        ("fit scan.ply -o a.html", "HTML"),
        ("fit scan.ply -o a.xls", ".igs"),
        ("fit scan.ply -o a", "extension"),
        ("fit scan.ply --report a.xls", ".html"),
        ("fit scan.ply --output-dir scan.ply", "folder"),
        ("fit scan.ply scan2.ply -o a.igs", "--output-dir"),
        (
            "fit scan.ply scan2.ply --output-dir out --report a.html",
            "`--report .html`",
        ),
        ("fit - -o a.igs --report .html", "no name"),
        ("convert scan.ply -o scan.ply", "also an input"),
        ("convert scan.ply -o a.doc", ".glb"),
        ("rarefy scan.ply -o scan.ply", "also an input"),
        ("rarefy scan.ply -o a.igs", ".xyz"),
        ("enrich scan.ply -o scan.ply", "also an input"),
        ("simulate pot -o a.doc", ".ply"),
        ("simulate teapot -o a.ply", "use one of pot"),
        ("simulate teapot -o a.ply", "bracket, knot"),
        ("simulate pot -o a.ply --mesh", "use one of double-torus"),
        ("simulate mug -o a.ply --opening", "does not apply to a mug"),
        ("simulate mug -o a.ply --ordered", "does not apply to a mug"),
    ] {
        bench.refuses(arguments, 2, says);
    }
    for (arguments, says) in [
        (
            "fit scan.ply -o none/a.igs",
            "does not exist; make it first",
        ),
        (
            "fit scan.ply -o a.igs --report none/a.json",
            "does not exist; make it first",
        ),
        (
            "rarefy scan.ply -o none/a.xyz",
            "does not exist; make it first",
        ),
        (
            "simulate pot -o none/a.xyz",
            "does not exist; make it first",
        ),
        ("fit folder.igs", "this is a directory"),
    ] {
        bench.refuses(arguments, 1, says);
    }
}

#[cfg(unix)]
#[test]
fn links_are_the_files_that_they_lead_to() {
    use std::os::unix::fs::symlink;
    let bench = Bench::with_scan("patch -o scan.ply");
    symlink("scan.ply", bench.path("link.ply")).unwrap();
    symlink(".", bench.path("here")).unwrap();
    for (arguments, says) in [
        ("rarefy scan.ply -o link.ply", "also an input"),
        ("convert link.ply -o scan.ply", "also an input"),
        ("convert scan.ply -o here/scan.ply", "also an input"),
        ("convert scan.ply -o a.xyz -o here/a.xyz", "named twice"),
    ] {
        bench.refuses(arguments, 2, says);
    }
}

#[test]
fn words_that_mean_nothing() {
    let bench = Bench::with_scan("patch -o scan.ply");
    for (arguments, says) in [
        ("fit", "SCAN"),
        ("skin scan.ply", "unrecognized subcommand"),
        (
            "fit scan.ply --tolerance -1",
            "a tolerance is a positive length",
        ),
        ("fit scan.ply -t -1mm", "a tolerance is a positive length"),
        ("fit scan.ply -t nan", "not a length"),
        ("fit scan.ply -t 1 --within 99.5", "99.5%"),
        ("fit scan.ply --within 99%", "--tolerance"),
        ("fit scan.ply --from foo", "ply"),
        ("fit scan.ply --to step", "`-o -`"),
        ("fit scan.ply -q -v", "--verbose"),
        ("enrich scan.ply -o a.txt --rarefy 20", "--rarefy"),
        ("rarefy scan.ply -o a.txt --enrich 2", "--enrich"),
        ("fit scan.ply -t 5parsec", "thou"),
        ("fit scan.ply --grid 5", "29x13"),
        ("fit scan.ply --degree 0", "degree"),
        ("fit scan.ply --rarefy 200", "degrees"),
        ("fit scan.ply --method magic", "interpolate"),
        ("fit scan.ply --topology cube", "torus"),
        ("fit scan.ply --hold-out 0.9", "0.5"),
        ("fit scan.ply --unit parsec", "mm"),
        ("fit scan.ply --threads 0", "1"),
        ("fit scan.ply --max-control-points 1", "4"),
        ("rarefy scan.ply", "--output"),
        ("simulate pot -o a.ply --noise -1", "0 or more"),
        ("simulate pot -o a.ply --points 5", "16"),
    ] {
        let done = bench.run(arguments);
        assert_eq!(done.status, 2, "{arguments}: {done:?}");
        assert!(done.stderr.contains(says), "{arguments}: {}", done.stderr);
        assert_eq!(done.stdout, "");
    }
    assert_eq!(bench.files(), ["scan.ply"]);
}

#[test]
fn bad_files() {
    let bench = Bench::with_scan("pot --points 900 -o scan.ply");
    let whole = std::fs::read(bench.path("scan.ply")).unwrap();
    bench.write("short.ply", &whole[..whole.len() / 2]);
    bench.write("empty.ply", "");
    bench.write("empty.xyz", "");
    bench.write("noise.ply", [0_u8, 159, 146, 150].repeat(99));
    bench.write("noise.xyz", [0_u8, 159, 146, 150].repeat(99));
    bench.write(
        "prose.txt",
        "Once upon a time there was a scan.\nIt had no numbers.\n",
    );
    bench.write("nothing.xyz", "nan nan nan\n".repeat(300));
    bench.write("spot.xyz", "1 2 3\n".repeat(300));
    let line = |k: i32| format!("{k} {} {}\n", 2 * k, 3 * k);
    bench.write("line.xyz", (0..300).map(line).collect::<String>());
    bench.write("few.xyz", "0 0 0\n1 0 0\n0 1 0\n");
    bench.write("lies.ply", "ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n");
    std::fs::create_dir(bench.path("folder")).unwrap();
    for (arguments, says) in [
        ("missing.ply", "no such file"),
        ("folder", "directory"),
        ("empty.ply", "empty"),
        ("empty.xyz", "empty"),
        ("short.ply", "truncated"),
        ("lies.ply", ""),
        ("noise.ply", ""),
        ("noise.xyz", "binary"),
        ("prose.txt", "line"),
        ("nothing.xyz", ""),
        ("spot.xyz", "spot"),
        ("line.xyz", "line"),
        ("few.xyz", ""),
        ("spot.xyz --grid 20x15", ""),
        ("line.xyz --grid 20x15", "line"),
        ("line.xyz --grid 20x16", "--grid 20x16 needs 320 points"),
        ("line.xyz --grid 9999999999x9999999999", "--grid"),
        ("few.xyz --grid 3x1", ""),
        ("few.xyz --grid 1x3", ""),
        ("line.xyz --method interpolate", "--grid"),
        // What it is comes before how it may be ordered.
        ("line.xyz --topology tube", "one line"),
    ] {
        bench.refuses(&format!("fit {arguments} -o a.igs"), 1, says);
        let name = arguments.split(' ').next().unwrap();
        bench.refuses(&format!("fit {arguments} -o a.igs --json --quiet"), 1, name);
    }
    for verb in ["rarefy", "enrich"] {
        for (name, says) in [
            ("spot.xyz", "--grid"),
            ("missing.ply", "no such file"),
            ("short.ply", "truncated"),
        ] {
            bench.refuses(&format!("{verb} {name} -o a.txt"), 1, says);
            bench.refuses(&format!("{verb} {name} -o a.txt"), 1, name);
        }
    }
}

#[test]
fn odd_files_that_are_scans() {
    let bench = Bench::with_scan("face --points 2000 --shuffled -o scan.xyz");
    let scan = bench.read("scan.xyz");
    bench.write("nan.xyz", format!("{scan}nan nan nan\n1 inf 2\n"));
    let found = bench.json("fit nan.xyz --force -t 0.5", 0);
    assert_eq!(found["input"]["rejected"]["non_finite"], 2);
    bench.write(
        "twice.xyz",
        format!("{scan}{}", scan.lines().last().unwrap()),
    );
    let found = bench.json("fit twice.xyz --force -t 0.5", 0);
    assert_eq!(found["input"]["rejected"]["duplicate"], 1);
    let grid = |at: f64, step: f64| -> String {
        let point = |k: i32| {
            let (x, y) = (f64::from(k % 30), f64::from(k / 30));
            format!(
                "{} {} {}\n",
                at + step * x,
                at + step * y,
                at + step * 0.01 * x * y
            )
        };
        (0..900).map(point).collect()
    };
    bench.write("far.xyz", grid(1e12, 1.0));
    bench.write("huge.xyz", grid(0.0, 1e12));
    bench.write("tiny.xyz", grid(0.0, 1e-9));
    bench.write(
        "flat.xyz",
        grid(0.0, 1.0)
            .lines()
            .map(|l| format!("{} 0\n", l.rsplit_once(' ').unwrap().0))
            .collect::<String>(),
    );
    for name in ["far", "huge", "tiny", "flat"] {
        bench.json(&format!("fit {name}.xyz --force"), 0);
        bench.json(&format!("fit {name}.xyz --force --grid 30x30"), 0);
    }
    // A hole of one point in an array is filled, and the point counted.
    let holed: String = grid(0.0, 1.0)
        .lines()
        .enumerate()
        .map(|(k, l)| {
            if k == 444 {
                "nan nan nan\n".into()
            } else {
                format!("{l}\n")
            }
        })
        .collect();
    bench.write("holed.xyz", holed);
    let found = bench.json("fit holed.xyz --force --grid 30x30", 0);
    assert_eq!(found["input"]["rejected"]["non_finite"], 1);
    assert_eq!(found["method"], "interpolate");
}

#[cfg(unix)]
#[test]
fn folders_that_may_not_be_written() {
    use std::os::unix::fs::PermissionsExt;
    let bench = Bench::with_scan("patch -o scan.ply");
    bench.refuses("fit scan.ply -o no/such/folder/a.igs", 1, "no/such/folder");
    std::fs::create_dir(bench.path("sealed")).unwrap();
    let seal = |mode| {
        std::fs::set_permissions(bench.path("sealed"), std::fs::Permissions::from_mode(mode))
            .unwrap();
    };
    seal(0o555);
    if std::fs::write(bench.path("sealed/probe"), "").is_ok() {
        eprintln!("skipped: this user may write everywhere");
        std::fs::remove_file(bench.path("sealed/probe")).unwrap();
    } else {
        bench.refuses("fit scan.ply -o sealed/a.igs", 1, "sealed");
    }
    seal(0o755);
    // /proc refuses everybody.
    if std::path::Path::new("/proc/self").exists() {
        bench.refuses("fit scan.ply -o /proc/a.igs", 1, "/proc/a.igs");
    }
}

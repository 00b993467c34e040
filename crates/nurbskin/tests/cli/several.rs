//! Several scans, the same bytes for any number of threads, silence, and Ctrl-C.

use super::{Bench, text};

#[test]
fn many_scans_go_on_after_a_failure() {
    let bench = Bench::with_scan("patch -o good.ply");
    bench.run("simulate torus --points 900 -o ring.txt");
    let bare: String = bench
        .read("ring.txt")
        .lines()
        .filter(|line| !line.contains("unit"))
        .map(|line| format!("{line}\n"))
        .collect();
    bench.write("ring.txt", bare);
    bench.write("bad.ply", "");
    let done = bench.run("fit good.ply bad.ply ring.txt --output-dir out/deep");
    assert_eq!(done.status, 1, "{done:?}");
    // A line for each scan, with its unit, check, verdict, time and output; and one for all.
    let lines: Vec<&str> = done.stdout.lines().collect();
    assert_eq!(lines.len(), 5, "{}", done.stdout);
    for title in ["scan", "unit", "95 %", "check", "verdict", "time", "output"] {
        assert!(lines[0].contains(title), "{title}: {}", lines[0]);
    }
    for (line, words) in [
        (
            1,
            vec![
                "good.ply",
                " mm ",
                " pass ",
                "not asked",
                " s ",
                "out/deep/good.step",
            ],
        ),
        (2, vec!["bad.ply", "error", "the file is empty"]),
        (3, vec!["ring.txt", "mm assumed", "out/deep/ring.step"]),
        (4, vec!["2 written, 1 error, "]),
    ] {
        for word in words {
            assert!(lines[line].contains(word), "{word}: {}", lines[line]);
        }
    }
    // What is to be minded names its file.
    assert!(done.stderr.contains("error: bad.ply"), "{}", done.stderr);
    assert!(
        done.stderr
            .contains("warning: ring.txt: the file does not say its unit"),
        "{}",
        done.stderr
    );
    assert!(bench.path("out/deep/good.step").exists() && bench.path("out/deep/ring.step").exists());
    assert_eq!(
        std::fs::read_dir(bench.path("out/deep")).unwrap().count(),
        2
    );

    let done = bench.run("fit good.ply bad.ply ring.txt --output-dir out --json --quiet");
    assert_eq!(done.status, 1);
    let list: serde_json::Value = serde_json::from_str(&done.stdout).unwrap();
    assert_eq!(list["schema"], 2);
    assert_eq!(text(&list, "/scans/0/verdict"), "not_asked");
    assert_eq!(text(&list, "/scans/1/error/kind"), "read");
    assert!(text(&list, "/scans/1/error/message").contains("empty"));
    assert_eq!(text(&list, "/scans/2/surface/topology"), "torus");
    assert_eq!(
        (&list["summary"]["written"], &list["summary"]["errors"]),
        (&2.into(), &1.into())
    );

    // What is there is replaced on demand only, and that is said.
    bench.refuses("fit good.ply ring.txt --output-dir out", 2, "--force");
    let done = bench.run("fit good.ply ring.txt --output-dir out --force");
    assert_eq!(done.status, 0);
    assert!(
        done.stdout.contains("out/good.step (replaced)"),
        "{}",
        done.stdout
    );
    let done = bench.run("fit good.ply ring.txt --output-dir out --force -t 1e-30");
    assert_eq!(done.status, 3);
    for words in ["tolerance", "within", "did not pass"] {
        assert!(done.stdout.contains(words), "{words}: {}", done.stdout);
    }
    // Beside the scans where no folder is named.
    assert_eq!(bench.run("fit good.ply ring.txt").status, 0);
    assert!(bench.path("good.step").exists() && bench.path("ring.step").exists());
    // Two results of one name would overwrite each other.
    bench.run("simulate patch -o out/good.ply");
    bench.refuses(
        "fit good.ply out/good.ply --output-dir same",
        2,
        "named twice",
    );
}

#[test]
fn each_of_many_scans_has_its_reports() {
    let bench = Bench::with_scan("patch -o a.ply");
    bench.run("simulate saddle --points 900 -o b.txt");
    let fit = "fit a.ply b.txt --output-dir out --report .html --report .CSV --title Both --note part=R-7";
    assert_eq!(bench.run(fit).status, 0);
    for name in ["a", "b"] {
        let page = bench.read(&format!("out/{name}.html"));
        assert!(page.contains("Both") && page.contains("R-7"), "{name}");
        let rows = bench.read(&format!("out/{name}.CSV"));
        assert!(rows.starts_with("index,x,y,z,"), "{name}: {rows}");
    }
    assert_eq!(std::fs::read_dir(bench.path("out")).unwrap().count(), 6);
    // Nobody named them, so none is replaced.
    std::fs::remove_file(bench.path("out/a.step")).unwrap();
    std::fs::remove_file(bench.path("out/b.step")).unwrap();
    bench.refuses(fit, 2, "out/a.html and 3 other outputs exist already");
    assert_eq!(bench.run(&format!("{fit} --force")).status, 0);
    // A single scan has the same; beside the scan where no folder is named, whatever its surface is called.
    let done = bench.run("fit a.ply -o surface.igs --report .json --report named.html");
    assert_eq!(done.status, 0);
    assert!(bench.path("a.json").exists() && bench.path("named.html").exists());
    bench.refuses(
        "fit a.ply -o surface.igs --report .json",
        2,
        "a.json exists already: name the report, as in `--report FILE`",
    );
    assert_eq!(
        bench
            .run("fit a.ply -o surface.igs --report named.html")
            .status,
        0
    );
    // It is not the scan.
    bench.refuses("fit b.txt -o b.step --report .txt", 2, ".html");
    bench.run("convert b.txt -o b.csv");
    bench.refuses(
        "fit b.csv -o b.step --report .csv --force",
        2,
        "also an input",
    );
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    for (scan, options) in [
        ("pot --points 3000 -o scan.ply", ""),
        (
            "face --points 3000 --noise 0.1 --outliers 0.01 --shuffled -o scan.ply",
            "",
        ),
        (
            "torus --points 3000 --noise 0.1 -o scan.ply",
            "--hold-out 0.2",
        ),
    ] {
        let bench = Bench::with_scan(scan);
        let results: Vec<[String; 2]> = [1, 2, 3, 2]
            .iter()
            .map(|threads| {
                let done = bench.run(&format!(
                    "fit scan.ply -o a.igs --report a.csv --threads {threads} {options}"
                ));
                assert!(matches!(done.status, 0 | 3), "{done:?}");
                let both = ["a.igs", "a.csv"].map(|name| bench.read(name));
                for name in ["a.igs", "a.csv"] {
                    std::fs::remove_file(bench.path(name)).unwrap();
                }
                both
            })
            .collect();
        assert!(results.windows(2).all(|w| w[0] == w[1]), "{scan}");
    }
}

#[test]
fn silence_and_plain_text() {
    let bench = Bench::with_scan("patch -o scan.ply");
    let done = bench.run("fit scan.ply --force --quiet");
    assert_eq!(
        (done.status, done.stdout.as_str(), done.stderr.as_str()),
        (0, "", "")
    );
    let output = bench
        .command("fit scan.ply --force")
        .env("NO_COLOR", "1")
        .output()
        .unwrap();
    assert!(output.stderr.is_empty());
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(
        !said.contains('\u{1b}') && said.contains("verdict     not asked"),
        "{said}"
    );
    assert!(!said.contains("-0.00"), "{said}");
    let done = bench.run("--version");
    assert_eq!(
        (done.status, done.stdout.as_str()),
        (0, concat!("nurbskin ", env!("CARGO_PKG_VERSION"), "\n"))
    );
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_nothing() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    let bench = Bench::with_scan("face --points 250000 --noise 0.05 --shuffled -o scan.ply");
    std::fs::create_dir(bench.path("out")).unwrap();
    let mut fit = bench
        .command("fit scan.ply -o out/a.igs")
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(600));
    if fit.try_wait().unwrap().is_some() {
        eprintln!("skipped: the fit was faster");
        return;
    }
    assert!(
        Command::new("kill")
            .args(["-INT", &fit.id().to_string()])
            .status()
            .unwrap()
            .success()
    );
    let start = Instant::now();
    let status = fit.wait().unwrap();
    assert_eq!(status.code(), Some(1));
    assert!(
        start.elapsed() < Duration::from_secs(5),
        "{:?}",
        start.elapsed()
    );
    assert_eq!(std::fs::read_dir(bench.path("out")).unwrap().count(), 0);
}

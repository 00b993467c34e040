//! The command as its users and their scripts see it: files, exit status, JSON, sentences.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stderr,
    reason = "a test that fails shall panic, and one that skips says why"
)]

mod app;
mod deviation;
mod fit;
mod info;
mod manners;
mod pages;
mod records;
mod refused;
mod several;
mod streams;
mod verbs;

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// A folder to work in.
struct Bench {
    folder: TempDir,
}

/// What a call of the command left.
#[derive(Debug)]
struct Done {
    status: i32,
    stdout: String,
    stderr: String,
}

impl Bench {
    fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
        }
    }

    /// With a scan by the virtual scanner.
    fn with_scan(arguments: &str) -> Self {
        let bench = Self::new();
        let done = bench.run(&format!("simulate {arguments} --quiet"));
        assert_eq!(done.status, 0, "{done:?}");
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).unwrap();
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// Names of all files, sorted.
    fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<String> = entries
            .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_nurbskin"));
        command
            .args(arguments.split_whitespace())
            .current_dir(self.folder.path())
            // Pages go there unless another place is named.
            .env("TMPDIR", self.folder.path())
            // The headers of files hold the same date in every call.
            .env("SOURCE_DATE_EPOCH", "1750000000")
            .stdin(Stdio::null());
        command
    }

    /// Runs `nurbskin arguments` in the folder; arguments are separated by blanks.
    fn run(&self, arguments: &str) -> Done {
        let output = self.command(arguments).output().unwrap();
        Done {
            status: output.status.code().unwrap_or(-1),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// Runs with these bytes on standard input.
    fn run_with_input(&self, arguments: &str, input: &[u8]) -> Done {
        use std::io::Write;
        let mut child = self
            .command(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stdin = child.stdin.take().unwrap();
        let input = input.to_vec();
        // A command that refuses its arguments reads nothing.
        let writer = std::thread::spawn(move || drop(stdin.write_all(&input)));
        let output = child.wait_with_output().unwrap();
        writer.join().unwrap();
        Done {
            status: output.status.code().unwrap_or(-1),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// Runs with `--json`, which must print one object of this schema and nothing else.
    fn json(&self, arguments: &str, status: i32) -> Value {
        let done = self.run(&format!("{arguments} --json"));
        assert_eq!(done.status, status, "{arguments}: {done:?}");
        assert_eq!(done.stderr, "", "{arguments}");
        let value: Value = serde_json::from_str(&done.stdout).unwrap();
        assert_eq!(value["schema"], 2, "{arguments}");
        value
    }

    /// Runs what must fail with this status, one sentence that holds `says`, no output and no new file. With `--json` the
    /// sentence is on stdout, too, in an object.
    fn refuses(&self, arguments: &str, status: i32, says: &str) {
        let before = self.files();
        let done = self.run(arguments);
        assert_eq!(done.status, status, "{arguments}: {done:?}");
        if arguments.contains("--json") {
            let found: Value = serde_json::from_str(&done.stdout).unwrap();
            assert_eq!(found["schema"], 2, "{arguments}");
            let message = text(&found, "/error/message");
            assert_eq!(done.stderr, format!("error: {message}\n"), "{arguments}");
            assert!(!text(&found, "/error/kind").is_empty());
        } else {
            assert_eq!(done.stdout, "", "{arguments}");
        }
        assert!(done.stderr.starts_with("error: "), "{}", done.stderr);
        assert_eq!(
            done.stderr.lines().count(),
            1,
            "{arguments}: {}",
            done.stderr
        );
        assert!(done.stderr.contains(says), "{arguments}: {}", done.stderr);
        assert_eq!(self.files(), before, "{arguments}");
    }
}

fn number(value: &Value, pointer: &str) -> f64 {
    let found = value.pointer(pointer).and_then(Value::as_f64);
    found.unwrap_or_else(|| panic!("no number {pointer} in {value:#}"))
}

fn text<'a>(value: &'a Value, pointer: &str) -> &'a str {
    let found = value.pointer(pointer).and_then(Value::as_str);
    found.unwrap_or_else(|| panic!("no text {pointer} in {value:#}"))
}

fn counts(value: &Value, pointer: &str) -> [u64; 2] {
    [0, 1].map(|d| {
        let found = value
            .pointer(&format!("{pointer}/{d}"))
            .and_then(Value::as_u64);
        found.unwrap_or_else(|| panic!("no count {pointer} in {value:#}"))
    })
}

/// The points of a text file.
fn points(path: &Path) -> Vec<[f64; 3]> {
    std::fs::read_to_string(path)
        .unwrap()
        .lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_digit() || c == '-'))
        .map(|line| {
            let numbers: Vec<f64> = line
                .split([' ', ','])
                .map(|word| word.parse().unwrap())
                .collect();
            [numbers[0], numbers[1], numbers[2]]
        })
        .collect()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt()
}

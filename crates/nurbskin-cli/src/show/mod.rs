//! What people and scripts see. Results go to stdout, as text or as one JSON object; progress, warnings and errors to
//! stderr.

mod batch;
mod check;
mod deviation;
mod fit;
mod info;
mod measured;
mod progress;
pub(crate) mod text;

use crate::args::Common;
use crate::failure::{Failure, Result};
use nurbskin::pipeline::{Output, SCHEMA};
use serde::Serialize;
use serde_json::{Value, json};
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};
use text::{ERROR, NOTE, Page, WARNING};

pub(crate) use batch::Batch;
pub(crate) use progress::{Terminal, cancel};

/// How much is shown, and in which form.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Show {
    json: bool,
    quiet: bool,
    verbose: bool,
}

/// Files that were there before, and so are replaced if they are written.
#[derive(Clone, Debug, Default)]
pub(crate) struct Replaced(Vec<PathBuf>);

impl Replaced {
    /// Those of `outputs` that are there now.
    pub(crate) fn among<'a>(outputs: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        let there = outputs.into_iter().filter(|path| path.exists());
        Self(there.cloned().collect())
    }

    fn has(&self, path: &Path) -> bool {
        self.0.iter().any(|old| old == path)
    }
}

impl Show {
    pub(crate) fn new(common: &Common) -> Self {
        Self {
            json: common.json,
            quiet: common.quiet,
            verbose: common.verbose,
        }
    }

    /// For what goes wrong before the arguments are understood.
    pub(crate) fn plain(json: bool) -> Self {
        Self {
            json,
            quiet: false,
            verbose: false,
        }
    }

    /// The failure that ends the program: a sentence on stderr, with `--json` an object on stdout.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn failed(&self, failure: &Failure) -> Result<()> {
        self.error(failure);
        self.json(&json!({ "error": failure.json() }))
    }

    /// A failure after which the program goes on.
    pub(crate) fn error(&self, failure: &Failure) {
        tell("error", ERROR, &failure.to_string());
    }

    /// Something that may change what the result is worth.
    pub(crate) fn warning(&self, sentence: &str) {
        if !self.quiet && !self.json {
            tell("warning", WARNING, sentence);
        }
    }

    /// A line of the chronicle, with `--verbose`.
    pub(crate) fn detail(&self, sentence: &str) {
        if self.verbose && !self.json {
            tell("note", NOTE, sentence);
        }
    }

    /// Warnings, each once; those that differ in numbers only are one line, but with `--verbose`.
    pub(crate) fn warnings(&self, warnings: &[String], already: &[String]) {
        let new: Vec<String> = warnings
            .iter()
            .filter(|w| !already.contains(w))
            .cloned()
            .collect();
        let new = if self.verbose { new } else { folded(&new) };
        for warning in new {
            self.warning(&warning);
        }
    }

    /// The result of a verb, where people read it.
    ///
    /// # Errors
    /// As [`print()`].
    fn result(&self, page: Page) -> Result<()> {
        if self.quiet || self.json {
            return Ok(());
        }
        print(&page.finish())
    }

    /// One JSON object, where it is asked for.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn json(&self, value: &impl Serialize) -> Result<()> {
        self.json_of(value, &Replaced::default())
    }

    /// One JSON object, where it is asked for, in which the outputs that took the place of another file say so.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn json_of(&self, value: &impl Serialize, replaced: &Replaced) -> Result<()> {
        if !self.json {
            return Ok(());
        }
        let mut value = serde_json::to_value(value)?;
        versioned(&mut value);
        mark_replaced(&mut value, replaced);
        print(&format!("{}\n", serde_json::to_string_pretty(&value)?))
    }

    /// The result of a verb that judges nothing: a sentence, and the files.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn done(
        &self,
        value: &impl Serialize,
        rows: &[(&str, String)],
        outputs: &[Output],
        replaced: &Replaced,
    ) -> Result<()> {
        self.json_of(value, replaced)?;
        let mut page = Page::new();
        for (label, body) in rows {
            page.row(label, body);
        }
        written(&mut page, outputs, replaced, None);
        self.result(page)
    }

    /// A line of data on stdout, whatever is asked to be quiet.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn data(&self, text: &str) -> Result<()> {
        if self.json { Ok(()) } else { print(text) }
    }

    /// Opens a page in the browser, or prints where it is.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn viewed(&self, path: &Path, no_open: bool) -> Result<()> {
        if no_open {
            return self.data(&format!("{}\n", path.display()));
        }
        match open::that_detached(path) {
            Ok(()) => {
                let mut page = Page::new();
                page.row("opened", &path.display().to_string());
                self.result(page)
            }
            // The page is there all the same.
            Err(error) => {
                self.warning(&format!(
                    "no browser can be opened ({error}); open this page yourself: {}",
                    path.display()
                ));
                Ok(())
            }
        }
    }
}

/// The files that were written, and the seconds that all took.
fn written(page: &mut Page, outputs: &[Output], replaced: &Replaced, seconds: Option<f64>) {
    for (k, output) in outputs.iter().enumerate() {
        let label = if k == 0 { "written" } else { "" };
        page.row(label, &text::output(output, replaced.has(&output.path)));
    }
    if let Some(seconds) = seconds {
        page.row("time", &text::seconds(seconds));
    }
}

/// Warnings of which those that differ only in numbers are one: the first, and how many there are.
fn folded(warnings: &[String]) -> Vec<String> {
    let kind = |text: &str| -> String {
        let word = |word: &str| !word.contains(|c: char| c.is_ascii_digit());
        text.split_whitespace()
            .filter(|w| word(w))
            .collect::<Vec<_>>()
            .join(" ")
    };
    let mut kinds: Vec<(String, &String, usize)> = Vec::new();
    for warning in warnings {
        let kind = kind(warning);
        match kinds.iter_mut().find(|known| known.0 == kind) {
            Some(known) => known.2 += 1,
            None => kinds.push((kind, warning, 1)),
        }
    }
    kinds
        .into_iter()
        .map(|(_, first, count)| match count {
            1 => first.clone(),
            n => format!("{first} (and {} more like this; -v prints all)", n - 1),
        })
        .collect()
}

/// Puts the version of the JSON into it, where it does not say that itself.
fn versioned(value: &mut Value) {
    if let Value::Object(object) = value
        && !object.contains_key("schema")
    {
        let nurbskin = object.shift_remove("nurbskin");
        let rest = std::mem::take(object);
        let version = nurbskin.unwrap_or_else(|| json!(env!("CARGO_PKG_VERSION")));
        object.insert("nurbskin".into(), version);
        object.insert("schema".into(), json!(SCHEMA));
        object.extend(rest);
    }
}

/// Says of each output whether it took the place of another file.
fn mark_replaced(value: &mut Value, replaced: &Replaced) {
    let Some(Value::Array(outputs)) = value.get_mut("outputs") else {
        return;
    };
    for output in outputs {
        let path = output.get("path").and_then(Value::as_str);
        let is = path.is_some_and(|path| replaced.has(Path::new(path)));
        if let (true, Value::Object(output)) = (is, output) {
            output.insert("replaced".into(), json!(true));
        }
    }
}

/// A line on stderr. Where nobody can read it, there is nobody to tell that.
fn tell(kind: &str, style: anstyle::Style, sentence: &str) {
    let text = text::message(kind, style, sentence, text::stderr_width());
    let _ = anstream::stderr().lock().write_all(text.as_bytes());
}

/// Whether people see stdout and stderr in one place.
fn one_terminal() -> bool {
    std::io::stdout().is_terminal() && std::io::stderr().is_terminal()
}

/// Writes to stdout. A reader that has seen enough is no failure.
///
/// # Errors
/// What keeps stdout from taking it.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut out = anstream::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Failure::write(format!(
            "cannot write to standard output: {error}"
        ))),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_that_differ_in_numbers_are_one() {
        let note = |k: usize| format!("edge #{k}: the curves differ by {}e-1 mm", k + 1);
        let mut all: Vec<String> = (0..28).map(note).collect();
        all.push("another thing".into());
        let shown = folded(&all);
        assert_eq!(shown.len(), 2);
        assert!(shown[0].starts_with("edge #0: the curves") && shown[0].contains("27 more"));
        assert_eq!(shown[1], "another thing");
    }

    #[test]
    fn every_object_has_a_version_first() {
        let mut value = json!({ "b": 1, "outputs": [{ "path": "a.step" }, { "path": "b.step" }] });
        versioned(&mut value);
        mark_replaced(&mut value, &Replaced(vec!["b.step".into()]));
        let text = value.to_string();
        assert!(text.starts_with("{\"nurbskin\":"), "{text}");
        assert_eq!(value["schema"], 2);
        assert!(value["outputs"][0].get("replaced").is_none());
        assert_eq!(value["outputs"][1]["replaced"], true);
    }
}

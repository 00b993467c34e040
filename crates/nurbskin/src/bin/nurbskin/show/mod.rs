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
use nurbskin::pipeline::{Converted, Output, SCHEMA, Target};
use serde::Serialize;
use serde_json::{Value, json};
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::Path;
use text::{ERROR, NOTE, Page, WARNING};

pub(crate) use batch::Batch;
pub(crate) use measured::sized;
pub(crate) use progress::{Terminal, cancel};

/// How much is shown, and in which form.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Show {
    json: bool,
    quiet: bool,
    verbose: bool,
    /// Whether stdout is taken by an output, and results go to stderr.
    aside: bool,
}

impl Show {
    pub(crate) fn new(common: &Common) -> Self {
        Self {
            json: common.json,
            quiet: common.quiet,
            verbose: common.verbose,
            aside: false,
        }
    }

    /// For what goes wrong before the arguments are understood.
    pub(crate) fn plain(json: bool) -> Self {
        Self {
            json,
            quiet: false,
            verbose: false,
            aside: false,
        }
    }

    /// The same, for a verb with these outputs: where one of them goes to stdout, the result goes to stderr.
    ///
    /// # Errors
    /// Wrong usage where JSON is asked for as well.
    pub(crate) fn beside(self, outputs: &[Target]) -> Result<Self> {
        let aside = outputs.iter().any(|output| output.as_file().is_none());
        if aside && self.json {
            return Err(Failure::usage(
                "--json and `-o -` both write to standard output: name a file with -o",
            ));
        }
        Ok(Self { aside, ..self })
    }

    /// An empty page of results.
    fn page(&self) -> Page {
        Page::new(if self.aside {
            text::stderr_width()
        } else {
            text::stdout_width()
        })
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

    /// The chronicle, with `--verbose`.
    pub(crate) fn details(&self, sentences: &[String]) {
        if self.verbose && !self.json {
            for sentence in sentences {
                tell("note", NOTE, sentence);
            }
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
        if self.aside {
            // Where nobody can read it, there is nobody to tell that.
            let _ = anstream::stderr()
                .lock()
                .write_all(page.finish().as_bytes());
            return Ok(());
        }
        print(&page.finish())
    }

    /// One JSON object, where it is asked for.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn json(&self, value: &impl Serialize) -> Result<()> {
        if !self.json {
            return Ok(());
        }
        let mut value = serde_json::to_value(value)?;
        versioned(&mut value);
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
    ) -> Result<()> {
        self.json(value)?;
        let mut page = self.page();
        for (label, body) in rows {
            page.row(label, body);
        }
        written(&mut page, outputs, None);
        self.result(page)
    }

    /// The result of a conversion.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn converted(&self, done: &Converted, told: &[String]) -> Result<()> {
        self.warnings(&done.warnings, told);
        let input = &done.input;
        let what = match (input.faces, input.points) {
            (Some(n), _) => nurbskin::unit::counted(n, "face", "faces"),
            (None, n) => nurbskin::unit::counted(n.unwrap_or(0), "point", "points"),
        };
        let size = measured::sized(input.bounding_box, input.unit, input.unit_source);
        let read = format!("{}: {what}{size}", input.path);
        self.done(done, &[("read", read)], &done.outputs)
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
        self.opened(&path.display().to_string(), no_open)
    }

    /// Opens the page at an address or a path in the browser, or prints where it is.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn opened(&self, address: &str, no_open: bool) -> Result<()> {
        if no_open {
            return self.data(&format!("{address}\n"));
        }
        match open::that_detached(address) {
            Ok(()) => {
                let mut page = self.page();
                page.row("opened", address);
                self.result(page)
            }
            // The page is there all the same.
            Err(error) => {
                self.warning(&format!(
                    "no browser can be opened ({error}); open this page yourself: {address}"
                ));
                Ok(())
            }
        }
    }
}

/// The files that were written, and the seconds that all took.
fn written(page: &mut Page, outputs: &[Output], seconds: Option<f64>) {
    for (k, output) in outputs.iter().enumerate() {
        let label = if k == 0 { "written" } else { "" };
        page.row(label, &text::output(output));
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
        let mut value = json!({ "b": 1 });
        versioned(&mut value);
        let text = value.to_string();
        assert!(text.starts_with("{\"nurbskin\":"), "{text}");
        assert_eq!(value["schema"], 2);
    }
}

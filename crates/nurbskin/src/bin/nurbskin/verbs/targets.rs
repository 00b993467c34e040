//! Where scans come from and results go: files, standard input and output; and what must not be overwritten.

use crate::failure::{Failure, Result};
use nurbskin::pipeline::{self, Output, STREAMED, Source, Target};
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};

/// Whether a word on the command line means standard input or output.
pub(super) fn is_stream(path: &Path) -> bool {
    path == Path::new(STREAMED)
}

/// What is to be read: standard input for `-`, else a file or a pipe; `from` is its format, where that is said.
pub(super) fn source(path: &Path, from: Option<&str>) -> Result<Source> {
    if is_stream(path) {
        let input = std::io::stdin();
        if input.is_terminal() {
            return Err(Failure::usage(
                "`-` reads standard input, which is the terminal: send a file to it with `<` or `|`",
            ));
        }
        return Ok(Source::stream("standard input", input.lock(), from)?);
    }
    Ok(Source::open(path, from)?)
}

/// Where results go: standard output in the format `to`, else the `usual` one, for `-`; else files.
pub(super) fn targets(outputs: &[PathBuf], to: Option<&str>, usual: &str) -> Result<Vec<Target>> {
    if to.is_some() && !outputs.iter().any(|path| is_stream(path)) {
        return Err(Failure::usage(
            "--to is the format of standard output; add `-o -`, or leave --to out: the format of a file follows its \
             extension",
        ));
    }
    let target = |path: &PathBuf| match is_stream(path) {
        true => Target::Memory(to.unwrap_or(usual).to_owned()),
        false => Target::File(path.clone()),
    };
    Ok(outputs.iter().map(target).collect())
}

/// Refuses, before anything is read, outputs that cannot be written or are also inputs.
pub(super) fn check(inputs: &[PathBuf], targets: &[Target], formats: &[&str]) -> Result<()> {
    let files = inputs.iter().filter(|path| !is_stream(path));
    if inputs.len() - files.clone().count() > 1 {
        return Err(Failure::usage("standard input, `-`, can be read only once"));
    }
    let sources: Vec<Source> = files.map(Source::file).collect();
    pipeline::check_targets(&sources, targets, formats).map_err(Failure::refused)
}

/// Writes the outputs that are no file to standard output, as they are. A reader that has seen enough is no failure.
pub(super) fn pass_on(outputs: &[Output]) -> Result<()> {
    let mut out = std::io::stdout().lock();
    for content in outputs.iter().filter_map(|output| output.content.as_ref()) {
        match out.write_all(content).and_then(|()| out.flush()) {
            Err(error) if error.kind() != ErrorKind::BrokenPipe => {
                return Err(Failure::write(format!(
                    "cannot write to standard output: {error}"
                )));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Refuses default outputs that are there already: nobody named them, so nobody means to lose them.
pub(super) fn refuse_existing(outputs: &[PathBuf]) -> Result<()> {
    let there: Vec<&PathBuf> = outputs.iter().filter(|path| path.exists()).collect();
    let Some(first) = there.first() else {
        return Ok(());
    };
    let more = match there.len() {
        1 => "exists already".to_owned(),
        2 => "and 1 other output exist already".to_owned(),
        n => format!("and {} other outputs exist already", n - 1),
    };
    let report = |path: &Path| {
        let extension = path.extension().and_then(|e| e.to_str());
        extension.is_some_and(|e| pipeline::REPORT_FORMATS.contains(&e))
    };
    let elsewhere = match outputs.len() {
        1 if report(first) => "name the report, as in `--report FILE`",
        1 => "name another file with -o",
        _ => "name another folder with --output-dir",
    };
    Err(Failure::usage(format!(
        "{} {more}: {elsewhere}, or use --force to replace",
        first.display()
    )))
}

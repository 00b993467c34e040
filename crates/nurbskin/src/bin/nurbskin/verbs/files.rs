//! `info` and `view`: of any number of files, the bad ones told and passed over.

use super::targets::{self, source};
use crate::args::{Info, View, command_line};
use crate::failure::{Failure, Result};
use crate::show::{Show, Terminal};
use crate::{DONE, ERROR};
use nurbskin::pipeline::{self, Target};
use serde_json::{Value, json};
use std::path::Path;

pub(crate) fn info(info: &Info, show: Show) -> Result<u8> {
    targets::check(&info.files, &[], &[])?;
    let mut files = Vec::new();
    let mut status = DONE;
    for path in &info.files {
        let terminal = Terminal::new(show);
        let result = source(path, info.from.as_deref())
            .and_then(|source| Ok(pipeline::info_from(&source, &terminal)?));
        terminal.finish();
        match result {
            Ok(found) => {
                show.information(&found)?;
                files.push(serde_json::to_value(found)?);
            }
            Err(failure) => {
                status = ERROR;
                show.error(&failure);
                files.push(failed(path, &failure));
                if failure.is_cancelled() {
                    break;
                }
            }
        }
    }
    show.json(&json!({ "files": files }))?;
    Ok(status)
}

pub(crate) fn view(view: &View, show: Show) -> Result<u8> {
    if view.output.is_some() && view.files.len() > 1 {
        return Err(Failure::usage(
            "several files make several pages: leave out -o",
        ));
    }
    let page = Target::files(view.output.as_slice());
    targets::check(&view.files, &page, &pipeline::PAGE_FORMATS)?;
    let replaced = view.output.as_ref().is_some_and(|page| page.exists());
    let command = command_line();
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    let mut status = DONE;
    for path in &view.files {
        let terminal = Terminal::new(show);
        let result = source(path, view.from.as_deref()).and_then(|source| {
            let page = view.output.as_deref();
            Ok(pipeline::view_from(
                &source,
                page,
                Some(&command),
                &terminal,
            )?)
        });
        let told = terminal.finish();
        match result {
            Ok(mut viewed) => {
                viewed.output.replaced = replaced;
                show.warnings(&viewed.input.warnings, &told);
                show.viewed(&viewed.output.path, view.no_open)?;
                inputs.push(serde_json::to_value(viewed.input)?);
                outputs.push(viewed.output);
            }
            Err(failure) => {
                status = ERROR;
                show.error(&failure);
                inputs.push(failed(path, &failure));
                if failure.is_cancelled() {
                    break;
                }
            }
        }
    }
    show.json(&json!({ "inputs": inputs, "outputs": outputs }))?;
    Ok(status)
}

/// A file in the list that could not be read.
fn failed(path: &Path, failure: &Failure) -> Value {
    json!({ "path": path.display().to_string(), "error": failure.json() })
}

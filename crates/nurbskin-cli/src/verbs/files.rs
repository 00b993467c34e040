//! `info` and `view`: of any number of files, the bad ones told and passed over.

use crate::args::{Info, View, command_line};
use crate::failure::{Failure, Result};
use crate::show::{Replaced, Show, Terminal};
use crate::{DONE, ERROR};
use nurbskin::pipeline;
use serde_json::{Value, json};
use std::path::Path;

pub(crate) fn info(info: &Info, show: Show) -> Result<u8> {
    let mut files = Vec::new();
    let mut status = DONE;
    for path in &info.files {
        let terminal = Terminal::new(show);
        let result = pipeline::info(path, &terminal);
        terminal.finish();
        match result {
            Ok(found) => {
                show.information(&found)?;
                files.push(serde_json::to_value(found)?);
            }
            Err(error) => {
                status = ERROR;
                let failure = Failure::from(error);
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
    let output = view.output.as_slice();
    pipeline::check_outputs(&view.files, output, &pipeline::PAGE_FORMATS)
        .map_err(Failure::refused)?;
    let replaced = Replaced::among(output);
    let command = command_line();
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    let mut status = DONE;
    for path in &view.files {
        let terminal = Terminal::new(show);
        let result = pipeline::view(path, view.output.as_deref(), Some(&command), &terminal);
        let told = terminal.finish();
        match result {
            Ok(viewed) => {
                show.warnings(&viewed.input.warnings, &told);
                show.viewed(&viewed.output.path, view.no_open)?;
                inputs.push(serde_json::to_value(viewed.input)?);
                outputs.push(viewed.output);
            }
            Err(error) => {
                status = ERROR;
                let failure = Failure::from(error);
                show.error(&failure);
                inputs.push(failed(path, &failure));
                if failure.is_cancelled() {
                    break;
                }
            }
        }
    }
    show.json_of(&json!({ "inputs": inputs, "outputs": outputs }), &replaced)?;
    Ok(status)
}

/// A file in the list that could not be read.
fn failed(path: &Path, failure: &Failure) -> Value {
    json!({ "path": path.display().to_string(), "error": failure.json() })
}

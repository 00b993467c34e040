//! What each verb does: arguments to the library, results to people and scripts, and the exit status.

mod files;
mod fit;
mod ordered;
mod targets;

use crate::args::{Check, Convert, Deviation};
use crate::failure::{Failure, Result};
use crate::show::{Replaced, Show, Terminal};
use crate::{DONE, NOT_PASSED};
use nurbskin::pipeline;

pub(crate) use files::{info, view};
pub(crate) use fit::fit;
pub(crate) use ordered::{enrich, rarefy, simulate};

pub(crate) fn deviation(deviation: &Deviation, show: Show) -> Result<u8> {
    let inputs = [deviation.scan.clone(), deviation.cad.clone()];
    pipeline::check_outputs(&inputs, &deviation.report, &pipeline::REPORT_FORMATS)
        .map_err(Failure::refused)?;
    let replaced = Replaced::among(&deviation.report);
    let terminal = Terminal::new(show);
    let options = deviation.options();
    let compared = pipeline::deviation(&deviation.scan, &deviation.cad, &options, &terminal);
    let told = terminal.finish();
    let compared = compared?;
    show.compared(&compared, &replaced, &told)?;
    Ok(if compared.verdict.is_good() {
        DONE
    } else {
        NOT_PASSED
    })
}

pub(crate) fn check(check: &Check, show: Show) -> Result<u8> {
    let terminal = Terminal::new(show);
    let checked = pipeline::check(&check.cad, &terminal);
    terminal.finish();
    let checked = checked?;
    show.checked(&checked)?;
    Ok(if checked.verdict == "pass" {
        DONE
    } else {
        NOT_PASSED
    })
}

pub(crate) fn convert(convert: &Convert, show: Show) -> Result<u8> {
    pipeline::check_outputs(
        std::slice::from_ref(&convert.input),
        &convert.output,
        &pipeline::CONVERT_FORMATS,
    )
    .map_err(Failure::refused)?;
    let replaced = Replaced::among(&convert.output);
    let terminal = Terminal::new(show);
    let done = pipeline::convert(
        &convert.input,
        &convert.output,
        &convert.options(),
        &terminal,
    );
    let told = terminal.finish();
    let done = done?;
    show.warnings(&done.warnings, &told);
    show.done(&done, &[], &done.outputs, &replaced)?;
    Ok(DONE)
}

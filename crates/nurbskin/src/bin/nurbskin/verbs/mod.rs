//! What each verb does: arguments to the library, results to people and scripts, and the exit status.

mod app;
mod files;
mod fit;
mod ordered;
mod targets;

use crate::args::{Check, Convert, Deviation};
use crate::failure::Result;
use crate::show::{Show, Terminal};
use crate::{DONE, NOT_PASSED};
use nurbskin::pipeline::{self, Target};
use targets::source;

pub(crate) use app::app;
pub(crate) use files::{info, view};
pub(crate) use fit::fit;
pub(crate) use ordered::{enrich, rarefy, simulate};

pub(crate) fn deviation(deviation: &Deviation, show: Show) -> Result<u8> {
    let inputs = [deviation.scan.clone(), deviation.cad.clone()];
    let reports = Target::files(&deviation.report);
    targets::check(&inputs, &reports, &pipeline::REPORT_FORMATS)?;
    let scan = source(&deviation.scan, deviation.from.as_deref())?;
    let cad = source(&deviation.cad, None)?;
    let terminal = Terminal::new(show);
    let compared = pipeline::deviation_from(&scan, &cad, &deviation.options(), &terminal);
    let told = terminal.finish();
    let compared = compared?;
    show.compared(&compared, &told)?;
    Ok(if compared.verdict.is_good() {
        DONE
    } else {
        NOT_PASSED
    })
}

pub(crate) fn check(check: &Check, show: Show) -> Result<u8> {
    let cad = source(&check.cad, check.from.as_deref())?;
    let terminal = Terminal::new(show);
    let checked = pipeline::check_from(&cad, &terminal);
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
    let to = targets::targets(&convert.output, convert.to.as_deref(), "step")?;
    let inputs = std::slice::from_ref(&convert.input);
    targets::check(inputs, &to, &pipeline::CONVERT_FORMATS)?;
    let show = show.beside(&to)?;
    let input = source(&convert.input, convert.from.as_deref())?;
    let terminal = Terminal::new(show);
    let done = pipeline::convert_from(&input, &to, &convert.options(), &terminal);
    let told = terminal.finish();
    let done = done?;
    targets::pass_on(&done.outputs)?;
    show.converted(&done, &told)?;
    Ok(DONE)
}

//! The `nurbskin` command: a thin front end of the library's pipeline.

mod args;
mod failure;
mod show;
mod verbs;

use args::{Cli, Common, Verb};
use clap::{CommandFactory, Parser};
use failure::{Failure, Result};
use show::Show;
use std::process::ExitCode;

/// Done, and nothing is amiss.
const DONE: u8 = 0;
/// An error; nothing was written.
const ERROR: u8 = 1;
/// Wrong usage.
const USAGE: u8 = 2;
/// Done, but the verdict is `fail` or `cannot tell`.
const NOT_PASSED: u8 = 3;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return ExitCode::from(misused(&error)),
    };
    let show = Show::new(&cli.common);
    let done = prepare(&cli.common, show).and_then(|()| run(&cli.verb, show));
    ExitCode::from(done.unwrap_or_else(|failure| {
        // Where stdout cannot be written either, stderr has said why.
        let _ = show.failed(&failure);
        failure.status()
    }))
}

/// Help, the version, or words that cannot be understood; with `--json` among them those are an object on stdout.
fn misused(error: &clap::Error) -> u8 {
    let json = std::env::args_os().any(|word| word == "--json");
    if !error.use_stderr() || !json {
        // Where nobody can read it, there is nobody to tell that.
        let _ = error.print();
        return u8::try_from(error.exit_code()).unwrap_or(USAGE);
    }
    let text = error.render().to_string();
    let message = text.strip_prefix("error: ").unwrap_or(&text);
    let end = ["\n\nUsage:", "\n\nFor more information"]
        .iter()
        .filter_map(|mark| message.find(mark))
        .min();
    let message = &message[..end.unwrap_or(message.len())];
    let failure = Failure::usage(message.trim());
    let _ = Show::plain(true).failed(&failure);
    failure.status()
}

/// Threads and Ctrl-C.
fn prepare(common: &Common, show: Show) -> Result<()> {
    if let Some(threads) = common.threads {
        nurbskin::set_threads(usize::from(threads))?;
    }
    ctrlc::set_handler(move || show::cancel(show))
        .map_err(|error| Failure::system(format!("cannot listen for Ctrl-C: {error}")))
}

fn run(verb: &Verb, show: Show) -> Result<u8> {
    match verb {
        Verb::Fit(fit) => verbs::fit(fit, show),
        Verb::Deviation(deviation) => verbs::deviation(deviation, show),
        Verb::Check(check) => verbs::check(check, show),
        Verb::Info(info) => verbs::info(info, show),
        Verb::View(view) => verbs::view(view, show),
        Verb::App(app) => verbs::app(app, show),
        Verb::Convert(convert) => verbs::convert(convert, show),
        Verb::Rarefy(rarefy) => verbs::rarefy(rarefy, show),
        Verb::Enrich(enrich) => verbs::enrich(enrich, show),
        Verb::Simulate(simulate) => verbs::simulate(simulate, show),
        Verb::Completions { shell } => {
            let mut text = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "nurbskin", &mut text);
            show::print(&String::from_utf8_lossy(&text))?;
            Ok(DONE)
        }
        Verb::Man { folder } => {
            clap_mangen::generate_to(Cli::command(), folder).map_err(|error| {
                Failure::write(format!("cannot write into {}: {error}", folder.display()))
            })?;
            Ok(DONE)
        }
    }
}

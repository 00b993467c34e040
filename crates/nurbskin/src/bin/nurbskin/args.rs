//! What can be typed, and what it means.

mod app;
mod fit;
mod inspect;
mod names;
mod ordered;
mod other;
mod words;

use clap::{ArgAction, Args, Parser, Subcommand};
use std::path::PathBuf;

pub(crate) use app::App;
pub(crate) use fit::Fit;
pub(crate) use inspect::{Check, Deviation, Info, View};
pub(crate) use ordered::{Enrich, Rarefy};
pub(crate) use other::{Convert, Simulate};
pub(crate) use words::command_line;

/// Headings of `--help`.
const OUTPUT: &str = "Output";
const TOLERANCE: &str = "Tolerance and size";
const SURFACE: &str = "Surface";
const ORDERED: &str = "Ordered scans";
const INPUT: &str = "Input";
const COMMON: &str = "Common options";

/// Fit one clean NURBS surface to a 3-D scan, and measure how close it is
///
/// nurbskin fits a single smooth NURBS surface to a 3-D scan, writes it as STEP or IGES, and measures the distance of
/// every scanned point from it. It also compares scans with CAD files and checks CAD files. It is made for reverse
/// engineering and inspection of free-form parts: castings, dies, blades, hulls, vessels, faces.
#[derive(Parser, Debug)]
#[command(
    name = "nurbskin",
    version,
    propagate_version = true,
    disable_help_flag = true,
    disable_version_flag = true,
    subcommand_value_name = "VERB",
    subcommand_help_heading = "Verbs",
    after_help = "Run `nurbskin VERB --help` for the options and examples of a verb.",
    after_long_help = "\
Exit status:
  0  done; the verdict is `pass`, or no tolerance was given and nothing is wrong
  1  an error or Ctrl-C; nothing was written (of several files: one or more failed)
  2  wrong usage; nothing was done
  3  done, but the verdict is `fail` or `cannot tell`; the reasons are printed

Of several scans the exit status is the worst: 1 if one could not be fitted, else 3 if one did not pass, else 0.

Results go to standard output; progress, warnings and errors go to standard error. Colours are used on a terminal only; set NO_COLOR to turn them off.

Run `nurbskin VERB --help` for the options and examples of a verb."
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) verb: Verb,
    #[command(flatten)]
    pub(crate) common: Common,
}

/// Options of every verb.
#[derive(Args, Debug)]
#[command(next_help_heading = COMMON)]
pub(crate) struct Common {
    /// Print the result as one JSON object on standard output
    ///
    /// Nothing else is printed there. An error is { "error": { "kind", "message" } }.
    #[arg(long, global = true, display_order = 901)]
    pub(crate) json: bool,
    /// Print errors only; the exit status tells the verdict
    #[arg(
        long,
        short,
        global = true,
        conflicts_with = "verbose",
        display_order = 902
    )]
    pub(crate) quiet: bool,
    /// Print everything: repairs, single checks, entity counts, times
    #[arg(long, short, global = true, display_order = 903)]
    pub(crate) verbose: bool,
    /// Number of threads [default: all cores]
    ///
    /// The result is the same for any number.
    #[arg(long, value_name = "N", global = true, display_order = 904, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Print help (`-h` is shorter, `--help` has more)
    #[arg(long, short, global = true, action = ArgAction::Help, display_order = 905)]
    help: Option<bool>,
    /// Print the version
    #[arg(long, short = 'V', global = true, action = ArgAction::Version, display_order = 906)]
    version: Option<bool>,
}

#[derive(Subcommand, Debug)]
pub(crate) enum Verb {
    Fit(Box<Fit>),
    Deviation(Deviation),
    Check(Check),
    Info(Info),
    View(View),
    App(App),
    Convert(Convert),
    Rarefy(Rarefy),
    Enrich(Enrich),
    Simulate(Simulate),
    /// Print a completion script for a shell
    #[command(after_help = "\
Example:
  nurbskin completions bash > ~/.local/share/bash-completion/completions/nurbskin")]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Write the manual pages, one for each verb, into a folder
    #[command(after_help = "\
Example:
  nurbskin man ~/.local/share/man/man1")]
    Man {
        /// The folder; it must exist
        folder: PathBuf,
    },
}

#[cfg(test)]
mod tests {
    use super::Cli;
    use clap::CommandFactory;

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }
}

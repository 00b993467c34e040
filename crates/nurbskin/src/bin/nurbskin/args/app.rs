//! `app`.

use super::OUTPUT;
use clap::Args;
use std::path::PathBuf;

/// Open the whole tool as a page in the browser
///
/// Drop scans on the page, see them, fit surfaces, compare them with CAD files, and save STEP, IGES, meshes and reports. The
/// page is served on the loopback address, computes in the browser and sends nothing anywhere. It runs on one thread and
/// within 4 GB; `nurbskin fit` has neither limit. Ctrl-C ends it.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin app
  nurbskin app --port 8080 --no-open
  nurbskin app --folder web/dist         the page that `npm run build` made

Exit status: 0 ended by Ctrl-C; 1 an error; 2 wrong usage.")]
pub(crate) struct App {
    /// Port of the loopback address [default: any that is free]
    #[arg(long, value_name = "PORT", value_parser = clap::value_parser!(u16).range(1..), help_heading = OUTPUT)]
    pub(crate) port: Option<u16>,
    /// Folder with the built page [default: the page inside this program]
    #[arg(long, value_name = "DIR", help_heading = OUTPUT)]
    pub(crate) folder: Option<PathBuf>,
    /// Print the address, and open nothing
    #[arg(long, help_heading = OUTPUT)]
    pub(crate) no_open: bool,
}

//! `deviation`, `check`, `info` and `view`: verbs that look and write no surface.

use super::words::{Heading, InputUnit, any_format, cad_format, command_line, scan_format, share};
use super::{INPUT, OUTPUT, TOLERANCE};
use clap::Args;
use nurbskin::pipeline::{DeviationOptions, Length};
use std::path::PathBuf;

/// Measure the deviation of a scan from a CAD file
///
/// The distance of every scanned point to the nearest place on the trimmed faces is computed, with a guaranteed lower and
/// upper bound; positive is outside. The other way round, the parts of the CAD model that have no scan data are found.
///
/// With -t the verdict says whether the part keeps the tolerance. Without -t figures are printed and no verdict.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin deviation scan.ply part.step
  nurbskin deviation scan.ply part.step -t 0.2mm --report deviation.html
  nurbskin deviation scan.ply part.igs -t 0.2mm --align --report points.csv

Exit status: 0 `pass`, or no tolerance given; 1 an error; 2 wrong usage; 3 `fail` or `cannot tell`.")]
pub(crate) struct Deviation {
    /// Scan; `-` reads standard input
    ///
    /// PLY, STL, OBJ, OFF, PCD, PTX, E57, LAS, LAZ, NPY, XYZ, ASC, TXT, CSV, PTS, VTK or VTP, also with .gz.
    pub(crate) scan: PathBuf,
    /// Nominal geometry: a STEP or IGES file; `-` reads standard input
    pub(crate) cad: PathBuf,
    /// Largest deviation allowed
    ///
    /// `0.05mm`, `20um`, `2thou`, `0.1%` of the diagonal of the scan's box, or a bare number in the scan's unit. Without
    /// it no verdict is given.
    #[arg(short, long, value_name = "LENGTH", allow_hyphen_values = true, help_heading = TOLERANCE)]
    pub(crate) tolerance: Option<Length>,
    /// Share of the points that must be within the tolerance [default: 99.5%, ordered scans 100%]
    ///
    /// `99.5%` or `0.995`. Whatever the share, no region of the surface may be biased to one side.
    #[arg(long, value_name = "SHARE", requires = "tolerance", allow_hyphen_values = true, value_parser = share, help_heading = TOLERANCE)]
    pub(crate) within: Option<f64>,
    /// Share of the nominal area that must have scan data [default: 90%]
    ///
    /// With less the verdict cannot be `pass`: what was not scanned may be out of tolerance. `0` turns this off.
    #[arg(long, value_name = "SHARE", requires = "tolerance", allow_hyphen_values = true, value_parser = share, help_heading = TOLERANCE)]
    pub(crate) min_coverage: Option<f64>,
    /// Move the scan to where it fits best (rigidly) before measuring
    ///
    /// The scan must lie roughly in place already. Its size is never changed.
    #[arg(long, help_heading = INPUT)]
    pub(crate) align: bool,
    #[command(flatten)]
    pub(crate) unit: InputUnit,
    /// Format of the scan [default: from its extension, else from its content]
    #[arg(long, value_name = "FORMAT", value_parser = scan_format(), help_heading = INPUT)]
    pub(crate) from: Option<String>,
    /// Report; may be repeated: .html, .json or .csv
    ///
    /// .html is one page with the surface and its deviation in 3-D that works offline; .json has the figures, .csv a line
    /// for each record of the file, with the deviation of its point and whether it was used.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(crate) report: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) heading: Heading,
}

impl Deviation {
    /// The options of the library that these words mean.
    pub(crate) fn options(&self) -> DeviationOptions {
        DeviationOptions {
            tolerance: self.tolerance,
            within: self.within,
            min_coverage: self.min_coverage,
            unit: self.unit.unit,
            align: self.align,
            reports: self.report.clone(),
            command: Some(command_line()),
            heading: self.heading.given(),
            time: None,
        }
    }
}

/// Check the quality of a CAD file
///
/// Checks what keeps a model from being used in other systems: gaps between edges and faces, tangency and curvature
/// across edges and knots, degrees, narrow knot spans, tiny edges, folds and self-intersections, loops, orientation,
/// free edges, and whether the file reads back the same. The limits are those of SASIG PDQ and VDA 4955.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin check part.step
  nurbskin check part.igs -v         every check, passed ones too
  nurbskin check part.igs --json

Exit status: 0 every check passed; 1 an error; 2 wrong usage; 3 a check failed or could not run.")]
pub(crate) struct Check {
    /// STEP or IGES file; `-` reads standard input
    pub(crate) cad: PathBuf,
    /// Format of the file [default: from its extension, else from its content]
    #[arg(long, value_name = "FORMAT", value_parser = cad_format(), help_heading = INPUT)]
    pub(crate) from: Option<String>,
}

/// Print what is in scans and CAD files
///
/// Of a scan: size, unit, points, order, spacing, noise, separate parts, and its topology where it can be told without a
/// fit. Of a CAD file: size, unit, solids, shells and faces, surfaces, and the author, system and date of its header.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin info face.ply
  nurbskin info scans/*.ply --json
  nurbskin info part.step -v         every surface and entity

Exit status: 0; 1 if a file cannot be read (the others are printed all the same); 2 wrong usage.")]
pub(crate) struct Info {
    /// Scans, STEP or IGES files; `-` reads standard input
    ///
    /// Scans: PLY, STL, OBJ, OFF, PCD, PTX, E57, LAS, LAZ, NPY, XYZ, ASC, TXT, CSV, PTS, VTK and VTP, also with .gz.
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// Format of the files [default: from their extension, else from their content]
    #[arg(long, value_name = "FORMAT", value_parser = any_format(), help_heading = INPUT)]
    pub(crate) from: Option<String>,
}

/// Show scans and CAD files in the browser
///
/// The page is one file that works offline. Without -o it goes to the folder for temporary files.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin view part.step --no-open
  nurbskin view face.ply -o face.html --no-open

Exit status: 0; 1 if a file cannot be read (the others are shown all the same); 2 wrong usage.")]
pub(crate) struct View {
    /// Scans, STEP or IGES files; `-` reads standard input
    ///
    /// Scans: PLY, STL, OBJ, OFF, PCD, PTX, E57, LAS, LAZ, NPY, XYZ, ASC, TXT, CSV, PTS, VTK and VTP, also with .gz.
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// Format of the files [default: from their extension, else from their content]
    #[arg(long, value_name = "FORMAT", value_parser = any_format(), help_heading = INPUT)]
    pub(crate) from: Option<String>,
    /// File for the page of a single input
    #[arg(short, long, value_name = "FILE.html", help_heading = OUTPUT)]
    pub(crate) output: Option<PathBuf>,
    /// Print where the page is, and open nothing
    #[arg(long, help_heading = OUTPUT)]
    pub(crate) no_open: bool,
}

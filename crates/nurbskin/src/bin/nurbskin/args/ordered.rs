//! `rarefy` and `enrich`: verbs of ordered scans.

use super::names::{ParametersName, TopologyName, named};
use super::words::{InputUnit, degree, scan_format};
use super::{INPUT, ORDERED, OUTPUT, SURFACE, TOLERANCE};
use clap::Args;
use nurbskin::pipeline::words::counts;
use nurbskin::pipeline::{
    InputOptions, Length, Options, Rarefaction, SCAN_FORMATS, SurfacingOptions,
};
use std::path::PathBuf;

/// Thin out an ordered scan to the points that its shape needs
///
/// Whole lines of points are dropped where the surface between their neighbours is the same without them. The result is
/// an M x N grid that `fit --grid MxN` reads again. Use it to make a dense ordered scan small before it is interpolated,
/// as in Pal & Ballav 2007; unordered scans are rejected.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin rarefy pot.ply -o kept.ply -t 0.1mm      all points stay within 0.1 mm
  nurbskin rarefy pot.ply -o kept.ply --rarefy 20   normals turn 20 degrees
  nurbskin rarefy pot.ply -o kept.txt --rarefy 18x18")]
pub(crate) struct Rarefy {
    /// Ordered scan; `-` reads standard input
    pub(crate) scan: PathBuf,
    /// File to write: .ply, .xyz, .txt, .asc or .csv; `-` for standard output
    #[arg(short, long, value_name = "OUT", help_heading = OUTPUT)]
    pub(crate) output: PathBuf,
    /// Format of standard output, for `-o -` [default: ply]
    #[arg(long, value_name = "FORMAT", value_parser = SCAN_FORMATS, help_heading = OUTPUT)]
    pub(crate) to: Option<String>,
    /// Largest distance allowed between the scan and the surface through the kept points
    ///
    /// For `--rarefy auto`. `0.05mm`, `20um`, `2thou`, `0.1%` of the diagonal, or a bare number in the scan's unit.
    /// [default: what the scan's noise can carry]
    #[arg(short, long, value_name = "LENGTH", allow_hyphen_values = true, help_heading = TOLERANCE)]
    pub(crate) tolerance: Option<Length>,
    /// Which lines of points are kept [default: auto]
    ///
    /// `auto` keeps the fewest lines with which all points are within the tolerance; `off` keeps all; `20` or `12,18` keeps
    /// a line where a normal has turned by that many degrees (for u and v) since the last one; `18x18` keeps that many.
    #[arg(long, value_name = "DEGREES|MxN|auto|off", default_value = "auto", hide_default_value = true, help_heading = ORDERED)]
    pub(crate) rarefy: Rarefaction,
    /// The scan has N rows, each of M points
    #[arg(long, value_name = "MxN", value_parser = counts, help_heading = ORDERED)]
    pub(crate) grid: Option<[usize; 2]>,
    /// Shape of the surface [default: auto]
    #[arg(long, value_parser = named::<TopologyName>(), default_value = "auto", hide_default_value = true, help_heading = SURFACE)]
    pub(crate) topology: TopologyName,
    /// Degree of the trial surfaces of `--rarefy auto` in u and v
    #[arg(long, value_name = "P[,Q]", default_value = "3", value_parser = degree, help_heading = SURFACE)]
    pub(crate) degree: [usize; 2],
    /// Parameters of the trial surfaces of `--rarefy auto` [default: auto]
    #[arg(long, value_parser = named::<ParametersName>(), default_value = "auto", hide_default_value = true, help_heading = SURFACE)]
    pub(crate) parameters: ParametersName,
    #[command(flatten)]
    pub(crate) unit: InputUnit,
    /// Format of the scan [default: from its extension, else from its content]
    #[arg(long, value_name = "FORMAT", value_parser = scan_format(), help_heading = INPUT)]
    pub(crate) from: Option<String>,
}

impl Rarefy {
    /// The options of the library that these words mean.
    pub(crate) fn options(&self) -> Options {
        Options {
            input: InputOptions {
                grid: self.grid,
                unit: self.unit.unit,
            },
            surfacing: SurfacingOptions {
                tolerance: self.tolerance,
                topology: self.topology,
                degree: self.degree,
                parameters: self.parameters,
                rarefy: self.rarefy,
                ..SurfacingOptions::default()
            },
            ..Options::default()
        }
    }
}

/// Densify a sparse grid of points by Catmull-Clark subdivision
///
/// New points are placed so that the surface through all of them still meets the original ones. Use it for a few measured
/// sections or touch-probe points that are too sparse for a good surface; unordered scans are rejected.
#[derive(Args, Debug)]
#[command(after_help = "\
Example:
  nurbskin enrich sparse.txt --grid 8x8 --enrich 2 -o dense.txt")]
pub(crate) struct Enrich {
    /// Ordered scan; `-` reads standard input
    #[arg(value_name = "SCAN")]
    pub(crate) scan: PathBuf,
    /// File to write: .ply, .xyz, .txt, .asc or .csv; `-` for standard output
    #[arg(short, long, value_name = "OUT", help_heading = OUTPUT)]
    pub(crate) output: PathBuf,
    /// Format of standard output, for `-o -` [default: ply]
    #[arg(long, value_name = "FORMAT", value_parser = SCAN_FORMATS, help_heading = OUTPUT)]
    pub(crate) to: Option<String>,
    /// Levels; each doubles the points along u and v
    #[arg(long, value_name = "LEVELS", default_value_t = 1, value_parser = clap::value_parser!(u8).range(0..=6), help_heading = ORDERED)]
    pub(crate) enrich: u8,
    /// The scan has N rows, each of M points
    #[arg(long, value_name = "MxN", value_parser = counts, help_heading = ORDERED)]
    pub(crate) grid: Option<[usize; 2]>,
    /// Shape of the surface [default: auto]
    #[arg(long, value_parser = named::<TopologyName>(), default_value = "auto", hide_default_value = true, help_heading = SURFACE)]
    pub(crate) topology: TopologyName,
    #[command(flatten)]
    pub(crate) unit: InputUnit,
    /// Format of the scan [default: from its extension, else from its content]
    #[arg(long, value_name = "FORMAT", value_parser = scan_format(), help_heading = INPUT)]
    pub(crate) from: Option<String>,
}

impl Enrich {
    /// The options of the library that these words mean.
    pub(crate) fn options(&self) -> Options {
        Options {
            input: InputOptions {
                grid: self.grid,
                unit: self.unit.unit,
            },
            surfacing: SurfacingOptions {
                topology: self.topology,
                enrich: usize::from(self.enrich),
                ..SurfacingOptions::default()
            },
            ..Options::default()
        }
    }
}

//! Preparation of a scan before it is fitted or measured.
//!
//! Applies the options on unit and order to the scan that was read, refuses scans without usable points, and adds the
//! file name to errors.

use super::Options;
use nurbskin_geometry::unit::UnitSource;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::{GridLayout, Organisation, Scan};
use std::path::Path;

/// Applies the options on the scan itself: unit and order.
pub(super) fn apply_options(scan: &mut Scan, options: &Options) -> Result<()> {
    if let Some(unit) = options.input.unit {
        (scan.unit, scan.unit_source) = (unit, UnitSource::Option);
    }
    if let Some([m, n]) = options.input.grid {
        if let Organisation::Grid(own) = &scan.organisation {
            if [own.count_u, own.count_v] == [m, n] {
                return Ok(());
            }
            return Err(Error::invalid(format!(
                "--grid {m}x{n} contradicts the scan, whose points are in a grid of {} x {} already: leave it away",
                own.count_u, own.count_v
            )));
        }
        if m.checked_mul(n) != Some(scan.points.len()) {
            return Err(Error::invalid(format!(
                "--grid {m}x{n} needs {} points, but the scan has {}: check which number counts the points in a row \
                 (M) and which the rows (N)",
                m.saturating_mul(n),
                scan.points.len()
            )));
        }
        let layout =
            GridLayout::complete(m, n).ok_or_else(|| Error::invalid("the grid is too large"))?;
        scan.organisation = Organisation::Grid(layout);
    }
    Ok(())
}

/// Refuses a scan without a finite point.
pub(super) fn refuse_pointless(scan: &Scan) -> Result<()> {
    if scan.points.is_empty() {
        return Err(Error::invalid(
            "the scan has no points; check that the file is a complete scan and not only a header, a curve or a solid",
        ));
    }
    if !scan.points.iter().any(|p| p.is_finite()) {
        return Err(Error::invalid("no point of it is finite"));
    }
    Ok(())
}

/// The error with the name of its file.
pub(super) fn about(path: &Path, error: Error) -> Error {
    let name = path.display().to_string();
    // Errors of a reader contain the file name already.
    let named = |what: String| match what.starts_with(&name) {
        true => what,
        false => format!("{name}: {what}"),
    };
    match error {
        Error::Invalid(what) => Error::Invalid(named(what)),
        Error::Unsupported(what) => Error::Unsupported(named(what)),
        Error::NoSolution(what) => Error::NoSolution(named(what)),
        other => other,
    }
}

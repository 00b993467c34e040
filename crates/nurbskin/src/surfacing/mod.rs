//! The surfaces of a scan: which way of fitting, which tolerance, and where each surface ends.
//!
//! Charts and fits are independent of CAD models, and trimming of scans. This stage holds the choices that need both:
//!
//! 1. An ordered scan is rarefied and interpolated as in the paper, or approximated where it is noisy (`ordered`).
//! 2. Everything else is cleaned and split into its parts, each of which gets a surface (`unordered`, `part`):
//!    - an exact surface of revolution, if its points agree with one (`turned`);
//!    - otherwise a free form over the rectangle around a sheet, over the region that its borders enclose, or over its
//!      mesh; the better one is taken, and made calmer where it intersects itself (`free_form`).
//! 3. A part that one surface cannot be, or that it misses, becomes a network of faces (`choice`, `network`).
//! 4. Each surface is cut down to the scan under it (`Part::trim`).
//!
//! Without a requested tolerance, the noise of the scan determines it ([`Tolerance`]). The choices are ours.
//!
//! ```
//! use nurbskin::progress::Silent;
//! use nurbskin::scan::simulate::{self, Order, ScanOptions, Shape};
//! use nurbskin::surfacing::{SurfacingOptions, surfaces};
//! let options = ScanOptions { points: Some(3000), order: Order::Shuffled, ..ScanOptions::default() };
//! let scan = simulate::scan(Shape::Saddle, &options)?.scan;
//! let surfaces = surfaces(&scan, &SurfacingOptions::default(), &Silent)?;
//! let model = surfaces.model("saddle", scan.unit)?;
//! assert_eq!(model.faces().len(), 1);
//! # Ok::<(), nurbskin::Error>(())
//! ```

mod choice;
mod free_form;
mod network;
mod options;
mod ordered;
mod outliers;
mod part;
mod rows;
mod solid;
mod surfaces;
mod tolerance;
mod turned;
mod unordered;

pub(crate) use free_form::MOST_UNKNOWNS;
pub use nurbskin_network::layout::lines::Sharp;
pub use options::{FaceLayout, Length, Method, Rarefaction, SurfacingOptions, Trim};
pub(crate) use ordered::{Prepared, prepare_filled, to_tolerance};
pub use surfaces::{NetworkPart, Part, PartShape, SinglePart, Surfaces};
pub use tolerance::Tolerance;

use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::{Organisation, Scan};

/// The surfaces of a scan, one for each of its parts: ordered scans as in the paper, everything else through a chart.
/// The stages are reported to `progress` as `order`, `clean`, `enrich`, `rarefy` and `fit`, in this order.
///
/// # Errors
/// [`Error::Unsupported`] for scans that are no surface or cannot be charted, and for interpolation of a scan without
/// order; [`Error::NoSolution`] and [`Error::Invalid`] where the points or the options do not suffice;
/// [`Error::Cancelled`].
pub fn surfaces(
    scan: &Scan,
    options: &SurfacingOptions,
    progress: &dyn Progress,
) -> Result<Surfaces> {
    if options.layout == FaceLayout::Network {
        return as_network(scan, options, progress);
    }
    if !scan.organisation.is_ordered() {
        if options.method == Method::Interpolate {
            return Err(Error::Unsupported(
                "interpolation needs an ordered scan: say `--grid MxN` if the file lists N rows of M points, or use \
                 `--method approximate`"
                    .into(),
            ));
        }
        let listed = scan.organisation == Organisation::Unordered;
        return unordered::fit(scan, options, progress).map_err(|error| match error {
            Error::Unsupported(what) if listed => Error::Unsupported(format!(
                "{what}; if the file lists N rows of M points, say --grid MxN"
            )),
            other => other,
        });
    }
    match ordered::fit(scan, options, progress) {
        // A grid with holes is still a cloud.
        Err(Error::Unsupported(why))
            if !options.keeps_order && options.method != Method::Interpolate =>
        {
            order_ignored(scan, &why, options, progress)
        }
        other => other,
    }
}

/// The networks of a scan, one for each of its parts; the cells of a grid are a mesh, rows a cloud.
fn as_network(
    scan: &Scan,
    options: &SurfacingOptions,
    progress: &dyn Progress,
) -> Result<Surfaces> {
    if options.method == Method::Interpolate {
        return Err(Error::Unsupported(
            "interpolation makes one surface, not a network: use `--layout single` or `--method approximate`".into(),
        ));
    }
    let mut fitted = unordered::fit(scan, options, progress)?;
    if let Organisation::Rows(_) = scan.organisation {
        let note = "the rows are ignored, and their points fitted as a cloud";
        fitted.notes.warnings.insert(0, note.into());
    }
    Ok(fitted)
}

/// The surfaces of an ordered scan whose order is unusable for the reason `why`.
fn order_ignored(
    scan: &Scan,
    why: &str,
    options: &SurfacingOptions,
    progress: &dyn Progress,
) -> Result<Surfaces> {
    let is_grid = matches!(scan.organisation, Organisation::Grid(_));
    let note = match is_grid {
        true => format!("{why}: the cells of the grid are fitted as a mesh, not row by row"),
        false => format!("{why}: the rows are ignored, and their points fitted as a cloud"),
    };
    let mut fitted = unordered::fit(scan, options, progress).map_err(|error| match error {
        Error::Unsupported(what) => Error::Unsupported(format!("{note}; then {what}")),
        other => other,
    })?;
    // A range image loses nothing by that; rows lose their order.
    let list = match is_grid {
        true => &mut fitted.notes.details,
        false => &mut fitted.notes.warnings,
    };
    list.insert(0, note);
    Ok(fitted)
}

/// Every k-th of `count` points is held out, for a fraction 1/k.
fn hold_out(count: usize, fraction: f64) -> Vec<bool> {
    if fraction <= 0.0 {
        return vec![false; count];
    }
    // The k-th point is the one at which the running share passes the next whole number.
    let passes = |i: usize| ((i + 1) as f64 * fraction).floor() > (i as f64 * fraction).floor();
    (0..count).map(passes).collect()
}

//! Finite, distinct points of a scan, and refusal of scans that are no surface.
//!
//! The points are sorted along a Morton curve, so that equal points are consecutive and nothing later depends on their
//! order in the file. Points that are not finite or beyond 1e90 are rejected; of equal points the first is kept. The
//! pole lines of a grid repeat one point on purpose and are kept. Fewer than four points, and points on one line (√(λ2
//! / λ1) ≤ 1e-6 for the principal variances λ1 ≥ λ2), are refused. Source: ours.

use crate::normals::principal_axes;
use crate::{Organisation, Reason, Rejected, Scan};
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::spatial::morton::spatial_order;
use nurbskin_geometry::{Error, Result};

/// Fewest distinct points of a scan. Derived: a surface of degree 1 × 1 has 2 × 2 control points.
const MIN_POINTS: usize = 4;
/// Largest absolute coordinate; its inverse is the least extent. Guard: no length in any unit, and cubes of such
/// numbers and of their inverses (1e270, 1e-270) stay within the range of doubles.
const MAX_COORDINATE: f64 = 1e90;
/// Ratio of the second to the largest principal standard deviation up to which points lie on one line. Guard: single
/// precision leaves 6e-8 of the coordinates as rounding.
const COLLINEAR_RATIO: f64 = 1e-6;

/// The finite, distinct points of a scan.
pub(super) struct Distinct {
    /// Their indices, in spatial order.
    pub(super) order: Vec<u32>,
    /// For every point of the scan, the index of the first point with its coordinates.
    pub(super) merged: Vec<u32>,
    /// Points of pole lines that repeat an earlier one and are used nevertheless.
    pub(super) copies: Vec<u32>,
}

/// Selects the finite, distinct points; the others go to `rejected`. O(n log n).
pub(super) fn distinct(scan: &Scan, rejected: &mut Vec<Rejected>) -> Distinct {
    let points = &scan.points;
    let mut merged: Vec<u32> = (0..u32::MAX).take(points.len()).collect();
    // Comparisons with NaN are false.
    let usable = |p: &DVec3| {
        p.x.abs() <= MAX_COORDINATE && p.y.abs() <= MAX_COORDINATE && p.z.abs() <= MAX_COORDINATE
    };
    let mut order = spatial_order(points, usable);
    if order.len() < points.len() {
        let reason = Reason::NonFinite;
        let lost = points.iter().enumerate().filter(|(_, p)| !usable(p));
        rejected.extend(lost.map(|(index, _)| Rejected { index, reason }));
    }
    let pole = pole_cells(scan);
    let mut first = None;
    let mut copies = Vec::new();
    order.retain(|&k| match first {
        Some(f) if points[f as usize] == points[k as usize] => {
            merged[k as usize] = f;
            if pole[k as usize] {
                copies.push(k);
            } else {
                rejected.push(Rejected {
                    index: k as usize,
                    reason: Reason::Duplicate,
                });
            }
            false
        }
        _ => {
            first = Some(k);
            true
        }
    });
    Distinct {
        order,
        merged,
        copies,
    }
}

/// Whether each point of a grid lies on a pole line: an end of u, or the first or last row, whose cells all have the
/// same coordinates.
fn pole_cells(scan: &Scan) -> Vec<bool> {
    let mut pole = vec![false; scan.points.len()];
    let Organisation::Grid(grid) = &scan.organisation else {
        return pole;
    };
    let [m, n] = [grid.count_u, grid.count_v];
    if m.checked_mul(n) != Some(grid.cells.len()) || m == 0 || n == 0 {
        return pole;
    }
    let lines: [Vec<usize>; 4] = [
        (0..n).map(|j| j * m).collect(),
        (0..n).map(|j| j * m + m - 1).collect(),
        (0..m).collect(),
        (0..m).map(|i| (n - 1) * m + i).collect(),
    ];
    for line in lines {
        let at: Option<Vec<usize>> = line
            .iter()
            .map(|&cell| grid.cells[cell].map(|k| k as usize))
            .collect();
        let Some(at) = at.filter(|at| at.iter().all(|&k| k < scan.points.len())) else {
            continue;
        };
        if at.iter().all(|&k| scan.points[k] == scan.points[at[0]]) {
            for k in at {
                pole[k] = true;
            }
        }
    }
    pole
}

/// Refuses scans with too few usable points, and names the reason.
pub(super) fn refuse_few(scan: &Scan, left: usize) -> Result<()> {
    let total = scan.points.len();
    let refuse = |what: String| Err(Error::Invalid(what));
    if total == 0 {
        return refuse(
            "the scan has no points; check that the file is a complete scan and not only a header, a curve or a solid"
                .to_owned(),
        );
    }
    if left >= MIN_POINTS {
        return Ok(());
    }
    let huge = |p: &&DVec3| p.is_finite() && p.abs().max_element() > MAX_COORDINATE;
    let huge = scan.points.iter().filter(huge).count();
    if 2 * huge > total {
        return refuse(format!(
            "{huge} of {total} points have coordinates beyond 1e90, which are no lengths in any unit; the file is \
             damaged, or its numbers were read with the wrong type or byte order"
        ));
    }
    if left == 1 && total > 1 {
        return refuse(format!(
            "all {total} points are at the same spot; a single spot is not a surface: check that the right columns \
             were read as x, y and z"
        ));
    }
    refuse(format!(
        "only {left} different usable points of {total}; a surface needs at least {MIN_POINTS}"
    ))
}

/// Refuses points on one line, whose second principal variance is nothing but rounding (single precision leaves 6e-8 of
/// the coordinates), and extents whose squares leave the range of doubles.
pub(super) fn refuse_line(points: impl Iterator<Item = DVec3> + Clone) -> Result<()> {
    let bounds = points
        .clone()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
            (low.min(p), high.max(p))
        });
    let extent = (bounds.1 - bounds.0).max_element();
    if extent < 1.0 / MAX_COORDINATE {
        return Err(Error::Invalid(format!(
            "the scan is only {extent:.0e} across, which is no length in any unit; the file is damaged, or its \
             numbers were read with the wrong type or byte order"
        )));
    }
    // Relative to the extent, so that squares neither overflow nor underflow.
    let low = bounds.0;
    let (_, [_, (across, _), (along, _)]) = principal_axes(points.map(|p| (p - low) / extent));
    if across.max(0.0).sqrt() <= COLLINEAR_RATIO * along.sqrt() {
        return Err(Error::invalid(
            "all points lie on one line; a line is not a surface: check that the right columns were read as x, y and z",
        ));
    }
    Ok(())
}

/// Whether each point of an order is a corner of a triangle.
pub(super) fn meshed(organisation: &Organisation, distinct: &Distinct, order: &[u32]) -> Vec<bool> {
    let Organisation::Mesh(triangles) = organisation else {
        return vec![false; order.len()];
    };
    let mut corner = vec![false; distinct.merged.len()];
    for k in triangles.iter().flatten() {
        if let Some(&first) = distinct.merged.get(*k as usize) {
            corner[first as usize] = true;
        }
    }
    each(order.len(), |k| corner[order[k] as usize])
}

//! Test whether the points agree with a surface of revolution.
//!
//! ```text
//! noise:  |median of a cell| ≤ 0.2 T + max(3.5, √(2 ln(100 cells))) · 1.2533 σ / √n,   for cells of several sizes
//! exact:  |d| ≤ T for all but outliers
//! ```
//!
//! Points that lie off together (a handle, a spout), more than 15 % of empty cells, and parts without support refuse
//! the surface as well. The second bound allows for the largest of many normal variables. Ours.

use super::data::{BEND_SLACK, Data};
use super::support;
use crate::chart::revolution::{ProfileCurve, Revolution};
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::statistics::{SIGMA_PER_MAD, median_in_place};
use nurbskin_geometry::spatial::neighbours::Neighbours;
use std::f64::consts::TAU;

/// Median offset of a cell of noisy points that is allowed beyond noise, in tolerances.
/// Derived: as in the approximation, so that both ask the same of a surface.
const CELL_BIAS_SHARE: f64 = 0.2;
/// Least number of standard errors of the median that are allowed besides.
/// Derived: as in the approximation; among many cells chance asks for more.
const CELL_BIAS_ERRORS: f64 = 3.5;
/// Standard error of the median of normal errors, in that of their mean. Dimensionless.
/// Derived: the root of pi / 2.
const MEDIAN_ERROR_RATIO: f64 = 1.2533;
/// Sides of the cells that are judged, in spacings; 0 stands for sectors over the whole profile.
/// Trial: not recorded. Small cells find small features, large ones faint deviations.
const CELL_SIDES: [f64; 4] = [5.0, 9.0, 16.0, 0.0];
/// Sectors over the whole profile. Count.
/// Trial: not recorded.
const PROFILE_SECTORS: usize = 32;
/// Fewest points of a cell whose median is judged. Count.
/// Guard: the median of fewer is far from normal.
const MIN_MEDIAN_POINTS: usize = 8;
/// Share of the smallest cells that may be without points. Dimensionless.
/// Trial: not recorded.
const MAX_BARE_SHARE: f64 = 0.15;
/// Number and share of the points from which on those that lie off together are a feature.
/// Trial: not recorded. A handle or a spout has more, a swarm of outliers fewer.
const MIN_FEATURE: (usize, f64) = (12, 0.003);
/// Least size of a group of points off the surface, counted within [`FEATURE_REACH`] of each. Count.
/// Guard: outliers hardly lie in fours.
const FEATURE_NEIGHBOURS: usize = 4;
/// Distance of these points in spacings.
/// Trial: not recorded.
const FEATURE_REACH: f64 = 3.0;
/// Distance in sigma, plus the tolerance, above which a point is off the surface, or an outlier where there is no
/// noise.
/// Derived: as in the robust weights of the approximation.
const OFF_SURFACE_SIGMAS: f64 = 8.0;
/// Odds against a false objection by any cell. Dimensionless.
/// Derived: of n normal variables the largest exceeds `sqrt(2 ln(100 n))` with a chance below 1 %.
const CHANCE_ODDS: f64 = 100.0;
/// Most rows of cells. Count.
/// Guard: bounds the memory.
const MAX_CELL_ROWS: f64 = 1000.0;
/// Most cells of a row. Count.
/// Guard: bounds the memory.
const MAX_CELLS_AROUND: f64 = 4000.0;

/// Cells of about equal sides on the surface: rows along the profile, each divided around the axis.
struct Cells {
    /// Number of cells around, and of those before, per row.
    rows: Vec<(usize, usize)>,
    length: f64,
    sweep: f64,
    total: usize,
}

impl Cells {
    fn new(curve: &ProfileCurve, sweep: f64, side: f64) -> Self {
        let length = curve.knots().domain().1;
        let whole = |x: f64, most: f64| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "clamped to 1..=most"
            )]
            let n = x.round().clamp(1.0, most) as usize;
            n
        };
        let mut rows = Vec::new();
        let mut total = 0;
        if side > 0.0 {
            let count = whole(length / side, MAX_CELL_ROWS);
            for row in 0..count {
                let s = (row as f64 + 0.5) / count as f64 * length;
                let around = whole(curve.derivatives(s)[0].x * sweep / side, MAX_CELLS_AROUND);
                rows.push((around, total));
                total += around;
            }
        } else {
            rows.push((PROFILE_SECTORS, 0));
            total = PROFILE_SECTORS;
        }
        Self {
            rows,
            length,
            sweep,
            total,
        }
    }
    fn of(&self, s: f64, angle: f64) -> usize {
        let at = |x: f64, n: usize| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "clamped to the cells"
            )]
            let k = (x * n as f64).clamp(0.0, n as f64 - 1.0) as usize;
            k
        };
        let (around, before) = self.rows[at(s / self.length, self.rows.len())];
        before + at(angle / self.sweep, around)
    }
    fn row(&self, cell: usize) -> (f64, f64) {
        let row = self.rows.partition_point(|r| r.1 <= cell).max(1) - 1;
        let (around, before) = self.rows[row];
        (
            (row as f64 + 0.5) / self.rows.len() as f64 * self.length,
            ((cell - before) as f64 + 0.5) / around as f64 * self.sweep,
        )
    }
}

/// The offsets of the points per cell.
fn by_cell(cells: &Cells, data: &Data, offsets: &[f64]) -> Vec<Vec<f64>> {
    let mut lists = vec![Vec::new(); cells.total];
    for k in 0..data.points.len() {
        if data.on(k) {
            lists[cells.of(data.s[k], data.angles[k])].push(offsets[k]);
        }
    }
    lists
}

/// The reason why the points do not agree with `curve` turned about the axis, if so. `noisy` selects the test: unbiased
/// cells, or all points within the tolerance. With `whole` false only deviations that no profile could explain count.
pub(super) fn objection(
    data: &Data,
    found: &Revolution,
    curve: &ProfileCurve,
    tolerance: f64,
    noisy: bool,
    whole: bool,
) -> Option<String> {
    let sweep = found.sector.sweep;
    let offsets = if whole {
        data.offsets.clone()
    } else {
        data.about_rows(curve)
    };
    let slack = if whole {
        0.0
    } else {
        BEND_SLACK * data.spacing
    };
    together(data, tolerance + slack)
        .or_else(|| bare(data, curve, sweep))
        .or_else(|| {
            whole
                .then(|| support::objection(data, curve, sweep, tolerance))
                .flatten()
        })
        .or_else(|| {
            if noisy {
                biased(data, &offsets, curve, sweep, tolerance)
            } else {
                far(data, &offsets, tolerance)
            }
        })
}

/// Points off the surface in groups: a handle, a spout, a dent.
fn together(data: &Data, least: f64) -> Option<String> {
    let limit = OFF_SURFACE_SIGMAS * data.sigma + least;
    let away: Vec<_> = (0..data.points.len())
        .filter(|&k| data.offsets[k].abs() > limit)
        .map(|k| data.points[k])
        .collect();
    let reach = (FEATURE_REACH * data.spacing).powi(2);
    let tree = Neighbours::new(&away);
    let among = |p: &&nurbskin_geometry::DVec3| {
        let near = tree.nearest(**p, FEATURE_NEIGHBOURS);
        near.len() == FEATURE_NEIGHBOURS
            && near
                .iter()
                .all(|&k| away[k as usize].distance_squared(**p) <= reach)
    };
    let count = away.iter().filter(among).count();
    let part = count as f64 / data.points.len().max(1) as f64;
    (count >= MIN_FEATURE.0 && part > MIN_FEATURE.1).then(|| {
        format!(
            "{:.1} % of the points lie together off the best such surface, by more than {limit:.3e}",
            100.0 * part
        )
    })
}

/// Too much of the surface without points.
fn bare(data: &Data, curve: &ProfileCurve, sweep: f64) -> Option<String> {
    let cells = Cells::new(curve, sweep, CELL_SIDES[0] * data.spacing);
    let empty = by_cell(&cells, data, &data.offsets)
        .iter()
        .filter(|c| c.is_empty())
        .count();
    let part = empty as f64 / cells.total.max(1) as f64;
    (part > MAX_BARE_SHARE).then(|| {
        format!(
            "{:.0} % of such a surface would be without points",
            100.0 * part
        )
    })
}

/// A cell whose median is off by more than noise explains.
fn biased(
    data: &Data,
    offsets: &[f64],
    curve: &ProfileCurve,
    sweep: f64,
    tolerance: f64,
) -> Option<String> {
    // 1. Noise is the variation within small cells.
    let small = Cells::new(curve, sweep, CELL_SIDES[0] * data.spacing);
    let mut within = Vec::new();
    for mut list in by_cell(&small, data, offsets) {
        if list.len() >= MIN_MEDIAN_POINTS {
            let middle = median_in_place(&mut list);
            let n = list.len() as f64;
            within.extend(
                list.iter()
                    .map(|e| (e - middle).abs() * (n / (n - 1.0)).sqrt()),
            );
        }
    }
    let sigma = if within.is_empty() {
        data.sigma
    } else {
        SIGMA_PER_MAD * median_in_place(&mut within)
    };
    // 2. Medians of cells of several sizes; the largest of many deviates farther by chance.
    let mut worst: Option<(f64, f64, f64, (f64, f64))> = None;
    for side in CELL_SIDES {
        let cells = Cells::new(curve, sweep, side * data.spacing);
        let lists = by_cell(&cells, data, offsets);
        let chance = (2.0 * math::ln(CHANCE_ODDS * lists.len() as f64)).sqrt();
        for (cell, mut list) in lists.into_iter().enumerate() {
            if list.len() < MIN_MEDIAN_POINTS {
                continue;
            }
            let middle = median_in_place(&mut list).abs();
            let errors = CELL_BIAS_ERRORS.max(chance) * MEDIAN_ERROR_RATIO * sigma
                / (list.len() as f64).sqrt();
            let allowed = CELL_BIAS_SHARE * tolerance + errors;
            if worst.as_ref().is_none_or(|w| middle / allowed > w.0) {
                worst = Some((middle / allowed, middle, allowed, cells.row(cell)));
            }
        }
    }
    let (ratio, middle, allowed, (s, angle)) = worst?;
    (ratio > 1.0).then(|| {
        format!(
            "near {:.0} % of the profile, {:.0} degrees around, the points lie {middle:.3e} off the best such surface \
             in the middle, where their noise explains {allowed:.3e}",
            100.0 * s / curve.knots().domain().1,
            angle * 360.0 / TAU
        )
    })
}

/// A point beyond the tolerance that is no outlier among its neighbours.
fn far(data: &Data, offsets: &[f64], tolerance: f64) -> Option<String> {
    let limit = OFF_SURFACE_SIGMAS * data.sigma + tolerance;
    let worst = offsets
        .iter()
        .map(|e| e.abs())
        .filter(|e| *e <= limit)
        .fold(0.0, f64::max);
    (worst > tolerance).then(|| {
        format!("points without noise lie up to {worst:.3e} off the best such surface, beyond the tolerance {tolerance:.3e}")
    })
}

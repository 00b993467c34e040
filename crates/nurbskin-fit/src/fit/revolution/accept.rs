//! Whether the points agree with a surface of revolution.

use super::data::{Data, SLACK};
use super::support;
use crate::chart::revolution::{ProfileCurve, Revolution};
use nurbskin_geometry::numeric::statistics::{SIGMA_PER_MAD, median_in_place};
use nurbskin_geometry::spatial::neighbours::Neighbours;
use std::f64::consts::TAU;

/// Share of the tolerance that the middle of a cell may be off, with noise.
const SHARE: f64 = 0.2;
/// Standard errors that the middle of a cell may be off besides, at least.
const ERRORS: f64 = 3.5;
/// Standard error of a median of normal numbers, in that of their mean.
const MEDIAN: f64 = 1.2533;
/// Sides of cells, in spacings; 0 stands for sectors over the whole profile.
const SIDES: [f64; 4] = [5.0, 9.0, 16.0, 0.0];
/// Sectors.
const SECTORS: usize = 32;
/// Fewest points that make the middle of a cell.
const FEWEST: usize = 8;
/// Part of the surface that may be without points.
const BARE: f64 = 0.15;
/// Points off the surface that lie together are a feature, from this number and this part of all.
const TOGETHER: (usize, f64) = (12, 0.003);

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
            let count = whole(length / side, 1000.0);
            for row in 0..count {
                let s = (row as f64 + 0.5) / count as f64 * length;
                let around = whole(curve.derivatives(s)[0].x * sweep / side, 4000.0);
                rows.push((around, total));
                total += around;
            }
        } else {
            rows.push((SECTORS, 0));
            total = SECTORS;
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

/// Why the points do not agree with `curve` turned about the axis, if so. `noisy` says what is asked of them: that
/// cells be unbiased, or that all points lie within the tolerance. `whole` is false where only what no profile could
/// explain is asked for.
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
    let slack = if whole { 0.0 } else { SLACK * data.spacing };
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

/// Points off the surface that have several of their kind nearby: a handle, a spout, a dent.
fn together(data: &Data, least: f64) -> Option<String> {
    let limit = 8.0 * data.sigma + least;
    let away: Vec<_> = (0..data.points.len())
        .filter(|&k| data.offsets[k].abs() > limit)
        .map(|k| data.points[k])
        .collect();
    let reach = (3.0 * data.spacing).powi(2);
    let tree = Neighbours::new(&away);
    let among = |p: &&nurbskin_geometry::DVec3| {
        let near = tree.nearest(**p, 4);
        near.len() == 4
            && near
                .iter()
                .all(|&k| away[k as usize].distance_squared(**p) <= reach)
    };
    let count = away.iter().filter(among).count();
    let part = count as f64 / data.points.len().max(1) as f64;
    (count >= TOGETHER.0 && part > TOGETHER.1).then(|| {
        format!(
            "{:.1} % of the points lie together off the best such surface, by more than {limit:.3e}",
            100.0 * part
        )
    })
}

/// Too much of the surface without points.
fn bare(data: &Data, curve: &ProfileCurve, sweep: f64) -> Option<String> {
    let cells = Cells::new(curve, sweep, SIDES[0] * data.spacing);
    let empty = by_cell(&cells, data, &data.offsets)
        .iter()
        .filter(|c| c.is_empty())
        .count();
    let part = empty as f64 / cells.total.max(1) as f64;
    (part > BARE).then(|| {
        format!(
            "{:.0} % of such a surface would be without points",
            100.0 * part
        )
    })
}

/// A cell whose middle is off by more than noise explains.
fn biased(
    data: &Data,
    offsets: &[f64],
    curve: &ProfileCurve,
    sweep: f64,
    tolerance: f64,
) -> Option<String> {
    // 1. Noise is what varies within small cells.
    let small = Cells::new(curve, sweep, SIDES[0] * data.spacing);
    let mut within = Vec::new();
    for mut list in by_cell(&small, data, offsets) {
        if list.len() >= FEWEST {
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
    // 2. The middle of cells of several sizes; the more there are, the farther one of them is off by chance.
    let mut worst: Option<(f64, f64, f64, (f64, f64))> = None;
    for side in SIDES {
        let cells = Cells::new(curve, sweep, side * data.spacing);
        let lists = by_cell(&cells, data, offsets);
        let chance = (2.0 * (100.0 * lists.len() as f64).ln()).sqrt();
        for (cell, mut list) in lists.into_iter().enumerate() {
            if list.len() < FEWEST {
                continue;
            }
            let middle = median_in_place(&mut list).abs();
            let errors = ERRORS.max(chance) * MEDIAN * sigma / (list.len() as f64).sqrt();
            let allowed = SHARE * tolerance + errors;
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
    let limit = 8.0 * data.sigma + tolerance;
    let worst = offsets
        .iter()
        .map(|e| e.abs())
        .filter(|e| *e <= limit)
        .fold(0.0, f64::max);
    (worst > tolerance).then(|| {
        format!("points without noise lie up to {worst:.3e} off the best such surface, beyond the tolerance {tolerance:.3e}")
    })
}

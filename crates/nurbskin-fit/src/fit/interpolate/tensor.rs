//! The two passes of tensor product interpolation over a table of points.
//!
//! Both passes are bound by memory, not by arithmetic, so that the order of access matters: the pass along u works on a
//! few rows while they are in the cache; the pass along v works on strips of columns narrow enough for the forward
//! sweep to be still in the cache when the backward sweep comes.
//!
//! ```text
//! traffic: 4 passes x 24 bytes per point
//! ```
//!
//! Source: two-pass solution of *The NURBS Book*, 9.2.5; the blocking is ours.

use super::collocation::Collocation;
use glam::DVec3;
use nurbskin_geometry::PointGrid;
use rayon::prelude::*;

/// Points from which on a table is solved in parallel. Count.
/// Guard: fewer are not worth waking other threads.
const PARALLEL_MIN_POINTS: usize = 1 << 15;

/// Copies each row of the grid to the row of `points` with the same number, and solves it along u. The first and the
/// last point of each row are replaced by `poles`.
pub(super) fn solve_along_u(
    along_u: &Collocation,
    grid: &PointGrid,
    poles: Option<[DVec3; 2]>,
    points: &mut [[f64; 3]],
) {
    let source: &[[f64; 3]] = bytemuck::cast_slice(grid.points());
    if points.len() >= PARALLEL_MIN_POINTS {
        let width = along_u.stored();
        // A multiple of four rows, and enough work to be worth handing over.
        let rows = 4 * (PARALLEL_MIN_POINTS / 4).div_ceil(4 * width);
        points
            .par_chunks_mut(rows * width)
            .zip(source.par_chunks(rows * grid.count_u()))
            .for_each(|(points, source)| solve_some_rows(along_u, source, poles, points));
        return;
    }
    solve_some_rows(along_u, source, poles, points);
}

fn solve_some_rows(
    along_u: &Collocation,
    source: &[[f64; 3]],
    poles: Option<[DVec3; 2]>,
    points: &mut [[f64; 3]],
) {
    let (width, count) = (along_u.stored(), along_u.count);
    for (four, source) in points.chunks_mut(4 * width).zip(source.chunks(4 * count)) {
        for (row, source) in four.chunks_exact_mut(width).zip(source.chunks_exact(count)) {
            row[along_u.shift..along_u.shift + count].copy_from_slice(source);
            if let Some([first, last]) = poles {
                row[0] = first.to_array();
                row[count - 1] = last.to_array();
            }
        }
        along_u.solve_lines(four);
    }
}

/// Solves a table of `width` points per row along v, all columns, and wraps it. Returns whether all results are finite.
pub(super) fn solve_along_v(along_v: &Collocation, points: &mut [[f64; 3]], width: usize) -> bool {
    let finite = solve_columns(along_v, along_v.rows_of(points, width), width);
    along_v.wrap(width, points);
    finite
}

fn solve_columns(along_v: &Collocation, points: &mut [[f64; 3]], width: usize) -> bool {
    let rows = points
        .chunks_exact_mut(width)
        .map(<[[f64; 3]]>::as_flattened_mut);
    if along_v.count * width >= PARALLEL_MIN_POINTS {
        /// Parts in which the columns are shared out to threads. Count.
        /// Guard: enough for some cores, and each still wide.
        const COLUMN_PARTS: usize = 8;
        let part = (3 * width).div_ceil(COLUMN_PARTS).next_multiple_of(8);
        let mut parts: Vec<Vec<&mut [f64]>> = (0..(3 * width).div_ceil(part))
            .map(|_| Vec::with_capacity(along_v.count))
            .collect();
        for row in rows {
            for (part, piece) in parts.iter_mut().zip(row.chunks_mut(part)) {
                part.push(piece);
            }
        }
        let finite: Vec<bool> = parts
            .par_iter_mut()
            .map(|rows| solve_strips(along_v, rows))
            .collect();
        return finite.into_iter().all(|finite| finite);
    }
    solve_strips(along_v, &mut rows.collect::<Vec<_>>())
}

fn solve_strips(along_v: &Collocation, rows: &mut [&mut [f64]]) -> bool {
    /// Numbers in a strip of columns. Count.
    /// Derived: a second-level cache of 1 MiB holds them.
    const STRIP_NUMBERS: usize = 1 << 17;
    let width = rows.first().map_or(0, |row| row.len());
    let strip = (STRIP_NUMBERS / rows.len().max(1) / 8 * 8).max(16);
    let mut finite = true;
    for start in (0..width).step_by(strip) {
        let lanes = start..(start + strip).min(width);
        along_v.solve(rows, lanes.clone());
        for row in rows.iter() {
            finite &= all_finite(&row[lanes.clone()]);
        }
    }
    finite
}

/// Whether no number is infinite or not a number; without branches, so that it vectorises.
fn all_finite(values: &[f64]) -> bool {
    /// The bits of the exponent of an f64, all set in infinities and NaN.
    /// Derived: IEEE 754, bits 52 to 62.
    const EXPONENT_BITS: u64 = 0x7ff0_0000_0000_0000;
    /// The lowest bit of the exponent.
    /// Derived: IEEE 754, bit 52.
    const LOWEST_EXPONENT_BIT: u64 = 0x0010_0000_0000_0000;
    // Adding the lowest to a full exponent carries into the sign's place, which is clear otherwise.
    let carried = values.iter().fold(0, |bits, x| {
        bits | ((x.to_bits() & EXPONENT_BITS) + LOWEST_EXPONENT_BIT)
    });
    carried >> 63 == 0
}

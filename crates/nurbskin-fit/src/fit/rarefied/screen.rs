//! Fast score of a selection of grid lines: the distances of all points, to first order.
//!
//! ```text
//! distance ≈ |(S(u_i, v_j) - Q_ij) · n_ij| / T
//! ```
//!
//! The interpolating surface is a tensor product: a change of lines in one direction only needs that direction to be
//! solved and evaluated again, on a table that is already splined along the other one. The distance is measured along
//! the normal of the point, since a shift along the surface, as any choice of parameters causes, does not count to
//! first order. All loops run over contiguous numbers. Ours.

use crate::fit::interpolate::collocation::Collocation;
use glam::DVec3;
use nurbskin_geometry::nurbs::MAX_DEGREE;
use nurbskin_geometry::nurbs::basis::basis_functions;
use nurbskin_geometry::{PointGrid, Result};

/// A grid with its parameters and normals, ready to judge selections of lines.
///
/// "The layout of direction d" is: one line of constant parameter d after the other; of each line first all x, then all
/// y, then all z.
pub(super) struct Screen {
    pub(super) counts: [usize; 2],
    pub(super) closed: [bool; 2],
    pub(super) degree: [usize; 2],
    /// Parameters of all lines.
    pub(super) parameters: [Vec<f64>; 2],
    /// Points in the layout of each direction.
    points: [Vec<f64>; 2],
    /// The lines of each direction on which distances are measured.
    samples: [Vec<usize>; 2],
    /// Points in the layout of each direction, of every line only those on the samples of the other direction.
    sampled_points: [Vec<f64>; 2],
    /// Normals divided by the tolerance, likewise.
    sampled_normals: [Vec<f64>; 2],
    /// Number of points evaluated so far.
    pub(super) work: u64,
    scratch: Scratch,
}

/// Reused memory.
#[derive(Default)]
struct Scratch {
    controls: Vec<f64>,
    row: Vec<f64>,
}

/// The score of a selection; all distances in tolerances.
#[derive(Clone, Default)]
pub(super) struct Score {
    /// The largest distance.
    pub(super) worst: f64,
    /// The sum of the eighth powers of the distances: smooth, and dominated by the worst places.
    pub(super) objective: f64,
    /// The largest distance on each line of each direction; zero on lines without samples.
    pub(super) by_line: [Vec<f64>; 2],
}

impl Screen {
    pub(super) fn new(
        grid: &PointGrid,
        normals: &[DVec3],
        closed: [bool; 2],
        degree: [usize; 2],
        parameters: [Vec<f64>; 2],
        tolerance: f64,
    ) -> Self {
        let counts = grid.counts();
        let mut this = Self {
            counts,
            closed,
            degree,
            parameters,
            points: [0, 1].map(|d| {
                let others: Vec<usize> = (0..counts[1 - d]).collect();
                layout(grid.points(), counts, d, &others)
            }),
            samples: [Vec::new(), Vec::new()],
            sampled_points: [Vec::new(), Vec::new()],
            sampled_normals: [Vec::new(), Vec::new()],
            work: 0,
            scratch: Scratch::default(),
        };
        this.sample(grid, normals, tolerance, [1, 1]);
        this
    }

    /// Measures distances on every `strides[d]`-th line of direction d and on the last one from now on, along these
    /// normals, in units of `tolerance`.
    pub(super) fn sample(
        &mut self,
        grid: &PointGrid,
        normals: &[DVec3],
        tolerance: f64,
        strides: [usize; 2],
    ) {
        let counts = self.counts;
        let scaled: Vec<DVec3> = normals.iter().map(|&n| n / tolerance).collect();
        self.samples = [0, 1].map(|d| {
            let mut samples: Vec<usize> = (0..counts[d]).step_by(strides[d]).collect();
            if samples.last() != Some(&(counts[d] - 1)) {
                samples.push(counts[d] - 1);
            }
            samples
        });
        let of = |points: &[DVec3], d: usize| layout(points, counts, d, &self.samples[1 - d]);
        self.sampled_points = [of(grid.points(), 0), of(grid.points(), 1)];
        self.sampled_normals = [of(&scaled, 0), of(&scaled, 1)];
    }

    /// The score of the surface that interpolates `lines` of `direction` of `table` (in the layout of `direction`).
    /// Without a table the points are taken: all lines of the other direction are kept, and the score is the error of
    /// this direction alone.
    pub(super) fn judge(
        &mut self,
        direction: usize,
        lines: &[usize],
        table: Option<&[f64]>,
    ) -> Result<Score> {
        let others = self.samples[1 - direction].len();
        let mut of_lines = vec![0.0; self.counts[direction]];
        let mut of_others = vec![0.0_f64; others];
        let mut objective = 0.0;
        let mut scratch = std::mem::take(&mut self.scratch);
        let table = table.unwrap_or(&self.sampled_points[direction]);
        let done = self.evaluate(direction, lines, table, &mut scratch, |k, row| {
            let range = 3 * others * k..3 * others * (k + 1);
            let points = &self.sampled_points[direction][range.clone()];
            let normals = &self.sampled_normals[direction][range];
            let (rx, rest) = row.split_at_mut(others);
            let (ry, rz) = rest.split_at_mut(others);
            let (px, rest) = points.split_at(others);
            let (py, pz) = rest.split_at(others);
            let (nx, rest) = normals.split_at(others);
            let (ny, nz) = rest.split_at(others);
            for l in 0..others {
                rx[l] =
                    ((rx[l] - px[l]) * nx[l] + (ry[l] - py[l]) * ny[l] + (rz[l] - pz[l]) * nz[l])
                        .abs();
            }
            let mut sums = [0.0; 4];
            let mut most = [0.0_f64; 4];
            let mut tally = |quad: &[f64], other: &mut [f64]| {
                for (l, (&e, other)) in quad.iter().zip(other).enumerate() {
                    let squared = e * e;
                    let fourth = squared * squared;
                    sums[l] += fourth * fourth;
                    most[l] = if e > most[l] { e } else { most[l] };
                    *other = if e > *other { e } else { *other };
                }
            };
            let (quads, rest) = rx.as_chunks::<4>();
            let (other_quads, other_rest) = of_others.as_chunks_mut::<4>();
            for (quad, other) in quads.iter().zip(other_quads) {
                tally(quad, other);
            }
            tally(rest, other_rest);
            of_lines[k] = most.iter().copied().fold(0.0, f64::max);
            objective += (sums[0] + sums[1]) + (sums[2] + sums[3]);
        });
        self.scratch = scratch;
        self.work += (self.samples[direction].len() * others) as u64;
        done?;
        let worst = of_lines.iter().copied().fold(0.0, f64::max);
        let mut of_other_lines = vec![0.0; self.counts[1 - direction]];
        for (&l, &most) in self.samples[1 - direction].iter().zip(&of_others) {
            of_other_lines[l] = most;
        }
        let by_line = if direction == 0 {
            [of_lines, of_other_lines]
        } else {
            [of_other_lines, of_lines]
        };
        Ok(Score {
            worst,
            objective,
            by_line,
        })
    }

    /// The points splined along `direction` through `lines`, on its samples, in the layout of the *other* direction.
    pub(super) fn splined(&mut self, direction: usize, lines: &[usize]) -> Result<Vec<f64>> {
        let others = self.counts[1 - direction];
        let samples = &self.samples[direction];
        let mut scratch = std::mem::take(&mut self.scratch);
        let mut turned = vec![0.0; 3 * samples.len() * others];
        let mut position = 0;
        let table = &self.points[direction];
        let done = self.evaluate(direction, lines, table, &mut scratch, |_, row| {
            for (c, part) in row.chunks_exact(others).enumerate() {
                for (l, &x) in part.iter().enumerate() {
                    turned[(3 * l + c) * samples.len() + position] = x;
                }
            }
            position += 1;
        });
        let work = samples.len() * others;
        self.scratch = scratch;
        self.work += work as u64;
        done.map(|()| turned)
    }

    /// Calls `f` with every sampled line of the surface that interpolates `lines` of `table`.
    fn evaluate(
        &self,
        direction: usize,
        lines: &[usize],
        table: &[f64],
        Scratch { controls, row }: &mut Scratch,
        mut f: impl FnMut(usize, &mut [f64]),
    ) -> Result<()> {
        let width = table.len() / self.counts[direction];
        let parameters: Vec<f64> = lines
            .iter()
            .map(|&k| self.parameters[direction][k])
            .collect();
        let collocation = Collocation::new(
            lines.len(),
            self.closed[direction],
            self.degree[direction],
            &parameters,
            "lines",
        )?;
        controls.resize(collocation.stored() * width, 0.0);
        for (row, &k) in controls[collocation.shift * width..]
            .chunks_exact_mut(width)
            .zip(lines)
        {
            row.copy_from_slice(&table[k * width..(k + 1) * width]);
        }
        {
            let lines = collocation.rows_of(controls, width);
            let mut rows: Vec<&mut [f64]> = lines.chunks_exact_mut(width).collect();
            collocation.solve(&mut rows, 0..width);
        }
        collocation.wrap(width, controls);
        let knots = &collocation.knots;
        let degree = knots.degree();
        let mut basis = [0.0; MAX_DEGREE + 1];
        row.resize(width, 0.0);
        let mut kept = lines.iter().copied().peekable();
        for &k in &self.samples[direction] {
            while kept.next_if(|&line| line < k).is_some() {}
            if kept.next_if_eq(&k).is_some() {
                row.copy_from_slice(&table[k * width..(k + 1) * width]);
            } else {
                let t = knots.wrap(self.parameters[direction][k]);
                let span = knots.span(t);
                basis_functions(knots, span, t, &mut basis);
                let first = (span - degree) * width;
                combine(&basis[..=degree], &controls[first..], row);
            }
            f(k, row);
        }
        Ok(())
    }
}

/// `out` = sum of `weights[i]` times the i-th row of `rows`.
fn combine(weights: &[f64], rows: &[f64], out: &mut [f64]) {
    let width = out.len();
    if let [a, b, c, d] = *weights {
        let (first, rest) = rows.split_at(width);
        let (second, rest) = rest.split_at(width);
        let (third, rest) = rest.split_at(width);
        let fourth = &rest[..width];
        for k in 0..width {
            out[k] = (a * first[k] + b * second[k]) + (c * third[k] + d * fourth[k]);
        }
        return;
    }
    out.fill(0.0);
    for (&weight, row) in weights.iter().zip(rows.chunks_exact(width)) {
        for (x, &y) in out.iter_mut().zip(row) {
            *x += weight * y;
        }
    }
}

/// The coordinates of a grid of vectors in the layout of `direction`, on these lines of the other direction.
fn layout(points: &[DVec3], [m, n]: [usize; 2], direction: usize, others: &[usize]) -> Vec<f64> {
    let lines = [m, n][direction];
    let mut out = Vec::with_capacity(3 * lines * others.len());
    let coordinates: [fn(DVec3) -> f64; 3] = [|p| p.x, |p| p.y, |p| p.z];
    for k in 0..lines {
        for coordinate in coordinates {
            out.extend(others.iter().map(|&l| {
                let (i, j) = if direction == 0 { (k, l) } else { (l, k) };
                coordinate(points[j * m + i])
            }));
        }
    }
    out
}

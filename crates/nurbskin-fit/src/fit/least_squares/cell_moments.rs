//! Sums over the points of a cell, which determine its part of the normal equations.
//!
//! In a cell of the knots the products of two bicubic basis functions are polynomials of degree 6 x 6, so that
//!
//! ```text
//! m_ab = Σ w T_a(s) T_b(t),  a, b ≤ 2p      r_ab = Σ w T_a(s) T_b(t) X,  a, b ≤ p
//! ```
//!
//! in Chebyshev polynomials hold all of them: 49 sums instead of 136 products of 16 functions, and 16 sums for the
//! right-hand side. A point costs these 49 + 48 multiply-adds; the rest is work per cell. O(n (p + 1)(q + 1)).
//!
//! Source: Chebyshev product formula; the use for normal equations is ours.

use super::chebyshev::{MAX_PRODUCT, Pieces, chebyshev};
use super::samples::{CHUNK_POINTS, Cells, Samples, lower_half};
use super::spline_space::SplineSpace;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::{DVec2, DVec3};
use rayon::prelude::*;

/// Points of a cell from which on they are summed apart before they are added to the sums of the cell. Count.
/// Guard: keeps the rounding of long sums small; for fewer points it makes no difference.
const MIN_SEPARATE_SUM: usize = 16;
/// Numbers to a multiple of which a row of moments is padded. Count.
/// Derived: a vector register of 256 bits holds four.
const LANES: usize = 4;
/// Fewest cells of a parallel job. Count.
/// Guard: a smaller job takes less time than to hand it over.
const MIN_JOB_CELLS: usize = 8;

/// Weight, parameters and coordinates of a point.
pub(super) type Weighted = (f64, DVec2, DVec3);

/// Padded length of a row of moments: a whole number of vectors for cubics.
fn lanes(n: usize) -> usize {
    n.next_multiple_of(LANES)
}

/// Memory layout of the sums of one cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    /// Degrees p and q.
    degree: [usize; 2],
}

impl Layout {
    /// Moments along s and t: 2p + 1, 2q + 1.
    fn products(self) -> [usize; 2] {
        self.degree.map(|p| 2 * p + 1)
    }
    /// Places of a row of moments, and of a row of right-hand sums.
    fn rows(self) -> [usize; 2] {
        [lanes(2 * self.degree[1] + 1), lanes(self.degree[1] + 1)]
    }
    /// Where the right-hand sums begin: after the moments.
    fn right(self) -> usize {
        self.products()[0] * self.rows()[0]
    }
    fn size(self) -> usize {
        self.right() + 3 * (self.degree[0] + 1) * self.rows()[1]
    }
    /// Adds points to the sums of their cell; `frame` is middle and half length of its spans.
    #[inline]
    fn add_points(
        self,
        frame: [[f64; 2]; 2],
        points: impl Iterator<Item = Weighted>,
        sums: &mut [f64],
    ) {
        match self.degree {
            // Bicubic: lengths known at compile time.
            [3, 3] => accumulate([3, 3], frame, points, sums),
            degree => accumulate(degree, frame, points, sums),
        }
    }
}

/// The moments of all cells.
#[derive(Clone, Debug)]
pub(super) struct Moments {
    layout: Layout,
    sums: Vec<f64>,
}

/// One cell's sums over the products of pairs of local functions, u pairs slowest, and its right-hand side.
#[derive(Debug)]
pub(super) struct CellSums {
    pub(super) pairs: Vec<f64>,
    pub(super) right: Vec<DVec3>,
    /// Chebyshev coefficients of the products of pairs along u and v, of the spans last used.
    products: [Vec<f64>; 2],
    last: [usize; 2],
    half: Vec<f64>,
    half_right: Vec<DVec3>,
}

impl Moments {
    /// From all points of weight above 0. O(n), in tasks that depend on the cells alone.
    pub(super) fn new(
        space: &SplineSpace,
        pieces: &[Pieces; 2],
        samples: &Samples,
        cells: &Cells,
        weights: &[f64],
    ) -> Self {
        let layout = Layout {
            degree: space.degree(),
        };
        let [columns, _] = space.spans();
        // Large cells are cut, so that all cores have work; parts are added in order.
        let mut tasks: Vec<(usize, &[u32])> = Vec::with_capacity(cells.len());
        for cell in 0..cells.len() {
            tasks.extend(
                cells
                    .samples(cell)
                    .chunks(CHUNK_POINTS)
                    .map(|part| (cell, part)),
            );
        }
        let size = layout.size();
        let run = |(sums, &(cell, part)): (&mut [f64], &(usize, &[u32]))| {
            let frame = [
                pieces[0].span(cell % columns),
                pieces[1].span(cell / columns),
            ];
            let sample = |&k: &u32| {
                let k = k as usize;
                (weights[k], samples.parameters[k], samples.points[k])
            };
            layout.add_points(frame, part.iter().map(sample), sums);
        };
        let mut partial = vec![0.0; tasks.len() * size];
        partial
            .par_chunks_mut(size)
            .zip(&tasks)
            .with_min_len(MIN_JOB_CELLS)
            .for_each(run);
        // Most cells are one task: what follows only adds up the few that are not.
        let mut sums = vec![0.0; cells.len() * size];
        for (part, &(cell, _)) in partial.chunks(size).zip(&tasks) {
            let sum = &mut sums[cell * size..][..size];
            sum.iter_mut().zip(part).for_each(|(s, p)| *s += p);
        }
        Self { layout, sums }
    }

    /// Numbers per cell.
    pub(super) fn size(degree: [usize; 2]) -> usize {
        Layout { degree }.size()
    }
    /// From existing sums, cell by cell, with the first direction fastest; numbers after the last cell belong to the
    /// caller.
    pub(super) fn from_sums(degree: [usize; 2], sums: Vec<f64>) -> Self {
        let layout = Layout { degree };
        Self { layout, sums }
    }
    pub(super) fn sums(&self) -> &[f64] {
        &self.sums
    }
    pub(super) fn sums_mut(&mut self) -> &mut [f64] {
        &mut self.sums
    }

    /// Adds points to their cells. `keys` are sorted and hold the number of the cell in the upper half and that of the
    /// point, the argument of `sample`, in the lower. The order of summation depends on the keys alone.
    pub(super) fn add(
        &mut self,
        pieces: &[Pieces; 2],
        keys: &[u64],
        sample: impl Fn(usize) -> Weighted + Sync,
    ) {
        let (layout, size, columns) = (self.layout, self.layout.size(), pieces[0].len());
        let mut runs = Vec::new();
        let (mut rest, mut next) = (self.sums.as_mut_slice(), 0);
        for run in keys.chunk_by(|a, b| a >> 32 == b >> 32) {
            let cell = usize::try_from(run[0] >> 32).unwrap_or(usize::MAX);
            let (sums, after) =
                std::mem::take(&mut rest)[(cell - next) * size..].split_at_mut(size);
            runs.push((cell, run, sums));
            (rest, next) = (after, cell + 1);
        }
        let add = |(cell, run, sums): (usize, &[u64], &mut [f64])| {
            let frame = [
                pieces[0].span(cell % columns),
                pieces[1].span(cell / columns),
            ];
            let points = |part: &[u64], sums: &mut [f64]| {
                let each = part.iter().map(|&key| sample(lower_half(key) as usize));
                layout.add_points(frame, each, sums);
            };
            if run.len() < MIN_SEPARATE_SUM {
                return points(run, sums);
            }
            let parts = each(run.len().div_ceil(CHUNK_POINTS), |k| {
                let mut part = vec![0.0; size];
                points(
                    &run[k * CHUNK_POINTS..run.len().min((k + 1) * CHUNK_POINTS)],
                    &mut part,
                );
                part
            });
            for part in parts {
                sums.iter_mut().zip(part).for_each(|(s, p)| *s += p);
            }
        };
        runs.into_par_iter()
            .with_min_len(MIN_JOB_CELLS)
            .for_each(add);
    }

    fn cell(&self, cell: usize) -> &[f64] {
        let size = self.layout.size();
        &self.sums[cell * size..][..size]
    }
    /// `sum w T_a(s) T_b(t)` of a cell.
    pub(super) fn moment(&self, cell: usize, a: usize, b: usize) -> f64 {
        self.cell(cell)[a * self.layout.rows()[0] + b]
    }
    /// `sum w T_a(s) T_b(t) X` of a cell, a <= p and b <= q.
    pub(super) fn right(&self, cell: usize, a: usize, b: usize) -> DVec3 {
        let row = self.layout.rows()[1];
        let at = |c: usize| self.cell(cell)[self.layout.right() + (3 * a + c) * row + b];
        DVec3::new(at(0), at(1), at(2))
    }
    /// The weight of a cell's points.
    pub(super) fn weight(&self, cell: usize) -> f64 {
        self.moment(cell, 0, 0)
    }

    /// The sums over basis functions of cell (i, j) of the knots, with the points taken relative to the affine map
    /// `plane[0] + plane[1] s + plane[2] t` of its local coordinates.
    pub(super) fn expand(
        &self,
        pieces: &[Pieces; 2],
        [i, j]: [usize; 2],
        plane: [DVec3; 3],
        out: &mut CellSums,
    ) {
        let cell = j * pieces[0].len() + i;
        let [p, q] = self.layout.degree;
        let [m, n] = self.layout.products();
        let row = self.layout.rows()[0];
        let moments = self.cell(cell);
        out.prepare(pieces, [i, j]);
        let CellSums {
            pairs,
            right,
            products,
            half,
            half_right,
            ..
        } = out;
        // 1. Pairs along v for each a, then pairs along u.
        let pairs_v = products[1].len() / n;
        for (a, half) in half.chunks_mut(pairs_v).enumerate() {
            let moments = &moments[a * row..][..n];
            for (x, c) in half.iter_mut().zip(products[1].chunks(n)) {
                *x = c.iter().zip(moments).map(|(c, m)| c * m).sum();
            }
        }
        for (target, c) in pairs.chunks_mut(pairs_v).zip(products[0].chunks(m)) {
            target.fill(0.0);
            for (&c, half) in c.iter().zip(half.chunks(pairs_v)) {
                target.iter_mut().zip(half).for_each(|(x, h)| *x += c * h);
            }
        }
        // 2. The right-hand side less that of the affine map: s T_a = (T_(a + 1) + T_|a - 1|) / 2.
        let fv = pieces[1].functions(j);
        for (a, half) in half_right.chunks_mut(q + 1).enumerate() {
            half.fill(DVec3::ZERO);
            for b in 0..=q {
                let moment = |a: usize, b: usize| moments[a * row + b];
                let along = 0.5 * (moment(a + 1, b) + moment(a.abs_diff(1), b));
                let across = 0.5 * (moment(a, b + 1) + moment(a, b.abs_diff(1)));
                let sum = self.right(cell, a, b)
                    - (moment(a, b) * plane[0] + along * plane[1] + across * plane[2]);
                for (x, f) in half.iter_mut().zip(fv.chunks(q + 1)) {
                    *x += f[b] * sum;
                }
            }
        }
        right.fill(DVec3::ZERO);
        for (k, f) in pieces[0].functions(i).chunks(p + 1).enumerate() {
            for (&f, half) in f.iter().zip(half_right.chunks(q + 1)) {
                for (l, &h) in half.iter().enumerate() {
                    right[l * (p + 1) + k] += f * h;
                }
            }
        }
    }
}

impl CellSums {
    pub(super) fn new(degree: [usize; 2]) -> Self {
        let pairs = degree.map(|p| (p + 1) * (p + 2) / 2);
        let products = degree.map(|p| 2 * p + 1);
        let functions = (degree[0] + 1) * (degree[1] + 1);
        Self {
            pairs: vec![0.0; pairs[0] * pairs[1]],
            right: vec![DVec3::ZERO; functions],
            products: [0, 1].map(|d| vec![0.0; pairs[d] * products[d]]),
            last: [usize::MAX; 2],
            half: vec![0.0; products[0] * pairs[1]],
            half_right: vec![DVec3::ZERO; functions],
        }
    }
    fn prepare(&mut self, pieces: &[Pieces; 2], spans: [usize; 2]) {
        for d in 0..2 {
            if self.last[d] != spans[d] {
                pieces[d].products(spans[d], &mut self.products[d]);
                self.last[d] = spans[d];
            }
        }
    }
}

/// See [`Layout::add_points`].
#[inline(always)]
fn accumulate(
    [p, q]: [usize; 2],
    frame: [[f64; 2]; 2],
    points: impl Iterator<Item = Weighted>,
    sums: &mut [f64],
) {
    let layout = Layout { degree: [p, q] };
    let [row, right_row] = layout.rows();
    let (moments, right) = sums.split_at_mut(layout.right());
    let inverse = frame.map(|[_, half]| 1.0 / half);
    let (mut ts, mut tt) = ([0.0; MAX_PRODUCT + 1], [0.0; MAX_PRODUCT + 1]);
    for (w, t, x) in points {
        if w <= 0.0 {
            continue;
        }
        chebyshev((t.x - frame[0][0]) * inverse[0], &mut ts[..2 * p + 1]);
        chebyshev((t.y - frame[1][0]) * inverse[1], &mut tt[..2 * q + 1]);
        for (target, &a) in moments.chunks_exact_mut(row).zip(&ts[..2 * p + 1]) {
            let a = w * a;
            for (m, &b) in target.iter_mut().zip(&tt[..row]) {
                *m += a * b;
            }
        }
        for (target, &a) in right.chunks_exact_mut(3 * right_row).zip(&ts[..=p]) {
            let a = w * a;
            for (target, c) in target.chunks_exact_mut(right_row).zip(x.to_array()) {
                let c = a * c;
                for (r, &b) in target.iter_mut().zip(&tt[..right_row]) {
                    *r += c * b;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::spline_space::values_and_slopes;
    use super::*;
    use crate::chart::Topology;
    use nurbskin_geometry::nurbs::MAX_DEGREE;

    /// Every entry against the sum over the points, for a cell of many points and others of few or none.
    #[test]
    fn moments_hold_all_products() {
        for (degree, topology) in [
            ([3, 3], Topology::Disk),
            ([3, 2], Topology::Tube),
            ([1, 7], Topology::Disk),
            ([4, 1], Topology::Torus),
        ] {
            let breaks = [
                vec![0.0, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0],
                (0..=9).map(|k| f64::from(k) / 9.0).collect(),
            ];
            let space = SplineSpace::new(degree, breaks, topology).unwrap();
            let place = |k: usize, step: f64| (k as f64 * step).fract();
            let parameters: Vec<DVec2> = (0..30_000)
                .map(|k| DVec2::new(place(k, 0.618_033_988_749_9).powi(2), place(k, 0.7548)))
                .collect();
            let points: Vec<DVec3> = parameters
                .iter()
                .map(|t| DVec3::new(t.x, t.y + 0.1, (9.0 * t.x).sin()))
                .collect();
            let samples = Samples::new(&points, &parameters, 1.0);
            let weights: Vec<f64> = (0..points.len()).map(|k| place(k, 0.37)).collect();
            let cells = Cells::of_space(&space, &samples);
            let pieces = [0, 1].map(|d| Pieces::new(&space.knots[d]));
            let moments = Moments::new(&space, &pieces, &samples, &cells, &weights);
            let [columns, rows] = space.spans();
            let [p, q] = degree;
            let plane = |t: DVec2| DVec3::new(0.3, 0.1 + t.x, 2.0 * t.y);
            let mut sums = CellSums::new(degree);
            for (i, j) in (0..columns).flat_map(|i| (0..rows).map(move |j| (i, j))) {
                let [[u, hu], [v, hv]] = [pieces[0].span(i), pieces[1].span(j)];
                let middle = plane(DVec2::new(u, v));
                let flat = [middle, DVec3::Y * hu, DVec3::Z * 2.0 * hv];
                moments.expand(&pieces, [i, j], flat, &mut sums);
                let mut pairs = vec![0.0; sums.pairs.len()];
                let mut right = vec![DVec3::ZERO; sums.right.len()];
                let mut total = 0.0;
                for &k in cells.samples(j * columns + i) {
                    let (w, t) = (weights[k as usize], samples.parameters[k as usize]);
                    let mut basis = [[0.0; MAX_DEGREE + 1]; 3];
                    let [bu, bv, slopes] = &mut basis;
                    values_and_slopes(&space.knots[0], i, t.x, bu, slopes);
                    values_and_slopes(&space.knots[1], j, t.y, bv, slopes);
                    let mut entries = pairs.iter_mut();
                    for (a, b) in (0..=p).flat_map(|a| (a..=p).map(move |b| (a, b))) {
                        for (c, d) in (0..=q).flat_map(|c| (c..=q).map(move |d| (c, d))) {
                            *entries.next().unwrap() += w * bu[a] * bu[b] * bv[c] * bv[d];
                        }
                    }
                    for (at, r) in right.iter_mut().enumerate() {
                        let b = bu[at % (p + 1)] * bv[at / (p + 1)];
                        *r += w * b * (samples.points[k as usize] - plane(t));
                    }
                    total += w;
                }
                let close = 1e-13 * (1.0 + total);
                assert!((moments.weight(j * columns + i) - total).abs() < close);
                for (x, y) in sums.pairs.iter().zip(&pairs) {
                    assert!((x - y).abs() < close, "{degree:?} {x} {y}");
                }
                for (x, y) in sums.right.iter().zip(&right) {
                    assert!((*x - *y).length() < 4.0 * close, "{degree:?} {x} {y}");
                }
            }
        }
    }
}

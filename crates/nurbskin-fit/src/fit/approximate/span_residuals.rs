//! Residuals summed over small cells of the domain, strip by strip, from which the knots along u and along v are
//! chosen.
//!
//! A strip is a span of one direction, times the whole other direction. It is cut into sub-cells at three levels: three
//! parts per span (the basic test), smaller ones where cells hold many noisy points, and lines across the whole
//! surface:
//!
//! ```text
//! cell: n, Σ d, max |d|;   mean residual Σ d / n, with standard error σ / √n
//! ```
//!
//! The levels see errors of different extent: local ones, small ones, and faint ones along a whole edge. Ours.

use super::adapt::{Criterion, OUTLIER_WEIGHT};
use crate::chart::Topology;
use crate::fit::least_squares::samples::{Residual, Samples};
use crate::fit::least_squares::spline_space::SplineSpace;
use nurbskin_geometry::DVec2;
use nurbskin_geometry::numeric::parallel::each;

/// Sub-cells along a span. Count.
/// Source: the bias test of the prototypes, on three sub-cells for each span: in a single cell an error that changes
/// its sign within the span averages out.
const SUBCELLS_PER_SPAN: usize = 3;
/// Mean number of points of the smallest sub-cells, into which large spans of noisy points are cut. Count.
/// Derived: the standard error of the mean of 25 points is a fifth of sigma.
const DETAIL_CELL_POINTS: f64 = 25.0;
/// Number of detailed sub-cells per ordinary one above which the detailed level is made. Dimensionless.
/// Trial: not recorded.
const MIN_DETAIL_RATIO: f64 = 2.0;
/// Least and largest number of detailed sub-cells of a span along one direction. Count.
/// Guard: bounds the memory of the sums.
const DETAIL_PARTS: [f64; 2] = [2.0, 64.0];
/// Number of points that a detailed sub-cell and all its neighbours must hold, as a share of the mean of the sub-cells
/// of its two spans. Dimensionless.
/// Trial: not recorded. Where the points end, sub-cells lie partly beside the surface and pull means where no knot can
/// follow.
const MIN_FILL: f64 = 0.5;
/// Least mean number of points of a line of cells that is judged as one, along the whole surface. Count.
/// Trial: not recorded.
const LINE_CELL_POINTS: f64 = 45.0;
/// Most such lines in a span. Count.
/// Guard: bounds the memory of the sums.
const MAX_LINES_PER_SPAN: f64 = 64.0;
/// Points that a strip of noisy points must hold per control point that its cut adds.
/// Trial: not recorded. With fewer the new row fits noise.
const POINTS_PER_CONTROL_POINT: f64 = 4.0;
/// Control points that a row has more than spans. Count.
/// Derived: the degree of an open direction, taken as cubic.
const CUBIC_EXCESS: f64 = 3.0;
/// Blocks of samples whose residuals are summed in parallel. Count.
/// Guard: fixed, so that sums do not depend on the number of threads.
const GATHER_BLOCKS: usize = 4;

/// The residuals of a sub-cell.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gathered {
    pub(super) points: f64,
    /// Sum of signed residuals.
    pub(super) sum: f64,
    /// Largest distance.
    pub(super) largest: f64,
}

impl Gathered {
    fn add(&mut self, other: Self) {
        self.points += other.points;
        self.sum += other.sum;
        self.largest = self.largest.max(other.largest);
    }
}

/// A span along u and one along v, and the position within them, 0..=1.
type Place = ([usize; 2], [f64; 2]);

/// The division of one direction into sub-cells.
#[derive(Clone, Copy, Debug)]
struct Layout {
    /// The direction, and the numbers of spans of it and of the other.
    d: usize,
    spans: [usize; 2],
    /// Sub-cells along a span; sub-cells across per span of the other direction, or `None` for a single one across all
    /// of them.
    along: usize,
    across: Option<usize>,
}

impl Layout {
    /// Sub-cells of a strip, along and across.
    fn parts(&self) -> [usize; 2] {
        [
            self.along,
            self.across.map_or(1, |parts| parts * self.spans[1]),
        ]
    }
    /// All sub-cells.
    fn len(&self) -> usize {
        self.parts().iter().product::<usize>() * self.spans[0]
    }
    /// The sub-cell of a place.
    #[inline]
    fn cell(&self, (spans, within): &Place) -> usize {
        let part = |d: usize, parts: usize| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a fraction of a span"
            )]
            let part = ((within[d] * parts as f64) as usize).min(parts - 1);
            spans[d] * parts + part
        };
        let along = part(self.d, self.along);
        match self.across {
            None => along,
            Some(parts) => along * parts * self.spans[1] + part(1 - self.d, parts),
        }
    }
}

/// Residuals summed over the spans of one direction, each cut into sub-cells along and across.
#[derive(Debug)]
pub(super) struct SpanResiduals {
    layout: Layout,
    /// Sub-cell `(a * along + part) * across + b` of span a.
    cells: Vec<Gathered>,
}

impl SpanResiduals {
    /// The strips of both directions: three parts per span and one per span across; with noisy points also detailed
    /// sub-cells where the basic ones hold many, and lines across all spans. Outliers do not count. O(n).
    pub(super) fn levels(
        space: &SplineSpace,
        samples: &Samples,
        residuals: &[Residual],
        weights: &[f64],
        criterion: Criterion,
    ) -> [Vec<Self>; 2] {
        let spans = space.spans();
        let per_cell = samples.len() as f64 / (spans[0] * spans[1]) as f64 / DETAIL_CELL_POINTS;
        let detailed =
            criterion == Criterion::Bias && per_cell > MIN_DETAIL_RATIO * SUBCELLS_PER_SPAN as f64;
        let layouts = |d: usize| {
            let layout = |along: usize, across: Option<usize>| Layout {
                d,
                spans: [spans[d], spans[1 - d]],
                along,
                across,
            };
            let mut out = vec![layout(SUBCELLS_PER_SPAN, Some(1))];
            if detailed {
                let fine = whole(per_cell.sqrt().clamp(DETAIL_PARTS[0], DETAIL_PARTS[1]));
                out.push(layout(fine.max(SUBCELLS_PER_SPAN), Some(fine)));
            }
            // An equal offset along a whole edge, or around, shows in narrow lines though in no cell.
            let lines = samples.len() as f64 / spans[d] as f64 / LINE_CELL_POINTS;
            if criterion == Criterion::Bias && lines > SUBCELLS_PER_SPAN as f64 {
                out.push(layout(whole(lines.min(MAX_LINES_PER_SPAN)), None));
            }
            out
        };
        let (along_u, along_v) = (layouts(0), layouts(1));
        let all = [along_u.as_slice(), &along_v].concat();
        let mut strips = gather(space, samples, residuals, weights, &all);
        if detailed {
            strips[1].drop_borders(space.topology);
            strips[along_u.len() + 1].drop_borders(space.topology);
        }
        let across = strips.split_off(along_u.len());
        [strips, across]
    }

    /// The strips of both directions, in three parts per span and one per span across.
    pub(super) fn coarse(
        space: &SplineSpace,
        samples: &Samples,
        residuals: &[Residual],
        weights: &[f64],
    ) -> Vec<Self> {
        let spans = space.spans();
        let layouts = [0, 1].map(|d| Layout {
            d,
            spans: [spans[d], spans[1 - d]],
            along: SUBCELLS_PER_SPAN,
            across: Some(1),
        });
        gather(space, samples, residuals, weights, &layouts)
    }

    /// Empties the sub-cells at the borders of the points: those with a sparse neighbour.
    fn drop_borders(&mut self, topology: Topology) {
        let Layout { d, spans, .. } = self.layout;
        let [along, columns] = self.layout.parts();
        let rows = along * spans[0];
        let per_span = [along, columns / spans[1]];
        let block = |k: usize| k / columns / per_span[0] * spans[1] + k % columns / per_span[1];
        let mut means = vec![(0.0_f64, 0.0_f64); spans[0] * spans[1]];
        for (k, cell) in self.cells.iter().enumerate() {
            if cell.points > 0.0 {
                let mean = &mut means[block(k)];
                *mean = (mean.0 + cell.points, mean.1 + 1.0);
            }
        }
        let holds_much = |(k, cell): (usize, &Gathered)| {
            let (points, cells) = means[block(k)];
            cell.points > 0.0 && cell.points * cells >= MIN_FILL * points
        };
        let held: Vec<bool> = self.cells.iter().enumerate().map(holds_much).collect();
        let closed = topology.closed();
        // A cell with the ones before and after it; `None` at an end of the points. A pole is no such end.
        let around = |i: usize, n: usize, d: usize| match closed[d] {
            true => Some([(i + n - 1) % n, i, (i + 1) % n]),
            false if topology == Topology::Sphere => {
                Some([i.saturating_sub(1), i, (i + 1).min(n - 1)])
            }
            false => (0 < i && i + 1 < n).then(|| [i - 1, i, i + 1]),
        };
        for (k, cell) in self.cells.iter_mut().enumerate() {
            let near = around(k / columns, rows, d);
            let next = around(k % columns, columns, 1 - d);
            let inside = near.zip(next).is_some_and(|(near, next)| {
                let mut all = near.iter().flat_map(|i| next.map(|j| i * columns + j));
                all.all(|beside| held[beside])
            });
            if !inside {
                *cell = Gathered::default();
            }
        }
    }

    /// Spans of the direction.
    pub(super) fn spans(&self) -> usize {
        self.layout.spans[0]
    }
    /// Whether a sub-cell goes across all spans of the other direction.
    pub(super) fn across_all(&self) -> bool {
        self.layout.across.is_none()
    }
    /// The sub-cells of span a.
    pub(super) fn strip(&self, a: usize) -> &[Gathered] {
        let size: usize = self.layout.parts().iter().product();
        &self.cells[a * size..][..size]
    }
    /// Sub-cells of a strip along the span and across.
    pub(super) fn parts(&self) -> [usize; 2] {
        self.layout.parts()
    }
    /// The absolute mean residuals of the sub-cells.
    pub(super) fn means(&self) -> impl Iterator<Item = f64> {
        let held = self.cells.iter().filter(|c| c.points > 0.0);
        held.map(|c| (c.sum / c.points).abs())
    }
    /// Whether both halves of span a hold several points per control point, which those of ragged rims do not.
    pub(super) fn is_well_supported(&self, a: usize) -> bool {
        let (used, halves) = self.support(a);
        halves
            .iter()
            .all(|&n| n > POINTS_PER_CONTROL_POINT * (used + CUBIC_EXCESS))
    }
    /// Number of sub-cells across span a that have points, and number of points of its halves; for strips in three
    /// parts.
    fn support(&self, a: usize) -> (f64, [f64; 2]) {
        let strip = self.strip(a);
        let [along, across] = self.parts();
        let used = (0..across)
            .filter(|b| (0..along).any(|h| strip[h * across + b].points > 0.0))
            .count() as f64;
        let part = |h: usize| -> f64 {
            let cells = &strip[h * across..(h + 1) * across];
            cells.iter().map(|c| c.points).sum()
        };
        let middle = 0.5 * part(1);
        (used, [part(0) + middle, middle + part(2)])
    }
    /// Whether span a holds enough points for one more row of control points.
    pub(super) fn can_be_cut(&self, a: usize, criterion: Criterion) -> bool {
        let (used, halves) = self.support(a);
        let points = halves[0] + halves[1];
        match criterion {
            // Neither half may be determined by fairness alone.
            Criterion::Bias => {
                points > POINTS_PER_CONTROL_POINT * (used + CUBIC_EXCESS)
                    && halves.iter().all(|&n| n > used + CUBIC_EXCESS)
            }
            Criterion::Maximum => points >= used && halves.iter().all(|&n| n > 0.0),
        }
    }
}

/// The nearest whole number, of numbers up to 64.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "2..=64"
)]
fn whole(parts: f64) -> usize {
    parts.round() as usize
}

/// The residuals in the cells of all layouts, in one pass. O(n).
fn gather(
    space: &SplineSpace,
    samples: &Samples,
    residuals: &[Residual],
    weights: &[f64],
    layouts: &[Layout],
) -> Vec<SpanResiduals> {
    let inverse = space.breaks.each_ref().map(|breaks| -> Vec<f64> {
        let lengths = breaks.windows(2).map(|w| w[1] - w[0]);
        lengths.map(|length| 1.0 / length).collect()
    });
    let place = |t: DVec2| -> Place {
        let t = t.to_array();
        let spans = [0, 1].map(|d| space.span(d, t[d]));
        let within = [0, 1].map(|d| (t[d] - space.breaks[d][spans[d]]) * inverse[d][spans[d]]);
        (spans, within)
    };
    let lines = layouts.iter().any(|layout| layout.across.is_none());
    // Blocks of samples on all cores, summed in order.
    let blocks = each(GATHER_BLOCKS, |block| {
        let empty = |layout: &Layout| vec![Gathered::default(); layout.len()];
        let mut cells: Vec<Vec<Gathered>> = layouts.iter().map(empty).collect();
        let n = residuals.len();
        for k in block * n / GATHER_BLOCKS..(block + 1) * n / GATHER_BLOCKS {
            if weights[k] <= OUTLIER_WEIGHT {
                continue;
            }
            let r = &residuals[k];
            let one = Gathered {
                points: 1.0,
                sum: r.signed,
                largest: r.distance,
            };
            let own = place(samples.parameters[k]);
            // Noise moves parameters, but hardly foot points: by their parameters, narrow lines would collect points
            // with noise of one sign.
            let foot = if lines { place(r.foot) } else { own };
            for (layout, cells) in layouts.iter().zip(&mut cells) {
                let at = if layout.across.is_none() { &foot } else { &own };
                cells[layout.cell(at)].add(one);
            }
        }
        cells
    });
    let mut blocks = blocks.into_iter();
    let mut sums = blocks.next().unwrap_or_default();
    for block in blocks {
        for (sum, cell) in sums.iter_mut().flatten().zip(block.iter().flatten()) {
            sum.add(*cell);
        }
    }
    let strips = layouts.iter().zip(sums);
    strips
        .map(|(&layout, cells)| SpanResiduals { layout, cells })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_geometry::DVec3;

    /// 4 x 4 spans, closed along v, and 30 points in each of the 32nd parts of the domain both ways, but for those of a
    /// hole; each is off by its u.
    fn gathered(criterion: Criterion) -> (usize, [Vec<SpanResiduals>; 2]) {
        let breaks = [
            vec![0.0, 0.3, 0.5, 0.7, 1.0],
            vec![0.0, 0.25, 0.5, 0.75, 1.0],
        ];
        let space = SplineSpace::new([3, 3], breaks, Topology::Tube).unwrap();
        let place = |k: usize, step: f64| (k as f64 * step).fract();
        let parameters: Vec<DVec2> = (0..30 * 32 * 32)
            .map(|k| DVec2::new(place(k, 0.754_877_666), place(k, 0.569_840_291)))
            .filter(|t| (*t - DVec2::new(0.4, 0.125)).length() > 0.05)
            .collect();
        let points: Vec<DVec3> = parameters.iter().map(|t| t.extend(0.0)).collect();
        let samples = Samples::new(&points, &parameters, 1.0);
        let residuals: Vec<Residual> = samples
            .parameters
            .iter()
            .map(|&foot| Residual {
                signed: foot.x,
                distance: foot.x,
                foot,
            })
            .collect();
        let mut weights = vec![1.0; samples.len()];
        weights[..10].fill(0.0);
        let levels = SpanResiduals::levels(&space, &samples, &residuals, &weights, criterion);
        (samples.len() - 10, levels)
    }

    #[test]
    fn every_point_is_in_one_cell_of_each_level() {
        let (count, levels) = gathered(Criterion::Bias);
        for (d, levels) in levels.iter().enumerate() {
            assert_eq!(levels.len(), 3, "coarse, detailed, lines");
            for level in [&levels[0], &levels[2]] {
                let points: f64 = level.cells.iter().map(|c| c.points).sum();
                assert!((points - count as f64).abs() < 0.5, "{d}");
            }
            // Means are those of u, which is the same all along a line of constant u.
            let lines = &levels[2];
            assert!(lines.across_all() && lines.parts()[1] == 1);
            if d == 0 {
                let means: Vec<f64> = lines.means().collect();
                assert!(means.windows(2).all(|w| w[0] < w[1]));
            }
        }
        let (count, levels) = gathered(Criterion::Maximum);
        for levels in &levels {
            assert_eq!(levels.len(), 1, "exact points need no means");
            let points: f64 = levels[0].cells.iter().map(|c| c.points).sum();
            assert!((points - count as f64).abs() < 0.5);
            let largest = levels[0].cells.iter().map(|c| c.largest);
            assert!(largest.fold(0.0, f64::max) > 0.99);
        }
    }

    /// The smallest cells are left out along the ends of an open direction and around a hole, not across a seam.
    #[test]
    fn details_end_before_the_points_do() {
        let (_, levels) = gathered(Criterion::Bias);
        for (d, levels) in levels.iter().enumerate() {
            let detail = &levels[1];
            let [along, across] = detail.parts();
            let rows = along * detail.spans();
            let at = |row: usize, column: usize| detail.cells[row * across + column].points;
            let (u, v) = if d == 0 {
                (rows, across)
            } else {
                (across, rows)
            };
            let of = |i: usize, j: usize| if d == 0 { at(i, j) } else { at(j, i) };
            assert!((0..v).all(|j| of(0, j) <= 0.0 && of(u - 1, j) <= 0.0));
            let held = |j: usize| (1..u - 1).filter(|&i| of(i, j) > 0.0).count();
            assert!(
                held(0) > u / 2 && held(v - 1) > u / 2,
                "{} {}",
                held(0),
                held(v - 1)
            );
            // The middle of the hole lies half-way in the second span along u and in the first along v.
            let (parts_u, parts_v) = if d == 0 {
                (along, across / 4)
            } else {
                (across / 4, along)
            };
            // Beside it, and beside that.
            let (row, column) = (parts_u, parts_v / 2);
            assert!(of(row + parts_u / 2, column) <= 0.0 && of(row + 7, column) <= 0.0);
            assert!(of(row + 8, column) > 0.0 && parts_u == 9);
        }
    }
}

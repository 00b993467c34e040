//! Placement of the knots of one direction, computed from a surface that has too many.
//!
//! A dense fit, seen along one direction, is a curve in a space of many dimensions, of which a few principal directions
//! hold nearly all of it:
//!
//! ```text
//! Y(t_i) ∈ R^8,   error(knots) = min over splines C of Σ_i w_i |Y(t_i) - C(t_i)|²
//! ```
//!
//! This least squares problem is small and contains none of the points, so that many numbers and places of knots can be
//! tried: knots are removed one by one, and the rest are moved. The points only confirm the best.
//!
//! Source: principal directions by subspace iteration (Golub and Van Loan); the reduction to a profile is ours.

mod dense;

use self::dense::{backwards, explained, principal};
use super::adapt::respaced;
use crate::fit::least_squares::samples::Samples;
use crate::fit::least_squares::spline_space::{Fit, SplineSpace};
use nurbskin_geometry::nurbs::KnotVector;
use nurbskin_geometry::nurbs::basis::basis_functions;
use nurbskin_geometry::{DVec3, Result};

/// Places along a span at which the surface is sampled. Count.
/// Guard: more than the four that determine a cubic piece.
const SAMPLES_ALONG: usize = 6;
/// Places per span of the other direction at which the surface is sampled. Count.
/// Trial: not recorded. The columns only form the principal directions, so that few are enough.
const SAMPLES_ACROSS: usize = 2;
/// Leading principal directions of the profile that are kept. Count.
/// Trial: not recorded. It is enough for a surface with fewer separable features; the time grows in proportion.
const PROFILE_DIMENSIONS: usize = 8;
/// Spans of a direction above which no knots are placed. Count.
/// Guard: the time of a step grows with their third power.
pub(super) const MAX_PLACED_SPANS: usize = 64;
/// Steps by which a knot is moved, as shares of the distance to its neighbour, coarse to fine. Dimensionless.
/// Trial: not recorded.
const KNOT_STEPS: [f64; 2] = [0.25, 0.1];
/// Weight of either end of an open direction, where all other places together have 1. Dimensionless.
/// Trial: with paired seeds of the simulated clouds; 0.02 and 0.04 were used before. Without it least squares leaves
/// the largest errors at the ends.
const END_WEIGHT: f64 = 0.05;
/// Weight of a place along the direction that has no points, in mean weights of a place.
/// Guard: keeps the normal equations regular; any small value does.
const EMPTY_PLACE_WEIGHT: f64 = 0.01;
/// Weight of a filled-in value where a line has no points, relative to a measured value. Dimensionless.
/// Guard: keeps the normal equations regular; any small value does.
const FILLED_VALUE_WEIGHT: f64 = 0.01;

/// Breakpoints of one direction, optimised for their number.
pub(super) struct Placed {
    pub(super) breaks: Vec<f64>,
    /// Mean squared distance to the dense surface where points hold it.
    pub(super) error: f64,
}

/// The dense surface along one direction: samples in its principal directions.
struct Profile {
    degree: usize,
    closed: bool,
    places: Vec<f64>,
    /// The sum is 1, without the two ends of an open direction.
    weights: Vec<f64>,
    /// Coordinates of each place in the principal directions.
    values: Vec<[f64; PROFILE_DIMENSIONS]>,
    /// Present where cells have no points.
    blind: Option<Blind>,
}

/// A surface that points hold only in part. Elsewhere it is replaced by the extrapolation of splines on fewer and fewer
/// knots, so that it costs few of them.
struct Blind {
    /// The surface minus its chord, times the roots of the weights of the other direction: a row for each place.
    matrix: Vec<f64>,
    columns: usize,
    /// Whether the cell of each pair of places, of this and of the other direction, has points.
    held: Vec<bool>,
}

/// Breakpoints of direction `d`, removed one after the other while the remaining ones move to better places, down to
/// `fewest` breakpoints or until the mean squared error exceeds `bound`. The first entry holds the breakpoints of the
/// fit. For at most [`MAX_PLACED_SPANS`]. O(spans^4).
pub(super) fn placed(
    fit: &Fit,
    samples: &Samples,
    d: usize,
    fewest: usize,
    bound: f64,
) -> Result<Vec<Placed>> {
    Profile::new(fit, samples, d).thinned(&fit.space.breaks[d], fewest, bound)
}

impl Profile {
    /// The removal of [`placed`].
    fn thinned(&mut self, all: &[f64], fewest: usize, bound: f64) -> Result<Vec<Placed>> {
        let mut breaks = all.to_vec();
        let mut out = vec![Placed {
            breaks: breaks.clone(),
            error: 0.0,
        }];
        while breaks.len() > fewest.max(3) {
            // 1. Remove the knot that is missed least, or respace all with their present or original density: single
            // knots removed from an even row leave gaps.
            let mut trials: Vec<Vec<f64>> = (1..breaks.len() - 1)
                .map(|r| [&breaks[..r], &breaks[r + 1..]].concat())
                .collect();
            trials.push(respaced(&breaks, breaks.len() - 2));
            trials.push(respaced(all, breaks.len() - 2));
            let mut error = f64::INFINITY;
            for trial in trials {
                let next = self.error(&trial)?;
                if next < error {
                    (breaks, error) = (trial, next);
                }
            }
            // 2. Move each of the others a little to the left or right.
            for step in KNOT_STEPS {
                for r in 1..breaks.len() - 1 {
                    for (side, other) in [(-1.0, r - 1), (1.0, r + 1)] {
                        let mut moved = breaks.clone();
                        moved[r] += side * step * (breaks[r] - breaks[other]).abs();
                        let next = self.error(&moved)?;
                        if next < error {
                            (breaks, error) = (moved, next);
                            break;
                        }
                    }
                }
            }
            // 3. Refill the surface on these knots where no points hold it.
            if self.fill(&breaks)? {
                error = self.error(&breaks)?;
            }
            if error > bound {
                break;
            }
            out.push(Placed {
                breaks: breaks.clone(),
                error,
            });
        }
        Ok(out)
    }

    fn new(fit: &Fit, samples: &Samples, d: usize) -> Self {
        let space = &fit.space;
        let closed = space.topology.closed()[d];
        let mut places = [d, 1 - d].map(|e| {
            let each = if e == d {
                SAMPLES_ALONG
            } else {
                SAMPLES_ACROSS
            };
            within_spans(&space.breaks[e], each)
        });
        let mut weights = [0, 1].map(|k| {
            let e = if k == 0 { d } else { 1 - d };
            density(&places[k], samples, e)
        });
        if !closed {
            for (end, at) in [(0.0, 0), (1.0, places[0].len() + 1)] {
                places[0].insert(at, end);
                weights[0].insert(at, END_WEIGHT);
            }
        }
        let grid = grid(fit, d, &places);
        let columns = 3 * places[1].len();
        // The chord is subtracted: every spline has it, and it would take dimensions.
        let rows = places[0].len();
        let mut matrix: Vec<f64> = vec![0.0; rows * columns];
        for j in 0..places[1].len() {
            let at = |i: usize| grid[i * places[1].len() + j];
            let (first, last) = (at(0), at(rows - 1));
            let across = places[0][rows - 1] - places[0][0];
            for i in 0..rows {
                let t = (places[0][i] - places[0][0]) / across;
                let base = if closed { first } else { first.lerp(last, t) };
                let value = (at(i) - base) * weights[1][j].sqrt();
                matrix[i * columns + 3 * j..][..3].copy_from_slice(&value.to_array());
            }
        }
        let held = held(space, samples, d, &places);
        let [places, _] = places;
        let [weights, _] = weights;
        Self {
            degree: space.degree()[d],
            closed,
            values: principal(&matrix, columns, &weights),
            places,
            weights,
            blind: (!held.iter().all(|&held| held)).then_some(Blind {
                matrix,
                columns,
                held,
            }),
        }
    }

    fn knots(&self, breaks: &[f64]) -> Result<KnotVector> {
        if self.closed {
            KnotVector::periodic(self.degree, breaks)
        } else {
            KnotVector::clamped(self.degree, breaks)
        }
    }

    /// Replaces the values without points by those of the splines on these breakpoints that are closest elsewhere;
    /// `false` where points hold all of it.
    fn fill(&mut self, breaks: &[f64]) -> Result<bool> {
        let Some(blind) = &self.blind else {
            return Ok(false);
        };
        let knots = self.knots(breaks)?;
        let (p, n, rows) = (self.degree, knots.distinct_count(), self.places.len());
        let across = blind.columns / 3;
        let mut matrix = blind.matrix.clone();
        let mut basis = vec![0.0; p + 1];
        for j in 0..across {
            let held = |i: usize| blind.held[i * across + j];
            if (0..rows).all(held) {
                continue;
            }
            let weight =
                |i: usize| self.weights[i] * if held(i) { 1.0 } else { FILLED_VALUE_WEIGHT };
            let value = |i: usize| {
                let xyz = &blind.matrix[i * blind.columns + 3 * j..][..3];
                [xyz[0], xyz[1], xyz[2]]
            };
            let (mut normal, mut control) = self.normal(breaks, &knots, weight, value);
            explained(&mut normal, &mut control);
            backwards(&normal, &mut control);
            let mut span = 0;
            for (i, &t) in self.places.iter().enumerate() {
                while span + 2 < breaks.len() && t >= breaks[span + 1] {
                    span += 1;
                }
                if held(i) {
                    continue;
                }
                basis_functions(&knots, span + p, t, &mut basis);
                let cell = &mut matrix[i * blind.columns + 3 * j..][..3];
                cell.fill(0.0);
                for (k, &b) in basis.iter().enumerate() {
                    for (x, c) in cell.iter_mut().zip(&control[(span + k) % n]) {
                        *x += b * c;
                    }
                }
            }
        }
        self.values = principal(&matrix, blind.columns, &self.weights);
        Ok(true)
    }

    /// The normal equations, lower half, of splines on these breakpoints to N-dimensional values.
    fn normal<const N: usize>(
        &self,
        breaks: &[f64],
        knots: &KnotVector,
        weight: impl Fn(usize) -> f64,
        value: impl Fn(usize) -> [f64; N],
    ) -> (Vec<f64>, Vec<[f64; N]>) {
        let (p, n) = (self.degree, knots.distinct_count());
        let mut matrix = vec![0.0; n * n];
        let mut right = vec![[0.0; N]; n];
        let mut basis = vec![0.0; p + 1];
        let mut span = 0;
        for (i, &t) in self.places.iter().enumerate() {
            while span + 2 < breaks.len() && t >= breaks[span + 1] {
                span += 1;
            }
            basis_functions(knots, span + p, t, &mut basis);
            let (w, values) = (weight(i), value(i));
            for (k, &b) in basis.iter().enumerate() {
                let row = (span + k) % n;
                for (l, &c) in basis[..=k].iter().enumerate() {
                    let column = (span + l) % n;
                    matrix[row.max(column) * n + row.min(column)] += w * b * c;
                }
                for (x, y) in right[row].iter_mut().zip(&values) {
                    *x += w * b * y;
                }
            }
        }
        (matrix, right)
    }

    /// The least weighted mean squared distance of a spline on these breakpoints.
    fn error(&self, breaks: &[f64]) -> Result<f64> {
        let knots = self.knots(breaks)?;
        let (weight, value) = (|i: usize| self.weights[i], |i: usize| self.values[i]);
        let (mut matrix, mut right) = self.normal(breaks, &knots, weight, value);
        let square = |values: &[f64; PROFILE_DIMENSIONS]| values.iter().map(|y| y * y).sum::<f64>();
        let all = self.weights.iter().zip(&self.values);
        let total: f64 = all.map(|(w, values)| w * square(values)).sum();
        Ok((total - explained(&mut matrix, &mut right)).max(0.0))
    }
}

/// Places spread evenly within each span.
fn within_spans(breaks: &[f64], each: usize) -> Vec<f64> {
    let place = |w: &[f64], k: usize| w[0] + (k as f64 + 0.5) / each as f64 * (w[1] - w[0]);
    breaks
        .windows(2)
        .flat_map(|w| (0..each).map(move |k| place(w, k)))
        .collect()
}

/// Share of the samples nearest to each place; a small weight where there are none.
fn density(places: &[f64], samples: &Samples, d: usize) -> Vec<f64> {
    let mut held = vec![0.0_f64; places.len()];
    for k in (0..samples.len()).filter(|&k| !samples.is_support(k)) {
        let t = samples.parameters[k].to_array()[d];
        let next = places.partition_point(|&x| x < t).min(places.len() - 1);
        let before = next.saturating_sub(1);
        let nearest = if t - places[before] < places[next] - t {
            before
        } else {
            next
        };
        held[nearest] += 1.0;
    }
    let least = EMPTY_PLACE_WEIGHT * samples.measured() as f64 / places.len() as f64;
    let total: f64 = held.iter().map(|&n| n.max(least)).sum();
    held.iter().map(|&n| n.max(least) / total).collect()
}

/// Whether there are points in the cell of each place of direction `d` (slowest) and of the other.
fn held(space: &SplineSpace, samples: &Samples, d: usize, places: &[Vec<f64>; 2]) -> Vec<bool> {
    let spans = |e: usize| space.breaks[e].len() - 1;
    let span = |e: usize, t: f64| space.breaks[e][1..spans(e)].partition_point(|&b| b <= t);
    let mut any = vec![false; spans(0) * spans(1)];
    for k in (0..samples.len()).filter(|&k| !samples.is_support(k)) {
        let at = samples.parameters[k];
        any[span(0, at.x) * spans(1) + span(1, at.y)] = true;
    }
    let cell = |along: f64, across: f64| match d {
        0 => span(0, along) * spans(1) + span(1, across),
        _ => span(0, across) * spans(1) + span(1, along),
    };
    let [along, across] = places;
    let row = |&t: &f64| across.iter().map(move |&s| (t, s));
    let all = along.iter().flat_map(row);
    all.map(|(t, s)| any[cell(t, s)]).collect()
}

/// The surface at the places of direction `d` (slowest) and of the other.
fn grid(fit: &Fit, d: usize, places: &[Vec<f64>; 2]) -> Vec<DVec3> {
    let basis = |e: usize, places: &[f64]| -> Vec<(usize, Vec<f64>)> {
        let knots = &fit.space.knots[e];
        let each = |&t: &f64| {
            let span = fit.space.span(e, t);
            let mut values = vec![0.0; knots.degree() + 1];
            basis_functions(knots, span + knots.degree(), t, &mut values);
            (span, values)
        };
        places.iter().map(each).collect()
    };
    let (along, across) = (basis(d, &places[0]), basis(1 - d, &places[1]));
    let stride = fit.space.stride();
    let mut out = Vec::with_capacity(along.len() * across.len());
    for (a, x) in &along {
        for (b, y) in &across {
            let mut point = DVec3::ZERO;
            for (k, &x) in x.iter().enumerate() {
                for (l, &y) in y.iter().enumerate() {
                    let (i, j) = if d == 0 {
                        (a + k, b + l)
                    } else {
                        (b + l, a + k)
                    };
                    point += x * y * fit.net[j * stride + i];
                }
            }
            out.push(point);
        }
    }
    out
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may stop")]
mod tests {
    use super::*;

    const KNOTS: [f64; 8] = [0.0, 0.13, 0.19, 0.37, 0.5, 0.81, 0.9, 1.0];

    /// A cubic spline in all dimensions on these breakpoints, its control points far from any lower number of knots.
    fn spline(breaks: &[f64], closed: bool) -> Profile {
        let knots = if closed {
            KnotVector::periodic(3, breaks).unwrap()
        } else {
            KnotVector::clamped(3, breaks).unwrap()
        };
        let n = knots.distinct_count();
        let places = within_spans(&respaced(&[0.0, 1.0], 200), 1);
        let value = |t: &f64| {
            let span = breaks[1..breaks.len() - 1].partition_point(|b| b <= t);
            let mut basis = [0.0; 4];
            basis_functions(&knots, span + 3, *t, &mut basis);
            std::array::from_fn(|c| {
                let control = |i: usize| (1.7 * ((i % n) * (c + 2)) as f64 + c as f64).sin();
                (0..4).map(|k| basis[k] * control(span + k)).sum()
            })
        };
        Profile {
            degree: 3,
            closed,
            values: places.iter().map(value).collect(),
            weights: vec![1.0 / places.len() as f64; places.len()],
            places,
            blind: None,
        }
    }

    #[test]
    fn known_knots_are_found_among_others() {
        for closed in [false, true] {
            let mut profile = spline(&KNOTS, closed);
            let mut all = [&KNOTS[..], &respaced(&[0.0, 1.0], 13)[1..13]].concat();
            all.sort_by(f64::total_cmp);
            let lists = profile.thinned(&all, 2, f64::INFINITY).unwrap();
            let found = lists.iter().find(|p| p.breaks.len() == KNOTS.len());
            let found = found.unwrap();
            assert!(found.error < 1e-12, "{}", found.error);
            for (x, y) in found.breaks.iter().zip(KNOTS) {
                assert!((x - y).abs() < 1e-9, "{:?}", found.breaks);
            }
            // One fewer does not do: it is where the error starts.
            let next = &lists[all.len() - KNOTS.len() + 1];
            assert!(next.error > 1e-5, "{}", next.error);
        }
    }

    /// A curve of which some places, in one of two columns, hold nothing of it.
    fn partly_blind(closed: bool) -> Profile {
        let mut profile = spline(&KNOTS, closed);
        let columns = 6;
        let mut matrix = Vec::new();
        let mut held = Vec::new();
        for (t, values) in profile.places.iter().zip(&profile.values) {
            let blind = *t > 0.55 && *t < 0.75;
            let made_up = if blind { 0.3 * (40.0 * t).sin() } else { 0.0 };
            let [x, y, z, ..] = *values;
            matrix.extend([x, y, z, y + made_up, z - made_up, x + made_up]);
            held.extend([true, !blind]);
        }
        profile.values = principal(&matrix, columns, &profile.weights);
        profile.blind = Some(Blind {
            matrix,
            columns,
            held,
        });
        profile
    }

    #[test]
    fn what_no_point_holds_is_no_error() {
        for closed in [false, true] {
            let mut profile = partly_blind(closed);
            let seen = profile.error(&KNOTS).unwrap();
            assert!(seen > 0.01, "{seen}");
            assert!(profile.fill(&KNOTS).unwrap());
            let filled = profile.error(&KNOTS).unwrap();
            assert!(filled < 1e-3 * seen, "{filled} {seen}");
            // Taking knots out one by one comes to the same.
            let few = |mut profile: Profile| {
                let lists = profile.thinned(&KNOTS, 5, f64::INFINITY).unwrap();
                let last = lists.last().unwrap();
                (last.error, last.breaks.len())
            };
            let believed = Profile {
                blind: None,
                ..partly_blind(closed)
            };
            let (known, believed) = (few(partly_blind(closed)), few(believed));
            assert!(
                known.1 == believed.1 && known.0 < believed.0,
                "{known:?} {believed:?}"
            );
        }
    }

    #[test]
    fn knots_go_where_the_curve_has_its_own() {
        for closed in [false, true] {
            let mut profile = spline(&KNOTS, closed);
            let even = |spans: usize| respaced(&[0.0, 1.0], spans);
            let lists = profile.thinned(&even(26), 2, f64::INFINITY).unwrap();
            let mut last = 0.0;
            for placed in &lists[1..] {
                let spans = placed.breaks.len() - 1;
                // No worse than even knots of the same number; as many in all as asked for, in order.
                assert!(placed.error <= profile.error(&even(spans)).unwrap());
                assert!(placed.breaks.windows(2).all(|w| w[0] < w[1]));
                last = f64::max(last, placed.error);
            }
            let same = lists.iter().find(|p| p.breaks.len() == KNOTS.len());
            let even = profile.error(&even(KNOTS.len() - 1)).unwrap();
            let (error, bound) = (same.unwrap().error, 0.05 * even);
            assert!(error < bound, "{error} {bound} {:?}", same.unwrap().breaks);
            // The bound ends it.
            let few = profile
                .thinned(&respaced(&[0.0, 1.0], 26), 2, 0.1 * last)
                .unwrap();
            assert!(few.len() < lists.len() && few.iter().all(|p| p.error <= 0.1 * last));
        }
    }
}

//! Record of the surfaces that an approximation visits, with the distances of the points from them.
//!
//! ```text
//! visit: control points N, p95, max, and the distance that the demanded share of the points keeps
//! ```
//!
//! The records of the main rounds form the curve of deviation over size (`trade`); they cost no additional fit. Ours.

use super::goal::Goal;
use super::problem::{Problem, State};
use super::trade::{Met, TradePoint};
use crate::fit::least_squares::samples::{Samples, residuals};
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Points that measure a surface which was fitted to means of groups. Count.
/// Derived: the quantiles of ten thousand points are right to within one per cent.
const GAUGE_POINTS: usize = 10_000;

/// Factors by which a tolerance is loosened until no region is biased. Dimensionless.
/// Guard: few, since each takes a test of all points; 3 is taken where none suffices.
const LOOSENING_FACTORS: [f64; 5] = [1.0, 1.2, 1.5, 2.0, 3.0];
/// Samples above which regions are not tested for bias here. Count.
/// Guard: the test would take a part of a second for each surface.
const BIAS_TEST_MAX_POINTS: usize = 100_000;

/// A sequence of growing surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    /// The rounds of the search for a tolerance.
    Search,
    /// The rounds of spending a budget, the last time if there are several.
    Budget,
}

/// The visits, in order.
#[derive(Debug, Default)]
struct Lists {
    all: Vec<TradePoint>,
    searched: Vec<TradePoint>,
    bought: Vec<TradePoint>,
}

/// The shared record of visits.
#[derive(Debug, Default)]
pub(super) struct Visits(Mutex<Lists>);

impl Visits {
    /// The lists stay valid if another thread fails while it holds the lock.
    fn lists(&self) -> MutexGuard<'_, Lists> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts the record of another budget.
    pub(super) fn begin(&self) {
        self.lists().bought.clear();
    }

    /// All of them, in units of `scale`.
    pub(super) fn met(self, scale: f64) -> Met {
        let lists = self.0.into_inner().unwrap_or_else(PoisonError::into_inner);
        let scaled = |list: Vec<TradePoint>| {
            let of = |visit: TradePoint| TradePoint {
                p95: scale * visit.p95,
                max: scale * visit.max,
                tolerance: scale * visit.tolerance,
                ..visit
            };
            list.into_iter().map(of).collect()
        };
        Met {
            surfaces: scaled(lists.all),
            way: scaled(match lists.searched.is_empty() {
                true => lists.bought,
                false => lists.searched,
            }),
        }
    }
}

/// Points that measure surfaces fitted to other samples.
#[derive(Clone, Debug)]
pub(super) struct Gauge {
    samples: Samples,
    weights: Vec<f64>,
}

impl Gauge {
    /// A regular subset of the samples, with their weights.
    pub(super) fn new(samples: &Samples, weights: &[f64]) -> Self {
        let step = samples.len().div_ceil(GAUGE_POINTS).max(1);
        Self {
            samples: samples.part(step),
            weights: weights.iter().copied().step_by(step).collect(),
        }
    }
}

impl Problem<'_> {
    /// Records a surface with the distances of the points from it. `kept` is the distance that the demanded share of
    /// them keeps, where it is known. O(n).
    pub(super) fn visit(&self, state: &State, kept: Option<f64>) {
        let seen = self.seen(state, kept);
        self.visits.lists().all.extend(seen);
    }

    /// [`visit`](Self::visit) of the next surface of a sequence. A search continues where a region is biased, too.
    pub(super) fn step(&self, state: &State, kept: Option<f64>, way: Way) {
        let Some(mut seen) = self.seen(state, kept) else {
            return;
        };
        let unbiased = self.unbiased(state, seen.tolerance);
        let mut lists = self.visits.lists();
        lists.all.push(seen);
        seen.tolerance = unbiased;
        match way {
            Way::Search => lists.searched.push(seen),
            Way::Budget => lists.bought.push(seen),
        }
    }

    /// The least of the loosened tolerances, from `kept` on, at which no region is biased.
    fn unbiased(&self, state: &State, kept: f64) -> f64 {
        // Means of groups hide the noise, so that the points themselves are measured.
        if self.gauge.is_some() || self.samples.len() > BIAS_TEST_MAX_POINTS {
            return kept;
        }
        let points = self.counted(state, kept);
        let tried = LOOSENING_FACTORS.map(|factor| factor * kept);
        let good = |tolerance: &f64| {
            let goal = Goal {
                tolerance: *tolerance,
                within: self.share,
            };
            !self.is_biased(state, &points, goal)
        };
        tried
            .into_iter()
            .find(good)
            .unwrap_or(LOOSENING_FACTORS[4] * kept)
    }

    /// The distances of the points; `None` where no point counts.
    fn seen(&self, state: &State, kept: Option<f64>) -> Option<TradePoint> {
        let mut off: Vec<f64> = match self.gauge {
            Some(Gauge { samples, weights }) => {
                let found = residuals(&state.fit, samples);
                let counts =
                    |k: &usize| weights[*k] > 0.0 && (samples.original[*k] as usize) < self.own;
                let own = (0..found.len()).filter(counts);
                own.map(|k| found[k].distance).collect()
            }
            None => {
                let tolerance = self.goal.map_or(self.tolerance, |goal| goal.tolerance);
                let counted = self.counted(state, tolerance).into_iter();
                counted.map(|k| state.residuals[k].distance).collect()
            }
        };
        (!off.is_empty()).then(|| TradePoint {
            control_points: state.fit.space.size(),
            p95: quantile_in_place(&mut off, 0.95),
            max: off.iter().copied().fold(0.0, f64::max),
            tolerance: kept.unwrap_or_else(|| quantile_in_place(&mut off, self.share)),
        })
    }
}

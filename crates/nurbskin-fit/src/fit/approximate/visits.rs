//! The surfaces that an approximation meets on its way, with how far the points are from them.

use super::goal::Goal;
use super::problem::{Problem, State};
use super::trade::{Met, TradePoint};
use crate::fit::least_squares::samples::{Samples, residuals};
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Number of points that measure a surface which was fitted to means of groups. The quantiles of so many points are right to
/// within one per cent.
const GAUGED: usize = 10_000;

/// Factors by which a tolerance is loosened until no region is biased; a few, each of which takes a test of all points.
const LOOSENED: [f64; 5] = [1.0, 1.2, 1.5, 2.0, 3.0];
/// With more points than this that is not tested: it would take a part of a second for each surface.
const TESTED: usize = 100_000;

/// Who goes a way of ever larger surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    /// The search for a tolerance.
    Search,
    /// What a budget buys; the last of several.
    Budget,
}

/// What was met, in the order in which it was.
#[derive(Debug, Default)]
struct Lists {
    all: Vec<TradePoint>,
    searched: Vec<TradePoint>,
    bought: Vec<TradePoint>,
}

/// What an approximation met, kept from wherever it goes.
#[derive(Debug, Default)]
pub(super) struct Visits(Mutex<Lists>);

impl Visits {
    /// A list is whole whoever fails while it is locked.
    fn lists(&self) -> MutexGuard<'_, Lists> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// From here on another budget is spent.
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

/// Points by which surfaces are measured that are fitted to others.
#[derive(Clone, Debug)]
pub(super) struct Gauge {
    samples: Samples,
    weights: Vec<f64>,
}

impl Gauge {
    /// Some of the samples, with their weights.
    pub(super) fn new(samples: &Samples, weights: &[f64]) -> Self {
        let step = samples.len().div_ceil(GAUGED).max(1);
        Self {
            samples: samples.part(step),
            weights: weights.iter().copied().step_by(step).collect(),
        }
    }
}

impl Problem<'_> {
    /// Keeps how far the points are from a surface that was met; `kept` is the distance that the demanded share of them
    /// keeps, where that is known. O(n).
    pub(super) fn visit(&self, state: &State, kept: Option<f64>) {
        let seen = self.seen(state, kept);
        self.visits.lists().all.extend(seen);
    }

    /// [`visit`](Self::visit) of the next surface on a way. A search goes on where a region is biased, too.
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

    /// The least of some tolerances, from the one that enough points keep on, with which no region is biased either.
    fn unbiased(&self, state: &State, kept: f64) -> f64 {
        // The means of groups hide the noise, so the points themselves are measured.
        if self.gauge.is_some() || self.samples.len() > TESTED {
            return kept;
        }
        let points = self.counted(state, kept);
        let tried = LOOSENED.map(|factor| factor * kept);
        let good = |tolerance: &f64| {
            let goal = Goal {
                tolerance: *tolerance,
                within: self.share,
            };
            !self.is_biased(state, &points, goal)
        };
        tried.into_iter().find(good).unwrap_or(LOOSENED[4] * kept)
    }

    /// How far the points are; `None` where no point counts.
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

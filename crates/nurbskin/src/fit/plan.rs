//! What is tried in which order: the fewest knots for the tolerance, or the least error for a budget, with the chart as
//! it is or corrected.

use super::adapt::Criterion;
use super::approximate::{Approximation, ApproximateOptions, Round, Status};
use super::budget::{Spent, knob};
use super::engine::{Engine, State};
use super::refinement::TOO_FEW;
use super::robust::Neighbourhoods;
use crate::numeric::statistics::quantile_in_place;
use crate::Result;

/// With more points than this, knots are found on a part of them ...
const MANY: usize = 60_000;
/// ... of about so many.
const PART: usize = 40_000;
/// A surface that misses the tolerance by more than this factor with all knots where they gain most will not reach it
/// with the same number elsewhere.
const HOPELESS: f64 = 3.0;
/// With more points than this, parameters are not corrected: the chart of so many points is good enough.
const CORRECTED: usize = 300_000;
/// Every so-manieth sample judges whether a correction helps.
const HELD_OUT: usize = 8;
/// Standard errors by which it must.
const CONVINCING: f64 = 3.0;

impl Engine<'_> {
    /// The approximation asked for.
    pub(super) fn approximation(
        &self,
        options: &ApproximateOptions,
        scale: f64,
    ) -> Result<Approximation> {
        let breaks = self.start(options)?;
        if !options.refine {
            let (state, history, status) = self.fit_once(&breaks)?;
            return self.finish(state, history, status, scale);
        }
        if self.samples.len() > MANY {
            return self.large(breaks, options, scale);
        }
        // 1. Within a budget: what it can do.
        let mut spent = None;
        if options.max_control_points.is_some() {
            let best = self.least_error(&breaks, options.correct)?;
            if self.is_hopeless(&best) {
                return self.finish_spent(best, scale);
            }
            spent = Some(best);
        }
        // 2. The fewest control points for the tolerance.
        let mut economical = breaks.clone();
        let engine = self.with(spent.as_ref().and_then(|s| s.samples.as_ref()));
        let (state, history, status) = engine.refine(&mut economical, true)?;
        let over_budget = matches!(&status, Status::NotMet(why) if *why == self.over_budget());
        if status == Status::Met || (spent.is_none() && !over_budget) {
            return engine.finish(state, history, status, scale);
        }
        // 3. Not to be had: the better of both.
        let best = match &spent {
            Some(best) => best.clone(),
            None => self.least_error(&breaks, options.correct)?,
        };
        if self.is_better(&best.state, &state) {
            return self.finish_spent(best, scale);
        }
        engine.finish(state, history, status, scale)
    }

    /// Whether the tolerance is out of reach for the control points that were spent. What was corrected was so because
    /// knots alone did not do.
    fn is_hopeless(&self, spent: &Spent) -> bool {
        let worst = spent.history.last().map_or(0.0, |r| r.worst);
        worst > if spent.samples.is_some() { 1.0 } else { HOPELESS }
    }

    /// The result of spending the budget.
    fn finish_spent(&self, spent: Spent, scale: f64) -> Result<Approximation> {
        let engine = self.with(spent.samples.as_ref());
        let worst = spent.history.last().map_or(0.0, |r| r.worst);
        let counts = spent.state.fit.space.counts();
        let full = counts[0] * counts[1] + counts[0].min(counts[1]) > self.budget;
        let status = match worst <= 1.0 {
            true => Status::Met,
            false if full => Status::NotMet(self.over_budget()),
            false => Status::NotMet(TOO_FEW.into()),
        };
        engine.finish(spent.state, spent.history, status, scale)
    }

    /// The surface of least overall error within the budget, with corrected parameters if those are better.
    fn least_error(&self, breaks: &[Vec<f64>; 2], correct: bool) -> Result<Spent> {
        let correct = correct && knob("CORRECT", 1.0) > 0.0;
        let mut spent = if !correct {
            self.spend(breaks.clone(), false)?
        } else if self.criterion == Criterion::Maximum {
            // Exact points: every single step was checked.
            self.spend(breaks.clone(), true)?
        } else {
            let held_out: Vec<bool> = (0..self.samples.len())
                .map(|k| k % HELD_OUT == HELD_OUT / 2)
                .collect();
            let engine = Engine {
                held_out: Some(&held_out),
                ..*self
            };
            let as_it_is = engine.spend(breaks.clone(), false)?;
            let corrected = engine.spend(breaks.clone(), true)?;
            if knob("VERBOSE", 0.0) > 0.0 { eprintln!("  convinced: {}", convinced(&held_out, &as_it_is.state, &corrected.state)); }
            if corrected.samples.is_some() && convinced(&held_out, &as_it_is.state, &corrected.state) {
                corrected
            } else {
                as_it_is
            }
        };
        // All points, their weights settled.
        let engine = self.with(spent.samples.as_ref());
        let settled = engine.settle(&spent.breaks, Some(&spent.state), 1)?;
        if engine.holds(&spent.state, &settled) {
            let round = engine.round(&settled, &engine.marks(&settled));
            spent.history.push(round);
            spent.state = settled;
        }
        Ok(spent)
    }

    /// Whether one state is closer to the points than another, all in all.
    fn is_better(&self, one: &State, other: &State) -> bool {
        let level = |state: &State| {
            let mut distances: Vec<f64> = state.residuals.iter().map(|r| r.distance).collect();
            quantile_in_place(&mut distances, 0.95)
        };
        level(one) < level(other)
    }

    /// Most of the way on a part of the points; all of them only have to confirm it.
    fn large(
        &self,
        mut breaks: [Vec<f64>; 2],
        options: &ApproximateOptions,
        scale: f64,
    ) -> Result<Approximation> {
        let part = self.samples.part(self.samples.len().div_ceil(PART));
        let neighbourhoods = Neighbourhoods::new(&part, self.size);
        let first = Engine {
            samples: &part,
            neighbourhoods: &neighbourhoods,
            ..*self
        };
        let mut hopeless = false;
        let mut history = Vec::new();
        if options.max_control_points.is_some() {
            let spent = first.least_error(&breaks, false)?;
            hopeless = self.is_hopeless(&spent);
            if hopeless {
                if options.correct && self.samples.len() <= CORRECTED {
                    return self.finish_spent(self.least_error(&breaks, true)?, scale);
                }
                (breaks, history) = (spent.breaks, spent.history);
            }
        }
        if hopeless {
            let (state, rounds, _) = self.fit_once(&breaks)?;
            history.extend(rounds);
            let status = Status::NotMet(self.over_budget());
            return self.finish(state, history, status, scale);
        }
        let (state, mut history, _) = first.refine(&mut breaks, true)?;
        drop(state);
        let (state, rounds, status): (_, Vec<Round>, _) = self.refine(&mut breaks, false)?;
        history.extend(rounds);
        self.finish(state, history, status, scale)
    }
}

/// Whether the samples held out lie closer to the other surface, by more than chance.
fn convinced(held_out: &[bool], before: &State, after: &State) -> bool {
    let of = |state: &State| -> Vec<f64> {
        let held = state.residuals.iter().zip(held_out).filter(|h| *h.1);
        held.map(|h| h.0.distance).collect()
    };
    let (mut before, mut after) = (of(before), of(after));
    // Outliers say nothing.
    let cap = 2.0 * quantile_in_place(&mut before.clone(), 0.9);
    for d in before.iter_mut().chain(&mut after) {
        *d = d.min(cap);
    }
    let n = before.len() as f64;
    let gains: Vec<f64> = before.iter().zip(&after).map(|(b, a)| b * b - a * a).collect();
    let mean = gains.iter().sum::<f64>() / n;
    let variance = gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    if knob("VERBOSE", 0.0) > 0.0 {
        eprintln!("  held out rms^2 {:.4e} gain {mean:.3e} +- {:.2e}", before.iter().map(|b| b * b).sum::<f64>() / n, (variance / n).sqrt());
    }
    mean > CONVINCING * (variance / n).sqrt()
}

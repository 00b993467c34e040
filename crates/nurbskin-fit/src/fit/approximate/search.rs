//! The smallest surface that keeps a given tolerance.
//!
//! The net grows by a factor of 1.6 per round, by the spans with the largest gain ([`Problem::best_spans`]). The rounds
//! do not depend on the tolerance, which only decides where they end; so a tighter tolerance follows the same sequence
//! to a larger and closer surface. Where few points lie beyond the tolerance, a round is first tried in small steps of
//! the spans that hold these points. Between the last round that misses the goal and the first one that reaches it the
//! number of spans is bisected.
//!
//! Ours; the monotone order of sizes over tolerances is its purpose.

use super::adapt::Criterion;
use super::goal::Reach;
use super::least_error::{Candidate, NET_GROWTH, cut_in_order};
use super::problem::{Known, Problem, State};
use super::span_residuals::SpanResiduals;
use super::strategy::{LARGE_SCAN_POINTS, Solution};
use super::visits::Way;
use crate::fit::approximate::{ApproximateOptions, Goal, Round, Shortfall, Status};
use crate::fit::least_squares::robust::Neighbourhoods;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::bias::ALL_WITHIN;
use nurbskin_geometry::unit::{grouped, percent};
use nurbskin_geometry::{Error, Result};

/// Ratio of each measure ([`is_stalled`]) after three rounds to its value before, above which the search ends.
/// Dimensionless.
/// Trial: on the plastic vase: at 0.9 over two rounds its plateau from 100 to 400 control points ends the search. Three
/// rounds make the net four times as large, with which the error of a smooth surface falls to a hundredth.
const STALL_RATIO: f64 = 0.95;
/// Ratio of the share of points beyond the tolerance, and of the p95, to the best one up to which a smaller surface is
/// returned instead where the goal is missed. Dimensionless.
/// Guard: a tenth of what is left is below what another scan of the same part would change; for one rough spot more
/// control points buy nothing.
const EQUIVALENCE_RATIO: f64 = 1.1;
/// Share of the points beyond the tolerance up to which only the spans that hold these points are cut.
/// Trial: on five real scans, together with the step and the progress below. It is ten times what the usual share
/// leaves.
const FOLLOWED_SHARE: f64 = 0.05;
/// Growth of the number of control points in one such step. Dimensionless.
/// Trial: on five real scans.
const FOLLOW_GROWTH: f64 = 0.08;
/// Factor by which each such step must lower the share of points beyond the tolerance. Dimensionless.
/// Trial: on five real scans; 0.98 was used before.
const FOLLOW_PROGRESS: f64 = 0.97;
/// Steps after which the pace of the share beyond is extrapolated to the last step. Count.
/// Guard: the pace of a single step varies.
const PACE_STEPS: i32 = 2;
/// Multiple of the allowed share beyond that the extrapolated one may have for the steps to go on. Dimensionless.
/// Guard: a margin, as the pace varies from step to step.
const PACE_MARGIN: f64 = 1.5;
/// Most control points of the surface that the noise alone determines. Count.
/// Guard: bounds the time; points that ask for more are not noisy but rough.
const ECONOMICAL_BUDGET: usize = 1600;
/// Ratio of the aim to the noise sigma up to which noise is taken to have set the aim. Dimensionless.
/// Derived: the pipeline sets such an aim to 3 sigma; the rest is a margin.
const NOISE_SET_AIM: f64 = 3.1;
/// Shares of the tolerance that are searched for in turn where a surface intersects itself and stiffer cells would miss
/// the tolerance, or where a region is biased: a closer surface leaves room for them. Dimensionless.
/// Trial: on the bunny at 0.8 % of its diagonal, which passes with 1173 control points. Such surfaces are up to about
/// twice as large.
const TIGHTENED_TOLERANCES: [f64; 3] = [0.85, 0.7, 0.5];
/// Control points of a surface without biased regions, in those of one that reaches the goal with some. Dimensionless.
/// Guard: as above; what takes more is a rough spot.
const EVEN_ROOM: usize = 2;
/// Samples above which the search is made on a part of them first. Count.
/// Guard: bounds the time; a fit to as many takes some tenths of a second.
const SEARCH_MAX_POINTS: usize = 100_000;
/// Relative difference of the numbers of control points at which the bisection ends. Dimensionless.
/// Guard: each halving takes a fit.
const BISECTION_RESOLUTION: f64 = 0.04;

/// A fit on its knots, and its distance from the goal.
struct Measured {
    breaks: [Vec<f64>; 2],
    state: State,
    reach: Reach,
}

impl Measured {
    fn size(&self) -> usize {
        self.state.fit.space.size()
    }
}

impl Problem<'_> {
    /// The smallest surface that reaches the goal; the closest one where none does.
    ///
    /// Noisy points determine a surface by themselves, whatever the goal: the knots that are significant against noise
    /// ([`Problem::economical`]). For a goal near the noise it is returned at once if it reaches the goal; for others,
    /// if the search finds no smaller one. Likewise, exact points get the result of a fit without a goal if it is
    /// smaller. This keeps the order of sizes: each goal gets the smallest surface that reaches it.
    pub(super) fn reaching(
        &self,
        breaks: &[Vec<f64>; 2],
        goal: Goal,
        options: &ApproximateOptions,
    ) -> Result<Solution> {
        let goal = self.within_reach(goal);
        let (Known::Given(sigma) | Known::Estimated(sigma)) = self.noise;
        let carried = || -> Result<Option<Solution>> {
            let problem = Problem {
                budget: self.budget.min(ECONOMICAL_BUDGET),
                goal: None,
                ..*self
            };
            let chosen = match self.samples.len() > LARGE_SCAN_POINTS {
                true => problem.large(breaks.clone(), options)?,
                false => problem.fewest(breaks)?,
            };
            let reached = self.reaches(&chosen.candidate.state, goal)?;
            Ok(reached.then_some(chosen))
        };
        let noisy = self.criterion == Criterion::Bias && self.tolerance <= NOISE_SET_AIM * sigma;
        let near = noisy && goal.tolerance < ALL_WITHIN * sigma;
        if near && let Some(chosen) = carried()? {
            return Ok(Solution {
                status: Status::Met,
                ..chosen
            });
        }
        let found = self.searched(breaks, goal)?;
        let found = self.even(found, goal)?;
        let size = found.candidate.state.fit.space.size();
        let exact = self.criterion == Criterion::Maximum && self.tolerance <= goal.tolerance;
        if (noisy && !near || exact)
            && let Some(chosen) = carried()?
            && (found.status != Status::Met || chosen.candidate.state.fit.space.size() < size)
        {
            return Ok(Solution {
                status: Status::Met,
                ..chosen
            });
        }
        Ok(found)
    }

    /// The result of the search, on a subset first where points are many.
    fn searched(&self, breaks: &[Vec<f64>; 2], goal: Goal) -> Result<Solution> {
        if self.samples.len() <= SEARCH_MAX_POINTS {
            let state = self.settle(breaks, None, 1)?;
            return self.search(self.candidate(breaks.clone(), state, goal)?, goal);
        }
        // Knots are found on a subset; all points decide.
        let part = self.part(SEARCH_MAX_POINTS);
        let neighbourhoods = Neighbourhoods::new(&part, self.size, self.topology);
        let first = self.on(&part, &neighbourhoods);
        let state = first.settle(breaks, None, 1)?;
        let found = first
            .search(first.candidate(breaks.clone(), state, goal)?, goal)?
            .candidate;
        let state = self.whole(&found.breaks, self.seen_by(&found.state), found.state.calm)?;
        self.search(self.candidate(found.breaks, state, goal)?, goal)
    }

    /// The smallest surface, starting from this candidate, that reaches the goal; the closest one where none does.
    fn search(&self, mut current: Measured, goal: Goal) -> Result<Solution> {
        let mut history = Vec::new();
        let mut reaches = Vec::new();
        let mut missed: Vec<Measured> = Vec::new();
        let why = loop {
            self.progress.advance(1);
            self.progress.tell(&format!(
                "{} control points, {} within the tolerance",
                grouped(current.size()),
                percent(1.0 - current.reach.beyond)
            ));
            let kept = current.reach.distance * goal.tolerance;
            self.step(&current.state, Some(kept), Way::Search);
            history.push(self.round(&current.state, &self.marks(&current.state)));
            if current.reach.reached {
                return self.met(current, goal, history);
            }
            let followed = self.follow(&current, goal, |reach| reach.reached)?;
            reaches.push(current.reach.clone());
            if let Some(found) = followed {
                // The usual cuts may reach it with fewer.
                let fewer = Problem {
                    budget: found.size() - 1,
                    ..*self
                };
                let trial = fewer.best_spans(&current.state, &current.breaks, 0.0);
                let next = match trial {
                    Some(trial) => self.advanced(&current, trial, goal)?,
                    None => None,
                };
                let found = match next.filter(|next| next.reach.reached) {
                    Some(next) => self.bisect(&current, next, goal)?,
                    None => found,
                };
                return self.met(found, goal, history);
            }
            if is_stalled(&reaches) {
                break Shortfall::NoGain;
            }
            let Some(trial) = self.best_spans(&current.state, &current.breaks, 0.0) else {
                let [m, n] = current.state.fit.space.counts();
                break match m * n + m.min(n) > self.budget {
                    true => self.over_budget(),
                    false => Shortfall::NoGain,
                };
            };
            let Some(next) = self.advanced(&current, trial, goal)? else {
                break Shortfall::NoGain;
            };
            if next.reach.reached {
                let found = self.bisect(&current, next, goal)?;
                return self.met(found, goal, history);
            }
            missed.push(std::mem::replace(&mut current, next));
        };
        missed.push(current);
        let Some(best) = self.smallest_as_good(missed, goal) else {
            return Err(Error::invalid("there is nothing to search in"));
        };
        let candidate = Candidate {
            breaks: best.breaks,
            samples: None,
            state: best.state,
            raised: None,
            history,
        };
        Ok(Solution {
            candidate,
            status: Status::NotMet(why),
        })
    }

    /// The smallest of these surfaces that is as good as the best: by the share of the points within the tolerance and,
    /// where that is less than 95 %, by p95, too. If none is as good by both, the best by the share.
    fn smallest_as_good(&self, missed: Vec<Measured>, goal: Goal) -> Option<Measured> {
        let levels: Vec<f64> = missed.iter().map(|c| self.level(&c.state)).collect();
        let least = |all: &mut dyn Iterator<Item = f64>| all.fold(f64::INFINITY, f64::min);
        let beyond = least(&mut missed.iter().map(|c| c.reach.beyond));
        let level = least(&mut levels.iter().copied());
        let is_good = |(c, own): &(Measured, f64)| {
            c.reach.beyond <= EQUIVALENCE_RATIO * beyond
                && *own <= (EQUIVALENCE_RATIO * level).max(goal.tolerance)
        };
        let mut all: Vec<(Measured, f64)> = missed.into_iter().zip(levels).collect();
        let at = all.iter().position(is_good).or_else(|| {
            let by_share = |(_, a): &(_, &(Measured, f64)), (_, b): &(_, &(Measured, f64))| {
                a.0.reach.beyond.total_cmp(&b.0.reach.beyond)
            };
            all.iter().enumerate().min_by(by_share).map(|best| best.0)
        })?;
        Some(all.swap_remove(at).0)
    }

    /// A larger surface that reaches the goal without self-intersections, made from one that intersects itself.
    pub(super) fn sound(&self, found: &Candidate, goal: Goal) -> Result<Option<Candidate>> {
        let goal = self.within_reach(goal);
        self.tightened(found, goal, |candidate| self.unfold(candidate))
    }

    /// The same surface, or a larger one in place of one that reaches the goal with regions to which a verdict will object.
    fn even(&self, mut found: Solution, goal: Goal) -> Result<Solution> {
        let biased = |of: &Candidate| Ok::<bool, Error>(self.reach(&of.state, goal)?.biased);
        if found.status != Status::Met || !biased(&found.candidate)? {
            return Ok(found);
        }
        let room = EVEN_ROOM * found.candidate.state.fit.space.size();
        let bounded = Problem {
            budget: self.budget.min(room),
            ..*self
        };
        let even = bounded.tightened(&found.candidate, goal, |larger| Ok(!biased(larger)?))?;
        found.candidate = even.unwrap_or(found.candidate);
        Ok(found)
    }

    /// The first acceptable surface for smaller and smaller tolerances, each made from the one before.
    fn tightened(
        &self,
        found: &Candidate,
        goal: Goal,
        mut accept: impl FnMut(&mut Candidate) -> Result<bool>,
    ) -> Result<Option<Candidate>> {
        let mut from = found.clone();
        for part in TIGHTENED_TOLERANCES {
            let tighter = Goal {
                tolerance: part * goal.tolerance,
                ..goal
            };
            let candidate = self.candidate(from.breaks, from.state, tighter)?;
            let Solution {
                mut candidate,
                status,
            } = self.search(candidate, tighter)?;
            if status != Status::Met {
                return Ok(None);
            }
            candidate.history.splice(0..0, from.history);
            from = candidate.clone();
            if accept(&mut candidate)? {
                return Ok(Some(candidate));
            }
        }
        Ok(None)
    }

    /// A surface that reaches the goal, without biased regions if a few more knots in them suffice.
    fn met(&self, mut found: Measured, goal: Goal, mut history: Vec<Round>) -> Result<Solution> {
        if found.reach.biased
            && let Some(even) = self.follow(&found, goal, |reach| reach.reached && !reach.biased)?
        {
            found = even;
        }
        history.push(self.round(&found.state, &self.marks(&found.state)));
        let Measured { breaks, state, .. } = found;
        let candidate = Candidate {
            breaks,
            samples: None,
            state,
            raised: None,
            history,
        };
        Ok(Solution {
            candidate,
            status: Status::Met,
        })
    }

    fn candidate(&self, breaks: [Vec<f64>; 2], state: State, goal: Goal) -> Result<Measured> {
        let reach = self.reach(&state, goal)?;
        self.visit(&state, Some(reach.distance * goal.tolerance));
        Ok(Measured {
            breaks,
            state,
            reach,
        })
    }

    /// The fit on these knots; `None` where the equations lose their digits.
    fn advanced(
        &self,
        from: &Measured,
        trial: [Vec<f64>; 2],
        goal: Goal,
    ) -> Result<Option<Measured>> {
        let next = self.advance(&trial, &from.state)?;
        if !self.holds(&from.state, &next) {
            return Ok(None);
        }
        self.candidate(trial, next, goal).map(Some)
    }

    /// The least number of cuts between a candidate that misses the goal and one that reaches it.
    fn bisect(&self, from: &Measured, enough: Measured, goal: Goal) -> Result<Measured> {
        let (mut low, mut found) = (from.size(), enough);
        loop {
            let high = found.size();
            let middle = low.midpoint(high);
            if (high - low) as f64 <= BISECTION_RESOLUTION * high as f64 {
                return Ok(found);
            }
            let problem = Problem {
                budget: middle,
                ..*self
            };
            let fewer = match problem.best_spans(&from.state, &from.breaks, 0.0) {
                Some(trial) => self.advanced(from, trial, goal)?,
                None => None,
            };
            match fewer {
                Some(fewer) if fewer.reach.reached && fewer.size() < high => found = fewer,
                _ => low = middle,
            }
        }
    }

    /// A surface that is good enough after cuts of the spans with the few points beyond, if the control points of one
    /// round suffice.
    fn follow(
        &self,
        from: &Measured,
        goal: Goal,
        enough: impl Fn(&Reach) -> bool,
    ) -> Result<Option<Measured>> {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a count"
        )]
        let most = ((NET_GROWTH * from.size() as f64) as usize).min(self.budget);
        let mut current: Option<Measured> = None;
        for steps in 0.. {
            let now = current.as_ref().unwrap_or(from);
            let pace = math::ln(now.reach.beyond / from.reach.beyond) / f64::from(steps.max(1));
            let left = math::ln(most as f64 / now.size() as f64) / math::ln_1p(FOLLOW_GROWTH);
            let hoped = now.reach.beyond * math::exp(pace * left);
            if steps >= PACE_STEPS && hoped > PACE_MARGIN * (1.0 - goal.within) {
                return Ok(None);
            }
            if now.reach.far.is_empty() || now.reach.beyond > FOLLOWED_SHARE {
                return Ok(None);
            }
            let Some(trial) = self.spans_of(now, most) else {
                return Ok(None);
            };
            let Some(next) = self.advanced(now, trial, goal)? else {
                return Ok(None);
            };
            if enough(&next.reach) {
                return Ok(Some(next));
            }
            if next.reach.beyond > FOLLOW_PROGRESS * now.reach.beyond {
                return Ok(None);
            }
            current = Some(next);
        }
        Ok(None)
    }

    /// The breakpoints after halving the spans with most points beyond the tolerance per control point.
    fn spans_of(&self, now: &Measured, most: usize) -> Option<[Vec<f64>; 2]> {
        let (state, breaks) = (&now.state, &now.breaks);
        let space = &state.fit.space;
        let strips = SpanResiduals::coarse(
            space,
            self.samples,
            &state.residuals,
            &state.judgement.weights,
        );
        let mut held = breaks.each_ref().map(|b| vec![0_usize; b.len() - 1]);
        for &k in &now.reach.far {
            for (d, held) in held.iter_mut().enumerate() {
                held[space.span(d, self.samples.parameters[k][d])] += 1;
            }
        }
        let counts = space.counts();
        let mut spans: Vec<(f64, usize, usize)> = Vec::new();
        for d in 0..2 {
            let cuttable = held[d]
                .iter()
                .enumerate()
                .filter(|&(a, &n)| n > 0 && strips[d].can_be_cut(a, self.criterion));
            spans.extend(cuttable.map(|(a, &n)| (n as f64 / counts[1 - d] as f64, d, a)));
        }
        spans.sort_by(|x, y| y.0.total_cmp(&x.0).then((x.1, x.2).cmp(&(y.1, y.2))));
        cut_in_order(
            breaks,
            counts,
            &spans,
            (1.0 + FOLLOW_GROWTH) * now.size() as f64,
            most,
        )
    }
}

/// Whether the last three rounds brought almost nothing: neither a smaller distance, nor fewer points beyond the
/// tolerance, nor a smaller overall error.
fn is_stalled(reaches: &[Reach]) -> bool {
    let [.., before, _, _, last] = reaches else {
        return false;
    };
    let same = |of: fn(&Reach) -> f64| of(last) > STALL_RATIO * of(before);
    same(|r| r.distance) && same(|r| r.beyond) && same(|r| r.rms)
}

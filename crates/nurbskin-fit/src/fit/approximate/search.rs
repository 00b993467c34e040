//! The smallest surface that keeps a tolerance that was asked for.
//!
//! The net grows by a fixed factor from round to round, each time by the spans that gain most ([`Problem::best_spans`]).
//! What the rounds are does not depend on the tolerance, which only says where they end: so a tighter tolerance goes
//! farther along the same way, to a larger and closer surface. Where few points are left beyond the tolerance, a round
//! is first tried in small steps of the spans that hold these points. Between the last round that misses the goal and
//! the first that reaches it the number of spans is bisected.

use super::adapt::Criterion;
use super::goal::Reach;
use super::least_error::{Candidate, GROWTH, cut_in_order};
use super::problem::{Known, Problem, State};
use super::span_residuals::SpanResiduals;
use super::strategy::{MANY, Solution};
use super::visits::Way;
use crate::fit::approximate::{ApproximateOptions, Goal, Round, Shortfall, Status};
use crate::fit::least_squares::robust::Neighbourhoods;
use nurbskin_geometry::numeric::bias::ALL_WITHIN;
use nurbskin_geometry::unit::{grouped, percent};
use nurbskin_geometry::{Error, Result};

/// The search ends where three rounds, which make the net four times as large, leave more than this part of every measure
/// ([`is_stalled`]). The error of a smooth surface falls to a hundredth then. By trial on the plastic vase: at 0.9 over two
/// rounds its plateau from 100 to 400 control points ends the search.
const STALLED: f64 = 0.95;
/// Of surfaces that miss the goal the smallest is returned that leaves at most this many times the points beyond the tolerance
/// that the best one leaves: for one rough spot more control points buy nothing. A tenth of what is left is below what
/// another scan of the same part would change.
const AS_GOOD: f64 = 1.1;
/// Share of the points beyond the tolerance up to which the spans that hold them are cut by themselves: ten times what the
/// usual share leaves. By trial on five real scans, as are the step and the gain, ...
const FEW: f64 = 0.05;
/// ... in steps of this part of the control points, ...
const STEP: f64 = 0.08;
/// ... as long as each step lowers that share by this factor, ...
const HELPS: f64 = 0.97;
/// ... and as long as, after the first steps (this many), the remaining steps at the same pace would bring the share below
/// this multiple of the allowed one. A margin: the pace varies from step to step.
const TRIED: i32 = 2;
const IN_SIGHT: f64 = 1.5;
/// Control points up to which what can be told from noise is looked for: what asks for more is not noisy but rough.
const ECONOMICAL: usize = 1600;
/// Standard deviations of the noise that the aim is at most where noise sets it.
const AIMED: f64 = 3.1;
/// Parts of the tolerance that are gone on to where a surface intersects itself and stiffer cells would miss the tolerance:
/// a closer surface has room for them. Such surfaces are up to about twice as large.
const TIGHTER: [f64; 3] = [0.85, 0.7, 0.5];
/// With more samples than this the search is made on a part of them; a fit to as many takes some tenths of a second.
const SEARCHED: usize = 100_000;
/// The bisection ends where the sizes differ by less than this part.
const CLOSE: f64 = 0.04;

/// A fit on its knots, and how far it is from the goal.
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
    /// Noisy points carry a surface of their own, whatever is asked for: the knots that can be told from noise
    /// ([`Problem::economical`]). A goal near the noise gets it at once if it reaches the goal; another one if the search
    /// finds none that is smaller. So do exact points: what a fit without a goal would make of them. So the order of sizes is
    /// kept: each goal gets the smallest of what reaches it.
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
                budget: self.budget.min(ECONOMICAL),
                goal: None,
                ..*self
            };
            let chosen = match self.samples.len() > MANY {
                true => problem.large(breaks.clone(), options)?,
                false => problem.fewest(breaks)?,
            };
            let reached = self.reaches(&chosen.candidate.state, goal)?;
            Ok(reached.then_some(chosen))
        };
        let noisy = self.criterion == Criterion::Bias && self.tolerance <= AIMED * sigma;
        let near = noisy && goal.tolerance < ALL_WITHIN * sigma;
        if near && let Some(chosen) = carried()? {
            return Ok(Solution {
                status: Status::Met,
                ..chosen
            });
        }
        let found = self.searched(breaks, goal)?;
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

    /// What the search finds, on a part of the points first where they are many.
    fn searched(&self, breaks: &[Vec<f64>; 2], goal: Goal) -> Result<Solution> {
        if self.samples.len() <= SEARCHED {
            let state = self.settle(breaks, None, 1)?;
            return self.search(self.candidate(breaks.clone(), state, goal)?, goal);
        }
        // Knots are found on a part of the points, and all of them have the last word.
        let part = self.part(SEARCHED);
        let neighbourhoods = Neighbourhoods::new(&part, self.size, self.topology);
        let first = self.on(&part, &neighbourhoods);
        let state = first.settle(breaks, None, 1)?;
        let found = first
            .search(first.candidate(breaks.clone(), state, goal)?, goal)?
            .candidate;
        let state = self.whole(&found.breaks, self.seen_by(&found.state), found.state.calm)?;
        self.search(self.candidate(found.breaks, state, goal)?, goal)
    }

    /// The smallest surface from this candidate on that reaches the goal; the closest one where none does.
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
                // The usual spans may do it with fewer.
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

    /// The first of these surfaces, from small to large, that is as good as the best: by the share of the points that keeps the
    /// tolerance and, where that is less than 95 %, by the distance of these, too.
    fn smallest_as_good(&self, missed: Vec<Measured>, goal: Goal) -> Option<Measured> {
        let levels: Vec<f64> = missed.iter().map(|c| self.level(&c.state)).collect();
        let least = |all: &mut dyn Iterator<Item = f64>| all.fold(f64::INFINITY, f64::min);
        let beyond = least(&mut missed.iter().map(|c| c.reach.beyond));
        let level = least(&mut levels.iter().copied());
        let is_good = |(c, own): &(Measured, f64)| {
            c.reach.beyond <= AS_GOOD * beyond && *own <= (AS_GOOD * level).max(goal.tolerance)
        };
        let mut all = missed.into_iter().zip(levels);
        all.find(is_good).map(|found| found.0)
    }

    /// A larger surface that reaches the goal and does not intersect itself, made from one that does.
    pub(super) fn sound(&self, found: &Candidate, goal: Goal) -> Result<Option<Candidate>> {
        let goal = self.within_reach(goal);
        let mut from = found.clone();
        for part in TIGHTER {
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
            if self.unfold(&mut candidate)? {
                return Ok(Some(candidate));
            }
        }
        Ok(None)
    }

    /// What reaches the goal; without biased regions if few more knots where they are do.
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

    /// The candidate with these knots instead; `None` where the equations lose their digits.
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

    /// The fewest of the spans that led from a candidate that misses the goal to one that reaches it.
    fn bisect(&self, from: &Measured, enough: Measured, goal: Goal) -> Result<Measured> {
        let (mut low, mut found) = (from.size(), enough);
        loop {
            let high = found.size();
            let middle = low.midpoint(high);
            if (high - low) as f64 <= CLOSE * high as f64 {
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

    /// A surface that is good enough by more knots for the few points that are off, if one round's control points do.
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
        let most = ((GROWTH * from.size() as f64) as usize).min(self.budget);
        let mut current: Option<Measured> = None;
        for steps in 0.. {
            let now = current.as_ref().unwrap_or(from);
            let pace = (now.reach.beyond / from.reach.beyond).ln() / f64::from(steps.max(1));
            let left = (most as f64 / now.size() as f64).ln() / STEP.ln_1p();
            let hoped = now.reach.beyond * (pace * left).exp();
            if steps >= TRIED && hoped > IN_SIGHT * (1.0 - goal.within) {
                return Ok(None);
            }
            if now.reach.far.is_empty() || now.reach.beyond > FEW {
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
            if next.reach.beyond > HELPS * now.reach.beyond {
                return Ok(None);
            }
            current = Some(next);
        }
        Ok(None)
    }

    /// The breakpoints with those spans cut that hold most of the points beyond the tolerance per control point.
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
            (1.0 + STEP) * now.size() as f64,
            most,
        )
    }
}

/// Whether the last three rounds brought next to nothing: neither a smaller distance, nor fewer points beyond the tolerance,
/// nor less error all in all.
fn is_stalled(reaches: &[Reach]) -> bool {
    let [.., before, _, _, last] = reaches else {
        return false;
    };
    let same = |of: fn(&Reach) -> f64| of(last) > STALLED * of(before);
    same(|r| r.distance) && same(|r| r.beyond) && same(|r| r.rms)
}

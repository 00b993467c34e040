//! Which points of a cloud tell what there is to learn of it.

use super::distinct::Distinct;
use super::elements::{Element, Elements};
use super::examined::{Examined, Known, examine};
use crate::clean::{CleanOptions, Steps};
use crate::simulate::Random;
use crate::{Organisation, Scan};
use nurbskin_geometry::numeric::parallel::gather;
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::spatial::neighbours::Neighbours;
use nurbskin_geometry::{Error, Result};

/// A sample of so many points of a cloud without order tells what there is to learn of it.
const PLENTY: usize = 250_000;
/// The fewest that a sample is made of because of noise.
const FEWEST_IN_SAMPLE: f64 = 2000.0;
/// Noise above this part of the spacing makes neighbourhoods, which reach 2.3 spacings far, as thick as they are wide: such
/// balls say nothing of planes, and too little of the noise.
const BALL: f64 = 0.5;
/// The noise, as far as it is known, is brought down to this part of the spacing.
const FLAT: f64 = 0.4;
/// Points, next to each other in spatial order, that are thinned alike; but so few of them that are so much denser, by their
/// squares, are thinned by themselves where noise is wide: the pole of a sphere may be no larger. Smaller differences come
/// by chance, and thinning after them prefers points that are off.
const RUN: usize = 4 * SMALL_RUN;
const SMALL_RUN: usize = 64;
const DENSER: f64 = 0.5;
/// So large a part of the small runs may stay as they are.
const FEW_BALLS: f64 = 0.01;
/// Times that a sample is thinned; of balls the noise is found at half its size at first.
const ROUNDS: usize = 4;
/// Lines are left so many times as dense as they lie beside each other; points see others of their own only on lines that
/// are some six times as dense.
const DENSE: f64 = 3.0;
/// Lines so many times as dense as they lie beside each other tell as much as denser ones of what is beside them.
const VERY_DENSE: f64 = 12.0;
/// Points that are asked whether lines are denser.
const PROBES: usize = 1000;
/// The fewest that a sample is made of because of lines: twelve on each of 40.
const FEWEST_ON_LINES: f64 = 500.0;
/// Part of the runs that are lines, from which on lines are thinned.
const LINED: f64 = 0.1;
/// What is kept of lines where the next one was not found.
const LONELY: f64 = 0.25;
/// What grows by more than so with the size of the neighbourhoods, at a time and in all, is no noise.
const RISE: [f64; 2] = [2.0, 4.0];

/// What was learnt, and from which points.
pub(super) struct Sampled {
    pub(super) examined: Examined,
    /// Ranks of the points among all of them in spatial order, ascending.
    pub(super) ranks: Vec<u32>,
    /// Whether most of them lay on dense lines.
    pub(super) lined: bool,
}

/// Examines the points, or a sample of them where they are very many, closer than the noise is wide, or on dense lines:
/// these say little of what is beside them, and neighbours are on the same line.
pub(super) fn sampled(
    scan: &Scan,
    distinct: &Distinct,
    options: &CleanOptions,
    progress: &Steps,
) -> Result<Sampled> {
    let all = distinct.order.len();
    let loose = matches!(scan.organisation, Organisation::Unordered);
    let mut ranks: Vec<u32> = (0..u32::MAX).take(all).collect();
    if loose && all >= 2 * PLENTY {
        // By chance, here and below: what is chosen evenly in space is evenly above and below the surface, too, and
        // polynomials then find more noise than there is.
        let share = PLENTY as f64 / all as f64;
        let mut chance = Random::new(all as u64);
        ranks.retain(|_| chance.uniform() < share);
    }
    let mut lined = loose && thin_lines(scan, distinct, &mut ranks);
    let known = if lined { Known::Lines } else { Known::Nothing };
    progress.check()?;
    let mut examined = examine(scan, distinct, &ranks, known, options, progress)?;
    // How often that is done is not known: the bar waits.
    let first = examined.noise;
    progress.pause(true);
    for _ in 0..if loose { ROUNDS } else { 0 } {
        if let Some((fewer, most)) = examined.without_lines(&ranks) {
            let known = Known::Denser(&examined, &ranks);
            let next = match examine(scan, distinct, &fewer, known, options, progress) {
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                Err(_) => break,
                Ok(next) => next,
            };
            // Along lines the noise is known best.
            let noise = examined.noise;
            (examined, ranks, lined) = (next, fewer, lined || most);
            examined.noise = noise;
            continue;
        }
        let Some(fewer) = examined.without_balls(&ranks) else {
            break;
        };
        match examine(scan, distinct, &fewer, Known::Nothing, options, progress) {
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Ok(next) if next.noise <= (RISE[0] * examined.noise).min(RISE[1] * first) => {
                (examined, ranks) = (next, fewer);
            }
            // That is shape.
            _ => break,
        }
    }
    progress.pause(false);
    Ok(Sampled {
        examined,
        ranks,
        lined,
    })
}

/// Whether the points lie on dense lines. If these are very dense, only as many are left as tell where the lines are.
fn thin_lines(scan: &Scan, distinct: &Distinct, ranks: &mut Vec<u32>) -> bool {
    let order = gather(&distinct.order, ranks);
    let tree = Neighbours::of_sorted(gather(&scan.points, &order));
    let some = Elements::some(&tree, tree.len().div_ceil(PROBES).max(1));
    let on_lines = some.iter().filter(|e| e.gap > 0.0 && e.gap.is_finite());
    let mut steps: Vec<f64> = on_lines.map(|e| (e.spacing / e.gap).powi(2)).collect();
    let lined = 2 * steps.len() > some.len();
    if lined {
        let enough = FEWEST_IN_SAMPLE / ranks.len() as f64;
        let share = enough.max(VERY_DENSE * median_in_place(&mut steps));
        let mut chance = Random::new(ranks.len() as u64);
        ranks.retain(|_| chance.uniform() < share);
    }
    lined
}

/// What the points of a run say of lines.
struct Line {
    /// Whether most of them lie on dense lines.
    lined: bool,
    /// Distance between these, in the median; infinite if most have no other beside them.
    gap: f64,
    /// That of the points; NaN if all are outliers.
    spacing: f64,
}

impl Line {
    fn of(elements: &[Element], dead: &[bool]) -> Self {
        let living = elements.iter().zip(dead).filter(|(_, dead)| !**dead);
        let mut spacings: Vec<f64> = living.clone().map(|(e, _)| e.spacing).collect();
        let gaps = living.map(|(e, _)| e.gap).filter(|&gap| gap > 0.0);
        let count = gaps.clone().count();
        let mut known: Vec<f64> = gaps.filter(|gap| gap.is_finite()).collect();
        Self {
            lined: 2 * count > spacings.len(),
            gap: match 2 * known.len() > count {
                true => median_in_place(&mut known),
                false => f64::INFINITY,
            },
            spacing: median_in_place(&mut spacings),
        }
    }
}

impl Examined {
    /// Those of the points, which have these ranks, that leave dense lines with as many as keep neighbours on several
    /// lines, and no more where lines run together, and whether most points lie on lines; none where few do.
    fn without_lines(&self, ranks: &[u32]) -> Option<(Vec<u32>, bool)> {
        let runs = self.elements.of.chunks(RUN).zip(self.dead.chunks(RUN));
        let runs: Vec<Line> = runs.map(|(of, dead)| Line::of(of, dead)).collect();
        let lined = runs.iter().filter(|run| run.lined).count();
        if lined as f64 <= LINED * runs.len() as f64 {
            return None;
        }
        let most = 2 * lined > runs.len();
        let gaps = runs.iter().filter(|run| run.lined && run.gap.is_finite());
        let usual = median_in_place(&mut gaps.map(|run| run.gap).collect::<Vec<_>>());
        let share = |run: &Line| {
            let share = match (run.lined, run.gap.is_finite()) {
                // The root of the steps along a line in steps between lines.
                (true, true) => DENSE * (run.spacing / run.gap).powi(2),
                (true, false) => LONELY,
                (false, _) if most => (DENSE * run.spacing / usual).powi(2),
                (false, _) => 1.0,
            };
            // Nothing is known of runs of outliers, or if no line has another beside it.
            if share.is_finite() {
                share.min(1.0)
            } else {
                1.0
            }
        };
        let shares: Vec<f64> = runs.iter().map(share).collect();
        thinned(ranks, RUN, &shares, FEWEST_ON_LINES).map(|fewer| (fewer, most))
    }

    /// Those of the points, which have these ranks, that leave the places where they are closer than the noise is wide
    /// with fewer, so that neighbourhoods there become flat; none where few places are such.
    fn without_balls(&self, ranks: &[u32]) -> Option<Vec<u32>> {
        // Runs in spatial order are thinned as a whole: points off the surface have fewer around them, and must not be
        // preferred for it.
        let living = self.elements.of.iter().zip(&self.dead);
        let square = |(e, dead): (&Element, &bool)| (!dead).then_some(e.spacing * e.spacing);
        let squares: Vec<Option<f64>> = living.map(square).collect();
        let mean = |squares: &[Option<f64>]| {
            let count = squares.iter().flatten().count();
            let sum: f64 = squares.iter().flatten().sum();
            // Nothing is known of runs of outliers.
            (count > 0).then(|| sum / count as f64)
        };
        let squares: Vec<f64> = squares
            .chunks(RUN)
            .flat_map(|run| {
                let whole = mean(run).unwrap_or(f64::INFINITY);
                let denser = move |square: &f64| *square < DENSER * whole;
                run.chunks(SMALL_RUN)
                    .map(move |small| mean(small).filter(denser).unwrap_or(whole))
            })
            .collect();
        let ball = (self.noise / BALL).powi(2);
        let balls = squares.iter().filter(|&&square| square < ball).count();
        if balls as f64 <= FEW_BALLS * squares.len() as f64 {
            return None;
        }
        let wanted = (self.noise / FLAT).powi(2);
        let share = |square: f64| (square / wanted).min(1.0);
        let shares: Vec<f64> = squares.iter().map(|&square| share(square)).collect();
        thinned(ranks, SMALL_RUN, &shares, FEWEST_IN_SAMPLE)
    }
}

/// By chance these parts of runs of ranks, of so many each, or of small clouds so much more that about `fewest` are left;
/// none where that leaves nearly all of the runs of which not all are wanted.
fn thinned(ranks: &[u32], run: usize, shares: &[f64], fewest: f64) -> Option<Vec<u32>> {
    let runs = || ranks.chunks(run).zip(shares);
    let left: f64 = runs().map(|(run, share)| share * run.len() as f64).sum();
    let more = (fewest / left.max(1.0)).max(1.0);
    let mut chance = Random::new(ranks.len() as u64);
    let mut fewer = Vec::new();
    let mut meant = 0;
    for (run, share) in runs() {
        let share = more * share;
        meant += if share < 1.0 { run.len() } else { 0 };
        fewer.extend(run.iter().filter(|_| chance.uniform() < share));
    }
    (10 * (ranks.len() - fewer.len()) > meant).then_some(fewer)
}

#[cfg(test)]
mod tests;

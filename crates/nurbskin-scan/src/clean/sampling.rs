//! Sampling of unordered clouds: the points that are examined.
//!
//! Three reasons to take a sample: 500 000 points or more (a random sample has the same noise as the scan); scan
//! lines much denser along than across, where all neighbours of a point lie on its own line; and noise wider than half
//! of the spacing, which makes neighbourhoods as thick as they are wide. Lines are thinned to three times the density
//! across them, and noisy regions until the noise is 0.4 of the spacing; noise and spacing are measured again after
//! each round. The choice is random: a selection that is even in space is even above and below the surface, too, and
//! increases the noise. Source: ours.

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

/// Size of the random sample of a large unordered cloud; clouds of twice as many points are sampled. Trial: not
/// recorded. It resolves 500 points along the side of a square; larger samples cost some 3 µs per point.
const SAMPLE_POINTS: usize = 250_000;
/// Fewest points that thinning because of noise aims at. Trial: not recorded.
const MIN_NOISE_SAMPLE: f64 = 2000.0;
/// Noise, in spacings, above which neighbourhoods are thinned. They reach 2.3 spacings, so that such noise makes them
/// as thick as they are wide: they determine no plane and underestimate the noise. Trial: not recorded.
const THICK_NOISE: f64 = 0.5;
/// Noise, in spacings, that thinning aims at. Trial: not recorded. Somewhat below [`THICK_NOISE`], so that one round of
/// thinning suffices; much smaller values lose detail.
const TARGET_NOISE: f64 = 0.4;
/// Consecutive points in spatial order that are thinned by the same share. Trial: not recorded. Shorter runs have
/// random densities, and thinning by them prefers points that are off the surface.
const THINNING_RUN: usize = 4 * SMALL_THINNING_RUN;
/// Consecutive points that are thinned by a share of their own where they are much denser than their run, as at the
/// pole of a sphere scanned in rings. Trial: not recorded.
const SMALL_THINNING_RUN: usize = 64;
/// Ratio of the mean squared spacing of a small run to that of its run below which it is thinned by itself. Trial: not
/// recorded. Smaller differences arise by chance.
const DENSE_RUN_RATIO: f64 = 0.5;
/// Largest share of points in small runs with too much noise for which nothing is thinned. Trial: not recorded.
const MAX_THICK_SHARE: f64 = 0.01;
/// Most rounds of thinning. Trial: not recorded. One round does not suffice: in thick neighbourhoods the noise is found
/// at half its size at first.
const MAX_THINNING_ROUNDS: usize = 4;
/// Density along scan lines, relative to the density across them, that thinning leaves. Trial: not recorded. At about
/// six, the neighbours of a point lie on its own line only.
const TARGET_LINE_DENSITY: f64 = 3.0;
/// Density along scan lines, relative to the density across them, to which very dense lines are thinned at random
/// before anything is examined. Trial: not recorded. Denser lines tell no more about the surface beside them; sparser
/// ones would lose the lines.
const MAX_LINE_DENSITY: f64 = 12.0;
/// Points on which scan lines are looked for. Guard: bounds the time; a share found on 1000 points has a standard error
/// below 1.6 %.
const LINE_PROBES: usize = 1000;
/// Fewest points that thinning of scan lines aims at: twelve on each of 40 lines. Trial: not recorded.
const MIN_LINE_SAMPLE: f64 = 500.0;
/// Share of the runs on dense lines above which lines are thinned. Trial: not recorded.
const MIN_LINED_SHARE: f64 = 0.1;
/// Share of the points that is kept of lines beside which no other line was found. Trial: not recorded.
const LONE_LINE_SHARE: f64 = 0.25;
/// Largest ratio of the noise after a round of thinning to that before it, and to the first. Trial: not recorded. Noise
/// does not depend on the size of the neighbourhoods; what rises faster with it is shape.
const MAX_NOISE_RISE: [f64; 2] = [2.0, 4.0];
/// Thinning must remove more than one point in this many (10 %) of the runs that are to be thinned. Guard: a round that
/// removes fewer would change nothing.
const MIN_THINNED_DIVISOR: usize = 10;

/// The examined sample.
pub(super) struct Sampled {
    pub(super) examined: Examined,
    /// Ranks of the sample points among all points in spatial order, ascending.
    pub(super) ranks: Vec<u32>,
    /// Whether most of the points lie on dense lines.
    pub(super) lined: bool,
}

/// Examines the points, or a sample of them if there are very many, if they are closer than the noise is wide, or if
/// they lie on dense lines: then all neighbours of a point lie on its own line.
pub(super) fn sampled(
    scan: &Scan,
    distinct: &Distinct,
    options: &CleanOptions,
    progress: &Steps,
) -> Result<Sampled> {
    let all = distinct.order.len();
    let loose = matches!(scan.organisation, Organisation::Unordered);
    let mut ranks: Vec<u32> = (0..u32::MAX).take(all).collect();
    if loose && all >= 2 * SAMPLE_POINTS {
        // Random, here and below: a selection that is even in space is even above and below the surface as well, and
        // polynomials then find more noise than there is.
        let share = SAMPLE_POINTS as f64 / all as f64;
        let mut chance = Random::new(all as u64);
        ranks.retain(|_| chance.uniform() < share);
    }
    let mut lined = loose && thin_lines(scan, distinct, &mut ranks);
    let known = if lined { Known::Lines } else { Known::Nothing };
    progress.check()?;
    let mut examined = examine(scan, distinct, &ranks, known, options, progress)?;
    // The number of rounds is not known in advance: the bar waits.
    let first = examined.noise;
    progress.pause(true);
    for _ in 0..if loose { MAX_THINNING_ROUNDS } else { 0 } {
        if let Some((fewer, most)) = examined.without_lines(&ranks) {
            let known = Known::Denser(&examined, &ranks);
            let next = match examine(scan, distinct, &fewer, known, options, progress) {
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                Err(_) => break,
                Ok(next) => next,
            };
            // The noise is most accurate along the denser lines.
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
            Ok(next)
                if next.noise
                    <= (MAX_NOISE_RISE[0] * examined.noise).min(MAX_NOISE_RISE[1] * first) =>
            {
                (examined, ranks) = (next, fewer);
            }
            // The increase is shape, not noise.
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

/// Whether most points lie on dense lines. Thins very dense lines at random to the density that still shows where the
/// lines are.
fn thin_lines(scan: &Scan, distinct: &Distinct, ranks: &mut Vec<u32>) -> bool {
    let order = gather(&distinct.order, ranks);
    let tree = Neighbours::of_sorted(gather(&scan.points, &order));
    let some = Elements::some(&tree, tree.len().div_ceil(LINE_PROBES).max(1));
    let on_lines = some.iter().filter(|e| e.gap > 0.0 && e.gap.is_finite());
    let mut steps: Vec<f64> = on_lines.map(|e| (e.spacing / e.gap).powi(2)).collect();
    let lined = 2 * steps.len() > some.len();
    if lined {
        let enough = MIN_NOISE_SAMPLE / ranks.len() as f64;
        let share = enough.max(MAX_LINE_DENSITY * median_in_place(&mut steps));
        let mut chance = Random::new(ranks.len() as u64);
        ranks.retain(|_| chance.uniform() < share);
    }
    lined
}

/// The scan lines in a run of points.
struct Line {
    /// Whether most points of the run lie on dense lines.
    lined: bool,
    /// Median distance between the lines; infinite if most have no other beside them.
    gap: f64,
    /// Median spacing of the points; NaN if all are outliers.
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
    /// A thinned sample for dense lines: each line keeps the density at which points have neighbours on several lines,
    /// and no more where lines run together. Also returns whether most points lie on lines; `None` if few do.
    fn without_lines(&self, ranks: &[u32]) -> Option<(Vec<u32>, bool)> {
        let runs = self
            .elements
            .of
            .chunks(THINNING_RUN)
            .zip(self.dead.chunks(THINNING_RUN));
        let runs: Vec<Line> = runs.map(|(of, dead)| Line::of(of, dead)).collect();
        let lined = runs.iter().filter(|run| run.lined).count();
        if lined as f64 <= MIN_LINED_SHARE * runs.len() as f64 {
            return None;
        }
        let most = 2 * lined > runs.len();
        let gaps = runs.iter().filter(|run| run.lined && run.gap.is_finite());
        let usual = median_in_place(&mut gaps.map(|run| run.gap).collect::<Vec<_>>());
        let share = |run: &Line| {
            let share = match (run.lined, run.gap.is_finite()) {
                // (spacing / gap)² is the ratio of the steps along and across the lines: the spacing is their geometric
                // mean.
                (true, true) => TARGET_LINE_DENSITY * (run.spacing / run.gap).powi(2),
                (true, false) => LONE_LINE_SHARE,
                (false, _) if most => (TARGET_LINE_DENSITY * run.spacing / usual).powi(2),
                (false, _) => 1.0,
            };
            // Undefined for runs of outliers, and if no line has another beside it.
            if share.is_finite() {
                share.min(1.0)
            } else {
                1.0
            }
        };
        let shares: Vec<f64> = runs.iter().map(share).collect();
        thinned(ranks, THINNING_RUN, &shares, MIN_LINE_SAMPLE).map(|fewer| (fewer, most))
    }

    /// A thinned sample for wide noise: regions whose spacing is small against the noise keep so few points that
    /// neighbourhoods become flat. `None` if such regions are few.
    fn without_balls(&self, ranks: &[u32]) -> Option<Vec<u32>> {
        // Runs in spatial order are thinned as a whole: points off the surface have fewer points around them and must
        // not be preferred for it.
        let living = self.elements.of.iter().zip(&self.dead);
        let square = |(e, dead): (&Element, &bool)| (!dead).then_some(e.spacing * e.spacing);
        let squares: Vec<Option<f64>> = living.map(square).collect();
        let mean = |squares: &[Option<f64>]| {
            let count = squares.iter().flatten().count();
            let sum: f64 = squares.iter().flatten().sum();
            // Undefined for runs of outliers.
            (count > 0).then(|| sum / count as f64)
        };
        let squares: Vec<f64> = squares
            .chunks(THINNING_RUN)
            .flat_map(|run| {
                let whole = mean(run).unwrap_or(f64::INFINITY);
                let denser = move |square: &f64| *square < DENSE_RUN_RATIO * whole;
                run.chunks(SMALL_THINNING_RUN)
                    .map(move |small| mean(small).filter(denser).unwrap_or(whole))
            })
            .collect();
        let ball = (self.noise / THICK_NOISE).powi(2);
        let balls = squares.iter().filter(|&&square| square < ball).count();
        if balls as f64 <= MAX_THICK_SHARE * squares.len() as f64 {
            return None;
        }
        let wanted = (self.noise / TARGET_NOISE).powi(2);
        let share = |square: f64| (square / wanted).min(1.0);
        let shares: Vec<f64> = squares.iter().map(|&square| share(square)).collect();
        thinned(ranks, SMALL_THINNING_RUN, &shares, MIN_NOISE_SAMPLE)
    }
}

/// A random sample of runs of `run` ranks each, with the share of each run given, increased so that about `fewest`
/// points remain of a small cloud. `None` if it would remove hardly any of the points that were to be thinned.
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
    (MIN_THINNED_DIVISOR * (ranks.len() - fewer.len()) > meant).then_some(fewer)
}

#[cfg(test)]
mod tests;

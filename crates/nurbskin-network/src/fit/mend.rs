//! Folds and self-intersections of a finished network.
//!
//! ```text
//! inspect ─▶ parts that cross, faces that fold or jump ─▶ points there let go, faces smoother ─▶ a few steps ─▶ inspect …
//!    └─ none are left ─▶ points taken back, but for faces that cross again ─▶ a few steps ─▶ inspect …
//!                         └─ others miss the tolerance ─▶ knots for these ─▶ a few steps ─▶ inspect …
//! ```
//!
//! A scan may touch or pass through itself: eyelids, lips, fins at the rim of a merged scan that are thinner than the tolerance.
//! No sound surface follows such points. Without them the thin plate spans the place. Many points around them are let go, too; these
//! are taken back once nothing crosses. Points of borders are let go and taken back in the same way: the rim of a scan may turn more
//! sharply than a side of a face can, and a side that doubles back folds its face.
//!
//! Source: ours.

use super::lines::LineSamples;
use super::network::Network;
use super::state::Fit;
use super::strategy::{closer, resumed};
use super::terms::Samples;
use super::{FacePart, FitOptions, Inspect, Target, finished};
use nurbskin_geometry::{Error, Result};

/// Most times that points are let go. Count.
/// Guard: each time reaches a span farther. A branching pipe has 754 defects, then 326, 124, 62, 38 and 1; a head still gets better after
/// eight.
const MOST_MENDS: usize = 12;
/// Steps after that. Count.
/// Trial: not varied; as at the end of a fit over all points.
const STEPS: usize = 3;
/// Steps each time that points are taken back. Count.
/// Trial: 1 and 3 on a face, a head and bunny. The face and the head end the same way; bunny takes 1 to 9 % less time with 1, its largest
/// jump stays.
const RETURN_STEPS: usize = 1;
/// Defects that are left, as a share of those after the last mend that helped, up to which a mend helps; where there were none, fewer bad
/// faces do. A round of refinement helps up to this share of the points that were missing.
/// Trial: the defects of sound scans fall to a third or to none. On the wall of a vase, whose flange folds over, they stay within
/// 2 %, and on its rim they end at half of those at first, whatever the steps.
const HELPS: f64 = 0.75;
/// Mends in a row that may not help, before the best network gets one more. Count.
/// Guard: the first on bad faces often only moves them.
const MOST_VAIN: usize = 2;
/// Factor of the weight of a point, each time it is let go. Dimensionless.
/// Trial: not varied; at first thirty points weigh as much as one did.
const LET_GO: f64 = 0.03;
/// The same on a face that folds or jumps.
/// Trial: on fandisk, a bracket, a mug and a drill at eight tolerances; with 0.03 more networks miss the tolerance. Without this
/// new layouts are sought: bunny takes 175 faces for 153, and 49 s for 35.
const LOOSEN: f64 = 0.3;
/// Factor of the fairness of its face. Dimensionless.
/// Trial: on bunny, whose 60 to 470 crossings go the first time; not varied.
const STIFFER: f64 = 4.0;
/// Most times that points are taken back. Count.
/// Guard: bounds the time. Five undo two times of letting go; points that were let go more often stay light.
const MOST_RETURNS: usize = 6;
/// Factor of the weight of a point, each time it is taken back. Dimensionless.
/// Trial: on a head, a skull and an impeller at 0.1 % of their diagonals. With 33, the inverse of [`LET_GO`], the first two cross again at
/// once; with 5 the points beyond the tolerance fall to a half or less on all three.
const RETURN: f64 = 5.0;
/// Most rounds of refinement of a sound network that misses the tolerance. Count.
/// Guard: bounds the time.
const MOST_APPROACHES: usize = 4;

/// What a mended network has left.
#[derive(Debug, Default)]
pub(super) struct Mended {
    /// Defects.
    pub(super) defects: Vec<FacePart>,
    /// For each face whether it has points beyond the tolerance that were let go. May be empty where none were.
    pub(super) lost: Vec<bool>,
}

/// What is wrong with a network.
#[derive(Clone)]
struct Found {
    /// What `inspect` finds, and faces that turn over at an edge.
    defects: Vec<FacePart>,
    /// Faces that fold, jump, or have no normal at a corner.
    bad: Vec<FacePart>,
    /// Whether points miss the tolerance.
    misses: bool,
}

impl Found {
    fn new(fit: &Fit, inspect: &mut Inspect, options: &FitOptions) -> Result<Self> {
        let fitted = finished(fit, Mended::default())?;
        let whole = |face| FacePart {
            face,
            low: [0.0; 2],
            high: [1.0; 2],
        };
        let bad = (0..).zip(&fitted.bad).filter(|face| *face.1);
        let turned = fit.turned_faces().into_iter().map(whole);
        Ok(Self {
            defects: inspect(&fitted)?.into_iter().chain(turned).collect(),
            bad: bad.map(|(face, _)| whole(face)).collect(),
            misses: fit.beyond(options.tolerance) > 1.0 - options.share_within,
        })
    }

    /// Whether there are no defects and at most `bad` bad faces.
    fn is_as_sound(&self, bad: usize) -> bool {
        self.defects.is_empty() && self.bad.len() <= bad
    }

    fn is_sound(&self) -> bool {
        self.defects.is_empty() && self.bad.is_empty()
    }

    /// The numbers of defects and of bad faces.
    fn counts(&self) -> (usize, usize) {
        (self.defects.len(), self.bad.len())
    }

    /// Whether clearly less is wrong than in a network with these numbers of defects and of bad faces.
    fn helps(&self, least: (usize, usize)) -> bool {
        match least.0 {
            0 => self.defects.is_empty() && self.bad.len() < least.1,
            n => self.defects.len() as f64 <= HELPS * n as f64,
        }
    }

    /// What counts, the less the better.
    fn rank(&self) -> (usize, bool, usize) {
        (self.defects.len(), self.misses, self.bad.len())
    }
}

/// What mends and the steps after them change, except the fairness of the faces. A face that became stiffer stays so: the next
/// steps shall end differently.
#[derive(Clone)]
struct Saved {
    network: Network,
    samples: Samples,
    lines: LineSamples,
    weights: Vec<f64>,
}

impl Saved {
    fn of(fit: &Fit) -> Self {
        Self {
            network: fit.network.clone(),
            samples: fit.samples.clone(),
            lines: fit.lines.clone(),
            weights: fit.weights.clone(),
        }
    }

    fn restore(self, fit: &mut Fit) {
        if fit.network.unknowns() != self.network.unknowns() {
            fit.knots_changed();
        }
        (fit.network, fit.samples, fit.lines) = (self.network, self.samples, self.lines);
        fit.weights = self.weights;
    }
}

/// Mends a network, as far as it goes, and adds knots if it is sound and misses the tolerance.
pub(super) fn mended(
    fit: &mut Fit,
    target: &Target,
    inspect: &mut Inspect,
    options: &FitOptions,
) -> Result<Mended> {
    let mut found = Found::new(fit, inspect, options)?;
    let is_sound = found.is_sound();
    if is_sound && !found.misses {
        return Ok(Mended::default());
    }
    let at_first = fit.weights.clone();
    let mut best = None;
    let (mut least, mut vain) = (found.counts(), 0);
    let mut is_second_try = false;
    for reach in 0..MOST_MENDS {
        if found.is_sound() {
            break;
        }
        let before = Saved::of(fit);
        fit.let_go(&found.bad, reach, [LOOSEN, STIFFER]);
        fit.let_go(&found.defects, reach, [LET_GO, STIFFER]);
        match resumed(fit, target, options, STEPS) {
            // What was there before is still a network.
            Err(Error::NoSolution(_)) => {
                before.restore(fit);
                break;
            }
            other => other?,
        }
        let next = Found::new(fit, inspect, options)?;
        let last = std::mem::replace(&mut found, next);
        if found.helps(least) {
            (least, vain, is_second_try) = (found.counts(), 0, false);
        } else {
            vain += 1;
        }
        if best
            .as_ref()
            .is_none_or(|b: &(_, Found)| last.rank() < b.1.rank())
        {
            best = Some((before, last));
        }
        if vain >= MOST_VAIN {
            // Once more from the best one, whose faces are stiffer by now, and farther around.
            let better = best.as_ref().filter(|b| b.1.rank() < found.rank());
            let Some((saved, least)) = better.filter(|_| !is_second_try) else {
                break;
            };
            saved.clone().restore(fit);
            found = least.clone();
            is_second_try = true;
        }
    }
    if let Some((saved, least)) = best.filter(|b| b.1.rank() < found.rank()) {
        saved.restore(fit);
        found = least;
    }
    if found.defects.is_empty() {
        if !is_sound {
            take_back(fit, target, inspect, options, (&at_first, &found.bad))?;
        }
        approach(fit, target, inspect, options, (&at_first, found.bad.len()))?;
    }
    let mut lost = vec![false; fit.network.faces.len()];
    let points = fit.distances().iter().zip(&fit.samples.feet);
    for ((distance, foot), (own, first)) in points.zip(fit.weights.iter().zip(&at_first)) {
        lost[foot.face as usize] |= own < first && *distance > options.tolerance;
    }
    Ok(Mended {
        defects: found.defects,
        lost,
    })
}

/// Adds knots for points that miss the tolerance, but for those that were let go. A round that gains little, or causes a defect or more
/// than `bad` bad faces, is undone.
fn approach(
    fit: &mut Fit,
    target: &Target,
    inspect: &mut Inspect,
    options: &FitOptions,
    (at_first, bad): (&[f64], usize),
) -> Result<()> {
    let missing = |fit: &Fit| fit.beyond(options.tolerance) - (1.0 - options.share_within);
    for _ in 0..MOST_APPROACHES {
        let last = missing(fit);
        if last <= 0.0 {
            break;
        }
        let before = Saved::of(fit);
        let gained = match closer(fit, target, options, at_first) {
            Ok(done) => done && missing(fit) <= HELPS * last,
            Err(Error::NoSolution(_)) => false,
            Err(why) => return Err(why),
        };
        if !gained || !Found::new(fit, inspect, options)?.is_as_sound(bad) {
            before.restore(fit);
            break;
        }
    }
    Ok(())
}

/// Takes back points that were let go, until none is beyond the tolerance: their weights grow step by step to those at first. A step
/// that causes a defect, or more bad faces than `bad`, is undone, and the points on these faces stay light.
fn take_back(
    fit: &mut Fit,
    target: &Target,
    inspect: &mut Inspect,
    options: &FitOptions,
    (at_first, bad): (&[f64], &[FacePart]),
) -> Result<()> {
    let mut lost = vec![false; fit.network.faces.len()];
    for _ in 0..MOST_RETURNS {
        let beyond = fit.beyond(options.tolerance);
        if beyond == 0.0 {
            break;
        }
        let before = Saved::of(fit);
        let mut returned = false;
        let weights = fit.weights.iter_mut().zip(&mut fit.samples.weights);
        for ((foot, first), (own, pulling)) in fit.samples.feet.iter().zip(at_first).zip(weights) {
            if *own < *first && !lost[foot.face as usize] {
                *own = (*own * RETURN).min(*first);
                *pulling = pulling.max(*own);
                returned = true;
            }
        }
        for (foot, own) in fit.lines.on_borders(&fit.network) {
            if *own < 1.0 && !lost[foot.face as usize] {
                *own = (*own * RETURN).min(1.0);
                returned = true;
            }
        }
        if !returned {
            break;
        }
        match resumed(fit, target, options, RETURN_STEPS) {
            Ok(()) if fit.beyond(options.tolerance) <= beyond => {}
            Ok(()) | Err(Error::NoSolution(_)) => {
                before.restore(fit);
                break;
            }
            other => other?,
        }
        let found = Found::new(fit, inspect, options)?;
        if found.is_as_sound(bad.len()) {
            continue;
        }
        before.restore(fit);
        let mut more = false;
        let worse = found.bad.iter().filter(|part| !bad.contains(part));
        for part in found.defects.iter().chain(worse) {
            if let Some(lost) = lost.get_mut(part.face as usize) {
                more |= !std::mem::replace(lost, true);
            }
        }
        if !more {
            break;
        }
    }
    Ok(())
}

//! Search for few grid lines whose interpolating surface is close enough to all points.
//!
//! Three moves: add a line where it lowers the error most per control point; shift lines to a neighbouring place while
//! that lowers the error; trade lines, fewer in one direction for at most three more in the other.
//!
//! ```text
//! objective = Σ (distance / T)^8,   error of a direction ~ (number of lines)⁻⁴
//! ```
//!
//! All decisions use the first-order distances of [`Screen`]; everything is deterministic. Ours.

use super::screen::{Score, Screen};
use nurbskin_geometry::Result;
use nurbskin_geometry::math;

/// A selection of lines with its score.
#[derive(Clone)]
pub(super) struct Selection {
    pub(super) lines: [Vec<usize>; 2],
    pub(super) score: Score,
    /// For each direction, the points splined along the other one, in the layout of this one; empty where outdated.
    tables: [Vec<f64>; 2],
}

impl Selection {
    pub(super) fn new(screen: &mut Screen, lines: [Vec<usize>; 2]) -> Result<Self> {
        let mut this = Self {
            lines,
            score: Score::default(),
            tables: [Vec::new(), Vec::new()],
        };
        this.score = this.trial(screen, 0, &this.lines[0].clone())?;
        Ok(this)
    }

    /// Judges the same lines again, after the screen changed.
    pub(super) fn judge_again(&mut self, screen: &mut Screen) -> Result<()> {
        self.tables = [Vec::new(), Vec::new()];
        self.score = self.trial(screen, 0, &self.lines[0].clone())?;
        Ok(())
    }

    /// Number of points kept.
    pub(super) fn point_count(&self) -> usize {
        self.lines[0].len() * self.lines[1].len()
    }

    /// The score with other lines in `direction`.
    fn trial(&mut self, screen: &mut Screen, direction: usize, lines: &[usize]) -> Result<Score> {
        if self.tables[direction].is_empty() {
            self.tables[direction] = screen.splined(1 - direction, &self.lines[1 - direction])?;
        }
        screen.judge(direction, lines, Some(&self.tables[direction]))
    }

    fn accept(&mut self, direction: usize, lines: Vec<usize>, score: Score) {
        self.lines[direction] = lines;
        self.score = score;
        self.tables[1 - direction].clear();
    }
}

/// Number of lines that are added at a time.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Pace {
    /// One.
    Single,
    /// One, or one in every bad gap, whichever helps more per line.
    Grouped,
    /// One in every gap that is not good: for tolerances that take nearly all lines.
    Hurried,
}

/// Point evaluations after which growing is hurried. Count.
/// Guard: about a second.
const PATIENT_WORK: u64 = 200_000_000;
/// Share of the error of the worst gap above which a gap is bad and gets a line in the same step. Dimensionless.
/// Trial: in prototypes on simulated grids: together with single lines the pot takes 360 points instead of 656.
const BAD_GAP_SHARE: f64 = 0.6;
/// Share of the aim above which a gap gets a line where growing is hurried. Dimensionless.
/// Trial: not recorded.
const HURRIED_GAP_SHARE: f64 = 0.25;
/// Times that all lines are moved after one was added. Count. Guard: ends earlier where the objective does not fall.
const BALANCING_PASSES: usize = 2;
/// Most passes of shifting lines. Count. Guard: bounds the time.
const MAX_SHIFT_PASSES: usize = 30;
/// Ratio of the objectives of two passes with the finest shifts above which shifting ends. Trial: not recorded.
const FINE_STALL: f64 = 0.98;
/// The same ratio above which the next pass has finer shifts. Dimensionless. Trial: not recorded.
const COARSE_STALL: f64 = 0.7;
/// Further passes at the same pace that must reach the aim, with coarse and with the finest shifts. Count, times the
/// patience.
/// Trial: not recorded.
const HOPE_PASSES: [i32; 2] = [8, 4];
/// Largest ratio of the objectives of two passes that is extrapolated. Guard: above, the next pass is not predictable.
const MAX_PACE: f64 = 0.9;
/// Patience at which trading lines ends. Dimensionless. Guard: it doubles each time, and so does the time.
const MAX_PATIENCE: i32 = 16;
/// Times that the lines of a direction are placed anew. Count. Guard: ends earlier where the objective does not fall.
const REPLACING_PASSES: usize = 3;
/// Most lines that a trade adds to or takes from a direction. Count. Guard: the number of trades grows with its square.
const MAX_TRADE: isize = 3;
/// Ratio of the first number of lines of a selection grown from below to the predicted one. Dimensionless.
/// Guard: starts below, since lines are only added.
const START_BELOW: f64 = 0.9;
/// Least error of a gap, relative to the worst one, by which lines are shared out. Derived: the fourth power of 0.1.
const MIN_GAP_ERROR: f64 = 1e-4;

/// State and limits of a search.
pub(super) struct Search {
    pub(super) screen: Screen,
    /// Fewest lines per direction.
    pub(super) least: [usize; 2],
    /// Most points to keep.
    pub(super) most_points: usize,
    /// `screen.work` at which improvement ends.
    pub(super) work_limit: u64,
    /// The largest first-order distance allowed, in tolerances.
    pub(super) aim: f64,
    pub(super) rounds: usize,
    /// Factor of the number of passes for shifts with little gain.
    pub(super) patience: i32,
    /// Selections that met the aim before fewer points did, the fewest last.
    pub(super) history: Vec<[Vec<usize>; 2]>,
}

impl Search {
    fn exhausted(&self) -> bool {
        self.screen.work >= self.work_limit
    }

    /// Adds lines until the selection is near enough, nothing can be added, or the budget of points is used up.
    ///
    /// The errors of the two directions add up, and each falls with the fourth power of its number of lines; the
    /// product of the numbers is least where the two errors are equal. So the direction with the larger error gets the
    /// next line.
    pub(super) fn grow(&mut self, mut selection: Selection, pace: Pace) -> Result<Selection> {
        let patient_until = self.screen.work + PATIENT_WORK;
        let mut alone = [0, 1].map(|d| self.screen.judge(d, &selection.lines[d], None));
        while selection.score.worst > self.aim {
            self.rounds += 1;
            let [u, v] = &alone;
            let (Ok(u), Ok(v)) = (u, v) else {
                break;
            };
            let first = usize::from(v.worst > u.worst);
            let mut best: Option<(f64, usize, Vec<usize>, Score)> = None;
            for direction in [first, 1 - first] {
                let now = [u, v][direction];
                let hurried = self.screen.work > patient_until;
                let pace = if hurried { Pace::Hurried } else { pace };
                for lines in self.additions(&selection.lines[direction], now, direction, pace) {
                    if lines.len() * selection.lines[1 - direction].len() > self.most_points {
                        continue;
                    }
                    let score = self.screen.judge(direction, &lines, None)?;
                    let gain = (ln(now.objective) - ln(score.objective))
                        / (lines.len() - selection.lines[direction].len()) as f64;
                    if best.as_ref().is_none_or(|best| gain > best.0) {
                        best = Some((gain, direction, lines, score));
                    }
                }
                if best.is_some() {
                    break;
                }
            }
            let Some((_, direction, mut lines, mut score)) = best else {
                break;
            };
            // The new line gives the others room to move.
            for _ in 0..BALANCING_PASSES {
                let errors = &score.by_line[direction];
                let (count, closed) =
                    (self.screen.counts[direction], self.screen.closed[direction]);
                let moved = equal_errors(&lines, errors, count, closed, lines.len());
                let after = self.screen.judge(direction, &moved, None)?;
                if after.objective >= score.objective {
                    break;
                }
                (lines, score) = (moved, after);
            }
            alone[direction] = Ok(score);
            let score = selection.trial(&mut self.screen, direction, &lines)?;
            selection.accept(direction, lines, score);
        }
        Ok(selection)
    }

    /// Candidates for added lines in a direction: at the error-weighted middle of the worst gap; half-way in every bad
    /// gap.
    fn additions(
        &self,
        lines: &[usize],
        score: &Score,
        direction: usize,
        pace: Pace,
    ) -> Vec<Vec<usize>> {
        let errors = &score.by_line[direction];
        let gaps = gaps(
            lines,
            self.screen.counts[direction],
            self.screen.closed[direction],
        );
        let of_gap =
            |&(a, b): &(usize, usize)| errors[a + 1..b].iter().copied().fold(0.0, f64::max);
        let worst = gaps.iter().map(of_gap).fold(0.0, f64::max);
        let mut ways = Vec::new();
        // The worst gap; where several are bad and only one line is wanted, each of the worst few.
        if let Some(&(a, b)) = gaps
            .iter()
            .filter(|gap| gap.1 - gap.0 > 1)
            .reduce(|x, y| if of_gap(y) > of_gap(x) { y } else { x })
        {
            let weight: f64 = errors[a + 1..b].iter().sum();
            let moment: f64 = (a + 1..b).map(|k| k as f64 * errors[k]).sum();
            let middle = a + (b - a) / 2;
            let centre = (a + 1..b)
                .find(|&k| weight > 0.0 && k as f64 + 0.5 > moment / weight)
                .unwrap_or(middle);
            ways.push(with(lines, [centre]));
            if centre != middle {
                ways.push(with(lines, [middle]));
            }
        }
        let bad_above = match pace {
            Pace::Hurried => (BAD_GAP_SHARE * worst).min(HURRIED_GAP_SHARE * self.aim),
            _ => BAD_GAP_SHARE * worst,
        };
        let bad: Vec<usize> = gaps
            .iter()
            .filter(|gap| gap.1 - gap.0 > 1 && of_gap(gap) > bad_above)
            .map(|&(a, b)| a + (b - a) / 2)
            .collect();
        if pace != Pace::Single && bad.len() > 1 {
            if pace == Pace::Hurried {
                ways.clear();
            }
            ways.push(with(lines, bad));
        }
        ways
    }

    /// Shifts single lines to better places until the aim is met (`to_aim`) or no shift helps: first by half a gap,
    /// then by less and less.
    pub(super) fn shift(&mut self, selection: &mut Selection, to_aim: bool) -> Result<()> {
        let mut level = 1;
        for _ in 0..MAX_SHIFT_PASSES {
            let before = selection.score.objective;
            let strides = [0, 1].map(|d| {
                let gap = self.screen.counts[d] / selection.lines[d].len();
                (gap >> level).max(1)
            });
            for (direction, &stride) in strides.iter().enumerate() {
                let count = selection.lines[direction].len();
                let end = if self.screen.closed[direction] {
                    count
                } else {
                    count - 1
                };
                for position in 1..end {
                    if (to_aim && selection.score.worst <= self.aim) || self.exhausted() {
                        return Ok(());
                    }
                    self.shift_line(selection, direction, position, stride)?;
                }
            }
            let ratio = selection.score.objective / before;
            let fine = strides == [1, 1];
            let passes = self.patience * HOPE_PASSES[usize::from(fine)];
            if (fine && ratio > FINE_STALL)
                || (to_aim && hopeless(ratio, passes, &selection.score, self.aim))
            {
                return Ok(());
            }
            level += usize::from(ratio > COARSE_STALL);
        }
        Ok(())
    }

    fn shift_line(
        &mut self,
        selection: &mut Selection,
        direction: usize,
        position: usize,
        stride: usize,
    ) -> Result<()> {
        let total = self.screen.counts[direction];
        for forward in [true, false] {
            let mut moved = false;
            loop {
                let lines = &selection.lines[direction];
                let next = lines.get(position + 1).copied().unwrap_or(total);
                let (from, before) = (lines[position], lines[position - 1]);
                let to = if forward {
                    from + stride
                } else {
                    from.saturating_sub(stride)
                };
                if to >= next || to <= before {
                    break;
                }
                let mut lines = lines.clone();
                lines[position] = to;
                let score = selection.trial(&mut self.screen, direction, &lines)?;
                if score.objective >= selection.score.objective {
                    break;
                }
                selection.accept(direction, lines, score);
                moved = true;
            }
            if moved {
                break;
            }
        }
        Ok(())
    }

    /// Removes the line of `direction` whose loss raises the objective least.
    fn remove(&mut self, selection: &mut Selection, direction: usize) -> Result<bool> {
        let lines = selection.lines[direction].clone();
        if lines.len() <= self.least[direction] {
            return Ok(false);
        }
        let end = if self.screen.closed[direction] {
            lines.len()
        } else {
            lines.len() - 1
        };
        let mut best: Option<(Vec<usize>, Score)> = None;
        for position in 1..end {
            let mut fewer = lines.clone();
            fewer.remove(position);
            let score = selection.trial(&mut self.screen, direction, &fewer)?;
            if best
                .as_ref()
                .is_none_or(|best| score.objective < best.1.objective)
            {
                best = Some((fewer, score));
            }
        }
        let Some((fewer, score)) = best else {
            return Ok(false);
        };
        selection.accept(direction, fewer, score);
        Ok(true)
    }

    /// Adds the line of `direction` that helps most among the middles of its worst gaps.
    fn add(&mut self, selection: &mut Selection, direction: usize) -> Result<bool> {
        let lines = selection.lines[direction].clone();
        let mut best: Option<(Vec<usize>, Score)> = None;
        for (a, b) in gaps(
            &lines,
            self.screen.counts[direction],
            self.screen.closed[direction],
        ) {
            if b - a > 1 {
                let more = with(&lines, [a + (b - a) / 2]);
                let score = selection.trial(&mut self.screen, direction, &more)?;
                if best
                    .as_ref()
                    .is_none_or(|best| score.objective < best.1.objective)
                {
                    best = Some((more, score));
                }
            }
        }
        let Some((more, score)) = best else {
            return Ok(false);
        };
        selection.accept(direction, more, score);
        Ok(true)
    }

    /// Fewer points within the aim: lines removed and traded between the directions, the rest shifted, while it works.
    pub(super) fn thin(&mut self, mut selection: Selection) -> Result<Selection> {
        if selection.score.worst > self.aim {
            return Ok(selection);
        }
        if let Some(fewer) = self.grown_from_below(&selection)? {
            self.history.push(selection.lines);
            selection = fewer;
        }
        'improve: loop {
            self.rounds += 1;
            for (change, balanced) in self.trades(&selection) {
                if self.exhausted() {
                    break 'improve;
                }
                let mut other = selection.clone();
                if self.trade(&mut other, change, balanced)? {
                    self.history.push(selection.lines);
                    selection = other;
                    continue 'improve;
                }
            }
            // Failed trades may succeed with more passes, if effort is left.
            if self.patience >= MAX_PATIENCE {
                break;
            }
            self.patience *= 2;
        }
        self.patience = 1;
        Ok(selection)
    }

    /// A selection with fewer points than this one that meets the aim: the numbers of lines at which both directions
    /// would err by half the aim, if errors fall with the fourth power of the number, and more of them until it works.
    fn grown_from_below(&mut self, selection: &Selection) -> Result<Option<Selection>> {
        let mut other = selection.clone();
        let mut alone = Vec::new();
        for direction in 0..2 {
            let lines = &selection.lines[direction];
            let score = self.screen.judge(direction, lines, None)?;
            let wanted = lines.len() as f64 * math::powf(score.worst / (0.5 * self.aim), 0.25);
            let fewer = (0..lines.len())
                .take_while(|&n| (n as f64) < START_BELOW * wanted)
                .count();
            let change = fewer.max(self.least[direction]).cast_signed() - lines.len().cast_signed();
            alone.push(score.worst);
            if !self.balance(&mut other, direction, change)? {
                return Ok(None);
            }
        }
        while other.point_count() < selection.point_count() && !self.exhausted() {
            self.shift(&mut other, true)?;
            if other.score.worst <= self.aim {
                return Ok(Some(other));
            }
            for (direction, alone) in alone.iter_mut().enumerate() {
                *alone = self
                    .screen
                    .judge(direction, &other.lines[direction], None)?
                    .worst;
            }
            let direction = usize::from(alone[1] > alone[0]);
            if !self.balance(&mut other, direction, 1)? {
                break;
            }
        }
        Ok(None)
    }

    /// Changes of the numbers of lines that make fewer points, the likeliest first, and whether to balance them.
    fn trades(&self, selection: &Selection) -> Vec<([isize; 2], bool)> {
        let counts = [0, 1].map(|d| selection.lines[d].len().cast_signed());
        let points = |[a, b]: [isize; 2]| (counts[0] + a) * (counts[1] + b);
        let mut changes: Vec<([isize; 2], bool)> = (-MAX_TRADE..=MAX_TRADE)
            .flat_map(|a| (-MAX_TRADE..=MAX_TRADE).map(move |b| [a, b]))
            .filter(|&change| points(change) < points([0, 0]))
            .filter(|change| change.iter().filter(|&&c| c < 0).count() == 1)
            .filter(|change| change.iter().any(|&c| c > 0) || change.contains(&-1))
            .flat_map(|change| [(change, true), (change, false)])
            .collect();
        // Few changes first, and among them those that leave the most points.
        changes.sort_by_key(|&(change, balanced)| {
            let changed: isize = change.iter().map(|&c| c.abs()).sum();
            (changed > 1, !balanced, changed, -points(change))
        });
        changes
    }

    /// Changes the numbers of lines, by placing them anew with balanced errors or one by one, and shifts them.
    fn trade(
        &mut self,
        selection: &mut Selection,
        change: [isize; 2],
        balanced: bool,
    ) -> Result<bool> {
        if balanced {
            for (direction, &change) in change.iter().enumerate() {
                if change != 0 && !self.balance(selection, direction, change)? {
                    return Ok(false);
                }
            }
        } else {
            for (direction, &change) in change.iter().enumerate() {
                for _ in 0..change {
                    if !self.add(selection, direction)? {
                        return Ok(false);
                    }
                }
            }
            for (direction, &change) in change.iter().enumerate() {
                for _ in change..0 {
                    if !self.remove(selection, direction)? {
                        return Ok(false);
                    }
                }
            }
        }
        self.shift(selection, true)?;
        Ok(selection.score.worst <= self.aim)
    }

    /// Places all lines of a direction anew, `change` more than now, with predicted equal errors of the gaps: the error
    /// of a cubic grows with the fourth power of the gap.
    fn balance(
        &mut self,
        selection: &mut Selection,
        direction: usize,
        change: isize,
    ) -> Result<bool> {
        let (count, closed) = (self.screen.counts[direction], self.screen.closed[direction]);
        let wanted = selection.lines[direction]
            .len()
            .saturating_add_signed(change);
        if wanted < self.least[direction] || wanted > count {
            return Ok(false);
        }
        let mut lines = selection.lines[direction].clone();
        let mut best: Option<(Vec<usize>, Score)> = None;
        for _ in 0..REPLACING_PASSES {
            let alone = self.screen.judge(direction, &lines, None)?;
            lines = equal_errors(&lines, &alone.by_line[direction], count, closed, wanted);
            let score = selection.trial(&mut self.screen, direction, &lines)?;
            if best
                .as_ref()
                .is_some_and(|best| score.objective >= best.1.objective)
            {
                break;
            }
            best = Some((lines.clone(), score));
        }
        let Some((lines, score)) = best else {
            return Ok(false);
        };
        selection.accept(direction, lines, score);
        Ok(true)
    }
}

/// `wanted` lines whose gaps have equal errors, by the `errors` on every line that interpolating `lines` leaves.
fn equal_errors(
    lines: &[usize],
    errors: &[f64],
    count: usize,
    closed: bool,
    wanted: usize,
) -> Vec<usize> {
    let gaps = gaps(lines, count, closed);
    let of_gap = |&(a, b): &(usize, usize)| errors[a + 1..b].iter().copied().fold(0.0, f64::max);
    let worst = gaps.iter().map(of_gap).fold(f64::MIN_POSITIVE, f64::max);
    // Share of the lines of each gap; a gap without error still gets a few.
    let shares: Vec<f64> = gaps
        .iter()
        .map(|gap| math::powf((of_gap(gap) / worst).max(MIN_GAP_ERROR), 0.25))
        .collect();
    let total: f64 = shares.iter().sum();
    let steps = if closed { wanted } else { wanted - 1 };
    let mut placed = vec![0];
    let (mut gap, mut passed) = (0, 0.0);
    for k in 1..wanted {
        if !closed && k == steps {
            placed.push(count - 1);
            break;
        }
        let target = total * k as f64 / steps as f64;
        while gap + 1 < gaps.len() && passed + shares[gap] < target {
            passed += shares[gap];
            gap += 1;
        }
        let (a, b) = gaps[gap];
        let part = ((target - passed) / shares[gap]).clamp(0.0, 1.0);
        let place = (a..b)
            .find(|&line| (line - a) as f64 + 0.5 > part * (b - a) as f64)
            .unwrap_or(b);
        // Strictly increasing, with room for those that follow.
        let lowest = placed[k - 1] + 1;
        let highest = count - (wanted - k);
        placed.push(place.clamp(lowest, highest));
    }
    placed
}

/// Whether shifts that change the objective by `ratio` per pass cannot reach the aim within `passes` more passes.
fn hopeless(ratio: f64, passes: i32, score: &Score, aim: f64) -> bool {
    (aim / score.worst).powi(8) < ratio.min(MAX_PACE).powi(passes)
}

fn ln(objective: f64) -> f64 {
    math::ln(objective.max(f64::MIN_POSITIVE))
}

/// The intervals between neighbouring lines; a closed direction ends with the first line, one period on.
fn gaps(lines: &[usize], count: usize, closed: bool) -> Vec<(usize, usize)> {
    let mut gaps: Vec<(usize, usize)> = lines.windows(2).map(|w| (w[0], w[1])).collect();
    if closed {
        gaps.extend(lines.last().map(|&last| (last, count)));
    }
    gaps
}

/// `lines` and `more`, in order.
fn with(lines: &[usize], more: impl IntoIterator<Item = usize>) -> Vec<usize> {
    let mut all: Vec<usize> = lines.iter().copied().chain(more).collect();
    all.sort_unstable();
    all.dedup();
    all
}

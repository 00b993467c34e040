//! Rarefaction to tolerance: grid lines are kept until every point is within a tolerance.
//!
//! The paper promises that rarefied points lose no shape, but its rule (see [`crate::rarefy`]) gives no bound: the
//! surface passes through the kept points only. Here lines are chosen so that the surface through the kept points comes
//! within a tolerance of *all* points, kept and discarded, with as few points as the search finds:
//!
//! 1. All lines get parameters once, from the full grid; kept lines inherit them.
//! 2. From a handful of lines, the line (or group of lines) is added that lowers the error most per control point,
//!    until all points are within tolerance.
//! 3. Lines are shifted to better places, removed, and traded between the directions while all points stay within
//!    tolerance.
//! 4. The result is verified with distances to actual points of the surface, and tightened where they disagree with the
//!    first-order distances of the search.
//!
//! Ours; the paper is Pal and Ballav, IJPR 45(2), 2007.

mod distance;
mod screen;
mod search;
mod threshold;

pub use threshold::largest_threshold;

use super::interpolate::interpolate_at;
use crate::chart::Topology;
use crate::fit::interpolate::parameters::{Parameterization, parameters_u, parameters_v};
use crate::rarefy::{Kept, normals};
use distance::largest_distance;
use glam::DVec3;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, NurbsSurface, PointGrid, Result};
use screen::Screen;
use search::{Pace, Search, Selection};
use std::cmp::Ordering;

/// How to rarefy to tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Degrees along u and v.
    pub degree: [usize; 2],
    /// Parameters of the lines; `None` tries chord length and uniform and takes what keeps fewer points.
    pub parameterization: Option<Parameterization>,
    /// Most points to keep; `None` for as many as it takes.
    pub max_points: Option<usize>,
    /// Number of point evaluations (some nanoseconds each) that may be spent on finding fewer lines after the first
    /// selections within tolerance; 0 takes those.
    pub effort: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            degree: [3, 3],
            parameterization: None,
            max_points: None,
            effort: DEFAULT_EFFORT,
        }
    }
}

/// The lines kept, and the surface through their points.
#[derive(Clone, Debug)]
pub struct Rarefied {
    /// The lines kept.
    pub kept: Kept,
    /// The surface through the kept points.
    pub surface: NurbsSurface,
    /// Parameters of *every* line of the grid along u and v.
    pub parameters: [Vec<f64>; 2],
    /// The parameterization they were computed with.
    pub parameterization: Parameterization,
    /// The largest distance of any point, kept or discarded, from the surface: an upper bound, taken to actual points
    /// of the surface.
    pub max_distance: f64,
    /// Rounds of adding and trading lines.
    pub rounds: usize,
    /// Whether `max_distance` is within the tolerance. If not, the budget of points did not allow it, and this is the
    /// best selection found within the budget.
    pub met: bool,
}

/// Few lines of an ordered grid such that the surface through their points comes within `tolerance` (in the unit of the
/// points) of all points. Ends of open directions and line 0 of closed ones are always kept, and at least degree + 1
/// lines, if the grid has them. Deterministic; [`Options::effort`] bounds the search.
///
/// Parameters that keep all lines always meet the tolerance, so only `options.max_points` can make it fail; then
/// [`Rarefied::met`] is false.
///
/// # Errors
/// [`Error::Invalid`] if the tolerance is not a positive number, or as
/// [`interpolate_at`]; [`Error::Cancelled`].
///
/// ```
/// use nurbskin_fit::fit::rarefied::{Options, rarefy_to_tolerance};
/// use nurbskin_geometry::{DVec3, PointGrid};
/// use nurbskin_fit::chart::Topology;
/// use nurbskin_geometry::progress::Silent;
/// let grid = PointGrid::from_fn(60, 60, |i, j| {
///     let (x, y) = (i as f64, j as f64);
///     DVec3::new(x, y, 8.0 * (-(x - 30.0).powi(2) / 200.0).exp() + 0.01 * y * y)
/// })?;
/// let options = Options::default();
/// let result = rarefy_to_tolerance(&grid, Topology::Disk, 0.05, &options, &Silent)?;
/// assert!(result.met && result.max_distance <= 0.05);
/// assert!(result.kept.point_count() <= 64);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
pub fn rarefy_to_tolerance(
    grid: &PointGrid,
    topology: Topology,
    tolerance: f64,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Rarefied> {
    check_tolerance(tolerance)?;
    let normals = normals(grid, topology);
    let kinds = match options.parameterization {
        Some(kind) => vec![kind],
        None => vec![Parameterization::ChordLength, Parameterization::Uniform],
    };
    let job = Job {
        grid,
        topology,
        tolerance,
        options,
        progress,
    };
    // All parameterizations get a share of the effort, the best one gets the rest.
    let share = options.effort / (kinds.len() as u64 + 1);
    let mut runs = Vec::new();
    let mut failure = None;
    for kind in kinds {
        match Run::start(job, &normals, kind).and_then(|mut run| run.thin(share).map(|()| run)) {
            Ok(run) => runs.push(run),
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(error) => failure = failure.or(Some(error)),
        }
    }
    // Stable, so that chord length wins where all is equal.
    runs.sort_by(|a, b| a.rank().partial_cmp(&b.rank()).unwrap_or(Ordering::Equal));
    let mut best: Option<Rarefied> = None;
    for (k, run) in runs.iter_mut().enumerate() {
        if k == 0 {
            run.thin(share)?;
        }
        let result = run.verify()?;
        if result.met {
            return Ok(result);
        }
        if best
            .as_ref()
            .is_none_or(|best| result.max_distance < best.max_distance)
        {
            best = Some(result);
        }
    }
    match (best, failure) {
        (Some(best), _) => Ok(best),
        (None, Some(error)) => Err(error),
        (None, None) => Err(Error::invalid("no parameterization was given")),
    }
}

fn check_tolerance(tolerance: f64) -> Result<()> {
    if tolerance.is_finite() && tolerance > 0.0 {
        return Ok(());
    }
    Err(Error::invalid(format!(
        "the tolerance {tolerance} is not a positive number"
    )))
}

/// Most times that a selection is mended whose true distances are larger than those of first order. Count.
/// Guard: a few are usual; then all lines are kept.
const MAX_MENDING_ATTEMPTS: usize = 40;
/// Default of [`Options::effort`]. Point evaluations.
/// Guard: a few tenths of a second.
const DEFAULT_EFFORT: u64 = 60_000_000;
/// Lines of a direction to start with, at least. Count.
/// Guard: one more than a cubic needs.
const FIRST_LINES: usize = 5;
/// Lines between two kept ones on which first-order distances are measured. Count.
/// Guard: the error is smooth, and the result is verified on all points.
const SAMPLES_PER_GAP: usize = 5;
/// Attempts after which the aim is lowered by more. Count.
/// Guard: bounds the number of attempts.
const PATIENT_ATTEMPTS: usize = 8;
/// Factor of the aim besides the excess of the true distance, in patient and in later attempts. Dimensionless.
/// Guard: a little below 1, so that the aim falls.
const AIM_FACTORS: [f64; 2] = [0.998, 0.7];
/// Least factor of the aim in one attempt. Dimensionless.
/// Guard: a single large distance must not ruin it.
const MIN_AIM_FACTOR: f64 = 0.5;
/// Ratio of the effort to that of mending once. Dimensionless.
/// Guard: bounds the time of all attempts.
const MENDING_EFFORT_DIVISOR: u64 = 16;
/// Length of `S_u x S_v` relative to the sum of the squared tangents up to which it gives no normal. Dimensionless.
/// Guard: near a pole one of the tangents vanishes.
const VANISHING_NORMAL: f64 = 1e-6;

/// The request.
#[derive(Clone, Copy)]
struct Job<'a> {
    grid: &'a PointGrid,
    topology: Topology,
    tolerance: f64,
    options: &'a Options,
    progress: &'a dyn Progress,
}

/// The search with one parameterization.
struct Run<'a> {
    job: Job<'a>,
    kind: Parameterization,
    parameters: [Vec<f64>; 2],
    normals: Vec<DVec3>,
    search: Search,
    selection: Selection,
}

impl<'a> Run<'a> {
    /// From a handful of lines to a selection within tolerance, to first order.
    fn start(job: Job<'a>, normals: &[DVec3], kind: Parameterization) -> Result<Self> {
        let Job {
            grid,
            topology,
            tolerance,
            options,
            ..
        } = job;
        let parameters = parameters(grid, topology, kind)?;
        let (closed, counts) = (topology.closed(), grid.counts());
        let least = [0, 1].map(|d| (options.degree[d] + 1).min(counts[d]));
        let start = [0, 1].map(|d| spread(FIRST_LINES.max(least[d]), counts[d], closed[d]));
        let mut search = Search {
            screen: Screen::new(
                grid,
                normals,
                closed,
                options.degree,
                parameters.clone(),
                tolerance,
            ),
            least,
            most_points: options.max_points.unwrap_or(usize::MAX),
            work_limit: 0,
            aim: 1.0,
            rounds: 0,
            patience: 1,
            history: Vec::new(),
        };
        let first = Selection::new(&mut search.screen, start)?;
        let selection = search.grow(first.clone(), Pace::Grouped)?;
        let mut run = Self {
            job,
            kind,
            parameters,
            normals: normals.to_vec(),
            search,
            selection,
        };
        let surface = run.surface()?;
        // The error is smooth: a few samples per gap show it. The result is verified on all points.
        let strides =
            [0, 1].map(|d| (counts[d] / (SAMPLES_PER_GAP * run.selection.lines[d].len())).max(1));
        run.improve_normals(&surface, strides)?;
        run.selection = run.search.grow(run.selection.clone(), Pace::Single)?;
        if options.effort > run.search.screen.work {
            let other = Selection::new(&mut run.search.screen, first.lines)?;
            let other = run.search.grow(other, Pace::Single)?;
            let rank = |s: &Selection| (s.score.worst > 1.0, s.point_count());
            if rank(&other) < rank(&run.selection) {
                run.selection = other;
            }
        }
        Ok(run)
    }

    /// Rank of the selection: less is better.
    fn rank(&self) -> (f64, usize) {
        let worst = self.selection.score.worst;
        let excess = if worst > self.search.aim { worst } else { 0.0 };
        (excess, self.selection.point_count())
    }

    /// Spends at most `effort` on fewer points.
    fn thin(&mut self, effort: u64) -> Result<()> {
        self.job.progress.check()?;
        self.search.work_limit = self.search.screen.work.saturating_add(effort);
        self.selection = self.search.thin(self.selection.clone())?;
        Ok(())
    }

    /// The selection with true distances; lines are shifted and added where those are larger than the tolerance.
    fn verify(&mut self) -> Result<Rarefied> {
        let (grid, tolerance) = (self.job.grid, self.job.tolerance);
        let mut attempts = 0;
        loop {
            self.job.progress.check()?;
            let surface = self.surface()?;
            let max_distance = largest_distance(&surface, grid, &self.parameters);
            let [u, v] = self.selection.lines.clone();
            let kept = Kept { u, v };
            let met = max_distance <= tolerance;
            let all = kept.counts() == grid.counts();
            let result = Rarefied {
                kept,
                parameters: self.parameters.clone(),
                parameterization: self.kind,
                max_distance,
                rounds: self.search.rounds,
                met,
                surface,
            };
            if met || all || self.selection.score.worst > self.search.aim {
                return Ok(result);
            }
            attempts += 1;
            if attempts > MAX_MENDING_ATTEMPTS {
                // First-order distances fail here, as on a grid without area: all lines meet the tolerance.
                let all = grid.counts().map(|count| (0..count).collect::<Vec<_>>());
                if all[0].len() * all[1].len() > self.search.most_points {
                    return Ok(result);
                }
                self.selection = Selection::new(&mut self.search.screen, all)?;
                continue;
            }
            self.improve_normals(&result.surface, [1, 1])?;
            let (aim, worst) = (self.search.aim, self.selection.score.worst);
            if worst <= aim {
                // First-order distances are too small for this surface: lower the aim by the same ratio, and by more if
                // it repeats.
                let factor = AIM_FACTORS[usize::from(attempts > PATIENT_ATTEMPTS)];
                self.search.aim *=
                    (factor * tolerance / max_distance).clamp(MIN_AIM_FACTOR, factor);
            }
            self.search.work_limit =
                self.search.screen.work + self.job.options.effort / MENDING_EFFORT_DIVISOR;
            self.search.shift(&mut self.selection, true)?;
            while self.selection.score.worst > self.search.aim {
                // The last selection with more points, or, where there is none, more lines.
                let Some(lines) = self.search.history.pop() else {
                    self.selection = self.search.grow(self.selection.clone(), Pace::Grouped)?;
                    break;
                };
                self.selection = Selection::new(&mut self.search.screen, lines)?;
            }
        }
    }

    /// The surface through the points selected.
    fn surface(&self) -> Result<NurbsSurface> {
        let [u, v] = self.selection.lines.clone();
        let Job {
            grid,
            topology,
            options,
            ..
        } = self.job;
        through(
            grid,
            topology,
            options.degree,
            &Kept { u, v },
            &self.parameters,
        )
    }

    /// Measures along the normals of this surface from now on: once it is close, they are better than those of
    /// differences. Distances are taken on every `strides[d]`-th line.
    fn improve_normals(&mut self, surface: &NurbsSurface, strides: [usize; 2]) -> Result<()> {
        let [u, v] = &self.parameters;
        for (k, normal) in self.normals.iter_mut().enumerate() {
            let s = surface.derivatives(u[k % u.len()], v[k / u.len()]);
            let product = s.du.cross(s.dv);
            // Near a pole one of the tangents vanishes, and the product gives no normal.
            if product.length() > VANISHING_NORMAL * (s.du.length_squared() + s.dv.length_squared())
            {
                *normal = product.normalize();
            }
        }
        let screen = &mut self.search.screen;
        screen.sample(self.job.grid, &self.normals, self.job.tolerance, strides);
        self.selection.judge_again(screen)
    }
}

fn parameters(
    grid: &PointGrid,
    topology: Topology,
    kind: Parameterization,
) -> Result<[Vec<f64>; 2]> {
    let closed = topology.closed();
    Ok([
        parameters_u(grid, closed[0], kind)?,
        parameters_v(grid, closed[1], kind)?,
    ])
}

/// The surface through the kept points, at the parameters of all lines that they inherit.
fn through(
    grid: &PointGrid,
    topology: Topology,
    degree: [usize; 2],
    kept: &Kept,
    parameters: &[Vec<f64>; 2],
) -> Result<NurbsSurface> {
    let of = |lines: &[usize], all: &[f64]| lines.iter().map(|&k| all[k]).collect::<Vec<_>>();
    let (u, v) = (of(&kept.u, &parameters[0]), of(&kept.v, &parameters[1]));
    interpolate_at(&kept.select(grid)?, topology, degree, [&u, &v])
}

/// `wanted` lines spread evenly over `count`, the ends of an open direction among them.
fn spread(wanted: usize, count: usize, closed: bool) -> Vec<usize> {
    let wanted = wanted.min(count);
    if wanted < 2 {
        return (0..wanted).collect();
    }
    let (steps, end) = if closed {
        (wanted, count)
    } else {
        (wanted - 1, count - 1)
    };
    (0..wanted).map(|k| (k * end + steps / 2) / steps).collect()
}

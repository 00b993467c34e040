//! Rarefaction to tolerance: grid lines are kept until every point is within tolerance.
//!
//! The paper promises that rarefied points lose no shape, but its rule (see [`crate::rarefy`]) bounds nothing and says
//! only that the surface passes through the points that were kept. Here the promise is kept: lines are chosen so that
//! the surface through the kept points comes within a tolerance of *all* points, kept and discarded, and with as few
//! points as the search finds.
//!
//! 1. All lines get parameters once, from the full grid; kept lines inherit them.
//! 2. From a handful of lines, the line (or group of lines) is added that lowers the error most per control point,
//!    until all points are within tolerance.
//! 3. Lines are shifted to better places, removed, and traded between the directions while all points stay within
//!    tolerance.
//! 4. The result is verified with distances to actual points of the surface, and tightened where they disagree with the
//!    first-order distances of the search.

mod distance;
mod screen;
mod search;

use super::interpolate::interpolate_at;
use super::parameters::{Parameterization, parameters_u, parameters_v};
use crate::chart::Topology;
use crate::progress::Progress;
use crate::rarefy::{Kept, Statistic, Turning, normals};
use crate::{Error, NurbsSurface, PointGrid, Result};
use distance::largest_distance;
use glam::DVec3;
use screen::Screen;
use search::{Search, Selection};

/// How to rarefy to tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Degrees along u and v.
    pub degree: [usize; 2],
    /// Parameters of the lines; `None` tries chord length and uniform and takes what keeps fewer points.
    pub parameterization: Option<Parameterization>,
    /// Most points to keep; `None` for as many as it takes.
    pub max_points: Option<usize>,
    /// Number of point evaluations that may be spent on each parameterization to find fewer lines after a first
    /// selection is within tolerance (some nanoseconds each); 0 takes the first selection.
    pub effort: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            degree: [3, 3],
            parameterization: None,
            max_points: None,
            effort: 25_000_000,
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
    /// How they follow from the points.
    pub parameterization: Parameterization,
    /// The largest distance of any point, kept or discarded, from the surface: an upper bound, taken to actual points of
    /// the surface.
    pub max_distance: f64,
    /// Rounds of adding and trading lines.
    pub rounds: usize,
    /// Whether `max_distance` is within the tolerance. If not, the budget of points did not allow it, and this is the
    /// best selection found within the budget.
    pub met: bool,
}

/// Few lines of an ordered grid such that the surface through their points comes within `tolerance` (in the unit of the
/// points) of all points. Ends of open directions and line 0 of closed ones are always kept, and at least degree + 1
/// lines, where there are so many. Deterministic; [`Options::effort`] bounds the search.
///
/// Parameters that keep all lines always meet the tolerance, so only `options.max_points` can make it fail; then
/// [`Rarefied::met`] is false.
///
/// # Errors
/// [`Error::Invalid`] if the tolerance is not a positive number, or as
/// [`interpolate_at`](crate::fit::interpolate::interpolate_at); [`Error::Cancelled`].
///
/// ```
/// use nurbskin::fit::rarefied::{Options, rarefy_to_tolerance};
/// use nurbskin::{DVec3, PointGrid, chart::Topology, progress::Silent};
/// let grid = PointGrid::from_fn(60, 60, |i, j| {
///     let (x, y) = (i as f64, j as f64);
///     DVec3::new(x, y, 8.0 * (-(x - 30.0).powi(2) / 200.0).exp() + 0.01 * y * y)
/// })?;
/// let options = Options::default();
/// let result = rarefy_to_tolerance(&grid, Topology::Disk, 0.05, &options, &Silent)?;
/// assert!(result.met && result.max_distance <= 0.05);
/// assert!(result.kept.point_count() <= 64);
/// # Ok::<(), nurbskin::Error>(())
/// ```
pub fn rarefy_to_tolerance(
    grid: &PointGrid,
    topology: Topology,
    tolerance: f64,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Rarefied> {
    if !(tolerance.is_finite() && tolerance > 0.0) {
        return Err(Error::invalid(format!(
            "the tolerance {tolerance} is not a positive number"
        )));
    }
    let normals = normals(grid, topology);
    let kinds = match options.parameterization {
        Some(kind) => vec![kind],
        None => vec![Parameterization::ChordLength, Parameterization::Uniform],
    };
    let mut best: Option<Rarefied> = None;
    let mut failure = None;
    for kind in kinds {
        match with_parameters(grid, &normals, topology, tolerance, options, kind, progress) {
            Ok(result) => {
                let better = best.as_ref().is_none_or(|best| {
                    let rank = |r: &Rarefied| {
                        let excess = if r.met { 0.0 } else { r.max_distance };
                        (excess, r.kept.point_count(), r.max_distance)
                    };
                    rank(&result) < rank(best)
                });
                if better {
                    best = Some(result);
                }
            }
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(error) => failure = failure.or(Some(error)),
        }
    }
    match (best, failure) {
        (Some(best), _) => Ok(best),
        (None, Some(error)) => Err(error),
        (None, None) => Err(Error::invalid("no parameterization was given")),
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

fn with_parameters(
    grid: &PointGrid,
    normals: &[DVec3],
    topology: Topology,
    tolerance: f64,
    options: &Options,
    kind: Parameterization,
    progress: &dyn Progress,
) -> Result<Rarefied> {
    let parameters = parameters(grid, topology, kind)?;
    let closed = topology.closed();
    let counts = grid.counts();
    let mut screen = Screen::new(
        grid,
        normals,
        closed,
        options.degree,
        parameters.clone(),
        tolerance,
    );
    let least = [0, 1].map(|d| (options.degree[d] + 1).min(counts[d]));
    let start = [0, 1].map(|d| spread(5.max(least[d]), counts[d], closed[d]));
    let mut search = Search {
        screen: &mut screen,
        least,
        most_points: options.max_points.unwrap_or(usize::MAX),
        work_limit: 0,
        aim: 1.0,
        rounds: 0,
    };
    let first = Selection::new(search.screen, start)?;
    let mut selection = search.grow(first.clone(), false)?;
    let finish = |selection: &Selection| {
        finish(grid, topology, options.degree, selection, &parameters, kind)
    };
    // The surface is near the truth now: its normals are better than those of differences.
    let mut normals = normals.to_vec();
    improve_normals(&mut normals, &finish(&selection)?);
    search.screen.measure_along(&normals, tolerance);
    selection.judge_again(search.screen)?;
    selection = search.grow(selection, true)?;
    search.work_limit = search.screen.work + options.effort;
    if options.effort > 0 {
        let other = Selection::new(search.screen, first.lines)?;
        let other = search.grow(other, true)?;
        let rank = |s: &Selection| (s.score.worst > 1.0, s.point_count());
        if rank(&other) < rank(&selection) {
            selection = other;
        }
        selection = search.thin(selection)?;
    }
    let mut attempt = 0;
    loop {
        progress.check()?;
        let result = finish(&selection)?;
        let met = result.max_distance <= tolerance;
        if met || result.kept.counts() == counts || selection.score.worst > search.aim {
            return Ok(Rarefied {
                met,
                rounds: search.rounds,
                ..result
            });
        }
        improve_normals(&mut normals, &result);
        search.screen.measure_along(&normals, tolerance);
        selection.judge_again(search.screen)?;
        if selection.score.worst <= search.aim {
            // Distances of first order are too small for this surface: aim lower by as much, and more if it repeats.
            attempt += 1;
            let factor = if attempt > 8 { 0.7 } else { 0.998 };
            search.aim *= (factor * tolerance / result.max_distance).clamp(0.5, factor);
        }
        search.shift(&mut selection, true)?;
        selection = search.grow(selection, true)?;
    }
}

/// Replaces normals by those of the surface at the points' own parameters, where it has one.
fn improve_normals(normals: &mut [DVec3], result: &Rarefied) {
    let [u, v] = &result.parameters;
    for (k, normal) in normals.iter_mut().enumerate() {
        let s = result.surface.derivatives(u[k % u.len()], v[k / u.len()]);
        let product = s.du.cross(s.dv);
        // Near a pole one of the tangents vanishes, and the product says nothing.
        if product.length() > 1e-6 * (s.du.length_squared() + s.dv.length_squared()) {
            *normal = product.normalize();
        }
    }
}

fn finish(
    grid: &PointGrid,
    topology: Topology,
    degree: [usize; 2],
    selection: &Selection,
    parameters: &[Vec<f64>; 2],
    kind: Parameterization,
) -> Result<Rarefied> {
    let [u, v] = selection.lines.clone();
    let kept = Kept { u, v };
    let surface = through(grid, topology, degree, &kept, parameters)?;
    Ok(Rarefied {
        max_distance: largest_distance(&surface, grid, parameters),
        kept,
        surface,
        parameters: parameters.clone(),
        parameterization: kind,
        rounds: 0,
        met: false,
    })
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

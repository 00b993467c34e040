//! The rule of the paper with the largest threshold that meets a tolerance.
//!
//! ```text
//! D_T = 180°, then the next turning angle that changes the selection, at least 0.5 % smaller, down to 0.001°
//! ```
//!
//! The error is not monotone in the threshold, so that none can be skipped; a selection is verified only if its
//! first-order distances are within twice the tolerance.
//!
//! Source: the threshold rule of Pal and Ballav, 2007, section 3.1; the search is ours.

use super::distance::largest_distance;
use super::screen::Screen;
use super::{Rarefied, parameters, through};
use crate::chart::Topology;
use crate::fit::interpolate::parameters::Parameterization;
use crate::rarefy::{Kept, Statistic, Turning, normals};
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{PointGrid, Result};

/// Least relative difference of two thresholds that are tried. Dimensionless.
/// Guard: bounds the number of trials to some 2400.
const THRESHOLD_RESOLUTION: f64 = 0.005;
/// Threshold, in degrees, at which the search ends.
/// Guard: at it nearly all lines are kept.
const MIN_THRESHOLD: f64 = 1e-3;
/// First-order distance, in tolerances, above which a selection is not verified.
/// Guard: near the tolerance first-order distances are good to far better than a factor of two.
const SCREENING_MARGIN: f64 = 2.0;
/// Relative difference up to which turnings count as equal. Dimensionless.
/// Guard: above rounding.
const EQUAL_TURNINGS: f64 = 1e-9;

/// The largest threshold `D_T`, the same in both directions, at which [`rarefy`](crate::rarefy::rarefy) keeps lines
/// such that the surface through their points comes within `tolerance` of *all* points; with what it keeps. `None` if
/// no threshold does that with fewer than all lines.
///
/// Thresholds are tried downward from half a turn, each as small as needed to change the selection and at least 0.5 %
/// smaller than the one before, down to a thousandth of a degree: the error does not fall steadily with the threshold,
/// so nothing can be skipped. Kept lines inherit the parameters of the full grid. O(m n) per threshold.
///
/// # Errors
/// As [`rarefy_to_tolerance`](super::rarefy_to_tolerance).
///
/// ```
/// use nurbskin_fit::fit::interpolate::parameters::Parameterization;
/// use nurbskin_fit::fit::rarefied::largest_threshold;
/// use nurbskin_geometry::{DVec3, PointGrid};
/// use nurbskin_fit::chart::Topology;
/// use nurbskin_geometry::progress::Silent;
/// let grid = PointGrid::from_fn(60, 40, |i, j| {
///     let (sin, cos) = (2.0 * i as f64).to_radians().sin_cos();
///     DVec3::new(50.0 * cos, 50.0 * sin, j as f64)
/// })?;
/// let kind = Parameterization::ChordLength;
/// let (degrees, result) =
///     largest_threshold(&grid, Topology::Disk, 0.1, [3, 3], kind, &Silent)?.expect("all lines would do");
/// assert!(degrees > 20.0 && result.max_distance <= 0.1);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
pub fn largest_threshold(
    grid: &PointGrid,
    topology: Topology,
    tolerance: f64,
    degree: [usize; 2],
    parameterization: Parameterization,
    progress: &dyn Progress,
) -> Result<Option<(f64, Rarefied)>> {
    super::check_tolerance(tolerance)?;
    let turning = Turning::new(grid, topology);
    let parameters = parameters(grid, topology, parameterization)?;
    let mut screen = Screen::new(
        grid,
        &normals(grid, topology),
        topology.closed(),
        degree,
        parameters.clone(),
        tolerance,
    );
    let mut degrees: f64 = 180.0;
    let mut tried = Kept::default();
    let mut rounds = 0;
    while degrees > MIN_THRESHOLD {
        progress.check()?;
        let walks = [0, 1].map(|d| turning.walk(d, degrees, Statistic::Max));
        // A hair below the largest turning that did not suffice, so that equal turnings fall together.
        let next = walks[0].next_threshold.max(walks[1].next_threshold) * (1.0 - EQUAL_TURNINGS);
        let [u, v] = walks.map(|walk| walk.kept);
        let kept = Kept {
            u: turning.filled(0, u, degree[0] + 1),
            v: turning.filled(1, v, degree[1] + 1),
        };
        if kept.counts() == grid.counts() {
            break;
        }
        if kept != tried {
            rounds += 1;
            let table = screen.splined(1, &kept.v)?;
            // Near the tolerance, first-order distances are good to far better than a factor of two.
            if screen.judge(0, &kept.u, Some(&table))?.worst <= SCREENING_MARGIN {
                let surface = through(grid, topology, degree, &kept, &parameters)?;
                let max_distance = largest_distance(&surface, grid, &parameters);
                if max_distance <= tolerance {
                    let result = Rarefied {
                        kept,
                        surface,
                        parameters,
                        parameterization,
                        max_distance,
                        rounds,
                        met: true,
                    };
                    return Ok(Some((degrees, result)));
                }
            }
            tried = kept;
        }
        degrees = next.min(degrees * (1.0 - THRESHOLD_RESOLUTION));
    }
    Ok(None)
}

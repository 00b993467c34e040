//! Noise of points in a grid or on lines.
//!
//! Grid: in windows of 5×5 to 7×7 points, the residual operators M = I - Q Qᵀ along u and N along v remove everything
//! that is a polynomial of degree 2, 3 or 4 of the averaged chord length along u, or along v. Shape remains only where
//! it is rough along both directions at once. The residual of point ij along its normal is `Σ_kl M_ik N_jl e_kl (n_ij
//! · n_kl)`, whose expected square normalises the variance. Lines: the same in one direction, in windows of nine
//! points. `settle` combines the degrees. Source: ours.

use crate::clean::elements::Elements;
use crate::clean::noise::{
    NOISE_SAMPLES, Residuals, VARIANCE_QUANTILE, expected_quantile, settle, small,
};
use crate::clean::sides::lines;
use crate::{GridLayout, Organisation, Scan};
use glam::DVec3;
use nurbskin_geometry::PointGrid;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::quantile_in_place;

/// Points per window of a line. Trial: not recorded. The polynomial of the highest degree (5, of six coefficients)
/// leaves three degrees of freedom; longer windows see more of the shape.
const LINE_WINDOW: usize = 9;
/// Degrees of the polynomials along a line, in ascending order for [`settle`]. Trial: not recorded. Lower degrees leave
/// more of the shape; higher ones leave too few degrees of freedom.
const LINE_DEGREES: [usize; 3] = [3, 4, 5];
/// Fewest tensor windows of a grid whose quantile alone gives the noise; with fewer, lines or the cloud are measured as
/// well. Trial: not recorded. The lower quartile of fewer windows scatters.
const MIN_GRID_WINDOWS: usize = 64;
/// Degrees of the polynomials along both directions of a grid, in ascending order for [`settle`]; the windows have 5×5,
/// 6×6 and 7×7 points. Trial: not recorded.
const GRID_DEGREES: [usize; 3] = [2, 3, 4];
/// Points of a grid window per direction beyond the degree. Derived: degree + 3 points less degree + 1 coefficients
/// leave two degrees of freedom per direction.
const GRID_WINDOW_SURPLUS: usize = 3;
/// Degrees of freedom of the residuals in a grid window. Derived: two per direction, and 2 × 2 in the tensor product.
const GRID_FREEDOM: f64 = 4.0;
/// Least expected sum of squares of the residuals of a grid window for unit noise; below it the normals of the window
/// cancel. Guard: the expectation is 4 where the normals agree, and a quotient by a small one is rounding.
const MIN_GRID_EXPECTATION: f64 = 1e-3;
/// The same for a window of a line. Guard: the expectation is 3 to 5 where the normals agree.
const MIN_LINE_EXPECTATION: f64 = 1e-6;

/// Standard deviation of the noise of ordered points, along their normals; `closed` states which of u and v are
/// periodic.
///
/// In windows of 5 x 5 to 7 x 7 points everything that is a polynomial along u, or along v, is removed. The rest is
/// noise, and shape only where it is rough along both directions at once. Lines need not be even: the polynomials run
/// over chord lengths, averaged over the window. In small grids, lines of nine points are measured as well, and the
/// smaller result counts; zero if there are neither. At most a few thousand windows are examined: O(n).
#[must_use]
pub fn noise_of_grid(grid: &PointGrid, closed: [bool; 2]) -> f64 {
    let normals = grid_normals(grid, closed);
    let [m, n] = grid.counts();
    let cells: Vec<Option<usize>> = (0..m * n).map(Some).collect();
    let (windows, variances) = grid_variances(grid.points(), &normals, [m, n], &cells, closed);
    let by_windows = settle(&variances);
    if windows >= MIN_GRID_WINDOWS && by_windows >= 0.0 {
        return by_windows.sqrt();
    }
    let along = |count: usize, lines: usize, around: bool, at: &dyn Fn(usize, usize) -> usize| {
        let lines = (0..lines).map(|l| (0..count).map(|k| at(k, l)).collect::<Vec<_>>());
        line_variances(grid.points(), &normals, &lines.collect::<Vec<_>>(), around)
    };
    let in_u = along(m, n, closed[0], &|k, l| l * m + k);
    let in_v = along(n, m, closed[1], &|k, l| k * m + l);
    let by_lines = smallest([settle(&in_u), settle(&in_v)]);
    // Lines with a result of zero were extrapolated to it; a result of windows has priority.
    if by_windows >= 0.0 && (by_lines <= 0.0 || by_lines * by_lines > by_windows) {
        by_windows.sqrt()
    } else {
        by_lines
    }
}

/// The number of tensor windows without empty cells that are examined, and their residual variance along the normals,
/// per degree; empty if there are none.
fn grid_variances(
    points: &[DVec3],
    normals: &[DVec3],
    [m, n]: [usize; 2],
    cells: &[Option<usize>],
    closed: [bool; 2],
) -> (usize, Vec<f64>) {
    let most = GRID_DEGREES[GRID_DEGREES.len() - 1] + GRID_WINDOW_SURPLUS;
    if m < most || n < most || cells.len() != m * n {
        return (0, Vec::new());
    }
    let starts = |count: usize, around: bool| if around { count } else { count + 1 - most };
    let [along_u, along_v] = [starts(m, closed[0]), starts(n, closed[1])];
    // The windows of the largest size without empty cells; windows of smaller size begin at the same corner.
    let window = |k: usize| -> Option<Vec<usize>> {
        let (i, j) = (k % along_u, k / along_u);
        (0..most * most)
            .map(|c| cells[(j + c / most) % n * m + (i + c % most) % m])
            .collect()
    };
    let total = along_u * along_v;
    let complete: Vec<usize> = (0..total).filter(|&k| window(k).is_some()).collect();
    let stride = complete.len().div_ceil(NOISE_SAMPLES).max(1);
    let sample: Vec<usize> = complete.into_iter().step_by(stride).collect();
    let found = each(sample.len(), |s| {
        let window = window(sample[s]).unwrap_or_default();
        GRID_DEGREES.map(|degree| tensor_variance(points, normals, &window, most, degree))
    });
    let variances = (0..GRID_DEGREES.len())
        .filter_map(|d| {
            let mut known: Vec<f64> = found.iter().map(|f| f[d]).filter(|v| *v >= 0.0).collect();
            (!known.is_empty()).then(|| quantile_in_place(&mut known, VARIANCE_QUANTILE))
        })
        .collect();
    (sample.len(), variances)
}

/// The variance in the first (degree + 3)² points of a window of `side` lines, divided by its expected
/// [`VARIANCE_QUANTILE`]; negative if it is undefined. With the residual operators M along u and N along v the residual
/// of point ij along its normal is `sum_kl M_ik N_jl e_kl (n_ij . n_kl)`, which gives the expectation.
fn tensor_variance(
    points: &[DVec3],
    normals: &[DVec3],
    window: &[usize],
    side: usize,
    degree: usize,
) -> f64 {
    let w = degree + GRID_WINDOW_SURPLUS;
    if window.len() != side * side || w > side {
        return -1.0;
    }
    let at = |i: usize, j: usize| window[j * side + i];
    let operator = |step: &dyn Fn(usize, usize) -> f64| -> Option<Vec<f64>> {
        let mut length = vec![0.0; w];
        for k in 1..w {
            let mean = (0..w).map(|l| step(k, l)).sum::<f64>() / w as f64;
            length[k] = length[k - 1] + mean;
        }
        let total = length[w - 1];
        if total <= 0.0 {
            return None;
        }
        let mut space = Residuals::new(vec![0.0; w], w);
        for power in 0..=degree {
            space.remove(
                length
                    .iter()
                    .map(|s| (2.0 * s / total - 1.0).powi(small(power))),
            );
        }
        let entry = |k: usize| {
            let (i, j) = (k / w, k % w);
            let inside: f64 = space.columns.chunks_exact(w).map(|c| c[i] * c[j]).sum();
            f64::from(u8::from(i == j)) - inside
        };
        (space.rank() == degree + 1).then(|| (0..w * w).map(entry).collect())
    };
    let in_u = operator(&|k, l| points[at(k, l)].distance(points[at(k - 1, l)]));
    let in_v = operator(&|k, l| points[at(l, k)].distance(points[at(l, k - 1)]));
    let (Some(in_u), Some(in_v)) = (in_u, in_v) else {
        return -1.0;
    };
    let (mut sum, mut expected) = (0.0, 0.0);
    for j in 0..w {
        for i in 0..w {
            let (mut residual, normal) = (DVec3::ZERO, normals[at(i, j)]);
            for l in 0..w {
                for k in 0..w {
                    let weight = in_u[i * w + k] * in_v[j * w + l];
                    residual += weight * (points[at(k, l)] - points[at(0, 0)]);
                    expected += (weight * normal.dot(normals[at(k, l)])).powi(2);
                }
            }
            sum += residual.dot(normal).powi(2);
        }
    }
    if expected <= MIN_GRID_EXPECTATION {
        return -1.0;
    }
    // Two degrees of freedom remain along either direction.
    sum / (expected * expected_quantile(GRID_FREEDOM))
}

/// As [`noise_of_grid`] for lines of any length: each line is a list of indices into `points`. `None` if no line has
/// nine points.
#[must_use]
pub fn noise_of_lines(points: &[DVec3], normals: &[DVec3], lines: &[Vec<usize>]) -> Option<f64> {
    let variance = settle(&line_variances(points, normals, lines, false));
    (variance >= 0.0).then(|| variance.sqrt())
}

/// The square root of the smaller variance; negative (unknown) ones do not count.
fn smallest(variances: [f64; 2]) -> f64 {
    let known = variances.into_iter().filter(|&v| v >= 0.0);
    let least = known.fold(f64::INFINITY, f64::min);
    if least.is_finite() { least.sqrt() } else { 0.0 }
}

/// Residual variance of polynomials over the chord length of windows of lines, per degree; empty if no line is long
/// enough.
fn line_variances(
    points: &[DVec3],
    normals: &[DVec3],
    lines: &[Vec<usize>],
    around: bool,
) -> Vec<f64> {
    let mut windows: Vec<(usize, usize)> = Vec::new();
    for (l, line) in lines.iter().enumerate() {
        if line.len() < LINE_WINDOW {
            continue;
        }
        let starts = if around {
            line.len()
        } else {
            line.len() + 1 - LINE_WINDOW
        };
        windows.extend((0..starts).map(|start| (l, start)));
    }
    let stride = windows.len().div_ceil(NOISE_SAMPLES).max(1);
    let mut found = vec![Vec::new(); LINE_DEGREES.len()];
    for &(l, start) in windows.iter().step_by(stride) {
        let line = &lines[l];
        let window: [usize; LINE_WINDOW] = std::array::from_fn(|k| line[(start + k) % line.len()]);
        let at = window.map(|k| points[k]);
        let normal = window.map(|k| normals[k]);
        for (variances, degree) in found.iter_mut().zip(LINE_DEGREES) {
            let variance = window_variance(&at, &normal, degree);
            if variance >= 0.0 {
                variances.push(variance);
            }
        }
    }
    found
        .into_iter()
        .filter(|variances| !variances.is_empty())
        .map(|mut v| quantile_in_place(&mut v, VARIANCE_QUANTILE))
        .collect()
}

/// Residual variance, along the normals, of the polynomial of this degree over the chord length through a window.
/// With the residual operator M the residual of point i along its normal is `sum_j M_ij e_j (n_i . n_j)`, which gives
/// the expectation that the sum of squares is divided by.
fn window_variance(
    points: &[DVec3; LINE_WINDOW],
    normals: &[DVec3; LINE_WINDOW],
    degree: usize,
) -> f64 {
    let mut length = [0.0; LINE_WINDOW];
    for k in 1..LINE_WINDOW {
        length[k] = length[k - 1] + points[k].distance(points[k - 1]);
    }
    let total = length[LINE_WINDOW - 1];
    if total <= 0.0 {
        return -1.0;
    }
    let mut space = Residuals::new(vec![0.0; LINE_WINDOW], LINE_WINDOW);
    for power in 0..=degree {
        let column = length.map(|s| (2.0 * s / total - 1.0).powi(small(power)));
        space.remove(column.into_iter());
    }
    let operator = |i: usize, j: usize| {
        let inside: f64 = space
            .columns
            .chunks_exact(LINE_WINDOW)
            .map(|c| c[i] * c[j])
            .sum();
        f64::from(u8::from(i == j)) - inside
    };
    let (mut sum, mut expected) = (0.0, 0.0);
    for i in 0..LINE_WINDOW {
        let mut residual = DVec3::ZERO;
        for j in 0..LINE_WINDOW {
            let m = operator(i, j);
            residual += m * (points[j] - points[0]);
            expected += (m * normals[i].dot(normals[j])).powi(2);
        }
        sum += residual.dot(normals[i]).powi(2);
    }
    let free = (LINE_WINDOW - space.rank()) as f64;
    if expected <= MIN_LINE_EXPECTATION || free < 1.0 {
        return -1.0;
    }
    sum / (expected * expected_quantile(free))
}

/// Unit normals of ordered points by central differences, one-sided at open ends; zero where a pole has none.
fn grid_normals(grid: &PointGrid, closed: [bool; 2]) -> Vec<DVec3> {
    let [m, n] = grid.counts();
    let step = |k: usize, count: usize, around: bool| {
        if around {
            ((k + count - 1) % count, (k + 1) % count)
        } else {
            (k.saturating_sub(1), (k + 1).min(count - 1))
        }
    };
    (0..m * n)
        .map(|k| {
            let (i, j) = (k % m, k / m);
            let (a, b) = step(i, m, closed[0]);
            let (c, d) = step(j, n, closed[1]);
            let along_u = grid.point(b, j) - grid.point(a, j);
            let along_v = grid.point(i, d) - grid.point(i, c);
            along_u.cross(along_v).normalize_or_zero()
        })
        .collect()
}

/// The noise of an ordered scan. For a grid: that of its windows, or the smaller of this and the noise of the cloud if
/// there are few windows. For rows: the smaller of the noise of the cloud and of the lines; coarse sampling affects the
/// former more. For other scans: that of the cloud.
pub(crate) fn noise_by_order(
    scan: &Scan,
    place: &[u32],
    points: &[DVec3],
    elements: &Elements,
    cloud: f64,
) -> f64 {
    let normals = || -> Vec<DVec3> { elements.of.iter().map(|e| e.normal).collect() };
    match &scan.organisation {
        Organisation::Grid(GridLayout {
            count_u, count_v, ..
        }) => {
            let cells = lines(scan, place).concat();
            let cells: Vec<Option<usize>> = cells.iter().map(|c| c.map(|c| c as usize)).collect();
            let sizes = [*count_u, *count_v];
            let (windows, variances) =
                grid_variances(points, &normals(), sizes, &cells, [false; 2]);
            let variance = settle(&variances);
            if variance < 0.0 || (windows < MIN_GRID_WINDOWS && cloud > 0.0) {
                let small = if variance < 0.0 {
                    cloud
                } else {
                    variance.sqrt()
                };
                cloud.min(small)
            } else {
                variance.sqrt()
            }
        }
        Organisation::Rows(_) => {
            let mut whole = Vec::new();
            for line in lines(scan, place) {
                runs(line.into_iter(), &mut whole);
            }
            noise_of_lines(points, &normals(), &whole).map_or(cloud, |lines| cloud.min(lines))
        }
        Organisation::Unordered | Organisation::Mesh(_) => cloud,
    }
}

/// Splits a line at missing points.
fn runs(line: impl Iterator<Item = Option<u32>>, lines: &mut Vec<Vec<usize>>) {
    let mut run = Vec::new();
    for place in line {
        match place {
            Some(place) => run.push(place as usize),
            None => lines.push(std::mem::take(&mut run)),
        }
    }
    lines.push(run);
}

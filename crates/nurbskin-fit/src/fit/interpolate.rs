//! Interpolation of an m x n grid (Pal & Ballav 2007, sections 3.2 and 3.3).
//!
//! ```text
//! Q_kl = Σ_i N_i(u_k) Σ_j N_j(v_l) P_ij:   B_u C = Q along u,   then  P B_vᵀ = C along v
//! ```
//!
//! Instead of inverting the (mn) x (mn) matrix of basis functions, its Kronecker structure is used: one banded system
//! per direction, factored once, solved for all lines. O(m n) instead of O((m n)³).
//!
//! Source: Pal and Ballav, eq. (10); A9.4, *The NURBS Book*, 2nd ed.

pub(crate) mod collocation;
pub mod parameters;
mod tensor;

use crate::chart::Topology;
use crate::fit::interpolate::collocation::Collocation;
use crate::fit::interpolate::parameters::{
    Parameterization, line_parameters, parameters_u, parameters_v,
};
use glam::DVec3;
use nurbskin_geometry::nurbs::ControlNet;
use nurbskin_geometry::{Error, KnotVector, NurbsCurve, NurbsSurface, PointGrid, Result};
use serde::Serialize;

/// An interpolating surface with the parameters of the grid's lines.
#[derive(Clone, Debug)]
pub struct Interpolation {
    /// The surface: `surface.point(parameters[0][i], parameters[1][j])` is the grid's point (i, j).
    pub surface: NurbsSurface,
    /// Parameters of the columns and of the rows.
    pub parameters: [Vec<f64>; 2],
}

/// A surface through every point of a grid, with parameters from the points. See [`interpolate_at`].
///
/// ```
/// use nurbskin_fit::fit::interpolate::interpolate;
/// use nurbskin_fit::fit::interpolate::parameters::Parameterization;
/// use nurbskin_geometry::{DVec3, PointGrid};
/// use nurbskin_fit::chart::Topology;
/// let grid = PointGrid::from_fn(7, 5, |i, j| DVec3::new(i as f64, j as f64, (i as f64).sin()))?;
/// let fit = interpolate(&grid, Topology::Disk, [3, 3], Parameterization::ChordLength)?;
/// let [u, v] = &fit.parameters;
/// assert!(fit.surface.point(u[2], v[3]).distance(grid.point(2, 3)) < 1e-14);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
///
/// # Errors
/// As [`parameters_u`], [`parameters_v`] and [`interpolate_at`].
pub fn interpolate(
    grid: &PointGrid,
    topology: Topology,
    degree: [usize; 2],
    kind: Parameterization,
) -> Result<Interpolation> {
    let [closed_u, closed_v] = topology.closed();
    let u = parameters_u(grid, closed_u, kind)?;
    let v = parameters_v(grid, closed_v, kind)?;
    let surface = interpolate_at(grid, topology, degree, [&u, &v])?;
    Ok(Interpolation {
        surface,
        parameters: [u, v],
    })
}

/// The surface through every point of a grid at given parameters: `S(u_i, v_j) = Q_{i,j}`.
///
/// A direction with too few lines for its degree gets the highest degree they allow, count - 1. Closed directions are
/// periodic, C^{p-1} across the seam, with period 1. A [`Topology::Sphere`] has a pole at each end of u: the points of
/// the first and of the last column must coincide (to single precision of the bounding box) and become one control
/// point each. O(m n) time for fixed degrees; no memory besides the result grows with m n.
///
/// Source: Pal & Ballav 2007, eq. (10); A9.4, *The NURBS Book*, 2nd ed., p. 380.
///
/// # Errors
/// [`Error::Invalid`] if a direction has fewer than 2 lines (3 where closed), a degree is out of range, the parameters
/// are not one per line and increasing (closed: within one period of length 1), or a pole's points do not coincide;
/// [`Error::NoSolution`] if the system is singular to working precision or the control points overflow.
pub fn interpolate_at(
    grid: &PointGrid,
    topology: Topology,
    degree: [usize; 2],
    parameters: [&[f64]; 2],
) -> Result<NurbsSurface> {
    let [closed_u, closed_v] = topology.closed();
    let along_u = Collocation::new(
        grid.count_u(),
        closed_u,
        degree[0],
        parameters[0],
        "columns",
    )?;
    let along_v = Collocation::new(grid.count_v(), closed_v, degree[1], parameters[1], "rows")?;
    let poles = if topology == Topology::Sphere {
        Some(find_poles(grid)?)
    } else {
        None
    };
    through(grid, along_u, along_v, poles)
}

/// The surface on given knots through every point of a grid at given parameters. Knots are clamped; parameters rise,
/// and the k-th lies strictly between knots k and k + p + 1, or at an end (Schoenberg and Whitney: the condition under
/// which there is such a surface). O(m n) for fixed degrees.
///
/// ```
/// use nurbskin_fit::fit::interpolate::interpolate_on;
/// use nurbskin_geometry::{DVec3, KnotVector, PointGrid};
/// let grid = PointGrid::from_fn(5, 5, |i, j| DVec3::new(i as f64, j as f64, (i * j) as f64))?;
/// // Not-a-knot: no knots at the second and the last but one parameter.
/// let knots = KnotVector::new(3, vec![0., 0., 0., 0., 2., 4., 4., 4., 4.])?;
/// let at = [0., 1., 2., 3., 4.];
/// let surface = interpolate_on(&grid, [&knots, &knots], [&at, &at])?;
/// assert!(surface.point(1.0, 3.0).distance(grid.point(1, 3)) < 1e-14);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
///
/// Source: C. de Boor, *A Practical Guide to Splines*, chapter XIII.
///
/// # Errors
/// [`Error::Invalid`] if the counts of lines, parameters and control points differ, or knots are periodic or not
/// clamped; [`Error::NoSolution`] if a parameter is not where it must be, or the control points overflow.
pub fn interpolate_on(
    grid: &PointGrid,
    knots: [&KnotVector; 2],
    parameters: [&[f64]; 2],
) -> Result<NurbsSurface> {
    let along_u = Collocation::on(knots[0], parameters[0], "columns")?;
    let along_v = Collocation::on(knots[1], parameters[1], "rows")?;
    if grid.counts() != [along_u.count, along_v.count] {
        return Err(Error::invalid(format!(
            "these knots need a grid of {} x {} points, not {} x {}",
            along_u.count,
            along_v.count,
            grid.count_u(),
            grid.count_v()
        )));
    }
    through(grid, along_u, along_v, None)
}

/// The surface of two systems, with poles where there are any.
fn through(
    grid: &PointGrid,
    along_u: Collocation,
    along_v: Collocation,
    poles: Option<[DVec3; 2]>,
) -> Result<NurbsSurface> {
    let mut points = vec![[0.0; 3]; along_u.stored() * along_v.stored()];
    tensor::solve_along_u(
        &along_u,
        grid,
        poles,
        along_v.rows_of(&mut points, along_u.stored()),
    );
    let finite = tensor::solve_along_v(&along_v, &mut points, along_u.stored());
    if !finite {
        return Err(overflow());
    }
    if let Some([first, last]) = poles {
        for row in points.chunks_exact_mut(along_u.stored()) {
            row[0] = first.to_array();
            row[along_u.stored() - 1] = last.to_array();
        }
    }
    let net = ControlNet::from_finite(
        along_u.stored(),
        along_v.stored(),
        bytemuck::allocation::cast_vec(points),
    );
    NurbsSurface::new(along_u.knots, along_v.knots, net, None)
}

/// A curve through every point of a line, with parameters from the points. See [`interpolate_curve_at`].
///
/// # Errors
/// As [`line_parameters`] and [`interpolate_curve_at`].
pub fn interpolate_curve(
    points: &[DVec3],
    closed: bool,
    degree: usize,
    kind: Parameterization,
) -> Result<NurbsCurve> {
    interpolate_curve_at(
        points,
        closed,
        degree,
        &line_parameters(points, closed, kind)?,
    )
}

/// The curve through every point of a line at given parameters; degree and closing as in [`interpolate_at`].
///
/// Source: Pal & Ballav 2007, eqs. (4) to (6); A9.1, *The NURBS Book*, 2nd ed., p. 369.
///
/// # Errors
/// As [`interpolate_at`].
pub fn interpolate_curve_at(
    points: &[DVec3],
    closed: bool,
    degree: usize,
    parameters: &[f64],
) -> Result<NurbsCurve> {
    let along = Collocation::new(points.len(), closed, degree, parameters, "points")?;
    let mut control = vec![[0.0; 3]; along.stored()];
    for (target, q) in control[along.shift..].iter_mut().zip(points) {
        *target = q.to_array();
    }
    along.solve_lines(&mut control);
    if control.as_flattened().iter().any(|x| !x.is_finite()) {
        return Err(overflow());
    }
    let control = control.into_iter().map(DVec3::from_array).collect();
    NurbsCurve::new(along.knots, control, None)
}

/// The result of [`choose_parameterization`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Choice {
    /// The better one, `ChordLength` or `Uniform`.
    pub kind: Parameterization,
    /// Root mean square distance of the left-out points, chord-length parameters; infinite where they do not exist.
    pub chord_length: f64,
    /// The same for uniform parameters.
    pub uniform: f64,
}

/// Chord-length or uniform parameters, whichever predicts the grid better: every second line is left out, the rest is
/// interpolated, and the distance of the left-out points from that surface is measured, after two steps from their own
/// parameters towards the foot point, within the neighbouring lines. If no line can be left out, or the figures are
/// equal, it is chord length.
///
/// # Errors
/// As [`interpolate`], if neither works.
pub fn choose_parameterization(
    grid: &PointGrid,
    topology: Topology,
    degree: [usize; 2],
) -> Result<Choice> {
    let closed = topology.closed();
    let keep = [
        every_second(grid.count_u(), closed[0]),
        every_second(grid.count_v(), closed[1]),
    ];
    let coarse = grid.select(&keep[0], &keep[1])?;
    let figure = |kind| -> Result<f64> {
        let parameters = [
            parameters_u(grid, closed[0], kind)?,
            parameters_v(grid, closed[1], kind)?,
        ];
        let kept: [Vec<f64>; 2] =
            [0, 1].map(|d| keep[d].iter().map(|&k| parameters[d][k]).collect());
        let surface = interpolate_at(&coarse, topology, degree, [&kept[0], &kept[1]])?;
        Ok(left_out_deviation(grid, &surface, &keep, &parameters))
    };
    let uniform = figure(Parameterization::Uniform)?;
    let chord_length = figure(Parameterization::ChordLength).unwrap_or(f64::INFINITY);
    let kind = if uniform < chord_length {
        Parameterization::Uniform
    } else {
        Parameterization::ChordLength
    };
    Ok(Choice {
        kind,
        chord_length,
        uniform,
    })
}

/// Indices of every second line; of an open direction both ends, of a closed one at least three.
fn every_second(count: usize, closed: bool) -> Vec<usize> {
    if closed && count < 6 {
        return (0..count).collect();
    }
    let mut keep: Vec<usize> = (0..count).step_by(2).collect();
    if !closed && count.is_multiple_of(2) {
        keep.push(count - 1);
    }
    keep
}

/// Root mean square distance of the points that are not on kept lines of both directions.
fn left_out_deviation(
    grid: &PointGrid,
    surface: &NurbsSurface,
    keep: &[Vec<usize>; 2],
    parameters: &[Vec<f64>; 2],
) -> f64 {
    /// Points of the grid, about, that are compared; larger grids are sampled evenly. Count.
    /// Guard: more do not make the comparison better.
    const MAX_COMPARED_POINTS: usize = 40_000;
    let [m, n] = grid.counts();
    let kept = |d: usize, k: usize| keep[d].binary_search(&k).is_ok();
    // An odd step, so that kept and left-out lines both occur.
    let step = ((m * n) as f64 / MAX_COMPARED_POINTS as f64)
        .sqrt()
        .ceil()
        .max(1.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a small positive whole number"
    )]
    let step = step as usize | 1;
    let (mut sum, mut count) = (0.0, 0usize);
    for j in (0..n).step_by(step) {
        for i in (0..m).step_by(step) {
            if kept(0, i) && kept(1, j) {
                continue;
            }
            let room = [neighbours(&parameters[0], i), neighbours(&parameters[1], j)];
            let at = [parameters[0][i], parameters[1][j]];
            sum += foot_distance_squared(surface, grid.point(i, j), at, room);
            count += 1;
        }
    }
    if count == 0 {
        0.0
    } else {
        (sum / count as f64).sqrt()
    }
}

/// The parameters of the lines before and after line k.
fn neighbours(parameters: &[f64], k: usize) -> [f64; 2] {
    let last = parameters.len() - 1;
    [
        parameters[k.saturating_sub(1)],
        parameters[(k + 1).min(last)],
    ]
}

/// Squared distance after two Gauss-Newton steps towards the foot point within a box of parameters.
fn foot_distance_squared(
    surface: &NurbsSurface,
    point: DVec3,
    mut at: [f64; 2],
    room: [[f64; 2]; 2],
) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..3 {
        let s = surface.derivatives(at[0], at[1]);
        let r = point - s.point;
        best = best.min(r.length_squared());
        let (a, b, c) = (s.du.length_squared(), s.du.dot(s.dv), s.dv.length_squared());
        let (f, g) = (r.dot(s.du), r.dot(s.dv));
        let determinant = a * c - b * b;
        if determinant <= 0.0 {
            break;
        }
        let step = [(c * f - b * g) / determinant, (a * g - b * f) / determinant];
        for d in 0..2 {
            at[d] = (at[d] + step[d]).clamp(room[d][0], room[d][1]);
        }
    }
    best
}

/// The two poles of a sphere-like grid: the means of its first and of its last column.
fn find_poles(grid: &PointGrid) -> Result<[DVec3; 2]> {
    let [lo, hi] = grid.bounding_box();
    // Resolution of single-precision coordinates.
    let tolerance = f64::from(f32::EPSILON) * lo.distance(hi);
    let pole = |i: usize, which: &str| {
        let mean = grid.column(i).sum::<DVec3>() / grid.count_v() as f64;
        let spread = grid.column(i).fold(0.0_f64, |m, q| m.max(q.distance(mean)));
        if spread <= tolerance {
            Ok(mean)
        } else {
            Err(Error::invalid(format!(
                "the {which} column of a sphere must be one pole point, but its points are up to {spread:.3e} from \
                 their mean: repeat the pole in every row, or use the topology tube"
            )))
        }
    };
    Ok([pole(0, "first")?, pole(grid.count_u() - 1, "last")?])
}

fn overflow() -> Error {
    Error::NoSolution(
        "the control points overflow: the coordinates are too large, or lines too close to each other".into(),
    )
}

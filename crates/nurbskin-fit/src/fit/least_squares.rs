//! The least squares surface on given knots, from points that need not fit into one memory.
//!
//! A surface on given knots needs only sums per cell of the knots from its points, whose number does not depend on that
//! of the points. So chunks of a scan can be read one after the other, or summed by several processes, and the sums
//! added. Finally the surface is solved for once:
//!
//! ```text
//! (Σ w N Nᵀ / Σ w + λ R) P = Σ w N X / Σ w,   N the tensor product basis, R the thin-plate form
//! ```
//!
//! Source: the normal equations of *The NURBS Book*, 2nd ed., section 9.4.1, for surfaces and without fixed ends; the
//! thin-plate energy of [`fairness`].

mod cell_moments;
mod chebyshev;
mod empty_cells;
pub mod fairness;
pub(crate) mod foot_points;
pub(crate) mod normal_equations;
pub(crate) mod robust;
pub(crate) mod samples;
pub(crate) mod spline_space;
mod system;

use crate::fit::least_squares::cell_moments::Moments;
use crate::fit::least_squares::chebyshev::Pieces;
use crate::fit::least_squares::fairness::Energies;
use crate::fit::least_squares::samples::CHUNK_POINTS;
use crate::fit::least_squares::spline_space::{Numbering, SpanTable};
use crate::fit::least_squares::system::Equations;
use nurbskin_geometry::numeric::parallel::{each, each_light};
use nurbskin_geometry::nurbs::{ControlNet, KnotVector, NurbsSurface};
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::{DVec2, DVec3, Error, Result};
use rayon::prelude::*;

/// Points that are sorted by cells together. Count.
/// Guard: bounds the memory that adding takes to a few MB.
const BLOCK_POINTS: usize = 1 << 16;
/// Numbers stored after those of the cells. Count.
/// Derived: two, the count of the points and `sum w |X - origin|^2`.
const EXTRA_SUMS: usize = 2;
/// Most numbers of the sums. Count.
/// Guard: 8 GB.
const MAX_SUMS: usize = 1 << 30;
/// Error of the solution of equations with a known solution, from which on they count as undetermined. Dimensionless,
/// for coordinates up to 1.
/// Guard: undetermined equations have about 1, those of a bicubic surface through well spread points 1e-13.
const MAX_SOLUTION_ERROR: f64 = 1e-6;
/// Rounding of mean squares, in units of their last place.
/// Guard: what sums over blocks of points leave, with some room.
const SUM_ROUNDING_ULPS: f64 = 256.0;
/// Rounding of a point of a surface, in units of the last place of the largest coordinate.
/// Guard: the steps of an evaluation, with some room.
const EVALUATION_ULPS: f64 = 8.0;

/// The sums over points that determine a least squares surface on given knots; they add up over any chunks of the
/// points.
///
/// For degrees p and q a cell of the knots takes about (2p + 1)(2q + 4) + 3 (p + 1)(q + 4) numbers, 832 bytes if
/// bicubic. Sums over the same points in other chunks differ by rounding only; those over the same chunks in the same
/// order not at all, whatever the number of threads.
///
/// ```
/// use nurbskin_fit::fit::least_squares::NormalSums;
/// use nurbskin_geometry::{DVec2, DVec3, KnotVector};
/// let knots = KnotVector::uniform(3, 8)?;
/// let middle = DVec3::new(5e5, 4e6, 100.0);
/// let mut all = NormalSums::new(knots.clone(), knots.clone(), middle)?;
/// for chunk in 0..10 {
///     let parameters: Vec<DVec2> = (0..400)
///         .map(|k| DVec2::new(f64::from(k % 20) / 19.0, f64::from(chunk + 10 * (k / 20)) / 199.0))
///         .collect();
///     let height = |t: &DVec2| (3.0 * t.x).sin() * t.y;
///     let points: Vec<DVec3> =
///         parameters.iter().map(|t| middle + DVec3::new(10.0 * t.x, 10.0 * t.y, height(t))).collect();
///     // Elsewhere, perhaps: what travels are `some.values()`.
///     let mut some = NormalSums::new(knots.clone(), knots.clone(), middle)?;
///     some.add(&points, &parameters, None)?;
///     all.merge(&some)?;
/// }
/// let fit = all.solve(0.0, [10.0, 10.0])?;
/// assert_eq!(all.count(), 4000);
/// assert!(fit.rms < 1e-3);
/// assert!((fit.surface.point(0.5, 1.0).z - (100.0 + 1.5_f64.sin())).abs() < 1e-3);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct NormalSums {
    knots: [KnotVector; 2],
    breaks: [Vec<f64>; 2],
    tables: [SpanTable; 2],
    pieces: [Pieces; 2],
    origin: DVec3,
    moments: Moments,
}

/// A least-squares surface and how well it and its equations are fulfilled.
#[derive(Clone, Debug)]
pub struct LeastSquares {
    /// The surface on the caller's knots.
    pub surface: NurbsSurface,
    /// Root mean square of the distances `|X - S(u, v)|` with their weights, in the unit of the points.
    pub rms: f64,
    /// Resolution of `rms` by rounding: a smaller value is only known to be no larger. From sums, of which `rms` is a
    /// difference, some 2e-7 of the distance of the points from the origin of the sums; from points in memory some
    /// 1e-15 of their coordinates.
    pub rms_resolution: f64,
    /// Residual of the normal equations, relative to their right-hand side.
    pub equation_residual: f64,
}

impl NormalSums {
    /// Empty sums on these knot vectors: clamped, unclamped or periodic in each direction, on any domain, of any
    /// degrees and multiplicities. Coordinates are summed up relative to `origin`, a point near the scan and the same
    /// for all of its chunks, so that those of far-off scans keep their digits. Domains do not: one that is k of its
    /// lengths away from zero gives a surface that is right to about k 1e-16 of its size.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the origin is not finite or the sums would take more than 8 GB.
    pub fn new(knots_u: KnotVector, knots_v: KnotVector, origin: DVec3) -> Result<Self> {
        let length = length(&knots_u, &knots_v)?;
        Self::with(knots_u, knots_v, origin, vec![0.0; length])
    }

    /// The sums that [`NormalSums::values`] gave, on the same knots with the same origin.
    ///
    /// # Errors
    /// As [`NormalSums::new`]; [`Error::Invalid`] if there are not as many values as these knots have sums, or one of
    /// them cannot be a sum: not finite, or a negative count or weight.
    pub fn from_values(
        knots_u: KnotVector,
        knots_v: KnotVector,
        origin: DVec3,
        values: Vec<f64>,
    ) -> Result<Self> {
        let length = length(&knots_u, &knots_v)?;
        if values.len() != length {
            return Err(Error::invalid(format!(
                "{} values cannot be sums on these knots, which have {length}: give the knots they were made with",
                values.len()
            )));
        }
        if let Some(k) = values.iter().position(|x| !x.is_finite()) {
            return Err(Error::invalid(format!(
                "value {k} of the sums is not finite"
            )));
        }
        let this = Self::with(knots_u, knots_v, origin, values)?;
        let cells = this.pieces[0].len() * this.pieces[1].len();
        let negative = |x: f64| x < 0.0;
        if this.extra().into_iter().any(negative)
            || (0..cells).any(|cell| negative(this.moments.weight(cell)))
        {
            return Err(Error::invalid(
                "the values are no sums: they have a negative count or weight",
            ));
        }
        Ok(this)
    }

    fn with(
        knots_u: KnotVector,
        knots_v: KnotVector,
        origin: DVec3,
        sums: Vec<f64>,
    ) -> Result<Self> {
        if !origin.is_finite() {
            return Err(Error::invalid("the origin of the sums is not finite"));
        }
        let knots = [knots_u, knots_v];
        let breaks = knots.each_ref().map(KnotVector::breakpoints);
        Ok(Self {
            tables: breaks.each_ref().map(|b| SpanTable::new(b)),
            pieces: knots.each_ref().map(Pieces::new),
            moments: Moments::from_sums(knots.each_ref().map(KnotVector::degree), sums),
            breaks,
            knots,
            origin,
        })
    }

    /// Adds points with their parameters, inside the domain of the knots also where that is periodic, and weights, all
    /// 1 where none are given; a point of weight 0 is counted but has no effect. O(n (p + 1)(q + 1)) for n points;
    /// takes a few MB whatever their number.
    ///
    /// # Errors
    /// [`Error::Invalid`] if counts disagree, a number is not finite, a weight is negative or parameters lie outside
    /// the domain; then no point was added.
    pub fn add(
        &mut self,
        points: &[DVec3],
        parameters: &[DVec2],
        weights: Option<&[f64]>,
    ) -> Result<()> {
        self.check(points, parameters, weights)?;
        for from in (0..points.len()).step_by(BLOCK_POINTS) {
            let block = from..points.len().min(from + BLOCK_POINTS);
            let weights = weights.map(|w| &w[block.clone()]);
            self.add_block(&points[block.clone()], &parameters[block], weights);
        }
        Ok(())
    }

    /// Rejects invalid points.
    fn check(&self, points: &[DVec3], parameters: &[DVec2], weights: Option<&[f64]>) -> Result<()> {
        if points.len() != parameters.len() {
            return Err(Error::invalid(format!(
                "{} points come with {} parameters: each point needs one pair",
                points.len(),
                parameters.len()
            )));
        }
        if let Some(weights) = weights {
            if points.len() != weights.len() {
                return Err(Error::invalid(format!(
                    "{} points come with {} weights: each point needs one, or none has any",
                    points.len(),
                    weights.len()
                )));
            }
            if let Some(k) = weights.iter().position(|w| !(w.is_finite() && *w >= 0.0)) {
                return Err(Error::invalid(format!(
                    "the weight of point {k} is {}: weights must not be negative",
                    weights[k]
                )));
            }
        }
        if let Some(k) = points.iter().position(|p| !p.is_finite()) {
            return Err(Error::invalid(format!("point {k} is not finite")));
        }
        let [(u0, u1), (v0, v1)] = self.knots.each_ref().map(KnotVector::domain);
        let inside = |t: &DVec2| (u0..=u1).contains(&t.x) && (v0..=v1).contains(&t.y);
        if let Some(k) = parameters.iter().position(|t| !inside(t)) {
            return Err(Error::invalid(format!(
                "the parameters ({}, {}) of point {k} lie outside the domain {u0}..{u1} x {v0}..{v1} of the knots",
                parameters[k].x, parameters[k].y
            )));
        }
        Ok(())
    }

    /// Adds one block of points, sorted by cells.
    fn add_block(&mut self, points: &[DVec3], parameters: &[DVec2], weights: Option<&[f64]>) {
        let (origin, columns) = (self.origin, self.pieces[0].len());
        let weight = |k: usize| weights.map_or(1.0, |w| w[k]);
        let (breaks, tables) = (&self.breaks, &self.tables);
        let mut keys = each_light(points.len(), |k| {
            let a = tables[0].find(&breaks[0], parameters[k].x);
            let b = tables[1].find(&breaks[1], parameters[k].y);
            (((b * columns + a) as u64) << 32) | k as u64
        });
        // Points mostly come line by line, in runs of one cell.
        keys.par_sort_unstable();
        self.moments.add(&self.pieces, &keys, |k| {
            (weight(k), parameters[k], points[k] - origin)
        });
        let squares = each(points.len().div_ceil(CHUNK_POINTS), |part| {
            let part = part * CHUNK_POINTS..points.len().min((part + 1) * CHUNK_POINTS);
            part.map(|k| weight(k) * points[k].distance_squared(origin))
                .sum::<f64>()
        });
        let sums = self.moments.sums_mut();
        let first = sums.len() - EXTRA_SUMS;
        sums[first] += points.len() as f64;
        sums[first + 1] += squares.iter().sum::<f64>();
    }

    /// Adds the sums of other points on the same knots with the same origin. O(cells).
    ///
    /// # Errors
    /// [`Error::Invalid`] if knots or origin differ; then nothing was added.
    pub fn merge(&mut self, other: &Self) -> Result<()> {
        if self.knots != other.knots {
            return Err(Error::invalid(
                "sums on different knots cannot be added: all chunks need the same knots",
            ));
        }
        if self.origin != other.origin {
            return Err(Error::invalid(format!(
                "sums relative to different origins, {} and {}, cannot be added: all chunks need the same",
                self.origin, other.origin
            )));
        }
        let sums = self.moments.sums_mut().iter_mut();
        sums.zip(other.values()).for_each(|(a, b)| *a += b);
        Ok(())
    }

    /// Number of points that were added, those of weight 0 included.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a count, exact up to 2^53 points"
    )]
    pub fn count(&self) -> u64 {
        self.extra()[0] as u64
    }
    /// Sum of their weights.
    #[must_use]
    pub fn weight(&self) -> f64 {
        let cells = self.pieces[0].len() * self.pieces[1].len();
        (0..cells).map(|cell| self.moments.weight(cell)).sum()
    }
    /// The knot vectors along u and v.
    #[must_use]
    pub fn knots(&self) -> &[KnotVector; 2] {
        &self.knots
    }
    /// The origin of the coordinates.
    #[must_use]
    pub fn origin(&self) -> DVec3 {
        self.origin
    }
    /// The raw sums, which may be added number by number to those of other points on the same knots with the same
    /// origin, and taken back by [`NormalSums::from_values`]: cell by cell, u fastest, then the count and `sum w |X -
    /// origin|^2`. How the numbers of a cell are arranged may change with the version.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        self.moments.sums()
    }
    fn extra(&self) -> [f64; EXTRA_SUMS] {
        let values = self.values();
        [values[values.len() - 2], values[values.len() - 1]]
    }

    /// The surface that minimises `sum w |X - S(u, v)|^2 / sum w + smoothing E(S)`, where E is the thin-plate energy of
    /// [`fairness`] for a domain that stands for `size[0]` x `size[1]` lengths in the unit of the points.
    ///
    /// `smoothing` is a length to the fourth power: features shorter than about its fourth root are smoothed away. With
    /// 0 the surface is that of plain least squares and `size` has no effect. O(N w^2) for N control points in a band
    /// w, and 16 N w bytes.
    ///
    /// Normal equations square the condition of the basis, which grows with the degrees: of the 16 digits about (p + q)
    /// / 2 are lost, and surfaces of degree 12 in both directions are refused.
    ///
    /// # Errors
    /// [`Error::Invalid`] if `smoothing` is negative or not finite, a size is not positive, or the equations would take
    /// more than 8 GB; [`Error::NoSolution`] if the points do not determine the surface: without smoothing where
    /// control points have none in their reach, with it where all lie on one line of the domain.
    pub fn solve(&self, smoothing: f64, size: [f64; 2]) -> Result<LeastSquares> {
        if !(smoothing.is_finite() && smoothing >= 0.0) {
            return Err(Error::invalid(format!(
                "the smoothing is {smoothing}: it must not be negative"
            )));
        }
        if !size.iter().all(|&s| s.is_finite() && s > 0.0) {
            return Err(Error::invalid(format!(
                "the lengths {} x {} of the domain must be positive",
                size[0], size[1]
            )));
        }
        let weight = self.weight();
        if weight <= 0.0 {
            return Err(Error::NoSolution(
                "there is no surface without points: add some of a weight above 0".into(),
            ));
        }
        let numbering = Numbering::new(&self.knots, false);
        let equations = Equations {
            knots: &self.knots,
            numbering: &numbering,
            pieces: &self.pieces,
            moments: &self.moments,
        };
        let plane = equations.plane();
        let energies = (smoothing > 0.0).then(|| Energies::new(&self.knots, size));
        let (matrix, right) = equations.assemble(&plane, |[a, b], _, block| {
            if let Some(energies) = &energies {
                energies.add_cell(a, b, smoothing, 0.0, block);
            }
        })?;
        let n = matrix.order();
        let alone = (0..n).filter(|&i| matrix.entry(i, i) <= 0.0).count();
        if alone > 0 {
            return Err(Error::NoSolution(format!(
                "{alone} of {n} control points have no point in their reach: {}",
                advice(smoothing)
            )));
        }
        let open = || {
            Error::NoSolution(format!(
                "the {} points do not determine the {n} control points: {}",
                self.count(),
                advice(smoothing)
            ))
        };
        let factor = matrix.clone().factor().map_err(|_| open())?;
        // Rounding hides whether a matrix is singular; a product with a known vector that cannot be solved back shows
        // it.
        let known: Vec<DVec3> = (0..n).map(known).collect();
        let mut found = matrix.multiply(&known);
        factor.solve(&mut found);
        let close = |(a, b): (&DVec3, &DVec3)| (*a - *b).abs().max_element() < MAX_SOLUTION_ERROR;
        if !known.iter().zip(&found).all(close) {
            return Err(open());
        }
        let (x, equation_residual) = factor.solve_refined(&matrix, &right);
        let mut net = equations.net(&plane, &x);
        if !net.iter().all(|p| p.is_finite()) {
            return Err(overflow());
        }
        let square = self.extra()[1] / weight;
        let rms = (square + equations.misfit(&net) / weight).max(0.0).sqrt();
        net.iter_mut().for_each(|p| *p += self.origin);
        let [ku, kv] = self.knots.clone();
        let net = ControlNet::new(ku.control_point_count(), kv.control_point_count(), net)?;
        Ok(LeastSquares {
            surface: NurbsSurface::new(ku, kv, net, None)?,
            rms,
            rms_resolution: (SUM_ROUNDING_ULPS * f64::EPSILON * square).sqrt(),
            equation_residual,
        })
    }
}

/// Length of the sums on these knots.
fn length(knots_u: &KnotVector, knots_v: &KnotVector) -> Result<usize> {
    let knots = [knots_u, knots_v];
    let [columns, rows] = knots.map(|k| k.breakpoints().len() - 1);
    let cells = columns.checked_mul(rows);
    let length = cells.and_then(|c| c.checked_mul(Moments::size(knots.map(|k| k.degree()))));
    length
        .filter(|&n| n <= MAX_SUMS - EXTRA_SUMS)
        .map(|n| n + EXTRA_SUMS)
        .ok_or_else(|| {
            Error::invalid(format!(
                "the sums of {columns} x {rows} spans would take more than 8 GB: give fewer knots"
            ))
        })
}

fn overflow() -> Error {
    Error::NoSolution("the surface overflows: give coordinates and weights of moderate size".into())
}

/// A remedy where points do not determine a surface.
fn advice(smoothing: f64) -> &'static str {
    if smoothing > 0.0 {
        "give points that are spread over the domain, fewer knots, or more smoothing"
    } else {
        "give points everywhere, fewer knots, or a smoothing above 0"
    }
}

/// Coordinates from -1 to 1 with a component in every direction: fractional parts of multiples of irrational numbers.
fn known(i: usize) -> DVec3 {
    let steps = DVec3::new(
        std::f64::consts::SQRT_2,
        std::f64::consts::E,
        std::f64::consts::PI,
    );
    2.0 * ((i + 1) as f64 * steps).fract() - 1.0
}

/// The surface of [`NormalSums::solve`] for points that fit into memory, in one call.
///
/// # Errors
/// As [`NormalSums::new`], [`NormalSums::add`] and [`NormalSums::solve`].
pub fn least_squares(
    points: &[DVec3],
    parameters: &[DVec2],
    weights: Option<&[f64]>,
    knots_u: KnotVector,
    knots_v: KnotVector,
    smoothing: f64,
    size: [f64; 2],
) -> Result<LeastSquares> {
    let [lo, hi] = bounding_box(points);
    let middle = 0.5 * lo + 0.5 * hi;
    // A box without a finite centre is rejected, with the number of the point, when points are added.
    let origin = if middle.is_finite() {
        middle
    } else {
        DVec3::ZERO
    };
    let mut sums = NormalSums::new(knots_u, knots_v, origin)?;
    sums.add(points, parameters, weights)?;
    let found = sums.solve(smoothing, size)?;
    // The points are in memory: their residuals are more accurate than differences of sums.
    let surface = &found.surface;
    let squares = each(points.len().div_ceil(CHUNK_POINTS), |part| {
        let part = part * CHUNK_POINTS..points.len().min((part + 1) * CHUNK_POINTS);
        part.map(|k| {
            let at = surface.point(parameters[k].x, parameters[k].y);
            weights.map_or(1.0, |w| w[k]) * points[k].distance_squared(at)
        })
        .sum::<f64>()
    });
    let rms = (squares.iter().sum::<f64>() / sums.weight()).sqrt();
    if !rms.is_finite() {
        return Err(overflow());
    }
    let largest = lo.abs().max(hi.abs()).max_element();
    Ok(LeastSquares {
        rms,
        rms_resolution: EVALUATION_ULPS * f64::EPSILON * largest,
        ..found
    })
}

#[cfg(test)]
mod tests;

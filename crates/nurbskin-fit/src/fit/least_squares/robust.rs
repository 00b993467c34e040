//! Noise and outliers from neighbourhoods in the domain.
//!
//! ```text
//! w = (1 - y²)²,   y = |d - median of neighbourhood| / (8 s),   s = max(1.4826 MAD, rms of the medians)
//! ```
//!
//! A point is judged by its residual about the median of its neighbourhood of some 20 points, so that a feature which
//! the surface does not follow yet is no outlier. The scale s is annealed: wide while whole neighbourhoods lie off the
//! surface, it shrinks to the noise on its own. Isolated points have no neighbourhood; they are excluded from the first
//! fit, and later count as far as they agree with it or with each other.
//!
//! Source: Tukey's biweight (A. E. Beaton and J. W. Tukey, 1974); local medians and the annealed scale are ours.

use super::samples::{CHUNK_POINTS, Cells, Residual, Samples, cell_number};
use crate::chart::Topology;
use nurbskin_geometry::numeric::parallel::{each, each_light};
use nurbskin_geometry::numeric::statistics::{
    SIGMA_PER_MAD, median_in_place, quantile_in_place, robust_sigma,
};
use nurbskin_geometry::{DVec2, DVec3};

/// Mean number of points of a neighbourhood. Count.
/// Trial: not recorded. A median of fewer is noisy, one of more smooths features away.
const NEIGHBOURHOOD_POINTS: usize = 20;
/// Distance from the median of the neighbourhood at which a point has no weight, in annealed scales.
/// Trial: in prototypes on simulated clouds with outliers, with the annealed scale; with a fixed scale an eye socket of
/// the face was rejected.
const REJECTION_SIGMAS: f64 = 8.0;
/// Distance, in annealed scales, above which a point is compared with its nearest points.
/// Guard: compares few points; one normal error in 370 exceeds it.
const SUSPICION_SIGMAS: f64 = 3.0;
/// Nearest points in the domain that a suspicious or lonely point is compared with. Count.
/// Trial: not recorded. The first ring of a hexagonal grid has as many.
const NEAREST_POINTS: usize = 6;

/// Most of the nearest points that must lie off like a point for it to count. Count.
/// Derived: more than half of the six nearest.
const MAX_WITNESSES: usize = 4;
/// Least number of them. Count.
/// Guard: two outliers side by side are not rare.
const MIN_WITNESSES: usize = 2;
/// Expected number of outliers that have enough others beside them by chance.
/// Guard: small enough that it hardly happens in a scan.
const FALSE_WITNESS_CHANCE: f64 = 0.01;

/// Points of a neighbourhood below which these are lonely. Count.
/// Trial: not recorded.
const MIN_NEIGHBOURHOOD_POINTS: usize = 6;
/// Share of lonely points above which none counts as lonely. Dimensionless.
/// Trial: not recorded. Of more, the scan is uneven and they are no outliers.
const MAX_LONELY_SHARE: f64 = 0.1;
/// Neighbourhoods in each direction among which a lonely point is compared. Count.
/// Trial: not recorded.
const LONELY_REACH: usize = 3;
/// Fewest points there for the comparison; else a lonely point is compared with the surface. Count.
/// Guard: the spread of fewer is unknown.
const MIN_LONELY_NEIGHBOURS: usize = 4;
/// Neighbourhoods of a parallel job. Count.
/// Guard: fixed, so that sums do not depend on the number of threads.
const JOB_NEIGHBOURHOODS: usize = 256;
/// Neighbourhoods, about, from which the scale is taken. Count.
/// Derived: its standard error from 80 000 points is then 0.3 %.
const SCALE_NEIGHBOURHOODS: usize = 4096;
/// Neighbourhoods, about, from which the noise is estimated before there is a surface. Count.
/// Guard: bounds the time; the standard error of the quantile is far below its bias.
const NOISE_NEIGHBOURHOODS: usize = 4096;
/// Quantile of the deviations of the neighbourhoods that gives the noise. Share of the neighbourhoods.
/// Guard: up to nine in ten may hold outliers or edges without harm.
const NOISE_QUANTILE: f64 = 0.1;
/// Lower decile of the standard deviation about a quadratic of 20 normal errors, in sigma.
/// Derived: of the chi distribution with 20 - 6 degrees of freedom, over the root of 14.
const NOISE_QUANTILE_SIGMAS: f64 = 0.746;
/// Fewest points of a neighbourhood to which a quadratic is fitted. Count.
/// Derived: twice its six terms.
const MIN_QUADRATIC_POINTS: usize = 12;
/// Pivot per point, in coordinates -1..=1, up to which the points do not determine a quadratic.
/// Guard: above rounding.
const MIN_PIVOT: f64 = 1e-9;
/// Most neighbourhoods along a direction. Count.
/// Guard: bounds the memory for extreme ratios of the sides.
const MAX_NEIGHBOURHOODS_ALONG: f64 = 65536.0;

/// The domain cut into neighbourhoods of about 20 points, as square as the chart's lengths allow.
#[derive(Debug)]
pub(crate) struct Neighbourhoods {
    cells: Cells,
    of_sample: Vec<u32>,
    counts: [usize; 2],
    /// For each column along u, the number of cells along v that form one neighbourhood. More than one towards poles,
    /// where columns shrink and hold fewer points.
    strides: Vec<usize>,
    size: [f64; 2],
    /// Number of points below which a neighbourhood is lonely.
    fewest: usize,
}

/// Weights and scale from the residuals.
#[derive(Clone, Debug)]
pub(crate) struct Judgement {
    /// Weight of each sample, 0 = outlier.
    pub(crate) weights: Vec<f64>,
    /// Standard deviation of residuals about the median of their neighbourhood.
    pub(crate) sigma: f64,
}

/// Medians and spread of the residuals of some neighbourhoods.
#[derive(Debug, Default)]
struct Medians {
    medians: Vec<f64>,
    /// Distances from the median.
    spread: Vec<f64>,
    /// Sum of squared medians, and number of points.
    squares: f64,
    judged: f64,
}

impl Neighbourhoods {
    pub(crate) fn new(samples: &Samples, size: [f64; 2], topology: Topology) -> Self {
        let measured = samples.measured();
        let wanted = (measured as f64 / NEIGHBOURHOOD_POINTS as f64).max(1.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to 1..=65536"
        )]
        let count = |ratio: f64| {
            (wanted * ratio)
                .sqrt()
                .clamp(1.0, wanted.min(MAX_NEIGHBOURHOODS_ALONG))
                .round() as usize
        };
        let counts = [count(size[0] / size[1]), count(size[1] / size[0])];
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "parameters lie in 0..=1"
        )]
        let place = |t: f64, n: usize| ((t * n as f64) as usize).min(n - 1);
        let mut strides = vec![1; counts[0]];
        if topology == Topology::Sphere {
            let mut held = vec![0_usize; counts[0]];
            for k in (0..samples.len()).filter(|&k| !samples.is_support(k)) {
                held[place(samples.parameters[k].x, counts[0])] += 1;
            }
            for (stride, held) in strides.iter_mut().zip(held) {
                *stride = counts[1].div_ceil((held / NEIGHBOURHOOD_POINTS).max(1));
            }
        }
        // Support points belong to no neighbourhood: their cell is the one after the last.
        let last = counts[0] * counts[1];
        let of_sample = each_light(samples.len(), |k| {
            if samples.is_support(k) {
                return cell_number(last);
            }
            let t = samples.parameters[k];
            let (a, b) = (place(t.x, counts[0]), place(t.y, counts[1]));
            cell_number(a + counts[0] * (b - b % strides[a]))
        });
        let cells = Cells::new(last + 1, &of_sample);
        let held = (0..last).map(|c| cells.samples(c).len());
        let lonely: usize = held.filter(|&n| n < MIN_NEIGHBOURHOOD_POINTS).sum();
        let few = lonely as f64 <= MAX_LONELY_SHARE * measured as f64;
        Self {
            cells,
            of_sample,
            counts,
            strides,
            size,
            fewest: if few { MIN_NEIGHBOURHOOD_POINTS } else { 1 },
        }
    }

    /// Number of neighbourhoods.
    fn len(&self) -> usize {
        self.counts[0] * self.counts[1]
    }

    fn is_support(&self, k: usize) -> bool {
        self.of_sample[k] as usize == self.len()
    }

    fn is_lonely(&self, cell: usize) -> bool {
        self.cells.samples(cell).len() < self.fewest
    }

    /// Whether no other sample in the neighbourhood of `k` is `far` off; several of them are a feature that the surface
    /// misses.
    pub(crate) fn is_alone(&self, k: usize, far: impl Fn(usize) -> bool) -> bool {
        let members = self.cells.samples(self.of_sample[k] as usize);
        members.iter().all(|&j| j as usize == k || !far(j as usize))
    }

    /// Weights before there is a surface: 1, and 0 for lonely points and support.
    pub(crate) fn first_weights(&self) -> Vec<f64> {
        each_light(self.of_sample.len(), |k| {
            if self.is_support(k) {
                return 0.0;
            }
            f64::from(u8::from(!self.is_lonely(self.of_sample[k] as usize)))
        })
    }

    /// Weights of all samples; support points get none.
    ///
    /// Tukey's biweight of each sample's residual about the median of its neighbourhood, with the annealed scale, at
    /// least `floor`, which is above zero for exact points and vertices of a mesh. O(n).
    pub(crate) fn judge(&self, samples: &Samples, residuals: &[Residual], floor: f64) -> Judgement {
        // 1. Medians of all neighbourhoods, and the spread of an even subset, which suffices for the scale.
        let every = self.len().div_ceil(SCALE_NEIGHBOURHOODS);
        let groups = self.len().div_ceil(JOB_NEIGHBOURHOODS);
        let groups = each(groups, |group| {
            let cells =
                group * JOB_NEIGHBOURHOODS..((group + 1) * JOB_NEIGHBOURHOODS).min(self.len());
            self.group(cells, every, residuals)
        });
        let (mut squares, mut judged) = (0.0, 0.0_f64);
        let mut medians = Vec::with_capacity(self.len());
        let mut spread = Vec::new();
        for group in &groups {
            medians.extend_from_slice(&group.medians);
            spread.extend_from_slice(&group.spread);
            squares += group.squares;
            judged += group.judged;
        }
        drop(groups);
        let sigma = if spread.is_empty() {
            0.0
        } else {
            SIGMA_PER_MAD * median_in_place(&mut spread)
        };
        // 2. The scale, and how many lie beyond it.
        let scale = sigma.max((squares / judged.max(1.0)).sqrt()).max(floor);
        let off = |k: usize| residuals[k].signed - medians[self.of_sample[k] as usize];
        let n = residuals.len();
        let far: usize = each(n.div_ceil(CHUNK_POINTS), |block| {
            let samples = block * CHUNK_POINTS..((block + 1) * CHUNK_POINTS).min(n);
            samples
                .filter(|&k| !self.is_support(k) && off(k).abs() > REJECTION_SIGMAS * scale)
                .count()
        })
        .into_iter()
        .sum();
        let witnesses = witnesses(far, n);
        // 3. The weights. Exact points, and vertices of a mesh, have few outliers: while whole neighbourhoods of them
        // lie off the surface, a point that is off by as much belongs to a feature, and counts in full.
        let full = if floor > 0.0 && scale > floor {
            SUSPICION_SIGMAS
        } else {
            0.0
        };
        let weights = each_light(n, |k| {
            if self.is_support(k) {
                return 0.0;
            }
            let Residual {
                signed, distance, ..
            } = residuals[k];
            // The tangential part lies beyond an edge of the surface.
            let beside = (distance * distance - signed * signed).max(0.0);
            let mut x = (off(k).powi(2) + beside).sqrt();
            if self.is_lonely(self.of_sample[k] as usize) {
                let reference = self.lonely_median(samples, residuals, k, SUSPICION_SIGMAS * scale);
                x = ((signed - reference).powi(2) + beside).sqrt();
            } else if x > SUSPICION_SIGMAS * scale {
                // Small features vary within a neighbourhood; an offset that the nearest points share is no outlier.
                let shared = self.shared(samples, residuals, k, witnesses);
                let left = (signed.abs() - shared).max(0.0);
                x = x.min((left * left + beside).sqrt());
            }
            let y = ((x / scale - full) / (REJECTION_SIGMAS - full)).max(0.0);
            if scale <= 0.0 || y < 1.0 {
                let z = if scale > 0.0 { 1.0 - y * y } else { 1.0 };
                z * z
            } else {
                0.0
            }
        });
        Judgement { weights, sigma }
    }

    /// The neighbourhoods at most `reach` away, itself included.
    fn around(&self, cell: usize, reach: usize) -> impl Iterator<Item = usize> {
        let [columns, rows] = self.counts;
        let (a, b) = (cell % columns, cell / columns);
        (a.saturating_sub(reach)..=(a + reach).min(columns - 1)).flat_map(move |near| {
            let stride = self.strides[a].max(self.strides[near]);
            let to = (b + (reach + 1) * stride).min(rows);
            (b.saturating_sub(reach * stride)..to).map(move |b| b * columns + near)
        })
    }

    /// The residuals of the points nearest to point k in the domain, among those up to `reach` neighbourhoods away.
    fn nearest(
        &self,
        samples: &Samples,
        residuals: &[Residual],
        k: usize,
        reach: usize,
    ) -> Vec<f64> {
        let here = samples.parameters[k];
        let mut near: Vec<(f64, u32)> = Vec::with_capacity(9 * NEIGHBOURHOOD_POINTS);
        for cell in self.around(self.of_sample[k] as usize, reach) {
            let others = self.cells.samples(cell).iter();
            near.extend(others.filter(|&&j| j as usize != k).map(|&j| {
                let apart = (samples.parameters[j as usize] - here) * DVec2::from(self.size);
                (apart.length_squared(), j)
            }));
        }
        let n = NEAREST_POINTS.min(near.len());
        if n > 0 {
            near.select_nth_unstable_by(n - 1, |x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        }
        let signed = |&(_, j): &(f64, u32)| residuals[j as usize].signed;
        near[..n].iter().map(signed).collect()
    }

    /// Reference of a lonely point: the median of its nearest points where these agree within `spread`, otherwise the
    /// surface.
    fn lonely_median(
        &self,
        samples: &Samples,
        residuals: &[Residual],
        k: usize,
        spread: f64,
    ) -> f64 {
        let mut values = self.nearest(samples, residuals, k, LONELY_REACH);
        if values.len() < MIN_LONELY_NEIGHBOURS {
            return 0.0;
        }
        let median = median_in_place(&mut values);
        match robust_sigma(&values, median) <= spread {
            true => median,
            false => 0.0,
        }
    }

    /// The medians of some neighbourhoods, and the spread of every `every`-th.
    fn group(
        &self,
        cells: std::ops::Range<usize>,
        every: usize,
        residuals: &[Residual],
    ) -> Medians {
        let mut out = Medians::default();
        let mut values = Vec::new();
        for cell in cells {
            values.clear();
            let signed = |&k: &u32| residuals[k as usize].signed;
            let samples = self.cells.samples(cell);
            // Lonely points are excluded from medians and spread.
            if samples.is_empty() || self.is_lonely(cell) {
                out.medians.push(0.0);
                continue;
            }
            values.extend(samples.iter().map(signed));
            let middle = values.len() / 2;
            let median = *values.select_nth_unstable_by(middle, f64::total_cmp).1;
            if cell.is_multiple_of(every) {
                // The median itself has distance zero and is excluded from the spread.
                let others = values[..middle].iter().chain(&values[middle + 1..]);
                out.spread.extend(others.map(|x| (x - median).abs()));
            }
            out.squares += values.len() as f64 * median * median;
            out.judged += values.len() as f64;
            out.medians.push(median);
        }
        out
    }

    /// The distance that at least `witnesses` of the nearest points in the domain reach, on the same side of the
    /// surface.
    fn shared(&self, samples: &Samples, residuals: &[Residual], k: usize, witnesses: usize) -> f64 {
        let side = residuals[k].signed.signum();
        let mut values = self.nearest(samples, residuals, k, 1);
        values.iter_mut().for_each(|x| *x *= side);
        values.sort_by(|x, y| y.total_cmp(x));
        values.get(witnesses - 1).map_or(0.0, |v| v.max(0.0))
    }

    /// Noise of the points across the surface, before there is a surface: residuals about a quadratic in (u, v) per
    /// neighbourhood. Zero if no neighbourhood has enough points.
    ///
    /// Nine of ten neighbourhoods may hold outliers or edges without harm: the lower decile over the neighbourhoods is
    /// taken, scaled as for normal noise.
    pub(crate) fn noise(&self, samples: &Samples) -> f64 {
        let every = self.len().div_ceil(NOISE_NEIGHBOURHOODS);
        let sigmas = each(self.len().div_ceil(every), |k| {
            quadratic_noise(samples, self.cells.samples(k * every))
        });
        let mut sigmas: Vec<f64> = sigmas.into_iter().flatten().collect();
        if sigmas.is_empty() {
            return 0.0;
        }
        quantile_in_place(&mut sigmas, NOISE_QUANTILE) / NOISE_QUANTILE_SIGMAS
    }
}

/// Number of the nearest points that must lie off like a point for it to count: large enough that among `far` outliers
/// of `n` points as many coincide on one side by chance with probability below [`FALSE_WITNESS_CHANCE`].
fn witnesses(far: usize, n: usize) -> usize {
    let far = far as f64;
    let beside = 0.5 * far / n.max(1) as f64;
    let mut ways = 1.0;
    let mut chance = 1.0;
    for k in 1..MAX_WITNESSES {
        ways *= (NEAREST_POINTS - k + 1) as f64 / k as f64;
        chance *= beside;
        if k >= MIN_WITNESSES && far * ways * chance < FALSE_WITNESS_CHANCE {
            return k;
        }
    }
    MAX_WITNESSES
}

/// Standard deviation across the surface about the best quadratic (u, v) -> X of these samples; `None` for fewer than
/// 12 or where they do not determine it.
fn quadratic_noise(samples: &Samples, members: &[u32]) -> Option<f64> {
    /// Terms of a quadratic in (u, v). Count.
    /// Derived: 1, u, v, u^2, u v, v^2.
    const QUADRATIC_TERMS: usize = 6;
    let n = members.len();
    if n < MIN_QUADRATIC_POINTS {
        return None;
    }
    let at = |k: u32| samples.parameters[k as usize];
    let (mut lo, mut hi) = (at(members[0]), at(members[0]));
    for &k in members {
        lo = lo.min(at(k));
        hi = hi.max(at(k));
    }
    let (middle, half) = (0.5 * (lo + hi), 0.5 * (hi - lo));
    if half.min_element() <= 0.0 {
        return None;
    }
    let terms = |k: u32| {
        let t = (at(k) - middle) / half;
        [1.0, t.x, t.y, t.x * t.x, t.x * t.y, t.y * t.y]
    };
    let mut a = [[0.0; QUADRATIC_TERMS]; QUADRATIC_TERMS];
    let mut b = [DVec3::ZERO; QUADRATIC_TERMS];
    for &k in members {
        let f = terms(k);
        for i in 0..QUADRATIC_TERMS {
            for j in 0..QUADRATIC_TERMS {
                a[i][j] += f[i] * f[j];
            }
            b[i] += f[i] * samples.points[k as usize];
        }
    }
    // Gaussian elimination of a symmetric positive definite system needs no pivoting.
    for i in 0..QUADRATIC_TERMS {
        if a[i][i] <= MIN_PIVOT * n as f64 {
            return None;
        }
        for r in i + 1..QUADRATIC_TERMS {
            let factor = a[r][i] / a[i][i];
            let (upper, lower) = a.split_at_mut(r);
            for (x, y) in lower[0][i..].iter_mut().zip(&upper[i][i..]) {
                *x -= factor * y;
            }
            let (upper, lower) = b.split_at_mut(r);
            lower[0] -= factor * upper[i];
        }
    }
    for i in (0..QUADRATIC_TERMS).rev() {
        let (upper, lower) = b.split_at_mut(i + 1);
        for (&x, &y) in a[i][i + 1..].iter().zip(&*lower) {
            upper[i] -= x * y;
        }
        b[i] /= a[i][i];
    }
    let normal = b[1].cross(b[2]).try_normalize()?;
    let squares: f64 = members
        .iter()
        .map(|&k| {
            let model = terms(k)
                .iter()
                .zip(&b)
                .fold(DVec3::ZERO, |s, (&f, &c)| s + f * c);
            let r = (samples.points[k as usize] - model).dot(normal);
            r * r
        })
        .sum();
    Some((squares / (n - QUADRATIC_TERMS) as f64).sqrt())
}

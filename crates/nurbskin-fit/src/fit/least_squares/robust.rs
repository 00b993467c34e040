//! Noise and outliers: what the points of a small neighbourhood in the domain say about each other.
//!
//! A point is judged by its residual minus the median of its neighbourhood, so that a feature which the surface does
//! not follow yet is never taken for an outlier; the scale is annealed: it is wide while neighbourhoods as a whole lie
//! off the surface and shrinks to the noise on its own.
//!
//! Points far from all others, as outliers beyond the edge of a scan, have no neighbourhood to speak of; the surface
//! would follow them. They take no part in the first fit, and later as far as they agree with it or with each other.

use super::samples::{CHUNK, Cells, Residual, Samples, cell_number};
use crate::chart::Topology;
use nurbskin_geometry::numeric::parallel::{each, each_light};
use nurbskin_geometry::numeric::statistics::{
    SIGMA_PER_MAD, median_in_place, quantile_in_place, robust_sigma,
};
use nurbskin_geometry::{DVec2, DVec3};

/// Points per neighbourhood.
const NEIGHBOURS: usize = 20;
/// Beyond so many sigmas a point has no weight.
const REJECT: f64 = 8.0;
/// Beyond so many sigmas a point is compared with its nearest points.
const SUSPICIOUS: f64 = 3.0;
/// So many of them.
const NEAREST: usize = 6;

/// Most points that must vouch for another: more than half of the nearest.
const MOST_WITNESSES: usize = 4;
/// Chance that any outlier is vouched for by others.
const CHANCE: f64 = 0.01;

/// Points in neighbourhoods of fewer than so many are lonely ...
const LONELY: usize = 6;
/// ... if they are no larger part of all.
const LONELY_PART: f64 = 0.1;
/// So many neighbourhoods away lonely points look for others.
const SIGHT: usize = 3;
/// So many they must see, that these have a say.
const SEEN: usize = 4;
/// Neighbourhoods handled together.
const GROUP: usize = 256;
/// From about so many neighbourhoods the scale is taken: its own error is then 0.3 %.
const SPREADS: usize = 4096;
/// From about so many neighbourhoods the noise is taken before there is a surface.
const QUADRATICS: usize = 4096;

/// The domain cut into neighbourhoods of about 20 points, as square as the chart's lengths allow.
#[derive(Debug)]
pub(crate) struct Neighbourhoods {
    cells: Cells,
    of_sample: Vec<u32>,
    counts: [usize; 2],
    /// Per column along u: so many places along v are one neighbourhood. More than one towards poles, where columns
    /// shrink and hold fewer points.
    strides: Vec<usize>,
    size: [f64; 2],
    /// Neighbourhoods with fewer points are lonely.
    fewest: usize,
}

/// What the residuals say.
#[derive(Clone, Debug)]
pub(crate) struct Judgement {
    /// Weight of each sample, 0 = outlier.
    pub(crate) weights: Vec<f64>,
    /// Standard deviation of residuals about the median of their neighbourhood.
    pub(crate) sigma: f64,
}

/// What a group of neighbourhoods says of their residuals.
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
        let wanted = (measured as f64 / NEIGHBOURS as f64).max(1.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to 1..=65536"
        )]
        let count = |ratio: f64| {
            (wanted * ratio)
                .sqrt()
                .clamp(1.0, wanted.min(65536.0))
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
                *stride = counts[1].div_ceil((held / NEIGHBOURS).max(1));
            }
        }
        // What only holds the surface belongs to no neighbourhood: its cell is the one after the last.
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
        let lonely: usize = held.filter(|&n| n < LONELY).sum();
        let few = lonely as f64 <= LONELY_PART * measured as f64;
        Self {
            cells,
            of_sample,
            counts,
            strides,
            size,
            fewest: if few { LONELY } else { 1 },
        }
    }

    /// How many there are.
    fn len(&self) -> usize {
        self.counts[0] * self.counts[1]
    }

    fn is_support(&self, k: usize) -> bool {
        self.of_sample[k] as usize == self.len()
    }

    fn is_lonely(&self, cell: usize) -> bool {
        self.cells.samples(cell).len() < self.fewest
    }

    /// Whether no other sample in the neighbourhood of `k` is `far` off: what several are is a feature that the surface
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

    /// Support counts for nothing here: it has no weight.
    ///
    /// Tukey's biweight of each sample's residual about the median of its neighbourhood, with the annealed scale, at
    /// least `floor`, which is above zero for exact points and vertices of a mesh. O(n).
    pub(crate) fn judge(&self, samples: &Samples, residuals: &[Residual], floor: f64) -> Judgement {
        // 1. Medians of the neighbourhoods, and how some of them spread: evenly chosen ones hold the scale of all.
        let every = self.len().div_ceil(SPREADS);
        let groups = self.len().div_ceil(GROUP);
        let groups = each(groups, |group| {
            let cells = group * GROUP..((group + 1) * GROUP).min(self.len());
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
        let far: usize = each(n.div_ceil(CHUNK), |block| {
            let samples = block * CHUNK..((block + 1) * CHUNK).min(n);
            samples
                .filter(|&k| !self.is_support(k) && off(k).abs() > REJECT * scale)
                .count()
        })
        .into_iter()
        .sum();
        let witnesses = witnesses(far, n);
        // 3. The weights. Exact points, and vertices of a mesh, have few outliers: while whole neighbourhoods of them lie off the
        // surface, what is off by as much is a feature, and counts in full.
        let full = if floor > 0.0 && scale > floor {
            SUSPICIOUS
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
            // What remains beside the normal lies beyond an edge of the surface.
            let beside = (distance * distance - signed * signed).max(0.0);
            let mut x = (off(k).powi(2) + beside).sqrt();
            if self.is_lonely(self.of_sample[k] as usize) {
                let reference = self.lonely_median(samples, residuals, k, SUSPICIOUS * scale);
                x = ((signed - reference).powi(2) + beside).sqrt();
            } else if x > SUSPICIOUS * scale {
                // Small features vary within a neighbourhood; what the nearest points share is no outlier.
                let shared = self.shared(samples, residuals, k, witnesses);
                let left = (signed.abs() - shared).max(0.0);
                x = x.min((left * left + beside).sqrt());
            }
            let y = ((x / scale - full) / (REJECT - full)).max(0.0);
            if scale <= 0.0 || y < 1.0 {
                let z = if scale > 0.0 { 1.0 - y * y } else { 1.0 };
                z * z
            } else {
                0.0
            }
        });
        Judgement { weights, sigma }
    }

    /// The neighbourhoods up to `reach` away from one, itself included.
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
        let mut near: Vec<(f64, u32)> = Vec::with_capacity(9 * NEIGHBOURS);
        for cell in self.around(self.of_sample[k] as usize, reach) {
            let others = self.cells.samples(cell).iter();
            near.extend(others.filter(|&&j| j as usize != k).map(|&j| {
                let apart = (samples.parameters[j as usize] - here) * DVec2::from(self.size);
                (apart.length_squared(), j)
            }));
        }
        let n = NEAREST.min(near.len());
        if n > 0 {
            near.select_nth_unstable_by(n - 1, |x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        }
        let signed = |&(_, j): &(f64, u32)| residuals[j as usize].signed;
        near[..n].iter().map(signed).collect()
    }

    /// What a lonely point is compared with: the median of the points nearest to it where these agree to `spread`, else
    /// the surface.
    fn lonely_median(
        &self,
        samples: &Samples,
        residuals: &[Residual],
        k: usize,
        spread: f64,
    ) -> f64 {
        let mut values = self.nearest(samples, residuals, k, SIGHT);
        if values.len() < SEEN {
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
            // Lonely points are no judges of themselves, and none of the spread.
            if samples.is_empty() || self.is_lonely(cell) {
                out.medians.push(0.0);
                continue;
            }
            values.extend(samples.iter().map(signed));
            let middle = values.len() / 2;
            let median = *values.select_nth_unstable_by(middle, f64::total_cmp).1;
            if cell.is_multiple_of(every) {
                // The point that is its own median says nothing about the spread.
                let others = values[..middle].iter().chain(&values[middle + 1..]);
                out.spread.extend(others.map(|x| (x - median).abs()));
            }
            out.squares += values.len() as f64 * median * median;
            out.judged += values.len() as f64;
            out.medians.push(median);
        }
        out
    }

    /// The distance that at least so many `witnesses` of the points nearest to point k in the domain reach, on its side
    /// of the surface.
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
        let every = self.len().div_ceil(QUADRATICS);
        let sigmas = each(self.len().div_ceil(every), |k| {
            quadratic_noise(samples, self.cells.samples(k * every))
        });
        let mut sigmas: Vec<f64> = sigmas.into_iter().flatten().collect();
        if sigmas.is_empty() {
            return 0.0;
        }
        // Of a chi distribution with 14 degrees of freedom the lower decile is 0.746 of sigma.
        quantile_in_place(&mut sigmas, 0.1) / 0.746
    }
}

/// How many of the nearest points must lie off like a point that it counts: so many that it is unlikely among `far` outliers
/// of `n` points that some have as many others beside them on their side by chance.
fn witnesses(far: usize, n: usize) -> usize {
    let far = far as f64;
    let beside = 0.5 * far / n.max(1) as f64;
    let mut ways = 1.0;
    let mut chance = 1.0;
    for k in 1..MOST_WITNESSES {
        ways *= (NEAREST - k + 1) as f64 / k as f64;
        chance *= beside;
        if k >= 2 && far * ways * chance < CHANCE {
            return k;
        }
    }
    MOST_WITNESSES
}

/// Standard deviation across the surface about the best quadratic (u, v) -> X of these samples; `None` for fewer than
/// 12 or where they do not determine it.
fn quadratic_noise(samples: &Samples, members: &[u32]) -> Option<f64> {
    const TERMS: usize = 6;
    let n = members.len();
    if n < 12 {
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
    let mut a = [[0.0; TERMS]; TERMS];
    let mut b = [DVec3::ZERO; TERMS];
    for &k in members {
        let f = terms(k);
        for i in 0..TERMS {
            for j in 0..TERMS {
                a[i][j] += f[i] * f[j];
            }
            b[i] += f[i] * samples.points[k as usize];
        }
    }
    // Gaussian elimination of a symmetric positive definite system needs no pivoting.
    for i in 0..TERMS {
        if a[i][i] <= 1e-9 * n as f64 {
            return None;
        }
        for r in i + 1..TERMS {
            let factor = a[r][i] / a[i][i];
            let (upper, lower) = a.split_at_mut(r);
            for (x, y) in lower[0][i..].iter_mut().zip(&upper[i][i..]) {
                *x -= factor * y;
            }
            let (upper, lower) = b.split_at_mut(r);
            lower[0] -= factor * upper[i];
        }
    }
    for i in (0..TERMS).rev() {
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
    Some((squares / (n - TERMS) as f64).sqrt())
}

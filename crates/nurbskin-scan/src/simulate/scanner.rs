//! Samples a shape as a scanner would.

use super::random::Random;
use super::shapes::Shape;
use super::truth::TrueSurface;
use crate::{GridLayout, Organisation, Scan};
use glam::{DVec2, DVec3};
use nurbskin_geometry::math;
use nurbskin_geometry::unit::UnitSource;
use nurbskin_geometry::{Error, Result};

/// Fewest points of a simulated scan: the paper's smallest, 4 x 4.
const MIN_POINTS: usize = 16;
/// Most points of a simulated scan; they need about 100 bytes each.
const MAX_POINTS: usize = 100_000_000;
/// Most holes; each takes at least [`HOLE_AREA`].
const MAX_HOLES: usize = 30;
/// Part of the samples that each hole takes away.
const HOLE_AREA: f64 = 0.01;
/// Typical offset of an outlier, in diagonals of the shape's size.
const OUTLIER_OFFSET: f64 = 0.04;

/// In which order a simulated scan gives its points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// Along lines of constant v, one after the other: a grid, or rows where the number of points has no fitting
    /// factors.
    #[default]
    Ordered,
    /// The samples of the lines in random order.
    Shuffled,
    /// At random places, evenly over the area, in random order.
    Scattered,
}

/// What the virtual scanner does. Lengths are in millimetres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScanOptions {
    /// Number of points, exactly; `None` for [`Shape::default_counts`]. 16 to 100 million.
    pub points: Option<usize>,
    /// Number of rows (lines of constant v); `None` chooses rows that sample both directions about equally.
    pub rows: Option<usize>,
    /// Standard deviation of the Gaussian noise along the normal (0).
    pub noise: f64,
    /// Part of the points thrown far off, 0 to 0.5 (0).
    pub outliers: f64,
    /// Number of round regions without points, at most 30 (0).
    pub holes: usize,
    /// Seed of all random numbers (0); same options, same points.
    pub seed: u64,
    /// Order of the points (ordered).
    pub order: Order,
    /// Tubes have a longitudinal opening, as the paper's handle (false).
    pub opening: bool,
}

/// A simulated scan and all that is known of it.
#[derive(Clone, Debug)]
pub struct Simulated {
    /// The scan.
    pub scan: Scan,
    /// The surface it was taken from.
    pub truth: TrueSurface,
    /// True (u, v) of each point, in the order of the scan's points.
    pub parameters: Vec<DVec2>,
    /// Indices of the points thrown off, ascending.
    pub outliers: Vec<usize>,
}

/// Scans `shape`: exactly the number of points asked for, of which `outliers` lie far off and the others `noise` from
/// the truth; holes are cut out of a larger number of samples, so that the number of points stays.
///
/// Ordered scans without holes are complete grids where the number of points has factors that sample both
/// directions about equally, otherwise rows whose lengths differ by at most one; with holes they are grids with
/// empty cells. Closed directions do not repeat their first point; poles are whole lines of the same point in
/// ordered scans, and left out otherwise.
///
/// # Errors
/// [`Error::Invalid`] if an option is out of its range.
pub fn scan(shape: Shape, options: &ScanOptions) -> Result<Simulated> {
    let points = options.points.unwrap_or(shape.default_counts().0);
    check(options, points)?;
    let truth = if options.opening {
        TrueSurface::opened(shape)
    } else {
        TrueSurface::new(shape)
    };
    // Noise, outliers, holes and order each have their own numbers, so that changing one leaves the others.
    let stream = |k: u64| Random::new(options.seed.wrapping_mul(8).wrapping_add(k));
    let samples = sample_count(points, options.holes);
    let lattice = Lattice::new(&truth, samples, options, points)?;
    let mut places = match options.order {
        Order::Scattered => scatter(&truth, lattice.count(), &mut stream(0)),
        _ => lattice.places(&truth, options.order == Order::Ordered),
    };
    let mut cells: Vec<Option<u32>> = Vec::new();
    if options.holes > 0 {
        let at = |k: usize| {
            let DVec2 { x: u, y: v } = places[k];
            (truth.point(u, v), truth.normal(u, v))
        };
        let keep = cut_holes(places.len(), at, options.holes, points, &mut stream(1));
        let mut count = 0;
        cells = keep
            .iter()
            .map(|&kept| kept.then(|| (count, count += 1).0))
            .collect();
        let mut kept = keep.into_iter();
        places.retain(|_| kept.next().unwrap_or(false));
    }
    let organisation = match (options.order, &lattice.rows) {
        (Order::Shuffled | Order::Scattered, _) => {
            stream(2).shuffle(&mut places);
            Organisation::Unordered
        }
        (Order::Ordered, Some(lengths)) => Organisation::Rows(lengths.clone()),
        (Order::Ordered, None) if cells.is_empty() => {
            GridLayout::complete(lattice.count_u, lattice.count_v)
                .map_or(Organisation::Unordered, Organisation::Grid)
        }
        (Order::Ordered, None) => Organisation::Grid(GridLayout {
            count_u: lattice.count_u,
            count_v: lattice.count_v,
            cells,
        }),
    };
    let mut coordinates = displace(&truth, &places, options.noise, &mut stream(3));
    // Poles stay.
    let candidates = (0..places.len()).filter(|&k| !at_pole(&truth, places[k]));
    let candidates = candidates.collect();
    let [length_u, length_v] = truth.size();
    let outliers = throw(
        &mut coordinates,
        candidates,
        options.outliers,
        math::hypot(length_u, length_v),
        &mut stream(4),
    );
    Ok(Simulated {
        scan: Scan {
            points: coordinates,
            organisation,
            format: "simulated".into(),
            // The shapes are defined in millimetres.
            unit_source: UnitSource::File,
            ..Scan::default()
        },
        truth,
        parameters: places,
        outliers,
    })
}

pub(super) fn check(options: &ScanOptions, points: usize) -> Result<()> {
    let wrong = |what: String| Err(Error::Invalid(what));
    if !(MIN_POINTS..=MAX_POINTS).contains(&points) {
        return wrong(format!(
            "a simulated scan has {MIN_POINTS} to {MAX_POINTS} points, not {points}"
        ));
    }
    if let Some(rows) = options.rows.filter(|&rows| rows < 3 || rows > points / 3) {
        return wrong(format!(
            "{points} points cannot be scanned in {rows} rows; choose 3 to {}",
            points / 3
        ));
    }
    if !(options.noise >= 0.0 && options.noise <= 1e3) {
        return wrong(format!(
            "the noise must be a length of 0 to 1000 mm, not {}",
            options.noise
        ));
    }
    if !(0.0..=0.5).contains(&options.outliers) {
        return wrong(format!(
            "the part of outliers must be between 0 and 0.5, not {}",
            options.outliers
        ));
    }
    if options.holes > MAX_HOLES {
        return wrong(format!(
            "a simulated scan has at most {MAX_HOLES} holes, not {}",
            options.holes
        ));
    }
    Ok(())
}

/// Samples to take so that the holes leave `points`.
pub(super) fn sample_count(points: usize, holes: usize) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "at most 1.5 times 100 million"
    )]
    let grown = (points as f64 / (1.0 - HOLE_AREA * holes as f64)).ceil() as usize;
    // Each hole takes at least one sample.
    grown.max(points + holes)
}

/// How the parameter domain is sampled: a grid, or rows of different length.
struct Lattice {
    count_u: usize,
    count_v: usize,
    rows: Option<Vec<usize>>,
}

impl Lattice {
    fn new(
        truth: &TrueSurface,
        samples: usize,
        options: &ScanOptions,
        points: usize,
    ) -> Result<Self> {
        let (default_points, default_rows) = truth.shape().default_counts();
        let asked = options
            .rows
            .or((points == default_points).then_some(default_rows));
        let [length_u, length_v] = truth.size();
        let ideal = (samples as f64 * length_v / length_u).sqrt();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a root of at most 1e8 times an aspect ratio, then clamped"
        )]
        let nearest = (ideal.round() as usize).clamp(3, samples / 3);
        if options.holes > 0 {
            // Holes take what is too much: any rows will do.
            let count_v = asked.unwrap_or(nearest);
            let count_u = samples.div_ceil(count_v);
            return Ok(Self {
                count_u,
                count_v,
                rows: None,
            });
        }
        let factor = || {
            let unevenness = |n: usize| math::ln(n as f64 / ideal).abs();
            (3..=samples / 3)
                .take_while(|&n| n as f64 <= 1.6 * ideal)
                .filter(|&n| samples.is_multiple_of(n) && unevenness(n) <= math::ln(1.6_f64))
                .min_by(|&a, &b| unevenness(a).total_cmp(&unevenness(b)))
        };
        let count_v = asked.or_else(factor).unwrap_or(nearest);
        let short = samples / count_v;
        let longer = samples % count_v;
        let rows = (longer > 0).then(|| {
            // The longer rows lie evenly among the others.
            (0..count_v)
                .map(|j| short + ((j + 1) * longer / count_v - j * longer / count_v))
                .collect()
        });
        Ok(Self {
            count_u: short,
            count_v,
            rows,
        })
    }

    fn count(&self) -> usize {
        self.rows
            .as_ref()
            .map_or(self.count_u * self.count_v, |rows| rows.iter().sum())
    }

    /// (u, v) of all samples, row by row. Poles are left out unless `poles`.
    fn places(&self, truth: &TrueSurface, poles: bool) -> Vec<DVec2> {
        let [closed_u, closed_v] = truth.closed();
        let inner = truth.shape().has_poles() && !poles;
        let step = |k: usize, count: usize, closed: bool, inner: bool| {
            if inner {
                (k as f64 + 0.5) / count as f64
            } else if closed {
                k as f64 / count as f64
            } else {
                k as f64 / (count - 1) as f64
            }
        };
        (0..self.count_v)
            .flat_map(|j| {
                let count_u = self.rows.as_ref().map_or(self.count_u, |rows| rows[j]);
                let v = step(j, self.count_v, closed_v, false);
                (0..count_u).map(move |i| DVec2::new(step(i, count_u, closed_u, inner), v))
            })
            .collect()
    }
}

/// Random places, evenly over the area: candidates are kept with the probability of their area element.
fn scatter(truth: &TrueSurface, count: usize, random: &mut Random) -> Vec<DVec2> {
    let area = |u: f64, v: f64| {
        let d = truth.derivatives(u, v);
        d.du.cross(d.dv).length()
    };
    let mut largest = 0.0_f64;
    for k in 0..10_000_u32 {
        largest = largest.max(area(f64::from(k % 100) / 99.0, f64::from(k / 100) / 99.0));
    }
    // What lies between those samples may be a little larger.
    largest *= 1.05;
    let mut places = Vec::with_capacity(count);
    while places.len() < count {
        let place = DVec2::new(random.uniform(), random.uniform());
        if random.uniform() * largest <= area(place.x, place.y) {
            places.push(place);
        }
    }
    places
}

/// Which of `count` samples remain when round holes are cut so that exactly `points` are left: the samples nearest to
/// the holes' centres, relative to each hole's size, go. A sample on the far side of a thin shape stays. `at` gives
/// point and normal of a sample.
pub(super) fn cut_holes(
    count: usize,
    at: impl Fn(usize) -> (DVec3, DVec3),
    holes: usize,
    points: usize,
    random: &mut Random,
) -> Vec<bool> {
    let centres: Vec<(DVec3, DVec3, f64)> = (0..holes)
        .map(|_| {
            let (point, normal) = at(random.index(count));
            (point, normal, 0.6 + 0.4 * random.uniform())
        })
        .collect();
    let mut ranks: Vec<(f64, usize)> = (0..count)
        .map(|k| {
            let (point, normal) = at(k);
            let rank = centres
                .iter()
                .filter(|(_, facing, _)| facing.dot(normal) > 0.0)
                .map(|(centre, _, size)| centre.distance(point) / size)
                .fold(f64::INFINITY, f64::min);
            (rank, k)
        })
        .collect();
    ranks.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut keep = vec![true; count];
    for &(_, k) in &ranks[..count.saturating_sub(points)] {
        keep[k] = false;
    }
    keep
}

fn at_pole(truth: &TrueSurface, place: DVec2) -> bool {
    truth.shape().has_poles() && (place.x <= 0.0 || place.x >= 1.0)
}

/// Coordinates of the places with noise along the normal; a pole is one point however often it is sampled.
fn displace(truth: &TrueSurface, places: &[DVec2], noise: f64, random: &mut Random) -> Vec<DVec3> {
    let mut poles = [None; 2];
    places
        .iter()
        .map(|&place| {
            let mut offset = noise * random.normal();
            if at_pole(truth, place) {
                offset = *poles[usize::from(place.x > 0.5)].get_or_insert(offset);
            }
            let u = place.x;
            // All samples of a pole have the same coordinates to the last bit.
            let v = if at_pole(truth, place) { 0.0 } else { place.y };
            let point = truth.point(u, v);
            if noise > 0.0 {
                point + offset * truth.normal(u, v)
            } else {
                point
            }
        })
        .collect()
}

/// Throws `part` of the points off in random directions, by about [`OUTLIER_OFFSET`] of `size`; returns their indices,
/// ascending. Only `candidates` are thrown.
pub(super) fn throw(
    points: &mut [DVec3],
    mut candidates: Vec<usize>,
    part: f64,
    size: f64,
    random: &mut Random,
) -> Vec<usize> {
    if part <= 0.0 {
        return Vec::new();
    }
    random.shuffle(&mut candidates);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "at most half of the points"
    )]
    let count = (part * points.len() as f64).round() as usize;
    candidates.truncate(count);
    candidates.sort_unstable();
    for &k in &candidates {
        points[k] +=
            OUTLIER_OFFSET * size * DVec3::new(random.normal(), random.normal(), random.normal());
    }
    candidates
}

#[cfg(test)]
mod tests;

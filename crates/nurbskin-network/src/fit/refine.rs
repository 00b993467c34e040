//! New knots where points are out of tolerance.
//!
//! A cell (span x span) of a face with a point beyond the limit is halved along the direction in which the surface has the
//! larger fourth difference, or along both. Where the cell lies at a side, the edge gets the knot too, and with it the face
//! beyond. Spans of lines are halved for points on them.
//!
//! Source: ours; the fourth difference estimates the error of a cubic (C. de Boor, *A Practical Guide to Splines*, ch. XII).

use super::lines::LineSamples;
use super::network::{Network, WIDTH};
use super::terms::Samples;
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::{median_in_place, normal_tail};
use std::collections::BTreeMap;

/// Fewest points of a cell that is halved. Count.
/// Trial: not recorded. It keeps faces from folding where points are few.
const LEAST_POINTS: usize = 4;
/// Fewest points of a span of a line that is halved. Count.
/// Derived: each half has one more than the control point that it adds, but for one at its end.
const LEAST_ON_LINE: usize = 3;
/// Control points of a face that may be more than its points. Count.
/// Derived: two spans each way.
const FREE: usize = 25;
/// Ratio of fourth differences, or of lengths, beyond which only one direction is halved.
/// Trial: not recorded.
const ONE_WAY: f64 = 2.5;
/// Shortest span that is halved to. Share of the diagonal.
/// Guard: below it there is nothing but noise.
const SHORTEST_SPAN: f64 = 1e-3;
/// Standard deviations of the noise from the median as which a point counts at most in a mean.
/// Source: P. J. Huber, Robust estimation of a location parameter, 1964; as in `numeric::bias`.
const CLIP: f64 = 2.5;
/// Standard errors of a mean that are not significant.
/// Derived: one mean of 2000 by chance; as in `numeric::bias`.
const SIGNIFICANT: f64 = 3.5;
/// Points of a part of a cell whose mean counts, and most parts along a direction. Counts.
/// Trial: a part of the 25 points of `numeric::bias`, since a span should not bend more than once.
const PART_POINTS: usize = 12;
const MOST_PARTS: usize = 6;
/// Places of the five samples of a fourth difference. Spans from the middle of the cell.
const REACH: [f64; 5] = [-1.25, -0.625, 0.0, 0.625, 1.25];

/// What a cell needs: how far it is out, and along which directions it is halved.
#[derive(Clone, Copy, Debug)]
struct Mark {
    excess: f64,
    /// Number of the cell along u and v.
    cell: [usize; 2],
    halve: [bool; 2],
}

/// What refinement aims at, and where it ends.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Excess from which a cell is halved, in the unit of the points.
    pub(crate) distance: f64,
    /// The tolerance of the fit.
    pub(crate) tolerance: f64,
    /// Standard deviation of the points, where it is so large that cells are judged by their mean.
    pub(crate) noise: Option<f64>,
    /// Share of the points that may be outliers, where cells are judged by their mean.
    pub(crate) outliers: f64,
    /// Mean distance that is allowed.
    pub(crate) offset: f64,
    /// Diagonal of the points.
    pub(crate) diagonal: f64,
    /// Most control points of all faces.
    pub(crate) control_points: usize,
}

impl Limits {
    /// How far the points of a cell are out, each given by its place in the cell (0 to 1) and its signed distance: the
    /// largest distance; or with noise, of the means over parts of the cell, the largest share that noise does not explain,
    /// over the slack that a mean has.
    fn excess(&self, points: &[([f64; 2], f64)]) -> f64 {
        let Some(noise) = self.noise else {
            return points.iter().fold(0.0, |most, (_, d)| d.abs().max(most));
        };
        let mut side = 1;
        while side < MOST_PARTS && (side + 1) * (side + 1) * PART_POINTS <= points.len() {
            side += 1;
        }
        let mut parts = vec![Vec::new(); side * side];
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "0 to 1"
        )]
        let part = |t: f64| ((t * side as f64) as usize).min(side - 1);
        for ([u, v], d) in points {
            parts[part(*v) * side + part(*u)].push(*d);
        }
        let tail = 2.0 * normal_tail(self.tolerance / noise) + self.outliers;
        let slack = self.offset / self.tolerance;
        let mean = |signed: &Vec<f64>| {
            if signed.len() < LEAST_POINTS {
                return 0.0;
            }
            let count = signed.len() as f64;
            // More points beyond the tolerance than noise and outliers explain, by three standard deviations and, with outliers,
            // one point.
            let expected = tail * count;
            let single = if self.outliers > 0.0 { 1.0 } else { 0.0 };
            let beyond = signed.iter().filter(|d| d.abs() > self.tolerance).count() as f64;
            if beyond > expected + 3.0 * expected.sqrt() + single {
                return signed.iter().fold(0.0, |most, d| d.abs().max(most));
            }
            let reach = CLIP * noise;
            let median = median_in_place(&mut signed.clone());
            let off: f64 = signed
                .iter()
                .map(|d| (d - median).clamp(-reach, reach))
                .sum();
            let mean = median + off / count;
            ((mean.abs() - SIGNIFICANT * noise / count.sqrt()) / slack).max(0.0)
        };
        parts.iter().map(mean).fold(0.0, f64::max)
    }
}

/// Adds knots for cells that are out, the worst first, until there are as many control points as are allowed. Only the first
/// `counted` samples count. Returns how many knots were asked for.
///
/// # Errors
/// As [`Network::add_knots`].
pub(crate) fn refine(
    network: &mut Network,
    samples: &Samples,
    counted: usize,
    lines: &LineSamples,
    limits: &Limits,
) -> Result<usize> {
    let chords = network.chords(0.0);
    let by_face = samples.by_face(network.faces.len());
    let marks = each(network.faces.len(), |k| {
        let points = &by_face[k][..by_face[k].partition_point(|&p| (p as usize) < counted)];
        marks_of(network, k, points, samples, limits, &chords)
    });
    // Each knot once, with the largest excess it was asked for.
    let mut face_knots: BTreeMap<(usize, usize, u64), f64> = BTreeMap::new();
    let mut edge_knots: BTreeMap<(usize, u64), f64> = BTreeMap::new();
    let raise = |map: &mut BTreeMap<(usize, u64), f64>, edge: usize, t: f64, excess: f64| {
        let entry = map.entry((edge, t.to_bits())).or_insert(0.0);
        *entry = entry.max(excess);
    };
    for (f, marks) in marks.iter().enumerate() {
        let face = &network.faces[f];
        let breaks = [0, 1].map(|d| Network::breaks(&face.inner[d]));
        for mark in marks {
            for d in (0..2).filter(|&d| mark.halve[d]) {
                let [low, high] = [0, 1].map(|i| breaks[d][mark.cell[d] + i]);
                let t = f64::midpoint(low, high);
                let entry = face_knots.entry((f, d, t.to_bits())).or_insert(0.0);
                *entry = entry.max(mark.excess);
                // The sides that this cell touches, along d.
                let across = mark.cell[1 - d];
                let [first, last] = if d == 0 { [0, 2] } else { [3, 1] };
                for (at, side) in [(0, first), (breaks[1 - d].len() - 2, last)] {
                    if across == at {
                        let side = face.sides[side];
                        let t = if side.reversed { 1.0 - t } else { t };
                        raise(&mut edge_knots, side.edge as usize, t, mark.excess);
                    }
                }
            }
        }
    }
    let span_of = |&(e, t): &(u32, f64)| {
        let breaks = Network::breaks(&network.edges[e as usize].inner);
        (e, cell_of(&breaks, t))
    };
    let spans: Vec<(u32, usize)> = lines.feet.iter().map(span_of).collect();
    let mut on_span: BTreeMap<(u32, usize), usize> = BTreeMap::new();
    for &span in &spans {
        *on_span.entry(span).or_insert(0) += 1;
    }
    for (k, &(e, span)) in spans.iter().enumerate() {
        if lines.distances[k] > limits.distance && on_span[&(e, span)] >= LEAST_ON_LINE {
            let breaks = Network::breaks(&network.edges[e as usize].inner);
            let width = breaks[span + 1] - breaks[span];
            if width * chords[e as usize] > SHORTEST_SPAN * limits.diagonal {
                let middle = f64::midpoint(breaks[span], breaks[span + 1]);
                raise(&mut edge_knots, e as usize, middle, lines.distances[k]);
            }
        }
    }
    add_worst(network, &face_knots, &edge_knots, limits.control_points)
}

/// Adds the knots, the worst first, until the network has `most` control points.
fn add_worst(
    network: &mut Network,
    faces: &BTreeMap<(usize, usize, u64), f64>,
    edges: &BTreeMap<(usize, u64), f64>,
    most: usize,
) -> Result<usize> {
    enum Knot {
        Face(usize, usize, f64),
        Edge(usize, f64),
    }
    let of_faces = faces
        .iter()
        .map(|(&(f, d, t), &e)| (e, Knot::Face(f, d, f64::from_bits(t))));
    let of_edges = edges
        .iter()
        .map(|(&(k, t), &e)| (e, Knot::Edge(k, f64::from_bits(t))));
    let mut all: Vec<(f64, Knot)> = of_faces.chain(of_edges).collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let count = all.len();
    let mut total = network.control_points();
    let (mut face_list, mut edge_list) = (Vec::new(), Vec::new());
    for (_, knot) in all {
        match knot {
            Knot::Face(f, d, t) => {
                total += network.faces[f].inner[1 - d].len() + WIDTH;
                face_list.push((f, d, t));
            }
            Knot::Edge(k, t) => {
                total += WIDTH;
                edge_list.push((k, t));
            }
        }
        if total > most {
            break;
        }
    }
    if count > 0 {
        network.add_knots(&edge_list, &face_list)?;
    }
    Ok(count)
}

/// The number of the span that holds t.
fn cell_of(breaks: &[f64], t: f64) -> usize {
    breaks
        .partition_point(|&b| b <= t)
        .saturating_sub(1)
        .min(breaks.len() - 2)
}

/// The marks of one face.
fn marks_of(
    network: &Network,
    f: usize,
    points: &[u32],
    samples: &Samples,
    limits: &Limits,
    chords: &[f64],
) -> Vec<Mark> {
    let face = &network.faces[f];
    // Ripples between the points would fold.
    if face.net.len() >= points.len() && face.net.len() > FREE {
        return Vec::new();
    }
    let patch = face.patch();
    let open = face.open(&network.edges);
    let breaks = [0, 1].map(|d| Network::breaks(&face.inner[d]));
    let width = breaks[0].len() - 1;
    let mut cells: Vec<Vec<([f64; 2], f64)>> = vec![Vec::new(); width * (breaks[1].len() - 1)];
    for &k in points {
        let k = k as usize;
        let foot = samples.feet[k];
        if face.is_beyond(open, [foot.u, foot.v], samples.points[k]) {
            continue;
        }
        let cell = [(0, foot.u), (1, foot.v)].map(|(d, t)| cell_of(&breaks[d], t));
        let within = [(0, foot.u), (1, foot.v)].map(|(d, t): (usize, f64)| {
            let (low, high) = (breaks[d][cell[d]], breaks[d][cell[d] + 1]);
            (t - low) / (high - low)
        });
        let distance = samples.distances[k];
        let signed = match limits.noise {
            None => distance,
            Some(_) => {
                let jet = patch.tangents(foot.u, foot.v);
                distance.copysign((samples.points[k] - jet.point).dot(jet.normal()))
            }
        };
        cells[cell[1] * width + cell[0]].push((within, signed));
    }
    let lengths = network.lengths(face, chords);
    let mut marks = Vec::new();
    for (at, points) in cells.iter().enumerate() {
        if points.len() < LEAST_POINTS {
            continue;
        }
        let worst = limits.excess(points);
        if worst <= limits.distance {
            continue;
        }
        let cell = [at % width, at / width];
        let size = [0, 1].map(|d| (breaks[d][cell[d] + 1] - breaks[d][cell[d]]) * lengths[d]);
        let bend = [0, 1].map(|d| fourth_difference(network, f, &breaks, cell, d));
        let only = |d: usize| bend[d] > ONE_WAY * bend[1 - d] || size[d] > ONE_WAY * size[1 - d];
        let halve = match [only(0), only(1)] {
            [true, _] => [true, false],
            [false, true] => [false, true],
            [false, false] => [true, true],
        };
        let halve = [0, 1].map(|d| halve[d] && size[d] > SHORTEST_SPAN * limits.diagonal);
        if halve != [false, false] {
            marks.push(Mark {
                excess: worst,
                cell,
                halve,
            });
        }
    }
    marks
}

/// Length of the fourth difference of the surface through the middle of a cell, along a direction.
fn fourth_difference(
    network: &Network,
    f: usize,
    breaks: &[Vec<f64>; 2],
    cell: [usize; 2],
    direction: usize,
) -> f64 {
    let patch = network.faces[f].patch();
    let [low, high] = [0, 1].map(|i| [0, 1].map(|d| breaks[d][cell[d] + i]));
    let at = REACH.map(|reach| {
        let mut place = [0, 1].map(|d| f64::midpoint(low[d], high[d]));
        place[direction] =
            (place[direction] + reach * (high[direction] - low[direction])).clamp(0.0, 1.0);
        patch.point(place[0], place[1])
    });
    (at[0] - 4.0 * at[1] + 6.0 * at[2] - 4.0 * at[3] + at[4]).length()
}

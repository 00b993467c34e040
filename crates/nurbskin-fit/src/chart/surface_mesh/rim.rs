//! The rim of a disk as the border of a rectangle: its corners, and the place of each of its vertices.
//!
//! The rim is sampled evenly and smoothed. Corners maximise
//!
//! ```text
//! sum_k (place of corner k) · (±1, ±1)  -  ½ (ln² (l_0 / l_2) + ln² (l_1 / l_3))
//! ```
//!
//! in the coordinates of the smallest rectangle around the rim, with the lengths l of the sides; or the sum of the
//! turns of the rim instead of the first term. Evenly spaced corners are tried as well. Vertices lie along a side by
//! the length of its smoothed course.
//!
//! Source: ours.

use glam::{DVec2, DVec3};
use nurbskin_geometry::math;

/// Edges of the mean length to either side over which raggedness is smoothed. Trial: not recorded. Fewer keep the
/// teeth, more cut the corners.
const SMOOTHING_EDGES: f64 = 3.0;
/// Weight of the squared logarithm of the ratio of opposite sides, against corners that lie far out or turn sharply.
/// Trial: not recorded.
const ASPECT_PENALTY: f64 = 0.5;
/// Most places at which a rim turns that are considered as corners. Guard: all sets of four are tried, 1820 of 16.
const MAX_PEAKS: usize = 16;
/// Rotations of four evenly spaced corners that are tried. Guard: each costs a layout.
const EVEN_ROTATIONS: usize = 4;
/// Smoothed samples of a rim. Guard: fine against a 32nd of the rim, the shortest side.
const RIM_SAMPLES: usize = 1024;
/// Length of the chords whose directions are tried for the rectangle: a sixteenth of the rim. Trial: not recorded;
/// chords of straight sides hold their directions.
const CHORD_SAMPLES: usize = RIM_SAMPLES / 16;
/// Shortest side, a 32nd of the rim; also the first step of the search for corners and the reach over which turns are
/// measured. Trial: not recorded.
const MIN_SIDE_SAMPLES: usize = RIM_SAMPLES / 32;
/// Least gain of the score that moves a corner. Guard: above rounding, so that the search ends.
const MIN_SCORE_GAIN: f64 = 1e-9;
/// Distance along the rim, in samples, within which the vertex farthest out is taken for a corner. Derived: a little
/// more than half a sample, the accuracy of the search.
const CORNER_GRAIN: f64 = 0.6;
/// Least turn of the rim, in radians, at a corner. Trial: not recorded; about 6 degrees.
const MIN_TURN: f64 = 0.1;
/// Turn, in radians, above which a corner is no better for being sharper: a little more than a right angle. Trial: not
/// recorded.
const MAX_TURN: f64 = 1.6;
/// Samples of a side per edge of the mesh. Guard: fine against the edges that are smoothed.
const SAMPLES_PER_EDGE: usize = 4;
/// Fewest and most samples of a side. Guard: bounds accuracy and time.
const RIM_SIDE_SAMPLES: [usize; 2] = [64, 8192];
/// Passes of the running mean. Derived: two of them have the triangular weights of a binomial-like mean.
const SMOOTHING_PASSES: usize = 2;
/// Largest reach of the smoothing: the number of samples over this. Guard: keeps short sides from being smoothed to a
/// point.
const MAX_SMOOTHING: f64 = 16.0;

/// A closed polygon through the rim's vertices, sampled evenly and smoothed.
pub(super) struct Rim {
    /// The vertices.
    points: Vec<DVec3>,
    /// Length of the unsmoothed rim up to each vertex, then its whole length.
    lengths: Vec<f64>,
    smooth: Vec<DVec3>,
}

/// A rim laid on the border of a rectangle.
pub(super) struct Border {
    /// A place in 0..=size for each vertex of the rim.
    pub(super) places: Vec<DVec2>,
    /// For each vertex of each side, from corner to corner, the nearby point of the smoothed side, and its direction
    /// there.
    pub(super) beside: [Vec<(DVec3, DVec3)>; 4],
    /// The rectangle's sides: mean lengths of opposite smoothed sides.
    pub(super) size: DVec2,
}

impl Rim {
    pub(super) fn new(points: Vec<DVec3>) -> Self {
        let mut lengths = vec![0.0];
        let mut length = 0.0;
        for k in 0..points.len() {
            length += points[k].distance(points[(k + 1) % points.len()]);
            lengths.push(length);
        }
        let mut rim = Self {
            points,
            lengths,
            smooth: Vec::new(),
        };
        let samples: Vec<DVec3> = (0..RIM_SAMPLES)
            .map(|k| rim.at(length * k as f64 / RIM_SAMPLES as f64))
            .collect();
        let reach = SMOOTHING_EDGES * RIM_SAMPLES as f64 / rim.points.len() as f64;
        let n = RIM_SAMPLES;
        rim.smooth = smoothed(&samples, reach, |a, step, sense: isize| {
            if sense > 0 {
                a[(step.0 + step.1) % n]
            } else {
                a[(step.0 + n - step.1 % n) % n]
            }
        });
        rim
    }

    fn whole(&self) -> f64 {
        self.lengths[self.points.len()]
    }

    /// The unsmoothed rim at a length from its first vertex, periodic.
    fn at(&self, length: f64) -> DVec3 {
        let n = self.points.len();
        let whole = self.whole();
        let length = length.rem_euclid(whole.max(f64::MIN_POSITIVE));
        let k = self.lengths.partition_point(|&l| l <= length).clamp(1, n) - 1;
        let part = self.lengths[k + 1] - self.lengths[k];
        let t = if part > 0.0 {
            (length - self.lengths[k]) / part
        } else {
            0.0
        };
        self.points[k].lerp(self.points[(k + 1) % n], t.clamp(0.0, 1.0))
    }

    /// The point of the smoothed rim next to a vertex, and the direction there.
    pub(super) fn smoothed_at(&self, vertex: usize) -> (DVec3, DVec3) {
        let n = RIM_SAMPLES;
        let at = self.lengths[vertex] / self.whole().max(f64::MIN_POSITIVE) * n as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the samples"
        )]
        let k = (at as usize).min(n - 1);
        let sample = |j: usize| self.smooth[j % n];
        let middle = sample(k).lerp(sample(k + 1), at - k as f64);
        let reach = (n / self.points.len()).clamp(1, n / 8);
        (middle, sample(k + 1 + reach) - sample(k + n - reach))
    }

    /// Axes of the smallest rectangle around the rim in the plane with this unit normal: the longer side, whose largest
    /// coordinate is positive, then the other, right-handed with the normal; also the rectangle's middle and half its
    /// sides along them.
    fn rectangle(&self, normal: DVec3) -> (DVec3, DVec3, DVec2, DVec2) {
        let frame = |a: usize, b: usize| {
            let along = (self.smooth[b] - self.smooth[a]).reject_from_normalized(normal);
            along.try_normalize().map(|x| (x, normal.cross(x)))
        };
        let extent = |x: DVec3, y: DVec3| {
            let places = self.smooth.iter().map(|p| DVec2::new(p.dot(x), p.dot(y)));
            places.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(l, h), p| {
                (l.min(p), h.max(p))
            })
        };
        let mut best = (f64::INFINITY, normal.any_orthonormal_pair());
        for k in (0..RIM_SAMPLES).step_by(4) {
            if let Some((x, y)) = frame(k, (k + CHORD_SAMPLES) % RIM_SAMPLES) {
                let (low, high) = extent(x, y);
                let area = (high - low).element_product();
                if area < best.0 {
                    best = (area, (x, y));
                }
            }
        }
        let (mut x, y) = best.1;
        let (low, high) = extent(x, y);
        if (high - low).y > (high - low).x {
            x = y;
        }
        if x[x.abs().max_position()] < 0.0 {
            x = -x;
        }
        let y = normal.cross(x);
        let (low, high) = extent(x, y);
        (x, y, 0.5 * (low + high), 0.5 * (high - low))
    }

    /// Vertices at the four corners, counter-clockwise as the rim is, from low u and v: far out towards the corners of
    /// the smallest rectangle in the plane of `normal`, with opposite sides of about equal length.
    pub(super) fn corners(&self, normal: DVec3) -> Option<[usize; 4]> {
        /// Directions of the corners of a rectangle, counter-clockwise from low u and v. Derived: the corners of the
        /// square [-1, 1]².
        const CORNER_SIGNS: [DVec2; 4] = [
            DVec2::new(-1.0, -1.0),
            DVec2::new(1.0, -1.0),
            DVec2::new(1.0, 1.0),
            DVec2::new(-1.0, 1.0),
        ];
        let n = RIM_SAMPLES;
        let (x, y, middle, half) = self.rectangle(normal);
        if half.min_element() <= 0.0 {
            return None;
        }
        let place = |p: DVec3| (DVec2::new(p.dot(x), p.dot(y)) - middle) / half;
        let flat: Vec<DVec2> = self.smooth.iter().map(|&p| place(p)).collect();
        let mut sums = vec![0.0];
        for k in 0..n {
            sums.push(sums[k] + self.smooth[k].distance(self.smooth[(k + 1) % n]));
        }
        let side = |a: usize, b: usize| {
            if b > a {
                sums[b] - sums[a]
            } else {
                sums[n] - sums[a] + sums[b]
            }
        };
        let score = |c: &[usize; 4]| {
            // The order is kept, and no side is too short.
            let steps = [0, 1, 2, 3].map(|k| (c[(k + 1) % 4] + n - c[k]) % n);
            if steps.iter().sum::<usize>() != n || steps.iter().any(|&s| s < MIN_SIDE_SAMPLES) {
                return f64::NEG_INFINITY;
            }
            let l = [0, 1, 2, 3].map(|k| side(c[k], c[(k + 1) % 4]));
            let uneven = math::ln(l[0] / l[2]).powi(2) + math::ln(l[1] / l[3]).powi(2);
            let far: f64 = (0..4).map(|k| flat[c[k]].dot(CORNER_SIGNS[k])).sum();
            far - ASPECT_PENALTY * uneven
        };
        let farthest = |sign: DVec2| {
            let values = flat.iter().map(|p| p.dot(sign)).enumerate();
            values
                .fold((0, f64::NEG_INFINITY), |b, v| if v.1 > b.1 { v } else { b })
                .0
        };
        let mut corners = CORNER_SIGNS.map(farthest);
        if score(&corners) == f64::NEG_INFINITY {
            let first = corners[0];
            corners = [0, 1, 2, 3].map(|k| (first + k * n / 4) % n);
        }
        let mut best = score(&corners);
        let mut step = MIN_SIDE_SAMPLES;
        while step > 0 {
            let mut moved = false;
            for k in 0..4 {
                for sense in [step, n - step] {
                    let mut trial = corners;
                    trial[k] = (trial[k] + sense) % n;
                    let value = score(&trial);
                    if value > best + MIN_SCORE_GAIN {
                        (corners, best, moved) = (trial, value, true);
                    }
                }
            }
            if !moved {
                step /= 2;
            }
        }
        // The vertex farthest out within a sample's length of the corner.
        let grain = self.whole() * (CORNER_GRAIN / n as f64).max(1.0 / self.points.len() as f64);
        let mut chosen = [0; 4];
        for k in 0..4 {
            let length = self.whole() * corners[k] as f64 / n as f64;
            let mut nearest = (f64::INFINITY, 0);
            let mut farthest = (f64::NEG_INFINITY, None);
            for (v, &p) in self.points.iter().enumerate() {
                let apart = (self.lengths[v] - length).abs();
                let apart = apart.min(self.whole() - apart);
                if apart < nearest.0 {
                    nearest = (apart, v);
                }
                let far = place(p).dot(CORNER_SIGNS[k]);
                if apart <= grain && far > farthest.0 {
                    farthest = (far, Some(v));
                }
            }
            chosen[k] = farthest.1.unwrap_or(nearest.1);
        }
        let m = self.points.len();
        let ordered = [0, 1, 2, 3].map(|k| (chosen[(k + 1) % 4] + m - chosen[k]) % m);
        (ordered.iter().sum::<usize>() == m && ordered.iter().all(|&s| s > 0)).then_some(chosen)
    }

    /// Sets of four corners, counter-clockwise as the rim is, by several criteria: far out in the plane of `normal`, at
    /// sharp turns of the rim, and evenly spaced. `normals` are the surface's at the vertices.
    pub(super) fn candidates(&self, normal: DVec3, normals: &[DVec3]) -> Vec<[usize; 4]> {
        let mut sets = Vec::new();
        sets.extend(self.corners(normal));
        sets.extend(self.turning(normals));
        let from = sets.first().map_or(0, |c| c[0]);
        let first = self.lengths[from];
        for shift in 0..EVEN_ROTATIONS {
            let part = |k: usize| (k as f64 + shift as f64 / EVEN_ROTATIONS as f64) / 4.0;
            let even = [0, 1, 2, 3].map(|k| self.vertex_at(first + part(k) * self.whole()));
            sets.push(even);
        }
        let m = self.points.len();
        let ordered = |c: &[usize; 4]| {
            let steps = [0, 1, 2, 3].map(|k| (c[(k + 1) % 4] + m - c[k]) % m);
            steps.iter().sum::<usize>() == m && steps.iter().all(|&s| s > 0)
        };
        sets.retain(ordered);
        sets
    }

    /// The vertex nearest to a length along the rim.
    fn vertex_at(&self, length: f64) -> usize {
        let n = self.points.len();
        let length = length.rem_euclid(self.whole().max(f64::MIN_POSITIVE));
        let k = self.lengths.partition_point(|&l| l <= length).clamp(1, n) - 1;
        let nearer = self.lengths[k + 1] - length < length - self.lengths[k];
        if nearer { (k + 1) % n } else { k }
    }

    /// The four places where the smoothed rim turns most to the inside, with a penalty for unequal opposite sides.
    fn turning(&self, normals: &[DVec3]) -> Option<[usize; 4]> {
        let n = RIM_SAMPLES;
        let whole = self.whole();
        let reach = MIN_SIDE_SAMPLES;
        // 1. Angle between the chords before and behind, about the surface's normal.
        let turn = |k: usize| {
            let here = self.smooth[k];
            let come = here - self.smooth[(k + n - reach) % n];
            let go = self.smooth[(k + reach) % n] - here;
            let vertex = self.vertex_at(whole * k as f64 / n as f64);
            let normal = normals.get(vertex).copied().unwrap_or(DVec3::Z);
            math::atan2(come.cross(go).dot(normal), come.dot(go))
        };
        let turns: Vec<f64> = (0..n).map(turn).collect();
        // 2. Its maxima within the reach, the largest first.
        let is_peak = |k: &usize| {
            (1..=reach).all(|s| turns[*k] >= turns[(k + s) % n])
                && (1..=reach).all(|s| turns[*k] > turns[(k + n - s) % n])
        };
        let mut peaks: Vec<usize> = (0..n)
            .filter(is_peak)
            .filter(|&k| turns[k] > MIN_TURN)
            .collect();
        peaks.sort_by(|a, b| turns[*b].total_cmp(&turns[*a]).then(a.cmp(b)));
        peaks.truncate(MAX_PEAKS);
        peaks.sort_unstable();
        // 3. The best four.
        let mut best = (f64::NEG_INFINITY, None);
        let side = |a: usize, b: usize| ((b + n - a) % n) as f64;
        for (i, &a) in peaks.iter().enumerate() {
            for (j, &b) in peaks.iter().enumerate().skip(i + 1) {
                for (k, &c) in peaks.iter().enumerate().skip(j + 1) {
                    for &d in peaks.iter().skip(k + 1) {
                        let corners = [a, b, c, d];
                        let l = [side(a, b), side(b, c), side(c, d), side(d, a)];
                        let uneven = math::ln(l[0] / l[2]).powi(2) + math::ln(l[1] / l[3]).powi(2);
                        let sharp: f64 = corners.iter().map(|&k| turns[k].min(MAX_TURN)).sum();
                        let score = sharp - ASPECT_PENALTY * uneven;
                        if score > best.0 {
                            best = (score, Some(corners));
                        }
                    }
                }
            }
        }
        best.1
            .map(|c| c.map(|k| self.vertex_at(whole * k as f64 / n as f64)))
    }

    /// The rim on the border of a rectangle: each vertex by the length of its smoothed side. Straight sides keep their
    /// spacing exactly.
    pub(super) fn border(&self, corners: [usize; 4]) -> Option<Border> {
        let n = self.points.len();
        let mut lengths = [0.0; 4];
        // For each vertex of a side, the share of the side's smoothed length before it.
        let mut parts: [Vec<f64>; 4] = Default::default();
        let mut beside: [Vec<(DVec3, DVec3)>; 4] = Default::default();
        for k in 0..4 {
            let (from, to) = (corners[k], corners[(k + 1) % 4]);
            let count = (to + n - from) % n;
            let start = self.lengths[from];
            let raw: Vec<f64> = (0..=count)
                .map(|j| {
                    let v = from + j;
                    let turn = if v >= n { self.whole() } else { 0.0 };
                    self.lengths[v % n] + turn - start
                })
                .collect();
            let whole = raw[count];
            let samples =
                (SAMPLES_PER_EDGE * count).clamp(RIM_SIDE_SAMPLES[0], RIM_SIDE_SAMPLES[1]);
            let chain: Vec<DVec3> = (0..=samples)
                .map(|j| {
                    if j == samples {
                        self.points[to]
                    } else {
                        self.at(start + whole * j as f64 / samples as f64)
                    }
                })
                .collect();
            let reach = SMOOTHING_EDGES * samples as f64 / count.max(1) as f64;
            // Beyond its ends the side is continued point-symmetrically.
            let smooth = smoothed(&chain, reach, |a, (k, step), sense| {
                let last = a.len() - 1;
                match sense {
                    1 if k + step > last => 2.0 * a[last] - a[last.saturating_sub(k + step - last)],
                    1 => a[k + step],
                    _ if step > k => 2.0 * a[0] - a[(step - k).min(last)],
                    _ => a[k - step],
                }
            });
            let mut sums = vec![0.0];
            for (j, pair) in smooth.windows(2).enumerate() {
                sums.push(sums[j] + pair[0].distance(pair[1]));
            }
            lengths[k] = sums[samples];
            if !(lengths[k] > 0.0 && whole > 0.0) {
                return None;
            }
            let at = |x: f64| {
                let x = x.clamp(0.0, samples as f64);
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "within the samples"
                )]
                let j = (x as usize).min(samples - 1);
                smooth[j].lerp(smooth[j + 1], x - j as f64)
            };
            let step = 0.5 * samples as f64 / count.max(1) as f64;
            beside[k] = raw
                .iter()
                .map(|l| l / whole * samples as f64)
                .map(|x| (at(x), at(x + step) - at(x - step)))
                .collect();
            parts[k] = raw
                .iter()
                .map(|l| {
                    let at = l / whole * samples as f64;
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "within the samples"
                    )]
                    let j = (at as usize).min(samples - 1);
                    (sums[j] + (at - j as f64) * (sums[j + 1] - sums[j])) / lengths[k]
                })
                .collect();
        }
        let size = 0.5 * DVec2::new(lengths[0] + lengths[2], lengths[1] + lengths[3]);
        let ends = [
            DVec2::ZERO,
            DVec2::new(size.x, 0.0),
            size,
            DVec2::new(0.0, size.y),
        ];
        let mut places = vec![DVec2::ZERO; n];
        for k in 0..4 {
            let last = parts[k].len() - 1;
            for (j, &part) in parts[k][..last].iter().enumerate() {
                places[(corners[k] + j) % n] = ends[k].lerp(ends[(k + 1) % 4], part);
            }
        }
        Some(Border {
            places,
            beside,
            size,
        })
    }
}

/// Means with binomial-like weights over `reach` samples to either side: two passes of a running mean. `neighbour`
/// gives the value a number of steps after (1) or before (-1) a sample.
fn smoothed(
    samples: &[DVec3],
    reach: f64,
    neighbour: impl Fn(&[DVec3], (usize, usize), isize) -> DVec3,
) -> Vec<DVec3> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the samples"
    )]
    let half = reach
        .round()
        .clamp(0.0, samples.len() as f64 / MAX_SMOOTHING) as usize;
    let mut values = samples.to_vec();
    for _ in 0..SMOOTHING_PASSES {
        values = (0..values.len())
            .map(|k| {
                let steps = 1..=half;
                let sum = steps.fold(values[k], |sum, s| {
                    sum + neighbour(&values, (k, s), 1) + neighbour(&values, (k, s), -1)
                });
                sum / (2 * half + 1) as f64
            })
            .collect();
    }
    values
}

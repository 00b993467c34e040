//! The order of points along the profile of a surface of revolution.
//!
//! Points turned into the half plane through the axis lie on the profile, unordered and with noise across it. A walk in
//! steps of fixed length goes from one local mean to the next: the mean normal of the points around, and the median of
//! their offsets along it. Normals give the direction of the walk and tell the two sides of a thin wall apart. The walk
//! crosses gaps of up to 2.5 steps and turns round corners.
//!
//! Source: ours; a moving-least-squares curve traced point by point (compare Lee 2000, curve reconstruction from
//! unorganised points).

use glam::DVec2;
use nurbskin_geometry::numeric::statistics::median_in_place;

/// Most steps of a walk. Guard: ends a walk that goes round without closing.
const MAX_WALK_STEPS: usize = 4000;
/// Fewest points that make a local mean. Guard: with three, the median offset resists one outlier.
const MIN_LOCAL_POINTS: usize = 3;
/// Least cosine between the normal of a place and those of the points that belong to it (70 degrees). Trial: not
/// recorded. A larger one loses points at bends, a smaller one joins the two sides of a thin wall.
const MIN_NORMAL_COSINE: f64 = 0.35;
/// Last steps of a walk that are left out when it is tested for a return to where it was. Trial: not recorded.
const RECENT_STEPS: usize = 6;
/// Distance from the profile, in steps, beyond which a point is not on it. Trial: not recorded.
const MAX_PROFILE_DISTANCE: f64 = 2.5;
/// Distance from the profile, in steps, up to which a point whose normal has the wrong side belongs to it. Trial: not
/// recorded. A larger one takes points of the other side of a thin wall.
const MAX_FLIPPED_DISTANCE: f64 = 0.5;
/// Most cells of the search grid along a direction. Guard: bounds its memory.
const MAX_CELLS: f64 = 2000.0;
/// Distances of the next place that are tried in turn, in steps: the longer ones cross gaps. Trial: not recorded.
const WALK_REACHES: [f64; 3] = [1.0, 1.5, 2.5];
/// Radius of the local mean, in steps. Trial: not recorded. A smaller one holds too few points, a larger one cuts
/// corners.
const MEAN_RADIUS: f64 = 0.75;
/// Least advance of the walk along its direction, in steps. Trial: not recorded; it keeps the walk from standing still.
const MIN_ADVANCE: f64 = 0.3;
/// Longest move of the walk, in reaches of the trial. Trial: not recorded; it keeps the walk from jumping to another
/// branch.
const MAX_ADVANCE: f64 = 2.0;
/// Radius in which the walk looks for the place round a corner, in reaches of the trial. Trial: not recorded.
const CORNER_RADIUS: f64 = 1.5;
/// Least cosine between the normals before and behind a corner (154 degrees). Trial: not recorded. A smaller one goes
/// back on the other side of a thin wall.
const MIN_CORNER_COSINE: f64 = -0.9;
/// Limits for a point round a corner, in steps: its least advance along the new direction, its least advance along the
/// old one, and its largest distance across the new one. Trial: not recorded.
const CORNER_LIMITS: [f64; 3] = [0.5, -0.2, 0.6];
/// Distance from its start, in steps, at which a walk has closed. Trial: not recorded; it is less than a step, so that
/// no walk passes its start.
const CLOSING_DISTANCE: f64 = 0.8;
/// Distance from an earlier place, in steps, at which a walk has lost its way. Trial: not recorded; a larger one takes
/// a neighbouring branch for the walk's own.
const RETURN_DISTANCE: f64 = 0.4;
/// Fewest places of a profile. Guard: a cubic needs four.
const MIN_WALK_PLACES: usize = 4;

/// Points in the half plane (radius, height), with normals in it: unit, or zero where the normal does not lie in it.
#[derive(Clone, Debug, Default)]
pub(super) struct Meridian {
    pub(super) points: Vec<DVec2>,
    pub(super) normals: Vec<DVec2>,
}

/// Square cells, each with a list of items, in compressed rows.
struct Cells {
    low: DVec2,
    size: f64,
    counts: [usize; 2],
    starts: Vec<usize>,
    items: Vec<u32>,
}

impl Cells {
    fn new(points: &[DVec2], size: f64) -> Self {
        let low = points.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = points.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to MAX_CELLS"
        )]
        let counts = ((high - low) / size)
            .to_array()
            .map(|c| c.ceil().clamp(1.0, MAX_CELLS) as usize);
        let longest = (high - low).max_element();
        let mut this = Self {
            low,
            size: size.max(longest / MAX_CELLS),
            counts,
            starts: vec![0; counts[0] * counts[1] + 1],
            items: vec![0; points.len()],
        };
        let cells: Vec<usize> = points.iter().map(|&p| this.index(this.cell(p))).collect();
        for &cell in &cells {
            this.starts[cell + 1] += 1;
        }
        for k in 1..this.starts.len() {
            this.starts[k] += this.starts[k - 1];
        }
        let mut next = this.starts.clone();
        for (k, &cell) in (0_u32..).zip(&cells) {
            this.items[next[cell]] = k;
            next[cell] += 1;
        }
        this
    }
    fn cell(&self, p: DVec2) -> [usize; 2] {
        let at = ((p - self.low) / self.size).to_array();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the cells"
        )]
        std::array::from_fn(|k| at[k].clamp(0.0, (self.counts[k] - 1) as f64) as usize)
    }
    fn index(&self, [i, j]: [usize; 2]) -> usize {
        j * self.counts[0] + i
    }
    /// Calls `f` for all items in cells within `radius` of p.
    fn near(&self, p: DVec2, radius: f64, mut f: impl FnMut(usize)) {
        let low = self.cell(p - radius);
        let high = self.cell(p + radius);
        for j in low[1]..=high[1] {
            for cell in self.index([low[0], j])..=self.index([high[0], j]) {
                for &k in &self.items[self.starts[cell]..self.starts[cell + 1]] {
                    f(k as usize);
                }
            }
        }
    }
    /// The items of the fullest cell.
    fn fullest(&self) -> &[u32] {
        let mut best = 0..0;
        for w in self.starts.windows(2) {
            if w[1] - w[0] > best.len() {
                best = w[0]..w[1];
            }
        }
        &self.items[best]
    }
}

/// A place of the walk, with its normal.
#[derive(Clone, Copy, Debug)]
struct Place {
    at: DVec2,
    normal: DVec2,
}

/// The direction of the profile where the normal is `n`: the surface normal of a profile that runs this way is n.
pub(super) fn along(n: DVec2) -> DVec2 {
    DVec2::new(n.y, -n.x)
}

struct Walk<'a> {
    data: &'a Meridian,
    cells: Cells,
    step: f64,
    /// Whether the sides of normals are known.
    oriented: bool,
}

/// How a walk in one direction ended.
enum End {
    Open,
    Closed,
    Lost,
}

impl Walk<'_> {
    /// The normal of point k, on the side of the normal `n`; `None` if the angle between them is too large.
    fn agreeing(&self, k: usize, n: DVec2, least: f64) -> Option<DVec2> {
        let m = self.data.normals[k];
        let cosine = m.dot(n);
        if cosine > least {
            Some(m)
        } else if !self.oriented && -cosine > least {
            Some(-m)
        } else {
            None
        }
    }

    /// The local mean near a place: the mean normal of the points around it with similar normals, and the median of
    /// their offsets along it.
    fn mean(&self, place: Place, radius: f64) -> Option<Place> {
        let mut place = place;
        for _ in 0..2 {
            let mut normal = DVec2::ZERO;
            let mut around = Vec::new();
            self.cells.near(place.at, radius, |k| {
                let q = self.data.points[k];
                if q.distance_squared(place.at) <= radius * radius
                    && let Some(m) = self.agreeing(k, place.normal, MIN_NORMAL_COSINE)
                {
                    normal += m;
                    around.push(q);
                }
            });
            let normal = normal.try_normalize()?;
            if around.len() < MIN_LOCAL_POINTS {
                return None;
            }
            let mut offsets: Vec<f64> = around.iter().map(|q| (q - place.at).dot(normal)).collect();
            place = Place {
                at: place.at + median_in_place(&mut offsets) * normal,
                normal,
            };
        }
        Some(place)
    }

    /// The next place, if any: ahead, a little farther over a gap, or round a corner.
    fn next(&self, from: Place, sign: f64) -> Option<Place> {
        let ahead = sign * along(from.normal);
        for reach in WALK_REACHES {
            let guess = Place {
                at: from.at + reach * self.step * ahead,
                ..from
            };
            if guess.at.x <= 0.0 {
                return None;
            }
            let found = self.mean(guess, reach.max(1.0) * MEAN_RADIUS * self.step);
            if let Some(place) = found.filter(|p| {
                let moved = p.at - from.at;
                moved.dot(ahead) > MIN_ADVANCE * self.step
                    && moved.length() < MAX_ADVANCE * reach * self.step
            }) {
                return Some(place);
            }
            if let Some(place) = self.corner(from, ahead, sign, reach) {
                return Some(place);
            }
        }
        None
    }

    /// The place round a corner: the nearest point whose own direction continues the walk.
    fn corner(&self, from: Place, ahead: DVec2, sign: f64, reach: f64) -> Option<Place> {
        let radius = CORNER_RADIUS * reach * self.step;
        let mut best: Option<(f64, Place)> = None;
        self.cells.near(from.at, radius, |k| {
            let offset = self.data.points[k] - from.at;
            let Some(m) = self.agreeing(k, from.normal, MIN_CORNER_COSINE) else {
                return;
            };
            let leads = sign * along(m);
            let (far, forward) = (offset.length(), offset.dot(leads));
            // The point lies ahead of the old direction or the new one, and does not lead back.
            let on = forward > CORNER_LIMITS[0] * self.step
                && offset.dot(ahead) > CORNER_LIMITS[1] * self.step
                && (offset - forward * leads).length() < CORNER_LIMITS[2] * self.step
                && far <= radius;
            if on && best.is_none_or(|(b, _)| far < b) {
                let place = Place {
                    at: self.data.points[k],
                    normal: m,
                };
                best = Some((far, place));
            }
        });
        let (_, place) = best?;
        self.mean(place, MEAN_RADIUS * self.step).or(Some(place))
    }

    /// Walks from `start` to the end of the profile, or around it.
    fn go(&self, start: Place, sign: f64) -> (Vec<Place>, End) {
        let mut places = vec![start];
        let mut here = start;
        while places.len() < MAX_WALK_STEPS {
            let Some(next) = self.next(here, sign) else {
                return (places, End::Open);
            };
            let same = |p: &Place, far: f64| {
                p.at.distance(next.at) < far * self.step
                    && p.normal.dot(next.normal) > MIN_NORMAL_COSINE
            };
            if places.len() > RECENT_STEPS {
                let old = &places[..places.len() - RECENT_STEPS];
                if same(&old[0], CLOSING_DISTANCE) {
                    return (places, End::Closed);
                }
                if old.iter().any(|p| same(p, RETURN_DISTANCE)) {
                    return (places, End::Lost);
                }
            }
            places.push(next);
            here = next;
        }
        (places, End::Lost)
    }
}

/// An ordered profile: consecutive places with their normals, and the length along the profile up to each.
#[derive(Clone, Debug)]
pub(super) struct Trace {
    pub(super) places: Vec<DVec2>,
    pub(super) normals: Vec<DVec2>,
    pub(super) lengths: Vec<f64>,
    pub(super) closed: bool,
    pub(super) step: f64,
    pub(super) oriented: bool,
}

/// Walks along the profile in steps of `step`; `None` for points that do not lie along one line.
pub(super) fn trace(data: &Meridian, step: f64, oriented: bool) -> Option<Trace> {
    let cells = Cells::new(&data.points, step);
    // 1. Start in the fullest cell, at the local mean of its first point with a normal.
    let start = cells
        .fullest()
        .iter()
        .map(|&k| k as usize)
        .find(|&k| data.normals[k] != DVec2::ZERO)?;
    let start = Place {
        at: data.points[start],
        normal: data.normals[start],
    };
    let walk = Walk {
        data,
        cells,
        step,
        oriented,
    };
    let start = walk.mean(start, step)?;
    // 2. Forwards, and backwards unless the walk closed.
    let (mut places, end) = walk.go(start, 1.0);
    let closed = match end {
        End::Closed => true,
        End::Lost => return None,
        End::Open => {
            let (back, end) = walk.go(start, -1.0);
            if !matches!(end, End::Open) {
                return None;
            }
            let mut all: Vec<Place> = back.into_iter().rev().collect();
            all.extend_from_slice(&places[1..]);
            places = all;
            false
        }
    };
    if places.len() < MIN_WALK_PLACES {
        return None;
    }
    // 3. Lengths.
    let mut lengths = vec![0.0];
    for w in places.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + w[0].at.distance(w[1].at));
    }
    if closed {
        let gap = places[places.len() - 1].at.distance(places[0].at);
        lengths.push(lengths[lengths.len() - 1] + gap);
        places.push(places[0]);
    }
    Some(Trace {
        places: places.iter().map(|p| p.at).collect(),
        normals: places.iter().map(|p| p.normal).collect(),
        lengths,
        closed,
        step,
        oriented,
    })
}

/// The straight line between two places of a trace.
struct Segment {
    start: DVec2,
    /// Its unit direction.
    side: DVec2,
    /// Range of foot points along it; at open ends of the trace it extends beyond.
    range: [f64; 2],
    /// Sum of the normals at both ends.
    normal: DVec2,
    /// Length along the trace at its start.
    length: f64,
}

impl Trace {
    fn segment(&self, i: usize, reach: f64) -> Segment {
        let (a, b) = (self.places[i], self.places[i + 1]);
        let width = a.distance(b);
        let [first, last] = [i == 0, i + 2 == self.places.len()].map(|end| end && !self.closed);
        Segment {
            start: a,
            side: (b - a).try_normalize().unwrap_or_default(),
            range: [
                if first { -reach } else { 0.0 },
                if last { width + reach } else { width },
            ],
            normal: self.normals[i] + self.normals[i + 1],
            length: self.lengths[i],
        }
    }

    /// Length of the whole trace.
    pub(super) fn length(&self) -> f64 {
        self.lengths.last().copied().unwrap_or(0.0)
    }

    /// The length along the profile of each point, see [`Places::of`]. O(points x places / cells).
    pub(super) fn locate(&self, data: &Meridian) -> Vec<f64> {
        let places = self.places_along();
        let all = data.points.iter().zip(&data.normals);
        all.map(|(&q, &m)| places.of(q, m)).collect()
    }

    /// The search structure for lengths along the profile.
    pub(super) fn places_along(&self) -> Places {
        let reach = MAX_PROFILE_DISTANCE * self.step;
        let last = self.places.len() - 1;
        Places {
            cells: Cells::new(&self.places, 2.0 * self.step),
            segments: (0..last).map(|i| self.segment(i, reach)).collect(),
            reach,
            step: self.step,
            oriented: self.oriented,
            stray: 0.0,
        }
    }

    /// The same, but points close to the profile with a normal on the wrong side get a place on it if no other fits:
    /// normals of clouds may have the wrong side.
    pub(super) fn places_of_all(&self) -> Places {
        Places {
            stray: MAX_FLIPPED_DISTANCE * self.step,
            ..self.places_along()
        }
    }
}

/// The segments of a trace, sorted into cells.
pub(super) struct Places {
    cells: Cells,
    segments: Vec<Segment>,
    reach: f64,
    step: f64,
    oriented: bool,
    /// Largest distance of points whose normal has the wrong side.
    stray: f64,
}

impl Places {
    /// The length along the profile of a point with the normal `m`, which may lie beyond the ends, or NaN for a point
    /// that is not on it.
    pub(super) fn of(&self, q: DVec2, m: DVec2) -> f64 {
        let last = self.segments.len();
        let mut best = (self.reach * self.reach, f64::NAN);
        let mut stray = (self.stray * self.stray, f64::NAN);
        let mut before = usize::MAX;
        self.cells.near(q, self.reach + self.step, |k| {
            // The segments before and after place k, unless the former was visited with place k - 1.
            let met = before == k.wrapping_sub(1);
            let first = if met { k } else { k.saturating_sub(1) };
            before = k;
            for segment in &self.segments[first.min(last)..(k + 1).min(last)] {
                let t = (q - segment.start).dot(segment.side);
                let t = t.clamp(segment.range[0], segment.range[1]);
                let far = q.distance_squared(segment.start + t * segment.side);
                if far < best.0 {
                    let agreement = m.dot(segment.normal);
                    let alike = if self.oriented {
                        agreement
                    } else {
                        agreement.abs()
                    };
                    if alike > 0.0 || m == DVec2::ZERO {
                        best = (far, segment.length + t);
                    } else if far < stray.0 {
                        stray = (far, segment.length + t);
                    }
                }
            }
        });
        if best.1.is_finite() { best.1 } else { stray.1 }
    }
}

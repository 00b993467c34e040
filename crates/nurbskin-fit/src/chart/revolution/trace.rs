//! The order of points along the profile of a surface of revolution.
//!
//! All points turned into one half plane through the axis lie on the profile, in no order and with noise across it. A
//! walk along it goes from one local mean to the next; normals tell where it leads, and the two sides of a thin wall
//! apart.

use glam::DVec2;
use nurbskin_geometry::numeric::statistics::median_in_place;

/// Steps of a walk at most.
const STEPS: usize = 4000;
/// Fewest points that make a local mean.
const FEWEST: usize = 3;
/// Least cosine between the normals of a place and of points that belong to it.
const ALIKE: f64 = 0.35;
/// Steps within which a walk must not come back to where it was.
const RECENT: usize = 6;
/// Points farther from the profile than this many steps are not on it.
const REACH: f64 = 2.5;
/// Points that look the wrong way are on it if they are not farther than this part of a step.
const STRAY: f64 = 0.5;

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
            reason = "clamped to 1..=2000"
        )]
        let counts = ((high - low) / size)
            .to_array()
            .map(|c| c.ceil().clamp(1.0, 2000.0) as usize);
        let longest = (high - low).max_element();
        let mut this = Self {
            low,
            size: size.max(longest / 2000.0),
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

/// A place of the walk.
#[derive(Clone, Copy, Debug)]
struct Place {
    at: DVec2,
    normal: DVec2,
}

/// The direction of the profile where the normal is `n`: with it, the surface's own normal looks along n.
pub(super) fn along(n: DVec2) -> DVec2 {
    DVec2::new(n.y, -n.x)
}

struct Walk<'a> {
    data: &'a Meridian,
    cells: Cells,
    step: f64,
    /// Whether normals are known with their side.
    oriented: bool,
}

/// How a walk in one direction ended.
enum End {
    Open,
    Closed,
    Lost,
}

impl Walk<'_> {
    /// The normal of point k as seen from a place with the normal n; `None` if it does not belong there.
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

    /// The local mean near a place: the mean normal of the points around that look the same way, and the median of
    /// their offsets.
    fn mean(&self, place: Place, radius: f64) -> Option<Place> {
        let mut place = place;
        for _ in 0..2 {
            let mut normal = DVec2::ZERO;
            let mut around = Vec::new();
            self.cells.near(place.at, radius, |k| {
                let q = self.data.points[k];
                if q.distance_squared(place.at) <= radius * radius
                    && let Some(m) = self.agreeing(k, place.normal, ALIKE)
                {
                    normal += m;
                    around.push(q);
                }
            });
            let normal = normal.try_normalize()?;
            if around.len() < FEWEST {
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

    /// The next place, where there is one: ahead, a little farther over a gap, or around a corner.
    fn next(&self, from: Place, sign: f64) -> Option<Place> {
        let ahead = sign * along(from.normal);
        for reach in [1.0, 1.5, 2.5] {
            let guess = Place {
                at: from.at + reach * self.step * ahead,
                ..from
            };
            if guess.at.x <= 0.0 {
                return None;
            }
            let found = self.mean(guess, reach.max(1.0) * 0.75 * self.step);
            if let Some(place) = found.filter(|p| {
                let moved = p.at - from.at;
                moved.dot(ahead) > 0.3 * self.step && moved.length() < 2.0 * reach * self.step
            }) {
                return Some(place);
            }
            if let Some(place) = self.corner(from, ahead, sign, reach) {
                return Some(place);
            }
        }
        None
    }

    /// The place around a corner: the nearest point ahead whose own direction leads on.
    fn corner(&self, from: Place, ahead: DVec2, sign: f64, reach: f64) -> Option<Place> {
        let radius = 1.5 * reach * self.step;
        let mut best: Option<(f64, Place)> = None;
        self.cells.near(from.at, radius, |k| {
            let offset = self.data.points[k] - from.at;
            let Some(m) = self.agreeing(k, from.normal, -0.9) else {
                return;
            };
            let leads = sign * along(m);
            let (far, forward) = (offset.length(), offset.dot(leads));
            // It continues the walk: it lies ahead of the old direction or the new one, and does not lead back.
            let on = forward > 0.5 * self.step
                && offset.dot(ahead) > -0.2 * self.step
                && (offset - forward * leads).length() < 0.6 * self.step
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
        self.mean(place, 0.75 * self.step).or(Some(place))
    }

    /// Walks from `start` to the end of the profile, or around it.
    fn go(&self, start: Place, sign: f64) -> (Vec<Place>, End) {
        let mut places = vec![start];
        let mut here = start;
        while places.len() < STEPS {
            let Some(next) = self.next(here, sign) else {
                return (places, End::Open);
            };
            let same = |p: &Place, far: f64| {
                p.at.distance(next.at) < far * self.step && p.normal.dot(next.normal) > ALIKE
            };
            if places.len() > RECENT {
                let old = &places[..places.len() - RECENT];
                if same(&old[0], 0.8) {
                    return (places, End::Closed);
                }
                if old.iter().any(|p| same(p, 0.4)) {
                    return (places, End::Lost);
                }
            }
            places.push(next);
            here = next;
        }
        (places, End::Lost)
    }
}

/// An ordered profile: places in a row with their normals, and how far along each is.
#[derive(Clone, Debug)]
pub(super) struct Trace {
    pub(super) places: Vec<DVec2>,
    pub(super) normals: Vec<DVec2>,
    pub(super) lengths: Vec<f64>,
    pub(super) closed: bool,
    pub(super) step: f64,
    pub(super) oriented: bool,
}

/// Walks along the profile in steps of `step`; `None` where the points do not lie along one line.
pub(super) fn trace(data: &Meridian, step: f64, oriented: bool) -> Option<Trace> {
    let cells = Cells::new(&data.points, step);
    // 1. Start in the fullest cell, at its point in the middle of those that look the same way.
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
    // 2. Forwards, and backwards unless that came around.
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
    if places.len() < 4 {
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
    /// Where along it feet may lie: at open ends of the trace beyond it, too.
    range: [f64; 2],
    /// Sum of the normals at both ends.
    normal: DVec2,
    /// How far along the trace it starts.
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

    /// Length of the whole.
    pub(super) fn length(&self) -> f64 {
        self.lengths.last().copied().unwrap_or(0.0)
    }

    /// For each point how far along the profile it is, see [`Places::of`]. O(points x places / cells).
    pub(super) fn locate(&self, data: &Meridian) -> Vec<f64> {
        let places = self.places_along();
        let all = data.points.iter().zip(&data.normals);
        all.map(|(&q, &m)| places.of(q, m)).collect()
    }

    /// What tells for any point where along the profile it is.
    pub(super) fn places_along(&self) -> Places {
        let reach = REACH * self.step;
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

    /// The same, but that points right on the profile whose normals look the other way have a place on it where there
    /// is no other: normals of clouds may err in their side.
    pub(super) fn places_of_all(&self) -> Places {
        Places {
            stray: STRAY * self.step,
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
    /// How near points with the wrong side must be.
    stray: f64,
}

impl Places {
    /// How far along the profile a point with the normal `m` is, beyond the ends where it lies there, or NaN where it
    /// is not on it.
    pub(super) fn of(&self, q: DVec2, m: DVec2) -> f64 {
        let last = self.segments.len();
        let mut best = (self.reach * self.reach, f64::NAN);
        let mut stray = (self.stray * self.stray, f64::NAN);
        let mut before = usize::MAX;
        self.cells.near(q, self.reach + self.step, |k| {
            // The segment before the place k, unless that was met as the one after its start, and the one after.
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

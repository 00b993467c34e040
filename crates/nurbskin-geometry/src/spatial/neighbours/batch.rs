//! The nearest neighbours of all points at once: the points of a leaf look among the same candidates.

use super::{Bounds, FAN, LEAF, Nearest, Neighbours};
use std::ops::Range;

/// Leaves on either side of a leaf that bound the neighbourhood of a single point.
const WINDOW: usize = 2;
/// Candidates that are looked through one by one; where there are more, the tree is searched nearest first.
const MOST: usize = 384;
/// Part of the points of a leaf, and times, whose farthest neighbour tells how far the next leaf looks.
const EXPECTED: (usize, f64) = (5, 1.2);

/// Points that come into question as neighbours, ascending by place.
#[derive(Debug, Default)]
struct Candidates {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
    places: Vec<u32>,
}

/// Memory that the searches of one task share.
#[derive(Debug)]
pub struct Scratch {
    /// Nodes still to visit.
    open: Vec<(usize, usize)>,
    of_leaf: Candidates,
    of_point: Candidates,
    squares: Vec<f64>,
    keys: Vec<u64>,
    nearest: Nearest,
    /// How far the points of the next leaf are expected to look.
    expected: f64,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            open: Vec::new(),
            of_leaf: Candidates::default(),
            of_point: Candidates::default(),
            squares: Vec::new(),
            keys: Vec::new(),
            nearest: Nearest::default(),
            expected: f64::INFINITY,
        }
    }
}

impl Neighbours {
    /// Gives `take` each point of a range of places in spatial order, which starts at a leaf, and its `count` nearest
    /// others.
    ///
    /// The points of a leaf share one way through the tree: all points within a distance of the leaf's box, which the
    /// leaf before tells, are its candidates. A point whose neighbourhood turns out to be larger looks again by
    /// itself, so that the guess costs time at worst.
    pub fn search_range(
        &self,
        range: Range<usize>,
        count: usize,
        scratch: &mut Scratch,
        mut take: impl FnMut(usize, &Nearest),
    ) {
        if count == 0 {
            return;
        }
        for leaf in range.start / LEAF..range.end.div_ceil(LEAF) {
            let mine = leaf * LEAF..range.end.min((leaf + 1) * LEAF);
            let square = scratch.expected * scratch.expected;
            let Scratch { open, of_leaf, .. } = scratch;
            let shared = self.gather(&self.levels[0][leaf], square, open, of_leaf);
            let mut reaches = [0.0; LEAF];
            for (k, reach) in mine.clone().zip(&mut reaches) {
                if !(shared && self.pick(k, count, square, scratch)) {
                    self.alone(k, count, scratch);
                }
                take(k, &scratch.nearest);
                *reach = scratch.nearest.items.last().map_or(0.0, |last| last.0);
            }
            let reaches = &mut reaches[..mine.len()];
            let which = EXPECTED.0.min(reaches.len() - 1);
            let (_, reach, _) = reaches.select_nth_unstable_by(which, f64::total_cmp);
            scratch.expected = EXPECTED.1 * reach.sqrt();
        }
    }

    /// Lists the points of all leaves within a squared distance of a box; `false` if there are too many.
    fn gather(
        &self,
        around: &Bounds,
        square: f64,
        open: &mut Vec<(usize, usize)>,
        found: &mut Candidates,
    ) -> bool {
        found.clear();
        open.clear();
        if square.is_finite() || self.len() <= MOST {
            open.push((self.levels.len() - 1, 0));
        } else {
            return false;
        }
        while let Some((level, node)) = open.pop() {
            if self.levels[level][node].distance_squared(around.low, around.high) > square {
                continue;
            }
            if level == 0 {
                let places = self.places(node);
                if found.places.len() + places.len() > MOST {
                    return false;
                }
                let points = &self.points[places.clone()];
                found.x.extend(points.iter().map(|p| p.x));
                found.y.extend(points.iter().map(|p| p.y));
                found.z.extend(points.iter().map(|p| p.z));
                #[expect(clippy::cast_possible_truncation, reason = "at most 2^32 points")]
                found.places.extend(places.map(|place| place as u32));
                continue;
            }
            // The first child on top, so that places ascend.
            let end = self.levels[level - 1].len().min((node + 1) * FAN);
            open.extend((node * FAN..end).rev().map(|child| (level - 1, child)));
        }
        true
    }

    /// Finds the `count` nearest others of a point among the candidates of its leaf; `false` if fewer are within the
    /// squared distance.
    fn pick(&self, k: usize, count: usize, square: f64, scratch: &mut Scratch) -> bool {
        let Scratch {
            of_leaf,
            squares,
            keys,
            nearest,
            ..
        } = scratch;
        self.select(k, count, square, of_leaf, squares, keys, nearest)
    }

    fn select(
        &self,
        k: usize,
        count: usize,
        square: f64,
        among: &Candidates,
        squares: &mut Vec<f64>,
        keys: &mut Vec<u64>,
        nearest: &mut Nearest,
    ) -> bool {
        let point = self.points[k];
        let total = among.places.len();
        squares.clear();
        let xyz = among.x.iter().zip(&among.y).zip(&among.z);
        squares.extend(xyz.map(|((x, y), z)| {
            let (x, y, z) = (x - point.x, y - point.y, z - point.z);
            x * x + y * y + z * z
        }));
        // 1. Those within the distance. A key is the square in single precision, which as bits sorts as it does as a
        // number, and the place in the list.
        let scale = 1.0 / square.clamp(1e-300, 1e300);
        keys.resize(total.max(keys.len()), 0);
        let mut within = 0;
        for (i, (&distance, &place)) in (0_u64..).zip(squares.iter().zip(&among.places)) {
            #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
            let rounded = (distance * scale) as f32;
            // Written in any case, kept if it counts.
            if let Some(key) = keys.get_mut(within) {
                *key = u64::from(rounded.to_bits()) << 32 | i;
            }
            within += usize::from((distance <= square) & (place as usize != k));
        }
        if within < count {
            return false;
        }
        let keys = &mut keys[..within];
        keys.sort_unstable();
        // 2. What is the same in single precision is put in order by the exact distance and the index.
        nearest.reset(count);
        let (mut last, most) = (u64::MAX, keys[count - 1] >> 32);
        for key in keys.iter() {
            let rounded = key >> 32;
            if rounded > most {
                break;
            }
            #[expect(clippy::cast_possible_truncation, reason = "the lower half is meant")]
            let i = (key & u64::from(u32::MAX)) as usize;
            let candidate = (squares[i], self.index(among.places[i] as usize));
            if rounded == last || nearest.items.len() == count {
                nearest.offer(candidate);
            } else {
                nearest.items.push(candidate);
            }
            last = rounded;
        }
        true
    }

    /// Finds the `count` nearest others of a single point: the leaves around its own in the order bound them.
    fn alone(&self, k: usize, count: usize, scratch: &mut Scratch) {
        let point = self.points[k];
        let leaf = k / LEAF;
        let start = leaf.saturating_sub(WINDOW) * LEAF;
        let end = self.points.len().min((leaf + WINDOW + 1) * LEAF);
        let Scratch {
            open,
            of_point,
            squares,
            keys,
            nearest,
            ..
        } = scratch;
        squares.clear();
        let window = self.points[start..end].iter();
        squares.extend(window.map(|p| p.distance_squared(point)));
        // The point itself is one of them.
        if count < squares.len() {
            let (_, &mut square, _) = squares.select_nth_unstable_by(count, f64::total_cmp);
            let around = Bounds {
                low: point,
                high: point,
            };
            if self.gather(&around, square, open, of_point)
                && self.select(k, count, square, of_point, squares, keys, nearest)
            {
                return;
            }
        }
        self.search(point, count, nearest, |j| j != self.index(k));
    }
}

impl Candidates {
    fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
        self.places.clear();
    }
}

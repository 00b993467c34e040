//! Points by cubes.

use glam::DVec3;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Bits per coordinate of a cell.
const BITS: u32 = 21;

/// Points in cubes of at least a certain size, sorted within each by coordinates.
#[derive(Debug)]
pub(super) struct Cells {
    low: DVec3,
    size: f64,
    /// Which cube each cell is.
    pub(super) keys: Vec<u64>,
    by_key: HashMap<u64, u32, BuildHasherDefault<Mixer>>,
    starts: Vec<usize>,
    members: Vec<u32>,
}

impl Cells {
    pub(super) fn new(points: &[DVec3], size: f64) -> Self {
        let finite = |p: &&DVec3| p.is_finite();
        let (low, high) = points
            .iter()
            .filter(finite)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &p| {
                (low.min(p), high.max(p))
            });
        // Larger cubes only take longer.
        let least = (high - low).max_element() / f64::from((1_u32 << BITS) - 3);
        let mut this = Self {
            low,
            size: size.max(least),
            keys: Vec::new(),
            by_key: HashMap::default(),
            starts: Vec::new(),
            members: Vec::new(),
        };
        // 1. Numbers of cells; points that come in a good order change theirs seldom.
        let mut counts: Vec<usize> = Vec::new();
        let mut last = (u64::MAX, 0);
        let cells: Vec<u32> = points
            .iter()
            .map(|p| {
                if !p.is_finite() {
                    return u32::MAX;
                }
                let key = this.key(*p);
                if key != last.0 {
                    let keys = &mut this.keys;
                    let number = *this.by_key.entry(key).or_insert_with(|| {
                        keys.push(key);
                        counts.push(0);
                        u32::try_from(keys.len() - 1).unwrap_or(u32::MAX)
                    });
                    last = (key, number);
                }
                counts[last.1 as usize] += 1;
                last.1
            })
            .collect();
        // 2. Points by cell.
        let mut next = 0;
        this.starts = counts.iter().map(|n| (next, next += n).0).collect();
        let mut at = this.starts.clone();
        this.starts.push(next);
        this.members = vec![0; next];
        for (k, &cell) in (0_u32..).zip(&cells).filter(|(_, cell)| **cell != u32::MAX) {
            this.members[at[cell as usize]] = k;
            at[cell as usize] += 1;
        }
        // 3. Each cell in the order of coordinates.
        let mut slices = Vec::with_capacity(this.keys.len());
        let mut rest = &mut this.members[..];
        for count in counts {
            let (one, others) = rest.split_at_mut(count);
            slices.push(one);
            rest = others;
        }
        let sort = |cell: &mut [u32]| {
            cell.sort_unstable_by(|&a, &b| {
                let (p, q) = (points[a as usize], points[b as usize]);
                p.x.total_cmp(&q.x)
                    .then(p.y.total_cmp(&q.y))
                    .then(p.z.total_cmp(&q.z))
                    .then(a.cmp(&b))
            });
        };
        #[cfg(feature = "parallel")]
        {
            use rayon::prelude::*;
            slices.into_par_iter().with_min_len(64).for_each(sort);
        }
        #[cfg(not(feature = "parallel"))]
        slices.into_iter().for_each(sort);
        this
    }

    fn key(&self, p: DVec3) -> u64 {
        let cell = (p - self.low) / self.size;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "from 0 to 2^21 by the size"
        )]
        // One more, so that the neighbours below are none of another row.
        let [x, y, z] = cell.to_array().map(|x| x as u64 + 1);
        x | y << BITS | z << (2 * BITS)
    }

    /// The cells in the order of their keys.
    pub(super) fn in_order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.keys.len()).collect();
        order.sort_unstable_by_key(|&cell| self.keys[cell]);
        order
    }

    /// The cell that holds a point.
    pub(super) fn of(&self, p: DVec3) -> Option<usize> {
        let cell = p.is_finite().then(|| self.by_key.get(&self.key(p)))?;
        cell.map(|&cell| cell as usize)
    }

    /// A cell and those of its 26 neighbours that hold points, in fixed order.
    pub(super) fn around(&self, cell: usize) -> impl Iterator<Item = usize> {
        let key = self.keys[cell];
        (0..27_u64).filter_map(move |k| {
            let step = k % 3 | (k / 3 % 3) << BITS | (k / 9) << (2 * BITS);
            let one = 1 | 1 << BITS | 1 << (2 * BITS);
            let other = key.wrapping_add(step).wrapping_sub(one);
            self.by_key.get(&other).map(|&cell| cell as usize)
        })
    }

    pub(super) fn members(&self, cell: usize) -> &[u32] {
        &self.members[self.starts[cell]..self.starts[cell + 1]]
    }
}

/// Mixes the bits of one number; the keys of cells are no threat.
#[derive(Debug, Default)]
struct Mixer(u64);

impl Hasher for Mixer {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u64(u64::from(byte));
        }
    }
    fn write_u64(&mut self, number: u64) {
        let mixed = (self.0 ^ number).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        self.0 = mixed ^ (mixed >> 32);
    }
}

//! The points of a fit in an order of their own, and their distances to a surface.

pub(crate) use super::foot_points::residuals;
use super::spline_space::SplineSpace;
use nurbskin_geometry::numeric::bucket_sort::sort_by_key;
use nurbskin_geometry::numeric::parallel::each_light;
use nurbskin_geometry::{DVec2, DVec3};

/// Weight in the fit of places that hold the surface where there are no points: what points beside them say wins.
pub(crate) const SUPPORT_WEIGHT: f64 = 0.25;
/// Points handled together; fixed, so that results do not depend on the number of threads.
pub(super) const CHUNK: usize = 4096;

/// The number of a place of the domain along Morton's curve through 2^16 x 2^16 cells: what is near in it is mostly near
/// in memory.
fn morton(t: DVec2) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "parameters lie in 0..=1"
    )]
    let place = |t: f64| ((t * 65536.0) as u32).min(65535);
    // Every bit moves to twice its place.
    let spread = |x: u32| {
        let x = (x | (x << 8)) & 0x00FF_00FF;
        let x = (x | (x << 4)) & 0x0F0F_0F0F;
        let x = (x | (x << 2)) & 0x3333_3333;
        (x | (x << 1)) & 0x5555_5555
    };
    spread(place(t.x)) | (spread(place(t.y)) << 1)
}

/// The lower 32 bits.
#[expect(clippy::cast_possible_truncation, reason = "that is the purpose")]
pub(super) fn lower_half(key: u64) -> u32 {
    key as u32
}

/// Points with parameters, moved and scaled to about unit size, in an order that depends on nothing but themselves:
/// whoever shuffles the input gets the same surface.
#[derive(Clone, Debug)]
pub(crate) struct Samples {
    pub(crate) points: Vec<DVec3>,
    pub(crate) parameters: Vec<DVec2>,
    /// Place of each sample in the caller's order.
    pub(crate) original: Vec<u32>,
    /// From this number on, of the caller's, samples are support: see [`SUPPORT_WEIGHT`].
    pub(crate) support: u32,
    pub(crate) measured: usize,
    pub(crate) origin: DVec3,
    pub(crate) scale: f64,
}

impl Samples {
    /// Takes the points in units of `scale` around the middle of their box. O(n log n), about 0.1 us per point.
    pub(crate) fn new(points: &[DVec3], parameters: &[DVec2], scale: f64) -> Self {
        Self::with_support(points, parameters, points.len(), scale)
    }

    /// The same, where the points from number `support` on are such that only hold the surface.
    pub(crate) fn with_support(
        points: &[DVec3],
        parameters: &[DVec2],
        support: usize,
        scale: f64,
    ) -> Self {
        let [lo, hi] = nurbskin_geometry::point_grid::bounding_box(points);
        let origin = 0.5 * lo + 0.5 * hi;
        // 1. Along Morton's curve through a lattice of 2^16 x 2^16, with the index in the lower half of the key.
        let key = |k: usize| (u64::from(morton(parameters[k])) << 32) | k as u64;
        let keys = sort_by_key(each_light(points.len(), key), |&key| key, Ord::cmp);
        let mut original: Vec<u32> = each_light(keys.len(), |k| lower_half(keys[k]));
        // 2. Within a cell of the lattice everything decides, the coordinates last.
        let everything = |k: u32| {
            let (t, p) = (parameters[k as usize], points[k as usize]);
            [t.x, t.y, p.x, p.y, p.z]
        };
        let together = |pair: &[u64]| pair[0] >> 32 == pair[1] >> 32;
        let mut from = 0;
        while let Some(alone) = keys[from..].windows(2).position(together) {
            from += alone;
            let others = keys[from..].windows(2).take_while(|pair| together(pair));
            let upto = from + 1 + others.count();
            original[from..upto].sort_unstable_by(|&a, &b| {
                let pairs = everything(a).into_iter().zip(everything(b));
                let mut orders = pairs.map(|(x, y)| x.total_cmp(&y));
                let first = orders.find(|o| o.is_ne());
                first.unwrap_or(std::cmp::Ordering::Equal)
            });
            from = upto;
        }
        drop(keys);
        Self {
            points: each_light(original.len(), |k| {
                (points[original[k] as usize] - origin) / scale
            }),
            parameters: each_light(original.len(), |k| parameters[original[k] as usize]),
            original,
            support: cell_number(support),
            measured: support.min(points.len()),
            origin,
            scale,
        }
    }
    /// Every `step`-th sample.
    pub(crate) fn part(&self, step: usize) -> Self {
        fn every<T: Copy>(all: &[T], step: usize) -> Vec<T> {
            all.iter().copied().step_by(step).collect()
        }
        let original = every(&self.original, step);
        Self {
            points: every(&self.points, step),
            parameters: every(&self.parameters, step),
            measured: original.iter().filter(|&&k| k < self.support).count(),
            original,
            ..*self
        }
    }
    pub(crate) fn len(&self) -> usize {
        self.points.len()
    }
    /// Whether sample k is no measured point.
    #[inline]
    pub(crate) fn is_support(&self, k: usize) -> bool {
        self.original[k] >= self.support
    }
    /// How many measured points there are.
    pub(crate) fn measured(&self) -> usize {
        self.measured
    }
    /// Which sample each of the caller's points is, of all samples.
    pub(crate) fn ranks(&self) -> Vec<u32> {
        let mut ranks = vec![0; self.original.len()];
        for (rank, &k) in (0..).zip(&self.original) {
            if let Some(place) = ranks.get_mut(k as usize) {
                *place = rank;
            }
        }
        ranks
    }
    /// A point of the scaled world in the caller's.
    pub(crate) fn restore(&self, p: DVec3) -> DVec3 {
        self.origin + self.scale * p
    }
    /// A point of the caller's in the scaled world.
    pub(crate) fn scaled(&self, p: DVec3) -> DVec3 {
        (p - self.origin) / self.scale
    }
}

/// The way back to the caller's order: which sample each of the caller's points is.
pub(crate) struct Unsorted<'a>(pub(crate) &'a [u32]);

impl Unsorted<'_> {
    /// `f` of each sample, in the caller's order.
    pub(crate) fn map<T: Send>(&self, f: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
        each_light(self.0.len(), |k| f(self.0[k] as usize))
    }
}

/// Samples grouped by the cells of a lattice over the domain, cell (a, b) at `b * columns + a`.
#[derive(Clone, Debug)]
pub(crate) struct Cells {
    /// Samples of cell k: `order[starts[k]..starts[k + 1]]`, in the order of the samples.
    pub(super) starts: Vec<usize>,
    pub(super) order: Vec<u32>,
}

impl Cells {
    /// Groups by a cell number below `cells` per sample. O(n).
    pub(crate) fn new(cells: usize, number: &[u32]) -> Self {
        let mut starts = vec![0; cells + 1];
        for &c in number {
            starts[c as usize + 1] += 1;
        }
        for k in 0..cells {
            starts[k + 1] += starts[k];
        }
        let mut next = starts.clone();
        let mut order = vec![0; number.len()];
        for (k, &c) in (0_u32..).zip(number) {
            let at = &mut next[c as usize];
            order[*at] = k;
            *at += 1;
        }
        Self { starts, order }
    }
    /// By the knot cells of a space.
    pub(super) fn of_space(space: &SplineSpace, samples: &Samples) -> Self {
        let [columns, rows] = space.spans();
        let number = each_light(samples.len(), |k| {
            let t = samples.parameters[k];
            cell_number(space.span(0, t.x) + columns * space.span(1, t.y))
        });
        Self::new(columns * rows, &number)
    }
    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }
    pub(crate) fn samples(&self, cell: usize) -> &[u32] {
        &self.order[self.starts[cell]..self.starts[cell + 1]]
    }
}

/// A cell number as it is stored; lattices stay far below 2^32 cells.
pub(crate) fn cell_number(cell: usize) -> u32 {
    u32::try_from(cell).unwrap_or(u32::MAX)
}

/// How a sample lies to a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Residual {
    /// (X - S) . n at the foot point, positive on the side of `S_u x S_v`.
    pub(crate) signed: f64,
    /// |X - S| at the foot point.
    pub(crate) distance: f64,
    /// The foot point.
    pub(crate) foot: DVec2,
}

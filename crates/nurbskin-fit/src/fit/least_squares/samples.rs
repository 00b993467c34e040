//! The points of a fit in a canonical order, and their residuals.
//!
//! Points are moved to the centre of their box, scaled by the diagonal of the domain, and sorted along a Morton curve
//! of 2^16 x 2^16 cells in (u, v). So neighbours in the domain are close in memory, and the result of a fit depends
//! neither on the order of the input nor on the number of threads.
//!
//! Source: G. M. Morton, 1966.

pub(crate) use super::foot_points::residuals;
use super::spline_space::SplineSpace;
use nurbskin_geometry::numeric::bucket_sort::sort_by_key;
use nurbskin_geometry::numeric::parallel::each_light;
use nurbskin_geometry::{DVec2, DVec3};

/// Weight in the fit of places that only hold the surface where it has no points, relative to a point. Dimensionless.
/// Trial: 0.01 was used before. Below 1, so that points beside them win.
pub(crate) const SUPPORT_WEIGHT: f64 = 0.25;
/// Points that are handled together. Count.
/// Guard: fixed, so that results do not depend on the number of threads.
pub(super) const CHUNK_POINTS: usize = 4096;

/// Number of a place of the domain along the Morton curve of 2^16 x 2^16 cells; neighbours are mostly close in it.
fn morton(t: DVec2) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "parameters lie in 0..=1"
    )]
    let place = |t: f64| ((t * 65536.0) as u32).min(65535);
    // Interleaves zeros: every bit moves to twice its position.
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

/// Points with parameters, moved and scaled to about unit size, in an order that depends on their values only, so that
/// the order of the input does not change the surface.
#[derive(Clone, Debug)]
pub(crate) struct Samples {
    pub(crate) points: Vec<DVec3>,
    pub(crate) parameters: Vec<DVec2>,
    /// Place of each sample in the caller's order.
    pub(crate) original: Vec<u32>,
    /// First index of the caller that is a support point: see [`SUPPORT_WEIGHT`].
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

    /// The same, with the points from number `support` on as support points.
    pub(crate) fn with_support(
        points: &[DVec3],
        parameters: &[DVec2],
        support: usize,
        scale: f64,
    ) -> Self {
        let [lo, hi] = nurbskin_geometry::point_grid::bounding_box(points);
        let origin = 0.5 * lo + 0.5 * hi;
        // 1. Sort along the Morton curve of a lattice of 2^16 x 2^16, with the index in the lower half of the key.
        let key = |k: usize| (u64::from(morton(parameters[k])) << 32) | k as u64;
        let keys = sort_by_key(each_light(points.len(), key), |&key| key, Ord::cmp);
        let mut original: Vec<u32> = each_light(keys.len(), |k| lower_half(keys[k]));
        // 2. Sort within a cell of the lattice by parameters, then coordinates.
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
    /// Whether sample k is a support point.
    #[inline]
    pub(crate) fn is_support(&self, k: usize) -> bool {
        self.original[k] >= self.support
    }
    /// Number of measured points.
    pub(crate) fn measured(&self) -> usize {
        self.measured
    }
    /// For each point of the caller, the number of its sample, of all samples.
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

/// Map back to the order of the caller: the number of the sample of each point.
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

/// Position of a sample relative to a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Residual {
    /// (X - S) . n at the foot point, positive on the side of `S_u x S_v`.
    pub(crate) signed: f64,
    /// |X - S| at the foot point.
    pub(crate) distance: f64,
    /// The foot point.
    pub(crate) foot: DVec2,
}

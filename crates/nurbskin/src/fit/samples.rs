//! The points of a fit in an order of their own, and their distances to a surface.

use super::space::{Fit, Space};
use crate::{DVec2, DVec3};
#[cfg(feature = "parallel")]
use rayon::prelude::*;

/// Points handled together; fixed, so that results do not depend on the number of threads.
pub(super) const CHUNK: usize = 4096;

/// `f` of every index below `n`, in order; in chunks on all cores.
pub(super) fn map_indices<T: Send>(n: usize, f: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    #[cfg(feature = "parallel")]
    if n > CHUNK {
        return (0..n)
            .into_par_iter()
            .with_min_len(CHUNK / 4)
            .map(f)
            .collect();
    }
    (0..n).map(f).collect()
}

/// Points with parameters, moved and scaled to about unit size, in an order that depends on nothing but themselves:
/// whoever shuffles the input gets the same surface.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    pub(super) points: Vec<DVec3>,
    pub(super) parameters: Vec<DVec2>,
    /// Place of each sample in the caller's order.
    pub(super) original: Vec<usize>,
    origin: DVec3,
    scale: f64,
}

impl Samples {
    /// Takes the points in units of `scale` around the middle of their box.
    pub(super) fn new(points: &[DVec3], parameters: &[DVec2], scale: f64) -> Self {
        let [lo, hi] = crate::point_grid::bounding_box(points);
        let origin = 0.5 * lo + 0.5 * hi;
        // Strips of v keep neighbours close in memory; within them everything decides, the coordinates last.
        let mut keys: Vec<([f64; 2], usize)> = parameters
            .iter()
            .enumerate()
            .map(|(k, t)| ([(t.y * 64.0).floor(), t.x], k))
            .collect();
        let compare = |a: &([f64; 2], usize), b: &([f64; 2], usize)| {
            let first = a.0[0].total_cmp(&b.0[0]).then(a.0[1].total_cmp(&b.0[1]));
            first.then_with(|| {
                let rest = |k: usize| [parameters[k].y, points[k].x, points[k].y, points[k].z];
                let pairs = rest(a.1).into_iter().zip(rest(b.1));
                let mut orders = pairs.map(|(x, y)| x.total_cmp(&y));
                orders
                    .find(|o| o.is_ne())
                    .unwrap_or(std::cmp::Ordering::Equal)
            })
        };
        #[cfg(feature = "parallel")]
        keys.par_sort_unstable_by(compare);
        #[cfg(not(feature = "parallel"))]
        keys.sort_unstable_by(compare);
        let original: Vec<usize> = keys.into_iter().map(|key| key.1).collect();
        Self {
            points: original
                .iter()
                .map(|&k| (points[k] - origin) / scale)
                .collect(),
            parameters: original.iter().map(|&k| parameters[k]).collect(),
            original,
            origin,
            scale,
        }
    }
    /// Every `step`-th sample.
    pub(super) fn part(&self, step: usize) -> Self {
        fn every<T: Copy>(all: &[T], step: usize) -> Vec<T> {
            all.iter().copied().step_by(step).collect()
        }
        Self {
            points: every(&self.points, step),
            parameters: every(&self.parameters, step),
            original: every(&self.original, step),
            ..*self
        }
    }
    pub(super) fn len(&self) -> usize {
        self.points.len()
    }
    /// A point of the scaled world in the caller's.
    pub(super) fn restore(&self, p: DVec3) -> DVec3 {
        self.origin + self.scale * p
    }
}

/// Samples grouped by the cells of a lattice over the domain, cell (a, b) at `b * columns + a`.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    /// Samples of cell k: `order[starts[k]..starts[k + 1]]`, in the order of the samples.
    pub(super) starts: Vec<usize>,
    pub(super) order: Vec<u32>,
}

impl Cells {
    /// Groups by a cell number below `cells` per sample. O(n).
    pub(super) fn new(cells: usize, number: &[u32]) -> Self {
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
    pub(super) fn of_space(space: &Space, samples: &Samples) -> Self {
        let [columns, rows] = space.spans();
        let number = map_indices(samples.len(), |k| {
            let t = samples.parameters[k];
            cell_number(space.span(0, t.x) + columns * space.span(1, t.y))
        });
        Self::new(columns * rows, &number)
    }
    pub(super) fn len(&self) -> usize {
        self.starts.len() - 1
    }
    pub(super) fn samples(&self, cell: usize) -> &[u32] {
        &self.order[self.starts[cell]..self.starts[cell + 1]]
    }
}

/// A cell number as it is stored; lattices stay far below 2^32 cells.
pub(super) fn cell_number(cell: usize) -> u32 {
    u32::try_from(cell).unwrap_or(u32::MAX)
}

/// How a sample lies to a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Residual {
    /// (X - S) . n at the foot point, positive on the side of `S_u x S_v`.
    pub(super) signed: f64,
    /// |X - S| at the foot point.
    pub(super) distance: f64,
    /// The foot point.
    pub(super) foot: DVec2,
}

/// Largest number of Gauss-Newton steps to a foot point.
const FOOT_STEPS: usize = 3;

/// The residuals of all samples, from foot points found by Gauss-Newton from their own parameters. O(n).
///
/// Source: A6.4, *The NURBS Book*, 2nd ed., p. 232, without second derivatives; steps are at most half a span long and
/// only taken while the distance falls.
pub(super) fn residuals(fit: &Fit, samples: &Samples) -> Vec<Residual> {
    let longest = fit
        .space
        .breaks
        .each_ref()
        .map(|b| 0.5 * b.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max));
    let closed = fit.space.topology.closed();
    let settle = |t: f64, d: usize| match closed[d] {
        true => t - t.floor(),
        false => t.clamp(0.0, 1.0),
    };
    map_indices(samples.len(), |k| {
        let x = samples.points[k];
        let mut foot = samples.parameters[k];
        let mut here = fit.tangents(foot.x, foot.y);
        for _ in 0..FOOT_STEPS {
            let d = x - here.point;
            let (a, b, c) = (
                here.du.length_squared(),
                here.du.dot(here.dv),
                here.dv.length_squared(),
            );
            let (g, h) = (here.du.dot(d), here.dv.dot(d));
            let determinant = a * c - b * b;
            if determinant <= 1e-12 * a * c {
                break;
            }
            let step = DVec2::new(c * g - b * h, a * h - b * g) / determinant;
            let moved = step.clamp(-DVec2::from(longest), DVec2::from(longest));
            let next = DVec2::new(settle(foot.x + moved.x, 0), settle(foot.y + moved.y, 1));
            let there = fit.tangents(next.x, next.y);
            let (old, new) = (d.length_squared(), (x - there.point).length_squared());
            if new >= old {
                break;
            }
            (foot, here) = (next, there);
            if new > 0.998 * old {
                break;
            }
        }
        let d = x - here.point;
        let n = here.du.cross(here.dv);
        let distance = d.length();
        let signed = match n.try_normalize() {
            Some(n) => d.dot(n),
            // At a pole there is no normal from first derivatives.
            None => distance,
        };
        Residual {
            signed,
            distance,
            foot,
        }
    })
}

//! A tensor product spline space: knots in both directions, and the map from unknowns to control points.
//!
//! ```text
//! closed direction:  numbered 0, n-1, 1, n-2, ...   (a cyclic band becomes a band of twice the width)
//! pole:              P,   next row  P + a cos t_j + b sin t_j   (tangent plane spanned by a and b)
//! ```
//!
//! Source: A2.2 of *The NURBS Book* for the basis; Toshniwal, Speleers, Hiemstra and Hughes, 2017, for poles.

use crate::chart::Topology;
use nurbskin_geometry::math;
use nurbskin_geometry::nurbs::{ControlNet, KnotVector, MAX_DEGREE, NurbsSurface};
use nurbskin_geometry::{DVec3, Result};

/// Values of the basis functions that do not vanish on a span.
pub(super) type Values = [f64; MAX_DEGREE + 1];

/// Fewest rows of control points between two poles with which the surface has a tangent plane there. Count.
/// Derived: two rows at each pole and one between them.
const MIN_SMOOTH_POLE_ROWS: usize = 5;
/// Parts of the table per span. Count.
/// Guard: with more the table is larger, with fewer more spans share a part.
const PARTS_PER_SPAN: usize = 4;

/// A control point as a sum of unknowns of the normal equations, each with its factor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sum {
    terms: [(usize, f64); 3],
    count: usize,
}

impl Sum {
    const fn one(unknown: usize) -> Self {
        Self {
            terms: [(unknown, 1.0), (0, 0.0), (0, 0.0)],
            count: 1,
        }
    }
    pub(super) fn terms(&self) -> &[(usize, f64)] {
        &self.terms[..self.count]
    }
}

/// Map from unknowns of the normal equations to control points.
///
/// Control points are numbered so that the equations have a narrow band: the inner direction runs fastest; a
/// closed direction is folded (0, n-1, 1, n-2, ...), which turns the corners of a cyclic band into twice the
/// bandwidth. Without poles each control point is one unknown.
///
/// With poles the first and the last row along u are one point P each. The row next to it is `P + a cos t_j + b sin
/// t_j`, with unknown vectors a and b and `t_j` the angle of the control point's Greville abscissa: an affine image of
/// a regular polygon, so that every curve that leaves the pole starts in the plane of a and b, and the surface has a
/// tangent plane there. (Any ring that is convex around the pole would do. Source: D. Toshniwal, H. Speleers, R. R.
/// Hiemstra, T. J. R. Hughes, *Multi-degree smooth polar splines*, Comput. Methods Appl. Mech. Engrg. 316, 2017, for
/// C^1.)
#[derive(Clone, Debug)]
pub(super) struct Numbering {
    /// Unknowns of the stored (wrapped) control point (i, j), at `j * stride + i`.
    sums: Vec<Sum>,
    stride: usize,
    unknowns: usize,
    half_band: usize,
}

impl Numbering {
    /// For knots of any multiplicity; a periodic direction is closed.
    pub(super) fn new(knots: &[KnotVector; 2], poles: bool) -> Self {
        let closed = knots.each_ref().map(KnotVector::is_periodic);
        let n = knots.each_ref().map(KnotVector::distinct_count);
        // Furthest neighbour along a direction, in the numbering of that direction.
        let reach = |d: usize| {
            let p = knots[d].degree();
            let far = if closed[d] { 2 * p } else { p };
            far.min(n[d] - 1)
        };
        let band = |outer: usize| reach(outer) * n[1 - outer] + reach(1 - outer);
        let outer = usize::from(!poles && band(1) < band(0));
        let inner = 1 - outer;
        let fold = |d: usize, i: usize| {
            let i = i % n[d];
            match closed[d] {
                false => i,
                true if 2 * i < n[d] => 2 * i,
                true => 2 * (n[d] - 1 - i) + 1,
            }
        };
        let [count_u, count_v] = knots.each_ref().map(KnotVector::control_point_count);
        // Rows at each pole without unknowns of their own per control point, and the number of unknowns they share.
        let smooth = poles && n[0] >= MIN_SMOOTH_POLE_ROWS && knots[0].degree() > 1;
        let (special, shared) = match (poles, smooth) {
            (false, _) => (0, 0),
            (true, false) => (1, 1),
            (true, true) => (2, 3),
        };
        let unknowns = (n[0] - 2 * special) * n[1] + 2 * shared;
        let angles: Vec<f64> = {
            let (from, to) = knots[1].domain();
            let turn = std::f64::consts::TAU / (to - from);
            let places = knots[1].greville().into_iter().take(n[1]);
            places.map(|t| turn * t).collect()
        };
        let sum = |i: usize, j: usize| {
            if !poles {
                let (a, b) = if outer == 0 { (i, j) } else { (j, i) };
                return Sum::one(fold(outer, a) * n[inner] + fold(inner, b));
            }
            // Counted from the nearer pole.
            let (ring, first) = match 2 * i < n[0] {
                true => (i, 0),
                false => (n[0] - 1 - i, unknowns - shared),
            };
            match ring {
                0 => Sum::one(first),
                1 if smooth => Sum {
                    terms: {
                        // Identical for repeated control points, to the last bit.
                        let (sin, cos) = math::sin_cos(angles[j % n[1]]);
                        [(first, 1.0), (first + 1, cos), (first + 2, sin)]
                    },
                    count: 3,
                },
                _ => Sum::one(shared + (i - special) * n[1] + fold(1, j)),
            }
        };
        let places = (0..count_v).flat_map(|j| (0..count_u).map(move |i| (i, j)));
        Self {
            sums: places.map(|(i, j)| sum(i, j)).collect(),
            stride: count_u,
            unknowns,
            half_band: (band(outer) + 2).min(unknowns - 1),
        }
    }
    /// Stored control points along u.
    pub(super) fn stride(&self) -> usize {
        self.stride
    }
    /// The combination of unknowns of each stored control point, u fastest.
    pub(super) fn sums(&self) -> &[Sum] {
        &self.sums
    }
    pub(super) fn unknowns(&self) -> usize {
        self.unknowns
    }
    pub(super) fn half_band(&self) -> usize {
        self.half_band
    }
}

/// The spans of a knot vector that are not empty: the first of the p + 1 functions that live there, and its ends.
pub(super) fn filled_spans(knots: &KnotVector) -> Vec<(usize, [f64; 2])> {
    let p = knots.degree();
    let domain = &knots.knots()[p..=knots.control_point_count()];
    let spans = domain.windows(2).enumerate();
    spans
        .filter(|(_, w)| w[0] < w[1])
        .map(|(first, w)| (first, [w[0], w[1]]))
        .collect()
}

/// Table to find the span of a parameter in a few steps, unless spans are very uneven.
#[derive(Clone, Debug)]
pub(super) struct SpanTable {
    start: f64,
    per_length: f64,
    /// For each of four equal parts per span, and for the end, the number of interior breakpoints in the parts before
    /// it: the first span that may hold a parameter of that part.
    first: Vec<u32>,
}

impl SpanTable {
    /// For the spans between these breakpoints.
    pub(super) fn new(breaks: &[f64]) -> Self {
        let parts = PARTS_PER_SPAN * (breaks.len() - 1);
        let (start, end) = (breaks[0], breaks[breaks.len() - 1]);
        let mut this = Self {
            start,
            per_length: parts as f64 / (end - start),
            first: vec![0; parts + 1],
        };
        for &inner in &breaks[1..breaks.len() - 1] {
            let part = this.part(inner);
            this.first[part + 1] += 1;
        }
        for k in 0..parts {
            this.first[k + 1] += this.first[k];
        }
        this
    }
    /// Which part holds t.
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the parts there are"
    )]
    fn part(&self, t: f64) -> usize {
        (((t - self.start) * self.per_length) as usize).min(self.first.len() - 2)
    }
    /// Number of the span, between the breakpoints of the table, that holds t.
    #[inline]
    pub(super) fn find(&self, breaks: &[f64], t: f64) -> usize {
        let part = self.part(t);
        let (first, last) = (self.first[part] as usize, self.first[part + 1] as usize);
        if first == last {
            return first;
        }
        first + breaks[first + 1..=last].partition_point(|&b| b <= t)
    }
}

/// The space of the surfaces with simple knots at the given breakpoints of \[0, 1\], closed according to the topology,
/// with poles on a sphere. See [`Numbering`] for the unknowns.
#[derive(Clone, Debug)]
pub(crate) struct SplineSpace {
    pub(crate) topology: Topology,
    pub(crate) knots: [KnotVector; 2],
    pub(crate) breaks: [Vec<f64>; 2],
    tables: [SpanTable; 2],
    numbering: Numbering,
}

impl SplineSpace {
    /// The space on these breakpoints.
    pub(crate) fn new(
        degree: [usize; 2],
        breaks: [Vec<f64>; 2],
        topology: Topology,
    ) -> Result<Self> {
        let closed = topology.closed();
        let make = |d: usize| {
            if closed[d] {
                KnotVector::periodic(degree[d], &breaks[d])
            } else {
                KnotVector::clamped(degree[d], &breaks[d])
            }
        };
        let knots = [make(0)?, make(1)?];
        Ok(Self {
            topology,
            tables: breaks.each_ref().map(|b| SpanTable::new(b)),
            numbering: Numbering::new(&knots, topology == Topology::Sphere),
            breaks,
            knots,
        })
    }
    pub(super) fn numbering(&self) -> &Numbering {
        &self.numbering
    }
    /// Stored control points along u.
    pub(crate) fn stride(&self) -> usize {
        self.numbering.stride
    }
    pub(crate) fn unknowns(&self) -> usize {
        self.numbering.unknowns
    }
    pub(crate) fn degree(&self) -> [usize; 2] {
        [self.knots[0].degree(), self.knots[1].degree()]
    }
    /// Distinct control points along u and v.
    pub(crate) fn counts(&self) -> [usize; 2] {
        [
            self.knots[0].distinct_count(),
            self.knots[1].distinct_count(),
        ]
    }
    /// Distinct control points.
    pub(crate) fn size(&self) -> usize {
        let [m, n] = self.counts();
        m * n
    }
    /// Spans along u and v.
    pub(crate) fn spans(&self) -> [usize; 2] {
        [self.breaks[0].len() - 1, self.breaks[1].len() - 1]
    }
    /// Number of the span of direction `d` that holds t.
    #[inline]
    pub(crate) fn span(&self, d: usize, t: f64) -> usize {
        self.tables[d].find(&self.breaks[d], t)
    }
}

/// The p + 1 basis functions from number `first` on, those of the span between knots `first + p` and the next, at t,
/// and their first derivatives, written to the first p + 1 places.
///
/// Source: A2.2, *The NURBS Book*, 2nd ed., p. 70; the last step of the recursion gives the derivatives, eq. (2.7).
#[inline]
pub(super) fn values_and_slopes(
    knots: &KnotVector,
    first: usize,
    t: f64,
    values: &mut Values,
    slopes: &mut Values,
) {
    let p = knots.degree();
    let around = &knots.knots()[first..];
    // Cubics with lengths known at compile time.
    match (p, around.first_chunk::<8>()) {
        (3, Some(around)) => recursion(3, around, t, values, slopes),
        _ => recursion(p, around, t, values, slopes),
    }
}

/// The recursion of [`values_and_slopes`]; `around` are the knots p before the span to p after it.
#[inline(always)]
fn recursion(p: usize, around: &[f64], t: f64, values: &mut Values, slopes: &mut Values) {
    slopes[0] = 0.0;
    values[0] = 1.0;
    for j in 1..=p {
        let mut saved = 0.0;
        slopes[j] = 0.0;
        for r in 0..j {
            let (low, high) = (around[p + 1 + r - j], around[p + 1 + r]);
            let temp = values[r] / (high - low);
            if j == p {
                slopes[r] -= p as f64 * temp;
                slopes[r + 1] += p as f64 * temp;
            }
            values[r] = saved + (high - t) * temp;
            saved = (t - low) * temp;
        }
        values[j] = saved;
    }
}

/// A surface of a space: its control points, stored wrapped with u fastest.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    pub(crate) space: SplineSpace,
    pub(crate) net: Vec<DVec3>,
}

impl Fit {
    /// The surface with its control points mapped by `f`.
    pub(crate) fn surface(&self, f: impl Fn(DVec3) -> DVec3) -> Result<NurbsSurface> {
        let [ku, kv] = &self.space.knots;
        let net = self.net.iter().map(|&p| f(p)).collect();
        NurbsSurface::new(
            ku.clone(),
            kv.clone(),
            ControlNet::new(ku.control_point_count(), kv.control_point_count(), net)?,
            None,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_geometry::nurbs::basis::basis_derivatives;

    #[test]
    fn the_band_holds_all_couplings() {
        for topology in [
            Topology::Disk,
            Topology::Tube,
            Topology::Sphere,
            Topology::Torus,
        ] {
            for (nu, nv) in [(4, 9), (9, 4), (5, 5), (12, 7)] {
                let even = |n: usize| (0..=n).map(|i| i as f64 / n as f64).collect::<Vec<_>>();
                let space = SplineSpace::new([3, 2], [even(nu), even(nv)], topology).unwrap();
                let mut seen = vec![false; space.unknowns()];
                for a in 0..nu {
                    for b in 0..nv {
                        let at: Vec<usize> = (0..12)
                            .flat_map(|k| {
                                let at = (b + k / 4) * space.stride() + a + k % 4;
                                space.numbering().sums()[at].terms()
                            })
                            .map(|term| term.0)
                            .collect();
                        let (lo, hi) = (at.iter().min().unwrap(), at.iter().max().unwrap());
                        assert!(
                            hi - lo <= space.numbering().half_band(),
                            "{topology:?} {nu} {nv}"
                        );
                        at.iter().for_each(|&k| seen[k] = true);
                    }
                }
                assert!(seen.iter().all(|&s| s));
            }
        }
    }

    #[test]
    fn surfaces_have_a_tangent_plane_at_each_pole() {
        let breaks = [
            vec![0.0, 0.1, 0.4, 0.5, 0.7, 1.0],
            vec![0.0, 0.2, 0.25, 0.5, 0.6, 0.8, 1.0],
        ];
        let space = SplineSpace::new([3, 3], breaks, Topology::Sphere).unwrap();
        let unknown = |k: usize| DVec3::from([2.1, 3.7, 5.3].map(|f| (f * (k as f64 + 1.0)).sin()));
        let net = space.numbering().sums().iter();
        let net = net.map(|sum| sum.terms().iter().map(|&(k, f)| f * unknown(k)).sum());
        let fit = Fit {
            net: net.collect(),
            space,
        };
        let surface = fit.surface(|p| p).unwrap();
        for u in [0.0, 1.0] {
            let tangents: Vec<DVec3> = (0..20)
                .map(|k| surface.derivatives(u, f64::from(k) / 20.0).du.normalize())
                .collect();
            let normal = tangents[0].cross(tangents[5]).normalize();
            assert!(tangents.iter().all(|t| t.dot(normal).abs() < 1e-12));
            // They go once around it.
            let turns = |k: usize| tangents[k].cross(tangents[(k + 1) % 20]).dot(normal);
            assert!((0..20).all(|k| turns(k) * turns(0) > 0.0));
        }
    }

    #[test]
    fn values_and_slopes_agree_with_the_book() {
        let knots = KnotVector::clamped(4, &[0.0, 0.1, 0.4, 0.5, 1.0]).unwrap();
        for t in [0.0, 0.05, 0.1, 0.3, 0.45, 0.9, 1.0] {
            let span = knots.span(t);
            let mut book = [0.0; 10];
            basis_derivatives(&knots, span, t, 1, &mut book);
            let (mut values, mut slopes) = ([0.0; MAX_DEGREE + 1], [0.0; MAX_DEGREE + 1]);
            values_and_slopes(&knots, span - 4, t, &mut values, &mut slopes);
            for k in 0..5 {
                assert!((values[k] - book[k]).abs() < 1e-14);
                assert!((slopes[k] - book[5 + k]).abs() < 1e-12);
            }
        }
    }
}

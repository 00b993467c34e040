//! The linear maps between control points over two knot vectors.

use crate::nurbs::{KnotVector, MAX_DEGREE};
use crate::{Error, Result};
use glam::DVec4;
use std::ops::Range;

/// Coefficients of one new control point.
type Row = [f64; MAX_DEGREE + 1];

/// A count or index as a signed number: a `Vec` has at most `isize::MAX` bytes.
#[expect(clippy::cast_possible_wrap, reason = "no Vec is that long")]
pub(super) fn signed(i: usize) -> isize {
    i as isize
}

/// An index known not to be negative.
fn unsigned(i: isize) -> usize {
    i.unsigned_abs()
}

/// A knot vector continued without end on both sides, so that no index is out of range. A periodic one repeats
/// itself; any other is continued by knots that no curve point depends on.
pub(super) struct EndlessKnots {
    pub(super) degree: usize,
    /// Periodic: one period of knots, all copies of the seam first, so that knot p is the first of them. Otherwise the
    /// knots as they are.
    pub(super) knots: Vec<f64>,
    pub(super) domain: (f64, f64),
    pub(super) periodic: bool,
    /// Control point 0 here is the stored one number -shift.
    shift: usize,
}

impl EndlessKnots {
    pub(super) fn new(knots: &KnotVector) -> Self {
        let p = knots.degree();
        let domain @ (a, b) = knots.domain();
        let (mut list, mut shift) = (knots.knots().to_vec(), 0);
        if knots.is_periodic() {
            shift = list[..p].iter().filter(|&&u| u >= a).count();
            list = list[p - shift..p - shift + knots.distinct_count()].to_vec();
            // Copies of the seam that are stored at the end of the period.
            let at_end = list.iter().filter(|&&u| u >= b).count();
            list.rotate_right(at_end);
            list[..at_end].fill(a);
            shift += at_end;
        }
        Self {
            degree: p,
            knots: list,
            domain,
            periodic: knots.is_periodic(),
            shift,
        }
    }

    fn len(&self) -> isize {
        signed(self.knots.len())
    }

    /// Knot i for any i.
    pub(super) fn knot(&self, i: isize) -> f64 {
        let (count, length) = (self.len(), self.domain.1 - self.domain.0);
        if self.periodic {
            let k = i - signed(self.degree);
            // The same expression as in `KnotVector::periodic`: images must be equal to the last bit.
            self.knots[unsigned(k.rem_euclid(count))] + k.div_euclid(count) as f64 * length
        } else if i < 0 {
            self.knots[0] + i as f64 * length
        } else if i >= count {
            self.knots[self.knots.len() - 1] + (i - count + 1) as f64 * length
        } else {
            self.knots[unsigned(i)]
        }
    }

    /// Where control point i is stored. Beyond the ends of a knot vector that is not periodic, the nearest.
    pub(super) fn column(&self, i: isize) -> usize {
        if self.periodic {
            unsigned((i - signed(self.shift)).rem_euclid(self.len()))
        } else {
            unsigned(i.clamp(0, self.len() - signed(self.degree) - 2))
        }
    }

    /// Index m with `u_m <= t < u_{m+1}`, searched from `start`.
    fn span(&self, t: f64, start: isize) -> isize {
        let mut m = start;
        while self.knot(m) > t {
            m -= 1;
        }
        while self.knot(m + 1) <= t {
            m += 1;
        }
        m
    }

    /// Coefficients of the polar form of span m at p arguments on the control points m - p .. m.
    ///
    /// With rising arguments that follow `u_m` in a refinement of the knots, every intermediate value is a discrete
    /// B-spline and thus not negative: no cancellation.
    fn polar_form(&self, m: isize, arguments: impl Iterator<Item = f64>, out: &mut Row) {
        let mut around = [0.0; 2 * MAX_DEGREE];
        let p = self.degree;
        // The p knots before and the p knots after the span.
        for (i, knot) in (m..).zip(&mut around[..2 * p]) {
            *knot = self.knot(i + 1 - signed(p));
        }
        *out = [0.0; MAX_DEGREE + 1];
        out[0] = 1.0;
        for (k, t) in (1..=p).zip(arguments) {
            let mut saved = 0.0;
            for r in 0..k {
                let (low, high) = (around[p + r - k], around[p + r]);
                let share = out[r] / (high - low);
                out[r] = saved + (high - t) * share;
                saved = (t - low) * share;
            }
            out[k] = saved;
        }
    }
}

/// Control points over one knot vector as convex combinations of those over another.
pub(in crate::nurbs) struct LineMap {
    source_count: usize,
    target: KnotVector,
    /// Number of terms of each combination.
    width: usize,
    /// Old control point and its coefficient, `width` per new control point.
    terms: Vec<(usize, f64)>,
}

impl LineMap {
    /// To a knot vector of the same degree whose functions contain the old ones, on their domain or a longer one.
    pub(in crate::nurbs) fn refinement(source: &KnotVector, target: KnotVector) -> Self {
        Self::build(source, target, |knots, m, arguments, row| {
            knots.polar_form(m, arguments.iter().copied(), row);
        })
    }

    /// To a knot vector of the next degree with every knot once more: the mean of the polar form over the
    /// arguments left out.
    pub(in crate::nurbs) fn elevation(source: &KnotVector, target: KnotVector) -> Self {
        Self::build(source, target, |knots, m, arguments, row| {
            let mut sum: Row = [0.0; MAX_DEGREE + 1];
            let mut at = 0;
            // Equal arguments give the same value: once for all of them.
            for group in arguments.chunk_by(|a, b| a >= b) {
                let rest = arguments[..at].iter().chain(&arguments[at + 1..]);
                knots.polar_form(m, rest.copied(), row);
                let share = group.len() as f64 / arguments.len() as f64;
                sum.iter_mut().zip(&*row).for_each(|(s, r)| *s += share * r);
                at += group.len();
            }
            *row = sum;
        })
    }

    fn build(
        source: &KnotVector,
        target: KnotVector,
        form: impl Fn(&EndlessKnots, isize, &[f64], &mut Row),
    ) -> Self {
        let endless = EndlessKnots::new(source);
        let (p, q) = (source.degree(), target.degree());
        let count = target.distinct_count();
        let mut terms = Vec::with_capacity(count * (p + 1));
        let mut row: Row = [0.0; MAX_DEGREE + 1];
        let mut span = signed(p);
        // What begins before all old knots, as an extension does, continues the first piece.
        let first = if endless.periodic {
            f64::NEG_INFINITY
        } else {
            endless.knots[0]
        };
        for knots in target.knots().windows(q + 1).take(count) {
            span = endless.span(knots[0].max(first), span);
            form(&endless, span, &knots[1..], &mut row);
            let columns = (span - signed(p)..).map(|i| endless.column(i));
            terms.extend(columns.zip(row[..=p].iter().copied()));
        }
        Self {
            source_count: source.control_point_count(),
            target,
            width: p + 1,
            terms,
        }
    }

    /// The new knot vector.
    pub(in crate::nurbs) fn target(&self) -> &KnotVector {
        &self.target
    }

    /// The map applied to every line of an array whose neighbours along the line are `stride` apart.
    pub(in crate::nurbs) fn apply(&self, points: &[DVec4], stride: usize) -> Vec<DVec4> {
        let count = self.target.control_point_count();
        let mut out = Vec::with_capacity(points.len() / self.source_count * count);
        for block in points.chunks_exact(self.source_count * stride) {
            self.append(block, stride, 0..count, &mut out);
        }
        out
    }

    /// Appends the new control points number `range` of `stride` lines side by side.
    pub(in crate::nurbs) fn append(
        &self,
        block: &[DVec4],
        stride: usize,
        range: Range<usize>,
        out: &mut Vec<DVec4>,
    ) {
        // A periodic line repeats its first control points.
        let distinct = self.target.distinct_count();
        for i in range.map(|i| i % distinct) {
            let row = out.len();
            out.resize(row + stride, DVec4::ZERO);
            for &(column, coefficient) in &self.terms[i * self.width..][..self.width] {
                let from = &block[column * stride..][..stride];
                for (sum, point) in out[row..].iter_mut().zip(from) {
                    *sum += coefficient * *point;
                }
            }
        }
    }
}

/// The knots with `inserted` ones.
pub(super) fn inserted_target(source: &KnotVector, inserted: &[f64]) -> Result<KnotVector> {
    let endless = EndlessKnots::new(source);
    let (p, (a, b)) = (source.degree(), endless.domain);
    if let Some(t) = inserted.iter().find(|t| !(**t >= a && **t <= b)) {
        return Err(Error::invalid(format!(
            "knot {t} cannot be inserted: it is outside the domain [{a}, {b}]"
        )));
    }
    let mut knots = endless.knots;
    if endless.periodic {
        knots.extend(inserted.iter().map(|&t| if t < b { t } else { a }));
    } else {
        knots.extend_from_slice(inserted);
    }
    knots.sort_by(f64::total_cmp);
    finish(p, knots, endless.domain, endless.periodic)
}

/// The knots for the next degree: each once more.
pub(super) fn elevated_target(source: &KnotVector) -> Result<KnotVector> {
    let endless = EndlessKnots::new(source);
    let knots = endless.knots.chunk_by(|a, b| a >= b);
    let knots = knots.flat_map(|group| group.iter().chain(group.first()).copied());
    finish(
        source.degree() + 1,
        knots.collect(),
        endless.domain,
        endless.periodic,
    )
}

/// A knot vector from one period of knots, or from all knots, of which only those are kept that matter.
fn finish(p: usize, mut knots: Vec<f64>, (a, b): (f64, f64), periodic: bool) -> Result<KnotVector> {
    if periodic {
        if knots.partition_point(|&u| u <= a) > p {
            return Err(Error::invalid(format!(
                "the seam knot {a} would get a multiplicity above the degree {p}"
            )));
        }
        knots.push(b);
        return KnotVector::periodic(p, &knots);
    }
    let last = (knots.partition_point(|&u| u < b) + p + 1).min(knots.len());
    let first = knots.partition_point(|&u| u <= a).saturating_sub(p + 1);
    KnotVector::new(p, knots[first..last].to_vec())
}

/// The clamped knots of the part over [a, b].
pub(super) fn section_target(source: &KnotVector, a: f64, b: f64) -> Result<KnotVector> {
    KnotVector::clamped(source.degree(), &section(source, a, b)?)
}

/// The clamped knots over [a, b], which contains the domain of what is not periodic.
pub(super) fn extended_target(source: &KnotVector, a: f64, b: f64) -> Result<KnotVector> {
    let (start, end) = source.domain();
    if source.is_periodic() || !(a <= start && b >= end) {
        return Err(Error::invalid(format!(
            "[{a}, {b}] does not extend the domain [{start}, {end}], or that is periodic"
        )));
    }
    let mut breaks = section(source, start, end)?;
    let last = breaks.len() - 1;
    (breaks[0], breaks[last]) = (a, b);
    KnotVector::clamped(source.degree(), &breaks)
}

/// The clamped knots over the whole domain with every inner knot p-fold: the control points are those of the Bezier
/// pieces.
pub(in crate::nurbs) fn bezier_target(source: &KnotVector) -> Result<KnotVector> {
    let (a, b) = source.domain();
    let mut breaks = section(source, a, b)?;
    breaks.dedup();
    let p = source.degree();
    let inner = &breaks[1..breaks.len() - 1];
    let mut list = vec![a];
    list.extend(inner.iter().flat_map(|&t| std::iter::repeat_n(t, p)));
    list.push(b);
    KnotVector::clamped(p, &list)
}

/// a, the knots strictly between, b.
fn section(source: &KnotVector, a: f64, b: f64) -> Result<Vec<f64>> {
    let endless = EndlessKnots::new(source);
    let (start, end) = endless.domain;
    let turn = end - start;
    let inside = a >= start
        && a < b
        && (b <= end || endless.periodic && a <= end && (b <= a + turn || b - a <= turn));
    if !inside {
        return Err(Error::invalid(format!(
            "[{a}, {b}] is not an interval within the domain [{start}, {end}]"
        )));
    }
    let mut list = vec![a];
    let first = endless.span(a, signed(endless.degree)) + 1;
    let inner = (first..).map(|i| endless.knot(i)).take_while(|&t| t < b);
    list.extend(inner);
    list.push(b);
    Ok(list)
}

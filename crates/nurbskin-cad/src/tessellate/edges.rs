//! The edges of a model, each cut once.

use super::Fineness;
use super::face::Plan;
use crate::model::Model;
use crate::pcurve::planar::crossings;
use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::nurbs::NurbsCurve;
use nurbskin_geometry::nurbs::bezier::{BezierCurve, curve_pieces};

/// Halving ends here at the latest.
const DEPTH: usize = 24;

/// Where an edge is cut.
#[derive(Clone, Debug, Default)]
pub(super) struct Cut {
    /// Parameters, its ends included.
    pub(super) parameters: Vec<f64>,
    /// The points between its ends.
    pub(super) inner: Vec<DVec3>,
    /// Number of the first of them among all points.
    pub(super) first: usize,
}

/// A point of an edge, whatever other edges are cut into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Key {
    /// A vertex of the model.
    Vertex(usize),
    /// Of an edge, the inner point of this number.
    Inner(usize, usize),
}

/// All edges of a model and who uses them.
pub(super) struct EdgeCuts<'a> {
    model: &'a Model,
    pub(super) cuts: Vec<Cut>,
    /// Faces and p-curves per edge.
    uses: Vec<Vec<(usize, &'a NurbsCurve)>>,
    /// Number of points on edges and at vertices.
    pub(super) count: usize,
    /// The largest distance of a chord from its edge, on samples.
    pub(super) missed: f64,
}

impl<'a> EdgeCuts<'a> {
    pub(super) fn new(model: &'a Model, plans: &[Plan<'a>], fineness: Fineness) -> Result<Self> {
        let mut uses: Vec<Vec<(usize, &NurbsCurve)>> = vec![Vec::new(); model.edges().len()];
        // Two edges between the same vertices would fall together as one chord each.
        let mut least = vec![1_usize; model.edges().len()];
        for (k, face) in model.faces().iter().enumerate() {
            for each in &face.loops {
                for used in &each.uses {
                    uses[used.edge].push((k, &used.pcurve));
                    let edge = &model.edges()[used.edge];
                    let need = match (edge.start == edge.end, each.uses.len()) {
                        (true, _) => 3,
                        (_, 2) => 2,
                        _ => 1,
                    };
                    least[used.edge] = least[used.edge].max(need);
                }
            }
        }
        let mut this = Self {
            model,
            cuts: Vec::with_capacity(uses.len()),
            uses,
            count: 0,
            missed: 0.0,
        };
        let edges: Vec<(usize, usize)> = least.into_iter().enumerate().collect();
        let found = each(edges.len(), |k| -> Result<(Vec<f64>, f64)> {
            let (edge, least) = edges[k];
            let start = this.given(edge, plans)?;
            Ok(this.refined(edge, start, least, plans, fineness))
        });
        for found in found {
            let (parameters, missed) = found?;
            this.missed = this.missed.max(missed);
            this.cuts.push(Cut {
                parameters,
                ..Cut::default()
            });
        }
        this.renew();
        Ok(this)
    }

    /// Where an edge has to be cut: at its ends, at its own creases, where it crosses creases of its faces, and, along a
    /// parameter line, where it meets the lines of points of its faces.
    fn given(&self, edge: usize, plans: &[Plan]) -> Result<Vec<f64>> {
        let curve = self.model.edges()[edge].curve.as_ref();
        let Some((a, b)) = curve
            .or(self.uses[edge].first().map(|used| used.1))
            .map(NurbsCurve::domain)
        else {
            return Ok(vec![0.0, 1.0]);
        };
        let mut sharp = vec![a, b];
        let mut wished = Vec::new();
        if let Some(curve) = curve {
            sharp.extend(creases(curve));
        }
        for &(face, pcurve) in &self.uses[edge] {
            sharp.extend(creases(pcurve));
            let Some(plan) = plans.get(face) else {
                continue;
            };
            for piece in curve_pieces(pcurve)? {
                let [low, high] = hull(&piece.points);
                for axis in 0..2 {
                    for &t in within(&plan.metric.creases[axis], low[axis], high[axis]) {
                        crossings(&piece, axis, t, &mut sharp);
                    }
                    let level = high[1 - axis] - low[1 - axis];
                    if level <= 1e-9 * (high[axis] - low[axis]) {
                        for &t in within(&plan.lines[axis], low[axis], high[axis]) {
                            match straight(&piece, axis, t) {
                                Some(crossing) => wished.push(crossing),
                                None => crossings(&piece, axis, t, &mut wished),
                            }
                        }
                    }
                }
            }
        }
        sharp.sort_by(f64::total_cmp);
        sharp.dedup_by(|x, y| *x - *y <= 1e-9 * (b - a));
        if let Some(last) = sharp.last_mut() {
            *last = b;
        }
        // Wishes that nearly coincide would make slivers.
        let closest = 0.2 * (b - a) / (wished.len() + 1) as f64;
        wished.sort_by(f64::total_cmp);
        let mut cuts = sharp.clone();
        let mut last = f64::NEG_INFINITY;
        for t in wished {
            let at = sharp.partition_point(|&s| s < t);
            let near = sharp[at.saturating_sub(1)..(at + 1).min(sharp.len())].iter();
            if near.chain([&last]).all(|s| (s - t).abs() > closest) {
                cuts.push(t);
                last = t;
            }
        }
        cuts.sort_by(f64::total_cmp);
        Ok(cuts)
    }

    /// The parameters halved until chords follow the curve and its faces, and how far they miss the curve.
    fn refined(
        &self,
        edge: usize,
        start: Vec<f64>,
        least: usize,
        plans: &[Plan],
        fineness: Fineness,
    ) -> (Vec<f64>, f64) {
        let (mut parameters, mut most) = (start, 0.0_f64);
        while parameters.len() <= least {
            parameters = halves(&parameters);
        }
        let mut result = vec![parameters[0]];
        for range in parameters.windows(2) {
            let mut stack = vec![(range[0], range[1], 0)];
            while let Some((a, b, depth)) = stack.pop() {
                let (fits, missed) = self.fits(edge, a, b, plans, fineness);
                if fits || depth == DEPTH {
                    most = most.max(missed);
                    result.push(b);
                } else {
                    let middle = f64::midpoint(a, b);
                    stack.extend([(middle, b, depth + 1), (a, middle, depth + 1)]);
                }
            }
        }
        (result, most)
    }

    /// Whether a chord is close enough to the edge, in space and on every face; and how far it is.
    fn fits(&self, edge: usize, a: f64, b: f64, plans: &[Plan], fineness: Fineness) -> (bool, f64) {
        let Fineness { tolerance, step } = fineness;
        let mut short = true;
        for &(face, pcurve) in &self.uses[edge] {
            if let Some(plan) = plans.get(face) {
                let [p, q] = [pcurve.point(a), pcurve.point(b)].map(glam::DVec3::truncate);
                short &= plan.metric.chord(p, q) <= 0.6 * tolerance;
            }
        }
        let Some(curve) = &self.model.edges()[edge].curve else {
            return (short, 0.0);
        };
        if !short {
            return (false, 0.0);
        }
        let (start, end) = (curve.point(a), curve.point(b));
        // Half as much again, so that edges along lines of their faces keep the cuts of these.
        if start.distance(end) > 1.5 * step {
            return (false, 0.0);
        }
        let knots = curve.knots().knots();
        let spans = knots.partition_point(|&t| t < b) - knots.partition_point(|&t| t <= a);
        let samples = 4 * (spans.min(64) + 1);
        let mut missed = 0.0_f64;
        let mut fits = true;
        for k in 1..samples {
            let s = k as f64 / samples as f64;
            let point = curve.point(a + s * (b - a));
            missed = missed.max(distance_to(point, start, end));
            for &(face, pcurve) in &self.uses[edge] {
                let Some(plan) = plans.get(face) else {
                    continue;
                };
                let place = pcurve.point(a).lerp(pcurve.point(b), s);
                let on_chord = plan.face.surface.point(place.x, place.y);
                let here = pcurve.point(a + s * (b - a));
                let on_curve = plan.face.surface.point(here.x, here.y);
                // Along the chord they may differ by the speed of the curve.
                let chord = (end - start).normalize_or_zero();
                let off = on_chord - on_curve;
                fits &= (off - off.dot(chord) * chord).length() <= tolerance / 2.0;
                fits &= off.length() <= tolerance / 2.0 + 0.5 * (end - start).length();
            }
        }
        (fits && missed <= tolerance / 2.0, missed)
    }

    /// The vertices of the model.
    pub(super) fn vertices(&self) -> &'a [DVec3] {
        self.model.vertices()
    }

    /// Cuts intervals (edge, number) in half, and tells which faces that concerns.
    pub(super) fn split(&mut self, splits: &[(usize, usize)]) -> Vec<usize> {
        let mut faces = Vec::new();
        // From the back, so that numbers before stay.
        for &(edge, k) in splits.iter().rev() {
            let parameters = &mut self.cuts[edge].parameters;
            if let Some(&[a, b]) = parameters.get(k..k + 2) {
                let middle = f64::midpoint(a, b);
                if middle > a && middle < b {
                    parameters.insert(k + 1, middle);
                    faces.extend(self.uses[edge].iter().map(|used| used.0));
                }
            }
        }
        self.renew();
        faces
    }

    /// Points and numbers anew.
    fn renew(&mut self) {
        self.count = self.model.vertices().len();
        for (cut, edge) in self.cuts.iter_mut().zip(self.model.edges()) {
            cut.first = self.count;
            let Some(curve) = &edge.curve else { continue };
            let inner = cut.parameters.len().saturating_sub(2);
            if inner != cut.inner.len() {
                let inner = &cut.parameters[1..=inner];
                cut.inner = inner.iter().map(|&t| curve.point(t)).collect();
            }
            self.count += inner;
        }
    }

    /// Which point cut k of an edge is.
    pub(super) fn key(&self, edge: usize, k: usize) -> Key {
        let (cut, ends) = (&self.cuts[edge], &self.model.edges()[edge]);
        if k == 0 || ends.curve.is_none() {
            Key::Vertex(ends.start)
        } else if k + 1 >= cut.parameters.len() {
            Key::Vertex(ends.end)
        } else {
            Key::Inner(edge, k - 1)
        }
    }

    /// The number of a point among all.
    pub(super) fn number(&self, key: Key) -> usize {
        match key {
            Key::Vertex(vertex) => vertex,
            Key::Inner(edge, k) => self.cuts[edge].first + k,
        }
    }

    /// Where a point is.
    pub(super) fn point(&self, key: Key) -> DVec3 {
        match key {
            Key::Vertex(vertex) => self.model.vertices()[vertex],
            Key::Inner(edge, k) => self.cuts[edge].inner.get(k).copied().unwrap_or_default(),
        }
    }
}

/// Where a straight polynomial piece crosses a line of constant u (axis 0) or v.
fn straight(piece: &BezierCurve, axis: usize, value: f64) -> Option<f64> {
    let &[p, q] = piece.points.as_slice() else {
        return None;
    };
    let share = (value - p[axis] / p.w) / (q[axis] / q.w - p[axis] / p.w);
    let (a, b) = piece.range;
    let polynomial = (p.w - q.w).abs() <= f64::EPSILON * p.w;
    (polynomial && share > 0.0 && share < 1.0).then_some(a + (b - a) * share)
}

fn distance_to(point: DVec3, a: DVec3, b: DVec3) -> f64 {
    let way = b - a;
    let square = way.length_squared();
    let share = if square > 0.0 {
        ((point - a).dot(way) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    point.distance(a + share * way)
}

fn halves(parameters: &[f64]) -> Vec<f64> {
    let mut result = vec![parameters[0]];
    for range in parameters.windows(2) {
        result.extend([f64::midpoint(range[0], range[1]), range[1]]);
    }
    result
}

/// Interior knots where a curve may bend sharply.
fn creases(curve: &NurbsCurve) -> Vec<f64> {
    let breaks = curve.knots().breakpoints();
    let inner = breaks[1..breaks.len() - 1].iter().copied();
    let sharp = inner.filter(|&t| curve.knots().multiplicity(t) >= curve.knots().degree());
    sharp.collect()
}

fn hull(points: &[glam::DVec4]) -> [DVec2; 2] {
    let places = points.iter().map(|h| h.truncate().truncate() / h.w);
    places.fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[a, b], p| {
        [a.min(p), b.max(p)]
    })
}

/// The sorted values strictly between two.
fn within(values: &[f64], low: f64, high: f64) -> &[f64] {
    let from = values.partition_point(|&x| x <= low);
    let to = values.partition_point(|&x| x < high);
    values.get(from..to).unwrap_or_default()
}

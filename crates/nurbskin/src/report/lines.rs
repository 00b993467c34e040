//! Lines on and around the faces of a model: edges, seams, isoparametric lines and control nets.
//!
//! Curves become polylines within a chordal tolerance. Isoparametric lines run at the knots and evenly between them,
//! and are clipped by the loops of the face.

use super::document::{Lines, Packed, Polylines};
use super::{number, place, step_of_places};
use glam::{DVec2, DVec3};
use nurbskin_cad::{Face, Model, Region};
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::nurbs::KnotVector;

/// Largest number of bisections of an interval of a line.
const DEPTH: usize = 8;
/// Approximate least number of isoparametric lines of a face along either direction, for a model with few and with many
/// faces.
const FEWEST: [usize; 2] = [8, 2];
/// Largest number of these lines, for a model with few and with many faces.
const MOST: [usize; 2] = [48, 8];
/// Number of faces beyond which a model has many.
const FEW_FACES: usize = 16;
/// Largest number of control points of a displayed net.
const MOST_CONTROL_POINTS: usize = 50_000;
/// Number of samples along an isoparametric line for the test against the loops of the face.
const SAMPLES: usize = 128;
/// Number of bisections for its intersection with a loop.
const HALVINGS: usize = 24;

/// Polylines in space, of one kind.
type Found = Vec<Vec<DVec3>>;

/// The lines of a model.
#[derive(Default)]
pub(super) struct ModelLines {
    pub(super) lines: Lines,
    /// Index in the model of each polyline of `lines.edges`.
    pub(super) edges: Vec<usize>,
    pub(super) poles: Vec<[f32; 3]>,
}

/// The lines of a model of this size within `tolerance`, and its poles.
pub(super) fn lines(model: &Model, diagonal: f64, tolerance: f64, origin: DVec3) -> ModelLines {
    let Edges {
        edges,
        indices,
        seams,
        poles,
    } = edges(model, tolerance);
    let faces = model.faces();
    let many = usize::from(faces.len() > FEW_FACES);
    let iso = each(faces.len(), |k| {
        iso_curves(&faces[k], tolerance, FEWEST[many], MOST[many])
    });
    let net_size = |face: &Face| face.surface.control_points().points().len();
    let net: Found = match faces.iter().map(net_size).sum::<usize>() {
        0..=MOST_CONTROL_POINTS => faces.iter().flat_map(control_net).collect(),
        _ => Vec::new(),
    };
    let packed = |found: Found| {
        let places: Vec<DVec3> = found.iter().flatten().map(|&p| p - origin).collect();
        let step = step_of_places(&places, diagonal);
        Polylines {
            lengths: found.iter().map(|line| number(line.len())).collect(),
            positions: Packed::floats(places.iter().map(DVec3::to_array), step),
        }
    };
    let lines = Lines {
        edges: packed(edges),
        seams: packed(seams),
        iso_curves: packed(iso.concat()),
        control_net: packed(net),
    };
    ModelLines {
        lines,
        edges: indices,
        poles: poles.iter().map(|&p| place(p - origin)).collect(),
    }
}

/// Edges, seams and poles of a model.
struct Edges {
    edges: Found,
    /// The index of each edge in the model.
    indices: Vec<usize>,
    seams: Found,
    poles: Vec<DVec3>,
}

/// Edges, seams and poles; an edge that a face uses twice is its seam.
fn edges(model: &Model, tolerance: f64) -> Edges {
    let mut uses: Vec<(usize, usize)> = Vec::new();
    for (k, face) in model.faces().iter().enumerate() {
        uses.extend(face.loops.iter().flat_map(|l| &l.uses).map(|u| (u.edge, k)));
    }
    uses.sort_unstable();
    let (mut edges, mut seams) = (Found::new(), Found::new());
    let mut indices = Vec::new();
    let mut poles: Vec<usize> = Vec::new();
    for of_edge in uses.chunk_by(|a, b| a.0 == b.0) {
        let first = of_edge.first().map(|used| used.0);
        let Some((index, edge)) = first.and_then(|k| Some((k, model.edges().get(k)?))) else {
            continue;
        };
        let Some(curve) = &edge.curve else {
            poles.push(edge.start);
            continue;
        };
        let line = polyline(&|t| curve.point(t), &curve.knots().breakpoints(), tolerance);
        match of_edge {
            [a, b] if a.1 == b.1 => seams.push(line),
            _ => {
                edges.push(line);
                indices.push(index);
            }
        }
    }
    poles.sort_unstable();
    poles.dedup();
    let vertex = |k: usize| model.vertices().get(k).copied();
    Edges {
        edges,
        indices,
        seams,
        poles: poles.into_iter().filter_map(vertex).collect(),
    }
}

/// Points of a curve such that the chords are within the tolerance, tested at the quarters of each.
fn polyline(curve: &dyn Fn(f64) -> DVec3, breaks: &[f64], tolerance: f64) -> Vec<DVec3> {
    let mut line: Vec<DVec3> = breaks.first().map(|&t| curve(t)).into_iter().collect();
    for interval in breaks.windows(2) {
        let mut open = vec![(interval[0], interval[1], 0)];
        while let Some((a, b, depth)) = open.pop() {
            let (from, to) = (curve(a), curve(b));
            let way = to - from;
            let misses = |share: f64| {
                let off = curve(a + share * (b - a)) - from;
                let along =
                    (off.dot(way) / way.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
                (off - along * way).length() > tolerance
            };
            if depth < DEPTH && [0.25, 0.5, 0.75].into_iter().any(misses) {
                let middle = f64::midpoint(a, b);
                open.extend([(middle, b, depth + 1), (a, middle, depth + 1)]);
            } else {
                line.push(to);
            }
        }
    }
    line
}

/// Rows and columns of control points.
fn control_net(face: &Face) -> Found {
    let net = face.surface.control_points();
    let [m, n] = net.counts();
    let rows = (0..n).map(|j| (0..m).map(|i| net.point(i, j)).collect());
    let columns = (0..m).map(|i| (0..n).map(|j| net.point(i, j)).collect());
    rows.chain(columns).collect()
}

/// Isoparametric lines within the loops of a face.
fn iso_curves(face: &Face, tolerance: f64, fewest: usize, most: usize) -> Found {
    let surface = &face.surface;
    let [(a, b), (c, d)] = surface.domain();
    let mut corners = [DVec2::new(a, c), DVec2::new(b, d)];
    let mut region = None;
    if face.trimmed {
        // A face without closed loops has no lines.
        let Ok(found) = Region::new(face) else {
            return Found::new();
        };
        let [low, high] = found.bounding_rectangle();
        corners = [corners[0].max(low), corners[1].min(high)];
        region = Some(found);
    }
    let knots = [surface.knots_u(), surface.knots_v()];
    let mut lines = Found::new();
    for axis in 0..2 {
        let range = |axis: usize| (corners[0][axis], corners[1][axis]);
        for fixed in levels(knots[axis], range(axis), fewest, most) {
            let at = |t: f64| match axis {
                0 => DVec2::new(fixed, t),
                _ => DVec2::new(t, fixed),
            };
            let inside = |t: f64| region.as_ref().is_none_or(|region| region.contains(at(t)));
            let other = knots[1 - axis].breakpoints();
            for (from, to) in covered(&inside, range(1 - axis), region.is_none()) {
                let mut breaks = vec![from];
                breaks.extend(other.iter().copied().filter(|&t| t > from && t < to));
                breaks.push(to);
                let point = |t: f64| surface.point(at(t).x, at(t).y);
                lines.push(polyline(&point, &breaks, tolerance));
            }
        }
    }
    lines
}

/// Parameters of isoparametric lines: the knots strictly within a range, and even steps between where these are few.
fn levels(knots: &KnotVector, (low, high): (f64, f64), fewest: usize, most: usize) -> Vec<f64> {
    let width = high - low;
    if width.is_nan() || width <= 0.0 {
        return Vec::new();
    }
    let mut breaks = vec![low];
    let inner = knots.breakpoints().into_iter();
    breaks.extend(inner.filter(|&t| t > low + 1e-6 * width && t < high - 1e-6 * width));
    breaks.push(high);
    let parts = fewest.div_ceil(breaks.len() - 1);
    let mut levels = Vec::new();
    for span in breaks.windows(2) {
        for part in 0..parts {
            levels.push(span[0] + (span[1] - span[0]) * part as f64 / parts as f64);
        }
    }
    let step = levels.len().div_ceil(most).max(1);
    levels.into_iter().step_by(step).skip(1).collect()
}

/// The intervals of a range that are `inside`, sampled at even steps.
fn covered(inside: &dyn Fn(f64) -> bool, (low, high): (f64, f64), whole: bool) -> Vec<(f64, f64)> {
    if whole {
        return vec![(low, high)];
    }
    let sample = |k: usize| low + (high - low) * (k as f64 + 0.5) / SAMPLES as f64;
    // Bisects between a parameter inside and one outside; returns the last inside.
    let border = |mut from: f64, mut to: f64| {
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(from, to);
            if inside(middle) {
                from = middle;
            } else {
                to = middle;
            }
        }
        from
    };
    let end = |from: f64, end: f64| {
        let near = end + 1e-9 * (from - end);
        if inside(near) {
            end
        } else {
            border(from, near)
        }
    };
    let states: Vec<bool> = (0..SAMPLES).map(|k| inside(sample(k))).collect();
    let mut found = Vec::new();
    let mut start = None;
    for (k, &now) in states.iter().enumerate() {
        let before = k.checked_sub(1).and_then(|k| states.get(k));
        match (before, now) {
            (None, true) => start = Some(end(sample(k), low)),
            (Some(false), true) => start = Some(border(sample(k), sample(k - 1))),
            (Some(true), false) => {
                let from = start.take();
                found.extend(from.map(|from| (from, border(sample(k - 1), sample(k)))));
            }
            _ => {}
        }
    }
    found.extend(start.map(|from| (from, end(sample(SAMPLES - 1), high))));
    found
}

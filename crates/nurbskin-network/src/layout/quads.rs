//! Four-sided faces from polygons.
//!
//! Each arc is split in its middle or not, and each cell has a pattern of faces over its corners and middles. A map of the
//! cell to a regular polygon gives each vertex of the mesh a first face and first parameters, by the inverse of the
//! bilinear map of the face in the plane.
//!
//! Source: E. Catmull, J. Clark, *Recursively generated B-spline surfaces on arbitrary topological meshes*, CAD 10(6),
//! 1978: if all arcs are split, a centre joined to all middles always gives four-sided faces.

use super::arcs::{Arc, Polygons};
use super::cells::Cells;
use super::flatten::Flat;
use super::patterns::Pattern;
use super::surface::{Surface, index};
use super::{EdgeKind, Layout, LayoutEdge, LayoutFace, NONE, OnFace, OnLine, SIDE_CORNERS, Side};
use glam::{DVec2, DVec3};
use nurbskin_geometry::math;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// The parameters of the corners of a face.
const CORNER: [DVec2; 4] = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
/// How far inside the rim a ring ends, as a share of the way to the middle. Derived: the square inside a disk, with faces of
/// about one size around it.
const RING: f64 = 0.5;
/// Newton's steps of the inverse of a bilinear map. Guard: it converges in six.
const NEWTON: usize = 12;

/// How the polygons are divided.
#[derive(Clone, Debug)]
pub(crate) struct Division {
    /// Per arc, whether it is split in the middle.
    pub(crate) split: Vec<bool>,
    /// Per cell its pattern: over its corners and the middles of its split arcs, from its first corner.
    pub(crate) patterns: Vec<Pattern>,
}

impl Division {
    /// All arcs split: always possible.
    pub(crate) fn all(polygons: &Polygons) -> Self {
        let corners = (0..index(polygons.sides.len())).map(|cell| polygons.corners(cell));
        Self {
            split: vec![true; polygons.arcs.len()],
            patterns: corners.map(Pattern::catmull_clark).collect(),
        }
    }
}

/// A cell in the layout: the vertices around it, the edges from each to the next, and whether these run backwards.
struct Rim {
    vertices: Vec<u32>,
    edges: Vec<(u32, bool)>,
    /// The vertices on the regular polygon.
    places: Vec<DVec2>,
}

/// The layout of polygons divided in this way.
pub(crate) fn assemble(
    surface: &Surface<'_>,
    cells: &Cells,
    polygons: &Polygons,
    division: &Division,
) -> Layout {
    let mut layout = Layout::default();
    let corner = corners(surface, polygons, &mut layout);
    let first = arc_edges(surface, polygons, division, &corner, &mut layout);
    let mut members = vec![Vec::new(); cells.count()];
    for (t, &label) in cells.labels.iter().enumerate() {
        members[label as usize].push(index(t));
    }
    let placed: Vec<Placed> = (0..cells.count())
        .into_par_iter()
        .map(|cell| {
            let outline = outline(surface, polygons, cell);
            let flat = Flat::new(surface, &members[cell], &outline);
            let pattern = &division.patterns[cell];
            let places = rim_places(polygons, division, cell);
            Placed::new(surface, flat, pattern, places)
        })
        .collect();
    layout.start = vec![OnFace::default(); surface.mesh.points.len()];
    let mut done = vec![false; surface.mesh.points.len()];
    for (cell, placed) in placed.into_iter().enumerate() {
        let base = layout.faces.len();
        let rim = Rim::new(polygons, division, cell, &first, &layout, placed.places);
        add_faces(&mut layout, &rim, &division.patterns[cell], &placed.inner);
        for (v, face, at) in placed.starts {
            if !std::mem::replace(&mut done[v as usize], true) {
                layout.start[v as usize] = OnFace {
                    face: index(base + face),
                    u: at.x,
                    v: at.y,
                };
            }
        }
    }
    on_lines(surface, polygons, division, &first, &mut layout);
    layout
}

/// What the map of a cell yields.
struct Placed {
    /// Vertices of the rim and inside in the plane.
    places: Vec<DVec2>,
    /// Those inside.
    inner: Vec<DVec3>,
    /// Vertices of the mesh, with their faces and parameters.
    starts: Vec<(u32, usize, DVec2)>,
}

impl Placed {
    fn new(surface: &Surface<'_>, flat: Flat, pattern: &Pattern, mut places: Vec<DVec2>) -> Self {
        places.extend(inner_places(pattern, &places));
        let inner = places[pattern.count..].iter();
        let inner = inner.map(|&place| flat.lift(surface, place)).collect();
        let faces: Vec<[DVec2; 4]> = pattern.faces.iter().map(|f| f.map(|k| places[k])).collect();
        let starts = flat.vertices.iter().zip(&flat.places).map(|(&v, &place)| {
            let face = containing(&faces, place);
            (v, face, inverse(&faces[face], place))
        });
        Self {
            starts: starts.collect(),
            inner,
            places,
        }
    }
}

/// The places of the vertices inside a polygon: a ring on the way to the middle, a centre amid the ends of its spokes.
fn inner_places(pattern: &Pattern, rim: &[DVec2]) -> Vec<DVec2> {
    let mut places = rim.to_vec();
    if pattern.ring {
        let middle = rim.iter().sum::<DVec2>() / rim.len() as f64;
        places.extend(rim.iter().map(|&place| place.lerp(middle, RING)));
    }
    if pattern.centre {
        let centre = places.len();
        let own = pattern.faces.iter().filter(|face| face[0] == centre);
        let spokes: Vec<DVec2> = own.map(|face| places[face[1]]).collect();
        places.push(spokes.iter().sum::<DVec2>() / spokes.len() as f64);
    }
    places.split_off(rim.len())
}

/// The face that contains a point, or comes nearest to.
fn containing(faces: &[[DVec2; 4]], point: DVec2) -> usize {
    let inside = |face: &[DVec2; 4]| {
        let side = |k: usize| {
            let (a, b) = (face[k], face[(k + 1) % 4]);
            (b - a).normalize_or_zero().perp_dot(point - a)
        };
        // Of two zeros `min` may return either, by the processor; the sum makes both positive.
        (0..4).map(side).fold(f64::INFINITY, f64::min) + 0.0
    };
    let best = (0..faces.len()).max_by(|&a, &b| {
        let [x, y] = [a, b].map(|k| inside(&faces[k]));
        x.total_cmp(&y).then(b.cmp(&a))
    });
    best.unwrap_or(0)
}

/// The parameters of a point in a convex face with bilinear parameters, within 0 to 1.
fn inverse(face: &[DVec2; 4], point: DVec2) -> DVec2 {
    let [a, b, c, d] = *face;
    let twist = a - b + c - d;
    let mut at = DVec2::splat(0.5);
    for _ in 0..NEWTON {
        let off = a + (b - a) * at.x + (d - a) * at.y + twist * (at.x * at.y) - point;
        let along = b - a + twist * at.y;
        let across = d - a + twist * at.x;
        let area = along.perp_dot(across);
        if area.abs() < 1e-12 {
            break;
        }
        let step = DVec2::new(off.perp_dot(across), along.perp_dot(off)) / area;
        at = (at - step).clamp(DVec2::ZERO, DVec2::ONE);
        if step.length_squared() < 1e-24 {
            break;
        }
    }
    at
}

/// Adds the corners left as vertices; returns the number of the layout's vertex for each vertex of the mesh.
fn corners(surface: &Surface<'_>, polygons: &Polygons, layout: &mut Layout) -> Vec<u32> {
    let mut corner = vec![NONE; surface.mesh.points.len()];
    for (k, arc) in polygons.arcs.iter().enumerate() {
        for root in polygons.corners_of(index(k)) {
            if !arc.gone && corner[root as usize] == NONE {
                corner[root as usize] = index(layout.vertices.len());
                layout.vertices.push(surface.place(root));
            }
        }
    }
    corner
}

/// Adds one edge for each whole arc, a middle and two edges for each split one; returns the first edge of each arc.
fn arc_edges(
    surface: &Surface<'_>,
    polygons: &Polygons,
    division: &Division,
    corner: &[u32],
    layout: &mut Layout,
) -> Vec<u32> {
    let mut first = vec![NONE; polygons.arcs.len()];
    let mut line = 0;
    for (k, arc) in polygons.arcs.iter().enumerate().filter(|(_, a)| !a.gone) {
        let [from, to] = polygons
            .corners_of(index(k))
            .map(|root| corner[root as usize]);
        first[k] = index(layout.edges.len());
        let number = arc.kind.is_hard().then_some(line);
        line += u32::from(arc.kind.is_hard());
        let mut add = |ends| {
            layout.edges.push(LayoutEdge {
                ends,
                kind: arc.kind,
                line: number,
            });
        };
        if division.split[k] {
            let middle = index(layout.vertices.len());
            layout.vertices.push(middle_of(surface, &arc.line));
            add([from, middle]);
            add([middle, to]);
        } else {
            add([from, to]);
        }
    }
    first
}

/// Shares of the length of a chain of vertices up to each of them, 0 to 1.
fn shares(surface: &Surface<'_>, path: &[u32]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut shares = vec![0.0];
    for pair in path.windows(2) {
        sum += surface.place(pair[0]).distance(surface.place(pair[1]));
        shares.push(sum);
    }
    let last = path.len().saturating_sub(1).max(1);
    for (k, share) in shares.iter_mut().enumerate() {
        *share = if k == last {
            1.0
        } else if sum > 0.0 {
            (*share / sum).min(1.0)
        } else {
            k as f64 / last as f64
        };
    }
    shares
}

/// The point at this share of the length of a chain of vertices.
pub(crate) fn point_at(surface: &Surface<'_>, path: &[u32], share: f64) -> DVec3 {
    let shares = shares(surface, path);
    let last = path.len().saturating_sub(1);
    let next = shares.partition_point(|s| *s < share).clamp(1, last.max(1));
    let (Some(&a), Some(&b)) = (path.get(next - 1), path.get(next)) else {
        return path.first().map_or(DVec3::ZERO, |&v| surface.place(v));
    };
    let width = shares[next] - shares[next - 1];
    let way = if width > 0.0 {
        ((share - shares[next - 1]) / width).clamp(0.0, 1.0)
    } else {
        0.5
    };
    surface.place(a).lerp(surface.place(b), way)
}

/// The point in the middle of a chain of vertices.
fn middle_of(surface: &Surface<'_>, path: &[u32]) -> DVec3 {
    point_at(surface, path, 0.5)
}

/// Corner j of the regular polygon with k corners.
fn polygon_corner(j: usize, k: usize) -> DVec2 {
    math::unit_vector(TAU * (j % k) as f64 / k as f64)
}

/// The places of the vertices around a cell on its regular polygon. Arcs that are gone lie at their corner.
fn outline(surface: &Surface<'_>, polygons: &Polygons, cell: usize) -> Vec<(u32, DVec2)> {
    let count = polygons.left(cell).count();
    let mut outline = Vec::new();
    let mut at = 0;
    for &(k, reversed) in &polygons.sides[cell] {
        let Arc { path, gone, .. } = &polygons.arcs[k as usize];
        let mut path = path.clone();
        if reversed {
            path.reverse();
        }
        let (from, mut to) = (polygon_corner(at, count), polygon_corner(at + 1, count));
        if *gone {
            to = from;
        } else {
            at += 1;
        }
        let shares = shares(surface, &path);
        let inner = path.iter().zip(shares).take(path.len() - 1);
        outline.extend(inner.map(|(&v, share)| (v, from.lerp(to, share))));
    }
    outline
}

/// The corners of a cell and the middles of its split arcs on its regular polygon.
fn rim_places(polygons: &Polygons, division: &Division, cell: usize) -> Vec<DVec2> {
    let count = polygons.left(cell).count();
    let mut places = Vec::new();
    for (j, (arc, _)) in polygons.left(cell).enumerate() {
        let (from, to) = (polygon_corner(j, count), polygon_corner(j + 1, count));
        places.push(from);
        if division.split[arc as usize] {
            places.push(0.5 * (from + to));
        }
    }
    places
}

impl Rim {
    fn new(
        polygons: &Polygons,
        division: &Division,
        cell: usize,
        first: &[u32],
        layout: &Layout,
        places: Vec<DVec2>,
    ) -> Self {
        let (mut vertices, mut edges) = (Vec::new(), Vec::new());
        for (arc, reversed) in polygons.left(cell) {
            let base = first[arc as usize];
            let pieces = if division.split[arc as usize] { 2 } else { 1 };
            for piece in 0..pieces {
                let edge = base + if reversed { pieces - 1 - piece } else { piece };
                edges.push((edge, reversed));
                vertices.push(layout.edges[edge as usize].ends[usize::from(reversed)]);
            }
        }
        Self {
            vertices,
            edges,
            places,
        }
    }
}

/// Adds the faces of a cell, with their chords and spokes.
fn add_faces(layout: &mut Layout, rim: &Rim, pattern: &Pattern, inside: &[DVec3]) {
    let n = rim.vertices.len();
    debug_assert_eq!((n, n + inside.len()), (pattern.count, rim.places.len()));
    let mut vertices = rim.vertices.clone();
    for &place in inside {
        vertices.push(index(layout.vertices.len()));
        layout.vertices.push(place);
    }
    // Chords: from the smaller to the larger number; edges with an end inside: from the larger.
    let mut inner: BTreeMap<[usize; 2], u32> = BTreeMap::new();
    for face in &pattern.faces {
        let sides = std::array::from_fn(|k| {
            let (a, b) = (face[k], face[(k + 1) % 4]);
            let (edge, against) = if a < n && b == (a + 1) % n {
                rim.edges[a]
            } else {
                let from = if a.max(b) >= n { a.max(b) } else { a.min(b) };
                let edge = *inner.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                    layout.edges.push(LayoutEdge {
                        ends: [vertices[from], vertices[a + b - from]],
                        kind: EdgeKind::Smooth,
                        line: None,
                    });
                    index(layout.edges.len() - 1)
                });
                (edge, a != from)
            };
            Side {
                edge,
                reversed: against != (k >= 2),
            }
        });
        layout.faces.push(LayoutFace {
            corners: face.map(|k| vertices[k]),
            sides,
        });
    }
}

/// The vertices of the mesh on hard lines: where they are on their edges, and their starts on a face of that edge.
fn on_lines(
    surface: &Surface<'_>,
    polygons: &Polygons,
    division: &Division,
    first: &[u32],
    layout: &mut Layout,
) {
    for (k, arc) in polygons.arcs.iter().enumerate() {
        if arc.gone || !arc.kind.is_hard() {
            continue;
        }
        let split = division.split[k];
        for (&vertex, share) in arc.line.iter().zip(shares(surface, &arc.line)) {
            let second = split && share > 0.5;
            let t = if split {
                2.0 * share - f64::from(u8::from(second))
            } else {
                share
            };
            layout.on_lines.push(OnLine {
                vertex,
                edge: first[k] + u32::from(second),
                t: t.clamp(0.0, 1.0),
            });
        }
    }
    start_on_lines(layout);
}

/// Starts of the vertices on lines: on the first side of a face that is the edge.
fn start_on_lines(layout: &mut Layout) {
    let mut user = vec![(NONE, 0); layout.edges.len()];
    for (f, face) in layout.faces.iter().enumerate() {
        for (s, side) in face.sides.iter().enumerate() {
            if user[side.edge as usize].0 == NONE {
                user[side.edge as usize] = (index(f), s);
            }
        }
    }
    for on in &layout.on_lines {
        let (face, s) = user[on.edge as usize];
        if face == NONE {
            continue;
        }
        let reversed = layout.faces[face as usize].sides[s].reversed;
        let t = if reversed { 1.0 - on.t } else { on.t };
        let [from, to] = SIDE_CORNERS[s].map(|c| CORNER[c]);
        let place = from.lerp(to, t);
        layout.start[on.vertex as usize] = OnFace {
            face,
            u: place.x,
            v: place.y,
        };
    }
}

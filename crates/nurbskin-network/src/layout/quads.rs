//! Four-sided faces from polygons: one Catmull-Clark split.
//!
//! A cell with k corners gives k faces (centre, middle of arc j - 1, corner j, middle of arc j). A map of the cell to the
//! regular k-gon gives each vertex of the mesh a first face and first parameters: the sector, then the inverse of the
//! bilinear map of the kite. With the corner at (1, 0), C = cos²(π/k), S = sin(π/k) cos(π/k), d = v - u and s = u + v
//!
//! ```text
//! y = S d        x = C s + (1 - 2 C) (s² - d²) / 4
//! ```
//!
//! Source: E. Catmull, J. Clark, *Recursively generated B-spline surfaces on arbitrary topological meshes*, CAD 10(6),
//! 1978.

use super::arcs::{Arc, Polygons};
use super::cells::Cells;
use super::flatten::Flat;
use super::surface::{Surface, index};
use super::{Layout, LayoutEdge, LayoutFace, NONE, OnFace, OnLine, SIDE_CORNERS, Side};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// The layout of these polygons, each split once.
pub(crate) fn split_all(surface: &Surface<'_>, cells: &Cells, polygons: &Polygons) -> Layout {
    let mut layout = Layout::default();
    let corner = corners(surface, polygons, &mut layout);
    let half = halves(surface, polygons, &corner, &mut layout);
    let mut members = vec![Vec::new(); cells.count()];
    for (t, &label) in cells.labels.iter().enumerate() {
        members[label as usize].push(index(t));
    }
    let flats: Vec<Flat> = (0..cells.count())
        .into_par_iter()
        .map(|cell| {
            let outline = outline(surface, polygons, cell);
            Flat::new(surface, &members[cell], &outline)
        })
        .collect();
    layout.start = vec![OnFace::default(); surface.mesh.points.len()];
    let mut placed = vec![false; surface.mesh.points.len()];
    for (cell, flat) in flats.iter().enumerate() {
        let sides: Vec<(u32, bool)> = polygons.left(cell).collect();
        let first = layout.faces.len();
        layout.vertices.push(flat.lift(surface, DVec2::ZERO));
        add_faces(&mut layout, &sides, &half);
        for (&v, &place) in flat.vertices.iter().zip(&flat.places) {
            if !std::mem::replace(&mut placed[v as usize], true) {
                let (sector, u, v_) = in_kite(place, sides.len());
                layout.start[v as usize] = OnFace {
                    face: index(first + sector),
                    u,
                    v: v_,
                };
            }
        }
    }
    on_lines(surface, polygons, &half, &mut layout);
    layout
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

/// Adds a middle and two edges for each arc left; returns the first of the two edges of each arc.
fn halves(
    surface: &Surface<'_>,
    polygons: &Polygons,
    corner: &[u32],
    layout: &mut Layout,
) -> Vec<u32> {
    let mut first = vec![NONE; polygons.arcs.len()];
    let mut line = 0;
    for (k, arc) in polygons.arcs.iter().enumerate().filter(|(_, a)| !a.gone) {
        let middle = index(layout.vertices.len());
        layout.vertices.push(middle_of(surface, &arc.line));
        let [from, to] = polygons
            .corners_of(index(k))
            .map(|root| corner[root as usize]);
        first[k] = index(layout.edges.len());
        let number = arc.kind.is_hard().then_some(line);
        line += u32::from(arc.kind.is_hard());
        for ends in [[from, middle], [middle, to]] {
            layout.edges.push(LayoutEdge {
                ends,
                kind: arc.kind,
                line: number,
            });
        }
    }
    first
}

/// Shares of the length of a chain of vertices up to each of them, 0 to 1.
pub(crate) fn shares(surface: &Surface<'_>, path: &[u32]) -> Vec<f64> {
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

/// The point in the middle of a chain of vertices.
fn middle_of(surface: &Surface<'_>, path: &[u32]) -> DVec3 {
    let shares = shares(surface, path);
    let next = shares.partition_point(|s| *s < 0.5).max(1);
    let (a, b) = (path[next - 1], path[next.min(path.len() - 1)]);
    let width = shares[next] - shares[next - 1];
    let way = if width > 0.0 {
        (0.5 - shares[next - 1]) / width
    } else {
        0.5
    };
    surface.place(a).lerp(surface.place(b), way)
}

/// Corner j of the regular polygon with k corners.
fn polygon_corner(j: usize, k: usize) -> DVec2 {
    DVec2::from_angle(TAU * (j % k) as f64 / k as f64)
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

/// Adds the faces of a cell around the vertex added last, its centre; `sides` are its arcs.
fn add_faces(layout: &mut Layout, sides: &[(u32, bool)], half: &[u32]) {
    let centre = index(layout.vertices.len() - 1);
    let k = sides.len();
    let spokes = index(layout.edges.len());
    let first_half = |j: usize| half[sides[j].0 as usize] + u32::from(sides[j].1);
    let second_half = |j: usize| half[sides[j].0 as usize] + u32::from(!sides[j].1);
    let middles: Vec<u32> = (0..k)
        .map(|j| layout.edges[half[sides[j].0 as usize] as usize].ends[1])
        .collect();
    for &middle in &middles {
        layout.edges.push(LayoutEdge {
            ends: [centre, middle],
            kind: super::EdgeKind::Smooth,
            line: None,
        });
    }
    for j in 0..k {
        let before = (j + k - 1) % k;
        let out = first_half(j);
        let corner = layout.edges[out as usize].ends[usize::from(sides[j].1)];
        let forward = |edge| Side {
            edge,
            reversed: false,
        };
        layout.faces.push(LayoutFace {
            corners: [centre, middles[before], corner, middles[j]],
            sides: [
                forward(spokes + index(before)),
                Side {
                    edge: second_half(before),
                    reversed: sides[before].1,
                },
                Side {
                    edge: out,
                    reversed: !sides[j].1,
                },
                forward(spokes + index(j)),
            ],
        });
    }
}

/// The sector of a point of the regular polygon with k corners, and its parameters in the kite of that corner.
fn in_kite(place: DVec2, k: usize) -> (usize, f64, f64) {
    let turn = place.to_angle() * k as f64 / TAU;
    let sector = (0..k).min_by(|&a, &b| {
        let off = |j: usize| {
            let d = (turn - j as f64).rem_euclid(k as f64);
            d.min(k as f64 - d)
        };
        off(a).total_cmp(&off(b))
    });
    let sector = sector.unwrap_or(0);
    let half = PI / k as f64;
    let p = DVec2::from_angle(-2.0 * half * sector as f64).rotate(place);
    let (c, s) = (half.cos() * half.cos(), half.sin() * half.cos());
    let d = p.y / s;
    let a = (1.0 - 2.0 * c) / 4.0;
    let right = a * d * d + p.x;
    let sum = 2.0 * right / (c + (c * c + 4.0 * a * right).max(0.0).sqrt());
    let (u, v) = (0.5 * (sum - d), 0.5 * (sum + d));
    (sector, u.clamp(0.0, 1.0), v.clamp(0.0, 1.0))
}

/// The vertices of the mesh on hard lines: where they are on their edges, and their starts on a face of that edge.
fn on_lines(surface: &Surface<'_>, polygons: &Polygons, half: &[u32], layout: &mut Layout) {
    for (k, arc) in polygons.arcs.iter().enumerate() {
        if arc.gone || !arc.kind.is_hard() {
            continue;
        }
        for (&vertex, share) in arc.line.iter().zip(shares(surface, &arc.line)) {
            let second = u32::from(share > 0.5);
            layout.on_lines.push(OnLine {
                vertex,
                edge: half[k] + second,
                t: (2.0 * share - f64::from(second)).clamp(0.0, 1.0),
            });
        }
    }
    start_on_lines(layout);
}

/// Starts of the vertices on lines: on the first side of a face that is the edge.
pub(crate) fn start_on_lines(layout: &mut Layout) {
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

/// The parameters of the corners of a face.
const CORNER: [DVec2; 4] = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];

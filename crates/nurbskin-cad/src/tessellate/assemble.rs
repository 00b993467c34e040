//! The triangles of all faces as one mesh.

use super::ModelTessellation;
use super::edges::{EdgeCuts, Key};
use super::face::{FaceMesh, Plan};
use crate::model::Model;
use glam::{DVec2, DVec3};
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use rayon::prelude::*;

/// Which points of edges and vertices are one: those that a face has at one place of its parameter plane.
fn joined(cuts: &EdgeCuts, meshes: &[FaceMesh]) -> Vec<usize> {
    let mut sets = DisjointSets::new(cuts.count);
    for &[a, b] in meshes.iter().flat_map(|mesh| &mesh.same) {
        sets.join(cuts.number(a), cuts.number(b));
    }
    (0..cuts.count).map(|k| sets.root(k)).collect()
}

/// The numbers of a face's vertices among all: those on edges as they are joined, then its own from `next` on.
fn numbers(mesh: &FaceMesh, cuts: &EdgeCuts, joined: &[usize], next: usize) -> Vec<usize> {
    let mut next = next;
    let mut number = |shared: Option<Key>| match shared {
        Some(key) => joined[cuts.number(key)],
        None => {
            next += 1;
            next - 1
        }
    };
    mesh.vertices.iter().map(|v| number(v.1)).collect()
}

fn is_whole([a, b, c]: [usize; 3]) -> bool {
    a != b && b != c && c != a
}

/// Faces and places where a side inside the face joins points that other triangles have joined in the same direction:
/// a point there keeps them apart.
pub(super) fn doubled(model: &Model, cuts: &EdgeCuts, meshes: &[FaceMesh]) -> Vec<(usize, DVec2)> {
    let joined = joined(cuts, meshes);
    // Only sides between points of edges can be doubled.
    let mut sides: Vec<([usize; 2], usize, [usize; 2])> = Vec::new();
    for (k, mesh) in meshes.iter().enumerate() {
        let numbers = numbers(mesh, cuts, &joined, cuts.count);
        let turned = model.faces().get(k).is_some_and(|face| face.reversed);
        for &triangle in &mesh.triangles {
            if !is_whole(triangle.map(|v| numbers[v])) {
                continue;
            }
            for s in 0..3 {
                let mut side = [triangle[s], triangle[(s + 1) % 3]];
                if turned {
                    side.swap(0, 1);
                }
                let pair = side.map(|v| numbers[v]);
                if pair.iter().all(|&n| n < cuts.count) {
                    sides.push((pair, k, side));
                }
            }
        }
    }
    sides.sort_unstable();
    let mut places = Vec::new();
    let mut from = 0;
    while from < sides.len() {
        let same = sides[from..].iter().take_while(|s| s.0 == sides[from].0);
        let to = from + same.count();
        if to - from > 1 {
            for &(_, k, [a, b]) in &sides[from..to] {
                let vertices = &meshes[k].vertices;
                if !meshes[k].is_border(a, b) {
                    places.push((k, vertices[a].0.midpoint(vertices[b].0)));
                }
            }
        }
        from = to;
    }
    places
}

pub(super) fn assemble(
    plans: &[Plan],
    cuts: &EdgeCuts,
    mut meshes: Vec<FaceMesh>,
) -> ModelTessellation {
    let joined = joined(cuts, &meshes);
    let mut points: Vec<DVec3> = cuts.vertices().to_vec();
    points.extend(cuts.cuts.iter().flat_map(|cut| cut.inner.iter().copied()));
    let mut result = ModelTessellation {
        bound: cuts.missed,
        ..ModelTessellation::default()
    };
    let mut triangles: Vec<[usize; 3]> = Vec::new();
    let samples = fill(plans, &mut meshes);
    for (k, ((mesh, plan), samples)) in meshes.into_iter().zip(plans).zip(samples).enumerate() {
        let reversed = plan.face.reversed;
        if let Some(fault) = mesh.fault {
            result.left_out.push((k, fault));
            continue;
        }
        let numbers = numbers(&mesh, cuts, &joined, points.len());
        result.bound = result.bound.max(mesh.bound);
        let mut used = vec![false; numbers.len()];
        let turn = |[a, b, c]: [usize; 3]| if reversed { [a, c, b] } else { [a, b, c] };
        let kept: Vec<[usize; 3]> = mesh
            .triangles
            .iter()
            .map(|&t| turn(t))
            .filter(|t| is_whole(t.map(|v| numbers[v])))
            .collect();
        kept.iter().flatten().for_each(|&v| used[v] = true);
        // Normals of the vertices that are used.
        let mut wedge = vec![0_u32; numbers.len()];
        for (v, (&(place, shared), (point, normal))) in
            mesh.vertices.iter().zip(samples).enumerate()
        {
            if shared.is_none() {
                points.push(point);
            }
            if used[v] {
                wedge[v] = small(result.normals.len());
                result.normals.push(if reversed { -normal } else { normal });
                result.parameters.push(place);
            }
        }
        for t in kept {
            triangles.push(t.map(|v| numbers[v]));
            result.corners.push(t.map(|v| wedge[v]));
            result.faces.push(small(k));
        }
    }
    compress(points, &triangles, &mut result);
    result
}

/// The plain cells of all faces; point and normal at the vertices of each.
fn fill(plans: &[Plan], meshes: &mut [FaceMesh]) -> Vec<Vec<(DVec3, DVec3)>> {
    let one = |(mesh, plan): (&mut FaceMesh, &Plan)| {
        if mesh.fault.is_none() {
            mesh.fill(plan)
        } else {
            Vec::new()
        }
    };
    meshes.par_iter_mut().zip(plans).map(one).collect()
}

/// Keeps the points that triangles use, in their order.
fn compress(points: Vec<DVec3>, triangles: &[[usize; 3]], result: &mut ModelTessellation) {
    let mut number = vec![u32::MAX; points.len()];
    triangles.iter().flatten().for_each(|&p| number[p] = 0);
    for (number, point) in number.iter_mut().zip(points) {
        if *number == 0 {
            *number = small(result.points.len());
            result.points.push(point);
        }
    }
    let renumbered = triangles.iter().map(|t| t.map(|p| number[p]));
    result.triangles = renumbered.collect();
}

/// Counts are limited to a quarter of what fits.
fn small(k: usize) -> u32 {
    u32::try_from(k).unwrap_or(u32::MAX)
}

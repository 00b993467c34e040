//! Bays: where a border runs in and out again by a narrow mouth.

use super::manifold::Manifold;
use glam::DVec3;
use std::collections::HashSet;

/// Edges of the mean length of the border that a mouth may be wide.
const MOUTH: f64 = 4.0;
/// The border around a bay is so many times as long as its mouth is wide, or more.
const DEEP: f64 = 2.5;
/// Longest border around a bay, as part of the whole border.
const LONGEST: f64 = 0.5;

/// Parts bays off the border `k`: slits, notches and cracks that a mouth of a few edges leads into. The border runs
/// straight across their mouths then, and each bay is a border of its own, added last, whose last vertex and first are
/// joined by no triangle: filling it makes the surface whole. Scans of one view have such where something stood in the
/// light. Returns the numbers of the new borders. O(n log n) for even borders of n vertices.
///
/// A mouth leads out of the surface at both ends, and both face the same side: narrow necks are no bays.
pub(crate) fn part_off(manifold: &mut Manifold, k: usize) -> std::ops::Range<usize> {
    let first = manifold.loops.len();
    let Some(border) = manifold.loops.get(k) else {
        return first..first;
    };
    let n = border.len();
    let chosen = chosen(manifold, border);
    let mut gone = vec![false; n];
    let mut bays = Vec::new();
    for &(i, j) in &chosen {
        let count = (j + n - i) % n;
        let bay: Vec<u32> = (0..=count).map(|s| border[(i + s) % n]).collect();
        for s in 1..count {
            gone[(i + s) % n] = true;
        }
        bays.push(bay);
    }
    let kept = border.iter().zip(&gone).filter(|(_, gone)| !**gone);
    let kept: Vec<u32> = kept.map(|(&v, _)| v).collect();
    if kept.len() < 4 {
        return first..first;
    }
    manifold.loops[k] = kept;
    manifold.loops.extend(bays);
    first..manifold.loops.len()
}

/// The mouths of bays that do not overlap, as places along the border from and to; the deepest first.
fn chosen(manifold: &Manifold, border: &[u32]) -> Vec<(usize, usize)> {
    let n = border.len();
    let points: Vec<DVec3> = border
        .iter()
        .map(|&v| manifold.points[v as usize])
        .collect();
    // 1. Lengths along the border, what leads out of the surface, and the edges that there are.
    let mut lengths = vec![0.0];
    for (i, p) in points.iter().enumerate() {
        lengths.push(lengths[i] + p.distance(points[(i + 1) % n]));
    }
    let whole = lengths[n];
    let reach = MOUTH * whole / n.max(1) as f64;
    let (normals, edges) = around(manifold, border);
    let outward: Vec<DVec3> = (0..n)
        .map(|i| (points[(i + 1) % n] - points[(i + n - 1) % n]).cross(normals[i]))
        .collect();
    // 2. Pairs within reach of each other, by a sweep along the axis that the border is longest in.
    let (low, high) = points
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| {
            (l.min(*p), h.max(*p))
        });
    let axis = (high - low).max_position();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| points[a][axis].total_cmp(&points[b][axis]).then(a.cmp(&b)));
    let mut mouths: Vec<(f64, usize, usize)> = Vec::new();
    for (rank, &a) in order.iter().enumerate() {
        for &b in &order[rank + 1..] {
            if points[b][axis] - points[a][axis] > reach {
                break;
            }
            let wide = points[a].distance(points[b]);
            if wide > reach || normals[a].dot(normals[b]) <= 0.0 {
                continue;
            }
            let forth = (lengths[b] - lengths[a]).rem_euclid(whole);
            let (i, j, deep) = if forth <= 0.5 * whole {
                (a, b, forth)
            } else {
                (b, a, whole - forth)
            };
            let across = points[j] - points[i];
            let out = across.dot(outward[i]) > 0.0 && across.dot(outward[j]) < 0.0;
            let (v, w) = (border[i], border[j]);
            let joined = edges.contains(&(v.min(w), v.max(w)));
            if out && !joined && deep > DEEP * wide && deep <= LONGEST * whole {
                mouths.push((deep - DEEP * wide, i, j));
            }
        }
    }
    // 3. The deepest that do not overlap.
    mouths.sort_by(|x, y| y.0.total_cmp(&x.0).then((x.1, x.2).cmp(&(y.1, y.2))));
    let mut taken = vec![false; n];
    let mut chosen = Vec::new();
    for (_, i, j) in mouths {
        let steps = (j + n - i) % n;
        if (0..steps).any(|s| taken[(i + s) % n]) {
            continue;
        }
        for s in 0..steps {
            taken[(i + s) % n] = true;
        }
        chosen.push((i, j));
    }
    chosen
}

/// The surface's normals at the vertices of a border, and the edges between them.
fn around(manifold: &Manifold, border: &[u32]) -> (Vec<DVec3>, HashSet<(u32, u32)>) {
    let mut place = vec![None; manifold.points.len()];
    for (i, &v) in border.iter().enumerate() {
        place[v as usize] = Some(i);
    }
    let mut normals = vec![DVec3::ZERO; border.len()];
    let mut edges = HashSet::new();
    for (t, triangle) in manifold.triangles.iter().enumerate() {
        let at = triangle.map(|v| place[v as usize]);
        if at.iter().all(Option::is_none) {
            continue;
        }
        let normal = manifold.vector_area(t);
        for s in 0..3 {
            if let Some(i) = at[s] {
                normals[i] += normal;
                let (a, b) = (triangle[s], triangle[(s + 1) % 3]);
                if at[(s + 1) % 3].is_some() {
                    edges.insert((a.min(b), a.max(b)));
                }
            }
        }
    }
    for normal in &mut normals {
        *normal = normal.normalize_or_zero();
    }
    (normals, edges)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::holes;

    /// A square sheet of n by n cells without those that `missing` says.
    fn sheet(n: u32, missing: impl Fn(u32, u32) -> bool) -> Manifold {
        let points: Vec<DVec3> = (0..(n + 1) * (n + 1))
            .map(|k| DVec3::new(f64::from(k % (n + 1)), f64::from(k / (n + 1)), 0.0))
            .collect();
        let cells = (0..n * n).map(|k| (k % n, k / n));
        let triangles: Vec<[u32; 3]> = cells
            .filter(|&(i, j)| !missing(i, j))
            .flat_map(|(i, j)| {
                let k = j * (n + 1) + i;
                [[k, k + 1, k + n + 2], [k, k + n + 2, k + n + 1]]
            })
            .collect();
        crate::mesh::repair::repair(&points, &triangles, &crate::progress::Silent)
            .unwrap()
            .manifold
    }

    #[test]
    fn a_slit_is_parted_off_and_filled_to_the_whole_sheet() {
        let mut slit = sheet(20, |i, j| i == 10 && j < 15);
        let area = slit.area();
        assert_eq!(slit.loops.len(), 1);
        let bays = part_off(&mut slit, 0);
        assert_eq!(bays, 1..2);
        let (whole, filled) = holes::fill(slit, &[1]);
        assert_eq!((whole.loops.len(), whole.euler_characteristic()), (1, 1));
        assert_eq!(whole.loops[0].len(), 80);
        assert!((filled[0].area - 15.0).abs() < 1e-9 && (whole.area() - area - 15.0).abs() < 1e-9);
        let up = |t| whole.vector_area(t).z > 0.0;
        assert!((0..whole.triangles.len()).all(up));
    }

    #[test]
    fn what_is_filled_leaves_one_whole_sheet() {
        let neck = |i: u32, j: u32| (9..11).contains(&j) && i != 10;
        let wide = |i: u32, j: u32| (6..14).contains(&i) && j < 8;
        let square = sheet(20, |_, _| false);
        assert_eq!(part_off(&mut square.clone(), 0), 1..1);
        for (mut sheet, most) in [(sheet(20, wide), 64.0), (sheet(20, neck), 38.0)] {
            let area = sheet.area();
            let bays: Vec<usize> = part_off(&mut sheet, 0).collect();
            let (whole, _) = holes::fill(sheet, &bays);
            assert_eq!((whole.loops.len(), whole.euler_characteristic()), (1, 1));
            assert!(whole.area() - area < most + 1e-9);
        }
    }
}

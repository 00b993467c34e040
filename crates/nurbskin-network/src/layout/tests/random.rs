//! Random manifolds of genus 0 to 5 with up to 6 borders, and random feature lines on them.

use super::super::surface::index;
use super::manifold;
use glam::DVec3;
use nurbskin_scan::mesh::manifold::{Manifold, NONE};
use nurbskin_scan::mesh::samples::{Mesh, Random};

/// A number from 0 to 1.
fn share(random: &mut Random) -> f64 {
    random.below(1 << 20) as f64 / f64::from(1 << 20)
}

/// The manifold of a seed, and the generator after it.
pub(super) fn random_manifold(seed: u64) -> (Manifold, Random) {
    let mut random = Random((seed + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    for _ in 0..8 {
        random.below(2);
    }
    let genus = random.below(6);
    let mut mesh = base(genus, &mut random);
    let waves: Vec<DVec3> = (0..3)
        .map(|_| DVec3::from([0; 3].map(|_| share(&mut random) * 3.0)))
        .collect();
    let noise = [0.0, 0.05, 0.3][random.below(3)];
    for p in &mut mesh.points {
        let wave: f64 = waves.iter().map(|w| w.dot(*p).sin()).sum();
        let shake = DVec3::from([0; 3].map(|_| share(&mut random) - 0.5));
        *p += 0.1 * wave * DVec3::ONE + 0.3 * noise * shake;
    }
    for _ in 0..random.below(7) {
        puncture(&mut mesh, &mut random);
    }
    let shuffled = mesh.shuffled(seed, false);
    (manifold(&shuffled), random)
}

/// A closed or open mesh with about this number of handles.
fn base(genus: usize, random: &mut Random) -> Mesh {
    let fine = |random: &mut Random| 6 + index(random.below(14));
    match (genus, random.below(3)) {
        (0, 0) => Mesh::lattice([fine(random), fine(random)], [false; 2], |u, v| {
            DVec3::new(3.0 * u, 2.0 * v, (4.0 * u).sin() * v)
        }),
        (0, _) => Mesh::sphere([fine(random), fine(random)], 0.0, std::f64::consts::PI),
        (1, 0) => Mesh::torus([2 * fine(random), fine(random)], 1.0, 0.4),
        (_, 0 | 1) => {
            let mut mesh =
                Mesh::sphere([4 + fine(random), fine(random)], 0.0, std::f64::consts::PI);
            for _ in 0..genus {
                join_somewhere(&mut mesh, random);
            }
            mesh
        }
        _ => Mesh::frame(genus as i64, 1 + random.below(2) as i64),
    }
}

/// Joins two triangles without common neighbours by a tube.
fn join_somewhere(mesh: &mut Mesh, random: &mut Random) {
    for _ in 0..50 {
        let n = mesh.triangles.len();
        let (s, t) = (random.below(n), random.below(n));
        let around = |t: usize| {
            let own = mesh.triangles[t];
            let near = mesh.triangles.iter();
            near.filter(move |u| u.iter().any(|k| own.contains(k)))
        };
        let apart = around(s).all(|u| u.iter().all(|k| !mesh.triangles[t].contains(k)));
        if apart {
            mesh.join(s, t);
            return;
        }
    }
}

/// Removes a triangle, the star of a vertex, or all triangles near a place.
fn puncture(mesh: &mut Mesh, random: &mut Random) {
    let t = random.below(mesh.triangles.len());
    let corners = mesh.triangles[t];
    match random.below(3) {
        0 => {
            mesh.triangles.swap_remove(t);
        }
        1 => mesh.triangles.retain(|u| !u.contains(&corners[0])),
        _ => mesh
            .triangles
            .retain(|u| !u.iter().any(|k| corners.contains(k))),
    }
    if mesh.triangles.is_empty() {
        mesh.triangles.push(corners);
    }
}

/// Random feature lines: none, single sides, walks, borders of random regions broken at random, or all sides.
pub(super) fn random_lines(mesh: &Manifold, random: &mut Random) -> Vec<bool> {
    let count = 3 * mesh.triangles.len();
    let mut sharp = vec![false; count];
    match random.below(8) {
        0 => {}
        1 => {
            let share = 2 + random.below(40);
            for flag in &mut sharp {
                *flag = random.below(share) == 0;
            }
        }
        2 => sharp.fill(true),
        3 | 4 => {
            for _ in 0..1 + random.below(6) {
                walk(mesh, &mut sharp, random);
            }
        }
        _ => {
            regions(mesh, &mut sharp, random);
            if random.below(3) == 0 {
                walk(mesh, &mut sharp, random);
            }
        }
    }
    sharp
}

/// A walk along sides that seldom turns back.
fn walk(mesh: &Manifold, sharp: &mut [bool], random: &mut Random) {
    let table = mesh.adjacency();
    let mut vertex = index(random.below(mesh.points.len()));
    for _ in 0..3 + random.below(30) {
        let fan: Vec<u32> = table.fan(vertex).collect();
        let side = fan[random.below(fan.len())] as usize;
        sharp[side] = true;
        vertex = mesh.triangles[side / 3][(side + 1) % 3];
    }
}

/// The borders of regions around random triangles, broken at random.
fn regions(mesh: &Manifold, sharp: &mut [bool], random: &mut Random) {
    let table = mesh.adjacency();
    let count = mesh.triangles.len();
    let mut region = vec![NONE; count];
    let mut queue = std::collections::VecDeque::new();
    for k in 0..2 + index(random.below(8)) {
        let t = random.below(count);
        region[t] = k;
        queue.push_back(t);
    }
    while let Some(t) = queue.pop_front() {
        for o in table.neighbours(t).into_iter().filter(|o| *o != NONE) {
            if region[o as usize] == NONE {
                region[o as usize] = region[t];
                queue.push_back(o as usize);
            }
        }
    }
    let gaps = [0, 3, 30][random.below(3)];
    for (side, flag) in sharp.iter_mut().enumerate() {
        let other = table.opposite[side];
        let border = other != NONE && region[other as usize / 3] != region[side / 3];
        *flag |= border && random.below(100) >= gaps;
    }
}

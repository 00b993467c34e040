//! Meshes of known topology for tests: lattices, spheres, tori, and frames of any genus, which can be cut, shuffled,
//! wound at random and joined by handles. [`check`] verifies every property of a manifold by independent counting.

#![allow(
    clippy::disallowed_methods,
    reason = "meshes of tests need no fixed last digits"
)]

use super::Manifold;
use super::manifold::NONE;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// Points and triangles, as a file would have them.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Corners.
    pub points: Vec<DVec3>,
    /// Three corners each, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// Numbers that look random, the same ones for the same seed.
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// 0..n.
    pub fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 11) % n as u64) as usize
    }
    fn shuffle<T>(&mut self, items: &mut [T]) {
        for k in (1..items.len()).rev() {
            items.swap(k, self.below(k + 1));
        }
    }
}

impl Mesh {
    /// A lattice of m x n cells over 0..=1 x 0..=1; where a direction is closed its last line is its first.
    pub fn lattice([m, n]: [u32; 2], closed: [bool; 2], shape: impl Fn(f64, f64) -> DVec3) -> Self {
        let [rows, columns] = [
            if closed[1] { n } else { n + 1 },
            if closed[0] { m } else { m + 1 },
        ];
        let at = |i: u32, j: u32| (j % rows) * columns + i % columns;
        let mut mesh = Self::default();
        for j in 0..rows {
            for i in 0..columns {
                mesh.points.push(shape(
                    f64::from(i) / f64::from(m),
                    f64::from(j) / f64::from(n),
                ));
            }
        }
        for j in 0..n {
            for i in 0..m {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                mesh.triangles.extend(if (i + j) % 2 == 0 {
                    [[a, b, c], [a, c, d]]
                } else {
                    [[a, b, d], [b, c, d]]
                });
            }
        }
        mesh
    }

    /// The part of the unit sphere between two polar angles; closed where one is 0 or pi.
    pub fn sphere([m, n]: [u32; 2], from: f64, to: f64) -> Self {
        use std::f64::consts::{PI, TAU};
        let mesh = Self::lattice([m, n], [true, false], |u, v| {
            let (polar, around) = (from + (to - from) * v, TAU * u);
            // The same bits for all points of a pole.
            let r = if polar == 0.0 || polar == PI {
                0.0
            } else {
                polar.sin()
            };
            DVec3::new(r * around.cos(), r * around.sin(), polar.cos())
        });
        mesh.welded()
    }

    /// A torus around z.
    pub fn torus([m, n]: [u32; 2], large: f64, small: f64) -> Self {
        use std::f64::consts::TAU;
        Self::lattice([m, n], [true, true], |u, v| {
            let (u, v) = (TAU * u, TAU * v);
            let r = large + small * v.cos();
            DVec3::new(r * u.cos(), r * u.sin(), small * v.sin())
        })
    }

    /// The surface of cubes of size 1, each side in d x d squares, wound outward.
    pub fn cubes(d: i64, solid: impl Fn(i64, i64, i64) -> bool) -> Self {
        let inside = |p: [i64; 3]| {
            let [x, y, z] = p.map(|x| x.div_euclid(d));
            p.iter().all(|x| (0..16 * d).contains(x)) && solid(x, y, z)
        };
        let mut number = BTreeMap::new();
        let mut mesh = Self::default();
        for cell in 0..(12 * d).pow(3) {
            let p = [
                cell % (12 * d),
                cell / (12 * d) % (12 * d),
                cell / (12 * d).pow(2),
            ];
            if !inside(p) {
                continue;
            }
            for axis in 0..3 {
                for forward in [0, 1] {
                    let mut beyond = p;
                    beyond[axis] += 2 * forward - 1;
                    if inside(beyond) {
                        continue;
                    }
                    let corner = |s: i64, t: i64| {
                        let mut q = p;
                        q[axis] += forward;
                        q[(axis + 1) % 3] += s;
                        q[(axis + 2) % 3] += t;
                        q
                    };
                    let mut ring = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                    if forward == 0 {
                        ring.reverse();
                    }
                    let [a, b, c, e] = ring.map(|q| {
                        *number.entry(q).or_insert_with(|| {
                            mesh.points
                                .push(DVec3::from(q.map(|x| x as f64 / d as f64)));
                            mesh.points.len() as u32 - 1
                        })
                    });
                    mesh.triangles.extend([[a, b, c], [a, c, e]]);
                }
            }
        }
        mesh
    }

    /// A frame of genus g: a bar of 2 g + 1 by 3 by 1 cubes with g holes.
    pub fn frame(genus: i64, d: i64) -> Self {
        Self::cubes(d, |x, y, z| {
            let bar = x < 2 * genus + 1 && y < 3 && z < 1;
            bar && !(x % 2 == 1 && y == 1)
        })
    }

    /// Points with equal coordinates as one, triangles without extent left out.
    fn welded(&self) -> Self {
        let mut number = BTreeMap::new();
        let mut mesh = Self::default();
        let place: Vec<u32> = self
            .points
            .iter()
            .map(|p| {
                *number
                    .entry((*p + DVec3::ZERO).to_array().map(f64::to_bits))
                    .or_insert_with(|| {
                        mesh.points.push(*p);
                        mesh.points.len() as u32 - 1
                    })
            })
            .collect();
        mesh.triangles = self
            .triangles
            .iter()
            .map(|t| t.map(|k| place[k as usize]))
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .collect();
        mesh
    }

    /// Without the triangles that have a corner where `cut` says.
    pub fn without(mut self, cut: impl Fn(DVec3) -> bool) -> Self {
        let points = &self.points;
        self.triangles
            .retain(|t| !t.iter().any(|&k| cut(points[k as usize])));
        self
    }

    /// The same in another order, each triangle begun at another corner; wound at random if `turned`.
    pub fn shuffled(&self, seed: u64, turned: bool) -> Self {
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
        let mut order: Vec<usize> = (0..self.points.len()).collect();
        random.shuffle(&mut order);
        let mut place = vec![0; order.len()];
        for (to, &from) in order.iter().enumerate() {
            place[from] = to as u32;
        }
        let mut triangles = self.triangles.clone();
        for t in &mut triangles {
            t.rotate_left(random.below(3));
            if turned && random.below(2) == 0 {
                t.swap(0, 1);
            }
            *t = t.map(|k| place[k as usize]);
        }
        random.shuffle(&mut triangles);
        Self {
            points: order.iter().map(|&k| self.points[k]).collect(),
            triangles,
        }
    }

    /// Three points of its own for each triangle, as in STL.
    pub fn soup(&self) -> Self {
        let corners = self.triangles.iter().flatten();
        Self {
            points: corners.map(|&k| self.points[k as usize]).collect(),
            triangles: (0..self.triangles.len() as u32)
                .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
                .collect(),
        }
    }

    /// Joins the places of two triangles by a tube in place of them: one handle more.
    pub fn join(&mut self, s: usize, t: usize) {
        let (low, high) = (s.min(t), s.max(t));
        let b = self.triangles.swap_remove(high);
        let a = self.triangles.swap_remove(low);
        // The tube ends against the winding of both.
        let place = |k: u32| self.points[k as usize];
        let b = [b[0], b[2], b[1]];
        let stretch = |r: usize| {
            (0..3)
                .map(|k| place(a[k]).distance(place(b[(k + r) % 3])))
                .sum()
        };
        let turn = (0..3)
            .min_by(|&x, &y| f64::total_cmp(&stretch(x), &stretch(y)))
            .unwrap();
        for k in 0..3 {
            let l = (k + 1) % 3;
            let [p, q] = [a[k], a[l]];
            let [r, s] = [b[(k + turn) % 3], b[(l + turn) % 3]];
            self.triangles.extend([[p, q, s], [p, s, r]]);
        }
    }
}

/// Panics unless everything is true that [`Manifold`] promises; counts by itself.
pub fn check(manifold: &Manifold) {
    let m = manifold;
    assert_eq!(m.points.len(), m.source.len());
    let mut sides = BTreeSet::new();
    let mut edges = BTreeSet::new();
    let mut corners = vec![0; m.points.len()];
    for t in &m.triangles {
        for s in 0..3 {
            let (a, b) = (t[s], t[(s + 1) % 3]);
            assert!(a != b && (a as usize) < m.points.len());
            assert!(sides.insert((a, b)), "side {a} {b} occurs twice");
            edges.insert((a.min(b), a.max(b)));
            corners[a as usize] += 1;
        }
    }
    // One fan per vertex: turning around it meets all its triangles.
    let adjacency = m.adjacency();
    for v in 0..m.points.len() as u32 {
        let fan: Vec<u32> = adjacency.fan(v).collect();
        assert!(
            !fan.is_empty() && fan.len() == corners[v as usize],
            "vertex {v} has several fans"
        );
        assert!(
            fan.iter()
                .all(|&s| m.triangles[s as usize / 3][s as usize % 3] == v)
        );
    }
    // The borders are the sides without a partner, once each.
    let open: BTreeSet<(u32, u32)> = sides
        .iter()
        .filter(|(a, b)| !sides.contains(&(*b, *a)))
        .copied()
        .collect();
    let mut seen = BTreeSet::new();
    let mut bordering = BTreeSet::new();
    for border in &m.loops {
        for (&a, &b) in border.iter().zip(border.iter().cycle().skip(1)) {
            assert!(seen.insert((a, b)));
            assert!(bordering.insert(a), "vertex {a} is on the border twice");
            assert!(adjacency.on_border(a));
        }
    }
    assert_eq!(seen, open);
    // Connected, and the Euler characteristic by counting.
    let mut reached = vec![false; m.triangles.len()];
    let mut stack = vec![0];
    reached[0] = true;
    while let Some(t) = stack.pop() {
        for u in adjacency.neighbours(t) {
            if u != NONE && !std::mem::replace(&mut reached[u as usize], true) {
                stack.push(u as usize);
            }
        }
    }
    assert!(reached.iter().all(|r| *r), "several pieces");
    let chi = m.points.len() as i64 - edges.len() as i64 + m.triangles.len() as i64;
    assert_eq!(m.euler_characteristic(), chi);
    assert_eq!(chi, 2 - 2 * m.genus() as i64 - m.loops.len() as i64);
}

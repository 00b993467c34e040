//! Domains that wrap round: tube, sphere and torus.
//!
//! The mesh is cut along a path of triangles, across which v grows by one: from rim to rim of a tube, from pole to pole
//! of a sphere. A torus is cut along two loops. The dual tree of its triangles and a tree of the remaining edges leave
//! two edges, each of which closes one loop (tree-cotree decomposition, Eppstein 2003, arXiv:cs/0207082).
//!
//! The two periods of a torus are then reduced to the shortest pair under the energy of its harmonic forms (Lagrange
//! and Gauss), so that nothing is twisted.

use super::layout::{Setup, Surface};
use super::ragged::{Tooth, depth, normals_along};
use super::rim::Rim;
use super::sides::{NONE, cross, ends, path};
use glam::{DVec2, DVec3};
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use nurbskin_geometry::{Error, Result};

/// Most rounds of the lattice reduction. Guard: it ends earlier; the length falls geometrically.
const REDUCTION_ROUNDS: usize = 32;
/// Most turns that one round of the reduction adds. Guard: keeps the turns within the range of `i8`.
const MAX_TURNS_PER_ROUND: f64 = 8.0;

/// A tube: u = 0 on the first rim and u = 1 on the second, both free in v; v grows by 1 around the tube.
pub(super) fn tube(surface: &Surface<'_>, rims: [&[u32]; 2]) -> Result<(Setup, Vec<DVec2>)> {
    let (vertices, triangles) = (surface.points.len(), surface.triangles.len());
    let mut setup = Setup::open(vertices, triangles);
    setup.closed = [false, true];
    for (rim, u) in rims.into_iter().zip([0.0, 1.0]) {
        for &k in rim {
            setup.held[k as usize][0] = Some(u);
        }
    }
    for (border, base) in rims.into_iter().zip([0.0, 1.0]) {
        let places = border.iter().map(|&k| surface.points[k as usize]);
        let rim = Rim::new(places.collect());
        let normals = normals_along(surface, border);
        let tooth = |(k, &vertex): (usize, &u32)| Tooth {
            vertex,
            axis: 0,
            base,
            depth: depth(
                surface.points[vertex as usize],
                normals[k],
                rim.smoothed_at(k),
            ),
        };
        setup.teeth.extend(border.iter().enumerate().map(tooth));
    }
    // Sides on the rims.
    let is_of = |side: u32, u: f64| {
        let own = ends(surface.triangles, side);
        surface.sides.partner[side as usize] == NONE
            && own.iter().all(|&k| setup.held[k as usize][0] == Some(u))
    };
    let sides = 0..u32::try_from(3 * triangles).unwrap_or(u32::MAX);
    let from: Vec<u32> = sides.filter(|&s| is_of(s, 0.0)).collect();
    let way = path(&surface.sides.partner, &from, |s| is_of(s, 1.0), |_| false);
    cut(surface, &mut setup, way)?;
    pin(surface, &mut setup, rims[0]);
    Ok((setup, vec![DVec2::new(0.5, 0.0); vertices]))
}

/// A sphere: u = 0 at the first pole and 1 at the second; v grows by 1 around it.
pub(super) fn sphere(surface: &Surface<'_>, poles: [u32; 2]) -> Result<(Setup, Vec<DVec2>)> {
    let (vertices, triangles) = (surface.points.len(), surface.triangles.len());
    let mut setup = Setup::open(vertices, triangles);
    setup.closed = [false, true];
    setup.poles = Some(poles);
    let has = |t: u32, k: u32| surface.triangles[t as usize].contains(&k);
    // Sides around a pole, seen from the triangles outside of its fan.
    let around = |side: u32, pole: u32| {
        let other = surface.sides.partner[side as usize];
        other != NONE && has(other / 3, pole) && !has(side / 3, pole)
    };
    let sides = 0..u32::try_from(3 * triangles).unwrap_or(u32::MAX);
    let from: Vec<u32> = sides.filter(|&s| around(s, poles[0])).collect();
    let at_pole = |t: u32| has(t, poles[0]) || has(t, poles[1]);
    let way = path(
        &surface.sides.partner,
        &from,
        |s| around(s, poles[1]),
        at_pole,
    );
    cut(surface, &mut setup, way)?;
    let ring: Vec<u32> = from
        .iter()
        .map(|&s| ends(surface.triangles, s)[0])
        .collect();
    pin(surface, &mut setup, &ring);
    Ok((setup, vec![DVec2::new(0.5, 0.0); vertices]))
}

/// Lets v grow by 1 across a path from end to end.
fn cut(surface: &Surface<'_>, setup: &mut Setup, way: Option<Vec<u32>>) -> Result<()> {
    let Some(way) = way else {
        return Err(Error::Unsupported(
            "the mesh has no way from one end to the other: it is too small to be charted".into(),
        ));
    };
    let partner = &surface.sides.partner;
    for (k, &side) in way.iter().enumerate() {
        cross(
            &mut setup.jumps,
            partner,
            side,
            1,
            if k == 0 { -1 } else { 1 },
        );
    }
    Ok(())
}

/// Puts v = 0 at the vertex of `among` that is farthest from the centroid of the vertices, a choice independent of
/// their numbering.
fn pin(surface: &Surface<'_>, setup: &mut Setup, among: &[u32]) {
    let middle = surface.points.iter().sum::<DVec3>() / surface.points.len().max(1) as f64;
    let far = |k: &u32| surface.points[*k as usize].distance_squared(middle);
    if let Some(&k) = among.iter().max_by(|a, b| far(a).total_cmp(&far(b))) {
        setup.held[k as usize][1] = Some(0.0);
    }
}

/// A torus: u and v each grow by 1 along one of two loops that cut it open.
///
/// The dual tree of triangles and a tree of the remaining edges leave two edges; each of them closes one loop (Eppstein
/// 2003, arXiv:cs/0207082).
pub(super) fn torus(surface: &Surface<'_>) -> Result<(Setup, Vec<DVec2>)> {
    let (vertices, triangles) = (surface.points.len(), surface.triangles.len());
    let mut setup = Setup::open(vertices, triangles);
    setup.closed = [true, true];
    let partner = &surface.sides.partner;
    // 1. A tree of triangles, given by the side through which each was entered.
    let mut entered = vec![NONE; triangles];
    let mut seen = vec![false; triangles];
    let mut queue = std::collections::VecDeque::from([0_u32]);
    if let Some(first) = seen.first_mut() {
        *first = true;
    }
    while let Some(t) = queue.pop_front() {
        for side in 3 * t..3 * t + 3 {
            let other = partner.get(side as usize).copied().unwrap_or(NONE);
            if other != NONE && !seen[other as usize / 3] {
                seen[other as usize / 3] = true;
                entered[other as usize / 3] = other;
                queue.push_back(other / 3);
            }
        }
    }
    // 2. A tree of the edges that it does not cross; the edges left over close loops.
    let mut sets = DisjointSets::new(vertices);
    let mut left = Vec::new();
    for &side in &surface.sides.edges {
        let other = partner[side as usize];
        if other == NONE {
            continue;
        }
        let crossed = entered[side as usize / 3] == side || entered[other as usize / 3] == other;
        if !crossed {
            let [a, b] = ends(surface.triangles, side).map(|k| k as usize);
            if sets.root(a) == sets.root(b) {
                left.push(side);
            } else {
                sets.join(a, b);
            }
        }
    }
    let [first, second] = left[..] else {
        return Err(Error::Unsupported(format!(
            "the mesh is no torus: {} loops cut it open instead of two",
            left.len()
        )));
    };
    // 3. Across each such edge and back through the tree.
    for (direction, side) in [first, second].into_iter().enumerate() {
        cross(&mut setup.jumps, partner, side, direction, 1);
        for (start, turns) in [(partner[side as usize], 1), (side, -1)] {
            let mut at = start / 3;
            while entered[at as usize] != NONE {
                let door = entered[at as usize];
                cross(&mut setup.jumps, partner, door, direction, turns);
                at = partner[door as usize] / 3;
            }
        }
    }
    setup.held[0] = [Some(0.0), Some(0.0)];
    Ok((setup, vec![DVec2::ZERO; vertices]))
}

/// Changes the basis of a torus's first layout so that its two directions are the shortest loops, as nearly orthogonal
/// as possible, u the shorter one; returns the transformed places.
///
/// The lattice of periods is reduced under the energy of its harmonic forms (Lagrange and Gauss), so that nothing is
/// twisted.
pub(super) fn straighten(surface: &Surface<'_>, setup: &mut Setup, places: &[DVec2]) -> Vec<DVec2> {
    // 1. Energies <du, du>, <du, dv>, <dv, dv>.
    let mut energy = [0.0; 3];
    for (t, triangle) in surface.triangles.iter().enumerate() {
        let p = surface.corners(t);
        let at = setup.lifted(triangle, t, places);
        let twice = (p[1] - p[0]).cross(p[2] - p[0]).length();
        if twice > 0.0 {
            let gradient = |k: fn(DVec2) -> f64| {
                let x = at.map(k);
                (x[0] * (p[2] - p[1]) + x[1] * (p[0] - p[2]) + x[2] * (p[1] - p[0])) / twice
            };
            let (du, dv) = (gradient(|p| p.x), gradient(|p| p.y));
            energy[0] += twice * du.dot(du);
            energy[1] += twice * du.dot(dv);
            energy[2] += twice * dv.dot(dv);
        }
    }
    // 2. Integer combinations of the two with the least energy.
    let (mut a, mut b) = ([1_i8, 0_i8], [0_i8, 1_i8]);
    let product = |a: [i8; 2], b: [i8; 2]| {
        let [x, y, z, w] = [a[0], a[1], b[0], b[1]].map(f64::from);
        x * z * energy[0] + (x * w + y * z) * energy[1] + y * w * energy[2]
    };
    for _ in 0..REDUCTION_ROUNDS {
        if product(a, a) > product(b, b) {
            (a, b) = (b, a);
        }
        let share = (product(a, b) / product(a, a).max(f64::MIN_POSITIVE)).round();
        if share == 0.0 {
            break;
        }
        #[expect(clippy::cast_possible_truncation, reason = "clamped")]
        let share = share.clamp(-MAX_TURNS_PER_ROUND, MAX_TURNS_PER_ROUND) as i8;
        b = [0, 1].map(|k| b[k].saturating_sub(share.saturating_mul(a[k])));
    }
    // 3. The form of the least energy changes slowest: it belongs to the long way round, which is v.
    let (u, mut v) = (b, a);
    let determinant = i16::from(u[0]) * i16::from(v[1]) - i16::from(u[1]) * i16::from(v[0]);
    if determinant < 0 {
        v = v.map(|x| -x);
    }
    for j in &mut setup.jumps {
        let turn = |c: [i8; 2]| {
            c[0].saturating_mul(j[0])
                .saturating_add(c[1].saturating_mul(j[1]))
        };
        *j = [turn(u), turn(v)];
    }
    let combine = |c: [i8; 2], p: DVec2| f64::from(c[0]) * p.x + f64::from(c[1]) * p.y;
    places
        .iter()
        .map(|&p| DVec2::new(combine(u, p), combine(v, p)))
        .collect()
}

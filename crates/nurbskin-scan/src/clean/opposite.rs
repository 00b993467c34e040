//! Walls that meet at sharp edges, told apart by what lies opposite.
//!
//! Along the trailing edge of a wing the next points are on both walls, and sides carried on from point to point go
//! round the edge as if there were one sheet. But a ray that leaves one wall along its normal, through air or through
//! material, meets the next wall from the other side: consistent normals of both are opposed. Where those of a cloud are
//! not, the even regions of the surface are turned by such rays, and what lies between them joins the one whose plane it
//! continues. Where they are, what lies between two walls that look opposite ways still joins the one that it continues.

use super::elements::{Element, Elements, NEIGHBOURS, offsets};
use super::faced::OPPOSED;
use super::orientation::{cost_and_turn, turn_outward};
use super::parts::Parts;
use super::signed_sets::SignedSets;
use crate::normals::{plane_axes, plane_through};
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::spatial::morton::crowded_box;
use nurbskin_geometry::spatial::neighbours::{Nearest, Neighbours};

/// Points that send rays.
const SAMPLES: usize = 2000;
/// Steps of a ray; between walls they are as long as the way is free.
const STEPS: usize = 200;
/// A ray meets a sheet within this many of its spacings of a point: of scattered points one in a hundred is missed.
const CLOSE: f64 = 1.2;
/// Within so many spacings of height a ray is still at the sheet that it left.
const OWN: f64 = 0.5;
/// Cosine between a ray and the normal where it ends: a grazing one says little.
const STRAIGHT: f64 = 0.7;
/// Fewest pairs of opposite points from which sides are judged. A guard.
const FEWEST: usize = 50;
/// Part of the pairs that may be contrary, as where rays miss thin parts.
const CONTRARY: f64 = 0.2;
/// Ratios of the variances across and along the plane of even neighbourhoods, in that of most points, and their bounds.
const EVEN: f64 = 6.0;
const EVEN_BOUNDS: [f64; 2] = [0.005, 0.05];
/// The cost of a link up to which neighbours belong to one region: 18 degrees.
const SMOOTH: f64 = 0.05;
/// Part of the points that makes a region count.
const REGION: f64 = 0.02;
/// Part of the votes of two regions by which they must outweigh the others.
const CLEAR: f64 = 0.6;
/// Fewest votes that decide between two regions. A guard.
const VOTES: f64 = 10.0;
/// Number of nearest points among which known sheets are sought.
const AROUND: usize = 48;
/// Most points of one sheet through which its plane is laid.
const PLANE: usize = 10;
/// Fewest points with which a sheet has a plane: a plane takes three.
const FEWEST_ON_SHEET: usize = 5;
/// A point off the plane that it continues by more than this part of its spacing keeps the direction of its own normal.
const OFF: f64 = 0.15;
/// A point continues a sheet up to this part of its spacing off its plane.
const CONTINUES: f64 = 0.25;
/// Times that sheets grow by the points beside them: they reach less than five spacings from what is even.
const ROUNDS: usize = 30;

/// Turns normals that contradict what lies opposite, and those between walls that look opposite ways to the side of the wall
/// that they continue; leaves them as they are where that does not help. O(n).
pub(super) fn mend(
    tree: &Neighbours,
    elements: &mut Elements,
    parts: &Parts,
    alive: &(dyn Fn(usize) -> bool + Sync),
) {
    let pairs = opposite_pairs(tree, &elements.of, parts, alive);
    let contrary = |of: &[Element]| {
        let same = |&&[k, j]: &&[u32; 2]| of[k as usize].normal.dot(of[j as usize].normal) > 0.0;
        pairs.iter().filter(same).count()
    };
    let before = contrary(&elements.of);
    if pairs.len() < FEWEST {
        return;
    }
    let core = core(tree, elements, alive);
    if before as f64 <= CONTRARY * pairs.len() as f64 {
        let (mut sided, mut known) = (elements.of.clone(), core);
        let join = Join {
            within: f64::INFINITY,
            opposed: true,
        };
        for _ in 0..ROUNDS {
            if !grow(tree, &mut sided, &mut known, join, alive) {
                break;
            }
        }
        if contrary(&sided) <= before {
            elements.of = sided;
        }
        return;
    }
    let Some((mut turned, mut known)) = turned_regions(tree, elements, &pairs, &core) else {
        return;
    };
    // First what continues a sheet; then what is left between them, as on a round edge.
    for within in [CONTINUES, f64::INFINITY] {
        let join = Join {
            within,
            opposed: false,
        };
        for _ in 0..ROUNDS {
            if !grow(tree, &mut turned, &mut known, join, alive) {
                break;
            }
        }
    }
    if 2 * contrary(&turned) < before {
        elements.of = turned;
        let whole = vec![0; elements.of.len()];
        turn_outward(tree.sorted_points(), &mut elements.of, &whole, 1, alive);
    }
}

/// The points whose neighbourhoods are even, as are those of all their neighbours: at a sharp edge one may be even by chance,
/// and lead from one wall to the other. O(n).
fn core(
    tree: &Neighbours,
    elements: &Elements,
    alive: &(dyn Fn(usize) -> bool + Sync),
) -> Vec<bool> {
    let (points, of) = (tree.sorted_points(), &elements.of);
    if elements.table.count() != NEIGHBOURS {
        return vec![false; of.len()];
    }
    let thick = each(of.len(), |k| {
        let mut around = [DVec3::ZERO; NEIGHBOURS];
        offsets(points, points[k], elements.table.of(k), &mut around);
        let (values, _) = plane_through(&around);
        values[0] / values[1].max(f64::MIN_POSITIVE)
    });
    let [least, most] = EVEN_BOUNDS;
    let limit = (EVEN * median_in_place(&mut thick.clone())).clamp(least, most);
    let even = |k: usize| alive(k) && thick[k] <= limit;
    each(of.len(), |k| {
        even(k) && elements.table.of(k).iter().all(|&j| even(j as usize))
    })
}

/// Points of which one sees the other along its normal.
fn opposite_pairs(
    tree: &Neighbours,
    of: &[Element],
    parts: &Parts,
    alive: &(dyn Fn(usize) -> bool + Sync),
) -> Vec<[u32; 2]> {
    let living: Vec<u32> = (0_u32..)
        .take(of.len())
        .filter(|&k| alive(k as usize))
        .collect();
    let step = living.len().div_ceil(SAMPLES).max(1);
    let bounds = crowded_box(tree.sorted_points());
    let found = each(living.len().div_ceil(step), |sample| {
        let k = living[sample * step];
        let normal = of[k as usize].normal;
        let met = |j: &u32| parts.of[*j as usize] == parts.of[k as usize];
        [normal, -normal].map(|way| first_met(tree, of, bounds, k as usize, way, alive).filter(met))
    });
    let pair = |(sample, met): (usize, Option<u32>)| Some([living[sample * step], met?]);
    let both = found.into_iter().enumerate();
    both.flat_map(|(sample, met)| met.map(|met| (sample, met)))
        .filter_map(pair)
        .collect()
}

/// The point that a ray from a point meets first, if the ray leaves its own sheet freely and meets another one squarely.
fn first_met(
    tree: &Neighbours,
    of: &[Element],
    [low, high]: [DVec3; 2],
    k: usize,
    way: DVec3,
    alive: &(dyn Fn(usize) -> bool + Sync),
) -> Option<u32> {
    let points = tree.sorted_points();
    let mut near = Nearest::default();
    let (mut at, mut left) = (0.0, false);
    for _ in 0..STEPS {
        let place = points[k] + way * at;
        if left && !(place.cmpge(low).all() && place.cmple(high).all()) {
            return None;
        }
        tree.search(place, 1, &mut near, |j| alive(j as usize));
        let &(square, j) = near.items.first()?;
        let (distance, element) = (square.sqrt(), &of[j as usize]);
        let reach = CLOSE * element.spacing;
        if !(reach > 0.0 && reach.is_finite()) {
            return None;
        }
        if distance > reach {
            left = true;
            at += (distance - 0.9 * reach).max(0.1 * reach);
        } else if left {
            return (element.normal.dot(way).abs() > STRAIGHT).then_some(j);
        } else {
            let height = (points[j as usize] - points[k]).dot(way);
            if height.abs() > OWN * of[k].spacing.max(element.spacing) {
                return None;
            }
            at += 0.5 * reach;
        }
    }
    None
}

/// The elements with the even regions, those of the `core`, turned by what lies opposite, and which points are in these;
/// `None` where that is not clear.
fn turned_regions(
    tree: &Neighbours,
    elements: &Elements,
    pairs: &[[u32; 2]],
    core: &[bool],
) -> Option<(Vec<Element>, Vec<bool>)> {
    let (points, of) = (tree.sorted_points(), &elements.of);
    // 1. Even regions.
    let even = |k: usize| core[k];
    let links = |k: usize| {
        let row = if even(k) { elements.table.of(k) } else { &[] };
        row.iter().map(|&j| j as usize).filter(|&j| even(j))
    };
    let judge =
        |k: usize, j: usize| Some(cost_and_turn(points, of, k, j)).filter(|link| link.0 <= SMOOTH);
    let mut sets = SignedSets::spanning(of.len(), &[0.01, SMOOTH], links, judge);
    // 2. Votes between them; each pair of opposite points should be opposed.
    let (number, count) = sets.numbered();
    let mut sizes = vec![0_usize; count];
    for k in (0..of.len()).filter(|&k| even(k)) {
        sizes[number[k] as usize] += 1;
    }
    let large = |k: usize| sizes[number[k] as usize] as f64 >= REGION * of.len() as f64;
    let mut votes: Vec<(u32, u32, bool, [usize; 2])> = Vec::new();
    for &[k, j] in pairs {
        let [a, b] = [k, j].map(|k| k as usize);
        if number[a] != number[b] && large(a) && large(b) {
            let same = of[a].normal.dot(of[b].normal) > 0.0;
            let turned = same ^ sets.turned[a] ^ sets.turned[b];
            let (low, high) = (number[a].min(number[b]), number[a].max(number[b]));
            votes.push((low, high, turned, [a, b]));
        }
    }
    votes.sort_unstable();
    let mut joins: Vec<(f64, [usize; 2], bool)> = Vec::new();
    for group in votes.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        let total = group.len() as f64;
        let net = 2.0 * group.iter().filter(|vote| vote.2).count() as f64 - total;
        if total >= VOTES && net.abs() >= CLEAR * total {
            // Any pair of that opinion stands for both regions.
            let stands = group.iter().find(|vote| vote.2 == (net > 0.0))?.3;
            let [a, b] = stands;
            joins.push((net.abs(), stands, of[a].normal.dot(of[b].normal) > 0.0));
        }
    }
    if joins.is_empty() {
        return None;
    }
    joins.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
    for (_, [a, b], turned) in joins {
        sets.join(a, b, turned);
    }
    sets.flatten();
    // 3. The set that most points are in.
    let (number_now, count) = sets.numbered();
    let mut sizes_now = vec![0_usize; count];
    for k in (0..of.len()).filter(|&k| even(k) && large(k)) {
        sizes_now[number_now[k] as usize] += 1;
    }
    let largest = (0..count).max_by_key(|&set| (sizes_now[set], std::cmp::Reverse(set)))?;
    let known = (0..of.len()).map(|k| even(k) && large(k) && number_now[k] as usize == largest);
    let known = known.collect();
    let mut turned = of.clone();
    for (element, turned) in turned.iter_mut().zip(&sets.turned) {
        if *turned {
            element.normal = -element.normal;
        }
    }
    Some((turned, known))
}

/// Which sheets a point may join.
#[derive(Clone, Copy, Debug)]
struct Join {
    /// Those whose plane it continues up to this part of its spacing.
    within: f64,
    /// Only one of two that look opposite ways; the side of other points is known as it is.
    opposed: bool,
}

/// Gives the points next to known ones the side of the sheet whose plane they continue; whether there were any.
fn grow(
    tree: &Neighbours,
    of: &mut [Element],
    known: &mut [bool],
    Join { within, opposed }: Join,
    alive: &(dyn Fn(usize) -> bool + Sync),
) -> bool {
    let points = tree.sorted_points();
    let seen: &[Element] = of;
    let found = each(seen.len(), |k| {
        if known[k] || !alive(k) {
            return None;
        }
        let mut near = Nearest::default();
        tree.search(points[k], AROUND, &mut near, |j| {
            j as usize != k && alive(j as usize)
        });
        // Of the nearest, not only far ones.
        let close = near.indices().take(PLANE).any(|j| known[j as usize]);
        if !close {
            return None;
        }
        let first = near.indices().find(|&j| known[j as usize])?;
        let side = seen[first as usize].normal;
        let sheet = |same: bool| {
            let on = near.items.iter().map(|item| item.1 as usize);
            let on = on.filter(|&j| known[j] && (seen[j].normal.dot(side) >= 0.0) == same);
            let on = on.take(PLANE);
            let (count, middle, normal) = on.clone().fold(
                (0_usize, DVec3::ZERO, DVec3::ZERO),
                |(n, middle, normal), j| (n + 1, middle + points[j], normal + seen[j].normal),
            );
            if count < FEWEST_ON_SHEET {
                return None;
            }
            let (_, axes) = plane_axes(on.map(|j| points[j]));
            let plane = axes[0] * axes[0].dot(normal).signum();
            let height = (points[k] - middle / count as f64).dot(plane).abs();
            Some((height, plane))
        };
        let own = seen[k].normal;
        let (height, plane) = match (sheet(true), sheet(false)) {
            (Some(a), Some(b)) if !opposed || a.1.dot(b.1) < OPPOSED => {
                if b.0 < a.0 {
                    b
                } else {
                    a
                }
            }
            _ if opposed => return Some(own),
            (a, b) => a.or(b)?,
        };
        if height > within * seen[k].spacing {
            return None;
        }
        let along = own.dot(plane);
        Some(if height <= OFF * seen[k].spacing || along.abs() < 0.1 {
            plane
        } else {
            own * along.signum()
        })
    });
    let mut grown = false;
    for (k, normal) in found.into_iter().enumerate() {
        if let Some(normal) = normal {
            of[k].normal = normal;
            known[k] = true;
            grown = true;
        }
    }
    grown
}

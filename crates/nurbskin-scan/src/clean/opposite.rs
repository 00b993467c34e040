//! Orientation of walls that meet at sharp edges, by rays from wall to wall.
//!
//! Along the trailing edge of a wing the nearest points lie on both walls, and propagation from point to point goes
//! round the edge as if there were one sheet. But a ray that leaves one wall along its normal, through air or through
//! material, meets the next wall from the other side: consistent normals at both ends are opposed, `n_a · n_b < 0`.
//! Where more than 20 % of the rays of a cloud contradict this, the even regions of the surface are turned by a vote
//! of the rays between them, and the points in between join the region whose plane they continue. Otherwise, only
//! points between two walls that look to opposite sides are assigned to the wall that they continue. Source: ours.

use super::elements::{Element, Elements, NEIGHBOURS, offsets};
use super::faced::OPPOSED_COSINE;
use super::orientation::{cost_and_turn, turn_outward};
use super::parts::Parts;
use super::signed_sets::SignedSets;
use crate::normals::{plane_axes, plane_through};
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::spatial::morton::crowded_box;
use nurbskin_geometry::spatial::neighbours::{Nearest, NeighbourTable, Neighbours};

/// Points from which rays start, in both directions of the normal. Guard: bounds the time; far more than the pairs that
/// decide ([`MIN_OPPOSITE_PAIRS`]).
const RAY_SAMPLES: usize = 2000;
/// Most steps of a ray; a step is as long as the way is free. Guard: bounds the time of rays along a sheet.
const MAX_RAY_STEPS: usize = 200;
/// Distance from a point, in its spacing, within which a ray meets the sheet. Trial: rays through a sheet of scattered
/// points miss it once in a hundred times. Larger distances meet the rims of walls that a ray passes.
const RAY_HIT_DISTANCE: f64 = 1.2;
/// Height above its start, in spacings, within which a ray has not left its own sheet. Trial: not recorded.
const OWN_SHEET_HEIGHT: f64 = 0.5;
/// Absolute cosine (45°) between a ray and the normal where it ends, above which the pair counts. Trial: not recorded.
/// Grazing rays determine no side.
const RAY_HIT_COSINE: f64 = 0.7;
/// Part of the hit distance by which a step stays short of the distance to the nearest point. Derived: less than one,
/// so that a step straight towards a point ends within the hit distance of it.
const RAY_STEP_MARGIN: f64 = 0.9;
/// Least length of a step through free space, in the hit distance. Guard: keeps the number of steps finite.
const MIN_RAY_STEP: f64 = 0.1;
/// Length of a step within the own sheet, in the hit distance. Guard: short against the hit distance, so that no sheet
/// is stepped over.
const LEAVING_STEP: f64 = 0.5;
/// Fewest pairs of opposite points from which sides are judged. Guard: a share found on 50 pairs has a standard error
/// of 6 % at 20 %.
const MIN_OPPOSITE_PAIRS: usize = 50;
/// Share of the pairs whose normals may look to the same side, above which regions are turned. Trial: not recorded.
/// Some pairs are contrary on consistent normals: rays miss thin parts.
const MAX_CONTRARY_PAIRS: f64 = 0.2;
/// Largest ratio of the variances across and along the plane of an even neighbourhood, in its median over the scan.
/// Trial: not recorded.
const EVENNESS_RATIO: f64 = 6.0;
/// Lower and upper bound of that limit. Trial: not recorded. The lower one admits noise-free scans, whose median is
/// near zero; the upper one keeps edges out of noisy ones.
const EVENNESS_BOUNDS: [f64; 2] = [0.005, 0.05];
/// Largest cost of a link between neighbours of one even region: 1 - cos 18°. Trial: not recorded. A larger cost joins
/// walls around a sharp edge.
const REGION_LINK_COST: f64 = 0.05;
/// Cost of a link (8°) up to which links of a region are joined first, in any order. Trial: not recorded. The first of
/// the steps of the orientation.
const FLAT_LINK_COST: f64 = 0.01;
/// Fewest points of a region that counts, as a share of all. Trial: not recorded.
const MIN_REGION_SHARE: f64 = 0.02;
/// Least margin of the votes between two regions, as a share of all (at least 80 % against 20 %). Trial: not recorded.
const MIN_VOTE_MARGIN: f64 = 0.6;
/// Fewest votes that decide between two regions. Guard: with a margin of 60 %, at least eight of ten agree.
const MIN_REGION_VOTES: f64 = 10.0;
/// Nearest points among which known sheets are looked for. Trial: not recorded.
const SHEET_SEARCH_NEIGHBOURS: usize = 48;
/// Most nearest points of one sheet through which its plane is laid. Trial: not recorded. More reach around edges.
const SHEET_PLANE_POINTS: usize = 10;
/// Fewest points through which the plane of a sheet is laid. Guard: a plane takes three, two more average its noise.
const MIN_SHEET_PLANE_POINTS: usize = 5;
/// Height above the plane of a sheet, in spacings, up to which a point takes the normal of the plane; above it the
/// point keeps its own direction. Trial: not recorded.
const ON_SHEET_HEIGHT: f64 = 0.15;
/// Height above the plane of a sheet, in spacings, up to which a point continues the sheet. Trial: not recorded. A
/// larger height leads from one wall to the other at a sharp edge.
const CONTINUATION_HEIGHT: f64 = 0.25;
/// Absolute cosine (84°) between the own normal of a point and that of its sheet, below which the own one has no side
/// and the sheet's is taken. Trial: not recorded.
const ACROSS_SHEET_COSINE: f64 = 0.1;
/// Most rounds in which sheets grow by the points beside them. Guard: what is not even lies less than five spacings
/// from what is, and each round gains a spacing or part of one.
const MAX_GROWTH_ROUNDS: usize = 30;

/// Turns normals that contradict the walls opposite to them, and assigns points between two walls that look to opposite
/// sides to the wall that they continue. Leaves the normals unchanged if that does not reduce the number of
/// contradictions. O(n).
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
    if pairs.len() < MIN_OPPOSITE_PAIRS {
        return;
    }
    let core = core(tree, elements, alive);
    if before as f64 <= MAX_CONTRARY_PAIRS * pairs.len() as f64 {
        let (mut sided, mut known) = (elements.of.clone(), core);
        let join = Join {
            within: f64::INFINITY,
            opposed: true,
        };
        grow(tree, &mut sided, &mut known, &[join], alive);
        if contrary(&sided) <= before {
            elements.of = sided;
        }
        return;
    }
    let Some((mut turned, mut known)) = turned_regions(tree, elements, &pairs, &core) else {
        return;
    };
    // First points that continue a sheet; then those that remain between sheets, as on a round edge.
    let joins = [CONTINUATION_HEIGHT, f64::INFINITY].map(|within| Join {
        within,
        opposed: false,
    });
    grow(tree, &mut turned, &mut known, &joins, alive);
    if 2 * contrary(&turned) < before {
        elements.of = turned;
        let whole = vec![0; elements.of.len()];
        turn_outward(tree.sorted_points(), &mut elements.of, &whole, 1, alive);
    }
}

/// The points whose neighbourhood, and that of all their neighbours, is even: at a sharp edge a single neighbourhood
/// may be even by chance and connect both walls. O(n).
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
    let [least, most] = EVENNESS_BOUNDS;
    let limit = (EVENNESS_RATIO * median_in_place(&mut thick.clone())).clamp(least, most);
    let even = |k: usize| alive(k) && thick[k] <= limit;
    each(of.len(), |k| {
        even(k) && elements.table.of(k).iter().all(|&j| even(j as usize))
    })
}

/// Pairs of points of one part, of which a ray along the normal of one meets the other.
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
    let step = living.len().div_ceil(RAY_SAMPLES).max(1);
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

/// The point that a ray from a point meets first, if the ray leaves its own sheet freely and meets another one at a
/// large angle.
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
    for _ in 0..MAX_RAY_STEPS {
        let place = points[k] + way * at;
        if left && !(place.cmpge(low).all() && place.cmple(high).all()) {
            return None;
        }
        tree.search(place, 1, &mut near, |j| alive(j as usize));
        let &(square, j) = near.items.first()?;
        let (distance, element) = (square.sqrt(), &of[j as usize]);
        let reach = RAY_HIT_DISTANCE * element.spacing;
        if !(reach > 0.0 && reach.is_finite()) {
            return None;
        }
        if distance > reach {
            left = true;
            at += (distance - RAY_STEP_MARGIN * reach).max(MIN_RAY_STEP * reach);
        } else if left {
            return (element.normal.dot(way).abs() > RAY_HIT_COSINE).then_some(j);
        } else {
            let height = (points[j as usize] - points[k]).dot(way);
            if height.abs() > OWN_SHEET_HEIGHT * of[k].spacing.max(element.spacing) {
                return None;
            }
            at += LEAVING_STEP * reach;
        }
    }
    None
}

/// The elements with the even regions (those of the `core`) turned by the votes of the rays, and the mask of the points
/// in these regions; `None` if the votes are not clear.
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
    let judge = |k: usize, j: usize| {
        Some(cost_and_turn(points, of, k, j)).filter(|link| link.0 <= REGION_LINK_COST)
    };
    let mut sets =
        SignedSets::spanning(of.len(), &[FLAT_LINK_COST, REGION_LINK_COST], links, judge);
    // 2. Votes between the regions: the normals of each pair should be opposed.
    let (number, count) = sets.numbered();
    let mut sizes = vec![0_usize; count];
    for k in (0..of.len()).filter(|&k| even(k)) {
        sizes[number[k] as usize] += 1;
    }
    let large = |k: usize| sizes[number[k] as usize] as f64 >= MIN_REGION_SHARE * of.len() as f64;
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
        if total >= MIN_REGION_VOTES && net.abs() >= MIN_VOTE_MARGIN * total {
            // Any pair with the majority represents both regions.
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
    // 3. The set with the most points.
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

/// Condition for a point to join a sheet.
#[derive(Clone, Copy, Debug)]
struct Join {
    /// Largest height above the plane of the sheet, in spacings.
    within: f64,
    /// Only points between two sheets that look to opposite sides join; all others keep their normal.
    opposed: bool,
}

/// Gives the points next to known ones the side of the sheet whose plane they continue, round after round, under one condition after
/// the other. O(n), and O(1) for each point beside known ones in each round.
fn grow(
    tree: &Neighbours,
    of: &mut [Element],
    known: &mut [bool],
    joins: &[Join],
    alive: &(dyn Fn(usize) -> bool + Sync),
) {
    if !known.contains(&true) {
        return;
    }
    // Most points are not beside known ones in most rounds.
    let beside = tree.table(SHEET_PLANE_POINTS);
    for &join in joins {
        for _ in 0..MAX_GROWTH_ROUNDS {
            if !grown(tree, &beside, of, known, join, alive) {
                break;
            }
        }
    }
}

/// One round of [`grow`], with the nearest other points of each, dead ones too; returns whether any point joined.
fn grown(
    tree: &Neighbours,
    beside: &NeighbourTable,
    of: &mut [Element],
    known: &mut [bool],
    Join { within, opposed }: Join,
    alive: &(dyn Fn(usize) -> bool + Sync),
) -> bool {
    let points = tree.sorted_points();
    let seen: &[Element] = of;
    let found =
        each(seen.len(), |k| {
            // At least one of the nearest points must be known.
            if known[k] || !alive(k) || !beside.of(k).iter().any(|&j| known[j as usize]) {
                return None;
            }
            let mut near = Nearest::default();
            tree.search(points[k], SHEET_SEARCH_NEIGHBOURS, &mut near, |j| {
                j as usize != k && alive(j as usize)
            });
            let first = near.indices().find(|&j| known[j as usize])?;
            let side = seen[first as usize].normal;
            let sheet = |same: bool| {
                let on = near.items.iter().map(|item| item.1 as usize);
                let on = on.filter(|&j| known[j] && (seen[j].normal.dot(side) >= 0.0) == same);
                let on = on.take(SHEET_PLANE_POINTS);
                let (count, middle, normal) = on.clone().fold(
                    (0_usize, DVec3::ZERO, DVec3::ZERO),
                    |(n, middle, normal), j| (n + 1, middle + points[j], normal + seen[j].normal),
                );
                if count < MIN_SHEET_PLANE_POINTS {
                    return None;
                }
                let (_, axes) = plane_axes(on.map(|j| points[j]));
                let plane = axes[0] * axes[0].dot(normal).signum();
                let height = (points[k] - middle / count as f64).dot(plane).abs();
                Some((height, plane))
            };
            let own = seen[k].normal;
            let (height, plane) =
                match (sheet(true), sheet(false)) {
                    (Some(a), Some(b)) if !opposed || a.1.dot(b.1) < OPPOSED_COSINE => {
                        if b.0 < a.0 { b } else { a }
                    }
                    _ if opposed => return Some(own),
                    (a, b) => a.or(b)?,
                };
            if height > within * seen[k].spacing {
                return None;
            }
            let along = own.dot(plane);
            Some(
                if height <= ON_SHEET_HEIGHT * seen[k].spacing || along.abs() < ACROSS_SHEET_COSINE
                {
                    plane
                } else {
                    own * along.signum()
                },
            )
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

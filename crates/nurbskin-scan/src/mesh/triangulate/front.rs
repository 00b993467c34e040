//! Advancing front: triangles are added at border sides, the best first.
//!
//! Candidates at a side are classed by the turn about the side; within a class the smallest circumradius (or empty
//! ball) comes first. The first pass admits triangles of the three-dimensional Delaunay triangulation; the second,
//! where noise leaves none, triangles that overlap no other as seen along the normals of their corners.
//!
//! Source: Cohen-Steiner and Da 2004 (DOI 10.1007/s00371-003-0217-z); the classes and the second pass are ours.

use super::MAX_CIRCUMRADIUS;
use super::ball::empty_ball;
use super::soup::{SHARP_FOLD_COSINE, Soup};
use super::star::circumradius;
use nurbskin_geometry::Result;
use nurbskin_geometry::progress::Progress;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Steps of the front between two tests for cancellation. Guard: some milliseconds of work.
const STEPS_PER_CHECK: usize = 1024;
/// Upper limits of the cosine between two triangles at a side (-1 in one plane) that divide candidates into classes; a
/// class with less turn comes first. Trial: not recorded. The last two are the fold limits of the soup.
const TURN_CLASSES: [f64; 6] = [-0.7, -0.35, 0.0, 0.4, 0.77, SHARP_FOLD_COSINE];
/// Most candidates tested per side by the second front. Guard: bounds the time; candidates come in order of quality.
const MAX_PROJECTED_TRIES: usize = 4;

/// A triangle beyond a border side: its class, its radius, and its corners, of which the first two are the side.
type Candidate = Reverse<(u8, u64, [u32; 3])>;

/// The triangles that a front may add.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rule {
    /// Those of the three-dimensional Delaunay triangulation.
    Delaunay,
    /// Those that overlap no other one as seen along the normals of their corners.
    Projected,
}

/// Adds triangles at border sides, the best first, until none fits.
pub(super) fn complete(soup: &mut Soup, rule: Rule, progress: &dyn Progress) -> Result<()> {
    let mut heap: BinaryHeap<Candidate> = BinaryHeap::new();
    for number in 0..soup.triangles().len() {
        push_sides(soup, soup.triangles()[number], rule, &mut heap);
    }
    let mut steps = 0_usize;
    while let Some(Reverse((_, _, triangle))) = heap.pop() {
        steps += 1;
        if steps.is_multiple_of(STEPS_PER_CHECK) {
            progress.check()?;
        }
        let [a, b, c] = triangle;
        if soup.beside(a, b).count() != 1 {
            continue;
        }
        if !soup.closed(c) && fits(soup, triangle, rule) {
            soup.insert(triangle);
            push_sides(soup, triangle, rule, &mut heap);
        } else if let Some(candidate) = best(soup, a, b, rule) {
            heap.push(candidate);
        }
    }
    Ok(())
}

fn fits(soup: &Soup, triangle: [u32; 3], rule: Rule) -> bool {
    match rule {
        Rule::Delaunay => soup.fits_plain(triangle),
        Rule::Projected => soup.fits(triangle),
    }
}

fn push_sides(soup: &Soup, [a, b, c]: [u32; 3], rule: Rule, heap: &mut BinaryHeap<Candidate>) {
    for (a, b) in [(a, b), (b, c), (c, a)] {
        if soup.beside(a, b).count() == 1 {
            heap.extend(best(soup, a, b, rule));
        }
    }
}

/// The best triangle beyond the border side a, b that fits: the smallest of the class with the least turn.
fn best(soup: &Soup, a: u32, b: u32, rule: Rule) -> Option<Candidate> {
    let sites = soup.sites;
    let far = soup.beside(a, b).next()?;
    let [p, q] = [a, b].map(|k| sites.points[k as usize]);
    let limit = |k: u32| {
        let spacing = [a, b, k].map(|k| sites.spacing[k as usize]);
        MAX_CIRCUMRADIUS * spacing.into_iter().fold(0.0, f64::max)
    };
    let mut near: Vec<u32> = [a, b]
        .iter()
        .flat_map(|&k| sites.table.of(k as usize).iter().copied())
        .chain(soup.border_neighbours(a))
        .chain(soup.border_neighbours(b))
        .filter(|&k| k != a && k != b && k != far)
        .collect();
    near.sort_unstable();
    near.dedup();
    // By class and radius; an empty ball is no smaller than the circumcircle.
    let mut candidates: Vec<(u8, f64, u32)> = near
        .into_iter()
        .filter_map(|k| {
            let c = sites.points[k as usize];
            let radius = circumradius(p, q, c);
            let turn = soup.unfolding(a, b, far, k);
            let class = (0_u8..)
                .zip(TURN_CLASSES)
                .find(|&(_, limit)| turn < limit)?
                .0;
            let order = match rule {
                Rule::Delaunay => radius,
                // The cosine of the angle at c over the side: its minimum is the Delaunay triangle in the plane.
                Rule::Projected => (p - c).normalize_or_zero().dot((q - c).normalize_or_zero()),
            };
            (radius <= limit(k)).then_some((class, order, k))
        })
        .collect();
    candidates.sort_unstable_by(|x, y| x.0.cmp(&y.0).then(x.1.total_cmp(&y.1)).then(x.2.cmp(&y.2)));
    let mut found: Option<(u8, f64, u32)> = None;
    let mut tries = 0;
    for (class, order, k) in candidates {
        if found.is_some_and(|(best, radius, _)| {
            class > best || rule == Rule::Projected || order > radius
        }) {
            break;
        }
        if soup.closed(k) {
            continue;
        }
        let triangle = [a, b, k];
        let radius = match rule {
            Rule::Delaunay => empty_ball(sites, triangle),
            Rule::Projected => Some(circumradius(p, q, sites.points[k as usize])),
        };
        let better = |r: &f64| *r <= limit(k) && found.is_none_or(|(_, radius, _)| *r < radius);
        if let Some(radius) = radius.filter(better)
            && fits(soup, triangle, rule)
        {
            found = Some((class, radius, k));
        } else if rule == Rule::Projected {
            tries += 1;
            if tries == MAX_PROJECTED_TRIES {
                break;
            }
        }
    }
    let (class, radius, k) = found?;
    let joined = soup.beside(a, k).next().is_some() || soup.beside(b, k).next().is_some();
    let touches = !joined && soup.used(k);
    Some(Reverse((
        2 * class + u8::from(touches),
        radius.to_bits(),
        [a, b, k],
    )))
}

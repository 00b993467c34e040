//! Completes triangles side by side from the borders of those that are certain.

use super::WIDEST;
use super::soup::Soup;
use super::star::circumradius;
use crate::Result;
use crate::progress::Progress;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Steps between two looks at whether to stop.
const STEPS: usize = 1024;
/// Candidates tried per side.
const TRIES: usize = 4;

/// A triangle beyond a border side: how bad it is, its corners, and the side it grows from.
type Candidate = Reverse<(u8, u64, [u32; 3])>;

/// Adds triangles at border sides, the best first, as long as there are any that fit.
pub(super) fn complete(soup: &mut Soup, progress: &dyn Progress) -> Result<()> {
    let mut heap: BinaryHeap<Candidate> = BinaryHeap::new();
    for number in 0..soup.triangles().len() {
        push_sides(soup, soup.triangles()[number], &mut heap);
    }
    let mut steps = 0_usize;
    while let Some(Reverse((_, _, triangle))) = heap.pop() {
        steps += 1;
        if steps % STEPS == 0 {
            progress.check()?;
        }
        let [a, b, _] = triangle;
        if soup.beside(a, b).count() != 1 {
            continue;
        }
        if soup.fits(triangle) {
            soup.insert(triangle);
            push_sides(soup, triangle, &mut heap);
        } else if let Some(candidate) = best(soup, a, b) {
            heap.push(candidate);
        }
    }
    Ok(())
}

fn push_sides(soup: &Soup, [a, b, c]: [u32; 3], heap: &mut BinaryHeap<Candidate>) {
    for (a, b) in [(a, b), (b, c), (c, a)] {
        if soup.beside(a, b).count() == 1 {
            heap.extend(best(soup, a, b));
        }
    }
}

/// The best triangle beyond the border side a, b that fits: in the half beyond the side, where the turn is less than a
/// right angle before others, the Delaunay one, which sees the side under the largest angle.
fn best(soup: &Soup, a: u32, b: u32) -> Option<Candidate> {
    let sites = soup.sites;
    let far = soup.beside(a, b).next()?;
    let [p, q] = [a, b].map(|k| sites.points[k as usize]);
    let spacing = |k: u32| sites.spacing[k as usize];
    let mut near: Vec<u32> = [a, b]
        .iter()
        .flat_map(|&k| sites.table.of(k as usize).iter().copied())
        .chain(soup.border_neighbours(a))
        .chain(soup.border_neighbours(b))
        .filter(|&k| k != a && k != b && k != far)
        .collect();
    near.sort_unstable();
    near.dedup();
    let mut candidates: Vec<(u8, f64, u32)> = near
        .into_iter()
        .filter_map(|k| {
            let c = sites.points[k as usize];
            let limit = WIDEST * spacing(a).max(spacing(b)).max(spacing(k));
            let (u, v) = (p - c, q - c);
            if u.length().max(v.length()) > 2.0 * limit {
                return None;
            }
            let turn = soup.unfolding(a, b, far, k);
            let class = match turn {
                ..0.0 => 0,
                ..0.77 => 1,
                _ => return None,
            };
            // Cosine of the angle under which c sees the side.
            let sight = u.normalize_or_zero().dot(v.normalize_or_zero());
            Some((class, sight, k))
        })
        .collect();
    candidates.sort_unstable_by(|x, y| x.0.cmp(&y.0).then(x.1.total_cmp(&y.1)).then(x.2.cmp(&y.2)));
    let mut tries = 0;
    for (class, _, k) in candidates {
        if soup.closed(k) {
            continue;
        }
        let c = sites.points[k as usize];
        let radius = circumradius(p, q, c);
        let limit = WIDEST * spacing(a).max(spacing(b)).max(spacing(k));
        if radius <= limit && soup.fits([a, b, k]) {
            return Some(Reverse((class, radius.to_bits(), [a, b, k])));
        }
        tries += 1;
        if tries == TRIES {
            break;
        }
    }
    None
}

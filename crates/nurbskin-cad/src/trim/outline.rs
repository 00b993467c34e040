//! Outlines of the part of a surface that has scan under it.
//!
//! Contours of the field `level - far` by marching squares, on the grid with a frame of outside nodes around it, are
//! closed lines. Where they run in the frame they lie on a side of the domain. Each line is split into runs: along a
//! side, where the edge is an iso-curve of the surface, and inside the domain. Runs too short to be an edge are merged.
//!
//! Source: marching squares (Lorensen and Cline 1987, in the plane); the runs are ours.

use super::support::Support;
use glam::DVec2;
use nurbskin_geometry::numeric::contours::{area, contours};

/// Fewest nodes of a run inside the domain between two runs on the same side; a shorter one is straightened out along
/// the side. Trial: not recorded. With less, rounding of the contour makes tiny edges.
const MIN_INNER_RUN: usize = 3;
/// Shortest run along an open side that becomes an edge, in nodes; with a shorter one the outline only touches the
/// side. Trial: runs of one node, where the surface is squeezed as in a corner of the domain, were edges shorter than
/// other systems keep, and failed the check.
const MIN_SIDE_RUN: f64 = 2.0;
/// Least depth of the frame outside the surface, in levels. Guard: keeps a contour between a node at zero and the
/// frame.
const MIN_FRAME_DEPTH: f64 = 1e-3;

/// A closed line in the domain, drawn to scale, with the surface to its left.
#[derive(Debug)]
pub(super) struct Outline {
    pub(super) runs: Vec<Run>,
}

/// A part of an outline.
#[derive(Clone, Debug)]
pub(super) enum Run {
    /// Straight along a side of the domain.
    Side([DVec2; 2]),
    /// Inside the domain; its ends lie on sides, unless the run is the whole outline.
    Inside(Vec<DVec2>),
}

impl Outline {
    /// Whether it is a single closed run.
    pub(super) fn closes(&self) -> bool {
        matches!(self.runs[..], [Run::Inside(_)])
    }
}

/// All outlines, the outer one first.
pub(super) fn trace(support: &Support) -> Vec<Outline> {
    let [m, n] = support.count;
    // 1. A frame of nodes around the grid, each as far outside as its neighbour is inside.
    let [wide, high] = [m + 2, n + 2];
    let inner = |k: usize, count: usize| k.clamp(1, count) - 1;
    let value = |k: usize| {
        let (i, j) = (k % wide, k / wide);
        let at = support.level - support.far[inner(j, n) * m + inner(i, m)];
        let framed = i == 0 || j == 0 || i + 1 == wide || j + 1 == high;
        if framed {
            -at.abs().max(MIN_FRAME_DEPTH * support.level)
        } else {
            at
        }
    };
    let values: Vec<f64> = (0..wide * high).map(value).collect();
    let mut lines = contours(&values, [wide, high], 0.0);
    lines.retain(|line| line.len() > 4);
    lines.sort_by(|a, b| area(b).abs().total_cmp(&area(a).abs()));
    // 2. Back to the domain: points in the frame move onto a side.
    let last = DVec2::new((m - 1) as f64, (n - 1) as f64);
    let mut outlines: Vec<Outline> = Vec::new();
    for (k, line) in lines.into_iter().enumerate() {
        // One outer line; inner ones run the other way round.
        if (area(&line) > 0.0) != (k == 0) {
            continue;
        }
        let mut placed: Vec<DVec2> = line
            .into_iter()
            .map(|p| (p - 1.0).clamp(DVec2::ZERO, last))
            .collect();
        placed.dedup();
        if placed.len() > 3 {
            outlines.push(Outline {
                runs: runs(&placed, last, support),
            });
        }
    }
    outlines
}

/// On which sides of the domain a point lies, as bits.
fn sides(p: DVec2, last: DVec2) -> u8 {
    u8::from(p.x <= 0.0)
        | u8::from(p.x >= last.x) << 1
        | u8::from(p.y <= 0.0) << 2
        | u8::from(p.y >= last.y) << 3
}

/// Splits a closed line where it joins and leaves the sides.
fn runs(line: &[DVec2], last: DVec2, support: &Support) -> Vec<Run> {
    let count = line.len();
    let at = |k: usize| line[k % count];
    // Segment k runs from point k to the next; here is the side on which it lies, or 0.
    let mut side: Vec<u8> = (0..count)
        .map(|k| {
            let both = sides(at(k), last) & sides(at(k + 1), last);
            both & both.wrapping_neg()
        })
        .collect();
    let scale = support.size() / last;
    // A run that only touches a side counts as inside.
    touch(&mut side, &at, |bit| {
        let side = bit.trailing_zeros() as usize;
        !support.closed[side / 2] && !support.poles[side]
    });
    let Some(first) = (0..count).find(|&k| side[k] != side[(k + count - 1) % count]) else {
        // The whole line is inside (or on one side, which cannot close).
        let mut points: Vec<DVec2> = line.iter().map(|&p| p * scale).collect();
        points.extend(points.first().copied());
        return vec![Run::Inside(points)];
    };
    side.rotate_left(first);
    let at = |k: usize| line[(first + k) % count];
    // Runs of equal sides: start and end points.
    let mut found: Vec<(u8, usize, usize)> = Vec::new();
    for (k, &side) in side.iter().enumerate() {
        match found.last_mut() {
            Some(run) if run.0 == side => run.2 = k + 1,
            _ => found.push((side, k, k + 1)),
        }
    }
    // A short run off a side and back to it belongs to the side.
    let mut k = 0;
    while found.len() > 2 && k < found.len() {
        let [before, this, behind] = [
            (k + found.len() - 1) % found.len(),
            k,
            (k + 1) % found.len(),
        ];
        let short = found[this].0 == 0 && found[this].2 - found[this].1 < MIN_INNER_RUN;
        if short && found[before].0 == found[behind].0 && before < this && this < behind {
            found[before].2 = found[behind].2;
            found.drain(this..=behind);
        } else {
            k += 1;
        }
    }
    let runs = found.into_iter().map(|(side, from, to)| {
        if side == 0 {
            Run::Inside((from..=to).map(|k| at(k) * scale).collect())
        } else {
            Run::Side([at(from) * scale, at(to) * scale])
        }
    });
    runs.collect()
}

/// Turns runs along open sides (by `is_open` of their bit) that are too short for an edge into inside runs.
fn touch(side: &mut [u8], at: &impl Fn(usize) -> DVec2, is_open: impl Fn(u8) -> bool) {
    let count = side.len();
    let Some(first) = (0..count).find(|&k| side[k] != side[(k + count - 1) % count]) else {
        return;
    };
    let mut k = 0;
    while k < count {
        let this = side[(first + k) % count];
        let run = (k..count)
            .take_while(|&l| side[(first + l) % count] == this)
            .count();
        let ends = [first + k, first + k + run].map(at);
        let beside = [k + count - 1, k + run].map(|l| side[(first + l) % count]);
        let short = ends[0].distance(ends[1]) < MIN_SIDE_RUN;
        if this != 0 && is_open(this) && short && beside.contains(&0) {
            (k..k + run).for_each(|l| side[(first + l) % count] = 0);
        }
        k += run;
    }
}

#[cfg(test)]
mod tests {
    use super::{sides, touch};
    use glam::DVec2;

    #[test]
    fn what_only_touches_a_side_runs_inside() {
        let last = DVec2::splat(10.0);
        // Along the lower side, and at two places that are nearly one on the left side.
        let line = [
            [2.0, 0.0],
            [8.0, 0.0],
            [6.0, 5.0],
            [0.0, 5.0],
            [0.0, 4.999],
            [1.0, 2.0],
        ];
        let at = |k: usize| DVec2::from(line[k % line.len()]);
        let of = |k: usize| sides(at(k), last) & sides(at(k + 1), last);
        let mut side: Vec<u8> = (0..line.len()).map(of).collect();
        assert_eq!(side, [4, 0, 0, 1, 0, 0]);
        let mut closed = side.clone();
        touch(&mut closed, &at, |bit| bit == 4);
        assert_eq!(closed, side);
        touch(&mut side, &at, |_| true);
        assert_eq!(side, [4, 0, 0, 0, 0, 0]);
    }
}

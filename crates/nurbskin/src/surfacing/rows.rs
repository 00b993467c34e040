//! Rows of an ordered scan without masked points: short gaps are filled, jumps and spikes found.
//!
//! ```text
//! filled:  cubic through two neighbours on each side (Lagrange), for gaps of at most 3 points
//! jump:    |x_k - (4 (x_{k-1} + x_{k+1}) - x_{k-2} - x_{k+2}) / 6| > 1.5 median gaps
//! spike:   both steps > 2 median gaps, though the neighbours are near each other
//! ```
//!
//! Source: Lagrange interpolation; the tests are ours.

use glam::DVec3;
use nurbskin_scan::{Organisation, Scan};
use std::ops::Range;

/// Most masked points in a row that are filled in. Count.
/// Guard: more of them are a hole, which a cubic would invent.
const MAX_FILLED_GAP: usize = 3;
/// Distance, in median gaps of the row, of a point from the place that its row predicts, above which the scan is
/// searched for outliers.
/// Trial: not recorded. A needless search costs time only.
const JUMP_GAPS: f64 = 1.5;
/// Distance, in median gaps, above which a step leads away from its row.
/// Trial: on rows with outliers; with 4 some remained that tore rows apart.
const SPIKE_GAPS: f64 = 2.0;
/// Most that the neighbours of a spike may lie apart, in units of the step that counts as leading away. Dimensionless.
/// Trial: not recorded. It makes three median gaps, where two are regular.
const SPIKE_BRIDGE: f64 = 1.5;

/// The indices of the points in each row of an ordered scan; none for other scans.
pub(super) fn rows(scan: &Scan) -> Vec<Vec<usize>> {
    match &scan.organisation {
        Organisation::Grid(layout) => layout
            .cells
            .chunks(layout.count_u.max(1))
            .map(|row| row.iter().flatten().map(|&k| k as usize).collect())
            .collect(),
        Organisation::Rows(lengths) => lengths
            .iter()
            .scan(0, |first, &length| {
                *first += length;
                Some((*first - length..*first).collect())
            })
            .collect(),
        Organisation::Unordered | Organisation::Mesh(_) => Vec::new(),
    }
}

/// The scan with the masked points replaced by the cubics through their neighbours in the row, so that an array stays
/// one; `None` if there is nothing to replace. Points at the ends of rows and in gaps of more than three become not
/// finite, since they have no such neighbours.
pub(super) fn filled(scan: &Scan, masked: &[bool]) -> Option<Scan> {
    if !masked.contains(&true) {
        return None;
    }
    let mut filled = Scan {
        points: scan.points.clone(),
        organisation: scan.organisation.clone(),
        ..Scan::default()
    };
    for row in rows(scan) {
        for gap in gaps(&row, masked) {
            let inside = gap.start > 0 && gap.end < row.len() && gap.len() <= MAX_FILLED_GAP;
            let before = (0..gap.start).rev().filter(|&p| !masked[row[p]]).take(2);
            let after = (gap.end..row.len()).filter(|&p| !masked[row[p]]).take(2);
            let known: Vec<usize> = before.chain(after).collect();
            for place in gap {
                filled.points[row[place]] = if inside {
                    let at = |p: usize| (p as f64, scan.points[row[p]]);
                    lagrange(
                        &known.iter().map(|&p| at(p)).collect::<Vec<_>>(),
                        place as f64,
                    )
                } else {
                    DVec3::NAN
                };
            }
        }
    }
    Some(filled)
}

/// The runs of masked places of a row.
fn gaps(row: &[usize], masked: &[bool]) -> Vec<Range<usize>> {
    let mut gaps: Vec<Range<usize>> = Vec::new();
    for (place, _) in row.iter().enumerate().filter(|(_, k)| masked[**k]) {
        match gaps.last_mut() {
            Some(gap) if gap.end == place => gap.end += 1,
            _ => gaps.push(place..place + 1),
        }
    }
    gaps
}

/// The polynomial through the values at distinct places, at `x`.
fn lagrange(known: &[(f64, DVec3)], x: f64) -> DVec3 {
    let weight = |a: usize| -> f64 {
        let others = known.iter().enumerate().filter(|(b, _)| *b != a);
        others
            .map(|(_, (place, _))| (x - place) / (known[a].0 - place))
            .product()
    };
    (0..known.len()).map(|a| known[a].1 * weight(a)).sum()
}

/// Whether a point of an ordered scan deviates from the prediction of its row. O(n).
pub(super) fn has_jumps(scan: &Scan) -> bool {
    rows(scan).iter().any(|row| {
        let row: Vec<DVec3> = row
            .iter()
            .map(|&k| scan.points[k])
            .filter(|p| p.is_finite())
            .collect();
        let mut steps: Vec<f64> = row.windows(2).map(|w| w[0].distance(w[1])).collect();
        let limit = JUMP_GAPS * nurbskin_geometry::numeric::statistics::median_in_place(&mut steps);
        let straight = |a: DVec3, b: DVec3, c: DVec3| (a - 2.0 * b + c).length() > 2.0 * limit;
        limit > 0.0
            && (row.windows(5).any(|w| {
                let led = (4.0 * (w[1] + w[3]) - w[0] - w[4]) / 6.0;
                w[2].distance(led) > limit
            }) || row.windows(3).any(|w| straight(w[0], w[1], w[2])))
    })
}

/// Points of an ordered scan, other than the masked ones, that are far from both neighbours in the row although these
/// are near each other; at the ends of rows, far from the only neighbour.
pub(super) fn spikes(scan: &Scan, masked: &[bool]) -> Vec<usize> {
    let mut found = Vec::new();
    for row in rows(scan) {
        let row: Vec<usize> = row.into_iter().filter(|&k| !masked[k]).collect();
        let step = |a: usize, b: usize| scan.points[row[a]].distance(scan.points[row[b]]);
        let mut steps: Vec<f64> = (1..row.len()).map(|p| step(p - 1, p)).collect();
        let limit =
            SPIKE_GAPS * nurbskin_geometry::numeric::statistics::median_in_place(&mut steps);
        let last = row.len().saturating_sub(1);
        if row.len() < 4 || limit <= 0.0 {
            continue;
        }
        let spike = |p: usize| match p {
            0 => step(0, 1) > limit && step(1, 2) <= limit,
            _ if p == last => step(p - 1, p) > limit && step(p - 2, p - 1) <= limit,
            _ => {
                step(p - 1, p) > limit
                    && step(p, p + 1) > limit
                    && step(p - 1, p + 1) <= SPIKE_BRIDGE * limit
            }
        };
        found.extend((0..row.len()).filter(|&p| spike(p)).map(|p| row[p]));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_scan::GridLayout;

    fn parabola() -> Scan {
        let point = |k: i32| {
            DVec3::new(
                f64::from(k % 8),
                f64::from(k / 8),
                f64::from((k % 8).pow(3)),
            )
        };
        Scan {
            points: (0..24).map(point).collect(),
            organisation: Organisation::Grid(GridLayout::complete(8, 3).unwrap()),
            ..Scan::default()
        }
    }

    #[test]
    fn gaps_are_filled_by_cubics_and_ends_are_not() {
        let scan = parabola();
        let mut masked = vec![false; 24];
        assert!(filled(&scan, &masked).is_none());
        // Inside, two in a row, an end, and too many.
        for k in [3, 11, 12, 7, 17, 18, 19, 20] {
            masked[k] = true;
        }
        let filled = filled(&scan, &masked).unwrap();
        for k in 0..24 {
            match k {
                7 | 17..=20 => assert!(filled.points[k].is_nan()),
                _ => assert!(filled.points[k].distance(scan.points[k]) < 1e-9, "{k}"),
            }
        }
    }

    #[test]
    fn jumps_are_seen() {
        let mut scan = parabola();
        for (k, point) in scan.points.iter_mut().enumerate() {
            point.z = 0.1 * ((k % 8) as f64).powi(2);
        }
        assert!(!has_jumps(&scan));
        for k in [0, 4, 7] {
            let mut scan = scan.clone();
            scan.points[k].z += 9.0;
            assert!(has_jumps(&scan), "{k}");
            assert_eq!(spikes(&scan, &[false; 24]), [k]);
        }
    }
}

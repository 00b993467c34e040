//! Where an open profile ends: on the axis, or where its points end.

use super::profile::ProfileEnd;
use super::trace::{Meridian, Trace};
use glam::{DMat3, DVec2, DVec3};
use nurbskin_geometry::numeric::statistics::{median_in_place, robust_sigma};

/// Points nearer to the axis than this many spacings make the end of a profile a pole.
const POLE: f64 = 1.6;
/// Slope against the perpendicular of the axis below which a pole has a normal.
const POLE_SLOPE: f64 = 0.35;
/// The first so many points after the outermost one must lie dense: outliers lie thin.
const DENSE_POINTS: [usize; 2] = [2, 6];
/// Part of the usual number of points per length of the profile that is dense.
const DENSE: f64 = 0.2;
/// Segments over which the direction of an end on the axis is seen, and which may lead past the axis, a quarter of all at
/// most: noise turns single ones.
const LAST: usize = 3;
/// The part of the direction at such an end that leads to the axis is at least so large.
const INWARD: f64 = 0.2;
/// Steps that an end moves at most.
const GROWTH: f64 = 4.0;
/// Rounds of a parabola through points, each without those so many standard deviations off the one before.
const ROUNDS: usize = 3;
const FAR: f64 = 3.0;
/// The determinant of its normal equations, of radii in parts of the largest and per point, is at least a tenth of that
/// of an even disk or of three rings: two rings determine no parabola.
const DETERMINED: f64 = 2e-5;
/// Steps by which it may end elsewhere than the line of the trace.
const ASIDE: f64 = 2.0;
/// Fewest places that are left of a trace.
const PLACES: usize = 4;

/// Makes the trace end at each open end where its points end, or on the axis where points come close to it; the
/// ends, and the length put in front (negative where some was taken off). `s` as of [`Trace::locate`]. O(n log n).
pub(super) fn finish(
    trace: &mut Trace,
    flat: &Meridian,
    s: &[f64],
    spacing: f64,
) -> ([ProfileEnd; 2], f64) {
    if trace.closed {
        return ([ProfileEnd::Rim; 2], 0.0);
    }
    // 1. The outermost points that others support; a walk may have gone on along a few outliers.
    let usual = usual_density(trace, flat, s);
    let rims = [0, 1].map(|side| {
        let points = along(trace, flat, s, side);
        rim(&points, usual)
    });
    let length = trace.length();
    let low = rims[0].map_or(0.0, |rim| -rim);
    let high = rims[1].map_or(length, |rim| length + rim);
    let mut taken = keep(trace, low, high);
    let beyond = [taken - low, high - taken - trace.length()];
    let step = trace.step;
    // 2. Each end. It moves: segments next to it were continued beyond it already.
    let mut ends = [ProfileEnd::Rim; 2];
    let mut grown = [0.0; 2];
    for side in [0, 1] {
        let s: Vec<f64> = s.iter().map(|s| s - taken).collect();
        if let Some(found) = on_axis(trace, flat, &s, side, spacing) {
            let (last, length) = (trace.lengths[found.place], trace.length());
            let lost = match side {
                0 => keep(trace, last, length),
                _ => keep(trace, 0.0, last),
            };
            taken += lost;
            ends[side] = found.end;
            let at = at_end(trace, side, 0);
            grown[side] = trace.places[at].distance(found.foot);
            trace.places[at] = found.foot;
        } else {
            grown[side] = beyond[side].clamp(-0.5 * step, GROWTH * step);
            let at = at_end(trace, side, 0);
            let out = outwards(trace, side, 0, 1);
            trace.places[at] += grown[side] * out;
        }
    }
    let last = trace.lengths.len() - 1;
    for length in &mut trace.lengths[1..last] {
        *length += grown[0];
    }
    trace.lengths[last] += grown[0] + grown[1];
    (ends, grown[0] - taken)
}

/// The place so many before the last one at an end.
fn at_end(trace: &Trace, side: usize, before: usize) -> usize {
    match side {
        0 => before,
        _ => trace.places.len() - 1 - before,
    }
}

/// The direction outwards at an end, from the `inner`-th place before the last to the `outer`-th.
fn outwards(trace: &Trace, side: usize, outer: usize, inner: usize) -> DVec2 {
    let [outer, inner] = [outer, inner].map(|before| trace.places[at_end(trace, side, before)]);
    (outer - inner).normalize_or(DVec2::Y)
}

/// How a profile ends on the axis.
struct OnAxis {
    /// Index of the last place before the axis.
    place: usize,
    foot: DVec2,
    end: ProfileEnd,
}

/// Where and how the profile meets the axis at an end, if it does.
fn on_axis(trace: &Trace, flat: &Meridian, s: &[f64], side: usize, spacing: f64) -> Option<OnAxis> {
    let (count, step) = (trace.places.len(), trace.step);
    let back = LAST.min(count / 4).max(1);
    // 1. Noise may have led the walk on past the axis.
    let radius = |before: &usize| trace.places[at_end(trace, side, *before)].x;
    let last = (0..=back.min(count.saturating_sub(PLACES)))
        .min_by(|a, b| radius(a).total_cmp(&radius(b)))?;
    let place = at_end(trace, side, last);
    let at = trace.places[place];
    let out = outwards(trace, side, last, last + back);
    let to_axis = (at.x / -out.x).max(0.0);
    if -out.x <= INWARD || to_axis >= GROWTH * step {
        return None;
    }
    // 2. Points are near the axis; one alone may be an outlier.
    let before = match side {
        0 => trace.lengths[place],
        _ => trace.length() - trace.lengths[place],
    };
    let points = along(trace, flat, s, side);
    let near = |steps: f64| {
        let within = move |far: f64| far > -before - steps * step;
        points.iter().filter(move |p| within(p.0)).map(|p| p.1)
    };
    let mut radii: Vec<f64> = near(2.0).map(|q| q.x).collect();
    radii.sort_by(f64::total_cmp);
    if radii.get(1).is_none_or(|&radius| radius >= POLE * spacing) {
        return None;
    }
    // 3. What they say of the profile there; where they do not tell, its last segment.
    let height = (at + to_axis * out).y;
    let around: Vec<DVec2> = near(back as f64 + 1.0).collect();
    let told = meets_axis(&around).filter(|told| (told.0 - height).abs() < ASIDE * step);
    let (height, slope) = told.unwrap_or_else(|| {
        let out = outwards(trace, side, last, last + 1);
        (height, out.y / out.x)
    });
    let end = if slope.abs() < POLE_SLOPE {
        ProfileEnd::Pole
    } else {
        ProfileEnd::Tip
    };
    let foot = DVec2::new(0.0, height);
    Some(OnAxis { place, foot, end })
}

/// The height and the slope at which a profile through some points meets the axis, by a parabola; `None` if they do not
/// determine one.
fn meets_axis(points: &[DVec2]) -> Option<(f64, f64)> {
    let mut kept: Vec<DVec2> = points.to_vec();
    let mut found = None;
    for _ in 0..ROUNDS {
        let widest = kept.iter().map(|q| q.x).fold(0.0, f64::max);
        let part = 1.0 / kept.len() as f64;
        let row = |q: &DVec2| DVec3::new(1.0, q.x / widest, (q.x / widest).powi(2));
        let (mut normal, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for q in &kept {
            let row = row(q);
            normal += part * DMat3::from_cols(row.x * row, row.y * row, row.z * row);
            right += part * q.y * row;
        }
        // Not a number where there are no points, or all on the axis.
        let determined = normal.determinant() > DETERMINED;
        if !determined {
            break;
        }
        let curve = normal.inverse() * right;
        found = Some((curve.x, curve.y / widest));
        let off = |q: &DVec2| q.y - curve.dot(row(q));
        let offs: Vec<f64> = kept.iter().map(off).collect();
        let most = FAR * robust_sigma(&offs, 0.0);
        let count = kept.len();
        kept.retain(|q| off(q).abs() <= most);
        if kept.len() == count || 2 * kept.len() < points.len() {
            break;
        }
    }
    found
}

/// How far each point lies beyond the last place at one end, and where it is, from the outermost on; beyond it only
/// those that lie near the line there.
fn along(trace: &Trace, flat: &Meridian, s: &[f64], side: usize) -> Vec<(f64, DVec2)> {
    let at = trace.places[at_end(trace, side, 0)];
    let out = outwards(trace, side, 0, 1);
    let length = trace.length();
    let mut points: Vec<(f64, DVec2)> = s
        .iter()
        .zip(&flat.points)
        .filter(|(s, _)| s.is_finite())
        .map(|(s, &q)| (if side == 0 { -s } else { s - length }, q))
        .filter(|&(far, q)| far < 0.0 || (q - at).perp_dot(out).abs() < 0.5 * trace.step)
        .collect();
    points.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.x.total_cmp(&b.1.x)));
    points
}

/// Points per length of the profile and per radius, in the median over its steps.
fn usual_density(trace: &Trace, flat: &Meridian, s: &[f64]) -> f64 {
    let length = trace.length();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "at least one; a step per place"
    )]
    let count = (length / trace.step).clamp(1.0, 1e4) as usize;
    let mut bins = vec![0.0; count];
    for (s, q) in s.iter().zip(&flat.points) {
        if *s >= 0.0 && *s < length && q.x > 0.0 {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a fraction of the bins"
            )]
            let k = (s / length * count as f64) as usize;
            bins[k.min(count - 1)] += 1.0 / q.x;
        }
    }
    median_in_place(&mut bins) * count as f64 / length
}

/// How far beyond the last place the outermost point lies that has enough others next to it, inwards.
fn rim(points: &[(f64, DVec2)], usual: f64) -> Option<f64> {
    let dense = |w: &&[(f64, DVec2)]| {
        DENSE_POINTS
            .iter()
            .all(|&n| n as f64 >= DENSE * usual * w[n].1.x * (w[0].0 - w[n].0))
    };
    let wide = DENSE_POINTS.iter().copied().max().unwrap_or(0) + 1;
    points.windows(wide).find(dense).map(|w| w[0].0)
}

/// Takes the places off that lie outside of the range; the length taken off in front.
fn keep(trace: &mut Trace, low: f64, high: f64) -> f64 {
    let inside = |l: &f64| *l >= low && *l <= high;
    let first = trace.lengths.iter().position(inside).unwrap_or(0);
    let count = trace.lengths.iter().filter(|l| inside(l)).count();
    if count < PLACES {
        return 0.0;
    }
    let range = first..first + count;
    trace.places = trace.places[range.clone()].to_vec();
    trace.normals = trace.normals[range.clone()].to_vec();
    let taken = trace.lengths[first];
    trace.lengths = trace.lengths[range].iter().map(|l| l - taken).collect();
    taken
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on rings about the axis of a sphere of radius 30, so many degrees from the pole.
    fn rings(degrees: &[f64]) -> Vec<DVec2> {
        let ring = |d: &f64| {
            let (out, up) = d.to_radians().sin_cos();
            (0..50).map(move |k| (30.0 + 0.01 * f64::from(k % 7 - 3)) * DVec2::new(out, up))
        };
        degrees.iter().flat_map(ring).collect()
    }

    #[test]
    fn parabolas_meet_the_axis_where_three_rings_do() {
        let (height, slope) = meets_axis(&rings(&[2.0, 4.0, 6.0, 8.0])).unwrap();
        assert!(
            (height - 30.0).abs() < 0.02 && slope.abs() < 0.05,
            "{height} {slope}"
        );
        // A cone that leans by one in two.
        let cone: Vec<DVec2> = (1..40)
            .map(|k| f64::from(k) * DVec2::new(0.2, -0.1))
            .collect();
        let (height, slope) = meets_axis(&cone).unwrap();
        assert!(height.abs() < 1e-9 && (slope + 0.5).abs() < 1e-9);
        for few in [&[][..], &[3.0], &[2.0, 4.0]] {
            assert!(meets_axis(&rings(few)).is_none(), "{few:?}");
        }
    }
}

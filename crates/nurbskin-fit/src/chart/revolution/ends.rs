//! The ends of an open profile: on the axis, or where its points end.
//!
//! 1. The trace is cut at the outermost point that has enough others behind it: n points must span at least 0.2 of the
//!    usual number per length, since outliers beyond a rim lie thin.
//! 2. An end that leads to the axis and has points close to it ends there, at the height and slope of a parabola
//!    `h = a + b r + c r²` through the points around. A slope below 0.35 makes a pole, a steeper one a tip. Other ends move to
//!    the outermost point.
//!
//! Source: ours.

use super::profile::ProfileEnd;
use super::trace::{Meridian, Trace};
use glam::{DMat3, DVec2, DVec3};
use nurbskin_geometry::numeric::statistics::{median_in_place, robust_sigma};

/// Distance from the axis, in spacings, below which the second nearest point makes the end of a profile a pole. Trial:
/// not recorded. A smaller one misses poles between points, a larger one closes small holes.
const POLE_DISTANCE: f64 = 1.6;
/// Slope against the perpendicular of the axis (19 degrees) below which an end on the axis is a pole with a normal, and
/// not a tip. Trial: not recorded.
const MAX_POLE_SLOPE: f64 = 0.35;
/// Ranks of the points behind the outermost one that must lie dense. Trial: not recorded; outliers beyond a rim lie
/// thin.
const RIM_SUPPORT: [usize; 2] = [2, 6];
/// Least density of points at a rim, as a share of the usual one per length of the profile. Trial: not recorded. A
/// larger share cuts thin rims off, a smaller one keeps outliers.
const MIN_RIM_DENSITY: f64 = 0.2;
/// Segments over which the direction of an end on the axis is measured, and which may lead past the axis; a quarter of
/// all at most. Trial: noise on scans with dense lines turns single segments; the data are not recorded.
const END_SEGMENTS: usize = 3;
/// Least cosine between the direction of an end and the perpendicular towards the axis. Trial: not recorded. A smaller
/// one extends walls that run along the axis.
const MIN_INWARD: f64 = 0.2;
/// Largest shift of an end outwards, in steps. Guard: an extrapolation over more steps is no longer supported by
/// points.
const MAX_END_SHIFT: f64 = 4.0;
/// Rounds of the parabola at an end, each without the outliers of the one before. Guard: the loop ends earlier where
/// nothing is left out.
const PARABOLA_ROUNDS: usize = 3;
/// Residual of the parabola, in robust standard deviations, beyond which a point is left out. Trial: not recorded.
const PARABOLA_OUTLIER_SIGMAS: f64 = 3.0;
/// Least determinant of the normal equations of the parabola, with radii in parts of the largest and per point.
/// Derived: a tenth of that of an even disk or of three rings; two rings determine no parabola.
const MIN_PARABOLA_DETERMINANT: f64 = 2e-5;
/// Largest distance along the axis between the ends by the parabola and by the trace, in steps. Trial: not recorded.
const MAX_FOOT_SHIFT: f64 = 2.0;
/// Fewest places that are left of a trace. Guard: a cubic needs four.
const MIN_TRACE_PLACES: usize = 4;
/// Largest shift of a rim inwards, in steps. Trial: not recorded; the last place stands for half a step to either side.
const MAX_END_RETREAT: f64 = 0.5;
/// Length of the profile before the axis whose points tell a pole, in steps. Trial: not recorded.
const POLE_WINDOW: f64 = 2.0;
/// Largest distance of points beyond an end from the straight line there, in steps. Trial: not recorded; farther ones
/// are stray.
const END_LINE_WIDTH: f64 = 0.5;
/// Most bins of the density along the profile. Guard: there is a bin per step, and walks are shorter.
const MAX_DENSITY_BINS: f64 = 1e4;

/// Ends the trace at each open end at its outermost points, or on the axis if points come close to it. Returns the
/// ends, and the length that was added in front (negative if some was removed). `s` as of [`Trace::locate`]. O(n log
/// n).
pub(super) fn finish(
    trace: &mut Trace,
    flat: &Meridian,
    s: &[f64],
    spacing: f64,
) -> ([ProfileEnd; 2], f64) {
    if trace.closed {
        return ([ProfileEnd::Rim; 2], 0.0);
    }
    // 1. The outermost supported points; the walk may have followed a few outliers.
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
    // 2. Each end. The end place moves, so that segments next to it need no extension.
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
            grown[side] = beyond[side].clamp(-MAX_END_RETREAT * step, MAX_END_SHIFT * step);
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

/// The index of the place that is `before` places from the end.
fn at_end(trace: &Trace, side: usize, before: usize) -> usize {
    match side {
        0 => before,
        _ => trace.places.len() - 1 - before,
    }
}

/// The outward direction at an end, from the `inner`-th place before the last to the `outer`-th.
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

/// Place and kind of the end on the axis, if the profile meets it there.
fn on_axis(trace: &Trace, flat: &Meridian, s: &[f64], side: usize, spacing: f64) -> Option<OnAxis> {
    let (count, step) = (trace.places.len(), trace.step);
    let back = END_SEGMENTS.min(count / 4).max(1);
    // 1. Noise may have led the walk past the axis.
    let radius = |before: &usize| trace.places[at_end(trace, side, *before)].x;
    let last = (0..=back.min(count.saturating_sub(MIN_TRACE_PLACES)))
        .min_by(|a, b| radius(a).total_cmp(&radius(b)))?;
    let place = at_end(trace, side, last);
    let at = trace.places[place];
    let out = outwards(trace, side, last, last + back);
    let to_axis = (at.x / -out.x).max(0.0);
    if -out.x <= MIN_INWARD || to_axis >= MAX_END_SHIFT * step {
        return None;
    }
    // 2. Points are near the axis; a single one may be an outlier.
    let before = match side {
        0 => trace.lengths[place],
        _ => trace.length() - trace.lengths[place],
    };
    let points = along(trace, flat, s, side);
    let near = |steps: f64| {
        let within = move |far: f64| far > -before - steps * step;
        points.iter().filter(move |p| within(p.0)).map(|p| p.1)
    };
    let mut radii: Vec<f64> = near(POLE_WINDOW).map(|q| q.x).collect();
    radii.sort_by(f64::total_cmp);
    if radii
        .get(1)
        .is_none_or(|&radius| radius >= POLE_DISTANCE * spacing)
    {
        return None;
    }
    // 3. Height and slope from a parabola through the points; if it is undetermined, from the last segment.
    let height = (at + to_axis * out).y;
    let around: Vec<DVec2> = near(back as f64 + 1.0).collect();
    let told = meets_axis(&around).filter(|told| (told.0 - height).abs() < MAX_FOOT_SHIFT * step);
    let (height, slope) = told.unwrap_or_else(|| {
        let out = outwards(trace, side, last, last + 1);
        (height, out.y / out.x)
    });
    let end = if slope.abs() < MAX_POLE_SLOPE {
        ProfileEnd::Pole
    } else {
        ProfileEnd::Tip
    };
    let foot = DVec2::new(0.0, height);
    Some(OnAxis { place, foot, end })
}

/// Height and slope at which a profile through the points meets the axis, by a parabola; `None` if the points do not
/// determine one.
fn meets_axis(points: &[DVec2]) -> Option<(f64, f64)> {
    let mut kept: Vec<DVec2> = points.to_vec();
    let mut found = None;
    for _ in 0..PARABOLA_ROUNDS {
        let widest = kept.iter().map(|q| q.x).fold(0.0, f64::max);
        let part = 1.0 / kept.len() as f64;
        let row = |q: &DVec2| DVec3::new(1.0, q.x / widest, (q.x / widest).powi(2));
        let (mut normal, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for q in &kept {
            let row = row(q);
            normal += part * DMat3::from_cols(row.x * row, row.y * row, row.z * row);
            right += part * q.y * row;
        }
        // The determinant is NaN if there are no points, or all lie on the axis.
        let determined = normal.determinant() > MIN_PARABOLA_DETERMINANT;
        if !determined {
            break;
        }
        let curve = normal.inverse() * right;
        found = Some((curve.x, curve.y / widest));
        let off = |q: &DVec2| q.y - curve.dot(row(q));
        let offs: Vec<f64> = kept.iter().map(off).collect();
        let most = PARABOLA_OUTLIER_SIGMAS * robust_sigma(&offs, 0.0);
        let count = kept.len();
        kept.retain(|q| off(q).abs() <= most);
        if kept.len() == count || 2 * kept.len() < points.len() {
            break;
        }
    }
    found
}

/// For each point its length beyond the last place at an end, and the point, from the outermost on. Beyond the last
/// place, only points near the straight continuation count.
fn along(trace: &Trace, flat: &Meridian, s: &[f64], side: usize) -> Vec<(f64, DVec2)> {
    let at = trace.places[at_end(trace, side, 0)];
    let out = outwards(trace, side, 0, 1);
    let length = trace.length();
    let mut points: Vec<(f64, DVec2)> = s
        .iter()
        .zip(&flat.points)
        .filter(|(s, _)| s.is_finite())
        .map(|(s, &q)| (if side == 0 { -s } else { s - length }, q))
        .filter(|&(far, q)| far < 0.0 || (q - at).perp_dot(out).abs() < END_LINE_WIDTH * trace.step)
        .collect();
    points.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.x.total_cmp(&b.1.x)));
    points
}

/// Points per length of the profile and per radius: the median over its steps.
fn usual_density(trace: &Trace, flat: &Meridian, s: &[f64]) -> f64 {
    let length = trace.length();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "at least one; a step per place"
    )]
    let count = (length / trace.step).clamp(1.0, MAX_DENSITY_BINS) as usize;
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

/// Length beyond the last place of the outermost point that has enough others next to it, inwards.
fn rim(points: &[(f64, DVec2)], usual: f64) -> Option<f64> {
    let dense = |w: &&[(f64, DVec2)]| {
        RIM_SUPPORT
            .iter()
            .all(|&n| n as f64 >= MIN_RIM_DENSITY * usual * w[n].1.x * (w[0].0 - w[n].0))
    };
    let wide = RIM_SUPPORT.iter().copied().max().unwrap_or(0) + 1;
    points.windows(wide).find(dense).map(|w| w[0].0)
}

/// Removes the places outside of the range; returns the length that was removed in front.
fn keep(trace: &mut Trace, low: f64, high: f64) -> f64 {
    let inside = |l: &f64| *l >= low && *l <= high;
    let first = trace.lengths.iter().position(inside).unwrap_or(0);
    let count = trace.lengths.iter().filter(|l| inside(l)).count();
    if count < MIN_TRACE_PLACES {
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

    /// Points on rings about the axis of a sphere of radius 30, at these angles from the pole in degrees.
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

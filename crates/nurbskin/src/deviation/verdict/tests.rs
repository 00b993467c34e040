//! The rule, on deviations made for it.

use super::super::measure::{Place, PointDeviation};
use super::*;

/// A deviation with these signed values on a square of (u, v).
fn with(count: usize, tolerance: f64, signed: impl Fn(usize, f64, f64) -> f64) -> Deviation {
    let side = (count as f64).sqrt().ceil();
    let points: Vec<PointDeviation> = (0..count)
        .map(|k| {
            let (u, v) = ((k as f64 % side) / side, (k as f64 / side).floor() / side);
            let d = signed(k, u, v);
            PointDeviation {
                lower: d.abs(),
                upper: d.abs(),
                side: if d < 0.0 { -1.0 } else { 1.0 },
                u,
                v,
                face: 0,
                place: Place::Interior,
            }
        })
        .collect();
    Deviation::new(points, tolerance)
}

/// Normal noise by the sum of twelve uniform numbers would have no tails: Box-Muller instead.
fn normal(k: usize) -> f64 {
    let hash = |k: u64| {
        let mut x = k.wrapping_add(0x9e37_79b9_7f4a_7c15);
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    };
    let (a, b) = (hash(2 * k as u64 + 1), hash(2 * k as u64 + 7_000_001));
    (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}

/// With places as if the surface were the square.
fn judged_by(deviation: &Deviation, asked: Asked, scan: Resolution) -> Judgement {
    let place = |p: &PointDeviation| DVec3::new(p.u, p.v, p.signed());
    let places: Vec<DVec3> = deviation.points.iter().map(place).collect();
    judge(deviation, &places, Some(asked), scan)
}

fn judged(deviation: &Deviation, tolerance: f64, scan: Resolution) -> Judgement {
    let within = USUAL_SHARE;
    judged_by(deviation, Asked { tolerance, within }, scan)
}

/// A scan with this noise.
fn scan_of(noise: f64) -> Resolution {
    Resolution {
        noise: Some(noise),
        spacing: 0.01,
        extent: 100.0,
        unit: Unit::Millimetre,
    }
}

fn verdict(
    tolerance: f64,
    noise: f64,
    count: usize,
    signed: impl Fn(usize, f64, f64) -> f64,
) -> Verdict {
    let judgement = judged(&with(count, tolerance, signed), tolerance, scan_of(noise));
    // Both are said whatever the answer: how many points are within, and whether a region is biased.
    if count > 10 {
        assert!(
            judgement.summary.contains("the worst is"),
            "{}",
            judgement.summary
        );
        assert!(
            judgement.summary.contains("biased"),
            "{}",
            judgement.summary
        );
    }
    assert_eq!(judgement.reasons.is_empty(), judgement.verdict.is_good());
    judgement.verdict
}

#[test]
fn points_that_show_nothing_do_not_pass() {
    let scan = Resolution {
        noise: None,
        spacing: 1.0,
        extent: 10.0,
        unit: Unit::Millimetre,
    };
    let deviation = with(8, 0.1, |_, _, _| 0.0);
    assert_eq!(judged(&deviation, 0.1, scan).verdict, Verdict::CannotTell);
    // What is off is off all the same.
    let off = with(8, 0.1, |_, _, _| 0.2);
    assert_eq!(judged(&off, 0.1, scan).verdict, Verdict::Fail);
    let larger = Resolution {
        noise: Some(0.0),
        ..scan
    };
    let within = with(1000, 10.0, |_, _, _| 3.0);
    assert_eq!(judged(&within, 9.0, larger).verdict, Verdict::Pass);
    assert_eq!(judged(&within, 10.0, larger).verdict, Verdict::CannotTell);
}

#[test]
fn a_quiet_scan_is_judged_by_the_share_asked_for() {
    assert_eq!(verdict(0.1, 0.0, 1000, |_, _, _| 0.09), Verdict::Pass);
    let off = |count: usize| {
        let signed = move |k: usize, _: f64, _: f64| match k % 200 {
            17 if k / 200 < count => -0.11,
            _ => 0.0,
        };
        with(1000, 0.1, signed)
    };
    let asked = |within: f64| Asked {
        tolerance: 0.1,
        within,
    };
    let judged = |count: usize, within: f64| judged_by(&off(count), asked(within), scan_of(0.0));
    for (count, within, verdict) in [
        (5, 0.995, Verdict::Pass),
        (5, 0.996, Verdict::Fail),
        (1, 1.0, Verdict::Fail),
        (0, 1.0, Verdict::Pass),
    ] {
        assert_eq!(judged(count, within).verdict, verdict, "{count} {within}");
    }
    let reason = judged(1, 1.0).reasons.remove(0);
    assert_eq!(
        reason.what,
        "1 of 1000 points (0.1 %) is outside +-0.1 mm, none may be; the worst is -0.11 mm; no region is biased"
    );
    let [u, v] = [17.0 / 32.0, 0.0];
    assert_eq!(reason.where_, Some([u, v, -0.11]));
}

#[test]
fn one_rule_whatever_the_noise() {
    // 0.4 % and 0.6 % of the points are outliers.
    for noise in [0.0, 0.01, 0.05, 0.09, 0.1] {
        for (every, verdict) in [(250, Verdict::Pass), (167, Verdict::Fail)] {
            let signed = |k: usize, _: f64, _: f64| match k % every {
                0 if (k / every).is_multiple_of(2) => 2.0,
                0 => -2.0,
                _ => (noise * normal(k)).clamp(-0.3, 0.3),
            };
            let judgement = judged(&with(20_000, 0.3, signed), 0.3, scan_of(noise));
            assert_eq!(judgement.verdict, verdict, "{noise}: {judgement:?}");
        }
    }
}

#[test]
fn a_region_may_be_off_by_what_leaves_the_share_within() {
    let patch = |by: f64| move |_: usize, u: f64, v: f64| if u < 0.2 && v < 0.2 { by } else { 0.0 };
    assert_eq!(verdict(1.0, 0.0, 10_000, patch(0.99)), Verdict::Pass);
    let off = judged(&with(10_000, 1.0, patch(-1.2)), 1.0, scan_of(0.0));
    assert_eq!(off.verdict, Verdict::Fail);
    let [share, region] = &off.reasons[..] else {
        panic!("{off:?}");
    };
    assert!(
        share
            .what
            .starts_with("400 of 10 000 points (4 %) are outside +-1 mm, 0.5 % may be")
    );
    assert!(
        region.what.contains(
            "regions are biased: the worst is off by -1.2 mm on average, 1 mm is allowed"
        ),
        "{}",
        region.what
    );
    let at = region.where_.unwrap();
    assert!(at[0] < 0.2 && at[1] < 0.2 && at[2] < -1.0);
}

#[test]
fn without_a_tolerance_there_are_figures_and_no_verdict() {
    let deviation = with(1000, 0.1, |k, _, _| if k == 500 { -6.0 } else { 0.02 });
    let places = vec![DVec3::ZERO; 1000];
    let found = judge(&deviation, &places, None, scan_of(0.01));
    assert_eq!((found.verdict, found.reasons.len()), (Verdict::NotAsked, 0));
    assert_eq!(
        found.summary,
        "no tolerance was given; 95 % of 1000 points are within 20 um, the worst is -6 mm; the scan's noise is 10 um, \
         its spacing 10 um"
    );
    assert!(found.verdict.is_good());
}

#[test]
fn the_gravest_reason_comes_first() {
    let mut judgement = Judgement {
        verdict: Verdict::NotAsked,
        summary: "figures".into(),
        reasons: Vec::new(),
    };
    assert_eq!(judgement.reason(Unit::Millimetre), "figures");
    for (verdict, what) in [
        (Verdict::CannotTell, "a"),
        (Verdict::Fail, "b"),
        (Verdict::CannotTell, "c"),
    ] {
        judgement.add(verdict, Reason::new(what).at([1.0, 2.0, 3.0]));
    }
    let said: Vec<&str> = judgement.reasons.iter().map(|r| &*r.what).collect();
    assert_eq!(
        (judgement.verdict, said),
        (Verdict::Fail, vec!["b", "a", "c"])
    );
    assert_eq!(judgement.reason(Unit::Millimetre), "b, at (1, 2, 3) mm");
}

#[test]
fn noise_alone_passes_at_three_sigma_and_bias_fails() {
    assert_eq!(
        verdict(0.3, 0.1, 20_000, |k, _, _| 0.1 * normal(k)),
        Verdict::Pass
    );
    // A bump of 2.5 sigma in a corner leaves 99.6 % inside and is seen all the same.
    let bump =
        |k: usize, u: f64, v: f64| 0.1 * normal(k) + if u < 0.2 && v < 0.2 { 0.25 } else { 0.0 };
    assert_eq!(verdict(0.39, 0.1, 20_000, bump), Verdict::Fail);
}

#[test]
fn outliers_are_no_bias_but_what_lies_off_together_is() {
    // One point in 300 anywhere within 60 sigma.
    let scattered = |k: usize, _: f64, _: f64| match k % 300 {
        0 => 2.0 * normal(k + 500_000),
        _ => 0.1 * normal(k),
    };
    assert_eq!(verdict(0.3, 0.1, 10_000, scattered), Verdict::Pass);
    // Two of them side by side.
    let two = |k: usize, _: f64, _: f64| match k {
        5050 | 5051 => 6.0,
        _ => 0.1 * normal(k),
    };
    assert_eq!(verdict(0.3, 0.1, 10_000, two), Verdict::Pass);
    // A feature of 8 x 4 points that was smoothed away lies in a corner of four cells or half of one: 99.6 % of the
    // points are within, and their median is none the wiser.
    for (from, to) in [((30, 30), (38, 34)), ((33, 36), (41, 40))] {
        let feature = move |k: usize, _: f64, _: f64| {
            let inside = (from.0..to.0).contains(&(k % 100)) && (from.1..to.1).contains(&(k / 100));
            0.1 * normal(k) + if inside { 0.6 } else { 0.0 }
        };
        assert_eq!(verdict(0.3, 0.1, 10_000, feature), Verdict::Fail);
    }
    // One that is wider and lower: no more points beyond the tolerance than noise explains.
    let low = |k: usize, u: f64, v: f64| {
        let inside = (0.4..0.55).contains(&u) && (0.4..0.55).contains(&v);
        0.1 * normal(k) + if inside { 0.24 } else { 0.0 }
    };
    assert_eq!(verdict(0.38, 0.1, 10_000, low), Verdict::Fail);
}

#[test]
fn perfect_surfaces_hardly_ever_fail() {
    // 100 scans, of which each may fail with one chance in a hundred; 0.2 % outliers within reach.
    let failed = (0..100)
        .filter(|&scan| {
            let signed = |k: usize, _: f64, _: f64| {
                let k = k + 20_000 * scan;
                let outlier = k.wrapping_mul(2_654_435_761) % 1000 < 2;
                if outlier { normal(k) } else { 0.1 * normal(k) }
            };
            verdict(0.35, 0.1, 5_000, signed) == Verdict::Fail
        })
        .count();
    assert!(failed <= 4, "{failed}");
}

#[test]
fn below_the_noise_nothing_can_be_told_unless_it_is_gross() {
    let noise = |k: usize, _: f64, _: f64| 0.1 * normal(k);
    assert_eq!(verdict(0.02, 0.1, 20_000, noise), Verdict::CannotTell);
    assert_eq!(verdict(0.25, 0.1, 20_000, noise), Verdict::CannotTell);
    assert_eq!(
        verdict(0.02, 0.1, 20_000, |_, _, _| 0.0),
        Verdict::CannotTell
    );
    assert_eq!(verdict(0.02, 0.1, 20_000, |_, _, _| 5.0), Verdict::Fail);
    assert_eq!(
        verdict(0.25, 0.1, 20_000, |k, _, _| 0.2 * normal(k)),
        Verdict::Fail
    );
    assert_eq!(verdict(0.3, 0.1, 4, noise), Verdict::CannotTell);
    assert_eq!(verdict(0.3, 0.1, 0, noise), Verdict::CannotTell);
}

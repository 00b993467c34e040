//! Sheets that do not fill their rectangle.

use super::*;
use glam::{DMat3, DQuat};
use nurbskin_geometry::progress::Silent;
use nurbskin_scan::{CleanOptions, CleanScan, Scan, clean};

/// A wavy sheet over an ellipse of 60 x 40, with noise of 0.05, from a multiplicative sequence.
fn ellipse() -> Vec<DVec3> {
    let mut state = 1_u64;
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut points = Vec::new();
    for j in 0..81 {
        for i in 0..121 {
            let (x, y) = (f64::from(i) - 60.0, f64::from(j) - 40.0);
            let (x, y) = (x + 0.4 * random(), y + 0.4 * random());
            if (x / 60.0).powi(2) + (y / 40.0).powi(2) < 1.0 {
                let z = 6.0 * (0.06 * x).sin() * (0.05 * y).cos() + 0.1 * (random() - 0.5);
                points.push(DVec3::new(x, y, z));
            }
        }
    }
    points
}

fn cleaned(points: Vec<DVec3>) -> CleanScan {
    let scan = Scan {
        points,
        ..Scan::default()
    };
    clean(&scan, &CleanOptions::default(), &Silent).unwrap()
}

fn charted(scan: &CleanScan) -> PlaneChart {
    plane_chart(scan, Sides::Outline).unwrap()
}

#[test]
fn an_ellipse_fills_its_domain() {
    let found = charted(&cleaned(ellipse()));
    let chart = &found.chart;
    assert!(chart.reason.contains("outline"), "{}", chart.reason);
    assert!(!found.beyond.contains(&true));
    // Boxes of the domain three spacings wide hold points everywhere; in the rectangle a fifth would hold none.
    const BOXES: [usize; 2] = [30, 20];
    let mut held = vec![false; BOXES[0] * BOXES[1]];
    for t in &chart.parameters {
        #[expect(clippy::cast_possible_truncation, reason = "0 <= t <= 1")]
        let at = |t: f64, n: usize| ((t * n as f64) as usize).min(n - 1);
        held[at(t.y, BOXES[1]) * BOXES[0] + at(t.x, BOXES[0])] = true;
    }
    let empty = held.iter().filter(|h| !**h).count();
    assert!(empty * 100 <= held.len(), "{empty} of {}", held.len());
}

#[test]
fn the_chart_turns_with_the_scan_and_ignores_the_order() {
    let scan = cleaned(ellipse());
    let first = charted(&scan).chart;
    // 1. Turned. The senses of u and v may change together.
    let turn = DMat3::from_quat(DQuat::from_xyzw(0.3, -0.2, 0.5, 0.4).normalize());
    let turned = CleanScan {
        points: scan.points.iter().map(|p| turn * *p).collect(),
        normals: scan.normals.iter().map(|n| turn * *n).collect(),
        ..scan.clone()
    };
    let second = charted(&turned).chart;
    let same = |a: DVec2, b: DVec2| a.distance(b) < 1e-5;
    let flipped = !same(first.parameters[0], second.parameters[0]);
    for (a, b) in first.parameters.iter().zip(&second.parameters) {
        let b = if flipped { DVec2::ONE - *b } else { *b };
        assert!(same(*a, b), "{a} {b}");
    }
    // 2. The other way round.
    let reversed = CleanScan {
        points: scan.points.iter().rev().copied().collect(),
        normals: scan.normals.iter().rev().copied().collect(),
        ..scan
    };
    let third = charted(&reversed).chart;
    for (a, b) in first.parameters.iter().zip(third.parameters.iter().rev()) {
        assert!(same(*a, *b), "{a} {b}");
    }
}

#[test]
fn a_rectangle_stays_one() {
    let points = (0..60 * 40)
        .map(|k| DVec3::new(f64::from(k % 60), f64::from(k / 60), 0.0))
        .collect();
    let found = charted(&cleaned(points)).chart;
    assert!((found.size[0] - 59.0).abs() < 1e-9 && (found.size[1] - 39.0).abs() < 1e-9);
    let even = |t: f64, n: f64| (t * n - (t * n).round()).abs() < 1e-9;
    assert!(
        found
            .parameters
            .iter()
            .all(|t| even(t.x, 59.0) && even(t.y, 39.0))
    );
}

#[test]
fn points_beyond_the_borders_are_named() {
    let mut points = ellipse();
    let count = points.len();
    // A piece that belongs to no side of the ellipse.
    points.extend((0..100).map(|k| {
        DVec3::new(f64::from(k % 10), f64::from(k / 10), 0.0) + DVec3::new(48.0, 30.0, 0.0)
    }));
    let scan = cleaned(points);
    let found = charted(&scan);
    for (&k, &beyond) in scan.used.iter().zip(&found.beyond) {
        assert!(!beyond || k as usize >= count);
    }
    assert!(found.beyond.iter().filter(|b| **b).count() > 50);
}

//! What a fit says that other tolerances would take, against the fits to them.

use nurbskin::pipeline::{Length, Options, Outcome, SurfacingOptions, fit_scan};
use nurbskin::progress::Silent;
use nurbskin::scan::Scan;
use nurbskin::scan::simulate::{Order, ScanOptions, Shape, scan};

/// By how much a promise may be off, as a ratio: rounds of the search are a factor of 1.6 apart.
const PROMISE: f64 = 1.4;

fn simulated(shape: Shape, noise: f64) -> Scan {
    let options = ScanOptions {
        points: Some(10_000),
        noise,
        order: Order::Shuffled,
        ..ScanOptions::default()
    };
    scan(shape, &options).unwrap().scan
}

fn fitted(scan: &Scan, tolerance: Option<Length>) -> Outcome {
    let options = Options {
        surfacing: SurfacingOptions {
            tolerance,
            ..SurfacingOptions::default()
        },
        ..Options::default()
    };
    fit_scan(scan.clone(), "scan", &options, &Silent).unwrap()
}

fn size(outcome: &Outcome) -> usize {
    outcome.surface.control_points.iter().product()
}

#[test]
fn what_control_points_buy_is_monotone_and_kept() {
    for (shape, noise) in [
        (Shape::Face, 0.0),
        (Shape::Face, 0.05),
        (Shape::Blade, 0.05),
    ] {
        let scan = simulated(shape, noise);
        for tolerance in [None, Some(Length::OfDiagonal(4e-3))] {
            let told = format!("{}, noise {noise}, {tolerance:?}", shape.name());
            let found = fitted(&scan, tolerance);
            let (surface, statistics) = (&found.surface, &found.deviation.scan_to_surface);
            let trade = &surface.trade;
            assert!(trade.len() >= 4, "{told}: {trade:?}");
            assert!(trade.windows(2).all(|pair| {
                pair[0].control_points < pair[1].control_points && pair[0].p95 > pair[1].p95
            }));
            let chosen = trade
                .iter()
                .find(|p| p.control_points == size(&found))
                .unwrap();
            assert!((chosen.p95 - statistics.p95).abs() <= 1e-12 * statistics.p95);
            assert!((chosen.max - statistics.max).abs() <= 1e-12 * statistics.max);
            assert!(chosen.p95 <= chosen.tolerance && chosen.tolerance <= chosen.max);
            // Noise is measured to some per cent.
            for neighbour in &surface.neighbours {
                assert!(neighbour.tolerance >= 2.8 * noise, "{told}: {neighbour:?}");
            }
            let looser = surface
                .neighbours
                .iter()
                .find(|n| n.control_points < size(&found));
            let Some(looser) = looser else { continue };
            let unit = found.input.unit;
            let kept = fitted(&scan, Some(Length::In(looser.tolerance, unit)));
            let ratio = looser.control_points as f64 / size(&kept) as f64;
            println!("{told}: {looser:?}, the search takes {}", size(&kept));
            assert!(
                (1.0 / PROMISE..PROMISE).contains(&ratio),
                "{told}: {looser:?}, {}",
                size(&kept)
            );
        }
    }
}

#[test]
fn surfaces_that_were_not_searched_stand_alone() {
    let turned = fitted(&simulated(Shape::Pot, 0.05), None);
    if turned.surface.rational {
        assert_eq!(turned.surface.trade.len(), 1);
        assert_eq!(
            (turned.surface.knee, turned.surface.neighbours.len()),
            (None, 0)
        );
    }
    let trade = &turned.surface.trade;
    assert!(trade.iter().any(|p| p.control_points == size(&turned)));
}

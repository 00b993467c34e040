//! Noise measured against noise made.

use super::*;
use crate::scan::simulate::{Order, ScanOptions, Shape, scan};

/// The whole of the specification takes minutes; this is its corners, with 1 % outliers left in.
#[test]
fn clouds_within_ten_percent() {
    let mut seed = 0;
    for shape in [
        Shape::Pot,
        Shape::Face,
        Shape::Tube,
        Shape::Sphere,
        Shape::Torus,
    ] {
        for (points, noise, order) in [
            (5_000, 0.02, Order::Shuffled),
            (5_000, 0.2, Order::Scattered),
            (12_000, 0.05, Order::Scattered),
        ] {
            seed += 1;
            let options = ScanOptions {
                points: Some(points),
                noise,
                outliers: 0.01,
                order,
                seed,
                ..ScanOptions::default()
            };
            let simulated = scan(shape, &options).unwrap();
            let found = noise_of_cloud(&simulated.scan.points, None);
            assert!(
                (found / noise - 1.0).abs() < 0.1,
                "{shape:?} {points} {noise} {order:?}: {found}"
            );
        }
    }
}

#[test]
fn grids_noisy_and_clean() {
    for (shape, m, n) in [
        (Shape::Pot, 18, 18),
        (Shape::Pot, 91, 72),
        (Shape::Handle, 25, 32),
        (Shape::Face, 100, 78),
        (Shape::Torus, 30, 40),
    ] {
        for noise in [0.0, 0.05, 0.2] {
            let options = ScanOptions {
                points: Some(m * n),
                rows: Some(n),
                noise,
                seed: 5,
                ..ScanOptions::default()
            };
            let points = scan(shape, &options).unwrap().scan.points;
            let grid = PointGrid::new(m, n, points).unwrap();
            for closed in [shape.closed(), [false; 2]] {
                let found = noise_of_grid(&grid, closed);
                // A few hundred points, seen through windows of nine, know the noise to some 15 %.
                assert!(
                    (found - noise).abs() < 0.15 * noise + 1e-3,
                    "{shape:?} {m} x {n} {noise}: {found}"
                );
            }
        }
    }
}

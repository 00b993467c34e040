//! Tests of the noise estimate against simulated noise.

use super::*;
use crate::simulate::{Order, Random, ScanOptions, Shape, TrueSurface, scan};
use nurbskin_geometry::PointGrid;

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

/// Steps of 1 to 4, as a grid has from which lines were taken: neither are they noise nor do they hide it.
#[test]
fn uneven_grids() {
    for (shape, least) in [
        (Shape::Pot, 5e-3),
        (Shape::Tube, 5e-3),
        (Shape::Handle, 1e-2),
        (Shape::Torus, 1e-2),
        (Shape::Face, 3e-2),
        (Shape::Saddle, 1e-3),
    ] {
        let truth = TrueSurface::new(shape);
        let mut random = Random::new(3);
        let closed = shape.closed();
        let mut along = |around: bool| {
            let mut at = vec![0.0];
            for k in 0..26 {
                at.push(at[k] + [1.0, 1.0, 2.0, 4.0][random.index(4)]);
            }
            let end = if around { at[26] } else { at[25] };
            at.truncate(26);
            at.into_iter().map(|t| t / end).collect::<Vec<f64>>()
        };
        let (u, v) = (along(closed[0]), along(closed[1]));
        for noise in [0.0, 0.2] {
            let points = v.iter().flat_map(|&v| u.iter().map(move |&u| (u, v)));
            let points: Vec<DVec3> = points
                .map(|(u, v)| truth.point(u, v) + noise * random.normal() * truth.normal(u, v))
                .collect();
            let found = noise_of_grid(&PointGrid::new(26, 26, points).unwrap(), closed);
            // 400 overlapping windows know the noise to some 15 %.
            assert!(
                (found - noise).abs() < 0.15 * noise + least,
                "{shape:?} {noise}: {found}"
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

//! Known surfaces, scanned and fitted.

mod scanner {
    use nurbskin::chart::plane::chart_on_plane;
    use nurbskin::progress::Silent;
    use nurbskin::scan::simulate::{Order, ScanOptions, Shape, Simulated, scan};
    use nurbskin::scan::{CleanOptions, CleanScan, Organisation, Reason, clean};

    fn scanned(shape: Shape, options: ScanOptions) -> nurbskin::Result<(Simulated, CleanScan)> {
        let simulated = scan(shape, &options)?;
        let cleaned = clean(&simulated.scan, &CleanOptions::default(), &Silent)?;
        Ok((simulated, cleaned))
    }

    /// What the paper's four objects are known to be: their points, and no noise where there is none.
    #[test]
    fn the_papers_objects_are_clean() {
        for (shape, points) in [
            (Shape::Pot, 13_159),
            (Shape::Patch, 16),
            (Shape::Face, 10_031),
            (Shape::Handle, 12_000),
        ] {
            let (simulated, cleaned) = scanned(shape, ScanOptions::default()).unwrap();
            assert_eq!(simulated.scan.points.len(), points);
            assert_eq!(cleaned.used.len(), points, "{shape:?}");
            assert!(cleaned.noise < 1e-4, "{shape:?} {}", cleaned.noise);
        }
    }

    /// A coarse but clean grid is not taken for a noisy one, and a noisy one not for coarse.
    #[test]
    fn coarse_grids() {
        let coarse = |noise| ScanOptions {
            points: Some(18 * 18),
            rows: Some(18),
            noise,
            seed: 2,
            ..ScanOptions::default()
        };
        let (_, clean_pot) = scanned(Shape::Pot, coarse(0.0)).unwrap();
        assert!(clean_pot.noise < 1e-3, "{}", clean_pot.noise);
        let (_, noisy_pot) = scanned(Shape::Pot, coarse(0.2)).unwrap();
        assert!(
            (noisy_pot.noise / 0.2 - 1.0).abs() < 0.3,
            "{}",
            noisy_pot.noise
        );
    }

    #[test]
    fn noise_over_seeds() {
        for (shape, noise) in [
            (Shape::Pot, 0.05),
            (Shape::Face, 0.1),
            (Shape::Tube, 0.02),
            (Shape::Sphere, 0.2),
            (Shape::Torus, 0.05),
        ] {
            for seed in 0..2 {
                let options = ScanOptions {
                    points: Some(8000),
                    noise,
                    outliers: 0.01,
                    order: Order::Scattered,
                    seed,
                    ..ScanOptions::default()
                };
                let (_, cleaned) = scanned(shape, options).unwrap();
                let ratio = cleaned.noise / noise;
                assert!((ratio - 1.0).abs() < 0.1, "{shape:?} {seed}: {ratio}");
            }
        }
    }

    #[test]
    fn holes_stay_empty() {
        let options = ScanOptions {
            holes: 4,
            noise: 0.02,
            ..ScanOptions::default()
        };
        let (simulated, cleaned) = scanned(Shape::Saddle, options).unwrap();
        let Organisation::Grid(grid) = &simulated.scan.organisation else {
            panic!("ordered scans with holes are grids");
        };
        assert!(grid.empty() >= 4);
        assert_eq!(simulated.scan.points.len(), 10_000);
        assert_eq!(cleaned.rejected_for(Reason::Outlier), 0);
        assert!((cleaned.noise / 0.02 - 1.0).abs() < 0.1);
        let chart = chart_on_plane(&cleaned).unwrap();
        assert!(chart.size.iter().all(|s| (s - 100.0).abs() < 0.5));
    }
}

mod unused {
    use nurbskin::DVec3;
    use nurbskin::pipeline::{Options, fit_scan};
    use nurbskin::progress::Silent;
    use nurbskin::scan::Reason;
    use nurbskin::scan::simulate::{Order, ScanOptions, Shape, scan as simulate};

    /// Points of a file that are not used have a place in the report, too.
    #[test]
    fn every_point_of_a_scan_is_used_or_told_of() {
        let options = ScanOptions {
            points: Some(3000),
            order: Order::Scattered,
            noise: 0.05,
            outliers: 0.01,
            ..ScanOptions::default()
        };
        let mut scan = simulate(Shape::Face, &options).unwrap().scan;
        let count = scan.points.len();
        scan.points.push(DVec3::new(1.0, f64::NAN, 2.0));
        scan.points.extend_from_within(10..30);
        // A second part, too small for a surface.
        let far = scan.points[40] + DVec3::Z * 500.0;
        scan.points
            .extend([0.0, 0.5, 1.0].map(|x| far + DVec3::X * x));
        let total = scan.points.len();
        let found = fit_scan(scan.clone(), "face", &Options::default(), &Silent).unwrap();
        let points = &found.per_point;
        assert_eq!(points.indices.len() + points.unused.len(), total);
        let mut indices: Vec<u32> = points.indices.clone();
        indices.extend(points.unused.iter().map(|p| p.index));
        indices.sort_unstable();
        assert!(
            (0..).zip(&indices).all(|(k, index)| k == *index),
            "each once"
        );
        let of = |reason| points.unused.iter().filter(move |p| p.reason == reason);
        let rejected = found.input.rejected;
        assert_eq!(of(Reason::NonFinite).count(), 1);
        assert_eq!(of(Reason::Duplicate).count(), rejected.duplicate);
        assert_eq!(of(Reason::Outlier).count(), rejected.outlier);
        assert_eq!(of(Reason::LeftOut).count(), rejected.left_out);
        assert!(rejected.duplicate >= 20 && rejected.outlier + rejected.left_out > 3);
        for point in &points.unused {
            let exact = scan.points[point.index as usize];
            assert_eq!(point.deviation.is_some(), exact.is_finite());
            assert!(point.point == exact || !exact.is_finite());
        }
        // A duplicate is as far from the surface as its twin.
        for twin in of(Reason::Duplicate).filter(|p| p.index as usize > count) {
            let first = twin.index as usize - count - 1 + 10;
            let at = points.indices.iter().position(|&k| k as usize == first);
            let Some(at) = at else { continue };
            let [a, b] = [points.deviation[at].upper, twin.deviation.unwrap().upper];
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
        let all = found.deviation.all_points.unwrap();
        assert_eq!(all.count, total - 1);
        assert!(all.max > found.deviation.scan_to_surface.max);
        let mut csv = Vec::new();
        points.write_csv(found.origin, &mut csv).unwrap();
        assert_eq!(String::from_utf8(csv).unwrap().lines().count(), total + 1);
    }
}

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

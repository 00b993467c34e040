//! The scanner and its shapes against brute force.

use super::*;

fn brute(truth: &TrueSurface, point: DVec3, steps: usize) -> f64 {
    let mut best = f64::INFINITY;
    for k in 0..=steps {
        for l in 0..=steps {
            let (u, v) = (k as f64 / steps as f64, l as f64 / steps as f64);
            best = best.min(truth.point(u, v).distance(point));
        }
    }
    best
}

#[test]
fn coordinates_normals_and_seams() {
    for shape in Shape::ALL {
        assert_eq!(Shape::from_name(&shape.name().to_uppercase()), Some(shape));
        let truth = TrueSurface::new(shape);
        let [closed_u, closed_v] = truth.closed();
        let mut middle = DVec3::ZERO;
        for k in 0..400 {
            middle += truth.point((k % 20) as f64 / 20.0, (k / 20) as f64 / 20.0) / 400.0;
        }
        let mut outward = 0.0;
        for k in 0..=20 {
            for l in 0..=20 {
                let (u, v) = (k as f64 / 20.0, l as f64 / 20.0);
                let point = truth.point(u, v);
                assert!(
                    point.min_element() >= 100.0 && point.max_element() < 1000.0,
                    "{shape:?} {point}"
                );
                let normal = truth.normal(u, v);
                assert!((normal.length() - 1.0).abs() < 1e-12);
                let d = truth.derivatives(u, v);
                if !(shape.has_poles() && (k == 0 || k == 20)) {
                    assert!(
                        d.du.cross(d.dv).normalize().dot(normal) > 0.999_999,
                        "{shape:?}"
                    );
                }
                outward += (point - middle).dot(normal) * d.du.cross(d.dv).length();
            }
            let t = k as f64 / 20.0;
            if closed_v {
                assert!(truth.point(t, 0.0).distance(truth.point(t, 1.0)) < 1e-12);
            }
            if closed_u {
                assert!(truth.point(0.0, t).distance(truth.point(1.0, t)) < 1e-12);
            }
            if shape.has_poles() {
                assert!(truth.point(0.0, t).distance(truth.point(0.0, 0.0)) < 1e-12);
            }
        }
        if closed_v {
            assert!(outward > 0.0, "{shape:?} points inward");
        } else {
            assert!(truth.normal(0.5, 0.5).z > 0.0, "{shape:?} points down");
        }
    }
}

#[test]
fn derivatives_against_differences() {
    for shape in Shape::ALL {
        let (u, v, h) = (0.37, 0.61, 1e-5);
        let d = shape.derivatives(u, v);
        let at = |a: f64, b: f64| shape.derivatives(u + a * h, v + b * h);
        let difference = |plus: DVec3, minus: DVec3| (plus - minus) / (2.0 * h);
        let close = |a: DVec3, b: DVec3| a.distance(b) <= 1e-5 * (1.0 + a.length());
        let [east, west, north, south] = [at(1.0, 0.0), at(-1.0, 0.0), at(0.0, 1.0), at(0.0, -1.0)];
        assert!(close(d.du, difference(east.point, west.point)), "{shape:?}");
        assert!(
            close(d.dv, difference(north.point, south.point)),
            "{shape:?}"
        );
        assert!(close(d.duu, difference(east.du, west.du)), "{shape:?}");
        assert!(close(d.duv, difference(north.du, south.du)), "{shape:?}");
        assert!(close(d.dvv, difference(north.dv, south.dv)), "{shape:?}");
    }
}

#[test]
fn distance_against_brute_force() {
    let mut random = Random::new(5);
    for shape in Shape::ALL {
        for opening in [false, true] {
            if opening && shape != Shape::Handle {
                continue;
            }
            let truth = if opening {
                TrueSurface::opened(shape)
            } else {
                TrueSurface::new(shape)
            };
            for k in 0..12 {
                let (u, v) = (random.uniform(), random.uniform());
                let away = if k % 3 == 0 { 0.3 } else { 25.0 };
                let offset = DVec3::new(random.normal(), random.normal(), random.normal());
                let point = truth.point(u, v) + away * offset;
                let distance = truth.distance(point);
                let steps = 160;
                let sampled = brute(&truth, point, steps);
                // The nearest sample is at most half a cell's diagonal, about `size`, from the foot.
                let [length_u, length_v] = truth.size();
                let size = 2.0 * length_u.hypot(length_v) / steps as f64;
                assert!(distance <= sampled + 1e-12, "{shape:?}");
                assert!(distance >= sampled - size, "{shape:?} {distance} {sampled}");
                let exact = (sampled * sampled - distance * distance).max(0.0).sqrt();
                assert!(exact <= 3.0 * (size + (size * sampled).sqrt()), "{shape:?}");
            }
            // On the surface, and a little above it where that is the nearest place.
            for _ in 0..12 {
                let (u, v) = (random.uniform(), 0.01 + 0.98 * random.uniform());
                let point = truth.point(u, v);
                assert!(truth.distance(point) < 1e-10, "{shape:?}");
                let above = point + 0.05 * truth.normal(u, v);
                assert!(
                    (truth.signed_distance(above) - 0.05).abs() < 1e-10,
                    "{shape:?}"
                );
                let below = point - 0.05 * truth.normal(u, v);
                assert!(
                    (truth.signed_distance(below) + 0.05).abs() < 1e-10,
                    "{shape:?}"
                );
            }
        }
    }
}

#[test]
fn general_search_agrees_with_closed_forms() {
    // The ellipsoid's closed form against the shape's own foot condition, from everywhere.
    let mut random = Random::new(3);
    let truth = TrueSurface::new(Shape::Ellipsoid);
    for _ in 0..300 {
        let point = DVec3::splat(300.0)
            + 60.0 * DVec3::new(random.normal(), random.normal(), random.normal());
        let foot = truth.closest_point(point) - DVec3::splat(300.0);
        let level = (foot / super::super::shapes::ELLIPSOID).length();
        assert!((level - 1.0).abs() < 1e-12);
        assert!(truth.distance(point) <= brute(&truth, point, 40) + 1e-12);
    }
    let centre = truth.distance(DVec3::splat(300.0));
    assert!((centre - 25.0).abs() < 1e-12);
}

#[test]
fn exact_counts_whatever_is_asked() {
    for shape in Shape::ALL {
        for (points, holes, order) in [
            (16, 0, Order::Ordered),
            (997, 0, Order::Ordered),
            (1000, 0, Order::Shuffled),
            (1001, 3, Order::Ordered),
            (1501, 5, Order::Shuffled),
            (500, 2, Order::Scattered),
        ] {
            let options = ScanOptions {
                points: Some(points),
                holes,
                order,
                noise: 0.02,
                outliers: 0.01,
                seed: 4,
                ..ScanOptions::default()
            };
            let simulated = scan(shape, &options).unwrap();
            let scan_ = &simulated.scan;
            assert_eq!(scan_.points.len(), points);
            assert_eq!(simulated.parameters.len(), points);
            match &scan_.organisation {
                Organisation::Rows(rows) => {
                    assert_eq!(rows.iter().sum::<usize>(), points);
                    let (least, most) = (rows.iter().min(), rows.iter().max());
                    assert!(most.unwrap() - least.unwrap() <= 1);
                }
                Organisation::Grid(grid) => {
                    assert_eq!(grid.cells.len(), grid.count_u * grid.count_v);
                    assert_eq!(grid.cells.len() - grid.empty(), points);
                    assert_eq!(grid.empty() > 0, holes > 0);
                }
                _ => assert_ne!(order, Order::Ordered),
            }
        }
    }
}

#[test]
fn the_papers_counts() {
    let count = |shape| scan(shape, &ScanOptions::default()).unwrap().scan;
    let pot = count(Shape::Pot);
    assert_eq!(pot.points.len(), 13_159);
    assert!(matches!(&pot.organisation, Organisation::Rows(rows) if rows.len() == 144));
    assert_eq!(count(Shape::Face).points.len(), 10_031);
    let handle = count(Shape::Handle);
    assert_eq!(handle.points.len(), 12_000);
    assert!(
        matches!(&handle.organisation, Organisation::Grid(g) if (g.count_u, g.count_v) == (120, 100))
    );
    let patch = count(Shape::Patch);
    let given: Vec<DVec3> = super::super::shapes::PATCH_POINTS
        .iter()
        .map(|&p| DVec3::from_array(p))
        .collect();
    assert_eq!(patch.points, given);
}

#[test]
fn noise_outliers_and_seeds() {
    let options = ScanOptions {
        noise: 0.05,
        outliers: 0.02,
        seed: 11,
        ..ScanOptions::default()
    };
    let a = scan(Shape::Torus, &options).unwrap();
    let b = scan(Shape::Torus, &options).unwrap();
    assert_eq!(a.scan.points, b.scan.points);
    assert_eq!(a.outliers.len(), 200);
    let other = scan(
        Shape::Torus,
        &ScanOptions {
            seed: 12,
            ..options
        },
    )
    .unwrap();
    assert_ne!(a.scan.points, other.scan.points);
    let inliers: Vec<f64> = (0..a.scan.points.len())
        .filter(|k| a.outliers.binary_search(k).is_err())
        .map(|k| a.truth.signed_distance(a.scan.points[k]))
        .collect();
    let n = inliers.len() as f64;
    let sigma = (inliers.iter().map(|d| d * d).sum::<f64>() / n).sqrt();
    assert!((sigma / 0.05 - 1.0).abs() < 0.03, "{sigma}");
    assert!((inliers.iter().sum::<f64>() / n).abs() < 0.002);
}

#[test]
fn bad_options_are_refused() {
    let bad = |options: ScanOptions| {
        assert!(matches!(scan(Shape::Pot, &options), Err(Error::Invalid(_))));
    };
    bad(ScanOptions {
        points: Some(15),
        ..ScanOptions::default()
    });
    bad(ScanOptions {
        points: Some(usize::MAX),
        ..ScanOptions::default()
    });
    bad(ScanOptions {
        rows: Some(2),
        ..ScanOptions::default()
    });
    bad(ScanOptions {
        rows: Some(100_000),
        ..ScanOptions::default()
    });
    bad(ScanOptions {
        noise: f64::NAN,
        ..ScanOptions::default()
    });
    bad(ScanOptions {
        noise: -1.0,
        ..ScanOptions::default()
    });
    bad(ScanOptions {
        outliers: 0.6,
        ..ScanOptions::default()
    });
    bad(ScanOptions {
        holes: 31,
        ..ScanOptions::default()
    });
}

/// Lines kept by the paper's rule along one direction: the first, then each whose normal turned by more than
/// `degrees` from the last kept line's anywhere, and the last of an open direction.
fn kept_lines(truth: &TrueSurface, counts: [usize; 2], along: usize, degrees: f64) -> usize {
    let closed = truth.closed();
    let at = |k: usize, axis: usize| {
        k as f64
            / (if closed[axis] {
                counts[axis]
            } else {
                counts[axis] - 1
            }) as f64
    };
    let line = |k: usize| -> Vec<DVec3> {
        (0..counts[1 - along])
            .map(|l| {
                let (a, b) = (at(k, along), at(l, 1 - along));
                if along == 0 {
                    truth.normal(a, b)
                } else {
                    truth.normal(b, a)
                }
            })
            .collect()
    };
    let turned = |a: &[DVec3], b: &[DVec3]| {
        let angle = |(x, y): (&DVec3, &DVec3)| x.dot(*y).clamp(-1.0, 1.0).acos().to_degrees();
        a.iter().zip(b).map(angle).fold(0.0, f64::max)
    };
    let (mut kept, mut last, mut at_end) = (1, line(0), false);
    for k in 1..counts[along] {
        let now = line(k);
        if turned(&last, &now) > degrees {
            (kept, last, at_end) = (kept + 1, now, k + 1 == counts[along]);
        }
    }
    kept + usize::from(!closed[along] && !at_end)
}

#[test]
fn the_papers_arrays_are_within_reach() {
    for (shape, opening, counts, wanted, degrees) in [
        (Shape::Pot, false, [91, 144], [18, 18], [10.5, 18.5]),
        (Shape::Face, false, [128, 78], [29, 13], [17.5, 28.5]),
        (Shape::Handle, false, [120, 100], [25, 32], [4.4, 9.9]),
        (Shape::Handle, true, [120, 100], [25, 32], [4.4, 9.4]),
    ] {
        let truth = if opening {
            TrueSurface::opened(shape)
        } else {
            TrueSurface::new(shape)
        };
        for along in 0..2 {
            let found = (0..10)
                .map(|k| degrees[along] + 0.1 * f64::from(k))
                .find(|&degrees| kept_lines(&truth, counts, along, degrees) == wanted[along]);
            assert!(found.is_some(), "{shape:?} {opening} {along}");
        }
    }
}

//! Logical rarefaction: the paper's rule against its definition, and rarefaction to tolerance against brute force.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

use crate::fixtures::{self, Shape};
use nurbskin::chart::Topology;
use nurbskin::fit::interpolate::parameters::Parameterization;
use nurbskin::fit::rarefied::{Options, largest_threshold, rarefy_to_tolerance};
use nurbskin::progress::Silent;
use nurbskin::rarefy::{
    Rule, Statistic, Thresholds, normals, rarefy, rarefy_by, to_counts, to_counts_filled,
};
use nurbskin::{DVec3, Error, NurbsSurface, PointGrid};
use proptest::prelude::*;
use std::f64::consts::TAU;

/// The definition, read off word by word: every row is asked, with the arc cosine, for the angle to the line kept last.
fn by_definition(grid: &PointGrid, topology: Topology, degrees: f64, along_v: bool) -> Vec<usize> {
    let (grid, topology_is_closed) = (grid, topology.closed()[usize::from(along_v)]);
    let normals = normals(grid, topology);
    let [m, n] = grid.counts();
    let (lines, rows) = if along_v { (n, m) } else { (m, n) };
    let normal = |line: usize, row: usize| {
        let (i, j) = if along_v { (row, line) } else { (line, row) };
        normals[j * m + i]
    };
    let mut kept = vec![0];
    for line in 1..lines {
        let last = *kept.last().unwrap();
        let exceeds = (0..rows)
            .any(|row| normal(last, row).angle_between(normal(line, row)) > degrees.to_radians());
        if exceeds {
            kept.push(line);
        }
    }
    if !topology_is_closed && *kept.last().unwrap() != lines - 1 {
        kept.push(lines - 1);
    }
    kept
}

#[test]
fn keeps_what_the_definition_keeps() {
    for Shape {
        grid,
        topology,
        name,
    } in fixtures::all()
    {
        for degrees in [3.0, 7.0, 12.3, 29.0] {
            let kept = rarefy(&grid, topology, Thresholds::both(degrees));
            assert!(kept.point_count() >= 16);
            assert_eq!(
                kept.u,
                by_definition(&grid, topology, degrees, false),
                "{name} {degrees}"
            );
            assert_eq!(
                kept.v,
                by_definition(&grid, topology, degrees, true),
                "{name} {degrees}"
            );
        }
    }
}

#[test]
fn normals_of_a_sphere_point_outward_and_at_the_poles_along_the_axis() {
    let grid = fixtures::sphere(41, 60);
    let normals = normals(&grid, Topology::Sphere);
    for (normal, point) in normals.iter().zip(grid.points()) {
        assert!((normal.length() - 1.0).abs() < 1e-14);
        assert!(normal.angle_between(*point) < 0.02, "{normal} at {point}");
    }
    for j in 0..60 {
        assert!((normals[j * 41] - DVec3::Z).length() < 1e-14);
        assert!((normals[j * 41 + 40] + DVec3::Z).length() < 1e-14);
    }
    // The same poles in the other direction of an open grid are found by their coincident points.
    let open = grid.transposed();
    let turned = nurbskin::rarefy::normals(&open, Topology::Disk);
    assert!((turned[7] + DVec3::Z).length() < 2e-2);
    assert!((turned[60 * 40 + 7] - DVec3::Z).length() < 2e-2);
}

#[test]
fn a_vanishing_threshold_keeps_all_and_a_large_one_what_the_degree_needs() {
    for Shape { grid, topology, .. } in fixtures::all() {
        let all = rarefy(&grid, topology, Thresholds::both(1e-9));
        assert_eq!(all.counts(), grid.counts());
        assert_eq!(all.select(&grid).unwrap(), grid);
        let few = rarefy(&grid, topology, Thresholds::both(180.0));
        assert_eq!(few.counts(), [4, 4]);
        let rule = Rule {
            at_least: [6, 3],
            ..Rule::new(Thresholds::both(180.0))
        };
        assert_eq!(rarefy_by(&grid, topology, rule).counts(), [6, 3]);
    }
}

#[test]
fn the_styled_patch_of_4_x_4_keeps_all_16() {
    let grid = PointGrid::from_fn(4, 4, |i, j| {
        DVec3::new(
            50.0 * i as f64,
            50.0 * j as f64,
            20.0 * ((i * j) as f64).sin(),
        )
    });
    let kept = rarefy(&grid.unwrap(), Topology::Disk, Thresholds::both(5.0));
    assert_eq!(kept.point_count(), 16);
}

#[test]
fn a_plane_and_degenerate_grids_do_no_harm() {
    let plane = PointGrid::from_fn(30, 20, |i, j| DVec3::new(i as f64, j as f64, 0.0)).unwrap();
    assert_eq!(
        rarefy(&plane, Topology::Disk, Thresholds::both(1e-9)).counts(),
        [4, 4]
    );
    for counts in [[1, 1], [1, 5], [5, 1], [2, 2], [3, 7]] {
        let point = PointGrid::from_fn(counts[0], counts[1], |_, _| DVec3::ONE).unwrap();
        for topology in [
            Topology::Disk,
            Topology::Tube,
            Topology::Sphere,
            Topology::Torus,
        ] {
            let kept = rarefy(&point, topology, Thresholds::both(1.0));
            assert_eq!(kept.counts(), counts.map(|count| count.min(4)));
        }
    }
    let huge = plane.map(|p| p * 1e300).unwrap();
    assert!((normals(&huge, Topology::Disk)[33] - DVec3::Z).length() < 1e-15);
    let tiny = plane.map(|p| p * 1e-300).unwrap();
    assert!((normals(&tiny, Topology::Disk)[33] - DVec3::Z).length() < 1e-15);
}

#[test]
fn wanted_counts_are_met_or_the_nearest_are_named() {
    let grid = fixtures::face(101, 100);
    for counts in [[29, 13], [25, 32], [8, 8], [101, 100]] {
        match to_counts(&grid, Topology::Disk, counts) {
            Ok((thresholds, kept)) => {
                assert_eq!(kept.counts(), counts);
                assert_eq!(rarefy(&grid, Topology::Disk, thresholds), kept);
            }
            Err(error) => assert!(error.to_string().contains("nearest counts"), "{error}"),
        }
        let (_, kept) = to_counts_filled(&grid, Topology::Disk, counts).unwrap();
        assert_eq!(kept.counts(), counts);
        assert!(kept.u.is_sorted_by(|a, b| a < b) && kept.v.is_sorted_by(|a, b| a < b));
    }
    // Around the axis of the pot all steps are equal: 115 lines become 20 (every sixth) or 17 (every seventh).
    let pot = fixtures::pot(115, 115);
    let error = to_counts(&pot, Topology::Tube, [18, 18]).unwrap_err();
    assert!(matches!(error, Error::NoSolution(_)));
    assert!(error.to_string().contains("17 and 20"), "{error}");
    let (_, kept) = to_counts_filled(&pot, Topology::Tube, [18, 18]).unwrap();
    assert_eq!(kept.counts(), [18, 18]);
    assert!(to_counts(&pot, Topology::Tube, [1, 18]).is_err());
    assert!(to_counts(&pot, Topology::Tube, [18, 116]).is_err());
}

#[test]
fn one_wild_row_decides_by_maximum_but_not_by_quantile() {
    let grid = PointGrid::from_fn(40, 40, |i, j| {
        let bump = if j == 20 { (i as f64).sin() } else { 0.0 };
        DVec3::new(i as f64, j as f64, bump)
    })
    .unwrap();
    let with = |statistic| {
        let rule = Rule {
            statistic,
            ..Rule::new(Thresholds::both(10.0))
        };
        rarefy_by(&grid, Topology::Disk, rule).u.len()
    };
    assert!(with(Statistic::Max) > 20);
    assert_eq!(with(Statistic::Quantile(0.9)), 4);
    assert_eq!(with(Statistic::Mean), 4);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn any_grid_is_rarefied_into_some_of_its_lines(
        m in 1usize..9,
        n in 1usize..9,
        seed in prop::collection::vec(-1.0..1.0f64, 192),
        degrees in 0.0..120.0f64,
        topology in prop::sample::select(vec![Topology::Disk, Topology::Tube, Topology::Sphere, Topology::Torus]),
    ) {
        let grid = PointGrid::from_fn(m, n, |i, j| DVec3::from_slice(&seed[3 * (j * m + i)..])).unwrap();
        let kept = rarefy(&grid, topology, Thresholds::both(degrees));
        prop_assert!(kept.u.is_sorted_by(|a, b| a < b) && kept.v.is_sorted_by(|a, b| a < b));
        prop_assert!(kept.u.len() >= m.min(4) && kept.v.len() >= n.min(4));
        prop_assert_eq!((kept.u[0], kept.v[0]), (0, 0));
        if !topology.closed()[0] {
            prop_assert_eq!(*kept.u.last().unwrap(), m - 1);
        }
        prop_assert!(kept.select(&grid).is_ok());
    }
}

/// The distance of a point to a surface by brute force: the nearest of a fine lattice of surface points around its
/// parameters, refined by ever finer lattices.
fn brute_distance(surface: &NurbsSurface, point: DVec3, start: [f64; 2]) -> f64 {
    let (mut at, mut width) = (start, 0.05);
    let domain = surface.domain();
    let mut best = f64::INFINITY;
    for _ in 0..14 {
        let centre = at;
        for a in -6..=6 {
            for b in -6..=6 {
                let mut u = centre[0] + width * f64::from(a) / 6.0;
                let mut v = centre[1] + width * f64::from(b) / 6.0;
                if !surface.periodic()[0] {
                    u = u.clamp(domain[0].0, domain[0].1);
                }
                if !surface.periodic()[1] {
                    v = v.clamp(domain[1].0, domain[1].1);
                }
                let distance = surface.point(u, v).distance(point);
                if distance < best {
                    (best, at) = (distance, [u, v]);
                }
            }
        }
        width *= 0.35;
    }
    best
}

/// Options for tests where the last point to save does not matter.
fn quick() -> Options {
    Options {
        effort: 4_000_000,
        ..Options::default()
    }
}

#[test]
fn all_points_are_within_tolerance_with_few_kept() {
    // At most so many points each; what a prototype of the method needed is 360, 920, 182 and 90.
    let ceilings = [120, 480, 80, 54];
    for (
        Shape {
            name,
            grid,
            topology,
        },
        ceiling,
    ) in fixtures::all().into_iter().zip(ceilings)
    {
        let options = Options::default();
        let result = rarefy_to_tolerance(&grid, topology, 0.1, &options, &Silent).unwrap();
        assert!(result.met && result.max_distance <= 0.1, "{name}");
        assert!(
            result.kept.point_count() <= ceiling,
            "{name}: {:?}",
            result.kept.counts()
        );
        if name == "sphere" {
            let again = rarefy_to_tolerance(&grid, topology, 0.1, &options, &Silent).unwrap();
            assert_eq!(again.surface, result.surface);
        }
        let [u, v] = &result.parameters;
        assert_eq!([u.len(), v.len()], grid.counts());
        // Kept points lie on the surface, and the surface has no other control points than theirs.
        for &j in &result.kept.v {
            for &i in &result.kept.u {
                assert!(result.surface.point(u[i], v[j]).distance(grid.point(i, j)) < 1e-11);
            }
        }
        assert_eq!(result.surface.distinct_counts(), result.kept.counts());
        let mut worst = 0.0_f64;
        for k in (0..grid.points().len()).step_by(131) {
            let [i, j] = [k % grid.count_u(), k / grid.count_u()];
            let brute = brute_distance(&result.surface, grid.points()[k], [u[i], v[j]]);
            worst = worst.max(brute);
        }
        assert!(
            worst <= result.max_distance + 1e-9 && worst > 0.2 * result.max_distance,
            "{name}"
        );
    }
}

#[test]
fn the_largest_distance_is_that_of_brute_force() {
    let grid = fixtures::face(41, 40);
    for kind in [Parameterization::ChordLength, Parameterization::Uniform] {
        let options = Options {
            parameterization: Some(kind),
            max_points: Some(81),
            ..Options::default()
        };
        let result = rarefy_to_tolerance(&grid, Topology::Disk, 0.1, &options, &Silent).unwrap();
        assert!(!result.met && result.kept.point_count() <= 81);
        let [u, v] = &result.parameters;
        let brute = (0..grid.points().len())
            .map(|k| brute_distance(&result.surface, grid.points()[k], [u[k % 41], v[k / 41]]))
            .fold(0.0, f64::max);
        assert!(
            (result.max_distance - brute).abs() < 1e-3 * brute,
            "{brute} {}",
            result.max_distance
        );
    }
}

#[test]
fn the_largest_threshold_meets_the_tolerance_with_more_points() {
    for Shape {
        name,
        grid,
        topology,
    } in fixtures::all()
    {
        let kind = Parameterization::ChordLength;
        let found = largest_threshold(&grid, topology, 0.1, [3, 3], kind, &Silent).unwrap();
        let (degrees, result) = found.unwrap();
        assert!(result.met && result.max_distance <= 0.1, "{name}");
        let kept = rarefy(&grid, topology, Thresholds::both(degrees));
        assert_eq!(kept, result.kept);
        let few = rarefy_to_tolerance(&grid, topology, 0.1, &quick(), &Silent).unwrap();
        assert!(
            2 * kept.point_count() > 3 * few.kept.point_count(),
            "{name} {degrees} {:?}",
            kept.counts()
        );
    }
}

#[test]
fn small_and_flat_grids_and_other_degrees_are_rarefied() {
    for topology in [Topology::Disk, Topology::Tube, Topology::Torus] {
        for [m, n] in [[3, 3], [3, 7], [4, 4], [6, 5]] {
            let torus = PointGrid::from_fn(m, n, |i, j| {
                let (a, b) = (i as f64 * TAU / m as f64, j as f64 * TAU / n as f64);
                let ring = 20.0 + 5.0 * a.cos();
                DVec3::new(ring * b.cos(), ring * b.sin(), 5.0 * a.sin())
            });
            let options = Options::default();
            let result = rarefy_to_tolerance(&torus.unwrap(), topology, 1e-3, &options, &Silent);
            assert!(result.unwrap().met);
        }
    }
    let plane = PointGrid::from_fn(50, 2, |i, j| DVec3::new(i as f64, j as f64, 1.0)).unwrap();
    let plane_result =
        rarefy_to_tolerance(&plane, Topology::Disk, 0.01, &Options::default(), &Silent);
    assert_eq!(plane_result.unwrap().kept.counts(), [4, 2]);
    let grid = fixtures::face(60, 50);
    let mut before = usize::MAX;
    for degree in [1, 2, 3, 4, 5] {
        let options = Options {
            degree: [degree; 2],
            ..quick()
        };
        let result = rarefy_to_tolerance(&grid, Topology::Disk, 1.0, &options, &Silent).unwrap();
        assert!(result.met);
        // A cubic needs fewer points than a polyhedron on a smooth shape.
        assert!(degree != 3 || result.kept.point_count() < before);
        if degree == 1 {
            before = result.kept.point_count();
        }
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(
            rarefy_to_tolerance(&grid, Topology::Disk, bad, &Options::default(), &Silent).is_err()
        );
    }
}

#[test]
fn a_tolerance_below_the_noise_ends_with_all_lines() {
    let mut seed = 1u64;
    let noise: Vec<f64> = (0..3 * 900)
        .map(|_| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 40) as f64 / 16_777_216.0 - 0.5
        })
        .collect();
    let grid = PointGrid::from_fn(30, 30, |i, j| {
        DVec3::new(10.0 * i as f64, 10.0 * j as f64, 0.0)
            + DVec3::from_slice(&noise[3 * (30 * j + i)..])
    });
    let grid = grid.unwrap();
    let options = Options::default();
    let all = rarefy_to_tolerance(&grid, Topology::Disk, 1e-4, &options, &Silent).unwrap();
    assert!(all.met && all.kept.counts().iter().all(|&count| count >= 29));
    let few = rarefy_to_tolerance(&grid, Topology::Disk, 2.0, &options, &Silent).unwrap();
    assert_eq!(few.kept.counts(), [4, 4]);
}

#[test]
fn a_looser_tolerance_needs_hardly_more_lines() {
    let grid = fixtures::tube(60, 50);
    let mut before = usize::MAX;
    for tolerance in [0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0] {
        let result = rarefy_to_tolerance(
            &grid,
            Topology::Tube,
            tolerance,
            &Options::default(),
            &Silent,
        );
        let kept = result.unwrap().kept;
        let points = kept.point_count();
        assert!(
            points as f64 <= 1.1 * before as f64,
            "{tolerance}: {points} after {before}"
        );
        before = points;
    }
}

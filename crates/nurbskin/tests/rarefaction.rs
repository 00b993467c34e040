//! Logical rarefaction: the paper's rule against its definition.

use crate::four_shapes::{self, Shape};
use nurbskin::chart::Topology;
use nurbskin::rarefy::{
    Rule, Statistic, Thresholds, normals, rarefy, rarefy_by, to_counts, to_counts_filled,
};
use nurbskin::{DVec3, Error, PointGrid};
use proptest::prelude::*;

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
    } in four_shapes::all()
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
    let grid = four_shapes::sphere(41, 60);
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
    for Shape { grid, topology, .. } in four_shapes::all() {
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
    let grid = four_shapes::face(101, 100);
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
    let pot = four_shapes::pot(115, 115);
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

//! Trimmed surfaces of simulated scans: loops, seams, extensions and withdrawals.

use super::*;
use nurbskin_geometry::nurbs::conic;
use nurbskin_geometry::{ControlNet, KnotVector};

fn sheet() -> NurbsSurface {
    let net = ControlNet::from_fn(6, 5, |i, j| {
        let (x, y) = (20.0 * i as f64 / 5.0, 16.0 * j as f64 / 4.0);
        DVec3::new(x, y, 0.02 * x * y)
    });
    let knots = |n| KnotVector::uniform(3, n).unwrap();
    NurbsSurface::new(knots(6), knots(5), net.unwrap(), None).unwrap()
}

/// Points on the surface, a quarter apart, that satisfy a condition.
fn points(surface: &NurbsSurface, keep: impl Fn(DVec3) -> bool) -> Vec<DVec3> {
    let [(a, b), (c, d)] = surface.domain();
    let [m, n] = surface.iso_lengths().map(|l| (4.0 * l).ceil());
    let mut all = Vec::new();
    let (mut j, mut i);
    j = 0.0;
    while j <= n {
        i = 0.0;
        while i <= m {
            all.push(surface.point(a + (b - a) * i / m, c + (d - c) * j / n));
            i += 1.0;
        }
        j += 1.0;
    }
    all.retain(|&p| keep(p));
    all
}

fn trimmed(surface: &NurbsSurface, points: &[DVec3]) -> (Trimming, Model) {
    let scan = Scanned {
        points,
        triangles: None,
        is_mesh: false,
        feet: None,
        stays_closed: true,
        spacing: 0.25,
    };
    let trimming = trimming(surface, &scan).unwrap();
    let mut model = Model::new("");
    let face = model.add_trimmed_surface(&trimming, 1e-9, 1e-5).unwrap();
    // Edges lie on the surface, and each loop is connected.
    let face = &model.faces()[face];
    for each in &face.loops {
        let mut at = each.uses[each.uses.len() - 1].ends()[1];
        for used in &each.uses {
            assert_eq!(used.ends()[0], at);
            at = used.ends()[1];
            let Some(curve) = &model.edges()[used.edge].curve else {
                continue;
            };
            let (a, b) = curve.domain();
            for k in 0..=100 {
                let t = a + (b - a) * f64::from(k) / 100.0;
                let p = used.pcurve.point(t);
                let gap = curve.point(t).distance(face.surface.point(p.x, p.y));
                assert!(gap < 1e-5, "{gap}");
            }
        }
    }
    (trimming, model)
}

#[test]
fn what_is_covered_is_left_alone() {
    let (trimming, model) = trimmed(&sheet(), &points(&sheet(), |_| true));
    assert!(!trimming.is_cut() && trimming.cut == 0.0);
    assert!(!model.faces()[0].trimmed);
}

#[test]
fn a_hole_and_a_notch_are_cut() {
    let hole = |p: DVec3| DVec2::new(p.x - 7.0, p.y - 8.0).length() < 3.0;
    let small = |p: DVec3| DVec2::new(p.x - 13.0, p.y - 3.0).length() < 0.3;
    let notch = |p: DVec3| p.x > 15.0 && (p.y - 10.0).abs() < 2.0;
    let keep = |p| !hole(p) && !small(p) && !notch(p);
    let (trimming, model) = trimmed(&sheet(), &points(&sheet(), keep));
    assert_eq!(trimming.holes(), 1);
    // A circle, and a rectangle of 5 by 4, each about a spacing smaller all around; the surface is but gently bent.
    let expected = (std::f64::consts::PI * 9.0 + 20.0) / 320.0;
    assert!(
        (trimming.cut / expected - 1.0).abs() < 0.2,
        "{}",
        trimming.cut
    );
    let outer = &model.faces()[0].loops[0];
    // Six pieces of sides (one is cut in two), three of the notch.
    assert!(
        outer.uses.len() >= 6 && outer.uses.len() <= 9,
        "{}",
        outer.uses.len()
    );
    assert_eq!(model.faces()[0].loops[1].uses.len(), 1);
    // The surface is extended beyond all four sides, by two spacings at most, and the loops stay inside.
    let (before, behind) = (sheet().domain(), trimming.surface.domain());
    for (axis, length) in sheet().iso_lengths().into_iter().enumerate() {
        let ((a, b), (low, high)) = (before[axis], behind[axis]);
        for by in [a - low, high - b] {
            assert!(by > 0.0 && by * length <= 0.5 + 1e-12, "{by}");
        }
        for used in model.faces()[0].loops.iter().flat_map(|l| &l.uses) {
            let points = used.pcurve.control_points();
            assert!(points.iter().all(|p| p[axis] >= a && p[axis] <= b));
        }
    }
    // Within the old domain it is unchanged.
    for k in 0..=20 {
        let (u, v) = (f64::from(k) / 20.0, f64::from(k * k) / 400.0);
        let off = trimming.surface.point(u, v).distance(sheet().point(u, v));
        assert!(off < 1e-13, "{off}");
    }
}

#[test]
fn a_seam_makes_way_for_a_hole() {
    let tube = conic::cylinder(DVec3::ZERO, 20.0 * DVec3::Z, 4.0).unwrap();
    // Periodic, by fitting its points: a polygon of control points serves as well.
    let v = KnotVector::periodic(
        3,
        &(0..=12).map(|k| f64::from(k) / 12.0).collect::<Vec<_>>(),
    )
    .unwrap();
    let net = ControlNet::from_fn(4, 15, |i, j| {
        let a = std::f64::consts::TAU * (j % 12) as f64 / 12.0;
        DVec3::new(4.0 * a.cos(), 4.0 * a.sin(), 20.0 * i as f64 / 3.0)
    });
    let surface =
        NurbsSurface::new(KnotVector::uniform(3, 4).unwrap(), v, net.unwrap(), None).unwrap();
    assert_eq!(tube.is_rational(), !surface.is_rational());
    let seam = surface.point(0.5, 0.0);
    let keep = |p: DVec3| p.distance(seam) > 2.5;
    let (trimming, model) = trimmed(&surface, &points(&surface, keep));
    assert_eq!(trimming.holes(), 1);
    assert!(trimming.moved[1] > 0.0);
    // Two rims, a seam and the hole.
    assert_eq!(model.edges().len(), 4);
    assert!(!model.is_closed(&[0]));
}

#[test]
fn both_seams_of_a_ring_are_edges_of_their_own() {
    let ring = conic::torus(DVec3::ZERO, DVec3::Z, 6.0, 2.0).unwrap();
    let middle = ring.point(0.4, 0.6);
    let keep = |p: DVec3| p.distance(middle) > 2.8;
    let (trimming, model) = trimmed(&ring, &points(&ring, keep));
    assert_eq!(trimming.holes(), 1);
    // Two seams, each used twice, which share their only vertex.
    let seams = &model.faces()[0].loops[0].uses;
    assert_eq!(seams.len(), 4);
    for used in seams {
        let edge = &model.edges()[used.edge];
        assert_eq!(seams.iter().filter(|u| u.edge == used.edge).count(), 2);
        assert_eq!(edge.start, edge.end);
    }
}

/// A long sheet, flat but for its last columns of control points, (x, z), which lie so far apart along y.
fn with_rim(rim: &[[f64; 2]], apart: f64) -> NurbsSurface {
    let flat = (0..=30).map(|i| [2.0 * f64::from(i), 0.0]);
    let profile: Vec<[f64; 2]> = flat.chain(rim.iter().copied()).collect();
    let net = ControlNet::from_fn(profile.len(), 5, |i, j| {
        DVec3::new(profile[i][0], apart * j as f64, profile[i][1])
    });
    let knots = |n| KnotVector::uniform(3, n).unwrap();
    NurbsSurface::new(knots(profile.len()), knots(5), net.unwrap(), None).unwrap()
}

/// Kept places of a trimming on a grid, with their normals.
fn kept(trimming: &Trimming) -> Vec<DVec3> {
    let region = trimming.region().unwrap();
    let [(a, b), (c, d)] = trimming.surface.domain();
    let at = |k: usize, n: usize| (k as f64 + 0.5) / n as f64;
    let places = (0..2000 * 10).map(|k| {
        let (u, v) = (at(k % 2000, 2000), at(k / 2000, 10));
        DVec2::new(a + (b - a) * u, c + (d - c) * v)
    });
    let normal = |p: DVec2| {
        let at = trimming.surface.derivatives(p.x, p.y);
        at.du.cross(at.dv).normalize()
    };
    places.filter(|&p| region.contains(p)).map(normal).collect()
}

#[test]
fn a_rim_that_turns_under_the_scan_is_cut_off() {
    let surface = with_rim(&[[61.0, 0.0], [61.0, -0.2], [60.4, -0.3]], 5.0);
    // A flat mesh that faces up and covers the surface.
    let (m, n) = (122, 41);
    let points: Vec<DVec3> = (0..m * n)
        .map(|k| 0.5 * DVec3::new(f64::from(k % m), f64::from(k / m), 0.0))
        .collect();
    let cells = (0..(m - 1) * (n - 1)).map(|k| k / (m - 1) * m + k % (m - 1));
    let triangles: Vec<[u32; 3]> = cells
        .flat_map(|k| [[k, k + 1, k + m + 1], [k, k + m + 1, k + m]])
        .collect();
    let scan = Scanned {
        points: &points,
        triangles: Some(&triangles),
        is_mesh: true,
        feet: None,
        stays_closed: true,
        spacing: 0.5,
    };
    let trimming = trimming(&surface, &scan).unwrap();
    assert!(trimming.withdrawn > 1e-3 && trimming.withdrawn < 0.02);
    let turned = kept(&trimming).iter().filter(|n| n.z < 0.0).count();
    assert_eq!(turned, 0);
    // The flat part stays.
    assert!(trimming.cut < 0.03, "{}", trimming.cut);
}

/// A rim that turns back and passes through the surface: x and z of its control points.
const MEETING: [[f64; 2]; 5] = [
    [61.0, 0.0],
    [62.0, 0.0],
    [62.6, -0.5],
    [61.6, -0.6],
    [61.2, 0.4],
];

#[test]
fn crossings_of_a_part_are_those_of_the_whole_inside_it() {
    let surface = with_rim(&MEETING, 5.0);
    let [low, high] = surface.bounding_box();
    let diagonal = low.distance(high);
    let whole = crossings(&surface, diagonal, &|_| true);
    // Parts that end in the middle of what crosses, a little before and after it, and beside it.
    let places = whole.places();
    let middle = places.iter().sum::<DVec2>() / places.len() as f64;
    let first = places.iter().map(|p| p.x).fold(f64::INFINITY, f64::min);
    let span = surface.domain()[0].1 - surface.domain()[0].0;
    for part in -8..=8 {
        let end = first + f64::from(part) * 2e-3 * span;
        for keeps in
            [&|p: DVec2| p.x < end, &|p: DVec2| p.x > end] as [&(dyn Fn(DVec2) -> bool + Sync); 2]
        {
            let (searched, left) = (crossings(&surface, diagonal, keeps), whole.within(keeps));
            // A search sees all that is left, and may see a triangle of a cell that the border cuts.
            assert!(
                left.is_empty() || !searched.is_empty(),
                "{:?}",
                left.places()
            );
            assert!(left.places().iter().all(|p| places.contains(p)));
        }
    }
    let sides: [&(dyn Fn(DVec2) -> bool + Sync); 2] =
        [&|p| p.y < middle.y, &|p| p.x < 0.5 * middle.x];
    assert!(
        !whole.within(sides[0]).is_empty() && !crossings(&surface, diagonal, sides[0]).is_empty()
    );
    assert!(
        whole.within(sides[1]).is_empty() && crossings(&surface, diagonal, sides[1]).is_empty()
    );
    // The unit makes no difference.
    let inches = surface.map_points(|p| p / 25.4).unwrap();
    assert_eq!(
        crossings(&inches, diagonal / 25.4, &|_| true)
            .places()
            .len(),
        places.len()
    );
    // Models whose diagonal differs a little have the same chords, or both are looked at.
    for part in [0.97, 0.985, 1.015, 1.03] {
        assert!(!crossings(&surface, part * diagonal, &|_| true).is_empty());
    }
}

#[test]
fn a_rim_that_meets_the_surface_is_cut_off() {
    // Narrow: the places of a crossing are as far apart as the triangles that cross.
    let surface = with_rim(&MEETING, 0.25);
    let [low, high] = surface.bounding_box();
    let diagonal = low.distance(high);
    assert!(!crossings(&surface, diagonal, &|_| true).is_empty());
    let points = points(&surface, |_| true);
    let scan = Scanned {
        points: &points,
        triangles: None,
        is_mesh: false,
        feet: None,
        stays_closed: true,
        spacing: 0.25,
    };
    let nearest = scan.nearest();
    let as_it_is = trimming_near(&surface, &scan, &nearest, None).unwrap();
    assert!(!as_it_is.is_cut());
    let trimming = trimming_near(&surface, &scan, &nearest, Some(diagonal)).unwrap();
    assert!(trimming.is_cut() && trimming.crossings.is_empty());
    assert!(trimming.withdrawn > 0.0 && trimming.withdrawn <= CROSSING.most);
}

#[test]
fn feet_tell_a_surface_that_comes_back_from_the_scan() {
    // One turn and a half around a cylinder; the points make the first turn.
    let net = ControlNet::from_fn(60, 4, |i, j| {
        let angle = 3.0 * std::f64::consts::PI * i as f64 / 59.0;
        DVec3::new(5.0 * angle.cos(), 5.0 * angle.sin(), 4.0 * j as f64)
    });
    let knots = |n| KnotVector::uniform(3, n).unwrap();
    let surface = NurbsSurface::new(knots(60), knots(4), net.unwrap(), None).unwrap();
    let places: Vec<DVec2> = (0..=133)
        .flat_map(|i| (0..=48).map(move |j| DVec2::new(0.005 * f64::from(i), f64::from(j) / 48.0)))
        .collect();
    let points: Vec<DVec3> = places.iter().map(|p| surface.point(p.x, p.y)).collect();
    let cut = |feet: Option<&[DVec2]>| {
        let scan = Scanned {
            feet,
            ..Scanned::cloud(&points, 0.25)
        };
        let trimming = trimming(&surface, &scan).unwrap();
        let mut model = Model::new("");
        model.add_trimmed_surface(&trimming, 1e-9, 1e-5).unwrap();
        crate::mass::mass(&model).unwrap().area
    };
    let turn = std::f64::consts::TAU * 5.0 * 12.0;
    let [without, with] = [None, Some(&places[..])].map(|feet| cut(feet) / turn);
    assert!(
        (without - 1.5).abs() < 0.02 && (with - 1.0).abs() < 0.02,
        "{without} {with}"
    );
}

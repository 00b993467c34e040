use super::*;
use crate::mesh::range_grid::triangles_of_grid;
use crate::simulate::Random;
use std::collections::BTreeSet;

/// The distance along a ray at which it meets something.
type Thing = dyn Fn(DVec3, DVec3) -> Option<f64>;

/// What a camera at `eye` that looks along +y and down sees of some things, with noise along the rays.
fn seen(eye: DVec3, down: f64, things: &[&Thing], noise: f64) -> (Vec<DVec3>, GridLayout) {
    let (m, n) = (240_u32, 180_u32);
    let ahead = DVec3::new(0.0, down.cos(), -down.sin());
    let up = DVec3::X.cross(ahead);
    let mut random = Random::new(4);
    let (mut points, mut cells) = (Vec::new(), Vec::new());
    for j in 0..n {
        for i in 0..m {
            let x = (f64::from(i) - 119.5) / 240.0;
            let y = (f64::from(j) - 89.5) / 240.0;
            let ray = (ahead + DVec3::X * x + up * y).normalize();
            let met = things.iter().filter_map(|thing| thing(eye, ray));
            let nearest = met.fold(f64::INFINITY, f64::min);
            let number = u32::try_from(points.len()).unwrap();
            cells.push(nearest.is_finite().then_some(number));
            if nearest.is_finite() {
                points.push(eye + ray * (nearest + noise * random.normal()));
            }
        }
    }
    let grid = GridLayout {
        count_u: m as usize,
        count_v: n as usize,
        cells,
    };
    (points, grid)
}

fn table(from: DVec3, ray: DVec3) -> Option<f64> {
    let t = -from.z / ray.z;
    let p = from + ray * t;
    (t > 0.0 && p.x.abs() < 600.0 && p.y.abs() < 600.0).then_some(t)
}

/// An upright can of radius 60 and height 120.
fn can(from: DVec3, ray: DVec3) -> Option<f64> {
    let middle = DVec3::new(-150.0, 0.0, 0.0);
    let (o, d) = ((from - middle).truncate(), ray.truncate());
    let (a, b, c) = (d.dot(d), o.dot(d), o.dot(o) - 3600.0);
    let side = (b * b - a * c > 0.0).then(|| (-b - (b * b - a * c).sqrt()) / a);
    let side = side.filter(|t| (0.0..=120.0).contains(&(from.z + t * ray.z)));
    let lid = (120.0 - from.z) / ray.z;
    let lid = Some(lid).filter(|t| (o + d * *t).length() <= 60.0);
    side.into_iter().chain(lid).reduce(f64::min)
}

/// A box of 150 x 100 x 90.
fn brick(from: DVec3, ray: DVec3) -> Option<f64> {
    let [low, high] = [DVec3::new(80.0, -50.0, 0.0), DVec3::new(230.0, 50.0, 90.0)];
    let (a, b) = ((low - from) / ray, (high - from) / ray);
    let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
    (enter < leave && enter > 0.0).then_some(enter)
}

/// An angle: the table goes on in a wall.
fn wall(from: DVec3, ray: DVec3) -> Option<f64> {
    let t = (300.0 - from.y) / ray.y;
    let p = from + ray * t;
    (t > 0.0 && p.x.abs() < 600.0 && (0.0..400.0).contains(&p.z)).then_some(t)
}

const EYE: DVec3 = DVec3::new(0.0, -700.0, 600.0);

fn cut(things: &[&Thing], noise: f64) -> (Vec<DVec3>, Option<Scene>) {
    let (points, grid) = seen(EYE, 0.7, things, noise);
    let triangles = triangles_of_grid(&points, &grid);
    let scene = cut_at_feet(&points, &grid, &triangles, EYE);
    (points, scene)
}

/// The connected pieces of at least 200 points, as which thing each point is on.
fn pieces(points: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Vec<usize>> {
    let mut sets = DisjointSets::new(points.len());
    for t in triangles {
        sides(*t).into_iter().for_each(|(a, b)| sets.join(a, b));
    }
    let mut found: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    let used: BTreeSet<usize> = triangles.iter().flatten().map(|&k| k as usize).collect();
    for k in used {
        found.entry(sets.root(k)).or_default().push(k);
    }
    let mut found: Vec<Vec<usize>> = found.into_values().filter(|p| p.len() >= 200).collect();
    found.sort_by_key(|piece| std::cmp::Reverse(piece.len()));
    found
}

#[test]
fn a_can_and_a_box_on_a_table_are_three_pieces() {
    for noise in [0.0, 0.3, 1.0] {
        let (points, scene) = cut(&[&table, &can, &brick], noise);
        let scene = scene.unwrap();
        assert_eq!(scene.objects, 2, "noise {noise}");
        let found = pieces(&points, &scene.triangles);
        assert_eq!(found.len(), 3, "noise {noise}");
        // Of each nearly all points are on one thing.
        let on = |k: usize| match points[k] {
            p if p.z < 6.0 => 0,
            p if p.x < 0.0 => 1,
            _ => 2,
        };
        let mut things = BTreeSet::new();
        for piece in &found {
            let mut counts = [0_usize; 3];
            piece.iter().for_each(|&k| counts[on(k)] += 1);
            let most = (0..3).max_by_key(|&thing| counts[thing]).unwrap();
            assert!(
                counts[most] as f64 > 0.93 * piece.len() as f64,
                "noise {noise}: {counts:?}"
            );
            things.insert(most);
        }
        assert_eq!(things.len(), 3);
    }
}

#[test]
fn what_stands_on_nothing_is_no_scene() {
    for noise in [0.0, 0.3, 1.0] {
        assert_eq!(cut(&[&table], noise).1, None);
        assert_eq!(cut(&[&can], noise).1, None);
        // A valley from rim to rim, before which nothing hides.
        assert_eq!(cut(&[&table, &wall], noise).1, None);
    }
}

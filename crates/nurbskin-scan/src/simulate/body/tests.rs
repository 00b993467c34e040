//! Bodies against their exact surfaces.

use super::super::random::Random;
use super::mesh::mesh;
use super::surface::{Exact, ORIGIN};
use super::*;
use crate::Organisation;
use crate::mesh::repair::repair;
use glam::DVec3;
use nurbskin_geometry::progress::Silent;

fn triangles(simulated: &SimulatedBody) -> &[[u32; 3]] {
    match &simulated.scan.organisation {
        Organisation::Mesh(triangles) => triangles,
        _ => &[],
    }
}

fn made(body: Body, points: usize, layout: Layout) -> SimulatedBody {
    let options = BodyOptions {
        points: Some(points),
        layout,
        ..BodyOptions::default()
    };
    scan_body(body, &options).unwrap()
}

fn any(random: &mut Random) -> DVec3 {
    DVec3::new(random.normal(), random.normal(), random.normal())
}

#[test]
fn clouds_lie_on_the_surface() {
    for body in Body::ALL {
        assert_eq!(Body::from_name(&body.name().to_uppercase()), Some(body));
        let simulated = made(body, 1500, Layout::Cloud);
        assert_eq!(simulated.scan.points.len(), 1500);
        assert_eq!(simulated.scan.organisation, Organisation::Unordered);
        let truth = &simulated.truth;
        let [low, high] = Exact(body).bounds();
        for &point in &simulated.scan.points {
            assert!(
                truth.level(point).abs() <= 1e-9 * truth.diagonal(),
                "{body:?}"
            );
            assert!(truth.distance(point) <= 1e-9 * truth.diagonal(), "{body:?}");
            let within = (point - ORIGIN).clamp(low - 1e-9, high + 1e-9);
            assert_eq!(within, point - ORIGIN, "{body:?} leaves its box");
            assert!(point.min_element() >= 100.0 && point.max_element() < 1000.0);
        }
    }
}

#[test]
fn meshes_have_the_topology_of_their_body() {
    for body in Body::ALL {
        let other = if body.has_creases() {
            (Layout::Unaligned, 6000)
        } else {
            (Layout::Mesh, 9000)
        };
        for (layout, count) in [(Layout::Mesh, 6000), other] {
            let simulated = made(body, count, layout);
            let (points, truth) = (&simulated.scan.points, &simulated.truth);
            assert!(
                points.len().abs_diff(count) * 20 <= count,
                "{body:?} {}",
                points.len()
            );
            for &point in points {
                assert!(
                    truth.level(point).abs() <= 1e-9 * truth.diagonal(),
                    "{body:?}"
                );
            }
            // Nothing is repaired: the mesh is one oriented manifold.
            let repaired = repair(points, triangles(&simulated), &Silent).unwrap();
            assert!(repaired.left_out.is_empty(), "{body:?}");
            let manifold = repaired.manifold;
            assert_eq!(manifold.points.len(), points.len(), "{body:?}");
            assert_eq!(manifold.triangles.len(), triangles(&simulated).len());
            assert_eq!(manifold.loops.len(), body.borders(), "{body:?}");
            assert_eq!(manifold.genus(), body.genus(), "{body:?}");
            assert_eq!(manifold.euler_characteristic(), body.euler_characteristic());
            for triangle in triangles(&simulated) {
                let [a, b, c] = triangle.map(|k| points[k as usize]);
                let normal = (b - a).cross(c - a);
                assert!(
                    truth.normal((a + b + c) / 3.0).dot(normal) > 0.0,
                    "{body:?}"
                );
                let least = [(a, b, c), (b, c, a), (c, a, b)]
                    .map(|(a, b, c)| (b - a).angle_between(c - a).to_degrees())
                    .into_iter()
                    .fold(180.0, f64::min);
                assert!(least > 22.0, "{body:?} {layout:?} {least}");
            }
        }
    }
}

#[test]
fn the_tees_borders_are_exact_circles() {
    let simulated = made(Body::Tee, 8000, Layout::Mesh);
    let points = &simulated.scan.points;
    let manifold = repair(points, triangles(&simulated), &Silent)
        .unwrap()
        .manifold;
    for border in &manifold.loops {
        let end = |p: DVec3| {
            let at = Exact(Body::Tee)
                .ends()
                .iter()
                .map(|end| end.closest(p).distance(p));
            at.fold(f64::INFINITY, f64::min)
        };
        for &k in border {
            assert!(end(manifold.points[k as usize] - ORIGIN) < 1e-10);
        }
    }
    // Beyond an end, the border is the closest place.
    let beyond = ORIGIN + DVec3::new(80.0, 0.0, 25.0);
    let exact = 10.0_f64.hypot(5.0);
    assert!((simulated.truth.distance(beyond) - exact).abs() < 1e-10);
}

#[test]
fn the_brackets_mesh_follows_its_creases() {
    let simulated = made(Body::Bracket, 5000, Layout::Mesh);
    let points = &simulated.scan.points;
    // Exactly flat triangles on every plane: none cuts an edge. On the cylinders the middles lie off by the sagitta.
    let off = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|k| points[k as usize]);
        simulated.truth.distance((a + b + c) / 3.0)
    };
    let worst = triangles(&simulated).iter().map(off).fold(0.0, f64::max);
    let length = 2.5;
    assert!(worst < length * length / (8.0 * bracket::HOLE), "{worst}");
    let area: f64 = triangles(&simulated)
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|k| points[k as usize]);
            0.5 * (b - a).cross(c - a).length()
        })
        .sum();
    assert!(
        (area / bracket::area() - 1.0).abs() < 1e-3,
        "{area} {}",
        bracket::area()
    );
}

#[test]
fn distances_along_normals_and_against_brute_force() {
    let mut random = Random::new(5);
    for body in Body::ALL {
        let simulated = made(body, 30_000, Layout::Cloud);
        let (points, truth) = (&simulated.scan.points, &simulated.truth);
        for &point in points.iter().take(200) {
            let normal = truth.normal(point);
            for offset in [0.01, -0.01] {
                let off = point + offset * normal;
                let near_crease = body.has_creases() && truth.distance(off) < 0.009_999;
                // Beside an end of the tee, or an inner edge of the bracket, another place may be nearer.
                assert!(
                    (truth.signed_distance(off) - offset).abs() < 1e-9 || near_crease,
                    "{body:?}"
                );
            }
        }
        for k in 0..60 {
            let off = points[k] + 15.0 * any(&mut random);
            let foot = truth.closest_point(off);
            assert!(truth.level(foot).abs() < 1e-9);
            let brute = points
                .iter()
                .map(|p| p.distance(off))
                .fold(f64::INFINITY, f64::min);
            let distance = truth.distance(off);
            assert!(distance <= brute + 1e-9, "{body:?} {distance} {brute}");
            // A sample lies within about 2.5 mm of the foot.
            assert!(brute <= distance + 3.0, "{body:?} {distance} {brute}");
        }
    }
}

#[test]
fn clouds_are_even() {
    // Pappus: the area of the knot's tube is its circumference times the length of its axis.
    let steps = 20_000;
    let at = |k: usize| {
        let turn = k as f64 / steps as f64 * std::f64::consts::TAU;
        let r = 40.0 + 16.0 * (3.0 * turn).cos();
        DVec3::new(
            r * (2.0 * turn).cos(),
            r * (2.0 * turn).sin(),
            16.0 * (3.0 * turn).sin(),
        )
    };
    let length: f64 = (0..steps).map(|k| at(k).distance(at(k + 1))).sum();
    let area = std::f64::consts::TAU * knot::RADIUS * length;
    // The outer half of the hammer's peen end, radius 5, has its share of the points, by the area of a fine mesh.
    let areas = |body: Body, within: &dyn Fn(DVec3) -> bool| {
        let mesh = mesh(Exact(body), 60_000, true).unwrap();
        let mut sums = [0.0; 2];
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|k| mesh.points[k as usize]);
            let area = 0.5 * (b - a).cross(c - a).length();
            sums[usize::from(within((a + b + c) / 3.0))] += area;
        }
        sums
    };
    let [outside, inside] = areas(Body::Knot, &|p| p.z > 0.0);
    assert!(((outside + inside) / area - 1.0).abs() < 1e-3, "{area}");
    let tip = |p: DVec3| p.x < -55.0;
    let [rest, end] = areas(Body::Hammer, &tip);
    let points = made(Body::Hammer, 200_000, Layout::Cloud).scan.points;
    let drawn = points.iter().filter(|p| tip(**p - ORIGIN)).count() as f64;
    let expected = 200_000.0 * end / (rest + end);
    // Three standard deviations, and 1 % for the flat triangles.
    assert!(
        (drawn - expected).abs() < 3.0 * expected.sqrt() + 0.01 * expected,
        "{drawn} {expected}"
    );
}

#[test]
fn noise_outliers_holes_and_seeds() {
    for body in [Body::Mug, Body::Bracket] {
        for layout in [Layout::Cloud, Layout::Mesh] {
            let options = BodyOptions {
                points: Some(12_000),
                layout,
                noise: 0.05,
                outliers: 0.01,
                holes: 2,
                seed: 7,
            };
            let simulated = scan_body(body, &options).unwrap();
            let again = scan_body(body, &options).unwrap();
            assert_eq!(simulated.scan, again.scan);
            let other = BodyOptions { seed: 8, ..options };
            assert_ne!(simulated.scan, scan_body(body, &other).unwrap().scan);
            simulated.scan.validate().unwrap();
            let points = &simulated.scan.points;
            assert_eq!(points.len(), simulated.places.len());
            assert!(layout == Layout::Mesh || points.len() == 12_000);
            let mut thrown = vec![false; points.len()];
            simulated.outliers.iter().for_each(|&k| thrown[k] = true);
            let share = simulated.outliers.len() as f64 / points.len() as f64;
            assert!((share - 0.01).abs() < 1e-4);
            let (mut sum, mut square, mut count) = (0.0, 0.0, 0.0);
            for (k, (point, place)) in points.iter().zip(&simulated.places).enumerate() {
                if thrown[k] {
                    continue;
                }
                // At a sharp edge of a mesh, the noise is along the mean normal.
                let offset = (*point - *place)
                    .length()
                    .copysign(simulated.truth.level(*point));
                sum += offset;
                square += offset * offset;
                count += 1.0;
            }
            assert!((sum / count).abs() < 0.002, "{body:?} {}", sum / count);
            assert!(((square / count).sqrt() - 0.05).abs() < 0.002, "{body:?}");
        }
    }
}

#[test]
fn wrong_options_are_refused() {
    let refused = |options: BodyOptions| scan_body(Body::Mug, &options).unwrap_err().to_string();
    let few = BodyOptions {
        points: Some(100),
        layout: Layout::Mesh,
        ..BodyOptions::default()
    };
    assert!(refused(few).contains("too few for a mesh of the mug"));
    let noisy = BodyOptions {
        noise: f64::NAN,
        ..BodyOptions::default()
    };
    assert!(refused(noisy).contains("noise"));
}

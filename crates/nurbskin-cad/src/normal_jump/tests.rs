//! Known angles, and bounds against dense samples.

use super::*;
use crate::samples::{block, cube_network, glued, round_network, solid_cylinder, torus_network};
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::{ControlNet, KnotVector, NurbsSurface};
use proptest::prelude::*;

fn all(model: &Model) -> NormalJumps {
    normal_jumps(model, Meant::default())
}

fn close(one: f64, two: f64) {
    assert!((one - two).abs() < 1e-9, "{one} {two}");
}

/// Two bicubic patches on either side of x = 0 with these inner knots, of control points that `f` moves.
fn pair(knots: [&[f64]; 2], f: impl Fn(DVec3) -> DVec3) -> Model {
    let patch = |side: f64, inner: &[f64]| {
        let mut breaks = vec![0.0];
        breaks.extend(inner);
        breaks.push(1.0);
        let plain = KnotVector::uniform(3, 4).unwrap();
        let net = ControlNet::from_fn(4, 4, |i, j| {
            let (x, y) = (i as f64 / 3.0, j as f64 / 3.0);
            f(DVec3::new(side.min(0.0) + x, y, 0.0))
        });
        let surface = NurbsSurface::new(plain.clone(), plain, net.unwrap(), None).unwrap();
        surface.insert_knots(Direction::V, inner).unwrap()
    };
    let patches = [patch(-1.0, knots[0]), patch(1.0, knots[1])];
    let network = glued(patches.to_vec(), 1e-9);
    // The edge is that of the first patch; take its inner knots away again.
    let mut network = network;
    for edge in &mut network.edges {
        edge.curve = edge.curve.remove_knots(1e-10).unwrap().result;
    }
    network.to_model("pair").unwrap()
}

#[test]
fn planes_at_an_angle() {
    for degrees in [0.0, 1e-6, 0.3, 30.0, 89.0, 90.0, 91.0, 120.0, 179.0_f64] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let bend = |p: DVec3| {
            if p.x > 0.0 {
                DVec3::new(cos * p.x, p.y, sin * p.x)
            } else {
                p
            }
        };
        let jumps = all(&pair([&[0.5], &[0.25, 0.7]], bend));
        assert_eq!(jumps.edges.len(), 1);
        let edge = &jumps.edges[0];
        close(edge.sampled, degrees);
        close(edge.length, 1.0);
        let bound = edge.bound.unwrap();
        assert!(
            bound >= degrees && bound < degrees + 1e-9,
            "{bound} {degrees}"
        );
        let kind = if degrees < 5.0 {
            JoinKind::Smooth
        } else {
            JoinKind::Sharp
        };
        assert_eq!(edge.kind, kind);
        assert_eq!(jumps.summary.open, 6);
    }
}

#[test]
fn solids_have_right_angles() {
    let jumps = all(&block(DVec3::new(1.0, 2.0, 3.0)));
    assert_eq!([jumps.summary.smooth, jumps.summary.sharp], [0, 12]);
    for edge in &jumps.edges {
        close(edge.sampled, 90.0);
        close(edge.bound.unwrap(), 90.0);
    }
    // Rational, and trimmed by circles: samples only. The seam is smooth.
    let jumps = all(&solid_cylinder());
    assert_eq!([jumps.summary.smooth, jumps.summary.sharp], [1, 2]);
    assert_eq!(jumps.summary.bound, None);
    close(
        jumps.edges.iter().map(|e| e.sampled).fold(0.0, f64::max),
        90.0,
    );
    let jumps = all(&cube_network().to_model("").unwrap());
    assert_eq!(jumps.summary.sharp, 12);
    for edge in &jumps.edges {
        close(edge.bound.unwrap(), 90.0);
    }
}

#[test]
fn a_surface_cut_at_its_knots_is_smooth() {
    let model = torus_network([4, 3], 4, [30.0, 10.0]).to_model("").unwrap();
    let jumps = all(&model);
    assert_eq!(jumps.summary.smooth, 24);
    assert!(jumps.summary.max < 1e-10, "{:?}", jumps.summary);
    assert!(jumps.summary.bound.unwrap() < 1e-9, "{:?}", jumps.summary);
    // The meridians are about 63 long, four of them; the control polygons are a little inside.
    assert!(jumps.summary.length > 4.0 * 50.0);
}

/// The second row beyond the common edge is raised by h at one control point. Then `S_u` = (1, 0, 3 h B(v)) on one side and
/// (1, 0, 0) on the other, for a patch of length 1: the normals turn by atan(3 h B(v)).
#[test]
fn a_raised_control_point_turns_the_normal_as_computed() {
    for h in [1e-9, 1e-5, 1e-3, 0.02] {
        let raise = |p: DVec3| {
            let here = (p.x - 1.0 / 3.0).abs() < 1e-9 && (p.y - 1.0 / 3.0).abs() < 1e-9;
            if here { p + h * DVec3::Z } else { p }
        };
        let jumps = all(&pair([&[], &[0.5]], raise));
        // B_1 of degree 3 is largest at 1/3, where it is 4/9.
        let exact = (3.0 * h * 4.0 / 9.0_f64).atan().to_degrees();
        let edge = &jumps.edges[0];
        let bound = edge.bound.unwrap();
        assert!(bound >= exact * (1.0 - 1e-9), "{bound} {exact}");
        assert!(bound <= (1.05 * exact).max(0.011), "{bound} {exact}");
        assert!(
            edge.sampled <= exact * (1.0 + 1e-9) + 1e-12 && edge.sampled > 0.98 * exact - 1e-12
        );
        assert!((edge.place.y - 1.0 / 3.0).abs() < 0.1);
    }
}

#[test]
fn the_size_of_a_model_does_not_matter() {
    let network = round_network(1.0, 9);
    let sizes = [1e-120, 1e-9, 1.0, 1e9, 1e120];
    let found = sizes.map(|size| {
        let model = network.to_model("").unwrap();
        let jumps = all(&model.map_points(|p| p * size).unwrap());
        jumps.edges[0].bound.unwrap()
    });
    for bound in found {
        assert!((bound / found[2] - 1.0).abs() < 1e-9, "{found:?}");
    }
    // Numbers that overflow have the bound that is always true.
    let model = network.to_model("").unwrap();
    let jumps = all(&model.map_points(|p| p * 1e300).unwrap());
    assert!(jumps.edges.iter().all(|edge| edge.bound.unwrap() > 1.0));
}

#[test]
fn shares_and_quantiles_are_by_length() {
    let mut samples = [[0.2, 1.0], [0.6, 2.0], [0.05, 7.0]];
    close(quantile(&mut samples, 0.5), 0.05);
    close(quantile(&mut samples, 0.75), 0.2);
    close(quantile(&mut samples, 0.95), 0.6);
    close(quantile(&mut [], 0.5), 0.0);
    let model = round_network(20.0, 9).to_model("").unwrap();
    let kinds = vec![JoinKind::Smooth; 12];
    let jumps = normal_jumps(&model, Meant::Kinds(&kinds));
    let s = jumps.summary;
    assert_eq!(s.smooth, 12);
    assert!(s.over_tenth >= s.over_half && s.p95 <= s.p99 && s.p99 <= s.max);
    assert!(
        s.max <= s.bound.unwrap() && s.bound.unwrap() < 1.06 * s.max,
        "{s:?}"
    );
    let kinds = vec![JoinKind::Sharp; 12];
    assert_eq!(normal_jumps(&model, Meant::Kinds(&kinds)).summary.smooth, 0);
}

/// The largest angle among many samples.
fn dense(model: &Model, edge: &EdgeJump) -> f64 {
    let uses: Vec<_> = model
        .faces()
        .iter()
        .flat_map(|face| face.loops[0].uses.iter().map(move |used| (face, used)))
        .filter(|(_, used)| used.edge == edge.edge)
        .collect();
    (0..=2000).fold(0.0, |most: f64, k| {
        let normals = [0, 1].map(|i: usize| {
            let (face, used) = uses[i];
            let p = used.pcurve.point(f64::from(k) / 2000.0);
            let d = face.surface.derivatives(p.x, p.y);
            d.du.cross(d.dv)
        });
        let [n, m] = normals;
        most.max(n.cross(m).length().atan2(n.dot(m)).to_degrees())
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_sample_exceeds_the_bound(
        size in prop::sample::select(vec![1e-6, 1e-3, 0.02, 0.1, 0.3]),
        seeds in prop::collection::vec(-1.0..1.0_f64, 96),
        first in prop::collection::vec(0.05..0.95_f64, 0..3),
        second in prop::collection::vec(0.05..0.95_f64, 0..3),
        far in prop::sample::select(vec![0.0, 1e4]),
    ) {
        let sorted = |mut v: Vec<f64>| { v.sort_by(f64::total_cmp); v.dedup(); v };
        let (first, second) = (sorted(first), sorted(second));
        let shake = |p: DVec3| {
            let [x, y] = [3.0 * p.x + 3.0, 3.0 * p.y];
            let here = |k: &usize| {
                (x - (k / 4) as f64).abs() < 0.1 && (y - (k % 4) as f64).abs() < 0.1
            };
            let k = (0..28).find(here).unwrap_or(28);
            p + size * DVec3::new(seeds[3 * k], seeds[3 * k + 1], seeds[3 * k + 2]) + far * DVec3::X
        };
        let model = pair([&first, &second], shake);
        for edge in &all(&model).edges {
            let found = dense(&model, edge);
            let bound = edge.bound.unwrap();
            // Samples are rounded too: far from the origin by more.
            prop_assert!(found <= bound + 1e-7, "{} {}", found, bound);
            prop_assert!(bound <= (1.06 * found).max(0.011) || bound > 170.0, "{} {}", found, bound);
        }
    }
}

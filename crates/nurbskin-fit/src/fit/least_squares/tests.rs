use super::*;
use nurbskin_geometry::numeric::quadrature::gauss_legendre;
use nurbskin_geometry::nurbs::basis::basis_derivatives;
use proptest::prelude::*;

/// Knots of all kinds: clamped, unclamped, periodic, multiple, on any domain, with fewer spans than the degree.
fn spaces() -> Vec<[KnotVector; 2]> {
    let clamped = |p, b: &[f64]| KnotVector::clamped(p, b).unwrap();
    let periodic = |p, b: &[f64]| KnotVector::periodic(p, b).unwrap();
    let free = KnotVector::new(3, (-3..=8).map(f64::from).collect()).unwrap();
    vec![
        [
            clamped(3, &[0.0, 0.2, 0.5, 1.0]),
            clamped(2, &[0.0, 0.4, 0.6, 0.7, 1.0]),
        ],
        [
            clamped(3, &[-3.0, 0.0, 2.0, 7.0]),
            periodic(3, &[1.0, 1.2, 1.5, 1.8, 2.0, 2.5, 3.0, 3.5]),
        ],
        [
            periodic(2, &[0.0, 1.0, 2.0, 3.0, 5.0]),
            clamped(1, &[0.0, 1.0, 4.0]),
        ],
        [
            periodic(3, &[10.0, 10.5, 11.0, 12.0, 12.5]),
            periodic(2, &[-1.0, -0.5, 0.0, 0.7, 1.0]),
        ],
        [
            clamped(3, &[0.0, 0.3, 0.3, 0.6, 0.6, 0.6, 1.0]),
            clamped(2, &[0.0, 2.0, 2.0, 3.0]),
        ],
        [periodic(3, &[0.0, 0.2, 0.2, 0.5, 0.8, 0.8, 0.8, 1.0]), free],
        [periodic(3, &[0.0, 0.3, 1.0]), clamped(5, &[0.0, 1.0])],
        // Far from zero, and tiny.
        [
            clamped(3, &[100.0, 100.5, 101.0]),
            clamped(4, &[0.0, 1e-6, 2e-6]),
        ],
    ]
}

/// A number in 0..1.
fn part(k: usize, step: f64) -> f64 {
    ((k + 1) as f64 * step).fract()
}

/// n parameters that cover the domain evenly, its ends included.
fn places(knots: &[KnotVector; 2], n: usize) -> Vec<DVec2> {
    let place = |d: usize, part: f64| {
        let (a, b) = knots[d].domain();
        (a + part * (b - a)).min(b)
    };
    (0..n)
        .map(|k| match k {
            0 => DVec2::new(place(0, 0.0), place(1, 1.0)),
            1 => DVec2::new(place(0, 1.0), place(1, 0.0)),
            _ => DVec2::new(
                place(0, part(k, 0.754_877_666_246_692_8)),
                place(1, part(k, 0.569_840_290_998_053_3)),
            ),
        })
        .collect()
}

/// The stored (wrapped) net of distinct control points.
fn wrapped(knots: &[KnotVector; 2], distinct: &[DVec3]) -> Vec<DVec3> {
    let [m, n] = knots.each_ref().map(KnotVector::distinct_count);
    let [a, b] = knots.each_ref().map(KnotVector::control_point_count);
    (0..a * b)
        .map(|k| distinct[(k / a % n) * m + k % a % m])
        .collect()
}

/// A surface of these knots in a box of side 2 around a point.
fn example(knots: &[KnotVector; 2], middle: DVec3) -> NurbsSurface {
    let [m, n] = knots.each_ref().map(KnotVector::distinct_count);
    let distinct: Vec<DVec3> = (0..m * n).map(|k| middle + known(k)).collect();
    let [a, b] = knots.each_ref().map(KnotVector::control_point_count);
    let net = ControlNet::new(a, b, wrapped(knots, &distinct)).unwrap();
    let [ku, kv] = knots.clone();
    NurbsSurface::new(ku, kv, net, None).unwrap()
}

/// Points of a surface, `noise` off it.
fn scanned(surface: &NurbsSurface, places: &[DVec2], noise: f64) -> Vec<DVec3> {
    let places = places.iter().enumerate();
    places
        .map(|(k, t)| surface.point(t.x, t.y) + noise * known(7 * k))
        .collect()
}

fn weights(n: usize) -> Vec<f64> {
    (0..n)
        .map(|k| 3.0 * (part(k, 0.37) - 0.1).max(0.0))
        .collect()
}

/// Largest distance of control points.
fn apart(a: &NurbsSurface, b: &NurbsSurface) -> f64 {
    let [a, b] = [a, b].map(|s| s.control_points().points());
    assert_eq!(a.len(), b.len());
    let pairs = a.iter().zip(b);
    pairs.fold(0.0, |m: f64, (a, b)| m.max(a.distance(*b)))
}

/// Largest distance at the same places of the domain. Control points may lie further apart where ends are not clamped.
fn off(a: &NurbsSurface, b: &NurbsSurface) -> f64 {
    let [(u0, u1), (v0, v1)] = a.domain();
    let places =
        (0..=20).flat_map(|i| (0..=20).map(move |j| (f64::from(i) / 20.0, f64::from(j) / 20.0)));
    places.fold(0.0, |m: f64, (s, t)| {
        let (u, v) = (u0 + s * (u1 - u0), v0 + t * (v1 - v0));
        m.max(a.point(u, v).distance(b.point(u, v)))
    })
}

/// The least-squares solution of `rows x = right` by Householder reflections.
fn orthogonal(mut rows: Vec<Vec<f64>>, mut right: Vec<DVec3>) -> Vec<DVec3> {
    let n = rows[0].len();
    for j in 0..n {
        let length = rows[j..].iter().map(|r| r[j] * r[j]).sum::<f64>().sqrt();
        let mut v: Vec<f64> = rows[j..].iter().map(|r| r[j]).collect();
        v[0] += length.copysign(v[0]);
        let scale = 2.0 / v.iter().map(|x| x * x).sum::<f64>();
        for c in j..n {
            let dot: f64 = v.iter().zip(&rows[j..]).map(|(v, r)| v * r[c]).sum();
            for (v, r) in v.iter().zip(&mut rows[j..]) {
                r[c] -= scale * dot * v;
            }
        }
        let dot: DVec3 = v.iter().zip(&right[j..]).map(|(&v, &r)| v * r).sum();
        for (&v, r) in v.iter().zip(&mut right[j..]) {
            *r -= scale * v * dot;
        }
    }
    let mut x = vec![DVec3::ZERO; n];
    for i in (0..n).rev() {
        let known: DVec3 = (i + 1..n).map(|k| rows[i][k] * x[k]).sum();
        x[i] = (right[i] - known) / rows[i][i];
    }
    x
}

/// The derivative of orders (a, b) at a place as a row over the distinct control points.
fn row(knots: &[KnotVector; 2], t: DVec2, [a, b]: [usize; 2], factor: f64) -> Vec<f64> {
    let [m, n] = knots.each_ref().map(KnotVector::distinct_count);
    let [p, q] = knots.each_ref().map(KnotVector::degree);
    let (i, j) = (knots[0].span(t.x), knots[1].span(t.y));
    let (mut bu, mut bv) = (vec![0.0; 3 * (p + 1)], vec![0.0; 3 * (q + 1)]);
    basis_derivatives(&knots[0], i, t.x, 2, &mut bu);
    basis_derivatives(&knots[1], j, t.y, 2, &mut bv);
    let mut row = vec![0.0; m * n];
    for l in 0..=q {
        for k in 0..=p {
            row[(j - q + l) % n * m + (i - p + k) % m] +=
                factor * bu[a * (p + 1) + k] * bv[b * (q + 1) + l];
        }
    }
    row
}

/// The surface by orthogonal transformations of all rows, the energy as rows at Gauss points.
fn dense(
    points: &[DVec3],
    places: &[DVec2],
    weights: &[f64],
    knots: &[KnotVector; 2],
    smoothing: f64,
    size: [f64; 2],
) -> Vec<DVec3> {
    let total: f64 = weights.iter().sum();
    let mut rows = Vec::new();
    let mut right = Vec::new();
    for ((&x, &t), &w) in points.iter().zip(places).zip(weights) {
        let w = (w / total).sqrt();
        rows.push(row(knots, t, [0, 0], w));
        right.push(w * x);
    }
    if smoothing > 0.0 {
        let nodes = knots.each_ref().map(|knots| {
            let spans: Vec<[f64; 2]> = knots
                .breakpoints()
                .windows(2)
                .map(|w| [w[0], w[1]])
                .collect();
            let width = knots.domain().1 - knots.domain().0;
            let rule = gauss_legendre(knots.degree() + 1);
            let at = |[a, b]: [f64; 2], (x, w): (f64, f64)| {
                (0.5 * (a + b + x * (b - a)), 0.5 * w * (b - a) / width)
            };
            let all = spans
                .iter()
                .flat_map(|&s| rule.iter().map(move |&r| at(s, r)));
            all.collect::<Vec<_>>()
        });
        let rate = [0, 1].map(|d| (knots[d].domain().1 - knots[d].domain().0) / size[d]);
        for &(u, wu) in &nodes[0] {
            for &(v, wv) in &nodes[1] {
                let f = (smoothing * wu * wv).sqrt();
                let t = DVec2::new(u, v);
                rows.push(row(knots, t, [2, 0], f * rate[0] * rate[0]));
                rows.push(row(knots, t, [1, 1], f * 2_f64.sqrt() * rate[0] * rate[1]));
                rows.push(row(knots, t, [0, 2], f * rate[1] * rate[1]));
                right.extend([DVec3::ZERO; 3]);
            }
        }
    }
    wrapped(knots, &orthogonal(rows, right))
}

#[test]
fn it_is_what_orthogonal_transformations_give() {
    for (number, knots) in spaces().into_iter().enumerate() {
        let places = places(&knots, 400);
        let points = scanned(&example(&knots, DVec3::splat(3.0)), &places, 0.3);
        let weights = weights(points.len());
        for (smoothing, size) in [(0.0, [1.0, 1.0]), (1e-3, [2.0, 1.5]), (10.0, [1.0, 3.0])] {
            let truth = dense(&points, &places, &weights, &knots, smoothing, size);
            let [ku, kv] = knots.clone();
            let fit = least_squares(&points, &places, Some(&weights), ku, kv, smoothing, size);
            let fit = fit.unwrap();
            let [ku, kv] = knots.clone();
            let [m, n] = [&ku, &kv].map(KnotVector::control_point_count);
            let net = ControlNet::new(m, n, truth).unwrap();
            let truth = NurbsSurface::new(ku, kv, net, None).unwrap();
            let error = [off(&fit.surface, &truth), apart(&fit.surface, &truth)];
            assert!(
                error.into_iter().all(|e| e < 1e-11),
                "{number} {smoothing}: {error:?}"
            );
            assert!(fit.equation_residual < 1e-10);
        }
    }
}

#[test]
fn surfaces_of_the_same_knots_come_back() {
    for (number, knots) in spaces().into_iter().enumerate() {
        let places = places(&knots, 1500);
        for (middle, close) in [(DVec3::ZERO, 1e-12), (DVec3::new(1e6, -5e5, 8e5), 1e-9)] {
            let truth = example(&knots, middle);
            let points = scanned(&truth, &places, 0.0);
            let [ku, kv] = knots.clone();
            let mut sums = NormalSums::new(ku, kv, middle + DVec3::X).unwrap();
            sums.add(&points, &places, None).unwrap();
            let fit = sums.solve(0.0, [1.0, 1.0]).unwrap();
            let error = off(&fit.surface, &truth);
            assert!(error < close, "{number}: {error:e}");
            assert!(fit.rms < fit.rms_resolution && fit.rms_resolution < 1e-6);
            assert_eq!(
                [fit.surface.knots_u(), fit.surface.knots_v()],
                knots.each_ref()
            );
            assert_eq!(sums.count(), 1500);
        }
    }
}

#[test]
fn the_root_mean_square_is_that_of_the_distances() {
    for (knots, noise) in spaces()
        .into_iter()
        .zip([0.1, 1e-3, 1e-5, 0.5].into_iter().cycle())
    {
        let places = places(&knots, 2000);
        let points = scanned(&example(&knots, DVec3::splat(100.0)), &places, noise);
        let weights = weights(points.len());
        let [low, high] = bounding_box(&points);
        let origin = 0.5 * (low + high);
        for smoothing in [0.0, 1e-4] {
            let some = Some(weights.as_slice());
            let [ku, kv] = knots.clone();
            let fit = least_squares(&points, &places, some, ku, kv, smoothing, [3.0, 2.0]);
            let fit = fit.unwrap();
            let (mut sum, mut total) = (0.0, 0.0);
            for ((x, t), w) in points.iter().zip(&places).zip(&weights) {
                sum += w * x.distance_squared(fit.surface.point(t.x, t.y));
                total += w;
            }
            let rms = (sum / total).sqrt();
            assert!(
                (fit.rms - rms).abs() < fit.rms_resolution,
                "{} {rms}",
                fit.rms
            );
            assert!(rms > 10.0 * fit.rms_resolution);
            // That of sums: what the resolution promises of squares.
            let mut sums = NormalSums::new(knots[0].clone(), knots[1].clone(), origin).unwrap();
            sums.add(&points, &places, some).unwrap();
            let of_sums = sums.solve(smoothing, [3.0, 2.0]).unwrap();
            let error = (of_sums.rms.powi(2) - rms.powi(2)).abs();
            assert!(
                error < of_sums.rms_resolution.powi(2),
                "{} {rms}",
                of_sums.rms
            );
        }
    }
}

fn some_sums(knots: &[KnotVector; 2]) -> NormalSums {
    let [ku, kv] = knots.clone();
    NormalSums::new(ku, kv, DVec3::ONE).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    /// However the points are cut, whatever is empty, in whichever order sums are merged or travel.
    #[test]
    fn chunks_add_up(
        space in 0..8_usize,
        cuts in prop::collection::vec(0..3000_usize, 0..12),
        rotate in 0..12_usize,
    ) {
        let knots = &spaces()[space];
        let places = places(knots, 3000);
        let points = scanned(&example(knots, DVec3::ZERO), &places, 0.2);
        let weights = weights(points.len());
        let mut all = some_sums(knots);
        all.add(&points, &places, Some(&weights)).unwrap();
        let mut cuts = [cuts, vec![0, 3000]].concat();
        cuts.sort_unstable();
        let mut chunks: Vec<_> = cuts.windows(2).map(|w| w[0]..w[1]).collect();
        let turn = rotate % chunks.len();
        chunks.rotate_left(turn);
        let (mut added, mut merged) = (some_sums(knots), some_sums(knots));
        for chunk in chunks {
            let weights = Some(&weights[chunk.clone()]);
            let (points, places) = (&points[chunk.clone()], &places[chunk]);
            added.add(points, places, weights).unwrap();
            let mut some = some_sums(knots);
            some.add(points, places, weights).unwrap();
            let [ku, kv] = knots.clone();
            let some = NormalSums::from_values(ku, kv, DVec3::ONE, some.values().to_vec()).unwrap();
            merged.merge(&some).unwrap();
        }
        let truth = all.solve(1e-6, [1.0, 1.0]).unwrap();
        for sums in [added, merged] {
            prop_assert_eq!(sums.count(), 3000);
            prop_assert!((sums.weight() - all.weight()).abs() < 1e-12 * all.weight());
            for (a, b) in sums.values().iter().zip(all.values()) {
                prop_assert!((a - b).abs() < 1e-12 * all.weight());
            }
            let fit = sums.solve(1e-6, [1.0, 1.0]).unwrap();
            prop_assert!(apart(&fit.surface, &truth.surface) < 2e-12);
            prop_assert!((fit.rms - truth.rms).abs() < 1e-12);
        }
    }
}

#[test]
fn sums_travel_without_loss() {
    for knots in spaces() {
        let places = places(&knots, 500);
        let mut sums = some_sums(&knots);
        sums.add(
            &scanned(&example(&knots, DVec3::ZERO), &places, 0.1),
            &places,
            None,
        )
        .unwrap();
        let [ku, kv] = knots.clone();
        let back = NormalSums::from_values(ku, kv, sums.origin(), sums.values().to_vec()).unwrap();
        assert_eq!(back.values(), sums.values());
        let [a, b] = [&sums, &back].map(|s| s.solve(0.1, [1.0, 2.0]).unwrap());
        assert_eq!(a.surface, b.surface);
        assert_eq!(a.rms.to_bits(), b.rms.to_bits());
    }
}

/// Several blocks of points, cells of many and of few, one cell of all.
#[test]
fn sums_do_not_depend_on_the_number_of_threads() {
    let even = |n| KnotVector::uniform(3, n).unwrap();
    for knots in [[even(40), even(60)], [even(4), even(5)]] {
        let places = places(&knots, 150_000);
        let points: Vec<DVec3> = places.iter().map(|t| t.extend(t.x * t.y)).collect();
        let weights = weights(points.len());
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let sums = || {
                let mut sums = some_sums(&knots);
                sums.add(&points, &places, Some(&weights)).unwrap();
                sums.values()
                    .iter()
                    .map(|x| x.to_bits())
                    .collect::<Vec<_>>()
            };
            pool.build().unwrap().install(sums)
        };
        let one = with(1);
        for threads in [2, 3] {
            assert!(one == with(threads), "{threads} threads");
        }
    }
}

#[test]
fn what_cannot_be_added_is_refused_as_a_whole() {
    let knots = [
        KnotVector::uniform(3, 6).unwrap(),
        KnotVector::periodic(2, &[1.0, 2.0, 3.0, 5.0]).unwrap(),
    ];
    let mut sums = some_sums(&knots);
    let (x, t) = ([DVec3::X; 2], [DVec2::new(0.5, 1.5); 2]);
    let says = |result: Result<()>, what: &str| {
        let Err(Error::Invalid(text)) = result else {
            panic!("{what}: {result:?}")
        };
        assert!(text.contains(what), "{text}");
    };
    says(
        sums.add(&x, &t[1..], None),
        "2 points come with 1 parameters",
    );
    says(
        sums.add(&x, &t, Some(&[1.0])),
        "2 points come with 1 weights",
    );
    says(
        sums.add(&x, &t, Some(&[1.0, -1.0])),
        "weight of point 1 is -1",
    );
    says(
        sums.add(&x, &t, Some(&[f64::NAN, 1.0])),
        "weight of point 0 is NaN",
    );
    says(
        sums.add(&[x[0], DVec3::NAN], &t, None),
        "point 1 is not finite",
    );
    for bad in [
        [1.1, 1.5],
        [-0.1, 1.5],
        [0.5, 0.9],
        [0.5, 5.1],
        [f64::NAN, 1.5],
    ] {
        says(
            sums.add(&x, &[t[0], bad.into()], None),
            "of point 1 lie outside the domain",
        );
    }
    assert!(sums.count() == 0 && sums.values().iter().all(|&x| x == 0.0));
    let [ku, kv] = knots;
    let made = |ku: &KnotVector, kv: &KnotVector, at| NormalSums::new(ku.clone(), kv.clone(), at);
    says(made(&ku, &kv, DVec3::INFINITY).map(drop), "origin");
    says(
        sums.merge(&made(&kv, &ku, DVec3::ONE).unwrap()),
        "different knots",
    );
    says(
        sums.merge(&made(&ku, &kv, DVec3::ZERO).unwrap()),
        "different origins",
    );
    let back = |values: Vec<f64>| {
        NormalSums::from_values(ku.clone(), kv.clone(), DVec3::ONE, values).map(drop)
    };
    let values = sums.values();
    back(values.to_vec()).unwrap();
    says(back(values[1..].to_vec()), "cannot be sums on these knots");
    let with = |k: usize, x: f64| {
        let mut values = values.to_vec();
        values[k] = x;
        back(values)
    };
    says(with(3, f64::NAN), "value 3");
    says(with(0, -1.0), "negative");
    says(with(values.len() - 1, -1.0), "negative");
    says(sums.solve(-1.0, [1.0; 2]).map(drop), "smoothing");
    says(sums.solve(f64::NAN, [1.0; 2]).map(drop), "smoothing");
    says(sums.solve(1.0, [1.0, 0.0]).map(drop), "lengths");
    let uniform = |n| KnotVector::uniform(25, n).unwrap();
    says(
        made(&uniform(4000), &uniform(4000), DVec3::ZERO).map(drop),
        "8 GB",
    );
    let call = least_squares(
        &[DVec3::NAN],
        &t[1..],
        None,
        ku.clone(),
        kv.clone(),
        0.0,
        [1.0; 2],
    );
    says(call.map(drop), "point 0 is not finite");
}

#[test]
fn what_points_leave_open_is_refused() {
    let knots = [
        KnotVector::uniform(3, 8).unwrap(),
        KnotVector::uniform(2, 9).unwrap(),
    ];
    let truth = example(&knots, DVec3::ZERO);
    let solve = |places: &[DVec2], smoothing: f64| {
        let mut sums = some_sums(&knots);
        sums.add(&scanned(&truth, places, 0.1), places, None)
            .unwrap();
        sums.solve(smoothing, [1.0, 1.0])
    };
    let says = |result: Result<LeastSquares>, what: &str| match result {
        Err(Error::NoSolution(text)) => assert!(text.contains(what), "{text}"),
        other => panic!("{what}: {:?}", other.map(|fit| fit.rms)),
    };
    let all = places(&knots, 1000);
    says(solve(&[], 1.0), "without points");
    solve(&all, 0.0).unwrap();
    // A span without points.
    let gap: Vec<DVec2> = all.iter().copied().filter(|t| t.x < 0.79).collect();
    says(
        solve(&gap, 0.0),
        "9 of 72 control points have no point in their reach",
    );
    solve(&gap, 1e-6).unwrap();
    // One within: what is on both sides of it still determines all.
    let inner: Vec<DVec2> = all
        .iter()
        .copied()
        .filter(|t| (t.x - 0.5).abs() > 0.11)
        .collect();
    solve(&inner, 0.0).unwrap();
    // Few lines, fewer points, one line, one point.
    let lines: Vec<DVec2> = all
        .iter()
        .map(|t| DVec2::new((7.0 * t.x).floor() / 6.5, t.y))
        .collect();
    says(solve(&lines[2..], 0.0), "do not determine");
    solve(&lines[2..], 1e-6).unwrap();
    says(solve(&all[..60], 0.0), "do not determine");
    solve(&all[..60], 1e-6).unwrap();
    let line: Vec<DVec2> = all.iter().map(|t| DVec2::new(t.y, t.y)).collect();
    says(solve(&line, 1e-6), "do not determine");
    says(solve(&all[2..3], 1e-6), "do not determine");
    // Weights of 0 count as no points.
    let mut sums = some_sums(&knots);
    let none = vec![0.0; all.len()];
    sums.add(&scanned(&truth, &all, 0.0), &all, Some(&none))
        .unwrap();
    assert_eq!((sums.count(), sums.weight()), (1000, 0.0));
    says(sums.solve(1.0, [1.0, 1.0]), "without points");
}

/// The digits that high degrees take from the normal equations, until they are refused.
#[test]
fn high_degrees_are_right_or_refused() {
    for p in [5, 8, 12, 16, 25] {
        let knots = [p, p].map(|p| KnotVector::uniform(p, p + 1).unwrap());
        let places = places(&knots, 4000);
        let truth = example(&knots, DVec3::ZERO);
        let [ku, kv] = knots;
        let fit = least_squares(
            &scanned(&truth, &places, 0.0),
            &places,
            None,
            ku,
            kv,
            0.0,
            [1.0; 2],
        );
        match fit {
            Ok(fit) => assert!(p < 12 && apart(&fit.surface, &truth) < 1e-5),
            Err(Error::NoSolution(_)) => assert!(p > 8),
            Err(other) => panic!("{other}"),
        }
    }
}

//! Curves and surfaces: other forms of the same geometry, invariances, derivatives.

#![expect(clippy::unwrap_used, reason = "a panic is how a test fails")]

use nurbskin::nurbs::basis::{basis_derivatives, basis_functions};
use nurbskin::nurbs::tessellate::tessellate;
use nurbskin::nurbs::{Direction, bezier};
use nurbskin::{ControlNet, DVec3, KnotVector, NurbsCurve, NurbsSurface};
use proptest::prelude::*;

/// A reproducible source of numbers.
struct Random(u64);

impl Random {
    /// In [0, 1).
    fn unit(&mut self) -> f64 {
        // SplitMix64.
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn below(&mut self, count: usize) -> usize {
        (0..count)
            .min_by_key(|_| (self.unit() * 1e9).to_bits())
            .unwrap_or(0)
    }
    fn point(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }
    fn inside(&mut self, (a, b): (f64, f64)) -> f64 {
        a + self.unit() * (b - a)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Ends {
    Clamped,
    Unclamped,
    Periodic,
}

#[derive(Clone, Copy, Debug)]
struct Shape {
    degree: usize,
    spans: usize,
    ends: Ends,
}

fn shape() -> impl Strategy<Value = Shape> {
    let ends = prop_oneof![
        Just(Ends::Clamped),
        Just(Ends::Unclamped),
        Just(Ends::Periodic)
    ];
    (1_usize..=7, 1_usize..=5, ends).prop_map(|(degree, spans, ends)| Shape {
        degree,
        spans,
        ends,
    })
}

/// Random knots with multiplicities up to the degree.
fn knots(shape: Shape, random: &mut Random) -> KnotVector {
    let Shape {
        degree,
        spans,
        ends,
    } = shape;
    let mut t = random.unit() - 0.5;
    let mut list = vec![t];
    for k in 0..spans {
        t += 0.05 + random.unit();
        let copies = if k + 1 == spans {
            1
        } else {
            1 + random.below(degree)
        };
        list.extend(std::iter::repeat_n(t, copies));
    }
    match ends {
        Ends::Clamped => KnotVector::clamped(degree, &list),
        Ends::Periodic => KnotVector::periodic(degree, &list),
        Ends::Unclamped => {
            let mut low = list[0];
            let mut high = t;
            for _ in 0..degree {
                low -= random.unit();
                high += random.unit();
                list.insert(0, low);
                list.push(high);
            }
            KnotVector::new(degree, list)
        }
    }
    .unwrap()
}

fn curve(shape: Shape, rational: bool, random: &mut Random) -> NurbsCurve {
    let knots = knots(shape, random);
    let (count, distinct) = (knots.control_point_count(), knots.distinct_count());
    let mut points: Vec<_> = (0..distinct).map(|_| random.point()).collect();
    let mut weights: Vec<_> = (0..distinct).map(|_| 0.2 + 3.0 * random.unit()).collect();
    for i in distinct..count {
        points.push(points[i % distinct]);
        weights.push(weights[i % distinct]);
    }
    NurbsCurve::new(knots, points, rational.then_some(weights)).unwrap()
}

fn surface(u: Shape, v: Shape, rational: bool, random: &mut Random) -> NurbsSurface {
    let (knots_u, knots_v) = (knots(u, random), knots(v, random));
    let [m, n] = [knots_u.control_point_count(), knots_v.control_point_count()];
    let [du, dv] = [knots_u.distinct_count(), knots_v.distinct_count()];
    let values: Vec<_> = (0..du * dv)
        .map(|_| (random.point(), 0.2 + 3.0 * random.unit()))
        .collect();
    let at = |i: usize, j: usize| values[(j % dv) * du + i % du];
    let net = ControlNet::from_fn(m, n, |i, j| at(i, j).0).unwrap();
    let weights = (0..n)
        .flat_map(|j| (0..m).map(move |i| at(i, j).1))
        .collect();
    NurbsSurface::new(knots_u, knots_v, net, rational.then_some(weights)).unwrap()
}

/// Parameters inside every span, the knots themselves and the ends.
fn parameters(knots: &KnotVector) -> Vec<f64> {
    let breaks = knots.breakpoints();
    let inner = breaks
        .windows(2)
        .flat_map(|w| [0.1, 0.5, 0.83].map(|s| w[0] + s * (w[1] - w[0])));
    let mut list: Vec<_> = inner.chain(breaks.iter().copied()).collect();
    list.sort_by(f64::total_cmp);
    list
}

/// Largest distance of two curves over the domain of the second.
fn curve_gap(a: &NurbsCurve, b: &NurbsCurve) -> f64 {
    let ts = parameters(b.knots());
    ts.iter()
        .map(|&t| a.point(t).distance(b.point(t)))
        .fold(0.0, f64::max)
}

/// Largest distance of two surfaces over the domain of the second.
fn surface_gap(a: &NurbsSurface, b: &NurbsSurface) -> f64 {
    let (us, vs) = (parameters(b.knots_u()), parameters(b.knots_v()));
    let gap = |u: f64, v: f64| a.point(u, v).distance(b.point(u, v));
    us.iter()
        .flat_map(|&u| vs.iter().map(move |&v| gap(u, v)))
        .fold(0.0, f64::max)
}

/// Knots that may be inserted: each new or one copy more, never above the degree.
fn insertable(knots: &KnotVector, random: &mut Random) -> Vec<f64> {
    let mut list = vec![random.inside(knots.domain())];
    list.push(list[0]);
    list.truncate(knots.degree());
    let breaks = knots.breakpoints();
    let inner = &breaks[1..breaks.len() - 1];
    list.extend(
        inner
            .iter()
            .filter(|&&t| knots.multiplicity(t) < knots.degree()),
    );
    if !knots.is_clamped() && knots.degree() > 1 {
        list.push(breaks[0]);
    }
    list
}

/// N_{i,p}(u) as defined, eq. (2.5) of The NURBS Book, on the span the library chose.
fn cox_de_boor(knots: &[f64], span: usize, i: usize, p: usize, u: f64) -> f64 {
    if p == 0 {
        return if i == span { 1.0 } else { 0.0 };
    }
    let part = |numerator: f64, denominator: f64, i: usize| {
        if denominator > 0.0 {
            numerator / denominator * cox_de_boor(knots, span, i, p - 1, u)
        } else {
            0.0
        }
    };
    part(u - knots[i], knots[i + p] - knots[i], i)
        + part(knots[i + p + 1] - u, knots[i + p + 1] - knots[i + 1], i + 1)
}

/// De Boor's algorithm: repeated convex combination of control points.
fn de_boor(curve: &NurbsCurve, t: f64) -> DVec3 {
    let (knots, p) = (curve.knots().knots(), curve.knots().degree());
    let span = curve.knots().span(t);
    let mut d: Vec<_> = (0..=p).map(|j| curve.homogeneous(span - p + j)).collect();
    for r in 1..=p {
        for j in (r..=p).rev() {
            let low = knots[span - p + j];
            let a = (t - low) / (knots[span + 1 + j - r] - low);
            d[j] = (1.0 - a) * d[j - 1] + a * d[j];
        }
    }
    d[p].truncate() / d[p].w
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn basis_functions_are_a_positive_partition_of_unity(shape in shape(), seed: u64) {
        let knots = knots(shape, &mut Random(seed));
        let p = knots.degree();
        let (mut basis, mut table) = ([0.0; 26], [0.0; 4 * 26]);
        for t in parameters(&knots) {
            let span = knots.span(t);
            basis_functions(&knots, span, t, &mut basis);
            basis_derivatives(&knots, span, t, 3, &mut table);
            prop_assert!(basis[..=p].iter().all(|&b| b >= 0.0));
            prop_assert!((basis[..=p].iter().sum::<f64>() - 1.0).abs() < 1e-14);
            for k in 0..=3 {
                let row = &table[k * (p + 1)..(k + 1) * (p + 1)];
                let size = row.iter().map(|d| d.abs()).fold(1.0, f64::max);
                let sum = row.iter().sum::<f64>() - if k == 0 { 1.0 } else { 0.0 };
                prop_assert!(sum.abs() < 1e-14 * size, "order {k}: {sum} of {size}");
            }
            for (j, &b) in basis[..=p].iter().enumerate() {
                let naive = cox_de_boor(knots.knots(), span, span - p + j, p, t);
                prop_assert!((naive - b).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn curve_algorithms_agree(shape in shape(), rational: bool, seed: u64) {
        let curve = curve(shape, rational, &mut Random(seed));
        for t in parameters(curve.knots()) {
            prop_assert!(curve.point(t).distance(de_boor(&curve, t)) < 1e-13);
        }
        let pieces = bezier::curve_pieces(&curve).unwrap();
        for piece in &pieces {
            let [left, right] = piece.split(0.3);
            for s in [0.0, 0.25, 0.5, 1.0] {
                let t = piece.range.0 + s * (piece.range.1 - piece.range.0);
                prop_assert!(curve.point(t).distance(piece.point(s)) < 1e-13);
                prop_assert!(left.point(s).distance(piece.point(0.3 * s)) < 1e-13);
                prop_assert!(right.point(s).distance(piece.point(0.3 + 0.7 * s)) < 1e-13);
            }
        }
        prop_assert_eq!(pieces.len(), curve.knots().breakpoints().len() - 1);
    }

    #[test]
    fn curve_stays_the_same(shape in shape(), rational: bool, seed: u64) {
        let mut random = Random(seed);
        let curve = curve(shape, rational, &mut random);
        let (a, b) = curve.domain();
        let inserted = insertable(curve.knots(), &mut random);
        let finer = curve.insert_knots(&inserted).unwrap();
        prop_assert!(curve_gap(&curve, &finer) < 1e-13);
        prop_assert_eq!(finer.knots().is_periodic(), curve.knots().is_periodic());
        let higher = curve.elevate(2).unwrap();
        prop_assert!(curve_gap(&curve, &higher) < 1e-13);
        prop_assert_eq!(higher.knots().degree(), shape.degree + 2);
        let clamped = curve.clamped().unwrap();
        prop_assert!(clamped.knots().is_clamped() && !clamped.knots().is_periodic());
        prop_assert!(curve_gap(&curve, &clamped) < 1e-13);
        if shape.ends == Ends::Periodic {
            prop_assert!(clamped.point(a).distance(clamped.point(b)) < 1e-13);
            let t = random.inside((a, b));
            let turn = curve.segment(t, t + (b - a)).unwrap();
            prop_assert!(curve_gap(&curve, &turn) < 1e-12);
        }
        for part in curve.split(random.inside((a + 1e-3, b))).unwrap() {
            prop_assert!(curve_gap(&curve, &part) < 1e-13);
            prop_assert!(part.knots().is_clamped());
        }
        let back = curve.reversed().unwrap();
        for t in parameters(curve.knots()) {
            prop_assert!(curve.point(t).distance(back.point(a + b - t)) < 1e-12);
        }
    }

    /// Control points in other forms are convex combinations, whatever the knots: they stay in the box.
    #[test]
    fn wild_knots_do_no_harm(degree in 1_usize..=24, spans in 1_usize..=6, seed: u64, periodic: bool) {
        let mut random = Random(seed);
        let mut list = vec![1e3 * random.unit()];
        for _ in 0..spans {
            let gap = 10.0_f64.powf(-9.0 * random.unit());
            list.push(list[list.len() - 1] + gap);
        }
        let knots = if periodic {
            KnotVector::periodic(degree, &list).unwrap()
        } else {
            KnotVector::clamped(degree, &list).unwrap()
        };
        let count = knots.distinct_count();
        let distinct: Vec<_> = (0..count).map(|_| random.point()).collect();
        let points = (0..knots.control_point_count()).map(|i| distinct[i % count]).collect();
        let curve = NurbsCurve::new(knots, points, None).unwrap();
        let (a, b) = curve.domain();
        let t = random.inside((a, b)).clamp(list[0], list[spans]);
        let mut forms = vec![
            curve.insert_knots(&[t]).unwrap(),
            curve.elevate(1).unwrap(),
            curve.clamped().unwrap(),
        ];
        if t > a && t < b {
            forms.extend(curve.split(t).unwrap());
        }
        for form in forms {
            let inside = form.control_points().iter().all(|p| p.abs().max_element() <= 1.0 + 1e-13);
            prop_assert!(inside, "{:?}", form.knots());
            prop_assert!(curve_gap(&curve, &form) < 1e-12, "{}", curve_gap(&curve, &form));
        }
        let removal = curve.remove_knots(0.5).unwrap();
        prop_assert!(curve_gap(&curve, &removal.result) <= removal.bound + 1e-12);
    }

    #[test]
    fn inserted_knots_can_be_removed(shape in shape(), rational: bool, seed: u64) {
        let mut random = Random(seed);
        let curve = curve(shape, rational, &mut random);
        let inserted = insertable(curve.knots(), &mut random);
        let finer = curve.insert_knots(&inserted).unwrap();
        let removal = finer.remove_knots(1e-11).unwrap();
        prop_assert!(removal.bound <= 1e-11);
        prop_assert!(curve_gap(&finer, &removal.result) <= removal.bound + 1e-13);
        // Periodic directions keep the seam and enough knots; an unclamped end keeps its knots.
        if shape.ends == Ends::Clamped {
            prop_assert!(removal.removed.len() >= inserted.len());
        }
    }

    #[test]
    fn removal_stays_within_its_bound(shape in shape(), rational: bool, seed: u64, log in -3.0..1.0_f64) {
        let mut random = Random(seed);
        let curve = curve(Shape { spans: shape.spans * 3, ..shape }, rational, &mut random);
        let tolerance = 10.0_f64.powf(log);
        let removal = curve.remove_knots(tolerance).unwrap();
        let gap = curve_gap(&curve, &removal.result);
        prop_assert!(removal.bound <= tolerance * (1.0 + 1e-12));
        prop_assert!(gap <= removal.bound + 1e-12, "{gap} > {}", removal.bound);
        let count = curve.knots().distinct_count() - removal.removed.len();
        prop_assert_eq!(removal.result.knots().distinct_count(), count);
    }

    #[test]
    fn surface_stays_the_same(u in shape(), v in shape(), rational: bool, seed: u64) {
        let mut random = Random(seed);
        let small = |s: Shape| Shape { degree: s.degree.min(4), spans: s.spans.min(3), ..s };
        let (u, v) = (small(u), small(v));
        let surface = surface(u, v, rational, &mut random);
        for direction in Direction::BOTH {
            let inserted = insertable(surface.knots(direction), &mut random);
            let finer = surface.insert_knots(direction, &inserted).unwrap();
            prop_assert!(surface_gap(&surface, &finer) < 1e-13);
            let removal = finer.remove_knots(direction, 0.1).unwrap();
            prop_assert!(surface_gap(&finer, &removal.result) <= removal.bound + 1e-12);
            prop_assert!(removal.bound <= 0.1 * (1.0 + 1e-12));
            let higher = surface.elevate(direction, 1).unwrap();
            prop_assert!(surface_gap(&surface, &higher) < 1e-13);
            let (a, b) = surface.knots(direction).domain();
            // The end pieces go on as they are: there are no knots where the ends were.
            let breaks = surface.knots(direction).breakpoints();
            let ends = [breaks[1] - a, b - breaks[breaks.len() - 2]].map(|span| 0.125 * span);
            match surface.extended(direction, a - ends[0], b + ends[1]) {
                Ok(longer) => {
                    prop_assert!(surface_gap(&longer, &surface) < 1e-12);
                    prop_assert_eq!(longer.knots(direction).breakpoints().len(), breaks.len());
                    prop_assert!(longer.knots(direction).is_clamped());
                }
                Err(_) => prop_assert!(rational || surface.knots(direction).is_periodic()),
            }
            let t = random.inside((a + 1e-3, b));
            for part in surface.split(direction, t).unwrap() {
                prop_assert!(surface_gap(&surface, &part) < 1e-13);
            }
            let curve = surface.iso_curve(direction, t).unwrap();
            let back = surface.reversed(direction).unwrap();
            for s in parameters(curve.knots()) {
                let (at, opposite) = match direction {
                    Direction::U => ((t, s), (a + b - t, s)),
                    Direction::V => ((s, t), (s, a + b - t)),
                };
                prop_assert!(curve.point(s).distance(surface.point(at.0, at.1)) < 1e-13);
                let gap = back.point(opposite.0, opposite.1).distance(surface.point(at.0, at.1));
                prop_assert!(gap < 1e-12);
            }
        }
        let clamped = surface.clamped().unwrap();
        prop_assert!(clamped.knots_u().is_clamped() && clamped.knots_v().is_clamped());
        prop_assert!(surface_gap(&surface, &clamped) < 1e-13);
        for piece in bezier::patches(&surface).unwrap() {
            let [(a, b), (c, d)] = piece.range;
            let [low, high] = piece.bounding_box();
            for (s, t) in [(0.0, 0.0), (0.3, 0.6), (1.0, 0.2)] {
                let point = piece.point(s, t);
                prop_assert!(point.distance(surface.point(a + s * (b - a), c + t * (d - c))) < 1e-13);
                prop_assert!((point - low).min_element() > -1e-12 && (high - point).min_element() > -1e-12);
                let [left, right] = piece.split(Direction::U, 0.4);
                prop_assert!(left.point(s, t).distance(piece.point(0.4 * s, t)) < 1e-13);
                prop_assert!(right.point(s, t).distance(piece.point(0.4 + 0.6 * s, t)) < 1e-13);
                let [left, right] = piece.split(Direction::V, 0.4);
                prop_assert!(left.point(s, t).distance(piece.point(s, 0.4 * t)) < 1e-13);
                prop_assert!(right.point(s, t).distance(piece.point(s, 0.4 + 0.6 * t)) < 1e-13);
            }
        }
    }

    #[test]
    fn triangles_close_where_the_surface_is_periodic(u in shape(), v in shape(), rational: bool, seed: u64) {
        let surface = surface(u, v, rational, &mut Random(seed));
        prop_assume!(surface.distinct_counts().iter().all(|&count| count >= 3));
        let Ok(mesh) = tessellate(&surface, 0.3, 300_000) else {
            return Ok(());
        };
        let mut edges: Vec<_> = mesh
            .triangles
            .iter()
            .flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        // Euler's formula: a disc, or a tube or torus.
        let disc = surface.periodic() == [false; 2];
        prop_assert_eq!(mesh.points.len() + mesh.triangles.len(), edges.len() + usize::from(disc));
    }

    #[test]
    fn affine_maps_commute_with_evaluation(u in shape(), v in shape(), rational: bool, seed: u64) {
        let mut random = Random(seed);
        let surface = surface(u, v, rational, &mut random);
        let matrix = random_matrix(&mut random);
        let shift = random.point();
        let map = |p: DVec3| matrix[0] * p.x + matrix[1] * p.y + matrix[2] * p.z + shift;
        let mapped = surface.map_points(map).unwrap();
        let [du, dv] = surface.domain();
        for _ in 0..8 {
            let (u, v) = (random.inside(du), random.inside(dv));
            prop_assert!(mapped.point(u, v).distance(map(surface.point(u, v))) < 1e-13);
            let (d, e) = (surface.derivatives(u, v), surface.transposed().derivatives(v, u));
            prop_assert!(d.point.distance(e.point) < 1e-13);
            prop_assert!(d.du.distance(e.dv) <= 1e-12 * (1.0 + d.du.length()));
            prop_assert!(d.duv.distance(e.duv) <= 1e-10 * (1.0 + d.duv.length()));
        }
    }
}

fn random_matrix(random: &mut Random) -> [DVec3; 3] {
    [random.point(), random.point(), random.point()]
}

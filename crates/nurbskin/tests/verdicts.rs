//! What may not pass, and what is said instead.

use nurbskin::deviation::verdict::Verdict;
use nurbskin::pipeline::{
    Compared, DeviationOptions, InputOptions, Length, Options, Outcome, SurfacingOptions,
    deviation, fit, fit_scan,
};
use nurbskin::progress::Silent;
use nurbskin::scan::simulate::Random;
use nurbskin::scan::{GridLayout, Organisation, Scan};
use nurbskin::{DVec3, Error, Unit};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Points along each side of the plate.
const SIDE: u32 = 61;

/// A bent plate of 120 mm, and a bump of `height` in its middle.
fn plate(height: f64) -> Vec<DVec3> {
    let point = |k: u32| {
        let (x, y) = (2.0 * f64::from(k % SIDE), 2.0 * f64::from(k / SIDE));
        let near = ((x - 60.0).powi(2) + (y - 60.0).powi(2)) / 50.0;
        DVec3::new(x, y, 0.002 * x * (x - y) + height * (-near).exp())
    };
    (0..SIDE * SIDE).map(point).collect()
}

fn millimetres(value: f64) -> Option<Length> {
    Some(Length::In(value, Unit::Millimetre))
}

/// A folder with the plate as `plate.step`.
struct Bench(TempDir);

impl Bench {
    fn new() -> Self {
        let bench = Self(tempfile::tempdir().unwrap());
        let scan = bench.scan("nominal.xyz", &plate(0.0));
        let options = Options {
            input: InputOptions {
                grid: Some([SIDE as usize; 2]),
                ..InputOptions::default()
            },
            ..Options::default()
        };
        fit(&scan, &[bench.path("plate.step")], &options, &Silent).unwrap();
        bench
    }
    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
    fn scan(&self, name: &str, points: &[DVec3]) -> PathBuf {
        let mut text = String::new();
        for p in points {
            writeln!(text, "{} {} {}", p.x, p.y, p.z).unwrap();
        }
        let path = self.path(name);
        std::fs::write(&path, text).unwrap();
        path
    }
    fn deviation(&self, points: &[DVec3], options: &DeviationOptions) -> Compared {
        let scan = self.scan("scan.xyz", points);
        deviation(&scan, &self.path("plate.step"), options, &Silent).unwrap()
    }
}

fn asked(tolerance: f64) -> DeviationOptions {
    DeviationOptions {
        tolerance: millimetres(tolerance),
        ..DeviationOptions::default()
    }
}

#[test]
fn without_a_tolerance_a_deviation_is_not_judged() {
    let bench = Bench::new();
    let found = bench.deviation(&plate(6.0), &DeviationOptions::default());
    assert_eq!(found.verdict, Verdict::NotAsked, "{}", found.reason);
    assert!(found.reasons.is_empty() && found.reason.contains("no tolerance was given"));
    assert_eq!((found.tolerance, found.within), (None, None));
    let s = found.deviation.scan_to_surface;
    assert_eq!(s.within_tolerance, None);
    assert!((s.max - 6.0).abs() < 0.2, "{}", s.max);
    let json = serde_json::to_value(&found).unwrap();
    assert_eq!(json["verdict"], "not_asked");
    assert_eq!(json["schema"], 2);
    assert!(json["tolerance"].is_null() && json["reasons"].as_array().unwrap().is_empty());
}

#[test]
fn a_bump_fails_with_its_place_and_what_to_do() {
    let bench = Bench::new();
    let found = bench.deviation(&plate(6.0), &asked(1.0));
    assert_eq!(found.verdict, Verdict::Fail);
    let first = &found.reasons[0];
    assert!(
        first.what.contains("outside +-1 mm") && first.what.contains("the worst is +"),
        "{}",
        first.what
    );
    let at = DVec3::from(first.where_.unwrap());
    assert!((at - DVec3::new(60.0, 60.0, 6.0)).length() < 0.5, "{at}");
    assert!(first.next.as_deref().unwrap().contains("--report"));
    assert!(found.reason.starts_with(&first.what) && found.reason.contains("at (60"));
    // The mean is of the distances; the signed one and its spread stand beside it.
    let s = found.deviation.scan_to_surface;
    assert!(s.signed_mean > 0.0 && s.signed_mean <= s.mean && s.signed_std > s.mean);
}

#[test]
fn a_scan_of_a_part_of_the_nominal_passes_only_if_that_is_enough() {
    let bench = Bench::new();
    let third: Vec<DVec3> = plate(0.0).into_iter().filter(|p| p.x < 40.0).collect();
    let found = bench.deviation(&third, &asked(1.0));
    assert_eq!(
        (found.verdict, found.min_coverage),
        (Verdict::CannotTell, Some(0.9))
    );
    let first = &found.reasons[0];
    assert!(
        first.what.contains("% of the nominal's area has data"),
        "{}",
        first.what
    );
    assert!(first.next.as_deref().unwrap().contains("--min-coverage"));
    let enough = DeviationOptions {
        min_coverage: Some(0.25),
        ..asked(1.0)
    };
    let found = bench.deviation(&third, &enough);
    assert_eq!(found.verdict, Verdict::Pass, "{}", found.reason);
    assert!(
        found.reason.contains("% of the nominal's area has data"),
        "{}",
        found.reason
    );
    // A whole one does.
    let found = bench.deviation(&plate(0.0), &asked(1.0));
    assert_eq!(found.verdict, Verdict::Pass, "{}", found.reason);
}

#[test]
fn a_scan_in_metres_is_not_aligned_onto_a_spot() {
    let bench = Bench::new();
    let metres: Vec<DVec3> = plate(0.0).into_iter().map(|p| 1e-3 * p).collect();
    let options = DeviationOptions {
        align: true,
        ..asked(1.0)
    };
    let found = bench.deviation(&metres, &options);
    assert_eq!(found.verdict, Verdict::CannotTell, "{}", found.reason);
    let next = |reason: &nurbskin::deviation::verdict::Reason| reason.next.clone();
    let all: Vec<String> = found.reasons.iter().filter_map(next).collect();
    assert!(
        all.iter()
            .any(|next| next.contains("looks like metres: say --unit m")),
        "{all:?}"
    );
    assert!(found.time.align > 0.0 && found.time.order.abs() < f64::EPSILON);
    // Without a tolerance as well.
    let unasked = DeviationOptions {
        align: true,
        ..DeviationOptions::default()
    };
    assert_eq!(
        bench.deviation(&metres, &unasked).verdict,
        Verdict::CannotTell
    );
    let in_metres = DeviationOptions {
        unit: Some(Unit::Metre),
        ..options
    };
    let found = bench.deviation(&metres, &in_metres);
    assert_eq!(found.verdict, Verdict::Pass, "{}", found.reason);
}

/// The plate as a cloud, with a tolerance of 0.1.
fn cloud(points: Vec<DVec3>, options: Options) -> Outcome {
    let scan = Scan {
        points,
        unit_source: nurbskin::unit::UnitSource::File,
        ..Scan::default()
    };
    fit_scan(scan, "plate", &options, &Silent).unwrap()
}

#[test]
fn a_few_points_do_not_decide_unless_all_are_asked_for() {
    let mut points = plate(0.0);
    // Two of 3,721, in places of their own: too near to be outliers, too far to be within.
    for k in [700, 2900] {
        points[k].z += 0.3;
    }
    let within = |within: Option<f64>| Options {
        surfacing: SurfacingOptions {
            tolerance: millimetres(0.15),
            within,
            ..SurfacingOptions::default()
        },
        ..Options::default()
    };
    let found = cloud(points.clone(), within(None));
    assert_eq!(
        (found.verdict, found.within),
        (Verdict::Pass, Some(0.995)),
        "{}",
        found.reason
    );
    let found = cloud(points, within(Some(1.0)));
    let outside = found.deviation.scan_to_surface.within_tolerance < Some(1.0);
    assert_eq!(found.verdict == Verdict::Fail, outside, "{}", found.reason);
}

/// A strip that crosses itself, x and y of a loop along u.
fn crossing() -> Scan {
    let (m, n) = (41_u32, 11_u32);
    let point = |k: u32| {
        let t = -1.4 + 2.8 * f64::from(k % m) / f64::from(m - 1);
        DVec3::new(
            30.0 * t * (t * t - 1.0),
            30.0 * (t * t - 1.0),
            4.0 * f64::from(k / m),
        )
    };
    Scan {
        points: (0..m * n).map(point).collect(),
        organisation: Organisation::Grid(GridLayout::complete(m as usize, n as usize).unwrap()),
        ..Scan::default()
    }
}

#[test]
fn a_surface_that_intersects_itself_fails_with_and_without_a_tolerance() {
    let folder = tempfile::tempdir().unwrap();
    for tolerance in [None, millimetres(0.5)] {
        let options = Options {
            surfacing: SurfacingOptions {
                tolerance,
                ..SurfacingOptions::default()
            },
            ..Options::default()
        };
        let mut found = fit_scan(crossing(), "strip", &options, &Silent).unwrap();
        let before = match tolerance {
            None => Verdict::NotAsked,
            Some(_) => Verdict::Pass,
        };
        assert_eq!(found.verdict, before, "{}", found.reason);
        let out = [
            folder.path().join("strip.step"),
            folder.path().join("strip.igs"),
        ];
        for path in &out {
            nurbskin::pipeline::write(
                &mut found,
                None,
                std::slice::from_ref(path),
                &options,
                &Silent,
            )
            .unwrap();
        }
        assert_eq!(found.verdict, Verdict::Fail);
        let check = found.check.as_ref().unwrap();
        assert_eq!(check.verdict, "fail");
        assert_eq!(found.reasons.len(), check.reasons.len());
        let first = &found.reasons[0];
        assert!(
            first.what.ends_with("where the surface intersects itself"),
            "{}",
            first.what
        );
        // The loop crosses itself on the line x = y = 0.
        let at = DVec3::from(first.where_.unwrap());
        assert!(at.x.hypot(at.y) < 3.0, "{at}");
        assert!(first.next.is_some() && found.reason.contains("intersects itself, at ("));
        // The file says the same.
        let file = nurbskin::pipeline::check(Path::new(&out[0]), &Silent).unwrap();
        assert_eq!(file.verdict, "fail");
    }
}

#[test]
fn points_in_a_volume_are_no_surface() {
    for seed in 0..4 {
        let mut random = Random::new(seed);
        let mut point = || DVec3::new(random.uniform(), random.uniform(), random.uniform());
        let points: Vec<DVec3> = (0..3000).map(|_| point()).collect();
        let scan = Scan {
            points,
            ..Scan::default()
        };
        let refused = fit_scan(scan, "cube", &Options::default(), &Silent);
        assert!(
            matches!(&refused, Err(Error::Unsupported(why)) if why.contains("fill a volume")),
            "{seed}: {:?}",
            refused.err()
        );
    }
}

#[test]
fn a_doubtful_size_is_the_first_thing_said() {
    let small = |source| {
        let scan = Scan {
            points: plate(0.0).into_iter().map(|p| 1e-3 * p).collect(),
            unit_source: source,
            ..Scan::default()
        };
        fit_scan(scan, "plate", &Options::default(), &Silent).unwrap()
    };
    let found = small(nurbskin::unit::UnitSource::Assumed);
    assert!(
        found.warnings[0].contains("--unit m: 120 x 120"),
        "{:?}",
        found.warnings
    );
    let found = small(nurbskin::unit::UnitSource::File);
    assert!(
        !found.warnings.iter().any(|w| w.contains("--unit")),
        "{:?}",
        found.warnings
    );
}

#[test]
fn holes_are_measured_once() {
    // Two large holes in the plate.
    let open = |x: f64, y: f64| {
        let near = |a: f64, b: f64| (x - a).hypot(y - b) < 22.0;
        near(40.0, 40.0) || near(80.0, 85.0)
    };
    let points = plate(0.0);
    let mut triangles = Vec::new();
    for k in 0..SIDE * SIDE {
        if k % SIDE + 1 < SIDE && k / SIDE + 1 < SIDE {
            let corners = [k, k + 1, k + SIDE + 1, k + SIDE];
            if corners
                .iter()
                .all(|&c| !open(points[c as usize].x, points[c as usize].y))
            {
                let [a, b, c, d] = corners;
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    let scan = Scan {
        points,
        organisation: Organisation::Mesh(triangles),
        ..Scan::default()
    };
    let found = fit_scan(scan, "plate", &Options::default(), &Silent).unwrap();
    let all = || found.warnings.iter().chain(&found.details);
    let areas: Vec<&String> = all()
        .filter(|w| w.contains("hole") && w.contains('%'))
        .collect();
    assert!(areas.len() <= 1, "{areas:?}");
    let holes = found
        .warnings
        .iter()
        .find(|w| w.contains("trimmed to the scan"));
    assert!(
        holes.is_some_and(|w| w.contains("with 2 holes")),
        "{:?}",
        found.warnings
    );
}

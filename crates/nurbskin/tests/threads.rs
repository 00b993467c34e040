//! The same bytes whatever the thread count.

use nurbskin::pipeline::{Options, fit_scan};
use nurbskin::progress::Silent;
use nurbskin::scan::simulate::{self, Order, ScanOptions, Shape};

/// The whole line, as JSON without its times and as the bits of its control points.
fn fitted(shape: Shape, options: &ScanOptions) -> (serde_json::Value, Vec<[u64; 3]>) {
    let scan = simulate::scan(shape, options).unwrap().scan;
    let outcome = fit_scan(scan, "scan", &Options::default(), &Silent).unwrap();
    let mut value = serde_json::to_value(&outcome).unwrap();
    value.as_object_mut().unwrap().remove("time");
    let bits = |p: &nurbskin::DVec3| p.to_array().map(f64::to_bits);
    let net = outcome.geometry[0].control_points().points();
    (value, net.iter().map(bits).collect())
}

#[test]
fn the_line_does_not_depend_on_the_number_of_threads() {
    let cloud = ScanOptions {
        points: Some(2000),
        noise: 0.1,
        outliers: 0.01,
        order: Order::Shuffled,
        ..ScanOptions::default()
    };
    let ordered = ScanOptions {
        points: Some(2000),
        ..ScanOptions::default()
    };
    for (shape, options) in [(Shape::Face, &cloud), (Shape::Pot, &ordered)] {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().unwrap().install(|| fitted(shape, options))
        };
        let one = with(1);
        for threads in [2, 3] {
            assert!(
                one == with(threads),
                "{} with {threads} threads",
                shape.name()
            );
        }
    }
}

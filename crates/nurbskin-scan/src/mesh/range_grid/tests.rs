use super::*;

/// A view of the heights of a function along z, one cell per unit.
fn view(m: usize, n: usize, z: impl Fn(f64, f64) -> Option<f64>) -> (Vec<DVec3>, GridLayout) {
    let mut points = Vec::new();
    let mut cells = Vec::new();
    for k in 0..m * n {
        let (x, y) = ((k % m) as f64, (k / m) as f64);
        cells.push(z(x, y).map(|z| {
            points.push(DVec3::new(x, y, z));
            u32::try_from(points.len()).unwrap() - 1
        }));
    }
    let grid = GridLayout {
        count_u: m,
        count_v: n,
        cells,
    };
    (points, grid)
}

#[test]
fn smooth_slopes_are_whole_and_wound_alike() {
    // Up to 76 degrees of slant.
    let (points, grid) = view(60, 40, |x, y| Some(0.033 * x * x + (0.1 * y).sin()));
    let triangles = triangles_of_grid(&points, &grid);
    assert_eq!(triangles.len(), 2 * 59 * 39);
    for t in triangles {
        let [a, b, c] = t.map(|k| points[k as usize]);
        assert!((b - a).cross(c - a).z > 0.0);
    }
}

#[test]
fn quantised_depth_is_no_step() {
    // Depth in steps as large as the sides of cells, on a slant.
    let (points, grid) = view(80, 60, |x, y| Some((0.3 * x + 0.17 * y).round()));
    assert_eq!(triangles_of_grid(&points, &grid).len(), 2 * 79 * 59);
}

#[test]
fn nothing_joins_a_ball_and_the_wall_behind() {
    let ball = |x: f64, y: f64| {
        let square = 625.0 - (x - 40.0).powi(2) - (y - 30.0).powi(2);
        if square > 0.0 {
            Some(60.0 + square.sqrt())
        } else {
            Some(0.0)
        }
    };
    let (points, grid) = view(80, 60, ball);
    let triangles = triangles_of_grid(&points, &grid);
    let front = |k: u32| points[k as usize].z > 1.0;
    assert!(
        triangles
            .iter()
            .all(|t| t.iter().all(|&k| front(k) == front(t[0])))
    );
    // All of the wall but the ring of squares that the outline crosses, most of the ball.
    let count = triangles.iter().filter(|t| front(t[0])).count();
    assert!(
        count > 3500 && triangles.len() > 8900,
        "{count} {}",
        triangles.len()
    );
}

#[test]
fn a_missing_cell_leaves_half_squares() {
    let (points, grid) = view(9, 9, |x, y| {
        ((x + y * 9.0 - 40.0).abs() > 0.5).then_some(0.0)
    });
    // Four squares lose one triangle each.
    assert_eq!(triangles_of_grid(&points, &grid).len(), 2 * 64 - 4);
    let wrong = GridLayout { count_u: 7, ..grid };
    assert!(triangles_of_grid(&points, &wrong).is_empty());
}

#[test]
fn a_real_view_keeps_its_steps_open() {
    let Ok(folder) = std::env::var("NURBSKIN_DATA") else {
        println!("skipped: NURBSKIN_DATA does not name the folder of real scans");
        return;
    };
    let file = std::path::Path::new(&folder).join("organised/stanford_bun000.ply");
    let scan = crate::io::scan::read_scan(file).unwrap();
    let crate::Organisation::Grid(grid) = &scan.organisation else {
        panic!("no grid");
    };
    let triangles = triangles_of_grid(&scan.points, grid);
    // The left ear hides the head behind it, the chin the chest: steps of centimetres.
    let longest = triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .map(|(a, b)| scan.points[a as usize].distance(scan.points[b as usize]))
        .fold(0.0, f64::max);
    assert!(longest < 0.008, "{longest}");
    assert!(triangles.len() > 75_000, "{}", triangles.len());
}

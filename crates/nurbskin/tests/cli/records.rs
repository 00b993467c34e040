//! The lines of a `.csv` report and the records of the file: one for each, under its number.

use super::Bench;

/// Side of the grid of the scans, in points.
const SIDE: usize = 30;

/// The point of a cell, in millimetres: a flat dome far from the origin, so that `0 0 0` is no point of it.
fn dome(i: usize, j: usize) -> [f64; 3] {
    let [x, y] = [i, j].map(|k| f64::from(u32::try_from(k).unwrap()));
    let z = 200.0 - 0.01 * ((x - 14.0).powi(2) + (y - 14.0).powi(2));
    [100.0 + x, 100.0 + y, z]
}

/// Cells without a point: a hole, and the last ones.
fn is_empty(i: usize, j: usize) -> bool {
    ((8..12).contains(&i) && (10..15).contains(&j)) || (j == SIDE - 1 && i > 26)
}

/// All cells, i fastest; `None` for an empty one.
fn cells() -> Vec<Option<[f64; 3]>> {
    let all = (0..SIDE * SIDE).map(|k| [k % SIDE, k / SIDE]);
    all.map(|[i, j]| (!is_empty(i, j)).then(|| dome(i, j)))
        .collect()
}

/// A PCD file of the cells, NaN where one is empty.
fn pcd(width: usize, cells: &[Option<[f64; 3]>]) -> String {
    let count = cells.len();
    let height = count / width;
    let mut text = format!(
        "VERSION .7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {width}\nHEIGHT {height}\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA ascii\n"
    );
    for cell in cells {
        let [x, y, z] = cell.unwrap_or([f64::NAN; 3]);
        text += &format!("{x} {y} {z}\n");
    }
    text
}

/// A scan of a PTX file, `0 0 0` where a cell is empty, of columns with `SIDE` cells each.
fn ptx(cells: &[Option<[f64; 3]>]) -> String {
    let mut text = format!("{}\n{SIDE}\n0 0 0\n", cells.len() / SIDE);
    text += "1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    for cell in cells {
        let [x, y, z] = cell.unwrap_or_default();
        text += &format!("{x} {y} {z} 0.5\n");
    }
    text
}

/// Checks that the report has a line for each cell, in order, with its place, distance and state.
fn joins(report: &str, cells: &[Option<[f64; 3]>]) {
    let lines: Vec<Vec<&str>> = (report.lines().skip(1))
        .map(|line| line.split(',').collect())
        .collect();
    assert_eq!(lines.len(), cells.len());
    for (k, (line, cell)) in lines.iter().zip(cells).enumerate() {
        assert_eq!((line.len(), line[0]), (11, &*k.to_string()));
        let place = [1, 2, 3].map(|c: usize| line[c].parse::<f64>().unwrap());
        match cell {
            Some(point) => {
                assert!(super::distance(place, *point) < 1e-9, "{k}: {line:?}");
                assert!(line[4].parse::<f64>().unwrap().abs() < 0.1, "{k}: {line:?}");
                assert_ne!(line[10], "not_finite", "{k}");
            }
            None => {
                assert!(place.iter().all(|c| c.is_nan()), "{k}: {line:?}");
                assert_eq!((line[4], line[10]), ("", "not_finite"), "{k}");
            }
        }
    }
}

#[test]
fn lines_are_the_records_of_an_organised_file() {
    let bench = Bench::new();
    let empty = cells().iter().filter(|cell| cell.is_none()).count();
    // The same points, as a grid and as a list: its NaN lines are points that cannot be used.
    for (name, width, unused) in [("grid", SIDE, 0), ("list", SIDE * SIDE, empty)] {
        bench.write(&format!("{name}.pcd"), pcd(width, &cells()));
        let found = bench.json(
            &format!("fit {name}.pcd -t 0.05 -o {name}.step --report {name}.csv"),
            0,
        );
        assert_eq!(found["input"]["points"], SIDE * SIDE - empty + unused);
        assert_eq!(found["input"]["rejected"]["non_finite"], unused);
        joins(&bench.read(&format!("{name}.csv")), &cells());
        let found = bench.json(
            &format!("deviation {name}.pcd {name}.step -t 0.05 --report compared.csv"),
            0,
        );
        joins(&bench.read("compared.csv"), &cells());
        for worst in found["deviation"]["worst"].as_array().unwrap() {
            let record = usize::try_from(worst["index"].as_u64().unwrap()).unwrap();
            let place = [0, 1, 2].map(|c| worst["point"][c].as_f64().unwrap());
            assert!(super::distance(place, cells()[record].unwrap()) < 1e-9);
        }
    }
}

#[test]
fn lines_are_the_records_of_all_scans_of_a_file() {
    let bench = Bench::new();
    let cells = cells();
    let (first, second) = cells.split_at(12 * SIDE);
    bench.write("two.ptx", ptx(first) + &ptx(second));
    let found = bench.json(
        "fit two.ptx --unit mm -t 0.05 -o two.step --report two.csv",
        0,
    );
    assert_eq!(found["input"]["organisation"], "unordered");
    joins(&bench.read("two.csv"), &cells);
    bench.write("one.ptx", ptx(&cells));
    let found = bench.json(
        "fit one.ptx --unit mm -t 0.05 -o one.step --report one.csv",
        0,
    );
    assert_eq!(found["input"]["organisation"], "grid");
    joins(&bench.read("one.csv"), &cells);
}

//! Table 1 of Pal & Ballav 2007 again, from our own scans, and what it left out:
//! `cargo run --release --example table1 [-- --write FOLDER]`.
//!
//! With `--write`, each surface goes to FOLDER as IGES, beside the points it was made from (`.xyz`) and the largest
//! deviation allowed for them (`.max`: 1e-8 of the box, or what six decimals can hold), for an independent reader to
//! check.

#![expect(clippy::print_stdout, reason = "tables are what it is for")]

#[path = "table1/full_matrix.rs"]
mod full_matrix;
#[path = "table1/measure.rs"]
mod measure;
#[path = "table1/noise.rs"]
mod noise;
#[path = "table1/table.rs"]
mod table;

use measure::{CASES, Measured, Round, Seconds, TOLERANCE, Tolerant, iges, measure};
use nurbskin::io::iges::write::{Layout, Written};
use nurbskin::nurbs::Direction;
use nurbskin::{NurbsSurface, PointGrid};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn counts([m, n]: [usize; 2]) -> [String; 2] {
    [format!("{m} x {n}"), (m * n).to_string()]
}

fn kib(file: Written) -> String {
    format!("{:.2}", file.bytes as f64 / 1024.0)
}

fn print_files(cases: &[Measured]) {
    let row = |it: &Measured| {
        let [kept, points] = counts(it.case.counts);
        let [paper, exact] = it.files;
        vec![
            it.case.name.into(),
            it.points.to_string(),
            kept,
            points,
            table::or_dash(it.case.paper, |p| p.lines.to_string()),
            paper.lines.to_string(),
            table::or_dash(it.case.paper, |p| p.kib.to_string()),
            kib(paper),
            exact.lines.to_string(),
            kib(exact),
        ]
    };
    table::print(
        "Points and IGES files: the paper's, ours in the paper's layout (six decimals), and ours with exact numbers",
        &[
            "object",
            "scanned",
            "kept",
            "points",
            "paper, lines",
            "ours, lines",
            "paper, KiB",
            "ours, KiB",
            "exact, lines",
            "exact, KiB",
        ],
        &cases.iter().map(row).collect::<Vec<_>>(),
    );
}

fn print_seconds(cases: &[Measured]) {
    let row = |it: &Measured| {
        let Seconds {
            order,
            rarefy,
            fit,
            write,
            full_matrix,
        } = it.seconds;
        let ms = |seconds: f64| format!("{:.3}", 1e3 * seconds);
        vec![
            it.case.name.into(),
            table::or_dash(it.case.paper, |p| format!("{:.1}", p.seconds)),
            ms(order),
            ms(rarefy),
            ms(fit),
            ms(write),
            ms(order + rarefy + fit + write),
            table::or_dash(full_matrix, ms),
            table::or_dash(full_matrix, |seconds| format!("{:.0}", seconds / fit)),
            table::or_dash(it.full_matrix_difference, |mm| format!("{mm:.0e}")),
        ]
    };
    table::print(
        "Time: the paper's CPU, our stages, and the paper's full matrix inverted on this machine instead of `fit`",
        &[
            "object",
            "paper, s",
            "order, ms",
            "rarefy, ms",
            "fit, ms",
            "write, ms",
            "sum, ms",
            "full matrix, ms",
            "times fit",
            "net differs, mm",
        ],
        &cases.iter().map(row).collect::<Vec<_>>(),
    );
}

fn print_distances(cases: &[Measured]) {
    let row = |it: &Measured| {
        let [uniform, chord] = &it.distances;
        // A negative threshold keeps every line.
        let degrees = |d: f64| table::or_dash((d >= 0.0).then_some(d), |d| format!("{d:.2}"));
        let around = it.case.shape.closed()[1] && it.case.round != Round::Opening;
        let seam = around.then(|| it.surfaces[1].seam_jumps(Direction::V).normal_angle);
        vec![
            it.case.name.into(),
            degrees(it.thresholds.u),
            degrees(it.thresholds.v),
            format!("{:.0e}", uniform.kept),
            format!("{:.0e}", chord.kept),
            format!("{:.4}", uniform.all),
            format!("{:.4}", chord.all),
            table::or_dash(seam, |radians| format!("{:.3}", radians.to_degrees())),
        ]
    };
    table::print(
        "What the paper left out: largest distance to the surface of the points kept and of all points, and how\n\
         far the normal turns at the seam of round objects",
        &[
            "object",
            "D_T u, deg",
            "D_T v, deg",
            "kept, uniform, mm",
            "kept, chord, mm",
            "all, uniform, mm",
            "all, chord, mm",
            "seam kink, chord, deg",
        ],
        &cases.iter().map(row).collect::<Vec<_>>(),
    );
}

fn print_tolerant(cases: &[Measured]) {
    let row = |it: &Measured| {
        let mut cells = vec![it.case.name.into()];
        cells.push((it.case.counts[0] * it.case.counts[1]).to_string());
        for Tolerant {
            found,
            distance,
            seconds,
        } in &it.tolerant
        {
            cells.extend(counts(found.kept.counts()));
            cells.push(format!("{distance:.4}"));
            cells.push(format!("{seconds:.3}"));
        }
        cells.push(table::or_dash(it.by_threshold, |(d, _)| format!("{d:.2}")));
        cells.push(table::or_dash(it.by_threshold, |(_, n)| n.to_string()));
        cells
    };
    table::print(
        &format!(
            "T-mode: as close as the better of those two; within {TOLERANCE} mm of all points; and the paper's rule with\n\
             the largest D_T that is within {TOLERANCE} mm too"
        ),
        &[
            "object",
            "paper, points",
            "as close",
            "points",
            "all, mm",
            "s",
            "within",
            "points",
            "all, mm",
            "s",
            "by D_T, deg",
            "points",
        ],
        &cases.iter().map(row).collect::<Vec<_>>(),
    );
}

fn save(name: &str, kept: &PointGrid, surface: &NurbsSurface, folder: &Path) -> Outcome<()> {
    let [lo, hi] = kept.bounding_box();
    let mut text = String::new();
    for p in kept.points() {
        writeln!(text, "{} {} {}", p.x, p.y, p.z)?;
    }
    for (layout, suffix, share) in [
        (Layout::Exact, "", 1e-8),
        (Layout::Paper, "-paper-layout", 1e-6),
    ] {
        let file = |extension: &str| folder.join(format!("{name}{suffix}.{extension}"));
        fs::write(file("xyz"), &text)?;
        fs::write(file("max"), format!("{:e}", share * lo.distance(hi)))?;
        fs::write(file("igs"), iges(surface, layout)?.0)?;
    }
    Ok(())
}

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let folder = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => None,
        ["--write", folder] => Some(Path::new(folder)),
        _ => return Err("usage: table1 [--write FOLDER]".into()),
    };
    let cases = CASES.iter().map(measure).collect::<Outcome<Vec<_>>>()?;
    println!(
        "Table 1 of Pal & Ballav 2007 again. Degree 3 x 3; uniform parameters, as in the paper, unless said."
    );
    print_files(&cases);
    print_seconds(&cases);
    print_distances(&cases);
    print_tolerant(&cases);
    noise::print()?;
    let Some(folder) = folder else { return Ok(()) };
    fs::create_dir_all(folder)?;
    for it in &cases {
        let name = it.case.name;
        save(name, &it.kept, &it.surfaces[0], folder)?;
        save(&format!("{name}-chord"), &it.kept, &it.surfaces[1], folder)?;
        let tolerant = &it.tolerant[1].found.surface;
        save(
            &format!("{name}-to-tolerance"),
            &it.tolerant_kept,
            tolerant,
            folder,
        )?;
    }
    Ok(())
}

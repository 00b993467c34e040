//! The paper's Table 1 again, from our own scans, and what it left out:
//! `cargo run --release --example table1 [-- --write FOLDER]`.
//!
//! With `--write`, each surface goes to FOLDER as IGES, beside the points it was made from (`.xyz`) and the largest
//! deviation allowed for them (`.max`: 1e-8 of the box, or what six decimals can hold), for an independent reader to
//! check.

use nurbskin::chart::Topology;
use nurbskin::chart::grid::{OrderedScan, order};
use nurbskin::fit::interpolate::interpolate;
use nurbskin::fit::parameters::Parameterization;
use nurbskin::fit::rarefied::{Options, Rarefied, rarefy_to_tolerance};
use nurbskin::io::iges::write::{IgesContent, Layout, WriteOptions, Written, write};
use nurbskin::nurbs::closest::ClosestPoint;
use nurbskin::progress::Silent;
use nurbskin::rarefy::to_counts_filled;
use nurbskin::scan::simulate::{ScanOptions, Shape, scan};
use nurbskin::{DVec3, NurbsSurface, PointGrid};
use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::time::Instant;

/// A row of the paper's table.
struct Case {
    name: &'static str,
    shape: Shape,
    /// The handle is given with its longitudinal opening, as in the paper, and as a closed tube.
    opening: bool,
    counts: [usize; 2],
    /// CPU seconds, kilobytes and lines as printed; none where the paper has no such row.
    paper: Option<[f64; 3]>,
}

const CASES: [Case; 5] = [
    Case {
        name: "pot",
        shape: Shape::Pot,
        opening: false,
        counts: [18, 18],
        paper: Some([5.0, 19.0, 230.0]),
    },
    Case {
        name: "patch",
        shape: Shape::Patch,
        opening: false,
        counts: [4, 4],
        paper: Some([2.5, 1.91, 22.0]),
    },
    Case {
        name: "face",
        shape: Shape::Face,
        opening: false,
        counts: [29, 13],
        paper: Some([6.1, 21.3, 267.0]),
    },
    Case {
        name: "handle",
        shape: Shape::Handle,
        opening: true,
        counts: [25, 32],
        paper: Some([19.5, 44.0, 549.0]),
    },
    Case {
        name: "handle-closed",
        shape: Shape::Handle,
        opening: false,
        counts: [25, 32],
        paper: None,
    },
];

/// One surface through the kept points, and how close it is to them and to all points.
struct Made {
    name: String,
    kept: PointGrid,
    surface: NurbsSurface,
    seconds: f64,
    at_kept: f64,
    at_all: f64,
}

/// Largest certified distance of the points to the surface.
fn largest_distance(surface: &NurbsSurface, points: &[DVec3]) -> Result<f64, Box<dyn Error>> {
    let feet = ClosestPoint::new(surface)?.closest_all(points, None);
    Ok(feet.iter().map(|foot| foot.distance).fold(0.0, f64::max))
}

fn make(
    name: String,
    kept: PointGrid,
    topology: Topology,
    kind: Parameterization,
    all: &[DVec3],
) -> Result<Made, Box<dyn Error>> {
    let start = Instant::now();
    let surface = interpolate(&kept, topology, [3, 3], kind)?.surface;
    let seconds = start.elapsed().as_secs_f64();
    let at_kept = largest_distance(&surface, kept.points())?;
    let at_all = largest_distance(&surface, all)?;
    Ok(Made {
        name,
        kept,
        surface,
        seconds,
        at_kept,
        at_all,
    })
}

fn iges(surface: &NurbsSurface, layout: Layout) -> Result<(Vec<u8>, Written), Box<dyn Error>> {
    let mut bytes = Vec::new();
    let content = IgesContent {
        surfaces: std::slice::from_ref(surface),
        ..IgesContent::default()
    };
    let written = write(
        &mut bytes,
        &content,
        &WriteOptions {
            layout,
            ..WriteOptions::default()
        },
    )?;
    Ok((bytes, written))
}

fn save(made: &Made, folder: &Path) -> Result<(), Box<dyn Error>> {
    let [lo, hi] = made.kept.bounding_box();
    for (layout, suffix, share) in [
        (Layout::Exact, "", 1e-8),
        (Layout::Paper, "-paper-layout", 1e-6),
    ] {
        let stem = format!("{}{suffix}", made.name);
        let mut text = String::new();
        for p in made.kept.points() {
            writeln!(text, "{} {} {}", p.x, p.y, p.z)?;
        }
        fs::write(folder.join(format!("{stem}.xyz")), text)?;
        fs::write(
            folder.join(format!("{stem}.max")),
            format!("{:e}", share * lo.distance(hi)),
        )?;
        fs::write(
            folder.join(format!("{stem}.igs")),
            iges(&made.surface, layout)?.0,
        )?;
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let folder = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => None,
        ["--write", folder] => Some(Path::new(folder)),
        _ => return Err("usage: table1 [--write FOLDER]".into()),
    };
    if let Some(folder) = folder {
        fs::create_dir_all(folder)?;
    }

    println!(
        "Table 1 of Pal & Ballav 2007 beside ours (degree 3 x 3; sizes in KiB; lengths in mm)\n"
    );
    println!(
        "object         points  kept      paper: CPU s  lines  size | ours: order+rarefy s  fit s     lines  size | exact layout: lines  size"
    );
    let mut tail = String::new();
    for case in &CASES {
        let simulated = scan(
            case.shape,
            &ScanOptions {
                opening: case.opening,
                ..ScanOptions::default()
            },
        )?;
        let all = &simulated.scan.points;
        let start = Instant::now();
        let OrderedScan { grid, topology, .. } = order(&simulated.scan, None)?;
        let (thresholds, kept) = to_counts_filled(&grid, topology, case.counts)?;
        let selected = kept.select(&grid)?;
        let ordering = start.elapsed().as_secs_f64();
        // The paper uses uniform parameters; chord length is what it describes beside them.
        let uniform = make(
            case.name.into(),
            selected.clone(),
            topology,
            Parameterization::Uniform,
            all,
        )?;
        let chord = make(
            format!("{}-chord", case.name),
            selected,
            topology,
            Parameterization::ChordLength,
            all,
        )?;
        let [(_, paper), (_, exact)] = [
            iges(&uniform.surface, Layout::Paper)?,
            iges(&uniform.surface, Layout::Exact)?,
        ];
        let [m, n] = case.counts;
        let printed = case
            .paper
            .map_or("      -      -     - ".into(), |[cpu, size, lines]| {
                format!("{cpu:7.1} {lines:6} {size:5.2} ")
            });
        println!(
            "{:13} {:7}  {:8} {printed:>27}| {ordering:19.4} {:8.6} {:7} {:6.2} | {:19} {:6.2}",
            case.name,
            all.len(),
            format!("{m} x {n}"),
            uniform.seconds,
            paper.lines,
            paper.bytes as f64 / 1024.0,
            exact.lines,
            exact.bytes as f64 / 1024.0
        );

        // What the paper left out: the points that were not kept, and what the same closeness really costs.
        let within = |tolerance: f64| -> nurbskin::Result<Rarefied> {
            rarefy_to_tolerance(&grid, topology, tolerance, &Options::default(), &Silent)
        };
        let tolerance = 0.1;
        let start = Instant::now();
        let found = within(tolerance)?;
        let seconds = start.elapsed().as_secs_f64();
        let reached = largest_distance(&found.surface, all)?;
        let [a, b] = found.kept.counts();
        let same = within(chord.at_all.min(uniform.at_all).max(1e-9))?;
        let [c, d] = same.kept.counts();
        writeln!(
            tail,
            "{:13} {:5.2} {:5.2}   {:8.1e} {:9.4} {:9.4}   {:>9} = {:5} pts   {:>9} = {:5} pts, max {:6.4}, {:5.3} s",
            case.name,
            thresholds.u,
            thresholds.v,
            uniform.at_kept.max(chord.at_kept),
            uniform.at_all,
            chord.at_all,
            format!("{c} x {d}"),
            c * d,
            format!("{a} x {b}"),
            a * b,
            reached,
            seconds
        )?;
        if let Some(folder) = folder {
            save(&uniform, folder)?;
            save(&chord, folder)?;
            let tolerant = Made {
                name: format!("{}-to-tolerance", case.name),
                kept: found.kept.select(&grid)?,
                surface: found.surface,
                ..chord
            };
            save(&tolerant, folder)?;
        }
    }
    println!("\nWhat the paper left out: all points, kept and discarded");
    println!(
        "object        D_T u, v deg  at kept   all points: uniform, chord   same by T-mode          within {} on all points by T-mode",
        0.1
    );
    print!("{tail}");
    Ok(())
}

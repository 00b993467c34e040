//! Figures of the layouts of scans: `cargo run --release --example layouts -- FOLDER [NAME...]`. `REFINE=2` splits each
//! triangle in sixteen first, to time large meshes.
//!
//! Per scan and per method: faces, vertices, extraordinary vertices (those off sharp lines with other than four faces,
//! two at borders), faces with a side below 0.02 diagonals, and the median angle between smooth edges and the nearest
//! principal direction where |k1| > 3 |k2|. 22.5 degrees is the angle of edges at random.

#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example prints its figures"
)]

use glam::DVec3;
use nurbskin_geometry::progress::Silent;
use nurbskin_geometry::{Error, Result};
use nurbskin_network::layout::field::{Principal, SMOOTHING, principal_curvatures};
use nurbskin_network::layout::{EdgeKind, Layout, LayoutOptions, Producer};
use nurbskin_scan::Organisation;
use nurbskin_scan::io::read_scan;
use nurbskin_scan::mesh::Manifold;
use nurbskin_scan::mesh::holes::fill;
use nurbskin_scan::mesh::manifold::NONE;
use nurbskin_scan::mesh::repair::repair;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// Scans of the design note's table, and whether they have sharp lines.
const SCANS: [(&str, bool); 6] = [
    ("tubes/ycb_banana.obj", false),
    ("tubes/aorta2.stl", false),
    ("classics/fandisk.obj", true),
    ("faces/lee_perry_smith_head.ply", false),
    ("classics/stanford_bun_zipper.ply", false),
    ("pots/sea_vase.ply", false),
];

/// A side of a face below this share of the diagonal makes it slender.
const SLENDER: f64 = 0.02;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((folder, names)) = arguments.split_first() else {
        return Err(Error::invalid("name the folder of the scans"));
    };
    println!(
        "| scan | method | faces | vertices | extraordinary (%) | slender (smooth) | angle | s |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (name, lines) in SCANS {
        if names.is_empty() || names.iter().any(|n| name.contains(n.as_str())) {
            scan(&Path::new(folder).join(name), lines)?;
        }
    }
    Ok(())
}

/// Prints the rows of a scan.
fn scan(path: &Path, lines: bool) -> Result<()> {
    let scan = read_scan(path)?;
    let Organisation::Mesh(triangles) = &scan.organisation else {
        return Err(Error::invalid("the scan has no triangles"));
    };
    let mesh = repair(&scan.points, triangles, &Silent)?.manifold;
    let small = |k: &usize| mesh.loops[*k].len() <= 12;
    let holes: Vec<usize> = (0..mesh.loops.len()).filter(small).collect();
    let (mut mesh, _) = fill(mesh, &holes);
    for _ in 0..refinements() {
        mesh = refined(&mesh);
    }
    let sharp = if lines {
        features(&mesh)
    } else {
        vec![false; 3 * mesh.triangles.len()]
    };
    let diagonal = diagonal(&mesh);
    let clock = Instant::now();
    let mut producer = Producer::new(&mesh, &sharp)?;
    let name = path.file_stem().unwrap_or_default().display();
    eprintln!("{name}: tables {:.2} s", clock.elapsed().as_secs_f64());
    for (method, options) in methods() {
        let clock = Instant::now();
        let layout = producer.layout(&options, &[]);
        let seconds = clock.elapsed().as_secs_f64();
        layout.validate(&mesh)?;
        eprintln!("{name}: {method} {seconds:.2} s");
        let principal = principal_curvatures(&mesh, &sharp, SMOOTHING * diagonal);
        let figures = Figures::new(&mesh, &principal, &layout, diagonal);
        println!(
            "| {name} ({}) | {method} | {} | {} | {} ({:.0}) | {} ({}) | {:.1} | {seconds:.2} |",
            mesh.points.len(),
            layout.faces.len(),
            layout.vertices.len(),
            figures.extraordinary,
            100.0 * figures.extraordinary as f64 / layout.vertices.len() as f64,
            figures.slender[0],
            figures.slender[1],
            figures.angle,
        );
    }
    Ok(())
}

/// How often triangles are split in four, to time large meshes: the value of `REFINE`, or 0.
fn refinements() -> usize {
    let given = std::env::var("REFINE").ok();
    given.and_then(|v| v.parse().ok()).unwrap_or(0)
}

/// Each triangle split in four.
fn refined(mesh: &Manifold) -> Manifold {
    let mut middles = BTreeMap::new();
    let mut points = mesh.points.clone();
    let mut triangles = Vec::with_capacity(4 * mesh.triangles.len());
    for t in &mesh.triangles {
        let m: [u32; 3] = std::array::from_fn(|s| {
            let (a, b) = (t[s], t[(s + 1) % 3]);
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push(0.5 * (points[a as usize] + points[b as usize]));
                u32::try_from(points.len() - 1).unwrap_or(NONE)
            })
        });
        triangles.extend([
            [t[0], m[0], m[2]],
            [t[1], m[1], m[0]],
            [t[2], m[2], m[1]],
            m,
        ]);
    }
    let border = |l: &Vec<u32>| {
        let ends = l.iter().zip(l.iter().cycle().skip(1));
        ends.flat_map(|(&a, &b)| [a, middles[&(a.min(b), a.max(b))]])
            .collect()
    };
    Manifold {
        source: vec![None; points.len()],
        loops: mesh.loops.iter().map(border).collect(),
        points,
        triangles,
    }
}

/// The methods compared; only one if `METHOD` names it.
fn methods() -> Vec<(&'static str, LayoutOptions)> {
    let mut all = vec![
        ("geodesic", LayoutOptions::default()),
        ("aligned", LayoutOptions::aligned()),
        ("parity", LayoutOptions::parity()),
    ];
    if let Ok(only) = std::env::var("METHOD") {
        all.retain(|(name, _)| *name == only);
    }
    all
}

fn diagonal(mesh: &Manifold) -> f64 {
    let low = mesh.points.iter().copied().reduce(DVec3::min);
    let high = mesh.points.iter().copied().reduce(DVec3::max);
    low.unwrap_or_default().distance(high.unwrap_or_default())
}

/// Sides over which the normal turns by more than 25 degrees, connected to one with more than 40, where the whole is
/// longer than 0.06 diagonals.
fn features(mesh: &Manifold) -> Vec<bool> {
    let table = mesh.adjacency();
    let turn = |side: usize| {
        let other = table.opposite[side];
        if other == NONE {
            return 0.0;
        }
        let [a, b] = [side, other as usize].map(|s| mesh.vector_area(s / 3).normalize_or_zero());
        a.dot(b).clamp(-1.0, 1.0).acos().to_degrees()
    };
    let count = 3 * mesh.triangles.len();
    let turns: Vec<f64> = (0..count).map(turn).collect();
    let end = |side: usize, k: usize| mesh.triangles[side / 3][(side + k) % 3] as usize;
    let mut sets = nurbskin_geometry::numeric::disjoint_sets::DisjointSets::new(mesh.points.len());
    for side in (0..count).filter(|&s| turns[s] > 25.0) {
        sets.join(end(side, 0), end(side, 1));
    }
    let mut strong = vec![false; mesh.points.len()];
    let mut length = vec![0.0; mesh.points.len()];
    for side in (0..count).filter(|&s| turns[s] > 25.0) {
        let root = sets.root(end(side, 0));
        strong[root] |= turns[side] > 40.0;
        length[root] += 0.5 * mesh.points[end(side, 0)].distance(mesh.points[end(side, 1)]);
    }
    let least = 0.06 * diagonal(mesh);
    (0..count)
        .map(|side| {
            let root = sets.root(end(side, 0));
            turns[side] > 25.0 && strong[root] && length[root] > least
        })
        .collect()
}

struct Figures {
    extraordinary: usize,
    /// Faces with a short side; those whose short sides are all smooth.
    slender: [usize; 2],
    angle: f64,
}

impl Figures {
    fn new(mesh: &Manifold, principal: &[Principal], layout: &Layout, diagonal: f64) -> Self {
        let place = |v: u32| layout.vertices[v as usize];
        let n = layout.vertices.len();
        let (mut faces, mut sharp, mut open) = (vec![0; n], vec![false; n], vec![false; n]);
        for &v in layout.faces.iter().flat_map(|f| &f.corners) {
            faces[v as usize] += 1;
        }
        let mut spokes = vec![0; n];
        for edge in &layout.edges {
            for v in edge.ends {
                sharp[v as usize] |= edge.kind == EdgeKind::Sharp;
                open[v as usize] |= edge.kind == EdgeKind::Open;
            }
            spokes[edge.ends[0] as usize] += 1;
        }
        let regular = |v: usize| sharp[v] || faces[v] == if open[v] { 2 } else { 4 };
        let mut slender = [0; 2];
        for face in &layout.faces {
            let short = face.sides.iter().map(|s| &layout.edges[s.edge as usize]);
            let short: Vec<bool> = short
                .filter(|e| place(e.ends[0]).distance(place(e.ends[1])) < SLENDER * diagonal)
                .map(|e| {
                    e.kind.is_hard()
                        || e.ends
                            .iter()
                            .any(|v| sharp[*v as usize] || open[*v as usize])
                })
                .collect();
            slender[0] += usize::from(!short.is_empty());
            slender[1] += usize::from(short.contains(&false));
        }
        Self {
            extraordinary: (0..n).filter(|&v| !regular(v)).count(),
            slender,
            angle: angle(mesh, principal, layout, diagonal),
        }
    }
}

/// The median angle of smooth edges to principal directions, degrees.
fn angle(mesh: &Manifold, principal: &[Principal], layout: &Layout, diagonal: f64) -> f64 {
    let middles: Vec<DVec3> = (0..mesh.triangles.len())
        .map(|t| mesh.corners(t).iter().sum::<DVec3>() / 3.0)
        .collect();
    let mut angles = Vec::new();
    for edge in layout.edges.iter().filter(|e| !e.kind.is_hard()) {
        let [a, b] = edge.ends.map(|v| layout.vertices[v as usize]);
        for t in [0.2, 0.5, 0.8] {
            let p = a.lerp(b, t);
            let distance = |m: &DVec3| m.distance_squared(p);
            let nearest = (0..middles.len())
                .min_by(|&i, &j| distance(&middles[i]).total_cmp(&distance(&middles[j])));
            let Some(nearest) = nearest else { continue };
            let k = principal[nearest];
            if k.k1.abs() > 3.0 * k.k2.abs() && k.k1.abs() * diagonal > 3.0 {
                let normal = mesh.vector_area(nearest).normalize_or_zero();
                let along = (b - a).reject_from_normalized(normal).normalize_or_zero();
                let off = [k.direction, normal.cross(k.direction)].map(|d| d.dot(along).abs());
                angles.push(off[0].max(off[1]).min(1.0).acos().to_degrees());
            }
        }
    }
    angles.sort_by(f64::total_cmp);
    angles.get(angles.len() / 2).copied().unwrap_or(f64::NAN)
}

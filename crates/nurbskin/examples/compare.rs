//! Our side of `compare/run.py`: reads the arrays that the peers read, prints one line `T seconds` per run.
//!
//! `compare grid IN OUT RUNS THREADS`, `compare closest SURFACE POINTS OUT RUNS THREADS` and, for a cloud over the unit square,
//! `compare cloud IN SPANS OUT RUNS THREADS`.

#![expect(
    clippy::print_stdout,
    reason = "its output is what compare/run.py reads"
)]

use nurbskin::chart::{Chart, Topology};
use nurbskin::fit::approximate::{ApproximateOptions, approximate};
use nurbskin::fit::interpolate::interpolate_at;
use nurbskin::nurbs::closest::ClosestPoint;
use nurbskin::progress::Silent;
use nurbskin::{ControlNet, DVec2, DVec3, KnotVector, NurbsSurface, PointGrid};
use std::error::Error;
use std::fs::{self, File};
use std::io::{BufReader, BufWriter, Read, Write};
use std::time::Instant;

/// Little-endian numbers of a file, taken from the front; nothing is held twice, so that the peak of memory is that of
/// the work.
struct Numbers(BufReader<File>);

impl Numbers {
    fn open(path: &str) -> Result<Self, Box<dyn Error>> {
        Ok(Self(BufReader::with_capacity(1 << 20, File::open(path)?)))
    }
    fn int(&mut self) -> Result<usize, Box<dyn Error>> {
        let mut bytes = [0; 4];
        self.0.read_exact(&mut bytes)?;
        Ok(usize::try_from(i32::from_le_bytes(bytes))?)
    }
    fn double(&mut self) -> std::io::Result<f64> {
        let mut bytes = [0; 8];
        self.0.read_exact(&mut bytes)?;
        Ok(f64::from_le_bytes(bytes))
    }
    fn doubles(&mut self, count: usize) -> Result<Vec<f64>, Box<dyn Error>> {
        Ok((0..count)
            .map(|_| self.double())
            .collect::<std::io::Result<_>>()?)
    }
    fn points(&mut self, count: usize) -> Result<Vec<DVec3>, Box<dyn Error>> {
        let mut points = Vec::with_capacity(count);
        for _ in 0..count {
            points.push(DVec3::new(self.double()?, self.double()?, self.double()?));
        }
        Ok(points)
    }
}

fn write<'a>(path: &str, numbers: impl Iterator<Item = &'a f64>) -> Result<(), Box<dyn Error>> {
    let mut file = BufWriter::with_capacity(1 << 20, File::create(path)?);
    for number in numbers {
        file.write_all(&number.to_le_bytes())?;
    }
    Ok(file.flush()?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["grid", source, result, runs, threads] => {
            grid(source, result, runs.parse()?, threads.parse()?)
        }
        ["closest", surface, points, result, runs, threads] => {
            closest(surface, points, result, runs.parse()?, threads.parse()?)
        }
        ["cloud", source, spans, result, runs, threads] => cloud(
            source,
            spans.parse()?,
            result,
            runs.parse()?,
            threads.parse()?,
        ),
        _ => Err("see the head of examples/compare.rs".into()),
    }
}

fn threads(count: usize) -> Result<(), Box<dyn Error>> {
    Ok(rayon::ThreadPoolBuilder::new()
        .num_threads(count)
        .build_global()?)
}

fn grid(source: &str, result: &str, runs: usize, count: usize) -> Result<(), Box<dyn Error>> {
    threads(count)?;
    let (points, u, v) = {
        let mut file = Numbers::open(source)?;
        let (m, n) = (file.int()?, file.int()?);
        let (u, v) = (file.doubles(m)?, file.doubles(n)?);
        // The file's second index runs fastest, ours is the first: u and v change places.
        (PointGrid::new(n, m, file.points(m * n)?)?, u, v)
    };
    let mut surface = None;
    for _ in 0..runs {
        drop(surface.take());
        let start = Instant::now();
        surface = Some(interpolate_at(&points, Topology::Disk, [3, 3], [&v, &u])?);
        println!("T {:.9}", start.elapsed().as_secs_f64());
    }
    let peak = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = peak
        .lines()
        .find_map(|l| l.strip_prefix("VmHWM:"))
        .map_or(f64::NAN, |l| {
            l.trim()
                .trim_end_matches(" kB")
                .parse::<f64>()
                .unwrap_or(f64::NAN)
                / 1024.0
        });
    println!("M {peak:.1}");
    let surface = surface.ok_or("no run")?;
    let (tu, tv) = (surface.knots_v().knots(), surface.knots_u().knots());
    let net = surface
        .control_points()
        .points()
        .iter()
        .flat_map(AsRef::<[f64; 3]>::as_ref);
    write(result, tu.iter().chain(tv).chain(net))
}

/// Fits the points of a file, which holds the tolerance and the two lengths of the domain, then x, y, z, u and v of each point. The
/// fit uses `spans` even spans each way, or its own knots if that is 0. Writes the numbers of control points, the knots and the
/// net.
fn cloud(
    source: &str,
    spans: usize,
    result: &str,
    runs: usize,
    count: usize,
) -> Result<(), Box<dyn Error>> {
    threads(count)?;
    let length = usize::try_from(fs::metadata(source)?.len() / 8)?.saturating_sub(3) / 5;
    let mut file = Numbers::open(source)?;
    let options = ApproximateOptions {
        refine: spans == 0,
        spans: (spans > 0).then_some([spans; 2]),
        ..ApproximateOptions::new(file.double()?)
    };
    let size = [file.double()?, file.double()?];
    let mut points = Vec::with_capacity(length);
    let mut parameters = Vec::with_capacity(length);
    for _ in 0..length {
        points.push(DVec3::new(file.double()?, file.double()?, file.double()?));
        parameters.push(DVec2::new(file.double()?, file.double()?));
    }
    let chart = Chart {
        topology: Topology::Disk,
        parameters,
        size,
        reason: String::new(),
    };
    let mut surface = None;
    for _ in 0..runs {
        let start = Instant::now();
        surface = Some(approximate(&points, &chart, &options, &Silent)?.surface);
        println!("T {:.9}", start.elapsed().as_secs_f64());
    }
    let surface = surface.ok_or("no run")?;
    let (u, v) = (surface.knots_u(), surface.knots_v());
    let counts = [u, v].map(|k| k.control_point_count() as f64);
    let net = surface.control_points().points().iter();
    let net = net.flat_map(AsRef::<[f64; 3]>::as_ref);
    let knots = u.knots().iter().chain(v.knots());
    write(result, counts.iter().chain(knots).chain(net))
}

fn closest(
    surface: &str,
    points: &str,
    result: &str,
    runs: usize,
    count: usize,
) -> Result<(), Box<dyn Error>> {
    threads(count)?;
    let mut file = Numbers::open(surface)?;
    let size = [file.int()?, file.int()?, file.int()?, file.int()?];
    let (tu, tv) = (
        file.doubles(size[0] + size[2] + 1)?,
        file.doubles(size[1] + size[3] + 1)?,
    );
    let net = ControlNet::new(size[1], size[0], file.points(size[0] * size[1])?)?;
    let surface = NurbsSurface::new(
        KnotVector::new(size[3], tv)?,
        KnotVector::new(size[2], tu)?,
        net,
        None,
    )?;
    let length = fs::metadata(points)?.len() / 24;
    let points = Numbers::open(points)?.points(usize::try_from(length)?)?;
    let mut feet = Vec::new();
    for _ in 0..runs {
        let start = Instant::now();
        let solver = ClosestPoint::new(&surface)?;
        feet = solver.closest_all(&points, None);
        println!("T {:.9}", start.elapsed().as_secs_f64());
    }
    let lower: Vec<f64> = feet.iter().map(|foot| foot.lower).collect();
    let upper: Vec<f64> = feet.iter().map(|foot| foot.distance).collect();
    write(result, lower.iter().chain(&upper))
}

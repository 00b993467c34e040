//! Our side of `compare/run.py`: reads the arrays that the peers read, prints one line `T seconds` per run.
//!
//! `compare grid IN OUT RUNS THREADS` and `compare closest SURFACE POINTS OUT RUNS THREADS`.

#![expect(
    clippy::print_stdout,
    reason = "its output is what compare/run.py reads"
)]

use nurbskin::chart::Topology;
use nurbskin::fit::interpolate::interpolate_at;
use nurbskin::nurbs::closest::ClosestPoint;
use nurbskin::{ControlNet, DVec3, KnotVector, NurbsSurface, PointGrid};
use std::error::Error;
use std::fs;
use std::time::Instant;

/// Little-endian numbers of a file, taken from the front.
struct Numbers(Vec<u8>, usize);

impl Numbers {
    fn open(path: &str) -> Result<Self, Box<dyn Error>> {
        Ok(Self(fs::read(path)?, 0))
    }
    fn int(&mut self) -> Result<usize, Box<dyn Error>> {
        let bytes = self
            .0
            .get(self.1..self.1 + 4)
            .ok_or("the file is too short")?;
        self.1 += 4;
        Ok(usize::try_from(i32::from_le_bytes(bytes.try_into()?))?)
    }
    fn doubles(&mut self, count: usize) -> Result<Vec<f64>, Box<dyn Error>> {
        let bytes = self
            .0
            .get(self.1..self.1 + 8 * count)
            .ok_or("the file is too short")?;
        self.1 += 8 * count;
        Ok(bytes
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]))
            .collect())
    }
    fn points(&mut self, count: usize) -> Result<Vec<DVec3>, Box<dyn Error>> {
        Ok(self
            .doubles(3 * count)?
            .chunks_exact(3)
            .map(DVec3::from_slice)
            .collect())
    }
}

fn write(path: &str, arrays: &[&[f64]]) -> Result<(), Box<dyn Error>> {
    Ok(fs::write(
        path,
        arrays
            .iter()
            .copied()
            .flatten()
            .flat_map(|x| x.to_le_bytes())
            .collect::<Vec<u8>>(),
    )?)
}

fn flat(points: &[DVec3]) -> Vec<f64> {
    points.iter().flat_map(|p| p.to_array()).collect()
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
    write(result, &[tu, tv, &flat(surface.control_points().points())])
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
    write(result, &[&lower, &upper])
}

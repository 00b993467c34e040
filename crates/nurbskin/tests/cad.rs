//! CAD files written and read back.

#![expect(clippy::unwrap_used, reason = "a panic is how a test fails")]

use nurbskin::io::iges::{self, IgesContent, IgesModel, WriteOptions};
use nurbskin::{ControlNet, DVec3, KnotVector, NurbsSurface};
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

mod faces;
mod iges_faces;
mod iges_mutated;
mod mangled;
mod reading;
mod real_files;
mod step;
mod writing;

fn surface(
    ku: KnotVector,
    kv: KnotVector,
    f: impl Fn(usize, usize) -> DVec3,
    w: Option<Vec<f64>>,
) -> NurbsSurface {
    let (m, n) = (ku.control_point_count(), kv.control_point_count());
    NurbsSurface::new(ku, kv, ControlNet::from_fn(m, n, f).unwrap(), w).unwrap()
}

/// An open, uneven surface of these degrees.
fn wavy(p: usize, q: usize, m: usize, n: usize) -> NurbsSurface {
    let breaks = |spans: usize| -> Vec<f64> { (0..=spans).map(|i| (i as f64).powf(1.3)).collect() };
    surface(
        KnotVector::clamped(p, &breaks(m - p)).unwrap(),
        KnotVector::clamped(q, &breaks(n - q)).unwrap(),
        |i, j| {
            let (x, y) = (i as f64 / 3.0, j as f64 * 0.7);
            DVec3::new(x, y, (0.9 * x).sin() * (1.1 * y).cos() - 2.0)
        },
        None,
    )
}

/// A tube, periodic along v, of radius 7.
fn tube(m: usize, n: usize) -> NurbsSurface {
    let breaks: Vec<f64> = (0..=n).map(|i| i as f64 / n as f64).collect();
    surface(
        KnotVector::uniform(3, m).unwrap(),
        KnotVector::periodic(3, &breaks).unwrap(),
        |i, j| {
            let angle = TAU * (j % n) as f64 / n as f64;
            DVec3::new(7.0 * angle.cos(), 7.0 * angle.sin(), 3.0 * i as f64)
        },
        None,
    )
}

/// The sphere of radius 5 about (1, 2, 3), exactly: nine by five control points.
fn sphere() -> NurbsSurface {
    let around = [
        (1, 0),
        (1, 1),
        (0, 1),
        (-1, 1),
        (-1, 0),
        (-1, -1),
        (0, -1),
        (1, -1),
        (1, 0),
    ];
    let along = [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1)];
    let weights = (0..45)
        .map(|k| {
            let half = |odd: bool| if odd { FRAC_1_SQRT_2 } else { 1.0 };
            half(k % 9 % 2 == 1) * half(k / 9 % 2 == 1)
        })
        .collect();
    surface(
        KnotVector::new(2, vec![0., 0., 0., 1., 1., 2., 2., 3., 3., 4., 4., 4.]).unwrap(),
        KnotVector::new(2, vec![0., 0., 0., 1., 1., 2., 2., 2.]).unwrap(),
        |i, j| {
            let ((x, y), (r, z)) = (around[i], along[j]);
            DVec3::new(1.0, 2.0, 3.0)
                + 5.0 * DVec3::new(f64::from(r * x), f64::from(r * y), f64::from(z))
        },
        Some(weights),
    )
}

fn bytes_of(surfaces: &[NurbsSurface], options: &WriteOptions) -> Vec<u8> {
    let mut bytes = Vec::new();
    let content = IgesContent {
        surfaces,
        ..Default::default()
    };
    let written = iges::write(&mut bytes, &content, options).unwrap();
    assert_eq!(written.bytes, bytes.len());
    assert_eq!(written.lines, bytes.iter().filter(|&&b| b == b'\n').count());
    bytes
}

fn exact(surfaces: &[NurbsSurface]) -> Vec<u8> {
    bytes_of(surfaces, &WriteOptions::default())
}

fn read(bytes: &[u8]) -> IgesModel {
    iges::read(bytes, "part.igs").unwrap()
}

fn refusal(bytes: &[u8]) -> String {
    iges::read(bytes, "part.igs").unwrap_err().to_string()
}

/// All numbers of a surface, bit by bit.
fn bits(s: &NurbsSurface) -> Vec<u64> {
    let points = s
        .control_points()
        .points()
        .iter()
        .flat_map(|p| p.to_array());
    let knots = s
        .knots_u()
        .knots()
        .iter()
        .chain(s.knots_v().knots())
        .copied();
    let weights = s.weights().unwrap_or(&[]).iter().copied();
    points
        .chain(knots)
        .chain(weights)
        .map(f64::to_bits)
        .collect()
}

/// An entity of a hand-made file: type, form, directory entry of its matrix, parameters.
type Entity<'a> = (u32, i32, usize, &'a str);

fn hand_made(global: &str, entities: &[Entity<'_>]) -> String {
    let mut cards = [String::new(), String::new(), String::new()];
    let mut counts = [0usize; 3];
    let mut put = |which: usize, data: &str| {
        counts[which] += 1;
        let letter = ["G", "D", "P"][which];
        cards[which] += &format!("{data:<72}{letter}{:>7}\n", counts[which]);
        counts[which]
    };
    let mut rest = global;
    while !rest.is_empty() {
        let (head, tail) = rest.split_at(rest.len().min(72));
        put(0, head);
        rest = tail;
    }
    for (k, (entity, form, matrix, parameters)) in entities.iter().enumerate() {
        let mut range = (usize::MAX, 0);
        for line in parameters.lines() {
            let at = put(2, &format!("{line:<64} {:>7}", 2 * k + 1));
            range = (range.0.min(at), at);
        }
        let status = if *entity == 126 {
            "00010000"
        } else {
            "00000000"
        };
        put(
            1,
            &format!(
                "{entity:>8}{:>8}{:>8}{:>8}{:>8}{:>8}{matrix:>8}{:>8}{status}",
                range.0, "", "", 4, "", ""
            ),
        );
        let lines = range.1 + 1 - range.0;
        put(
            1,
            &format!(
                "{entity:>8}{:>8}{:>8}{lines:>8}{form:>8}{:>16}{:>8}{:>8}",
                "", "", "", "LABEL", k
            ),
        );
    }
    let [g, d, p] = counts;
    format!(
        "{:<72}S{:>7}\n{}{}{}{:<72}T{:>7}\n",
        "Made by hand",
        1,
        cards[0],
        cards[1],
        cards[2],
        format!("S{:>7}G{g:>7}D{d:>7}P{p:>7}", 1),
        1
    )
}

const MILLIMETRES: &str = "1H,,1H;,,,,,32,38,6,308,15,,1.,2,2HMM;";

//! Damaged files of scanners: a scan that agrees with itself, or a sentence; never a panic, a hang or more memory than
//! the file is worth.

use super::make::{e57, gzip, las, npy, pcd, ptx, wave};
use nurbskin::io::scan::read_bytes;
use nurbskin::scan::{Organisation, Scan};
use nurbskin::{DVec3, Error};
use std::path::Path;
use std::time::Instant;

/// Damaged files per good one; more from the environment variable `NURBSKIN_MUTANTS`.
fn mutants() -> usize {
    let asked = std::env::var("NURBSKIN_MUTANTS").ok();
    asked.and_then(|n| n.parse().ok()).unwrap_or(300)
}

struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(self.0 >> 33).unwrap() % n.max(1)
    }
}

/// Small good files.
fn good() -> Vec<(&'static str, Vec<u8>)> {
    let wave = wave();
    let cells: Vec<(DVec3, [i64; 2])> = wave
        .iter()
        .copied()
        .zip((0..).map(|k| [k % 5, k / 5]))
        .collect();
    let numbers: Vec<f64> = wave.iter().flat_map(|p| p.to_array()).collect();
    let many: Vec<DVec3> = (0..40)
        .flat_map(|k| wave.iter().map(move |p| *p + f64::from(k)))
        .collect();
    let two = ptx(&wave, 4, 5, DVec3::ZERO) + &ptx(&wave, 4, 5, DVec3::X);
    vec![
        ("a.pcd", pcd(&wave, 5, 4, "ascii")),
        ("b.pcd", pcd(&wave, 5, 4, "binary")),
        ("c.pcd", pcd(&wave, 5, 4, "binary_compressed")),
        ("a.ptx", two.into_bytes()),
        (
            "a.off",
            b"OFF\n4 2 0\n0 0 0\n1 0 0 1 2 3\n1 1 0\n0 1 0\n3 0 1 2\n4 0 1 2 3 1 1 1\n".to_vec(),
        ),
        (
            "b.off",
            b"NCOFF 3 1\n0 0 0 0 0 1 9 9 9\n1 0 0 0 0 1 9 9 9\n1 1 0 0 0 1 9 9 9\n3 0 1 2\n"
                .to_vec(),
        ),
        ("a.npy", npy("<f8", false, "(5, 4, 3)", &numbers)),
        ("b.npy", npy(">f4", true, "(20, 3)", &numbers)),
        (
            "a.e57",
            e57(&[cells.clone(), cells.clone()], DVec3::X, false),
        ),
        ("b.e57", e57(&[cells], DVec3::X, true)),
        ("a.las", las(&wave, 3, false, DVec3::ZERO)),
        ("b.las", las(&wave, 6, false, DVec3::ZERO)),
        ("a.laz", las(&many, 1, true, DVec3::ZERO)),
        ("b.laz", las(&many, 7, true, DVec3::ZERO)),
        ("a.xyz.gz", gzip(b"1 2 3\n4 5 6\n7 8 9\n")),
        (
            "a.pts",
            b"3\n1 2 3 -100 9 9 9\n4 5 6 -100 9 9 9\n7 8 9 -100 9 9 9\n".to_vec(),
        ),
    ]
}

/// Checksums of the pages of E57, which damage would be stopped by otherwise.
fn seal(file: &mut [u8]) {
    for page in file.chunks_exact_mut(1024) {
        let mut sum = u32::MAX;
        for &byte in &page[..1020] {
            sum ^= u32::from(byte);
            for _ in 0..8 {
                sum = (sum >> 1) ^ (0x82f6_3b78 & (sum & 1).wrapping_neg());
            }
        }
        page[1020..].copy_from_slice(&(!sum).to_be_bytes());
    }
}

fn damage(file: &mut Vec<u8>, random: &mut Random) {
    const WORDS: [&[u8]; 12] = [
        b"18446744073709551615",
        b"4294967295",
        b"-1",
        b"99999999",
        b"nan",
        b"1e999",
        b"\n\n",
        b" ",
        b"\0\0\0\0\0\0\0\0",
        b"\xff\xff\xff\xff",
        b"\xff\xff\xff\x7f",
        b"\x00\x00\x00\x10",
    ];
    for _ in 0..1 + random.below(3) {
        if file.is_empty() {
            return;
        }
        // Headers are where the lies are.
        let reach = if random.below(2) == 0 {
            file.len()
        } else {
            file.len().min(400)
        };
        let at = random.below(reach);
        match random.below(6) {
            0 => file.truncate(at),
            1 => file[at] ^= 1 << random.below(8),
            2 => file[at] = u8::try_from(random.below(256)).unwrap(),
            3 => {
                let word = WORDS[random.below(WORDS.len())];
                file.splice(at..at, word.iter().copied());
            }
            4 => {
                // Over what is there: binary counts keep their places.
                let word = WORDS[random.below(WORDS.len())];
                for (byte, new) in file[at..].iter_mut().zip(word) {
                    *byte = *new;
                }
            }
            _ => {
                // A number in place of a number.
                let digits = |b: &u8| b.is_ascii_digit();
                if let Some(start) = file[at..].iter().position(digits).map(|k| at + k) {
                    let end = file[start..].iter().position(|b| !digits(b));
                    let end = end.map_or(file.len(), |k| start + k);
                    let word = WORDS[random.below(6)];
                    file.splice(start..end, word.iter().copied());
                }
            }
        }
    }
}

fn check(scan: &Scan) {
    let count = scan.points.len();
    match &scan.organisation {
        Organisation::Unordered => {}
        Organisation::Rows(lengths) => assert_eq!(lengths.iter().sum::<usize>(), count),
        Organisation::Grid(grid) => {
            assert_eq!(grid.count_u * grid.count_v, grid.cells.len());
            let mut seen = vec![false; count];
            for &cell in grid.cells.iter().flatten() {
                assert!(!std::mem::replace(&mut seen[cell as usize], true));
            }
        }
        Organisation::Mesh(triangles) => {
            assert!(
                triangles
                    .as_flattened()
                    .iter()
                    .all(|&k| (k as usize) < count)
            );
        }
    }
    assert!(
        scan.normals
            .as_ref()
            .is_none_or(|normals| normals.len() == count)
    );
}

#[test]
fn damage_gets_a_scan_or_a_sentence() {
    let mut random = Random(20_261_121);
    for (name, good) in good() {
        let (mut read, begun) = (0, Instant::now());
        for k in 0..mutants() {
            let mut file = good.clone();
            damage(&mut file, &mut random);
            if name.ends_with("e57") {
                seal(&mut file);
            }
            let started = Instant::now();
            let size = file.len();
            match read_bytes(file, Path::new(name)) {
                Ok(scan) => {
                    check(&scan);
                    assert!(scan.points.len() <= 8 * size + 64, "{name} {k}");
                    read += 1;
                }
                Err(error) => {
                    let text = error.to_string();
                    assert!(
                        matches!(error, Error::Read { .. } | Error::Unsupported(_)),
                        "{name} {k}: {text}"
                    );
                    assert!(
                        !text.contains('\n') && text.len() < 600,
                        "{name} {k}: {text}"
                    );
                }
            }
            assert!(started.elapsed().as_secs_f64() < 1.0, "{name} {k}");
        }
        println!(
            "{name}: {read} of {} read, {:.2} s",
            mutants(),
            begun.elapsed().as_secs_f64()
        );
    }
}

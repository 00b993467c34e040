//! Files of other systems in the folder named by `NURBSKIN_DATA`: read as OpenCascade reads them, and, damaged by a
//! seeded mutator, refused with a sentence or read as sound models, never wrong without a word.

use super::iges_mutated::{Random, damaged, sound};
use nurbskin::cad::{Extent, Model, check, extent, mass};
use nurbskin::io::cad::{CadFile, CadFormat, CadWriteOptions, cad_text, read_cad_bytes};
use nurbskin::{DVec3, Unit};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

/// A file, and what OpenCascade 8.0 finds in it: `compare/cad.py`.
struct Real {
    name: &'static str,
    /// Degrees along u and v, and the number of faces that have them.
    degrees: &'static [([usize; 2], usize)],
    area: f64,
    low: [f64; 3],
    high: [f64; 3],
    /// How many variants of it are made.
    variants: usize,
    /// Whether area and box are fast to measure.
    small: bool,
}

const FILES: [Real; 5] = [
    Real {
        name: "sphere_rhino.igs",
        degrees: &[([2, 2], 1)],
        area: 12.56637054031102,
        low: [-1.0, -1.0, -1.0],
        high: [1.0, 1.0, 1.0],
        variants: 620,
        small: true,
    },
    Real {
        name: "pygem_pipe.step",
        degrees: &[([1, 1], 2), ([1, 2], 4)],
        area: 69115038.38538374,
        low: [-1000.0, -1000.0, 0.0],
        high: [1000.0, 1000.0, 10000.0],
        variants: 1000,
        small: true,
    },
    Real {
        name: "tigl_d150_wing.igs",
        degrees: &[([1, 1], 2), ([3, 3], 6)],
        area: 132027991.83648103,
        low: [12743.713526508167, 0.0, -1845.888364382062],
        high: [22136.9723101, 16963.4790601, -106.96354187532053],
        variants: 300,
        small: true,
    },
    Real {
        name: "tigl_nacelle.stp",
        degrees: &[([5, 5], 6)],
        area: 10920037.318612136,
        low: [-35.81948495250966, -580.0908896974033, -644.975759243649],
        high: [2564.0000001, 580.0908896974119, 593.6734562509437],
        variants: 50,
        small: false,
    },
    Real {
        name: "occt_hammer.iges",
        degrees: &[([1, 1], 14), ([1, 2], 15), ([2, 2], 12), ([3, 1], 4)],
        area: 397795992.70638895,
        low: [-10939.2722401, 17053.2448499, -13714.2039801],
        high: [2239.5174661, 21342.9604601, 24717.17880524581],
        variants: 30,
        small: false,
    },
];

/// The content of a file, if it is there.
fn content(name: &str) -> Option<Vec<u8>> {
    let Some(folder) = std::env::var_os("NURBSKIN_DATA") else {
        println!("skipped: NURBSKIN_DATA does not name a folder of CAD files");
        return None;
    };
    let found = std::fs::read(PathBuf::from(folder).join("cad").join(name));
    if found.is_err() {
        println!("skipped: {name} is not there");
    }
    found.ok()
}

#[test]
fn real_files_are_read_as_opencascade_reads_them() {
    for real in FILES {
        let Some(bytes) = content(real.name) else {
            continue;
        };
        let file = read_cad_bytes(&bytes, Path::new(real.name)).unwrap();
        assert!(file.unread.is_empty(), "{}: {:?}", real.name, file.unread);
        assert_eq!(file.model.unit, Unit::Millimetre);
        let mut degrees = BTreeMap::<[usize; 2], usize>::new();
        for face in file.model.faces() {
            *degrees.entry(face.surface.degree()).or_default() += 1;
        }
        let found: Vec<_> = degrees.into_iter().collect();
        assert_eq!(found, real.degrees, "{}", real.name);
        let area = mass(&file.model).unwrap().area;
        assert!(
            (area / real.area - 1.0).abs() < 1e-5,
            "{}: {area}",
            real.name
        );
        let Extent { low, high, .. } = extent(&file.model).unwrap();
        let [wanted_low, wanted_high] = [real.low, real.high].map(DVec3::from_array);
        let off = (low - wanted_low).abs().max((high - wanted_high).abs());
        let size = wanted_low.distance(wanted_high);
        assert!(
            off.max_element() < 1e-6 * size,
            "{}: {low} {high}",
            real.name
        );
    }
}

/// No variant may take longer.
const LIMIT: Duration = Duration::from_secs(60);
/// A silent change of area or box by more than this share must be a model that holds together.
const CHANGE: f64 = 1e-3;

/// A file to be damaged, with its own area and box where they are compared.
struct Good {
    name: &'static str,
    bytes: Vec<u8>,
    measured: Option<(f64, Extent)>,
}

fn measured(model: &Model) -> Option<(f64, Extent)> {
    Some((mass(model).ok()?.area, extent(model).ok()?))
}

/// Whether a model that was read without a word, and is another one than the file's, is good: then it reads back from
/// the other format with the same area. Otherwise `check` must find it out.
fn holds_together(file: &CadFile, area: f64) -> bool {
    let gaps = ["edge_surface_gap", "loop_gap", "boundary_off_surface"];
    let report = check(&file.model);
    if gaps
        .iter()
        .any(|gap| report.get(gap).is_none_or(|c| !c.pass))
    {
        return true;
    }
    let other = if file.format == "step" {
        CadFormat::Iges
    } else {
        CadFormat::Step
    };
    let Ok(text) = cad_text(&file.model, other, &CadWriteOptions::default()) else {
        return false;
    };
    let again = read_cad_bytes(&text, Path::new("again"));
    let again = again.ok().and_then(|again| measured(&again.model));
    again.is_some_and(|(again, _)| (again / area - 1.0).abs() < 1e-6)
}

/// Reads the variant of this number; whether it was accepted.
fn variant(good: &Good, number: usize) -> bool {
    let seed = 0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(number as u64 + 1);
    let bytes = damaged(&good.bytes, &mut Random(seed | 1));
    let file = match read_cad_bytes(&bytes, Path::new(good.name)) {
        Ok(file) => file,
        Err(error) => {
            let text = error.to_string();
            assert!(!text.contains('\n') && text.len() < 500, "{text}");
            return false;
        }
    };
    sound(&file.model);
    let silent = file.warnings.is_empty() && file.unread.is_empty();
    if let Some((area, size)) = good.measured.filter(|_| silent)
        && let Some((found, now)) = measured(&file.model)
    {
        let moved = (now.low - size.low).abs().max((now.high - size.high).abs());
        let same =
            (found / area - 1.0).abs() <= CHANGE && moved.max_element() <= CHANGE * size.diagonal();
        assert!(
            same || holds_together(&file, found),
            "area {found} of {area}, box {now:?} of {size:?}, and not a word"
        );
    }
    true
}

#[test]
fn damaged_real_files_are_refused_or_read_as_sound_models() {
    let mut goods = Vec::new();
    let mut jobs = Vec::new();
    for real in FILES {
        let Some(bytes) = content(real.name) else {
            continue;
        };
        let file = read_cad_bytes(&bytes, Path::new(real.name)).unwrap();
        jobs.extend((0..real.variants).map(|k| (goods.len(), k)));
        goods.push(Good {
            name: real.name,
            bytes,
            measured: measured(&file.model).filter(|_| real.small),
        });
    }
    if jobs.is_empty() {
        return;
    }
    // Threads of their own, which one that hangs does not stop from being named.
    let (goods, jobs) = (Arc::new(goods), Arc::new(jobs));
    let next = Arc::new(AtomicUsize::new(0));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let (tell, told) = mpsc::channel();
    for thread in 0..threads {
        let (goods, jobs) = (Arc::clone(&goods), Arc::clone(&jobs));
        let (next, tell) = (Arc::clone(&next), tell.clone());
        std::thread::spawn(move || {
            while let Some(&(good, k)) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                let _ = tell.send((thread, good, k, None));
                let done = std::panic::catch_unwind(|| variant(&goods[good], k));
                let _ = tell.send((thread, good, k, Some(done.ok())));
            }
        });
    }
    drop(tell);
    let mut running = vec![None; threads];
    let mut accepted = 0;
    loop {
        match told.recv_timeout(LIMIT / 20) {
            Ok((thread, good, k, None)) => running[thread] = Some((Instant::now(), good, k)),
            Ok((thread, good, k, Some(done))) => {
                running[thread] = None;
                let fine = done.unwrap_or_else(|| panic!("variant {k} of {}", goods[good].name));
                accepted += usize::from(fine);
            }
            Err(mpsc::RecvTimeoutError::Disconnected) => break,
            Err(mpsc::RecvTimeoutError::Timeout) => {}
        }
        let late = running.iter().flatten().find(|r| r.0.elapsed() > LIMIT);
        if let Some((_, good, k)) = late {
            panic!("variant {k} of {} takes long", goods[*good].name);
        }
    }
    println!("{accepted} of {} variants were read", jobs.len());
    assert!(
        10 * accepted > jobs.len(),
        "the mutator changes too much to test anything"
    );
}

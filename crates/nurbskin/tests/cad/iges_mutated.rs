//! Files damaged by a seeded mutator: refused with a sentence, or read as finite, valid models.

use super::iges_faces::file_of;
use super::{exact, sphere, tube, wavy};
use nurbskin::cad::Model;
use nurbskin::io::iges::read_cad;

/// Xorshift.
pub(super) struct Random(pub(super) u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        usize::try_from(self.0 >> 33).unwrap() % n.max(1)
    }
}

/// One to three changes: bits flipped, bytes that mean something put in, lines cut, shifted, doubled or swapped, counts
/// and pointers changed, the end cut off.
pub(super) fn damaged(good: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = good.to_vec();
    for _ in 0..=random.below(3) {
        let at = random.below(bytes.len());
        let lines: Vec<usize> = (0..bytes.len()).filter(|&k| bytes[k] == b'\n').collect();
        let line = random.below(lines.len());
        let from = lines.get(line).map_or(0, |k| k + 1);
        let range = from..lines.get(line + 1).map_or(bytes.len(), |k| k + 1);
        match random.below(10) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = b"0123456789,;.-+EDHSGPT \n"[random.below(24)],
            2 => drop(bytes.drain(range)),
            3 => bytes.truncate(at),
            4 => {
                let copy = bytes[range.clone()].to_vec();
                drop(bytes.splice(range.end..range.end, copy));
            }
            5 => {
                let line = &mut bytes[range];
                line.rotate_right((1 + at % 7).min(line.len()));
            }
            // Digits: counts, pointers, numbers, which keep their columns.
            _ => {
                let digit = (at..bytes.len()).find(|&k| bytes[k].is_ascii_digit());
                if let Some(k) = digit {
                    bytes[k] = b'0' + u8::try_from(random.below(10)).unwrap();
                }
            }
        }
        if bytes.is_empty() {
            bytes.push(b' ');
        }
    }
    bytes
}

/// The types hold what they promise; what is left to see is that places are finite.
pub(super) fn sound(model: &Model) {
    assert!(model.vertices().iter().all(|p| p.is_finite()));
    for face in model.faces() {
        let net = face.surface.control_points();
        assert!(net.points().iter().all(|p| p.is_finite()));
        assert!(!face.loops.is_empty());
        for used in face.loops.iter().flat_map(|l| &l.uses) {
            assert!(used.edge < model.edges().len());
            let (a, b) = used.pcurve.domain();
            assert!(used.pcurve.point(f64::midpoint(a, b)).is_finite());
        }
    }
}

/// Reads `count` variants; how many were accepted.
fn attack(good: &[u8], count: usize, seed: u64) -> usize {
    let mut random = Random(seed | 1);
    let mut accepted = 0;
    for k in 0..count {
        let bytes = damaged(good, &mut random);
        let before = std::time::Instant::now();
        let Ok(file) = read_cad(&bytes, "part.igs") else {
            continue;
        };
        assert!(
            before.elapsed().as_secs() < 20,
            "variant {k} of seed {seed} takes long"
        );
        accepted += 1;
        sound(&file.model);
    }
    accepted
}

#[test]
fn damaged_files_are_refused_or_read_as_sound_models() {
    let e = |kind: u32, form: i32, text: &str| (kind, form, 0, text.to_owned());
    let plate = "1,1,1,1,0,0,1,0,0,0,0,1,1,0,0,1,1,1,1,1,1,0,0,0,4,0,0,0,4,0,4,4,0,0,1,0,1";
    let brep = [
        e(186, 0, "3,1,0"),
        e(514, 1, "1,5,1"),
        e(510, 0, "7,1,1,9"),
        e(128, 0, plate),
        e(508, 0, "4,0,11,1,1,0,0,11,2,1,0,0,11,3,1,0,0,11,4,1,0"),
        e(
            504,
            0,
            "4,15,13,1,13,2,17,13,2,13,3,19,13,3,13,4,21,13,4,13,1",
        ),
        e(502, 0, "4,0.,0.,0.,4.,0.,0.,4.,4.,0.,0.,4.,0."),
        e(110, 0, "0.,0.,0.,4.,0.,0."),
        e(110, 0, "4.,0.,0.,4.,4.,0."),
        e(110, 0, "4.,4.,0.,0.,4.,0."),
        e(110, 0, "0.,4.,0.,0.,0.,0."),
    ];
    let swept = [
        e(120, 0, "3,5,0.5,2."),
        e(110, 0, "1.,0.,0.,1.,0.,5."),
        e(
            112,
            0,
            "3,1,3,1,0.,1.,4.,0.,0.,0.,1.,2.,0.,1.,6.,1.,0.,0.,1,2,3,4,5,6,7,8,9,10,11,12",
        ),
        e(118, 1, "9,11,0,0"),
        e(104, 1, "1.,0.,1.,0.,0.,-4.,0.,2.,0.,0.,2."),
        e(106, 12, "2,3,0.,0.,1.,1.,2.,1.,3.,0.,1."),
        e(144, 0, "15,1,0,17"),
        e(192, 0, "19,21,2."),
        e(142, 0, "1,15,0,23,2"),
        e(116, 0, "0.,0.,0."),
        e(123, 0, "0.,0.,1."),
        e(102, 0, "4,25,27,29,31"),
        e(100, 0, "0.,0.,0.,2.,0.,0.,2."),
        e(110, 0, "0.,2.,0.,0.,2.,3."),
        (100, 0, 33, "3.,0.,0.,2.,0.,0.,-2.".to_owned()),
        e(110, 0, "2.,0.,3.,2.,0.,0."),
        e(124, 0, "1,0,0,0,0,1,0,0,0,0,1,0"),
        e(308, 0, "0,1HA,1,1"),
        e(408, 0, "35,1.,2.,3.,2."),
    ];
    let global = super::MILLIMETRES;
    let texts = [
        file_of(global, &brep).into_bytes(),
        file_of(global, &swept).into_bytes(),
        exact(&[wavy(2, 3, 4, 5), sphere()]),
        exact(&[tube(4, 5)]),
    ];
    for (seed, text) in texts.iter().enumerate() {
        let accepted = attack(text, 300, 77 + 2 * seed as u64);
        assert!(
            accepted > 10,
            "{accepted}: the mutator changes too much to test anything"
        );
    }
}

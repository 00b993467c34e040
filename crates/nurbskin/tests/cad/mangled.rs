//! Files cut short, changed or lying: refused with a sentence, never a panic, a hang or a full memory.

use super::{
    Entity, MILLIMETRES, bits, bytes_of, exact, hand_made, read, refusal, sphere, tube, wavy,
};
use nurbskin::io::iges::{self, IgesContent, Layout, WriteOptions};
use nurbskin::{ControlNet, DVec3, KnotVector, NurbsSurface};
use proptest::prelude::*;

#[test]
fn a_file_cut_anywhere_is_refused() {
    let good = exact(&[wavy(2, 2, 4, 4), tube(4, 5)]);
    for end in 0..good.len() - 9 {
        // The terminate card's last columns are only its number.
        let error = iges::read(&good[..end], "part.igs");
        assert!(error.is_err(), "cut after {end} bytes of {}", good.len());
    }
}

#[test]
fn counts_that_lie_cost_nothing() {
    for parameters in [
        "128,9000000,9000000,3,3,0,0,1,0,0,0;",
        "128,9223372036854775807,1,1,1,0,0,1,0,0,0;",
        "126,99999999999999999999,1;",
        "106,2,4000000000,0.,0.;",
        "102,1000000000,1;",
        "116,1,2,99999999H;",
        "106,2,60;",
    ] {
        let entity: u32 = parameters[..3].parse().unwrap();
        let form = if entity == 106 { 2 } else { 0 };
        let file = hand_made(MILLIMETRES, &[(entity, form, 0, parameters)]);
        let text = refusal(file.as_bytes());
        assert!(text.contains("(P1)"), "{text}");
    }
    // Two entities that share one long record, a circle of matrices, a composite of itself.
    let file = hand_made(
        MILLIMETRES,
        &[(116, 0, 0, "116,1,2,3;"), (116, 0, 0, "116,1,2,3;")],
    );
    let shared = file.replacen("     116       2", "     116       1", 1);
    assert!(refusal(shared.as_bytes()).contains("belong to another entity"));
    let matrix = "124,1,0,0,0,0,1,0,0,0,0,1,0;";
    let circle = hand_made(
        MILLIMETRES,
        &[
            (124, 0, 3, matrix),
            (124, 0, 1, matrix),
            (116, 0, 1, "116,1,2,3;"),
        ],
    );
    assert!(refusal(circle.as_bytes()).contains("circle"));
    let own = hand_made(
        MILLIMETRES,
        &[(102, 0, 0, "102,1,1;"), (102, 0, 0, "102,1,9;")],
    );
    assert!(refusal(own.as_bytes()).contains("D9, but there is no entity"));
    // Composites that repeat one line again and again.
    let mut repeats: Vec<Entity<'_>> = vec![(110, 0, 0, "110,0,0,0,1,1,1;")];
    let many = ["102,300,1"]
        .into_iter()
        .chain([",1,1,1,1,1,1,1,1,1,1,1,1,1"; 23]);
    let many = many.collect::<Vec<_>>().join("\n") + ";";
    repeats.extend([(102, 0, 0, many.as_str()); 5]);
    let repeated = refusal(hand_made(MILLIMETRES, &repeats).as_bytes());
    assert!(repeated.contains("over and over"), "{repeated}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Whatever happens to a file, reading it ends, without a panic; and what it says can be written again.
    #[test]
    fn mangled_files_are_read_or_refused(
        which in 0usize..3,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0u8..4), 1..6),
    ) {
        let mut bytes = match which {
            0 => exact(&[wavy(2, 3, 4, 5), sphere()]),
            1 => hand_made(MILLIMETRES, &[
                (124, 0, 0, "124,1,0,0,0,0,1,0,0,0,0,1,0;"),
                (100, 0, 1, "100,5.,1.,1.,3.,1.,1.,3.;"),
                (126, 0, 0, "126,2,1,0,0,1,0,0.,0.,1.,2.,2.,\n1.,1.,1.,0,0,0,1,0,0,1,1,0,0.5,1.5,0,0,1;"),
                (102, 0, 0, "102,2,3,5;"),
                (106, 12, 0, "106,2,2,1,2,3,4,5,6;"),
                (144, 0, 0, "144,1,0,0,1;"),
            ]).into_bytes(),
            _ => bytes_of(&[tube(4, 4)], &WriteOptions { layout: Layout::Paper, ..Default::default() }),
        };
        for (at, byte, kind) in changes {
            let at = at.index(bytes.len());
            // Characters that mean something do more harm than others.
            let likely = b"0123456789,;.-+EDHSGPT \n"[usize::from(byte) % 24];
            match kind {
                0 => bytes[at] = byte,
                1 => bytes[at] = likely,
                2 => { bytes.remove(at); }
                _ => bytes.insert(at, likely),
            }
        }
        if let Ok(model) = iges::read(&bytes, "part.igs") {
            let surfaces: Vec<NurbsSurface> = model.surfaces.into_iter().map(|s| s.surface).collect();
            let content = IgesContent { surfaces: &surfaces, ..Default::default() };
            let _ = iges::write(&mut Vec::new(), &content, &WriteOptions::default());
        }
    }

    /// Random surfaces of any degree return bit by bit.
    #[test]
    fn random_surfaces_return(
        p in 1usize..=9,
        q in 1usize..=9,
        more in (0usize..4, 0usize..4),
        seed in any::<u64>(),
        rational in any::<bool>(),
    ) {
        let mut state = seed | 1;
        let mut random = || {
            // Xorshift: any 64 bits, of which the finite numbers are taken.
            loop {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                let x = f64::from_bits(state);
                if x.is_finite() {
                    return x;
                }
            }
        };
        let (m, n) = (p + 1 + more.0, q + 1 + more.1);
        let points = (0..m * n).map(|_| DVec3::new(random(), random(), random())).collect();
        // Spread widely, and never all equal: such weights are none.
        let weights = rational.then(|| (0..m * n).map(|_| 0.5 + random().abs().max(1e-300).ln().abs()).collect());
        let s = NurbsSurface::new(
            KnotVector::uniform(p, m).unwrap(),
            KnotVector::uniform(q, n).unwrap().with_domain(-0.3, 1.0 / 7.0).unwrap(),
            ControlNet::new(m, n, points).unwrap(),
            weights,
        ).unwrap();
        prop_assert_eq!(bits(&read(&exact(std::slice::from_ref(&s))).surfaces[0].surface), bits(&s));
    }
}

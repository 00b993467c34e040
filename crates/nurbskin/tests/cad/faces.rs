//! Models written as IGES: bare and trimmed faces.

use super::step::{whole, with_hole};
use super::{bits, read, sphere, wavy};
use nurbskin::io::iges::{self, IgesContent, WriteOptions};
use nurbskin::{DVec3, Unit, cad::Model};
use std::collections::BTreeMap;

fn written(model: &Model) -> Vec<u8> {
    let mut bytes = Vec::new();
    let content = IgesContent {
        model: Some(model),
        ..Default::default()
    };
    iges::write(&mut bytes, &content, &WriteOptions::default()).unwrap();
    bytes
}

/// Entity type, form and status number of each entry of the directory, with its parameters.
fn entries(bytes: &[u8]) -> Vec<(u32, u32, String, String)> {
    let text = std::str::from_utf8(bytes).unwrap();
    let cards = |letter: &'static str| text.lines().filter(move |l| &l[72..73] == letter);
    let directory: Vec<&str> = cards("D").collect();
    let mut parameters = BTreeMap::<usize, String>::new();
    for card in cards("P") {
        let entry = card[64..72].trim().parse().unwrap();
        parameters
            .entry(entry)
            .or_default()
            .push_str(card[..64].trim_end());
    }
    let pairs = directory.chunks(2).enumerate();
    let entry = |(k, pair): (usize, &[&str])| {
        let number = |text: &str| text.trim().parse().unwrap();
        let numbers = parameters[&(2 * k + 1)].clone();
        (
            number(&pair[0][..8]),
            number(&pair[1][32..40]),
            pair[0][64..72].to_owned(),
            numbers,
        )
    };
    pairs.map(entry).collect()
}

#[test]
fn a_trimmed_face_has_both_curves_of_each_border() {
    for reversed in [false, true] {
        let mut model = with_hole(reversed);
        model.unit = Unit::Inch;
        model.colour = Some([255, 0, 0]);
        let bytes = written(&model);
        let all = entries(&bytes);
        let count = |entity: u32| all.iter().filter(|e| e.0 == entity).count();
        // Four lines and their composite, a circle; each in the plane and in space.
        let counts = [314, 406, 128, 126, 102, 142, 144].map(count);
        assert_eq!(counts, [1, 1, 1, 10, 2, 2, 1]);
        for (entity, form, status, numbers) in &all {
            let flat = numbers.ends_with(",0.,0.,1.;") && status == "00010500";
            match entity {
                126 => assert!(flat || status == "00010000", "{status} {numbers}"),
                102 => assert!(status == "00010500" || status == "00010000"),
                128 | 142 => assert_eq!(status, "00010000"),
                406 => assert_eq!((form, status.as_str()), (&15, "00010300")),
                _ => {}
            }
        }
        let parametric = |e: &&(u32, u32, String, String)| e.0 == 126 && e.2 == "00010500";
        assert_eq!(all.iter().filter(parametric).count(), 5);
        // The pointers: surface, outer border given, one hole; the hole; no associativity, one property.
        let at = |entity: u32| {
            let found = all.iter().enumerate().filter(|(_, e)| e.0 == entity);
            found.map(|(k, _)| 2 * k + 1).collect::<Vec<_>>()
        };
        let (outer, hole) = (at(142)[0], at(142)[1]);
        let face = &all.last().unwrap().3;
        let (surface, name) = (at(128)[0], at(406)[0]);
        assert_eq!(
            *face,
            format!("144,{surface},1,1,{outer},{hole},0,1,{name};")
        );
        for border in [outer, hole] {
            let border = &all[(border - 1) / 2].3;
            let numbers = border.trim_end_matches(';').split(',');
            let numbers: Vec<usize> = numbers.map(|n| n.parse().unwrap()).collect();
            assert_eq!((numbers[1], numbers[2], numbers[5]), (0, surface, 3));
            assert_eq!(all[(numbers[3] - 1) / 2].2, "00010500");
            assert_eq!(all[(numbers[4] - 1) / 2].2, "00010000");
        }
        // The face looks along the normal of its surface, and its borders have it on their left.
        let back = read(&bytes);
        assert_eq!(back.global.unit, Unit::Inch);
        let found = &back.surfaces[0];
        assert!(found.trimmed);
        let normal = found.surface.normal(1.0, 1.0).unwrap();
        assert_eq!(normal, if reversed { -DVec3::Z } else { DVec3::Z });
        let around = |c: &nurbskin::nurbs::NurbsCurve| {
            let points: Vec<DVec3> = (0..=64).map(|k| c.point(f64::from(k) / 64.0)).collect();
            points.windows(2).map(|p| p[0].cross(p[1]).z).sum::<f64>()
        };
        let flat = back.curves.iter().filter(|c| c.parametric);
        let turns: Vec<f64> = flat.map(|c| around(&c.curve)).collect();
        assert!(turns[..4].iter().sum::<f64>() > 0.0 && turns[4] < 0.0);
        // Point by point, the curve in space is the surface along the one in its plane.
        let space: Vec<_> = back.curves.iter().filter(|c| !c.parametric).collect();
        for (flat, space) in back.curves.iter().filter(|c| c.parametric).zip(space) {
            for k in 0..=8 {
                let t = f64::from(k) / 8.0;
                let uv = flat.curve.point(t);
                let gap = found
                    .surface
                    .point(uv.x, uv.y)
                    .distance(space.curve.point(t));
                assert!(gap < 1e-14, "{gap}");
            }
        }
    }
}

#[test]
fn untrimmed_faces_are_bare_surfaces_to_the_last_bit() {
    let mut model = whole(&sphere());
    model.add_whole_surface(&wavy(3, 2, 6, 7), 1e-9).unwrap();
    let bytes = written(&model);
    let all = entries(&bytes);
    assert!(all.iter().all(|e| e.0 == 128 && e.2 == "00000000"));
    // K1, K2, M1, M2, in this order: counts less one, then degrees.
    assert!(
        all[1].3.starts_with("128,5,6,3,2,0,0,1,0,0,"),
        "{}",
        all[1].3
    );
    let back = read(&bytes);
    for (found, face) in back.surfaces.iter().zip(model.faces()) {
        assert_eq!(bits(&found.surface), bits(&face.surface));
        assert!(!found.trimmed);
    }
    // The name of the model is that of the product.
    assert!(String::from_utf8(bytes).unwrap().contains("4Hpart,"));
}

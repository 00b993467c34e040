//! Files that others might have written.

use super::{MILLIMETRES, bits, exact, hand_made, read, refusal, wavy};
use nurbskin::{DVec3, Unit};

fn near(a: DVec3, b: DVec3) {
    assert!((a - b).length() < 1e-12, "{a} is not {b}");
}

#[test]
fn curves_points_and_matrices_are_read() {
    let file = hand_made(
        MILLIMETRES,
        &[
            (100, 0, 0, "100,5.,1.,1.,3.,1.,1.,3.;"), // a quarter
            (100, 0, 3, "100,0.0D0,0,0,2.E0,0,2,0;"), // a full circle, moved by D3
            (124, 0, 0, "124,0,-1,0,10., 1,0,0,0, 0,0,1,0;"), // unused here
            (110, 0, 9, "110,1,2,3,4,5,6;"),
            (124, 0, 11, "124,0,-1,0,0,1,0,0,0,0,0,1,0;"), // a quarter turn about z, then D11
            (124, 0, 0, "124,1,0,0,100,0,1,0,0,0,0,1,0;"), // a shift along x
            (
                126,
                0,
                0,
                "126,2,1,0,0,1,0,0.,0.,1.,2.,2.,\n1.,1.,1.,0,0,0,1,0,0,1,1,0,0.5,1.5,0,0,1;",
            ),
            (102, 0, 0, "102,2,1,7;"),
            (116, 0, 0, "116,1.5,,-2.5D-1;"),
            (106, 1, 0, "106,1,2,7.,1,2,3,4;"),
            (106, 2, 0, "106,2,2,1,2,3,4,5,6;"),
            (106, 3, 0, "106,3,1,1,2,3,0,0,1;"),
            (106, 11, 0, "106,1,2,7.,1,2,3,4;"),
            (106, 63, 0, "106,1,3,0.,0,0,1,0,0,1;"),
            (106, 31, 0, "106,1,2,7.,1,2,3,4;"), // section lines: a drawing aid
            (402, 1, 0, "402,2,1,7;"),
        ],
    );
    // D3 is not a matrix: its line is named.
    let text = refusal(file.as_bytes());
    assert_eq!(
        text,
        "part.igs, line 5 (D3): its transformation matrix should be at D3, but there is no entity 124"
    );
    let file = file.replace(
        "       3        00000000D      3",
        "       5        00000000D      3",
    );
    let model = read(file.as_bytes());
    let curve = |k: usize| &model.curves[k].curve;
    assert_eq!(model.curves.len(), 4);
    for k in 0..=50 {
        let t = f64::from(k) / 50.0;
        let p = curve(0).point(t);
        assert!(
            (p - DVec3::new(1.0, 1.0, 5.0)).length() - 2.0 < 1e-14
                && p.x > 1.0 - 1e-12
                && p.y > 1.0 - 1e-12
        );
        let p = curve(1).point(t) - DVec3::X * 10.0;
        assert!((p.length() - 2.0).abs() < 1e-14);
    }
    near(curve(1).point(0.25), DVec3::new(8.0, 0.0, 0.0)); // (0, 2) turned by 90 degrees
    near(curve(2).point(0.0), DVec3::new(98.0, 1.0, 3.0));
    near(curve(2).point(1.0), DVec3::new(95.0, 4.0, 6.0));
    assert_eq!(curve(3).domain(), (0.5, 1.5));
    near(curve(3).point(1.0), DVec3::X);
    assert!(model.curves[3].subordinate && !model.curves[3].parametric);
    assert_eq!(model.composites.len(), 1);
    assert_eq!(
        model.composites[0].parts,
        [curve(0).clone(), curve(2).clone()]
    );
    assert_eq!(model.points.len(), 1 + 2 + 2 + 1);
    assert_eq!(model.points[0], DVec3::new(1.5, 0.0, -0.25));
    assert_eq!(model.points[1], DVec3::new(1.0, 2.0, 7.0));
    assert_eq!(model.polylines.len(), 2);
    assert_eq!(model.polylines[1].len(), 4);
    assert_eq!(model.unread, [(106, 1), (402, 1)].into());
    assert_eq!(model.entities[&106], 6);
}

#[test]
fn delimiters_may_be_chosen_and_fields_left_out() {
    let file = hand_made(
        "1H/,1H#////4HA/#B//////////".replace(',', "/").as_str(),
        &[(116, 0, 0, "116/1./2./3.#")],
    );
    // Parameter 14 (unit flag) and all behind it are missing: inches, and the reader says so.
    let file = file.replace("//////////", "////////# ");
    let model = read(file.as_bytes());
    assert_eq!(model.global.delimiters, ['/', '#']);
    assert_eq!(model.points, [DVec3::new(1.0, 2.0, 3.0)]);
    assert_eq!(model.global.unit, Unit::Inch);
    assert!(!model.global.unit_given && model.warnings[0].contains("inches"));
    let file = hand_made(",,,,,,,,,,,,,8;", &[(116, 0, 0, "116,1.,2.,3.;")]);
    let model = read(file.as_bytes());
    assert_eq!(model.global.unit, Unit::Inch);
    near(model.points[0], DVec3::new(0.001, 0.002, 0.003));
    assert!(model.warnings[0].contains("0.001"));
}

#[test]
fn line_ends_and_lengths_are_tolerated() {
    let bytes = exact(&[wavy(2, 3, 5, 6)]);
    let text = String::from_utf8(bytes.clone()).unwrap();
    let wanted = bits(&read(&bytes).surfaces[0].surface);
    let crlf = text.replace('\n', "\r\n") + "\u{1a}";
    let cr = text.replace('\n', "\r");
    let records = text.replace('\n', "");
    let long = text.replace('\n', "     \n\n");
    for variant in [crlf, cr, records, long] {
        assert_eq!(bits(&read(variant.as_bytes()).surfaces[0].surface), wanted);
    }
}

#[test]
fn refusals_name_the_line() {
    let good = String::from_utf8(exact(&[wavy(3, 3, 5, 5)])).unwrap();
    let line_with = |text: &str| good.lines().position(|l| l.contains(text)).unwrap() + 1;
    let changed = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        refusal(good.replacen(from, to, 1).as_bytes())
    };
    let p1 = line_with("128,4,4,3,3");
    let tests = [
        (refusal(b""), "the file is empty".to_owned()),
        (
            refusal(b"ply\nformat ascii 1.0\n"),
            "line 1: this is not an IGES file".into(),
        ),
        (refusal(&[0u8; 300]), "binary".into()),
        (
            refusal(format!("{:<72}C      1\n", "").as_bytes()),
            "compressed ASCII form".into(),
        ),
        (
            refusal(format!("{:<72}B      1\n", "").as_bytes()),
            "binary form".into(),
        ),
        (
            changed("128,4,4,3,3", "128,9,4,3,3"),
            "numbers (control points): its counts do not fit".into(),
        ),
        (
            changed("128,4,4,3,3,", "128,9999999,"),
            format!("line {p1} (P1): 9999999 values (K1)"),
        ),
        (
            changed("128,4,4,3,3,", "128,-4,4,3, "),
            format!("line {p1} (P1): K1 is -4"),
        ),
        (
            changed("128,4,4,3,3", "126,4,4,3,3"),
            format!("line {p1} (P1): the data of an entity 126"),
        ),
        (
            changed("128,4,4,3,3", "128,4,4,3,x"),
            format!("line {p1} (P1): `x` where an integer"),
        ),
        (
            changed("     128       1", "     128       9"),
            "(D1): its parameter data should be".into(),
        ),
    ];
    for (found, wanted) in &tests {
        assert!(
            found.contains(wanted.as_str()),
            "{found}\nshould have\n{wanted}"
        );
        assert!(found.starts_with("part.igs"), "{found}");
    }
}

#[test]
fn a_composite_with_an_unread_part_is_counted_as_unread() {
    let file = hand_made(
        MILLIMETRES,
        &[
            (116, 0, 0, "116,1.,2.,3.;"),
            (110, 0, 0, "110,0,0,0,1,1,1;"),
            (102, 0, 0, "102,2,1,3;"),
        ],
    );
    let model = read(file.as_bytes());
    assert!(model.composites.is_empty());
    assert_eq!(model.unread, [(102, 1)].into());
}

#[test]
fn periodic_forms_are_kept_where_they_are_true() {
    let points = "1,0,0, 0,1,0, -1,0,0, 0,-1,0, 1,0,0, 0,1,0,";
    let curve = |periodic: u8, points: &str| {
        let text = format!(
            "126,5,2,1,1,1,{periodic},-2,-1,0,1,2,3,4,5,6,\n1,1,1,1,1,1,\n{points}\n0.,4.,0,0,1;"
        );
        read(hand_made(MILLIMETRES, &[(126, 0, 0, &text)]).as_bytes()).curves[0]
            .curve
            .clone()
    };
    let round = curve(1, points);
    assert!(round.knots().is_periodic());
    near(round.point(0.5), round.point(4.5));
    // The same curve, told as what it also is; and one that does not close though it says so.
    let plain = curve(0, points);
    assert!(!plain.knots().is_periodic() && !plain.knots().is_clamped());
    near(plain.point(0.7), round.point(0.7));
    let open = curve(1, "1,0,0, 0,1,0, -1,0,0, 0,-1,0, 1,0,0, 0,1,5,");
    assert!(!open.knots().is_periodic());

    let tube = |last: &str| {
        let text = format!(
            "128,3,1,1,1,1,0,1,1,0,\n-1,0,1,2,3,4, 0,0,1,1,\n1,1,1,1,1,1,1,1,\n\
             0,0,0, 1,0,0, 0,1,0, 0,0,0,\n0,0,2, 1,0,2, 0,1,2, {last},\n0,3,0,1;"
        );
        read(hand_made(MILLIMETRES, &[(128, 0, 0, &text)]).as_bytes()).surfaces[0]
            .surface
            .clone()
    };
    assert_eq!(tube("0,0,2").periodic(), [true, false]);
    assert_eq!(tube("0,0,3").periodic(), [false, false]);
    near(tube("0,0,2").point(3.5, 0.5), tube("0,0,2").point(0.5, 0.5));
}

#[test]
fn a_part_of_the_domain_may_be_asked_for() {
    let text = "128,3,1,1,1,0,0,1,0,0,\n0,0,1,2,3,3, 0,0,1,1,\n1,1,1,1,1,1,1,1,\n\
                0,0,0, 1,0,0, 2,1,0, 3,0,0,\n0,0,2, 1,0,2, 2,1,2, 3,0,2,\n0.5,3.,.25,1.;";
    let model = read(hand_made(MILLIMETRES, &[(128, 0, 0, text)]).as_bytes());
    let s = &model.surfaces[0].surface;
    assert_eq!(s.domain(), [(0.5, 3.0), (0.25, 1.0)]);
    near(s.point(0.5, 0.25), DVec3::new(0.5, 0.0, 0.5));
    near(s.point(2.0, 1.0), DVec3::new(2.0, 1.0, 2.0));
}

#[test]
fn a_full_circle_closes() {
    let model = read(hand_made(MILLIMETRES, &[(100, 0, 0, "100,1,0,0,3,4,3,4;")]).as_bytes());
    let circle = &model.curves[0].curve;
    assert_eq!(circle.control_points().len(), 9);
    near(circle.point(0.0), DVec3::new(3.0, 4.0, 1.0));
    near(circle.point(1.0), DVec3::new(3.0, 4.0, 1.0));
    near(circle.point(0.5), DVec3::new(-3.0, -4.0, 1.0));
    near(circle.point(0.25), DVec3::new(-4.0, 3.0, 1.0));
}

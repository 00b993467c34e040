//! What the coordinate system says of the unit.

use super::super::bytes::u16_at;
use super::header::Header;
use super::{assume, state};
use crate::Scan;
use nurbskin_geometry::unit::Unit;

/// Metres of a foot of the US survey.
const SURVEY_FOOT: f64 = 1200.0 / 3937.0;

/// Takes the unit from the coordinate system: its well-known text, or its `GeoTIFF` keys.
pub(super) fn find(scan: &mut Scan, header: &Header, bytes: &[u8]) {
    const USER: &[u8] = b"LASF_Projection";
    let text = header
        .record(bytes, USER, 2112)
        .map(String::from_utf8_lossy);
    if let Some(text) = text.filter(|text| !text.trim_matches(['\0', ' ']).is_empty()) {
        return of_text(scan, &text);
    }
    if let Some(keys) = header.record(bytes, USER, 34735) {
        return of_keys(scan, keys);
    }
    assume(
        scan,
        "the file names no coordinate system: metres assumed, as is usual",
    );
}

/// From `PROJCS[..., UNIT["metre", 1], ...]`, or `LENGTHUNIT` in newer texts.
fn of_text(scan: &mut Scan, text: &str) {
    let projected = ["PROJCS[", "PROJCRS[", "LOCAL_CS[", "ENGCRS["];
    let Some(start) = projected.iter().find_map(|word| text.find(word)) else {
        return geographic(scan);
    };
    let end = ["VERT_CS[", "VERTCRS["]
        .iter()
        .filter_map(|word| text[start..].find(word))
        .min();
    let horizontal = &text[start..end.map_or(text.len(), |end| start + end)];
    // The unit of the projection is the last one, after those of its base and its parameters.
    let factor = horizontal
        .match_indices("UNIT[")
        .filter(|(at, _)| !horizontal[..*at].ends_with("ANGLE"))
        .filter_map(|(at, word)| {
            let mut words = horizontal[at + word.len()..].split([',', ']']);
            let name = words.next()?.to_lowercase();
            let factor: f64 = words.next()?.trim().parse().ok()?;
            (!name.contains("degree") && !name.contains("radian")).then_some(factor)
        })
        .last();
    match factor {
        Some(factor) => of_factor(scan, factor),
        None => assume(
            scan,
            "the coordinate system does not say its unit: metres assumed",
        ),
    }
}

/// From the keys of `GeoTIFF`: 1024 is the kind of system, 3076 its unit of length.
fn of_keys(scan: &mut Scan, keys: &[u8]) {
    let entries = usize::from(u16_at(keys, 6).unwrap_or(0));
    let value = |wanted: u16| {
        (1..=entries).find_map(|k| {
            let field = |n: usize| u16_at(keys, 8 * k + 2 * n);
            (field(0)? == wanted && field(1)? == 0)
                .then(|| field(3))
                .flatten()
        })
    };
    match (value(1024), value(3076)) {
        (_, Some(9001)) => of_factor(scan, 1.0),
        (_, Some(9002)) => of_factor(scan, 0.3048),
        (_, Some(9003)) => of_factor(scan, SURVEY_FOOT),
        (Some(2), _) => geographic(scan),
        _ => assume(
            scan,
            "the coordinate system does not say its unit: metres assumed",
        ),
    }
}

/// The unit that is so many metres.
fn of_factor(scan: &mut Scan, metres: f64) {
    let is = |value: f64| (metres / value - 1.0).abs() < 1e-9;
    if is(1.0) {
        state(scan, Unit::Metre);
    } else if is(0.3048) {
        state(scan, Unit::Foot);
    } else if (metres / SURVEY_FOOT - 1.0).abs() < 1e-6 {
        state(scan, Unit::Foot);
        assume(
            scan,
            "the unit is the US survey foot, read as the international foot: lengths are too short by two millionths",
        );
    } else {
        let what = format!("the unit is {metres} metres, which is unknown: metres assumed");
        assume(scan, &what);
    }
}

fn geographic(scan: &mut Scan) {
    assume(
        scan,
        "the coordinates are longitudes and latitudes in degrees, not lengths: project them to metres first",
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_geometry::unit::UnitSource;

    #[test]
    fn units_of_coordinate_systems() {
        let degrees = "GEOGCS[\"WGS 84\",UNIT[\"degree\",0.01745]]";
        for (text, unit) in [
            (
                format!("PROJCS[\"UTM\",{degrees},UNIT[\"metre\",1]]"),
                Some(Unit::Metre),
            ),
            (
                format!(
                    "COMPD_CS[\"a\",PROJCS[\"b\",{degrees},UNIT[\"foot\",0.3048]],VERT_CS[\"c\",UNIT[\"m\",1]]]"
                ),
                Some(Unit::Foot),
            ),
            (
                format!("PROJCS[\"b\",{degrees},UNIT[\"US survey foot\",0.304800609601219]]"),
                Some(Unit::Foot),
            ),
            (
                "PROJCRS[\"a\",ANGLEUNIT[\"gon\",0.0157],LENGTHUNIT[\"metre\",1]]".to_owned(),
                Some(Unit::Metre),
            ),
            (degrees.to_owned(), None),
        ] {
            let mut scan = Scan::default();
            of_text(&mut scan, &text);
            let found = (scan.unit_source == UnitSource::File).then_some(scan.unit);
            assert_eq!(found, unit, "{text}");
            assert!(
                unit == Some(Unit::Metre) || unit == Some(Unit::Foot) || scan.warnings.len() == 1
            );
        }
    }
}

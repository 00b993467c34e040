//! What is in a file, in lines for people.

use crate::show::short;
use nurbskin::pipeline::{CadContent, Checked, Content, Information, ScanContent};
use nurbskin::unit::UnitSource;
use std::fmt::Write;

/// Surfaces that are listed one by one.
const MOST_SURFACES: usize = 20;

/// The table of a file.
pub(crate) fn lines(information: &Information) -> String {
    let mut rows = vec![("format", information.format.to_string())];
    match &information.content {
        Content::Scan(scan) => of_scan(scan, &mut rows, information),
        Content::Cad(cad) => of_cad(cad, &mut rows, information),
    }
    if let Some([low, high]) = information.bounding_box {
        let size = [0, 1, 2].map(|k| short(high[k] - low[k]));
        let place = low.map(short);
        rows.push((
            "box",
            format!(
                "{} {} from ({})",
                size.join(" x "),
                information.unit,
                place.join(", ")
            ),
        ));
    }
    let source = match information.unit_source {
        UnitSource::File => "the file says so",
        UnitSource::Option => "as asked",
        UnitSource::Assumed => "assumed",
    };
    rows.push(("unit", format!("{} ({source})", information.unit)));
    let mut text = format!("{}\n", information.path);
    for (name, value) in rows {
        // A string takes everything.
        let _ = writeln!(text, "  {name:12}{value}");
    }
    text
}

/// The checks of a CAD file, the failed ones marked.
pub(crate) fn checks(checked: &Checked) -> String {
    let mut text = format!(
        "{}: {} ({} faces, {})\n",
        checked.path, checked.verdict, checked.faces, checked.format
    );
    for check in &checked.checks {
        let mark = match (check.pass, check.within) {
            (false, _) => "FAIL",
            (true, false) => "note",
            (true, true) => "ok",
        };
        let place = check
            .where_
            .filter(|_| !check.within)
            .map_or_else(String::new, |p| {
                format!("  at ({}, {}, {})", short(p.x), short(p.y), short(p.z))
            });
        // A string takes everything.
        let _ = writeln!(
            text,
            "  {mark:5}{:20}{:>12} {:4} limit {}{place}",
            check.name,
            short(check.measured),
            check.unit,
            short(check.limit)
        );
    }
    let _ = match &checked.differs {
        None => writeln!(text, "  ok   reads_back"),
        Some(why) => writeln!(text, "  FAIL reads_back  {why}"),
    };
    text
}

type Rows = Vec<(&'static str, String)>;

fn of_scan(scan: &ScanContent, rows: &mut Rows, information: &Information) {
    let mut points = scan.points.to_string();
    if let Some(rejected) = scan.rejected {
        for (count, why) in [
            (rejected.non_finite, "not finite"),
            (rejected.duplicate, "repeated"),
            (rejected.outlier, "outlying"),
        ] {
            if count > 0 {
                points += &format!(", {count} {why}");
            }
        }
    }
    if scan.normals {
        points += ", with normals";
    }
    rows.push(("points", points));
    let mut order = scan.organisation.to_owned();
    if let Some([m, n]) = scan.grid {
        order += &format!(" of {m} x {n} cells");
    }
    if let Some(triangles) = scan.triangles {
        order += &format!(" of {triangles} triangles");
    }
    rows.push(("order", order));
    if let (Some(spacing), Some(noise)) = (scan.spacing, scan.noise) {
        let unit = information.unit;
        rows.push(("spacing", format!("{} {unit}", short(spacing))));
        rows.push(("noise", format!("{} {unit}", short(noise))));
    }
    if let Some(parts) = scan.parts {
        rows.push(("parts", parts.to_string()));
    }
    let topology = scan
        .topology
        .map_or("not known", |topology| topology.name());
    rows.push(("topology", topology.to_owned()));
}

fn of_cad(cad: &CadContent, rows: &mut Rows, information: &Information) {
    let unit = information.unit;
    let mut faces = format!("{}, {} {unit}2", cad.faces, short(cad.area));
    if cad.closed {
        faces += ", closed";
    }
    rows.push(("faces", faces));
    if let Some(volume) = cad.volume {
        rows.push(("volume", format!("{} {unit}3", short(volume))));
    }
    let list = |entities: &std::collections::BTreeMap<String, usize>| {
        let each = entities
            .iter()
            .map(|(kind, count)| format!("{count} of {kind}"));
        each.collect::<Vec<_>>().join(", ")
    };
    rows.push(("entities", list(&cad.entities)));
    if !cad.unread.is_empty() {
        rows.push(("unread", list(&cad.unread)));
    }
    for surface in cad.surfaces.iter().take(MOST_SURFACES) {
        let [m, n] = surface.control_points;
        let [p, q] = surface.degree;
        let mut words = vec![format!("{m} x {n} control points, degree {p} x {q}")];
        for (is, word) in [
            (surface.rational, "rational"),
            (surface.closed[0] || surface.closed[1], "closed"),
            (surface.trimmed, "trimmed"),
        ] {
            if is {
                words.push(word.to_owned());
            }
        }
        rows.push(("surface", words.join(", ")));
    }
    if cad.surfaces.len() > MOST_SURFACES {
        rows.push((
            "",
            format!("and {} more", cad.surfaces.len() - MOST_SURFACES),
        ));
    }
}

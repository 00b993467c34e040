//! What is in a file.

use super::text::Page;
use super::{Show, measured};
use crate::failure::Result;
use nurbskin::Unit;
use nurbskin::cad::SurfaceKind;
use nurbskin::pipeline::{CadContent, Content, Information, ScanContent, SurfaceContent};
use nurbskin::unit::{UnitSource, counted, grouped, percent, three_digits};
use std::collections::BTreeMap;

/// Surfaces that are listed one by one without `--verbose`.
const MOST_SURFACES: usize = 3;

impl Show {
    /// What is in a file: data, so it is printed whatever is asked to be quiet.
    ///
    /// # Errors
    /// As [`print()`](super::print).
    pub(crate) fn information(&self, information: &Information) -> Result<()> {
        let warnings: Vec<String> = information
            .warnings
            .iter()
            .map(|warning| {
                // This verb takes no unit, and says who does.
                let whose = if warning.contains("--unit") {
                    " (an option of `fit`, `deviation` and `convert`)"
                } else {
                    ""
                };
                format!("{}: {warning}{whose}", information.path)
            })
            .collect();
        self.warnings(&warnings, &[]);
        let mut page = self.page();
        fill(&mut page, information, self.verbose);
        self.data(&page.finish())
    }
}

/// The table of a file.
fn fill(page: &mut Page, information: &Information, verbose: bool) {
    let unit = information.unit;
    page.line(&format!("{}:", information.path));
    if let Some(corners) = information.bounding_box {
        let size = measured::extents(corners);
        // What is nothing beside the size is nothing.
        let tiny = 1e-9 * size.into_iter().fold(0.0, f64::max);
        let low = corners[0].map(|x| if x.abs() <= tiny { 0.0 } else { x });
        page.row(
            "size",
            &format!("{}, from {}", unit.size(size), unit.place(low)),
        );
    }
    let source = match information.unit_source {
        UnitSource::File => "from the file",
        UnitSource::Option => "as given",
        UnitSource::Assumed => "assumed: the file does not say",
    };
    page.row("unit", &format!("{unit} ({source})"));
    match &information.content {
        Content::Scan(scan) => of_scan(page, scan, unit),
        Content::Cad(cad) => of_cad(page, cad, unit, verbose),
    }
    page.row("format", &information.format.to_uppercase());
}

fn of_scan(page: &mut Page, scan: &ScanContent, unit: Unit) {
    let normals = if scan.normals { ", with normals" } else { "" };
    let points = counted(scan.points, "point", "points");
    let order = match (scan.grid, scan.triangles) {
        (Some([m, n]), _) => format!("grid of {m} x {n}"),
        (_, Some(triangles)) => {
            format!("mesh of {}", counted(triangles, "triangle", "triangles"))
        }
        _ => scan.organisation.to_owned(),
    };
    page.row("scan", &format!("{points}, {order}{normals}"));
    if let Some(rejected) = scan.rejected {
        let why = [
            (rejected.outlier, "outliers"),
            (rejected.duplicate, "duplicates"),
            (rejected.non_finite, "not finite"),
        ];
        let total: usize = why.iter().map(|(n, _)| n).sum();
        if total > 0 {
            let why: Vec<String> = why
                .iter()
                .filter(|(n, _)| *n > 0)
                .map(|(n, why)| format!("{} {why}", grouped(*n)))
                .collect();
            let share = total as f64 / scan.points.max(1) as f64;
            page.row(
                "ignored",
                &format!(
                    "{} ({}): {}",
                    counted(total, "point", "points"),
                    percent(share),
                    why.join(", ")
                ),
            );
        }
    }
    if let (Some(spacing), Some(noise)) = (scan.spacing, scan.noise) {
        page.row("spacing", &unit.length(spacing));
        let noise = match noise > 0.0 {
            true => format!("{} (1 sigma)", unit.length(noise)),
            false => "none".to_owned(),
        };
        page.row("noise", &noise);
    }
    if let Some(parts) = scan.parts {
        page.row("parts", &grouped(parts));
    }
    let topology = scan
        .topology
        .map_or("not known without a fit", |topology| topology.name());
    page.row("topology", topology);
}

fn of_cad(page: &mut Page, cad: &CadContent, unit: Unit, verbose: bool) {
    let parts = [
        counted(cad.solids, "solid", "solids"),
        counted(cad.shells, "shell", "shells"),
        counted(cad.faces, "face", "faces"),
    ];
    let closed = if cad.closed { "closed" } else { "open" };
    page.row(
        "model",
        &format!(
            "{}, {closed}, area {}",
            parts.join(", "),
            area(unit, cad.area)
        ),
    );
    if let Some(x) = cad.volume {
        page.row("volume", &volume(unit, x));
    }
    let list = |entities: &BTreeMap<String, usize>| {
        let each = entities
            .iter()
            .map(|(kind, n)| format!("{} {kind}", grouped(*n)));
        each.collect::<Vec<_>>().join(", ")
    };
    let header = &cad.header;
    for (label, value) in [
        ("author", &header.author),
        ("from", &header.organization),
        ("system", &header.system),
        ("date", &header.date),
    ] {
        if !value.trim().is_empty() {
            page.row(label, value.trim());
        }
    }
    if verbose || cad.surfaces.len() <= MOST_SURFACES {
        for (k, surface) in cad.surfaces.iter().enumerate() {
            let label = if cad.surfaces.len() == 1 {
                "surface".to_owned()
            } else {
                format!("surface {}", k + 1)
            };
            page.row(&label, &of_surface(surface));
        }
    } else {
        page.row("surfaces", &kinds(&cad.surfaces));
    }
    if !cad.unread.is_empty() {
        page.row("not read", &list(&cad.unread));
    }
    if verbose {
        page.row("entities", &list(&cad.entities));
    }
}

fn of_surface(surface: &SurfaceContent) -> String {
    let [m, n] = surface.control_points;
    let [p, q] = surface.degree;
    let degree = if p == q {
        format!("degree {p}")
    } else {
        format!("degree {p} x {q}")
    };
    let mut words = vec![format!(
        "{}, {m} x {n} control points, {degree}",
        kind(surface.kind, 1)
    )];
    for (is, word) in [
        (surface.rational, "rational"),
        (surface.closed[0] || surface.closed[1], "closed"),
        (surface.trimmed, "trimmed"),
    ] {
        if is {
            words.push(word.to_owned());
        }
    }
    words.join(", ")
}

/// How many there are of each kind.
fn kinds(surfaces: &[SurfaceContent]) -> String {
    let mut found: Vec<(SurfaceKind, usize)> = Vec::new();
    for surface in surfaces {
        match found.iter_mut().find(|known| known.0 == surface.kind) {
            Some(known) => known.1 += 1,
            None => found.push((surface.kind, 1)),
        }
    }
    found.sort_by_key(|known| std::cmp::Reverse(known.1));
    let words: Vec<String> = found
        .into_iter()
        .map(|(of, n)| format!("{}\u{a0}{}", grouped(n), kind(of, n)))
        .collect();
    let control: usize = surfaces
        .iter()
        .map(|s| s.control_points[0] * s.control_points[1])
        .sum();
    format!(
        "{}; {} (-v lists them)",
        words.join(", "),
        counted(control, "control point", "control points")
    )
}

fn kind(kind: SurfaceKind, n: usize) -> &'static str {
    let [one, more] = match kind {
        SurfaceKind::BSpline => ["B-spline", "B-splines"],
        SurfaceKind::Plane => ["plane", "planes"],
        SurfaceKind::Cylinder => ["cylinder", "cylinders"],
        SurfaceKind::Cone => ["cone", "cones"],
        SurfaceKind::Sphere => ["sphere", "spheres"],
        SurfaceKind::Torus => ["torus", "tori"],
        SurfaceKind::Revolution => ["surface of revolution", "surfaces of revolution"],
        SurfaceKind::Extrusion => ["extruded surface", "extruded surfaces"],
        SurfaceKind::Ruled => ["ruled surface", "ruled surfaces"],
        SurfaceKind::ParametricSpline => ["parametric spline", "parametric splines"],
    };
    if n == 1 { one } else { more }
}

/// An area in mm2, cm2 or m2; of inches and feet in their own unit.
fn area(unit: Unit, x: f64) -> String {
    match unit {
        Unit::Inch | Unit::Foot => format!("{} {unit}2", three_digits(x)),
        _ => {
            let mm2 = x * unit.millimetres().powi(2);
            let (scale, symbol) = match mm2 {
                x if x >= 1e5 => (1e-6, "m2"),
                x if x >= 1e3 => (1e-2, "cm2"),
                _ => (1.0, "mm2"),
            };
            format!("{} {symbol}", three_digits(mm2 * scale))
        }
    }
}

/// A volume in mm3, cm3 or m3; of inches and feet in their own unit.
fn volume(unit: Unit, x: f64) -> String {
    match unit {
        Unit::Inch | Unit::Foot => format!("{} {unit}3", three_digits(x)),
        _ => {
            let mm3 = x * unit.millimetres().powi(3);
            let (scale, symbol) = match mm3.abs() {
                x if x >= 1e8 => (1e-9, "m3"),
                x if x >= 1e3 => (1e-3, "cm3"),
                _ => (1.0, "mm3"),
            };
            format!("{} {symbol}", three_digits(mm3 * scale))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_and_volumes_have_fitting_units() {
        let mm = Unit::Millimetre;
        assert_eq!(area(mm, 397_795_994.0), "398 m2");
        assert_eq!(area(mm, 36788.0), "368 cm2");
        assert_eq!(area(Unit::Metre, 0.0001), "100 mm2");
        assert_eq!(area(Unit::Inch, 12.5), "12.5 in2");
        assert_eq!(volume(mm, 5e5), "500 cm3");
        assert_eq!(volume(Unit::Metre, 2.5), "2.5 m3");
    }
}

//! Tables of the figures in the JSON of a verb.
//!
//! Each table formats one section of the JSON with lengths in the displayed units. Unknown figures are omitted.

use super::document::Table;
use super::text::{count, seconds, with_unit};
use nurbskin_geometry::unit::{Unit, percent};
use serde_json::Value;

/// Stages of `time`, in order of execution.
const STAGES: [&str; 10] = [
    "read",
    "clean",
    "order",
    "align",
    "rarefy",
    "enrich",
    "fit",
    "deviation",
    "write",
    "total",
];

/// All tables for which the JSON of `fit`, `deviation` or `info` has figures, in order.
pub(super) fn tables(outcome: &Value, unit: Unit) -> Vec<Table> {
    let read = outcome.get("input").unwrap_or(outcome);
    let mut tables = vec![read_table("Read", read, unit)];
    if let Some(cad) = outcome.get("cad") {
        tables.push(read_table("Surface", cad, unit));
    }
    tables.push(alignment(outcome, unit));
    tables.push(fitted(outcome, unit));
    tables.push(parts(outcome, unit));
    tables.push(checked(outcome));
    tables.push(written(outcome));
    tables.push(times(outcome));
    tables.push(notes(outcome));
    tables.retain(|table| !table.rows.is_empty());
    tables
}

/// Checks with a lower limit.
const AT_LEAST: [&str; 5] = [
    "faces",
    "knot_distance",
    "edge_length",
    "face_width",
    "solid_volume",
];
/// Largest number of notes.
const NOTES: usize = 12;
/// Largest number of listed kinds of entities, the most frequent first.
const KINDS: usize = 8;

/// Rows of a table; unknown figures are omitted.
#[derive(Default)]
struct Rows(Vec<Vec<String>>);

impl Rows {
    fn add(&mut self, name: &str, value: Option<String>) {
        if let Some(value) = value.filter(|value| !value.is_empty()) {
            self.0.push(vec![name.to_owned(), value]);
        }
    }

    fn table(self, title: &'static str) -> Table {
        Table {
            title,
            rows: self.0,
        }
    }
}

fn text(value: &Value, key: &str) -> Option<String> {
    let found = value.get(key)?.as_str()?;
    Some(found.replace('_', " "))
}

fn length(value: &Value, key: &str, unit: Unit) -> Option<String> {
    Some(unit.length(value.get(key)?.as_f64()?))
}

/// A figure other than a length, with its unit.
fn measure(value: &Value, key: &str, unit: &str) -> Option<String> {
    Some(with_unit(value.get(key)?.as_f64()?, unit))
}

/// A count with its noun, in the singular for one.
fn things(value: &Value, key: &str, one: &str, many: &str) -> Option<String> {
    let n = value.get(key)?.as_u64()?;
    Some(format!("{} {}", count(n), if n == 1 { one } else { many }))
}

fn whole(value: &Value, key: &str) -> Option<String> {
    Some(count(value.get(key)?.as_u64()?))
}

/// `18 × 20`.
fn product(value: &Value, key: &str) -> Option<String> {
    let list = value.get(key)?.as_array()?.iter();
    let words: Vec<String> = list.filter_map(|n| n.as_u64().map(count)).collect();
    Some(words.join(" × "))
}

/// `u`, `v`, `u and v`, `no`.
fn directions(value: &Value, key: &str) -> Option<String> {
    let list = value.get(key)?.as_array()?;
    let is = |k: usize| list.get(k).and_then(Value::as_bool).unwrap_or(false);
    Some(
        match (is(0), is(1)) {
            (true, true) => "in u and v",
            (true, false) => "in u",
            (false, true) => "in v",
            (false, false) => "no",
        }
        .to_owned(),
    )
}

fn yes(value: &Value, key: &str) -> Option<String> {
    let is = value.get(key)?.as_bool()?;
    Some(if is { "yes" } else { "no" }.to_owned())
}

/// An input file, scan or CAD, in its own unit if it has one.
fn read_table(title: &'static str, read: &Value, unit: Unit) -> Table {
    let own = read.get("unit").and_then(Value::as_str);
    let unit = own.and_then(Unit::from_symbol).unwrap_or(unit);
    let mut rows = Rows::default();
    rows.add(
        "file",
        read.get("path").and_then(Value::as_str).map(str::to_owned),
    );
    rows.add("format", text(read, "format"));
    rows.add("points", whole(read, "points"));
    rows.add("used", whole(read, "used"));
    if let Some(rejected) = read.get("rejected").and_then(Value::as_object) {
        for (reason, n) in rejected {
            let name = match reason.as_str() {
                "non_finite" => "rejected: not finite".to_owned(),
                "left_out" => "left out: parts without a surface".to_owned(),
                other => format!("rejected: {}", other.replace('_', " ")),
            };
            rows.add(&name, n.as_u64().filter(|n| *n > 0).map(count));
        }
    }
    let order = text(read, "organisation");
    rows.add(
        "organisation",
        order.map(|order| match product(read, "grid") {
            Some(grid) => format!("{order} of {grid}"),
            None => order,
        }),
    );
    rows.add("triangles", whole(read, "triangles"));
    rows.add("parts", whole(read, "parts"));
    rows.add("topology", text(read, "topology"));
    rows.add("faces", whole(read, "faces"));
    rows.add("area", measure(read, "area", &format!("{unit}²")));
    rows.add("volume", measure(read, "volume", &format!("{unit}³")));
    rows.add("closed", yes(read, "closed"));
    rows.add("not understood", entities(read, "unread"));
    rows.add("spacing", length(read, "spacing", unit));
    rows.add("noise", length(read, "noise", unit));
    rows.add("unit", unit_of(read));
    rows.table(title)
}

/// The most frequent kinds of entities of a CAD file.
fn entities(read: &Value, key: &str) -> Option<String> {
    let all = read.get(key)?.as_object()?.iter();
    let mut kinds: Vec<(u64, &String)> = all.map(|(k, n)| (n.as_u64().unwrap_or(0), k)).collect();
    kinds.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(b.1)));
    let more = kinds.len().saturating_sub(KINDS);
    kinds.truncate(KINDS);
    let mut words: Vec<String> = kinds
        .iter()
        .map(|(n, kind)| format!("{} of {kind}", count(*n)))
        .collect();
    if more > 0 {
        let kinds = if more == 1 { "kind" } else { "kinds" };
        words.push(format!("and {more} more {kinds}"));
    }
    Some(words.join(", "))
}

fn unit_of(read: &Value) -> Option<String> {
    let source = match text(read, "unit_source")?.as_str() {
        "file" => "the file says so",
        "option" => "as asked",
        _ => "assumed: the file does not say",
    };
    Some(format!("{} ({source})", text(read, "unit")?))
}

fn alignment(outcome: &Value, unit: Unit) -> Table {
    let mut rows = Rows::default();
    if let Some(found) = outcome.get("alignment").filter(|a| a.is_object()) {
        rows.add("rotation", measure(found, "rotation_deg", "°"));
        let vector = found.get("translation").and_then(Value::as_array);
        rows.add(
            "translation",
            vector.and_then(|v| {
                let numbers: Vec<f64> = v.iter().filter_map(Value::as_f64).collect();
                numbers.try_into().ok().map(|v| unit.place(v))
            }),
        );
        rows.add("RMS before", length(found, "rms_before", unit));
        rows.add("RMS after", length(found, "rms_after", unit));
    }
    rows.table("Alignment")
}

/// The fitted surface, if any, and its tolerance.
fn fitted(outcome: &Value, unit: Unit) -> Table {
    let mut rows = Rows::default();
    let surface = outcome.get("surface");
    if let Some(surface) = surface {
        rows.add(
            "layout",
            text(surface, "layout").filter(|layout| layout == "network"),
        );
        rows.add("faces", whole(surface, "faces"));
        rows.add("topology", text(surface, "topology"));
        rows.add("handles", whole(surface, "genus"));
        rows.add("borders", whole(surface, "borders"));
        let parameters = text(surface, "parameters");
        rows.add(
            "method",
            text(outcome, "method").map(|method| match parameters {
                Some(parameters) => format!("{method}, {parameters} parameters"),
                None => method,
            }),
        );
        rows.add("degree", product(surface, "degree"));
        rows.add("control points", product(surface, "control_points"));
        rows.add("lines kept", product(surface, "kept"));
        rows.add("rational", yes(surface, "rational"));
        rows.add(
            "closed",
            directions(surface, "closed").or_else(|| yes(surface, "closed")),
        );
        joins(surface, &mut rows);
        if surface.get("faces").is_none() {
            rows.add("periodic", directions(surface, "periodic"));
        }
        rows.add("trimmed", yes(surface, "trimmed"));
    }
    rows.add("tolerance", length(outcome, "tolerance", unit));
    let share = |key: &str| outcome.get(key).and_then(Value::as_f64).map(percent);
    let within = share("within").map(|share| format!("{share} of the points"));
    rows.add("within it, asked", within);
    let covered = share("min_coverage").map(|share| format!("{share} of the area"));
    rows.add("with data, asked", covered);
    // With a given tolerance, this is the aim.
    let aim = outcome.get("aim").filter(|_| share("within").is_none());
    rows.add("aim", aim.and_then(|aim| length(aim, "value", unit)));
    rows.add("aim from", aim.and_then(|aim| text(aim, "source")));
    rows.table(match surface {
        Some(_) => "Fitted",
        None => "Compared",
    })
}

/// The edges of a network, and the angles between the normals of its faces.
fn joins(surface: &Value, rows: &mut Rows) {
    if let Some(edges) = surface.get("edges") {
        for (key, name) in [
            ("smooth", "smooth edges"),
            ("sharp", "sharp edges"),
            ("border", "edges at borders"),
        ] {
            rows.add(name, whole(edges, key));
        }
    }
    if let Some(jump) = surface.get("normal_jump") {
        let most = measure(jump, "bound", "°").or_else(|| measure(jump, "max", "°"));
        rows.add("normals turn at smooth edges by at most", most);
        rows.add("95 % of their length", measure(jump, "p95", "°"));
        for (key, name) in [
            ("over_tenth", "share of their length over 0.1°"),
            ("over_half", "share of their length over 0.5°"),
        ] {
            rows.add(name, jump.get(key).and_then(Value::as_f64).map(percent));
        }
    }
}

/// The surfaces of several parts.
fn parts(outcome: &Value, unit: Unit) -> Table {
    let list = outcome.get("parts").and_then(Value::as_array);
    let row = |(k, part): (usize, &Value)| {
        let surface = part.get("surface").unwrap_or(part);
        let statistics = part.get("scan_to_surface").unwrap_or(part);
        let within = statistics.get("within_tolerance").and_then(Value::as_f64);
        vec![
            format!("part {}", k + 1),
            things(part, "points", "point", "points").unwrap_or_default(),
            format!(
                "{} control points",
                product(surface, "control_points").unwrap_or_default()
            ),
            match (length(statistics, "max", unit).unwrap_or_default(), within) {
                (max, Some(within)) => format!("at most {max}, {} within", percent(within)),
                (max, None) => format!("at most {max}"),
            },
            text(part, "verdict").unwrap_or_default(),
        ]
    };
    Table {
        title: "Parts",
        rows: list.into_iter().flatten().enumerate().map(row).collect(),
    }
}

/// Product data quality: name, measured, limit, pass.
fn checked(outcome: &Value) -> Table {
    let check = outcome.get("check").filter(|c| c.is_object());
    let list = check.and_then(|c| c.get("checks")?.as_array());
    let row = |check: &Value| {
        let name = check.get("name").and_then(Value::as_str);
        let unit = check.get("unit").and_then(Value::as_str);
        let unit = unit.unwrap_or_default();
        let figure = |key: &str| {
            let found = match Unit::from_symbol(unit) {
                Some(unit) => length(check, key, unit),
                None if unit == "deg" => measure(check, key, "°"),
                None => measure(check, key, &unit.replace('2', "²").replace('3', "³")),
            };
            found.unwrap_or_else(|| "–".to_owned())
        };
        let bound = match name.is_some_and(|name| AT_LEAST.contains(&name)) {
            true => "at least",
            false => "at most",
        };
        let is = |key: &str| check.get(key).and_then(Value::as_bool).unwrap_or(true);
        let said = match (is("pass"), is("within")) {
            (false, _) => "fail",
            (true, false) => "note",
            (true, true) => "pass",
        };
        vec![
            text(check, "name").unwrap_or_default(),
            figure("measured"),
            format!("{bound} {}", figure("limit")),
            said.to_owned(),
        ]
    };
    let mut rows: Vec<Vec<String>> = list.into_iter().flatten().map(row).collect();
    let back = check.and_then(|c| yes(c, "reads_back"));
    rows.extend(back.map(|back| vec!["reads back the same".to_owned(), back]));
    Table {
        title: "Checked",
        rows,
    }
}

fn written(outcome: &Value) -> Table {
    let list = outcome.get("outputs").and_then(Value::as_array);
    let row = |output: &Value| {
        let path = output.get("path").and_then(Value::as_str);
        vec![
            path.unwrap_or_default().to_owned(),
            text(output, "format").unwrap_or_default(),
            things(output, "bytes", "byte", "bytes").unwrap_or_default(),
        ]
    };
    Table {
        title: "Written",
        rows: list.into_iter().flatten().map(row).collect(),
    }
}

/// Times of the stages; stages that did not run are omitted.
fn times(outcome: &Value) -> Table {
    let mut rows = Rows::default();
    if let Some(time) = outcome.get("time") {
        for stage in STAGES {
            let spent = time.get(stage).and_then(Value::as_f64);
            rows.add(stage, spent.filter(|t| *t > 0.0).map(seconds));
        }
    }
    rows.table("Time")
}

/// Warnings, and the first of many notes.
fn notes(outcome: &Value) -> Table {
    let list = outcome.get("warnings").and_then(Value::as_array);
    let sentences: Vec<&str> = list
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
        .collect();
    let row = |(k, sentence): (usize, &&str)| vec![format!("{}", k + 1), (*sentence).to_owned()];
    let mut rows: Vec<Vec<String>> = sentences.iter().enumerate().take(NOTES).map(row).collect();
    let more = sentences.len().saturating_sub(NOTES);
    if more > 0 {
        rows.push(vec![
            "more".to_owned(),
            match more {
                1 => "1 note is left out here; --json has them all".to_owned(),
                _ => format!("{more} notes are left out here; --json has them all"),
            },
        ]);
    }
    Table {
        title: "Notes",
        rows,
    }
}

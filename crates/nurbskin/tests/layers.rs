//! No module uses one above it.

use std::fs;
use std::path::Path;

/// The modules of each crate, low to high: one may use those of its own line and of the lines before it. Between crates
/// the compiler sees to it.
const ORDER: [(&str, &[&[&str]]); 6] = [
    (
        "nurbskin-geometry",
        &[
            &["error", "math"],
            &["unit", "progress", "notes", "point_grid", "files"],
            &["numeric"],
            &["spatial"],
            &["nurbs"],
        ],
    ),
    (
        "nurbskin-cad",
        &[
            // A face that is a whole surface is oriented by what it encloses.
            &["model", "natural", "pcurve", "region", "mass"],
            &[
                "extent",
                "fairness",
                "boundary",
                "closest",
                "tessellate",
                "normal_jump",
                "network",
            ],
            &["check"],
            &["trim", "io"],
        ],
    ),
    (
        "nurbskin-scan",
        &[
            &["cloud", "binary", "sides"],
            &["stored", "normals", "simulate"],
            &["clean"],
            &["mesh", "io"],
        ],
    ),
    (
        "nurbskin-fit",
        &[&["chart"], &["rarefy", "enrich"], &["fit"], &["charting"]],
    ),
    ("nurbskin-network", &[&["cholesky"], &["layout"], &["fit"]]),
    (
        "nurbskin",
        &[
            &["deviation", "io"],
            &["surfacing"],
            &["report"],
            &["pipeline"],
        ],
    ),
];

type Order = [&'static [&'static str]];

fn level(order: &Order, module: &str) -> Option<usize> {
    order.iter().position(|line| line.contains(&module))
}

/// The code of a file without comments and without its module of tests, which may look anywhere; as many lines as there
/// are before that.
fn code(text: &str) -> String {
    let lines: Vec<&str> = text.lines().collect();
    let tests = |at: usize| {
        let next = lines.get(at + 1).copied().unwrap_or("").trim_end();
        lines[at].trim_start().starts_with("#[cfg(")
            && lines[at].contains("test")
            && next.contains("mod ")
            && next.ends_with('{')
    };
    let end = (0..lines.len()).find(|&at| tests(at));
    let bare = |line: &&str| line.split("//").next().unwrap_or("").to_owned() + "\n";
    lines[..end.unwrap_or(lines.len())]
        .iter()
        .map(bare)
        .collect()
}

/// The modules named right after `crate::` at the start of `rest`: one, or each branch of a group in braces.
fn modules(rest: &str) -> Vec<String> {
    let first = |path: &str| -> String {
        path.trim_start()
            .chars()
            .take_while(|c| c.is_ascii_lowercase() || *c == '_')
            .collect()
    };
    let Some(group) = rest.strip_prefix('{') else {
        return vec![first(rest)];
    };
    let mut depth = 0;
    let mut found = vec![first(group)];
    for (at, letter) in group.char_indices() {
        match letter {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' if depth == 0 => found.push(first(&group[at + 1..])),
            _ => {}
        }
    }
    found
}

/// Line and module of each use of a stage of the crate.
fn uses(order: &Order, text: &str) -> Vec<(usize, String)> {
    let code = code(text);
    code.match_indices("crate::")
        .flat_map(|(at, word)| {
            let line = code[..at].matches('\n').count() + 1;
            let named = modules(&code[at + word.len()..]);
            named.into_iter().map(move |module| (line, module))
        })
        .filter(|(_, module)| level(order, module).is_some())
        .collect()
}

fn visit(order: &Order, path: &Path, module: &str, faults: &mut Vec<String>) {
    if path.is_dir() {
        for entry in fs::read_dir(path).unwrap() {
            visit(order, &entry.unwrap().path(), module, faults);
        }
        return;
    }
    // Tests beside a module may look anywhere.
    if path.to_string_lossy().ends_with("tests.rs") {
        return;
    }
    let own = level(order, module)
        .unwrap_or_else(|| panic!("{module} is missing from the list of stages"));
    for (line, used) in uses(order, &fs::read_to_string(path).unwrap()) {
        if level(order, &used) > Some(own) {
            faults.push(format!("{}:{line}: {used}", path.display()));
        }
    }
}

#[test]
fn no_module_uses_one_above_it() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut faults = Vec::new();
    for (name, order) in ORDER {
        for entry in fs::read_dir(crates.join(name).join("src")).unwrap() {
            let path = entry.unwrap().path();
            let module = path.file_stem().unwrap().to_str().unwrap().to_owned();
            // Models and meshes for tests may use what they like; the command is a crate of its own.
            if !["lib", "samples", "bin"].contains(&module.as_str()) {
                visit(order, &path, &module, &mut faults);
            }
        }
    }
    faults.sort();
    assert!(faults.is_empty(), "upward uses:\n{}", faults.join("\n"));
}

#[test]
fn every_form_of_use_is_seen() {
    let order: &Order = &[
        &["nurbs"],
        &["scan", "mesh"],
        &["chart", "fit"],
        &["io", "pipeline"],
    ];
    let text = "use crate::scan::{mesh, io};\n\
                use crate::{Error, chart::{fit, plane}, // io::x,\n    nurbs::{self, shape::{a, b}}, io};\n\
                #[cfg(test)]\nmod inner_tests;\n\
                fn f() { crate::mesh::g(); }\n\
                #[cfg(all(test, feature = \"scan\"))]\nmod tests {\n    use crate::pipeline;\n}\n";
    let found: Vec<(usize, String)> = uses(order, text);
    let expected = [
        (1, "scan"),
        (2, "chart"),
        (2, "nurbs"),
        (2, "io"),
        (6, "mesh"),
    ];
    assert_eq!(found, expected.map(|(line, name)| (line, name.to_owned())));
}

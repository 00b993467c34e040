//! No module uses one above it.

use std::fs;
use std::path::Path;

/// The stages, low to high; a module may use its own level and those before it.
const ORDER: [&str; 16] = [
    "error",
    "unit",
    "progress",
    "point_grid",
    "numeric",
    "nurbs",
    "scan",
    "mesh",
    "chart",
    "rarefy",
    "enrich",
    "fit",
    "deviation",
    "io",
    "report",
    "pipeline",
];

fn level(module: &str) -> Option<usize> {
    ORDER.iter().position(|&name| name == module)
}

fn visit(path: &Path, module: &str, faults: &mut Vec<String>) {
    if path.is_dir() {
        for entry in fs::read_dir(path).unwrap() {
            visit(&entry.unwrap().path(), module, faults);
        }
        return;
    }
    // Tests beside a module may look anywhere.
    if path.to_string_lossy().ends_with("tests.rs") {
        return;
    }
    let own =
        level(module).unwrap_or_else(|| panic!("{module} is missing from the list of stages"));
    for (number, line) in fs::read_to_string(path).unwrap().lines().enumerate() {
        if line.trim() == "#[cfg(test)]" {
            break;
        }
        let code = line.split("//").next().unwrap_or("");
        for (at, _) in code.match_indices("crate::") {
            let used: String = code[at + 7..]
                .chars()
                .take_while(|c| c.is_ascii_lowercase() || *c == '_')
                .collect();
            if level(&used).is_some_and(|used| used > own) {
                faults.push(format!(
                    "{}:{}: {}",
                    path.display(),
                    number + 1,
                    line.trim()
                ));
            }
        }
    }
}

#[test]
fn no_module_uses_one_above_it() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut faults = Vec::new();
    for entry in fs::read_dir(source).unwrap() {
        let path = entry.unwrap().path();
        let module = path.file_stem().unwrap().to_str().unwrap().to_owned();
        if module != "lib" {
            visit(&path, &module, &mut faults);
        }
    }
    assert!(faults.is_empty(), "upward uses:\n{}", faults.join("\n"));
}

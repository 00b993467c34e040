//! Where results go, and what must not be overwritten there.

use crate::failure::{Failure, Result};
use nurbskin::pipeline;
use std::path::{Path, PathBuf};

/// `part.ply` and `part.ply.gz` become `part.step`.
pub(super) fn surface_beside(scan: &Path) -> PathBuf {
    let zipped = scan
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
    let bare = if zipped {
        scan.with_extension("")
    } else {
        scan.to_owned()
    };
    bare.with_extension("step")
}

/// Refuses default outputs that are there already: nobody named them, so nobody means to lose them.
pub(super) fn refuse_existing(outputs: &[PathBuf]) -> Result<()> {
    let there: Vec<&PathBuf> = outputs.iter().filter(|path| path.exists()).collect();
    let Some(first) = there.first() else {
        return Ok(());
    };
    let more = match there.len() {
        1 => "exists already".to_owned(),
        2 => "and 1 other output exist already".to_owned(),
        n => format!("and {} other outputs exist already", n - 1),
    };
    Err(Failure::usage(format!(
        "{} {more}, and nothing was done; replace with --force, or write elsewhere with {}",
        first.display(),
        if outputs.len() == 1 {
            "-o"
        } else {
            "--output-dir"
        }
    )))
}

/// Refuses the output of a verb that writes a scan.
pub(super) fn check_scan_output(input: &Path, output: &Path) -> Result<()> {
    let (inputs, outputs) = ([input.to_owned()], [output.to_owned()]);
    pipeline::check_outputs(&inputs, &outputs, &pipeline::SCAN_FORMATS).map_err(Failure::refused)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_are_named_after_their_scans() {
        for (scan, surface) in [
            ("part.ply", "part.step"),
            ("a/part.ply.gz", "a/part.step"),
            ("part.v2.xyz.GZ", "part.v2.step"),
            ("part", "part.step"),
        ] {
            assert_eq!(surface_beside(Path::new(scan)), Path::new(surface));
        }
    }
}

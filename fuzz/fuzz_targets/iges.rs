//! Any bytes as a CAD file: a model that can be checked and written again, or an error.
#![no_main]

use nurbskin::cad::check;
use nurbskin::io::cad::{CadFormat, CadWriteOptions, cad_text, read_cad_bytes};
use std::path::Path;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(file) = read_cad_bytes(bytes, Path::new("a.igs")) else {
        return;
    };
    // A check of thousands of faces is slow, not wrong.
    if file.model.faces().len() <= 8 {
        let _ = check(&file.model);
    }
    if let Ok(written) = cad_text(&file.model, CadFormat::Step, &CadWriteOptions::default()) {
        read_cad_bytes(&written, Path::new("again.step")).expect("what was written is read");
    }
});

//! Any bytes as a file of legacy VTK: a scan whose shapes agree, or an error.
#![no_main]

mod scan;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| scan::read(bytes, "a.vtk"));

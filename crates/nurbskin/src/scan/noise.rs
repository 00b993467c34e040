//! The noise of a scan, measured.

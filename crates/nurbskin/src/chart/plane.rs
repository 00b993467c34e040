//! Scans that project onto their best plane.

//! The line as one call: file, scan, ordered points, surface, deviation, CAD file.

//! Fits a network of B-spline faces to a mesh over a layout.

//! Knot insertion and removal, degree elevation, splitting, clamping.

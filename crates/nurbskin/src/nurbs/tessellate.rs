//! Triangles within a chordal tolerance.

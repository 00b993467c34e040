//! Normals of unordered points.

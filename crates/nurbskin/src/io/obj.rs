//! Wavefront OBJ meshes and points.

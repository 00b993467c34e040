//! STL meshes, ASCII and binary.

//! PLY meshes, points and range grids.

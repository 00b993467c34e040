//! Distance of every point to the surface, and its statistics.

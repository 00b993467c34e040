//! Shapes of exactly known surface and distance.

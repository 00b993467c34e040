//! Closest points on a surface: local Newton and certified branch and bound.

//! Exact conics and surfaces of revolution.

//! Samples a shape as a scanner would.

//! Knots where the error is.

//! Bezier extraction: a spline as its polynomial pieces.

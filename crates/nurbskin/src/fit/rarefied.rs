//! Rarefaction to tolerance: grid lines are kept until every point is within tolerance.

//! Robust statistics: medians, MAD, quantiles, robust weights.

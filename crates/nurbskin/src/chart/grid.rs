//! Ordered scans: an m x n array, or rows of different length brought to one.

//! Delimited text: XYZ, ASC, TXT, CSV.

//! Points that cannot be used are found, counted and named.

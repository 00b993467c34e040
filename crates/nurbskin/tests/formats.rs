//! Good, odd, truncated and mangled files.

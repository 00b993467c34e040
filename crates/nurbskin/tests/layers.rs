//! No module uses one above it.

//! Pass, fail or cannot tell.

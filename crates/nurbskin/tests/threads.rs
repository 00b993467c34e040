//! The same bytes whatever the thread count.

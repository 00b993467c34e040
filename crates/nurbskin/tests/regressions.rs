//! Every bug, by name.

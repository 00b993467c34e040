//! The `nurbskin` command.
fn main() {}

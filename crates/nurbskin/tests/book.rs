//! The NURBS Book's examples and identities.

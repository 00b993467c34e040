//! Writing IGES.

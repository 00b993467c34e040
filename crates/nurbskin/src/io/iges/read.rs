//! Reading IGES.

//! CAD files written and read back.

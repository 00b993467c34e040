//! Properties that hold for all input.

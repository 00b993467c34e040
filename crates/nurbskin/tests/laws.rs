//! Properties that hold for all input.

mod nurbs;
mod shapes;

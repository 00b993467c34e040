//! Meshes laid out on their domain: sheets, tubes, closed shapes and rings, whatever their shape in space.
//!
//! All four are one system of equations: every vertex is a weighted mean of its neighbours, over a domain that wraps round
//! where it is closed. Weights are positive, so that nothing folds; they are lowered where the surface is stretched over
//! too little of the domain. Then lines are spaced evenly.

mod chart;
mod closed;
mod disk;
mod facing;
mod harmonic;
mod layout;
mod place;
mod pockets;
mod poles;
mod ragged;
mod relax;
mod rim;
mod sides;
mod spread;
mod stretch;

pub use chart::{ChartQuality, MeshChart, chart_of_mesh};
pub use place::Placement;
pub(crate) use relax::FEW_FOLDED;

#[cfg(test)]
mod tests;

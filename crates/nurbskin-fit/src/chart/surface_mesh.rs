//! Meshes laid out on their domain: disks, tubes, spheres and tori, whatever their shape in space.
//!
//! All four are one system of equations, over a domain that wraps round where it is closed. Every free vertex is a
//! weighted mean of its neighbours; `j_ab` is a whole turn for edges that cross a cut:
//!
//! ```text
//! sum_b w_ab √(f_a f_b) (x_b - x_a + j_ab) = 0
//! ```
//!
//! Positive weights fold nothing (Tutte 1963; Gortler, Gotsman and Thurston 2006). Rounds of lower factors f where the
//! surface is stretched over too little of the domain reduce the stretch (Yoshizawa, Belyaev and Seidel 2004). Then the
//! lines are spaced evenly.
//!
//! A sheet may also be spread out in the plane, with nothing that holds its border (`developed`).

mod chart;
mod closed;
mod developed;
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
pub(crate) use developed::{Developed, spread};
pub use place::Placement;
pub(crate) use relax::MAX_NEW_FOLDS;

#[cfg(test)]
mod tests;

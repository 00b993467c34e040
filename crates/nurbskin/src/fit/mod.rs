//! From ordered or charted points to a surface.

#[cfg(feature = "scan")]
pub mod adapt;
#[cfg(feature = "scan")]
pub mod approximate;
#[cfg(feature = "scan")]
mod budget;
mod collocation;
#[cfg(feature = "scan")]
mod condensed;
#[cfg(feature = "scan")]
mod correction;
#[cfg(feature = "scan")]
mod engine;
#[cfg(feature = "scan")]
pub mod fairness;
#[cfg(feature = "scan")]
mod feet;
#[cfg(feature = "scan")]
mod gaps;
#[cfg(feature = "scan")]
mod goal;
pub mod interpolate;
#[cfg(feature = "scan")]
mod large;
#[cfg(feature = "scan")]
pub mod least_squares;
#[cfg(feature = "scan")]
mod moments;
#[cfg(feature = "scan")]
mod normal_equations;
pub mod parameters;
#[cfg(feature = "scan")]
mod pieces;
#[cfg(feature = "scan")]
mod placing;
#[cfg(feature = "scan")]
mod plan;
pub mod rarefied;
#[cfg(feature = "scan")]
mod refinement;
#[cfg(feature = "scan")]
mod removal;
#[cfg(feature = "scan")]
mod result;
#[cfg(feature = "scan")]
pub mod revolution;
#[cfg(feature = "scan")]
mod robust;
#[cfg(feature = "scan")]
mod samples;
#[cfg(feature = "scan")]
mod search;
#[cfg(feature = "scan")]
mod space;
#[cfg(feature = "scan")]
mod strips;
#[cfg(feature = "scan")]
mod system;
mod tensor;
#[cfg(feature = "scan")]
pub mod trade;
#[cfg(feature = "scan")]
mod unfold;
#[cfg(feature = "scan")]
mod visits;

//! Where things are: the nearest points of a point, the nearest place on triangles, boxes that overlap.

pub(crate) mod boxes;
pub(crate) mod hierarchy;
pub(crate) mod morton;
pub(crate) mod nearest;
pub mod neighbours;

//! Where things are: the nearest points of a point, the nearest place on triangles, boxes that overlap.

pub mod boxes;
pub mod hierarchy;
pub mod morton;
pub mod nearest;
pub mod neighbours;

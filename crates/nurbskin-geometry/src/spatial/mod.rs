//! Where things are: the nearest points of a point, the nearest place on triangles, boxes that overlap, triangles that
//! pass through each other.

pub mod boxes;
pub mod hierarchy;
pub mod morton;
pub mod nearest;
pub mod neighbours;
pub mod triangles;

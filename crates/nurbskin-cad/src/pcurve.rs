//! Curves in the parameter plane of a surface (p-curves), and the curves in space that they stand for.

pub(crate) mod fit;
pub(crate) mod lift;
pub(crate) mod march;
pub(crate) mod on_surface;
pub(crate) mod planar;
pub(crate) mod project;

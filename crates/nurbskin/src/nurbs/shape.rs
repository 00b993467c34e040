//! Normals, curvatures, continuity.

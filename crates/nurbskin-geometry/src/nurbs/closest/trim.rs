//! A surface of which only a part counts, and the curves that bound it.
//!
//! The nearest point of such a part lies on its border, or is a stationary point of the distance inside it. The border
//! is searched as curves. Where the squared distance is convex on a piece, its minimum there is the nearest point of the
//! part on that piece if it lies in the part; if not, the straight way to it in the parameter plane, along which the
//! distance falls, leaves the part through the border, which is nearer then. Elsewhere rectangles are cut until they
//! are inside, outside, or without a stationary point.

use super::curves::Curves;
use crate::Result;
use crate::nurbs::NurbsCurve;
use glam::{DVec2, DVec3};
use std::fmt::Debug;
use std::sync::Arc;

/// How a rectangle of the parameter plane lies to a part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cover {
    /// All of it is covered.
    Inside,
    /// Nothing of it is covered.
    Outside,
    /// The border passes through it, or so near that this could not be told.
    Border,
}

/// The part of the parameter plane that counts.
pub trait Part: Debug + Send + Sync {
    /// Whether it covers this place; on its border either answer may be given.
    fn contains(&self, place: DVec2) -> bool;
    /// How a rectangle with these corners lies to it; never wrong about inside and outside.
    fn cover(&self, low: DVec2, high: DVec2) -> Cover;
    /// (u, v) at this parameter of a border curve.
    fn place(&self, curve: usize, parameter: f64) -> DVec2;
}

/// A part, its border, and how the pieces of the surface lie to it.
#[derive(Clone, Debug)]
pub(super) struct Trim {
    pub(super) part: Arc<dyn Part>,
    pub(super) border: Curves,
    /// How far these curves may be from the border.
    pub(super) gap: f64,
    covers: Vec<Cover>,
}

impl Trim {
    /// With border curves relative to `centre`, and the rectangles `[u_0, u_1, v_0, v_1]` of the pieces.
    pub(super) fn new(
        part: Arc<dyn Part>,
        border: &[NurbsCurve],
        gap: f64,
        centre: DVec3,
        pieces: &[[f64; 4]],
    ) -> Result<Self> {
        let cover = |&[a, b, c, d]: &[f64; 4]| part.cover(DVec2::new(a, c), DVec2::new(b, d));
        Ok(Self {
            covers: pieces.iter().map(cover).collect(),
            border: Curves::new(border, centre)?,
            gap,
            part,
        })
    }

    pub(super) fn cover(&self, piece: usize) -> Cover {
        self.covers.get(piece).copied().unwrap_or(Cover::Border)
    }
}

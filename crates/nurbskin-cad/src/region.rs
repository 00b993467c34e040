//! The part of the parameter plane that a face covers.
//!
//! The p-curves of each loop are cut into Bezier pieces, in the order and sense of the loop, under a binary tree whose
//! nodes are chains of pieces. A ray from a point to larger u crosses a chain that lies wholly to the right of the
//! point as often (modulo 2) as the ends of the chain lie on different sides of the ray; only chains whose boxes hold
//! the point are looked into, and their Bezier pieces are split by de Casteljau's algorithm until the same holds. So
//! nothing is approximated but by rounding. Gaps between the p-curves of a loop are closed by straight lines, without
//! which a ray could slip through.

mod chain;
mod crossings;

use super::model::{Face, Loop};
use chain::Chain;
pub(crate) use chain::Piece;
use glam::{DVec2, DVec4};
use nurbskin_geometry::nurbs::bezier::{BezierCurve, curve_pieces};
pub use nurbskin_geometry::nurbs::closest::Cover;
use nurbskin_geometry::nurbs::{NurbsCurve, NurbsSurface};
use nurbskin_geometry::{Error, Result};

/// Where the loops of a face come nearest to a place in the parameter plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopPoint {
    /// The nearest (u, v) on the loops.
    pub place: DVec2,
    /// Its distance in the parameter plane stretched by [`Region::scale`]: about a length in space.
    pub distance: f64,
    /// Index of the loop.
    pub loop_index: usize,
    /// Index of the edge use in the loop; where two p-curves do not meet, the one before the gap.
    pub use_index: usize,
    /// The parameter of the edge and of its p-curve there.
    pub parameter: f64,
}

/// The part of the parameter plane inside the loops of a face, by the even-odd rule: the sense of the loops does not
/// matter, and a point in a hole is outside.
///
/// ```
/// use nurbskin_geometry::{DVec2, DVec3};
/// use nurbskin_cad::{Model, Region};
/// use nurbskin_geometry::nurbs::conic;
/// let mut model = Model::new("ball");
/// let face = model.add_whole_surface(&conic::sphere(DVec3::ZERO, 1.0)?, 1e-9)?;
/// let region = Region::new(&model.faces()[face])?;
/// assert!(region.contains(DVec2::new(0.5, 0.5)));
/// assert!(!region.contains(DVec2::new(1.5, 0.5)));
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Region {
    chains: Vec<Chain>,
    scale: DVec2,
    low: DVec2,
    high: DVec2,
}

impl Region {
    /// The region of a face. O(pieces).
    ///
    /// # Errors
    /// [`Error::Invalid`] if the face has no loop.
    pub fn new(face: &Face) -> Result<Self> {
        Self::of_loops(&face.loops, &face.surface)
    }

    /// The region inside loops, of which only the p-curves count.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is none, or one is empty.
    pub(crate) fn of_loops(loops: &[Loop], surface: &NurbsSurface) -> Result<Self> {
        let chains = loops.iter().map(loop_pieces).collect::<Result<Vec<_>>>()?;
        Self::from_pieces(chains, scale_of(surface))
    }

    /// The region inside polygons, each given without its first point repeated at the end.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is none, or one is empty.
    pub(crate) fn from_polygons(polygons: &[Vec<DVec2>], scale: DVec2) -> Result<Self> {
        let chain = |polygon: &Vec<DVec2>| {
            let next = polygon.iter().cycle().skip(1);
            let sides = polygon.iter().zip(next).enumerate();
            let piece = |(use_index, (&a, &b))| Piece {
                curve: segment(a, b, (0.0, 1.0)),
                use_index,
            };
            sides.map(piece).collect::<Vec<_>>()
        };
        Self::from_pieces(polygons.iter().map(chain).collect(), scale)
    }

    fn from_pieces(chains: Vec<Vec<Piece>>, scale: DVec2) -> Result<Self> {
        if chains.is_empty() || chains.iter().any(Vec::is_empty) {
            return Err(Error::invalid(
                "a face needs at least one loop, and every loop an edge",
            ));
        }
        let chains: Vec<Chain> = chains.into_iter().map(Chain::new).collect();
        let boxes = chains.iter().map(Chain::bounds);
        let [low, high] = boxes.fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[a, b], [c, d]| {
            [a.min(c), b.max(d)]
        });
        Ok(Self {
            chains,
            scale,
            low,
            high,
        })
    }

    /// Whether the region covers this place. On a loop, either answer may be given. O(log n) but near a loop.
    #[must_use]
    pub fn contains(&self, place: DVec2) -> bool {
        let odd = |inside: bool, chain: &Chain| inside != chain.crossed_from(place);
        self.chains.iter().fold(false, odd)
    }

    /// How a rectangle with these corners lies to the region. Never wrong about inside and outside.
    #[must_use]
    pub fn cover(&self, low: DVec2, high: DVec2) -> Cover {
        if self.chains.iter().any(|chain| chain.touches(low, high)) {
            Cover::Border
        } else if self.contains((low + high) / 2.0) {
            Cover::Inside
        } else {
            Cover::Outside
        }
    }

    /// The place on the loops nearest to this one, in the parameter plane stretched by [`Region::scale`].
    #[must_use]
    pub fn nearest(&self, place: DVec2) -> LoopPoint {
        let mut best = LoopPoint {
            place,
            distance: f64::INFINITY,
            loop_index: 0,
            use_index: 0,
            parameter: 0.0,
        };
        for (loop_index, chain) in self.chains.iter().enumerate() {
            if chain.nearest(place, self.scale, &mut best) {
                best.loop_index = loop_index;
            }
        }
        best
    }

    /// Lower and upper corner of a rectangle that holds the region: that of the control points of its p-curves.
    #[must_use]
    pub fn bounding_rectangle(&self) -> [DVec2; 2] {
        [self.low, self.high]
    }

    /// Mean length in space of a unit of u and of v: what makes lengths in the parameter plane comparable.
    #[must_use]
    pub fn scale(&self) -> DVec2 {
        self.scale
    }

    /// The area inside one loop in the parameter plane, positive where the loop runs counter-clockwise, so that what it
    /// encloses is to its left; 0 if there is no such loop. To about 1e-12 of the loop's rectangle.
    #[must_use]
    pub fn signed_area(&self, loop_index: usize) -> f64 {
        self.chains.get(loop_index).map_or(0.0, Chain::signed_area)
    }

    /// Whether a place is inside one loop, by the even-odd rule; false if there is no such loop.
    #[must_use]
    pub fn loop_contains(&self, loop_index: usize, place: DVec2) -> bool {
        let chain = self.chains.get(loop_index);
        chain.is_some_and(|chain| chain.crossed_from(place))
    }

    /// Number of loops.
    #[must_use]
    pub fn loop_count(&self) -> usize {
        self.chains.len()
    }
}

/// The Bezier pieces of a loop in its sense, with gaps between its p-curves closed by straight pieces.
pub(crate) fn loop_pieces(each: &Loop) -> Result<Vec<Piece>> {
    let mut pieces: Vec<Piece> = Vec::new();
    for (use_index, used) in each.uses.iter().enumerate() {
        let curve = run(&used.pcurve, used.reversed)?;
        bridge(&mut pieces, curve.first().map(start_of));
        pieces.extend(curve.into_iter().map(|curve| Piece { curve, use_index }));
    }
    let first = pieces.first().map(|piece| start_of(&piece.curve));
    bridge(&mut pieces, first);
    Ok(pieces)
}

/// The Bezier pieces of a p-curve in the sense of its loop: their ranges then run from the larger parameter to the
/// smaller.
pub(crate) fn run(pcurve: &NurbsCurve, reversed: bool) -> Result<Vec<BezierCurve>> {
    let mut pieces = curve_pieces(pcurve)?;
    if reversed {
        pieces.reverse();
        for piece in &mut pieces {
            piece.points.reverse();
            piece.range = (piece.range.1, piece.range.0);
        }
    }
    Ok(pieces)
}

/// Where a piece begins.
pub(crate) fn start_of(piece: &BezierCurve) -> DVec2 {
    piece.points.first().map_or(DVec2::ZERO, |&h| place_of(h))
}

/// Where a piece ends.
pub(crate) fn end_of(piece: &BezierCurve) -> DVec2 {
    piece.points.last().map_or(DVec2::ZERO, |&h| place_of(h))
}

pub(crate) fn place_of(h: DVec4) -> DVec2 {
    h.truncate().truncate() / h.w
}

/// A straight piece.
pub(crate) fn segment(a: DVec2, b: DVec2, range: (f64, f64)) -> BezierCurve {
    let at = |p: DVec2| p.extend(0.0).extend(1.0);
    BezierCurve {
        range,
        points: vec![at(a), at(b)],
    }
}

/// Leads straight on from the last piece to `next`, unless that is where it ends.
fn bridge(pieces: &mut Vec<Piece>, next: Option<DVec2>) {
    let (Some(last), Some(next)) = (pieces.last(), next) else {
        return;
    };
    let from = end_of(&last.curve);
    if from != next {
        let (at, use_index) = (last.curve.range.1, last.use_index);
        pieces.push(Piece {
            curve: segment(from, next, (at, at)),
            use_index,
        });
    }
}

/// Mean length of the lines of control points over the width of the domain, per direction; 1 where that is nothing.
pub(crate) fn scale_of(surface: &NurbsSurface) -> DVec2 {
    let net = surface.control_points();
    let [m, n] = net.counts();
    let [(a, b), (c, d)] = surface.domain();
    let mut sums = [0.0; 2];
    for j in 0..n {
        for i in 0..m {
            if i > 0 {
                sums[0] += net.point(i, j).distance(net.point(i - 1, j)) / n as f64;
            }
            if j > 0 {
                sums[1] += net.point(i, j).distance(net.point(i, j - 1)) / m as f64;
            }
        }
    }
    let usable = |x: f64| if x.is_finite() && x > 0.0 { x } else { 1.0 };
    DVec2::new(usable(sums[0] / (b - a)), usable(sums[1] / (d - c)))
}

#[cfg(test)]
mod tests;

//! The closest point of a surface, with a certified lower bound of the distance.
//!
//! The surface is cut once into nearly flat Bezier pieces under a hierarchy of boxes. For a point, the boxes are
//! examined from near to far. On a piece where bounds of the derivatives show the squared distance to be *convex*
//! (which holds in a tube around the surface about half as thick as its smallest radius of curvature), a few Newton
//! steps find the only minimum, and the last gradient bounds how much lower it could be. Elsewhere the squared
//! distance is written as a polynomial in Bernstein form, whose coefficients bound it from below, and cut until they
//! do so closely enough. Borders and corners are part of every piece, so they need no special case.
//!
//! Any foot is an upper bound of the distance; the bounds above make the lower one. Sources: the Bernstein form of the
//! squared distance and its hull property, Y.-J. Chen et al., *Computing the minimum distance between a point and a
//! NURBS curve*, Computer-Aided Design 40, 2008; the cluster problem and its cure by convexity, Du and Kearfott,
//! *The cluster problem in multivariate global optimization*, J. Global Optimization 5, 1994; foot points by Newton's
//! method, *The NURBS Book*, 2nd ed., section 6.1.

mod borders;
mod curves;
mod evaluate;
mod extract;
mod interval;
mod piece;
mod quadric;
mod search;
mod store;
mod trim;

use super::{NurbsCurve, NurbsSurface};
use crate::numeric::bucket_sort::sort_by_key;
use crate::numeric::parallel::by_index;
use crate::progress::{Progress, Silent};
use crate::spatial::hierarchy;
use crate::spatial::hierarchy::{LEAF, Node};
use crate::{Error, Result};
use borders::Borders;
use curves::{CurveSearch, Parts};
use glam::{DVec2, DVec3};
use quadric::Quadric;
use rayon::prelude::*;
use search::Search;
use std::sync::Arc;
use store::{Cache, Store};
pub use trim::Cover;
pub use trim::Part;
use trim::Trim;

/// The point of a surface that is closest to a given point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// Parameter u of the foot.
    pub u: f64,
    /// Parameter v of the foot.
    pub v: f64,
    /// The foot, S(u, v).
    pub point: DVec3,
    /// Unit normal there, along dS/du x dS/dv; on a crease or a pole the mean of the normals around (zero if they cancel).
    pub normal: DVec3,
    /// Distance of the given point to the foot: an upper bound of its distance to the surface.
    pub distance: f64,
    /// Certified lower bound of the distance to the surface.
    pub lower: f64,
}

/// Finds closest points of one surface; made once, then asked for any number of points.
///
/// Degrees, weights, periodic directions, poles and creases are arbitrary. Memory is about 1.4 kB per bicubic piece,
/// and a surface has about one to four pieces per knot span; of a surface with more than 65 536 spans only their boxes
/// are kept (60 bytes each), and pieces are made when a search comes to them.
///
/// ```
/// use nurbskin_geometry::{ControlNet, DVec3, KnotVector, NurbsSurface};
/// use nurbskin_geometry::nurbs::closest::ClosestPoint;
/// let net = ControlNet::from_fn(4, 4, |i, j| DVec3::new(i as f64, j as f64, 0.0))?;
/// let knots = KnotVector::uniform(3, 4)?;
/// let plane = NurbsSurface::new(knots.clone(), knots, net, None)?;
/// let foot = ClosestPoint::new(&plane)?.closest(DVec3::new(1.0, -4.0, 3.0));
/// assert!((foot.distance - 5.0).abs() < 1e-12);
/// assert!(foot.lower <= foot.distance && foot.lower > 5.0 - 1e-9);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct ClosestPoint {
    store: Store,
    piece_count: usize,
    nodes: Vec<Node>,
    surface: NurbsSurface,
    /// Middle of the box around the surface: the hierarchy's single precision coordinates are relative to it.
    centre: DVec3,
    borders: Borders,
    /// The part that counts, where that is not all of it.
    trim: Option<Trim>,
    tolerance: f64,
    rounding: f64,
}

/// Reusable memory of searches, on any surfaces.
#[derive(Debug, Default)]
pub struct Workspace {
    /// Which [`ClosestPoint`] the cache belongs to, by its address.
    owner: usize,
    cache: Cache,
    quadric: Quadric,
    parts: Parts,
}

/// What a search within a radius found.
#[derive(Clone, Copy, Debug)]
pub struct Nearest {
    /// The closest point, if it is nearer than the radius.
    pub foot: Option<Foot>,
    /// Certified lower bound of the distance, or the radius if that is less.
    pub lower: f64,
    /// Which border curve the foot is on, and its parameter there.
    pub border: Option<(usize, f64)>,
}

impl ClosestPoint {
    /// Prepares a surface; brackets will be at most 1e-11 of the diagonal of the box around its control points wide.
    /// O(pieces log pieces).
    ///
    /// # Errors
    /// [`Error::Unsupported`] if the surface has 2^31 pieces or more.
    pub fn new(surface: &NurbsSurface) -> Result<Self> {
        let [low, high] = surface.bounding_box();
        Self::with_tolerance(surface, 1e-11 * (high - low).length())
    }

    /// Prepares a surface; brackets (distance less lower bound) will be at most `tolerance` wide, or 2e-12 of the size
    /// of the surface and its distance from the point, whichever is larger.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the tolerance is negative or not finite, [`Error::Unsupported`] if the surface has 2^31
    /// pieces or more.
    pub fn with_tolerance(surface: &NurbsSurface, tolerance: f64) -> Result<Self> {
        if !(tolerance >= 0.0 && tolerance.is_finite()) {
            return Err(Error::invalid(format!(
                "the tolerance of closest points must be zero or a positive length, not {tolerance}"
            )));
        }
        let [low, high] = surface.bounding_box();
        let centre = low + 0.5 * (high - low);
        // Coordinates far from the origin would cost accuracy: everything happens around the middle of the box.
        let moved = surface.map_points(|p| p - centre)?;
        Self::from_store(Store::new(&moved), moved, centre, tolerance)
    }

    fn from_store(
        mut store: Store,
        moved: NurbsSurface,
        centre: DVec3,
        tolerance: f64,
    ) -> Result<Self> {
        let [low, high] = moved.bounding_box();
        let boxes = store.take_boxes();
        if boxes.len() >= LEAF as usize {
            return Err(Error::Unsupported(format!(
                "a surface of {} pieces is too large for closest points",
                boxes.len()
            )));
        }
        let nodes = hierarchy::build(&boxes);
        let borders = Borders::new(&moved);
        Ok(Self {
            borders,
            trim: None,
            store,
            piece_count: boxes.len(),
            nodes,
            surface: moved,
            centre,
            tolerance,
            rounding: 1e-12 * (high - low).length()
                + 4.0
                    * f64::EPSILON
                    * (low + centre)
                        .abs()
                        .max((high + centre).abs())
                        .max_element(),
        })
    }

    /// Prepares a part of a surface, bounded by curves that follow its border within `gap`. They count as they are: what
    /// is found is the nearest point of the part and of these curves; beside them, brackets may be twice `gap` wider.
    ///
    /// # Errors
    /// As [`ClosestPoint::new`].
    pub fn of_part(
        surface: &NurbsSurface,
        part: Arc<dyn Part>,
        border: &[NurbsCurve],
        gap: f64,
    ) -> Result<Self> {
        let mut this = Self::new(surface)?;
        let pieces = this.store.domains();
        this.trim = Some(Trim::new(part, border, gap, this.centre, &pieces)?);
        Ok(this)
    }

    /// How wide a bracket may be.
    #[must_use]
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// Number of nearly flat pieces the surface was cut into.
    #[must_use]
    pub fn piece_count(&self) -> usize {
        self.piece_count
    }

    /// The closest point of the surface. About a microsecond near a bicubic surface; a search that cannot be decided
    /// within the tolerance ends after about 10 ms with the bracket reached so far.
    #[must_use]
    pub fn closest(&self, point: DVec3) -> Foot {
        let mut workspace = Workspace::default();
        self.nearest(point, None, &mut workspace)
    }

    /// The closest point of the surface, for a point of which a place near its foot is known, as a fit knows it; any
    /// start gives the same distance, a good one sooner.
    #[must_use]
    pub fn closest_from(&self, point: DVec3, start: DVec2) -> Foot {
        let mut workspace = Workspace::default();
        self.nearest(point, Some(start), &mut workspace)
    }

    /// The closest point of the surface if it is within `radius`, else `None` (certified to the tolerance). Quicker than
    /// [`ClosestPoint::closest`] for points farther away.
    #[must_use]
    pub fn within(&self, point: DVec3, radius: f64) -> Option<Foot> {
        let reach = radius.max(0.0) * (1.0 + 1e-12) + self.rounding;
        let found = self.nearer(point, reach, None, &mut Workspace::default());
        found.foot.filter(|foot| foot.distance <= radius)
    }

    /// The closest points of many points, in their order; `starts`, where given, as in [`ClosestPoint::closest_from`]
    /// (points beyond its length have none). The same for any number of threads.
    #[must_use]
    pub fn closest_all(&self, points: &[DVec3], starts: Option<&[DVec2]>) -> Vec<Foot> {
        // Silent never cancels, so there is no error to lose.
        self.closest_all_with(points, starts, &Silent)
            .unwrap_or_default()
    }

    /// [`ClosestPoint::closest_all`] that tells how many points are done and can be stopped.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn closest_all_with(
        &self,
        points: &[DVec3],
        starts: Option<&[DVec2]>,
        progress: &dyn Progress,
    ) -> Result<Vec<Foot>> {
        let search = |k: usize, workspace: &mut Workspace| {
            let start = starts.and_then(|s| s.get(k)).copied();
            self.nearest(points[k], start, workspace)
        };
        in_spatial_order(points, self.surface_box(), progress, search)
    }

    fn nearest(&self, point: DVec3, start: Option<DVec2>, workspace: &mut Workspace) -> Foot {
        let mut search = self.search(point, f64::INFINITY);
        self.run(&mut search, start, workspace);
        self.foot(&search, workspace)
    }

    /// Corners of the box around the control points.
    pub fn surface_box(&self) -> [DVec3; 2] {
        self.surface
            .bounding_box()
            .map(|corner| corner + self.centre)
    }

    /// Whether the parameters of a foot lie on a free border: an end of the domain that is neither a seam nor a pole.
    #[must_use]
    pub fn on_free_edge(&self, foot: &Foot) -> bool {
        self.borders.is_free(&self.surface, foot.u, foot.v)
    }
    /// Whether the parameters of a foot lie on an end of the domain.
    pub fn on_side(&self, foot: &Foot) -> bool {
        let [(a, b), (c, d)] = self.surface.domain();
        foot.u <= a || foot.u >= b || foot.v <= c || foot.v >= d
    }
    /// The parameter rectangle of the surface, [(a, b) of u, (c, d) of v].
    #[must_use]
    pub fn domain(&self) -> [(f64, f64); 2] {
        self.surface.domain()
    }

    /// The closest point within `radius`, from a place near it where one is known.
    pub fn nearer(
        &self,
        point: DVec3,
        radius: f64,
        start: Option<DVec2>,
        workspace: &mut Workspace,
    ) -> Nearest {
        let mut search = self.search(point, radius);
        self.run(&mut search, start, workspace);
        let found = search.piece != usize::MAX || search.border.is_some();
        let foot = self.foot(&search, workspace);
        Nearest {
            lower: foot.lower,
            border: search.border.map(|on| (on.curve, on.parameter)),
            foot: found.then_some(foot),
        }
    }

    fn search(&self, point: DVec3, radius: f64) -> Search<'_> {
        let point = point - self.centre;
        let far = point.abs().max_element();
        let mut search = Search::new(
            point,
            radius,
            self.tolerance.max(1e-12 * far),
            4.0 * f64::from(f32::EPSILON) * far,
            // A node costs about as much as its coefficients, (2 p + 1)(2 q + 1).
            (1 << 18) / self.store.net_len(),
        );
        search.creased = self.borders.creased;
        search.gap = self.trim.as_ref().map_or(0.0, |trim| trim.gap);
        search
    }

    fn run<'a>(&'a self, search: &mut Search<'a>, start: Option<DVec2>, workspace: &mut Workspace) {
        let owner = std::ptr::from_ref(self).addr();
        if workspace.owner != owner {
            workspace.owner = owner;
            workspace.cache = Cache::default();
        }
        let mut done = usize::MAX;
        if let Some(start) = start {
            let uv = DVec2::new(
                self.surface.knots_u().wrap(start.x),
                self.surface.knots_v().wrap(start.y),
            );
            let first = self.store.at(uv);
            if self.enter(search, workspace, first) {
                let (pieces, slot) = self.store.load(&self.surface, &mut workspace.cache, first);
                search.current = first;
                if search.visit_from(pieces, slot, pieces.all[slot].local(uv)) {
                    done = first;
                }
            }
        }
        self.traverse(search, workspace, done);
    }

    /// Visits the pieces from near to far, except `done`, until no other can be nearer.
    fn traverse<'a>(&'a self, search: &mut Search<'a>, workspace: &mut Workspace, done: usize) {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the limit has slack for this rounding"
        )]
        let point = search.point.to_array().map(|x| x as f32);
        let limit = search.limit;
        hierarchy::visit_near(&self.nodes, point, limit, |piece| {
            if piece != done && self.enter(search, workspace, piece) {
                let (pieces, slot) = self.store.load(&self.surface, &mut workspace.cache, piece);
                search.current = piece;
                search.visit(pieces, &mut workspace.quadric, slot);
            }
            search.limit
        });
    }

    /// Whether something of a piece counts. Before the first that the border passes through, the border is searched.
    #[inline]
    fn enter<'a>(
        &'a self,
        search: &mut Search<'a>,
        workspace: &mut Workspace,
        piece: usize,
    ) -> bool {
        let Some(trim) = &self.trim else {
            return true;
        };
        search.part = match trim.cover(piece) {
            Cover::Outside => return false,
            Cover::Inside => None,
            Cover::Border => Some(&*trim.part),
        };
        if search.part.is_some() && !search.bordered {
            search.bordered = true;
            let mut along = CurveSearch {
                point: search.point,
                best: search.best,
                found: None,
                proven: f64::INFINITY,
                tolerance: search.tolerance,
                slack: search.slack,
            };
            trim.border.search(&mut along, &mut workspace.parts);
            search.proven = search.proven.min(along.proven);
            if along.found.is_some() {
                search.border = along.found;
                search.best = along.best;
                search.set_limit();
            }
        }
        true
    }

    fn foot(&self, search: &Search, workspace: &mut Workspace) -> Foot {
        let distance = search.best.sqrt();
        let rounding = self.rounding + 1e-12 * search.point.abs().max_element();
        let lower = (search.proven.min(search.best).sqrt() - rounding).max(0.0);
        let at = |uv: DVec2, point: DVec3, normal: DVec3| Foot {
            u: uv.x,
            v: uv.y,
            point,
            normal,
            distance,
            lower,
        };
        if let (Some(on), Some(trim)) = (&search.border, &self.trim) {
            let [(a, b), (c, d)] = self.surface.domain();
            let place = trim.part.place(on.curve, on.parameter);
            let uv = place.clamp(DVec2::new(a, c), DVec2::new(b, d));
            let there = self.surface.derivatives(uv.x, uv.y);
            let mut normal = there.du.cross(there.dv).normalize_or_zero();
            if normal == DVec3::ZERO {
                normal = self.borders.pseudo_normal(&self.surface, uv);
            }
            return at(uv, on.point + self.centre, normal);
        }
        if search.piece == usize::MAX {
            return at(DVec2::ZERO, DVec3::ZERO, DVec3::ZERO);
        }
        let (pieces, slot) = self
            .store
            .load(&self.surface, &mut workspace.cache, search.piece);
        let piece = &pieces.all[slot];
        let DVec2 { x, y } = search.place;
        let local = pieces.point(slot, x, y);
        let uv = piece.parameters(x, y);
        let [sx, sy] = search.tangents;
        let mut normal = piece.vector(sx.cross(sy).normalize_or_zero());
        let border = x.abs() >= 1.0 || y.abs() >= 1.0;
        if normal == DVec3::ZERO || (border && self.borders.sharp) {
            normal = self.borders.pseudo_normal(&self.surface, uv);
        }
        at(uv, piece.origin + piece.vector(local) + self.centre, normal)
    }
}

/// What `search` says of each point, given its index, in the order of the points. They are taken along a Morton curve
/// over a box, so that one search finds the memory of the one before warm, in chunks that do not depend on the number of
/// threads; `progress` is told of every chunk.
///
/// # Errors
/// [`Error::Cancelled`].
pub fn in_spatial_order<T: Copy + Send + Sync>(
    points: &[DVec3],
    around: [DVec3; 2],
    progress: &dyn Progress,
    search: impl Fn(usize, &mut Workspace) -> T + Sync,
) -> Result<Vec<T>> {
    const CHUNK: usize = 1024;
    let order = spatial_order(points, around);
    let chunk = |items: &[u32]| -> Result<Vec<T>> {
        progress.check()?;
        let mut workspace = Workspace::default();
        let found = items.iter().map(|&i| search(i as usize, &mut workspace));
        let found = found.collect();
        progress.advance(items.len() as u64);
        Ok(found)
    };
    let found: Vec<Vec<T>> = order.par_chunks(CHUNK).map(chunk).collect::<Result<_>>()?;
    Ok(by_index(&order, &found, CHUNK))
}

/// The indices of points along a Morton curve over a box.
fn spatial_order(points: &[DVec3], [low, high]: [DVec3; 2]) -> Vec<u32> {
    let scale = 1023.0 / (high - low).max_element().max(f64::MIN_POSITIVE);
    let spread = |x: f64| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to 10 bits"
        )]
        let mut bits = x.clamp(0.0, 1023.0) as u32;
        bits = (bits | (bits << 16)) & 0x0300_00ff;
        bits = (bits | (bits << 8)) & 0x0300_f00f;
        bits = (bits | (bits << 4)) & 0x030c_30c3;
        (bits | (bits << 2)) & 0x0924_9249
    };
    let keys: Vec<(u32, u32)> = (0u32..)
        .zip(points)
        .map(|(i, &p)| {
            let q = (p - low) * scale;
            (spread(q.x) | (spread(q.y) << 1) | (spread(q.z) << 2), i)
        })
        .collect();
    let keys = sort_by_key(keys, |&(code, _)| u64::from(code), Ord::cmp);
    keys.into_iter().map(|(_, i)| i).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ControlNet, KnotVector};

    #[test]
    fn pieces_made_on_demand_give_the_same() {
        let knots = KnotVector::uniform(3, 40).unwrap();
        let net = ControlNet::from_fn(40, 40, |i, j| {
            let (x, y) = (i as f64, j as f64);
            DVec3::new(x, y, 2.0 * (0.5 * x).sin() * (0.4 * y).cos())
        })
        .unwrap();
        let weights = (0..1600).map(|k| 1.0 + 0.3 * f64::from(k).sin()).collect();
        for weights in [None, Some(weights)] {
            let surface =
                NurbsSurface::new(knots.clone(), knots.clone(), net.clone(), weights).unwrap();
            let kept = ClosestPoint::new(&surface).unwrap();
            let store = Store::keeping(&surface, false);
            let made =
                ClosestPoint::from_store(store, surface, DVec3::ZERO, kept.tolerance()).unwrap();
            let points: Vec<DVec3> = (0..500)
                .map(|k| {
                    let k = f64::from(k);
                    let z = 3.0 * (3.3 * k).sin();
                    DVec3::new(
                        20.0 + 23.0 * (1.7 * k).sin(),
                        20.0 + 23.0 * (2.9 * k).sin(),
                        z,
                    )
                })
                .collect();
            let starts: Vec<DVec2> = points
                .iter()
                .map(|p| DVec2::new(p.x / 39.0, p.y / 39.0))
                .collect();
            let (a, b, c) = (
                kept.closest_all(&points, None),
                made.closest_all(&points, None),
                made.closest_all(&points, Some(&starts)),
            );
            for ((a, b), c) in a.iter().zip(&b).zip(&c) {
                assert!((a.distance - b.distance).abs() <= 2.0 * kept.tolerance());
                assert!((a.distance - c.distance).abs() <= 2.0 * kept.tolerance());
                assert!(b.distance - b.lower < 1e-8 && c.distance - c.lower < 1e-8);
            }
        }
    }
}

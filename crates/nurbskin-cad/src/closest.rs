//! The closest point of a model: of its faces as their loops cut them, edges and corners included, certified.

mod around;

use super::model::{EdgeUse, Face, Model};
use super::region::Region;
use crate::pcurve::on_surface;
use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::nurbs::closest::{
    ClosestPoint, Cover, Foot, Nearest, Part, Workspace, in_spatial_order,
};
use nurbskin_geometry::nurbs::{NurbsCurve, NurbsSurface};
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::spatial::hierarchy;
use nurbskin_geometry::spatial::hierarchy::{Node, limit};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Where on a surface the nearest point lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// Inside, or on a seam, a pole, or an edge between two faces.
    Interior,
    /// On a free edge, beside which there is no other face, whether it shares the edge or not: the distance may run along
    /// the surface rather than away from it.
    FreeEdge,
}

/// The point of a model that is closest to a given point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelFoot {
    /// Index of the face; of one of them on an edge.
    pub face: usize,
    /// The foot. Its normal points outwards; on an edge between faces it is the sum of theirs, at a vertex weighted by
    /// their angles, so that it tells inside from outside (Baerentzen and Aanaes, *Signed distance computation using the
    /// angle weighted pseudonormal*, IEEE TVCG 11, 2005).
    pub foot: Foot,
    /// Whether it is on a free edge.
    pub place: Place,
}

/// Edges farther from their surface than this part of its size do not stand for its border.
const OFF: f64 = 1e-7;
/// Spans of an edge that are looked at for that.
const MOST_SPANS: usize = 1000;

/// Finds closest points of one model; made once, then asked for any number of points.
///
/// The faces are what their loops leave of their surfaces, together with their edges. Where a file's edges are off their
/// surfaces, both count.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_cad::{ClosestOnModel, Model, Place};
/// use nurbskin_geometry::nurbs::conic;
/// let mut model = Model::new("ball");
/// model.add_whole_surface(&conic::sphere(DVec3::ZERO, 1.0)?, 1e-9)?;
/// let found = ClosestOnModel::new(&model)?.closest(DVec3::new(0.0, 0.3, -0.4)).ok_or_else(|| nurbskin_geometry::Error::invalid("no face"))?;
/// assert!((found.foot.distance - 0.5).abs() < 1e-12 && found.foot.lower > 0.5 - 1e-9);
/// assert_eq!(found.place, Place::Interior);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[derive(Debug)]
pub struct ClosestOnModel<'a> {
    model: &'a Model,
    /// By index of the face; only those that count.
    faces: Vec<Option<Target>>,
    nodes: Vec<Node>,
    /// The face of each leaf of the hierarchy.
    leaves: Vec<usize>,
    around: [DVec3; 2],
    /// Of each edge: the faces, loops and places in them that use it.
    users: Vec<Vec<[usize; 3]>>,
    /// Of each vertex: those that begin there.
    corners: Vec<Vec<[usize; 3]>>,
    /// Of each edge with one user: whether other faces lie along it all the same.
    joined: Vec<bool>,
}

/// A face and what finds its points.
#[derive(Debug)]
struct Target {
    closest: ClosestPoint,
    part: Arc<FacePart>,
    size: f64,
}

/// What a face covers, and its border curves: those of its edges that have a length, each once.
#[derive(Debug)]
struct FacePart {
    region: Region,
    border: Vec<Border>,
}

#[derive(Debug)]
struct Border {
    edge: usize,
    pcurve: NurbsCurve,
}

impl Part for FacePart {
    fn contains(&self, place: DVec2) -> bool {
        self.region.contains(place)
    }
    fn cover(&self, low: DVec2, high: DVec2) -> Cover {
        self.region.cover(low, high)
    }
    fn place(&self, curve: usize, parameter: f64) -> DVec2 {
        let border = self.border.get(curve);
        border.map_or(DVec2::ZERO, |b| b.pcurve.point(parameter).truncate())
    }
}

impl Target {
    fn new(model: &Model, face: &Face) -> Result<Self> {
        let region = Region::new(face)?;
        let [low, high] = face.surface.bounding_box();
        let size = low.distance(high);
        let mut border: Vec<Border> = Vec::new();
        let mut curves: Vec<NurbsCurve> = Vec::new();
        let mut gap = 0.0_f64;
        for used in face.loops.iter().flat_map(|l| &l.uses) {
            let curve = model.edges().get(used.edge).and_then(|e| e.curve.as_ref());
            let Some(curve) = curve else { continue };
            let known = border.iter().any(|b| b.edge == used.edge);
            let mut add = |curve: NurbsCurve| {
                curves.push(curve);
                border.push(Border {
                    edge: used.edge,
                    pcurve: used.pcurve.clone(),
                });
            };
            if !known {
                add(curve.clone());
            }
            if !face.trimmed {
                continue;
            }
            // Edges that are off the surface leave its own border open.
            let off = gap_between(&face.surface, used, curve);
            let own = (off > OFF * size)
                .then(|| on_surface::curve(&face.surface, &used.pcurve, OFF * size).ok())
                .flatten();
            match own {
                Some(own) => {
                    add(own);
                    gap = gap.max(OFF * size);
                }
                None => gap = gap.max(off),
            }
        }
        let part = Arc::new(FacePart { region, border });
        let closest = if face.trimmed {
            ClosestPoint::of_part(&face.surface, part.clone(), &curves, gap)?
        } else {
            ClosestPoint::new(&face.surface)?
        };
        Ok(Self {
            closest,
            part,
            size,
        })
    }
}

/// How far an edge is from its p-curve on a surface, at samples.
fn gap_between(surface: &NurbsSurface, used: &EdgeUse, curve: &NurbsCurve) -> f64 {
    let breaks = curve.knots().breakpoints();
    let spans = breaks.windows(2).zip(0..MOST_SPANS);
    let places = spans.flat_map(|(w, _)| [0.0, 0.3, 0.7].map(|s| w[0] + s * (w[1] - w[0])));
    let off = |t: f64| {
        let place = used.pcurve.point(t);
        surface.point(place.x, place.y).distance(curve.point(t))
    };
    places.map(off).fold(0.0, f64::max)
}

impl<'a> ClosestOnModel<'a> {
    /// Prepares the faces of a model. O(pieces log pieces).
    ///
    /// # Errors
    /// [`Error::Unsupported`](nurbskin_geometry::Error::Unsupported) if a surface has 2^31 pieces or more,
    /// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) if a face has no loop.
    pub fn new(model: &'a Model) -> Result<Self> {
        let all: Vec<usize> = (0..model.faces().len()).collect();
        Self::of_faces(model, &all)
    }

    /// Prepares only the faces with these indices; those that do not exist are passed over.
    ///
    /// # Errors
    /// As [`ClosestOnModel::new`].
    pub fn of_faces(model: &'a Model, chosen: &[usize]) -> Result<Self> {
        let target = |k: &usize| {
            let face = model.faces().get(*k);
            face.map(|face| Target::new(model, face)).transpose()
        };
        let made: Vec<Option<Target>> = chosen.par_iter().map(target).collect::<Result<_>>()?;
        let mut faces: Vec<Option<Target>> = model.faces().iter().map(|_| None).collect();
        for (&k, made) in chosen.iter().zip(made) {
            if let Some(place) = faces.get_mut(k) {
                *place = made;
            }
        }
        let (leaves, boxes): (Vec<usize>, Vec<[DVec3; 2]>) = faces
            .iter()
            .enumerate()
            .filter_map(|(k, target)| Some((k, target.as_ref()?.closest.surface_box())))
            .unzip();
        let around = boxes
            .iter()
            .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[a, b], [c, d]| {
                [a.min(*c), b.max(*d)]
            });
        let mut users = vec![Vec::new(); model.edges().len()];
        let mut corners = vec![Vec::new(); model.vertices().len()];
        for (f, face) in model.faces().iter().enumerate() {
            for (l, each) in face.loops.iter().enumerate() {
                for (k, used) in each.uses.iter().enumerate() {
                    let Some(edge) = model.edges().get(used.edge) else {
                        continue;
                    };
                    users[used.edge].push([f, l, k]);
                    let from = if used.reversed { edge.end } else { edge.start };
                    corners[from].push([f, l, k]);
                }
            }
        }
        let mut this = Self {
            model,
            nodes: hierarchy::build(&boxes),
            leaves,
            faces,
            around,
            joined: vec![false; users.len()],
            users,
            corners,
        };
        this.join();
        Ok(this)
    }

    /// The closest point of the model; `None` if it has no face. About a microsecond near a bicubic face.
    #[must_use]
    pub fn closest(&self, point: DVec3) -> Option<ModelFoot> {
        self.nearest(point, None, &mut Workspace::default())
    }

    /// The closest points of many points, in their order; none at all if the model has no face. `starts` are faces and
    /// places on them near the feet, where known: they save time and change nothing. The same for any number of threads.
    ///
    /// # Errors
    /// [`Error::Cancelled`](nurbskin_geometry::Error::Cancelled).
    pub fn closest_all(
        &self,
        points: &[DVec3],
        starts: Option<&[(usize, DVec2)]>,
        progress: &dyn Progress,
    ) -> Result<Vec<ModelFoot>> {
        self.closest_all_as(points, starts, progress, |_, foot| *foot)
    }

    /// What `of` makes of each point and the closest one, as [`Self::closest_all`] finds it, where less than all of that is
    /// wanted of many points.
    pub fn closest_all_as<T: Copy + Send + Sync>(
        &self,
        points: &[DVec3],
        starts: Option<&[(usize, DVec2)]>,
        progress: &dyn Progress,
        of: impl Fn(DVec3, &ModelFoot) -> T + Sync,
    ) -> Result<Vec<T>> {
        let search = |k: usize, workspace: &mut Workspace| {
            let start = starts.and_then(|s| s.get(k)).copied();
            let found = self.nearest(points[k], start, workspace);
            found.map(|foot| of(points[k], &foot))
        };
        let found = in_spatial_order(points, self.around, progress, search)?;
        Ok(found.into_iter().flatten().collect())
    }

    fn nearest(
        &self,
        point: DVec3,
        start: Option<(usize, DVec2)>,
        workspace: &mut Workspace,
    ) -> Option<ModelFoot> {
        let mut best: Option<(usize, Nearest, Foot)> = None;
        let (mut radius, mut lower) = (f64::INFINITY, f64::INFINITY);
        let mut visit = |face: usize, start: Option<DVec2>| {
            let Some(Some(target)) = self.faces.get(face) else {
                return radius;
            };
            let found = target.closest.nearer(point, radius, start, workspace);
            lower = lower.min(found.lower);
            if let Some(foot) = found.foot
                && foot.distance < radius
            {
                radius = foot.distance;
                best = Some((face, found, foot));
            }
            radius
        };
        let (first, reach) = match start {
            Some((face, at)) => (face, visit(face, Some(at))),
            None => (usize::MAX, f64::INFINITY),
        };
        self.visit_near(point, reach, first, |face| visit(face, None));
        let (face, found, mut foot) = best?;
        foot.lower = foot.lower.min(lower);
        Some(self.placed(face, foot, found.border, workspace))
    }

    /// Visits the faces but `first` whose boxes are within reach of a point, from near to far; `visit` returns the new
    /// reach.
    fn visit_near(
        &self,
        point: DVec3,
        mut reach: f64,
        first: usize,
        mut visit: impl FnMut(usize) -> f64,
    ) {
        let [low, high] = self.around;
        let far = (point - low).abs().max((high - point).abs()).max_element();
        // Far above the rounding of the point to single precision.
        let slack = 8.0 * f64::from(f32::EPSILON) * (far + point.abs().max_element());
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the limit has slack for this rounding"
        )]
        let rounded = point.to_array().map(|x| x as f32);
        let within = |reach: f64| limit(reach * reach, slack);
        hierarchy::visit_near(&self.nodes, rounded, within(reach), |leaf| {
            if let Some(&face) = self.leaves.get(leaf)
                && face != first
            {
                reach = visit(face);
            }
            within(reach)
        });
    }
}

#[cfg(test)]
mod tests;

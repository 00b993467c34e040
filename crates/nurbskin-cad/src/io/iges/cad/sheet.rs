//! The face that a surface and its boundaries make, with vertices and edges of its own.

use super::super::directory::DirectoryEntry;
use super::carrier::Carrier;
use super::curves::{Chain, placed, points_of};
use super::entity::Reader;
use super::joints::Joints;
use super::lift::{apart, is_point, lifted, paired};
use super::trimmed::Border;
use super::{Got, Place, leave};
use crate::boundary::{Bound, BoundEdge, GIVEN};
use crate::pcurve::lift::{leaves, outside};
use crate::{Face, Loop};
use glam::DVec2;
use nurbskin_geometry::nurbs::bezier::curve_pieces;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::{NurbsCurve, NurbsSurface};
use nurbskin_geometry::{DVec3, Result};
use std::rc::Rc;

/// A piece of a boundary, in the coordinates of the model.
pub(super) struct Piece {
    pub(super) curve: NurbsCurve,
    pub(super) pcurve: Option<NurbsCurve>,
}

impl Reader<'_> {
    /// Adds the part of a surface within these boundaries; without an outer one, that is the edge of the surface.
    pub(super) fn face(
        &mut self,
        place: Place,
        entry: &Rc<DirectoryEntry>,
        surface: usize,
        borders: &[Border],
        name: String,
    ) -> Got<usize> {
        let place = place.of_part(match self.store.entry(surface) {
            // A bare surface has its own transformation already.
            Some(found) if found.sequence == entry.sequence => None,
            _ => self.store.transform(entry)?,
        });
        let carrier = self.carrier(entry, surface)?;
        // 1. Everything in the coordinates of the model.
        let mut hull: Vec<DVec3> = Vec::new();
        let mut chains = Vec::with_capacity(borders.len());
        for border in borders {
            let space = match &border.space {
                Some(space) => placed(space, place)?,
                None => Vec::new(),
            };
            self.spend(points_of(&space))?;
            hull.extend(space.iter().flat_map(NurbsCurve::control_points));
            chains.push(space);
        }
        let mut surface = carrier.realise(place, &hull)?;
        let own = matches!(*carrier, Carrier::Net { own_parameters, .. } if own_parameters);
        let flat = borders.iter().filter_map(|border| border.plane.as_ref());
        // Without an outer boundary, the domain is it.
        let bounded = own && borders.iter().any(|border| border.outer);
        if let Some(reach) = reach(flat).filter(|_| bounded) {
            surface = carrier.reaching(place, surface, reach)?;
        }
        self.spend(surface.control_points().points().len())?;
        if hull.is_empty() {
            hull.extend(surface.control_points().points());
        }
        let [low, high] = nurbskin_geometry::point_grid::bounding_box(&hull);
        let tolerance = self.tolerance(low.distance(high));
        // 2. Pieces with curves of both kinds.
        let mut pieces = Vec::with_capacity(borders.len());
        for (border, space) in borders.iter().zip(chains) {
            let found = self.pieces(place, entry, &carrier, &surface, border, space, tolerance)?;
            self.spend(found.iter().map(|p| p.curve.control_points().len()).sum())?;
            pieces.push((found, border.outer));
        }
        // 3. The face.
        let added = self.add_face(&surface, &carrier, &pieces, name, tolerance);
        self.take_notes(entry);
        let face = added?;
        if place.mirrors() {
            self.file.model.turn_face(face)?;
        }
        self.see_colour(entry)?;
        Ok(face)
    }

    /// Lengths below this mean nothing: what the file says, within reason for something of this size.
    pub(super) fn tolerance(&self, size: f64) -> f64 {
        self.store.global.resolution.clamp(1e-7 * size, 1e-4 * size)
    }

    fn pieces(
        &mut self,
        place: Place,
        entry: &DirectoryEntry,
        carrier: &Carrier,
        surface: &NurbsSurface,
        border: &Border,
        space: Vec<NurbsCurve>,
        tolerance: f64,
    ) -> Got<Vec<Piece>> {
        let own = matches!(carrier, Carrier::Net { own_parameters, .. } if *own_parameters);
        let plane = border.plane.as_ref().filter(|_| own);
        let lift = |plane: &Chain| -> Result<Vec<Piece>> {
            let closed = Direction::BOTH.map(|d| surface.is_closed(d, tolerance));
            let each = plane.iter().map(|pcurve| {
                let pcurve = pcurve.clamped()?;
                if leaves(&pcurve, surface.domain(), closed) {
                    return Err(outside());
                }
                Ok(Piece {
                    curve: lifted(surface, &pcurve, 0.1 * tolerance)?,
                    pcurve: Some(pcurve.map_points(|p| DVec3::new(p.x, p.y, 0.0))?),
                })
            });
            each.collect()
        };
        if space.is_empty() {
            return match plane {
                Some(plane) => Ok(lift(plane)?),
                None => leave("a boundary has no curves in space"),
            };
        }
        // Poles have no curve in space.
        let matching = plane.map(|plane| -> Vec<&NurbsCurve> {
            let long =
                |p: &&NurbsCurve| plane.len() == space.len() || !is_point(surface, p, tolerance);
            plane.iter().filter(long).collect()
        });
        let matching = matching.filter(|plane| plane.len() == space.len());
        let mut worst = 0.0_f64;
        let order = border
            .plane
            .as_ref()
            .map(|plane| in_order(plane, &space, tolerance));
        let mut pieces = Vec::with_capacity(space.len());
        for (k, curve) in space.into_iter().enumerate() {
            let mut pcurve = carrier.pcurve(place, &curve);
            if let Some(given) = matching.as_ref().and_then(|plane| plane.get(k)) {
                let (found, off) = paired(surface, given, &curve)?;
                if off > 10.0 * tolerance && !border.space_first {
                    worst = worst.max(apart(surface, &found, &curve));
                }
                pcurve = (off <= GIVEN * tolerance).then_some(found);
            }
            pieces.push(Piece { curve, pcurve });
        }
        // Where the two are not the same, the one that the file prefers counts; with no preference, the one that is on
        // the surface by its nature.
        let mut lifted_all = None;
        if worst > 10.0 * tolerance
            && let Some(plane) = plane
        {
            let from = (entry.line, entry.sequence);
            self.file.warnings.push(format!(
                "line {} (D{}): its 3-D and 2-D trimming curves disagree by {}; the 2-D curves were used",
                from.0,
                from.1,
                self.file.model.unit.length(worst)
            ));
            lifted_all = Some(lift(plane)?);
        }
        let mut pieces = lifted_all.unwrap_or(pieces);
        if let Some(order) = order.flatten() {
            let mut slots: Vec<Option<Piece>> = pieces.into_iter().map(Some).collect();
            pieces = order
                .into_iter()
                .filter_map(|k| slots.get_mut(k)?.take())
                .collect();
        }
        Ok(pieces)
    }

    fn add_face(
        &mut self,
        surface: &NurbsSurface,
        carrier: &Carrier,
        borders: &[(Vec<Piece>, bool)],
        name: String,
        tolerance: f64,
    ) -> Got<usize> {
        let kind = carrier.kind();
        let whole = !borders.iter().any(|(_, outer)| *outer);
        let model = &mut self.file.model;
        let natural = if whole {
            let surface = crate::clamped(surface)?;
            Some(model.whole_loop(&surface, tolerance)?)
        } else {
            None
        };
        if borders.is_empty() {
            return Ok(model.add_face(Face {
                surface: surface.clone(),
                kind,
                reversed: false,
                loops: natural.into_iter().collect(),
                trimmed: false,
                name,
            })?);
        }
        let mut bounds: Vec<Bound> = natural.map(as_bound).into_iter().collect();
        let mut joints = Joints::new(tolerance);
        for (pieces, outer) in borders {
            bounds.push(self.bound(pieces, *outer, &mut joints, surface)?);
        }
        // Files do not keep to a sense of these boundaries, and on closed surfaces it says which part is meant: as they
        // are, all turned round, the holes, the outer one.
        let model = &mut self.file.model;
        let mut first = None;
        for turn in [[false; 2], [true; 2], [true, false], [false, true]] {
            let bounds: Vec<Bound> = bounds
                .iter()
                .map(|b| {
                    if turn[usize::from(b.outer)] {
                        b.clone().turned()
                    } else {
                        b.clone()
                    }
                })
                .collect();
            match model.add_bounded_face(
                surface,
                kind,
                false,
                &bounds,
                name.clone(),
                [tolerance, 0.0],
            ) {
                Ok(face) => return Ok(face),
                Err(error) => {
                    first = first.or(Some(error));
                    drop(model.take_notes());
                }
            }
        }
        leave(first.map_or_else(String::new, |error| error.to_string()))
    }

    /// The edges of one boundary. Pieces that coincide are one edge, a seam.
    fn bound(
        &mut self,
        pieces: &[Piece],
        outer: bool,
        joints: &mut Joints,
        surface: &NurbsSurface,
    ) -> Got<Bound> {
        let ends = |curve: &NurbsCurve| {
            let (a, b) = curve.domain();
            [curve.point(a), curve.point(b)]
        };
        // A piece that is a point is none: poles are found again.
        let long = |piece: &&Piece| {
            let [low, high] =
                nurbskin_geometry::point_grid::bounding_box(piece.curve.control_points());
            low.distance(high) > joints.tolerance
        };
        let pieces: Vec<&Piece> = pieces.iter().filter(long).collect();
        let all: Vec<[DVec3; 2]> = pieces.iter().map(|p| ends(&p.curve)).collect();
        let backwards = senses(&all, joints.tolerance);
        let run = |k: usize| {
            let [from, to] = all[k];
            if backwards[k] { [to, from] } else { [from, to] }
        };
        let mut edges = Vec::with_capacity(pieces.len());
        let Some(last) = pieces.len().checked_sub(1) else {
            return leave("a boundary is a single point");
        };
        let mut at = joints.vertex(&mut self.file.model, run(last)[1])?;
        let (first, mut end) = (at, run(last)[1]);
        for (k, piece) in pieces.iter().enumerate() {
            let [from, to] = run(k);
            let widest = 1e3 * joints.tolerance;
            if end.distance(from) > widest {
                return leave(format!(
                    "its boundary is open: {} between the end of a curve and the start of the next",
                    self.file.model.unit.length(end.distance(from))
                ));
            }
            end = to;
            let next = if k == last {
                first
            } else {
                joints.vertex(&mut self.file.model, to)?
            };
            edges.push(joints.edge(
                &mut self.file.model,
                piece,
                [at, next],
                backwards[k],
                surface,
            )?);
            at = next;
        }
        Ok(Bound { edges, outer })
    }
}

/// The rectangle of many places of curves in the parameter plane, and one that holds the curves; `None` without any.
fn reach<'c>(chains: impl Iterator<Item = &'c Chain>) -> Option<[[DVec2; 2]; 2]> {
    let (mut seen, mut hull): (Vec<DVec2>, Vec<DVec2>) = (Vec::new(), Vec::new());
    for curve in chains.flat_map(|chain| chain.iter()) {
        for piece in curve_pieces(curve).ok()? {
            seen.extend((0..=16).map(|k| piece.point(f64::from(k) / 16.0).truncate()));
            hull.extend(piece.points.iter().map(|h| (h.truncate() / h.w).truncate()));
        }
    }
    let rectangle = |places: &[DVec2]| {
        let empty = [DVec2::INFINITY, DVec2::NEG_INFINITY];
        places
            .iter()
            .fold(empty, |[low, high], &p| [low.min(p), high.max(p)])
    };
    (!seen.is_empty()).then(|| [rectangle(&seen), rectangle(&hull)])
}

/// Longer boundaries keep their order.
const MOST_SORTED: usize = 32;

/// The order in which the curves in the parameter plane follow each other, where it is another one than the file's: all
/// pieces of a torus between its seams meet in one point in space, which allows any order there.
fn in_order(plane: &[NurbsCurve], space: &[NurbsCurve], tolerance: f64) -> Option<Vec<usize>> {
    if plane.len() != space.len() || plane.len() > MOST_SORTED {
        return None;
    }
    let ends = |curve: &NurbsCurve| {
        let (a, b) = curve.domain();
        [curve.point(a), curve.point(b)]
    };
    let flat: Vec<[DVec3; 2]> = plane.iter().map(ends).collect();
    let round: Vec<[DVec3; 2]> = space.iter().map(ends).collect();
    let [low, high] = nurbskin_geometry::point_grid::bounding_box(flat.as_flattened());
    let near = 1e-4 * low.distance(high);
    let follows = |k: usize, next: usize| {
        flat[k][1].distance(flat[next][0]) <= near
            && round[k][1].distance(round[next][0]) <= 10.0 * tolerance
    };
    let count = plane.len();
    if (0..count).all(|k| follows(k, (k + 1) % count)) {
        return None;
    }
    let mut order = vec![0];
    while order.len() < count {
        let at = *order.last()?;
        order.push((0..count).find(|k| !order.contains(k) && follows(at, *k))?);
    }
    follows(*order.last()?, 0).then_some(order)
}

/// Which curves of a closed chain run against it, by their ends: nearly always none.
fn senses(ends: &[[DVec3; 2]], tolerance: f64) -> Vec<bool> {
    let mut backwards = vec![false; ends.len()];
    if ends.len() < 2 {
        return backwards;
    }
    // The first one runs towards the second.
    let to_next = |p: DVec3| p.distance(ends[1][0]).min(p.distance(ends[1][1]));
    let first = to_next(ends[0][0]) < to_next(ends[0][1]);
    // There and back along a seam, both ends meet the next one.
    backwards[0] = first && to_next(ends[0][1]) > tolerance;
    let mut at = ends[0][usize::from(!backwards[0])];
    for k in 1..ends.len() {
        let [from, to] = ends[k];
        // A closed curve runs as it does: rounding shall not turn it.
        backwards[k] = at.distance(from) > tolerance && at.distance(to) < at.distance(from);
        at = if backwards[k] { from } else { to };
    }
    backwards
}

/// The loop around a whole surface among other boundaries.
fn as_bound(whole: Loop) -> Bound {
    let edges = whole.uses.into_iter().map(|used| BoundEdge {
        edge: used.edge,
        reversed: used.reversed,
        pcurve: Some(used.pcurve),
    });
    Bound {
        edges: edges.collect(),
        outer: true,
    }
}

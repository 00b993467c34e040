//! Trimming: a surface that ends where its scan does.
//!
//! 1. `support` measures the distance from each node of a grid to the scan, along the surface. Nodes farther than the
//!    scan's own gaps are bare. Bare regions wider than three spacings are cut out, smaller ones stay covered.
//! 2. A morphological closing (Serra 1982) takes the contour back to the rim of the data, and `seams` moves a seam that
//!    a bare region would cross.
//! 3. `rims` ends the surface before it turns away from the scan or meets itself beside a rim.
//! 4. `outline` traces the contours, along the sides of the domain or inside it; `pcurve` fits smooth p-curves between
//!    corners.
//! 5. The surface is extended a little beyond sides that loops touch, so that all loops lie inside its domain. Edges in
//!    space follow S(p(t)), not the data, within a certified gap (`on_surface`).

mod outline;
mod pcurve;
mod rims;
mod seams;
mod support;

use super::check::{Defects, crossings};
use super::model::{EdgeUse, Face, Loop, Model};
use super::{Region, SurfaceKind, natural};
use crate::pcurve::on_surface;
use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::nurbs::NurbsSurface;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::shape::Edge as Side;
use nurbskin_geometry::spatial::nearest::Nearest;
use outline::{Outline, Run};
use rims::{CROSSING, TURNED};
use std::borrow::Cow;
use support::Support;

pub use support::Scanned;

/// The result of trimming a surface to its scan.
#[derive(Clone, Debug, PartialEq)]
pub struct Trimming {
    /// The surface, with its seam moved if a loop would have crossed it. If it is trimmed, its domain extends beyond
    /// the open sides that the loops touch.
    pub surface: NurbsSurface,
    /// Shift of the seam in each direction, as a share of the domain.
    pub moved: [f64; 2],
    /// The loops in (u, v), the outer one first. Empty if the surface ends as the scan does.
    loops: Vec<Vec<Piece>>,
    /// Share of the area that is cut off.
    pub cut: f64,
    /// Share of the area without data that stays covered.
    pub covered: f64,
    /// Whether some of it would have been cut off if the surface did not have to stay closed.
    pub kept_closed: bool,
    /// Share of the area that is cut off beside rims because the surface turned away from the scan or met itself there.
    pub withdrawn: f64,
    /// Folds and self-intersections of the trimmed surface, if they were searched.
    pub crossings: Defects,
}

/// A piece of a loop.
#[derive(Clone, Debug, PartialEq)]
enum Piece {
    /// Along a side of the domain before its extension, from one point to another.
    Side([DVec2; 2]),
    /// A p-curve inside the domain, in the direction of the loop.
    Inside(nurbskin_geometry::NurbsCurve),
}

impl Trimming {
    /// Whether anything is cut off.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        !self.loops.is_empty()
    }

    /// The trimmed region in (u, v).
    ///
    /// # Errors
    /// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) if nothing is cut off.
    pub fn region(&self) -> Result<Region> {
        let used = |piece: &Piece| -> Result<EdgeUse> {
            let pcurve = match piece {
                Piece::Side([from, to]) => {
                    natural::line(from.to_array(), to.to_array(), (0.0, 1.0))?
                }
                Piece::Inside(curve) => curve.clone(),
            };
            Ok(EdgeUse {
                edge: 0,
                reversed: false,
                pcurve,
            })
        };
        let of = |pieces: &Vec<Piece>| -> Result<Loop> {
            let uses = pieces.iter().map(used).collect::<Result<_>>()?;
            Ok(Loop { uses })
        };
        let loops = self.loops.iter().map(of).collect::<Result<Vec<_>>>()?;
        Region::of_loops(&loops, &self.surface)
    }

    /// Whether no two boundaries of the region cross.
    fn is_apart(&self) -> Result<bool> {
        let apart = |region: Region| region.crossings().is_ok_and(|found| found.is_empty());
        Ok(!self.is_cut() || apart(self.region()?))
    }

    /// Folds and self-intersections of the trimmed surface, searched with the chords of a model of this diagonal. If
    /// `known` is given, those of `known` that are left, without a new search.
    fn crossings(&self, diagonal: f64, known: Option<&Defects>) -> Result<Defects> {
        let region = match self.is_cut() {
            true => Some(self.region()?),
            false => None,
        };
        let keeps = |p: DVec2| region.as_ref().is_none_or(|region| region.contains(p));
        Ok(match known {
            Some(known) => known.within(&keeps),
            None => crossings(&self.surface, diagonal, &keeps),
        })
    }

    /// Extends the surface by about this length beyond the open sides that a loop touches.
    fn extend(&mut self, length: f64) {
        let lengths = self.surface.iso_lengths();
        let slack = CLOSED_TOLERANCE * lengths[0].max(lengths[1]);
        for direction in Direction::BOTH {
            if self.surface.is_closed(direction, slack) {
                continue;
            }
            let (axis, sides) = match direction {
                Direction::U => (0, [Side::UMin, Side::UMax]),
                Direction::V => (1, [Side::VMin, Side::VMax]),
            };
            let breaks = self.surface.knots(direction).breakpoints();
            let (a, b) = (breaks[0], breaks[breaks.len() - 1]);
            let [first, last] = [breaks[1] - a, b - breaks[breaks.len() - 2]];
            let along = length / lengths[axis].max(f64::MIN_POSITIVE) * (b - a);
            let by = |side: Side, span: f64, touches: &dyn Fn(f64) -> bool| {
                let mut ends = self.loops.iter().flatten().flat_map(Piece::ends);
                if ends.any(|p| touches(p[axis])) && !self.surface.is_pole(side, slack) {
                    along.min(MAX_EXTENSION_OF_SPAN * span)
                } else {
                    0.0
                }
            };
            let before = by(sides[0], first, &|x| x <= a);
            let behind = by(sides[1], last, &|x| x >= b);
            // If a weight would not stay positive, the outline stays on the side.
            if (before > 0.0 || behind > 0.0)
                && let Ok(longer) = self.surface.extended(direction, a - before, b + behind)
            {
                self.surface = longer;
            }
        }
    }

    /// Number of holes.
    #[must_use]
    pub fn holes(&self) -> usize {
        self.loops.len().saturating_sub(1)
    }
}

impl Piece {
    /// Where it begins and ends.
    fn ends(&self) -> [DVec2; 2] {
        match self {
            Self::Side(ends) => *ends,
            Self::Inside(curve) => {
                let points = curve.control_points();
                [points[0], points[points.len() - 1]].map(|p| p.truncate())
            }
        }
    }
}

/// Length by which the surface is extended beyond open sides that a loop touches, in spacings. Trial: not recorded.
/// Without it, loops lie on the border of the domain and other systems have nothing to offset or extend.
const EXTENSION: f64 = 2.0;
/// Longest extension as a share of the last span. Guard: a polynomial swings out if it is continued farther.
const MAX_EXTENSION_OF_SPAN: f64 = 0.25;

/// Distance of two opposite sides of a surface, as a share of its length, up to which it is closed. Guard: above
/// rounding, far below any tolerance.
const CLOSED_TOLERANCE: f64 = 1e-9;

/// Distance of the end of an outline from a side of the domain, as a share of the side, up to which it lies on the
/// side. Guard: a few operations' rounding.
const END_ROUNDING: f64 = 1e-13;

/// Largest distances of p-curves from the outlines, in steps of the grid, that are tried until no two curves cross.
/// Trial: with a first one of 0.4 in an earlier version, rims of meshes left the tolerance; a smaller one follows the
/// noise of the outline.
const PCURVE_TOLERANCES: [f64; 4] = [0.25, 0.12, 0.06, 0.03];

/// Trims a surface where its scan ends.
///
/// Places farther from the scan, along the surface, than the scan's own gaps are bare; bare regions wider than three
/// spacings are cut out. A closed direction of a surface that is not periodic keeps its seam, and regions across it
/// stay covered; so do regions around a pole and regions that would leave only islands.
///
/// O(nodes log points) with at most 250 000 nodes.
///
/// # Errors
/// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) if weights underflow.
pub fn trimming(surface: &NurbsSurface, scan: &Scanned<'_>) -> Result<Trimming> {
    trimming_near(surface, scan, &scan.nearest(), None)
}

/// [`trimming`] with an existing search structure. If a diagonal `crosses` is given, self-intersections are searched
/// with the chords of a model of that diagonal.
pub fn trimming_near(
    surface: &NurbsSurface,
    scan: &Scanned<'_>,
    nearest: &Nearest,
    crosses: Option<f64>,
) -> Result<Trimming> {
    let mut found = Support::new(surface, scan, nearest);
    found.keep_wide();
    found.draw_in();
    // A seam that no cut crosses.
    let mut surface = Cow::Borrowed(surface);
    let mut moved = [0.0; 2];
    for direction in Direction::BOTH {
        let Some(span) = found.seam(&surface, direction) else {
            continue;
        };
        let (a, b) = surface.knots(direction).domain();
        let shift = surface.knots(direction).breakpoints()[span] - a;
        surface = Cow::Owned(surface.with_seam_after(direction, span)?);
        found.turn(direction, shift / (b - a));
        moved[usize::from(direction == Direction::V)] = shift / (b - a);
    }
    found.cover_seams_and_poles();
    let whole = found.clone();
    for &depth in TURNED.depths {
        found.withdraw(&found.turned(), depth, &TURNED);
    }
    let mut trimming = cut_down(&surface, moved, &found, scan.spacing)?;
    if found.withdrawn > 0.0 && !trimming.is_apart()? {
        // Outlines that cross are worse than a fold beside a rim.
        found = whole;
        trimming = cut_down(&surface, moved, &found, scan.spacing)?;
    }
    let Some(diagonal) = crosses else {
        return Ok(trimming);
    };
    trimming.crossings = trimming.crossings(diagonal, None)?;
    let mut is_searched = true;
    for &depth in CROSSING.depths {
        // The known crossings are gone. Search again: the surface may now be extended beyond other sides.
        if trimming.crossings.is_empty() && !is_searched {
            trimming.crossings = trimming.crossings(diagonal, None)?;
            is_searched = true;
        }
        // What winds through itself widely has no parts to cut off.
        if trimming.crossings.is_empty() || trimming.crossings.is_wide() {
            break;
        }
        let [(a, b), (c, d)] = surface.domain();
        let lengths = found.size() / DVec2::new(b - a, d - c);
        let places = trimming.crossings.places().into_iter();
        let places: Vec<DVec2> = places.map(|p| (p - DVec2::new(a, c)) * lengths).collect();
        if found.withdraw(&places, depth, &CROSSING) {
            let mut next = cut_down(&surface, moved, &found, scan.spacing)?;
            if !next.is_apart()? {
                continue;
            }
            next.crossings = next.crossings(diagonal, Some(&trimming.crossings))?;
            (trimming, is_searched) = (next, false);
        }
    }
    if !is_searched {
        trimming.crossings = trimming.crossings(diagonal, None)?;
    }
    Ok(trimming)
}

/// The trimmed surface, extended a little beyond the sides that its loops touch.
fn cut_down(
    surface: &NurbsSurface,
    moved: [f64; 2],
    found: &Support,
    spacing: f64,
) -> Result<Trimming> {
    let [cut, covered] = found.shares();
    let outlines = if cut > 0.0 {
        outline::trace(found)
    } else {
        Vec::new()
    };
    let mut trimming = Trimming {
        surface: surface.clone(),
        moved,
        loops: Vec::new(),
        cut,
        covered,
        kept_closed: found.kept_closed,
        withdrawn: found.withdrawn,
        crossings: Defects::default(),
    };
    // Outlines do not cross, but smooth curves close to them may.
    for smoothness in PCURVE_TOLERANCES {
        let of = |o: &Outline| pieces(o, &trimming.surface, found, smoothness);
        trimming.loops = outlines.iter().map(of).collect::<Result<Vec<_>>>()?;
        if trimming.is_apart()? {
            break;
        }
    }
    trimming.extend(EXTENSION * spacing);
    Ok(trimming)
}

/// An outline as pieces of a loop in the parameters of the surface.
fn pieces(
    outline: &Outline,
    surface: &NurbsSurface,
    found: &Support,
    smoothness: f64,
) -> Result<Vec<Piece>> {
    let [(a, b), (c, d)] = surface.domain();
    let unit = |p: DVec2| {
        let p = (p / found.size()).clamp(DVec2::ZERO, DVec2::ONE);
        // Exact ends: equal places on a seam are identified by their parameters.
        let at = |x: f64, a: f64, b: f64| {
            if x >= 1.0 - END_ROUNDING {
                b
            } else if x <= END_ROUNDING {
                a
            } else {
                a + (b - a) * x
            }
        };
        DVec2::new(at(p.x, a, b), at(p.y, c, d))
    };
    let mut pieces = Vec::new();
    for run in &outline.runs {
        match run {
            Run::Side(ends) => pieces.push(Piece::Side(ends.map(unit))),
            Run::Inside(points) => {
                let curves = pcurve::smooth(points, outline.closes(), found.step(), smoothness)?;
                for curve in curves {
                    pieces.push(Piece::Inside(
                        curve.map_points(|p| unit(p.truncate()).extend(0.0))?,
                    ));
                }
            }
        }
    }
    Ok(pieces)
}

impl Model {
    /// Adds the face of a trimming and returns its index. The largest distance between an edge and the surface is at
    /// most `gap`. Sides of the surface that coincide within `tolerance` are one edge.
    ///
    /// # Errors
    /// [`Error::NoSolution`](nurbskin_geometry::Error::NoSolution) if an edge cannot follow the surface that closely.
    pub fn add_trimmed_surface(
        &mut self,
        trimming: &Trimming,
        tolerance: f64,
        gap: f64,
    ) -> Result<usize> {
        if !trimming.is_cut() {
            return self.add_whole_surface(&trimming.surface, tolerance);
        }
        let surface = natural::clamped(&trimming.surface)?;
        let closed = Direction::BOTH.map(|d| surface.is_closed(d, tolerance));
        let mut builder = Builder {
            model: self,
            surface: &surface,
            closed,
            tolerance,
            gap,
            vertices: Vec::new(),
            seams: Vec::new(),
        };
        let mut loops = Vec::new();
        for pieces in &trimming.loops {
            let mut uses = Vec::new();
            for piece in pieces {
                uses.extend(builder.edge(piece)?);
            }
            loops.push(Loop { uses });
        }
        self.add_face(Face {
            surface,
            kind: SurfaceKind::BSpline,
            reversed: false,
            loops,
            trimmed: true,
            name: String::new(),
        })
    }
}

/// Makes the edges of one face.
struct Builder<'a> {
    model: &'a mut Model,
    surface: &'a NurbsSurface,
    closed: [bool; 2],
    tolerance: f64,
    gap: f64,
    /// Vertices and their (u, v); those on a seam have the parameter of the start of the domain.
    vertices: Vec<(DVec2, usize)>,
    /// Edges along seams: whether they run along u, their ends as above, and the edge. Each is used twice.
    seams: Vec<(bool, [DVec2; 2], usize)>,
}

impl Builder<'_> {
    /// The representative of all parameters of the same point: on a seam, that of the start of the domain.
    fn folded(&self, p: DVec2) -> DVec2 {
        let [(a, b), (c, d)] = self.surface.domain();
        DVec2::new(
            if self.closed[0] && p.x >= b { a } else { p.x },
            if self.closed[1] && p.y >= d { c } else { p.y },
        )
    }

    /// The vertex at this place. A pole is one vertex for all values of its other parameter.
    fn vertex(&mut self, p: DVec2) -> Result<usize> {
        let at = self.folded(p);
        let point = self.surface.point(p.x, p.y);
        let on_pole = |q: DVec2| {
            let [(a, b), (c, d)] = self.surface.domain();
            let sides = [
                (Side::UMin, p.x <= a && q.x <= a),
                (Side::UMax, p.x >= b && q.x >= b),
                (Side::VMin, p.y <= c && q.y <= c),
                (Side::VMax, p.y >= d && q.y >= d),
            ];
            let both =
                |&(side, both): &(Side, bool)| both && self.surface.is_pole(side, self.tolerance);
            sides.iter().any(both)
        };
        let same = |v: &&(DVec2, usize)| v.0 == at || on_pole(v.0);
        if let Some(&(_, vertex)) = self.vertices.iter().find(same) {
            return Ok(vertex);
        }
        let vertex = self.model.add_vertex(point)?;
        self.vertices.push((at, vertex));
        Ok(vertex)
    }

    /// The edge of a piece, as the loop uses it.
    fn edge(&mut self, piece: &Piece) -> Result<Vec<EdgeUse>> {
        match piece {
            Piece::Side(ends) => self.side(*ends).map(|used| vec![used]),
            Piece::Inside(curve) => {
                let [start, end] = piece.ends();
                let (start, end) = (self.vertex(start)?, self.vertex(end)?);
                let on_surface = on_surface::curve(self.surface, curve, self.gap)?;
                let edge = self.model.add_edge(&on_surface, start, end)?;
                Ok(vec![EdgeUse {
                    edge,
                    reversed: false,
                    pcurve: curve.clone(),
                }])
            }
        }
    }

    /// A piece of a side of the domain: the exact boundary curve between two parameters.
    fn side(&mut self, [from, to]: [DVec2; 2]) -> Result<EdgeUse> {
        // The edge runs along u if v is constant, with increasing parameters.
        let along_u = (to.x - from.x).abs() > (to.y - from.y).abs();
        let at = |p: DVec2| if along_u { p.x } else { p.y };
        let reversed = at(to) < at(from);
        let (low, high) = if reversed { (to, from) } else { (from, to) };
        let range = (at(low), at(high));
        let pcurve = natural::line(low.to_array(), high.to_array(), range)?;
        let used = |edge: usize| EdgeUse {
            edge,
            reversed,
            pcurve: pcurve.clone(),
        };
        let is_seam = self.closed[usize::from(along_u)];
        let key = [low, high].map(|p| self.folded(p));
        // Its far end may be the seam of the other direction.
        let same = |seam: &&(bool, [DVec2; 2], usize)| (seam.0, seam.1) == (along_u, key);
        if is_seam && let Some(&(.., edge)) = self.seams.iter().find(same) {
            return Ok(used(edge));
        }
        let direction = if along_u { Direction::V } else { Direction::U };
        let line = self
            .surface
            .iso_curve(direction, if along_u { low.y } else { low.x })?;
        let (start, end) = (self.vertex(low)?, self.vertex(high)?);
        let points = line.control_points();
        let centre = points[0];
        let is_pole = points
            .iter()
            .all(|p: &DVec3| p.distance(centre) <= self.tolerance);
        let edge = if is_pole {
            self.model.add_degenerate_edge(start)?
        } else {
            let (a, b) = line.domain();
            let whole = range.0 <= a && range.1 >= b;
            let line = if whole {
                line
            } else {
                line.segment(range.0, range.1)?
            };
            self.model.add_edge(&line, start, end)?
        };
        if is_seam {
            self.seams.push((along_u, key, edge));
        }
        Ok(used(edge))
    }
}

#[cfg(test)]
mod tests;

//! Shells: what their faces leave open, which way they look, folds and self-intersections.

use super::{FOLD, Limit, Report, Severity, Subject, Worst};
use crate::Result;
use crate::cad::mass::shell_mass;
use crate::cad::model::ShellKind;
use crate::cad::region::scale_of;
use crate::cad::tree::Tree;
use crate::nurbs::NurbsSurface;
use crate::nurbs::tessellate::{Tessellation, tessellate};
use crate::unit::grouped;
use glam::{DVec2, DVec3};

/// Triangles of a face allowed for the search, ...
const TRIANGLES: usize = 4_000_000;
/// Chordal tolerance as a share of the diagonal, ...
const SHARE: f64 = 1e-3;
/// ... and those that confirm what was found.
const TRIANGLES_TO_CONFIRM: usize = 1_000_000;
const FINER: f64 = 1.25e-4;

/// Folds and self-intersections.
#[cfg_attr(
    not(feature = "files"),
    allow(dead_code, reason = "the pipeline uses it")
)]
pub(super) struct Found {
    /// The largest angle by which a normal turns at once.
    fold: Worst,
    /// The number of pairs of triangles that cross.
    crossings: Worst,
    /// Where either is, in (u, v).
    pub(super) places: Vec<DVec2>,
}

/// The largest fold, and the self-intersections.
///
/// # Errors
/// Those of tessellating with at most [`TRIANGLES`].
fn folds_and_crossings(subject: &Subject) -> Result<Found> {
    found(|share, most| Grids::new(subject, share, most))
}

/// The same of one surface by itself, where `keeps` keeps it; chords as in a model of this diagonal.
///
/// # Errors
/// As [`folds_and_crossings`].
#[cfg_attr(
    not(feature = "files"),
    allow(dead_code, reason = "the pipeline uses it")
)]
pub(super) fn folds_and_crossings_of(
    surface: &NurbsSurface,
    diagonal: f64,
    keeps: &dyn Fn(DVec2) -> bool,
) -> Result<Found> {
    found(|share, most| Grids::of_surface(surface, share * diagonal, most, keeps))
}

fn found<'a>(grids: impl Fn(f64, usize) -> Result<Grids<'a>>) -> Result<Found> {
    let coarse = grids(SHARE, TRIANGLES)?;
    let (fold, mut folded) = folds(&coarse);
    let (mut crossings, mut places) = coarse.overlaps();
    // Chords cut corners: what is real is there with shorter ones as well.
    if crossings.value > 0.5
        && let Ok(fine) = grids(FINER, TRIANGLES_TO_CONFIRM)
    {
        (crossings, places) = fine.overlaps();
    }
    places.append(&mut folded);
    Ok(Found {
        fold,
        crossings,
        places,
    })
}

pub(super) fn check(subject: &Subject, report: &mut Report) {
    let (defect, none) = (Severity::Defect, Limit::Most(0.0));
    match folds_and_crossings(subject) {
        Ok(Found {
            fold, crossings, ..
        }) => {
            report.add("folds", defect, Limit::Most(FOLD), "deg", fold);
            report.add("self_intersections", defect, none, "", crossings);
        }
        Err(_) => report.skipped.push(format!(
            "folds and self-intersections: more than {} triangles would be needed to look for them",
            grouped(TRIANGLES)
        )),
    }
    let [orientation, shared, free, open] = uses(subject);
    report.add("shell_orientation", defect, none, "", orientation);
    report.add("non_manifold_edges", defect, none, "", shared);
    report.add("free_edges", defect, none, "", free);
    report.add("open_edges", Severity::Information, none, "", open);
    let mut least = Worst::of(f64::INFINITY);
    let mut any = false;
    for (k, shell) in subject.model.shells().iter().enumerate() {
        if shell.kind != ShellKind::Solid {
            continue;
        }
        any = true;
        match shell_mass(subject.model, k) {
            Ok(mass) => {
                let volume = Worst {
                    value: mass.volume.unwrap_or(f64::NAN),
                    place: Some(mass.centroid),
                    face: None,
                    edge: None,
                };
                least = least.smaller(volume);
            }
            Err(error) => report
                .skipped
                .push(format!("the volume of shell {}: {error}", k + 1)),
        }
    }
    if any {
        let unit = format!("{}3", subject.model.unit);
        report.add("solid_volume", defect, Limit::Above(0.0), &unit, least);
    }
}

/// Edges that faces use in the same sense, that more than two use, and that one uses in closed and in open shells.
fn uses(subject: &Subject) -> [Worst; 4] {
    let mut worst = [Worst::default(); 4];
    let model = subject.model;
    // Faces without a shell are taken as an open one.
    let mut shell_of = vec![usize::MAX; model.faces().len()];
    for (k, shell) in model.shells().iter().enumerate() {
        shell.faces.iter().for_each(|&face| shell_of[face] = k);
    }
    for (k, edge) in model.edges().iter().enumerate() {
        let Some(curve) = &edge.curve else { continue };
        let (a, b) = curve.domain();
        let place = Some(curve.point(f64::midpoint(a, b)));
        let mut shells: Vec<usize> = subject.uses[k].iter().map(|u| shell_of[u[0]]).collect();
        shells.sort_unstable();
        shells.dedup();
        for shell in shells {
            let mut senses = [0_u32; 2];
            let mut face = None;
            for &[f, l, m] in subject.uses[k].iter().filter(|u| shell_of[u[0]] == shell) {
                let found = &model.faces()[f];
                let used = &found.loops[l].uses[m];
                senses[usize::from(used.reversed != found.reversed)] += 1;
                face = face.or(Some(f));
            }
            let closed = model
                .shells()
                .get(shell)
                .is_some_and(|s| s.kind != ShellKind::Open);
            match senses {
                [1, 1] => {}
                [1, 0] | [0, 1] if closed => worst[2].count(place, face, Some(k)),
                [1, 0] | [0, 1] => worst[3].count(place, face, Some(k)),
                [2, 0] | [0, 2] => worst[0].count(place, face, Some(k)),
                _ => worst[1].count(place, face, Some(k)),
            }
        }
    }
    worst
}

/// The triangles of all faces, cut along the knots of their surfaces: those that lie in a face with all corners. Along
/// its loops a strip as wide as one of them is left out.
struct Grids<'a> {
    surfaces: Vec<&'a NurbsSurface>,
    meshes: Vec<Tessellation>,
    /// Face and corners of each triangle.
    triangles: Vec<(usize, [u32; 3])>,
}

impl<'a> Grids<'a> {
    /// The triangles of one surface inside what `keeps` accepts. `tolerance` is chordal, `most` limits their number.
    #[cfg_attr(
        not(feature = "files"),
        allow(dead_code, reason = "the pipeline uses it")
    )]
    fn of_surface(
        surface: &'a NurbsSurface,
        tolerance: f64,
        most: usize,
        keeps: &dyn Fn(DVec2) -> bool,
    ) -> Result<Self> {
        let mesh = tessellate(surface, tolerance, most)?;
        let inside: Vec<bool> = mesh.parameters.iter().map(|&p| keeps(p)).collect();
        let kept = mesh
            .triangles
            .iter()
            .filter(|t| t.iter().all(|&c| inside[c as usize]));
        let triangles = kept.map(|&t| (0, t)).collect();
        Ok(Self {
            surfaces: vec![surface],
            meshes: vec![mesh],
            triangles,
        })
    }

    /// Chordal tolerance as a share of the diagonal, and the largest number of triangles per face.
    fn new(subject: &Subject<'a>, share: f64, most: usize) -> Result<Self> {
        let (mut meshes, mut triangles) = (Vec::new(), Vec::new());
        for (k, face) in subject.model.faces().iter().enumerate() {
            let mesh = tessellate(&face.surface, share * subject.diagonal, most)?;
            let region = subject.regions[k].as_ref().filter(|_| face.trimmed);
            let [(a, b), (c, d)] = face.surface.domain();
            let on_side = |p: DVec2| p.x <= a || p.x >= b || p.y <= c || p.y >= d;
            // The chords of neighbours cross along the edges that they share.
            let alone = subject.model.faces().len() == 1;
            let within =
                |p: DVec2| (alone || !on_side(p)) && region.is_none_or(|region| region.contains(p));
            let inside: Vec<bool> = mesh.parameters.iter().map(|&p| within(p)).collect();
            let kept = mesh
                .triangles
                .iter()
                .filter(|t| t.iter().all(|&c| inside[c as usize]));
            triangles.extend(kept.map(|&t| (k, t)));
            meshes.push(mesh);
        }
        let surfaces = subject.model.faces().iter().map(|f| &f.surface);
        Ok(Self {
            surfaces: surfaces.collect(),
            meshes,
            triangles,
        })
    }

    /// Counts the pairs of triangles without a common point that cross, and tells where these are in (u, v).
    fn overlaps(&self) -> (Worst, Vec<DVec2>) {
        let mut places = Vec::new();
        let corners =
            |&(face, t): &(usize, [u32; 3])| t.map(|k| self.meshes[face].points[k as usize]);
        let triangles: Vec<[DVec3; 3]> = self.triangles.iter().map(corners).collect();
        let bounds = |t: &[DVec3; 3]| [t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2])];
        let boxes: Vec<[DVec3; 2]> = triangles.iter().map(bounds).collect();
        let mut worst = Worst::default();
        Tree::new(&boxes).pairs(|a, b| {
            let ((face, one), (other, two)) = (self.triangles[a], self.triangles[b]);
            let near = face == other && one.iter().any(|k| two.contains(k));
            if !near {
                let place = cross(&triangles[a], &triangles[b]);
                if let Some(place) = place.or_else(|| cross(&triangles[b], &triangles[a])) {
                    worst.count(Some(place), Some(face), None);
                    places.extend([a, b].map(|k| self.middle(k)));
                }
            }
            true
        });
        (worst, places)
    }

    /// The middle of a triangle in (u, v).
    fn middle(&self, k: usize) -> DVec2 {
        let (face, corners) = self.triangles[k];
        let parameters = &self.meshes[face].parameters;
        corners
            .map(|c| parameters[c as usize])
            .iter()
            .sum::<DVec2>()
            / 3.0
    }
}

/// The largest angle by which the normal turns at once inside a face, and where in (u, v) it is over the limit: where it differs by more than the limit between
/// the corners of a triangle, the way between them is halved towards the larger turn.
fn folds(grids: &Grids<'_>) -> (Worst, Vec<DVec2>) {
    let (mut worst, mut places) = (Worst::default(), Vec::new());
    let limit = FOLD.to_radians().cos();
    for &(face, corners) in &grids.triangles {
        let mesh = &grids.meshes[face];
        for s in 0..3 {
            let [a, b] = [corners[s], corners[(s + 1) % 3]].map(|k| k as usize);
            let [n, m] = [a, b].map(|k| mesh.normals[k]);
            if a > b || n == DVec3::ZERO || m == DVec3::ZERO || n.dot(m) >= limit {
                continue;
            }
            let ends = [a, b].map(|k| mesh.parameters[k]);
            let surface = grids.surfaces[face];
            let (angle, place) = turn(surface, ends);
            let point = surface.point(place.x, place.y);
            worst = worst.larger(Worst::at(angle, point, face));
            if angle > FOLD {
                places.push(place);
            }
        }
    }
    (worst, places)
}

/// By how many degrees the normal turns in a short piece between two places, and where.
fn turn(surface: &NurbsSurface, [mut a, mut b]: [DVec2; 2]) -> (f64, DVec2) {
    // Where S_u x S_v is all but nothing, at poles, its direction is that of rounding.
    let least = 1e-7 * scale_of(surface).element_product();
    let normal = |p: DVec2| {
        let d = surface.derivatives(p.x, p.y);
        let normal = d.du.cross(d.dv);
        if normal.length() > least {
            normal.normalize_or_zero()
        } else {
            DVec3::ZERO
        }
    };
    let angle = |n: DVec3, m: DVec3| n.cross(m).length().atan2(n.dot(m));
    let (mut n, mut m) = (normal(a), normal(b));
    if n == DVec3::ZERO || m == DVec3::ZERO {
        return (0.0, a);
    }
    for _ in 0..24 {
        let middle = a.midpoint(b);
        let between = normal(middle);
        if between == DVec3::ZERO {
            break;
        }
        if angle(n, between) >= angle(between, m) {
            (b, m) = (middle, between);
        } else {
            (a, n) = (middle, between);
        }
    }
    (angle(n, m).to_degrees(), a.midpoint(b))
}

/// Where a side of one triangle passes through the inside of another.
///
/// Source: T. Moeller, B. Trumbore, *Fast, minimum storage ray/triangle intersection*, J. Graphics Tools 2, 1997.
fn cross(one: &[DVec3; 3], two: &[DVec3; 3]) -> Option<DVec3> {
    // Touching does not count: shares of the way and of the triangle.
    const INSIDE: f64 = 1e-6;
    let [a, b, c] = *two;
    let (x, y) = (b - a, c - a);
    let normal = x.cross(y);
    for s in 0..3 {
        let (from, to) = (one[s], one[(s + 1) % 3]);
        let way = to - from;
        let height = normal.dot(way);
        // Nearly parallel sides are left to the others.
        if height.abs() <= 1e-12 * normal.length() * way.length() {
            continue;
        }
        let share = normal.dot(a - from) / height;
        if !(share > INSIDE && share < 1.0 - INSIDE) {
            continue;
        }
        let point = from + share * way;
        let square = normal.length_squared();
        let v = x.cross(point - a).dot(normal) / square;
        let u = (point - a).cross(y).dot(normal) / square;
        if u > INSIDE && v > INSIDE && u + v < 1.0 - INSIDE {
            return Some(point);
        }
    }
    None
}

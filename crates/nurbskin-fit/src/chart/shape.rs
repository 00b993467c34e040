//! The topology of a triangle mesh: which of its borders are openings, and which are holes.
//!
//! Genus g and number of openings b give the topology: (0, 0) sphere, (0, 1) disk, (0, 2) tube, (1, 0) torus. A border
//! is judged by its length, by the area of its plane projection and by its slope, the mean of |n · m| for normals n of
//! the surface around it and the normal m of its plane: small or level borders are holes, long upright ones openings.
//! Doubtful borders lead to several readings, the most likely first, which [`charting`](crate::charting) compares.
//!
//! Source: ours; the thresholds are found by trial.

use super::Topology;
use glam::DVec3;
use nurbskin_geometry::unit::counted;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::mesh::Manifold;
use nurbskin_scan::mesh::manifold::NONE;
use std::f64::consts::PI;

/// Length of a border, as a share of the longest one, below which it is a hole: a branch so thin would end in a point.
/// Trial: not recorded.
const MIN_OPENING_LENGTH: f64 = 0.1;
/// Area within a border, as a share of the surface's, below which it is a hole whatever it looks like. Trial: not
/// recorded.
const MIN_OPENING_AREA: f64 = 0.0005;
/// Area within a border, as a share of the surface's, below which it is a hole if the surface around it lies in its
/// plane: scans miss such patches where light does not reach. Trial: not recorded.
const MAX_LEVEL_HOLE: f64 = 0.02;
/// Mean of |n · m|, for normals n of the surface around a border and the normal m of the border's plane, above which
/// the surface goes on across the border (45 degrees). Trial: not recorded.
const LEVEL_COSINE: f64 = 0.7;
/// The same mean below which a tube ends at the border (60 degrees and more). Trial: not recorded.
const UPRIGHT_COSINE: f64 = 0.5;
/// Length of a second border, as a share of the longest one, below which it makes no tube if the surface is level
/// around it. Trial: not recorded; 0.1 in an earlier version.
const COMPARABLE_LENGTH: f64 = 0.35;
/// Length of a border, as a share of the longest one, below which a border around little area may be no end of a tube
/// where another is around much. Trial: not recorded.
const SIMILAR_LENGTH: f64 = 0.5;
/// Length of the mean normal above which a surface is a sheet, whose longest border surrounds the others: 1 if it is
/// flat, 0 for a tube or a closed surface. Derived: it is 1/2 for a hemisphere, the disc over the half sphere.
const SHEET_MEAN_NORMAL: f64 = 0.5;
/// Area within a single opening, as a share of the surface's, below which the shape counts as closed: its chart is
/// better made from poles than from so small a rim. Trial: not recorded; 0.02 in an earlier version.
const CLOSED_OPENING: f64 = 0.01;
/// The same for a surface without handles that is level around an opening that is no slit. Trial: not recorded.
const CLOSED_LEVEL_OPENING: f64 = 0.04;
/// Least compactness 4π A/L² of a border that is no slit. Trial: it is 1 for a circle, 0.5 and less for ragged borders
/// of gaps that run together, and 0.02 for a slit along a tube, whose area does not show the tube's ends.
const MIN_COMPACTNESS: f64 = 0.1;
/// Area within a border, as a share of the surface's, above which it is no hole of a surface that is no sheet: a patch
/// over it would be made up, not bridged. Trial: not recorded. A smaller share opens closed shapes at gaps of the scan.
const MAX_BRIDGED_AREA: f64 = 0.05;
/// The same limit where the surface is level around a border about as long as the longest one. Trial: not recorded; a
/// few per cent.
const MAX_LEVEL_BRIDGE: f64 = 0.03;
/// Most readings that are compared. Guard: each is laid out and fitted.
const MAX_READINGS: usize = 4;
/// Rings of triangles that count as the surface around a border. Trial: not recorded. One ring follows the teeth of the
/// border, many look past the bend of a tube's end.
const BORDER_RINGS: usize = 3;

/// The topology of a surface, with its openings and holes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshShape {
    /// The domain.
    pub topology: Topology,
    /// Borders (by number in [`Manifold::loops`]) where the domain ends, longest first: one for a disk, two for a tube.
    pub openings: Vec<usize>,
    /// Borders that are holes in the domain and are to be filled.
    pub holes: Vec<usize>,
    /// Why, for the user.
    pub reason: String,
}

/// Measures of a border. `length` is absolute, `area` a share of the surface's, `level` the mean of |n · m|.
#[derive(Clone, Copy, Debug)]
struct Border {
    length: f64,
    area: f64,
    level: f64,
}

/// The role of a border in the domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// The domain ends there.
    Opening,
    /// To be filled.
    Hole,
    /// It may be either.
    Doubtful,
}

/// Tells openings from holes and finds the topology of the surface; with `asked`, tests whether the surface has that
/// one. It is the first of several [readings](readings_of).
///
/// # Errors
/// As [`readings_of`].
pub fn shape_of(manifold: &Manifold, asked: Option<Topology>) -> Result<MeshShape> {
    let mut readings = readings_of(manifold, asked)?;
    Ok(readings.swap_remove(0))
}

/// The topologies that a surface may have, at least one, the most likely first; with `asked`, that one.
///
/// A border is a hole if it is tiny, short against the longest one, or small and level. In a sheet, every level border
/// within the longest one is a hole. The longest border of a sheet is an opening, as is a border at which the surface
/// ends upright, like a tube, and a border around more than 5 % of the area of a surface that is no sheet. A surface is
/// a sphere if its only opening is around less than 1 % of its area, or around less than 4 %, level and no slit (with a
/// handle it is a torus, up to 1 %). All other borders are doubtful: nostrils end upright within a face, and so does a
/// pipe within its flange. Each choice of them that leaves at most two openings is a reading. O(n log n).
///
/// # Errors
/// [`Error::Unsupported`] for a surface with none of the four topologies, or not the one that was asked for: with
/// handles, or with three or more openings. The message gives their number and what to do.
pub fn readings_of(manifold: &Manifold, asked: Option<Topology>) -> Result<Vec<MeshShape>> {
    let borders = borders(manifold);
    if let Some(asked) = asked {
        let openings = wanted(asked, &borders)?;
        return Ok(vec![reading(manifold, &borders, openings, Some(asked))?]);
    }
    let mut found = Vec::new();
    let mut refusal = None;
    let roles = roles(manifold, &borders);
    let ends = roles.iter().filter(|role| **role != Role::Hole).count();
    for openings in choices(&roles) {
        let branches_off = openings.len() > 2 && manifold.genus() == 0;
        match reading(manifold, &borders, openings, None) {
            Ok(shape) => found.push(shape),
            // The message counts all borders that may be openings.
            Err(_) if branches_off => refusal = refusal.or(Some(branches(ends))),
            Err(why) => refusal = refusal.or(Some(why)),
        }
    }
    match refusal {
        Some(why) if found.is_empty() => Err(why),
        _ => Ok(found),
    }
}

/// The borders (by number in [`Manifold::loops`]) that are holes for certain: tiny ones, short ones against the longest,
/// and level ones, as for [`readings_of`]. All others may be openings. O(n log n).
#[must_use]
pub fn holes_of(manifold: &Manifold) -> Vec<usize> {
    let roles = roles(manifold, &borders(manifold));
    (0..roles.len())
        .filter(|&k| roles[k] == Role::Hole)
        .collect()
}

/// The topology of the surface if these borders are openings and the others holes.
fn reading(
    manifold: &Manifold,
    borders: &[Border],
    mut openings: Vec<usize>,
    asked: Option<Topology>,
) -> Result<MeshShape> {
    let genus = manifold.genus();
    openings.sort_unstable();
    let found = match (genus, openings.len()) {
        (0, 0) => Topology::Sphere,
        (0, 1) => Topology::Disk,
        (0, 2) => Topology::Tube,
        (1, 0) => Topology::Torus,
        (0, count) => return Err(branches(count)),
        (genus, count) => return Err(handles(genus, count)),
    };
    if let Some(asked) = asked.filter(|&a| a != found) {
        return Err(Error::Unsupported(format!(
            "the mesh cannot be charted as a {}: it is {}; ask for a {} or leave the choice to the program",
            asked.name(),
            described(genus, borders.len()),
            found.name(),
        )));
    }
    let holes: Vec<usize> = (0..borders.len())
        .filter(|k| !openings.contains(k))
        .collect();
    Ok(MeshShape {
        topology: found,
        reason: reason(found, holes.len(), asked.is_some()),
        openings,
        holes,
    })
}

/// The openings of a topology that was asked for: the longest borders.
fn wanted(topology: Topology, borders: &[Border]) -> Result<Vec<usize>> {
    let count = match topology {
        Topology::Disk => 1,
        Topology::Tube => 2,
        Topology::Sphere | Topology::Torus => 0,
    };
    if borders.len() < count {
        return Err(Error::Unsupported(format!(
            "the mesh cannot be charted as a {}: that takes {}, and it has {}; leave the choice to the program",
            topology.name(),
            counted(count, "border", "borders"),
            match borders.len() {
                0 => "none".to_owned(),
                n => format!("only {n}"),
            }
        )));
    }
    Ok((0..count).collect())
}

/// The role of each border.
fn roles(manifold: &Manifold, borders: &[Border]) -> Vec<Role> {
    let Some(longest) = borders.first().map(|b| b.length) else {
        return Vec::new();
    };
    let mean: DVec3 = (0..manifold.triangles.len())
        .map(|t| manifold.vector_area(t))
        .sum();
    let sheet = mean.length() > SHEET_MEAN_NORMAL * manifold.area();
    let bare = borders.iter().any(|b| b.area > MAX_BRIDGED_AREA);
    let role = |(k, b): (usize, &Border)| {
        let comparable = b.length >= COMPARABLE_LENGTH * longest;
        // A sheet ends at its longest border.
        if sheet && k == 0 && b.area >= MIN_OPENING_AREA {
            return Role::Opening;
        }
        if b.area < MIN_OPENING_AREA || b.length < MIN_OPENING_LENGTH * longest {
            return Role::Hole;
        }
        if b.area < MAX_LEVEL_HOLE && b.level > UPRIGHT_COSINE {
            // The slanted end of a long pipe encloses as little area.
            let slanted = !sheet && comparable && b.level < LEVEL_COSINE;
            return if slanted { Role::Doubtful } else { Role::Hole };
        }
        match (sheet, b.level > LEVEL_COSINE) {
            // Borders within the longest border of a sheet are windows and shadows, unless a wide pipe ends there.
            (true, false) if b.area > MAX_BRIDGED_AREA => Role::Doubtful,
            (true, _) => Role::Hole,
            (false, _) if b.area > MAX_BRIDGED_AREA => Role::Opening,
            (false, true) if k > 0 && !comparable => Role::Hole,
            (false, true) if b.area > MAX_LEVEL_BRIDGE && b.length >= SIMILAR_LENGTH * longest => {
                Role::Opening
            }
            (false, false) if comparable && (!bare || b.length >= SIMILAR_LENGTH * longest) => {
                Role::Opening
            }
            (false, _) => Role::Doubtful,
        }
    };
    let mut roles: Vec<Role> = borders.iter().enumerate().map(role).collect();
    let count = |roles: &[Role]| roles.iter().filter(|r| **r == Role::Opening).count();
    // If there are too many openings, level ones are places that the scanner did not see, ...
    if count(&roles) > 2 {
        for (role, b) in roles.iter_mut().zip(borders) {
            if *role == Role::Opening && b.level > LEVEL_COSINE {
                *role = Role::Hole;
            }
        }
    }
    // ... and nostrils are small compared with the border of a face.
    if count(&roles) > 2 && bare {
        for (role, b) in roles.iter_mut().zip(borders) {
            if *role == Role::Opening && b.area <= MAX_BRIDGED_AREA {
                *role = Role::Doubtful;
            }
        }
    }
    // Several pipes hardly end in one sheet: such borders are shadows.
    if sheet && roles.iter().filter(|r| **r == Role::Doubtful).count() > 1 {
        for role in roles.iter_mut().filter(|r| **r == Role::Doubtful) {
            *role = Role::Hole;
        }
    }
    // A single opening that is small compared with the surface leaves the surface closed.
    let left: Vec<usize> = (0..roles.len())
        .filter(|&k| roles[k] != Role::Hole)
        .collect();
    if let ([only], false) = (&left[..], sheet) {
        let b = &borders[*only];
        let round = 4.0 * PI * b.area * manifold.area() > MIN_COMPACTNESS * b.length * b.length;
        let gap = round && manifold.genus() == 0;
        roles[*only] = if b.area < CLOSED_OPENING
            || b.area < CLOSED_LEVEL_OPENING && b.level > LEVEL_COSINE && gap
        {
            Role::Hole
        } else if b.area <= MAX_BRIDGED_AREA && b.level > UPRIGHT_COSINE && gap {
            Role::Doubtful
        } else {
            Role::Opening
        };
    }
    roles
}

/// Every choice of openings, the most likely first: the certain ones alone, then with one or two doubtful ones. If none
/// is certain and at most two are doubtful, all of them come first.
fn choices(roles: &[Role]) -> Vec<Vec<usize>> {
    let of =
        |role: Role| -> Vec<usize> { (0..roles.len()).filter(|&k| roles[k] == role).collect() };
    let (certain, doubtful) = (of(Role::Opening), of(Role::Doubtful));
    let all = [&certain[..], &doubtful].concat();
    let mut choices = Vec::new();
    if certain.is_empty() && all.len() <= 2 {
        choices.push(all);
    }
    let with = |more: &[usize]| [&certain[..], more].concat();
    choices.push(certain.clone());
    choices.extend(doubtful.iter().map(|&k| with(&[k])));
    for (i, &k) in doubtful.iter().enumerate() {
        choices.extend(doubtful[i + 1..].iter().map(|&j| with(&[k, j])));
    }
    let mut distinct: Vec<Vec<usize>> = Vec::new();
    for choice in choices {
        let possible = choice.len() <= 2 || choice.len() == certain.len();
        if possible && !distinct.contains(&choice) {
            distinct.push(choice);
        }
    }
    distinct.truncate(MAX_READINGS);
    distinct
}

/// Length, area and slope of all borders.
fn borders(manifold: &Manifold) -> Vec<Border> {
    let area = manifold.area().max(f64::MIN_POSITIVE);
    let adjacency = manifold.adjacency();
    let mut near = vec![NONE; manifold.triangles.len()];
    let numbered = (0_u32..).zip(&manifold.loops);
    numbered
        .map(|(k, vertices)| {
            let place = |v: u32| manifold.points[v as usize];
            let origin = vertices.first().map_or(DVec3::ZERO, |&v| place(v));
            let steps = vertices.iter().zip(vertices.iter().cycle().skip(1));
            let plane: DVec3 = steps
                .map(|(&a, &b)| 0.5 * (place(a) - origin).cross(place(b) - origin))
                .sum();
            let normal = plane.normalize_or_zero();
            // The triangles around the border, ring by ring.
            let mut ring: Vec<usize> = Vec::new();
            let mut add = |t: usize, ring: &mut Vec<usize>| {
                if near[t] != k {
                    near[t] = k;
                    ring.push(t);
                }
            };
            for &v in vertices {
                adjacency
                    .fan(v)
                    .for_each(|side| add(side as usize / 3, &mut ring));
            }
            let mut from = 0;
            for _ in 1..BORDER_RINGS {
                let to = ring.len();
                for i in from..to {
                    for other in adjacency.neighbours(ring[i]) {
                        if other != NONE {
                            add(other as usize, &mut ring);
                        }
                    }
                }
                from = to;
            }
            let around = ring.iter().map(|&t| manifold.vector_area(t));
            let (level, total) = around.fold((0.0, 0.0), |(level, total), n| {
                (level + n.dot(normal).abs(), total + n.length())
            });
            Border {
                length: manifold.border_length(k as usize),
                area: plane.length() / area,
                level: level / f64::max(total, f64::MIN_POSITIVE),
            }
        })
        .collect()
}

fn branches(count: usize) -> Error {
    Error::Unsupported(format!(
        "the mesh branches: it has {count} openings of comparable size; one surface has at most two, so cut it into \
         tubes and fit each"
    ))
}

fn handles(genus: usize, openings: usize) -> Error {
    let handles = counted(genus, "handle", "handles");
    let openings = match openings {
        0 => String::new(),
        n => format!(" and {}", counted(n, "opening", "openings")),
    };
    Error::Unsupported(format!(
        "the mesh has {handles} (genus {genus}){openings}; one surface is a disk, a tube, a sphere or a torus: cut the \
         {} off and fit the rest",
        if genus == 1 { "handle" } else { "handles" }
    ))
}

/// A description of a surface by its genus and its number of borders.
fn described(genus: usize, borders: usize) -> String {
    let borders = match borders {
        0 => "closed".to_owned(),
        n => format!("a surface with {}", counted(n, "border", "borders")),
    };
    match genus {
        0 => format!("{borders} and without handles"),
        n => format!(
            "{borders} and with {} (genus {n})",
            counted(n, "handle", "handles")
        ),
    }
}

/// A description of the choice, for the user.
fn reason(topology: Topology, holes: usize, asked: bool) -> String {
    let what = match topology {
        Topology::Disk => "disk: an open sheet with one border",
        Topology::Tube => "tube: open at two ends",
        Topology::Torus => "torus: closed, with one handle",
        Topology::Sphere if holes == 0 => "sphere: closed, without handles",
        Topology::Sphere => "sphere: closed but for holes",
    };
    let why = if asked { ", as asked" } else { "" };
    match holes {
        0 => format!("{what}{why}"),
        n => format!("{what}{why}; {}", counted(n, "hole in it", "holes in it")),
    }
}

#[cfg(test)]
mod tests;

//! Which shape of domain a surface has: which of its borders are openings, and which are holes.

use super::Topology;
use glam::DVec3;
use nurbskin_geometry::unit::counted;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::mesh::Manifold;
use nurbskin_scan::mesh::manifold::NONE;
use std::f64::consts::PI;

/// A border with less than this part of the longest one's length is a hole: a branch so thin would end in a point.
const THIN: f64 = 0.1;
/// A border around less than this part of the area is a hole, whatever it looks like.
const TINY: f64 = 0.0005;
/// A border around less than this part of the area is a hole if the surface around it lies in its plane: scans miss
/// such patches where light does not reach.
const SMALL: f64 = 0.02;
/// Mean of |n . m| for normals n of the surface around a border and m of the border's own plane, above which the
/// surface goes on across the border (up to 45 degrees), and a tube below which it ends there (60 degrees and more).
const LEVEL: f64 = 0.7;
const UPRIGHT: f64 = 0.5;
/// A second border of less than this part of the longest one's length does not make a tube if the surface is level
/// around it.
const COMPARABLE: f64 = 0.35;
/// ... and one of less than this part, around little area, may be no end of a tube where the longest is around much.
const ALIKE: f64 = 0.5;
/// Length of the mean normal of a sheet: 1 if it is flat, 0.5 for a hemisphere, 0 for a tube or a closed surface. Above
/// it, the longest border surrounds the others.
const SHEET: f64 = 0.5;
/// A single opening around less than this part of the area leaves a closed shape: its chart is better made from poles
/// than from so small a rim. ...
const CLOSED: f64 = 0.01;
/// ... If it has no handles and is level around the opening, less than this part, ...
const CLOSED_IF_LEVEL: f64 = 0.04;
/// ... if that is no slit: 4 pi area over length squared is 1 for a circle, .5 and less for ragged borders of gaps that run
/// together, and .02 for a slit along a tube, the ends of which do not show in its area.
const COMPACT: f64 = 0.1;
/// A border around more than this part of the area is no hole of a surface that is no sheet: a patch over it would be made
/// up, not bridged.
const BRIDGED: f64 = 0.05;
/// The same where the surface is level around a border that is about as long as the longest one: a few per cent.
const MADE_UP: f64 = 0.03;
/// Most readings that are weighed against each other.
const MOST_READINGS: usize = 4;
/// Triangles within so many steps of a border count as around it.
const RINGS: usize = 3;

/// What a surface is, for its chart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshShape {
    /// The domain.
    pub topology: Topology,
    /// Borders (by number in [`Manifold::loops`]) where the domain ends, longest first: one for a disk, two for a tube.
    pub openings: Vec<usize>,
    /// Borders that are holes in the domain, to be filled.
    pub holes: Vec<usize>,
    /// Why, for the user.
    pub reason: String,
}

/// A border, as seen from the surface. Areas are parts of the surface's.
#[derive(Clone, Copy, Debug)]
struct Border {
    length: f64,
    area: f64,
    level: f64,
}

/// What a border is to the domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// The domain ends there.
    Opening,
    /// To be filled.
    Hole,
    /// It may be either.
    Doubtful,
}

/// Tells openings from holes, and says which of disk, tube, sphere and torus the surface is; with `asked`, whether it can
/// be that one. Of several [readings](readings_of) the first.
///
/// # Errors
/// As [`readings_of`].
pub fn shape_of(manifold: &Manifold, asked: Option<Topology>) -> Result<MeshShape> {
    let mut readings = readings_of(manifold, asked)?;
    Ok(readings.swap_remove(0))
}

/// The domains that a surface may have, at least one, the most likely first; with `asked`, that one.
///
/// A border is a hole if it is tiny or thin against the longest one, or small in a surface that lies level around it; in
/// a sheet, whatever lies level within the longest border is. The longest border of a sheet is an opening, as is what ends
/// upright at a border, like a tube, or surrounds more than 5 % of the area of what is no sheet.
/// A surface that is closed but for an opening around less than 1 % of its area, or for a gap around less than 4 % that
/// is no slit and in which it would go on level, is a sphere (or a torus, if it has a handle, up to 1 %). Whatever is
/// neither is doubtful: nostrils end upright within a face, and so does a pipe within its flange. Then there is a
/// reading for each choice that leaves a domain with two openings at most. O(n log n).
///
/// # Errors
/// [`Error::Unsupported`] for what is none of the four, or not what was asked: handles, and three or more openings, with
/// their number and what to do.
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
            // All that may be an end is named.
            Err(_) if branches_off => refusal = refusal.or(Some(branches(ends))),
            Err(why) => refusal = refusal.or(Some(why)),
        }
    }
    match refusal {
        Some(why) if found.is_empty() => Err(why),
        _ => Ok(found),
    }
}

/// The surface with these openings, its other borders being holes.
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

/// The borders that a domain asked for needs: the longest.
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

/// What each border is to the domain.
fn roles(manifold: &Manifold, borders: &[Border]) -> Vec<Role> {
    let Some(longest) = borders.first().map(|b| b.length) else {
        return Vec::new();
    };
    let mean: DVec3 = (0..manifold.triangles.len())
        .map(|t| manifold.vector_area(t))
        .sum();
    let sheet = mean.length() > SHEET * manifold.area();
    let bare = borders.iter().any(|b| b.area > BRIDGED);
    let role = |(k, b): (usize, &Border)| {
        let comparable = b.length >= COMPARABLE * longest;
        // A sheet ends at its longest border.
        if sheet && k == 0 && b.area >= TINY {
            return Role::Opening;
        }
        if b.area < TINY || b.length < THIN * longest {
            return Role::Hole;
        }
        if b.area < SMALL && b.level > UPRIGHT {
            // The slanted end of a long pipe is as small.
            let slanted = !sheet && comparable && b.level < LEVEL;
            return if slanted { Role::Doubtful } else { Role::Hole };
        }
        match (sheet, b.level > LEVEL) {
            // Seen from one side, what lies within the longest border are windows and shadows, unless a wide pipe ends there.
            (true, false) if b.area > BRIDGED => Role::Doubtful,
            (true, _) => Role::Hole,
            (false, _) if b.area > BRIDGED => Role::Opening,
            (false, true) if k > 0 && !comparable => Role::Hole,
            (false, true) if b.area > MADE_UP && b.length >= ALIKE * longest => Role::Opening,
            (false, false) if comparable && (!bare || b.length >= ALIKE * longest) => Role::Opening,
            (false, _) => Role::Doubtful,
        }
    };
    let mut roles: Vec<Role> = borders.iter().enumerate().map(role).collect();
    let count = |roles: &[Role]| roles.iter().filter(|r| **r == Role::Opening).count();
    // Of too many, those that the surface goes on across are places that the scanner did not see, ...
    if count(&roles) > 2 {
        for (role, b) in roles.iter_mut().zip(borders) {
            if *role == Role::Opening && b.level > LEVEL {
                *role = Role::Hole;
            }
        }
    }
    // ... and nostrils are small beside the border of a face.
    if count(&roles) > 2 && bare {
        for (role, b) in roles.iter_mut().zip(borders) {
            if *role == Role::Opening && b.area <= BRIDGED {
                *role = Role::Doubtful;
            }
        }
    }
    // Several pipes do not end in one sheet: they are shadows.
    if sheet && roles.iter().filter(|r| **r == Role::Doubtful).count() > 1 {
        for role in roles.iter_mut().filter(|r| **r == Role::Doubtful) {
            *role = Role::Hole;
        }
    }
    // A single one that is small against the surface leaves it closed.
    let left: Vec<usize> = (0..roles.len())
        .filter(|&k| roles[k] != Role::Hole)
        .collect();
    if let ([only], false) = (&left[..], sheet) {
        let b = &borders[*only];
        let round = 4.0 * PI * b.area * manifold.area() > COMPACT * b.length * b.length;
        let gap = round && manifold.genus() == 0;
        roles[*only] = if b.area < CLOSED || b.area < CLOSED_IF_LEVEL && b.level > LEVEL && gap {
            Role::Hole
        } else if b.area <= BRIDGED && b.level > UPRIGHT && gap {
            Role::Doubtful
        } else {
            Role::Opening
        };
    }
    roles
}

/// Every choice of openings, the most likely first: those that are certain, then these with one or two of the doubtful ones;
/// where none is certain, first both of two that may be.
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
    distinct.truncate(MOST_READINGS);
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
            // Triangles around, ring by ring.
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
            for _ in 1..RINGS {
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

/// What a surface is by its counts.
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

/// A sentence on the choice.
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

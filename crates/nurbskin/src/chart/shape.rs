//! Which shape of domain a surface has: which of its borders are openings, and which are holes.

use super::Topology;
use crate::mesh::Manifold;
use crate::mesh::manifold::NONE;
use crate::unit::counted;
use crate::{Error, Result};
use glam::DVec3;
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
/// A border around more than this part of the area is no hole of a surface that is no sheet, whose longest border is not
/// left open: a patch over it would be made up, not bridged.
const BRIDGED: f64 = 0.05;
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

/// Tells openings from holes, and says which of disk, tube, sphere and torus the surface is; with `asked`, whether it can
/// be that one.
///
/// A border is a hole if it is tiny or thin against the longest one, or small in a surface that lies level around it; in
/// a sheet, whatever lies within the longest border is. What ends upright at a border, like a tube, has an opening there;
/// so has what is no sheet at a border around more than 5 % of the area, and then smaller ones are holes.
/// A surface that is closed but for an opening around less than 1 % of its area, or for a gap around less than 4 % that
/// is no slit and in which it would go on level, is a sphere (or a torus, if it has a handle, up to 1 %). O(n log n).
///
/// # Errors
/// [`Error::Unsupported`] for what is none of the four, or not what was asked: handles, and three or more openings, with
/// their number and what to do.
pub fn shape_of(manifold: &Manifold, asked: Option<Topology>) -> Result<MeshShape> {
    let genus = manifold.genus();
    let borders = borders(manifold);
    let mut openings = match asked {
        None => openings_of(manifold, &borders),
        Some(topology) => wanted(topology, &borders)?,
    };
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

/// The borders that are openings.
fn openings_of(manifold: &Manifold, borders: &[Border]) -> Vec<usize> {
    let Some(longest) = borders.first().map(|b| b.length) else {
        return Vec::new();
    };
    // 1. A sheet ends at its longest border.
    let mean: DVec3 = (0..manifold.triangles.len())
        .map(|t| manifold.vector_area(t))
        .sum();
    let sheet = mean.length() > SHEET * manifold.area();
    let first = &borders[0];
    let open = |k: &usize| {
        let b = &borders[*k];
        let small = b.area < TINY || b.length < THIN * longest;
        let patch = b.area < SMALL && b.level > UPRIGHT;
        let inside = b.level > LEVEL && *k > 0 && (sheet || b.length < COMPARABLE * longest);
        !(small || patch || inside)
    };
    let mut openings: Vec<usize> = (0..borders.len()).filter(open).collect();
    if sheet && !openings.contains(&0) && first.area >= TINY {
        openings.push(0);
    }
    // 2. Of too many, those that the surface goes on across are places that the scanner did not see.
    if openings.len() > 2 {
        openings.retain(|&k| borders[k].level < LEVEL);
    }
    if openings.len() > 2 && sheet {
        // Seen from one side, what lies within the longest are shadows.
        openings = vec![0];
    }
    // 3. What cannot be bridged is open, and then what can be is a hole.
    if !sheet {
        let bare = |k: &usize| borders[*k].area > BRIDGED;
        let bare: Vec<usize> = (0..borders.len()).filter(bare).collect();
        let filled = bare.iter().any(|k| !openings.contains(k));
        if filled {
            let more = bare.iter().copied().filter(|k| !openings.contains(k));
            let more: Vec<usize> = more.collect();
            openings.extend(more);
            if openings.len() > 2 {
                openings = bare;
            }
        }
    }
    // 4. One that is small against the surface leaves it closed.
    if let [only] = openings[..] {
        let b = &borders[only];
        let round = 4.0 * PI * b.area * manifold.area() > COMPACT * b.length * b.length;
        let gap = b.area < CLOSED_IF_LEVEL && b.level > LEVEL && round && manifold.genus() == 0;
        if !sheet && (b.area < CLOSED || gap) {
            openings.clear();
        }
    }
    openings
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
#[path = "shape_tests.rs"]
mod tests;

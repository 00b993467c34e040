//! Faces: bare surfaces (entity 128), and trimmed ones (144) with curves on a surface (142) as their borders.

use super::{Entities, SURFACE_LEVEL};
use crate::io::iges::curve;
use crate::io::iges::directory::DirectoryEntry;
use crate::io::iges::global::hollerith;
use crate::io::iges::surface;
use crate::{Face, Loop, Model};
use nurbskin_geometry::Result;
use nurbskin_geometry::nurbs::NurbsCurve;

/// Status of what belongs to one other entity (subordinate 01): in space, or in a parameter plane (use 05).
pub(super) const PART: &str = "00010000";
pub(super) const PARAMETRIC: &str = "00010500";
/// Status of a property: it belongs to its entity, and is no geometry (use 03).
const PROPERTY: &str = "00010300";
/// Preference of a curve on a surface: both its curves are equally good.
const BOTH_CURVES: usize = 3;

/// Puts a face, the `k`-th of the file, and what it consists of before it.
///
/// # Errors
/// As `write`.
pub(super) fn push(
    entities: &mut Entities,
    model: &Model,
    face: &Face,
    colour: i64,
    k: usize,
) -> Result<()> {
    let mut properties = Vec::new();
    if !face.name.is_empty() {
        properties.push(entities.name(&face.name)?);
    }
    // A trimmed surface has no sense of its own: seen from outside, u and v must turn counter-clockwise.
    let turned = face.reversed.then(|| face.surface.transposed());
    let whole = turned.as_ref().unwrap_or(&face.surface);
    let entry = |entity, status: &str, label: &str| DirectoryEntry {
        entity,
        level: SURFACE_LEVEL,
        status: status.into(),
        label: label.into(),
        subscript: i64::try_from(k).unwrap_or(0) + 1,
        ..Default::default()
    };
    let visible = |entry| DirectoryEntry { colour, ..entry };
    let (spelling, origin, resolution) = (entities.spelling, entities.origin, entities.resolution);
    let trimmed = face.trimmed && !face.loops.is_empty();
    let (status, own): (&str, &[usize]) = if trimmed {
        (PART, &[])
    } else {
        ("", properties.as_slice())
    };
    let basis = entities.add(visible(entry(128, status, "SURFACE")), |section| {
        surface::push(section, whole, spelling, origin, resolution, own)
    })?;
    if !trimmed {
        return Ok(());
    }
    let mut bounds = Vec::with_capacity(face.loops.len());
    for each in &face.loops {
        let (flat, space) = curves(model, each, face.reversed)?;
        let flat = path(entities, &flat, true, &entry)?;
        let space = path(entities, &space, false, &entry)?;
        // How it was made: not told. The surface, the curve in its plane, the one in space, and which is the better.
        let numbers = [142, 0, basis, flat, space, BOTH_CURVES];
        bounds.push(entities.list(entry(142, PART, "BORDER"), &numbers)?);
    }
    // N1 = 1: the outer border is not that of the domain.
    let holes = bounds.len() - 1;
    let mut numbers = vec![144, basis, 1, holes];
    numbers.extend(bounds);
    if !properties.is_empty() {
        numbers.extend([0, properties.len()]);
        numbers.extend(properties);
    }
    entities.list(visible(entry(144, "", "FACE")), &numbers)?;
    Ok(())
}

/// The curves of a loop one after the other, in the parameter plane and in space, running as the loop does. A
/// degenerate edge has none in space.
fn curves(model: &Model, each: &Loop, turned: bool) -> Result<(Vec<NurbsCurve>, Vec<NurbsCurve>)> {
    let (mut flat, mut space) = (Vec::new(), Vec::new());
    let run = |curve: &NurbsCurve, backwards: bool| {
        if backwards {
            curve.reversed()
        } else {
            Ok(curve.clone())
        }
    };
    let mut uses: Vec<_> = each.uses.iter().collect();
    if turned {
        uses.reverse();
    }
    for used in uses {
        let backwards = used.reversed != turned;
        let mut pcurve = run(&used.pcurve, backwards)?;
        if turned {
            pcurve = pcurve.map_points(|p| nurbskin_geometry::DVec3::new(p.y, p.x, p.z))?;
        }
        flat.push(pcurve);
        if let Some(curve) = &model.edges()[used.edge].curve {
            space.push(run(curve, backwards)?);
        }
    }
    Ok((flat, space))
}

/// Puts these curves, as a composite curve (102) where they are several, and tells the directory entry; 0 for none.
fn path(
    entities: &mut Entities,
    curves: &[NurbsCurve],
    parametric: bool,
    entry: &impl Fn(u32, &str, &str) -> DirectoryEntry,
) -> Result<usize> {
    let (status, label) = if parametric {
        (PARAMETRIC, "PCURVE")
    } else {
        (PART, "CURVE")
    };
    let origin = if parametric {
        nurbskin_geometry::DVec3::ZERO
    } else {
        entities.origin
    };
    let resolution = entities.resolution;
    let mut parts = Vec::with_capacity(curves.len());
    for each in curves {
        parts.push(entities.add(entry(126, status, label), |section| {
            curve::push(section, each, origin, resolution, parametric)
        })?);
    }
    match parts[..] {
        [] => Ok(0),
        [only] => Ok(only),
        _ => {
            let mut numbers = vec![102, parts.len()];
            numbers.extend(parts);
            entities.list(entry(102, status, label), &numbers)
        }
    }
}

impl Entities {
    /// Puts a name (property 406 of form 15), and tells its directory entry.
    pub(super) fn name(&mut self, name: &str) -> Result<usize> {
        let entry = DirectoryEntry {
            entity: 406,
            form: 15,
            status: PROPERTY.into(),
            label: "NAME".into(),
            ..Default::default()
        };
        self.add(entry, |section| {
            section.token("406,");
            section.token("1,");
            section.token(&format!("{};", hollerith(name)));
            Ok(())
        })
    }
    /// Puts an entity of whole numbers, its type first, and tells its directory entry.
    pub(super) fn list(&mut self, entry: DirectoryEntry, numbers: &[usize]) -> Result<usize> {
        self.add(entry, |section| {
            for (k, number) in numbers.iter().enumerate() {
                let delimiter = if k + 1 == numbers.len() { ';' } else { ',' };
                section.token(&format!("{number}{delimiter}"));
            }
            Ok(())
        })
    }
}

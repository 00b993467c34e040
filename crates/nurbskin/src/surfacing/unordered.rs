//! Clouds, meshes and range images: cleaned, split into connected components, and a surface for each of them.
//!
//! 1. Clean: remove outliers and duplicates, estimate noise and spacing; refuse points that fill a volume.
//! 2. Split into connected components; those below a tenth of the largest one are left out (a hundredth in a scene), as long as they
//!    have few of the points.
//! 3. Fit each component (`part`); loose pieces of its mesh that the surface does not cover join the queue.
//!
//! Ours.

use super::solid::fills_a_volume;
use super::{Surfaces, SurfacingOptions, Tolerance, part};
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::{counted, grouped, percent};
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::clean::{CleanOptions, CleanScan, clean};
use nurbskin_scan::mesh::range_grid::triangles_of_grid;
use nurbskin_scan::mesh::scene::cut_at_feet;
use nurbskin_scan::{Organisation, Reason, Rejected, Scan};
use std::collections::VecDeque;

/// Points of a part, as a share of those of the largest part, below which it gets no surface.
/// Trial: not recorded.
const SCRAP_SHARE: f64 = 0.1;
/// The same share in a scene.
/// Trial: not recorded. It is smaller, since a table has far more points than what stands on it.
const SCENE_SCRAP_SHARE: f64 = 0.01;
/// Most parts that get a surface of their own. Count.
/// Guard: bounds the time; a scan of more is a scene to be cut up first.
const MAX_PARTS: usize = 64;

/// Fits a surface to each part of a scan that has no order, or more holes than an order can have.
pub(super) fn fit(
    scan: &Scan,
    options: &SurfacingOptions,
    progress: &dyn Progress,
) -> Result<Surfaces> {
    // 1. The points that count.
    progress.stage("clean", Some(scan.points.len() as u64));
    // The cells of a range image are a mesh, cut at steps in depth; rows without a grid are taken as a cloud.
    let mut objects = 0;
    let instead = match &scan.organisation {
        Organisation::Grid(layout) => {
            let mut triangles = triangles_of_grid(&scan.points, layout);
            let cut = |place| cut_at_feet(&scan.points, layout, &triangles, place);
            if let Some(scene) = scan.seen_from(0).and_then(cut) {
                (objects, triangles) = (scene.objects, scene.triangles);
            }
            Some(Organisation::Mesh(triangles))
        }
        Organisation::Rows(_) => Some(Organisation::Unordered),
        Organisation::Mesh(_) | Organisation::Unordered => None,
    };
    let other = instead.map(|organisation| Scan {
        organisation,
        ..scan.clone()
    });
    // A mesh has most outliers removed; the cells of a range image have them at every step in depth.
    let vertices =
        matches!(&scan.organisation, Organisation::Mesh(triangles) if !triangles.is_empty());
    let scan = other.as_ref().unwrap_or(scan);
    let mut cleaned = clean(scan, &CleanOptions::default(), progress)?;
    if fills_a_volume(&cleaned) {
        return Err(Error::Unsupported(
            "the points fill a volume, and a surface has none to follow: scan the surface only, or take the points on \
             the outside"
                .into(),
        ));
    }
    let mut rejected = std::mem::take(&mut cleaned.rejected);
    let [lo, hi] = nurbskin_geometry::point_grid::bounding_box(&cleaned.points);
    let (spacing, noise) = (cleaned.spacing, cleaned.noise);
    let tolerance = Tolerance::choose(options, scan.unit, noise, lo.distance(hi));
    progress.check()?;
    // 2. Its parts.
    let scrap = if objects > 0 {
        SCENE_SCRAP_SHARE
    } else {
        SCRAP_SHARE
    };
    let (pieces, mut scraps) = cleaned.split(scrap);
    let least = pieces.first().map_or(0, |main| main.points.len());
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a part of a count"
    )]
    let least = (scrap * least as f64).ceil() as usize;
    // 3. A surface for each of them, and for pieces that turn out not to be connected with them.
    let mut queue = VecDeque::from(pieces);
    let mut said: Vec<(usize, usize, Notes)> = Vec::new();
    let mut number = 0;
    let mut parts = Vec::new();
    let mut refusals: Vec<Error> = Vec::new();
    while let Some(piece) = queue.pop_front() {
        number += 1;
        let count = piece.points.len();
        let mut left_out_because = |why: String| {
            let mut notes = Notes::default();
            notes.warn(format!("left out: {why}"));
            said.push((number, count, notes));
        };
        if number > MAX_PARTS {
            left_out_because("there are too many parts; cut the scan up".into());
            leave_out(&piece, &mut rejected);
            continue;
        }
        match part::fit(&piece, vertices, least, &tolerance, options, progress) {
            Ok(mut made) => {
                made.part.trim(options, &mut made.notes)?;
                said.push((number, count, made.notes));
                rejected.extend(made.lost);
                parts.push(made.part);
                let (rest, bits) = piece.rest(&made.detached, least);
                queue.extend(rest);
                scraps.extend(bits);
            }
            Err(why @ (Error::Unsupported(_) | Error::NoSolution(_) | Error::Invalid(_))) => {
                left_out_because(why.to_string());
                leave_out(&piece, &mut rejected);
                refusals.push(why);
            }
            Err(other) => return Err(other),
        }
    }
    let mut notes = Notes::default();
    if objects > 0 {
        notes.warn(format!(
            "the scan shows a scene, which is not one surface: {} on or before something else; each piece that stands clear \
             of the others is fitted by itself, the largest first",
            counted(objects, "object stands", "objects stand")
        ));
    }
    if !scraps.is_empty() {
        let count: usize = scraps.iter().map(|scrap| scrap.indices.len()).sum();
        let finite = scan.points.iter().filter(|p| p.is_finite()).count();
        let said = format!(
            "{} of the points ({} of {}) are left out: they are in {}",
            percent(count as f64 / finite as f64),
            grouped(count),
            grouped(finite),
            counted(
                scraps.len(),
                "small separate piece",
                "small separate pieces"
            ),
        );
        notes.warn(said);
    }
    for (part, count, said) in said {
        notes.append(match number {
            1 => said,
            _ => said.map(|what| {
                format!(
                    "part {part} ({}): {what}",
                    counted(count, "point", "points")
                )
            }),
        });
    }
    if parts.is_empty() {
        return Err(none(refusals));
    }
    for index in scraps.into_iter().flat_map(|scrap| scrap.indices) {
        rejected.push(Rejected {
            index: index as usize,
            reason: Reason::LeftOut,
        });
    }
    rejected.sort_by_key(|r| r.index);
    Ok(Surfaces {
        parts,
        tolerance,
        grid: None,
        resampled: false,
        objects,
        rejected,
        spacing,
        noise,
        notes,
    })
}

/// The error where no part got a surface.
fn none(refusals: Vec<Error>) -> Error {
    let count = refusals.len();
    match refusals.into_iter().next() {
        None => Error::NoSolution(
            "no part of the scan has points enough for a surface: scan more densely".into(),
        ),
        Some(only) if count == 1 => only,
        Some(first) => Error::Unsupported(format!(
            "none of the {count} separate parts can be fitted; the largest: {first}"
        )),
    }
}

fn leave_out(piece: &CleanScan, rejected: &mut Vec<Rejected>) {
    rejected.extend(piece.used.iter().map(|&index| Rejected {
        index: index as usize,
        reason: Reason::LeftOut,
    }));
}

//! The outcome of a fit, assembled from the chosen attempt.
//!
//! Last stage of a fit: it combines the surfaces, their model and the assessment into an [`Outcome`], with summaries,
//! warnings, details and the verdict. It computes no geometry.

use super::Options;
use super::attempt::Attempt;
use super::networks;
use super::outcome::{
    Aim, Closed, DeviationSummary, Input, Outcome, PartSummary, RejectedCounts, SCHEMA,
    SurfaceSummary, Times,
};
use super::sanity::{self, FitFacts};
use super::trade::Trade;
use crate::deviation::measure::{Unused, measure_model};
use crate::surfacing::{FaceLayout, Part, PartShape, Rarefaction, Surfaces};
use glam::DVec3;
use nurbskin_cad::{ClosestOnModel, Model, curvature_variation};
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::UnitSource;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::{Organisation, Reason, Rejected, Scan};
use std::ops::Range;

/// The outcome of an attempt, without its times; `name` is the name of the scan.
///
/// # Errors
/// [`Error::NoSolution`] if there is no surface; [`Error::Cancelled`].
pub(super) fn outcome(
    mut scan: Scan,
    name: &str,
    attempt: Attempt,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Outcome> {
    let Attempt {
        surfaces: mut fitted,
        model,
        mut assessed,
    } = attempt;
    let notes = notes(&mut scan, &mut fitted, options);
    let (unit, origin) = (scan.unit, scan.origin);
    let counts = RejectedCounts::of(&fitted.rejected);
    let rejected = rejected_points(&scan, &fitted);
    let surfaces: Vec<SurfaceSummary> = fitted
        .parts
        .iter()
        .zip(&assessed.parts)
        .zip(fitted.faces())
        .map(|((part, assessed), faces)| {
            let trade = Trade::new(part, &assessed.measured, &fitted, options);
            summary(part, trade, &model, faces)
        })
        .collect::<Result<_>>()?;
    let parts: Vec<PartSummary> = fitted
        .parts
        .iter()
        .zip(&assessed.parts)
        .zip(&surfaces)
        .map(|((part, assessed), surface)| PartSummary {
            surface: surface.clone(),
            points: part.points.len(),
            scan_to_surface: assessed.measured.statistics,
            verdict: assessed.judged.verdict,
            reason: assessed.judged.clone().moved(origin).reason(unit),
            reasons: assessed.judged.clone().moved(origin).reasons,
        })
        .collect();
    let mut judged = assessed.judged.clone().moved(origin);
    let facts = FitFacts {
        points: scan.points.len() - counts.non_finite,
        rejected: counts,
        beyond: fitted.parts.iter().map(|part| part.shape.beyond()).sum(),
        unsupported: assessed.coverage.unsupported_area,
        unit,
        unit_source: scan.unit_source,
        extents: fitted.extents(),
        options,
    };
    for (verdict, reason) in sanity::of_fit(&facts) {
        judged.add(verdict, reason);
    }
    let edges = networks::edges(&fitted, &model);
    let tolerance = fitted.tolerance.asked();
    let mut per_point = assessed.take_per_point(&mut fitted);
    per_point.unused = unused(&scan, &fitted, &model, progress)?;
    per_point.records = std::mem::take(&mut scan.records);
    let (Some(first), Some(surface)) = (fitted.parts.first(), surfaces.into_iter().next()) else {
        return Err(Error::NoSolution(
            "no part of the scan could be fitted".into(),
        ));
    };
    Ok(Outcome {
        nurbskin: env!("CARGO_PKG_VERSION").into(),
        schema: SCHEMA,
        input: Input {
            path: name.to_owned(),
            format: scan.format,
            points: scan.points.len(),
            used: per_point.points.len(),
            rejected: counts,
            organisation: scan.organisation.name().into(),
            grid: fitted.grid,
            unit: scan.unit,
            unit_source: scan.unit_source,
            bounding_box: nurbskin_geometry::point_grid::bounding_box(&per_point.points)
                .map(|corner| (corner + scan.origin).to_array()),
            spacing: Some(fitted.spacing),
            noise: Some(fitted.noise),
            scene_objects: fitted.objects,
        },
        surface,
        parts: if parts.len() > 1 { parts } else { Vec::new() },
        method: first.method.name().into(),
        tolerance,
        within: fitted.asked(&options.surfacing).map(|asked| asked.within),
        aim: Aim {
            value: fitted.tolerance.value,
            source: fitted.tolerance.source,
        },
        deviation: DeviationSummary {
            scan_to_surface: assessed.statistics,
            free_edges: assessed.free_edges,
            surface_to_scan: assessed.coverage,
            hold_out: assessed.hold_out,
            all_points: Some(per_point.statistics_of_all(assessed.statistics, tolerance)),
            worst: per_point.worst(scan.origin),
        },
        verdict: judged.verdict,
        reason: judged.reason(unit),
        reasons: judged.reasons,
        time: Times::default(),
        outputs: Vec::new(),
        check: None,
        warnings: notes.warnings,
        details: notes.details,
        per_point,
        rejected,
        model,
        edges,
        geometry: (fitted.parts.into_iter())
            .flat_map(|part| part.shape.into_surfaces())
            .collect(),
        origin: scan.origin,
    })
}

/// Summary of the surface or network of a part, with its trade-off curve; `faces` are its faces in the model.
fn summary(
    part: &Part,
    trade: Trade,
    model: &Model,
    faces: Range<usize>,
) -> Result<SurfaceSummary> {
    let faces = model.faces().get(faces).unwrap_or_default();
    let variation = faces.iter().map(curvature_variation).sum();
    let common = SurfaceSummary {
        layout: FaceLayout::Single,
        topology: None,
        degree: [0; 2],
        control_points: Vec::new(),
        rational: false,
        closed: Closed::Directions([false; 2]),
        periodic: [false; 2],
        trimmed: part.shape.is_trimmed(),
        kept: None,
        parameters: None,
        curvature_variation: variation,
        trade: trade.curve,
        knee: trade.knee,
        neighbours: trade.neighbours,
        ended: part.not_met.clone(),
        faces: None,
        control_points_total: None,
        edges: None,
        normal_jump: None,
        genus: None,
        borders: None,
    };
    let single = match &part.shape {
        PartShape::Network(part) => return networks::summary(part, common),
        PartShape::Single(single) => single,
    };
    Ok(SurfaceSummary {
        topology: Some(single.topology),
        degree: single.surface.degree(),
        control_points: single.surface.distinct_counts().to_vec(),
        rational: single.surface.is_rational(),
        closed: Closed::Directions(single.topology.closed()),
        periodic: single.surface.periodic(),
        kept: single.kept,
        parameters: single.parameters.map(Into::into),
        ..common
    })
}

/// Warnings: assumptions of the reader, choices of the fit, and options that could not be honoured.
fn notes(scan: &mut Scan, fitted: &mut Surfaces, options: &Options) -> Notes {
    let mut notes = Notes {
        warnings: std::mem::take(&mut scan.warnings),
        details: Vec::new(),
    };
    notes.append(std::mem::take(&mut fitted.notes));
    let singles = fitted.parts.iter().filter_map(|part| part.shape.single());
    // Exact conics have a degree of their own.
    let mut degrees = singles
        .filter(|single| !single.surface.is_rational())
        .map(|single| single.surface.degree());
    if let Some([p, q]) = degrees.find(|degree| *degree != options.surfacing.degree) {
        notes.warn(format!(
            "the points are too few for degree {} x {}: degree {p} x {q} is used",
            options.surfacing.degree[0], options.surfacing.degree[1]
        ));
    }
    let unordered = !scan.organisation.is_ordered();
    if unordered && options.surfacing.enrich > 0 {
        notes.warn(no_effect("enrichment"));
    }
    if unordered && options.surfacing.rarefy != Rarefaction::Auto {
        notes.warn(no_effect("rarefaction"));
    }
    if unordered && options.surfacing.parameters.is_some() {
        notes.warn(no_effect("choice of parameters"));
    }
    let is_grid = matches!(scan.organisation, Organisation::Grid(_));
    let counts = RejectedCounts::of(&fitted.rejected);
    sanity::ignored(scan.points.len(), counts, is_grid, &mut notes);
    if let Some(doubt) = sanity::doubtful_unit(scan.unit_source, scan.unit, fitted.extents()) {
        notes.warnings.insert(0, doubt.words_with_next());
    } else if scan.unit_source == UnitSource::Assumed {
        notes.warn(match &*scan.format {
            nurbskin_scan::io::ARRAY => format!("the array has no unit: {} is assumed", scan.unit),
            _ => format!(
                "the file does not say its unit: {} is assumed (say --unit)",
                scan.unit
            ),
        });
    }
    notes
}

/// Warning about an option for ordered points that has no effect on other points.
fn no_effect(what: &str) -> String {
    format!("the {what} has no effect: it applies to ordered points only")
}

/// The points that are not used, in the order of the file, each finite one with its deviation from the model.
fn unused(
    scan: &Scan,
    fitted: &Surfaces,
    model: &Model,
    progress: &dyn Progress,
) -> Result<Vec<Unused>> {
    let of = |r: &Rejected| {
        Some(Unused {
            index: u32::try_from(r.index).ok()?,
            point: *scan.points.get(r.index)?,
            reason: r.reason,
            deviation: None,
        })
    };
    let mut found: Vec<Unused> = fitted.rejected.iter().filter_map(of).collect();
    found.sort_by_key(|point| point.index);
    let finite = |point: &&mut Unused| point.point.is_finite();
    let points: Vec<DVec3> = found.iter_mut().filter(finite).map(|p| p.point).collect();
    if points.is_empty() {
        return Ok(found);
    }
    progress.stage("deviation", Some(points.len() as u64));
    let target = ClosestOnModel::new(model)?;
    let measured = measure_model(&target, &points, None, None, progress)?;
    let places = found.iter_mut().filter(finite);
    for (place, deviation) in places.zip(measured.points) {
        place.deviation = Some(deviation);
    }
    Ok(found)
}

/// The points rejected by position, with their indices.
fn rejected_points(scan: &Scan, fitted: &Surfaces) -> Vec<(u32, DVec3)> {
    let placed = |r: &&Rejected| matches!(r.reason, Reason::Outlier | Reason::LeftOut);
    let rejected = fitted.rejected.iter().filter(placed);
    let point = |r: &Rejected| Some((u32::try_from(r.index).ok()?, *scan.points.get(r.index)?));
    rejected.filter_map(point).collect()
}

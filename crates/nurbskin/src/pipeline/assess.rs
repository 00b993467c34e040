//! Measures the surfaces of a scan against its points, and judges the result.
//!
//! The stage measures the deviation of every point from the trimmed faces of its part, the distance of the faces to the scan, and
//! the coverage. It derives one verdict per part and one for the whole scan, each with reasons and remedies.

use super::{Options, PerPoint};
use crate::deviation::coverage::{Coverage, Covered, CoveredFace, coverage_near};
use crate::deviation::measure::{Deviation, Place, PointDeviation, Statistics, measure_model};
use crate::deviation::verdict::{Asked, Judgement, Reason, Resolution, Verdict, judge};
use crate::surfacing::{Part, Surfaces};
use nurbskin_cad::{ClosestOnModel, Model};
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::{Unit, percent};
use nurbskin_scan::Records;
use rayon::join;
use std::ops::Range;

/// An advised tolerance exceeds the measured distance by the rounding of the displayed digits.
const ROUNDED_UP: f64 = 1.005;

/// The measured surfaces of a scan.
pub(super) struct Assessed {
    pub(super) statistics: Statistics,
    pub(super) free_edges: Statistics,
    pub(super) coverage: Coverage,
    pub(super) hold_out: Option<Statistics>,
    pub(super) judged: Judgement,
    /// One entry per part.
    pub(super) parts: Vec<AssessedPart>,
}

/// One surface, measured against the points of its part.
pub(super) struct AssessedPart {
    pub(super) measured: Deviation,
    pub(super) judged: Judgement,
}

impl Assessed {
    /// Measures the trimmed faces of the parts, in the order of the parts.
    pub(super) fn new(
        fitted: &Surfaces,
        model: &Model,
        options: &Options,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let count: usize = fitted.parts.iter().map(|part| part.points.len()).sum();
        progress.stage("deviation", Some(count as u64));
        let asked = fitted.asked(&options.surfacing);
        let tolerance = fitted.tolerance.asked();
        let regions = fitted.regions()?;
        let face = |surface, region| CoveredFace { surface, region };
        let covered: Vec<Covered> = fitted
            .parts
            .iter()
            .zip(&regions)
            .map(|(part, region)| Covered {
                faces: (part.shape.surfaces())
                    .map(|surface| face(surface, region.as_ref()))
                    .collect(),
                points: &part.points,
                triangles: part.triangles.as_deref(),
                spacing: part.spacing,
            })
            .collect();
        // Both tasks have serial sections, so they run concurrently.
        let (parts, coverage) = join(
            || {
                let parts = fitted.parts.iter().zip(fitted.faces());
                parts
                    .map(|(part, faces)| {
                        AssessedPart::new(part, (model, faces), asked, options, progress)
                    })
                    .collect::<Result<Vec<_>>>()
            },
            || -> Result<Coverage> {
                progress.check()?;
                let near = fitted.parts.iter().map(Part::nearest);
                Ok(coverage_near(
                    &covered.into_iter().zip(near).collect::<Vec<_>>(),
                ))
            },
        );
        let (parts, coverage) = (parts?, coverage?);
        progress.check()?;
        let places = || fitted.parts.iter().zip(&parts);
        let of = |wanted: &dyn Fn(&PointDeviation, bool) -> bool| {
            let chosen: Vec<PointDeviation> = places()
                .flat_map(|(part, assessed)| assessed.measured.points.iter().zip(&part.held_out))
                .filter(|(point, out)| wanted(point, **out))
                .map(|(point, _)| *point)
                .collect();
            Statistics::new(&chosen, tolerance)
        };
        let held_out = fitted
            .parts
            .iter()
            .any(|part| part.held_out.contains(&true));
        let (statistics, free_edges) = match parts.as_slice() {
            [only] => (only.measured.statistics, only.measured.free_edges),
            _ => (
                of(&|_, _| true),
                of(&|point, _| point.place == Place::FreeEdge),
            ),
        };
        let this = Self {
            statistics,
            free_edges,
            coverage,
            hold_out: held_out.then(|| of(&|_, out| out)),
            judged: overall(&parts, tolerance, &statistics),
            parts,
        };
        Ok(this)
    }

    /// The deviation of every used point in the order of the file; moved out of the parts.
    pub(super) fn take_per_point(&mut self, fitted: &mut Surfaces) -> PerPoint {
        use std::mem::take;
        // The search trees are dropped, too.
        for part in &mut fitted.parts {
            part.forget_nearest();
        }
        if let ([part], [assessed]) = (&mut fitted.parts[..], &mut self.parts[..])
            && part.used.is_sorted()
        {
            return PerPoint {
                indices: take(&mut part.used),
                points: take(&mut part.points),
                deviation: take(&mut assessed.measured.points),
                held_out: take(&mut part.held_out),
                triangles: take(&mut part.triangles).unwrap_or_default(),
                unused: Vec::new(),
                records: Records::default(),
            };
        }
        // For each point: its index in the file, its part, and its index within the part.
        let parts = fitted.parts.iter().enumerate();
        let places = parts.flat_map(|(p, part)| {
            let used = part.used.iter().enumerate();
            used.map(move |(k, &index)| (index, p, k))
        });
        let mut all: Vec<(u32, usize, usize)> = places.collect();
        all.sort_by_key(|row| row.0);
        let row = |index: u32| {
            let found = all.binary_search_by_key(&index, |row| row.0).ok()?;
            u32::try_from(found).ok()
        };
        let mut triangles = Vec::new();
        for part in &fitted.parts {
            let of = part.triangles.iter().flatten();
            triangles.extend(of.filter_map(|corners| {
                let [a, b, c] = corners.map(|k| row(*part.used.get(k as usize)?));
                Some([a?, b?, c?])
            }));
        }
        PerPoint {
            triangles,
            unused: Vec::new(),
            records: Records::default(),
            indices: all.iter().map(|row| row.0).collect(),
            points: all
                .iter()
                .map(|&(_, p, k)| fitted.parts[p].points[k])
                .collect(),
            deviation: all
                .iter()
                .map(|&(_, p, k)| self.parts[p].measured.points[k])
                .collect(),
            held_out: all
                .iter()
                .map(|&(_, p, k)| fitted.parts[p].held_out[k])
                .collect(),
        }
    }
}

impl AssessedPart {
    fn new(
        part: &Part,
        (model, faces): (&Model, Range<usize>),
        asked: Option<Asked>,
        options: &Options,
        progress: &dyn Progress,
    ) -> Result<Self> {
        progress.check()?;
        let first = faces.start;
        let target = ClosestOnModel::of_faces(model, &faces.collect::<Vec<_>>())?;
        let starts = part.shape.starts(first);
        let measured = measure_model(
            &target,
            &part.points,
            starts.as_deref(),
            asked.map(|asked| asked.tolerance),
            progress,
        )?;
        progress.check()?;
        let [low, high] = nurbskin_geometry::point_grid::bounding_box(&part.points);
        let resolution = Resolution {
            noise: Some(part.noise),
            spacing: part.spacing,
            extent: low.distance(high),
            unit: model.unit,
        };
        let mut judged = judge(&measured, &part.points, asked, resolution);
        if let (Verdict::Fail, Some(asked)) = (judged.verdict, asked) {
            let next = closer(&measured, asked, options, model.unit);
            for reason in judged.reasons.iter_mut().filter(|r| r.next.is_none()) {
                reason.next = Some(next.clone());
            }
            if let (Some(why), Some(first)) = (&part.not_met, judged.reasons.first_mut()) {
                first.what = format!("{}; {why}", first.what);
            }
        }
        Ok(Self { measured, judged })
    }
}

/// The remedy for a surface that misses its tolerance.
fn closer(measured: &Deviation, asked: Asked, options: &Options, unit: Unit) -> String {
    let mut distances: Vec<f64> = measured.points.iter().map(|p| p.upper).collect();
    // Rounded up, so that the tolerance is kept as it is written.
    let kept = ROUNDED_UP * quantile_in_place(&mut distances, asked.within);
    let looser = format!(
        "a tolerance of {} (-t), which {} of the points keep",
        unit.length(kept),
        percent(asked.within)
    );
    match options.surfacing.max_control_points {
        Some(budget) => {
            format!("allow more than {budget} control points (--max-control-points), or {looser}")
        }
        None => format!("allow {looser}"),
    }
}

/// The verdict of all parts: the worst one, with the reasons of every part that has some.
fn overall(parts: &[AssessedPart], tolerance: Option<f64>, all: &Statistics) -> Judgement {
    if let [only] = parts {
        return only.judged.clone();
    }
    let Some(worst) = parts.iter().max_by_key(|p| p.judged.verdict.gravity()) else {
        return Judgement {
            verdict: Verdict::CannotTell,
            summary: "there is no surface".into(),
            reasons: vec![Reason::new("there is no surface")],
        };
    };
    let verdict = worst.judged.verdict;
    let count = parts.len();
    let within = match (tolerance, all.within_tolerance) {
        (Some(_), Some(share)) => format!(
            "{count} parts: {} of all points are within the tolerance",
            percent(share)
        ),
        _ => format!("no tolerance was given; {count} parts"),
    };
    let worst = parts.iter().enumerate().max_by(|a, b| {
        let [a, b] = [a, b].map(|(_, part)| part.measured.statistics.max);
        a.total_cmp(&b)
    });
    let mut judged = Judgement {
        verdict,
        summary: match worst {
            Some((k, part)) => format!(
                "{within}; the worst is part {}: {}",
                k + 1,
                part.judged.summary
            ),
            None => within,
        },
        reasons: Vec::new(),
    };
    let mut grave: Vec<(usize, &AssessedPart)> = parts.iter().enumerate().collect();
    grave.sort_by_key(|(_, part)| std::cmp::Reverse(part.judged.verdict.gravity()));
    for (k, part) in grave {
        judged
            .reasons
            .extend(part.judged.reasons.iter().map(|reason| Reason {
                what: format!("part {} of {}: {}", k + 1, parts.len(), reason.what),
                ..reason.clone()
            }));
    }
    judged
}

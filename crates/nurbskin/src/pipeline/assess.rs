//! Surfaces measured against their scan, and judged.

use super::fitted::{Fitted, Part};
use super::{Options, PerPoint, Times};
use crate::Result;
use crate::cad::{ClosestOnModel, Model};
use crate::deviation::coverage::{Coverage, Covered, CoveredFace, coverage_near};
use crate::deviation::measure::{Deviation, Place, PointDeviation, Statistics, measure_model};
use crate::deviation::verdict::{Asked, Judgement, Reason, Resolution, Verdict, judge};
use crate::numeric::tasks::join;
use crate::progress::Progress;
use std::time::Instant;

/// The surfaces of a scan, measured.
pub(super) struct Assessed {
    pub(super) statistics: Statistics,
    pub(super) free_edges: Statistics,
    pub(super) coverage: Coverage,
    pub(super) hold_out: Option<Statistics>,
    pub(super) judged: Judgement,
    /// Each part on its own.
    pub(super) parts: Vec<AssessedPart>,
}

/// One surface, measured against its own points.
pub(super) struct AssessedPart {
    pub(super) measured: Deviation,
    pub(super) judged: Judgement,
}

impl Assessed {
    /// With the faces of the parts, in their order, as they are trimmed.
    pub(super) fn new(
        fitted: &Fitted,
        model: &Model,
        options: &Options,
        progress: &dyn Progress,
        times: &mut Times,
    ) -> Result<Self> {
        let start = Instant::now();
        let count: usize = fitted.parts.iter().map(|part| part.points.len()).sum();
        progress.stage("deviation", Some(count as u64));
        let asked = fitted.asked(options);
        let tolerance = fitted.tolerance.asked();
        let regions = fitted.regions()?;
        let covered: Vec<Covered> = fitted
            .parts
            .iter()
            .zip(&regions)
            .map(|(part, region)| Covered {
                faces: vec![CoveredFace {
                    surface: &part.surface,
                    region: region.as_ref(),
                }],
                points: &part.points,
                triangles: part.triangles.as_deref(),
                spacing: part.spacing,
            })
            .collect();
        // Both have pieces that only one core can work on.
        let (parts, coverage) = join(
            || {
                let parts = fitted.parts.iter().enumerate();
                parts
                    .map(|(k, part)| AssessedPart::new(part, model, k, asked, progress))
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
            judged: overall(&parts),
            parts,
        };
        times.deviation += start.elapsed().as_secs_f64();
        Ok(this)
    }

    /// Every point with its deviation, in the order of the file; taken from the parts.
    pub(super) fn take_per_point(&mut self, fitted: &mut Fitted) -> PerPoint {
        use std::mem::take;
        // What finds places among them goes, too.
        for part in &mut fitted.parts {
            part.near.take();
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
            };
        }
        // The index of each point in the file, its part, and its place there.
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
        model: &Model,
        face: usize,
        asked: Option<Asked>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        progress.check()?;
        let target = ClosestOnModel::of_faces(model, &[face])?;
        let starts: Option<Vec<_>> = part
            .feet
            .as_ref()
            .map(|feet| feet.iter().map(|&place| (face, place)).collect());
        let measured = measure_model(
            &target,
            &part.points,
            starts.as_deref(),
            asked.map(|asked| asked.tolerance),
            progress,
        )?;
        progress.check()?;
        let [low, high] = crate::point_grid::bounding_box(&part.points);
        let resolution = Resolution {
            noise: Some(part.noise),
            spacing: part.spacing,
            extent: low.distance(high),
            unit: model.unit,
        };
        let mut judged = judge(&measured, &part.points, asked, resolution);
        if let (Some(why), Verdict::Fail, Some(first)) =
            (&part.not_met, judged.verdict, judged.reasons.first_mut())
        {
            first.next.get_or_insert_with(|| why.clone());
        }
        Ok(Self { measured, judged })
    }
}

/// A scan passes if all its parts do; otherwise the first that failed, or else could not be told, speaks.
fn overall(parts: &[AssessedPart]) -> Judgement {
    let worst = [Verdict::Fail, Verdict::CannotTell, Verdict::NotAsked]
        .into_iter()
        .find_map(|verdict| parts.iter().position(|p| p.judged.verdict == verdict))
        .unwrap_or(0);
    let Some(part) = parts.get(worst) else {
        return Judgement {
            verdict: Verdict::CannotTell,
            summary: "there is no surface".into(),
            reasons: vec![Reason::new("there is no surface")],
        };
    };
    let mut judged = part.judged.clone();
    if parts.len() > 1 {
        let alike = parts.iter().filter(|p| p.judged.verdict == judged.verdict);
        let which = format!(
            "{} of {} parts: part {}",
            alike.count(),
            parts.len(),
            worst + 1
        );
        judged.summary = format!("{which}: {}", judged.summary);
        for reason in &mut judged.reasons {
            reason.what = format!("{which}: {}", reason.what);
        }
    }
    judged
}

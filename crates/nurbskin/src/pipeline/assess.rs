//! Surfaces measured against their scan, and judged.

use super::fitted::{Fitted, Part};
use super::{PerPoint, Times};
use crate::Result;
use crate::deviation::coverage::{Coverage, Covered, coverage_of_all};
use crate::deviation::measure::{Deviation, Outside, Place, PointDeviation, Statistics, measure};
use crate::deviation::verdict::{Judgement, Resolution, Verdict, judge};
use crate::nurbs::closest::ClosestPoint;
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
    pub(super) fn new(fitted: &Fitted, progress: &dyn Progress, times: &mut Times) -> Result<Self> {
        let start = Instant::now();
        let count: usize = fitted.parts.iter().map(|part| part.points.len()).sum();
        progress.stage("deviation", Some(count as u64));
        let tolerance = fitted.tolerance.value;
        let parts = fitted
            .parts
            .iter()
            .map(|part| AssessedPart::new(part, tolerance, progress))
            .collect::<Result<Vec<_>>>()?;
        let regions = fitted.regions()?;
        let covered: Vec<Covered> = fitted
            .parts
            .iter()
            .zip(&regions)
            .map(|(part, region)| Covered {
                surface: &part.surface,
                points: &part.points,
                triangles: part.triangles.as_deref(),
                spacing: part.spacing,
                region: region.as_ref(),
            })
            .collect();
        let coverage = coverage_of_all(&covered);
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

    /// Every point with its deviation, in the order of the file.
    pub(super) fn per_point(&self, fitted: &Fitted) -> PerPoint {
        let mut all = Vec::new();
        for (face, (part, assessed)) in (0_u32..).zip(fitted.parts.iter().zip(&self.parts)) {
            let rows = part.used.iter().zip(&part.points);
            let rows = rows.zip(&assessed.measured.points).zip(&part.held_out);
            all.extend(rows.map(|(((&index, &point), &d), &out)| (index, point, d, face, out)));
        }
        all.sort_by_key(|row| row.0);
        PerPoint {
            indices: all.iter().map(|row| row.0).collect(),
            points: all.iter().map(|row| row.1).collect(),
            deviation: all.iter().map(|row| row.2).collect(),
            faces: all.iter().map(|row| row.3).collect(),
            held_out: all.iter().map(|row| row.4).collect(),
        }
    }
}

impl AssessedPart {
    fn new(part: &Part, tolerance: f64, progress: &dyn Progress) -> Result<Self> {
        progress.check()?;
        let closest = ClosestPoint::new(&part.surface)?;
        let measured = measure(
            &closest,
            &part.points,
            part.feet.as_deref(),
            tolerance,
            Outside::Normal,
            progress,
        )?;
        progress.check()?;
        let resolution = Resolution {
            noise: part.noise,
            spacing: part.spacing,
        };
        let mut judged = judge(&measured, tolerance, resolution);
        if let (Some(why), Verdict::Fail) = (&part.not_met, judged.verdict) {
            judged.reason = format!("{}; {why}", judged.reason);
        }
        Ok(Self { measured, judged })
    }
}

/// A scan passes if all its parts do; otherwise the first that failed, or else could not be told, speaks.
fn overall(parts: &[AssessedPart]) -> Judgement {
    let worst = [Verdict::Fail, Verdict::CannotTell, Verdict::Pass]
        .into_iter()
        .find_map(|verdict| parts.iter().position(|p| p.judged.verdict == verdict))
        .unwrap_or(0);
    let Some(part) = parts.get(worst) else {
        return Judgement {
            verdict: Verdict::CannotTell,
            reason: "there is no surface".into(),
        };
    };
    let mut judged = part.judged.clone();
    if parts.len() > 1 {
        let alike = parts.iter().filter(|p| p.judged.verdict == judged.verdict);
        judged.reason = format!(
            "{} of {} parts: part {}: {}",
            alike.count(),
            parts.len(),
            worst + 1,
            judged.reason
        );
    }
    judged
}

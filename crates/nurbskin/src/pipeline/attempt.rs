//! Surfaces of a scan, their model, and its deviation; tried again with other options where that promises more.

use super::Options;
use super::assess::Assessed;
use crate::surfacing::{Method, Rarefaction, Surfaces, SurfacingOptions, surfaces};
use nurbskin_cad::Model;
use nurbskin_geometry::Result;
use nurbskin_geometry::progress::Progress;
use nurbskin_scan::Scan;

/// Least squares may do better than interpolation of resampled rows, but not by more than this.
const NEAR_MISS: f64 = 10.0;

/// So many times the points that may be beyond a tolerance are what trimming may cost; more has another cause.
const FEW_MORE: f64 = 1.5;
/// Parts of what may be beyond that are tried then, one after the other.
const STRICTER: [f64; 2] = [0.8, 0.5];

/// The surfaces of a scan, measured.
pub(super) struct Attempt {
    pub(super) surfaces: Surfaces,
    pub(super) model: Model,
    pub(super) assessed: Assessed,
}

impl Attempt {
    /// With these options as they are.
    fn new(scan: &Scan, options: &Options, progress: &dyn Progress) -> Result<Self> {
        let asked = SurfacingOptions {
            // Whoever says how the points lie wants no cloud of them.
            keeps_order: options.input.grid.is_some(),
            ..options.surfacing.clone()
        };
        let surfaces = surfaces(scan, &asked, progress)?;
        let model = surfaces.model("", scan.unit)?;
        let assessed = Assessed::new(&surfaces, &model, options, progress)?;
        Ok(Self {
            surfaces,
            model,
            assessed,
        })
    }

    /// The best of what the options allow.
    pub(super) fn best(scan: &Scan, options: &Options, progress: &dyn Progress) -> Result<Self> {
        let mut best = Self::new(scan, options, progress)?;
        if let Some(instead) = best.by_least_squares(options) {
            let other = Self::new(scan, &instead, progress)?;
            if other.assessed.statistics.max < best.assessed.statistics.max {
                best = other;
            }
        }
        for part in STRICTER {
            if let Some(instead) = best.stricter(options, part) {
                let other = Self::new(scan, &instead, progress)?;
                let within = |tried: &Self| tried.assessed.statistics.within_tolerance;
                if within(&other) > within(&best) {
                    best = other;
                }
            }
        }
        best.surfaces.check_budget(&options.surfacing)?;
        Ok(best)
    }

    /// Rows of different length are interpolated at points between their own. Where that costs the tolerance, least squares
    /// through their own points may keep it: the options for that, if it is worth a try.
    fn by_least_squares(&self, options: &Options) -> Option<Options> {
        let Self {
            surfaces: fitted,
            assessed,
            ..
        } = self;
        let chosen = options.surfacing.method == Method::Auto
            && options.surfacing.rarefy == Rarefaction::Auto
            && options.surfacing.enrich == 0
            && fitted
                .parts
                .iter()
                .all(|part| part.method == Method::Interpolate);
        let near = assessed.statistics.max <= NEAR_MISS * fitted.tolerance.value;
        let missed = assessed.statistics.max > fitted.tolerance.value;
        // A tolerance that was asked for may cost more control points.
        let as_many = match options.surfacing.tolerance {
            None => Some(fitted.control_points()),
            Some(_) => None,
        };
        (chosen && near && missed && fitted.resampled).then(|| Options {
            surfacing: SurfacingOptions {
                method: Method::Approximate,
                max_control_points: options.surfacing.max_control_points.or(as_many),
                ..options.surfacing.clone()
            },
            ..options.clone()
        })
    }
    /// A fit measures to the whole surface; where that is then trimmed, a few points are farther off. Where those cost the share
    /// that was asked for, though the fit had reached it: the options with a share of which only this part is used.
    fn stricter(&self, options: &Options, part: f64) -> Option<Options> {
        let Self {
            surfaces: fitted,
            assessed,
            ..
        } = self;
        let asked = fitted.asked(&options.surfacing)?;
        let reached = fitted.parts.iter().all(|part| part.not_met.is_none());
        let is_cut = fitted.parts.iter().any(|part| part.trimming.is_some());
        let allowed = 1.0 - asked.within;
        let beyond = 1.0 - assessed.statistics.within_tolerance?;
        let few = allowed > 0.0 && beyond > allowed && beyond <= FEW_MORE * allowed;
        (reached && is_cut && few).then(|| Options {
            surfacing: SurfacingOptions {
                within: Some(1.0 - part * allowed),
                ..options.surfacing.clone()
            },
            ..options.clone()
        })
    }
}

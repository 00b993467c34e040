//! One attempt at a fit: the surfaces of a scan, their model, and the measured deviation.
//!
//! [`Attempt::best`] repeats the fit with other options where the first result suggests an improvement: by least
//! squares where interpolation of resampled rows misses the tolerance, with a stricter share where only the trim costs
//! the required share, and with a network of faces where the trim costs it all the same, or a
//! whole region is off.

use super::Options;
use super::assess::Assessed;
use crate::deviation::verdict::Verdict;
use crate::surfacing::{
    FaceLayout, Method, PartShape, Rarefaction, Surfaces, SurfacingOptions, surfaces,
};
use nurbskin_cad::Model;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::Scan;

/// Least squares may improve on interpolation of resampled rows by at most this factor.
const NEAR_MISS: f64 = 10.0;

/// Trimming explains up to this multiple of the allowed number of points beyond the tolerance; a larger number has
/// another cause.
const FEW_MORE: f64 = 1.5;
/// Fractions of the allowed share beyond the tolerance for the stricter fits, tried in this order.
const STRICTER: [f64; 2] = [0.8, 0.5];

/// Control points of a network, in those of a single surface, beyond which it does not replace it where neither meets the
/// tolerance. Dimensionless. Guard.
const SWELLS: usize = 2;

/// The measured surfaces of a scan.
pub(super) struct Attempt {
    pub(super) surfaces: Surfaces,
    pub(super) model: Model,
    pub(super) assessed: Assessed,
}

/// An attempt that may fail where another one has succeeded.
fn tried(attempt: Result<Attempt>) -> Result<Option<Attempt>> {
    match attempt {
        Ok(attempt) => Ok(Some(attempt)),
        Err(Error::Unsupported(_) | Error::NoSolution(_) | Error::Invalid(_)) => Ok(None),
        Err(other) => Err(other),
    }
}

impl Attempt {
    /// Fits with these options of the surfaces, unchanged, and judges by those that were given.
    fn new(
        scan: &Scan,
        surfacing: &SurfacingOptions,
        options: &Options,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let asked = SurfacingOptions {
            // An explicit grid rules out treatment as a cloud.
            keeps_order: options.input.grid.is_some(),
            ..surfacing.clone()
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

    /// The best attempt that the options allow.
    pub(super) fn best(scan: &Scan, options: &Options, progress: &dyn Progress) -> Result<Self> {
        let mut best = Self::new(scan, &options.surfacing, options, progress)?;
        let was_tried = best.has_tried_network();
        if let Some(instead) = best.by_least_squares(options) {
            let other = Self::new(scan, &instead, options, progress)?;
            if other.assessed.statistics.max < best.assessed.statistics.max {
                best = other;
            }
        }
        for part in STRICTER {
            if let Some(instead) = best.stricter(options, part) {
                let other = Self::new(scan, &instead, options, progress)?;
                let within = |tried: &Self| tried.assessed.statistics.within_tolerance;
                if within(&other) > within(&best) {
                    best = other;
                }
            }
        }
        if !(was_tried || best.has_tried_network())
            && let Some(instead) = best.as_network(options)
            && let Some(other) = tried(Self::new(scan, &instead, options, progress))?
            && other.is_sound()
            && other.is_closer_than(&best, options)
        {
            best = other;
            best.surfaces.notes.details.insert(
                0,
                "one surface was tried first: it fails once it is measured".into(),
            );
        }
        best.surfaces.check_budget(&options.surfacing)?;
        Ok(best)
    }

    /// Options for least squares, if they may help. Interpolation resamples rows of different length; if this costs the
    /// tolerance, least squares through the original points may keep it.
    fn by_least_squares(&self, options: &Options) -> Option<SurfacingOptions> {
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
        // An explicit tolerance may cost more control points.
        let as_many = match options.surfacing.tolerance {
            None => Some(fitted.control_points()),
            Some(_) => None,
        };
        (chosen && near && missed && fitted.resampled).then(|| SurfacingOptions {
            method: Method::Approximate,
            max_control_points: options.surfacing.max_control_points.or(as_many),
            ..options.surfacing.clone()
        })
    }

    /// Options for a network, if it may help: the fit of a single surface kept the tolerance, and what is left of the
    /// surface does not, or is off on a whole region.
    fn as_network(&self, options: &Options) -> Option<SurfacingOptions> {
        let asked = self.surfaces.asked(&options.surfacing)?;
        let [part] = &self.surfaces.parts[..] else {
            return None;
        };
        part.shape.single()?;
        let free = options.surfacing.layout == FaceLayout::Auto
            && options.surfacing.topology.is_none()
            // A budget is meant for one surface.
            && options.surfacing.max_control_points.is_none()
            && self.surfaces.grid.is_none();
        let possible = asked.tolerance >= self.surfaces.tolerance.told(part.noise);
        let missed = self.assessed.statistics.within_tolerance? < asked.within
            || self.assessed.judged.verdict == Verdict::Fail;
        (free && possible && missed).then(|| SurfacingOptions {
            layout: FaceLayout::Network,
            ..options.surfacing.clone()
        })
    }

    /// Whether a network was made beside its single surface, and was of no use.
    fn has_tried_network(&self) -> bool {
        let mut parts = self.surfaces.parts.iter();
        parts.any(|part| part.shape.single().is_some_and(|part| part.network_tried))
    }

    /// Whether no network of it folds or intersects itself.
    fn is_sound(&self) -> bool {
        let mut parts = self.surfaces.parts.iter();
        parts.all(|part| match &part.shape {
            PartShape::Network(part) => part.defects == 0,
            PartShape::Single(_) => true,
        })
    }

    /// Whether this attempt passes and the other one does not; otherwise whether it has more points within the tolerance. Where it
    /// fails, too, it may not take more than [`SWELLS`] times the control points: a tolerance out of reach does not swell the
    /// surface.
    fn is_closer_than(&self, other: &Self, options: &Options) -> bool {
        let [passes, other_passes] =
            [self, other].map(|tried| tried.assessed.judged.verdict == Verdict::Pass);
        if passes != other_passes {
            return passes;
        }
        let fails = self.assessed.judged.verdict == Verdict::Fail;
        let [own, others] = [self, other].map(|tried| tried.assessed.statistics.within_tolerance);
        let asked = self.surfaces.asked(&options.surfacing);
        let met = !fails && asked.is_some_and(|asked| own >= Some(asked.within));
        let few = self.surfaces.control_points() <= SWELLS * other.surfaces.control_points();
        own > others && (met || few)
    }

    /// Options with a stricter share, if they may help. The fit measures distances to the untrimmed surface, and
    /// trimming increases the distance of a few points. If the fit reached the share and only the trim costs it, the
    /// result allows only `part` of the permitted points beyond the tolerance.
    fn stricter(&self, options: &Options, part: f64) -> Option<SurfacingOptions> {
        let Self {
            surfaces: fitted,
            assessed,
            ..
        } = self;
        let asked = fitted.asked(&options.surfacing)?;
        let reached = fitted.parts.iter().all(|part| part.not_met.is_none());
        let is_cut = fitted.parts.iter().any(|part| part.shape.is_trimmed());
        let allowed = 1.0 - asked.within;
        let beyond = 1.0 - assessed.statistics.within_tolerance?;
        let few = allowed > 0.0 && beyond > allowed && beyond <= FEW_MORE * allowed;
        (reached && is_cut && few).then(|| SurfacingOptions {
            within: Some(1.0 - part * allowed),
            // Only a single surface is trimmed: it was the better choice.
            layout: FaceLayout::Single,
            ..options.surfacing.clone()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surfacing::Length;
    use nurbskin_geometry::progress::Silent;
    use nurbskin_scan::simulate::{Order, ScanOptions, Shape, scan};

    /// With a tolerance of three standard deviations of the noise 0.27 % of the points are beyond it.
    #[test]
    fn a_stricter_fit_is_judged_by_the_given_share() {
        let simulated = ScanOptions {
            points: Some(4000),
            noise: 0.1,
            order: Order::Shuffled,
            ..ScanOptions::default()
        };
        let cloud = scan(Shape::Saddle, &simulated).unwrap().scan;
        let given = Options {
            surfacing: SurfacingOptions {
                tolerance: Some(Length::Plain(0.3)),
                ..SurfacingOptions::default()
            },
            ..Options::default()
        };
        let stricter = SurfacingOptions {
            within: Some(0.9999),
            layout: FaceLayout::Single,
            ..given.surfacing.clone()
        };
        let judged = |options: &Options| {
            let attempt = Attempt::new(&cloud, &stricter, options, &Silent).unwrap();
            attempt.assessed.judged.verdict
        };
        assert_eq!(judged(&given), Verdict::Pass);
        let strict = Options {
            surfacing: stricter.clone(),
            ..given.clone()
        };
        assert_ne!(judged(&strict), Verdict::Pass);
    }
}
